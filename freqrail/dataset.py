"""Labelled results: a sweep as one flat xarray dataset, names and units attached here and nowhere else.

Dimensions are the swept parameters in the order given, none squeezed away, then the position of the
response (car_position, bogie or axle), then frequency. Data are in SI units; `speed` is in km/h, joint
stiffnesses in MN/m, `frequency` in Hz, any other axis in the unit the user wrote. Conventions: CF-1.11.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import math
import os
import platform
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail import __version__, grid
from freqrail.case import Case, load_case
from freqrail.errors import FreqrailWarning, InputError
from freqrail.modal import modes
from freqrail.names import DIMENSIONS, JOINTS, PARAMETERS, RESPONSES, Response, suggestion
from freqrail.quantities import Axis
from freqrail.track import Band, band_limits

SCHEMA_VERSION = 1
PSD_POINTS = 400
COPIES = 3  # how many times a result stands in memory at most, while it is labelled and written
PSD_RANGE = (0.01, 500.0)  # Hz, where no band is given

MODELS = {"": "model with damper joints", "traditional_": "traditional model, rigid damper joints"}
"""Prefix of a model's variables and the words for it."""

# what UDUNITS parses of the units that users write; anything else goes to `user_units`
_UDUNITS = re.compile(r"(?:(?:k|M|G|m|c)?(?:g|m|N|s|Hz|rad)|t|h|min|km|deg)(?:\^-?\d)?")


def sweep(
    case: Case | str | os.PathLike[str],
    over: Mapping[str, str] | None = None,
    settings: Mapping[str, str] | None = None,
    responses: str | Sequence[str] = "paper",
    psd: bool = False,
    jobs: int | None = None,
    progress: Callable[[int], object] = lambda points: None,
) -> xr.Dataset:
    """Response RMS values over the grid of a case, as a labelled dataset.

    case: a `Case`, the path of a case file or the name of a shipped case. over: {"NAME": "AXIS"}, such
    as {"speed": "100:300:10 km/h"}, replaces the case's axis or adds one. settings: {"NAME": "VALUE"} for
    scalars. responses: "paper" (the paper's four), "all", or names of `names.RESPONSES`. psd: store
    spectra too. jobs: threads that work on blocks, as many as processors unless given; they change no bit of the
    result. progress: called with the number of grid points just done.

    Returns a dataset with `<response>_rms` [m/s^2, rad/s^2 or m] over (swept parameters..., position),
    `<response>_rms_relative_error`, `status` and `method` per grid point, the same with the
    prefix `traditional_` without the joint axes, and with `psd` `<response>_psd` [unit^2/Hz].
    A value that could not be computed to 1e-6 is NaN with a status other than 0.

    Raises InputError for a bad case, axis, setting or response name. The RMS is the root of the integral
    over the band of |sum_i H_i e^{-i omega tau_i}|^2 S_v(omega/v)/v (eqs. 2 to 7 and 11).
    """
    if not isinstance(case, Case):
        case = load_case(case, settings, over)
    elif over or settings:
        raise InputError("over and settings go with the path or name of a case: a Case is checked already")
    plan = Plan.of(case, responses, psd)
    _check_memory(plan)
    _warn_of_rigid_rail(case)
    solutions, spectra = {}, {}
    for prefix, study in plan.studies.items():
        solutions[prefix] = grid.solve(study, jobs or grid.processors(), progress)
        if plan.frequency is not None:
            spectra[prefix] = grid.psd(study, plan.frequency.si, progress)
    return _label(plan, solutions, spectra)


@dataclass(frozen=True)
class Plan:
    """What a sweep computes and stores: the numerical studies by model prefix, and the axes of each."""

    case: Case
    names: tuple[str, ...]
    frequency: Axis | None
    studies: Mapping[str, grid.Study]

    @classmethod
    def of(cls, case: Case, responses: str | Sequence[str] = "paper", psd: bool = False) -> Plan:
        """The plan of a checked case. Raises InputError for an unknown response."""
        names = response_names(responses)
        frequency = (case.frequency or _default_frequency(case)) if psd else None
        return cls(
            case=case,
            names=names,
            frequency=frequency,
            studies={
                prefix: grid.Study(
                    vehicle=part.vehicles() if not prefix else part.vehicles().traditional(),
                    speed=part.speeds(),
                    spectrum=part.spectrum,
                    band=part.band,
                    names=names,
                )
                for prefix, part in (("", case), ("traditional_", _without_joints(case)))
            },
        )

    @property
    def points(self) -> int:
        """Number of grid points of the joint model."""
        return math.prod(self.studies[""].shape)

    @property
    def work(self) -> int:
        """Grid points that `progress` is told of in all: both models, spectra counted again."""
        once = sum(math.prod(study.shape) for study in self.studies.values())
        return once * (2 if self.frequency is not None else 1)

    @property
    def stored_bytes(self) -> int:
        """Size of the dataset's numbers in bytes."""
        series = sum(max(1, len(RESPONSES[name].positions)) for name in self.names)
        lines = self.frequency.si.size if self.frequency is not None else 0
        values = sum(math.prod(s.shape) * (8 * series * (2 + lines) + 2) for s in self.studies.values())
        return values + 6_000 * len(self.names) + 2 * len(self.case.text) + 50_000  # what HDF5 and attributes take

    def seconds(self, jobs: int) -> float:
        """Estimated wall time of the sweep in s, from timing a first block of each model."""
        return sum(grid.seconds(study, jobs) for study in self.studies.values())


def _check_memory(plan: Plan) -> None:
    """Raise InputError before anything is allocated that the machine's memory cannot hold."""
    needed = COPIES * plan.stored_bytes
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else math.inf
    if needed > memory:
        raise InputError(
            f"the grid is too large for this machine: {needed / 1e9:.3g} GB needed, {memory / 1e9:.3g} GB of memory; "
            "use fewer values or responses, or leave out the spectra"
        )


def _warn_of_rigid_rail(case: Case) -> None:
    """Warn where the band takes in the wheelsets' resonance on the contact spring, which a real track does not have."""
    try:
        wheelset = max(modes(case.vehicle), key=lambda mode: mode.damped_frequency)
    except InputError:
        return  # numbers that overflow: the points' status says so
    frequency = wheelset.damped_frequency
    reached = case.band is None or band_limits(case.band, case.speeds()).max() > 2 * np.pi * frequency
    if reached:
        warnings.warn(
            f"{case.name}: the band ({band_text(case.band)}) takes in the wheelsets' resonance on the rigid rail, "
            f"{frequency:.0f} Hz with a damping ratio of {wheelset.damping_ratio:.1e}, which no real track has; "
            'to leave it out: --set "frequency=0.1:100 Hz"',
            FreqrailWarning,
            stacklevel=3,
        )


def response_names(responses: str | Sequence[str]) -> tuple[str, ...]:
    """Names of responses from "paper", "all", "NAME,NAME" or a sequence of names, in the table's order."""
    if responses == "paper":
        return tuple(name for name, response in RESPONSES.items() if response.paper)
    if responses == "all":
        return tuple(RESPONSES)
    wanted = [part.strip() for part in responses.split(",")] if isinstance(responses, str) else list(responses)
    unknown = [name for name in wanted if name not in RESPONSES]
    if unknown or not wanted:
        known = ("paper", "all", *RESPONSES)
        raise InputError(*(f"--responses: unknown response {name!r}{suggestion(name, known)}" for name in unknown))
    return tuple(name for name in RESPONSES if name in wanted)


def _without_joints(case: Case) -> Case:
    return replace(case, axes=tuple(axis for axis in case.axes if axis.name not in JOINTS))


def _default_frequency(case: Case) -> Axis:
    """Frequencies of stored spectra: log-spaced over the band, over all speeds' bands if by wavelength."""
    low, high = PSD_RANGE
    if case.band is not None:
        limits = band_limits(case.band, case.speeds()) / (2 * np.pi)
        low, high = float(limits.min()), float(limits.max())
    values = np.geomspace(low, high, PSD_POINTS)
    return Axis("frequency", values, "Hz", values, f"log:{low:g}:{high:g}:{PSD_POINTS} Hz")


def band_text(band: Band | None) -> str:
    """A band in words: "0.1 to 100 Hz", "wavelengths 1 to 200 m" or "whole axis"."""
    if band is None:
        return "whole axis"
    if band.kind == "frequency":
        return f"{band.low:g} to {band.high:g} Hz"
    return f"wavelengths {band.low:g} to {band.high:g} m"


# --- labelling -------------------------------------------------------------------------------------


def _label(
    plan: Plan, solutions: Mapping[str, grid.Solution], spectra: Mapping[str, Mapping[str, NDArray]]
) -> xr.Dataset:
    coordinates: dict[str, Any] = {axis.name: coordinate(axis) for axis in plan.case.axes}
    variables: dict[str, Any] = {}
    used = {RESPONSES[name].dimension for name in plan.names}
    for dimension, (long_name, labels) in DIMENSIONS.items():
        if dimension in used:
            values = np.array(labels, dtype=np.int32 if isinstance(labels[0], int) else None)
            coordinates[dimension] = (dimension, values, {"long_name": long_name})
    if plan.frequency is not None:
        coordinates["frequency"] = coordinate(plan.frequency)
    for prefix, solution in solutions.items():
        case = plan.case if not prefix else _without_joints(plan.case)
        dims = tuple(axis.name for axis in case.axes)
        for name in plan.names:
            response = RESPONSES[name]
            place = (response.dimension,) if response.dimension else ()
            variables[f"{prefix}{name}_rms"] = (
                (*dims, *place),
                _arrange(solution.rms[name], case, response),
                {
                    "units": response.unit,
                    "long_name": f"RMS of the {response.long_name}, {MODELS[prefix]}",
                    "ancillary_variables": f"{prefix}{name}_rms_relative_error {prefix}status {prefix}method",
                },
            )
            variables[f"{prefix}{name}_rms_relative_error"] = (
                (*dims, *place),
                _arrange(solution.relative_error[name], case, response),
                {
                    "units": "1",
                    "long_name": f"estimated relative error of the RMS of the {response.long_name}, {MODELS[prefix]}",
                },
            )
            if prefix in spectra:
                variables[f"{prefix}{name}_psd"] = (
                    (*dims, *place, "frequency"),
                    _arrange(spectra[prefix][name], case, response),
                    {
                        "units": response.psd_unit,
                        "long_name": f"one-sided PSD of the {response.long_name}, {MODELS[prefix]}",
                    },
                )
        for name, meanings, what in (
            ("status", grid.STATUS, "outcome of the computation"),
            ("method", grid.METHOD, "method of the computation"),
        ):
            values = _arrange(getattr(solution, name)[None], case, None)
            variables[f"{prefix}{name}"] = (dims, values, flags(meanings, f"{what}, {MODELS[prefix]}"))
    ordered = sorted(variables, key=lambda key: (key.startswith("traditional_"), "_rms" not in key))
    return xr.Dataset({key: variables[key] for key in ordered}, coordinates, attributes(plan.case, "sweep"))


def coordinate(axis: Axis) -> tuple[str, NDArray, dict[str, str]]:
    """A swept parameter as a coordinate: dimension, values, attributes with its unit."""
    parameter = PARAMETERS[axis.name]
    described = {"long_name": parameter.meaning}
    plain = all(_UDUNITS.fullmatch(part) for part in re.split(r"[*/ ]", axis.unit))
    described["units" if plain else "user_units"] = axis.unit
    return axis.name, axis.values, described


def _arrange(values: NDArray, case: Case, response: Response | None) -> NDArray:
    """[positions, vehicles..., speeds, rest...] to the dataset's order (axes..., position, rest...)."""
    vehicles = sum(axis.name != "speed" for axis in case.axes)
    swept = [axis.name for axis in case.axes]
    if "speed" in swept:
        values = np.moveaxis(values, 1 + vehicles, 1 + swept.index("speed"))
    else:
        values = values[(slice(None),) * (1 + vehicles) + (0,)]
    if response is None or not response.dimension:
        return np.array(values[0])
    return np.array(np.moveaxis(values, 0, len(swept)))


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

    The same for a dataset in memory and for the one read back from its file.
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
            digest.update(np.ascontiguousarray(variable.values, dtype=little).data)
    return digest.hexdigest()


def first_failures(dataset: xr.Dataset) -> list[str]:
    """One line a model that has points without a result: how many, why, and the first of them."""
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
            f"{dim}={float(dataset[dim][i]):g} {dataset[dim].attrs.get('units', '')}".strip()
            for dim, i in zip(status.dims, first, strict=True)
        )
        counts = ", ".join(
            f"{np.sum(values == k)} {meaning}" for k, meaning in enumerate(meanings) if k and np.any(values == k)
        )
        at = f"; the first at {where}" if where else ""
        lines.append(f"{words}: {len(bad)} of {values.size} grid points have no result ({counts}){at}")
    return lines
