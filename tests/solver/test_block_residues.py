"""Closed form over blocks: against the chains', against fifty digits, against contour integrals that share nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from freqrail.model.elements import Dashpot, Inerter, Parallel, Spring
from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.outputs import Displacement, Output
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum
from freqrail.model.system import Freedom, Leg, System, Wheel
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import Reduction, reduce
from freqrail.solver import block_poles, block_residues, block_terms
from freqrail.solver.problem import cells
from freqrail.solver.quadrature import MeanSquare
from tests import contours
from tests.extremes import forty_digits
from tests.extremes.draws import draw
from tests.plain_vehicles import MAKERS, Plain, as_system, one_car, outputs_of
from tests.solver.test_residues import KMH, REFERENCE, reference_spectrum, reference_vehicle

ALL = tuple(output.name for output in outputs())
TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
RATIONAL = [kind for kind in MAKERS if kind != "irrational laws"]


@lru_cache
def reduced(**lengths: float) -> Reduction:
    return reduce(half_vehicle(), outputs(), lengths)


def of_paper(vehicle, spectrum, speed) -> dict[str, MeanSquare]:
    lengths = {name: getattr(vehicle, name) for name in ("half_bogie_spacing", "half_wheelbase")}
    varying = any(np.ndim(length) for length in lengths.values())
    found = reduce(half_vehicle(), outputs(), lengths) if varying else reduced(**lengths)
    return block_residues.whole_axis_mean_squares(found, vars(vehicle), spectrum, speed)


def ours(plain: Plain, speed: float, spectrum: RationalSpectrum = TRACK, every: int = 1) -> dict[str, MeanSquare]:
    """Every so many-th label of `outputs_of`."""
    some = tuple(replace(output, taps=output.taps[::every]) for output in outputs_of(plain))
    found = reduce(as_system(plain), some, plain.values)
    result = block_residues.whole_axis_mean_squares(found, plain.values, spectrum, np.array([speed]))
    return {name: MeanSquare(each.value[:, 0], each.error[:, 0]) for name, each in result.items()}


def compared(plain: Plain, speed: float, every: int = 1) -> tuple[float, float]:
    """(largest relative error, largest error over what the estimate and the reference's own rounding allow)."""
    found = ours(plain, speed, every=every)
    expected = {name: square[::every] for name, square in contours.mean_squares(plain, TRACK, speed).items()}
    lost = 1e-11 + 4e-16 * contours.sharpness(plain)
    true = np.concatenate([np.abs(found[name].value / expected[name] - 1) for name in expected])
    estimate = np.concatenate([found[name].error / np.abs(found[name].value) for name in expected])
    return float(np.max(true)), float(np.max(true / (estimate + lost)))


# --- the paper's vehicle -----------------------------------------------------------------------------


def exact(vehicle: Vehicle, track: RationalSpectrum, speed: float) -> dict[str, np.ndarray]:
    """Mean squares of a single vehicle by forty digits, {name: [labels]}."""
    found = forty_digits.mean_squares(vars(vehicle), (track.roughness, *track.cutoffs), speed, None)
    return {name: np.array(list(map(float, squares))) for name, squares in found.items()}


def test_the_papers_vehicle_is_what_forty_digits_give(paper_vehicle, german_low):
    """To 1e-12 where joints are ordinary, from 5 MN/m to rigid."""
    joints = np.array([5e6, 8.1e6, 2e7, 1e8, 1e10, np.inf])
    vehicle = replace(paper_vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints)
    speed = np.array([20, 100, 250, 400]) * KMH
    found = of_paper(vehicle, german_low, speed)
    for i, j in np.ndindex(vehicle.shape):
        k = (i + j) % speed.size  # every vehicle, every speed with many of them
        for name, expected in exact(vehicle.at((i, j)), german_low, float(speed[k])).items():
            np.testing.assert_allclose(found[name].value[:, i, j, k], expected, rtol=2e-12)
    for square in found.values():
        assert np.all(square.error < 1e-8 * square.value)


def test_joints_from_one_newton_per_metre_on_are_off_by_no_more_than_the_estimate(paper_vehicle, german_low):
    joints = np.append(10.0 ** np.arange(15), np.inf)
    vehicle = replace(paper_vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints)
    speed = np.array([0.3, 100, 600]) * KMH
    found = of_paper(vehicle, german_low, speed)
    for i, j in np.ndindex(vehicle.shape):
        k = (i + j) % speed.size
        if (i - j) % 2 == 0:  # every second one
            for name, expected in exact(vehicle.at((i, j)), german_low, float(speed[k])).items():
                value, error = (x[:, i, j, k] for x in (found[name].value, found[name].error))
                assert not np.any(np.abs(value - expected) > error)
    for square in found.values():
        known = square.error < 1e-6 * square.value
        assert np.all(known[:, 5:, 5:])


def test_fifty_digits_are_met():
    """1e-9 from 0.5 MN/m to rigid joints, the singular points included; softer joints as their estimate says."""
    for case in REFERENCE["cases"]:
        vehicle, speed = reference_vehicle(case), np.array([float(case["speed_km_h"]) * KMH])
        squares = of_paper(vehicle, reference_spectrum(), speed)
        names = [name for name in ALL if not name.endswith("pitch_acceleration")]
        found = np.concatenate([squares[name].value[:, 0] for name in names])
        estimate = np.concatenate([squares[name].error[:, 0] for name in names]) / found
        true = np.abs(found / np.array(list(map(float, case["mean_squares"]))) - 1)
        assert np.all(true <= estimate)
        if min(vehicle.primary_joint_stiffness, vehicle.secondary_joint_stiffness) >= 0.5e6:
            assert np.max(true) < 1e-10


@pytest.mark.parametrize("cutoffs", [(0.5, 0.5), (0.0206, 0.0206 * (1 + 1e-9)), (0.9, 0.8246)])
def test_cutoffs_of_the_track_may_be_equal(paper_vehicle, cutoffs):
    track = RationalSpectrum("rational", 4.032e-7, cutoffs)
    speed = np.array([100, 250]) * KMH
    found = of_paper(paper_vehicle, track, speed)
    for k, v in enumerate(speed):
        for name, expected in exact(paper_vehicle, track, float(v)).items():
            value, error = (x[:, k] for x in (found[name].value, found[name].error))
            np.testing.assert_allclose(value, expected, rtol=1e-9)
            assert np.all(np.abs(value - expected) <= error)


def test_the_bits_of_a_value_do_not_depend_on_how_the_grid_is_cut(paper_vehicle, german_low):
    joints = np.geomspace(0.5e6, 100e6, 5)
    vehicle = replace(paper_vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints[:3])
    speed = np.linspace(100, 300, 7) * KMH
    found = reduce(half_vehicle(), outputs(), vars(vehicle))
    whole = block_residues.whole_axis_mean_squares(found, vars(vehicle), german_low, speed)
    for most in (2, 4):
        for cell in cells(vehicle.shape, most):
            own = {
                "primary_joint_stiffness": vehicle.primary_joint_stiffness[cell[0]],
                "secondary_joint_stiffness": vehicle.secondary_joint_stiffness[cell[1]],
            }
            part = block_residues.whole_axis_mean_squares(found, vars(vehicle) | own, german_low, speed)
            for name in ALL:
                np.testing.assert_array_equal(part[name].value, whole[name].value[(slice(None), *cell)])
                np.testing.assert_array_equal(part[name].error, whole[name].error[(slice(None), *cell)])


def test_lengths_may_vary_over_the_grid(paper_vehicle, german_low):
    half = np.array([0.7, 0.9, 4.0])  # of the last the second axle runs behind the third
    speed = np.array([60.0])
    together = of_paper(replace(paper_vehicle, half_wheelbase=half, car_body_mass=np.full(3, 2e4)), german_low, speed)
    for k, length in enumerate(half):
        alone = of_paper(replace(paper_vehicle, half_wheelbase=length, car_body_mass=2e4), german_low, speed)
        for name in ALL:
            np.testing.assert_allclose(together[name].value[:, k], alone[name].value, rtol=1e-11)


# --- any vehicle -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", RATIONAL)
def test_every_kind_of_vehicle_is_what_contour_integrals_give(kind):
    """Accelerations, strokes and forces of everything: below the estimate, and 1e-10."""
    off, excess = compared(MAKERS[kind](np.random.default_rng(41)), 70.0)
    assert off < 1e-10
    assert excess <= 1


def drawn(seed: int) -> tuple[Plain, float]:
    """A vehicle with joints of 1e3 to 1e12 N/m or rigid, dampers up to 30 times stronger or weaker, and a speed."""
    rng = np.random.default_rng((2026, seed))
    options = ({}, {"alike": False}, {"off_centre": True}, {"modes": 1}, {"kinds": ("inerter", "two_stage")})
    plain = one_car(rng, **options[seed % 5])
    for name in plain.values:
        if name.endswith("_joint"):
            rigid = rng.random() < 0.1 and seed % 5 != 4
            plain.values[name] = float(np.inf if rigid else 10 ** rng.uniform(3, 12))
        elif name.endswith("_c"):
            plain.values[name] *= 30 ** rng.uniform(-1, 1)
    return plain, float(10 ** rng.uniform(0, 2))


@pytest.mark.parametrize("kind", range(5))
@pytest.mark.parametrize("speed", [2.0, 60.0])
def test_no_estimate_is_below_the_error(kind, speed):
    """Of 200 vehicles, 20 of a kind as one grid, whose lengths vary too."""
    plain = [drawn(seed)[0] for seed in range(kind + (100 if speed > 9 else 0), 200, 5)][:20]
    values = {name: np.array([each.values[name] for each in plain]) for name in plain[0].values}
    some = tuple(replace(output, taps=output.taps[::4]) for output in outputs_of(plain[0]))
    found = reduce(as_system(plain[0]), some, values)
    squares = block_residues.whole_axis_mean_squares(found, values, TRACK, np.array([speed]))
    for k, each in enumerate(plain):
        lost = 1e-11 + 4e-16 * contours.sharpness(each)
        for name, expected in contours.mean_squares(each, TRACK, speed).items():
            value, error = squares[name].value[:, k, 0], squares[name].error[:, k, 0]
            assert np.all(np.abs(value - expected[::4]) <= error + lost * expected[::4])


def test_wheelsets_that_hardly_feel_each_other_are_told_apart():
    """Of a vehicle with pivots off centre two pairs of their poles differ by 1e-13 of themselves."""
    plain = MAKERS["pivots off centre"](np.random.default_rng(40))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    (poles,) = (each.poles for each in block_poles.expand(found, plain.values).values())
    wheels = np.sort(poles[np.abs(poles) > 1200])
    assert wheels.size == 4
    assert np.sum(np.abs(np.diff(wheels)) < 1e-12 * np.abs(wheels[0])) == 2


def critical(kind: str = "the paper's", damping: str = "primary_c") -> tuple[Plain, float]:
    """A vehicle with a damping that makes two poles of a block one, and that pole's slope over its terms."""
    plain = MAKERS[kind](np.random.default_rng(2))
    found = reduce(as_system(plain), outputs_of(plain)[:1], plain.values)
    values = plain.values | {damping: plain.values[damping] * np.geomspace(0.01, 100, 1000)}
    for _ in range(5):
        expansions = block_poles.expand(found, values).values()
        slopes = [np.min(np.where(e.weight > 0, e.defect, 1.0), axis=-1) for e in expansions]
        defect = np.min(np.broadcast_arrays(*slopes), axis=0)
        best, tried = int(np.argmin(defect)), values[damping]
        values[damping] = np.linspace(*tried[[max(best - 1, 0), min(best + 1, tried.size - 1)]], 50)
    plain.values[damping] = float(tried[best])
    return plain, float(defect[best])


CRITICAL = [("the paper's", "primary_c"), ("laws without joints", "secondary_c")]


@pytest.mark.parametrize(("kind", "damping"), CRITICAL)
def test_poles_may_merge(kind, damping):
    plain, defect = critical(kind, damping)
    assert defect < 1e-4
    off, excess = compared(plain, 70.0)
    assert off < 1e-9
    assert excess <= 1


@pytest.mark.parametrize("kind", ["front and rear differ", "one bending mode"])
@pytest.mark.parametrize("beside", [0.0, 1e-6, 2e-3])
def test_poles_may_meet_those_of_the_track(kind, beside):
    plain = MAKERS[kind](np.random.default_rng(6))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    poles = next(iter(block_poles.expand(found, plain.values).values())).poles
    slow = poles.real[(poles.imag == 0) & (poles.real > -100)]
    speed = -slow[0] / TRACK.cutoffs[1] * (1 + beside)
    off, excess = compared(plain, float(speed))
    assert off < 1e-9
    assert excess <= 1


def meeting(kind: str) -> tuple[Plain, float]:
    """A vehicle and a speed at which one of its poles meets one of the track's."""
    plain = MAKERS[kind](np.random.default_rng(6))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    poles = next(iter(block_poles.expand(found, plain.values).values())).poles
    return plain, float(-np.max(poles.real[poles.imag == 0]) / TRACK.cutoffs[1])


@pytest.mark.parametrize("kind", ["front and rear differ", "one bending mode"])
def test_poles_may_meet_those_of_the_track_at_one_speed_of_many(kind):
    """There the track's cut-offs are varied, while the vehicle's poles stay."""
    plain, speed = meeting(kind)
    speeds = speed * np.array([0.7, 1.0, 1.0004, 1.3])
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    squares = block_residues.whole_axis_mean_squares(found, plain.values, TRACK, speeds)
    lost = 1e-11 + 4e-16 * contours.sharpness(plain)
    for k, each in enumerate(speeds):
        for name, expected in contours.mean_squares(plain, TRACK, float(each)).items():
            off = np.abs(squares[name].value[:, k] - expected)
            assert np.all(off < 1e-9 * expected)
            assert np.all(off <= squares[name].error[:, k] + lost * expected)


@pytest.mark.parametrize("kind", ["front and rear differ", "pivots off centre", "two coupled cars"])
def test_the_bits_of_any_vehicle_do_not_depend_on_those_beside_it(kind):
    """Nor on speeds at which poles meet, or on one beside that is no vehicle."""
    plain, speed = MAKERS[kind](np.random.default_rng(6)), np.array([0.7, 1.0, 1.3]) * 40.0
    some = tuple(replace(output, taps=output.taps[::4]) for output in outputs_of(plain))
    stage = next(name for name in plain.values if name.startswith("primary") and name.endswith("joint"))
    values = plain.values | {stage: np.array([1e6, 5e6, 2e7, 5e6]), "car_mass": plain.values["car_mass"] * np.ones(4)}
    values["car_mass"][1] = 1e-305
    found = reduce(as_system(plain), some, values)
    whole = block_residues.whole_axis_mean_squares(found, values, TRACK, speed)
    for part in (slice(0, 1), slice(2, 4), slice(3, 4)):
        own = values | {name: values[name][part] for name in (stage, "car_mass")}
        alone = block_residues.whole_axis_mean_squares(found, own, TRACK, speed)
        for name, square in alone.items():
            np.testing.assert_array_equal(square.value, whole[name].value[:, part])
            np.testing.assert_array_equal(square.error, whole[name].error[:, part])


# --- what is no number -------------------------------------------------------------------------------


def test_an_undamped_vehicle_has_no_mean_square_and_leaves_those_beside_it_alone(paper_vehicle, german_low):
    speed = np.array([60.0])
    alone = of_paper(paper_vehicle, german_low, speed)
    for name, value in (("wheelset_mass", 1e-305), ("primary_damping", 0.0)):
        vehicle = replace(paper_vehicle, **{name: np.array([value, getattr(paper_vehicle, name)])})
        if name == "primary_damping":
            vehicle = replace(vehicle, secondary_damping=np.array([0.0, paper_vehicle.secondary_damping]))
        for key, square in of_paper(vehicle, german_low, speed).items():
            assert not np.any(np.isfinite(square.value[:, 0]) & np.isfinite(square.error[:, 0]))
            np.testing.assert_allclose(square.value[:, 1], alone[key].value, rtol=1e-12)


def test_what_is_not_rational_is_refused(paper_vehicle):
    with pytest.raises(TypeError, match="TabulatedSpectrum"):
        of_paper(paper_vehicle, TabulatedSpectrum("measured", (0.1, 1.0), (1e-4, 1e-6)), np.array([60.0]))
    plain = MAKERS["irrational laws"](np.random.default_rng(0))
    with pytest.raises(ValueError, match="no differential equation"):
        ours(plain, 60.0)


def test_a_contact_that_takes_the_tracks_acceleration_is_refused():
    contact = Parallel((Spring("k"), Inerter("b")))
    system = System(
        (Freedom("z", "m"),), (Leg("leg", {"z": 1.0}, Dashpot("c")),), (Wheel("axle", {"z": 1.0}, contact, 0.0),)
    )
    values = {"m": 1.0, "k": 1.0, "b": 1.0, "c": 1.0}
    found = reduce(system, (Output("z", "m", "", (("", Displacement({"z": 1.0})),)),), values)
    with pytest.raises(ValueError, match="acceleration"):
        block_residues.whole_axis_mean_squares(found, values, TRACK, np.array([1.0]))


# --- the checks can fail -----------------------------------------------------------------------------


def never(*_: object) -> np.ndarray:
    return np.zeros(1, dtype=bool)


def no_errors(own=block_residues.read_blocks):
    def read(*arguments):
        blocks = own(*arguments)
        return {
            index: replace(block, residue_errors={k: 0 * e for k, e in block.residue_errors.items()})
            for index, block in blocks.items()
        }

    return read


def turned(own=block_terms.lag_sums):
    def sums(reduction):
        forms, factors = own(reduction)
        odd = np.array([lag.part == "im" for lag in reduction.lags])
        return forms, np.where(odd[:, None], -factors, factors)

    return sums


def wider(own=block_poles.real_parts):
    def parts(*arguments):
        real_part, error = own(*arguments)
        return real_part * (1 + 1e-7), error

    return parts


def near() -> tuple[Plain, float]:
    return MAKERS["pivots off centre"](np.random.default_rng(40)), 0.0


FAULTS = {
    "no interpolation": (block_residues, "_singular", never, critical),
    "poles not told apart": (block_poles, "clusters", lambda *_: {}, near),
    "sines turned": (block_terms, "lag_sums", turned(), lambda: (drawn(1)[0], 0)),
    "peaks too wide": (block_poles, "real_parts", wider(), lambda: (drawn(0)[0], 0)),
    "no track": (block_residues, "track_terms", lambda *_: (), lambda: (drawn(1)[0], 0)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found(fault, monkeypatch):
    module, name, instead, vehicle = FAULTS[fault]
    plain, _ = vehicle()
    assert compared(plain, 70.0)[0] < 1e-9
    monkeypatch.setattr(module, name, instead)
    assert not compared(plain, 70.0)[0] < 1e-9


def excess_of_extreme(number: int) -> float:
    """The largest error over its estimate of a vehicle ten decades from any other, against forty digits."""
    extreme = draw(2, number)
    track = RationalSpectrum("rational", extreme.spectrum[0], extreme.spectrum[1:])
    found = of_paper(Vehicle(**extreme.vehicle), track, np.array([extreme.speed]))
    worst = 0.0
    for name, exact in forty_digits.mean_squares(extreme.vehicle, extreme.spectrum, extreme.speed, None).items():
        value, error = found[name].value[:, 0], found[name].error[:, 0]
        off = np.abs(value - np.array([float(x) for x in exact]))
        worst = max(worst, float(np.max(np.where(np.isfinite(off) & np.isfinite(value), off / error, 0.0))))
    return worst


@pytest.mark.parametrize("number", [5, 13, 24, 25, 26, 59, 80])
def test_extremes_are_not_off_by_more_than_their_estimate(number):
    assert excess_of_extreme(number) <= 1


def test_estimates_without_what_the_residues_lack_are_found_out(monkeypatch):
    monkeypatch.setattr(block_residues, "read_blocks", no_errors())
    assert excess_of_extreme(25) > 1
