"""Slopes of the blocks' scalars by every parameter: inertias, those of the laws, and lengths.

A scalar is X = r^T K^-1 b with the symmetric matrix K of `solver.elimination`. With y = K^-1 b and the adjoint
a = K^-1 r, one more back substitution a scalar,

    dX/dp = dr^T y - a^T (dK/dp) y,

where dK/dp is s^2 at the coordinates of an inertia, D'/D^2 at the struts of a law (K holds -1/D there) and the slope of
a row's entry at a length. With the elongations 1/D a and 1/D y of both a law's share is -(a/D) (y/D) dD/dp: of a rigid
law nothing, of one without force what it would take if it had some.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Law, Values
from freqrail.reduction.blocks import Block
from freqrail.reduction.columns import Reduction, Scalar
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_response import Parts, parts_of, read, times_s, used
from freqrail.solver.elimination import Factors, solve
from freqrail.types import Number


@dataclass(frozen=True)
class Sloped:
    """Scalars X, and dX/d(parameter) of each by name; of a name that is not there the slope is 0."""

    scalars: list[Number]
    slopes: list[dict[str, Number]]


def check_wanted(reduction: Reduction, wanted: Iterable[str]) -> None:
    """Raises ValueError for a name that is no parameter, or a length that the reduction holds for one value of only."""
    known = reduction.system.parameters
    for name in wanted:
        if name not in known:
            raise ValueError(f"no parameter {name!r}; there are {', '.join(known)}")
        if name in reduction.lengths.fixed:
            raise ValueError(
                f"the reduction holds for {name} = {reduction.lengths.fixed[name]:g} m only; "
                "make it with `lengths_free` for a derivative by it"
            )


def lengths_free(values: Values, wanted: Iterable[str]) -> dict[str, Number]:
    """Values for `reduce`, with which it holds for all values of those names wanted that are lengths.

    A vehicle that is its own mirror image is none any more when one of its lengths changes. A length that is an array
    is a symbol to `reduce`, whatever the array holds.
    """
    some = frozenset(wanted)
    return {
        name: np.resize(value, 2) if name in some and np.size(value) == 1 else value for name, value in values.items()
    }


def slopes(
    reduction: Reduction,
    values: Values,
    s: Number,
    s2: Number,
    wanted: Iterable[str],
    exact: frozenset[int] = frozenset(),
    inverses: Mapping[int, NDArray[np.complex128]] | None = None,
) -> Sloped:
    """Every scalar of a reduction at any complex s and its slopes by the parameters wanted, per metre of its input.

    Arguments as of `block_response.scalars`; wanted: see `check_wanted`; inverses: K^-1 [..., unknowns, unknowns] of
    blocks of which it is known. A parameter that several struts share is one.
    The slope by the stiffness of what is rigid (inf) is 0.
    """
    names = frozenset(wanted)
    laws: dict[Law, Number] = {}
    by_law: dict[Law, dict[str, Number]] = {}
    count = len(reduction.scalars)
    found: list[Number] = [0.0] * count
    gradients: list[dict[str, Number]] = [{} for _ in range(count)]
    for index, block, some in used(reduction):
        parts = parts_of(block, reduction.lengths, values, s, s2, laws)
        for strut in block.struts:
            if strut.law not in by_law and names.intersection(strut.law.names):
                found_slopes = strut.law.slopes(values, s)
                by_law[strut.law] = {name: found_slopes[name] for name in strut.law.names if name in names}
        inverse = (inverses or {}).get(index)
        if inverse is None and index in exact:
            inverse = _by_lapack(parts)
        own = _Block(block, parts, s, reduction.lengths, values, by_law, names, inverse)
        for k, scalar in some.items():
            found[k], gradients[k] = own.scalar(scalar)
    return Sloped(found, gradients)


def _by_lapack(parts: Parts) -> NDArray[np.complex128]:
    matrix = parts.matrix()
    good = np.isfinite(matrix).all(axis=(-2, -1), keepdims=True)
    try:
        return np.where(good, np.linalg.inv(np.where(good, matrix, np.eye(matrix.shape[-1]))), np.nan)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)


@dataclass
class _Block:
    """A block in numbers, and columns of K^-1 as they are asked for."""

    block: Block
    parts: Parts
    s: Number
    lengths: Lengths
    values: Values
    by_law: Mapping[Law, Mapping[str, Number]]
    names: frozenset[str]
    inverse: NDArray[np.complex128] | None
    columns: dict[tuple[int, int], dict[int, Number]] = field(default_factory=dict)
    inputs: dict[int, dict[int, tuple[Number, Number]]] = field(default_factory=dict)

    @functools.cached_property
    def factors(self) -> Factors:
        return self.parts.factors()

    @functools.cached_property
    def entries(self) -> list[tuple[str, int, int, float]]:
        """(length, strut, coordinate, slope) of the rows' entries that change with lengths wanted."""
        result = []
        for place, name in enumerate(self.lengths.varying, start=1):
            for j, strut in enumerate(self.block.struts if name in self.names else ()):
                result += [(name, j, int(i), float(strut.row[i, place])) for i in np.flatnonzero(strut.row[:, place])]
        return result

    @functools.cached_property
    def needed(self) -> frozenset[int]:
        """Unknowns that some slope is made of."""
        n = self.block.size
        some = {i for i, name in enumerate(self.block.inertias) if name in self.names}
        some |= {n + j for j, strut in enumerate(self.block.struts) if strut.law in self.by_law}
        some |= {unknown for _, j, i, _ in self.entries for unknown in (n + j, i)}
        return frozenset(some)

    def solved(self, right: Mapping[int, Number], wanted: Iterable[int]) -> dict[int, Number]:
        """Unknowns of K^-1 right."""
        inverse = self.inverse
        if inverse is None:
            return solve(self.factors, right, wanted)
        return {
            k: functools.reduce(operator.add, (np.multiply(inverse[..., k, i], v) for i, v in right.items()))
            for k in wanted
        }

    def column(self, unknown: int, derivative: int, wanted: Iterable[int]) -> dict[int, Number]:
        """A column of K^-1, times s^derivative: at least the unknowns wanted and those that slopes are made of."""
        known = self.columns.setdefault((unknown, derivative), {})
        wanted = self.needed | set(wanted)
        if not wanted <= known.keys():
            known.update(self.solved({unknown: self._power(derivative)}, wanted))
        return known

    def _power(self, derivative: int) -> Number:
        return times_s(1.0, derivative, self.s, self.parts.s2)

    def fed(self, strut: int, y: Mapping[int, Number]) -> dict[int, tuple[Number, Number]]:
        """By unknown, what an entry of the adjoint is multiplied by in a slope, and of a strut, in its elongation's.

        That is -s^2 y of an inertia, -y/D^2 and -y/D of a law.
        """
        if strut not in self.inputs:
            n = self.block.size
            result: dict[int, tuple[Number, Number]] = {}
            for i, name in enumerate(self.block.inertias):
                if name in self.names:
                    result[i] = np.multiply(np.negative(self.parts.s2), y[i]), 0.0
            for j, each in enumerate(self.block.struts):
                if each.law in self.by_law:
                    elongation = np.multiply(np.negative(self.parts.compliances[j]), y[n + j])
                    result[n + j] = np.multiply(self.parts.compliances[j], elongation), elongation
            self.inputs[strut] = result
        return self.inputs[strut]

    def scalar(self, scalar: Scalar) -> tuple[Number, dict[str, Number]]:
        """A scalar and its slopes."""
        block, n, of = self.block, self.block.size, self.block.size + scalar.of
        reads = {int(i) for i in np.flatnonzero(np.any(scalar.row, axis=-1))} if scalar.of < 0 else {of}
        y = self.column(n + scalar.strut, 0, reads)
        x = times_s(read(scalar, self.lengths, self.values, self.parts, y), scalar.derivative, self.s, self.parts.s2)
        if scalar.quantity == "displacement":
            a = self._adjoint_of_row(scalar)
        else:
            own = {int(i) for i in np.flatnonzero(np.any(block.struts[scalar.of].row, axis=-1))}
            a = self.column(of, scalar.derivative, own)
            if scalar.quantity == "elongation":
                a = {k: np.multiply(self.parts.compliances[scalar.of], v) for k, v in a.items()}
        gradient: dict[str, Number] = {}

        def add(name: str, slope: Number) -> None:
            gradient[name] = gradient[name] + slope if name in gradient else slope

        shares: dict[Law, Number] = {}
        for unknown, (factor, by_elongation) in self.fed(scalar.strut, y).items():
            if unknown < n:
                add(block.inertias[unknown], np.multiply(a[unknown], factor))
                continue
            if scalar.quantity == "elongation" and unknown == of:
                # 1/D changes in what is read, too: 1 + a/D, which is R a. It cancels where there is little force.
                entries = [(i, r) for i, r in enumerate(self.parts.rows[scalar.of]) if np.any(r)]
                here = functools.reduce(operator.add, (np.multiply(r, a[i]) for i, r in entries))
                share = np.multiply(here, by_elongation)
            else:
                share = np.multiply(a[unknown], factor)
            law = block.struts[unknown - n].law
            shares[law] = shares[law] + share if law in shares else share
        for law, share in shares.items():
            for name, slope in self.by_law[law].items():
                add(name, share if isinstance(slope, float) and slope == 1.0 else np.multiply(share, slope))
        for name, j, i, entry in self.entries:
            add(name, -entry * (np.multiply(a[n + j], y[i]) + np.multiply(a[i], y[n + j])))
        if scalar.quantity == "displacement":
            for place, name in enumerate(self.lengths.varying, start=1):
                for i, entry in enumerate(scalar.row[:, place]) if name in self.names else ():
                    if entry:
                        add(name, times_s(float(entry) * y[i], scalar.derivative, self.s, self.parts.s2))
        return x, gradient

    def _adjoint_of_row(self, scalar: Scalar) -> dict[int, Number]:
        """K^-1 r of a row of displacements, times s^derivative."""
        row = self.lengths.evaluate(scalar.row, self.values)
        entries = {i: entry for i, entry in enumerate(row) if np.any(entry)}
        ((i, entry), *others) = entries.items()
        if not others and isinstance(entry, float) and entry == 1.0:
            return self.column(i, scalar.derivative, ())
        power = self._power(scalar.derivative)
        return self.solved({i: np.multiply(entry, power) for i, entry in entries.items()}, self.needed)
