"""Confirmations of free vehicles: the time side assembled from the laws' realisations, whatever the vehicle."""

from __future__ import annotations

import warnings
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad_vec

import freqrail
from freqrail.case.case import build_case
from freqrail.case.expand import expanded
from freqrail.cli.commands import run as command
from freqrail.confirm import crosschecks, setup, simulated, simulation, time_side
from freqrail.confirm.confirm import carry_out
from freqrail.confirm.run import prepare_run
from freqrail.errors import InputError
from freqrail.figures import confirmations
from freqrail.model import assembled
from freqrail.model.elements import Dashpot, Parallel, Series, Spring
from freqrail.model.outputs import Output
from freqrail.model.realisation import Realisation
from freqrail.model.spectrum import frequency_psd
from freqrail.result import confirmation
from freqrail.result.netcdf import write_result
from freqrail.result.points import read_result
from freqrail.result.vocabulary import vocabulary_of
from freqrail.solver.transfer import transfer

pytestmark = pytest.mark.filterwarnings("ignore::freqrail.errors.FreqrailWarning")

VEHICLE = """
schema_version = 2
title = "front and rear differ, and every kind of rational law"
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
mass = "1500 kg"
pitch_inertia = "800 kg*m^2"
position = "-pivot"
[wheels.axle_1]
mass = "906.5 kg"
position = "pivot + axle"
contact_stiffness = "1.34785 GN/m"
[wheels.axle_2]
mass = "906.5 kg"
position = "pivot - axle"
contact = "k | c"
k = "1.2 GN/m"
c = "60 kN*s/m"
[wheels.axle_3]
mass = "950 kg"
position = "axle - pivot"
contact_constant = "5.1824e-8 m/N^(2/3)"
[wheels.axle_4]
mass = "906.5 kg"
position = "-pivot - axle"
contact = "H - (m | k | c)"
H = "0.9 GN/m"
m = "400 kg"
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
between = ["bogie_rear", "axle_4"]
position = "-axle - pivot"
law = "k | (q - (c | b))"
k = "1.1 MN/m"
q = "900 kN/m"
c = "9 kN*s/m"
b = "60 kg"
[suspensions.secondary_front]
between = ["car", "bogie_front"]
position = "pivot"
law = "k3 | (k1 - (k2 | c))"
k3 = "200 kN/m"
k1 = "500 kN/m"
k2 = "300 kN/m"
c = "25 kN*s/m"
[suspensions.secondary_rear]
between = ["car", "bogie_rear"]
position = "-pivot"
law = "k | c | b"
k = "430 kN/m"
c = "20 kN*s/m"
b = "100 kg"
[suspensions.pitch_front]
direction = "pitch"
between = ["car", "bogie_front"]
law = "k | c"
k = "10.5 kN*m/rad"
c = "200 N*m*s/rad"
[variants.stiff]
joint = "30 MN/m"
[outputs.driver]
quantity = "acceleration"
of = "car"
at = "8 m"
[outputs.floor]
quantity = "velocity"
of = "car"
at = "-8, 0, 8 m"
[outputs.leading]
quantity = "acceleration"
of = "axle_1"
[outputs.damped]
quantity = "acceleration"
of = "axle_2"
[outputs.closing]
quantity = "stroke_velocity"
of = "secondary_front"
[track]
spectrum = "german-low"
[operation]
speed = "200 km/h"
[band]
frequency = "0.5:10 Hz"
"""

QUICK = {"integrator": "exponential", "start": "steady", "duration": "16 s", "realisations": 2}


def case_of(text: str):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return build_case(text, name="vehicle", stray_points=True)


@pytest.fixture(scope="module")
def result():
    return freqrail.sweep(case_of(VEHICLE), responses="all", psd=True)


@pytest.fixture(scope="module")
def plan(result):
    return prepare_run(result, **QUICK)


@pytest.fixture(scope="module")
def found(plan):
    return carry_out(plan)


# --- they agree ------------------------------------------------------------------------------------


def test_all_stands_of_a_vehicle_with_every_kind_of_rational_law(found):
    assert confirmation.problems(found) == []
    assert confirmation.not_checked(found) == []
    total, made = confirmation.count_of_checks(found)
    series = 3 + 3 + 6 + 6 + 4 + 1 + 3 + 1 + 1 + 1
    assert found.sizes["series"] == series
    assert total == made == 5 * 2 * series + 2
    assert list(found["model"].values) == ["the vehicle", "stiff"]


def test_the_half_vehicle_written_out_stands_too_with_the_same_numbers():
    """The records of fixed amplitudes have the same moduli: so have the responses' line spectra."""
    over = {"primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m", "speed": "200 km/h"}
    case = freqrail.load_case("yu-damper-joint", {"frequency": "0.5:5 Hz"}, over)
    template, free = freqrail.sweep(case), freqrail.sweep(case_of(expanded(case)))
    known, own = (
        carry_out(prepare_run(each, at="speed=200 km/h", **QUICK | {"duration": "18 s"})) for each in (template, free)
    )
    assert confirmation.problems(own) == confirmation.problems(known) == []
    assert own.attrs["responses"] == free.attrs["responses"]
    bodies = own["body_acceleration_rms_line_spectrum"].sel(body=["bogie_front", "bogie_rear"])
    legs = own["stroke_rms_line_spectrum"].sel(suspension=[f"primary_{k}" for k in (1, 2, 3, 4)])
    for ours, theirs in ((bodies, "bogie_acceleration"), (legs, "primary_stroke")):
        rows = ours.values[..., 0], known[f"{theirs}_rms_line_spectrum"].values[..., 0]
        np.testing.assert_allclose(*rows, rtol=1e-9)
    np.testing.assert_allclose(own["lag"], known["lag"], rtol=1e-12)
    np.testing.assert_allclose(own["static_wheel_load"][0], float(known["static_wheel_load"][0]), rtol=1e-9)


@pytest.mark.parametrize("speed", [5.0, 60.0])
def test_the_assembled_states_answer_as_the_kernel_does(plan, speed):
    """Every output, forces too, of both models: C (i omega - A)^-1 B e + ... against the blocks' transfer."""
    point = replace(plan.points[0], speed=speed)
    side = time_side.time_side(point, plan.names)
    frequency = np.array([0.3, 1.1, 8.9, 12.0, 37.0, 110.0, 600.0])
    assert {*side.rates} == {*side.models}  # axle_2 stands on a damper
    for name, vehicle in time_side.vehicles(point).items():
        rows = transfer(vehicle.reduction, vehicle.values, 2 * np.pi * frequency, speed)
        known = np.concatenate([rows[each] for each in plan.names])
        ours = crosschecks.state_response(
            side.models[name], side.readout[name], side.feedthrough[name], side.lags, frequency, side.rates[name]
        )
        # the kernel's phase is that midway between first and last wheel
        ours = ours * np.exp(1j * np.pi * frequency * side.lags[-1])
        np.testing.assert_allclose(ours, known, rtol=1e-9, atol=1e-9 * np.abs(known).max(axis=1, keepdims=True).min())


def test_the_covariance_is_the_integral_over_all_frequencies(plan):
    """With the track's rate in the readout, whose part the shaping filter's second state is."""
    point = plan.points[0]
    side = time_side.time_side(point, plan.names)
    own = (side.models["stiff"], side.readout["stiff"], side.feedthrough["stiff"], side.lags)
    rates = side.rates["stiff"]
    place = confirmation.series_of(plan.names, plan.vocabulary)["damped"]
    rms, _ = crosschecks.covariance_rms(*own, point.spectrum, point.speed, rates)

    def power(frequency):
        found = crosschecks.state_response(*own, np.array([frequency]), rates)[place, 0]
        return np.square(np.abs(found)) * frequency_psd(point.spectrum, np.array([frequency]), point.speed)

    edges = np.concatenate([[1e-6], np.geomspace(0.05, 2000, 60), [1e6]])
    square = sum(quad_vec(power, a, b, epsrel=1e-9)[0] for a, b in pairwise(edges))
    np.testing.assert_allclose(rms[place], np.sqrt(square), rtol=1e-5)


# --- it can fail -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def short():
    """One model and one Gaussian record: what the solver check sees, it sees there."""
    alone = VEHICLE.replace('[variants.stiff]\njoint = "30 MN/m"\n', "")
    return prepare_run(freqrail.sweep(case_of(alone)), **QUICK | {"realisations": 1})


def changed_side(plan, **values: float) -> time_side.TimeSide:
    """The time side with some of the vehicle's numbers times a factor."""
    point = plan.points[0]

    def other(vehicle):
        own = {name: value * values.get(name, 1.0) for name, value in vehicle.values.items()}
        return replace(vehicle, values=own)

    twins = tuple((name, other(vehicle)) for name, vehicle in point.twins)
    return time_side.time_side(replace(point, vehicle=other(point.vehicle), twins=twins), plan.names)


def seen(plan, side: time_side.TimeSide) -> set[str]:
    """The responses that the solver check says "outside" of."""
    error = simulation.examine(plan.points[0], plan.setups[0], side).solver_error
    labels = confirmation.series_labels(plan.names, plan.vocabulary)
    outside = (error > setup.tolerance(plan.setups[0])).any(axis=0)
    return {each.split()[0] for each, bad in zip(labels, outside, strict=True) if bad}


def test_without_a_fault_none_is_seen(short):
    assert seen(short, changed_side(short)) == set()


@pytest.mark.parametrize(
    "name",
    [
        "joint",
        "suspensions_primary_4_b",
        "suspensions_secondary_front_k1",
        "suspensions_secondary_rear_b",
        "suspensions_pitch_front_c",
        "wheels_axle_4_k",
        "wheels_axle_2_k",
        "bodies_car_bending_1_frequency",
    ],
)
def test_two_per_cent_on_one_number_is_seen(short, name):
    assert name in short.points[0].vehicle.values, sorted(short.points[0].vehicle.values)
    assert seen(short, changed_side(short, **{name: 1.02}))


def test_a_lag_of_the_wrong_sign_is_seen(short):
    side = time_side.time_side(short.points[0], short.names)
    assert "body_acceleration" in seen(short, replace(side, lags=-side.lags))
    one = np.array([1.0, 1.01, 1.0, 1.0])
    assert "body_acceleration" in seen(short, replace(side, lags=one * side.lags))


def test_a_legs_row_with_a_wrong_sign_is_seen(short):
    point = short.points[0]

    def turned(vehicle):
        legs = tuple(
            replace(leg, row=leg.row | {"bogie_front.pitch": 1.28}) if leg.name == "primary_1" else leg
            for leg in vehicle.system.legs
        )
        assert legs != vehicle.system.legs
        return replace(vehicle, system=replace(vehicle.system, legs=legs))

    wrong = replace(point, vehicle=turned(point.vehicle), twins=tuple((n, turned(v)) for n, v in point.twins))
    assert {"stroke", "body_acceleration"} <= seen(short, time_side.time_side(wrong, short.names))


def test_a_wrong_force_alone_is_seen_of_the_forces_alone(short, monkeypatch):
    true = assembled._force
    monkeypatch.setattr(assembled, "_force", lambda *given: assembled._times(true(*given), 1.001))
    side = time_side.time_side(short.points[0], short.names)
    assert seen(short, side) == {"suspension_force", "contact_force"}


def test_without_the_tracks_rate_the_wheel_on_a_damper_is_seen(short):
    side = time_side.time_side(short.points[0], short.names)
    assert seen(short, replace(side, rates={})) == {"contact_force", "damped"}


# --- what cannot be simulated ----------------------------------------------------------------------

HYSTERETIC = '{ stiffness = "3 MN/m", loss_factor = 0.1 }'


def test_a_law_without_a_differential_equation_is_refused_in_a_line(tmp_path, capsys):
    text = VEHICLE.replace('K = "joint"', f"K = {HYSTERETIC}").replace('[variants.stiff]\njoint = "30 MN/m"\n', "")
    text = text.replace('joint = "3.3 MN/m"\n', "")
    write_result(freqrail.sweep(case_of(text)), tmp_path / "x.nc")
    assert command(["confirm", str(tmp_path / "x.nc")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "suspension primary_1, K, suspension primary_2, K, suspension primary_3, K: no differential" in line
    assert "crosschecks.line_rms" in line


def test_of_a_contact_the_letter_is_told_too():
    text = VEHICLE.replace('contact = "k | c"\nk = "1.2 GN/m"', f'contact = "k | c"\nk = {HYSTERETIC}')
    with pytest.raises(InputError, match="contact of wheel axle_2, k: no differential equation"):
        prepare_run(freqrail.sweep(case_of(text)), **QUICK)


def test_a_variants_rigid_leg_is_refused_with_its_name():
    text = VEHICLE.replace('k = "10.5 kN*m/rad"', 'k = "clamp"').replace('joint = "30 MN/m"', 'clamp = "inf"')
    result = freqrail.sweep(case_of(text.replace("[parameters]", '[parameters]\nclamp = "10.5 kN*m/rad"')))
    with pytest.raises(InputError, match="confirm: stiff: suspension pitch_front: rigid; give a large finite") as told:
        prepare_run(result, **QUICK)
    assert len(told.value.problems) == 1


def test_a_rigid_leg_is_refused_where_it_is_rigid():
    case = case_of(VEHICLE)
    system, values = case.described.system, case.values()
    assert assembled.obstacles(system, values) == {}
    rigid = values | {"suspensions_secondary_rear_k": np.inf}
    assert assembled.obstacles(system, rigid) == {"secondary_rear": assembled.RIGID}
    with pytest.raises(ValueError, match="'secondary_rear' is rigid"):
        assembled.state_space(system, rigid)


def test_equal_poles_are_told_apart_by_rounding_or_refused():
    """Three springs beside dashpots in series, all alike: a double pole, which partial fractions halve at best."""
    parts = tuple(Parallel((Spring("k"), Dashpot("c"))) for _ in range(3))
    law, values = Series(parts), {"k": 4.3e5, "c": 2e4}
    s = 2j * np.pi * np.array([0.5, 5.0, 50.0])
    np.testing.assert_allclose(law.realisation(values).stiffness(s), law.stiffness(values, s), rtol=1e-7)
    nothing = Realisation(1.0, np.nan, 0.0, ((np.inf, 0.05), (-np.inf, 0.05)))
    assert assembled._obstacle(nothing, contact=False) == assembled.EQUAL_POLES


def test_an_output_of_the_tracks_acceleration_is_refused():
    case = case_of(VEHICLE)
    system, values = case.described.system, case.values()
    (taps,) = (output.taps for output in case.described.readings.outputs if output.name == "contact_force")
    model = assembled.state_space(system, values)
    with pytest.raises(ValueError, match="track's acceleration"):
        assembled.readout(system, values, (Output("rate", "N s-1", "", taps[1:2], 1),), model)


# --- what is stored, drawn, and run how ------------------------------------------------------------


def test_the_file_says_what_its_responses_are_and_is_drawn_and_told(found, tmp_path, capsys):
    path = tmp_path / "c.nc"
    write_result(found, path)
    again = read_result(path)
    assert vocabulary_of(again).responses.keys() >= {"stroke", "contact_force", "driver", "floor"}
    assert confirmation.confirmed_names(again) == confirmation.confirmed_names(found)
    assert command(["show", str(path)]) == 0
    told = capsys.readouterr().out
    assert "contact_force axle_2" in told
    assert "all stand" in told
    drawn = confirmations.drawings(again)
    figure = drawn["psd-point-1"]()
    assert any("dynamic wheel-rail force, axle_1" in ax.get_title() for ax in figure.axes)
    assert len(drawn["track-point-1"]().axes[0].lines) == 4
    contact = confirmation.shared(again, 0)["contact_stiffness_N_per_m"]
    assert contact[0] == pytest.approx(1.34785e9)
    assert contact[1] is contact[3] is None


def without_inner_states(joint: str) -> str:
    """The vehicle with springs, dashpots and inerters side by side, but for joints that the variant makes rigid."""
    text = VEHICLE.replace('K = "joint"', f'K = "{joint}"').replace('joint = "30 MN/m"', 'joint = "inf"')
    for old, new in (
        ('k | (q - (c | b))"', 'k | c | b"'),
        ('q = "900 kN/m"\n', ""),
        ('k3 | (k1 - (k2 | c))"', 'k2 | (k1 - c)"'),
        ('k3 = "200 kN/m"\n', ""),
        ('k1 = "500 kN/m"', f'k1 = "{joint}"'),
        ('contact = "k | c"\nk = "1.2 GN/m"\nc = "60 kN*s/m"', 'contact_stiffness = "1.2 GN/m"'),
        ('contact = "H - (m | k | c)"\nH = "0.9 GN/m"\nm = "400 kg"\nk = "60 MN/m"', 'contact = "k"\nk = "1 GN/m"'),
        ('c = "50 kN*s/m"\n', ""),
    ):
        assert old in text, old
        text = text.replace(old, new)
    return text


def test_newmark_serves_the_models_without_inner_states():
    newmark = QUICK | {"integrator": "newmark", "realisations": 1}
    mixed = prepare_run(freqrail.sweep(case_of(without_inner_states("joint"))), **newmark)
    assert mixed.setups[0].rigid == ("stiff",)
    rigid = without_inner_states("inf").replace('[variants.stiff]\njoint = "inf"\n', "")
    run = prepare_run(freqrail.sweep(case_of(rigid.replace('joint = "3.3 MN/m"\n', ""))), **newmark)
    dataset = carry_out(run)
    assert dataset.attrs["integrator"] == "the vehicle: newmark"
    assert confirmation.problems(dataset) == []


def test_lags_are_those_of_the_wheels_places(plan):
    point = plan.points[0]
    places = np.array([9.5 + 1.28, 9.5 - 1.28, -9.5 + 1.28, -9.5 - 1.28])
    np.testing.assert_allclose(simulated.wheel_lags(point.vehicle, 10.0), (places[0] - places) / 10, rtol=1e-14)
