"""Any vehicle through the whole solver: bands, against dense solutions that share nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from freqrail.model.band import Band
from freqrail.model.elements import Dashpot, Parallel, Series, Spring
from freqrail.model.outputs import Displacement, Elongation, Output
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.system import Freedom, Leg, System, Wheel
from freqrail.solver import solve
from freqrail.solver.problem import problem_of
from tests.any_vehicle.__main__ import check
from tests.dense_integrals import band_rms
from tests.plain_vehicles import MAKERS, TRACK, as_system, outputs_of

BANDS = [
    Band("frequency", 0.1, 100.0),
    Band("frequency", 0.5, 400.0),  # takes in the wheelsets on a rigid rail
    Band("wavelength", 1.5, 60.0),
    Band("frequency", 8.0, 30.0),
]


@pytest.mark.parametrize("kind", MAKERS)
def test_no_number_is_off_by_more_than_its_estimate(kind):
    """A vehicle of every kind in every band, at three speeds."""
    rng = np.random.default_rng(sum(map(ord, kind)))
    for band in BANDS:
        plain = MAKERS[kind](rng)
        speeds = rng.uniform(8, 100, 2)
        problem = problem_of(as_system(plain), outputs_of(plain), plain.values, speeds, TRACK, band)
        found = solve.solve(problem)
        assert np.all(found.status == 0)
        for k, speed in enumerate(speeds):
            low, high = problem.limits[:, k]
            for name, expected in band_rms(plain, speed, low, high).items():
                error = np.abs(found.rms[name][:, k] / expected - 1)
                assert np.all(error <= found.relative_error[name][:, k] + 3e-11), (name, band)
                assert np.all(found.relative_error[name][:, k] < 1e-7)


@pytest.mark.parametrize("number", [4, 7, 15])
def test_the_campaign_sees_a_number_that_is_off_by_three_estimates(number, monkeypatch):
    assert check((0, number)).violations == []
    right = solve.solve

    def wrong(problem):
        found = right(problem)
        for name, values in found.rms.items():
            values *= 1 + 3 * found.relative_error[name] + 1e-10
        return found

    monkeypatch.setattr(solve, "solve", wrong)
    assert len(check((0, number)).violations) > 10


# --- against sixty digits ----------------------------------------------------------------------------


REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "any_vehicle.json").read_text())


def described(vehicle: dict) -> tuple[System, dict[str, float], tuple[Output, ...]]:
    """A vehicle of tests/reference/make_any_vehicle.py."""
    values = {f"m_{f}": float(mass) for f, mass in vehicle["freedoms"].items()} | {"contact": float(vehicle["contact"])}
    legs, forms = [], {}
    for name, (row, *numbers) in vehicle["legs"].items():
        forms[name] = {f: float(arm) for f, arm in row.items()}
        own = dict(zip((f"{name}_k", f"{name}_c", f"{name}_K"), map(float, numbers), strict=True))
        values |= own
        k, c, joint = own
        legs.append(Leg(name, forms[name], Parallel((Spring(k), Series((Spring(joint), Dashpot(c), Spring(joint)))))))
    system = System(
        tuple(Freedom(f, f"m_{f}") for f in vehicle["freedoms"]),
        tuple(legs),
        tuple(Wheel(f"under {w}", {w: 1.0}, Spring("contact"), float(x)) for w, x in vehicle["wheels"].items()),
    )
    outputs = []
    for name in vehicle["mean_squares"]:
        what, of = name.split(" ")
        tap, order = (Displacement({of: 1.0}), 2) if what == "acceleration" else (Elongation(of), 0)
        outputs.append(Output(name, "", "", (("", tap),), order))
    return system, values, tuple(outputs)


@pytest.mark.parametrize("which", REFERENCE["vehicles"])
def test_vehicles_without_symmetry_and_with_a_bending_mode_to_sixty_digits(which):
    vehicle = REFERENCE["vehicles"][which]
    system, values, outputs = described(vehicle)
    roughness, low, high = map(float, REFERENCE["spectrum"])
    spectrum, speed = RationalSpectrum("reference", roughness, (low, high)), np.array([float(vehicle["speed"])])
    bands = [None, *(Band("frequency", float(a), float(b)) for a, b in REFERENCE["bands_hz"])]
    for place, band in enumerate(bands):
        found = solve.solve(problem_of(system, outputs, values, speed, spectrum, band))
        assert np.all(found.status == 0)
        for name, squares in vehicle["mean_squares"].items():
            error = abs(float(found.rms[name][0, 0]) ** 2 / float(squares[place]) - 1) / 2
            assert error <= found.relative_error[name][0, 0]
            assert error < 1e-9
