"""Points that a grid lacks, computed anew: the numbers of a sweep of that point, for every response and both models."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.cli import tables
from freqrail.errors import InputError
from freqrail.result.axes import swept
from freqrail.result.points import parse_point, result_case
from freqrail.sweep.off_grid import find

CASE = "yu-damper-joint"
JOINT = "primary_joint_stiffness"
AXES = {
    "speed": "log:100:300:4 km/h",
    JOINT: "log:0.5:100:5 MN/m",
    "secondary_joint_stiffness": "5, inf MN/m",
    "secondary_damping": "27, 54 kN*s/m",
}


@pytest.fixture(scope="module")
def result():
    """Logarithmic axes, which hold neither the case's 250 km/h nor its 5 MN/m; all responses, and spectra."""
    return freqrail.sweep(CASE, {**AXES, "frequency": "1, 10, 50 Hz"}, responses="all", psd=True)


def single(**values: str):
    """The sweep of one point."""
    axes = {name: values.get(name, own) for name, own in (("speed", "250 km/h"), (JOINT, "5 MN/m"))}
    axes |= {"secondary_joint_stiffness": "5 MN/m", "secondary_damping": "54 kN*s/m", "frequency": "1, 10, 50 Hz"}
    return freqrail.sweep(CASE, {**axes, **values}, responses="all", psd=True)


def test_a_point_on_the_grid_is_the_result_s_own(result):
    speed = f"{result.speed.values[2]!r} km/h".replace("np.float64(", "").replace(")", "")
    point = parse_point(f"speed={speed}, {JOINT}=100 MN/m, secondary_joint_stiffness=inf")
    found = find(result, point)
    assert found.dataset is result
    assert found.index == {JOINT: 4, "secondary_joint_stiffness": 1, "speed": 2, "secondary_damping": 1}
    assert (found.anew, found.note) == ((), "")


@pytest.mark.parametrize(
    ("point", "values", "anew"),
    [
        (None, {}, (JOINT, "speed")),
        ("speed=300 km/h", {"speed": "300 km/h"}, (JOINT,)),
        (
            "speed=123.4 km/h, secondary_damping=0.03 MN*s/m",
            {"speed": "123.4 km/h", "secondary_damping": "30 kN*s/m"},
            3,
        ),
        (f"{JOINT}=inf, speed=300 km/h", {JOINT: "inf", "speed": "300 km/h"}, (JOINT,)),
        (f"{JOINT}=7000 N/mm, secondary_joint_stiffness=inf", {JOINT: "7 MN/m", "secondary_joint_stiffness": "inf"}, 2),
    ],
)
def test_a_point_off_the_grid_is_the_sweep_of_that_point(result, point, values, anew):
    found = find(result, point and parse_point(point))
    assert found.anew == anew or len(found.anew) == anew
    assert all(f"{name} = " in found.note for name in found.anew)
    assert found.index == dict.fromkeys(swept(result), 0)
    expected = single(**values)
    assert swept(found.dataset) == swept(result)
    for name in result.data_vars:
        assert found.dataset[name].dims == result[name].dims
        assert str(found.dataset[name].attrs) == str(result[name].attrs)
        one, other = found.dataset[name].values, expected[name].transpose(*result[name].dims).values
        if name.endswith("_relative_error"):
            assert np.all((one > 0) & (one <= 1e-6))
        else:
            np.testing.assert_allclose(one, other, rtol=1e-9)


def test_a_value_beside_the_grid_s_is_told_with_the_digits_that_tell_them_apart(result):
    found = find(result, parse_point(f"speed=100.000001 km/h, {JOINT}=0.5 MN/m"))
    assert found.note == "computed anew: speed = 100.000001 km/h is not on the result's grid"
    assert tables.result_point(result, parse_point("speed=100.000001 km/h"))[1][0].endswith(
        "speed = 100.000001 km/h, " + "secondary_damping = 54 kN*s/m"
    )


def test_its_case_is_that_of_the_point(result):
    found = find(result, parse_point("speed=123 km/h"))
    case = result_case(found.dataset)
    assert case.speeds().tolist() == [pytest.approx(123 / 3.6)]
    assert case.vehicles().at((0, 0, 0)).primary_joint_stiffness == 5e6
    assert found.dataset.attrs["computed_anew"] == f"{JOINT} speed"


def test_axes_that_are_kept_stay_whole(result):
    found = find(result, None, keep=("speed", "secondary_damping"))
    assert found.anew == (JOINT,)
    assert found.index == {JOINT: 0, "secondary_joint_stiffness": 0}
    assert {name: found.dataset.sizes[name] for name in swept(result)} == {
        **{JOINT: 1, "secondary_joint_stiffness": 1},
        **{"speed": 4, "secondary_damping": 2},
    }
    np.testing.assert_allclose(found.dataset.speed.values, result.speed.values, rtol=1e-14)
    assert find(result, None, keep=(JOINT, "speed")).dataset is result


def test_of_a_part_that_the_caller_has_cut_out_the_part_stays(result):
    part = result.isel(speed=slice(1, 3), secondary_joint_stiffness=[1])
    found = find(part, None, keep=("speed",))
    np.testing.assert_allclose(found.dataset.speed.values, part.speed.values, rtol=1e-14)
    assert found.dataset.secondary_joint_stiffness.values.tolist() == [np.inf]  # its only value, not the case's own


def test_a_point_without_a_result_says_why():
    grid = freqrail.sweep(CASE, {"speed": "200, 250 km/h", "primary_damping": "10, 17 kN*s/m", **_joints()})
    found = find(grid, parse_point("primary_damping=0 kN*s/m"))
    assert found.dataset.status.attrs["flag_meanings"].split()[int(found.dataset.status.squeeze())] == "undamped"
    assert np.isnan(found.dataset.primary_stroke_rms).all()
    assert np.isfinite(found.dataset.bogie_acceleration_rms).all()  # which does not feel the bogies pitch


def _joints() -> dict[str, str]:
    return dict.fromkeys((JOINT, "secondary_joint_stiffness"), "5 MN/m")


def test_what_is_not_swept_is_not_changed(result):
    with pytest.raises(InputError, match=r"--at bogie_mass: is not swept, the case has 600 kg"):
        find(result, parse_point("bogie_mass=3 t, speed=111 km/h"))
    grid = freqrail.sweep(CASE, {"speed": "250 km/h", "half_wheelbase": "0.8, 0.9 m", **_joints()})
    with pytest.raises(InputError, match=r"half_bogie_spacing: must exceed half_wheelbase"):
        find(grid, parse_point("half_wheelbase=4 m"))


def test_of_results_put_together_in_memory_nothing_is_computed_anew():
    """The case of the first would stand for all of them."""
    both = [freqrail.sweep(CASE, {"speed": "200, 250 km/h", **_joints()}, {"bogie_mass": m}) for m in ("600 kg", "1 t")]
    together = xr.concat(both, "bogie_mass", coords="different", compat="equals")
    assert find(together, parse_point("speed=250 km/h, bogie_mass=1 t")).anew == ()
    with pytest.raises(InputError, match=r"--at speed: off the grid, .*the result's case does not sweep bogie_mass"):
        find(together, parse_point("speed=220 km/h, bogie_mass=1 t"))


def test_a_whole_vehicle_is_computed_anew_as_one():
    """Axes of whole masses: 1.5 t on an axis of 1.2 and 1.6 t is 1.5 t, not the half of it."""
    settings = {"masses": "whole", "car_body_mass": "30.4 t", "car_body_pitch_inertia": "2038 t*m^2"}
    settings |= {"bogie_pitch_inertia": "1.4 t*m^2", "wheelset_mass": "1.4 t", "primary_stiffness": "1.75 MN/m"}
    settings |= {"primary_damping": "34 kN*s/m", "secondary_stiffness": "824 kN/m", "secondary_damping": "108 kN*s/m"}
    joints = dict.fromkeys((JOINT, "secondary_joint_stiffness"), "10 MN/m")
    grid = freqrail.sweep(CASE, {"speed": "250 km/h", "bogie_mass": "1.2, 1.6 t", **joints}, settings)
    anew = find(grid, parse_point("bogie_mass=1.5 t")).dataset
    exact = freqrail.sweep(CASE, {"speed": "250 km/h", "bogie_mass": "750 kg", **_joints()})
    np.testing.assert_allclose(anew.bogie_acceleration_rms, exact.bogie_acceleration_rms, rtol=1e-9)
