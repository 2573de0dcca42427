"""Mutation testing of the numerical modules: `python -m tests.mutation track vehicle`, see mutation.md.

Every operator, comparison, number and twin function of a module is changed, one at a time, and the module's own tests
are run on the changed source: in a fork of this process, which has the libraries loaded and freqrail not. No
file is touched. A mutant that the tests let pass is printed with its line.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.abc
import importlib.util
import os
import re
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
SECONDS = 120  # a mutant whose tests take longer counts as killed

TESTS = {
    "track": ["test_track.py"],
    "vehicle": ["test_vehicle.py"],
    "response": ["test_response.py"],
    "rms": ["test_rms.py"],
    "residues": ["test_residues.py"],
    "study": ["test_study.py"],
    "nodes": ["test_nodes.py"],
    "grid": ["test_grid.py", "test_nodes.py", "test_properties.py"],
}

OPERATORS: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.MatMult: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
PAIRS = (("sin", "cos"), ("maximum", "minimum"), ("max", "min"), ("real", "imag"), ("all", "any"), ("zeros", "ones"))
TWINS = {a: b for pair in PAIRS for a, b in (pair, pair[::-1])}


def mutants(tree: ast.Module) -> Iterator[tuple[int, str, ast.Module]]:
    """(line, what was changed, changed module), one change at a time; see `untested` for what is left alone."""
    skipped = {id(part) for node in ast.walk(tree) for part in untested(node)}
    for place, node in enumerate(ast.walk(tree)):
        if id(node) in skipped:
            continue
        for what, change in changes(node):
            changed = copy.deepcopy(tree)
            twin = next(n for k, n in enumerate(ast.walk(changed)) if k == place)
            change(twin)
            yield node.lineno, what, ast.fix_missing_locations(changed)


def untested(node: ast.AST) -> Iterator[ast.AST]:
    """What of a node means nothing to the numbers: annotations (they are text here), names of types, decorators."""
    for key in ("annotation", "returns"):
        if getattr(node, key, None):
            yield from ast.walk(getattr(node, key))
    if isinstance(node, ast.keyword) and node.arg == "strict":  # of zip, which says what holds by construction
        yield from ast.walk(node.value)
    for decorator in getattr(node, "decorator_list", ()):
        yield from ast.walk(decorator)
    if isinstance(node, ast.Assign) and isinstance(node.value, ast.BinOp) and isinstance(node.value.op, ast.BitOr):
        yield from ast.walk(node.value)


def changes(node: ast.AST) -> Iterator[tuple[str, object]]:
    """(what, function that does it to the node) of every change to one node."""

    def setting(key: str, value: object) -> object:
        return lambda twin: setattr(twin, key, value)

    def name(operator: object) -> str:
        return type(operator).__name__

    if isinstance(node, ast.BinOp | ast.AugAssign | ast.BoolOp) and type(node.op) in OPERATORS:
        other = OPERATORS[type(node.op)]()
        yield f"{name(node.op)} to {name(other)}", setting("op", other)
    elif isinstance(node, ast.Compare) and type(node.ops[0]) in OPERATORS:
        other = OPERATORS[type(node.ops[0])]()
        yield f"{name(node.ops[0])} to {name(other)}", setting("ops", [other, *node.ops[1:]])
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "minus sign lost", setting("op", ast.UAdd())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "not lost", lambda twin: setattr(twin, "operand", ast.UnaryOp(ast.Not(), twin.operand))
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield f"{node.value} to {not node.value}", setting("value", not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int):
        yield f"{node.value} to {node.value + 1}", setting("value", node.value + 1)
    elif isinstance(node, ast.Constant) and isinstance(node.value, float | complex):
        other = 1.01 * node.value or 0.01
        yield f"{node.value} to {other}", setting("value", other)
    elif isinstance(node, ast.Attribute) and node.attr in TWINS:
        yield f"{node.attr} to {TWINS[node.attr]}", setting("attr", TWINS[node.attr])
    elif isinstance(node, ast.IfExp):
        yield "branches swapped", lambda twin: twin.__dict__.update(body=twin.orelse, orelse=twin.body)


class Changed(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports one module from a changed tree."""

    def __init__(self, name: str, tree: ast.Module) -> None:
        self.name, self.tree = name, tree

    def find_spec(self, name: str, *_: object):
        if name == self.name:
            return importlib.util.spec_from_loader(name, self, origin=f"changed {name}")
        return None

    def exec_module(self, module) -> None:
        exec(compile(self.tree, module.__spec__.origin, "exec"), module.__dict__)


def survives(module: str, tree: ast.Module, tests: list[str]) -> bool:
    """Whether the tests pass with the module's source replaced by `tree`; in a fork."""
    child = os.fork()
    if not child:
        signal.alarm(SECONDS)
        null = os.open(os.devnull, os.O_RDWR)
        for stream in (1, 2):
            os.dup2(null, stream)
        import hypothesis
        import pytest

        hypothesis.settings.register_profile("mutation", derandomize=True, database=None)
        hypothesis.settings.load_profile("mutation")
        sys.meta_path.insert(0, Changed(f"freqrail.{module}", tree))
        paths = [str(ROOT / "tests" / test) for test in tests]
        os._exit(min(1, int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "--no-header", *paths]))))
    return os.waitpid(child, 0)[1] == 0


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("modules", nargs="+", choices=TESTS, metavar="MODULE", help=", ".join(TESTS))
    parser.add_argument("--lines", default="1:1000000", help="only mutants of these lines, FIRST:LAST")
    parser.add_argument("--again", metavar="FILE", help="only what survived in a former run, whose output FILE holds")
    asked = parser.parse_args()
    first, last = map(int, asked.lines.split(":"))
    again = former(Path(asked.again).read_text(encoding="utf-8")) if asked.again else None
    os.chdir(ROOT)
    for library in ("numpy", "scipy.linalg", "scipy.integrate", "xarray", "hypothesis", "pint", "pydantic", "pytest"):
        importlib.import_module(library)
    unexpected = 0
    for module in asked.modules:
        source = (ROOT / "freqrail" / f"{module}.py").read_text(encoding="utf-8")
        lines, tree, tests = source.splitlines(), ast.parse(source), TESTS[module]
        known = explained(module)
        if not survives(module, tree, tests):
            raise SystemExit(f"{module}: the tests do not pass on the module as it is")
        start, count, alive = time.perf_counter(), 0, 0
        twice: Counter[tuple[int, str]] = Counter()
        for line, what, changed in mutants(tree):
            twice[line, what] += 1
            if twice[line, what] > 1:  # the same change at another place of the line
                what = f"{what}, no. {twice[line, what]}"
            text = lines[line - 1].strip()
            if not first <= line <= last or (again is not None and (what.split(", no. ")[0], text) not in again):
                continue
            count += 1
            if survives(module, changed, tests):
                alive += 1
                new = not {what, "any"} & known.get(text, set())
                unexpected += new
                print(f"{module}:{line}: {what}: {text}{'' if new else '  (explained)'}", flush=True)
        print(f"{module}: {count} mutants, {alive} survive; {time.perf_counter() - start:.0f} s", flush=True)
    return 1 if unexpected else 0


def former(output: str) -> set[tuple[str, str]]:
    """(change, line of source) of what an earlier run printed."""
    return set(re.findall(r"^\w+:\d+: (.+?)(?:, no\. \d+)?: (.+?)(?:  \(explained\))?$", output, re.MULTILINE))


def explained(module: str) -> dict[str, set[str]]:
    """Changes by line of source that mutation.md explains: `- MODULE: CHANGE | CHANGE: `SOURCE`: why`, or "any"."""
    text = (Path(__file__).parent / "mutation.md").read_text(encoding="utf-8")
    known: dict[str, set[str]] = {}
    for listed, source in re.findall(rf"^- {module}: (.+?): `(.+?)`", text, re.MULTILINE):
        known.setdefault(source, set()).update(listed.split(" | "))
    return known


if __name__ == "__main__":
    sys.exit(main())
