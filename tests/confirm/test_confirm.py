"""Confirmations: what a user asks for is what is simulated, judged, labelled, drawn and told."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.case.case import build_case
from freqrail.cli import tables
from freqrail.cli.commands import run as command
from freqrail.confirm import run as confirm_run
from freqrail.confirm import setup, simulation, statistics, time_side
from freqrail.confirm.confirm import carry_out
from freqrail.confirm.run import check_cost, prepare_run
from freqrail.confirm.track_record import spectral_lines
from freqrail.errors import FreqrailWarning, InputError
from freqrail.figures import confirmations, plot
from freqrail.model import responses
from freqrail.result import confirmation
from freqrail.result.points import parse_point

pytestmark = pytest.mark.filterwarnings("ignore:the simulation .* would have seen no fault below")

QUICK = {"integrator": "exponential", "duration": "20 s", "realisations": 2}
FAST = ["--integrator", "exponential", "--duration", "20 s", "--realisations", "2"]
AT = ["speed=250 km/h, primary_joint_stiffness=5 MN/m", "speed=300 km/h, primary_joint_stiffness=5 MN/m"]


def sweep(over=None, settings=None, points=""):
    """The shipped case over two speeds and joints, up to 20 Hz to keep runs short; `points` are its own to confirm."""
    text = freqrail.load_case("yu-damper-joint").text.partition("[confirm]")[0] + points
    text = text.replace('"100 Hz"', '"20 Hz"')
    over = over or {
        "speed": "250, 300 km/h",
        "primary_joint_stiffness": "5, 10 MN/m",
        "secondary_joint_stiffness": "5 MN/m",
    }
    return freqrail.sweep(build_case(text, settings, over, name="yu-damper-joint"))


@pytest.fixture(scope="module")
def result():
    return sweep(points='[confirm]\npoints = [{ speed = "250 km/h" }, { speed = "300 km/h" }]\n')


@pytest.fixture(scope="module")
def confirmed(result):
    return freqrail.confirm(result, **QUICK)


@pytest.fixture(scope="module")
def file(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("confirm") / "small.nc"
    freqrail.write_result(result, path)
    return path


def lines(capsys) -> list[str]:
    return capsys.readouterr().err.splitlines()


# --- the dataset -----------------------------------------------------------------------------------


def test_the_cases_own_points_are_confirmed_unless_others_are_named(result, confirmed):
    assert confirmed["speed"].values.tolist() == [250, 300]
    assert confirmed["primary_joint_stiffness"].values.tolist() == [5, 5]
    assert [place.index["speed"] for place in prepare_run(result, AT[1], **QUICK).places] == [1]


def test_the_dataset_has_the_names_and_dimensions_of_the_conventions(confirmed):
    """docs/conventions.md, "Confirmations"."""
    assert dict(confirmed.sizes) | {"line": 0, "sample": 0} == {
        "point": 2,
        "model": 2,
        "series": 11,
        "record": 3,
        "car_position": 3,
        "bogie": 2,
        "axle": 4,
        "wavelength_range": 2,
        "limit": 2,
        "line": 0,
        "sample": 0,
    }
    for name, place in (("car_body_acceleration", "car_position"), ("primary_stroke", "axle")):
        for suffix in ("frequency_domain", "interval_low", "interval_high"):
            assert confirmed[f"{name}_rms_{suffix}"].dims == ("point", "model", place)
        for suffix in ("line_spectrum", "time_domain"):
            assert confirmed[f"{name}_rms_{suffix}"].dims == ("point", "model", place, "record")
    for name in ("solver_error", "verdict_solver", "verdict_statistical"):
        assert confirmed[name].dims == ("point", "model", "series")
    assert confirmed.verdict_solver.sel(series="primary_stroke axle 3", model="joint", point=1) == 0


def test_the_frequency_domain_number_is_the_results_own(result, confirmed):
    own = result.sel(speed=300, primary_joint_stiffness=5, secondary_joint_stiffness=5)
    found = confirmed.sel(point=2)
    for name in responses.PAPER:
        for model, prefix in (("joint", ""), ("traditional", "traditional_")):
            here, there = found[f"{name}_rms_frequency_domain"].sel(model=model), own[f"{prefix}{name}_rms"]
            np.testing.assert_allclose(here, there, rtol=1e-12)
    assert np.abs(confirmed.result_difference).max() < 1e-12


def test_all_numbers_stand_and_the_interval_holds_the_number(confirmed):
    assert confirmation.problems(confirmed) == []
    assert confirmed.solver_error.max() < 2e-5
    for name in responses.PAPER:
        low, high = confirmed[f"{name}_rms_verdict_low"], confirmed[f"{name}_rms_verdict_high"]
        assert bool(
            ((low < confirmed[f"{name}_rms_frequency_domain"]) & (confirmed[f"{name}_rms_pooled"] < high)).all()
        )
        assert bool((low < confirmed[f"{name}_rms_interval_low"]).all())


def test_the_pooled_rms_is_that_of_the_gaussian_records_alone(confirmed):
    records = confirmed.bogie_acceleration_rms_time_domain.isel(record=slice(1, None))
    np.testing.assert_allclose(np.sqrt((records**2).mean("record")), confirmed.bogie_acceleration_rms_pooled)


def test_conditions_are_attributes(confirmed):
    a = confirmed.attrs
    assert (a["seed"], a["realisations"], a["duration_s"], a["start"]) == (0, 2, 20.0, "rest")
    assert "exponential" in a["integrator"]
    assert "spline" in a["interpolation"]
    assert "ln(100000)" in a["discard_rule"]
    assert 0 < a["tighter_repeat_change"] < 2e-5
    assert a["ramp_s"] == setup.RAMP
    assert len(a["result_content_digest"]) == 64
    assert "scipy" in json.loads(a["versions"])
    assert a["effective_case_sha256"]


def test_the_file_keeps_every_bit_and_any_number_of_points(confirmed, tmp_path):
    for name, dataset in (("two", confirmed), ("one", confirmed.isel(point=[0]))):
        path = freqrail.write_result(dataset, tmp_path / f"{name}.nc")
        xr.testing.assert_equal(freqrail.open_result(path), dataset)


def test_the_file_passes_the_cf_checker(confirmed, tmp_path):
    from compliance_checker.runner import CheckSuite, ComplianceChecker

    path, report = tmp_path / "c.nc", tmp_path / "report.json"
    freqrail.write_result(confirmed, path)
    CheckSuite.load_all_available_checkers()
    ComplianceChecker.run_checker(
        str(path), ["cf:1.11"], 0, "strict", output_filename=str(report), output_format="json"
    )
    found = json.loads(report.read_text())["cf:1.11"]
    assert [c["msgs"] for c in found["high_priorities"] if c["value"][0] != c["value"][1]] == []


def test_numbers_are_the_same_whatever_the_order_of_the_points_and_the_number_of_processes(result, confirmed):
    turned = freqrail.confirm(result, at=AT[::-1], jobs=2, **QUICK)
    for name in ("bogie_acceleration_rms_time_domain", "primary_stroke_history", "track_height"):
        np.testing.assert_array_equal(turned[name].values[::-1], confirmed[name].values)


def test_another_seed_gives_other_records_and_the_same_reference(result, confirmed):
    other = freqrail.confirm(result, at=AT[0], seed=1, **QUICK)
    assert np.all(
        other.bogie_acceleration_rms_time_domain[0, :, :, 1:]
        != confirmed.bogie_acceleration_rms_time_domain[0, :, :, 1:]
    )
    assert np.all(
        other.bogie_acceleration_rms_frequency_domain[0] == confirmed.bogie_acceleration_rms_frequency_domain[0]
    )


def test_histories_and_track_are_bounded_and_the_track_reaches_the_wheels_one_after_the_other(confirmed):
    assert float(confirmed.time.max()) < setup.HISTORY
    first, last = (confirmed.track_height.isel(point=0).sel(axle=n).values for n in (1, 4))
    v = 250 / 3.6
    lag = 2 * (0.797 + 3.289) / v
    time = confirmed.time.isel(point=0).values
    later = np.interp(time[200:] - lag, time, first)
    assert np.abs(later - last[200:]).max() < 0.02 * np.abs(first).max()


# --- bands -----------------------------------------------------------------------------------------


def test_a_result_without_a_band_is_confirmed_over_0_1_to_100_hz_and_says_so():
    with pytest.warns(FreqrailWarning, match="rigid rail"):
        whole = sweep(settings={"band": "none"})
    found = freqrail.confirm(whole, at=AT[0], **QUICK)
    assert confirmation.band_note(found) == "confirmed over 0.1 to 100 Hz (the result's own band: whole axis)"
    assert not found.verdict_whole_axis.any()
    np.testing.assert_allclose(
        found.bogie_acceleration_rms_covariance, found.bogie_acceleration_rms_whole_axis, rtol=1e-9
    )
    assert confirmation.problems(found) == []
    assert found.bogie_acceleration_rms_frequency_domain[0, 0, 0] < whole.bogie_acceleration_rms[0, 0, 0, 0]


def test_a_wavelength_band_is_that_of_each_points_speed():
    waves = sweep(settings={"wavelength": "1:100 m"})
    plans = prepare_run(waves, AT, **QUICK).setups
    assert plans[1].limits == pytest.approx((300 / 3.6 / 100, 300 / 3.6))
    found = freqrail.confirm(waves, at=AT, **QUICK)
    assert confirmation.problems(found) == []
    assert np.isfinite(found.frequency.isel(point=1)).all()


def test_a_band_can_be_named(result):
    assert prepare_run(result, AT[0], band="0.5:20 Hz", **QUICK).setups[0].limits == pytest.approx((0.5, 20))
    assert prepare_run(result, AT[0], band="1:100 m", **QUICK).setups[0].limits == pytest.approx((250 / 360, 250 / 3.6))


# --- it can fail -----------------------------------------------------------------------------------


def test_a_result_whose_numbers_are_wrong_does_not_stand(result):
    """As a later freqrail would find that an earlier one had a fault: the digest alone would not show it."""
    wrong = result.copy(deep=True)
    wrong["bogie_acceleration_rms"] *= 1.001
    told = confirmation.problems(freqrail.confirm(wrong, at=AT[0], **QUICK))
    assert len(told) == 1
    assert "differ by up to 0.1 % from" in told[0]


def test_a_faulty_simulation_does_not_stand_and_the_command_ends_with_3(file, monkeypatch, capsys, tmp_path):
    true = time_side.time_side
    monkeypatch.setattr(simulation, "time_side", lambda *given: replace(true(*given), lags=true(*given).lags[::-1]))
    out = tmp_path / "out.nc"
    assert command(["confirm", str(file), *FAST, "--at", AT[0], "-o", str(out)]) == 3
    told = lines(capsys)
    assert any("solver check outside" in line for line in told)
    assert out.exists()
    found = freqrail.open_result(out)
    assert (found.verdict_solver == 1).any()
    assert np.isfinite(found.solver_error).all()


def test_a_run_that_fails_is_nan_with_a_verdict_and_its_reason(result, monkeypatch):
    true = time_side.time_side

    def runaway(*given):
        side = true(*given)
        model = side.models["joint"]
        return replace(side, models={**side.models, "joint": replace(model, a=model.a + 2 * np.eye(len(model.a)))})

    monkeypatch.setattr(simulation, "time_side", runaway)
    found = carry_out(prepare_run(result, AT[0], **QUICK))
    assert (found.verdict_solver.sel(model="joint") == 2).all()
    assert (found.verdict_statistical.sel(model="joint") == 2).all()
    assert not found.verdict_solver.sel(model="traditional").any()
    told = confirmation.problems(found)
    assert "grow without bound" in told[0]
    assert any("without a number" in line for line in told)


# --- what it would have seen ------------------------------------------------------------------------


def test_the_smallest_fault_seen_is_one_that_the_interval_just_leaves_out(confirmed):
    """A number right but for that fault lies outside, one right but for nine tenths of it does not."""
    for name in responses.PAPER:
        part = confirmation.series_of(responses.PAPER)[name]
        own = confirmed[f"{name}_rms_frequency_domain"].values
        low, high = confirmed[f"{name}_rms_verdict_low"].values, confirmed[f"{name}_rms_verdict_high"].values
        fault = confirmed.smallest_fault_seen.values[..., part]
        assert np.all((own * (1 + 1.001 * fault) > high) & (own * (1 - 1.001 * fault) < low))
        nearly = 0.999 * fault
        assert np.all((own * (1 + nearly) <= high) | (own * (1 - nearly) >= low))
        width = confirmed.half_width.values[..., part]
        np.testing.assert_allclose(width, (high - low) / 2 / confirmed[f"{name}_rms_pooled"].values)


def test_a_run_that_sees_nothing_below_ten_per_cent_says_so_and_what_would(result):
    with pytest.warns(FreqrailWarning, match=r"1 records? of 30 s\) would have seen no fault below \d+ %") as told:
        found = freqrail.confirm(result, AT[0], integrator="exponential", duration="30 s", realisations=1)
    records, duration = re.search(r'--realisations (\d+) --duration "(\d+) s"', str(told[0].message)).groups()
    least = min(row["simulation_percent"] for row in confirmation.power(found))
    # four times the time simulated, half the width
    enough = int(records) * int(duration) / 30 * (10 / least) ** 2
    assert 1 <= enough < 2.1


def test_the_power_is_told_for_each_response_and_check(confirmed):
    rows = {row["response"]: row for row in confirmation.power(confirmed)}
    assert len(rows) == 4
    assert all(row["kernel_percent"] < 0.1 for row in rows.values())
    assert all(row["solver_percent"] == pytest.approx(2e-3) for row in rows.values())
    assert 1 < rows["bogie frame vertical acceleration"]["simulation_percent"] < 20


def test_what_the_manual_says_of_the_default_run_s_intervals():
    """Half of the interval that decides hangs on the lines' power alone, not on the records."""
    text = (Path(__file__).parents[2] / "docs" / "confirming.md").read_text()
    run = prepare_run(freqrail.sweep("yu-damper-joint"))
    degrees = []
    for point, how in zip(run.points, run.setups, strict=True):
        lines = spectral_lines(point.spectrum, point.speed, how.limits, how.period)
        power = time_side.line_power(point, how.names, lines.frequency)
        degrees.append(statistics.degrees_of_freedom(power, lines, how.realisations))
    checks = np.size(degrees)
    low, high = statistics.interval(np.ones(np.shape(degrees)), np.array(degrees), statistics.simultaneous(checks))
    told = []
    for name in ("bogie_acceleration", "car_body_acceleration", "secondary_stroke"):
        width = 50 * (high - low)[..., confirmation.series_of(responses.PAPER)[name]]
        told.append(f"{width.min():.1f} to {width.max():.1f} %")
    words = f"{told[0]} for the bogie, {told[1]} for the car body, {told[2]} for the secondary stroke"
    assert f"with the defaults {words}" in " ".join(text.split())


def test_a_lag_of_nothing_is_printed_as_0():
    shared = {
        "static_wheel_load_N": 1e4,
        "contact_stiffness_N_per_m": 1e9,
        "lags_s": [0.0, 0.02295],
        "simulated_lags_s": [-4.4e-18, 0.02295],
        "track": [],
    }
    assert "lags 0, 22.95 ms (on the track simulated 0, 22.95)" in tables._shared_text(shared)


# --- before the run --------------------------------------------------------------------------------


def test_of_the_cases_points_those_on_a_narrowed_grid_will_do():
    """The case names 100, 250 and 300 km/h."""
    with pytest.warns(
        FreqrailWarning, match=r"speed = [13]00 km/h is off the grid: left out; name it with --at"
    ) as told:
        run = prepare_run(freqrail.sweep("yu-damper-joint", {"speed": "250, 260 km/h"}), **QUICK)
    assert len(told) == 2
    assert [point.speed for point in run.points] == [pytest.approx(250 / 3.6)]


def test_if_none_of_them_is_on_the_grid_they_are_computed_anew():
    with pytest.warns(FreqrailWarning, match=r"computed anew: speed = \d+ km/h is not on the result's grid") as told:
        run = prepare_run(freqrail.sweep("yu-damper-joint", {"speed": "260 km/h"}), **QUICK)
    assert len(told) == 3
    assert [point.speed for point in run.points] == pytest.approx([100 / 3.6, 250 / 3.6, 300 / 3.6])


def test_the_cases_own_value_on_a_logarithmic_axis_is_computed_anew_and_confirmed():
    fine = sweep(over={"primary_joint_stiffness": "log:1:50:4 MN/m", "secondary_joint_stiffness": "5 MN/m"})
    at = "primary_joint_stiffness=5000 kN/m"
    with pytest.warns(FreqrailWarning, match=r"computed anew: primary_joint_stiffness = 5 MN/m is not on the result"):
        found = freqrail.confirm(fine, at=[at, "primary_joint_stiffness=1 MN/m"], **QUICK)
    assert found.computed_anew.values.tolist() == [1, 0]
    np.testing.assert_allclose(found.primary_joint_stiffness, [5, 1], rtol=1e-12)
    np.testing.assert_allclose(found.primary_joint_compliance, [0.2, 1], rtol=1e-12)
    assert confirmation.problems(found) == []
    assert (found.verdict_result[0] == 3).all()  # the file holds no number there
    assert (found.verdict_result[1] == 0).all()
    assert confirmation.not_checked(found) == ["result check: 22 of 44 not checked (the result has no number there)"]
    shown = tables.confirmation_text(found)[1]
    anew = [n for n, line in enumerate(shown) if line.startswith("computed anew: not on the result's grid")]
    assert [shown[n - 1].split(",")[0] for n in anew] == ["primary_joint_stiffness = 5 MN/m"]
    assert not any("nan" in line for line in shown)
    assert [line for line in shown if "checks" in line and "those stand" in line] == [
        "202 of 224 checks made: those stand; not checked:"
    ]
    assert tables.confirmation_text(found)[0]["computed_anew"] == [found.place.values[0]]
    figure = confirmations.drawings(found)["confirmation"]()
    assert ["(computed anew)" in ax.get_title() for ax in figure.axes] == [True, False]
    assert "(computed anew)" in confirmations.drawings(found)["psd-point-1"]().get_suptitle()
    # and it is the number of that very vehicle
    own = sweep(over={"primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}).squeeze()
    here = found.bogie_acceleration_rms_frequency_domain.sel(point=1, model="joint")
    np.testing.assert_allclose(here, own.bogie_acceleration_rms.sel(speed=250), rtol=1e-12)


def test_a_confirmation_of_computed_anew_points_alone_compares_nothing_and_ends_with_3(file, tmp_path, capsys):
    arguments = ["confirm", str(file), *FAST, "-o", str(tmp_path / "c.nc"), "--at", "speed=260 km/h"]
    assert command(arguments) == 3
    told = [line for line in lines(capsys) if "nothing of the result was checked" in line]
    assert len(told) == 1
    assert "its grid holds no point confirmed, all were computed anew" in told[0]
    advised = re.search(r'--at "(.*)"', told[0])
    run = prepare_run(file, advised[1], **QUICK)  # the advice is a point of the grid
    assert [place.anew for place in run.places] == [()]
    assert command(["show", str(tmp_path / "c.nc")]) == 0
    assert "NOT all stand" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"at": "sped=250 km/h"}, "unknown name (did you mean speed?)"),
        ({"at": "bogie_mass=650 kg"}, "is not swept"),
        ({"at": [AT[0], AT[0]]}, "the same point as point 1"),
        ({"seed": -1}, "--seed: must be a whole number from 0 to"),
        ({"seed": 2**63 + 1}, "--seed: must be"),
        ({"seed": 1.5}, "--seed: must be"),
        ({"realisations": 0}, "--realisations: must be a whole number from 1"),
        ({"duration": "60"}, "--duration: a unit is missing"),
        ({"duration": "nan s"}, "--duration: nan is not a number"),
        ({"duration": "60 m"}, "--duration: wrong dimension"),
        ({"duration": "-1 s"}, "--duration: must be greater than 0"),
        ({"duration": "5 s"}, "too short"),
        ({"duration": "1e9 s"}, "GB of memory"),
        ({"integrator": "rk4"}, "--integrator: unknown (did you mean rk45?)"),
        ({"start": "middle"}, "--start: unknown"),
        ({"band": "100:0.1 Hz"}, "--band: the lower limit must be below"),
        ({"band": "100 Hz"}, "--band: two quantities are expected"),
        ({"band": "0:100 Hz"}, "--band: must be greater than 0"),
    ],
)
def test_bad_options_are_refused_before_anything_is_run(result, options, words):
    with pytest.raises(InputError) as fault:
        freqrail.confirm(result, **{**QUICK, **options})
    assert words in str(fault.value)


def test_all_faults_are_told_at_once(result):
    with pytest.raises(InputError) as fault:
        prepare_run(result, seed=-1, realisations=0, duration="x", band="y")
    assert len(fault.value.problems) == 4


def test_a_confirmation_cannot_be_confirmed(confirmed):
    with pytest.raises(InputError, match="this dataset is a confirmation; what it confirms, a result of a sweep, is"):
        freqrail.confirm(confirmed)
    with pytest.raises(InputError, match="no result of `freqrail sweep`"):
        freqrail.confirm(confirmed[["solver_error"]])


def test_rk45_on_a_stiff_joint_is_refused_with_the_alternative_that_serves():
    stiff = sweep(over={"primary_joint_stiffness": "5, 10000 MN/m"})
    at = "primary_joint_stiffness=10000 MN/m"
    run = prepare_run(stiff, at, duration="20 s", realisations=2)
    with pytest.raises(InputError, match=r"rk45 would take about .*--max-time.*--integrator exponential"):
        check_cost(run, "1 min")
    assert confirmation.problems(freqrail.confirm(stiff, at, **QUICK)) == []


def test_an_undamped_mode_in_the_band_has_nothing_to_confirm():
    undamped = sweep(settings={"primary_damping": "0 N*s/m", "secondary_damping": "0 N*s/m"})
    with pytest.raises(InputError, match="undamped"):
        prepare_run(undamped, AT[0], **QUICK)


def test_progress_tells_every_simulated_second(result):
    run = prepare_run(result, AT[0], **QUICK)
    told = []
    carry_out(run, progress=told.append)
    assert all(type(step) is int for step in told)
    assert sum(told) == pytest.approx(run.simulated_seconds, abs=2)


def test_times_are_told_in_units_that_suit_them():
    assert [confirm_run._time(s) for s in (1.5, 100, 600, 10_000, 1e6)] == [
        "1.5 s",
        "1e+02 s",
        "10 min",
        "2.8 h",
        "12 days",
    ]


# --- the command, show and plot --------------------------------------------------------------------


def test_the_command_writes_beside_the_result_and_says_what_stands(file, capsys):
    assert command(["confirm", str(file), *FAST]) == 0
    out = capsys.readouterr().out
    assert "confirmed over 0.1 to 20 Hz; 2 Gaussian records of 20 s, seed 0" in out
    assert out.count("  confirmed\n") == 44
    assert "shared by both sides: P0 47040 N, K_H 1.0448e+09 N/m, lags 0, 22.95, 94.72, 117.7 ms" in out
    # 11 series in 2 models at 2 points by five checks, and the track in two ranges
    assert "224 checks: all stand" in out
    target = file.with_name("small-confirmation.nc")
    assert f"plot {target}" in out.splitlines()[-1]
    before = target.read_bytes()
    assert command(["confirm", str(file), *FAST]) == 2
    assert "--overwrite" in lines(capsys)[0]
    assert target.read_bytes() == before


def test_the_command_refuses_the_input_as_output_and_a_bad_time(file, capsys):
    before = file.read_bytes()
    assert command(["confirm", str(file), *FAST, "-o", str(file), "--overwrite"]) == 2
    assert command(["confirm", str(file), "--max-time", "1 s", "-o", str(file.with_name("x.nc"))]) == 2
    assert command(["confirm", str(file), "--jobs", "0"]) == 2
    assert command(["confirm", str(file), *FAST, "-o", str(file.parent / "none" / "x.nc")]) == 4
    assert all(line.startswith("freqrail: error: ") for line in lines(capsys))
    assert file.read_bytes() == before


def test_json_holds_the_numbers(file, capsys, tmp_path):
    assert command(["confirm", str(file), *FAST, "--at", AT[0], "--json", "-o", str(tmp_path / "j.nc")]) == 0
    facts = json.loads(capsys.readouterr().out)
    (rows,) = facts["points"].values()
    assert len(rows) == 22
    assert {row["solver"] for row in rows} == {"confirmed"}
    assert facts["problems"] == []


def test_show_tells_a_confirmation_and_one_of_its_points(confirmed, tmp_path, capsys):
    path = freqrail.write_result(confirmed, tmp_path / "c.nc")
    assert command(["show", str(path)]) == 0
    assert capsys.readouterr().out.count("speed = ") == 2
    assert command(["show", str(path), "--at", "speed=300 km/h"]) == 0
    assert capsys.readouterr().out.count("speed = ") == 1
    assert command(["show", str(path), "--check"]) == 0
    assert command(["show", str(path), "--at", "speed=310 km/h"]) == 2
    assert "names none of the confirmed points" in lines(capsys)[0]


def test_what_does_not_stand_is_told_by_show_too(confirmed):
    wrong = confirmed.copy(deep=True)
    wrong["verdict_statistical"][0, 0, 3] = 1
    facts, told = tables.confirmation_text(wrong)
    assert len(facts["problems"]) == 1
    assert "NOT all stand" in told[-1]


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Function of a confirmation to its figures by name, made but not written."""

    def draw(dataset, at=None):
        found = {}
        monkeypatch.setattr(plot, "save", lambda figure, target, *_: found.setdefault(target.stem, figure))
        freqrail.plot(dataset, tmp_path / "unused", at=at and parse_point(at))
        return found

    return draw


def test_plot_draws_checks_once_and_histories_and_spectra_of_every_point(confirmed, drawn):
    kinds = ("track", "responses", "psd")
    both = {
        "confirmation",
        "solver-error",
        "kernel-difference",
        *(f"{kind}-point-{n}" for kind in kinds for n in (1, 2)),
    }
    assert set(drawn(confirmed)) == both
    assert set(drawn(confirmed, "speed=300 km/h")) == {
        "confirmation",
        "solver-error",
        "kernel-difference",
        *(f"{k}-point-2" for k in kinds),
    }


def test_what_is_drawn_is_what_the_dataset_holds(confirmed, drawn):
    found = drawn(confirmed)
    joint, traditional = found["responses-point-1"].axes[2].get_lines()
    one = confirmed.secondary_stroke_history.isel(point=0, bogie=0)
    shown = joint.get_ydata().size
    np.testing.assert_allclose(joint.get_ydata(), 1e3 * one.sel(model="joint")[:shown], rtol=1e-6)
    np.testing.assert_allclose(traditional.get_ydata(), 1e3 * one.sel(model="traditional")[:shown], rtol=1e-6)
    assert len(found["track-point-1"].axes[0].get_lines()) == 4
    dots = [line for line in found["psd-point-2"].axes[1].get_lines() if line.get_marker() == "o"]
    simulated = confirmed.bogie_acceleration_psd_time_domain.isel(point=1, model=0, bogie=0)
    np.testing.assert_array_equal(dots[0].get_ydata(), simulated[::2])


def test_every_axis_names_its_unit(confirmed, drawn):
    for stem, figure in drawn(confirmed).items():
        for ax in figure.axes:
            if stem not in ("solver-error", "kernel-difference"):
                assert "[" in ax.get_xlabel()
            if not stem.startswith(("confirmation", "solver", "kernel")):
                assert "[" in ax.get_ylabel()


def test_a_number_outside_is_marked(confirmed, drawn):
    wrong = confirmed.copy(deep=True)
    wrong["verdict_statistical"][0, 0, 3] = 1
    wrong["verdict_solver"][1, 1, 5] = 1
    wrong["verdict_kernel"][0, 0, 2] = 1
    wrong["verdict_kernel"][1, 0, 2] = 3  # nothing to compare is not outside
    found = drawn(wrong)
    for stem, place in (("confirmation", 0), ("solver-error", 1), ("kernel-difference", 0)):
        marked = [line for ax in found[stem].axes for line in ax.get_lines() if line.get_marker() == "X"]
        assert sum(line.get_xdata().size for line in marked) == 1
        assert any(line.get_marker() == "X" and line.get_xdata().size for line in found[stem].axes[place].get_lines())


def test_legends_show_what_is_drawn(confirmed, drawn):
    wrong = confirmed.copy(deep=True)
    wrong["verdict_solver"][1, 1, 5] = 1
    found = drawn(wrong)
    for stem, style in (("confirmation", "-"), ("solver-error", "None"), ("kernel-difference", "None")):
        (legend,) = found[stem].legends
        texts = [text.get_text() for text in legend.get_texts()]
        assert ("outside" in texts) == (stem == "solver-error")
        assert [line.get_linestyle() for line in legend.get_lines()[:2]] == [style] * 2
    dots = [line for line in found["psd-point-1"].axes[0].get_lines() if line.get_marker() == "o"]
    assert [line.get_markerfacecolor() for line in dots] == ["none"] * 2


def test_many_points_are_drawn_on_several_pages(confirmed):
    many = xr.concat([confirmed] * 5, "point", data_vars="minimal").assign_coords(point=np.arange(1, 11))
    drawings = confirmations.drawings(many)
    assert [stem for stem in drawings if stem.startswith("confirmation")] == ["confirmation-1", "confirmation-2"]
    assert len(drawings["confirmation-1"]().axes) == 9
    assert len(drawings["confirmation-2"]().axes) == 1
