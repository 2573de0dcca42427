"""The numbers at a point of a result, computed anew from the case in its file where its grid lacks it: milliseconds.

So the case's own values can be shown and drawn on any grid, also on a logarithmic one, which never holds them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import xarray as xr

from freqrail.result.points import Place, Point, find_place, layout_of, result_case
from freqrail.sweep import plausibility
from freqrail.sweep.plan import Plan
from freqrail.sweep.sweep import compute

ATTRIBUTE = "computed_anew"
"""Attribute of a dataset computed anew: the swept parameters, with blanks between, whose values the result lacks."""


def find(dataset: xr.Dataset, point: Point | None = None, keep: Sequence[str] = (), origin: str = "--at") -> Place:
    """The numbers at a point of a result, on its grid or off it; see `points.find_place`.

    Values, error estimates and status of all models are in the dataset, whose case is that of the point.
    """
    found = find_place(dataset, point, keep, origin)
    if not found.anew:
        return found
    computed = compute(Plan.for_layout(layout_of(dataset, result_case(found.dataset))))
    return replace(found, dataset=computed.assign_attrs({ATTRIBUTE: " ".join(found.anew)}))


def warned(place: Place) -> list[dict[str, Any]]:
    """What is to be told of a point, as `plausibility.recalled`: its own off the grid, else what the result has."""
    if not place.anew:
        return plausibility.recalled(place.dataset.attrs)
    case = replace(result_case(place.dataset), warnings=place.told)
    return plausibility.recalled({"warnings": plausibility.stored(plausibility.concerns(case), case)})
