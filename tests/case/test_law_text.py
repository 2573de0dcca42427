"""Laws as text: what is parallel, what is in series, and what cannot be read, with its place."""

import pytest

from freqrail.case.law_text import Joined, Letter, letters, parse_law

K, C, J = Letter("k"), Letter("c"), Letter("K")


def test_a_law_is_a_tree_of_letters():
    assert parse_law("k|(K-c-K)") == Joined("|", (K, Joined("-", (J, C, J))))
    assert parse_law(" ( k ) ") == K
    assert parse_law("k | c | (K - c)").parts[:2] == (K, C)
    assert letters(parse_law("k | (K - c - K)")) == ("k", "K", "c")
    assert letters(parse_law("H - (m | ((kp | cp) - (ms | kb | cb)))")) == ("H", "m", "kp", "cp", "ms", "kb", "cb")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a law is text such as"),
        (5, "a law is text such as"),
        ("k |", "ends where a letter or a bracket is expected"),
        ("k | | c", r"'|' at character 5: a letter or a bracket is expected"),
        ("k (c)", r"'(' at character 3: | or - is expected before it"),
        ("(k | c", "the bracket at character 1 does not close"),
        ("k | c)", "')' at character 6: closes a bracket that is not open"),
        ("k | c - K", "'-' at character 7: brackets are expected where | and - meet"),
        ("k + c", "'+' at character 3 is none of letters"),
        ("3 | c", "'3' at character 1 is none of letters"),
        ("k" * 501, "too long for a law"),
        ("(" * 400 + "k", "does not close"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(text, words):
    with pytest.raises(ValueError, match=r".") as caught:
        parse_law(text)
    assert words in str(caught.value)
