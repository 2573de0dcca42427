"""What the checks of a confirmation say, in words."""

from __future__ import annotations

VERDICTS = ("confirmed", "outside", "failed", "not_checked")
"""Meaning of the verdicts 0 to 3: the number stands; it does not; the simulation failed; nothing to compare with."""

CONFIRMED, OUTSIDE, FAILED, NOT_CHECKED = range(len(VERDICTS))
