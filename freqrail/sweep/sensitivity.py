"""How much a response changes with each parameter: elasticities of RMS values, per cent for one per cent."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.axis import Axis, parse_axis
from freqrail.case.case import Case, load_case
from freqrail.case.parameters import PARAMETERS
from freqrail.errors import InputError
from freqrail.model.elements import Values
from freqrail.result.axes import POINT_SPEED
from freqrail.result.labels import attributes, coordinate, position_coordinates
from freqrail.result.layout import response_names
from freqrail.result.points import Point
from freqrail.solver.gradient_solve import SPEED, RmsGradient, rms_gradients
from freqrail.sweep.gradients import differentiable, parameters_of, slope_of_case

Array = NDArray[np.float64]


def sensitivity(
    case: Case | str | os.PathLike[str], at: Point | None = None, responses: str | Sequence[str] = "paper"
) -> xr.Dataset:
    """Elasticities of every response by every parameter of a case, at a point and over the case's speeds.

    case: a `Case`, a case file's path or a shipped case's name. at: the point (see `points.parse_point`); what it
    leaves out takes the case's own value. A speed in it leaves the case's axis of speeds out of the result.
    responses: as of `sweep`.

    Returns a dataset with `<response>_rms` and `<response>_rms_elasticity`, d ln RMS/d ln parameter, over the
    dimension `parameter`, `speed` and the response's own, and `<response>_rms_elasticity_error`, its estimated error
    (absolute, numerical only). A rigid joint has the elasticity 0. Where the contact stiffness follows from the contact
    constant (eq. 1), masses change it too. Raises InputError for an unknown response or point.
    """
    loaded = case if isinstance(case, Case) else load_case(case)
    one, speeds = _at(loaded, at or {})
    names = response_names(responses, one.vocabulary)
    problem, wanted = differentiable(one, names, speeds.si)
    found = rms_gradients(problem, (*wanted, SPEED))
    parameters = parameters_of(one)
    variables: dict[str, Any] = {}
    for name in names:
        response, place = one.vocabulary.responses[name], one.vocabulary.place(name)
        rms = found[name].rms
        elastic = [_elasticity(found[name], one, problem.values, key, speeds.si) for key in parameters]
        tables = [np.stack([each[i] for each in elastic]) for i in (0, 1)]
        dims = ("parameter", "speed", *place)
        variables[f"{name}_rms"] = (
            dims[1:],
            _placed(rms, bool(place)),
            {"units": response.unit, "long_name": f"RMS of the {response.long_name}"},
        )
        words = f"elasticity of the RMS of the {response.long_name}: per cent for one per cent of a parameter"
        variables[f"{name}_rms_elasticity"] = (
            dims,
            _placed(tables[0], bool(place)),
            {"units": "1", "long_name": words},
        )
        variables[f"{name}_rms_elasticity_error"] = (
            dims,
            np.abs(_placed(tables[1], bool(place))),
            {"units": "1", "long_name": f"estimated error of the {words}, absolute; numerical only"},
        )
    used = {one.vocabulary.responses[name].dimension for name in names} - {""}
    coordinates: dict[str, Any] = {
        "parameter": ("parameter", list(parameters), {"long_name": "parameter of the case"}),
        "parameter_value": (
            "parameter",
            [one.quantities[name].text for name in parameters],
            {"long_name": "value of the parameter at the point"},
        ),
        "parameter_meaning": (
            "parameter",
            [one.meaning(name) for name in parameters],
            {"long_name": "meaning"},
        ),
        **coordinate(speeds, one),
        **position_coordinates(used, one.vocabulary),
    }
    here = parse_axis(PARAMETERS["speed"], one.quantities["speed"].text).values[0]
    return xr.Dataset(variables, coordinates, attributes(one, "sensitivity") | {POINT_SPEED: float(here)})


def _at(case: Case, point: Point) -> tuple[Case, Axis]:
    """The case at a point, without axes, and its speeds as an axis."""
    unknown = [name for name in point if name not in case.scalars]
    if unknown:
        raise InputError(f"--at {unknown[0]}: the case does not give it; it has {', '.join(case.quantities)}")
    derived = [name for name in point if name not in case.quantities]
    if derived:
        raise InputError(f"--at {derived[0]}: follows from the case's other values; set them instead")
    quantities = {name: point.get(name, quantity) for name, quantity in case.quantities.items()}
    axis = next((axis for axis in case.axes if axis.name == "speed"), None)
    if axis is None or "speed" in point:
        axis = parse_axis(PARAMETERS["speed"], quantities["speed"].text)
    return replace(case, quantities=quantities, axes=(), samples=None), axis


Elasticity = tuple[Array, Array]
"""Values and errors, [labels, speeds] each."""


def _elasticity(gradient: RmsGradient, one: Case, values: Values, name: str, speed: Array) -> Elasticity:
    """d ln RMS/d ln parameter; 0 by a rigid joint."""
    value = speed if name == SPEED else np.asarray(one.quantities[name].value)
    slope, error = slope_of_case(gradient, one, values, name)
    scale = np.where(np.isinf(value), 0.0, value) / gradient.rms
    return slope * scale, error * np.abs(scale)


def _placed(values: NDArray, place: bool) -> NDArray:
    """[..., labels, speeds] as [..., speeds, labels], or without labels."""
    return np.moveaxis(values, -2, -1) if place else values[..., 0, :]
