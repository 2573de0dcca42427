"""A case written out in the free form is the same case: its numbers, whatever is given, swept or sampled."""

from __future__ import annotations

import math
import tomllib
import warnings

import numpy as np
import pytest

import freqrail
from freqrail.case.case import build_case, load_case
from freqrail.case.expand import expanded
from freqrail.case.samples import from_mapping
from freqrail.errors import FreqrailWarning
from freqrail.model.responses import PAPER as PAPER_RESPONSES
from tests.case.test_free_vehicle import VEHICLE, quiet

PAPER = freqrail.shipped_cases()["yu-damper-joint"]
ENDS = {"front": "bogie_front", "rear": "bogie_rear"}


def both(settings, over, samples=None):
    """The sweep of a template, and that of the template written out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)
        case = build_case(PAPER, settings, over, samples=samples, stray_points=True)
        return freqrail.sweep(case), freqrail.sweep(build_case(expanded(case), stray_points=True))


def assert_same(one, other):
    """Accelerations of the car's centre and of both bogies, all strokes, of both models; axes by name."""
    axles = [f"primary_{k}" for k in (1, 2, 3, 4)]
    for prefix in ("", "traditional_"):
        free = {name: other[f"{prefix}{name}_rms"] for name in ("body_acceleration", "stroke")}
        own = {name: one[f"{prefix}{name}_rms"] for name in PAPER_RESPONSES}
        pairs = [
            (own["car_body_acceleration"].sel(car_position="centre"), free["body_acceleration"].sel(body="car")),
            (own["bogie_acceleration"], free["body_acceleration"].sel(body=list(ENDS.values()))),
            (own["primary_stroke"], free["stroke"].sel(suspension=axles)),
            (own["secondary_stroke"], free["stroke"].sel(suspension=["secondary_front", "secondary_rear"])),
        ]
        for ours, theirs in pairs:
            np.testing.assert_allclose(ours.values, theirs.values, rtol=1e-12)


@pytest.mark.parametrize("number", range(12))
def test_random_templates_written_out_give_their_numbers(number):
    """Numbers up to three times off the paper's, rigid joints among them, halves and wholes, bands of every kind."""
    rng = np.random.default_rng(number)
    case = load_case("yu-damper-joint")
    settings = {}
    for name, quantity in case.quantities.items():
        if name in case.varied or name in ("speed", "half_wheelbase"):
            continue
        spread = 1.3 if name.startswith("half") else 3.0
        settings[name] = f"{quantity.value * spread ** rng.uniform(-1, 1)!r} {case.parameter(name).unit}"
    if rng.random() < 0.5:
        settings.pop("contact_constant")
        settings["contact_stiffness"] = f"{1e9 * rng.uniform(0.5, 2)!r} N/m"
    settings["masses"] = str(rng.choice(["half", "whole"]))
    joints = ["inf", f"{rng.uniform(1, 9)!r}, inf MN/m", f"{rng.uniform(1, 9)!r} MN/m"]
    over = {joint: str(rng.choice(joints)) for joint in ("primary_joint_stiffness", "secondary_joint_stiffness")}
    over["speed"] = f"{rng.uniform(60, 120):.3f}, {rng.uniform(130, 300):.3f} km/h"
    kind = rng.integers(3)
    settings |= {"band": "none"} if kind == 0 else {"wavelength": "1.5:90 m"} if kind == 1 else {}
    assert_same(*both(settings, over))


@pytest.mark.parametrize("masses", ["half", "whole"])
def test_axes_of_masses_and_lengths_are_those_of_one_side(masses):
    """The contact stiffness follows from the load in both forms, along the axis of a mass too."""
    over = {"bogie_mass": "500, 700 kg", "half_bogie_spacing": "3, 3.5 m", "primary_damping": "10, 20 kN*s/m"}
    over |= {"primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "inf", "speed": "200 km/h"}
    one, other = both({"masses": masses}, over)
    assert other["bogie_mass"].values.tolist() == [500 / (1 + (masses == "whole")), 700 / (1 + (masses == "whole"))]
    assert_same(one, other)


def test_samples_are_written_out_too():
    samples = from_mapping({"bogie_mass [kg]": [600, 650], "primary_joint_stiffness [MN/m]": [5, math.inf]})
    over = {"secondary_joint_stiffness": "5 MN/m", "speed": "200 km/h"}
    assert_same(*both({"masses": "whole"}, over, samples))


def test_a_free_case_is_written_out_without_likes():
    case = quiet(VEHICLE)
    text = expanded(case)
    assert not any("like" in table for table in tomllib.loads(text)["suspensions"].values())
    one, other = freqrail.sweep(case), freqrail.sweep(quiet(text))
    for name in ("stroke_rms", "body_acceleration_rms", "driver_rms", "rigid_stroke_rms"):
        np.testing.assert_allclose(other[name], one[name], rtol=1e-12)
