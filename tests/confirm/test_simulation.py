"""The time domain against the frequency domain: they agree, and every fault put into one of them shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.confirm import setup, simulation, statistics, time_side
from freqrail.confirm.integrators import Accuracy
from freqrail.confirm.setup import MODELS, Setup
from freqrail.confirm.time_side import OperatingPoint, TimeSide
from freqrail.confirm.usual_run import plain_run
from freqrail.errors import InputError
from freqrail.model.band import Band
from freqrail.model.equations import state_space
from freqrail.model.responses import PAPER, series_count
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.vehicle import half_vehicle
from freqrail.result import verdicts
from freqrail.solver import solve
from freqrail.solver.problem import half_vehicle_problem
from tests.helpers import ALL_NAMES, lags, output_matrices

BAND = (0.1, 100.0)
SHORT = Setup(BAND, period=20.0, realisations=2, integrator="exponential")


@pytest.fixture(scope="module")
def point(paper_vehicle, german_low) -> OperatingPoint:
    return OperatingPoint(paper_vehicle, 250 / 3.6, german_low, "speed=250 km/h")


def reference(point: OperatingPoint, band=BAND) -> np.ndarray:
    """The numbers under test: RMS over the continuous spectrum, [model, series]."""
    rows = []
    for vehicle in (point.vehicle, point.vehicle.traditional()):
        study = half_vehicle_problem(vehicle, np.array([point.speed]), point.spectrum, Band("frequency", *band), PAPER)
        rms = solve.solve(study).rms
        rows.append(np.concatenate([rms[name][:, 0] for name in PAPER]))
    return np.array(rows)


def verdicts_of(point, plan, side=None, true=None) -> tuple[np.ndarray, np.ndarray]:
    """(solver, statistical) verdicts of one point; `true` is the point that the frequency domain knows."""
    return judged(simulation.examine(point, plan, side), plan, reference(true or point))


def judged(evidence: simulation.Simulation, plan: Setup, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(solver, statistical) verdicts of what was found at one point."""
    return (
        statistics.tolerance_verdicts(
            evidence.solver_error,
            np.array([[setup.SOLVER_TOLERANCE[setup.integrator_of(plan, model)]] for model in MODELS]),
            verdicts.FAILED,
        ),
        statistics.statistical_verdicts(evidence.pooled, evidence.degrees, known, 2 * series_count(PAPER)),
    )


def flagged(verdict: np.ndarray) -> bool:
    """Whether some check of each model says so."""
    return bool(np.all((verdict != 0).any(axis=1)))


# --- they agree ------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [100, 250, 300])
def test_one_period_of_the_exact_recurrence_has_the_line_spectrums_rms_to_2e_5(point, speed):
    evidence = simulation.examine(replace(point, speed=speed / 3.6), SHORT)
    assert evidence.failures == {}
    assert evidence.solver_error.shape == (2, series_count(PAPER))
    assert evidence.solver_error.max() < 2e-5


def test_rk45_does_too(point):
    evidence = simulation.examine(point, replace(SHORT, integrator="rk45", realisations=1, start="steady", period=18.0))
    assert evidence.solver_error.max() < 2e-5


def test_a_start_in_the_steady_state_needs_no_time_to_forget(point):
    plan = replace(SHORT, start="steady")
    assert setup.startup(point, plan) == 0
    assert simulation.examine(point, plan).solver_error.max() < 2e-5


def test_newmark_runs_the_traditional_model_and_rk45_the_other_as_in_the_paper(point):
    plan = replace(SHORT, integrator="newmark", limits=(0.1, 20.0), start="steady", period=18.0, realisations=1)
    assert [setup.integrator_of(plan, model) for model in MODELS] == ["rk45", "newmark"]
    found = simulation.examine(point, plan)
    assert found.solver_error[0].max() < 2e-5
    assert 1e-7 < found.solver_error[1].max() < 1e-3
    solver, _ = judged(found, plan, found.pooled)
    assert not solver.any()


def test_gaussian_records_confirm_the_continuous_rms(point):
    solver, statistical = verdicts_of(point, SHORT)
    assert not solver.any()
    assert not statistical.any()


def test_the_run_from_rest_and_the_run_in_the_steady_state_are_one_after_the_start_is_forgotten(point):
    rest = simulation.examine(point, SHORT)
    steady = simulation.examine(point, replace(SHORT, start="steady"))
    size = np.abs(rest.histories).max(axis=-1, keepdims=True)
    np.testing.assert_allclose(rest.histories / size, steady.histories / size, atol=2e-5)


def test_the_simulated_spectrum_is_the_analytic_one_at_every_line(point):
    evidence = simulation.examine(point, SHORT)
    peak = evidence.psd.max(axis=-1, keepdims=True)
    np.testing.assert_allclose(evidence.psd_simulated / peak, evidence.psd / peak, atol=1e-5)


def test_readout_is_that_of_the_tests_own_state_equations(paper_vehicle):
    c, d = output_matrices(paper_vehicle)
    side = time_side.time_side(OperatingPoint(paper_vehicle, 1.0, None, ""), ALL_NAMES)
    np.testing.assert_allclose(side.readout["joint"], np.concatenate([c[name] for name in ALL_NAMES]))
    np.testing.assert_allclose(side.feedthrough["joint"], np.concatenate([d[name] for name in ALL_NAMES]))


def test_lags_are_those_of_eq_2(point):
    np.testing.assert_allclose(time_side.time_side(point).lags, lags(point.vehicle, point.speed))


# --- it can fail -----------------------------------------------------------------------------------


def with_leg(point: OperatingPoint, name: str, **changes) -> TimeSide:
    """The time side with one suspension leg changed."""
    side = time_side.time_side(point)
    models = {}
    for model, vehicle in zip(MODELS, (point.vehicle, point.vehicle.traditional()), strict=True):
        system = half_vehicle(vehicle)
        legs = tuple(
            replace(leg, **{k: f * getattr(leg, k) for k, f in changes.items()}) if leg.name == name else leg
            for leg in system.legs
        )
        models[model] = state_space(replace(system, legs=legs))
    return replace(side, models=models)


@pytest.mark.parametrize("leg", ["secondary_1", "primary_3"])
def test_two_per_cent_on_one_stiffness_is_flagged(point, leg):
    solver, _ = verdicts_of(point, SHORT, with_leg(point, leg, stiffness=1.02))
    assert flagged(solver)


def test_two_per_cent_on_one_joint_is_flagged_in_the_joint_model_alone(point):
    solver, _ = verdicts_of(point, SHORT, with_leg(point, "primary_2", joint_stiffness=1.02))
    assert solver[0].any()
    assert not solver[1].any()


@pytest.mark.parametrize("order", [[1, 0, 2, 3], [0, 2, 1, 3], [3, 2, 1, 0]])
def test_a_swapped_wheel_lag_is_flagged(point, order):
    side = time_side.time_side(point)
    solver, _ = verdicts_of(point, SHORT, replace(side, lags=side.lags[order]))
    assert flagged(solver)


@pytest.mark.parametrize(("row", "column"), [("dz_t1/dt", "z_c"), ("dz_w3/dt", "beta_t2"), ("dbeta_t1/dt", "z_w1")])
def test_a_wrong_sign_in_one_coupling_term_is_flagged(point, row, column):
    side = time_side.time_side(point)
    models = {}
    for name, model in side.models.items():
        a = model.a.copy()
        a[model.states.index(row), model.states.index(column)] *= -1
        models[name] = replace(model, a=a)
    solver, _ = verdicts_of(point, SHORT, replace(side, models=models))
    assert flagged(solver)


def test_a_factor_of_two_pi_in_the_spectrum_passes_the_solver_check_and_is_flagged_by_the_statistical_one(point):
    wrong = RationalSpectrum("wrong", 2 * np.pi * point.spectrum.roughness, point.spectrum.cutoffs)
    solver, statistical = verdicts_of(replace(point, spectrum=wrong), SHORT, true=point)
    assert not solver.any()
    assert (statistical == 1).all()


def test_linear_interpolation_at_a_millisecond_is_flagged(point):
    plan = replace(SHORT, interpolation="linear")
    evidence = simulation.examine(point, plan)
    assert evidence.heights.shape[0] == 4
    solver, _ = judged(evidence, plan, reference(point))
    assert flagged(solver)


def test_a_model_that_runs_away_is_a_failure_with_a_reason_and_nan(point):
    side = time_side.time_side(point)
    runaway = replace(side.models["joint"], a=side.models["joint"].a + 2.0 * np.eye(26))
    evidence = simulation.examine(point, SHORT, replace(side, models={**side.models, "joint": runaway}))
    assert "grow without bound" in evidence.failures["joint"]
    assert np.isnan(evidence.simulated[0]).all()
    solver, statistical = judged(evidence, SHORT, reference(point))
    assert (solver[0] == verdicts.VERDICTS.index("failed")).all()
    assert (statistical[0] == verdicts.VERDICTS.index("failed")).all()


# --- the images of the track's spline ---------------------------------------------------------------

V = 250 / 3.6
FALSE_ALARMS = [(0.1, 40.0), (0.1, 50.0), (V / 200, V / 2)]  # the last: wavelengths 2 to 200 m


@pytest.mark.parametrize("limits", FALSE_ALARMS)
def test_no_band_makes_a_right_number_fail_the_solver_check(point, limits):
    plan = replace(SHORT, limits=limits, start="steady", realisations=1)
    assert simulation.examine(point, plan).solver_error.max() < 2e-6


@pytest.mark.parametrize("limits", FALSE_ALARMS)
def test_the_bound_of_the_images_is_above_what_they_do_and_ten_samples_a_period_would_not_do(
    point, limits, monkeypatch
):
    monkeypatch.setattr(setup, "SAMPLES_A_PERIOD", (10,))
    plan = replace(SHORT, limits=limits, start="steady", realisations=1)
    side = time_side.time_side(point)
    bound = setup.image_bound(point, plan, side, setup.sampling_rate(point, plan, side))
    found = simulation.examine(point, plan).solver_error.max()
    assert 1e-5 < found < 1.5 * bound  # a record's lines are not those that the bound is reckoned with


# --- a usual run -----------------------------------------------------------------------------------


def test_a_usual_run_reports_ten_times_the_bogies_acceleration_and_a_good_car_body(point):
    """docs/confirming.md: from rest, straight lines 5 ms apart, default tolerances."""
    time, responses, exact = plain_run(point, (0.1, 90.0), 10.0, 0.005)
    rms = np.sqrt(np.mean(responses**2, axis=-1))
    assert time[-1] == pytest.approx(10.0, abs=0.002)
    assert rms[0, 3] > 10 * exact[0, 3]
    assert rms[0, 0] == pytest.approx(exact[0, 0], rel=0.2)


def test_each_of_its_habits_alone_is_wrong_and_without_them_the_run_is_right(point):
    def ratio(step, **options):
        time, responses, exact = plain_run(point, (0.1, 90.0), 20.0, step, integrator="exponential", **options)
        return np.sqrt(np.mean(responses[0, 3, time > 4] ** 2)) / exact[0, 3]

    assert ratio(0.001, interpolation="cubic") > 2  # a sudden start, seconds later
    assert ratio(0.005, interpolation="linear", ramp=4.0) > 1.3  # straight lines
    assert ratio(0.001, interpolation="cubic", ramp=4.0) == pytest.approx(1, abs=0.05)


# --- before the run --------------------------------------------------------------------------------


def test_the_start_waits_for_the_slowest_mode_below_the_bands_end(point):
    # docs/confirming.md, "How a point is simulated": 29 s on the paper's case
    assert setup.startup(point, SHORT) - setup.RAMP == pytest.approx(29, abs=1)


def test_a_band_that_reaches_the_wheelsets_must_wait_for_them(point):
    # decay time 5.7 s at 5 MN/m, so ln(1e5) times that
    assert setup.startup(point, replace(SHORT, limits=(0.1, 250.0))) - setup.RAMP == pytest.approx(66, abs=2)


def test_records_too_short_for_a_mode_are_refused_with_the_length_that_is_due(point):
    with pytest.raises(InputError, match=r"too short.*--duration \"18 s\""):
        setup.check_setup(point, replace(SHORT, period=5.0))


def test_records_that_do_not_fit_the_memory_are_refused(point):
    with pytest.raises(InputError, match="GB of memory"):
        setup.check_setup(point, replace(SHORT, period=1e6))


def test_the_estimate_of_the_cost_grows_with_the_stiffness_for_rk45_and_not_for_the_recurrence(point):
    stiff = replace(point, vehicle=replace(point.vehicle, primary_joint_stiffness=1e10))
    plan = replace(SHORT, integrator="rk45")
    assert simulation.seconds(stiff, plan) > 20 * simulation.seconds(point, plan)
    assert simulation.seconds(stiff, SHORT) < 60


def test_a_plan_ten_times_tighter_changes_next_to_nothing(point):
    evidence = simulation.examine(point, SHORT, tighter=True)
    assert 0 < evidence.tighter_change < 2e-5
    assert replace(SHORT, accuracy=Accuracy(1e-5)).tighter().accuracy.relative == pytest.approx(1e-6)


def test_records_are_the_same_however_many_there_are_and_in_whatever_batches(point, monkeypatch):
    few = simulation.examine(point, SHORT)
    monkeypatch.setattr(simulation, "BATCH", 2)
    many = simulation.examine(point, replace(SHORT, realisations=4))
    np.testing.assert_allclose(many.simulated[..., :3], few.simulated, rtol=1e-12)
