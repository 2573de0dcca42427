"""What the commands have in common at the terminal: results on stdout, messages and progress on stderr, exit codes."""

from __future__ import annotations

import contextlib
import json
import math
import os
import shutil
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from typing import Any, TextIO

import click

from freqrail.cli.process import Terminated, is_out_of_memory, limit_in_words
from freqrail.errors import FileError, FreqrailError, FreqrailWarning


def report(facts: dict[str, Any], as_json: bool, *lines: str) -> None:
    """Print a result on stdout: its lines for people, or its facts for a program."""
    click.echo(json.dumps(_jsonable(facts), indent=2) if as_json else "\n".join(lines))


def _jsonable(value: Any) -> Any:
    """The same with null for nan and text for inf, which JSON has no numbers for."""
    if isinstance(value, dict):
        return {key: _jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_jsonable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value


def program() -> str:
    """How to call this program again: its bare name if that is on the PATH, else as it was called."""
    called = sys.argv[0]
    found = shutil.which("freqrail")
    return "freqrail" if found and os.path.exists(called) and os.path.samefile(found, called) else called


@contextlib.contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar on stderr, if that is a terminal; yields the function that advances it."""
    if not sys.stderr.isatty():
        yield lambda points: None
        return
    lock = threading.Lock()  # blocks finish on several threads
    with click.progressbar(length=total, label=label, file=sys.stderr) as bar:

        def advance(points: int) -> None:
            with lock:
                bar.update(points)

        yield advance


def tell(text: str) -> None:
    """A line on stderr; lost if nobody takes it."""
    try:
        click.echo(text, err=True)
    except (OSError, ValueError):
        _abandon(sys.stderr)


def _say(kind: str, text: str) -> None:
    from freqrail.text import printable

    for line in text.split("\n"):
        tell(f"freqrail: {kind}: {printable(line)}")


def _show_warning(message: Warning | str, category: type[Warning], *rest: Any, **options: Any) -> None:
    if issubclass(category, FreqrailWarning):
        _say("warning", str(message))


def _abandon(stream: TextIO) -> None:
    """Leave nothing for the interpreter to flush at its end into a stream that takes nothing."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def guarded(task: Callable[[], object]) -> int:
    """Run a command and return its exit code; every fault is a line on stderr, never a traceback.

    0 done; 2 bad input; 3 numerical; 4 input or output; 130 interrupted; 143 terminated (SIGTERM).
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("always", FreqrailWarning)
            warnings.showwarning = _show_warning
            task()
        sys.stdout.flush()
    except click.exceptions.Exit as stop:
        return stop.exit_code
    except SystemExit:  # click's way to leave a closed pipe
        return FileError.exit_code
    except click.exceptions.NoArgsIsHelpError as help_text:
        tell(help_text.format_message())
        return 2
    except click.UsageError as fault:
        where = f" (see {fault.ctx.command_path} --help)" if fault.ctx else ""
        _say("error", " ".join(fault.format_message().split()) + where)
        return 2
    except FreqrailError as fault:
        for problem in fault.problems:
            _say("error", problem.replace("\n", "\\n"))
        return fault.exit_code
    except (KeyboardInterrupt, click.Abort) as stop:  # click turns the first into the second
        if isinstance(stop, Terminated) or isinstance(stop.__cause__, Terminated):
            tell("freqrail: terminated")
            return 143
        tell("freqrail: interrupted")
        return 130
    except (OSError, MemoryError, RuntimeError, ImportError) as fault:
        if is_out_of_memory(fault):
            tell(f"freqrail: error: out of memory{limit_in_words()}")
        elif isinstance(fault, OSError):
            if not isinstance(fault, BrokenPipeError):  # of which the user knows
                _say("error", f"{fault.filename or 'output'}: {fault.strerror or fault}")
        else:
            raise
        _abandon(sys.stdout)
        return FileError.exit_code
    return 0
