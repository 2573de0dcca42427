"""What the physics and docs/architecture.md promise of every vehicle, track and grid, not of chosen ones.

Vehicles are drawn around the paper's, a factor of three to each side, joints over Table I's range and rigid ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import freqrail
from freqrail.model.band import Band
from freqrail.model.equations import system_response
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.vehicle import Vehicle, half_vehicle
from freqrail.solver import solution
from freqrail.solver import solve as solver_solve
from freqrail.solver.problem import cells, half_vehicle_problem
from tests.chains import FAMILIES, chain_responses, poles, track_response
from tests.helpers import ALL_NAMES, INDEX, random_vehicle

EXAMPLES = settings(deadline=None, derandomize=True, database=None, max_examples=15)
FEW = settings(EXAMPLES, max_examples=8)

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
BANDS = (Band("frequency", 0.1, 100.0), Band("frequency", 2.0, 9.0), Band("wavelength", 1.0, 60.0), None)


@st.composite
def vehicles(draw: st.DrawFn) -> Vehicle:
    vehicle = random_vehicle(np.random.default_rng(draw(st.integers(0, 10**6))))
    rigid = draw(st.sampled_from([(), ("primary",), ("secondary",), ("primary", "secondary")]))
    return replace(vehicle, **{f"{stage}_joint_stiffness": np.inf for stage in rigid})


speeds = st.floats(8.0, 150.0)
bands = st.sampled_from(BANDS)


def solve(vehicle: Vehicle, speed: object, band: Band | None, track: RationalSpectrum = TRACK, **options: int):
    return solver_solve.solve(half_vehicle_problem(vehicle, np.atleast_1d(speed), track, band, ALL_NAMES), **options)


def same_bits(one: solution.Solution, other: solution.Solution) -> bool:
    return all(
        np.array_equal(getattr(one, key)[name], getattr(other, key)[name], equal_nan=True)
        for key in ("rms", "relative_error")
        for name in ALL_NAMES
    ) and bool(np.all(one.status == other.status) and np.all(one.method == other.method))


# --- the vehicle -----------------------------------------------------------------------------------


@EXAMPLES
@given(vehicles(), st.floats(0.05, 400.0))
def test_reciprocity(vehicle, frequency):
    """A force on one body moves another as a force on that one moves it: springs from all bodies to feet, and back."""
    system = half_vehicle(vehicle)
    feet = [(place, 1e5 * (1 + place)) for place in INDEX.values()]
    stood = replace(system, contacts=(*system.contacts, *feet))
    places = [place for place, _ in stood.contacts]
    springs = np.array([spring for _, spring in stood.contacts])
    receptance = system_response(stood, 2 * np.pi * np.array([frequency]))[0][places] / springs
    size = np.sqrt(np.abs(np.outer(receptance.diagonal(), receptance.diagonal())))
    assert np.max(np.abs(receptance - receptance.T) / size) < 1e-9


@EXAMPLES
@given(vehicles(), st.floats(0.05, 400.0), st.integers(0, 10**6))
def test_passivity(vehicle, frequency, seed):
    """Whatever the heights of the wheels: the rail never gets more power back than it puts in; all modes decay."""
    omega = 2 * np.pi * np.array([frequency])
    system = half_vehicle(vehicle)
    wheels = [wheel for wheel, _ in system.contacts]
    force = vehicle.contact_stiffness * (np.eye(4) - system_response(system, omega)[0][wheels])
    heights = np.random.default_rng(seed).normal(size=(50, 4, 2)) @ [1, 1j]
    power = np.real(np.einsum("ni,ij,nj->n", np.conj(1j * omega * heights), force, heights)) / 2
    rounding = 1e-13 * vehicle.contact_stiffness * omega * np.sum(np.abs(heights) ** 2, axis=1)
    assert np.all(power > -rounding)
    assert np.all(poles(vehicle).real < 0)


@EXAMPLES
@given(vehicles(), speeds, st.floats(0.05, 400.0))
def test_the_front_of_a_vehicle_is_the_rear_of_one_that_runs_backwards(vehicle, speed, frequency):
    omega = 2 * np.pi * np.array([frequency])
    chains = chain_responses(vehicle, omega)
    for name in ("car_body_acceleration", "bogie_acceleration", "secondary_stroke"):
        ahead, back = (np.abs(track_response(FAMILIES[name], vehicle, omega, v, chains)) for v in (speed, -speed))
        np.testing.assert_allclose(ahead, back[::-1], rtol=1e-9, atol=1e-12 * ahead.max())
    for name in ("primary_stroke", "wheelset_acceleration"):
        ahead, back = (np.abs(track_response(FAMILIES[name], vehicle, omega, v, chains)) for v in (speed, -speed))
        np.testing.assert_allclose(ahead, back[::-1], rtol=1e-9, atol=1e-12 * ahead.max())


# --- RMS values ------------------------------------------------------------------------------------


@EXAMPLES
@given(vehicles(), speeds, bands, st.floats(1e-3, 1e3))
def test_rms_grows_with_the_root_of_the_roughness(vehicle, speed, band, factor):
    once = solve(vehicle, speed, band)
    rough = solve(vehicle, speed, band, replace(TRACK, roughness=factor * TRACK.roughness))
    assert np.array_equal(once.status, rough.status)
    for name in ALL_NAMES:
        np.testing.assert_allclose(rough.rms[name], np.sqrt(factor) * once.rms[name], rtol=1e-12)


@EXAMPLES
@given(vehicles(), speeds, bands, st.floats(0.3, 3.0))
def test_geometry_and_speed_scaled_together_leave_the_lags_and_the_rms_alone(vehicle, speed, band, scale):
    """Lengths and speed times s, pitch inertias times s^2, wavelengths of track and band times s: angles over s."""
    larger = replace(
        vehicle,
        half_bogie_spacing=scale * vehicle.half_bogie_spacing,
        half_wheelbase=scale * vehicle.half_wheelbase,
        car_body_pitch_inertia=scale**2 * vehicle.car_body_pitch_inertia,
        bogie_pitch_inertia=scale**2 * vehicle.bogie_pitch_inertia,
    )
    longer = replace(TRACK, roughness=TRACK.roughness / scale, cutoffs=tuple(c / scale for c in TRACK.cutoffs))
    wider = replace(band, low=scale * band.low, high=scale * band.high) if band and band.kind == "wavelength" else band
    small, large = solve(vehicle, speed, band), solve(larger, scale * speed, wider, longer)
    assert np.array_equal(small.status, large.status)
    for name in ALL_NAMES:
        angle = scale if "pitch" in name else 1.0
        allowed = 1e-9 + 2 * (small.relative_error[name] + large.relative_error[name])
        assert np.all(np.abs(angle * large.rms[name] / small.rms[name] - 1) <= allowed)


@pytest.mark.filterwarnings("ignore::freqrail.errors.FreqrailWarning")  # wheels that leave the rail
@FEW
@given(st.lists(st.integers(10, 160), min_size=1, max_size=5, unique=True).map(sorted))
def test_kilometres_an_hour_and_metres_a_second_are_one_speed(metres):
    """To the last bit: 5 m/s and 18 km/h are formed as decimals."""
    fixed = {"primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
    one, other = (
        freqrail.sweep("yu-damper-joint", {**fixed, "speed": f"{', '.join(map(str, axis))} {unit}"})
        for axis, unit in ((metres, "m/s"), ([round(3.6 * v, 1) for v in metres], "km/h"))
    )
    assert one.drop_attrs(deep=False).identical(other.drop_attrs(deep=False))


# --- grids -----------------------------------------------------------------------------------------

AXES = {
    "primary_joint_stiffness": np.array([0.5e6, 2e6, 5e6, 40e6, np.inf]),
    "secondary_joint_stiffness": np.array([1e6, 5e6, 80e6]),
    "car_body_mass": np.array([12e3, 15e3]),
    "half_wheelbase": np.array([0.8, 1.1]),
}


def spanned(vehicle: Vehicle, axes: dict[str, np.ndarray]) -> Vehicle:
    """The grid of vehicles over the axes, in their order."""
    count = len(axes)
    shaped = {
        name: values.reshape([-1 if k == place else 1 for k in range(count)])
        for place, (name, values) in enumerate(axes.items())
    }
    return replace(vehicle, **shaped)


@FEW
@given(vehicles(), st.permutations(list(AXES)), bands)
def test_axes_in_another_order_give_the_same_bits_in_that_order(vehicle, order, band):
    plain = solve(spanned(vehicle, AXES), [30.0, 60.0], band)
    other = solve(spanned(vehicle, {name: AXES[name] for name in order}), [30.0, 60.0], band)
    back = [order.index(name) for name in AXES]
    for name in ALL_NAMES:
        moved = other.rms[name].transpose(0, *(1 + k for k in back), len(AXES) + 1)
        assert np.array_equal(moved, plain.rms[name], equal_nan=True)
    assert np.array_equal(other.status.transpose(*back, len(AXES)), plain.status)


@FEW
@given(vehicles(), st.permutations(range(5)), bands)
def test_values_of_an_axis_in_another_order_give_the_same_bits_in_that_order(vehicle, order, band):
    joints = AXES["primary_joint_stiffness"]
    plain, other = (
        solve(spanned(vehicle, {"primary_joint_stiffness": values}), [30.0, 60.0], band)
        for values in (joints, joints[order])
    )
    for name in ALL_NAMES:
        assert np.array_equal(other.rms[name], plain.rms[name][:, order], equal_nan=True)


def in_blocks(vehicle: Vehicle, band: Band | None, block: int, jobs: int) -> solution.Solution:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solver_solve, "BLOCK", block)
        patch.setattr(solver_solve, "CLOSED_FORM_BLOCK", 2 * block)
        return solve(vehicle, [30.0, 60.0], band, jobs=jobs)


@FEW
@given(vehicles(), st.sampled_from([1, 2, 3, 7]), st.sampled_from([1, 2, 3]), bands)
def test_blocks_and_jobs_change_no_bit(vehicle, block, jobs, band):
    many = spanned(vehicle, AXES)
    same = same_bits(in_blocks(many, band, block, jobs), solve(many, [30.0, 60.0], band))
    assert same


def test_the_grid_above_is_cut_into_several_blocks():
    """Else the tests above would show nothing."""
    shape = tuple(values.size for values in AXES.values())
    assert [len(cells(shape, block)) for block in (1, 7)] == [60, 24]
