"""Tasks on several processes, for work that the interpreter cannot share among threads.

Workers are started afresh (not forked: threads of numerical libraries do not survive that), tell of
their progress through a pipe, and end with this process.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any

from freqrail.errors import NumericalError
from freqrail.types import SecondsProgress

Task = Callable[..., Any]


def run(task: Task, arguments: Sequence[tuple[Any, ...]], jobs: int, progress: SecondsProgress) -> list[Any]:
    """`task(*arguments[i], progress)` for every i, on up to `jobs` processes; results in the order of `arguments`.

    progress: called in this process with what the tasks tell of. Raises what a task raises, the first that does;
    NumericalError if a worker ends without a word (killed, or out of memory).
    """
    if jobs == 1 or len(arguments) < 2:
        return [task(*each, progress) for each in arguments]
    context = multiprocessing.get_context("spawn")
    results: list[Any] = [None] * len(arguments)
    waiting = list(enumerate(arguments))
    busy: dict[Connection, tuple[int, Any]] = {}
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                place, each = waiting.pop(0)
                ours, theirs = context.Pipe(duplex=False)
                process = context.Process(target=_work, args=(task, each, theirs), daemon=True)
                process.start()
                theirs.close()  # so that the end of the worker ends the pipe
                busy[ours] = place, process
            for pipe in wait(list(busy)):
                assert isinstance(pipe, Connection)
                place, process = busy[pipe]
                try:
                    kind, value = pipe.recv()
                except EOFError:
                    process.join()
                    raise NumericalError(f"a worker process ended with code {process.exitcode} and no result") from None
                if kind == "progress":
                    progress(value)
                    continue
                if kind == "fault":
                    raise value
                results[place] = value
                del busy[pipe]
                process.join()
    finally:
        for _, process in busy.values():
            process.terminate()
            process.join()
    return results


def _work(task: Task, arguments: tuple[Any, ...], pipe: Connection) -> None:
    """A worker's whole life. An interruption from the keyboard is for the parent to answer, which then ends it."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        result = task(*arguments, lambda value: pipe.send(("progress", value)))
    except Exception as fault:
        pipe.send(("fault", fault))
    else:
        pipe.send(("result", result))
