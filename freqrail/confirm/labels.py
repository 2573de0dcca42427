"""A confirmation as a labelled dataset; `result.confirmation` reads it.

Dimensions: point, model (joint, and the variants: traditional), the position of a response, record; series for the
verdicts, which are of every response that the result holds. Swept parameters are coordinates of the points, in the
units of the result.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.axis import Axis
from freqrail.case.quantities import unit_factor
from freqrail.case.samples import SAMPLE
from freqrail.confirm import setup as confirm_setup
from freqrail.confirm import statistics
from freqrail.confirm.judging import Judgement, by_model, judge
from freqrail.confirm.references import References
from freqrail.confirm.run import Run, told_of
from freqrail.confirm.simulated import contact_stiffnesses, wheel_lags
from freqrail.confirm.simulation import Simulation
from freqrail.model.band import band_text
from freqrail.model.variants import DEFAULT
from freqrail.result import verdicts
from freqrail.result.axes import SAMPLE_NAME, grid_axis, sample_names, sampled, swept
from freqrail.result.confirmation import CHECKS, series_labels, series_of
from freqrail.result.content import content_digest, whole
from freqrail.result.labels import attributes, coordinate, position_coordinates, scalar_coordinates, vehicle_words
from freqrail.result.layout import flags
from freqrail.result.points import example_point

TRACK_TOLERANCE = 1e-4  # of the record's standard deviation
RANGES = ("3-25 m", "band")
"""Ranges of the track's standard deviation: the wavelengths of track standards as far as the band reaches, the band."""

Variables = dict[str, tuple[Any, Any, dict[str, Any]]]


def label(run: Run, simulations: Sequence[Simulation], found: Sequence[References]) -> xr.Dataset:
    """What was found at the points of a run, judged, named and with units. found: the frequency domain's numbers."""
    by_series = _check_variables(judge(run, simulations, found))
    described: Variables = {
        name: (("point", "model", "series"), values, attributes) for name, (values, attributes) in by_series.items()
    }
    variables = described | _by_response(run, simulations, found, by_series) | _by_point(run, simulations, found)
    return xr.Dataset(variables, _coordinates(run, simulations), _attributes(run, simulations))


def _check_variables(judged: Judgement) -> dict[str, tuple[NDArray, dict[str, Any]]]:
    """What the checks found by variable, with attributes."""
    number = {"units": "1"}
    words = {
        "solver_error": (judged.solver_error, "largest relative difference of a record's RMS from its line spectrum's"),
        **{f"{name}_difference": (v, f"relative difference: {CHECKS[name]}") for name, v in judged.differences.items()},
        **{f"{name}_tolerance": (v, f"largest {name}_difference allowed") for name, v in judged.tolerances.items()},
        "psd_difference": (judged.psd, "largest relative difference of the result's PSD from the states' response"),
        "line_psd_difference": (
            judged.line_psd,
            "largest difference of the PSD of record 0 from that of its lines, of the highest",
        ),
        "half_width": (judged.half_width, "half of the interval that decides, of the simulated RMS"),
        "smallest_fault_seen": (
            judged.smallest_fault_seen,
            "smallest relative fault of the RMS that this simulation would have seen",
        ),
        "degrees_of_freedom": (judged.degrees, "degrees of freedom of the pooled mean square"),
    }
    return {
        **{
            f"verdict_{name}": (
                judged.verdicts[name],
                flags(verdicts.VERDICTS, f"{name.replace('_', ' ')} check: {what}"),
            )
            for name, what in CHECKS.items()
            if name in judged.verdicts
        },
        **{name: (values, number | {"long_name": what}) for name, (values, what) in words.items()},
    }


def _by_response(
    run: Run, simulations: Sequence[Simulation], found: Sequence[References], checks: Mapping[str, tuple[NDArray, Any]]
) -> Variables:
    """The numbers behind the checks, a variable a response: <response>_<what>."""
    pooled, degrees = np.array([e.pooled for e in simulations]), checks["degrees_of_freedom"][0]
    low, high = statistics.interval(pooled, degrees)
    verdict_low, verdict_high = statistics.interval(pooled, degrees, statistics.simultaneous(pooled.size))
    every: dict[str, tuple[Any, str, tuple[str, ...]]] = {
        "rms_frequency_domain": ([f.kernel for f in found], "RMS by frequency responses, continuous spectrum", ()),
        "rms_line_spectrum": (
            [e.line_spectrum for e in simulations],
            "RMS of a record by its line spectrum",
            ("record",),
        ),
        "rms_time_domain": ([e.simulated for e in simulations], "RMS of a record by simulation", ("record",)),
        "rms_pooled": (pooled, "RMS of all Gaussian records together by simulation", ()),
        "rms_interval_low": (low, "lower limit of the 95 % interval by simulation", ()),
        "rms_interval_high": (high, "upper limit of the 95 % interval by simulation", ()),
        "rms_verdict_low": (verdict_low, "lower limit of the interval that decides", ()),
        "rms_verdict_high": (verdict_high, "upper limit of the interval that decides", ()),
        "psd_frequency_domain": (
            _padded([e.psd for e in simulations]),
            "one-sided PSD by frequency responses",
            ("line",),
        ),
        "psd_time_domain": (
            _padded([e.psd_simulated for e in simulations]),
            "one-sided PSD of record 0 by simulation",
            ("line",),
        ),
        # single precision: these are to be drawn, and would be most of the file
        "history": (
            _padded([e.histories for e in simulations]).astype(np.float32),
            "beginning of record 0 by simulation",
            ("sample",),
        ),
    }
    if run.case.band is None:
        every["rms_whole_axis"] = ([f.own for f in found], "RMS over the whole axis by the closed form", ())
        every["rms_covariance"] = (
            [f.covariance for f in found],
            "RMS over the whole axis by the covariance of the simulated states",
            (),
        )
    variables: Variables = {}
    for name, part in series_of(run.names, run.vocabulary).items():
        response = run.vocabulary.responses[name]
        place = (response.dimension,) if response.dimension else ()
        for suffix, (values, what, last) in every.items():
            unit = response.psd_unit if suffix.startswith("psd") else response.unit
            own = np.asarray(values)[:, :, part]
            variables[f"{name}_{suffix}"] = (
                ("point", "model", *place, *last),
                own if place else own[:, :, 0],
                {"units": unit, "long_name": f"{response.long_name}: {what}"},
            )
    return variables


def _by_point(run: Run, simulations: Sequence[Simulation], found: Sequence[References]) -> Variables:
    """The track of record 0, what both sides share, and how the points were run."""
    metre, number, second = {"units": "m"}, {"units": "1"}, {"units": "s"}
    simulated, closed = np.array([e.track_deviation for e in simulations]), np.array([f.track_deviation for f in found])
    ranges = np.array(
        [confirm_setup.track_ranges(point, setup) for point, setup in zip(run.points, run.setups, strict=True)]
    )
    speed = np.array([[[point.speed]] for point in run.points])
    wheels, half = _wheels(run), run.case.is_half_vehicle
    loads = np.array([f.wheel_load for f in found])
    stiffnesses = np.array([contact_stiffnesses(point.vehicle) for point in run.points])
    each = ("point", wheels) if loads.ndim > 1 else ("point",)
    judged = statistics.tolerance_verdicts(simulated / closed - 1, np.full(closed.shape, TRACK_TOLERANCE))
    return {
        "computed_anew": (
            "point",
            np.array([bool(place.anew) for place in run.places], dtype=np.int8),
            flags(("on_the_grid", "computed_anew"), "whether the result's grid lacks the point"),
        ),
        "verdict_track": (
            ("point", "wavelength_range"),
            judged,
            flags(verdicts.VERDICTS, "track check: standard deviation of record 0 against that of the spectrum"),
        ),
        "track_deviation_simulated": (
            ("point", "wavelength_range"),
            simulated,
            metre | {"long_name": "standard deviation of the track height of record 0 under the first wheel"},
        ),
        "track_deviation": (
            ("point", "wavelength_range"),
            closed,
            metre | {"long_name": "standard deviation of the track height by the spectrum's closed form"},
        ),
        "wavelengths": (
            ("point", "wavelength_range", "limit"),
            (speed / ranges)[..., ::-1],
            metre | {"long_name": "shortest and longest wavelength of a range"},
        ),
        "static_wheel_load": (
            each,
            loads,
            {"units": "N", "long_name": "static load of a wheel" + (" P0 (below eq. 1)" if half else "")},
        ),
        "contact_stiffness_used": (
            each,
            stiffnesses,
            {
                "units": "N m-1",
                "long_name": "contact stiffness K_H (eq. 1)" if half else "stiffness of a contact that is a spring",
            },
        ),
        "lag": (
            ("point", wheels),
            np.array([wheel_lags(point.vehicle, point.speed) for point in run.points]),
            second | {"long_name": "lag of a wheel behind the first (eq. 2)"},
        ),
        "lag_simulated": (
            ("point", wheels),
            np.array([e.lags for e in simulations]),
            second | {"long_name": "lag of a wheel behind the first, read off the track of record 0"},
        ),
        "track_height": (
            ("point", wheels, "sample"),
            _padded([e.heights for e in simulations]).astype(np.float32),
            metre | {"long_name": "track height under the wheels, beginning of record 0"},
        ),
        "startup": (
            "point",
            np.array([e.startup for e in simulations]),
            second | {"long_name": "simulated before the measured period and discarded, the ramp included"},
        ),
        "solver_tolerance": (
            "model",
            by_model(run, confirm_setup.SOLVER_TOLERANCE)[:, 0],
            number | {"long_name": "largest solver error that is allowed"},
        ),
        "relative_tolerance": (
            "point",
            np.array(
                [
                    confirm_setup.accuracy(point, setup).relative
                    for point, setup in zip(run.points, run.setups, strict=True)
                ]
            ),
            number | {"long_name": "rtol of rk45 and radau"},
        ),
    }


def _padded(arrays: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Arrays of different lengths as one, [point, ..., longest], NaN behind the shorter ones."""
    longest = max(array.shape[-1] for array in arrays)
    return np.array(
        [np.pad(a, [(0, 0)] * (a.ndim - 1) + [(0, longest - a.shape[-1])], constant_values=np.nan) for a in arrays]
    )


def _coordinates(run: Run, simulations: Sequence[Simulation]) -> dict[str, Any]:
    coordinates: dict[str, Any] = {
        "point": ("point", np.arange(1, len(run.points) + 1, dtype=np.int32), {"long_name": "confirmed grid point"}),
        "model": ("model", np.array(run.labels_of_models), {"long_name": _models_text(run)}),
        "series": (
            "series",
            np.array(series_labels(run.names, run.vocabulary)),
            {"long_name": "response and position"},
        ),
        "wavelength_range": ("wavelength_range", np.array(RANGES), {"long_name": "range of wavelengths of the track"}),
        "record": (
            "record",
            np.arange(run.setups[0].realisations + 1, dtype=np.int32),
            {"long_name": "record: 0 with fixed amplitudes and random phases, the others Gaussian"},
        ),
        "place": ("point", np.array(run.labels), {"long_name": "the grid point in words"}),
        "frequency": (
            ("point", "line"),
            _padded([e.frequency for e in simulations]),
            {"units": "Hz", "long_name": "frequency of the lines at which spectra are kept"},
        ),
        "time": (
            ("point", "sample"),
            _padded([e.time for e in simulations]),
            {"units": "s", "long_name": "time from the start of the measured period"},
        ),
    }
    if SAMPLE in swept(run.dataset):
        coordinates |= _samples_of_points(run)
    for name in (name for name in (*swept(run.dataset), *sampled(run.dataset)) if name != SAMPLE):
        for key, (_, values, described) in coordinate(_axis_of_points(run, name), run.case).items():
            coordinates[key] = ("point", values, described)
    coordinates |= scalar_coordinates(run.case, run.band)
    used = {run.vocabulary.responses[name].dimension for name in run.names} | {_wheels(run)}
    return coordinates | position_coordinates(used, run.vocabulary)


def _wheels(run: Run) -> str:
    """The dimension of the wheels."""
    return "axle" if run.case.is_half_vehicle else "wheel"


def _models_text(run: Run) -> str:
    if run.case.is_half_vehicle and run.models[1:] == DEFAULT:
        return "with damper joints, or traditional with rigid ones"
    return "; ".join(f"{label}: {model.words}" for label, model in zip(run.labels_of_models, run.models, strict=True))


def _samples_of_points(run: Run) -> dict[str, Any]:
    """The number, and the name, of every point's sample."""
    numbers = [int(place.dataset[SAMPLE].values[place.index[SAMPLE]]) for place in run.places]
    found = {SAMPLE: ("point", np.array(numbers, dtype=np.int32), run.dataset[SAMPLE].attrs)}
    if sample_names(run.dataset):
        names = [sample_names(place.dataset)[place.index[SAMPLE]] for place in run.places]
        found[SAMPLE_NAME] = ("point", np.array(names), run.dataset[SAMPLE_NAME].attrs)
    return found


def _axis_of_points(run: Run, name: str) -> Axis:
    """A swept parameter's value at every point, in the result's unit whether the point is on its grid or not."""
    axis = grid_axis(run.dataset, name)
    factor = float(unit_factor(axis.unit)[0])
    along = SAMPLE if name in sampled(run.dataset) else name
    si = [grid_axis(place.dataset, name).si[place.index[along]] for place in run.places]
    values = [si[n] / factor if place.anew else axis.values[place.index[along]] for n, place in enumerate(run.places)]
    return replace(axis, values=np.array(values), si=np.array(si))


def _attributes(run: Run, simulations: Sequence[Simulation]) -> dict[str, Any]:
    """The dataset's attributes: its case's and the conditions of the runs."""
    setup = run.setups[0]
    described = attributes(run.case, "confirmation")
    versions = json.loads(described["versions"]) | {"scipy": scipy.__version__}
    steady = setup.start == "steady"
    accuracy = setup.accuracy
    discard = f"ln({1 / confirm_setup.FORGOTTEN:g})/sigma of the slowest mode below the band's end"
    conditions = {
        "source": f"freqrail {versions['freqrail']}, simulation of {vehicle_words(run.case)} against its "
        "frequency response",
        "result_content_digest": content_digest(run.dataset),
        "result_band": str(run.dataset.attrs["band"]),
        "grid_point": example_point(run.dataset),
        "band": band_text(run.band),
        "seed": whole(setup.seed),
        "realisations": whole(setup.realisations),
        "duration_s": setup.period,
        "integrator": "; ".join(
            f"{model}: {confirm_setup.integrator_of(setup, model)}" for model in run.labels_of_models
        ),
        "tolerances": f"rk45 and radau: rtol {accuracy.relative:g}, smaller where a mode in the band is damped by less "
        f"than {confirm_setup.WELL_DAMPED:g}, atol the same share of a state's RMS, longest step 1/"
        f"{confirm_setup.STEPS_A_PERIOD} of the highest line's period; newmark: {accuracy.substeps} steps a sample of "
        "the track; exponential: exact for the track's spline",
        "interpolation": "periodic cubic spline, harmonics in the band exact, images below "
        f"{confirm_setup.IMAGES:g} of an RMS",
        "start": setup.start,
        "ramp_s": 0.0 if steady else confirm_setup.RAMP,
        "discard_rule": "nothing: the start is the lines' own steady state" if steady else f"the ramp, then {discard}",
        "tighter_repeat": "record 0 of point 1, ten times tighter (exponential: track sampled twice as often)",
        "tighter_repeat_change": simulations[0].tighter_change,
        "interval_confidence": statistics.CONFIDENCE,
        "verdict_confidence": statistics.FAMILY_CONFIDENCE,
        "verdict_rule": "simultaneous (Bonferroni) over all statistical checks of the run",
        "failures": "; ".join(
            f"{place}, {model} model: {fault}"
            for place, e in zip(run.labels, simulations, strict=True)
            for model, fault in e.failures.items()
        ),
        "versions": json.dumps(versions),
        "warnings": _warnings(run),
    }
    return {key: value for key, value in (described | conditions).items() if str(value) != ""}


def _warnings(run: Run) -> str:
    """The result's warnings, if any point is on its grid, and what is told of those that are not, as a result has them
    (JSON); "" if there is nothing."""
    on_grid = any(not place.anew for place in run.places)
    records = json.loads(str(run.dataset.attrs.get("warnings") or "[]")) if on_grid else []
    for line in (line for place in run.places for line in told_of(place)):
        records.append({"name": "computed_anew", "accepted": False, "text": line})
    return json.dumps(records, ensure_ascii=False) if records else ""
