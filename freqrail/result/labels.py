"""Labelled results: a sweep as one flat xarray dataset, names and units attached here and nowhere else.

Dimensions are the swept parameters in the order given, none squeezed away, then the position of the
response (car_position, bogie or axle), then frequency. Data are in SI units; `speed` is in km/h, joint
stiffnesses in MN/m, `frequency` in Hz, any other axis in the unit the user wrote as CF spells it, or in SI. What the
case does not sweep of the vehicle, the speed and the band are scalar coordinates. Conventions: CF-1.11.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import math
import platform
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.axis import Axis, parse_axis
from freqrail.case.case import Case
from freqrail.case.kinds import has_dimension
from freqrail.case.parameters import COMPLIANCE_UNIT, COMPLIANCES, meaning
from freqrail.case.quantities import cf_unit
from freqrail.case.samples import SAMPLE, Samples
from freqrail.model.band import Band, band_text
from freqrail.model.responses import HALF_VEHICLE, Vocabulary
from freqrail.result import vocabulary
from freqrail.result.axes import SAMPLE_NAME
from freqrail.result.content import SCHEMA_VERSION
from freqrail.result.layout import PARAMETER, Layout, variables
from freqrail.result.variants import ATTRIBUTE, stored, stored_all
from freqrail.solver.solution import Solution
from freqrail.version import __version__


def arrays(
    layout: Layout,
    prefix: str,
    solution: Solution,
    spectra: Mapping[str, NDArray] | None,
    gradients: Mapping[str, tuple[NDArray, NDArray]] | None = None,
) -> dict[str, NDArray]:
    """The numbers of a model, or of a part of its grid, by variable and in the order of its dimensions.

    gradients: {response: (slopes, errors)}, [positions, vehicles..., speeds, parameters].
    """
    swept = [axis.name for axis in layout.axes(prefix)]
    result: dict[str, NDArray] = {}
    for name in layout.names:
        squeeze = not layout.response(name).dimension
        result[f"{prefix}{name}_rms"] = _arrange(solution.rms[name], swept, squeeze)
        result[f"{prefix}{name}_rms_relative_error"] = _arrange(solution.relative_error[name], swept, squeeze)
        if spectra is not None:
            result[f"{prefix}{name}_psd"] = _arrange(spectra[name], swept, squeeze)
        for kind, values in zip(
            ("_rms_gradient", "_rms_gradient_error"), (gradients or {}).get(name, ()), strict=False
        ):
            result[f"{prefix}{name}{kind}"] = _arrange(values, swept, squeeze)
    result[f"{prefix}status"] = _arrange(solution.status[None], swept, True)
    result[f"{prefix}method"] = _arrange(solution.method[None], swept, True)
    return result


def skeleton(layout: Layout) -> xr.Dataset:
    """The coordinates and attributes of a sweep, without its variables."""
    coordinates: dict[str, Any] = {}
    for axis in layout.case.axes:
        own = sample_coordinates(layout.case) if axis.name == SAMPLE else None
        coordinates |= own or coordinate(axis, layout.case)
    used = {layout.response(name).dimension for name in layout.names}
    coordinates |= position_coordinates(used, layout.vocabulary)
    if layout.frequency is not None:
        coordinates |= coordinate(layout.frequency, layout.case)
    if layout.gradients:
        units = [
            cf_unit(layout.case.parameter(name).unit) or layout.case.parameter(name).unit
            if has_dimension(layout.case.parameter(name))
            else "1"
            for name in layout.gradients
        ]
        coordinates[PARAMETER] = (PARAMETER, np.array(layout.gradients), {"long_name": "parameter of the case"})
        coordinates[f"{PARAMETER}_unit"] = (PARAMETER, np.array(units), {"long_name": "unit of the parameter"})
    coordinates |= scalar_coordinates(layout.case, layout.case.band)
    return xr.Dataset({}, coordinates, attributes(layout.case, "sweep"))


def position_coordinates(
    used: Collection[str], vocabulary: Vocabulary = HALF_VEHICLE
) -> dict[str, tuple[str, NDArray, dict[str, str]]]:
    """Of the dimensions along which responses are resolved, those in use: (dimension, labels, attributes) by name."""
    return {
        name: (
            name,
            np.array(dimension.labels, dtype=np.int32 if isinstance(dimension.labels[0], int) else None),
            {"long_name": dimension.long_name},
        )
        for name, dimension in vocabulary.dimensions.items()
        if name in used
    }


def label(layout: Layout, values: Mapping[str, NDArray]) -> xr.Dataset:
    """The labelled dataset of a sweep from the numbers of all its variables."""
    described = variables(layout)
    return skeleton(layout).assign(
        {name: (described[name].dims, values[name], described[name].attributes) for name in described}
    )


def _arrange(values: NDArray, swept: list[str], squeeze: bool) -> NDArray:
    """[positions, vehicles..., speeds, rest...] to the dataset's order (axes..., position, rest...)."""
    vehicles = sum(name != "speed" for name in swept)
    if "speed" in swept:
        values = np.moveaxis(values, 1 + vehicles, 1 + swept.index("speed"))
    else:
        values = values[(slice(None),) * (1 + vehicles) + (0,)]
    # not ascontiguousarray, which gives a single point without a position an axis of its own
    return np.asarray(values[0] if squeeze else np.moveaxis(values, 0, len(swept)), order="C")


def coordinate(axis: Axis, case: Case) -> dict[str, tuple[str, NDArray, dict[str, str]]]:
    """A swept parameter of a case as coordinates by name: (dimension, values, attributes with its unit).

    A joint stiffness, which may be infinite, has its finite compliance beside it.
    """
    parameter = case.parameter(axis.name)
    if not has_dimension(parameter):
        described = {"long_name": case.meaning(axis.name), "units": "1"}
        return {axis.name: (axis.name, axis.si, described)}
    values, unit = axis.values, parameter.shown_unit or cf_unit(axis.unit)
    if unit is None and cf_unit(parameter.unit):
        values, unit = axis.si, cf_unit(parameter.unit)
    # a fractional power, as of the contact constant's unit, is none of CF's
    described = {"long_name": case.meaning(axis.name)} | ({"units": unit} if unit else {"user_units": axis.unit})
    found = {axis.name: (axis.name, values, described)}
    if axis.name in COMPLIANCES and case.is_half_vehicle:
        found[COMPLIANCES[axis.name]] = (axis.name, *_compliance(axis.name, values, case.masses))
    return found


def sample_coordinates(case: Case, part: Samples | None = None) -> dict[str, tuple[str, NDArray, dict[str, str]]]:
    """A case's samples as coordinates along `sample` by name: numbers, names, and what is sampled as an axis is.

    part: of the samples, if not all.
    """
    samples = part or case.samples
    if samples is None:
        return {}
    found: dict[str, tuple[str, NDArray, dict[str, str]]] = {
        SAMPLE: (SAMPLE, samples.numbers.astype(np.int32), {"long_name": "sample, a row of the table of samples"})
    }
    if samples.names:
        found[SAMPLE_NAME] = (SAMPLE, np.array(samples.names), {"long_name": "name of the sample"})
    for column in samples.columns:
        for key, (_, values, described) in coordinate(column, case).items():
            found[key] = (SAMPLE, values, described)
    return found


def _compliance(joint: str, stiffness: NDArray, masses: str) -> tuple[NDArray, dict[str, str]]:
    """Values and attributes of a joint's compliance, of its stiffness in MN/m."""
    what = meaning(joint, masses).replace("stiffness", "compliance")
    return 1 / stiffness, {"long_name": f"{what}, the reciprocal of its stiffness", "units": COMPLIANCE_UNIT}


def scalar_coordinates(case: Case, band: Band | None) -> dict[str, tuple[tuple[()], NDArray, dict[str, str]]]:
    """What a case does not sweep, and a band, as scalar coordinates by name: ((), value, attributes with its unit).

    In the SI unit, or in the table's where it shows another, as the axis would be. The whole axis as a band is
    from 0 to inf Hz.
    """
    found: dict[str, tuple[tuple[()], NDArray, dict[str, str]]] = {}
    for name, quantity in case.quantities.items():
        if name in case.varied or (name == "contact_constant" and "contact_stiffness" in case.varied):
            continue
        parameter = case.parameter(name)
        if parameter.shown_unit:
            axis = parse_axis(parameter, quantity.text)  # the very number of an axis
        else:
            axis = Axis(name, np.array([quantity.value]), parameter.unit, np.array([quantity.value]), quantity.text)
        for key, (_, values, described) in coordinate(axis, case).items():
            found[key] = ((), np.array(values[0]), described)
    ends: dict[str, tuple[float, str, str]] = {
        "band_lower_frequency": (0.0, "Hz", "lower limit of the band, frequency"),
        "band_upper_frequency": (math.inf, "Hz", "upper limit of the band, frequency"),
    }
    if band is not None and band.kind == "frequency":
        ends = {name: (end, *ends[name][1:]) for name, end in zip(ends, (band.low, band.high), strict=True)}
    elif band is not None:
        ends = {
            "band_shortest_wavelength": (
                band.low,
                "m",
                "lower limit of the band, wavelength of the track irregularity",
            ),
            "band_longest_wavelength": (
                band.high,
                "m",
                "upper limit of the band, wavelength of the track irregularity",
            ),
        }
    for name, (end, unit, what) in ends.items():
        found[name] = ((), np.array(end), {"long_name": what, "units": unit})
    return found


def vehicle_words(case: Case) -> str:
    """What a case's vehicle is called in attributes."""
    return "the half vehicle" if case.is_half_vehicle else "the vehicle that the case describes"


def attributes(case: Case, command: str) -> dict[str, Any]:
    """Attributes of a whole dataset that `command` makes from a case: CF's, the case itself, versions."""
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    versions = {
        "freqrail": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "xarray": xr.__version__,
    }
    described = {
        "Conventions": "CF-1.11",
        "title": case.title,
        "history": f"{now} freqrail {__version__}: {command} of {case.name}",
        "source": f"freqrail {__version__}, frequency response of {vehicle_words(case)}",
        "references": case.reference,
        "dataset_schema_version": SCHEMA_VERSION,
        "case_name": case.name,
        "case_text": case.text,
        "effective_case": case.effective,
        "effective_case_sha256": hashlib.sha256(case.effective.encode()).hexdigest(),
        "band": band_text(case.band),
        ATTRIBUTE: stored(case.variants) if case.is_half_vehicle else stored_all(case.variants),
        vocabulary.ATTRIBUTE: vocabulary.stored(case.vocabulary),
        "versions": json.dumps(versions),
    }
    return {key: value for key, value in described.items() if value != ""}
