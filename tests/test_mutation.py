"""The explanations in mutation.md: each names a mutant that exists, and new line breaks orphan none."""

from __future__ import annotations

import ast
import io
import itertools
import tokenize
from pathlib import Path

import pytest

from tests import mutation

EXPLANATIONS = mutation.MUTATION.read_text(encoding="utf-8")


def labels(tree: ast.Module) -> list[mutation.Label]:
    return [mutant.label for mutant in mutation.mutants(tree)]


def split(source: str) -> str:
    """A source with a line for everything between brackets and commas, as formatters split what is too long."""
    lines, breaks, depth = source.splitlines(keepends=True), [], 0
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.OP:
            depth += (token.string in "([{") - (token.string in ")]}")
            if token.string in "([{" or (token.string == "," and depth):
                breaks.append(token.end)
    for row, column in reversed(breaks):
        lines[row - 1] = lines[row - 1][:column] + "\n" + lines[row - 1][column:]
    return "".join(lines)


def commented(source: str) -> str:
    """A source with other comments, which are no part of a statement, and one more."""
    lines = source.splitlines(keepends=True)
    for token in list(tokenize.generate_tokens(io.StringIO(source).readline)):
        if token.type == tokenize.COMMENT:
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column] + "# another\n"
    return "# one more\n\n" + "".join(lines)


def orphans(text: str, module: str, tree: ast.Module) -> list[mutation.Label]:
    """The mutants that a text explains and a tree has not."""
    there = set(labels(tree))
    return [label for label in mutation.explained(text, module) if label not in there]


@pytest.mark.parametrize("module", mutation.TESTS)
def test_each_explanation_names_a_mutant(module):
    assert orphans(EXPLANATIONS, module, mutation.parsed(module)) == []


def test_every_explanation_is_read_and_none_twice():
    read = {module: mutation.explained(EXPLANATIONS, module) for module in mutation.TESTS}
    listed = [line for line in EXPLANATIONS.partition("## Survivors explained")[2].splitlines() if line[:2] == "- "]
    count = sum(1 + line.split(": `")[0].count(" | ") for line in listed)
    assert sum(map(len, read.values())) == count > 50
    assert all(len(set(each)) == len(each) for each in read.values())


@pytest.mark.parametrize("module", mutation.TESTS)
@pytest.mark.parametrize("rewrite", [split, commented, lambda source: ast.unparse(ast.parse(source))])
def test_other_line_breaks_and_comments_leave_every_mutant_its_name(module, rewrite):
    source = (mutation.ROOT / "freqrail" / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8")
    changed = rewrite(source)
    assert changed != source
    assert labels(ast.parse(changed)) == labels(ast.parse(source))


def test_an_explanation_of_what_is_no_more_is_seen():
    tree = ast.parse("def f(a):\n    if a < 1:\n        return a + 2\n")
    text = "- m: Lt to LtE | 1 to 2: `f`: `if a < 1:`: head\n- m: Add to Sub: `f`: `return a + 2`: inside\n"
    assert orphans(text, "m", tree) == []
    for before, after in (("`f`", "`g`"), ("a + 2", "a + 3"), ("Lt to LtE", "Gt to GtE"), ("1 to 2", "1 to 2, no. 2")):
        assert orphans(text.replace(before, after, 1), "m", tree) != []


def test_the_same_change_twice_in_a_statement_has_a_number():
    found = labels(ast.parse("class A:\n    def f(a):\n        return (a +\n            1, a + 1)\n"))
    assert list(map(str, found)) == [
        f"{what}: `A.f`: `return (a + 1, a + 1)`"
        for what in ("Add to Sub", "Add to Sub, no. 2", "1 to 2", "1 to 2, no. 2")
    ]


def test_a_statement_that_is_too_long_is_known_by_its_ends():
    (first, *_, last) = labels(ast.parse(f"x = [{', '.join(map(str, range(100, 200)))}]"))
    assert first.statement == last.statement
    assert first.statement.startswith("x = [100, 101")
    assert first.statement.endswith("198, 199]")
    assert len(first.statement) < mutation.LONGEST


def test_each_mutant_is_one_change_of_its_tree():
    tree = mutation.parsed("solver.problem")
    written = [ast.unparse(mutant.changed()) for mutant in mutation.mutants(tree)]
    assert len(set(written)) == len(written) > 40
    assert ast.unparse(tree) not in written
    assert all(len(different(ast.unparse(tree), other)) == 1 for other in written)


def different(first: str, second: str) -> list[tuple[str, str]]:
    """Lines that are not the same."""
    return [pair for pair in itertools.zip_longest(first.splitlines(), second.splitlines()) if pair[0] != pair[1]]


@pytest.mark.parametrize("module", mutation.TESTS)
def test_the_tests_of_a_module_are_there(module):
    assert all((Path(mutation.ROOT) / "tests" / test).is_file() for test in mutation.TESTS[module])


def test_what_survived_in_a_run_is_read_back():
    """The output of the command and the explanations have one form."""
    (label, *_) = labels(ast.parse("x = 1"))
    assert mutation.explained(f"- m: {label} (line 1)\n- m: {label}: explained (line 1)\n", "m") == [label, label]
