"""The reference that knows nothing of freqrail, and what freqrail makes of the same numbers."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from freqrail.model.equations import state_space
from freqrail.model.vehicle import half_vehicle
from freqrail.solver import solve
from freqrail.solver.problem import half_vehicle_problem
from tests.independent import NAMES, PAPER, SPEED, TRACK, band_rms, state_matrices, whole_axis_rms

SOURCE = Path(__file__).with_name("independent.py")


def test_it_imports_nothing_of_freqrail():
    names = []
    for node in ast.walk(ast.parse(SOURCE.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names.append(node.module)
    assert {name.split(".")[0] for name in names} == {"__future__", "types", "typing", "numpy"}


def test_its_typed_matrices_are_the_packages(paper_vehicle):
    model = state_space(half_vehicle(paper_vehicle))
    a, b = state_matrices(PAPER)
    np.testing.assert_allclose(a, model.a, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(b, model.b, rtol=1e-12)


@pytest.mark.parametrize("banded", [True, False])
def test_the_package_gives_its_numbers(paper_case, banded):
    band = paper_case.band if banded else None
    found = solve.solve(
        half_vehicle_problem(paper_case.vehicle, np.array([paper_case.speed]), paper_case.spectrum, band, NAMES)
    ).rms
    if banded:
        expected = band_rms(PAPER, TRACK, SPEED, 2 * np.pi * 0.1, 2 * np.pi * 100)
    else:
        expected = whole_axis_rms(PAPER, *state_matrices(PAPER), TRACK, SPEED)
    for name in NAMES:
        np.testing.assert_allclose(found[name][:, 0], expected[name], rtol=1e-9)
