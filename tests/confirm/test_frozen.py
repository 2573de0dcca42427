"""What both sides of a confirmation share, held to numbers from elsewhere.

The case reader, its units, the wheel load and contact stiffness of eq. (1), the spectrum, the band and the lags are the
same for the frequency and the time side, so that no confirmation can see a fault in them. tests/reference/
plain_solver.py has a reader and a solver of its own, imports nothing of freqrail, and made frozen.json.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import freqrail
from freqrail.model.responses import RESPONSES
from freqrail.model.spectrum import GERMAN_CUTOFFS, GERMAN_ROUGHNESS
from freqrail.model.vehicle import static_wheel_load
from tests.reference import plain_solver

TABLE = json.loads((Path(__file__).parents[1] / "reference" / "frozen.json").read_text(encoding="utf-8"))
UNITS = {"mass": "kg", "joint_stiffness": "N/m", "spacing": "m", "wheelbase": "m"}


def settings(point) -> dict[str, str]:
    changes = {
        name: f"{value} {UNITS[next(u for u in UNITS if u in name)]}" for name, value in point["changes"].items()
    }
    return changes | {"spectrum": point["spectrum"], "speed": f"{point['speed_kmh']} km/h"}


@pytest.fixture(params=range(len(TABLE["points"])), ids=lambda k: f"point {k}")
def point(request):
    return TABLE["points"][request.param]


def test_there_are_a_hundred_numbers():
    assert sum(len(point["rms"]) + 2 for point in TABLE["points"]) >= 100


def test_the_frozen_numbers_are_those_that_their_script_makes():
    case = plain_solver.read_case(plain_solver.CASE)
    made = plain_solver.rms(case["vehicle"], 250 / 3.6, case["track"], case["band"])
    assert made == pytest.approx(TABLE["points"][1]["rms"], rel=1e-10, abs=0)


def test_the_case_reader_reads_what_a_reader_without_pint_reads():
    plain, case = plain_solver.read_case(plain_solver.CASE), freqrail.load_case("yu-damper-joint")
    ours = {name: quantity.value for name, quantity in case.quantities.items() if name != "speed"}
    assert ours == pytest.approx(plain["vehicle"], rel=1e-15, abs=0)
    assert case.speed == pytest.approx(plain["speed"], rel=1e-15)
    assert (case.band.low, case.band.high) == plain["band"]
    assert (case.spectrum.roughness, *case.spectrum.cutoffs) == plain["track"]
    assert {name: (rough, *GERMAN_CUTOFFS) for name, rough in GERMAN_ROUGHNESS.items()} == plain_solver.TRACKS


def test_load_and_contact_stiffness_are_those_of_the_table(point):
    vehicle = freqrail.load_case("yu-damper-joint", settings(point), scalars=True).vehicle
    load = static_wheel_load(vehicle.car_body_mass, vehicle.bogie_mass, vehicle.wheelset_mass)
    assert load == pytest.approx(point["static_wheel_load"], rel=1e-12)
    assert vehicle.contact_stiffness == pytest.approx(point["contact_stiffness"], rel=1e-12)


def test_rms_values_are_those_of_the_table(point):
    changes = settings(point)
    own = {"primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}  # the case sweeps these
    axes = {name: changes.pop(name, own.get(name)) for name in (*own, "speed")}
    result = freqrail.sweep("yu-damper-joint", axes, settings=changes, responses="all").squeeze()
    found = {}
    for label, number in point["rms"].items():
        name, position = label.split(" ")
        values = np.atleast_1d(result[f"{name}_rms"].values)
        place = [str(each) for each in RESPONSES[name].positions].index(position)
        found[label] = (values[place], number)
    ours, table = np.array(list(found.values())).T
    np.testing.assert_allclose(ours, table, rtol=1e-8)
