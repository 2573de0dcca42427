"""Points of a result's grid: from text such as "speed=250 km/h, primary_joint_stiffness=5 MN/m" to indices."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import xarray as xr

from freqrail.case import Case, build_case
from freqrail.errors import InputError
from freqrail.names import PARAMETERS, SWEEPABLE, suggestion
from freqrail.quantities import Quantity, parse_quantity, unit_factor

Point = Mapping[str, Quantity]

SAME = 1e-9  # relative distance below which a value is taken for the grid's own


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
    text, name = str(dataset.attrs["effective_case"]), str(dataset.attrs["case_name"])
    return build_case(text, name=name, file="the result's case", stray_points=True)


def swept(dataset: xr.Dataset) -> tuple[str, ...]:
    """The swept parameters of a result, in order."""
    return tuple(str(dim) for dim in dataset["status"].dims)


def axis_si(dataset: xr.Dataset, name: str) -> np.ndarray:
    """The values of a swept parameter in SI units: [n]."""
    attributes = dataset[name].attrs
    unit = attributes.get("units", attributes.get("user_units"))
    return dataset[name].values * float(unit_factor(str(unit))[0])


def axis_label(dataset: xr.Dataset, name: str, index: int) -> str:
    """A grid value in the coordinate's unit, such as "250 km/h"; "rigid" for an infinite joint stiffness."""
    value = float(dataset[name].values[index])
    attributes = dataset[name].attrs
    return "rigid" if np.isinf(value) else f"{value:g} {attributes.get('units', attributes.get('user_units'))}"


def locate(dataset: xr.Dataset, point: Point | None = None, nearest: bool = False) -> dict[str, int]:
    """Index along every swept parameter of the grid point that `point` names.

    A swept name that the point leaves out takes the case's scalar; if that is not on the grid, its
    nearest value where `nearest` is set, else it is an error. Raises InputError, with the nearest grid
    value, for a value off the grid and for a named quantity that is neither swept nor the case's own.
    """
    point = point or {}
    case = result_case(dataset)
    axes = swept(dataset)
    indices, problems = {}, []
    for name in axes:
        quantity = point.get(name) or case.quantities.get(name)
        values = axis_si(dataset, name)
        if quantity is None or (values.size == 1 and name not in point):
            indices[name] = 0  # nothing to choose from, or nothing that says what to choose
            continue
        at = _closest(values, quantity.value)
        hit = values[at] == quantity.value or np.isclose(values[at], quantity.value, rtol=SAME, atol=0)
        if hit or (nearest and name not in point):
            indices[name] = at
        else:
            source = "" if name in point else "the case's own value, used where --at leaves it out, "
            problems.append(
                f'--at {name}: {source}"{quantity.text}" is not on the grid; '
                f"the nearest value is {axis_label(dataset, name, at)}"
            )
    for name in set(point) - set(axes):
        own = case.quantities.get(name)
        if own is None or not np.isclose(own.value, point[name].value, rtol=SAME, atol=0):
            has = f"the case has {own.text}" if own else "the case does not give it"
            problems.append(f'--at {name}: not swept in this result, {has} (got "{point[name].text}")')
    if problems:
        raise InputError(*sorted(problems))
    return indices


def _closest(values: np.ndarray, value: float) -> int:
    if np.isinf(value) or np.any(values == value):
        return int(np.argmax(values == value)) if np.any(values == value) else int(values.size - 1)
    with np.errstate(divide="ignore"):
        return int(np.argmin(np.abs(np.log(values / value))))
