"""Modes in words: the poles of the assembled vehicle, named once each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.equations import state_space
from freqrail.model.vehicle import half_vehicle
from freqrail.solver.modes import modes
from tests.helpers import random_vehicles


def test_modes_and_their_conjugates_are_the_poles_of_the_26_state_model(paper_vehicle):
    for vehicle in (paper_vehicle, *random_vehicles(5, seed=3)):
        found = [mode.pole for mode in modes(vehicle)]
        found += [pole.conjugate() for pole in found if pole.imag > 0]
        expected = np.linalg.eigvals(state_space(half_vehicle(vehicle)).a)
        assert len(found) == expected.size == 26
        apart = np.abs(np.subtract.outer(found, expected))
        assert np.max(apart.min(axis=0) / np.abs(expected)) < 1e-6
        assert np.max(apart.min(axis=1) / np.abs(found)) < 1e-6


def test_every_mode_has_a_name_of_its_own(paper_vehicle):
    for vehicle in (paper_vehicle, paper_vehicle.traditional()):
        names = [mode.name for mode in modes(vehicle)]
        assert len(set(names)) == len(names)


@pytest.mark.parametrize("stiffness", [1e13, 1e15])
def test_very_stiff_joints_are_rigid_to_the_digits_that_are_left(paper_vehicle, stiffness):
    """A joint softens by one over its stiffness and no more; plain eigenvalues lose their digits on the way."""
    stiff = replace(paper_vehicle, primary_joint_stiffness=stiffness, secondary_joint_stiffness=stiffness)
    rigid = {mode.name: mode for mode in modes(paper_vehicle.traditional()) if "wheelset" in mode.name}
    for mode in modes(stiff):
        if mode.name in rigid:
            assert mode.damping_ratio == pytest.approx(rigid[mode.name].damping_ratio, rel=1e7 / stiffness)
            assert mode.natural_frequency == pytest.approx(rigid[mode.name].natural_frequency, rel=1e7 / stiffness)


def test_an_overdamped_pair_is_a_slow_and_a_fast_one(paper_vehicle):
    pair = [mode for mode in modes(paper_vehicle.traditional()) if mode.name.startswith("bogie bounce, in phase")]
    assert [mode.name.split(", ")[-1] for mode in pair] == ["slow", "fast"]
    assert pair[0].natural_frequency < pair[1].natural_frequency
    assert all(mode.damping_ratio == 1 and mode.damped_frequency == 0 for mode in pair)
