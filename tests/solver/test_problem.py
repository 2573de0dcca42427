"""A grid as numbers: its bands, and parts that together are the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.band import Band
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum
from freqrail.solver.problem import half_vehicle_problem, cells, cells_by_geometry, cut

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
TABLE = TabulatedSpectrum("measured", (0.1, 1.0, 4.0), (1e-4, 1e-6, 1e-9))
SPEEDS = np.array([10.0, 50.0])


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
    study = half_vehicle_problem(many, SPEEDS, TRACK, None, ())
    assert study.shape == (4, 3, 2)
    assert study.points == 24
    assert replace(study, vehicle=paper_vehicle).shape == (2,)


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
    """Fields keep what they do not vary along: a number stays a number, an axis of length 1 its length."""
    many = replace(
        paper_vehicle,
        bogie_mass=np.arange(1.0, 5.0)[:, None],
        car_body_mass=np.arange(1.0, 4.0),
        wheelset_mass=np.array([[7.0]]),
    )
    cell = (slice(1, 3), slice(2, 3))
    part = cut(many, cell)
    assert part.shape == (2, 1)
    assert part.bogie_mass.tolist() == [[2], [3]]
    assert part.car_body_mass.tolist() == [[3]]
    assert part.wheelset_mass.tolist() == [[7]]
    assert part.primary_stiffness == paper_vehicle.primary_stiffness
    assert np.ndim(part.primary_stiffness) == 0
    for index in np.ndindex(part.shape):
        assert part.at(index) == many.at((index[0] + 1, index[1] + 2))


def test_an_axis_of_two_is_cut_like_any_other(paper_vehicle):
    two = replace(paper_vehicle, bogie_mass=np.array([500.0, 600.0]))
    assert [cut(two, cell).bogie_mass.tolist() for cell in cells(two.shape, 1)] == [[500], [600]]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("name", ["half_bogie_spacing", "half_wheelbase"])
def test_vehicles_of_a_block_have_one_geometry(paper_vehicle, name, axis):
    """Wherever the axis stands that changes it, also where arrays are shorter than the grid has axes."""
    shape = (4, 2, 5)
    lengths = np.arange(1.0, 1 + shape[axis]).reshape(-1, *(1,) * (2 - axis))
    many = replace(
        paper_vehicle, bogie_mass=np.ones((4, 1, 1)), car_body_mass=np.ones((2, 1)), wheelset_mass=np.ones(5)
    )
    many = replace(many, **{name: lengths})
    count, geometries = np.zeros(shape, int), 0
    for geometry, parts in cells_by_geometry(many, 6):
        geometries += 1
        for cell in parts:
            count[cell] += 1
            assert count[cell].size <= 6
            part = np.unique(getattr(cut(many, cell), name))
            assert part.tolist() == [getattr(many.at(geometry), name)]
    assert np.all(count == 1)
    assert geometries == shape[axis]


def test_one_geometry_is_one_group_of_blocks(paper_vehicle):
    many = replace(paper_vehicle, bogie_mass=np.ones((4, 1)), car_body_mass=np.ones(3))
    ((geometry, parts),) = cells_by_geometry(many, 100)
    assert geometry == (0, 0)
    assert parts == [(slice(0, 4), slice(0, 3))]
