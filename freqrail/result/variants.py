"""The models of a result: the vehicle and its variants, as its attribute tells them, and whose a variable is.

A result of the default variants (`variants.DEFAULT`) has no such attribute, so that files from before there were others
are read alike.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Sequence

import xarray as xr

from freqrail.case.parameters import SWEEPABLE
from freqrail.errors import InputError
from freqrail.model.readings import ALWAYS
from freqrail.model.responses import RESPONSES
from freqrail.model.variants import BASE, DEFAULT, ITSELF, Variant
from freqrail.result.vocabulary import vocabulary_of
from freqrail.text import given

ATTRIBUTE = "variants"
"""Attribute of a dataset: its variants in JSON, with "inf" for an infinite number."""

FLAGS = ("status", "method")
"""The variables that each model has one of, beside those of its responses."""

KINDS = ("_rms", "_rms_relative_error", "_psd", "_rms_gradient", "_rms_gradient_error")
"""How the variables of a response end."""


def stored(variants: Sequence[Variant]) -> str:
    """Variants of a half vehicle as the attribute keeps them; "" for the default ones, which need none."""
    return "" if tuple(variants) == DEFAULT else stored_all(variants)


def stored_all(variants: Sequence[Variant]) -> str:
    """Variants as the attribute keeps them."""
    records = [
        {
            "name": variant.name,
            "words": variant.words,
            "values": {name: "inf" if math.isinf(value) else value for name, value in variant.values.items()},
        }
        for variant in variants
    ]
    return json.dumps(records, ensure_ascii=False)


def variants_of(dataset: xr.Dataset) -> tuple[Variant, ...]:
    """The variants of a result or a confirmation. Raises InputError if its attribute says nothing of the kind."""
    text = dataset.attrs.get(ATTRIBUTE)
    if text is None:
        return DEFAULT
    try:
        found = tuple(_variant(record) for record in json.loads(str(text)))
        strange = {name for variant in found for name in variant.values} - {*SWEEPABLE}
        if len({variant.name for variant in found}) < len(found) or (strange and not is_free(dataset)):
            raise ValueError
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise InputError(f"its attribute {ATTRIBUTE} is no list of variants in JSON {given(text)}") from None
    return found


def _variant(record: dict) -> Variant:
    """A variant from its record. Raises ValueError, TypeError, KeyError or AttributeError if it is none."""
    name, words, values = record["name"], record["words"], record["values"]
    right = all(value == "inf" or (type(value) in (int, float) and math.isfinite(value)) for value in values.values())
    if not (
        re.fullmatch("[a-z][a-z0-9_]*", name)
        and isinstance(words, str)
        and all(re.fullmatch("[A-Za-z][A-Za-z0-9_]*", key) for key in values)
        and right
    ):
        raise ValueError
    return Variant(name, words, {key: float(value) for key, value in values.items()})


def models_of(dataset: xr.Dataset) -> tuple[Variant, ...]:
    """The vehicle itself and its variants, in the order of their variables."""
    return (ITSELF if is_free(dataset) else BASE, *variants_of(dataset))


def is_free(dataset: xr.Dataset) -> bool:
    """Whether a result is of a vehicle of the free form."""
    return next(iter(ALWAYS)) in vocabulary_of(dataset).responses


def owner(variable: str, models: Sequence[Variant], responses: Collection[str] = tuple(RESPONSES)) -> Variant:
    """The model that a variable is of; the vehicle itself for one that is no response's. responses: by name."""
    whose = (model for model in models if variable.startswith(model.prefix) and model.name)
    return next((model for model in whose if _is_own(variable.removeprefix(model.prefix), responses)), BASE)


def _is_own(name: str, responses: Collection[str]) -> bool:
    """Whether a name without a prefix is a variable that every model has."""
    return name in FLAGS or any(name.removesuffix(kind) in responses for kind in KINDS if name.endswith(kind))
