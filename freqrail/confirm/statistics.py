"""What a simulation says of an RMS: intervals and verdicts. Plain statistics, of no model in particular.

A mean square of N Gaussian records of length T is chi-square with nu = 2 B T N degrees of freedom, where
B = (int G_y df)^2 / int G_y^2 df is the response's bandwidth (J. S. Bendat, A. G. Piersol, Random Data, 4th ed.,
2010, section 8.3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from freqrail.confirm.track_record import Lines
from freqrail.result.verdicts import CONFIRMED, FAILED, NOT_CHECKED, OUTSIDE

CONFIDENCE = 0.95  # of the intervals that are reported


FAMILY_CONFIDENCE = 0.999  # of the intervals that decide, all checks of a run together


def degrees_of_freedom(power: NDArray[np.float64], lines: Lines, records: int) -> NDArray[np.float64]:
    """nu = 2 B T N of the responses' mean squares, [...], B by the lines' own sums.

    power: |T|^2 [..., K].
    """
    mean = power * lines.amplitude**2
    density = mean / lines.width
    # mean = G_y df at every line
    return 2 * lines.period * records * np.sum(mean, -1) ** 2 / np.sum(mean * density, -1)


def interval(
    pooled: NDArray[np.float64], degrees: NDArray[np.float64], confidence: float = CONFIDENCE
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Limits between which the true RMS lies with `confidence`, given the pooled RMS of Gaussian records."""
    tail = (1 - confidence) / 2
    # chdtri: the chi-square that is exceeded with a probability
    return pooled * np.sqrt(degrees / chdtri(degrees, tail)), pooled * np.sqrt(degrees / chdtri(degrees, 1 - tail))


def simultaneous(checks: int) -> float:
    """Confidence of each of so many intervals that makes all of them hold together with FAMILY_CONFIDENCE."""
    return 1 - (1 - FAMILY_CONFIDENCE) / checks  # Bonferroni: holds however the checks depend on each other


def tolerance_verdicts(
    difference: NDArray[np.float64], tolerance: NDArray[np.float64], missing: int = NOT_CHECKED
) -> NDArray[np.int8]:
    """Whether relative differences are within their tolerance, see `VERDICTS`; arrays broadcast.

    missing: the verdict of a difference that is no number; a tolerance that is none leaves nothing to check either.
    """
    verdict = np.where(np.abs(difference) <= tolerance, CONFIRMED, OUTSIDE)
    verdict = np.where(np.isnan(tolerance), NOT_CHECKED, verdict)
    return np.where(np.isnan(difference), missing, verdict).astype(np.int8)


def statistical_verdicts(
    pooled: NDArray[np.float64], degrees: NDArray[np.float64], reference: NDArray[np.float64], checks: int
) -> NDArray[np.int8]:
    """Whether the RMS over the continuous spectrum lies in the interval of its simulation, see `VERDICTS`.

    checks: statistical checks of the whole run, which share FAMILY_CONFIDENCE.
    """
    low, high = interval(pooled, degrees, simultaneous(checks))
    verdict = np.where((low <= reference) & (reference <= high), CONFIRMED, OUTSIDE)
    verdict = np.where(np.isfinite(reference), verdict, NOT_CHECKED)
    return np.where(np.isfinite(pooled), verdict, FAILED).astype(np.int8)
