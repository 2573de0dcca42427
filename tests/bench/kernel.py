"""The general kernel against the chains, alone and in one run: 100 x 100 joint stiffnesses x 100 speeds, 0.1 to 100 Hz.

python -m tests.bench.kernel
"""

from __future__ import annotations

import statistics
import time
from dataclasses import replace

import numpy as np

import freqrail
from freqrail.model.band import Band
from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.responses import RESPONSES
from freqrail.reduction.columns import reduce
from freqrail.solver import block_lags, block_quadrature, panels, quadrature, solve
from freqrail.solver.problem import Problem, cells, cut

JOINTS = np.geomspace(0.5e6, 100e6, 100)


def paper_study(count: int = 100, speeds: int = 100) -> Problem:
    """The paper's grid: joints 0.5 to 100 MN/m, 100 to 300 km/h."""
    case = freqrail.load_case("yu-damper-joint")
    joints = np.geomspace(0.5e6, 100e6, count)
    vehicle = replace(case.vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints[None, :])
    speed = np.linspace(100, 300, speeds) / 3.6
    return Problem(vehicle, speed, case.spectrum, Band("frequency", 0.1, 100.0), tuple(RESPONSES)[:4])


def main() -> None:
    """Medians of alternating runs, and the largest difference."""
    study = paper_study()
    shared = panels.shared_panels(study)[0]
    rule = quadrature.quadrature(shared.edges)
    blocks = [cut(study.vehicle, cell) for cell in cells(study.vehicle.shape, solve.BLOCK)]
    reduction = reduce(half_vehicle(), outputs()[:4], vars(study.vehicle))
    places = block_lags.places_of(reduction, vars(study.vehicle), (0, 0))

    def old() -> dict:
        weighted = solve._weighted_nodes(study, (0, 0), rule)
        return [
            quadrature.mean_squares(block.column(), study.names, weighted, shared.rounding_errors) for block in blocks
        ][-1]

    def new() -> dict:
        weighted = list(
            block_lags.weighted_nodes(
                reduction, places, study.spectrum, rule, study.speed, study.limits, quadrature.NODES
            )
        )
        return [
            block_quadrature.mean_squares(reduction, vars(block), weighted, shared.rounding_errors) for block in blocks
        ][-1]

    times: dict[str, list[float]] = {"old": [], "new": []}
    for _ in range(5):
        for name, run in (("old", old), ("new", new)):
            start = time.process_time()
            found = run()
            times[name].append(time.process_time() - start)
            if name == "old":
                before = found
    worst = max(float(np.max(np.abs(found[k].value / before[k].value - 1))) for k in study.names)
    one, other = (statistics.median(times[name]) for name in ("old", "new"))
    print(f"{study.points} points, {rule.omega.size} nodes: chains {one:.2f} s, blocks {other:.2f} s")
    print(f"ratio {one / other:.2f}, largest difference {worst:.1e}")


if __name__ == "__main__":
    main()
