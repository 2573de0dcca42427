"""What all figures share: size, colours, panels, legends, and how they are saved."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from freqrail import files
from freqrail.errors import FileError
from freqrail.text import printable

Style = Mapping[str, Any]

FORMATS = ("png", "svg", "pdf")
WIDTH = 7.2  # inches, two columns of a journal
BLUE, ORANGE, GREEN, PINK, VERMILION = "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00"  # Okabe and Ito's
WHEELS = (BLUE, ORANGE, GREEN, PINK)
WITH_JOINTS = {"color": BLUE}
TRADITIONAL = {"color": "black", "linestyle": "--"}
_DASHES = ("--", "-.", ":", (0, (6, 2, 1, 2, 1, 2)))  # of variants; of more they begin anew
MARKERS = "osD^vP<X"
FLATTEST = 0.1  # an RMS axis spans at least this share of its top, so that a flat line looks flat
DEEPEST = 1e-8  # of its top, where a PSD axis ends: below lie only the dips of the wheelbase filter

STYLE = {
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.use_mathtext": True,
    "axes.titlesize": 8,
    "font.size": 8,
    "grid.color": "0.88",
    "grid.linewidth": 0.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.title_fontsize": 8,
    "lines.linewidth": 1.1,
    "lines.markersize": 2.6,
    "pdf.fonttype": 42,
    "svg.hashsalt": "freqrail",  # with no date in the file: the same bytes from run to run
}
"""Settings of matplotlib, with `after_reset=True`: a matplotlibrc of the user's must not change the bytes."""


def new_figure(height: float, gaps: tuple[float, float] = (0.05, 0.05), head: Sequence[str] = ()) -> Figure:
    """A figure two columns wide and `height` inches high, with gaps (across, down) and lines of text at its head."""
    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(wspace=gaps[0], hspace=gaps[1]))
    if head:
        figure.suptitle("\n".join(head), fontsize=8.5)
    return figure


def panels(figure: Figure, titles: Sequence[str], columns: int = 2) -> list[Axes]:
    """A panel a title, lettered, row by row."""
    columns = min(columns, len(titles))
    axes = list(figure.subplots(-(-len(titles) // columns), columns, squeeze=False).flat)
    for spare in axes[len(titles) :]:
        spare.remove()
    for letter, title, ax in zip("abcdefghijklmnopqrstuvwxyz", titles, axes, strict=False):
        ax.set_title(f"({letter}) {title}")
    return axes[: len(titles)]


def variant_styles(count: int) -> list[dict[str, Any]]:
    """Lines of so many variants beside the vehicle's own; the first as `TRADITIONAL`."""
    return [{**TRADITIONAL, "linestyle": _DASHES[k % len(_DASHES)]} for k in range(count)]


def family(size: int) -> list[dict[str, Any]]:
    """Colours and markers for so many lines of one family."""
    colours = colormaps["viridis"](np.linspace(0, 0.88, size))
    return [{"color": colour, "marker": MARKERS[k % len(MARKERS)]} for k, colour in enumerate(colours)]


def not_too_steep(ax: Axes) -> None:
    """Widen an axis of RMS values whose lines hardly change."""
    low, high = ax.get_ylim()
    least = FLATTEST * high
    if high - low < least:
        ax.set_ylim((low + high - least) / 2, (low + high + least) / 2)


def psd_label(unit: str) -> str:
    """Label of an axis of one-sided PSDs of a response shown in `unit`."""
    return f"one-sided PSD [{f'({unit})' if '/' in unit else unit}²/Hz]"


def handle(style: Style, label: str) -> Line2D:
    """An entry of a legend."""
    return Line2D([], [], **style, label=label)


def legend(figure: Figure, handles: Sequence[Line2D], title: str | None = None, columns: int | None = None) -> None:
    """One legend below all panels, in one row unless told otherwise."""
    # "outside": the layout makes room for it, so that it covers no panel
    figure.legend(handles=handles, title=title, loc="outside lower center", ncols=columns or len(handles))


def save(figure: Figure, target: Path, title: str, ready: Callable[[Path], object] = lambda whole: None) -> Path:
    """Write a figure beside its target and put it in the target's place only when it is whole; see `files.replacing`.

    Characters of the title that no SVG file may hold are escaped. Raises FileError if it cannot be written.
    """
    kind = target.suffix[1:]
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})
    try:
        with files.replacing(target, ready) as path:
            figure.savefig(path, format=kind, dpi=200, metadata={"Title": printable(title), **undated})
    except OSError as fault:
        raise FileError(f"{target}: cannot be written: {fault.strerror or fault}") from None
    return target
