"""`freqrail show FILE --check`: a file of unknown origin, read in a child process with limits on time and memory.

Three in a thousand random changes of a byte make the NetCDF library loop for ever, others make it crash; a
process of its own keeps both from the one that asks. The file is read as every result is, by `points.read_result`.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from freqrail.errors import InputError

SECONDS, SECONDS_PER_GB = 30.0, 60.0
COMMAND = "from freqrail.result.sandbox import child; child()"
BYTES, BYTES_PER_BYTE = 2 * 10**9, 4  # address space: the libraries take a quarter of the first


def check_result(path: str | os.PathLike[str], seconds: float | None = None) -> dict[str, Any]:
    """{"digest": ..., "failures": [...]} of a result that is whole; `failures` as `axes.first_failures`.

    seconds: how long reading may take, by its size unless given. Raises InputError with the reason for
    anything else: also for a file that crashes the library, or does not let it end.
    """
    try:
        size = Path(path).stat().st_size
    except (OSError, ValueError):
        size = 0  # the child says what is wrong
    seconds = SECONDS + SECONDS_PER_GB * size / 1e9 if seconds is None else seconds
    # the child finds what this process finds, and nothing of the folder it happens to run in (-P)
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "OPENBLAS_NUM_THREADS": "1",  # each thread takes address space
    }
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", COMMAND, os.fspath(path), str(BYTES + BYTES_PER_BYTE * size)],
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=seconds,
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{path}: damaged: reading it did not end within {seconds:g} s") from None
    if done.returncode < 0:
        raise InputError(f"{path}: damaged: it crashes the NetCDF library ({signal.Signals(-done.returncode).name})")
    try:
        answer = json.loads(done.stdout.splitlines()[-1])
    except (ValueError, IndexError):
        raise InputError(f"{path}: damaged: reading it ended without an answer (exit {done.returncode})") from None
    if answer["problems"]:
        raise InputError(*answer["problems"])
    return {"digest": answer["digest"], "failures": answer["failures"]}


def child() -> None:
    """In the child: read the file named by the first argument and print what it is, as JSON on the last line."""
    path, most = sys.argv[1], int(sys.argv[2])
    with contextlib.suppress(ImportError, ValueError, OSError):  # where there are no such limits
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    from freqrail.result.axes import first_failures
    from freqrail.result.points import read_result

    answer: dict[str, Any] = {"problems": [], "digest": "", "failures": []}
    try:
        dataset = read_result(path)
        answer |= {"digest": str(dataset.attrs["content_digest"]), "failures": first_failures(dataset)}
    except InputError as fault:
        answer["problems"] = fault.problems
    print(json.dumps(answer))
