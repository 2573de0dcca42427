"""Words and numbers for messages, tables and figures."""

from __future__ import annotations

import math


def printable(text: str) -> str:
    """Text with its control characters escaped, so that none reaches a terminal or a figure; lines stay lines."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


def given(value: object) -> str:
    """What the user gave, short enough for a message: (got "5 kN*s/m") or (got 5)."""
    try:
        text = f'"{value}"' if isinstance(value, str) and value.isprintable() else repr(value)
    except (ValueError, RecursionError):  # an integer of 5000 digits, tables nested 3000 deep
        text = f"a very large {type(value).__name__}"
    return f"(got {text})" if len(text) <= 80 else f"(got {text[:60]}... of {len(text)} characters)"


def shown_bytes(number: float) -> str:
    """A number of bytes, as people read it."""
    for unit in ("B", "kB", "MB"):
        if number < 1000:
            return f"{number:.3g} {unit}"
        number /= 1000
    return f"{number:.3g} GB"


def number(value: float, digits: int = 4) -> str:
    """A number in `digits` significant digits; whole numbers below ten million plain."""
    if not math.isfinite(value):
        return str(value)
    if value == round(value, 0) and abs(value) < 1e7:
        return f"{value + 0.0:.0f}"  # no minus before a zero
    return f"{value:.{digits}g}"


def counted(number: int, what: str) -> str:
    """A number of things, in the plural but for one."""
    return f"{number} {what}{'' if number == 1 else 's'}"
