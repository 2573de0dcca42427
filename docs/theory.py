"""The drawing and the printed tables of docs/theory.md, each by its name; from the repository's folder:

    .venv/bin/python -m docs.theory blocks

Names: drawing (writes docs/vehicle.svg), blocks, columns, nodes, errors, kinds, rail; page puts what the tables print
into the page.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import freqrail
from freqrail.model.band import Band
from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.spectrum import RationalSpectrum
from freqrail.reduction.blocks import blocks_of
from freqrail.reduction.columns import lag_sums, reduce
from freqrail.replication.mechanism import on_rail
from freqrail.replication.yielding_rail import TYPICAL, wheel_resonance
from freqrail.solver.detours import without
from freqrail.solver.panels import shared_panels
from freqrail.solver.problem import Problem, half_vehicle_problem, problem_of
from freqrail.solver.quadrature import quadrature
from freqrail.solver.solve import solve
from freqrail.solver.transfer import transfer
from tests import contours, independent
from tests.plain_vehicles import MAKERS, as_system, dense_outputs, lagged, outputs_of

PICTURE, PAGE = (Path(__file__).parent / name for name in ("vehicle.svg", "theory.md"))
PAPER = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke")
SPEED = 250 / 3.6  # m/s
SEED = 0  # of the vehicles of `tests.plain_vehicles`
VARYING = {"half_bogie_spacing": np.array([3.0, 9.0]), "half_wheelbase": np.array([0.8, 1.3])}
"""Lengths that vary, so that they stay symbols."""


# --- tables ------------------------------------------------------------------------------------------


def blocks() -> Iterator[str]:
    """Blocks of every kind of vehicle, and how many columns their outputs have."""
    heads = f"{'blocks: freedoms (inputs)':48}{'lag functions':>14}{'products':>9}"
    yield f"{'vehicle':26}{'freedoms':>9}{'wheels':>7}  {heads}"
    for kind, make in MAKERS.items():
        plain = make(np.random.default_rng(SEED))
        system = as_system(plain)
        found = [f"{block.size} ({len(block.inputs)})" for block in blocks_of(system, plain.values)[1]]
        reduction = reduce(system, outputs_of(plain), plain.values)
        most = max(map(len, reduction.columns.values()))
        yield (
            f"{kind:26}{len(system.freedoms):9}{len(system.wheels):7}  {', '.join(found):48}"
            f"{len(reduction.lags):14}{most:9}"
        )


def columns() -> Iterator[str]:
    """The paper's lag functions as sums over the wheels' distances, and the products of its responses."""
    reduction = reduce(half_vehicle(), outputs(), VARYING)
    forms, factors = lag_sums(reduction)
    kinds = ["cos" if lag.part == "re" else "sin" for lag in reduction.lags]
    order = np.lexsort(np.abs(forms).T)
    names = [
        " ".join(f"{factor:+g} {length}" for factor, length in zip(form, ("", "L_c", "L_t"), strict=True) if factor)
        for form in forms
    ]
    yield "lag function" + "".join(f"{names[k] or '0':>18}" for k in order)
    for number, (kind, row) in enumerate(zip(kinds, factors, strict=True)):
        scaled = row / np.sum(np.abs(row)) * np.sign(row[order][np.flatnonzero(row[order])[0]])
        yield f"{number + 1} {kind:10}" + "".join(f"{scaled[k] + 0.0:18g}" for k in order)
    yield ""
    for name, found in reduction.columns.items():
        numbers = sorted({column.lag + 1 for column in found})
        yield f"{name:28}products: {len(found)}, of lag functions {', '.join(map(str, numbers))}"


def nodes() -> Iterator[str]:
    """Groups of speeds and the nodes that every vehicle of a group shares."""
    joints = np.array([0.5, 1, 5, 10, 50, 100]) * 1e6
    for words, speed, end in (
        ("100 to 300 km/h by 10 km/h, 0.1 to 100 Hz", np.arange(100, 301, 10), 100.0),
        ("1 to 600 km/h by 1 km/h, 0.1 to 100 Hz", np.arange(1, 601), 100.0),
        ("100 to 300 km/h by 10 km/h, 0.1 to 400 Hz", np.arange(100, 301, 10), 400.0),
    ):
        study = paper_problem(speed / 3.6, Band("frequency", 0.1, end), joints)
        groups = shared_panels(study)
        yield f"{words}: groups of {', '.join(str(each.speeds.size) for each in groups)} speeds"
        axis = [without(quadrature(each.edges), each.detours).omega.size for each in groups if each.edges is not None]
        yield f"    nodes on the axis {', '.join(map(str, axis))}"
        for each in groups[0].detours:
            low, high = (omega / 2 / np.pi for omega in (each.low, each.high))
            yield f"    nodes on a detour {each.rule().omega.size}, from {low:.0f} to {high:.0f} Hz"


def errors() -> Iterator[str]:
    """The paper's vehicle at 250 km/h against equations and integrals typed out in `tests.independent`."""
    yield f"{'paper, 250 km/h, 11 series':28}{'largest error':>14}{'estimate':>10}"
    for words, limits in (("0.1 to 100 Hz", (0.1, 100.0)), ("0.1 to 400 Hz", (0.1, 400.0)), ("whole axis", None)):
        band = None if limits is None else Band("frequency", *limits)
        found = solve(paper_problem(np.array([SPEED]), band))
        if limits is None:
            expected = independent.whole_axis_rms(
                independent.PAPER, *independent.state_matrices(independent.PAPER), independent.TRACK, SPEED
            )
        else:
            low, high = (2 * np.pi * f for f in limits)
            expected = independent.band_rms(independent.PAPER, independent.TRACK, SPEED, low, high)
        error = max(float(np.max(np.abs(found.rms[k][:, 0] / expected[k] - 1))) for k in PAPER)
        estimate = max(float(np.max(found.relative_error[k])) for k in PAPER)
        yield f"{words:28}{error:14.1e}{estimate:10.1e}"


def kinds() -> Iterator[str]:
    """Every kind of vehicle: frequency response against dense solutions, closed form against contour integrals."""
    track = RationalSpectrum("german-low", independent.TRACK.roughness, independent.TRACK.cutoffs)
    yield f"{'':26}{'response':>10}{'whole axis':>12}{'estimate':>10}"
    for kind, make in MAKERS.items():
        plain = make(np.random.default_rng(SEED))
        some = outputs_of(plain)
        problem = problem_of(as_system(plain), some, plain.values, np.array([SPEED]), track, None)
        omega = 2 * np.pi * np.geomspace(0.1, 300.0, 200)
        response = float(max(differences(problem, plain, omega)))
        if not problem.reduction.system.rational:
            yield f"{kind:26}{response:10.0e}{'no poles':>12}"
            continue
        found, expected = solve(problem), contours.mean_squares(plain, track, SPEED)
        names = [output.name for output in some]
        error = max(float(np.max(np.abs(found.rms[k][:, 0] / np.sqrt(expected[k]) - 1))) for k in names)
        estimate = max(float(np.max(found.relative_error[k])) for k in names)
        yield f"{kind:26}{response:10.0e}{error:12.0e}{estimate:10.0e}"


def rail() -> Iterator[str]:
    """The paper's vehicle at 250 km/h, 0.1 to 100 Hz, on a rigid and on a yielding rail."""
    case = freqrail.load_case("yu-damper-joint")
    rigid, yielding = on_rail(case, None), on_rail(case, TYPICAL)
    yield f"{'':32}{'rigid rail':>14}{'yielding rail':>15}"
    for words, name in (("bogie frame", "bogie_acceleration"), ("car body", "car_body_acceleration")):
        yield f"{words + ' RMS with joints':32}{rigid.joint[name]:9.4g} m/s²{yielding.joint[name]:10.4g} m/s²"
        joints = [100 * each.departure(name) for each in (rigid, yielding)]
        yield f"{'effect of the joints on it':32}{joints[0]:+12.1f} %{joints[1]:+13.1f} %"
    change = max(abs(yielding.joint[name] / rigid.joint[name] - 1) for name in PAPER if name != "bogie_acceleration")
    yield f"change of the car body and of the strokes: at most {100 * change:.1f} %"
    frequency, damping = wheel_resonance(case.vehicle, TYPICAL)
    yield f"wheelsets on the yielding rail: {frequency:.1f} Hz, damping ratio {damping:.3f}"


def differences(problem: Problem, plain, omega: np.ndarray) -> Iterable[float]:
    """Of the transfer functions from dense ones, relative to the largest of each label."""
    found = transfer(problem.reduction, problem.values, omega, SPEED)
    x = problem.reduction.places(problem.values)
    middle = np.exp(1j * omega / SPEED * (np.max(x) + np.min(x)) / 2)
    for name, each in dense_outputs(plain, omega).items():
        for label, expected in zip(found[name], each, strict=True):
            dense = lagged(expected, plain, omega, SPEED)
            yield float(np.max(np.abs(label * middle - dense)) / np.max(np.abs(dense)))


def paper_problem(speed: np.ndarray, band: Band | None, joints: np.ndarray | None = None) -> Problem:
    """The paper's vehicle, or a grid of it with these stiffnesses of both kinds of joints."""
    case = freqrail.load_case("yu-damper-joint")
    vehicle = case.vehicle
    if joints is not None:
        vehicle = replace(vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints)
    return half_vehicle_problem(vehicle, speed, case.spectrum, band, PAPER)


TABLES = {"blocks": blocks, "columns": columns, "nodes": nodes, "errors": errors, "kinds": kinds, "rail": rail}

PRINTED = re.compile(rf"(?<=`python -m docs\.theory )({'|'.join(TABLES)})`((?:(?!```).)*)```text\n(.*?)```", re.DOTALL)
"""A command on the page, the words up to what it prints, and that."""


def printed(name: str) -> str:
    """What a table prints."""
    return "".join(f"{line.rstrip()}\n" for line in TABLES[name]())


def main(name: str) -> None:
    if name == "page":
        text = PAGE.read_text(encoding="utf-8")
        new = PRINTED.sub(lambda found: f"{found[1]}`{found[2]}```text\n{printed(found[1])}```", text)
        PAGE.write_text(new, encoding="utf-8")
        return
    if name == "drawing":
        from docs.vehicle import draw

        draw(PICTURE)
        return
    print(printed(name), end="")


if __name__ == "__main__":
    main(*sys.argv[1:])
