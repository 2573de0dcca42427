"""A system in time: first-order equations of one vehicle, assembled from the laws' realisations, and what reads it.

The time side's route: no blocks, no dynamic stiffness. Source: eqs. (3) to (10) of the paper for its vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.outputs import Displacement, Elongation, Force, Output, Tap
from freqrail.model.realisation import Realisation
from freqrail.model.system import System, evaluate_row, structure

_ROUNDED = 1e-14
"""A dashpot this small, of the branches beside it, is what rounding left of partial fractions."""


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


@dataclass(frozen=True)
class Readout:
    """y = C x + D v + D' dv/dt, with x and v of a `StateSpace`: c [rows, n], d, d_rate [rows, m]."""

    c: NDArray[np.float64]
    d: NDArray[np.float64]
    d_rate: NDArray[np.float64]


@dataclass(frozen=True)
class _Branch:
    """A branch c s/(1 + tau s) of a leg: one state, or the real and imaginary part of a conjugate pair's.

    at: its first state.
    """

    name: str
    c: complex
    tau: complex
    at: int

    @property
    def size(self) -> int:
        return 2 if np.imag(self.tau) else 1

    @property
    def rate(self) -> complex:
        return 1 / self.tau

    @property
    def spring(self) -> complex:
        """What its force is per elongation beyond the inner one; of a pair, twice its real part is the force."""
        return self.size * self.c / self.tau

    @property
    def states(self) -> tuple[str, ...]:
        return (self.name,) if self.size == 1 else (f"{self.name}_real", f"{self.name}_imaginary")


@dataclass(frozen=True)
class _Part:
    """A leg, or a wheel's contact, in numbers. row: [freedoms]. wheel: its number, -1 for a leg."""

    name: str
    row: NDArray[np.float64]
    wheel: int
    k: float
    c: float
    b: float
    branches: tuple[_Branch, ...]


def state_space(system: System, values: Values) -> StateSpace:
    """The first-order equations of one vehicle; values are floats.

    Raises ValueError where there are `obstacles`: a law without a realisation in time, a rigid leg, an inerter on the
    track without a spring.
    """
    fixed = structure(system, values)
    n, wheels = len(system.freedoms), len(system.wheels)
    mass = np.diag(sum(float(values[name]) * diagonal for name, diagonal in fixed.inertia.items()))
    springs, dampers = np.zeros((2, n, n))
    heights, rates = np.zeros((2, n, wheels))
    parts = list(_parts(system, values))
    for part in parts:
        springs += part.k * np.outer(part.row, part.row)
        dampers += part.c * np.outer(part.row, part.row)
        mass = mass + part.b * np.outer(part.row, part.row)
        if part.wheel >= 0:
            heights[:, part.wheel] += part.k * part.row
            rates[:, part.wheel] += part.c * part.row
    return _first_order(system, mass, springs, dampers, heights, rates, parts)


def _parts(system: System, values: Values) -> Iterator[_Part]:
    """Legs, then wheels' contacts, in numbers. Raises ValueError as `state_space` does."""
    at = len(system.freedoms)
    for k, (each, law) in enumerate(system.rows):
        wheel = k - len(system.legs)
        found = law.realisation(values)
        obstacle = _obstacle(found, wheel >= 0)
        if found is None or obstacle:
            raise ValueError(obstacle.format(repr(each.name)))
        c = float(np.real(found.c + sum(c_j for c_j, tau in found.branches if tau == 0)))
        if abs(c) <= _ROUNDED * sum(abs(c_j) for c_j, _ in found.branches):
            c = 0.0
        branches: list[_Branch] = []
        for number, (c_j, tau) in enumerate(found.branches):
            if tau != 0 and c_j != 0 and np.imag(tau) >= 0:
                name = f"Delta_{each.name}" + (f"_{number + 1}" if number else "")
                branches.append(_Branch(name, c_j, tau, at))
                at += branches[-1].size
        row = np.array(evaluate_row(each.row, system.freedoms, values), dtype=float)
        yield _Part(each.name, row, max(wheel, -1), float(found.k), c, float(found.b), tuple(branches))


IRRATIONAL = "the law of {} has no differential equation"
RIGID = "{} is rigid"
EQUAL_POLES = "the law of {} has equal poles: it is no sum of first-order branches"
ACCELERATED = "the contact of {} takes the track's acceleration"
"""Why a leg or a wheel, its name in the braces, has no equations in time."""


def obstacles(system: System, values: Values) -> dict[str, str]:
    """The legs and wheels that have no equations in time, by name, and why."""
    found = {
        each.name: _obstacle(law.realisation(values), k >= len(system.legs))
        for k, (each, law) in enumerate(system.rows)
    }
    return {name: why for name, why in found.items() if why}


def _obstacle(found: Realisation | None, contact: bool) -> str:
    """Why a law has no equations in time, "" if it has."""
    if found is None:
        return IRRATIONAL
    if not np.isfinite(found.k):
        return RIGID
    if not all(np.isfinite(x) for x in (found.c, found.b, *(x for branch in found.branches for x in branch))):
        return EQUAL_POLES
    return ACCELERATED if contact and found.b else ""


def _first_order(
    system: System,
    mass: NDArray,
    springs: NDArray,
    dampers: NDArray,
    heights: NDArray,
    rates: NDArray,
    parts: list[_Part],
) -> StateSpace:
    inner = [(part, branch) for part in parts for branch in part.branches]
    n, count = len(mass), sum(branch.size for _, branch in inner)
    velocity, position = slice(0, n), slice(n + count, 2 * n + count)
    a = np.zeros((2 * n + count, 2 * n + count))
    b, b_rate = np.zeros((2, 2 * n + count, heights.shape[1]))
    a[position, velocity] = np.eye(n)
    a[velocity, position], a[velocity, velocity] = -springs, -dampers
    b[velocity], b_rate[velocity] = heights, rates
    for part, branch in inner:
        row, at, rate, spring = part.row, branch.at, branch.rate, branch.spring
        a[velocity, position] -= np.real(spring) * np.outer(row, row)
        a[velocity, at] += np.real(spring) * row
        a[at, position], a[at, at] = np.real(rate) * row, -np.real(rate)
        if branch.size == 2:
            a[velocity, at + 1] -= np.imag(spring) * row
            a[at + 1, position] = np.imag(rate) * row
            a[at, at + 1], a[at + 1, at], a[at + 1, at + 1] = np.imag(rate), -np.imag(rate), -np.real(rate)
        if part.wheel >= 0:
            b[velocity, part.wheel] += np.real(spring) * row
            b[at, part.wheel] = -np.real(rate)
            if branch.size == 2:
                b[at + 1, part.wheel] = -np.imag(rate)
    for block in (a, b, b_rate):
        block[velocity] = np.linalg.solve(mass, block[velocity])
    freedoms = [freedom.name for freedom in system.freedoms]
    names = [name for _, branch in inner for name in branch.states]
    return StateSpace(a, b, b_rate, (*(f"d{name}/dt" for name in freedoms), *names, *freedoms))


def readout(system: System, values: Values, outputs: tuple[Output, ...], model: StateSpace) -> Readout:
    """What reads the outputs off a vehicle's states, a row a label; model: its `state_space`.

    A contact's force and elongation are relative to the track. Raises ValueError for an output that reads what there
    is not, or the track's acceleration.
    """
    parts = {part.name: part for part in _parts(system, values)}
    rows = [_row(tap, output.derivative, system, values, model, parts) for output in outputs for _, tap in output.taps]
    return Readout(*(np.array(block) for block in zip(*((r.c, r.d, r.d_rate) for r in rows), strict=True)))


def _row(
    tap: Tap, derivative: int, system: System, values: Values, model: StateSpace, parts: dict[str, _Part]
) -> Readout:
    """One row, its arrays without the axis of rows."""
    if isinstance(tap, Displacement):
        row = np.array(evaluate_row(tap.row, system.freedoms, values), dtype=float)
        found = _position(row, -1, model)
    elif tap.of not in parts:
        raise ValueError(f"there is no leg or wheel {tap.of!r}")
    elif isinstance(tap, Elongation):
        found = _position(parts[tap.of].row, parts[tap.of].wheel, model)
    else:
        found = _force(tap, parts[tap.of], model)
    for _ in range(derivative):
        found = _differentiated(found, model)
    return found


def _position(row: NDArray[np.float64], wheel: int, model: StateSpace) -> Readout:
    """A row times q, less the track's height under a wheel unless that is -1."""
    c, (d, d_rate) = np.zeros(len(model.a)), np.zeros((2, model.b.shape[1]))
    c[len(c) - row.size :] = row
    if wheel >= 0:
        d[wheel] = -1.0
    return Readout(c, d, d_rate)


def _force(tap: Force, part: _Part, model: StateSpace) -> Readout:
    """k e + c de/dt + b d^2e/dt^2 and the branches' springs, of the elongation e."""
    elongation = _position(part.row, part.wheel, model)
    found = _times(elongation, part.k)
    if part.c or part.b:
        rate = _differentiated(elongation, model)
        found = _plus(found, _times(rate, part.c))
        if part.b:
            found = _plus(found, _times(_differentiated(rate, model), part.b))
    for branch in part.branches:
        found = _plus(found, _times(elongation, float(np.real(branch.spring))))
        found.c[branch.at] -= np.real(branch.spring)
        if branch.size == 2:
            found.c[branch.at + 1] += np.imag(branch.spring)
    return found


def _differentiated(row: Readout, model: StateSpace) -> Readout:
    """The rate of what a row reads. Raises ValueError for one that reads the track's rate."""
    if row.d_rate.any():
        raise ValueError("an output reads the track's acceleration")
    return Readout(row.c @ model.a, row.c @ model.b, row.c @ model.b_rate + row.d)


def _times(row: Readout, factor: float) -> Readout:
    return Readout(row.c * factor, row.d * factor, row.d_rate * factor)


def _plus(one: Readout, other: Readout) -> Readout:
    return Readout(one.c + other.c, one.d + other.d, one.d_rate + other.d_rate)


def without_rates(model: StateSpace, rows: Readout) -> tuple[StateSpace, Readout]:
    """The same in the states y = x - B' v, whose equations the track's rate is not in.

    dy/dt = A y + (B + A B') v, and C x + D v + D' dv/dt = C y + (C B' + D) v + D' dv/dt.
    """
    if not model.b_rate.any():
        return model, rows
    moved = StateSpace(model.a, model.b + model.a @ model.b_rate, np.zeros_like(model.b_rate), model.states)
    return moved, Readout(rows.c, rows.d + rows.c @ model.b_rate, rows.d_rate)
