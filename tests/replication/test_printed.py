"""Eq. (4) as printed: two damper forces with the wrong sign, and what that does to symmetry and stability."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.confirm.time_side import readout
from freqrail.model.equations import state_space
from freqrail.model.responses import PAPER
from freqrail.model.vehicle import half_vehicle
from freqrail.replication import printed
from freqrail.solver import solve
from freqrail.solver.problem import half_vehicle_problem


def test_two_damper_forces_and_nothing_else_change_sign(paper_vehicle):
    # written out: M_t z_t1'' and M_t z_t2'' of eq. (4), with eq. (8) for the dampers' ends
    right, wrong = state_space(half_vehicle(paper_vehicle)), printed.printed_state_space(paper_vehicle)
    vehicle = paper_vehicle
    rng = np.random.default_rng(1)
    x = rng.standard_normal(len(right.states))
    value = dict(zip(right.states, x, strict=True))
    e_s1 = value["z_c"] - vehicle.half_bogie_spacing * value["beta_c"] - value["z_t1"]
    e_p4 = value["z_t2"] + vehicle.half_wheelbase * value["beta_t2"] - value["z_w4"]
    force_s1 = vehicle.secondary_joint_stiffness / 2 * (e_s1 - value["Delta_secondary_1"])
    force_p4 = vehicle.primary_joint_stiffness / 2 * (e_p4 - value["Delta_primary_4"])
    change = (wrong.a - right.a) @ x
    expected = np.zeros_like(x)
    expected[right.states.index("dz_t1/dt")] = -2 * force_s1 / vehicle.bogie_mass
    expected[right.states.index("dz_t2/dt")] = +2 * force_p4 / vehicle.bogie_mass
    np.testing.assert_allclose(change, expected, atol=1e-9 * np.abs(expected).max())
    assert np.array_equal(right.b, wrong.b)


def test_the_printed_stiffness_matrix_is_not_symmetric(paper_vehicle):
    assert printed.asymmetry(paper_vehicle) > 0.01


def test_stiff_secondary_joints_make_the_printed_equations_unstable(paper_vehicle):
    assert printed.growth_rate(paper_vehicle) < 0
    stiff = replace(paper_vehicle, secondary_joint_stiffness=10e6)
    assert printed.growth_rate(stiff) > 1
    assert state_space(half_vehicle(stiff)).a.shape == (26, 26)


def test_the_front_sign_alone_makes_them_unstable_and_the_rear_one_alone_does_not(paper_case):
    """Each sign by itself is a change of its own; the two together are the print."""
    growth = {name: [] for name in printed.READINGS}
    vehicles = paper_case.vehicles()
    for index in np.ndindex(vehicles.shape):
        for name, signs in printed.READINGS.items():
            growth[name].append(printed.growth_rate(vehicles.at(index), signs))
    both, front, rear = (np.array(values) for values in growth.values())
    assert np.array_equal(both > 0, front > 0)
    assert 0 < np.count_nonzero(front > 0) < front.size
    assert np.all(rear < 0)
    vehicle = paper_case.vehicle
    right = state_space(half_vehicle(vehicle)).a
    changes = [printed.printed_state_space(vehicle, signs).a - right for signs in printed.READINGS.values()]
    np.testing.assert_allclose(changes[0], changes[1] + changes[2])


def test_unstable_equations_have_no_rms(paper_vehicle, paper_case):
    stiff = replace(paper_vehicle, secondary_joint_stiffness=50e6)
    rms = printed.printed_rms(stiff, paper_case.spectrum, np.array([50.0]), paper_case.band)
    assert np.isnan(rms).all()


def test_the_same_quadrature_gives_the_right_equations_their_known_rms(paper_vehicle, paper_case):
    speed = np.array([100, 250]) / 3.6
    system = half_vehicle(paper_vehicle)
    model = state_space(system)
    rows, _ = readout(system, model, paper_vehicle)
    poles = np.linalg.eigvals(model.a)
    found = printed.response_rms(model, rows, poles, paper_vehicle, paper_case.spectrum, speed, paper_case.band)
    known = solve.solve(half_vehicle_problem(paper_vehicle, speed, paper_case.spectrum, paper_case.band, PAPER)).rms
    np.testing.assert_allclose(found, np.concatenate([known[name] for name in PAPER]), rtol=1e-6)


def test_wrong_signs_change_the_numbers_where_they_are_stable(paper_vehicle, paper_case):
    speed = np.array([250 / 3.6])
    found = printed.printed_rms(paper_vehicle, paper_case.spectrum, speed, paper_case.band)[:, 0]
    known = solve.solve(half_vehicle_problem(paper_vehicle, speed, paper_case.spectrum, paper_case.band, PAPER)).rms
    bogies = known["bogie_acceleration"][:, 0]
    assert found[3] / bogies[0] > 2
    assert found[3] != pytest.approx(found[4], rel=0.5)  # front and rear bogie are no longer alike
