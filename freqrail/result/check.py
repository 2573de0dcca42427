"""What a result of `freqrail sweep` must hold: variables, dimensions, units and statuses that fit each other.

A digest tells whether a file is what was written; this tells whether what was written is a result. A dataset
that other hands have cut, renamed or filled and written anew has a digest that matches. No case is read here:
whether the axes are those of the case in the file is for `points.read_result` to say.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from freqrail.case.parameters import JOINTS, SWEEPABLE
from freqrail.model.responses import DIMENSIONS, PREFIXES, RESPONSES
from freqrail.result.axes import swept
from freqrail.result.content import PIECE, pieces

ATTRIBUTES = ("case_name", "effective_case", "band", "source")


def faults(dataset: xr.Dataset) -> list[str]:
    """What keeps a dataset from being a result of a sweep, a line each; none if it is one, or a confirmation."""
    if "verdict_solver" in dataset:  # a confirmation
        return []
    missing = [f"has no attribute {name}" for name in ATTRIBUTES if name not in dataset.attrs]
    missing += [f"has no variable {p}{k}" for p in PREFIXES for k in ("status", "method") if f"{p}{k}" not in dataset]
    missing += (
        []
        if any(f"{name}_rms" in dataset for name in RESPONSES)
        else [f"has no response, such as {next(iter(RESPONSES))}_rms"]
    )
    if missing:
        return missing
    axes = swept(dataset)
    return [*_coordinate_faults(dataset, axes), *_variable_faults(dataset, axes)]


def _coordinate_faults(dataset: xr.Dataset, axes: tuple[str, ...]) -> Iterator[str]:
    for name in axes:
        if name not in SWEEPABLE:
            yield f"status has the dimension {name}, which no sweep has"
        elif name not in dataset.coords:
            yield f"has no coordinate {name}"
    for name, dimension in DIMENSIONS.items():
        if name in dataset.coords and not set(dataset[name].values.tolist()) <= set(dimension.labels):
            yield f"{name} has labels other than {', '.join(map(str, dimension.labels))}"


def _variable_faults(dataset: xr.Dataset, axes: tuple[str, ...]) -> Iterator[str]:
    first_schema = dataset.attrs.get("dataset_schema_version") == 1  # it wrote spectra as "(m s-2)2 Hz-1"
    for prefix in PREFIXES:
        own = axes if not prefix else tuple(name for name in axes if name not in JOINTS)
        for flags in (f"{prefix}status", f"{prefix}method"):
            if dataset[flags].dims != own or "flag_meanings" not in dataset[flags].attrs:
                yield f"{flags} has other dimensions than {', '.join(own) or 'none'}, or no flag_meanings"
                return
        for name, response in RESPONSES.items():
            place = (response.dimension,) if response.dimension else ()
            kinds = {"_rms": response.unit, "_rms_relative_error": "1", "_psd": response.psd_unit}
            former = kinds | ({"_psd": f"({response.unit})2 Hz-1"} if first_schema else {})
            stored = any(f"{p}{name}{kind}" in dataset for p in PREFIXES for kind in kinds)
            for kind, unit in kinds.items():
                variable = f"{prefix}{name}{kind}"
                if variable not in dataset:
                    if stored and (kind != "_psd" or any(f"{p}{name}_psd" in dataset for p in PREFIXES)):
                        yield f"has no variable {variable}"
                    continue
                array = dataset[variable]
                if array.dims != (*own, *place, *(("frequency",) if kind == "_psd" else ())):
                    yield f"{variable} has the dimensions {', '.join(map(str, array.dims)) or 'none'}"
                elif array.attrs.get("units") not in (unit, former[kind]):
                    yield f"{variable} has no unit {unit} (got {array.attrs.get('units', 'none')!r})"
                elif kind != "_psd":
                    wrong = _without_number(array, dataset[f"{prefix}status"])
                    if wrong:
                        yield f"{variable} has no number at {wrong} grid points whose status is ok"


def _without_number(array: xr.DataArray, status: xr.DataArray) -> int:
    """How many grid points are ok by their status and yet lack a number, read in pieces."""
    count = 0
    for piece in pieces(array.shape, PIECE // 8):
        ok = status[piece[: status.ndim]].values == 0
        finite = np.isfinite(array[piece].values).reshape(*ok.shape, -1).all(axis=-1)
        count += int(np.sum(ok & ~finite))
    return count
