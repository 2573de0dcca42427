"""[outputs] of a case: responses of the user's own, read off bodies, suspensions and wheels by name."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

from freqrail.case.kinds import Read, read_list
from freqrail.case.leaves import Leaves, Path, leaf_name
from freqrail.case.parameters import nearest_name
from freqrail.case.quantities import Quantity, split_number
from freqrail.model.outputs import Output
from freqrail.model.readings import QUANTITIES, Readings, tap_of
from freqrail.model.responses import Dimension, Response, Vocabulary
from freqrail.model.stations import Body, Place, displacement, distance
from freqrail.text import given, number

STATION = "station"
"""The dimension of an output that is read at several stations."""

_KEYS = ("quantity", "of", "at")
_LATER = ("weighting", "index", "element")
_OVERHANG = 1.6
"""How far a station may be from a body's position, relative to the farthest wheel of the vehicle: a car body of usual
make reaches to about 1.4 of it."""


def read_outputs(
    table: object,
    leaves: Leaves,
    bodies: Mapping[str, Body],
    suspensions: Mapping[str, str],
    wheels: Collection[str],
    taken: Collection[str],
    warned: list[str],
    faulty: Collection[str] = (),
) -> Readings:
    """The outputs of a table, those in order; what is wrong with the others is noted.

    suspensions: {name in the case: name of the leg}. taken: names of other responses. warned: lines to warn of are
    added. faulty: names of bodies that are there, but may not be among those read.
    """
    reader = _Reader(leaves, bodies, suspensions, wheels, warned, faulty)
    if not isinstance(table, dict):
        leaves.fault(("outputs",), f"must be a table {given(table)}")
        return reader.readings()
    for name, each in table.items():
        path = ("outputs", name)
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or re.search(r"_(rms|psd|relative_error)$", name):
            leaves.fault(path, f"a name is small letters, digits and _, beginning with a letter {given(name)}")
        elif name in taken:
            leaves.fault(path, f"{name!r} is the name of another response; give it another")
        elif not isinstance(each, dict):
            leaves.fault(path, f"must be a table {given(each)}")
        else:
            reader.read(path, each)
    return reader.readings()


class _Reader:
    def __init__(
        self,
        leaves: Leaves,
        bodies: Mapping[str, Body],
        suspensions: Mapping[str, str],
        wheels: Collection[str],
        warned: list[str],
        faulty: Collection[str],
    ) -> None:
        self.leaves = leaves
        self.bodies = bodies
        self.suspensions = suspensions
        self.wheels = wheels
        self.warned = warned
        self.faulty = faulty
        self.outputs: list[Output] = []
        self.responses: dict[str, Response] = {}
        self.derived: dict[str, Any] = {}
        self.stations: tuple[str, ...] = ()

    def readings(self) -> Readings:
        dimensions = {}
        if self.stations:
            words = tuple(f"at {label}" for label in self.stations)
            dimensions[STATION] = Dimension("station along the vehicle, m, forward positive", self.stations, words)
        return Readings(tuple(self.outputs), Vocabulary(self.responses, dimensions), tuple(self.derived.values()))

    def read(self, path: Path, table: dict[str, Any]) -> None:
        leaves, before = self.leaves, len(self.leaves.problems)
        for key in table:
            if key in _LATER:
                leaves.fault((*path, key), "this version of freqrail reads no such output yet")
        leaves.keys(path, {key: value for key, value in table.items() if key not in _LATER}, _KEYS)
        name = leaves.need(path, table, "quantity", '"acceleration"')
        if name is None:
            return
        kind = QUANTITIES.get(name) if isinstance(name, str) else None
        if kind is None:
            leaves.fault((*path, "quantity"), f"unknown quantity{nearest_name(str(name), QUANTITIES)} {given(name)}")
            return
        known = {
            "body": {**self.bodies, **dict.fromkeys(self.faulty)},
            "suspension": self.suspensions,
            "wheel": self.wheels,
        }[kind.of]
        example = {"body": '"car"', "suspension": '"secondary_front"', "wheel": '"axle_1"'}[kind.of]
        of = leaves.need(path, table, "of", example)
        if of is None:
            return
        if not isinstance(of, str) or of not in known:
            leaves.fault((*path, "of"), f"unknown {kind.of}{nearest_name(str(of), known)} {given(of)}")
            return
        if "at" in table and (kind.of != "body" or name == "pitch_acceleration"):
            leaves.fault((*path, "at"), f"a {name.replace('_', ' ')} is the same everywhere; leave out `at`")
        if len(leaves.problems) > before or (kind.of == "body" and of not in self.bodies):
            return
        places = self.places(path, table.get("at"), of) if kind.of == "body" else ((("", {}),))
        if places is None:
            return
        taps = []
        for label, station in places:
            row = None
            if kind.of == "body":
                row, needed = displacement(self.bodies[of], station)
                self.derived |= {each.name: each for each in needed}
            taps.append((label, tap_of(name, self.suspensions.get(of, of), self.bodies.get(of), row)))
        at = f" at {table['at']}" if "at" in table and len(places) == 1 else ""
        dimension = STATION if len(places) > 1 else ""
        labels = tuple(label for label, _ in places) if dimension else ()
        self.outputs.append(Output(path[-1], kind.unit, dimension, tuple(taps), kind.derivative))
        self.responses[path[-1]] = Response(
            path[-1], kind.symbol, kind.unit, dimension, f"{kind.words} of {of}{at}", labels
        )

    def places(self, path: Path, text: object, of: str) -> tuple[tuple[str, Place], ...] | None:
        """(label, station) of each place of a body that an output reads; None, and a note, if one is wrong."""
        body = self.bodies[of]
        at = (*path, "at")
        if text is None:
            return (("", body.place),)
        if isinstance(text, str) and "," in text:
            return self.several(at, text, body)
        place = self.leaves.place(at, text)
        if place is None or not self.inside(at, body, place):
            return None
        return (("", place),)

    def several(self, at: Path, text: str, body: Body) -> tuple[tuple[str, Place], ...] | None:
        try:
            found = read_list(text, "length")
            unit = split_number(text.split(",")[-1], "1 m", given(text))[1]
        except ValueError as fault:
            self.leaves.fault(at, fault)
            return None
        texts = [part.strip() for part in text.split(",")]
        labels = tuple(part if part.endswith(unit) else f"{part} {unit}" for part in texts)
        if self.stations not in ((), labels):
            self.leaves.fault(at, f"stations are the same for all outputs: {', '.join(self.stations)} {given(text)}")
            return None
        if len({*found}) < len(found):
            self.leaves.fault(at, f"a station is given twice {given(text)}")
            return None
        self.stations = labels
        places = []
        for k, (label, x) in enumerate(zip(labels, found, strict=True), start=1):
            name = self.leaves.use(leaf_name((*at, str(k))), Read(Quantity(x, label), "length"), "station")
            if not self.inside(at, body, {name: 1.0}):
                return None
            places.append((label, {name: 1.0}))
        return tuple(places)

    def inside(self, at: Path, body: Body, place: Place) -> bool:
        """Whether the shapes of the body's modes cover a place; one outside of a usual car is warned of."""
        values = self.leaves.known_numbers()
        x = distance(body, place, values)
        for mode in body.modes:
            low, high = mode.reach(values)
            if not low - 1e-9 * abs(low) <= x <= high + 1e-9 * abs(high):
                self.leaves.fault(
                    at,
                    f"{number(x)} m from the position of {body.name} is beyond the shape of its bending mode "
                    f"{mode.order}, which covers {low:g} to {high:g} m",
                )
                return False
        wheels = [abs(distance(body, self.bodies[w].place, values)) for w in self.wheels if w in self.bodies]
        if wheels and abs(x) > _OVERHANG * max(wheels):
            words = f"{self.leaves.where(*at)}: {number(x)} m from the position of {body.name}"
            limit = f"{_OVERHANG:g} times the distance of the farthest wheel, {number(max(wheels))} m"
            self.warned.append(f"{words} is outside the vehicle, beyond {limit}; check the place")
        return True
