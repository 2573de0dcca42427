"""The lag functions of a reduction at nodes and speeds, and the weights that turn powers into mean squares."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.inputs import cos_sin
from freqrail.model.spectrum import Spectrum, angular_psd
from freqrail.reduction.columns import Reduction
from freqrail.reduction.forms import SAME
from freqrail.solver.quadrature import Quadrature, WeightedNodes

Array = NDArray[np.float64]


def centred(places: Array) -> Array:
    """Places from the middle between the first and the last wheel, m: no phase of the whole matters."""
    return np.asarray(places - (np.max(places) + np.min(places)) / 2)


def wheel_waves(places: Array, delay: Array) -> tuple[Array, Array]:
    """Real and imaginary part of e^{i omega x_w/v} for every wheel, [wheels, ...]; delay: omega/v, rad/m.

    Wheels at x and -x get the same bits but for the sign, so that what cancels between them is zero.
    """
    real, imaginary = np.empty((2, len(places), *delay.shape), dtype=delay.dtype)
    known: dict[float, tuple[Array, Array]] = {}
    for k, x in enumerate(places):
        size = _near(float(np.abs(x)), known)
        if size not in known:
            known[size] = cos_sin(size * delay)
        real[k], imaginary[k] = known[size][0], known[size][1] if x >= 0 else -known[size][1]
    return real, imaginary


def lag_functions(reduction: Reduction, places: Array, delay: Array) -> Array:
    """Every lag function of a reduction, [lags, ...], -; delay: omega/v, rad/m.

    Sums over wheels that cancel where the delays are short keep their digits (see `_steps`).
    """
    places = centred(places)
    waves, steps = wheel_waves(places, delay), None
    sums: dict[bytes, tuple[Array, Array]] = {}
    for weights in (each for lag in reduction.lags for each in (lag.one, lag.other)):
        key = weights.tobytes()
        if key in sums:
            continue
        # one by one, in the order of the wheels: a matrix product's bits would depend on the shape
        if abs(np.sum(weights)) > SAME * np.max(np.abs(weights)):
            sums[key] = _weighted(weights, waves[0]), _weighted(weights, waves[1])
        else:
            steps = steps or _steps(places, delay)
            order, real, imaginary = steps
            along = np.cumsum(weights[order])[:-1]
            along = np.where(np.abs(along) > SAME * np.max(np.abs(weights)), along, 0.0)
            sums[key] = _weighted(along, real), _weighted(along, imaginary)
    result = np.empty((len(reduction.lags), *delay.shape), dtype=waves[0].dtype)
    for k, lag in enumerate(reduction.lags):
        (a, b), (c, d) = sums[lag.one.tobytes()], sums[lag.other.tobytes()]
        result[k] = lag.factor * (a * c + b * d if lag.part == "re" else b * c - a * d)
    return result


def _steps(places: Array, delay: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Differences of the waves of neighbouring wheels, by product: (order of the wheels, real, imaginary parts).

    A sum of weights W_w whose total is 0 is, by parts, the sum of W_1 + ... + W_k times u_k - u_(k+1), and with the
    middle m and half the distance h of two wheels u_k - u_(k+1) = 2i sin(delay h) e^{i delay m}: nothing cancels where
    the delay is short, as it does between the waves themselves.
    """
    order = np.argsort(-places, kind="stable")
    ahead, behind = places[order[:-1]], places[order[1:]]
    real, imaginary = wheel_waves((ahead + behind) / 2, delay)
    known: dict[float, Array] = {}
    for k, half in enumerate((ahead - behind) / 2):
        size = _near(float(half), known)
        if size not in known:
            known[size] = 2 * cos_sin(size * delay)[1]
        real[k], imaginary[k] = -known[size] * imaginary[k], known[size] * real[k]
    return order, real, imaginary


def _near(size: float, known: Iterable[float]) -> float:
    """A distance, or one of those known that it is but for rounding, so that what is alike cancels."""
    return next((other for other in known if abs(size - other) <= SAME * max(size, other)), size)


def _weighted(weights: Array, waves: Array) -> Array:
    total = np.zeros(waves.shape[1:], dtype=waves.dtype)
    for weight, wave in zip(weights, waves, strict=True):
        if weight:
            total += weight * wave
    return total


def weighted_nodes(
    reduction: Reduction, places: Array, spectrum: Spectrum, rule: Quadrature, speed: Array, limits: Array, most: int
) -> Iterator[WeightedNodes]:
    """The nodes of a rule, at most `most` at a time, with weights that turn powers into mean squares.

    places: of the wheels, m. speed: [m] in m/s. limits: [2, m], each speed's band in rad/s, on panel edges; outside it
    the weights are zero.
    """
    gauss = rule.gauss_weights.size
    for first, last in ((0, gauss), (gauss, rule.omega.size)):  # the embedded rule's nodes come first
        edges = np.linspace(first, last, -(-(last - first) // most) + 1).round().astype(int)
        for part in itertools.starmap(slice, itertools.pairwise(edges)):
            omega = rule.omega[part, None]
            density = angular_psd(spectrum, omega, speed) * ((omega > limits[0]) & (omega < limits[1]))
            functions = lag_functions(reduction, places, omega / speed)
            functions *= density
            embedded = functions * rule.gauss_weights[part, None] if last == gauss else None
            functions *= rule.weights[part, None]
            yield WeightedNodes(rule.omega[part], functions, embedded)


def places_of(reduction: Reduction, values: Values, index: tuple[int, ...] = ()) -> Array:
    """Places of the wheels of the vehicle at an index of the grid, m; values without a last axis for frequencies."""
    shape = np.broadcast_shapes(*(np.shape(v) for v in values.values()))
    one = {name: float(np.broadcast_to(values[name], shape)[index]) for name in reduction.system.lengths}
    return reduction.places(one)
