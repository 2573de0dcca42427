"""Quadrature over a frequency band that follows the resonances: panels, rule, and what rounding leaves.

The nodes are Gauss-Kronrod panels whose lengths follow the poles of the vehicles at hand and the
fastest wheel lag, so that no peak is stepped over, however narrow; the embedded Gauss rule gives
every value an error estimate.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Gauss-Kronrod pair with 10 and 21 nodes on [-1, 1] (QUADPACK, Piessens et al. 1983, routine qk21):
# Kronrod abscissae from the outside in, every second one a Gauss abscissa.
_KRONROD_X = (
    0.995657163025808080735527280689003,
    0.973906528517171720077964012084452,
    0.930157491355708226001207180059508,
    0.865063366688984510732096688423493,
    0.780817726586416897063717578345042,
    0.679409568299024406234327365114874,
    0.562757134668604683339000099272694,
    0.433395394129247190799265943165784,
    0.294392862701460198131126603103866,
    0.148874338981631210884826001129720,
    0.0,
)
_KRONROD_W = (
    0.011694638867371874278064396062192,
    0.032558162307964727478818972459390,
    0.054755896574351996031381300244580,
    0.075039674810919952767043140916190,
    0.093125454583697605535065465083366,
    0.109387158802297641899210590325805,
    0.123491976262065851077958109585166,
    0.134709217311473325928054001771707,
    0.142775938577060080797094273138717,
    0.147739104901338491374841515972068,
    0.149445554002916905664936468389821,
)
_GAUSS_W = (
    0.066671344308688137593568809893332,
    0.149451349150580593145863396957658,
    0.219086362515982043995534934228163,
    0.269266719309996355091226921569469,
    0.295524224714752870173815619188769,
)

# A panel's length is at most POLE_DISTANCE times its distance from the nearest pole, and the fastest lag turns by at
# most PANEL_PHASE radians over it. With a pole abreast of the panel's middle the Bernstein ellipse has
# rho = 5/6 + sqrt(25/36 + 1) = 2.14: the Gauss rule misses by rho^-20 = 3e-7 of that panel's share, the Kronrod
# rule by rho^-32 = 3e-11. docs/theory.md shows the errors measured.
POLE_DISTANCE = 2.4
PANEL_PHASE = 14.0
CAUTION = 40.0  # of the error estimate: QUADPACK's 200 is for integrands of any kind, these panels follow the poles
NARROWEST = 1e-13  # no panel is shorter than this fraction of its frequency: rounding begins there
TINY = 1e-150
EPSILON = np.finfo(float).eps
RUN, LONGEST_RUN = 16, 1024  # panels that the lag alone cuts are laid so many at a time

TILE, NODES, SPEEDS = 16, 160, 100  # rows of every matrix product, and its most nodes and speeds

ROUNDING = 1e-12
"""Relative floor of every error estimate: what summing a few thousand products in double precision loses."""


@dataclass(frozen=True)
class Quadrature:
    """Nodes and weights of a Gauss-Kronrod rule in rad/s, the embedded Gauss rule's nodes first.

    omega: [n] nodes. weights: [n] Kronrod weights. gauss_weights: [g], for the first g nodes.
    """

    omega: NDArray[np.float64]
    weights: NDArray[np.float64]
    gauss_weights: NDArray[np.float64]


@dataclass(frozen=True)
class MeanSquare:
    """Mean squares of one output and their error estimates, [labels, grid..., speeds], SI squared."""

    value: NDArray[np.float64]
    error: NDArray[np.float64]


def panel_edges(
    edges: NDArray[np.float64], poles: NDArray[np.complex128], longest_lag: float, refine: float = 1.0
) -> NDArray[np.float64]:
    """Edges of panels that resolve the poles and the lags, from the few edges given, all in rad/s.

    edges: increasing, at least two; panels never straddle one. poles: any shape, rad/s, those of the
    vehicles and of the track spectrum. longest_lag: of the wheels, s. From the left, each panel is as long as its
    distance from every pole and the lag's period allow; `refine` > 1 makes them shorter by that factor.
    """
    ratio = POLE_DISTANCE / refine
    by_lag = PANEL_PHASE / refine / longest_lag if longest_lag > 0 else np.inf
    done = []
    for low, high in itertools.pairwise(edges):
        done.append(float(low))
        least, run = NARROWEST * NARROWEST * high, RUN  # a pole at zero must not keep panels from leaving it
        while True:
            by_poles = float(_room(np.array(done[-1:]), poles, ratio)[0])
            step = max(min(by_poles, by_lag), NARROWEST * done[-1], least)
            if not done[-1] + step < high:
                break
            done.append(done[-1] + step)
            if step == by_lag:  # and likely so for many panels to come
                ahead = np.add.accumulate(np.append(done[-1], np.full(run, by_lag)))
                same = (_room(ahead, poles, ratio) >= by_lag) & (ahead + by_lag < high)
                count = int(np.argmin(np.append(same, False)))
                done.extend(ahead[1 : count + 1].tolist())
                run = min(2 * run, LONGEST_RUN) if count == run else RUN
    return np.append(done, edges[-1])


def _room(left: NDArray[np.float64], poles: NDArray[np.complex128], ratio: float) -> NDArray[np.float64]:
    """Longest panels that poles allow from each left edge [n], rad/s; `ratio` times the distance from the nearest."""
    centre, width = np.abs(np.imag(poles)).ravel(), np.abs(np.real(poles)).ravel()
    ahead = centre - left[:, None]
    # L = ratio x distance: from the left edge (pole behind), from the right edge (pole ahead), or from within
    room = ahead**2 - (ratio**2 - 1) * width**2
    square = np.square(ahead) + np.square(width)
    before = ratio * square / (np.abs(ratio * ahead) + np.sqrt(np.maximum(room, 0.0)) + TINY)
    within = np.where((room > 0) & (before < ahead), before, ratio * width)
    length = np.where(ahead <= 0, ratio * np.sqrt(square), within)
    return np.min(length, axis=-1, initial=np.inf)


PANEL_NODES = 21


def fewest_nodes(edges: NDArray[np.float64], longest_lag: float) -> float:
    """Nodes that the lags alone call for between edges in rad/s, whatever the poles; longest_lag in s."""
    return PANEL_NODES * float(edges[-1] - edges[0]) * longest_lag / PANEL_PHASE


def quadrature(edges: NDArray) -> Quadrature:
    """The Gauss-Kronrod rule on every panel between consecutive edges [n + 1], rad/s."""
    half_x, half_w = np.array(_KRONROD_X), np.array(_KRONROD_W)
    x = np.concatenate([-half_x, half_x[-2::-1]])
    w = np.concatenate([half_w, half_w[-2::-1]])
    gauss = np.arange(1, x.size, 2)
    order = np.concatenate([gauss, np.arange(0, x.size, 2)])
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    return Quadrature(
        omega=(middle + np.multiply.outer(x[order], half)).ravel(),
        weights=np.multiply.outer(w[order], half).ravel(),
        gauss_weights=np.multiply.outer(np.concatenate([_GAUSS_W, _GAUSS_W[::-1]]), half).ravel(),
    )


@dataclass(frozen=True)
class WeightedNodes:
    """Some nodes of a rule: omega [n] rad/s, and lag functions times the track's density and the weights.

    omega is complex on the way around a peak, see `detours`, and the weights are twice as many.
    kronrod: [lags, n, speeds]. gauss: the same for the embedded rule, None if it has none of these nodes.
    """

    omega: NDArray[np.float64]
    kronrod: NDArray[np.float64]
    gauss: NDArray[np.float64] | None
