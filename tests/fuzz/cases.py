"""Changed case files and option strings: refused in so many words, or read as they are written."""

from __future__ import annotations

import contextlib
import faulthandler
import math
import re
import signal
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pint

import freqrail
from freqrail.case.case import Case, build_case
from freqrail.case.parameters import PARAMETERS, SWEEPABLE
from freqrail.case.shipped import shipped_cases
from freqrail.cli.tables import case_derived, mode_records, printable
from freqrail.errors import FreqrailError, FreqrailWarning
from freqrail.model.responses import RESPONSES
from freqrail.result.points import parse_point

SECONDS = 10  # that one input may take
SMALL = 1000  # grid points that are computed too, of one input in three

SHIPPED = shipped_cases()["yu-damper-joint"]
NAMES = (*PARAMETERS, "band", "title", "reference", "masses", "spectrum", "schema_version", "points")
NUMBERS = (
    "0",
    "-1",
    "1",
    "5",
    "0.5",
    "1e3",
    "1e-3",
    "1e308",
    "1e-308",
    "1e400",
    "nan",
    "inf",
    "-inf",
    "600,5",
    "1_000",
)
NUMBERS += (
    "1e-300",
    "1e300",
    "1e-9",
    "1e9",
    "0x10",
    "1e",
    "1.2.3",
    "٣",
    "1" * 40,
    "2*3",
    "1/3",
    "",
    "+5",
    "5.",
    ".5",
    "250",
    "1e15",
    "7e-9",
)
NUMBERS += ("1e-300", "1e300", "1e-9", "1e9")
UNITS = ("kg", "t", "kg*m^2", "N/m", "kN/m", "MN/m", "mN/m", "GN/m", "N*s/m", "kN*s/m", "km/h", "m/s", "m", "mm", "Hz")
UNITS += ("rad/m", "m^2*rad/m", "m/N^(2/3)", "", "kX", "ton", "dB", "degC", "m^9^9", "(m", "5 m", "lbf/inch", "µm", "%")
AXES = ("{0}:{1}:{2} {u}", "{0}, {1}, {2} {u}", "lin:{0}:{1}:{2} {u}", "log:{0}:{1}:{2} {u}", "{0} {u}", "{0}:{1} {u}")
TOKENS = (
    "\ufffe",
    "\uffff",
    "\U0001fffe",
    "\x0b",
    "\udcff",
    '"',
    "'",
    '"""',
    "=",
    "[",
    "]",
    "[[",
    "{",
    "}",
    "#",
    "\n",
    "\r",
    "\\",
    "\\u0000",
    "\x1b",
    "\0",
    "é",
    "\u2028",
)
TOKENS += ("\ufffe", "\uffff", "\U0001fffe", "\x0b", "\udcff")
TOKENS += (
    ".",
    ",",
    ":",
    "true",
    "1979-05-27",
    "[x]",
    "x = 1",
    "[a.b.c]",
    "inf",
    "nan",
    "0x" + "F" * 50,
    "\ufeff",
    "{}",
)


def quantity(rng: np.random.Generator) -> str:
    return f"{rng.choice(NUMBERS)} {rng.choice(UNITS)}"


def axis(rng: np.random.Generator) -> str:
    return str(rng.choice(AXES)).format(*rng.choice(NUMBERS, 3), u=rng.choice(UNITS))


def value(rng: np.random.Generator) -> str:
    """A TOML value: mostly text of a quantity or an axis, sometimes of another type."""
    kind = rng.integers(8)
    if kind < 3:
        return f'"{quantity(rng)}"'
    if kind < 5:
        return f'"{axis(rng)}"'
    if kind == 5:
        return f'["{quantity(rng)}", "{quantity(rng)}"]'
    return str(rng.choice([*NUMBERS, *TOKENS, f'[{{ speed = "{quantity(rng)}" }}]']))


def changed(rng: np.random.Generator, text: str) -> str:
    """The text with one to four changes, from a byte to a table."""
    for _ in range(rng.integers(1, 5)):
        lines = text.split("\n")
        at, place = int(rng.integers(len(lines))), int(rng.integers(len(text) + 1))
        keys = [i for i, line in enumerate(lines) if "=" in line]
        kind = int(rng.integers(10))
        if kind == 0:
            text = text[:place] + chr(int(rng.integers(1, 0x250))) + text[place + 1 :]
        elif kind == 1:
            text = text[:place] + text[place + int(rng.integers(1, 40)) :]
        elif kind == 2:
            text = text[:place] + str(rng.choice(TOKENS)) + text[place:]
        elif kind == 3:
            text = "\n".join(lines[:at] + lines[at + 1 :])
        elif kind == 4:
            text = "\n".join([*lines[: at + 1], lines[int(rng.integers(len(lines)))], *lines[at + 1 :]])
        elif kind == 5:
            text = text[:place] if rng.integers(4) == 0 else text
        elif kind == 6:
            numbers = list(re.finditer(r"\d+(?:\.\d+)?", text))
            if numbers:
                found = numbers[int(rng.integers(len(numbers)))]
                text = text[: found.start()] + str(rng.choice(NUMBERS)) + text[found.end() :]
        elif keys:
            key = keys[int(rng.integers(len(keys)))]
            lines[key] = f"{lines[key].split('=')[0]}= {value(rng)}"
            text = "\n".join(lines)
        if not text:
            break
    return text


def options(rng: np.random.Generator) -> tuple[dict[str, str], dict[str, str], str]:
    """Settings, axes and a point as options give them, right ones among the wrong."""
    settings = {str(rng.choice(NAMES)): quantity(rng) for _ in range(rng.integers(0, 3))}
    over = {str(rng.choice([*SWEEPABLE, "frequency", "sped"])): axis(rng) for _ in range(rng.integers(0, 3))}
    parts = [f"{rng.choice([*SWEEPABLE, 'sped', ''])}{rng.choice(['=', ' = ', ''])}{quantity(rng)}" for _ in range(2)]
    return settings, over, str(rng.choice([", ", ",", ";"])).join(parts)


def fuzz(count: int, seed: int) -> tuple[Counter[str], list[str]]:
    """({outcome: how many}, faults) of `count` changed case files, each with its options."""
    outcomes: Counter[str] = Counter()
    faults = []
    with warnings.catch_warnings(), limited():
        warnings.simplefilter("ignore", FreqrailWarning)
        warnings.filterwarnings("ignore", category=RuntimeWarning)
        for number in range(count):
            rng = np.random.default_rng((seed, number))
            text = changed(rng, SHIPPED) if rng.integers(4) else SHIPPED
            settings, over, point = options(rng) if rng.integers(2) else ({}, {}, "speed=250 km/h")
            faulthandler.dump_traceback_later(6 * SECONDS, exit=True)  # what no signal interrupts
            signal.alarm(SECONDS)
            try:
                outcomes[one(text, settings, over, point, compute=number % 3 == 0)] += 1
            except Exception as fault:
                outcomes["fault"] += 1
                last = traceback.extract_tb(fault.__traceback__)[-1]
                what = f"{type(fault).__name__}: {fault} (line {last.lineno} of {last.name})"
                faults.append(f"case {number}: {what}\n  settings {settings}\n  over {over}\n  point {point}")
            finally:
                signal.alarm(0)
    faulthandler.cancel_dump_traceback_later()
    return outcomes, faults


@contextlib.contextmanager
def limited() -> Iterator[None]:
    def too_long(*_: object) -> None:
        raise TimeoutError(f"took longer than {SECONDS} s")

    before = signal.signal(signal.SIGALRM, too_long)
    try:
        yield
    finally:
        signal.signal(signal.SIGALRM, before)


def one(text: str, settings: dict[str, str], over: dict[str, str], point: str, compute: bool) -> str:
    """The outcome of one input; raises for a fault."""
    with contextlib.suppress(FreqrailError):
        for name, found in parse_point(point).items():
            check_value(name, found.text, found.value)
    try:
        case = build_case(text, settings, over, file="F")
    except FreqrailError as refusal:
        for problem in refusal.problems:
            assert problem.startswith(("F: ", "--set ", "--over ")), f"names no place: {problem!r}"
            assert len(problem) < 600, f"too long: {problem!r}"
            assert "\n" not in printable(problem.replace("\n", "\\n")), f"more than a line: {problem!r}"
        return "refused"
    check_case(case)
    case_derived(case)
    with contextlib.suppress(FreqrailError):  # numbers too far apart for double precision
        mode_records(case)
    if not compute or math.prod(a.values.size for a in case.axes) > SMALL:
        return "accepted"
    result = freqrail.sweep(case)
    for prefix in ("", "traditional_"):
        status = result[f"{prefix}status"]
        whole = np.ones(status.shape, dtype=bool)
        for name in (f"{prefix}{response}_rms" for response in RESPONSES if f"{prefix}{response}_rms" in result):
            values, errors = result[name].values, result[f"{name}_relative_error"].values
            whole &= np.isfinite(values).reshape(*status.shape, -1).all(axis=-1)
            assert np.array_equal(np.isfinite(values), errors <= 1e-6), f"{name}: a number without a promise"
            assert not np.any(values < 0), f"{name}: below 0"
        assert np.array_equal(whole, status.values == 0), f"{prefix}status: does not fit the numbers"
    return "computed"


def check_case(case: Case) -> None:
    """Every number of a case is the one that its text says, and the case written out is the same case."""
    again = build_case(case.effective, file="F", stray_points=True)
    for name, found in case.quantities.items():
        assert again.quantities[name].value == found.value, f"{name}: another value when written out"
        check_value(name, found.text, found.value)
    assert [a.si.tolist() for a in again.axes] == [a.si.tolist() for a in case.axes], "other axes when written out"
    assert (again.band, again.spectrum, again.title) == (case.band, case.spectrum, case.title), "another case"
    for found in case.axes:
        assert np.all(np.diff(found.si[np.isfinite(found.si)]) > 0), f"{found.name}: does not increase"
        first = re.match(r"(?:lin:|log:)?\s*([^:,\s]+)", found.text)[1]
        last = re.split("[:,]", found.text)[-1]
        unit = re.fullmatch(r"\s*(?:[+-]?(?:[\d.]+(?:[eE][+-]?\d+)?|inf))\s*(.*?)\s*", last)[1]
        check_value(found.name, f"{first} {unit}", found.si[0])
        with contextlib.suppress(ValueError):
            assert found.values[0] * factor(found.unit) == np.float64(found.si[0]) or np.isclose(
                found.values[0] * factor(found.unit), found.si[0], rtol=1e-12, atol=0
            ), f"{found.name}: coordinate and SI value differ"


_PINT = pint.UnitRegistry()
_FACTORS: dict[str, float] = {}


def factor(unit: str) -> float:
    """To SI, by pint's own floats."""
    if unit not in _FACTORS:
        _FACTORS[unit] = float((1.0 * _PINT.Unit(unit)).to_base_units().magnitude)
    return _FACTORS[unit]


def check_value(name: str, text: str, found: float) -> None:
    """An accepted value against another way of reading it: float for the number, pint's floats for the unit."""
    number, unit = re.fullmatch(r"\s*([+-]?(?:[\d.]+(?:[eE][+-]?\d+)?|inf))\s*(.*?)\s*", text, re.DOTALL).groups()
    expected = float(number) * (factor(unit) if unit else 1.0)
    assert found == expected or math.isclose(found, expected, rel_tol=1e-12), f"{name}: {text!r} read as {found!r}"
    parameter = PARAMETERS[name]
    assert parameter.lower <= found <= parameter.upper * (1 + 1e-9), f"{name}: {text!r} is out of bounds"
    low, high = parameter.plausible
    inside = low * (1 - 1e-9) <= found <= high * (1 + 1e-9)
    assert inside or found == 0 or (parameter.infinite and math.isinf(found)), f"{name}: {text!r} is out of its range"
