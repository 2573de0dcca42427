"""The report's words on why joints do what they do, and on the rigid rail; every number is computed in `mechanism`."""

from __future__ import annotations

from freqrail.model.responses import RESPONSES
from freqrail.replication.claims import BOGIE, PAPER_SPEED
from freqrail.replication.document import Block, Bullets, Heading, Paragraph, Table
from freqrail.replication.mechanism import Filter, Mechanism
from freqrail.replication.words import extent, percent
from freqrail.text import number

TITLES = ("Why joints change what they change", "What belongs to the rigid rail")


def explained(found: Mechanism) -> list[Block]:
    """The mechanism in three items, and the same vehicle on a rail that gives way."""
    return [
        Heading(2, TITLES[0]),
        Paragraph("Numbers of the paper's vehicle, joints of 5 MN/m in both stages unless said otherwise."),
        Bullets([_stiffening(found), _freed(found), _filtered(found)]),
        Heading(2, TITLES[1]),
        *_on_rails(found),
    ]


def _stiffening(found: Mechanism) -> str:
    s = found.stiffening
    return (
        "**Car body: the damper becomes a spring as well.** Between its joints the secondary damper adds c²ω²/κ to its "
        f"spring: {percent(s.added)} of K_s at the car body's bounce of {number(s.frequency)} Hz "
        f"({percent(s.exact)} with the higher orders), and more above. The car body's RMS departs by "
        f"{percent(s.car)} at {PAPER_SPEED:g} km/h; secondary springs stiffer by as much at all frequencies would "
        f"alone make {percent(s.springs)}, so that this is a part of the reason, not all of it."
    )


def _freed(found: Mechanism) -> str:
    slow, fast = found.freed.rigid
    mode = found.freed.joint
    return (
        "**Bogie frame: its bounce is set free.** With rigid joints it is overdamped (it decays at "
        f"{number(slow, 3)} and {number(fast, 3)} 1/s and does not oscillate); with joints it is a resonance at "
        f"{number(mode.natural_frequency, 3)} Hz with a damping ratio of {mode.damping_ratio:.2f}."
    )


def _filtered(found: Mechanism) -> str:
    return (
        "**Bogie frame over speed: the wheelbase filters that resonance.** The two wheels of a bogie cancel in its "
        f"bounce at f = v/(4 L_t). {' '.join(_filter(one) for one in found.filters)}"
    )


def _filter(one: Filter) -> str:
    return (
        f"With primary joints of {one.joint:g} MN/m the bounce is at {number(one.bounce, 3)} Hz and the departure is "
        f"{extent(one.departure)}; at {one.speed:g} km/h the wheels cancel at {number(one.cancelled, 3)} Hz. Without "
        f"the lag inside the bogie it is {extent(one.without_lag)}."
    )


def _on_rails(found: Mechanism) -> list[Block]:
    rail, (rigid, yielding) = found.rail, (found.on_rigid, found.on_yielding)
    (before, undamped), (after, damped) = found.rigid_resonance, found.resonance
    rows = []
    for name in rigid.joint:
        response = RESPONSES[name]
        row = [response.long_name]
        for rails in (rigid, yielding):
            for values in (rails.joint, rails.rigid):
                row.append(f"{number(response.shown_scale * values[name])} {response.shown_unit}")
            row.append(percent(rails.departure(name)))
        rows.append(row)
    return [
        Paragraph(
            "The paper's rail is rigid. Put under each wheel a rail that gives way "
            f"({number(rail.mass)} kg on {number(rail.stiffness / 1e6)} MN/m and {number(rail.damping / 1e3)} kN·s/m), "
            f"and the wheelsets' resonance moves from {number(before, 3)} Hz with a damping ratio of {undamped:.2g} "
            f"to {number(after, 3)} Hz with {damped:.2f}. The bogie frame's RMS at {PAPER_SPEED:g} km/h is "
            f"{number(yielding.joint[BOGIE])} m/s² instead of {number(rigid.joint[BOGIE])} m/s², and the joints' "
            f"effect on it {percent(yielding.departure(BOGIE))} instead of {percent(rigid.departure(BOGIE))}. What "
            "this report says of the bogie frame is said of one on a rigid rail. Computed by a dense solution of its "
            "own, which for a rigid rail gives the numbers of this report."
        ),
        Table(
            (
                "response",
                "rigid rail: joints",
                "rigid rail: traditional",
                "rigid rail: effect of joints",
                "yielding rail: joints",
                "yielding rail: traditional",
                "yielding rail: effect of joints",
            ),
            rows,
        ),
    ]
