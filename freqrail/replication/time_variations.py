"""Why the paper may differ, in time: its claims judged over RMS values that a run of 20 s from rest reports.

Every variation runs the stiffnesses of the paper's two scans and the softest and stiffest pair over a choice of speeds;
it is compared with the exact result at the same points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.case import Case
from freqrail.case.parameters import JOINTS
from freqrail.model.band import Band, band_limits
from freqrail.model.responses import PAPER, RESPONSES, series_count
from freqrail.replication.claims import BOGIE, CAR, RESPONSE_NAMES, judge_all
from freqrail.replication.judging import OTHER_JOINT, Finding
from freqrail.replication.procedures import DURATION, Procedure, run
from freqrail.replication.studies import TABLE_I
from freqrail.replication.variations import Variation, relabelled
from freqrail.types import SecondsProgress

SPEEDS = (100.0, 120.0, 150.0, 180.0, 200.0, 220.0, 250.0, 280.0, 300.0)  # km/h
NAIVE_RECORDS = 2  # tracks of the slow run that has every habit at once
RECORDS = 8  # tracks that an exact run is repeated on, to tell a procedure from its luck


@dataclass(frozen=True)
class Trial:
    """A procedure and what it is called in the report; `joint_from` takes the joint model's runs of another trial."""

    name: str
    procedure: Procedure
    joint_from: str = ""


_REST = "20 s from rest, smooth track, exact integration"
_SET_DOWN = (
    "20 s from rest, set down on uneven track, linear interpolation, Runge-Kutta for joints, "
    "Newmark for the traditional model"
)
_RUNGE = "20 s from rest, linear interpolation, Runge-Kutta with default tolerances"

TRIALS: tuple[tuple[str, Trial], ...] = (
    ("run from rest", Trial(_REST, Procedure(records=RECORDS))),
    (
        "run from rest",
        Trial("20 s from rest, set down on uneven track, exact integration", Procedure(start="jump", records=RECORDS)),
    ),
    (
        "run from rest",
        Trial(
            "20 s from rest, each vehicle on a track of its own, exact integration",
            Procedure(own_track=True, records=RECORDS),
        ),
    ),
    (
        "interpolation",
        Trial(
            "20 s from rest, track linear over 1 ms, exact integration",
            Procedure(interpolation="linear", records=RECORDS),
        ),
    ),
    (
        "integrator",
        Trial("20 s from rest, smooth track, Runge-Kutta with default tolerances", Procedure("rk45", "rk45")),
    ),
    ("integrator", Trial(_RUNGE, Procedure("rk45", "rk45", "linear"))),
    (
        "two integrators",
        Trial(
            "20 s from rest, smooth track, exact for joints, Newmark at 1 ms for the traditional model",
            Procedure(traditional="newmark"),
            _REST,
        ),
    ),
    (
        "two integrators",
        Trial(
            "20 s from rest, linear interpolation, Runge-Kutta for joints, Newmark for the traditional model",
            Procedure(traditional="newmark", interpolation="linear"),
            _RUNGE,
        ),
    ),
    (
        "every habit at once",
        Trial(_SET_DOWN, Procedure("rk45", "newmark", "linear", "jump", records=NAIVE_RECORDS)),
    ),
)
"""(question, trial) in the report's order."""


def in_time(exact: xr.Dataset, case: Case, progress: SecondsProgress = lambda seconds: None) -> list[Variation]:
    """The variations in time. progress: called with the simulated seconds just done, of `simulated_seconds` in all."""
    exact = exact.sel(speed=list(SPEEDS))
    pairs = _pairs(*(exact[name].values.tolist() for name in JOINTS))
    vehicles = [case.vehicles().at(pair) for pair in pairs]
    values: dict[str, NDArray[np.float64]] = {}
    found = []
    for group, trial in TRIALS:
        joint = values.get(trial.joint_from)
        some = [*([] if trial.joint_from else vehicles), case.vehicle.traditional()]
        limits = band_limits(case.band or Band("frequency", 0.1, 100.0), case.speed) / (2 * np.pi)
        fresh = run(
            trial.procedure,
            some,
            case.spectrum,
            np.array(SPEEDS) / 3.6,
            (float(limits[0]), float(limits[1])),
            progress=progress,
        )
        if joint is None:
            joint = values[trial.name] = fresh[:-1]
        found.append(_variation(group, trial.name, exact, pairs, joint, fresh[-1]))
    return found


def simulated_seconds() -> float:
    """Seconds that `in_time` simulates."""
    vehicles = len(_pairs(TABLE_I, TABLE_I)) + 1  # the traditional one
    runs = sum((1 if trial.joint_from else vehicles) * trial.procedure.records for _, trial in TRIALS)
    return DURATION * len(SPEEDS) * runs


def _pairs(primary: Sequence[float], secondary: Sequence[float]) -> list[tuple[int, int]]:
    """Places on the joints' axes of both scans, and of the softest and the stiffest pair."""
    kept = [list(axis).index(OTHER_JOINT) for axis in (primary, secondary)]
    scans = {(i, kept[1]) for i in range(len(primary))} | {(kept[0], j) for j in range(len(secondary))}
    return sorted(scans | {(0, 0), (len(primary) - 1, len(secondary) - 1)})


def _variation(
    group: str,
    name: str,
    exact: xr.Dataset,
    pairs: Sequence[tuple[int, int]],
    joint: NDArray[np.float64],
    rigid: NDArray[np.float64],
) -> Variation:
    """joint: [pairs, series, speeds, records]; rigid: [series, speeds, records]."""
    records = min(joint.shape[-1], rigid.shape[-1])
    judged: list[Mapping[str, Finding]] = []
    first = None
    for record in range(records):
        grid = np.full((*(exact.sizes[key] for key in JOINTS), series_count(PAPER), len(SPEEDS)), np.nan)
        for pair, values in zip(pairs, joint[..., record], strict=True):
            grid[pair] = values
        varied = relabelled(exact, grid, rigid[..., record])
        first = varied if first is None else first
        judged.append(judge_all({"grid": varied}))
    assert first is not None
    same_points = exact.copy()
    ratios = []
    for response in (CAR, BOGIE):
        words = []
        for key in (f"{response}_rms", f"traditional_{response}_rms"):
            ratio = first[key] / exact[key]
            words.append(f"{float(ratio.min()):.2f} to {float(ratio.max()):.2f}")
        ratios.append(f"{RESPONSES[response].long_name} {words[0]} with joints, {words[1]} without")
    for response in RESPONSE_NAMES:
        known = first[f"{response}_rms"].notnull().transpose(*exact[f"{response}_rms"].dims)
        same_points[f"{response}_rms"] = exact[f"{response}_rms"].where(known)
    note = f"RMS over the exact one: {'; '.join(ratios)}"
    if records > 1:
        note += f" (first of {records} tracks)"
    return Variation(group, name, judged, judge_all({"grid": same_points}), note)
