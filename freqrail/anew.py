"""A point that the grid of a result lacks, computed anew from the case in its file: milliseconds.

So the case's own values can be shown and drawn on any grid, also on a logarithmic one, which never holds them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from freqrail.axes import axis_label, grid_axis, swept
from freqrail.campaign import compute
from freqrail.case import Case, build_case
from freqrail.plan import Plan
from freqrail.points import Point, off_grid, result_case
from freqrail.quantities import Axis, unit_factor
from freqrail.responses import RESPONSES

ATTRIBUTE = "computed_anew"
"""Attribute of a dataset computed anew: the swept parameters, with blanks between, whose values the result lacks."""


@dataclass(frozen=True)
class Found:
    """Where the numbers of a point are.

    dataset: the result itself, or one of the same names, units and dimensions that was computed anew. index: place
    along every swept parameter, those kept whole left out. anew: the swept parameters whose value the result's grid
    lacks, none if the numbers are the result's own.
    """

    dataset: xr.Dataset
    index: Mapping[str, int]
    anew: tuple[str, ...]

    @property
    def note(self) -> str:
        """What is not the result's own, in words; "" if nothing."""
        values = [f"{name} = {axis_label(self.dataset, name, self.index[name])}" for name in self.anew]
        return f"computed anew: {', '.join(values)} is not on the result's grid" if values else ""


def find(dataset: xr.Dataset, point: Point | None = None, keep: Sequence[str] = (), origin: str = "--at") -> Found:
    """The numbers at a point of a result, its own or computed anew from its case where the grid does not hold it.

    point: {name: quantity}; a swept parameter left out takes the case's own value, or the axis' only one. keep: swept
    parameters that stay whole axes. origin: what messages call the point.

    Values, error estimates and status of both models are in the dataset, whose case (`points.result_case`) is that of
    the point. Raises InputError for a name that is neither swept nor the case's own value.
    """
    index, off = off_grid(dataset, point, origin)
    off = {name: quantity for name, quantity in off.items() if name not in keep}
    index = {name: i for name, i in index.items() if name not in keep}
    if not off:
        return Found(dataset, index, ())
    case = result_case(dataset)
    over = {name: quantity.text for name, quantity in off.items()}
    for axis in case.axes:
        si = grid_axis(dataset, axis.name).si
        if axis.name in index:
            over[axis.name] = _text(axis, si[[index[axis.name]]])
        elif axis.name in keep and not np.array_equal(si, axis.si):  # a part that the caller has cut out
            over[axis.name] = _text(axis, si)
    found = _computed(dataset, build_case(case.effective, over=over, name=case.name, stray_points=True))
    found.attrs |= {ATTRIBUTE: " ".join(off), **{k: v for k, v in dataset.attrs.items() if k == "warnings"}}
    return Found(found, {name: 0 for name in swept(dataset) if name not in keep}, tuple(off))


def _text(axis: Axis, si: np.ndarray) -> str:
    """Values of an axis as a case has them, in the unit in which it was written."""
    factor = float(unit_factor(axis.unit)[0])
    return f"{', '.join('inf' if np.isinf(value) else f'{value / factor:.15g}' for value in si)} {axis.unit}"


def _computed(dataset: xr.Dataset, case: Case) -> xr.Dataset:
    """The responses, and the spectra at the frequencies, that a result holds, computed for another grid."""
    names = [name for name in RESPONSES if f"{name}_rms" in dataset]
    plan = Plan.of(case, names, psd="frequency" in dataset.dims)
    if plan.layout.frequency is not None:
        values = dataset["frequency"].values
        frequency = replace(plan.layout.frequency, values=values, si=values)
        plan = replace(plan, layout=replace(plan.layout, frequency=frequency))
    return compute(plan)
