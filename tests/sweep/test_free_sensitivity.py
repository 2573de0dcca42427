"""Elasticities of a free vehicle: differences of sweeps, also by what works through modal masses and contacts."""

import warnings

import numpy as np
import pytest

import freqrail
from freqrail.case.case import build_case
from freqrail.errors import FreqrailWarning
from tests.case.test_free_vehicle import VEHICLE, changed

RESPONSES = ["stroke", "driver", "body_acceleration", "contact_force"]


def rms_with(text, name, factor):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)
        case = build_case(text)
        value = case.quantities[name].value * factor
        unit = case.parameter(name).unit
        own = build_case(text, {name: f"{value!r}" if unit == "1" else f"{value!r} {unit}"})
        return freqrail.sweep(own, responses=RESPONSES)


@pytest.mark.parametrize("band", ["a band", "the whole axis"])
def test_elasticities_are_differences_of_sweeps(band):
    text = VEHICLE if band == "a band" else changed((("band",), None))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)
        found = freqrail.sensitivity(build_case(text), responses=RESPONSES)
    wanted = ["pivot", "joint", "bodies_car_mass", "bodies_car_bending_1_length", "wheels_axle_3_contact_constant"]
    wanted += ["suspensions_secondary_front_c", "speed", "outputs_driver_at", "wheels_axle_4_m"]
    step = 3e-4
    for name in wanted:
        near = {k: rms_with(text, name, 1 + k * step) for k in (-2, -1, 1, 2)}
        for response in RESPONSES:
            at = {k: np.log(one[f"{response}_rms"].values) for k, one in near.items()}
            expected = (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12 * step)  # of fourth order
            ours = found[f"{response}_rms_elasticity"].sel(parameter=name).values[0]
            np.testing.assert_allclose(ours, expected, atol=1e-6, err_msg=f"{name} {response}")


def test_every_value_that_the_vehicle_hangs_on_is_listed_once():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)
        case = build_case(VEHICLE)
        found = freqrail.sensitivity(case, responses="stroke")
    names = found["parameter"].values.tolist()
    assert len({*names}) == len(names)
    assert {*case.quantities} == {*names}


def test_by_a_rigid_joint_there_is_no_elasticity():
    """Also where the contacts follow from static loads, which joints do not change."""
    found = freqrail.sensitivity("two-coupled-cars", responses="stroke").stroke_rms_elasticity
    assert np.isfinite(found).all()
    assert (found.sel(parameter=["primary_joint", "secondary_joint"]) == 0).all()
