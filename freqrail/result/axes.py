"""The swept parameters of a result and its failures in words, read from its coordinates and statuses alone."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from freqrail.case.axis import Axis
from freqrail.case.parameters import COMPLIANCES, SWEEPABLE
from freqrail.case.quantities import PLAIN, typed_unit, unit_factor
from freqrail.case.samples import SAMPLE
from freqrail.model.variants import Variant
from freqrail.result.variants import models_of

SAMPLE_NAME = "sample_name"
"""Coordinate along the samples, if these have names."""


def swept(dataset: xr.Dataset) -> tuple[str, ...]:
    """The swept parameters of a result, in order."""
    return tuple(str(dim) for dim in dataset["status"].dims)


def swept_by(dataset: xr.Dataset, model: Variant) -> tuple[str, ...]:
    """The swept parameters of one of a result's models, in order; a model that fixes all that is sampled has no
    samples."""
    columns = sampled(dataset)
    gone = {*model.fixed, SAMPLE} if columns and {*columns} <= model.fixed else model.fixed
    return tuple(name for name in swept(dataset) if name not in gone)


def sampled(dataset: xr.Dataset) -> tuple[str, ...]:
    """The parameters that vary along the samples of a result."""
    others = {SAMPLE, SAMPLE_NAME, *COMPLIANCES.values()}
    along = [str(name) for name in dataset.coords if dataset[name].dims == (SAMPLE,) and name not in others]
    known = [name for name in SWEEPABLE if name in along]
    return (*known, *(name for name in along if name not in known))


def sample_names(dataset: xr.Dataset) -> list[str]:
    """The names of a result's samples, or of those at the points of a confirmation; [] if they have none."""
    return [str(name) for name in np.atleast_1d(dataset[SAMPLE_NAME].values)] if SAMPLE_NAME in dataset.coords else []


def grid_axis(dataset: xr.Dataset, name: str) -> Axis:
    """A swept parameter of a result, its values as the coordinate bears them and in SI units."""
    unit = axis_unit(dataset, name)
    values = dataset[name].values
    if name == SAMPLE:
        return Axis(name, values.astype(float), "", values.astype(float), "")
    return Axis(name, values, unit, values * float(unit_factor(unit)[0]), "")


def axis_label(dataset: xr.Dataset, name: str, index: int, digits: int = 6) -> str:
    """A grid value in the coordinate's unit, such as "250 km/h"; "rigid" for an infinite joint stiffness. A sample's
    number with its name, if it has one.

    digits: significant ones of a value that is not whole.
    """
    value = float(dataset[name].values[index])
    if name == SAMPLE:
        names = sample_names(dataset)
        return f"{value:.0f} ({names[index]})" if names else f"{value:.0f}"
    whole = abs(value) < 1e7 and value == round(value)
    return "rigid" if np.isinf(value) else f"{value:{'.0f' if whole else f'.{digits}g'}} {axis_unit(dataset, name)}"


def axis_unit(dataset: xr.Dataset, name: str) -> str:
    """The unit of a coordinate as users type it, such as "kN*s/m"; "" if it has none."""
    attributes = dataset[name].attrs
    unit = typed_unit(str(attributes.get("units", attributes.get("user_units", ""))))
    return "" if unit in PLAIN else unit


def first_failures(dataset: xr.Dataset) -> list[str]:
    """One line a model that has points without all results: how many, why, and the first of them."""
    lines = []
    for model in models_of(dataset):
        name = f"{model.prefix}status"
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
        lines.append(f"{model.words}: {len(bad)} of {values.size} grid points lack results ({counts}){at}")
    return lines


def largest_error(dataset: xr.Dataset) -> float:
    """The largest relative error estimate among all RMS values of a result; nan if there are none."""
    errors = [v.values for k, v in dataset.data_vars.items() if str(k).endswith("_rms_relative_error")]
    return max((float(np.nanmax(e)) for e in errors if np.isfinite(e).any()), default=math.nan)


POINT_SPEED = "point_speed"
"""Attribute of a dataset of elasticities: the speed of the point that is asked for, in the coordinate's unit."""


def point_speed(dataset: xr.Dataset) -> int:
    """Index of the speed of a dataset of elasticities that is nearest to its point's."""
    return int(np.argmin(np.abs(dataset["speed"].values - dataset.attrs[POINT_SPEED])))
