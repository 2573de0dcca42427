"""A vehicle in which nothing decouples, 34 freedoms on 16 wheels, beside a loop over the same matrices.

python -m tests.bench.large
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from freqrail.model.band import Band
from freqrail.solver import solve
from freqrail.solver.problem import problem_of
from freqrail.solver.solution import STATUS
from tests.bench.closed_form import joints, speeds
from tests.independent import density
from tests.plain_vehicles import TRACK, Plain, as_system, dense_outputs, lagged, outputs_of

BOGIES = 8
BAND = Band("frequency", 0.1, 60.0)
LINES = 3000
"""Frequencies of the loop, evenly spaced: what a user would take to be on the safe side."""


def long_car() -> Plain:
    """A car body on eight bogies of two axles; every leg has numbers of its own."""
    rng = np.random.default_rng(4)
    plain = Plain({"car_mass": 60e3, "car_inertia": 6e6, "hertz": 1.05e9, "bogie_mass": 1000.0, "bogie_inertia": 700.0})
    plain.values |= {"wheelset_mass": 700.0, "axle": 1.1}
    plain.freedoms |= {"z_c": "car_mass", "b_c": "car_inertia"}

    def leg(name: str, row: dict, stiffness: float, damping: float) -> None:
        own = {f"{name}_k": stiffness, f"{name}_c": damping, f"{name}_joint": 5e6}
        plain.values.update({key: value * float(rng.uniform(0.8, 1.2)) for key, value in own.items()})
        plain.legs.append((name, row, "paper", tuple(own)))

    for k in range(BOGIES):
        place, z, b = f"place_{k}", f"z_{k}", f"b_{k}"
        plain.values[place] = 3.5 * (BOGIES - 1 - 2 * k) / 2 + float(rng.uniform(-0.2, 0.2))
        plain.freedoms |= {z: "bogie_mass", b: "bogie_inertia"}
        leg(f"secondary_{k}", {"z_c": {"": 1.0}, "b_c": {place: -1.0}, z: {"": -1.0}}, 412e3, 54e3)
        for sign in (1.0, -1.0):
            wheel = f"{z}{'a' if sign > 0 else 'b'}"
            plain.freedoms[wheel] = "wheelset_mass"
            leg(f"primary_{wheel}", {z: {"": 1.0}, b: {"axle": -sign}, wheel: {"": -1.0}}, 875e3, 17e3)
            plain.wheels.append((f"under_{wheel}", wheel, "spring", ("hertz",), {place: 1.0, "axle": sign}))
    return plain


def loop(plain: Plain, speed: np.ndarray) -> dict[str, np.ndarray]:
    """RMS of all outputs of one vehicle at every speed as a user would: dense solutions, then a sum over lines."""
    omega = np.linspace(2 * np.pi * BAND.low, 2 * np.pi * BAND.high, LINES)
    found = dense_outputs(plain, omega)
    step = omega[1] - omega[0]
    return {
        name: np.array(
            [
                [np.sqrt(np.abs(lagged(row, plain, omega, v)) ** 2 @ density(TRACK, omega, v) * step) for v in speed]
                for row in rows
            ]
        )
        for name, rows in found.items()
        if name != "force"
    }


def large(quick: bool = False) -> None:
    """Points a second of both, and how far apart they are."""
    plain, speed = long_car(), speeds(20 if quick else 60)
    system = as_system(plain)
    grid = joints(2 if quick else 6)
    values = plain.values | {"secondary_0_joint": grid}
    outputs = tuple(output for output in outputs_of(plain) if output.name != "force")
    problem = problem_of(system, outputs, values, speed, TRACK, BAND)
    start = time.process_time()
    solution = solve.solve(problem, 1)
    ours = grid.size * speed.size / (time.process_time() - start)
    start = time.process_time()
    users = loop(long_car(), speed)
    theirs = speed.size / (time.process_time() - start)
    sizes = [block.size for block in problem.reduction.blocks]
    series = sum(len(output.taps) for output in outputs)
    ok = float(np.mean(solution.status == STATUS.index("ok")))
    apart = max(float(np.max(np.abs(users[name] / solution.rms[name][:, -1] - 1))) for name in users)
    print(
        f"\na band, {len(system.freedoms)} freedoms, {len(system.wheels)} wheels, blocks of {sizes}, {series} series: "
        f"{ours:,.0f} points/s a core, {ok:.0%} of them ok; a loop with {LINES} lines {theirs:,.0f} points/s, "
        f"{apart:.1e} from it (with other joints under one leg; nan: withheld)"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.bench.large", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    large(parser.parse_args().quick)
