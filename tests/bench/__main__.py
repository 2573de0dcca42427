"""Benchmarks: `python -m tests.bench` prints what freqrail costs beside other ways to the same numbers.

Speeds are ratios to the loop a user would write, timed in the same run, for machines differ and are noisy; nothing
is asserted. Errors are against integrals and sums of residues of `tests/independent.py`, which imports nothing of
freqrail.
"""

from __future__ import annotations

import argparse
import importlib.util
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import freqrail
from freqrail.model.responses import RESPONSES
from freqrail.solver import solve
from freqrail.solver.problem import Problem, half_vehicle_problem
from tests.bench.closed_form import closed_form
from tests.bench.peers import PEERS, user_loop
from tests.independent import PAPER, SPEED, TRACK, band_rms, state_matrices, whole_axis_rms

NAMES = tuple(name for name, response in RESPONSES.items() if response.paper)
BANDS = {"0.1-100 Hz": (0.1, 100.0), "whole axis": None}
NEEDS = {"python-control": "control", "pyyeti": "pyyeti"}


def median(function, runs: int) -> float:
    """Median wall time of `function` in s over some runs, after one that warms up."""
    function()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def single(study: Problem) -> np.ndarray:
    """The eleven numbers of a study with one vehicle and one speed."""
    solution = solve.solve(study)
    return np.concatenate([solution.rms[name][:, 0] for name in NAMES])


def study_of(case, band, speeds=None, vehicle=None) -> Problem:
    return half_vehicle_problem(
        vehicle or case.vehicle,
        np.atleast_1d(case.speed if speeds is None else speeds),
        case.spectrum,
        case.band if band else None,
        NAMES,
    )


def peers(case, runs: int) -> None:
    """Points per second and errors of every peer on the paper's case at 250 km/h."""
    print("\npaper's case at 250 km/h, eleven series                 points/s    x loop   largest relative error")
    for words, band in BANDS.items():
        exact = np.concatenate([independent(band)[name] for name in NAMES])
        loop = median(partial(user_loop, case.vehicle, case.speed, case.spectrum, band), runs)
        for name, peer in PEERS.items():
            package = next((p for key, p in NEEDS.items() if name.startswith(key)), None)
            if package and not importlib.util.find_spec(package):
                print(f"  {words}: {name:42s} not installed: pip install -e '.[bench]'")
                continue
            values = peer(case.vehicle, case.speed, case.spectrum, band)
            here = partial(peer, case.vehicle, case.speed, case.spectrum, band)
            seconds = loop if peer is user_loop else median(here, 1)
            row(words, name, 1 / seconds, loop, np.max(np.abs(values / exact - 1)))
        here = partial(single, study_of(case, band))
        row(words, "freqrail, this point alone", 1 / median(here, runs), loop, np.max(np.abs(here() / exact - 1)))


def independent(band) -> dict[str, np.ndarray]:
    """The paper's RMS values at 250 km/h, by quadrature or residues that know nothing of freqrail."""
    if band:
        return band_rms(PAPER, TRACK, SPEED, *(2 * np.pi * f for f in band))
    return whole_axis_rms(PAPER, *state_matrices(PAPER), TRACK, SPEED)


def row(words: str, name: str, rate: float, loop: float, error: float) -> None:
    print(f"  {words}: {name:36s} {rate:11.1f} {rate * loop:9.2f}   {error:.1e}")


def paper_grid(case, runs: int) -> None:
    """The paper's grid, all default responses and both models, beside the loop for ONE grid point."""
    loop = median(lambda: user_loop(case.vehicle, case.speed, case.spectrum, BANDS["0.1-100 Hz"]), runs)
    whole = median(lambda: freqrail.sweep(case), runs)
    print(f"\nuser's loop, 1 grid point, 1,000 frequencies          {1e3 * loop:8.1f} ms")
    print(f"freqrail.sweep, 756 grid points, both models          {1e3 * whole:8.1f} ms")
    print(f"the whole grid costs {whole / loop:.2f} of the loop's single points (asked: at most 10)")


def large_grid(case, side: int, count: int) -> None:
    """`side` x `side` joint stiffnesses and `count` speeds: points per second against the loop's."""
    stiffness = np.geomspace(0.5e6, 100e6, side)
    vehicle = replace(
        case.vehicle, primary_joint_stiffness=stiffness[:, None], secondary_joint_stiffness=stiffness[None, :]
    )
    speeds = np.linspace(100, 300, count) / 3.6
    points = side * side * count
    print(f"\n{side} x {side} joint stiffnesses x {count} speeds, eleven series, warm process, two threads")
    for words, band in BANDS.items():
        study = study_of(case, band, speeds, vehicle)
        loop = median(lambda: user_loop(case.vehicle, case.speed, case.spectrum, BANDS["0.1-100 Hz"]), 3)
        own = min(elapsed(partial(solve.solve, study, jobs=2)) for _ in range(2))
        rate = points / own
        print(f"  {words}: {points} points in {own:6.2f} s, {rate:9.0f} points/s, {rate * loop:8.0f} x loop")


def elapsed(function) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def growth(case, picture: Path | None) -> None:
    """Wall time against the number of stiffness pairs (at 100 speeds) and of speeds (at 1,600 pairs)."""
    print("\nstiffness pairs  speeds   0.1-100 Hz s   whole axis s")
    rows = []
    for side, count in (
        (10, 100),
        (20, 100),
        (40, 100),
        (80, 100),
        (160, 100),
        (40, 10),
        (40, 30),
        (40, 300),
        (40, 1000),
    ):
        stiffness = np.geomspace(0.5e6, 100e6, side)
        vehicle = replace(
            case.vehicle, primary_joint_stiffness=stiffness[:, None], secondary_joint_stiffness=stiffness[None, :]
        )
        speeds = np.linspace(100, 300, count) / 3.6
        studies = [study_of(case, band, speeds, vehicle) for band in BANDS.values()]
        times = [min(elapsed(partial(solve.solve, study, jobs=2)) for _ in range(3)) for study in studies]
        print(f"{side * side:15d} {count:7d} {times[0]:14.3f} {times[1]:14.3f}")
        rows.append((side * side, count, *times))
    if picture:
        draw_growth(np.array(rows), picture)


def draw_growth(rows: np.ndarray, picture: Path) -> None:
    """Both kinds of growth beside a line of slope one, as a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.8), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for ax, column, fixed, words in (
        (axes[0], 0, rows[:, 1] == 100, "stiffness pairs (100 speeds)"),
        (axes[1], 1, rows[:, 0] == 1600, "speeds (1,600 stiffness pairs)"),
    ):
        some = rows[fixed][np.argsort(rows[fixed, column])]
        for k, band in enumerate(BANDS):
            ax.loglog(some[:, column], some[:, 2 + k], "o-", label=band)
        line = some[[0, -1], column]
        ax.loglog(line, some[-1, 2] * line / line[-1], "k:", label="proportional")
        ax.set(xlabel=words)
        ax.grid(alpha=0.3)
    axes[0].set(ylabel="wall time, s")
    axes[0].legend()
    figure.savefig(picture, dpi=120)


def end_to_end(case) -> None:
    """`freqrail sweep` of a million grid points from the shell to the closed file: time and peak memory."""
    loop = median(lambda: user_loop(case.vehicle, case.speed, case.spectrum, BANDS["0.1-100 Hz"]), 3)
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "freqrail", "sweep", "yu-damper-joint", "-o", str(Path(folder, "million.nc"))]
        command += ["--over", "speed=lin:100:300:100 km/h"]
        for joint in ("primary", "secondary"):
            command += ["--over", f"{joint}_joint_stiffness=log:0.5:100:100 MN/m"]
        seconds = elapsed(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL))
        size = Path(folder, "million.nc").stat().st_size
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    print("freqrail sweep of 100 x 100 joint stiffnesses x 100 speeds, from the shell to the closed file")
    print(f"  {seconds:.1f} s, {seconds / loop:.0f} x the loop's single point, peak memory {memory:.2f} GB")
    print(f"  file {size / 1e6:.0f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="small grids, few repetitions")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="draw the growth of the wall time")
    options = parser.parse_args()
    quick = options.quick
    case = freqrail.load_case("yu-damper-joint")
    print(f"freqrail {freqrail.__version__}, numpy {np.__version__}, {time.strftime('%Y-%m-%d')}")
    if not quick:
        end_to_end(case)  # first: a child's peak memory counts what its parent holds when it starts
    paper_grid(case, 2 if quick else 7)
    peers(case, 2 if quick else 5)
    large_grid(case, *((10, 20) if quick else (100, 100)))
    closed_form(quick)
    if not quick:
        growth(case, options.picture)


if __name__ == "__main__":
    main()
