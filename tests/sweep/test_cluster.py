"""Blocks on a dask cluster: a real scheduler and two workers on the loopback."""

from __future__ import annotations

import contextlib
import os
import random
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

import freqrail
from freqrail.case.case import load_case
from freqrail.cli import commands
from freqrail.errors import InputError
from freqrail.result.content import content_digest
from freqrail.sweep import cluster, parts, sweep
from freqrail.sweep.plan import Plan

OVER = {"primary_joint_stiffness": "log:0.5:100:30 MN/m", "secondary_joint_stiffness": "log:0.5:100:8 MN/m"}
QUIET = {**os.environ, "DASK_DISTRIBUTED__DASHBOARD__LINK": "", "OMP_NUM_THREADS": "1"}


def start(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        env=QUIET,
    )


def worker(address: str) -> subprocess.Popen:
    # without a nanny, which would start a killed worker anew
    return start("worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    process = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    assert process.stderr is not None
    address = next(m[0] for line in process.stderr if (m := re.search(r"tcp://127\.0\.0\.1:\d+", line)))
    threading.Thread(target=process.stderr.read, daemon=True).start()  # or its pipe fills up
    yield address
    process.terminate()
    process.wait()


@pytest.fixture
def workers(scheduler) -> Iterator[list[subprocess.Popen]]:
    both = [worker(scheduler) for _ in range(2)]
    yield both
    for process in both:
        process.kill()
        process.wait()


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_cluster_gives_the_bits_of_a_local_run_even_if_a_worker_dies(here, monkeypatch, scheduler, workers):
    monkeypatch.setattr(parts, "POINTS", 100)
    case = load_case("yu-damper-joint", over=OVER)
    plan, done = Plan.of(case), []

    def watch(points: int) -> None:
        done.append(points)
        if len(done) == 3:
            workers[0].send_signal(signal.SIGKILL)

    outcome = sweep.sweep_to_file(plan, here / "o.nc", executor=cluster.executor(scheduler), progress=watch)
    assert workers[0].wait() == -signal.SIGKILL
    assert len(done) == len(parts.cut(plan)) > 20
    assert freqrail.open_result(outcome.path).attrs["content_digest"] == content_digest(freqrail.sweep(case))


def test_a_cluster_of_this_machine_is_called_local(here, capsys):
    arguments = ["sweep", "yu-damper-joint", "--over", "primary_joint_stiffness=1, 5 MN/m", "-o"]
    assert commands.run([*arguments, "cluster.nc", "--dask", "local"]) == 0
    assert commands.run([*arguments, "threads.nc"]) == 0
    first, second = (freqrail.open_result(f"{name}.nc").attrs["content_digest"] for name in ("cluster", "threads"))
    assert first == second


def test_a_scheduler_that_is_not_there_is_one_line(here, capsys, monkeypatch):
    monkeypatch.setattr(cluster, "TIMEOUT", 0.5)
    begun = time.perf_counter()
    assert commands.run(["sweep", "yu-damper-joint", "--dask", "tcp://127.0.0.1:9"]) == 4
    assert time.perf_counter() - begun < 30
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert "tcp://127.0.0.1:9: no scheduler with a worker answers within 0.5 s" in told[0]
    assert "dask scheduler" in told[0]
    assert not list((here / "results").iterdir())


MALFORMED = ["tcp://", "tcp://127.0.0.1", "tcp://127.0.0.1:99999", "tcp://h:0", "tcp://h:x", "tcp://a:1,tcp://b:2"]
MALFORMED += ["tcp://user@h:1", f"tcp://{'a' * 300}:1", "tcp://\udcff:1", "tcp://h:1/x", "", "tcp://h:1\n"]
MALFORMED += ["tcp://a..b:1", "tcp://.a:1", f"tcp://{'a' * 64}.b:1"]


@pytest.mark.parametrize("address", MALFORMED)
def test_a_malformed_address_is_one_line(address, here, capsys):
    assert commands.run(["sweep", "yu-damper-joint", "--dask", address]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "as in tcp://HOST:8786, is expected (got " in line


def silent(client: socket.socket) -> None:
    time.sleep(60)


def http(client: socket.socket) -> None:
    client.sendall(b"HTTP/1.0 400 Bad Request\r\n\r\n")


def garbage(client: socket.socket) -> None:
    client.sendall(random.Random(1).randbytes(5000))
    time.sleep(60)


def zeros(client: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while True:
            client.sendall(bytes(1000))


def greets(client: socket.socket) -> None:
    client.sendall(b"pickle-protocol")
    time.sleep(60)


def greets_and_babbles(client: socket.socket) -> None:
    client.sendall(b"pickle-protocol" + random.Random(1).randbytes(5000))
    time.sleep(60)


@pytest.mark.parametrize("answer", [silent, http, garbage, zeros, greets, greets_and_babbles])
def test_what_answers_and_is_no_scheduler_is_one_line_within_15_s(answer, here):
    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=answer, args=(server.accept()[0],), daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=serve, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        begun = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "freqrail", "sweep", "yu-damper-joint", "--dask", address],
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert time.perf_counter() - begun < 15
    assert done.returncode == 4
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"freqrail: error: --dask {address}: no scheduler with a worker answers")


def test_tls_without_certificates_is_one_line(here, scheduler):
    address = scheduler.replace("tcp", "tls")
    done = subprocess.run(
        [sys.executable, "-m", "freqrail", "sweep", "yu-damper-joint", "--dask", address],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 4
    assert done.stderr.startswith(f"freqrail: error: --dask {address}: tls needs certificates")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("address", ["localhost:8786", "http://x", "somewhere"])
def test_an_address_must_name_its_protocol(address):
    with pytest.raises(InputError, match="tcp://HOST:8786"):
        cluster.check(address)


def test_threads_of_a_cluster_are_its_own(here, capsys):
    assert commands.run(["sweep", "yu-damper-joint", "--dask", "local", "--jobs", "2"]) == 2
    assert "--jobs" in capsys.readouterr().err
