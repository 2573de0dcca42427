"""Gradients of the mean squares over a frequency band, by every parameter and by the speed.

With sigma^2 a sum of columns (`reduction.columns`), integrals of a power P of the vehicle times a function W of the
lags and of the track,

    d sigma^2/dp = sum of integral of (dP/dp) W + P (dW/dp),

on the nodes of the mean square itself: P depends on the parameters of the vehicle, W on the speed and on lengths
between wheels. The powers' slopes follow from those of the scalars (`solver.block_slopes`) by the product rule; as with
mean squares the speed axis is a matrix product over the nodes, one for every column and parameter that touches it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.reduction.columns import Column, Reduction
from freqrail.solver.block_quadrature import add_product, shape_of
from freqrail.solver.block_response import column, unsound
from freqrail.solver.block_slopes import Sloped, check_wanted, slopes
from freqrail.solver.lag_slopes import POWERS, SPEED, GradientNodes, groups_of, moves
from freqrail.solver.quadrature import CAUTION, ROUNDING, TILE, MeanSquare
from freqrail.types import Number

Array = NDArray[np.float64]


def mean_square_gradients(
    reduction: Reduction,
    values: Values,
    nodes: Iterable[GradientNodes],
    wanted: Iterable[str],
    rounding_errors: Mapping[str, Array] | Array | float = ROUNDING,
) -> dict[str, dict[str, MeanSquare]]:
    """Slopes of the mean squares of every output of a reduction by parameters and speed, for a grid of vehicles.

    values: by parameter, broadcasting to [grid...]; the wheels stand in one geometry, that of the nodes. nodes: of
    `lag_slopes.gradient_nodes`, for the same names. wanted: names of parameters, and `SPEED`; a name that several legs
    share is one parameter. rounding_errors: relative, of a response's square at the nodes, for all outputs or by name.
    Returns {output: {name: MeanSquare}}, [labels, grid..., speeds], in the mean square's unit over the parameter's.

    The slope by the stiffness of a rigid joint (inf) is 0. The error estimate has QUADPACK's form: with d the
    difference of the two rules and A a bound of the integral of the integrand's size, which changes its sign at every
    resonance, min(CAUTION d, (CAUTION d)^1.5/A^0.5), and of A what rounding leaves. d and A sum over the columns
    without their signs, so that they cannot cancel.
    Raises ValueError for what is no parameter, for a length that the reduction holds for one value of only
    (`block_slopes.lengths_free`), for no nodes, and for nodes without weights for a name.
    """
    wanted = tuple(dict.fromkeys(wanted))
    names = tuple(name for name in wanted if name != SPEED)
    check_wanted(reduction, names)
    nodes = list(nodes)
    if not nodes:
        raise ValueError("no nodes")
    for part in nodes:
        lacking = {*moves(reduction, names), *{SPEED}.intersection(wanted)} - part.kronrod.keys()
        if POWERS in part.kronrod and lacking:
            raise ValueError(f"the nodes have no weights for {', '.join(sorted(lacking))}")
    columns = [(name, each) for name, some in reduction.columns.items() for each in some]
    sums = _Sums(shape_of(values), nodes[0].kronrod)
    on_axis = [part.omega for part in nodes if np.isrealobj(part.omega)]
    exact = unsound(reduction, values, np.concatenate(on_axis)) if on_axis else frozenset()
    spread = column(values)
    for part in nodes:
        own = [name for name in part.kronrod if name in wanted]
        by = names if POWERS in part.kronrod else ()
        omega = part.omega
        with np.errstate(all="ignore"):
            here = slopes(reduction, spread, 1j * omega, -np.square(omega), by, exact, part.inverses[0])
            powers: Powers | PairPowers = Powers(here)
            if np.iscomplexobj(omega):
                mirrored = slopes(reduction, spread, -1j * omega, -np.square(omega), by, exact, part.inverses[1])
                powers = PairPowers(here, mirrored)
            space = sums.space(next(iter(part.kronrod.values())).shape[1])
            for index, (_, each) in enumerate(columns):
                if own:
                    powers.value(each, *space.targets)
                    for name in own:
                        sums.add((index, name), space, part, name, each.lag)
                for name in powers.names(each):
                    powers.slope(each, name, *space.targets)
                    sums.add((index, name), space, part, POWERS, each.lag)
    return {
        output.name: {
            name: sums.total(
                [(sums.found.get((k, name)), each) for k, (of, each) in enumerate(columns) if of == output.name],
                len(output.taps),
                rounding_errors[output.name] if isinstance(rounding_errors, Mapping) else rounding_errors,
            )
            for name in wanted
        }
        for output in reduction.outputs
    }


def rms_gradient(square: MeanSquare, slope: MeanSquare) -> MeanSquare:
    """The slope of an RMS, and its error estimate, from a mean square and its slope."""
    with np.errstate(divide="ignore", invalid="ignore"):
        twice = 2 * np.sqrt(square.value)
        value = slope.value / twice
        return MeanSquare(value, slope.error / twice + np.abs(value) * (square.error / (2 * square.value)))


@dataclass(frozen=True)
class _Space:
    """Powers in tiles, [tiles, TILE, n], and the same memory as [grid..., n], with as much to work in."""

    padded: Array
    sizes: Array
    targets: tuple[Array, Array]


@dataclass
class _Sum:
    """Of a column and a name: by both rules [2, tiles, TILE, speeds], and its size [tiles, TILE, groups]."""

    both: Array
    size: Array


class _Sums:
    """Sums over the nodes, by column and name."""

    def __init__(self, grid: tuple[int, ...], weights: Mapping[str, Array]) -> None:
        self.grid, self.rows = grid, math.prod(grid)
        self.tile = TILE if grid else 1  # a single vehicle is never part of a block
        self.tiles = -(-self.rows // self.tile)
        self.speeds = next(iter(weights.values())).shape[-1]
        self.groups = groups_of(self.speeds)
        self.found: dict[tuple[int, str], _Sum] = {}

    def space(self, nodes: int) -> _Space:
        padded = np.zeros((self.tiles, self.tile, nodes))
        target = padded.reshape(self.tiles * self.tile, nodes)[: self.rows].reshape(*self.grid, nodes)
        return _Space(padded, np.empty_like(padded), (target, np.empty((*self.grid, nodes))))

    def add(self, key: tuple[int, str], space: _Space, part: GradientNodes, weights: str, lag: int) -> None:
        """Add the powers in a space times weights under a name."""
        if key not in self.found:
            shape = (self.tiles, self.tile)
            self.found[key] = _Sum(np.zeros((2, *shape, self.speeds)), np.zeros((*shape, len(self.groups))))
        own = self.found[key]
        add_product(own.both[0], space.padded, part.kronrod[weights][lag])
        if part.gauss is not None:
            add_product(own.both[1], space.padded, part.gauss[weights][lag])
        add_product(own.size, np.abs(space.padded, out=space.sizes), part.sizes[weights][lag])

    def total(self, sums: list[tuple[_Sum | None, Column]], labels: int, rounding: Array | float) -> MeanSquare:
        """Value and error estimate [labels, grid..., speeds] of columns' sums; None of a column that adds nothing."""
        columns = [(own, *self._grid(own.both), each.weights) for own, each in sums if own is not None]
        value, error = np.zeros((2, labels, *self.grid, self.speeds))
        for label in range(labels):
            for _, total, _, weights in columns:
                if weights[label]:
                    value[label] += weights[label] * total
        # labels that the columns add to with the same sizes, as those of front and rear, share their estimate
        by_sizes: dict[tuple[float, ...], list[int]] = {}
        for label in range(labels):
            by_sizes.setdefault(tuple(abs(float(c[-1][label])) for c in columns), []).append(label)
        for weights, some in by_sizes.items():
            apart, size = np.zeros((2, *self.grid, self.speeds))
            for weight, (own, total, embedded, _) in zip(weights, columns, strict=True):
                if weight:
                    apart += weight * np.abs(total - embedded)
                    for k, group in enumerate(self.groups):
                        size[..., group] += weight * self._grid(own.size)[..., k, None]
            apart *= CAUTION
            with np.errstate(invalid="ignore", divide="ignore"):
                steep = np.where(apart > 0, np.sqrt(apart / size), 0.0)
            error[some] = apart * np.minimum(1.0, steep) + rounding * size
        return MeanSquare(value, error)

    def _grid(self, tiles: Array) -> Array:
        """[..., tiles, TILE, k] as [..., grid..., k]."""
        before, last = tiles.shape[:-3], tiles.shape[-1]
        return tiles.reshape(*before, self.tiles * self.tile, last)[..., : self.rows, :].reshape(
            *before, *self.grid, last
        )


class Powers:
    """Powers of columns at s = i omega, and their slopes, into arrays [grid..., nodes]; with another to work in."""

    def __init__(self, sloped: Sloped) -> None:
        self.x = [_parts(x) for x in sloped.scalars]
        self.slopes = [{name: _parts(slope) for name, slope in own.items()} for own in sloped.slopes]
        self.times: dict[tuple[int, float], Parts] = {}

    def names(self, each: Column) -> tuple[str, ...]:
        """The parameters that a column's power depends on."""
        return _names(each, self.slopes)

    def _times(self, k: int, factor: float) -> Parts:
        """A scalar times a factor."""
        if (k, factor) not in self.times:
            real, imaginary = self.x[k]
            self.times[k, factor] = factor * real, factor * imaginary
        return self.times[k, factor]

    def value(self, each: Column, out: Array, spare: Array) -> None:
        """A column's power."""
        _sum([(self.x[i], self._times(j, factor), part) for i, j, part, factor in each.powers], out, spare)

    def slope(self, each: Column, name: str, out: Array, spare: Array) -> None:
        """Its slope by a parameter: dX_i X_j* and X_i dX_j*."""
        terms = []
        for i, j, part, factor in each.powers:
            one, other = self.slopes[i].get(name), self.slopes[j].get(name)
            if i == j and one is not None:
                terms.append((one, self._times(i, 2 * factor), part))
                continue
            terms += [(one, self._times(j, factor), part)] if one is not None else []
            terms += [(self._times(i, factor), other, part)] if other is not None else []
        _sum(terms, out, spare)


class PairPowers:
    """The same at s off the axis, where X(s) Y(-s) is what X Y* is on it: real parts first along the nodes, then
    imaginary ones. The mean of both ways round has the column's power as its real part on the axis.
    """

    def __init__(self, here: Sloped, mirrored: Sloped) -> None:
        self.here, self.mirrored = here, mirrored

    def names(self, each: Column) -> tuple[str, ...]:
        """The parameters that a column's power depends on."""
        return _names(each, self.here.slopes)

    def value(self, each: Column, out: Array, spare: Array) -> None:
        """A column's power; spare is not used."""
        self._sum(each, [(self.here.scalars, self.mirrored.scalars)], out)

    def slope(self, each: Column, name: str, out: Array, spare: Array) -> None:
        """Its slope by a parameter; spare is not used."""
        one, other = ([own.get(name, 0.0) for own in sloped.slopes] for sloped in (self.here, self.mirrored))
        self._sum(each, [(one, self.mirrored.scalars), (self.here.scalars, other)], out)

    def _sum(self, each: Column, pairs: list[tuple[list[Number], list[Number]]], out: Array) -> None:
        total: Number = 0.0
        for x, y in pairs:
            for i, j, part, factor in each.powers:
                one, other = np.multiply(x[i], y[j]), np.multiply(x[j], y[i])
                total = total + factor / 2 * (other + one if part == "re" else other - one)
        count = out.shape[-1] // 2
        out[..., :count], out[..., count:] = np.real(total), np.imag(total)


Parts = tuple[Array, Array]


def _parts(z: Number) -> Parts:
    """Real and imaginary part, each in memory of its own: twice as fast to compute with."""
    return np.ascontiguousarray(np.real(z)), np.ascontiguousarray(np.imag(z))


def _names(each: Column, gradients: list[dict[str, Any]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for i, j, *_ in each.powers for k in (i, j) for name in gradients[k]))


def _sum(terms: list[tuple[Parts, Parts, str]], out: Array, spare: Array) -> None:
    """Sum of Re or Im of X Y* over (X, Y, "re" or "im")."""
    for place, ((a, b), (c, d), part) in enumerate(terms):
        one, other, change = (a, b, np.add) if part == "re" else (b, a, np.subtract)
        if place:
            out += np.multiply(one, c, out=spare)
        else:
            np.multiply(one, c, out=out)
        change(out, np.multiply(other, d, out=spare), out=out)
