"""Resonances of the blocks as quadrature sees them: where the peaks lie, how wide they are, what rounding makes of them.

An elimination with rounding is the exact one of a vehicle whose numbers differ in their last digits; what that does to
a peak, its place and its height, `solver.free_oscillation` tells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.reduction.columns import Reduction, Scalar
from freqrail.solver.block_poles import EPSILON, FAR, LIGHT, Expansion, at_poles, bases, expand
from freqrail.solver.block_response import parts_of
from freqrail.solver.free_oscillation import derivative, null_vectors, uncertainty
from freqrail.types import Number

Array = NDArray[np.float64]

ROUNDED_BELOW = 1e-9  # of the largest eigenvalue: real parts smaller than this are not taken from eigenvalues
SAME = 1e-6  # relative error of a product of poles up to which it counts as known


@dataclass(frozen=True)
class Resonances:
    """Poles of a block of one vehicle or many, rad/s: [n], those with Im >= 0, and what rounding makes of responses.

    known: [n], whether its peak surely lies there, as wide as the pole tells. shift: how far rounding moves a
    peak, relative to its frequency. errors: relative errors of each scalar beside it, {scalar: [n]}. All NaN where a
    vehicle's numbers overflow.
    """

    poles: NDArray[np.complex128]
    known: NDArray[np.bool_]
    shift: Array
    errors: dict[int, Array]


def resonances(reduction: Reduction, values: Values, sample: bool = False) -> dict[int, Resonances]:
    """`Resonances` of every block that scalars are read off, of all vehicles of a grid together.

    sample: where the eigenvalues of a vehicle cannot tell a peak's width, its poles are taken for unknown. Without it
    they are counted by the determinant, which takes longer.
    """
    found = _tables(reduction, values, sample)
    return {index: _told(each, ...) for index, each in found.items()}


def resonances_of_each(reduction: Reduction, values: Values, count: int) -> list[dict[int, Resonances]]:
    """The same of each of `count` vehicles, whose values are floats or arrays [count]."""
    found = _tables(reduction, values, False)
    return [
        {index: _told(each, slice(v, v + 1) if each.poles.ndim > 1 else ...) for index, each in found.items()}
        for v in range(count)
    ]


def every_pole(found: Mapping[int, Resonances]) -> NDArray[np.complex128]:
    """The poles of all blocks, rad/s."""
    return np.concatenate([each.poles for each in found.values()])


@dataclass(frozen=True)
class _Table:
    """Of a block's vehicles: what `Resonances` has, [grid..., k], and which poles there are; finite: [grid...]."""

    poles: NDArray[np.complex128]
    known: NDArray[np.bool_]
    shift: Array
    errors: dict[int, Array]
    there: NDArray[np.bool_]
    finite: NDArray[np.bool_]


def _told(table: _Table, some: Any) -> Resonances:
    finite = table.finite[some]
    here = table.there[some] & finite[..., None]
    nothing = np.full(int(np.sum(~finite)), np.nan)
    return Resonances(
        np.append(table.poles[some][here], nothing),
        np.append(table.known[some][here], nothing == 0),
        np.append(table.shift[some][here], nothing),
        {k: np.append(error[some][here], nothing) for k, error in table.errors.items()},
    )


def _tables(reduction: Reduction, values: Values, sample: bool) -> dict[int, _Table]:
    result = {}
    plain = bases(reduction)
    with np.errstate(all="ignore"):
        for index, each in expand(reduction, values).items():
            some = {k: plain.scalars[k] for k in each.residues}
            shift, errors = _sensitivities(reduction, index, some, values, each)
            result[index] = _Table(
                each.poles,
                _known(reduction, index, values, each, sample),
                shift,
                errors,
                each.weight > 0,
                np.asarray(np.isfinite(each.raw).all(axis=-1)),
            )
    return result


def _sensitivities(
    reduction: Reduction, index: int, some: Mapping[int, Scalar], values: Values, each: Expansion
) -> tuple[Array, dict[int, Array]]:
    """What changes in the last digits of a block's matrix make of its peaks, relative: [grid..., k].

    (shift of the poles, changes of the residues of scalars). With z the null vector, G of `free_oscillation.inverse` and
    r = (c^T z)(b^T z)/(z^T K' z), a change dK moves the pole by dp = -z^T dK z/(z^T K' z) and

        d log r = -(w - kappa z)^T dK z,  w = G (c/c^T z + b/b^T z - 2 K' z/(z^T K' z)),  kappa = w^T K' z/(z^T K' z),

    but for the change of K' itself. Normalising z cancels in it.
    """
    block, grid = reduction.blocks[index], each.poles.shape
    p, own = at_poles(block, reduction.lengths, values, each.poles, each.weight)
    matrix, z, carried = null_vectors(block, reduction.lengths, own, p)
    uncertain = uncertainty(block, matrix, z)
    by_s = derivative(block, matrix)
    slope = np.sum(by_s * np.square(z), axis=-1)
    size = np.sum(np.abs(by_s * np.square(z)), axis=-1)
    shift = np.sum(np.abs(z) * uncertain, axis=-1) / np.abs(slope * p)
    of_laws = np.array([np.broadcast_to(matrix.slopes[strut.law][1], p.shape) for strut in block.struts])
    direct = np.sum(np.abs(by_s * np.square(z))[:, block.size :] * of_laws.T, axis=-1) / np.abs(slope)
    direct = direct * (1 + shift / EPSILON) + 4 * EPSILON * size / np.abs(slope)
    errors = {}
    for k, scalar in some.items():
        c = np.zeros(z.shape, complex)
        if scalar.quantity == "displacement":
            for i, entry in enumerate(reduction.lengths.evaluate(scalar.row, own)):
                c[:, i] = entry * matrix.scale[:, i]
        else:
            c[:, block.size + scalar.of] = matrix.scale[:, block.size + scalar.of]
        b = np.zeros(z.shape, complex)
        b[:, block.size + scalar.strut] = 1.0
        v = c / np.sum(c * z, axis=-1)[:, None] + b / np.sum(b * z, axis=-1)[:, None] - 2 * by_s * z / slope[:, None]
        w = np.einsum("nij,nj->ni", carried, v)
        kappa = np.sum(w * by_s * z, axis=-1) / slope
        error = np.sum(np.abs(w - kappa[:, None] * z) * uncertain, axis=-1) + direct
        if scalar.quantity != "displacement":
            error = error + of_laws[scalar.of]
        residue = each.residues[k].ravel()
        errors[k] = np.where(residue == 0, 0.0, error).reshape(grid)
    return shift.reshape(grid), errors


def _known(reduction: Reduction, index: int, values: Values, each: Expansion, sample: bool) -> NDArray[np.bool_]:
    """Whether a block's poles are known, [grid..., k]."""
    known = ~each.lost
    shape = each.raw.shape[:-1]
    for place in np.argwhere(np.any(is_lost(each.raw), axis=-1)):
        at = tuple(map(int, place))
        own = {name: float(np.broadcast_to(v, shape)[at]) if np.ndim(v) else v for name, v in values.items()}
        known[at] &= not sample and _complete(reduction, index, own, _all_of(each, at))
    return known


def is_lost(poles: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Eigenvalues [..., n] whose real parts, the widths of their peaks, may be lost in the rounding of the largest."""
    largest = np.max(np.where(np.abs(poles) < 2 * FAR, np.abs(poles), 0.0), axis=-1, keepdims=True, initial=0.0)
    return np.asarray(np.abs(poles.real) < ROUNDED_BELOW * largest)


def _all_of(each: Expansion, at: tuple[int, ...]) -> NDArray[np.complex128]:
    """All poles [n] of a vehicle: polished, with their conjugates, and the far ones as computed."""
    weight, p, raw = each.weight[at], each.poles[at], each.raw[at]
    far = raw[(np.abs(raw) >= FAR) & (np.abs(raw + 2 * FAR) > 1e-6 * FAR)]
    return np.concatenate([p[weight > 0], np.conj(p[weight > 1]), far[np.abs(far.imag) <= LIGHT * np.abs(far)]])


def _complete(reduction: Reduction, index: int, values: Values, poles: NDArray[np.complex128]) -> bool:
    """Whether poles [n] are those of a block of a single vehicle, each once.

    The determinant of its matrix, times the numerators of its struts' stiffnesses, is a polynomial of s with these
    roots. On the positive axis its elimination adds terms of one sign only; at s = |p| a pole that is not there shows.
    """
    block = reduction.blocks[index]
    size = np.abs(poles[np.abs(poles) < FAR])
    s = np.append(size, 2 * np.max(size, initial=1.0))
    parts = parts_of(block, reduction.lengths, values, s, np.square(s), {})
    factors = parts.factors()
    logarithm: Number = -sum(np.log(np.abs(each)) for each in factors.inverse.values())
    for strut in block.struts:
        numerator = np.abs(strut.law.quotient(values, s)[0])
        logarithm = logarithm + np.log(np.where(numerator > 0, numerator, 1.0))
    product = np.sum(np.log(np.abs(s[:, None] - poles)), axis=-1)
    apart = logarithm - product
    return bool(np.ptp(apart) < SAME)
