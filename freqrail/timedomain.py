"""Grid points in the time domain: what a simulation says of the numbers that came from frequency responses.

Two verdicts, never mixed:

- solver: one period of the simulated response against the line spectrum of the same record. Only the
  integrator's error is left, so that the tolerance is tight; it finds a fault in the equations, the lags or the
  integration, whatever the track's spectrum.
- statistical: Gaussian records against the RMS over the continuous spectrum (`freqrail.verdicts`). It finds a wrong
  use of the spectrum or the band, and a wrong quadrature, too.

The frequency side (`response.track_response`) and the time side (`vehicle.state_space`) share what both are told, the
vehicle's numbers, the lags of eq. (2) and S_v of eq. (11), and nothing else; a fault put into a `Simulated` is on the
time side only.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.linalg import block_diag

from freqrail.errors import InputError, NumericalError
from freqrail.integrators import Accuracy, Progress, integrate, solver_of, stack
from freqrail.realisation import (
    Lines,
    Track,
    fixed_amplitudes,
    gaussian_amplitudes,
    mean_square,
    refined,
    sampled_track,
    spectral_lines,
    stream,
)
from freqrail.response import SERIES, chain_responses, track_response, wheel_lags
from freqrail.track import Spectrum
from freqrail.vehicle import DEGREES_OF_FREEDOM, StateSpace, System, Vehicle, half_vehicle, poles, state_space
from freqrail.verdicts import degrees_of_freedom

RESPONSES = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke")
"""The responses that are confirmed: the paper's four, eleven series in all."""

SERIES_COUNT = sum(len(SERIES[name].positions) for name in RESPONSES)

MODELS = ("joint", "traditional")

SOLVER_TOLERANCE = {"rk45": 2e-5, "exponential": 2e-5, "radau": 2e-5, "newmark": 1e-3}
"""Largest solver error, relative, that an integrator is allowed."""

FORGOTTEN = 1e-5  # what is left of the start's transient when the measured period begins
RESOLVED = 1e-3  # a mode in the band must decay by this within a record, or the lines step over its peak
RAMP = 4.0  # s, over which the track rises at the start
NEAR = 40.0 / RAMP  # Hz beyond the band's end where the ramp's own spectrum still strikes a mode
SAMPLES_A_PERIOD = 10  # of the track, at the highest line
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


@dataclass(frozen=True)
class Plan:
    """How a point is simulated.

    limits: the band, Hz. period: length of a record, s. realisations: Gaussian records, beside one of fixed
    amplitudes. integrator: of `integrators.INTEGRATORS`. start: "rest" or "steady". seed: see `realisation.stream`.
    accuracy: None for the defaults. interpolation: of the track between samples, "cubic" (or, to show what
    it does, "linear").
    """

    limits: tuple[float, float]
    period: float = 60.0
    realisations: int = 8
    integrator: str = "rk45"
    start: str = "rest"
    seed: int = 0
    accuracy: Accuracy = field(default_factory=lambda: Accuracy(substeps=NEWMARK_SUBSTEPS))
    interpolation: str = "cubic"
    samples_a_period: int = SAMPLES_A_PERIOD

    def tighter(self) -> Plan:
        """The same ten times tighter: tolerances; the steps of a method of second order; else the track's samples."""
        accuracy = replace(
            self.accuracy,
            relative=self.accuracy.relative / 10,
            absolute=self.accuracy.absolute / 10,
            substeps=math.ceil(self.accuracy.substeps * math.sqrt(10)),
        )
        finer = 2 if self.integrator == "exponential" else 1
        return replace(self, accuracy=accuracy, samples_a_period=self.samples_a_period * finer)


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

    readout: [series, states] a model. lags: [wheels], s.
    """

    models: dict[str, StateSpace]
    readout: dict[str, NDArray[np.float64]]
    lags: NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """What was found at a point. Numbers in SI units, NaN where a run failed; series in the order of `series_labels`.

    line_spectrum, simulated: RMS of every record, [model, series, record], the record of fixed amplitudes first.
    pooled: RMS of all Gaussian records together, [model, series]; degrees: its degrees of freedom.
    frequency [n], psd, psd_simulated [model, series, n]: one-sided PSD per Hz at a choice of lines, from the frequency
    responses and from the simulated record of fixed amplitudes. time [m], s; heights [wheels, m]; histories
    [model, series, m]: the beginning of that record. startup: s. tighter_change: largest relative change of an RMS
    of the first record ten times tighter; NaN if that was not asked for. failures: what went wrong, by model.
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
    startup: float
    tighter_change: float
    failures: dict[str, str]

    @property
    def solver_error(self) -> NDArray[np.float64]:
        """Largest relative difference of a record's simulated RMS from its line spectrum's: [model, series]."""
        return np.max(np.abs(self.simulated / self.line_spectrum - 1), axis=-1)


# --- the two sides ---------------------------------------------------------------------------------


def readout(system: System, model: StateSpace, vehicle: Vehicle) -> NDArray[np.float64]:
    """[series, states] that reads the eleven series off the states of a half vehicle (signs as in `vehicle`)."""
    n, states = len(system.freedoms), len(model.states)
    place = {name: DEGREES_OF_FREEDOM.index(name) for name in DEGREES_OF_FREEDOM}
    acceleration = np.zeros((5, n))
    for row, sign in enumerate((-1, 0, 1)):  # over the front pivot, at the centre, over the rear pivot
        acceleration[row, place["z_c"]] = 1
        acceleration[row, place["beta_c"]] = sign * vehicle.half_bogie_spacing
    acceleration[3, place["z_t1"]] = acceleration[4, place["z_t2"]] = 1
    elongation = np.zeros((len(system.legs), states))
    elongation[:, states - n :] = [leg.elongation for leg in system.legs]
    # none of these bodies stands on the rail: their accelerations are read off the states alone
    return np.vstack([acceleration @ model.a[:n], elongation])


def time_side(point: Point) -> Simulated:
    """The simulated side of a point, without any fault."""
    models, rows = {}, {}
    for name, vehicle in zip(MODELS, (point.vehicle, point.vehicle.traditional()), strict=True):
        system = half_vehicle(vehicle)
        models[name] = state_space(system)
        rows[name] = readout(system, models[name], vehicle)
    return Simulated(models, rows, wheel_lags(point.vehicle, point.speed))


def transfer_power(point: Point, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """|T|^2 of the eleven series of both models at `frequency` [K] in Hz: [model, series, K], from the FRFs."""
    omega = 2 * np.pi * frequency
    power = []
    for vehicle in (point.vehicle, point.vehicle.traditional()):
        chains = chain_responses(vehicle, omega)
        rows = [track_response(SERIES[name], vehicle, omega, point.speed, chains) for name in RESPONSES]
        power.append(np.square(np.abs(np.concatenate(rows))))
    return np.array(power)


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
    both = np.concatenate([poles(v) for v in (point.vehicle, point.vehicle.traditional())])
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
    samples = (plan.period + startup(point, plan)) * plan.limits[1] * plan.samples_a_period
    needed = 8 * samples * (6 * min(plan.realisations + 1, BATCH) + 2 * SERIES_COUNT)
    needed += 16 * plan.limits[1] * plan.period * (plan.realisations + 1)
    if needed > MOST_MEMORY:
        raise InputError(
            f"{plan.realisations} records of {plan.period:g} s take {needed / 1e9:.3g} GB of memory, more than "
            f"{MOST_MEMORY / 1e9:g} GB; give a smaller --duration or fewer --realisations"
        )


def seconds(point: Point, plan: Plan) -> float:
    """Estimated wall time of `examine`, s, from running the first moments of it in the steady state."""
    trial = replace(plan, start="steady", period=min(plan.period, TRIAL_PERIOD))
    side, told = time_side(point), accuracy(point, plan)
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
    progress: Progress = lambda seconds: None,
) -> Evidence:
    """Simulate a point and hold it against the frequency responses.

    side: what is simulated; the point itself unless given. tighter: repeat the first record ten times tighter.
    progress: called with the simulated seconds just done, of `simulated_seconds` in all. A run that fails leaves NaN
    and its reason in `failures`. Raises InputError as `check_plan` does.
    """
    check_plan(point, plan)
    side = side or time_side(point)
    lines = spectral_lines(point.spectrum, point.speed, plan.limits, plan.period)
    records = amplitudes(point, plan)
    power = transfer_power(point, lines.frequency)
    squares = np.full((len(MODELS), SERIES_COUNT, len(records)), np.nan)
    failures: dict[str, str] = {}
    first = None
    for begin in range(0, len(records), BATCH):
        batch = slice(begin, begin + BATCH)
        prepared = _prepare(point, plan, side, records[batch])
        squares[..., batch], responses, faults = _run(plan, prepared, progress)
        failures |= faults
        first = first or (prepared, responses)
    assert first is not None
    prepared, responses = first
    change = math.nan
    if tighter:
        finer = plan.tighter()
        again, _, faults = _run(finer, _prepare(point, finer, side, records[:1]), progress)
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
        heights=prepared.track.at_steps(prepared.track.before, shown * prepared.stride)[:: prepared.stride, :, 0].T,
        histories=responses[..., :shown],
        startup=prepared.track.startup,
        tighter_change=change,
        failures=failures,
    )


DEFAULT_TOLERANCES = Accuracy(relative=1e-3, absolute=1e-6)
"""What most programs integrate with unless told otherwise; `absolute` is not scaled by the states here."""


def plain_run(
    point: Point,
    limits: tuple[float, float],
    duration: float,
    step: float,
    interpolation: str = "linear",
    integrator: str = "rk45",
    accuracy: Accuracy = DEFAULT_TOLERANCES,
    ramp: float = 0.0,
    seed: int = 0,
    side: Simulated | None = None,
) -> tuple[NDArray, NDArray, NDArray]:
    """A run as it is usually made: from rest, the track switched on at once, nothing discarded, no step limit.

    limits: of the lines, Hz. duration: s, also the lines' period. step: s between the track's samples; with straight
    lines between them, responses are kept more often, so that what the kinks excite is not mistaken for something
    else. ramp: s over which the track rises smoothly instead. Returns (times
    [m], responses [model, series, m], RMS of the same record's line spectrum [model, series]); NaN where a run failed.
    For studies of what such a run reports; `examine` is what confirms.
    """
    side = side or time_side(point)
    lines = spectral_lines(point.spectrum, point.speed, limits, duration)
    record = fixed_amplitudes(lines, stream(seed, point.key, "plain run", 0))[None]
    track = sampled_track(lines, record, side.lags, round(duration / step), 0, ramp, interpolation)
    if interpolation == "linear":
        track = refined(track, math.ceil(track.step * SAMPLES_A_PERIOD * limits[1]))
    start = {name: np.zeros((len(model.a), 1)) for name, model in side.models.items()}
    size = {name: np.ones(len(model.a)) for name, model in side.models.items()}
    _, responses, _ = _run(
        Plan(limits, integrator=integrator), _Prepared(track, 1, accuracy, side, start, size), _quiet
    )
    power = transfer_power(point, lines.frequency)
    return track.step * np.arange(track.samples), responses, np.sqrt(mean_square(power, record))[..., 0]


def _quiet(seconds: float) -> None:
    """Progress that nobody watches."""


def simulated_seconds(point: Point, plan: Plan, tighter: bool = False) -> float:
    """Seconds that `examine` simulates, a state of many columns counted once."""
    once = startup(point, plan) + plan.period
    return once * len(_groups(plan)) * (-(-(plan.realisations + 1) // BATCH) + tighter)


@dataclass(frozen=True)
class _Prepared:
    """A batch of records ready to run: the track, and by model its state space, start, size and readout."""

    track: Track
    stride: int
    accuracy: Accuracy
    side: Simulated
    start: dict[str, NDArray[np.float64]]
    size: dict[str, NDArray[np.float64]]


def _prepare(point: Point, plan: Plan, side: Simulated, records: NDArray[np.complex128]) -> _Prepared:
    lines = spectral_lines(point.spectrum, point.speed, plan.limits, plan.period)
    samples = _samples(side, plan, lines)
    before = math.ceil(startup(point, plan) * samples / plan.period)
    ramp = 0.0 if plan.start == "steady" else RAMP
    track = sampled_track(lines, records, side.lags, samples, before, ramp, plan.interpolation)
    start, size = {}, {}
    for name, model in side.models.items():
        steady = _line_states(model, side.lags, lines)
        size[name] = np.sqrt(np.square(np.abs(steady)) @ np.square(lines.amplitude) / 2)
        start[name] = (steady @ records.T).real * (plan.start == "steady")
    return _Prepared(track, KEPT_EVERY, accuracy(point, plan), side, start, size)


def _samples(side: Simulated, plan: Plan, lines: Lines) -> int:
    """Samples of the track in a period: enough for the highest line, and for its images to clear every mode."""
    highest = float(lines.frequency[-1])
    modes = max(float(np.abs(np.linalg.eigvals(model.a).imag).max()) / (2 * np.pi) for model in side.models.values())
    # a line at f has images at rate -+ f; an undamped wheelset there would answer them
    rate = max(plan.samples_a_period * highest, highest + 2 * modes)
    samples = next_fast_len(math.ceil(rate * plan.period))
    while samples % KEPT_EVERY:
        samples = next_fast_len(samples + 1)
    return samples


def _line_states(model: StateSpace, lags: NDArray[np.float64], lines: Lines) -> NDArray[np.complex128]:
    """Steady states per metre of track at t = 0: X_k = (i omega_k - A)^-1 B exp(-i omega_k tau), [states, K]."""
    omega = 2 * np.pi * lines.frequency
    forcing = np.exp(-1j * np.multiply.outer(omega, lags)) @ model.b.T
    matrices = 1j * omega[:, None, None] * np.eye(len(model.a)) - model.a
    return np.asarray(np.linalg.solve(matrices, forcing[..., None])[..., 0].T, dtype=np.complex128)


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


def _stacked(prepared: _Prepared, names: tuple[str, ...]) -> tuple[StateSpace, NDArray, NDArray]:
    model = stack([prepared.side.models[name] for name in names])
    start = np.vstack([prepared.start[name] for name in names])
    return model, start, np.concatenate([prepared.size[name] for name in names])


def _run(plan: Plan, prepared: _Prepared, progress: Progress) -> tuple[NDArray, NDArray, dict[str, str]]:
    """Mean squares [model, series, record], all responses of the first record [model, series, m], and failures."""
    kept = prepared.track.samples // prepared.stride
    records = prepared.track.coefficients.shape[2]
    squares = np.full((len(MODELS), SERIES_COUNT, records), np.nan)
    responses = np.full((len(MODELS), SERIES_COUNT, kept), np.nan)
    failures: dict[str, str] = {}
    waiting = _groups(plan)
    while waiting:
        integrator, names = waiting.pop(0)
        model, start, size = _stacked(prepared, names)
        rows = block_diag(*(prepared.side.readout[name] for name in names))
        at = [MODELS.index(name) for name in names]
        total = np.zeros((len(rows), records))
        done = 0
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for block in integrate(
                    integrator, model, prepared.track, start, size, prepared.stride, prepared.accuracy, progress
                ):
                    y = rows @ block
                    total += np.square(y).sum(axis=0)
                    responses[at, :, done : done + len(y)] = y[..., 0].T.reshape(len(at), SERIES_COUNT, len(y))
                    done += len(y)
        except NumericalError as fault:
            responses[at] = np.nan
            if len(names) > 1:  # one model must not take the other's numbers with it
                waiting += [(integrator, (name,)) for name in names]
            else:
                failures[names[0]] = str(fault)
        else:
            squares[at] = (total / kept).reshape(len(at), SERIES_COUNT, records)
    return squares, responses, failures
