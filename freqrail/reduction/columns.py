"""|T|^2 of every response as a sum of columns: real powers of the vehicle times real functions of the wheels' lags.

A response at a label is h = sum of X_i U_i: X_i(s) are the complex scalars of the blocks, read off once however often
they occur, and U_i = sum of W_iw u_w with u_w = e^{i omega x_w/v} sums over the wheels. Hence

    |h|^2 = sum |X_i|^2 |U_i|^2 + 2 sum over i < j of Re(X_i X_j*) Re(U_i U_j*) - Im(X_i X_j*) Im(U_i U_j*)

in which a product of U's is a sum of cosines or sines of the wheels' distances. Products that vanish (a vehicle that is
its own mirror image has real and imaginary U's only) are left out, and what is in proportion is taken together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.outputs import Displacement, Elongation, Force, Output
from freqrail.model.system import System, evaluate
from freqrail.reduction.blocks import Block, blocks_of
from freqrail.reduction.forms import SAME, Form, Lengths, direction

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Scalar:
    """One complex function X(s) of a block per metre of its input.

    block: its index. strut: of the input. quantity: "displacement" of `row` (forms [nb, 1 + varying]), "elongation" or
    "force" of strut `of`. derivative: X holds the factor s^derivative.
    """

    block: int
    strut: int
    quantity: str
    of: int
    row: Form
    derivative: int


@dataclass(frozen=True)
class Lag:
    """A real function of the lags: factor x Re or Im of U U'*, with U = sum of one u_w and U' = sum of other u_w."""

    one: Vector
    other: Vector
    part: str
    factor: float


@dataclass(frozen=True)
class Column:
    """A term of |T|^2: sum of factor x Re or Im of X_i X_j* over (i, j, "re" or "im", factor), times a lag function.

    lag: index. weights: [labels], how often it enters at each label of the response.
    """

    powers: tuple[tuple[int, int, str, float], ...]
    lag: int
    weights: Vector


@dataclass(frozen=True)
class Reduction:
    """A system reduced to blocks, for some outputs.

    sums: {output: for each label [(scalar, W [wheels])]}, h as a sum. columns: {output: columns}, |h|^2 as a sum.
    """

    system: System
    outputs: tuple[Output, ...]
    lengths: Lengths
    blocks: tuple[Block, ...]
    scalars: tuple[Scalar, ...]
    sums: dict[str, tuple[tuple[tuple[int, Vector], ...], ...]]
    lags: tuple[Lag, ...]
    columns: dict[str, tuple[Column, ...]]

    def only(self, names: tuple[str, ...]) -> Reduction:
        """The reduction for some of its outputs; scalars that only others need are still told, but belong to none."""
        some = tuple(output for output in self.outputs if output.name in names)
        return replace(
            self,
            outputs=some,
            sums={output.name: self.sums[output.name] for output in some},
            columns={output.name: self.columns[output.name] for output in some},
        )

    def blocks_in(self, name: str) -> tuple[int, ...]:
        """Indices of the blocks that an output is read off: what happens in another is nothing to it."""
        return tuple(sorted({self.scalars[k].block for label in self.sums[name] for k, _ in label}))

    def places(self, values: Values) -> Vector:
        """Of the wheels along the vehicle, m, [wheels]; every length of theirs one number."""
        return np.array([float(evaluate(wheel.place, values)) for wheel in self.system.wheels])


def reduce(system: System, outputs: tuple[Output, ...], values: Values) -> Reduction:
    """Blocks, scalars and columns of a system for some outputs.

    values: those of the lengths (`System.lengths`), floats, or arrays for those that vary over the grid. The result
    holds for all vehicles of the grid. Raises ValueError for a tap of a leg or freedom that there is not.
    """
    lengths, blocks = blocks_of(system, values)
    reading = _Reading(system, lengths, blocks)
    sums = {output.name: tuple(reading.sum(tap, output.derivative) for _, tap in output.taps) for output in outputs}
    distances = _Distances(system, lengths)
    lags: list[tuple[Vector, Lag]] = []
    columns = {name: tuple(_columns(labels, distances, lags)) for name, labels in sums.items()}
    return Reduction(
        system, outputs, lengths, blocks, tuple(reading.scalars), sums, tuple(lag for _, lag in lags), columns
    )


class _Reading:
    """Taps as sums of scalars, each scalar once."""

    def __init__(self, system: System, lengths: Lengths, blocks: tuple[Block, ...]) -> None:
        self.system, self.lengths, self.blocks = system, lengths, blocks
        self.freedoms = tuple(freedom.name for freedom in system.freedoms)
        self.rows = {each.name: k for k, (each, _) in enumerate(system.rows)}
        self.scalars: list[Scalar] = []

    def sum(self, tap: Displacement | Elongation | Force, derivative: int) -> tuple[tuple[int, Vector], ...]:
        """h as (scalar, W): what a tap reads."""
        found: dict[int, Vector] = {}
        for block in self.blocks:
            for quantity, of, row, factor in self._parts(tap, block):
                for strut in block.inputs:
                    weights = np.zeros(len(self.system.wheels))
                    for member, weight in block.struts[strut].members:
                        weights[member - len(self.system.legs)] = weight
                    scalar = self._scalar(Scalar(block.alike, strut, quantity, of, row, derivative))
                    found[scalar] = found.get(scalar, 0.0) + factor * weights
        return tuple((scalar, _clean(weights)) for scalar, weights in sorted(found.items()) if np.any(_clean(weights)))

    def _parts(self, tap: Displacement | Elongation | Force, block: Block) -> Iterator[tuple[str, int, Form, float]]:
        """What a tap reads off a block: (quantity, strut, row, factor)."""
        nothing = np.zeros((block.size, self.lengths.size))
        if isinstance(tap, Displacement):
            unknown = [name for name in tap.row if name not in self.freedoms]
            if unknown:
                raise ValueError(f"no freedom {unknown[0]!r} to read; there are {', '.join(self.freedoms)}")
            row = np.einsum("na,nb->ba", self.lengths.row(tap.row, self.freedoms), block.basis)
            factor, unit = direction(row)
            if abs(factor) > SAME:
                yield "displacement", -1, unit, factor
            return
        if tap.of not in self.rows:
            raise ValueError(f"no leg or wheel {tap.of!r} to read; there are {', '.join(self.rows)}")
        quantity = "elongation" if isinstance(tap, Elongation) else "force"
        for strut, each in enumerate(block.struts):
            for member, weight in each.members:
                if member == self.rows[tap.of]:
                    yield quantity, strut, nothing, weight

    def _scalar(self, scalar: Scalar) -> int:
        for index, other in enumerate(self.scalars):
            same = (scalar.block, scalar.strut, scalar.quantity, scalar.of, scalar.derivative) == (
                other.block,
                other.strut,
                other.quantity,
                other.of,
                other.derivative,
            )
            if same and np.all(np.abs(scalar.row - other.row) <= SAME):
                return index
        self.scalars.append(scalar)
        return len(self.scalars) - 1


class _Distances:
    """Cosines and sines of the distances between wheels, as coordinates of products of U's."""

    def __init__(self, system: System, lengths: Lengths) -> None:
        places = np.array([lengths.arm(wheel.place) for wheel in system.wheels])
        apart = places[:, None, :] - places[None, :, :]
        scale = max(1.0, float(np.max(np.abs(apart))))
        found: list[Vector] = []
        self.index = np.zeros(apart.shape[:2], dtype=int)
        self.sign = np.zeros(apart.shape[:2])
        for place in np.ndindex(apart.shape[:2]):
            factor, unit = direction(apart[place])
            vector = abs(factor) * unit
            for k, other in enumerate(found):
                if np.all(np.abs(vector - other) <= SAME * scale):
                    self.index[place] = k
                    break
            else:
                self.index[place] = len(found)
                found.append(vector)
            self.sign[place] = np.sign(factor)
        self.count = len(found)
        self.forms = found

    def product(self, one: Vector, other: Vector, part: str) -> Vector:
        """Re or Im of U U'* as factors of cosines and of sines: [2 x distances]."""
        outer = np.outer(one, other)
        result = np.zeros(2 * self.count)
        if part == "re":
            np.add.at(result, self.index, outer)
        else:
            np.add.at(result, self.count + self.index, self.sign * outer)
        size = np.sum(np.abs(outer))
        return np.where(np.abs(result) > SAME * size, result, 0.0)


def _columns(
    labels: tuple[tuple[tuple[int, Vector], ...], ...], distances: _Distances, lags: list[tuple[Vector, Lag]]
) -> list[Column]:
    """|h|^2 at every label as columns; new lag functions are appended to `lags`."""
    entries: dict[tuple[int, int, str], dict[int, Vector]] = {}
    for place, terms in enumerate(labels):
        for a, (i, one) in enumerate(terms):
            for j, other in terms[a:]:
                for part, sign in (("re", 1.0), ("im", -1.0)):
                    vector = distances.product(one, other, part)
                    if (i == j and part == "im") or not np.any(vector):
                        continue
                    factor, lag = _lag(vector, one, other, part, lags)
                    weights = entries.setdefault((i, j, part), {}).setdefault(lag, np.zeros(len(labels)))
                    weights[place] += sign * factor * (1.0 if i == j else 2.0)
    columns: list[Column] = []
    for (i, j, part), by_lag in entries.items():
        for lag, weights in by_lag.items():
            factor, unit = direction(weights)
            largest = float(np.max(np.abs(unit)))
            factor, unit = factor * largest, unit / largest
            power = (i, j, part, factor)
            for k, column in enumerate(columns):
                if column.lag == lag and np.all(np.abs(column.weights - unit) <= SAME):
                    columns[k] = Column((*column.powers, power), lag, column.weights)
                    break
            else:
                columns.append(Column((power,), lag, unit))
    return columns


def _lag(vector: Vector, one: Vector, other: Vector, part: str, lags: list[tuple[Vector, Lag]]) -> tuple[float, int]:
    """(factor, index) of a lag function given by its cosines and sines."""
    factor, unit = direction(vector)
    for index, (known, _) in enumerate(lags):
        if np.all(np.abs(known - unit) <= SAME):
            return factor, index
    lags.append((unit, Lag(one, other, part, 1 / factor)))
    return factor, len(lags) - 1


def lag_sums(reduction: Reduction) -> tuple[Form, Vector]:
    """Lag functions as sums over the wheels' distances: forms d [distances, 1 + varying], m, factors [lags, distances].

    A lag function of a real part is the sum of factor x cos(omega d/v), of an imaginary part of factor x sin(omega
    d/v).
    """
    distances = _Distances(reduction.system, reduction.lengths)
    factors = np.zeros((len(reduction.lags), distances.count))
    for k, lag in enumerate(reduction.lags):
        cosines, sines = np.split(distances.product(lag.one, lag.other, lag.part), 2)
        factors[k] = lag.factor * (cosines if lag.part == "re" else sines)
    return np.array(distances.forms), factors


def _clean(weights: Vector) -> Vector:
    return np.where(np.abs(weights) > SAME * np.max(np.abs(weights), initial=0.0), weights, 0.0)
