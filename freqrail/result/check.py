"""What a result of `freqrail sweep` must hold: variables, dimensions, units, numbers and statuses that fit each other.

A digest tells whether a file is what was written; this tells whether what was written is a result. A dataset
that other hands have cut, renamed or filled and written anew has a digest that matches. No case is read here:
whether the axes are those of the case in the file is for `points.read_result` to say.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.parameters import SWEEPABLE
from freqrail.case.samples import SAMPLE
from freqrail.errors import InputError
from freqrail.model.responses import HALF_VEHICLE, Vocabulary
from freqrail.model.variants import Variant
from freqrail.result.axes import sampled, swept, swept_by
from freqrail.result.content import PIECE, pieces
from freqrail.result.variants import FLAGS, models_of
from freqrail.result.vocabulary import vocabulary_of
from freqrail.solver.solution import METHOD, STATUS, TOLERANCE
from freqrail.text import counted, given

ATTRIBUTES = ("case_name", "effective_case", "band", "source")


def faults(dataset: xr.Dataset) -> list[str]:
    """What keeps a dataset from being a result of a sweep, a line each; none if it is one, or a confirmation."""
    told = _warning_faults(dataset)
    try:
        models = models_of(dataset)
        vocabulary = vocabulary_of(dataset)
    except InputError as fault:
        told += fault.problems
    if told or "verdict_solver" in dataset:  # a confirmation
        return told
    missing = [f"has no attribute {name}" for name in ATTRIBUTES if name not in dataset.attrs]
    flags = [f"{model.prefix}{flag}" for model in models for flag in FLAGS]
    missing += [f"has no variable {flag}" for flag in flags if flag not in dataset]
    missing += (
        []
        if any(f"{name}_rms" in dataset for name in vocabulary.responses)
        else [f"has no response, such as {next(iter(vocabulary.responses), 'stroke')}_rms"]
    )
    if missing:
        return missing
    axes = swept(dataset)
    return [*_coordinate_faults(dataset, axes, vocabulary), *_variable_faults(dataset, models, vocabulary)]


def _coordinate_faults(dataset: xr.Dataset, axes: tuple[str, ...], vocabulary: Vocabulary) -> Iterator[str]:
    for name in axes:
        # those of a free vehicle are its own; `points.read_result` holds them against the case
        if vocabulary == HALF_VEHICLE and name not in (*SWEEPABLE, SAMPLE):
            yield f"status has the dimension {name}, which no sweep has"
        elif name not in dataset.coords:
            yield f"has no coordinate {name}"
        elif dataset[name].dtype.kind not in "iuf" or np.isnan(dataset[name].values).any():
            yield f"{name} holds other values than numbers"
    if SAMPLE in axes and SAMPLE in dataset.coords:
        numbers = dataset[SAMPLE].values
        if numbers.dtype.kind not in "iu" or (numbers < 1).any() or np.unique(numbers).size < numbers.size:
            yield f"{SAMPLE} holds other values than the numbers of samples"
    for name in sampled(dataset):
        if dataset[name].dtype.kind != "f" or np.isnan(dataset[name].values).any():
            yield f"{name} holds other values than numbers"
    if "frequency" in dataset.dims and (
        "frequency" not in dataset.coords or not _is_float(dataset["frequency"]) or np.isnan(dataset["frequency"]).any()
    ):
        yield "frequency holds other values than numbers"
    for name, dimension in vocabulary.dimensions.items():
        if name in dataset.coords:
            found = np.atleast_1d(dataset[name].values).tolist()
            if not set(found) <= set(dimension.labels):
                yield f"{name} has labels other than {', '.join(map(str, dimension.labels))}"
            elif found != [label for label in dimension.labels if label in found]:
                yield f"{name} has its labels in another order than {', '.join(map(str, dimension.labels))}"
        elif name in dataset.dims:
            yield f"has no coordinate {name}"


def _warning_faults(dataset: xr.Dataset) -> list[str]:
    """What is wrong with the attribute of what was warned of (see `plausibility.stored`)."""
    text = dataset.attrs.get("warnings") or "[]"
    try:
        records = json.loads(str(text))
        right = [isinstance(r["text"], str) and isinstance(r["accepted"], bool) for r in records]
    except (ValueError, TypeError, KeyError, RecursionError):
        right = [False]
    return [] if all(right) else [f"its attribute warnings is no list of warnings in JSON {given(text)}"]


def _variable_faults(dataset: xr.Dataset, models: tuple[Variant, ...], vocabulary: Vocabulary) -> Iterator[str]:
    first_schema = dataset.attrs.get("dataset_schema_version") == 1  # it wrote spectra as "(m s-2)2 Hz-1"
    prefixes = [model.prefix for model in models]
    for model in models:
        prefix, own = model.prefix, swept_by(dataset, model)
        unreadable = list(_flag_faults(dataset, prefix, own))
        if unreadable:
            yield from unreadable
            return
        for name, response in vocabulary.responses.items():
            place = (response.dimension,) if response.dimension else ()
            kinds = {"_rms": response.unit, "_rms_relative_error": "1", "_psd": response.psd_unit}
            former = kinds | ({"_psd": f"({response.unit})2 Hz-1"} if first_schema else {})
            stored = any(f"{p}{name}{kind}" in dataset for p in prefixes for kind in kinds)
            for kind, unit in kinds.items():
                variable = f"{prefix}{name}{kind}"
                if variable not in dataset:
                    if stored and (kind != "_psd" or any(f"{p}{name}_psd" in dataset for p in prefixes)):
                        yield f"has no variable {variable}"
                    continue
                array = dataset[variable]
                if array.dims != (*own, *place, *(("frequency",) if kind == "_psd" else ())):
                    yield f"{variable} has the dimensions {', '.join(map(str, array.dims)) or 'none'}"
                elif array.attrs.get("units") not in (unit, former[kind]):
                    yield f"{variable} has no unit {unit} (got {array.attrs.get('units', 'none')!r})"
                elif not _is_float(array):
                    yield f"{variable} holds {_kind(array)}, numbers of 64 bits (float64) are expected"
                else:
                    yield from _number_faults(array, kind, dataset[f"{prefix}status"])


def _flag_faults(dataset: xr.Dataset, prefix: str, axes: tuple[str, ...]) -> Iterator[str]:
    """What is wrong with the statuses and methods of a model."""
    for name, meanings in ((f"{prefix}status", STATUS), (f"{prefix}method", METHOD)):
        flags = dataset[name]
        if flags.dims != axes or "flag_meanings" not in flags.attrs:
            yield f"{name} has other dimensions than {', '.join(axes) or 'none'}, or no flag_meanings"
        elif flags.attrs["flag_meanings"] != " ".join(meanings):
            yield f"{name} has other flag_meanings than {' '.join(meanings)}"
        elif flags.dtype != np.int8:
            yield f"{name} holds {_kind(flags)}, whole numbers of 8 bits (int8) are expected"
        else:
            strange = np.unique(flags.values[(flags.values < 0) | (flags.values >= len(meanings))])
            if strange.size:
                yield f"{name} holds {strange[0]}, which means nothing: 0 to {len(meanings) - 1} are expected"


_EXPECTED: dict[str, tuple[str, Callable[[NDArray], NDArray]]] = {
    "_rms": ("not positive and finite", lambda v: np.isnan(v) | ((v > 0) & (v < np.inf))),
    "_rms_relative_error": (
        f"not above 0 and up to {TOLERANCE:g}",
        lambda v: np.isnan(v) | ((v > 0) & (v <= TOLERANCE)),
    ),
    "_psd": ("", lambda v: np.ones_like(v, dtype=bool)),  # of the deepest dips rounding may leave anything
}
"""By kind of variable, what its numbers may not be, in words, and which of them are right."""


def _number_faults(array: xr.DataArray, kind: str, status: xr.DataArray) -> Iterator[str]:
    """What is wrong with the numbers of a variable, read in pieces."""
    lacking = wrong = 0
    words, is_right = _EXPECTED[kind]
    for piece in pieces(array.shape, PIECE // 8):
        values = array[piece].values
        ok = status[piece[: status.ndim]].values == 0
        # a spectrum may be infinite, where an undamped mode lies beside the band
        has = ~np.isnan(values) if kind == "_psd" else np.isfinite(values)
        lacking += int(np.sum(ok & ~has.reshape(*ok.shape, -1).all(axis=-1)))
        wrong += int(np.sum(~is_right(values)))
    if lacking:
        yield f"{array.name} has no number at {lacking} grid points whose status is ok"
    if wrong:
        yield f"{array.name} has {counted(wrong, 'number')} {words}"


def _is_float(array: xr.DataArray) -> bool:
    return array.dtype == np.float64


def _kind(array: xr.DataArray) -> str:
    return "text" if array.dtype.kind in "OUS" else str(array.dtype)
