"""Poles and residues of the chains: as the frequency response has them, and against forty digits on extremes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp, mpf

from freqrail.model.equations import state_space
from freqrail.model.responses import CHAINS
from freqrail.model.vehicle import Vehicle, half_vehicle
from freqrail.solver import partial_fractions
from freqrail.solver.partial_fractions import chain_poles, expand, own_resonances
from tests.chains import chain_responses, poles
from tests.extremes import forty_digits
from tests.extremes.draws import KNOWN, PLAUSIBLE


@pytest.mark.parametrize("chain", CHAINS)
def test_partial_fractions_are_the_frequency_response(paper_vehicle, chain):
    grid_of = replace(
        paper_vehicle,
        primary_joint_stiffness=np.array([0.5e6, 5e6, 1e8, 1e10, 1e14, np.inf])[:, None],
        secondary_joint_stiffness=np.array([[0.5e6, 1e8, np.inf]]),
    )
    omega = np.geomspace(5.0, 3000.0, 50)
    direct = chain_responses(grid_of.column(), omega)[chain]
    part = expand(grid_of, chain)
    for element, ratio in direct.ratios.items():
        fractions = np.sum(
            part.residues[element][..., None, :] / (1j * omega[:, None] - part.poles[..., None, :]), axis=-1
        )
        exact = ratio * direct.top
        scale = np.max(np.abs(exact), axis=-1, keepdims=True)
        assert np.max(np.abs(fractions - exact) / scale) < 1e-9


def test_the_poles_are_those_of_the_26_states(paper_vehicle):
    found = np.concatenate([expand(paper_vehicle, chain).poles for chain in CHAINS])
    expected = np.linalg.eigvals(state_space(half_vehicle(paper_vehicle)).a)
    assert all(np.min(np.abs(found - p)) < 1e-9 * abs(p) for p in expected)


def test_numbers_that_overflow_have_no_poles_and_leave_those_beside_them_alone(paper_vehicle):
    many = replace(paper_vehicle, wheelset_mass=np.array([1e-305, 700.0]))
    for chain in CHAINS:
        with np.errstate(all="ignore"):
            light, plain = chain_poles(many, chain)
        assert np.isnan(light).all()
        assert np.isfinite(plain).all()


# --- against forty digits ----------------------------------------------------------------------------

RIGID = {"primary_joint_stiffness": np.inf, "secondary_joint_stiffness": np.inf}
EXTREME = [drawn.vehicle | joints for drawn in KNOWN for joints in ({}, RIGID)]
EXTREME.append(PLAUSIBLE | {"bogie_mass": 6e8, "primary_stiffness": 1.0, "primary_damping": 1e-3})


def exact(numbers: dict[str, float], chain: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Poles of a chain and the residues of its elements there."""
    with mp.workdps(60):
        found = forty_digits.solve_chain({name: mpf(value) for name, value in numbers.items()}, CHAINS.index(chain))
        residues = {
            "car" if element == "top" else element: np.array(
                [
                    complex(forty_digits.evaluate(numerator, p) / slope)
                    for p, slope in zip(found.poles, found.slopes, strict=True)
                ]
            )
            for element, numerator in found.numerators.items()
        }
        return np.array([complex(p) for p in found.poles]), residues


def nearest(found: np.ndarray, p: complex) -> int:
    return int(np.argmin(np.abs(found - p) / np.abs(p)))


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("number", range(len(EXTREME)))
def test_what_rounding_leaves_of_a_light_pole_is_known(number, chain):
    """The peaks of light poles hang on their residues and real parts alone; estimates of 1e-9 and less."""
    numbers = EXTREME[number]
    part = expand(Vehicle(**{name: np.array([value]) for name, value in numbers.items()}), chain)
    true, residues = exact(numbers, chain)
    light = np.abs(true.real) < partial_fractions.LIGHT * np.abs(true)
    assert light.any()
    for k in np.flatnonzero(light):
        place = nearest(part.poles[0], true[k])
        assert part.poles[0, place].imag == pytest.approx(true[k].imag, rel=1e-12)
        for element, expected in residues.items():
            error = abs(part.residues[element][0, place] / expected[k] - 1)
            shape = abs(part.poles[0, place].real / true[k].real - 1)
            assert error + shape <= part.rounding[element][0, place] < 1e-7


@pytest.mark.parametrize("chain", CHAINS)
def test_a_pole_beside_the_zero_of_a_leg_is_found(chain):
    """A damper of 3 GN s/m makes its leg rigid but for motions of an hour: V has a pole and a zero side by side."""
    numbers = KNOWN[2].vehicle | RIGID
    part = expand(Vehicle(**{name: np.array([value]) for name, value in numbers.items()}), chain)
    true, residues = exact(numbers, chain)
    slow = np.flatnonzero(np.abs(true) < 1e-3)
    for k in slow:
        place = nearest(part.poles[0], true[k])
        assert part.poles[0, place] == pytest.approx(true[k], rel=1e-12)
        assert part.residues["bogie"][0, place] == pytest.approx(residues["bogie"][k], rel=1e-9)
    assert slow.size == 1


# --- resonances as quadrature sees them --------------------------------------------------------------


def test_plausible_vehicles_need_no_more_than_eigenvalues(paper_vehicle):
    for chain in CHAINS:
        found = own_resonances(paper_vehicle, chain)
        assert np.array_equal(found.poles, poles(paper_vehicle, (chain,)))
        assert found.known.all()
        assert np.all(found.shift < 1e-13)


def test_a_peak_that_eigenvalues_misplace_is_placed(paper_vehicle):
    """Joints of 1e15 N/m relax at 1e11 rad/s and more: beside them eigenvalues lose the car's slow, light bounce."""
    stiff = replace(
        paper_vehicle,
        car_body_mass=1e10,
        primary_joint_stiffness=1e15,
        secondary_joint_stiffness=1e15,
        secondary_damping=1.0,
    )
    numbers = {name: float(value) for name, value in vars(stiff).items()}
    true, _ = exact(numbers, "bounce")
    slowest = true[np.argmin(np.where(true.imag > 0, np.abs(true), np.inf))]
    raw = poles(stiff, ("bounce",))
    assert np.min(np.abs(raw - slowest)) > abs(slowest.real)
    found = own_resonances(stiff, "bounce")
    assert np.min(np.abs(found.poles - slowest)) < 0.1 * abs(slowest.real)
    assert found.known.all()


@pytest.mark.parametrize("chain", CHAINS)
def test_a_pole_that_is_taken_twice_or_lies_elsewhere_is_missed(paper_vehicle, chain):
    for vehicle in (paper_vehicle, paper_vehicle.traditional()):
        whole = poles(vehicle, (chain,))
        assert partial_fractions._complete(vehicle, chain, whole)
        for k in range(whole.size):
            other = whole[k - 1]
            assert not partial_fractions._complete(vehicle, chain, np.append(np.delete(whole, k), other))
            moved = np.where(np.arange(whole.size) == k, whole * (1 + 1e-4), whole)
            assert not partial_fractions._complete(vehicle, chain, moved)


def test_numbers_that_overflow_have_no_known_resonances(paper_vehicle):
    found = own_resonances(replace(paper_vehicle, wheelset_mass=1e-305), "bounce")
    assert not found.known.any()
