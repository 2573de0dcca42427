"""The elements of a law from the values of its letters: the unit tells a spring from a dashpot and an inerter."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from freqrail.case.kinds import KINDS, Read, check, read_list
from freqrail.case.law_text import Letter, Tree, law_of, letters
from freqrail.case.leaves import Leaves, Path, leaf_name
from freqrail.case.parameters import SMALLEST_JOINT_STIFFNESS
from freqrail.case.quantities import Quantity, split_number
from freqrail.model.elements import (
    ComplexSpring,
    Dashpot,
    Fractional,
    Inerter,
    Law,
    Spring,
    Tabulated,
)
from freqrail.text import given

VERTICAL = {"stiffness": Spring, "damping": Dashpot, "mass": Inerter}
PITCH = {"rotational stiffness": Spring, "rotational damping": Dashpot, "moment of inertia": Inerter}
"""Which element a letter is, by the kind of its value."""

_FRACTIONAL = re.compile(r"(.*?)\s*([kMG]?)N\*s\^(\d*\.?\d+)/m", re.ASCII)
_PREFIX = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
_TABLES = (
    '{ stiffness = "5 MN/m", loss_factor = 0.1 }, { coefficient = "12.67 MN*s^0.19/m", exponent = 0.19 } or '
    '{ frequency = "1, 10 Hz", storage = "1, 2 MN/m", loss = "0.1, 0.3 MN/m" }'
)

Written = Mapping[str, tuple[Any, Path]]
"""By key: the value, and the path where it is written, which may be that of another table."""


def read_law(leaves: Leaves, path: Path, tree: Tree, written: Written, pitch: bool, words: str) -> Law | None:
    """A law with the values of its letters; None, and a note, if one is missing or wrong. path: of the law's table."""
    found: dict[str, Law] = {}
    for letter in letters(tree):
        if letter not in written:
            leaves.fault((*path, letter), f'missing; the law names it: write it as in {letter} = "1.2 MN/m"')
            continue
        value, at = written[letter]
        element = _element(leaves, at, value, pitch, f"{letter} of {words}")
        if element is not None:
            found[letter] = element
    if len(found) < len(letters(tree)):
        return None
    _check_series(leaves, path, tree, found, False)
    return law_of(tree, found)


def _check_series(leaves: Leaves, path: Path, tree: Tree, found: Mapping[str, Law], inside: bool) -> None:
    """Note springs in series that are softer than the smallest joint, of which one may be 0 and cut the leg."""
    if not isinstance(tree, Letter):
        for part in tree.parts:
            _check_series(leaves, path, part, found, tree.sign == "-")
        return
    law = found[tree.name]
    if inside and isinstance(law, Spring) and leaves.used[law.name].quantity.value < SMALLEST_JOINT_STIFFNESS:
        leaves.fault(
            (*path, tree.name),
            f'a spring in series must be at least {SMALLEST_JOINT_STIFFNESS:g} N/m, or "inf" for a rigid one '
            f"{given(leaves.used[law.name].quantity.text)}",
        )


def _element(leaves: Leaves, path: Path, value: object, pitch: bool, words: str) -> Law | None:
    if isinstance(value, dict):
        return _special(leaves, path, value, words)
    kinds = PITCH if pitch else VERTICAL
    name = leaves.value(path, value, kinds, words)
    return None if name is None else kinds[leaves.used[name].kind](name)


def _special(leaves: Leaves, path: Path, table: dict[str, Any], words: str) -> Law | None:
    """A complex spring, a fractional element or a tabulated stiffness."""
    if set(table) == {"stiffness", "loss_factor"}:
        stiffness = leaves.value((*path, "stiffness"), table["stiffness"], ["stiffness"], f"stiffness of {words}")
        loss = leaves.value((*path, "loss_factor"), table["loss_factor"], ["number"], f"loss factor of {words}")
        return ComplexSpring(stiffness, loss) if stiffness and loss else None
    try:
        if set(table) == {"coefficient", "exponent"}:
            return _fractional(leaves, path, table, words)
        if set(table) == {"frequency", "storage", "loss"}:
            return _tabulated(leaves, path, table, words)
    except ValueError as fault:
        leaves.fault(path, fault)
        return None
    leaves.fault(path, f"a table is {_TABLES} {given(table)}")
    return None


def _fractional(leaves: Leaves, path: Path, table: dict[str, Any], words: str) -> Law:
    """C s^a; the unit of C holds the exponent, which must be the one given."""
    text, exponent = table["coefficient"], table["exponent"]
    found = _FRACTIONAL.fullmatch(text.strip()) if isinstance(text, str) else None
    if not found:
        raise ValueError(f'coefficient: such as "12.67 MN*s^0.19/m" is expected {given(text)}')
    if type(exponent) not in (int, float) or not 0 <= exponent <= 1:
        raise ValueError(f"exponent: a number from 0 to 1 is expected {given(exponent)}")
    if not math.isclose(float(found[3]), exponent, abs_tol=1e-12):
        raise ValueError(f"coefficient: its unit has s^{found[3]}, but exponent is {exponent} {given(text)}")
    number = float(split_number(f"{found[1]} m", "12.67 m", given(text))[0]) * _PREFIX[found[2]]
    check(KINDS["fractional coefficient"], number, given(text))
    reads = {
        "coefficient": Read(Quantity(number, text.strip()), "fractional coefficient"),
        "exponent": Read(Quantity(float(exponent), str(exponent)), "number"),
    }
    names = [leaves.use(leaf_name((*path, key)), read, f"{key} of {words}") for key, read in reads.items()]
    return Fractional(*names)


def _tabulated(leaves: Leaves, path: Path, table: dict[str, Any], words: str) -> Law:
    """A measured complex stiffness: storage + i loss over frequency."""
    frequency = read_list(table["frequency"], "frequency")
    storage, loss = (read_list(table[key], "stiffness") for key in ("storage", "loss"))
    if not len(frequency) == len(storage) == len(loss):
        raise ValueError(
            f"as many values of storage and loss as frequencies are expected (got {len(frequency)}, {len(storage)}, "
            f"{len(loss)})"
        )
    scale = leaves.use(leaf_name((*path, "scale")), Read(Quantity(1.0, "1"), "number"), f"scale of {words}")
    return Tabulated(scale, tuple(2 * math.pi * f for f in frequency), tuple(map(complex, storage, loss)))
