"""A sweep into a file: whole or not there, the same bits however it was cut, killed and resumed."""

from __future__ import annotations

import os
import random
import resource
import shlex
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.case.case import load_case
from freqrail.cli import commands
from freqrail.errors import FileError, InputError
from freqrail.result import content, netcdf
from freqrail.sweep import journal, parts, sweep
from freqrail.sweep.plan import Plan

OVER = {
    "speed": "lin:100:300:7 km/h",
    "primary_joint_stiffness": "log:0.5:100:12 MN/m",
    "secondary_joint_stiffness": "log:0.5:100:6 MN/m",
}
ARGUMENTS = ["sweep", "yu-damper-joint", "-o", "o.nc", *(w for k, v in OVER.items() for w in ("--over", f"{k}={v}"))]
KILLS = int(os.environ.get("FREQRAIL_KILLS", "30"))
"""How often a sweep is killed; FREQRAIL_KILLS=200 for the long version."""


@pytest.fixture(scope="module")
def expected():
    return freqrail.sweep("yu-damper-joint", OVER)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def same(path: Path, dataset: xr.Dataset) -> bool:
    """Whether a file holds a dataset to the last bit, the time of its making aside."""
    return freqrail.open_result(path).attrs["content_digest"] == content.content_digest(dataset)


def child(arguments: list[str], prepare=lambda: None) -> int:
    """Process id of a forked freqrail command: no interpreter to start, all modules loaded."""
    process = os.fork()
    if process:
        return process
    try:
        os.dup2(os.open("out.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
        os.dup2(os.open("err.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        prepare()
        code = commands.run(arguments)
        sys.stderr.flush()
        os._exit(code)
    finally:
        os._exit(99)


def ended(process: int) -> int:
    """Exit code of a child, or minus the signal that ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


# --- blocks ------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:.*rigid rail")
@pytest.mark.parametrize("points", [1, 40, 333, 10**6])
@pytest.mark.parametrize("band", ["0.1:100 Hz", "none"])
def test_a_file_has_the_same_bits_however_it_is_cut(here, monkeypatch, points, band):
    monkeypatch.setattr(parts, "POINTS", points)
    case = load_case("yu-damper-joint", {"band" if band == "none" else "frequency": band}, OVER)
    outcome = sweep.sweep_to_file(Plan.of(case, psd=points == 333), here / "o.nc")
    monkeypatch.undo()
    whole = freqrail.sweep(case, psd=points == 333)
    assert same(outcome.path, whole)
    xr.testing.assert_equal(freqrail.open_result(here / "o.nc"), whole)


@pytest.mark.parametrize("over", [OVER, {"secondary_joint_stiffness": "1, 5 MN/m", "speed": "250 km/h"}, {}])
def test_blocks_cover_every_grid_point_once(monkeypatch, over):
    monkeypatch.setattr(parts, "POINTS", 30)
    plan = Plan.of(load_case("yu-damper-joint", over=over))
    for prefix in plan.problems:
        count = np.zeros([axis.si.size for axis in plan.layout.axes(prefix)], int)
        for block in parts.cut(plan):
            if block.prefix == prefix:
                count[block.place] += 1
        assert np.all(count == 1)
    assert len({block.key for block in parts.cut(plan)}) == len(parts.cut(plan))


# --- interruptions -----------------------------------------------------------------------------------


def test_a_killed_sweep_leaves_the_old_file_or_the_new_one_and_resumes_to_the_same_bits(here, monkeypatch, expected):
    monkeypatch.setattr(parts, "POINTS", 30)
    old = freqrail.sweep("yu-damper-joint", {"speed": "200 km/h"})
    start = time.perf_counter()
    assert ended(child(ARGUMENTS)) == 0
    takes = time.perf_counter() - start
    assert same(here / "o.nc", expected)
    times, outcomes = random.Random(7), {"old": 0, "new": 0, "resumed": 0}

    def seen() -> bool:
        """Whether enough kills came before the file was replaced, and enough of these after a block was finished."""
        return outcomes["old"] > KILLS / 3 and outcomes["resumed"] > KILLS / 6

    for kill in range(4 * KILLS):
        if kill >= KILLS and seen():  # on a machine under load the moments of the first KILLS may all be too early
            break
        for path in here.iterdir():
            path.unlink()
        netcdf.write_result(old, here / "o.nc")
        before = (here / "o.nc").read_bytes()
        process = child([*ARGUMENTS, "--overwrite"])
        time.sleep(times.uniform(0, takes))
        os.kill(process, signal.SIGKILL)
        if ended(process) == 0 or (here / "o.nc").read_bytes() != before:
            assert same(here / "o.nc", expected)
            outcomes["new"] += 1
        else:
            outcomes["old"] += 1
        assert ended(child([*ARGUMENTS, "--overwrite", "--resume"])) == 0
        assert same(here / "o.nc", expected)
        outcomes["resumed"] += " 0 blocks taken over" not in (here / "out.txt").read_text()
        assert sorted(path.name for path in here.iterdir()) == ["err.txt", "o.nc", "out.txt"]
    assert seen(), outcomes


@pytest.mark.parametrize(
    ("sent", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_an_interrupted_sweep_says_how_to_go_on(here, sent, code, word):
    """Ctrl-C, or a batch system's signal, once the first block is kept: the blocks kept, one line with the command."""
    script = "from freqrail.cli import commands; from freqrail.sweep import parts; parts.POINTS = 2; commands.main()"
    with subprocess.Popen([sys.executable, "-c", script, *ARGUMENTS], stderr=subprocess.PIPE, text=True) as process:
        while not (here / ".o.nc.journal").exists():
            time.sleep(0.01)
        time.sleep(0.2)
        process.send_signal(sent)
        told = [line for line in process.communicate(timeout=60)[1].splitlines() if line]
    assert process.returncode == code
    assert told[-1] == f"freqrail: {word}"
    assert told[-2].startswith("freqrail: finished blocks are kept; to go on: ")
    assert shlex.split(told[-2])[-len(ARGUMENTS) - 1 :] == [*ARGUMENTS, "--resume"]
    assert sorted(path.name for path in here.iterdir()) == [".o.nc.journal"]


# --- the journal -------------------------------------------------------------------------------------


def interrupted(here: Path, monkeypatch, kept: int = 5) -> Path:
    """The journal of a sweep that was stopped after some blocks."""
    monkeypatch.setattr(parts, "POINTS", 30)
    keep = journal.Journal.keep
    done: list[str] = []

    def stop(self, key, data):
        if len(done) == kept:
            raise KeyboardInterrupt
        done.append(key)
        keep(self, key, data)

    monkeypatch.setattr(journal.Journal, "keep", stop)
    assert commands.run(ARGUMENTS) == 130
    monkeypatch.setattr(journal.Journal, "keep", keep)
    return here / ".o.nc.journal"


def test_a_resumed_sweep_takes_over_what_is_done(here, monkeypatch, expected, capsys):
    interrupted(here, monkeypatch)
    computed = []
    compute = parts.compute
    monkeypatch.setattr(parts, "compute", lambda *given: computed.append(given) or compute(*given))
    assert commands.run([*ARGUMENTS, "--resume"]) == 0
    plan = Plan.of(load_case("yu-damper-joint", over=OVER))
    assert len(computed) == len(parts.cut(plan)) - 5
    assert "5 blocks taken over" in capsys.readouterr().out
    assert same(here / "o.nc", expected)


def test_a_damaged_block_is_computed_anew(here, monkeypatch, expected, capsys):
    path = interrupted(here, monkeypatch)
    with sqlite3.connect(path) as database:
        key, data = database.execute("select key, data from block limit 1").fetchone()
        database.execute("update block set data = ? where key = ?", (data[:100] + b"\0" + data[101:], key))
    assert commands.run([*ARGUMENTS, "--resume"]) == 0
    assert "4 blocks taken over" in capsys.readouterr().out
    assert same(here / "o.nc", expected)


@pytest.mark.parametrize("change", [["--set", "bogie_mass=650 kg"], ["--responses", "all"], ["--psd"]])
def test_a_journal_of_another_sweep_is_refused(here, monkeypatch, capsys, change):
    path = interrupted(here, monkeypatch)
    before = path.read_bytes()
    assert commands.run([*ARGUMENTS, "--resume", *change]) == 2
    told = capsys.readouterr().err.splitlines()[-1]
    assert "--resume" in told
    assert "another case, grid, responses" in told
    assert path.read_bytes() == before


def test_a_corrupt_journal_is_refused(here, monkeypatch, capsys):
    interrupted(here, monkeypatch).write_bytes(b"no database " * 1000)
    assert commands.run([*ARGUMENTS, "--resume"]) == 2
    assert "damaged" in capsys.readouterr().err.splitlines()[-1]


def test_without_resume_a_journal_is_begun_afresh_and_the_user_told(here, monkeypatch, expected, capsys):
    interrupted(here, monkeypatch)
    assert commands.run(ARGUMENTS) == 0
    told = capsys.readouterr()
    assert "started afresh, --resume would have gone on" in told.err
    assert "taken over" not in told.out
    assert same(here / "o.nc", expected)
    assert not (here / ".o.nc.journal").exists()


# --- faults of the disk ------------------------------------------------------------------------------


class Fault(OSError):
    """What a disk does now and then."""


def steps() -> dict[str, tuple[object, str]]:
    """Every step of writing a file, as (owner, name) of the function that does it."""
    return {
        "skeleton": (xr.Dataset, "to_netcdf"),
        "variable": (netcdf, "_create"),
        "checksum": (netcdf, "_checksum"),
        "digest": (netcdf, "content_digest"),
        "open": (netcdf.netCDF4, "Dataset"),
        "fsync": (os, "fsync"),
        "replace": (os, "replace"),
    }


@pytest.mark.parametrize("call", [1, 2])
@pytest.mark.parametrize("step", ["skeleton", "variable", "checksum", "digest", "open", "fsync", "replace"])
def test_a_fault_at_any_step_leaves_the_old_file_and_the_finished_blocks(here, monkeypatch, expected, step, call):
    monkeypatch.setattr(parts, "POINTS", 200)
    netcdf.write_result(freqrail.sweep("yu-damper-joint", {"speed": "200 km/h"}), here / "o.nc")
    before = (here / "o.nc").read_bytes()
    # xarray shares the library's module, and asks it for types: the package gets one of its own
    monkeypatch.setattr(netcdf, "netCDF4", SimpleNamespace(**vars(netcdf.netCDF4)))
    owner, name = steps()[step]
    real, calls = getattr(owner, name), []

    def failing(*given, **named):
        calls.append(given)
        if len(calls) == call:
            raise Fault(28, "No space left on device")
        return real(*given, **named)

    with monkeypatch.context() as patch:
        patch.setattr(owner, name, failing)
        code = commands.run([*ARGUMENTS, "--overwrite"])
    if len(calls) < call:  # a step that comes once only
        assert code == 0
        return
    assert code == 4
    if (step, call) != ("fsync", 2):  # by then the new file, already on the disk, has taken the old one's place
        assert (here / "o.nc").read_bytes() == before
        assert sorted(path.name for path in here.iterdir()) == [".o.nc.journal", "o.nc"]
    assert commands.run([*ARGUMENTS, "--overwrite", "--resume"]) == 0
    assert same(here / "o.nc", expected)


@pytest.mark.parametrize("limit", [1_000, 5_000, 20_000, 60_000, 120_000, 200_000, 400_000])
def test_a_file_that_cannot_grow_is_an_error_and_the_old_one_stays(here, expected, limit):
    """ulimit -f: the disk takes so many bytes a file and no more."""
    netcdf.write_result(freqrail.sweep("yu-damper-joint", {"speed": "200 km/h"}), here / "o.nc")
    before = (here / "o.nc").read_bytes()
    code = ended(child([*ARGUMENTS, "--overwrite"], lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))))
    if code == 0:
        assert limit > len((here / "o.nc").read_bytes())
        assert same(here / "o.nc", expected)
        return
    assert code == 4
    assert (here / "o.nc").read_bytes() == before
    told = (here / "err.txt").read_text()
    assert told.startswith("freqrail: error: ")
    assert "Traceback" not in told


# --- others at the same file -------------------------------------------------------------------------


def test_a_second_writer_is_turned_away(here, capsys):
    with netcdf.lock(here / "o.nc"):
        assert commands.run(ARGUMENTS) == 4
    assert "another run of freqrail is writing this file" in capsys.readouterr().err
    assert commands.run(ARGUMENTS) == 0


def test_the_lock_of_a_killed_run_holds_nobody_up(here):
    process = child(ARGUMENTS, lambda: netcdf.lock(here / "o.nc").__enter__() and os.kill(os.getpid(), signal.SIGKILL))
    ended(process)
    with netcdf.lock(here / "o.nc"):
        pass


def test_the_lock_is_one_at_a_time(here):
    with netcdf.lock(here / "o.nc"), pytest.raises(FileError, match="another run"), netcdf.lock(here / "o.nc"):
        pass


def test_a_reader_keeps_the_file_it_opened(here, expected):
    old = freqrail.sweep("yu-damper-joint", {"speed": "200 km/h"})
    netcdf.write_result(old, here / "o.nc")
    with xr.open_dataset(here / "o.nc", cache=False) as held:
        assert commands.run([*ARGUMENTS, "--overwrite"]) == 0
        xr.testing.assert_equal(held.load(), old)
    assert same(here / "o.nc", expected)


def test_a_grid_beyond_the_memory_is_refused_before_it_is_allocated(monkeypatch):
    """In memory; a file is written block by block, whatever its size."""
    monkeypatch.setattr("os.sysconf", {"SC_PHYS_PAGES": 1, "SC_PAGE_SIZE": 4096}.__getitem__)
    with pytest.raises(InputError, match="too large for this machine"):
        freqrail.sweep("yu-damper-joint")
