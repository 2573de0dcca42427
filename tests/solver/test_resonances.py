"""Resonances as quadrature sees them: known or not, exact where eigenvalues lack the digits, of many at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import Reduction, reduce
from freqrail.solver import resonances as the_resonances
from freqrail.solver.block_poles import expansion
from freqrail.solver.problem import half_vehicle_reduction
from freqrail.solver.resonances import Resonances, every_pole, is_lost, resonances, resonances_of_each
from tests import chains
from tests.chains import CHAINS
from tests.helpers import ALL_NAMES, random_vehicles
from tests.plain_vehicles import MAKERS, as_system, outputs_of
from tests.solver.test_block_poles import exact


def reduction() -> Reduction:
    return half_vehicle_reduction(ALL_NAMES)


def found_in(vehicle: Vehicle) -> dict[int, Resonances]:
    return resonances(reduction(), vars(vehicle), vehicle.shape)


def stiff(vehicle: Vehicle) -> Vehicle:
    """Joints of 1e15 N/m relax at 1e11 rad/s and more: beside them eigenvalues lose the car's slow, light bounce."""
    return replace(
        vehicle,
        car_body_mass=1e10,
        primary_joint_stiffness=1e15,
        secondary_joint_stiffness=1e15,
        secondary_damping=1.0,
    )


def test_plausible_vehicles_have_known_peaks_where_the_chains_have_them(paper_vehicle):
    for vehicle in (paper_vehicle, paper_vehicle.traditional(), *random_vehicles(10, 3)):
        found = found_in(vehicle)
        assert len(found) == len(CHAINS)
        expected = chains.poles(vehicle)
        for each in found.values():
            assert each.known.all()
            assert np.all(each.shift < 1e-13)
            assert np.all(each.vehicle == 0)
        told = every_pole(found)
        with_conjugates = np.concatenate([told, np.conj(told[told.imag > 0])])
        assert with_conjugates.size == expected.size
        for p in expected:
            assert np.min(np.abs(with_conjugates - p)) < 1e-9 * abs(p)


def test_a_peak_that_eigenvalues_misplace_is_placed(paper_vehicle):
    vehicle = stiff(paper_vehicle)
    true, _ = exact({name: float(value) for name, value in vars(vehicle).items()}, "bounce")
    slowest = true[np.argmin(np.where(true.imag > 0, np.abs(true), np.inf))]
    raw = chains.poles(vehicle, ("bounce",))
    assert np.min(np.abs(raw - slowest)) > abs(slowest.real)
    found = min(found_in(vehicle).values(), key=lambda each: np.min(np.abs(each.poles - slowest)))
    assert np.min(np.abs(found.poles - slowest)) < 0.1 * abs(slowest.real)
    assert found.known.all()


def test_where_eigenvalues_lose_a_width_a_sample_takes_no_time_to_know_it(paper_vehicle):
    """Its poles are unknown, and of this block only; `is_lost` tells."""
    vehicle = stiff(paper_vehicle)
    asked = resonances(reduction(), vars(vehicle), sample=True)
    lost = {index: bool(np.any(is_lost(expansion(reduction(), index, vars(vehicle)).raw))) for index in asked}
    assert set(lost.values()) == {True, False}
    for index, each in asked.items():
        assert each.known.all() is not lost[index]
        assert each.known.any() is not lost[index]


def every_pole_of(vehicle: Vehicle, index: int) -> np.ndarray:
    return the_resonances._all_of(expansion(reduction(), index, vars(vehicle)), ())


@pytest.mark.parametrize("which", range(len(CHAINS)))
def test_a_pole_that_is_taken_twice_or_lies_elsewhere_is_missed(paper_vehicle, which):
    index = list(found_in(paper_vehicle))[which]
    for vehicle in (paper_vehicle, paper_vehicle.traditional()):
        values, whole = vars(vehicle), every_pole_of(vehicle, index)
        assert the_resonances._complete(reduction(), index, values, whole)
        for k in range(whole.size):
            other = whole[k - 1]
            twice = np.append(np.delete(whole, k), other)
            assert not the_resonances._complete(reduction(), index, values, twice)
            moved = np.where(np.arange(whole.size) == k, whole * (1 + 1e-4), whole)
            assert not the_resonances._complete(reduction(), index, values, moved)


@pytest.mark.parametrize("kind", [kind for kind in MAKERS if kind != "irrational laws"])
def test_the_poles_of_any_vehicle_are_counted(kind):
    """Those of every block are complete, whatever its laws; one less is not."""
    plain = MAKERS[kind](np.random.default_rng(5))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    for index in resonances(found, plain.values):
        whole = the_resonances._all_of(expansion(found, index, plain.values), ())
        assert the_resonances._complete(found, index, plain.values, whole)
        # a pair, or a real pole, that lies elsewhere
        p = whole[np.argmin(np.abs(whole))]
        moved = np.where(np.isin(whole, [p, np.conj(p)]), whole * (1 + 1e-3), whole)
        assert not the_resonances._complete(found, index, plain.values, moved)


def test_numbers_that_overflow_have_no_known_resonances(paper_vehicle):
    for each in found_in(replace(paper_vehicle, wheelset_mass=1e-305)).values():
        assert np.isnan(each.poles).all()
        assert not each.known.any()
        assert each.poles.size == 1


def test_resonances_of_many_vehicles_are_those_of_each(paper_vehicle):
    """Bit by bit, and one that overflows leaves those beside it alone; rigid joints have fewer poles."""
    many = replace(
        paper_vehicle,
        wheelset_mass=np.array([700.0, 1e-305, 650.0]),
        primary_joint_stiffness=np.array([5e6, 5e6, np.inf]),
    )
    together = resonances_of_each(reduction(), vars(many), 3)
    grid = found_in(many)
    for k in range(3):
        alone = found_in(many.at((k,)))
        for index, each in alone.items():
            other, part = together[k][index], grid[index].some(grid[index].vehicle == k)
            for found in (other, part):
                order = [np.lexsort((x.poles.real, x.poles.imag)) for x in (each, found)]
                assert np.array_equal(each.poles[order[0]], found.poles[order[1]], equal_nan=True)
                assert np.array_equal(each.known[order[0]], found.known[order[1]])
                assert np.array_equal(each.shift[order[0]], found.shift[order[1]], equal_nan=True)
                for scalar, error in each.errors.items():
                    assert np.array_equal(error[order[0]], found.errors[scalar][order[1]], equal_nan=True)
            assert np.all(other.vehicle == 0)
