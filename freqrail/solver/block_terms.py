"""Terms of the closed form over blocks: what poles of the blocks and of the track add to every column.

See `solver.block_residues` for the integrals; a row is a column of an output.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.inputs import cos_sin
from freqrail.model.spectrum import RationalSpectrum
from freqrail.reduction.columns import Column, Reduction, lag_sums
from freqrail.solver.block_poles import Array, Complex, Expansion, bases, expand, multiplier
from freqrail.solver.block_response import column, scalars
from freqrail.solver.closed_form import EPSILON, LOSS, SAFETY
from freqrail.types import Number


@dataclass(frozen=True)
class Product:
    """coefficient x X(s) Y(-s) in a row's integrals J: row, scalars of X and Y."""

    row: int
    x: int
    y: int
    coefficient: float


def products_of(rows: list[tuple[str, Column]]) -> list[Product]:
    result = []
    for row, (_, each) in enumerate(rows):
        for i, j, part, factor in each.powers:
            sign = 1.0 if part == "re" else -1.0
            scale = factor * 2 * np.pi / 4
            result += [Product(row, i, j, sign * scale), Product(row, j, i, scale)]
    return result


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
    for k, x in enumerate(d):
        if np.any(np.less(x, 0)):  # lengths that vary may change the order of two wheels: cosines stay, sines turn
            d[k] = np.abs(x)
            odd = np.array([lag.part == "im" for lag in reduction.lags])
            turned = np.where(odd, np.sign(x)[..., None], 1.0)
            factors = np.broadcast_to(factors, (*turned.shape[:-1], *factors.shape[-2:])).copy()
            factors[..., k] *= turned
    sums: dict[int, tuple[int, int]] = {}
    size = [float(np.max(x)) for x in d]
    order = sorted(range(len(d)), key=size.__getitem__)
    for place, k in enumerate(order if all(np.ndim(x) == 0 for x in d) else []):
        below = [i for i in order[:place] if size[i] > 0]
        pairs = [(i, j) for i in below if i not in sums for j in below]
        same = [(i, j) for i, j in pairs if abs(size[i] + size[j] - size[k]) <= 4 * EPSILON * size[k]]
        if same:
            sums[k] = same[0]
    return Distances(d, factors, sums)


@dataclass(frozen=True)
class ReadBlock:
    """A block at its poles p: partial fractions, possible errors of the residues, what is read of every scalar there.

    residue_errors: {own scalar: [grid..., k]}. at: [grid..., k], -p of a well damped pole, |p| of a light one. direct:
    every scalar's base read at these. factors, mirrored: what makes X of every base at p and at -p.
    """

    expansion: Expansion
    residue_errors: dict[int, Array]
    direct: list[Number]
    factors: list[Number]
    mirrored: list[Number]


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
        p = each.poles
        at = np.where(each.light, np.abs(p), -p)
        direct = scalars(plain, spread_values, at, np.square(at)).values()
        errors = {}
        fractions, rounded = each.fractions(tuple(each.residues), at)
        for place, (k, residue) in enumerate(each.residues.items()):
            known, missing = rounded[place], np.abs(fractions[place] - direct[k])
            beyond = np.maximum(0.0, missing - known - LOSS / SAFETY * np.abs(direct[k]))
            own = np.where(each.light, each.rounding[k], SAFETY * each.shift * np.abs(residue))
            error = SAFETY * 2 * np.abs(p) * np.where(each.light, beyond, missing) + own
            errors[k] = np.where(each.lost[..., None], np.inf, error)
        factors, mirrored = (
            [multiplier(x, reduction.blocks[x.block], spread_values, s) for x in reduction.scalars] for s in (p, -p)
        )
        result[index] = ReadBlock(each, errors, direct, factors, mirrored)
    return result


def pole_terms(
    blocks: dict[int, ReadBlock],
    index: int,
    products: list[Product],
    count: int,
    reduction: Reduction,
    lags: Array,
    distances: Distances,
    loss: Array,
    spectrum: RationalSpectrum,
    speed: Array,
) -> tuple[Array, Array]:
    """What the poles of a block add to every row: (value, error), [grid..., rows, speeds].

    One matrix product a vehicle: coefficients [rows, parts of poles and lags] times waves [.., speeds]. Y(-p) is read
    off directly where the pole p is well damped, and comes from partial fractions where it is light, which near the
    mirror image of another pole see the true distance, but are as wrong as the residues in them.
    """
    block = blocks[index]
    each, p = block.expansion, block.expansion.poles
    mirrors: dict[int, tuple[Complex, Array]] = {}
    paired = {product.y for product in products}
    for other in blocks.values():
        some = [y for y in other.expansion.residues if y in paired]
        if not some:
            continue
        fractions, _ = other.expansion.fractions(some, -p)
        weights_of = _mirror_weights(p, other.expansion)
        for place, y in enumerate(some):
            wrong = _total(np.moveaxis(weights_of * other.residue_errors[y][..., None, :], -1, 0))
            mirrors[y] = (
                block.mirrored[y] * np.where(each.light, fractions[place], block.direct[y]),
                np.abs(block.mirrored[y]) * np.where(each.light, wrong, 0.0),
            )
    weights: dict[int, Number] = {}
    uncertain: dict[int, Number] = {}
    for product in products:
        scale = product.coefficient * each.weight * block.factors[product.x]
        residue, residue_error = each.residues[product.x], block.residue_errors[product.x]
        mirrored, wrong = mirrors[product.y]
        weights[product.row] = weights.get(product.row, 0.0) + np.multiply(np.multiply(scale, residue), mirrored)
        error = np.abs(scale) * (np.abs(mirrored) * residue_error + np.abs(residue) * wrong)
        uncertain[product.row] = uncertain.get(product.row, 0.0) + error
    present = sorted(weights)
    weight = np.stack(np.broadcast_arrays(*(weights[row] for row in present)), axis=-2)
    error = np.stack(np.broadcast_arrays(*(uncertain[row] for row in present)), axis=-2)
    weight, error = (np.where(each.weight[..., None, :] > 0, x, 0.0) for x in (weight, error))
    error = error + loss[..., present, None] * np.abs(weight)
    # as many terms as the block has states: BLAS picks its order of summation by the shape of the product
    weight, error = (_padded(x, each.states, -1) for x in (weight, error))
    waves, density = _waves(p, each, distances, spectrum, speed)
    of_rows = lags[..., present, :]
    parts = np.stack([weight.real, -weight.imag], axis=-2)[..., None, :] * of_rows[..., None, :, None]
    value = parts.reshape(*parts.shape[:-3], -1) @ waves
    bound = (error * np.sum(np.abs(of_rows), axis=-1)[..., None]) @ density
    if len(present) == count:
        return value, bound
    result = np.zeros((2, *value.shape[:-2], count, value.shape[-1]))
    result[0][..., present, :], result[1][..., present, :] = value, bound
    return result[0], result[1]


def _mirror_weights(p: Complex, other: Expansion) -> Array:
    """What an error of a residue of another block's upper pole (and its conjugate) makes of partial fractions at -p:
    at most this much a unit, [grid..., k, other's k]."""
    q = other.poles[..., None, :]
    apart = np.hypot(p.real[..., None] + q.real, np.abs(p.imag[..., None]) - np.abs(q.imag))
    return np.where(other.weight[..., None, :] > 0, other.weight[..., None, :] / apart, 0.0)


def _padded(values: NDArray, width: int, axis: int) -> NDArray:
    missing = [(0, 0)] * values.ndim
    missing[axis] = (0, width - values.shape[axis])
    return np.pad(values, missing)


def losses_of(reduction: Reduction, rows: list[tuple[str, Column]], blocks: dict[int, ReadBlock]) -> Array:
    """Relative error that rounding leaves in the terms of every row, [grid..., rows].

    A peak's height goes with the distance of a pole from another's mirror image, for light poles that are nearly equal
    in two blocks about twice the real part, while the imaginary parts are only known to a rounding error.
    """
    sharpness: dict[int, Array] = {}
    for index, block in blocks.items():
        p = block.expansion.poles
        sharp = np.where(block.expansion.weight > 0, np.abs(p) / np.abs(2 * p.real), 0.0)
        sharpness[index] = np.max(sharp, axis=-1)
    of_output = {
        name: functools.reduce(
            np.maximum,
            {
                reduction.scalars[i].block: sharpness[reduction.scalars[i].block] for terms in labels for i, _ in terms
            }.values(),
        )
        for name, labels in reduction.sums.items()
    }
    return LOSS + 8 * EPSILON * np.stack(np.broadcast_arrays(*(of_output[name] for name, _ in rows)), axis=-1)


def _waves(
    p: Complex, each: Expansion, distances: Distances, spectrum: RationalSpectrum, speed: Array
) -> tuple[Array, Array]:
    """G(s) e^{s d} at poles p [grid..., k] for the distances at every speed, and |G|, [grid..., states, speeds].

    The waves are [grid..., 2 x distances x states, speeds]: real and imaginary parts of each lag of each pole, then
    zeros.
    """
    v = speed[..., None, :]
    low, high = (np.square(v * cutoff) for cutoff in spectrum.cutoffs)
    s2 = np.square(p)[..., None]
    # S_v(omega/v)/v with omega^2 = -s^2 (eq. 11)
    density = spectrum.roughness * spectrum.cutoffs[1] ** 2 * v**3 / ((low - s2) * (high - s2))
    density = np.where(each.weight[..., None] > 0, density, 0.0)
    pure: dict[int, Complex] = {}  # e^{s d}, where another lag is made of it
    lagged: dict[int, Complex] = {}
    for k in sorted(range(len(distances.d)), key=lambda k: float(np.max(distances.d[k]))):
        if not np.any(distances.d[k]):
            lagged[k] = density
        elif k in distances.sums:
            i, j = distances.sums[k]
            lagged[k] = np.multiply(pure[i], lagged[j])
        else:
            pure[k] = _exponential(p, np.asarray(distances.d[k])[..., None, None] / v)
            lagged[k] = np.multiply(pure[k], density)
    shape = np.broadcast_shapes(density.shape, *(wave.shape for wave in lagged.values()))
    waves = np.zeros((*shape[:-2], 2, len(lagged), each.states, shape[-1]))
    for k, wave in lagged.items():
        waves[..., 0, k, : shape[-2], :], waves[..., 1, k, : shape[-2], :] = wave.real, wave.imag
    return waves.reshape(*shape[:-2], -1, shape[-1]), _padded(np.abs(density), each.states, -2)


def _exponential(p: Complex, delay: Array) -> Complex:
    """e^{p t} at poles p [grid..., k] for delays t [grid..., 1, speeds]."""
    size = np.exp(p.real[..., None] * delay)
    cosine, sine = cos_sin(p.imag[..., None] * delay)
    result = np.empty(size.shape, complex)
    result.real, result.imag = size * cosine, size * sine
    return result


def track_terms(
    reduction: Reduction,
    values: Values,
    blocks: dict[int, ReadBlock],
    products: list[Product],
    lags: Array,
    distances: Distances,
    spectrum: RationalSpectrum,
    speed: Array,
) -> Iterator[tuple[Array, Array]]:
    """What each pole q = -v Omega of the spectrum adds to every row, [grid..., rows, speeds].

    Scalars are read directly there.

    The residue of G times e^{q d} = e^{-Omega d} does not depend on the speed. On the negative axis an elimination that
    divides may meet a pivot near zero; so what is read is held against partial fractions.
    """
    low, high = spectrum.cutoffs
    scale = spectrum.roughness * high**2 / (high**2 - low**2) / 2
    plain, spread_values = bases(reduction), column(values)
    count = lags.shape[-2]
    for cutoff, residue in ((low, scale / low), (high, -scale / high)):
        q = -cutoff * speed
        read = {}
        for sign in (1.0, -1.0):
            found = scalars(plain, spread_values, sign * q, np.square(q))
            direct, errors = found.values(), dict.fromkeys(range(len(reduction.scalars)), 0.0)
            divided = [] if sign < 0 else [k for k, x in enumerate(found.fractions) if x.denominator < 0]
            for block in blocks.values():
                some = [k for k in block.expansion.residues if k in divided]
                if some:
                    _check(direct, errors, some, block, q)
            for k, scalar in enumerate(reduction.scalars):
                factor = np.real(multiplier(scalar, reduction.blocks[scalar.block], spread_values, sign * q))
                read[k, sign] = np.real(direct[k]) * factor, errors[k] * np.abs(factor)
        decay = np.stack(np.broadcast_arrays(*(residue * np.exp(-cutoff * d) for d in distances.d)), axis=-1)
        weight = np.sum(decay[..., None, :] * lags, axis=-1)
        size = np.sum(np.abs(decay)[..., None, :] * np.abs(lags), axis=-1)
        shape = np.broadcast_shapes(*(np.shape(x) for x, _ in read.values()), (*weight.shape[:-1], 1))
        value, error = np.zeros((2, *shape[:-1], count, shape[-1]))
        for each in products:
            (x, x_error), (y, _) = read[each.x, 1.0], read[each.y, -1.0]
            term = each.coefficient * (x * y)
            value[..., each.row, :] += weight[..., each.row, None] * term
            lost = LOSS * np.abs(term)
            if np.any(x_error):
                lost = lost + abs(each.coefficient) * x_error * np.abs(y)
            error[..., each.row, :] += size[..., each.row, None] * lost
        yield value, error


def _check(direct: list[Number], errors: dict[int, Number], some: list[int], block: ReadBlock, q: Array) -> None:
    """Replace entries of `direct`, bases of a block at q [..., speeds] as eliminated, and of their `errors`.

    They become partial fractions where these differ by more than they may be wrong.
    """
    each = block.expansion
    s = np.broadcast_to(q, np.broadcast_shapes(q.shape, (*each.poles.shape[:-1], 1))).astype(complex)
    found, _ = each.fractions(some, s)
    lacking = np.stack([each.weight * block.residue_errors[k] for k in some], axis=-2)
    known: Number = 0.0
    for k in range(each.poles.shape[-1]):
        apart = np.abs(s - each.poles[..., k, None])[..., None, :]
        known = known + np.where(each.weight[..., k, None, None] > 0, lacking[..., k, None] / apart, 0.0)
    for place, k in enumerate(some):
        fractions, wrong = found[place], known[..., place, :]
        difference = np.abs(direct[k] - fractions)
        bad = ~(difference <= wrong + LOSS * np.abs(fractions))
        direct[k] = np.where(bad, fractions, direct[k])
        errors[k] = np.where(bad, wrong, np.minimum(difference, wrong))


def _total(terms: NDArray) -> NDArray:
    """The sum over the first axis, one term after the other: so its bits do not depend on the other axes."""
    return functools.reduce(operator.add, terms)
