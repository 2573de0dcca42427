"""Case files of schema 2: a vehicle of bodies, wheels and suspensions, and what each fault of one is told as."""

from __future__ import annotations

import contextlib
import copy
import tomllib
import warnings

import numpy as np
import pytest

import freqrail
from freqrail.case.case import build_case
from freqrail.case.file import to_toml
from freqrail.errors import FreqrailWarning, InputError

VEHICLE = """
schema_version = 2
title = "A car that bends, on air springs, its rear axle on a soft track"

[parameters]
pivot = "9.5 m"
axle = "1.28 m"
joint = "3.3 MN/m"

[bodies.car]
mass = "16000 kg"
pitch_inertia = "985000 kg*m^2"
position = "0 m"
[[bodies.car.bending]]
frequency = "9 Hz"
damping_ratio = 0.015
length = "24.5 m"

[bodies.bogie_front]
mass = "1307.5 kg"
pitch_inertia = "738 kg*m^2"
position = "pivot"

[bodies.bogie_rear]
mass = "1307.5 kg"
pitch_inertia = "738 kg*m^2"
position = "-pivot"

[wheels.axle_1]
mass = "906.5 kg"
position = "pivot + axle"
contact_stiffness = "1.34785 GN/m"

[wheels.axle_2]
mass = "906.5 kg"
position = "pivot - axle"
contact_stiffness = "1.34785 GN/m"

[wheels.axle_3]
mass = "906.5 kg"
position = "axle - pivot"
contact_constant = "5.1824e-8 m/N^(2/3)"

[wheels.axle_4]
mass = "906.5 kg"
position = "-pivot - axle"
contact = "H - (m | k | c)"
H = "1.3 GN/m"
m = "200 kg"
k = "60 MN/m"
c = "50 kN*s/m"

[suspensions.primary_1]
between = ["bogie_front", "axle_1"]
position = "pivot + axle"
law = "k | (K - c - K)"
k = "1.2 MN/m"
c = "4 kN*s/m"
K = "joint"

[suspensions.primary_2]
like = "primary_1"
position = "pivot - axle"
between = ["bogie_front", "axle_2"]

[suspensions.primary_3]
like = "primary_1"
position = "axle - pivot"
between = ["bogie_rear", "axle_3"]

[suspensions.primary_4]
like = "primary_3"
position = "-axle - pivot"
between = ["bogie_rear", "axle_4"]

[suspensions.secondary_front]
between = ["car", "bogie_front"]
position = "pivot"
law = "k3 | (k1 - (k2 | c))"
k1 = "600 kN/m"
k2 = "700 kN/m"
k3 = "40 kN/m"
c = "20 kN*s/m"

[suspensions.secondary_rear]
like = "secondary_front"
position = "-pivot"
between = ["car", "bogie_rear"]

[suspensions.tilt_front]
direction = "pitch"
between = ["car", "bogie_front"]
law = "k"
k = "10.5 kN*m/rad"

[variants.rigid]
joint = "inf"

[outputs.driver]
quantity = "acceleration"
of = "car"
at = "8 m"

[track]
spectrum = "german-low"

[operation]
speed = "200 km/h"

[band]
wavelength = ["1.5 m", "120 m"]
"""


def changed(*changes):
    """The vehicle's text with values put (None: taken out) at paths."""
    tables = tomllib.loads(VEHICLE)
    for path, value in changes:
        at = tables
        for key in path[:-1]:
            at = at[key] if isinstance(at, list) else at.setdefault(key, {})
        if value is None:
            del at[path[-1]]
        else:
            at[path[-1]] = value
    return to_toml(tables)


def problems_of(text, **further):
    with pytest.raises(InputError) as caught:
        quiet(text, **further)
    return list(caught.value.problems)


def quiet(text, *further, **named):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)
        return build_case(text, *further, **named)


P1, P2, WHEEL, CAR = ("suspensions", "primary_1"), ("suspensions", "primary_2"), ("wheels", "axle_1"), ("bodies", "car")

FAULTS = {
    "an unknown body": (
        [((*P1, "between"), ["bogie_frnt", "axle_1"])],
        "[suspensions.primary_1].between: unknown body 'bogie_frnt' (did you mean bogie_front?)",
    ),
    "a letter without value": (
        [((*P1, "c"), None)],
        '[suspensions.primary_1].c: missing; the law names it: write it as in c = "1.2 MN/m"',
    ),
    "a unit that is none of the three": (
        [((*P1, "c"), "4 kW")],
        "[suspensions.primary_1].c: wrong dimension: a stiffness in N/m, a damping in N*s/m or a mass in kg is "
        'expected (got "4 kW")',
    ),
    "brackets that do not close": (
        [((*P1, "law"), "k | (K - c - K")],
        '[suspensions.primary_1].law: the bracket at character 5 does not close (got "k | (K - c - K")',
    ),
    "like in a circle": (
        [((*P1, "like"), "primary_4")],
        "[suspensions.primary_1].like: like in a circle: primary_1 -> primary_4 -> primary_3 -> primary_1",
    ),
    "like nothing there is": (
        [((*P2, "like"), "primary_7")],
        '[suspensions.primary_2].like: unknown suspension (did you mean primary_4?) (got "primary_7")',
    ),
    "a wheel carried by nothing": (
        [((*P1, "between"), ["bogie_front", "axle_2"])],
        "[wheels.axle_1]: this wheel is carried by nothing: no suspension has it in its `between`",
    ),
    "a body that hangs on nothing": (
        [(("bodies", "box"), {"mass": "100 kg", "position": "0 m"})],
        "[bodies.box]: this body hangs on nothing: no suspension has it in its `between`",
    ),
    "a body on a dashpot alone": (
        [
            (("bodies", "box"), {"mass": "100 kg", "position": "0 m"}),
            (
                ("suspensions", "box"),
                {"between": ["box", "car"], "position": "0 m", "law": "c", "c": "1 kN*s/m"},
            ),
        ],
        "[bodies.box]: hangs on nothing: no spring holds its bounce",
    ),
    "a body that may turn": (
        [
            (("bodies", "box"), {"mass": "100 kg", "pitch_inertia": "50 kg*m^2", "position": "0 m"}),
            (("suspensions", "box"), {"between": ["box", "car"], "position": "0 m", "law": "k", "k": "1 MN/m"}),
        ],
        "[bodies.box]: hangs on nothing: no spring holds its pitch",
    ),
    "a leg from a body to itself": (
        [((*P1, "between"), ["axle_1", "axle_1"])],
        "[suspensions.primary_1].between: joins 'axle_1' to itself; two bodies are expected",
    ),
    "a name twice": (
        [(("wheels", "car"), tomllib.loads(VEHICLE)["wheels"]["axle_1"])],
        "[wheels.car]: 'car' is the name of a body too; give one of them another",
    ),
    "a name that is a unit": (
        [(("parameters", "kN"), "5 m")],
        '[parameters].kN: "kN" is a unit; give the parameter another name',
    ),
    "a name that is the speed's": (
        [(("parameters", "speed"), "5 m")],
        '[parameters].speed: "speed" is the name of something else; give the parameter another name',
    ),
    "a mode shape too short": (
        [((*CAR, "bending", 0, "length"), "18 m")],
        "[suspensions.secondary_front].position: stands 9.5 m from the position of car, beyond the shape of its "
        "bending mode 1, which covers -9 to 9 m",
    ),
    "a sum of units": (
        [((*WHEEL, "position"), "pivot + joint")],
        "[wheels.axle_1].position: a sum of m and N/m: a place is a sum of lengths",
    ),
    "no sum": ([((*WHEEL, "position"), "pivot axle")], "[wheels.axle_1].position: a place is a sum of lengths"),
    "an unknown parameter": (
        [((*P1, "K"), "joints")],
        "[suspensions.primary_1].K: unknown parameter 'joints' (did you mean joint?)",
    ),
    "a parameter of another kind": (
        [((*CAR, "mass"), "pivot")],
        '[bodies.car].mass: pivot is a length in m; a mass in kg is expected (got "pivot")',
    ),
    "an unknown key": ([((*CAR, "weight"), "5 kg")], "[bodies.car].weight: unknown key"),
    "a letter too many": (
        [((*P1, "q"), "5 kg")],
        "[suspensions.primary_1].q: unknown key",
    ),
    "a mass below zero": ([((*CAR, "mass"), "-5 kg")], "[bodies.car].mass: must be greater than 0 kg"),
    "a mass of nothing": ([((*CAR, "mass"), "0 kg")], "[bodies.car].mass: must be greater than 0 kg"),
    "a number for a text": ([((*CAR, "mass"), 5)], "[bodies.car].mass: text with a unit is expected"),
    "a list for a text": ([((*CAR, "mass"), ["5 kg"])], "[bodies.car].mass: text with a unit is expected"),
    "a text for a ratio": (
        [((*CAR, "bending", 0, "damping_ratio"), "0.01")],
        "[bodies.car.bending_1].damping_ratio: a number without quotes is expected",
    ),
    "infinite mass": ([((*CAR, "mass"), "inf")], "[bodies.car].mass: inf is not allowed here"),
    "not a number": ([((*CAR, "mass"), "nan kg")], "[bodies.car].mass: nan is not a number"),
    "a decimal comma": ([((*CAR, "mass"), "16,5 t")], "[bodies.car].mass: a decimal comma"),
    "too large a number": ([((*CAR, "mass"), "1e400 kg")], "[bodies.car].mass: a number beyond what double precision"),
    "a joint of nothing": (
        [((*P1, "K"), "0 N/m")],
        '[suspensions.primary_1].K: a spring in series must be at least 1 N/m, or "inf" for a rigid one',
    ),
    "a negative spring": ([((*P1, "k"), "-1 MN/m")], "[suspensions.primary_1].k: must be at least 0 N/m"),
    "two contacts": (
        [((*WHEEL, "contact_constant"), "5e-8 m/N^(2/3)")],
        "[wheels.axle_1].contact_stiffness: contact_stiffness and contact_constant are given; give one of",
    ),
    "no contact": ([((*WHEEL, "contact_stiffness"), None)], "[wheels.axle_1].contact_stiffness: missing; give one of"),
    "wheels out of order": (
        [((*WHEEL, "position"), "-pivot")],
        "[wheels.axle_2].position: 8.22 m is not behind axle_1 at -9.5 m; wheels are told front to rear",
    ),
    "an unknown direction": (
        [((*P1, "direction"), "lateral")],
        '[suspensions.primary_1].direction: "vertical" or "pitch" is expected (got "lateral")',
    ),
    "a pitch spring on a wheel": (
        [(("suspensions", "tilt_front", "between"), ["car", "axle_1"])],
        "[suspensions.tilt_front].between: axle_1 has no pitch_inertia and does not pitch",
    ),
    "a variant of nothing": (
        [(("variants", "rigid"), {"joints": "inf"})],
        "[variants.rigid].joints: unknown name (did you mean joint?)",
    ),
    "an empty variant": ([(("variants", "rigid"), {})], "[variants.rigid]: a table is expected, with what it fixes"),
    "an output of nothing": (
        [(("outputs", "driver", "of"), "cab")],
        '[outputs.driver].of: unknown body (did you mean car?) (got "cab")',
    ),
    "an output of no quantity": (
        [(("outputs", "driver", "quantity"), "accelerations")],
        "[outputs.driver].quantity: unknown quantity (did you mean acceleration?)",
    ),
    "an output beyond the beam": (
        [(("outputs", "driver", "at"), "13 m")],
        "[outputs.driver].at: 13 m from the position of car is beyond the shape of its bending mode 1",
    ),
    "an output by a name that is taken": (
        [(("outputs", "stroke"), {"quantity": "acceleration", "of": "car"})],
        "[outputs.stroke]: 'stroke' is the name of another response; give it another",
    ),
    "a table missing": ([(("wheels",), None)], "[wheels]: this table is missing"),
    "schema 1": ([(("schema_version",), 1)], "schema_version: must be 2 for [parameters], [bodies], [wheels]"),
}


def test_the_vehicle_itself_is_right():
    case = build_case(VEHICLE)
    assert not case.is_half_vehicle
    assert freqrail.sweep(case).status == 0


@pytest.mark.parametrize("which", FAULTS)
def test_a_fault_is_told_with_its_place_and_what_is_expected(which):
    changes, words = FAULTS[which]
    found = problems_of(changed(*copy.deepcopy(changes)))
    assert any(line.startswith("case: " + words) for line in found), found
    assert all("\n" not in line for line in found)


def test_all_faults_of_a_file_are_told_at_once():
    names = ["a unit that is none of the three", "an unknown parameter", "a sum of units", "a name that is a unit"]
    names += ["an output of no quantity", "a mass below zero", "a variant of nothing"]
    found = problems_of(changed(*(change for name in names for change in FAULTS[name][0])) + '\n[sweep]\nspeed = "5"\n')
    for name in names:
        assert any(line.startswith("case: " + FAULTS[name][1][:40]) for line in found), (name, found)
    assert any("[sweep].speed" in line for line in found)


def test_a_place_outside_the_car_is_warned_of():
    with pytest.warns(FreqrailWarning, match="outside the vehicle"):
        build_case(changed((("bodies", "car", "bending"), None), (("outputs", "driver", "at"), "40 m")))


def test_what_nothing_uses_is_warned_of():
    with pytest.warns(FreqrailWarning, match=r"\[parameters\].spare: nothing uses it"):
        build_case(changed((("parameters", "spare"), "5 m")))


def test_settings_and_axes_take_paths_and_names():
    case = quiet(VEHICLE, {"suspensions.primary_1.k": "1.4 MN/m", "bodies.car.bending_1.damping_ratio": "0.02"})
    assert case.quantities["suspensions_primary_1_k"].value == 1.4e6
    assert case.quantities["bodies_car_bending_1_damping_ratio"].value == 0.02
    case = quiet(VEHICLE, over={"suspensions.primary_2.K": "1, 5, inf MN/m", "joint": "2, 3 MN/m"})
    assert [axis.name for axis in case.axes] == ["suspensions_primary_2_K", "joint"]
    result = freqrail.sweep(case)  # the others keep the parameter
    assert result.sizes["suspensions_primary_2_K"] == 3
    with pytest.raises(InputError, match="nothing uses joint, so that it cannot vary"):
        quiet(VEHICLE, over={"suspensions.primary_1.K": "1, 5 MN/m", "joint": "2, 3 MN/m"})  # all are like primary_1
    with pytest.raises(InputError, match=r"unknown name .did you mean joint"):
        build_case(VEHICLE, {"joinst": "5 MN/m"})
    with pytest.raises(InputError, match=r"--over bodies.car.mas: unknown name .did you mean bodies_car_mass"):
        build_case(VEHICLE, over={"bodies.car.mas": "5, 6 t"})
    with pytest.raises(InputError, match="excludes --set joint"):
        build_case(VEHICLE, {"joint": "5 MN/m"}, {"joint": "1, 2 MN/m"})


def test_what_one_has_of_another_by_like_varies_with_it_unless_it_is_named():
    alike = freqrail.sweep(quiet(VEHICLE, {"suspensions.primary_1.k": "2 MN/m"}))
    written = freqrail.sweep(
        quiet(changed(*(((*("suspensions", f"primary_{i}"), "k"), "2 MN/m") for i in (1, 2, 3, 4))))
    )
    np.testing.assert_allclose(alike.stroke_rms, written.stroke_rms, rtol=1e-12)
    one = freqrail.sweep(quiet(VEHICLE, {"suspensions.primary_2.k": "2 MN/m"}))
    other = freqrail.sweep(quiet(changed(((*P2, "k"), "2 MN/m"))))
    np.testing.assert_allclose(one.stroke_rms, other.stroke_rms, rtol=1e-12)
    axis = freqrail.sweep(quiet(VEHICLE, over={"suspensions.primary_2.k": "1.2, 2 MN/m"}))
    np.testing.assert_allclose(axis.stroke_rms[1], one.stroke_rms, rtol=1e-9)


def test_numbers_without_a_unit_are_axes_too(tmp_path):
    ratio = "bodies.car.bending_1.damping_ratio"
    case = quiet(VEHICLE, over={ratio: "0.01, 0.015, 0.05"})
    result = freqrail.sweep(case)
    name = "bodies_car_bending_1_damping_ratio"
    assert result[name].attrs["units"] == "1"
    one = freqrail.sweep(quiet(VEHICLE))
    np.testing.assert_allclose(result.driver_rms.sel({name: 0.015}), one.driver_rms, rtol=1e-10)
    freqrail.write_result(result, tmp_path / "r.nc")
    assert freqrail.open_result(tmp_path / "r.nc")[name].values.tolist() == [0.01, 0.015, 0.05]
    with pytest.raises(InputError, match="a number without a unit is expected"):
        quiet(VEHICLE, over={ratio: "1, 2 m"})


def test_a_dashpot_behind_an_inerter_holds_nothing():
    """Two parts in series without static stiffness carry no weight, and are no fault of the others'."""
    law = {"law": "k3 | (c - b)", "c": "20 kN*s/m", "b": "50 kg", "k3": "400 kN/m"}
    front = law | {"between": ["car", "bogie_front"], "position": "pivot"}
    rear = law | {"between": ["car", "bogie_rear"], "position": "-pivot"}
    case = quiet(changed((("suspensions", "secondary_front"), front), (("suspensions", "secondary_rear"), rear)))
    assert freqrail.sweep(case).status == 0


def test_a_variant_is_the_vehicle_with_what_it_fixes():
    twin = freqrail.sweep(quiet(VEHICLE, over={"joint": "1, inf MN/m"}))
    np.testing.assert_allclose(twin.rigid_stroke_rms, twin.stroke_rms.sel(joint=np.inf), rtol=1e-9)
    assert "joint" not in twin.rigid_stroke_rms.dims


def test_samples_vary_paths_and_names_together(tmp_path):
    table = tmp_path / "designs.csv"
    table.write_text("name,joint [MN/m],suspensions.secondary_front.c [kN*s/m]\nsoft,1,10\nhard,inf,40\n")
    (tmp_path / "v.toml").write_text(VEHICLE)
    result = freqrail.sweep(tmp_path / "v.toml", samples=table)
    assert result.sizes["sample"] == 2
    one = freqrail.sweep(quiet(VEHICLE, {"joint": "1 MN/m", "suspensions.secondary_front.c": "10 kN*s/m"}))
    np.testing.assert_allclose(result.stroke_rms[0], one.stroke_rms, rtol=1e-10)


def test_a_mode_shape_may_stand_in_a_file(tmp_path):
    """The beam's own shape told by points gives the beam's numbers, but for the straight lines between them."""
    x = np.linspace(-12.25, 12.25, 2001)
    half, at = 4.730040744862704 / 2, 4.730040744862704 * x / 24.5
    shape = (np.cos(at) / np.cos(half) + np.cosh(at) / np.cosh(half)) / 2
    rows = "\n".join(f"{a!r},{b!r}" for a, b in zip(x.tolist(), shape.tolist(), strict=True))
    (tmp_path / "mode.csv").write_text(f"position [m],value\n{rows}\n")
    mode = {"frequency": "9 Hz", "damping_ratio": 0.015, "shape": "mode.csv"}
    (tmp_path / "v.toml").write_text(changed(((*CAR, "bending"), [mode])))
    found, beam = freqrail.sweep(tmp_path / "v.toml"), freqrail.sweep(quiet(VEHICLE))
    np.testing.assert_allclose(found.driver_rms, beam.driver_rms, rtol=1e-5)
    assert "mode.csv" not in found.attrs["effective_case"]
    (tmp_path / "mode.csv").write_text("x,y\n1,2\n")
    with pytest.raises(InputError, match="its first line must be"):
        freqrail.load_case(tmp_path / "v.toml")


def test_bodies_that_do_not_pitch_have_no_pitch_acceleration():
    text = changed((("bodies", "bogie_rear", "pitch_inertia"), None))
    result = freqrail.sweep(quiet(text))
    assert result.status == 0
    assert result.body_pitch_acceleration_rms.sel(body="bogie_rear") == 0


def test_random_damage_is_refused_or_read():
    """Three hundred changes of single values: no exception but InputError leaves."""
    rng = np.random.default_rng(5)
    tables = tomllib.loads(VEHICLE)
    values = [
        "inf",
        "",
        "5",
        "-3 kg",
        "1 m",
        "car",
        "k - k",
        "nan N/m",
        7,
        1.5,
        True,
        [],
        {},
        ["a", "b"],
        "pivot",
        "(",
        "9e99 MN/m",
    ]
    values += [{"stiffness": "1 MN/m", "loss_factor": 0.1}, {"coefficient": "1 MN*s^0.2/m", "exponent": 0.3}, "1" * 400]
    leaves = []

    def walk(at, path):
        for key, value in at.items() if isinstance(at, dict) else enumerate(at):
            leaves.append((*path, key))
            if isinstance(value, dict | list):
                walk(value, (*path, key))

    walk(tables, ())
    for _ in range(300):
        damaged = copy.deepcopy(tables)
        path = leaves[rng.integers(len(leaves))]
        at = damaged
        for key in path[:-1]:
            at = at[key]
        value = values[rng.integers(len(values))]
        at[path[-1]] = copy.deepcopy(value)
        try:
            text = to_toml(damaged)
            tomllib.loads(text)
        except (tomllib.TOMLDecodeError, AttributeError):
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FreqrailWarning)
            with contextlib.suppress(InputError):
                build_case(text)
