"""Closed form over the whole axis: against 50-digit arithmetic, against quadrature, and at its singular points."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from freqrail.model.equations import state_space
from freqrail.model.responses import RESPONSES
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum, wavenumber_psd
from freqrail.model.vehicle import Vehicle, hertzian_contact_stiffness, static_wheel_load
from freqrail.solver import block_residues, solve
from freqrail.solver import solution as the_solution
from freqrail.solver.problem import half_vehicle_problem
from tests.chains import FAMILIES, chain_system
from tests.helpers import own_quadrature, whole_axis_mean_squares

REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "whole_axis.json").read_text())
NAMES = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke", "wheelset_acceleration")
KMH = 1 / 3.6


def reference_vehicle(case: dict) -> Vehicle:
    numbers = {name: float(text) for name, text in case["vehicle"].items()}
    load = static_wheel_load(numbers["car_body_mass"], numbers["bogie_mass"], numbers["wheelset_mass"])
    return Vehicle(
        **numbers,
        primary_joint_stiffness=float(case["primary_joint_stiffness"]),
        secondary_joint_stiffness=float(case["secondary_joint_stiffness"]),
        contact_stiffness=hertzian_contact_stiffness(float(REFERENCE["contact_constant"]), load),
    )


def reference_spectrum() -> RationalSpectrum:
    roughness, low, high = map(float, REFERENCE["spectrum"])
    return RationalSpectrum("reference", roughness, (low, high))


@pytest.mark.parametrize(
    "case",
    REFERENCE["cases"],
    ids=lambda c: f"{c['primary_joint_stiffness']}-{c['secondary_joint_stiffness']}-{c['speed_km_h']}",
)
def test_the_closed_form_agrees_with_fifty_digits(case):
    """1e-9 from 0.5 MN/m to rigid joints, the singular points included; softer joints as their estimate says."""
    vehicle, speed = reference_vehicle(case), np.array([float(case["speed_km_h"]) * KMH])
    squares = whole_axis_mean_squares(vehicle, NAMES, reference_spectrum(), speed)
    found = np.concatenate([squares[name].value[:, 0] for name in NAMES])
    estimate = np.concatenate([squares[name].error[:, 0] for name in NAMES]) / found
    true = np.abs(found / np.array(list(map(float, case["mean_squares"]))) - 1)
    assert np.all(true <= estimate)
    if min(vehicle.primary_joint_stiffness, vehicle.secondary_joint_stiffness) >= 0.5e6:
        assert np.max(true) < 1e-9


def test_closed_form_and_quadrature_agree_on_the_paper_grid(paper_vehicle, german_low):
    """Two methods that share only the response: nodes that follow the poles, and residues at them."""
    stiffness = 1e6 * np.array([0.5, 5, 100])
    vehicles = replace(
        paper_vehicle,
        primary_joint_stiffness=stiffness[:, None],
        secondary_joint_stiffness=stiffness[None, :],
    )
    names = tuple(
        name for name in RESPONSES if name != "wheelset_acceleration"
    )  # whose tail the quadrature only bounds
    study = half_vehicle_problem(vehicles, np.array([20.0, 100, 250, 600]) * KMH, german_low, None, names)
    squares = whole_axis_mean_squares(vehicles, names, german_low, study.speed)
    for index in np.ndindex(3, 3):
        own = own_quadrature(study, index)
        for name in names:
            exact, other = squares[name].value[:, *index], own[name].value
            allowed = squares[name].error[:, *index] + own[name].error
            assert np.all(np.abs(exact - other) <= allowed)
            assert np.max(np.abs(other / exact - 1)) < 1e-8


def critical(vehicle: Vehicle, joint: str, chain: str, low: float, high: float) -> float:
    """The joint stiffness between two at which two poles of a chain become one, to the last bit."""

    def real_poles(stiffness: float) -> int:
        matrix = state_space(chain_system(replace(vehicle, **{joint: stiffness}), chain)).a
        return np.count_nonzero(np.linalg.eigvals(matrix).imag == 0)

    below = real_poles(low)
    assert real_poles(high) != below
    while high - low > 1.5 * np.spacing(low):
        middle = (low + high) / 2
        low, high = (middle, high) if real_poles(middle) == below else (low, middle)
    return low


MERGERS = {
    "bounce, K_sd 69.82": ("bounce", {"secondary_joint_stiffness": 69.82e6}, "primary_joint_stiffness", 17e6, 18e6),
    "pitch, K_sd 69.82": ("pitch", {"secondary_joint_stiffness": 69.82e6}, "primary_joint_stiffness", 16e6, 17e6),
    "bounce, K_pd 50": ("bounce", {"primary_joint_stiffness": 50e6}, "secondary_joint_stiffness", 52e6, 54e6),
    "pitch, K_sd rigid": ("pitch", {"secondary_joint_stiffness": np.inf}, "primary_joint_stiffness", 12e6, 12.5e6),
    "bogie pitch": ("bogie_pitch", {"primary_damping": 60e3}, "primary_joint_stiffness", 1e6, 1e9),
}


@pytest.mark.parametrize("scale", [1 - 1e-3, 1 - 1e-6, 1 - 1e-9, 1 - 1e-12, 1.0, 1 + 1e-15, 1 + 1e-10, 1 + 1e-7, 1.01])
@pytest.mark.parametrize("merger", MERGERS)
def test_nothing_happens_where_two_poles_merge(paper_vehicle, german_low, merger, scale):
    """Residues of two poles that are almost one are huge and cancel; quadrature does not know of them."""
    chain, changes, joint, low, high = MERGERS[merger]
    vehicle = replace(paper_vehicle, **changes)
    vehicle = replace(vehicle, **{joint: scale * critical(vehicle, joint, chain, low, high)})
    study = half_vehicle_problem(vehicle, np.array([250 * KMH]), german_low, None, NAMES[:4])
    squares, own = (
        whole_axis_mean_squares(vehicle, study.names, german_low, study.speed),
        own_quadrature(study),
    )
    for name in study.names:
        apart = np.abs(squares[name].value - own[name].value)
        assert np.all(apart <= squares[name].error + own[name].error)
        assert np.all(squares[name].error < 1e-8 * squares[name].value)


def test_vehicles_and_speeds_of_a_grid_are_singular_each_for_itself(paper_vehicle, german_low):
    """A pole on the track's at one speed, critical damping at another stiffness, real poles here and complex ones
    there: in a grid of two axes every number is the one that it is alone.
    """
    merged = replace(paper_vehicle, secondary_joint_stiffness=69.82e6)
    merging = critical(merged, "primary_joint_stiffness", "bounce", 17e6, 18e6)
    many = replace(
        paper_vehicle,
        primary_joint_stiffness=np.array([5e6, merging, 100e6])[:, None],
        secondary_joint_stiffness=np.array([5e6, 69.82e6, 0.5e6, np.inf]),
    )
    speed = np.array([50, 77.84414, 250, 310]) * KMH
    together = whole_axis_mean_squares(many, NAMES, german_low, speed)
    for index in np.ndindex(many.shape):
        for k in range(speed.size):
            alone = whole_axis_mean_squares(many.at(index), NAMES, german_low, speed[k : k + 1])
            for name in NAMES:
                found, expected = together[name].value[:, *index, k], alone[name].value[:, 0]
                np.testing.assert_allclose(found, expected, rtol=2e-9)


@pytest.mark.parametrize("slower", [100.0, 0.01])
def test_the_unit_of_time_is_ours_to_choose(paper_vehicle, german_low, slower):
    """Everything `slower` times slower, speed included: strokes are what they were, accelerations the square less."""

    def slow(vehicle: Vehicle) -> Vehicle:
        stiffness = {n: getattr(vehicle, n) / slower**2 for n in vars(vehicle) if n.endswith("stiffness")}
        return replace(
            vehicle,
            **stiffness,
            primary_damping=vehicle.primary_damping / slower,
            secondary_damping=vehicle.secondary_damping / slower,
        )

    for vehicle in (
        paper_vehicle,
        replace(paper_vehicle, secondary_joint_stiffness=100e6),
        paper_vehicle.traditional(),
    ):
        speed = np.array([100, 250]) * KMH
        one = whole_axis_mean_squares(vehicle, NAMES, german_low, speed)
        other = whole_axis_mean_squares(slow(vehicle), NAMES, german_low, speed / slower)
        for name in NAMES:
            factor = slower ** (2 * FAMILIES[name].derivative)
            np.testing.assert_allclose(factor * other[name].value, one[name].value, rtol=1e-9)


def test_a_spectrum_with_simple_poles_is_taken_as_it_is():
    for cutoffs in ((0.02, 0.8), (0.5, 0.56), (0.8, 0.02)):
        spectrum = RationalSpectrum("rational", 1e-7, cutoffs)
        assert block_residues.spread(spectrum) == [(1.0, spectrum)]


@pytest.mark.parametrize("cutoffs", [(0.5, 0.5), (0.5, 0.52), (0.52, 0.5), (7.0, 7.001), (1e-4, 1e-4)])
def test_a_spectrum_with_merging_poles_is_the_sum_of_others(cutoffs):
    spectrum = RationalSpectrum("rational", 1e-7, cutoffs)
    parts = block_residues.spread(spectrum)
    assert len(parts) > 1
    assert all(block_residues.spread(part) == [(1.0, part)] for _, part in parts)
    assert sum(weight for weight, _ in parts) == pytest.approx(1, rel=1e-12)
    assert sum(abs(weight) for weight, _ in parts) < 60
    wavenumber = cutoffs[0] * np.geomspace(1e-3, 1e3, 50)
    total = sum(weight * wavenumber_psd(part, wavenumber) for weight, part in parts)
    np.testing.assert_allclose(total, wavenumber_psd(spectrum, wavenumber), rtol=1e-9)


def test_the_closed_form_is_for_rational_spectra(paper_vehicle):
    table = TabulatedSpectrum("measured", (0.1, 1.0), (1e-4, 1e-6))
    with pytest.raises(TypeError, match="TabulatedSpectrum"):
        whole_axis_mean_squares(paper_vehicle, NAMES, table, np.array([60.0]))


def test_nothing_happens_where_a_vehicle_pole_meets_a_track_pole(paper_vehicle, german_low):
    """77.84414 km/h on the paper's case, and a hair beside: quadrature does not know that anything is special there."""
    offsets = np.array([-2e-3, -1e-3, -1e-5, -1e-8, 0, 1e-9, 1e-6, 1e-4, 1.1e-3])
    study = half_vehicle_problem(paper_vehicle, 77.84414 * (1 + offsets) * KMH, german_low, None, NAMES[:4])
    squares = whole_axis_mean_squares(paper_vehicle, study.names, german_low, study.speed)
    own = own_quadrature(study)
    for name in study.names:
        assert squares[name].value == pytest.approx(own[name].value, rel=1e-9, abs=0)


def test_a_stiff_joint_is_a_rigid_joint_up_to_one_over_its_stiffness(paper_vehicle, german_low):
    speed = np.array([100, 250]) * KMH
    rigid = whole_axis_mean_squares(paper_vehicle.traditional(), NAMES, german_low, speed)
    stiffness = 10.0 ** np.arange(10, 16)
    stiff = replace(paper_vehicle, primary_joint_stiffness=stiffness, secondary_joint_stiffness=stiffness)
    squares = whole_axis_mean_squares(stiff, NAMES, german_low, speed)
    for name in NAMES:
        apart = np.max(np.abs(squares[name].value / rigid[name].value[:, None] - 1), axis=(0, 2))
        assert np.all(apart[1:] < 0.11 * apart[:-1])  # a tenth for ten times the stiffness


def test_softer_joints_own_up_to_a_larger_error(paper_vehicle, german_low):
    """The wheelset's damping shrinks with the square of the joint's stiffness, towards the rounding error."""
    stiffness = 10.0 ** np.arange(3, 7)[::-1]
    soft = replace(paper_vehicle, primary_joint_stiffness=stiffness, secondary_joint_stiffness=stiffness)
    square = whole_axis_mean_squares(soft, NAMES, german_low, np.array([250 * KMH]))["primary_stroke"]
    relative = (square.error / square.value)[0, :, 0]
    assert np.all(np.diff(relative) > 0)
    assert relative[0] < 2e-9
    assert relative[-1] > 1e-6


@pytest.mark.parametrize("cutoff", [0.002, 0.0206, 0.8246])
@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-4, 3e-3, 0.0499, 0.0501, -1e-3])
def test_cutoffs_may_be_equal_or_nearly_so(paper_vehicle, cutoff, apart):
    """The residues at both grow without bound and cancel; quadrature does not know of them."""
    track = RationalSpectrum("rational", 4.032e-7, (cutoff * (1 - apart), cutoff * (1 + apart)))
    for vehicle in (paper_vehicle, paper_vehicle.traditional()):
        study = half_vehicle_problem(vehicle, np.array([100, 250]) * KMH, track, None, NAMES[:4])
        squares, own = (
            whole_axis_mean_squares(vehicle, study.names, track, study.speed),
            own_quadrature(study),
        )
        for name in study.names:
            assert np.all(np.abs(squares[name].value - own[name].value) <= squares[name].error + own[name].error)
            assert np.all(squares[name].error < 2e-7 * squares[name].value)


def test_equal_cutoffs_have_all_responses(paper_vehicle):
    """Also the wheelsets' acceleration, whose tail no quadrature reaches."""
    track = RationalSpectrum("rational", 4.032e-7, (0.5, 0.5))
    solution = solve.solve(
        half_vehicle_problem(paper_vehicle, np.array([20, 250]) * KMH, track, None, tuple(RESPONSES))
    )
    assert np.all(solution.method == the_solution.METHOD.index("closed_form"))
    beside = RationalSpectrum("rational", 4.032e-7, (0.499, 0.501))
    other = solve.solve(half_vehicle_problem(paper_vehicle, np.array([20, 250]) * KMH, beside, None, tuple(RESPONSES)))
    for name in RESPONSES:
        assert solution.rms[name] == pytest.approx(other.rms[name], rel=5e-3)


# a slow pole of the joints, beside which a car of 1,388 t swings almost undamped: the pole's own residue is noise, and
# so are the partial fractions at the mirror image of the car's pole, which it enters
HEAVY_ON_SOFT_JOINTS = {
    "car_body_mass": 1.388e6,
    "car_body_pitch_inertia": 2.792e5,
    "bogie_mass": 1666.0,
    "bogie_pitch_inertia": 2081.0,
    "wheelset_mass": 776.9,
    "primary_stiffness": 3.582e6,
    "primary_damping": 1753.0,
    "primary_joint_stiffness": 1.518e7,
    "secondary_stiffness": 2.416e5,
    "secondary_damping": 1e4,
    "secondary_joint_stiffness": 248.4,
    "half_bogie_spacing": 5.463,
    "half_wheelbase": 1.296,
    "contact_stiffness": 8.316e8,
}


@pytest.mark.parametrize(
    ("change", "speed"),
    [
        ({"secondary_joint_stiffness": 5e3}, 250),
        ({"secondary_joint_stiffness": 2e3}, 50),
        ({"secondary_joint_stiffness": 1e3}, 50),
        ({"secondary_damping": 2e6, "secondary_joint_stiffness": 1e12}, 10),
        ({"primary_damping": 300e3, "primary_stiffness": 146e3, "primary_joint_stiffness": np.inf}, 5),
        ({"secondary_joint_stiffness": 1.27e14, "secondary_damping": 2e6, "primary_damping": 89.0}, 60),
        (HEAVY_ON_SOFT_JOINTS, 555),
    ],
    ids=[
        "5 kN/m",
        "2 kN/m",
        "1 kN/m",
        "slow overdamped",
        "slow overdamped, rigid",
        "fast, nearly rigid",
        "heavy on soft joints",
    ],
)
def test_a_residue_that_rounding_spoils_is_found_out(paper_vehicle, german_low, change, speed):
    """Soft secondary joints, slow and fast overdamped poles: the estimate covers the error, the grid mends it."""
    vehicle = replace(paper_vehicle, **change)
    study = half_vehicle_problem(vehicle, np.array([speed * KMH]), german_low, None, NAMES[:4])
    squares = whole_axis_mean_squares(vehicle, study.names, german_low, study.speed)
    own, solution = own_quadrature(study), solve.solve(study)
    for name in study.names:
        apart = np.abs(squares[name].value - own[name].value)
        assert not np.any(apart > squares[name].error + own[name].error)
        assert solution.rms[name] == pytest.approx(np.sqrt(own[name].value), rel=1e-7, abs=0)
