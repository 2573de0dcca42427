"""The vehicle on a rail that gives way, beside the package's own numbers and a second solution by chains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.spectrum import frequency_psd
from freqrail.replication.mechanism import on_rail
from freqrail.replication.yielding_rail import TYPICAL, Rail, displacements, poles, response_rms, wheel_resonance
from freqrail.solver import solve
from freqrail.solver.modes import modes
from freqrail.solver.problem import half_vehicle_problem

NAMES = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke")
PLACE = {"car_body_acceleration": 1}


def package_rms(case, vehicle) -> dict[str, float]:
    rms = solve.solve(half_vehicle_problem(vehicle, np.array([case.speed]), case.spectrum, case.band, NAMES)).rms
    return {name: float(rms[name][PLACE.get(name, 0), 0]) for name in NAMES}


def chain_bogie(vehicle, frequency: np.ndarray, speed: float, rail: Rail) -> np.ndarray:
    """z_t1 per metre under the first wheel by the chains of bounce and pitch, the rail's give in series below."""
    s = 2j * np.pi * frequency
    below = 1 / (1 / vehicle.contact_stiffness + 1 / (rail.mass * s**2 + rail.damping * s + rail.stiffness))
    # from the wheel down, the irregularity sits between wheel and rail: contact and rail are two springs in series
    secondary, primary = (
        k + 1 / (1 / (c * s) + 2 / joint)
        for k, c, joint in (
            (vehicle.secondary_stiffness, vehicle.secondary_damping, vehicle.secondary_joint_stiffness),
            (vehicle.primary_stiffness, vehicle.primary_damping, vehicle.primary_joint_stiffness),
        )
    )
    bogies = {}
    for chain, car in (
        ("bounce", vehicle.car_body_mass / 4),
        ("pitch", vehicle.car_body_pitch_inertia / 4 / vehicle.half_bogie_spacing**2),
    ):
        force = -car * s**2  # below a car body of displacement one
        bogie = 1 - force / (secondary / 2)
        force = force - vehicle.bogie_mass / 2 * s**2 * bogie
        wheel = bogie - force / primary
        force = force - vehicle.wheelset_mass * s**2 * wheel
        bogies[chain] = bogie / (wheel - force / below)
    a, b = (
        np.pi * frequency * 2 * vehicle.half_wheelbase / speed,
        np.pi * frequency * 2 * vehicle.half_bogie_spacing / speed,
    )
    middle = np.cos(a) * (np.cos(b) * bogies["bounce"] + 1j * np.sin(b) * bogies["pitch"])
    return middle * np.exp(-1j * (a + b))  # lags are counted from the first wheel


def test_on_a_rigid_rail_the_dense_solution_gives_the_packages_numbers(paper_case):
    for vehicle in (paper_case.vehicle, paper_case.vehicle.traditional()):
        expected = package_rms(paper_case, vehicle)
        for rail in (None, Rail(150.0, 1e17, 0.0)):
            found = response_rms(
                vehicle,
                lambda f: frequency_psd(paper_case.spectrum, f, paper_case.speed),
                paper_case.speed,
                (0.1, 100.0),
                rail,
            )
            for name in NAMES:
                assert found[name] == pytest.approx(expected[name], rel=1e-8), (name, rail)


@pytest.mark.parametrize("rigid", [False, True])
def test_on_a_yielding_rail_it_agrees_with_chains_whose_contact_is_in_series_with_the_rail(paper_case, rigid):
    vehicle = paper_case.vehicle.traditional() if rigid else paper_case.vehicle
    frequency = np.geomspace(0.1, 300, 200)
    dense = displacements(vehicle, frequency, paper_case.speed, TYPICAL)[:, 2]
    np.testing.assert_allclose(dense, chain_bogie(vehicle, frequency, paper_case.speed, TYPICAL), rtol=1e-8, atol=1e-12)


def test_a_yielding_rail_changes_the_bogie_frame_and_hardly_the_rest(paper_case):
    """The numbers of docs/theory.md, 0.1 to 100 Hz at 250 km/h."""
    rigid, yielding = on_rail(paper_case, None), on_rail(paper_case, TYPICAL)
    bogie, car = NAMES[1], NAMES[0]
    assert rigid.joint[bogie] == pytest.approx(1.454, abs=5e-4)
    assert yielding.joint[bogie] == pytest.approx(2.039, abs=5e-4)
    assert rigid.departure(bogie) == pytest.approx(0.29, abs=5e-3)
    assert yielding.departure(bogie) == pytest.approx(0.134, abs=1e-3)
    assert (rigid.joint[car], yielding.joint[car]) == (pytest.approx(0.1976, abs=5e-5), pytest.approx(0.1986, abs=5e-5))
    assert (rigid.departure(car), yielding.departure(car)) == (
        pytest.approx(0.116, abs=1e-3),
        pytest.approx(0.105, abs=1e-3),
    )
    for name in NAMES:
        if name != bogie:
            assert abs(yielding.joint[name] / rigid.joint[name] - 1) < 0.02


def test_the_wheelsets_resonance_moves_from_195_to_49_hz(paper_vehicle):
    frequency, damping = wheel_resonance(paper_vehicle, TYPICAL)
    assert frequency == pytest.approx(48.7, abs=0.05)
    assert damping == pytest.approx(0.112, abs=1e-3)
    # by hand: wheel and rail move together on the rail's spring, between the bogie above and the ground
    together = np.sqrt(TYPICAL.stiffness / (paper_vehicle.wheelset_mass + TYPICAL.mass)) / (2 * np.pi)
    assert frequency == pytest.approx(together, rel=0.03)


def test_the_poles_are_those_of_the_dense_equations_and_on_a_stiff_rail_the_vehicles_own(paper_vehicle):
    for pole in poles(paper_vehicle, TYPICAL):
        # at a pole the dynamic stiffness is singular: responses grow without bound beside it
        if pole.imag > 0:
            near, far = (
                np.abs(displacements(paper_vehicle, np.array([(pole / 2j / np.pi) * (1 + d)]), 70.0, TYPICAL)).max()
                for d in (1e-9, 1e-4)
            )
            assert near > 1e3 * far
    stiff = poles(paper_vehicle, Rail(1.0, 1e14, 1.0))
    for mode in modes(paper_vehicle):
        assert np.abs(stiff - mode.pole).min() < 1e-4 * abs(mode.pole)


def test_a_softer_rail_lowers_the_resonance(paper_vehicle):
    softer = replace(TYPICAL, stiffness=TYPICAL.stiffness / 4)
    assert wheel_resonance(paper_vehicle, softer)[0] < 0.6 * wheel_resonance(paper_vehicle, TYPICAL)[0]
