"""Points of a result's grid: from text such as "speed=250 km/h, primary_joint_stiffness=5 MN/m" to indices."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping

import numpy as np
import xarray as xr

from freqrail.axes import axis_unit, grid_axis, swept
from freqrail.case import Case, build_case, place_point
from freqrail.errors import FreqrailWarning, InputError
from freqrail.findings import is_confirmation
from freqrail.names import PARAMETERS, SWEEPABLE, suggestion
from freqrail.quantities import Quantity, is_same, parse_quantity, unit_factor
from freqrail.storage import open_result

Point = Mapping[str, Quantity]


def parse_point(text: str) -> Point:
    """A point from "NAME=VALUE, NAME=VALUE". Raises InputError for unknown names and bad values."""
    point: dict[str, Quantity] = {}
    problems = []
    for part in filter(None, re.split(r",\s*(?=[A-Za-z_]+\s*=)", text.strip())):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals:
            problems.append(f'--at: a point is written "NAME=VALUE, NAME=VALUE" (got "{part}")')
        elif name not in SWEEPABLE:
            problems.append(f"--at {name}: unknown name{suggestion(name, SWEEPABLE)}")
        elif name in point:
            problems.append(f'--at {name}: given twice (got "{text}")')
        else:
            try:
                point[name] = parse_quantity(PARAMETERS[name], value)
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
        raise InputError(f"the dataset has no attribute {fault}: a result of freqrail's sweep is due") from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FreqrailWarning)  # the sweep has told them
        return build_case(text, name=name, file="the result's case", stray_points=True)


def read_result(path: str | os.PathLike[str]) -> xr.Dataset:
    """A result from its file (see `storage.open_result`), held against the case that it bears.

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
    faults = [
        f"has no dimension {axis.name}, which its case sweeps" for axis in case.axes if axis.name not in dataset.dims
    ]
    for name in swept(dataset):
        unit, parameter = axis_unit(dataset, name), PARAMETERS[name]
        try:
            right = unit_factor(unit)[1] == unit_factor(parameter.unit)[1]
        except ValueError:
            right = False
        if not right:
            faults.append(f"{name} has no unit of a {parameter.kind} (got {unit!r})")
    return faults


def example_point(dataset: xr.Dataset) -> str:
    """A grid point as `parse_point` reads it: the one nearest to the case's scalars, every axis named."""
    parts = []
    for name, index in locate(dataset, nearest=True).items():
        value = float(dataset[name].values[index])
        parts.append(f"{name}={'inf' if np.isinf(value) else f'{value:.10g}'} {axis_unit(dataset, name)}")
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
    indices, faults = place_point(point or {}, axes, result_case(dataset).scalars, nearest)
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
    indices, faults = place_point(point or {}, axes, scalars)
    off = {name: (point or {}).get(name) or scalars[name] for name in swept(dataset) if name in faults}
    if faults.keys() - off.keys():
        raise InputError(*(f"{origin} {name}: {fault}" for name, fault in faults.items() if name not in off))
    return indices, off


def confirmed_point(dataset: xr.Dataset, point: Point) -> int:
    """Place of a point among those of a confirmation. Raises InputError if it names none or several of them."""
    keep = np.ones(dataset.sizes["point"], dtype=bool)
    for name, quantity in point.items():
        own = result_case(dataset).scalars.get(name)
        if name in dataset.coords and dataset[name].dims == ("point",):
            values = dataset[name].values * float(unit_factor(axis_unit(dataset, name))[0])
            keep &= [is_same(value, quantity.value) for value in values]
        elif own is None or not is_same(own.value, quantity.value):
            keep[:] = False
    found = np.flatnonzero(keep)
    if found.size != 1:
        known = "; ".join(map(str, dataset["place"].values))
        raise InputError(f"--at: names {found.size or 'none'} of the confirmed points, one is due (known: {known})")
    return int(found[0])
