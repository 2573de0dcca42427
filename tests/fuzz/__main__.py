"""`python -m tests.fuzz`, see the package."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz import cases, extremes, files

parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description="Damaged inputs by the thousand.")
parser.add_argument("--cases", type=int, default=1000, help="changed case files, each with options")
parser.add_argument("--netcdf", type=int, default=100, help="damaged result files")
parser.add_argument("--extremes", type=int, default=50, help="points from anywhere in the ranges of the quantities")
parser.add_argument("--seed", type=int, default=0, help="of the random changes; the same seed, the same inputs")
asked = parser.parse_args()

found = []
for what, count, fuzz in (
    ("case files and option strings", asked.cases, cases.fuzz),
    ("points of extreme vehicles", asked.extremes, extremes.fuzz),
    ("damaged NetCDF files", asked.netcdf, files.fuzz),
):
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        outcomes, faults = fuzz(count, asked.seed, Path(folder)) if fuzz is files.fuzz else fuzz(count, asked.seed)
    split = ", ".join(f"{outcomes[kind]} {kind}" for kind in sorted(outcomes))
    print(
        f"{sum(outcomes.values())} {what}, seed {asked.seed}: {split}; {time.perf_counter() - start:.0f} s", flush=True
    )
    found += faults
for fault in found:
    print(fault)
sys.exit(1 if found else 0)
