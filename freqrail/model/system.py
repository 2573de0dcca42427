"""Any linear vehicle on wheels: freedoms with inertia, legs between them, wheels on the track. Names, no numbers.

The dynamic stiffness is Z(s) = s^2 sum of m_k M_k + sum of D_g(s) E_g + sum of C_w(s) e_w e_w^T, with
Z q = sum of C_w e_w u_w. M_k and E_g are constant symmetric matrices, one for every inertia and one for every law of
the legs; D_g is a law's stiffness, C_w a wheel's contact law and u_w the track's height under it.

All displacements count positive in one vertical direction. A leg's elongation is its row times q, upper end minus lower
end; a wheel's contact is a leg whose lower end is the track.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Law, Values
from freqrail.types import Number

Arm = float | str | Mapping[str, float]
"""An entry of a row: a number, the name of a length, or a sum {name: factor} with "" for 1."""
Row = Mapping[str, Arm]
"""Freedoms by name with their arms; all others are 0."""


@dataclass(frozen=True)
class Freedom:
    """A coordinate of motion, and the name of the mass (kg) or moment of inertia (kg m^2) that moves with it.

    For modes in words (`model.bodies`): body: the name of the body that moves, its own name if "". kind: what such a
    body is, "car", "bogie", "wheelset", the same for like bodies; the body's name if "". motion: "bounce", "pitch",
    "bending" or another word.
    """

    name: str
    inertia: str
    body: str = ""
    kind: str = ""
    motion: str = ""


@dataclass(frozen=True)
class Leg:
    """A suspension leg: elongation `row` times q, and the law of its force; of one body alone, to the ground.

    inside: words for what yields inside it, as "secondary damper joints", the same for like legs; its name if "".
    """

    name: str
    row: Row
    law: Law
    inside: str = ""


@dataclass(frozen=True)
class Wheel:
    """A wheel on the track: what of q presses on the contact, its law, and its place in m, forward positive."""

    name: str
    row: Row
    contact: Law
    place: Arm


@dataclass(frozen=True)
class System:
    """Freedoms, legs and wheels; wheels are told front to rear. Raises ValueError for names that do not fit.

    stations: names of lengths that only what is read off the vehicle needs.
    """

    freedoms: tuple[Freedom, ...]
    legs: tuple[Leg, ...]
    wheels: tuple[Wheel, ...]
    stations: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        rows = [each for each, _ in self.rows]
        for what, names in (("freedom", [f.name for f in self.freedoms]), ("leg or wheel", [r.name for r in rows])):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"{what} {twice[0]!r} stands twice")
        known = {f.name for f in self.freedoms}
        for each in rows:
            unknown = [name for name in each.row if name not in known]
            if unknown or not each.row:
                what = f"unknown freedom {unknown[0]!r}" if unknown else "an empty row"
                raise ValueError(f"{each.name!r} has {what}; freedoms are {', '.join(sorted(known))}")
        if not self.wheels:
            raise ValueError("a vehicle needs a wheel")

    @property
    def inertias(self) -> tuple[str, ...]:
        """Names of masses and moments of inertia, each once."""
        return tuple(dict.fromkeys(f.inertia for f in self.freedoms))

    @property
    def laws(self) -> tuple[Law, ...]:
        """Laws of legs and of contacts, each once."""
        return tuple(dict.fromkeys(law for _, law in self.rows))

    @property
    def rational(self) -> bool:
        """Whether all laws are."""
        return all(law.rational for law in self.laws)

    @property
    def rows(self) -> tuple[tuple[Leg | Wheel, Law], ...]:
        """Legs, then wheels, with their laws."""
        return (*((leg, leg.law) for leg in self.legs), *((wheel, wheel.contact) for wheel in self.wheels))

    @property
    def lengths(self) -> tuple[str, ...]:
        """Names that stand in arms of rows and places, each once."""
        found = [arm for each, _ in self.rows for arm in each.row.values()] + [wheel.place for wheel in self.wheels]
        return tuple(dict.fromkeys([*(name for arm in found for name in coefficients(arm) if name), *self.stations]))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Every name that needs a value, each once."""
        laws = (name for law in self.laws for name in law.names)
        return tuple(dict.fromkeys((*self.inertias, *laws, *self.lengths)))


def coefficients(arm: Arm) -> dict[str, float]:
    """An arm as {length: factor}, "" for the number 1."""
    if isinstance(arm, str):
        return {arm: 1.0}
    if isinstance(arm, Mapping):
        return {name: float(factor) for name, factor in arm.items()}
    return {"": float(arm)}


def evaluate(arm: Arm, values: Values) -> Number:
    """An arm in m or -: a float, or an array where a length is one."""
    result: Number = 0.0
    for name, factor in coefficients(arm).items():
        result = result + factor * (values[name] if name else 1.0)
    return result


def evaluate_row(row: Row, freedoms: Iterable[Freedom], values: Values) -> list[Number]:
    """A row's entries in the order of the freedoms, floats or arrays."""
    return [evaluate(row[f.name], values) if f.name in row else 0.0 for f in freedoms]


@dataclass(frozen=True)
class Structure:
    """The constant matrices of a system with given lengths.

    inertia: {name: [n]} diagonals of 0 and 1. rows: [legs + wheels, n]. laws: {law: indices of rows}. wheels: indices
    of the rows that are wheels. places: [wheels] m.
    """

    inertia: dict[str, NDArray[np.float64]]
    rows: NDArray[np.float64]
    laws: dict[Law, tuple[int, ...]]
    wheels: tuple[int, ...]
    places: NDArray[np.float64]


def structure(system: System, lengths: Values) -> Structure:
    """The constant matrices of a system; every length of `System.lengths` a float in m."""
    rows = [evaluate_row(each.row, system.freedoms, lengths) for each, _ in system.rows]
    labels = np.array([f.inertia for f in system.freedoms])
    laws = [law for _, law in system.rows]
    return Structure(
        inertia={name: (labels == name).astype(float) for name in system.inertias},
        rows=np.array(rows, dtype=float),
        laws={law: tuple(i for i, each in enumerate(laws) if each == law) for law in system.laws},
        wheels=tuple(range(len(system.legs), len(laws))),
        places=np.array([evaluate(wheel.place, lengths) for wheel in system.wheels], dtype=float),
    )


def alike(system: System, values: Values, apart: Collection[str] = ()) -> System:
    """The system in which masses of one value, and numbers of laws of one value, bear one name: the first.

    So legs that are equal though written out one by one are known to be, and blocks are found. apart: names that are
    kept, such as those of derivatives. Arrays keep their names.
    """
    lengths = {*system.lengths}
    masses = [name for name in system.inertias if name not in lengths]
    numbers = [name for law in system.laws for name in law.names if name not in (*masses, *lengths)]
    same: dict[str, str] = {}
    for some in (masses, list(dict.fromkeys(numbers))):
        plain = [name for name in some if np.ndim(values[name]) == 0 and name not in apart]
        firsts: list[str] = []
        for name in plain:
            value = float(values[name])
            like = next((other for other in firsts if _equal(float(values[other]), value)), name)
            if like == name:
                firsts.append(name)
            else:
                same[name] = like
    if not same:
        return system
    return replace(
        system,
        freedoms=tuple(replace(f, inertia=same.get(f.inertia, f.inertia)) for f in system.freedoms),
        legs=tuple(replace(leg, law=leg.law.renamed(same)) for leg in system.legs),
        wheels=tuple(replace(wheel, contact=wheel.contact.renamed(same)) for wheel in system.wheels),
    )


def _equal(a: float, b: float) -> bool:
    """Whether two numbers are one but for rounding, as loads of wheels that carry alike."""
    return a == b or (math.isfinite(b) and abs(a - b) <= 1e-14 * abs(b))
