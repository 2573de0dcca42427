"""A short run of `python -m tests.fuzz`, and that the fuzzer sees a fault when there is one."""

from __future__ import annotations

import time

from freqrail.case import quantities
from freqrail.errors import InputError
from tests.fuzz import cases, extremes, files


def test_changed_case_files_and_options_are_refused_or_read_right():
    outcomes, faults = cases.fuzz(200, seed=11)
    assert faults == []
    assert min(outcomes[kind] for kind in ("refused", "accepted", "computed")) > 5


def test_points_from_anywhere_in_the_ranges_end_with_a_status():
    outcomes, faults = extremes.fuzz(8, seed=11)
    assert faults == []
    assert outcomes.total() == 8
    assert outcomes["ok"] > 0


def test_damaged_results_are_refused_or_the_same(tmp_path):
    outcomes, faults = files.fuzz(60, seed=11, folder=tmp_path)
    assert faults == []
    assert outcomes.total() == 60
    assert min(outcomes["refused"], outcomes["the same"]) > 5


def test_a_number_read_wrong_is_a_fault(monkeypatch):
    """A factor that is off by a part in a million, of one unit."""
    right = quantities.unit_factor

    def wrong(unit: str):
        factor, dimension = right(unit)
        return (factor * 1_000_001 / 1_000_000 if unit == "km/h" else factor), dimension

    monkeypatch.setattr("freqrail.case.quantities.unit_factor", wrong)
    _, faults = cases.fuzz(5, seed=11)
    assert any("speed: " in fault and " read as " in fault for fault in faults)


def test_a_traceback_and_a_hang_are_faults(monkeypatch):
    def fails(text: str) -> None:
        raise KeyError(text)

    monkeypatch.setattr(cases, "parse_point", fails)
    outcomes, faults = cases.fuzz(3, seed=1)
    assert outcomes == {"fault": 3}
    assert faults[0].startswith("case 0: KeyError: ")
    monkeypatch.setattr(cases, "parse_point", lambda _: time.sleep(60))
    monkeypatch.setattr(cases, "SECONDS", 1)
    _, faults = cases.fuzz(1, seed=1)
    assert faults[0].startswith("case 0: TimeoutError: took longer than 1 s")


# a reader that takes file 0 for another, stumbles over file 1, crashes on file 2 and never comes back from file 3
FAULTY = """
import itertools, os, sys, time
from tests.fuzz import files
read, numbers = files.open_result, itertools.count(int(sys.argv[3]))
acts = [
    lambda path: read(path.with_name("other.nc")),
    lambda path: {}["x"],
    lambda path: os.abort(),
    lambda path: time.sleep(60),
]
files.open_result = lambda path: acts[next(numbers)](path) if path.name == "damaged.nc" else read(path)
files.child()
"""


def test_a_reader_at_fault_is_found_out_and_so_is_a_command_that_falls_for_a_hang(tmp_path, monkeypatch):
    source = files.intact(tmp_path)
    other = files.open_result(source).assign_attrs(title="another")
    files.write_result(other, tmp_path / "other.nc")
    checks = iter((InputError("crashes"), None))  # the command refuses file 2, and takes file 3 for whole

    def check(path, seconds):
        fault = next(checks)
        if fault:
            raise fault

    monkeypatch.setattr(files, "intact", lambda folder: source)
    monkeypatch.setattr(files, "SECONDS", 1.0)
    monkeypatch.setattr(files, "CHILD", FAULTY)
    monkeypatch.setattr(files, "check_result", check)
    outcomes, faults = files.fuzz(4, seed=11, folder=tmp_path)
    assert outcomes == {"fault": 3, "crashes": 1}
    assert faults == [
        "file 0: accepted with other content",
        "file 1: KeyError: 'x'",
        "file 3: hangs a reader and passes the check",
    ]
