"""Equations of motion of the assembled vehicle: energy, and the law of action and reaction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.equations import leg_dynamic_stiffness, system_response
from freqrail.model.vehicle import half_vehicle
from tests.helpers import INDEX, MODELS

every_model = pytest.mark.parametrize("vehicle", MODELS.values(), ids=MODELS.keys())
OMEGA = 2 * np.pi * np.geomspace(1e-3, 1e3, 601)


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
