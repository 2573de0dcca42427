"""What a confirmation simulates: the paper's half vehicle, or any system of one vehicle's numbers.

The frequency side of both is told here, and what both sides share: the wheels' lags, loads and contact springs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from freqrail.model import assembled, inputs
from freqrail.model.band import Band
from freqrail.model.elements import Spring
from freqrail.model.equations import StateSpace
from freqrail.model.outputs import Output
from freqrail.model.spectrum import Spectrum
from freqrail.model.statics import wheel_loads
from freqrail.model.system import System, alike, evaluate
from freqrail.model.vehicle import Vehicle, static_wheel_load
from freqrail.reduction.columns import Reduction, reduce
from freqrail.solver.problem import Problem, half_vehicle_problem
from freqrail.solver.vehicle_poles import half_vehicle_poles, vehicle_poles


@dataclass(frozen=True)
class AnyVehicle:
    """A vehicle that is no half vehicle, in numbers. values: of all its parameters, floats in SI units; outputs: what
    is read off it."""

    system: System
    values: Mapping[str, float]
    outputs: tuple[Output, ...]

    @cached_property
    def reduction(self) -> Reduction:
        """Its blocks and columns, as a sweep computes with them."""
        return reduce(alike(self.system, self.values), self.outputs, self.values)


Simulated = Vehicle | AnyVehicle


def time_model(
    vehicle: AnyVehicle, names: tuple[str, ...]
) -> tuple[StateSpace, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """dx/dt = A x + B v, and C [series, states], D, D' [series, wheels]: responses are C x + D v + D' dv/dt.

    From the laws' realisations: nothing of the reduction. D' is zero unless a contact has a damper of its own. Raises
    ValueError as `assembled.state_space` does.
    """
    known = {output.name: output for output in vehicle.outputs}
    model = assembled.state_space(vehicle.system, vehicle.values)
    rows = assembled.readout(vehicle.system, vehicle.values, tuple(known[name] for name in names), model)
    model, rows = assembled.without_rates(model, rows)
    return StateSpace(model.a, model.b, model.states), rows.c, rows.d, rows.d_rate


def wheel_lags(vehicle: Simulated, speed: float) -> NDArray[np.float64]:
    """Lags [wheels] of the wheels behind the first, s; speed in m/s."""
    if isinstance(vehicle, Vehicle):
        return inputs.wheel_lags(vehicle, speed)
    places = np.array([float(evaluate(wheel.place, vehicle.values)) for wheel in vehicle.system.wheels])
    return np.asarray((places[0] - places) / speed)


def poles(vehicle: Simulated) -> NDArray[np.complex128]:
    """Poles, rad/s, with their conjugates, equal blocks' once; NaN for a block whose numbers overflow."""
    if isinstance(vehicle, Vehicle):
        return half_vehicle_poles(vehicle)
    own = vehicle.reduction
    return vehicle_poles(own.lengths, own.blocks, vehicle.values)


def kernel_problem(
    vehicle: Simulated, speed: NDArray[np.float64], spectrum: Spectrum, band: Band | None, names: tuple[str, ...]
) -> Problem:
    """What a sweep solves of one vehicle; names: of the responses."""
    if isinstance(vehicle, Vehicle):
        return half_vehicle_problem(vehicle, speed, spectrum, band, names)
    reduction = vehicle.reduction.only(names)
    values = {name: vehicle.values[name] for name in reduction.system.parameters}
    return Problem(reduction, values, speed, spectrum, band)


def static_loads(vehicle: Simulated) -> NDArray[np.float64]:
    """Static load of a wheel, N: [] of the half vehicle, whose wheels are loaded alike, else [wheels]."""
    if isinstance(vehicle, Vehicle):
        load = static_wheel_load(vehicle.car_body_mass, vehicle.bogie_mass, vehicle.wheelset_mass)
        return np.asarray(load, dtype=float)
    return wheel_loads(vehicle.system, vehicle.values)


def contact_stiffnesses(vehicle: Simulated) -> NDArray[np.float64]:
    """Stiffness of the contact springs, N/m: [] of the half vehicle, else [wheels], NaN for a contact that is none."""
    if isinstance(vehicle, Vehicle):
        return np.asarray(vehicle.contact_stiffness, dtype=float)
    contacts = [wheel.contact for wheel in vehicle.system.wheels]
    return np.array([vehicle.values[law.name] if isinstance(law, Spring) else np.nan for law in contacts])
