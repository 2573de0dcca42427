"""Points per second against threads and workers: `python -m tests.bench.scaling`.

Computing alone, then the whole way into a file: what a journal, the checks and the disk add.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path

from freqrail.case.case import load_case
from freqrail.sweep import cluster, parts, sweep
from freqrail.sweep.plan import Plan

SIDE, SPEEDS = 160, 100


def plan() -> Plan:
    joints = {f"{which}_joint_stiffness": f"log:0.5:100:{SIDE} MN/m" for which in ("primary", "secondary")}
    return Plan.of(load_case("yu-damper-joint", over={"speed": f"lin:100:300:{SPEEDS} km/h", **joints}))


def computing(executor: sweep.Executor) -> float:
    """Seconds to compute all blocks."""
    everything = plan()
    start = time.perf_counter()
    for _ in executor(everything, parts.cut(everything), lambda points: None):
        pass
    return time.perf_counter() - start


def into_a_file(executor: sweep.Executor) -> float:
    """Seconds to compute and write."""
    folder = Path(tempfile.mkdtemp())
    start = time.perf_counter()
    try:
        sweep.sweep_to_file(plan(), folder / "o.nc", executor=executor)
        return time.perf_counter() - start
    finally:
        shutil.rmtree(folder)


def main() -> None:
    from distributed import LocalCluster

    everything = plan()
    print(f"{everything.points} grid points in {len(parts.cut(everything))} blocks, four responses, both models")
    print("                          computing            into a file")
    computing(sweep.local(1))  # warm
    for jobs in (1, 2):
        row(everything, f"{jobs} thread{'s' * (jobs > 1)}", sweep.local(jobs))
    for workers in (1, 2):
        with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as here:
            row(everything, f"{workers} dask worker{'s' * (workers > 1)}", cluster.executor(here.scheduler_address))


def row(everything: Plan, words: str, executor: sweep.Executor) -> None:
    rates = [everything.points / measure(executor) for measure in (computing, into_a_file)]
    print(f"{words:20s} {rates[0]:9.0f} points/s {rates[1]:9.0f} points/s")


if __name__ == "__main__":
    main()
