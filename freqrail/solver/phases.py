"""How like bodies move together, in words: "in phase", "bogies in antiphase", "wheelsets of a bogie opposed".

One rule for all: like bodies that one body carries form a group. If they move alike in all groups, their motion is told
by that within a group ("wheelsets of a bogie opposed") and that of the groups, which is a motion of the carrying bodies
("bogies in phase"). What moves alone is told by its place ("front bogie").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from freqrail.model.bodies import Body, Part, ordinal, plural

STILL = 0.3  # of the largest displacement among like bodies: what moves less is not told

IN_PHASE = "in phase"


@dataclass(frozen=True)
class _Told:
    """Phases of bodies of a kind: the pattern within their groups and, of several groups, what these do.

    pattern: signs, see `_pattern`. place: of the only body of a group that moves, "front". outer: None for one group.
    """

    kind: str
    pattern: tuple[int, ...]
    place: str
    outer: _Told | None

    @property
    def in_phase(self) -> bool:
        """Whether the bodies of a group are in phase."""
        return self.pattern == (1,) * len(self.pattern)

    @property
    def all_in_phase(self) -> bool:
        """Whether all are."""
        return self.in_phase and (self.outer is None or self.outer.all_in_phase)

    @property
    def one(self) -> bool:
        """Whether one body moves alone."""
        return bool(self.place) and (self.outer is None or self.outer.one)


def motion_words(part: Part, bodies: Sequence[Body], amplitudes: Mapping[int, float]) -> str:
    """A part's motion with its phases, as "bogie pitch, bogies in phase". amplitudes: signed, by body."""
    return _titled(part.title, part.alone, part.motion == "bounce", _told(part.bodies, bodies, amplitudes))


def body_words(which: Sequence[int], bodies: Sequence[Body], amplitudes: Mapping[int, float]) -> str:
    """The phases of some like bodies, as "wheelsets all in phase"; "" of one. Arguments as of `leg_words`."""
    told = _told(which, bodies, amplitudes)
    return "" if told is None else _phases(told, named=True)


def leg_words(lower: Sequence[int], bodies: Sequence[Body], amplitudes: Mapping[int, float]) -> str:
    """The motion of rigid bodies that like legs follow, as "bounce", "pitch" or "bogie pitch, bogies in phase".

    lower: the bodies at the legs' lower ends, front to rear. amplitudes: elongations by these.
    """
    groups = _groups(lower, bodies)
    if -1 in groups:
        return _rigid("bounce", lower, bodies, amplitudes)
    pattern, above = _common(groups, bodies, amplitudes), _carried(groups, amplitudes)
    if pattern == (1,) * len(pattern or (0,)):
        return leg_words(tuple(above), bodies, above)
    if pattern is not None and _turning(pattern):
        return _rigid("pitch", tuple(above), bodies, above)
    return body_words(lower, bodies, amplitudes)


def place_words(which: int, bodies: Sequence[Body]) -> str:
    """What one of several like bodies is called: "front bogie", "wheelset 3"; the kind if there is one only."""
    alike = [k for k, body in enumerate(bodies) if body.kind == bodies[which].kind]
    kind = bodies[which].kind
    if len(alike) == 1:
        return kind
    if len(alike) == 2:
        return f"{_PLACES[2][alike.index(which)]} {kind}"
    return f"{kind} {alike.index(which) + 1}"


# --- patterns ----------------------------------------------------------------------------------------

_PLACES = {1: ("",), 2: ("front", "rear"), 3: ("front", "middle", "rear")}


def _pattern(amplitudes: Sequence[float]) -> tuple[int, ...]:
    """Signs of displacements, 0 for what hardly moves, the first that moves positive."""
    x = np.array(amplitudes)
    largest = np.max(np.abs(x))
    signs = np.where(np.abs(x) >= STILL * largest, np.sign(x), 0.0) if largest > 0 else np.zeros(x.size)
    first = next((sign for sign in signs if sign), 1.0)
    return tuple(int(sign) for sign in signs * first)


def _turning(pattern: tuple[int, ...]) -> bool:
    """Whether a pattern is that of bodies below one that pitches, as (1, -1), (1, 0, -1) or (1, 1, -1, -1)."""
    half = len(pattern) // 2
    return half > 0 and pattern == (1,) * half + (0,) * (len(pattern) - 2 * half) + (-1,) * half


def _groups(which: Sequence[int], bodies: Sequence[Body]) -> dict[int, list[int]]:
    """Bodies by what carries them, front to rear; all in one group (-1) if that is not known of all."""
    result: dict[int, list[int]] = {}
    for k in which:
        carrier = bodies[k].above
        if carrier is None:
            return {-1: list(which)}
        result.setdefault(carrier, []).append(k)
    return dict(sorted(result.items()))


def _moving(groups: Mapping[int, list[int]], amplitudes: Mapping[int, float]) -> list[list[int]]:
    """The groups of which some body moves."""
    sizes = {carrier: max(abs(amplitudes[k]) for k in members) for carrier, members in groups.items()}
    return [members for carrier, members in groups.items() if sizes[carrier] >= STILL * max(sizes.values())]


def _carried(groups: Mapping[int, list[int]], amplitudes: Mapping[int, float]) -> dict[int, float]:
    """An amplitude for each group, by what carries it: its largest, with the sign of its first body that moves."""
    result = {}
    for carrier, members in groups.items():
        size = max(abs(amplitudes[k]) for k in members)
        first = next((k for k in members if abs(amplitudes[k]) >= STILL * size), members[0])
        result[carrier] = size if amplitudes[first] >= 0 else -size
    return result


def _common(
    groups: Mapping[int, list[int]], bodies: Sequence[Body], amplitudes: Mapping[int, float]
) -> tuple[int, ...] | None:
    """The pattern within each group that moves; None where the groups are not alike or have several.

    Two groups are alike also where one is the other's mirror image; then the pattern is the front one's.
    """
    if len({len(members) for members in groups.values()}) > 1:
        return None
    if -1 not in groups and len({bodies[carrier].kind for carrier in groups}) > 1:
        return None
    patterns = [_pattern([amplitudes[k] for k in members]) for members in _moving(groups, amplitudes)]
    if len(set(patterns)) > 1 and not (len(groups) == 2 and _mirrored(patterns)):
        return None
    return patterns[0]


def _mirrored(patterns: list[tuple[int, ...]]) -> bool:
    """Whether one body of each of two groups moves, both the outer or both the inner one."""
    return patterns[0] == patterns[1][::-1] and sum(map(abs, patterns[0])) == 1


def _told(which: Sequence[int], bodies: Sequence[Body], amplitudes: Mapping[int, float]) -> _Told | None:
    """The phases of like bodies; None if there is one only."""
    if len(which) == 1:
        return None
    groups, kind = _groups(which, bodies), bodies[which[0]].kind
    pattern = _common(groups, bodies, amplitudes)
    if len(groups) == 1 or pattern is None:
        pattern = _pattern([amplitudes[k] for members in groups.values() for k in members])
        return _Told(kind, pattern, _place(pattern), None)
    above = _carried(groups, amplitudes)
    outer = _told(tuple(above), bodies, above)
    if len(pattern) == 1:  # every body carries one of them
        return None if outer is None else _Told(kind, outer.pattern, outer.place, outer.outer)
    last = _pattern([amplitudes[k] for k in _moving(groups, amplitudes)[-1]])
    place = _place(pattern) if last == pattern else "outer" if pattern[0] else "inner"
    return _Told(kind, pattern, place, outer)


def _place(pattern: tuple[int, ...]) -> str:
    """Where the only body that moves stands, "" if several do."""
    if sum(map(abs, pattern)) != 1 or len(pattern) == 1:
        return ""
    where = pattern.index(1)
    return _PLACES[len(pattern)][where] if len(pattern) in _PLACES else ordinal(where)


# --- words -------------------------------------------------------------------------------------------


def _where(told: _Told) -> str:
    """The one body that moves: "front wheelset of the rear bogie"."""
    return f"{told.place} {told.kind}" + (f" of the {_where(told.outer)}" if told.outer else "")


def _within(told: _Told, of: str) -> str:
    """The phases of the bodies of a group, as "wheelsets of a bogie opposed"; of: " of a bogie", "" for all bodies."""
    bodies, opposed = f"{plural(told.kind)}{of}", "opposed" if of else "in antiphase"
    if told.place:
        return f"{told.place} {told.kind}{of}"
    if told.in_phase:
        return f"{bodies} {IN_PHASE}"
    if _turning(told.pattern):
        some = {2: "", 3: "outer "}.get(len(told.pattern), "front and rear ")
        return f"{some}{bodies} {opposed}"
    if told.pattern == (1, 0, 1):
        return f"outer {bodies} {IN_PHASE}"
    if told.pattern == (1, -1, 1):
        return f"middle {told.kind}{of} against the outer ones"
    return f"{bodies} {' '.join('-0+'[sign + 1] for sign in told.pattern)}"


def _phases(told: _Told, named: bool) -> str:
    """Phases in words. named: whether bodies have to be named also where their own phase alone is told."""
    outer = told.outer
    if told.one:
        return _where(told)
    if outer is None or told.all_in_phase:
        words = _within(told, "") if outer is None else f"{plural(told.kind)} all {IN_PHASE}"
        return words if named else words.removeprefix(f"{plural(told.kind)} ")
    if outer.one:
        return _within(told, f" of the {_where(outer)}")
    if told.in_phase:
        return _phases(outer, named=True)
    each = "each" if told.place else "a"
    return f"{_within(told, f' of {each} {outer.kind}')}, {_phases(outer, named=True)}"


def _titled(title: str, alone: bool, bounce: bool, told: _Told | None) -> str:
    """Title and phases. alone: the title is the bodies' kind itself. bounce: phases need no name of the bodies."""
    if told is None:
        return title
    if told.one and told.outer is None and not alone:
        return f"{told.place} {title}"
    words = _phases(told, named=not (bounce or alone))
    return words if alone and told.kind in words else f"{title}, {words}"


def _rigid(motion: str, which: Sequence[int], bodies: Sequence[Body], amplitudes: Mapping[int, float]) -> str:
    """A motion of the bodies that carry others; of a vehicle's only car body it needs no name."""
    told = _told(which, bodies, amplitudes)
    title = motion if told is None and bodies[which[0]].above is None else f"{bodies[which[0]].kind} {motion}"
    return _titled(title, False, motion == "bounce", told)
