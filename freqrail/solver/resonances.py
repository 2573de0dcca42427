"""Resonances of the blocks as quadrature sees them: where peaks lie, how wide they are, what rounding makes of them.

An elimination with rounding is the exact one of a vehicle whose numbers differ in their last digits; what that does to
a peak, its place and its height, `solver.free_oscillation` tells.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_poles import UNSURE, Expansion, expansion
from freqrail.solver.block_response import parts_of, used
from freqrail.solver.closed_form import FAR, LIGHT
from freqrail.solver.frozen_laws import resonances_frozen
from freqrail.types import Number

Array = NDArray[np.float64]

ROUNDED_BELOW = 1e-9  # of the largest eigenvalue: real parts smaller than this are not taken from eigenvalues
SAME = 1e-6  # relative error of a product of poles up to which it counts as known


@dataclass(frozen=True)
class Resonances:
    """Poles of a block of one vehicle or many, rad/s: [n], those with Im >= 0, and what rounding makes of responses.

    known: [n], whether its peak surely lies there, as wide as the pole tells. shift: how far rounding moves a
    peak, relative to its frequency. vehicle: [n], whose it is. residues: of the bases of the block's scalars, with
    their errors, {scalar: [n]}. All NaN where a vehicle's numbers overflow.
    """

    poles: NDArray[np.complex128]
    known: NDArray[np.bool_]
    shift: Array
    vehicle: NDArray[np.intp]
    residues: dict[int, NDArray[np.complex128]]
    errors: dict[int, Array]

    def some(self, which: NDArray[np.bool_]) -> Resonances:
        """Some of them."""
        return Resonances(
            self.poles[which],
            self.known[which],
            self.shift[which],
            self.vehicle[which],
            {k: x[which] for k, x in self.residues.items()},
            {k: x[which] for k, x in self.errors.items()},
        )


def resonances(
    reduction: Reduction, values: Values, shape: tuple[int, ...] = (), sample: bool = False
) -> dict[int, Resonances]:
    """`Resonances` of every block that scalars are read off, of all vehicles of a grid [shape] together.

    sample: where the eigenvalues of a vehicle cannot tell a peak's width, its poles are taken for unknown. Without it
    they are counted by the determinant, which takes longer.
    """
    result = {}
    with np.errstate(all="ignore"):
        for index, block, _ in used(reduction):
            if all(strut.law.rational for strut in block.struts):
                each = expansion(reduction, index, values)
                known = _known(reduction, index, values, each, sample)
                finite = np.asarray(np.isfinite(each.raw).all(axis=-1))
                tables = (each.poles, known, each.shift, each.residues, each.rounding)
                result[index] = _told(*tables, each.weight > 0, finite, shape)
            else:
                found = resonances_frozen(block, reduction.lengths, values)
                everywhere = np.ones(found.shape[:-1], dtype=bool)
                nothing = np.zeros(found.shape)
                result[index] = _told(found, np.isfinite(found), nothing, {}, {}, found.imag > 0, everywhere, shape)
    return result


def resonances_of_each(reduction: Reduction, values: Values, count: int) -> list[dict[int, Resonances]]:
    """The same of each of `count` vehicles, whose values are floats or arrays [count]."""
    found = resonances(reduction, values, (count,))
    result = []
    for v in range(count):
        own = {index: each.some(each.vehicle == v) for index, each in found.items()}
        result.append({index: replace(each, vehicle=0 * each.vehicle) for index, each in own.items()})
    return result


def every_pole(found: Mapping[int, Resonances]) -> NDArray[np.complex128]:
    """The poles of all blocks, rad/s."""
    return np.concatenate([each.poles for each in found.values()])


def _told(
    poles: NDArray[np.complex128],
    known: NDArray[np.bool_],
    shift: Array,
    residues: dict[int, NDArray[np.complex128]],
    errors: dict[int, Array],
    there: NDArray[np.bool_],
    finite: NDArray[np.bool_],
    shape: tuple[int, ...],
) -> Resonances:
    """Tables [grid..., k] one pole after the other; there: which poles there are; finite: [grid...]."""
    wide = (*shape, poles.shape[-1])
    here = np.broadcast_to(there & finite[..., None], wide)
    missing = np.flatnonzero(~np.broadcast_to(finite, shape).ravel())
    vehicle = np.broadcast_to(np.arange(math.prod(shape)).reshape(*shape, 1), wide)
    nothing = np.full(missing.size, np.nan)

    def flat(table: NDArray) -> NDArray:
        return np.append(np.broadcast_to(table, wide)[here], nothing)

    return Resonances(
        flat(poles),
        flat(known) == 1,
        flat(shift),
        np.append(vehicle[here], missing),
        {k: flat(x) for k, x in residues.items()},
        {k: flat(x) for k, x in errors.items()},
    )


def _known(reduction: Reduction, index: int, values: Values, each: Expansion, sample: bool) -> NDArray[np.bool_]:
    """Whether a block's poles are known, [grid..., k]; what does not oscillate is no peak."""
    known = ~each.lost | (each.poles.imag == 0)
    for place in np.argwhere(np.any(is_lost(each.raw), axis=-1)):
        at = tuple(map(int, place))
        own = {name: _number_at(v, at) for name, v in values.items()}
        known[at] &= not sample and _complete(reduction, index, own, _all_of(each, at))
    return known


def _number_at(value: Number, at: tuple[int, ...]) -> float:
    """A value of the vehicle at an index of a block's grid: all axes, those that it does not feel of length 1."""
    array = np.asarray(value)
    own = zip(at[len(at) - array.ndim :], array.shape, strict=True)
    return float(array[tuple(k if n > 1 else 0 for k, n in own)])


def is_lost(poles: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Eigenvalues [..., n] whose real parts, the widths of their peaks, may be lost in the rounding of the largest."""
    largest = np.max(np.where(np.abs(poles) < 2 * FAR, np.abs(poles), 0.0), axis=-1, keepdims=True, initial=0.0)
    return np.asarray(np.abs(poles.real) < ROUNDED_BELOW * largest)


def _all_of(each: Expansion, at: tuple[int, ...]) -> NDArray[np.complex128]:
    """All poles [n] of a vehicle: polished, with their conjugates; the far ones, and others that are not, as computed.

    Beside a leg's own pole, where its stiffness is infinite, a pole that does not oscillate may escape the polishing.
    """
    weight, p, raw = each.weight[at], each.poles[at], each.raw[at]
    computed = raw[np.argmin(np.abs(raw - p[:, None]), axis=-1)]
    p = np.where((p.imag == 0) & ~(each.shift[at] < UNSURE), computed, p)
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
