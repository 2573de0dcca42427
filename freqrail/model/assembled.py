"""A system in time: first-order equations of one vehicle, assembled from the laws' realisations.

The time side's route: no blocks, no dynamic stiffness. Source: eqs. (3) to (10) of the paper for its vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.system import System, structure


@dataclass(frozen=True)
class StateSpace:
    """dx/dt = A x + B v + B' dv/dt, v [m] the track's heights under the wheels.

    x = [dq/dt, inner elongations, q], the paper's order below eq. (9). a: [n, n]; b, b_rate: [n, m], SI units; b_rate
    is zero unless a contact has a damper of its own. states: names.
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]
    b_rate: NDArray[np.float64]
    states: tuple[str, ...]


def state_space(system: System, values: Values) -> StateSpace:
    """The first-order equations of one vehicle; values are floats.

    Raises ValueError where a law has no realisation in time, where a leg is rigid and where an inerter stands on the
    track without a spring.
    """
    fixed = structure(system, values)
    n, wheels = len(system.freedoms), len(system.wheels)
    mass = np.diag(sum(float(values[name]) * diagonal for name, diagonal in fixed.inertia.items()))
    springs, dampers = np.zeros((2, n, n))
    heights, rates = np.zeros((2, n, wheels))
    inner: list[_Inner] = []
    for k, (each, law) in enumerate(system.rows):
        found = law.realisation(values)
        if found is None:
            raise ValueError(f"the law of {each.name!r} has no differential equation")
        if not np.isfinite(found.k):
            raise ValueError(f"{each.name!r} is rigid")
        row, wheel = fixed.rows[k], k - len(system.legs)
        rigid = [c for c, tau in found.branches if tau == 0]
        c = float(np.real(found.c + sum(rigid)))
        springs += float(found.k) * np.outer(row, row)
        dampers += c * np.outer(row, row)
        mass = mass + float(found.b) * np.outer(row, row)
        if wheel >= 0:
            if found.b:
                raise ValueError(f"the contact of {each.name!r} takes the track's acceleration")
            heights[:, wheel] += float(found.k) * row
            rates[:, wheel] += c * row
        for number, (c_j, tau) in enumerate(found.branches):
            if tau != 0 and c_j != 0 and np.imag(tau) >= 0:
                inner.append(_Inner(f"Delta_{each.name}" + (f"_{number + 1}" if number else ""), row, wheel, c_j, tau))
    return _first_order(system, mass, springs, dampers, heights, rates, inner)


@dataclass(frozen=True)
class _Inner:
    """A branch c s/(1 + tau s) of a leg: one state, or the real and imaginary part of a conjugate pair's."""

    name: str
    row: NDArray[np.float64]
    wheel: int
    c: complex
    tau: complex

    @property
    def size(self) -> int:
        return 2 if np.imag(self.tau) else 1


def _first_order(
    system: System,
    mass: NDArray,
    springs: NDArray,
    dampers: NDArray,
    heights: NDArray,
    rates: NDArray,
    inner: list[_Inner],
) -> StateSpace:
    n, count = len(mass), sum(branch.size for branch in inner)
    velocity, position = slice(0, n), slice(n + count, 2 * n + count)
    a = np.zeros((2 * n + count, 2 * n + count))
    b, b_rate = np.zeros((2, 2 * n + count, heights.shape[1]))
    a[position, velocity] = np.eye(n)
    a[velocity, position], a[velocity, velocity] = -springs, -dampers
    b[velocity], b_rate[velocity] = heights, rates
    names, at = [], n
    for branch in inner:
        rate, spring = 1 / branch.tau, branch.c / branch.tau
        weight = branch.size  # a pair's force is twice the real part
        a[velocity, position] -= weight * np.real(spring) * np.outer(branch.row, branch.row)
        a[velocity, at] += weight * np.real(spring) * branch.row
        a[at, position], a[at, at] = np.real(rate) * branch.row, -np.real(rate)
        if branch.size == 2:
            a[velocity, at + 1] -= weight * np.imag(spring) * branch.row
            a[at + 1, position] = np.imag(rate) * branch.row
            a[at, at + 1], a[at + 1, at], a[at + 1, at + 1] = np.imag(rate), -np.imag(rate), -np.real(rate)
        if branch.wheel >= 0:
            b[velocity, branch.wheel] += weight * np.real(spring) * branch.row
            b[at, branch.wheel] = -np.real(rate)
            if branch.size == 2:
                b[at + 1, branch.wheel] = -np.imag(rate)
        names += [branch.name] if branch.size == 1 else [f"{branch.name}_real", f"{branch.name}_imaginary"]
        at += branch.size
    for block in (a, b, b_rate):
        block[velocity] = np.linalg.solve(mass, block[velocity])
    freedoms = [freedom.name for freedom in system.freedoms]
    return StateSpace(a, b, b_rate, (*(f"d{name}/dt" for name in freedoms), *names, *freedoms))
