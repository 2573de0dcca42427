"""RMS values over grids: the same numbers however the grid is cut, and none where there is none."""

from __future__ import annotations

import contextlib
import itertools
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from freqrail.model.band import Band
from freqrail.model.elements import Values
from freqrail.model.equations import state_space
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum, wavenumber_psd
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import Reduction
from freqrail.solver import block_quadrature, block_residues, panels
from freqrail.solver import quadrature as solver_quadrature
from freqrail.solver import solution as the_solution
from freqrail.solver import solve as solver_solve
from freqrail.solver.problem import half_vehicle_problem
from tests.chains import FAMILIES, chain_responses, chain_system, poles, track_response
from tests.helpers import (
    ALL_NAMES,
    PAPER_NAMES,
    from_chains,
    own_quadrature,
    random_vehicles,
    reference_rms,
    residue_rms,
    whole_axis_mean_squares,
)

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
PAPER_BAND = Band("frequency", 0.1, 100.0)
RINGING = Band("frequency", 0.1, 300.0)  # with the wheelsets near 195 Hz
TABLE = TabulatedSpectrum("measured", (1e-3, 1e3), (3e-2, 3e-14))  # no density off the axis, and no kink in a band
KMH = 1 / 3.6


def solve(
    vehicle: Vehicle,
    speeds: Sequence[float],
    band: Band | None = PAPER_BAND,
    names: tuple[str, ...] = PAPER_NAMES,
    spectrum: RationalSpectrum = TRACK,
    jobs: int = 1,
) -> the_solution.Solution:
    return solver_solve.solve(
        half_vehicle_problem(vehicle, np.asarray(speeds, dtype=float), spectrum, band, names), jobs
    )


def assert_ok(solution: the_solution.Solution) -> None:
    assert np.all(solution.status == the_solution.STATUS.index("ok"))
    assert np.all(solution.method != the_solution.METHOD.index("none"))
    for values in solution.rms.values():
        assert np.all(values > 0)
    for errors in solution.relative_error.values():
        assert np.all(errors <= the_solution.TOLERANCE)


def assert_without_result(
    solution: the_solution.Solution, where: np.ndarray, status: str, names: tuple[str, ...] | None = None
) -> None:
    """The status given where `where` holds, no value and no error estimate of the responses named (all) there.

    And only there, nor of any other response; no method where no response has a value.
    """
    assert np.array_equal(solution.status == the_solution.STATUS.index(status), where)
    everything = names is None or set(names) == set(solution.rms)
    assert np.array_equal(solution.method == the_solution.METHOD.index("none"), where & everything)
    for numbers in (solution.rms, solution.relative_error):
        for name, values in numbers.items():
            lacking = where & (names is None or name in names)
            assert np.array_equal(np.isnan(values), np.broadcast_to(lacking, values.shape))


def identical(first: the_solution.Solution, second: the_solution.Solution) -> bool:
    """Bit by bit."""
    return all(
        np.array_equal(getattr(first, part)[name], getattr(second, part)[name], equal_nan=True)
        for part in ("rms", "relative_error")
        for name in first.rms
    ) and np.array_equal(first.status, second.status)


@pytest.fixture(scope="module")
def table_i(paper_vehicle: Vehicle) -> Vehicle:
    """The paper's Table I: both joints from 0.5 to 100 MN/m."""
    values = 1e6 * np.array([0.5, 1, 5, 10, 50, 100])
    return replace(paper_vehicle, primary_joint_stiffness=values[:, None], secondary_joint_stiffness=values[None, :])


@pytest.fixture(scope="module")
def corners(paper_vehicle: Vehicle) -> Vehicle:
    """Six vehicles of Table I, its corners among them."""
    soft_to_hard = 1e6 * np.array([0.5, 5, 100])
    return replace(
        paper_vehicle,
        primary_joint_stiffness=soft_to_hard[:, None],
        secondary_joint_stiffness=soft_to_hard[None, ::2],
    )


# --- a grid is its points ----------------------------------------------------------------------------


@pytest.mark.parametrize("band", [PAPER_BAND, Band("wavelength", 1.0, 120.0), Band("frequency", 0.1, 500.0), None])
def test_grid_values_are_those_of_single_points(corners, band):
    speeds = np.array([100.0, 250.0]) * KMH
    whole = solve(corners, speeds, band)
    assert_ok(whole)
    for index in np.ndindex(corners.shape):
        for k, speed in enumerate(speeds):
            alone = solve(corners.at(index), [speed], band)
            for name in PAPER_NAMES:
                found, expected = whole.rms[name][:, *index, k], alone.rms[name][:, 0]
                np.testing.assert_allclose(found, expected, rtol=1e-8)


@pytest.mark.parametrize("axis", ["half_bogie_spacing", "half_wheelbase", "car_body_mass", "contact_stiffness"])
@pytest.mark.parametrize("place", [0, 1])
def test_any_field_can_be_an_axis_lags_included(paper_vehicle, axis, place):
    """Also those that change the lags: the geometry of a block is that of its vehicles."""
    values = getattr(paper_vehicle, axis) * np.array([0.9, 1.0, 1.3])
    joints = np.array([1e6, 20e6])
    shapes = ((-1, 1), (1, -1)) if place == 0 else ((1, -1), (-1, 1))
    many = replace(
        paper_vehicle, **{axis: values.reshape(shapes[0])}, primary_joint_stiffness=joints.reshape(shapes[1])
    )
    speeds = np.array([30.0, 80.0])
    whole = solve(many, speeds, names=ALL_NAMES)
    assert_ok(whole)
    for i, value in enumerate(values):
        for j, joint in enumerate(joints):
            alone = solve(
                replace(paper_vehicle, **{axis: value}, primary_joint_stiffness=joint), speeds, names=ALL_NAMES
            )
            at = (i, j) if place == 0 else (j, i)
            for name in ALL_NAMES:
                np.testing.assert_allclose(whole.rms[name][:, *at], alone.rms[name], rtol=1e-8)
    # the axis does something
    assert np.ptp(whole.rms["bogie_acceleration"], axis=1 + place).max() > 1e-4


BANDS = [PAPER_BAND, Band("frequency", 0.1, 500.0), None]
CUTS = {1: 36, 7: 9, 20: 4, 10**9: 1}
"""Vehicles a block, and the blocks that Table I then falls into: each of 6 x 6 is at most 1 x 1, 2 x 2, 3 x 3, all."""


def in_blocks_of(
    block: int, monkeypatch: pytest.MonkeyPatch, vehicle: Vehicle, speeds: np.ndarray, band: Band | None, jobs: int = 1
) -> tuple[the_solution.Solution, int]:
    """The solution with at most `block` vehicles a block, and the number of blocks."""
    monkeypatch.setattr(solver_solve, "BLOCK", block)
    monkeypatch.setattr(solver_solve, "CLOSED_FORM_BLOCK", block * speeds.size)
    done: list[int] = []
    study = half_vehicle_problem(vehicle, speeds, TRACK, band, PAPER_NAMES)
    return solver_solve.solve(study, jobs, done.append), len(done)


def on_threads(jobs: int, monkeypatch: pytest.MonkeyPatch, vehicle: Vehicle, band: Band | None):
    """(solution of one vehicle a block, threads that stored a block); the first `jobs` blocks wait for each other.

    So it ends only if as many threads are at work at once.
    """
    barrier, count, threads, store = threading.Barrier(jobs), itertools.count(), set(), solver_solve._store

    def met(*given) -> None:
        threads.add(threading.get_ident())
        if jobs > 1 and next(count) < jobs:
            barrier.wait(timeout=60)
        store(*given)

    with monkeypatch.context() as patch:
        patch.setattr(solver_solve, "_store", met)
        solution, _ = in_blocks_of(1, patch, vehicle, np.linspace(100, 300, 5) * KMH, band, jobs)
    return solution, threads


def tilt(monkeypatch: pytest.MonkeyPatch, tilted: Callable[[Values], bool]) -> None:
    """Mean squares a bit larger for every block of which `tilted` holds."""

    def changed(original: Callable) -> Callable:
        def inner(reduction: Reduction, values: Values, *given):
            squares = original(reduction, values, *given)
            if tilted(values):
                squares = {k: replace(m, value=np.nextafter(m.value, np.inf)) for k, m in squares.items()}
            return squares

        return inner

    for module, name in ((block_quadrature, "mean_squares"), (block_residues, "whole_axis_mean_squares")):
        monkeypatch.setattr(module, name, changed(getattr(module, name)))


@pytest.mark.parametrize("jobs", [2, 3])
@pytest.mark.parametrize("band", BANDS)
def test_the_number_of_jobs_changes_no_bit(corners, monkeypatch, band, jobs):
    alone, one = on_threads(1, monkeypatch, corners, band)
    together, several = on_threads(jobs, monkeypatch, corners, band)
    assert one == {threading.get_ident()}
    assert len(several) == jobs
    assert threading.get_ident() not in several
    assert identical(alone, together)


@pytest.mark.parametrize("band", BANDS)
def test_a_bit_that_depended_on_the_thread_would_be_seen(corners, monkeypatch, band):
    tilt(monkeypatch, lambda values: threading.get_ident() != threading.main_thread().ident)
    assert not identical(*(on_threads(jobs, monkeypatch, corners, band)[0] for jobs in (1, 2)))


@pytest.mark.parametrize("band", [Band("frequency", 0.1, 500.0), None])
def test_the_size_of_blocks_changes_no_digit_that_counts(table_i, monkeypatch, band):
    """One vehicle a block, a few, or all."""
    speeds = np.linspace(100, 300, 5) * KMH
    (first, _), *others = (in_blocks_of(block, monkeypatch, table_i, speeds, band) for block in CUTS)
    assert [count for _, count in others] == list(CUTS.values())[1:]
    for other, _ in others:
        assert np.array_equal(first.status, other.status)
        for name in PAPER_NAMES:
            np.testing.assert_allclose(other.rms[name], first.rms[name], rtol=1e-14)


@pytest.mark.parametrize("band", BANDS)
@pytest.mark.parametrize("count", [1, 2, 5])
def test_the_size_of_blocks_changes_no_bit(table_i, monkeypatch, count, band):
    """docs/architecture.md: bits do not depend on the cut."""
    speeds = np.linspace(100, 300, count) * KMH
    solved = [in_blocks_of(block, monkeypatch, table_i, speeds, band) for block in CUTS]
    assert [blocks for _, blocks in solved] == list(CUTS.values())
    assert all(identical(solved[0][0], other) for other, _ in solved[1:])


@pytest.mark.parametrize("band", BANDS)
def test_rigid_joints_on_an_axis_with_others_have_the_same_bits_in_any_block(paper_vehicle, monkeypatch, band):
    """A rigid leg has a state less, which must not be felt by who is in its block."""
    joints = np.array([5e6, 1e7, np.inf])
    many = replace(paper_vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints)
    solved = [in_blocks_of(block, monkeypatch, many, np.array([30.0, 60.0]), band)[0] for block in (1, 2, 4, 9)]
    assert all(identical(solved[0], other) for other in solved[1:])


@pytest.mark.parametrize("band", BANDS)
@pytest.mark.parametrize("length", ["half_bogie_spacing", "half_wheelbase"])
def test_lengths_on_an_axis_have_the_same_bits_in_any_block(paper_vehicle, monkeypatch, length, band):
    """Where the wheels stand is a vehicle's own, whoever is in its block."""
    lengths = getattr(paper_vehicle, length) * np.array([0.9, 1.0, 1.2])
    many = replace(paper_vehicle, primary_joint_stiffness=np.array([[5e6], [1e8]]), **{length: lengths})
    solved = [in_blocks_of(block, monkeypatch, many, np.array([30.0, 60.0]), band)[0] for block in (1, 2, 6)]
    assert all(identical(solved[0], other) for other in solved[1:])


@pytest.mark.parametrize("together", [1, 5])
def test_vehicles_with_nodes_of_their_own_have_the_same_bits_in_any_company(table_i, monkeypatch, together):
    """Their resonances are found for some at a time."""
    monkeypatch.setattr(panels, "SHARED_WEIGHTS", 0)
    study = half_vehicle_problem(table_i, np.array([30.0, 60.0]), TRACK, RINGING, PAPER_NAMES)
    whole = solver_solve.solve(study)
    assert np.all(whole.method == the_solution.METHOD.index("own_quadrature"))
    assert_ok(whole)
    monkeypatch.setattr(solver_solve, "TOGETHER", together)
    assert identical(whole, solver_solve.solve(study, jobs=2))


@pytest.mark.parametrize("size", [1, 4, 9, 36])
def test_a_bit_that_depended_on_the_cut_would_be_seen(table_i, monkeypatch, size):
    """Each of the cuts alone: it is told from the others by the number of vehicles in a block."""
    tilt(monkeypatch, lambda values: np.prod(block_quadrature.shape_of(values)) == size)
    speeds = np.array([60.0])
    solutions = [in_blocks_of(block, monkeypatch, table_i, speeds, PAPER_BAND)[0] for block in CUTS]
    odd = [1, 4, 9, 36].index(size)
    same = [k for k in range(len(CUTS)) if identical(solutions[k], solutions[odd])]
    assert same == [odd]


@pytest.mark.parametrize("band", BANDS)
def test_progress_counts_every_point_once(corners, band):
    done: list[int] = []
    study = half_vehicle_problem(corners, np.array([30.0, 60.0, 80.0]), TRACK, band, PAPER_NAMES)
    solver_solve.solve(study, jobs=2, progress=done.append)
    assert sum(done) == np.prod(study.shape) == 18


def test_shapes_are_positions_then_grid_then_speeds(table_i):
    solution = solve(table_i, [30.0, 60.0, 80.0], names=ALL_NAMES)
    assert solution.status.shape == solution.method.shape == (6, 6, 3)
    for name in ALL_NAMES:
        assert solution.rms[name].shape == (len(FAMILIES[name].signs), 6, 6, 3)


# --- against other methods ---------------------------------------------------------------------------


def test_random_vehicles_in_a_band_within_their_own_error_estimates():
    rng = np.random.default_rng(8)
    for vehicle in random_vehicles(30, seed=41, joints=(5e6, 100e6)):
        speed = rng.uniform(10, 90)
        low = float(np.exp(rng.uniform(np.log(0.02), np.log(20))))
        high = low * float(np.exp(rng.uniform(0.1, 5)))
        solution = solve(vehicle, [speed], Band("frequency", low, high), ALL_NAMES)
        assert_ok(solution)
        expected = reference_rms(
            vehicle, TRACK, speed, 2 * np.pi * low, 2 * np.pi * high, ALL_NAMES, transfer=from_chains
        )
        for name in ALL_NAMES:
            error = np.abs(solution.rms[name][:, 0] / expected[name] - 1)
            assert np.all(error <= solution.relative_error[name][:, 0] + 3e-13)


def test_estimates_of_a_grid_are_never_below_its_errors(monkeypatch):
    """With panels twice too long there is an error to estimate; what is passed on covers it."""
    monkeypatch.setattr(solver_quadrature, "POLE_DISTANCE", 2 * solver_quadrature.POLE_DISTANCE)
    monkeypatch.setattr(solver_solve, "REFINE_ABOVE", np.inf)
    monkeypatch.setattr(solver_solve, "TOLERANCE", 1.0)
    speeds, largest = np.array([20.0, 70.0]), 0.0
    for vehicle in random_vehicles(10, seed=71, joints=(2e6, 100e6)):
        solution = solve(vehicle, speeds)
        for k, speed in enumerate(speeds):
            expected = reference_rms(vehicle, TRACK, speed, 0.2 * np.pi, 200 * np.pi, transfer=from_chains)
            for name in PAPER_NAMES:
                error = np.abs(solution.rms[name][:, k] / expected[name] - 1)
                assert np.all(error <= solution.relative_error[name][:, k])
                largest = max(largest, error.max())
    assert largest > 1e-9


def test_the_whole_axis_agrees_with_residues_of_the_assembled_system(paper_vehicle):
    """Closed form over the poles of the 26 states, wheel by wheel: no frequency and no chain in it."""
    vehicles = [paper_vehicle, *random_vehicles(8, seed=51)]
    for k, vehicle in enumerate(vehicles):
        vehicle = vehicle.traditional() if k == 1 else vehicle
        for speed in (40 * KMH, 250 * KMH):
            solution = solve(vehicle, [speed], None)
            assert_ok(solution)
            expected = residue_rms(vehicle, TRACK, speed)
            for name in PAPER_NAMES:
                np.testing.assert_allclose(solution.rms[name][:, 0], expected[name], rtol=1e-6)


def test_the_whole_axis_agrees_with_a_lyapunov_equation_where_there_are_no_lags(paper_vehicle):
    """Shrunk to a point, with its pitch inertias, the vehicle has no lags: white noise through track and vehicle."""
    size, speed = 1e-6, 70.0
    point = replace(
        paper_vehicle,
        half_bogie_spacing=size * paper_vehicle.half_bogie_spacing,
        half_wheelbase=size * paper_vehicle.half_wheelbase,
        car_body_pitch_inertia=size**2 * paper_vehicle.car_body_pitch_inertia,
        bogie_pitch_inertia=size**2 * paper_vehicle.bogie_pitch_inertia,
    )
    # the bounce of all wheels together, in the 8 states of its chain; track: v = F w, |F|^2 = pi G for unit white noise
    model = state_space(chain_system(point, "bounce"))
    omega_r, omega_c = speed * np.array(TRACK.cutoffs)
    gain = np.sqrt(np.pi * TRACK.roughness * TRACK.cutoffs[1] ** 2 * speed**3)
    n = model.a.shape[0]
    a, b = np.zeros((n + 2, n + 2)), np.zeros((n + 2, 1))
    a[:n, :n], a[:n, n:][:, :1] = model.a, model.b
    a[n, n], a[n, n + 1], a[n + 1, n + 1] = -omega_r, 1.0, -omega_c
    b[n + 1] = gain
    covariance = solve_continuous_lyapunov(a, -b @ b.T)
    car, bogie, wheelset = n - 3, n - 2, n - 1
    rows = {
        "car_body_acceleration": a[0],
        "bogie_acceleration": a[1],
        "secondary_stroke": np.eye(n + 2)[car] - np.eye(n + 2)[bogie],
        "primary_stroke": np.eye(n + 2)[bogie] - np.eye(n + 2)[wheelset],
    }
    solution = solve(point, [speed], None)
    assert_ok(solution)
    for name, row in rows.items():
        np.testing.assert_allclose(solution.rms[name][:, 0], np.sqrt(row @ covariance @ row), rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "speed"),
    [
        ({"primary_joint_stiffness": 17.28626e6}, 250 * KMH),
        ({"secondary_joint_stiffness": 69.82e6}, 250 * KMH),
        ({}, 77.84414 * KMH),
        ({"primary_joint_stiffness": 1e14, "secondary_joint_stiffness": 1e14}, 250 * KMH),
    ],
    ids=["two bogie poles merge", "two car poles merge", "a vehicle pole on a track pole", "nearly rigid joints"],
)
def test_the_whole_axis_where_residues_break(paper_vehicle, change, speed):
    """docs/theory.md, "What keeps the digits": critical damping, a pole on the track's, stiff finite joints."""
    vehicle = replace(paper_vehicle, **change)
    solution = solve(vehicle, [speed], None)
    assert_ok(solution)
    # beyond 10 kHz, 50 times the wheelsets' resonance, is less than 1e-8 of any of the paper's four
    low, high = 1e-6, 2 * np.pi * 1e4
    expected = reference_rms(vehicle, TRACK, speed, low, high, transfer=from_chains, nodes=12)
    for name in PAPER_NAMES:
        np.testing.assert_allclose(solution.rms[name][:, 0], expected[name], rtol=1e-6)


@pytest.mark.parametrize(
    "joints",
    [
        (1e7, 1e10),
        (1e10, 1e14),
    ],
    ids=["up to 1e10 N/m", "up to 1e14 N/m"],
)
def test_the_whole_axis_of_random_vehicles_on_stiff_joints(joints):
    """From Table I's stiffest to what a user may type for rigid: the closed form against quadrature."""
    rng = np.random.default_rng(77)
    for vehicle in random_vehicles(30, seed=77, joints=joints):
        speed = rng.uniform(10, 150)
        solution = solve(vehicle, [speed], None)
        assert_ok(solution)
        expected = reference_rms(vehicle, TRACK, speed, 1e-6, 2 * np.pi * 1e4, transfer=from_chains, nodes=12)
        for name in PAPER_NAMES:
            np.testing.assert_allclose(solution.rms[name][:, 0], expected[name], rtol=1e-6)


def test_all_responses_have_a_value_on_the_whole_axis(paper_vehicle):
    """Also the wheelsets, whose acceleration tends to K_H/M_w per metre instead of vanishing at high frequency."""
    vehicle, speeds = paper_vehicle.traditional(), [50 * KMH, 250 * KMH]
    solution = solve(vehicle, speeds, None, ALL_NAMES)
    assert_ok(solution)
    for k, speed in enumerate(speeds):
        expected = residue_rms(vehicle, TRACK, speed)
        for name in ALL_NAMES:
            np.testing.assert_allclose(solution.rms[name][:, k], expected[name], rtol=1e-6)


@pytest.mark.parametrize("speed", [100.0, 365.0])
def test_the_whole_axis_error_estimate_covers_what_is_left_out(speed):
    """A value whose nodes end somewhere owns up to the tail beyond them, whichever way it was computed."""
    for vehicle in random_vehicles(6, seed=61, joints=(20e6, 100e6)):
        solution = solve(vehicle, [speed * KMH], None, ("wheelset_acceleration",))
        expected = residue_rms(vehicle, TRACK, speed * KMH)["wheelset_acceleration"]
        error = np.abs(solution.rms["wheelset_acceleration"][:, 0] / expected - 1)
        assert np.all(error <= solution.relative_error["wheelset_acceleration"][:, 0] + 1e-10)


# --- scaling -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("band", [PAPER_BAND, None])
def test_rms_grows_with_the_root_of_the_roughness(paper_vehicle, band):
    rougher = replace(TRACK, roughness=9 * TRACK.roughness)
    smooth, rough = (solve(paper_vehicle, [60.0], band, ALL_NAMES[:4], track) for track in (TRACK, rougher))
    for name in PAPER_NAMES:
        np.testing.assert_allclose(rough.rms[name], 3 * smooth.rms[name], rtol=1e-12)


@pytest.mark.parametrize("band", [PAPER_BAND, None])
def test_a_larger_vehicle_on_a_longer_track_run_faster_is_the_same_vehicle(paper_vehicle, band):
    """Lengths and speed times s, pitch inertias times s^2, wavenumbers over s, and the same G(omega): angles over s."""
    s = 1.7
    larger = replace(
        paper_vehicle,
        half_bogie_spacing=s * paper_vehicle.half_bogie_spacing,
        half_wheelbase=s * paper_vehicle.half_wheelbase,
        car_body_pitch_inertia=s**2 * paper_vehicle.car_body_pitch_inertia,
        bogie_pitch_inertia=s**2 * paper_vehicle.bogie_pitch_inertia,
    )
    longer = RationalSpectrum("rational", TRACK.roughness / s, (TRACK.cutoffs[0] / s, TRACK.cutoffs[1] / s))
    names = tuple(name for name in ALL_NAMES if name != "wheelset_acceleration")
    small = solve(paper_vehicle, [60.0], band, names)
    large = solve(larger, [s * 60.0], band, names, longer)
    assert_ok(small)
    for name in names:
        factor = s if "pitch" in name else 1.0
        np.testing.assert_allclose(factor * large.rms[name], small.rms[name], rtol=1e-8)


def test_a_band_adds_to_its_neighbour(paper_vehicle):
    """Mean squares of two bands that share an edge add up to that of both, exactly at a resonance too."""
    edge = float(np.max(poles(paper_vehicle).imag)) / (2 * np.pi)
    bands = [Band("frequency", 0.1, edge), Band("frequency", edge, 400.0), Band("frequency", 0.1, 400.0)]
    low, high, both = (solve(paper_vehicle, [60.0], band) for band in bands)
    for name in PAPER_NAMES:
        np.testing.assert_allclose(low.rms[name] ** 2 + high.rms[name] ** 2, both.rms[name] ** 2, rtol=1e-9)


# --- no silent numbers -------------------------------------------------------------------------------


PITCHED = ("primary_stroke", "wheelset_acceleration", "bogie_pitch_acceleration")
"""The responses that feel the bogies pitch."""


@pytest.mark.parametrize("band", [None, PAPER_BAND])
def test_without_primary_dampers_the_bogies_pitch_for_ever(paper_vehicle, band):
    """The bogie's pitch is held by the primary suspension alone: undamped, what feels it has no variance."""
    undamped = replace(paper_vehicle, primary_damping=0.0)
    solution = solve(undamped, [30.0, 60.0], band, ALL_NAMES)
    assert np.all(solution.status == the_solution.STATUS.index("undamped"))
    assert all(np.isnan(solution.rms[name]).all() for name in PITCHED)
    calm = tuple(name for name in ALL_NAMES if name not in PITCHED)
    alone = solve(undamped, [30.0, 60.0], band, calm)
    for name in calm:
        np.testing.assert_allclose(solution.rms[name], alone.rms[name], rtol=1e-8)
    if band:  # the whole axis takes in wheelsets that ring too long
        assert_ok(alone)
        assert_without_result(solution, np.array([True, True]), "undamped", PITCHED)


def test_without_any_damper_no_response_has_a_value(paper_vehicle):
    undamped = replace(paper_vehicle, primary_damping=0.0, secondary_damping=0.0)
    for band in (None, PAPER_BAND):
        assert_without_result(solve(undamped, [60.0], band, ALL_NAMES), np.array([True]), "undamped")


def test_a_band_without_the_undamped_resonance_has_a_value(paper_vehicle):
    undamped = replace(paper_vehicle, primary_damping=0.0)
    resonances = np.abs(np.linalg.eigvals(state_space(chain_system(undamped, "bogie_pitch")).a).imag) / (2 * np.pi)
    band = Band("frequency", 1.2 * resonances.min(), 100.0)
    assert not np.any((resonances > band.low) & (resonances < band.high))
    solution = solve(undamped, [60.0], band)
    assert_ok(solution)
    expected = reference_rms(undamped, TRACK, 60.0, 2 * np.pi * band.low, 2 * np.pi * band.high)
    for name in PAPER_NAMES:
        np.testing.assert_allclose(solution.rms[name][:, 0], expected[name], rtol=1e-8)


def test_a_wavelength_band_meets_the_undamped_resonance_at_some_speeds_only(paper_vehicle):
    undamped = replace(paper_vehicle, primary_damping=0.0)
    resonance = np.min(np.abs(np.linalg.eigvals(state_space(chain_system(undamped, "bogie_pitch")).a).imag))
    frequency = resonance / (2 * np.pi)
    band = Band("wavelength", 3.0, 25.0)
    speeds = frequency * np.array([2.0, 10.0, 40.0])  # passes waves of 2, 10 and 40 m at the resonance
    strokes = ("primary_stroke",)
    assert_without_result(solve(undamped, speeds, band), np.array([False, True, False]), "undamped", strokes)


def test_only_the_undamped_vehicles_of_a_grid_lack_a_value(paper_vehicle):
    many = replace(paper_vehicle, primary_damping=np.array([0.0, 5e3, 17e3]))
    solution = solve(many, [30.0, 60.0])
    where = np.array([[True, True], [False, False], [False, False]])
    assert_without_result(solution, where, "undamped", ("primary_stroke",))


def test_a_promise_that_cannot_be_kept_leaves_no_number(corners, monkeypatch):
    monkeypatch.setattr(solver_solve, "TOLERANCE", 1e-30)
    for band in (PAPER_BAND, None):
        assert_without_result(solve(corners, [60.0], band), np.full((3, 2, 1), True), "unresolved_peak")


def test_a_vehicle_that_overflows_fails_and_its_neighbour_does_not(paper_vehicle):
    """A mass that a user may type, and whose inverse is beyond double precision."""
    many = replace(paper_vehicle, wheelset_mass=np.array([1e-305, 700.0]))
    with np.errstate(all="ignore"):
        solution = solve(many, [60.0])
    assert_without_result(solution, np.array([[True], [False]]), "failed")


@pytest.mark.parametrize(
    "band",
    [
        PAPER_BAND,
        None,
    ],
)
def test_a_single_vehicle_that_overflows_fails_and_raises_nothing(paper_vehicle, band):
    with np.errstate(all="ignore"):
        solution = solve(replace(paper_vehicle, wheelset_mass=1e-305), [60.0], band)
    assert_without_result(solution, np.array([True]), "failed")


def test_a_root_has_half_the_relative_error_of_its_square():
    root, error = solver_solve._root(solver_quadrature.MeanSquare(np.array([4.0]), np.array([0.04])))
    assert root == [2.0]
    assert error == [0.005]


def test_responses_do_not_care_for_a_block_that_they_are_no_part_of(paper_vehicle):
    """Without primary dampers the bogies pitch for ever, which neither the car body nor the bogies' centres feel."""
    undamped = replace(paper_vehicle, primary_damping=np.array([0.0, 17e3]))
    names = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke")
    solution = solve(undamped, [60.0], PAPER_BAND, names)
    assert_ok(solution)
    expected = reference_rms(undamped.at((0,)), TRACK, 60.0, 0.2 * np.pi, 200 * np.pi, names, transfer=from_chains)
    for name in names:
        np.testing.assert_allclose(solution.rms[name][:, 0, 0], expected[name], rtol=1e-8)
    with_pitch = solve(undamped, [60.0], PAPER_BAND, ("bogie_acceleration", "primary_stroke"))
    assert_without_result(with_pitch, np.array([[True], [False]]), "undamped", ("primary_stroke",))


def test_one_number_that_the_closed_form_doubts_is_tried_by_quadrature(paper_vehicle, monkeypatch):
    closed = block_residues.whole_axis_mean_squares

    def doubtful(*given):
        squares = closed(*given)
        squares["primary_stroke"].error[1, 0, 2] = squares["primary_stroke"].value[1, 0, 2]
        return squares

    many = replace(paper_vehicle, bogie_mass=np.array([600.0, 700.0]))
    good = solve(many, [30.0, 60.0, 80.0], None)
    monkeypatch.setattr(block_residues, "whole_axis_mean_squares", doubtful)
    mended = solve(many, [30.0, 60.0, 80.0], None)
    assert_ok(mended)
    assert mended.method[0, 2] == the_solution.METHOD.index("own_quadrature")
    assert np.all(mended.method[1] == the_solution.METHOD.index("closed_form"))
    for name in PAPER_NAMES:
        np.testing.assert_allclose(mended.rms[name], good.rms[name], rtol=1e-8)


def test_each_response_takes_the_better_of_closed_form_and_quadrature(paper_vehicle, monkeypatch):
    """Where either is good for one response and not for the other, both have numbers."""
    names = ("bogie_acceleration", "primary_stroke")
    closed, own = block_residues.whole_axis_mean_squares, solver_solve._own_quadrature

    def doubtful(*given):
        squares = closed(*given)
        bogie = squares["bogie_acceleration"]
        return squares | {"bogie_acceleration": solver_quadrature.MeanSquare(2 * bogie.value, bogie.value)}

    def lost(*given):
        squares = own(*given)
        return squares | {
            "primary_stroke": solver_quadrature.MeanSquare(
                *(np.nan * x for x in vars(squares["primary_stroke"]).values())
            )
        }

    good = solve(paper_vehicle, [30.0, 60.0], None, names)
    monkeypatch.setattr(block_residues, "whole_axis_mean_squares", doubtful)
    monkeypatch.setattr(solver_solve, "_own_quadrature", lost)
    mended = solve(paper_vehicle, [30.0, 60.0], None, names)
    assert np.all(mended.method == the_solution.METHOD.index("own_quadrature"))
    np.testing.assert_allclose(mended.rms["bogie_acceleration"], good.rms["bogie_acceleration"], rtol=1e-8)
    assert np.array_equal(mended.rms["primary_stroke"], good.rms["primary_stroke"])


@pytest.mark.parametrize(
    ("band", "spectrum", "parts"),
    [
        (None, TRACK, 8),  # 1,000 vehicles at 100 speeds: 5 x 5 x 5 vehicles a block
        (PAPER_BAND, TRACK, 10),  # 5 x 5 x 4
        (RINGING, TRACK, 10),
        (RINGING, TABLE, 1000),  # a vehicle at a time
    ],
)
def test_the_time_of_a_sweep_is_that_of_its_first_block_times_the_blocks(
    paper_vehicle, monkeypatch, band, spectrum, parts
):
    monkeypatch.setattr(solver_solve, "_timed", lambda task: task() is None or 6.0)
    joints = np.geomspace(1e6, 1e8, 10)
    many = replace(
        paper_vehicle,
        primary_joint_stiffness=joints[:, None, None],
        secondary_joint_stiffness=joints[:, None],
        bogie_mass=np.linspace(500, 700, 10),
    )
    study = half_vehicle_problem(many, np.linspace(30, 80, 100), spectrum, band, PAPER_NAMES)
    assert solver_solve.seconds(study) == 6.0 * parts
    assert solver_solve.seconds(study, jobs=3) == 2.0 * parts


@pytest.mark.parametrize(("value", "error", "status"), [(1.0, 1e-3, "unresolved_peak"), (np.nan, np.nan, "failed")])
def test_a_point_is_ok_only_if_every_position_of_every_response_is(paper_vehicle, monkeypatch, value, error, status):
    """One of six numbers at one speed that cannot be promised is NaN, and the point's status tells; the rest stays."""
    names, closed, own = (
        ("bogie_acceleration", "primary_stroke"),
        block_residues.whole_axis_mean_squares,
        solver_solve._own_quadrature,
    )

    def spoiled(squares, at):
        squares["primary_stroke"].value[at] *= value
        squares["primary_stroke"].error[at] = error
        return squares

    monkeypatch.setattr(block_residues, "whole_axis_mean_squares", lambda *given: spoiled(closed(*given), (2, ..., 1)))
    monkeypatch.setattr(solver_solve, "_own_quadrature", lambda *given: spoiled(own(*given), (2,)))
    many = replace(paper_vehicle, bogie_mass=np.array([500.0, 600.0]))
    solution = solve(many, [30.0, 60.0, 80.0], None, names)
    where = np.array([[False, True, False]] * 2)
    assert np.array_equal(solution.status == the_solution.STATUS.index(status), where)
    assert np.all(solution.method != the_solution.METHOD.index("none"))
    for numbers in (solution.rms, solution.relative_error):
        lacking = np.isnan(numbers["primary_stroke"])
        assert np.array_equal(lacking[2], where)
        assert np.count_nonzero(lacking) == np.count_nonzero(where)
        assert not np.isnan(numbers["bogie_acceleration"]).any()


def test_a_response_that_lacks_one_position_has_a_method_all_the_same(paper_vehicle, monkeypatch):
    quadrature = block_quadrature.mean_squares

    def spoiled(*given):
        squares = quadrature(*given)
        squares["primary_stroke"].value[2] = np.nan
        return squares

    monkeypatch.setattr(block_quadrature, "mean_squares", spoiled)
    solution = solve(paper_vehicle, [60.0], names=("primary_stroke",))
    assert np.isnan(solution.rms["primary_stroke"][:, 0]).tolist() == [False, False, True, False]
    assert solution.method.tolist() == [the_solution.METHOD.index("own_quadrature")]


def test_a_vehicle_that_shared_nodes_serve_badly_anywhere_gets_its_own(paper_vehicle, monkeypatch):
    quadrature = block_quadrature.mean_squares

    def doubtful(reduction, values, nodes, lost):
        squares = quadrature(reduction, values, nodes, lost)
        if block_quadrature.shape_of(values):  # together
            squares["primary_stroke"].error[3, 1, 2] = 1e-3 * squares["primary_stroke"].value[3, 1, 2]
        return squares

    many = replace(paper_vehicle, bogie_mass=np.array([500.0, 600.0, 700.0]))
    monkeypatch.setattr(solver_solve, "REFINE_ABOVE", 1e-6)
    good = solve(many, [30.0, 60.0, 80.0])
    monkeypatch.setattr(block_quadrature, "mean_squares", doubtful)
    mended = solve(many, [30.0, 60.0, 80.0])
    shared, own = (the_solution.METHOD.index(f"{kind}_quadrature") for kind in ("shared", "own"))
    assert mended.method.tolist() == [[shared] * 3, [own] * 3, [shared] * 3]
    for name in PAPER_NAMES:
        np.testing.assert_allclose(mended.rms[name], good.rms[name], rtol=1e-7)
        assert np.all(mended.relative_error[name] < 1e-6)


def test_quadrature_on_the_whole_axis_owns_up_to_the_tail(paper_vehicle):
    """The wheelsets' acceleration has one: the bound is not below what is missing, nor a hundred times above it."""
    vehicle, names = paper_vehicle.traditional(), ("wheelset_acceleration",)
    study = half_vehicle_problem(vehicle, np.array([30.0, 60.0]), TRACK, None, names)
    exact = whole_axis_mean_squares(vehicle, names, TRACK, study.speed)[names[0]].value
    own = own_quadrature(study)[names[0]]
    missing = exact - own.value
    assert np.all(missing > 0)
    assert np.all(missing < own.error)
    assert np.all(missing > own.error / 100)


def test_after_a_fault_no_more_is_begun():
    begun: list[int] = []

    def task(item: int) -> None:
        begun.append(item)
        if item == 0:
            raise ZeroDivisionError
        time.sleep(0.05)

    with pytest.raises(ZeroDivisionError):
        solver_solve._run(task, list(range(200)), 2)
    assert len(begun) < 100


def test_a_task_takes_time():
    assert 0.02 <= solver_solve._timed(lambda: time.sleep(0.02)) < 60


@pytest.mark.parametrize("jobs", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 2, 7])
def test_every_item_is_done_once_and_a_fault_is_not_lost(jobs, count):
    done: list[int] = []
    solver_solve._run(done.append, list(range(count)), jobs)
    assert sorted(done) == list(range(count))

    def fault(item: int) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError) if count else contextlib.nullcontext():
        solver_solve._run(fault, list(range(count)), jobs)


def test_fields_broadcast_as_arrays_do(paper_vehicle):
    """`Vehicle` promises no more than that: a row of [3] beside a column of [2, 1]."""
    row, column = 1e6 * np.array([1.0, 5.0, 10.0]), 1e6 * np.array([[2.0], [20.0]])
    short = replace(paper_vehicle, primary_joint_stiffness=row, secondary_joint_stiffness=column)
    full = replace(paper_vehicle, primary_joint_stiffness=row[None], secondary_joint_stiffness=column)
    assert short.shape == (2, 3)
    assert identical(solve(short, [60.0]), solve(full, [60.0]))


def test_a_spectrum_is_repeated_along_axes_that_its_response_does_not_feel(paper_vehicle):
    """The car body does not feel the bogies' pitch."""
    many = replace(paper_vehicle, bogie_pitch_inertia=np.linspace(600, 900, 4))
    names, frequency = ("car_body_acceleration", "primary_stroke"), np.array([1.0, 5.0])
    found = solver_solve.psd(half_vehicle_problem(many, np.array([60.0]), TRACK, PAPER_BAND, names), frequency)
    for index in np.ndindex(many.shape):
        alone = solver_solve.psd(
            half_vehicle_problem(many.at(index), np.array([60.0]), TRACK, PAPER_BAND, names), frequency
        )
        for name in names:
            np.testing.assert_allclose(found[name][:, *index], alone[name], rtol=1e-12)


def test_every_field_of_a_vehicle_may_be_an_array(paper_vehicle):
    """`shape` and `at` treat all fields alike."""
    for field in fields(Vehicle):
        many = replace(paper_vehicle, **{field.name: getattr(paper_vehicle, field.name) * np.array([1.0, 2.0, 3.0])})
        assert many.shape == (3,)
        expected = replace(paper_vehicle, **{field.name: 2.0 * getattr(paper_vehicle, field.name)})
        assert many.at((1,)) == expected


def test_a_tabulated_spectrum_is_integrated_between_its_kinks(paper_vehicle):
    """Coarse enough for its kinks to matter: against panels that know of nothing but the kinks."""
    points, values = np.array([0.02, 0.1, 0.6, 2.5, 8.0]), np.array([3e-4, 9e-5, 2e-7, 6e-9, 1e-10])
    table = TabulatedSpectrum("measured", tuple(points), tuple(values))
    speed, names = 180 * KMH, ("car_body_acceleration", "primary_stroke")
    solution = solver_solve.solve(half_vehicle_problem(paper_vehicle, np.array([speed]), table, None, names))
    assert np.all(solution.status == 0)
    x, w = np.polynomial.legendre.leggauss(400)
    ends = points * speed
    for name in names:
        total = 0.0
        for low, high in itertools.pairwise(ends):
            omega = (low + high) / 2 + (high - low) / 2 * x
            series, chains = FAMILIES[name], chain_responses(paper_vehicle, omega)
            transfer = track_response(series, paper_vehicle, omega, speed, chains)
            total = total + np.abs(transfer) ** 2 @ (
                w * (high - low) / 2 * wavenumber_psd(table, omega / speed) / speed
            )
        assert solution.rms[name][:, 0] == pytest.approx(np.sqrt(total), rel=1e-9, abs=0)
