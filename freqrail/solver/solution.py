"""What a solver hands on: RMS values with their error estimates, statuses and methods, as words and arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

STATUS = ("ok", "unresolved_peak", "undamped", "failed")
"""Meaning of the status values 0, 1, ...; all but the first come with NaN in some response."""


METHOD = ("none", "closed_form", "shared_quadrature", "own_quadrature")
"""Meaning of the method values: no result, sum of residues, nodes shared by the grid, nodes of the vehicle's own."""


TOLERANCE = 1e-6
"""Largest error estimate of an RMS value, relative, that is passed on as a result."""


@dataclass(frozen=True)
class Solution:
    """RMS values and their relative error estimates {name: [positions, grid..., speeds]} in SI units.

    status and method: [grid..., speeds], int8, see `STATUS` and `METHOD`; the status is the gravest that befell any
    response. A number and its error are NaN where it is not finite, its error exceeds `TOLERANCE` or it is undamped.
    """

    rms: dict[str, NDArray[np.float64]]
    relative_error: dict[str, NDArray[np.float64]]
    status: NDArray[np.int8]
    method: NDArray[np.int8]
