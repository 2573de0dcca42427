"""A grid as numbers: its bands, and parts that together are the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.band import Band
from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum
from freqrail.model.vehicle import Vehicle
from freqrail.solver.problem import Problem, cells, cells_by_geometry, half_vehicle_problem, problem_of

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
TABLE = TabulatedSpectrum("measured", (0.1, 1.0, 4.0), (1e-4, 1e-6, 1e-9))
SPEEDS = np.array([10.0, 50.0])


def of(vehicle: Vehicle) -> Problem:
    return half_vehicle_problem(vehicle, SPEEDS, TRACK, None, ())


# --- bands -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("band", "spectrum", "limits"),
    [
        (None, TRACK, [[0, 0], [np.inf, np.inf]]),
        (Band("frequency", 0.5, 20.0), TRACK, 2 * np.pi * np.array([[0.5, 0.5], [20, 20]])),
        (Band("wavelength", 2.0, 50.0), TRACK, 2 * np.pi * np.array([[0.2, 1], [5, 25]])),
        (None, TABLE, [[1, 5], [40, 200]]),  # omega = Omega v, from the table's first to its last wavenumber
        (Band("frequency", 0.5, 20.0), TABLE, [[np.pi, 5], [40, 40 * np.pi]]),
        (Band("frequency", 30.0, 50.0), TABLE, [[60 * np.pi, 60 * np.pi], [60 * np.pi, 200]]),  # empty at 10 m/s
    ],
)
def test_limits_are_the_bands_at_every_speed_as_far_as_the_spectrum_goes(paper_vehicle, band, spectrum, limits):
    study = half_vehicle_problem(paper_vehicle, SPEEDS, spectrum, band, ())
    np.testing.assert_allclose(study.limits, limits)


def test_a_study_knows_its_shape(paper_vehicle):
    many = replace(paper_vehicle, bogie_mass=np.ones((4, 1)), car_body_mass=np.ones(3))
    study = of(many)
    assert study.vehicles == (4, 3)
    assert study.shape == (4, 3, 2)
    assert study.points == 24
    assert of(paper_vehicle).shape == (2,)


# --- parts -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(), (1,), (7,), (6, 6), (5, 1, 9), (2, 3, 4, 5)])
@pytest.mark.parametrize("most", [1, 2, 5, 16, 10**6])
def test_cells_hold_every_vehicle_once_and_no_more_than_asked(shape, most):
    count = np.zeros(shape, int)
    for cell in cells(shape, most):
        assert count[cell].size <= most
        count[cell] += 1
    assert np.all(count == 1)


@pytest.mark.parametrize(
    ("shape", "most", "expected"),
    [
        ((100, 100), 256, 7 * 7),  # 15 x 15 vehicles or so, not 1 x 100 and not 2 x 100
        ((100, 100), 5, 50 * 50),  # 2 x 2: a power of two, not more than asked
        ((10, 3), 8, 3 * 2),
        ((4, 4), 16, 1),
        ((9,), 8, 2),
        ((6, 1), 1, 6),
        ((1, 100), 64, 2),
    ],
)
def test_cells_are_few_and_about_as_long_along_every_axis(shape, most, expected):
    found = cells(shape, most)
    assert len(found) == expected
    lengths = [tuple(part.stop - part.start for part in cell) for cell in found]
    assert np.max(np.ptp(lengths, axis=0), initial=0) <= np.max(lengths) / 2


def test_a_part_of_a_grid_has_the_vehicles_of_its_cell(paper_vehicle):
    """Values keep what they do not vary along: a number stays a number, an axis of length 1 its length."""
    many = replace(
        paper_vehicle,
        bogie_mass=np.arange(1.0, 5.0)[:, None],
        car_body_mass=np.arange(1.0, 4.0),
        wheelset_mass=np.array([[7.0]]),
    )
    cell = (slice(1, 3), slice(2, 3))
    part = of(many).cut(cell)
    assert part.vehicles == (2, 1)
    assert part.values["bogie_mass"].tolist() == [[2], [3]]
    assert part.values["car_body_mass"].tolist() == [[3]]
    assert part.values["wheelset_mass"].tolist() == [[7]]
    assert part.values["primary_stiffness"] == paper_vehicle.primary_stiffness
    assert np.ndim(part.values["primary_stiffness"]) == 0
    for index in np.ndindex(part.vehicles):
        alone = vars(many.at((index[0] + 1, index[1] + 2)))
        assert part.at(index).values == of(many).at((index[0] + 1, index[1] + 2)).values == alone


def test_a_part_keeps_all_but_its_values(paper_vehicle):
    whole = of(replace(paper_vehicle, bogie_mass=np.arange(1.0, 5.0)))
    for part in (whole.cut((slice(1, 3),)), whole.at((1,))):
        assert part.reduction is whole.reduction
        assert part.speed is whole.speed
        assert (part.spectrum, part.band) == (whole.spectrum, whole.band)


def test_an_axis_of_two_is_cut_like_any_other(paper_vehicle):
    two = of(replace(paper_vehicle, bogie_mass=np.array([500.0, 600.0])))
    assert [two.cut(cell).values["bogie_mass"].tolist() for cell in cells(two.vehicles, 1)] == [[500], [600]]


def test_vehicles_picked_from_every_axis_are_all_pairs(paper_vehicle):
    """Indices serve as well as slices: those that a sample takes."""
    many = of(replace(paper_vehicle, bogie_mass=np.arange(1.0, 5.0)[:, None], car_body_mass=np.arange(1.0, 4.0)))
    part = many.cut((np.array([0, 3]), np.array([0, 2])))
    assert part.vehicles == (2, 2)
    assert part.values["bogie_mass"].tolist() == [[1], [4]]
    assert part.values["car_body_mass"].tolist() == [[1, 3]]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("name", ["half_bogie_spacing", "half_wheelbase"])
def test_vehicles_of_a_block_have_one_geometry(paper_vehicle, name, axis):
    """Wherever the axis stands that changes it, also where arrays are shorter than the grid has axes."""
    shape = (4, 2, 5)
    lengths = np.arange(1.0, 1 + shape[axis]).reshape(-1, *(1,) * (2 - axis))
    many = replace(
        paper_vehicle, bogie_mass=np.ones((4, 1, 1)), car_body_mass=np.ones((2, 1)), wheelset_mass=np.ones(5)
    )
    many = of(replace(many, **{name: lengths}))
    count, geometries = np.zeros(shape, int), 0
    for geometry, parts in cells_by_geometry(many, 6):
        geometries += 1
        for cell in parts:
            count[cell] += 1
            assert count[cell].size <= 6
            part = np.unique(many.cut(cell).values[name])
            assert part.tolist() == [many.at(geometry).values[name]]
    assert np.all(count == 1)
    assert geometries == shape[axis]


@pytest.mark.parametrize("length", ["half_bogie_spacing", "half_wheelbase"])
def test_lengths_that_move_no_wheel_change_no_geometry(paper_vehicle, length):
    """Of a vehicle whose wheels stand at fixed places, on bogies whose lengths vary."""
    system = half_vehicle()
    wheels = tuple(replace(wheel, place=float(k)) for k, wheel in enumerate(system.wheels))
    values = vars(paper_vehicle) | {length: np.arange(1.0, 4.0)}
    fixed = problem_of(replace(system, wheels=wheels), outputs(), values, SPEEDS, TRACK, None)
    assert [len(parts) for _, parts in cells_by_geometry(fixed, 100)] == [1]
    moved = problem_of(system, outputs(), values, SPEEDS, TRACK, None)
    assert [len(parts) for _, parts in cells_by_geometry(moved, 100)] == [1, 1, 1]


def test_one_geometry_is_one_group_of_blocks(paper_vehicle):
    many = of(replace(paper_vehicle, bogie_mass=np.ones((4, 1)), car_body_mass=np.ones(3)))
    ((geometry, parts),) = cells_by_geometry(many, 100)
    assert geometry == (0, 0)
    assert parts == [(slice(0, 4), slice(0, 3))]


# --- outputs -----------------------------------------------------------------------------------------


def test_some_outputs_of_a_problem_are_those_in_the_vehicles_order(paper_vehicle):
    every = tuple(output.name for output in outputs())
    whole = half_vehicle_problem(paper_vehicle, SPEEDS, TRACK, None, every)
    assert whole.names == every
    assert whole.only(("primary_stroke", "bogie_acceleration")).names == ("bogie_acceleration", "primary_stroke")


def test_a_problem_holds_the_values_of_its_vehicle_and_no_others(paper_vehicle):
    """Which others there are, and how they vary, is nothing to its shape."""
    system = half_vehicle()
    values = vars(paper_vehicle) | {"weather": np.arange(5.0)}
    study = problem_of(system, outputs(), values, SPEEDS, TRACK, None)
    assert set(study.values) == set(vars(paper_vehicle))
    assert study.shape == (2,)
