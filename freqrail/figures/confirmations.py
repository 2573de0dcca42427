"""Figures of a confirmation: time histories as the paper's figs. 3 and 4, spectra, and what the checks found.

As in `figures`, which calls this, nothing is computed here and the first position of each response is drawn: the car
body over the front pivot, the front bogie, axle 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter
from numpy.typing import NDArray

from freqrail.figures.style import (
    BLUE,
    DEEPEST,
    GREEN,
    ORANGE,
    PINK,
    VERMILION,
    WHEELS,
    WITH_JOINTS,
    legend,
    new_figure,
    panels,
    psd_label,
    variant_styles,
)
from freqrail.result.confirmation import band_note, confirmed_names, is_anew, relative
from freqrail.result.variants import models_of
from freqrail.result.verdicts import FAILED, OUTSIDE
from freqrail.result.vocabulary import vocabulary_of

_CLOSE, _SHOWN = 1.0, 5.0  # s: of the histories, where the wheels' lags are to be seen, and otherwise
_COUNTS = {2: "two", 3: "three", 4: "four", 6: "six", 8: "eight"}
_PANELS_A_ROW, _POINTS_A_FIGURE = 3, 9
_COLOURS = (BLUE, "black", GREEN, PINK, ORANGE)  # of the vehicle itself and of its variants; of more they begin anew
_SMALLEST = 1e-14  # solver errors below this are rounding, and drawn there
_DOTS: dict[str, Any] = {
    "marker": "o",
    "markersize": 2.2,
    "markerfacecolor": "none",
    "markeredgewidth": 0.5,
    "linestyle": "none",
}
"""Simulated spectra: open, so that a model's dots do not cover the other's."""
_APART = 0.36  # of a row, between the first model's bars and the last one's, so that they do not cover each other


def drawings(dataset: xr.Dataset, point: int | None = None) -> dict[str, Callable[[], Figure]]:
    """The figures of a confirmation by the stem of their file's name; of one point (from 0), or of all."""
    chosen = range(dataset.sizes["point"]) if point is None else [point]
    found: dict[str, Callable[[], Figure]] = {}
    pages = [chosen[i : i + _POINTS_A_FIGURE] for i in range(0, len(chosen), _POINTS_A_FIGURE)]
    for n, page in enumerate(pages, start=1):
        tail = f"-{n}" if len(pages) > 1 else ""
        found[f"confirmation{tail}"] = partial(_intervals, dataset, page)
        found[f"solver-error{tail}"] = partial(_differences, dataset, page, "solver")
        found[f"kernel-difference{tail}"] = partial(_differences, dataset, page, "kernel")
    for i in chosen:
        label = f"point-{i + 1}"
        found[f"track-{label}"] = partial(_track, dataset, i)
        found[f"responses-{label}"] = partial(_responses, dataset, i)
        found[f"psd-{label}"] = partial(_spectra, dataset, i)
    return found


# --- time histories and spectra of one point -------------------------------------------------------


def _track(dataset: xr.Dataset, point: int) -> Figure:
    """The track at the wheels (the paper's fig. 3), and a second of it, where the lags show."""
    one = dataset.isel(point=point)
    wheels = str(one["lag"].dims[0])
    dimension = vocabulary_of(dataset).dimensions[wheels]
    words = [dimension.place(label) for label in one[wheels].values]
    colours = [WHEELS[k % len(WHEELS)] for k in range(len(words))]
    all_of_them = f"the {_COUNTS.get(len(words), len(words))} wheels" if len(words) > 1 else "the wheel"
    figure = _figure(4.2, dataset, point, "track irregularity of record 0")
    for ax, span, letter in zip(figure.subplots(2, 1), (_SHOWN, _CLOSE), "ab", strict=True):
        kept = one["time"].values <= span
        for wheel, colour in enumerate(colours):
            height = one["track_height"].isel({wheels: wheel}).values
            ax.plot(one["time"].values[kept], 1e3 * height[kept], color=colour)
        ax.set_xlim(0, span)
        ax.set(xlabel="time [s]", ylabel="track height [mm]", title=f"({letter}) under {all_of_them}, {span:g} s")
    legend(figure, [Line2D([], [], color=c, label=name) for name, c in zip(words, colours, strict=True)])
    return figure


def _responses(dataset: xr.Dataset, point: int) -> Figure:
    """The four responses in time, both models together (the paper's fig. 4)."""
    one = dataset.isel(point=point)
    kept = one["time"].values <= _SHOWN
    figure = _figure(_panels_height(dataset), dataset, point, "simulated responses to record 0")
    for name, ax in _panels(figure, dataset):
        response = vocabulary_of(dataset).responses[name]
        for model, style in _line_styles(dataset).items():
            history = _first(one[f"{name}_history"], response.dimension, model)
            ax.plot(one["time"].values[kept], response.shown_scale * history[kept], **style)
        ax.set_xlim(0, _SHOWN)
        ax.set(xlabel="time [s]", ylabel=f"{name.split('_')[-1]} [{response.shown_unit}]")
    words = _words(dataset)
    legend(figure, [Line2D([], [], **style, label=words[model]) for model, style in _line_styles(dataset).items()])
    return figure


def _spectra(dataset: xr.Dataset, point: int) -> Figure:
    """PSDs of the simulated responses as dots over the analytic ones."""
    one, colours = dataset.isel(point=point), _colours(dataset)
    figure = _figure(
        _panels_height(dataset),
        dataset,
        point,
        "spectra: lines by frequency responses, dots by simulation (record 0)",
    )
    for name, ax in _panels(figure, dataset):
        response = vocabulary_of(dataset).responses[name]
        top = 0.0
        for m, (model, colour) in enumerate(colours.items()):
            scale = response.shown_scale**2
            analytic, simulated = (
                scale * _first(one[f"{name}_psd_{side}_domain"], response.dimension, model)
                for side in ("frequency", "time")
            )
            ax.plot(one["frequency"].values, analytic, color=colour, linewidth=0.8)
            # every second line of either of two models, so that the curves stay visible
            dots = slice(m, None, len(colours))
            ax.plot(one["frequency"].values[dots], simulated[dots], **_DOTS, color=colour)
            top = max(top, float(np.nanmax(analytic)))
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylim(bottom=max(ax.get_ylim()[0], DEEPEST * top))
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.set(xlabel="frequency $f$ [Hz]", ylabel=psd_label(response.shown_unit))
    both = _DOTS | {"linestyle": "-", "linewidth": 0.8}
    handles = [Line2D([], [], **both, color=colours[m], label=words) for m, words in _words(dataset).items()]
    legend(figure, handles)
    return figure


def _line_styles(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """By model; variants thin and on top, so that all are seen where they agree."""
    own, *variants = _words(dataset)
    thin = [{**style, "linewidth": 0.6} for style in variant_styles(len(variants))]
    return {own: {**WITH_JOINTS, "linewidth": 1.3}, **dict(zip(variants, thin, strict=True))}


def _words(dataset: xr.Dataset) -> dict[str, str]:
    """The models of a confirmation, by the label of the dimension, in words."""
    known = {model.name: model.words for model in models_of(dataset)}
    return {str(label): known.get(str(label), known[""]) for label in dataset["model"].values}


def _colours(dataset: xr.Dataset) -> dict[str, str]:
    """The models' colours, by the label of the dimension."""
    return {label: _COLOURS[m % len(_COLOURS)] for m, label in enumerate(_words(dataset))}


def _offset(dataset: xr.Dataset, model: int) -> float:
    """Where in a row the bars of a model stand."""
    last = dataset.sizes["model"] - 1
    return _APART * (model / last - 0.5) if last else 0.0


def _first(variable: xr.DataArray, dimension: str, model: str) -> np.ndarray:
    return variable.isel({dimension: 0} if dimension else {}).sel(model=model).values


def _panels(figure: Figure, dataset: xr.Dataset) -> list[tuple[str, Axes]]:
    """A panel a response that was confirmed, two in a row."""
    names, vocabulary = confirmed_names(dataset), vocabulary_of(dataset)
    titles = []
    for name in names:
        response = vocabulary.responses[name]
        dimension = vocabulary.dimensions.get(response.dimension)
        titles.append(response.long_name + (f", {dimension.words[0]}" if dimension else ""))
    return list(zip(names, panels(figure, titles), strict=True))


def _panels_height(dataset: xr.Dataset) -> float:
    """Height of a figure with a panel a response, inches."""
    return 0.8 + 2.5 * -(-len(confirmed_names(dataset)) // 2)


# --- what the checks found -------------------------------------------------------------------------


def _intervals(dataset: xr.Dataset, points: Sequence[int]) -> Figure:
    """Simulated RMS relative to the frequency domain's, with the intervals that are reported and that decide."""
    values = {
        key: 100 * relative(dataset, key)
        for key in ("pooled", "interval_low", "interval_high", "verdict_low", "verdict_high")
    }
    figure, rows = _rows(dataset, points, "simulated RMS against the frequency domain's (line at 0)")
    for place, ax in rows:
        ax.axvline(0, color="0.35", linewidth=0.8)
        for m, colour in enumerate(_colours(dataset).values()):
            y = np.arange(dataset.sizes["series"]) + _offset(dataset, m)
            at = {key: array[place, m] for key, array in values.items()}
            ax.hlines(y, at["verdict_low"], at["verdict_high"], color=colour, linewidth=0.7)
            ax.hlines(y, at["interval_low"], at["interval_high"], color=colour, linewidth=2.4)
            outside = _outside(dataset, "statistical", place, m)
            ax.plot(at["pooled"][~outside], y[~outside], "o", color="white", markeredgecolor=colour, ms=3.5)
            ax.plot(at["pooled"][outside], y[outside], "X", color=VERMILION, markersize=5)
        ax.set_xlabel("difference of the RMS [%]")
    marked = _any_outside(dataset, "statistical", points)
    bars = "bars: 95 % interval, thin lines: the simultaneous interval that decides"
    _checked_legend(figure, dataset, bars, marked, "-")
    return figure


_DIFFERENCES = {
    "solver": ("solver_error", "largest difference of a simulated record from its own line spectrum"),
    "kernel": ("kernel_difference", "RMS over the continuous spectrum against the line spectrum of record 0"),
}


def _differences(dataset: xr.Dataset, points: Sequence[int], check: str) -> Figure:
    """What the solver or the kernel check found for every series, and what it allows."""
    variable, what = _DIFFERENCES[check]
    shape = dataset[variable].shape
    allowed = dataset[f"{check}_tolerance"].values
    allowed = np.broadcast_to(allowed[None, :, None] if allowed.ndim == 1 else allowed, shape)
    errors = np.maximum(np.abs(dataset[variable].values), _SMALLEST)
    figure, rows = _rows(dataset, points, what)
    for place, ax in rows:
        ax.set_xscale("log")
        for m, colour in enumerate(_colours(dataset).values()):
            y = np.arange(dataset.sizes["series"]) + _offset(dataset, m)
            outside = _outside(dataset, check, place, m)
            ax.plot(errors[place, m][~outside], y[~outside], "o", color=colour, markersize=3.5)
            ax.plot(errors[place, m][outside], y[outside], "X", color=VERMILION, markersize=5)
            ax.plot(allowed[place, m], y, "|", color=colour, markersize=6)
        least = np.nanmin(errors[points], initial=1.0) / 2
        ax.set_xlim(least, 3 * max(float(np.nanmax(allowed[points])), float(np.nanmax(errors[points], initial=0.0))))
        ax.xaxis.set_major_locator(LogLocator(numticks=5))
        ax.xaxis.set_minor_locator(NullLocator())
        ax.set_xlabel("relative difference of the RMS")
    marked = _any_outside(dataset, check, points)
    _checked_legend(figure, dataset, "dashes: the largest difference allowed", marked, "none")
    return figure


def _outside(dataset: xr.Dataset, check: str, point: int, model: int) -> NDArray[np.bool_]:
    """Which series a check says "outside" or "failed" of: [series]."""
    return np.isin(dataset[f"verdict_{check}"].values[point, model], (OUTSIDE, FAILED))


def _any_outside(dataset: xr.Dataset, check: str, points: Sequence[int]) -> bool:
    models = range(dataset.sizes["model"])
    return any(bool(_outside(dataset, check, place, m).any()) for place in points for m in models)


def _rows(dataset: xr.Dataset, points: Sequence[int], what: str) -> tuple[Figure, list[tuple[int, Axes]]]:
    """A panel a point, a row a series."""
    columns = min(_PANELS_A_ROW, len(points))
    rows = -(-len(points) // columns)
    figure = _figure((0.9 + 0.22 * dataset.sizes["series"]) * rows + 0.9, dataset, None, what)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for spare in axes.ravel()[len(points) :]:
        spare.remove()
    drawn = list(zip(points, axes.ravel(), strict=False))
    labels = [str(label).replace("_", " ") for label in dataset["series"].values]
    for place, ax in drawn:
        ax.set_yticks(np.arange(len(labels)), labels)
        ax.set_ylim(len(labels) - 0.5, -0.5)
        ax.set_title("\n".join(_place(dataset, place).split(", ")), fontsize=7)
    return figure, drawn


def _checked_legend(
    figure: Figure, dataset: xr.Dataset, note: str, outside: bool, linestyle: Literal["-", "none"]
) -> None:
    """A legend of the marks that there are. outside: whether any is; linestyle: of the bars through the marks."""
    marks = [
        Line2D([], [], color=colour, marker="o", markersize=3.5, linestyle=linestyle, label=words)
        for colour, words in zip(_colours(dataset).values(), _words(dataset).values(), strict=True)
    ]
    if outside:
        marks.append(Line2D([], [], color=VERMILION, marker="X", linestyle="none", markersize=5, label="outside"))
    legend(figure, marks, note)


# --- words and layout ------------------------------------------------------------------------------


def _place(dataset: xr.Dataset, point: int) -> str:
    """A point in words; one that the result's grid lacks says that it was computed anew."""
    anew = ", (computed anew)" if is_anew(dataset, point) else ""
    return str(dataset["place"].values[point]).replace("_", " ") + anew


def _figure(height: float, dataset: xr.Dataset, point: int | None, what: str) -> Figure:
    where = "" if point is None else _place(dataset, point).replace(", (", " (")
    return new_figure(height, (0.04, 0.04), [*filter(None, [what, where]), band_note(dataset)])
