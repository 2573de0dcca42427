"""Mean squares of the responses over a frequency band, by quadrature that follows the resonances.

sigma^2 = integral of |T|^2 G d omega over the band, with |T|^2 a sum of seven lag columns
(`freqrail.response`): the powers of a vehicle serve every speed, and the whole speed axis is a
matrix product over the quadrature nodes.

The nodes are Gauss-Kronrod panels whose lengths follow the poles of the vehicles at hand and the
fastest wheel lag, so that no peak is stepped over, however narrow; the embedded Gauss rule gives
every value an error estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.response import (
    LAG_COLUMNS,
    SERIES,
    chain_responses,
    column_powers,
    column_signs,
    lag_columns,
    top_products,
)
from freqrail.track import Spectrum, angular_psd
from freqrail.vehicle import Vehicle

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

# A panel is kept if its length is at most POLE_REACH times its distance from the nearest pole, and the
# fastest lag turns by at most PHASE_REACH radians over it. With a pole abreast of the panel's middle the
# Bernstein ellipse has rho = 2/3 + sqrt(4/9 + 1) = 1.87: the Gauss rule misses by rho^-20 = 4e-6 of that
# panel's share, the Kronrod rule by rho^-32 = 2e-9. docs/theory.md shows the errors measured.
POLE_REACH = 3.0
PHASE_REACH = 14.0
NARROWEST = 1e-13  # panels are not halved below this fraction of their frequency: rounding begins there

TILE = 16  # rows of every matrix product

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
    """Mean squares of one response and their error estimates, [positions, grid..., speeds], SI squared."""

    value: NDArray[np.float64]
    error: NDArray[np.float64]


def panel_edges(
    edges: NDArray[np.float64], poles: NDArray[np.complex128], longest_lag: float, refine: float = 1.0
) -> NDArray[np.float64]:
    """Edges of panels that resolve the poles and the lags, from the few edges given, all in rad/s.

    edges: increasing, at least two; panels never straddle one. poles: any shape, rad/s, those of the
    vehicles and of the track spectrum. longest_lag: of the wheels, s. Panels are halved until each is
    short against its distance from every pole and against the lag's period; `refine` > 1 makes
    them shorter by that factor.
    """
    centre, width = np.abs(np.imag(poles)).ravel(), np.abs(np.real(poles)).ravel()
    done = []
    low, high = np.asarray(edges[:-1], dtype=float), np.asarray(edges[1:], dtype=float)
    while low.size:
        length = high - low
        beside = np.maximum(0.0, np.maximum(low[:, None] - centre, centre - high[:, None]))
        nearest = np.min(np.hypot(beside, width), axis=1, initial=np.inf)
        split = (refine * length > POLE_REACH * nearest) | (refine * length * longest_lag > PHASE_REACH)
        split &= length > NARROWEST * high
        done.append(low[~split])
        middle = (low[split] + high[split]) / 2
        low, high = np.concatenate([low[split], middle]), np.concatenate([middle, high[split]])
    return np.append(np.sort(np.concatenate(done)), edges[-1])


PANEL_NODES = 21


def fewest_nodes(edges: NDArray[np.float64], longest_lag: float) -> float:
    """Nodes that the lags alone call for between edges in rad/s, whatever the poles; longest_lag in s."""
    return PANEL_NODES * float(edges[-1] - edges[0]) * longest_lag / PHASE_REACH


def quadrature(edges: NDArray[np.float64]) -> Quadrature:
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
class LagWeights:
    """Lag columns times the track's density and the quadrature weights: [7, n, speeds] and [7, g, speeds]."""

    kronrod: NDArray[np.float64]
    gauss: NDArray[np.float64]


def lag_weights(
    vehicle: Vehicle,
    spectrum: Spectrum,
    rule: Quadrature,
    speed: NDArray[np.float64],
    limits: NDArray[np.float64],
) -> LagWeights:
    """Weights that turn column powers into mean squares, for every speed at once.

    vehicle: a single geometry. speed: [m] in m/s. limits: [2, m], each speed's band in rad/s, on
    panel edges; outside it the weights are zero.
    """
    omega = rule.omega[:, None]
    density = angular_psd(spectrum, omega, speed) * ((omega > limits[0]) & (omega < limits[1]))
    columns = lag_columns(vehicle, rule.omega, speed) * density
    gauss = columns[:, : rule.gauss_weights.size] * rule.gauss_weights[:, None]
    return LagWeights(columns * rule.weights[:, None], gauss)


def mean_squares(
    vehicle: Vehicle,
    names: tuple[str, ...],
    omega: NDArray[np.float64],
    weights: LagWeights,
    lost: NDArray[np.float64] | float = ROUNDING,
) -> dict[str, MeanSquare]:
    """Mean squares of the named responses (keys of `SERIES`) for a grid of vehicles.

    vehicle: fields that broadcast to [grid..., 1]; one geometry. omega: [n] in rad/s, of the rule that
    made `weights`. lost: see `rounding`. Returns {name: MeanSquare}, [positions, grid..., speeds].

    The error estimate is QUADPACK's: with d the difference of the two rules relative to the value,
    min(d, (200 d)^1.5). d sums the differences of the lag columns without their signs, so that
    they cannot cancel.
    """
    chains = chain_responses(vehicle, omega)
    products = top_products(chains)
    n, g = omega.size, weights.gauss.shape[1]
    product = _product if vehicle.shape else np.matmul  # a single vehicle is never part of a block
    grid = vehicle.shape[:-1]
    result = {}
    for name in names:
        series = SERIES[name]
        signs = np.array([column_signs(position) for position in series.positions])
        shape = (len(series.positions), *grid, weights.kronrod.shape[2])
        value, difference = np.zeros(shape), np.zeros(shape)
        for column, power in column_powers(series, vehicle, omega, chains, products):
            power = np.broadcast_to(power, (*grid, n)).reshape(-1, n)
            total = product(power, weights.kronrod[column])
            apart = np.abs(total - product(power[:, :g], weights.gauss[column]))
            for p, sign in enumerate(signs[:, column]):
                if sign:
                    value[p] += (sign * total).reshape(shape[1:])
                    difference[p] += apart.reshape(shape[1:])
        with np.errstate(invalid="ignore", divide="ignore"):
            d = difference / np.abs(value)
        result[name] = MeanSquare(value, np.abs(value) * (np.minimum(d, (200 * d) ** 1.5) + lost))
    return result


def _product(power: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """power [vehicles, n] @ weight [n, speeds], the bits of a row the same whatever the number of rows.

    BLAS picks its order of summation by the shape of the product, so all products of a grid have TILE rows.
    """
    rows, n = power.shape
    tiles = -(-rows // TILE)
    if rows % TILE:
        power = np.concatenate([power, np.zeros((tiles * TILE - rows, n))])
    return (power.reshape(tiles, TILE, n) @ weight).reshape(tiles * TILE, -1)[:rows]


def rounding(poles: NDArray[np.complex128], limits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative errors [m] that rounding leaves in integrals over limits [2, m] with resonances at `poles`, rad/s.

    Near a resonance the response is a difference of large numbers: rounding over the distance of the band from the
    pole, relative to its frequency (the damping ratio, if the band holds the resonance). In a narrow band the
    differences of the nodes carry the rounding of their frequencies.
    """
    frequency = np.abs(poles.imag)[:, None]
    outside = np.maximum(0.0, np.maximum(limits[0] - frequency, frequency - limits[1]))
    with np.errstate(divide="ignore", invalid="ignore"):
        sharpness = np.where(frequency > 0, np.abs(poles)[:, None] / np.hypot(outside, poles.real[:, None]), 0.0)
        narrow = np.where(np.isfinite(limits[1]), limits[1] / (limits[1] - limits[0]), 1.0)
    return ROUNDING + 4 * np.finfo(float).eps * (np.max(sharpness, axis=0, initial=0.0) + narrow)


def truncation_bound(
    vehicle: Vehicle,
    names: tuple[str, ...],
    spectrum: Spectrum,
    speed: NDArray[np.float64],
    cutoff: float,
) -> dict[str, NDArray[np.float64]]:
    """Upper bound of the mean squares beyond `cutoff` [rad/s], whatever the lags.

    Returns {name: [positions, grid..., speeds]}. From |B u_B + P u_P + Q u_Q|^2 <= 3 (|B|^2 + |P|^2 +
    |Q|^2), integrated over u = cutoff/omega, where the responses beyond the last resonance are smooth.
    """
    rule = quadrature(np.array([0.0, 1.0]))
    omega = cutoff / rule.omega
    density = angular_psd(spectrum, omega[:, None], speed) * (rule.weights * omega / rule.omega)[:, None]
    diagonal = np.array([1, 1, 0, 1, 0, 0, 0]).reshape(-1, 1, 1)
    bound = 3.0 * diagonal * density
    none = np.zeros((LAG_COLUMNS, 0, speed.size))
    return {k: m.value for k, m in mean_squares(vehicle, names, omega, LagWeights(bound, none)).items()}
