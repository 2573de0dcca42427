"""The numbers that decide what a claim comes to, the range in which each of them would be as sensible, and words.

The paper says "basically identical", "great errors", "a low speed": a judgement needs numbers, and any number is a
choice. `CHOSEN` are the ones taken here, `PLAUSIBLE` how far another reader's may lie from them.
"""

from __future__ import annotations

from dataclasses import dataclass

KNIFE_EDGE = (
    "A verdict is a knife edge if some other value of one of its thresholds, within the plausible range of that "
    "threshold and with all other thresholds as chosen, would change it."
)
"""What is called a knife edge: this sentence alone defines it."""


@dataclass(frozen=True)
class Thresholds:
    """What decides.

    everywhere: share of points from which on a claim holds: one curve may stray at a point or two. mostly: share from
    which on it holds partly. same: relative difference up to which two curves look the same in a printed figure. seen:
    from which on two curves do not coincide. step: relative change from which on a curve rises, falls, nears or grows:
    above the numbers' own error. great: relative difference that a "great error" exceeds. alike: of a normalised
    curve, up to which two speeds follow the same law. region: of the range of speeds at either end, "low" and "high"
    speed. mainly: share of a change that has to lie where it is said mainly to lie.
    """

    everywhere: float = 0.95
    mostly: float = 0.5
    same: float = 0.05
    seen: float = 1e-3
    step: float = 1e-6
    great: float = 0.10
    alike: float = 0.1
    region: float = 0.25
    mainly: float = 0.5


CHOSEN = Thresholds()

PLAUSIBLE: dict[str, tuple[float, float]] = {
    "everywhere": (0.90, 1.0),
    "mostly": (1 / 3, 2 / 3),
    "same": (0.02, 0.10),
    "seen": (1e-4, 1e-2),
    "step": (1e-8, 1e-3),
    "great": (0.05, 0.20),
    "alike": (0.05, 0.20),
    "region": (0.15, 0.35),
    "mainly": (1 / 3, 2 / 3),
}
"""Lowest and highest value of each threshold that a careful reader might have taken instead."""

SHARES = ("everywhere", "mostly")
"""Thresholds on the share of points, which every claim has."""

MEANING: dict[str, tuple[str, str]] = {
    "everywhere": ("share for holds", "share of its points from which on a claim holds"),
    "mostly": ("share for partly", "share of its points from which on a claim holds partly"),
    "same": ("equal within", "relative difference up to which two values are practically equal"),
    "seen": ("coincident within", "relative difference up to which two curves coincide"),
    "step": ("counted from", "relative change from which on a curve rises, falls, nears or grows"),
    "great": ("great above", "relative difference above which an error is great"),
    "alike": ("one law within", "distance from the mean normalised curve up to which speeds follow one law"),
    "region": ("low and high speed", "share of the range of speeds at either end that is low and high speed"),
    "mainly": ("mainly above", "share of a change that has to lie where it is said mainly to lie"),
}
"""What the report calls each threshold, and what it is."""
