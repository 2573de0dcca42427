"""Elimination in a block: the order of the unknowns, found once, and the factors for a whole grid at once.

The unknowns are a block's displacements x and its struts' forces f together,

    s^2 M x + R^T f = 0        (momentum)
    R x - f/D(s)    = v        (elongations; v the track under a strut of contacts, 0 of a leg)

a symmetric matrix, factored as L D L^T without pivoting, elementwise over arrays. From the top down, a body first
and the leg below it next, a pivot is a sum of the receptance above and the compliance of the leg, or of the mass and
the stiffness above: nothing cancels, be a leg rigid or without any force, and a stroke, which is its force over a
stiffness, keeps its digits where the bodies move almost alike.

Where each unknown is coupled with one later one only, as in a ladder of masses, no division is needed at all: the
pivots are quotients of polynomials (continuants), of which only the last one's spans all axes of the grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.reduction.blocks import Block
from freqrail.types import Number

FREE = 1e30
"""Compliance of a leg without any force, m/N: beside any other it is none, and products of several do not overflow."""


@dataclass(frozen=True)
class Order:
    """Unknowns in the order of elimination, and for each those after it that it is coupled with at its turn.

    Unknowns 0, 1, ... are the block's coordinates, then come its struts' forces.
    """

    size: int
    unknowns: tuple[int, ...]
    after: Mapping[int, tuple[int, ...]]


def order_of(block: Block) -> Order:
    """From the top down: the farther from the track the sooner, bodies before the legs below them.

    Legs beyond those that the freedoms need (the fourth of a table) come first: their stiffness is assembled.
    """
    n, rows = block.size, [np.any(strut.row, axis=-1) for strut in block.struts]
    near = {n + j: set(map(int, np.flatnonzero(row))) for j, row in enumerate(rows)}
    near |= {i: {n + j for j, row in enumerate(rows) if row[i]} for i in range(n)}
    distance = {n + j: 0 for j in block.inputs}
    front = list(distance)
    for unknown in front:  # which grows meanwhile
        for other in sorted(near[unknown]):
            if other not in distance:
                distance[other] = distance[unknown] + 1
                front.append(other)
    far = max(distance.values(), default=0) + 2
    key = {i: float(distance.get(i, far)) for i in range(n)}
    # a leg after the body above it; one to the ground, as a bending mode's, before its only body
    low = {n + j: 0.25 if len(near[n + j]) == 1 and j not in block.inputs else -0.5 for j in range(len(rows))}
    key |= {strut: max(key[i] for i in near[strut]) + lower for strut, lower in low.items()}
    for extra in _redundant(block, key):
        key[extra] = np.inf
    coupled = {unknown: set(others) for unknown, others in near.items()}
    rest, unknowns, after = set(near), [], {}
    while rest:
        # of those equally far the one with the fewest couplings, so that the factors stay sparse
        unknown = min(rest, key=lambda u: (-key[u], len(coupled[u] & rest), u))
        rest.remove(unknown)
        others = coupled[unknown] & rest
        for other in others:
            coupled[other] |= others - {other}
        unknowns.append(unknown)
        after[unknown] = others
    place = {unknown: k for k, unknown in enumerate(unknowns)}
    return Order(n, tuple(unknowns), {u: tuple(sorted(map(int, o), key=place.__getitem__)) for u, o in after.items()})


def _redundant(block: Block, key: Mapping[int, float]) -> list[int]:
    """Struts of legs whose rows depend on those of others, the nearer to the track the sooner."""
    result, kept = [], np.zeros((0, block.size))
    legs = range(len(block.struts) - len(block.inputs))
    contacts = np.array([block.struts[j].row @ np.ones(block.struts[j].row.shape[1]) for j in block.inputs])
    for j in sorted(legs, key=lambda j: (-key[block.size + j], j)):
        row = block.struts[j].row @ (1 + 0.1 * np.arange(block.struts[j].row.shape[1]))
        more = np.concatenate([kept, row[None]])
        if np.linalg.matrix_rank(np.concatenate([more, contacts])) < len(more) + len(contacts):
            result.append(block.size + j)
        else:
            kept = more
    return result


@dataclass(frozen=True)
class Factors:
    """L D L^T of a block: entries of L below the diagonal by (later, earlier) unknown, and reciprocals of D."""

    order: Order
    lower: dict[tuple[int, int], Number]
    inverse: dict[int, Number]
    compliances: tuple[Number, ...]


def factorise(
    order: Order, inertia: list[Number], rows: list[list[Number]], compliances: list[Number], s2: Number
) -> Factors:
    """Factors of a block's matrix for arrays of vehicles and frequencies.

    inertia: of each coordinate, kg. rows: [struts][coordinates]. compliances: 1/D(s) of the struts, m/N. s2: s^2. All
    broadcast against each other, and whatever depends on few axes of the grid spans only these.
    """
    n = order.size
    entries: dict[tuple[int, int], Number] = {(i, i): m * s2 for i, m in enumerate(inertia)}
    for j, row in enumerate(rows):
        entries[n + j, n + j] = np.negative(compliances[j])
        for i, entry in enumerate(row):
            if is_some(entry):
                entries[n + j, i] = entries[i, n + j] = entry
    lower, inverse = {}, {}
    for k in order.unknowns:
        inverse[k] = reciprocal(entries[k, k])
        others = order.after[k]
        for a, i in enumerate(others):
            lower[i, k] = np.multiply(entries[i, k], inverse[k])
            for j in others[a:]:
                product = np.multiply(lower[i, k], entries[j, k])
                known = entries.get((j, i))
                entries[j, i] = entries[i, j] = np.negative(product) if known is None else known - product
    return Factors(order, lower, inverse, tuple(compliances))


def solve(factors: Factors, right: Mapping[int, Number], wanted: Iterable[int]) -> dict[int, Number]:
    """The unknowns `wanted`, and those that they follow from, for a right-hand side {unknown: value}."""
    order = factors.order
    forward = dict(right)
    for k in order.unknowns:
        if k in forward:
            for i in order.after[k]:
                product = np.multiply(factors.lower[i, k], forward[k])
                forward[i] = forward[i] - product if i in forward else np.negative(product)
    needed = set(wanted)
    for k in order.unknowns:
        if k in needed:
            needed |= set(order.after[k])
    result: dict[int, Number] = {}
    for k in reversed(order.unknowns):
        if k not in needed:
            continue
        total: Number = np.multiply(forward[k], factors.inverse[k]) if k in forward else None
        for i in order.after[k]:
            product = np.multiply(factors.lower[i, k], result[i])
            total = np.negative(product) if total is None else total - product
        result[k] = 0.0 if total is None else total
    return result


def is_some(entry: Number) -> bool:
    """Whether a number, or one of an array's, is not zero."""
    return entry != 0.0 if isinstance(entry, float) else bool(np.any(entry))


def is_tree(order: Order) -> bool:
    """Whether every unknown is coupled with one later one only, and the last is the one input."""
    return all(len(order.after[k]) == 1 for k in order.unknowns[:-1]) and order.unknowns[-1] >= order.size


def continuants(
    order: Order,
    inertia: list[Number],
    rows: list[list[Number]],
    compliances: list[Number],
    s2: Number,
    wanted: Iterable[int],
) -> tuple[dict[int, Number], Number]:
    """Numerators of the unknowns `wanted` and their common denominator, for a unit of the last unknown's equation.

    The pivot of an unknown k is P_k over the product of its children's P, those eliminated into it,
    P_k = d_k prod P_c - sum over c of o_c^2 Q_c prod of the other P, with Q_c the product of c's own children's. Down
    from the last one each numerator is its parent's, with -o_c Q_c in place of P_c. Arguments as of `factorise`.
    """
    n, children = order.size, {k: [c for c in order.unknowns if order.after[c] == (k,)] for k in order.unknowns}

    def diagonal(k: int) -> Number:
        return np.multiply(inertia[k], s2) if k < n else np.negative(compliances[k - n])

    def coupling(k: int, c: int) -> Number:
        return rows[max(k, c) - n][min(k, c)]

    def product(factors: Iterable[Number]) -> Number:
        result: Number = 1.0
        for factor in factors:
            result = factor if isinstance(result, float) and result == 1.0 else np.multiply(result, factor)
        return result

    p: dict[int, Number] = {}
    for k in order.unknowns:
        value = product([*(p[c] for c in children[k]), diagonal(k)])
        for c in children[k]:
            others = [p[other] for other in children[k] if other != c]
            value = value - product([np.square(coupling(k, c)), *(p[g] for g in children[c]), *others])
        p[k] = value
    # a numerator: a factor, and the unknowns whose P it is the product of
    last = order.unknowns[-1]
    numerators: dict[int, tuple[Number, tuple[int, ...]]] = {last: (1.0, tuple(children[last]))}
    for k in reversed(order.unknowns[:-1]):
        parent = order.after[k][0]
        factor, factors = numerators[parent]
        rest = list(factors)
        rest.remove(k)
        numerators[k] = np.multiply(factor, np.negative(coupling(parent, k))), (*rest, *children[k])
    return {k: product([numerators[k][0], *(p[i] for i in numerators[k][1])]) for k in wanted}, p[last]


def times(a: Number, b: Number) -> Number:
    """a b. A single number in an array of several axes numpy multiplies in another way, off by the last bit."""
    shape = np.broadcast_shapes(np.shape(a), np.shape(b))
    if shape and math.prod(shape) == 1:
        return np.multiply(np.ravel(a), np.ravel(b)).reshape(shape)
    return np.multiply(a, b)


def reciprocal(z: Number) -> Number:
    """1/z. Complex division by numpy is several times slower than this, which is as exact but for extreme z."""
    if not np.iscomplexobj(z):
        return 1.0 / np.asarray(z)
    z = np.asarray(z)
    scale = 1.0 / (np.square(z.real) + np.square(z.imag))
    result = np.empty(z.shape, complex)
    np.multiply(z.real, scale, out=result.real)
    np.multiply(z.imag, scale, out=result.imag)
    np.negative(result.imag, out=result.imag)
    return result


def dense(order: Order, inertia: list[Number], rows: list[list[Number]], compliances: list[Number], s2: Number) -> Any:
    """The block's matrix itself, [..., unknowns, unknowns], for checks and for LAPACK."""
    n, count = order.size, order.size + len(rows)
    parts = [*(m * s2 for m in inertia), *compliances, *(entry for row in rows for entry in row)]
    shape = np.broadcast_shapes(*(np.shape(part) for part in parts))
    matrix = np.zeros((*shape, count, count), complex)
    for i, m in enumerate(inertia):
        matrix[..., i, i] = m * s2
    for j, row in enumerate(rows):
        matrix[..., n + j, n + j] = np.negative(compliances[j])
        for i, entry in enumerate(row):
            matrix[..., n + j, i] = matrix[..., i, n + j] = entry
    return matrix


def backward_error(matrix: NDArray, solution: NDArray, right: NDArray) -> NDArray[np.float64]:
    """Largest componentwise backward error of solutions [..., unknowns] of matrix [..., unknowns, unknowns]."""
    residual = np.abs(np.einsum("...ij,...j->...i", matrix, solution) - right)
    size = np.einsum("...ij,...j->...i", np.abs(matrix), np.abs(solution)) + np.abs(right)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.max(np.where(size == 0, 0.0, residual / size), axis=-1)
