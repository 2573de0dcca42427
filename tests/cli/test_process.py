"""A command in surroundings of every kind: closed and full streams, names of any bytes, no memory, foreign settings.

Each in a process of its own.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

import freqrail

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="streams, limits and names of Linux")

POINT = [
    part
    for axis in ("speed=249, 250 km/h", "primary_joint_stiffness=5 MN/m", "secondary_joint_stiffness=5 MN/m")
    for part in ("--over", axis)
]
SWEEP = ["sweep", "yu-damper-joint", *POINT]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def intact(tmp_path_factory) -> Path:
    """A small result. Not to be changed."""
    over = {"speed": "200, 250 km/h", "primary_joint_stiffness": "1, 5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
    return freqrail.write_result(freqrail.sweep("yu-damper-joint", over), tmp_path_factory.mktemp("i") / "intact.nc")


def command(*arguments: str | bytes, python: tuple[str, ...] = (), shell: str = "", **options: object):
    """The command in a process of its own; shell: redirections as a shell knows them."""
    program = [sys.executable, *python, "-m", "freqrail", *arguments]
    if shell:
        program = ["bash", "-c", f'exec "$@" {shell}', "bash", *program]
    done = subprocess.run(program, capture_output=True, timeout=120, **options)
    assert b"Traceback" not in done.stderr
    assert b"Exception ignored" not in done.stderr
    return done


def one_line(done: subprocess.CompletedProcess[bytes], exit_code: int, words: str) -> None:
    assert done.returncode == exit_code
    (line,) = done.stderr.decode().splitlines()
    assert line.startswith("freqrail: error: ")
    assert words in line


# --- streams -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [["show", "yu-damper-joint"], ["modes", "yu-damper-joint", "--json"], ["cases"], ["--help"]],
    ids=" ".join,
)
def test_a_closed_stdout_is_as_a_closed_pipe(arguments):
    done = command(*arguments, shell=">&-")
    assert (done.returncode, done.stderr) == (4, b"")


@pytest.mark.parametrize("streams", [">&-", ">&- 2>&-", "<&- >&- 2>&-", "2>&-", "<&-"])
def test_no_file_takes_the_place_of_a_closed_stream(streams, here):
    done = command(*SWEEP, "-o", "out.nc", shell=streams)
    assert done.returncode == (4 if ">&-" in streams.replace("2>&-", "") else 0)
    assert freqrail.open_result("out.nc").sizes["speed"] == 2
    assert os.listdir() == ["out.nc"]


@pytest.mark.parametrize("streams", ["2>&-", "2>/dev/full"])
def test_messages_that_nobody_takes_change_no_exit_code(streams, here):
    assert command("show", "none.nc", shell=streams).returncode == 2
    assert command("sweep", shell=streams).returncode == 2
    assert command(*SWEEP, "--set", "band=none", "-o", "out.nc", shell=streams).returncode == 0  # with a warning
    assert freqrail.open_result("out.nc").sizes["speed"] == 2


# --- names -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [b"x\xff.nc", b"a\\b.nc", "ü.nc".encode(), b"new\nline.nc"], ids=repr)
@pytest.mark.parametrize("locale", ["C", "C.UTF-8"])
def test_an_output_lands_whatever_its_name(name, locale, here):
    environment = {**os.environ, "LC_ALL": locale}
    assert command(*SWEEP, "-o", name, env=environment).returncode == 0
    assert os.listdir(b".") == [name]
    for arguments in (["show"], ["show", "--check"], ["plot", "-o", "figures"]):
        assert command(arguments[0], name, *arguments[1:], env=environment).returncode == 0
    assert freqrail.open_result(os.fsdecode(name)).sizes["speed"] == 2


@pytest.mark.parametrize("folder", [b"d\xff", b"e\\f"], ids=repr)
def test_so_it_does_in_a_folder_of_any_name(folder, here):
    os.mkdir(folder)
    assert command(*SWEEP, "-o", "out.nc", cwd=folder).returncode == 0
    assert command(*SWEEP, "-o", folder + b"/too.nc").returncode == 0
    assert command("plot", "out.nc", cwd=folder).returncode == 0
    assert sorted(os.listdir(folder)) == [b"out-figures", b"out.nc", b"too.nc"]


def test_a_case_file_of_any_name_is_swept(here):
    with open(b"c\xff.toml", "w") as file:
        file.write(freqrail.shipped_cases()["yu-damper-joint"])
    assert command("sweep", b"c\xff.toml", *POINT, "-o", "out.nc").returncode == 0
    assert freqrail.open_result("out.nc").attrs["case_name"] == "c\N{REPLACEMENT CHARACTER}"


def test_a_name_too_long_for_the_files_beside_it_is_found_before_computing(here):
    one_line(command(*SWEEP, "-o", f"{'x' * 245}.nc"), 4, "this name is too long")
    assert os.listdir() == []


# --- memory ------------------------------------------------------------------------------------------


def limited(megabytes: int):
    return lambda: resource.setrlimit(resource.RLIMIT_AS, (megabytes * 10**6, megabytes * 10**6))


@pytest.mark.parametrize("megabytes", [250, 300, 400])
def test_too_little_memory_to_start_is_told_at_once(megabytes, here):
    done = command(*SWEEP, "-o", "out.nc", preexec_fn=limited(megabytes))
    one_line(done, 4, f"out of memory: the address space is limited to {megabytes} MB (ulimit -v), at least")
    assert os.listdir() == []


def test_memory_that_runs_out_is_one_line_and_what_was_there_stays(here):
    Path("old.nc").write_bytes(b"old")
    one = [part for joint in ("primary", "secondary") for part in ("--over", f"{joint}_joint_stiffness=5 MN/m")]
    axes = ["--over", "bogie_mass=lin:600:700:10000000 kg", "--over", "speed=250 km/h", *one]
    done = command("sweep", "yu-damper-joint", *axes, "-o", "old.nc", "--overwrite", preexec_fn=limited(700))
    one_line(done, 4, "out of memory: the address space is limited to 700 MB")
    assert Path("old.nc").read_bytes() == b"old"


def test_memory_that_runs_out_keeps_the_journal(here, monkeypatch, capsys):
    from freqrail.cli import commands
    from freqrail.sweep import parts

    monkeypatch.setattr(parts, "POINTS", 10)
    compute, calls = parts.compute, []

    def greedy(*arguments: object) -> object:
        calls.append(arguments)
        if len(calls) > 2:
            raise MemoryError
        return compute(*arguments)

    monkeypatch.setattr(parts, "compute", greedy)
    axes = ["--over", "primary_joint_stiffness=log:1:9:50 MN/m"]
    assert commands.run(["sweep", "yu-damper-joint", *axes, "-o", "out.nc"]) == 4
    kept, error = capsys.readouterr().err.splitlines()
    assert "finished blocks are kept; to go on: " in kept
    assert error == "freqrail: error: out of memory"
    assert os.listdir() == [".out.nc.journal"]


# --- other people's settings ---------------------------------------------------------------------------

SETTINGS = {
    "a backend that is none": {"MPLBACKEND": "bogus"},
    "a backend with windows": {"MPLBACKEND": "TkAgg"},
    "no home": {"HOME": "/nonexistent", "MPLCONFIGDIR": "/proc/none", "TMPDIR": "/nonexistent"},
    "a home that is no folder": {"HOME": "/dev/null", "MPLCONFIGDIR": "/dev/null", "XDG_CACHE_HOME": "/dev/null"},
}


@pytest.mark.parametrize("row", SETTINGS)
def test_figures_are_drawn_whatever_the_environment_says(row, here, intact):
    done = command("plot", str(intact), "-o", "figures", env={**os.environ, **SETTINGS[row]})
    assert done.returncode == 0
    assert all(line.startswith("freqrail: ") for line in done.stderr.decode().splitlines())


@pytest.mark.parametrize(
    "text", [b"axes.grid: \xff\xfe", b"backend: nope\nfont.size: zz\nbad line\n"], ids=["bytes", "words"]
)
def test_a_broken_matplotlibrc_is_nobody_s_business(text, here, intact):
    Path("matplotlibrc").write_bytes(text)
    done = command("plot", str(intact), "-o", "figures", env={**os.environ, "MATPLOTLIBRC": str(here)})
    assert done.returncode == 0
    assert all(line.startswith("freqrail: ") for line in done.stderr.decode().splitlines())


@pytest.mark.parametrize(
    "arguments",
    [["cases"], ["show", "yu-damper-joint"], ["modes", "yu-damper-joint"], [*SWEEP, "-o", "out.nc"], ["plot"]],
    ids=lambda words: words[0],
)
def test_warnings_turned_into_errors_stop_no_command(arguments, here, intact):
    arguments = ["plot", str(intact), "-o", "figures"] if arguments == ["plot"] else arguments
    for how in ({"python": ("-W", "error")}, {"env": {**os.environ, "PYTHONWARNINGS": "error"}}):
        assert command(*arguments, **how).returncode == 0
        Path("out.nc").unlink(missing_ok=True)
