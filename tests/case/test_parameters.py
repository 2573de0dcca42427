"""The table of names: examples that parse, and every name of a dataset to be found in it."""

from __future__ import annotations

import math
from dataclasses import fields

import pytest

import freqrail
from freqrail.case.axis import parse_axis
from freqrail.case.parameters import COMPLIANCES, JOINTS, PARAMETERS, SWEEPABLE, suggestion
from freqrail.case.quantities import parse_quantity, unit_factor
from freqrail.model.responses import DIMENSIONS, RESPONSES
from freqrail.model.vehicle import Vehicle
from tests.chains import FAMILIES


@pytest.fixture(scope="module")
def everything():
    """A small result with every variable that a sweep can store."""
    over = {"speed": "250 km/h", "primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
    over |= {"frequency": "1, 10 Hz", "bogie_mass": "600 kg"}
    return freqrail.sweep("yu-damper-joint", over, responses="all", psd=True)


@pytest.mark.parametrize("name", PARAMETERS)
def test_the_example_of_a_parameter_parses_and_lies_in_its_bounds(name):
    parameter = PARAMETERS[name]
    assert parameter.name == name
    quantity = parse_quantity(parameter, parameter.example)
    number, unit = parameter.example.split(" ", 1)
    assert quantity.value == pytest.approx(float(number) * float(unit_factor(unit)[0]), rel=1e-15)
    assert parameter.lower <= quantity.value <= parameter.upper
    assert quantity.value > 0
    assert math.isfinite(quantity.value)


@pytest.mark.parametrize("name", PARAMETERS)
def test_units_of_a_parameter_agree(name):
    parameter = PARAMETERS[name]
    factor, dimension = unit_factor(parameter.unit)
    assert factor == 1
    assert unit_factor(parameter.example.split(" ", 1)[1])[1] == dimension
    assert unit_factor(parameter.shown_unit or parameter.unit)[1] == dimension
    if not parameter.above:  # the smallest accepted value is accepted, what lies below is not
        assert parse_quantity(parameter, f"{parameter.lower:g} {parameter.unit}").value == parameter.lower
    with pytest.raises(ValueError, match="must be"):
        parse_quantity(parameter, f"{parameter.lower - (0 if parameter.above else 0.001)!r} {parameter.unit}")


@pytest.mark.parametrize("name", [*SWEEPABLE, "frequency"])
def test_an_axis_bears_the_shown_unit_or_the_users(name):
    parameter = PARAMETERS[name]
    axis = parse_axis(parameter, parameter.example)
    assert axis.unit == (parameter.shown_unit or parameter.example.split(" ", 1)[1])
    assert axis.values.size == 1


def test_the_units_of_coordinates_are_those_of_the_conventions():
    """docs/conventions.md, "Datasets"."""
    shown = {name: p.shown_unit for name, p in PARAMETERS.items() if p.shown_unit}
    assert shown == {"speed": "km/h", "frequency": "Hz", **dict.fromkeys(JOINTS, "MN/m")}
    assert {name for name, p in PARAMETERS.items() if p.infinite} == set(JOINTS)


def test_the_vehicle_has_the_fields_of_its_table():
    vehicle = {name for name, p in PARAMETERS.items() if p.section == "vehicle"}
    assert {field.name for field in fields(Vehicle)} == vehicle - {"contact_constant"}
    assert set(SWEEPABLE) == vehicle | {"speed"}


def test_every_variable_of_a_dataset_is_in_the_table(everything):
    wanted = set()
    for prefix in ("", "traditional_"):
        wanted |= {f"{prefix}{name}_{kind}" for name in RESPONSES for kind in ("rms", "rms_relative_error", "psd")}
        wanted |= {f"{prefix}status", f"{prefix}method"}
    assert set(everything.data_vars) == wanted


def test_every_axis_of_a_dataset_is_in_the_table(everything):
    assert set(everything.dims) == {"speed", "frequency", "bogie_mass", *JOINTS, *DIMENSIONS}
    scalars = set(SWEEPABLE) - {*everything.dims, "contact_stiffness"}  # the case gives the contact constant
    band = {"band_lower_frequency", "band_upper_frequency"}
    assert set(everything.coords) == {*everything.dims, *COMPLIANCES.values(), *scalars, *band}
    for name in set(everything.dims) & set(PARAMETERS):
        assert everything[name].attrs["long_name"] == PARAMETERS[name].meaning
    for name, dimension in DIMENSIONS.items():
        assert everything[name].attrs["long_name"] == dimension.long_name
        assert everything[name].values.tolist() == list(dimension.labels)


@pytest.mark.parametrize("name", RESPONSES)
def test_responses_agree_with_the_kernel_and_the_dataset(everything, name):
    response = RESPONSES[name]
    assert response.name == name
    assert len(FAMILIES[name].signs) == max(1, len(response.positions))
    variable = everything[f"{name}_rms"]
    assert variable.attrs["units"] == response.unit
    assert everything[f"{name}_psd"].attrs["units"] == response.psd_unit
    assert [d for d in variable.dims if d not in PARAMETERS] == ([response.dimension] if response.dimension else [])
    # the words of a place in a figure: one for each label
    assert [len(d.words) for d in DIMENSIONS.values()] == [len(d.labels) for d in DIMENSIONS.values()]


def test_the_papers_four_responses_come_first():
    paper = [name for name, response in RESPONSES.items() if response.paper]
    assert paper == ["car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke"]
    assert list(RESPONSES)[:4] == paper


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("sped", "speed"),
        ("speeed", "speed"),
        ("bogie_mas", "bogie_mass"),
        ("primary_joint_stifness", "primary_joint_stiffness"),
        ("secondary_joint", "secondary_joint_stiffness"),
        ("half_wheel_base", "half_wheelbase"),
    ],
)
def test_suggestions_name_the_nearest(name, near):
    assert suggestion(name, SWEEPABLE) == f" (did you mean {near}?)"


def test_without_a_near_name_all_are_listed():
    assert suggestion("zzz", ["one", "two"]) == " (known: one, two)"
    assert suggestion("", (name for name in ("one", "two"))) == " (known: one, two)"
