"""The band that an RMS is taken over: its limits at a speed, and its words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.types import Number


@dataclass(frozen=True)
class Band:
    """What an RMS is taken over: "frequency" in Hz or "wavelength" in m, from `low` to `high`."""

    kind: str
    low: float
    high: float


def band_limits(band: Band, speed: Number) -> NDArray[np.float64]:
    """Limits [2, ...] of a band in rad/s at every `speed` in m/s; omega = 2 pi v / wavelength."""
    if band.kind == "frequency":
        return 2 * np.pi * np.array([np.full(np.shape(speed), band.low), np.full(np.shape(speed), band.high)])
    return 2 * np.pi * np.array([speed / band.high, speed / band.low])


def band_text(band: Band | None) -> str:
    """A band in words: "0.1 to 100 Hz", "wavelengths 1 to 200 m" or "whole axis"."""
    if band is None:
        return "whole axis"
    if band.kind == "frequency":
        return f"{band.low:g} to {band.high:g} Hz"
    return f"wavelengths {band.low:g} to {band.high:g} m"
