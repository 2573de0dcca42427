"""A short run of `python -m tests.extremes`; that its reference is right and a fault is seen when there is one."""

from __future__ import annotations

import itertools
import json
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpmath import cbrt, exp, linspace, mp, mpc, mpf, quad

from freqrail.model.band import Band
from freqrail.model.responses import RESPONSES
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.vehicle import Vehicle
from freqrail.solver import solution as the_solution
from freqrail.solver import solve
from freqrail.solver.problem import half_vehicle_problem
from tests.extremes import check as checking
from tests.extremes import forty_digits
from tests.extremes.check import check
from tests.extremes.draws import GERMAN_LOW, KNOWN, PLAUSIBLE, Draw, draw

WHOLE_AXIS = json.loads((Path(__file__).parent / "reference" / "whole_axis.json").read_text())
SPEED = 250 / 3.6
PAPERS = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke", "wheelset_acceleration")


# --- the campaign ------------------------------------------------------------------------------------


@pytest.mark.parametrize("drawn", KNOWN)
def test_what_was_wrong_once_is_right(drawn):
    found = check(drawn)
    assert found.violations == []
    assert found.values > 0


@pytest.mark.parametrize("number", [302, 1081, 1362])
def test_wheels_that_stand_close_for_the_wave_are_told_apart(number):
    """Draws of seed 21 whose primary strokes hung on differences of waves a millionth of a period apart."""
    found = check(draw(21, number))
    assert found.violations == []
    assert found.values > 0


def test_extremes_keep_their_promises():
    """Forty-five draws, most of their numbers given: no value is off by more than its estimate."""
    values = missing = 0
    for number in range(45):
        drawn = draw(1, number)
        found = check(drawn)
        assert found.violations == [], drawn
        values, missing = values + found.values, missing + found.missing
    assert values > missing


# --- what the campaign must see ----------------------------------------------------------------------

FAULTS = {
    "a value off by twice its estimate": ("car_body_acceleration_rms", lambda v, e: v * (1 + 2 * e)),
    "an estimate of nothing": ("primary_stroke_rms_relative_error", lambda v, e: 0 * v),
    "an estimate above 1e-6": ("bogie_acceleration_rms_relative_error", lambda v, e: 0 * v + 1e-5),
    "no number where all is well": ("traditional_secondary_stroke_rms", lambda v, e: np.nan * v),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_broken_promise_is_a_violation(fault, monkeypatch):
    name, change = FAULTS[fault]
    sweep = checking._sweep

    def broken(drawn: Draw):
        result = sweep(drawn)
        estimate = result[name if name.endswith("_error") else f"{name}_relative_error"]
        return result.assign({name: change(result[name], estimate)})

    plain = Draw(PLAUSIBLE)
    assert check(plain).violations == []
    monkeypatch.setattr(checking, "_sweep", broken)
    assert len(check(plain).violations) >= 1
    assert all(line.startswith(name.split("_rms")[0]) for line in check(plain).violations)


def test_a_value_of_an_infinite_variance_is_a_violation(monkeypatch):
    undamped = Draw(PLAUSIBLE | {"primary_damping": 0.0}, band=("frequency", 0.1, 100.0))
    assert check(undamped).violations == []
    sweep = checking._sweep
    monkeypatch.setattr(checking, "_sweep", lambda drawn: sweep(drawn).fillna(1e-9))
    found = check(undamped).violations
    assert len(found) == 2 * (4 + 4 + 2)
    assert all("true inf" in line for line in found)


def test_an_exception_and_a_hang_are_violations(monkeypatch):
    def fails(_: Draw) -> None:
        raise ZeroDivisionError("float division by zero")

    def hangs(_: Draw) -> None:
        end = time.process_time() + 30
        while time.process_time() < end:
            pass

    monkeypatch.setattr(checking, "SECONDS", 1)
    monkeypatch.setattr(checking, "_sweep", fails)
    assert check(Draw(PLAUSIBLE)).violations == ["ZeroDivisionError: float division by zero"]
    monkeypatch.setattr(checking, "_sweep", hangs)
    assert check(Draw(PLAUSIBLE)).violations == ["TimeoutError: took longer than 1 s"]


# --- the reference -----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", WHOLE_AXIS["cases"][::4], ids=lambda c: f"{c['primary_joint_stiffness']}")
def test_the_reference_has_the_twenty_digits_of_the_26_states(case):
    """Chains by Cramer's rule against eigenvectors of the whole vehicle, which share nothing."""
    with mp.workdps(60):
        vehicle = {name: mpf(text) for name, text in case["vehicle"].items()}
        load = vehicle["car_body_mass"] / 4 + vehicle["bogie_mass"] / 2 + vehicle["wheelset_mass"]
        vehicle["contact_stiffness"] = mpf("1.5") * cbrt(load * mpf("9.8")) / mpf(WHOLE_AXIS["contact_constant"])
        for joint in ("primary_joint_stiffness", "secondary_joint_stiffness"):
            vehicle[joint] = mpf(case[joint])
        speed = mpf(case["speed_km_h"]) / mpf("3.6")
        found = forty_digits.mean_squares(vehicle, tuple(map(mpf, WHOLE_AXIS["spectrum"])), speed)
        squares = [square for name in PAPERS for square in found[name]]
        for square, expected in zip(squares, map(mpf, case["mean_squares"]), strict=True):
            assert abs(square / expected - 1) < 1e-19


@pytest.mark.parametrize(("spectrum", "band"), [(GERMAN_LOW, (0.6, 190.0)), ((4e-7, 0.3, 0.3), (40.0, 45.0))])
def test_the_reference_over_a_band_is_the_integral_of_the_density(spectrum, band):
    """Exponential integrals against Gauss-Legendre panels of thirty digits, equal cut-offs among them."""
    found = forty_digits.mean_squares(PLAUSIBLE, spectrum, SPEED, band)
    with mp.workdps(30):
        vehicle = {name: mpf(value) for name, value in PLAUSIBLE.items()}
        chains = [forty_digits.solve_chain(vehicle, which) for which in range(3)]
        half, arm = vehicle["half_wheelbase"], vehicle["half_bogie_spacing"]
        delays = [2 * x / mpf(SPEED) for x in (0, half, arm, arm + half)]
        low, high = (mpf(cutoff) * mpf(SPEED) for cutoff in spectrum[1:])

        def density(omega):
            """Of the primary stroke at axle 4: all three chains, and every lag."""
            s = mpc(0, omega)
            u = [exp(-s * delay) for delay in delays]
            inputs = (sum(u) / 4, -(u[0] + u[1] - u[2] - u[3]) / 4, -(u[2] - u[3]) / 2)
            total = mpc(0)
            for chain, put in zip(chains, inputs, strict=True):
                element = forty_digits.evaluate(chain.numerators["primary"], s)
                total += element / forty_digits.evaluate(chain.denominator, s) * put
            scale = mpf(spectrum[0]) * mpf(spectrum[2]) ** 2 * mpf(SPEED) ** 3
            return abs(total) ** 2 * scale / ((low**2 + omega**2) * (high**2 + omega**2))

        expected = quad(density, linspace(*band, 30))
        assert abs(found["primary_stroke"][3] / expected - 1) < 1e-22


@pytest.mark.parametrize("number", [2, 7, 19])
def test_the_reference_does_not_depend_on_its_precision(number, monkeypatch):
    drawn = draw(5, number)
    asked = (drawn.vehicle, drawn.spectrum, drawn.speed, drawn.limits)
    first = forty_digits.mean_squares(*asked)
    monkeypatch.setattr(forty_digits, "FIRST", 400)
    for name, squares in forty_digits.mean_squares(*asked).items():
        for one, other in zip(first[name], squares, strict=True):
            assert one == other or abs(one / other - 1) < 1e-36


def test_bands_of_the_reference_add_up_to_the_whole_axis():
    edges = [0.0, 3.0, 1000.0, 1e9]
    parts = [forty_digits.mean_squares(PLAUSIBLE, GERMAN_LOW, SPEED, band) for band in itertools.pairwise(edges)]
    whole = forty_digits.mean_squares(PLAUSIBLE, GERMAN_LOW, SPEED)
    for name, squares in whole.items():
        for place, square in enumerate(squares):
            assert float(sum(part[name][place] for part in parts) / square) == pytest.approx(1.0, abs=1e-12)


# --- the ends of what a case accepts -----------------------------------------------------------------


@pytest.mark.parametrize("band", [None, Band("frequency", 0.1, 100.0), Band("wavelength", 1.0, 200.0)])
@pytest.mark.parametrize("seed", range(20))
def test_at_the_corners_of_a_wide_range_the_kernel_neither_raises_nor_hangs(seed, band):
    """Every quantity at a millionth or a million times the plausible; the slowest and the fastest train."""
    rng = np.random.default_rng(seed)
    vehicle = {name: value * 10.0 ** rng.choice([-6, 0, 6]) for name, value in PLAUSIBLE.items()}
    vehicle["half_bogie_spacing"] = max(vehicle["half_bogie_spacing"], 2 * vehicle["half_wheelbase"])
    for damper in ("primary_damping", "secondary_damping"):
        vehicle[damper] *= rng.choice([0.0, 1.0])
    for joint in ("primary_joint_stiffness", "secondary_joint_stiffness"):
        vehicle[joint] = rng.choice([1.0, vehicle[joint], math.inf])
    spectrum = RationalSpectrum("rational", 4.032e-7, (0.0206 * 10.0 ** rng.choice([-6, 0]), 0.8246))
    speeds = np.array([1e-3 / 3.6, 600 / 3.6])
    start = time.process_time()
    solution = solve.solve(half_vehicle_problem(Vehicle(**vehicle), speeds, spectrum, band, tuple(RESPONSES)))
    assert time.process_time() - start < 60
    for name, values in solution.rms.items():
        given = np.isfinite(values)
        assert np.array_equal(given, solution.relative_error[name] <= the_solution.TOLERANCE)
        assert np.all(given[:, solution.status == 0])


def test_a_spring_of_nothing_without_a_damper_ends():
    """It hung for minutes: a pole at zero kept the panels from leaving it."""
    vehicle = Vehicle(**PLAUSIBLE | {"secondary_stiffness": 1e-300, "secondary_damping": 0.0, "primary_damping": 0.0})
    for damping in (0.0, 17e3):
        study = half_vehicle_problem(
            replace(vehicle, primary_damping=damping),
            np.array([SPEED]),
            RationalSpectrum("german-low", GERMAN_LOW[0], GERMAN_LOW[1:]),
            None,
            tuple(RESPONSES),
        )
        start = time.process_time()
        solution = solve.solve(study)
        assert time.process_time() - start < 20
        assert solution.status[0] != 0
