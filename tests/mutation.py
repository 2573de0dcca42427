"""Mutation testing of the numerical modules: `python -m tests.mutation solver.panels solver.solve`, see mutation.md.

Every operator, comparison, number and twin function of a module is changed, one at a time, and the module's own tests
are run on the changed source: in a fork of this process, which has the libraries loaded and freqrail not. No
file is touched. A mutant that the tests let pass is printed with its statement, in the form of mutation.md.
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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
MUTATION = Path(__file__).with_suffix(".md")
SECONDS = 120  # a mutant whose tests take longer counts as killed

TESTS = {
    "model.spectrum": ["model/test_spectrum.py"],
    "model.vehicle": ["model/test_vehicle.py"],
    "model.equations": ["model/test_equations.py", "model/test_vehicle.py", "solver/test_responses.py"],
    "model.elements": ["model/test_elements.py"],
    "reduction.forms": ["reduction/test_decouple.py", "reduction/test_columns.py"],
    "reduction.decouple": ["reduction/test_decouple.py"],
    "reduction.blocks": ["reduction/test_decouple.py", "solver/test_block_response.py"],
    "reduction.columns": ["reduction/test_columns.py", "solver/test_responses.py"],
    "solver.elimination": ["solver/test_block_response.py"],
    "solver.block_response": ["solver/test_block_response.py", "solver/test_responses.py"],
    "solver.block_lags": ["solver/test_block_quadrature.py", "solver/test_responses.py", "solver/test_quadrature.py"],
    "solver.block_quadrature": ["solver/test_block_quadrature.py", "solver/test_work.py", "solver/test_quadrature.py"],
    "solver.quadrature": ["solver/test_quadrature.py"],
    "solver.block_matrix": ["solver/test_block_matrix.py", "solver/test_block_poles.py"],
    "solver.free_oscillation": ["solver/test_block_poles.py", "solver/test_vehicle_poles.py"],
    "solver.block_poles": ["solver/test_block_poles.py", "solver/test_vehicle_poles.py"],
    "solver.block_terms": ["solver/test_residues.py", "solver/test_block_residues.py"],
    "solver.block_waves": ["solver/test_residues.py", "solver/test_block_residues.py"],
    "solver.block_residues": ["solver/test_residues.py", "solver/test_block_residues.py"],
    "solver.closed_form": ["solver/test_residues.py"],
    "solver.resonances": ["solver/test_resonances.py", "solver/test_any_vehicle.py"],
    "solver.frozen_laws": ["solver/test_any_vehicle.py"],
    "solver.detours": ["solver/test_detours.py", "solver/test_panels.py"],
    "solver.peaks": ["solver/test_detours.py", "solver/test_solve.py"],
    "solver.rounding": ["solver/test_work.py", "solver/test_quadrature.py"],
    "solver.transfer": ["solver/test_transfer.py", "solver/test_responses.py"],
    "solver.problem": ["solver/test_problem.py"],
    "solver.panels": ["solver/test_work.py", "solver/test_panels.py"],
    "solver.solve": ["solver/test_work.py", "solver/test_solve.py", "solver/test_panels.py", "test_properties.py"],
}
"""Modules and the tests that are theirs, the quickest first: the first that fails ends a run."""

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


LONGEST = 200  # characters of a statement; of a longer one its two ends name it


@dataclass(frozen=True)
class Label:
    """What names a mutant, whatever the lines of its source and their breaks.

    definition: the functions and classes around it, "f.g", "module" if none. statement: the innermost one, as
    `ast.unparse` writes it; of a compound one its head. what: the change, with a number from the second of its kind on.
    """

    definition: str
    statement: str
    what: str

    def __str__(self) -> str:
        return f"{self.what}: `{self.definition}`: `{self.statement}`"


@dataclass(frozen=True)
class Mutant:
    """One change to a tree."""

    tree: ast.Module
    place: int  # of the node among those that `ast.walk` meets
    line: int
    label: Label
    change: Callable[[ast.AST], object]

    def changed(self) -> ast.Module:
        """The tree with the change made."""
        tree = copy.deepcopy(self.tree)
        self.change(next(node for k, node in enumerate(ast.walk(tree)) if k == self.place))
        return ast.fix_missing_locations(tree)


def mutants(tree: ast.Module) -> Iterator[Mutant]:
    """Every change of one node; see `untested` for what is left alone."""
    skipped = {id(part) for node in ast.walk(tree) for part in untested(node)}
    homes = {id(node): (name, statement) for name, statement, node in nodes(tree)}
    seen: Counter[Label] = Counter()
    for place, node in enumerate(ast.walk(tree)):
        if id(node) in skipped:
            continue
        for what, change in changes(node):
            label = Label(*homes[id(node)], what)
            seen[label] += 1
            if seen[label] > 1:
                label = Label(label.definition, label.statement, f"{what}, no. {seen[label]}")
            yield Mutant(tree, place, node.lineno, label, change)


def nodes(node: ast.AST, name: str = "", statement: str = "") -> Iterator[tuple[str, str, ast.AST]]:
    """(definition, statement, node) of every node in a tree."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        name = f"{name}.{node.name}".lstrip(".")
    if isinstance(node, ast.stmt):
        statement = head(node)
    yield name or "module", statement, node
    for child in ast.iter_child_nodes(node):
        yield from nodes(child, name, statement)


def head(statement: ast.stmt) -> str:
    """A statement on one line, without the statements inside it."""
    alone = copy.copy(statement)
    for key in ("body", "orelse", "handlers", "finalbody", "cases", "decorator_list"):
        if hasattr(alone, key):
            setattr(alone, key, [])
    text = " ".join(ast.unparse(alone).split())
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 60]} ... {text[-50:]}"


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


def changes(node: ast.AST) -> Iterator[tuple[str, Callable[[ast.AST], object]]]:
    """(what, function that does it to the node) of every change to one node."""

    def setting(key: str, value: object) -> Callable[[ast.AST], object]:
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


def killed_by(module: str, tree: ast.Module, tests: list[str]) -> str:
    """What the tests make of the module's source replaced by `tree`: "tests", "time", "" if they pass; in a fork."""
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
    status = os.waitpid(child, 0)[1]
    if status == 0:
        return ""
    return "time" if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM else "tests"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("modules", nargs="+", choices=TESTS, metavar="MODULE", help=", ".join(TESTS))
    parser.add_argument("--lines", default="1:1000000", help="only mutants of these lines, FIRST:LAST")
    parser.add_argument("--again", metavar="FILE", help="only what survived in a former run, whose output FILE holds")
    asked = parser.parse_args()
    first, last = map(int, asked.lines.split(":"))
    former = Path(asked.again).read_text(encoding="utf-8") if asked.again else None
    os.chdir(ROOT)
    for library in ("numpy", "scipy.linalg", "scipy.integrate", "xarray", "hypothesis", "pint", "pydantic", "pytest"):
        importlib.import_module(library)
    unexpected = 0
    for module in asked.modules:
        tree, tests = parsed(module), TESTS[module]
        again = None if former is None else set(explained(former, module))
        known = set(explained(MUTATION.read_text(encoding="utf-8"), module))
        if killed_by(module, tree, tests):
            raise SystemExit(f"{module}: the tests do not pass on the module as it is")
        start, count, alive, late = time.perf_counter(), 0, 0, 0
        for mutant in mutants(tree):
            if not first <= mutant.line <= last or (again is not None and mutant.label not in again):
                continue
            count += 1
            killer = killed_by(module, mutant.changed(), tests)
            late += killer == "time"
            if not killer:
                alive += 1
                new = mutant.label not in known
                unexpected += new
                print(f"- {module}: {mutant.label}{'' if new else ': explained'} (line {mutant.line})", flush=True)
        took = time.perf_counter() - start
        print(f"{module}: {count} mutants, {alive} survive, {late} took too long; {took:.0f} s", flush=True)
    return 1 if unexpected else 0


def parsed(module: str) -> ast.Module:
    """The source of a module such as "solver.panels"."""
    return ast.parse((ROOT / "freqrail" / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8"))


def explained(text: str, module: str) -> list[Label]:
    """The mutants of a module that lines of a text name: "- MODULE: CHANGE | CHANGE: `DEFINITION`: `STATEMENT`"."""
    listed = re.findall(rf"^- {re.escape(module)}: (.+?): `(.+?)`: `(.+?)`", text, re.MULTILINE)
    return [Label(name, statement, what) for whats, name, statement in listed for what in whats.split(" | ")]


if __name__ == "__main__":
    sys.exit(main())
