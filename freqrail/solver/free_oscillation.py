"""Free oscillations of a block at its poles: null vectors, polished poles, and what rounding leaves of both.

In free oscillation K(s) z = 0 with the symmetric matrix K of `solver.block_matrix`, whose unknowns z are displacements
x and forces f of the struts. A pole is polished by p <- p - z^T K z/(z^T K' z), with z from inverse iteration, which
converges cubically (A. Neumaier, "Residual inverse iteration for the nonlinear eigenvalue problem", SIAM J. Numer.
Anal. 22 (1985)); z^T K' z = 2 p sum of m x^2 + sum of D'(p) e^2 with the elongations e = f/D.

Inverse iteration tells poles apart by their distance. Where several are nearly one, as those of wheelsets that hardly
feel each other, the space of all their vectors is found together and the poles are those of K in it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.reduction.blocks import Block
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_matrix import Matrix, bordered_inverse, inverses, matrix_at, product, start, total
from freqrail.solver.closed_form import EPSILON, POLISHING

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

STEP = 0.1  # longest step of the polishing, relative to the pole
FOUND = 16 * EPSILON  # relative distance from a pole below which it is found
TURNED = 1e-8  # change of a null vector by its refinement above which that has left more than rounding
CLOSE = 1e-4  # poles closer than this, relatively, are found together
AT_ONCE = 4096  # poles whose matrices are held at once: few enough to stay in the cache


@dataclass(frozen=True)
class Oscillation:
    """A block in free oscillation at poles [n], and what rounding leaves of it.

    z: [unknowns, n], scaled. x: [coordinates, n] m or rad. f, e: [struts, n] N and m. The *_errors of these are
    absolute. slope: z^T K' z, slope_error relative; size: the sum of its terms' sizes. step: how far the pole still is,
    rad/s, shift: how far rounding may move it. turned: by how much z was still refined, of the largest displacement.
    For what becomes of residues: scale [unknowns, n], by_s, the diagonal of K', uncertain, what is left of K z, and
    carried [unknowns, unknowns, n], how far it carries, all scaled. compliances, of_laws: [struts, n], 1/D and its
    relative error.
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
    turned: Array
    scale: Array
    by_s: Complex
    uncertain: Array
    carried: Complex
    compliances: Complex
    of_laws: Array

    def residue_errors(self, some: NDArray[np.intp], row: NDArray, strut: int) -> Array:
        """What is uncertain of (row z) f/(z^T K' z) at some of the poles, f the strut's force; row: [unknowns, n].

        What is computed is the exact residue r of a matrix K + dK with |dK| |z| below `uncertain`. With G `carried` and
        b the row of f, the pole moves by dp = -z^T dK z/(z^T K' z), and but for the change of K' itself

            dr = -(w - kappa z)^T dK z/(z^T K' z),  w = G (f row + u b - 2 r K' z),  kappa = w^T K' z/(z^T K' z).

        How z is normalised cancels in it.
        """
        z, by_s, slope, scale = (x[..., some] for x in (self.z, self.by_s, self.slope, self.scale))
        c, place = row[:, some] * scale, len(self.x) + strut
        u, f = total(np.multiply(c, z)), np.multiply(scale[place], z[place])
        v = np.multiply(f, c) - np.multiply(np.multiply(2 * np.multiply(u, f) / slope, by_s), z)
        v[place] += np.multiply(u, scale[place])
        w = product(self.carried[..., some], v)
        kappa = total(np.multiply(np.multiply(w, by_s), z)) / slope
        return np.asarray(total(np.abs(w - np.multiply(kappa, z)) * self.uncertain[:, some]) / np.abs(slope))


def _unit(z: Complex, size: int) -> Complex:
    """Vectors [unknowns, n] with the largest of `size` displacements 1: what blocks share rounds alike in all."""
    x = z[:size]
    largest = np.argmax(np.square(x.real) + np.square(x.imag), axis=0)[None]
    result = z / np.take_along_axis(z, largest, axis=0)
    np.put_along_axis(result, largest, 1.0, axis=0)
    return result


def _refined(matrix: Matrix, carried: NDArray, z: Complex) -> tuple[Complex, Array]:
    """(null vectors of unit length, by how much they were turned), from vectors and G of a matrix beside."""
    z = _unit(z, matrix.size)
    change = product(carried, matrix.times(z))
    turned = np.max(np.abs(change[: matrix.size]), axis=0)
    z = _unit(z - change, matrix.size)
    # once more for entries that are small beside the largest
    return _unit(z - product(carried, matrix.times(z)), matrix.size), turned


def _oscillation(matrix: Matrix, carried: NDArray, z: Complex, turned: Array) -> Oscillation:
    """What scaled null vectors z [unknowns, n] tell."""
    n, p, scale, compliances, by_s = matrix.size, matrix.s, matrix.scale, matrix.compliances, matrix.slopes
    size_of_z = np.abs(z)
    left = matrix.times(z)
    uncertain = matrix.rounded(size_of_z) + np.abs(left)
    errors = (product(np.abs(carried), uncertain) + EPSILON * size_of_z) * scale
    x, f = np.split(z * scale, [n])
    x_errors, f_errors = np.split(errors, [n])
    e = np.multiply(compliances, f)
    x_size, e_size, by_s_size = np.abs(x), np.abs(e), np.abs(by_s)
    e_errors = np.abs(compliances) * f_errors + e_size * (matrix.law_errors + EPSILON)
    mass = np.array([np.broadcast_to(m, p.shape) for m in matrix.inertia])
    terms = np.concatenate([np.multiply(2 * p * mass, np.square(x)), np.multiply(by_s, np.square(e))])
    slope, size = total(terms), total(np.abs(terms))
    slope_error = total(4 * np.abs(p) * mass * x_size * x_errors) + 4 * EPSILON * size
    slope_error = slope_error + total(by_s_size * e_size * (2 * e_errors + e_size * matrix.law_errors))
    slope_size = np.abs(slope)
    return Oscillation(
        z,
        x,
        f,
        e,
        x_errors,
        f_errors,
        e_errors,
        slope,
        slope_error / slope_size,
        size,
        -total(np.multiply(z, left)) / slope,
        total(size_of_z * uncertain) / slope_size,
        turned,
        scale,
        matrix.derivative(),
        uncertain,
        carried,
        compliances,
        matrix.law_errors,
    )


def real_parts(block: Block, values: Values, p: Complex, found: Oscillation) -> tuple[Array, Array]:
    """(Re p, its relative error) of poles [n], by the energy that the struts take, sums of terms of one sign:

    Re p = - sum of taken |e|^2 / (2 sum of m |x|^2 + 2 sum of kinetic |e|^2).
    """
    losses = {law: law.loss(values, p) for law in {strut.law for strut in block.struts}}
    taken, kinetic = np.empty((2, len(block.struts), p.size))
    for j, strut in enumerate(block.struts):
        taken[j], kinetic[j] = losses[strut.law]
    mass = np.array([np.broadcast_to(values[name], p.shape) for name in block.inertias])
    e, x = np.abs(found.e), np.abs(found.x)
    lost, moved = total(taken * np.square(e)), total(mass * np.square(x)) + total(kinetic * np.square(e))
    lost_error = total(taken * e * (2 * found.e_errors + 4 * EPSILON * e))
    moved_error = total(2 * mass * x * found.x_errors) + total(2 * kinetic * e * found.e_errors)
    return -lost / (2 * moved), np.where(lost > 0, lost_error / lost, 0.0) + moved_error / moved + 4 * EPSILON


def polished(block: Block, lengths: Lengths, values: Values, p: Complex) -> tuple[Complex, Oscillation]:
    """Poles [n], polished, and the free oscillation there; values: of each pole's vehicle, floats or [n]."""
    edges = np.linspace(0, p.size, -(-p.size // AT_ONCE) + 1).round().astype(int)
    parts = [
        _polished(block, lengths, _some(values, slice(first, last)), p[first:last])
        for first, last in itertools.pairwise(edges)
    ]
    if len(parts) == 1:
        return parts[0]
    found = {name: np.concatenate([vars(o)[name] for _, o in parts], axis=-1) for name in vars(parts[0][1])}
    return np.concatenate([q for q, _ in parts]), Oscillation(**found)


def _polished(block: Block, lengths: Lengths, values: Values, p: Complex) -> tuple[Complex, Oscillation]:
    p, found = _nearer(block, lengths, values, p, start(1, len(block.struts))[0])
    left = np.abs(found.step)
    todo = np.flatnonzero((left > FOUND * np.abs(p)) | (found.turned > TURNED))
    for _ in range(POLISHING if todo.size else 0):
        border = np.conj(found.z[block.size :, todo])
        p[todo], part = _nearer(block, lengths, _some(values, todo), p[todo], border)
        found = _replaced(found, todo, part)
        size = np.abs(part.step)
        still = (size > FOUND * np.abs(p[todo])) & (size < 0.5 * left[todo])  # else what is left is rounding
        left[todo] = size
        todo = todo[still | (part.turned > TURNED)]
        if not todo.size:
            break
    return p, found


def _nearer(block: Block, lengths: Lengths, values: Values, p: Complex, border: NDArray) -> tuple[Complex, Oscillation]:
    """Poles [n] after one step, and what is known there: the vector is refined with the inverse at hand."""
    before = matrix_at(block, lengths, values, p, errors=False)
    carried, z = bordered_inverse(before, border)
    step = _step(before, z)
    p = np.where(np.abs(step) < STEP * np.abs(p), p + step, p)
    after = matrix_at(block, lengths, values, p, before.scale)
    return p, _oscillation(after, carried, *_refined(after, carried, z))


def _step(matrix: Matrix, z: Complex) -> Complex:
    """Towards the pole, rad/s."""
    slope = total(np.multiply(np.square(z), matrix.derivative()))
    return np.asarray(-total(np.multiply(z, matrix.times(z))) / slope)


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
    middle = matrix_at(block, lengths, own, np.mean(p[places], axis=1))
    k, by_s = middle.dense(), middle.derivative().T
    unknowns = k.shape[-1]
    first = start(m, unknowns) + 0j
    border = np.broadcast_to(first, (count, m, unknowns))
    for _ in range(3):
        carried, space = _dense_inverse(k, border)
        good = np.isfinite(space).all(axis=(-2, -1), keepdims=True)
        space = np.linalg.qr(np.where(good, space, np.eye(unknowns, m)))[0]
        border = np.conj(np.swapaxes(space, 1, 2))
    t = np.swapaxes(space, 1, 2) @ (by_s[:, :, None] * space)
    s = np.swapaxes(space, 1, 2) @ (k @ space)
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
    z = np.moveaxis(space @ vectors, 1, 0).reshape(unknowns, -1)  # [unknowns, clusters x m]
    carried = np.repeat(np.moveaxis(carried, 0, -1), m, axis=-1)
    flat, wide = places.ravel(), _some(values, places.ravel())
    here, scale = np.repeat(middle.s, m), np.repeat(middle.scale, m, axis=-1)
    for _ in range(3):
        matrix = matrix_at(block, lengths, wide, here, scale)
        z, _ = _refined(matrix, carried, z)
        step = _step(matrix, z)
        here = np.where(np.abs(step) < 10 * CLOSE * np.abs(here), here + step, here)
    last = matrix_at(block, lengths, wide, here, scale)
    p = p.copy()
    p[flat] = here
    return p, _replaced(found, flat, _oscillation(last, carried, *_refined(last, carried, z)))


def _dense_inverse(k: NDArray, border: NDArray) -> tuple[NDArray, NDArray]:
    """(G, Y) of the inverse of matrices k [n, m, m] bordered by vectors [n, c, m]; Y: [n, m, c]."""
    size, more = k.shape[-1], border.shape[1]
    matrix = np.zeros((len(k), size + more, size + more), complex)
    matrix[:, :size, :size], matrix[:, size:, :size] = k, border
    matrix[:, :size, size:] = np.swapaxes(border, 1, 2)
    inverse = inverses(matrix)
    return inverse[:, :size, :size], inverse[:, :size, size:]


def clusters(p: Complex, there: NDArray[np.bool_]) -> dict[int, NDArray[np.intp]]:
    """Poles of vehicles [k, vehicles] that are nearly one: {m: flat indices [clusters, m]}. there: what are poles."""
    poles = np.where(there, p, np.nan)
    close = np.abs(poles[:, None] - poles) < CLOSE * np.abs(poles[:, None])
    result: dict[int, list[NDArray[np.intp]]] = {}
    known: dict[bytes, list[list[int]]] = {}
    for v in np.flatnonzero(np.sum(close, axis=(0, 1)) > np.sum(there, axis=0)):
        key = close[:, :, v].tobytes()
        if key not in known:
            known[key] = _linked(close[:, :, v])
        for members in known[key]:
            result.setdefault(len(members), []).append(np.array(members) * p.shape[1] + v)
    return {m: np.array(some) for m, some in result.items()}


def _linked(close: NDArray[np.bool_]) -> list[list[int]]:
    """Groups of two or more that a relation [k, k] links; what is not even close to itself is left out."""
    result = []
    rest = set(map(int, np.flatnonzero(np.diagonal(close))))
    while rest:
        members = [rest.pop()]
        for k in members:  # which grows meanwhile
            more = {int(i) for i in np.flatnonzero(close[k])} & rest
            members += sorted(more)
            rest -= more
        if len(members) > 1:
            result.append(sorted(members))
    return result


def _some(values: Values, places: NDArray[np.intp] | slice) -> Values:
    return {name: v[places] if np.ndim(v) else v for name, v in values.items()}


def _replaced(found: Oscillation, places: NDArray[np.intp], part: Oscillation) -> Oscillation:
    """What is known at poles, that at some places anew."""
    result = {}
    for name, value in vars(found).items():
        value = value.copy()
        value[..., places] = getattr(part, name)
        result[name] = value
    return Oscillation(**result)
