"""RMS values over a whole grid of vehicles and speeds: closed form or quadrature, in blocks, each judged.

The speed axis of every block is one matrix product, where its vehicles can share one set of quadrature nodes
(`solver.panels`). Where resonances are too narrow for that (the wheelsets ringing on a rigid rail), and where the
shared nodes miss the tolerance, each vehicle gets nodes of its own. The bits of a value do not depend on how the grid
is cut into blocks, nor on the number of workers.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.equations import state_space
from freqrail.model.responses import RESPONSES
from freqrail.reduction.chain_columns import response_psd
from freqrail.reduction.chains import chain_system, ladder, poles
from freqrail.solver import quadrature, residues
from freqrail.solver.panels import SharedPanels, every_pole, own_edges, rounding_errors, shared_panels, speed_groups
from freqrail.solver.partial_fractions import own_resonances
from freqrail.solver.problem import Problem, cells, cells_by_geometry, cut
from freqrail.solver.solution import METHOD, STATUS, TOLERANCE, Solution
from freqrail.types import Progress

REFINE_ABOVE = 1e-8  # a shared-node result whose estimate exceeds this is computed anew with nodes of its own
CLOSED_FORM_BLOCK = 51_200  # grid points of a block in closed form
BLOCK = 256  # vehicles whose sums over the nodes are held at once: few enough to stay in the cache
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
    for shared in groups:
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
    shape = study.shape
    positions = {name: len(RESPONSES[name].signs) for name in study.names}
    return Solution(
        rms={name: np.full((count, *shape), np.nan) for name, count in positions.items()},
        relative_error={name: np.full((count, *shape), np.nan) for name, count in positions.items()},
        status=np.full(shape, STATUS.index("unresolved_peak"), np.int8),
        method=np.zeros(shape, np.int8),
    )


def _solve_in_closed_form(study: Problem, solution: Solution, jobs: int, progress: Progress) -> None:
    def part(cell: tuple[slice, ...]) -> None:
        vehicle = cut(study.vehicle, cell)
        block = residues.whole_axis_mean_squares(vehicle, study.names, study.spectrum, study.speed)
        _store(solution, cell, block, "closed_form")
        progress(replace(study, vehicle=vehicle).points)

    _run(part, cells(study.vehicle.shape, CLOSED_FORM_BLOCK // study.speed.size), jobs)
    _run(partial(_improve, study, solution), _inaccurate(study, solution), jobs)


def _inaccurate(study: Problem, solution: Solution) -> list[tuple[int, ...]]:
    """Vehicles of which a damped response has an error estimate above TOLERANCE, or none at all, at some speed."""
    result = np.zeros(study.vehicle.shape, dtype=bool)
    for name, error in solution.relative_error.items():
        result |= ~(np.max(error, axis=(0, -1)) <= TOLERANCE) & ~_without_damper(study, RESPONSES[name].chains)
    return [tuple(map(int, index)) for index in np.argwhere(result)]


def _improve(study: Problem, solution: Solution, index: tuple[int, ...]) -> None:
    """Quadrature for one vehicle, kept for the responses and speeds where its error estimates are the smaller ones."""
    vehicle = study.vehicle.at(index)
    for speeds in speed_groups(replace(study, vehicle=vehicle), poles(vehicle, study.chains)):
        squares = _own_quadrature(replace(study, speed=study.speed[speeds]), index)
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
        own = list(np.ndindex(study.vehicle.shape))
    else:
        rule = quadrature.quadrature(shared.edges)
        for geometry, group in cells_by_geometry(study.vehicle, BLOCK):
            nodes = _weighted_nodes(study, geometry, rule)

            def together(cell: tuple[slice, ...], nodes: list[quadrature.WeightedNodes] = nodes) -> None:
                part = replace(study, vehicle=cut(study.vehicle, cell))
                block = quadrature.mean_squares(part.vehicle.column(), study.names, nodes, shared.rounding_errors)
                _store(solution, cell, block, "shared_quadrature")
                progress(part.points)

            _run(together, group, jobs)
        worst = np.max([np.max(e, axis=(0, -1)) for e in solution.relative_error.values()], axis=0)
        own = [tuple(map(int, i)) for i in np.argwhere(~(worst <= REFINE_ABOVE))]

    def alone(index: tuple[int, ...]) -> None:
        squares = _own_quadrature(study, index)
        cell = tuple(slice(i, i + 1) for i in index)
        together = {
            name: quadrature.MeanSquare(
                *(np.expand_dims(x, tuple(range(1, 1 + len(index)))) for x in (m.value, m.error))
            )
            for name, m in squares.items()
        }
        _store(solution, cell, together, "own_quadrature")
        if shared.edges is None:
            progress(study.speed.size)

    _run(alone, own, jobs)


def _weighted_nodes(
    study: Problem, geometry: tuple[int, ...], rule: quadrature.Quadrature
) -> list[quadrature.WeightedNodes]:
    """Nodes with the weights of every speed and of the geometry of the vehicle at an index."""
    vehicle = study.vehicle.at(geometry)
    return list(quadrature.weighted_nodes(vehicle, study.spectrum, rule, study.speed, study.limits, quadrature.NODES))


def _own_quadrature(study: Problem, index: tuple[int, ...]) -> dict[str, quadrature.MeanSquare]:
    """Mean squares of one vehicle at every speed with nodes placed for it alone, and denser: [positions, speeds]."""
    vehicle = study.vehicle.at(index)
    found = {chain: own_resonances(vehicle, chain) for chain in study.chains}
    rounding = rounding_errors(study, found)
    hopeless = {name for name in study.names if not np.any(rounding[name] / 2 <= TOLERANCE)}
    if hopeless and np.isfinite(every_pole(found)).all():
        rest = replace(study, names=tuple(name for name in study.names if name not in hopeless))
        squares = _own_quadrature(rest, index) if rest.names else {}
        zero = {name: np.zeros((len(RESPONSES[name].signs), study.speed.size)) for name in hopeless}
        return squares | {name: quadrature.MeanSquare(each, each + np.inf) for name, each in zero.items()}
    edges = own_edges(study, vehicle, every_pole(found))
    if edges is None:
        nothing = {k: np.full((len(RESPONSES[k].signs), study.speed.size), np.nan) for k in study.names}
        return {k: quadrature.MeanSquare(v, v) for k, v in nothing.items()}
    rule = quadrature.quadrature(edges)
    nodes = quadrature.weighted_nodes(vehicle, study.spectrum, rule, study.speed, study.limits, OWN_NODES)
    squares = quadrature.mean_squares(vehicle, study.names, nodes, rounding)
    if np.isinf(study.limits).any():
        beyond = quadrature.truncation_bound(vehicle, study.names, study.spectrum, study.speed, float(edges[-1]))
        squares = {k: replace(m, error=m.error + beyond[k]) for k, m in squares.items()}
    return squares


def psd(
    study: Problem, frequency: NDArray[np.float64], progress: Progress = lambda points: None
) -> dict[str, NDArray[np.float64]]:
    """One-sided PSDs {name: [positions, grid..., speeds, n]} at `frequency` [n] in Hz, per Hz, SI squared."""
    result = {name: np.empty((len(RESPONSES[name].signs), *study.shape, frequency.size)) for name in study.names}
    for _, group in cells_by_geometry(study.vehicle, PSD_BLOCK // (frequency.size * study.speed.size)):
        for cell in group:
            part = replace(study, vehicle=cut(study.vehicle, cell))
            column = part.vehicle.column().column()
            for name in study.names:
                density = response_psd(RESPONSES[name], column, study.spectrum, frequency, study.speed[:, None])
                # a response spans only the axes that it depends on: the positions come before all of them
                missing = tuple(range(1, 1 + result[name].ndim - density.ndim))
                result[name][(slice(None), *cell)] = np.expand_dims(density, missing)
            progress(part.points)
    return result


def seconds(study: Problem, jobs: int = 1) -> float:
    """Estimated wall time of `solve`, s, from timing a first block of this grid for every group of its speeds."""
    groups = shared_panels(study)
    if not groups:
        first = cut(study.vehicle, cells(study.vehicle.shape, CLOSED_FORM_BLOCK // study.speed.size)[0])
        once = _timed(lambda: residues.whole_axis_mean_squares(first, study.names, study.spectrum, study.speed))
        return once * math.prod(study.vehicle.shape) / math.prod(first.shape) / jobs
    return sum(_group_seconds(replace(study, speed=study.speed[g.speeds]), g) for g in groups) / jobs


def _group_seconds(study: Problem, shared: SharedPanels) -> float:
    everyone = math.prod(study.vehicle.shape)
    if shared.edges is None:
        return everyone * _timed(lambda: _own_quadrature(study, (0,) * len(study.vehicle.shape)))
    rule = quadrature.quadrature(shared.edges)
    geometry, group = next(iter(cells_by_geometry(study.vehicle, BLOCK)))
    nodes = _weighted_nodes(study, geometry, rule)
    part = cut(study.vehicle, group[0])
    return everyone / math.prod(part.shape) * _timed(lambda: quadrature.mean_squares(part.column(), study.names, nodes))


def _timed(task: Callable[[], object]) -> float:
    start = time.perf_counter()
    task()
    return time.perf_counter() - start


def _root(square: quadrature.MeanSquare) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """RMS and its relative error; the root halves a relative error."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(square.value), square.error / square.value / 2


def _store(solution: Solution, cell: tuple[slice, ...], squares: dict[str, quadrature.MeanSquare], method: str) -> None:
    for name, square in squares.items():
        root, error = _root(square)
        solution.rms[name][(slice(None), *cell)] = root
        solution.relative_error[name][(slice(None), *cell)] = error
    solution.method[cell] = METHOD.index(method)


def _judge(study: Problem, solution: Solution) -> None:
    """Give every point its status, and NaN to the numbers that cannot be promised."""
    undamped = _undamped_chains(study)
    found = {status: np.zeros(study.shape, dtype=bool) for status in ("unresolved_peak", "failed", "undamped")}
    nothing = np.ones(study.shape, dtype=bool)
    for name, error in solution.relative_error.items():
        value = solution.rms[name]
        infinite = np.zeros(study.shape, dtype=bool)
        for chain in undamped.keys() & set(RESPONSES[name].chains):
            infinite |= undamped[chain]
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


def _undamped_chains(study: Problem) -> dict[str, NDArray[np.bool_]]:
    """Where a chain without any damper resonates inside the band, {chain: [grid..., speeds]}, if anywhere."""
    result = {}
    for chain in study.chains:
        none = _without_damper(study, (chain,))
        if none.any():
            result[chain] = np.zeros(study.shape, dtype=bool)
            for index in map(tuple, np.argwhere(none)):
                result[chain][index] = _undamped(study, index, chain)
    return result


def _without_damper(study: Problem, chains: tuple[str, ...]) -> NDArray[np.bool_]:
    """Vehicles of which one of the chains has no damper at all, [grid...]."""
    result = np.zeros(study.vehicle.shape, dtype=bool)
    for chain in chains:
        none = np.ones(study.vehicle.shape, dtype=bool)
        for _, damping, _ in ladder(study.vehicle, chain)[1]:
            none &= np.equal(damping, 0)
        result |= none
    return result


def _undamped(study: Problem, index: tuple[int, ...], chain: str) -> NDArray[np.bool_]:
    """Whether a vehicle's chain, without damper, resonates inside the band, [speeds]: its variance is infinite."""
    resonances = np.abs(np.linalg.eigvals(state_space(chain_system(study.vehicle.at(index), chain)).a).imag)
    inside = (resonances[:, None] > study.limits[0]) & (resonances[:, None] < study.limits[1])
    return inside.any(axis=0)


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
