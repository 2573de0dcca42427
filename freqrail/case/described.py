"""What the vehicle of a case is: its system of names, what is read off it, and the numbers that only that needs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from freqrail.case.free_vehicle import FreeVehicle, read_free_vehicle
from freqrail.case.kinds import Read
from freqrail.case.leaves import Leaves
from freqrail.case.outputs import read_outputs
from freqrail.case.parameters import PARAMETERS, VARIABLE, Parameter
from freqrail.case.quantities import Quantity
from freqrail.model.derived import Derived, complete
from freqrail.model.half_vehicle import BODIES, SUSPENSIONS, half_vehicle, outputs
from freqrail.model.readings import Readings, joined, usual_readings
from freqrail.model.responses import HALF_VEHICLE
from freqrail.model.system import System
from freqrail.types import Number


@dataclass(frozen=True)
class Described:
    """A vehicle. variable: what may vary, by name. free: None if it is the half vehicle. stations: numbers that only
    outputs need, SI."""

    system: System
    readings: Readings
    variable: Mapping[str, Parameter]
    free: FreeVehicle | None = None
    stations: Mapping[str, Number] = field(default_factory=dict)

    @property
    def derived(self) -> tuple[Derived, ...]:
        """Numbers that follow from others, in an order in which they can."""
        return (*(self.free.derived if self.free else ()), *self.readings.derived)

    def values(self, own: Mapping[str, Number]) -> dict[str, Number]:
        """All numbers by name, SI, from those that may vary."""
        found = self.free.values(own) if self.free else dict(own)
        return complete({**self.stations, **found}, self.readings.derived)


HALF = Described(half_vehicle(), Readings(outputs(), HALF_VEHICLE), VARIABLE)
"""The half vehicle without outputs of the user's own."""


def describe_template(
    tables: Mapping[str, Any],
    quantities: Mapping[str, Quantity],
    where: Callable[..., str],
    problems: list[str],
    warned: list[str],
) -> Described:
    """The half vehicle with the outputs of a case; its parameters may stand in their places."""
    if "outputs" not in tables or not {*HALF.system.lengths} <= quantities.keys():  # else the case is at fault anyway
        return HALF
    leaves = Leaves(where, problems)
    leaves.known = {
        name: Read(quantity, PARAMETERS[name].kind)
        for name, quantity in quantities.items()
        if PARAMETERS[name].section == "vehicle"
    }
    bodies = BODIES
    wheels = [wheel.name for wheel in HALF.system.wheels]
    own = read_outputs(tables["outputs"], leaves, bodies, SUSPENSIONS, wheels, tuple(HALF_VEHICLE.responses), warned)
    extra = {name: value for name, value in leaves.numbers().items() if name not in VARIABLE}
    system = replace(HALF.system, stations=(*extra, *(each.name for each in own.derived)))
    return Described(system, joined([HALF.readings, own]), VARIABLE, None, extra)


def _keys(tables: Mapping[str, Any], name: str) -> Collection[str]:
    found = tables.get(name, {})
    return found if isinstance(found, dict) else ()


def describe_free(
    tables: Mapping[str, Any],
    where: Callable[..., str],
    problems: list[str],
    warned: list[str],
    own: Collection[str] = (),
) -> tuple[Described | None, Leaves]:
    """The vehicle of a free case, None if something is wrong with it, and its values as read."""
    vehicle, leaves, bodies = read_free_vehicle(tables, where, problems, own)
    if vehicle is None:  # its outputs are judged as far as they can be
        names = {key: dict.fromkeys(_keys(tables, key), key) for key in ("bodies", "wheels", "suspensions")}
        legs = {name: name for name in names["suspensions"]}
        read_outputs(tables.get("outputs", {}), leaves, bodies, legs, names["wheels"], (), warned, names["bodies"])
        return None, leaves
    wheels = [wheel.name for wheel in vehicle.system.wheels]
    usual = usual_readings(vehicle.bodies, vehicle.suspensions, wheels)
    legs = {leg.name: leg.name for leg in vehicle.system.legs if leg.name not in vehicle.bent}
    before = {*leaves.used}
    read = read_outputs(
        tables.get("outputs", {}), leaves, vehicle.bodies, legs, wheels, tuple(usual.vocabulary.responses), warned
    )
    readings = joined([usual, read])
    lengths = {*vehicle.system.lengths}
    stations = [name for name in (*leaves.used, *(each.name for each in readings.derived)) if name not in before]
    stations += [each.name for each in readings.derived if each.name in before]
    system = replace(vehicle.system, stations=tuple(name for name in dict.fromkeys(stations) if name not in lengths))
    whole = replace(vehicle, quantities=leaves.quantities(), parameters=leaves.parameters())
    return Described(system, readings, {**whole.parameters, "speed": PARAMETERS["speed"]}, whole), leaves
