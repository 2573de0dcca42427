"""What the shell offers behind <Tab>: cases, results and the names that options take.

click calls these with what has been typed. A shell waits for the answer: nothing here reads a result or imports
more than the tables of names.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import click
from click.shell_completion import BashComplete, add_completion_class

from freqrail.case.parameters import PARAMETERS, SWEEPABLE
from freqrail.case.shipped import shipped_cases
from freqrail.model.responses import RESPONSES

_END = "    return 0\n}"
_NO_BLANK = """    # behind NAME= goes its value, without a blank
    if [[ ${#COMPREPLY[@]} -eq 1 && ${COMPREPLY[0]} == *= ]]; then
        compopt -o nospace
    fi

"""


@add_completion_class
class _Bash(BashComplete):
    """click's own, and no blank behind a name that ends in an equals sign."""

    source_template = BashComplete.source_template.replace(_END, _NO_BLANK + _END)


SETTINGS = (*PARAMETERS, "band", "spectrum", "masses", "title", "reference")
"""What `--set` takes."""


def case(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Shipped cases by name, case files by path."""
    return [*_beginning(shipped_cases(), typed), *_files(typed, ".toml")]


def shipped(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Shipped cases by name."""
    return _beginning(shipped_cases(), typed)


def result(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Results by path."""
    return _files(typed, ".nc")


def case_or_result(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """Either."""
    return [*_beginning(shipped_cases(), typed), *_files(typed, ".toml", ".nc")]


def axis(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """The names of `--over`, with the equals sign behind which the values go."""
    return _beginning((f"{name}=" for name in (*SWEEPABLE, "frequency")), typed)


def setting(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """The names of `--set`."""
    return _beginning((f"{name}=" for name in SETTINGS), typed)


def point(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """The names of `--at`, also behind a comma."""
    before, comma, last = typed.rpartition(",")
    blanks = last[: len(last) - len(last.lstrip())]
    given = [part.partition("=")[0].strip() for part in before.split(",")]
    names = (f"{name}=" for name in SWEEPABLE if name not in given)
    return [before + comma + blanks + name for name in _beginning(names, last.lstrip())]


def responses(context: click.Context, parameter: click.Parameter, typed: str) -> list[str]:
    """The names of `--responses`, also behind a comma."""
    before, comma, last = typed.rpartition(",")
    given = [part.strip() for part in before.split(",")]
    names = (name for name in ("paper", "all", *RESPONSES) if name not in given)
    return [before + comma + name for name in _beginning(names, last.lstrip())]


def _beginning(names: Iterable[str], typed: str) -> list[str]:
    return [name for name in names if name.startswith(typed)]


def _files(typed: str, *suffixes: str) -> list[str]:
    """Files with one of these endings, and folders on the way to them, whose path begins so."""
    folder, name = os.path.split(typed)
    try:
        entries: Sequence[Path] = sorted(Path(folder or ".").iterdir())
    except OSError:
        return []
    found = []
    for entry in entries:
        if entry.name.startswith(name) and (name.startswith(".") or not entry.name.startswith(".")):
            path = os.path.join(folder, entry.name)
            if entry.is_dir():
                found.append(path + os.sep)
            elif entry.suffix in suffixes:
                found.append(path)
    return found
