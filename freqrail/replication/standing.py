"""How firmly a verdict stands: the range of each threshold within which it is the same, the others as chosen."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from freqrail.replication.claims import CLAIMS, Claim
from freqrail.replication.judging import verdict_of
from freqrail.replication.thresholds import CHOSEN, MEANING, PLAUSIBLE, SHARES

_WIDEST = (1e-9, 10.0)  # how far from what was chosen a relative threshold is tried
_HALVINGS = 24  # of the way from what was chosen to there
_DIGITS = 3


Range = tuple[float | None, float | None]


@dataclass(frozen=True)
class Standing:
    """The range of every threshold that enters a claim, low and high; None where nothing changes that way.

    ranges: by threshold. knife_edges: those of which a plausible value changes the verdict (`thresholds.KNIFE_EDGE`).
    """

    ranges: Mapping[str, Range]
    knife_edges: tuple[str, ...]

    @property
    def words(self) -> str:
        """Each threshold that the verdict hangs on with the range in which the verdict stands."""
        bound = {name: ends for name, ends in self.ranges.items() if ends != (None, None)}
        if not bound:
            return "whatever its thresholds" if self.ranges else "without a threshold"
        return "; ".join(f"{MEANING[name][0]}: {_range(name, *ends)}" for name, ends in bound.items())


def standings(datasets: Mapping[str, xr.Dataset]) -> dict[str, Standing]:
    """How firmly every claim's verdict stands, by key."""
    return {claim.key: standing(claim, datasets[claim.over]) for claim in CLAIMS if claim.over in datasets}


def standing(claim: Claim, dataset: xr.Dataset) -> Standing:
    """How firmly a claim's verdict stands in a dataset."""
    outcome = claim.outcome(dataset)
    share = float(outcome.true.mean())
    verdict = verdict_of(share)
    ranges, edges = _shares(share), []
    for name in SHARES:
        if any(verdict_of(share, replace(CHOSEN, **{name: value})) != verdict for value in PLAUSIBLE[name]):
            edges.append(name)
    for name in outcome.thresholds:

        def stands(value: float, name: str = name) -> bool:
            there = replace(CHOSEN, **{name: value})
            return verdict_of(float(claim.outcome(dataset, thresholds=there).true.mean()), there) == verdict

        if name == "region":
            ranges[name], edge = _regions(stands, dataset["speed"].values)
        else:
            ranges[name] = (_end(stands, name, 0), _end(stands, name, 1))
            edge = not all(stands(value) for value in PLAUSIBLE[name])
        if edge:
            edges.append(name)
    return Standing(ranges, tuple(edges))


def _shares(share: float) -> dict[str, Range]:
    """The ranges of the thresholds on a share of true points: up to the share itself, or above it."""
    if share >= CHOSEN.everywhere:
        return {"everywhere": (None, share if share < 1 else None), "mostly": (None, None)}
    if share >= CHOSEN.mostly:
        return {"everywhere": (share, None), "mostly": (None, share)}
    return {"everywhere": (None, None), "mostly": (share if share > 0 else None, None)}


def _end(stands: Callable[[float], bool], name: str, side: int) -> float | None:
    """The last value on the way from what was chosen to the lower (0) or upper (1) limit at which a verdict stands.

    Found by halving: beyond the first change a verdict does not come back, for a share of true points only grows or
    only shrinks with a threshold.
    """
    inside, outside = getattr(CHOSEN, name), ((0.0, 1.0) if name == "mainly" else _WIDEST)[side]
    if stands(outside):
        return None
    for _ in range(_HALVINGS):
        between = 0.5 * (inside + outside) if min(inside, outside) <= 0 else math.sqrt(inside * outside)
        if stands(between):
            inside = between
        else:
            outside = between
    return float(inside)


def _regions(stands: Callable[[float], bool], speed: np.ndarray) -> tuple[Range, bool]:
    """The range for "low and high speed", which has as many different values as there are speeds; and a knife edge."""
    share = np.unique((speed - speed.min()) / np.ptp(speed))
    share = share[(share > 0) & (share <= 0.5)]
    # a hair more, so that the speed itself is in
    same = np.array([stands(float(value) + 1e-9) for value in share])
    chosen = int(np.flatnonzero(share <= CHOSEN.region + 1e-9)[-1])
    changed = np.flatnonzero(~same)
    below, above = changed[changed < chosen], changed[changed > chosen]
    ends = (
        float(share[below[-1] + 1]) if below.size else None,
        float(share[above[0] - 1]) if above.size else None,
    )
    low, high = PLAUSIBLE["region"]
    plausible = (share >= low - 1e-9) & (share <= high + 1e-9)
    return ends, bool((~same & plausible).any())


def _range(name: str, low: float | None, high: float | None) -> str:
    """A range in words, rounded inwards so that the verdict stands at the numbers told."""
    unit = 1.0 if name == "alike" else 100.0
    after = "" if name == "alike" else " %"
    texts = [
        None if end is None else f"{_inwards(unit * end, up):.{_DIGITS}g}{after}"
        for end, up in ((low, True), (high, False))
    ]
    if texts[0] is None:
        return f"{texts[1]} or less"
    if name in SHARES:
        return f"above {texts[0]}"  # at the share itself the next better verdict begins
    return f"{texts[0]} or more" if texts[1] is None else f"{texts[0]} to {texts[1]}"


def _inwards(value: float, up: bool) -> float:
    """`value` in `_DIGITS` significant digits, rounded up or down unless it is such a number but for rounding."""
    scale = 10.0 ** (_DIGITS - 1 - math.floor(math.log10(value))) if value > 0 else 1.0
    nearest = round(value * scale)
    if abs(value * scale - nearest) < 1e-9:
        return nearest / scale
    return (math.ceil if up else math.floor)(value * scale) / scale
