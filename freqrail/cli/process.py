"""This process made fit to run a command, whatever its surroundings: streams, warnings, memory, matplotlib.

For the command line alone; who imports freqrail has a process of their own making. Nothing large is imported here.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import importlib.util
import io
import logging
import math
import os
import re
import signal
import sys
import warnings
from pathlib import Path

from freqrail.errors import FileError

LEAST_MEMORY = 500e6
"""Bytes of address space that the libraries take before anything is computed; with less they hang or crash."""
_NO_MEMORY = re.compile(r"can't start new thread|map segment|allocate|out of memory|malloc", re.IGNORECASE)


class Terminated(KeyboardInterrupt):
    """SIGTERM, as a batch system or `kill` sends it: what is open is closed as after Ctrl-C."""


def _terminate(number: int, frame: object) -> None:
    signal.signal(number, signal.SIG_IGN)  # a second one must not keep the first from cleaning up
    raise Terminated


class _Closed(io.StringIO):
    """In place of a stdout that was closed: refuses what is written to it."""

    def write(self, text: str) -> int:
        raise BrokenPipeError(errno.EPIPE, "stdout is closed")


def take_over() -> None:
    """Make this process fit to run a command whatever its surroundings: for the command line alone, once, at first.

    Closed streams get the null device, so that no file takes their number; what is written to a closed stdout counts
    as written to a closed pipe. Text that a stream cannot encode is escaped. Warnings of other packages are nobody's
    business here, also those that -W and PYTHONWARNINGS turn into errors. Where the address space is limited,
    numerical libraries get one thread: each takes a share of it. SIGTERM raises `Terminated`, unless it is ignored.
    """
    for stream in range(3):
        try:
            os.fstat(stream)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free, this one
    sys.stdout = sys.stdout or _Closed()
    sys.stderr = sys.stderr or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    for each in (sys.stdout, sys.stderr):
        if isinstance(each, io.TextIOWrapper):
            each.reconfigure(errors="backslashreplace")
    with contextlib.suppress(ValueError, OSError):  # outside the main thread
        if signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
            signal.signal(signal.SIGTERM, _terminate)
    sys.warnoptions.clear()
    os.environ.pop("PYTHONWARNINGS", None)
    warnings.resetwarnings()
    warnings.simplefilter("ignore")
    if address_space() < math.inf:
        for library in ("OPENBLAS", "OMP", "MKL"):
            os.environ.setdefault(f"{library}_NUM_THREADS", "1")


def address_space() -> float:
    """Bytes of memory that this process may address; inf without a limit."""
    try:
        import resource
    except ImportError:
        return math.inf
    limits = [resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA)]
    return min((float(limit) for limit in limits if limit != resource.RLIM_INFINITY), default=math.inf)


def prepare_matplotlib() -> None:
    """Import matplotlib with its own defaults, for files: no backend, style or broken file of the user's matters.

    It reads the first `matplotlibrc` that it finds, from the working folder on; its own lies in its folder of data.
    """
    if "matplotlib" in sys.modules:
        return
    found = importlib.util.find_spec("matplotlib")
    if found is None or found.origin is None:
        return  # to be told of where it is imported
    os.environ["MPLBACKEND"] = "agg"
    os.environ.pop("MATPLOTLIBRC", None)
    logging.getLogger("matplotlib").setLevel(logging.CRITICAL)
    # by its handle where that can be: a working folder may have been removed, or have no name that can be decoded
    here = os.open(".", os.O_RDONLY) if hasattr(os, "fchdir") else os.getcwd()
    try:
        os.chdir(os.path.join(os.path.dirname(found.origin), "mpl-data"))
        importlib.import_module("matplotlib")
    finally:
        os.chdir(here)
        if isinstance(here, int):
            os.close(here)


def is_out_of_memory(fault: BaseException) -> bool:
    """Whether a fault means that no memory was left: some libraries have other words for it than MemoryError."""
    if isinstance(fault, OSError):
        return fault.errno == errno.ENOMEM
    return isinstance(fault, MemoryError) or bool(_NO_MEMORY.search(str(fault)))


def check_memory_limit() -> None:
    """Raise FileError if the address space is so limited that the libraries would not even start."""
    if address_space() < LEAST_MEMORY:
        raise FileError(f"out of memory{limit_in_words()}, at least {LEAST_MEMORY / 1e6:.0f} MB are needed")


def limit_in_words() -> str:
    """What limits the memory, to end a message with; "" for the machine itself."""
    limit = address_space()
    return "" if math.isinf(limit) else f": the address space is limited to {limit / 1e6:.0f} MB (ulimit -v)"
