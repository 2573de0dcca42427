"""Mean squares over the whole frequency axis in closed form, over blocks, for a rational track spectrum.

With X and Y two scalars of the blocks, J_XY(d) = integral over all omega of X(i w) Y(-i w) G(w) e^{i w d} for a lag d >= 0
closes in the left half plane:

    J_XY(d) = 2 pi sum over the poles p of X and of G of Res[X(s) Y(-s) G(s) e^{s d}].

Each column of a reduction (`reduction.columns`) is a sum of such integrals over its powers and over the distances
between wheels that its lag function is a sum of: the integral over omega > 0 of Re(X Y*) cos(w d) G is (J_XY + J_YX)/4, of
Im(X Y*) sin(w d) G (J_YX - J_XY)/4. The poles of a vehicle do not depend on the speed: one eigenproblem serves all.

Where two poles of a block merge (critical damping) or one meets the spectrum's, the residues grow without bound and
cancel, though their sum is smooth. There the value is interpolated from vehicles with more and less damping.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Bending, Dashpot, Law, Values
from freqrail.model.spectrum import RationalSpectrum, Spectrum
from freqrail.reduction.chain_columns import cos_sin
from freqrail.reduction.columns import Column, Reduction, lag_sums
from freqrail.solver.block_poles import Array, Complex, Expansion, bases, expand, multiplier
from freqrail.solver.block_quadrature import shape_of
from freqrail.solver.block_response import column, scalars
from freqrail.solver.partial_fractions import EPSILON
from freqrail.solver.quadrature import MeanSquare
from freqrail.solver.residues import LOSS, MEETING, MERGING, SAFETY, SPREAD, SUPPORT, spread
from freqrail.types import Number

DEFECT = 0.05  # slope of a pole over its terms below which a pole near it may be merging with it
FEWER = slice(1, -1)  # nodes of a second interpolation, which tells the first one's error


def whole_axis_mean_squares(
    reduction: Reduction, values: Values, spectrum: Spectrum, speed: Array
) -> dict[str, MeanSquare]:
    """Mean squares over the whole axis of every output of a reduction, for a grid of vehicles and every speed.

    values: by parameter, broadcasting to [grid...]; speed: [m] in m/s. Returns {output: MeanSquare}, [labels, grid...,
    speeds]. The error estimate counts what the terms lose when they cancel and what the residues lack. A vehicle that is
    undamped or whose numbers overflow gives inf or nan, which the caller judges. Raises TypeError for a spectrum, and
    ValueError for a law, that is not rational.
    """
    if not isinstance(spectrum, RationalSpectrum):
        raise TypeError(f"the closed form is for rational spectra (got {type(spectrum).__name__})")
    grid = shape_of(values)
    own = {name: np.asarray(v) if np.size(v) > 1 else float(np.ravel(v)[0]) for name, v in values.items()}
    if not grid:
        first = reduction.system.inertias[0]
        own[first] = np.reshape(own[first], 1)
    with np.errstate(all="ignore"):
        parts = [(weight, _mean_squares(reduction, own, each, speed)) for weight, each in spread(spectrum)]
    result = {}
    for name in reduction.columns:
        value = np.sum([weight * part[name].value for weight, part in parts], axis=0)
        error = np.sum([abs(weight) * part[name].error for weight, part in parts], axis=0)
        shape = (value.shape[0], *grid, value.shape[-1])
        result[name] = MeanSquare(value.reshape(shape), error.reshape(shape))
    return result


def _mean_squares(
    reduction: Reduction, values: Values, spectrum: RationalSpectrum, speed: Array
) -> dict[str, MeanSquare]:
    squares, singular = _sum_of_residues(reduction, values, spectrum, speed)
    merging = np.all(singular, axis=-1, keepdims=True)
    places = np.argwhere(merging[..., 0])
    if places.size:
        _interpolate(reduction, values, spectrum, speed, squares, tuple(places.T))
    places = np.argwhere(singular & ~merging)
    if places.size:
        _interpolate(reduction, values, spectrum, speed[places[:, -1], None, None], squares, tuple(places.T))
    return squares


def dampings(reduction: Reduction) -> set[str]:
    """Names of the parameters that scale a damper's force."""

    def of_law(law: Law) -> Iterator[str]:
        if isinstance(law, Dashpot):
            yield law.name
        elif isinstance(law, Bending):
            yield law.damping_ratio
        for part in getattr(law, "parts", ()):
            yield from of_law(part)

    return {name for law in reduction.system.laws for name in of_law(law)}


def _interpolate(
    reduction: Reduction,
    values: Values,
    spectrum: RationalSpectrum,
    speed: Array,
    squares: dict[str, MeanSquare],
    places: tuple[NDArray[np.intp], ...],
) -> None:
    """Replace `squares` at grid indices `places` by values interpolated from vehicles around them.

    Their dampers' constants are scaled by factors around 1. places: one index array [r] an axis of the grid, and for
    single speeds one more; speed: [m], all of them, or [r, 1, 1], that of each place.
    """
    grid = shape_of(values)
    offsets = SPREAD * np.cos(np.pi * (np.arange(SUPPORT) + 0.5) / SUPPORT)
    weight = _to_zero(offsets)
    fewer = weight.copy()
    fewer[FEWER] -= _to_zero(offsets[FEWER])
    near = {
        name: np.broadcast_to(v, grid)[places[: len(grid)]].reshape(-1, 1) if np.ndim(v) else v
        for name, v in values.items()
    }
    near |= {name: near[name] * (1 + offsets) for name in dampings(reduction)}
    around, _ = _sum_of_residues(reduction, near, spectrum, speed)
    for name, square in around.items():
        value = np.einsum("prks,k->prs", square.value, weight)
        error = np.einsum("prks,k->prs", square.error, np.abs(weight))
        error += np.abs(np.einsum("prks,k->prs", square.value, fewer))
        everywhere = (slice(None), *places)
        single = len(places) > len(grid)
        squares[name].value[everywhere] = value[..., 0] if single else value
        squares[name].error[everywhere] = error[..., 0] if single else error


def _to_zero(nodes: Array) -> Array:
    """Weights of the polynomial through values at nodes, at zero."""
    return np.array([np.prod([z / (z - x) for z in nodes if z != x]) for x in nodes])


# --- sums of residues --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Product:
    """coefficient x X(s) Y(-s) in a row's integrals J: row, scalars of X and Y."""

    row: int
    x: int
    y: int
    coefficient: float


def _products(rows: list[tuple[str, Column]]) -> list[_Product]:
    result = []
    for row, (_, each) in enumerate(rows):
        for i, j, part, factor in each.powers:
            sign = 1.0 if part == "re" else -1.0
            scale = factor * 2 * np.pi / 4
            result += [_Product(row, i, j, sign * scale), _Product(row, j, i, scale)]
    return result


@dataclass(frozen=True)
class _Distances:
    """Those between wheels, and every lag function as a sum over them.

    d: [distances], each a float or [grid...], m, not negative. factors: [lags, distances] or [grid..., lags, distances].
    sums: (k, i, j) where d_k = d_i + d_j for all vehicles.
    """

    d: list[Number]
    factors: Array
    sums: dict[int, tuple[int, int]]


def _distances(reduction: Reduction, values: Values) -> _Distances:
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
    if all(np.ndim(x) == 0 for x in d):
        for place, k in enumerate(order):
            below = [i for i in order[:place] if size[i] > 0]
            pairs = [(i, j) for i in below for j in below if i <= j and abs(size[i] + size[j] - size[k]) <= 4 * EPSILON * size[k]]
            if pairs:
                sums[k] = pairs[0]
    return _Distances(d, factors, sums)


def _sum_of_residues(
    reduction: Reduction, values: Values, spectrum: RationalSpectrum, speed: Array
) -> tuple[dict[str, MeanSquare], NDArray[np.bool_]]:
    """The plain formula, and where [grid..., speeds] merging or meeting poles spoil it.

    speed: [speeds], or [grid..., speeds] with axes of length 1 where it is common to the vehicles.
    """
    rows = [(name, each) for name, some in reduction.columns.items() for each in some]
    products = _products(rows)
    distances = _distances(reduction, values)
    lags = distances.factors[..., [each.lag for _, each in rows], :]
    blocks = _read(reduction, values)
    shape = (*shape_of(values), speed.shape[-1])
    loss = LOSS + 8 * EPSILON * _sharpness([block.expansion for block in blocks.values()])[..., None]
    totals, errors = np.zeros((2, *shape[:-1], len(rows), shape[-1]))
    for index in blocks:
        own = [each for each in products if reduction.scalars[each.x].block == index]
        if own:
            value, error = _block_terms(blocks, index, own, len(rows), reduction, lags, distances, loss, spectrum, speed)
            totals += value
            errors += error
    for value, error in _track_terms(reduction, values, blocks, products, lags, distances, spectrum, speed):
        totals += value
        errors += error
    result = {}
    for output in reduction.outputs:
        value, error = np.zeros((2, len(output.taps), *shape))
        for row, (name, each) in enumerate(rows):
            if name == output.name:
                for label, weight in enumerate(each.weights):
                    if weight:
                        value[label] += weight * totals[..., row, :]
                        error[label] += abs(weight) * errors[..., row, :]
        result[output.name] = MeanSquare(value, error)
    singular = _singular([block.expansion for block in blocks.values()], spectrum, speed)
    return result, np.broadcast_to(singular, shape)


@dataclass(frozen=True)
class _Block:
    """A block at its poles p: partial fractions, possible errors of the residues, what is read of every scalar there.

    residue_errors: {own scalar: [grid..., k]}. at: [grid..., k], -p of a well damped pole, |p| of a light one. direct:
    every scalar's base read at these. factors, mirrored: what makes X of every base at p and at -p.
    """

    expansion: Expansion
    residue_errors: dict[int, Array]
    direct: list[Number]
    factors: list[Number]
    mirrored: list[Number]


def _read(reduction: Reduction, values: Values) -> dict[int, _Block]:
    """Every block with its residues held against what is read directly.

    At -p of a well damped pole the elimination adds positive terms only; a wrong residue r of p shows there as r/(2 p). Of
    a light pole -p lies beside other poles, and |p| serves. But its peak hangs on its residue alone, however small it is
    among others': there what rounding may have left is counted, and of the check what that cannot explain.
    """
    plain, spread_values = bases(reduction), column(values)
    result = {}
    for index, each in expand(reduction, values).items():
        p = each.poles
        at = np.where(each.light, np.abs(p), -p)
        direct = scalars(plain, spread_values, at, np.square(at)).values()
        errors = {}
        for k, residue in each.residues.items():
            found, known = each.fractions(k, at)
            missing = np.abs(found - direct[k])
            beyond = np.maximum(0.0, missing - known - LOSS / SAFETY * np.abs(direct[k]))
            own = np.where(each.light, each.rounding[k], 0.0)
            errors[k] = SAFETY * 2 * np.abs(p) * np.where(each.light, beyond, missing) + own
        factors, mirrored = (
            [multiplier(x, reduction.blocks[x.block], spread_values, s) for x in reduction.scalars] for s in (p, -p)
        )
        result[index] = _Block(each, errors, direct, factors, mirrored)
    return result


def _block_terms(
    blocks: dict[int, _Block],
    index: int,
    products: list[_Product],
    count: int,
    reduction: Reduction,
    lags: Array,
    distances: _Distances,
    loss: Array,
    spectrum: RationalSpectrum,
    speed: Array,
) -> tuple[Array, Array]:
    """What the poles of a block add to every row: (value, error), [grid..., rows, speeds].

    One matrix product a vehicle: coefficients [rows, parts of poles and lags] times waves [.., speeds]. Y(-p) is read off
    directly where the pole p is well damped, and comes from partial fractions where it is light, which near the mirror
    image of another pole see the true distance, but are as wrong as the residues in them.
    """
    block = blocks[index]
    each, p = block.expansion, block.expansion.poles
    mirrors: dict[int, tuple[Complex, Array]] = {}
    for y in dict.fromkeys(product.y for product in products):
        other = blocks[reduction.scalars[y].block]
        fractions, _ = other.expansion.fractions(y, _widened(-p, other.expansion))
        wrong = np.sum(_mirror_weights(p, other.expansion) * other.residue_errors[y][..., None, :], axis=-1)
        mirrors[y] = (
            block.mirrored[y] * np.where(each.light, fractions, block.direct[y]),
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
    some = sorted(weights)
    weight = np.stack(np.broadcast_arrays(*(weights[row] for row in some)), axis=-2)
    error = np.stack(np.broadcast_arrays(*(uncertain[row] for row in some)), axis=-2)
    weight, error = (np.where(each.weight[..., None, :] > 0, x, 0.0) for x in (weight, error))
    error = error + loss[..., None] * np.abs(weight)
    # as many terms as the block has states: BLAS picks its order of summation by the shape of the product
    weight, error = (_padded(x, each.states, -1) for x in (weight, error))
    waves, density = _waves(p, each, distances, spectrum, speed)
    of_rows = lags[..., some, :]
    parts = np.stack([weight.real, -weight.imag], axis=-2)[..., None, :] * of_rows[..., None, :, None]
    value = parts.reshape(*parts.shape[:-3], -1) @ waves
    bound = (error * np.sum(np.abs(of_rows), axis=-1)[..., None]) @ density
    if len(some) == count:
        return value, bound
    result = np.zeros((2, *value.shape[:-2], count, value.shape[-1]))
    result[0][..., some, :], result[1][..., some, :] = value, bound
    return result[0], result[1]


def _widened(s: Complex, other: Expansion) -> Complex:
    """s [grid..., k] over the axes of the grid that another block spans too."""
    return np.broadcast_to(s, np.broadcast_shapes(s.shape, (*other.poles.shape[:-1], 1)))


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


def _sharpness(expansions: list[Expansion]) -> Number:
    """Height of the sharpest peak, [grid...]: imaginary parts of poles are known to a rounding error only."""
    result: Number = 0.0
    for each in expansions:
        sharp = np.where(each.weight > 0, np.abs(each.poles) / np.abs(2 * each.poles.real), 0.0)
        result = np.maximum(result, sharp.max(axis=-1))
    return result


def _waves(
    p: Complex, each: Expansion, distances: _Distances, spectrum: RationalSpectrum, speed: Array
) -> tuple[Array, Array]:
    """G(s) e^{s d} at poles p [grid..., k] for the distances at every speed, and |G|, [grid..., states, speeds].

    The waves are [grid..., 2 x distances x states, speeds]: real and imaginary parts of each lag of each pole, then zeros.
    """
    v = speed[..., None, :]
    low, high = (np.square(v * cutoff) for cutoff in spectrum.cutoffs)
    s2 = np.square(p)[..., None]
    # S_v(omega/v)/v with omega^2 = -s^2 (eq. 11)
    density = spectrum.roughness * spectrum.cutoffs[1] ** 2 * v**3 / ((low - s2) * (high - s2))
    density = np.where(each.weight[..., None] > 0, density, 0.0)
    lagged: dict[int, Complex] = {}
    for k in sorted(range(len(distances.d)), key=lambda k: float(np.max(distances.d[k]))):
        d = distances.d[k]
        if not np.any(d):
            lagged[k] = np.ones((1,) * density.ndim)
        elif k in distances.sums:
            i, j = distances.sums[k]
            lagged[k] = np.multiply(lagged[i], lagged[j])
        else:
            lagged[k] = _exponential(p, np.asarray(d)[..., None, None] / v)
    shape = np.broadcast_shapes(density.shape, *(wave.shape for wave in lagged.values()))
    waves = np.zeros((*shape[:-2], 2, len(lagged), each.states, shape[-1]))
    for k, wave in lagged.items():
        here = np.multiply(wave, density)
        waves[..., 0, k, : shape[-2], :], waves[..., 1, k, : shape[-2], :] = here.real, here.imag
    return waves.reshape(*shape[:-2], -1, shape[-1]), _padded(np.abs(density), each.states, -2)


def _exponential(p: Complex, delay: Array) -> Complex:
    """e^{p t} at poles p [grid..., k] for delays t [grid..., 1, speeds]."""
    size = np.exp(p.real[..., None] * delay)
    cosine, sine = cos_sin(p.imag[..., None] * delay)
    result = np.empty(size.shape, complex)
    result.real, result.imag = size * cosine, size * sine
    return result


def _track_terms(
    reduction: Reduction,
    values: Values,
    blocks: dict[int, _Block],
    products: list[_Product],
    lags: Array,
    distances: _Distances,
    spectrum: RationalSpectrum,
    speed: Array,
) -> Iterator[tuple[Array, Array]]:
    """What each pole q = -v Omega of the spectrum adds to every row, [grid..., rows, speeds]: there scalars are read directly.

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
            for k, (x, fraction) in enumerate(zip(found.values(), found.fractions, strict=True)):
                scalar = reduction.scalars[k]
                error: Number = 0.0
                if sign > 0 and fraction.denominator < 0:
                    x, error = _checked(x, blocks[scalar.block], k, q)
                factor = np.real(multiplier(scalar, reduction.blocks[scalar.block], spread_values, sign * q))
                read[k, sign] = np.real(x) * factor, error * np.abs(factor)
        decay = np.stack(np.broadcast_arrays(*(residue * np.exp(-cutoff * d) for d in distances.d)), axis=-1)
        weight = np.sum(decay[..., None, :] * lags, axis=-1)
        size = np.sum(np.abs(decay)[..., None, :] * np.abs(lags), axis=-1)
        shape = np.broadcast_shapes(*(np.shape(x) for x, _ in read.values()), (*weight.shape[:-1], 1))
        value, error = np.zeros((2, *shape[:-1], count, shape[-1]))
        for each in products:
            (x, x_error), (y, _) = read[each.x, 1.0], read[each.y, -1.0]
            term = each.coefficient * (x * y)
            value[..., each.row, :] += weight[..., each.row, None] * term
            lost = LOSS * np.abs(term) + abs(each.coefficient) * x_error * np.abs(y)
            error[..., each.row, :] += size[..., each.row, None] * lost
        yield value, error


def _checked(x: Number, block: _Block, scalar: int, q: Array) -> tuple[Number, Number]:
    """A base at q [..., speeds] as eliminated, or as partial fractions where these differ by more than they may be wrong."""
    each = block.expansion
    s = np.broadcast_to(q, np.broadcast_shapes(q.shape, (*each.poles.shape[:-1], 1))).astype(complex)
    found, _ = each.fractions(scalar, s)
    error = block.residue_errors[scalar]
    apart = np.abs(s[..., :, None] - each.poles[..., None, :])
    known = np.sum(np.where(each.weight[..., None, :] > 0, (each.weight * error)[..., None, :] / apart, 0.0), axis=-1)
    wrong = ~(np.abs(x - found) <= known + LOSS * np.abs(found))
    return np.where(wrong, found, x), np.where(wrong, known, np.minimum(np.abs(x - found), known))


def _singular(expansions: list[Expansion], spectrum: RationalSpectrum, speed: Array) -> NDArray[np.bool_]:
    """Where the plain formula loses its digits: [grid..., speeds]."""
    result: Number = np.zeros(speed.shape[-1], dtype=bool)
    for each in expansions:
        taken = np.any([r != 0 for r in each.residues.values()], axis=0) & (each.weight > 0)
        p = np.where(taken, each.poles, np.nan)
        size = np.abs(p)
        with_conjugates = np.concatenate([p, np.where(each.weight > 1, np.conj(p), np.nan)], axis=-1)
        gaps = np.abs(p[..., :, None] - with_conjugates[..., None, :])
        gaps[..., range(p.shape[-1]), range(p.shape[-1])] = np.nan
        merging = (gaps < MERGING * size[..., None]) & (each.defect < DEFECT)[..., None]
        result = result | np.any(merging, axis=(-2, -1))[..., None]
        # the spectrum's poles are real: only vehicle's poles next to the real axis can meet them
        real = np.where(np.abs(p.imag) < MEETING * size, p.real, np.nan)
        for k in np.flatnonzero(np.any(np.isfinite(real), axis=tuple(range(p.ndim - 1)))):
            for cutoff in spectrum.cutoffs:
                distance = np.abs(real[..., k, None] + cutoff * speed)
                result = result | (distance < MEETING * np.abs(real[..., k, None]))
    return np.asarray(result)
