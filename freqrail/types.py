"""Names of types that many modules share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Number = Any
"""A float or complex number, or an array of them that broadcasts against its neighbours."""

Progress = Callable[[int], object]
"""Called with how much more is done: grid points, figures, whole simulated seconds."""

SecondsProgress = Callable[[float], object]
"""Called with how much more is done: seconds of simulated time."""
