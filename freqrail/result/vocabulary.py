"""The responses of a result, as its attribute tells them; without one they are those of the half vehicle."""

from __future__ import annotations

import json

import xarray as xr

from freqrail.errors import InputError
from freqrail.model.responses import HALF_VEHICLE, SHOWN_UNITS, Dimension, Labels, Response, Vocabulary
from freqrail.text import given

ATTRIBUTE = "responses"
"""Attribute of a dataset: its responses and their dimensions in JSON, unless they are the half vehicle's."""


def stored(vocabulary: Vocabulary) -> str:
    """A vocabulary as the attribute keeps it; "" for that of the half vehicle, which needs none."""
    if vocabulary == HALF_VEHICLE:
        return ""
    responses = [
        {
            "name": r.name,
            "symbol": r.symbol,
            "unit": r.unit,
            "dimension": r.dimension,
            "long_name": r.long_name,
            "positions": list(r.positions),
            "paper": r.paper,
        }
        for r in vocabulary.responses.values()
    ]
    dimensions = [
        {"name": name, "long_name": d.long_name, "labels": list(d.labels), "words": list(d.words)}
        for name, d in vocabulary.dimensions.items()
    ]
    return json.dumps({"responses": responses, "dimensions": dimensions}, ensure_ascii=False)


def vocabulary_of(dataset: xr.Dataset) -> Vocabulary:
    """The responses of a result or a confirmation. Raises InputError if its attribute says nothing of the kind."""
    text = dataset.attrs.get(ATTRIBUTE)
    if text is None:
        return HALF_VEHICLE
    try:
        found = json.loads(str(text))
        dimensions = {d["name"]: _dimension(d) for d in found["dimensions"]}
        responses = {r["name"]: _response(r, dimensions) for r in found["responses"]}
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise InputError(f"its attribute {ATTRIBUTE} is no table of responses in JSON {given(text)}") from None
    return Vocabulary(responses, dimensions)


def _dimension(record: dict) -> Dimension:
    """A dimension from its record. Raises ValueError, TypeError or KeyError if it is none."""
    labels, words = tuple(record["labels"]), tuple(record["words"])
    alike = all(type(label) is str for label in labels) or all(type(label) is int for label in labels)
    if not (labels and alike and len(words) == len(labels) and all(isinstance(each, str) for each in words)):
        raise ValueError
    return Dimension(str(record["long_name"]), labels, words)


def _response(record: dict, dimensions: dict[str, Dimension]) -> Response:
    """A response from its record. Raises ValueError, TypeError or KeyError if it is none."""
    dimension = record["dimension"]
    positions: Labels = tuple(record["positions"])
    if record["unit"] not in SHOWN_UNITS or (dimension and positions != dimensions[dimension].labels):
        raise ValueError
    return Response(
        str(record["name"]),
        str(record["symbol"]),
        record["unit"],
        dimension,
        str(record["long_name"]),
        positions if dimension else (),
        bool(record["paper"]),
    )
