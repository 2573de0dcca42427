"""Figures of sensitivities: a tornado of elasticities at a point, and elasticities over the speeds."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from freqrail.case.parameters import PARAMETERS
from freqrail.figures.style import BLUE, VERMILION, family, handle, legend, new_figure, panels
from freqrail.result.axes import point_speed
from freqrail.result.vocabulary import vocabulary_of

SHOWN = 8  # parameters whose lines are drawn, those that matter most
_WIDEST = 34  # characters of a line of a panel's title
LEAST = 0.005  # largest elasticity of a parameter below which a tornado leaves it out


def drawings(dataset: xr.Dataset) -> dict[str, Callable[[], Figure]]:
    """Figures of a dataset of `sensitivity` by name of their files: the tornado, and lines if it has several speeds."""
    result: dict[str, Callable[[], Figure]] = {"sensitivity": partial(tornado, dataset)}
    if dataset.sizes["speed"] > 1:
        result["sensitivity-against-speed"] = partial(lines, dataset)
    return result


def responses_of(dataset: xr.Dataset) -> list[str]:
    """Names of the responses whose elasticities a dataset holds."""
    return [name for name in vocabulary_of(dataset).responses if f"{name}_rms_elasticity" in dataset]


def at_first_label(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Elasticities of a response, [parameter, speed], at the first label of its dimension: the front."""
    found = dataset[f"{name}_rms_elasticity"]
    dimension = vocabulary_of(dataset).responses[name].dimension
    return found.isel({dimension: 0}) if dimension else found


def _title(dataset: xr.Dataset, name: str) -> str:
    vocabulary = vocabulary_of(dataset)
    response = vocabulary.responses[name]
    place = f", {vocabulary.dimensions[response.dimension].words[0]}" if response.dimension else ""
    words = re.sub(r"(?<=\d) (?=m\b)", "\N{NO-BREAK SPACE}", f"{response.long_name}{place}")
    return "\n".join(textwrap.wrap(words, _WIDEST))


def _symbol(name: str) -> str:
    if name in PARAMETERS:
        return f"${PARAMETERS[name].symbol}$"
    for table in ("bodies_", "wheels_", "suspensions_", "outputs_"):
        name = name.removeprefix(table)
    return name.replace("_", " ")


def tornado(dataset: xr.Dataset) -> Figure:
    """Bars of elasticities at the point's speed, the largest on top: one panel a response."""
    names = responses_of(dataset)
    place = point_speed(dataset)
    speed = float(dataset["speed"][place])
    figure = new_figure(
        0.7 + 2.3 * -(-len(names) // 2), head=[str(dataset.attrs["title"]), f"at {speed:g} {dataset['speed'].units}"]
    )
    for ax, name in zip(panels(figure, [_title(dataset, name) for name in names]), names, strict=True):
        values = at_first_label(dataset, name).isel(speed=place).values
        order = [k for k in np.argsort(np.abs(values), kind="stable") if abs(values[k]) >= LEAST]
        ax.barh(range(len(order)), values[order], color=[BLUE if values[k] > 0 else VERMILION for k in order])
        ax.set_yticks(range(len(order)), [_symbol(str(dataset["parameter"].values[k])) for k in order])
        ax.axvline(0.0, color="0.3", linewidth=0.8)
        ax.set_xlabel("% of the RMS for 1 %")
    return figure


def lines(dataset: xr.Dataset) -> Figure:
    """Elasticities over the speeds, of the parameters that matter most in any response."""
    names = responses_of(dataset)
    largest = np.max([np.max(np.abs(at_first_label(dataset, name).values), axis=1) for name in names], axis=0)
    shown = [str(dataset["parameter"].values[k]) for k in np.argsort(-largest, kind="stable")[:SHOWN]]
    styles = [style | {"marker": ""} for style in family(len(shown))]
    figure = new_figure(0.9 + 2.1 * -(-len(names) // 2), head=[str(dataset.attrs["title"])])
    for ax, name in zip(panels(figure, [_title(dataset, name) for name in names]), names, strict=True):
        for parameter, style in zip(shown, styles, strict=True):
            ax.plot(dataset["speed"], at_first_label(dataset, name).sel(parameter=parameter), **style)
        ax.axhline(0.0, color="0.3", linewidth=0.8)
        ax.set_xlabel(f"speed [{dataset['speed'].units}]")
        ax.set_ylabel("elasticity of the RMS [%/%]")
    legend(figure, [handle(style, _symbol(p)) for p, style in zip(shown, styles, strict=True)])
    return figure
