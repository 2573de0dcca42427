"""Gradients of mean squares over a band: against dense linear algebra, and differences in forty digits."""

from __future__ import annotations

import warnings
from functools import lru_cache

import numpy as np
import pytest
from mpmath import mp, mpf, pi

from freqrail.model.assembled import state_space
from freqrail.model.band import Band
from freqrail.model.elements import Dashpot, Parallel, Spring
from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.outputs import Displacement, Elongation, Output
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum
from freqrail.model.system import Freedom, Leg, System, Wheel
from freqrail.reduction.columns import Reduction, reduce
from freqrail.solver import block_lags, block_quadrature, block_slopes, gradients, lag_slopes, quadrature
from freqrail.solver.block_slopes import lengths_free
from freqrail.solver.lag_slopes import SPEED, band_edges, gradient_nodes
from freqrail.solver.problem import cells
from freqrail.solver.quadrature import MeanSquare
from tests import dense_slopes
from tests.dense_slopes import euler_sums
from tests.extremes import forty_digits
from tests.helpers import reference_nodes
from tests.independent import PAPER
from tests.plain_vehicles import MAKERS, Plain, as_system, one_car, outputs_of, places

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
HERTZ = Band("frequency", 0.1, 60.0)
BAND = 2 * np.pi * np.array([HERTZ.low, HERTZ.high])
Gradients = dict[str, dict[str, MeanSquare]]


def poles_of(plain: Plain) -> np.ndarray:
    """Eigenvalues of the assembled equations; of a vehicle with irrational laws a ladder of guesses."""
    try:
        return np.linalg.eigvals(state_space(as_system(plain), plain.values).a)
    except ValueError:
        return 2 * np.pi * np.geomspace(0.1, 100, 60) * (-0.08 + 1j)


def gradients_of(
    reduction: Reduction, values: dict, wanted: tuple[str, ...], speed, poles, band=HERTZ, spectrum=TRACK, most=500
) -> Gradients:
    """Of vehicles with one geometry, on nodes that follow the poles given."""
    one = {name: float(np.ravel(values[name])[0]) for name in reduction.system.lengths}
    limits, slopes = band_edges(band, spectrum, speed)
    lag = float(np.ptp(reduction.places(one))) / speed.min()
    singular = np.concatenate([poles, -np.multiply.outer(speed, (0.0206, 0.8246)).ravel()])
    kinks = np.multiply.outer(getattr(spectrum, "wavenumbers", ()), speed).ravel()
    ends = np.unique(np.concatenate([limits.ravel(), kinks[(kinks > limits.min()) & (kinks < limits.max())]]))
    rule = quadrature.quadrature(quadrature.panel_edges(ends, singular, lag))
    nodes = gradient_nodes(reduction, one, spectrum, rule, speed, limits, slopes, wanted, most)
    return gradients.mean_square_gradients(reduction, values, nodes, wanted)


def ours(plain: Plain, speed, wanted: tuple[str, ...] | None = None) -> Gradients:
    system = as_system(plain)
    wanted = (*system.parameters, SPEED) if wanted is None else wanted
    reduction = reduce(system, outputs_of(plain), lengths_free(plain.values, wanted))
    return gradients_of(reduction, plain.values, wanted, speed, poles_of(plain))


def reference_of(plain: Plain, speed: float) -> dense_slopes.BandReference:
    """On nodes that close in on every pole; of poles that are nearly one, on one of them."""
    poles = poles_of(plain)
    poles = poles[poles.imag >= 0]
    apart = [p for k, p in enumerate(poles) if np.all(np.abs(poles[:k] - p) > 1e-3 * np.abs(p))]
    nodes = reference_nodes(*BAND, np.array(apart), float(np.ptp(places(plain))) / speed, 12)
    return dense_slopes.BandReference(plain, TRACK, speed, *nodes)


def compared(
    found: Gradients,
    reference: dense_slopes.BandReference | dense_slopes.AxisReference,
    every: int = 1,
    rounding: float = 1e-10,
) -> tuple[float, float]:
    """(largest error, largest error over what the estimate and the dense solution's rounding allow).

    Errors are those of elasticities, of p d(sigma^2)/dp over sigma^2, by every so many-th parameter.
    """
    worst, excess, plain = 0.0, 0.0, reference.plain
    squares = reference.squares()
    nothing = dict.fromkeys(squares, 0.0)  # what the reference has, as elasticities, where there is no slope at all
    for name in list(found["acceleration"])[::-every]:
        value = reference.speed if name == SPEED else abs(plain.values[name])
        measured = getattr(reference, "measured", None)
        wrong = {} if measured is None else {key: spread for key, (_, spread) in measured(name).items()}
        for output, expected in reference.slopes(name).items():
            own = found[output][name]
            none = (own.value[:, 0] == 0) & (own.error[:, 0] == 0)
            if measured is not None and none.any():
                nothing[output] = max(
                    nothing[output], float(np.max((np.abs(expected) * value / squares[output])[none]))
                )
            # what the reference itself is known to be off by, where it is measured
            known = 2 * wrong.get(output, 0.0) * value / squares[output] + 2 * nothing[output]
            off = np.maximum(0.0, np.abs(own.value[:, 0] - expected) * value / squares[output] - known)
            estimate = own.error[:, 0] * value / squares[output]
            # what the dense solution loses where a contact's elongation is a difference of large numbers
            lost = 100 * rounding if output == "elongation" else rounding
            worst = max(worst, float(np.max(off[: len(plain.legs)])))
            excess = max(excess, float(np.max(off / (estimate + lost))))
    return worst, excess


@pytest.mark.parametrize("kind", MAKERS)
def test_every_slope_is_that_of_the_dense_solution(kind):
    """By every parameter of every law, every inertia, length and the speed, of accelerations, strokes and forces."""
    plain, speed = MAKERS[kind](np.random.default_rng(50)), 70.0
    found = ours(plain, np.array([speed]))
    worst, excess = compared(found, reference_of(plain, speed), 3 if len(plain.wheels) > 6 else 1)
    assert worst < 1e-9
    assert excess <= 1


# --- the paper's vehicle -----------------------------------------------------------------------------

VALUES = dict(vars(PAPER))
HALF = half_vehicle()
EVERYTHING = (*HALF.parameters, SPEED)


def paper_poles(**changed: float) -> np.ndarray:
    return np.linalg.eigvals(state_space(HALF, VALUES | changed).a)


def of_paper(wanted=EVERYTHING, changed=(), band=HERTZ, spectrum=TRACK) -> Gradients:
    """At 70 m/s; changed: values other than the paper's."""
    values = VALUES | dict(changed)
    reduction = reduce(HALF, outputs(), lengths_free(values, wanted))
    return gradients_of(reduction, values, wanted, np.array([70.0]), paper_poles(**dict(changed)), band, spectrum)


@lru_cache
def in_forty_digits(
    name: str, band: Band | None, changed: tuple[tuple[str, float], ...] = ()
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """(mean squares, p d/dp of them) of the paper's vehicle at 70 m/s by a central difference in forty digits."""
    values = VALUES | dict(changed)

    def squares(factor: mpf) -> dict[str, list[mpf]]:
        vehicle = {key: mpf(value) * (factor if key == name else 1) for key, value in values.items()}
        speed = mpf(70) * (factor if name == SPEED else 1)
        limits = None
        if band is not None and band.kind == "frequency":
            limits = tuple(2 * pi * mpf(x) for x in (band.low, band.high))
        elif band is not None:
            limits = tuple(2 * pi * speed / mpf(x) for x in (band.high, band.low))
        return forty_digits.mean_squares(vehicle, (TRACK.roughness, *TRACK.cutoffs), speed, limits)

    with mp.workdps(60):
        step = mpf(10) ** -9
        here, above, below = (squares(1 + k * step) for k in (0, 1, -1))
        return {
            key: (
                np.array([float(x) for x in here[key]]),
                np.array([float((a - b) / (2 * step)) for a, b in zip(above[key], below[key], strict=True)]),
            )
            for key in here
        }


def off_forty_digits(found: Gradients, band: Band | None, names=EVERYTHING, changed=()) -> tuple[float, float]:
    """(largest error of elasticities, largest over the estimate and what the difference leaves)."""
    worst = excess = 0.0
    for name in names:
        value = 70.0 if name == SPEED else (VALUES | dict(changed))[name]
        for output, (square, expected) in in_forty_digits(name, band, tuple(dict(changed).items())).items():
            own = found[output][name]
            off = np.abs(own.value[:, 0] * value - expected) / square
            worst = max(worst, float(np.max(off)))
            excess = max(excess, float(np.max(off / (own.error[:, 0] * value / square + 1e-15))))
    return worst, excess


BANDS = {"wavelengths": Band("wavelength", 1.0, 120.0), "hertz": Band("frequency", 0.5, 30.0)}


SOME = ("speed", "half_wheelbase", "half_bogie_spacing", "bogie_mass", "secondary_damping", "primary_joint_stiffness")


@pytest.mark.parametrize("band", BANDS)
def test_forty_digits_are_met(band):
    """A band in wavelengths moves with the speed."""
    names = SOME if band == "wavelengths" else SOME[:3]
    worst, excess = off_forty_digits(of_paper(band=BANDS[band]), BANDS[band], names)
    assert worst < 1e-10
    assert excess <= 1


def test_units_of_mass_and_time_are_ours_to_choose():
    """Euler: what has kilograms, and what has seconds, the speed included, adds up to no change of a stroke."""
    for found in (of_paper(band=BANDS["wavelengths"])[name] for name in ("primary_stroke", "secondary_stroke")):
        shares = {name: found[name].value * (70.0 if name == SPEED else VALUES[name]) for name in EVERYTHING}
        for some in euler_sums(shares, SPEED):
            assert np.max(np.abs(np.sum(some, axis=0))) < 1e-11 * np.max(np.abs(some))


def test_the_slope_of_an_rms_is_that_of_the_mean_square_over_twice_it():
    slope = MeanSquare(np.array([6.0]), np.array([0.6]))
    found = gradients.rms_gradient(MeanSquare(np.array([9.0]), np.array([0.9])), slope)
    np.testing.assert_allclose(found.value, 1.0)
    np.testing.assert_allclose(found.error, 0.1 + 0.05)


# --- grids -------------------------------------------------------------------------------------------


def grid_of_joints() -> tuple[Reduction, dict]:
    joints = np.geomspace(0.5e6, 100e6, 5)
    values = VALUES | {"primary_joint_stiffness": joints[:, None], "secondary_joint_stiffness": joints[:3]}
    return reduce(HALF, outputs(), lengths_free(values, EVERYTHING)), values


def test_the_bits_of_a_slope_do_not_depend_on_how_the_grid_is_cut():
    found, values = grid_of_joints()
    speed = np.array([40.0, 55.0, 80.0])
    whole = gradients_of(found, values, EVERYTHING, speed, paper_poles(), most=90)
    for most in (1, 3, 8):
        for cell in cells((5, 3), most):
            own = values | {
                "primary_joint_stiffness": values["primary_joint_stiffness"][cell[0]],
                "secondary_joint_stiffness": values["secondary_joint_stiffness"][cell[1]],
            }
            part = gradients_of(found, own, EVERYTHING, speed, paper_poles(), most=90)
            for output, by_name in whole.items():
                for name, slope in by_name.items():
                    index = (slice(None), *cell)
                    np.testing.assert_array_equal(part[output][name].value, slope.value[index])
                    np.testing.assert_array_equal(part[output][name].error, slope.error[index])


def test_what_is_wanted_beside_does_not_change_a_slope():
    """To rounding: lengths that stay numbers make other coordinates of the same blocks."""
    everything = of_paper()
    for names in (("secondary_damping",), ("half_wheelbase", SPEED), ("bogie_mass", "contact_stiffness")):
        for output, by_name in of_paper(names).items():
            assert tuple(by_name) == names
            for name, slope in by_name.items():
                expected = everything[output][name].value
                np.testing.assert_allclose(slope.value, expected, rtol=1e-10, atol=1e-12 * np.max(np.abs(expected)))


def test_a_parameter_that_an_output_does_not_feel_has_slope_zero():
    found = of_paper(("car_body_pitch_inertia", "car_body_mass"))
    assert not np.any(found["bogie_pitch_acceleration"]["car_body_mass"].value)
    assert not np.any(found["car_body_acceleration"]["car_body_pitch_inertia"].value[1])  # at its centre
    assert np.all(found["car_body_acceleration"]["car_body_pitch_inertia"].value[[0, 2]])


# --- symmetry that a parameter breaks ----------------------------------------------------------------


def with_pivots_of_their_own() -> Plain:
    """A car whose front and rear pivots have names of their own and, as it happens, one distance."""
    plain = one_car(np.random.default_rng(51))
    plain.values["pivot_rear"] = plain.values["pivot"]
    legs = []
    for name, row, kind, names in plain.legs:
        rear = name == "secondary_rear"
        own = {f: {"pivot_rear" if rear and x == "pivot" else x: y for x, y in arms.items()} for f, arms in row.items()}
        legs.append((name, own, kind, names))
    plain.legs = legs
    plain.wheels = [
        (name, on, kind, names, {"pivot_rear" if x == "pivot" and y < 0 else x: y for x, y in place.items()})
        for name, on, kind, names, place in plain.wheels
    ]
    return plain


def test_one_length_of_two_equal_ones_may_change_alone():
    """The vehicle is its own mirror image, and none any more as soon as one of them changes."""
    plain, speed = with_pivots_of_their_own(), 70.0
    found = ours(plain, np.array([speed]), ("pivot", "pivot_rear"))
    worst, excess = compared(found, reference_of(plain, speed))
    assert worst < 1e-10
    assert excess <= 1
    front, rear = (found["acceleration"][name].value for name in ("pivot", "pivot_rear"))
    some = rear != 0  # a bogie's pitch knows nothing of pivots, to the last bit
    assert not some.all()
    assert np.max(np.abs(front[some] / rear[some] - 1)) > 0.1


def test_a_reduction_that_holds_for_one_length_only_is_refused():
    plain = with_pivots_of_their_own()
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    with pytest.raises(ValueError, match=r"holds for pivot = .* only"):
        gradients_of(found, plain.values, ("pivot",), np.array([70.0]), poles_of(plain))


def test_names_that_are_none_and_nodes_without_weights_are_refused():
    with pytest.raises(ValueError, match="no parameter 'mass'"):
        of_paper(("mass",))
    found = reduce(HALF, outputs(), lengths_free(VALUES, EVERYTHING))
    limits, slopes = band_edges(HERTZ, TRACK, np.array([70.0]))
    rule = quadrature.quadrature(limits[:, 0])
    nodes = list(gradient_nodes(found, VALUES, TRACK, rule, np.array([70.0]), limits, slopes, ("bogie_mass",), 500))
    for name in (SPEED, "half_wheelbase"):
        with pytest.raises(ValueError, match=f"no weights for {name}"):
            gradients.mean_square_gradients(found, VALUES, nodes, (name,))


# --- scalars -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["front and rear differ", "three axles, off centre", "laws with inerters"])
def test_a_block_solved_by_lapack_has_the_slopes_of_its_elimination(kind):
    """At any complex s."""
    plain = MAKERS[kind](np.random.default_rng(50))
    system = as_system(plain)
    found = reduce(system, outputs_of(plain), lengths_free(plain.values, system.parameters))
    s = np.array([3 + 20j, -4 + 150j, 9j])
    one, other = (
        block_slopes.slopes(found, plain.values, s, s**2, system.parameters, exact)
        for exact in (frozenset(), frozenset(range(len(found.blocks))))
    )
    for k, slopes in enumerate(one.slopes):
        np.testing.assert_allclose(other.scalars[k], one.scalars[k], rtol=1e-8)
        for name, slope in slopes.items():
            size = np.abs(one.scalars[k] / plain.values[name])
            assert np.all(np.abs(other.slopes[k][name] - slope) < 1e-8 * (np.abs(slope) + size))


# --- limits ------------------------------------------------------------------------------------------


RIGID = {"primary_joint_stiffness": np.inf, "secondary_joint_stiffness": np.inf}


def test_rigid_joints_and_dampers_without_damping_have_slopes():
    """By the stiffness of what is rigid it is 0; by a damping of zero it is that of a damping near it. No warnings."""
    names = (*RIGID, "secondary_damping", "secondary_stiffness")
    near = RIGID | {"secondary_damping": 1e-9}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found, beside = of_paper(names, RIGID | {"secondary_damping": 0.0}), of_paper(names, near)
    for output, by_name in found.items():
        for name in RIGID:
            assert not np.any(by_name[name].value)
        for name in names[2:]:
            np.testing.assert_allclose(by_name[name].value, beside[output][name].value, rtol=1e-8)


def test_a_slope_at_a_resonance_without_damping_is_not_believed():
    """Without primary dampers nothing damps the bogies' pitch: there is no mean square, and the estimate knows it."""
    found = of_paper(("primary_damping",), RIGID | {"primary_damping": 0.0})
    for output in ("primary_stroke", "bogie_pitch_acceleration", "wheelset_acceleration"):
        slope = found[output]["primary_damping"]
        assert not np.any(slope.error < np.abs(slope.value))


@pytest.mark.parametrize("name", ["spring", "damping"])
def test_a_leg_without_any_force_has_the_slope_of_what_it_would_take(name):
    """Stroke and force of a leg whose spring and damper are zero, beside one that carries."""
    system = System(
        (Freedom("z", "m"), Freedom("w", "m_w")),
        (
            Leg("carries", {"z": 1.0, "w": -1.0}, Parallel((Spring("k"), Dashpot("c")))),
            Leg("idle", {"z": 1.0, "w": -1.0}, Parallel((Spring("spring"), Dashpot("damping")))),
        ),
        (Wheel("axle", {"w": 1.0}, Spring("hertz"), 0.0),),
    )
    taps = (("stroke", Elongation("idle")), ("other", Elongation("carries")))
    some = (Output("stroke", "m", "leg", taps), Output("z", "m s-2", "", (("", Displacement({"z": 1.0})),), 2))
    values = {"m": 1e4, "m_w": 1e3, "k": 1e6, "c": 3e4, "hertz": 1e9, "spring": 0.0, "damping": 0.0}
    found = reduce(system, some, values)
    poles = np.array([-2 + 10j, -20 + 1000j])
    speed = np.array([70.0])
    slope = gradients_of(found, values, (name,), speed, poles)
    # what the leg that carries has in its place, k or c, has the same effect
    twin = gradients_of(found, values, ({"spring": "k", "damping": "c"}[name],), speed, poles)
    for output, by_name in slope.items():
        (expected,) = twin[output].values()
        np.testing.assert_allclose(by_name[name].value, expected.value, rtol=1e-10)


TABLE = TabulatedSpectrum("measured", (0.05, 0.2, 0.7, 2.0), (3e-4, 4e-5, 6e-6, 2e-7))


@pytest.mark.parametrize("band", [HERTZ, Band("wavelength", 4.0, 60.0), Band("frequency", 1.0, 12.0)])
def test_the_ends_of_a_table_and_its_kinks_move_with_the_speed(band):
    """Against a difference of mean squares over bands that do not end where the table does, or do."""
    found = of_paper((SPEED,), band=band, spectrum=TABLE)

    def squares(speed: float) -> dict[str, np.ndarray]:
        v = np.array([speed])
        limits, _ = band_edges(band, TABLE, v)
        kinks = np.array(TABLE.wavenumbers) * speed
        ends = np.unique(np.concatenate([limits.ravel(), kinks[(kinks > limits[0]) & (kinks < limits[1])]]))
        reduction = reduce(HALF, outputs(), VALUES)
        rule = quadrature.quadrature(quadrature.panel_edges(ends, paper_poles(), 8 / speed, 1.5))
        nodes = block_lags.weighted_nodes(reduction, reduction.places(VALUES), TABLE, rule, v, limits, 500)
        return {k: m.value for k, m in block_quadrature.mean_squares(reduction, VALUES, nodes).items()}

    step = 2e-3
    pairs = [(squares(70 + k * step), squares(70 - k * step)) for k in (1, 2)]
    for output, by_name in found.items():
        one, two = ((a[output] - b[output]) / (2 * k * step) for k, (a, b) in enumerate(pairs, start=1))
        np.testing.assert_allclose(by_name[SPEED].value, (4 * one - two) / 3, rtol=2e-9)


# --- the checks can fail -----------------------------------------------------------------------------


def without_ends(own=lag_slopes.band_edges):
    return lambda *arguments: (own(*arguments)[0], np.zeros((2, 1)))


def places_held(own=lag_slopes.lag_slopes):
    return lambda reduction, places, move, delay: 0.0 * own(reduction, places, move, delay)


def rows_held(own=block_slopes._Block):
    class Held(own):
        entries = ()

    return Held


def track_held(own=lag_slopes.angular_psd_slope):
    return lambda spectrum, omega, speed: -own(spectrum, omega, speed)


FAULTS = {
    "limits of the band held": ("band_edges", without_ends(), SPEED),
    "wheels held": (lag_slopes, "lag_slopes", places_held(), "half_bogie_spacing"),
    "rows held": (block_slopes, "_Block", rows_held(), "half_bogie_spacing"),
    "track turned": (lag_slopes, "angular_psd_slope", track_held(), SPEED),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found(fault, monkeypatch):
    *where, instead, name = FAULTS[fault]
    band = BANDS["wavelengths"]
    if len(where) == 1:
        monkeypatch.setitem(globals(), where[0], instead)
    else:
        monkeypatch.setattr(*where, instead)
    worst, _ = off_forty_digits(of_paper((name,), band=band), band, (name,))
    assert worst > 1e-4
