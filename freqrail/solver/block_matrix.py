"""The matrix K(s) of a block at many s, scaled, and what its inverse tells beside a pole.

K is that of `solver.elimination`: its unknowns are displacements x and forces f of the struts,

    K = [[s^2 M, R^T], [R, -C(s)]]

with diagonal M (inertia) and C (compliances), so that K' is diagonal. All arrays here have the unknowns first and s
last: each step is an expression over all s at once.

At a pole K is singular, but not when it is bordered by a row and a column. As s^2 M is diagonal, the bordered inverse
follows from that of the struts' dynamic compliances alone, S = -C - R (s^2 M)^-1 R^T, which is half as large. A free
oscillation without any force in a strut there is none, so that the border needs entries for forces only.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import BY_S, Law, Values
from freqrail.reduction.blocks import Block
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_response import parts_of
from freqrail.solver.closed_form import EPSILON
from freqrail.types import Number

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

ROUNDED = 4.0  # roundings in an entry of K, a product with it and a sum


@dataclass(frozen=True)
class Matrix:
    """K at some s [n], scaled by powers of two: k = scale K scale.

    Masses count about 1, and so does a strut's compliance together with the receptances of what it joins.

    size: number of displacements. diagonal: [unknowns, n]. rows: R's entries that are not zero, {(strut, coordinate):
    [n]}, complex like what they are multiplied with. scale: [unknowns, n]. inertia: [coordinates], kg. compliances,
    slopes, law_errors: [struts, n], 1/D, D' and the relative error of D.
    """

    s: Complex
    size: int
    diagonal: Complex
    rows: dict[tuple[int, int], Complex]
    scale: Array
    inertia: list[Number]
    compliances: Complex
    slopes: Complex
    law_errors: Array

    def times(self, z: Complex) -> Complex:
        """K z of vectors [unknowns, n]."""
        result = np.multiply(self.diagonal, z)
        for (j, i), entry in self.rows.items():
            result[i] += np.multiply(entry, z[self.size + j])
            result[self.size + j] += np.multiply(entry, z[i])
        return result

    def rounded(self, z: Array) -> Array:
        """What rounding leaves of K z, with the sizes of the vector's entries: [unknowns, n]."""
        sizes = np.abs(self.diagonal) * z
        result = sizes.copy()
        for (j, i), entry in self.rows.items():
            size = np.abs(entry.real)
            result[i] += size * z[self.size + j]
            result[self.size + j] += size * z[i]
        result *= ROUNDED * EPSILON
        result[self.size :] += self.law_errors * sizes[self.size :]
        return result

    def derivative(self) -> Complex:
        """The diagonal of K', scaled: [unknowns, n]. K is diagonal but for constants."""
        result = np.empty(self.diagonal.shape, complex)
        for i, mass in enumerate(self.inertia):
            result[i] = 2 * self.s * mass
        np.multiply(self.slopes, np.square(self.compliances), out=result[self.size :])
        return result * np.square(self.scale)

    def dense(self) -> Complex:
        """[n, unknowns, unknowns]."""
        count = len(self.diagonal)
        result = np.zeros((self.s.size, count, count), complex)
        result[:, range(count), range(count)] = self.diagonal.T
        for (j, i), entry in self.rows.items():
            result[:, self.size + j, i] = result[:, i, self.size + j] = entry
        return result


def matrix_at(block: Block, lengths: Lengths, values: Values, s: Complex, scale: Array | None = None) -> Matrix:
    """K at s [n], with a scale of its own or one given; values: of each s's vehicle, floats or [n]."""
    n, count = block.size, len(block.struts)
    laws: dict[Law, Number] = {}
    parts = parts_of(block, lengths, values, s, np.square(s), laws)
    found = {law: _slope(law, values, s, compliance) for law, compliance in laws.items()}
    compliances, slopes = np.empty((2, count, s.size), complex)
    law_errors = np.empty((count, s.size))
    for j, strut in enumerate(block.struts):
        compliances[j], (slopes[j], law_errors[j]) = laws[strut.law], found[strut.law]
    diagonal = np.empty((n + count, s.size), complex)
    for i, mass in enumerate(parts.inertia):
        np.multiply(mass, parts.s2, out=diagonal[i])
    np.negative(compliances, out=diagonal[n:])
    rows = {(j, i): x for j, row in enumerate(parts.rows) for i, x in enumerate(row) if np.any(x)}
    if scale is None:
        scale = np.abs(diagonal)
        for (j, i), entry in rows.items():
            scale[n + j] += np.square(entry) / scale[i]
        scale = np.exp2(np.round(-0.5 * np.log2(scale)))  # products with powers of two are exact
    diagonal *= np.square(scale)
    scaled = {(j, i): entry * scale[n + j] * scale[i] + 0j for (j, i), entry in rows.items()}
    return Matrix(s, n, diagonal, scaled, scale, parts.inertia, compliances, slopes, law_errors)


def _slope(law: Law, values: Values, s: Complex, compliance: Number) -> tuple[Number, Number]:
    """D'(s), and the relative error of D by the rounding of its parameters and of s."""
    slopes = law.slopes(values, s)
    size: Number = np.abs(s * slopes[BY_S])
    for name in law.names:
        size = size + np.nan_to_num(np.abs(values[name] * slopes[name]), nan=0.0, posinf=0.0)
    return slopes[BY_S], 2 * EPSILON * (1.0 + np.nan_to_num(size * np.abs(compliance), nan=0.0, posinf=1 / EPSILON))


def start(count: int, struts: int) -> Array:
    """Borders to start from, [count, struts], the same for all."""
    return np.random.default_rng(7).uniform(0.5, 1.5, (count, struts))


def bordered_inverse(matrix: Matrix, border: NDArray) -> tuple[Complex, Complex]:
    """(G, z) of the inverse of K bordered by entries [struts] or [struts, n] for forces; NaN where there is none.

    z [unknowns, n] spans the null space at a pole, and G [unknowns, unknowns, n] tells how far an error in K carries,
    |dz| <= |G| |dK| |z| (Higham, Accuracy and Stability of Numerical Algorithms, chapter 7).
    """
    n, struts, count = matrix.size, len(matrix.compliances), matrix.s.size
    receptance = 1.0 / matrix.diagonal[:n]
    down = {(j, i): np.multiply(entry, receptance[i]) for (j, i), entry in matrix.rows.items()}  # R (s^2 M)^-1
    bordered = np.zeros((struts + 1, struts + 1, count), complex)
    for j in range(struts):
        bordered[j, j] = matrix.diagonal[n + j]
    for (j, i), one in down.items():
        for k in range(j, struts):
            if (k, i) in matrix.rows:
                bordered[j, k] -= np.multiply(one, matrix.rows[k, i])
    for j in range(struts):
        bordered[j + 1 : struts, j] = bordered[j, j + 1 : struts]
    bordered[struts, :struts] = bordered[:struts, struts] = np.reshape(border, (struts, -1))
    inverse = np.moveaxis(inverses(np.moveaxis(bordered, -1, 0)), 0, -1)
    h, y = inverse[:struts, :struts], inverse[:struts, struts]
    g = np.empty((n + struts, n + struts, count), complex)
    z = np.empty((n + struts, count), complex)
    g[n:, n:], z[n:] = h, y
    carried = np.zeros((n, struts, count), complex)  # (s^2 M)^-1 R^T H
    z[:n] = 0.0
    for (j, i), one in down.items():
        carried[i] += np.multiply(one, h[j])
        z[i] -= np.multiply(one, y[j])
    g[:n, :n] = 0.0
    g[range(n), range(n)] = receptance
    for (j, i), one in down.items():
        g[:n, i] += np.multiply(carried[:, j], one)
    np.negative(carried, out=g[:n, n:])
    g[n:, :n] = np.swapaxes(g[:n, n:], 0, 1)
    return g, z


def inverses(matrix: NDArray) -> NDArray:
    """Of matrices [n, m, m]; NaN where an entry is no number. One that is singular is nudged."""
    good = np.asarray(np.isfinite(matrix).all(axis=(-2, -1), keepdims=True))
    matrix = np.where(good, matrix, np.eye(matrix.shape[-1]))
    try:
        result = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        result = np.stack([_nudged(each) for each in matrix])
    return np.where(good, result, np.nan)


def _nudged(matrix: NDArray) -> NDArray:
    try:
        return np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return np.linalg.inv(matrix + EPSILON * np.diag(1.0 + np.arange(len(matrix))))


def product(matrix: NDArray, vector: NDArray) -> NDArray:
    """[m, m, n] by [m, n], one term after the other."""
    return total(np.multiply(matrix[:, i], vector[i]) for i in range(len(vector)))


def total(terms: Iterable[NDArray]) -> NDArray:
    """The sum over the first axis, one term after the other: so its bits do not depend on the other axes."""
    return functools.reduce(operator.add, terms)
