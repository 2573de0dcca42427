"""A sweep of samples, from the table to files, figures and confirmations: each sample is the vehicle of its row."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.case.case import load_case
from freqrail.cli import commands
from freqrail.confirm.run import prepare_run
from freqrail.errors import InputError
from freqrail.figures.sweeps import drawings
from freqrail.model.variants import TRADITIONAL, Variant
from freqrail.result import content
from freqrail.result.axes import sampled, swept_by
from freqrail.result.check import faults
from freqrail.result.points import find_place, parse_point, read_result, result_case
from freqrail.sweep import concern, journal, off_grid, parts, plausibility, sweep
from freqrail.sweep.plan import Plan

SAMPLES = {
    "name": ["soft", "rigid", "middle", "hard"],
    "primary_joint_stiffness [MN/m]": [0.5, math.inf, 5.25, 40.0],
    "bogie_mass": ["600 kg", "0.7 t", "650 kg", "620 kg"],
}
OVER = {"speed": "150, 250 km/h", "secondary_joint_stiffness": "5 MN/m"}
RIGID = Variant("rigid", "rigid joints", {"primary_joint_stiffness": math.inf})
FIXED = Variant("fixed", "one vehicle", {"primary_joint_stiffness": 5e6, "bogie_mass": 600.0})


@pytest.fixture(scope="module")
def result():
    return freqrail.sweep("yu-damper-joint", OVER, samples=SAMPLES, psd=True)


@pytest.fixture(scope="module")
def path(result, tmp_path_factory):
    return freqrail.write_result(result, tmp_path_factory.mktemp("samples") / "samples.nc")


def alone(number: int, speed: str = "250 km/h") -> xr.Dataset:
    """The sweep of one sample as a case of its own."""
    stiffness = ["0.5 MN/m", "inf", "5.25 MN/m", "40 MN/m"][number - 1]
    mass = SAMPLES["bogie_mass"][number - 1]
    over = {"primary_joint_stiffness": stiffness, "secondary_joint_stiffness": "5 MN/m", "speed": speed}
    return freqrail.sweep("yu-damper-joint", over, {"bogie_mass": mass})


# --- what a result holds -----------------------------------------------------------------------------


@pytest.mark.parametrize("number", [1, 2, 3, 4])
@pytest.mark.parametrize("name", ["car_body_acceleration_rms", "traditional_primary_stroke_rms"])
def test_a_sample_is_the_vehicle_of_its_row(result, number, name):
    own = result[name].sel(sample=number, speed=250).values
    np.testing.assert_allclose(own.ravel(), alone(number)[name].values.ravel(), rtol=1e-8)


def test_dimensions_and_coordinates(result):
    assert result["status"].dims == ("sample", "secondary_joint_stiffness", "speed")
    assert result["traditional_status"].dims == ("sample", "speed")  # bogie_mass is sampled too
    assert result["sample"].values.tolist() == [1, 2, 3, 4]
    assert result["sample_name"].values.tolist() == SAMPLES["name"]
    assert result["primary_joint_stiffness"].dims == ("sample",)
    assert (result["bogie_mass"].values.tolist(), result["bogie_mass"].units) == ([600, 700, 650, 620], "kg")
    assert result["primary_joint_compliance"].values.tolist() == [2.0, 0.0, 1 / 5.25, 0.025]
    assert sampled(result) == ("bogie_mass", "primary_joint_stiffness")


def test_a_variant_that_fixes_all_that_is_sampled_has_no_samples():
    case = replace(load_case("yu-damper-joint", over=OVER, samples=SAMPLES), variants=(RIGID, FIXED))
    found = freqrail.sweep(case)
    assert found["rigid_status"].dims == ("sample", "secondary_joint_stiffness", "speed")
    assert found["fixed_status"].dims == ("secondary_joint_stiffness", "speed")
    assert faults(found) == []
    assert swept_by(found, FIXED) == found["fixed_status"].dims
    only = freqrail.sweep("yu-damper-joint", OVER, samples={"primary_joint_stiffness": "1, 5 MN/m"})
    assert only["traditional_status"].dims == ("speed",)
    assert faults(only) == []
    assert swept_by(only, TRADITIONAL) == ("speed",)


def test_the_file_stands_alone_and_is_whole(result, path):
    read = read_result(path)
    assert read.attrs["content_digest"] == content.content_digest(result)
    case = result_case(read)
    assert case.samples.names == tuple(SAMPLES["name"])
    assert np.array_equal(case.vehicles().bogie_mass.ravel(), [600, 700, 650, 620])


@pytest.mark.parametrize("points", [1, 3, 10**6])
def test_a_file_in_parts_has_the_same_bits(result, tmp_path, monkeypatch, points):
    monkeypatch.setattr(parts, "POINTS", points)
    case = load_case("yu-damper-joint", over=OVER, samples=SAMPLES)
    sweep.sweep_to_file(Plan.of(case, psd=True), tmp_path / "parts.nc")
    assert freqrail.open_result(tmp_path / "parts.nc").attrs["content_digest"] == content.content_digest(result)


def test_a_journal_goes_on_without_the_table_and_refuses_another(result, tmp_path, monkeypatch):
    monkeypatch.setattr(parts, "POINTS", 1)
    plan = Plan.of(load_case("yu-damper-joint", over=OVER, samples=SAMPLES), psd=True)

    def stops(plan, todo, progress):
        yield from list(sweep.local()(plan, todo, progress))[:3]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep.sweep_to_file(plan, tmp_path / "o.nc", executor=stops)
    assert journal.journal_path(tmp_path / "o.nc").exists()
    other = Plan.of(
        load_case("yu-damper-joint", over=OVER, samples={**SAMPLES, "bogie_mass": "601, 700, 650, 620 kg"}), psd=True
    )
    with pytest.raises(InputError, match="another case"):
        sweep.sweep_to_file(other, tmp_path / "o.nc", resume=True)
    done = sweep.sweep_to_file(plan, tmp_path / "o.nc", resume=True)
    assert done.resumed == 3
    assert freqrail.open_result(done.path).attrs["content_digest"] == content.content_digest(result)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.drop_vars("bogie_mass"), "traditional_status has other dimensions"),  # all that is left is rigid
        (lambda d: d.drop_vars("sample_name"), "has no coordinate sample_name along sample"),
        (lambda d: d.assign_coords(sample=[1, 2, 3, 9]), "has a sample 9, which its case has not"),
        (lambda d: d.assign_coords(sample=[1, 2, 3, 3]), "sample holds other values than the numbers"),
        (lambda d: d.assign_coords(bogie_mass=d.bogie_mass + 1), "bogie_mass is not that of its case"),
        (lambda d: d.assign_coords(sample_name=("sample", ["a", "b", "c", "d"])), "sample_name is not that"),
        (lambda d: d.assign_coords(bogie_mass=d.bogie_mass.assign_attrs(units="t")), "bogie_mass has no unit kg"),
        (lambda d: d.assign_coords(primary_joint_compliance=2 * d.primary_joint_compliance), "compliance is not that"),
    ],
    ids=["dropped", "nameless", "number", "twice", "value", "name", "unit", "compliance"],
)  # fmt: skip
def test_a_file_whose_samples_are_not_those_of_its_case_is_refused(result, tmp_path, change, words):
    path = freqrail.write_result(change(result), tmp_path / "bad.nc")
    with pytest.raises(InputError) as fault:
        read_result(path)
    assert any(words in line for line in fault.value.problems), fault.value.problems


def test_a_part_of_the_samples_is_a_result(result, tmp_path):
    part = read_result(freqrail.write_result(result.isel(sample=[3, 0]), tmp_path / "part.nc"))
    found = find_place(part, parse_point("sample=hard, speed=250 km/h"))
    assert found.index["sample"] == 0
    anew = off_grid.find(part, parse_point("sample=4, speed=222 km/h"))
    own = alone(4, "222 km/h")["bogie_acceleration_rms"].values
    np.testing.assert_allclose(anew.dataset["bogie_acceleration_rms"].values.ravel(), own.ravel(), rtol=1e-8)


# --- points ------------------------------------------------------------------------------------------


def test_a_sample_is_found_by_number_or_name_and_the_first_is_taken_for_none(result):
    for text, index in (("sample=3", 2), ("sample=middle", 2), ("speed=150 km/h", 0)):
        assert find_place(result, parse_point(text)).index["sample"] == index
    for text in ("sample=5", "sample=0", "sample=sof", "sample="):
        with pytest.raises(InputError, match="there is no such sample"):
            find_place(result, parse_point(text))
    with pytest.raises(InputError, match="bogie_mass: varies with the samples"):
        find_place(result, parse_point("bogie_mass=600 kg"))


def test_a_point_off_the_grid_is_computed_anew_for_its_sample(result):
    found = off_grid.find(result, parse_point("sample=middle, speed=222 km/h"))
    assert found.dataset["sample"].values.tolist() == [3]
    assert found.label("sample") == "sample = 3 (middle)"
    own = alone(3, "222 km/h")["bogie_acceleration_rms"].values
    np.testing.assert_allclose(found.dataset["bogie_acceleration_rms"].values.ravel(), own.ravel(), rtol=1e-8)


# --- figures -----------------------------------------------------------------------------------------


def test_samples_alone_are_drawn_as_marks_against_their_numbers():
    found = freqrail.sweep("yu-damper-joint", {**OVER, "speed": "200 km/h"}, samples=SAMPLES)
    assert list(drawings(found)) == ["rms-against-sample"]
    drawing = drawings(found)["rms-against-sample"]
    figure = drawing.draw(found, result_case(found), {"speed": 0, "secondary_joint_stiffness": 0}, *drawing.rest)
    line, rigid = figure.axes[0].lines
    assert line.get_xdata().tolist() == [1, 2, 3, 4]
    assert (line.get_linestyle(), rigid.get_linestyle()) == ("None", "None")
    assert line.get_marker() != rigid.get_marker()
    np.testing.assert_array_equal(
        line.get_ydata(), found["car_body_acceleration_rms"].isel(car_position=0).values.ravel()
    )


def test_beside_an_axis_samples_are_a_family_of_curves(result):
    assert list(drawings(result)) == ["rms-against-speed-sample", "psd"]
    drawing = drawings(result)["rms-against-speed-sample"]
    figure = drawing.draw(result, result_case(result), {"secondary_joint_stiffness": 0}, *drawing.rest)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"1 (soft)", "2 (rigid)", "3 (middle)", "4 (hard)"} <= {*words}


def test_of_many_samples_a_few_are_drawn_and_it_is_said():
    many = {"bogie_mass [kg]": np.linspace(550, 650, 30)}
    found = freqrail.sweep("yu-damper-joint", {"primary_joint_stiffness": "5 MN/m", **OVER}, samples=many)
    drawing = drawings(found)["rms-against-speed-sample"]
    index = {"secondary_joint_stiffness": 0, "primary_joint_stiffness": 0}
    figure = drawing.draw(found, result_case(found), index, *drawing.rest)
    assert figure.legends[0].get_title().get_text() == "sample (8 of 30 values)"


def test_a_held_sample_is_told_with_its_values(result):
    drawing = drawings(result)["psd"]
    figure = drawing.draw(result, result_case(result), {"sample": 2, "secondary_joint_stiffness": 0, "speed": 1})
    head = figure.get_suptitle().replace("\N{NO-BREAK SPACE}", " ")
    assert "sample = 3 (middle)" in head
    assert "5.25 MN/m" in head
    assert "650 kg" in head


# --- warnings and confirmations ----------------------------------------------------------------------


def test_a_sample_in_the_middle_is_warned_of_though_the_ends_are_usual():
    case = load_case("yu-damper-joint", over=OVER, samples={"bogie_mass [kg]": [600, 6e6, 620]})
    told = {concern.name: concern.text for concern in plausibility.concerns(case)}
    assert "at sample=2" in told["bogie_frame"]


def test_of_many_samples_the_wheel_force_is_computed_at_few():
    samples = {"bogie_mass [kg]": np.linspace(500, 700, 200), "wheelset_mass [kg]": np.linspace(700, 600, 200)}
    case = load_case("yu-damper-joint", over=OVER, samples=samples)
    few = concern.few_samples(concern.corners(case))
    assert few.samples.numbers.tolist() == [1, 200]
    shape = (7, 2, 2, 2, 2, 2)
    corners = concern.some_corners(shape)
    assert len(corners) == concern.FORCES
    for axis, size in enumerate(shape):
        assert {corner[axis] for corner in corners} == {*range(size)}


@pytest.mark.filterwarnings("ignore")
def test_a_confirmation_of_a_sample_is_keyed_by_its_values(result):
    at = ["sample=middle, speed=250 km/h", "sample=1, speed=250 km/h"]
    run = prepare_run(result, at, duration="20 s")
    assert [point.vehicle.bogie_mass for point in run.points] == [650.0, 600.0]
    assert "bogie_mass=650" in run.points[0].key
    assert "sample" not in run.points[0].key
    turned = prepare_run(result.isel(sample=[3, 2]), at[:1], duration="20 s")
    assert turned.points[0].key == run.points[0].key
    assert turned.points[0].vehicle == run.points[0].vehicle


@pytest.mark.filterwarnings("ignore")
def test_a_confirmation_says_which_sample_a_point_is_of(result, tmp_path):
    found = freqrail.confirm(
        result,
        "sample=middle, speed=250 km/h",
        realisations=1,
        duration="20 s",
        band="1:15 Hz",
        integrator="exponential",
    )
    assert (found["sample"].dims, found["sample"].values.tolist()) == (("point",), [3])
    assert found["sample_name"].values.tolist() == ["middle"]
    assert found["bogie_mass"].values.tolist() == [650.0]
    assert (found["result_difference"] < 1e-9).all()
    path = freqrail.write_result(found, tmp_path / "c.nc")
    assert commands.run(["show", str(path), "--at", "sample=3"]) == 0


# --- the command line --------------------------------------------------------------------------------


def test_the_command_reads_a_file_and_its_result_needs_it_no_more(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "designs.csv").write_text("name,bogie_mass [kg],primary_joint_stiffness [MN/m]\na,600,5\nb,650,inf\n")
    arguments = ["sweep", "yu-damper-joint", "--samples", "designs.csv", "--over", "speed=200, 250 km/h", "-o", "o.nc"]
    assert commands.run(arguments) == 0
    (tmp_path / "designs.csv").unlink()
    assert commands.run(["show", "o.nc"]) == 0
    assert "sampled" in capsys.readouterr().out
    assert commands.run(["show", "o.nc", "--at", "sample=b, speed=210 km/h", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["sampled"] == {"bogie_mass": 650.0, "primary_joint_stiffness": "inf"}
    assert facts["point"]["sample"] == 2
    assert commands.run(["show", "o.nc", "--check"]) == 0
    assert commands.run(["plot", "o.nc", "-o", "figures"]) == 0
    assert commands.run(arguments) == 2
    assert "designs.csv: no such file" in capsys.readouterr().err
