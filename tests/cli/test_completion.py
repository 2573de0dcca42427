"""Shell completion: what is offered can be given, nothing heavy is imported for it, and bash gets it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from freqrail.case.file import apply_axis, apply_setting, parse_toml, sections
from freqrail.case.parameters import SWEEPABLE
from freqrail.case.shipped import shipped_cases
from freqrail.cli import completion
from freqrail.errors import InputError
from freqrail.model.responses import RESPONSES
from freqrail.result.layout import response_names
from freqrail.result.points import parse_point

CASE = "yu-damper-joint"
CASES = list(shipped_cases())


def offered(words: list[str], cwd: Path) -> list[str]:
    """What the program answers bash when the last of these words is being typed, click's own escapes taken off."""
    quoted = " ".join(f"'{word}'" if " " in word else word for word in ["freqrail", *words])
    environment = os.environ | {
        "_FREQRAIL_COMPLETE": "bash_complete",
        "COMP_WORDS": quoted,
        "COMP_CWORD": str(len(words)),
    }
    done = subprocess.run(
        [sys.executable, "-m", "freqrail"], cwd=cwd, env=environment, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    return [line.partition(",")[2] for line in done.stdout.splitlines() if line]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["sweep", "yu"], [CASE]),
        (["sweep", "mi"], ["mine.toml"]),
        (["sweep", "deep/"], ["deep/er/", "deep/other.toml"]),
        (["modes", ""], [*CASES, "deep/", "mine.toml"]),
        (["cases", ""], CASES),
        (["confirm", "r"], ["result.nc"]),
        (["plot", ""], ["deep/", "result.nc"]),
        (["show", ""], [*CASES, "deep/", "mine.toml", "result.nc"]),
        (["sweep", CASE, "--over", "s"], [f"{n}=" for n in SWEEPABLE if n.startswith("s")]),
        (["sweep", CASE, "--over", "fre"], ["frequency="]),
        (["sweep", CASE, "--set", "wa"], ["wavelength="]),
        (["modes", CASE, "--set", "bogie_m"], ["bogie_mass="]),
        (["show", "result.nc", "--at", "spe"], ["speed="]),
        (["confirm", "result.nc", "--at", "speed=250 km/h, primary_j"], ["speed=250 km/h, primary_joint_stiffness="]),
        (["sweep", CASE, "--responses", "pa"], ["paper"]),
        (["sweep", CASE, "--responses", "primary_stroke,prim"], []),
        (["sweep", CASE, "--responses", "primary_stroke,sec"], ["primary_stroke,secondary_stroke"]),
        (["sweep", CASE, "--over", "speed=1"], []),
    ],
    ids=" ".join,
)
def test_the_shell_is_offered_what_fits(words, expected, tmp_path):
    (tmp_path / "deep" / "er").mkdir(parents=True)
    for name in ("mine.toml", "result.nc", "notes.txt", ".hidden.nc", "deep/other.toml"):
        (tmp_path / name).touch()
    assert offered(words, tmp_path) == expected


def test_every_name_that_is_offered_is_taken_and_none_is_missing():
    over = completion.axis(None, None, "")
    assert over == [f"{name}=" for name in (*SWEEPABLE, "frequency")]
    for option, names in (("over", over), ("set", completion.setting(None, None, ""))):
        for name in names:
            tables, problems = parse_toml(shipped_cases()[CASE], "case"), []
            if option == "over":
                apply_axis(tables, name.rstrip("="), "1", problems, {})
            else:
                apply_setting(tables, name.rstrip("="), "none", problems, {}, scalars=True)
            assert problems == [], name
    known = {f"{name}=" for names in sections().values() for name in names}
    assert known <= {*completion.setting(None, None, "")}
    for name in completion.responses(None, None, ""):
        assert response_names(name)
    assert {*RESPONSES} < {*completion.responses(None, None, "")}
    for name in completion.point(None, None, ""):
        with pytest.raises(InputError) as refusal:
            parse_point(f"{name}?")
        assert "unknown name" not in str(refusal.value)


def test_completing_imports_nothing_heavy():
    """It runs at every press of the key."""
    code = (
        "import sys; from freqrail.cli.commands import run\n"
        "try: run([])\n"
        "except SystemExit: pass\n"
        "print(sorted({m.split('.')[0] for m in sys.modules} & {'numpy', 'xarray', 'scipy', 'pint', 'pydantic',"
        " 'matplotlib', 'netCDF4', 'filelock'}))"
    )
    for words in ("freqrail sweep yu", "freqrail show x.nc --at sp", f"freqrail sweep {CASE} --responses pri"):
        environment = os.environ | {"_FREQRAIL_COMPLETE": "bash_complete", "COMP_WORDS": words}
        environment["COMP_CWORD"] = str(len(words.split()) - 1)
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=True
        )
        assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_itself_completes(tmp_path):
    """The line that the README gives, and then what readline would ask for."""
    program = tmp_path / "freqrail"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m freqrail "$@"\n')
    program.chmod(0o755)
    script = (
        'eval "$(_FREQRAIL_COMPLETE=bash_source freqrail)"; '
        "COMP_WORDS=(freqrail sweep yu-da); COMP_CWORD=2; _freqrail_completion freqrail; echo ${COMPREPLY[@]}"
    )
    environment = os.environ | {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == CASE, done.stderr


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize(("typed", "asked"), [("--over spe", 1), ("yu-da", 0)])
def test_bash_puts_no_blank_behind_an_equals_sign(tmp_path, typed, asked):
    program = tmp_path / "freqrail"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m freqrail "$@"\n')
    program.chmod(0o755)
    script = (
        'eval "$(_FREQRAIL_COMPLETE=bash_source freqrail)"; compopt() { echo "compopt $1 $2"; }; '
        f"COMP_WORDS=(freqrail sweep {typed}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _freqrail_completion freqrail"
    )
    environment = os.environ | {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True, timeout=60)
    assert done.stdout == "compopt -o nospace\n" * asked, done.stderr
