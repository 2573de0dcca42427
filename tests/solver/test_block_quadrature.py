"""Mean squares over a band, by columns and blocks, against sums over wheels of a dense solution on nodes of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.model.assembled import state_space
from freqrail.model.band import Band
from freqrail.model.responses import RESPONSES
from freqrail.model.spectrum import RationalSpectrum, angular_psd
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import reduce
from freqrail.solver import block_lags, block_quadrature, panels, quadrature
from freqrail.solver.problem import Problem, cells, half_vehicle_problem
from freqrail.solver.quadrature import MeanSquare
from tests.chains import FAMILIES, chain_responses, column_powers, column_signs, lag_columns, top_products
from tests.helpers import density, reference_nodes
from tests.plain_vehicles import MAKERS, Plain, as_system, dense_outputs, lagged, outputs_of, places

BAND = 2 * np.pi * np.array([0.1, 60.0])


def poles_of(plain: Plain) -> np.ndarray:
    """Eigenvalues of the assembled equations; of a vehicle with irrational laws a ladder of guesses."""
    try:
        return np.linalg.eigvals(state_space(as_system(plain), plain.values).a)
    except ValueError:
        return 2 * np.pi * np.geomspace(0.1, 100, 60) * (-0.3 + 1j)


def ours(plain: Plain, spectrum: RationalSpectrum, speed: np.ndarray) -> dict[str, MeanSquare]:
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    x = found.places(plain.values)
    edges = quadrature.panel_edges(BAND, poles_of(plain), float(np.ptp(x)) / speed.min())
    limits = np.repeat(BAND[:, None], speed.size, axis=1)
    weighted = block_lags.weighted_nodes(found, x, spectrum, quadrature.quadrature(edges), speed, limits, 500)
    return block_quadrature.mean_squares(found, plain.values, weighted)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", MAKERS)
def test_every_mean_square_is_that_of_the_dense_solution(kind, seed, german_low):
    """Accelerations, strokes and forces of everything: the error is below its estimate, and 1e-10."""
    plain = MAKERS[kind](np.random.default_rng(40 + seed))
    speed = np.array([20.0, 70.0])
    found = ours(plain, german_low, speed)
    for k, v in enumerate(speed):
        omega, weights = reference_nodes(*BAND, poles_of(plain), float(np.ptp(places(plain))) / v)
        for name, per_wheel in dense_outputs(plain, omega).items():
            transfer = np.array([lagged(row, plain, omega, v) for row in per_wheel])
            expected = np.abs(transfer) ** 2 @ (density(german_low, omega, v) * weights)
            value, error = found[name].value[:, k], found[name].error[:, k]
            # what the dense solution loses where a contact's elongation is a difference of large numbers
            lost = 1e-9 if name == "elongation" else 1e-11
            assert np.all(np.abs(value - expected) <= error + lost * expected)


def paper_grid(vehicle: Vehicle) -> Vehicle:
    joints = np.geomspace(0.5e6, 100e6, 6)
    return replace(vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints[:4])


def paper_study(vehicle: Vehicle, spectrum: RationalSpectrum) -> Problem:
    return half_vehicle_problem(
        vehicle, np.array([100.0, 180, 300]) / 3.6, spectrum, Band("frequency", 0.1, 100.0), tuple(RESPONSES)
    )


def nodes_of(study: Problem, rule: quadrature.Quadrature, most: int) -> list[quadrature.WeightedNodes]:
    x = block_lags.places_of(study.reduction, study.values, (0,) * len(study.vehicles))
    return list(block_lags.weighted_nodes(study.reduction, x, study.spectrum, rule, study.speed, study.limits, most))


def chain_squares(study: Problem, vehicle: Vehicle, rule: quadrature.Quadrature) -> dict[str, MeanSquare]:
    """Mean squares by the chains' columns, and the sums of their columns' differences of two rules, as `error`."""
    one = vehicle.at((0, 0))
    columns = lag_columns(one, rule.omega, study.speed)
    inside = (rule.omega[:, None] > study.limits[0]) & (rule.omega[:, None] < study.limits[1])
    columns = columns * angular_psd(study.spectrum, rule.omega[:, None], study.speed) * inside
    chains = chain_responses(vehicle.column(), rule.omega)
    gauss = rule.gauss_weights.size
    result = {}
    for name in study.names:
        series = FAMILIES[name]
        value, difference = np.zeros((2, len(series.signs), *study.shape))
        for column, power in column_powers(series, vehicle.column(), rule.omega, chains, top_products(chains)):
            total = power @ (columns[column] * rule.weights[:, None])
            embedded = power[..., :gauss] @ (columns[column, :gauss] * rule.gauss_weights[:, None])
            for place, position in enumerate(series.signs):
                sign = column_signs(position)[column]
                value[place] += sign * total
                difference[place] += abs(sign) * np.abs(total - embedded)
        result[name] = MeanSquare(value, difference)
    return result


def test_the_papers_grid_is_what_the_chains_give(paper_vehicle, german_low):
    """To 1e-12, values and error estimates, with the same nodes."""
    vehicle = paper_grid(paper_vehicle)
    study = paper_study(vehicle, german_low)
    (shared,) = panels.shared_panels(study)
    rule = quadrature.quadrature(shared.edges)
    after = block_quadrature.mean_squares(
        study.reduction, study.values, nodes_of(study, rule, quadrature.NODES), shared.rounding_errors
    )
    for name, before in chain_squares(study, vehicle, rule).items():
        np.testing.assert_allclose(after[name].value, before.value, rtol=1e-12)
        # an estimate is the 1.5th power of a difference of two rules, which itself is rounded
        apart = np.minimum(1.0, (quadrature.CAUTION * before.error / before.value) ** 1.5)
        expected = before.value * (apart + shared.rounding_errors[name])
        np.testing.assert_allclose(after[name].error, expected, rtol=0.05)


def test_the_bits_of_a_value_do_not_depend_on_how_the_grid_is_cut(paper_vehicle, german_low):
    study = paper_study(paper_grid(paper_vehicle), german_low)
    weighted = nodes_of(study, quadrature.quadrature(np.linspace(1.0, 300.0, 12)), 60)
    whole = block_quadrature.mean_squares(study.reduction, study.values, weighted)
    for most in (1, 3, 8):
        for cell in cells(study.vehicles, most):
            part = block_quadrature.mean_squares(study.reduction, study.cut(cell).values, weighted)
            for name in study.names:
                index = (slice(None), *cell)
                np.testing.assert_array_equal(part[name].value, whole[name].value[index])
                np.testing.assert_array_equal(part[name].error, whole[name].error[index])


def test_products_of_opposed_wheels_vanish_to_the_last_bit():
    """Wheels at x and -x have conjugate waves, so that a sum that is real by symmetry has no imaginary part."""
    real, imaginary = block_lags.wheel_waves(
        block_lags.centred(np.array([9.1, 6.9, -6.9, -9.1]) + 4.0), np.geomspace(0.01, 90, 50)
    )
    np.testing.assert_array_equal(imaginary[0] + imaginary[3], 0.0)
    np.testing.assert_array_equal(real[0], real[3])
