"""The half vehicle: its numbers, and the bodies and suspension legs they stand for.

Every model of the package is a `System`: bodies with masses, joined by suspension legs, each a
spring beside a damper that sits between two rubber joints. The paper's 26-state model, the
traditional 20-state model (rigid joints) and the three decoupled chains come from that one
description, and a leg may differ from its neighbour.

Source: Y. Yu, Y. Song, L. Zhao, C. Zhou, "Numerical Investigation on Train Vertical Dynamics with
Damper Rubber Joint Stiffness", called "the paper" throughout; equation numbers are the paper's.
Two signs of eq. (4) are corrected here: `+K_sd (z_t1 - z_sd2)` in the front bogie's bounce and
`+K_pd (z_t2 + L_t beta_t2 - z_pd7)` in the rear bogie's bounce must both be minus, or the stiffness
matrix is not symmetric and action and reaction do not cancel.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from freqrail.model.equations import Leg, System
from freqrail.model.variants import TRADITIONAL
from freqrail.types import Number

GRAVITY = 9.8
"""Acceleration of gravity of eq. (1), m/s^2 (the paper's value, not the standard 9.80665)."""

DEGREES_OF_FREEDOM = ("z_c", "beta_c", "z_t1", "beta_t1", "z_w1", "z_w2", "z_t2", "beta_t2", "z_w3", "z_w4")
"""The order of q, as in the paper's state vector below eq. (9)."""


@dataclass(frozen=True)
class Vehicle:
    """The numbers of a half vehicle, front and rear alike, in SI units.

    Fields bear the names of the case file's [vehicle] table. Each is a float or an array; arrays
    broadcast against each other, which is how one object carries a whole grid of vehicles.

    Units: masses kg, pitch inertias kg m^2, stiffnesses N/m, dampings N s/m, lengths m.
    The half vehicle is one side of the vehicle: half of the masses and inertias, and of the suspension what stands on
    that side. `primary_stiffness` and `primary_damping` are those of one side of one axle, `secondary_*` those of one
    side of one bogie; a joint stiffness is that of each of the damper's two joints, `inf` for a rigid one.
    """

    car_body_mass: Number
    car_body_pitch_inertia: Number
    bogie_mass: Number
    bogie_pitch_inertia: Number
    wheelset_mass: Number
    primary_stiffness: Number
    primary_damping: Number
    primary_joint_stiffness: Number
    secondary_stiffness: Number
    secondary_damping: Number
    secondary_joint_stiffness: Number
    half_bogie_spacing: Number
    half_wheelbase: Number
    contact_stiffness: Number

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid of vehicles that the fields span; () for a single vehicle."""
        return np.broadcast_shapes(*(np.shape(getattr(self, f.name)) for f in fields(self)))

    def map(self, function: Any) -> Vehicle:
        """The vehicle with `function` applied to every field."""
        return Vehicle(**{f.name: function(getattr(self, f.name)) for f in fields(self)})

    def column(self) -> Vehicle:
        """The grid of vehicles with one more, last axis, along which frequencies or poles can broadcast."""
        return self.map(lambda field: np.asarray(field)[..., None] if np.ndim(field) else field)

    def at(self, index: tuple[int, ...]) -> Vehicle:
        """The single vehicle at `index` of the grid `shape`, fields as floats."""
        return self.map(lambda field: float(np.broadcast_to(field, self.shape)[index]))

    def traditional(self) -> Vehicle:
        """The vehicle with rigid damper joints: the traditional model of the paper's fig. 1."""
        return replace(self, **TRADITIONAL.values)


def static_wheel_load(car_body_mass: Number, bogie_mass: Number, wheelset_mass: Number) -> Number:
    """Static load P0 of one wheel, N; masses in kg. Below eq. (1): P0 = (M_c/4 + M_t/2 + M_w) g."""
    return (car_body_mass / 4 + bogie_mass / 2 + wheelset_mass) * GRAVITY


def hertzian_contact_stiffness(contact_constant: Number, wheel_load: Number) -> Number:
    """Linear contact stiffness K_H = 1.5 P0^(1/3) / G, N/m (eq. 1).

    `contact_constant` is G in m/N^(2/3), `wheel_load` is P0 in N.
    """
    return 1.5 * np.cbrt(wheel_load) / contact_constant


def half_vehicle(vehicle: Vehicle) -> System:
    """The paper's half vehicle (eqs. 3 to 7, signs of eq. 4 corrected) as bodies and legs.

    Takes a single vehicle (no arrays); returns 10 freedoms, 6 legs and 4 contacts. Legs are in the
    paper's order: secondary front, rear, primary 1 to 4.
    """
    a, b = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    ends = {
        "secondary_1": {"z_c": 1, "beta_c": -a, "z_t1": -1},
        "secondary_2": {"z_c": 1, "beta_c": a, "z_t2": -1},
        "primary_1": {"z_t1": 1, "beta_t1": -b, "z_w1": -1},
        "primary_2": {"z_t1": 1, "beta_t1": b, "z_w2": -1},
        "primary_3": {"z_t2": 1, "beta_t2": -b, "z_w3": -1},
        "primary_4": {"z_t2": 1, "beta_t2": b, "z_w4": -1},
    }

    def leg(name: str) -> Leg:
        stage = name.split("_")[0]
        row = tuple(float(ends[name].get(freedom, 0.0)) for freedom in DEGREES_OF_FREEDOM)
        return Leg(
            name,
            row,
            getattr(vehicle, f"{stage}_stiffness"),
            getattr(vehicle, f"{stage}_damping"),
            getattr(vehicle, f"{stage}_joint_stiffness"),
        )

    bogie = (vehicle.bogie_mass, vehicle.bogie_pitch_inertia, vehicle.wheelset_mass, vehicle.wheelset_mass)
    wheels = [i for i, freedom in enumerate(DEGREES_OF_FREEDOM) if freedom.startswith("z_w")]
    return System(
        freedoms=DEGREES_OF_FREEDOM,
        inertia=(vehicle.car_body_mass, vehicle.car_body_pitch_inertia, *bogie, *bogie),
        legs=tuple(leg(name) for name in ends),
        contacts=tuple((wheel, vehicle.contact_stiffness) for wheel in wheels),
    )
