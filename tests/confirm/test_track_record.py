"""Realisations: the lines carry the spectrum, the track carries the lines, the streams hang on seed and point alone."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.confirm.track_record import (
    END_LINES,
    fixed_amplitudes,
    gaussian_amplitudes,
    line_widths,
    mean_square,
    refined,
    sampled_track,
    smooth_step,
    spectral_lines,
    stream,
    track_deviation,
    track_lags,
)
from freqrail.model.spectrum import frequency_psd, standard_deviation

SPEED = 250 / 3.6
LAGS = np.array([0.0, 0.023, 0.095, 0.118])


@pytest.fixture
def lines(german_low):
    return spectral_lines(german_low, SPEED, (0.5, 20.0), 8.0)


def amplitudes(lines, count=2):
    return np.array([fixed_amplitudes(lines, stream(0, "point", "test", r)) for r in range(count)])


def harmonics(lines, record, time, lag=0.0):
    """The sum of the harmonics written out."""
    return np.sum((record * np.exp(2j * np.pi * lines.frequency * (time - lag))).real)


def test_a_line_carries_two_g_df(lines, german_low):
    inner = slice(END_LINES, -END_LINES)
    expected = np.sqrt(2 * frequency_psd(german_low, lines.frequency, SPEED) / lines.period)
    np.testing.assert_allclose(lines.amplitude[inner], expected[inner])


def test_the_lines_share_the_band_among_them(lines):
    assert lines.width.sum() == pytest.approx(19.5)
    assert lines.frequency[0] == pytest.approx(0.5)
    assert lines.width[0] == pytest.approx(0.3486 / 8.0, rel=1e-3)  # Gregory's rule: a line on the band's very end


@pytest.mark.parametrize("shift", np.linspace(-0.5, 0.5, 11))
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_the_lines_are_an_integral_wherever_the_band_ends(shift, degree):
    """A cubic over 20 spacings and a bit, exactly; every weight is positive, so that it can be an amplitude."""
    low, high, period = 1.0 + shift / 8, 3.5 - shift / 8, 8.0
    order = np.arange(8, 29)
    width = line_widths(order, (low, high), period)
    exact = (high ** (degree + 1) - low ** (degree + 1)) / (degree + 1)
    assert (order / period) ** degree @ width == pytest.approx(exact, rel=1e-12)
    assert np.all(width > 0)


@pytest.mark.parametrize("count", range(1, 12))
def test_however_few_lines_share_the_whole_band(count):
    order = np.arange(3, 3 + count)
    width = line_widths(order, (2.8 / 8, (order[-1] + 0.3) / 8), 8.0)
    assert width.sum() == pytest.approx((count - 0.5) / 8, rel=1e-12)
    assert np.all(width > 0)


def test_a_band_that_begins_far_below_the_first_line_leaves_no_line_negative():
    assert np.all(line_widths(np.arange(1, 40), (0.01 / 8, 5.0), 8.0) > 0)


def test_the_variance_of_the_lines_is_that_of_the_track(german_low):
    # 3-25 m at 250 km/h: 0.984 mm (docs/conventions.md)
    limits = (SPEED / 25, SPEED / 3)
    lines = spectral_lines(german_low, SPEED, limits, 60.0)
    total = np.sqrt(np.sum(lines.amplitude**2) / 2)
    assert total == pytest.approx(standard_deviation(german_low, (3.0, 25.0)), rel=1e-8, abs=0)


def test_a_record_says_what_deviation_it_has_in_any_range_and_when_it_reaches_the_wheels(german_low):
    lines = spectral_lines(german_low, SPEED, (0.5, 50.0), 20.0)
    track = sampled_track(lines, amplitudes(lines), LAGS, 20 * 600)
    ranges = np.array([[SPEED / 25, SPEED / 3], [0.5, 50.0], [np.nan, np.nan], [10.0, 10.1]])
    found = track_deviation(lines, track, ranges)
    exact = [standard_deviation(german_low, (SPEED / high, SPEED / low)) for low, high in ranges[:2]]
    np.testing.assert_allclose(found[:2], exact, rtol=1e-5)
    assert np.isnan(found[2:]).all()
    np.testing.assert_allclose(track_lags(lines, track), LAGS, rtol=1e-9, atol=1e-12)


def test_mean_square_is_that_of_the_sampled_sum(lines):
    records = amplitudes(lines)
    time = np.arange(1000) * lines.period / 1000
    turning = np.exp(2j * np.pi * np.multiply.outer(lines.frequency, time))
    sampled = np.mean((records @ turning).real ** 2, axis=1)
    np.testing.assert_allclose(mean_square(np.ones(lines.order.size), records), sampled, rtol=1e-12)


@pytest.mark.parametrize("time", [0.0, 0.1234, 5.4321, 8.0])
def test_between_samples_the_spline_is_the_sum_of_the_harmonics_with_each_wheels_lag(lines, time):
    records = amplitudes(lines)
    heights = sampled_track(lines, records, LAGS, 4800).heights(time)
    assert heights.shape == (4, 2)
    for wheel, lag in enumerate(LAGS):
        for r, record in enumerate(records):
            assert heights[wheel, r] == pytest.approx(harmonics(lines, record, time, lag), abs=1e-8)


def test_the_harmonics_of_the_spline_are_exact_and_its_images_small(lines):
    record = amplitudes(lines, 1)
    samples, finer = 8 * 200, 8
    track = sampled_track(lines, record, LAGS[:1], samples)
    fine = np.stack([track.at_steps(0, samples, k / finer)[:, 0, 0] for k in range(finer)], axis=1).ravel()
    spectrum = np.fft.rfft(fine) * 2 / fine.size
    np.testing.assert_allclose(spectrum[lines.order], record[0], rtol=1e-6, atol=1e-9)
    rest = np.delete(spectrum, lines.order)
    assert np.abs(rest).max() < 2e-4 * np.abs(record).max()


def test_linear_interpolation_joins_the_samples_by_straight_lines(lines):
    record = amplitudes(lines, 1)
    track = sampled_track(lines, record, LAGS[:1], 400, interpolation="linear")
    a, b = (harmonics(lines, record[0], k * track.step) for k in (3, 4))
    assert track.heights(3.25 * track.step)[0, 0] == pytest.approx(0.75 * a + 0.25 * b)


def test_the_start_rises_from_zero_into_the_periodic_track(lines):
    record = amplitudes(lines, 1)
    track = sampled_track(lines, record, LAGS, 800, before=600, ramp=4.0)
    periodic = sampled_track(lines, record, LAGS, 800)
    assert track.startup == pytest.approx(6.0)
    assert np.abs(track.heights(-6.0)).max() < 1e-3 * np.abs(periodic.heights(2.0)).max()
    for time in (-1.0, 0.0, 3.3, 8.0):
        np.testing.assert_allclose(track.heights(time), periodic.heights(time % 8.0), atol=1e-15)


def test_the_ramp_is_smooth_at_both_ends():
    x = np.array([-1.0, 0.0, 0.5, 1.0, 2.0])
    np.testing.assert_allclose(smooth_step(x), [0, 0, 0.5, 1, 1])
    h = 1e-4
    slope = (smooth_step(x + h) - smooth_step(x - h)) / (2 * h)
    np.testing.assert_allclose(slope[[0, 1, 3, 4]], 0, atol=1e-6)


def test_fixed_amplitudes_are_those_of_the_lines_and_gaussian_ones_so_in_the_mean_square(lines):
    np.testing.assert_allclose(np.abs(amplitudes(lines)), np.broadcast_to(lines.amplitude, (2, lines.order.size)))
    many = np.array([gaussian_amplitudes(lines, stream(0, "p", "gaussian", r)) for r in range(4000)])
    np.testing.assert_allclose(np.mean(np.abs(many) ** 2, axis=0) / lines.amplitude**2, 1, atol=0.09)
    # a complex Gaussian number: the fourth moment of the modulus is twice the square of the second
    assert np.mean(np.abs(many / lines.amplitude) ** 4) == pytest.approx(2, rel=0.01, abs=0)


def test_streams_hang_on_seed_point_purpose_and_record_and_on_nothing_else():
    def first(*key):
        return stream(*key).random()

    base = first(1, "speed=250", "gaussian", 3)
    assert first(1, "speed=250", "gaussian", 3) == base
    others = [(2, "speed=250", "gaussian", 3), (1, "speed=251", "gaussian", 3), (1, "speed=250", "fixed", 3)]
    others.append((1, "speed=250", "gaussian", 4))
    assert len({base, *(first(*key) for key in others)}) == 5


@pytest.mark.parametrize("limits", [(0.0, 20.0), (20.0, 20.0), (1.0, 1e9)])
def test_a_band_without_manageable_lines_is_refused(german_low, limits):
    with pytest.raises(ValueError, match="manageable lines"):
        spectral_lines(german_low, SPEED, limits, 60.0)


def test_too_few_samples_for_a_harmonic_are_refused(lines):
    with pytest.raises(ValueError, match="cannot carry"):
        sampled_track(lines, amplitudes(lines), LAGS, 2 * int(lines.order[-1]))


def test_a_refined_track_is_the_same_straight_lines(lines):
    coarse = sampled_track(lines, amplitudes(lines), LAGS, 400, before=10, interpolation="linear")
    fine = refined(coarse, 5)
    assert (fine.samples, fine.startup, fine.end) == (2000, pytest.approx(coarse.startup), pytest.approx(coarse.end))
    for time in (-0.19, 0.0, 1.2345, 8.0):
        np.testing.assert_allclose(fine.heights(time), coarse.heights(time), atol=1e-15)
