"""What the checks of a confirmation find: differences, tolerances, verdicts, [point, model, series] each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.confirm import setup as confirm_setup
from freqrail.confirm import statistics
from freqrail.confirm.references import References
from freqrail.confirm.run import Run
from freqrail.confirm.simulation import Simulation
from freqrail.model.responses import Response
from freqrail.result import verdicts
from freqrail.result.confirmation import series_of

KERNEL_TOLERANCE = 2e-6  # the kernel's numbers are good to 1e-6
LINE_SAFETY = 2.0  # times what a record twice as long changes, which is about what the lines miss
ROUNDING_SAFETY = 10.0  # times what another scaling of the states changes
DISAGREEMENT = 1e-5  # relative; the result's numbers and the ones computed here are both good to 1e-6
PSD_TOLERANCE = 1e-5  # of the result's spectra, relative to the line itself and PSD_FLOOR of the highest
PSD_FLOOR = 1e-6
LINE_PSD_TOLERANCE = {"rk45": 1e-3, "exponential": 1e-3, "radau": 1e-3, "newmark": 1e-1}  # of the highest line


@dataclass(frozen=True)
class Judgement:
    """What the checks found, by the check's name (see `confirmation.CHECKS`).

    differences, tolerances: relative, and the largest allowed, of the checks that hold a number against another one.
    verdicts: of all checks made. psd, line_psd: largest relative differences of the result's spectra and of record 0's
    lines; solver_error, half_width, smallest_fault_seen, degrees: see the variables of those names.
    """

    differences: dict[str, NDArray[np.float64]]
    tolerances: dict[str, NDArray[np.float64]]
    verdicts: dict[str, NDArray[np.int8]]
    psd: NDArray[np.float64]
    line_psd: NDArray[np.float64]
    solver_error: NDArray[np.float64]
    half_width: NDArray[np.float64]
    smallest_fault_seen: NDArray[np.float64]
    degrees: NDArray[np.float64]


def judge(run: Run, simulations: Sequence[Simulation], found: Sequence[References]) -> Judgement:
    """Hold every series of a run against its references. found: the frequency domain's numbers."""
    kernel = np.array([f.kernel for f in found])
    pooled, degrees = np.array([e.pooled for e in simulations]), np.array([e.degrees for e in simulations])
    low, high = statistics.interval(pooled, degrees, statistics.simultaneous(kernel.size))
    solver = np.array([e.solver_error for e in simulations])
    differences, tolerances = _differences(run, found)
    psd, line_psd = _spectral_differences(run, simulations, found)
    judged = {
        "solver": statistics.tolerance_verdicts(solver, by_model(run, confirm_setup.SOLVER_TOLERANCE), verdicts.FAILED),
        "statistical": statistics.statistical_verdicts(pooled, degrees, kernel, kernel.size),
        **{name: statistics.tolerance_verdicts(value, tolerances[name]) for name, value in differences.items()},
        "psd": statistics.tolerance_verdicts(line_psd, by_model(run, LINE_PSD_TOLERANCE), verdicts.FAILED),
    }
    if run.frequency.size:
        stored = statistics.tolerance_verdicts(psd, np.full_like(kernel, PSD_TOLERANCE))
        judged["psd"] = np.where(stored == verdicts.CONFIRMED, judged["psd"], stored)
    seen = np.maximum(high / kernel - 1, 1 - low / kernel)
    return Judgement(differences, tolerances, judged, psd, line_psd, solver, (high - low) / 2 / pooled, seen, degrees)


def _differences(
    run: Run, found: Sequence[References]
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """Differences of one number from another and the largest allowed, by check."""
    kernel, own = np.array([f.kernel for f in found]), np.array([f.own for f in found])
    differences = {
        "kernel": kernel / np.array([f.line_spectrum for f in found]) - 1,
        "result": _stored(run, "rms") / own - 1,
    }
    tolerances = {
        "kernel": KERNEL_TOLERANCE + LINE_SAFETY * np.array([f.line_change for f in found]),
        "result": np.full_like(kernel, DISAGREEMENT),
    }
    if run.case.band is None:
        rounding = np.array([f.covariance_rounding for f in found])
        differences["whole_axis"] = own / np.array([f.covariance for f in found]) - 1
        tolerances["whole_axis"] = KERNEL_TOLERANCE + ROUNDING_SAFETY * rounding
    return differences, tolerances


def by_model(run: Run, tolerance: Mapping[str, float]) -> NDArray[np.float64]:
    """What the integrators of a run are allowed, [model, 1]."""
    return np.array([[tolerance[confirm_setup.integrator_of(run.setups[0], model)]] for model in run.labels_of_models])


def _spectral_differences(
    run: Run, simulations: Sequence[Simulation], found: Sequence[References]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Largest relative differences of the result's PSDs and of record 0's lines, [point, model, series] each."""
    lines = np.array([np.max(np.abs(e.psd_simulated - e.psd), -1) / np.max(e.psd, -1) for e in simulations])
    if not run.frequency.size:
        return np.full_like(lines, np.nan), lines
    own = np.array([f.psd for f in found])
    size = own + PSD_FLOOR * np.max(own, axis=-1, keepdims=True)
    return np.max(np.abs(_stored(run, "psd") - own) / size, axis=-1), lines


def _stored(run: Run, kind: str) -> NDArray[np.float64]:
    """The result's own numbers at the points, "rms" [point, model, series] or "psd" [..., frequency]; NaN for none."""
    last = run.frequency.shape if kind == "psd" else ()
    rows = np.full((len(run.points), len(run.models), run.setups[0].series, *last), np.nan)
    for name, part in series_of(run.names, run.vocabulary).items():
        for model, prefix in enumerate(each.prefix for each in run.models):
            if f"{prefix}{name}_{kind}" in run.dataset:
                variable = run.dataset[f"{prefix}{name}_{kind}"]
                for point, place in enumerate(run.places):
                    at = {dim: i for dim, i in place.index.items() if dim in variable.dims}
                    if not place.anew:
                        rows[point, model, part] = _at_all_positions(variable.isel(at), run.vocabulary.responses[name])
    return rows


def _at_all_positions(numbers: xr.DataArray, response: Response) -> NDArray[np.float64]:
    """A response of which a part of a result may hold some of the positions, NaN at the others."""
    if not response.dimension:
        return numbers.values
    held = numbers if response.dimension in numbers.dims else numbers.expand_dims(response.dimension)
    return held.reindex({response.dimension: list(response.positions)}).values
