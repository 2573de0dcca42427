"""Points of a result's grid: from text such as "speed=250 km/h, primary_joint_stiffness=5 MN/m" to indices."""

from __future__ import annotations

import functools
import hashlib
import math
import os
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.axis import SAME, Axis, is_same
from freqrail.case.case import Case, build_case, place_point
from freqrail.case.free_tables import typed_name
from freqrail.case.parameters import COMPLIANCES, VARIABLE, Parameter, suggestion
from freqrail.case.quantities import Quantity, parse_quantity, typed_unit, unit_factor
from freqrail.case.samples import SAMPLE, number_of
from freqrail.errors import FreqrailWarning, InputError
from freqrail.model.band import band_text
from freqrail.result.axes import SAMPLE_NAME, axis_label, axis_unit, grid_axis, sample_names, sampled, swept
from freqrail.result.confirmation import is_confirmation
from freqrail.result.labels import coordinate, sample_coordinates, scalar_coordinates, skeleton
from freqrail.result.layout import Layout
from freqrail.result.netcdf import open_result
from freqrail.result.variants import variants_of
from freqrail.result.vocabulary import vocabulary_of
from freqrail.text import given

Point = Mapping[str, Quantity]


def parse_point(text: str, variable: Mapping[str, Parameter] = VARIABLE) -> Point:
    """A point from "NAME=VALUE, NAME=VALUE". variable: what may vary, by name.

    Raises InputError for unknown names and bad values.
    """
    point: dict[str, Quantity] = {}
    problems = []
    for part in filter(None, re.split(r",\s*(?=[A-Za-z_][A-Za-z0-9_.]*\s*=)", text.strip())):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        name = typed_name(name) if "." in name else name
        if not equals:
            problems.append(f'--at: a point is written "NAME=VALUE, NAME=VALUE" (got "{part}")')
        elif name not in (*variable, SAMPLE):
            problems.append(f"--at {name}: unknown name{suggestion(name, variable)}")
        elif name in point:
            problems.append(f'--at {name}: given twice (got "{text}")')
        elif name == SAMPLE:
            point[name] = Quantity(math.nan, value)
        else:
            try:
                point[name] = parse_quantity(variable[name], value)
            except ValueError as fault:
                problems.append(f"--at {name}: {fault}")
    if not point and not problems:
        problems.append('--at: is empty; write it as in --at "speed=250 km/h"')
    if problems:
        raise InputError(*problems)
    return point


def result_case(dataset: xr.Dataset) -> Case:
    """The case that a result was computed from, after all its settings and axes."""
    try:
        text, name = str(dataset.attrs["effective_case"]), str(dataset.attrs["case_name"])
    except KeyError as fault:
        raise InputError(f"the dataset has no attribute {fault}: a result of freqrail's sweep is expected") from None
    return replace(_case_of(text, name), variants=variants_of(dataset))


@functools.lru_cache(maxsize=2)  # of many samples it takes a second
def _case_of(text: str, name: str) -> Case:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)  # the sweep has told them
        return build_case(text, name=name, file="the result's case", stray_points=True)


def read_result(path: str | os.PathLike[str]) -> xr.Dataset:
    """A result from its file (see `netcdf.open_result`), held against the case that it bears.

    Raises InputError besides if its effective_case is no case, or its axes are not those of the case.
    """
    dataset = open_result(path)
    faults = [] if is_confirmation(dataset) else _case_faults(dataset)
    if faults:
        raise InputError(*(f"{path}: is no whole result of freqrail: {fault}" for fault in faults))
    return dataset


def _case_faults(dataset: xr.Dataset) -> list[str]:
    try:
        case = result_case(dataset)
    except InputError as fault:
        return [f"its effective_case is no case: {problem}" for problem in fault.problems]
    axes = {axis.name: axis for axis in case.axes}
    faults = [f"has no dimension {name}, which its case sweeps" for name in axes if name not in dataset.dims]
    for name in swept(dataset):
        if name not in axes:
            faults.append(f"has the dimension {name}, which its case does not sweep; read it with xarray")
            continue
        if name == SAMPLE:
            faults += _sample_faults(dataset, case)
            continue
        unit, right = axis_unit(dataset, name), _axis_unit_of(dataset, axes[name], case)
        if not _is_unit_of(unit, case.parameter(name)):
            faults.append(f"{name} has no unit of a {case.parameter(name).kind} (got {unit!r})")
        elif unit_factor(unit) != unit_factor(right):
            faults.append(f"{name} is not in {right}, as its case has it (got {unit!r})")
    return faults or [*_contradictions(dataset, case)]


def _sample_faults(dataset: xr.Dataset, case: Case) -> Iterator[str]:
    """What of the samples of a result, or of the part that it holds, is not as its case has them."""
    assert case.samples
    try:
        own = case.samples.at(dataset[SAMPLE].values)
    except KeyError as fault:
        yield f"has a sample {fault}, which its case has not; read it with xarray"
        return
    for name, (_, values, attributes) in sample_coordinates(case, own).items():
        if name not in dataset.coords or dataset[name].dims != (SAMPLE,):
            yield f"has no coordinate {name} along {SAMPLE}, as its case has it"
        elif dataset[name].attrs.get("units") != attributes.get("units"):
            yield f"{name} has no unit {attributes.get('units')} (got {dataset[name].attrs.get('units', 'none')!r})"
        elif name == SAMPLE_NAME:
            if sample_names(dataset) != values.tolist():
                yield f"{name} is not that of its case"
        elif not np.allclose(dataset[name].values, values, rtol=SAME, atol=0.0):
            yield f"{name} is not that of its case"


def _contradictions(dataset: xr.Dataset, case: Case) -> Iterator[str]:
    """What of a result's attributes and coordinates is not what its case gives."""
    digest = hashlib.sha256(str(dataset.attrs["effective_case"]).encode()).hexdigest()
    for name, right in (("effective_case_sha256", digest), ("band", band_text(case.band))):
        if dataset.attrs.get(name, right) != right:
            yield f"its attribute {name} is not that of its case: {right} is expected {given(dataset.attrs[name])}"
    expected: dict[str, tuple[tuple[str, ...], NDArray[np.float64], dict[str, str]]] = {}
    expected |= scalar_coordinates(case, case.band)
    for joint in {*swept(dataset)} & {*COMPLIANCES} if case.is_half_vehicle else ():
        compliance = COMPLIANCES[joint]
        values, attributes = coordinate(grid_axis(dataset, joint), case)[compliance][1:]
        expected[compliance] = ((joint,), values, attributes)
    for name, (dims, values, attributes) in expected.items():
        if name not in dataset.coords:
            continue
        array = dataset[name]
        if array.dims != dims or array.dtype != np.float64:
            where = f"along {', '.join(dims)}" if dims else "one number"
            yield f"{name} is not {where}, as its case has it; read it with xarray"
        elif array.attrs.get("units") != attributes.get("units"):
            yield f"{name} has no unit {attributes.get('units')} (got {array.attrs.get('units', 'none')!r})"
        elif not np.allclose(array.values, values, rtol=SAME, atol=0.0):
            at = np.argmax(~np.isclose(array.values, values, rtol=SAME, atol=0.0))
            own, wanted = (float(np.ravel(v)[at]) for v in (array.values, values))
            yield f"{name} is not that of its case: {wanted:.10g} is expected (got {own:.10g})"


def _axis_unit_of(dataset: xr.Dataset, axis: Axis, case: Case) -> str:
    """The unit, as users type it, in which a result of a case has an axis."""
    if dataset.attrs.get("dataset_schema_version") == 1:  # in the spelling of the case
        return axis.unit
    attributes = coordinate(axis, case)[axis.name][2]
    return typed_unit(attributes.get("units", attributes.get("user_units", "")))


def _is_unit_of(unit: str, parameter: Parameter) -> bool:
    try:
        return unit_factor(unit)[1] == unit_factor(parameter.unit)[1]
    except ValueError:
        return False


def example_point(dataset: xr.Dataset) -> str:
    """A grid point as `parse_point` reads it: the one nearest to the case's scalars, every axis named."""
    parts = []
    for name, index in locate(dataset, nearest=True).items():
        value = float(dataset[name].values[index])
        parts.append(f"{name}={'inf' if np.isinf(value) else f'{value:.10g}'} {axis_unit(dataset, name)}".rstrip())
    return ", ".join(parts)


def locate(
    dataset: xr.Dataset, point: Point | None = None, nearest: bool = False, origin: str = "--at"
) -> dict[str, int]:
    """Index along every swept parameter of the grid point that `point` names.

    A swept name that the point leaves out takes the case's scalar; if that is not on the grid, its
    nearest value where `nearest` is set, else it is an error. Raises InputError, with the nearest grid
    value, for a value off the grid and for a named quantity that is neither swept nor the case's own;
    `origin` is what its messages call the point.
    """
    axes = tuple(grid_axis(dataset, name) for name in swept(dataset))
    indices, faults = place_point(
        point or {}, axes, result_case(dataset).scalars, nearest, sampled(dataset), sample_names(dataset)
    )
    if faults:
        raise InputError(*(f"{origin} {name}: {fault}" for name, fault in faults.items()))
    return indices


def off_grid(
    dataset: xr.Dataset, point: Point | None = None, origin: str = "--at"
) -> tuple[dict[str, int], dict[str, Quantity]]:
    """Where a point lies on a result's grid, and what of it does not: ({axis: index}, {axis: its value}).

    A swept name that the point leaves out takes the case's scalar. Raises InputError for a named quantity that is
    neither swept nor the case's own; `origin` is what its messages call the point.
    """
    axes = tuple(grid_axis(dataset, name) for name in swept(dataset))
    scalars = result_case(dataset).scalars
    indices, faults = place_point(point or {}, axes, scalars, False, sampled(dataset), sample_names(dataset))
    off = {
        name: (point or {}).get(name) or scalars[name]
        for name in swept(dataset)
        if name in faults and name != SAMPLE  # there is no other sample
    }
    if faults.keys() - off.keys():
        raise InputError(*(f"{origin} {name}: {fault}" for name, fault in faults.items() if name not in off))
    return indices, off


@dataclass(frozen=True)
class Place:
    """Where a point lies in a result.

    dataset: the result itself, or the coordinates and the case (see `result_case`) of the point where the result's
    grid does not hold it. index: place along every swept parameter, those kept whole left out. anew: the swept
    parameters whose value the result's grid lacks, none if the numbers are the result's own. beyond: see
    `outside`. told: what was warned of when the case of a point off the grid was read.
    """

    dataset: xr.Dataset
    index: Mapping[str, int]
    anew: tuple[str, ...]
    beyond: str = ""
    told: tuple[str, ...] = ()

    def label(self, name: str) -> str:
        """A swept parameter and its value, such as "speed = 250 km/h"; one off the grid with all digits that tell it
        from the grid's (`is_same`)."""
        digits = 10 if name in self.anew else 6
        return f"{name} = {axis_label(self.dataset, name, self.index[name], digits)}"

    @property
    def note(self) -> str:
        """What is not the result's own, in words; "" if nothing."""
        values = [self.label(name) for name in self.anew]
        return f"computed anew: {', '.join(values)} is not on the result's grid{self.beyond}" if values else ""


def find_place(
    dataset: xr.Dataset, point: Point | None = None, keep: Sequence[str] = (), origin: str = "--at"
) -> Place:
    """Where a point lies, on the grid of a result or off it.

    point: {name: quantity}; a swept parameter left out takes the case's own value, or the axis' only one. keep: swept
    parameters that stay whole axes. origin: what messages call the point.

    Raises InputError for a name that is neither swept nor the case's own value.
    """
    index, off = off_grid(dataset, point, origin)
    off = {name: quantity for name, quantity in off.items() if name not in keep}
    index = {name: i for name, i in index.items() if name not in keep}
    if not off:
        return Place(dataset, index, ())
    case = result_case(dataset)
    stray = {*swept(dataset)} - {axis.name for axis in case.axes}
    if stray:  # results put together in memory: their case is that of the first
        raise InputError(
            f"{origin} {', '.join(off)}: off the grid, and cannot be computed anew: the result's case does not sweep "
            f"{', '.join(sorted(stray))}"
        )
    over = {name: quantity.text for name, quantity in off.items()}
    table = None
    for axis in case.axes:
        if axis.name == SAMPLE and case.samples:
            numbers = dataset[SAMPLE].values
            table = case.samples.at(numbers[[index[SAMPLE]]] if SAMPLE in index else numbers)
            continue
        si = grid_axis(dataset, axis.name).si
        if axis.name in index:
            over[axis.name] = _axis_text(axis, si[[index[axis.name]]])
        elif axis.name in keep and not np.array_equal(si, axis.si):  # a part that the caller has cut out
            over[axis.name] = _axis_text(axis, si)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)  # for the caller to tell, once
        own = build_case(
            case.effective, over=over, name=case.name, stray_points=True, axis_option=origin, samples=table
        )
    own = replace(own, variants=case.variants)
    index = {name: 0 for name in swept(dataset) if name not in keep}
    return Place(skeleton(layout_of(dataset, own)), index, tuple(off), outside(dataset, off), own.warnings)


def outside(dataset: xr.Dataset, off: Mapping[str, Quantity]) -> str:
    """Which values off a result's grid lie beyond its ends, to end a message with; "" if none does."""
    found = []
    for name, quantity in off.items():
        si = grid_axis(dataset, name).si
        if not si.min() <= quantity.value <= si.max():
            ends = [axis_label(dataset, name, int(at)) for at in (np.argmin(si), np.argmax(si))]
            found.append(f"{name} (swept: {' to '.join(dict.fromkeys(ends))})")
    return f"; outside the swept range: {', '.join(found)}" if found else ""


def layout_of(dataset: xr.Dataset, case: Case) -> Layout:
    """The layout of a result with the responses, and at the frequencies, of another one."""
    frequency = None
    if "frequency" in dataset.dims:
        values = dataset["frequency"].values
        frequency = Axis("frequency", values, "Hz", values, "")
    names = tuple(name for name in vocabulary_of(dataset).responses if f"{name}_rms" in dataset)
    slopes = any(f"{name}_rms_gradient" in dataset for name in names)
    return Layout(case, names, frequency, tuple(map(str, dataset["parameter"].values)) if slopes else ())


def _axis_text(axis: Axis, si: np.ndarray) -> str:
    """Values of an axis as a case has them, in the unit in which it was written."""
    factor = float(unit_factor(axis.unit)[0])
    return f"{', '.join('inf' if np.isinf(value) else f'{value / factor:.15g}' for value in si)} {axis.unit}"


def confirmed_point(dataset: xr.Dataset, point: Point) -> int:
    """Place of a point among those of a confirmation. Raises InputError if it names none or several of them."""
    keep = np.ones(dataset.sizes["point"], dtype=bool)
    for name, quantity in point.items():
        own = result_case(dataset).scalars.get(name)
        if name == SAMPLE and SAMPLE in dataset.coords:
            keep &= dataset[SAMPLE].values == number_of(quantity.text, dataset[SAMPLE].values, sample_names(dataset))
        elif name in dataset.coords and dataset[name].dims == ("point",):
            values = dataset[name].values * float(unit_factor(axis_unit(dataset, name))[0])
            keep &= [is_same(value, quantity.value) for value in values]
        elif own is None or not is_same(own.value, quantity.value):
            keep[:] = False
    found = np.flatnonzero(keep)
    if found.size != 1:
        known = "; ".join(map(str, dataset["place"].values))
        raise InputError(
            f"--at: names {found.size or 'none'} of the confirmed points, one is expected (known: {known})"
        )
    return int(found[0])
