"""How a point is simulated: band, records, integrator, start, sampling; what of it can be known before the run."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.confirm.crosschecks import state_response
from freqrail.confirm.integrators import Accuracy
from freqrail.confirm.simulated import poles
from freqrail.confirm.time_side import OWN, OperatingPoint, TimeSide, time_side, vehicles
from freqrail.errors import InputError
from freqrail.model.responses import HALF_VEHICLE, PAPER, Vocabulary
from freqrail.model.spectrum import frequency_psd
from freqrail.model.variants import DEFAULT, TRADITIONAL

MODELS = (OWN, *(variant.name for variant in DEFAULT))
"""The models of a confirmation of the default variants."""


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


MOST_MEMORY = 4e9  # bytes of tracks and responses


HISTORY = 10.0  # s of the first record that are kept to be drawn


PSD_LINES = 600  # lines, at most, at which spectra are kept


GOOD_TRACK = (3.0, 25.0)  # m, the wavelengths by which track standards judge a track (EN 13848-1, range D1)


@dataclass(frozen=True)
class Setup:
    """How a point is simulated.

    limits: the band, Hz. period: length of a record, s. realisations: Gaussian records, beside one of fixed
    amplitudes. integrator: of `integrators.INTEGRATORS`. start: "rest" or "steady". seed: see `track_record.stream`.
    accuracy: None for the defaults. interpolation: of the track between samples, "cubic" (or, to show what
    it does, "linear"). names: of the responses. finer: times the track's samples that will do. models: as
    `time_side.vehicles` has them; rigid: those without states inside their legs, which newmark serves. vocabulary: of
    the names.
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
    models: tuple[str, ...] = MODELS
    rigid: tuple[str, ...] = (TRADITIONAL.name,)
    vocabulary: Vocabulary = HALF_VEHICLE

    @property
    def series(self) -> int:
        """How many series the responses are, one a position."""
        return self.vocabulary.series_count(self.names)

    def tighter(self) -> Setup:
        """The same ten times tighter: tolerances; the steps of a method of second order; else the track's samples."""
        accuracy = replace(
            self.accuracy,
            relative=self.accuracy.relative / 10,
            absolute=self.accuracy.absolute / 10,
            substeps=math.ceil(self.accuracy.substeps * math.sqrt(10)),
        )
        return replace(self, accuracy=accuracy, finer=2 if self.integrator == "exponential" else 1)


def slowest_decay(point: OperatingPoint, highest: float) -> float:
    """Decay rate, 1/s, of the slowest mode of any model that a band up to `highest` [Hz] strikes."""
    return float(np.min(-_struck(point, highest).real))


def accuracy(point: OperatingPoint, setup: Setup) -> Accuracy:
    """The setup's accuracy, tighter where a mode in the band is so little damped that rk45's own damping would show."""
    modes = _struck(point, setup.limits[1])
    least = float(np.min(-modes.real / np.abs(modes)))
    sharper = min(1.0, least / WELL_DAMPED)
    longest = min(setup.accuracy.longest_step, 1 / (STEPS_A_PERIOD * setup.limits[1]))
    return replace(
        setup.accuracy,
        relative=setup.accuracy.relative * sharper,
        absolute=setup.accuracy.absolute * sharper,
        longest_step=longest,
    )


def _struck(point: OperatingPoint, highest: float) -> NDArray[np.complex128]:
    """Poles of all models, rad/s, that a band up to `highest` [Hz] strikes."""
    both = np.concatenate([poles(vehicle) for vehicle in vehicles(point).values()])
    if not np.isfinite(both).all():
        raise InputError("the vehicle's numbers are too far apart for double precision: nothing to simulate")
    return both[np.abs(both.imag) <= 2 * np.pi * (highest + NEAR)]


def startup(point: OperatingPoint, setup: Setup) -> float:
    """Seconds from the start until the measured period: the ramp, then ln(1e5)/sigma of the slowest mode struck."""
    if setup.start == "steady":
        return 0.0
    return RAMP + math.log(1 / FORGOTTEN) / slowest_decay(point, setup.limits[1])


def check_setup(point: OperatingPoint, setup: Setup) -> None:
    """Raise InputError for a setup that cannot answer: records too short for a mode, or more than fits the memory."""
    decay = slowest_decay(point, setup.limits[1])
    if decay <= 0:
        raise InputError("a mode inside the band is undamped: it has no steady response to confirm")
    least = math.log(1 / RESOLVED) / decay
    if setup.period < least:
        raise InputError(
            f"records of {setup.period:g} s are too short: a mode inside the band decays at {decay:.3g} 1/s, and the "
            f'lines of a record must resolve its peak; give --duration "{math.ceil(least)} s" or more, or a --band '
            "without that mode"
        )
    samples = (setup.period + startup(point, setup)) * sampling_rate(point, setup, time_side(point, setup.names))
    needed = 8 * samples * (6 * min(setup.realisations + 1, BATCH) + 2 * setup.series)
    needed += 16 * setup.limits[1] * setup.period * (setup.realisations + 1)
    if needed > MOST_MEMORY:
        raise InputError(
            f"{setup.realisations} records of {setup.period:g} s take {needed / 1e9:.3g} GB of memory, more than "
            f"{MOST_MEMORY / 1e9:g} GB; give a smaller --duration or fewer --realisations"
        )


def track_ranges(point: OperatingPoint, setup: Setup) -> NDArray[np.float64]:
    """Limits, Hz, of the ranges in which a record's track is checked: GOOD_TRACK as far as the band reaches, the band.

    [range, 2]; an empty range is NaN.
    """
    shortest, longest = GOOD_TRACK
    low, high = max(setup.limits[0], point.speed / longest), min(setup.limits[1], point.speed / shortest)
    return np.array([[low, high] if low < high else [np.nan, np.nan], setup.limits])


def simulated_seconds(point: OperatingPoint, setup: Setup, tighter: bool = False) -> float:
    """Seconds that `examine` simulates, a state of many columns counted once."""
    once = startup(point, setup) + setup.period
    return once * len(groups(setup)) * (-(-(setup.realisations + 1) // BATCH) + tighter)


def sampling_rate(point: OperatingPoint, setup: Setup, side: TimeSide) -> float:
    """Samples of the track a second: enough for the highest line, and for its images to leave every RMS alone.

    They must clear every mode, for an undamped wheelset there would answer them, and add less than IMAGES to an RMS.
    """
    highest = setup.limits[1] + 0.5 / setup.period
    modes = max(float(np.abs(np.linalg.eigvals(model.a).imag).max()) / (2 * np.pi) for model in side.models.values())
    rates = dict.fromkeys(max(samples * highest, highest + 2 * modes) for samples in SAMPLES_A_PERIOD)
    rate = math.inf
    for rate in rates:  # each once: the modes may ask for more than the first ones give
        if setup.interpolation != "cubic" or image_bound(point, setup, side, rate) <= IMAGES:
            break
    return rate * setup.finer


def image_bound(point: OperatingPoint, setup: Setup, side: TimeSide, rate: float) -> float:
    """Upper bound of what the images of a cubic spline with `rate` samples a second add to any RMS, relative.

    A line at f has images at m rate -+ f, (f/(m rate -+ f))^4 of its height. The kept samples cannot tell the first of
    them from the line, so that they may add up in phase: sum |Y_k| |image_k|/sum |Y_k|^2.
    """
    lines = np.linspace(*setup.limits, IMAGE_LINES)
    density = frequency_psd(point.spectrum, lines, point.speed)
    images = [(image, (lines / image) ** 4) for m in (1, 2) for image in (m * rate - lines, m * rate + lines)]
    worst = 0.0
    for name, model in side.models.items():
        own, *others = (
            np.abs(
                state_response(
                    model, side.readout[name], side.feedthrough[name], side.lags, frequency, side.rates.get(name)
                )
            )
            for frequency in (lines, *(image for image, _ in images))
        )
        added = sum(other * height for other, (_, height) in zip(others, images, strict=True))
        worst = max(worst, float(np.max((own * added) @ density / (own**2 @ density))))
    return worst


def integrator_of(setup: Setup, model: str) -> str:
    """The integrator that runs a model."""
    return next(integrator for integrator, models in groups(setup) if model in models)


def tolerance(setup: Setup) -> NDArray[np.float64]:
    """Largest solver error, relative, that the integrators of a setup are allowed, [model, 1]."""
    return np.array([[SOLVER_TOLERANCE[integrator_of(setup, model)]] for model in setup.models])


BATCH = 16  # records that are columns of one state


def groups(setup: Setup) -> list[tuple[str, tuple[str, ...]]]:
    """(integrator, models that it runs together): newmark is for models without inner states, as traditional."""
    if setup.integrator == "newmark":
        jointed = tuple(model for model in setup.models if model not in setup.rigid)
        rigid = tuple(model for model in setup.models if model in setup.rigid)
        return [(integrator, models) for integrator, models in (("rk45", jointed), ("newmark", rigid)) if models]
    return [(setup.integrator, setup.models)]
