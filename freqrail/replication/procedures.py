"""The paper's own procedure, or what it may have been: 20 s from rest at each point, integrated in time.

The paper samples a track in time, starts the vehicle at rest on it, integrates with a variable step and takes the RMS
of the whole run. Each of these is a choice here, so that they can be varied one at a time. Tracks, their interpolation
and the recurrences are those of `realisation` and `integrators`; here many runs go through them abreast, with
Runge-Kutta each at steps of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import RK45

from freqrail.confirm.integrators import exponential_recurrence, newmark_recurrence
from freqrail.confirm.time_side import readout
from freqrail.confirm.track_record import (
    Track,
    basis_polynomials,
    fixed_amplitudes,
    sampled_track,
    spectral_lines,
    stream,
)
from freqrail.model.equations import StateSpace, state_space
from freqrail.model.inputs import wheel_lags
from freqrail.model.spectrum import Spectrum
from freqrail.model.vehicle import Vehicle, half_vehicle
from freqrail.types import SecondsProgress

DURATION = 20.0  # s, section VI
SAMPLE = 1e-3  # s between samples of the track; the paper does not say
RELATIVE, ABSOLUTE = 1e-3, 1e-6  # tolerances that variable-step Runge-Kutta solvers come with
KEY = "replicate"

_BLOCK = 500  # samples at once
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 10.0  # of scipy's step control


_RECURRENCES = {"exponential": exponential_recurrence, "newmark": newmark_recurrence}


@dataclass(frozen=True)
class Procedure:
    """How a point is run.

    joint, traditional: what integrates either model: "exponential", exact for the track as interpolated; "rk45" with
    default tolerances; "newmark" (traditional model only) at a step of SAMPLE. interpolation: "cubic" or "linear".
    start: "level", every wheel on even track until the irregularity, taken from its first height, reaches it; or
    "jump", the vehicle at rest on a track that is not at zero. records: how many tracks are run. own_track: every
    vehicle has tracks of its own, else all share them.
    """

    joint: str = "exponential"
    traditional: str = "exponential"
    interpolation: str = "cubic"
    start: str = "level"
    records: int = 1
    own_track: bool = False


def run(
    procedure: Procedure,
    vehicles: Sequence[Vehicle],
    spectrum: Spectrum,
    speeds: NDArray[np.float64],
    limits: tuple[float, float],
    seed: int = 0,
    progress: SecondsProgress = lambda seconds: None,
) -> NDArray[np.float64]:
    """RMS over whole runs from rest: [vehicles, series, speeds, records], SI units, series as `time_side.readout`.

    vehicles: with finite joints or, in both stages, rigid ones; all of one geometry. speeds in m/s, limits of the band
    in Hz. The phases of the tracks do not depend on the speed. NaN where an integration fails. progress: called with
    the simulated seconds just done.
    """
    rigid = np.array([bool(np.isinf(vehicle.primary_joint_stiffness)) for vehicle in vehicles])
    systems = [half_vehicle(vehicle) for vehicle in vehicles]
    models = [state_space(system) for system in systems]
    rows = [readout(*each)[0] for each in zip(systems, models, vehicles, strict=True)]
    shape = (len(vehicles), speeds.size)
    result = np.empty((*shape, len(rows[0]), procedure.records))
    tracks = [_tracks(procedure, vehicles, spectrum, float(speed), limits, seed) for speed in speeds]
    for which, integrator in ((rigid, procedure.traditional), (~rigid, procedure.joint)):
        chosen = np.flatnonzero(which)
        # recurrences share the matrices of a speed's step; Runge-Kutta gains from many runs abreast
        together = [range(speeds.size)] if integrator == "rk45" else [[k] for k in range(speeds.size)]
        for some in together if chosen.size else ():
            places = [(n, k) for n in chosen for k in some]
            parts = (
                [models[n] for n, _ in places],
                [tracks[k][n] for n, k in places],
                np.array([rows[n] for n, _ in places]),
            )
            with np.errstate(over="ignore", invalid="ignore"):
                squares = runge_kutta(*parts, progress) if integrator == "rk45" else recurrent(integrator, *parts)
            for place, square in zip(places, squares, strict=True):
                result[place] = np.sqrt(np.where(np.isfinite(square), square, np.nan))
            if integrator != "rk45":
                progress(DURATION * len(places) * procedure.records)
    return np.swapaxes(result, 1, 2)


def _tracks(
    procedure: Procedure,
    vehicles: Sequence[Vehicle],
    spectrum: Spectrum,
    speed: float,
    limits: tuple[float, float],
    seed: int,
) -> list[Track]:
    """The track of every vehicle at a speed, its records as columns."""
    lines = spectral_lines(spectrum, speed, limits, DURATION)
    lags = wheel_lags(vehicles[0], speed)

    def track(key: str) -> Track:
        streams = (stream(seed, key, "track", record) for record in range(procedure.records))
        amplitudes = np.array([fixed_amplitudes(lines, random) for random in streams])
        made = sampled_track(lines, amplitudes, lags, round(DURATION / SAMPLE), interpolation=procedure.interpolation)
        return _level(made, lags) if procedure.start == "level" else made

    if procedure.own_track:
        return [track(f"{KEY}, vehicle {n}") for n in range(len(vehicles))]
    return [track(KEY)] * len(vehicles)


def _level(track: Track, lags: NDArray[np.float64]) -> Track:
    """The track with every wheel at zero until its lag has passed, and less the first height from then on."""
    # a constant has the same coefficients, so that this shifts the heights themselves
    index = np.arange(len(track.coefficients)) - (track.degree - 1) // 2
    begun = index[:, None] * track.step >= lags
    return replace(track, coefficients=(track.coefficients - track.heights(0.0)[0]) * begun[:, :, None])


# --- by recurrence ---------------------------------------------------------------------------------


def recurrent(
    integrator: str, models: Sequence[StateSpace], tracks: Sequence[Track], rows: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean squares [models, series, records] from rest by a recurrence of `integrators`, all models abreast.

    tracks: one a model, alike in all but the heights. rows: [models, series, states].
    """
    track = tracks[0]
    rules = [_RECURRENCES[integrator](model, track) for model in models]
    advance = np.array([rule.advance for rule in rules])
    forcing = [np.hstack(list(rule.forcing)) for rule in rules]  # [z, j x wheels]
    states, records = models[0].a.shape[0], track.coefficients.shape[-1]
    z = np.array(
        [rule.lift(np.zeros((states, records)), own.heights(0.0)) for rule, own in zip(rules, tracks, strict=True)]
    )
    total = np.zeros((len(models), rows.shape[1], records))
    for first in range(0, track.samples, _BLOCK):
        count = min(_BLOCK, track.samples - first)
        pushes = np.array(
            [
                push @ rule.inputs(own, first, count).reshape(count, -1, records)
                for push, rule, own in zip(forcing, rules, tracks, strict=True)
            ]
        ).swapaxes(0, 1)
        kept = np.empty((count, *z.shape))
        for step in range(count):
            kept[step] = z
            z = advance @ z + pushes[step]
        total += np.square(rows @ kept[:, :, rules[0].states]).sum(axis=0)
    return total / track.samples


# --- Runge-Kutta -----------------------------------------------------------------------------------


def runge_kutta(
    models: Sequence[StateSpace],
    tracks: Sequence[Track],
    rows: NDArray[np.float64],
    progress: SecondsProgress = lambda seconds: None,
) -> NDArray[np.float64]:
    """Mean squares [models, series, records] from rest by scipy's RK45 with default tolerances, all runs abreast.

    Each model and record has its own time, step and error control, as if run alone: the formulas and the control are
    those of `scipy.integrate.RK45`. The mean square is the trapezoidal rule over the steps that were accepted.
    """
    records = tracks[0].coefficients.shape[-1]
    runs = [(m, r) for m in range(len(models)) for r in range(records)]
    a, b = np.array([models[m].a for m, _ in runs]), np.array([models[m].b for m, _ in runs])
    read = np.array([rows[m] for m, _ in runs])
    heights = _Heights(tracks)
    end = tracks[0].end
    step = np.array([_first_step(models[m], tracks[m], r) for m, r in runs])
    time, rejected = np.zeros(len(runs)), np.zeros(len(runs), dtype=bool)
    x = np.zeros(a.shape[:2])
    slope = _times(a, x) + _times(b, heights.at(time, np.arange(len(runs))))
    square = np.square(_times(read, x))
    total = np.zeros(square.shape)
    active = np.arange(len(runs))
    while active.size:
        own_a, own_b, own_read = a[active], b[active], read[active]
        going = np.ones(active.size, dtype=bool)
        told = time[active].sum()
        while going.all():
            t, y = time[active], x[active]
            h = np.minimum(step[active], end - t)
            k = np.empty((RK45.n_stages + 1, *y.shape))
            k[0] = slope[active]
            for s in range(1, RK45.n_stages):
                inner = y + h[:, None] * np.tensordot(RK45.A[s, :s], k[:s], 1)
                k[s] = _times(own_a, inner) + _times(own_b, heights.at(t + RK45.C[s] * h, active))
            new = y + h[:, None] * np.tensordot(RK45.B, k[:-1], 1)
            k[-1] = _times(own_a, new) + _times(own_b, heights.at(t + h, active))
            scale = ABSOLUTE + RELATIVE * np.maximum(np.abs(y), np.abs(new))
            error = np.sqrt(np.mean(np.square(h[:, None] * np.tensordot(RK45.E, k, 1) / scale), axis=1))
            good = error < 1
            factor = _SAFETY * np.maximum(error, 1e-30) ** (-1 / (RK45.error_estimator_order + 1))
            longer = np.minimum(np.where(rejected[active], 1.0, _GROW), factor)
            step[active] = h * np.where(good, longer, np.maximum(_SHRINK, factor))
            rejected[active] = ~good
            done = active[good]
            after = np.square(_times(own_read, new)[good])
            total[done] += 0.5 * h[good, None] * (square[done] + after)
            square[done], x[done], slope[done] = after, new[good], k[-1, good]
            time[done] += h[good]
            lost = ~np.isfinite(error)
            total[active[lost]] = np.nan
            going = ~lost & (time[active] < end * (1 - 1e-12))
            if time[active].sum() - told > active.size:  # a second of each, so that progress moves
                progress(time[active].sum() - told)
                told = time[active].sum()
        progress(time[active].sum() - told)
        active = active[going]
    return np.swapaxes(total.reshape(len(models), records, -1), 1, 2) / end


def _first_step(model: StateSpace, track: Track, record: int) -> float:
    """The step that scipy begins with."""

    def slope(time: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(model.a @ x + model.b @ track.heights(time)[:, record])

    return float(RK45(slope, 0.0, np.zeros(len(model.a)), track.end, rtol=RELATIVE, atol=ABSOLUTE).h_abs)


class _Heights:
    """Track heights [runs, wheels] at a time of its own for every run."""

    def __init__(self, tracks: Sequence[Track]) -> None:
        self.coefficients = np.concatenate([np.moveaxis(track.coefficients, -1, 0) for track in tracks])
        self.step, self.last = tracks[0].step, tracks[0].samples - 1
        self.basis = basis_polynomials(tracks[0].degree)

    def at(self, time: NDArray[np.float64], runs: NDArray[np.intp]) -> NDArray[np.float64]:
        """Heights at `time` [n] under the wheels of the runs [n]."""
        place = time / self.step
        start = np.minimum(place.astype(np.intp), self.last)
        weights = self.basis @ ((place - start) ** np.arange(self.basis.shape[1])[:, None])
        heights = 0.0
        for j, weight in enumerate(weights):
            heights = heights + weight[:, None] * self.coefficients[runs, start + j]
        return np.asarray(heights)


def _times(matrices: NDArray, vectors: NDArray) -> NDArray[np.float64]:
    return np.asarray(np.matmul(matrices, vectors[..., None])[..., 0])
