"""`python -m tests.extremes`, see the package."""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time

from tests.extremes.check import Found, check
from tests.extremes.draws import KNOWN, Draw, draw


def _one(task: tuple[int, int]) -> tuple[Draw, Found]:
    seed, number = task
    drawn = draw(seed, number) if number >= 0 else KNOWN[~number]
    return drawn, check(drawn)


def main() -> int:
    """Run the campaign; 1 if there is a violation."""
    parser = argparse.ArgumentParser(prog="python -m tests.extremes", description="Extremes against forty digits.")
    parser.add_argument("--count", type=int, default=2000, help="draws, beside the counter-examples of the past")
    parser.add_argument("--seed", type=int, default=0, help="of the draws; the same seed, the same draws")
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    asked = parser.parse_args()
    tasks = [(asked.seed, ~k) for k in range(len(KNOWN))]
    tasks += [(asked.seed, number) for number in range(asked.first, asked.first + asked.count)]
    start, violated, values, missing, kept, longest = time.perf_counter(), 0, 0, 0, 0, 0.0
    with multiprocessing.Pool(asked.jobs) as pool:
        for (_, number), (drawn, found) in zip(tasks, pool.imap(_one, tasks), strict=True):
            values, missing, kept = values + found.values, missing + found.missing, kept + found.kept
            longest = max(longest, found.seconds)
            if found.violations:
                violated += 1
                print(f"draw {number} of seed {asked.seed}: {drawn}", *found.violations, sep="\n    ", flush=True)
    print(
        f"{len(tasks)} draws, seed {asked.seed}: {violated} with violations; {values} numbers, {kept} of them at "
        f"points that are not ok, {missing} withheld; longest {longest:.1f} s, {time.perf_counter() - start:.0f} s"
    )
    return 1 if violated else 0


if __name__ == "__main__":
    sys.exit(main())
