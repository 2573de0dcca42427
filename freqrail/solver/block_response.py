"""Frequency responses of the blocks, for grids of vehicles: the scalars that every response is a sum of.

Convention: e^{+i omega t}; s = i omega. Values carry the grid's axes and one more, last, along which s runs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Law, Values
from freqrail.reduction.blocks import Block
from freqrail.reduction.columns import Reduction, Scalar
from freqrail.reduction.forms import Lengths
from freqrail.solver.elimination import (
    FREE,
    Factors,
    Order,
    backward_error,
    continuants,
    dense,
    factorise,
    is_some,
    is_tree,
    order_of,
    reciprocal,
    solve,
)
from freqrail.types import Number

CHECKED = 97  # every so many-th node's solution is put back into the equations
BACKWARD = 1e-9  # backward error above which a block is solved by LAPACK


def column(values: Values) -> dict[str, Number]:
    """Values with one more, last axis, along which frequencies or poles can broadcast."""
    return {name: np.asarray(v)[..., None] if np.ndim(v) else v for name, v in values.items()}


@dataclass(frozen=True)
class Parts:
    """A block in numbers that broadcast: inertia [nb], rows [struts][nb], compliances 1/D(s) [struts], and s^2."""

    order: Order
    inertia: list[Number]
    rows: list[list[Number]]
    compliances: list[Number]
    s2: Number

    def factors(self) -> Factors:
        """L D L^T."""
        return factorise(self.order, self.inertia, self.rows, self.compliances, self.s2)

    def matrix(self) -> NDArray[np.complex128]:
        """Dense."""
        return np.asarray(dense(self.order, self.inertia, self.rows, self.compliances, self.s2))


_orders = lru_cache(maxsize=256)(lambda key: order_of(key.block))


class _Key:
    """A block by identity: the order of its unknowns is found once."""

    def __init__(self, block: Block) -> None:
        self.block = block

    def __hash__(self) -> int:
        return id(self.block)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and other.block is self.block


def compliance(law: Law, values: Values, s: Number) -> Number:
    """1/D(s) of a law, m/N: 0 where rigid, `FREE` where there is no force."""
    n, d = law.quotient(values, s)
    if np.all(n):
        return np.multiply(d, reciprocal(n))
    some = np.not_equal(n, 0)
    return np.where(some, np.multiply(d, reciprocal(np.where(some, n, 1.0))), FREE)


def parts_of(block: Block, lengths: Lengths, values: Values, s: Number, s2: Number, laws: dict[Law, Number]) -> Parts:
    """The numbers of a block. laws: compliances found so far, and added to."""
    for strut in block.struts:
        if strut.law not in laws:
            laws[strut.law] = compliance(strut.law, values, s)
    return Parts(
        _orders(_Key(block)),
        [values[name] for name in block.inertias],
        [lengths.evaluate(strut.row, values) for strut in block.struts],
        [laws[strut.law] for strut in block.struts],
        s2,
    )


@dataclass(frozen=True)
class Fraction:
    """A scalar as a quotient: numerator over the denominator of its block, an index into `Scalars.denominators`.

    The denominator spans all axes of the grid that the block depends on, numerators often fewer. -1: no denominator.
    """

    numerator: Number
    denominator: int


@dataclass(frozen=True)
class Scalars:
    """Every scalar of a reduction, and the denominators that those of a block share."""

    fractions: list[Fraction]
    denominators: list[Number]

    def values(self) -> list[Number]:
        """The scalars themselves, each broadcasting to [grid..., n]."""
        inverse = [reciprocal(d) for d in self.denominators]
        return [
            np.multiply(f.numerator, inverse[f.denominator]) if f.denominator >= 0 else f.numerator
            for f in self.fractions
        ]


def scalars(
    reduction: Reduction, values: Values, s: Number, s2: Number, exact: frozenset[int] = frozenset()
) -> Scalars:
    """Every scalar of a reduction at any complex s, per metre of its input.

    values: of `column`. s: [n] rad/s, s2 its square, an argument of its own because on the imaginary axis it is real.
    exact: blocks to be solved by LAPACK, see `unsound`. Each number spans only the axes of the grid that it depends on.
    """
    laws: dict[Law, Number] = {}
    found: dict[int, Fraction] = {}
    denominators: list[Number] = []
    for index, block, some in used(reduction):
        parts = parts_of(block, reduction.lengths, values, s, s2, laws)
        tree = is_tree(parts.order) and index not in exact
        factors = None if tree or index in exact else parts.factors()
        if tree:
            solution, denominator = continuants(
                parts.order, parts.inertia, parts.rows, parts.compliances, s2, unknowns_of(some.values(), block)
            )
            denominators.append(denominator)
        for strut in dict.fromkeys(x.strut for x in some.values()):
            fed = {k: x for k, x in some.items() if x.strut == strut}
            wanted = unknowns_of(fed.values(), block)
            if factors is not None:
                solution = solve(factors, {block.size + strut: 1.0}, wanted)
            elif not tree:
                solution = _by_lapack(parts, strut, wanted)
            for k, x in fed.items():
                numerator = times_s(read(x, reduction.lengths, values, parts, solution), x.derivative, s, s2)
                found[k] = Fraction(numerator, len(denominators) - 1 if tree else -1)
    return Scalars([found[k] for k in range(len(reduction.scalars))], denominators)


def used(reduction: Reduction) -> list[tuple[int, Block, dict[int, Scalar]]]:
    """Blocks that scalars are read off, with these."""
    result = []
    for index, block in enumerate(reduction.blocks):
        some = {k: x for k, x in enumerate(reduction.scalars) if x.block == index}
        if some:
            result.append((index, block, some))
    return result


def unknowns_of(some: Iterable[Scalar], block: Block) -> set[int]:
    """The unknowns that scalars are read off."""
    wanted: set[int] = set()
    for x in some:
        rows = np.flatnonzero(np.any(x.row, axis=-1))
        wanted |= {int(i) for i in rows} if x.quantity == "displacement" else {block.size + x.of}
    return wanted


def _right(parts: Parts, strut: int) -> NDArray[np.complex128]:
    right = np.zeros(parts.order.size + len(parts.rows), complex)
    right[parts.order.size + strut] = 1.0
    return right


def _by_lapack(parts: Parts, strut: int, wanted: Iterable[int]) -> dict[int, Number]:
    matrix = parts.matrix()
    right = np.broadcast_to(_right(parts, strut)[:, None], (*matrix.shape[:-1], 1))
    found = np.linalg.solve(matrix, right)[..., 0]
    return {k: found[..., k] for k in wanted}


def unsound(reduction: Reduction, values: Values, omega: NDArray[np.float64]) -> frozenset[int]:
    """Blocks whose elimination loses its digits at a sample of vehicles and nodes: to be solved by LAPACK.

    values: without a last axis for the nodes. omega: [n] rad/s.
    """
    some = {
        name: np.asarray(v)[tuple(slice(0, None, max(1, n // 2)) for n in np.shape(v))] for name, v in values.items()
    }
    omega = omega[::CHECKED]
    laws: dict[Law, Number] = {}
    result = set()
    for index, block, _ in used(reduction):
        parts = parts_of(block, reduction.lengths, column(some), 1j * omega, -np.square(omega), laws)
        everything = range(block.size + len(block.struts))
        matrix = parts.matrix()
        with np.errstate(all="ignore"):
            factors = parts.factors()
            for strut in block.inputs:
                found = solve(factors, {block.size + strut: 1.0}, everything)
                solution = np.stack(np.broadcast_arrays(*(found[k] for k in everything)), axis=-1)
                solution = np.broadcast_to(solution, matrix.shape[:-1])
                if not np.all(backward_error(matrix, solution, _right(parts, strut)) < BACKWARD):
                    result.add(index)
    return frozenset(result)


def read(scalar: Scalar, lengths: Lengths, values: Values, parts: Parts, solution: Mapping[int, Number]) -> Number:
    """A scalar, without its derivative, from a block's solution."""
    if scalar.quantity == "displacement":
        total: Number = None
        for i, entry in enumerate(lengths.evaluate(scalar.row, values)):
            if is_some(entry):
                term = solution[i] if isinstance(entry, float) and entry == 1.0 else np.multiply(entry, solution[i])
                total = term if total is None else total + term
        return total
    force = solution[parts.order.size + scalar.of]
    return force if scalar.quantity == "force" else np.multiply(parts.compliances[scalar.of], force)


def times_s(x: Number, derivative: int, s: Number, s2: Number) -> Number:
    """x s^derivative."""
    for _ in range(derivative // 2):
        x = np.multiply(x, s2)
    return np.multiply(x, s) if derivative % 2 else x
