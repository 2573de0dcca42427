"""A vehicle of the free form: the tables [parameters], [bodies], [wheels], [suspensions] to a `System` of names.

Every fault of the tables is told at once: the place, what is wrong, what was given, what is expected.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from freqrail.case.element_values import Written, read_law
from freqrail.case.kinds import read_list
from freqrail.case.law_text import Tree, letters, parse_law
from freqrail.case.leaves import NAME, Leaves, Path, leaf_name
from freqrail.case.parameters import Parameter, nearest_name
from freqrail.case.quantities import Quantity
from freqrail.model.derived import Derived, HertzianContact, ModalMass, complete
from freqrail.model.elements import Bending, Law, Spring, Values
from freqrail.model.statics import loose_motions
from freqrail.model.stations import BendingMode, Body, Place, between, distance
from freqrail.model.system import Freedom, Leg, Row, System, Wheel, evaluate
from freqrail.text import given
from freqrail.types import Number

TABLES = ("parameters", "bodies", "wheels", "suspensions")
"""The tables of a free vehicle."""

_BODY = ("mass", "pitch_inertia", "position", "bending")
_BENDING = ("frequency", "damping_ratio", "length", "modal_mass", "shape")
_CONTACTS = ("contact_stiffness", "contact_constant", "contact")
_WHEEL = ("mass", "position", *_CONTACTS)
_SUSPENSION = ("between", "position", "law", "direction", "like")
_SHAPE = '{ position = "-12, 0, 12 m", value = [1, -0.6, 1] }'


@dataclass(frozen=True)
class FreeVehicle:
    """A vehicle of the free form.

    quantities: every value by name (see `leaves`), as written and in SI units. parameters: what each of them is.
    derived: numbers that follow from those. bodies: by name, wheels too. suspensions: of direction "vertical". bent:
    names of the legs that are what holds a bending mode.
    """

    system: System
    quantities: Mapping[str, Quantity]
    parameters: Mapping[str, Parameter]
    derived: tuple[Derived, ...]
    bodies: Mapping[str, Body]
    suspensions: tuple[str, ...]
    bent: frozenset[str] = frozenset()

    def values(self, changed: Values | None = None) -> dict[str, Number]:
        """All numbers by name in SI units, those that follow from others too; changed: in place of the file's."""
        own: dict[str, Number] = {name: quantity.value for name, quantity in self.quantities.items()}
        return complete(own | dict(changed or {}), self.derived)


def read_free_vehicle(
    tables: Mapping[str, Any], where: Callable[..., str], problems: list[str], own: Collection[str] = ()
) -> tuple[FreeVehicle | None, Leaves, Mapping[str, Body]]:
    """The vehicle of parsed tables, None if something is wrong with it; the values and the bodies as read.

    where: what messages call a place in the file, by its keys. problems: what is wrong is added, a line each. own:
    names of leaves that vary by themselves, though their text names a parameter.
    """
    reader = _Reader(tables, Leaves(where, problems, own))
    return reader.vehicle(), reader.leaves, reader.bodies


class _Reader:
    """Reads the tables once, front to back; what it has found of the system so far."""

    def __init__(self, tables: Mapping[str, Any], leaves: Leaves) -> None:
        self.tables = tables
        self.leaves = leaves
        self.bodies: dict[str, Body] = {}
        self.freedoms: list[Freedom] = []
        self.legs: list[Leg] = []
        self.contacts: dict[str, Law | str] = {}  # by wheel; a str is the name of its contact constant
        self.derived: dict[str, Derived] = {}
        self.vertical: list[str] = []

    def vehicle(self) -> FreeVehicle | None:
        leaves, before = self.leaves, len(self.leaves.problems)
        for name in TABLES[1:]:
            if name not in self.tables:
                leaves.fault((name,), "this table is missing")
        leaves.read_parameters(self.tables.get("parameters", {}))
        for name, table in self.each("bodies"):
            self.read_body(name, table)
        for name, table in self.each("wheels"):
            self.read_wheel(name, table)
        if self.tables.get("wheels") == {}:
            leaves.fault(("wheels",), "a vehicle needs a wheel")
        suspensions = self.inherited()
        for name, written in suspensions.items():
            self.read_suspension(name, written)
        self.check_held(suspensions)
        if len(leaves.problems) > before:
            return None
        return self.whole()

    def each(self, name: str) -> list[tuple[str, dict[str, Any]]]:
        """The tables of a table by name; what is none is noted."""
        table = self.tables.get(name, {})
        if not isinstance(table, dict):
            self.leaves.fault((name,), f"must be a table {given(table)}")
            return []
        found = []
        for key, sub in table.items():
            if not NAME.fullmatch(key):
                words = f"a name is letters, digits and _, beginning with a letter {given(key)}"
                self.leaves.fault((name, key), words)
            elif not isinstance(sub, dict):
                self.leaves.fault((name, key), f"must be a table {given(sub)}")
            else:
                found.append((key, sub))
        return found

    def names(self, table: str) -> Collection[str]:
        """The keys of a table, whatever is wrong with it."""
        found = self.tables.get(table, {})
        return found if isinstance(found, dict) else ()

    # --- bodies and wheels ----------------------------------------------------------------------------

    def read_body(self, name: str, table: dict[str, Any]) -> None:
        leaves, path = self.leaves, ("bodies", name)
        leaves.keys(path, table, _BODY)
        mass = self.mass(path, table, "16000 kg")
        place = self.position(path, table, "0 m")
        inertia = None
        if "pitch_inertia" in table:
            words = f"pitch moment of inertia of {name}"
            inertia = leaves.value((*path, "pitch_inertia"), table["pitch_inertia"], ["moment of inertia"], words)
        if mass:
            self.freedoms.append(Freedom(name, mass, name, stem(name), "bounce"))
        if inertia:
            self.freedoms.append(Freedom(f"{name}.pitch", inertia, name, stem(name), "pitch"))
        bending = table.get("bending", [])
        if not isinstance(bending, list) or not all(isinstance(each, dict) for each in bending):
            leaves.fault(
                (*path, "bending"), f"a list of tables, [[bodies.{name}.bending]], is expected {given(bending)}"
            )
            bending = []
        modes = [self.read_bending(name, mass, order, each) for order, each in enumerate(bending, start=1)]
        if mass and place is not None and None not in modes:
            found = tuple(mode for mode in modes if mode is not None)
            self.bodies[name] = Body(name, place, name, f"{name}.pitch" if "pitch_inertia" in table else "", found)

    def mass(self, path: Path, table: dict[str, Any], example: str) -> str | None:
        text = self.leaves.need(path, table, "mass", f'"{example}"')
        return None if text is None else self.leaves.value((*path, "mass"), text, ["mass"], f"mass of {path[-1]}")

    def position(self, path: Path, table: dict[str, Any], example: str) -> Place | None:
        text = self.leaves.need(path, table, "position", f'"{example}"')
        return None if text is None else self.leaves.place((*path, "position"), text)

    def read_bending(self, body: str, mass: str | None, order: int, table: dict[str, Any]) -> BendingMode | None:
        leaves, path = self.leaves, ("bodies", body, f"bending_{order}")
        leaves.keys(path, table, _BENDING)

        def value(key: str, kind: str, example: str) -> str | None:
            text = leaves.need(path, table, key, example)
            words = f"{key.replace('_', ' ')} of bending mode {order} of {body}"
            return None if text is None else leaves.value((*path, key), text, [kind], words)

        frequency = value("frequency", "frequency", '"9 Hz"')
        ratio = value("damping_ratio", "number", "0.015")
        points, length = None, ""
        if "shape" in table:
            points = self.shape((*path, "shape"), table["shape"])
        else:
            length = value("length", "length", '"24.5 m"') or ""
        modal = value("modal_mass", "mass", "") if "modal_mass" in table else leaf_name((*path, "modal_mass"))
        if mass and modal and "modal_mass" not in table:
            self.derived[modal] = ModalMass(modal, mass)
        if not (frequency and ratio and modal and (points or length)):
            return None
        freedom = f"{body}.bending_{order}"
        motion = "bending" if order == 1 else f"bending {order}"
        self.freedoms.append(Freedom(freedom, modal, body, stem(body), motion))
        self.legs.append(Leg(freedom, {freedom: 1.0}, Bending(modal, frequency, ratio)))
        return BendingMode(freedom, order, length, points)

    def shape(self, path: Path, shape: object) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """The points of a mode shape."""
        if not isinstance(shape, dict) or set(shape) != {"position", "value"}:
            self.leaves.fault(path, f'a CSV file such as "mode.csv", or a table {_SHAPE}, is expected {given(shape)}')
            return None
        try:
            positions = read_list(shape["position"], "length")
        except ValueError as fault:
            self.leaves.fault(path, fault)
            return None
        values = shape["value"]
        if (
            not isinstance(values, list)
            or not all(type(each) in (int, float) for each in values)
            or not len(values) == len(positions) > 1
        ):
            self.leaves.fault(
                path, f"as many values as positions, two or more, are expected, as in {_SHAPE} {given(shape)}"
            )
            return None
        if any(b <= a for a, b in itertools.pairwise(positions)):
            self.leaves.fault(path, f"its positions must increase {given(shape['position'])}")
            return None
        return positions, tuple(map(float, values))

    def read_wheel(self, name: str, table: dict[str, Any]) -> None:
        leaves, path = self.leaves, ("wheels", name)
        if name in self.names("bodies"):
            leaves.fault(path, f"{name!r} is the name of a body too; give one of them another")
            return
        tree = self.tree((*path, "contact"), table["contact"]) if "contact" in table else None
        leaves.keys(path, table, (*_WHEEL, *(letters(tree) if tree else table if "contact" in table else ())))
        mass = self.mass(path, table, "900 kg")
        place = self.position(path, table, "pivot + axle")
        contact = self.contact(path, table, tree)
        if mass:
            self.freedoms.append(Freedom(name, mass, name, "wheelset", "bounce"))
        if mass and place is not None and contact is not None:
            self.bodies[name] = Body(name, place, name)
            self.contacts[name] = contact

    def contact(self, path: Path, table: dict[str, Any], tree: Tree | None) -> Law | str | None:
        """The law of a wheel's contact, or the name of its contact constant."""
        leaves, name = self.leaves, path[-1]
        found = [key for key in _CONTACTS if key in table]
        if len(found) != 1:
            fault = f"{' and '.join(found)} are given" if found else "missing"
            leaves.fault((*path, "contact_stiffness"), f"{fault}; give one of {', '.join(_CONTACTS)}")
            return None
        if found == ["contact"]:
            if tree is None:
                return None
            written = {key: (value, (*path, key)) for key, value in table.items()}
            return read_law(leaves, path, tree, written, False, f"the contact of {name}")
        kind = found[0].replace("_", " ") if found == ["contact_constant"] else "stiffness"
        value = leaves.value((*path, found[0]), table[found[0]], [kind], f"{found[0].replace('_', ' ')} of {name}")
        return value if value is None or found == ["contact_constant"] else Spring(value)

    def tree(self, path: Path, text: object) -> Tree | None:
        try:
            return parse_law(text)
        except ValueError as fault:
            self.leaves.fault(path, fault)
            return None

    # --- suspensions ----------------------------------------------------------------------------------

    def inherited(self) -> dict[str, Written]:
        """Every suspension with the keys of those that it is like."""
        tables = dict(self.each("suspensions"))
        result: dict[str, Written] = {}
        for name, table in tables.items():
            chain, at = [name], table
            written = {key: (value, ("suspensions", name, key)) for key, value in table.items() if key != "like"}
            while "like" in at:
                other = at["like"]
                if not isinstance(other, str) or other not in tables:
                    if len(chain) == 1:  # of the others it is told at their own place
                        words = f"unknown suspension{nearest_name(str(other), tables)} {given(other)}"
                        self.leaves.fault(("suspensions", name, "like"), words)
                    break
                if other in chain:
                    if other == name:
                        circle = " -> ".join([*chain, other])
                        self.leaves.fault(("suspensions", name, "like"), f"like in a circle: {circle}")
                    break
                chain.append(other)
                at = tables[other]
                for key, value in at.items():
                    if key != "like":
                        # a leaf that varies by itself stands in its own table
                        path = ("suspensions", name, key)
                        varies = leaf_name(path) in self.leaves.own
                        written.setdefault(key, (value, path if varies else ("suspensions", other, key)))
            result[name] = written
        return result

    def read_suspension(self, name: str, written: Written) -> None:
        leaves, path = self.leaves, ("suspensions", name)
        table = {key: value for key, (value, _) in written.items()}
        text = leaves.need(path, table, "law", '"k | (K - c - K)"')
        own = {key: value for key, (value, at) in written.items() if at[1] == name}
        tree = None
        if text is not None:
            if "law" in own:
                tree = self.tree((*path, "law"), text)
            else:  # of a wrong one it is told where it stands
                tree = _Reader(self.tables, leaves.silent()).tree(path, text)
        if tree is not None:
            clash = [letter for letter in letters(tree) if letter in _SUSPENSION]
            for letter in clash:
                leaves.fault((*path, "law"), f"{letter!r} is a key of the table; give the element another letter")
            leaves.keys(path, own, (*_SUSPENSION, *letters(tree)))
            tree = None if clash else tree
        direction = table.get("direction", "vertical")
        if direction not in ("vertical", "pitch"):
            leaves.fault((*path, "direction"), f'"vertical" or "pitch" is expected {given(direction)}')
            return
        pitch = direction == "pitch"
        law = None if tree is None else read_law(leaves, path, tree, written, pitch, f"the {stem(name)} suspension")
        pair = self.pair(path, written)
        row = self.pitch_row(path, pair) if pitch else self.row(path, written, pair)
        if row is not None and law is not None:
            self.legs.append(Leg(name, row, law, f"{stem(name)} inner elements"))
            if not pitch:
                self.vertical.append(name)

    def pair(self, path: Path, written: Written) -> tuple[Body, Body] | None:
        """The two bodies that a suspension joins; None if there are none, or something is wrong with them."""
        leaves = self.leaves
        if "between" not in written:
            leaves.fault((*path, "between"), 'missing; write it as in between = ["bogie_front", "axle_1"]')
            return None
        ends, at = written["between"]
        if at[1] != path[1]:  # told where it stands
            leaves = leaves.silent()
        if not isinstance(ends, list) or len(ends) != 2 or not all(isinstance(end, str) for end in ends):
            words = 'two names, the upper body and the lower, are expected, as in ["bogie_front", "axle_1"]'
            leaves.fault(at, f"{words} {given(ends)}")
            return None
        known = [*self.names("bodies"), *self.names("wheels")]
        for end in ends:
            if end not in known:
                leaves.fault(at, f"unknown body {end!r}{nearest_name(end, known)}")
        if ends[0] == ends[1]:
            leaves.fault(at, f"joins {ends[0]!r} to itself; two bodies are expected {given(ends)}")
            return None
        return (self.bodies[ends[0]], self.bodies[ends[1]]) if {*ends} <= self.bodies.keys() else None

    def pitch_row(self, path: Path, pair: tuple[Body, Body] | None) -> Row | None:
        if pair is None:
            return None
        stiff = [end.name for end in pair if not end.pitch]
        for name in stiff:
            words = f'{name} has no pitch_inertia and does not pitch; direction = "pitch" joins two bodies that do'
            self.leaves.fault((*path, "between"), words)
        return None if stiff else {pair[0].pitch: 1.0, pair[1].pitch: -1.0}

    def row(self, path: Path, written: Written, pair: tuple[Body, Body] | None) -> Row | None:
        if "position" not in written:
            self.leaves.fault((*path, "position"), 'missing; write it as in position = "pivot + axle"')
            return None
        text, at = written["position"]
        leaves = self.leaves if at[1] == path[1] else self.leaves.silent()  # of a wrong one it is told where it stands
        station = leaves.place(at, text)
        if station is None or pair is None or not self.reaches(path, pair, station):
            return None
        row, derived = between(*pair, station)
        self.derived |= {each.name: each for each in derived}
        return row

    def reaches(self, path: Path, pair: tuple[Body, Body], station: Place) -> bool:
        """Whether the shapes of both bodies' bending modes cover a station."""
        values = self.leaves.numbers()
        right = True
        for body in pair:
            x = distance(body, station, values)
            for mode in body.modes:
                low, high = mode.reach(values)
                if not low - 1e-9 * abs(low) <= x <= high + 1e-9 * abs(high):
                    right = False
                    self.leaves.fault(
                        (*path, "position"),
                        f"stands {x:g} m from the position of {body.name}, beyond the shape of its bending mode "
                        f"{mode.order}, which covers {low:g} to {high:g} m",
                    )
        return right

    # --- the whole ------------------------------------------------------------------------------------

    def check_held(self, suspensions: Mapping[str, Written]) -> None:
        """Note wheels and bodies that no suspension is attached to."""
        held = set()
        for written in suspensions.values():
            ends: Any = written["between"][0] if "between" in written else []
            held |= {end for end in ends if isinstance(end, str)} if isinstance(ends, list) else set()
        for kind, words in (("wheels", "this wheel is carried by nothing"), ("bodies", "this body hangs on nothing")):
            for name, _ in self.each(kind) if suspensions else ():
                if name not in held:
                    self.leaves.fault((kind, name), f"{words}: no suspension has it in its `between`")

    def whole(self) -> FreeVehicle | None:
        wheels = []
        for name, contact in self.contacts.items():
            law = Spring(leaf_name(("wheels", name, "contact_stiffness"))) if isinstance(contact, str) else contact
            wheels.append(Wheel(name, {name: 1.0}, law, dict(self.bodies[name].place)))
        system = System(tuple(self.freedoms), tuple(self.legs), tuple(wheels))
        for number, (wheel, contact) in enumerate(zip(wheels, self.contacts.values(), strict=True)):
            if isinstance(contact, str):
                name = wheel.contact.names[0]
                self.derived[name] = HertzianContact(name, contact, number, system)
        vehicle = FreeVehicle(
            system,
            self.leaves.quantities(),
            self.leaves.parameters(),
            tuple(self.derived.values()),
            self.bodies,
            tuple(self.vertical),
            frozenset(mode.freedom for body in self.bodies.values() for mode in body.modes),
        )
        values = vehicle.values()
        before = len(self.leaves.problems)
        self.check_order(system, values)
        self.check_loose(system, values)
        return None if len(self.leaves.problems) > before else vehicle

    def check_order(self, system: System, values: Values) -> None:
        """Wheels are told front to rear: what is wrong otherwise is most often a sign."""
        places = [float(evaluate(wheel.place, values)) for wheel in system.wheels]
        for (one, other), (x, y) in zip(itertools.pairwise(system.wheels), itertools.pairwise(places), strict=True):
            if y >= x:
                self.leaves.fault(
                    ("wheels", other.name, "position"),
                    f"{y:g} m is not behind {one.name} at {x:g} m; wheels are told front to rear, forward positive",
                )

    def check_loose(self, system: System, values: Values) -> None:
        """Note motions without stiffness."""
        for motion in loose_motions(system, values):
            first = next(freedom for freedom in system.freedoms if freedom.name == next(iter(motion)))
            kind = "wheels" if first.body in self.contacts else "bodies"
            others = ", ".join(name for name in motion if name != first.name)
            together = f" together with {others}" if others else ""
            self.leaves.fault((kind, first.body), f"hangs on nothing: no spring holds its {first.motion}{together}")


_END = re.compile(r"_(front|rear|leading|trailing|middle|centre|first|second|third|[0-9]+)$")


def stem(name: str) -> str:
    """What like bodies and suspensions are called: "bogie" of "bogie_front", "primary" of "primary_1"."""
    while found := _END.search(name):
        name = name[: found.start()]
    return name
