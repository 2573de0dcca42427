"""Frequency responses of the decoupled chains, against equations of motion with the wheels' lags added one by one.

The package reads responses off three chains, with the lags seen from the vehicle's centre. The references
here solve the assembled half vehicle for each wheel alone, as matrices of dynamic stiffness and in state
space, and add the four with exp(-i omega tau_i) from the first wheel. The two differ by the common factor
exp(-i omega (L_c + L_t)/v).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import simpson

from freqrail.model.band import Band
from freqrail.model.equations import leg_dynamic_stiffness, state_space, system_response
from freqrail.model.inputs import wheel_lags
from freqrail.model.responses import CHAINS, RESPONSES
from freqrail.model.vehicle import Vehicle, half_vehicle
from freqrail.solver import solve
from freqrail.solver.problem import half_vehicle_problem
from tests.chains import (
    LAG_COLUMNS,
    chain_response,
    chain_responses,
    chain_system,
    column_powers,
    column_signs,
    lag_columns,
    response_psd,
    top_products,
    track_response,
)
from tests.helpers import (
    ALL_NAMES,
    INDEX,
    density,
    explicit_responses,
    lagged,
    output_matrices,
    random_vehicles,
    read_off,
)

SPEEDS = (20.0, 250 / 3.6)
VEHICLES = random_vehicles(4, seed=11)
MODELS = {
    **{f"random {k}": vehicle for k, vehicle in enumerate(VEHICLES)},
    "traditional": VEHICLES[0].traditional(),
    "primary rigid": replace(VEHICLES[1], primary_joint_stiffness=np.inf),
    "secondary undamped": replace(VEHICLES[2], secondary_damping=0.0),
}
every_model = pytest.mark.parametrize("vehicle", MODELS.values(), ids=MODELS.keys())
every_series = pytest.mark.parametrize("name", ALL_NAMES)

OMEGA = 2 * np.pi * np.geomspace(1e-3, 1e3, 601)
EPSILON = np.finfo(float).eps


def from_chains(name: str, vehicle: Vehicle, omega: np.ndarray, speed: float) -> np.ndarray:
    return track_response(RESPONSES[name], vehicle, omega, speed, chain_responses(vehicle, omega))


def seen_from_first_wheel(vehicle: Vehicle, omega: np.ndarray, speed: float) -> np.ndarray:
    return np.exp(-1j * omega * (vehicle.half_bogie_spacing + vehicle.half_wheelbase) / speed)


def lost_digits(vehicle: Vehicle, name: str, omega: np.ndarray) -> np.ndarray:
    """What a reference that subtracts displacements of about a metre per metre cannot resolve."""
    scale = np.max(np.abs(system_response(half_vehicle(vehicle), omega)), axis=(1, 2)) * 1e-12
    arm = 1 + 1 / vehicle.half_wheelbase
    return scale * arm * (1 if name.endswith("stroke") else omega**2)


# --- two methods that share no more than the law of a leg ---------------------------------------------


@every_model
@every_series
@pytest.mark.parametrize("speed", SPEEDS)
def test_chains_equal_the_equations_of_motion_with_explicit_lags(vehicle, name, speed):
    found = from_chains(name, vehicle, OMEGA, speed) * seen_from_first_wheel(vehicle, OMEGA, speed)
    expected = explicit_responses(vehicle, OMEGA, speed, (name,))[name]
    assert found.shape == expected.shape == (len(RESPONSES[name].signs), OMEGA.size)
    assert np.all(np.abs(found - expected) <= 1e-9 * np.abs(expected) + lost_digits(vehicle, name, OMEGA))


def state_response(vehicle: Vehicle, omega: np.ndarray) -> np.ndarray:
    """(i omega - A)^-1 B: states per metre of track under each wheel, [n, states, 4]."""
    model = state_space(half_vehicle(vehicle))
    shifted = 1j * omega[:, None, None] * np.eye(model.a.shape[0]) - model.a
    return np.linalg.solve(shifted, np.broadcast_to(model.b.astype(complex), (omega.size, *model.b.shape)))


@every_model
@every_series
def test_chains_equal_the_state_space(vehicle, name):
    """Displacements are the last ten states, accelerations i omega times i omega times those."""
    speed, omega = 60.0, OMEGA[::3]
    q = lagged(state_response(vehicle, omega)[:, -10:], vehicle, omega, speed)
    expected = read_off(name, vehicle, q, 1j * omega)
    found = from_chains(name, vehicle, omega, speed) * seen_from_first_wheel(vehicle, omega, speed)
    assert np.all(np.abs(found - expected) <= 1e-9 * np.abs(expected) + 10 * lost_digits(vehicle, name, omega))


@every_model
@every_series
def test_accelerations_are_forces_over_masses(vehicle, name):
    """The same as an output of the state equations, y = C x + D v, which differentiates nothing."""
    speed, omega = 60.0, OMEGA[OMEGA > 1]
    c, d = (matrices[name] for matrices in output_matrices(vehicle))
    expected = lagged(c @ state_response(vehicle, omega) + d, vehicle, omega, speed)
    found = from_chains(name, vehicle, omega, speed) * seen_from_first_wheel(vehicle, omega, speed)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-13 * np.max(np.abs(expected)))


@every_model
@pytest.mark.parametrize("chain", CHAINS)
def test_a_chain_is_the_response_of_its_own_equations(vehicle, chain):
    response = chain_response(vehicle, chain, OMEGA)
    q = system_response(chain_system(vehicle, chain), OMEGA)[:, :, 0]
    bodies = ("car", "bogie", "wheelset")[-q.shape[1] :]
    for body, expected in zip(bodies, q.T, strict=True):
        np.testing.assert_allclose(response.top * response.ratios[body], expected, rtol=1e-8)


@every_series
def test_a_grid_of_vehicles_is_answered_vehicle_by_vehicle(name, paper_vehicle):
    stiffness = np.array([0.5e6, 5e6, np.inf])
    damping = np.array([10e3, 20e3])
    omega, speed = OMEGA[::10], 70.0
    many = replace(
        paper_vehicle,
        primary_joint_stiffness=stiffness[:, None, None],
        secondary_damping=damping[None, :, None],
    )
    found = np.broadcast_to(from_chains(name, many, omega, speed), (len(RESPONSES[name].signs), 3, 2, omega.size))
    for i, k in enumerate(stiffness):
        for j, c in enumerate(damping):
            one = replace(paper_vehicle, primary_joint_stiffness=k, secondary_damping=c)
            np.testing.assert_allclose(found[:, i, j], from_chains(name, one, omega, speed), rtol=1e-13)


@every_series
@settings(deadline=None, max_examples=15)
@given(
    seed=st.integers(0, 10**6),
    speed=st.floats(3.0, 160.0),
)
@example(seed=1591, speed=90.171875)  # at 177 rad/s half the wheelbase is a quarter of the wave but for 8e-5
def test_columns_times_powers_are_the_square_of_the_sum(name, seed, speed):
    """|T|^2 as seven real columns of the lags times powers of the vehicle, none of which knows of the other."""
    (vehicle,) = random_vehicles(1, seed)
    omega = OMEGA[::5]
    series, chains = RESPONSES[name], chain_responses(vehicle, omega)
    columns = lag_columns(vehicle, omega, np.array([speed]))
    assert columns.shape == (LAG_COLUMNS, omega.size, 1)
    square = np.abs(track_response(series, vehicle, omega, speed, chains)) ** 2
    for place, position in enumerate(series.signs):
        signs = column_signs(position)
        powers = list(column_powers(series, vehicle, omega, chains, top_products(chains)))
        terms = np.array([signs[column] * power * columns[column, :, 0] for column, power in powers])
        # where a cosine vanishes, what is left of it is the rounding of its angle
        loss = 1e-12 * np.sum(np.abs(terms), axis=0) + 8 * EPSILON * np.sum(np.abs([p for _, p in powers]), axis=0)
        assert np.all(np.abs(np.sum(terms, axis=0) - square[place]) <= loss)


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
    assert np.array_equal(lag_columns(larger, OMEGA, 2 * speed), lag_columns(vehicle, OMEGA, speed))
    assert np.array_equal(wheel_lags(larger, 2 * speed[0]), wheel_lags(vehicle, speed[0]))


@every_model
@every_series
def test_running_backwards_exchanges_front_and_rear(vehicle, name):
    """With the lags negated the last axle leads: what the front did, the rear now does; nose up becomes nose down."""
    series = RESPONSES[name]
    forwards, backwards = (from_chains(name, vehicle, OMEGA, v) for v in (60.0, -60.0))
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


@pytest.mark.parametrize("name", [name for name in ALL_NAMES if "pitch" not in name])
def test_front_and_rear_do_differ(name):
    """Otherwise the mirror above would show nothing: the lags set front and rear apart."""
    response = np.abs(from_chains(name, VEHICLES[0], OMEGA, 60.0))
    front, rear = response[0], response[-1]
    assert np.max(np.abs(front - rear) / (front + rear)) > 1e-4


def test_the_car_bodys_centre_does_not_know_its_pitch_inertia():
    vehicle = VEHICLES[0]
    heavier = replace(vehicle, car_body_pitch_inertia=3 * vehicle.car_body_pitch_inertia)
    light, heavy = (from_chains("car_body_acceleration", v, OMEGA, 60.0) for v in (vehicle, heavier))
    centre = RESPONSES["car_body_acceleration"].signs.index((0, 0))
    assert np.array_equal(light[centre], heavy[centre])
    assert np.max(np.abs(light[0] - heavy[0])) > 1e-2 * np.max(np.abs(light))


def test_bogie_pitch_does_not_know_the_car():
    vehicle = VEHICLES[0]
    other = replace(
        vehicle, car_body_mass=3 * vehicle.car_body_mass, secondary_stiffness=2 * vehicle.secondary_stiffness
    )
    name = "bogie_pitch_acceleration"
    assert np.array_equal(from_chains(name, vehicle, OMEGA, 60.0), from_chains(name, other, OMEGA, 60.0))


# --- limits ------------------------------------------------------------------------------------------


@every_model
@pytest.mark.parametrize("name", ["car_body_acceleration", "bogie_acceleration", "wheelset_acceleration"])
def test_on_long_waves_everything_follows_the_track(vehicle, name):
    omega = np.array([1e-5])
    displacement = from_chains(name, vehicle, omega, 60.0) / -(omega**2)
    np.testing.assert_allclose(displacement, 1.0, atol=1e-4)


@every_model
@pytest.mark.parametrize("name", ["car_body_pitch_acceleration", "bogie_pitch_acceleration"])
def test_on_long_waves_bodies_lie_along_the_slope_of_the_track(vehicle, name):
    """Nose down is positive: beta = -dz/dx, and z(x + v t) makes dz/dx = i omega z / v."""
    omega, speed = np.array([1e-5]), 60.0
    angle = from_chains(name, vehicle, omega, speed) / -(omega**2)
    np.testing.assert_allclose(angle, -1j * omega[0] / speed, rtol=1e-4)


@every_model
def test_strokes_vanish_with_the_square_of_the_frequency(vehicle):
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
        away = np.max(np.abs(from_chains(name, vehicle, omega, 60.0) / omega**2 / static - 1), axis=0)
        assert away[0] < 1e-6
        np.testing.assert_allclose(away[1:] / away[:-1], 10, rtol=0.02)


@every_model
def test_far_above_all_resonances_the_wheelset_is_a_mass_on_the_contact_spring(vehicle):
    """Each wheelset alone: z_w'' -> K_H v / M_w, and |T| the same at every axle."""
    omega = np.array([2 * np.pi * 5e5])
    expected = vehicle.contact_stiffness / vehicle.wheelset_mass
    response = np.abs(from_chains("wheelset_acceleration", vehicle, omega, 60.0))
    np.testing.assert_allclose(response, expected, rtol=1e-3)


# --- physics of the assembled system -----------------------------------------------------------------


@every_model
def test_a_legs_dynamic_stiffness_never_returns_more_energy_than_it_took(vehicle):
    """Im D(i omega) >= 0 for omega > 0, at most that of the damper on rigid ends."""
    for leg in half_vehicle(vehicle).legs:
        loss = leg_dynamic_stiffness(leg.stiffness, leg.damping, leg.joint_stiffness, 1j * OMEGA).imag
        assert np.all(loss >= 0)
        assert np.all(loss <= leg.damping * OMEGA * (1 + 1e-12))
        assert np.any(loss > 0) == (leg.damping > 0)


@every_model
def test_what_the_rail_puts_in_the_dampers_take_out(vehicle):
    """Mean power at the contacts, Re(F conj(i omega v))/2, equals omega Im D |e|^2 / 2 summed over the legs; both >= 0.

    For any heights of the four wheels, not only for a track that passes under them one after the other.
    """
    omega = OMEGA[(OMEGA > 2) & (OMEGA < 2000)]
    system = half_vehicle(vehicle)
    rng = np.random.default_rng(5)
    heights = rng.normal(size=(omega.size, 4)) + 1j * rng.normal(size=(omega.size, 4))
    q = np.einsum("nfw,nw->nf", system_response(system, omega), heights)
    wheels = [wheel for wheel, _ in system.contacts]
    force = vehicle.contact_stiffness * (heights - q[:, wheels])
    put_in = 0.5 * np.sum(np.real(force * np.conj(1j * omega[:, None] * heights)), axis=1)
    taken_out = np.zeros(omega.size)
    for leg in system.legs:
        loss = leg_dynamic_stiffness(leg.stiffness, leg.damping, leg.joint_stiffness, 1j * omega).imag
        taken_out += 0.5 * omega * loss * np.abs(q @ np.array(leg.elongation)) ** 2
    apparent = 0.5 * np.sum(np.abs(force) * omega[:, None] * np.abs(heights), axis=1)
    assert np.all(taken_out > 0)
    rounding = 1e-12 * vehicle.contact_stiffness * omega * np.sum(np.abs(heights) * np.abs(q[:, wheels]), axis=1)
    assert np.all(np.abs(put_in - taken_out) <= 1e-9 * apparent + rounding)


@every_model
def test_point_to_point_responses_are_reciprocal(vehicle):
    """A force on body a moves body b as a force on b moves a: stand extra springs on bodies, and lift their feet."""
    system = half_vehicle(vehicle)
    feet = [(INDEX["z_c"], 2e5), (INDEX["beta_t1"], 3e5), (INDEX["z_t2"], 5e5), (INDEX["beta_c"], 7e5)]
    stood = replace(system, contacts=(*system.contacts, *feet))
    places = [place for place, _ in stood.contacts]
    springs = np.array([spring for _, spring in stood.contacts])
    omega = 2 * np.pi * np.geomspace(0.1, 400, 80)
    receptance = system_response(stood, omega)[:, places, :] / springs
    scale = np.max(np.abs(receptance), axis=(1, 2))[:, None, None]
    assert np.max(np.abs(receptance - np.swapaxes(receptance, 1, 2)) / scale) < 1e-9
    off_diagonal = receptance - receptance * np.eye(len(springs))
    assert np.all(np.max(np.abs(off_diagonal), axis=(1, 2)) > 0)


# --- spectra -----------------------------------------------------------------------------------------


@every_series
def test_psd_is_the_square_of_the_response_times_the_track_per_hz(name, german_low):
    vehicle, speed = VEHICLES[3], 60.0
    frequency = np.geomspace(0.1, 100, 50)
    omega = 2 * np.pi * frequency
    expected = np.abs(explicit_responses(vehicle, omega, speed, (name,))[name]) ** 2
    expected = expected * 2 * np.pi * density(german_low, omega, speed)
    found = response_psd(RESPONSES[name], vehicle, german_low, frequency, speed)
    assert np.all(found >= 0)
    np.testing.assert_allclose(found, expected, rtol=1e-7)


@pytest.mark.parametrize("model", ["joints", "traditional"])
def test_psd_adds_up_to_the_rms(model, paper_vehicle, german_low):
    """The area below the PSD of a fine grid of frequencies is the mean square that the quadrature gives."""
    vehicle = paper_vehicle if model == "joints" else paper_vehicle.traditional()
    speed, low, high = 250 / 3.6, 0.3, 60.0
    frequency = np.linspace(low, high, 60_001)
    study = half_vehicle_problem(vehicle, np.array([speed]), german_low, Band("frequency", low, high), ALL_NAMES)
    solution = solve.solve(study)
    for name in ALL_NAMES:
        psd = response_psd(RESPONSES[name], vehicle, german_low, frequency, speed)
        area = simpson(psd, x=frequency, axis=-1)
        np.testing.assert_allclose(np.sqrt(area), solution.rms[name][:, 0], rtol=1e-8)


def test_psds_of_a_grid_are_those_of_its_vehicles_and_speeds(paper_vehicle, german_low):
    stiffness, speeds = np.array([0.5e6, 50e6]), np.array([30.0, 60.0, 80.0])
    frequency = np.geomspace(0.1, 100, 20)
    many = replace(paper_vehicle, primary_joint_stiffness=stiffness)
    found = solve.psd(half_vehicle_problem(many, speeds, german_low, None, ALL_NAMES), frequency)
    for name in ALL_NAMES:
        assert found[name].shape == (len(RESPONSES[name].signs), 2, 3, 20)
        for i, k in enumerate(stiffness):
            for j, speed in enumerate(speeds):
                one = replace(paper_vehicle, primary_joint_stiffness=k)
                expected = response_psd(RESPONSES[name], one, german_low, frequency, speed)
                np.testing.assert_allclose(found[name][:, i, j], expected, rtol=1e-12)


@pytest.mark.parametrize("chain", CHAINS)
def test_ratios_are_per_unit_displacement_of_the_top_body(chain, paper_vehicle):
    response = chain_response(paper_vehicle, chain, OMEGA)
    assert np.all(response.ratios["bogie" if chain == "bogie_pitch" else "car"] == 1)
