"""Quantities and axes: text such as "875 kN/m" or "100:300:10 km/h" to numbers in SI units.

One regular expression takes the number, another says what may stand as a unit, and pint takes that unit
alone, because pint alone reads "600,5 kg" as 6005 kg and "2*3 kg" as 6 kg. Numbers stay exact (decimal,
then rational) until the last step, so that an axis value is the float that the user would type. Every
fault is a ValueError whose text says what is wrong, what was given and what would be right.
"""

from __future__ import annotations

import functools
import math
import re
import sys
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from typing import Any

from freqrail.case.parameters import PARAMETERS, Parameter
from freqrail.errors import FileError
from freqrail.text import given

PLAIN = ("", "1")
"""Units of a plain number, such as a damping ratio."""

LONGEST_QUANTITY = 100
"""Most characters of one number with its unit; no true one comes near."""


_NUMBER = re.compile(
    r"([+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf(?![A-Za-z])))(?![\d.])[ \t]*(.*)", re.ASCII | re.DOTALL
)
# Names to small powers, joined by * / or blanks, with at most one level of parentheses. No bare numbers, so
# that "m/N^2/3" is not read as m/N^2 divided by 3, and no towers such as m^9^9^9, which would never end.
_POWER = r"(?:(?:\^|\*\*)(?:-?\d{1,2}|\(-?\d{1,2}(?:/\d{1,2})?\))|⁻?[¹²³])?"
_FACTOR = rf"[A-Za-zµμ]+{_POWER}"
_JOINED = r"(?: *[*·./] *| +)"
_PRODUCT = rf"{_FACTOR}(?:{_JOINED}{_FACTOR})*"
_UNIT = re.compile(rf"(?:{_FACTOR}|\({_PRODUCT}\))(?:{_JOINED}(?:{_FACTOR}|\({_PRODUCT}\)))*")
_MILLINEWTON = re.compile(r"(?<![A-Za-zµμ])mN(?![A-Za-z])[^\s\",]*")
_AMBIGUOUS = re.compile(r"\btons?\b")  # 907 kg to pint, 1000 kg to most of those who type it


@dataclass(frozen=True)
class Quantity:
    """A number with a unit: `value` in SI, `text` as the user wrote it."""

    value: float
    text: str


# --- units and numbers -----------------------------------------------------------------------------


@functools.cache
def _registry() -> Any:
    """pint's registry. Raises FileError if pint is missing or does not run: no fault of the unit's."""
    try:
        import pint  # takes a third of a second: only where a unit is read

        return pint.UnitRegistry(non_int_type=Fraction)
    except Exception as fault:  # a version that does not go with those beside it raises whatever it hits
        what = " ".join(f"{type(fault).__name__}: {fault}".split())
        raise FileError(
            f"pint, which reads units, does not run here ({what}); install it anew: "
            'pip install --upgrade "pint>=0.24.4"'
        ) from None


@functools.cache
def unit_factor(unit: str) -> tuple[Fraction, Any]:
    """(exact factor from `unit` to SI, its SI base units). Raises ValueError for an unknown unit.

    The radian counts as a base unit, so that "rad/s" is not taken for Hz, nor "1/m" for "rad/m".
    """
    if unit in PLAIN:
        return Fraction(1), _registry().Quantity(Fraction(1), "").units
    if len(unit) > LONGEST_QUANTITY or not _UNIT.fullmatch(unit):
        raise ValueError(f"not a unit: {unit!r}")
    if _AMBIGUOUS.search(unit):
        raise ValueError('"ton" means 907 kg here and 1000 kg there, write "t" (1000 kg) or "kg"')
    registry = _registry()
    try:
        one = registry.Quantity(Fraction(1), registry.parse_units(unit)).to_base_units()
    except Exception as fault:  # pint raises a dozen kinds, some from its tokenizer
        raise ValueError(f"unknown unit {unit!r}") from fault
    # a root such as N^(2/3) is a float with a rounding error in its last digits
    rounded = any(Fraction(power).denominator != 1 for _, power in one.unit_items())
    return Fraction(f"{float(one.magnitude):.14g}" if rounded else one.magnitude), one.units


# Units and prefixes, by pint's names, that UDUNITS knows by the same symbol and in the same size. Of many others it
# does not, or means something else: "oz" is a mass to pint, and a volume to it.
_CF_UNITS = {
    **{"meter": "m", "gram": "g", "second": "s", "newton": "N", "hertz": "Hz", "radian": "rad", "degree": "deg"},
    **{"minute": "min", "hour": "h", "metric_ton": "t", "pound": "lb", "foot": "ft", "inch": "in", "mile": "mi"},
    **{"force_pound": "lbf", "joule": "J", "pascal": "Pa", "watt": "W"},
}
_CF_PREFIXES = {"": "", "milli": "m", "centi": "c", "deci": "d", "kilo": "k", "mega": "M", "giga": "G", "micro": "u"}
_CF_FACTOR = re.compile(r"([A-Za-z]+)(-?\d+)?", re.ASCII)


@functools.cache
def cf_unit(unit: str) -> str | None:
    """A unit as the CF conventions spell it, "kN s m-1" for "kN*s/m"; None if UDUNITS may not read it so.

    Raises ValueError for an unknown unit.
    """
    if unit in PLAIN:
        return "1"
    unit_factor(unit)
    registry = _registry()
    factors = []
    for name, power in registry.Quantity(1, registry.parse_units(unit)).unit_items():
        ((prefix, root, _),) = registry.parse_unit_name(name)[:1]
        if Fraction(power).denominator != 1 or root not in _CF_UNITS or prefix not in _CF_PREFIXES:
            return None
        factors.append((int(power), _CF_PREFIXES[prefix] + _CF_UNITS[root]))
    factors.sort(key=lambda factor: factor[0] < 0)
    return " ".join(symbol if power == 1 else f"{symbol}{power}" for power, symbol in factors)


def typed_unit(unit: str) -> str:
    """The unit of a coordinate as users type it: "kN*s/m" for CF's "kN s m-1"; any other text as it is."""
    factors = [_CF_FACTOR.fullmatch(part) for part in unit.split()]
    if not factors or None in factors:
        return unit
    text = ""
    for symbol, power in (factor.groups() for factor in factors if factor):
        size = int(power or 1)
        over = bool(text) and size < 0
        size = -size if over else size
        text += ("/" if over else "*" if text else "") + symbol + (f"^{size}" if size != 1 else "")
    return text


def split_number(text: str, example: str, got: str) -> tuple[Decimal, str]:
    """The number at the head of `text`, exactly, and the rest. Raises ValueError if there is none.

    example and got: for messages, a right spelling and the whole of what the user gave, as `given` puts it.
    """
    body = text.strip()
    if len(body) > LONGEST_QUANTITY:
        raise ValueError(f'too long for a number with a unit such as "{example}" {got}')
    if re.match(r"[+-]?\d*,\d", body):
        raise ValueError(f'a decimal comma: write a point, as in "{example}" {got}')
    if re.match(r"[+-]?nan\b", body, re.IGNORECASE):
        raise ValueError(f'nan is not a number, write one as in "{example}" {got}')
    match = _NUMBER.fullmatch(body)
    if not match:
        raise ValueError(f'not a number with a unit such as "{example}" {got}')
    try:
        number = Decimal(match[1])
    except InvalidOperation:  # an exponent of more than 18 digits
        raise ValueError(f"a number beyond what double precision holds {got}") from None
    if number == 0:
        return Decimal(0), match[2]  # 0e999999999 is zero too, but as a fraction it would fill the memory
    if number.is_finite() and not sys.float_info.min <= number.copy_abs() <= sys.float_info.max:
        raise ValueError(f"a number beyond what double precision holds {got}")
    return number, match[2]


def to_float(exact: Fraction, got: str) -> float:
    """A rational as the nearest float; refused where a float cannot come near, so that none turns inf or 0."""
    if exact != 0 and not sys.float_info.min <= abs(exact) <= sys.float_info.max:
        raise ValueError(f"a number beyond what double precision holds {got}")
    return float(exact)


def user_factor(parameter: Parameter, unit: str, got: str) -> Fraction:
    """Exact factor of the user's unit, after checking that it is there and of the right dimension."""
    if parameter.unit in PLAIN and unit:
        raise ValueError(f"a number without a unit is expected, such as {parameter.example} {got}")
    if not unit and parameter.unit not in PLAIN:
        raise ValueError(f'a unit is missing: write it as in "{parameter.example}" {got}')
    try:
        factor, dimension = unit_factor(unit)
    except ValueError as fault:
        raise ValueError(f'{fault}: a {parameter.kind} such as "{parameter.example}" is expected {got}') from None
    if dimension != unit_factor(parameter.unit)[1]:
        raise ValueError(
            f'wrong dimension: a {parameter.kind} in {parameter.unit}, such as "{parameter.example}", is expected {got}'
        )
    return factor


def check_bounds(parameter: Parameter, value: float, got: str) -> None:
    """Raise ValueError if a value is outside the parameter's bounds."""
    if math.isinf(value):
        if parameter.infinite and value > 0:
            return
        raise ValueError(f"inf is not allowed here {got}")
    low = value <= parameter.lower if parameter.above else value < parameter.lower
    if low:
        bound = f"greater than {parameter.lower:g}" if parameter.above else f"at least {parameter.lower:g}"
        rigid = ', or "inf" for a rigid joint' if parameter.infinite else ""
        hint = milli_hint(got)
        raise ValueError(f"must be {bound} {parameter.unit}{rigid}{hint and f'; {hint}'} {got}")
    if value > parameter.upper * (1 + 1e-12):
        raise ValueError(f"{parameter.hint or f'must be at most {parameter.upper:g} {parameter.unit}'} {got}")
    smallest, largest = parameter.plausible
    if value and not smallest * (1 - 1e-12) <= value <= largest * (1 + 1e-12):
        unit = parameter.example.partition(" ")[2]
        factor = float(unit_factor(unit)[0])
        zero = "0, or " if not parameter.above and not parameter.lower else ""
        raise ValueError(f"must be {zero}from {smallest / factor:g} to {largest / factor:g} {unit} {got}")


def milli_hint(text: str) -> str:
    """What to say of a unit in millinewtons, a slip of the shift key in this field; "" if there is none."""
    found = _MILLINEWTON.search(text)
    return f'"{found[0]}" is millinewtons: did you mean "M{found[0][1:]}"?' if found else ""


# --- single quantities and pairs -------------------------------------------------------------------


_KINDS = {int: "a bare number", float: "a bare number", bool: "a boolean", list: "a list", dict: "a table"}


def parse_quantity(parameter: Parameter, text: object) -> Quantity:
    """A quantity of the case file, such as "875 kN/m", checked for dimension and bounds.

    Raises ValueError, with the right spelling, for a bare number, a decimal comma, a missing,
    unknown or wrong unit, nan, or a value outside the parameter's bounds (see `parameters.Parameter`).
    """
    got = given(text)
    if not isinstance(text, str):
        kind = _KINDS.get(type(text), f"a {type(text).__name__}")
        raise ValueError(f'text with a unit is expected, such as "{parameter.example}", not {kind} {got}')
    number, unit = split_number(text, parameter.example, got)
    if number.is_infinite():
        value = float(number)
        if unit:  # "inf" needs none
            user_factor(parameter, unit, got)
    else:
        value = to_float(Fraction(number) * user_factor(parameter, unit, got), got)
    check_bounds(parameter, value, got)
    return Quantity(value, text.strip())


PAIRS = {
    "frequency": '["0.1 Hz", "100 Hz"] or "0.1:100 Hz"',
    "wavelength": '["1 m", "200 m"] or "1:200 m"',
    "cutoffs": '["0.0206 rad/m", "0.8246 rad/m"]',
}
"""Examples of the quantities that come in pairs."""


def parse_pair(parameter: Parameter, value: object) -> tuple[Quantity, Quantity]:
    """Two quantities, ["0.1 Hz", "100 Hz"] or, as on a command line, "0.1:100 Hz" or "0.1 Hz, 100 Hz"."""
    parts: list[object] = value if isinstance(value, list) else [value]
    if isinstance(value, str):
        # a unit serves both sides of a colon only: "1,5 Hz" may well be one number
        sides = value.split(":") if ":" in value else value.split(",")
        if ":" in value and len(sides) == 2 and not split_number(sides[0], parameter.example, given(value))[1]:
            sides[0] = f"{sides[0]} {split_number(sides[1], parameter.example, given(value))[1]}"
        parts = [*sides]
    if len(parts) != 2:
        example = PAIRS.get(parameter.name, f'["{parameter.example}", "{parameter.example}"]')
        raise ValueError(f"two quantities are expected, as in {example} {given(value)}")
    first, second = (parse_quantity(parameter, part) for part in parts)
    return first, second


# --- axes ------------------------------------------------------------------------------------------


# --- values of an axis -----------------------------------------------------------------------------


def shown_value(name: str, value: float) -> str:
    """An SI value in the unit its table entry shows, for messages: '250 km/h'."""
    parameter = PARAMETERS[name]
    unit = parameter.shown_unit or parameter.unit
    if math.isinf(value):
        return "inf"
    return f"{value / float(unit_factor(unit)[0]):.10g} {unit}"
