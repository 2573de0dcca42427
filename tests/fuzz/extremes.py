"""Vehicles, tracks, speeds and bands from anywhere in the ranges of the table of names: all end with a status."""

from __future__ import annotations

import contextlib
import math
import signal
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator

import numpy as np

import freqrail
from freqrail.case.case import build_case
from freqrail.case.parameters import JOINTS, PARAMETERS
from freqrail.case.shipped import shipped_cases
from freqrail.cli.tables import case_derived, mode_records
from freqrail.errors import FreqrailError
from freqrail.model.responses import RESPONSES
from freqrail.solver.solution import STATUS, TOLERANCE

SECONDS = 60  # of processor time that one point may take, both models
SHIPPED = shipped_cases()["yu-damper-joint"]
VEHICLE = tuple(p.name for p in PARAMETERS.values() if p.section == "vehicle" and p.name != "contact_constant")


def value(rng: np.random.Generator, name: str) -> str:
    """A quantity inside its range, often at an end of it; a damping may be 0, a joint rigid."""
    parameter = PARAMETERS[name]
    low, high = parameter.plausible
    kind = rng.integers(10)
    if kind == 0 and parameter.infinite:
        return "inf"
    if kind == 0 and not parameter.above:
        return f"0 {parameter.unit}"
    number = low if kind == 1 else high if kind == 2 else math.exp(rng.uniform(math.log(low), math.log(high)))
    return f"{number:.12e} {parameter.unit}"


def drawn(rng: np.random.Generator) -> tuple[dict[str, str], dict[str, str]]:
    """Settings and axes of a single point: some of the vehicle's quantities or all, and perhaps speed, band, track."""
    over = {"speed": "250 km/h", **dict.fromkeys(JOINTS, "5 MN/m")}
    settings = {}
    count = len(VEHICLE) if rng.integers(3) == 0 else int(rng.integers(1, 4))
    for name in rng.choice(VEHICLE, count, replace=False):
        (over if name in JOINTS else settings)[str(name)] = value(rng, str(name))
    if rng.integers(2):
        over["speed"] = value(rng, "speed")
    band = str(rng.choice(["", "band", "frequency", "wavelength"]))
    if band == "band":
        settings["band"] = "none"
    elif band:
        settings[band] = ", ".join(
            sorted((value(rng, band) for _ in range(2)), key=lambda text: float(text.split()[0]))
        )
    if rng.integers(3) == 0:
        settings |= {"spectrum": "rational", "roughness": value(rng, "roughness")}
        settings["cutoffs"] = f"{value(rng, 'cutoffs')}, {value(rng, 'cutoffs')}"
    return settings, over


def fuzz(count: int, seed: int) -> tuple[Counter[str], list[str]]:
    """({outcome: how many}, faults) of `count` points."""
    outcomes: Counter[str] = Counter()
    faults = []
    with warnings.catch_warnings(), limited():
        warnings.simplefilter("ignore")
        for number in range(count):
            settings, over = drawn(np.random.default_rng((seed, number)))
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            try:
                outcomes[one(settings, over)] += 1
            except Exception as fault:
                outcomes["fault"] += 1
                last = traceback.extract_tb(fault.__traceback__)[-1]
                what = f"{type(fault).__name__}: {fault} (line {last.lineno} of {last.name})"
                faults.append(f"point {number}: {what}\n  settings {settings}\n  over {over}")
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
    return outcomes, faults


@contextlib.contextmanager
def limited() -> Iterator[None]:
    def too_long(*_: object) -> None:
        raise TimeoutError(f"took longer than {SECONDS} s")

    before = signal.signal(signal.SIGPROF, too_long)
    try:
        yield
    finally:
        signal.signal(signal.SIGPROF, before)


def one(settings: dict[str, str], over: dict[str, str]) -> str:
    """The outcome of one point; raises for a fault. Refused are wheelbases beyond the spacing, bands of no width."""
    try:
        case = build_case(SHIPPED, settings, over, file="F")
    except FreqrailError as refusal:
        for problem in refusal.problems:
            assert "half_bogie_spacing: must exceed" in problem or "lower limit must be below" in problem, problem
        return "refused"
    case_derived(case)
    with contextlib.suppress(FreqrailError):  # numbers too far apart for double precision
        mode_records(case)
    result = freqrail.sweep(case, responses="all")
    for prefix in ("", "traditional_"):
        status = int(result[f"{prefix}status"].values.item())
        finite = []
        for response in RESPONSES:
            name = f"{prefix}{response}_rms"
            has, error = np.isfinite(result[name].values), result[f"{name}_relative_error"].values
            assert np.all(error[has] <= TOLERANCE), f"{name}: a number without a promise"
            assert not np.any(result[name].values < 0), f"{name}: below 0"
            finite.append(has.all())
        # the status is the gravest of the values': ok if, and only if, none is missing
        assert all(finite) == (status == 0), f"{prefix}status {status}: {finite}"
    return STATUS[int(result.status.values.item())]
