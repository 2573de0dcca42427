"""The closed form over the whole axis: the paper's vehicle, and six others.

python -m tests.bench.closed_form
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

import freqrail
from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.outputs import Displacement, Elongation, Output
from freqrail.model.responses import RESPONSES
from freqrail.reduction.columns import Reduction, reduce
from freqrail.solver import block_residues
from tests.plain_vehicles import MAKERS, Plain, as_system

NAMES = tuple(RESPONSES)[:4]
GRIDS = ((32, 16, 100), (100, 100, 1))
"""Joints of both stages, and speeds: what depends on the speed decides in the first, what does not in the second."""

OTHERS = (
    "one bending mode",
    "three-axle bogies",
    "laws with inerters",
    "front and rear differ",
    "pivots off centre",
    "two coupled cars",
)


def joints(count: int) -> np.ndarray:
    return np.geomspace(0.5e6, 100e6, count)


def speeds(count: int) -> np.ndarray:
    """100 to 300 km/h in m/s."""
    return np.linspace(100, 300, count) / 3.6


def alternately(functions: list[Callable[[], object]], runs: int) -> list[float]:
    """Median processor time of each function in s over runs in turn, after one that warms up."""
    times: list[list[float]] = [[] for _ in functions]
    for run in range(runs + 1):
        for function, own in zip(functions, times, strict=True):
            start = time.process_time()
            function()
            if run:
                own.append(time.process_time() - start)
    return [statistics.median(own) for own in times]


def of_the_papers(one: int, other: int, count: int, runs: int) -> str:
    """The paper's vehicle with one x other joints, at so many speeds."""
    case = freqrail.load_case("yu-damper-joint")
    own = {"primary_joint_stiffness": joints(one)[:, None], "secondary_joint_stiffness": joints(other)}
    vehicle, speed = replace(case.vehicle, **own), speeds(count)
    values = vars(vehicle)
    reduction = reduce(half_vehicle(), outputs()[: len(NAMES)], values)
    run = partial(block_residues.whole_axis_mean_squares, reduction, values, case.spectrum, speed)
    (seconds,) = alternately([run], runs)
    return f"  {one} x {other} joints x {count} speeds: {one * other * count / seconds:8,.0f} points/s"


def usual_outputs(plain: Plain) -> tuple[Output, ...]:
    """What the paper looks at: accelerations of the car bodies and the bogies, strokes of both stages."""
    cars = [name.removesuffix("z_c") for name in plain.freedoms if name.endswith("z_c")]
    bodies = []
    for car in cars:
        for place, arm in (("front", -1.0), ("centre", 0.0), ("rear", 1.0)):
            row = {f"{car}z_c": 1.0} | ({f"{car}b_c": {"pivot": arm}} if arm else {})
            bodies.append((f"{car}{place}", Displacement(row)))
    bogies = [(f"{car}{end}", Displacement({f"{car}z_{end}": 1.0})) for car in cars for end in ("front", "rear")]
    strokes = {stage: [name for name, *_ in plain.legs if stage in name] for stage in ("secondary", "primary")}
    return (
        Output("body_acceleration", "m s-2", "place", tuple(bodies), 2),
        Output("bogie_acceleration", "m s-2", "bogie", tuple(bogies), 2),
        *(Output(stage, "m", "leg", tuple((x, Elongation(x)) for x in names)) for stage, names in strokes.items()),
    )


def vehicle_of(kind: str, one: int, other: int) -> tuple[Reduction, dict[str, np.ndarray | float]]:
    """A vehicle of a kind, with a grid of joints in one primary and one secondary law."""
    plain = MAKERS[kind](np.random.default_rng(1))
    values: dict[str, np.ndarray | float] = dict(plain.values)
    primary, secondary = (
        next(name for name in values if name.endswith("_joint") and name.startswith(stage))
        for stage in ("primary", "secondary")
    )
    values |= {primary: joints(one)[:, None], secondary: joints(other)}
    return reduce(as_system(plain), usual_outputs(plain), values), values


def of_any_vehicle(kind: str, one: int, other: int, count: int, runs: int) -> str:
    """Points per second of the closed form over blocks."""
    reduction, values = vehicle_of(kind, one, other)
    spectrum = freqrail.load_case("yu-damper-joint").spectrum
    run = partial(block_residues.whole_axis_mean_squares, reduction, values, spectrum, speeds(count))
    (seconds,) = alternately([run], runs)
    system, series = reduction.system, sum(len(output.taps) for output in reduction.outputs)
    return (
        f"  {kind:22s} {len(system.freedoms):2d} freedoms, {len(system.wheels)} wheels, "
        f"{series:2d} series: {one * other * count / seconds:9,.0f} points/s"
    )


def closed_form(quick: bool = False) -> None:
    """Both parts."""
    print("\nwhole axis in closed form, four responses, one core")
    for one, other, count in ((8, 8, 50), (20, 20, 1)) if quick else GRIDS:
        print(of_the_papers(one, other, count, 3 if quick else 5), flush=True)
    size = (6, 5, 50) if quick else (32, 16, 100)
    print(f"other vehicles, {size[0]} x {size[1]} joints x {size[2]} speeds")
    for kind in OTHERS:
        print(of_any_vehicle(kind, *size, 1 if quick else 3), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.bench.closed_form", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="small grids, few repetitions")
    closed_form(parser.parse_args().quick)
