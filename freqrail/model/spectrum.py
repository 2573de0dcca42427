"""Vertical track irregularity: one-sided spectra of the track's height.

A spectrum S_v(Omega) in m^2/(rad/m) over the wavenumber Omega in rad/m is one-sided: its integral
from 0 to infinity is the variance. Read that way, the low German spectrum gives 0.984 mm over
3-25 m, what the track standards expect of good track.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.types import Number


@dataclass(frozen=True)
class RationalSpectrum:
    """S_v(Omega) = A Omega_c^2 / ((Omega^2 + Omega_r^2) (Omega^2 + Omega_c^2))  (eq. 11).

    roughness: A in m^2 rad/m. cutoffs: (Omega_r, Omega_c) in rad/m.
    """

    name: str
    roughness: float
    cutoffs: tuple[float, float]


@dataclass(frozen=True)
class TabulatedSpectrum:
    """S_v between tabulated points, straight in log-log; zero outside them.

    wavenumbers: [n] rad/m, increasing, above 0. values: [n] m^2/(rad/m), above 0, one-sided. Raises ValueError
    for anything else.
    """

    name: str
    wavenumbers: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        knots, values = np.asarray(self.wavenumbers), np.asarray(self.values)
        if knots.shape != values.shape or knots.ndim != 1 or knots.size < 2:
            raise ValueError(
                f"a table needs two or more wavenumbers and as many values (got {knots.shape} and {values.shape})"
            )
        if not (np.all(knots > 0) and np.all(values > 0) and np.all(np.diff(knots) > 0)):
            raise ValueError("wavenumbers and values must be positive, and wavenumbers increase")


Spectrum = RationalSpectrum | TabulatedSpectrum


# A_v in m^2 rad/m, cutoffs in rad/m: the low one is eq. (11) with the paper's numbers, the high one
# the same formula with the German high-interference roughness.
GERMAN_CUTOFFS = (0.0206, 0.8246)
GERMAN_ROUGHNESS = {"german-low": 4.032e-7, "german-high": 1.080e-6}

GERMAN_WAVELENGTHS = (1.0, 120.0)
"""Wavelengths in m that the field computes with the German spectra; beyond them eq. (11) extrapolates measurements."""


def wavenumber_psd(spectrum: Spectrum, wavenumber: Number) -> Number:
    """S_v in m^2/(rad/m), one-sided, at `wavenumber` in rad/m (eq. 11, or the table)."""
    if isinstance(spectrum, TabulatedSpectrum):
        knots, values = np.log(spectrum.wavenumbers), np.log(spectrum.values)
        with np.errstate(divide="ignore"):
            return np.exp(np.interp(np.log(wavenumber), knots, values, left=-np.inf, right=-np.inf))
    omega_r, omega_c = spectrum.cutoffs
    square = np.square(wavenumber)
    return spectrum.roughness * omega_c**2 / ((square + omega_r**2) * (square + omega_c**2))


def angular_psd(spectrum: Spectrum, omega: Number, speed: Number) -> Number:
    """G(omega) = S_v(omega / v) / v in m^2/(rad/s), one-sided; omega in rad/s, speed in m/s."""
    return wavenumber_psd(spectrum, omega / speed) / speed


def elasticity(spectrum: Spectrum, wavenumber: Number) -> Number:
    """d ln S_v/d ln Omega at `wavenumber` in rad/m; of a table the slope in log-log, 0 where it gives nothing."""
    if isinstance(spectrum, TabulatedSpectrum):
        knots, values = np.log(spectrum.wavenumbers), np.log(spectrum.values)
        slopes = np.concatenate([[0.0], np.diff(values) / np.diff(knots), [0.0]])
        return np.asarray(slopes[np.searchsorted(spectrum.wavenumbers, wavenumber)])
    omega_r, omega_c = spectrum.cutoffs
    square = np.square(wavenumber)
    return -2 * (square / (square + omega_r**2) + square / (square + omega_c**2))


def angular_psd_slope(spectrum: Spectrum, omega: Number, speed: Number) -> Number:
    """dG/dv in m^2/(rad/s)/(m/s) at `omega` in rad/s, one-sided; speed in m/s. Omega = omega/v falls with the speed."""
    return -angular_psd(spectrum, omega, speed) / speed * (1.0 + elasticity(spectrum, omega / speed))


def frequency_psd(spectrum: Spectrum, frequency: Number, speed: Number) -> Number:
    """2 pi S_v(2 pi f / v) / v in m^2/Hz, one-sided; frequency in Hz, speed in m/s."""
    return 2 * np.pi * angular_psd(spectrum, 2 * np.pi * frequency, speed)


def singular_points(spectrum: Spectrum, speed: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Where G is singular, rad/s, at all of the speeds [m/s]: s = -v Omega_r and -v Omega_c; 0 for a table's powers."""
    if isinstance(spectrum, TabulatedSpectrum):
        return np.zeros(1, dtype=complex)
    return -np.multiply.outer(speed, np.array(spectrum.cutoffs)).ravel().astype(complex)


def kinks(spectrum: Spectrum, speed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where G is not smooth, rad/s: [points, speeds], none for a rational spectrum, the points of a table."""
    points = spectrum.wavenumbers if isinstance(spectrum, TabulatedSpectrum) else ()
    return np.multiply.outer(np.array(points), speed)


def standard_deviation(spectrum: RationalSpectrum, wavelengths: tuple[float, float] = (0.0, np.inf)) -> float:
    """Standard deviation of the track height in m, over all wavelengths or a band of them in m.

    In closed form, by partial fractions of eq. (11).
    """
    upper, lower = (2 * np.pi / w if w > 0 else np.inf for w in wavelengths)
    omega_r, omega_c = spectrum.cutoffs

    def part(cutoff: float) -> float:
        return (np.arctan(upper / cutoff) - np.arctan(lower / cutoff)) / cutoff

    if np.isclose(omega_r, omega_c, rtol=1e-6):
        # the double pole: both partial fractions merge, and so does their difference quotient
        def double(wavenumber: float) -> float:
            x = wavenumber / omega_c
            tail = 0.0 if np.isinf(x) else x / (1 + x * x)
            return (np.arctan(x) + tail) / (2 * omega_c)

        return float(np.sqrt(spectrum.roughness * (double(upper) - double(lower))))
    scale = spectrum.roughness * omega_c**2 / (omega_c**2 - omega_r**2)
    return float(np.sqrt(scale * (part(omega_r) - part(omega_c))))
