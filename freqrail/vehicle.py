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
from numpy.typing import NDArray

from freqrail.types import Number

GRAVITY = 9.8
"""Acceleration of gravity of eq. (1), m/s^2 (the paper's value, not the standard 9.80665)."""

DEGREES_OF_FREEDOM = ("z_c", "beta_c", "z_t1", "beta_t1", "z_w1", "z_w2", "z_t2", "beta_t2", "z_w3", "z_w4")
"""The order of q, as in the paper's state vector below eq. (9)."""

CHAINS = ("bounce", "pitch", "bogie_pitch")


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
        return replace(self, primary_joint_stiffness=np.inf, secondary_joint_stiffness=np.inf)


def static_wheel_load(car_body_mass: Number, bogie_mass: Number, wheelset_mass: Number) -> Number:
    """Static load P0 of one wheel, N; masses in kg. Below eq. (1): P0 = (M_c/4 + M_t/2 + M_w) g."""
    return (car_body_mass / 4 + bogie_mass / 2 + wheelset_mass) * GRAVITY


def hertzian_contact_stiffness(contact_constant: Number, wheel_load: Number) -> Number:
    """Linear contact stiffness K_H = 1.5 P0^(1/3) / G, N/m (eq. 1).

    `contact_constant` is G in m/N^(2/3), `wheel_load` is P0 in N.
    """
    return 1.5 * np.cbrt(wheel_load) / contact_constant


def leg_dynamic_stiffness(stiffness: Number, damping: Number, joint_stiffness: Number, s: Number) -> Number:
    """Dynamic stiffness D(s) of a suspension leg, N/m: force over elongation, both complex.

    D = k + c s / (1 + c s / kappa) with kappa = K_d / 2, two equal joints K_d in series (from
    eqs. 6 and 7 with the damper's ends eliminated). Arguments broadcast: `stiffness` k and
    `joint_stiffness` K_d in N/m (inf: rigid), `damping` c in N s/m, `s` in rad/s.
    """
    viscous = damping * s
    return stiffness + viscous / (1.0 + viscous * (2.0 / joint_stiffness))


@dataclass(frozen=True)
class Leg:
    """One suspension leg: a spring in parallel with a damper between two rubber joints.

    `elongation` is the row that maps q to the leg's elongation, upper end minus lower end.
    Stiffnesses in N/m, damping in N s/m; `joint_stiffness` is that of each joint, inf if rigid.
    """

    name: str
    elongation: tuple[float, ...]
    stiffness: float
    damping: float
    joint_stiffness: float

    @property
    def has_state(self) -> bool:
        """Whether the damper's own elongation Delta is a state: a damper behind finite joints."""
        return self.damping > 0 and np.isfinite(self.joint_stiffness)


@dataclass(frozen=True)
class System:
    """Bodies and legs above a rigid rail: q'' of `inertia`, `legs` between, contact springs below.

    inertia: [n] masses and moments of inertia (kg, kg m^2).
    contacts: (index of the wheel's freedom in q, contact stiffness N/m), one a track input.
    """

    freedoms: tuple[str, ...]
    inertia: tuple[float, ...]
    legs: tuple[Leg, ...]
    contacts: tuple[tuple[int, float], ...]


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


def ladder(vehicle: Vehicle, chain: str) -> tuple[list[Number], list[tuple[Number, Number, Number]]]:
    """One of the three chains into which a half vehicle with equal legs decouples, per wheel.

    With x the displacement over the leg (bounce z_c; pitch -L_c beta_c; bogie pitch -L_t beta_t)
    each chain is a ladder of masses from the top body to the wheelset, a leg below each but the
    last, which stands on the contact spring:

    - bounce:       M_c/4,         M_t/2,         M_w   (all bodies move alike front and rear)
    - pitch:        J_c/(4 L_c^2), M_t/2,         M_w   (front and rear opposed)
    - bogie_pitch:  J_t/(2 L_t^2),                M_w   (the two wheelsets of a bogie opposed)

    Returns (masses, legs): masses in kg from the top down, legs as (k, c, K_d), one fewer.
    Fields of `vehicle` may be arrays. Raises ValueError for an unknown chain.
    """
    primary = (vehicle.primary_stiffness, vehicle.primary_damping, vehicle.primary_joint_stiffness)
    # half a secondary leg stands over each wheelset of a bogie
    secondary = (
        vehicle.secondary_stiffness / 2,
        vehicle.secondary_damping / 2,
        vehicle.secondary_joint_stiffness / 2,
    )
    if chain == "bounce":
        return [vehicle.car_body_mass / 4, vehicle.bogie_mass / 2, vehicle.wheelset_mass], [secondary, primary]
    if chain == "pitch":
        car = vehicle.car_body_pitch_inertia / (4 * np.square(vehicle.half_bogie_spacing))
        return [car, vehicle.bogie_mass / 2, vehicle.wheelset_mass], [secondary, primary]
    if chain == "bogie_pitch":
        frame = vehicle.bogie_pitch_inertia / (2 * np.square(vehicle.half_wheelbase))
        return [frame, vehicle.wheelset_mass], [primary]
    raise ValueError(f"unknown chain {chain!r}: one of {', '.join(CHAINS)}")


def chain_system(vehicle: Vehicle, chain: str) -> System:
    """A chain of `ladder` as a `System` of its own: freedoms top body, ..., wheelset."""
    masses, legs = ladder(vehicle, chain)
    n = len(masses)

    def row(k: int) -> tuple[float, ...]:
        return tuple(1.0 if i == k else -1.0 if i == k + 1 else 0.0 for i in range(n))

    names = ("secondary", "primary")[-len(legs) :]
    return System(
        freedoms=("car", "bogie", "wheelset") if n == 3 else ("bogie", "wheelset"),
        inertia=tuple(masses),
        legs=tuple(Leg(name, row(k), *leg) for k, (name, leg) in enumerate(zip(names, legs, strict=True))),
        contacts=((n - 1, vehicle.contact_stiffness),),
    )


@dataclass(frozen=True)
class StateSpace:
    """dx/dt = A x + B v for a system, v [m] the track heights under its contacts.

    x = [dq/dt, Delta of the legs that have a state, q] (the paper's order below eq. 9).
    A: [n, n], B: [n, m], both in SI units.
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]
    states: tuple[str, ...]


def stiffness_matrices(system: System) -> tuple[NDArray, NDArray, NDArray]:
    """M [n, n], and the stiffness K [n, n] and coupling K_v [n, m] of springs and contacts alone.

    M q'' = -K q + K_v v - (damper forces); dampers and joints are in `state_space`.
    """
    rows = np.array([leg.elongation for leg in system.legs])
    spring = np.array([leg.stiffness for leg in system.legs])
    k = rows.T @ (spring[:, None] * rows)
    k_v = np.zeros((len(system.inertia), len(system.contacts)))
    for column, (wheel, contact) in enumerate(system.contacts):
        k[wheel, wheel] += contact
        k_v[wheel, column] = contact
    return np.diag(system.inertia), k, k_v


def state_space(system: System) -> StateSpace:
    """The first-order form of a system (eq. 10): 26 states with six finite joints, 20 with none.

    A leg's damper force is f = kappa (e - Delta) = c dDelta/dt with kappa = K_d/2 (eqs. 6 and 7);
    a rigid joint gives f = c de/dt and no state of its own, a damping of zero no force.
    """
    mass, k, k_v = stiffness_matrices(system)
    n = len(system.inertia)
    inner = [leg for leg in system.legs if leg.has_state]
    d = len(inner)
    velocity, position = slice(0, n), slice(n + d, 2 * n + d)
    a = np.zeros((2 * n + d, 2 * n + d))
    b = np.zeros((2 * n + d, len(system.contacts)))
    inverse = 1.0 / np.diag(mass)[:, None]
    a[velocity, position] = -inverse * k
    b[velocity] = inverse * k_v
    a[position, velocity] = np.eye(n)
    for leg in system.legs:
        row = np.array(leg.elongation)
        if not leg.has_state and leg.damping > 0:
            a[velocity, velocity] -= inverse * leg.damping * np.outer(row, row)
    for j, leg in enumerate(inner):
        row, kappa = np.array(leg.elongation), leg.joint_stiffness / 2
        a[velocity, position] -= inverse * kappa * np.outer(row, row)
        a[velocity, n + j] += kappa * row / np.diag(mass)
        a[n + j, position] = kappa / leg.damping * row
        a[n + j, n + j] = -kappa / leg.damping
    states = (
        *(f"d{freedom}/dt" for freedom in system.freedoms),
        *(f"Delta_{leg.name}" for leg in inner),
        *system.freedoms,
    )
    return StateSpace(a, b, states)


def poles(vehicle: Vehicle, chains: tuple[str, ...] = CHAINS) -> NDArray[np.complex128]:
    """Poles of a single vehicle, rad/s: those of its three chains, or some of them, the bogie-pitch pair once.

    The chains' blocks are small and well separated, so that the repeated front and rear
    bogie-pitch poles of the 26-state matrix do not disturb each other. NaN where the numbers overflow.
    """
    with np.errstate(all="ignore"):
        matrices = [state_space(chain_system(vehicle, chain)).a for chain in chains]
    return np.concatenate(
        [np.linalg.eigvals(a) if np.isfinite(a).all() else np.full(len(a), np.nan) for a in matrices]
    ).astype(complex)
