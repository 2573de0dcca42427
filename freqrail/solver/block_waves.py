"""What depends on the speed in the closed form over blocks: waves at the poles of the blocks, and the track's poles.

See `solver.block_residues` for the integrals and `solver.block_terms` for the coefficients. The grid is worked off in
cells that stay in the cache. Every vehicle's matrix products have the same shape, so that its bits do not depend on the
others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.inputs import cos_sin
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_poles import Array, Complex, bases, multiplier
from freqrail.solver.block_response import column, scalars
from freqrail.solver.block_terms import Distances, Group, PoleTerms, Product, ReadBlock, Row
from freqrail.solver.closed_form import LOSS
from freqrail.solver.problem import cells
from freqrail.types import Number

AT_ONCE = 1 << 17  # numbers that a cell's waves hold: few enough to stay in the cache

Cell = tuple[slice, ...]


@dataclass(frozen=True)
class Track:
    """A spectrum of eq. (11): roughness and cut-offs, floats, or [grid...] where each vehicle has its own."""

    roughness: Number
    cutoffs: tuple[Number, Number]

    def part(self, cell: Cell) -> Track:
        """That of the vehicles in a cell."""
        return Track(_part(self.roughness, cell, 0), (_part(self.cutoffs[0], cell, 0), _part(self.cutoffs[1], cell, 0)))


def add_pole_terms(
    total: Array, error: Array, terms: PoleTerms, distances: Distances, track: Track, speed: Array
) -> None:
    """Add what the poles of a block are worth to every row: total and error, [grid..., rows, speeds].

    Two matrix products a vehicle make rows of waves: the distances' waves become those of lag functions, and these are
    weighted with the coefficients.
    """
    each, groups, axes = terms.expansion, terms.groups, total.ndim - 2
    lags = sorted({group.lag for group in groups})
    factors = distances.factors[..., lags, :]
    some = [k for k in range(len(distances.d)) if np.any(factors[..., k])]
    factors = np.ascontiguousarray(factors[..., some])
    sizes = np.sum(np.abs(factors), axis=-1)
    shapes = (each.poles.shape[:-1], speed.shape[:-1], factors.shape[:-2], *(np.shape(distances.d[k]) for k in some))
    own = np.broadcast_shapes((1,) * axes, *shapes, *map(np.shape, track.cutoffs), np.shape(track.roughness))
    most = AT_ONCE // (2 * each.states * speed.shape[-1] * len(some))
    for cell in _cells(own, most):
        waves, density = _waves(
            np.ascontiguousarray(_part(each.poles, cell, 1)),
            _part(each.weight, cell, 1),
            each.states,
            distances,
            some,
            [_part(d, cell, 0) for d in distances.d],
            track.part(cell),
            _part(speed, cell, 1),
        )
        grid = waves.shape[:-4]
        of_lags = np.matmul(_part(factors, cell, 2), waves.reshape(*grid, len(some), -1))
        of_lags = of_lags.reshape(*of_lags.shape[:-1], 2 * each.states, -1)
        weight, uncertain, size = (_part(x, cell, n) for x, n in ((terms.weight, 2), (terms.error, 2), (sizes, 1)))
        target, target_error = _part(total, cell, 2), _part(error, cell, 2)
        first = 0
        for group in groups:
            lag, rows = lags.index(group.lag), slice(first, first + group.rows.stop - group.rows.start)
            target[..., group.rows, :] += weight[..., rows, :] @ of_lags[..., lag, :, :]
            bound = uncertain[..., rows, :] @ density
            target_error[..., group.rows, :] += size[..., lag, None, None] * bound
            first = rows.stop


def _cells(shape: tuple[int, ...], most: int) -> list[Cell]:
    """Cells of a grid; along axes of length 1 they are whole, whatever else spans them."""
    return [
        tuple(slice(None) if n == 1 else part for part, n in zip(cell, shape, strict=True))
        for cell in cells(shape, max(1, most))
    ]


def _part(x: Number, cell: Cell, inner: int) -> NDArray:
    """The part of an array [grid..., inner axes] in a cell; its grid may have fewer axes, or some of length 1."""
    x = np.asarray(x)
    lead = x.ndim - inner
    own = cell[len(cell) - lead :] if lead else ()
    return x[tuple(part if n > 1 else slice(None) for part, n in zip(own, x.shape[:lead], strict=True))]


def _waves(
    p: Complex,
    present: Array,
    states: int,
    distances: Distances,
    some: list[int],
    d: list[NDArray],
    track: Track,
    speed: Array,
) -> tuple[Array, Array]:
    """G(s) e^{s d} at poles p [grid..., k] for some distances d at every speed, and |G|, [grid..., states, speeds].

    The waves are [grid..., distances, 2, states, speeds]: real and imaginary parts at each pole, then zeros.
    """
    v = speed[..., None, :]
    roughness, *cutoffs = (np.asarray(x)[..., None, None] for x in (track.roughness, *track.cutoffs))
    low, high = (np.square(v * cutoff) for cutoff in cutoffs)
    s2 = np.square(p)[..., None]
    # S_v(omega/v)/v with omega^2 = -s^2 (eq. 11)
    density = roughness * cutoffs[1] ** 2 * v**3 / np.multiply(low - s2, high - s2)
    if not np.all(present > 0):
        density = np.where(present[..., None] > 0, density, 0.0)
    shape = np.broadcast_shapes(density.shape, *((*np.shape(d[k]), 1, 1) for k in some))
    count = shape[-2]
    waves = np.zeros((*shape[:-2], len(some), 2, states, shape[-1]))
    pure: dict[int, Complex] = {}  # e^{s d}, where another lag is made of it
    lagged: dict[int, Complex] = {}
    for k in _needed(some, distances, d):
        if not np.any(d[k]):
            lagged[k] = density
        elif k in distances.sums:
            i, j = distances.sums[k]
            lagged[k] = np.multiply(pure[i], lagged[j])
        else:
            pure[k] = _exponential(p, d[k][..., None, None] / v)
            lagged[k] = np.multiply(pure[k], density)
        if k in some:
            place = some.index(k)
            waves[..., place, 0, :count, :], waves[..., place, 1, :count, :] = lagged[k].real, lagged[k].imag
    size = np.zeros((*density.shape[:-2], states, density.shape[-1]))
    np.abs(density, out=size[..., :count, :])
    return waves, size


def _needed(some: list[int], distances: Distances, d: list[NDArray]) -> list[int]:
    """Some distances and those that they are sums of, each after those."""
    result: list[int] = []
    for k in some:
        for each in (*_needed(list(distances.sums.get(k, ())), distances, d), k):
            if each not in result:
                result.append(each)
    return result


def _exponential(p: Complex, delay: Array) -> Complex:
    """e^{p t} at poles p [grid..., k] for delays t [grid..., 1, speeds]."""
    size = np.exp(p.real[..., None] * delay)
    cosine, sine = cos_sin(p.imag[..., None] * delay)
    result = np.empty(size.shape, complex)
    np.multiply(size, cosine, out=result.real)
    np.multiply(size, sine, out=result.imag)
    return result


def track_terms(
    reduction: Reduction,
    values: Values,
    blocks: dict[int, ReadBlock],
    products: list[Product],
    groups: list[Group],
    distances: Distances,
    track: Track,
    speed: Array,
    shape: tuple[int, ...],
) -> Iterator[tuple[Cell, Array, Array]]:
    """What the poles q = -v Omega of the spectrum add to every row: (cell, value, error), [cell..., rows, speeds].

    shape: of the grid. Scalars are read directly there. The residue of G times e^{q d} = e^{-Omega d} does not depend
    on the speed. On the negative axis an elimination that divides may meet a pivot near zero; so what is read is held
    against partial fractions.
    """
    pairs = list(dict.fromkeys((product.x, product.y) for product in products))
    weight, size = _track_weights(products, pairs, groups, distances, track)
    poles = [-np.asarray(cutoff)[..., None] * speed for cutoff in track.cutoffs]
    read = [_at_track_pole(reduction, values, blocks, q) for q in poles]
    count, speeds = len(pairs), speed.shape[-1]
    for cell in _cells(shape, AT_ONCE // (2 * count * speeds)):
        inside = tuple(len(range(n)[part]) for part, n in zip(cell, shape, strict=True))
        terms, uncertain = np.empty((2, *inside, 2 * count, speeds))
        for k, (here, mirrored, wrong) in enumerate(read):
            one, other, error = ({i: _part(x, cell, 1) for i, x in table.items()} for table in (here, mirrored, wrong))
            for place, (x, y) in enumerate(pairs, start=k * count):
                np.multiply(one[x], other[y], out=terms[..., place, :])
                np.multiply(LOSS, np.abs(terms[..., place, :]), out=uncertain[..., place, :])
                if x in error:
                    uncertain[..., place, :] += error[x] * np.abs(other[y])
        yield cell, contracted(_part(weight, cell, 2), terms), contracted(_part(size, cell, 2), uncertain)


def _track_weights(
    products: list[Product],
    pairs: list[tuple[int, int]],
    groups: list[Group],
    distances: Distances,
    track: Track,
) -> tuple[Array, Array]:
    """What each pair of scalars at each of the track's poles is worth in every row, and the sum of its terms' sizes.

    [rows, 2 x pairs], or [grid..., rows, 2 x pairs] where lengths vary.
    """
    low, high = track.cutoffs
    scale = track.roughness * high**2 / (high**2 - low**2) / 2
    place = {pair: k for k, pair in enumerate(pairs)}
    lag_of = {row: group.lag for group in groups for row in range(group.rows.start, group.rows.stop)}
    weights, sizes = [], []
    for cutoff, residue in ((low, scale / low), (high, -scale / high)):
        decay = np.stack(np.broadcast_arrays(*(residue * np.exp(-cutoff * d) for d in distances.d)), axis=-1)
        terms = decay[..., None, :] * distances.factors
        by_lag, size_by_lag = np.sum(terms, axis=-1), np.sum(np.abs(terms), axis=-1)
        weight, size = np.zeros((2, *by_lag.shape[:-1], len(lag_of), len(pairs)))
        for each in products:
            k, lag = place[each.x, each.y], lag_of[each.row]
            weight[..., each.row, k] += each.coefficient * by_lag[..., lag]
            size[..., each.row, k] += abs(each.coefficient) * size_by_lag[..., lag]
        weights.append(weight)
        sizes.append(size)
    return np.concatenate(weights, axis=-1), np.concatenate(sizes, axis=-1)


def _at_track_pole(
    reduction: Reduction, values: Values, blocks: dict[int, ReadBlock], q: Array
) -> tuple[dict[int, Number], dict[int, Number], dict[int, Number]]:
    """Every scalar at poles q of the track and at -q, real, [grid..., speeds], and possible errors of some at q."""
    plain, spread_values = bases(reduction), column(values)
    found = scalars(plain, spread_values, q, np.square(q))
    direct, errors = found.values(), dict[int, Number]()
    divided = [k for k, x in enumerate(found.fractions) if x.denominator < 0]
    for block in blocks.values():
        some = [k for k in block.expansion.residues if k in divided]
        if some:
            _check(direct, errors, some, block, q)
    mirrored = scalars(plain, spread_values, -q, np.square(q)).values()
    here, there, wrong = {}, {}, {}
    for k, scalar in enumerate(reduction.scalars):
        factor, opposite = (multiplier(scalar, reduction.blocks[scalar.block], spread_values, s) for s in (q, -q))
        here[k], there[k] = direct[k] * factor, mirrored[k] * opposite
        if k in errors:
            wrong[k] = errors[k] * np.abs(factor)
    return here, there, wrong


def _check(direct: list[Number], errors: dict[int, Number], some: list[int], block: ReadBlock, q: Array) -> None:
    """Replace entries of `direct`, bases of a block at q [..., speeds] as eliminated, and tell their `errors`.

    They become partial fractions where these differ by more than they may be wrong.
    """
    each = block.expansion
    count, states = each.poles.shape[-1], each.states
    shape = np.broadcast_shapes(q.shape, (*each.poles.shape[:-1], 1))
    near, far = np.zeros((*shape[:-1], 2, states, shape[-1])), np.zeros((*shape[:-1], states, shape[-1]))
    reciprocal = 1.0 / (q[..., None, :] - each.poles[..., None])
    present = each.weight[..., None]
    reciprocal = np.where(present > 0, present * reciprocal, 0.0)
    near[..., 0, :count, :], near[..., 1, :count, :] = reciprocal.real, reciprocal.imag
    np.abs(reciprocal, out=far[..., :count, :])
    near = near.reshape(*near.shape[:-3], 2 * states, -1)
    grid = each.poles.shape[:-1]
    residues, lacking = np.zeros((*grid, len(some), 2, states)), np.zeros((*grid, len(some), states))
    for place, k in enumerate(some):
        residue = np.where(each.weight > 0, each.residues[k], 0.0)
        residues[..., place, 0, :count], residues[..., place, 1, :count] = residue.real, -residue.imag
        lacking[..., place, :count] = np.where(each.weight > 0, block.residue_errors[k], 0.0)
    found = residues.reshape(*grid, len(some), -1) @ near
    known = lacking @ far
    for place, k in enumerate(some):
        fractions, wrong = each.constants[k] + found[..., place, :], known[..., place, :]
        difference = np.abs(direct[k] - fractions)
        bad = ~(difference <= wrong + LOSS * np.abs(fractions))
        direct[k] = np.where(bad, fractions, direct[k])
        errors[k] = np.where(bad, wrong, np.minimum(difference, wrong))


def label_sums(reduction: Reduction, rows: list[Row], total: Array, error: Array) -> dict[str, tuple[Array, Array]]:
    """What rows come to at the labels of every output: {output: (value, error)}, [labels, grid..., speeds]."""
    starts = np.cumsum([0] + [len(output.taps) for output in reduction.outputs])
    places = {output.name: slice(a, b) for output, a, b in zip(reduction.outputs, starts, starts[1:], strict=False)}
    weights = np.zeros((starts[-1], len(rows)))
    for row, (name, each) in enumerate(rows):
        weights[places[name], row] = each.weights
    value, uncertain = contracted(weights, total), contracted(np.abs(weights), error)
    uncertain[np.isnan(uncertain)] = np.inf
    value, uncertain = (np.moveaxis(x, -2, 0) for x in (value, uncertain))
    return {name: (value[some], uncertain[some]) for name, some in places.items()}


def contracted(matrix: Array, terms: Array) -> Array:
    """matrix [..., rows, n] @ terms [grid..., n, speeds], where an entry 0 leaves a term out though it is no number."""
    result = np.matmul(matrix, terms)
    if np.all(np.isfinite(result)):
        return result
    matrix = np.broadcast_to(matrix, (*terms.shape[:-2], *matrix.shape[-2:]))
    for place in map(tuple, np.argwhere(~np.isfinite(result).all(axis=(-2, -1)))):
        own = matrix[place]
        parts = np.where(own[:, :, None] != 0, own[:, :, None] * terms[place], 0.0)
        result[place] = np.sum(parts, axis=1)
    return result
