"""Reading a confirmation: what it says in words, numbers and verdicts, from its dataset alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.model.responses import HALF_VEHICLE, Vocabulary
from freqrail.result import verdicts
from freqrail.result.vocabulary import vocabulary_of
from freqrail.text import number

CHECKS = {
    "solver": "simulation against the line spectrum of the same record",
    "statistical": "RMS over the continuous spectrum against the simulation",
    "kernel": "RMS over the continuous spectrum against the line spectrum of record 0",
    "whole_axis": "RMS over the whole axis against the covariance of the simulated states",
    "result": "the result's own RMS against the one computed here",
    "psd": "spectra of the result and of record 0 against the frequency response of the simulated states",
}
"""The checks of every series, each with a variable verdict_NAME; whole_axis only for a result without a band."""

NOTHING_TO_COMPARE = {
    "statistical": "the kernel has no number there",
    "kernel": "the kernel has no number there",
    "whole_axis": "the covariance of the states has no number there",
    "result": "the result has no number there",
    "psd": "the result has no number there",
    "track": "the band holds too little of 3-25 m",
}

POWER = (
    "the kernel and the lines that it is held against share the blocks of the vehicle: the kernel "
    "check sees faults of the integration, the lags and the band; a fault of the blocks is seen by the solver check"
)
"""What the limits of `power` are limits of."""

SEEN = 0.1  # a fault that a confirmation ought to see in one response at least


def problems(dataset: xr.Dataset) -> list[str]:
    """One line for every point and model whose numbers do not all stand, for every run that failed, and if nothing
    that the result holds was compared."""
    lines = [part for part in str(dataset.attrs.get("failures", "")).split("; ") if part]
    for check in checks_of(dataset):
        values = dataset[f"verdict_{check}"].values
        bad = (values == verdicts.OUTSIDE) | (values == verdicts.FAILED)
        for index in np.argwhere(bad.any(axis=-1)):
            row = values[tuple(index)]
            at = np.flatnonzero(bad[tuple(index)])
            how = "outside" if (row[at] == verdicts.OUTSIDE).all() else "without a number"
            labels = [str(dataset[dataset[f"verdict_{check}"].dims[-1]].values[i]) for i in at]
            shown = ", ".join(labels[:3]) + (f" and {len(labels) - 3} more" if len(labels) > 3 else "")
            model = [f"{dataset['model'].values[m]} model" for m in index[1:]]
            where = ", ".join(filter(None, [str(dataset["place"].values[index[0]]), *model]))
            lines.append(f"{where}: {check.replace('_', ' ')} check {how}: {shown}{_remark(dataset, check, index)}")
    if (dataset["verdict_result"].values == verdicts.NOT_CHECKED).all():
        lines.append(_nothing_compared(dataset))
    return lines


def _nothing_compared(dataset: xr.Dataset) -> str:
    """What a line of `problems` says where no number of the result was compared: why, and what to do."""
    if not dataset["computed_anew"].values.all():
        return "nothing of the result was checked: it has no number at the points confirmed"
    point = dataset.attrs.get("grid_point")
    advice = f'name one of the grid, as in --at "{point}"' if point else "name one of the grid with --at"
    return f"nothing of the result was checked: its grid holds no point confirmed, all were computed anew; {advice}"


def _remark(dataset: xr.Dataset, check: str, index: NDArray[np.int64]) -> str:
    """What a line of `problems` says besides: by how much a result differs, and what to do."""
    if check != "result":
        return ""
    differ = _percent(np.nanmax(np.abs(dataset["result_difference"].values[tuple(index)])))
    return f"; the result's numbers differ by up to {differ} % from those that this freqrail computes; sweep anew"


def _percent(share: float) -> str:
    return number(float(f"{100 * share:.2g}"))


def not_checked(dataset: xr.Dataset) -> list[str]:
    """One line for every check that had nothing to compare somewhere: how often, and why."""
    lines = []
    for check in checks_of(dataset):
        values = dataset[f"verdict_{check}"].values
        missing = int((values == verdicts.NOT_CHECKED).sum())
        if missing:
            what = check.replace("_", " ")
            lines.append(f"{what} check: {missing} of {values.size} not checked ({NOTHING_TO_COMPARE[check]})")
    return lines


def checks_of(dataset: xr.Dataset) -> tuple[str, ...]:
    """The checks that a confirmation made: those of every series, then that of the track."""
    return tuple(check for check in (*CHECKS, "track") if f"verdict_{check}" in dataset)


def count_of_checks(dataset: xr.Dataset) -> tuple[int, int]:
    """Number of comparisons, those that had nothing to compare included, and of those that were made."""
    found = [dataset[f"verdict_{check}"].values for check in checks_of(dataset)]
    return sum(v.size for v in found), sum(int((v != verdicts.NOT_CHECKED).sum()) for v in found)


def power(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """The smallest relative fault of each response that would have been seen, at every point and in both models.

    By the kernel check: of what the kernel does not share with the lines, see POWER. By the solver check: also of the
    ladder, which they share. By the simulation: of the RMS, whatever the lines say.
    """
    solver = float(100 * dataset["solver_tolerance"].values.max())
    rows = []
    vocabulary = vocabulary_of(dataset)
    for name, part in series_of(confirmed_names(dataset), vocabulary).items():
        row: dict[str, Any] = {"response": vocabulary.responses[name].long_name}
        for check, variable in (("kernel", "kernel_tolerance"), ("simulation", "smallest_fault_seen")):
            values = dataset[variable].values[..., part]
            row[f"{check}_percent"] = float(100 * np.max(values)) if np.isfinite(values).all() else None
            if check == "kernel":
                row["solver_percent"] = solver
        rows.append(row)
    return rows


def power_warnings(dataset: xr.Dataset) -> list[str]:
    """A line if the simulation would have seen no fault below SEEN in any response: how large, and what would."""
    seen = [row["simulation_percent"] / 100 for row in power(dataset) if row["simulation_percent"]]
    if not seen or min(seen) <= SEEN:
        return []
    records, period = int(dataset.attrs["realisations"]), float(dataset.attrs["duration_s"])
    # the interval's width falls with the square root of the time simulated
    longer = max(period, 60.0)
    enough = math.ceil(records * period * (min(seen) / SEEN) ** 2 / longer)
    return [
        f"the simulation ({records} records of {period:g} s) would have seen no fault below {100 * min(seen):.2g} % in "
        f'any response (criterion: {100 * SEEN:g} %); give --realisations {enough} --duration "{longer:g} s" or more'
    ]


def series_of(names: Sequence[str], vocabulary: Vocabulary = HALF_VEHICLE) -> dict[str, slice]:
    """Where the series of each response lie."""
    found, place = {}, 0
    for name in names:
        found[name] = slice(place, place + max(1, len(vocabulary.responses[name].positions)))
        place = found[name].stop
    return found


def series_labels(names: Sequence[str], vocabulary: Vocabulary = HALF_VEHICLE) -> list[str]:
    """The series by label: "bogie_acceleration front", "primary_stroke axle 1", "car_body_pitch_acceleration"."""
    labels = []
    for name in names:
        response = vocabulary.responses[name]
        axle = "axle " if response.dimension == "axle" else ""
        labels += [f"{name} {axle}{position}" for position in response.positions] or [name]
    return labels


def confirmed_names(dataset: xr.Dataset) -> tuple[str, ...]:
    """The responses that a confirmation holds, in the table's order."""
    return tuple(name for name in vocabulary_of(dataset).responses if f"{name}_rms_frequency_domain" in dataset)


def relative(dataset: xr.Dataset, key: str) -> NDArray[np.float64]:
    """An RMS by simulation, such as "pooled" or "interval_low", relative to the frequency domain's, less one:
    [point, model, series]."""
    parts = []
    responses = vocabulary_of(dataset).responses
    for name in confirmed_names(dataset):
        ratio = dataset[f"{name}_rms_{key}"].values / dataset[f"{name}_rms_frequency_domain"].values - 1
        parts.append(ratio if responses[name].dimension else ratio[..., None])
    return np.concatenate(parts, axis=-1)


def is_confirmation(dataset: xr.Dataset) -> bool:
    """Whether a dataset is one of `confirm`."""
    return "verdict_solver" in dataset


def is_anew(dataset: xr.Dataset, point: int) -> bool:
    """Whether the result's grid lacks a point (counted from 0), so that its numbers were computed anew."""
    return bool(dataset["computed_anew"].values[point])


def band_note(dataset: xr.Dataset) -> str:
    """What band the numbers were confirmed over, and that it is not the result's own if so."""
    band, own = dataset.attrs["band"], dataset.attrs["result_band"]
    return f"confirmed over {band}" + ("" if band == own else f" (the result's own band: {own})")


def shared(dataset: xr.Dataset, point: int) -> dict[str, Any]:
    """What both sides of the checks share at a point (counted from 0), to be compared with numbers from elsewhere."""
    one = dataset.isel(point=point)
    return {
        # one number where all wheels are alike; a contact that is no spring has none
        "static_wheel_load_N": one["static_wheel_load"].values.tolist(),
        "contact_stiffness_N_per_m": _numbers(one["contact_stiffness_used"]),
        "lags_s": one["lag"].values.tolist(),
        "simulated_lags_s": one["lag_simulated"].values.tolist(),
        "track": [
            {
                "range": str(label),
                "simulated_mm": 1e3 * float(one["track_deviation_simulated"].values[k]),
                "mm": 1e3 * float(one["track_deviation"].values[k]),
                "verdict": _word(one["verdict_track"], k),
            }
            for k, label in enumerate(one["wavelength_range"].values)
        ],
    }


def _numbers(values: xr.DataArray) -> Any:
    """A number, or a list of them with None for one that is not there."""
    found = values.values.tolist()
    return [None if each != each else each for each in found] if isinstance(found, list) else found


def records(dataset: xr.Dataset, point: int) -> list[dict[str, Any]]:
    """What is told of one point (counted from 0): a row a model and series, in the units of the variables."""
    rows = []
    vocabulary = vocabulary_of(dataset)
    labels = [str(label) for label in dataset["series"].values]
    differences = {"solver": "solver_error"} | {
        check: f"{check}_difference" for check in CHECKS if f"{check}_difference" in dataset
    }
    for m, model in enumerate(map(str, dataset["model"].values)):
        one = dataset.isel(point=point, model=m)
        for name, part in series_of(confirmed_names(dataset), vocabulary).items():
            response = vocabulary.responses[name]
            kept = ("frequency_domain", "pooled", "interval_low", "interval_high")
            values = np.array([np.atleast_1d(one[f"{name}_rms_{key}"].values) for key in kept])
            for k, (rms, simulated, low, high) in zip(range(part.start, part.stop), values.T.tolist(), strict=True):
                words = {check: _word(one[f"verdict_{check}"], k) for check in checks_of(dataset) if check != "track"}
                rows.append(
                    {
                        "model": model,
                        "series": labels[k],
                        "variable": f"{name}_rms",
                        "RMS": rms,
                        "simulated": simulated,
                        "interval_low": low,
                        "interval_high": high,
                        "unit": response.unit,
                        "half_width_percent": 100 * float(one["half_width"].values[k]),
                        **{f"{check}_differs": float(one[key].values[k]) for check, key in differences.items()},
                        **words,
                        "verdict": _summary(words),
                    }
                )
    return rows


TABLE = (
    "model",
    "series",
    "RMS",
    "simulated",
    "interval_low",
    "interval_high",
    "unit",
    "half_width_percent",
    "solver_differs",
    "kernel_differs",
    "whole_axis_differs",
    "result_differs",
    "verdict",
)
"""The columns of `records` that the table of a point shows, those that there are."""


def _summary(words: Mapping[str, str]) -> str:
    """The verdicts of a series in a few words: "confirmed", or what is not."""
    others = {word: [check for check, own in words.items() if own == word] for word in verdicts.VERDICTS[1:]}
    told = [f"{word.replace('_', ' ')}: {', '.join(checks)}" for word, checks in others.items() if checks]
    return "; ".join(told).replace("whole_axis", "whole axis") or "confirmed"


def _word(verdict: xr.DataArray, series: int) -> str:
    return str(verdict.attrs["flag_meanings"]).split()[int(verdict.values[series])]
