"""Faults put into one side of a confirmation at a time: each is seen by the check that is named for it.

The sides: the kernel that makes the numbers, the lines and the closed forms that they are held against, the
simulation, and the file. What both sides share and no check can see is held to numbers from elsewhere in
test_frozen.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import freqrail
from freqrail.cli import tables
from freqrail.cli.commands import run as command
from freqrail.confirm import crosschecks, references, simulation, time_side, track_record
from freqrail.confirm.confirm import carry_out
from freqrail.confirm.labels import label
from freqrail.confirm.run import prepare_run
from freqrail.model import band as the_band
from freqrail.model import spectrum as model_spectrum
from freqrail.model.elements import Spring
from freqrail.model.responses import RESPONSES
from freqrail.result import confirmation
from freqrail.result.verdicts import CONFIRMED, NOT_CHECKED, OUTSIDE
from freqrail.solver import block_lags, block_residues, block_response, problem
from freqrail.solver import solve as solver_solve

pytestmark = pytest.mark.filterwarnings("ignore::freqrail.errors.FreqrailWarning")

OVER = {"speed": "100 km/h", "primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
QUICK = {
    "at": "speed=100 km/h",
    "integrator": "exponential",
    "start": "steady",
    "duration": "40 s",
    "realisations": 1,
}


@pytest.fixture(scope="module")
def result():
    """A point with all responses and spectra, up to 20 Hz to keep runs short."""
    return freqrail.sweep("yu-damper-joint", OVER, settings={"frequency": "0.1:20 Hz"}, responses="all", psd=True)


@pytest.fixture(scope="module")
def whole():
    """The same over the whole axis."""
    return freqrail.sweep("yu-damper-joint", OVER, settings={"band": "none"}, responses="all")


@pytest.fixture(scope="module")
def plan(result):
    return prepare_run(result, **QUICK)


@pytest.fixture(scope="module")
def simulated(plan):
    """The time side, without a fault."""
    return [simulation.examine(point, one) for point, one in zip(plan.points, plan.setups, strict=True)]


def judged(run, evidence):
    """The confirmation of a simulation that is done, its references computed anew."""
    found = [
        references.references(point, one, run.case.band, run.frequency)
        for point, one in zip(run.points, run.setups, strict=True)
    ]
    return label(run, evidence, found)


def outside(dataset) -> dict[str, set[str]]:
    """The checks that say "outside", and the responses that they say it of."""
    told: dict[str, set[str]] = {}
    for check in confirmation.checks_of(dataset):
        verdict = dataset[f"verdict_{check}"]
        labels = dataset[verdict.dims[-1]].values[(verdict.values == OUTSIDE).reshape(-1, verdict.shape[-1]).any(0)]
        if len(labels):
            told[check] = {str(each).split()[0] for each in labels}
    return told


ALL = set(RESPONSES)
PITCHING = {"bogie_acceleration", "secondary_stroke", "primary_stroke", "car_body_acceleration"}


def test_without_a_fault_all_stands(plan, simulated):
    found = judged(plan, simulated)
    assert outside(found) == {}
    assert confirmation.problems(found) == []
    assert confirmation.not_checked(found) == []
    # 18 series in 2 models by five checks, and the track in two ranges
    assert confirmation.count_of_checks(found) == (18 * 2 * 5 + 2, 18 * 2 * 5 + 2)


# --- the kernel ------------------------------------------------------------------------------------


def scaled(factors):
    """`solve.solve` with the RMS of some responses times a factor."""
    true = solver_solve.solve

    def solve(*given, **options):
        solution = true(*given, **options)
        return replace(solution, rms={name: factors.get(name, 1.0) * rms for name, rms in solution.rms.items()})

    return solve


@pytest.mark.parametrize(
    "factors",
    [
        dict.fromkeys(ALL, 1.003),
        dict.fromkeys(ALL, 1.01),
        dict.fromkeys(ALL, 0.999),
        {"car_body_acceleration": 1.05},
        {"secondary_stroke": 1.05},
        {"wheelset_acceleration": 2.0},
        {"car_body_pitch_acceleration": 2.0},
        {"bogie_pitch_acceleration": 1 - 1e-5},
    ],
    ids=lambda factors: f"{len(factors)} x {max(factors.values()):g}",
)
def test_a_kernel_whose_rms_is_off_is_seen_by_the_kernel_check(plan, simulated, monkeypatch, factors):
    monkeypatch.setattr(solver_solve, "solve", scaled(factors))
    assert outside(judged(plan, simulated))["kernel"] == set(factors)


def test_a_kernel_with_two_per_cent_more_density_is_seen_by_the_kernel_check(plan, simulated, monkeypatch):
    true = model_spectrum.angular_psd
    monkeypatch.setattr(block_lags, "angular_psd", lambda *given: 1.02 * true(*given))
    assert outside(judged(plan, simulated))["kernel"] == ALL


def test_a_lag_function_with_the_wrong_sign_is_seen_by_the_kernel_check(plan, simulated, monkeypatch):
    """That of the bogies' pitch beside what moves a bogie and a wheelset alike: two products of scalars have it."""
    true = block_lags.lag_functions

    def turned(reduction, *given):
        functions = true(reduction, *given)
        shared = {column.lag for column in reduction.columns["primary_stroke"] if len(column.powers) == 2}
        (k,) = shared
        functions[k] *= -1
        return functions

    monkeypatch.setattr(block_lags, "lag_functions", turned)
    # below 20 Hz the wheelsets' share of it is less than what the check allows
    assert outside(judged(plan, simulated))["kernel"] == {"primary_stroke"}


def test_a_kernel_whose_lags_are_those_of_another_speed_is_seen_by_the_kernel_check(plan, simulated, monkeypatch):
    true = block_lags.lag_functions
    monkeypatch.setattr(block_lags, "lag_functions", lambda of, places, delay: true(of, places, delay / 1.01))
    assert outside(judged(plan, simulated))["kernel"] == ALL


@pytest.mark.parametrize("factor", [0.5, 3.0])
@pytest.mark.parametrize("edge", [0, 1])
def test_a_kernel_with_another_edge_of_the_band_is_seen_by_the_kernel_check(plan, simulated, monkeypatch, factor, edge):
    true = the_band.band_limits

    def moved(band, speed):
        limits = true(band, speed).copy()
        limits[edge] *= factor
        return limits

    monkeypatch.setattr(problem, "band_limits", moved)
    assert outside(judged(plan, simulated))["kernel"] >= PITCHING


def test_a_closed_form_that_is_off_is_seen_by_the_whole_axis_check(whole, monkeypatch):
    run = prepare_run(whole, **QUICK, band="0.5:10 Hz")
    simulated = [simulation.examine(point, one) for point, one in zip(run.points, run.setups, strict=True)]
    assert outside(judged(run, simulated)) == {}
    true = block_residues.whole_axis_mean_squares

    def off(*given):
        found = true(*given)
        return {name: replace(square, value=1.002 * square.value) for name, square in found.items()}

    with monkeypatch.context() as patch:
        patch.setattr(block_residues, "whole_axis_mean_squares", off)
        assert outside(judged(run, simulated))["whole_axis"] == ALL
    with monkeypatch.context() as patch:  # the other side: states that vary too much
        solved = crosschecks.solve_sylvester
        patch.setattr(crosschecks, "solve_sylvester", lambda *given: 1.002 * solved(*given))
        assert outside(judged(run, simulated))["whole_axis"] == ALL


# --- what the kernel shares with the lines -----------------------------------------------------------


@pytest.mark.parametrize("factor", [1.01, 1 + 1e-3])
def test_a_fault_in_the_blocks_is_not_seen_by_the_kernel_check_but_by_the_solver_check(plan, monkeypatch, factor):
    """As the table of what a run would have seen says: both begin from the blocks, the simulation does not."""
    true = block_response.compliance

    def softer(law, *given):
        """Legs that give way more; the contact is a spring alone."""
        return true(law, *given) if isinstance(law, Spring) else np.multiply(factor, true(law, *given))

    plain = carry_out(plan)
    monkeypatch.setattr(block_response, "compliance", softer)
    found = carry_out(plan)
    told = outside(found)
    assert "kernel" not in told
    assert told["solver"] >= PITCHING
    for name in PITCHING:
        fault = np.abs(found[f"{name}_rms_frequency_domain"] / plain[f"{name}_rms_frequency_domain"] - 1)
        assert float(fault.max()) > float(found["solver_tolerance"].max())


def test_the_table_says_which_check_sees_a_fault_in_the_blocks(plan, simulated):
    _, lines = tables.confirmation_text(judged(plan, simulated))
    (place,) = (i for i, line in enumerate(lines) if line.startswith("smallest fault of an RMS"))
    assert lines[place + 2].endswith("a fault of the blocks is seen by the solver check")
    assert "by the kernel check %  by the solver check %  by the simulation %" in lines[place + 1]


# --- what the kernel is held against ---------------------------------------------------------------


def test_lines_that_respond_too_much_are_seen_by_the_kernel_check(plan, simulated, monkeypatch):
    true = crosschecks.transfer_power
    monkeypatch.setattr(crosschecks, "transfer_power", lambda *given: 1.006 * true(*given))
    assert outside(judged(plan, simulated)) == {"kernel": ALL}


def test_lines_whose_lags_are_those_of_another_speed_are_seen_by_the_kernel_check(plan, simulated, monkeypatch):
    true = crosschecks.half_vehicle_transfer
    monkeypatch.setattr(crosschecks, "half_vehicle_transfer", lambda *given: true(*given[:3], 1.01 * given[3]))
    assert outside(judged(plan, simulated)) == {"kernel": ALL}


def faulty_simulation(plan):
    """The confirmation with the time side simulated anew."""
    return outside(carry_out(plan))


def test_lines_with_two_per_cent_more_density_are_seen_by_the_kernel_and_the_track_check(plan, monkeypatch):
    true = model_spectrum.frequency_psd
    monkeypatch.setattr(track_record, "frequency_psd", lambda *given: 1.02 * true(*given))
    told = faulty_simulation(plan)
    assert told["kernel"] == ALL
    assert told["track"] == {"3-25", "band"}


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_lines_with_another_low_edge_of_the_band_are_seen_by_the_kernel_and_the_track_check(plan, monkeypatch, factor):
    true = track_record.spectral_lines

    def moved(spectrum, speed, limits, period):
        return true(spectrum, speed, (factor * limits[0], limits[1]), period)

    monkeypatch.setattr(crosschecks, "spectral_lines", moved)
    monkeypatch.setattr(simulation, "spectral_lines", moved)
    told = faulty_simulation(plan)
    assert told["kernel"] >= PITCHING
    assert ("track" in told) == (factor > 1)  # lines beyond the band are no part of the deviation inside it


def test_a_density_that_is_wrong_on_both_sides_is_seen_by_the_track_check_alone(plan, monkeypatch):
    true = model_spectrum.wavenumber_psd
    monkeypatch.setattr(model_spectrum, "wavenumber_psd", lambda *given: 1.02 * true(*given))
    told = faulty_simulation(plan)
    assert told["track"] == {"3-25", "band"}
    assert "kernel" not in told
    assert "solver" not in told


def test_a_closed_form_of_the_tracks_deviation_that_is_off_is_seen_by_the_track_check(plan, simulated, monkeypatch):
    true = references.standard_deviation
    monkeypatch.setattr(references, "standard_deviation", lambda *given: 1.001 * true(*given))
    assert outside(judged(plan, simulated)) == {"track": {"3-25", "band"}}


def test_gaussian_records_that_are_too_strong_are_seen_by_the_statistical_check(plan, monkeypatch):
    true = simulation.gaussian_amplitudes
    monkeypatch.setattr(simulation, "gaussian_amplitudes", lambda *given: 1.7 * true(*given))
    assert faulty_simulation(plan) == {"statistical": ALL}


def test_a_simulation_whose_readout_is_off_is_seen_by_the_solver_and_the_spectral_check(plan, monkeypatch):
    true = time_side.readout

    def off(*given):
        rows, feedthrough = true(*given)
        return 1.001 * rows, 1.001 * feedthrough

    monkeypatch.setattr(time_side, "readout", off)
    told = faulty_simulation(plan)
    assert told["solver"] == told["psd"] == ALL


# --- the file --------------------------------------------------------------------------------------


def wrong(result, factor, *parts):
    """The result with some of its variables times a factor."""
    found = result.copy(deep=True)
    names = [str(name) for name in result.data_vars if any(part in str(name) for part in parts)]
    assert names
    for name in names:
        found[name] = factor * found[name]
    return found


@pytest.mark.parametrize(
    ("factor", "part", "check", "responses"),
    [
        (np.pi, "_psd", "psd", ALL),
        (1.0001, "bogie_acceleration_psd", "psd", {"bogie_acceleration"}),
        (2.0, "wheelset_acceleration_rms", "result", {"wheelset_acceleration"}),
        (2.0, "pitch_acceleration_rms", "result", {"car_body_pitch_acceleration", "bogie_pitch_acceleration"}),
        (1.0001, "_rms", "result", ALL),
    ],
)
def test_a_file_whose_numbers_are_off_is_seen_by_the_check_of_the_result(
    result, plan, simulated, factor, part, check, responses
):
    found = judged(replace(plan, dataset=wrong(result, factor, part)), simulated)
    assert outside(found) == {check: responses}
    assert any(f"{check} check outside" in line for line in confirmation.problems(found))


def test_spectra_that_are_computed_wrong_for_comparison_are_seen_by_the_check_of_the_spectra(
    plan, simulated, monkeypatch
):
    true = model_spectrum.frequency_psd
    monkeypatch.setattr(references, "frequency_psd", lambda *given: 2 * np.pi * true(*given))
    assert outside(judged(plan, simulated)) == {"psd": ALL}


def test_a_file_over_the_whole_axis_whose_numbers_are_off_is_seen_by_the_check_of_the_result(whole):
    run = prepare_run(wrong(whole, 2.0, "_rms"), **QUICK, band="0.5:10 Hz")
    assert outside(carry_out(run)) == {"result": ALL}


def test_a_file_of_nan_is_not_checked_and_the_command_ends_with_3(result, tmp_path, capsys):
    path = tmp_path / "nan.nc"
    broken = wrong(result, np.nan, "_rms", "_psd")
    for status in ("status", "traditional_status"):
        broken[status] += 1
    freqrail.write_result(broken, path)
    given = [part for name, value in QUICK.items() for part in (f"--{name}", str(value))]
    assert command(["confirm", str(path), *given]) == 3
    told = capsys.readouterr()
    assert "nothing of the result was checked" in told.err
    assert "result check: 36 of 36 not checked (the result has no number there)" in told.out
    assert "checks: all stand" not in told.out
    found = freqrail.open_result(tmp_path / "nan-confirmation.nc")
    assert (found.verdict_result == NOT_CHECKED).all()
    assert (found.verdict_kernel == CONFIRMED).all()


def test_a_number_that_the_file_lacks_is_not_checked_and_the_rest_stands(result, plan, simulated):
    partly = result.copy(deep=True)
    partly["car_body_acceleration_rms"][...] = np.nan
    found = judged(replace(plan, dataset=partly), simulated)
    assert confirmation.problems(found) == []
    assert confirmation.not_checked(found) == ["result check: 3 of 36 not checked (the result has no number there)"]
