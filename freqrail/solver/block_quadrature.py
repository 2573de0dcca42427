"""Mean squares of the responses over a frequency band, by quadrature over the blocks' scalars.

sigma^2 = integral of |T|^2 G d omega, with |T|^2 a sum of columns (`reduction.columns`): the powers of a vehicle serve
every speed, and the speed axis is a matrix product over the nodes. Panels, the rule and its error estimate are those of
`solver.quadrature`; the nodes follow the poles of the vehicles and the longest lag.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.spectrum import Spectrum, angular_psd
from freqrail.reduction.columns import Column, Reduction
from freqrail.solver.block_response import Number, Scalars, column, scalars, unsound
from freqrail.solver.quadrature import (
    CAUTION,
    ROUNDING,
    SPEEDS,
    TILE,
    MeanSquare,
    WeightedNodes,
    quadrature,
)

TAIL = 40  # halvings of u = cutoff/omega on the way from 1 to 0

Array = NDArray[np.float64]


def shape_of(values: Values) -> tuple[int, ...]:
    """Shape of the grid of vehicles that the values span; () for a single one."""
    return np.broadcast_shapes(*(np.shape(v) for v in values.values()))


def mean_squares(
    reduction: Reduction,
    values: Values,
    nodes: Iterable[WeightedNodes],
    rounding_errors: Mapping[str, Array] | Array | float = ROUNDING,
) -> dict[str, MeanSquare]:
    """Mean squares of every output of a reduction for a grid of vehicles.

    values: by parameter, broadcasting to [grid...]; the wheels stand in one geometry, that of the nodes.
    rounding_errors: relative, what rounding leaves, for all outputs or by name, see `panels.rounding_errors`.
    Returns {output: MeanSquare}, [labels, grid..., speeds].

    The error estimate has QUADPACK's form: with d the difference of the two rules relative to the value,
    min(1, (CAUTION d)^1.5). d sums the differences of the columns without their signs, so that they cannot cancel.
    """
    grid = shape_of(values)
    rows = math.prod(grid)
    tile = TILE if grid else 1  # a single vehicle is never part of a block
    tiles = -(-rows // tile)
    columns = [(name, each) for name, some in reduction.columns.items() for each in some]
    sums: list[Array] = []
    nodes = list(nodes)
    exact = unsound(reduction, values, np.concatenate([part.omega for part in nodes if np.isrealobj(part.omega)]))
    spread = column(values)
    for part in nodes:
        if not sums:
            sums = [np.zeros((2, tiles, tile, part.kronrod.shape[-1])) for _ in columns]
        omega, size = part.omega, part.kronrod.shape[1]
        with np.errstate(all="ignore"):
            here = scalars(reduction, spread, 1j * omega, -np.square(omega), exact)
            if np.iscomplexobj(omega):  # beside the axis, see `solver.detours`
                products: Products | PairProducts = PairProducts(
                    here.values(), scalars(reduction, spread, -1j * omega, -np.square(omega), exact).values()
                )
            else:
                products = Products(here)
        padded = np.zeros((tiles, tile, size))
        target = padded.reshape(tiles * tile, size)[:rows].reshape(*grid, size)
        spare = np.empty((*grid, size))
        for (_, each), (total, embedded) in zip(columns, sums, strict=True):
            products.power(each, target, spare)
            add_product(total, padded, part.kronrod[each.lag])
            if part.gauss is not None:
                add_product(embedded, padded, part.gauss[each.lag])
    result = {}
    for output in reduction.outputs:
        speeds = sums[0].shape[-1]
        value, difference = np.zeros((2, len(output.taps), *grid, speeds))
        for (name, each), both in zip(columns, sums, strict=True):
            if name != output.name:
                continue
            total, embedded = both.reshape(2, tiles * tile, speeds)[:, :rows].reshape(2, *grid, speeds)
            apart = np.abs(total - embedded)
            for label, weight in enumerate(each.weights):
                if weight:
                    value[label] += weight * total
                    difference[label] += abs(weight) * apart
        own = rounding_errors[output.name] if isinstance(rounding_errors, Mapping) else rounding_errors
        with np.errstate(invalid="ignore", divide="ignore"):
            steep = CAUTION * np.where(difference > 0, difference / np.abs(value), difference)
        result[output.name] = MeanSquare(value, np.abs(value) * (np.minimum(1.0, steep * np.sqrt(steep)) + own))
    return result


def truncation_bound(
    reduction: Reduction, values: Values, spectrum: Spectrum, speed: Array, cutoff: float
) -> dict[str, Array]:
    """Upper bound of the mean squares beyond `cutoff` [rad/s], whatever the lags.

    Returns {output: [labels, grid..., speeds]}. From |sum of n X_i U_i|^2 <= n sum of |X_i|^2 (sum of |W_iw|)^2,
    integrated over u = cutoff/omega on panels each half as long as the one before, because what is overdamped may bend
    the responses far beyond the last resonance.
    """
    rule = quadrature(np.append(0.0, np.exp2(np.arange(-TAIL, 1))))
    omega = cutoff / rule.omega
    density = angular_psd(spectrum, omega[:, None], speed) * (rule.weights * omega / rule.omega)[:, None]
    columns = {name: _diagonal(labels) for name, labels in reduction.sums.items()}
    nodes = [WeightedNodes(omega, density[None], None)]
    return {k: m.value for k, m in mean_squares(replace(reduction, columns=columns), values, nodes).items()}


def _diagonal(labels: tuple[tuple[tuple[int, Array], ...], ...]) -> tuple[Column, ...]:
    """n |X_i|^2 (sum of |W_iw|)^2 of every label's sum as columns of one lag function."""
    weights: dict[int, Array] = {}
    for place, terms in enumerate(labels):
        for i, wheels in terms:
            weights.setdefault(i, np.zeros(len(labels)))[place] += len(terms) * np.sum(np.abs(wheels)) ** 2
    return tuple(Column(((i, i, "re", 1.0),), 0, each) for i, each in weights.items())


class Products:
    """Real and imaginary parts of X_i X_j* of the scalars at some nodes: of numerators, over those of denominators."""

    def __init__(self, x: Scalars) -> None:
        self.x = x
        self.square = [1.0 / _modulus2(d) for d in x.denominators]
        self.heads: dict[tuple[int, int], tuple[Number, Number]] = {}

    def _head(self, a: int, b: int) -> tuple[Number, Number]:
        """1/(d_a d_b*), real and imaginary part; of -1 the denominator is 1."""
        if (a, b) not in self.heads:
            d = self.x.denominators
            if a == b:
                self.heads[a, b] = (self.square[a], 0.0) if a >= 0 else (1.0, 0.0)
            elif min(a, b) < 0:
                known = max(a, b)
                sign = -1.0 if a >= 0 else 1.0
                self.heads[a, b] = d[known].real * self.square[known], sign * d[known].imag * self.square[known]
            else:
                # 1/(d_a d_b*) = d_a* d_b/(|d_a|^2 |d_b|^2). As a function, because the operator may swap the factors
                # of a complex product, and with them the last bit, as the size of the arrays suits it.
                product = np.multiply(np.conj(d[a]), d[b])
                both = self.square[a] * self.square[b]
                self.heads[a, b] = product.real * both, product.imag * both
        return self.heads[a, b]

    def _product(self, i: int, j: int, part: str, factor: float, out: Array) -> None:
        """factor x Re or Im of X_i X_j*, into an array [grid..., nodes]."""
        one, other = self.x.fractions[i], self.x.fractions[j]
        head, tail = self._head(one.denominator, other.denominator)
        if i == j:
            np.multiply(factor * _modulus2(one.numerator), head, out=out)
            return
        a, b = np.real(one.numerator), np.imag(one.numerator)
        c, d = np.real(other.numerator), np.imag(other.numerator)
        real, imaginary = factor * (a * c + b * d), factor * (b * c - a * d)
        if part == "im":
            real, imaginary = imaginary, -real
        np.multiply(real, head, out=out)
        if isinstance(tail, float):
            return
        out -= imaginary * tail

    def power(self, each: Column, out: Array, spare: Array) -> None:
        """A column's power, into an array [grid..., nodes]; spare: another such array to work in."""
        first, *others = each.powers
        self._product(*first, out)
        for other in others:
            self._product(*other, spare)
            out += spare


class PairProducts:
    """Products of scalars at s, off the axis, and at -s: X_i(s) X_j(-s) is X_i X_j* on it.

    The mean of both ways round has the column's power as its real part on the axis. Real parts come first along the
    nodes, then imaginary ones.
    """

    def __init__(self, here: list[Number], mirrored: list[Number]) -> None:
        self.here, self.mirrored = here, mirrored

    def power(self, each: Column, out: Array, spare: Array) -> None:
        """A column's power, into an array [grid..., 2 x nodes]; spare is not used."""
        total: Number = 0.0
        for i, j, part, factor in each.powers:
            one, other = np.multiply(self.here[i], self.mirrored[j]), np.multiply(self.here[j], self.mirrored[i])
            total = total + factor / 2 * (other + one if part == "re" else other - one)
        count = out.shape[-1] // 2
        out[..., :count], out[..., count:] = np.real(total), np.imag(total)


def _modulus2(z: Number) -> Number:
    return np.square(np.real(z)) + np.square(np.imag(z)) if np.iscomplexobj(z) else np.square(z)


def add_product(total: Array, power: Array, weight: Array) -> None:
    """Add power [tiles, TILE, n] @ weight [n, speeds] to total [tiles, TILE, speeds].

    BLAS picks its order of summation by the shape of a product, so every product of a grid has the same shape and a
    row the same bits whatever its block. And the shape is small: OpenBLAS then neither copies its operands nor starts
    threads of its own (up to 4 x 65536 multiplications), which would fight with those that work on the blocks.
    """
    speeds = total.shape[-1]
    if speeds <= SPEEDS:
        total += power @ weight
        return
    parts = -(-speeds // SPEEDS)
    for k in range(parts):
        some = slice(k * speeds // parts, (k + 1) * speeds // parts)
        total[..., some] += power @ weight[:, some]
