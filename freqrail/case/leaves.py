"""The values of a free vehicle's tables: texts with units, names of parameters, places as sums of both.

Whatever uses a parameter shares it; every other value is a leaf of its own, named by its path with underscores,
"suspensions_primary_1_k". What is wrong is noted, line by line, and reading goes on.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from freqrail.case.kinds import KINDS, Read, expected, read_quantity
from freqrail.case.parameters import PARAMETERS, Parameter, nearest_name
from freqrail.case.quantities import Quantity, cf_unit, split_number, unit_factor
from freqrail.model.stations import Place
from freqrail.text import given

Path = tuple[str, ...]

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_TERM = re.compile(rf"\s*([+-]?)\s*(?:({_NUMBER})\s*([A-Za-z]+)|([A-Za-z][A-Za-z0-9_]*))", re.ASCII)
_TAKEN = frozenset({"inf", "sample", "parameter", "band", "status", "method"})
_PARAMETERS = ("stiffness", *(kind for kind in KINDS if kind not in ("stiffness", "fractional coefficient")))
_PLACE = 'a place is a sum of lengths such as "9.5 m", "-pivot" or "pivot + axle"'


def leaf_name(path: Path) -> str:
    """The name of a value by its path."""
    return "_".join(path)


@dataclass
class Leaves:
    """What has been read of the values so far.

    where: what messages call a place in the file, by its keys. problems: what is wrong, a line each. own: names of
    leaves that vary by themselves though their text names a parameter. known: the parameters of the file. used: all
    values that the vehicle needs; meaning: what each of them is.
    """

    where: Callable[..., str]
    problems: list[str]
    own: Collection[str] = ()
    written: Mapping[str, Any] = field(default_factory=dict)
    known: dict[str, Read] = field(default_factory=dict)
    used: dict[str, Read] = field(default_factory=dict)
    meaning: dict[str, str] = field(default_factory=dict)

    def silent(self) -> Leaves:
        """The same, which notes what is wrong nowhere: for what is told elsewhere."""
        return replace(self, problems=[])

    def fault(self, path: Path, words: object) -> None:
        """Note what is wrong at a place."""
        self.problems.append(f"{self.where(*path)}: {words}")

    def keys(self, path: Path, table: Mapping[str, Any], known: Collection[str]) -> None:
        """Note keys that are none."""
        for key in table:
            if key not in known:
                self.fault((*path, key), f"unknown key{nearest_name(key, known)}")

    def need(self, path: Path, table: Mapping[str, Any], key: str, example: str) -> Any:
        """What stands under a key; None, and a note, if it is missing."""
        if key not in table:
            self.fault((*path, key), f"missing; write it as in {key} = {example}")
        return table.get(key)

    def read_parameters(self, table: object) -> None:
        """Read [parameters]."""
        if not isinstance(table, dict):
            self.fault(("parameters",), f"must be a table {given(table)}")
            return
        self.written = table
        for name, text in table.items():
            path = ("parameters", name)
            if not NAME.fullmatch(name):
                self.fault(path, f"a name is letters, digits and _, beginning with a letter {given(name)}")
            elif _is_unit(name):
                self.fault(path, f'"{name}" is a unit; give the parameter another name')
            elif name in _TAKEN or (name in PARAMETERS and PARAMETERS[name].section != "vehicle"):
                self.fault(path, f'"{name}" is the name of something else; give the parameter another name')
            else:
                try:
                    self.known[name] = read_quantity(text, _PARAMETERS)
                except ValueError as fault:
                    self.fault(path, fault)

    def value(self, path: Path, text: object, wanted: Collection[str], meaning: str) -> str | None:
        """The name of the value of a key, of one of some kinds (see `kinds.KINDS`); None, and a note, if it is none."""
        wanted = tuple(wanted)
        if isinstance(text, str) and NAME.fullmatch(text.strip()) and text.strip() != "inf":
            named = self._parameter(path, text.strip(), wanted)
            if named is None:
                return None
            if leaf_name(path) not in self.own:
                self.use(text.strip(), named, meaning)
                return text.strip()
            read = named
        else:
            try:
                read = read_quantity(text, wanted)
            except ValueError as fault:
                self.fault(path, fault)
                return None
        return self.use(leaf_name(path), read, meaning)

    def use(self, name: str, read: Read, meaning: str) -> str:
        """Note that the vehicle needs a value; its name."""
        self.used[name] = read
        self.meaning.setdefault(name, meaning)
        return name

    def _parameter(self, path: Path, name: str, wanted: tuple[str, ...]) -> Read | None:
        read = self.known.get(name)
        if read is None:
            if name not in self.written:  # else it is at fault itself
                self.fault(path, f"unknown parameter {name!r}{nearest_name(name, self.known)}")
            return None
        kind = _kind_among(read, wanted)
        if kind is None:
            self.fault(
                path,
                f"{name} is a {read.kind} in {KINDS[read.kind].unit}; {expected(wanted)} is expected {given(name)}",
            )
            return None
        return Read(read.quantity, kind)

    def place(self, path: Path, text: object) -> Place | None:
        """A place along the vehicle: a length, a parameter's name, or a sum of both."""
        body = text.strip() if isinstance(text, str) else ""
        terms: list[re.Match[str]] = []
        at = 0
        while at < len(body):
            found = _TERM.match(body, at)
            if not found or (terms and not found[1]):
                break
            terms.append(found)
            at = found.end()
        if not terms or body[at:].strip():
            self.fault(path, f"{_PLACE} {given(text)}")
            return None
        arm: dict[str, float] = {}
        units: dict[str, None] = {}
        constant = Fraction(0)
        for term in terms:
            sign = -1 if term[1] == "-" else 1
            if term[4]:
                read = self.known.get(term[4])
                if read is None:
                    if term[4] not in self.written:
                        self.fault(path, f"unknown parameter {term[4]!r}{nearest_name(term[4], self.known)}")
                    return None
                units[KINDS[read.kind].unit] = None
                arm[term[4]] = arm.get(term[4], 0.0) + sign
            else:
                try:
                    read_quantity(f"{term[2]} {term[3]}", ["length"])
                except ValueError as fault:
                    self.fault(path, str(fault).replace(given(f"{term[2]} {term[3]}"), given(text)))
                    return None
                units["m"] = None
                constant += sign * Fraction(split_number(f"{term[2]} m", "", "")[0]) * unit_factor(term[3])[0]
        if {*units} != {"m"}:
            words = "a sum of " + " and ".join(units) if len(units) > 1 else f"in {next(iter(units))}"
            self.fault(path, f"{words}: {_PLACE} {given(text)}")
            return None
        return self._arm(path, body, arm, constant)

    def _arm(self, path: Path, text: str, arm: dict[str, float], constant: Fraction) -> Place:
        """The arm of a sum. A plain length, and one that varies by itself, is a leaf."""
        if leaf_name(path) in self.own or (constant and not arm):
            value = float(constant) + sum(factor * self.known[name].quantity.value for name, factor in arm.items())
            plain = _TERM.fullmatch(text) and not arm
            quantity = Quantity(value, text if plain else f"{value!r} m")
            return {self.use(leaf_name(path), Read(quantity, "length"), "place along the vehicle"): 1.0}
        for name in arm:
            self.use(name, self.known[name], "length")
        if constant:
            arm[""] = float(constant)
        return {name: factor for name, factor in arm.items() if factor}

    def unused(self) -> dict[str, Parameter]:
        """Parameters of the file that nothing uses, and what each is."""
        rest = {name: read for name, read in self.known.items() if name not in self.used}
        return {name: replace(KINDS[read.kind], name=name) for name, read in rest.items()}

    def numbers(self) -> dict[str, float]:
        """The values by name, SI."""
        return {name: read.quantity.value for name, read in self.used.items()}

    def known_numbers(self) -> dict[str, float]:
        """The values and all parameters of the file by name, SI."""
        return {name: read.quantity.value for name, read in {**self.known, **self.used}.items()}

    def quantities(self) -> dict[str, Quantity]:
        """The values by name, as written and in SI."""
        return {name: read.quantity for name, read in self.used.items()}

    def parameters(self) -> dict[str, Parameter]:
        """What each value is."""
        return {
            name: replace(KINDS[read.kind], name=name, meaning=self.meaning[name]) for name, read in self.used.items()
        }


def _kind_among(read: Read, wanted: Collection[str]) -> str | None:
    """What a parameter is where some kinds are wanted: a mass may be an inerter, and inf is every stiffness."""
    if read.kind in wanted:
        return read.kind
    if read.quantity.value == float("inf"):
        return next((kind for kind in wanted if KINDS[kind].infinite), None)
    return None


def _is_unit(name: str) -> bool:
    try:
        return cf_unit(name) is not None
    except ValueError:
        return False
