"""Blocks of a sweep computed by a dask cluster: workers compute, this process alone keeps and writes.

Needs the extra `distributed`. A block travels as the sweep's plan and the block's place, and comes back as numbers; a
worker that dies costs its block's time, for the scheduler gives the block to another.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import socket
import threading
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.errors import FileError, FreqrailWarning, InputError
from freqrail.solver.solve import processors
from freqrail.sweep import parts
from freqrail.sweep.parts import Part
from freqrail.sweep.plan import Plan
from freqrail.sweep.sweep import Executor
from freqrail.text import given
from freqrail.types import Progress, SecondsProgress
from freqrail.version import __version__

TIMEOUT = 10.0
"""Seconds for a scheduler, and then a worker, to answer, in all."""
AHEAD = 3  # blocks under way for every worker thread: enough to keep it busy, few enough to hold in memory
_LABEL = r"[A-Za-z0-9](?:[A-Za-z0-9_-]{0,61}[A-Za-z0-9])?"
_ADDRESS = re.compile(rf"(tcp|tls)://(\[[0-9A-Fa-f:.]+\]|{_LABEL}(?:\.{_LABEL})*):([0-9]{{1,5}})", re.ASCII)
_LONGEST_HOST = 253
_GREETING = b"pickle-protocol"  # every scheduler of dask speaks first and says what it can read
_GREETING_BYTES = 10_000
_LOGGERS = ("distributed", "tornado", "asyncio", "bokeh")


def check(address: str) -> None:
    """Raise InputError unless `address` is "local" or tcp://HOST:PORT (or tls://) and dask is installed."""
    found = _ADDRESS.fullmatch(address)
    well_formed = found and len(found[2]) <= _LONGEST_HOST and 0 < int(found[3]) < 65536
    if address != "local" and not well_formed:
        raise InputError(
            f'--dask: "local" or the address of a scheduler, as in tcp://HOST:8786, is expected {given(address)}'
        )
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError('--dask: dask is not installed; pip install "freqrail[distributed]"') from None


def executor(address: str) -> Executor:
    """Blocks computed by the workers of the scheduler at `address`, or of one on this machine for "local".

    Raises InputError as `check` does; the executor raises FileError if no scheduler or worker answers.
    """
    check(address)

    def run(plan: Plan, todo: Sequence[Part], progress: Progress) -> Iterator[tuple[Part, Mapping[str, NDArray]]]:
        if todo:
            with _client(address) as client:
                yield from _gather(client, address, plan, todo, progress)

    return run


def _gather(
    client: Any, address: str, plan: Plan, todo: Sequence[Part], progress: Progress
) -> Iterator[tuple[Part, Mapping[str, NDArray]]]:
    from distributed import as_completed

    shared = parts.panels_of(plan)
    waiting = iter(todo)
    place: dict[str, Part] = {}

    def submit() -> Any:
        block = next(waiting, None)
        if block is None:
            return None
        # pure=False: a key of its own, so that no result of another sweep is taken for this one
        future = client.submit(parts.compute, plan, block, shared, pure=False)
        place[future.key] = block
        return future

    try:
        threads = sum(client.nthreads().values())
        first = [submit() for _ in range(min(len(todo), AHEAD * max(1, threads)))]
        under_way = as_completed(first, loop=client.loop)
        for future in under_way:
            values = future.result()
            block = place.pop(future.key)
            future.release()
            progress(parts.point_count(plan, block))
            yield block, values
            following = submit()
            if following is not None:
                under_way.add(following)
    except (OSError, TimeoutError) as fault:
        raise FileError(f"--dask {address}: the cluster was lost ({_words(fault)}); go on with --resume") from None
    except Exception as fault:
        if type(fault).__module__.partition(".")[0] != "distributed":
            raise
        raise FileError(f"--dask {address}: {_words(fault)}; finished blocks are kept for --resume") from None


@contextlib.contextmanager
def _client(address: str) -> Iterator[Any]:
    """A client of the cluster, whose workers are known to compute the same bits."""
    from distributed import Client, LocalCluster

    end = time.monotonic() + TIMEOUT

    def left() -> float:
        return max(0.1, end - time.monotonic())

    for name in _LOGGERS:  # what goes wrong is told in a line of ours
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with contextlib.ExitStack() as stack:
        try:
            where: Any = address
            if address == "local":
                where = stack.enter_context(
                    LocalCluster(
                        n_workers=processors(), threads_per_worker=1, dashboard_address=None, silence_logs=logging.ERROR
                    )
                )
                end = time.monotonic() + TIMEOUT
            else:
                _in_time(lambda seconds: _greet(address, seconds), TIMEOUT / 2)
                _in_time(lambda seconds: _identify(address, seconds), left() / 2)
            client = stack.enter_context(Client(where, timeout=left(), set_as_default=False))
            client.wait_for_workers(1, timeout=left())
        except FileError:
            raise
        except (OSError, TimeoutError) as fault:
            raise FileError(
                f"--dask {address}: no scheduler with a worker answers within {TIMEOUT:g} s ({_words(fault)}); "
                "start one with `dask scheduler` and `dask worker`"
            ) from None
        except Exception as fault:  # what else the library makes of an answer, or of certificates
            raise FileError(f"--dask {address}: cannot be used as a scheduler ({_words(fault)})") from None
        _check_versions(client, address)
        yield client


def _greet(address: str, seconds: float) -> None:
    """Raise OSError unless a scheduler of dask listens at an address: the library waits for ever for some others."""
    found = _ADDRESS.fullmatch(address)
    assert found
    scheme, host, port = found[1], found[2].strip("[]"), int(found[3])
    end = time.monotonic() + seconds
    with contextlib.ExitStack() as stack:
        stream = stack.enter_context(socket.create_connection((host, port), timeout=seconds))
        if scheme == "tls":
            stream = stack.enter_context(_certificates(address).wrap_socket(stream))
        heard = b""
        while _GREETING not in heard:
            stream.settimeout(max(0.01, end - time.monotonic()))
            more = stream.recv(4096)
            heard += more
            if not more or len(heard) > _GREETING_BYTES:
                raise ConnectionError("what answers there is no scheduler of dask")


def _identify(address: str, seconds: float) -> None:
    """Raise OSError unless what greets like a scheduler of dask answers like one.

    A client of the library that was told nonsense waits for it for another twenty seconds when it is thrown away.
    """
    from distributed.comm import connect
    from distributed.core import send_recv
    from distributed.security import Security

    async def ask() -> Any:
        comm = await connect(address, timeout=seconds, **Security().get_connection_args("client"))
        try:
            return await send_recv(comm, op="identity", reply=True)
        finally:
            comm.abort()

    try:
        answer = asyncio.run(asyncio.wait_for(ask(), seconds))
    except (OSError, TimeoutError):
        raise
    except Exception:  # whatever nonsense makes of the library: an array of exabytes, text that is none
        answer = None
    if not isinstance(answer, Mapping) or answer.get("type") != "Scheduler":
        raise ConnectionError("what answers there is no scheduler of dask")


def _certificates(address: str) -> Any:
    """The TLS context of dask's own configuration. Raises FileError if it has none."""
    from distributed.security import Security

    try:
        context = Security().get_connection_args("client")["ssl_context"]
    except Exception as fault:  # files that are missing, keys that do not fit
        raise FileError(f"--dask {address}: the certificates cannot be used ({_words(fault)})") from None
    if context is None:
        raise FileError(
            f"--dask {address}: tls needs certificates; name them in dask's configuration (distributed.comm.tls)"
        )
    return context


def _in_time(task: SecondsProgress, seconds: float) -> None:
    """Run a task that is told how long it may take, and give up on it then: a look-up of names knows no limit."""
    faults: list[BaseException] = []

    def guarded() -> None:
        try:
            task(seconds)
        except BaseException as fault:
            faults.append(fault)

    thread = threading.Thread(target=guarded, daemon=True)
    thread.start()
    thread.join(seconds)
    if faults:
        raise faults[0]
    if thread.is_alive():
        raise TimeoutError("no answer")


def _check_versions(client: Any, address: str) -> None:
    """Refuse workers with another freqrail, warn of another numpy: its last bits may differ."""
    ours = _versions()
    for worker, theirs in client.run(_versions, on_error="return").items():
        if isinstance(theirs, Exception):
            raise FileError(f"--dask {address}: worker {worker} has no freqrail ({_words(theirs)}); install it there")
        if theirs["freqrail"] != ours["freqrail"]:
            raise FileError(
                f"--dask {address}: worker {worker} has freqrail {theirs['freqrail']}, here is {ours['freqrail']}; "
                "install the same on both"
            )
        if theirs != ours:
            warnings.warn(
                f"--dask {address}: worker {worker} has numpy {theirs['numpy']}, here is {ours['numpy']}: "
                "the last bits may differ; install the same on both",
                FreqrailWarning,
                stacklevel=2,
            )


def _versions() -> dict[str, str]:
    return {"freqrail": __version__, "numpy": np.__version__}


def _words(fault: Exception) -> str:
    return " ".join(str(fault).split())[:200] or type(fault).__name__
