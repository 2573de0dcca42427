"""Ways and nodes for integrals over the whole frequency axis: of a pair of scalars,

    integral over omega > 0 of F(i omega), F(s) = X(s) Y(-s) G(s) e^{s d}, d >= 0.

The way follows the axis up to i end and from there not the axis, where the lags turn without end, but goes straight to
the left, where they die out. With the poles p of X above,

    integral from end on = i integral over x > 0 of F(i end - x) + 2 pi sum of Res F(p).

Panels follow the poles, and beyond the last one in x the rest is one panel in 1/x: nothing is truncated. Where no
resonance is sharp, the way leaves the axis above all of them and there are no residues: poles may then merge, meet
those of the track or be double, as in slopes. Sharp ones are left above. Their residues are integrals over circles,
which mind no double poles either, with the blocks' inverses of `solver.sharp_poles`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.spectrum import RationalSpectrum, angular_psd, angular_psd_slope, singular_points
from freqrail.reduction.columns import Reduction, lag_sums
from freqrail.solver.lag_slopes import POWERS, SPEED, GradientNodes, gradient_nodes, moves, sizes_of
from freqrail.solver.quadrature import fewest_nodes, panel_edges, quadrature
from freqrail.solver.sharp_poles import Circle, LocalInverse, circles, inverses_at, local_inverses

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Poles = Mapping[int, Complex]
"""Of a vehicle by block, rad/s, those with Im >= 0."""

BEYOND = 2.0  # times the highest resonance: where the way leaves the axis
SHARP = 1e-3  # damping ratio below which a resonance is left above
GAPS = np.linspace(0.5, 0.9, 9)  # times the lowest sharp resonance: where the way may leave the axis below it
REFINEMENT = 1.5  # panels shorter than those of mean squares by this: the poles are double
OUTSIDE = 4.0  # times the largest pole: where the last panel begins
MOST_NODES = 400_000  # of a rule that the lags of a slow vehicle call for; beyond it there is none
TRIED = 1e-3  # shift of a sharp pole, relative to its distance from the axis, to see what rounding of it does
PART = 160  # nodes at a time, about
ENTRIES = 400_000  # nodes times speeds that one rule serves


@dataclass(frozen=True)
class Above:
    """What a vehicle has above the way: circles around the poles, and inverses around them by block."""

    circles: list[Circle]
    local: dict[int, list[LocalInverse]]

    def moved(self) -> Above:
        """With frequencies of the poles moved by `TRIED` of their distances from the axis, up and down in turn."""
        sign, local = itertools.cycle((1j, -1j)), {}
        for block, some in self.local.items():
            local[block] = [
                each.moved(np.array([next(sign) * TRIED * abs(each.centre.real) for _ in each.poles])) for each in some
            ]
        return replace(self, local=local)

    @property
    def sharpness(self) -> float:
        """Largest frequency of a pole over its distance from the axis."""
        some = (each for inverses in self.local.values() for each in inverses)
        return max((abs(each.centre / each.centre.real) for each in some), default=0.0)

    @property
    def nearness(self) -> float:
        """Largest frequency of a pole over the radius of the circle that its inverse is read on."""
        some = (each for inverses in self.local.values() for each in inverses)
        return max((abs(each.centre) / each.radius for each in some), default=0.0)


@dataclass(frozen=True)
class Way:
    """Where a way leaves the axis, rad/s, and what each of its vehicles has above, None without."""

    end: float
    above: list[Above | None]


def way_of(reduction: Reduction, vehicles: Sequence[tuple[Values, Poles]]) -> Way:
    """The way for some vehicles, each with its values, floats, and its poles by block."""
    poles = np.concatenate([p for _, own in vehicles for p in own.values()])
    plain = Way(max(BEYOND * float(np.max(poles.imag)), float(np.min(np.abs(poles)))), [None] * len(vehicles))
    sharp = np.abs(poles.real) < SHARP * poles.imag
    if not np.any(sharp):
        return plain
    ends = GAPS * np.min(poles.imag[sharp])
    end = float(ends[np.argmax([np.min(np.abs(poles.imag / each - 1)) for each in ends])])
    above: list[Above | None] = []
    for values, own in vehicles:
        everything = np.concatenate(list(own.values()))
        inside = everything.imag > end
        around = circles(everything[inside], np.concatenate([-np.conj(everything), everything[~inside]]))
        local = {block: local_inverses(reduction, values, block, p, p.imag > end) for block, p in own.items()}
        known = {block: some for block, some in local.items() if some is not None}
        if around is None or len(known) < len(local):
            return plain  # too crowded
        above.append(Above(around, known))
    return Way(end, above)


def speed_groups(way: Way, length: float, speed: Array) -> Iterator[NDArray[np.intp]]:
    """Indices of speeds [m/s] that one rule serves, slower ones in smaller groups; those too slow for any in none.

    length: between the first wheel and the last, m.
    """
    edges = np.array([0.0, way.end])
    order = np.argsort(-speed, kind="stable")
    needed = np.array([REFINEMENT * fewest_nodes(edges, length / v) for v in speed[order]])
    order, needed = order[needed < MOST_NODES], needed[needed < MOST_NODES]
    while order.size:
        count = 1 + int(np.sum(needed[1:] * np.arange(2, order.size + 1) < ENTRIES))
        yield np.sort(order[:count])
        order, needed = order[count:], needed[count:]


def nodes_along(
    way: Way,
    poles: Complex,
    reduction: Reduction,
    values: Values,
    spectrum: RationalSpectrum,
    speed: Array,
    wanted: tuple[str, ...],
) -> Iterator[GradientNodes]:
    """Nodes on the axis, then to the left of it. values: of a vehicle with the wheels' places, floats."""
    everything = np.concatenate([poles, singular_points(spectrum, speed)])
    lag = float(np.ptp(reduction.places(values))) / float(np.min(speed))
    rule = quadrature(panel_edges(np.array([0.0, way.end]), everything, lag, REFINEMENT))
    limits = np.array([np.zeros(speed.size), np.full(speed.size, np.inf)])
    held = np.zeros(limits.shape)
    yield from gradient_nodes(reduction, values, spectrum, rule, speed, limits, held, wanted, PART)
    for omega, weights, gauss in _to_the_left(way.end, everything, lag):
        for first, last in ((0, gauss.size), (gauss.size, omega.size)):
            for some in np.array_split(np.arange(first, last), -(-(last - first) // (PART // 2))):
                functions = _functions(reduction, values, spectrum, omega[some, None], speed, wanted)
                yield _weighted(functions, omega[some], weights[some], gauss[some] if last == gauss.size else None)


def nodes_around(
    above: Above,
    reduction: Reduction,
    values: Values,
    spectrum: RationalSpectrum,
    speed: Array,
    wanted: tuple[str, ...],
) -> Iterator[GradientNodes]:
    """Nodes on the circles around a vehicle's poles above the way; its values, floats."""
    for circle in above.circles:
        offset = circle.offsets()
        half = offset.size // 2
        for some in (slice(0, half), slice(half, None)):
            own = offset[some]
            omega = (circle.centre + own) / 1j
            inverses = _inverses(above, circle, own)
            weights = 2 * np.pi * own / offset.size
            functions = _functions(reduction, values, spectrum, omega[:, None], speed, wanted)
            yield _weighted(functions, omega, weights, 2 * weights if some.start == 0 else None, inverses)


def with_poles_moved(nodes: Sequence[GradientNodes], above: Above) -> Iterator[GradientNodes]:
    """Nodes of `nodes_around` a vehicle's poles, with inverses of those poles moved."""
    moved, rest = above.moved(), iter(nodes)
    for circle in above.circles:
        offset = circle.offsets()
        for own in (offset[: offset.size // 2], offset[offset.size // 2 :]):
            yield replace(next(rest), inverses=_inverses(moved, circle, own))


def _inverses(above: Above, circle: Circle, offset: Complex) -> tuple[dict[int, Complex], dict[int, Complex]]:
    """K^-1 by block at s and at -s, which is the conjugate of that at -s*."""
    mirrored = inverses_at(above.local, -np.conj(circle.centre), -np.conj(offset))
    return (
        inverses_at(above.local, circle.centre, offset),
        {block: np.conj(inverse) for block, inverse in mirrored.items()},
    )


def _weighted(
    functions: Mapping[str, Complex],
    omega: Complex,
    weights: Complex,
    gauss: Complex | None,
    inverses: tuple[dict[int, Complex], dict[int, Complex]] | None = None,
) -> GradientNodes:
    """Nodes beside the axis; gauss: weights of the embedded rule, None if it has none of them."""
    kronrod = {name: _parts(function * weights[:, None]) for name, function in functions.items()}
    embedded = None
    if gauss is not None:
        embedded = {name: _parts(function * gauss[:, None]) for name, function in functions.items()}
    sizes = {name: sizes_of(weight) for name, weight in kronrod.items()}
    return GradientNodes(omega, kronrod, embedded, sizes, inverses or ({}, {}))


def _to_the_left(end: float, poles: Complex, lag: float) -> Iterator[tuple[NDArray, NDArray, NDArray]]:
    """Rules from i end to the left, to beyond all poles, then to infinity: nodes omega = s/i, weights, the Gauss rule's
    weights; the embedded rule's nodes come first."""
    last = OUTSIDE * max(float(np.max(np.abs(poles))), end)
    first = min(end, 4.0 / lag if lag > 0 else np.inf)
    steps = np.append(0.0, first * np.exp2(np.arange(int(np.ceil(np.log2(last / first))) + 1)))
    # along x the poles lie abreast of -Re p, at the distance of Im p from the line
    abreast = (end - np.abs(poles.imag)) - 1j * poles.real
    near = quadrature(panel_edges(steps, abreast, 0.0, REFINEMENT))
    yield end + 1j * near.omega, 1j * near.weights, 1j * near.gauss_weights
    rest = quadrature(np.array([0.0, 0.5, 1.0]) / steps[-1])  # u = 1/x
    square, gauss = np.square(rest.omega), rest.gauss_weights.size
    yield end + 1j / rest.omega, 1j * rest.weights / square, 1j * rest.gauss_weights / square[:gauss]


def _functions(
    reduction: Reduction,
    values: Values,
    spectrum: RationalSpectrum,
    omega: Complex,
    speed: Array,
    wanted: tuple[str, ...],
) -> dict[str, Complex]:
    """Lag functions as sums of e^{s d}, d >= 0, times the track's density, and their slopes: [lags, n, speeds].

    omega = s/i: [n, 1] rad/s.
    """
    forms, factors = lag_sums(reduction)
    d = [float(x) for x in reduction.lengths.evaluate(forms, values)]
    odd = np.array([lag.part == "im" for lag in reduction.lags])
    lengths = moves(reduction, wanted)
    places = {name: 1 + reduction.lengths.varying.index(name) for name in lengths}
    density = angular_psd(spectrum, omega, speed)
    by_speed = angular_psd_slope(spectrum, omega, speed) if SPEED in wanted else None
    names = (POWERS, *lengths, *((SPEED,) if by_speed is not None else ()))
    result = {name: np.zeros((len(factors), *density.shape), complex) for name in names}
    delay = 1j * omega / speed
    for k, distance in enumerate(d):
        if not np.any(factors[:, k]):
            continue
        sign = -1.0 if distance < 0 else 1.0  # of two wheels that have changed places sines turn
        wave = np.exp(delay * abs(distance))
        terms = {POWERS: wave * density}
        for name, place in places.items():
            if forms[k, place]:
                terms[name] = sign * forms[k, place] * delay * terms[POWERS]
        if by_speed is not None:
            terms[SPEED] = wave * (by_speed - density * delay * (abs(distance) / speed))
        for lag in np.flatnonzero(factors[:, k]):
            factor = factors[lag, k] * (sign if odd[lag] else 1.0)
            for name, term in terms.items():
                result[name][lag] += factor * term
    return result


def _parts(weights: Complex) -> Array:
    """Weights of the real parts of powers, then of the imaginary ones, for Re(P W): [lags, 2 n, speeds]."""
    return np.concatenate([weights.real, -weights.imag], axis=1)
