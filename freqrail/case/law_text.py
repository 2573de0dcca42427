"""Laws of suspension elements as text, "k | (K - c - K)", to trees of letters.

`|` joins what stands side by side (parallel), `-` what stands one behind the other (series); brackets say which comes
first wherever both occur, for neither binds tighter. A letter is a key of the table that the law stands in.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from freqrail.model.elements import Law, Parallel, Series
from freqrail.text import given

LONGEST_LAW = 500
"""Most characters of a law; no true one comes near."""

_TOKEN = re.compile(r"\s*(?:([A-Za-z][A-Za-z0-9_]*)|([()|-]))", re.ASCII)
_EXAMPLE = "k | (K - c - K)"


@dataclass(frozen=True)
class Letter:
    """An element: its key."""

    name: str


@dataclass(frozen=True)
class Joined:
    """Parts side by side ("|") or one behind the other ("-")."""

    sign: str
    parts: tuple[Tree, ...]


Tree = Letter | Joined


def parse_law(text: object) -> Tree:
    """The tree of a law. Raises ValueError for what is none, with the place in the text."""
    got = given(text)
    if not isinstance(text, str) or not text.strip():
        raise ValueError(f'a law is text such as "{_EXAMPLE}" {got}')
    if len(text) > LONGEST_LAW:
        raise ValueError(f'too long for a law such as "{_EXAMPLE}", limit {LONGEST_LAW} characters {got}')
    tokens: list[tuple[str, int]] = []
    place = 0
    while text[place:].strip():
        found = _TOKEN.match(text, place)
        if not found:
            at = place + len(text[place:]) - len(text[place:].lstrip())
            raise ValueError(
                f"{text[at]!r} at character {at + 1} is none of letters, | (parallel), - (series) and brackets; "
                f'a law is text such as "{_EXAMPLE}" {got}'
            )
        tokens.append((found[1] or found[2], found.end() - len(found[1] or found[2])))
        place = found.end()
    return _Parser(tokens, got).law()


def law_of(tree: Tree, elements: Mapping[str, Law]) -> Law:
    """The law of a tree. elements: by letter, all of them."""
    if isinstance(tree, Letter):
        return elements[tree.name]
    parts = tuple(law_of(part, elements) for part in tree.parts)
    return Parallel(parts) if tree.sign == "|" else Series(parts)


def letters(tree: Tree) -> tuple[str, ...]:
    """The letters of a law, each once, in the order in which they stand."""
    if isinstance(tree, Letter):
        return (tree.name,)
    return tuple(dict.fromkeys(name for part in tree.parts for name in letters(part)))


class _Parser:
    """Reads one law from its tokens, (text, place)."""

    def __init__(self, tokens: list[tuple[str, int]], got: str) -> None:
        self.tokens = tokens
        self.next = 0
        self.got = got

    def law(self) -> Tree:
        tree = self.joined(0)
        if self.next < len(self.tokens):
            token, place = self.tokens[self.next]
            raise ValueError(f"{token!r} at character {place + 1}: {self.stray(token)} {self.got}")
        return tree

    def stray(self, token: str) -> str:
        return "closes a bracket that is not open" if token == ")" else "| or - is expected before it"

    def peek(self) -> str:
        return self.tokens[self.next][0] if self.next < len(self.tokens) else ""

    def joined(self, depth: int) -> Tree:
        """Parts with one sign between them."""
        parts = [self.part(depth)]
        sign = ""
        while self.peek() in ("|", "-"):
            token, place = self.tokens[self.next]
            if sign and token != sign:
                raise ValueError(
                    f"{token!r} at character {place + 1}: brackets are expected where | and - meet, as in "
                    f'"{_EXAMPLE}" {self.got}'
                )
            sign = token
            self.next += 1
            parts.append(self.part(depth))
        return Joined(sign, tuple(parts)) if sign else parts[0]

    def part(self, depth: int) -> Tree:
        if self.next == len(self.tokens):
            raise ValueError(f"ends where a letter or a bracket is expected {self.got}")
        token, place = self.tokens[self.next]
        self.next += 1
        if token not in ("(", ")", "|", "-"):
            return Letter(token)
        if token != "(":
            raise ValueError(f"{token!r} at character {place + 1}: a letter or a bracket is expected {self.got}")
        tree = self.joined(depth + 1)
        if self.peek() != ")":
            raise ValueError(f"the bracket at character {place + 1} does not close {self.got}")
        self.next += 1
        return tree
