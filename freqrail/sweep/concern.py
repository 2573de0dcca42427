"""What is outside its usual range, in words: measured value, criterion, remedy; and the corners of a case's grid."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.case.axis import Axis
from freqrail.case.case import Case
from freqrail.case.criteria import CRITERIA, Criterion
from freqrail.case.samples import SAMPLE
from freqrail.model.band import Band

FORCES = 16  # corners, at most, at which the wheel-rail force is computed, beside the worst that they point to


@dataclass(frozen=True)
class Concern:
    """Something outside its usual range. Numbers in the criterion's unit.

    name: key of `criteria.CRITERIA`. measured: smallest and largest on the grid. usual: the range. accepted: whether
    the case takes it for usual, so that nobody need be warned. text: what, measured, usual, what to do.
    """

    name: str
    measured: tuple[float, float]
    usual: tuple[float, float]
    accepted: bool
    text: str


def corners(case: Case) -> Case:
    """The case with every axis cut to its two ends; samples stay, for their ends hold nothing."""

    def ends(axis: Axis) -> Axis:
        return (
            axis
            if axis.si.size < 3 or axis.name == SAMPLE
            else replace(axis, values=axis.values[[0, -1]], si=axis.si[[0, -1]])
        )

    return replace(case, axes=tuple(map(ends, case.axes)))


def few_samples(case: Case) -> Case:
    """The case with those of its samples in which a parameter is smallest or largest, FORCES of them at most."""
    if case.samples is None:
        return case
    rows = [f(column.si) for f in (np.argmin, np.argmax) for column in case.samples.columns]
    numbers = case.samples.numbers[sorted(dict.fromkeys(map(int, rows)))[:FORCES]]
    samples = case.samples.at(numbers)
    axes = tuple(samples.axis if axis.name == SAMPLE else axis for axis in case.axes)
    return replace(case, samples=samples, axes=axes)


def some_corners(shape: tuple[int, ...]) -> list[tuple[int, ...]]:
    """All corners of a grid of so many ends an axis, or FORCES of them: both ends of every axis half of the time each,
    the four pairs of ends of any two axes a quarter of it (two-level orthogonal array, for up to 15 axes of two ends).
    """
    axes = [axis for axis, ends in enumerate(shape) if ends > 1]
    if math.prod(shape) <= FORCES:
        return list(np.ndindex(shape))
    if max(shape) > 2:  # samples: each once at least, with the others' corners in turn
        longest = max(range(len(shape)), key=lambda axis: shape[axis])
        others = some_corners((*shape[:longest], 1, *shape[longest + 1 :]))
        runs = range(max(FORCES, shape[longest]))
        # a step that shares no factor with their number takes every corner beside many samples
        corners = [others[(run + run // len(others)) % len(others)] for run in runs]
        return [(*c[:longest], run % shape[longest], *c[longest + 1 :]) for run, c in zip(runs, corners, strict=True)]
    # an axis's end is the parity of some bits of the run's number: other bits for every axis, odd numbers of them first
    masks = sorted(range(1, FORCES), key=lambda mask: (mask.bit_count() % 2 == 0, mask.bit_count()))
    bits = dict(zip(axes, masks, strict=False))
    return [tuple((run & bits.get(axis, 0)).bit_count() % 2 for axis in range(len(shape))) for run in range(FORCES)]


def wavelengths(band: Band | None, speeds: NDArray[np.float64]) -> tuple[float, float]:
    """The shortest and the longest wavelength that a band takes in at any of the speeds [m/s], m."""
    if band is None:
        return 0.0, math.inf
    if band.kind == "wavelength":
        return band.low, band.high
    return float(speeds.min()) / band.high, float(speeds.max()) / band.low


def judged(case: Case, name: str, values: NDArray[np.float64], remedy: str = "", measured: str = "") -> Concern | None:
    """The concern about values on the corners of a grid, if there is one."""
    criterion = CRITERIA[name]
    known = values[~np.isnan(values)]
    if not known.size:
        return None
    low, high = float(known.min()), float(known.max())
    if inside((low, high), criterion.usual):
        return None
    text = measured or f"{criterion.what} {span(low, high)} {criterion.unit}".rstrip() + _place(case, name, values)
    text += f" (usual: {_range(criterion.usual, criterion.unit)})"
    accepted = name in case.accepted and inside((low, high), case.accepted[name])
    if not accepted:
        text = "; ".join([text, remedy or criterion.remedy, *_right_or_wrong(case, criterion, low, high)])
        if high <= criterion.acceptable:
            accepting = json.dumps(_accepting((low, high), criterion.usual)).replace("Infinity", "inf")
            text += f"; or accept it: [accepted] {name} = {accepting}"
    return Concern(name, (low, high), criterion.usual, accepted, text)


def _right_or_wrong(case: Case, criterion: Criterion, low: float, high: float) -> list[str]:
    """What else may be wrong with a case below or above a range, and what may be right."""
    below, above = low < criterion.usual[0], high > criterion.usual[1]
    sides = {
        "half": above and 'if masses, springs and dampers of both sides are given, say so: --set "masses=whole"',
        "whole": below and 'if masses, springs and dampers of one side are given, say so: --set "masses=half"',
    }
    words = [
        criterion.sides and sides[case.masses],
        below and criterion.right_below,
        above and criterion.right_above,
    ]
    return [text for text in words if text]


def inside(measured: tuple[float, float], limits: tuple[float, float]) -> bool:
    return bool(measured[0] >= limits[0] * (1 - 1e-9) and measured[1] <= limits[1] * (1 + 1e-9))


def _place(case: Case, name: str, values: NDArray[np.float64]) -> str:
    """Where on the grid the value lies that is furthest outside, by the axes that touch it."""
    axes = [axis for axis in case.axes if axis.name != "speed"]
    if values.ndim != len(axes) or values.size == 1:
        return ""
    low, high = CRITERIA[name].usual
    with np.errstate(all="ignore"):
        outside = np.where(np.isnan(values), -1.0, np.maximum(values / high, low / values))
    index = np.unravel_index(int(np.argmax(outside)), values.shape)
    where = [
        f"{axis.name}={axis.values[i]:{'.0f' if axis.name == SAMPLE else '.4g'}} {axis.unit}".rstrip()
        for axis, i, size in zip(axes, index, values.shape, strict=True)
        if size > 1
    ]
    return f" ({values[index]:.3g} at {', '.join(where)})"


def span(low: float, high: float) -> str:
    return f"{low:.3g}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g}"


def _range(limits: tuple[float, float], unit: str) -> str:
    low, high = limits
    words = f"at least {low:.4g}" if math.isinf(high) else f"{low:.4g} to {high:.4g}" if low else f"up to {high:.3g}"
    return f"{words} {unit}".rstrip()


def _accepting(measured: tuple[float, float], usual: tuple[float, float]) -> list[float]:
    """A range with round ends that takes in both."""
    low, high = (rounded(value, way) for value, way in zip(measured, (math.floor, math.ceil), strict=True))
    return [min(usual[0], low), max(rounded(usual[1], math.ceil), high)]


def rounded(value: float, way: Callable[[float], int], digits: int = 2) -> float:
    """A number to two significant digits, up (`math.ceil`) or down (`math.floor`)."""
    if not 1e-280 < value < 1e280:
        return value
    places = digits - 1 - math.floor(math.log10(value))
    return float(f"{way(round(value * 10.0**places, 9)) / 10.0**places:.{digits}g}")
