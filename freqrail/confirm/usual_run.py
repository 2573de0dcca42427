"""A time run as it is usually made, to show what it reports: docs/confirming.md, "The trap". It confirms nothing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from freqrail.confirm.integrators import Accuracy
from freqrail.confirm.setup import SAMPLES_A_PERIOD, Setup
from freqrail.confirm.simulation import Prepared, run_records
from freqrail.confirm.time_side import OperatingPoint, TimeSide, line_power, time_side
from freqrail.confirm.track_record import fixed_amplitudes, mean_square, refined, sampled_track, spectral_lines, stream
from freqrail.model.responses import PAPER

DEFAULT_TOLERANCES = Accuracy(relative=1e-3, absolute=1e-6)
"""What most programs integrate with unless told otherwise; `absolute` is not scaled by the states here."""


def plain_run(
    point: OperatingPoint,
    limits: tuple[float, float],
    duration: float,
    step: float,
    interpolation: str = "linear",
    integrator: str = "rk45",
    accuracy: Accuracy = DEFAULT_TOLERANCES,
    ramp: float = 0.0,
    seed: int = 0,
    side: TimeSide | None = None,
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
        track = refined(track, math.ceil(track.step * SAMPLES_A_PERIOD[0] * limits[1]))
    start = {name: np.zeros((len(model.a), 1)) for name, model in side.models.items()}
    size = {name: np.ones(len(model.a)) for name, model in side.models.items()}
    _, responses, _ = run_records(
        Setup(limits, integrator=integrator), Prepared(track, 1, accuracy, side, start, size), lambda seconds: None
    )
    power = line_power(point, PAPER, lines.frequency)
    return track.step * np.arange(track.samples), responses, np.sqrt(mean_square(power, record))[..., 0]
