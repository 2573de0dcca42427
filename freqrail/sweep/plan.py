"""What a sweep computes: the numerical problems of a case's models, their axes, and what they will take."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from freqrail.case.axis import Axis
from freqrail.case.case import Case
from freqrail.case.described import HALF
from freqrail.errors import InputError
from freqrail.model.band import band_limits
from freqrail.model.system import alike
from freqrail.result.layout import Layout, response_names
from freqrail.solver import solve
from freqrail.solver.problem import Problem, half_vehicle_problem, problem_of
from freqrail.sweep.gradients import parameter_names

PSD_POINTS = 400
PSD_RANGE = (0.01, 500.0)  # Hz, where no band is given
KEPT_A_SECOND = 50e6  # bytes of a result that are hashed, written twice and read back in a second (docs/scaling.md)
COPIES = 3  # how many times a result stands in memory at most, while it is labelled


@dataclass(frozen=True)
class Plan:
    """What a sweep computes and stores: its layout, and the numerical problems by model prefix."""

    layout: Layout
    problems: Mapping[str, Problem]

    @classmethod
    def of(cls, case: Case, responses: str | Sequence[str] = "paper", psd: bool = False) -> Plan:
        """The plan of a checked case. Raises InputError for an unknown response."""
        return cls.for_layout(planned_layout(case, responses, psd))

    @classmethod
    def for_layout(cls, layout: Layout) -> Plan:
        """The plan that fills a layout."""
        problems = {}
        for model in layout.models:
            case = layout.case.of(model)
            problems[model.prefix] = problem_of_case(case, layout.names)
        return cls(layout, problems)

    @property
    def points(self) -> int:
        """Number of grid points of the vehicle itself."""
        return math.prod(self.problems[""].shape)

    @property
    def work(self) -> int:
        """Grid points that `progress` is told of in all: all models, spectra counted again."""
        once = sum(math.prod(problem.shape) for problem in self.problems.values())
        return once * (2 if self.layout.frequency is not None else 1)

    def seconds(self, jobs: int) -> float:
        """Estimated wall time of the sweep into a file in s, from timing a first block of each model."""
        computing = sum(solve.seconds(problem, jobs) for problem in self.problems.values())
        return computing + stored_bytes(self.layout) / KEPT_A_SECOND


def problem_of_case(case: Case, names: tuple[str, ...]) -> Problem:
    """The grid of a case's vehicle as numbers, for some of its responses."""
    if case.described == HALF:
        return half_vehicle_problem(case.vehicles(), case.speeds(), case.spectrum, case.band, names)
    described = case.described
    outputs = tuple(output for output in described.readings.outputs if output.name in names)
    values = case.values()
    system = alike(described.system, values)
    return problem_of(system, outputs, values, case.speeds(), case.spectrum, case.band)


def planned_layout(
    case: Case,
    responses: str | Sequence[str] = "paper",
    psd: bool = False,
    gradients: str | Sequence[str] = (),
) -> Layout:
    """What a sweep of a checked case stores. Raises InputError for an unknown response or parameter."""
    frequency = (case.frequency or _default_frequency(case)) if psd else None
    wanted = parameter_names(case, gradients) if gradients else ()
    return Layout(case, response_names(responses, case.vocabulary), frequency, wanted)


def stored_bytes(layout: Layout) -> int:
    """Size of a result in bytes, told from its axes alone: a grid may be too large to be made."""
    series = layout.vocabulary.series_count(layout.names)
    lines = layout.frequency.si.size if layout.frequency is not None else 0
    points = sum(math.prod(axis.si.size for axis in layout.axes(model.prefix)) for model in layout.models)
    # the last: what HDF5 and attributes take
    return (
        points * (8 * series * (2 + lines + 2 * len(layout.gradients)) + 2)
        + 6_000 * len(layout.names)
        + 2 * len(layout.case.text)
        + 50_000
        + _stored_samples(layout)
    )


def _stored_samples(layout: Layout) -> int:
    """Bytes of the samples in the case that a result holds, and as coordinates."""
    samples = layout.case.samples
    return 0 if samples is None else len(layout.case.effective) + 8 * samples.numbers.size * len(samples.columns)


def check_memory(layout: Layout) -> None:
    """Raise InputError before anything is allocated that the machine's memory cannot hold."""
    needed = COPIES * stored_bytes(layout)
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else math.inf
    if needed > memory:
        raise InputError(
            f"the grid is too large for this machine: {needed / 1e9:.3g} GB needed, {memory / 1e9:.3g} GB of memory; "
            "use fewer values or responses, or leave out the spectra"
        )


def _default_frequency(case: Case) -> Axis:
    """Frequencies of stored spectra: log-spaced over the band, over all speeds' bands if by wavelength."""
    low, high = PSD_RANGE
    if case.band is not None:
        limits = band_limits(case.band, case.speeds()) / (2 * np.pi)
        low, high = float(limits.min()), float(limits.max())
    values = np.geomspace(low, high, PSD_POINTS)
    return Axis("frequency", values, "Hz", values, f"log:{low:g}:{high:g}:{PSD_POINTS} Hz")
