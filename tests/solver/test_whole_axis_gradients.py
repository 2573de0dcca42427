"""Gradients over the whole axis: against forty digits, and contour integrals of a dense solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.half_vehicle import outputs
from freqrail.model.spectrum import TabulatedSpectrum
from freqrail.reduction.columns import reduce
from freqrail.solver import block_poles, block_residues, whole_axis_gradients, whole_axis_nodes
from freqrail.solver.block_slopes import lengths_free
from freqrail.solver.lag_slopes import SPEED
from tests import contours
from tests.dense_slopes import MeasuredReference, euler_sums
from tests.plain_vehicles import MAKERS, Plain, as_system, outputs_of
from tests.solver.test_block_residues import critical
from tests.solver.test_gradients import (
    EVERYTHING,
    HALF,
    SOME,
    TRACK,
    VALUES,
    Gradients,
    compared,
    off_forty_digits,
    with_pivots_of_their_own,
)

RATIONAL = [kind for kind in MAKERS if kind != "irrational laws"]
RIGID = {"primary_joint_stiffness": np.inf, "secondary_joint_stiffness": np.inf}


def of_paper(wanted=EVERYTHING, changed=(), speed=70.0, shared=False) -> Gradients:
    values = VALUES | dict(changed)
    found = reduce(HALF, outputs(), lengths_free(values, wanted))
    return whole_axis_gradients.whole_axis_gradients(found, values, TRACK, np.atleast_1d(speed), wanted, shared)


def ours(plain: Plain, speed: float, wanted: tuple[str, ...] | None = None) -> Gradients:
    system = as_system(plain)
    wanted = (*system.parameters, SPEED) if wanted is None else wanted
    found = reduce(system, outputs_of(plain), lengths_free(plain.values, wanted))
    return whole_axis_gradients.whole_axis_gradients(found, plain.values, TRACK, np.array([speed]), wanted)


def lost(plain: Plain) -> float:
    """What a dense solution beside sharp poles loses of a slope, beside what `MeasuredReference` sees of it."""
    return 1e-10 + 3e-14 * contours.sharpness(plain) ** 2


def blunt(plain: Plain) -> Plain:
    """The vehicle with joints thirty times stiffer, whose wheelsets are damped well enough for a dense solution."""
    return replace(plain, values={k: 30 * v if k.endswith("_joint") else v for k, v in plain.values.items()})


# --- the paper's vehicle -----------------------------------------------------------------------------


@pytest.mark.parametrize("joints", [0.5e6, 5e6, np.inf])
def test_forty_digits_are_met(joints):
    """Joints of 0.5 MN/m leave the wheelsets a damping ratio of 1.4e-6."""
    changed = {"primary_joint_stiffness": joints, "secondary_joint_stiffness": joints}
    names = (*SOME[:5], "contact_stiffness", "wheelset_mass") + (SOME[5:] if np.isfinite(joints) else ())
    worst, excess = off_forty_digits(of_paper(changed=changed), None, names, changed)
    assert worst < (1e-8 if joints < 1e6 else 1e-10)
    assert excess <= 1


def test_units_of_mass_and_time_are_ours_to_choose():
    """Euler: what has kilograms, and what has seconds, the speed included, adds up to no change of a stroke."""
    for found in (of_paper()[name] for name in ("primary_stroke", "secondary_stroke")):
        shares = {name: found[name].value * (70.0 if name == SPEED else VALUES[name]) for name in EVERYTHING}
        for some in euler_sums(shares, SPEED):
            assert np.max(np.abs(np.sum(some, axis=0))) < 1e-9 * np.max(np.abs(some))


# --- any vehicle -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", RATIONAL)
def test_every_kind_of_vehicle_is_what_contour_integrals_give(kind):
    plain, speed = blunt(MAKERS[kind](np.random.default_rng(52))), 70.0
    every = 4 if len(plain.wheels) > 6 else 1
    worst, excess = compared(ours(plain, speed), MeasuredReference(plain, TRACK, speed), every, lost(plain))
    assert worst < 1e-9 + lost(plain)
    assert excess <= 1


STEPS = np.array([1, -1, 2, -2, 3, -3, 4, -4])
WEIGHTS = np.array([4 / 5, -4 / 5, -1 / 5, 1 / 5, 4 / 105, -4 / 105, -1 / 280, 1 / 280])


BLUNT = ("laws without joints", "laws with inerters", "a track that yields")


@pytest.mark.parametrize("kind", [kind for kind in RATIONAL if kind not in BLUNT])
def test_beside_sharp_peaks_slopes_are_differences_of_the_closed_form(kind):
    """Of eighth order: strokes by a mass, a stiffness and a length, with damping ratios of wheelsets down to 4e-6."""
    plain, speed, step = MAKERS[kind](np.random.default_rng(52)), np.array([70.0]), 2e-3
    assert contours.sharpness(plain) > 1e3
    wanted = ("wheelset_mass", "hertz", "pivot")
    found = ours(plain, 70.0, wanted)
    some = tuple(output for output in outputs_of(plain) if output.name == "elongation")
    for name in wanted:
        values = plain.values | {name: plain.values[name] * (1 + step * np.append(0, STEPS))}
        closed = reduce(as_system(plain), some, values)
        if name == "pivot":
            values |= {"car_mass": np.full(STEPS.size + 1, values["car_mass"])}
        squares = block_residues.whole_axis_mean_squares(closed, values, TRACK, speed)["elongation"].value[..., 0]
        expected = squares[:, 1:] @ WEIGHTS / step / squares[:, 0]
        slope = found["elongation"][name]
        scale = plain.values[name] / squares[:, 0]
        off = np.abs(slope.value[:, 0] * scale - expected)
        assert np.all(off < 3e-8)
        assert np.all(slope.error[:, 0] * scale < 1e-6)


def test_one_length_of_two_equal_ones_may_change_alone():
    plain, speed = blunt(with_pivots_of_their_own()), 70.0
    found = ours(plain, speed, ("pivot", "pivot_rear"))
    worst, excess = compared(found, MeasuredReference(plain, TRACK, speed), 1, lost(plain))
    assert worst < 1e-9 + lost(plain)
    assert excess <= 1


def test_poles_may_merge():
    plain, defect = critical()
    assert defect < 1e-4
    worst, excess = compared(ours(plain, 70.0), MeasuredReference(plain, TRACK, 70.0), 1, lost(plain))
    assert worst < 1e-9 + lost(plain)
    assert excess <= 1


@pytest.mark.parametrize("beside", [0.0, 1e-6])
def test_poles_may_meet_those_of_the_track(beside):
    plain = blunt(MAKERS["one bending mode"](np.random.default_rng(6)))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    poles = next(iter(block_poles.expand(found, plain.values).values())).poles
    slow = poles.real[(poles.imag == 0) & (poles.real > -100)]
    speed = float(-slow[0] / TRACK.cutoffs[1] * (1 + beside))
    worst, excess = compared(ours(plain, speed), MeasuredReference(plain, TRACK, speed), 2, lost(plain))
    assert worst < 1e-9 + lost(plain)
    assert excess <= 1


# --- grids -------------------------------------------------------------------------------------------

JOINTS = {
    "primary_joint_stiffness": np.array([2e6, 8e6, 5e7])[:, None],
    "secondary_joint_stiffness": np.array([1e6, 9e6]),
}
FEW = ("secondary_damping", "half_bogie_spacing", SPEED)


def test_vehicles_with_nodes_of_their_own_have_the_bits_that_they_have_alone():
    speed = np.array([30.0, 60.0])
    together = of_paper(FEW, JOINTS, speed)
    for i, j in np.ndindex(3, 2):
        joints = {"primary_joint_stiffness": float(JOINTS["primary_joint_stiffness"][i, 0])}
        joints |= {"secondary_joint_stiffness": float(JOINTS["secondary_joint_stiffness"][j])}
        for output, by_name in of_paper(FEW, joints, speed).items():
            for name, slope in by_name.items():
                np.testing.assert_array_equal(together[output][name].value[:, i, j], slope.value)
                np.testing.assert_array_equal(together[output][name].error[:, i, j], slope.error)


def test_shared_nodes_differ_by_no_more_than_the_estimates():
    """Also where wheels of some vehicles stand elsewhere, and where there are sharp resonances."""
    changed = JOINTS | {"half_wheelbase": np.array([0.8, 1.1])}
    own, shared = (of_paper(FEW, changed, np.array([30.0, 60.0]), some) for some in (False, True))
    for output, by_name in own.items():
        for name, slope in by_name.items():
            other = shared[output][name]
            assert np.all(np.abs(slope.value - other.value) <= slope.error + other.error)
            if output.startswith("car_body"):  # the others have slopes by far below their elasticities
                assert np.all(other.error < 1e-8 * np.max(np.abs(slope.value)))


def test_slow_vehicles_are_computed_in_groups_of_their_own():
    speed = np.array([70.0, 1.0, 0.2, 50.0])
    together = of_paper(FEW, (), speed)
    for k, v in enumerate(speed):
        for output, by_name in of_paper(FEW, (), v).items():
            for name, slope in by_name.items():
                found = together[output][name]
                off = np.abs(found.value[:, k] - slope.value[:, 0])
                assert np.all(off <= found.error[:, k] + slope.error[:, 0])


# --- what is no number -------------------------------------------------------------------------------


def test_an_undamped_block_has_no_slope_and_leaves_those_beside_it_alone():
    """Without primary dampers the bogies' pitch is undamped, and bounce and pitch are not."""
    found = of_paper(("secondary_damping", "car_body_mass"), RIGID | {"primary_damping": 0.0})
    for output in ("primary_stroke", "wheelset_acceleration", "bogie_pitch_acceleration"):
        for slope in found[output].values():
            assert np.all(np.isnan(slope.value))
            assert np.all(np.isinf(slope.error))
    for output in ("car_body_acceleration", "bogie_acceleration", "secondary_stroke"):
        for slope in found[output].values():
            assert np.all(slope.error < 1e-6 * np.max(np.abs(slope.value)))


def test_a_vehicle_too_slow_for_any_rule_has_no_slope():
    slope = of_paper((SPEED,), (), np.array([60.0, 1e-4]))["car_body_acceleration"][SPEED]
    assert np.all(np.isfinite(slope.value[:, 0]))
    assert np.all(np.isnan(slope.value[:, 1]))
    assert np.all(np.isinf(slope.error[:, 1]))


def test_what_is_not_rational_is_refused():
    found = reduce(HALF, outputs(), lengths_free(VALUES, ()))
    table = TabulatedSpectrum("measured", (0.1, 1.0), (1e-4, 1e-6))
    with pytest.raises(TypeError, match="TabulatedSpectrum"):
        whole_axis_gradients.whole_axis_gradients(found, VALUES, table, np.array([60.0]), (SPEED,))
    with pytest.raises(ValueError, match="no differential equation"):
        ours(MAKERS["irrational laws"](np.random.default_rng(0)), 60.0)


# --- the checks can fail -----------------------------------------------------------------------------


def without_last_panel(own=whole_axis_nodes._to_the_left):
    return lambda *arguments: list(own(*arguments))[:1]


def half_of_them(own=whole_axis_nodes.circles):
    return lambda *arguments: own(*arguments)[:1]


FAULTS = {
    "not to infinity": (whole_axis_nodes, "_to_the_left", without_last_panel(), 5e6),
    "nothing to the left": (whole_axis_nodes, "_to_the_left", lambda *_: (), 5e6),
    "sharp poles passed": (whole_axis_nodes, "SHARP", 0.0, 0.5e6),
    "half of the residues": (whole_axis_nodes, "circles", half_of_them(), 0.5e6),
    "inverses eliminated": (whole_axis_nodes, "inverses_at", lambda *_: {}, 0.5e6),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found(fault, monkeypatch):
    """By the difference from forty digits, which is below 1e-8 without it."""
    module, name, instead, joints = FAULTS[fault]
    changed = {"primary_joint_stiffness": joints, "secondary_joint_stiffness": joints}
    monkeypatch.setattr(module, name, instead)
    worst, _ = off_forty_digits(of_paper(("wheelset_mass",), changed), None, ("wheelset_mass",), changed)
    print(fault, worst)
    assert not worst < 1e-8
