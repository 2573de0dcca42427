"""Mean squares over the whole frequency axis in closed form, over blocks, for a rational track spectrum.

With X and Y two scalars of the blocks, J_XY(d) = integral over all omega of X(i w) Y(-i w) G(w) e^{i w d} for a lag d
>= 0 closes in the left half plane:

    J_XY(d) = 2 pi sum over the poles p of X and of G of Res[X(s) Y(-s) G(s) e^{s d}].

Each column of a reduction (`reduction.columns`) is a sum of such integrals over its powers and over the distances
between wheels that its lag function is a sum of: the integral over omega > 0 of Re(X Y*) cos(w d) G is (J_XY + J_YX)/4,
of Im(X Y*) sin(w d) G (J_YX - J_XY)/4. The poles of a vehicle do not depend on the speed: one eigenproblem serves all.

Where two poles of a block merge (critical damping) or one meets the spectrum's, the residues grow without bound and
cancel, though their sum is smooth. There the value is interpolated from vehicles with more and less damping, or from
tracks with other cut-offs.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Bending, Dashpot, Law, Values
from freqrail.model.spectrum import RationalSpectrum, Spectrum
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_poles import Array, Expansion
from freqrail.solver.block_quadrature import shape_of
from freqrail.solver.block_terms import (
    ReadBlock,
    distances_of,
    losses_of,
    pole_terms,
    products_of,
    read_blocks,
    rows_of,
)
from freqrail.solver.block_waves import Track, add_pole_terms, by_output, label_sums, track_terms
from freqrail.solver.closed_form import MEETING, MERGING, SPREAD, SUPPORT, spread
from freqrail.solver.quadrature import MeanSquare
from freqrail.types import Number

DEFECT = 0.05  # slope of a pole over its terms below which a pole near it may be merging with it
FEWER = slice(1, -1)  # nodes of a second interpolation, which tells the first one's error


def whole_axis_mean_squares(
    reduction: Reduction, values: Values, spectrum: Spectrum, speed: Array
) -> dict[str, MeanSquare]:
    """Mean squares over the whole axis of every output of a reduction, for a grid of vehicles and every speed.

    values: by parameter, broadcasting to [grid...]; speed: [m] in m/s. Returns {output: MeanSquare}, [labels, grid...,
    speeds]. The error estimate counts what the terms lose when they cancel and what the residues lack. A vehicle that
    is undamped or whose numbers overflow gives inf or nan, which the caller judges. Raises TypeError for a spectrum,
    and ValueError for a law, that is not rational.
    """
    if not isinstance(spectrum, RationalSpectrum):
        raise TypeError(f"the closed form is for rational spectra (got {type(spectrum).__name__})")
    grid = shape_of(values)
    own = {name: np.asarray(v) if np.size(v) > 1 else float(np.ravel(v)[0]) for name, v in values.items()}
    if not shape_of(own):  # a single vehicle is a grid too
        first = reduction.system.inertias[0]
        own[first] = np.reshape(own[first], 1)
    with np.errstate(all="ignore"):
        parts = [(weight, _mean_squares(reduction, own, each, speed)) for weight, each in spread(spectrum)]
    result = {}
    for name in reduction.columns:
        value = functools.reduce(operator.add, (weight * part[name].value for weight, part in parts))
        error = functools.reduce(operator.add, (abs(weight) * part[name].error for weight, part in parts))
        shape = (value.shape[0], *grid, value.shape[-1])
        result[name] = MeanSquare(value.reshape(shape), error.reshape(shape))
    return result


def _mean_squares(
    reduction: Reduction, values: Values, spectrum: RationalSpectrum, speed: Array
) -> dict[str, MeanSquare]:
    grid, track = shape_of(values), Track(spectrum.roughness, spectrum.cutoffs)
    blocks = read_blocks(reduction, values)
    squares = _sum_of_residues(reduction, values, blocks, track, speed, grid)
    expansions = [block.expansion for block in blocks.values()]
    singular = np.broadcast_to(_singular(expansions, spectrum, speed), (*grid, speed.size))
    merging = np.all(singular, axis=-1, keepdims=True)
    places = np.argwhere(merging[..., 0])
    if places.size:
        _interpolate(reduction, values, blocks, track, speed, squares, tuple(places.T))
    places = np.argwhere(singular & ~merging)
    if places.size:
        _interpolate(reduction, values, blocks, track, speed[places[:, -1], None, None], squares, tuple(places.T))
    return squares


def dampings(reduction: Reduction) -> set[str]:
    """Names of the parameters that scale a damper's force."""

    def of_law(law: Law) -> Iterator[str]:
        if isinstance(law, Dashpot):
            yield law.name
        elif isinstance(law, Bending):
            yield law.damping_ratio
        for part in getattr(law, "parts", ()):
            yield from of_law(part)

    return {name for law in reduction.system.laws for name in of_law(law)}


def _interpolate(
    reduction: Reduction,
    values: Values,
    blocks: dict[int, ReadBlock],
    track: Track,
    speed: Array,
    squares: dict[str, MeanSquare],
    places: tuple[NDArray[np.intp], ...],
) -> None:
    """Replace `squares` at grid indices `places` by values interpolated from what is around them.

    places: one index array [r] an axis of the grid: there poles of a vehicle merge, and its dampers' constants are
    scaled by factors around 1. Or one more, for single speeds: there poles meet the track's, and its cut-offs are
    scaled, which leaves the vehicle's poles where they are. speed: [m], all of them, or [r, 1, 1], that of each place.
    """
    grid = shape_of(values)
    offsets = SPREAD * np.cos(np.pi * (np.arange(SUPPORT) + 0.5) / SUPPORT)
    weight = _to_zero(offsets)
    fewer = weight.copy()
    fewer[FEWER] -= _to_zero(offsets[FEWER])
    near = {
        name: np.broadcast_to(v, grid)[places[: len(grid)]].reshape(-1, 1) if np.ndim(v) else v
        for name, v in values.items()
    }
    single = len(places) > len(grid)
    if single:
        low, high = (cutoff * (1 + offsets) for cutoff in track.cutoffs)
        track = Track(track.roughness, (low, high))
        blocks = {index: block.at(grid, places[:-1]) for index, block in blocks.items()}
    else:
        near |= {name: near[name] * (1 + offsets) for name in dampings(reduction)}
        blocks = read_blocks(reduction, near)
    around = _sum_of_residues(reduction, near, blocks, track, speed, (len(places[0]), SUPPORT))
    for name, square in around.items():
        value = np.einsum("prks,k->prs", square.value, weight)
        error = np.einsum("prks,k->prs", square.error, np.abs(weight))
        error += np.abs(np.einsum("prks,k->prs", square.value, fewer))
        everywhere: tuple[Any, ...] = (slice(None), *places)
        squares[name].value[everywhere] = value[..., 0] if single else value
        squares[name].error[everywhere] = error[..., 0] if single else error


def _to_zero(nodes: Array) -> Array:
    """Weights of the polynomial through values at nodes, at zero."""
    return np.array([np.prod([z / (z - x) for z in nodes if z != x]) for x in nodes])


def _sum_of_residues(
    reduction: Reduction,
    values: Values,
    blocks: dict[int, ReadBlock],
    track: Track,
    speed: Array,
    grid: tuple[int, ...],
) -> dict[str, MeanSquare]:
    """The plain formula.

    speed: [speeds], or [grid..., speeds] with axes of length 1 where it is common to the vehicles. grid: of the
    vehicles, each with its track.
    """
    rows, groups = rows_of(reduction)
    products = products_of(rows)
    distances = distances_of(reduction, values)
    loss = losses_of(reduction, rows, blocks)
    total, error = np.zeros((2, *grid, len(rows), speed.shape[-1]))
    for index in blocks:
        own = [each for each in products if reduction.scalars[each.x].block == index]
        if own:
            terms = pole_terms(blocks, index, own, groups, reduction, values, loss)
            add_pole_terms(total, error, terms, distances, track, speed)
    at_labels, lost = label_sums(reduction, rows, total, error)
    for cell, value, uncertain in track_terms(reduction, values, blocks, products, rows, distances, track, speed, grid):
        at_labels[cell] += value
        lost[cell] += uncertain
    found = by_output(reduction, at_labels, lost)
    return {name: MeanSquare(*each) for name, each in found.items()}


def _singular(expansions: list[Expansion], spectrum: RationalSpectrum, speed: Array) -> NDArray[np.bool_]:
    """Where the plain formula loses its digits: [grid..., speeds]."""
    result: Number = np.zeros(speed.shape[-1], dtype=bool)
    for each in expansions:
        taken = np.any([r != 0 for r in each.residues.values()], axis=0) & (each.weight > 0)
        p = np.where(taken, each.poles, np.nan)
        size = np.abs(p)
        with_conjugates = np.concatenate([p, np.where(each.weight > 1, np.conj(p), np.nan)], axis=-1)
        gaps = np.abs(p[..., :, None] - with_conjugates[..., None, :])
        gaps[..., range(p.shape[-1]), range(p.shape[-1])] = np.nan
        merging = (gaps < MERGING * size[..., None]) & (each.defect < DEFECT)[..., None]
        result = result | np.any(merging, axis=(-2, -1))[..., None]
        # the spectrum's poles are real: only vehicle's poles next to the real axis can meet them
        real = np.where(np.abs(p.imag) < MEETING * size, p.real, np.nan)
        for k in np.flatnonzero(np.any(np.isfinite(real), axis=tuple(range(p.ndim - 1)))):
            for cutoff in spectrum.cutoffs:
                distance = np.abs(real[..., k, None] + cutoff * speed)
                result = result | (distance < MEETING * np.abs(real[..., k, None]))
    return np.asarray(result)
