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
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail import solution as the_solution
from freqrail.band import Band, band_text
from freqrail.case import Case
from freqrail.names import COMPLIANCE_UNIT, COMPLIANCES, PARAMETERS, meaning
from freqrail.plan import Plan
from freqrail.quantities import Axis, cf_unit, parse_axis, typed_unit
from freqrail.responses import DIMENSIONS, RESPONSES
from freqrail.version import __version__

SCHEMA_VERSION = 2
"""Of the datasets written. 2: spectra in "m2 s-4 Hz-1", before "(m s-2)2 Hz-1"; axes in CF's spelling; scalars, band
and compliances as coordinates. Datasets of schema 1 are read as well."""
PIECE = 16_000_000  # bytes of a variable that are read at once while its digest is made

MODELS = {"": "model with damper joints", "traditional_": "traditional model, rigid damper joints"}
"""Prefix of a model's variables and the words for it."""


@dataclass(frozen=True)
class Variable:
    """A variable of a sweep before it has values. dtype: numpy's, in the machine's byte order."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: np.dtype
    attributes: dict[str, Any]


def variables(plan: Plan) -> dict[str, Variable]:
    """The variables of a sweep by name, in the order of the file."""
    sizes = {name: len(dimension.labels) for name, dimension in DIMENSIONS.items()}
    if plan.frequency is not None:
        sizes["frequency"] = plan.frequency.si.size
    result: dict[str, Variable] = {}

    def add(prefix: str, key: str, further: tuple[str, ...], dtype: type, attributes: dict[str, Any]) -> None:
        axes = plan.axes(prefix)
        shape = (*(axis.si.size for axis in axes), *(sizes[dimension] for dimension in further))
        dims = (*(axis.name for axis in axes), *further)
        result[prefix + key] = Variable(dims, shape, np.dtype(dtype), attributes)

    for prefix, words in MODELS.items():
        for name in plan.names:
            response = RESPONSES[name]
            place = (response.dimension,) if response.dimension else ()
            meaning = f"RMS of the {response.long_name}"
            add(
                prefix,
                f"{name}_rms",
                place,
                float,
                {
                    "units": response.unit,
                    "long_name": f"{meaning}, {words}",
                    "ancillary_variables": f"{prefix}{name}_rms_relative_error {prefix}status {prefix}method",
                },
            )
            error = {
                "units": "1",
                "long_name": f"estimated relative error of the computation of the {meaning}, {words}; numerical only: "
                "it says nothing of the model or of its data",
            }
            add(prefix, f"{name}_rms_relative_error", place, float, error)
        if plan.frequency is not None:
            for name in plan.names:
                response = RESPONSES[name]
                place = (response.dimension,) if response.dimension else ()
                spectrum = {
                    "units": response.psd_unit,
                    "long_name": f"one-sided PSD of the {response.long_name}, {words}",
                }
                add(prefix, f"{name}_psd", (*place, "frequency"), float, spectrum)
        add(prefix, "status", (), np.int8, flags(the_solution.STATUS, f"outcome of the computation, {words}"))
        add(prefix, "method", (), np.int8, flags(the_solution.METHOD, f"method of the computation, {words}"))
    return result


def arrays(
    plan: Plan, prefix: str, solution: the_solution.Solution, spectra: Mapping[str, NDArray] | None
) -> dict[str, NDArray]:
    """The numbers of a model, or of a part of its grid, by variable and in the order of its dimensions."""
    swept = [axis.name for axis in plan.axes(prefix)]
    result: dict[str, NDArray] = {}
    for name in plan.names:
        squeeze = not RESPONSES[name].dimension
        result[f"{prefix}{name}_rms"] = _arrange(solution.rms[name], swept, squeeze)
        result[f"{prefix}{name}_rms_relative_error"] = _arrange(solution.relative_error[name], swept, squeeze)
        if spectra is not None:
            result[f"{prefix}{name}_psd"] = _arrange(spectra[name], swept, squeeze)
    result[f"{prefix}status"] = _arrange(solution.status[None], swept, True)
    result[f"{prefix}method"] = _arrange(solution.method[None], swept, True)
    return result


def skeleton(plan: Plan) -> xr.Dataset:
    """The coordinates and attributes of a sweep, without its variables."""
    coordinates: dict[str, Any] = {}
    for axis in plan.case.axes:
        coordinates |= coordinate(axis, plan.case.masses)
    coordinates |= position_coordinates({RESPONSES[name].dimension for name in plan.names})
    if plan.frequency is not None:
        coordinates |= coordinate(plan.frequency)
    coordinates |= scalar_coordinates(plan.case, plan.case.band)
    return xr.Dataset({}, coordinates, attributes(plan.case, "sweep"))


def position_coordinates(used: Collection[str]) -> dict[str, tuple[str, NDArray, dict[str, str]]]:
    """Of the dimensions along which responses are resolved, those in use: (dimension, labels, attributes) by name."""
    return {
        name: (
            name,
            np.array(dimension.labels, dtype=np.int32 if isinstance(dimension.labels[0], int) else None),
            {"long_name": dimension.long_name},
        )
        for name, dimension in DIMENSIONS.items()
        if name in used
    }


def label(plan: Plan, values: Mapping[str, NDArray]) -> xr.Dataset:
    """The labelled dataset of a sweep from the numbers of all its variables."""
    described = variables(plan)
    return skeleton(plan).assign(
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


def coordinate(axis: Axis, masses: str = "half") -> dict[str, tuple[str, NDArray, dict[str, str]]]:
    """A swept parameter as coordinates by name: (dimension, values, attributes with its unit).

    A joint stiffness, which may be infinite, has its finite compliance beside it. masses: see `Case`.
    """
    parameter = PARAMETERS[axis.name]
    values, unit = axis.values, parameter.shown_unit or cf_unit(axis.unit)
    if unit is None and cf_unit(parameter.unit):
        values, unit = axis.si, cf_unit(parameter.unit)
    # a fractional power, as of the contact constant's unit, is none of CF's
    described = {"long_name": meaning(axis.name, masses)} | ({"units": unit} if unit else {"user_units": axis.unit})
    found = {axis.name: (axis.name, values, described)}
    if axis.name in COMPLIANCES:
        found[COMPLIANCES[axis.name]] = (axis.name, *_compliance(axis.name, values, masses))
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
    swept = {axis.name for axis in case.axes}
    for name, quantity in case.quantities.items():
        if name in swept or (name == "contact_constant" and "contact_stiffness" in swept):
            continue
        parameter = PARAMETERS[name]
        if parameter.shown_unit:
            axis = parse_axis(parameter, quantity.text)  # the very number of an axis
        else:
            axis = Axis(name, np.array([quantity.value]), parameter.unit, np.array([quantity.value]), quantity.text)
        for key, (_, values, described) in coordinate(axis, case.masses).items():
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


def named_coordinates(dataset: xr.Dataset, name: str, dims: Collection[str]) -> list[str]:
    """What CF's `coordinates` attribute of a variable with these dimensions names.

    All coordinates that lie along its dimensions, or none, but those that CF finds by the dimension's name alone.
    Not the joints' of the traditional model, which has none.
    """
    absent = {*COMPLIANCES, *COMPLIANCES.values()} if name.startswith("traditional_") else set()
    return [
        str(key)
        for key, values in dataset.coords.items()
        if key not in absent and {*values.dims} <= {*dims} and values.dims != (key,)
    ]


def whole(number: int) -> np.int32 | str:
    """A whole number as an attribute: 32 bits, as the classic NetCDF format and R have them, or text beyond."""
    return np.int32(number) if abs(number) <= np.iinfo(np.int32).max else str(number)


def narrowed(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Attributes with each whole number that fits in 32 bits (see `whole`); the digest does not tell them apart."""
    most = np.iinfo(np.int32).max
    return {
        str(key): np.int32(value) if type(value) in (int, np.int64) and abs(value) <= most else value
        for key, value in attributes.items()
    }


def flags(meanings: tuple[str, ...], long_name: str) -> dict[str, Any]:
    """CF attributes of an int8 variable whose values 0, 1, ... have a meaning."""
    return {
        "long_name": long_name,
        "flag_values": np.arange(len(meanings), dtype=np.int8),
        "flag_meanings": " ".join(meanings),
    }


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
        "source": f"freqrail {__version__}, frequency response of the half vehicle",
        "references": case.reference,
        "dataset_schema_version": SCHEMA_VERSION,
        "case_name": case.name,
        "case_text": case.text,
        "effective_case": case.effective,
        "effective_case_sha256": hashlib.sha256(case.effective.encode()).hexdigest(),
        "band": band_text(case.band),
        "versions": json.dumps(versions),
    }
    return {key: value for key, value in described.items() if value != ""}


def content_digest(dataset: xr.Dataset) -> str:
    """SHA-256 over all variables and attributes but `history` and the digest itself, as hex text.

    The same for a dataset in memory and for the one read back from its file, also if that is larger than the memory.
    """
    digest = hashlib.sha256()

    def add(value: object) -> None:
        digest.update(json.dumps(value, sort_keys=True).encode() + b"\n")

    def plain(attributes: Mapping[Any, Any]) -> dict[str, Any]:
        return {str(key): np.asarray(value).tolist() for key, value in attributes.items()}

    add({k: v for k, v in plain(dataset.attrs).items() if k not in ("history", "content_digest")})
    for name in sorted(map(str, dataset.variables)):
        variable = dataset.variables[name]
        text = variable.dtype.kind in "OUS"
        add([name, list(variable.dims), list(variable.shape), plain(variable.attrs)])
        if text:
            add([str(v) for v in variable.values.ravel()])
        else:
            little = variable.dtype.newbyteorder("<")
            add(little.str)
            for piece in pieces(variable.shape, PIECE // little.itemsize):
                digest.update(np.ascontiguousarray(variable[piece].values, dtype=little).data)
    return digest.hexdigest()


def pieces(shape: tuple[int, ...], most: int) -> Iterator[tuple[slice, ...]]:
    """An array cut into pieces of about `most` values, one after the other as they lie in memory."""
    axis = next((k for k in range(len(shape)) if math.prod(shape[k + 1 :]) <= most), len(shape))
    if axis == len(shape):
        yield ()
        return
    step = max(1, most // max(1, math.prod(shape[axis + 1 :])))
    for corner in np.ndindex(shape[:axis]):
        for start in range(0, shape[axis], step):
            yield (*(slice(i, i + 1) for i in corner), slice(start, start + step))


def first_failures(dataset: xr.Dataset) -> list[str]:
    """One line a model that has points without all results: how many, why, and the first of them."""
    lines = []
    for prefix, words in MODELS.items():
        name = f"{prefix}status"
        if name not in dataset:
            continue
        status = dataset[name]
        values = status.values
        bad = np.argwhere(values != 0)
        if not len(bad):
            continue
        meanings = str(status.attrs["flag_meanings"]).split()
        first = tuple(int(i) for i in bad[0])
        where = ", ".join(
            f"{dim}={float(dataset[dim][i]):g} {typed_unit(dataset[dim].attrs.get('units', ''))}".strip()
            for dim, i in zip(status.dims, first, strict=True)
        )
        counts = ", ".join(
            f"{np.sum(values == k)} {meaning}" for k, meaning in enumerate(meanings) if k and np.any(values == k)
        )
        at = f"; the first at {where}" if where else ""
        lines.append(f"{words}: {len(bad)} of {values.size} grid points lack results ({counts}){at}")
    return lines
