"""Frequency responses of the half vehicle, against equations of motion with the wheels' lags added one by one.

Two ways to the responses: the package's blocks, which it finds by itself, and the chains that tests hold it to
(`tests.chains`), derived by hand. Both see the lags from the vehicle's centre. The references here solve the assembled
half vehicle for each wheel alone, as matrices of dynamic stiffness and in state space, and add the four with
exp(-i omega tau_i) from the first wheel. The two differ by the common factor exp(-i omega (L_c + L_t)/v).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson

from freqrail.model.band import Band
from freqrail.model.equations import state_space, system_response
from freqrail.model.inputs import wheel_lags
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.vehicle import Vehicle, half_vehicle
from freqrail.solver import solve
from freqrail.solver.block_lags import lag_functions
from freqrail.solver.problem import half_vehicle_problem, half_vehicle_reduction
from freqrail.solver.transfer import transfer_functions
from tests.chains import FAMILIES, chain_responses, response_psd, track_response
from tests.helpers import (
    ALL_NAMES,
    MODELS,
    VEHICLES,
    density,
    explicit_responses,
    lagged,
    output_matrices,
    read_off,
)

SPEEDS = (20.0, 250 / 3.6)
every_model = pytest.mark.parametrize("vehicle", MODELS.values(), ids=MODELS.keys())
every_series = pytest.mark.parametrize("name", ALL_NAMES)

OMEGA = 2 * np.pi * np.geomspace(1e-3, 1e3, 601)


def from_blocks(name: str, vehicle: Vehicle, omega: np.ndarray, speed: float) -> np.ndarray:
    """[labels, grid..., n]."""
    found = transfer_functions(half_vehicle_reduction((name,)), vars(vehicle), omega, np.array([speed]))[name]
    return np.stack(np.broadcast_arrays(*(label[..., 0, :] for label in found)))


def from_chains(name: str, vehicle: Vehicle, omega: np.ndarray, speed: float) -> np.ndarray:
    return track_response(FAMILIES[name], vehicle.column(), omega, speed, chain_responses(vehicle.column(), omega))


every_way = pytest.mark.parametrize("responses", [from_blocks, from_chains], ids=["blocks", "chains"])


def seen_from_first_wheel(vehicle: Vehicle, omega: np.ndarray, speed: float) -> np.ndarray:
    return np.exp(-1j * omega * (vehicle.half_bogie_spacing + vehicle.half_wheelbase) / speed)


def lost_digits(vehicle: Vehicle, name: str, omega: np.ndarray) -> np.ndarray:
    """What a reference that subtracts displacements of about a metre per metre cannot resolve."""
    scale = np.max(np.abs(system_response(half_vehicle(vehicle), omega)), axis=(1, 2)) * 1e-12
    arm = 1 + 1 / vehicle.half_wheelbase
    return scale * arm * (1 if name.endswith("stroke") else omega**2)


# --- methods that share no more than the law of a leg -------------------------------------------------


@every_way
@every_model
@every_series
@pytest.mark.parametrize("speed", SPEEDS)
def test_responses_are_those_of_the_equations_of_motion_with_explicit_lags(responses, vehicle, name, speed):
    found = responses(name, vehicle, OMEGA, speed) * seen_from_first_wheel(vehicle, OMEGA, speed)
    expected = explicit_responses(vehicle, OMEGA, speed, (name,))[name]
    assert found.shape == expected.shape == (len(FAMILIES[name].signs), OMEGA.size)
    assert np.all(np.abs(found - expected) <= 1e-9 * np.abs(expected) + lost_digits(vehicle, name, OMEGA))


def state_response(vehicle: Vehicle, omega: np.ndarray) -> np.ndarray:
    """(i omega - A)^-1 B: states per metre of track under each wheel, [n, states, 4]."""
    model = state_space(half_vehicle(vehicle))
    shifted = 1j * omega[:, None, None] * np.eye(model.a.shape[0]) - model.a
    return np.linalg.solve(shifted, np.broadcast_to(model.b.astype(complex), (omega.size, *model.b.shape)))


@every_way
@every_model
@every_series
def test_responses_are_those_of_the_state_space(responses, vehicle, name):
    """Displacements are the last ten states, accelerations i omega times i omega times those."""
    speed, omega = 60.0, OMEGA[::3]
    q = lagged(state_response(vehicle, omega)[:, -10:], vehicle, omega, speed)
    expected = read_off(name, vehicle, q, 1j * omega)
    found = responses(name, vehicle, omega, speed) * seen_from_first_wheel(vehicle, omega, speed)
    assert np.all(np.abs(found - expected) <= 1e-9 * np.abs(expected) + 10 * lost_digits(vehicle, name, omega))


@every_way
@every_model
@every_series
def test_accelerations_are_forces_over_masses(responses, vehicle, name):
    """The same as an output of the state equations, y = C x + D v, which differentiates nothing."""
    speed, omega = 60.0, OMEGA[OMEGA > 1]
    c, d = (matrices[name] for matrices in output_matrices(vehicle))
    expected = lagged(c @ state_response(vehicle, omega) + d, vehicle, omega, speed)
    found = responses(name, vehicle, omega, speed) * seen_from_first_wheel(vehicle, omega, speed)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-13 * np.max(np.abs(expected)))


@every_way
@every_series
def test_a_grid_of_vehicles_is_answered_vehicle_by_vehicle(responses, name, paper_vehicle):
    stiffness = np.array([0.5e6, 5e6, np.inf])
    damping = np.array([10e3, 20e3])
    omega, speed = OMEGA[::10], 70.0
    many = replace(paper_vehicle, primary_joint_stiffness=stiffness[:, None], secondary_damping=damping)
    found = np.broadcast_to(responses(name, many, omega, speed), (len(FAMILIES[name].signs), 3, 2, omega.size))
    for i, k in enumerate(stiffness):
        for j, c in enumerate(damping):
            one = replace(paper_vehicle, primary_joint_stiffness=k, secondary_damping=c)
            np.testing.assert_allclose(found[:, i, j], responses(name, one, omega, speed), rtol=1e-13)


# --- what the four wheels see ------------------------------------------------------------------------


def test_wheel_lags_of_equation_2():
    vehicle = replace(VEHICLES[0], half_bogie_spacing=8.75, half_wheelbase=1.25)
    np.testing.assert_allclose(wheel_lags(vehicle, 50.0), [0.0, 0.05, 0.35, 0.4], rtol=1e-15)


def test_lags_stay_when_geometry_and_speed_grow_together():
    vehicle = VEHICLES[0]
    larger = replace(
        vehicle, half_bogie_spacing=2 * vehicle.half_bogie_spacing, half_wheelbase=2 * vehicle.half_wheelbase
    )
    speed = np.array([20.0, 60.0])
    reduction, delay = half_vehicle_reduction(ALL_NAMES), OMEGA[:, None] / speed
    before, after = (
        lag_functions(reduction, reduction.places(vars(v)), d) for v, d in ((vehicle, delay), (larger, delay / 2))
    )
    assert np.array_equal(before, after)
    assert np.array_equal(wheel_lags(larger, 2 * speed[0]), wheel_lags(vehicle, speed[0]))


@every_way
@every_model
@every_series
def test_running_backwards_exchanges_front_and_rear(responses, vehicle, name):
    """With the lags negated the last axle leads: what the front did, the rear now does; nose up becomes nose down."""
    series = FAMILIES[name]
    forwards, backwards = (responses(name, vehicle, OMEGA, v) for v in (60.0, -60.0))
    mirrored = {(1, 0): (-1, 0), (-1, 0): (1, 0), (0, 0): (0, 0)}
    mirrored |= {(1, 1): (-1, -1), (1, -1): (-1, 1), (-1, 1): (1, -1), (-1, -1): (1, 1)}
    for place, position in enumerate(series.signs):
        if series.arm == "half_bogie_spacing":
            other, sign = place, -1  # the only position
        elif series.arm == "half_wheelbase":
            other, sign = 1 - place, -1
        else:
            other, sign = series.signs.index(mirrored[position]), 1
        tolerance = 1e-12 * np.max(np.abs(forwards))
        assert np.max(np.abs(backwards[place] - sign * forwards[other])) <= tolerance


@every_way
@pytest.mark.parametrize("name", [name for name in ALL_NAMES if "pitch" not in name])
def test_front_and_rear_do_differ(responses, name):
    """Otherwise the mirror above would show nothing: the lags set front and rear apart."""
    response = np.abs(responses(name, VEHICLES[0], OMEGA, 60.0))
    front, rear = response[0], response[-1]
    assert np.max(np.abs(front - rear) / (front + rear)) > 1e-4


@every_way
def test_the_car_bodys_centre_does_not_know_its_pitch_inertia(responses):
    vehicle = VEHICLES[0]
    heavier = replace(vehicle, car_body_pitch_inertia=3 * vehicle.car_body_pitch_inertia)
    light, heavy = (responses("car_body_acceleration", v, OMEGA, 60.0) for v in (vehicle, heavier))
    centre = FAMILIES["car_body_acceleration"].signs.index((0, 0))
    assert np.array_equal(light[centre], heavy[centre])
    assert np.max(np.abs(light[0] - heavy[0])) > 1e-2 * np.max(np.abs(light))


@every_way
def test_bogie_pitch_does_not_know_the_car(responses):
    vehicle = VEHICLES[0]
    other = replace(
        vehicle, car_body_mass=3 * vehicle.car_body_mass, secondary_stiffness=2 * vehicle.secondary_stiffness
    )
    name = "bogie_pitch_acceleration"
    assert np.array_equal(responses(name, vehicle, OMEGA, 60.0), responses(name, other, OMEGA, 60.0))


# --- limits ------------------------------------------------------------------------------------------


@every_way
@every_model
@pytest.mark.parametrize("name", ["car_body_acceleration", "bogie_acceleration", "wheelset_acceleration"])
def test_on_long_waves_everything_follows_the_track(responses, vehicle, name):
    omega = np.array([1e-5])
    displacement = responses(name, vehicle, omega, 60.0) / -(omega**2)
    np.testing.assert_allclose(displacement, 1.0, atol=1e-4)


@every_way
@every_model
@pytest.mark.parametrize("name", ["car_body_pitch_acceleration", "bogie_pitch_acceleration"])
def test_on_long_waves_bodies_lie_along_the_slope_of_the_track(responses, vehicle, name):
    """Nose down is positive: beta = -dz/dx, and z(x + v t) makes dz/dx = i omega z / v."""
    omega, speed = np.array([1e-5]), 60.0
    angle = responses(name, vehicle, omega, speed) / -(omega**2)
    np.testing.assert_allclose(angle, -1j * omega[0] / speed, rtol=1e-4)


@every_way
@every_model
def test_strokes_vanish_with_the_square_of_the_frequency(responses, vehicle):
    """On long waves a leg carries the inertia of what stands on it: e = omega^2 (mass above) / k.

    Divided by omega^2 the stroke tends to the static value linearly in omega (damper and lags), over six decades:
    a stroke formed as a difference of displacements would be noise below 1e-3 Hz.
    """
    above = {
        "secondary_stroke": vehicle.car_body_mass / 2 / vehicle.secondary_stiffness,
        "primary_stroke": (vehicle.car_body_mass / 4 + vehicle.bogie_mass / 2) / vehicle.primary_stiffness,
    }
    omega = np.geomspace(1e-7, 1e-2, 6)
    for name, static in above.items():
        away = np.max(np.abs(responses(name, vehicle, omega, 60.0) / omega**2 / static - 1), axis=0)
        assert away[0] < 1e-6
        np.testing.assert_allclose(away[1:] / away[:-1], 10, rtol=0.02)


@every_way
@every_model
def test_far_above_all_resonances_the_wheelset_is_a_mass_on_the_contact_spring(responses, vehicle):
    """Each wheelset alone: z_w'' -> K_H v / M_w, and |T| the same at every axle."""
    omega = np.array([2 * np.pi * 5e5])
    expected = vehicle.contact_stiffness / vehicle.wheelset_mass
    response = np.abs(responses("wheelset_acceleration", vehicle, omega, 60.0))
    np.testing.assert_allclose(response, expected, rtol=1e-3)


# --- spectra -----------------------------------------------------------------------------------------


def psd(vehicle: Vehicle, spectrum: RationalSpectrum, frequency: np.ndarray, speed: float) -> dict[str, np.ndarray]:
    """{name: [labels, n]}."""
    found = solve.psd(half_vehicle_problem(vehicle, np.array([speed]), spectrum, None, ALL_NAMES), frequency)
    return {name: each[:, 0] for name, each in found.items()}


def test_psd_is_the_square_of_the_response_times_the_track_per_hz(german_low):
    vehicle, speed = VEHICLES[3], 60.0
    frequency = np.geomspace(0.1, 100, 50)
    omega = 2 * np.pi * frequency
    found = psd(vehicle, german_low, frequency, speed)
    for name, response in explicit_responses(vehicle, omega, speed).items():
        expected = np.abs(response) ** 2 * 2 * np.pi * density(german_low, omega, speed)
        assert np.all(found[name] >= 0)
        np.testing.assert_allclose(found[name], expected, rtol=1e-7)


@pytest.mark.parametrize("model", ["joints", "traditional"])
def test_psd_adds_up_to_the_rms(model, paper_vehicle, german_low):
    """The area below the PSD of a fine grid of frequencies is the mean square that the quadrature gives."""
    vehicle = paper_vehicle if model == "joints" else paper_vehicle.traditional()
    speed, low, high = 250 / 3.6, 0.3, 60.0
    frequency = np.linspace(low, high, 60_001)
    study = half_vehicle_problem(vehicle, np.array([speed]), german_low, Band("frequency", low, high), ALL_NAMES)
    solution = solve.solve(study)
    for name, each in psd(vehicle, german_low, frequency, speed).items():
        area = simpson(each, x=frequency, axis=-1)
        np.testing.assert_allclose(np.sqrt(area), solution.rms[name][:, 0], rtol=1e-8)


def test_psds_of_a_grid_are_those_of_its_vehicles_and_speeds(paper_vehicle, german_low):
    stiffness, speeds = np.array([0.5e6, 50e6]), np.array([30.0, 60.0, 80.0])
    frequency = np.geomspace(0.1, 100, 20)
    many = replace(paper_vehicle, primary_joint_stiffness=stiffness)
    found = solve.psd(half_vehicle_problem(many, speeds, german_low, None, ALL_NAMES), frequency)
    for name in ALL_NAMES:
        assert found[name].shape == (len(FAMILIES[name].signs), 2, 3, 20)
        for i, k in enumerate(stiffness):
            for j, speed in enumerate(speeds):
                one = replace(paper_vehicle, primary_joint_stiffness=k)
                expected = response_psd(FAMILIES[name], one, german_low, frequency, speed)
                np.testing.assert_allclose(found[name][:, i, j], expected, rtol=1e-12)
