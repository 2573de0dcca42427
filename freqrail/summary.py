"""What the terminal shows of a case, its modes and a result: plain records, and tables made of them.

Records are dicts that `--json` prints as they are, so their keys are plain identifiers; `table` sets them in
columns and heads these in words.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from freqrail.anew import find
from freqrail.case import Case
from freqrail.dataset import MODELS, first_failures
from freqrail.evidence import band_note, problems
from freqrail.evidence import records as confirmation_records
from freqrail.modal import modes
from freqrail.names import PARAMETERS, RESPONSES, meaning
from freqrail.plan import band_text
from freqrail.points import Point, axis_label, confirmed_point, swept
from freqrail.quantities import shown_value
from freqrail.track import band_limits, standard_deviation
from freqrail.vehicle import static_wheel_load

Record = dict[str, Any]

HEADINGS = {
    "Hz_rigid_joints": "Hz, rigid joints",
    "damping_rigid_joints": "damping, rigid joints",
    "difference_percent": "difference %",
    "interval_low": "95 % low",
    "interval_high": "95 % high",
}
"""Keys of records whose column is not headed by the key with blanks for underscores."""


def printable(text: str) -> str:
    """Text with its control characters escaped, so that none reaches a terminal; lines stay lines."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


def number(value: float, digits: int = 4) -> str:
    """A number in `digits` significant digits; whole numbers below ten million plain."""
    if not math.isfinite(value):
        return str(value)
    if value == round(value, 0) and abs(value) < 1e7:
        return f"{value + 0.0:.0f}"  # no minus before a zero
    return f"{value:.{digits}g}"


def table(records: Sequence[Record], columns: Sequence[str] | None = None) -> str:
    """Records as aligned text columns; numbers to the right, missing entries blank."""
    columns = list(columns or records[0])
    cells = [[_cell(record.get(column)) for column in columns] for record in records]
    heads = [HEADINGS.get(column, column.replace("_", " ")) for column in columns]
    widths = [max(len(head), *(len(row[i]) for row in cells)) for i, head in enumerate(heads)]
    right = [all(isinstance(r.get(c), int | float | None) for r in records) for c in columns]

    def line(row: Sequence[str]) -> str:
        parts = [t.rjust(w) if r else t.ljust(w) for t, w, r in zip(row, widths, right, strict=True)]
        return "  ".join(parts).rstrip()

    return "\n".join([line(heads), line(["-" * w for w in widths]), *(line(row) for row in cells)])


def _cell(value: object) -> str:
    if value is None:
        return ""
    return number(value) if isinstance(value, float) else printable(str(value))


# --- a case ----------------------------------------------------------------------------------------


def case_parameters(case: Case) -> list[Record]:
    """The case's quantities: name, symbol, value as written, value in SI, meaning."""
    return [
        {
            "name": name,
            "symbol": PARAMETERS[name].symbol.replace("{", "").replace("}", ""),
            "given": quantity.text,
            "SI": quantity.value,
            "unit": PARAMETERS[name].unit,
            "meaning": meaning(name, case.masses),
        }
        for name, quantity in case.quantities.items()
    ]


def case_derived(case: Case) -> list[Record]:
    """What follows from a case's scalars: loads, contact stiffness, track, wavelengths of the band."""
    vehicle = case.vehicle
    rows = [
        (
            "static wheel load P0",
            static_wheel_load(vehicle.car_body_mass, vehicle.bogie_mass, vehicle.wheelset_mass),
            "N",
        ),
        ("contact stiffness K_H (eq. 1)", vehicle.contact_stiffness, "N/m"),
        ("track height, standard deviation", 1e3 * standard_deviation(case.spectrum), "mm"),
        ("  the same over 3-25 m wavelength", 1e3 * standard_deviation(case.spectrum, (3.0, 25.0)), "mm"),
        ("lag of the second axle", 2e3 * vehicle.half_wheelbase / case.speed, "ms"),
        ("lag of the rear bogie", 2e3 * vehicle.half_bogie_spacing / case.speed, "ms"),
    ]
    if case.band is not None:
        low, high = band_limits(case.band, case.speed) / (2 * np.pi)
        rows += [
            ("band, lower limit", float(low), "Hz"),
            ("band, upper limit", float(high), "Hz"),
            (f"longest wavelength at {shown_value('speed', case.speed)}", case.speed / float(low), "m"),
            (f"shortest wavelength at {shown_value('speed', case.speed)}", case.speed / float(high), "m"),
        ]
    return [{"derived": name, "value": float(value), "unit": unit} for name, value, unit in rows]


def case_axes(case: Case) -> list[Record]:
    """The swept parameters of a case: name, number of values, first, last, unit."""
    return [
        {
            "axis": axis.name,
            "values": axis.values.size,
            "first": float(axis.values[0]),
            "last": float(axis.values[-1]),
            "unit": axis.unit,
        }
        for axis in case.axes
    ]


def mode_records(case: Case) -> list[Record]:
    """The modes of a case's scalars, with the traditional model's frequency and damping beside each."""
    rigid = list(modes(case.vehicle.traditional()))
    records: list[Record] = []
    for mode in modes(case.vehicle):
        twin = next((m for m in rigid if m.name == mode.name), None)
        if twin:
            rigid.remove(twin)
        records.append(
            {
                "mode": mode.name,
                "Hz": mode.natural_frequency,
                "damping": mode.damping_ratio,
                "decay_s": mode.time_constant,
                "Hz_rigid_joints": twin.natural_frequency if twin else None,
                "damping_rigid_joints": twin.damping_ratio if twin else None,
                "shape": ", ".join(f"{body} {value:+.3f}" for body, value in mode.shape.items()),
            }
        )
    for mode in rigid:
        records.append(
            {
                "mode": mode.name,
                "Hz": None,
                "damping": None,
                "decay_s": None,
                "Hz_rigid_joints": mode.natural_frequency,
                "damping_rigid_joints": mode.damping_ratio,
                "shape": "",
            }
        )
    return records


# --- a result --------------------------------------------------------------------------------------


def result_ranges(dataset: xr.Dataset) -> list[Record]:
    """Smallest and largest RMS of each response over the grid, and the largest error estimate."""
    records: list[Record] = []
    for prefix, words in MODELS.items():
        for name, response in RESPONSES.items():
            variable = f"{prefix}{name}_rms"
            if variable not in dataset:
                continue
            values, error = dataset[variable].values, dataset[f"{variable}_relative_error"].values
            has = np.isfinite(values)
            records.append(
                {
                    "response": response.long_name,
                    "model": words.split(",")[0].replace("model with damper joints", "joints").split(" ")[0],
                    "smallest": float(values[has].min()) * response.shown_scale if has.any() else math.nan,
                    "largest": float(values[has].max()) * response.shown_scale if has.any() else math.nan,
                    "unit": response.shown_unit,
                    "largest_error": float(error[has].max()) if has.any() else math.nan,
                }
            )
    return records


def largest_error(dataset: xr.Dataset) -> float:
    """The largest relative error estimate among all RMS values of a result; nan if there are none."""
    errors = [v.values for k, v in dataset.data_vars.items() if str(k).endswith("_rms_relative_error")]
    return max((float(np.nanmax(e)) for e in errors if np.isfinite(e).any()), default=math.nan)


def result_axes(dataset: xr.Dataset) -> list[Record]:
    """The swept parameters of a result: name, number of values, first and last."""
    return [
        {
            "axis": name,
            "values": int(dataset.sizes[name]),
            "first": axis_label(dataset, name, 0),
            "last": axis_label(dataset, name, -1),
        }
        for name in swept(dataset)
    ]


def result_point(dataset: xr.Dataset, point: Point | None) -> tuple[Record, list[str]]:
    """One point as facts to print as JSON and as lines of text; one that the grid lacks is computed anew, and said so.

    Where it is, why it has no result if so, and RMS with and without joints at every position.
    """
    found = find(dataset, point)
    dataset, indices = found.dataset, found.index
    facts: Record = {"point": {name: axis_label(dataset, name, i) for name, i in indices.items()}}
    facts["computed_anew"] = list(found.anew)
    lines = [", ".join(f"{name} = {label}" for name, label in facts["point"].items()), *filter(None, [found.note])]
    for prefix, words in MODELS.items():
        flags = dataset[f"{prefix}status"]
        status = int(flags.isel({k: i for k, i in indices.items() if k in flags.dims}))
        facts[f"{prefix}status"] = str(flags.attrs["flag_meanings"]).split()[status]
        if status:
            lines.append(f"{words}: no result, status {facts[f'{prefix}status']}")
    records: list[Record] = []
    for name, response in RESPONSES.items():
        if f"{name}_rms" not in dataset:
            continue
        values = {}
        for key in (f"{name}_rms", f"traditional_{name}_rms", f"{name}_rms_relative_error"):
            array = dataset[key]
            values[key] = np.atleast_1d(array.isel({k: i for k, i in indices.items() if k in array.dims}).values)
        for place, label in enumerate(response.positions or ("",)):
            joint, rigid, error = (float(v[place]) for v in values.values())
            records.append(
                {
                    "variable": f"{name}_rms",
                    "response": response.long_name,
                    "at": str(label) if response.dimension != "axle" else f"axle {label}",
                    "RMS": joint * response.shown_scale,
                    "rigid_joints": rigid * response.shown_scale,
                    "unit": response.shown_unit,
                    "difference_percent": 100 * (joint / rigid - 1),
                    "relative_error": error,
                }
            )
    columns = [column for column in records[0] if column != "variable"]
    return facts | {"numbers": records}, [*lines, table(records, columns)]


def result_head(dataset: xr.Dataset) -> str:
    """Title, band, origin and grid of a result, and its failures, as lines of text."""
    attributes = dataset.attrs
    lines = [
        str(attributes.get("title", attributes["case_name"])),
        f"case {attributes['case_name']}, band {attributes['band']}, written by {attributes['source']}",
        *(f"WARNING {line}" for line in first_failures(dataset)),
    ]
    return "\n".join(map(printable, lines))


def case_head(case: Case) -> str:
    """Title, track, band and speed of a case as lines of text."""
    track = f"track {case.spectrum.name}, band {band_text(case.band)}, {shown_value('speed', case.speed)}"
    return "\n".join(printable(line) for line in (case.title or case.name, track))


def confirmation_text(dataset: xr.Dataset, point: Point | None = None) -> tuple[Record, list[str]]:
    """A confirmation as facts to print as JSON and as lines of text: conditions, a table a point, and what fails.

    point: the only one to tell of. Raises InputError if it is not among those confirmed.
    """
    attributes = dataset.attrs
    chosen = range(dataset.sizes["point"]) if point is None else [confirmed_point(dataset, point)]
    tables = {str(dataset["place"].values[i]): confirmation_records(dataset, i) for i in chosen}
    faults = problems(dataset)
    head = [
        str(attributes.get("title", attributes["case_name"])),
        f"{band_note(dataset)}; {attributes['realisations']} Gaussian records of {attributes['duration_s']:g} s, "
        f"seed {attributes['seed']}, {attributes['integrator']}",
    ]
    lines = [printable(line) for line in head]
    for where, numbers in tables.items():
        lines += ["", printable(where), table(numbers)]
    lines += [
        "",
        "confirmed: inside the interval that holds for all checks together with "
        f"{100 * float(attributes['verdict_confidence']):g} %, wider than the 95 % one above",
    ]
    checks = 2 * dataset["solver_error"].size
    words = "all stand" if not faults else "NOT all stand"
    lines += [f"{checks} checks: {words}; largest solver error {float(dataset['solver_error'].max()):.1e}"]
    return {"title": head[0], "conditions": head[1], "points": tables, "problems": faults}, lines
