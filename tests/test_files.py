"""Files beside a target: nobody's file or link in their place is written to or removed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import freqrail
from freqrail import files
from freqrail.cli import commands
from freqrail.errors import FileError
from freqrail.result import netcdf
from freqrail.solver import solve

SWEEP = ["sweep", "yu-damper-joint", "--over", "speed=250 km/h", "-o", "o.nc"]
PRECIOUS = b"years of work"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


# a file of that name beside a journal is SQLite's own
@pytest.mark.parametrize(
    ("beside", "planted"),
    [
        (beside, planted)
        for beside in (".o.nc.partial", ".o.nc.journal", ".o.nc.journal-journal", ".o.nc.lock")
        for planted in ("link", "dangling link", "file", "pipe")
        if (beside, planted) != (".o.nc.journal-journal", "file")
    ],
)
def test_what_stands_in_the_way_is_left_alone_and_found_before_computing(beside, planted, here, capsys, monkeypatch):
    monkeypatch.delattr(solve, "solve")
    Path("precious").write_bytes(PRECIOUS)
    if planted == "file":
        Path(beside).write_bytes(PRECIOUS)
    elif planted == "pipe":
        os.mkfifo(beside)
    else:
        os.symlink("precious" if planted == "link" else "nowhere", beside)
    assert commands.run(SWEEP) == 4
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"freqrail: error: {beside}: is in the way")
    assert Path("precious").read_bytes() == PRECIOUS
    assert not os.path.lexists("nowhere")
    assert os.path.lexists(beside)
    assert planted != "file" or Path(beside).read_bytes() == PRECIOUS
    assert not os.path.lexists("o.nc")


def test_a_link_at_the_temporary_name_of_a_figure_is_not_followed(here, capsys):
    result = freqrail.write_result(freqrail.sweep("yu-damper-joint", {"speed": "200, 250 km/h"}), "r.nc")
    assert commands.run(["plot", str(result), "-o", "figures"]) == 0
    capsys.readouterr()
    figure = sorted(Path("figures").glob("*.png"))[0]
    before = figure.read_bytes()
    Path("precious").write_bytes(PRECIOUS)
    Path("figures", f".{figure.name}.partial").symlink_to("../precious")
    assert commands.run(["plot", str(result), "-o", "figures"]) == 2
    assert Path("precious").read_bytes() == PRECIOUS
    assert figure.read_bytes() == before
    with pytest.raises(FileError, match="is in the way"), files.replacing(figure):
        raise AssertionError("nothing is to be written")


def test_what_a_killed_run_left_is_cleared(here):
    left = Path(".o.nc.partial")
    left.mkdir()
    (left / "unfinished.nc").write_bytes(b"half a file")
    assert commands.run(SWEEP) == 0
    assert os.listdir() == ["o.nc"]


def test_a_folder_at_the_temporary_name_that_holds_anything_else_is_not(here, capsys):
    Path(".o.nc.partial").mkdir()
    Path(".o.nc.partial", "thesis.tex").write_bytes(PRECIOUS)
    assert commands.run(SWEEP) == 4
    assert Path(".o.nc.partial", "thesis.tex").read_bytes() == PRECIOUS


def test_nor_is_one_that_holds_a_link(here, capsys):
    (here / "theirs.nc").write_bytes(b"theirs")
    (here / ".o.nc.partial").mkdir()
    (here / ".o.nc.partial" / "unfinished.nc").symlink_to(here / "theirs.nc")
    assert commands.run(SWEEP) == 4
    assert "is in the way of a temporary file, and none of freqrail's; remove it" in capsys.readouterr().err
    assert (here / ".o.nc.partial" / "unfinished.nc").is_symlink()
    assert (here / "theirs.nc").read_bytes() == b"theirs"


def test_a_file_is_whole_or_what_it_was(here):
    Path("f").write_bytes(PRECIOUS)

    def interrupted() -> None:
        with files.replacing(Path("f")) as path:
            path.write_bytes(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert Path("f").read_bytes() == PRECIOUS
    assert os.listdir() == ["f"]
    with files.replacing(Path("f")) as path:
        path.write_bytes(b"new")
    assert Path("f").read_bytes() == b"new"


def test_the_target_has_the_rights_that_any_new_file_has(here):
    netcdf.write_result(freqrail.sweep("yu-damper-joint", {"speed": "250 km/h"}), "o.nc")
    Path("other").touch()
    assert Path("o.nc").stat().st_mode == Path("other").stat().st_mode
