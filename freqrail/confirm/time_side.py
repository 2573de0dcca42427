"""The time side of a point: state spaces of its models, and what reads the responses off them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.confirm.crosschecks import transfer_power
from freqrail.confirm.simulated import Simulated, time_model, wheel_lags
from freqrail.model.equations import StateSpace, System, state_space
from freqrail.model.responses import PAPER
from freqrail.model.spectrum import Spectrum
from freqrail.model.variants import DEFAULT
from freqrail.model.vehicle import DEGREES_OF_FREEDOM, Vehicle, half_vehicle

OWN = "joint"
"""What a confirmation calls the half vehicle itself; variants go by their names."""

OWN_FREE = "the vehicle"
"""The same of a vehicle of the free form; no variant can have this name."""


@dataclass(frozen=True)
class OperatingPoint:
    """A grid point, SI units. key: its values as text, which its random numbers are keyed by.

    twins: what the variants make of the vehicle, (name, vehicle) each; None for the half vehicle's default ones. own:
    what the vehicle itself is called.
    """

    vehicle: Simulated
    speed: float
    spectrum: Spectrum
    key: str
    twins: tuple[tuple[str, Simulated], ...] | None = None
    own: str = OWN


@dataclass(frozen=True)
class TimeSide:
    """The time side of a point: state spaces and what reads the responses off them, by model, and the wheels' lags.

    readout: [series, states] a model, feedthrough: [series, wheels], of the track heights. lags: [wheels], s. rates:
    [series, wheels], of the heights' rates, of the models that feel these at once, a contact having a damper.
    """

    models: dict[str, StateSpace]
    readout: dict[str, NDArray[np.float64]]
    feedthrough: dict[str, NDArray[np.float64]]
    lags: NDArray[np.float64]
    rates: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


def readout(
    system: System, model: StateSpace, vehicle: Vehicle, names: tuple[str, ...] = PAPER
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """C [series, states] and D [series, wheels]: the responses of a half vehicle are C x + D v (signs as in `vehicle`).

    x: the states, v: the track heights under the wheels, m, which only the wheelsets' accelerations feel at once.
    """
    unit = dict(zip(DEGREES_OF_FREEDOM, np.eye(len(system.freedoms)), strict=True))
    arm = vehicle.half_bogie_spacing
    accelerated = {
        # over the front pivot, at the centre, over the rear pivot
        "car_body_acceleration": [unit["z_c"] + place * unit["beta_c"] for place in (-arm, 0.0, arm)],
        "bogie_acceleration": [unit["z_t1"], unit["z_t2"]],
        "wheelset_acceleration": [unit[f"z_w{axle}"] for axle in (1, 2, 3, 4)],
        "car_body_pitch_acceleration": [unit["beta_c"]],
        "bogie_pitch_acceleration": [unit["beta_t1"], unit["beta_t2"]],
    }
    n, states = len(system.freedoms), len(model.states)
    rows, feedthrough = [], []
    for name in names:
        if name in accelerated:
            q = np.array(accelerated[name])
            rows.append(q @ model.a[:n])
            feedthrough.append(q @ model.b[:n])
            continue
        stage = name.removesuffix("_stroke")
        legs = np.array([leg.elongation for leg in system.legs if leg.name.startswith(stage)])
        rows.append(np.hstack([np.zeros((len(legs), states - n)), legs]))
        feedthrough.append(np.zeros((len(legs), model.b.shape[1])))
    return np.vstack(rows), np.vstack(feedthrough)


def time_side(point: OperatingPoint, names: tuple[str, ...] = PAPER) -> TimeSide:
    """The simulated side of a point, without any fault."""
    models, rows, feedthrough, rates = {}, {}, {}, {}
    for name, vehicle in vehicles(point).items():
        if isinstance(vehicle, Vehicle):
            system = half_vehicle(vehicle)
            models[name] = state_space(system)
            rows[name], feedthrough[name] = readout(system, models[name], vehicle, names)
        else:
            models[name], rows[name], feedthrough[name], rate = time_model(vehicle, names)
            if rate.any():
                rates[name] = rate
    return TimeSide(models, rows, feedthrough, wheel_lags(point.vehicle, point.speed), rates)


def vehicles(point: OperatingPoint) -> dict[str, Simulated]:
    """The vehicle of a point by model: its own and those of the variants."""
    twins = point.twins
    if twins is None:
        if not isinstance(point.vehicle, Vehicle):
            raise ValueError("the default variants are those of a half vehicle")
        twins = tuple((variant.name, replace(point.vehicle, **variant.values)) for variant in DEFAULT)
    return {point.own: point.vehicle, **dict(twins)}


def line_power(point: OperatingPoint, names: tuple[str, ...], frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """|T|^2 of the named responses of all models at `frequency` [K] in Hz, from the FRFs: [model, series, K]."""
    return np.array([transfer_power(vehicle, names, point.speed, frequency) for vehicle in vehicles(point).values()])
