"""Quantities and axes: text such as "875 kN/m" or "100:300:10 km/h" to numbers in SI units.

One regular expression takes the number and pint takes the unit alone, because pint alone reads
"600,5 kg" as 6005 kg and "2*3 kg" as 6 kg. Numbers stay exact (decimal, then rational) until the
last step, so that an axis value is the float that the user would type. Every fault is a ValueError
whose text says what is wrong, what was given and what would be right.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.names import PARAMETERS, Parameter

LARGEST_AXIS = 10_000_000
"""Most values an axis may have."""

_NUMBER = re.compile(
    r"\s*([+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf))(?![\d.])\s*(.*?)\s*", re.ASCII | re.DOTALL
)
_UNIT = re.compile(r"[A-Za-zµμ][A-Za-zµμ0-9 */^().·²³-]*")
_HOSTILE_UNIT = re.compile(r"\d{3}|[\^*]\s*[\^*(].*[\^]|\*\*")


@dataclass(frozen=True)
class Quantity:
    """A number with a unit: `value` in SI, `text` as the user wrote it."""

    value: float
    text: str


@dataclass(frozen=True, eq=False)
class Axis:
    """The values of a swept parameter.

    values: in `unit`, which the dataset's coordinate bears; si: the same in SI units. Both [n],
    strictly increasing; inf only last. text: as the user wrote it.
    """

    name: str
    values: NDArray[np.float64]
    unit: str
    si: NDArray[np.float64]
    text: str


Formed = Callable[[Fraction], NDArray[np.float64]]
"""The values of an axis once the ratio of units is known."""


@functools.cache
def _registry() -> Any:
    import pint  # takes a third of a second: only where a unit is read

    return pint.UnitRegistry(non_int_type=Fraction)


@functools.cache
def unit_factor(unit: str) -> tuple[Fraction, Any]:
    """(exact factor from `unit` to SI, its dimensions). Raises ValueError for an unknown unit."""
    if not _UNIT.fullmatch(unit) or _HOSTILE_UNIT.search(unit) or len(unit) > 40:
        raise ValueError(f"not a unit: {unit!r}")
    try:
        registry = _registry()
        parsed = registry.parse_units(unit)
        factor, _ = registry.get_base_units(parsed)
        # a root such as N^(2/3) leaves a float with a rounding error in its last digits
        return Fraction(f"{factor:.14g}" if isinstance(factor, float) else factor), parsed.dimensionality
    except Exception as fault:  # pint raises a dozen kinds, some from its tokenizer
        raise ValueError(f"unknown unit {unit!r}") from fault


def split_number(text: str, example: str) -> tuple[Decimal, str]:
    """The number at the head of `text`, exactly, and the rest. Raises ValueError if there is none."""
    match = _NUMBER.fullmatch(text)
    if re.match(r"\s*[+-]?\d*,\d", text):
        raise ValueError(f'a decimal comma: write a point, as in "{example}" (got "{text}")')
    if not match:
        raise ValueError(f'not a number with a unit such as "{example}" (got "{text}")')
    number = Decimal(match[1])
    if number.is_finite() and (math.isinf(float(number)) or (number != 0 and float(number) == 0)):
        raise ValueError(f'a number beyond what double precision holds (got "{text}")')
    return number, match[2]


def _float(exact: Any) -> float:
    """A rational or infinite number as the nearest float; inf where it is too large for one."""
    try:
        return float(exact)
    except OverflowError:
        return math.inf if exact > 0 else -math.inf


def _exact(number: Decimal) -> Any:
    return float(number) if number.is_infinite() else Fraction(number)


def _factor(parameter: Parameter, unit: str, text: str) -> Fraction:
    """Exact factor of the user's unit, after checking that it is there and of the right dimension."""
    if not unit:
        raise ValueError(f'a unit is missing: write it as in "{parameter.example}" (got "{text}")')
    try:
        factor, dimension = unit_factor(unit)
    except ValueError as fault:
        raise ValueError(f'{fault}: a {parameter.kind} such as "{parameter.example}" is due (got "{text}")') from None
    if dimension != unit_factor(parameter.unit)[1]:
        raise ValueError(
            f"wrong dimension: a {parameter.kind} in {parameter.unit}, such as "
            f'"{parameter.example}", is due (got "{text}")'
        )
    return factor


def _check(parameter: Parameter, number: Decimal, value: float, text: str) -> None:
    """Raise ValueError if a value is outside the parameter's bounds."""
    if math.isinf(value) and parameter.infinite and value > 0:
        return
    if math.isinf(value):
        raise ValueError(f'{"inf is not allowed here" if number.is_infinite() else "too large"} (got "{text}")')
    low = value <= parameter.lower if parameter.above else value < parameter.lower
    if low:
        bound = f"greater than {parameter.lower:g}" if parameter.above else f"at least {parameter.lower:g}"
        rigid = ', or "inf" for a rigid joint' if parameter.infinite else ""
        raise ValueError(f'must be {bound} {parameter.unit}{rigid} (got "{text}")')
    if value > parameter.upper * (1 + 1e-12):
        raise ValueError(f'{parameter.hint or f"must be at most {parameter.upper:g} {parameter.unit}"} (got "{text}")')


def parse_quantity(parameter: Parameter, text: object) -> Quantity:
    """A quantity of the case file, such as "875 kN/m", checked for dimension and bounds.

    Raises ValueError, with the right spelling, for a bare number, a decimal comma, a missing,
    unknown or wrong unit, nan, or a value outside the parameter's bounds (see `names.Parameter`).
    """
    if isinstance(text, bool) or not isinstance(text, str):
        kind = "a bare number" if isinstance(text, int | float) and not isinstance(text, bool) else type(text).__name__
        raise ValueError(f'text with a unit is due, such as "{parameter.example}", not {kind} (got {text!r})')
    if text.strip().lower() in ("nan", "+nan", "-nan") or text.strip().lower().startswith("nan "):
        raise ValueError(f'not a number (got "{text}")')
    number, unit = split_number(text, parameter.example)
    rigid = number.is_infinite() and not unit and parameter.infinite
    factor = Fraction(1) if rigid else _factor(parameter, unit, text)
    value = _float(_exact(number) * factor)
    _check(parameter, number, value, text)
    return Quantity(value, text.strip())


def parse_pair(parameter: Parameter, value: object) -> tuple[Quantity, Quantity]:
    """Two quantities, ["0.1 Hz", "100 Hz"] or, as on a command line, "0.1:100 Hz" or "0.1 Hz, 100 Hz"."""
    parts: list[object]
    if isinstance(value, str):
        sides = re.split(r"[:,]", value)
        if len(sides) == 2 and _NUMBER.fullmatch(sides[0]) and not split_number(sides[0], "")[1]:
            unit = split_number(sides[1], f"{sides[0]}:{parameter.example}")[1]
            sides[0] = f"{sides[0]} {unit}"
        parts = list(sides)
    else:
        parts = value if isinstance(value, list) else [value]
    if len(parts) != 2:
        raise ValueError(f'two quantities are due, such as ["{parameter.example}", "..."] (got {value!r})')
    first, second = (parse_quantity(parameter, part) for part in parts)
    return first, second


def parse_axis(parameter: Parameter, text: object) -> Axis:
    """A swept axis: "START:STOP:STEP UNIT", "a, b, c UNIT", "lin:START:STOP:COUNT UNIT" or "log:...".

    STOP is included; a STOP off the step is an error. Values are formed exactly and rounded once, in
    the coordinate's unit (`Parameter.shown_unit`, or the unit the user wrote). Raises ValueError.
    """
    example = f'"{_axis_example(parameter)}"'
    if not isinstance(text, str):
        raise ValueError(f"an axis is text such as {example} (got {text!r})")
    body = text.strip()
    spacing = body[:3] if body[:4] in ("lin:", "log:") else ""
    parts = re.split(r"[:]" if ":" in body else r"[,]", body[4:] if spacing else body)
    if ":" in body and len(parts) != 3:
        form = f"{spacing}:START:STOP:COUNT UNIT" if spacing else "START:STOP:STEP UNIT"
        raise ValueError(f'an axis of the form "{form}" has three numbers, such as {example} (got "{text}")')
    numbers = []
    for place, part in enumerate(parts):
        number, unit = split_number(part, _axis_example(parameter))
        if unit and place < len(parts) - 1:
            raise ValueError(f'one unit, at the end, such as {example} (got "{text}")')
        numbers.append(number)
    if not unit and not (number.is_infinite() and parameter.infinite and len(numbers) == 1):
        raise ValueError(f'a unit is missing at the end: write it as in {example} (got "{text}")')
    unit = unit or parameter.unit
    factor = _factor(parameter, unit, text)
    shown = parameter.shown_unit or unit
    if spacing:
        formed = _spaced(spacing, numbers, text)
    elif ":" in body:
        formed = _stepped(numbers, text)
    else:
        formed = partial(_listed, numbers)
    values, si = formed(factor / unit_factor(shown)[0]), formed(factor)
    if np.any(np.diff(values) <= 0):
        at = int(np.argmax(np.diff(values) <= 0))
        raise ValueError(f'values must strictly increase, {values[at + 1]:g} follows {values[at]:g} (got "{text}")')
    for value in (si[0], si[-1], *si[np.isinf(si)]):
        _check(parameter, Decimal(float(value)), float(value), text)
    return Axis(parameter.name, values, shown, si, body)


def _axis_example(parameter: Parameter) -> str:
    return {"speed": "100:300:10 km/h", "frequency": "log:0.1:100:400 Hz"}.get(
        parameter.name, f"1, 2, 5 {parameter.example.split(' ', 1)[1]}"
    )


def _listed(numbers: list[Decimal], ratio: Fraction) -> NDArray[np.float64]:
    return np.array([_float(_exact(n) * ratio) for n in numbers])


def _arithmetic(start: Fraction, step: Fraction, count: int, ratio: Fraction) -> NDArray[np.float64]:
    """start + i step for i < count, times `ratio`, each value exact and rounded once."""
    first, by = start * ratio, step * ratio
    common = math.lcm(first.denominator, by.denominator)
    a, b = int(first * common), int(by * common)
    if max(abs(a) + abs(b) * count, common) < 2**53:  # integers that doubles hold: one correctly rounded division
        return (a + b * np.arange(count)) / common
    return np.array([_float(first + by * i) for i in range(count)])


def _geometric(start: Fraction, stop: Fraction, count: int, ratio: Fraction) -> NDArray[np.float64]:
    """Log-spaced values, the ends exact and the rest rounded to 12 digits, times `ratio`."""
    values = np.geomspace(float(start), float(stop), count)
    digits = 10.0 ** (11 - np.floor(np.log10(values)))
    values = np.round(values * digits) / digits * float(ratio)
    values[[0, -1]] = _float(start * ratio), _float(stop * ratio)
    return values


def _stepped(numbers: list[Decimal], text: str) -> Formed:
    if not all(n.is_finite() for n in numbers):
        raise ValueError(f'inf can only end a list of values (got "{text}")')
    start, stop, step = (Fraction(n) for n in numbers)
    if step == 0 or (step < 0 and stop > start):
        raise ValueError(f'STEP must be positive (got "{text}")')
    if start > stop:
        raise ValueError(f'START must not exceed STOP (got "{text}")')
    steps = (stop - start) / step
    if steps < 0:
        raise ValueError(f'STEP must be positive (got "{text}")')
    if steps >= LARGEST_AXIS:
        raise ValueError(f'an axis of {float(steps) + 1:.3g} values exceeds the limit of {LARGEST_AXIS} (got "{text}")')
    if steps.denominator != 1:
        last = start + step * math.floor(steps)
        raise ValueError(f'STOP lies off the step: the last value would be {float(last):g} (got "{text}")')
    return partial(_arithmetic, start, step, int(steps) + 1)


def _spaced(spacing: str, numbers: list[Decimal], text: str) -> Formed:
    if not all(n.is_finite() for n in numbers):
        raise ValueError(f'inf can only end a list of values (got "{text}")')
    start, stop = Fraction(numbers[0]), Fraction(numbers[1])
    if numbers[2] != numbers[2].to_integral_value() or numbers[2] < 1:
        raise ValueError(f'COUNT must be a whole number, at least 1 (got "{text}")')
    if numbers[2] > LARGEST_AXIS:
        raise ValueError(f'an axis of {numbers[2]} values exceeds the limit of {LARGEST_AXIS} (got "{text}")')
    count = int(numbers[2])
    if start > stop or (start == stop) != (count == 1):
        raise ValueError(f'START must be less than STOP, and equal to it with COUNT 1 only (got "{text}")')
    if spacing == "log":
        if start <= 0:
            raise ValueError(f'a log axis starts above 0 (got "{text}")')
        return partial(_geometric, start, stop, count)
    return partial(_arithmetic, start, (stop - start) / max(1, count - 1), count)


def shown_value(name: str, value: float) -> str:
    """An SI value in the unit its table entry shows, for messages: '250 km/h'."""
    parameter = PARAMETERS[name]
    unit = parameter.shown_unit or parameter.unit
    if math.isinf(value):
        return "inf"
    return f"{value / float(unit_factor(unit)[0]):.10g} {unit}"
