"""Benchmarks: `python -m tests.bench` prints what freqrail's sweeps cost beside the loop a user would write.

Every figure is a ratio to the loop timed in the same run, for machines differ and are noisy.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import freqrail
from tests.bench.peers import user_loop


def best(function, runs: int) -> float:
    """Shortest wall time of `function` in s over some runs, after one that warms up."""
    function()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def paper_grid(runs: int) -> None:
    """The paper's grid, all default responses and both models, beside the loop for ONE grid point."""
    case = freqrail.load_case("yu-damper-joint")
    band = (case.band.low, case.band.high)
    loop = best(lambda: user_loop(case.vehicle, case.speed, case.spectrum, band), runs)
    grid = best(lambda: freqrail.sweep(case), runs)
    result = freqrail.sweep(case)
    point = result.sel(speed=250, primary_joint_stiffness=5, secondary_joint_stiffness=5)
    names = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke")
    values = np.concatenate([point[f"{name}_rms"].values for name in names])
    apart = np.max(np.abs(user_loop(case.vehicle, case.speed, case.spectrum, band) / values - 1))
    print(f"user's loop, 1 grid point, 1,000 frequencies   {1e3 * loop:8.1f} ms")
    print(f"freqrail.sweep, {result.status.size} grid points, both models  {1e3 * grid:8.1f} ms")
    print(f"the whole grid costs {grid / loop:.2f} of the loop's single points (asked: at most 10)")
    print(f"largest difference of the loop from freqrail at 250 km/h: {apart:.1e} (the loop's own error)")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    paper_grid(2 if parser.parse_args().quick else 7)


if __name__ == "__main__":
    main()
