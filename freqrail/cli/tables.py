"""What the terminal shows of a case, its modes and a result: plain records, and tables made of them.

Records are dicts that `--json` prints as they are, so their keys are plain identifiers and the numbers of a response
are in its variable's unit; `in_shown_units` makes records for people of them, `table` sets these in headed columns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from freqrail.case.case import Case
from freqrail.case.quantities import shown_value
from freqrail.case.samples import SAMPLE
from freqrail.model.band import band_limits, band_text
from freqrail.model.responses import HALF_VEHICLE, Response, Vocabulary
from freqrail.model.spectrum import standard_deviation
from freqrail.model.statics import wheel_loads
from freqrail.model.system import evaluate
from freqrail.model.variants import BASE, TRADITIONAL, Variant
from freqrail.model.vehicle import static_wheel_load
from freqrail.result import confirmation
from freqrail.result.axes import axis_label, axis_unit, first_failures, point_speed, sampled, swept
from freqrail.result.points import Point, confirmed_point, result_case
from freqrail.result.variants import models_of
from freqrail.result.vocabulary import vocabulary_of
from freqrail.solver.modes import Mode, modes
from freqrail.sweep.off_grid import find
from freqrail.text import number, printable

Record = dict[str, Any]

HEADINGS = {
    "Hz_rigid_joints": "Hz, rigid joints",
    "damping_rigid_joints": "damping, rigid joints",
    "difference_percent": "difference %",
    "interval_low": "95 % low",
    "interval_high": "95 % high",
    "half_width_percent": "+-%",
    "solver_differs": "solver",
    "kernel_differs": "kernel",
    "whole_axis_differs": "whole axis",
    "result_differs": "result",
    "kernel_percent": "by the kernel check %",
    "solver_percent": "by the solver check %",
    "simulation_percent": "by the simulation %",
}
"""Keys of records whose column is not headed by the key with blanks for underscores."""

DIGITS = {
    "half_width_percent": 2,
    "solver_differs": 2,
    "kernel_differs": 2,
    "whole_axis_differs": 2,
    "result_differs": 2,
    "kernel_percent": 2,
    "solver_percent": 2,
    "simulation_percent": 2,
}
"""Keys of records whose numbers are shown with other than four digits."""


def table(records: Sequence[Record], columns: Sequence[str] | None = None) -> str:
    """Records as aligned text columns; numbers to the right, missing entries blank."""
    columns = list(columns or records[0])
    cells = [[_cell(record.get(column), DIGITS.get(column, 4)) for column in columns] for record in records]
    heads = [HEADINGS.get(column, column.replace("_", " ")) for column in columns]
    widths = [max(len(head), *(len(row[i]) for row in cells)) for i, head in enumerate(heads)]
    right = [all(isinstance(r.get(c), int | float | None) for r in records) for c in columns]

    def line(row: Sequence[str]) -> str:
        parts = [t.rjust(w) if r else t.ljust(w) for t, w, r in zip(row, widths, right, strict=True)]
        return "  ".join(parts).rstrip()

    return "\n".join([line(heads), line(["-" * w for w in widths]), *(line(row) for row in cells)])


def _cell(value: object, digits: int) -> str:
    if value is None:
        return ""
    return number(value, digits) if isinstance(value, float) else printable(str(value))


# --- a case ----------------------------------------------------------------------------------------


def case_parameters(case: Case) -> list[Record]:
    """The case's quantities: name, symbol, value as written, value in SI, meaning."""
    return [
        {
            "name": name,
            "symbol": case.parameter(name).symbol.replace("{", "").replace("}", ""),
            "given": quantity.text,
            "SI": quantity.value,
            "unit": case.parameter(name).unit,
            "meaning": case.meaning(name),
        }
        for name, quantity in case.quantities.items()
    ]


def case_derived(case: Case) -> list[Record]:
    """What follows from a case's scalars: loads, contact stiffness, track, wavelengths of the band."""
    rows = [
        *(_half_vehicle_rows(case) if case.is_half_vehicle else _free_vehicle_rows(case)),
        ("track height, standard deviation", 1e3 * standard_deviation(case.spectrum), "mm"),
        ("  the same over 3-25 m wavelength", 1e3 * standard_deviation(case.spectrum, (3.0, 25.0)), "mm"),
        *(_half_vehicle_lags(case) if case.is_half_vehicle else _free_vehicle_lags(case)),
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


def case_summary(case: Case) -> Record:
    """A case in a line: mass of the whole vehicle, distance of its first and last wheel, source."""
    one = case.scalar_case
    values, system = one.values(), case.described.system
    masses = {freedom.body: values[freedom.inertia] for freedom in system.freedoms if freedom.motion == "bounce"}
    places = [float(evaluate(wheel.place, values)) for wheel in system.wheels]
    return {
        "case": case.name,
        "mass_t": round(2e-3 * float(sum(masses.values())), 3),
        "wheels": len(places),
        "length_m": round(places[0] - places[-1], 3),
        "source": case.reference or case.title,
    }


def _half_vehicle_rows(case: Case) -> list[tuple[str, Any, str]]:
    vehicle = case.vehicle
    load = static_wheel_load(vehicle.car_body_mass, vehicle.bogie_mass, vehicle.wheelset_mass)
    return [
        ("static wheel load P0", load, "N"),
        ("contact stiffness K_H (eq. 1)", vehicle.contact_stiffness, "N/m"),
    ]


def _half_vehicle_lags(case: Case) -> list[tuple[str, Any, str]]:
    vehicle = case.vehicle
    return [
        ("lag of the second axle", 2e3 * vehicle.half_wheelbase / case.speed, "ms"),
        ("lag of the rear bogie", 2e3 * vehicle.half_bogie_spacing / case.speed, "ms"),
    ]


def _free_vehicle_rows(case: Case) -> list[tuple[str, Any, str]]:
    one = case.scalar_case
    values = one.values()
    system = case.described.system
    loads = wheel_loads(system, values)
    rows = [(f"static wheel load, {w.name}", load, "N") for w, load in zip(system.wheels, loads, strict=True)]
    rows += [
        (f"contact stiffness, {w.name} (eq. 1)", values[w.contact.names[0]], "N/m")
        for w in system.wheels
        if w.contact.names[0] not in case.quantities
    ]
    return rows


def _free_vehicle_lags(case: Case) -> list[tuple[str, Any, str]]:
    values = case.scalar_case.values()
    places = [float(evaluate(wheel.place, values)) for wheel in case.described.system.wheels]
    lags = [1e3 * (places[0] - place) / case.speed for place in places]
    return [
        (f"lag of {wheel.name}", lag, "ms")
        for wheel, lag in zip(case.described.system.wheels[1:], lags[1:], strict=True)
    ]


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


def case_samples(case: Case) -> list[Record]:
    """What is sampled in a case: name, smallest, largest, unit."""
    columns = case.samples.columns if case.samples else ()
    return [
        {
            "sampled": column.name,
            "smallest": float(column.values.min()),
            "largest": float(column.values.max()),
            "unit": column.unit,
        }
        for column in columns
    ]


def mode_records(case: Case) -> list[Record]:
    """The modes of a case's scalars, with the traditional model's frequency and damping beside each."""
    if not case.is_half_vehicle:
        return [_mode_record(mode) for mode in modes(case)]
    rigid = list(modes(case.vehicle.traditional()))
    records: list[Record] = []
    for mode in modes(case.vehicle):
        twin = next((m for m in rigid if m.name == mode.name), None)
        if twin:
            rigid.remove(twin)
        record = _mode_record(mode)
        shape = record.pop("shape")
        records.append(
            record
            | {
                "Hz_rigid_joints": twin.natural_frequency if twin else None,
                "damping_rigid_joints": twin.damping_ratio if twin else None,
                "shape": shape,
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


def _mode_record(mode: Mode) -> Record:
    return {
        "mode": mode.name,
        "Hz": mode.natural_frequency,
        "damping": mode.damping_ratio,
        "decay_s": mode.time_constant,
        "shape": ", ".join(f"{body} {value:+.3f}" for body, value in mode.shape.items()),
    }


_IN_RESPONSE_UNITS = ("RMS", "rigid_joints", "smallest", "largest", "simulated", "interval_low", "interval_high")


def _response(variable: str, vocabulary: Vocabulary) -> Response:
    """The response of which a variable, of any model, is the RMS."""
    responses = vocabulary.responses
    return responses[max((name for name in responses if variable.endswith(f"{name}_rms")), key=len)]


def elasticity_records(dataset: xr.Dataset) -> list[Record]:
    """Elasticities of every response at the point's speed and its first place, the largest parameter first."""
    place = point_speed(dataset)
    columns = {}
    for name in (str(key).removesuffix("_rms_elasticity") for key in dataset if str(key).endswith("_rms_elasticity")):
        found = dataset[f"{name}_rms_elasticity"].isel(speed=place)
        dimension = vocabulary_of(dataset).responses[name].dimension
        columns[f"{name} {dataset[dimension].values[0]}" if dimension else name] = (
            found.isel({dimension: 0}) if dimension else found
        ).values
    largest = np.max(np.abs(np.array(list(columns.values()))), axis=0)
    speed = f"{float(dataset['speed'][place]):g} {dataset['speed'].units}"
    return [
        {
            "parameter": str(dataset["parameter"].values[k]),
            "value": speed
            if str(dataset["parameter"].values[k]) == "speed"
            else str(dataset["parameter_value"].values[k]),
            **{f"{column} %/%": round(float(values[k]), 6) for column, values in columns.items()},
        }
        for k in np.argsort(-np.nan_to_num(largest), kind="stable")
    ]


def in_shown_units(
    records: Sequence[Record], variants: Sequence[str] = (), vocabulary: Vocabulary = HALF_VEHICLE
) -> list[Record]:
    """Records of a result's variables as people read them: in mm rather than m, and without the variable's name.

    variants: names of those whose numbers have columns of their own, see `_columns`.
    """
    shown = []
    for record in records:
        response = _response(record["variable"], vocabulary)
        columns = (*_IN_RESPONSE_UNITS, *(f"{name}_RMS" for name in variants))
        scaled = {key: record[key] * response.shown_scale for key in columns if key in record}
        shown.append({k: v for k, v in record.items() if k != "variable"} | scaled | {"unit": response.shown_unit})
    return shown


# --- a result --------------------------------------------------------------------------------------


def result_ranges(dataset: xr.Dataset) -> list[Record]:
    """Smallest and largest RMS of each response over the grid, and the largest error estimate."""
    records: list[Record] = []
    for model in models_of(dataset):
        for name, response in vocabulary_of(dataset).responses.items():
            variable = f"{model.prefix}{name}_rms"
            if variable not in dataset:
                continue
            values, error = dataset[variable].values, dataset[f"{variable}_relative_error"].values
            has = np.isfinite(values)
            records.append(
                {
                    "variable": variable,
                    "response": response.long_name,
                    "model": model.name or ("joints" if model == BASE else "itself"),
                    "smallest": float(values[has].min()) if has.any() else math.nan,
                    "largest": float(values[has].max()) if has.any() else math.nan,
                    "unit": response.unit,
                    "largest_error": float(error[has].max()) if has.any() else math.nan,
                }
            )
    return records


def result_axes(dataset: xr.Dataset) -> list[Record]:
    """The swept parameters of a result: name, number of values, first, last, unit."""
    return [
        {
            "axis": name,
            "values": int(dataset.sizes[name]),
            "first": float(dataset[name].values[0]),
            "last": float(dataset[name].values[-1]),
            "unit": axis_unit(dataset, name),
        }
        for name in swept(dataset)
    ]


def result_samples(dataset: xr.Dataset) -> list[Record]:
    """What varies along the samples of a result: name, smallest, largest, unit."""
    return [
        {
            "sampled": name,
            "smallest": float(dataset[name].values.min()),
            "largest": float(dataset[name].values.max()),
            "unit": axis_unit(dataset, name),
        }
        for name in sampled(dataset)
    ]


def result_tables(dataset: xr.Dataset) -> list[str]:
    """The axes and the ranges of a result as tables."""
    axes = [
        {k: axis[k] for k in ("axis", "values")}
        | {end: axis_label(dataset, axis["axis"], at) for end, at in (("first", 0), ("last", -1))}
        for axis in result_axes(dataset)
    ]
    parts = (axes, result_samples(dataset), in_shown_units(result_ranges(dataset), (), vocabulary_of(dataset)))
    return [table(records) for records in parts if records]


def result_point(dataset: xr.Dataset, point: Point | None) -> tuple[Record, list[str]]:
    """One point as facts to print as JSON and as lines of text; one that the grid lacks is computed anew, and said so.

    Where it is, what has no result and why if so, and the RMS of all models at every position.
    """
    found = find(dataset, point)
    dataset, indices = found.dataset, found.index
    facts: Record = {
        "point": {name: float(dataset[name].values[i]) for name, i in indices.items()},
        "units": {name: axis_unit(dataset, name) for name in indices},
        "computed_anew": list(found.anew),
    }
    where = ", ".join(found.label(name) for name in indices)
    lines = [where, *filter(None, [_sample_text(dataset, indices), found.note])]
    if sampled(dataset):
        facts["sampled"] = {name: float(dataset[name].values[indices[SAMPLE]]) for name in sampled(dataset)}
        facts["units"] |= {name: axis_unit(dataset, name) for name in sampled(dataset)}
    models = models_of(dataset)
    for model in models:
        prefix = model.prefix
        flags = dataset[f"{prefix}status"]
        status = int(flags.isel({k: i for k, i in indices.items() if k in flags.dims}))
        facts[f"{prefix}status"] = str(flags.attrs["flag_meanings"]).split()[status]
        if status:
            stored = [name for name in vocabulary_of(dataset).responses if f"{prefix}{name}_rms" in dataset]
            lacking = [name for name in stored if _lacks(dataset[f"{prefix}{name}_rms"], indices)]
            of = f" for {', '.join(lacking)}" if lacking != stored else ""
            lines.append(f"{model.words}: no result{of}, status {facts[f'{prefix}status']}")
    records: list[Record] = []
    for name, response in vocabulary_of(dataset).responses.items():
        if f"{name}_rms" not in dataset:
            continue
        values = {}
        for key in (*(f"{model.prefix}{name}_rms" for model in models), f"{name}_rms_relative_error"):
            array = dataset[key]
            values[key] = np.atleast_1d(array.isel({k: i for k, i in indices.items() if k in array.dims}).values)
        # a part of a result may hold some of the positions
        labels = np.atleast_1d(dataset[response.dimension].values).tolist() if response.dimension else [""]
        for place, label in enumerate(labels):
            own, *others, error = (float(v[place]) for v in values.values())
            columns = [_columns(variant) for variant in models[1:]]
            records.append(
                {
                    "variable": f"{name}_rms",
                    "response": response.long_name,
                    "at": str(label) if response.dimension != "axle" else f"axle {label}",
                    "RMS": own,
                    **{key: other for (key, _), other in zip(columns, others, strict=True)},
                    "unit": response.unit,
                    **{key: 100 * (own / other - 1) for (_, key), other in zip(columns, others, strict=True)},
                    "relative_error": error,
                }
            )
    shown = in_shown_units(records, [variant.name for variant in models[1:]], vocabulary_of(dataset))
    return facts | {"numbers": records}, [*lines, table(shown)]


def _sample_text(dataset: xr.Dataset, indices: Mapping[str, int]) -> str:
    """What is sampled, as a line of text; "" if nothing is."""
    return ", ".join(f"{name} = {axis_label(dataset, name, indices[SAMPLE])}" for name in sampled(dataset))


def _columns(variant: Variant) -> tuple[str, str]:
    """The columns of a variant's RMS at a point and of the vehicle's difference from it."""
    if variant.name == TRADITIONAL.name:
        return "rigid_joints", "difference_percent"
    return f"{variant.name}_RMS", f"difference_percent_from_{variant.name}"


def _lacks(array: xr.DataArray, indices: Mapping[str, int]) -> bool:
    """Whether a response lacks a number at a grid point."""
    at_point = array.isel({k: i for k, i in indices.items() if k in array.dims})
    return not np.isfinite(at_point.values).all()


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
    """A confirmation as facts for JSON and as lines of text: conditions, a table a point, what it sees, what fails.

    point: the only one to tell of. Raises InputError if it is not among those confirmed.
    """
    attributes = dataset.attrs
    chosen = range(dataset.sizes["point"]) if point is None else [confirmed_point(dataset, point)]
    tables = {str(dataset["place"].values[i]): confirmation.records(dataset, i) for i in chosen}
    shared = {str(dataset["place"].values[i]): confirmation.shared(dataset, i) for i in chosen}
    faults, missing, power = (
        confirmation.problems(dataset),
        confirmation.not_checked(dataset),
        confirmation.power(dataset),
    )
    head = [
        str(attributes.get("title", attributes["case_name"])),
        f"{confirmation.band_note(dataset)}; {attributes['realisations']} Gaussian records of "
        f"{attributes['duration_s']:g} s, seed {attributes['seed']}, {attributes['integrator']}",
    ]
    lines = [printable(line) for line in head]
    anew = [str(dataset["place"].values[i]) for i in chosen if confirmation.is_anew(dataset, i)]
    for where, numbers in tables.items():
        columns = [column for column in confirmation.TABLE if column in numbers[0]]
        in_units = in_shown_units(numbers, (), vocabulary_of(dataset))
        shown = [{k: None if v != v else v for k, v in row.items()} for row in in_units]  # nan: blank
        note = "computed anew: not on the result's grid, which has no number to compare"
        lines += [
            "",
            printable(where),
            *([note] if where in anew else []),
            table(shown, columns),
            _shared_text(shared[where]),
        ]
    lines += [
        "",
        "verdict: simulated RMS inside the interval that holds for all checks together with "
        f"{100 * float(attributes['verdict_confidence']):g} %, wider than the 95 % one above: half of it is +-%; "
        "the other columns are relative differences",
        "",
        "smallest fault of an RMS that this run would have seen, over its points and models",
        table(power),
        confirmation.POWER,
        "",
    ]
    total, made = confirmation.count_of_checks(dataset)
    count = f"{total} checks" if made == total else f"{made} of {total} checks made"
    if faults:
        words = f"{count}: NOT all stand"
    elif missing:
        words = f"{count}: those stand; not checked:"
    else:
        words = f"{count}: all stand"
    lines += [words, *(f"  {line}" for line in missing)]
    known = (*result_case(dataset).variable, SAMPLE)
    axes = [str(name) for name in dataset.coords if name in known and dataset[name].dims == ("point",)]
    facts = {
        "title": head[0],
        "conditions": head[1],
        "points": tables,
        "computed_anew": anew,
        "shared": shared,
        "power": power,
        "axes": {
            str(dataset["place"].values[i]): {name: float(dataset[name].values[i]) for name in axes} for i in chosen
        },
        "units": {name: axis_unit(dataset, name) for name in axes},
        "problems": faults,
        "not_checked": missing,
    }
    return facts, lines


def _of_wheels(numbers: float | list[float | None], digits: int = 4) -> str:
    """A number, or one a wheel, "-" for none; one that all wheels share is told once."""
    each = numbers if isinstance(numbers, list) else [numbers]
    words = ["-" if one is None else number(one, digits) for one in each]
    return words[0] if len({*words}) == 1 else ", ".join(words)


def _shared_text(shared: Record) -> str:
    """What both sides of a confirmation share at a point, as a line of text."""
    # to a picosecond: what lies below is rounding
    lags, simulated = (
        ", ".join(number(round(1e3 * lag, 9)) for lag in shared[name]) for name in ("lags_s", "simulated_lags_s")
    )
    track = "; ".join(
        f"{row['range']} {number(row['simulated_mm'], 5)} mm simulated, {number(row['mm'], 5)} mm by the spectrum"
        for row in shared["track"]
    )
    load = _of_wheels(shared["static_wheel_load_N"])
    stiffness = _of_wheels(shared["contact_stiffness_N_per_m"], 5)
    return (
        f"shared by both sides: P0 {load} N, K_H {stiffness} N/m, lags {lags} ms (on the track simulated {simulated})\n"
        f"track, standard deviation: {track}"
    )
