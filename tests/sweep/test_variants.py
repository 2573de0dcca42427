"""A case with variants of its own, from sweep to figures: each is the vehicle that it says, without its axes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.case.case import load_case
from freqrail.cli import tables
from freqrail.errors import FreqrailWarning, InputError
from freqrail.figures.plot import plot
from freqrail.model.variants import BASE, DEFAULT, Variant
from freqrail.result import content
from freqrail.result.check import faults
from freqrail.result.points import parse_point, read_result, result_case
from freqrail.result.variants import models_of, owner, stored
from freqrail.sweep import off_grid, parts, plausibility, sweep
from freqrail.sweep.plan import Plan

STIFF = Variant("stiff", "stiff joints", {"primary_joint_stiffness": 40e6, "secondary_joint_stiffness": math.inf})
HEAVY = Variant("stiff_heavy", "heavy bogies", {"bogie_mass": 800.0})  # its prefix begins with the other's
OVER = {"speed": "150, 250 km/h", "primary_joint_stiffness": "1, 5, 40 MN/m", "bogie_mass": "500, 600, 800 kg"}


@pytest.fixture(scope="module")
def case():
    return replace(
        load_case("yu-damper-joint", over=OVER | {"secondary_joint_stiffness": "5, inf MN/m"}), variants=(STIFF, HEAVY)
    )


@pytest.fixture(scope="module")
def result(case):
    return freqrail.sweep(case, responses="all", psd=True)


@pytest.fixture(scope="module")
def path(result, tmp_path_factory):
    return freqrail.write_result(result, tmp_path_factory.mktemp("variants") / "variants.nc")


def test_a_variant_lacks_the_axes_of_what_it_fixes(result):
    assert {*result["status"].dims} == {*OVER, "secondary_joint_stiffness"}
    assert {*result["stiff_status"].dims} == {"speed", "bogie_mass"}
    assert {*result["stiff_heavy_status"].dims} == {"speed", "primary_joint_stiffness", "secondary_joint_stiffness"}
    assert not [name for name in result if str(name).startswith("traditional")]


def test_a_variant_is_the_vehicle_with_what_it_fixes(result):
    for name in ("bogie_acceleration_rms", "primary_stroke_rms", "wheelset_acceleration_psd"):
        own = result[name].sel(primary_joint_stiffness=40, secondary_joint_stiffness=np.inf)
        np.testing.assert_allclose(own.values, result[f"stiff_{name}"].transpose(*own.dims).values, rtol=1e-9)
        own = result[name].sel(bogie_mass=800)
        np.testing.assert_allclose(own.values, result[f"stiff_heavy_{name}"].transpose(*own.dims).values, rtol=1e-9)


def test_the_file_says_which_variants_it_has_and_is_whole(result, path, case):
    read = read_result(path)
    assert faults(read) == []
    assert read.attrs["content_digest"] == content.content_digest(result)
    assert models_of(read) == (BASE, STIFF, HEAVY)
    assert result_case(read).variants == case.variants


def test_coordinates_of_what_a_variant_fixes_are_none_of_its_own(path):
    with xr.open_dataset(path, decode_coords=False) as raw:
        named = {
            name: raw[name].attrs["coordinates"].split() for name in ("status", "stiff_status", "stiff_heavy_status")
        }
    assert "primary_joint_compliance" in named["status"]
    assert not {"primary_joint_compliance", "secondary_joint_compliance"} & {*named["stiff_status"]}
    assert "primary_joint_compliance" in named["stiff_heavy_status"]


def test_a_file_in_parts_has_the_same_bits(case, result, tmp_path, monkeypatch):
    monkeypatch.setattr(parts, "POINTS", 5)
    sweep.sweep_to_file(Plan.of(case, "all", psd=True), tmp_path / "parts.nc")
    assert freqrail.open_result(tmp_path / "parts.nc").attrs["content_digest"] == content.content_digest(result)


def test_a_journal_of_other_variants_is_of_another_sweep(case):
    softer = replace(STIFF, values={**STIFF.values, "primary_joint_stiffness": 39e6})
    plans = [Plan.of(replace(case, variants=variants)) for variants in ((STIFF, HEAVY), (softer, HEAVY))]
    assert parts.cut(plans[0]) == parts.cut(plans[1])
    assert len({sweep._identity(plan, parts.cut(plan)) for plan in plans}) == 2


def test_a_number_that_a_variant_fixes_is_no_coordinate_of_its_variables(tmp_path):
    light = Variant("light", "light wheelsets", {"wheelset_mass": 600.0})
    found = freqrail.sweep(replace(load_case("yu-damper-joint", over={"speed": "200 km/h"}), variants=(light,)))
    with xr.open_dataset(freqrail.write_result(found, tmp_path / "o.nc"), decode_coords=False) as raw:
        named = [raw[f"{prefix}bogie_acceleration_rms"].attrs["coordinates"].split() for prefix in ("", "light_")]
    assert {*named[0]} - {*named[1]} == {"wheelset_mass"}


def without_attribute(dataset, name):
    changed = dataset.copy()
    del changed.attrs[name]
    return changed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.drop_vars("stiff_heavy_status"), "has no variable stiff_heavy_status"),
        (lambda d: d.drop_vars("stiff_primary_stroke_rms"), "has no variable stiff_primary_stroke_rms"),
        (lambda d: d.assign(stiff_status=d["stiff_heavy_status"]), "stiff_status has other dimensions"),
        (lambda d: d.assign_attrs(variants="[{}]"), "its attribute variants is no list of variants"),
        (lambda d: d.assign_attrs(variants='[{"name": "a b", "words": "", "values": {}}]'), "no list of variants"),
        (lambda d: d.assign_attrs(variants='[{"name": "a", "words": "", "values": {"m": 1}}]'), "no list of variants"),
        (lambda d: without_attribute(d, "variants"), "has no variable traditional_status"),
    ],
    ids=["status", "response", "dimensions", "empty", "name", "parameter", "none"],
)  # fmt: skip
def test_what_is_missing_of_a_variant_is_told(result, change, words):
    assert any(words in fault for fault in faults(change(result))), faults(change(result))


def test_variables_are_told_apart_though_one_name_begins_with_another():
    models = (BASE, STIFF, HEAVY)
    names = ("bogie_acceleration_rms", "status", "primary_stroke_rms_relative_error", "wheelset_acceleration_psd")
    for model in models:
        assert [owner(model.prefix + name, models) for name in names] == [model] * len(names)


def test_variants_are_shown_plotted_and_computed_anew_off_the_grid(result, tmp_path):
    facts, lines = tables.result_point(result, parse_point("speed=250 km/h, bogie_mass=600 kg"))
    assert {"RMS", "stiff_RMS", "stiff_heavy_RMS", "difference_percent_from_stiff"} <= facts["numbers"][0].keys()
    assert "stiff heavy RMS" in "\n".join(lines)
    strokes = [row for row in facts["numbers"] if row["variable"] == "primary_stroke_rms"]
    expected = result["stiff_primary_stroke_rms"].sel(speed=250, bogie_mass=600).values
    np.testing.assert_allclose([row["stiff_RMS"] for row in strokes], expected, rtol=1e-12)
    anew = off_grid.find(result, parse_point("speed=222 km/h, bogie_mass=600 kg")).dataset
    assert {"stiff_heavy_status", "stiff_bogie_acceleration_rms"} <= {*map(str, anew)}
    assert plot(result, tmp_path / "figures", "svg")


def test_legends_name_the_variants(result):
    from freqrail.figures.sweeps import drawings

    figures = drawings(result)
    for stem in ("rms-against-speed-bogie_mass", "psd"):
        drawing = figures[stem]
        index = {name: 0 for name in ("speed", *OVER, "secondary_joint_stiffness") if name not in drawing.axes}
        figure = drawing.draw(result, result_case(result), index, *drawing.rest)
        words = [text.get_text() for text in figure.legends[0].get_texts()]
        assert {STIFF.words, HEAVY.words, BASE.words} <= {*words}


def test_what_only_a_variant_does_is_warned_of_in_its_name(case):
    absurd = Variant("light", "light wheelsets", {"wheelset_mass": 10.0})
    plain, with_it = (plausibility.concerns(replace(case, variants=v)) for v in ((), (absurd,)))
    new = [concern for concern in with_it if concern.text.startswith("light wheelsets: ")]
    assert {concern.name for concern in new} >= {"wheelset"}
    assert {concern.name for concern in plausibility.concerns(replace(case, variants=DEFAULT))} == {
        c.name for c in plain
    }


def test_default_variants_need_no_attribute(case):
    assert stored(DEFAULT) == ""
    assert "variants" not in freqrail.sweep("yu-damper-joint", {"speed": "200 km/h"}).attrs


@pytest.mark.filterwarnings("ignore")
def test_a_confirmation_simulates_every_variant():
    over = {"speed": "250 km/h", "primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
    one = replace(load_case("yu-damper-joint", over=over), variants=(STIFF, HEAVY))
    confirmed = freqrail.confirm(
        freqrail.sweep(one), realisations=1, duration="18 s", band="1:15 Hz", integrator="exponential"
    )
    assert confirmed["model"].values.tolist() == ["joint", "stiff", "stiff_heavy"]
    assert (confirmed["solver_error"] < 1e-4).all()
    assert (confirmed["result_difference"] < 1e-9).all()
    assert faults(confirmed) == []


def test_a_variant_that_moves_the_wheels_is_left_out_of_a_confirmation():
    from freqrail.confirm.run import prepare_run

    longer = Variant("longer", "longer bogies", {"half_wheelbase": 1.0})
    one = replace(load_case("yu-damper-joint", over={"speed": "250 km/h"}), variants=(longer, STIFF))
    with pytest.warns(FreqrailWarning, match="longer bogies: left out: it fixes half_wheelbase"):
        run = prepare_run(freqrail.sweep(one), ["speed=250 km/h, primary_joint_stiffness=5 MN/m"], duration="20 s")
    assert run.labels_of_models == ("joint", "stiff")


def test_a_variant_may_fix_the_speed():
    fast = Variant("fast", "at 300 km/h", {"speed": 300 / 3.6})
    found = freqrail.sweep(replace(load_case("yu-damper-joint", over={"speed": "200, 300 km/h"}), variants=(fast,)))
    own, twin = found["bogie_acceleration_rms"].sel(speed=300), found["fast_bogie_acceleration_rms"]
    assert "speed" not in twin.dims
    np.testing.assert_allclose(own, twin, rtol=1e-9)


def test_models_of_nonsense_is_an_error():
    with pytest.raises(InputError, match="no list of variants"):
        models_of(xr.Dataset(attrs={"variants": "17"}))
