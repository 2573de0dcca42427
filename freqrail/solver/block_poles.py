"""Blocks as partial fractions: their poles, the residues there, and what rounding leaves of both.

The poles come from the eigenvalues of the laws' realisations and are polished (`solver.free_oscillation`). At a simple
pole p with null vector z the inverse of the block's matrix K has the residue z z^T/(z^T K'(p) z). Of a lightly damped
pole the real part, which decides the height of its peak, comes from the energy that the struts take.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Law, Values
from freqrail.model.realisation import Realisation
from freqrail.reduction.blocks import Block
from freqrail.reduction.columns import Reduction, Scalar
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_response import used
from freqrail.solver.closed_form import EPSILON, FAR, LIGHT
from freqrail.solver.elimination import times
from freqrail.solver.free_oscillation import Oscillation, clusters, polished, real_parts, together
from freqrail.types import Number

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

SPREAD = 1e-8  # smallest eigenvalue over the largest below which the slow ones are computed apart
UNSURE = 5e-4  # relative error of a pole above which it is lost, if it is light
SURE = 0.1  # relative error of a light pole's real part up to which it counts as known
NOWHERE = -2e9  # a pole that is not there, where no response is read


@dataclass(frozen=True)
class Expansion:
    """A block as partial fractions: B(s) = constant + sum of residue_k/(s - pole_k), and of the conjugates.

    B are a block's scalars without their derivatives, a force's as the elongation that it belongs to, m per metre.
    poles: [grid..., k] rad/s, those with Im >= 0. weight: [grid..., k], 2 for a pole with a conjugate, 1 for a real
    one, 0 where a vehicle has fewer than k; then pole and residues mean nothing. residues: {scalar: [grid..., k]}.
    rounding: {scalar: [grid..., k]}, their possible errors, the real part's of a light pole included. defect: [grid...,
    k], the slope z^T K' z over the sizes of its terms, 0 where two poles have become one. light: [grid..., k], lightly
    damped. shift: [grid..., k], possible relative errors of the poles. lost: [grid..., k], one that no polishing found,
    that a vehicle cannot have, or whose real part rounding leaves open. states: number of states, as many as poles with
    their conjugates for any vehicle. raw: [grid..., states] rad/s, all eigenvalues as computed, those of missing states
    at -2 `FAR`.

    In memory the poles come first: expressions over them run along the grid. Every grid has all axes, some of length 1.
    """

    poles: Complex
    weight: Array
    residues: dict[int, Complex]
    rounding: dict[int, Array]
    constants: dict[int, float]
    defect: Array
    light: NDArray[np.bool_]
    shift: Array
    lost: NDArray[np.bool_]
    states: int
    raw: Complex

    def fractions(self, which: Sequence[int], s: Complex, known: bool = True) -> tuple[Complex, Array]:
        """B of some scalars at s [grid..., n], and what rounding may leave of them: [scalars, grid..., n].

        known: whether the latter is wanted; else it is zero.
        """
        present = self.weight > 0
        p, s = poles_first(np.where(present, self.poles, NOWHERE)), poles_first(s)
        pair = poles_first(self.weight) > 1
        shape = (len(which), *np.broadcast_shapes(s.shape, (1, *p.shape[1:])))
        result, left = np.empty(shape, complex), np.zeros(shape)
        for i, k in enumerate(which):
            result[i] = self.constants[k]
            left[i] = 4 * EPSILON * abs(self.constants[k])
        tables = [poles_first(np.where(present, self.residues[k], 0.0)) for k in which]
        mirrored = [np.where(pair, np.conj(table), 0.0) for table in tables]
        errors = [poles_first(np.where(present, self.rounding[k], 0.0)) for k in which if known]
        errors = [error + 4 * EPSILON * np.abs(table) for error, table in zip(errors, tables, strict=False)]
        for k in range(len(p)):  # one by one: the order of a sum's terms would depend on the shape
            near = 1.0 / (s - p[k])
            beside = 1.0 / (s - np.conj(p[k])) if np.any(pair[k]) else None
            if known:
                size = np.abs(near)
                if beside is not None:
                    size += np.where(pair[k], np.abs(beside), 0.0)
            for i in range(len(which)):
                result[i] += times(tables[i][k], near)
                if beside is not None:
                    result[i] += times(mirrored[i][k], beside)
                if known:
                    left[i] += size * errors[i][k]
        return np.moveaxis(result, 1, -1), np.moveaxis(left, 1, -1)


def poles_first(values: NDArray) -> NDArray:
    """Values [grid..., k] with the last axis first, [k, grid...]; several times faster than numpy's moveaxis."""
    return values.transpose(-1, *range(values.ndim - 1))


def poles_last(values: NDArray) -> NDArray:
    """Values [k, grid...] with the first axis last."""
    return values.transpose(*range(1, values.ndim), 0)


def bases(reduction: Reduction) -> Reduction:
    """The reduction with its scalars as `Expansion` has them: without derivatives, forces as elongations."""
    base = {"displacement": "displacement", "elongation": "elongation", "force": "elongation"}
    plain = tuple(replace(x, quantity=base[x.quantity], derivative=0) for x in reduction.scalars)
    return replace(reduction, scalars=plain)


def multiplier(scalar: Scalar, block: Block, values: Values, s: Number) -> Number:
    """What makes a scalar of its base: s^derivative, times D(s) for a force; values of `column`."""
    power = s**scalar.derivative
    if scalar.quantity != "force":
        return power
    return times(block.struts[scalar.of].law.stiffness(values, s), power)


def shape_of_block(block: Block, lengths: Lengths, values: Values) -> tuple[int, ...]:
    """The axes of the grid that a block depends on."""
    own = (np.shape(values[name]) for name in block.parameters)
    rows = (np.shape(entry) for strut in block.struts for entry in lengths.evaluate(strut.row, values))
    return np.broadcast_shapes(*own, *rows)


# --- eigenvalues -------------------------------------------------------------------------------------


def state_matrix(block: Block, lengths: Lengths, values: Values) -> tuple[Array, NDArray[np.bool_]]:
    """A of dx/dt = A x for a grid of vehicles, [grid..., n, n], and which states there are, [grid..., n].

    x = [dy/dt, inner elongations, y]. A state that a vehicle does not have, of a branch without damping or with a
    time below 1/`FAR`, stands by itself. Raises ValueError for a law without a realisation and for a contact that
    takes the track's acceleration.
    """
    n = block.size
    shape = shape_of_block(block, lengths, values)
    found = [_realised(strut.law, values) for strut in block.struts]
    inner = sum(len(each.branches) for each in found)
    states = 2 * n + inner
    a, there = np.zeros((*shape, states, states)), np.ones((*shape, states), dtype=bool)
    velocity, position = slice(0, n), slice(n + inner, states)
    a[..., range(n + inner, states), range(n)] = 1.0
    mass = np.zeros((*shape, n, n))
    for i, name in enumerate(block.inertias):
        mass[..., i, i] = values[name]
    at, by_inerter = n, False
    for strut, law in zip(block.struts, found, strict=True):
        entries = lengths.evaluate(strut.row, values)
        row = np.stack(np.broadcast_arrays(*(np.asarray(e, float) for e in entries)), axis=-1)
        outer = row[..., :, None] * row[..., None, :]
        if np.any(law.b):
            if strut.wheel:
                raise ValueError("a contact takes the track's acceleration")
            mass, by_inerter = mass + _wide(law.b, 2) * outer, True
        a[..., velocity, position] -= _wide(law.k, 2) * outer
        a[..., velocity, velocity] -= _wide(law.c, 2) * outer
        second: Number = False  # whether the branch before is the first of a conjugate pair here
        for c, tau in law.branches:
            own = (np.abs(tau) > 1 / FAR) & np.not_equal(c, 0)
            a[..., velocity, velocity] -= _wide(np.where(own, 0.0, np.real(c)), 2) * outer
            rate = 1.0 / np.where(own, tau, 1.0)
            first = own & (np.imag(rate) != 0) & np.logical_not(second)
            spring = np.where(own, c * rate, 0.0)
            # z of a pair c s/(1 + tau s) and its conjugate: real part in the first state, imaginary part in the next
            weight = np.where(first, 2.0, 1.0) * np.logical_not(second)
            a[..., velocity, position] -= _wide(weight * np.real(spring), 2) * outer
            force = np.where(second, 2 * np.imag(spring), weight * np.real(spring))
            a[..., velocity, at] += _wide(force, 1) * row
            pull = np.where(second, np.imag(np.conj(rate)), np.real(rate)) * own
            a[..., at, position] = _wide(pull, 1) * row
            a[..., at, at] = np.where(own, -np.real(rate), -2 * FAR)
            if np.any(second):
                a[..., at - 1, at] = np.where(second, np.imag(np.conj(rate)), 0.0)
                a[..., at, at - 1] = np.where(second, -np.imag(np.conj(rate)), 0.0)
            there[..., at] = own
            second, at = first, at + 1
    if by_inerter:
        regular = np.isfinite(mass).all(axis=(-2, -1), keepdims=True)
        inverse = np.linalg.inv(np.where(regular, mass, np.eye(n)))
        a[..., velocity, :] = np.where(regular, np.matmul(inverse, a[..., velocity, :]), np.nan)
    else:
        a[..., velocity, :] /= np.diagonal(mass, axis1=-2, axis2=-1)[..., None]
    return a, there


def _within(shape: tuple[int, ...], grid: tuple[int, ...]) -> bool:
    """Whether an array spans axes of a grid only."""
    return len(shape) <= len(grid) and all(a in (1, b) for a, b in zip(shape[::-1], grid[::-1], strict=False))


def _realised(law: Law, values: Values) -> Realisation:
    found = law.realisation(values)
    if found is None:
        raise ValueError(f"the law of {', '.join(law.names)} has no differential equation, hence no poles")
    return found


def _wide(x: Number, axes: int) -> Number:
    """A number of every vehicle with axes appended."""
    return np.reshape(x, (*np.shape(x), *(1,) * axes))


def poles(block: Block, lengths: Lengths, values: Values) -> Complex:
    """Eigenvalues of a block for a grid of vehicles, rad/s: [grid..., n].

    Those of missing states are -2 `FAR`, and all are NaN where the numbers overflow. Rounding leaves an error in
    proportion to the largest; where they are far apart the slow ones are therefore those of the inverse matrix.
    """
    a, there = state_matrix(block, lengths, values)
    finite = np.asarray(np.isfinite(a).all(axis=(-2, -1)))
    a = np.where(finite[..., None, None], a, -np.eye(a.shape[-1]))
    found = np.linalg.eigvals(a).astype(complex)
    size = np.where(there.all(axis=-1, keepdims=True) | (np.abs(found + 2 * FAR) > 1e-6 * FAR), np.abs(found), np.nan)
    wide = np.argwhere(np.nanmin(size, axis=-1) < SPREAD * np.nanmax(size, axis=-1))
    for place in map(tuple, wide):
        middle = np.sqrt(max(np.nanmin(size[place]), EPSILON * np.nanmax(size[place])) * np.nanmax(size[place]))
        try:
            slow = 1.0 / np.linalg.eigvals(np.linalg.inv(a[place]))
        except np.linalg.LinAlgError:
            continue
        both = np.concatenate([found[place][np.abs(found[place]) >= middle], slow[np.abs(slow) < middle]])
        if both.size == found.shape[-1]:
            found[place] = both
    return np.where(finite[..., None], found, np.nan)


# --- partial fractions -------------------------------------------------------------------------------


def expand(reduction: Reduction, values: Values) -> dict[int, Expansion]:
    """Partial fractions of every block that scalars are read off, for a grid of vehicles."""
    return {index: _expand(block, some, reduction.lengths, values) for index, block, some in used(bases(reduction))}


def expansion(reduction: Reduction, index: int, values: Values) -> Expansion:
    """Partial fractions of one block."""
    some = {k: x for k, x in enumerate(bases(reduction).scalars) if x.block == index}
    return _expand(reduction.blocks[index], some, reduction.lengths, values)


def _expand(block: Block, some: Mapping[int, Scalar], lengths: Lengths, values: Values) -> Expansion:
    raw = poles(block, lengths, values)
    states = raw.shape[-1]
    rows = [entry for scalar in some.values() for entry in lengths.evaluate(scalar.row, values)]
    vehicles = np.broadcast_shapes(raw.shape[:-1], *map(np.shape, rows), (1,) * max(map(np.ndim, values.values())))
    raw = poles_first(np.broadcast_to(raw, (*vehicles, states)))
    near = (np.abs(raw) < FAR) | (np.abs(raw.imag) > LIGHT * np.abs(raw))
    weight = np.where(raw.imag > 0, 2.0, np.where(raw.imag < 0, 0.0, 1.0)) * near
    count = max(1, int(np.max(np.sum(weight > 0, axis=0), initial=1)))
    order = np.argsort(-weight, axis=0, kind="stable")[:count]
    weight, upper = (np.take_along_axis(x, order, axis=0) for x in (weight, raw))
    grid = upper.shape
    p = np.where(weight > 0, upper, -1.0 + 0j).ravel()
    own = {
        name: np.broadcast_to(v, grid).ravel() if np.ndim(v) else v
        for name, v in values.items()
        if name in block.parameters or _within(np.shape(v), vehicles)
    }
    p, found = polished(block, lengths, own, p)
    for places in clusters(p.reshape(count, -1), (weight > 0).reshape(count, -1)).values():
        p, found = together(block, lengths, own, p, found, places)
    light = np.abs(p.real) < LIGHT * np.abs(p)
    off = 1.0 + np.abs(found.step) / np.abs(p) / EPSILON
    real_part, real_part_error = real_parts(block, own, p, found)
    peak = np.where(light, real_part_error, 0.0)
    p = np.where(light, real_part + 1j * p.imag, p)
    shift = (np.abs(found.step) + found.shift) / np.abs(p)
    # of a damped pole what is read at -p tells how wrong it is
    lost = ~((shift < np.where(light, UNSURE, np.inf)) & (p.real <= 0) & (peak < SURE))
    bright = np.flatnonzero(light)
    of_slope = _of_slope(block, p, found, bright)

    def last(x: NDArray) -> NDArray:
        return poles_last(x.reshape(grid))

    slope = np.abs(found.slope)
    residues, rounding, constants = {}, {}, {}
    for k, scalar in some.items():
        if scalar.quantity == "displacement":
            entries = [np.asarray(entry) for entry in lengths.evaluate(scalar.row, own)]
            u = sum(np.multiply(entry, x) for entry, x in zip(entries, found.x, strict=True))
            u_error = sum(np.multiply(np.abs(entry), x) for entry, x in zip(entries, found.x_errors, strict=True))
        else:
            u, u_error = found.e[scalar.of], found.e_errors[scalar.of]
        f, f_error = found.f[scalar.strut], found.f_errors[scalar.strut]
        residue = np.multiply(u, f) / found.slope
        own_error = (u_error * np.abs(f) + np.abs(u) * f_error) / slope
        error = (own_error + np.abs(residue) * found.slope_error) * off
        # a peak hangs on its residue: there what cancels in its error is not counted twice
        error[bright] = _residue_errors(block, lengths, own, scalar, found, bright, residue, of_slope)
        residues[k] = last(residue)
        rounding[k] = last(error + np.abs(residue) * peak)
        constants[k] = -1.0 if scalar.quantity == "elongation" and scalar.of == scalar.strut else 0.0
    there = weight > 0
    return Expansion(
        last(np.where(there, p.reshape(grid), np.where(np.isnan(upper), np.nan, -1.0))),
        last(weight),
        residues,
        rounding,
        constants,
        last(slope / found.size),
        last(light),
        last(shift),
        last(lost.reshape(grid) & there),
        states,
        np.moveaxis(raw, 0, -1),
    )


def _of_slope(block: Block, p: Complex, found: Oscillation, some: NDArray[np.intp]) -> Array:
    """Relative errors of z^T K' z at some poles [n] by K' itself: as the laws' slopes are off, and as the poles are."""
    n = block.size
    terms = np.abs(np.multiply(found.by_s[:, some], np.square(found.z[:, some])))
    of_laws = functools.reduce(operator.add, (terms[n + j] * found.of_laws[j, some] for j in range(len(block.struts))))
    size = functools.reduce(operator.add, terms)
    moved = found.shift[some] / np.abs(p[some])
    return (of_laws * (1 + moved / EPSILON) + 4 * EPSILON * size) / np.abs(found.slope[some])


def _residue_errors(
    block: Block,
    lengths: Lengths,
    values: Values,
    scalar: Scalar,
    found: Oscillation,
    some: NDArray[np.intp],
    residue: Complex,
    of_slope: Array,
) -> Array:
    """Errors of a scalar's residues at some poles by rounding."""
    row = np.zeros(found.z.shape)
    factor, of_factor = np.ones(1), np.zeros(1)
    if scalar.quantity == "displacement":
        for i, entry in enumerate(lengths.evaluate(scalar.row, values)):
            row[i] = entry
    else:  # an elongation: its force times the law's compliance
        row[block.size + scalar.of] = 1.0
        factor, of_factor = np.abs(found.compliances[scalar.of, some]), found.of_laws[scalar.of, some]
    return factor * found.residue_errors(some, row, scalar.strut) + np.abs(residue[some]) * (of_slope + of_factor)
