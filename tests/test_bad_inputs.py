"""Bad inputs of every kind, given to the commands as a user gives them: a row each, with its exit code and the words
that name the fault; no traceback, one line a problem, and whatever output file was there before stays as it was.

The contents of most bad case files stand in test_case; here they go through the command. In this process but where
the operating system decides: there the command runs in a process of its own.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.cli import commands
from freqrail.cli.commands import run
from freqrail.figures import plot
from freqrail.result import sandbox
from freqrail.solver import solve
from tests.case.test_case import ACCEPTED, FAULTS, PLAIN, UNREADABLE, put

OLD = b"an output file of another day"
SMALL = {
    "speed": "200, 250 km/h",
    "primary_joint_stiffness": "1, 5 MN/m",
    "secondary_joint_stiffness": "5 MN/m",
}


def over(**axes: str) -> list[str]:
    """Options for a single point of the paper's case, but for the axes given."""
    point = {"speed": "250 km/h", "primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
    return [part for name, axis in {**point, **axes}.items() for part in ("--over", f"{name}={axis}")]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def intact(tmp_path_factory) -> Path:
    """A small result. Not to be changed."""
    return freqrail.write_result(
        freqrail.sweep("yu-damper-joint", SMALL), tmp_path_factory.mktemp("intact") / "intact.nc"
    )


def told(capsys) -> list[str]:
    """What the command said on stderr, a line each."""
    err = capsys.readouterr().err
    assert "Traceback" not in err
    return err.splitlines()


def refuses(arguments: list[str], exit_code: int, words: str | list[str], capsys) -> None:
    """One line on stderr that holds the words, nothing on stdout, and the exit code."""
    assert run(arguments) == exit_code
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert line.startswith("freqrail: error: ")
    assert all(some in line for some in ([words] if isinstance(words, str) else words))
    assert line.isprintable()


def without_override() -> None:
    """In a child: root obeys the mode bits of files as everyone does."""
    for capability in (1, 2):  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH
        ctypes.CDLL(None).prctl(24, capability, 0, 0, 0)  # PR_CAPBSET_DROP


def process(*arguments: str, stdout: int = subprocess.PIPE, **options: object) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "freqrail", *arguments],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        timeout=120,
        **options,
    )
    assert "Traceback" not in done.stderr
    return done


def fails(done: subprocess.CompletedProcess[str], exit_code: int, words: str) -> None:
    assert done.returncode == exit_code
    (line,) = done.stderr.splitlines()
    assert line.startswith("freqrail: error: ")
    assert words in line


linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="drops a capability of Linux")


# --- case files, exit 2 ----------------------------------------------------------------------------

# contents, and words that the message holds
BAD_FILES: dict[str, tuple[bytes, str, str]] = {
    **{row: (content, "study.toml: ", words) for row, (content, words) in UNREADABLE.items()},
    **{row: (content.encode(), f"study.toml: {place}: ", words) for row, (content, place, words) in FAULTS.items()},
    "a table 3,000 deep": ((PLAIN + "[a" + ".a" * 3000 + "]\n").encode(), "study.toml: ", "nested too deeply"),
    "tables in tables, 3,000 of them": (
        (PLAIN + "".join(f"[{'.'.join('a' * n)}]\n" for n in (10, 20, 40))).encode(),
        "study.toml: [a]: ",
        "unknown table",
    ),
    "a joint in millinewtons": (
        put("vehicle", "primary_joint_stiffness", '"5 mN/m"').encode(),
        "study.toml: [vehicle].primary_joint_stiffness: ",
        '; "mN/m" is millinewtons: did you mean "MN/m"?',
    ),
    "an escape in what was given": (
        put("vehicle", "bogie_mass", r'"\u001b[31m"').encode(),
        "study.toml: [vehicle].bogie_mass: ",
        r"(got '\x1b[31m')",
    ),
}


@pytest.mark.parametrize("row", BAD_FILES)
def test_a_bad_case_file_is_one_line_and_exit_2(row, here, capsys):
    content, *words = BAD_FILES[row]
    Path("study.toml").write_bytes(content)
    Path("old.nc").write_bytes(OLD)
    refuses(["sweep", "study.toml", "-o", "old.nc", "--overwrite"], 2, words, capsys)
    assert Path("old.nc").read_bytes() == OLD
    assert sorted(path.name for path in here.iterdir()) == ["old.nc", "study.toml"]


@pytest.mark.parametrize("row", ACCEPTED)
def test_an_odd_but_right_case_file_goes_on(row, here, capsys):
    Path("study.toml").write_bytes(ACCEPTED[row].encode())
    assert run(["sweep", "study.toml", "--dry-run", *over()]) == 0
    assert not [line for line in told(capsys) if "error" in line]


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("none.toml", "none.toml: no such case file"),
        (".", ".: is a folder, a case file is expected"),
        ("x" * 5000, "cannot be opened: File name too long"),
        ("x\0y", r"x\x00y: no such case file"),
        (os.devnull, "is not a regular file"),
    ],
)
def test_what_is_no_case_file_at_all(case, words, here, capsys):
    refuses(["sweep", case], 2, words, capsys)


# --- case files that are warned of ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("joint", "exit_code"),
    [("secondary_joint_stiffness", 0), ("primary_joint_stiffness", 3)],
)
def test_a_joint_of_5_newtons_a_metre_is_warned_of_and_computed_as_far_as_it_can_be(joint, exit_code, here, capsys):
    """Behind such a primary joint the bogies pitch with a damping ratio of 5e-12, for 120 years: double precision
    places no node on that peak to 1e-6, and no number is better than a wrong one. What does not feel the bogies pitch
    has its numbers, and the traditional model has them all.
    """
    assert run([*SWEEP, *over(**{joint: "5 N/m"}), "-o", "soft.nc"]) == exit_code
    lines = told(capsys)
    assert lines[0].startswith(f"freqrail: warning: --over {joint}: 5 N/m is ")
    assert "below 0.01: the damper hardly acts; check the unit" in lines[0]
    assert len(lines) == (1 if exit_code == 0 else 3)  # and such a bogie's wheels leave the rail
    result = freqrail.open_result("soft.nc")
    assert np.isfinite(result.primary_stroke_rms).all() == (exit_code == 0)
    for name in ("bogie_acceleration_rms", "traditional_bogie_acceleration_rms", "traditional_primary_stroke_rms"):
        assert np.isfinite(result[name]).all()


def test_millinewtons_are_warned_of(here, capsys):
    assert run([*SWEEP, "--set", "secondary_stiffness=412e6 mN/m", "--dry-run"]) == 0
    (line,) = told(capsys)
    assert line == (
        'freqrail: warning: --set secondary_stiffness: "mN/m" is millinewtons: did you mean "MN/m"? (got "412e6 mN/m")'
    )


def test_control_characters_of_a_title_are_kept_in_the_file_and_escaped_on_the_terminal(here, capsys):
    Path("study.toml").write_text(put("", "title", r'"red \u001b[31m bell \u0007"'))
    assert run(["sweep", "study.toml", *over(), "-o", "study.nc"]) == 0
    assert run(["show", "study.nc"]) == 0
    out = capsys.readouterr().out
    assert not set(out) & {"\x1b", "\x07"}
    assert r"red \x1b[31m bell \x07" in out
    assert freqrail.open_result("study.nc").attrs["title"] == "red \x1b[31m bell \x07"


# --- the command line, exit 2 ----------------------------------------------------------------------

SWEEP = ["sweep", "yu-damper-joint"]
USAGE = {
    "unknown option": ([*SWEEP, "--sped"], "No such option"),
    "unknown command": (["swep"], "No such command 'swep'"),
    "missing argument": (["sweep"], "Missing argument 'CASE'"),
    "an argument too many": ([*SWEEP, "again"], "unexpected extra argument"),
    "jobs 0": ([*SWEEP, "--jobs", "0"], "0 is not in the range x>=1"),
    "jobs in words": ([*SWEEP, "--jobs", "two"], "'two' is not a valid integer"),
    "nan in --set": ([*SWEEP, "--set", "bogie_mass=nan kg"], "nan is not a number"),
    "nan in --over": ([*SWEEP, "--over", "speed=nan km/h"], "nan is not a number"),
    "nan in --at": (["show", "intact.nc", "--at", "speed=nan km/h"], "nan is not a number"),
    "inf in --set": ([*SWEEP, "--set", "bogie_mass=inf kg"], "inf is not allowed here"),
    "no = in --set": ([*SWEEP, "--set", "bogie_mass"], 'NAME=VALUE, as in "speed=250 km/h" (got "bogie_mass")'),
    "no = in --over": ([*SWEEP, "--over", "speed:100"], 'NAME=VALUE, as in "speed=250 km/h" (got "speed:100")'),
    "no name in --over": ([*SWEEP, "--over", "=100"], "NAME=VALUE"),
    "unknown name in --set": ([*SWEEP, "--set", "bogie_mas=1 kg"], "unknown name (did you mean bogie_mass?)"),
    "unknown name in --over": ([*SWEEP, "--over", "sped=1 km/h"], "unknown name (did you mean speed?)"),
    "unknown name in --at": (["show", "intact.nc", "--at", "sped=1 km/h"], "unknown name (did you mean speed?)"),
    "off the grid in --at": (["show", "intact.nc", "--at", "bogie_mass=3 t"], "is not swept, the case has 600 kg"),
    "plot format": (["plot", "none.nc", "--format", "gif"], "'gif' is not one of 'png', 'svg', 'pdf'"),
    "no output name": ([*SWEEP, "-o", ""], "-o: the name is empty"),
    "output without .nc": ([*SWEEP, "-o", "out"], 'the name of a NetCDF file ends in ".nc"; did you mean out.nc?'),
    "output of another kind": ([*SWEEP, "-o", "out.png"], "did you mean out.png.nc?"),
    "output a folder": ([*SWEEP, "-o", "."], "is a folder; name a file in it"),
    "output exists": ([*SWEEP, "-o", "old.nc"], "old.nc: exists already; --overwrite replaces it"),
    "output is the input": (["sweep", "case.nc", "-o", "case.nc", "--overwrite"], "is the input itself"),
    "output links to the input": (["sweep", "case.nc", "-o", "link.nc", "--overwrite"], "is the input itself"),
    "output is the input by another way": (["sweep", "case.nc", "-o", "./case.nc", "--overwrite"], "is the input"),
    "output is a hard link of the input": (["sweep", "case.nc", "-o", "hard.nc", "--overwrite"], "is the input itself"),
    "an axis above 1e7": ([*SWEEP, "--over", "speed=lin:1:600:10000001 km/h"], "10000001 values exceeds the limit"),
    "a grid of masses too large to be made": (  # K_H follows from all three of them (eq. 1)
        [*SWEEP, *over(**{f"{body}_mass": "lin:500:900:20000 kg" for body in ("car_body", "bogie", "wheelset")})],
        "the result is too large for this disk",
    ),
    "a grid above the memory or the disk": (
        [*SWEEP, "--psd", *over(speed="lin:1:600:5000 km/h", primary_joint_stiffness="lin:1:9:5000 MN/m")],
        "the result is too large for this disk",
    ),
    "a grid of more points than there are numbers": (
        [
            *SWEEP,
            *over(**{f"{body}_mass": "lin:100:1000:3000000 kg" for body in ("car_body", "bogie", "wheelset")}),
        ],
        "--over car_body_mass: the axes span 2.7e+19 points, more than can be counted (limit 9.22e+18)",
    ),
    "a dask address without its host": (
        [*SWEEP, "--dask", "tcp://"],
        'as in tcp://HOST:8786, is expected (got "tcp://")',
    ),
    "an empty dask address": ([*SWEEP, "--dask", ""], 'as in tcp://HOST:8786, is expected (got "")'),
    "--set of a swept name": ([*SWEEP, "--set", "speed=9 km/h"], 'give it one value with --over "speed=9 km/h"'),
    "--set twice": ([*SWEEP, "--set", "bogie_mass=1 t", "--set", "bogie_mass=2 t"], "given twice; give it once"),
    "--over twice": ([*SWEEP, "--over", "speed=1 km/h", "--over", "speed=2 km/h"], "given twice; give it once"),
    "--set of both bands": (
        [*SWEEP, "--set", "frequency=1:10 Hz", "--set", "wavelength=1:10 m"],
        "--set wavelength: excludes --set frequency; give one of the two",
    ),
    "--set of a band and of none": (
        [*SWEEP, "--set", "frequency=1:10 Hz", "--set", "band=none"],
        "--set band: excludes --set frequency; give one of the two",
    ),
    "--set of both contacts": (
        [*SWEEP, "--set", "contact_constant=5e-8 m/N^(2/3)", "--set", "contact_stiffness=1 GN/m"],
        "--set contact_stiffness: excludes --set contact_constant; give one of the two",
    ),
    "--over of both contacts": (
        [*SWEEP, "--over", "contact_stiffness=1, 2 GN/m", "--over", "contact_constant=5e-8, 6e-8 m/N^(2/3)"],
        "--over contact_constant: excludes --over contact_stiffness; give one of the two",
    ),
    "no file of samples": ([*SWEEP, "--samples", "x.csv"], "x.csv: no such file; a CSV file of samples is expected"),
    "a file of samples without a name": ([*SWEEP, "--samples", ""], ".: is a folder"),
    "a folder of samples": ([*SWEEP, "--samples", "/dev"], "/dev: is a folder"),
    "a device of samples": ([*SWEEP, "--samples", "/dev/zero"], "/dev/zero: is not a regular file"),
    "a result for samples": ([*SWEEP, "--samples", "intact.nc"], "intact.nc: is a NetCDF file, a CSV file of samples"),
    "a case for samples": ([*SWEEP, "--samples", "case.nc"], "case.nc: line 1: column 1: unknown name"),
    "two points": (["show", "intact.nc", *["--at", "speed=250 km/h"] * 2], "given 2 times; this command takes one"),
    "an axis of spectra without --psd": ([*SWEEP, "--over", "frequency=1, 2 Hz"], "add --psd"),
    "unknown response": ([*SWEEP, "--responses", "bogie_accel"], "did you mean bogie_acceleration?"),
    "unknown response beside others": ([*SWEEP, "--responses", "paper,x"], "unknown response 'x' (known: paper, all,"),
    "no response": ([*SWEEP, "--responses", ""], "unknown response '' (known: paper"),
    "unknown case": (["sweep", "yu-damper-join"], "did you mean yu-damper-joint?"),
    "unknown case to print": (["cases", "yu"], "no shipped case of that name"),
    "--at of a case": (["show", "yu-damper-joint", "--at", "speed=250 km/h"], "goes with a result"),
    "--set of a result": (["show", "intact.nc", "--set", "bogie_mass=1 t"], "goes with a case"),
    "--check of a case": (["show", "yu-damper-joint", "--check"], "goes with a result, not with a case"),
}


@pytest.mark.parametrize("row", USAGE)
def test_bad_usage_is_one_line_and_exit_2(row, here, intact, capsys, monkeypatch):
    def computes(*_: object) -> None:
        raise AssertionError("computing began before the fault was found")

    monkeypatch.setattr(solve, "solve", computes)
    monkeypatch.setattr(plot, "plot", computes)
    shutil.copy(intact, "intact.nc")
    Path("old.nc").write_bytes(OLD)
    Path("case.nc").write_text(PLAIN)
    Path("link.nc").symlink_to("case.nc")
    os.link("case.nc", "hard.nc")
    before = {path.name: path.read_bytes() for path in here.iterdir()}
    arguments, words = USAGE[row]
    refuses(arguments, 2, words, capsys)
    assert {path.name: path.read_bytes() for path in here.iterdir()} == before


# --- quantities beyond their range, exit 2 -------------------------------------------------------------

RANGES = {
    "car_body_mass": ("1e-300 kg", "1e300 kg", "must be from 0.01 to 1e+11 kg"),
    "car_body_pitch_inertia": ("1e-300 kg*m^2", "1e300 kg*m^2", "must be from 0.1 to 1e+13 kg*m^2"),
    "bogie_mass": ("1e-300 kg", "1e300 kg", "must be from 0.001 to 1e+10 kg"),
    "bogie_pitch_inertia": ("1e-300 kg*m^2", "1e300 kg*m^2", "must be from 0.001 to 1e+10 kg*m^2"),
    "wheelset_mass": ("1e-300 kg", "1e300 kg", "must be from 0.001 to 1e+10 kg"),
    "primary_stiffness": ("1e-300 N/m", "1e300 N/m", "must be from 0.0001 to 1e+10 kN/m"),
    "primary_damping": ("1e-300 N*s/m", "1e300 N*s/m", "must be 0, or from 1e-06 to 1e+08 kN*s/m"),
    "secondary_stiffness": ("1e-300 N/m", "1e300 N/m", "must be from 0.0001 to 1e+10 kN/m"),
    "secondary_damping": ("1e-300 N*s/m", "1e300 N*s/m", "must be 0, or from 1e-06 to 1e+08 kN*s/m"),
    "half_bogie_spacing": ("1e-300 m", "1e300 m", "must be from 1e-06 to 1e+07 m"),
    "half_wheelbase": ("1e-300 m", "1e300 m", "must be from 1e-06 to 1e+07 m"),
    "contact_constant": ("1e-300 m/N^(2/3)", "1e300 m/N^(2/3)", "must be from 1e-14 to 0.1 m/N^(2/3)"),
    "contact_stiffness": ("1e-300 N/m", "1e300 N/m", "must be from 1e-07 to 1e+07 GN/m"),
    "frequency": ("1e-300:100 Hz", "0.1:1e300 Hz", "must be from 1e-08 to 1e+10 Hz"),
    "wavelength": ("1e-300:100 m", "1:1e300 m", "must be from 1e-08 to 1e+09 m"),
}


@pytest.mark.parametrize("name", RANGES)
def test_a_value_beyond_all_vehicles_is_refused_with_the_range(name, here, capsys):
    *values, words = RANGES[name]
    for value in values:
        refuses(
            [*SWEEP, "--set", f"{name}={value}"],
            2,
            [f"--set {name}: {words} (got ", "e300" if "e300" in value else "e-300"],
            capsys,
        )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--over", "speed=1e-300, 250 km/h"], "--over speed: must be from 1e-05 to 600 km/h"),
        (["--over", "primary_joint_stiffness=5, 1e300, inf N/m"], "must be from 1e-06 to 1e+08 MN/m"),
        (["--over", "primary_damping=0, 1e-300, 17 N*s/m"], "must be 0, or from 1e-06 to 1e+08 kN*s/m"),
        (["--over", "secondary_stiffness=log:1:1e300:3 N/m"], "must be from 0.0001 to 1e+10 kN/m"),
        (["--over", "bogie_mass=1e-300, 600 kg"], "--over bogie_mass: must be from 0.001 to 1e+10 kg"),
    ],
)
def test_so_is_a_value_of_an_axis(arguments, words, here, capsys):
    refuses([*SWEEP, *arguments], 2, words, capsys)


def test_so_is_a_track_beyond_all_tracks(here, capsys):
    track = ["--set", "spectrum=rational", "--set", "roughness=4e-7 m^2*rad/m"]
    refuses([*SWEEP, *track, "--set", "cutoffs=1e-300:0.8 rad/m"], 2, "must be from 1e-09 to 1e+07 rad/m", capsys)
    track[-1] = "roughness=1e-300 m^2*rad/m"
    refuses([*SWEEP, *track, "--set", "cutoffs=0.02:0.8 rad/m"], 2, "must be from 1e-14 to 10 m^2*rad/m", capsys)


@pytest.mark.parametrize(
    "value", ["car_body_mass=0.01 kg", "primary_stiffness=0.0001 kN/m", "primary_damping=0 N*s/m", "bogie_mass=1e10 kg"]
)
def test_the_ends_of_a_range_and_no_damper_are_inside(value, here, capsys):
    assert run(["show", "yu-damper-joint", "--set", value]) == 0


@pytest.mark.parametrize("joint", ["1 N/m", "1e8 MN/m", "inf"])
def test_so_are_the_softest_joint_and_the_rigid_one(joint, here, capsys):
    assert run(["show", "yu-damper-joint", "--set", f"primary_joint_stiffness={joint}"]) == 0


# --- what is no regular file, exit 2 ------------------------------------------------------------------

IRREGULAR = {
    "a pipe as a case": (["sweep", "pipe"], "pipe: is not a regular file"),
    "a pipe as a case to show": (["show", "pipe"], "pipe: is not a regular file"),
    "a pipe as a result": (["plot", "pipe.nc"], "pipe.nc: is not a regular file"),
    "a pipe as a result to check": (["show", "pipe.nc", "--check"], "pipe.nc: is not a regular file"),
    "a pipe as an output": ([*SWEEP, "-o", "pipe.nc", "--overwrite"], "pipe.nc: is not a regular file"),
    "a device as a result": (["show", "device.nc"], "device.nc: is not a regular file"),
    "a file of /proc as a case": (["show", "/proc/self/mem"], "/proc/self/mem: is empty"),
    "a file of /proc as a result": (["plot", "/proc/self/mem"], "/proc/self/mem: is not a NetCDF file (it is empty)"),
    "the kernel's log as a case": (["sweep", "/proc/kmsg"], "/proc/kmsg: "),
    "the kernel's log as a result": (["plot", "/proc/kmsg"], "/proc/kmsg: "),
    "a dangling link as an output": ([*SWEEP, "-o", "dangling.nc"], "dangling.nc: exists already"),
}


@linux
@pytest.mark.parametrize("row", IRREGULAR)
def test_what_is_no_regular_file_is_refused_at_once(row, here):
    os.mkfifo("pipe")
    os.mkfifo("pipe.nc")
    Path("device.nc").symlink_to("/dev/zero")
    Path("dangling.nc").symlink_to("nowhere.nc")
    before = sorted(here.iterdir())
    arguments, words = IRREGULAR[row]
    fails(process(*arguments), 2, words)
    assert sorted(here.iterdir()) == before


# --- folders that hold what the command did not write, exit 2 ------------------------------------------


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("command", [["replicate", "--quick"], ["plot", "intact.nc"]], ids=lambda words: words[0])
def test_a_folder_with_a_user_s_pictures_is_left_alone(command, here, intact, capsys, monkeypatch):
    monkeypatch.delattr(solve, "solve")
    shutil.copy(intact, "intact.nc")
    Path("mine").mkdir()
    for name in ("thesis-figure.png", "logo.svg"):
        Path("mine", name).write_bytes(OLD)
    before = contents(here)
    refuses([*command, "-o", "mine"], 2, "mine: holds what this command did not write (logo.svg, thesis-figure", capsys)
    assert contents(here) == before


def test_a_folder_of_plot_is_none_of_replicate_s(here, intact, capsys, monkeypatch):
    assert run(["plot", str(intact), "-o", "figures"]) == 0
    capsys.readouterr()
    monkeypatch.delattr(solve, "solve")
    before = contents(here)
    refuses(["replicate", "-o", "figures"], 2, "figures: is a folder of another command (freqrail plot)", capsys)
    assert contents(here) == before


def test_plots_are_drawn_anew_into_their_own_folder_but_not_over_a_figure_that_was_touched_up(here, intact, capsys):
    for file_format in ("svg", "svg", "png"):
        assert run(["plot", str(intact), "-o", "figures", "--format", file_format]) == 0
    touched = sorted(Path("figures").glob("*.svg"))[0]
    touched.write_bytes(touched.read_bytes() + b"<!-- arrows by hand -->")
    before = contents(here)
    capsys.readouterr()
    words = (
        f"figures: holds files that were changed since this command wrote them ({touched.name}); move them elsewhere"
    )
    refuses(["plot", str(intact), "-o", "figures"], 2, words, capsys)
    assert contents(here) == before


# --- input and output, exit 4 ----------------------------------------------------------------------


@linux
def test_an_unreadable_case_file_and_result(here, intact):
    Path("secret.toml").write_text(PLAIN)
    shutil.copy(intact, "secret.nc")
    for name, command in (("secret.toml", "sweep"), ("secret.nc", "plot")):
        Path(name).chmod(0)
        fails(process(command, name, preexec_fn=without_override), 2, f"{name}: cannot be read: Permission denied")


@linux
def test_a_read_only_output_folder_is_found_before_computing(here):
    Path("locked").mkdir()
    Path("locked/old.nc").write_bytes(OLD)
    Path("locked").chmod(0o555)
    done = process(*SWEEP, "-o", "locked/old.nc", "--overwrite", preexec_fn=without_override)
    fails(done, 4, "locked: this folder cannot be written")
    assert [path.read_bytes() for path in Path("locked").iterdir()] == [OLD]


@pytest.mark.parametrize("folder", ["none/deeper", "file"])
def test_a_missing_output_folder_is_found_before_computing(folder, here, capsys, monkeypatch):
    monkeypatch.delattr(solve, "solve")
    Path("file").touch()
    refuses([*SWEEP, "-o", f"{folder}/out.nc"], 4, f"{folder}: ", capsys)
    assert [path.name for path in here.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("kilobytes", "words"),
    [
        (4, ".old.nc.journal: the journal cannot be written: "),
        (40, "old.nc: cannot be written: NetCDF: HDF error (is a quota, or a limit on the size of files, reached?)"),
    ],
    ids=["in the journal", "in the file"],
)
def test_a_full_disk_is_told_and_leaves_the_old_file(kilobytes, words, here):
    """A limit on the size of files stands for the disk."""
    Path("old.nc").write_bytes(OLD)
    options = " ".join(f"'{part}'" for part in over())
    command = f"ulimit -f {kilobytes}; exec '{sys.executable}' -m freqrail sweep yu-damper-joint {options} -o old.nc"
    done = subprocess.run(["bash", "-c", f"{command} --overwrite"], capture_output=True, text=True, timeout=120)
    fails(done, 4, words)
    assert Path("old.nc").read_bytes() == OLD
    assert {path.name for path in here.iterdir()} <= {"old.nc", ".old.nc.journal"}


def test_a_full_disk_is_called_by_its_name(here, capsys, monkeypatch):
    """The library says no more than that something went wrong; what is left of the disk says what."""
    Path("old.nc").write_bytes(OLD)

    def full(*_: object, **__: object) -> None:
        usage = shutil.disk_usage(here)
        monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=0))
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", full)
    refuses([*SWEEP, *over(), "-o", "old.nc", "--overwrite"], 4, "cannot be written: no space left on", capsys)
    assert Path("old.nc").read_bytes() == OLD
    assert {path.name for path in here.iterdir()} <= {"old.nc", ".old.nc.journal"}


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_stdout(here):
    with open("/dev/full", "w") as full:
        fails(process(*SWEEP, *over(), "-o", "out.nc", stdout=full.fileno()), 4, "No space left on device")
    assert freqrail.open_result("out.nc").sizes["speed"] == 1


def test_a_closed_pipe_is_quiet(here):
    read, write = os.pipe()
    os.close(read)
    done = process("modes", "yu-damper-joint", stdout=write)
    os.close(write)
    assert (done.returncode, done.stderr) == (4, "")


# --- NetCDF files, exit 2 --------------------------------------------------------------------------


def rewritten(change: Callable[[xr.Dataset], xr.Dataset]) -> Callable[[Path], None]:
    """A result changed in memory and written anew, so that its digest matches."""

    def make(path: Path) -> None:
        freqrail.write_result(change(freqrail.open_result(path)), path, overwrite=True)

    return make


def edited(change: Callable[[netCDF4.Dataset], object]) -> Callable[[Path], None]:
    """A result changed in place by another program, so that its digest does not match."""

    def make(path: Path) -> None:
        with netCDF4.Dataset(path, "a") as file:
            change(file)

    return make


def cut(share: float) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])


def written(data: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(data)


def foreign(path: Path) -> None:
    path.unlink()
    xr.Dataset({"temperature": ("time", [1.0, 2.0])}).to_netcdf(path)


def huge(path: Path) -> None:
    """Four kilobytes that declare eight terabytes."""
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("speed", 10**12)
        file.createVariable("status", "f8", ("speed",), chunksizes=(1000,))
        file.setncatts({"dataset_schema_version": 1, "content_digest": "0" * 64})


def stripped(variable: str, attribute: str) -> Callable[[xr.Dataset], xr.Dataset]:
    def change(dataset: xr.Dataset) -> xr.Dataset:
        copy = dataset.copy(deep=True)
        del copy[variable].attrs[attribute]
        return copy

    return change


def described(variable: str, attribute: str, words: str) -> Callable[[xr.Dataset], xr.Dataset]:
    def change(dataset: xr.Dataset) -> xr.Dataset:
        copy = dataset.copy(deep=True)
        copy[variable].attrs[attribute] = words
        return copy

    return change


def recoded(variable: str, kind: type) -> Callable[[xr.Dataset], xr.Dataset]:
    def change(dataset: xr.Dataset) -> xr.Dataset:
        attributes = dataset[variable].attrs
        return dataset.assign({variable: dataset[variable].astype(kind).assign_attrs(attributes)})

    return change


def filled(variable: str, value: float) -> Callable[[xr.Dataset], xr.Dataset]:
    """The first number of a variable replaced."""

    def change(dataset: xr.Dataset) -> xr.Dataset:
        copy = dataset.copy(deep=True)
        copy[variable].values[(0,) * copy[variable].ndim] = value
        return copy

    return change


def with_spectrum(value: float) -> Callable[[xr.Dataset], xr.Dataset]:
    """A result of the same case with spectra, the first number of one of them replaced."""
    return lambda dataset: filled("bogie_acceleration_psd", value)(
        freqrail.sweep("yu-damper-joint", SMALL | {"frequency": "1, 10 Hz"}, psd=True)
    )


def all_nan(dataset: xr.Dataset) -> xr.Dataset:
    return dataset.assign({name: dataset[name] * np.nan for name in dataset if name.endswith("_rms")})


RMS = "bogie_acceleration_rms"
NETCDF: dict[str, tuple[Callable[[Path], object], str]] = {
    "missing": (Path.unlink, "no such file"),
    "0 bytes": (written(b""), "is not a NetCDF file (it is empty)"),
    "only the signature": (cut(8 / 1e5), "damaged, cannot be read as NetCDF"),
    **{f"truncated to {share:.0%}": (cut(share), "damaged, cannot be read") for share in (0.01, 0.3, 0.7, 0.99)},
    "text": (written(b"speed,rms\n1,2\n"), "is not a NetCDF file"),
    "PNG": (written(b"\x89PNG\r\n\x1a\n" + bytes(100)), "is not a NetCDF file"),
    "signature and zeros": (written(b"\x89HDF\r\n\x1a\n" + bytes(10_000)), "damaged, cannot be read as NetCDF"),
    "foreign": (foreign, "is not a result of freqrail (no dataset_schema_version)"),
    "newer schema": (rewritten(lambda d: d.assign_attrs(dataset_schema_version=99)), "has schema 99, this freqrail"),
    "schema no number": (
        rewritten(lambda d: d.assign_attrs(dataset_schema_version="new")),
        'has no schema number (got "new")',
    ),
    "digest mismatch, data": (edited(lambda f: f[RMS].__setitem__((0, 0, 0, 0), 1.0)), "does not match its digest"),
    "digest mismatch, name": (edited(lambda f: f.renameVariable(RMS, "x")), "does not match its digest"),
    "digest mismatch, text": (edited(lambda f: f.setncattr("title", "x")), "does not match its digest"),
    "no digest": (edited(lambda f: f.delncattr("content_digest")), "is not a result of freqrail"),
    "no variable": (rewritten(lambda d: d.drop_vars(RMS)), f"has no variable {RMS}"),
    "no twin": (rewritten(lambda d: d.drop_vars(f"traditional_{RMS}")), f"has no variable traditional_{RMS}"),
    "no status": (rewritten(lambda d: d.drop_vars("status")), "has no variable status"),
    "no response": (
        rewritten(lambda d: d[["status", "method", "traditional_status", "traditional_method"]]),
        "has no response",
    ),
    "no dimension": (rewritten(lambda d: d.isel(speed=0)), "has no dimension speed, which its case sweeps"),
    "no coordinate": (rewritten(lambda d: d.drop_vars("speed")), "has no coordinate speed"),
    "other order": (
        rewritten(lambda d: d.assign({RMS: d[RMS].transpose("bogie", ...)})),
        f"{RMS} has the dimensions bogie, primary_joint_stiffness",
    ),
    "other labels": (rewritten(lambda d: d.assign_coords(bogie=["left", "right"])), "labels other than front, rear"),
    "no unit": (rewritten(stripped(RMS, "units")), f"{RMS} has no unit m s-2"),
    "no unit of an axis": (rewritten(stripped("speed", "units")), "speed has no unit of a speed"),
    "another unit of an axis": (
        rewritten(described("speed", "units", "m s-1")),
        "speed is not in km/h, as its case has it (got 'm/s')",
    ),
    "another axis": (
        rewritten(lambda d: xr.concat([d], "bogie_mass", coords="different", compat="equals")),
        "has the dimension bogie_mass, which its case does not sweep",
    ),
    "labels in another order": (rewritten(lambda d: d.isel(bogie=[1, 0])), "bogie has its labels in another order"),
    "no labels": (rewritten(lambda d: d.drop_vars("bogie")), "has no coordinate bogie"),
    "an axis of text": (rewritten(recoded("speed", str)), "speed holds other values than numbers"),
    "numbers as text": (rewritten(recoded(RMS, str)), f"{RMS} holds text, numbers of 64 bits (float64) are expected"),
    "short numbers": (rewritten(recoded(RMS, np.float32)), f"{RMS} holds float32, numbers of 64 bits"),
    "long statuses": (rewritten(recoded("status", np.int32)), "status holds int32, whole numbers of 8 bits"),
    "a status without a meaning": (rewritten(filled("status", 99)), "status holds 99, which means nothing"),
    "a method without a meaning": (rewritten(filled("method", -1)), "method holds -1, which means nothing"),
    "other meanings": (
        rewritten(described("status", "flag_meanings", "ok ok ok ok")),
        "status has other flag_meanings than ok unresolved_peak",
    ),
    "a negative RMS": (rewritten(filled(RMS, -1.0)), f"{RMS} has 1 number not positive and finite"),
    "an RMS of zero": (rewritten(filled(RMS, 0.0)), f"{RMS} has 1 number not positive and finite"),
    "no error at all": (rewritten(filled(f"{RMS}_relative_error", 0.0)), "has 1 number not above 0 and up to 1e-06"),
    "a large error": (rewritten(filled(f"{RMS}_relative_error", 1e-5)), "has 1 number not above 0 and up to 1e-06"),
    "a hole in a spectrum": (
        rewritten(with_spectrum(np.nan)),
        "bogie_acceleration_psd has no number at 1 grid points whose status is ok",
    ),
    "warnings that are no JSON": (
        rewritten(lambda d: d.assign_attrs(warnings="nothing")),
        'its attribute warnings is no list of warnings in JSON (got "nothing")',
    ),
    "warnings without words": (rewritten(lambda d: d.assign_attrs(warnings="[{}]")), "is no list of warnings in JSON"),
    "another vehicle": (
        rewritten(lambda d: d.assign_coords(bogie_mass=d.bogie_mass + 50)),
        "bogie_mass is not that of its case: 600 is expected (got 650)",
    ),
    "another unit of a scalar": (rewritten(described("bogie_mass", "units", "t")), "bogie_mass has no unit kg"),
    "another compliance": (
        rewritten(lambda d: d.assign_coords(primary_joint_compliance=2 * d.primary_joint_compliance)),
        "primary_joint_compliance is not that of its case: 1 is expected (got 2)",
    ),
    "another band": (
        rewritten(lambda d: d.assign_coords(band_upper_frequency=d.band_upper_frequency / 2)),
        "band_upper_frequency is not that of its case: 100 is expected (got 50)",
    ),
    "another band in words": (
        rewritten(lambda d: d.assign_attrs(band="0.1 to 50 Hz")),
        'its attribute band is not that of its case: 0.1 to 100 Hz is expected (got "0.1 to 50 Hz")',
    ),
    "another digest of the case": (
        rewritten(lambda d: d.assign_attrs(effective_case_sha256="0" * 64)),
        "its attribute effective_case_sha256 is not that of its case",
    ),
    "no flags": (rewritten(stripped("status", "flag_meanings")), "or no flag_meanings"),
    "no case": (rewritten(lambda d: d.drop_attrs().assign_attrs(dataset_schema_version=1)), "has no attribute"),
    "a broken case": (rewritten(lambda d: d.assign_attrs(effective_case="x")), "its effective_case is no case"),
    "all NaN": (rewritten(all_nan), f"{RMS} has no number at 4 grid points whose status is ok"),
    "huge dimension": (huge, "declares 8e+12 bytes of data, far more than the file holds"),
}


@pytest.mark.parametrize("row", NETCDF)
def test_a_bad_netcdf_file_is_refused_by_name(row, here, intact, capsys):
    path = here / "bad.nc"
    shutil.copy(intact, path)
    make, words = NETCDF[row]
    make(path)
    before = path.read_bytes() if path.exists() else None
    for command in ("show", "plot"):
        assert run([command, "bad.nc"]) == 2
        lines = told(capsys)
        assert lines
        assert any(words in line for line in lines)
        assert all(line.startswith("freqrail: error: bad.nc: ") for line in lines)
    assert [p.name for p in here.iterdir()] == ([] if before is None else ["bad.nc"])
    assert (path.read_bytes() if path.exists() else None) == before


def test_a_part_of_a_result_is_one(here, intact, capsys):
    rewritten(lambda d: d.isel(bogie=[1], primary_joint_stiffness=slice(1, None)))(Path(shutil.copy(intact, "part.nc")))
    assert run(["show", "part.nc", "--at", "speed=250 km/h"]) == 0
    shown = capsys.readouterr().out
    (bogie,) = [line for line in shown.splitlines() if "bogie" in line and "acceleration" in line]
    assert " rear " in bogie
    assert run(["show", "part.nc", "--check"]) == 0
    assert run(["plot", "part.nc"]) == 0
    quick = ["--integrator", "exponential", "--duration", "20 s", "--realisations", "2", "--band", "0.5:20 Hz"]
    assert run(["confirm", "part.nc", *quick, "--at", "speed=250 km/h"]) == 0
    out = capsys.readouterr().out
    assert "result check: 4 of 22 not checked (the result has no number there)" in out


def test_what_xarray_wrote_is_refused_with_the_function_that_writes_results(here, intact, capsys):
    result = freqrail.open_result(intact)
    freqrail.sweep("yu-damper-joint", SMALL).to_netcdf("own.nc")
    xr.concat([result, result], "speed", coords="different", compat="equals").to_netcdf("together.nc")
    refuses(["show", "own.nc"], 2, "a dataset of freqrail.sweep is written with freqrail.write_result", capsys)
    refuses(["show", "together.nc"], 2, "what was changed on purpose is for xarray to read, or to be written", capsys)


def test_check_names_numbers_that_are_text(here, intact, capsys):
    rewritten(recoded(RMS, str))(Path(shutil.copy(intact, "text.nc")))
    for command in (["show", "text.nc", "--check"], ["confirm", "text.nc"]):
        refuses(command, 2, f"{RMS} holds text, numbers of 64 bits (float64) are expected", capsys)


@pytest.mark.parametrize(
    "url", ["http://localhost/x.nc", "https://example.org/x.nc", "s3://bucket/x.nc", "file:///x.nc"]
)
def test_a_url_is_not_fetched(url, here, capsys):
    for command in (["show", url], ["plot", url], ["show", url, "--check"]):
        refuses(command, 2, "only local files are read", capsys)


def test_a_result_without_a_single_number_is_shown_but_not_plotted(here, capsys):
    """As sweep writes it: NaN with a status."""
    still = ["--set", "primary_damping=0 N*s/m", "--set", "secondary_damping=0 N*s/m"]
    undamped = [*still, *over(speed="200, 250 km/h")]
    assert run([*SWEEP, *undamped, "-o", "nan.nc"]) == 3
    capsys.readouterr()
    assert run(["show", "nan.nc"]) == 0
    assert "2 of 2 grid points lack results (2 undamped)" in capsys.readouterr().out
    refuses(["plot", "nan.nc"], 2, "plot: no grid point has a result", capsys)


# --- untrusted files -------------------------------------------------------------------------------


def test_check_reads_in_a_child_and_says_what_the_child_found(here, intact, capsys):
    shutil.copy(intact, "result.nc")
    assert run(["show", "result.nc", "--check"]) == 0
    assert "result.nc: whole; content digest" in capsys.readouterr().out
    huge(here / "huge.nc")
    refuses(["show", "huge.nc", "--check"], 2, "huge.nc: declares 8e+12 bytes of data", capsys)


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("import time; time.sleep(60)", "damaged: reading it did not end within 1 s"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "damaged: it crashes the NetCDF library (SIGSEGV)"),
        ("raise MemoryError", "damaged: reading it ended without an answer (exit 1)"),
    ],
    ids=["hangs", "crashes", "dies"],
)
def test_a_file_that_does_it_to_the_library_does_not_do_it_to_the_command(program, words, here, capsys, monkeypatch):
    Path("evil.nc").write_bytes(OLD)
    monkeypatch.setattr(sandbox, "COMMAND", program)
    monkeypatch.setattr(sandbox, "SECONDS", 1.0)
    refuses(["show", "evil.nc", "--check"], 2, f"evil.nc: {words}", capsys)


def test_the_child_has_a_limit_on_its_memory(here, capsys, monkeypatch):
    """So that a file which makes the library ask for everything takes nothing from the others on the machine."""
    program = (
        "import freqrail.result.points\n"
        "def read_result(path): return bytearray(10**10)\n"
        "freqrail.result.points.read_result = read_result\n"
        "from freqrail.result.sandbox import child; child()"
    )
    monkeypatch.setattr(sandbox, "COMMAND", program)
    Path("large.nc").write_bytes(OLD)
    refuses(["show", "large.nc", "--check"], 2, "damaged: reading it ended without an answer", capsys)


# --- numbers that cannot be had, exit 3 -------------------------------------------------------------

NUMERICAL = {
    "an undamped mode": ({}, ["--set", "primary_damping=0 N*s/m"], "undamped"),
    "a resonance too narrow": ({"primary_joint_stiffness": "5 N/m"}, [], "unresolved_peak"),
    "lags that need nodes without number": ({}, ["--set", "half_bogie_spacing=1e7 m"], "failed"),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("row", NUMERICAL)
def test_what_cannot_be_computed_is_counted_and_its_first_point_named(row, here, capsys):
    axes, settings, status = NUMERICAL[row]
    assert run([*SWEEP, *over(**{"speed": "200, 250 km/h", **axes}), *settings, "-o", "nan.nc"]) == 3
    errors = [line for line in told(capsys) if line.startswith("freqrail: error: ")]
    assert errors[0].startswith("freqrail: error: nan.nc: model with damper joints: 2 of 2 grid points lack results")
    assert f"(2 {status}); the first at " in errors[0]
    assert "speed=200 km/h" in errors[0]
    result = freqrail.open_result("nan.nc")
    meanings = result.status.attrs["flag_meanings"].split()
    assert {meanings[int(k)] for k in result.status.values.ravel()} == {status}
    assert np.isnan(result.primary_stroke_rms).all()
    assert np.isnan(result[RMS]).all() == (status == "failed")  # which does not feel the bogies pitch


def test_no_case_file_makes_an_unstable_model(here, capsys):
    """What could, a negative stiffness or damping, is refused; a passive model has no pole to the right."""
    for name in ("primary_damping", "secondary_damping", "primary_stiffness", "secondary_stiffness"):
        unit = "N*s/m" if name.endswith("damping") else "N/m"
        refuses([*SWEEP, "--set", f"{name}=-1 {unit}"], 2, f"--set {name}: must be ", capsys)


# --- what a program reads ---------------------------------------------------------------------------


def keys(value: object) -> Iterator[str]:
    if isinstance(value, dict):
        yield from value
    for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from keys(item)


@pytest.mark.parametrize(
    "arguments",
    [
        ["show", "yu-damper-joint"],
        ["show", "intact.nc"],
        ["show", "intact.nc", "--at", "speed=250 km/h"],
        ["modes", "yu-damper-joint"],
        [*SWEEP, "--dry-run"],
    ],
    ids=" ".join,
)
def test_keys_of_json_are_plain_identifiers(arguments, here, intact, capsys):
    shutil.copy(intact, "intact.nc")
    assert run([*arguments, "--json"]) == 0
    found = set(keys(json.loads(capsys.readouterr().out)))
    assert len(found) > 4
    assert [key for key in found if not key.isidentifier()] == []


def test_plots_say_on_a_terminal_how_far_they_are(here, intact, capsys, monkeypatch):
    steps: list[int] = []
    asked: list[tuple[str, int]] = []

    @contextlib.contextmanager
    def progress(label: str, total: int):
        asked.append((label, total))
        yield steps.append

    monkeypatch.setattr(commands, "progress", progress)
    shutil.copy(intact, "intact.nc")
    assert run(["plot", "intact.nc"]) == 0
    paths = capsys.readouterr().out.splitlines()
    assert asked == [("figures", len(paths))]
    assert sum(steps) == len(paths) > 1
