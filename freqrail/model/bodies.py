"""The bodies of a system: which moves with which freedoms, which stands on which, and what like ones are called.

All of it is read off the freedoms' words and the legs' rows. A body is as high as its way down to the track, by legs,
is long; the body above another is the one that it carries, where it carries one only. What stands on the track is
ordered front to rear as the wheels are, and whatever it carries with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqrail.model.system import Freedom, System

_ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth")


@dataclass(frozen=True)
class Body:
    """A body: its kind in a word, legs down to the track (-1: none lead there), and the index of the body above."""

    name: str
    kind: str
    level: int
    above: int | None


@dataclass(frozen=True)
class Part:
    """One motion of all bodies of a kind, as "bogie pitch".

    title: its words for one body or for several. motion: a word. bodies: indices, front to rear. freedoms: index of
    each body's. alone: whether it is the only motion of bodies that stand on the track, so that it needs no word.
    """

    title: str
    kind: str
    motion: str
    bodies: tuple[int, ...]
    freedoms: tuple[int, ...]
    alone: bool


@dataclass(frozen=True)
class Anatomy:
    """The bodies and motions of a system. body_of: of each freedom. lower: of each of `System.rows`, its lower end."""

    bodies: tuple[Body, ...]
    parts: tuple[Part, ...]
    body_of: tuple[int, ...]
    lower: tuple[int | None, ...]


def anatomy_of(system: System) -> Anatomy:
    """Which bodies a system has, how they move, and what its legs stand on."""
    bodies = bodies_of(system)
    index = {body.name: k for k, body in enumerate(bodies)}
    body_of = tuple(index[body_name(freedom)] for freedom in system.freedoms)
    return Anatomy(bodies, parts_of(system, bodies), body_of, lower_bodies(system, bodies))


def body_name(freedom: Freedom) -> str:
    """The name of the body that moves."""
    return freedom.body or freedom.name


def bodies_of(system: System) -> tuple[Body, ...]:
    """The bodies of a system, front to rear; of equally far ones those first whose freedoms come first."""
    kinds: dict[str, str] = {}
    for freedom in system.freedoms:
        kinds.setdefault(body_name(freedom), freedom.kind or body_name(freedom))
    of = {freedom.name: body_name(freedom) for freedom in system.freedoms}
    places: dict[str, list[float]] = {}
    for k, wheel in enumerate(system.wheels):
        for name in wheel.row:
            places.setdefault(of[name], []).append(float(k))
    level = dict.fromkeys(places, 0)
    joined = [set(map(of.__getitem__, leg.row)) for leg in system.legs]
    upper: dict[str, set[str]] = {name: set() for name in kinds}
    front = list(level)
    for name in front:  # which grows meanwhile
        for other in sorted(set().union(*(some for some in joined if name in some)) - {name}):
            if other not in level:
                level[other] = level[name] + 1
                front.append(other)
            if level[other] == level[name] + 1:
                upper[name].add(other)
    where = {name: float(np.mean(places[name])) for name in places}
    for name in front:
        below = [where[other] for other in front if name in upper[other]]
        where.setdefault(name, float(np.mean(below)) if below else np.inf)
    order = sorted(kinds, key=lambda name: (where.get(name, np.inf), list(kinds).index(name)))
    index = {name: k for k, name in enumerate(order)}
    above = {name: index[next(iter(some))] if len(some) == 1 else None for name, some in upper.items()}
    return tuple(Body(name, kinds[name], level.get(name, -1), above[name]) for name in order)


def parts_of(system: System, bodies: tuple[Body, ...]) -> tuple[Part, ...]:
    """The motions of a system, in the order of the freedoms; every freedom belongs to one."""
    index = {body.name: k for k, body in enumerate(bodies)}
    own: dict[str, list[int]] = {}
    for k, freedom in enumerate(system.freedoms):
        own.setdefault(body_name(freedom), []).append(k)
    found: dict[tuple[str, str, int], list[tuple[int, int]]] = {}
    for k, freedom in enumerate(system.freedoms):
        body = body_name(freedom)
        motion = freedom.motion or (freedom.name if len(own[body]) > 1 else "")
        alike = [i for i in own[body] if system.freedoms[i].motion == freedom.motion]
        key = bodies[index[body]].kind, motion, alike.index(k) if freedom.motion else 0
        found.setdefault(key, []).append((index[body], k))
    motions = {kind: sum(key[0] == kind for key in found) for kind, *_ in found}
    result = []
    for (kind, motion, number), members in found.items():
        which, freedoms = zip(*sorted(members), strict=True)
        alone = motions[kind] == 1 and (not motion or bodies[which[0]].level == 0)
        title = f"{kind} {motion}".rstrip()
        if alone:
            title = plural(kind) if len(which) > 1 else kind
        if motion == "bending" or number:
            title += f", {ordinal(number)} mode"
        result.append(Part(title, kind, motion, which, freedoms, alone))
    return tuple(result)


def lower_bodies(system: System, bodies: tuple[Body, ...]) -> tuple[int | None, ...]:
    """The body at the lower end of every leg and wheel of `System.rows`, None where two are equally high."""
    index = {body.name: k for k, body in enumerate(bodies)}
    of = {freedom.name: index[body_name(freedom)] for freedom in system.freedoms}
    result: list[int | None] = []
    for each, _ in system.rows:
        some = {of[name] for name in each.row}
        least = min(bodies[k].level for k in some)
        lowest = [k for k in some if bodies[k].level == least]
        result.append(lowest[0] if len(lowest) == 1 else None)
    return tuple(result)


def ordinal(index: int) -> str:
    """ "first" of index 0, and so on."""
    return _ORDINALS[index] if index < len(_ORDINALS) else f"{index + 1}th"


def plural(kind: str) -> str:
    """Several of a kind."""
    return f"{kind[:-1]}ies" if kind.endswith("y") else f"{kind}s"
