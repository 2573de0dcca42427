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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import BY_S, Law, Values
from freqrail.reduction.blocks import Block
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_response import parts_of
from freqrail.solver.closed_form import EPSILON
from freqrail.solver.elimination import is_some
from freqrail.types import Number

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

CANCELLING = 1e-5  # a determinant smaller than this, relative to the sum of its terms' sizes, may lack digits
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


def matrix_at(
    block: Block, lengths: Lengths, values: Values, s: Complex, scale: Array | None = None, errors: bool = True
) -> Matrix:
    """K at s [n], with a scale of its own or one given; values: of each s's vehicle, floats or [n].

    errors: whether the laws' errors are wanted; else they are zero.
    """
    n, count = block.size, len(block.struts)
    laws: dict[Law, Number] = {}
    parts = parts_of(block, lengths, values, s, np.square(s), laws)
    found = {law: _slope(law, values, s, compliance, errors) for law, compliance in laws.items()}
    compliances, slopes = np.empty((2, count, s.size), complex)
    law_errors = np.empty((count, s.size))
    for j, strut in enumerate(block.struts):
        compliances[j], (slopes[j], law_errors[j]) = laws[strut.law], found[strut.law]
    diagonal = np.empty((n + count, s.size), complex)
    for i, mass in enumerate(parts.inertia):
        np.multiply(mass, parts.s2, out=diagonal[i])
    np.negative(compliances, out=diagonal[n:])
    rows = {(j, i): x for j, row in enumerate(parts.rows) for i, x in enumerate(row) if is_some(x)}
    if scale is None:
        scale = np.abs(diagonal)
        for (j, i), entry in rows.items():
            scale[n + j] += np.square(entry) / scale[i]
        scale = np.exp2(np.round(-0.5 * np.log2(scale)))  # products with powers of two are exact
    diagonal *= np.square(scale)
    scaled = {(j, i): entry * scale[n + j] * scale[i] + 0j for (j, i), entry in rows.items()}
    return Matrix(s, n, diagonal, scaled, scale, parts.inertia, compliances, slopes, law_errors)


def _slope(law: Law, values: Values, s: Complex, compliance: Number, errors: bool) -> tuple[Number, Number]:
    """D'(s), and the relative error of D by the rounding of its parameters and of s."""
    slopes = law.slopes(values, s)
    if not errors:
        return slopes[BY_S], 0.0
    size: Number = np.abs(s * slopes[BY_S])
    for name in law.names:
        part = np.abs(values[name] * slopes[name])
        size = size + np.where(part < np.inf, part, 0.0)  # a rigid spring's is no number
    size = size * np.abs(compliance)
    return slopes[BY_S], 2 * EPSILON * (1.0 + np.where(np.isnan(size), 0.0, np.minimum(size, 1 / EPSILON)))


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
    inverse = _inverses_along(bordered)
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


def _inverses_along(matrix: Complex) -> Complex:
    """Of symmetric matrices [m, m, n]: of small ones by minors, unless their determinant cancels."""
    m = len(matrix)
    if m > 4:
        return np.moveaxis(inverses(np.moveaxis(matrix, -1, 0)), 0, -1)
    result = np.empty(matrix.shape, complex)
    terms = _adjugate(matrix, result) if m < 4 else _adjugate_of_four(matrix, result)
    determinant = total(terms)
    result *= 1.0 / determinant
    sure = np.abs(determinant) > CANCELLING * total(map(np.abs, terms))
    sure &= np.isfinite(determinant)
    if not np.all(sure):
        rest = np.flatnonzero(~sure)
        result[:, :, rest] = np.moveaxis(inverses(np.moveaxis(matrix[:, :, rest], -1, 0)), 0, -1)
    return result


def _adjugate(a: Complex, out: Complex) -> list[Complex]:
    """The adjugate of symmetric matrices [m, m, n], m = 2 or 3, and the terms of their determinants."""
    if len(a) == 2:
        out[0, 0], out[1, 1] = a[1, 1], a[0, 0]
        np.negative(a[0, 1], out=out[0, 1])
        out[1, 0] = out[0, 1]
        return [np.multiply(a[0, 0], a[1, 1]), np.multiply(a[0, 1], out[0, 1])]
    for i in range(3):
        for j in range(i, 3):
            (p, q), (r, s) = ([k for k in range(3) if k != each] for each in (i, j))
            minor = np.multiply(a[p, r], a[q, s]) - np.multiply(a[p, s], a[q, r])
            out[i, j] = out[j, i] = minor if (i + j) % 2 == 0 else np.negative(minor)
    return [np.multiply(a[0, j], out[0, j]) for j in range(3)]


def _adjugate_of_four(a: Complex, out: Complex) -> list[Complex]:
    """The same for m = 4, by the minors of its upper and its lower two rows (Laplace)."""
    pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    upper, lower = (
        [np.multiply(a[r, i], a[r + 1, j]) - np.multiply(a[r, j], a[r + 1, i]) for i, j in pairs] for r in (0, 2)
    )
    # entry (i, j) of the adjugate: row j and column i left out; expanded along the row beside row j
    for j, minors in ((0, lower), (1, lower), (2, upper), (3, upper)):
        beside = j ^ 1
        for i in range(j + 1):
            columns = [k for k in range(4) if k != i]
            value: Any = 0.0
            for place, column in enumerate(columns):
                first, second = (k for k in columns if k != column)
                term = np.multiply(a[beside, column], minors[pairs.index((first, second))])
                value = value + term if place % 2 == 0 else value - term
            # rows other than j: the one beside stands before the lower two, or behind the upper two
            out[i, j] = out[j, i] = value if (i + j) % 2 == 0 else np.negative(value)
    signs = (1, -1, 1, 1, -1, 1)
    return [sign * np.multiply(upper[k], lower[5 - k]) for k, sign in enumerate(signs)]


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
