"""RMS values over a whole grid of vehicles and speeds: what to evaluate where, in blocks.

The grid's vehicles share one set of quadrature nodes where that is cheap, because then the speed axis of
every block is one matrix product. Where resonances are too narrow for that (the wheelsets ringing
on a rigid rail), and where the shared nodes miss the tolerance, each vehicle gets nodes of its own.
Both depend on the grid alone, never on how it is cut into blocks or on the number of workers.
"""

from __future__ import annotations

import itertools
import math
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from freqrail import residues, rms
from freqrail.response import SERIES, response_psd, wheel_lags
from freqrail.track import Band, Spectrum, band_limits, kinks, singular_points
from freqrail.vehicle import CHAINS, Vehicle, chain_system, ladder, poles, state_space

STATUS = ("ok", "unresolved_peak", "undamped", "failed")
"""Meaning of the status values 0, 1, ...; all but the first come with NaN."""

METHOD = ("none", "closed_form", "shared_quadrature", "own_quadrature")
"""Meaning of the method values: no result, sum of residues, nodes shared by the grid, nodes of the vehicle's own."""

TOLERANCE = 1e-6
"""Largest error estimate of an RMS value, relative, that is passed on as a result."""

REFINE_ABOVE = 1e-8  # a shared-node result whose estimate exceeds this is computed anew with nodes of its own
SHARED_NODES = 6000  # more nodes than this are not worth sharing
LARGEST_RULE = 10_000_000  # nodes x speeds that a vehicle's own quadrature may take: about 1 GB of weights
SAMPLES = 300  # vehicles whose poles place the shared nodes: all of a small grid, an even spread of a large one
SHARPEST_SHARED = 0.01  # damping ratio below which every vehicle's poles must be known to place shared nodes
CLOSED_FORM_BLOCK = 51_200  # grid points of a block in closed form
BLOCK = 256  # vehicles whose sums over the nodes are held at once: few enough to stay in the cache
OWN_NODES = 500  # of a single vehicle, at once
PSD_BLOCK = 250_000  # vehicles x speeds x frequencies of a block of spectra
WHOLE_AXIS_REACH = 20.0  # without a band, nodes reach this multiple of the highest resonance; beyond is bounded


Progress = Callable[[int], object]


@dataclass(frozen=True)
class Study:
    """A grid of vehicles, speeds and the track below them, numbers only.

    vehicle: fields are floats or arrays that broadcast to the grid of vehicles. speed: [m] in m/s.
    band None: the whole axis. names: keys of `response.SERIES`.
    """

    vehicle: Vehicle
    speed: NDArray[np.float64]
    spectrum: Spectrum
    band: Band | None
    names: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape [grid..., speeds]."""
        return (*self.vehicle.shape, self.speed.size)


@dataclass(frozen=True)
class Solution:
    """RMS values and their relative error estimates {name: [positions, grid..., speeds]} in SI units.

    status and method: [grid..., speeds], int8, see `STATUS` and `METHOD`; NaN wherever status is not 0.
    """

    rms: dict[str, NDArray[np.float64]]
    relative_error: dict[str, NDArray[np.float64]]
    status: NDArray[np.int8]
    method: NDArray[np.int8]


@dataclass(frozen=True)
class SharedNodes:
    """Panel edges [n + 1] in rad/s that serve every vehicle of a grid, None if each needs its own; `rms.rounding` [m].

    They depend on the whole grid: a part of it takes those of the whole, and so gets the same bits.
    """

    edges: NDArray[np.float64] | None
    lost: NDArray[np.float64]


def solve(
    study: Study, jobs: int = 1, progress: Progress = lambda points: None, nodes: SharedNodes | None = None
) -> Solution:
    """RMS of every named response at every grid point, with an error estimate and a status each.

    jobs: threads that work on blocks; the result does not depend on it. progress: called with the
    number of grid points just finished. nodes: `shared_nodes` of the grid that this one is a part of, if any.
    Never raises for a numerical failure: such points are NaN.
    """
    shape = study.shape
    positions = {name: len(SERIES[name].positions) for name in study.names}
    solution = Solution(
        rms={name: np.full((count, *shape), np.nan) for name, count in positions.items()},
        relative_error={name: np.full((count, *shape), np.nan) for name, count in positions.items()},
        status=np.full(shape, STATUS.index("unresolved_peak"), np.int8),
        method=np.zeros(shape, np.int8),
    )
    nodes = nodes or shared_nodes(study)
    if nodes is None:
        _solve_in_closed_form(study, solution, jobs, progress)
    else:
        _solve_by_quadrature(study, solution, nodes, jobs, progress)
    _judge(study, solution)
    return solution


def _in_closed_form(study: Study) -> bool:
    return study.band is None and residues.applies(study.spectrum)


def _solve_in_closed_form(study: Study, solution: Solution, jobs: int, progress: Progress) -> None:
    def part(cell: tuple[slice, ...]) -> None:
        vehicle = cut(study.vehicle, cell)
        block = residues.mean_squares(vehicle, study.names, study.spectrum, study.speed)
        _store(solution, cell, block, "closed_form")
        progress(math.prod(vehicle.shape) * study.speed.size)

    _run(part, cells(study.vehicle.shape, CLOSED_FORM_BLOCK // study.speed.size), jobs)
    _run(partial(_improve, study, solution), _inaccurate(study, solution), jobs)


def _inaccurate(study: Study, solution: Solution) -> list[tuple[int, ...]]:
    """Damped vehicles with an error estimate above TOLERANCE, or none at all, at some speed."""
    worst = np.max([np.max(e, axis=(0, -1)) for e in solution.relative_error.values()], axis=0)
    damped = np.greater(study.vehicle.primary_damping, 0)
    return [tuple(map(int, i)) for i in np.argwhere(~(worst <= TOLERANCE) & damped)]


def _improve(study: Study, solution: Solution, index: tuple[int, ...]) -> None:
    """Quadrature for one vehicle, kept at the speeds where its error estimates are the smaller ones."""
    own = replace(solution, rms={}, relative_error={})
    squares = _own_quadrature(study, index)
    cell = tuple(slice(i, i + 1) for i in index)
    for name, square in squares.items():
        own.rms[name], own.relative_error[name] = _root(square)
    before = np.max([np.max(e[(slice(None), *cell)], axis=0) for e in solution.relative_error.values()], axis=0)
    after = np.max([np.max(e, axis=0) for e in own.relative_error.values()], axis=0)
    better = (after < before) | ~np.isfinite(before)
    for old, new in ((solution.rms, own.rms), (solution.relative_error, own.relative_error)):
        for name in old:
            part = old[name][(slice(None), *cell)]
            old[name][(slice(None), *cell)] = np.where(better, new[name], part)
    solution.method[cell] = np.where(better, METHOD.index("own_quadrature"), solution.method[cell])


def _solve_by_quadrature(study: Study, solution: Solution, shared: SharedNodes, jobs: int, progress: Progress) -> None:
    own: list[tuple[int, ...]] = []
    if shared.edges is None:
        own = list(np.ndindex(study.vehicle.shape))
    else:
        rule = rms.quadrature(shared.edges)
        for geometry, group in _blocks(study.vehicle, BLOCK):
            nodes = list(_weighted_nodes(study, geometry, rule, rms.NODES))

            def together(cell: tuple[slice, ...], nodes: list[rms.WeightedNodes] = nodes) -> None:
                part = replace(study, vehicle=cut(study.vehicle, cell))
                block = rms.mean_squares(part.vehicle.column(), study.names, nodes, shared.lost)
                _store(solution, cell, block, "shared_quadrature")
                progress(math.prod(part.shape))

            _run(together, group, jobs)
        worst = np.max([np.max(e, axis=(0, -1)) for e in solution.relative_error.values()], axis=0)
        own = [tuple(map(int, i)) for i in np.argwhere(~(worst <= REFINE_ABOVE))]

    def alone(index: tuple[int, ...]) -> None:
        cell = tuple(slice(i, i + 1) for i in index)
        _store(solution, cell, _own_quadrature(study, index), "own_quadrature")
        if shared.edges is None:
            progress(study.speed.size)

    _run(alone, own, jobs)


def psd(
    study: Study, frequency: NDArray[np.float64], progress: Callable[[int], object] = lambda points: None
) -> dict[str, NDArray[np.float64]]:
    """One-sided PSDs {name: [positions, grid..., speeds, n]} at `frequency` [n] in Hz, per Hz, SI squared."""
    result = {name: np.empty((len(SERIES[name].positions), *study.shape, frequency.size)) for name in study.names}
    for _, group in _blocks(study.vehicle, PSD_BLOCK // (frequency.size * study.speed.size)):
        for cell in group:
            part = cut(study.vehicle, cell)
            column = part.column().column()
            for name in study.names:
                result[name][(slice(None), *cell)] = response_psd(
                    SERIES[name], column, study.spectrum, frequency, study.speed[:, None]
                )
            progress(math.prod(part.shape) * study.speed.size)
    return result


def seconds(study: Study, jobs: int = 1) -> float:
    """Estimated wall time of `solve`, s, from timing the first block of this grid."""
    shared = shared_nodes(study)
    if shared is None:
        cell = cells(study.vehicle.shape, CLOSED_FORM_BLOCK // study.speed.size)[0]
        first = cut(study.vehicle, cell)
        start = time.perf_counter()
        residues.mean_squares(first, study.names, study.spectrum, study.speed)
        once = time.perf_counter() - start
        return once * math.prod(study.vehicle.shape) / math.prod(first.shape) / jobs
    start = time.perf_counter()
    if shared.edges is None:
        _own_quadrature(study, (0,) * len(study.vehicle.shape))
        return (time.perf_counter() - start) * math.prod(study.vehicle.shape) / jobs
    rule = rms.quadrature(shared.edges)
    geometry, group = next(iter(_blocks(study.vehicle, BLOCK)))
    nodes = list(_weighted_nodes(study, geometry, rule, rms.NODES))
    part = cut(study.vehicle, group[0])
    start = time.perf_counter()
    rms.mean_squares(part.column(), study.names, nodes)
    once = time.perf_counter() - start
    return once * math.prod(study.vehicle.shape) / math.prod(part.shape) / jobs


def _limits(study: Study) -> NDArray[np.float64]:
    """The band at every speed, rad/s: [2, speeds]; no wider than what a tabulated spectrum covers."""
    low, high = np.zeros_like(study.speed), np.full_like(study.speed, np.inf)
    if study.band is not None:
        low, high = band_limits(study.band, study.speed)
    points = kinks(study.spectrum, study.speed)
    if points.size:
        low, high = np.maximum(low, points[0]), np.minimum(high, points[-1])
    return np.array([low, np.maximum(low, high)])


def _weighted_nodes(
    study: Study, index: tuple[int, ...], rule: rms.Quadrature, most: int
) -> Iterator[rms.WeightedNodes]:
    """The rule's nodes with the weights of every speed and of the geometry of the vehicle at `index`."""
    return rms.weighted_nodes(study.vehicle.at(index), study.spectrum, rule, study.speed, _limits(study), most)


def _first_edges(study: Study, resonances: NDArray[np.complex128]) -> NDArray[np.float64]:
    """The edges a panel must not straddle: every speed's own band, or 0 and the end of the nodes, and all kinks."""
    limits = _limits(study)
    ends = np.where(np.isinf(limits), WHOLE_AXIS_REACH * np.max(np.abs(resonances.imag), initial=1.0), limits)
    points = kinks(study.spectrum, study.speed)
    return np.unique(np.concatenate([ends.ravel(), points[(points > limits[0]) & (points < limits[1])]]))


def shared_nodes(study: Study) -> SharedNodes | None:
    """Nodes that serve the whole grid, where they are not too many; None where the closed form needs none."""
    if _in_closed_form(study):
        return None
    sample = _sample(study.vehicle)
    resonances = np.concatenate([residues.chain_poles(sample, chain).ravel() for chain in CHAINS])
    resonances = resonances[np.isfinite(resonances)]
    if np.isinf(_limits(study)).any():
        return SharedNodes(None, np.array(np.nan))  # the bound of what lies beyond the nodes is each vehicle's own
    first = _first_edges(study, resonances)
    if math.prod(sample.shape) < math.prod(study.vehicle.shape):
        inside = (np.abs(resonances.imag) > first[0]) & (np.abs(resonances.imag) < first[-1])
        if np.any(inside & (np.abs(resonances.real) < SHARPEST_SHARED * np.abs(resonances.imag))):
            return SharedNodes(
                None, np.array(np.nan)
            )  # between the vehicles sampled, such a peak could pass through the nodes
    lag = float(np.max(sample.half_bogie_spacing + sample.half_wheelbase)) * 2 / float(study.speed.min())
    everything = np.concatenate([resonances, singular_points(study.spectrum, study.speed)])
    lost = rms.rounding(resonances, _limits(study))
    if rms.fewest_nodes(first, lag) > SHARED_NODES:
        return SharedNodes(None, lost)
    edges = rms.panel_edges(first, everything, lag)
    return SharedNodes(edges if (edges.size - 1) * rms.PANEL_NODES <= SHARED_NODES else None, lost)


def _sample(vehicle: Vehicle) -> Vehicle:
    """At most about SAMPLES vehicles of the grid, evenly over every axis, its two ends among them."""
    varying = sum(n > 1 for n in vehicle.shape)
    limit = max(2, int(SAMPLES ** (1 / varying))) if varying else 1
    return cut(
        vehicle, tuple(np.unique(np.linspace(0, n - 1, min(n, limit)).round().astype(int)) for n in vehicle.shape)
    )


def _blocks(vehicle: Vehicle, most: int) -> Iterator[tuple[tuple[int, ...], list[tuple[slice, ...]]]]:
    """The grid cut into blocks: (index of a vehicle with the geometry, its blocks), geometry by geometry.

    A block holds at most `most` vehicles of one L_c and L_t, because the lags are common to it; it is never cut
    along speed, so that the matrix product of every row is the same whatever the cut.
    """
    shape = vehicle.shape
    fixed = [_varies(vehicle, axis) for axis in range(len(shape))]
    inside = cells(tuple(1 if f else n for n, f in zip(shape, fixed, strict=True)), most)
    for geometry in np.ndindex(*(n if f else 1 for n, f in zip(shape, fixed, strict=True))):
        yield (
            geometry,
            [
                tuple(slice(g, g + 1) if f else s for g, f, s in zip(geometry, fixed, cell, strict=True))
                for cell in inside
            ],
        )


def cells(shape: tuple[int, ...], most: int) -> list[tuple[slice, ...]]:
    """A grid cut into blocks of at most `most` vehicles (but one at least), about as long along every axis.

    So whatever depends on some of the axes only is computed least often.
    """
    size = [1] * len(shape)
    while 2 * math.prod(size) <= most and any(s < n for s, n in zip(size, shape, strict=True)):
        shortest = min((axis for axis, n in enumerate(shape) if size[axis] < n), key=lambda axis: size[axis])
        size[shortest] *= 2
    size = [-(-n // -(-n // step)) for n, step in zip(shape, size, strict=True)]  # all about equally long
    starts = [range(0, n, step) for n, step in zip(shape, size, strict=True)]
    return [
        tuple(slice(s, min(s + step, n)) for s, step, n in zip(corner, size, shape, strict=True))
        for corner in itertools.product(*starts)
    ]


def _varies(vehicle: Vehicle, axis: int) -> bool:
    """Whether the lags' geometry changes along a grid axis."""
    behind = len(vehicle.shape) - axis
    shapes = (np.shape(vehicle.half_bogie_spacing), np.shape(vehicle.half_wheelbase))
    return any(len(shape) >= behind and shape[-behind] > 1 for shape in shapes)


def cut(vehicle: Vehicle, cell: tuple[slice | NDArray[np.intp], ...]) -> Vehicle:
    """The part of a grid of vehicles inside `cell`; a field stays whole along axes where it has length 1."""

    def part(field: object) -> object:
        array = np.asarray(field)
        if array.ndim == 0:
            return field
        array = array.reshape((1,) * (len(cell) - array.ndim) + array.shape)
        for axis, some in enumerate(cell):
            if array.shape[axis] > 1:
                array = array[(slice(None),) * axis + (some,)]
        return array

    return vehicle.map(part)


def _own_quadrature(study: Study, index: tuple[int, ...]) -> dict[str, rms.MeanSquare]:
    """Mean squares of one vehicle at every speed with nodes placed for it alone, and denser."""
    vehicle = study.vehicle.at(index)
    resonances = poles(vehicle)
    lag = float(wheel_lags(vehicle, study.speed.min())[-1])
    finite = np.isfinite(resonances).all()
    first = _first_edges(study, resonances) if finite else np.zeros(2)
    if not finite or 2 * rms.fewest_nodes(first, lag) * study.speed.size > LARGEST_RULE:
        nothing = {
            k: np.full((len(SERIES[k].positions), *(1,) * len(index), study.speed.size), np.nan) for k in study.names
        }
        return {k: rms.MeanSquare(v, v) for k, v in nothing.items()}
    edges = rms.panel_edges(
        first, np.concatenate([resonances, singular_points(study.spectrum, study.speed)]), lag, refine=1.25
    )
    rule = rms.quadrature(edges)
    nodes = _weighted_nodes(study, index, rule, OWN_NODES)
    squares = rms.mean_squares(vehicle, study.names, nodes, rms.rounding(resonances, _limits(study)))
    if np.isinf(_limits(study)).any():
        beyond = rms.truncation_bound(vehicle, study.names, study.spectrum, study.speed, float(edges[-1]))
        squares = {k: replace(m, error=m.error + beyond[k]) for k, m in squares.items()}
    return {
        k: rms.MeanSquare(*(np.expand_dims(x, tuple(range(1, 1 + len(index)))) for x in (m.value, m.error)))
        for k, m in squares.items()
    }


def _root(square: rms.MeanSquare) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """RMS and its relative error; the root halves a relative error."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(square.value), square.error / square.value / 2


def _store(solution: Solution, cell: tuple[slice, ...], squares: dict[str, rms.MeanSquare], method: str) -> None:
    for name, square in squares.items():
        root, error = _root(square)
        solution.rms[name][(slice(None), *cell)] = root
        solution.relative_error[name][(slice(None), *cell)] = error
    solution.method[cell] = METHOD.index(method)


def _judge(study: Study, solution: Solution) -> None:
    """Give every point its status, and NaN where it is not ok."""
    errors = np.concatenate(list(solution.relative_error.values()))
    finite = np.all([np.all(np.isfinite(v), axis=0) for v in solution.rms.values()], axis=0)
    solution.status[np.all(errors <= TOLERANCE, axis=0) & finite] = STATUS.index("ok")
    solution.status[~finite] = STATUS.index("failed")
    damperless = np.equal(study.vehicle.primary_damping, 0) | np.equal(study.vehicle.secondary_damping, 0)
    for index in map(tuple, np.argwhere(np.broadcast_to(damperless, study.vehicle.shape))):
        undamped = _undamped(study.vehicle.at(index), _limits(study))
        solution.status[index][undamped] = STATUS.index("undamped")
    bad = solution.status != STATUS.index("ok")
    solution.method[bad] = METHOD.index("none")
    for values in (*solution.rms.values(), *solution.relative_error.values()):
        values[:, bad] = np.nan


def _undamped(vehicle: Vehicle, limits: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether a chain without any damper resonates inside the band, [speeds]: its variance is infinite."""
    result = np.zeros(limits.shape[1], dtype=bool)
    for chain in CHAINS:
        if all(damping == 0 for _, damping, _ in ladder(vehicle, chain)[1]):
            resonances = np.abs(np.linalg.eigvals(state_space(chain_system(vehicle, chain)).a).imag)
            inside = (resonances[:, None] > limits[0]) & (resonances[:, None] < limits[1])
            result |= inside.any(axis=0)
    return result


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _run(task: Callable, items: list, jobs: int) -> None:
    """Call `task` on every item, on `jobs` threads (numpy lets go of the interpreter's lock)."""
    if jobs == 1 or len(items) < 2:
        for item in items:
            task(item)
        return
    pool = ThreadPoolExecutor(jobs)
    try:
        for future in [pool.submit(task, item) for item in items]:
            future.result()
    finally:
        pool.shutdown(cancel_futures=True)  # an interruption waits for the blocks at work, not for those in line
