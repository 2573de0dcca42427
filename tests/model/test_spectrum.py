"""Track irregularity: what the spectra of section V say about the height of the rails."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from freqrail.model.band import Band, band_limits
from freqrail.model.spectrum import (
    GERMAN_CUTOFFS,
    GERMAN_ROUGHNESS,
    RationalSpectrum,
    TabulatedSpectrum,
    angular_psd,
    frequency_psd,
    kinks,
    singular_points,
    standard_deviation,
    wavenumber_psd,
)

GENERAL = RationalSpectrum("rational", 2.5e-6, (0.13, 3.1))


def integral(spectrum: RationalSpectrum, lower: float, upper: float) -> float:
    """Variance between two wavenumbers, by adaptive quadrature over log wavenumber of eq. (11) written out."""
    omega_r, omega_c = spectrum.cutoffs

    def integrand(log: float) -> float:
        w = np.exp(log)
        return w * spectrum.roughness * omega_c**2 / ((w**2 + omega_r**2) * (w**2 + omega_c**2))

    return quad(integrand, np.log(lower), np.log(upper), epsrel=1e-12, epsabs=0, limit=400)[0]


def test_equation_11_with_the_papers_numbers(german_low):
    a, omega_r, omega_c = 4.032e-7, 0.0206, 0.8246
    for wavenumber in (0.001, 0.0206, 0.3, 0.8246, 10.0):
        expected = a * omega_c**2 / ((wavenumber**2 + omega_r**2) * (wavenumber**2 + omega_c**2))
        assert wavenumber_psd(german_low, wavenumber) == pytest.approx(expected, rel=1e-14, abs=0)


def test_the_papers_case_runs_on_the_low_german_track(paper_case, german_low):
    assert paper_case.spectrum == german_low


@pytest.mark.parametrize(
    ("track", "wavelengths", "millimetres", "digits"),
    [
        ("german_low", (0.0, np.inf), 5.4768, 1e-4),
        ("german_low", (3.0, 25.0), 0.984, 1e-3),
        ("german_high", (3.0, 25.0), 1.611, 1e-3),
    ],
)
def test_standard_deviations_are_those_of_the_conventions(request, track, wavelengths, millimetres, digits):
    """docs/conventions.md, "Signs and spectra"."""
    spectrum = request.getfixturevalue(track)
    assert 1e3 * standard_deviation(spectrum, wavelengths) == pytest.approx(millimetres, abs=digits / 2)


@pytest.mark.parametrize("spectrum", [RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246)), GENERAL])
@pytest.mark.parametrize("wavelengths", [(3.0, 25.0), (1.0, 200.0), (25.0, 70.0), (0.5, 1000.0)])
def test_closed_form_is_the_integral_over_the_band(spectrum, wavelengths):
    expected = np.sqrt(integral(spectrum, 2 * np.pi / wavelengths[1], 2 * np.pi / wavelengths[0]))
    assert standard_deviation(spectrum, wavelengths) == pytest.approx(expected, rel=1e-10, abs=0)


@pytest.mark.parametrize("spectrum", [RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246)), GENERAL])
def test_variance_is_the_integral_from_zero_not_from_minus_infinity(spectrum):
    """One-sided: integral of S_v from 0 to infinity = pi A Omega_c / (2 Omega_r (Omega_r + Omega_c))."""
    omega_r, omega_c = spectrum.cutoffs
    variance = np.pi * spectrum.roughness * omega_c / (2 * omega_r * (omega_r + omega_c))
    assert standard_deviation(spectrum) ** 2 == pytest.approx(variance, rel=1e-13, abs=0)
    assert integral(spectrum, 1e-9, 1e9) == pytest.approx(variance, rel=1e-6, abs=0)


def test_a_track_built_of_harmonics_has_the_standard_deviation(german_low):
    """Amplitudes sqrt(2 G df) with one-sided per-Hz G make a track whose height scatters by sigma."""
    speed, samples, period = 60.0, 2**16, 400.0
    frequency = np.arange(samples // 2 + 1) / period
    inside = (frequency > speed / 25) & (frequency < speed / 3)
    amplitude = np.zeros(frequency.size)
    amplitude[inside] = np.sqrt(2 * frequency_psd(german_low, frequency[inside], speed) / period)
    phase = np.random.default_rng(3).uniform(0, 2 * np.pi, frequency.size)
    height = np.fft.irfft(samples / 2 * amplitude * np.exp(1j * phase), samples)
    assert np.std(height) == pytest.approx(standard_deviation(german_low, (3, 25)), rel=1e-3, abs=0)


@pytest.mark.parametrize("speed", [5.0, 250 / 3.6, 160.0])
@pytest.mark.parametrize("wavelengths", [(3.0, 25.0), (1.0, 200.0)])
def test_variance_does_not_depend_on_how_fast_the_track_is_run_over(german_low, speed, wavelengths):
    """The same wavelengths, per Hz and per rad/s, at any speed: the same height variance."""
    variance = standard_deviation(german_low, wavelengths) ** 2
    low, high = speed / wavelengths[1], speed / wavelengths[0]
    per_hz = quad(lambda f: frequency_psd(german_low, f, speed), low, high, epsrel=1e-11, epsabs=0, limit=200)[0]
    per_rad = quad(
        lambda w: angular_psd(german_low, w, speed),
        2 * np.pi * low,
        2 * np.pi * high,
        epsrel=1e-11,
        epsabs=0,
        limit=200,
    )[0]
    assert per_hz == pytest.approx(variance, rel=1e-9, abs=0)
    assert per_rad == pytest.approx(variance, rel=1e-9, abs=0)


@pytest.mark.parametrize("wavelengths", [(0.0, np.inf), (3.0, 25.0), (1.0, np.inf), (0.0, 50.0)])
@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-5, 1e-2])
def test_cutoffs_that_merge_leave_a_finite_continuous_limit(wavelengths, apart):
    """S = A W^2/(k^2 + W^2)^2 for equal cut-offs: no division by their vanishing difference shows."""
    spectrum = RationalSpectrum("rational", 1e-6, (0.5, 0.5 * (1 + apart)))
    lower, upper = (max(1e-9, min(1e9, 2 * np.pi / w)) if w else 1e9 for w in wavelengths[::-1])
    expected = np.sqrt(integral(spectrum, lower, upper))
    assert standard_deviation(spectrum, wavelengths) == pytest.approx(expected, rel=1e-7, abs=0)


def test_roughness_scales_the_height_with_its_root(german_low, german_high):
    ratio = np.sqrt(1.080e-6 / 4.032e-7)
    assert standard_deviation(german_high, (3, 25)) / standard_deviation(german_low, (3, 25)) == pytest.approx(
        ratio, rel=1e-12
    )


def test_a_frequency_band_is_the_same_at_every_speed():
    speeds = np.array([10.0, 50.0, 80.0])
    limits = band_limits(Band("frequency", 0.1, 100.0), speeds)
    np.testing.assert_allclose(limits, np.array([[0.1] * 3, [100.0] * 3]) * 2 * np.pi, rtol=1e-15)


def test_a_wavelength_band_moves_with_the_speed_longest_first():
    """A wave of 200 m passes in 4 s at 50 m/s: 0.25 Hz is the lower limit, its shortest wave the upper."""
    limits = band_limits(Band("wavelength", 2.0, 200.0), np.array([50.0, 100.0]))
    np.testing.assert_allclose(limits / (2 * np.pi), [[0.25, 0.5], [25.0, 50.0]], rtol=1e-15)
    assert np.all(limits[0] < limits[1])


def test_a_table_of_the_german_spectrum_is_the_german_spectrum_between_its_points(german_low):
    points = np.geomspace(1e-3, 50, 4000)
    table = TabulatedSpectrum("table", tuple(points), tuple(wavenumber_psd(german_low, points)))
    inside = np.geomspace(2e-3, 49, 777)
    assert wavenumber_psd(table, inside) == pytest.approx(wavenumber_psd(german_low, inside), rel=1e-5, abs=0)
    assert np.all(wavenumber_psd(table, np.array([0.9e-3, 51.0])) == 0)


@pytest.mark.parametrize(
    ("points", "values"),
    [
        ((1.0,), (1.0,)),
        ((1.0, 2.0), (1.0,)),
        ((2.0, 1.0), (1.0, 1.0)),
        ((0.0, 1.0), (1.0, 1.0)),
        ((1.0, 2.0), (1.0, -1.0)),
    ],
)
def test_a_table_that_is_none_is_refused(points, values):
    with pytest.raises(ValueError, match="wavenumbers"):
        TabulatedSpectrum("table", points, values)


def test_the_high_german_spectrum_is_rougher_by_its_own_coefficient():
    assert GERMAN_ROUGHNESS == {"german-low": 4.032e-7, "german-high": 1.080e-6}
    assert GERMAN_CUTOFFS == (0.0206, 0.8246)


def test_the_whole_standard_deviation_is_the_closed_form_over_all_wavelengths(german_low):
    """sigma^2 = pi A Omega_c / (2 Omega_r (Omega_r + Omega_c)), with nothing left out at either end."""
    low, high = german_low.cutoffs
    closed = np.sqrt(np.pi * german_low.roughness * high / (2 * low * (low + high)))
    assert standard_deviation(german_low) == pytest.approx(closed, rel=1e-13, abs=0)


@pytest.mark.parametrize("cutoff", [0.03, 2.0])
def test_the_standard_deviation_with_two_equal_cutoffs(cutoff):
    """sigma^2 = pi A / (4 Omega_c)."""
    double = RationalSpectrum("double", 1e-6, (cutoff, cutoff))
    assert standard_deviation(double) == pytest.approx(np.sqrt(np.pi * 1e-6 / (4 * cutoff)), rel=1e-13, abs=0)


def test_a_rational_spectrum_is_singular_in_the_left_half_plane_and_has_no_kinks(german_low):
    speeds = np.array([10.0, 50.0])
    expected = [-0.206, -8.246, -1.03, -41.23]
    np.testing.assert_allclose(singular_points(german_low, speeds), expected, rtol=1e-14)
    assert kinks(german_low, speeds).shape == (0, 2)


def test_a_table_is_singular_at_zero_and_has_its_points_as_kinks():
    table = TabulatedSpectrum("measured", (0.1, 1.0, 4.0), (1e-3, 1e-5, 1e-7))
    speeds = np.array([10.0, 50.0])
    assert singular_points(table, speeds).tolist() == [0]
    np.testing.assert_allclose(kinks(table, speeds), [[1, 5], [10, 50], [40, 200]], rtol=1e-15)


def test_two_points_make_a_table_and_one_does_not():
    two = TabulatedSpectrum("straight", (1.0, 4.0), (1e-3, 1e-5))
    assert wavenumber_psd(two, 2.0) == pytest.approx(1e-4, rel=1e-14, abs=0)  # half-way in the logarithms
    with pytest.raises(ValueError, match="two or more"):
        TabulatedSpectrum("point", (1.0,), (1e-3,))


@pytest.mark.parametrize(
    ("wavenumbers", "values"),
    [
        ((0.0, 1.0, 2.0), (1e-3, 1e-4, 1e-5)),
        ((-1.0, 1.0, 2.0), (1e-3, 1e-4, 1e-5)),
        ((1.0, 2.0, 2.0), (1e-3, 1e-4, 1e-5)),
        ((1.0, 3.0, 2.0), (1e-3, 1e-4, 1e-5)),
        ((1.0, 2.0, 3.0), (1e-3, 0.0, 1e-5)),
    ],
    ids=["zero", "negative", "twice", "back", "no roughness"],
)
def test_one_bad_point_spoils_a_table(wavenumbers, values):
    with pytest.raises(ValueError, match="must be positive, and wavenumbers increase"):
        TabulatedSpectrum("bad", wavenumbers, values)
