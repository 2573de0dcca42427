"""Elasticities of a case: per cent for one per cent, against differences of the sweep's own numbers."""

from __future__ import annotations

import numpy as np
import pytest

import freqrail
from freqrail.case.case import load_case
from freqrail.errors import InputError
from freqrail.result.points import parse_point
from freqrail.sweep.sensitivity import sensitivity

STEP = 2e-5


def changed(case, name: str, factor: float, band: str | None):
    """The case with a parameter times a factor, at 250 km/h."""
    value, _, unit = case.quantities[name].text.partition(" ")
    settings = {name: f"{float(value) * factor!r} {unit}"} | ({"band": band} if band else {})
    if name != "speed":
        settings["speed"] = "250 km/h"
    return load_case("yu-damper-joint", settings, scalars=True)


@pytest.mark.parametrize("band", [None, "none"], ids=["0.1-100 Hz", "whole axis"])
@pytest.mark.parametrize(
    "name",
    ["car_body_mass", "contact_constant", "half_wheelbase", "primary_joint_stiffness", "secondary_damping", "speed"],
)
def test_elasticities_are_what_a_small_change_makes(name, band):
    case = load_case("yu-damper-joint", {"band": band} if band else {}, scalars=True)
    at = parse_point("speed=250 km/h")
    found = sensitivity(case, at, "all")
    more, less = (
        sensitivity(
            case if name == "speed" else changed(case, name, factor, band),
            parse_point(f"speed={250 * factor!r} km/h") if name == "speed" else None,
            "all",
        )
        for factor in (1 + STEP, 1 - STEP)
    )
    for response in freqrail.model.responses.RESPONSES:
        place = {"speed": 0} if name == "speed" else {"speed": list(found["speed"].values).index(250.0)}
        one, other = (np.log(d[f"{response}_rms"].isel(speed=_at(d, name)).values) for d in (more, less))
        difference = (one - other) / np.log((1 + STEP) / (1 - STEP))
        elasticity = found[f"{response}_rms_elasticity"].sel(parameter=name).isel(place).values
        np.testing.assert_allclose(elasticity, difference, rtol=2e-6, atol=2e-6)


def _at(dataset, name: str) -> int:
    speeds = dataset["speed"].values
    return int(np.argmin(np.abs(speeds - 250.0)))


def test_a_rigid_joint_has_none():
    case = load_case("yu-damper-joint", {"primary_joint_stiffness": "inf MN/m"}, scalars=True)
    found = sensitivity(case, parse_point("speed=200 km/h"))
    for response in ("car_body_acceleration", "primary_stroke"):
        assert np.all(found[f"{response}_rms_elasticity"].sel(parameter="primary_joint_stiffness") == 0)


def test_what_the_case_does_not_give_is_no_point():
    with pytest.raises(InputError, match="follows from the case's other values"):
        sensitivity("yu-damper-joint", parse_point("contact_stiffness=1 GN/m"))
