"""Rows and places as linear forms in the lengths that vary over a grid.

A length that is one number for the whole grid is put in; one that varies stays a symbol. A form is an array [..., 1 +
varying]: the constant, then the factor of each varying length. So what is found about the forms, that two are
proportional or that bodies do not couple, holds for every vehicle of the grid.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.system import Arm, Row, System, coefficients
from freqrail.types import Number

Form = NDArray[np.float64]

SAME = 1e-11
"""Numbers closer than this, relative to the largest beside them, are taken for equal."""


@dataclass(frozen=True)
class Lengths:
    """Those of a system: fixed ones by value, m, and the names of varying ones."""

    fixed: Mapping[str, float]
    varying: tuple[str, ...]

    @property
    def size(self) -> int:
        """Entries of a form."""
        return 1 + len(self.varying)

    def arm(self, arm: Arm) -> Form:
        """An arm as a form [1 + varying]."""
        result = np.zeros(self.size)
        for name, factor in coefficients(arm).items():
            if name in self.varying:
                result[1 + self.varying.index(name)] += factor
            else:
                result[0] += factor * (self.fixed[name] if name else 1.0)
        return result

    def row(self, row: Row, freedoms: tuple[str, ...]) -> Form:
        """A row as forms [freedoms, 1 + varying]."""
        return np.array([self.arm(row[name]) if name in row else np.zeros(self.size) for name in freedoms])

    def derivative(self, arm: Arm, length: str) -> float:
        """d arm/d length, fixed or varying, -."""
        return coefficients(arm).get(length, 0.0)

    def evaluate(self, form: Form, values: Values) -> list[Number]:
        """Forms [k, 1 + varying] as k floats, or arrays over the grid where a varying length stands in them."""
        return [self._evaluate(entry, values) for entry in form]

    def _evaluate(self, entry: Form, values: Values) -> Number:
        result: Number = float(entry[0])
        for name, factor in zip(self.varying, entry[1:], strict=True):
            if factor:
                result = result + factor * np.asarray(values[name])
        return result


def lengths_of(system: System, values: Values) -> Lengths:
    """A system's lengths: those that are one number, and those that are arrays."""
    size = {name: np.size(values[name]) for name in system.lengths}
    return Lengths(
        fixed={name: float(np.ravel(values[name])[0]) for name in system.lengths if size[name] == 1},
        varying=tuple(name for name in system.lengths if size[name] > 1),
    )


def direction(vector: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """(factor, unit vector) of a vector, the unit's first entry that is not zero positive; (0, zeros) of none.

    Of proportional vectors the units are equal up to rounding.
    """
    size = float(np.linalg.norm(vector))
    if size == 0:
        return 0.0, vector
    unit = np.where(np.abs(vector) > SAME * size, vector, 0.0) / size
    sign = 1.0 if unit.ravel()[np.flatnonzero(unit)[0]] > 0 else -1.0
    return sign * size, sign * unit


def alike(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether two arrays of numbers around 1 are equal up to rounding."""
    return a.shape == b.shape and bool(np.all(np.abs(a - b) <= SAME))
