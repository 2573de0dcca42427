"""What other programs make of a result: CF's coordinates and units, and datasets of several vehicles put together."""

from __future__ import annotations

from pathlib import Path

import cf_units
import cf_xarray
import cf_xarray.units
import netCDF4
import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.case.axis import parse_axis
from freqrail.case.case import load_case
from freqrail.case.parameters import PARAMETERS
from freqrail.case.quantities import cf_unit, typed_unit, unit_factor
from freqrail.cli.commands import run
from freqrail.result.labels import coordinate

CASE = "yu-damper-joint"
PRIMARY, SECONDARY = "primary_joint_stiffness", "secondary_joint_stiffness"
POINT = {PRIMARY: "5 MN/m", SECONDARY: "5 MN/m", "speed": "250 km/h"}

pytestmark = pytest.mark.filterwarnings("ignore:the simulation .* would have seen no fault below")


def alone(folder: Path, **changes: str) -> xr.Dataset:
    """The paper's vehicle at one point, with nothing swept, changed as `--set` does."""
    text = freqrail.shipped_cases()[CASE]
    file = folder / "alone.toml"
    file.write_text(text[: text.index("[sweep]")], encoding="utf-8")
    return freqrail.sweep(file, settings=changes, responses="paper")


@pytest.fixture(scope="module")
def everything() -> xr.Dataset:
    """Rigid and elastic joints, an added axis, all responses and their spectra. Not to be changed."""
    over = POINT | {PRIMARY: "5, 100, inf MN/m", "secondary_damping": "40, 54 kN*s/m", "frequency": "1, 2, 5 Hz"}
    return freqrail.sweep(CASE, over, responses="all", psd=True)


@pytest.fixture(scope="module")
def file(everything, tmp_path_factory) -> Path:
    return freqrail.write_result(everything, tmp_path_factory.mktemp("cf") / "everything.nc")


@pytest.fixture(scope="module")
def confirmation(tmp_path_factory) -> Path:
    """A confirmation of two points, on the disk."""
    folder = tmp_path_factory.mktemp("confirmation")
    result = freqrail.write_result(freqrail.sweep(CASE, POINT | {"speed": "200, 250 km/h"}), folder / "r.nc")
    found = freqrail.confirm(
        result,
        ["speed=200 km/h", "speed=250 km/h"],
        duration="20 s",
        realisations=2,
        integrator="exponential",
        band="1:10 Hz",
    )
    return freqrail.write_result(found, folder / "confirmation.nc")


# --- coordinates -------------------------------------------------------------------------------------


def test_every_variable_of_a_confirmation_names_its_coordinates(confirmation):
    """As NCO, Iris and cf_xarray need it: without, a variable taken out of the file has no speed and no stiffness."""
    with netCDF4.Dataset(confirmation) as raw:
        for name, variable in raw.variables.items():
            if "point" in variable.dimensions and name not in raw.dimensions and "units" in variable.ncattrs():
                coordinate = name in ("speed", PRIMARY, SECONDARY, "frequency", "time") or name.endswith("compliance")
                named = [] if coordinate else variable.coordinates.split()
                assert coordinate or {"speed", PRIMARY, SECONDARY, "place"} <= set(named), name
        assert "coordinates" not in raw.ncattrs()
        spectrum = raw["bogie_acceleration_psd_time_domain"].coordinates.split()
        assert "frequency" in spectrum
        assert "time" not in spectrum
        assert "time" in raw["bogie_acceleration_history"].coordinates.split()


def test_cf_xarray_finds_the_coordinates_of_one_variable(confirmation, file):
    """Each variable read alone, as by `ncks -v`: only what it names itself goes with it."""
    with xr.open_dataset(confirmation) as found:
        one = found["bogie_acceleration_rms_pooled"]
        assert {"speed", PRIMARY, "bogie_mass", "band_upper_frequency"} <= set(one.cf.coordinates.get("", [])) | set(
            one.coords
        )
        assert set(found.cf.get_associated_variable_names("bogie_acceleration_rms_pooled")["coordinates"]) >= {
            "speed",
            PRIMARY,
            SECONDARY,
            "place",
        }
    with xr.open_dataset(file) as found:
        assert set(found.cf.get_associated_variable_names("primary_stroke_rms")["coordinates"]) >= {
            "bogie_mass",
            "primary_joint_compliance",
        }


def test_the_traditional_model_has_no_joints_among_its_coordinates(tmp_path):
    written = freqrail.write_result(alone(tmp_path), tmp_path / "alone.nc")
    with netCDF4.Dataset(written) as raw:
        assert "primary_joint_stiffness primary_joint_compliance" in raw["bogie_acceleration_rms"].coordinates
        assert "joint" not in raw["traditional_bogie_acceleration_rms"].coordinates
        assert "bogie_mass" in raw["traditional_status"].coordinates


def test_what_is_not_swept_is_a_scalar_coordinate(tmp_path):
    found = alone(tmp_path)
    for name, value, unit in (
        ("speed", 250.0, "km/h"),
        (PRIMARY, 5.0, "MN/m"),
        ("primary_joint_compliance", 0.2, "mm kN-1"),
        ("car_body_mass", 15200.0, "kg"),
        ("primary_stiffness", 875e3, "N m-1"),
        ("secondary_damping", 54e3, "N s m-1"),
        ("band_lower_frequency", 0.1, "Hz"),
        ("band_upper_frequency", 100.0, "Hz"),
    ):
        assert (found[name].dims, found[name].item(), found[name].attrs["units"]) == ((), value, unit)
    assert "contact_stiffness" not in found.coords
    swept = freqrail.sweep(CASE, POINT | {"contact_stiffness": "1, 2 GN/m"})
    assert "contact_constant" not in swept.coords  # it is not what the numbers were computed with


@pytest.mark.filterwarnings("ignore:.*rigid rail")
def test_a_band_by_wavelength_or_none_is_told_too():
    found = freqrail.sweep(CASE, POINT, {"wavelength": "1:200 m"}, "bogie_acceleration")
    assert (found.band_shortest_wavelength.item(), found.band_longest_wavelength.item()) == (1.0, 200.0)
    assert found.band_longest_wavelength.attrs["units"] == "m"
    whole = freqrail.sweep(CASE, POINT, {"band": "none"}, "bogie_acceleration")
    assert (whole.band_lower_frequency.item(), whole.band_upper_frequency.item()) == (0.0, np.inf)


def test_results_of_several_vehicles_lie_along_their_mass_when_put_together(tmp_path):
    """`xr.concat` of single results is the sweep over that mass, labels and units included."""
    masses = ["600 kg", "0.65 t"]
    paths = []
    for mass in masses:
        found = freqrail.sweep(CASE, POINT, {"bogie_mass": mass}, "paper")
        paths.append(freqrail.write_result(found, tmp_path / f"{len(paths)}.nc"))
    both = [xr.open_dataset(path) for path in paths]
    together = xr.concat(both, dim="bogie_mass", coords="different", compat="equals")  # as README has it
    assert together.bogie_mass.values.tolist() == [600.0, 650.0]
    assert together.bogie_mass.attrs["units"] == "kg"
    swept = freqrail.sweep(CASE, POINT | {"bogie_mass": "600, 650 kg"})
    for name in swept.data_vars:
        atol = 1e-7 if str(name).endswith("_error") else 0.0
        put = together[name].transpose(*swept[name].dims)
        np.testing.assert_allclose(put.values, swept[name].values, rtol=1e-13, atol=atol, err_msg=str(name))
    assert together.primary_stiffness.dims == ()  # what they share stays a scalar
    one = together.bogie_acceleration_rms.sel(bogie_mass=650, bogie="front").squeeze()
    assert one.item() == xr.open_dataset(paths[1]).bogie_acceleration_rms.sel(bogie="front").item()


def test_between_the_stiffest_joint_and_the_rigid_one_is_interpolated_along_the_compliance(everything):
    """Along the stiffness `interp` meets infinity, and gives the finite neighbour; the compliance is 0 there."""
    values = everything.bogie_acceleration_rms.squeeze().isel(secondary_damping=0, bogie=0)
    compliance = everything.primary_joint_compliance
    assert compliance.dims == (PRIMARY,)
    assert compliance.values.tolist() == [0.2, 0.01, 0.0]
    assert compliance.attrs["units"] == "mm kN-1"
    between = values.swap_dims({PRIMARY: "primary_joint_compliance"}).interp(primary_joint_compliance=0.005)
    assert between.item() == pytest.approx((values[1].item() + values[2].item()) / 2, rel=1e-12)
    assert values[1].item() != values[2].item()


# --- units and attributes ------------------------------------------------------------------------------


def test_pint_and_udunits_read_every_unit_of_a_file_alike(file, confirmation):
    for path in (file, confirmation):
        with xr.open_dataset(path, decode_timedelta=False) as found:
            units = {variable.attrs["units"] for variable in found.variables.values() if "units" in variable.attrs}
        assert any("Hz-1" in unit for unit in units)
        for unit in units - {"1"}:
            by_pint = cf_xarray.units.units.Quantity(1, unit).to_base_units()
            by_udunits = cf_units.Unit(unit)
            base = cf_units.Unit(f"{by_pint.units:cf}")
            assert by_udunits.convert(1.0, base) == pytest.approx(by_pint.magnitude, rel=1e-12), unit


@pytest.mark.parametrize(
    ("name", "text", "values", "unit"),
    [
        ("secondary_damping", "40, 54 kN*s/m", [40, 54], "kN s m-1"),
        ("bogie_mass", "1300, 1400 lb", [1300, 1400], "lb"),
        ("bogie_mass", "0.6, 0.65 t", [0.6, 0.65], "t"),
        ("bogie_mass", "40, 45 slug", [583.756, 656.725], "kg"),
        ("bogie_mass", "20000, 21000 oz", [566.99, 595.34], "kg"),  # a volume to UDUNITS
        ("bogie_pitch_inertia", "700, 800 kg m^2", [700, 800], "kg m2"),
        ("bogie_pitch_inertia", "700, 800 kg·m²", [700, 800], "kg m2"),
        ("primary_stiffness", "800, 900 N/mm", [800, 900], "N mm-1"),
        ("primary_stiffness", "5000, 6000 lbf/in", [5000, 6000], "lbf in-1"),
        ("half_wheelbase", "0.7, 0.8 m", [0.7, 0.8], "m"),
        ("half_wheelbase", "700000, 800000 µm", [7e5, 8e5], "um"),
        ("speed", "100, 200 km/h", [100, 200], "km/h"),
        ("speed", "50 m/s", [180], "km/h"),
        ("primary_joint_stiffness", "5000 kN/m", [5], "MN/m"),
    ],
)
def test_units_of_axes_are_spelled_as_cf_has_them_or_turned_to_si(name, text, values, unit):
    """No unit is withheld but the contact constant's, whose fractional power UDUNITS has no word for."""
    axis = parse_axis(PARAMETERS[name], text)
    _, found, described = coordinate(axis, load_case("yu-damper-joint"))[name]
    assert described["units"] == unit
    assert found == pytest.approx(values, rel=1e-5)
    in_si = cf_units.Unit(unit).convert(found, cf_units.Unit(cf_unit(PARAMETERS[name].unit)))
    assert in_si == pytest.approx(axis.si, rel=1e-12)


@pytest.mark.parametrize(
    "unit", ["kN*s/m", "kg*m^2", "MN/m", "km/h", "lb", "m/s^2", "N/mm", "rad/m", "m^2*rad/m", "t", "1/s", "Hz"]
)
def test_a_unit_spelled_as_cf_has_it_comes_back_as_users_type_it(unit):
    if unit == "1/s":
        assert typed_unit("s-1") == "s^-1"
        return
    assert unit_factor(typed_unit(cf_unit(unit))) == unit_factor(unit)
    assert typed_unit(unit) == unit


def test_no_whole_number_among_the_attributes_is_longer_than_32_bits(file, confirmation, tmp_path):
    """The classic NetCDF format and R have none; a seed that needs more is text."""
    for path in (file, confirmation):
        with netCDF4.Dataset(path) as raw:
            holders = [raw, *raw.variables.values()]
            kinds = {np.asarray(holder.getncattr(key)).dtype for holder in holders for key in holder.ncattrs()}
            kinds |= {np.dtype(variable.dtype) for variable in raw.variables.values()}
        assert not kinds & {np.dtype(np.int64), np.dtype(np.uint64)}
        with xr.open_dataset(path, decode_timedelta=False) as found:
            found.to_netcdf(tmp_path / f"classic-{path.name}", format="NETCDF3_CLASSIC", engine="netcdf4")
        with xr.open_dataset(path) as found, xr.open_dataset(tmp_path / f"classic-{path.name}") as classic:
            xr.testing.assert_equal(found, classic)


def test_a_long_seed_is_told_as_text():
    from freqrail.result.content import whole

    assert (whole(7), whole(7).dtype) == (7, np.int32)
    assert whole(2**40) == str(2**40)


# --- results written before --------------------------------------------------------------------------


def test_a_result_of_the_first_schema_is_read_as_ever(tmp_path, capsys):
    """Written by freqrail before its schema 2: units of spectra and axes in another spelling, no scalars."""
    old = Path(__file__).parents[1] / "schema1" / "sweep.nc"
    found = freqrail.open_result(old)
    assert found.attrs["dataset_schema_version"] == 1
    assert found.bogie_acceleration_psd.attrs["units"] == "(m s-2)2 Hz-1"
    assert found.secondary_damping.attrs["units"] == "kN*s/m"
    over = POINT | {PRIMARY: "5, inf MN/m", "secondary_damping": "40, 54 kN*s/m", "frequency": "1, 2, 5 Hz"}
    new = freqrail.sweep(CASE, over, responses="bogie_acceleration", psd=True)
    for name in found.data_vars:
        tolerance = {"rtol": 1e-9} if not str(name).endswith("_relative_error") else {"atol": 1e-6}
        np.testing.assert_allclose(new[name].values, found[name].values, **tolerance)
    at = f"{PRIMARY}=5 MN/m, {SECONDARY}=5 MN/m, speed=250 km/h, secondary_damping=40 kN*s/m"
    assert run(["show", str(old), "--at", at]) == 0
    assert "secondary_damping = 40 kN*s/m" in capsys.readouterr().out
    assert freqrail.plot(old, tmp_path / "figures")
    renamed = found.assign_attrs(dataset_schema_version=2)
    path = freqrail.write_result(renamed, tmp_path / "wrong.nc")
    with pytest.raises(freqrail.FreqrailError, match="has no unit m2 s-4 Hz-1"):
        freqrail.open_result(path)
