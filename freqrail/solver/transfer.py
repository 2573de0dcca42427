"""Transfer functions of outputs, the wheels' lags summed as complex numbers: no columns, no lag functions."""

from __future__ import annotations

import functools
import operator

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.half_vehicle import values_of
from freqrail.model.system import evaluate
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import Reduction
from freqrail.solver.block_response import column, scalars, unsound
from freqrail.solver.problem import half_vehicle_reduction

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def transfer_functions(reduction: Reduction, values: Values, omega: Array, speed: Array) -> dict[str, list[Complex]]:
    """T(i omega) of every output's labels, [grid..., speeds, n] each, in its unit per metre of track height.

    values: by parameter, broadcasting to [grid...]. omega: [n] rad/s. speed: [m] m/s. The height is that midway
    between the first and the last wheel. What depends on few axes of the grid spans only these; an output that the
    track does not move is 0.
    """
    spread = column(column(values))
    exact = unsound(reduction, values, omega)
    found = scalars(reduction, spread, 1j * omega, -np.square(omega), exact).values()
    delay = omega / speed[:, None]
    places = [np.asarray(evaluate(wheel.place, values)) for wheel in reduction.system.wheels]
    middle = (functools.reduce(np.maximum, places) + functools.reduce(np.minimum, places)) / 2
    waves = [np.exp(1j * delay * (place - middle)[..., None, None]) for place in places]
    nothing = np.zeros(delay.shape, complex)
    result: dict[str, list[Complex]] = {}
    for name, labels in reduction.sums.items():
        result[name] = []
        for terms in labels:
            parts = [
                np.multiply(found[k], functools.reduce(operator.add, (w * u for w, u in zip(some, waves, strict=True))))
                for k, some in terms
            ]
            result[name].append(functools.reduce(operator.add, parts, nothing))
    return result


def transfer(reduction: Reduction, values: Values, omega: Array, speed: float) -> dict[str, Complex]:
    """The same of a single vehicle at one speed, {name: [labels, n]}; values: floats."""
    found = transfer_functions(reduction, values, omega, np.array([speed]))
    return {name: np.concatenate(labels) for name, labels in found.items()}


def half_vehicle_transfer(vehicle: Vehicle, names: tuple[str, ...], omega: Array, speed: float) -> dict[str, Complex]:
    """`transfer` of the named responses of a single half vehicle, in the order of the names."""
    return transfer(half_vehicle_reduction(names), values_of(vehicle), omega, speed)
