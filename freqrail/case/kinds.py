"""Kinds of quantities that a free vehicle's tables hold: the unit tells which one a text is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from freqrail.case.parameters import Parameter
from freqrail.case.quantities import Quantity, check_bounds, parse_quantity, split_number, to_float, unit_factor
from freqrail.text import given

SHORTEST, LONGEST = 1e-6, 1e7  # m, the sizes of a length that is not 0


def _kind(kind: str, unit: str, example: str, plausible: tuple[float, float], **further: Any) -> Parameter:
    return Parameter("", "parameters", "", unit, kind, example, kind, plausible=plausible, **further)


KINDS: Mapping[str, Parameter] = {
    p.kind: p
    for p in (
        _kind("mass", "kg", "1300 kg", (1e-3, 1e11)),
        _kind("moment of inertia", "kg*m^2", "700 kg*m^2", (1e-3, 1e13)),
        _kind("stiffness", "N/m", "1.2 MN/m", (1e-1, 1e16), above=False, infinite=True),
        _kind("damping", "N*s/m", "4 kN*s/m", (1e-3, 1e12), above=False),
        _kind("rotational stiffness", "N*m/rad", "21 kN*m/rad", (1e-3, 1e16), above=False, infinite=True),
        _kind("rotational damping", "N*m*s/rad", "1 kN*m*s/rad", (1e-3, 1e13), above=False),
        _kind("length", "m", "9.5 m", (-LONGEST, LONGEST), lower=-LONGEST),
        _kind("frequency", "Hz", "9 Hz", (1e-3, 1e5)),
        _kind("contact constant", "m/N^(2/3)", "5.1824e-8 m/N^(2/3)", (1e-14, 1e-1)),
        _kind("number", "1", "0.015", (0.0, 1e3), above=False),
        _kind("fractional coefficient", "N*s^a/m", "12.67 MN*s^0.19/m", (1e-3, 1e13)),
    )
}
"""By name. A mass is an inerter's too, where a law takes it."""

_UNITLESS = ("number", "fractional coefficient")


@dataclass(frozen=True)
class Read:
    """A quantity, and of which kind it is."""

    quantity: Quantity
    kind: str


def read_quantity(value: object, kinds: Iterable[str]) -> Read:
    """A quantity of one of some kinds. Raises ValueError with the units that will do."""
    kinds = tuple(kinds)
    example = KINDS[kinds[0]].example
    got = given(value)
    if "number" in kinds and type(value) in (int, float):
        check(KINDS["number"], float(value), got)  # type: ignore[arg-type]
        return Read(Quantity(float(value), str(value)), "number")  # type: ignore[arg-type]
    if kinds == ("number",):
        raise ValueError(f"a number without quotes is expected, such as {example} {got}")
    if not isinstance(value, str):
        raise ValueError(f'text with a unit is expected, such as "{example}" {got}')
    amount, unit = split_number(value, example, got)
    if amount.is_infinite():
        own = next((kind for kind in kinds if KINDS[kind].infinite), None)
        if own is None or amount < 0:
            raise ValueError(f"inf is not allowed here {got}")
        return Read(Quantity(math.inf, value.strip()), own)
    if not unit:
        raise ValueError(f'a unit is missing: write it as in "{example}" {got}')
    try:
        factor, dimension = unit_factor(unit)
    except ValueError as fault:
        raise ValueError(f"{fault}: {expected(kinds)} is expected {got}") from None
    own = next((k for k in kinds if k not in _UNITLESS and unit_factor(KINDS[k].unit)[1] == dimension), None)
    if own is None:
        raise ValueError(f"wrong dimension: {expected(kinds)} is expected {got}")
    si = to_float(Fraction(amount) * factor, got)
    check(KINDS[own], si, got)
    return Read(Quantity(si, value.strip()), own)


def read_list(value: object, kind: str) -> tuple[float, ...]:
    """Quantities with one unit at the end, "1, 10 Hz", in SI units. Raises ValueError."""
    example = KINDS[kind].example
    if not isinstance(value, str):
        raise ValueError(f'a list such as "1, 2 {example.split(" ", 1)[1]}" is expected {given(value)}')
    parts = value.split(",")
    unit = split_number(parts[-1], example, given(value))[1]
    texts = [*(f"{part} {unit}" for part in parts[:-1]), parts[-1]]
    return tuple(read_quantity(text, [kind]).quantity.value for text in texts)


def has_dimension(parameter: Parameter) -> bool:
    """Whether a parameter has a unit that is the same whatever its value, and not 1."""
    return parameter.kind not in _UNITLESS


def check(parameter: Parameter, value: float, got: str) -> None:
    """Raise ValueError for a value outside a kind's bounds; a length may have either sign, or be 0."""
    if parameter.kind != "length":
        check_bounds(parameter, value, got)
    elif value and not SHORTEST <= abs(value) <= LONGEST:
        raise ValueError(f"must be 0, or from {SHORTEST:g} to {LONGEST:g} m in size {got}")


def expected(kinds: Iterable[str]) -> str:
    """What one of some kinds is, in words."""
    words = [f"a {kind} in {KINDS[kind].unit}" for kind in kinds if kind not in _UNITLESS]
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words) or "a number"


def parse_value(parameter: Parameter, text: object) -> float:
    """The value of a parameter, SI; a plain number where it has no unit. Raises ValueError."""
    if parameter.kind in _UNITLESS or parameter.section == "parameters":
        return read_quantity(text, [parameter.kind]).quantity.value
    return parse_quantity(parameter, text).value
