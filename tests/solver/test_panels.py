"""Where a grid is evaluated: speeds taken together, and nodes for all vehicles or for each."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.band import Band
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum
from freqrail.model.vehicle import Vehicle
from freqrail.solver import panels, quadrature, solve
from freqrail.solver import solution as the_solution
from freqrail.solver.problem import Problem, half_vehicle_problem
from freqrail.solver.resonances import every_pole, resonances
from tests.helpers import PAPER_NAMES, from_chains, own_quadrature, reference_rms

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
TABLE = TabulatedSpectrum("measured", (1e-3, 0.1, 1e3), (3e-4, 9e-5, 1e-9))
FREQUENCY, WAVELENGTH = Band("frequency", 0.1, 100.0), Band("wavelength", 1.0, 200.0)
KMH = 1 / 3.6
WALKING = np.array([1.0, 1.5, 3, 6, 12, 40, 250, 600]) * KMH


def study(vehicle: Vehicle, speeds: np.ndarray, band: Band | None = FREQUENCY, spectrum=TRACK) -> Problem:
    return half_vehicle_problem(vehicle, speeds, spectrum, band, PAPER_NAMES)


def groups(of: Problem) -> list[np.ndarray]:
    return panels.speed_groups(of, every_pole(resonances(of.reduction, of.values, of.vehicles)))


def own_edges(of: Problem) -> np.ndarray | None:
    return panels.own_edges(of, every_pole(resonances(of.reduction, of.values)))


# --- groups of speeds --------------------------------------------------------------------------------


@pytest.mark.parametrize("band", [FREQUENCY, WAVELENGTH, Band("frequency", 5.0, 6.0), None])
def test_every_speed_is_in_one_group_whatever_the_order(paper_vehicle, band):
    speeds = np.random.default_rng(3).permutation(np.linspace(0.3, 160, 321))
    found = groups(study(paper_vehicle, speeds, band))
    assert sorted(np.concatenate(found)) == list(range(speeds.size))
    assert all(np.all(np.diff(group) > 0) for group in found)
    ranges = [(speeds[group].min(), speeds[group].max()) for group in found]
    assert all(slower[1] < faster[0] for faster, slower in itertools.pairwise(ranges))


def test_the_papers_speeds_are_one_group(paper_vehicle):
    (group,) = groups(study(paper_vehicle, np.arange(100, 301, 10) * KMH))
    assert group.tolist() == list(range(21))


def test_slow_trains_do_not_make_fast_ones_dear(paper_vehicle):
    """Lags are long at walking pace: the nodes they call for are at most twice what each speed of the group needs."""
    speeds = np.arange(1, 301) * KMH
    found = groups(study(paper_vehicle, speeds))
    assert 2 < len(found) < 9
    lag = 2 * (paper_vehicle.half_bogie_spacing + paper_vehicle.half_wheelbase) / speeds
    alone = np.array([quadrature.fewest_nodes(2 * np.pi * np.array([0.1, 100.0]), t) for t in lag])
    for group in found:
        assert alone[group].max() <= max(panels.GROUP_NODES, 2 * (alone[group].min() + quadrature.PANEL_NODES))


def test_wavelength_bands_of_many_speeds_are_cut_so_that_their_edges_stay_few(paper_vehicle):
    speeds = np.linspace(100, 300, 401) * KMH
    for group in groups(study(paper_vehicle, speeds, WAVELENGTH)):
        assert group.size < 50
    for shared in panels.shared_panels(study(paper_vehicle, speeds, WAVELENGTH)):
        assert shared.edges is not None
        assert np.all(np.isin(study(paper_vehicle, speeds[shared.speeds], WAVELENGTH).limits, shared.edges))


def test_no_group_holds_more_weights_than_memory_should(paper_vehicle):
    speeds = np.linspace(100, 300, 4001) * KMH
    found = groups(study(paper_vehicle, speeds))
    assert max(group.size for group in found) == panels.GROUP_SPEEDS
    for shared in panels.shared_panels(study(paper_vehicle, speeds)):
        assert shared.edges.size * quadrature.PANEL_NODES * shared.speeds.size < panels.SHARED_WEIGHTS


# --- numbers do not depend on the company ------------------------------------------------------------


@pytest.mark.parametrize("band", [FREQUENCY, WAVELENGTH], ids=["frequency", "wavelength"])
def test_from_walking_pace_to_600_km_h_each_speed_has_the_number_it_has_alone(paper_vehicle, band):
    many = replace(paper_vehicle, primary_joint_stiffness=np.array([1e6, 5e6, 50e6]))
    whole = solve.solve(study(many, WALKING, band))
    assert np.all(whole.status == 0)
    for k, speed in enumerate(WALKING):
        low, high = study(paper_vehicle, np.array([speed]), band).limits[:, 0]
        expected = reference_rms(many.at((1,)), TRACK, speed, low, high, transfer=from_chains, nodes=12)
        for name in PAPER_NAMES:
            error = np.abs(whole.rms[name][:, 1, k] / expected[name] - 1)
            assert np.all(error <= whole.relative_error[name][:, 1, k] + 3e-13)
            assert np.all(error < 1e-8)


def test_a_part_of_a_grid_takes_the_nodes_of_the_whole_and_so_its_bits(paper_vehicle):
    many = replace(paper_vehicle, primary_joint_stiffness=np.geomspace(1e6, 1e8, 12))
    whole = study(many, WALKING[2:])
    together = solve.solve(whole)
    part = solve.solve(
        whole.cut((slice(4, 7),)),
        nodes=panels.shared_panels(whole),
    )
    for name in PAPER_NAMES:
        assert np.array_equal(part.rms[name], together.rms[name][:, 4:7])
        assert np.array_equal(part.relative_error[name], together.relative_error[name][:, 4:7])


def test_progress_counts_every_point_of_every_group_once(paper_vehicle):
    for band in (FREQUENCY, WAVELENGTH, Band("frequency", 0.1, 300.0)):
        done: list[int] = []
        solve.solve(study(paper_vehicle, WALKING, band), progress=done.append)
        assert sum(done) == WALKING.size


def test_a_soft_joint_on_the_whole_axis_is_mended_at_every_speed(paper_vehicle):
    """The closed form owns up to an error above 1e-6 at 10 kN/m, where wheelsets ring with a damping ratio of 6e-10.

    Quadrature, group by group of the speeds, has less.
    """
    soft = replace(paper_vehicle, primary_joint_stiffness=np.array([1e4, 5e6]))
    speeds = np.array([30.0, 60.0, 100.0, 250.0]) * KMH
    solution = solve.solve(study(soft, speeds, None))
    own, closed = (the_solution.METHOD.index(name) for name in ("own_quadrature", "closed_form"))
    assert solution.method.tolist() == [[own] * 4, [closed] * 4]
    for k in range(speeds.size):
        alone = own_quadrature(study(soft, speeds[k : k + 1], None), (0,))
        for name in PAPER_NAMES:
            np.testing.assert_allclose(solution.rms[name][:, 0, k], np.sqrt(alone[name].value[:, 0]), rtol=1e-7)


# --- shared or each its own --------------------------------------------------------------------------


def test_long_vehicles_share_what_the_lags_call_for(paper_vehicle):
    """Two kilometres between the bogies: tens of thousands of nodes, the same for every vehicle of the grid."""
    long = replace(paper_vehicle, half_bogie_spacing=1e3)
    for shared in panels.shared_panels(study(long, np.arange(100, 301, 10) * KMH)):
        assert shared.edges.size * quadrature.PANEL_NODES > panels.SHARED_NODES


@pytest.mark.parametrize(("spectrum", "around"), [(TRACK, 1), (TABLE, 0)], ids=["rational", "table"])
def test_a_peak_that_might_pass_between_the_nodes_is_gone_around_or_left_to_each_vehicle(
    paper_vehicle, spectrum, around
):
    """The wheelsets' ringing near 195 Hz, on a grid too large to know every vehicle's poles.

    Where the track has a density off the axis there is a way around.
    """
    band, joints = Band("frequency", 0.1, 300.0), np.geomspace(0.5e6, 1e8, 20)
    few = replace(paper_vehicle, primary_joint_stiffness=joints)
    many = replace(few, secondary_joint_stiffness=joints[:, None])
    (shared,) = panels.shared_panels(study(few, np.array([60.0]), band, spectrum))
    assert shared.edges is not None
    (own,) = panels.shared_panels(study(many, np.array([60.0]), band, spectrum))
    assert len(own.detours) == around
    assert (own.edges is None) == (not around)
    (below,) = panels.shared_panels(study(many, np.array([60.0]), spectrum=spectrum))
    assert below.edges is not None
    assert below.detours == ()


@pytest.mark.parametrize("spectrum", [TRACK, TABLE], ids=["rational", "table"])
def test_a_peak_inside_the_band_of_any_speed_counts(paper_vehicle, spectrum):
    """Bands of wavelengths reach it at one speed or another, whatever the edges between.

    Then it is gone around, if the bands of all speeds of the group hold it, or every vehicle has nodes of its own.
    """
    joints = np.geomspace(0.5e6, 3e6, 20)
    soft = replace(paper_vehicle, primary_joint_stiffness=joints, secondary_joint_stiffness=joints[:, None])
    ways = set()
    for band in (Band("wavelength", 0.25, 10.0), Band("wavelength", 0.4, 10.0), Band("frequency", 0.1, 300.0)):
        speeds = np.array([50.0, 60.0, 90.0])
        reached = study(soft, speeds, band, spectrum).limits[1] > 2 * np.pi * 199
        for shared in panels.shared_panels(study(soft, speeds, band, spectrum)):
            around = spectrum is TRACK and bool(reached[shared.speeds].all())
            held = [each for each in shared.detours if each.holds(np.array(-1e-3 + 2j * np.pi * 195))]
            assert len(held) == len(shared.detours) == around
            assert (shared.edges is None) == (reached[shared.speeds].any() and not around)
            ways.add((shared.edges is None, around))
    assert ways == ({(False, True), (True, False)} if spectrum is TRACK else {(True, False)})


def test_vehicles_whose_sharp_peaks_are_all_elsewhere_are_better_off_alone(paper_vehicle):
    """Every one's poles are known, and nodes for all peaks would be hundreds of thousands."""
    springs = np.linspace(3e5, 3e6, 200)
    ringing = replace(paper_vehicle, primary_stiffness=springs, primary_damping=1.0, secondary_damping=1.0)
    (own,) = panels.shared_panels(study(ringing, np.array([60.0])))
    assert own.edges is None
    assert all(np.all(lost > 1e-12) for lost in own.rounding_errors.values())


def test_shared_nodes_resolve_the_longest_vehicles_lags(paper_vehicle):
    many = replace(
        paper_vehicle, half_bogie_spacing=np.array([3.0, 30.0, 9.0]), half_wheelbase=np.array([[0.8], [1.2]])
    )
    speeds = np.array([40.0, 50.0])
    (shared,) = panels.shared_panels(study(many, speeds))
    assert np.max(np.diff(shared.edges)) == pytest.approx(quadrature.PANEL_PHASE / (2 * (30 + 1.2) / 40))


@pytest.mark.parametrize("shape", [(300,), (301,), (5000,), (40, 50), (1, 1000), (7, 1, 600), (10, 10, 10)])
def test_a_sample_of_a_grid_has_its_corners_and_is_small(paper_vehicle, shape):
    axes = ("bogie_mass", "car_body_mass", "wheelset_mass")
    lengths = {
        name: np.arange(1.0, 1 + n).reshape([-1 if k == place else 1 for k in range(len(shape))])
        for place, (name, n) in enumerate(zip(axes, shape, strict=False))
    }
    whole = study(replace(paper_vehicle, **lengths), WALKING)
    sample = whole.cut(panels._sample(whole.vehicles))
    assert np.prod(sample.vehicles) <= panels.SAMPLES
    assert np.prod(sample.vehicles) >= min(panels.SAMPLES, np.prod(shape)) / 3
    for name, every in lengths.items():
        part = sample.values[name]
        assert {part.min(), part.max()} == {every.min(), every.max()}


def test_the_closed_form_needs_no_nodes(paper_vehicle):
    assert panels.shared_panels(study(paper_vehicle, WALKING, None)) == ()


def test_a_table_on_the_whole_axis_has_nodes_between_its_ends(paper_vehicle):
    table = TabulatedSpectrum("measured", (0.02, 0.1, 3.0), (3e-4, 9e-5, 1e-9))
    (shared,) = panels.shared_panels(study(paper_vehicle, np.array([50.0]), None, table))
    assert shared.edges[[0, -1]] == pytest.approx([1.0, 150.0])
    assert 5.0 in shared.edges
    (narrower,) = panels.shared_panels(study(paper_vehicle, np.array([50.0]), Band("frequency", 1.0, 10.0), table))
    assert narrower.edges[[0, -1]] == pytest.approx([2 * np.pi, 20 * np.pi])


def test_numbers_too_far_apart_have_no_nodes(paper_vehicle):
    light = replace(paper_vehicle, wheelset_mass=1e-305)
    endless = replace(paper_vehicle, half_bogie_spacing=1e300)
    twisting = replace(paper_vehicle, bogie_pitch_inertia=1e-305)
    for vehicle in (light, endless, twisting):
        with np.errstate(all="ignore"):
            assert own_edges(study(vehicle, np.array([60.0]))) is None


def test_a_rule_that_takes_too_long_is_not_begun(paper_vehicle):
    """A million nodes for one speed, but not for thirty."""
    long = replace(paper_vehicle, half_bogie_spacing=5e4)
    one, thirty = np.array([60.0]), np.linspace(60, 61, 30)
    assert own_edges(study(long, one)).size * quadrature.PANEL_NODES > 1e6
    assert own_edges(study(long, thirty)) is None
    longer = replace(long, half_bogie_spacing=1e6)
    assert own_edges(study(longer, one)) is None
