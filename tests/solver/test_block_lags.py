"""Lag functions: cosines and sines of the wheels' distances, to the last digits also where they cancel."""

import mpmath
import numpy as np
import pytest

from freqrail.reduction.columns import reduce
from freqrail.solver.block_lags import lag_functions
from freqrail.solver.problem import half_vehicle_reduction
from tests.helpers import ALL_NAMES
from tests.plain_vehicles import MAKERS, as_system, outputs_of


def exact(lag, places, delay):
    """A lag function in 40 digits."""
    with mpmath.workdps(40):
        waves = [mpmath.expj(mpmath.mpf(float(delay)) * mpmath.mpf(float(x))) for x in places]
        one, other = (
            mpmath.fsum(mpmath.mpf(float(w)) * u for w, u in zip(weights, waves, strict=True) if w)
            for weights in (lag.one, lag.other)
        )
        product = one * mpmath.conj(other)
        return float(mpmath.mpf(lag.factor) * (product.real if lag.part == "re" else product.imag))


@pytest.mark.parametrize("delay", [1e-9, 1e-6, 1e-3, 0.1, 1.0, 30.0])
def test_nothing_is_lost_where_the_wheels_stand_close_for_the_wave(delay):
    """Wavelengths from 0.2 m to a million kilometres: differences of waves are as small as their delays."""
    reduction = half_vehicle_reduction(ALL_NAMES)
    places = np.array([4.0859375, 2.4921875, -2.4921875, -4.0859375])  # whole in binary: distances are exact
    found = lag_functions(reduction, places, np.array([delay]))[:, 0]
    expected = np.array([exact(lag, places, delay) for lag in reduction.lags])
    assert np.all(np.abs(found - expected) <= 1e-13 * np.abs(expected) + 1e-16 * max(1.0, delay))
    small = np.abs(expected) < 1e-3
    if delay <= 1e-6:
        assert small.any()
        assert np.all(np.abs(found[small] / expected[small] - 1) < 1e-13)


@pytest.mark.parametrize("kind", ["three-axle bogies", "two coupled cars", "front and rear differ"])
def test_of_any_vehicle_they_are_products_of_sums_over_the_wheels(kind):
    plain = MAKERS[kind](np.random.default_rng(3))
    reduction = reduce(as_system(plain), outputs_of(plain), plain.values)
    places = reduction.places(plain.values)
    for delay in (1e-3, 0.4):
        found = lag_functions(reduction, places, np.array([delay]))[:, 0]
        expected = np.array([exact(lag, places, delay) for lag in reduction.lags])
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)
