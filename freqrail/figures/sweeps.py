"""Figures of a sweep's result, fit for a paper. Nothing is computed here: what is drawn is in a dataset.

A figure has one panel a response, laid out as the paper's figs. 5 to 7, and draws the first stored
position of each: the car body over the front pivot, the front bogie, axle 1. What it keeps fixed stands
above the panels, what its lines mean below them, so that neither covers data. Where it keeps a value that the grid
lacks, the dataset that it draws is computed anew (`freqrail.sweep.off_grid`).
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator, StrMethodFormatter
from numpy.typing import NDArray

from freqrail.case.case import Case
from freqrail.case.parameters import JOINTS, PARAMETERS
from freqrail.case.samples import SAMPLE
from freqrail.figures.style import (
    BLUE,
    DEEPEST,
    MARKERS,
    WITH_JOINTS,
    Style,
    handle,
    legend,
    new_figure,
    not_too_steep,
    panels,
    psd_label,
    variant_styles,
)
from freqrail.figures.style import family as family_styles
from freqrail.model.band import band_limits
from freqrail.model.responses import Response
from freqrail.model.variants import Variant
from freqrail.result.axes import axis_label, axis_unit, grid_axis, sampled, swept, swept_by
from freqrail.result.variants import models_of, variants_of
from freqrail.result.vocabulary import vocabulary_of
from freqrail.sweep.off_grid import ATTRIBUTE

Selection = Mapping[str, int | NDArray[np.intp]]
"""What a figure takes of each swept parameter: one index where it is held, all that it draws otherwise."""

_ROW, _MARGIN = 2.3, 1.2  # inches: a row of panels; caption and legend
_SPEEDS, _LINES = 6, 8  # of more speeds, or more values of another parameter, an even spread is drawn
_MARKED = 30  # a line of at most so many values shows each of them by a marker
_CROWDED = 0.13  # of an axis: its ticks are the grid's own values where these lie further apart than this
_NARROW = 5.0  # a logarithmic axis from 1 to less than this is ticked as a linear one
_DECADES = 20.0  # a span from which an axis of evenly spread ratios is logarithmic
_TICKS = 5  # at most so many steps between ticks: long numbers must not touch
_BAND_END: dict[str, Any] = {"color": "0.4", "linestyle": ":", "linewidth": 0.8}
_RIGID = 0.95  # of a panel's width, where the mark of the rigid joint begins


@dataclass(frozen=True)
class Drawing:
    """A figure: the swept parameters that it draws whole, and the function that draws it, with what this takes last."""

    axes: tuple[str, ...]
    draw: Callable[..., Figure]
    rest: tuple[str | None, ...] = ()


def drawings(dataset: xr.Dataset) -> dict[str, Drawing]:
    """The figures that the axes of a dataset allow, by the stem of their file's name."""
    axes = [name for name in swept(dataset) if dataset.sizes[name] > 1]
    others = [name for name in axes if name != "speed"]
    others.sort(key=lambda name: name == SAMPLE)  # last, as the axes of their own are what is looked for first
    along = [name for name in others if name != SAMPLE or others == axes == [SAMPLE]]
    speed = "speed" if "speed" in axes else None
    drawings: dict[str, Drawing] = {}
    if speed and not others:
        drawings["rms-against-speed"] = Drawing((speed,), _curves, (speed, None))
    for name in others if speed else ():
        drawings[f"rms-against-speed-{name}"] = Drawing(("speed", name), _curves, ("speed", name))
    for name in along:
        drawings[f"rms-against-{name}"] = Drawing((name, *([speed] if speed else [])), _curves, (name, speed))
    for name in along if SAMPLE in others and not speed else ():
        if name != SAMPLE:
            drawings[f"rms-against-{name}-{SAMPLE}"] = Drawing((name, SAMPLE), _curves, (name, SAMPLE))
    for name in along if speed else ():
        if np.isfinite(dataset[name].values).sum() > 1:
            drawings[f"map-speed-{name}"] = Drawing(("speed", name), _map, (name,))
    if stored(dataset, "_psd"):
        drawings["psd"] = Drawing((), _spectra)
    return drawings


# --- the figures -----------------------------------------------------------------------------------


def _curves(dataset: xr.Dataset, case: Case, index: Mapping[str, int], along: str, family: str | None) -> Figure:
    """RMS along one swept parameter, one line a value of `family`, beside the variants."""
    where: dict[str, int | NDArray[np.intp]] = {**index, along: np.arange(dataset.sizes[along])}
    if family:
        where[family] = _spread(dataset.sizes[family], _SPEEDS if family == "speed" else _LINES)
    places = np.atleast_1d(where[family]) if family else np.zeros(1, np.intp)
    variants = variants_of(dataset)
    # a variant has one line for all where the family's parameter does not touch it
    own = [family in swept_by(dataset, variant) for variant in variants]
    x = dataset[along].values
    styles: list[Style] = [*family_styles(len(places))] if family else [{"color": BLUE, "marker": MARKERS[0]}]
    if x.size > _MARKED:
        styles = [{**style, "marker": None} for style in styles]
    dashed: list[list[Style]] = [
        [{**one, "color": style["color"] if each else one["color"], "zorder": 2.5} for style in styles]
        for one, each in zip(variant_styles(len(variants)), own, strict=True)
    ]
    if along == SAMPLE:  # nothing lies between two samples
        styles = [_marks(style, 0) for style in styles]
        for k, variant in enumerate(variants):
            if SAMPLE in swept_by(dataset, variant):
                dashed[k] = [_marks(style, k + 1) for style in dashed[k]]
    order = [name for name in (family, along) if name]
    figure, drawn = _panels(dataset, "_rms", _caption(dataset, case, "_rms", where))
    for response, ax in drawn:
        with_joints = _drawn(dataset, response, "", "_rms", where, order).reshape(len(places), x.size)
        for line, style in zip(with_joints, styles, strict=True):
            _line(ax, x, line, style)
        for variant, each, lines in zip(variants, own, dashed, strict=True):
            values = _drawn(dataset, response, variant.prefix, "_rms", where, order)
            for line, style in zip(values if each else [values], lines, strict=False):
                if np.ndim(line):
                    _line(ax, x, line, style)
                else:
                    ax.axhline(line, **style)
        _name_axis(ax, "x", dataset, along)
        ax.set_ylabel(f"RMS [{response.shown_unit}]")
        not_too_steep(ax)
    grey = {"color": "0.4"}
    models = [
        handle({**lines[0], **(grey if each else {})}, variant.words)
        for variant, each, lines in zip(variants, own, dashed, strict=True)
    ]
    if any(own) or not family:
        models.insert(0, handle(grey if family else styles[0], models_of(dataset)[0].words))
    if np.isinf(x).any():
        mark = {
            "color": "0.4" if family else BLUE,
            "linestyle": "none",
            "marker": "_",
            "markersize": 9,
            "markeredgewidth": 2,
        }
        models.append(handle(mark, "rigid joint, at the right edge"))
    if family:
        labels = _values(dataset, family, places)
        entries = [handle(style, label) for label, style in zip(labels, styles, strict=True)]
        size = dataset.sizes[family]
        some = f" ({len(places)} of {size} values)" if len(places) < size else ""
        _legend(figure, models, entries, f"{_symbol(family) or family.replace('_', ' ')}{some}")
    else:
        _legend(figure, models)
    return figure


def _marks(style: Style, model: int) -> Style:
    """The style of a model's line as marks alone."""
    return {**style, "linestyle": "none", "marker": MARKERS[model % len(MARKERS)]}


def _map(dataset: xr.Dataset, case: Case, index: Mapping[str, int], name: str) -> Figure:
    """RMS over speed and another swept parameter as colours: a cell a grid point, grey where there is no result."""
    finite = np.flatnonzero(np.isfinite(dataset[name].values))
    where: dict[str, int | NDArray[np.intp]] = {**index, "speed": np.arange(dataset.sizes["speed"]), name: finite}
    caption = _caption(dataset, case, "_rms", where, models_of(dataset)[:1])
    if finite.size < dataset.sizes[name]:
        caption.append("the rigid joint is not drawn")
    figure, drawn = _panels(dataset, "_rms", caption)
    for response, ax in drawn:
        _name_axis(ax, "x", dataset, "speed")
        _name_axis(ax, "y", dataset, name)
        cells = ax.pcolormesh(
            _edges(dataset["speed"].values, "speed"),
            _edges(dataset[name].values[finite], name),
            np.ma.masked_invalid(_drawn(dataset, response, "", "_rms", where, (name, "speed"))),
            cmap="viridis",
            rasterized=True,  # as vectors, cells show seams and a fine grid makes a huge file
        )
        ax.grid(False)
        ax.set_facecolor("0.85")
        figure.colorbar(cells, ax=ax, label=f"RMS [{response.shown_unit}]", pad=0.02)
    return figure


def _spectra(dataset: xr.Dataset, case: Case, index: Mapping[str, int]) -> Figure:
    """One-sided PSDs at one grid point, of all models."""
    models = models_of(dataset)
    each: list[Style] = [WITH_JOINTS, *variant_styles(len(models) - 1)]
    styles = {model.prefix: style for model, style in zip(models, each, strict=True)}
    figure, drawn = _panels(dataset, "_psd", _caption(dataset, case, "_psd", index))
    ends = _band_ends(dataset, case, index)
    for response, ax in drawn:
        for end in ends:
            ax.axvline(end, **_BAND_END)
        ax.set_xscale("log")
        ax.set_yscale("log", nonpositive="mask")
        densities = {prefix: _drawn(dataset, response, prefix, "_psd", index, ("frequency",)) for prefix in styles}
        for prefix, density in densities.items():
            ax.plot(dataset["frequency"].values, density, **styles[prefix])
        floor = DEEPEST * max(np.max(density, initial=0.0, where=density < np.inf) for density in densities.values())
        if ax.get_ylim()[0] < floor:
            ax.set_ylim(bottom=floor)
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.set_xlabel("frequency $f$ [Hz]")
        ax.set_ylabel(psd_label(response.shown_unit))
    handles = [handle(styles[model.prefix], model.words) for model in models]
    _legend(figure, [*handles, *([handle(_BAND_END, "ends of the RMS's band at this speed")] if ends else [])])
    return figure


def _band_ends(dataset: xr.Dataset, case: Case, index: Mapping[str, int]) -> list[float]:
    """Ends of the band of the RMS at the speed drawn, Hz, inside the spectra: these cover the bands of all speeds."""
    if case.band is None:
        return []
    speed = case.speed
    if "speed" in dataset.coords:  # swept, or a slice that the caller has cut out
        values = np.atleast_1d(grid_axis(dataset, "speed").si)
        speed = float(values[index.get("speed", 0)])
    frequency = dataset["frequency"].values
    ends = band_limits(case.band, speed) / (2 * np.pi)
    return [float(end) for end in ends if frequency.min() * (1 + 1e-9) < end < frequency.max() * (1 - 1e-9)]


# --- what a figure takes of the dataset ------------------------------------------------------------


def stored(dataset: xr.Dataset, suffix: str) -> list[Response]:
    return [response for name, response in vocabulary_of(dataset).responses.items() if f"{name}{suffix}" in dataset]


def _drawn(
    dataset: xr.Dataset, response: Response, prefix: str, suffix: str, where: Selection, order: Sequence[str] = ()
) -> NDArray[np.float64]:
    """One variable at the first stored position in the shown unit, its dimensions as in `order`."""
    variable = dataset[f"{prefix}{response.name}{suffix}"]
    selected = variable.isel({n: at for n, at in {**where, response.dimension: 0}.items() if n in variable.dims})
    values = selected.transpose(*order, ..., missing_dims="ignore").values
    return values * response.shown_scale ** (2 if suffix == "_psd" else 1)


def _spread(size: int, most: int) -> NDArray[np.intp]:
    """At most so many of `size` places, evenly spread from the first to the last."""
    return np.unique(np.linspace(0, size - 1, min(size, most)).round().astype(np.intp))


def _is_logarithmic(values: NDArray[np.float64], name: str) -> bool:
    """Whether an axis is drawn so: that of a joint stiffness, and any other whose values span decades evenly."""
    some = values[np.isfinite(values)]
    if name in JOINTS or some.size < 3 or some[0] <= 0 or some[-1] < _DECADES * some[0]:
        return name in JOINTS
    steps = np.diff(np.log(some))
    return bool(steps.max() < 3 * steps.min())


def _edges(values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Edges of the cells about grid values, half-way between them as the axis is drawn."""
    there, back = (np.log, np.exp) if _is_logarithmic(values, name) else (np.positive, np.positive)
    centre = there(values)
    middle = (centre[1:] + centre[:-1]) / 2
    return back(np.concatenate([[2 * centre[0] - middle[0]], middle, [2 * centre[-1] - middle[-1]]]))


# --- words -----------------------------------------------------------------------------------------


def _symbol(name: str) -> str:
    if name == SAMPLE:
        return name
    return f"${PARAMETERS[name].symbol}$" if name in PARAMETERS else ""


def _pretty(unit: str) -> str:
    return unit.replace("*", "·").replace("^2", "²").replace("^3", "³")


def _value(dataset: xr.Dataset, name: str, index: int) -> str:
    return _values(dataset, name, [index])[0]


def _values(dataset: xr.Dataset, name: str, places: Sequence[int] | NDArray[np.intp]) -> list[str]:
    """Grid values as labels: three digits, more only where two of them would read alike."""
    if name == SAMPLE:
        return [axis_label(dataset, name, int(place)) for place in places]
    axis = grid_axis(dataset, name)
    values, unit = axis.values[np.asarray(places)], _pretty(axis.unit)
    for digits in range(3, 17):
        labels = ["rigid" if np.isinf(value) else f"{_digits(float(value), digits)} {unit}" for value in values]
        if len(set(labels)) == len(labels):
            break
    return labels


def _digits(value: float, digits: int) -> str:
    """A number in so many significant digits, without an exponent up to ten million."""
    if 1 <= abs(value) < 1e7:
        return f"{round(value, max(0, digits - len(str(int(abs(value)))))):.15g}"
    return f"{value:.{digits}g}"


def _name_axis(ax: Axes, which: str, dataset: xr.Dataset, name: str) -> None:
    """Label an axis with name, symbol and unit; that of a joint stiffness is logarithmic."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    if name == SAMPLE:
        axis.set_label_text(name)
        axis.set_major_locator(MaxNLocator(_TICKS, integer=True, min_n_ticks=1))
        return
    unit = _pretty(axis_unit(dataset, name))
    words = " ".join(filter(None, [name.replace("_", " "), _symbol(name), f"[{unit}]" if unit else ""]))
    axis.set_label_text(words)
    values = dataset[name].values[np.isfinite(dataset[name].values)]
    logarithmic = _is_logarithmic(values, name)
    if logarithmic:
        ax.set(**{f"{which}scale": "log"})
        axis.set_minor_formatter(NullFormatter())
    gaps = np.diff(np.log(values) if logarithmic else values)
    own = values.size > 1 and gaps.min() > _CROWDED * gaps.sum() and all(len(f"{value:g}") <= 5 for value in values)
    if own:
        axis.set_ticks(values)
    elif not logarithmic or values[-1] <= _NARROW * values[0]:
        axis.set_major_locator(MaxNLocator(_TICKS))
    elif values[-1] <= 1000 * values[0]:  # more decades have no room for it
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    else:
        return
    axis.set_minor_locator(NullLocator())
    if logarithmic:
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _caption(
    dataset: xr.Dataset, case: Case, suffix: str, where: Selection, models: Sequence[Variant] = ()
) -> list[str]:
    """What a figure keeps fixed, and how many of the points that it draws lack results.

    models: those drawn; all of them by default.
    """
    held = {}
    swept_once = case.varied & {*map(str, dataset.coords)}
    along_samples = sampled(dataset)
    if SAMPLE in where and np.ndim(where[SAMPLE]) == 0:
        held[SAMPLE] = _value(dataset, SAMPLE, int(where[SAMPLE]))
    usual = [name for name in (*JOINTS, "speed") if name in case.quantities]
    for name in dict.fromkeys([*usual, *(name for name in case.variable if name in swept_once)]):
        if name in along_samples:
            if SAMPLE in held:
                held[name] = _value(dataset, name, int(where[SAMPLE]))
        elif name in where:
            if np.ndim(where[name]) == 0:
                held[name] = _value(dataset, name, int(where[name]))
        elif name in swept_once:  # a slice that the caller has cut out of the result
            held[name] = _value(dataset[[name]].expand_dims(name), name, 0)
        else:
            quantity = case.quantities[name]
            held[name] = "rigid" if np.isinf(quantity.value) else _pretty(quantity.text)
    anew = str(dataset.attrs.get(ATTRIBUTE, "")).split()
    fixed = [
        f"{_symbol(name) or name.replace('_', ' ')} = {text.replace('rigid', '∞ (rigid)')}"
        f"{' (computed anew)' * (name in anew)}"
        for name, text in held.items()
    ]
    # no-break spaces: a long caption is wrapped between its items, not within one
    lines = [", ".join(item.replace(" ", "\N{NO-BREAK SPACE}") for item in [*fixed, f"band: {dataset.attrs['band']}"])]
    for model in models or models_of(dataset):
        values = [_drawn(dataset, response, model.prefix, suffix, where) for response in stored(dataset, suffix)]
        missing = np.any(np.isnan(values), axis=0)
        if missing.any():
            lines.append(f"{model.words}: {missing.sum()} of {missing.size} points lack results (gaps)")
    return lines


# --- panels ----------------------------------------------------------------------------------------


def _panels(dataset: xr.Dataset, suffix: str, caption: Sequence[str]) -> tuple[Figure, Iterator[tuple[Response, Axes]]]:
    """A figure with a titled panel for each stored response, two a row, and its caption above them."""
    responses = stored(dataset, suffix)
    rows = -(-len(responses) // 2)
    head = [line for text in caption for line in textwrap.wrap(text, 100)]
    figure = new_figure(rows * _ROW + _MARGIN, (0.05, 0.03), head)
    titles = [f"{response.long_name}{_place(dataset, response)}" for response in responses]
    return figure, zip(responses, panels(figure, titles), strict=True)


def _place(dataset: xr.Dataset, response: Response) -> str:
    if not response.dimension:
        return ""
    dimension = vocabulary_of(dataset).dimensions[response.dimension]
    return f", {dimension.place(np.ravel(dataset[response.dimension].values)[0])}"


def _line(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64], style: Style) -> None:
    """A line over the finite x; the value at an infinite one, the rigid joint, as a mark at the right edge."""
    finite = np.isfinite(x)
    if np.isnan(y).any():
        style = {**style, "marker": style.get("marker") or "."}  # a point between two gaps shows by its marker alone
    ax.plot(x[finite], y[finite], **style)
    for level in y[~finite]:
        ax.plot([_RIGID, 1], [level, level], color=style["color"], linewidth=2.2, transform=ax.get_yaxis_transform())
    if not finite.all():
        ax.set_xmargin(0.1)  # leaves the mark a place of its own


def _legend(figure: Figure, models: list[Line2D], values: Sequence[Line2D] = (), title: str | None = None) -> None:
    """One legend below all panels: the values in columns of their own, the models in the last one."""
    rows = max(len(models), 2 if len(values) <= 6 else 3) if values else 1
    blank = Line2D([], [], linestyle="none", label=" ")
    handles = [*values, *[blank] * (-len(values) % rows), *models, *[blank] * (-len(models) % rows)]
    legend(figure, handles, title, len(handles) // rows)


# --- files -----------------------------------------------------------------------------------------
