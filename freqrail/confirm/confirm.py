"""Confirmations: grid points of a result held against simulations in the time domain, as one labelled dataset."""

from __future__ import annotations

import os
import warnings

import xarray as xr

from freqrail.confirm import processes, simulation, time_side
from freqrail.confirm.labels import label
from freqrail.confirm.references import references
from freqrail.confirm.run import GivenPoints, Run, check_cost, prepare_run
from freqrail.confirm.setup import Setup
from freqrail.confirm.simulation import Simulation
from freqrail.errors import FreqrailWarning
from freqrail.result.confirmation import power_warnings
from freqrail.types import Progress, SecondsProgress


def confirm(
    result: xr.Dataset | str | os.PathLike[str],
    at: GivenPoints | None = None,
    seed: int = 0,
    realisations: int = 8,
    duration: str = "60 s",
    integrator: str = "rk45",
    start: str = "rest",
    band: str | None = None,
    max_time: str = "10 min",
    jobs: int = 1,
    progress: Progress = lambda seconds: None,
) -> xr.Dataset:
    """Simulate grid points of a result in time and judge its numbers by them.

    result: a dataset of `sweep` or the path of one. at: a point or several, as "speed=250 km/h,
    primary_joint_stiffness=5 MN/m"; the case's [confirm] points unless given. seed: of the random streams, which are
    keyed by the points' values. realisations: Gaussian records a point, beside one of fixed amplitudes. duration: of
    each record. integrator: "rk45", "exponential", "newmark" (for the traditional model, rk45 for the other, as in the
    paper) or "radau". start: "rest" or "steady". band: such as "0.1:100 Hz"; the result's own unless given, 0.1 to
    100 Hz if that is the whole axis. max_time: refuse a run estimated to take longer. jobs: processes, a point each
    (in a script, call this under `if __name__ == "__main__":` then). progress: called with whole simulated seconds.

    Returns a dataset over (point, model, position, record): `<response>_rms_frequency_domain`, `_line_spectrum`,
    `_time_domain`, `_interval_low`, `_interval_high` [m/s^2 or m], and over (point, model, series) `solver_error`,
    `verdict_solver`, `verdict_statistical`; beside them time histories, spectra and the conditions as attributes. A
    run that fails leaves NaN and the verdict "failed".

    Raises InputError for a point off the grid or a bad option; NumericalError if the run would take longer than
    `max_time`.
    """
    run = prepare_run(result, at, seed, realisations, duration, integrator, start, band)
    check_cost(run, max_time, jobs)
    return carry_out(run, jobs, progress)


def carry_out(run: Run, jobs: int = 1, progress: Progress = lambda seconds: None) -> xr.Dataset:
    """Simulate and judge the points of a setup; see `confirm`."""
    simulated, said = 0.0, 0

    def whole_seconds(seconds: float) -> None:
        nonlocal simulated, said
        simulated += seconds
        if simulated - said >= 1:
            progress(int(simulated) - said)
            said = int(simulated)

    tasks = [(point, setup, not place) for place, (point, setup) in enumerate(zip(run.points, run.setups, strict=True))]
    simulations = processes.run(_examine, tasks, jobs, whole_seconds)
    found = [
        references(point, setup, run.case.band, run.frequency)
        for point, setup in zip(run.points, run.setups, strict=True)
    ]
    dataset = label(run, simulations, found)
    for line in power_warnings(dataset):
        warnings.warn(line, FreqrailWarning, stacklevel=2)
    return dataset


def _examine(point: time_side.OperatingPoint, setup: Setup, tighter: bool, progress: SecondsProgress) -> Simulation:
    """`simulation.examine`, telling of its progress in steps that are worth a message between processes."""
    waiting = 0.0

    def advance(seconds: float) -> None:
        nonlocal waiting
        waiting += seconds
        if waiting >= 0.5:
            progress(waiting)
            waiting = 0.0

    return simulation.examine(point, setup, tighter=tighter, progress=advance)
