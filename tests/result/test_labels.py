"""The labelled result: names, order and units that users read, and files that are whole or refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.errors import InputError
from freqrail.model.responses import RESPONSES
from freqrail.result.content import content_digest
from freqrail.result.points import result_case
from tests.helpers import ALL_NAMES, explicit_responses, reference_rms

CASE = "yu-damper-joint"
PRIMARY, SECONDARY = "primary_joint_stiffness", "secondary_joint_stiffness"
FOUR = {
    "car_body_acceleration": ("car_position", ["front", "centre", "rear"], "m s-2"),
    "bogie_acceleration": ("bogie", ["front", "rear"], "m s-2"),
    "secondary_stroke": ("bogie", ["front", "rear"], "m"),
    "primary_stroke": ("axle", [1, 2, 3, 4], "m"),
}
OTHERS = {
    "wheelset_acceleration": ("axle", [1, 2, 3, 4], "m s-2"),
    "car_body_pitch_acceleration": (None, None, "rad s-2"),
    "bogie_pitch_acceleration": ("bogie", ["front", "rear"], "rad s-2"),
}
SMALL = {PRIMARY: "1, 5, 100 MN/m", SECONDARY: "5, 50 MN/m", "speed": "100, 250 km/h"}


def one_point(**axes: str) -> dict[str, str]:
    return {PRIMARY: "5 MN/m", SECONDARY: "5 MN/m", "speed": "250 km/h", **axes}


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    """A small sweep of the paper's case. Not to be changed."""
    return freqrail.sweep(CASE, over=SMALL)


@pytest.fixture(scope="module")
def everything() -> xr.Dataset:
    """One point with all responses and their spectra. Not to be changed."""
    return freqrail.sweep(CASE, over=one_point(frequency="log:0.5:50:7 Hz"), responses="all", psd=True)


@pytest.fixture
def written(result: xr.Dataset, tmp_path: Path) -> Path:
    return freqrail.write_result(result, tmp_path / "result.nc")


# --- dimensions and coordinates ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "order",
    [(PRIMARY, SECONDARY, "speed"), (PRIMARY, "speed", SECONDARY), ("speed", SECONDARY, PRIMARY)],
    ids=["speed last", "speed in the middle", "speed first"],
)
def test_dimensions_stand_in_the_order_of_the_axes(tmp_path, result, order):
    """The order in the case file is the order of the dimensions; the values move with their labels."""
    text = freqrail.shipped_cases()[CASE]
    head, tail = text[: text.index("[sweep]")], text[text.index("[confirm]") :]
    axes = "".join(f'{name} = "{SMALL[name]}"\n' for name in order)
    tail = tail[: tail.index("points")] + "points = []\n"
    file = tmp_path / "ordered.toml"
    file.write_text(f"{head}[sweep]\n{axes}\n{tail}", encoding="utf-8")
    found = freqrail.sweep(file)
    for name, (place, _, _) in FOUR.items():
        assert found[f"{name}_rms"].dims == (*order, place)
        assert found[f"traditional_{name}_rms"].dims == ("speed", place)
        for prefix in ("", "traditional_"):
            xr.testing.assert_allclose(
                found[f"{prefix}{name}_rms"],
                result[f"{prefix}{name}_rms"].transpose(..., *order, place, missing_dims="ignore"),
                rtol=1e-12,
            )
    assert found["status"].dims == found["method"].dims == order
    assert found["traditional_status"].dims == ("speed",)


def test_an_axis_of_one_value_stays_a_dimension():
    found = freqrail.sweep(CASE, over=one_point(), responses="all")
    for name, response in RESPONSES.items():
        place = (response.dimension,) if response.dimension else ()
        assert found[f"{name}_rms"].dims == (PRIMARY, SECONDARY, "speed", *place)
        assert found[f"{name}_rms"].shape[:3] == (1, 1, 1)
        assert found[f"traditional_{name}_rms"].dims == ("speed", *place)


def test_a_case_that_sweeps_nothing_is_a_single_point_without_axes(tmp_path):
    text = freqrail.shipped_cases()[CASE]
    file = tmp_path / "alone.toml"
    file.write_text(text[: text.index("[sweep]")], encoding="utf-8")
    found, swept = freqrail.sweep(file, responses="all"), freqrail.sweep(CASE, over=one_point(), responses="all")
    assert found["status"].dims == ()
    for name, response in RESPONSES.items():
        assert found[f"{name}_rms"].dims == ((response.dimension,) if response.dimension else ())
        np.testing.assert_array_equal(found[f"{name}_rms"], swept[f"{name}_rms"].squeeze())


def test_an_added_axis_comes_last_and_keeps_the_users_unit():
    found = freqrail.sweep(CASE, over=one_point(secondary_damping="40, 54 kN*s/m"))
    assert found["bogie_acceleration_rms"].dims == (PRIMARY, SECONDARY, "speed", "secondary_damping", "bogie")
    assert found["traditional_bogie_acceleration_rms"].dims == ("speed", "secondary_damping", "bogie")
    assert list(found["secondary_damping"].values) == [40.0, 54.0]
    assert found["secondary_damping"].attrs["units"] == "kN s m-1"


def test_coordinates_bear_the_values_that_users_type(everything):
    found = freqrail.sweep(CASE, over={PRIMARY: "0.1:1:0.1 MN/m", SECONDARY: "5000 kN/m", "speed": "50 m/s"})
    assert list(found[PRIMARY].values) == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    assert list(found[SECONDARY].values) == [5.0]
    assert list(found["speed"].values) == [180.0]
    assert found[PRIMARY].attrs["units"] == found[SECONDARY].attrs["units"] == "MN/m"
    assert found["speed"].attrs["units"] == "km/h"
    assert everything["frequency"].attrs["units"] == "Hz"
    assert everything["frequency"].values[[0, -1]] == pytest.approx([0.5, 50.0], rel=1e-12)


def test_positions_are_labelled(everything):
    for name, (place, labels, _) in (FOUR | OTHERS).items():
        dims = everything[f"{name}_rms"].dims
        assert dims == (PRIMARY, SECONDARY, "speed", *([place] if place else []))
        if place:
            assert list(everything[place].values) == labels


def test_every_variable_and_coordinate_explains_itself(everything, result):
    for dataset in (result, everything):
        for name, variable in dataset.variables.items():
            assert len(variable.attrs["long_name"]) > 5, name
            if variable.dtype.kind == "f":
                # the contact constant's unit has a fractional power, which CF has not
                assert variable.attrs["user_units" if name == "contact_constant" else "units"], name
                assert variable.dtype == np.float64


def test_units_are_si_and_those_of_the_quantity(everything):
    squared = {"m": "m2 Hz-1", "m s-2": "m2 s-4 Hz-1", "rad s-2": "rad2 s-4 Hz-1"}
    for name, (_, _, unit) in (FOUR | OTHERS).items():
        for prefix in ("", "traditional_"):
            assert everything[f"{prefix}{name}_rms"].attrs["units"] == unit
            assert everything[f"{prefix}{name}_rms_relative_error"].attrs["units"] == "1"
            assert everything[f"{prefix}{name}_psd"].attrs["units"] == squared[unit]


def test_values_are_those_of_the_kernel_in_si(everything, paper_vehicle, german_low):
    """Labels move nothing: front, centre and rear, and axles 1 to 4, are where the kernel has them."""

    speed = 250 / 3.6
    expected = reference_rms(paper_vehicle, german_low, speed, 2 * np.pi * 0.1, 2 * np.pi * 100.0, ALL_NAMES)
    frequency = everything["frequency"].values
    transfer = explicit_responses(paper_vehicle, 2 * np.pi * frequency, speed)
    for name in ALL_NAMES:
        np.testing.assert_allclose(everything[f"{name}_rms"].values.ravel(), expected[name], rtol=1e-9)
        psd = everything[f"{name}_psd"].squeeze().transpose(..., "frequency").values.reshape(-1, frequency.size)
        wavenumber = 2 * np.pi * frequency / speed
        track = 4.032e-7 * 0.8246**2 / ((wavenumber**2 + 0.0206**2) * (wavenumber**2 + 0.8246**2))
        np.testing.assert_allclose(psd, np.abs(transfer[name]) ** 2 * 2 * np.pi * track / speed, rtol=1e-7)


def test_infinite_joints_at_the_end_of_an_axis_are_the_traditional_model():
    found = freqrail.sweep(CASE, over={PRIMARY: "5, inf MN/m", SECONDARY: "5, inf MN/m", "speed": "100, 250 km/h"})
    rigid = found.sel({PRIMARY: np.inf, SECONDARY: np.inf})
    for name in FOUR:
        np.testing.assert_allclose(rigid[f"{name}_rms"], found[f"traditional_{name}_rms"], rtol=1e-9)
        soft = found[f"{name}_rms"].sel({PRIMARY: 5, SECONDARY: 5})
        assert not np.allclose(soft, found[f"traditional_{name}_rms"], rtol=1e-5)


def test_stiff_joints_approach_the_traditional_model():
    found = freqrail.sweep(CASE, over=one_point(**{PRIMARY: "10, 1000 MN/m", SECONDARY: "10, 1000 MN/m"}))
    both = {PRIMARY: xr.DataArray([10.0, 1000.0], dims="k"), SECONDARY: xr.DataArray([10.0, 1000.0], dims="k")}
    away = abs(found.bogie_acceleration_rms.sel(both) / found.traditional_bogie_acceleration_rms - 1)
    assert np.all(away.isel(k=1) < 0.05 * away.isel(k=0))


# --- what is in it -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ("paper", list(FOUR)),
        ("all", [*FOUR, *OTHERS]),
        ("primary_stroke", ["primary_stroke"]),
        ("primary_stroke, car_body_acceleration", ["car_body_acceleration", "primary_stroke"]),
        (["wheelset_acceleration"], ["wheelset_acceleration"]),
        ("paper, wheelset_acceleration", [*FOUR, "wheelset_acceleration"]),
    ],
)
def test_responses_are_those_asked_for(asked, expected):
    found = freqrail.sweep(CASE, over=one_point(), responses=asked)
    names = [name for name in found.data_vars if name.endswith("_rms") and not name.startswith("traditional_")]
    assert names == [f"{name}_rms" for name in expected]
    suffixes = ("_rms", "_rms_relative_error")
    every = {f"{p}{n}{s}" for p in ("", "traditional_") for n in expected for s in suffixes}
    assert set(found.data_vars) == every | {"status", "method", "traditional_status", "traditional_method"}
    used = {(FOUR | OTHERS)[name][0] for name in expected} - {None}
    assert set(found.indexes) == {PRIMARY, SECONDARY, "speed"} | used


def test_an_unknown_response_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="bogie_acceleration"):
        freqrail.sweep(CASE, over=one_point(), responses="bogie_aceleration")


def test_status_and_method_say_what_their_values_mean(result):
    for prefix in ("", "traditional_"):
        for flags in ("status", "method"):
            variable = result[f"{prefix}{flags}"]
            assert variable.dtype == np.int8
            meanings = variable.attrs["flag_meanings"].split()
            assert list(variable.attrs["flag_values"]) == list(range(len(meanings)))
            assert variable.attrs["flag_values"].dtype == np.int8
        assert result[f"{prefix}status"].attrs["flag_meanings"].split() == [
            *("ok", "unresolved_peak", "undamped", "failed")
        ]
        assert np.all(result[f"{prefix}status"] == 0)
        assert np.all(result[f"{prefix}method"] > 0)
        assert result[f"{prefix}bogie_acceleration_rms"].attrs["ancillary_variables"].split() == [
            f"{prefix}bogie_acceleration_rms_relative_error",
            f"{prefix}status",
            f"{prefix}method",
        ]


def test_a_response_without_a_result_is_nan_and_the_point_has_a_status():
    found = freqrail.sweep(CASE, over=one_point(primary_damping="0, 17 kN*s/m"))
    for prefix in ("", "traditional_"):
        meanings = found[f"{prefix}status"].attrs["flag_meanings"].split()
        status = found[f"{prefix}status"].sel(primary_damping=0)
        assert np.all(status == meanings.index("undamped"))
        for name in FOUR:
            values = found[f"{prefix}{name}_rms"]
            assert np.all(np.isnan(values.sel(primary_damping=0)) == (name == "primary_stroke"))
            assert np.all(values.sel(primary_damping=17) > 0)


def test_attributes_tell_where_the_numbers_come_from(result):
    assert result.attrs["Conventions"] == "CF-1.11"
    assert result.attrs["dataset_schema_version"] == 2
    assert result.attrs["case_text"] == freqrail.shipped_cases()[CASE]
    assert "0.1 to 100 Hz" in result.attrs["band"]
    for name in ("title", "history", "source", "references", "effective_case", "effective_case_sha256", "versions"):
        assert result.attrs[name]


@pytest.mark.filterwarnings("ignore:.*rigid rail:freqrail.errors.FreqrailWarning")
def test_a_result_carries_all_that_repeats_it(result):
    """Settings and axes are in its effective case, from which alone the same sweep follows."""
    changed = freqrail.sweep(
        CASE, over={**SMALL, "speed": "150, 250 km/h"}, settings={"secondary_damping": "40 kN*s/m", "band": "none"}
    )
    again = freqrail.sweep(result_case(changed))
    for key in ("effective_case", "effective_case_sha256", "band", "title", "case_name"):
        assert again.attrs[key] == changed.attrs[key]
    xr.testing.assert_equal(again, changed)
    assert not np.allclose(changed.bogie_acceleration_rms.sel(speed=250), result.bogie_acceleration_rms.sel(speed=250))


def test_jobs_change_no_bit(result):
    xr.testing.assert_equal(freqrail.sweep(CASE, over=SMALL, jobs=2), result)


@pytest.mark.filterwarnings("ignore:.*rigid rail:freqrail.errors.FreqrailWarning")
def test_a_default_spectrum_covers_the_band():
    found = freqrail.sweep(CASE, over=one_point(), psd=True, responses="primary_stroke")
    frequency = found["frequency"].values
    assert frequency.size == 400
    assert frequency[[0, -1]] == pytest.approx([0.1, 100.0], rel=1e-12)
    np.testing.assert_allclose(np.diff(np.log(frequency)), np.log(1000) / 399, rtol=1e-9)
    whole = freqrail.sweep(CASE, over=one_point(), settings={"band": "none"}, psd=True, responses="primary_stroke")
    assert whole["frequency"].values[[0, -1]] == pytest.approx([0.01, 500.0], rel=1e-12)


def test_spectra_of_responses_that_an_axis_does_not_touch_have_it_all_the_same():
    """The bogies' pitch does not depend on the secondary damping; once such a sweep ended in a ValueError."""
    axes = {**one_point(), "secondary_damping": "54 kN*s/m", "frequency": "1, 10 Hz"}
    found = freqrail.sweep(CASE, over=axes, responses="all", psd=True)
    two = freqrail.sweep(CASE, over={**axes, "secondary_damping": "27, 54 kN*s/m"}, responses="all", psd=True)
    for name in ("bogie_pitch_acceleration_psd", "traditional_bogie_pitch_acceleration_psd"):
        assert found[name].dims == two[name].dims
        np.testing.assert_allclose(
            two[name].isel(secondary_damping=0), found[name].isel(secondary_damping=0), rtol=1e-12
        )


# --- the digest --------------------------------------------------------------------------------------


def test_digest_does_not_know_history_or_itself(result):
    digest = content_digest(result)
    assert content_digest(result.copy(deep=True)) == digest
    assert content_digest(result.assign_attrs(history="another day", content_digest="0" * 64)) == digest


def test_digest_changes_with_any_value(result):
    digest = content_digest(result)
    for name, variable in result.variables.items():
        other = result.copy(deep=True)
        values = variable.values.copy()
        flat = values.reshape(-1)
        if values.dtype.kind == "f":
            flat[-1] = np.nextafter(flat[-1], np.inf)  # the last bit of the last value
        elif values.dtype.kind == "i":
            flat[-1] += 1
        else:
            flat[-1] = "reaR"
        other = (
            other.assign_coords({name: (variable.dims, values, variable.attrs)})
            if name in other.coords
            else (other.assign({name: (variable.dims, values, variable.attrs)}))
        )
        assert content_digest(other) != digest, name


def test_digest_changes_with_any_attribute_or_name(result):
    digest = content_digest(result)
    for key in set(result.attrs) - {"history"}:
        assert content_digest(result.assign_attrs({key: "something else"})) != digest, key
        without = result.copy()
        without.attrs = {k: v for k, v in result.attrs.items() if k != key}
        assert content_digest(without) != digest, key
    for name in result.variables:
        for key in result[name].attrs:
            other = result.copy(deep=True)
            other[name].attrs[key] = "something else"
            assert content_digest(other) != digest, (name, key)
    assert content_digest(result.rename(bogie_acceleration_rms="bogie_rms")) != digest
    assert content_digest(result.drop_vars("method")) != digest
    assert content_digest(result.transpose()) != digest


# --- files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("which", ["result", "everything"])
def test_a_file_holds_the_result_entirely(request, tmp_path, which):
    dataset = request.getfixturevalue(which)
    path = freqrail.write_result(dataset, tmp_path / "result.nc")
    back = freqrail.open_result(path)
    xr.testing.assert_equal(back, dataset)
    assert list(back.data_vars) == list(dataset.data_vars)
    assert back.attrs.pop("content_digest") == content_digest(dataset)
    for name in dataset.variables:
        assert back[name].dims == dataset[name].dims
        assert set(back[name].attrs) == set(dataset[name].attrs)
        for key, value in dataset[name].attrs.items():
            assert np.array_equal(back[name].attrs[key], value), (name, key)
    assert set(back.attrs) == set(dataset.attrs)
    for key, value in dataset.attrs.items():
        assert np.array_equal(back.attrs[key], value), key
    assert list(tmp_path.iterdir()) == [path]


def test_nan_and_infinity_survive_the_file(tmp_path):
    dataset = freqrail.sweep(CASE, over=one_point(**{PRIMARY: "5, inf MN/m"}, primary_damping="0, 17 kN*s/m"))
    back = freqrail.open_result(freqrail.write_result(dataset, tmp_path / "result.nc"))
    assert np.isinf(back[PRIMARY].values[-1])
    assert np.isnan(back.primary_stroke_rms.sel(primary_damping=0)).all()
    xr.testing.assert_equal(back, dataset)


def test_an_existing_file_is_refused_and_left_alone(result, tmp_path):
    path = tmp_path / "result.nc"
    path.write_bytes(b"something of the user's own")
    with pytest.raises(InputError, match="exists already"):
        freqrail.write_result(result, path)
    assert path.read_bytes() == b"something of the user's own"
    freqrail.write_result(result, path, overwrite=True)
    xr.testing.assert_equal(freqrail.open_result(path), result)


def place_of(data: bytes, values: np.ndarray) -> int:
    """Where an array's bytes stand in a file."""
    place = data.find(np.ascontiguousarray(values).tobytes())
    assert place > 0
    return place


@pytest.mark.parametrize("target", ["bogie_acceleration_rms", "status", "speed", PRIMARY, "title", "units"])
def test_a_flipped_bit_is_noticed(written, result, target):
    """In a value, a flag, a coordinate, or the text of an attribute."""
    data = bytearray(written.read_bytes())
    if target in result.variables:
        place = place_of(data, result[target].values)
    elif target == "title":
        place = data.find(result.attrs["title"].encode())
    else:
        place = data.find(b"m s-2")
    assert place > 0
    data[place] ^= 1
    written.write_bytes(data)
    with pytest.raises(InputError, match=r"damaged|not a result"):
        freqrail.open_result(written)


def test_a_file_that_another_program_changed_is_refused(written):
    """Well-formed NetCDF with other numbers, words or variables: only the digest can tell."""
    pristine = written.read_bytes()

    def value(file: netCDF4.Dataset) -> None:
        file["bogie_acceleration_rms"][0, 0, 0, 0] *= 1 + 1e-12

    def label(file: netCDF4.Dataset) -> None:
        file["speed"][0] = 101.0

    def unit(file: netCDF4.Dataset) -> None:
        file["speed"].units = "m/s"

    def word(file: netCDF4.Dataset) -> None:
        file.title = "another"

    def variable(file: netCDF4.Dataset) -> None:
        file.createVariable("extra", "f8", ("speed",))[:] = 1.0

    for change in (value, label, unit, word, variable):
        written.write_bytes(pristine)
        with netCDF4.Dataset(written, "a") as file:
            change(file)
        with pytest.raises(InputError, match="does not match its digest"):
            freqrail.open_result(written)
    written.write_bytes(pristine)
    with netCDF4.Dataset(written, "a") as file:
        file.history = f"{file.history}; looked at"  # what tools append to is not part of the content
    freqrail.open_result(written)


@pytest.mark.parametrize("kept", [0.0, 0.001, 0.3, 0.7, 0.95])
def test_a_truncated_file_is_refused(written, kept):
    data = written.read_bytes()
    written.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(InputError, match=str(written)):
        freqrail.open_result(written)


def test_no_flipped_byte_anywhere_passes_as_another_result(written, result):
    """60 places over the whole file: refused, or the very same content (a byte that nothing reads)."""
    data = written.read_bytes()
    refused = 0
    for place in np.random.default_rng(4).integers(0, len(data), 60):
        broken = bytearray(data)
        broken[place] ^= 0xFF
        written.write_bytes(broken)
        try:
            back = freqrail.open_result(written)
        except InputError:
            refused += 1
        else:
            xr.testing.assert_equal(back, result)
    assert refused > 3


def test_other_files_are_refused_by_name(tmp_path, result):
    text = tmp_path / "case.toml"
    text.write_text("schema_version = 1", encoding="utf-8")
    foreign = tmp_path / "foreign.nc"
    xr.Dataset({"x": ("t", [1.0, 2.0])}).to_netcdf(foreign)
    newer = freqrail.write_result(result.assign_attrs(dataset_schema_version=99), tmp_path / "newer.nc")
    for path, words in (
        (tmp_path / "none.nc", "no such file"),
        (tmp_path, "folder"),
        (text, "not a NetCDF file"),
        (foreign, "not a result of freqrail"),
        (newer, "schema 99"),
    ):
        with pytest.raises(InputError, match=words) as caught:
            freqrail.open_result(path)
        assert str(path) in str(caught.value)
        assert len(caught.value.problems) == 1


def test_plain_xarray_reads_and_selects_without_freqrail(written, result):
    """In a process of its own that never imports the package."""
    program = (
        "import sys, xarray as xr\n"
        f"data = xr.open_dataset({str(written)!r})\n"
        "value = data.bogie_acceleration_rms.sel("
        'speed=250, primary_joint_stiffness=5, secondary_joint_stiffness=5, bogie="front")\n'
        "assert not any(name.split('.')[0] == 'freqrail' for name in sys.modules)\n"
        "print(repr(float(value)), data.bogie_acceleration_rms.units)\n"
    )
    done = subprocess.run([sys.executable, "-I", "-c", program], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    value, unit = done.stdout.split(maxsplit=1)
    point = {"speed": 250, PRIMARY: 5, SECONDARY: 5, "bogie": "front"}
    assert float(value) == float(result.bogie_acceleration_rms.sel(point))
    assert unit.strip() == "m s-2"


def test_files_follow_the_cf_conventions(written, everything, tmp_path):
    """The IOOS checker: a plain result, one with everything, one whose axis has a unit that UDUNITS does not parse."""
    full = freqrail.write_result(everything, tmp_path / "everything.nc")
    contact = freqrail.sweep(CASE, over=one_point(contact_constant="4.2534e-8, 5.1824e-8 m/N^(2/3)"))
    assert contact["contact_constant"].attrs["user_units"] == "m/N^(2/3)"
    assert "units" not in contact["contact_constant"].attrs
    swept = freqrail.write_result(contact, tmp_path / "contact.nc")
    checker = Path(sys.executable).with_name("compliance-checker")
    done = subprocess.run(
        [checker, "--test=cf:1.11", written, full, swept], capture_output=True, text=True, timeout=300
    )
    assert done.stdout.count("All tests passed!") == 3, done.stdout + done.stderr
    assert done.returncode == 0
