"""Realisations of the track: sums of harmonics on a period, and smooth tracks under four wheels made of them.

A spectrum sampled at the harmonics of a period T is a line spectrum, A_k = sqrt(2 G_k df), G_k = 2 pi S_v/v per
Hz. Whatever the phases and amplitudes of the lines, the steady response of a linear vehicle is then a line spectrum
too, and its RMS over one period is known from the frequency responses: that is what makes a run in time a check.

The wheels' lags are exact, as phases. Between samples the track is a periodic cubic spline whose harmonics
inside the band are exact; only its images beyond the sampling rate are left. Linear interpolation is here as well,
to show what it does: its kinks ring the wheelsets on a rigid rail.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import bernoulli

from freqrail.model.spectrum import Spectrum, frequency_psd

LARGEST_SEED = 2**63
MOST_LINES = 10_000_000
END_LINES = 4  # at either end of a band, whose weights make the sum over lines an integral

# Weights of the coefficients about an interval as polynomials in the place u in [0, 1) within it: row j holds
# the powers of u of coefficient j. Uniform B-splines of degree 1 and 3.
_BASIS = {
    1: np.array([[1.0, -1.0], [0.0, 1.0]]),
    3: np.array([[1.0, -3, 3, -1], [4.0, 0, -6, 3], [1.0, 3, 3, -3], [0.0, 0, 0, 1]]) / 6,
}
DEGREES = {"linear": 1, "cubic": 3}


@dataclass(frozen=True)
class Lines:
    """Harmonics of a period and what the spectrum puts on them.

    period: T, s. order: [K] multiples of 1/T. width: [K] Hz, the share of the frequency axis that a line stands for:
    1/T, else see `line_widths` where the band ends. amplitude: A_k = sqrt(2 G_k df), m, [K].
    """

    period: float
    order: NDArray[np.int64]
    width: NDArray[np.float64]
    amplitude: NDArray[np.float64]

    @property
    def frequency(self) -> NDArray[np.float64]:
        """Frequencies of the lines, Hz: [K]."""
        return self.order / self.period


def spectral_lines(spectrum: Spectrum, speed: float, limits: tuple[float, float], period: float) -> Lines:
    """The lines of a period [s] inside a band, `limits` in Hz; speed in m/s.

    The lines are those whose cell, of width 1/T, reaches into the band; the first and the last may lie up to half a
    cell outside it. Raises ValueError if the band holds no line or too many.
    """
    low, high = limits
    if not (0 < low < high and high * period <= MOST_LINES):
        raise ValueError(f"a band of {low:g} to {high:g} Hz has no manageable lines on a period of {period:g} s")
    order = np.arange(max(1, math.ceil(low * period - 0.5)), math.floor(high * period + 0.5) + 1)
    if not order.size:
        raise ValueError(f"a band of {low:g} to {high:g} Hz has no line on a period of {period:g} s")
    width = line_widths(order, limits, period)
    frequency = order / period
    return Lines(period, order, width, np.sqrt(2 * frequency_psd(spectrum, frequency, speed) * width))


def line_widths(order: NDArray[np.int64], limits: tuple[float, float], period: float) -> NDArray[np.float64]:
    """Weights [K], Hz, that make a sum over consecutive lines the integral over a band, `limits` in Hz.

    1/T inside, the trapezoidal rule; at either end END_LINES weights that integrate polynomials of that order
    exactly, wherever the band ends between the lines. With the end at 0 and the lines at j + theta, in units of 1/T,
    sum_{j < m} w_j (j + theta)^k = B_{k+1}(m + theta)/(k + 1), k < m, B the Bernoulli polynomials (the
    Euler-Maclaurin formula; Gregory's rule is theta = 0). All weights are positive for -1/2 <= theta <= 1/2, so
    that they can be amplitudes.
    """
    low, high = limits
    if order.size == 1:
        return np.array([high - low])
    width = np.ones(order.size)
    most = min(END_LINES, order.size // 2)
    for theta, turned in ((order[0] - low * period, width), (high * period - order[-1], width[::-1])):
        weights = _end_weights(float(theta), most)
        turned[: weights.size] = weights
    return width / period


def _end_weights(theta: float, most: int) -> NDArray[np.float64]:
    # a band that begins below half a line's spacing leaves theta > 1/2, where only two weights stay positive
    count = min(most, 2) if theta > 0.5 else most
    places = np.arange(count) + theta
    moments = [_bernoulli_polynomial(k + 1, count + theta) / (k + 1) for k in range(count)]
    return np.linalg.solve(np.vander(places, increasing=True).T, moments)


def _bernoulli_polynomial(degree: int, x: float) -> float:
    numbers = bernoulli(degree)
    return float(sum(math.comb(degree, k) * numbers[k] * x ** (degree - k) for k in range(degree + 1)))


def stream(seed: int, key: str, purpose: str, record: int) -> np.random.Generator:
    """A stream of random numbers of its own for every (seed, point, purpose, record).

    key: the point's values as text. The numbers depend on nothing else: not on the order of the points, nor on
    how many records or processes there are.
    """
    words = np.frombuffer(hashlib.sha256(f"{key}\n{purpose}".encode()).digest(), dtype="<u4")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(*map(int, words), record))))


def fixed_amplitudes(lines: Lines, random: np.random.Generator) -> NDArray[np.complex128]:
    """Complex amplitudes [K], m, of one record: A_k as it is, the phase uniform."""
    return lines.amplitude * np.exp(2j * np.pi * random.random(lines.order.size))


def gaussian_amplitudes(lines: Lines, random: np.random.Generator) -> NDArray[np.complex128]:
    """Complex amplitudes [K], m, of one record of a Gaussian process: the modulus Rayleigh, its mean square A_k^2."""
    parts = random.standard_normal((2, lines.order.size))
    return lines.amplitude * (parts[0] + 1j * parts[1]) / math.sqrt(2)


def mean_square(power: NDArray[np.float64], amplitudes: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Mean square over one period of the responses to lines: sum over k of |T_k|^2 |a_k|^2 / 2.

    power: |T_k|^2, [..., K]. amplitudes: [records, K]. Returns [..., records].
    """
    return power @ (np.square(np.abs(amplitudes)) / 2).T


# --- the track under the wheels --------------------------------------------------------------------


@dataclass(frozen=True)
class Track:
    """Track heights under the wheels over [-startup, period], one column a wheel and record.

    coefficients: [steps + degree, wheels, records], m, of the B-splines about the samples, the start's ramp in them.
    step: time between samples, s. degree: 3, or 1 for straight lines between samples. samples: steps in one
    period. before: steps of the start, which end at t = 0.
    """

    coefficients: NDArray[np.float64]
    step: float
    degree: int
    samples: int
    before: int

    @property
    def startup(self) -> float:
        """Time before the measured period, s."""
        return self.before * self.step

    @property
    def end(self) -> float:
        """End of the measured period, s, which starts at 0."""
        return self.samples * self.step

    def heights(self, time: float) -> NDArray[np.float64]:
        """Track heights at `time` [s] in [-startup, end]: [wheels, records], m."""
        place = time / self.step + self.before
        start = min(max(int(place), 0), self.before + self.samples - 1)
        weights = basis(self.degree, place - start)
        wheels, records = self.coefficients.shape[1:]
        window = self.coefficients[start : start + self.degree + 1].reshape(self.degree + 1, -1)
        return weights.dot(window).reshape(wheels, records)

    def at_steps(self, first: int, count: int, place: float = 0.0) -> NDArray[np.float64]:
        """Heights at `count` successive steps from step `first` (0 at the start), each `place` [0, 1] of a step later.

        Returns [count, wheels, records], m.
        """
        weights = basis(self.degree, place)
        return self._weighted(weights, first, count)

    def rates_at_steps(self, first: int, count: int) -> NDArray[np.float64]:
        """Rates of the heights there, m/s: of the pieces that begin at the steps."""
        return self._weighted(basis_polynomials(self.degree)[:, 1] / self.step, first, count)

    def _weighted(self, weights: NDArray[np.float64], first: int, count: int) -> NDArray[np.float64]:
        windows = (self.coefficients[first + j : first + j + count] * w for j, w in enumerate(weights))
        return np.asarray(sum(windows))


def basis(degree: int, place: float) -> NDArray[np.float64]:
    """Weights [degree + 1] of the coefficients about an interval at `place` in [0, 1] of it."""
    powers = (1.0, place, place * place, place * place * place)
    return _BASIS[degree].dot(powers[: degree + 1])  # rk45 asks for this at every stage: plain floats are fastest


def basis_polynomials(degree: int) -> NDArray[np.float64]:
    """Those weights as polynomials in the place: [coefficient, power]."""
    return _BASIS[degree]


def smooth_step(x: NDArray) -> NDArray:
    """From 0 at x <= 0 to 1 at x >= 1 with two continuous derivatives, so that its spectrum falls as f^-4."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def sampled_track(
    lines: Lines,
    amplitudes: NDArray[np.complex128],
    lags: NDArray[np.float64],
    samples: int,
    before: int = 0,
    ramp: float = 0.0,
    interpolation: str = "cubic",
) -> Track:
    """A track under wheels that see it `lags` [s] later, [wheels].

    amplitudes: complex, [records, K], m; the height under wheel i is Re sum_k a_k exp(i omega_k (t - tau_i)).
    samples: steps in the period, more than twice the highest order. before: steps of start before t = 0; the
    track rises smoothly from zero over the first `ramp` [s] of them. interpolation: "cubic", a spline whose
    harmonics are the given ones exactly, or "linear".
    """
    if samples <= 2 * lines.order[-1]:
        raise ValueError(f"{samples} samples a period cannot carry its harmonic {lines.order[-1]}")
    degree = DEGREES[interpolation]
    phase = np.exp(-2j * np.pi * np.multiply.outer(lags, lines.frequency))
    spectrum = np.zeros((lags.size, len(amplitudes), samples // 2 + 1), dtype=complex)
    spectrum[..., lines.order] = phase[:, None, :] * amplitudes * (samples / 2)
    if degree == 3:
        # a uniform cubic B-spline has the spectrum sinc^4: divided out, the harmonics come through unchanged
        spectrum[..., lines.order] /= np.sinc(lines.order / samples) ** 4
    period = np.fft.irfft(spectrum, samples).transpose(2, 0, 1)
    step = lines.period / samples
    # the first coefficient of a cubic stands one step before the interval that it starts
    index = np.arange(before + samples + degree) - before - (degree - 1) // 2
    coefficients = period[index % samples]
    if ramp:
        coefficients *= smooth_step((index * step + before * step) / ramp)[:, None, None]
    return Track(coefficients, step, degree, samples, before)


def refined(track: Track, parts: int) -> Track:
    """A linearly interpolated track as the same straight lines on steps `parts` times shorter."""
    c = track.coefficients
    pieces = np.stack([c[:-1] + (c[1:] - c[:-1]) * (k / parts) for k in range(parts)], axis=1)
    coefficients = np.concatenate([pieces.reshape(-1, *c.shape[1:]), c[-1:]])
    return Track(coefficients, track.step / parts, 1, track.samples * parts, track.before * parts)


def track_deviation(lines: Lines, track: Track, ranges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation of the heights under the first wheel, first record, in `ranges` [range, 2] in Hz: [range], m.

    Of a record of fixed amplitudes it is that of the spectrum. NaN for a range that holds too few lines to say.
    """
    density = np.square(np.abs(_harmonics(lines, track)[:, 0])) / 2 / lines.width
    found = np.full(len(ranges), np.nan)
    for n, (low, high) in enumerate(ranges):
        inside = np.flatnonzero((lines.order >= low * lines.period - 0.5) & (lines.order <= high * lines.period + 0.5))
        if inside.size >= 2 * END_LINES:
            widths = line_widths(lines.order[inside], (low, high), lines.period)
            found[n] = math.sqrt(float(density[inside] @ widths))
    return found


def track_lags(lines: Lines, track: Track) -> NDArray[np.float64]:
    """Lags [wheels], s, at which the first record reaches the wheels, from the slopes of its harmonics' phases."""
    amplitude = _harmonics(lines, track)
    phase = np.unwrap(np.angle(amplitude[:, :1] * np.conj(amplitude)), axis=0)
    omega = 2 * np.pi * (lines.frequency - lines.frequency[0])
    if omega.size < 2:
        return np.full(phase.shape[1], np.nan)
    return np.asarray(omega @ (phase - phase[0]) / (omega @ omega))


def _harmonics(lines: Lines, track: Track) -> NDArray[np.complex128]:
    """Complex amplitudes of the first record's heights at the lines, [K, wheels], m."""
    heights = track.at_steps(track.before, track.samples)[..., 0]
    return np.asarray(np.fft.rfft(heights, axis=0)[lines.order] * (2 / track.samples))
