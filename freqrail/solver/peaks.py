"""What the sharp peaks that detours go around add to mean squares over a band: residues at their poles.

See `solver.detours` for the way around and `solver.block_residues` for the integrals. A peak may be so narrow that all
wheels cancel in it; what is uncertain of its height is then uncertain of what they leave, not of what each of them
puts in.
"""

from __future__ import annotations

import functools
import operator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.spectrum import RationalSpectrum, Spectrum, angular_psd
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_poles import Array, Complex, Expansion, bases, expand, multiplier
from freqrail.solver.block_quadrature import shape_of
from freqrail.solver.block_residues import DEFECT
from freqrail.solver.block_response import column, scalars
from freqrail.solver.block_terms import Distances, Product, distances_of, mirror_weights, products_of, rows_of
from freqrail.solver.block_waves import by_output, label_sums
from freqrail.solver.closed_form import LOSS, SAFETY
from freqrail.solver.detours import Detour, is_sharp
from freqrail.solver.elimination import times
from freqrail.solver.quadrature import EPSILON, MeanSquare
from freqrail.solver.resonances import is_lost
from freqrail.types import Number


def peak_mean_squares(
    reduction: Reduction,
    values: Values,
    spectrum: Spectrum,
    speed: Array,
    around: tuple[Detour, ...],
    limits: Array,
) -> dict[str, MeanSquare]:
    """What the poles in the rectangles of detours add to mean squares over bands, limits [2, m] in rad/s.

    values: by parameter, broadcasting to [grid...]. Returns {output: MeanSquare}, [labels, grid..., speeds]. The error
    is inf for vehicles with a sharp peak in the band that is in no rectangle, whose poles merge, or whose eigenvalues
    cannot tell a peak's width. Raises TypeError for a spectrum that is not rational.
    """
    if not isinstance(spectrum, RationalSpectrum):
        raise TypeError(f"detours are for rational spectra (got {type(spectrum).__name__})")
    rows, _ = rows_of(reduction)
    products = products_of(rows)
    spread = column(values)
    with np.errstate(all="ignore"):
        distances = distances_of(reduction, values)
        expansions = expand(reduction, values)
        found = {index: _held(reduction, spread, each, around) for index, each in expansions.items()}
        totals, errors = np.zeros((2, *shape_of(values), len(rows), speed.size))
        for index, peaks in found.items():
            own = [product for product in products if reduction.scalars[product.x].block == index]
            if own and peaks is not None:
                lags = [each.lag for _, each in rows]
                for row, value, error in _terms(
                    reduction, spread, expansions, found, peaks, own, lags, distances, spectrum, speed
                ):
                    totals[..., row, :] += value
                    errors[..., row, :] += error
    found_at = by_output(reduction, *label_sums(reduction, rows, totals, errors))
    result = {name: MeanSquare(*each) for name, each in found_at.items()}
    for index, each in expansions.items():
        doubtful = _doubtful(each, around, limits)
        for name, square in result.items():
            if index in reduction.blocks_in(name):
                square.error[:, np.broadcast_to(doubtful, square.error.shape[1:-1])] = np.inf
    return result


def _doubtful(each: Expansion, around: tuple[Detour, ...], limits: Array) -> NDArray[np.bool_]:
    """Vehicles, [grid...], of which a peak may not be gone around as it should."""
    held = _inside(each, around)
    frequency = np.abs(each.poles.imag)
    within = (frequency > np.min(limits[0])) & (frequency < np.max(limits[1])) & (each.weight > 1)
    missed = within & is_sharp(each.poles) & ~held
    merging = held & (each.defect < DEFECT)
    return np.asarray(
        np.any(missed | merging | each.lost, axis=-1)
        | np.any(is_lost(each.raw), axis=-1)
        | ~np.isfinite(each.raw).all(axis=-1)
    )


def _inside(each: Expansion, around: tuple[Detour, ...]) -> NDArray[np.bool_]:
    inside = [detour.holds(each.poles) for detour in around]
    return np.asarray(functools.reduce(np.logical_or, inside) & (each.weight > 1))


@dataclass(frozen=True)
class _Peaks:
    """The poles of a block inside rectangles: at most h of a vehicle.

    poles: [grid..., h] rad/s. there: [grid..., h]. light: [grid..., h], lightly damped. residues, errors: of its own
    scalars' bases, {scalar: [grid..., h]}. direct: of every scalar's base, read at -p.
    """

    poles: Complex
    there: NDArray[np.bool_]
    light: NDArray[np.bool_]
    residues: dict[int, Complex]
    errors: dict[int, Array]
    direct: list[Number]


def _held(reduction: Reduction, spread: Values, each: Expansion, around: tuple[Detour, ...]) -> _Peaks | None:
    held = _inside(each, around)
    count = int(np.max(np.sum(held, axis=-1), initial=0))
    if not count:
        return None
    order = np.argsort(~held, axis=-1, kind="stable")[..., :count]

    def take(table: NDArray) -> NDArray:
        return np.take_along_axis(table, order, axis=-1)

    p, there, light = take(each.poles), take(held), take(each.light)
    plain = bases(reduction)
    # a wrong residue shows at |p| of a light pole, at -p of a well damped one, see `block_terms.read_blocks`
    at = np.where(light, np.abs(p), -p)
    read = scalars(plain, spread, at, np.square(at)).values()
    fractions, rounded = each.fractions(tuple(each.residues), at)
    residues, errors = {}, {}
    for place, (k, residue) in enumerate(each.residues.items()):
        missing = np.abs(fractions[place] - read[k])
        beyond = np.maximum(0.0, missing - rounded[place] - LOSS / SAFETY * np.abs(read[k]))
        own = take(each.rounding[k]) + SAFETY * np.where(light, 0.0, take(each.shift)) * np.abs(take(residue))
        residues[k], errors[k] = take(residue), SAFETY * 2 * np.abs(p) * beyond + own
    return _Peaks(p, there, light, residues, errors, scalars(plain, spread, -p, np.square(p)).values())


def _terms(
    reduction: Reduction,
    spread: Values,
    expansions: dict[int, Expansion],
    found: dict[int, _Peaks | None],
    peaks: _Peaks,
    products: list[Product],
    lags: list[int],
    distances: Distances,
    spectrum: RationalSpectrum,
    speed: Array,
) -> list[tuple[int, Array, Array]]:
    """(row, value, error), [grid..., speeds] each, of what a block's peaks add."""
    p = peaks.poles
    factors = {
        k: multiplier(reduction.scalars[k], reduction.blocks[reduction.scalars[k].block], spread, p)
        for k in {x.x for x in products}
    }
    mirrored: dict[int, tuple[Complex, Array]] = {}
    for other in expansions.values():
        some = [y for y in other.residues if y in {product.y for product in products}]
        if not some:
            continue
        fractions, _ = other.fractions(some, -p)
        nearness = mirror_weights(p, other)
        for place, y in enumerate(some):
            scalar = reduction.scalars[y]
            factor = multiplier(scalar, reduction.blocks[scalar.block], spread, -p)
            wrong = functools.reduce(
                operator.add, (near * other.rounding[y][..., k, None] for k, near in enumerate(nearness))
            )
            mirrored[y] = (
                times(factor, np.where(peaks.light, fractions[place], peaks.direct[y])),
                np.abs(factor) * np.where(peaks.light, wrong, 0.0),
            )
    weights: dict[int, Number] = {}
    uncertain: dict[int, Number] = {}
    for product in products:
        scale = np.where(peaks.there, 2 * product.coefficient * factors[product.x], 0.0)
        residue, residue_error = peaks.residues[product.x], peaks.errors[product.x]
        value, wrong = mirrored[product.y]
        # functions: an operator may swap the factors of a complex product, and with them the last bit
        weights[product.row] = weights.get(product.row, 0.0) + times(times(scale, residue), value)
        error = np.abs(scale) * (np.abs(value) * residue_error + np.abs(residue) * wrong)
        uncertain[product.row] = uncertain.get(product.row, 0.0) + error
    waves, sizes = _lag_waves(p, sorted({lags[row] for row in weights}), distances, spectrum, speed)
    # a peak's height goes with the distance of a pole from a mirror image, which is known to a rounding error
    sharpness = 8 * EPSILON * np.abs(p) / np.abs(2 * p.real)
    result = []
    for row, weight in weights.items():
        wave, size = waves[lags[row]], sizes[lags[row]]
        value = _total(np.moveaxis(np.real(times(weight[..., None], wave)), -2, 0))
        lost = (uncertain[row] + (LOSS_OF_PEAK + sharpness) * np.abs(weight))[..., None] * np.abs(wave)
        lost = lost + np.abs(weight)[..., None] * size
        result.append((row, np.asarray(value, dtype=float), _total(np.moveaxis(lost, -2, 0))))
    return result


LOSS_OF_PEAK = 1e-13  # what the products of a peak's term lose beside what is counted, relative to it


def _lag_waves(
    p: Complex, lags: list[int], distances: Distances, spectrum: RationalSpectrum, speed: Array
) -> tuple[dict[int, Complex], dict[int, Array]]:
    """G(s) times every lag function at poles p [grid..., h], {lag: [grid..., h, speeds]}, and its rounding errors."""
    density = angular_psd(spectrum, p[..., None] / 1j, speed)
    waves: dict[int, Complex] = {}
    sizes: dict[int, Array] = {}
    for k, d in enumerate(distances.d):
        some = [lag for lag in lags if np.any(distances.factors[..., lag, k])]
        if not some:
            continue
        exponent = p[..., None] * (np.asarray(d)[..., None, None] / speed)
        wave = times(np.exp(exponent), density)
        rounding = 4 * EPSILON * (2 + np.abs(exponent)) * np.abs(wave)
        for lag in some:
            factor = distances.factors[..., lag, k]
            factor = np.asarray(factor)[..., None, None] if np.ndim(factor) else factor
            waves[lag] = waves.get(lag, 0.0) + factor * wave
            sizes[lag] = sizes.get(lag, 0.0) + np.abs(factor) * rounding
    return waves, sizes


def _total(terms: NDArray) -> NDArray:
    """The sum over the first axis, one term after the other: so its bits do not depend on the other axes."""
    return functools.reduce(operator.add, terms)
