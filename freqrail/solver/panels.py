"""Where to evaluate a grid: which speeds to take together, and quadrature nodes that many vehicles can share.

The grid's vehicles share one set of nodes where that is cheap, because then the speed axis of every block is one
matrix product. All of it depends on the grid alone, never on how that is cut into blocks or on the number of workers.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.spectrum import RationalSpectrum, kinks, singular_points
from freqrail.solver import quadrature
from freqrail.solver.detours import Detour, detours, is_sharp, panels_kept
from freqrail.solver.problem import Problem
from freqrail.solver.resonances import Resonances, every_pole, resonances
from freqrail.solver.rounding import BEYOND, longest_lags, rounding_errors

SHARED_NODES = 6000  # more nodes than this are not worth sharing, unless the lags call for as many anyway
SHARED_WEIGHTS = 3_000_000  # nodes x speeds whose weights are held at once: 250 MB
SAMPLES = 300  # vehicles whose poles place the shared nodes: all of a small grid, an even spread of a large one
GROUP_NODES, GROUP_SPEEDS = 2000, 500  # up to so many nodes, speeds of any range are taken together, and so many
LARGEST_RULE = 10_000_000  # nodes x speeds that a vehicle's own quadrature may take: about a second
OWN_REFINEMENT = 1.25  # a vehicle's own panels are shorter than shared ones by this


@dataclass(frozen=True)
class SharedPanels:
    """Panel edges [n + 1] in rad/s that serve every vehicle of a grid, None if each needs its own.

    speeds: [m], which of the grid's speeds they are for. rounding_errors: `quadrature.rounding` of each response,
    {name: [m]}. detours: ways around sharp peaks, where the edges do not count. They depend on the whole grid: a part
    of it takes those of the whole, and so gets the same bits.
    """

    speeds: NDArray[np.intp]
    edges: NDArray[np.float64] | None
    rounding_errors: Mapping[str, NDArray[np.float64]]
    detours: tuple[Detour, ...] = ()


def in_closed_form(study: Problem) -> bool:
    """Whether a study needs no nodes: the whole axis, spectrum and laws rational."""
    return study.band is None and isinstance(study.spectrum, RationalSpectrum) and study.reduction.system.rational


def shared_panels(study: Problem) -> tuple[SharedPanels, ...]:
    """Nodes for the whole grid, group by group of its speeds; none where the closed form needs none."""
    if in_closed_form(study):
        return ()
    sample = study.cut(_sample(study.vehicles))
    found = resonances(sample.reduction, sample.values, sample.vehicles, sample=True)
    all_known = math.prod(sample.vehicles) == math.prod(study.vehicles)
    groups = speed_groups(sample, every_pole(found))
    return tuple(_shared(sample, group, found, all_known) for group in groups)


def _shared(study: Problem, speeds: NDArray[np.intp], found: Mapping[int, Resonances], all_known: bool) -> SharedPanels:
    """Nodes for some of the speeds. all_known: the resonances are those of every vehicle of the grid."""
    resonances = every_pole(found)
    study = replace(study, speed=study.speed[speeds])
    if np.isinf(study.limits).any():
        return SharedPanels(speeds, None, {})  # the bound of what lies beyond is each vehicle's own
    first, lag = first_edges(study, resonances), _longest_lag(study)
    inside = (np.abs(resonances.imag) > first[0]) & (np.abs(resonances.imag) < first[-1])
    if np.any(inside & ~np.concatenate([each.known for each in found.values()])):
        return SharedPanels(speeds, None, {})
    around = _detours(study, resonances, lag)
    if around is None:
        if not all_known and np.any(inside & is_sharp(resonances)):
            # between the vehicles sampled, such a peak could pass through the nodes
            return SharedPanels(speeds, None, {})
        around = ()
    first = np.union1d(first, [end for each in around for end in (each.low, each.high)])
    outside_too = {index: replace(each, known=np.full(each.poles.shape, True)) for index, each in found.items()}
    rounding = rounding_errors(study, outside_too, around)
    most = min(max(SHARED_NODES, 3 * _fewest_nodes(study, resonances)), SHARED_WEIGHTS / speeds.size)
    if quadrature.fewest_nodes(first, lag) > most:
        return SharedPanels(speeds, None, rounding)
    everything = np.concatenate([resonances, singular_points(study.spectrum, study.speed)])
    edges = quadrature.panel_edges(first, everything, lag)
    shared = panels_kept(edges, around) * quadrature.PANEL_NODES <= most
    return SharedPanels(speeds, edges if shared else None, rounding, around)


def _detours(study: Problem, resonances: NDArray[np.complex128], lag: float) -> tuple[Detour, ...] | None:
    """Ways around the sharp peaks of a grid; none where there are none, None where there is no way."""
    if not isinstance(study.spectrum, RationalSpectrum) or not study.reduction.system.rational:
        return None
    return detours(resonances, study.limits, lag)


def speed_groups(study: Problem, resonances: NDArray[np.complex128]) -> list[NDArray[np.intp]]:
    """Indices of the speeds to take together, the fastest first.

    The slower the train, the longer the lags and the more nodes they need; and where the band is one of wavelengths,
    every speed's own edges end panels. A group grows until it needs GROUP_NODES and twice what its fastest needs alone.
    """
    order = np.argsort(-study.speed, kind="stable")

    def needed(count: int) -> float:
        return _fewest_nodes(replace(study, speed=study.speed[order[:count]]), resonances)

    groups = []
    while order.size:
        room = max(GROUP_NODES, 2 * needed(1))
        count = bisect.bisect_right(range(1, min(order.size, GROUP_SPEEDS) + 1), room, key=needed)
        groups.append(np.sort(order[:count]))
        order = order[count:]
    return groups


def own_edges(study: Problem, resonances: NDArray[np.complex128]) -> NDArray[np.float64] | None:
    """Panel edges, rad/s, for one vehicle and all speeds, closer than shared ones; None if too many.

    resonances: the vehicle's poles, rad/s.
    """
    if not np.isfinite(resonances).all():
        return None
    first, lag = first_edges(study, resonances), _longest_lag(study)
    if 2 * quadrature.fewest_nodes(first, lag) * study.speed.size > LARGEST_RULE:
        return None
    everything = np.concatenate([resonances, singular_points(study.spectrum, study.speed)])
    return quadrature.panel_edges(first, everything, lag, OWN_REFINEMENT)


def first_edges(study: Problem, resonances: NDArray[np.complex128]) -> NDArray[np.float64]:
    """The edges a panel must not straddle: every speed's own band, or 0 and the end of the nodes, and all kinks."""
    limits = study.limits
    ends = np.where(np.isinf(limits), BEYOND * np.max(np.abs(resonances.imag), initial=1.0), limits)
    points = kinks(study.spectrum, study.speed)
    knots = np.array([knot for law in study.reduction.system.laws for knot in law.knots])
    knots = knots[(knots > np.min(ends)) & (knots < np.max(ends))]
    return np.unique(np.concatenate([ends.ravel(), points[(points > limits[0]) & (points < limits[1])], knots]))


def _fewest_nodes(study: Problem, resonances: NDArray[np.complex128]) -> float:
    """Nodes that the lags and the edges alone call for, whatever the resonances."""
    first = first_edges(study, resonances)
    return quadrature.fewest_nodes(first, _longest_lag(study)) + quadrature.PANEL_NODES * (first.size - 1)


def _longest_lag(study: Problem) -> float:
    """The last wheel's lag behind the first at the lowest speed, s (eq. 2), the largest of all vehicles'."""
    return float(np.max(longest_lags(study)))


def _sample(shape: tuple[int, ...]) -> tuple[NDArray[np.intp], ...]:
    """At most about SAMPLES vehicles of a grid, evenly over every axis, its two ends among them."""
    varying = sum(n > 1 for n in shape)
    limit = max(2, int(SAMPLES ** (1 / varying))) if varying else 1
    return tuple(np.unique(np.linspace(0, n - 1, min(n, limit)).round().astype(int)) for n in shape)
