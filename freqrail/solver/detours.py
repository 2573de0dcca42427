"""Ways around sharp peaks: through the left half plane, where all vehicles of a grid can share nodes again.

A peak of a damping ratio of 1e-4, as of wheelsets on a rigid rail, calls for nodes that follow it, vehicle by vehicle.
But the integrand of a pair of scalars, F(s) = X(s) Y(-s) G(s) e^{s d} with d >= 0 (see `solver.block_residues`), is
analytic: from i low to i high it may as well be integrated along the other three sides of a rectangle on the left, and
what the poles p of X inside add is known in closed form,

    integral of F(i omega) = integral along the sides of F ds/i + 2 pi sum of Res F(p).

On the sides F is smooth. Only for spectra and laws that are rational.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.spectrum import Spectrum, angular_psd
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_terms import distances_of
from freqrail.solver.quadrature import PANEL_PHASE, POLE_DISTANCE, Quadrature, WeightedNodes, quadrature

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

SHARP = 0.01
"""Damping ratio below which a peak is gone around, and below which shared nodes call for every vehicle's poles."""

BESIDE = 0.2  # a rectangle reaches this far beyond the frequencies of its peaks, relatively
NEAREST = 0.02  # and keeps at least this far from the band's edges, or none is drawn
WIDTHS = (
    0.2,
    0.1,
    0.4,
    0.05,
)  # of rectangles, relative to their frequencies, of which the one with fewest panels is taken
MOST_PANELS = 60  # of a rectangle's sides


@dataclass(frozen=True)
class Detour:
    """Three sides of a rectangle, from i low to i high by Re s = -width, rad/s, and panels on them.

    edges: [n + 1] complex, of panels.
    """

    low: float
    high: float
    width: float
    edges: Complex

    def holds(self, poles: Complex) -> NDArray[np.bool_]:
        """Whether poles lie in the rectangle."""
        return (poles.imag > self.low) & (poles.imag < self.high) & (poles.real > -self.width)

    def rule(self) -> Quadrature:
        """Nodes omega = s/i, complex, and their weights."""
        return quadrature(self.edges / 1j)


def is_sharp(poles: Complex) -> NDArray[np.bool_]:
    """Whether poles, rad/s, are of peaks that are gone around."""
    return np.asarray(np.abs(poles.real) < SHARP * np.abs(poles.imag))


def detours(poles: Complex, limits: Array, longest_lag: float) -> tuple[Detour, ...] | None:
    """Ways around all sharp peaks in the band, the lowest first; None if there is none around some of them.

    poles: [n] rad/s, of all vehicles. limits: [2, speeds] rad/s, of every speed's band, all of which must take in the
    same peaks. longest_lag: s.
    """
    low, high = np.max(limits[0]), np.min(limits[1])
    sharp = np.sort(np.abs(poles.imag[is_sharp(poles)]))
    outermost = (np.min(limits[0]) * (1 - NEAREST), np.max(limits[1]) * (1 + NEAREST))
    sharp = sharp[(sharp > outermost[0]) & (sharp < outermost[1])]
    groups: list[list[float]] = []
    for frequency in sharp:
        if groups and frequency * (1 - BESIDE) <= groups[-1][1]:
            groups[-1][1] = frequency * (1 + BESIDE)
        else:
            groups.append([frequency * (1 - BESIDE), frequency * (1 + BESIDE)])
    result = []
    for first, last in groups:
        ends = max(first, low), min(last, high)
        inside = sharp[(sharp > first) & (sharp < last)]
        if not (ends[0] < inside[0] * (1 - NEAREST) and ends[1] > inside[-1] * (1 + NEAREST)):
            return None
        found = _shortest(*ends, poles, longest_lag)
        if found is None:
            return None
        result.append(found)
    return tuple(result)


def _shortest(low: float, high: float, poles: Complex, longest_lag: float) -> Detour | None:
    """The rectangle between two frequencies with the fewest panels."""
    everything = np.concatenate([poles, np.conj(poles), -poles, -np.conj(poles)])
    best = None
    for relative in WIDTHS:
        width = relative * (low + high) / 2
        corners = [1j * low, 1j * low - width, 1j * high - width, 1j * high]
        edges = [np.array([corners[0]])]
        for start, end in itertools.pairwise(corners):
            side = _panels(start, end, everything, longest_lag)
            if side is None:
                break
            edges.append(side[1:])
        else:
            found = Detour(low, high, width, np.concatenate(edges))
            if best is None or found.edges.size < best.edges.size:
                best = found
    return best


def _panels(start: complex, end: complex, poles: Complex, longest_lag: float) -> Complex | None:
    """Edges of panels on a straight line, halved until each is short against its distance from poles and the lag."""
    done, todo = [start], [(start, end)]
    while todo:
        a, b = todo.pop()
        middle, length = (a + b) / 2, abs(b - a)
        # of the pole nearest to the panel: from its line, and from beyond its ends
        along = ((poles - middle) * np.conj((b - a) / length)).real
        across = ((poles - middle) * np.conj((b - a) / length)).imag
        distance = np.min(np.hypot(np.maximum(0.0, np.abs(along) - length / 2), across), initial=np.inf)
        if length > POLE_DISTANCE * distance or length * longest_lag > PANEL_PHASE:
            if len(todo) + len(done) > MOST_PANELS:
                return None
            todo += [(middle, b), (a, middle)]
        else:
            done.append(b)
    return np.array(done)


def without(rule: Quadrature, around: tuple[Detour, ...]) -> Quadrature:
    """A rule on the axis without the nodes that are gone around; panels end where detours begin and end."""
    kept = np.ones(rule.omega.shape, dtype=bool)
    for each in around:
        kept &= ~((rule.omega > each.low) & (rule.omega < each.high))
    gauss = rule.gauss_weights.size
    return Quadrature(rule.omega[kept], rule.weights[kept], rule.gauss_weights[kept[:gauss]])


def panels_kept(edges: Array, around: tuple[Detour, ...]) -> int:
    """How many panels between edges are not gone around, and those of the detours."""
    middle = (edges[1:] + edges[:-1]) / 2
    inside = [(middle > each.low) & (middle < each.high) for each in around]
    sides = sum(each.edges.size - 1 for each in around)
    return int(np.sum(~np.any(inside, axis=0)) if inside else middle.size) + 4 * sides


def weighted_detours(
    reduction: Reduction, values: Values, spectrum: Spectrum, around: tuple[Detour, ...], speed: Array
) -> Iterator[WeightedNodes]:
    """The nodes of detours, with weights as of `block_lags.weighted_nodes`, twice: of real parts, then of imaginary.

    values: of a vehicle with the wheels' places, floats. speed: [m] in m/s.
    """
    distances = distances_of(reduction, values)
    for each in around:
        rule = each.rule()
        gauss = rule.gauss_weights.size
        for part in (slice(0, gauss), slice(gauss, rule.omega.size)):
            omega = rule.omega[part, None]
            density = angular_psd(spectrum, omega, speed)
            waves = np.zeros((len(distances.factors), *density.shape), complex)
            for k, d in enumerate(distances.d):
                wave = np.exp(1j * omega * (float(d) / speed)) * density
                for lag in np.flatnonzero(distances.factors[:, k]):
                    waves[lag] += distances.factors[lag, k] * wave
            weighted = waves * rule.weights[part, None]
            embedded = _real_and_imaginary(waves * rule.gauss_weights[:, None]) if part.start == 0 else None
            yield WeightedNodes(rule.omega[part], _real_and_imaginary(weighted), embedded)


def _real_and_imaginary(waves: NDArray) -> Array:
    """Weights of the real parts of powers [lags, 2 n, speeds], then of the imaginary ones: Re(P W)."""
    return np.concatenate([waves.real, -waves.imag], axis=1)
