"""A campaign: no number with status ok is off by more than its estimate, in bands and over the whole axis.

Kinds in turn (`plain_vehicles.MAKERS`); dampings from a millionth of usual ones to overdamped; 5 to 300 km/h. Bands are
held against panels around the dense solution's peaks, the whole axis against contour integrals.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from dataclasses import dataclass, field

import numpy as np

from freqrail.model.band import Band
from freqrail.solver import solve
from freqrail.solver.problem import problem_of
from tests import contours
from tests.dense_integrals import band_rms
from tests.plain_vehicles import MAKERS, TRACK, Plain, as_system, outputs_of

REFERENCE = 3e-11
"""What the references themselves may be off, relative."""

SHARPEST = 1e5
"""Of peaks that contours around their poles still resolve; sharper ones are integrated along the axis."""

EVERYTHING = (1e-4, 3e5)
"""rad/s: what of the whole axis holds all but 1e-11 of a mean square."""

PROMISED = 1e-9


@dataclass
class Found:
    """Of one draw. worst: largest error over estimate. ok: numbers with status ok, withheld: others."""

    violations: list[str] = field(default_factory=list)
    ok: int = 0
    withheld: int = 0
    worst: float = 0.0
    promised: int = 0


def draw(seed: int, number: int) -> tuple[str, Plain, float, Band | None]:
    """A vehicle, a speed in m/s and a band; draw `number` of a seed, whatever the others."""
    rng = np.random.default_rng((seed, number))
    kind = list(MAKERS)[number % len(MAKERS)]
    plain = MAKERS[kind](rng)
    factor = 10 ** rng.choice([0.0, rng.uniform(-6, 0), rng.uniform(0, 2)])
    for name in plain.values:
        if name.endswith(("_c", "_c2", "_damping", "_coefficient", "_eta")):
            plain.values[name] *= factor
    bands = (
        Band("frequency", 0.1, 100.0),
        Band("wavelength", 1.0, float(rng.uniform(30, 200))),
        Band("frequency", float(rng.uniform(0.05, 5)), float(rng.uniform(10, 400))),
        None,
    )
    band = bands[rng.integers(4)]
    if kind == "irrational laws" and band is None:
        band = bands[0]
    return kind, plain, float(np.exp(rng.uniform(np.log(5 / 3.6), np.log(300 / 3.6)))), band


def check(task: tuple[int, int]) -> Found:
    """One draw against the references."""
    kind, plain, speed, band = draw(*task)
    found = Found()
    problem = problem_of(as_system(plain), outputs_of(plain), plain.values, np.array([speed]), TRACK, band)
    with np.errstate(all="ignore"):
        solution = solve.solve(problem)
    if band is None and contours.sharpness(plain) > SHARPEST:
        expected = band_rms(plain, speed, *EVERYTHING)
    elif band is None:
        expected = {name: np.sqrt(each) for name, each in contours.mean_squares(plain, TRACK, speed).items()}
    else:
        low, high = problem.limits[:, 0]
        expected = band_rms(plain, speed, low, high)
    for name, right in expected.items():
        values, errors = solution.rms[name][:, 0], solution.relative_error[name][:, 0]
        for label, (value, error, true) in enumerate(zip(values, errors, right, strict=True)):
            if not np.isfinite(value):
                found.withheld += 1
                if solution.status[0] == 0:
                    found.violations.append(f"{name}[{label}]: no number at a point that is ok")
                continue
            off = abs(value / true - 1)
            found.ok += 1
            found.promised += error <= PROMISED
            found.worst = max(found.worst, max(0.0, off - REFERENCE) / error)
            if off > error + REFERENCE:
                found.violations.append(f"{kind}, {band}, {name}[{label}]: off by {off:.1e}, estimate {error:.1e}")
    return found


def main() -> int:
    """Run the campaign; 1 if there is a violation."""
    parser = argparse.ArgumentParser(prog="python -m tests.any_vehicle", description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=300, help="vehicles")
    parser.add_argument("--seed", type=int, default=0, help="of the draws; the same seed, the same draws")
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    asked = parser.parse_args()
    tasks = [(asked.seed, number) for number in range(asked.first, asked.first + asked.count)]
    start, total, violated = time.perf_counter(), Found(), 0
    with multiprocessing.Pool(asked.jobs) as pool:
        for (_, number), found in zip(tasks, pool.imap(check, tasks), strict=True):
            total.ok, total.withheld = total.ok + found.ok, total.withheld + found.withheld
            total.promised, total.worst = total.promised + found.promised, max(total.worst, found.worst)
            if found.violations:
                violated += 1
                print(f"draw {number} of seed {asked.seed}:", *found.violations, sep="\n    ", flush=True)
    print(
        f"{len(tasks)} vehicles, seed {asked.seed}: {violated} with violations; {total.ok} numbers, {total.promised} "
        f"of them promised to {PROMISED:g}, {total.withheld} withheld; largest error {total.worst:.2f} of its "
        f"estimate, {time.perf_counter() - start:.0f} s"
    )
    return 1 if violated else 0


if __name__ == "__main__":
    sys.exit(main())
