"""What the frequency domain says of a point to be confirmed: the kernel's numbers, and the same by other routes.

The kernel is what a sweep computes with (`solve.solve`); the other routes are those of `crosschecks`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.confirm.crosschecks import covariance_rms, line_rms, state_response
from freqrail.confirm.setup import Setup, track_ranges
from freqrail.confirm.simulated import Simulated, kernel_problem, static_loads
from freqrail.confirm.time_side import OperatingPoint, time_side, vehicles
from freqrail.model.band import Band
from freqrail.model.spectrum import RationalSpectrum, frequency_psd, standard_deviation
from freqrail.solver import solve


@dataclass(frozen=True)
class References:
    """Numbers of a point, [model, series] unless said otherwise, SI units; NaN where there is none.

    kernel: RMS over the band confirmed. line_spectrum: the same from the lines of record 0. line_change: by how much
    that changes, relative, if the record is twice as long. own: the kernel's RMS over the result's own band.
    covariance, covariance_rounding: RMS over the whole axis from the states' covariance, and the relative rounding in
    it; NaN unless that is the result's own band. psd: [model, series, n] at the result's frequencies, from the state
    space. track_deviation: [range] of `setup.track_ranges`, m, in closed form. wheel_load: of
    `simulated.static_loads`, N.
    """

    kernel: NDArray[np.float64]
    line_spectrum: NDArray[np.float64]
    line_change: NDArray[np.float64]
    own: NDArray[np.float64]
    covariance: NDArray[np.float64]
    covariance_rounding: NDArray[np.float64]
    psd: NDArray[np.float64]
    track_deviation: NDArray[np.float64]
    wheel_load: NDArray[np.float64]


def references(point: OperatingPoint, setup: Setup, own: Band | None, frequency: NDArray[np.float64]) -> References:
    """The numbers to hold a point against. own: the result's band, None for the whole axis. frequency: [n], Hz."""
    models = list(vehicles(point).values())
    confirmed = Band("frequency", *setup.limits)

    def lines(period: float) -> NDArray[np.float64]:
        return np.array([line_rms(v, setup.names, point.spectrum, point.speed, setup.limits, period) for v in models])

    kernel = np.array([kernel_rms(vehicle, point, setup.names, confirmed) for vehicle in models])
    once, twice = lines(setup.period), lines(2 * setup.period)
    covariance, rounding = _covariances(point, setup) if own is None else (np.full_like(kernel, np.nan),) * 2
    return References(
        kernel=kernel,
        line_spectrum=once,
        line_change=np.abs(once / twice - 1),
        own=kernel if own == confirmed else np.array([kernel_rms(v, point, setup.names, own) for v in models]),
        covariance=covariance,
        covariance_rounding=rounding,
        psd=_spectra(point, setup, frequency),
        track_deviation=_track_deviations(point, setup),
        wheel_load=static_loads(point.vehicle),
    )


def kernel_rms(
    vehicle: Simulated, point: OperatingPoint, names: tuple[str, ...], band: Band | None
) -> NDArray[np.float64]:
    """RMS of a vehicle at a point's speed and on its track by the kernel of a sweep: [series]."""
    rms = solve.solve(kernel_problem(vehicle, np.array([point.speed]), point.spectrum, band, names)).rms
    return np.concatenate([rms[name][:, 0] for name in names])


def _covariances(point: OperatingPoint, setup: Setup) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if not isinstance(point.spectrum, RationalSpectrum):
        return (np.full((len(vehicles(point)), setup.series), np.nan),) * 2
    side = time_side(point, setup.names)
    found = [
        covariance_rms(
            model,
            side.readout[name],
            side.feedthrough[name],
            side.lags,
            point.spectrum,
            point.speed,
            side.rates.get(name),
        )
        for name, model in side.models.items()
    ]
    return np.array([rms for rms, _ in found]), np.array([rounding for _, rounding in found])


def _spectra(point: OperatingPoint, setup: Setup, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    side = time_side(point, setup.names)
    density = frequency_psd(point.spectrum, frequency, point.speed)
    transfer = [
        state_response(model, side.readout[name], side.feedthrough[name], side.lags, frequency, side.rates.get(name))
        for name, model in side.models.items()
    ]
    return np.square(np.abs(np.array(transfer))) * density


def _track_deviations(point: OperatingPoint, setup: Setup) -> NDArray[np.float64]:
    if not isinstance(point.spectrum, RationalSpectrum):
        return np.full(2, np.nan)
    return np.array(
        [
            standard_deviation(point.spectrum, (point.speed / high, point.speed / low))
            for low, high in track_ranges(point, setup)
        ]
    )
