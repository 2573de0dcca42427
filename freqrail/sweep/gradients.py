"""Slopes of RMS values by the parameters of a case, at a point and over the grid of a sweep.

The kernel differentiates by the numbers of the vehicle's system; a case's own quantities may be shares of them (whole
vehicles), or others may follow from them: the contact stiffness from the static load, modal masses, mode shapes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.case.case import Case, share
from freqrail.case.described import HALF
from freqrail.case.parameters import PARAMETERS, nearest_name
from freqrail.case.quantities import Quantity
from freqrail.case.samples import SAMPLE
from freqrail.errors import InputError
from freqrail.model.derived import followers, slopes
from freqrail.reduction.columns import reduce
from freqrail.solver.block_slopes import lengths_free
from freqrail.solver.gradient_solve import SPEED, RmsGradient, rms_gradients
from freqrail.solver.problem import Problem, half_vehicle_problem

Array = NDArray[np.float64]

Slope = tuple[Array, Array]
"""Values and errors, [labels, speeds] each, in a response's unit over a parameter's SI unit."""

LOADS = {"car_body_mass": 1 / 4, "bogie_mass": 1 / 2, "wheelset_mass": 1.0}
"""What of a mass the static load of one wheel holds (below eq. 1)."""


def parameters_of(case: Case) -> tuple[str, ...]:
    """Names of what the case gives and the vehicle hangs on; of a free vehicle in the order of the case."""
    if case.is_half_vehicle:
        return tuple(name for name in PARAMETERS if name in case.quantities)
    own = {*case.described.system.parameters}
    own |= {name for needs in followers(case.described.derived).values() for name in needs}
    return tuple(name for name in case.quantities if name in own or name == SPEED)


def parameter_names(case: Case, wanted: str | Sequence[str]) -> tuple[str, ...]:
    """Names of parameters from "all", "NAME,NAME" or a sequence of names, each once. Raises InputError for others."""
    known = parameters_of(case)
    given = [part.strip() for part in wanted.split(",") if part.strip()] if isinstance(wanted, str) else list(wanted)
    if isinstance(wanted, str) and wanted and not given:
        raise InputError('--gradients: is empty; names of parameters are expected, or "all"')
    names = [*known] if given == ["all"] else [name.replace(".", "_") for name in given]
    faults = [
        f"--gradients: unknown parameter {name!r}{nearest_name(name, (*known, 'all'))}"
        for name in names
        if name not in known
    ]
    if faults:
        raise InputError(*faults)
    return tuple(dict.fromkeys(names))


def differentiable(one: Case, names: tuple[str, ...], speeds: Array) -> tuple[Problem, list[str]]:
    """The vehicle of a case without axes as a problem that can be differentiated, and by what."""
    if one.described == HALF:
        own = [name for name in one.quantities if name not in ("contact_constant", SPEED)]
        wanted = [*dict.fromkeys((*own, "contact_stiffness"))]
        return half_vehicle_problem(one.vehicle, speeds, one.spectrum, one.band, names), wanted
    described, values = one.described, one.values()
    outputs = tuple(output for output in described.readings.outputs if output.name in names)
    wanted = list(described.system.parameters)
    reduction = reduce(described.system, outputs, lengths_free(values, wanted))
    return Problem(reduction, {name: values[name] for name in wanted}, speeds, one.spectrum, one.band), wanted


def slope_of_case(gradient: RmsGradient, one: Case, values: Mapping[str, Any], name: str) -> Slope:
    """By a parameter of a case as the case has it. values: the numbers of the system. A rigid joint's is 0."""
    found = {key: (slope.value, slope.error) for key, slope in gradient.slopes.items()}
    if name == SPEED:
        return found[SPEED]
    total = [np.zeros_like(gradient.rms), np.zeros_like(gradient.rms)]
    for key, factor in _factors(one, values, name).items():
        if key in found and factor:
            total[0] = total[0] + factor * found[key][0]
            total[1] = total[1] + abs(factor) * found[key][1]
    return total[0], total[1]


def _factors(one: Case, values: Mapping[str, Any], name: str) -> dict[str, float]:
    """By how much the system's numbers change with a parameter of the case: {number: derivative}."""
    if not one.is_half_vehicle:
        own = {key: quantity.value for key, quantity in one.quantities.items() if key != SPEED}
        return {name: 1.0, **slopes(one.described.derived, own, name)}
    own = {name: share(name, one.masses)}
    if "contact_constant" not in one.quantities:
        return own
    stiffness = float(values["contact_stiffness"])  # K_H = 1.5 P0^(1/3)/G (eq. 1)
    if name == "contact_constant":
        return {"contact_stiffness": -stiffness / one.quantities[name].value}
    if name in LOADS:
        load = sum(factor * one.quantities[mass].value for mass, factor in LOADS.items())
        own["contact_stiffness"] = stiffness * LOADS[name] / load / 3
    return own


def grid_gradients(
    case: Case,
    names: tuple[str, ...],
    wanted: tuple[str, ...],
    cell: tuple[slice, ...],
    fixed: Collection[str] = (),
) -> dict[str, tuple[Array, Array]]:
    """Slopes of a part of a case's grid: {response: (values, errors)}, [labels, vehicles..., speeds, parameters].

    cell: of the axes other than speed. Each vehicle is differentiated by itself, so that no cut changes a bit. fixed:
    what a variant fixes, so that the case's own value changes nothing: 0.
    """
    axes = [axis for axis in case.axes if axis.name != SPEED]
    speeds = case.speeds()
    shape = tuple(part.stop - part.start for part in cell)
    result: dict[str, tuple[Array, Array]] = {}
    for index in np.ndindex(shape):
        place = tuple(part.start + i for part, i in zip(cell, index, strict=True))
        one = _at(case, [replace(a, values=a.values[[i]], si=a.si[[i]]) for a, i in zip(axes, place, strict=True)])
        problem, numbers = differentiable(one, names, speeds)
        with np.errstate(all="ignore"):
            found = rms_gradients(problem, (*numbers, SPEED))
        for name in names:
            labels = found[name].rms.shape[0]
            if name not in result:
                empty = np.empty((labels, *shape, speeds.size, len(wanted)))
                result[name] = empty, empty.copy()
            for k, parameter in enumerate(wanted):
                slope = slope_of_case(found[name], one, problem.values, parameter)
                if parameter in fixed:
                    slope = np.zeros_like(slope[0]), np.zeros_like(slope[1])
                for target, numbers_of in zip(result[name], slope, strict=True):
                    target[(slice(None), *index, slice(None), k)] = numbers_of
    return result


def _at(case: Case, axes: Sequence[Any]) -> Case:
    """The case at one value of every axis other than speed."""
    columns = [axis for axis in axes if axis.name != SAMPLE]
    for axis in axes:
        if axis.name == SAMPLE and case.samples:
            columns += case.samples.at(axis.values).columns
    changed = {c.name: Quantity(float(c.si[0]), f"{float(c.si[0])!r}") for c in columns}
    quantities = {**case.quantities, **changed}
    if "contact_stiffness" in changed:
        quantities.pop("contact_constant", None)
    return replace(case, quantities=quantities, axes=(), samples=None)
