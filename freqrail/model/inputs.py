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
