"""The lag functions of a reduction at nodes and speeds, and the weights that turn powers into mean squares."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.inputs import cos_sin
from freqrail.model.spectrum import Spectrum, angular_psd
from freqrail.reduction.columns import Reduction
from freqrail.solver.quadrature import Quadrature, WeightedNodes

Array = NDArray[np.float64]


def centred(places: Array) -> Array:
    """Places from the middle between the first and the last wheel, m: no phase of the whole matters."""
    return np.asarray(places - (np.max(places) + np.min(places)) / 2)


def wheel_waves(places: Array, delay: Array) -> tuple[Array, Array]:
    """Real and imaginary part of e^{i omega x_w/v} for every wheel, [wheels, ...]; delay: omega/v, rad/m.

    Wheels at x and -x get the same bits but for the sign, so that what cancels between them is zero.
    """
    real, imaginary = np.empty((2, len(places), *delay.shape))
    known: dict[float, tuple[Array, Array]] = {}
    for k, x in enumerate(places):
        size = float(np.abs(x))
        if size not in known:
            known[size] = cos_sin(size * delay)
        real[k], imaginary[k] = known[size][0], known[size][1] if x >= 0 else -known[size][1]
    return real, imaginary


def lag_functions(reduction: Reduction, places: Array, delay: Array) -> Array:
    """Every lag function of a reduction, [lags, ...], -; delay: omega/v, rad/m."""
    real, imaginary = wheel_waves(centred(places), delay)

    sums: dict[bytes, tuple[Array, Array]] = {}

    def sum_over_wheels(weights: Array) -> tuple[Array, Array]:
        key = weights.tobytes()
        if key not in sums:
            # one by one, in the order of the wheels: a matrix product's bits would depend on the shape
            sums[key] = _weighted(weights, real), _weighted(weights, imaginary)
        return sums[key]

    result = np.empty((len(reduction.lags), *delay.shape))
    for k, lag in enumerate(reduction.lags):
        (a, b), (c, d) = sum_over_wheels(lag.one), sum_over_wheels(lag.other)
        result[k] = lag.factor * (a * c + b * d if lag.part == "re" else b * c - a * d)
    return result


def _weighted(weights: Array, waves: Array) -> Array:
    total = np.zeros(waves.shape[1:])
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
