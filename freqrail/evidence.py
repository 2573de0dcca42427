"""The evidence of a confirmation as a labelled dataset, and what it says in words.

Dimensions: point, model (joint, traditional), the position of a response, record; series for the verdicts. Swept
parameters are coordinates of the points, in the units of the result.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy
import xarray as xr
from numpy.typing import NDArray

from freqrail import timedomain, verdicts
from freqrail.dataset import attributes, content_digest, coordinate, flags
from freqrail.names import DIMENSIONS, RESPONSES
from freqrail.plan import band_text
from freqrail.points import grid_axis, swept
from freqrail.runs import Run
from freqrail.timedomain import MODELS, Evidence

DISAGREEMENT = 1e-5  # relative; both the result's numbers and the ones computed here are good to 1e-6


def label(run: Run, evidence: Sequence[Evidence], references: Sequence[NDArray[np.float64]]) -> xr.Dataset:
    """What was found at the points of a run, judged, named and with units.

    references: RMS by frequency responses, [model, series] a point.
    """
    reference = np.array(references)
    checks = reference.size
    pooled, degrees = np.array([e.pooled for e in evidence]), np.array([e.degrees for e in evidence])
    low, high = verdicts.interval(pooled, degrees)
    verdict_low, verdict_high = verdicts.interval(pooled, degrees, verdicts.simultaneous(checks))
    tolerances = np.array([timedomain.tolerance(plan) for plan in run.plans])
    solver = verdicts.solver_verdicts(np.array([e.solver_error for e in evidence]), tolerances)
    statistical = verdicts.statistical_verdicts(pooled, degrees, reference, checks)
    number = {"units": "1"}
    by_series: dict[str, tuple[Any, str, dict[str, Any]]] = {
        "verdict_solver": (
            solver,
            "solver check: simulation against its own line spectrum",
            flags(verdicts.VERDICTS, ""),
        ),
        "verdict_statistical": (
            statistical,
            "statistical check: frequency-domain RMS against the simulation",
            flags(verdicts.VERDICTS, ""),
        ),
        "solver_error": (
            [e.solver_error for e in evidence],
            "largest relative difference of a record's RMS from its line spectrum's",
            number,
        ),
        "degrees_of_freedom": (degrees, "degrees of freedom of the pooled mean square", number),
        "result_difference": (
            _stored(run) / reference - 1,
            "relative difference of the result's RMS from the one computed here",
            number,
        ),
    }
    every: dict[str, tuple[Any, str, tuple[str, ...]]] = {
        "rms_frequency_domain": (reference, "RMS by frequency responses, continuous spectrum", ()),
        "rms_line_spectrum": ([e.line_spectrum for e in evidence], "RMS of a record by its line spectrum", ("record",)),
        "rms_time_domain": ([e.simulated for e in evidence], "RMS of a record by simulation", ("record",)),
        "rms_pooled": (pooled, "RMS of all Gaussian records together by simulation", ()),
        "rms_interval_low": (low, "lower limit of the 95 % interval by simulation", ()),
        "rms_interval_high": (high, "upper limit of the 95 % interval by simulation", ()),
        "rms_verdict_low": (verdict_low, "lower limit of the interval that decides", ()),
        "rms_verdict_high": (verdict_high, "upper limit of the interval that decides", ()),
        "psd_frequency_domain": (_padded([e.psd for e in evidence]), "one-sided PSD by frequency responses", ("line",)),
        "psd_time_domain": (
            _padded([e.psd_simulated for e in evidence]),
            "one-sided PSD of record 0 by simulation",
            ("line",),
        ),
        # single precision: these are to be drawn, and would be most of the file
        "history": (
            _padded([e.histories for e in evidence]).astype(np.float32),
            "beginning of record 0 by simulation",
            ("sample",),
        ),
    }
    variables: dict[str, Any] = {
        name: (("point", "model", "series"), np.array(values), described | {"long_name": what})
        for name, (values, what, described) in by_series.items()
    }
    place = 0
    for name in timedomain.RESPONSES:
        response = RESPONSES[name]
        part = slice(place, place + len(response.positions))
        place = part.stop
        for suffix, (values, what, last) in every.items():
            unit = response.psd_unit if suffix.startswith("psd") else response.unit
            variables[f"{name}_{suffix}"] = (
                ("point", "model", response.dimension, *last),
                np.asarray(values)[:, :, part],
                {"units": unit, "long_name": f"{response.long_name}: {what}"},
            )
    variables["track_height"] = (
        ("point", "axle", "sample"),
        _padded([e.heights for e in evidence]).astype(np.float32),
        {"units": "m", "long_name": "track height under the wheels, beginning of record 0"},
    )
    variables["startup"] = (
        "point",
        np.array([e.startup for e in evidence]),
        {"units": "s", "long_name": "simulated before the measured period and discarded, the ramp included"},
    )
    variables["solver_tolerance"] = (
        "model",
        tolerances[0, :, 0],
        number | {"long_name": "largest solver error that is allowed"},
    )
    variables["relative_tolerance"] = (
        "point",
        np.array(
            [timedomain.accuracy(point, plan).relative for point, plan in zip(run.points, run.plans, strict=True)]
        ),
        number | {"long_name": "rtol of rk45 and radau"},
    )
    return xr.Dataset(variables, _coordinates(run, evidence), _attributes(run, evidence))


def _padded(arrays: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Arrays of different lengths as one, [point, ..., longest], NaN behind the shorter ones."""
    longest = max(array.shape[-1] for array in arrays)
    return np.array(
        [np.pad(a, [(0, 0)] * (a.ndim - 1) + [(0, longest - a.shape[-1])], constant_values=np.nan) for a in arrays]
    )


def _coordinates(run: Run, evidence: Sequence[Evidence]) -> dict[str, Any]:
    coordinates: dict[str, Any] = {
        "point": ("point", np.arange(1, len(run.points) + 1, dtype=np.int32), {"long_name": "confirmed grid point"}),
        "model": ("model", np.array(MODELS), {"long_name": "with damper joints, or traditional with rigid ones"}),
        "series": ("series", np.array(series_labels()), {"long_name": "response and position"}),
        "record": (
            "record",
            np.arange(run.plans[0].realisations + 1, dtype=np.int32),
            {"long_name": "record: 0 with fixed amplitudes and random phases, the others Gaussian"},
        ),
        "place": ("point", np.array(run.labels), {"long_name": "the grid point in words"}),
        "frequency": (
            ("point", "line"),
            _padded([e.frequency for e in evidence]),
            {"units": "Hz", "long_name": "frequency of the lines at which spectra are kept"},
        ),
        "time": (
            ("point", "sample"),
            _padded([e.time for e in evidence]),
            {"units": "s", "long_name": "time from the start of the measured period"},
        ),
    }
    for name in swept(run.dataset):
        _, values, described = coordinate(grid_axis(run.dataset, name), run.case.masses)
        coordinates[name] = ("point", values[[index[name] for index in run.indices]], described)
    for dimension in dict.fromkeys(RESPONSES[name].dimension for name in timedomain.RESPONSES):
        long_name, labels = DIMENSIONS[dimension]
        values = np.array(labels, dtype=np.int32 if isinstance(labels[0], int) else None)
        coordinates[dimension] = (dimension, values, {"long_name": long_name})
    return coordinates


def _attributes(run: Run, evidence: Sequence[Evidence]) -> dict[str, Any]:
    """The dataset's attributes: its case's and the conditions of the runs."""
    plan = run.plans[0]
    described = attributes(run.case, "confirmation")
    versions = json.loads(described["versions"]) | {"scipy": scipy.__version__}
    steady = plan.start == "steady"
    accuracy = plan.accuracy
    discard = f"ln({1 / timedomain.FORGOTTEN:g})/sigma of the slowest mode below the band's end"
    conditions = {
        "source": f"freqrail {versions['freqrail']}, simulation of the half vehicle against its frequency response",
        "result_content_digest": content_digest(run.dataset),
        "result_band": str(run.dataset.attrs["band"]),
        "band": band_text(run.band),
        "seed": np.int64(plan.seed),
        "realisations": np.int64(plan.realisations),
        "duration_s": plan.period,
        "integrator": "; ".join(f"{model}: {timedomain.integrator_of(plan, model)}" for model in MODELS),
        "tolerances": f"rk45 and radau: rtol {accuracy.relative:g}, smaller where a mode in the band is damped by less "
        f"than {timedomain.WELL_DAMPED:g}, atol the same share of a state's RMS, longest step 1/"
        f"{timedomain.STEPS_A_PERIOD} of the highest line's period; newmark: {accuracy.substeps} steps a sample of the "
        "track; exponential: exact for the track's spline",
        "interpolation": f"periodic cubic spline, at least {plan.samples_a_period} samples a period of the highest "
        "line, harmonics in the band exact",
        "start": plan.start,
        "ramp_s": 0.0 if steady else timedomain.RAMP,
        "discard_rule": "nothing: the start is the lines' own steady state" if steady else f"the ramp, then {discard}",
        "tighter_repeat": "record 0 of point 1, ten times tighter (exponential: track sampled twice as often)",
        "tighter_repeat_change": evidence[0].tighter_change,
        "interval_confidence": verdicts.CONFIDENCE,
        "verdict_confidence": verdicts.FAMILY_CONFIDENCE,
        "verdict_rule": "simultaneous (Bonferroni) over all statistical checks of the run",
        "failures": "; ".join(
            f"{place}, {model} model: {fault}"
            for place, e in zip(run.labels, evidence, strict=True)
            for model, fault in e.failures.items()
        ),
        "versions": json.dumps(versions),
        "warnings": str(run.dataset.attrs.get("warnings", "")),
    }
    return {key: value for key, value in (described | conditions).items() if str(value) != ""}


def problems(dataset: xr.Dataset) -> list[str]:
    """One line for every point and model whose numbers do not all stand, and for every run that failed."""
    lines = [part for part in str(dataset.attrs.get("failures", "")).split("; ") if part]
    for check in ("solver", "statistical"):
        values = dataset[f"verdict_{check}"].values
        for point, model in np.argwhere((values != 0).any(axis=-1)):
            row = values[point, model]
            bad = [str(dataset["series"].values[i]) for i in np.flatnonzero(row)]
            how = "outside" if (row[row != 0] == 1).all() else "without a number"
            shown = ", ".join(bad[:3]) + (f" and {len(bad) - 3} more" if len(bad) > 3 else "")
            where = f"{dataset['place'].values[point]}, {dataset['model'].values[model]} model"
            lines.append(f"{where}: {check} check {how}: {shown}")
    differ = np.abs(dataset["result_difference"].values)
    for point in np.flatnonzero((differ > DISAGREEMENT).any(axis=(1, 2))):
        lines.append(
            f"{dataset['place'].values[point]}: the result's numbers differ by up to {np.nanmax(differ[point]):.1e} "
            "from those that this freqrail computes; sweep anew"
        )
    return lines


def series_labels() -> list[str]:
    """The eleven series by label, such as "bogie_acceleration front" and "primary_stroke axle 1"."""
    labels = []
    for name in timedomain.RESPONSES:
        for position in RESPONSES[name].positions:
            labels.append(f"{name} {'axle ' if RESPONSES[name].dimension == 'axle' else ''}{position}")
    return labels


def _stored(run: Run) -> NDArray[np.float64]:
    """The result's own RMS at the points, [point, model, series]; NaN where it has none over the band confirmed."""
    rows = np.full((len(run.points), len(MODELS), timedomain.SERIES_COUNT), np.nan)
    if run.case.band != run.band:
        return rows
    place = 0
    for name in timedomain.RESPONSES:
        count = len(RESPONSES[name].positions)
        for model, prefix in enumerate(("", "traditional_")):
            if f"{prefix}{name}_rms" in run.dataset:
                variable = run.dataset[f"{prefix}{name}_rms"]
                for point, index in enumerate(run.indices):
                    at = {dim: i for dim, i in index.items() if dim in variable.dims}
                    rows[point, model, place : place + count] = variable.isel(at).values
        place += count
    return rows


def relative(dataset: xr.Dataset, key: str) -> NDArray[np.float64]:
    """An RMS by simulation, such as "pooled" or "interval_low", relative to the frequency domain's, less one:
    [point, model, series]."""
    parts = [
        dataset[f"{name}_rms_{key}"].values / dataset[f"{name}_rms_frequency_domain"].values - 1
        for name in timedomain.RESPONSES
    ]
    return np.concatenate(parts, axis=-1)


def is_confirmation(dataset: xr.Dataset) -> bool:
    """Whether a dataset is one of `confirm`."""
    return "verdict_solver" in dataset


def band_note(dataset: xr.Dataset) -> str:
    """What band the numbers were confirmed over, and that it is not the result's own if so."""
    band, own = dataset.attrs["band"], dataset.attrs["result_band"]
    return f"confirmed over {band}" + ("" if band == own else f" (the result's own band: {own})")


def records(dataset: xr.Dataset, point: int) -> list[dict[str, Any]]:
    """What the table of one point (counted from 0) shows: a row a model and series, in shown units."""
    rows = []
    for m, model in enumerate(map(str, dataset["model"].values)):
        one = dataset.isel(point=point, model=m)
        series = iter(range(dataset.sizes["series"]))
        for name in timedomain.RESPONSES:
            response = RESPONSES[name]
            kept = ("frequency_domain", "pooled", "interval_low", "interval_high")
            values = np.array([one[f"{name}_rms_{key}"].values for key in kept]) * response.shown_scale
            for rms, simulated, low, high in values.T.tolist():
                k = next(series)
                rows.append(
                    {
                        "model": model,
                        "series": str(dataset["series"].values[k]),
                        "RMS": rms,
                        "simulated": simulated,
                        "interval_low": low,
                        "interval_high": high,
                        "unit": response.shown_unit,
                        "statistical": _word(one["verdict_statistical"], k),
                        "solver_error": float(one["solver_error"].values[k]),
                        "solver": _word(one["verdict_solver"], k),
                    }
                )
    return rows


def _word(verdict: xr.DataArray, series: int) -> str:
    return str(verdict.attrs["flag_meanings"]).split()[int(verdict.values[series])]
