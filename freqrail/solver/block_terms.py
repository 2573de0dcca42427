"""Coefficients of the closed form over blocks: what poles of the blocks are worth in every column, whatever the speed.

See `solver.block_residues` for the integrals; a row is a column of an output. Rows of one lag function that the same
blocks take part in stand side by side, as a `Group`. What depends on the speed is in `solver.block_waves`.
"""

from __future__ import annotations

import functools
import itertools
import operator
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.reduction.columns import Column, Reduction, lag_sums
from freqrail.solver.block_poles import Array, Complex, Expansion, bases, expand, multiplier, poles_first, poles_last
from freqrail.solver.block_response import column, scalars
from freqrail.solver.closed_form import EPSILON, LOSS, SAFETY
from freqrail.solver.elimination import times
from freqrail.types import Number

Row = tuple[str, Column]
"""A column, with the name of its output."""


@dataclass(frozen=True)
class Product:
    """coefficient x X(s) Y(-s) in a row's integrals J: row, scalars of X and Y."""

    row: int
    x: int
    y: int
    coefficient: float


def products_of(rows: list[Row]) -> list[Product]:
    """Every product of the rows."""
    result = []
    for row, (_, each) in enumerate(rows):
        for i, j, part, factor in each.powers:
            sign = 1.0 if part == "re" else -1.0
            scale = factor * 2 * np.pi / 4
            result += [Product(row, i, j, sign * scale), Product(row, j, i, scale)]
    return result


@dataclass(frozen=True)
class Group:
    """Rows side by side with one lag function, in which the same blocks take part: lag, rows, blocks."""

    lag: int
    rows: slice
    blocks: frozenset[int]


def rows_of(reduction: Reduction) -> tuple[list[Row], list[Group]]:
    """Every column of every output, and their groups."""

    def key(row: Row) -> tuple[int, list[int]]:
        each = row[1]
        return each.lag, sorted({reduction.scalars[k].block for i, j, _, _ in each.powers for k in (i, j)})

    rows = sorted(((name, each) for name, some in reduction.columns.items() for each in some), key=key)
    groups, start = [], 0
    for (lag, blocks), some in itertools.groupby(rows, key=key):
        count = len(list(some))
        groups.append(Group(lag, slice(start, start + count), frozenset(blocks)))
        start += count
    return rows, groups


@dataclass(frozen=True)
class Distances:
    """Those between wheels, and every lag function as a sum over them.

    d: [distances], each a float or [grid...], m, not negative. factors: [lags, distances] or [grid..., lags,
    distances]. sums: {k: (i, j)} where d_k = d_i + d_j for all vehicles and d_i is no such sum.
    """

    d: list[Number]
    factors: Array
    sums: dict[int, tuple[int, int]]


def distances_of(reduction: Reduction, values: Values) -> Distances:
    forms, factors = lag_sums(reduction)
    some = np.flatnonzero(np.any(factors, axis=0))
    forms, factors = forms[some], factors[:, some]
    d = reduction.lengths.evaluate(forms, values)
    backwards = set()
    for k, x in enumerate(d):
        if np.any(np.less(x, 0)):  # lengths that vary may change the order of two wheels: cosines stay, sines turn
            d[k] = np.abs(x)
            backwards.add(k)
            odd = np.array([lag.part == "im" for lag in reduction.lags])
            turned = np.where(odd, np.sign(x)[..., None], 1.0)
            factors = np.broadcast_to(factors, (*turned.shape[:-1], *factors.shape[-2:])).copy()
            factors[..., k] *= turned
    # of the forms, so that a sum holds for all vehicles, whoever is in company
    sums: dict[int, tuple[int, int]] = {}
    size = [float(np.sum(np.abs(form))) for form in forms]
    order = [k for k in sorted(range(len(forms)), key=size.__getitem__) if k not in backwards]
    for place, k in enumerate(order):
        below = [i for i in order[:place] if size[i] > 0]
        pairs = [(i, j) for i in below if i not in sums for j in below]
        same = [(i, j) for i, j in pairs if np.all(np.abs(forms[i] + forms[j] - forms[k]) <= 4 * EPSILON * size[k])]
        if same:
            sums[k] = same[0]
    return Distances(d, factors, sums)


@dataclass(frozen=True)
class ReadBlock:
    """A block at its poles p: partial fractions, possible errors of the residues, what is read of every scalar there.

    residue_errors: {own scalar: [grid..., k]}. direct: every scalar's base, as `Expansion` has it, [grid..., k], at -p
    of a well damped pole, at |p| of a light one.
    """

    expansion: Expansion
    residue_errors: dict[int, Array]
    direct: list[Number]

    def at(self, grid: tuple[int, ...], places: tuple[NDArray[np.intp], ...]) -> ReadBlock:
        """That of the vehicles at some places of a grid, an index array [r] an axis, as a grid [r, 1]."""

        def taken(x: NDArray, inner: int = 1) -> NDArray:
            return np.broadcast_to(x, (*grid, *x.shape[x.ndim - inner :]))[places][:, None]

        each = self.expansion
        tables = [{k: taken(x) for k, x in table.items()} for table in (each.residues, each.rounding)]
        expansion = replace(
            each,
            poles=taken(each.poles),
            weight=taken(each.weight),
            residues=tables[0],
            rounding=tables[1],
            defect=taken(each.defect),
            light=taken(each.light),
            shift=taken(each.shift),
            lost=taken(each.lost),
            raw=taken(each.raw),
        )
        errors = {k: taken(x) for k, x in self.residue_errors.items()}
        return ReadBlock(expansion, errors, [taken(x) for x in self.direct])


def read_blocks(reduction: Reduction, values: Values) -> dict[int, ReadBlock]:
    """Every block with its residues held against what is read directly.

    At -p of a well damped pole the elimination adds positive terms only; a wrong residue r of p shows there as r/(2 p).
    Of a light pole -p lies beside other poles, and |p| serves. But its peak hangs on its residue alone, however small
    it is among others': there what rounding may have left is counted, and of the check what that cannot explain. Nor
    does it see a pole and a residue that are off in the same ratio: what rounding may move a pole by counts too.
    """
    plain, spread_values = bases(reduction), column(values)
    result = {}
    for index, each in expand(reduction, values).items():
        p, size = each.poles, np.abs(each.poles)
        at = np.where(each.light, size, -p)
        direct = scalars(plain, spread_values, at, np.square(at)).values()
        errors = {}
        fractions, rounded = each.fractions(tuple(each.residues), at)
        for place, (k, residue) in enumerate(each.residues.items()):
            missing = np.abs(fractions[place] - direct[k])
            beyond = np.maximum(0.0, missing - rounded[place] - LOSS / SAFETY * np.abs(direct[k]))
            own = np.where(each.light, each.rounding[k], SAFETY * each.shift * np.abs(residue))
            error = SAFETY * 2 * size * np.where(each.light, beyond, missing) + own
            errors[k] = np.where(np.any(each.lost, axis=-1, keepdims=True), np.inf, error)
        result[index] = ReadBlock(each, errors, direct)
    return result


@dataclass(frozen=True)
class PoleTerms:
    """What the poles [grid..., k] of a block are worth in the groups of rows that it takes part in, before any lag.

    weight: [grid..., rows, 2 x states], to be multiplied with real and imaginary parts of waves e^{p d} G(p), those of
    the rows of all groups one after the other; error: [grid..., rows, states], with |G|. As many terms as the block has
    states, zeros behind the poles: BLAS picks its order of summation by the shape of a product.
    """

    expansion: Expansion
    groups: list[Group]
    weight: Array
    error: Array


def pole_terms(
    blocks: dict[int, ReadBlock],
    index: int,
    products: list[Product],
    groups: list[Group],
    reduction: Reduction,
    values: Values,
    loss: list[Array],
) -> PoleTerms:
    """The terms of a block: the sum of coefficient x residue of X x Y(-p) over the products of every row.

    products: those with X of the block. loss: of every row. Y(-p) is read off directly where the pole p is well damped,
    and comes from partial fractions where it is light, which near the mirror image of another pole see the true
    distance, but are as wrong as the residues in them.
    """
    each, p = blocks[index].expansion, blocks[index].expansion.poles
    present, spread_values = each.weight > 0, column(values)
    mirrors = _mirrored(blocks, index, {product.y for product in products}, reduction, spread_values)
    heads: dict[int, tuple[Number, Number, Number]] = {}
    for x in dict.fromkeys(product.x for product in products):
        scale = times(each.weight, multiplier(reduction.scalars[x], reduction.blocks[index], spread_values, p))
        head = np.where(present, times(scale, each.residues[x]), 0.0)
        heads[x] = head, np.abs(head), np.where(present, np.abs(scale) * blocks[index].residue_errors[x], 0.0)
    pairs: dict[tuple[int, int], tuple[Number, Number]] = {}
    for x, y in dict.fromkeys((product.x, product.y) for product in products):
        (head, size, head_error), (mirrored, mirrored_size, wrong) = heads[x], mirrors[y]
        term, error = times(head, mirrored), mirrored_size * head_error + size * wrong
        pairs[x, y] = np.where(present, term, 0.0), np.where(present, error, 0.0)
    own = [group for group in groups if index in group.blocks]
    rows = [row for group in own for row in range(group.rows.start, group.rows.stop)]
    shape = np.broadcast_shapes(*(np.shape(term) for term, _ in pairs.values()))
    shape = np.broadcast_shapes(shape, *((*np.shape(loss[row]), 1) for row in rows))
    weight = np.zeros((*shape[:-1], len(rows), 2, each.states))
    errors = np.zeros((*shape[:-1], len(rows), each.states))
    by_row: dict[int, list[Product]] = {}
    for product in products:
        by_row.setdefault(product.row, []).append(product)
    for place, row in enumerate(rows):
        terms = [(product.coefficient, *pairs[product.x, product.y]) for product in by_row[row]]
        total = _total(c * term for c, term, _ in terms)
        weight[..., place, 0, : shape[-1]] = total.real
        weight[..., place, 1, : shape[-1]] = -total.imag
        error = _total(abs(c) * error for c, _, error in terms)
        errors[..., place, : shape[-1]] = error + loss[row][..., None] * np.abs(total)
    return PoleTerms(each, own, weight.reshape(*weight.shape[:-2], -1), errors)


def _mirrored(
    blocks: dict[int, ReadBlock], index: int, wanted: set[int], reduction: Reduction, spread_values: Values
) -> dict[int, tuple[Complex, Array, Number]]:
    """Y(-p) of scalars at a block's poles p, its size, and how wrong it may be: [grid..., k]."""
    block, each = blocks[index], blocks[index].expansion
    p = each.poles
    bright = np.flatnonzero(np.any(each.light, axis=tuple(range(p.ndim - 1))))  # places at which some poles are light
    light = each.light[..., bright]
    result: dict[int, tuple[Complex, Array, Number]] = {}
    for other in blocks.values():
        some = [y for y in other.expansion.residues if y in wanted]
        if some and bright.size:
            fractions = other.expansion.fractions(some, -p[..., bright], known=False)[0]
            weights = mirror_weights(p[..., bright], other.expansion)
        for place, y in enumerate(some):
            scalar = reduction.scalars[y]
            factor = multiplier(scalar, reduction.blocks[scalar.block], spread_values, -p)
            value, wrong = times(factor, block.direct[y]), np.zeros(1)
            if bright.size:
                errors = poles_first(other.residue_errors[y])[..., None]
                lacking = np.where(light, _total(map(times, weights, errors)), 0.0)
                factor = factor if np.ndim(factor) == 0 else factor[..., bright]
                near = np.where(light, times(factor, fractions[place]), value[..., bright])
                value, wrong = _with(value, bright, near), _with(np.zeros(p.shape), bright, np.abs(factor) * lacking)
            result[y] = value, np.abs(value), wrong
    return result


def _with(values: NDArray, places: NDArray[np.intp], others: NDArray) -> NDArray:
    """Values [grid..., k] with those at some places of the last axis replaced by others, poles first in memory."""
    shape = np.broadcast_shapes(values.shape[:-1], others.shape[:-1])
    result = np.empty((values.shape[-1], *shape), values.dtype)
    result[:] = poles_first(np.broadcast_to(values, (*shape, values.shape[-1])))
    result[places] = poles_first(np.broadcast_to(others, (*shape, len(places))))
    return poles_last(result)


def mirror_weights(p: Complex, other: Expansion) -> list[Array]:
    """What an error of a residue of another block's upper pole (and its conjugate) makes of partial fractions at -p:
    at most this much a unit, [grid..., k], for each of the other's poles."""
    result, height = [], np.abs(p.imag)
    for k in range(other.poles.shape[-1]):
        q, weight = other.poles[..., k, None], other.weight[..., k, None]
        apart = np.sqrt(np.square(p.real + q.real) + np.square(height - np.abs(q.imag)))
        result.append(np.where(weight > 0, weight / apart, 0.0))
    return result


def losses_of(reduction: Reduction, rows: list[Row], blocks: dict[int, ReadBlock]) -> list[Array]:
    """Relative error that rounding leaves in the terms of every row, [grid...] each.

    A peak's height goes with the distance of a pole from another's mirror image, for light poles that are nearly equal
    in two blocks about twice the real part, while the imaginary parts are only known to a rounding error.
    """
    sharpness: dict[int, Array] = {}
    for index, block in blocks.items():
        p = block.expansion.poles
        sharp = np.where(block.expansion.weight > 0, np.abs(p) / np.abs(2 * p.real), 0.0)
        sharpness[index] = np.max(sharp, axis=-1)
    of_output = {}
    for name, labels in reduction.sums.items():
        taking_part = {reduction.scalars[i].block for terms in labels for i, _ in terms}
        of_output[name] = LOSS + 8 * EPSILON * functools.reduce(np.maximum, map(sharpness.__getitem__, taking_part))
    return [of_output[name] for name, _ in rows]


def _total(terms: Iterable[NDArray]) -> NDArray:
    """The sum of arrays, one after the other: so its bits do not depend on their shape."""
    return functools.reduce(operator.add, terms)
