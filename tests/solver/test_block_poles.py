"""Poles and residues of blocks: as the frequency response has them, and against forty digits on extremes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpmath import mp, mpf

from freqrail.model.equations import state_space
from freqrail.model.vehicle import Vehicle, half_vehicle
from freqrail.reduction.columns import Reduction
from freqrail.solver import block_poles
from freqrail.solver.block_poles import Expansion, bases, expand
from freqrail.solver.block_response import column, scalars
from freqrail.solver.problem import half_vehicle_reduction
from tests.chains import BODIES, CHAINS, chain_responses
from tests.extremes import forty_digits
from tests.extremes.draws import KNOWN, PLAUSIBLE

NAMES = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke", "wheelset_acceleration")


def reduction() -> Reduction:
    return half_vehicle_reduction(NAMES)


@cache
def elements() -> dict[int, tuple[str, str, float]]:
    """{scalar: (chain, element, factor)}: a scalar of a block is that element of that chain, per metre, times a factor.

    Found by comparison at two frequencies, of the plausible vehicle; the factors are roots of sixteenths.
    """
    vehicle, omega = Vehicle(**PLAUSIBLE), np.array([7.0, 90.0])
    found = scalars(bases(reduction()), column(vars(vehicle)), 1j * omega, -np.square(omega)).values()
    chains = chain_responses(vehicle, omega)
    result = {}
    for k, scalar in enumerate(found):
        for chain, response in chains.items():
            for element, ratio in response.ratios.items():
                factor = scalar / (ratio * response.top)
                if np.ptp(factor) < 1e-9 * np.abs(factor[0]):
                    square = np.round(16 * factor[0].real ** 2) / 16
                    assert square == pytest.approx(factor[0].real ** 2, rel=1e-12)
                    result[k] = chain, element, float(np.sign(factor[0].real) * np.sqrt(square))
    assert len(result) == len(found) == 5 + 5 + 2
    return result


def expansions(vehicle: Vehicle) -> dict[str, tuple[Expansion, dict[str, tuple[int, float]]]]:
    """{chain: (partial fractions, {element: (scalar, factor)})}, the bogies' pitch once."""
    result: dict[str, tuple[Expansion, dict[str, tuple[int, float]]]] = {}
    for found in expand(reduction(), vars(vehicle)).values():
        for k in found.residues:
            chain, element, factor = elements()[k]
            result.setdefault(chain, (found, {}))[1][element] = (k, factor)
    assert set(result) == set(CHAINS)
    return result


@pytest.mark.parametrize("chain", CHAINS)
def test_partial_fractions_are_the_frequency_response(paper_vehicle, chain):
    grid_of = replace(
        paper_vehicle,
        primary_joint_stiffness=np.array([0.5e6, 5e6, 1e8, 1e10, 1e14, np.inf])[:, None],
        secondary_joint_stiffness=np.array([[0.5e6, 1e8, np.inf]]),
    )
    omega = np.geomspace(5.0, 3000.0, 50)
    direct = chain_responses(grid_of.column(), omega)[chain]
    part, read = expansions(grid_of)[chain]
    for element, (k, factor) in read.items():
        (fractions,), (lost,) = part.fractions((k,), 1j * omega[None, None])
        exact = factor * direct.ratios[element] * direct.top
        scale = np.max(np.abs(exact), axis=-1, keepdims=True)
        assert np.max(np.abs(fractions - exact) / scale) < 1e-9
        assert np.max(lost / scale) < 1e-6


def test_the_poles_are_those_of_the_26_states(paper_vehicle):
    upper = np.concatenate([found.poles for found, _ in expansions(paper_vehicle).values()])
    found = np.concatenate([upper, np.conj(upper)])
    expected = np.linalg.eigvals(state_space(half_vehicle(paper_vehicle)).a)
    assert all(np.min(np.abs(found - p)) < 1e-9 * abs(p) for p in expected)
    assert all(np.min(np.abs(expected - p)) < 1e-9 * abs(p) for p in found)


def test_numbers_that_overflow_have_no_poles_and_leave_those_beside_them_alone(paper_vehicle):
    many = replace(paper_vehicle, wheelset_mass=np.array([1e-305, 700.0]))
    for block in reduction().blocks:
        with np.errstate(all="ignore"):
            light, plain = block_poles.poles(block, reduction().lengths, vars(many))
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


OPEN = {(0, "pitch"), (6, "bounce"), (6, "pitch"), (6, "bogie_pitch")}
"""Where an element that hardly moves at a light pole loses digits; it is told so, as of every other."""


@pytest.mark.parametrize("number", range(len(EXTREME)))
@pytest.mark.parametrize("chain", CHAINS)
def test_what_rounding_leaves_of_a_light_pole_is_known(number, chain):
    """The peaks of light poles hang on their residues and real parts alone; estimates of 1e-9 and less."""
    numbers = EXTREME[number]
    part, read = expansions(Vehicle(**{name: np.array([value]) for name, value in numbers.items()}))[chain]
    poles = np.broadcast_to(part.poles, (1, part.poles.shape[-1]))[0]
    true, residues = exact(numbers, chain)
    light = (np.abs(true.real) < block_poles.LIGHT * np.abs(true)) & (true.imag > 0)
    assert light.any()
    for k in np.flatnonzero(light):
        place = nearest(poles, true[k])
        assert poles[place].imag == pytest.approx(true[k].imag, rel=1e-12)
        for element, (scalar, factor) in read.items():
            expected = factor * residues[element][k]
            error = abs(part.residues[scalar][0, place] / expected - 1)
            shape = abs(poles[place].real / true[k].real - 1)
            told = part.rounding[scalar][0, place] / abs(expected)
            assert error + shape <= told
            assert told < 1e-7 or (number, chain) in OPEN


@pytest.mark.parametrize("chain", CHAINS)
def test_a_pole_beside_the_zero_of_a_leg_is_found(chain):
    """A damper of 3 GN s/m makes its leg rigid but for motions of an hour: a pole lies beside a zero of the leg."""
    numbers = KNOWN[2].vehicle | RIGID
    part, read = expansions(Vehicle(**{name: np.array([value]) for name, value in numbers.items()}))[chain]
    true, residues = exact(numbers, chain)
    slow = np.flatnonzero(np.abs(true) < 1e-3)
    scalar, factor = read["bogie"] if "bogie" in read else read[BODIES[-1]]
    element = elements()[scalar][1]
    for k in slow:
        place = nearest(part.poles[0], true[k])
        assert part.poles[0, place] == pytest.approx(true[k], rel=1e-12)
        assert part.residues[scalar][0, place] == pytest.approx(factor * residues[element][k], rel=1e-9)
    assert slow.size == 1
