"""Numbers of the frequency domain by routes that the kernel of a sweep does not take, to hold its numbers against.

- `line_rms`: the integral over a band as a sum over a record's lines, |T|^2 from the blocks' frequency responses with
  the wheels' lags as complex numbers: no lag columns, no panels, no residues, but the kernel's own blocks;
- `state_response`: T from the state space that is simulated, by one linear solve a frequency;
- `covariance_rms`: the mean square over the whole axis from the stationary covariance of the states behind a shaping
  filter, by Sylvester's equation: no frequency at all.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, matrix_balance, solve_sylvester

from freqrail.confirm.simulated import Simulated
from freqrail.confirm.track_record import Lines, spectral_lines
from freqrail.model.equations import StateSpace
from freqrail.model.spectrum import RationalSpectrum, Spectrum
from freqrail.model.vehicle import Vehicle
from freqrail.solver.transfer import half_vehicle_transfer, transfer


def transfer_power(
    vehicle: Simulated, names: tuple[str, ...], speed: float, frequency: NDArray[np.float64]
) -> NDArray[np.float64]:
    """|T|^2 of the named responses at `frequency` [K] in Hz: [series, K], SI units squared per m^2; speed in m/s."""
    omega = 2 * np.pi * frequency
    if isinstance(vehicle, Vehicle):
        rows = half_vehicle_transfer(vehicle, names, omega, speed)
    else:
        rows = transfer(vehicle.reduction.only(names), vehicle.values, omega, speed)
    return np.square(np.abs(np.concatenate([rows[name] for name in names])))


def line_rms(
    vehicle: Simulated,
    names: tuple[str, ...],
    spectrum: Spectrum,
    speed: float,
    limits: tuple[float, float],
    period: float,
) -> NDArray[np.float64]:
    """RMS of the named responses to the lines of a record of `period` [s] in a band, `limits` in Hz: [series]."""
    lines: Lines = spectral_lines(spectrum, speed, limits, period)
    return np.sqrt(transfer_power(vehicle, names, speed, lines.frequency) @ np.square(lines.amplitude) / 2)


def state_response(
    model: StateSpace,
    readout: NDArray[np.float64],
    feedthrough: NDArray[np.float64],
    lags: NDArray[np.float64],
    frequency: NDArray[np.float64],
    rates: NDArray[np.float64] | None = None,
) -> NDArray[np.complex128]:
    """T = C (i omega - A)^-1 B e + D e, e = exp(-i omega tau), per metre of track under the first wheel: [series, K].

    readout: C [series, states]. feedthrough: D [series, wheels]. lags: tau [wheels], s. frequency: [K], Hz. rates: D'
    [series, wheels], of the heights' rates, which adds i omega D' e.
    """
    omega = 2 * np.pi * np.asarray(frequency)
    delays = np.exp(-1j * np.multiply.outer(omega, lags))
    matrices = 1j * omega[:, None, None] * np.eye(len(model.a)) - model.a
    states = np.linalg.solve(matrices, (delays @ model.b.T)[..., None])[..., 0]
    found = states @ readout.T + delays @ feedthrough.T
    if rates is not None:
        found = found + 1j * omega[:, None] * (delays @ rates.T)
    return np.asarray(found.T, dtype=np.complex128)


def covariance_rms(
    model: StateSpace,
    readout: NDArray[np.float64],
    feedthrough: NDArray[np.float64],
    lags: NDArray[np.float64],
    spectrum: RationalSpectrum,
    speed: float,
    rates: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """RMS over the whole axis and the relative rounding in it, [series] each; NaN for an unstable model.

    Arguments as `state_response`; speed in m/s. White noise through 1/((s + v Omega_r)(s + v Omega_c)) is a track of
    eq. (11). Let x_i be the states if wheel i alone stood on it, without lag; the response is the sum of
    y_i(t - tau_i), and for d = tau_j - tau_i >= 0 E[x_i(t + d) x_j(t)'] = exp(A_i d) P_ij with
    A_i P_ij + P_ij A_j' + W b b' = 0 (A. Gelb (ed.), Applied Optimal Estimation, MIT Press, 1974, chapter 3).
    """
    states, wheels = model.b.shape
    low, high = (speed * cutoff for cutoff in spectrum.cutoffs)
    # one-sided G = W |F|^2/pi in m^2/(rad/s), of eq. (11) with Omega = omega/v
    noise = np.zeros((states + 2, states + 2))
    noise[-1, -1] = np.pi * spectrum.roughness * spectrum.cutoffs[1] ** 2 * speed**3
    systems, outputs = [], []
    for wheel in range(wheels):
        a = np.zeros_like(noise)
        a[:states, :states] = model.a
        a[:states, states] = model.b[:, wheel]
        a[states, states:] = -low, 1.0
        a[-1, -1] = -high
        systems.append(a)
        height, rate = feedthrough[:, [wheel]], np.zeros((len(readout), 1))
        if rates is not None:  # dv/dt = -low v + the other state of the filter
            rate = rates[:, [wheel]]
            height = height - low * rate
        outputs.append(np.hstack([readout, height, rate]))
    if not np.linalg.eigvals(model.a).real.max() < 0:
        return np.full(len(readout), np.nan), np.full(len(readout), np.nan)
    # states of about one size, or the rounding is that of the largest; another choice of sizes rounds otherwise
    sizes = np.array([np.diag(matrix_balance(a, permute=False)[1]) for a in systems])
    uneven = np.where(np.arange(states + 2) % 2, 8.0, 1 / 8)
    with np.errstate(invalid="ignore"):  # a mean square below its own rounding may be negative: NaN
        rms, other = (_covariance_rms(systems, outputs, lags, noise, s) for s in (sizes, sizes * uneven))
        return rms, np.abs(other / rms - 1)


def _covariance_rms(
    systems: list[NDArray], outputs: list[NDArray], lags: NDArray, noise: NDArray, sizes: NDArray
) -> NDArray[np.float64]:
    """The RMS of `covariance_rms`, [series], with states in units of `sizes` [wheels, states]."""
    scaled = [a * (size / size[:, None]) for a, size in zip(systems, sizes, strict=True)]
    rows = [c * size for c, size in zip(outputs, sizes, strict=True)]
    square = np.zeros(len(outputs[0]))
    for i, j in itertools.product(range(len(systems)), repeat=2):
        delay = lags[j] - lags[i]
        if delay < 0 or (delay == 0 and i > j):
            continue  # the pair the other way round, counted with this one
        covariance = solve_sylvester(scaled[i], scaled[j].T, -noise / np.multiply.outer(sizes[i], sizes[j]))
        part = np.einsum("ps,sr,pr->p", rows[i], expm(scaled[i] * delay) @ covariance, rows[j])
        square += part if i == j else 2 * part
    return np.sqrt(square)
