"""Whether what a sweep of one point returns keeps its promises."""

from __future__ import annotations

import contextlib
import math
import signal
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mpmath import fabs, mp, mpf, sqrt

import freqrail
from tests.extremes import forty_digits
from tests.extremes.draws import Draw

SECONDS = 60  # of the processor that the computation of one draw may take
TOLERANCE = 1e-6  # largest estimate of a number that is given out
MODELS = {"": {}, "traditional_": {"primary_joint_stiffness": math.inf, "secondary_joint_stiffness": math.inf}}


@dataclass
class Found:
    """What became of a draw. values, missing: numbers given and withheld; kept: given at a point that is not ok."""

    violations: list[str] = field(default_factory=list)
    values: int = 0
    missing: int = 0
    kept: int = 0
    seconds: float = 0.0


def check(drawn: Draw) -> Found:
    """Sweep the point with freqrail, and hold every number of both models against forty digits."""
    found = Found()
    start = time.process_time()
    try:
        with _limit(SECONDS):
            result = _sweep(drawn)
    except Exception as fault:
        found.violations.append(f"{type(fault).__name__}: {fault}")
        return found
    found.seconds = time.process_time() - start
    for prefix, joints in MODELS.items():
        status = str(result[f"{prefix}status"].attrs["flag_meanings"]).split()[int(result[f"{prefix}status"])]
        true = forty_digits.mean_squares({**drawn.vehicle, **joints}, drawn.spectrum, drawn.speed, drawn.limits)
        for name, squares in true.items():
            values = np.atleast_1d(result[f"{prefix}{name}_rms"].values)
            errors = np.atleast_1d(result[f"{prefix}{name}_rms_relative_error"].values)
            for place, (value, error, square) in enumerate(zip(values, errors, squares, strict=True)):
                where = f"{prefix}{name}[{place}], status {status}"
                fault = _fault(float(value), float(error), square, status)
                if fault:
                    found.violations.append(f"{where}: {fault}")
                found.values += math.isfinite(value)
                found.missing += not math.isfinite(value)
                found.kept += math.isfinite(value) and status != "ok"
    return found


def _fault(value: float, error: float, square: mpf, status: str) -> str:
    if math.isnan(value):
        return "no number at a point that is ok" if status == "ok" else ""
    if not 0 <= error <= TOLERANCE:
        return f"{value!r} with the estimate {error!r}"
    if square == math.inf:
        return f"{value!r}, true inf"
    with mp.workdps(forty_digits.DIGITS):
        true = sqrt(square)
        off = float(fabs(mpf(value) / true - 1)) if true else math.inf
    return "" if off <= error else f"{value!r}, true {float(true)!r}: off by {off:.1e}, estimate {error:.1e}"


def _sweep(drawn: Draw):
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", freqrail.FreqrailWarning)
        path = Path(folder) / "extreme.toml"
        path.write_text(drawn.case(), encoding="utf-8")
        return freqrail.sweep(path, responses="all", jobs=1)


@contextlib.contextmanager
def _limit(seconds: int) -> Iterator[None]:
    """Raise TimeoutError inside after so many seconds of this process, where the system counts them."""
    if not hasattr(signal, "SIGPROF"):
        yield
        return

    def stop(*_: object) -> None:
        raise TimeoutError(f"took longer than {seconds} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
