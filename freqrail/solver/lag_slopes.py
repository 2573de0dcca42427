"""Nodes for gradients: the weights of `block_lags`, and their slopes by lengths and by the speed.

A lag function depends on the wheels' places over the speed, so that its slope by the speed is that of wheels which move
by -x/v; the track's density and the limits of a band given in wavelengths depend on the speed as well.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.band import Band, band_limits
from freqrail.model.elements import Values
from freqrail.model.spectrum import Spectrum, angular_psd, angular_psd_slope, kinks
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_lags import _weighted, centred, lag_functions, wheel_waves
from freqrail.solver.quadrature import Quadrature

Array = NDArray[np.float64]

SPEED = "speed"
"""The name of the derivative by the speed; no parameter of a system that is differentiated by can have it."""

POWERS = ""
"""The key, among those of `GradientNodes`, of weights for the powers' own slopes."""

GROUPS = 4  # of speeds, that share a bound of what rounding leaves


@dataclass(frozen=True)
class GradientNodes:
    """Some nodes of a rule, and weights by what they are for.

    omega: [n] rad/s; beside the axis complex, s/i. kronrod: under `POWERS` the weights [lags, n, speeds] that turn
    slopes of powers into slopes of mean squares, under the name of a length or `SPEED` those that turn powers into
    them; beside the axis [lags, 2 n, speeds], of real parts of powers first, then of imaginary ones. gauss: the same
    for the embedded rule, None if it has none of these nodes. sizes: for each of kronrod the largest of its sizes among
    the speeds of a group, [lags, n, groups]. inverses: where K^-1 of a block [n, unknowns, unknowns] is known at s, and
    at -s, by block; of one vehicle.
    """

    omega: Array | NDArray[np.complex128]
    kronrod: dict[str, Array]
    gauss: dict[str, Array] | None
    sizes: dict[str, Array]
    inverses: tuple[Mapping[int, NDArray[np.complex128]], Mapping[int, NDArray[np.complex128]]] = ({}, {})


def groups_of(speeds: int) -> list[slice]:
    """The speeds of each group."""
    edges = np.linspace(0, speeds, min(GROUPS, speeds) + 1).round().astype(int)
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]


def sizes_of(weights: Array) -> Array:
    """Largest sizes of weights [lags, n, speeds] in every group, [lags, n, groups]."""
    sizes = np.abs(weights)
    return np.stack([np.max(sizes[..., some], axis=-1) for some in groups_of(weights.shape[-1])], axis=-1)


def moves(reduction: Reduction, wanted: Iterable[str]) -> dict[str, Array]:
    """How far every wheel moves, -, [wheels], with each length wanted that places depend on."""
    result, lengths = {}, reduction.system.lengths
    for name in wanted:
        if name in lengths:
            along = [reduction.lengths.derivative(wheel.place, name) for wheel in reduction.system.wheels]
            if np.ptp(along) > 0:  # all of them together make no difference
                result[name] = np.array(along)
    return result


def lag_slopes(reduction: Reduction, places: Array, move: Array, delay: Array) -> Array:
    """Slopes of every lag function of a reduction by a length, [lags, ...], 1/m.

    places: of the wheels, m. move: how far they move with it, -. delay: omega/v, rad/m.
    """
    real, imaginary = wheel_waves(centred(places), delay)
    sums: dict[bytes, tuple[Array, Array]] = {}

    def total(weights: Array) -> tuple[Array, Array]:
        key = weights.tobytes()
        if key not in sums:
            sums[key] = _weighted(weights, real), _weighted(weights, imaginary)
        return sums[key]

    result = np.empty((len(reduction.lags), *delay.shape))
    for k, lag in enumerate(reduction.lags):
        (a, b), (c, d) = total(lag.one), total(lag.other)
        # d u_w = i omega/v move_w u_w; no phase of the wheels that take part matters: where all move alike, it is 0
        part = (lag.one != 0) | (lag.other != 0)
        along = move - (np.max(move[part]) + np.min(move[part])) / 2
        (da, db), (dc, dd) = (
            (-delay * y, delay * x) for x, y in (total(weights * along) for weights in (lag.one, lag.other))
        )
        one, other = (da * c + a * dc, db * d + b * dd) if lag.part == "re" else (db * c + b * dc, -(da * d + a * dd))
        result[k] = lag.factor * (one + other)
    return result


def gradient_nodes(
    reduction: Reduction,
    values: Values,
    spectrum: Spectrum,
    rule: Quadrature,
    speed: Array,
    limits: Array,
    limit_slopes: Array,
    wanted: Iterable[str],
    most: int,
) -> Iterator[GradientNodes]:
    """The nodes of a rule, at most `most` at a time, with weights for `gradients.mean_square_gradients`.

    values: of one vehicle with the wheels' places, floats. speed: [m] in m/s. limits: [2, m], each speed's band in
    rad/s, on panel edges. limit_slopes: [2, m], how these move with the speed, rad/m, see `band_edges`; then nodes at
    the limits themselves come last. wanted: names of lengths and `SPEED`; others need nothing of their own.
    """
    wanted = tuple(wanted)
    places, along = reduction.places(values), moves(reduction, wanted)
    gauss = rule.gauss_weights.size
    for first, last in ((0, gauss), (gauss, rule.omega.size)):  # the embedded rule's nodes come first
        edges = np.linspace(first, last, -(-(last - first) // most) + 1).round().astype(int)
        for part in itertools.starmap(slice, itertools.pairwise(edges)):
            omega = rule.omega[part, None]
            inside = (omega > limits[0]) & (omega < limits[1])
            functions = _functions(reduction, places, along, spectrum, omega, speed, inside, SPEED in wanted)
            weights = rule.weights[part, None]
            kronrod = {name: function * weights for name, function in functions.items()}
            embedded = None
            if last == gauss:
                weights = rule.gauss_weights[part, None]
                embedded = {name: function * weights for name, function in functions.items()}
            sizes = {name: sizes_of(function) for name, function in kronrod.items()}
            yield GradientNodes(rule.omega[part], kronrod, embedded, sizes)
    if SPEED in wanted and np.any(limit_slopes):
        yield from _ends(reduction, places, spectrum, speed, limits, limit_slopes, most)


def _functions(
    reduction: Reduction,
    places: Array,
    along: dict[str, Array],
    spectrum: Spectrum,
    omega: Array,
    speed: Array,
    inside: NDArray[np.bool_],
    by_speed: bool,
) -> dict[str, Array]:
    """Lag functions times the track's density, and their slopes, [lags, n, speeds]."""
    delay = omega / speed
    density = angular_psd(spectrum, omega, speed) * inside
    functions = lag_functions(reduction, places, delay)
    result = {name: lag_slopes(reduction, places, move, delay) * density for name, move in along.items()}
    if by_speed:
        by_density = angular_psd_slope(spectrum, omega, speed) * inside
        moved = lag_slopes(reduction, places, -places, delay)
        result[SPEED] = functions * by_density + moved * (density / speed)
    functions *= density
    result[POWERS] = functions
    return result


def _ends(
    reduction: Reduction, places: Array, spectrum: Spectrum, speed: Array, limits: Array, slopes: Array, most: int
) -> Iterator[GradientNodes]:
    """What a mean square gains at the upper limit of a band that moves with the speed, and loses at the lower one."""
    for limit, slope, sign in zip(limits, slopes, (-1.0, 1.0), strict=True):
        moving = np.flatnonzero(slope)
        for some in np.array_split(moving, -(-moving.size // most)) if moving.size else ():
            omega, v = limit[some], speed[some]
            # of a table, the last value before it ends
            density = angular_psd(spectrum, omega * (1 + sign * -4 * np.finfo(float).eps), v)
            functions = lag_functions(reduction, places, omega / v) * (sign * slope[some] * density)
            weights = np.zeros((len(functions), some.size, speed.size))
            weights[:, range(some.size), some] = functions
            by_speed = {SPEED: weights}
            yield GradientNodes(omega, by_speed, by_speed, {SPEED: sizes_of(weights)})


def band_edges(band: Band, spectrum: Spectrum, speed: Array) -> tuple[Array, Array]:
    """Limits [2, m] of a band at speeds [m], rad/s, no wider than what a table covers, and their slopes, rad/m.

    Limits in wavelengths and the ends of a table are in proportion to the speed, those in hertz stay.
    """
    limits = band_limits(band, speed)
    moving = np.full(limits.shape, band.kind == "wavelength")
    points = kinks(spectrum, speed)
    if points.size:
        inner = np.array([np.maximum(limits[0], points[0]), np.minimum(limits[1], points[-1])])
        moving |= inner != limits
        empty = inner[1] <= inner[0]
        limits, moving = np.where(empty, inner[0], inner), moving & ~empty
    return limits, np.where(moving, limits / speed, 0.0)
