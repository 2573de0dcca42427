"""`freqrail replicate`: the paper's study in one call, written as a folder of datasets, figures and a report."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from freqrail.errors import FileError, InputError
from freqrail.replication import document, studies, time_variations, variations
from freqrail.replication.claims import judge_all
from freqrail.replication.figures import draw_all, pictures
from freqrail.replication.judging import VERDICTS, Finding
from freqrail.replication.mechanism import mechanism
from freqrail.replication.report import compose
from freqrail.replication.standing import standings
from freqrail.replication.variations import Variation
from freqrail.result import manifest
from freqrail.result.netcdf import write_result
from freqrail.types import Progress

FOLDER = Path("results", studies.CASE)
COMMAND = "replicate"

_DATASETS: dict[str, Callable[[], xr.Dataset]] = {
    "grid": studies.paper_grid,
    "map": studies.joint_map,
    "spectra": studies.spectra,
    "track": studies.histories,
    "dampers": studies.dampers,
}
SECONDS_A_STEP = 100.0  # simulated, that progress counts as one step
LEFT_OUT = "This run left out the variations in the time domain (--quick)."


@dataclass(frozen=True)
class Replication:
    """What was computed: datasets by name (see `studies`), findings by claim, variations; and the folder written."""

    datasets: dict[str, xr.Dataset]
    findings: dict[str, Finding]
    variations: list[Variation]
    folder: Path

    @property
    def counts(self) -> dict[str, int]:
        """How many claims come to each verdict."""
        verdicts = [found.verdict for found in self.findings.values()]
        return {verdict: verdicts.count(verdict) for verdict in VERDICTS}


def steps(quick: bool = False) -> int:
    """How many steps `replicate` tells its `progress` of."""
    simulated = 0 if quick else round(time_variations.simulated_seconds() / SECONDS_A_STEP)
    return len(_DATASETS) + 2 + variations.count_in_frequency() + simulated + len(pictures(dict.fromkeys(_DATASETS)))


def replicate(
    folder: str | os.PathLike[str] | None = None, quick: bool = False, progress: Progress = lambda steps: None
) -> Replication:
    """Recompute the paper's sections V and VI, judge its claims and write datasets, figures and report.

    folder: where to; results/yu-damper-joint below the working folder unless given, made with its parents then. It is
    replaced as a whole, and only when the new one is complete; a folder that holds anything that an earlier run did
    not write, or that was changed since (see `manifest`), is refused. quick: leave out the variations in the time
    domain. progress: called with the number of steps just done, of `steps`.

    Raises InputError for a folder that is not this command's own, FileError if it cannot be written.
    """
    target = _check(Path(folder) if folder is not None else FOLDER, default=folder is None)
    datasets = {}
    for name, make in _DATASETS.items():
        datasets[name] = make()
        progress(1)
    findings, standing = judge_all(datasets), standings(datasets)
    progress(1)
    case = studies.study_case()
    explanation = mechanism(datasets["grid"], case)
    progress(1)
    varied = variations.in_frequency(datasets["grid"], case, progress)
    if not quick:
        varied += time_variations.in_time(datasets["grid"], case, _whole_steps(progress))
    drawn = pictures(datasets)
    partial = _beside(target, "partial")
    try:
        partial.mkdir()
    except OSError as fault:
        raise FileError(f"{partial}: cannot be made: {fault.strerror}") from None
    try:
        for name, dataset in datasets.items():
            write_result(dataset, partial / f"{name}.nc")
        draw_all(drawn, partial, progress)
        blocks = compose(
            datasets, findings, standing, explanation, varied, drawn, case.vehicle, LEFT_OUT if quick else ""
        )
        (partial / "report.md").write_text(document.markdown(blocks), encoding="utf-8")
        (partial / "report.html").write_text(document.web_page(blocks, partial), encoding="utf-8")
        manifest.record(partial, COMMAND, {path.name: manifest.digest(path) for path in partial.iterdir()})
        _swap(partial, target)
    except OSError as fault:
        raise FileError(f"{target}: cannot be written: {fault.strerror or fault}") from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return Replication(datasets, findings, varied, target)


def _whole_steps(progress: Progress) -> Callable[[float], None]:
    """Turns simulated seconds into steps of `progress`."""
    simulated, told = 0.0, 0

    def advance(seconds: float) -> None:
        nonlocal simulated, told
        simulated += seconds
        steps = int(simulated / SECONDS_A_STEP)
        if steps > told:
            progress(steps - told)
            told = steps

    return advance


def _check(target: Path, default: bool) -> Path:
    """The target, after checking that it may be replaced: all that it holds is what an earlier run wrote."""
    if target.name in ("", ".."):
        raise InputError(f"{target}: is not a folder of its own; name another with -o")
    if default:
        target.parent.mkdir(exist_ok=True)
    if not target.parent.is_dir():
        raise FileError(f"{target.parent}: no such folder; make it, or name another with -o")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise FileError(f"{target.parent}: this folder cannot be written; name another with -o")
    if target.is_symlink() or (target.exists() and not target.is_dir()):
        raise InputError(f"{target}: is not a folder of its own; name another with -o")
    for beside in (_beside(target, "partial"), _beside(target, "old")):
        if os.path.lexists(beside):
            raise FileError(f"{beside}: is in the way, left by a run that was cut short or another's; remove it")
    manifest.owned(target, COMMAND)
    return target


def _beside(target: Path, kind: str) -> Path:
    """The folder in which the new results are made, or in which the old ones wait until the new stand."""
    return target.with_name(f".{target.name}.{kind}")


def _swap(new: Path, target: Path) -> None:
    """Put a complete folder in the target's place; of the old one goes what its manifest lists, and nothing else."""
    if not target.exists():
        new.rename(target)
        return
    old = _beside(target, "old")
    target.rename(old)
    try:
        listed = manifest.owned(old, COMMAND)  # once more: it took a while to compute
        new.rename(target)
    except BaseException:
        old.rename(target)
        raise
    for name in (*listed, manifest.NAME):
        (old / name).unlink(missing_ok=True)
    old.rmdir()
