"""Grid points in the time domain: what a simulation says of the numbers that came from frequency responses.

One period of the simulated response is held against the line spectrum of the same record, where only the integrator's
error is left, and Gaussian records against the RMS over the continuous spectrum (`freqrail.result.verdicts`).

The frequency side (`crosschecks.transfer_power`) and the time side (`equations.state_space`) share what both are told,
the vehicle's numbers, the lags of eq. (2) and S_v of eq. (11), and nothing else; a fault put into a `Simulated` is on
the time side only.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.linalg import block_diag

from freqrail.confirm.crosschecks import state_response
from freqrail.confirm.integrators import Accuracy, integrate, solver_of, stack
from freqrail.confirm.setup import (
    BATCH,
    HISTORY,
    KEPT_EVERY,
    PSD_LINES,
    RAMP,
    Setup,
    accuracy,
    check_setup,
    groups,
    sampling_rate,
    startup,
    track_ranges,
)
from freqrail.confirm.statistics import degrees_of_freedom
from freqrail.confirm.time_side import OperatingPoint, TimeSide, line_power, time_side
from freqrail.confirm.track_record import (
    Track,
    fixed_amplitudes,
    gaussian_amplitudes,
    mean_square,
    sampled_track,
    spectral_lines,
    stream,
    track_deviation,
    track_lags,
)
from freqrail.errors import NumericalError
from freqrail.model.equations import StateSpace
from freqrail.types import SecondsProgress

TRIAL = 0.3  # s of wall time that the cost of a run is measured for
TRIAL_LEAST = 0.05  # s of simulated time that a trial covers at least, ...
SLOW_TRIAL = 3.0  # ... unless that takes more than this, s of wall time
TRIAL_PERIOD = 5.0  # s, of the track that a trial runs on


@dataclass(frozen=True)
class Simulation:
    """What was found at a point. Numbers in SI units, NaN where a run failed; series in the order of the setup's names.

    line_spectrum, simulated: RMS of every record, [model, series, record], the record of fixed amplitudes first.
    pooled: RMS of all Gaussian records together, [model, series]; degrees: its degrees of freedom.
    frequency [n], psd, psd_simulated [model, series, n]: one-sided PSD per Hz at a choice of lines, from the frequency
    responses and from the simulated record of fixed amplitudes. time [m], s; heights [wheels, m]; histories
    [model, series, m]: the beginning of that record. track_deviation [range]: standard deviation of that record's
    track in each of `track_ranges`, m, NaN where it has no line there. lags [wheels]: those at which its track reaches
    the wheels, s. startup: s. tighter_change: largest relative change of an RMS of the first record ten times tighter;
    NaN if that was not asked for. failures: what went wrong, by model.
    """

    line_spectrum: NDArray[np.float64]
    simulated: NDArray[np.float64]
    pooled: NDArray[np.float64]
    degrees: NDArray[np.float64]
    frequency: NDArray[np.float64]
    psd: NDArray[np.float64]
    psd_simulated: NDArray[np.float64]
    time: NDArray[np.float64]
    heights: NDArray[np.float64]
    histories: NDArray[np.float64]
    track_deviation: NDArray[np.float64]
    lags: NDArray[np.float64]
    startup: float
    tighter_change: float
    failures: dict[str, str]

    @property
    def solver_error(self) -> NDArray[np.float64]:
        """Largest relative difference of a record's simulated RMS from its line spectrum's: [model, series]."""
        return np.max(np.abs(self.simulated / self.line_spectrum - 1), axis=-1)


# --- the two sides ---------------------------------------------------------------------------------


# --- before the run --------------------------------------------------------------------------------


def seconds(point: OperatingPoint, setup: Setup) -> float:
    """Estimated wall time of `examine`, s, from running the first moments of it in the steady state."""
    trial = replace(setup, start="steady", period=min(setup.period, TRIAL_PERIOD))
    side, accurate = time_side(point, setup.names), accuracy(point, setup)
    prepared = _prepare(point, trial, side, amplitudes(point, trial)[:BATCH])
    simulated = startup(point, setup) + setup.period
    total = 0.0
    for integrator, names in groups(setup):
        model, start, size = _stacked(prepared, names)
        options = (integrator, model, prepared.track, start, size)
        begin = time.perf_counter()
        if integrator in ("rk45", "radau"):
            solver = solver_of(*options, accurate)
            done = spent = 0.0
            while solver.status == "running" and spent < (TRIAL if done > TRIAL_LEAST else SLOW_TRIAL):
                solver.step()
                done, spent = solver.t, time.perf_counter() - begin
        else:
            blocks = integrate(*options, prepared.stride, accurate)
            block = next(blocks)
            spent, begin = time.perf_counter() - begin, time.perf_counter()
            if (second := next(blocks, None)) is not None:  # the first holds what is done once
                block, spent = second, time.perf_counter() - begin
            done = len(block) * prepared.stride * prepared.track.step
        total += spent / max(done, 1e-12) * simulated
    return total * -(-(setup.realisations + 1) // BATCH)


# --- the run ---------------------------------------------------------------------------------------


def amplitudes(point: OperatingPoint, setup: Setup) -> NDArray[np.complex128]:
    """Complex amplitudes of the lines, [1 + realisations, K], m: fixed moduli first, then the Gaussian records."""
    lines = spectral_lines(point.spectrum, point.speed, setup.limits, setup.period)
    fixed = fixed_amplitudes(lines, stream(setup.seed, point.key, "fixed amplitudes", 0))
    records = range(1, setup.realisations + 1)
    return np.array(
        [fixed, *(gaussian_amplitudes(lines, stream(setup.seed, point.key, "gaussian", r)) for r in records)]
    )


def examine(
    point: OperatingPoint,
    setup: Setup,
    side: TimeSide | None = None,
    tighter: bool = False,
    progress: SecondsProgress = lambda seconds: None,
) -> Simulation:
    """Simulate a point and hold it against the frequency responses.

    side: what is simulated; the point itself unless given. tighter: repeat the first record ten times tighter.
    progress: called with the simulated seconds just done, of `simulated_seconds` in all. A run that fails leaves NaN
    and its reason in `failures`. Raises InputError as `check_plan` does.
    """
    check_setup(point, setup)
    side = side or time_side(point, setup.names)
    lines = spectral_lines(point.spectrum, point.speed, setup.limits, setup.period)
    records = amplitudes(point, setup)
    power = line_power(point, setup.names, lines.frequency)
    squares = np.full((len(setup.models), setup.series, len(records)), np.nan)
    failures: dict[str, str] = {}
    first = None
    for begin in range(0, len(records), BATCH):
        batch = slice(begin, begin + BATCH)
        prepared = _prepare(point, setup, side, records[batch])
        squares[..., batch], responses, faults = run_records(setup, prepared, progress)
        failures |= faults
        first = first or (prepared, responses)
    assert first is not None
    prepared, responses = first
    change = math.nan
    if tighter:
        finer = setup.tighter()
        again, _, faults = run_records(finer, _prepare(point, finer, side, records[:1]), progress)
        failures |= {model: f"ten times tighter: {fault}" for model, fault in faults.items()}
        change = float(np.max(np.abs(np.sqrt(again[..., 0] / squares[..., 0]) - 1)))
    chosen = np.unique(np.geomspace(1, lines.order.size, PSD_LINES).round().astype(np.intp)) - 1
    transform = np.fft.rfft(responses, axis=-1)[..., lines.order[chosen]] * (2 / responses.shape[-1])
    spacing = prepared.stride * prepared.track.step
    shown = min(responses.shape[-1], round(HISTORY / spacing))
    mean = power * lines.amplitude**2 / 2
    return Simulation(
        line_spectrum=np.sqrt(mean_square(power, records)),
        simulated=np.sqrt(squares),
        pooled=np.sqrt(np.mean(squares[..., 1:], axis=-1)),
        degrees=degrees_of_freedom(power, lines, setup.realisations),
        frequency=lines.frequency[chosen],
        psd=mean[..., chosen] / lines.width[chosen],
        psd_simulated=np.square(np.abs(transform)) / 2 / lines.width[chosen],
        time=spacing * np.arange(shown),
        heights=_kept_heights(prepared, 0, shown)[..., 0].T,
        histories=responses[..., :shown],
        track_deviation=track_deviation(lines, prepared.track, track_ranges(point, setup)),
        lags=track_lags(lines, prepared.track),
        startup=prepared.track.startup,
        tighter_change=change,
        failures=failures,
    )


@dataclass(frozen=True)
class Prepared:
    """A batch of records ready to run: the track, and by model its state space, start, size and readout."""

    track: Track
    stride: int
    accuracy: Accuracy
    side: TimeSide
    start: dict[str, NDArray[np.float64]]
    size: dict[str, NDArray[np.float64]]


def _prepare(point: OperatingPoint, setup: Setup, side: TimeSide, records: NDArray[np.complex128]) -> Prepared:
    lines = spectral_lines(point.spectrum, point.speed, setup.limits, setup.period)
    samples = _samples(point, side, setup)
    before = math.ceil(startup(point, setup) * samples / setup.period)
    ramp = 0.0 if setup.start == "steady" else RAMP
    track = sampled_track(lines, records, side.lags, samples, before, ramp, setup.interpolation)
    start, size = {}, {}
    for name, model in side.models.items():
        every, none = np.eye(len(model.a)), np.zeros(model.b.shape)
        steady = state_response(model, every, none, side.lags, lines.frequency)
        size[name] = np.sqrt(np.square(np.abs(steady)) @ np.square(lines.amplitude) / 2)
        start[name] = (steady @ records.T).real * (setup.start == "steady")
    return Prepared(track, KEPT_EVERY, accuracy(point, setup), side, start, size)


def _samples(point: OperatingPoint, side: TimeSide, setup: Setup) -> int:
    """Samples of the track in a period."""
    samples = next_fast_len(math.ceil(sampling_rate(point, setup, side) * setup.period))
    while samples % KEPT_EVERY:
        samples = next_fast_len(samples + 1)
    return samples


def _stacked(prepared: Prepared, names: tuple[str, ...]) -> tuple[StateSpace, NDArray, NDArray]:
    model = stack([prepared.side.models[name] for name in names])
    start = np.vstack([prepared.start[name] for name in names])
    return model, start, np.concatenate([prepared.size[name] for name in names])


def run_records(setup: Setup, prepared: Prepared, progress: SecondsProgress) -> tuple[NDArray, NDArray, dict[str, str]]:
    """Mean squares [model, series, record], all responses of the first record [model, series, m], and failures."""
    kept = prepared.track.samples // prepared.stride
    records = prepared.track.coefficients.shape[2]
    count = len(prepared.side.readout[setup.models[0]])
    squares = np.full((len(setup.models), count, records), np.nan)
    responses = np.full((len(setup.models), count, kept), np.nan)
    failures: dict[str, str] = {}
    waiting = groups(setup)
    while waiting:
        integrator, names = waiting.pop(0)
        model, start, size = _stacked(prepared, names)
        rows = block_diag(*(prepared.side.readout[name] for name in names))
        feedthrough = np.vstack([prepared.side.feedthrough[name] for name in names])
        rates = _stacked_rates(prepared, names)
        at = [setup.models.index(name) for name in names]
        total = np.zeros((len(rows), records))
        done = 0
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for block in integrate(
                    integrator, model, prepared.track, start, size, prepared.stride, prepared.accuracy, progress
                ):
                    y = rows @ block + feedthrough @ _kept_heights(prepared, done, len(block))
                    if rates is not None:
                        y = y + rates @ _kept_rates(prepared, done, len(block))
                    total += np.square(y).sum(axis=0)
                    responses[at, :, done : done + len(y)] = y[..., 0].T.reshape(len(at), count, len(y))
                    done += len(y)
        except NumericalError as fault:
            responses[at] = np.nan
            if len(names) > 1:  # one model must not take the other's numbers with it
                waiting += [(integrator, (name,)) for name in names]
            else:
                failures[names[0]] = str(fault)
        else:
            squares[at] = (total / kept).reshape(len(at), count, records)
    return squares, responses, failures


def _stacked_rates(prepared: Prepared, names: tuple[str, ...]) -> NDArray[np.float64] | None:
    """What the models' responses feel of the heights' rates at once, [series, wheels]; None for nothing."""
    side = prepared.side
    if not any(name in side.rates for name in names):
        return None
    return np.vstack([side.rates.get(name, np.zeros_like(side.feedthrough[name])) for name in names])


def _kept_rates(prepared: Prepared, first: int, count: int) -> NDArray[np.float64]:
    """Rates of the track's heights at the kept samples: as `_kept_heights`, m/s."""
    track, stride = prepared.track, prepared.stride
    return track.rates_at_steps(track.before + first * stride, count * stride)[::stride]


def _kept_heights(prepared: Prepared, first: int, count: int) -> NDArray[np.float64]:
    """Track heights at the kept samples of the period from the `first`: [count, wheels, records], m."""
    track, stride = prepared.track, prepared.stride
    return track.at_steps(track.before + first * stride, count * stride)[::stride]
