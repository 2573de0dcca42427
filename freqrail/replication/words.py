"""Ratios in per cent with their places, and places as ranges: the numbers of a judgement as text."""

from __future__ import annotations

import numpy as np
import xarray as xr

_UNITS = {"speed": " km/h", "stiffness": " MN/m"}
_FEWER = 0.5  # share of points up to which those where a statement is true are named, not the others


def percent(value: float, signed: bool = True) -> str:
    """A ratio in per cent, two significant digits below ten."""
    number = 100 * value
    digits = 0 if abs(number) >= 99.5 else 1 if abs(number) >= 0.95 else 2
    return f"{number:{'+' if signed else ''}.{digits}f} %".replace("-", "−")


def whole(limit: float) -> str:
    """A limit of this module in per cent, as it was chosen."""
    return f"{100 * limit:g} %"


def extent(values: xr.DataArray, signed: bool = True) -> str:
    """Smallest and largest of `values` in per cent, each with its place."""
    if not bool(values.notnull().any()):
        return "no number"
    if values.size == 1:
        return percent(float(values), signed)
    return f"{extreme(values, 'min', signed)} to {extreme(values, 'max', signed)}"


def extreme(values: xr.DataArray, which: str, signed: bool = True) -> str:
    """The "min" or "max" of `values` in per cent with its place."""
    if not bool(values.notnull().any()):
        return "none"
    at = place(values, which)
    return percent(float(getattr(values, which)()), signed) + (f" ({at})" if at else "")


def place(values: xr.DataArray, which: str) -> str:
    """Where `values` have their "min" or "max"."""
    if not bool(values.notnull().any()):
        return "no number"
    flat = {"min": np.nanargmin, "max": np.nanargmax}[which](values.values)
    index = np.unravel_index(flat, values.shape)
    return ", ".join(label(values, str(dim), int(i)) for dim, i in zip(values.dims, index, strict=True))


def label(values: xr.DataArray, dim: str, index: int) -> str:
    value = values[dim].values[index]
    return f"{value:g}{_UNITS[dim]}" if dim in _UNITS else str(value).replace("_", " ")


def at_speed(values: xr.DataArray, index: int) -> str:
    return label(values, "speed", index)


def where(true: xr.DataArray, counted: xr.DataArray) -> str:
    """Where a statement is true, in words: speeds by stiffness or response; the exceptions where those are fewer."""
    found, points = int(true.sum()), int(counted.sum())
    if found == points:
        return "at every point"
    if not found:
        return "nowhere"
    words = _regions(true) if found <= _FEWER * points else f"all but {_regions(~true & counted)}"
    return f"at {found} of {points}: {words}"


def _regions(true: xr.DataArray) -> str:
    """Points as text, rows with the same speeds together."""
    rows = [str(dim) for dim in true.dims if dim != "speed"]
    if not rows:
        return _ranges(true)
    if len(rows) > 1:  # too many to name each
        counts = true.sum([dim for dim in true.dims if dim != rows[0]])
        labels = (f"{label(true, rows[0], i)} at {int(n)}" for i, n in enumerate(counts.values) if n)
        return "; ".join(labels)
    by_speeds: dict[str, list[str]] = {}
    for i in range(true.sizes[rows[0]]):
        line = true.isel({rows[0]: i})
        if bool(line.any()):
            by_speeds.setdefault(_ranges(line) if line.ndim else "", []).append(label(true, rows[0], i))
    # the unit once: "1, 5 MN/m" rather than "1 MN/m, 5 MN/m"
    groups = {speeds: _listed(labels) for speeds, labels in by_speeds.items()}
    return "; ".join(f"{labels} at {speeds}" if speeds else labels for speeds, labels in groups.items())


def _listed(labels: list[str]) -> str:
    *first, last = labels
    return f"{', '.join(label.removesuffix(_UNITS['stiffness']) for label in first)} and {last}" if first else last


def _ranges(line: xr.DataArray) -> str:
    """The speeds at which `line` is true, as ranges."""
    values = line["speed"].values
    if bool(line.all()):
        return "all speeds"
    true = np.concatenate([[False], line.values.astype(bool), [False]])
    edges = np.flatnonzero(np.diff(true.astype(int)))
    pairs = zip(edges[::2], edges[1::2] - 1, strict=True)
    texts = [f"{values[a]:g}" if a == b else f"{values[a]:g}-{values[b]:g}" for a, b in pairs]
    return f"{', '.join(texts)} km/h"
