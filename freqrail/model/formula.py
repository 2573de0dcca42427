"""A law as a formula: letters for elements, - in series, | in parallel, brackets; "k | (K - c - K)"."""

from __future__ import annotations

import re
from collections.abc import Mapping

from freqrail.model.elements import Law, Parallel, Series

_TOKEN = re.compile(r"\s*([A-Za-z_][A-Za-z_0-9]*|[-|()])")
_OPERATORS = {"|": "parallel", "-": "series"}


def parse_law(text: str, elements: Mapping[str, Law]) -> Law:
    """The law of a formula whose letters are the keys of `elements`.

    Operators of two kinds need brackets between them: "k | K - c" is refused, for it can be read in two ways.
    Raises ValueError that says what is wrong at which place, and what is expected there.
    """
    tokens, position = [], 0
    while text[position:].strip():
        match = _TOKEN.match(text, position)
        if match is None:
            start = position + len(text[position:]) - len(text[position:].lstrip())
            raise _fault(text, start, f"unexpected character {text[start]!r}; expected a letter, -, | or a bracket")
        tokens.append((match.group(1), match.start(1)))
        position = match.end()
    tokens.append(("", len(text)))
    law, rest = _chain(text, tokens, elements)
    if rest[0][0] == ")":
        raise _fault(text, rest[0][1], "a bracket is closed that was not opened")
    if rest[0][0]:
        raise _fault(text, rest[0][1], f"expected - or | before {rest[0][0]!r}")
    return law


Tokens = list[tuple[str, int]]


def _chain(text: str, tokens: Tokens, elements: Mapping[str, Law]) -> tuple[Law, Tokens]:
    first, tokens = _operand(text, tokens, elements)
    parts, operator = [first], ""
    while tokens[0][0] in _OPERATORS:
        token, place = tokens[0]
        if operator and token != operator:
            both = f"- ({_OPERATORS['-']}) and | ({_OPERATORS['|']})"
            raise _fault(text, place, f"{both} beside each other can be read in two ways; put brackets around one")
        operator = token
        part, tokens = _operand(text, tokens[1:], elements)
        parts.append(part)
    if not operator:
        return first, tokens
    return (Parallel if operator == "|" else Series)(tuple(parts)), tokens


def _operand(text: str, tokens: Tokens, elements: Mapping[str, Law]) -> tuple[Law, Tokens]:
    token, place = tokens[0]
    if token == "(":
        law, tokens = _chain(text, tokens[1:], elements)
        if tokens[0][0] != ")":
            what = f"expected ) or an operator, got {tokens[0][0]!r}" if tokens[0][0] else "a bracket is not closed"
            raise _fault(text, tokens[0][1], what)
        return law, tokens[1:]
    if token in elements:
        return elements[token], tokens[1:]
    if token and token not in {*_OPERATORS, ")"}:
        raise _fault(text, place, f"unknown element {token!r}; there are {', '.join(elements) or 'none'}")
    got = f", got {token!r}" if token else ", the formula ends"
    raise _fault(text, place, f"expected an element or ({got}")


def _fault(text: str, place: int, what: str) -> ValueError:
    return ValueError(f"law {text!r}, character {place + 1}: {what}")
