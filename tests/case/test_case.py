"""Case files: what is accepted, what is refused and in which words, and the order of settings and axes."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import freqrail
from freqrail.case import case as case_module
from freqrail.case.case import Case, build_case, load_case
from freqrail.case.file import to_toml
from freqrail.case.parameters import PARAMETERS, SWEEPABLE
from freqrail.case.shipped import shipped_cases
from freqrail.errors import FreqrailWarning, InputError
from freqrail.model.band import Band
from freqrail.model.spectrum import RationalSpectrum

ROOT = Path(__file__).parents[2]
SHIPPED = shipped_cases()["yu-damper-joint"]

# a case with one line a key, so that a test can change each of them
PLAIN = """\
schema_version = 1
title = "plain"
reference = "none"

[vehicle]
masses = "half"
car_body_mass = "15200 kg"
car_body_pitch_inertia = "1019000 kg*m^2"
bogie_mass = "600 kg"
bogie_pitch_inertia = "700 kg*m^2"
wheelset_mass = "700 kg"
primary_stiffness = "875 kN/m"
primary_damping = "17 kN*s/m"
primary_joint_stiffness = "5 MN/m"
secondary_stiffness = "412 kN/m"
secondary_damping = "54 kN*s/m"
secondary_joint_stiffness = "5 MN/m"
half_bogie_spacing = "3.289 m"
half_wheelbase = "0.797 m"
contact_constant = "5.1824e-8 m/N^(2/3)"

[track]
spectrum = "german-low"

[operation]
speed = "250 km/h"

[band]
frequency = ["0.1 Hz", "100 Hz"]

[sweep]
speed = "100:300:10 km/h"
primary_joint_stiffness = "0.5, 1, 5, 10, 50, 100 MN/m"

[confirm]
points = [{ speed = "250 km/h", primary_joint_stiffness = "5 MN/m" }]
"""


def put(table: str, key: str, value: str | None) -> str:
    """The plain case with a key of a table set to TOML text, added if it is not there, or taken out."""
    lines = PLAIN.splitlines()
    start = lines.index(f"[{table}]") if table else -1
    end = next((i for i in range(start + 1, len(lines)) if lines[i].startswith("[")), len(lines))
    kept = [line for line in lines[start + 1 : end] if not line.startswith(f"{key} =")]
    new = [] if value is None else [f"{key} = {value}"]
    return "\n".join([*lines[: start + 1], *new, *kept, *lines[end:]]) + "\n"


def drop(table: str) -> str:
    """The plain case without a table."""
    blocks = PLAIN.split("\n\n")
    return "\n\n".join(block for block in blocks if not block.startswith(f"[{table}]"))


def changed(*changes: tuple[str, str]) -> str:
    """The plain case with pieces of text replaced, each of which must be there."""
    text = PLAIN
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def refusal(call: Callable[[], object]) -> tuple[str, ...]:
    """The problems that a call is refused with, each one line, exit code 2."""
    with pytest.raises(InputError) as caught:
        call()
    assert caught.value.exit_code == 2
    assert str(caught.value) == "\n".join(caught.value.problems)
    assert len(set(caught.value.problems)) == len(caught.value.problems) > 0
    return caught.value.problems


def facts(case: Case) -> dict[str, object]:
    """Everything of a case that computing depends on, comparable with ==."""
    return {
        "title": case.title,
        "reference": case.reference,
        "quantities": dict(case.quantities),
        "spectrum": case.spectrum,
        "band": case.band,
        "axes": [(a.name, a.unit, a.text, a.values.tolist(), a.si.tolist()) for a in case.axes],
        "frequency": case.frequency and case.frequency.si.tolist(),
        "points": case.points,
    }


# --- the shipped case ------------------------------------------------------------------------------


def test_the_shipped_case_carries_the_papers_numbers(paper_case):
    """Section V, first paragraph; eq. (11); section VI and Table I."""
    assert {name: quantity.value for name, quantity in paper_case.quantities.items()} == {
        "wheelset_mass": 700.0,
        "bogie_mass": 600.0,
        "bogie_pitch_inertia": 700.0,
        "car_body_mass": 15200.0,
        "car_body_pitch_inertia": 1019000.0,
        "primary_stiffness": 875000.0,
        "primary_joint_stiffness": 5e6,
        "secondary_stiffness": 412000.0,
        "secondary_joint_stiffness": 5e6,
        "primary_damping": 17000.0,
        "secondary_damping": 54000.0,
        "half_bogie_spacing": 3.289,
        "half_wheelbase": 0.797,
        "contact_constant": 5.1824e-8,
        "speed": 250 * 5 / 18,
    }
    assert paper_case.spectrum == RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
    assert paper_case.band == Band("frequency", 0.1, 100.0)
    table_1 = [0.5, 1.0, 5.0, 10.0, 50.0, 100.0]
    assert {axis.name: axis.values.tolist() for axis in paper_case.axes} == {
        "primary_joint_stiffness": table_1,
        "secondary_joint_stiffness": table_1,
        "speed": [float(v) for v in range(100, 301, 10)],
    }
    assert [axis.unit for axis in paper_case.axes] == ["MN/m", "MN/m", "km/h"]
    joints = {"primary_joint_stiffness": 5e6, "secondary_joint_stiffness": 5e6}
    assert [{name: q.value for name, q in point.items()} for point in paper_case.points] == [
        {"speed": v * 5 / 18, **joints} for v in (100, 250, 300)
    ]
    assert "Yu" in paper_case.reference
    assert paper_case.name == "yu-damper-joint"
    assert paper_case.text == SHIPPED


def test_the_contact_stiffness_follows_from_eq_1(paper_case):
    """K_H = 1.5 P0^(1/3)/G with G of a conical tread, R = 0.43 m; the case's comments say 1.0448e9 N/m."""
    load = (15200 / 4 + 600 / 2 + 700) * 9.8
    assert paper_case.vehicle.contact_stiffness == pytest.approx(1.5 * load ** (1 / 3) / 5.1824e-8, rel=1e-14)
    assert paper_case.vehicle.contact_stiffness == pytest.approx(1.0448e9, rel=5e-5)
    assert pytest.approx(4.57e-8 * 0.43**-0.149, rel=1e-5) == 5.1824e-8
    assert paper_case.scalars["contact_stiffness"].value == paper_case.vehicle.contact_stiffness
    assert "contact_stiffness" not in paper_case.quantities


def test_the_grid_of_vehicles_broadcasts_in_the_order_of_the_axes(paper_case):
    vehicles = paper_case.vehicles()
    assert vehicles.shape == (6, 6)
    assert np.shape(vehicles.primary_joint_stiffness) == (6, 1)
    assert np.shape(vehicles.secondary_joint_stiffness) == (1, 6)
    assert vehicles.at((2, 4)).primary_joint_stiffness == 5e6
    assert vehicles.at((2, 4)).secondary_joint_stiffness == 50e6
    assert paper_case.vehicle.shape == ()
    assert paper_case.speeds().tolist() == [v * 5 / 18 for v in range(100, 301, 10)]
    assert build_case(drop("sweep")).speeds().tolist() == [250 * 5 / 18]


def test_masses_swept_with_a_contact_constant_change_the_contact_stiffness():
    vehicles = build_case(PLAIN, over={"wheelset_mass": "700, 800 kg", "speed": "250 km/h"}).vehicles()
    loads = (15200 / 4 + 600 / 2 + np.array([700, 800])) * 9.8
    np.testing.assert_allclose(np.ravel(vehicles.contact_stiffness), 1.5 * np.cbrt(loads) / 5.1824e-8, rtol=1e-13)


def test_a_swept_contact_stiffness_replaces_the_constants():
    vehicles = build_case(PLAIN, over={"contact_stiffness": "1, 2 GN/m"}).vehicles()
    assert np.ravel(vehicles.contact_stiffness).tolist() == [1e9, 2e9]


# --- what is accepted ------------------------------------------------------------------------------

ACCEPTED = {
    "a byte order mark": "\ufeff" + PLAIN,
    "Windows line ends": PLAIN.replace("\n", "\r\n"),
    "a comment": "# a comment\n" + PLAIN,
    "no title and no reference": changed(('title = "plain"\n', ""), ('reference = "none"\n', "")),
    "a title in many scripts": put("", "title", '"Überhöhung, 転向架, \U0001f686"'),
    "control characters in a title": put("", "title", r'"a\u001b[31m\u0007\n\t\u007f\u0085b"'),
    "a rigid joint": put("vehicle", "secondary_joint_stiffness", '"inf"'),
    "a rigid joint in a list": put("sweep", "primary_joint_stiffness", '"1, 5, inf MN/m"'),
    "no damper": put("vehicle", "secondary_damping", '"0 N*s/m"'),
    "the softest joint without a warning": put("vehicle", "primary_joint_stiffness", '"8.75 kN/m"').replace(
        'primary_joint_stiffness = "0.5, 1,', 'primary_joint_stiffness = "0.00875, 1,'
    ),
    "no band": drop("band"),
    "a band of wavelengths": changed(('frequency = ["0.1 Hz", "100 Hz"]', 'wavelength = ["1 m", "200 m"]')),
    "no sweep and no points": changed((PLAIN[PLAIN.index("[sweep]") :], "")),
    "a sweep of spectra": put("sweep", "frequency", '"log:0.1:100:50 Hz"'),
    "the fastest speed": put("sweep", "speed", '"250, 600 km/h"'),
    "a single point of the grid": put("confirm", "points", '[{ speed = "100 km/h" }]'),
    "a point that names what is not swept": put("confirm", "points", '[{ bogie_mass = "0.6 t" }]'),
    "a point that names the contact stiffness": put(
        "confirm", "points", '[{ contact_stiffness = "1.044764 GN/m" }]'
    ).replace('contact_constant = "5.1824e-8 m/N^(2/3)"', 'contact_stiffness = "1.044764 GN/m"'),
    "no points": put("confirm", "points", "[]"),
    "an empty confirm table": put("confirm", "points", None),
    "high German spectrum": put("track", "spectrum", '"german-high"'),
}


@pytest.mark.parametrize("row", ACCEPTED)
def test_accepted_files_load_without_a_word(tmp_path, row):
    path = tmp_path / "study.toml"
    path.write_bytes(ACCEPTED[row].encode())
    case = load_case(path)  # a FreqrailWarning is an error here, see pyproject.toml
    assert case.name == "study"
    assert case.quantities["speed"].value == 250 * 5 / 18


def test_what_accepted_files_mean():
    assert build_case(ACCEPTED["a rigid joint"]).vehicle.secondary_joint_stiffness == math.inf
    assert build_case(ACCEPTED["a rigid joint in a list"]).axes[0].si.tolist() == [1e6, 5e6, math.inf]
    assert build_case(ACCEPTED["no damper"]).vehicle.secondary_damping == 0
    assert build_case(ACCEPTED["no band"]).band is None
    assert build_case(ACCEPTED["a band of wavelengths"]).band == Band("wavelength", 1.0, 200.0)
    assert build_case(ACCEPTED["no sweep and no points"]).axes == ()
    spectra = build_case(ACCEPTED["a sweep of spectra"])
    assert spectra.frequency.values.size == 50
    assert "frequency" not in [axis.name for axis in spectra.axes]
    assert build_case(ACCEPTED["high German spectrum"]).spectrum == RationalSpectrum(
        "german-high", 1.080e-6, (0.0206, 0.8246)
    )
    assert build_case(ACCEPTED["control characters in a title"]).title == "a\x1b[31m\x07\n\t\x7f\x85b"
    rational = put(
        "track", "spectrum", '"rational"\nroughness = "1e-6 m^2*rad/m"\ncutoffs = ["0.02 rad/m", "0.8 rad/m"]'
    )
    assert build_case(rational).spectrum == RationalSpectrum("rational", 1e-6, (0.02, 0.8))


UNITS = {
    "car_body_mass": "15.2 t",
    "car_body_pitch_inertia": "1019 t*m^2",
    "bogie_mass": "0.6 tonne",
    "bogie_pitch_inertia": "0.7 Mg*m**2",
    "wheelset_mass": "700000 g",
    "primary_stiffness": "0.875 kN/mm",
    "primary_damping": "17 kN/(m/s)",
    "primary_joint_stiffness": "5 kN/mm",
    "secondary_stiffness": "412 N/mm",
    "secondary_damping": "0.054 MN*s/m",
    "secondary_joint_stiffness": "5000 N/mm",
    "half_bogie_spacing": "3289 mm",
    "half_wheelbase": "79.7 cm",
    "contact_constant": "5.1824e-5 mm/N^(2/3)",
}


def test_other_units_give_the_same_si_numbers():
    text = PLAIN
    for name, value in UNITS.items():
        text = text.replace(f'\n{name} = "{build_case(PLAIN).quantities[name].text}"', f'\n{name} = "{value}"', 1)
    text = text.replace('["0.1 Hz", "100 Hz"]', '["100 mHz", "0.1 kHz"]')
    text = text.replace('"0.5, 1, 5, 10, 50, 100 MN/m"', '"0.5, 1, 5, 10, 50, 100 kN/mm"')
    other, plain = build_case(text), build_case(PLAIN)
    assert {name: q.text for name, q in other.quantities.items()} == {**UNITS, "speed": "250 km/h"}
    assert {n: q.value for n, q in other.quantities.items()} == {n: q.value for n, q in plain.quantities.items()}
    assert other.band == plain.band
    assert [a.si.tolist() for a in other.axes] == [a.si.tolist() for a in plain.axes]
    assert [a.unit for a in other.axes] == [a.unit for a in plain.axes]


@pytest.mark.parametrize(
    ("text", "value"), [("90 km/h", 25.0), ("25 m/s", 25.0), ("100 mph", 44.704), ("100 knot", 463 / 9)]
)
def test_speeds_in_other_units(text, value):
    case = build_case(drop("sweep"), {"speed": text})
    assert case.speed == value


# --- what is refused: rows of shared/bad-inputs.md, "Case file, exit 2" ----------------------------


def deep(count: int) -> str:
    return "[" * count + "]" * count


# the file's bytes or text: (what the message says after "FILE: "), one problem each
UNREADABLE = {
    "empty": (b"", "is empty; start from a shipped case"),
    "blank": (b" \n\t\n", "is empty; start from a shipped case"),
    "UTF-16": (PLAIN.encode("utf-16"), "is UTF-16 text, a case file is UTF-8: save it anew"),
    "UTF-16 without a mark": (PLAIN.encode("utf-16-le"), "line 1: holds a NUL byte"),
    "invalid UTF-8": (PLAIN.encode().replace(b"plain", b"pl\xe4in"), "is not UTF-8 text (byte 30 is 0xe4)"),
    "NUL byte": (PLAIN.encode().replace(b'"half"', b'"ha\0lf"'), "line 6: holds a NUL byte"),
    "raw control character": (
        PLAIN.replace("plain", "pl\x1b[31min").encode(),
        r"not valid TOML: Illegal character '\x1b' (at line 2, column 12)",
    ),
    "syntax error": (PLAIN.replace('"600 kg"', "600 kg").encode(), "not valid TOML: Expected newline"),
    "line and column": (b"schema_version = 1\ntitle = plain\n", "not valid TOML: Invalid value (at line 2, column 9)"),
    "duplicate key": ((PLAIN + 'points = "x"\n').encode(), "not valid TOML: Cannot overwrite a value (at line 37"),
    "duplicate table": ((PLAIN + "[band]\n").encode(), "not valid TOML: Cannot declare ('band',) twice (at line 37"),
    "5,000-digit integer": (put("", "title", "1" * 5000).encode(), "not valid TOML: a number with too many digits"),
    "arrays 3,000 deep": (put("", "title", deep(3000)).encode(), "not valid as a case: nested too deeply"),
    "inline tables 3,000 deep": (
        put("", "title", "{a=" * 3000 + "1" + "}" * 3000).encode(),
        "not valid as a case: nested too deeply",
    ),
    "too large": (b"#" * 1_000_001, "too large for a case file (got 1000001 bytes, limit 1000000)"),
    "a NetCDF file": (b"\x89HDF\r\n\x1a\n" + b"\0" * 50, "is a NetCDF file, a case file is expected"),
}


@pytest.mark.parametrize("row", UNREADABLE)
def test_files_that_are_no_case_file(tmp_path, row):
    content, words = UNREADABLE[row]
    path = tmp_path / "study.toml"
    path.write_bytes(content)
    (problem,) = refusal(lambda: load_case(path))
    assert problem.startswith(f"{path}: {words}")


# (file, place of the fault after "FILE: ", words of the message), one problem each
FAULTS = {
    "unknown key": (
        put("vehicle", "car_body_mas", '"1 kg"'),
        "[vehicle].car_body_mas",
        "unknown key (did you mean car_body_mass?)",
    ),
    "unknown key at the top": (put("", "titel", '"x"'), "titel", "unknown key (did you mean title?)"),
    "unknown table": (PLAIN + "[sweeep]\n", "[sweeep]", "unknown table (did you mean sweep?)"),
    "unknown table like none": (
        PLAIN + "[zzz]\n",
        "[zzz]",
        "unknown table (known: vehicle, track, operation, band, sweep, samples, confirm, accepted)",
    ),
    "unknown key in track": (
        put("track", "colour", '"red"'),
        "[track].colour",
        "unknown key (known: spectrum, roughness, cutoffs)",
    ),
    "unknown key in confirm": (put("confirm", "point", "[]"), "[confirm].point", "unknown key (did you mean points?)"),
    "missing key": (
        put("vehicle", "bogie_mass", None),
        "[vehicle].bogie_mass",
        'missing; write it as in bogie_mass = "600 kg"',
    ),
    "missing masses": (put("vehicle", "masses", None), "[vehicle].masses", 'missing; write it as in masses = "half"'),
    "missing spectrum": (
        put("track", "spectrum", None),
        "[track].spectrum",
        'missing; write it as in spectrum = "german-low"',
    ),
    "missing speed": (
        put("operation", "speed", None),
        "[operation].speed",
        'missing; write it as in speed = "250 km/h"',
    ),
    "missing version": (
        put("", "schema_version", None),
        "schema_version",
        "missing; write it as in schema_version = 1",
    ),
    "missing table": (drop("track"), "[track]", "this table is missing"),
    "masses of neither": (
        put("vehicle", "masses", '"hole"'),
        "[vehicle].masses",
        'must be "half" (masses, inertias, springs and dampers of one side) or "whole" (of both sides) (got "hole")',
    ),
    "version 3": (
        put("", "schema_version", "3"),
        "schema_version",
        "unsupported schema_version: this freqrail reads 1 and 2 (got 3)",
    ),
    "version true": (
        put("", "schema_version", "true"),
        "schema_version",
        "unsupported schema_version: this freqrail reads 1 and 2 (got True)",
    ),
    "version in quotes": (
        put("", "schema_version", '"1"'),
        "schema_version",
        'unsupported schema_version: this freqrail reads 1 and 2 (got "1")',
    ),
    "version 1.0": (
        put("", "schema_version", "1.0"),
        "schema_version",
        "unsupported schema_version: this freqrail reads 1 and 2 (got 1.0)",
    ),
    "a huge hexadecimal version": (
        put("", "schema_version", "0x" + "F" * 5000),
        "schema_version",
        "(got a very large int)",
    ),
    "title a number": (put("", "title", "5"), "title", "text is expected (got 5)"),
    "NUL in a title": (
        put("", "title", r'"a\u0000b"'),
        "title",
        r"holds a NUL or another character that no file can store (got 'a\x00b')",
    ),
    "text for a number": (
        put("vehicle", "bogie_mass", '"heavy"'),
        "[vehicle].bogie_mass",
        'not a number with a unit such as "600 kg" (got "heavy")',
    ),
    "a boolean for a number": (
        put("vehicle", "bogie_mass", "true"),
        "[vehicle].bogie_mass",
        "not a boolean (got True)",
    ),
    "a date": (
        put("vehicle", "bogie_mass", "2024-01-02"),
        "[vehicle].bogie_mass",
        "not a date (got datetime.date(2024, 1, 2))",
    ),
    "a bare number": (
        put("vehicle", "bogie_mass", "600"),
        "[vehicle].bogie_mass",
        'text with a unit is expected, such as "600 kg", not a bare number (got 600)',
    ),
    "a bare float": (put("vehicle", "bogie_mass", "600.0"), "[vehicle].bogie_mass", "not a bare number (got 600.0)"),
    "a huge hexadecimal number": (
        put("vehicle", "bogie_mass", "0x" + "F" * 5000),
        "[vehicle].bogie_mass",
        "not a bare number (got a very large int)",
    ),
    "a list for a number": (
        put("vehicle", "bogie_mass", '["600 kg"]'),
        "[vehicle].bogie_mass",
        "not a list (got ['600 kg'])",
    ),
    "a table for a number": (
        put("vehicle", "bogie_mass", "{ kg = 600 }"),
        "[vehicle].bogie_mass",
        "not a table (got {'kg': 600})",
    ),
    "a missing unit": (
        put("vehicle", "bogie_mass", '"600"'),
        "[vehicle].bogie_mass",
        'a unit is missing: write it as in "600 kg" (got "600")',
    ),
    "wrong dimension": (
        put("vehicle", "primary_stiffness", '"875 kN*s/m"'),
        "[vehicle].primary_stiffness",
        'wrong dimension: a stiffness in N/m, such as "875 kN/m", is expected (got "875 kN*s/m")',
    ),
    "unknown unit": (
        put("vehicle", "primary_stiffness", '"875 kX/m"'),
        "[vehicle].primary_stiffness",
        "unknown unit 'kX/m': a stiffness such as \"875 kN/m\" is expected",
    ),
    "nan": (
        put("vehicle", "bogie_mass", '"nan kg"'),
        "[vehicle].bogie_mass",
        'nan is not a number, write one as in "600 kg" (got "nan kg")',
    ),
    "bare nan": (put("vehicle", "bogie_mass", "nan"), "[vehicle].bogie_mass", "not a bare number (got nan)"),
    "inf": (put("vehicle", "bogie_mass", '"inf kg"'), "[vehicle].bogie_mass", 'inf is not allowed here (got "inf kg")'),
    "1e400": (
        put("vehicle", "bogie_mass", '"1e400 kg"'),
        "[vehicle].bogie_mass",
        "a number beyond what double precision holds",
    ),
    "bare 1e400": (put("vehicle", "bogie_mass", "1e400"), "[vehicle].bogie_mass", "not a bare number (got inf)"),
    "1e-400": (
        put("vehicle", "bogie_mass", '"1e-400 kg"'),
        "[vehicle].bogie_mass",
        "a number beyond what double precision holds",
    ),
    "decimal comma": (
        put("vehicle", "bogie_mass", '"600,5 kg"'),
        "[vehicle].bogie_mass",
        "a decimal comma: write a point",
    ),
    "a product": (put("vehicle", "bogie_mass", '"2*3 kg"'), "[vehicle].bogie_mass", "not a unit: '*3 kg'"),
    "zero mass": (
        put("vehicle", "bogie_mass", '"0 kg"'),
        "[vehicle].bogie_mass",
        'must be greater than 0 kg (got "0 kg")',
    ),
    "negative mass": (
        put("vehicle", "wheelset_mass", '"-700 kg"'),
        "[vehicle].wheelset_mass",
        'must be greater than 0 kg (got "-700 kg")',
    ),
    "negative inertia": (
        put("vehicle", "bogie_pitch_inertia", '"-1 kg*m^2"'),
        "[vehicle].bogie_pitch_inertia",
        "must be greater than 0 kg*m^2",
    ),
    "negative damping": (
        put("vehicle", "primary_damping", '"-17 kN*s/m"'),
        "[vehicle].primary_damping",
        'must be at least 0 N*s/m (got "-17 kN*s/m")',
    ),
    "negative stiffness": (
        put("vehicle", "secondary_stiffness", '"-412 kN/m"'),
        "[vehicle].secondary_stiffness",
        "must be greater than 0 N/m",
    ),
    "zero stiffness": (
        put("vehicle", "primary_stiffness", '"0 kN/m"'),
        "[vehicle].primary_stiffness",
        "must be greater than 0 N/m",
    ),
    "joint stiffness 0": (
        put("vehicle", "primary_joint_stiffness", '"0 N/m"'),
        "[vehicle].primary_joint_stiffness",
        'must be at least 1 N/m, or "inf" for a rigid joint (got "0 N/m")',
    ),
    "negative length": (
        put("vehicle", "half_bogie_spacing", '"-1 m"'),
        "[vehicle].half_bogie_spacing",
        "must be greater than 0 m",
    ),
    "spacing not above wheelbase": (
        put("vehicle", "half_wheelbase", '"3.289 m"'),
        "[vehicle].half_bogie_spacing",
        "must exceed half_wheelbase everywhere on the grid (got 3.289 m and 3.289 m)",
    ),
    "spacing swept below wheelbase": (
        put("sweep", "half_bogie_spacing", '"0.7, 3.289 m"'),
        "[vehicle].half_bogie_spacing",
        "(got 0.7 m and 0.797 m)",
    ),
    "wheelbase swept above spacing": (
        put("sweep", "half_wheelbase", '"0.797, 3.5 m"'),
        "[vehicle].half_bogie_spacing",
        "(got 3.289 m and 3.5 m)",
    ),
    "speed 0": (
        put("operation", "speed", '"0 km/h"'),
        "[operation].speed",
        'must be greater than 0 m/s (got "0 km/h")',
    ),
    "negative speed": (put("operation", "speed", '"-250 km/h"'), "[operation].speed", "must be greater than 0 m/s"),
    "speed above 600 km/h": (
        put("operation", "speed", '"250 m/s"'),
        "[operation].speed",
        'speeds above 600 km/h are refused: is the unit right? (got "250 m/s")',
    ),
    "both contacts": (
        put("vehicle", "contact_stiffness", '"1 GN/m"'),
        "[vehicle].contact_constant, .contact_stiffness",
        "both are given; give exactly one",
    ),
    "no contact": (
        put("vehicle", "contact_constant", None),
        "[vehicle].contact_constant, .contact_stiffness",
        "one of the two is missing; give exactly one",
    ),
    "both contacts swept": (
        put("sweep", "contact_constant", '"1e-8 m/N^(2/3)"\ncontact_stiffness = "1 GN/m"'),
        "[sweep].contact_constant, .contact_stiffness",
        "both are swept; sweep one",
    ),
    "START above STOP": (
        put("sweep", "speed", '"300:100:10 km/h"'),
        "[sweep].speed",
        'START must not exceed STOP (got "300:100:10 km/h")',
    ),
    "COUNT 0": (
        put("sweep", "speed", '"lin:100:300:0 km/h"'),
        "[sweep].speed",
        "COUNT must be a whole number, at least 1",
    ),
    "COUNT negative": (
        put("sweep", "speed", '"lin:100:300:-3 km/h"'),
        "[sweep].speed",
        "COUNT must be a whole number, at least 1",
    ),
    "COUNT fractional": (
        put("sweep", "speed", '"log:100:300:2.5 km/h"'),
        "[sweep].speed",
        "COUNT must be a whole number, at least 1",
    ),
    "STEP 0": (
        put("sweep", "speed", '"100:300:0 km/h"'),
        "[sweep].speed",
        'STEP must be positive (got "100:300:0 km/h")',
    ),
    "STEP of the wrong sign": (put("sweep", "speed", '"100:300:-10 km/h"'), "[sweep].speed", "STEP must be positive"),
    "STOP off the step": (
        put("sweep", "speed", '"100:300:70 km/h"'),
        "[sweep].speed",
        "STOP lies off the step: the last value would be 240",
    ),
    "log axis with 0": (
        put("sweep", "secondary_damping", '"log:0:100:5 kN*s/m"'),
        "[sweep].secondary_damping",
        "a log axis starts above 0",
    ),
    "duplicate values": (
        put("sweep", "speed", '"100, 250, 250 km/h"'),
        "[sweep].speed",
        "values must strictly increase, 250 follows 250",
    ),
    "unsorted values": (
        put("sweep", "speed", '"250, 100 km/h"'),
        "[sweep].speed",
        "values must strictly increase, 100 follows 250",
    ),
    "inf in the middle": (
        put("sweep", "primary_joint_stiffness", '"5, inf, 10 MN/m"'),
        "[sweep].primary_joint_stiffness",
        "inf can only end a list of values",
    ),
    "unknown axis": (put("sweep", "sped", '"100 km/h"'), "[sweep].sped", "unknown axis (did you mean speed?)"),
    "an axis that cannot be swept": (
        put("sweep", "roughness", '"1e-7 m^2*rad/m"'),
        "[sweep].roughness",
        "unknown axis",
    ),
    "axis a list": (
        put("sweep", "speed", '["100 km/h"]'),
        "[sweep].speed",
        "an axis is text such as \"100:300:10 km/h\" (got ['100 km/h'])",
    ),
    "axis a number": (
        put("sweep", "speed", "250"),
        "[sweep].speed",
        'an axis is text such as "100:300:10 km/h" (got 250)',
    ),
    "axis above 1e7 values": (
        put("sweep", "speed", '"lin:100:300:10000001 km/h"'),
        "[sweep].speed",
        "an axis of 10000001 values exceeds the limit of 10000000",
    ),
    "f_min 0": (put("band", "frequency", '["0 Hz", "100 Hz"]'), "[band].frequency", "must be greater than 0 Hz"),
    "f_min above f_max": (
        put("band", "frequency", '["100 Hz", "0.1 Hz"]'),
        "[band].frequency",
        'the lower limit must be below the upper one (got "100 Hz" and "0.1 Hz")',
    ),
    "f_min equal to f_max": (
        put("band", "frequency", '["1 Hz", "1000 mHz"]'),
        "[band].frequency",
        "the lower limit must be below the upper one",
    ),
    "wavelengths reversed": (
        changed(('frequency = ["0.1 Hz", "100 Hz"]', 'wavelength = ["200 m", "1 m"]')),
        "[band].wavelength",
        "the lower limit must be below the upper one",
    ),
    "band in rad/s": (
        put("band", "frequency", '["1 rad/s", "600 rad/s"]'),
        "[band].frequency",
        "wrong dimension: a frequency in Hz",
    ),
    "one limit": (put("band", "frequency", '["0.1 Hz"]'), "[band].frequency", "two quantities are expected"),
    "both bands": (
        put("band", "wavelength", '["1 m", "200 m"]'),
        "[band]",
        "both frequency and wavelength are given; give one",
    ),
    "empty band": (
        put("band", "frequency", None),
        "[band]",
        "is empty; give frequency or wavelength, or leave the table out",
    ),
    "unknown spectrum": (
        put("track", "spectrum", '"german-lo"'),
        "[track].spectrum",
        'unknown spectrum (did you mean german-low?) (got "german-lo")',
    ),
    "spectrum a list": (
        put("track", "spectrum", '["german-low"]'),
        "[track].spectrum",
        "unknown spectrum (known: german-low, german-high, rational) (got ['german-low'])",
    ),
    "spectrum a huge number": (
        put("track", "spectrum", "0x" + "F" * 5000),
        "[track].spectrum",
        "(got a very large int)",
    ),
    "roughness of a German spectrum": (
        put("track", "roughness", '"1e-7 m^2*rad/m"'),
        "[track].roughness",
        'belongs to spectrum = "rational" only (spectrum is "german-low")',
    ),
    "rational without cutoffs": (
        put("track", "spectrum", '"rational"\nroughness = "1e-7 m^2*rad/m"'),
        "[track].cutoffs",
        'missing; spectrum = "rational" needs it, such as "0.0206 rad/m"',
    ),
    "a value for a table": ('track = "german-low"\n' + drop("track"), "[track]", 'must be a table (got "german-low")'),
    "confirm point off the grid": (
        put("confirm", "points", '[{ speed = "254 km/h" }]'),
        "[confirm].points",
        'point 1: speed: "254 km/h" is off the grid; the nearest value is 250 km/h',
    ),
    "a rigid point off the grid": (
        put("confirm", "points", '[{ primary_joint_stiffness = "inf" }]'),
        "[confirm].points",
        'point 1: primary_joint_stiffness: "inf" is off the grid; the nearest value is 100 MN/m',
    ),
    "a point that leaves out a name off the grid": (
        put("operation", "speed", '"255 km/h"').replace('[{ speed = "250 km/h", p', "[{ p"),
        "[confirm].points",
        'point 1: speed: left out, and the case\'s own value "255 km/h" is off the grid; the nearest value is 260 km/h',
    ),
    "a point with another scalar": (
        put("confirm", "points", '[{ bogie_mass = "650 kg" }]'),
        "[confirm].points",
        'point 1: bogie_mass: is not swept, the case has 600 kg (got "650 kg")',
    ),
    "a point with a contact stiffness of its own": (
        put("confirm", "points", '[{ contact_stiffness = "2 GN/m" }]'),
        "[confirm].points",
        "point 1: contact_stiffness: is not swept, the case has 1044",
    ),
    "unknown name of a point": (
        put("confirm", "points", '[{ sped = "250 km/h" }]'),
        "[confirm].points",
        "point 1: unknown name 'sped' (did you mean speed?)",
    ),
    "bad value of a point": (
        put("confirm", "points", '[{ speed = "250" }]'),
        "[confirm].points",
        "point 1: speed: a unit is missing",
    ),
    "points no list": (
        put("confirm", "points", '"250 km/h"'),
        "[confirm].points",
        'a list of points is expected, such as [{ speed = "250 km/h" }] (got "250 km/h")',
    ),
    "points a list of text": (
        put("confirm", "points", '["250 km/h"]'),
        "[confirm].points",
        "a list of points is expected",
    ),
    "points 400 deep": (put("confirm", "points", deep(400)), "[confirm].points", "a list of points is expected"),
}


@pytest.mark.parametrize("row", FAULTS)
def test_faults_of_a_case_file(tmp_path, row):
    content, place, words = FAULTS[row]
    path = tmp_path / "study.toml"
    path.write_text(content, encoding="utf-8")
    (problem,) = refusal(lambda: load_case(path))
    assert problem.startswith(f"{path}: {place}: ")
    assert words in problem
    assert "\n" not in problem
    assert len(problem) < len(str(path)) + 400


def test_the_plain_case_itself_is_in_order():
    """Else every row above could be refused for a reason of its own."""
    case = build_case(PLAIN)
    assert facts(case)["quantities"] == facts(build_case(SHIPPED))["quantities"]
    assert len(case.points) == 1


def test_every_quantity_of_the_vehicle_is_required_and_bounded():
    for name in set(UNITS) - {"contact_constant"}:
        (problem,) = refusal(lambda name=name: build_case(put("vehicle", name, None)))
        assert problem.startswith(f"case: [vehicle].{name}: missing; write it as in {name} = ")
        unit = PARAMETERS[name].unit
        (problem,) = refusal(lambda name=name, unit=unit: build_case(put("vehicle", name, f'"-1 {unit}"')))
        assert problem.startswith(f"case: [vehicle].{name}: must be ")


def test_a_missing_file_a_folder_and_a_device(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (problem,) = refusal(lambda: load_case("yu-damper-join"))
    assert problem == (
        "yu-damper-join: no such case file, and no shipped case of that name (did you mean yu-damper-joint?)"
    )
    assert "nothere.toml: no such case file" in refusal(lambda: load_case(tmp_path / "nothere.toml"))[0]
    assert refusal(lambda: load_case(tmp_path)) == (f"{tmp_path}: is a folder, a case file is expected",)
    assert refusal(lambda: load_case("")) == (".: is a folder, a case file is expected",)
    assert refusal(lambda: load_case("/dev/null")) == ("/dev/null: is not a regular file, a case file is expected",)
    assert "cannot be opened" in refusal(lambda: load_case("x" * 5000))[0]
    assert "x\0y" in refusal(lambda: load_case("x\0y"))[0]


def test_a_folder_of_the_name_of_a_shipped_case_does_not_hide_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "yu-damper-joint").mkdir()
    assert load_case("yu-damper-joint").text == SHIPPED


def test_a_file_of_the_name_of_a_shipped_case_comes_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "yu-damper-joint").write_text(PLAIN)
    assert load_case("yu-damper-joint").title == "plain"


def test_an_unreadable_file(tmp_path, monkeypatch):
    path = tmp_path / "study.toml"
    path.write_text(PLAIN)

    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("freqrail.files.read", refuse)  # to root every file is readable
    assert refusal(lambda: load_case(path)) == (f"{path}: cannot be read: Permission denied",)


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_an_unreadable_file_and_folder_for_real(tmp_path):
    path = tmp_path / "inner" / "study.toml"
    path.parent.mkdir()
    path.write_text(PLAIN)
    path.chmod(0)
    assert refusal(lambda: load_case(path)) == (f"{path}: cannot be read: Permission denied",)
    path.parent.chmod(0)
    try:
        assert refusal(lambda: load_case(path)) == (f"{path}: cannot be opened: Permission denied",)
    finally:
        path.parent.chmod(0o700)


def test_keys_of_endless_parts_end_at_once():
    """tomllib needs gigabytes for them, hence a process of its own with a limit on its memory."""
    script = """
import resource
from freqrail.case.case import build_case
from freqrail.errors import InputError
from tests.case.test_case import PLAIN
resource.setrlimit(resource.RLIMIT_AS, (3 * 10**9, 3 * 10**9))
dots = ".a" * 100_000
for text in ("x" + dots + " = 1\\n" + PLAIN, PLAIN + "[x" + dots + "]\\n", "x = {a" + dots + " = 1}\\n" + PLAIN,
             "x" + " . 'a'" * 20_000 + ' = 1\\n' + PLAIN):
    try:
        build_case(text)
    except InputError as fault:
        print(fault)
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    assert done.stdout.splitlines() == ["case: not valid as a case: nested too deeply"] * 4


def test_texts_with_many_dots_are_no_endless_keys():
    dotted = " ".join(["Y. Yu, Y. Song", *["et al."] * 60, *["1.5"] * 60, *["e.g."] * 20, "." * 200])
    assert build_case(put("", "reference", f'"{dotted}"')).reference == dotted


@settings(deadline=10_000, database=None, derandomize=True, max_examples=300)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(PLAIN.splitlines()),
            st.text(st.characters(codec="utf-8"), max_size=20)
            | st.sampled_from(['"', "=", "[", "]", "inf", "-1", "[x]", "x = 1", "speed = 5", '"""', "nan", "{", "1e9"]),
            st.integers(0, 60),
        ),
        min_size=1,
        max_size=4,
    )
)
def test_damaged_files_are_refused_or_load(edits):
    text = PLAIN
    for line, insert, at in edits:
        text = text.replace(line, line[:at] + insert + line[at:], 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FreqrailWarning)
            case = build_case(text, file="F")
            assert facts(build_case(case.effective)) == facts(case)
        refused: tuple[str, ...] = ()
    except InputError as fault:
        refused = fault.problems
    assert all(problem.startswith("F: ") for problem in refused)


# --- all at once -----------------------------------------------------------------------------------


def test_all_faults_of_a_file_are_told_at_once():
    text = changed(
        ('bogie_mass = "600 kg"', 'bogie_mass = "600,5 kg"'),
        ('wheelset_mass = "700 kg"\n', ""),
        ('half_bogie_spacing = "3.289 m"', 'half_bogie_spacing = "0.5 m"'),
        ("contact_constant =", 'contact_stiffness = "1 GN/m"\ncontact_constant ='),
        ('"german-low"', '"german-lo"'),
        ('["0.1 Hz", "100 Hz"]', '["100 Hz", "0.1 Hz"]'),
        ('"0.5, 1, 5, 10, 50, 100 MN/m"', '"0.5, 1, 5, 10, 50, 50 MN/m"'),
        (
            '[{ speed = "250 km/h", primary_joint_stiffness = "5 MN/m" }]',
            '[{ speed = "255 km/h" }, { sped = "1 km/h" }, { speed = "1 km" }]',
        ),
        ("[confirm]", "[confirn]\n[confirm]"),
    )
    problems = refusal(lambda: build_case(text, file="F"))
    assert sorted(problem.split(": ")[1] for problem in problems) == sorted(
        [
            "[vehicle].bogie_mass",
            "[vehicle].wheelset_mass",
            "[vehicle].half_bogie_spacing",
            "[vehicle].contact_constant, .contact_stiffness",
            "[track].spectrum",
            "[band].frequency",
            "[sweep].primary_joint_stiffness",
            "[confirm].points",
            "[confirm].points",
            "[confirm].points",
            "[confirn]",
        ]
    )
    assert [p.split(": ")[2] for p in problems if "points" in p] == ["point 2", "point 3", "point 1"]


def test_faults_of_options_are_told_with_those_of_the_file():
    text = put("vehicle", "bogie_mass", '"0 kg"')
    problems = refusal(
        lambda: build_case(
            text,
            {"bogie_mas": "1 kg", "wheelset_mass": "-1 kg", "speed": "260 km/h", "frequency": "9:1 Hz"},
            {"sped": "1 km/h", "half_wheelbase": "1 kg"},
            file="F",
        )
    )
    assert [problem.split(": ")[0] for problem in problems] == [
        "--set bogie_mas",
        "--set speed",
        "--over sped",
        "F",
        "--set wheelset_mass",
        "--over half_wheelbase",
        "--set frequency",
    ]


@pytest.mark.parametrize(
    "text",
    [
        put("sweep", "speed", '"100:300:7 km/h"'),
        put("sweep", "primary_joint_stiffness", '"x"'),
        put("operation", "speed", '"250 km"').replace('[{ speed = "250 km/h", ', "[{ "),
        put("confirm", "points", '[{ bogie_mass = "600 kg" }]').replace(
            'bogie_mass = "600 kg"\n', 'bogie_mass = "6"\n'
        ),
        put("operation", "speed", '"255 km/h"').replace('{ speed = "250 km/h"', '{ speed = "250"'),
        put("vehicle", "half_wheelbase", '"9 kg"'),
        put("track", "spectrum", '"x"\nroughness = "1e-7 m^2*rad/m"'),
    ],
)
def test_a_fault_has_no_false_faults_in_its_train(text):
    assert len(refusal(lambda: build_case(text))) == 1


# --- warnings --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "over", "words"),
    [
        (
            put("vehicle", "secondary_joint_stiffness", '"5 N/m"'),
            {},
            "F: [vehicle].secondary_joint_stiffness: 5 N/m is 1.2e-05 of secondary_stiffness (412000 N/m), below 0.01",
        ),
        (PLAIN, {"primary_joint_stiffness": "5 kN/m, inf"}, None),
        (
            PLAIN,
            {"primary_joint_stiffness": "5, 5000 kN/m"},
            "--over primary_joint_stiffness: 5000 N/m is 5.7e-03 of primary_stiffness (875000 N/m), below 0.01",
        ),
        (
            put("sweep", "secondary_joint_stiffness", '"4.1, 5000 kN/m"'),
            {},
            "F: [sweep].secondary_joint_stiffness: 4100 N/m",
        ),
        (
            put("sweep", "secondary_stiffness", '"412, 600000 kN/m"'),
            {},
            "F: [vehicle].secondary_joint_stiffness: 5e+06 N/m is 8.3e-03 of secondary_stiffness (6e+08 N/m)",
        ),
    ],
)
def test_soft_joints_are_warned_of(text, over, words):
    if words is None:
        assert "unit" in refusal(lambda: build_case(text, over=over))[0]
        return
    with pytest.warns(FreqrailWarning) as caught:
        case = build_case(text, over=over, file="F")
    assert isinstance(case, Case)
    (message,) = [str(w.message) for w in caught]
    assert message.startswith(words)
    assert "check the unit" in message


# --- the order of things ---------------------------------------------------------------------------


def test_settings_change_scalars_and_over_changes_axes():
    case = build_case(
        drop("sweep"),
        {"car_body_mass": "16 t", "vehicle.wheelset_mass": "0.8 t", "operation.speed": "200 km/h", "title": "new"},
        {"half_wheelbase": "0.8, 1 m", "bogie_mass": "600, 650 kg"},
    )
    assert case.quantities["car_body_mass"].value == 16000
    assert case.quantities["wheelset_mass"].value == 800
    assert case.speed == 200 * 5 / 18
    assert case.title == "new"
    assert [axis.name for axis in case.axes] == ["half_wheelbase", "bogie_mass"]


@pytest.mark.parametrize(
    ("settings", "over", "problem"),
    [
        (
            {"speed": "90 km/h"},
            {"speed": "90, 100 km/h"},
            "--over speed: excludes --set speed; give one of the two",
        ),
        (
            {"vehicle.bogie_mass": "650 kg"},
            {"sweep.bogie_mass": "600, 700 kg"},
            "--over sweep.bogie_mass: excludes --set vehicle.bogie_mass; give one of the two",
        ),
        (
            {"contact_constant": "5e-8 m/N^(2/3)"},
            {"contact_stiffness": "1, 1.2 GN/m"},
            "--over contact_stiffness: excludes --set contact_constant; give one of the two",
        ),
    ],
)
def test_a_quantity_is_set_or_swept_but_not_both(settings, over, problem):
    """Whichever was applied last, the other would be ignored in silence."""
    for text in (drop("sweep"), PLAIN):  # also of what the case sweeps itself
        told = refusal(lambda text=text: build_case(text, settings, over))
        assert problem in told
        assert "is swept by the case" not in " ".join(told)


def test_the_band_may_be_set_beside_the_frequencies_of_spectra():
    case = build_case(PLAIN, {"frequency": "0.5:80 Hz"}, {"frequency": "1, 2 Hz"})
    assert (case.band.low, case.band.high) == (0.5, 80)
    assert case.frequency.values.tolist() == [1, 2]


def test_over_replaces_an_axis_in_its_place_and_adds_new_ones_last():
    case = build_case(
        PLAIN, over={"bogie_mass": "600, 700 kg", "speed": "200:250:50 km/h", "sweep.half_wheelbase": "0.7 m"}
    )
    assert [axis.name for axis in case.axes] == ["speed", "primary_joint_stiffness", "bogie_mass", "half_wheelbase"]
    assert case.axes[0].values.tolist() == [200.0, 250.0]
    assert case.axes[3].values.tolist() == [0.7]
    assert case.speed == 250 * 5 / 18


def test_an_axis_of_spectra_is_no_swept_parameter():
    case = build_case(PLAIN, over={"frequency": "1:3:1 Hz"})
    assert case.frequency.values.tolist() == [1.0, 2.0, 3.0]
    assert [axis.name for axis in case.axes] == ["speed", "primary_joint_stiffness"]
    both = build_case(put("sweep", "frequency", '"1:3:1 Hz"'), {"frequency": "1:3 Hz"})
    assert both.band == Band("frequency", 1.0, 3.0)
    assert both.frequency.values.size == 3


SETTINGS = {
    "a swept name": (
        {"speed": "260 km/h"},
        '--set speed: speed is swept by the case; give it one value with --over "speed=260 km/h"',
    ),
    "a swept name with its section": ({"operation.speed": "260 km/h"}, '--over "speed=260 km/h"'),
    "an axis": (
        {"sweep.speed": "100, 200 km/h"},
        '--set sweep.speed: an axis is replaced with --over "speed=100, 200 km/h"',
    ),
    "an unknown name": ({"bogie_mas": "1 kg"}, "--set bogie_mas: unknown name (did you mean bogie_mass?)"),
    "an unknown name of a section": (
        {"vehicle.bogie_mas": "1 kg"},
        "--set vehicle.bogie_mas: unknown name (did you mean bogie_mass?)",
    ),
    "a name of another section": ({"vehicle.spectrum": "german-high"}, "--set vehicle.spectrum: unknown name"),
    "an unknown section": (
        {"vehicel.bogie_mass": "1 kg"},
        "--set vehicel.bogie_mass: unknown name (did you mean bogie_mass?)",
    ),
    "the version": ({"schema_version": "1"}, "--set schema_version: unknown name"),
    "a bad value": ({"bogie_mass": "5"}, "--set bogie_mass: a unit is missing"),
    "a bad value with its section": ({"vehicle.bogie_mass": "5"}, "--set vehicle.bogie_mass: a unit is missing"),
    "a bare number": ({"bogie_mass": 5}, "--set bogie_mass: text with a unit is expected"),
    "a band": (
        {"band": "0.1:100 Hz"},
        '--set band: only "band=none", or --set "frequency=0.1:100 Hz", will do (got "0.1:100 Hz")',
    ),
    "a reversed band": ({"frequency": "100:1 Hz"}, "--set frequency: the lower limit must be below the upper one"),
    "an unknown spectrum": ({"spectrum": "german"}, "--set spectrum: unknown spectrum (did you mean german-low?)"),
    "masses of neither": ({"masses": "hole"}, '--set masses: must be "half" (masses'),
    "values of a swept name that no axis takes": (
        {"primary_joint_stiffness": "10, 5, 5 MN/m"},
        'is swept by the case; give it values with --over "primary_joint_stiffness=5, 10 MN/m"',
    ),
    "values of a swept name": (
        {"primary_joint_stiffness": "10, 20 MN/m"},
        'give it values with --over "primary_joint_stiffness=10, 20 MN/m"',
    ),
    "values of a swept name, one of them rigid": (
        {"primary_joint_stiffness": "inf, 0.5"},
        'give it one value with --over "primary_joint_stiffness=5 MN/m"',
    ),
    "values of a swept name of two units": (
        {"primary_joint_stiffness": "10 MN/m, 5 MN/m"},
        'give it one value with --over "primary_joint_stiffness=5 MN/m"',
    ),
    "values of an axis that no axis takes": (
        {"sweep.speed": "fast"},
        '--set sweep.speed: an axis is replaced with --over "speed=250 km/h"',
    ),
    "an axis of spectra": ({"sweep.frequency": "1, 2 Hz"}, 'is replaced with --psd --over "frequency=1, 2 Hz"'),
    "an axis that there is not": ({"sweep.sped": "1 km/h"}, "--set sweep.sped: unknown name (did you mean speed?)"),
    "a roughness": ({"roughness": "1e-7 m^2*rad/m"}, '--set roughness: belongs to spectrum = "rational" only'),
    "text that no file can hold": ({"title": "\udc80"}, "--set title: holds a NUL or another character"),
    "a number for a title": ({"title": 5}, "--set title: text is expected (got 5)"),
}


@pytest.mark.parametrize("row", SETTINGS)
def test_bad_settings(row):
    settings, words = SETTINGS[row]
    (problem,) = refusal(lambda: build_case(PLAIN, settings))
    assert problem.startswith("--set ")
    assert words in problem


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ({"sped": "250 km/h"}, "--over sped: unknown name (did you mean speed?)"),
        ({"vehicle.speed": "250 km/h"}, "--over vehicle.speed: unknown name"),
        ({"roughness": "1e-7 m^2*rad/m"}, "--over roughness: unknown name"),
        ({"speed": "250"}, "--over speed: a unit is missing at the end"),
        ({"speed": 250}, "--over speed: an axis is text"),
        ({"bogie_mass": "0, 5 kg"}, "--over bogie_mass: must be greater than 0 kg"),
    ],
)
def test_bad_axes_from_options(over, words):
    (problem,) = refusal(lambda: build_case(PLAIN, over=over))
    assert problem.startswith(words)


def test_band_none_removes_the_band():
    assert build_case(PLAIN, {"band": "none"}).band is None
    assert build_case(PLAIN, {"band": " None "}).band is None
    assert "[band]" not in build_case(PLAIN, {"band": "none"}).effective


def test_one_kind_of_band_removes_the_other():
    assert build_case(PLAIN, {"wavelength": "1:200 m"}).band == Band("wavelength", 1.0, 200.0)
    long = build_case(PLAIN, {"wavelength": "1:200 m"})
    assert build_case(long.effective, {"frequency": "1 Hz, 2 Hz"}).band == Band("frequency", 1.0, 2.0)


@pytest.mark.parametrize("first", [{"wavelength": "1:200 m"}, {"band": "none"}])
def test_two_given_of_which_one_can_hold_are_refused_in_either_order(first):
    both = first | {"frequency": "1:2 Hz"}
    for changes in (both, dict(reversed(both.items()))):
        (problem,) = refusal(lambda changes=changes: build_case(PLAIN, changes))
        one, other = (f"--set {name}" for name in changes)
        assert problem == f"{other}: excludes {one}; give one of the two"


def test_one_contact_key_removes_the_other():
    case = build_case(PLAIN, {"contact_stiffness": "1.2 GN/m"})
    assert case.vehicle.contact_stiffness == 1.2e9
    assert "contact_constant" not in case.quantities
    back = build_case(case.effective, {"vehicle.contact_constant": "4e-8 m/N^(2/3)"})
    assert "contact_stiffness" not in back.quantities
    assert back.quantities["contact_constant"].value == 4e-8
    (problem,) = refusal(lambda: build_case(case.effective, over={"contact_constant": "4e-8, 5e-8 m/N^(2/3)"}))
    assert problem == "--over contact_constant: swept, but [vehicle] gives contact_stiffness"
    swept = build_case(PLAIN, over={"contact_constant": "4e-8 m/N^(2/3)"})
    other = build_case(swept.effective, over={"contact_stiffness": "1, 2 GN/m"})
    assert [axis.name for axis in other.axes][-1] == "contact_stiffness"
    assert "contact_constant" not in [axis.name for axis in other.axes]


def test_a_german_spectrum_removes_the_numbers_of_a_rational_one():
    rational = build_case(
        PLAIN, {"spectrum": "rational", "roughness": "1e-6 m^2*rad/m", "cutoffs": "0.02 rad/m, 0.8 rad/m"}
    )
    assert rational.spectrum == RationalSpectrum("rational", 1e-6, (0.02, 0.8))
    assert build_case(rational.effective, {"spectrum": "german-high"}).spectrum.roughness == 1.080e-6


def test_options_may_leave_points_off_the_grid_but_a_file_may_not():
    assert build_case(PLAIN, {"primary_damping": "18 kN*s/m"}).points == build_case(PLAIN).points
    alone = drop("sweep")
    assert build_case(alone, {"speed": "90 km/h"}).points[0]["speed"].text == "250 km/h"
    (problem,) = refusal(lambda: build_case(alone.replace('\nspeed = "250 km/h"', '\nspeed = "90 km/h"')))
    assert problem.endswith('speed: is not swept, the case has 90 km/h (got "250 km/h")')
    case = build_case(PLAIN, over={"speed": "100, 200 km/h"})
    assert [{n: q.text for n, q in p.items()} for p in case.points] == [
        {"speed": "250 km/h", "primary_joint_stiffness": "5 MN/m"}
    ]
    assert '"250 km/h" is off the grid; the nearest value is 200 km/h' in refusal(lambda: build_case(case.effective))[0]
    assert facts(build_case(case.effective, stray_points=True)) == facts(case)


# --- the effective case ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "settings", "over"),
    [
        (SHIPPED, {}, {}),
        *((ACCEPTED[row], {}, {}) for row in ACCEPTED if row != "a byte order mark"),
        (SHIPPED, {"band": "none", "title": 'a\x1b\x7f"\\\r\n\u2028é\U0001f686'}, {}),
        (SHIPPED, {"contact_stiffness": "1.2 GN/m", "frequency": "1:50 Hz"}, {}),
        (PLAIN, {}, {"speed": "250, 300 km/h", "bogie_mass": "600, 650 kg", "frequency": "log:1:10:5 Hz"}),
        (PLAIN, {"spectrum": "rational", "roughness": "1e-6 m^2*rad/m", "cutoffs": "0.02:0.8 rad/m"}, {}),
    ],
)
def test_the_effective_case_is_the_same_case(text, settings, over):
    case = build_case(text, settings, over)
    again = build_case(case.effective)
    assert facts(again) == facts(case)
    assert again.effective == case.effective
    assert case.text == text
    case.effective.encode()  # what a file stores


@settings(database=None, derandomize=True)
@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=40))
def test_any_text_survives_toml(text):
    tables = {"title": text, "vehicle": {"masses": text}, "confirm": {"points": [{"speed": text}, {}]}, "empty": {}}
    assert tomllib.loads(to_toml(tables)) == tables


# --- names -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SWEEPABLE)
def test_every_sweepable_quantity_can_be_set_and_swept(name):
    unit, base = PARAMETERS[name].unit, build_case(drop("sweep")).scalars[name].value
    other = f"{base * 1.01!r} {unit}"
    text = put("confirm", "points", "[]").replace(PLAIN[PLAIN.index("[sweep]") : PLAIN.index("[confirm]")], "")
    assert build_case(text, {name: other}).quantities[name].value == base * 1.01
    over = {name: f"{base!r}, {base * 1.01!r} {unit}"}
    case = build_case(text, over=over)
    assert case.axes[0].si.tolist() == pytest.approx([base, base * 1.01], rel=1e-15)
    grid = case.vehicles()
    if name == "speed":
        assert case.speeds().size == 2
    else:
        field = "contact_stiffness" if name.startswith("contact") else name
        assert np.size(getattr(grid, field)) == 2


def test_the_scalar_of_a_swept_length_must_be_in_order_too():
    """It is what show, modes and slices are computed with."""
    text = put("vehicle", "half_wheelbase", '"4 m"')
    (problem,) = refusal(lambda: build_case(text, over={"half_wheelbase": "0.7, 0.8 m"}, file="F"))
    assert problem.startswith("F: [vehicle].half_bogie_spacing: must exceed half_wheelbase")
    assert problem.endswith("(got 3.289 m and 4 m)")


def test_the_messages_name_the_file_that_was_read(tmp_path):
    path = tmp_path / "näme with blanks.toml"
    path.write_text(put("vehicle", "bogie_mass", '"0 kg"'), encoding="utf-8")
    assert refusal(lambda: load_case(str(path)))[0].startswith(f"{path}: [vehicle].bogie_mass: ")
    assert freqrail.load_case is case_module.load_case
