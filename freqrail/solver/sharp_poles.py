"""The inverse of a block's matrix beside sharp resonances, to full precision, and circles around such poles.

Beside a pole p of damping ratio zeta an elimination at s leaves relative errors of EPSILON/zeta that change from s to
s; of the slope of a peak, whose halves cancel, 1/zeta times as much is left. But inside a circle that holds m poles

    K^-1(s) = Q S^-1 (s - T)^-1 Q^T + H(s),   M = contour integral of K^-1/(2 pi i),   H(s) = that of K^-1(z)/(z - s),

with U [unknowns, m] an orthonormal basis of what M spans, Q = M U*, S = U^H Q and T S = U^H M_1 U*, M_1 being the
integral of s K^-1 (of the kind of W.-J. Beyn, "An integral method for solving nonlinear eigenvalue problems", Linear
Algebra Appl. 436 (2012)). Unknowns that hardly move keep their digits in Q. The nodes lie on the circle, far from the
poles, where nothing is lost, so that rounding leaves one and the same error for all s. Poles may lie as close to each
other as they will; of a single one T is that of `solver.block_poles`, whose real part comes from the energy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_response import parts_of

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

RADIUS, AROUND = 0.4, 64  # of the circle that K^-1 is read on, relative to the nearest pole outside, and its nodes
ROOM = 16.0  # at least so many distances from the axis
WIDE = 0.02  # and so much of the poles' frequency, if other poles may be taken into it for that
MOST = 12  # poles in a circle
APART = 2.5  # what is outside of a circle around poles over what is inside, at least
FEW = 1.0 / 9  # the same the other way round, where poles are as good as one
POINTS = {True: 48, False: 96}  # nodes on a circle, for few poles and for more


@dataclass(frozen=True)
class LocalInverse:
    """K^-1 of one vehicle's block around some poles.

    centre, radius: of the circle, rad/s. head: Q S^-1 [unknowns, m]. poles: T [m, m], from the centre. tail: Q^T [m,
    unknowns]. around: K^-1 at the circle's nodes, [nodes, unknowns, unknowns].
    """

    centre: complex
    radius: float
    head: Complex
    poles: Complex
    tail: Complex
    around: Complex

    def at(self, centre: complex, offset: Complex) -> Complex:
        """K^-1 at centre + offset [n], rad/s: offsets that are small lose nothing beside a centre that is not."""
        t = (centre - self.centre) + offset
        turn = _turns(len(self.around))
        weights = turn / (turn - t[:, None] / self.radius) / turn.size
        regular = np.tensordot(weights, self.around, axes=(1, 0))
        shifted = t[:, None, None] * np.eye(len(self.poles)) - self.poles
        tail = np.broadcast_to(self.tail, (t.size, *self.tail.shape))
        return np.asarray(self.head @ np.linalg.solve(shifted, tail) + regular)

    def holds(self, s: complex) -> bool:
        """Whether s lies well inside the circle."""
        return abs(s - self.centre) < self.radius / 2

    def moved(self, shifts: Complex) -> LocalInverse:
        """With poles that are moved by shifts [m], rad/s, to try what difference it makes."""
        return replace(self, poles=self.poles + np.diag(shifts))


def _turns(count: int) -> Complex:
    return np.exp(2j * np.pi * (np.arange(count) + 0.5) / count)


def local_inverses(
    reduction: Reduction, values: Values, block: int, poles: Complex, which: NDArray[np.bool_]
) -> list[LocalInverse] | None:
    """K^-1 around those of a block's poles [k] (Im >= 0) that `which` names; None where others are too near.

    values: of one vehicle, floats.
    """
    conjugates = np.conj(poles)
    clusters = [[int(k)] for k in np.flatnonzero(which)]
    found: list[tuple[list[int], complex, float]] = []
    while clusters:
        members = clusters.pop()
        centre = complex(np.mean(poles[members]))
        outside = np.delete(poles, members)
        radius = RADIUS * float(np.min(np.abs(np.concatenate([outside, conjugates]) - centre)))
        inner = float(np.max(np.abs(poles[members] - centre)))
        needed = max(ROOM * float(np.max(np.abs(poles[members].real))), APART * inner)
        near = min(clusters, key=lambda other: float(np.min(np.abs(poles[other] - centre))), default=None)
        if near is not None and radius < max(needed, WIDE * abs(centre)) and len(members) + len(near) <= MOST:
            clusters.remove(near)
            clusters.append(members + near)
        elif radius < needed:
            return None
        else:
            found.append((members, centre, radius))
    return [_around(reduction, values, block, poles[members], centre, radius) for members, centre, radius in found]


def _around(
    reduction: Reduction, values: Values, block: int, poles: Complex, centre: complex, radius: float
) -> LocalInverse:
    turn = _turns(AROUND)
    s = centre + radius * turn
    parts = parts_of(reduction.blocks[block], reduction.lengths, values, s, np.square(s), {})
    matrix = np.broadcast_to(parts.matrix(), (s.size, *parts.matrix().shape[-2:]))
    size = np.max(np.abs(matrix), axis=0)
    n = len(parts.inertia)
    scale = np.ones(len(size))
    scale[:n] = 1.0 / np.sqrt(np.diag(size)[:n])
    scale[n:] = 1.0 / np.sqrt(np.diag(size)[n:] + np.square(size[n:, :n] * scale[:n]).sum(axis=1))
    scale = np.exp2(np.round(np.log2(scale)))  # products with powers of two are exact
    inverse = np.linalg.inv(matrix * np.outer(scale, scale))
    offset = radius * turn
    zeroth = np.tensordot(offset, inverse, axes=(0, 0)) / turn.size
    first = np.tensordot(np.square(offset), inverse, axes=(0, 0)) / turn.size
    span = np.linalg.svd(zeroth)[0][:, : poles.size]
    q = zeroth @ np.conj(span)
    s_inverse = np.linalg.inv(np.conj(span.T) @ q)
    found = (np.conj(span.T) @ first @ np.conj(span)) @ s_inverse
    if poles.size == 1:  # its real part is better known than that
        found = np.zeros((1, 1))
    return LocalInverse(
        centre,
        radius,
        np.asarray(q @ s_inverse * scale[:, None], complex),
        np.asarray(found, complex),
        np.asarray(q.T * scale, complex),
        np.asarray(inverse * np.outer(scale, scale), complex),
    )


@dataclass(frozen=True)
class Circle:
    """A circle around poles, with no other and none of their mirror images in it, rad/s."""

    centre: complex
    radius: float
    points: int

    def offsets(self) -> Complex:
        """Of its nodes from the centre: first those of the rule with half as many."""
        turn = _turns(self.points)
        return np.asarray(self.radius * np.concatenate([turn[::2], turn[1::2]]), complex)


def circles(poles: Complex, others: Complex) -> list[Circle] | None:
    """Circles that hold all poles, each once, and none of others; None where they cannot be told apart."""
    clusters = [[k] for k in range(poles.size)]
    while True:
        found = []
        for number, members in enumerate(clusters):
            centre = complex(np.mean(poles[members]))
            inner = float(np.max(np.abs(poles[members] - centre)))
            rest = np.setdiff1d(np.arange(poles.size), members)
            beside, beyond = np.abs(poles[rest] - centre), float(np.min(np.abs(others - centre)))
            outer = min(beyond, float(np.min(beside, initial=np.inf)))
            crowded = outer < max(APART * inner, 0.1 * beyond)
            if crowded and outer == beyond:
                return None
            if crowded:
                nearest = int(rest[np.argmin(beside)])
                other = next(k for k, some in enumerate(clusters) if nearest in some)
                clusters[min(number, other)] = clusters[number] + clusters[other]
                del clusters[max(number, other)]
                break
            radius = float(np.sqrt(max(inner, FEW * outer) * outer))
            found.append(Circle(centre, radius, POINTS[inner <= FEW * outer]))
        else:
            return found


def inverses_at(local: Mapping[int, list[LocalInverse]], centre: complex, offset: Complex) -> dict[int, Complex]:
    """K^-1 at centre + offset [n] of the blocks that have one there, {block: [n, unknowns, unknowns]}."""
    inside = centre + complex(offset[0])
    return {b: each.at(centre, offset) for b, some in local.items() for each in some if each.holds(inside)}
