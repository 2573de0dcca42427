"""Simultaneous block diagonalisation: the coordinates in which a system falls into blocks that do not feel each other.

Z(s) is a sum of constant symmetric matrices, one for every inertia and law, times functions of s (`model.system`).
Orthonormal coordinates that make all of these matrices block diagonal at once make Z(s) so, whatever the numbers. They
come from the eigenvectors of a random combination of the matrices, connected where a second one couples them; equal
eigenvalues are copies of one block. Source: K. Murota, Y. Kanno, M. Kojima, S. Kojima, "A numerical algorithm for
block-diagonal decomposition of matrix *-algebras", Japan J. Indust. Appl. Math. 27 (2010).

Eigenvectors differ in the last bits from machine to machine. The coordinates are therefore made exact: within a block
each belongs to one inertia and is the sparsest, and where its entries are in the ratio of small whole numbers they are
these over their root sum of squares. What coupling is left is measured, and blocks that still feel each other are
taken together: always right, only slower.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

LEFT = 1e-12  # coupling left between two blocks, relative to the matrix's largest entry, above which they are merged
CLUSTER = 1e-9  # eigenvalues closer than this, relative to the largest, are taken for equal
TRIES = 9  # random combinations, of which the one with eigenvalues farthest apart is taken
NONE = 1e-9  # of unit vectors: what is below is rounding
WHOLE = 60  # largest whole number in a ratio of entries that is taken for exact


def decouple(inertias: list[Matrix], matrices: list[Matrix]) -> list[list[Matrix]]:
    """Bases of the blocks: a list for each kind of block, in it a basis [n, nb] for each copy with equal matrices.

    inertias: diagonals [n] of 0 and 1, one a name, their sum all ones. matrices: symmetric [n, n]. Every column of a
    basis is supported by one inertia's freedoms. Blocks come in the order of their first freedom.
    """
    # a unit of its own for the freedoms of every inertia, in which their largest entry is 1, changes no block
    largest = [max(float(np.max(np.abs(d * np.diag(m)))) for m in matrices) for d in inertias]
    unit = 1 / np.sqrt(sum(d * (size or 1.0) for d, size in zip(inertias, largest, strict=True)))
    matrices = [m * np.outer(unit, unit) for m in matrices if np.any(m)]
    matrices = [m / np.max(np.abs(m)) for m in matrices]
    whole = [np.diag(d) for d in inertias] + matrices
    kinds = []
    for vectors, copies in _components(whole):
        bases = _copies(vectors, copies, inertias, matrices) if copies > 1 else None
        kinds.append(bases or [_sparse_basis(vectors, inertias)])
    return sorted(_merged(kinds, inertias, matrices), key=lambda bases: _first(bases[0]))


def _first(basis: Matrix) -> tuple[int, ...]:
    return tuple(int(np.flatnonzero(column)[0]) for column in basis.T)


def _components(matrices: list[Matrix]) -> list[tuple[Matrix, int]]:
    """Invariant subspaces as (orthonormal vectors [n, k], number of copies of a block that it holds)."""
    rng = np.random.default_rng(20100101)
    tries = [sum(rng.uniform(0.5, 1.5) * rng.choice((-1.0, 1.0)) * m for m in matrices) for _ in range(TRIES)]
    # eigenvectors are as exact as their eigenvalues are apart
    values, vectors = max((np.linalg.eigh(each) for each in tries[1:]), key=lambda found: _narrowest(found[0]))
    other = tries[0]
    spaces = np.split(np.arange(values.size), np.flatnonzero(_apart(values)) + 1)
    coupling = np.abs(vectors.T @ other @ vectors) > NONE * np.max(np.abs(other))
    group = list(range(len(spaces)))
    for i, j in itertools.combinations(range(len(spaces)), 2):
        if group[i] != group[j] and coupling[np.ix_(spaces[i], spaces[j])].any():
            group = [group[i] if g == group[j] else g for g in group]
    result = []
    for g in dict.fromkeys(group):
        members = [space for space, of in zip(spaces, group, strict=True) if of == g]
        sizes = {space.size for space in members}
        copies = sizes.pop() if len(sizes) == 1 else 1
        result.append((vectors[:, np.concatenate(members)], copies))
    return result


def _apart(values: Matrix) -> NDArray[np.bool_]:
    """Whether eigenvalues and the next ones are different."""
    return np.asarray(np.diff(values) > CLUSTER * np.max(np.abs(values)))


def _narrowest(values: Matrix) -> float:
    """The narrowest gap between eigenvalues that are different."""
    gaps = np.diff(values)[_apart(values)]
    return float(np.min(gaps, initial=np.inf))


def _sparse_basis(vectors: Matrix, inertias: list[Matrix]) -> Matrix:
    """Orthonormal basis of an invariant subspace, inertia by inertia, from reduced row echelon forms."""
    columns = []
    for diagonal in inertias:
        part = _echelon((vectors * diagonal[:, None]).T)
        columns += _orthonormal([_exact(row) for row in part])
    order = sorted(columns, key=lambda column: int(np.flatnonzero(column)[0]))
    return np.array(order).T


def _echelon(rows: Matrix) -> Matrix:
    """The reduced row echelon form [rank, n]: one matrix for each space of rows, whatever spans it."""
    values, vectors = np.linalg.svd(rows, full_matrices=False)[1:]
    rest = vectors[values > 1e-6]  # projections of orthonormal vectors: their singular values are 1, or 0
    done = 0
    for column in range(rest.shape[1]):
        if done == len(rest):
            break
        pivot = done + int(np.argmax(np.abs(rest[done:, column])))
        if abs(rest[pivot, column]) < 1e-8:
            continue
        rest[[done, pivot]] = rest[[pivot, done]]
        rest[done] /= rest[done, column]
        others = np.arange(len(rest)) != done
        rest[others] -= np.outer(rest[others, column], rest[done])
        done += 1
    return np.where(np.abs(rest) < NONE, 0.0, rest)


def _exact(vector: Matrix) -> Matrix:
    """The vector at unit length, from whole numbers where its entries are in the ratio of some; the first positive."""
    present = np.flatnonzero(np.abs(vector) > NONE * np.max(np.abs(vector)))
    entries = vector[present] / vector[present[0]]
    result = np.zeros_like(vector)
    for multiple in range(1, WHOLE + 1):
        numbers = multiple * entries
        if np.all(np.abs(numbers - np.round(numbers)) < multiple * 1e-9) and np.max(np.abs(numbers)) <= WHOLE:
            entries = np.round(numbers)
            break
    result[present] = entries / np.sqrt(np.sum(np.square(entries)))
    return result


def _orthonormal(vectors: list[Matrix]) -> list[Matrix]:
    """Gram and Schmidt's vectors; those that are orthogonal already stay as they are."""
    result: list[Matrix] = []
    for vector in vectors:
        rest = vector
        for _ in range(2):
            for other in result:
                overlap = float(other @ rest)
                if abs(overlap) > 1e-14:
                    rest = rest - overlap * other
        result.append(vector if rest is vector else _exact(rest))
    return result


def _copies(vectors: Matrix, copies: int, inertias: list[Matrix], matrices: list[Matrix]) -> list[Matrix] | None:
    """A basis for each of several equal blocks, column for column the same motion; None if none is found this way.

    Each grows from one sparse vector: what the matrices make of it, inertia by inertia, in a fixed order.
    """
    size = vectors.shape[1] // copies
    starts: list[Matrix] = []
    for diagonal in inertias:
        part = _echelon((vectors * diagonal[:, None]).T)
        if len(part) == copies:  # the block has one coordinate of this inertia: any vector of it grows into a copy
            starts = _orthonormal([_exact(row) for row in part])
            break
    bases = [_grown(start, size, inertias, matrices) for start in starts]
    if len(bases) != copies or any(basis is None for basis in bases):
        return None
    found = [basis for basis in bases if basis is not None]
    overlap = np.abs(np.concatenate(found, axis=1).T @ np.concatenate(found, axis=1) - np.eye(size * copies))
    same = all(
        np.max(np.abs(basis.T @ m @ basis - found[0].T @ m @ found[0])) < LEFT for basis in found for m in matrices
    )
    return found if same and np.max(overlap) < LEFT else None


def _grown(start: Matrix, size: int, inertias: list[Matrix], matrices: list[Matrix]) -> Matrix | None:
    """The smallest invariant subspace that holds a vector, if it has this size: [n, size]."""
    columns = [start]
    for column in columns:  # which grows meanwhile
        for matrix, diagonal in itertools.product(matrices, inertias):
            image = diagonal * (matrix @ column)
            for _ in range(2):
                for other in columns:
                    image = image - (other @ image) * other
            if np.linalg.norm(image) > 1e-7:
                columns.append(_signed(_exact(image), matrix @ column))
                if len(columns) > size:
                    return None
    return np.array(columns).T if len(columns) == size else None


def _signed(vector: Matrix, image: Matrix) -> Matrix:
    """The vector, in the direction of the image that it comes from, so that copies have equal signs."""
    return vector if vector @ image > 0 else -vector


def _merged(kinds: list[list[Matrix]], inertias: list[Matrix], matrices: list[Matrix]) -> list[list[Matrix]]:
    """The blocks, those together that still feel each other."""
    blocks = [(k, basis) for k, bases in enumerate(kinds) for basis in bases]
    parent = list(range(len(blocks)))
    for i, j in itertools.combinations(range(len(blocks)), 2):
        one, other = blocks[i][1], blocks[j][1]
        left = max(float(np.max(np.abs(one.T @ m @ other))) for m in (*matrices, np.eye(len(one))))
        if left > LEFT and parent[i] != parent[j]:
            parent = [parent[i] if p == parent[j] else p for p in parent]
    result: dict[int, list[Matrix]] = {}
    for root in dict.fromkeys(parent):
        members = [i for i, p in enumerate(parent) if p == root]
        if len(members) == 1:
            result.setdefault(blocks[members[0]][0], []).append(blocks[members[0]][1])
        else:
            together = _sparse_basis(np.linalg.qr(np.concatenate([blocks[i][1] for i in members], axis=1))[0], inertias)
            result[-1 - root] = [together]
    return list(result.values())
