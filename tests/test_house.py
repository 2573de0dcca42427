"""The house: the order of the folders, and who may know whom (docs/architecture.md)."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "freqrail"
FOLDERS = ("model", "reduction", "case", "solver", "result", "sweep", "confirm", "figures", "replication", "cli")
"""From the ground up: a folder imports itself, what stands before it, and the modules beside the folders."""

FORBIDDEN = {
    "confirm": {"sweep"},  # a confirmation does not know how its result was swept
    "figures": {"solver", "confirm", "replication"},  # figures draw datasets
    "cli": {"reduction"},
}
ONLY = {
    ("result", "solver"): {"solver.solution"},  # labels know no numerics: statuses and methods as words
    ("figures", "sweep"): {"sweep.off_grid"},  # for a point that the result's grid lacks
}


def imports(source: str) -> Iterator[tuple[str, str]]:
    """(module, name) of everything of freqrail that a source imports, anywhere in it, in the one form that is used."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            assert not [alias.name for alias in node.names if alias.name.split(".")[0] == "freqrail"]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            if str(node.module).split(".")[0] == "freqrail":
                for alias in node.names:
                    yield str(node.module).removeprefix("freqrail").removeprefix("."), alias.name


def edges(folder: str) -> Iterator[tuple[str, str, str]]:
    """(file, module that it imports, name) for a folder; the module with its folder, such as "solver.solve"."""
    for path in sorted((ROOT / folder).rglob("*.py")):
        for module, name in imports(path.read_text(encoding="utf-8")):
            is_module = (ROOT / module.replace(".", "/") / f"{name}.py").is_file()
            yield path.name, ".".join(filter(None, [module, name])) if is_module else module, name


def faults(folder: str, found: list[tuple[str, str, str]]) -> list[str]:
    """What of the imports of a folder breaks the order or a rule."""
    known = {*FOLDERS[: FOLDERS.index(folder) + 1]} - FORBIDDEN.get(folder, set())
    above = [
        f"{folder}/{file} imports {module}"
        for file, module, _ in found
        if (home := module.split(".")[0]) in FOLDERS
        and (home not in known or module not in ONLY.get((folder, home), {module}))
    ]
    private = [
        f"{folder}/{file} imports {module}.{name}"
        for file, module, name in found
        if name.startswith("_") and not name.startswith("__") and module.split(".")[0] != folder
    ]
    return above + private


def test_the_listing_is_the_flow():
    """Every folder is in the order, and prints it: `pytest tests/test_house.py -s -k listing`."""
    print("\n".join(f"{folder:12} {len(list((ROOT / folder).glob('*.py'))) - 1:3} modules" for folder in FOLDERS))
    assert {path.name for path in ROOT.iterdir() if (path / "__init__.py").is_file()} == set(FOLDERS)


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_folder_imports_only_what_stands_before_it(folder):
    assert faults(folder, list(edges(folder))) == []


def test_the_architecture_names_every_module():
    text = (ROOT.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    missing = [
        path.relative_to(ROOT).as_posix()
        for path in ROOT.rglob("*.py")
        if path.name != "__init__.py" and f"`{path.name}`" not in text.partition(f"### {path.parent.name}")[2]
    ]
    assert [name for name in missing if "/" in name] == []


@pytest.mark.parametrize("line", ["import freqrail.solver.solve", "from . import x", "from ..solver import solve"])
def test_another_form_of_import_is_refused(line):
    with pytest.raises(AssertionError):
        list(imports(line))


def test_what_stands_beside_the_folders_imports_none_of_them():
    for path in ROOT.glob("*.py"):
        if path.name not in ("__init__.py", "__main__.py"):
            assert not {module.split(".")[0] for module, _ in imports(path.read_text())} & set(FOLDERS), path.name


@pytest.mark.parametrize(
    ("folder", "edge"),
    [
        ("model", ("x.py", "case.case", "Case")),
        ("solver", ("x.py", "result.labels", "label")),
        ("result", ("x.py", "solver.solve", "solve")),
        ("confirm", ("x.py", "sweep.plan", "Plan")),
        ("figures", ("x.py", "sweep.sweep", "compute")),
        ("figures", ("x.py", "solver.solve", "solve")),
        ("sweep", ("x.py", "case.axis", "_Values")),
    ],
)
def test_an_import_the_wrong_way_is_seen(folder, edge):
    assert len(faults(folder, [edge])) == 1


def test_opening_a_file_parses_no_toml(tmp_path):
    """Neither pydantic nor a case comes in with `open_result`: they take longer to import than a file to read."""
    code = (
        "import sys, freqrail; freqrail.open_result(sys.argv[1]); "
        "print([m for m in ('pydantic', 'tomllib', 'freqrail.case.case', 'freqrail.solver.solve') if m in sys.modules])"
    )
    grid = ROOT.parent / "results" / "yu-damper-joint" / "grid.nc"
    done = subprocess.run([sys.executable, "-c", code, str(grid)], capture_output=True, text=True, timeout=60)
    assert done.stdout == "[]\n", done.stderr


def test_the_public_functions_are_not_hidden_by_folders_of_their_names():
    code = (
        "import freqrail.sweep.plan, freqrail.confirm.run, freqrail; from freqrail import confirm, sweep; "
        "print(callable(sweep), callable(confirm), callable(freqrail.sweep), callable(freqrail.confirm))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "True True True True\n", done.stderr


def roots(source: str) -> set[str]:
    """The names before the first dot that a source imports; "" of a relative import."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add("" if node.level else str(node.module).split(".")[0])
    return found


def test_tests_import_each_other_as_parts_of_tests():
    """One root: `from tests.helpers import ...`, wherever the test stands."""
    files = sorted((ROOT.parent / "tests").rglob("*.py"))
    own = {"", *(path.stem for path in files), *(path.parent.name for path in files)} - {"tests"}
    assert not {path.name: found for path in files if (found := roots(path.read_text(encoding="utf-8")) & own)}
    assert roots("from helpers import x") | roots("from . import x") | roots("import helpers as h") == {"helpers", ""}
    assert {"helpers", ""} <= own
