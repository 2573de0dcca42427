"""Mean squares by quadrature that follows the poles, against integrals taken another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import chebyshev, legendre

from freqrail.model.band import Band, band_limits
from freqrail.model.inputs import wheel_lags
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.vehicle import Vehicle
from freqrail.solver import block_quadrature, quadrature, rounding
from freqrail.solver.block_lags import weighted_nodes
from freqrail.solver.problem import Problem, half_vehicle_problem
from freqrail.solver.resonances import every_pole, resonances
from tests.chains import FAMILIES, chain_responses
from tests.helpers import (
    ALL_NAMES,
    PAPER_NAMES,
    all_poles,
    density,
    explicit_responses,
    from_chains,
    lags,
    random_vehicles,
    reference_nodes,
    reference_rms,
)

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
BAND = 2 * np.pi * np.array([0.1, 100.0])


def problem(vehicle: Vehicle, names: tuple[str, ...]) -> Problem:
    return half_vehicle_problem(vehicle, np.array([]), TRACK, None, names)


def poles(vehicle: Vehicle) -> np.ndarray:
    of = problem(vehicle, ALL_NAMES)
    return every_pole(resonances(of.reduction, of.values))


def package_edges(poles: np.ndarray, vehicle: Vehicle, speed: float, limits: np.ndarray, refine: float) -> np.ndarray:
    places = np.append(poles, -speed * np.array(TRACK.cutoffs))
    return quadrature.panel_edges(np.asarray(limits), places, float(wheel_lags(vehicle, speed)[-1]), refine)


def mean_squares(
    vehicle: Vehicle,
    names: tuple[str, ...],
    rule: quadrature.Quadrature,
    speeds: np.ndarray,
    limits: np.ndarray,
    lost: dict[str, np.ndarray] | float = quadrature.ROUNDING,
) -> dict[str, quadrature.MeanSquare]:
    """Of a half vehicle, or of a grid whose wheels stand alike."""
    of = problem(vehicle, names)
    places = of.reduction.places(of.at((0,) * len(of.vehicles)).values)
    nodes = weighted_nodes(of.reduction, places, TRACK, rule, speeds, limits, most=100)
    return block_quadrature.mean_squares(of.reduction, of.values, nodes, lost)


def truncation_bound(vehicle: Vehicle, names: tuple[str, ...], speed: float, cutoff: float) -> dict[str, np.ndarray]:
    """Beyond the cut-off, {name: [labels]}."""
    of = problem(vehicle, names)
    found = block_quadrature.truncation_bound(of.reduction, of.values, TRACK, np.array([speed]), cutoff)
    return {name: bound[:, 0] for name, bound in found.items()}


def package(
    vehicle: Vehicle, speed: float, limits: np.ndarray, names: tuple[str, ...] = PAPER_NAMES, refine: float = 1.0
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """(RMS, relative error estimate) of the module's own recipe, {name: ([positions], [positions])}."""
    found = poles(vehicle)
    rule = quadrature.quadrature(package_edges(found, vehicle, speed, limits, refine))
    limits = np.reshape(limits, (2, 1))
    lost = dict.fromkeys(names, rounding.rounding(found, limits))
    squares = mean_squares(vehicle, names, rule, np.array([speed]), limits, lost)
    return {k: (np.sqrt(m.value[:, 0]), m.error[:, 0] / m.value[:, 0] / 2) for k, m in squares.items()}


def soft(vehicle: Vehicle) -> Vehicle:
    """Table I's softest corner."""
    return replace(vehicle, primary_joint_stiffness=0.5e6, secondary_joint_stiffness=0.5e6)


# --- the rule ----------------------------------------------------------------------------------------


def test_kronrod_is_exact_to_degree_31_and_gauss_to_19():
    rule = quadrature.quadrature(np.array([-1.0, 1.0]))
    gauss = rule.omega[: rule.gauss_weights.size]
    for degree in range(33):
        polynomial = np.zeros(degree + 1)
        polynomial[degree] = 1.0
        antiderivative = chebyshev.chebint(polynomial)
        exact = chebyshev.chebval(1.0, antiderivative) - chebyshev.chebval(-1.0, antiderivative)
        kronrod_error = abs(rule.weights @ chebyshev.chebval(rule.omega, polynomial) - exact)
        gauss_error = abs(rule.gauss_weights @ chebyshev.chebval(gauss, polynomial) - exact)
        assert (kronrod_error < 1e-14) == (degree <= 31 or degree % 2 == 1)
        assert (gauss_error < 1e-14) == (degree <= 19 or degree % 2 == 1)


def test_the_embedded_rule_is_gauss_legendre():
    rule = quadrature.quadrature(np.array([-1.0, 1.0]))
    x, w = legendre.leggauss(10)
    order = np.argsort(rule.omega[:10])
    np.testing.assert_allclose(rule.omega[:10][order], x, atol=1e-15)
    np.testing.assert_allclose(rule.gauss_weights[order], w, atol=1e-15)


def test_panels_of_unequal_length_join_without_gap_or_overlap():
    edges = np.array([0.5, 0.75, 2.0, 2.001, 9.0])
    rule = quadrature.quadrature(edges)
    gauss = rule.omega[: rule.gauss_weights.size]
    for power in (0, 1, 7):
        exact = (edges[-1] ** (power + 1) - edges[0] ** (power + 1)) / (power + 1)
        assert rule.weights @ rule.omega**power == pytest.approx(exact, rel=1e-14, abs=0)
        assert rule.gauss_weights @ gauss**power == pytest.approx(exact, rel=1e-14, abs=0)
    assert np.array_equal(np.histogram(rule.omega, edges)[0], [21] * 4)


# --- the panels --------------------------------------------------------------------------------------


@pytest.mark.parametrize("damping", [1e-1, 1e-3, 1e-6, 1e-9])
def test_panels_close_in_on_a_narrow_pole(damping):
    pole = 1225.0 * np.array([-damping + 1j, -damping - 1j])
    edges = quadrature.panel_edges(np.array([1.0, 3000.0]), pole, longest_lag=0.0)
    assert np.all(np.diff(edges) > 0)
    length = np.diff(edges)
    at_pole = length[(edges[:-1] <= 1225.0) & (edges[1:] >= 1225.0)]
    assert at_pole.size
    assert np.all(at_pole <= quadrature.POLE_DISTANCE * 1225.0 * damping * (1 + 1e-9) + 1e-12)  # edges are rounded
    # and no panel anywhere is longer than that multiple of its distance from the pole
    beside = np.maximum(0, np.maximum(edges[:-1] - 1225.0, 1225.0 - edges[1:]))
    assert np.all(length <= quadrature.POLE_DISTANCE * np.hypot(beside, 1225.0 * damping) * (1 + 1e-9) + 1e-11)
    assert edges.size < 60 + 10 * np.log2(1 / damping)  # in a geometric progression, not in steps


@pytest.mark.parametrize("before", [0.0, 1.0, 2.0, 2.25, 2.35])
def test_a_pole_within_a_panel_allows_a_multiple_of_its_width(before):
    """From wherever the panel starts, as long as it reaches the pole; `before` in half-widths."""
    pole = np.array([-10.0 + 1000j])
    edges = quadrature.panel_edges(np.array([1000.0 - 10 * before, 3000.0]), pole, longest_lag=0.0)
    assert edges[1] - edges[0] == pytest.approx(10 * quadrature.POLE_DISTANCE)


def test_an_undamped_pole_is_passed_in_steps_that_rounding_can_tell_apart():
    edges = quadrature.panel_edges(np.array([1.0, 3000.0]), np.array([1225j]), longest_lag=0.0)
    assert np.all(np.diff(edges) > 0)
    assert np.min(np.diff(edges)) == pytest.approx(
        1225 * quadrature.NARROWEST, rel=0.2, abs=0
    )  # of numbers whose last bit is 2e-13
    assert edges.size < 200


def test_the_last_panel_is_never_empty():
    edges = quadrature.panel_edges(np.array([0.0, 2 * quadrature.PANEL_PHASE]), np.array([-1e9 + 0j]), longest_lag=1.0)
    assert edges.tolist() == [0.0, quadrature.PANEL_PHASE, 2 * quadrature.PANEL_PHASE]


def test_panels_are_short_against_the_lag():
    edges = quadrature.panel_edges(np.array([1.0, 3000.0]), np.array([-1e9 + 0j]), longest_lag=0.5)
    assert np.max(np.diff(edges)) * 0.5 <= quadrature.PANEL_PHASE
    assert np.max(np.diff(edges)) * 0.5 == pytest.approx(quadrature.PANEL_PHASE)  # and no shorter than that
    finer = quadrature.panel_edges(np.array([1.0, 3000.0]), np.array([-1e9 + 0j]), longest_lag=0.5, refine=4.0)
    assert np.max(np.diff(finer)) * 0.5 <= quadrature.PANEL_PHASE / 4


def test_the_fewest_nodes_are_those_that_the_lags_call_for():
    """Where no pole is near, the rule has as many nodes, but for the last panel, which may be short."""
    given, lag = np.array([1000.0, 1500.0, 3000.0]), 5.0
    rule = quadrature.quadrature(quadrature.panel_edges(given, np.array([-1e9 + 0j]), lag))
    assert 0 <= rule.omega.size - quadrature.fewest_nodes(given, lag) < 2 * 21


def test_no_panel_straddles_an_edge_that_was_given():
    given = np.array([1.0, 3.3, 7.7, 1225.0, 1900.0])
    edges = quadrature.panel_edges(given, 1225.0 * np.array([-1e-4 + 1j, -0.1 + 0.3j]), longest_lag=0.1)
    assert np.all(np.isin(given, edges))
    assert edges[0] == given[0]
    assert edges[-1] == given[-1]
    assert np.all(np.diff(edges) > 0)


# --- the integral ------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [100 / 3.6, 300 / 3.6])
@pytest.mark.parametrize("which", ["paper", "softest", "traditional", "random 0", "random 1"])
def test_rms_equals_an_integral_that_adds_the_lags_one_by_one(paper_vehicle, which, speed):
    """0.1 to 100 Hz, from equations of motion and a composite Gauss-Legendre rule of the test's own."""
    vehicle = {
        "paper": paper_vehicle,
        "softest": soft(paper_vehicle),
        "traditional": paper_vehicle.traditional(),
        **{f"random {k}": vehicle for k, vehicle in enumerate(random_vehicles(2, seed=21))},
    }[which]
    expected = reference_rms(vehicle, TRACK, speed, *BAND, names=ALL_NAMES)
    for name, (found, _) in package(vehicle, speed, BAND, ALL_NAMES).items():
        np.testing.assert_allclose(found, expected[name], rtol=1e-9)


def test_the_reference_itself_is_converged(paper_vehicle):
    """A different number of nodes a panel changes nothing in the integral that the others are held to."""
    vehicle, speed = soft(paper_vehicle), 250 / 3.6
    coarse, fine = (reference_rms(vehicle, TRACK, speed, *BAND, nodes=n) for n in (20, 32))
    for name in PAPER_NAMES:
        np.testing.assert_allclose(coarse[name], fine[name], rtol=1e-12)


def test_each_speed_is_integrated_over_its_own_wavelengths(paper_vehicle):
    speeds = np.array([100.0, 170.0, 300.0]) / 3.6
    limits = band_limits(Band("wavelength", 2.0, 60.0), speeds)
    edges = quadrature.panel_edges(np.unique(limits), all_poles(paper_vehicle, TRACK, 50.0), 0.3)
    rule = quadrature.quadrature(edges)
    squares = mean_squares(paper_vehicle, PAPER_NAMES, rule, speeds, limits)
    for k, speed in enumerate(speeds):
        expected = reference_rms(paper_vehicle, TRACK, speed, 2 * np.pi * speed / 60, 2 * np.pi * speed / 2)
        for name in PAPER_NAMES:
            np.testing.assert_allclose(np.sqrt(squares[name].value[:, k]), expected[name], rtol=1e-9)


@pytest.mark.parametrize("shape", [(), (3,), (5, 7)])
def test_as_many_speeds_and_vehicles_as_one_likes(paper_vehicle, shape):
    """More than one product holds, whose sizes are small: the values are those of single speeds, one by one."""
    joints = np.geomspace(1e6, 1e8, int(np.prod(shape))).reshape(shape)
    vehicle = replace(paper_vehicle, primary_joint_stiffness=joints if shape else 5e6)
    speeds = np.linspace(20.0, 90.0, 2 * quadrature.SPEEDS + 7)
    limits = np.repeat(BAND[:, None], speeds.size, axis=1)
    softest = soft(paper_vehicle)
    rule = quadrature.quadrature(package_edges(poles(softest), softest, speeds[0], BAND, 1.0))

    def squares(some: slice) -> dict[str, quadrature.MeanSquare]:
        return mean_squares(vehicle, PAPER_NAMES, rule, speeds[some], limits[:, some])

    together = squares(slice(None))
    for k in (0, quadrature.SPEEDS - 1, quadrature.SPEEDS, speeds.size - 1):
        alone = squares(slice(k, k + 1))
        for name in PAPER_NAMES:
            assert together[name].value.shape[1:] == (*shape, speeds.size)
            np.testing.assert_allclose(together[name].value[..., k], alone[name].value[..., 0], rtol=1e-12)
            np.testing.assert_allclose(together[name].error[..., k], alone[name].error[..., 0], rtol=1e-3)


@pytest.mark.parametrize("which", ["softest", "paper"])
def test_the_ringing_of_the_wheelsets_is_integrated_not_stepped_over(paper_vehicle, which):
    """0.1 to 500 Hz holds the resonance near 195 Hz, of damping ratio 1.4e-6 in the softest corner.

    Rounding alone leaves 2e-16 / 1.4e-6 = 1.6e-10 in either value.
    """
    vehicle = soft(paper_vehicle) if which == "softest" else paper_vehicle
    speed, limits = 250 / 3.6, 2 * np.pi * np.array([0.1, 500.0])
    expected = reference_rms(vehicle, TRACK, speed, *limits, names=ALL_NAMES)
    for name, (found, estimate) in package(vehicle, speed, limits, ALL_NAMES).items():
        np.testing.assert_allclose(found, expected[name], rtol=1e-8)
        assert np.all(estimate < 1e-6)


def test_a_narrow_peak_holds_what_a_resonance_of_its_width_and_height_must(paper_vehicle):
    """At the car's centre one mode rings: its mean square is 2 atan(d/w) w |T|^2 G for half-width w in a band +-d."""
    vehicle, speed = soft(paper_vehicle), 250 / 3.6
    candidates = [p for p in all_poles(vehicle, TRACK, speed) if 1000 < p.imag < 1500]
    peak, height = None, 0.0
    for pole in candidates:
        omega = np.array([pole.imag])
        transfer = explicit_responses(vehicle, omega, speed, ("car_body_acceleration",))["car_body_acceleration"][1]
        power = (np.abs(transfer) ** 2 * density(TRACK, omega, speed))[0]
        if power > height:
            peak, height = pole, power
    assert -peak.real / peak.imag == pytest.approx(1.4e-6, rel=0.05, abs=0)
    limits = peak.imag * np.array([0.9995, 1.0005])
    width, side = -peak.real, 0.0005 * peak.imag
    found, _ = package(vehicle, speed, limits, ("car_body_acceleration",))["car_body_acceleration"]
    assert found[1] ** 2 == pytest.approx(2 * np.arctan(side / width) * width * height, rel=1e-4, abs=0)
    # a grid of 200 frequencies in this band, and of half a million from 0 to 500 Hz, misses it
    frequency = np.linspace(limits[0], limits[1], 200)
    coarse = explicit_responses(vehicle, frequency, speed, ("car_body_acceleration",))["car_body_acceleration"][1]
    stepped = np.trapezoid(np.abs(coarse) ** 2 * density(TRACK, frequency, speed), frequency)
    assert abs(stepped / found[1] ** 2 - 1) > 0.1


# --- the error estimate ------------------------------------------------------------------------------


def test_the_estimate_is_never_below_the_error():
    """1,000 random vehicles, bands and speeds: soft, stiff and rigid joints, peaks inside, beside and at the edges."""
    rng = np.random.default_rng(23)
    worst = 0.0
    for k, vehicle in enumerate(random_vehicles(1000, seed=37)):
        vehicle = vehicle.traditional() if k % 8 == 0 else vehicle
        speed = rng.uniform(20, 600) / 3.6
        low, high = np.sort(10 ** rng.uniform(-2, 2.5, 2))
        limits = 2 * np.pi * np.array([low, max(high, 1.1 * low)])
        expected = reference_rms(vehicle, TRACK, speed, *limits, names=ALL_NAMES, transfer=from_chains, nodes=20)
        for name, (found, estimate) in package(vehicle, speed, limits, ALL_NAMES).items():
            error = np.abs(found / expected[name] - 1)
            assert np.all(error <= estimate)
            assert np.all(error <= 1e-8)
            worst = max(worst, np.max(error / estimate))
    assert worst > 1e-3  # nor does it cry wolf


@pytest.mark.parametrize("refine", [0.2, 0.35, 0.5, 0.7])
def test_the_estimate_knows_panels_that_are_too_long(refine):
    """Panels far too long and too long: 60 random vehicles, speeds and bands each."""
    rng = np.random.default_rng(17)
    bands = ((0.1, 100.0), (0.5, 20.0), (1.0, 300.0), (0.01, 50.0))
    largest = 0.0
    for k, vehicle in enumerate(random_vehicles(60, seed=31, joints=(2e6, 100e6))):
        vehicle = vehicle.traditional() if k % 5 == 0 else vehicle
        speed, limits = rng.uniform(8, 90), 2 * np.pi * np.array(bands[k % 4])
        expected = reference_rms(vehicle, TRACK, speed, *limits, names=ALL_NAMES, transfer=from_chains, nodes=16)
        for name, (found, estimate) in package(vehicle, speed, limits, ALL_NAMES, refine).items():
            error = np.abs(found / expected[name] - 1)
            assert np.all(error <= estimate + 1e-12)  # the last is what the reference itself may be off
            largest = max(largest, error.max())
    assert largest > 1e-10  # there was something to estimate


def test_the_estimate_knows_what_a_narrow_resonance_makes_of_rounding(paper_vehicle):
    """Rounding moves the poles' real parts: values are off by about 2e-16 over the damping ratio, not by 2e-16.

    Against 30 digits that was 1.3e-11 in Table I's softest corner, in both of these evaluations.
    """
    speed, limits = 250 / 3.6, 2 * np.pi * np.array([100.0, 500.0])
    vehicle = soft(paper_vehicle)
    expected = reference_rms(vehicle, TRACK, speed, *limits, transfer=from_chains, nodes=32)
    for name, (found, estimate) in package(vehicle, speed, limits, refine=2.0).items():
        assert np.all(np.abs(found / expected[name] - 1) <= estimate)


@pytest.mark.parametrize(
    ("pole", "limits", "sharpness"),
    [
        (-0.1 + 100j, (10.0, 1000.0), 1000.0),  # one over twice the damping ratio, but for the factor 2
        (-0.1 + 100j, (10.0, np.inf), 1000.0),
        (-1.0 + 2000j, (10.0, 1000.0), 2.0),  # beyond the band: as far off as the band's end is from it
        (-1.0 + 2000j, (4000.0, 5000.0), 1.0),
        (-3.0 + 0j, (10.0, 1000.0), 0.0),  # no resonance
    ],
)
def test_rounding_counts_how_sharp_a_resonance_the_band_sees(pole, limits, sharpness):
    lost = rounding.rounding(np.array([pole]), np.array(limits)[:, None]) - quadrature.ROUNDING
    narrow = limits[1] / (limits[1] - limits[0]) if np.isfinite(limits[1]) else 1.0
    assert lost == pytest.approx(4 * np.finfo(float).eps * (sharpness + narrow), rel=1e-3, abs=0)


def test_the_sharpest_of_the_resonances_counts():
    sharp, blunt, limits = -0.1 + 100j, -10 + 100j, np.array([[10.0], [1000.0]])
    both, alone = (rounding.rounding(np.array(some), limits) for some in ([blunt, sharp], [sharp]))
    assert both == alone
    assert alone > rounding.rounding(np.array([blunt]), limits)


def test_the_bound_beyond_the_last_node_is_exact_for_a_mass_on_its_spring(paper_vehicle):
    """Far up |T| of a wheelset is K_H/M_w in every chain and G falls with omega^-4: 3 times 3 times the integral."""
    speed, cutoff = 60.0, 2 * np.pi * 1e5
    (bound,) = truncation_bound(paper_vehicle, ("wheelset_acceleration",), speed, cutoff).values()
    power = (paper_vehicle.contact_stiffness / paper_vehicle.wheelset_mass) ** 2
    tail = TRACK.roughness * TRACK.cutoffs[1] ** 2 * speed**3 / (3 * cutoff**3)
    np.testing.assert_allclose(bound, 9 * power * tail, rtol=1e-3)


@pytest.mark.parametrize("name", ALL_NAMES)
def test_the_bound_beyond_the_last_node_is_that_of_its_blocks_whatever_their_phases(paper_vehicle, name):
    """n sum of |X|^2 G over its n blocks (Cauchy, Schwarz), by a rule of the test's own above all resonances."""
    speed, cutoff = 60.0, 2 * np.pi * 400.0
    bound = truncation_bound(paper_vehicle, (name,), speed, cutoff)[name]
    x, w = legendre.leggauss(200)
    omega, weight = cutoff * np.exp(5 + 5 * x), 5 * w
    series, chains = FAMILIES[name], chain_responses(paper_vehicle, omega)
    arm = getattr(paper_vehicle, series.arm) if series.arm else 1.0
    weighted = omega ** (2 * series.derivative) * density(TRACK, omega, speed) * weight * omega
    part = {c: np.abs(chains[c].ratios[series.element] * chains[c].top / arm) ** 2 @ weighted for c in series.chains}
    for found, (sigma, _) in zip(bound, series.signs, strict=True):  # at the car's centre there is no pitch
        some = [value for chain, value in part.items() if sigma or chain != "pitch"]
        assert found == pytest.approx(len(some) * sum(some), rel=1e-6, abs=0)


def test_what_lies_beyond_the_last_node_is_bounded(paper_vehicle):
    """Ten octaves above the cut-off hold less than the bound, and not so much less that the bound says nothing."""
    speed, cutoff = 60.0, 2 * np.pi * 1000.0
    bound = truncation_bound(paper_vehicle, ALL_NAMES, speed, cutoff)
    upper = 8 * cutoff
    omega, weights = reference_nodes(
        cutoff, upper, all_poles(paper_vehicle, TRACK, speed), lags(paper_vehicle, speed)[-1]
    )
    weighted = density(TRACK, omega, speed) * weights
    for name, transfer in from_chains(paper_vehicle, omega, speed, ALL_NAMES).items():
        beyond = np.abs(transfer) ** 2 @ weighted
        assert np.all(beyond < bound[name])
        assert np.all(beyond > bound[name] / 30)
