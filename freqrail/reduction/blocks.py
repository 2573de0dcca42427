"""The blocks of a system: their coordinates, the struts between them, and which wheels feed them.

In a block's coordinates y (q = basis y) the legs of one law whose rows are proportional act as one strut. So do
contacts, and a strut of contacts is an input of the block: v = sum of weight u_w over its wheels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Law, Values
from freqrail.model.system import System
from freqrail.reduction.decouple import decouple
from freqrail.reduction.forms import SAME, Form, Lengths, alike, direction, lengths_of


@dataclass(frozen=True)
class Strut:
    """Legs of one law as one: elongation e = row y, force D(s) e, its energy that of all members.

    row: forms [nb, 1 + varying]. members: (index in `System.rows`, weight), a leg's elongation being weight x e; the
    weights' squares sum to 1. wheel: whether it is one of contacts, with e = row y - v.
    """

    law: Law
    row: Form
    members: tuple[tuple[int, float], ...]
    wheel: bool


@dataclass(frozen=True)
class Block:
    """A block: basis [n, nb], the inertia of each coordinate, and its struts, legs first.

    alike: the index of the first block with the same matrices, its own if there is none before it.
    """

    basis: NDArray[np.float64]
    inertias: tuple[str, ...]
    struts: tuple[Strut, ...]
    alike: int

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.inertias)

    @cached_property
    def inputs(self) -> tuple[int, ...]:
        """Indices of the struts of contacts."""
        return tuple(j for j, strut in enumerate(self.struts) if strut.wheel)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names that its matrices depend on, but for lengths."""
        return tuple(dict.fromkeys((*self.inertias, *(n for strut in self.struts for n in strut.law.names))))


def blocks_of(system: System, values: Values) -> tuple[Lengths, tuple[Block, ...]]:
    """The blocks of a system. values: those of its lengths, floats or arrays over the grid."""
    lengths = lengths_of(system, values)
    freedoms = tuple(freedom.name for freedom in system.freedoms)
    rows = np.array([lengths.row(each.row, freedoms) for each, _ in system.rows])
    labels = np.array([freedom.inertia for freedom in system.freedoms])
    kinds = decouple([(labels == name).astype(float) for name in system.inertias], _matrices(system, rows))
    blocks: list[Block] = []
    for bases in kinds:
        first = len(blocks)
        for basis in bases:
            inertias = tuple(str(labels[np.flatnonzero(column)[0]]) for column in basis.T)
            blocks.append(Block(basis, inertias, _struts(system, rows, basis), first))
    return lengths, tuple(blocks)


def _matrices(system: System, rows: Form) -> list[NDArray[np.float64]]:
    """E_g of every law, by powers of the varying lengths: [n, n] each."""
    result = []
    laws = [law for _, law in system.rows]
    for wheel in (False, True):
        for law in system.laws:
            some = [k for k, each in enumerate(laws) if each == law and (k >= len(system.legs)) == wheel]
            if not some:
                continue
            product = np.einsum("rna,rmb->abnm", rows[some], rows[some])
            size = product.shape[0]
            result += [product[a, b] + product[a, b].T for a in range(size) for b in range(a, size)]
    return [matrix for matrix in result if np.max(np.abs(matrix)) > 0]


def _struts(system: System, rows: Form, basis: NDArray[np.float64]) -> tuple[Strut, ...]:
    found: dict[tuple[Law, bool], list[tuple[NDArray[np.float64], list[tuple[int, float]]]]] = {}
    for k, (_, law) in enumerate(system.rows):
        row = np.einsum("na,nb->ba", rows[k], basis)
        factor, unit = direction(row)
        if abs(factor) <= SAME * np.linalg.norm(rows[k]):
            continue
        group = found.setdefault((law, k >= len(system.legs)), [])
        for other, members in group:
            if alike(unit, other):
                members.append((k, factor))
                break
        else:
            group.append((unit, [(k, factor)]))
    struts = []
    for (law, wheel), group in found.items():
        fewer = _fewest(group)
        for unit, members in group if fewer is None else []:
            size = float(np.sqrt(sum(factor**2 for _, factor in members)))
            struts.append(Strut(law, _exact(size * unit), tuple((k, factor / size) for k, factor in members), wheel))
        for row, members in fewer or []:
            struts.append(Strut(law, row, tuple(members), wheel))
    return tuple(sorted(struts, key=lambda strut: strut.wheel))


def _exact(row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Entries that are roots of whole numbers but for rounding, as these: what blocks share stays equal."""
    whole = np.round(np.square(row))
    root = np.sign(row) * np.sqrt(whole)
    return np.where((whole > 0) & (np.abs(row - root) <= 8 * np.finfo(float).eps * np.abs(root)), root, row)


Group = list[tuple[NDArray[np.float64], list[tuple[int, float]]]]


def _fewest(group: Group) -> Group | None:
    """Rows R and weights Q of legs with rows P = Q R, Q^T Q = 1, where fewer do than there are directions; else None.

    Three wheelsets of a bogie, for one, rest in two of their motions on what four rows would tell twice over.
    """
    units = np.array([unit for unit, _ in group])
    if len(group) < 2 or np.any(units[..., 1:]):
        return None
    legs = np.array([factor * unit[:, 0] for unit, members in group for _, factor in members])
    size = float(np.max(np.abs(legs)))
    if np.linalg.matrix_rank(legs, tol=1e-9 * size) == len(group):
        return None
    rest, rows = legs.T @ legs, []
    while np.max(np.diag(rest)) > 1e-12 * size**2:  # Cholesky's factor, pivoted
        pivot = int(np.argmax(np.diag(rest)))
        row = rest[pivot] / np.sqrt(rest[pivot, pivot])
        row = np.where(np.abs(row) > SAME * size, row, 0.0)
        rest = rest - np.outer(row, row)
        rows.append(row)
    weights = legs @ np.linalg.pinv(np.array(rows))
    names = [k for _, members in group for k, _ in members]
    form = np.zeros((len(rows), *units.shape[1:]))
    form[..., 0] = rows
    return [
        (form[j], [(k, float(w)) for k, w in zip(names, weights[:, j], strict=True) if abs(w) > SAME])
        for j in range(len(rows))
    ]
