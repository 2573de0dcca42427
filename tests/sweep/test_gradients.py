"""Slopes stored with a sweep: differences of sweeps, whatever the cut; what is asked for wrongly is refused."""

from __future__ import annotations

import numpy as np
import pytest

import freqrail
from freqrail.case.case import load_case
from freqrail.cli.commands import run
from freqrail.errors import InputError
from freqrail.sweep import parts, sweep
from freqrail.sweep.plan import Plan, planned_layout

OVER = {"primary_joint_stiffness": "1, 5, inf MN/m", "speed": "150, 250 km/h", "secondary_joint_stiffness": "5 MN/m"}
WANTED = ("bogie_mass", "primary_damping", "half_wheelbase", "speed", "contact_constant", "primary_joint_stiffness")


@pytest.fixture(scope="module")
def result():
    return freqrail.sweep("yu-damper-joint", over=OVER, gradients=WANTED)


@pytest.mark.filterwarnings("ignore::freqrail.errors.FreqrailWarning")
@pytest.mark.parametrize("name", WANTED[:5])
@pytest.mark.parametrize("masses", ["half", "whole"])
def test_slopes_are_differences_of_sweeps(name, masses, result):
    """Of fourth order; of whole vehicles by what the case gives: a slope by both sides' mass is half of one side's."""
    settings = {} if masses == "half" else {"masses": "whole"}
    result = result if masses == "half" else freqrail.sweep("yu-damper-joint", OVER, settings, gradients=WANTED)
    case = load_case("yu-damper-joint", settings)
    value, unit = case.quantities[name].value, case.parameter(name).unit
    step = 3e-4
    near = {}
    for k in (-2, -1, 1, 2):
        changed = f"{value * (1 + k * step)!r} {unit}"
        if name == "speed":
            over = OVER | {"speed": ", ".join(repr(v * (1 + k * step)) for v in (150, 250)) + " km/h"}
            near[k] = freqrail.sweep("yu-damper-joint", over, settings)
        else:
            near[k] = freqrail.sweep("yu-damper-joint", OVER, settings | {name: changed})
    for prefix in ("", "traditional_"):
        for response in ("car_body_acceleration", "primary_stroke"):
            at = {k: one[f"{prefix}{response}_rms"].values for k, one in near.items()}
            size = np.array([150, 250])[:, None] / 3.6 if name == "speed" else value
            expected = (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12 * step) / size
            found = result[f"{prefix}{response}_rms_gradient"].sel(parameter=name)
            scale = result[f"{prefix}{response}_rms"] / size
            np.testing.assert_array_less(np.abs(found.values - expected), 2e-6 * np.abs(scale.values))


def test_a_rigid_joint_has_no_slope_and_a_variant_none_by_what_it_fixes(result):
    own = result.primary_stroke_rms_gradient.sel(parameter="primary_joint_stiffness")
    assert (own.sel(primary_joint_stiffness=np.inf) == 0).all()
    assert (own.sel(primary_joint_stiffness=1) != 0).all()
    assert (result.traditional_primary_stroke_rms_gradient.sel(parameter="primary_joint_stiffness") == 0).all()


def test_slopes_have_units_and_errors(result):
    units = dict(zip(result["parameter"].values.tolist(), result["parameter_unit"].values.tolist(), strict=True))
    assert units["bogie_mass"] == "kg"
    assert units["primary_damping"] == "N s m-1"
    assert result.bogie_acceleration_rms_gradient.dims[-2:] == ("bogie", "parameter")
    case = load_case("yu-damper-joint")
    for name in WANTED[:5]:
        error = result.bogie_acceleration_rms_gradient_error.sel(parameter=name) * case.quantities[name].value
        assert (error < 1e-6 * result.bogie_acceleration_rms).all()  # per cent for per cent


def test_the_cut_changes_no_bit_and_a_file_holds_them(result, tmp_path, monkeypatch):
    monkeypatch.setattr(parts, "POINTS", 1)
    case = load_case("yu-damper-joint", over=OVER)
    plan = Plan.for_layout(planned_layout(case, "paper", False, WANTED))
    assert len(parts.cut(plan)) > 3
    sweep.sweep_to_file(plan, tmp_path / "g.nc")
    read = freqrail.open_result(tmp_path / "g.nc")
    for name, array in result.data_vars.items():
        np.testing.assert_array_equal(read[name].values, array.values, err_msg=str(name))


def test_the_command_stores_them_and_refuses_what_it_does_not_know(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = ["sweep", "yu-damper-joint", "--over", "speed=250 km/h", "-o", "g.nc", "--over"]
    joints = "primary_joint_stiffness=5 MN/m"
    more = ["--over", "secondary_joint_stiffness=5 MN/m", "--gradients"]
    assert run([*arguments, joints, *more, "all"]) == 0
    assert freqrail.open_result("g.nc").sizes["parameter"] == 15
    assert run(["show", "g.nc", "--check"]) == 0
    assert run(["show", "g.nc", "--at", "speed=222 km/h"]) == 0
    capsys.readouterr()
    assert run([*arguments, joints, "--overwrite", *more, "bogie_mas"]) == 2
    assert "--gradients: unknown parameter 'bogie_mas' (did you mean bogie_mass?)" in capsys.readouterr().err
    with pytest.raises(InputError, match="is empty"):
        freqrail.sweep("yu-damper-joint", gradients=",")
