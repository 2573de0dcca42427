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
from freqrail.solver.block_poles import NOWHERE, Array, Complex, bases, multiplier
from freqrail.solver.block_response import column, scalars
from freqrail.solver.block_terms import Distances, PoleTerms, Product, ReadBlock, Row
from freqrail.solver.closed_form import LOSS
from freqrail.solver.problem import cells
from freqrail.types import Number

AT_ONCE = 1 << 18  # numbers that a cell's waves hold: few enough to stay in the cache
MORE_AT_ONCE = 1 << 19  # and its products of scalars, each of which is used less

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
    needed = _needed(some, distances)
    apart = {k: bool(np.any(distances.d[k])) for k in needed}
    for cell in _cells(own, most):
        waves, density = _waves(
            np.ascontiguousarray(_part(each.poles, cell, 1)),
            _part(each.weight, cell, 1),
            each.states,
            distances.sums,
            some,
            {k: _part(distances.d[k], cell, 0) if apart[k] else None for k in needed},
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
    sums: dict[int, tuple[int, int]],
    some: list[int],
    d: dict[int, NDArray | None],
    track: Track,
    speed: Array,
) -> tuple[Array, Array]:
    """G(s) e^{s d} at poles p [grid..., k] for some distances d at every speed, and |G|, [grid..., states, speeds].

    d: of some, and before them those that they are sums of; None for zero. The waves are [grid..., distances, 2,
    states, speeds]: real and imaginary parts at each pole, then zeros.
    """
    v = speed[..., None, :]
    roughness, *cutoffs = (np.asarray(x)[..., None, None] for x in (track.roughness, *track.cutoffs))
    low, high = (np.square(v * cutoff) for cutoff in cutoffs)
    s2 = np.square(p)[..., None]
    # S_v(omega/v)/v with omega^2 = -s^2 (eq. 11)
    density = roughness * cutoffs[1] ** 2 * v**3 / np.multiply(low - s2, high - s2)
    if not np.all(present > 0):
        density = np.where(present[..., None] > 0, density, 0.0)
    shape = np.broadcast_shapes(density.shape, *((*np.shape(x), 1, 1) for x in d.values() if x is not None))
    count = shape[-2]
    waves = np.zeros((*shape[:-2], len(some), 2, states, shape[-1]))
    pure: dict[int, Complex] = {}  # e^{s d}, where another lag is made of it
    lagged: dict[int, Complex] = {}
    for k, length in d.items():
        if length is None:
            lagged[k] = density
        elif k in sums:
            i, j = sums[k]
            lagged[k] = np.multiply(pure[i], lagged[j])
        else:
            pure[k] = _exponential(p, length[..., None, None] / v)
            lagged[k] = np.multiply(pure[k], density)
        if k in some:
            place = some.index(k)
            waves[..., place, 0, :count, :], waves[..., place, 1, :count, :] = lagged[k].real, lagged[k].imag
    size = np.zeros((*density.shape[:-2], states, density.shape[-1]))
    np.abs(density, out=size[..., :count, :])
    return waves, size


def _needed(some: list[int], distances: Distances) -> list[int]:
    """Some distances and those that they are sums of, each after those."""
    result: dict[int, None] = {}
    for k in some:
        result |= dict.fromkeys(_needed(list(distances.sums.get(k, ())), distances))
        result[k] = None
    return list(result)


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
    rows: list[Row],
    distances: Distances,
    track: Track,
    speed: Array,
    shape: tuple[int, ...],
) -> Iterator[tuple[Cell, Array, Array]]:
    """What the poles q = -v Omega of the spectrum add at every label: (cell, value, error), [cell..., labels, speeds].

    shape: of the grid. labels: of all outputs, one after the other. Scalars are read directly there. The residue of G
    times e^{q d} = e^{-Omega d} does not depend on the speed. On the negative axis an elimination that divides may meet
    a pivot near zero; so what is read is held against partial fractions.
    """
    pairs = list(dict.fromkeys((product.x, product.y) for product in products))
    one, other = ([pair[side] for pair in pairs] for side in (0, 1))
    weight, size = _track_weights(products, pairs, rows, label_weights(reduction, rows), distances, track)
    poles = [-np.asarray(cutoff)[..., None] * speed for cutoff in track.cutoffs]
    read = [_at_track_pole(reduction, values, blocks, q) for q in poles]
    count, speeds = len(pairs), speed.shape[-1]
    for cell in _cells(shape, MORE_AT_ONCE // (2 * count * speeds)):
        inside = tuple(len(range(n)[part]) for part, n in zip(cell, shape, strict=True))
        terms, uncertain = np.empty((2, *inside, 2 * count, speeds))
        for k, (here, mirrored, wrong) in enumerate(read):
            x, y = (_stacked(table, cell, (*inside, speeds)) for table in (here, mirrored))
            y = y[..., other, :]
            place = slice(k * count, (k + 1) * count)
            np.multiply(x[..., one, :], y, out=terms[..., place, :])
            np.abs(terms[..., place, :], out=uncertain[..., place, :])
            if wrong:  # in units of what else is lost
                nothing = dict.fromkeys(here.keys() - wrong.keys(), 0.0)
                errors = _stacked(wrong | nothing, cell, (*inside, speeds))
                uncertain[..., place, :] += errors[..., one, :] * np.abs(y) / LOSS
        yield cell, contracted(_part(weight, cell, 2), terms), LOSS * contracted(_part(size, cell, 2), uncertain)


def _stacked(table: dict[int, Number], cell: Cell, shape: tuple[int, ...]) -> Array:
    """Numbers [grid..., speeds] by index as one array of a cell, [cell..., numbers, speeds]."""
    result = np.empty((*shape[:-1], len(table), shape[-1]))
    for k, x in table.items():
        result[..., k, :] = _part(x, cell, 1) if np.ndim(x) else x
    return result


def label_weights(reduction: Reduction, rows: list[Row]) -> Array:
    """What every row is worth at the labels of all outputs, one after the other: [labels, rows]."""
    places = _places_of(reduction)
    result = np.zeros((sum(len(output.taps) for output in reduction.outputs), len(rows)))
    for row, (name, each) in enumerate(rows):
        result[places[name], row] = each.weights
    return result


def _places_of(reduction: Reduction) -> dict[str, slice]:
    """Of every output's labels among all."""
    result, first = {}, 0
    for output in reduction.outputs:
        result[output.name] = slice(first, first + len(output.taps))
        first += len(output.taps)
    return result


def _track_weights(
    products: list[Product],
    pairs: list[tuple[int, int]],
    rows: list[Row],
    labels: Array,
    distances: Distances,
    track: Track,
) -> tuple[Array, Array]:
    """What each pair of scalars at each of the track's poles is worth at every label, and the sum of its terms' sizes.

    [labels, 2 x pairs], or [grid..., labels, 2 x pairs] where lengths or cut-offs vary.
    """
    low, high = track.cutoffs
    scale = track.roughness * high**2 / (high**2 - low**2) / 2
    place = {pair: k for k, pair in enumerate(pairs)}
    some = [[(int(k), labels[k, row]) for k in np.flatnonzero(labels[:, row])] for row in range(len(rows))]
    weights, sizes = [], []
    for cutoff, residue in ((low, scale / low), (high, -scale / high)):
        decay = np.stack(np.broadcast_arrays(*(residue * np.exp(-cutoff * d) for d in distances.d)), axis=-1)
        terms = decay[..., None, :] * distances.factors
        by_lag, size_by_lag = np.sum(terms, axis=-1), np.sum(np.abs(terms), axis=-1)
        weight, size = np.zeros((2, *by_lag.shape[:-1], len(labels), len(pairs)))
        for each in products:
            k, lag = place[each.x, each.y], rows[each.row][1].lag
            for label, of_row in some[each.row]:
                factor = of_row * each.coefficient
                weight[..., label, k] += factor * by_lag[..., lag]
                size[..., label, k] += abs(factor) * size_by_lag[..., lag]
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
    each, axes = block.expansion, block.expansion.poles.ndim - 1
    count, states, there = each.poles.shape[-1], each.states, each.weight > 0
    grid = np.broadcast_shapes(q.shape[:-1], each.poles.shape[:-1], (1,) * axes)
    residues = np.zeros((*each.poles.shape[:-1], len(some), 2, states))
    lacking = np.zeros((*each.poles.shape[:-1], len(some), states))
    for place, k in enumerate(some):
        residue = np.where(there, each.weight * each.residues[k], 0.0)
        residues[..., place, 0, :count], residues[..., place, 1, :count] = residue.real, -residue.imag
        lacking[..., place, :count] = np.where(there, each.weight * block.residue_errors[k], 0.0)
    residues = residues.reshape(*each.poles.shape[:-1], len(some), -1)
    found, known = np.empty((2, *grid, len(some), q.shape[-1]))
    poles = np.where(there, each.poles, NOWHERE)
    for cell in _cells(grid, AT_ONCE // (2 * states * q.shape[-1])):
        near = 1.0 / (_part(q, cell, 1)[..., None, :] - np.ascontiguousarray(_part(poles, cell, 1))[..., None])
        parts = np.zeros((*near.shape[:-2], 3, states, near.shape[-1]))
        parts[..., 0, :count, :], parts[..., 1, :count, :] = near.real, near.imag
        np.abs(near, out=parts[..., 2, :count, :])
        both = parts[..., :2, :, :].reshape(*near.shape[:-2], 2 * states, -1)
        found[cell], known[cell] = _part(residues, cell, 2) @ both, _part(lacking, cell, 2) @ parts[..., 2, :, :]
    for place, k in enumerate(some):
        fractions, wrong = each.constants[k] + found[..., place, :], known[..., place, :]
        difference = np.abs(direct[k] - fractions)
        bad = ~(difference <= wrong + LOSS * np.abs(fractions))
        direct[k] = np.where(bad, fractions, direct[k])
        errors[k] = np.where(bad, wrong, np.minimum(difference, wrong))


def label_sums(reduction: Reduction, rows: list[Row], total: Array, error: Array) -> tuple[Array, Array]:
    """What rows [grid..., rows, speeds] and their errors come to at all labels: [grid..., labels, speeds]."""
    weights = label_weights(reduction, rows)
    return contracted(weights, total), contracted(np.abs(weights), error)


def by_output(reduction: Reduction, value: Array, error: Array) -> dict[str, tuple[Array, Array]]:
    """What there is at all labels, [grid..., labels, speeds], as [labels, grid..., speeds] of every output."""
    value, error = (np.moveaxis(x, -2, 0) for x in (value, np.where(np.isnan(error), np.inf, error)))
    return {name: (value[some], error[some]) for name, some in _places_of(reduction).items()}


def contracted(matrix: Array, terms: Array) -> Array:
    """matrix [..., rows, n] @ terms [grid..., n, speeds], where an entry 0 leaves a term out though it is no number."""
    result = np.matmul(matrix, terms)
    if np.all(np.isfinite(result)):
        return result
    bad = ~np.isfinite(result).all(axis=(-2, -1))
    own, some = np.broadcast_to(matrix, (*terms.shape[:-2], *matrix.shape[-2:]))[bad], terms[bad]
    total = np.zeros(result[bad].shape)
    for k in range(own.shape[-1]):
        entry = own[..., k, None]
        total += np.where(entry != 0, entry * some[:, None, k], 0.0)
    result[bad] = total
    return result
