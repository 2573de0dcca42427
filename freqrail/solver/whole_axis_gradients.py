"""Gradients of the mean squares over the whole frequency axis, for rational laws and a rational spectrum of the track.

The slope of a scalar has double poles where the scalar has simple ones. They need not be told apart: the integrals are
taken along ways through the left half plane (`solver.whole_axis_nodes`), by the matrix products and with the error
estimate that a band has.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.spectrum import RationalSpectrum, Spectrum
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_poles import expand
from freqrail.solver.block_quadrature import shape_of
from freqrail.solver.block_slopes import check_wanted
from freqrail.solver.gradients import mean_square_gradients
from freqrail.solver.lag_slopes import SPEED
from freqrail.solver.quadrature import EPSILON, ROUNDING, MeanSquare
from freqrail.solver.whole_axis_nodes import (
    TRIED,
    Above,
    Poles,
    nodes_along,
    nodes_around,
    speed_groups,
    way_of,
    with_poles_moved,
)
from freqrail.types import Number

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Gradients = dict[str, dict[str, MeanSquare]]

UNDAMPED = 1e-12  # damping ratio below which a pole counts as undamped
SAFETY = 16.0  # roundings in the frequency of a pole
TOGETHER = 64  # vehicles whose sums over the nodes are held at once


def whole_axis_gradients(
    reduction: Reduction,
    values: Values,
    spectrum: Spectrum,
    speed: Array,
    wanted: Iterable[str],
    shared: bool = False,
) -> Gradients:
    """Slopes of the mean squares over the whole axis, for a grid of vehicles and every speed.

    values: by parameter, broadcasting to [grid...], lengths included. speed: [m] in m/s. wanted: names of parameters
    and `SPEED`, see `gradients.mean_square_gradients`, whose form the result has. shared: whether vehicles with wheels
    at the same places share nodes that follow the poles of all of them: many times faster where these are much alike,
    but the last bits then depend on which vehicles are asked for together. Else every vehicle has its own.
    Where a block that an output is read off is undamped, and where the lags of a slow vehicle call for too many nodes,
    value and error are NaN and inf. Raises TypeError for a spectrum, and ValueError for a law, that is not rational,
    and ValueError as `mean_square_gradients` does.
    """
    if not isinstance(spectrum, RationalSpectrum):
        raise TypeError(f"the whole axis is for rational spectra (got {type(spectrum).__name__})")
    wanted = tuple(dict.fromkeys(wanted))
    check_wanted(reduction, (name for name in wanted if name != SPEED))
    grid = shape_of(values)
    count = math.prod(grid)
    flat = {name: np.broadcast_to(v, grid).ravel() for name, v in values.items()}
    poles, wrong = _poles(reduction, values)
    result: Gradients = {
        output.name: {name: _nothing((len(output.taps), count, speed.size)) for name in wanted}
        for output in reduction.outputs
    }
    for vehicles in _alike(reduction, flat) if shared else np.arange(count)[:, None]:
        some = np.array([v for v in vehicles if poles[v]], dtype=int)
        if some.size:
            _gradients(reduction, flat, [poles[v] for v in some], some, spectrum, speed, wanted, result)
    for output, labels in reduction.sums.items():
        for block in {reduction.scalars[k].block for label in labels for k, _ in label}:
            for slope in result[output].values():
                slope.value[:, wrong[block]], slope.error[:, wrong[block]] = np.nan, np.inf
    shape = (*grid, speed.size)
    return {
        output: {
            name: MeanSquare(s.value.reshape(-1, *shape), s.error.reshape(-1, *shape)) for name, s in slopes.items()
        }
        for output, slopes in result.items()
    }


def _gradients(
    reduction: Reduction,
    flat: Values,
    poles: list[Poles],
    vehicles: NDArray[np.intp],
    spectrum: RationalSpectrum,
    speed: Array,
    wanted: tuple[str, ...],
    result: Gradients,
) -> None:
    """Put the slopes of some vehicles, indices into values [count], into results [labels, count, speeds]."""
    single = [{name: float(v[k]) for name, v in flat.items()} for k in vehicles]
    way = way_of(reduction, list(zip(single, poles, strict=True)))
    everything = np.concatenate([p for own in poles for p in own.values()])
    sharpness = np.array(
        [_sharpness(own, way.end, above is not None) for own, above in zip(poles, way.above, strict=True)]
    )
    length = float(np.ptp(reduction.places(single[0])))
    for group in speed_groups(way, length, speed):
        at = reduction, single[0], spectrum, speed[group], wanted
        nodes = list(nodes_along(way, everything, *at))
        for first in range(0, vehicles.size, TOGETHER):
            part = slice(first, first + TOGETHER)
            own: dict[str, Number] = single[0]
            if vehicles.size > 1:  # a single vehicle is never part of a block
                own = {name: _one_or_all(v[vehicles], part) for name, v in flat.items()}
                mass = reduction.system.inertias[0]
                own[mass] = np.broadcast_to(own[mass], vehicles[part].shape)
            rounding = ROUNDING + 4 * EPSILON * sharpness[part, None]
            found = mean_square_gradients(reduction, own, nodes, wanted, rounding)
            for output, slopes in found.items():
                for name, slope in slopes.items():
                    labels = len(slope.value)
                    place = np.ix_(np.arange(labels), vehicles[part], group)
                    result[output][name].value[place] = slope.value.reshape(labels, -1, group.size)
                    result[output][name].error[place] = slope.error.reshape(labels, -1, group.size)
        for vehicle, values, above in zip(vehicles, single, way.above, strict=True):
            if above is not None:
                for output, slopes in _around(above, reduction, values, spectrum, speed[group], wanted).items():
                    for name, slope in slopes.items():
                        place = np.ix_(np.arange(len(slope.value)), [vehicle], group)
                        result[output][name].value[place] += slope.value[:, None]
                        result[output][name].error[place] += slope.error[:, None]
    for slopes in result.values():
        for slope in slopes.values():
            error = slope.error[:, vehicles]
            slope.error[:, vehicles] = np.where(np.isfinite(slope.value[:, vehicles]), error, np.inf)


def _around(
    above: Above,
    reduction: Reduction,
    values: Values,
    spectrum: RationalSpectrum,
    speed: Array,
    wanted: tuple[str, ...],
) -> Gradients:
    """What a vehicle's poles above its way add. The error is that of the rule, and what rounding of the poles makes."""
    rounding = 8 * EPSILON * (1 + above.nearness)
    nodes = list(nodes_around(above, reduction, values, spectrum, speed, wanted))
    found = mean_square_gradients(reduction, values, nodes, wanted, rounding)
    beside = mean_square_gradients(reduction, values, with_poles_moved(nodes, above), wanted, rounding)
    known = SAFETY * EPSILON * above.sharpness / TRIED
    return {
        output: {
            name: MeanSquare(slope.value, slope.error + known * np.abs(slope.value - beside[output][name].value))
            for name, slope in slopes.items()
        }
        for output, slopes in found.items()
    }


def _nothing(shape: tuple[int, ...]) -> MeanSquare:
    return MeanSquare(np.full(shape, np.nan), np.full(shape, np.inf))


def _one_or_all(values: Array, part: slice) -> Number:
    """A number that all vehicles share, or those of a part of them."""
    return float(values[0]) if np.all(values == values[0]) else values[part]


def _alike(reduction: Reduction, flat: Values) -> list[NDArray[np.intp]]:
    """Indices of the vehicles with wheels at the same places."""
    found: dict[bytes, list[int]] = {}
    for k in range(len(next(iter(flat.values())))):
        places = reduction.places({name: flat[name][k] for name in reduction.system.lengths})
        found.setdefault(places.tobytes(), []).append(k)
    return [np.array(some) for some in found.values()]


def _sharpness(poles: Poles, end: float, some_above: bool) -> float:
    """Frequency over width of the sharpest resonance that a vehicle's way passes."""
    p = np.concatenate(list(poles.values()))
    passed = p[p.imag < end] if some_above else p
    return float(np.max(np.abs(passed / passed.real), initial=1.0))


def _poles(reduction: Reduction, values: Values) -> tuple[list[dict[int, Complex]], dict[int, NDArray[np.bool_]]]:
    """Poles of every vehicle by block, rad/s, with Im >= 0, and by block which vehicles' are undamped or no numbers.

    Of these none are told.
    """
    grid = shape_of(values)
    count = math.prod(grid)
    own = {name: np.asarray(v) if np.size(v) > 1 else float(np.ravel(v)[0]) for name, v in values.items()}
    if all(np.ndim(v) == 0 for v in own.values()):
        mass = reduction.system.inertias[0]
        own[mass] = np.reshape(own[mass], 1)
    with np.errstate(all="ignore"):
        found = expand(reduction, own)
    result: list[dict[int, Complex]] = [{} for _ in range(count)]
    wrong = {}
    for block, each in found.items():
        shape = (*(grid or (1,)), each.poles.shape[-1])
        p, there = (np.broadcast_to(x, shape).reshape(count, -1) for x in (each.poles, each.weight > 0))
        damped = np.isfinite(p).all(axis=-1) & np.all(np.where(there, -p.real > UNDAMPED * np.abs(p), True), axis=-1)
        wrong[block] = ~damped
        for vehicle in np.flatnonzero(damped):
            result[vehicle][block] = p[vehicle][there[vehicle]]
    return result, wrong
