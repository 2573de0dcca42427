"""Poles of one vehicle: those of the chains and of the assembled matrix, exact where eigenvalues lose digits."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from freqrail.model.half_vehicle import half_vehicle, values_of
from freqrail.reduction.blocks import blocks_of
from freqrail.solver import vehicle_poles as the_poles
from freqrail.solver.vehicle_poles import free_motion, half_vehicle_blocks, half_vehicle_poles
from tests import chains
from tests.helpers import random_vehicles
from tests.independent import state_matrices


def farthest(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest relative distance of a pole of one side from the nearest of the other."""
    apart = np.abs(np.subtract.outer(found, expected))
    return float(max(np.max(apart.min(axis=1) / np.abs(found)), np.max(apart.min(axis=0) / np.abs(expected))))


def test_poles_are_those_of_the_chains_the_bogie_pitch_pair_once(paper_vehicle):
    for vehicle in (paper_vehicle, paper_vehicle.traditional(), *random_vehicles(20, 2)):
        found, expected = half_vehicle_poles(vehicle), chains.poles(vehicle)
        assert found.size == expected.size
        assert farthest(found, expected) < 1e-10


def test_poles_are_the_eigenvalues_of_the_typed_matrices(paper_vehicle):
    for vehicle in (paper_vehicle, *random_vehicles(5, 6)):
        assert farthest(half_vehicle_poles(vehicle), np.linalg.eigvals(state_matrices(vehicle)[0])) < 1e-6


@pytest.mark.parametrize("joint", [1e3, 1e5, 5e6, 1e10])
def test_a_lightly_damped_wheelset_keeps_the_digits_of_its_decay(paper_vehicle, joint):
    """Two masses on the rail in fifty digits, the bogie's pitch; 1 kN/m joints: the decay is 1e-13 of the frequency."""
    vehicle = replace(paper_vehicle, primary_joint_stiffness=joint)
    v = {name: mpmath.mpf(float(value)) for name, value in vars(vehicle).items()}
    top = v["bogie_pitch_inertia"] / (2 * v["half_wheelbase"] ** 2)

    def track(s):
        damper = v["primary_damping"] * s
        leg = v["primary_stiffness"] + damper / (1 + damper * 2 / v["primary_joint_stiffness"])
        force = -top * s**2
        x = 1 - force / leg
        return x - (force - v["wheelset_mass"] * s**2 * x) / v["contact_stiffness"]

    lengths, blocks = half_vehicle_blocks()
    (pitch,) = (block for k, block in enumerate(blocks) if block.size == 2 and block.alike == k)
    found = free_motion(pitch, lengths, values_of(vehicle))
    p = found.poles[np.argmax(found.poles.imag)]
    with mpmath.workdps(50):
        expected = mpmath.findroot(track, mpmath.mpc(complex(p)))
    assert p.imag == pytest.approx(float(expected.imag), rel=1e-13)
    assert p.real == pytest.approx(float(expected.real), rel=1e-11)


def test_what_moves_at_a_pole_is_in_balance(paper_vehicle):
    """m p^2 x + R^T D(p) e = 0 in every block, with e of the struts the rows times x."""
    values = values_of(paper_vehicle)
    lengths, blocks = blocks_of(half_vehicle(), values)
    for block in blocks:
        motion = free_motion(block, lengths, values)
        rows = np.array([lengths.evaluate(strut.row, values) for strut in block.struts])
        np.testing.assert_allclose(motion.e, rows @ motion.x, rtol=1e-9, atol=1e-12 * np.abs(motion.x).max())
        laws = np.array([strut.law.stiffness(values, motion.poles) + 0 * motion.poles for strut in block.struts])
        masses = np.array([values[name] for name in block.inertias])
        inertia = masses[:, None] * motion.poles**2 * motion.x
        size = np.abs(inertia).max(axis=0) + np.abs(rows.T @ (laws * motion.e)).max(axis=0)
        assert np.max(np.abs(inertia + rows.T @ (laws * motion.e)) / size) < 1e-9


def test_poles_that_no_polishing_finds_stay_eigenvalues_with_their_vectors(paper_vehicle, monkeypatch):
    values = values_of(paper_vehicle)
    lengths, blocks = half_vehicle_blocks()
    sure = free_motion(blocks[0], lengths, values)
    true = the_poles._polished

    def unfound(*given):
        p, x, e, sure = true(*given)
        return np.nan * p, np.nan * x, np.nan * e, ~sure

    monkeypatch.setattr(the_poles, "_polished", unfound)
    raw = free_motion(blocks[0], lengths, values)
    np.testing.assert_allclose(raw.poles, sure.poles, rtol=1e-9)
    np.testing.assert_allclose(raw.x / raw.x[2], sure.x / sure.x[2], rtol=1e-6)
    np.testing.assert_allclose(raw.e / raw.x[2], sure.e / sure.x[2], rtol=1e-6, atol=1e-6)


def test_a_block_whose_numbers_overflow_has_no_poles(paper_vehicle):
    absurd = half_vehicle_poles(replace(paper_vehicle, car_body_mass=1e300, bogie_mass=1e-300, wheelset_mass=1e-305))
    assert np.isnan(absurd).any()
