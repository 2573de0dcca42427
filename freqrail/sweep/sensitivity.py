"""How much a response changes with each parameter: elasticities of RMS values, per cent for one per cent."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.axis import Axis, parse_axis
from freqrail.case.case import Case, load_case
from freqrail.case.described import HALF
from freqrail.case.parameters import PARAMETERS
from freqrail.errors import InputError
from freqrail.model.derived import followers, slopes
from freqrail.model.elements import Values
from freqrail.reduction.columns import reduce
from freqrail.result.axes import POINT_SPEED
from freqrail.result.labels import attributes, coordinate, position_coordinates
from freqrail.result.layout import response_names
from freqrail.result.points import Point
from freqrail.solver.block_slopes import lengths_free
from freqrail.solver.gradient_solve import SPEED, RmsGradient, rms_gradients
from freqrail.solver.problem import Problem, half_vehicle_problem

Array = NDArray[np.float64]

LOADS = {"car_body_mass": 1 / 4, "bogie_mass": 1 / 2, "wheelset_mass": 1.0}
"""What of a mass the static load of one wheel holds (below eq. 1)."""


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
    problem, wanted = _problem(one, names, speeds.si)
    found = rms_gradients(problem, (*wanted, SPEED))
    parameters = _parameters(one)
    variables: dict[str, Any] = {}
    for name in names:
        response, place = one.vocabulary.responses[name], one.vocabulary.place(name)
        rms = found[name].rms
        elastic = _elasticities(found[name], problem.values, speeds.si)
        tables = [np.stack([_of_case(elastic, one, key)[i] for key in parameters]) for i in (0, 1)]
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
        "parameter": ("parameter", parameters, {"long_name": "parameter of the case"}),
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


def _problem(one: Case, names: tuple[str, ...], speeds: Array) -> tuple[Problem, list[str]]:
    """The vehicle of a case as a problem that can be differentiated, and by what."""
    if one.described == HALF:
        own = [name for name in one.quantities if name not in ("contact_constant", "speed")]
        wanted = [*dict.fromkeys((*own, "contact_stiffness"))]
        return half_vehicle_problem(one.vehicle, speeds, one.spectrum, one.band, names), wanted
    described, values = one.described, one.values()
    outputs = tuple(output for output in described.readings.outputs if output.name in names)
    wanted = list(described.system.parameters)
    reduction = reduce(described.system, outputs, lengths_free(values, wanted))
    return Problem(reduction, {name: values[name] for name in wanted}, speeds, one.spectrum, one.band), wanted


def _parameters(one: Case) -> list[str]:
    """Names of what the case gives and the vehicle hangs on, in the order of the case; the speed last."""
    if one.is_half_vehicle:
        return [name for name in PARAMETERS if name in one.quantities]
    own = {*one.described.system.parameters}
    own |= {name for needs in followers(one.described.derived).values() for name in needs}
    return [name for name in one.quantities if name in own or name == SPEED]


Elasticity = tuple[Array, Array]
"""Values and errors, [labels, speeds] each."""


def _elasticities(gradient: RmsGradient, values: Values, speed: Array) -> dict[str, Elasticity]:
    """By every parameter that was differentiated by; 0 by a rigid joint."""
    result = {}
    for name, slope in gradient.slopes.items():
        value = speed if name == SPEED else np.asarray(values[name])
        scale = np.where(np.isinf(value), 0.0, value) / gradient.rms
        result[name] = (slope.value * scale, slope.error * np.abs(scale))
    return result


def _of_case(elastic: Mapping[str, Elasticity], case: Case, name: str) -> Elasticity:
    """By a parameter of the case, which may change the contact stiffness too: K_H = 1.5 P0^(1/3)/G (eq. 1)."""
    if not case.is_half_vehicle:
        return _of_free_case(elastic, case, name)
    contact, contact_error = elastic["contact_stiffness"]
    if name == "contact_constant":
        return -contact, contact_error
    value, error = elastic[name]
    if name in LOADS and "contact_constant" in case.quantities:
        loads = {mass: factor * case.quantities[mass].value for mass, factor in LOADS.items()}
        share = loads[name] / sum(loads.values()) / 3
        return value + share * contact, error + share * contact_error
    return value, error


def _of_free_case(elastic: Mapping[str, Elasticity], case: Case, name: str) -> Elasticity:
    """By a parameter of a free vehicle, and by what follows from it: masses of modes, shapes at a place, contacts."""
    if name == SPEED:
        return elastic[SPEED]
    described = case.described
    values = {key: quantity.value for key, quantity in case.quantities.items() if key != SPEED}
    whole = described.values(values)
    nothing = np.zeros_like(next(iter(elastic.values()))[0])
    value, error = elastic.get(name, (nothing, nothing))
    for target, slope in slopes(described.derived, values, name).items():
        share = slope * values[name] / float(whole[target]) if whole[target] else 0.0
        if target in elastic:
            value, error = value + share * elastic[target][0], error + abs(share) * elastic[target][1]
    return value, error


def _placed(values: NDArray, place: bool) -> NDArray:
    """[..., labels, speeds] as [..., speeds, labels], or without labels."""
    return np.moveaxis(values, -2, -1) if place else values[..., 0, :]
