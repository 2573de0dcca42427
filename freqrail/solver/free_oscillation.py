"""Free oscillations of a block at its poles: null vectors, polished poles, and what rounding leaves of both.

In free oscillation K(s) z = 0 with the symmetric matrix K of `solver.elimination`, whose unknowns z are displacements x
and forces f of the struts. A pole is polished by p <- p - z^T K z/(z^T K' z), with z from inverse iteration, which
converges cubically (A. Neumaier, "Residual inverse iteration for the nonlinear eigenvalue problem", SIAM J. Numer.
Anal. 22 (1985)); z^T K' z = 2 p sum of m x^2 + sum of D'(p) e^2 with the elongations e = f/D.

Inverse iteration tells poles apart by their distance. Where several are nearly one, as those of wheelsets that hardly
feel each other, the space of all their vectors is found together and the poles are those of K in it.
"""

from __future__ import annotations

import functools
import operator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import BY_S, Law, Values
from freqrail.reduction.blocks import Block
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_response import parts_of
from freqrail.solver.closed_form import EPSILON, POLISHING
from freqrail.types import Number

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

STEP = 0.1  # longest step of the polishing, relative to the pole
FOUND = 16 * EPSILON  # relative distance from a pole below which it is found
CLOSE = 1e-4  # poles closer than this, relatively, are found together
ROUNDED = 4.0  # roundings in an entry of K, a product with it and a sum


@dataclass(frozen=True)
class Oscillation:
    """A block in free oscillation at poles [n], and what rounding leaves of it.

    z: [n, unknowns]. x: [coordinates, n] m or rad. f, e: [struts, n] N and m. The *_errors of these are absolute.
    slope: z^T K' z, slope_error relative; size: the sum of its terms' sizes. step: how far the pole still is, rad/s,
    shift: how far rounding may move it.
    """

    z: Complex
    x: Complex
    f: Complex
    e: Complex
    x_errors: Array
    f_errors: Array
    e_errors: Array
    slope: Complex
    slope_error: Array
    size: Array
    step: Complex
    shift: Array


@dataclass(frozen=True)
class _Matrix:
    """K at some s [n], scaled by powers of two: k = scale K scale.

    Masses count about 1, and so does a strut's compliance together with the receptances of what it joins.

    laws: compliances. slopes: D' and the relative error of D, by law. inertia: [coordinates], kg.
    """

    s: Complex
    k: Complex
    scale: Array
    inertia: list[Number]
    laws: dict[Law, Number]
    slopes: dict[Law, tuple[Number, Number]]


def _matrix(block: Block, lengths: Lengths, values: Values, s: Complex) -> _Matrix:
    n = block.size
    laws: dict[Law, Number] = {}
    parts = parts_of(block, lengths, values, s, np.square(s), laws)
    matrix = np.broadcast_to(parts.matrix(), (s.size, *(n + len(block.struts),) * 2))
    diagonal = np.abs(np.diagonal(matrix, axis1=-2, axis2=-1))
    scale = np.empty(diagonal.shape)
    scale[:, :n] = 1.0 / np.sqrt(diagonal[:, :n])
    joined = [_total((np.abs(row) * scale[:, :n]).T ** 2) for row in np.moveaxis(matrix[:, n:, :n], 1, 0)]
    scale[:, n:] = 1.0 / np.sqrt(diagonal[:, n:] + np.array(joined).T)
    scale = np.exp2(np.round(np.log2(scale)))  # products with powers of two are exact
    slopes = {law: _slope(law, values, s, compliance) for law, compliance in laws.items()}
    return _Matrix(s, matrix * scale[:, :, None] * scale[:, None, :], scale, parts.inertia, laws, slopes)


def _slope(law: Law, values: Values, s: Complex, compliance: Number) -> tuple[Number, Number]:
    """D'(s), and the relative error of D by the rounding of its parameters and of s."""
    slopes = law.slopes(values, s)
    size: Number = np.abs(s * slopes[BY_S])
    for name in law.names:
        size = size + np.nan_to_num(np.abs(values[name] * slopes[name]), nan=0.0, posinf=0.0)
    return slopes[BY_S], 2 * EPSILON * (1.0 + np.nan_to_num(size * np.abs(compliance), nan=0.0, posinf=1 / EPSILON))


def _bordered(k: NDArray, start: NDArray) -> tuple[NDArray, NDArray[np.bool_]]:
    """Matrices k [n, m, m] with `start` [n, c, m] appended, and which are finite; an identity for others."""
    size, more = k.shape[-1], start.shape[1]
    matrix = np.zeros((len(k), size + more, size + more), complex)
    matrix[:, :size, :size], matrix[:, size:, :size] = k, start
    matrix[:, :size, size:] = np.swapaxes(start, 1, 2)
    good = np.asarray(np.isfinite(matrix).all(axis=(-2, -1), keepdims=True))
    return np.where(good, matrix, np.eye(size + more)), good


def _inverse(k: NDArray, start: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """(G, Y, A) of the inverse of a bordered matrix; NaN where there is none.

    It is regular at a pole. K Y + start^T A = 0, so that Y [n, m, c] spans the null space there, and G [n, m, m] tells
    how far an error in K carries, |dz| <= |G| |dK| |z| (Higham, Accuracy and Stability of Numerical Algorithms, chapter
    7).
    """
    size, more = k.shape[-1], start.shape[1]
    matrix, good = _bordered(k, start)
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:  # one of them is singular: nudge them all
        inverse = np.linalg.inv(matrix + EPSILON * np.diag(1.0 + np.arange(size + more)))
    inverse = np.where(good, inverse, np.nan)
    return inverse[:, :size, :size], inverse[:, :size, size:], inverse[:, size:, size:]


def _start(count: int, unknowns: int) -> NDArray:
    """Vectors to start from, [count, unknowns], the same for all."""
    return np.random.default_rng(7).uniform(0.5, 1.5, (count, unknowns)) * (1 + 0j)


def _null_vector(block: Block, matrix: _Matrix, start: Complex) -> tuple[Complex, Complex]:
    """(z, G): the null vector [n, unknowns] of unit length, from start [n, unknowns]."""
    carried, z, rest = _inverse(matrix.k, start[:, None, :])
    z = z[..., 0]
    z = z - _product(carried, _product(matrix.k, z) + start * rest[:, 0])  # what the inverse's rounding left
    return _unit(z, block), carried


def _unit(z: Complex, block: Block) -> Complex:
    """Vectors [n, unknowns] with the largest displacement 1, so that what blocks share rounds alike in all."""
    largest = np.argmax(np.abs(z[:, : block.size]), axis=-1)[:, None]
    result = z / np.take_along_axis(z, largest, axis=-1)
    np.put_along_axis(result, largest, 1.0, axis=-1)
    return result


def _oscillation(block: Block, matrix: _Matrix, z: Complex, carried: NDArray) -> Oscillation:
    """What a scaled null vector z [n, unknowns] tells."""
    n, p, scale = block.size, matrix.s, matrix.scale
    laws = [strut.law for strut in block.struts]

    def each(values: list[Number]) -> NDArray:
        return np.array([np.broadcast_to(value, p.shape) for value in values])

    compliance, by_s, of_law = (
        each([table[law] for law in laws])
        for table in (
            matrix.laws,
            {law: slope for law, (slope, _) in matrix.slopes.items()},
            {law: error for law, (_, error) in matrix.slopes.items()},
        )
    )
    uncertain = ROUNDED * EPSILON * _product(np.abs(matrix.k), np.abs(z))
    diagonal = np.diagonal(matrix.k, axis1=-2, axis2=-1)[:, n:]
    uncertain[:, n:] += of_law.T * np.abs(diagonal * z[:, n:])
    errors = (_product(np.abs(carried), uncertain) + EPSILON * np.abs(z)) * scale
    x, f = np.split((z * scale).T, [n])
    x_errors, f_errors = np.split(errors.T, [n])
    e = compliance * f
    e_errors = np.abs(compliance) * f_errors + np.abs(e) * (of_law + EPSILON)

    mass = each(matrix.inertia)
    terms = np.concatenate([2 * p * mass * np.square(x), by_s * np.square(e)])
    slope, size = _total(terms), _total(np.abs(terms))
    slope_error = _total(4 * np.abs(p) * mass * np.abs(x) * x_errors) + 4 * EPSILON * size
    slope_error = slope_error + _total(np.abs(by_s) * np.abs(e) * (2 * e_errors + np.abs(e) * of_law))
    return Oscillation(
        z,
        x,
        f,
        e,
        x_errors,
        f_errors,
        e_errors,
        slope,
        slope_error / np.abs(slope),
        size,
        -_total((z * _product(matrix.k, z)).T) / slope,
        _total((np.abs(z) * uncertain).T) / np.abs(slope),
    )


def real_parts(block: Block, values: Values, p: Complex, found: Oscillation) -> tuple[Array, Array]:
    """(Re p, its relative error) of poles [n], by the energy that the struts take, sums of terms of one sign:

    Re p = - sum of taken |e|^2 / (2 sum of m |x|^2 + 2 sum of kinetic |e|^2).
    """
    losses = [strut.law.loss(values, p) for strut in block.struts]
    taken, kinetic = (np.array([np.broadcast_to(loss[i], p.shape) for loss in losses]) for i in (0, 1))
    mass = np.array([np.broadcast_to(values[name], p.shape) for name in block.inertias])
    e, x = np.abs(found.e), np.abs(found.x)
    lost, moved = _total(taken * np.square(e)), _total(mass * np.square(x)) + _total(kinetic * np.square(e))
    lost_error = _total(taken * e * (2 * found.e_errors + 4 * EPSILON * e))
    moved_error = _total(2 * mass * x * found.x_errors) + _total(2 * kinetic * e * found.e_errors)
    return -lost / (2 * moved), np.where(lost > 0, lost_error / lost, 0.0) + moved_error / moved + 4 * EPSILON


def polished(block: Block, lengths: Lengths, values: Values, p: Complex) -> tuple[Complex, Oscillation]:
    """Poles [n], polished, and the free oscillation there; values: of each pole's vehicle, floats or [n]."""
    p, found = _nearer(block, lengths, values, p)
    before = np.abs(found.step)
    todo = np.flatnonzero(before > FOUND * np.abs(p))
    for _ in range(POLISHING if todo.size else 0):
        step = found.step[todo]
        p = p.copy()
        p[todo] = np.where(np.abs(step) < STEP * np.abs(p[todo]), p[todo] + step, p[todo])
        part = _at(block, lengths, _some(values, todo), p[todo], np.conj(found.z[todo]))
        found = _replaced(found, todo, part)
        size = np.abs(part.step)
        still = (size > FOUND * np.abs(p[todo])) & (size < 0.5 * before[todo])  # else what is left is rounding
        before[todo] = size
        todo = todo[still]
        if not todo.size:
            break
    return p, found


def _nearer(block: Block, lengths: Lengths, values: Values, p: Complex) -> tuple[Complex, Oscillation]:
    """Poles [n] after one step, from no vector in particular, and what is known there.

    The step is short where eigenvalues are good: the vector is refined with the inverse at hand.
    """
    before = _matrix(block, lengths, values, p)
    start = np.broadcast_to(_start(1, before.k.shape[-1]), (p.size, before.k.shape[-1]))
    z, carried = _null_vector(block, before, start)
    step = _step(block, before, z)
    p = np.where(np.abs(step) < STEP * np.abs(p), p + step, p)
    after = _matrix(block, lengths, values, p)
    return p, _oscillation(block, after, *_refined(block, before, after, z, carried))


def _step(block: Block, matrix: _Matrix, z: Complex) -> Complex:
    """Towards the pole, rad/s."""
    slope = _total((np.square(z) * _derivative(block, matrix)).T)
    return np.asarray(-_total((z * _product(matrix.k, z)).T) / slope)


def _refined(block: Block, before: _Matrix, after: _Matrix, z: NDArray, carried: NDArray) -> tuple[Complex, NDArray]:
    """Null vectors and G, scaled for a matrix beside their own, the vectors refined there."""
    ratio = before.scale / after.scale
    z, carried = z * ratio, carried * ratio[:, :, None] * ratio[:, None, :]
    return _unit(z - _product(carried, _product(after.k, z)), block), carried


def _at(block: Block, lengths: Lengths, values: Values, p: Complex, start: Complex) -> Oscillation:
    matrix = _matrix(block, lengths, values, p)
    return _oscillation(block, matrix, *_null_vector(block, matrix, start))


def together(
    block: Block, lengths: Lengths, values: Values, p: Complex, found: Oscillation, places: NDArray[np.intp]
) -> tuple[Complex, Oscillation]:
    """Poles [n] and their oscillations, those at places [clusters, m], each of m nearly equal poles, found together.

    With Y a basis of the space that m steps of inverse iteration at their mean p0 lead to, poles and vectors are those
    of Y^T (K(p0) + (s - p0) K'(p0)) Y. Any basis of the space of equal poles serves, if its vectors are orthogonal with
    K': the sum over them is what counts.
    """
    count, m = places.shape
    own = _some(values, places[:, 0])
    middle = _matrix(block, lengths, own, np.mean(p[places], axis=1))
    unknowns = middle.k.shape[-1]
    start = np.broadcast_to(_start(m, unknowns), (count, m, unknowns))
    for _ in range(3):
        carried, space, _ = _inverse(middle.k, start)
        good = np.isfinite(space).all(axis=(-2, -1), keepdims=True)
        space = np.linalg.qr(np.where(good, space, np.eye(unknowns, m)))[0]
        start = np.conj(np.swapaxes(space, 1, 2))
    by_s = _derivative(block, middle)
    t = np.swapaxes(space, 1, 2) @ (by_s[:, :, None] * space)
    s = np.swapaxes(space, 1, 2) @ (middle.k @ space)
    good = (np.isfinite(t) & np.isfinite(s)).all(axis=(-2, -1), keepdims=True)
    try:
        ritz = np.linalg.solve(np.where(good, t, np.eye(m)), np.where(good, s, 0.0))
    except np.linalg.LinAlgError:  # a double pole that is none of two: it is interpolated
        return p, found
    vectors = np.linalg.eig(ritz)[1]
    for i in range(m):  # orthogonal with K', whatever eigenvectors of equal eigenvalues are
        for j in range(i):
            a, b = vectors[:, :, j], vectors[:, :, i]
            along = np.einsum("ci,cij,cj->c", a, t, b) / np.einsum("ci,cij,cj->c", a, t, a)
            vectors[:, :, i] = b - along[:, None] * a
    z: NDArray = np.swapaxes(space @ vectors, 1, 2)  # [clusters, m, unknowns]
    p, carried = p.copy(), np.repeat(carried, m, axis=0)
    flat, wide = places.ravel(), _some(values, places.ravel())
    z, here = z.reshape(-1, unknowns), np.repeat(middle.s, m)
    before = _matrix(block, lengths, wide, here)
    for _ in range(3):
        matrix = _matrix(block, lengths, wide, here)
        z, carried = _refined(block, before, matrix, z, carried)
        step = _step(block, matrix, z)
        here = np.where(np.abs(step) < 10 * CLOSE * np.abs(here), here + step, here)
        before = matrix
    p[flat] = here
    last = _matrix(block, lengths, wide, here)
    return p, _replaced(found, flat, _oscillation(block, last, *_refined(block, before, last, z, carried)))


def _derivative(block: Block, matrix: _Matrix) -> Complex:
    """The diagonal of K', scaled, [n, unknowns]: K is diagonal but for constants."""
    mass = [2 * matrix.s * m for m in matrix.inertia]
    struts = [matrix.slopes[strut.law][0] * np.square(matrix.laws[strut.law]) for strut in block.struts]
    rows = [np.broadcast_to(x, matrix.s.shape) for x in (*mass, *struts)]
    return np.array(rows).T * np.square(matrix.scale)


def clusters(p: Complex, there: NDArray[np.bool_]) -> dict[int, NDArray[np.intp]]:
    """Poles of vehicles [vehicles, k] that are nearly one: {m: flat indices [clusters, m]}. there: what are poles."""
    poles = np.where(there, p, np.nan)
    close = np.abs(poles[:, :, None] - poles[:, None, :]) < CLOSE * np.abs(poles[:, :, None])
    result: dict[int, list[list[int]]] = {}
    for v in np.flatnonzero(np.sum(close, axis=(1, 2)) > np.sum(there, axis=1)):
        rest = set(map(int, np.flatnonzero(there[v])))
        while rest:
            members = [rest.pop()]
            for k in members:  # which grows meanwhile
                more = {int(i) for i in np.flatnonzero(close[v, k])} & rest
                members += sorted(more)
                rest -= more
            if len(members) > 1:
                result.setdefault(len(members), []).append([int(v) * p.shape[1] + k for k in sorted(members)])
    return {m: np.array(some) for m, some in result.items()}


def _some(values: Values, places: NDArray[np.intp]) -> Values:
    return {name: v[places] if np.ndim(v) else v for name, v in values.items()}


def _replaced(found: Oscillation, places: NDArray[np.intp], part: Oscillation) -> Oscillation:
    """What is known at poles, that at some places anew."""
    result = {}
    for name, value in vars(found).items():
        value = value.copy()
        value[(..., places) if value.ndim > 1 and name != "z" else places] = getattr(part, name)
        result[name] = value
    return Oscillation(**result)


def _product(matrix: NDArray, vector: NDArray) -> NDArray:
    """[n, m, m] by [n, m], one term after the other."""
    return functools.reduce(operator.add, (matrix[:, :, i] * vector[:, None, i] for i in range(vector.shape[-1])))


def _total(terms: NDArray) -> NDArray:
    """The sum over the first axis, one term after the other: so its bits do not depend on the other axes."""
    return functools.reduce(operator.add, terms)
