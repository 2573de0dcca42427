"""Grid points in the time domain: what a simulation says of the numbers that came from frequency responses.

One period of the simulated response is held against the line spectrum of the same record, where only the integrator's
error is left, and Gaussian records against the RMS over the continuous spectrum (`freqrail.verdicts`).

The frequency side (`crosschecks.transfer_power`) and the time side (`vehicle.state_space`) share what both are told,
the vehicle's numbers, the lags of eq. (2) and S_v of eq. (11), and nothing else; a fault put into a `Simulated` is on
the time side only.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.linalg import block_diag

from freqrail.crosschecks import state_response, transfer_power
from freqrail.errors import InputError, NumericalError
from freqrail.integrators import Accuracy, integrate, solver_of, stack
from freqrail.realisation import (
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
from freqrail.response import wheel_lags
from freqrail.responses import PAPER, series_count
from freqrail.statistics import degrees_of_freedom
from freqrail.track import Spectrum, frequency_psd
from freqrail.types import SecondsProgress
from freqrail.vehicle import DEGREES_OF_FREEDOM, StateSpace, System, Vehicle, half_vehicle, poles, state_space

MODELS = ("joint", "traditional")

SOLVER_TOLERANCE = {"rk45": 2e-5, "exponential": 2e-5, "radau": 2e-5, "newmark": 1e-3}
"""Largest solver error, relative, that an integrator is allowed."""

FORGOTTEN = 1e-5  # what is left of the start's transient when the measured period begins
RESOLVED = 1e-3  # a mode in the band must decay by this within a record, or the lines step over its peak
RAMP = 4.0  # s, over which the track rises at the start
NEAR = 40.0 / RAMP  # Hz beyond the band's end where the ramp's own spectrum still strikes a mode
SAMPLES_A_PERIOD = (10, 14, 20, 28, 40, 56, 80)  # of the track, at the highest line: the first that will do
IMAGES = 1e-6  # what the images of the track's spline may add to an RMS, relative
IMAGE_LINES = 400  # at which they are reckoned
STEPS_A_PERIOD = 5  # at least, of an integrator with error control, at the highest line
KEPT_EVERY = 2  # steps of the track: the responses keep five samples a period of the highest line
NEWMARK_SUBSTEPS = 8
WELL_DAMPED = 0.02  # damping ratio below which an integrator's own damping would show at the default tolerance
BATCH = 16  # records that are columns of one state
MOST_MEMORY = 4e9  # bytes of tracks and responses
TRIAL = 0.3  # s of wall time that the cost of a run is measured for
TRIAL_LEAST = 0.05  # s of simulated time that a trial covers at least, ...
SLOW_TRIAL = 3.0  # ... unless that takes more than this, s of wall time
TRIAL_PERIOD = 5.0  # s, of the track that a trial runs on
HISTORY = 10.0  # s of the first record that are kept to be drawn
PSD_LINES = 600  # lines, at most, at which spectra are kept
GOOD_TRACK = (3.0, 25.0)  # m, the wavelengths by which track standards judge a track (EN 13848-1, range D1)


@dataclass(frozen=True)
class Plan:
    """How a point is simulated.

    limits: the band, Hz. period: length of a record, s. realisations: Gaussian records, beside one of fixed
    amplitudes. integrator: of `integrators.INTEGRATORS`. start: "rest" or "steady". seed: see `realisation.stream`.
    accuracy: None for the defaults. interpolation: of the track between samples, "cubic" (or, to show what
    it does, "linear"). names: of the responses. finer: times the track's samples that will do.
    """

    limits: tuple[float, float]
    period: float = 60.0
    realisations: int = 8
    integrator: str = "rk45"
    start: str = "rest"
    seed: int = 0
    accuracy: Accuracy = field(default_factory=lambda: Accuracy(substeps=NEWMARK_SUBSTEPS))
    interpolation: str = "cubic"
    names: tuple[str, ...] = PAPER
    finer: int = 1

    def tighter(self) -> Plan:
        """The same ten times tighter: tolerances; the steps of a method of second order; else the track's samples."""
        accuracy = replace(
            self.accuracy,
            relative=self.accuracy.relative / 10,
            absolute=self.accuracy.absolute / 10,
            substeps=math.ceil(self.accuracy.substeps * math.sqrt(10)),
        )
        return replace(self, accuracy=accuracy, finer=2 if self.integrator == "exponential" else 1)


@dataclass(frozen=True)
class Point:
    """A grid point, SI units. key: its values as text, which its random numbers are keyed by."""

    vehicle: Vehicle
    speed: float
    spectrum: Spectrum
    key: str


@dataclass(frozen=True)
class Simulated:
    """The time side of a point: state spaces and what reads the responses off them, by model, and the wheels' lags.

    readout: [series, states] a model, feedthrough: [series, wheels], of the track heights. lags: [wheels], s.
    """

    models: dict[str, StateSpace]
    readout: dict[str, NDArray[np.float64]]
    feedthrough: dict[str, NDArray[np.float64]]
    lags: NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """What was found at a point. Numbers in SI units, NaN where a run failed; series in the order of the plan's names.

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


def readout(
    system: System, model: StateSpace, vehicle: Vehicle, names: tuple[str, ...] = PAPER
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """C [series, states] and D [series, wheels]: the responses of a half vehicle are C x + D v (signs as in `vehicle`).

    x: the states, v: the track heights under the wheels, m, which only the wheelsets' accelerations feel at once.
    """
    unit = dict(zip(DEGREES_OF_FREEDOM, np.eye(len(system.freedoms)), strict=True))
    arm = vehicle.half_bogie_spacing
    accelerated = {
        # over the front pivot, at the centre, over the rear pivot
        "car_body_acceleration": [unit["z_c"] + place * unit["beta_c"] for place in (-arm, 0.0, arm)],
        "bogie_acceleration": [unit["z_t1"], unit["z_t2"]],
        "wheelset_acceleration": [unit[f"z_w{axle}"] for axle in (1, 2, 3, 4)],
        "car_body_pitch_acceleration": [unit["beta_c"]],
        "bogie_pitch_acceleration": [unit["beta_t1"], unit["beta_t2"]],
    }
    n, states = len(system.freedoms), len(model.states)
    rows, feedthrough = [], []
    for name in names:
        if name in accelerated:
            q = np.array(accelerated[name])
            rows.append(q @ model.a[:n])
            feedthrough.append(q @ model.b[:n])
            continue
        stage = name.removesuffix("_stroke")
        legs = np.array([leg.elongation for leg in system.legs if leg.name.startswith(stage)])
        rows.append(np.hstack([np.zeros((len(legs), states - n)), legs]))
        feedthrough.append(np.zeros((len(legs), model.b.shape[1])))
    return np.vstack(rows), np.vstack(feedthrough)


def time_side(point: Point, names: tuple[str, ...] = PAPER) -> Simulated:
    """The simulated side of a point, without any fault."""
    models, rows, feedthrough = {}, {}, {}
    for name, vehicle in vehicles(point).items():
        system = half_vehicle(vehicle)
        models[name] = state_space(system)
        rows[name], feedthrough[name] = readout(system, models[name], vehicle, names)
    return Simulated(models, rows, feedthrough, wheel_lags(point.vehicle, point.speed))


def vehicles(point: Point) -> dict[str, Vehicle]:
    """The vehicle of a point by model."""
    return {"joint": point.vehicle, "traditional": point.vehicle.traditional()}


def line_power(point: Point, names: tuple[str, ...], frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """|T|^2 of the named responses of both models at `frequency` [K] in Hz, from the FRFs: [model, series, K]."""
    return np.array([transfer_power(vehicle, names, point.speed, frequency) for vehicle in vehicles(point).values()])


# --- before the run --------------------------------------------------------------------------------


def slowest_decay(point: Point, highest: float) -> float:
    """Decay rate, 1/s, of the slowest mode of either model that a band up to `highest` [Hz] strikes."""
    return float(np.min(-_struck(point, highest).real))


def accuracy(point: Point, plan: Plan) -> Accuracy:
    """The plan's accuracy, tighter where a mode in the band is so little damped that rk45's own damping would show."""
    modes = _struck(point, plan.limits[1])
    least = float(np.min(-modes.real / np.abs(modes)))
    sharper = min(1.0, least / WELL_DAMPED)
    longest = min(plan.accuracy.longest_step, 1 / (STEPS_A_PERIOD * plan.limits[1]))
    return replace(
        plan.accuracy,
        relative=plan.accuracy.relative * sharper,
        absolute=plan.accuracy.absolute * sharper,
        longest_step=longest,
    )


def _struck(point: Point, highest: float) -> NDArray[np.complex128]:
    """Poles of both models, rad/s, that a band up to `highest` [Hz] strikes."""
    both = np.concatenate([poles(vehicle) for vehicle in vehicles(point).values()])
    if not np.isfinite(both).all():
        raise InputError("the vehicle's numbers are too far apart for double precision: nothing to simulate")
    return both[np.abs(both.imag) <= 2 * np.pi * (highest + NEAR)]


def startup(point: Point, plan: Plan) -> float:
    """Seconds from the start until the measured period: the ramp, then ln(1e5)/sigma of the slowest mode struck."""
    if plan.start == "steady":
        return 0.0
    return RAMP + math.log(1 / FORGOTTEN) / slowest_decay(point, plan.limits[1])


def check_plan(point: Point, plan: Plan) -> None:
    """Raise InputError for a plan that cannot answer: records too short for a mode, or more than fits the memory."""
    decay = slowest_decay(point, plan.limits[1])
    if decay <= 0:
        raise InputError("a mode inside the band is undamped: it has no steady response to confirm")
    least = math.log(1 / RESOLVED) / decay
    if plan.period < least:
        raise InputError(
            f"records of {plan.period:g} s are too short: a mode inside the band decays at {decay:.3g} 1/s, and the "
            f'lines of a record must resolve its peak; --duration "{math.ceil(least)} s" or more is due, or a --band '
            "without that mode"
        )
    samples = (plan.period + startup(point, plan)) * sampling_rate(point, plan, time_side(point, plan.names))
    needed = 8 * samples * (6 * min(plan.realisations + 1, BATCH) + 2 * series_count(plan.names))
    needed += 16 * plan.limits[1] * plan.period * (plan.realisations + 1)
    if needed > MOST_MEMORY:
        raise InputError(
            f"{plan.realisations} records of {plan.period:g} s take {needed / 1e9:.3g} GB of memory, more than "
            f"{MOST_MEMORY / 1e9:g} GB; give a smaller --duration or fewer --realisations"
        )


def seconds(point: Point, plan: Plan) -> float:
    """Estimated wall time of `examine`, s, from running the first moments of it in the steady state."""
    trial = replace(plan, start="steady", period=min(plan.period, TRIAL_PERIOD))
    side, told = time_side(point, plan.names), accuracy(point, plan)
    prepared = _prepare(point, trial, side, amplitudes(point, trial)[:BATCH])
    simulated = startup(point, plan) + plan.period
    total = 0.0
    for integrator, names in _groups(plan):
        model, start, size = _stacked(prepared, names)
        options = (integrator, model, prepared.track, start, size)
        begin = time.perf_counter()
        if integrator in ("rk45", "radau"):
            solver = solver_of(*options, told)
            done = spent = 0.0
            while solver.status == "running" and spent < (TRIAL if done > TRIAL_LEAST else SLOW_TRIAL):
                solver.step()
                done, spent = solver.t, time.perf_counter() - begin
        else:
            blocks = integrate(*options, prepared.stride, told)
            block = next(blocks)
            spent, begin = time.perf_counter() - begin, time.perf_counter()
            if (second := next(blocks, None)) is not None:  # the first holds what is done once
                block, spent = second, time.perf_counter() - begin
            done = len(block) * prepared.stride * prepared.track.step
        total += spent / max(done, 1e-12) * simulated
    return total * -(-(plan.realisations + 1) // BATCH)


# --- the run ---------------------------------------------------------------------------------------


def amplitudes(point: Point, plan: Plan) -> NDArray[np.complex128]:
    """Complex amplitudes of the lines, [1 + realisations, K], m: fixed moduli first, then the Gaussian records."""
    lines = spectral_lines(point.spectrum, point.speed, plan.limits, plan.period)
    fixed = fixed_amplitudes(lines, stream(plan.seed, point.key, "fixed amplitudes", 0))
    records = range(1, plan.realisations + 1)
    return np.array(
        [fixed, *(gaussian_amplitudes(lines, stream(plan.seed, point.key, "gaussian", r)) for r in records)]
    )


def examine(
    point: Point,
    plan: Plan,
    side: Simulated | None = None,
    tighter: bool = False,
    progress: SecondsProgress = lambda seconds: None,
) -> Evidence:
    """Simulate a point and hold it against the frequency responses.

    side: what is simulated; the point itself unless given. tighter: repeat the first record ten times tighter.
    progress: called with the simulated seconds just done, of `simulated_seconds` in all. A run that fails leaves NaN
    and its reason in `failures`. Raises InputError as `check_plan` does.
    """
    check_plan(point, plan)
    side = side or time_side(point, plan.names)
    lines = spectral_lines(point.spectrum, point.speed, plan.limits, plan.period)
    records = amplitudes(point, plan)
    power = line_power(point, plan.names, lines.frequency)
    squares = np.full((len(MODELS), series_count(plan.names), len(records)), np.nan)
    failures: dict[str, str] = {}
    first = None
    for begin in range(0, len(records), BATCH):
        batch = slice(begin, begin + BATCH)
        prepared = _prepare(point, plan, side, records[batch])
        squares[..., batch], responses, faults = run_records(plan, prepared, progress)
        failures |= faults
        first = first or (prepared, responses)
    assert first is not None
    prepared, responses = first
    change = math.nan
    if tighter:
        finer = plan.tighter()
        again, _, faults = run_records(finer, _prepare(point, finer, side, records[:1]), progress)
        failures |= {model: f"ten times tighter: {fault}" for model, fault in faults.items()}
        change = float(np.max(np.abs(np.sqrt(again[..., 0] / squares[..., 0]) - 1)))
    chosen = np.unique(np.geomspace(1, lines.order.size, PSD_LINES).round().astype(np.intp)) - 1
    transform = np.fft.rfft(responses, axis=-1)[..., lines.order[chosen]] * (2 / responses.shape[-1])
    spacing = prepared.stride * prepared.track.step
    shown = min(responses.shape[-1], round(HISTORY / spacing))
    mean = power * lines.amplitude**2 / 2
    return Evidence(
        line_spectrum=np.sqrt(mean_square(power, records)),
        simulated=np.sqrt(squares),
        pooled=np.sqrt(np.mean(squares[..., 1:], axis=-1)),
        degrees=degrees_of_freedom(power, lines, plan.realisations),
        frequency=lines.frequency[chosen],
        psd=mean[..., chosen] / lines.width[chosen],
        psd_simulated=np.square(np.abs(transform)) / 2 / lines.width[chosen],
        time=spacing * np.arange(shown),
        heights=_kept_heights(prepared, 0, shown)[..., 0].T,
        histories=responses[..., :shown],
        track_deviation=track_deviation(lines, prepared.track, track_ranges(point, plan)),
        lags=track_lags(lines, prepared.track),
        startup=prepared.track.startup,
        tighter_change=change,
        failures=failures,
    )


def track_ranges(point: Point, plan: Plan) -> NDArray[np.float64]:
    """Limits, Hz, of the ranges in which a record's track is checked: GOOD_TRACK as far as the band reaches, the band.

    [range, 2]; an empty range is NaN.
    """
    shortest, longest = GOOD_TRACK
    low, high = max(plan.limits[0], point.speed / longest), min(plan.limits[1], point.speed / shortest)
    return np.array([[low, high] if low < high else [np.nan, np.nan], plan.limits])


def simulated_seconds(point: Point, plan: Plan, tighter: bool = False) -> float:
    """Seconds that `examine` simulates, a state of many columns counted once."""
    once = startup(point, plan) + plan.period
    return once * len(_groups(plan)) * (-(-(plan.realisations + 1) // BATCH) + tighter)


@dataclass(frozen=True)
class Prepared:
    """A batch of records ready to run: the track, and by model its state space, start, size and readout."""

    track: Track
    stride: int
    accuracy: Accuracy
    side: Simulated
    start: dict[str, NDArray[np.float64]]
    size: dict[str, NDArray[np.float64]]


def _prepare(point: Point, plan: Plan, side: Simulated, records: NDArray[np.complex128]) -> Prepared:
    lines = spectral_lines(point.spectrum, point.speed, plan.limits, plan.period)
    samples = _samples(point, side, plan)
    before = math.ceil(startup(point, plan) * samples / plan.period)
    ramp = 0.0 if plan.start == "steady" else RAMP
    track = sampled_track(lines, records, side.lags, samples, before, ramp, plan.interpolation)
    start, size = {}, {}
    for name, model in side.models.items():
        every, none = np.eye(len(model.a)), np.zeros(model.b.shape)
        steady = state_response(model, every, none, side.lags, lines.frequency)
        size[name] = np.sqrt(np.square(np.abs(steady)) @ np.square(lines.amplitude) / 2)
        start[name] = (steady @ records.T).real * (plan.start == "steady")
    return Prepared(track, KEPT_EVERY, accuracy(point, plan), side, start, size)


def _samples(point: Point, side: Simulated, plan: Plan) -> int:
    """Samples of the track in a period."""
    samples = next_fast_len(math.ceil(sampling_rate(point, plan, side) * plan.period))
    while samples % KEPT_EVERY:
        samples = next_fast_len(samples + 1)
    return samples


def sampling_rate(point: Point, plan: Plan, side: Simulated) -> float:
    """Samples of the track a second: enough for the highest line, and for its images to leave every RMS alone.

    They must clear every mode, for an undamped wheelset there would answer them, and add less than IMAGES to an RMS.
    """
    highest = plan.limits[1] + 0.5 / plan.period
    modes = max(float(np.abs(np.linalg.eigvals(model.a).imag).max()) / (2 * np.pi) for model in side.models.values())
    rate = math.inf
    for samples in SAMPLES_A_PERIOD:
        rate = max(samples * highest, highest + 2 * modes)
        if plan.interpolation != "cubic" or image_bound(point, plan, side, rate) <= IMAGES:
            break
    return rate * plan.finer


def image_bound(point: Point, plan: Plan, side: Simulated, rate: float) -> float:
    """Upper bound of what the images of a cubic spline with `rate` samples a second add to any RMS, relative.

    A line at f has images at m rate -+ f, (f/(m rate -+ f))^4 of its height. The kept samples cannot tell the first of
    them from the line, so that they may add up in phase: sum |Y_k| |image_k|/sum |Y_k|^2.
    """
    lines = np.linspace(*plan.limits, IMAGE_LINES)
    density = frequency_psd(point.spectrum, lines, point.speed)
    images = [(image, (lines / image) ** 4) for m in (1, 2) for image in (m * rate - lines, m * rate + lines)]
    worst = 0.0
    for name, model in side.models.items():
        own, *others = (
            np.abs(state_response(model, side.readout[name], side.feedthrough[name], side.lags, frequency))
            for frequency in (lines, *(image for image, _ in images))
        )
        added = sum(other * height for other, (_, height) in zip(others, images, strict=True))
        worst = max(worst, float(np.max((own * added) @ density / (own**2 @ density))))
    return worst


def _groups(plan: Plan) -> list[tuple[str, tuple[str, ...]]]:
    """(integrator, models that it runs together): as in the paper, newmark is for the traditional model alone."""
    if plan.integrator == "newmark":
        return [("rk45", ("joint",)), ("newmark", ("traditional",))]
    return [(plan.integrator, MODELS)]


def integrator_of(plan: Plan, model: str) -> str:
    """The integrator that runs a model."""
    return next(integrator for integrator, models in _groups(plan) if model in models)


def tolerance(plan: Plan) -> NDArray[np.float64]:
    """Largest solver error, relative, that the integrators of a plan are allowed, [model, 1]."""
    return np.array([[SOLVER_TOLERANCE[integrator_of(plan, model)]] for model in MODELS])


def _stacked(prepared: Prepared, names: tuple[str, ...]) -> tuple[StateSpace, NDArray, NDArray]:
    model = stack([prepared.side.models[name] for name in names])
    start = np.vstack([prepared.start[name] for name in names])
    return model, start, np.concatenate([prepared.size[name] for name in names])


def run_records(plan: Plan, prepared: Prepared, progress: SecondsProgress) -> tuple[NDArray, NDArray, dict[str, str]]:
    """Mean squares [model, series, record], all responses of the first record [model, series, m], and failures."""
    kept = prepared.track.samples // prepared.stride
    records = prepared.track.coefficients.shape[2]
    count = len(prepared.side.readout[MODELS[0]])
    squares = np.full((len(MODELS), count, records), np.nan)
    responses = np.full((len(MODELS), count, kept), np.nan)
    failures: dict[str, str] = {}
    waiting = _groups(plan)
    while waiting:
        integrator, names = waiting.pop(0)
        model, start, size = _stacked(prepared, names)
        rows = block_diag(*(prepared.side.readout[name] for name in names))
        feedthrough = np.vstack([prepared.side.feedthrough[name] for name in names])
        at = [MODELS.index(name) for name in names]
        total = np.zeros((len(rows), records))
        done = 0
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for block in integrate(
                    integrator, model, prepared.track, start, size, prepared.stride, prepared.accuracy, progress
                ):
                    y = rows @ block + feedthrough @ _kept_heights(prepared, done, len(block))
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


def _kept_heights(prepared: Prepared, first: int, count: int) -> NDArray[np.float64]:
    """Track heights at the kept samples of the period from the `first`: [count, wheels, records], m."""
    track, stride = prepared.track, prepared.stride
    return track.at_steps(track.before + first * stride, count * stride)[::stride]
