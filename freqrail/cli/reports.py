"""What the sweep's command reports: facts for `--json`, and the same as lines of text."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from freqrail.case.case import Case
from freqrail.cli.terminal import program
from freqrail.model.band import band_text
from freqrail.sweep import plausibility
from freqrail.sweep.plan import Plan, stored_bytes
from freqrail.sweep.sweep import Outcome
from freqrail.text import counted, number, shown_bytes

Report = tuple[dict[str, Any], list[str]]


def grid_text(plan: Plan) -> str:
    """The axes of a sweep in words, such as "speed 21 x bogie_mass 2"."""
    return " x ".join(f"{axis.name} {axis.values.size}" for axis in plan.layout.case.axes) or "a single point"


def dry_run(plan: Plan, target: Path, jobs: int, overwrite: bool) -> Report:
    """What a sweep would compute, its size and time. jobs: threads. overwrite: whether an existing file may go."""
    seconds = plan.seconds(jobs)
    facts = _facts(plan) | {"output": str(target), "bytes": stored_bytes(plan.layout), "seconds": seconds}
    lines = [
        f"{counted(plan.points, 'grid point')} ({grid_text(plan)}), {_models_text(plan)}",
        plausibility.vitals_text(plan.layout.case),
        f"{target}: {shown_bytes(stored_bytes(plan.layout))}, "
        f"computing about {number(seconds, 2)} s on {counted(jobs, 'thread')}",
        "dry run: nothing computed, nothing written",
    ]
    if target.exists() and not overwrite:
        lines.append(f"{target}: exists already; --overwrite replaces it")
    return facts, lines


def outcome(plan: Plan, done: Outcome, seconds: float, resumed: bool) -> Report:
    """What a sweep came to. seconds: of wall time. resumed: whether `--resume` was given."""
    error = done.largest_error
    warned = plausibility.recalled({"warnings": done.warnings})
    facts = _facts(plan) | {
        "output": str(done.path),
        "seconds": seconds,
        "largest_relative_error": error,
        "failures": list(done.failures),
        "warnings": warned,
    }
    accuracy = f"largest estimated error {error:.1e} (relative, numerical only)"
    if math.isnan(error):
        accuracy = "no number has an error estimate"
    taken_over = f", {counted(done.resumed, 'block')} taken over" if resumed else ""
    next_step = "show" if plan.points == 1 or math.isnan(error) else "plot"
    lines = [
        f"{counted(plan.points, 'grid point')} ({grid_text(plan)}), {counted(len(plan.layout.names), 'response')}, "
        f"{_models(plan.layout.case)}",
        plausibility.vitals_text(plan.layout.case),
        *filter(None, [plausibility.accepted_text(warned)]),
        f"band {band_text(plan.layout.case.band)}; {accuracy}",
        f"written: {done.path} ({shown_bytes(done.path.stat().st_size)}, {number(seconds, 2)} s{taken_over})",
        f"next: {program()} {next_step} {shlex.quote(str(done.path))}",
    ]
    return facts, lines


def again(given: Sequence[str]) -> str:
    """The command that goes on with an interrupted sweep. given: the arguments of the one that was."""
    return f"{program()} {shlex.join([*given, *(['--resume'] if '--resume' not in given else [])])}"


def _models_text(plan: Plan) -> str:
    count = len(plan.layout.models)
    return "both models" if count == 2 else counted(count, "model")


def _facts(plan: Plan) -> dict[str, Any]:
    case = plan.layout.case
    return {
        "case": case.name,
        "grid": grid_text(plan),
        "points": plan.points,
        "responses": list(plan.layout.names),
        "vehicle": plausibility.vitals(case),
    }


def _models(case: Case) -> str:
    """The models of a case in words: with joints and traditional, or a free vehicle and its variants."""
    names = ", ".join(variant.name for variant in case.variants)
    if case.is_half_vehicle:
        return f"with joints and {names}" if names else "with joints"
    return f"and {names} beside" if names else "no variants"
