"""Closed form over the whole axis: against 50-digit arithmetic, against quadrature, and at its singular points."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from freqrail import grid, residues
from freqrail.response import SERIES, chain_responses
from freqrail.study import Study
from freqrail.track import RationalSpectrum
from freqrail.vehicle import CHAINS, Vehicle, half_vehicle, hertzian_contact_stiffness, state_space, static_wheel_load

REFERENCE = json.loads((Path(__file__).parent / "reference" / "whole_axis.json").read_text())
NAMES = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke", "wheelset_acceleration")
KMH = 1 / 3.6


def reference_vehicle(case: dict) -> Vehicle:
    numbers = {name: float(text) for name, text in case["vehicle"].items()}
    load = static_wheel_load(numbers["car_body_mass"], numbers["bogie_mass"], numbers["wheelset_mass"])
    return Vehicle(
        **numbers,
        primary_joint_stiffness=float(case["primary_joint_stiffness"]),
        secondary_joint_stiffness=float(case["secondary_joint_stiffness"]),
        contact_stiffness=hertzian_contact_stiffness(float(REFERENCE["contact_constant"]), load),
    )


def reference_spectrum() -> RationalSpectrum:
    roughness, low, high = map(float, REFERENCE["spectrum"])
    return RationalSpectrum("reference", roughness, (low, high))


@pytest.mark.parametrize(
    "case",
    REFERENCE["cases"],
    ids=lambda c: f"{c['primary_joint_stiffness']}-{c['secondary_joint_stiffness']}-{c['speed_km_h']}",
)
def test_the_closed_form_agrees_with_fifty_digits(case):
    """1e-9 from 0.5 MN/m to rigid joints, the singular points included; softer joints as their estimate says."""
    vehicle, speed = reference_vehicle(case), np.array([float(case["speed_km_h"]) * KMH])
    squares = residues.mean_squares(vehicle, NAMES, reference_spectrum(), speed)
    found = np.concatenate([squares[name].value[:, 0] for name in NAMES])
    estimate = np.concatenate([squares[name].error[:, 0] for name in NAMES]) / found
    true = np.abs(found / np.array(list(map(float, case["mean_squares"]))) - 1)
    assert np.all(true <= estimate)
    if min(vehicle.primary_joint_stiffness, vehicle.secondary_joint_stiffness) >= 0.5e6:
        assert np.max(true) < 1e-9


@pytest.mark.parametrize("chain", CHAINS)
def test_partial_fractions_are_the_frequency_response(paper_vehicle, chain):
    grid_of = replace(
        paper_vehicle,
        primary_joint_stiffness=np.array([0.5e6, 5e6, 1e8, 1e10, 1e14, np.inf])[:, None],
        secondary_joint_stiffness=np.array([[0.5e6, 1e8, np.inf]]),
    )
    omega = np.geomspace(5.0, 3000.0, 50)
    direct = chain_responses(grid_of.column(), omega)[chain]
    part = residues.modal(grid_of, chain)
    for element, ratio in direct.ratios.items():
        fractions = np.sum(
            part.residues[element][..., None, :] / (1j * omega[:, None] - part.poles[..., None, :]), axis=-1
        )
        exact = ratio * direct.top
        scale = np.max(np.abs(exact), axis=-1, keepdims=True)
        assert np.max(np.abs(fractions - exact) / scale) < 1e-9


def test_the_poles_are_those_of_the_26_states(paper_vehicle):
    found = np.concatenate([residues.modal(paper_vehicle, chain).poles for chain in CHAINS])
    expected = np.linalg.eigvals(state_space(half_vehicle(paper_vehicle)).a)
    assert all(np.min(np.abs(found - p)) < 1e-9 * abs(p) for p in expected)


def test_closed_form_and_quadrature_agree_on_the_paper_grid(paper_vehicle, german_low):
    """Two methods that share only the response: nodes that follow the poles, and residues at them."""
    stiffness = 1e6 * np.array([0.5, 5, 100])
    vehicles = replace(
        paper_vehicle,
        primary_joint_stiffness=stiffness[:, None],
        secondary_joint_stiffness=stiffness[None, :],
    )
    names = tuple(name for name in SERIES if name != "wheelset_acceleration")  # whose tail the quadrature only bounds
    study = Study(vehicles, np.array([20.0, 100, 250, 600]) * KMH, german_low, None, names)
    squares = residues.mean_squares(vehicles, names, german_low, study.speed)
    for index in np.ndindex(3, 3):
        own = grid._own_quadrature(study, index)
        for name in names:
            exact, other = squares[name].value[:, *index], own[name].value
            allowed = squares[name].error[:, *index] + own[name].error
            assert np.all(np.abs(exact - other) <= allowed)
            assert np.max(np.abs(other / exact - 1)) < 1e-8


@pytest.mark.parametrize("scale", [1 - 1e-2, 1 - 1e-4, 1 - 1e-6, 1 - 1e-9, 1.0, 1 + 1e-9, 1 + 1e-5, 1 + 1e-3])
@pytest.mark.parametrize(
    ("joint", "critical"), [("primary_joint_stiffness", 17.28626e6), ("secondary_joint_stiffness", 69.82e6)]
)
def test_nothing_happens_where_two_poles_merge(paper_vehicle, german_low, joint, critical, scale):
    """The variance is smooth in the stiffness: at critical damping it lies on the curve through its neighbours."""
    offsets = np.array([-0.06, -0.04, -0.02, 0.02, 0.04, 0.06])
    line = replace(paper_vehicle, **{joint: critical * (1 + offsets)})
    speed = np.array([250 * KMH])
    around = residues.mean_squares(line, NAMES, german_low, speed)
    here = residues.mean_squares(replace(paper_vehicle, **{joint: critical * scale}), NAMES, german_low, speed)
    for name in NAMES:
        for p in range(len(SERIES[name].positions)):
            smooth = np.polynomial.Polynomial.fit(offsets, around[name].value[p, :, 0], 5)
            assert here[name].value[p, 0] == pytest.approx(smooth(scale - 1), rel=3e-8)


def test_nothing_happens_where_a_vehicle_pole_meets_a_track_pole(paper_vehicle, german_low):
    """77.84414 km/h on the paper's case, and a hair beside: quadrature does not know that anything is special there."""
    offsets = np.array([-2e-3, -1e-3, -1e-5, -1e-8, 0, 1e-9, 1e-6, 1e-4, 1.1e-3])
    study = Study(paper_vehicle, 77.84414 * (1 + offsets) * KMH, german_low, None, NAMES[:4])
    squares = residues.mean_squares(paper_vehicle, study.names, german_low, study.speed)
    own = grid._own_quadrature(study, ())
    for name in study.names:
        assert squares[name].value == pytest.approx(own[name].value, rel=1e-9)


def test_a_stiff_joint_is_a_rigid_joint_up_to_one_over_its_stiffness(paper_vehicle, german_low):
    speed = np.array([100, 250]) * KMH
    rigid = residues.mean_squares(paper_vehicle.traditional(), NAMES, german_low, speed)
    stiffness = 10.0 ** np.arange(10, 16)
    stiff = replace(paper_vehicle, primary_joint_stiffness=stiffness, secondary_joint_stiffness=stiffness)
    squares = residues.mean_squares(stiff, NAMES, german_low, speed)
    for name in NAMES:
        apart = np.max(np.abs(squares[name].value / rigid[name].value[:, None] - 1), axis=(0, 2))
        assert np.all(apart[1:] < 0.11 * apart[:-1])  # a tenth for ten times the stiffness


def test_softer_joints_own_up_to_a_larger_error(paper_vehicle, german_low):
    """The wheelset's damping shrinks with the square of the joint's stiffness, towards the rounding error."""
    stiffness = 10.0 ** np.arange(3, 7)[::-1]
    soft = replace(paper_vehicle, primary_joint_stiffness=stiffness, secondary_joint_stiffness=stiffness)
    square = residues.mean_squares(soft, NAMES, german_low, np.array([250 * KMH]))["primary_stroke"]
    relative = (square.error / square.value)[0, :, 0]
    assert np.all(np.diff(relative) > 0)
    assert relative[0] < 1e-9
    assert relative[-1] > 1e-6


def test_equal_cutoffs_are_left_to_quadrature(paper_vehicle):
    double = RationalSpectrum("rational", 4.032e-7, (0.5, 0.5))
    assert not residues.applies(double)
    study = Study(paper_vehicle, np.array([250 * KMH]), double, None, NAMES[:4])
    solution = grid.solve(study)
    assert np.all(solution.method == grid.METHOD.index("own_quadrature"))
    near = RationalSpectrum("rational", 4.032e-7, (0.5, 0.502))
    beside = grid.solve(replace(study, spectrum=near))
    assert np.all(beside.method == grid.METHOD.index("closed_form"))
    for name in NAMES[:4]:
        assert solution.rms[name] == pytest.approx(beside.rms[name], rel=1e-2)


@pytest.mark.parametrize(
    ("change", "speed"),
    [
        ({"secondary_joint_stiffness": 5e3}, 250),
        ({"secondary_joint_stiffness": 2e3}, 50),
        ({"secondary_joint_stiffness": 1e3}, 50),
        ({"secondary_damping": 2e6, "secondary_joint_stiffness": 1e12}, 10),
        ({"primary_damping": 300e3, "primary_stiffness": 146e3, "primary_joint_stiffness": np.inf}, 5),
        ({"secondary_joint_stiffness": 1.27e14, "secondary_damping": 2e6, "primary_damping": 89.0}, 60),
    ],
    ids=["5 kN/m", "2 kN/m", "1 kN/m", "slow overdamped", "slow overdamped, rigid", "fast, nearly rigid"],
)
def test_a_residue_that_rounding_spoils_is_found_out(paper_vehicle, german_low, change, speed):
    """Soft secondary joints, slow and fast overdamped poles: the estimate covers the error, the grid mends it."""
    vehicle = replace(paper_vehicle, **change)
    study = Study(vehicle, np.array([speed * KMH]), german_low, None, NAMES[:4])
    squares = residues.mean_squares(vehicle, study.names, german_low, study.speed)
    own, solution = grid._own_quadrature(study, ()), grid.solve(study)
    for name in study.names:
        apart = np.abs(squares[name].value - own[name].value)
        assert not np.any(apart > squares[name].error + own[name].error)
        assert solution.rms[name] == pytest.approx(np.sqrt(own[name].value), rel=1e-7)
