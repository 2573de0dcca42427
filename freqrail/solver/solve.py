"""RMS values over a whole grid of vehicles and speeds: closed form or quadrature, in blocks, each judged.

The speed axis of every block is one matrix product, where its vehicles can share one set of quadrature nodes
(`solver.panels`). Where resonances are too narrow for that (the wheelsets ringing on a rigid rail), and where the
shared nodes miss the tolerance, each vehicle gets nodes of its own. The bits of a value do not depend on how the grid
is cut into blocks, nor on the number of workers.
"""

from __future__ import annotations

import functools
import math
import operator
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.spectrum import frequency_psd
from freqrail.solver import block_quadrature, block_residues, quadrature
from freqrail.solver.block_lags import places_of, weighted_nodes
from freqrail.solver.block_poles import poles
from freqrail.solver.detours import weighted_detours, without
from freqrail.solver.panels import SharedPanels, own_edges, shared_panels, speed_groups
from freqrail.solver.peaks import peak_mean_squares
from freqrail.solver.problem import Problem, cells, cells_by_geometry
from freqrail.solver.quadrature import MeanSquare
from freqrail.solver.resonances import Resonances, every_pole, resonances, resonances_of_each
from freqrail.solver.rounding import rounding_errors
from freqrail.solver.solution import METHOD, STATUS, TOLERANCE, Solution
from freqrail.solver.transfer import transfer_functions
from freqrail.types import Progress

REFINE_ABOVE = 1e-8  # a shared-node result whose estimate exceeds this is computed anew with nodes of its own
CLOSED_FORM_BLOCK = 51_200  # grid points of a block in closed form
BLOCK = 256  # vehicles whose sums over the nodes are held at once: few enough to stay in the cache
TOGETHER = 64  # vehicles with nodes of their own whose resonances are found together
OWN_NODES = 500  # of a single vehicle, at once
PSD_BLOCK = 250_000  # vehicles x speeds x frequencies of a block of spectra


def solve(
    study: Problem,
    jobs: int = 1,
    progress: Progress = lambda points: None,
    nodes: tuple[SharedPanels, ...] | None = None,
) -> Solution:
    """RMS of every named response at every grid point, with an error estimate and a status each.

    jobs: threads that work on blocks; the result does not depend on it. progress: called with the
    number of grid points just finished. nodes: `shared_nodes` of the grid that this one is a part of, if any.
    Never raises for a numerical failure: such numbers are NaN.
    """
    groups = shared_panels(study) if nodes is None else nodes
    solution = _blank(study)
    if not groups:
        _solve_in_closed_form(study, solution, jobs, progress)
    if len(groups) == 1:
        _solve_by_quadrature(study, solution, groups[0], jobs, progress)
    for shared in groups if len(groups) > 1 else ():
        part = replace(study, speed=study.speed[shared.speeds])
        found = _blank(part)
        _solve_by_quadrature(part, found, shared, jobs, progress)
        for name in study.names:
            solution.rms[name][..., shared.speeds] = found.rms[name]
            solution.relative_error[name][..., shared.speeds] = found.relative_error[name]
        solution.method[..., shared.speeds] = found.method
    _judge(study, solution)
    return solution


def _blank(study: Problem) -> Solution:
    shape, labels = study.shape, _labels(study)
    return Solution(
        rms={name: np.full((count, *shape), np.nan) for name, count in labels.items()},
        relative_error={name: np.full((count, *shape), np.nan) for name, count in labels.items()},
        status=np.full(shape, STATUS.index("unresolved_peak"), np.int8),
        method=np.zeros(shape, np.int8),
    )


def _labels(study: Problem) -> dict[str, int]:
    """How many labels every output has."""
    return {output.name: len(output.taps) for output in study.reduction.outputs}


def _solve_in_closed_form(study: Problem, solution: Solution, jobs: int, progress: Progress) -> None:
    def part(cell: tuple[slice, ...]) -> None:
        some = study.cut(cell)
        _store(solution, cell, _closed_form(some), "closed_form")
        progress(some.points)

    _run(part, cells(study.vehicles, CLOSED_FORM_BLOCK // study.speed.size), jobs)
    _run(partial(_improve, study, solution), _inaccurate(study, solution), jobs)


def _closed_form(study: Problem) -> dict[str, MeanSquare]:
    return block_residues.whole_axis_mean_squares(study.reduction, study.values, study.spectrum, study.speed)


def _inaccurate(study: Problem, solution: Solution) -> list[tuple[int, ...]]:
    """Vehicles of which a damped response has an error estimate above TOLERANCE, or none at all, at some speed."""
    result = np.zeros(study.vehicles, dtype=bool)
    for name, error in solution.relative_error.items():
        undamped = functools.reduce(
            operator.or_, (_without_damper(study, index) for index in study.reduction.blocks_in(name))
        )
        result |= ~(np.max(error, axis=(0, -1)) <= TOLERANCE) & ~undamped
    return [tuple(map(int, index)) for index in np.argwhere(result)]


def _improve(study: Problem, solution: Solution, index: tuple[int, ...]) -> None:
    """Quadrature for one vehicle, kept for the responses and speeds where its error estimates are the smaller ones."""
    alone = study.at(index)
    found = resonances(alone.reduction, alone.values)
    for speeds in speed_groups(alone, every_pole(found)):
        squares = _own_quadrature(replace(alone, speed=study.speed[speeds]), found)
        own = {name: _root(square) for name, square in squares.items()}
        at: tuple[Any, ...] = (slice(None), *index, speeds)
        for name, (root, error) in own.items():
            before, after = (np.max(e, axis=0) for e in (solution.relative_error[name][at], error))
            better = (after < before) | ~np.isfinite(before)
            solution.rms[name][at] = np.where(better, root, solution.rms[name][at])
            solution.relative_error[name][at] = np.where(better, error, solution.relative_error[name][at])
            method = solution.method[at[1:]]
            solution.method[at[1:]] = np.where(better, METHOD.index("own_quadrature"), method)


def _solve_by_quadrature(
    study: Problem, solution: Solution, shared: SharedPanels, jobs: int, progress: Progress
) -> None:
    own: list[tuple[int, ...]] = []
    if shared.edges is None:
        own = list(np.ndindex(study.vehicles))
    else:
        for geometry, group in cells_by_geometry(study, BLOCK):
            nodes = _shared_nodes(study, geometry, shared)

            def together(cell: tuple[slice, ...], nodes: list[quadrature.WeightedNodes] = nodes) -> None:
                part = study.cut(cell)
                block = _by_shared_nodes(part, nodes, shared)
                _store(solution, cell, block, "shared_quadrature")
                progress(part.points)

            _run(together, group, jobs)
        worst = np.max([np.max(e, axis=(0, -1)) for e in solution.relative_error.values()], axis=0)
        own = [tuple(map(int, i)) for i in np.argwhere(~(worst <= REFINE_ABOVE))]

    def each(some: list[tuple[int, ...]]) -> None:
        for index, found in zip(some, _resonances_of_each(study, some), strict=True):
            squares = _own_quadrature(study.at(index), found)
            cell = tuple(slice(i, i + 1) for i in index)
            inside = tuple(range(1, 1 + len(index)))
            wide = {k: MeanSquare(*(np.expand_dims(x, inside) for x in (m.value, m.error))) for k, m in squares.items()}
            _store(solution, cell, wide, "own_quadrature")
            if shared.edges is None:
                progress(study.speed.size)

    _run(each, [own[k : k + TOGETHER] for k in range(0, len(own), TOGETHER)], jobs)


def _shared_nodes(study: Problem, geometry: tuple[int, ...], shared: SharedPanels) -> list[quadrature.WeightedNodes]:
    """Weighted nodes on the axis and on detours, for the wheels' places of the vehicle at an index."""
    rule = without(quadrature.quadrature(np.asarray(shared.edges)), shared.detours)
    nodes = _weighted_nodes(study, geometry, rule, quadrature.NODES)
    if shared.detours:
        values = study.at(geometry).values if geometry else study.values
        nodes += weighted_detours(study.reduction, values, study.spectrum, shared.detours, study.speed)
    return nodes


def _by_shared_nodes(
    study: Problem, nodes: list[quadrature.WeightedNodes], shared: SharedPanels
) -> dict[str, MeanSquare]:
    squares = block_quadrature.mean_squares(study.reduction, study.values, nodes, shared.rounding_errors)
    if not shared.detours:
        return squares
    added = peak_mean_squares(study.reduction, study.values, study.spectrum, study.speed, shared.detours, study.limits)
    return {
        name: MeanSquare(square.value + added[name].value, square.error + added[name].error)
        for name, square in squares.items()
    }


def _resonances_of_each(study: Problem, some: list[tuple[int, ...]]) -> list[dict[int, Resonances]]:
    """Of the vehicles at some indices of the grid."""
    places, shape = tuple(np.array(some).reshape(len(some), -1).T), study.vehicles
    values = {k: np.broadcast_to(v, shape)[places] if np.ndim(v) else v for k, v in study.values.items()}
    return resonances_of_each(study.reduction, values, len(some))


def _weighted_nodes(
    study: Problem, geometry: tuple[int, ...], rule: quadrature.Quadrature, most: int
) -> list[quadrature.WeightedNodes]:
    """Nodes with the weights of every speed and of the wheels' places of the vehicle at an index."""
    places = places_of(study.reduction, study.values, geometry)
    return list(weighted_nodes(study.reduction, places, study.spectrum, rule, study.speed, study.limits, most))


def _own_quadrature(study: Problem, found: dict[int, Resonances]) -> dict[str, MeanSquare]:
    """Mean squares of a single vehicle at every speed with nodes placed for it alone, and denser: [labels, speeds]."""
    rounding = rounding_errors(study, found)
    labels = _labels(study)
    hopeless = {name for name in study.names if not np.any(rounding[name] / 2 <= TOLERANCE)}
    if hopeless and np.isfinite(every_pole(found)).all():
        rest = study.only(tuple(name for name in study.names if name not in hopeless))
        squares = _own_quadrature(rest, found) if rest.names else {}
        zero = {name: np.zeros((labels[name], study.speed.size)) for name in hopeless}
        return squares | {name: MeanSquare(each, each + np.inf) for name, each in zero.items()}
    edges = own_edges(study, every_pole(found))
    if edges is None:
        nothing = {name: np.full((count, study.speed.size), np.nan) for name, count in labels.items()}
        return {k: MeanSquare(v, v) for k, v in nothing.items()}
    rule = quadrature.quadrature(edges)
    nodes = _weighted_nodes(study, (), rule, OWN_NODES)
    squares = block_quadrature.mean_squares(study.reduction, study.values, nodes, rounding)
    if np.isinf(study.limits).any():
        beyond = block_quadrature.truncation_bound(
            study.reduction, study.values, study.spectrum, study.speed, float(edges[-1])
        )
        squares = {k: replace(m, error=m.error + beyond[k]) for k, m in squares.items()}
    return squares


def psd(
    study: Problem, frequency: NDArray[np.float64], progress: Progress = lambda points: None
) -> dict[str, NDArray[np.float64]]:
    """One-sided PSDs {name: [labels, grid..., speeds, n]} at `frequency` [n] in Hz, per Hz, SI squared."""
    result = {name: np.empty((count, *study.shape, frequency.size)) for name, count in _labels(study).items()}
    density = frequency_psd(study.spectrum, frequency, study.speed[:, None])
    for _, group in cells_by_geometry(study, PSD_BLOCK // (frequency.size * study.speed.size)):
        for cell in group:
            part = study.cut(cell)
            found = transfer_functions(part.reduction, part.values, 2 * np.pi * frequency, study.speed)
            for name, labels in found.items():
                for place, each in enumerate(labels):
                    at: tuple[Any, ...] = (place, *cell)
                    result[name][at] = (np.square(each.real) + np.square(each.imag)) * density
            progress(part.points)
    return result


def seconds(study: Problem, jobs: int = 1) -> float:
    """Estimated wall time of `solve`, s, from timing a first block of this grid for every group of its speeds."""
    groups = shared_panels(study)
    if not groups:
        first = study.cut(cells(study.vehicles, CLOSED_FORM_BLOCK // study.speed.size)[0])
        return _timed(lambda: _closed_form(first)) * study.points / first.points / jobs
    return sum(_group_seconds(replace(study, speed=study.speed[g.speeds]), g) for g in groups) / jobs


def _group_seconds(study: Problem, shared: SharedPanels) -> float:
    if shared.edges is None:
        first = study.at((0,) * len(study.vehicles))
        return math.prod(study.vehicles) * _timed(
            lambda: _own_quadrature(first, resonances(first.reduction, first.values))
        )
    geometry, group = next(iter(cells_by_geometry(study, BLOCK)))
    nodes = _shared_nodes(study, geometry, shared)
    part = study.cut(group[0])
    once = _timed(lambda: _by_shared_nodes(part, nodes, shared))
    return once * study.points / part.points


def _timed(task: Callable[[], object]) -> float:
    start = time.perf_counter()
    task()
    return time.perf_counter() - start


def _root(square: MeanSquare) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """RMS and its relative error; the root halves a relative error."""
    with np.errstate(invalid="ignore", divide="ignore"):
        # what the track does not move is exactly 0
        return np.sqrt(square.value), np.where(square.error > 0, square.error / square.value / 2, square.error)


def _store(solution: Solution, cell: tuple[slice, ...], squares: dict[str, MeanSquare], method: str) -> None:
    for name, square in squares.items():
        root, error = _root(square)
        solution.rms[name][(slice(None), *cell)] = root
        solution.relative_error[name][(slice(None), *cell)] = error
    solution.method[cell] = METHOD.index(method)


def _judge(study: Problem, solution: Solution) -> None:
    """Give every point its status, and NaN to the numbers that cannot be promised."""
    undamped = _undamped_blocks(study)
    found = {status: np.zeros(study.shape, dtype=bool) for status in ("unresolved_peak", "failed", "undamped")}
    nothing = np.ones(study.shape, dtype=bool)
    for name, error in solution.relative_error.items():
        value = solution.rms[name]
        infinite = np.zeros(study.shape, dtype=bool)
        for index in undamped.keys() & set(study.reduction.blocks_in(name)):
            infinite |= undamped[index]
        bad = ~np.isfinite(value) | ~(error <= TOLERANCE) | infinite
        found["unresolved_peak"] |= np.any(bad, axis=0)
        found["failed"] |= np.any(~np.isfinite(value), axis=0)
        found["undamped"] |= infinite
        nothing &= np.all(bad, axis=0)
        value[bad], error[bad] = np.nan, np.nan
    solution.status[...] = STATUS.index("ok")
    for status, where in found.items():  # the gravest last
        solution.status[where] = STATUS.index(status)
    solution.method[nothing] = METHOD.index("none")


def _undamped_blocks(study: Problem) -> dict[int, NDArray[np.bool_]]:
    """Where a block without any damper resonates inside the band, {block: [grid..., speeds]}, if anywhere."""
    result = {}
    for index in {index for name in study.names for index in study.reduction.blocks_in(name)}:
        none = _without_damper(study, index)
        if none.any():
            result[index] = np.zeros(study.shape, dtype=bool)
            for place in map(tuple, np.argwhere(none)):
                result[index][place] = _undamped(study.at(place), index)
    return result


def _without_damper(study: Problem, index: int) -> NDArray[np.bool_]:
    """Vehicles of which a block has no damper at all, [grid...]."""
    damped = [strut.law.damps(study.values) for strut in study.reduction.blocks[index].struts]
    return np.broadcast_to(np.logical_not(functools.reduce(np.logical_or, damped)), study.vehicles)


def _undamped(study: Problem, index: int) -> NDArray[np.bool_]:
    """Whether a block of a single vehicle, without damper, resonates inside the band, [speeds]: infinite variance."""
    found = np.abs(poles(study.reduction.blocks[index], study.reduction.lengths, study.values).imag)
    inside = (found[:, None] > study.limits[0]) & (found[:, None] < study.limits[1])
    return np.asarray(inside.any(axis=0))


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
