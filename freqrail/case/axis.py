"""Swept axes: text such as "100:300:10 km/h" to values in the unit of the user and in SI."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from freqrail.case.parameters import Parameter
from freqrail.case.quantities import PLAIN, check_bounds, split_number, to_float, unit_factor, user_factor
from freqrail.text import given

LARGEST_AXIS = 10_000_000
"""Most values an axis may have."""


SAME = 1e-9
"""Relative distance below which two values are taken for one, such as a point's and the grid's own."""


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


@dataclass(frozen=True)
class _Values:
    """The finite values of an axis in the user's unit, exactly: numerators over one denominator."""

    numerators: Sequence[int]
    denominator: int

    def times(self, ratio: Fraction, got: str) -> NDArray[np.float64]:
        """The values times `ratio`, each rounded once: Python divides integers to the nearest float."""
        scale = ratio / self.denominator
        p, q = scale.numerator, scale.denominator
        for end in (self.numerators[0], self.numerators[-1]):
            to_float(Fraction(end) * scale, got)
        try:
            return np.fromiter((n * p / q for n in self.numerators), float, len(self.numerators))
        except OverflowError:  # inside a list that does not increase
            raise ValueError(f"a number beyond what double precision holds {got}") from None


def parse_axis(parameter: Parameter, text: object) -> Axis:
    """A swept axis: "START:STOP:STEP UNIT", "a, b, c UNIT", "lin:START:STOP:COUNT UNIT" or "log:...".

    STOP is included; a STOP off the step is an error. Values are formed exactly and rounded once, in
    the coordinate's unit (`Parameter.shown_unit`, or the unit the user wrote). Raises ValueError.
    """
    got = given(text)
    if not isinstance(text, str):
        raise ValueError(f'an axis is text such as "{_axis_example(parameter)}" {got}')
    written = _read(parameter, text.strip(), got)
    factor = user_factor(parameter, written.unit or (parameter.unit if written.rigid else ""), got)
    shown = parameter.shown_unit or written.unit or parameter.unit
    exact = _exact_values(written, got)
    end = [math.inf] if written.rigid else []
    ratios = (factor / unit_factor(shown)[0], factor)
    values, si = (np.append(exact.times(r, got) if exact.numerators else np.empty(0), end) for r in ratios)
    _check_increasing(values, si, got)
    for value in (*si[:2], *si[-2:]):  # they increase; the first may be 0 and the last inf
        check_bounds(parameter, float(value), got)
    return Axis(parameter.name, values, shown, si, text.strip())


@dataclass(frozen=True)
class _Written:
    """An axis as it is written: its form, "lin", "log", "step" or "list", its finite numbers, its unit ("" if it has
    none, and needs none), and whether the rigid joint, inf, ends the list."""

    form: str
    numbers: list[Decimal]
    unit: str
    rigid: bool


def _read(parameter: Parameter, body: str, got: str) -> _Written:
    """The numbers and the unit of an axis. Raises ValueError for what cannot be read."""
    example = _axis_example(parameter)
    form, parts = _parts(body, example, got)
    numbers = []
    unit = ""
    for place, part in enumerate(parts):
        number, unit = split_number(part, example, got)
        if unit and place < len(parts) - 1:
            raise ValueError(f'one unit, at the end, such as "{example}" {got}')
        numbers.append(number)
    rigid = form == "list" and numbers[-1] == Decimal("inf")
    finite = numbers[:-1] if rigid else numbers
    if not all(n.is_finite() for n in finite):
        raise ValueError(f"inf can only end a list of values {got}")
    if not unit and finite and parameter.unit not in PLAIN:
        raise ValueError(f'a unit is missing at the end: write it as in "{example}" {got}')
    return _Written(form, finite, unit, rigid)


def _parts(body: str, example: str, got: str) -> tuple[str, list[str]]:
    """The form of an axis (see `_Written`) and the texts of its numbers."""
    form = body[:3] if body[:4] in ("lin:", "log:") else "step" if ":" in body else "list"
    parts = body[4:].split(":") if form in ("lin", "log") else body.split(":" if form == "step" else ",")
    if form != "list" and len(parts) != 3:
        right = "START:STOP:STEP UNIT" if form == "step" else f"{form}:START:STOP:COUNT UNIT"
        raise ValueError(f'an axis of the form "{right}" has three numbers, such as "{example}" {got}')
    if len(parts) > LARGEST_AXIS:
        raise _too_many(Decimal(len(parts)), got)
    if re.search(r"\d,\d", body) and re.search(r"\d,[ \t]", body):  # "0,5, 1 MN/m" would be 0, 5 and 1
        raise ValueError(f"a decimal comma? write a point, or a blank after every comma {got}")
    return form, parts


def _exact_values(written: _Written, got: str) -> _Values:
    if written.form == "list":
        return _exactly([Fraction(n) for n in written.numbers])
    if written.form == "step":
        return _stepped(written.numbers, got)
    return _spaced(written.form, written.numbers, got)


def _check_increasing(values: NDArray[np.float64], si: NDArray[np.float64], got: str) -> None:
    """Raise ValueError unless values, in either unit, strictly increase."""
    for array in (values, si):
        if np.any(array[1:] <= array[:-1]):
            at = int(np.argmax(array[1:] <= array[:-1]))
            raise ValueError(f"values must strictly increase, {values[at + 1]:g} follows {values[at]:g} {got}")


def _axis_example(parameter: Parameter) -> str:
    return {"speed": "100:300:10 km/h", "frequency": "log:0.1:100:400 Hz"}.get(
        parameter.name, f"1, 2, 5 {parameter.example.partition(' ')[2]}".rstrip()
    )


def _too_many(count: Decimal, got: str) -> ValueError:
    size = f"{count:.3g}" if count > 1e15 else int(count)
    return ValueError(f"an axis of {size} values exceeds the limit of {LARGEST_AXIS} {got}")


def _exactly(values: list[Fraction]) -> _Values:
    common = math.lcm(*(v.denominator for v in values))
    return _Values([v.numerator * (common // v.denominator) for v in values], common)


def _progression(start: Fraction, step: Fraction, count: int) -> _Values:
    common = math.lcm(start.denominator, step.denominator)
    first, by = int(start * common), int(step * common)
    return _Values(range(first, first + by * count, by) if count > 1 else [first], common)


def _stepped(numbers: list[Decimal], got: str) -> _Values:
    start, stop, step = map(Fraction, numbers)
    if start > stop:
        raise ValueError(f"START must not exceed STOP {got}")
    if step <= 0:
        raise ValueError(f"STEP must be positive {got}")
    steps = (stop - start) / step
    if steps >= LARGEST_AXIS:
        raise _too_many(Decimal(math.floor(steps)) + 1, got)
    if steps.denominator != 1:
        last = start + step * math.floor(steps)
        raise ValueError(f"STOP lies off the step: the last value would be {float(last):g} {got}")
    return _progression(start, step, int(steps) + 1)


def _spaced(spacing: str, numbers: list[Decimal], got: str) -> _Values:
    start, stop = Fraction(numbers[0]), Fraction(numbers[1])
    if numbers[2] != numbers[2].to_integral_value() or numbers[2] < 1:
        raise ValueError(f"COUNT must be a whole number, at least 1 {got}")
    if numbers[2] > LARGEST_AXIS:
        raise _too_many(numbers[2], got)
    count = int(numbers[2])
    if start > stop or (start == stop) != (count == 1):
        raise ValueError(f"START must be less than STOP, and equal to it with COUNT 1 only {got}")
    if spacing == "lin":
        return _progression(start, (stop - start) / max(1, count - 1), count)
    if start <= 0:
        raise ValueError(f"a log axis starts above 0 {got}")
    # the ends are the user's own, the values between them are rounded to 12 digits so that they can be typed
    inner = np.geomspace(float(start), float(stop), count)[1:-1]
    places = max(0, 12 - numbers[0].adjusted(), *(-int(n.as_tuple().exponent) for n in numbers[:2]))
    shifted = (int(Decimal(f"{v:.12g}").scaleb(places)) for v in inner)
    ends = [int(n * 10**places) for n in (start, stop)]
    return _Values([ends[0], *shifted, *ends[1 : min(count, 2)]], 10**places)


def is_same(a: float, b: float) -> bool:
    """Whether two values, both in SI units, are one but for rounding."""
    return math.isclose(a, b, rel_tol=SAME)


def nearest(values: NDArray[np.float64], value: float) -> int:
    """Index of the value nearest to `value`, by ratio; inf is nearest to the largest."""
    if math.isinf(value):
        return int(values.size - 1)
    if np.any(values == value):
        return int(np.argmax(values == value))
    with np.errstate(divide="ignore"):
        return int(np.argmin(np.abs(np.log(values / value))))
