"""Intervals that cover what they say, and verdicts of numbers that stand, do not, or are not there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.confirm import statistics, time_side
from freqrail.confirm.time_side import OperatingPoint
from freqrail.confirm.track_record import gaussian_amplitudes, mean_square, spectral_lines, stream
from freqrail.model import responses
from freqrail.model.spectrum import RationalSpectrum
from freqrail.result import verdicts
from tests.confirm.test_simulation import BAND, SHORT, reference


@pytest.fixture(scope="module")
def point(paper_vehicle, german_low) -> OperatingPoint:
    return OperatingPoint(paper_vehicle, 250 / 3.6, german_low, "speed=250 km/h")


def test_the_interval_covers_the_true_rms_in_95_per_cent_of_2000_seeds(point):
    """Closed-form line RMS, nothing integrated: all eleven series of both models."""
    plan = replace(SHORT, period=60.0, realisations=1)
    lines = spectral_lines(point.spectrum, point.speed, BAND, plan.period)
    power = time_side.line_power(point, responses.PAPER, lines.frequency)
    degrees = statistics.degrees_of_freedom(power, lines, plan.realisations)
    true = reference(point)
    covered = np.zeros(true.shape)
    for seed in range(2000):
        record = gaussian_amplitudes(lines, stream(seed, point.key, "gaussian", 1))
        low, high = statistics.interval(np.sqrt(mean_square(power, record[None])[..., 0]), degrees)
        covered += (low <= true) & (true <= high)
    share = covered / 2000
    assert share.min() > 0.935
    assert share.max() < 0.965


def test_the_sum_over_lines_is_the_rms_over_the_continuous_spectrum(point):
    lines = spectral_lines(point.spectrum, point.speed, BAND, 60.0)
    power = time_side.line_power(point, responses.PAPER, lines.frequency)
    total = np.sqrt(power @ lines.amplitude**2 / 2)
    np.testing.assert_allclose(total, reference(point), rtol=1e-8)


def test_simultaneous_intervals_are_wider_the_more_checks_there_are():
    one, many = statistics.simultaneous(1), statistics.simultaneous(66)
    assert one == pytest.approx(0.999)
    assert 1 - many == pytest.approx(0.001 / 66)


def test_white_noise_has_the_degrees_of_freedom_of_its_bandwidth():
    flat = RationalSpectrum("flat", 1.0, (1e6, 1e6))
    lines = spectral_lines(flat, 50.0, (1.0, 11.0), 8.0)
    assert statistics.degrees_of_freedom(np.ones(lines.order.size), lines, 3) == pytest.approx(2 * 10 * 8 * 3, rel=1e-6)


def test_a_number_stands_does_not_or_cannot_be_compared():
    error = np.array([1e-6, -2e-5, 3e-5, -3e-5, np.nan])
    assert statistics.tolerance_verdicts(error, np.array(2e-5), verdicts.FAILED).tolist() == [0, 0, 1, 1, 2]
    assert statistics.tolerance_verdicts(error, np.array(2e-5)).tolist() == [0, 0, 1, 1, 3]
    assert statistics.tolerance_verdicts(error, np.full(5, np.nan)).tolist() == [3] * 5
    degrees = np.full(5, 200.0)
    low, high = statistics.interval(np.ones(5), degrees, statistics.simultaneous(5))
    reference = np.array([1.0, 1.01 * low[1], 0.99 * low[2], 1.01 * high[3], np.nan])
    assert statistics.statistical_verdicts(np.ones(5), degrees, reference, 5).tolist() == [0, 0, 1, 1, 3]
    assert statistics.statistical_verdicts(np.full(5, np.nan), degrees, np.ones(5), 5).tolist() == [2] * 5


@pytest.mark.parametrize("confidence", [0.5, 0.95, 1 - 1e-5])
@pytest.mark.parametrize("degrees", [3.3, 50.0, 2000.0])
def test_the_intervals_limits_leave_half_of_the_rest_on_either_side(degrees, confidence):
    from scipy.stats import chi2

    low, high = statistics.interval(np.ones(1), np.array([degrees]), confidence)
    # the mean square is chi-square/nu times the true one, so that the true one is nu/chi-square times the found one
    assert chi2.cdf(degrees / high**2, degrees) == pytest.approx((1 - confidence) / 2, rel=1e-8)
    assert chi2.sf(degrees / low**2, degrees) == pytest.approx((1 - confidence) / 2, rel=1e-8)
