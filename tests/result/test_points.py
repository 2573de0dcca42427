"""Points of a result's grid: from text to indices, by the values of the result's own axes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.errors import FreqrailWarning, InputError
from freqrail.result.axes import axis_label, grid_axis, swept
from freqrail.result.points import locate, parse_point, result_case

JOINT, DAMPING = "primary_joint_stiffness", "secondary_damping"
AXES = {
    "speed": "200, 250 km/h",
    JOINT: "1, 5, 33.3333333333, inf MN/m",
    "secondary_joint_stiffness": "5 MN/m",
    DAMPING: "27, 54 kN*s/m",
}


def solve(over: dict[str, str], settings: dict[str, str] | None = None) -> xr.Dataset:
    return freqrail.sweep("yu-damper-joint", over, settings, responses="bogie_acceleration")


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    """The paper's case over two joint stiffnesses, speed (their order in the case file) and damping."""
    return solve(AXES)


@pytest.fixture(scope="module")
def off_scalar() -> xr.Dataset:
    """A result whose grid does not hold the case's own 250 km/h and 5 MN/m."""
    return solve({"speed": "100, 240, 300 km/h", JOINT: "10, 20 MN/m", "secondary_joint_stiffness": "inf"})


def refusal(*arguments: object, **options: object) -> tuple[str, ...]:
    with pytest.raises(InputError) as caught:
        locate(*arguments, **options)
    assert caught.value.exit_code == 2
    return caught.value.problems


# --- reading a point -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("speed=250 km/h", {"speed": 250 * 5 / 18}),
        (f"speed=250 km/h, {JOINT}=5 MN/m", {"speed": 250 * 5 / 18, JOINT: 5e6}),
        (f"  speed = 90 km/h ,{JOINT}= inf  ", {"speed": 25.0, JOINT: math.inf}),
        ("contact_constant=5e-8 m/N^(2/3), bogie_mass=0.6 t", {"contact_constant": 5e-8, "bogie_mass": 600.0}),
    ],
)
def test_points_from_text(text, values):
    assert {name: quantity.value for name, quantity in parse_point(text).items()} == values


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        ("", ['--at: is empty; write it as in --at "speed=250 km/h"']),
        ("250 km/h", ['--at: a point is written "NAME=VALUE, NAME=VALUE" (got "250 km/h")']),
        ("sped=250 km/h", ["--at sped: unknown name (did you mean speed?)"]),
        ("frequency=1 Hz", ["--at frequency: unknown name"]),
        ("speed=250", ["--at speed: a unit is missing"]),
        ("speed=", ["--at speed: not a number with a unit"]),
        ("speed=25 m/s,", ["--at speed: not a unit: 'm/s,'"]),
        ("speed=250,5 km/h", ["--at speed: a decimal comma"]),
        ("speed=250 km/h, speed=200 km/h", ["--at speed: given twice"]),
        ("speed=250 km/h, 5 MN/m", ["--at speed: not a unit: 'km/h, 5 MN/m'"]),
        ("sped=1 km/h, speed=0 km/h", ["--at sped: unknown name", "--at speed: must be greater than 0 m/s"]),
    ],
)
def test_bad_points_are_refused_with_all_their_faults(text, problems):
    with pytest.raises(InputError) as caught:
        parse_point(text)
    assert caught.value.exit_code == 2
    assert len(caught.value.problems) == len(problems)
    for problem, words in zip(caught.value.problems, problems, strict=True):
        assert problem.startswith(words)


# --- finding it on the grid ------------------------------------------------------------------------


def test_swept_names_are_in_the_order_of_the_grid(result):
    assert swept(result) == (JOINT, "secondary_joint_stiffness", "speed", DAMPING)


def test_a_point_on_the_grid(result):
    point = parse_point(f"speed=200 km/h, {JOINT}=1 MN/m, {DAMPING}=27 kN*s/m, secondary_joint_stiffness=5 MN/m")
    assert locate(result, point) == {JOINT: 0, "secondary_joint_stiffness": 0, "speed": 0, DAMPING: 0}


@pytest.mark.parametrize(
    ("text", "name", "index"),
    [
        ("speed=250 km/h", "speed", 1),
        (f"speed={250 / 3.6!r} m/s", "speed", 1),
        (f"{JOINT}=5 MN/m", JOINT, 1),
        (f"{JOINT}=5000 N/mm", JOINT, 1),
        (f"{JOINT}=inf", JOINT, 3),
        (f"{JOINT}=33.33333333 MN/m", JOINT, 2),  # as a message shows it
        (f"{DAMPING}=54 kN*s/m", DAMPING, 1),
        (f"{DAMPING}=0.027 MN*s/m", DAMPING, 0),
    ],
)
def test_values_are_found_in_any_unit(result, text, name, index):
    assert locate(result, parse_point(text))[name] == index


def test_every_value_of_every_axis_is_found_by_its_own_label(result):
    for name in swept(result):
        for index in range(result.sizes[name]):
            label = axis_label(result, name, index)
            text = label.replace("rigid", "inf").replace("33.3333 ", "33.3333333333 ")
            assert locate(result, parse_point(f"{name}={text}"))[name] == index


def test_names_left_out_take_the_cases_scalars(result):
    """250 km/h, joints of 5 MN/m, 54 kN*s/m: none of them first on its axis but the single one."""
    scalars = {JOINT: 1, "secondary_joint_stiffness": 0, "speed": 1, DAMPING: 1}
    assert locate(result) == scalars
    assert locate(result, {}) == scalars
    assert locate(result, parse_point("speed=200 km/h")) == {**scalars, "speed": 0}


def test_settings_change_the_scalars_that_are_taken():
    dataset = solve({"speed": "250 km/h"}, {DAMPING: "27 kN*s/m", "title": "other"})
    assert locate(dataset, parse_point(f"{DAMPING}=27 kN*s/m")) == locate(dataset)
    assert "the case has 27 kN*s/m" in refusal(dataset, parse_point(f"{DAMPING}=54 kN*s/m"))[0]
    assert result_case(dataset).quantities[DAMPING].value == 27e3


def test_values_off_the_grid_name_the_nearest(result):
    point = parse_point(f"speed=240 km/h, {JOINT}=13 MN/m, {DAMPING}=1 kN*s/m, secondary_joint_stiffness=inf")
    assert refusal(result, point) == (
        f'--at {JOINT}: "13 MN/m" is off the grid; the nearest value is 33.33333333 MN/m',
        f'--at {DAMPING}: "1 kN*s/m" is off the grid; the nearest value is 27 kN*s/m',
        '--at secondary_joint_stiffness: "inf" is off the grid; the nearest value is 5 MN/m',
        '--at speed: "240 km/h" is off the grid; the nearest value is 250 km/h',
    )


def test_a_value_off_by_a_part_in_a_million_is_off_the_grid(result):
    assert locate(result, parse_point("speed=250.0000000001 km/h"))["speed"] == 1
    assert "the nearest value is 250 km/h" in refusal(result, parse_point("speed=250.00025 km/h"))[0]


def test_a_large_value_is_not_taken_for_a_rigid_joint(result):
    assert "nearest value is 33.33333333 MN/m" in refusal(result, parse_point(f"{JOINT}=1e8 MN/m"))[0]


def test_scalars_off_the_grid_are_an_error_or_the_nearest(off_scalar):
    assert refusal(off_scalar) == (
        f'--at {JOINT}: left out, and the case\'s own value "5 MN/m" is off the grid; the nearest value is 10 MN/m: '
        f'name it, as in "{JOINT}=10 MN/m"',
        '--at speed: left out, and the case\'s own value "250 km/h" is off the grid; the nearest value is 240 km/h: '
        'name it, as in "speed=240 km/h"',
    )
    assert locate(off_scalar, nearest=True) == {JOINT: 0, "secondary_joint_stiffness": 0, "speed": 1}
    assert locate(off_scalar, parse_point(f"speed=300 km/h, {JOINT}=20 MN/m")) == {
        JOINT: 1,
        "secondary_joint_stiffness": 0,  # its only value, though the case's own is 5 MN/m
        "speed": 2,
    }


def test_nearest_is_for_names_left_out_only(off_scalar):
    (problem,) = refusal(off_scalar, parse_point("speed=250 km/h"), nearest=True)
    assert problem == '--at speed: "250 km/h" is off the grid; the nearest value is 240 km/h'
    assert refusal(off_scalar, parse_point("secondary_joint_stiffness=5 MN/m"), nearest=True) == (
        '--at secondary_joint_stiffness: "5 MN/m" is off the grid; the nearest value is inf',
    )


def test_names_that_are_not_swept_must_be_the_cases_own(result):
    assert locate(result, parse_point("bogie_mass=0.6 t")) == locate(result)
    assert refusal(result, parse_point("bogie_mass=650 kg")) == (
        '--at bogie_mass: is not swept, the case has 600 kg (got "650 kg")',
    )
    stiffness = float(result_case(result).vehicle.contact_stiffness)
    assert locate(result, parse_point(f"contact_stiffness={stiffness!r} N/m")) == locate(result)
    assert (
        "--at contact_stiffness: is not swept, the case has 1044"
        in refusal(result, parse_point("contact_stiffness=1.5 GN/m"))[0]
    )


def test_a_name_that_the_case_does_not_give():
    dataset = solve({"speed": "250 km/h"}, {"contact_stiffness": "1 GN/m"})
    assert refusal(dataset, parse_point(f"contact_constant=5e-8 m/N^(2/3), {JOINT}=5 MN/m")) == (
        '--at contact_constant: is not swept, the case does not give it (got "5e-8 m/N^(2/3)")',
    )


def test_a_swept_contact_stiffness_left_out_takes_what_the_constant_gives():
    over = {"speed": "250 km/h", JOINT: "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
    exact = float(freqrail.load_case("yu-damper-joint").vehicle.contact_stiffness)
    on_grid = solve({**over, "contact_stiffness": f"0.8e9, {exact!r}, 2e9 N/m"})
    assert locate(on_grid)["contact_stiffness"] == 1
    off_grid = solve({**over, "contact_stiffness": "0.8, 0.9, 2 GN/m"})
    assert "the nearest value is 0.9 GN/m" in refusal(off_grid)[0]
    assert locate(off_grid, nearest=True)["contact_stiffness"] == 1


def test_a_part_of_a_result_is_searched_by_its_own_values(result):
    part = result.isel({JOINT: slice(1, 3), "speed": [1, 0]}).sortby("speed")
    assert locate(part)[JOINT] == 0
    assert "nearest value is 5 MN/m" in refusal(part, parse_point(f"{JOINT}=1 MN/m"))[0]


# --- what a result says of its axes ----------------------------------------------------------------


def test_labels_and_si_values(result):
    assert [axis_label(result, JOINT, i) for i in range(4)] == ["1 MN/m", "5 MN/m", "33.3333 MN/m", "rigid"]
    assert axis_label(result, "speed", -1) == "250 km/h"
    assert axis_label(result, DAMPING, 0) == "27 kN*s/m"
    np.testing.assert_allclose(grid_axis(result, "speed").si, [200 / 3.6, 250 / 3.6], rtol=1e-15)
    np.testing.assert_allclose(grid_axis(result, JOINT).si, [1e6, 5e6, 33.3333333333e6, np.inf], rtol=1e-15)
    np.testing.assert_allclose(grid_axis(result, DAMPING).si, [27e3, 54e3], rtol=1e-15)


def test_the_case_of_a_result_is_the_one_it_was_computed_from(result):
    case = result_case(result)
    assert case.name == "yu-damper-joint"
    assert [axis.name for axis in case.axes] == list(swept(result))
    for axis in case.axes:
        assert axis.values.tolist() == result[axis.name].values.tolist()


@pytest.mark.filterwarnings("ignore:.*rigid rail")  # an undamped bogie's pitch
def test_the_warnings_of_a_case_are_not_told_again():
    with pytest.warns(FreqrailWarning, match="the damper hardly acts"):
        dataset = solve({"speed": "250 km/h", "secondary_joint_stiffness": "5 MN/m", JOINT: "1, 5000 kN/m"})
    assert locate(dataset)[JOINT] == 1  # a FreqrailWarning is an error here, see pyproject.toml


@pytest.mark.parametrize("attribute", ["effective_case", "case_name"])
def test_a_dataset_without_its_case_is_refused(result, attribute):
    stripped = result.copy()
    del stripped.attrs[attribute]
    (problem,) = refusal(stripped)
    assert problem == f"the dataset has no attribute '{attribute}': a result of freqrail's sweep is expected"
