"""A whole sweep: in memory as a labelled dataset, or block by block into a file that survives interruptions."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.case import Case, load_case
from freqrail.errors import InputError
from freqrail.result import axes, labels, layout, netcdf, variants
from freqrail.solver import solve
from freqrail.sweep import parts, plausibility
from freqrail.sweep.journal import Journal
from freqrail.sweep.parts import Part
from freqrail.sweep.plan import Plan, check_memory, planned_layout
from freqrail.text import given
from freqrail.types import Progress
from freqrail.version import __version__

Executor = Callable[[Plan, Sequence[Part], Progress], Iterable[tuple[Part, Mapping[str, NDArray]]]]
"""Computes blocks, in any order, and yields each with its numbers as soon as it is done."""


def sweep(
    case: Case | str | os.PathLike[str],
    over: Mapping[str, str] | None = None,
    settings: Mapping[str, str] | None = None,
    responses: str | Sequence[str] = "paper",
    psd: bool = False,
    jobs: int | None = None,
    progress: Progress = lambda points: None,
    samples: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    gradients: str | Sequence[str] = (),
) -> xr.Dataset:
    """Response RMS values over the grid of a case, as a labelled dataset.

    case: a `Case`, the path of a case file or the name of a shipped case. over: {"NAME": "AXIS"}, such
    as {"speed": "100:300:10 km/h"}, replaces the case's axis or adds one. settings: {"NAME": "VALUE"} for
    scalars. responses: "paper" (the paper's four), "all", or names of `model.responses`. psd: store
    spectra too. jobs: threads that work on blocks, as many as processors unless given; they change no bit of the
    result. progress: called with the number of grid points just done. samples: parameters that vary together, along a
    dimension `sample`: the path of a CSV file, or a mapping such as {"bogie_mass [kg]": [600, 650]} or {"bogie_mass":
    ["600 kg", "0.65 t"]}; they replace the case's, and
    its axes of the same names. gradients: parameters by which slopes are stored, names or "all".

    Returns a dataset with `<response>_rms` [m/s^2, rad/s^2 or m] over (swept parameters..., position),
    `<response>_rms_relative_error`, `status` and `method` per grid point, the same of each variant with its
    prefix (`traditional_`) and without the axes that it fixes (the joints'), and with `psd` `<response>_psd`
    [unit^2/Hz], with `gradients` `<response>_rms_gradient` and `<response>_rms_gradient_error` over `parameter`
    [the response's unit over the parameter's SI unit].
    A value that could not be computed to 1e-6 is NaN, and the status of its point is not 0.

    Raises InputError for a bad case, axis, setting or response name. The RMS is the root of the integral
    over the band of |sum_i H_i e^{-i omega tau_i}|^2 S_v(omega/v)/v (eqs. 2 to 7 and 11).
    """
    if jobs is not None and (type(jobs) is not int or jobs < 1):
        raise InputError(f"jobs: must be a whole number, at least 1 {given(jobs)}")
    if not isinstance(case, Case):
        case = load_case(case, settings, over, samples=samples)
    elif over or settings or samples is not None:
        raise InputError("over, settings and samples go with the path or name of a case: a Case is checked already")
    wanted = planned_layout(case, responses, psd, gradients)
    check_memory(wanted)
    plan = Plan.for_layout(wanted)
    warned = plausibility.stored(plausibility.warn(case), case)
    return compute(plan, jobs, progress).assign_attrs({"warnings": warned} if warned else {})


def compute(plan: Plan, jobs: int | None = None, progress: Progress = lambda points: None) -> xr.Dataset:
    """The labelled dataset of a plan, in memory; see `sweep`, which warns besides."""
    values = {name: np.empty(v.shape, v.dtype) for name, v in layout.variables(plan.layout).items()}
    for block, part in local(jobs)(plan, parts.cut(plan), progress):
        for name, numbers in part.items():
            values[name][block.place] = numbers
    return labels.label(plan.layout, values)


@dataclass(frozen=True)
class Outcome:
    """What a sweep into a file came to. largest_error: NaN if no number has an error estimate.

    warnings: the attribute `warnings` of its file, see `plausibility.stored`.
    """

    path: Path
    largest_error: float
    failures: tuple[str, ...]
    resumed: int
    warnings: str


def sweep_to_file(
    plan: Plan,
    path: str | os.PathLike[str],
    overwrite: bool = False,
    resume: bool = False,
    executor: Executor | None = None,
    progress: Progress = lambda points: None,
) -> Outcome:
    """Compute a sweep block by block and write it as NetCDF, in bounded memory.

    Finished blocks are kept in a journal beside the target until the file is complete; with `resume` those of an
    earlier, interrupted run of the same sweep are taken over. executor: computes the blocks, `local` unless given.

    Raises InputError if the file exists and `overwrite` is not set, or if the journal is of another sweep or damaged;
    FileError if another run is writing the same file, or the disk is full (the journal is kept).
    """
    target = netcdf.check_target(path, overwrite)
    warned = plausibility.stored(plausibility.warn(plan.layout.case), plan.layout.case)
    skeleton = labels.skeleton(plan.layout).assign_attrs({"warnings": warned} if warned else {})
    everything = parts.cut(plan)
    with netcdf.lock(target), Journal.open(target, _identity(plan, everything), resume) as journal:
        todo = [block for block in everything if block.key not in journal.keys]
        for block in everything:
            if block.key in journal.keys:
                progress(parts.point_count(plan, block))
        for block, values in (executor or local())(plan, todo, progress):
            journal.keep(block.key, parts.pack(plan, block, values))
        largest = [np.nan]
        described = layout.variables(plan.layout)
        status = {name: np.zeros(v.shape, v.dtype) for name, v in described.items() if name.endswith("status")}

        def stored() -> Iterator[tuple[tuple[slice, ...], Mapping[str, NDArray]]]:
            for block in everything:
                values = parts.unpack(plan, block, journal.read(block.key))
                largest.extend(_largest(values))
                for name in status.keys() & values.keys():
                    status[name][block.place] = values[name]
                yield block.place, values

        netcdf.write_parts(target, skeleton, described, stored())
        journal.discard()
    labelled = skeleton.assign(
        {name: (described[name].dims, values, described[name].attributes) for name, values in status.items()}
    )
    failures = tuple(axes.first_failures(labelled))
    return Outcome(target, float(np.fmax.reduce(largest)), failures, len(everything) - len(todo), warned)


def local(jobs: int | None = None) -> Executor:
    """Blocks one after the other in this process, each on `jobs` threads (as many as processors unless given)."""

    def run(plan: Plan, todo: Sequence[Part], progress: Progress) -> Iterator[tuple[Part, Mapping[str, NDArray]]]:
        shared = parts.panels_of(plan) if todo else {}
        for block in todo:
            yield block, parts.compute(plan, block, shared, jobs or solve.processors(), progress)

    return run


def _largest(values: Mapping[str, NDArray]) -> list[float]:
    return [float(np.fmax.reduce(v, axis=None)) for name, v in values.items() if name.endswith("_relative_error")]


def _identity(plan: Plan, everything: Sequence[Part]) -> str:
    """SHA-256 of all that decides the bits of the blocks: a journal with another one is of another sweep."""
    facts = [
        plan.layout.case.effective,
        variants.stored_all(plan.layout.case.variants),
        plan.layout.names,
        plan.layout.gradients,
        plan.layout.frequency.si.tolist() if plan.layout.frequency is not None else None,
        [block.key for block in everything],
        [__version__, np.__version__],
    ]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()
