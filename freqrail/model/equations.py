"""Equations of motion of bodies, suspension legs and contact springs: state space, and response at a frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.types import Number


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


def system_response(system: System, omega: NDArray) -> NDArray[np.complex128]:
    """Displacements q of any system per metre of height under each contact: [n, freedoms, contacts], m/m.

    omega [n] in rad/s. Solves (M s^2 + E^T D(s) E + K_H) q = K_H v at every frequency; the legs
    need not be alike. Differentiate by multiplying with i omega.
    """
    s = 1j * np.asarray(omega, dtype=float)[:, None, None]
    mass, stiffness, coupling = stiffness_matrices(system)
    dynamic = mass * s**2 + stiffness
    for leg in system.legs:
        row = np.array(leg.elongation)
        total = leg_dynamic_stiffness(leg.stiffness, leg.damping, leg.joint_stiffness, s)
        dynamic = dynamic + (total - leg.stiffness) * np.outer(row, row)
    return np.linalg.solve(dynamic, np.broadcast_to(coupling.astype(complex), (len(s), *coupling.shape)))
