"""Blocks of a sweep computed by a dask cluster: workers compute, this process alone keeps and writes.

Needs the extra `distributed`. A block travels as the sweep's plan and the block's place, and comes back as numbers; a
worker that dies costs its block's time, for the scheduler gives the block to another.
"""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail import blocks
from freqrail.blocks import Block
from freqrail.campaign import Executor, Progress
from freqrail.errors import FileError, FreqrailWarning, InputError
from freqrail.grid import processors
from freqrail.plan import Plan
from freqrail.version import __version__

TIMEOUT = 10.0
"""Seconds to wait for a scheduler to answer."""
AHEAD = 3  # blocks under way for every worker thread: enough to keep it busy, few enough to hold in memory


def check(address: str) -> None:
    """Raise InputError unless `address` is "local" or tcp://HOST:PORT (or tls://) and dask is installed."""
    if address != "local" and not address.startswith(("tcp://", "tls://")):
        raise InputError(
            f'--dask: "local" or the address of a scheduler, as in tcp://HOST:8786, is due (got {address})'
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

    def run(plan: Plan, todo: Sequence[Block], progress: Progress) -> Iterator[tuple[Block, Mapping[str, NDArray]]]:
        if todo:
            with _client(address) as client:
                yield from _gather(client, address, plan, todo, progress)

    return run


def _gather(
    client: Any, address: str, plan: Plan, todo: Sequence[Block], progress: Progress
) -> Iterator[tuple[Block, Mapping[str, NDArray]]]:
    from distributed import as_completed

    shared = blocks.nodes(plan)
    waiting = iter(todo)
    place: dict[str, Block] = {}

    def submit() -> Any:
        block = next(waiting, None)
        if block is None:
            return None
        # pure=False: a key of its own, so that no result of another sweep is taken for this one
        future = client.submit(blocks.compute, plan, block, shared, pure=False)
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
            progress(blocks.points(plan, block))
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

    with contextlib.ExitStack() as stack:
        try:
            where: Any = address
            if address == "local":
                where = stack.enter_context(
                    LocalCluster(
                        n_workers=processors(), threads_per_worker=1, dashboard_address=None, silence_logs=logging.ERROR
                    )
                )
            client = stack.enter_context(Client(where, timeout=TIMEOUT, set_as_default=False))
            client.wait_for_workers(1, timeout=TIMEOUT)
        except (OSError, TimeoutError) as fault:
            raise FileError(
                f"--dask {address}: no scheduler with a worker answers within {TIMEOUT:g} s ({_words(fault)}); "
                "start one with `dask scheduler` and `dask worker`"
            ) from None
        _check_versions(client, address)
        yield client


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
