"""What a file of freqrail holds: its schema's number, its variables before they have values, its digest."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from freqrail.case.parameters import COMPLIANCES
from freqrail.result.variants import models_of, owner
from freqrail.result.vocabulary import vocabulary_of

SCHEMA_VERSION = 2
"""Of the datasets written. 2: spectra in "m2 s-4 Hz-1", before "(m s-2)2 Hz-1"; axes in CF's spelling; scalars, band
and compliances as coordinates. Datasets of schema 1 are read as well."""


PIECE = 16_000_000  # bytes of a variable that are read at once while its digest is made


@dataclass(frozen=True)
class Variable:
    """A variable of a sweep before it has values. dtype: numpy's, in the machine's byte order."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: np.dtype
    attributes: dict[str, Any]


def named_coordinates(dataset: xr.Dataset, name: str, dims: Collection[str]) -> list[str]:
    """What CF's `coordinates` attribute of a variable with these dimensions names.

    All coordinates that lie along its dimensions, or none, but those that CF finds by the dimension's name alone.
    Not those of what a variant fixes, such as the joints' of the traditional model, which has none.
    """
    fixed = owner(name, models_of(dataset), vocabulary_of(dataset).responses).fixed
    absent = fixed | {COMPLIANCES[joint] for joint in fixed & {*COMPLIANCES}}
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
