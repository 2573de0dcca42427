"""What the claims as judged leave out: choices that decide a verdict, and clauses that are no claims, with numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from freqrail.model.responses import RESPONSES
from freqrail.model.variants import PREFIXES
from freqrail.replication import judging
from freqrail.replication.claims import (
    CLAIMS,
    PAPER_SPEED,
    PRIMARY_STROKE,
    RESPONSE_NAMES,
    SECONDARY,
    Claim,
    about_the_corner,
)
from freqrail.replication.document import Block, Bullets, Heading
from freqrail.replication.judging import PLACES, grows_with_speed, more_at_low_speed
from freqrail.replication.thresholds import CHOSEN
from freqrail.replication.words import percent, whole

TITLE = "What the claims leave out"


def unjudged(datasets: Mapping[str, xr.Dataset]) -> list[Block]:
    """The report's section on it."""
    return [
        Heading(2, TITLE),
        Bullets(
            [
                _relative_or_absolute(datasets["grid"]),
                _rms_or_curves(datasets["track"]),
                _low_frequency(datasets["spectra"]),
                _consistency(datasets["grid"]),
            ]
        ),
    ]


def compares_speeds(claim: Claim) -> bool:
    """Whether a claim compares what joints change at different speeds."""
    judge: Any = claim.judge
    return getattr(judge, "args", ()) != () and judge.args[0] in (more_at_low_speed, grows_with_speed)


def absolute(grid: xr.Dataset) -> xr.Dataset:
    """A grid whose departures are differences of RMS, each over one number for all speeds, in the place of shares."""
    found = grid.copy()
    for name in RESPONSE_NAMES:
        joint, rigid = grid[f"{name}_rms"], grid[f"traditional_{name}_rms"]
        one = rigid.mean("speed")
        found[f"{name}_rms"] = (joint - rigid + one).transpose(*joint.dims)
        found[f"traditional_{name}_rms"] = (one + 0 * rigid).transpose(*rigid.dims)
    return found


def curve_differences(track: xr.Dataset) -> dict[str, float]:
    """RMS of the difference of both models' curves over the traditional one's RMS, on one track, by response."""
    found = {}
    for name in RESPONSE_NAMES:
        curves = [track[f"{prefix}{name}_history"] for prefix in PREFIXES]
        at = {dim: here for dim, here in PLACES.items() if dim in curves[0].dims}
        joint, rigid = (curve.sel(at).values.astype(float) for curve in curves)
        found[name] = float(np.sqrt(np.mean((joint - rigid) ** 2) / np.mean(rigid**2)))
    return found


def _relative_or_absolute(grid: xr.Dataset) -> str:
    compared = [claim for claim in CLAIMS if compares_speeds(claim)]
    other = absolute(grid)
    changed = []
    for claim in compared:
        before, after = claim.finding(grid), claim.finding(other)
        if before.verdict != after.verdict:
            changed.append(f"{claim.key} {before.verdict} → **{after.verdict}** (true {after.where})")
    told = "; ".join(changed) or "none"
    return (
        "**Relative or in m/s² and mm.** Departures are judged relative to the traditional RMS, which itself grows "
        f"with speed; the paper draws RMS as it is. For the {len(compared)} claims that compare speeds "
        f"({', '.join(claim.key for claim in compared)}) that is a choice. With differences of RMS instead, these "
        f"change: {told}."
    )


def _rms_or_curves(track: xr.Dataset) -> str:
    apart = curve_differences(track)
    parts = [f"{RESPONSES[name].long_name} {percent(d, False)}" for name, d in apart.items()]
    alike = [RESPONSES[name].long_name for name, d in apart.items() if d <= CHOSEN.same]
    return (
        "**RMS or curves (V.B b to e).** The paper's fig. 4 shows curves over time; judged is their RMS. The RMS of "
        f"the difference of both models' curves, on one track at {PAPER_SPEED:g} km/h, is, of the traditional RMS: "
        f"{', '.join(parts)}. Alike as curves, to {whole(CHOSEN.same)}: {', '.join(alike) or 'none'}."
    )


def _low_frequency(spectra: xr.Dataset) -> str:
    _, change = about_the_corner(spectra)
    corner = float(spectra.attrs["corner_frequency"])
    parts = [f"{RESPONSES[name].long_name} {percent(float(change.sel(response=name)))}" for name in RESPONSE_NAMES]
    little = int((abs(change) <= CHOSEN.same).sum())
    return (
        "**“Has little impact on its low frequency characteristics” (V.B, fig. 4)** is no claim of its own. What "
        f"joints change in the RMS below {corner:.1f} Hz: {', '.join(parts)}; up to {whole(CHOSEN.same)} for "
        f"{little} of {change.size}."
    )


def _consistency(grid: xr.Dataset) -> str:
    ratio = judging.scan(grid, PRIMARY_STROKE, SECONDARY).departure + 1
    spread = ratio.std("speed") / ratio.mean("speed")
    parts = [f"{percent(float(s), False)} with {float(s['stiffness']):g} MN/m" for s in spread]
    return (
        "**“And the more consistent the change law is” (VI.B, 4)** is no claim of its own either. The spread over "
        "speed (standard deviation over mean) of the primary stroke's RMS relative to the traditional one is "
        f"{', '.join(parts)}; it is the largest, the law the least "
        f"consistent, with {float(spread['stiffness'].values[spread.values.argmax()]):g} MN/m."
    )
