"""The report of a replication: what holds, what does not, with which numbers, and why the paper may differ.

Every verdict and number comes from the findings and datasets; the sentences around them are conditional on them or say
nothing about an outcome. What holds is said first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from freqrail.case.parameters import JOINTS
from freqrail.model.responses import RESPONSES
from freqrail.model.vehicle import Vehicle
from freqrail.replication import judging
from freqrail.replication.claims import CLAIMS, PAPER_POINT, PRIMARY, RESPONSE_NAMES, Claim
from freqrail.replication.contradictions import contradictions
from freqrail.replication.document import Block, Bullets, Heading, Image, Paragraph, Table, anchor
from freqrail.replication.explanation import TITLES, explained
from freqrail.replication.figures import Picture
from freqrail.replication.judging import FAILS, HOLDS, OTHER_JOINT, PARTLY, VERDICTS, Finding, high, low, plural
from freqrail.replication.mechanism import Mechanism
from freqrail.replication.procedures import DURATION
from freqrail.replication.standing import Standing
from freqrail.replication.studies import TABLE_I
from freqrail.replication.thresholds import CHOSEN, KNIFE_EDGE, MEANING, PLAUSIBLE
from freqrail.replication.unjudged import unjudged
from freqrail.replication.variations import Variation
from freqrail.result.axes import largest_error
from freqrail.solver.vehicle_poles import half_vehicle_poles
from freqrail.text import number

_PAPER = (
    'Y. Yu, Y. Song, L. Zhao, C. Zhou, "Numerical Investigation on Train Vertical Dynamics with Damper Rubber Joint '
    'Stiffness"'
)


def compose(
    datasets: Mapping[str, xr.Dataset],
    findings: Mapping[str, Finding],
    standing: Mapping[str, Standing],
    mechanism: Mechanism,
    variations: Sequence[Variation],
    pictures: Sequence[Picture],
    vehicle: Vehicle,
    left_out: str = "",
) -> list[Block]:
    """The report's blocks.

    findings, standing: of all claims by key. vehicle: the paper's. left_out: what this run did not do, in words.
    """
    by_verdict = {verdict: [c for c in CLAIMS if findings[c.key].verdict == verdict] for verdict in VERDICTS}
    return [
        Heading(1, "The paper's study, redone and judged claim by claim"),
        *_opening(datasets, by_verdict, standing, left_out),
        *_held(by_verdict, findings, standing),
        *contradictions(datasets["grid"]),
        *unjudged(datasets),
        *explained(mechanism),
        *_reasons(findings, variations, vehicle),
        Heading(2, "Figures of the paper"),
        *_images(pictures, paper=True),
        Heading(2, "Figures that explain"),
        *_images(pictures, paper=False),
        *_method(datasets),
    ]


def _opening(
    datasets: Mapping[str, xr.Dataset],
    by_verdict: Mapping[str, Sequence[Claim]],
    standing: Mapping[str, Standing],
    left_out: str,
) -> list[Block]:
    grid = datasets["grid"]
    points = grid["status"].size
    scanned = sum(grid.sizes[joint] * grid.sizes["speed"] for joint in JOINTS)
    counts = ", ".join(
        f"**{len(by_verdict[verdict])} {plural(verdict, len(by_verdict[verdict]))}**" for verdict in VERDICTS
    )
    blocks: list[Block] = [
        Paragraph(
            f"{_PAPER}, sections V to VII, computed anew from frequency responses: {points} grid points of the model "
            f"with joints (band {grid.attrs['band']}), every pair of stiffnesses. The paper scans one joint at a time "
            f"and integrates {DURATION:g} s at each of {scanned} points; here every number has an error estimate, the "
            f"largest being {largest_error(grid):.1e}."
        ),
        Paragraph(f"Of the paper's {len(CLAIMS)} directional claims {counts}."),
        Paragraph(_edges(by_verdict, standing)),
        Paragraph(
            "Each claim stands beside the paper's own sentence with its section, so that the reading can be checked. "
            "The numbers are those of a vehicle on a rigid rail, as in the paper: see "
            f"[{TITLES[1].lower()}](#{anchor(TITLES[1])})."
        ),
    ]
    if left_out:
        blocks.append(Paragraph(f"**{left_out}**"))
    return blocks


def _edges(by_verdict: Mapping[str, Sequence[Claim]], standing: Mapping[str, Standing]) -> str:
    """How many verdicts are knife edges, and what that is."""
    counts = {verdict: sum(bool(standing[c.key].knife_edges) for c in claims) for verdict, claims in by_verdict.items()}
    parts = [f"{count} of those that {plural(verdict, 2)}" for verdict, count in counts.items()]
    return f"**{sum(counts.values())} of these verdicts are knife edges**: {', '.join(parts)}. {KNIFE_EDGE}"


# --- the claims ------------------------------------------------------------------------------------


def _held(
    by_verdict: Mapping[str, Sequence[Claim]], findings: Mapping[str, Finding], standing: Mapping[str, Standing]
) -> list[Block]:
    titles = {HOLDS: "What holds", PARTLY: "What holds partly", FAILS: "What does not hold"}
    head = ("claim", "the paper's words", "read as", "verdict", "true where", "numbers that decide", "stands while")
    blocks: list[Block] = []
    for verdict, claims in by_verdict.items():
        blocks.append(Heading(2, titles[verdict]))
        if not claims:
            blocks.append(Paragraph("No claim."))
            continue
        rows = []
        for claim in claims:
            found = findings[claim.key]
            quoted = f"“{claim.quotation}” ({claim.section}, {claim.item})"
            row = [claim.key, quoted, claim.text, found.verdict, found.where, found.numbers, _firm(standing[claim.key])]
            rows.append(row)
        blocks.append(Table(head, rows))
    return blocks


def _firm(standing: Standing) -> str:
    """The ranges of its thresholds in which a verdict stands, and whether it is a knife edge."""
    if not standing.knife_edges:
        return standing.words
    return f"{standing.words}. **Knife edge**: {', '.join(MEANING[name][0] for name in standing.knife_edges)}"


# --- why it may differ -----------------------------------------------------------------------------


def _reasons(findings: Mapping[str, Finding], variations: Sequence[Variation], vehicle: Vehicle) -> list[Block]:
    rows = [
        [
            v.group,
            v.name,
            " / ".join(f"{v.count(verdict):.3g}" for verdict in VERDICTS),
            "; ".join(_change(v, key) for key in v.changed) or "none",
            v.note,
        ]
        for v in variations
    ]
    failing = [claim for claim in CLAIMS if findings[claim.key].verdict == FAILS]
    mended = {claim.key: [v for v in variations if v.mended.get(claim.key)] for claim in failing}
    never = [claim for claim in failing if not mended[claim.key]]
    return [
        Heading(2, "Why the paper may differ"),
        Paragraph(
            "What the paper does not state, and what its procedure does, varied one at a time. Each variation is "
            "judged beside the exact result at the same points; a verdict that changes is what the variation explains. "
            f"Judged are the {len(variations[0].exact)} claims about RMS values; of the exact ones over the whole grid "
            f"{' / '.join(str(_count(variations[0], verdict)) for verdict in VERDICTS)} hold / hold partly / do not "
            "hold."
        ),
        Paragraph(
            "Sections V and VI hold a vehicle of which one joint is scanned, the other kept at 5 MN/m, against one "
            "whose joints are both rigid. However stiff the scanned joint, the other one keeps the two apart: that the "
            "curves never coincide (VI.A 1d and 3f, VI.B 1d) is true whatever the scanned joint does, and a slow "
            "approach (VI.A 1h and 3e) may be a curve that has long reached its own limit. The variation of what a "
            "joint is compared with judges the scanned joint by its own effect."
        ),
        Paragraph(_ringing(vehicle)),
        Table(("question", "variation", "hold / partly / not", "claims that change verdict", "what else"), rows),
        Heading(3, "Claims that do not hold, and what would make them"),
        Table(
            ("claim", "read as", "holds at least partly under"),
            [
                [
                    c.key,
                    c.text,
                    "; ".join(f"{v.group}: {v.name}{_tracks(v, v.mended[c.key])}" for v in mended[c.key])
                    or "no variation tried",
                ]
                for c in failing
            ],
        ),
        *_reading(failing, never, variations),
    ]


def _change(variation: Variation, key: str) -> str:
    """A claim's verdict before and after, and on how many tracks it changes if not on all."""
    verdicts = variation.changed[key]
    after = max(VERDICTS, key=verdicts.count)
    return f"{key} {variation.exact[key].verdict} → **{after}**{_tracks(variation, len(verdicts))}"


def _count(variation: Variation, verdict: str) -> int:
    return sum(found.verdict == verdict for found in variation.exact.values())


def _tracks(variation: Variation, count: int) -> str:
    total = len(variation.tracks)
    return "" if count == total else f" (on {count} of {total} tracks)"


def _counted(variation: Variation, claims: Mapping[str, int]) -> str:
    return ", ".join(f"{key}{_tracks(variation, count)}" for key, count in claims.items())


def _steps(variation: Variation, claims: Mapping[str, int]) -> str:
    """Steps, on average over the tracks, and those of each claim."""
    if not claims:
        return "none"
    total = len(variation.tracks)
    each = ", ".join(f"{key} by {count / total:.2g}" for key, count in claims.items())
    return f"{sum(claims.values()) / total:.3g} ({each})"


def _reading(failing: Sequence[Claim], never: Sequence[Claim], variations: Sequence[Variation]) -> list[Block]:
    """What each reading explains and costs, as far as the variations decide it, and what stays unknown."""
    idle = [group for group in dict.fromkeys(v.group for v in variations) if not _ever(group, variations)]
    items = [f"No verdict hangs on: {', '.join(idle)}."] if idle else []
    items += [
        f"The paper cannot have used {v.group} ({v.name}): its own grid cannot be computed that way: {v.note}."
        for v in variations
        if not v.possible
    ]
    items += _balances([v for v in variations if v.possible], [claim.key for claim in failing])
    if never:
        items.append(
            f"Mended by nothing that was tried are {len(never)} of the {len(failing)}: "
            f"{', '.join(c.key for c in never)}."
        )
    return [
        Heading(3, "What a reading explains, and what it costs"),
        Paragraph(
            "A reading is credited with the steps by which verdicts rise in it and charged with those by which they "
            "fall: from “does not hold” to “holds partly” is one step, and so is from there to “holds”, either way; a "
            "claim counts by its share of tracks."
        ),
        Bullets(items),
        Heading(3, "What cannot be known"),
        Paragraph(
            "The paper gives neither its contact constant nor its band nor its sampling nor the tolerances of its "
            "integrator; not the phases of its track, how a run starts on it, nor whether each run had a track of its "
            "own; not where on the car body and at which bogie and axle it reads its responses. Its results are in "
            "drawings, not in numbers, and only its words are judged here. A variation that agrees with the words "
            "shows that it can have been so, never that it was."
        ),
    ]


def _ever(group: str, variations: Sequence[Variation]) -> bool:
    return any(v.changed for v in variations if v.group == group)


def _balances(variations: Sequence[Variation], failing: Sequence[str]) -> list[str]:
    """The readings that explain more than they cost, the best first; then others that make failing claims hold."""
    better = sorted((v for v in variations if v.balance > 0), key=lambda v: v.balance, reverse=True)
    helpful = [v for v in variations if v.balance <= 0 and v.at_once(failing)]
    helpful.sort(key=lambda v: sum(v.mended.get(key, 0) for key in failing) / len(v.tracks), reverse=True)
    items = [_balance(v, failing) for v in better]
    if not better:
        items.append("No reading explains more than it costs.")
    elif not any(v.at_once(failing) for v in better):
        items.append("No reading that explains more than it costs makes a claim that fails hold, even partly.")
    items += [_balance(v, failing) for v in helpful]
    if not any(v.at_once(failing) for v in variations):
        items.append(
            "Nothing that was tried, and that the paper can have done, makes a claim that fails hold, even partly."
        )
    return items


def _balance(variation: Variation, failing: Sequence[str]) -> str:
    """A reading's steps gained and lost, and what it makes of the claims that fail."""
    balance = variation.balance
    than = "more than" if balance > 0 else "less than" if balance < 0 else "as much as"
    return (
        f"**{variation.group}: {variation.name}** explains {than} it costs: steps gained "
        f"{_steps(variation, variation.gained)}, lost {_steps(variation, variation.lost)}. "
        f"{_mended(variation, failing)}"
    )


def _mended(variation: Variation, failing: Sequence[str]) -> str:
    """How many of the claims that fail hold at least partly in a variation, and which."""
    mended = {key: variation.mended[key] for key in failing if key in variation.mended}
    if not mended:
        return f"It makes none of the {len(failing)} claims that fail hold, even partly."
    return (
        f"It makes {len(mended)} of the {len(failing)} claims that fail hold at least partly, up to "
        f"{variation.at_once(failing)} on one track: {_counted(variation, mended)}."
    )


def _ringing(vehicle: Vehicle) -> str:
    """How long a struck wheelset rings on the rigid rail, beside the paper's 20 s."""
    parts, frequencies = [], []
    for joint in (TABLE_I[0], OTHER_JOINT, TABLE_I[-1], np.inf):
        stiffness = 1e6 * joint
        one = replace(vehicle, primary_joint_stiffness=stiffness, secondary_joint_stiffness=stiffness)
        wheelset = max(half_vehicle_poles(one), key=lambda pole: abs(pole.imag))
        words = "rigid joints" if np.isinf(joint) else f"{joint:g} MN/m"
        parts.append(f"{number(-1 / wheelset.real, 3)} s with {words}")
        frequencies.append(abs(wheelset.imag) / (2 * np.pi))
    return (
        f"On a rail without give a wheelset rings on the contact spring at {number(min(frequencies))} to "
        f"{number(max(frequencies))} Hz, and a blow "
        f"takes long to die away: decay times are {', '.join(parts)}. What a run of {DURATION:g} s reports then "
        "depends on how it begins and on what its integrator does to that ringing, not on the track alone."
    )


# --- figures and method ----------------------------------------------------------------------------


def _images(pictures: Sequence[Picture], paper: bool) -> list[Block]:
    return [Image(p.stem, p.title, p.caption) for p in pictures if p.stem.startswith("figure-") == paper]


def _method(datasets: Mapping[str, xr.Dataset]) -> list[Block]:
    grid = datasets["grid"]
    corner = float(datasets["spectra"].attrs["corner_frequency"])
    where = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in judging.PLACES.items())
    stiff = ", ".join(f"{k:g}" for k in grid[PRIMARY].values)
    point = ", ".join(
        f"{k.replace('_', ' ')} {v:g} {'km/h' if k == 'speed' else 'MN/m'}" for k, v in PAPER_POINT.items()
    )
    responses = ", ".join(RESPONSES[name].long_name for name in RESPONSE_NAMES)
    return [
        Heading(2, "How claims are judged"),
        Bullets(
            [
                f"Responses: {responses}; read at {where}. Stiffnesses: {stiff} MN/m. The point of section V: {point}.",
                "Departure: RMS with joints over RMS of the traditional model (rigid joints), less one.",
                "Points are stiffnesses times speeds, or steps between them. Every verdict hangs on thresholds, each "
                "a choice; the table gives what was chosen and how far another reader's choice may plausibly lie from "
                "it. The column “stands while” gives for each claim the range of its thresholds, one at a time, "
                "within which its verdict is the same; what is not named there changes nothing. Two choices have no "
                f"range: departures are relative (see above what that decides), and V.B g is judged above {corner:.1f} "
                "Hz, the lower of the two dampers' corners.",
                f"Low and high speed as chosen: {_range(low(grid['speed']))} and {_range(high(grid['speed']))} km/h.",
                f"Files: {', '.join(f'`{name}.nc`' for name in datasets)}; `freqrail replicate` makes all of this.",
            ]
        ),
        Table(
            ("threshold", "what it is", "chosen", "plausible"),
            [
                [
                    words,
                    meaning,
                    _threshold(name, getattr(CHOSEN, name)),
                    " to ".join(_threshold(name, end) for end in PLAUSIBLE[name]),
                ]
                for name, (words, meaning) in MEANING.items()
            ],
        ),
    ]


def _threshold(name: str, value: float) -> str:
    """A threshold as the claims' table writes it: one on normalised curves is a plain number."""
    return f"{value:.3g}" if name == "alike" else f"{100 * value:.3g} %"


def _range(values: xr.DataArray) -> str:
    return f"{float(values.min()):g}-{float(values.max()):g}"
