"""Warnings: published vehicles are left alone, the usual slips are told, what is advised runs and is free of them."""

from __future__ import annotations

import json
import re
import shlex
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

import freqrail
from freqrail.case.case import Case, build_case, load_case
from freqrail.case.criteria import CRITERIA
from freqrail.case.parameters import SWEEPABLE
from freqrail.cli.commands import run
from freqrail.errors import FreqrailWarning, InputError
from freqrail.model.band import Band
from freqrail.model.equations import system_response
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.vehicle import half_vehicle, static_wheel_load
from freqrail.solver.contact_force import contact_force, contact_force_rms
from freqrail.solver.modes import modes
from freqrail.sweep import plausibility
from freqrail.sweep.concern import FORCES, some_corners
from tests.fleet import FLEET, LENGTHS, PAPER, TYPICAL, UNITS, case_text, half
from tests.helpers import INDEX, all_poles, density, lagged, lags, random_vehicles, reference_nodes

CASE = "yu-damper-joint"
EVERY = {**FLEET, "the paper's": PAPER}
BODIES = tuple(name for name in UNITS if name.endswith(("_mass", "_inertia")))


def names(text: str) -> set[str]:
    """What is warned of in a case, but for the paper's radius of gyration where that is its own 2.49."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)
        case = build_case(text)
    found = {concern.name: concern.measured[1] for concern in plausibility.concerns(case)}
    if found.get("radius_of_gyration") == pytest.approx(2.4896, rel=1e-4):
        del found["radius_of_gyration"]
    return {*found, *case.warnings}


def times(factor: float, *changed: str) -> Callable[[Mapping[str, float]], dict[str, float]]:
    return lambda vehicle: {name: value * (factor if name in changed else 1) for name, value in vehicle.items()}


def exchanged(what: str) -> Callable[[Mapping[str, float]], dict[str, float]]:
    primary, secondary = f"primary_{what}", f"secondary_{what}"
    other = {primary: secondary, secondary: primary}
    return lambda vehicle: {name: vehicle[other.get(name, name)] for name in vehicle}


SLIPS = {
    "whole masses": times(2, *BODIES),
    "whole masses, springs and dampers": times(2, *(name for name in UNITS if name not in LENGTHS)),
    "whole spacings": times(2, *LENGTHS),
    "whole spacing of the pivots": times(2, "half_bogie_spacing"),
    "whole wheelbase": times(2, "half_wheelbase"),
    "K_p and K_s exchanged": exchanged("stiffness"),
    "C_p and C_s exchanged": exchanged("damping"),
    **{f"{name} a thousandth": times(1e-3, name) for name in UNITS if name not in LENGTHS},
    **{f"{name} a thousandfold": times(1e3, name) for name in UNITS if name not in LENGTHS},
    **{f"{name} tenfold": times(10, name) for name in UNITS if name.endswith("_inertia")},
    **{f"{name} a tenth": times(0.1, name) for name in UNITS if name.endswith("_inertia")},
}
"""What is wrong with a half vehicle: `40 kg` for t and `40 N*s/m` for kN*s/m are a thousandth."""

PLAUSIBLE_ALL_THE_SAME = {
    ("whole spacing of the pivots", "the paper's"),  # 13.2 m, which is more usual than its own 6.58 m
    ("car_body_pitch_inertia a tenth", "the paper's"),  # 0.79 half pivot distances, which is what others have
    ("bogie_pitch_inertia a tenth", "the paper's"),  # 0.43 half wheelbases
    ("C_p and C_s exchanged", "Pioneer trailer"),  # 40 and 38 kN s/m
    ("K_p and K_s exchanged", "Eurostar locomotive"),  # the only one whose secondary springs are the stiffer ones
}
"""Slips that make a vehicle as plausible as others: no criterion that spares these can tell them."""


# --- vehicles --------------------------------------------------------------------------------------


@pytest.mark.parametrize("vehicle", FLEET)
def test_no_published_vehicle_is_warned_of(vehicle):
    whole = build_case(case_text(FLEET[vehicle], "whole"))
    assert plausibility.concerns(whole) == ()
    assert plausibility.concerns(build_case(case_text(half(FLEET[vehicle])))) == ()
    fast = replace(whole, band=Band("frequency", 0.1, 100), accepted={"wavelengths": (0.1, 1000)})
    assert [c.name for c in plausibility.concerns(fast) if not c.accepted] == []


LEGS = tuple(name for name in UNITS if name.endswith(("_stiffness", "_damping")))
ALL = {**EVERY, **TYPICAL}
HALVES: dict[str, tuple[str, Callable, set[str]]] = {
    # what is read: masses =, what is done to the right numbers for it, the vehicles of which it is told
    "all of both sides": ("half", times(2, *BODIES, *LEGS), ALL.keys() - {"tram"}),
    "masses of both sides": ("half", times(2, *BODIES), ALL.keys() - {"tram"}),
    "springs and dampers of both sides": ("half", times(2, *LEGS), {"Eurostar locomotive", "tram", "Y25 wagon, laden"}),
    "all of one side": (
        "whole",
        times(0.5, *BODIES, *LEGS),
        {
            *("Pioneer trailer", "double-deck coach", "Eurostar locomotive", "CRH380A", "the paper's"),
            *("tram", "Y25 wagon, empty"),
        },
    ),
    "springs and dampers of one side": (
        "whole",
        times(0.5, *LEGS),
        {"Shinkansen 300", "Pioneer trailer", "GZ18 metro", "the paper's"},
    ),
    "masses of one side": (
        "whole",
        times(0.5, *BODIES),
        {
            *("Pioneer trailer", "double-deck coach", "Eurostar locomotive", "CRH380A", "the paper's"),
            *("tram", "Y25 wagon, laden", "Y25 wagon, empty"),
        },
    ),
    "secondary springs and dampers of the vehicle": (
        "whole",
        times(2, "secondary_stiffness", "secondary_damping"),
        {"high-speed coach", "Eurostar locomotive", "locomotive", "Y25 wagon, laden", "Y25 wagon, empty"},
    ),
    "primary springs and dampers of a bogie": (
        "whole",
        times(2, "primary_stiffness", "primary_damping"),
        {"Pioneer trailer", "tram", "Y25 wagon, laden"},
    ),
}


@pytest.mark.parametrize("slip", HALVES)
def test_what_is_told_of_halves_and_wholes_and_what_is_not(slip):
    """Of a vehicle that is warned of as it is, what it has and half as much again is accepted."""
    masses, change, expected = HALVES[slip]
    seen = set()
    for vehicle, whole in ALL.items():
        accepted = {
            c.name: (min(c.usual[0], c.measured[0] / 1.5), max(c.usual[1], 1.5 * c.measured[1]))
            for c in plausibility.concerns(build_case(case_text(whole, "whole")))
        }
        changed = change(whole if masses == "whole" else half(whole))
        if told(replace(build_case(case_text(changed, masses)), accepted=accepted)):
            seen.add(vehicle)
    assert seen == expected


ONE_STAGE = dict.fromkeys(
    ("bogie_bounce", "primary_over_secondary"), "one stage of springs (Y25 and other freight wagons)"
)
MOTORS = {"wheelset": "wheelsets that carry nose-suspended motors are heavier"}
RIGHT: dict[str, dict[str, str]] = {
    "tram": {},
    "locomotive": MOTORS,
    "Y25 wagon, laden": ONE_STAGE,
    "Y25 wagon, empty": {**dict.fromkeys(("car_bounce", "car_pitch"), "most of all empty ones"), **ONE_STAGE},
}
"""What is warned of in right vehicles of other kinds, and what the warning says for them."""


@pytest.mark.parametrize("vehicle", TYPICAL)
@pytest.mark.parametrize("masses", ["half", "whole"])
def test_a_right_vehicle_that_is_warned_of_is_named_and_is_not_advised_what_it_says(vehicle, masses):
    numbers = TYPICAL[vehicle]
    found = told(build_case(case_text(numbers if masses == "whole" else half(numbers), masses)))
    assert found.keys() == RIGHT[vehicle].keys()
    for name, concern in found.items():
        assert RIGHT[vehicle][name] in concern.text
        assert f"masses={masses}" not in concern.text
        assert f"; or accept it: [accepted] {name} = [" in concern.text


def test_masses_of_the_other_kind_are_what_a_warning_advises():
    """Both sides given for one are too heavy, one for both too light; what is too heavy as a whole is neither."""
    for masses, factor, advice in (
        ("half", 4.0, {"masses=whole"}),
        ("whole", 0.1, {"masses=half"}),
        ("whole", 4.0, set()),
        ("half", 0.1, set()),
    ):
        case = build_case(case_text({**FLEET["Velaro E"], "wheelset_mass": factor * 1800}, masses))
        assert set(re.findall(r"masses=\w+", told(case)["wheelset"].text)) == advice


@pytest.mark.parametrize("slip", SLIPS)
def test_every_slip_on_every_vehicle_is_told(slip):
    silent = {vehicle for vehicle, whole in EVERY.items() if not names(case_text(SLIPS[slip](half(whole))))}
    assert silent == {vehicle for what, vehicle in PLAUSIBLE_ALL_THE_SAME if what == slip}


def test_a_car_body_of_15_kg_and_one_of_15000_t_are_told():
    for mass in ("15 kg", "15000 t"):
        case = load_case(CASE, {"car_body_mass": mass})
        assert "car_body" in {c.name for c in plausibility.concerns(case) if not c.accepted}


def test_roughness_in_m2_for_cm2_is_told():
    """4.032e-3 cm^2 rad/m are 4.032e-7 m^2 rad/m; read as m^2 they give 64.8 m/s^2 and 98 mm of track."""
    track = {"spectrum": "rational", "cutoffs": '["0.0206 rad/m", "0.8246 rad/m"]'}
    right = load_case(CASE, {**track, "roughness": "4.032e-3 cm^2*rad/m"})
    slip = load_case(CASE, {**track, "roughness": "4.032e-3 m^2*rad/m"})
    assert "track_height" not in {c.name for c in plausibility.concerns(right)}
    (height,) = (c for c in plausibility.concerns(slip) if c.name == "track_height")
    assert height.measured[1] == pytest.approx(98.427, rel=1e-4)


def test_natural_frequencies_are_those_of_the_undamped_modes():
    """By eigenvalues of the state matrices, wheels and contact springs left in: a part in a thousand."""
    for vehicle in random_vehicles(20, 5):
        free = replace(vehicle, primary_damping=0.0, secondary_damping=0.0)
        by_name = {mode.name: mode.natural_frequency for mode in modes(free)}
        for chain, car, bogie in (
            ("bounce", "car bounce", "bogie bounce, in phase"),
            ("pitch", "car pitch", "bogie bounce, in antiphase"),
        ):
            found = plausibility.natural_frequencies(free, chain)
            np.testing.assert_allclose(found, (by_name[car], by_name[bogie]), rtol=2e-2)


def test_the_line_an_engineer_knows_a_vehicle_by():
    """Manchester benchmark: 32 t, 2 x 2.615 t and 4 x 1.813 t make 11.1 t an axle; 1.07 Hz is its published bounce."""
    text = plausibility.vitals_text(build_case(case_text(FLEET["Manchester benchmark"], "whole")))
    assert text.startswith("axle load 11.1 t, car bounce 1.07 Hz, car pitch 1.3 Hz, bogie bounce 7.47 Hz, pivots 19 m")
    swept = build_case(case_text(PAPER, "whole"), over={"car_body_mass": "30.4, 40 t"})
    assert plausibility.vitals_text(swept).startswith("axle load 9.6 to 12 t, car bounce 0.918 to 1.05 Hz")


# --- the grid --------------------------------------------------------------------------------------


def told(case: Case) -> dict[str, plausibility.Concern]:
    return {concern.name: concern for concern in plausibility.concerns(case) if not concern.accepted}


def test_a_swept_value_is_seen_also_where_the_case_s_own_is_right():
    case = load_case(CASE, over={"contact_stiffness": "0.05, 1 GN/m", "speed": "200, 250 km/h"})
    resonance = told(case)["wheelset_resonance"]
    assert "43 Hz" in resonance.text
    assert "contact_stiffness=0.05 GN/m" in resonance.text
    between = load_case(CASE, over={"wheelset_mass": "700, 800, 7000 kg"})
    assert "(14 at wheelset_mass=7000 kg)" in told(between)["wheelset"].text


@pytest.mark.parametrize(
    ("settings", "over"),
    [
        ({"band": "none"}, {}),
        ({"frequency": "0.1:150 Hz"}, {}),  # the flank alone
        ({"frequency": "0.1:250 Hz"}, {}),
        ({"wavelength": "0.2:100 m"}, {}),
        ({"frequency": "0.1:100 Hz"}, {"contact_stiffness": "0.05, 1 GN/m"}),
        ({"frequency": "0.1:100 Hz"}, {"wheelset_mass": "700, 7000 kg"}),
        ({"frequency": "0.001:30 Hz"}, {}),  # wavelengths only
        ({"frequency": "0.1:100 Hz"}, {"speed": "5:600:5 km/h"}),
    ],
)
@pytest.mark.parametrize("accepting", [True, False])
def test_a_band_that_is_advised_is_another_one_and_free_of_the_warning(settings, over, accepting):
    case = load_case(CASE, settings, over)
    case = case if accepting else replace(case, accepted={})
    concerned = {n: c for n, c in told(case).items() if n in ("wheelset_resonance", "wavelengths")}
    assert concerned
    for concern in concerned.values():
        advice = re.search(r'--set "((?:frequency|wavelength)=[^"]*)"', concern.text)
        if advice is None:
            assert over  # 5 to 600 km/h: no band of frequencies is 1 to 120 m at both
            assert "no band is clear of it" in concern.text
            continue
        name, _, value = advice[1].partition("=")
        better = load_case(CASE, {name: value}, over)
        assert better.band != case.band
        better = better if accepting else replace(better, accepted={})
        assert not {"wheelset_resonance", "wavelengths"} & told(better).keys()


def test_a_band_that_ends_at_the_resonance_is_said_to():
    for end, words in (
        (194.6, "194.6 Hz, about at the wheelsets' resonance"),
        (150, "150 Hz, 0.77 times the wheelsets'"),
    ):
        text = told(load_case(CASE, {"frequency": f"0.1:{end} Hz"}))["wheelset_resonance"].text
        assert f"the band ends at {words}" in text


def test_a_grid_with_many_axes_is_judged_by_some_of_its_corners(monkeypatch):
    over = {name: f"{0.99 * v!r}, {v!r}, {1.01 * v!r} {UNITS[name]}" for name, v in half(FLEET["Velaro E"]).items()}
    case = build_case(case_text(half(FLEET["Velaro E"])), over=over)
    computed = []
    monkeypatch.setattr(plausibility, "contact_force_rms", lambda *arguments: computed.append(arguments) or np.ones(4))
    assert plausibility.concerns(case) == ()
    assert len({one for one, *_ in computed}) == len(computed)
    assert 2 * FORCES <= len(computed) <= 2 * (FORCES + 1)
    assert len(case.axes) == 11
    for name in over:  # the one whose joints are as given
        ends = [getattr(one, name) for one, *_ in computed[: 2 * FORCES : 2]]
        low, high = sorted(set(ends))
        assert high / low == pytest.approx(1.01 / 0.99)
        assert ends.count(low) == ends.count(high) == FORCES / 2


@pytest.mark.parametrize("axes", range(16))
def test_some_corners_hold_both_ends_of_every_axis_and_all_pairs_of_ends_of_two(axes):
    shape = (1, *(2,) * axes, 1)
    chosen = np.array(some_corners(shape))
    assert len(np.unique(chosen, axis=0)) == len(chosen) == min(2**axes, FORCES)
    for one in range(1, axes + 1):
        assert set(chosen[:, one]) == {0, 1}
        for other in range(1, one):
            assert len(np.unique(chosen[:, [one, other]], axis=0)) == 4
    assert len(SWEEPABLE) - 2 <= 15  # without the speed, and the contact given in one way only


@pytest.mark.parametrize("more", [{}, {"secondary_stiffness": "400, 420 kN/m", "car_body_mass": "15000, 15400 kg"}])
@pytest.mark.parametrize("before", [True, False])
def test_contact_lost_at_one_end_of_an_axis_is_told_wherever_the_axis_stands(more, before):
    """Wheelsets of 1.2 t lift, of 0.5 t not: every second of 32 corners in order has the last axis at one end only."""
    wheelsets = {"wheelset_mass": "500, 1200 kg"}
    over = {**more, **wheelsets} if before else {**wheelsets, **more}
    case = load_case(CASE, {"spectrum": "german-high", "frequency": "0.5:100 Hz"}, {**over, "speed": "300, 310 km/h"})
    force = told(case)["wheel_force"]
    assert "wheelset_mass=1200 kg" in force.text
    assert force.measured == pytest.approx((0.194, 0.458) if not more else (0.192, 0.464), abs=2e-3)


def test_the_worst_corner_is_that_which_a_few_corners_point_to(monkeypatch):
    """A force that grows with some axes and falls with others: its largest value lies at one corner of 2048."""
    over = {name: f"{0.9 * v!r}, {v!r} {UNITS[name]}" for name, v in half(FLEET["Velaro E"]).items()}
    case = build_case(case_text(half(FLEET["Velaro E"])), over=over)
    signs = {name: 1 if place % 3 else -1 for place, name in enumerate(over)}

    def force(vehicle, *_):
        logarithm = sum(sign * np.log(getattr(vehicle, name)) for name, sign in signs.items())
        own = sum(sign * np.log(getattr(case.vehicle, name)) for name, sign in signs.items())
        load = static_wheel_load(vehicle.car_body_mass, vehicle.bogie_mass, vehicle.wheelset_mass)
        return np.full(4, load * np.exp(logarithm - own))

    monkeypatch.setattr(plausibility, "contact_force_rms", force)
    (found,) = (c for c in plausibility.concerns(case) if c.name == "wheel_force")
    assert found.measured[1] == pytest.approx(0.9 ** -list(signs.values()).count(-1))


# --- the wheel-rail force --------------------------------------------------------------------------


def test_the_contact_force_is_the_contact_spring_s_compression(paper_vehicle):
    """K_H (z_w - v) wheel by wheel from the equations of motion, against the sum of the inertia forces."""
    omega = 2 * np.pi * np.geomspace(0.3, 400, 60)
    speed = 70.0
    for vehicle in (paper_vehicle, paper_vehicle.traditional(), *random_vehicles(3, 8)):
        per_wheel = system_response(half_vehicle(vehicle), omega)
        heights = np.exp(-1j * np.multiply.outer(lags(vehicle, speed), omega))
        wheels = [INDEX[f"z_w{k}"] for k in (1, 2, 3, 4)]
        compression = vehicle.contact_stiffness * (lagged(per_wheel, vehicle, omega, speed)[wheels] - heights)
        centre = np.exp(1j * omega * (vehicle.half_bogie_spacing + vehicle.half_wheelbase) / speed)
        size = np.abs(compression).max()
        np.testing.assert_allclose(contact_force(vehicle, omega, speed), compression * centre, atol=1e-7 * size)


def test_the_rms_of_the_contact_force_by_a_quadrature_of_its_own(paper_vehicle, german_low):
    low, high, speed = 0.1, 100.0, 250 / 3.6
    omega, weights = reference_nodes(
        2 * np.pi * low, 2 * np.pi * high, all_poles(paper_vehicle, german_low, speed), lags(paper_vehicle, speed)[-1]
    )
    square = np.abs(contact_force(paper_vehicle, omega, speed)) ** 2
    expected = np.sqrt(square @ (weights * density(german_low, omega, speed)))
    found = contact_force_rms(paper_vehicle, german_low, speed, Band("frequency", low, high))
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_contact_lost_is_told_and_a_train_that_keeps_it_is_not(paper_case):
    assert "wheel_force" not in told(paper_case)
    whole = told(load_case(CASE, {"band": "none"}))["wheel_force"]
    assert whole.measured[1] > 100  # the wheelsets ring on the rigid rail
    assert "accept" not in whole.text  # more than the load itself
    rough = replace(paper_case, spectrum=RationalSpectrum("rational", 4e-6, (0.0206, 0.8246)))
    force = told(rough)["wheel_force"].measured[1]
    assert "or accept it: [accepted] wheel_force = [0.0, " in told(rough)["wheel_force"].text
    one, speed = paper_case.vehicles().at((0, 0)), float(paper_case.speeds().max())
    load = static_wheel_load(one.car_body_mass, one.bogie_mass, one.wheelset_mass)
    assert force >= contact_force_rms(one, rough.spectrum, speed, rough.band).max() / load > 1 / 3


def test_the_bands_wavelengths_are_of_no_corner_of_the_grid():
    """With one swept joint, two ends of a range must not be taken for two corners."""
    over = {"primary_joint_stiffness": "1, 5 MN/m", "secondary_joint_stiffness": "5 MN/m", "speed": "100, 200 km/h"}
    case = load_case(CASE, {"frequency": "0.001:30 Hz"}, over)
    assert "primary_joint_stiffness" not in told(replace(case, axes=case.axes[:1]))["wavelengths"].text


def test_numbers_beyond_all_measure_are_judged_at_once(paper_vehicle, german_low):
    absurd = replace(paper_vehicle, car_body_mass=1e300, bogie_mass=1e-300)
    assert np.isnan(contact_force_rms(absurd, german_low, 70.0, Band("frequency", 0.1, 100))).all()
    assert "car_body" in told(load_case(CASE, {"car_body_mass": "1e11 kg", "bogie_mass": "1e-3 kg"}))


def test_what_rings_for_ever_has_no_force_to_tell(paper_vehicle, german_low):
    undamped = replace(paper_vehicle, primary_damping=0.0)
    assert np.isnan(contact_force_rms(undamped, german_low, 70.0, None)).all()


# --- whole masses ----------------------------------------------------------------------------------


def test_a_whole_vehicle_gives_the_numbers_of_its_half():
    for vehicle in (PAPER, FLEET["CRH380A"]):
        text = case_text(vehicle, "whole", joints="10 MN/m")
        whole, one_side = build_case(text), build_case(case_text(half(vehicle), joints="5 MN/m"))
        assert whole.vehicle == one_side.vehicle
        assert float(whole.scalars["contact_stiffness"].value) == pytest.approx(whole.vehicle.contact_stiffness, 1e-9)
    over = {"car_body_mass": "30.4, 32 t", "speed": "200, 250 km/h"}
    found = freqrail.sweep(load_case(CASE, {"masses": "whole", **_doubled()}, {**over, **_joints("10 MN/m")}))
    expected = freqrail.sweep(CASE, {"car_body_mass": "15.2, 16 t", "speed": "200, 250 km/h", **_joints("5 MN/m")})
    for name in ("bogie_acceleration_rms", "traditional_primary_stroke_rms"):
        np.testing.assert_array_equal(found[name].values, expected[name].values)
    assert found.car_body_mass.values.tolist() == [30.4, 32]  # as written
    assert found.car_body_mass.attrs["long_name"] == "the car body's mass"


def _doubled() -> dict[str, str]:
    values = {name: f"{value!r} {UNITS[name]}" for name, value in PAPER.items() if name not in LENGTHS}
    return {name: text for name, text in values.items() if name != "car_body_mass"} | {
        "car_body_pitch_inertia": "2038 t*m^2"
    }


def _joints(stiffness: str) -> dict[str, str]:
    return dict.fromkeys(("primary_joint_stiffness", "secondary_joint_stiffness"), stiffness)


def test_lengths_and_the_contact_are_not_halved():
    case = build_case(case_text(PAPER, "whole"), {"contact_stiffness": "1 GN/m"})
    assert case.vehicle.contact_stiffness == 1e9
    assert (case.vehicle.half_bogie_spacing, case.vehicle.half_wheelbase) == (3.289, 0.797)
    assert case.vehicle.primary_joint_stiffness == 2.5e6


# --- accepted --------------------------------------------------------------------------------------


def test_a_range_that_a_case_accepts_is_not_warned_of_but_noted(paper_case):
    found = plausibility.concerns(paper_case)
    assert {c.name for c in found} == {"radius_of_gyration", "wavelengths"}
    assert all(c.accepted for c in found)
    freqrail.sweep(CASE, {"speed": "50, 350 km/h"})  # a FreqrailWarning is an error here, see pyproject.toml
    beyond = told(load_case(CASE, {"car_body_pitch_inertia": "1100 t*m^2"}))
    assert set(beyond) == {"radius_of_gyration"}


def test_what_a_warning_says_to_accept_is_accepted():
    slips = {**half(PAPER), "primary_damping": 40.0, "wheelset_mass": 7.0}
    text = case_text(slips)
    concerned = told(build_case(text))
    assert len(concerned) == 3
    lines = [re.search(r"\[accepted\] (.*)$", concern.text)[1] for concern in concerned.values()]
    assert told(build_case(text + "[accepted]\n" + "\n".join(lines) + "\n")) == {}


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("radius = [0.5, 2]", "accepted: unknown warning 'radius' (known: "),
        ("radius_of_gyratio = [0.5, 2]", "unknown warning 'radius_of_gyratio' (did you mean radius_of_gyration?)"),
        ("wheelset = 2", "wheelset: two numbers are expected, as in wheelset = [0.5, 2.4] (got 2)"),
        ('wheelset = ["1 t", "2 t"]', "wheelset: two numbers are expected"),
        ("wheelset = [3, 2]", "wheelset: the first number must be less than the second"),
        ("wheelset = [nan, 2]", "wheelset: the first number must be less than the second"),
    ],
)
def test_bad_ranges_are_refused(line, problem):
    with pytest.raises(InputError) as caught:
        build_case(case_text(half(PAPER)) + f"[accepted]\n{line}\n")
    assert problem in str(caught.value)


def test_every_criterion_is_measured_and_has_a_remedy_or_an_advice():
    others = {"track_height", "wavelengths", "wheelset_resonance", "wheel_force"}
    assert CRITERIA.keys() == plausibility.MEASURES.keys() | others
    assert {name for name, c in CRITERIA.items() if not c.remedy} == {"wavelengths", "wheelset_resonance"}


# --- in the file and said again --------------------------------------------------------------------


@pytest.fixture
def warned(tmp_path, monkeypatch, capsys):
    """A result with a wheelset of 7 t, and an input warned of while the case was read."""
    monkeypatch.chdir(tmp_path)
    over = ["--over", "speed=200, 250 km/h", "--over", "wheelset_mass=700, 3500 kg"]
    joints = ["--over", "primary_joint_stiffness=5 MN/m", "--over", "secondary_joint_stiffness=5000000000 mN/m"]
    assert run(["sweep", CASE, *over, *joints, "-o", "w.nc"]) == 0
    return "w.nc"


def test_warnings_stay_with_the_file_and_are_said_again(warned, capsys):
    first = [line.replace(f" {CASE}:", "") for line in capsys.readouterr().err.splitlines()]
    assert any("mass of a whole wheelset 1.4 to 7 t (7 at wheelset_mass=3500 kg)" in line for line in first)
    assert any("millinewtons" in line for line in first)
    records = json.loads(freqrail.open_result(warned).attrs["warnings"])
    assert [record["text"] for record in records if not record["accepted"]] == [
        line.removeprefix("freqrail: warning: ") for line in first
    ]
    point = "wheelset_mass=700 kg, secondary_joint_stiffness=5 MN/m"
    confirming = ["confirm", warned, "--at", point, "--integrator", "exponential", "--realisations", "1"]
    for command in (
        ["show", warned],
        ["show", warned, "--at", "speed=200 km/h"],
        ["plot", warned],
        [*confirming, "--duration", "20 s", "-o", "c.nc"],
        ["show", "c.nc"],
        ["plot", "c.nc", "-o", "pictures"],
    ):
        assert run(command) in (0, 3)  # one short record may well fall outside
        said = capsys.readouterr().err.splitlines()
        assert [line for line in said if line.startswith("freqrail: warning: ")] == first, command


def test_sweep_and_show_say_what_the_case_accepts_in_a_line_and_warn_of_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for command in (["sweep", CASE, "-o", "r.nc"], ["show", "r.nc"], ["show", CASE]):
        assert run(command) == 0
        out, err = capsys.readouterr()
        assert err == ""
        assert len([line for line in out.splitlines() if line.startswith("accepted by the case: ")]) == 1
        assert (
            sum(line.startswith("axle load 9.6 t, car bounce 1.05 Hz, car pitch 0.423 Hz") for line in out.splitlines())
            == 1
        )
    assert run(["show", "r.nc", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [record["accepted"] for record in facts["warnings"]] == [True, True]
    assert facts["vehicle"][0] == {"quantity": "axle_load", "smallest": 9.6, "largest": 9.6, "unit": "t"}


def test_a_dry_run_warns_too(capsys):
    assert run(["sweep", CASE, "--set", "wheelset_mass=0.7 kg", "--dry-run"]) == 0
    assert "mass of a whole wheelset 0.0014 t" in capsys.readouterr().err


def test_the_functions_warn_as_the_commands_do():
    with pytest.warns(FreqrailWarning, match="mass of a whole wheelset 0.0014 t"):
        found = freqrail.sweep(CASE, {"speed": "250 km/h"}, {"wheelset_mass": "0.7 kg"})
    assert "wheelset" in found.attrs["warnings"]


def test_an_error_estimate_says_that_it_is_numerical_only():
    found = freqrail.sweep(CASE, {"speed": "250 km/h"})
    for name in found.data_vars:
        if name.endswith("_relative_error"):
            assert "numerical only: it says nothing of the model or of its data" in found[name].attrs["long_name"]


# --- advice that runs ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ["--set", "primary_joint_stiffness=10, 5 MN/m"],
        ["--set", "speed=fast"],
        ["--set", "sweep.speed=100:50:10 km/h"],
        ["--set", "sweep.frequency=1"],
        ["--set", "band=0.1:100 Hz"],
        ["--over", "frequency=1, 2 Hz"],
        ["--set", "masses=both"],
        ["--set", "bogie_mass=600"],
        ["--set", "frequency=1 Hz"],
        ["--set", "secondary_stiffness=412 mN/m"],
    ],
)
def test_what_a_message_advises_runs(arguments, tmp_path, monkeypatch, capsys):
    """The option in quotes of the message in place of what was refused; an example in quotes as the option's value."""
    monkeypatch.chdir(tmp_path)
    base = ["sweep", CASE, "--dry-run"]
    code = run([*base, *arguments])
    message = capsys.readouterr().err
    options = re.findall(r'(?:--psd )?--(?:set|over) "[^"]*"|add --psd', message)
    examples = re.findall(r'such as "([^"]*)"|as in \[?"([^"]*)"|did you mean "([^"]*)"|must be "([^"]*)"', message)
    tried = []
    for option in options:
        if option == "add --psd":
            tried.append([*arguments, "--psd"])
        else:
            tried.append(shlex.split(option))
    for found in examples:
        value = next(filter(None, found))
        name = arguments[1].partition("=")[0]
        if "did you mean" in message:
            value = f"412 {value}"
        if name == "frequency" and " Hz" in value and ":" not in value:
            value = "0.1:100 Hz"
        tried.append([arguments[0], f"{name}={value}"])
    assert tried, message
    assert code in (0, 2)
    for better in tried:
        assert run([*base, *better]) == 0, (message, better, capsys.readouterr().err)
        capsys.readouterr()


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("front_secondary_damping=1 kN*s/m", "(front and rear are alike in this model; secondary_damping is the one"),
        (
            "left_primary_stiffness=1 kN/m",
            "(the model is one rail's share: left and right are alike; primary_stiffness",
        ),
        ("lateral_stiffness=1 kN/m", "(the model moves vertically and pitches, no more)"),
        ("car_body_bending_frequency=9 Hz", "(the bodies of this model are rigid)"),
        ("rail_stiffness=1 kN/m", "(the rail of this model is rigid)"),
    ],
)
def test_a_quantity_that_the_model_cannot_have_is_not_taken_for_a_slip_of_the_pen(option, words, capsys):
    for kind in ("--set", "--over"):
        assert run(["sweep", CASE, kind, option]) == 2
        message = capsys.readouterr().err
        assert words in message
        assert "did you mean" not in message


def test_the_hint_of_plot_is_a_command_that_stores_spectra(tmp_path, monkeypatch, capsys):
    """A command where one will do it; of a changed or a user's own case words, since no file need be there."""
    monkeypatch.chdir(tmp_path)
    for settings, runs in (
        ([], True),
        (["--over", "speed=200, 250 km/h"], False),
        (["--set", "bogie_mass=650 kg"], False),
    ):
        assert run(["sweep", CASE, *settings, "-o", "r.nc", "--overwrite"]) == 0
        assert run(["plot", "r.nc", "-o", "pictures"]) == 0
        (line,) = (line for line in capsys.readouterr().err.splitlines() if "no spectra stored" in line)
        assert ("freqrail sweep" in line) == runs
        if runs:
            words = shlex.split(line[line.index("freqrail sweep") :])
            assert run(words[1:]) == 0
            assert (
                "psd" in freqrail.open_result(words[-1]).sizes or "frequency" in freqrail.open_result(words[-1]).sizes
            )
            capsys.readouterr()
        else:
            assert "sweep the case anew with --psd and the same --set and --over" in line
