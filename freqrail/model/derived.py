"""Numbers of a vehicle that follow from others: modal masses, mode shapes at a place, Hertzian contact stiffnesses.

Each names what it needs in the mapping of values, and broadcasts over the grid as these do.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from freqrail.model.elements import Values
from freqrail.model.statics import wheel_loads
from freqrail.model.system import Arm, System, coefficients, evaluate
from freqrail.model.vehicle import hertzian_contact_stiffness
from freqrail.types import Number

SAME = 1e-12
"""Loads closer than this, relatively, are one."""


class Derived(Protocol):
    """A number that follows from others."""

    @property
    def name(self) -> str: ...

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the values it follows from."""
        ...

    def value(self, values: Values) -> Number: ...


@dataclass(frozen=True)
class ModalMass:
    """Of a mode of a uniform free-free beam that is 1 at its ends: a quarter of the body's mass, whichever mode.

    Source: R. D. Blevins, Formulas for Natural Frequency and Mode Shape, table 8-1, free-free beam.
    """

    name: str
    mass: str

    @property
    def needs(self) -> tuple[str, ...]:
        return (self.mass,)

    def value(self, values: Values) -> Number:
        return np.asarray(values[self.mass]) / 4


def wavenumber(order: int) -> float:
    """Wavenumber times length of the mode of that order of a uniform free-free beam: cos x cosh x = 1.

    order: from 1. By Newton's method from (order + 1/2) pi, on cos x - 1/cosh x.
    """
    x = (order + 0.5) * np.pi
    for _ in range(20):
        x -= (np.cos(x) - 1 / np.cosh(x)) / (-np.sin(x) + np.sinh(x) / np.cosh(x) ** 2)
    return float(x)


@dataclass(frozen=True)
class BeamShape:
    """Deflection of a uniform free-free beam's mode at a place: 1 at the front end, 1 or -1 at the rear.

    order: from 1. place: from the beam's middle, forward positive. length: name of the beam's.
    """

    name: str
    order: int
    place: Arm
    length: str

    @property
    def needs(self) -> tuple[str, ...]:
        return (*(name for name in coefficients(self.place) if name), self.length)

    def value(self, values: Values) -> Number:
        half = wavenumber(self.order) / 2
        x = 2 * half * evaluate(self.place, values) / np.asarray(values[self.length])
        if self.order % 2:
            return (np.cos(x) / np.cos(half) + np.cosh(x) / np.cosh(half)) / 2
        return (np.sin(x) / np.sin(half) + np.sinh(x) / np.sinh(half)) / 2


@dataclass(frozen=True)
class TabulatedShape:
    """A mode shape at a place from the body's position, straight between points. positions: [n] m, increasing."""

    name: str
    place: Arm
    positions: tuple[float, ...]
    deflections: tuple[float, ...]

    @property
    def needs(self) -> tuple[str, ...]:
        return tuple(name for name in coefficients(self.place) if name)

    def value(self, values: Values) -> Number:
        return np.interp(evaluate(self.place, values), self.positions, self.deflections)


@dataclass(frozen=True)
class HertzianContact:
    """K_H = 1.5 P0^(1/3)/G of a wheel (the paper's eq. 1), P0 its static load on rigid contacts.

    system: the vehicle, whose masses and springs the load follows from.
    """

    name: str
    constant: str
    wheel: int
    system: System = field(repr=False)

    @property
    def needs(self) -> tuple[str, ...]:
        contacts = {name for wheel in self.system.wheels for name in wheel.contact.names}
        return (self.constant, *(name for name in self.system.parameters if name not in contacts))

    def value(self, values: Values) -> Number:
        load = _narrowed(wheel_loads(self.system, values)[self.wheel])
        return hertzian_contact_stiffness(values[self.constant], load)


def _narrowed(load: Number) -> Number:
    """A load without the axes along which it does not vary but for rounding, such as those of dampers' joints."""
    found = np.asarray(load)
    for axis, size in enumerate(found.shape):
        first = found.take([0], axis=axis)
        if size > 1 and np.all(np.abs(found - first) <= SAME * np.abs(first)):
            found = first
    return found if found.size > 1 else float(found.ravel()[0])


def complete(values: Values, derived: Iterable[Derived]) -> dict[str, Number]:
    """The values with those that follow from them, in the order told: one may need those before it."""
    result = dict(values)
    for each in derived:
        result[each.name] = each.value(result)
    return result


def followers(derived: Iterable[Derived]) -> dict[str, frozenset[str]]:
    """{name of a derived number: names of the values that it follows from in the end}."""
    found: dict[str, frozenset[str]] = {}
    for each in derived:
        found[each.name] = functools.reduce(
            operator.or_, (found.get(name, frozenset({name})) for name in each.needs), frozenset()
        )
    return found


def slopes(derived: Iterable[Derived], values: Mapping[str, float], name: str, step: float = 1e-5) -> dict[str, float]:
    """d(derived)/d(name) of one vehicle by differences of fourth order in `step` of the value, or of 1 where it is 0.

    values: floats, without the derived ones. Raises nothing; a number that does not follow from `name` is left out.
    """
    derived = tuple(derived)
    some = [each.name for each in derived if name in followers(derived)[each.name]]
    if not some or np.isinf(values[name]):  # what is rigid holds nothing that the static loads hang on
        return {}
    h = step * (abs(values[name]) or 1.0)
    at = {k: complete({**values, name: values[name] + k * h}, derived) for k in (-2, -1, 1, 2)}
    return {each: float((8 * (at[1][each] - at[-1][each]) - (at[2][each] - at[-2][each])) / (12 * h)) for each in some}
