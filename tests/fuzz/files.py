"""Damaged result files: refused, or the same numbers; read in child processes, a batch each, with limits."""

from __future__ import annotations

import json
import os
import resource
import selectors
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

import freqrail
from freqrail.errors import InputError
from freqrail.result.netcdf import open_result, write_result
from freqrail.result.sandbox import check_result

SECONDS, START = 10.0, 60.0  # that a child may take for one file, and to start
BYTES = 4 * 10**9  # of its address space
CHILD = "from tests.fuzz.files import child; child()"


def intact(folder: Path) -> Path:
    """A small result with every kind of variable."""
    over = {"speed": "200, 250 km/h", "primary_joint_stiffness": "1, 5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
    over["frequency"] = "1, 10, 50 Hz"
    result = freqrail.sweep("yu-damper-joint", over, psd=True, responses="bogie_acceleration,primary_stroke")
    return write_result(result, folder / "intact.nc")


def damaged(data: bytes, seed: int, number: int) -> bytes:
    """A file's bytes with one kind of damage: flipped bits, other bytes, a lost, moved, doubled or zeroed part."""
    rng = np.random.default_rng((seed, number))
    at, length = int(rng.integers(len(data))), int(2 ** rng.uniform(0, 12))
    if rng.integers(2):  # half of the file is padding, where no damage shows
        used = np.flatnonzero(np.frombuffer(data, np.uint8))
        at = int(rng.choice(used))
    kind = rng.integers(10)
    new = bytearray(data)
    if kind < 4:
        new[at] ^= 1 << int(rng.integers(8))
    elif kind < 6:
        for place in rng.integers(len(data), size=int(rng.integers(2, 17))):
            new[place] = int(rng.integers(256))
    elif kind == 6:
        new = new[:at]
    elif kind == 7:
        new[at : at + length] = bytes(len(new[at : at + length]))
    elif kind == 8:
        new = new[:at] + new[at + length :] if rng.integers(2) else new[:at] + new[at : at + length] + new[at:]
    else:
        other = int(rng.integers(len(data)))
        new[at : at + length] = data[other : other + length]
    return bytes(new)


def fuzz(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """({outcome: how many}, faults) of `count` damaged files; `folder` is for them."""
    source = intact(folder)
    data = source.read_bytes()
    outcomes: Counter[str] = Counter()
    faults = []
    number = 0
    while number < count:
        for done, outcome in batch(source, seed, number, count):
            if outcome in ("hangs", "crashes"):  # the command must do neither
                path = folder / "worst.nc"
                path.write_bytes(damaged(data, seed, done))
                try:
                    check_result(path, seconds=SECONDS)
                    outcome = f"file {done}: {outcome} a reader and passes the check"
                except InputError:
                    pass
            kind = outcome if outcome in ("refused", "the same", "hangs", "crashes") else "fault"
            outcomes[kind] += 1
            if kind == "fault":
                faults.append(outcome)
            number = done + 1
    return outcomes, faults


def batch(source: Path, seed: int, first: int, count: int):
    """(number, outcome) of the files from `first` on, until the last or until one ends the child."""
    command = [sys.executable, "-c", CHILD, str(source)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    environment["PYTHONPATH"] += os.pathsep + str(Path(__file__).parents[2])
    with (
        subprocess.Popen(
            [*command, str(seed), str(first), str(count)],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ) as process,
        selectors.DefaultSelector() as selector,
    ):
        selector.register(process.stdout, selectors.EVENT_READ)
        number, line = first - 1, b""
        limit = time.monotonic() + START
        while number < count - 1:
            if not selector.select(max(0.0, limit - time.monotonic())):
                process.kill()
                yield number + 1, "hangs"
                return
            piece = os.read(process.stdout.fileno(), 65536)
            if not piece:
                yield number + 1, "crashes"
                return
            *whole, line = (line + piece).split(b"\n")
            for answer in map(json.loads, whole):
                limit = time.monotonic() + SECONDS
                if answer["number"] >= 0:  # the first line says that the child has started
                    number = answer["number"]
                    yield number, answer["outcome"]


def child() -> None:
    """In a child: read the damaged files one after the other, and print a line of JSON for each."""
    source, seed, first, count = Path(sys.argv[1]), *map(int, sys.argv[2:])
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    expected = open_result(source)
    data = source.read_bytes()
    path = source.with_name("damaged.nc")
    print(json.dumps({"number": -1}), flush=True)
    for number in range(first, count):
        path.write_bytes(damaged(data, seed, number))
        try:
            found = open_result(path)
        except InputError:
            outcome = "refused"
        except Exception as fault:
            outcome = f"file {number}: {type(fault).__name__}: {fault}"
        else:
            same = found.assign_attrs(history=expected.attrs["history"]).identical(expected)
            outcome = "the same" if same else f"file {number}: accepted with other content"
        print(json.dumps({"number": number, "outcome": outcome}), flush=True)
