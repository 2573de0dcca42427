"""Resonances of the blocks as quadrature sees them: where peaks lie, how wide they are, what rounding makes of them.

An elimination with rounding is the exact one of a vehicle whose numbers differ in their last digits; what that does to
a peak, its place and its height, `solver.free_oscillation` tells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.reduction.blocks import Block
from freqrail.reduction.columns import Reduction
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_poles import FAR, LIGHT, Expansion, expansion
from freqrail.solver.block_response import parts_of, used
from freqrail.solver.frozen_laws import resonances_frozen
from freqrail.types import Number

Array = NDArray[np.float64]

ROUNDED_BELOW = 1e-9  # of the largest eigenvalue: real parts smaller than this are not taken from eigenvalues
BESIDE = 0.01  # relative distance of poles up to which their peaks are taken for overlapping
SAME = 1e-6  # relative error of a product of poles up to which it counts as known


@dataclass(frozen=True)
class Resonances:
    """Poles of a block of one vehicle or many, rad/s: [n], those with Im >= 0, and what rounding makes of responses.

    known: [n], whether its peak surely lies there, as wide as the pole tells. shift: how far rounding moves a
    peak, relative to its frequency. errors: relative errors of each scalar beside it, {scalar: [n]}. All NaN where a
    vehicle's numbers overflow.
    """

    poles: NDArray[np.complex128]
    known: NDArray[np.bool_]
    shift: Array
    errors: dict[int, Array]


def resonances(reduction: Reduction, values: Values, sample: bool = False) -> dict[int, Resonances]:
    """`Resonances` of every block that scalars are read off, of all vehicles of a grid together.

    sample: where the eigenvalues of a vehicle cannot tell a peak's width, its poles are taken for unknown. Without it
    they are counted by the determinant, which takes longer.
    """
    found = _tables(reduction, values, sample)
    return {index: _told(each, ...) for index, each in found.items()}


def resonances_of_each(reduction: Reduction, values: Values, count: int) -> list[dict[int, Resonances]]:
    """The same of each of `count` vehicles, whose values are floats or arrays [count]."""
    found = _tables(reduction, values, False)
    return [
        {index: _told(each, slice(v, v + 1) if each.poles.ndim > 1 else ...) for index, each in found.items()}
        for v in range(count)
    ]


def every_pole(found: Mapping[int, Resonances]) -> NDArray[np.complex128]:
    """The poles of all blocks, rad/s."""
    return np.concatenate([each.poles for each in found.values()])


@dataclass(frozen=True)
class _Table:
    """Of a block's vehicles: what `Resonances` has, [grid..., k], and which poles there are; finite: [grid...]."""

    poles: NDArray[np.complex128]
    known: NDArray[np.bool_]
    shift: Array
    errors: dict[int, Array]
    there: NDArray[np.bool_]
    finite: NDArray[np.bool_]


def _told(table: _Table, some: Any) -> Resonances:
    finite = table.finite[some]
    here = table.there[some] & finite[..., None]
    nothing = np.full(int(np.sum(~finite)), np.nan)
    return Resonances(
        np.append(table.poles[some][here], nothing),
        np.append(table.known[some][here], nothing == 0),
        np.append(table.shift[some][here], nothing),
        {k: np.append(error[some][here], nothing) for k, error in table.errors.items()},
    )


def _tables(reduction: Reduction, values: Values, sample: bool) -> dict[int, _Table]:
    result = {}
    with np.errstate(all="ignore"):
        for index, block, _ in used(reduction):
            if not all(strut.law.rational for strut in block.struts):
                result[index] = _irrational(block, reduction.lengths, values)
                continue
            each = expansion(reduction, index, values)
            errors = {k: _relative(rounding, each.residues[k], each) for k, rounding in each.rounding.items()}
            result[index] = _Table(
                each.poles,
                _known(reduction, index, values, each, sample),
                each.shift,
                errors,
                each.weight > 0,
                np.asarray(np.isfinite(each.raw).all(axis=-1)),
            )
    return result


def _relative(rounding: Array, residues: NDArray[np.complex128], each: Expansion) -> Array:
    """Errors of residues relative to what a peak is among those that it overlaps with, [grid..., k].

    A peak's mean square is in proportion to |residue|^2/|Re p|; of two side by side the lower one counts for less.
    """
    present = each.weight > 0
    power = np.where(present, np.square(np.abs(residues)) / np.abs(each.poles.real), 0.0)
    near = np.abs(each.poles[..., :, None] - each.poles[..., None, :]) < BESIDE * np.abs(each.poles[..., :, None])
    highest = np.max(np.where(near, power[..., None, :], 0.0), axis=-1)
    wrong = np.abs(residues) * rounding / np.abs(each.poles.real)
    return np.where(present & (highest > 0), wrong / highest, 0.0)


def _irrational(block: Block, lengths: Lengths, values: Values) -> _Table:
    found = resonances_frozen(block, lengths, values)
    there, nothing = found.imag > 0, np.zeros(found.shape)
    return _Table(found, np.isfinite(found), nothing, {}, there, np.ones(found.shape[:-1], dtype=bool))


def _known(reduction: Reduction, index: int, values: Values, each: Expansion, sample: bool) -> NDArray[np.bool_]:
    """Whether a block's poles are known, [grid..., k]."""
    known = ~each.lost
    shape = each.raw.shape[:-1]
    for place in np.argwhere(np.any(is_lost(each.raw), axis=-1)):
        at = tuple(map(int, place))
        own = {name: float(np.broadcast_to(v, shape)[at]) if np.ndim(v) else v for name, v in values.items()}
        known[at] &= not sample and _complete(reduction, index, own, _all_of(each, at))
    return known


def is_lost(poles: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Eigenvalues [..., n] whose real parts, the widths of their peaks, may be lost in the rounding of the largest."""
    largest = np.max(np.where(np.abs(poles) < 2 * FAR, np.abs(poles), 0.0), axis=-1, keepdims=True, initial=0.0)
    return np.asarray(np.abs(poles.real) < ROUNDED_BELOW * largest)


def _all_of(each: Expansion, at: tuple[int, ...]) -> NDArray[np.complex128]:
    """All poles [n] of a vehicle: polished, with their conjugates, and the far ones as computed."""
    weight, p, raw = each.weight[at], each.poles[at], each.raw[at]
    far = raw[(np.abs(raw) >= FAR) & (np.abs(raw + 2 * FAR) > 1e-6 * FAR)]
    return np.concatenate([p[weight > 0], np.conj(p[weight > 1]), far[np.abs(far.imag) <= LIGHT * np.abs(far)]])


def _complete(reduction: Reduction, index: int, values: Values, poles: NDArray[np.complex128]) -> bool:
    """Whether poles [n] are those of a block of a single vehicle, each once.

    The determinant of its matrix, times the numerators of its struts' stiffnesses, is a polynomial of s with these
    roots. On the positive axis its elimination adds terms of one sign only; at s = |p| a pole that is not there shows.
    """
    block = reduction.blocks[index]
    size = np.abs(poles[np.abs(poles) < FAR])
    s = np.append(size, 2 * np.max(size, initial=1.0))
    parts = parts_of(block, reduction.lengths, values, s, np.square(s), {})
    factors = parts.factors()
    logarithm: Number = -sum(np.log(np.abs(each)) for each in factors.inverse.values())
    for strut in block.struts:
        numerator = np.abs(strut.law.quotient(values, s)[0])
        logarithm = logarithm + np.log(np.where(numerator > 0, numerator, 1.0))
    product = np.sum(np.log(np.abs(s[:, None] - poles)), axis=-1)
    apart = logarithm - product
    return bool(np.ptp(apart) < SAME)
