"""What is declared and what is shipped: lower bounds, and a source package and a wheel that work by themselves."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_the_lowest_versions_that_are_tested_are_those_declared():
    """.ci/run installs tests/lowest.txt and runs a part of the tests with it."""
    lines = (ROOT / "tests" / "lowest.txt").read_text(encoding="utf-8").splitlines()
    tested = {line for line in lines if line and not line.startswith("#")}
    assert tested == {bound.replace(">=", "==") for bound in PROJECT["project"]["dependencies"]}


def test_pint_is_asked_for_in_the_version_that_is_declared():
    """The message about a pint that does not run names a version; it is the one declared."""
    (bound,) = (b for b in PROJECT["project"]["dependencies"] if b.startswith("pint"))
    assert f'"{bound}"' in (ROOT / "freqrail" / "case" / "quantities.py").read_text(encoding="utf-8")


def test_the_oldest_python_is_the_same_everywhere():
    lowest = PROJECT["project"]["requires-python"].removeprefix(">=")
    assert PROJECT["tool"]["mypy"]["python_version"] == lowest
    assert PROJECT["tool"]["ruff"]["target-version"] == "py" + lowest.replace(".", "")
    versions = [c for c in PROJECT["project"]["classifiers"] if re.search(r":: 3\.\d+$", c)]
    assert versions[0] == f"Programming Language :: Python :: {lowest}"


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> tuple[Path, Path]:
    """The source package, and the wheel that is built from it."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    (source,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    return source, wheel


def test_the_source_package_holds_what_tests_need_and_no_results(built):
    with tarfile.open(built[0]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"freqrail/py.typed", "cases/yu-damper-joint.toml", "tests/lowest.txt", "tests/schema1/sweep.nc"} <= names
    assert {"README.md", "CHANGELOG.md", "LICENSE", "docs/theory.md", "pyproject.toml"} <= names
    assert not [name for name in names if name.startswith("results")]
    ours = {str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("*.py")}
    assert ours <= names
    assert built[0].stat().st_size < 3_000_000


def test_the_wheel_works_by_itself(built, tmp_path):
    with zipfile.ZipFile(built[1]) as archive:
        names = set(archive.namelist())
    assert {"freqrail/py.typed", "freqrail/cases/yu-damper-joint.toml", "freqrail/replication/claims.py"} <= names
    assert {name.split("/")[0].split("-")[0] for name in names} == {"freqrail"}
    place = tmp_path / "site"
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--target", str(place)]
    subprocess.run([*install, str(built[1])], check=True, capture_output=True, timeout=300)
    environment = os.environ | {"PYTHONPATH": str(place)}
    for code, expected in (
        ("import freqrail; print(freqrail.__file__)", str(place / "freqrail" / "__init__.py")),
        ("from freqrail.cli.commands import run; run(['cases'])", "Damper Rubber Joint Stiffness"),
        ("from freqrail.cli.commands import run; run(['show', 'yu-damper-joint'])", "static wheel load"),
    ):
        done = subprocess.run(
            [sys.executable, "-P", "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True,
            timeout=60,
        )  # fmt: skip
        assert expected in done.stdout, done.stderr
