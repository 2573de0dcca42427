"""Mean squares over the whole frequency axis in closed form, for a rational track spectrum.

With X and Y two of a response's chains, J_XY(d) = integral over all omega of X(i w) Y(-i w) G(w) e^{i w d}
for a lag d >= 0 closes in the left half plane:

    J_XY(d) = 2 pi sum over the poles p of X and of G of Res[X(s) Y(-s) G(s) e^{s d}].

The poles of a vehicle do not depend on the speed, those of the spectrum, -v Omega_r and -v Omega_c, give
e^{-Omega D} with the wheels' distance D: one eigenproblem a vehicle serves every speed, and no frequency
grid and no truncation enter. Each lag column of `freqrail.reduction.chain_columns` is a sum of cosines or sines of the
lags, hence of J's.

Where two poles of a chain merge (critical damping) or a vehicle's pole meets one of the spectrum's, the
residues of the two grow without bound and cancel, though their sum is smooth. There the value is
interpolated from vehicles with slightly more and less damping.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.inputs import cos_sin
from freqrail.model.responses import CHAINS, RESPONSES, Response, chains_of
from freqrail.model.spectrum import RationalSpectrum, Spectrum
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.chain_columns import column_signs
from freqrail.reduction.chains import descend
from freqrail.solver.closed_form import EPSILON, LIGHT, LOSS, MEETING, MERGING, SAFETY, SPREAD, SUPPORT, spread
from freqrail.solver.partial_fractions import Expansion, expand
from freqrail.solver.quadrature import MeanSquare
from freqrail.types import Number

# Lags of the columns: 0, 2 L_t, 2 L_c, 2 (L_c + L_t), 2 (L_c - L_t), over v. With a = omega L_t/v, b = omega L_c/v:
# cos^2 a cos^2 b = (1 + cos 2a)(1 + cos 2b)/4 and so on. Rows: `lag_columns`, as sums of cosines (columns 0,
# 1, 3, 6) or of sines (2, 4, 5) of these lags.
LAG_SUMS = np.array(
    [
        [1 / 4, 1 / 4, 1 / 4, 1 / 8, 1 / 8],
        [1 / 4, 1 / 4, -1 / 4, -1 / 8, -1 / 8],
        [0, 0, 1 / 2, 1 / 4, 1 / 4],
        [1 / 2, -1 / 2, 0, 0, 0],
        [0, 1 / 2, 0, 1 / 4, -1 / 4],
        [0, 1 / 2, 0, -1 / 4, 1 / 4],
        [0, 0, 0, -1 / 4, 1 / 4],
    ]
)

# What each column multiplies, as products X(s) Y(-s): cos-type X Y* real parts, sin-type imaginary parts, by
# integral Re(XY*) cos = (J_XY + J_YX)/2 and integral Im(XY*) sin = (J_YX - J_XY)/2.
B, P, Q = CHAINS
PRODUCTS: tuple[tuple[tuple[str, str, float], ...], ...] = (
    ((B, B, 1.0),),
    ((P, P, 1.0),),
    ((B, P, -0.5), (P, B, 0.5)),
    ((Q, Q, 1.0),),
    ((B, Q, -0.5), (Q, B, 0.5)),
    ((P, Q, -0.5), (Q, P, 0.5)),
    ((P, Q, 0.5), (Q, P, 0.5), (B, Q, -0.5), (Q, B, -0.5)),
)


def whole_axis_mean_squares(
    vehicle: Vehicle, names: tuple[str, ...], spectrum: Spectrum, speed: NDArray[np.float64]
) -> dict[str, MeanSquare]:
    """Mean squares over the whole axis of the named responses, for a grid of vehicles and every speed.

    vehicle: fields that broadcast to [grid...]; speed: [m] in m/s. Returns {name: MeanSquare}, each
    [positions, grid..., speeds]. The error estimate counts what the terms lose when they cancel. Every pole of the
    chains that take part must be damped. Raises TypeError for a spectrum that is not rational.
    """
    if not isinstance(spectrum, RationalSpectrum):
        raise TypeError(f"the closed form is for rational spectra (got {type(spectrum).__name__})")
    if vehicle.shape == ():
        single = whole_axis_mean_squares(vehicle.map(lambda field: np.reshape(field, 1)), names, spectrum, speed)
        return {name: MeanSquare(square.value[:, 0], square.error[:, 0]) for name, square in single.items()}
    with np.errstate(all="ignore"):  # an undamped or overflowing vehicle gives inf or nan, which the caller judges
        parts = [(weight, _mean_squares(vehicle, names, each, speed)) for weight, each in spread(spectrum)]
    return {
        name: MeanSquare(
            np.sum([weight * part[name].value for weight, part in parts], axis=0),
            np.sum([abs(weight) * part[name].error for weight, part in parts], axis=0),
        )
        for name in names
    }


def _mean_squares(
    vehicle: Vehicle, names: tuple[str, ...], spectrum: RationalSpectrum, speed: NDArray[np.float64]
) -> dict[str, MeanSquare]:
    squares, singular = _sum_of_residues(vehicle, names, spectrum, speed)
    merging = np.all(singular, axis=-1, keepdims=True)
    places = np.argwhere(merging[..., 0])
    if places.size:
        _interpolate(vehicle, names, spectrum, speed, squares, tuple(places.T))
    places = np.argwhere(singular & ~merging)
    if places.size:
        _interpolate(vehicle, names, spectrum, speed[places[:, -1], None, None], squares, tuple(places.T))
    return squares


def _interpolate(
    vehicle: Vehicle,
    names: tuple[str, ...],
    spectrum: RationalSpectrum,
    speed: NDArray[np.float64],
    squares: dict[str, MeanSquare],
    places: tuple[NDArray[np.intp], ...],
) -> None:
    """Replace `squares` at grid indices `places` by values interpolated from vehicles around them.

    Their dampers' constants are scaled by factors around 1. places: one index array [r] an axis of the grid, and for
    single speeds one more; speed: [m], all of them, or [r, 1, 1], that of each place.
    """
    offsets = SPREAD * np.cos(np.pi * (np.arange(SUPPORT) + 0.5) / SUPPORT)
    weight = np.array([np.prod([z / (z - x) for z in offsets if z != x]) for x in offsets])
    near = _gather(vehicle, places[: len(vehicle.shape)])
    near = replace(
        near,
        primary_damping=near.primary_damping * (1 + offsets),
        secondary_damping=near.secondary_damping * (1 + offsets),
    )
    around, _ = _sum_of_residues(near, names, spectrum, speed)
    for name, square in around.items():
        for target, values, w in (
            (squares[name].value, square.value, weight),
            (squares[name].error, square.error, np.abs(weight)),
        ):
            found = np.einsum("prks,k->prs", values, w)
            everywhere: tuple[Any, ...] = (slice(None), *places)
            target[everywhere] = found if len(places) == len(vehicle.shape) else found[..., 0]


def _gather(vehicle: Vehicle, places: tuple[NDArray[np.intp], ...]) -> Vehicle:
    """The vehicles at grid indices, an array [r] an axis; fields [r, 1]."""
    shape = vehicle.shape
    return vehicle.map(lambda field: np.broadcast_to(field, shape)[places].reshape(-1, 1))


def _sum_of_residues(
    vehicle: Vehicle, names: tuple[str, ...], spectrum: RationalSpectrum, speed: NDArray[np.float64]
) -> tuple[dict[str, MeanSquare], NDArray[np.bool_]]:
    """The plain formula, and where [grid..., speeds] merging or meeting poles spoil it.

    speed: [speeds], or [grid..., speeds] with axes of length 1 where it is common to the vehicles.
    """
    chains = {chain: expand(vehicle, chain) for chain in chains_of(names)}
    distances = _lag_distances(vehicle)
    columns = {name: _columns(RESPONSES[name]) for name in names}
    terms: dict[tuple[str, int], list[tuple[NDArray, NDArray]]] = {(k, c): [] for k in names for c in columns[k]}
    residue_errors = _residue_errors(vehicle, chains, {RESPONSES[name].element for name in names})
    for x in chains:
        rows = [(name, c) for name, c in terms if any(x == first for first, _, _ in PRODUCTS[c])]
        found = _chain_terms(vehicle, chains, residue_errors, x, rows, distances, spectrum, speed)
        for row, term in zip(rows, found, strict=True):
            terms[row].append(term)
    for track in _track_poles(vehicle, tuple(chains), distances, spectrum, speed):
        for (name, c), parts in terms.items():
            extra = track.term(RESPONSES[name], c)
            parts.append((extra, LOSS * np.abs(extra)))
    shape = (*vehicle.shape, speed.shape[-1])
    result = {}
    for name in names:
        series = RESPONSES[name]
        value, error = np.zeros((2, len(series.signs), *shape))
        scale = np.pi / np.square(np.asarray(getattr(vehicle, series.arm) if series.arm else 1.0))[..., None]
        for c in columns[name]:
            total = scale * sum(term for term, _ in terms[name, c])
            uncertain = scale * sum(error for _, error in terms[name, c])
            for place, position in enumerate(series.signs):
                sign = column_signs(position)[c]
                value[place] += sign * total
                error[place] += abs(sign) * uncertain
        result[name] = MeanSquare(value, error)
    return result, np.broadcast_to(_singular(chains, spectrum, speed), shape)


def _columns(series: Response) -> list[int]:
    """The lag columns that a series' chains take part in."""
    return [c for c, terms in enumerate(PRODUCTS) if all({x, y} <= set(series.chains) for x, y, _ in terms)]


def _residue_errors(
    vehicle: Vehicle, chains: dict[str, Expansion], quantities: set[str]
) -> dict[tuple[str, str], NDArray[np.float64]]:
    """Possible errors of the residues of (chain, element) at its upper poles, [grid..., k].

    The partial fractions are held against the chain read directly where the way down adds positive terms only, at -p of
    a well damped pole, at |p| of a light one, whose -p lies beside other poles: a wrong residue r of p shows in them as
    r/(2 p). But a light pole's peak hangs on its residue alone, however small it is among others': there what rounding
    may have left is counted (`Modal.rounding`), and of the check what that cannot explain.
    """
    result = {}
    for name, chain in chains.items():
        p = chain.take(chain.poles)
        damped = np.abs(p.real) > LIGHT * np.abs(p)
        s = np.where(damped, -p, np.abs(p))
        near = 1.0 / (s[..., :, None] - chain.poles[..., None, :])
        direct = _directly(vehicle, name, s)
        for quantity in quantities & chain.residues.keys():
            terms = near * chain.residues[quantity][..., None, :]
            rounding = chain.rounding[quantity]
            missing = np.abs(np.sum(terms, axis=-1) - direct[quantity])
            known = np.sum(np.abs(terms) * (rounding[..., None, :] + 4 * EPSILON), axis=-1)
            missing = np.where(
                damped, missing, np.maximum(0.0, missing - known - LOSS / SAFETY * np.abs(direct[quantity]))
            )
            own = np.where(damped, 0.0, np.abs(chain.take(chain.residues[quantity])) * chain.take(rounding))
            result[name, quantity] = SAFETY * 2 * np.abs(p) * missing + own
    return result


def _chain_terms(
    vehicle: Vehicle,
    chains: dict[str, Expansion],
    residue_errors: dict[tuple[str, str], NDArray[np.float64]],
    x: str,
    rows: list[tuple[str, int]],
    distances: NDArray,
    spectrum: RationalSpectrum,
    speed: NDArray[np.float64],
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """What the poles of chain x add to each row (series, column): (value, error), [grid..., speeds] each.

    One matrix product a vehicle: coefficients [rows, parts of poles and lags] times waves [.., speeds].

    Y(-p) is read off the chain directly where the pole p is well damped: there the way down adds positive terms
    only. Of a lightly damped pole it comes from partial fractions, which near the mirror image of another pole see
    the true distance and no difference of large numbers, but are as wrong as the residues in them (`residue_errors`).
    """
    chain = chains[x]
    p = chain.take(chain.poles)
    near = {y: -1.0 / (p[..., :, None] + other.poles[..., None, :]) for y, other in chains.items()}
    direct = {y: _directly(vehicle, y, -p) for y in chains}
    damped = np.abs(p.real) > LIGHT * np.abs(p)
    mirrors = {y: _mirror_weights(p, other) for y, other in chains.items()}
    heads, uncertainties = {}, {}
    for name in dict.fromkeys(name for name, _ in rows):
        series = RESPONSES[name]
        quantity, scale = series.element, chain.weight * p ** (2 * series.derivative)
        fractions = {y: np.sum(near[y] * chains[y].residues[quantity][..., None, :], axis=-1) for y in series.chains}
        residue = chain.take(chain.residues[quantity])
        for y in series.chains:
            mirrored = np.where(damped, direct[y][quantity], fractions[y])
            heads[name, y] = scale * residue * mirrored
            wrong = np.where(damped, 0.0, np.sum(mirrors[y] * residue_errors[y, quantity][..., None, :], axis=-1))
            uncertainties[name, y] = np.abs(scale) * (
                np.abs(mirrored) * residue_errors[x, quantity] + np.abs(residue) * wrong
            )
    coefficients = [sum(f * heads[name, y] for a, y, f in PRODUCTS[c] if a == x) for name, c in rows]
    weight = np.stack(np.broadcast_arrays(*coefficients), axis=-2)
    losses = {name: _loss(chains, RESPONSES[name].chains) for name in dict.fromkeys(name for name, _ in rows)}
    loss = np.stack(np.broadcast_arrays(*(losses[name] for name, _ in rows)), axis=-2)
    from_residues = [sum(abs(f) * uncertainties[name, y] for a, y, f in PRODUCTS[c] if a == x) for name, c in rows]
    uncertain = loss * np.abs(weight) + np.stack(np.broadcast_arrays(*from_residues), axis=-2)
    lags = LAG_SUMS[[c for _, c in rows]]
    # As many terms as the chain has poles, the rest zero: how many of them stand for two differs from vehicle to
    # vehicle, and BLAS picks its order of summation by the shape of the product.
    width = chain.poles.shape[-1]
    weight, uncertain = (_padded(each, width, -1) for each in (weight, uncertain))
    waves, density = _waves(p, distances, spectrum, speed, width)
    parts = np.stack([weight.real, -weight.imag], axis=-2)[..., None, :] * lags[:, None, :, None]
    value = parts.reshape(*parts.shape[:-3], -1) @ waves
    # all lagged waves of a pole are smaller than its density
    error = (uncertain * np.sum(np.abs(lags), axis=-1)[:, None]) @ density
    for row in range(len(rows)):
        yield value[..., row, :], error[..., row, :]


def _mirror_weights(p: NDArray[np.complex128], other: Expansion) -> NDArray[np.float64]:
    """What an error of a residue of another chain's upper pole (and its conjugate) makes of partial fractions at -p:
    at most this much a unit, [grid..., k, other's k]."""
    q = other.take(other.poles)[..., None, :]
    return other.weight[..., None, :] / np.hypot(p.real[..., None] + q.real, np.abs(p.imag[..., None]) - np.abs(q.imag))


def _padded(values: NDArray, width: int, axis: int) -> NDArray:
    """The values with zeros appended along an axis up to a width."""
    missing = [(0, 0)] * values.ndim
    missing[axis] = (0, width - values.shape[axis])
    return np.pad(values, missing)


def _directly(vehicle: Vehicle, chain: str, s: NDArray[np.complex128]) -> dict[str, Number]:
    """Elements of a chain per metre of track at s, [grid..., k], from the way down."""
    track, ratios, _ = descend(vehicle.column(), chain, s, s * s)
    return {name: ratio / track for name, ratio in ratios.items()}


def _loss(chains: dict[str, Expansion], names: tuple[str, ...]) -> NDArray[np.float64]:
    """Relative error that rounding leaves in the residues of the named chains, [grid..., 1].

    A peak's height goes with the distance of a pole from another's mirror image. For the wheelsets' modes, which
    differ little from chain to chain, that is about twice the real part, while the imaginary parts are only known
    to a rounding error.
    """
    sharpness: Any = 0.0
    for chain in map(chains.__getitem__, names):
        p = chain.take(chain.poles)
        with np.errstate(divide="ignore"):
            sharp = np.where(chain.weight > 0, np.abs(p) / np.abs(2 * p.real), 0.0)
        sharpness = np.maximum(sharpness, sharp.max(axis=-1))
    return (LOSS + 8 * EPSILON * sharpness)[..., None]


def _lag_distances(vehicle: Vehicle) -> NDArray[np.float64]:
    """Distances between wheels that the columns' lags come from, m: [grid..., 5], see `LAG_SUMS`."""
    a, b = 2 * np.asarray(vehicle.half_wheelbase), 2 * np.asarray(vehicle.half_bogie_spacing)
    return np.stack(np.broadcast_arrays(0 * a, a, b, b + a, b - a), axis=-1)


def _waves(
    p: NDArray[np.complex128],
    distances: NDArray,
    spectrum: RationalSpectrum,
    speed: NDArray[np.float64],
    width: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """G(s) e^{s d} at poles p [grid..., k] for the lags d at every speed, and |G|, [grid..., width, speeds].

    The waves are [grid..., 2 x 5 x width, speeds]: real and imaginary parts of each lag of each pole, then zeros.
    """
    v = speed[..., None, :]
    low, high = (np.square(v * cutoff) for cutoff in spectrum.cutoffs)
    s2 = np.square(p)[..., None]
    # S_v(omega/v)/v with omega^2 = -s^2 (eq. 11)
    density = spectrum.roughness * spectrum.cutoffs[1] ** 2 * v**3 / ((low - s2) * (high - s2))
    wheelbase, inner = (_exponential(p, distances[..., lag, None, None] / v) for lag in (1, 4))
    first, rear = wheelbase * density, inner * wheelbase * density
    lagged = (density, first, rear, wheelbase * rear, inner * density)
    shape = np.broadcast_shapes(*(wave.shape for wave in lagged))
    waves = np.zeros((*shape[:-2], 2, 5, width, shape[-1]))
    for lag, wave in enumerate(lagged):
        waves[..., 0, lag, : shape[-2], :], waves[..., 1, lag, : shape[-2], :] = wave.real, wave.imag
    return waves.reshape(*shape[:-2], -1, shape[-1]), _padded(np.abs(density), width, -2)


def _exponential(p: NDArray[np.complex128], delay: NDArray[np.float64]) -> NDArray[np.complex128]:
    """e^{p t} at poles p [grid..., k] for delays t [grid..., 1, speeds]."""
    size = np.exp(p.real[..., None] * delay)
    cosine, sine = cos_sin(p.imag[..., None] * delay)
    result = np.empty(size.shape, complex)
    result.real, result.imag = size * cosine, size * sine
    return result


@dataclass(frozen=True)
class _TrackPole:
    """A pole q = -v Omega of the spectrum, where the vehicle's chains are read off directly.

    q: [speeds] rad/s. weight: residue of G times e^{q d} = e^{-Omega D} summed over each column's lags, [grid..., 7];
    the speed cancels in both. elements: {(chain, sign): {element: X(sign q) [grid..., speeds]}}.
    """

    q: NDArray[np.float64]
    weight: NDArray[np.float64]
    elements: dict[tuple[str, int], dict[str, Number]]

    def term(self, series: Response, column: int) -> NDArray[np.float64]:
        """What the pole adds to a column of a series, [grid..., speeds]."""
        name, power = series.element, self.q ** (2 * series.derivative)
        products = sum(f * self.elements[x, 1][name] * self.elements[y, -1][name] for x, y, f in PRODUCTS[column])
        return np.asarray(self.weight[..., column, None] * power * products)


def _track_poles(
    vehicle: Vehicle,
    chains: tuple[str, ...],
    distances: NDArray,
    spectrum: RationalSpectrum,
    speed: NDArray[np.float64],
) -> Iterator[_TrackPole]:
    low, high = spectrum.cutoffs
    scale = spectrum.roughness * high**2 / (high**2 - low**2) / 2
    for cutoff, residue in ((low, scale / low), (high, -scale / high)):
        q = -cutoff * speed
        elements = {}
        for chain in chains:
            for sign in (1, -1):
                track, ratios, _ = descend(vehicle.column(), chain, sign * q, q * q)
                elements[chain, sign] = {name: ratio / track for name, ratio in ratios.items()}
        # a sum, not a matrix product, whose bits would depend on the number of vehicles
        weight = np.sum(residue * np.exp(-cutoff * distances)[..., None, :] * LAG_SUMS, axis=-1)
        yield _TrackPole(q, weight, elements)


def _singular(
    chains: dict[str, Expansion], spectrum: RationalSpectrum, speed: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Where the plain formula loses its digits: [grid..., speeds]."""
    result: Any = np.zeros(speed.shape[-1], dtype=bool)
    for chain in chains.values():
        p = np.where(np.any([r != 0 for r in chain.residues.values()], axis=0), chain.poles, np.nan)
        gaps = np.abs(p[..., :, None] - p[..., None, :])
        gaps = np.where(np.eye(p.shape[-1], dtype=bool), np.nan, gaps)
        merging = np.any(gaps < MERGING * np.abs(p[..., None]), axis=(-2, -1))
        result = result | merging[..., None]
        # the spectrum's poles are real: only vehicle's poles next to the real axis can meet them
        meeting = np.abs(p.imag) < MEETING * np.abs(p)
        for k in np.flatnonzero(np.any(meeting, axis=tuple(range(p.ndim - 1)))):
            real = np.where(meeting[..., k], p[..., k].real, np.nan)[..., None]
            for cutoff in spectrum.cutoffs:
                result = result | (np.abs(real + cutoff * speed) < MEETING * np.abs(real))
    return result
