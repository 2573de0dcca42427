"""Gradients by the fourteen parameters of the paper's vehicle: joints x 100 speeds, a band and the whole axis.

Beside the mean squares alone, in one run. python -m tests.bench.gradients
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

import freqrail
from freqrail.model.band import Band
from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.responses import PAPER
from freqrail.reduction.columns import reduce
from freqrail.solver import block_lags, panels, quadrature
from freqrail.solver.block_quadrature import mean_squares
from freqrail.solver.block_slopes import lengths_free
from freqrail.solver.gradients import mean_square_gradients
from freqrail.solver.lag_slopes import SPEED, gradient_nodes
from freqrail.solver.problem import Problem, cells, half_vehicle_problem
from freqrail.solver.whole_axis_gradients import whole_axis_gradients

BLOCK, BLOCKS = 128, 4


def paper_study(count: int) -> Problem:
    """The paper's vehicle with count x count joints, 0.5 to 100 MN/m, at a hundred speeds, 0.1 to 100 Hz."""
    case = freqrail.load_case("yu-damper-joint")
    joints = np.geomspace(0.5e6, 100e6, count)
    vehicle = replace(case.vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints)
    speed = np.linspace(100, 300, 100) / 3.6
    return half_vehicle_problem(vehicle, speed, case.spectrum, Band("frequency", 0.1, 100.0), PAPER)


def timed(*runs: Callable[[], object]) -> list[float]:
    """Medians of alternating runs, s of processor time."""
    times: list[list[float]] = [[] for _ in runs]
    for _ in range(5):
        for run, own in zip(runs, times, strict=True):
            start = time.process_time()
            run()
            own.append(time.process_time() - start)
    return [statistics.median(own) for own in times]


def main() -> None:
    study = paper_study(32)
    shared = panels.shared_panels(study)[0]
    rule = quadrature.quadrature(shared.edges)
    values, system, some = study.values, half_vehicle(), outputs()[:4]
    one = {name: float(np.ravel(v)[0]) for name, v in values.items()}
    parts = [study.cut(cell).values for cell in cells(study.vehicles, BLOCK)][:BLOCKS]
    points = BLOCK * BLOCKS * study.speed.size
    plain = reduce(system, some, values)
    at = study.spectrum, rule, study.speed, study.limits
    weighted = list(block_lags.weighted_nodes(plain, plain.places(one), *at, quadrature.NODES))

    def alone() -> None:
        for part in parts:
            mean_squares(plain, part, weighted, shared.rounding_errors)

    for wanted in (system.parameters, (*system.parameters, SPEED)):
        found = reduce(system, some, lengths_free(values, wanted))
        nodes = list(gradient_nodes(found, one, *at, np.zeros_like(study.limits), wanted, quadrature.NODES))

        def gradients(found=found, nodes=nodes, wanted=wanted) -> None:  # type: ignore[no-untyped-def]
            for part in parts:
                mean_square_gradients(found, part, nodes, wanted, shared.rounding_errors)

        before, after = timed(alone, gradients)
        print(
            f"band, {rule.omega.size} nodes, {len(wanted)} slopes: {points / after:,.0f} points/s a core, "
            f"mean squares alone {points / before:,.0f}, ratio {after / before:.1f}"
        )
    wanted = (*system.parameters, SPEED)
    found = reduce(system, some, lengths_free(values, wanted))
    vehicles = study.cut((slice(0, 32, 4), slice(None))).values
    for together, own in ((True, vehicles), (False, one)):
        start = time.process_time()
        whole_axis_gradients(found, own, study.spectrum, study.speed, wanted, together)
        count = 256 if together else 1
        spent = time.process_time() - start
        print(f"whole axis, {'shared' if together else 'own'} nodes: {count * study.speed.size / spent:,.0f} points/s")


if __name__ == "__main__":
    main()
