"""Transfer functions of outputs, the wheels' lags summed as complex numbers: no columns, no lag functions."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.half_vehicle import half_vehicle, outputs, values_of
from freqrail.model.outputs import Output
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import Reduction, reduce
from freqrail.solver.block_lags import centred, places_of
from freqrail.solver.block_response import column, scalars, unsound


def transfer(
    reduction: Reduction, values: Values, omega: NDArray[np.float64], speed: float
) -> dict[str, NDArray[np.complex128]]:
    """T(i omega) of every output of a reduction, {name: [labels, n]}, in its unit per metre of track height.

    values: floats. omega: [n] rad/s. speed: m/s. The height is that midway between the first and the last wheel.
    """
    exact = unsound(reduction, values, omega)
    found = scalars(reduction, column(values), 1j * omega, -np.square(omega), exact).values()
    waves = np.exp(1j * np.multiply.outer(centred(places_of(reduction, values)), omega) / speed)
    result = {}
    for name, labels in reduction.sums.items():
        rows = np.zeros((len(labels), omega.size), complex)
        for row, terms in zip(rows, labels, strict=True):
            for scalar, weights in terms:
                for weight, wave in zip(weights, waves, strict=True):
                    row += found[scalar] * (weight * wave)
        result[name] = rows
    return result


def half_vehicle_transfer(
    vehicle: Vehicle, names: tuple[str, ...], omega: NDArray[np.float64], speed: float
) -> dict[str, NDArray[np.complex128]]:
    """`transfer` of the named responses of a single half vehicle, in the order of the names."""
    found = transfer(_reduced(names), values_of(vehicle), omega, speed)
    return {name: found[name] for name in names}


@cache
def _reduced(names: tuple[str, ...]) -> Reduction:
    return half_vehicle_reduction(tuple(output for output in outputs() if output.name in names))


def half_vehicle_reduction(wanted: tuple[Output, ...]) -> Reduction:
    """The half vehicle reduced for some outputs, whatever its lengths."""
    system = half_vehicle()
    return reduce(system, wanted, {name: np.array([1.0, 2.0]) for name in system.lengths})
