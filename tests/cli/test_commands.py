"""The commands: exit codes, one line a problem, results on stdout, files untouched by bad input."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.case.case import build_case
from freqrail.cli.commands import run

ROOT = Path(__file__).parents[2]
SMALL = ("--over", "speed=200, 250 km/h", "--over", "primary_joint_stiffness=1, 5 MN/m")


def command(*arguments: str, cwd: Path, **options) -> subprocess.CompletedProcess[str]:
    """The command as a process of its own, as a user runs it."""
    return subprocess.run(
        [sys.executable, "-m", "freqrail", *arguments], cwd=cwd, capture_output=True, text=True, timeout=120, **options
    )


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def result(tmp_path_factory):
    """A small result, made once by the command."""
    folder = tmp_path_factory.mktemp("result")
    done = command("sweep", "yu-damper-joint", *SMALL, "-o", "small.nc", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "small.nc"


def lines(capsys) -> list[str]:
    return capsys.readouterr().err.splitlines()


def test_sweep_writes_the_default_file_and_says_what_where_how_accurate_and_what_next(here):
    done = command("sweep", "yu-damper-joint", *SMALL, cwd=here)
    assert done.returncode == 0
    assert done.stderr == ""
    assert "24 grid points" in done.stdout
    assert "results/yu-damper-joint.nc" in done.stdout
    assert "estimated error" in done.stdout
    assert "plot results/yu-damper-joint.nc" in done.stdout.splitlines()[-1]
    assert freqrail.open_result(here / "results/yu-damper-joint.nc").sizes["speed"] == 2


def test_a_case_file_and_its_shipped_name_are_the_same_study(here):
    for case, out in ((str(ROOT / "cases/yu-damper-joint.toml"), "a.nc"), ("yu-damper-joint", "b.nc")):
        assert run(["sweep", case, *SMALL, "-o", out]) == 0
    a, b = xr.open_dataset("a.nc"), xr.open_dataset("b.nc")
    assert a.attrs["content_digest"] == b.attrs["content_digest"]


def test_the_command_and_the_function_give_the_same_numbers(result):
    over = {"speed": "200, 250 km/h", "primary_joint_stiffness": "1, 5 MN/m"}
    xr.testing.assert_equal(freqrail.sweep("yu-damper-joint", over), freqrail.open_result(result))


def test_json_holds_the_facts_of_the_run(here, capsys):
    assert run(["sweep", "yu-damper-joint", *SMALL, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["points"] == 24
    assert facts["failures"] == []
    assert 0 < facts["largest_relative_error"] < 1e-6


def test_dry_run_writes_nothing_and_tells_size_and_time(here, capsys):
    assert run(["sweep", "yu-damper-joint", "--dry-run", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["points"] == 756
    assert facts["bytes"] > 756 * 11 * 8
    assert facts["seconds"] > 0
    assert run(["sweep", "yu-damper-joint", "--dry-run"]) == 0
    assert ", computing about " in capsys.readouterr().out  # the start of the program is not in it
    assert not any(here.iterdir())


def test_psd_is_stored_at_the_frequencies_asked_for(here):
    over = ("--over", "frequency=log:1:10:5 Hz", "--over", "speed=250 km/h")
    assert run(["sweep", "yu-damper-joint", *over, "--psd", "--responses", "bogie_acceleration", "-o", "p.nc"]) == 0
    data = freqrail.open_result("p.nc")
    assert data.frequency.values[[0, -1]].tolist() == [1.0, 10.0]
    assert "bogie_acceleration_psd" in data
    assert "car_body_acceleration_rms" not in data


def test_points_without_a_result_end_with_3_and_a_file_that_says_so(here, capsys):
    arguments = ["--set", "primary_damping=0 N*s/m", "--set", "band=none", *SMALL[:2]]
    arguments += ["--over", "primary_joint_stiffness=5 MN/m", "--over", "secondary_joint_stiffness=5 MN/m"]
    assert run(["sweep", "yu-damper-joint", *arguments, "-o", "u.nc"]) == 3
    data = freqrail.open_result("u.nc")
    assert np.isnan(data.bogie_acceleration_rms).all()
    told = [line for line in lines(capsys) if line.startswith("freqrail: error: ")]
    assert len(told) == 2  # one a model
    assert all("2 undamped" in line and "the first at" in line for line in told)


def test_every_fault_of_a_case_is_told_at_once_a_line_each(here, capsys):
    text = freqrail.shipped_cases()["yu-damper-joint"]
    faulty = text.replace('"15200 kg"', "15200").replace("bogie_mass =", "bogie_mas =").replace("km/h", "km")
    Path("bad.toml").write_text(faulty)
    assert run(["sweep", "bad.toml"]) == 2
    told = lines(capsys)
    assert len(told) >= 5
    assert all(line.startswith("freqrail: error: bad.toml: [") for line in told)


def test_show_prints_the_eleven_numbers_of_a_point(result, capsys):
    assert run(["show", str(result), "--at", "speed=250 km/h, primary_joint_stiffness=5 MN/m", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert len(shown["numbers"]) == 11
    stored = freqrail.open_result(result)
    point = {"speed": 250, "primary_joint_stiffness": 5, "secondary_joint_stiffness": 5}
    assert shown["numbers"][3]["RMS"] == float(stored.bogie_acceleration_rms.sel(**point, bogie="front"))
    assert shown["numbers"][5]["RMS"] == float(stored.secondary_stroke_rms.sel(**point, bogie="front"))
    assert (shown["numbers"][3]["unit"], shown["numbers"][5]["unit"]) == ("m s-2", "m")
    assert shown["point"] == point
    assert shown["units"] == {"speed": "km/h", "primary_joint_stiffness": "MN/m", "secondary_joint_stiffness": "MN/m"}


def test_json_and_the_table_tell_the_same_numbers_each_in_its_unit(result, capsys):
    """Programs get what the variables hold, people millimetres."""
    assert run(["show", str(result), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["axes"][2] == {"axis": "speed", "values": 2, "first": 200.0, "last": 250.0, "unit": "km/h"}
    stored = freqrail.open_result(result)
    for record in facts["ranges"]:
        assert record["largest"] == float(stored[record["variable"]].max())
        assert record["unit"] == stored[record["variable"]].attrs["units"]
    assert run(["show", str(result)]) == 0
    shown = capsys.readouterr().out
    stroke = next(record for record in facts["ranges"] if record["variable"] == "secondary_stroke_rms")
    (row,) = (line for line in shown.splitlines() if line.startswith("secondary suspension vertical stroke  joints"))
    assert row.split()[-3:-1] == [f"{1e3 * stroke['largest']:.4g}", "mm"]
    assert "200 km/h" in shown


def test_show_off_the_grid_computes_the_point_anew_and_says_so(result, here, capsys):
    assert run(["show", str(result), "--at", "speed=240 km/h"]) == 0
    shown = capsys.readouterr().out
    assert "computed anew: speed = 240 km/h is not on the result's grid" in shown
    assert run(["sweep", "yu-damper-joint", "--over", "speed=240 km/h", *SMALL[2:], "-o", "240.nc"]) == 0
    assert run(["show", "240.nc"]) == run(["show", "240.nc", "--at", "speed=240 km/h"]) == 0
    own = capsys.readouterr().out.splitlines()[-len(shown.splitlines()) + 2 :]
    # but for the last column, the error estimates: quadrature nodes are placed for the whole grid
    assert [line.split()[:-1] for line in shown.splitlines()[4:]] == [line.split()[:-1] for line in own[2:]]
    assert run(["show", str(result), "--at", "speed=250 km/h"]) == 0
    assert "anew" not in capsys.readouterr().out


SOFT = "speed=400 km/h, primary_joint_stiffness=0.001 MN/m"


def warned(capsys) -> list[str]:
    return [line.removeprefix("freqrail: warning: ") for line in lines(capsys) if ": warning: " in line]


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    """A result up to 120 km/h, over wavelengths of which the sweep warns."""
    path = tmp_path_factory.mktemp("slow") / "slow.nc"
    case = freqrail.load_case("yu-damper-joint").text.replace("wavelengths = [", "track_height = [0.01, 10.0] #")
    path.with_suffix(".toml").write_text(case)
    over = ["--over", "speed=40:120:20 km/h", "--over", "primary_joint_stiffness=0.5, 5 MN/m"]
    assert run(["sweep", str(path.with_suffix(".toml")), *over, "-o", str(path)]) == 0
    return path


def test_a_point_computed_anew_has_its_own_warnings_and_not_the_grids(slow, here, capsys):
    assert run(["show", str(slow)]) == 0
    (of_the_grid,) = warned(capsys)
    assert "wavelengths in the band 0.111 to 333 m" in of_the_grid
    assert "sweep (anew) with --set" in of_the_grid
    point = [f"--over={name}={value}" for name, value in (part.split("=") for part in SOFT.split(", "))]
    case = str(slow.with_suffix(".toml"))
    assert run(["sweep", case, *point, "--over", "secondary_joint_stiffness=5 MN/m", "-o", "own.nc"]) == 0
    own = [line.replace("--over", "--at").replace("slow: ", "") for line in warned(capsys)]
    assert any(line.startswith("--at primary_joint_stiffness: 1000 N/m is 1.1e-03 of") for line in own)
    assert any("over the static wheel load" in line for line in own)
    assert run(["show", str(slow), "--at", SOFT]) == 0
    told = capsys.readouterr()
    assert [line.removeprefix("freqrail: warning: ") for line in told.err.splitlines()] == own
    outside = "outside the swept range: primary_joint_stiffness (swept: 0.5 MN/m to 5 MN/m), speed (swept: 40 km/h to"
    assert outside in told.out
    assert run(["plot", str(slow), "--at", SOFT, "-o", "figures"]) == 0
    told = warned(capsys)
    assert {of_the_grid, *own} == {*told}
    assert len(told) == len({*told})


def test_between_the_ends_of_the_grid_nothing_is_outside_and_on_it_the_warnings_are_the_grids(slow, capsys):
    assert run(["show", str(slow), "--at", "speed=50 km/h"]) == 0
    told = capsys.readouterr()
    assert "speed = 50 km/h is not on the result's grid\n" in told.out
    assert run(["show", str(slow), "--at", "speed=60 km/h"]) == 0
    assert "wavelengths in the band 0.111 to 333 m" in capsys.readouterr().err


def test_so_it_is_in_a_confirmation_which_keeps_and_repeats_them(slow, here, capsys):
    quick = ["--integrator", "exponential", "--duration", "20 s", "--realisations", "2", "--band", "0.5:20 Hz"]
    assert run(["confirm", str(slow), "--at", "speed=400 km/h", *quick, "-o", "c.nc"]) == 3
    told = [line for line in warned(capsys) if "smallest fault" not in line and "would have seen" not in line]
    assert not any("333 m" in line for line in told)
    assert any("computed anew: speed = 400 km/h is not on the result's grid; outside the" in line for line in told)
    assert any("speed = 400 km/h: wavelengths in the band 1.11 to 1.11e+03 m" in line for line in told)
    assert run(["show", "c.nc"]) == 0
    assert {*told} == {*warned(capsys)}


def test_show_check_tells_a_whole_file_from_a_damaged_one(result, here, capsys):
    assert run(["show", str(result), "--check"]) == 0
    damaged = bytearray(result.read_bytes())
    place = bytes(damaged).find(b"paper")  # inside the stored case text
    damaged[place] ^= 1
    Path("damaged.nc").write_bytes(damaged)
    assert run(["show", "damaged.nc", "--check"]) == 2


def test_show_of_a_case_derives_load_and_contact_stiffness(capsys):
    assert run(["show", "yu-damper-joint", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    derived = {row["derived"]: row["value"] for row in shown["derived"]}
    assert derived["static wheel load P0"] == pytest.approx((15200 / 4 + 300 + 700) * 9.8)
    assert derived["contact stiffness K_H (eq. 1)"] == pytest.approx(1.0448e9, rel=1e-4)
    assert derived["longest wavelength at 250 km/h"] == pytest.approx(250 / 3.6 / 0.1)


def test_cases_prints_a_file_that_can_be_swept(here, capsys):
    assert run(["cases", "yu-damper-joint"]) == 0
    Path("mine.toml").write_text(capsys.readouterr().out)
    assert run(["sweep", "mine.toml", *SMALL]) == 0
    assert Path("results/mine.nc").is_file()


def test_plot_draws_files_and_names_the_command_for_spectra(result, here, capsys):
    assert run(["plot", str(result), "-o", "figures"]) == 0
    told = capsys.readouterr()
    paths = told.out.splitlines()
    assert paths
    assert all(Path(p).stat().st_size > 10_000 for p in paths)
    assert "--psd" in told.err


def test_help_imports_neither_xarray_nor_matplotlib_nor_scipy():
    code = (
        "import sys; from freqrail.cli.commands import run; run(['--help']); "
        "print([m for m in ('xarray', 'matplotlib', 'scipy', 'pint', 'pydantic') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.splitlines()[-1] == "[]"


def test_version():
    done = command("--version", cwd=ROOT)
    assert done.stdout == f"freqrail {freqrail.__version__}\n"


def test_modes_and_show_take_any_scalar_also_of_a_swept_quantity(capsys):
    def softest(*arguments: str) -> float:
        assert run(["modes", "yu-damper-joint", "--json", *arguments]) == 0
        modes = json.loads(capsys.readouterr().out)["modes"]
        return min(mode["damping"] for mode in modes if mode["damping"])

    assert softest("--set", "primary_joint_stiffness=0.5 MN/m") < 0.1 * softest()
    assert run(["show", "yu-damper-joint", "--set", "speed=100 km/h"]) == 0
    assert "100 km/h" in capsys.readouterr().out


def test_a_point_without_a_result_says_why(here, capsys):
    over = ["--over", "speed=250 km/h", "--over", "primary_damping=0, 17 kN*s/m", *SMALL[2:]]
    assert run(["sweep", "yu-damper-joint", *over, "-o", "u.nc"]) == 3
    assert run(["show", "u.nc", "--at", "primary_damping=0 kN*s/m"]) == 0
    told = capsys.readouterr().out
    assert "model with damper joints: no result for primary_stroke, status undamped" in told
    assert len([line for line in told.splitlines() if "nan" in line]) == 4  # the axles
    still = ["--set", "primary_damping=0 N*s/m", "--set", "secondary_damping=0 N*s/m"]
    assert run(["sweep", "yu-damper-joint", *SMALL, *still, "-o", "v.nc"]) == 3
    assert run(["show", "v.nc", "--at", "speed=250 km/h"]) == 0
    assert "model with damper joints: no result, status undamped" in capsys.readouterr().out


def test_a_band_that_takes_in_the_rigid_rail_resonance_is_warned_of(here, capsys):
    for setting in ("band=none", "frequency=0.1:250 Hz"):
        assert run(["sweep", "yu-damper-joint", *SMALL, "--set", setting, "-o", f"{setting[:4]}.nc"]) == 0
        assert any("195 Hz with a damping ratio of 5.8e-06" in line for line in lines(capsys))
    assert run(["sweep", "yu-damper-joint", *SMALL, "-o", "default.nc"]) == 0
    assert lines(capsys) == []


def test_numbers_beyond_all_measure_are_failed_points_and_no_traceback(here):
    extreme = (["--set", "half_bogie_spacing=1e7 m"], ["--over", "speed=0.001 km/h"])
    for k, change in enumerate(extreme):
        rest = [] if "--over" in change else ["--over", "speed=250 km/h"]
        done = command("sweep", "yu-damper-joint", *change, *rest, *SMALL[2:], "-o", f"{k}.nc", cwd=here)
        assert done.returncode == 3, done.stderr
        assert "Traceback" not in done.stderr


def test_json_of_a_point_says_where_and_why(here, capsys):
    """null, not text, where there is no number; the status in a word."""
    over = {"primary_damping": "0, 17 kN*s/m", "speed": "250 km/h"}
    over |= dict.fromkeys(("primary_joint_stiffness", "secondary_joint_stiffness"), "5 MN/m")
    options = [part for name, axis in over.items() for part in ("--over", f"{name}={axis}")]
    assert run(["sweep", "yu-damper-joint", *options, "-o", "u.nc"]) == 3
    capsys.readouterr()
    assert run(["show", "u.nc", "--at", "primary_damping=0 kN*s/m", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["point"]["primary_damping"] == 0
    assert facts["units"]["primary_damping"] == "kN*s/m"
    assert (facts["status"], facts["traditional_status"]) == ("undamped", "undamped")
    lacking = {record["variable"] for record in facts["numbers"] if record["RMS"] is None}
    assert lacking == {"primary_stroke_rms"}
    assert all(record["RMS"] for record in facts["numbers"] if record["variable"] not in lacking)
    assert run(["show", "u.nc", "--at", "primary_damping=17 kN*s/m"]) == 0
    assert "no result" not in capsys.readouterr().out


def test_the_point_that_show_suggests_can_be_shown(here, capsys):
    over = ["--over", "speed=100, 300 km/h", "--over", "primary_joint_stiffness=0.5, inf MN/m"]
    assert run(["sweep", "yu-damper-joint", *over, "-o", "two grids.nc"]) == 0
    capsys.readouterr()
    assert run(["show", "two grids.nc"]) == 0
    (hint,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("one grid point: "))
    words = shlex.split(hint)
    assert run(words[words.index("show") :]) == 0
    assert "speed = 300 km/h" in capsys.readouterr().out


def test_a_shipped_case_as_json(capsys):
    assert run(["cases", "yu-damper-joint", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["name"] == "yu-damper-joint"
    assert build_case(facts["text"]).title


def test_functions_take_cases_and_files_as_the_commands_do(here):
    case = freqrail.load_case("yu-damper-joint")
    assert freqrail.modes("yu-damper-joint") == freqrail.modes(case) == freqrail.modes(case.vehicle)
    result = freqrail.write_result(freqrail.sweep("yu-damper-joint", {"speed": "200, 250 km/h"}), "r.nc")
    assert len(freqrail.plot(result, "figures")) == len(freqrail.plot(freqrail.open_result(result), "figures")) > 1
    for jobs in (0, 1.5, True):
        with pytest.raises(freqrail.FreqrailError, match="jobs: must be a whole number"):
            freqrail.sweep("yu-damper-joint", jobs=jobs)
    with pytest.raises(freqrail.FreqrailError, match="a case file's path or a shipped case's name is expected"):
        freqrail.load_case(5)
