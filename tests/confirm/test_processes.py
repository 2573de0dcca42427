"""Workers: results in order, progress and faults across processes, and no waiting for the dead."""

from __future__ import annotations

import os
import time

import pytest

from freqrail.confirm import processes
from freqrail.errors import InputError, NumericalError


def double(number, progress):
    progress(number)
    return 2 * number, os.getpid()


def refuse(number, progress):
    raise InputError(f"no {number}")


def die(number, progress):
    os._exit(7)


def sleep_or_refuse(number, progress):
    if number == 0:
        raise InputError("first")
    time.sleep(60)


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_the_order_of_the_arguments_and_progress_from_all(jobs):
    told = []
    found = processes.run(double, [(1,), (2,), (3,)], jobs, told.append)
    assert [value for value, _ in found] == [2, 4, 6]
    assert sorted(told) == [1, 2, 3]
    elsewhere = {pid for _, pid in found} - {os.getpid()}
    assert bool(elsewhere) == (jobs == 2)


def test_a_fault_in_a_worker_is_raised_here():
    with pytest.raises(InputError, match=r"no [12]"):
        processes.run(refuse, [(1,), (2,)], 2, print)


def test_a_worker_that_dies_is_a_fault_and_not_a_hang():
    with pytest.raises(NumericalError, match="code 7"):
        processes.run(die, [(1,), (2,)], 2, print)


def test_a_fault_ends_the_workers_that_are_still_at_it():
    begin = time.monotonic()
    with pytest.raises(InputError, match="first"):
        processes.run(sleep_or_refuse, [(0,), (1,)], 2, print)
    assert time.monotonic() - begin < 30
