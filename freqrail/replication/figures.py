"""Figures of the replication: the paper's figs. 3 to 7 in its layout, and those that explain them.

As in `figures`, nothing is computed here: what is drawn is in the datasets of `studies`. A figure comes with a title
and a caption that says what to look for, never what a dataset happens to show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter, NullLocator, StrMethodFormatter
from numpy.typing import NDArray

from freqrail.case.parameters import JOINTS, PARAMETERS
from freqrail.figures.style import (
    BLUE,
    GREEN,
    ORANGE,
    STYLE,
    TRADITIONAL,
    WHEELS,
    WITH_JOINTS,
    family,
    handle,
    legend,
    new_figure,
    not_too_steep,
    panels,
    save,
)
from freqrail.model.responses import DIMENSIONS, RESPONSES
from freqrail.model.variants import PREFIXES
from freqrail.replication.claims import (
    BOGIE,
    CAR,
    PAPER_POINT,
    PAPER_SPEED,
    PRIMARY,
    PRIMARY_STROKE,
    SECONDARY,
    SECONDARY_STROKE,
)
from freqrail.replication.judging import OTHER_JOINT, PLACES
from freqrail.replication.words import percent
from freqrail.types import Progress

FORMATS = ("svg", "png")

_SHOWN, _CLOSE, _RESPONSES = 10.0, 1.0, 4.0  # s of the histories
_SPEEDS = (100, 150, 200, 250, 300)  # km/h, of the curves against stiffness
_TICKS = (0.5, 1, 2, 5, 10, 20, 50, 100)  # MN/m
_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 1e4, 1e5)  # %, of the map's colours
_MAP_COLOURS = "RdBu_r"
_ALL = (CAR, BOGIE, SECONDARY_STROKE, PRIMARY_STROKE)


@dataclass(frozen=True)
class Picture:
    """A figure of the report: file stem, title, what to see in it, and what draws it."""

    stem: str
    title: str
    caption: str
    draw: Callable[[], Figure]


def pictures(datasets: Mapping[str, Any]) -> list[Picture]:
    """Every figure of the report, in its order; `datasets` as in `studies`."""
    grid, track = datasets["grid"], datasets["track"]
    speed = f"{PAPER_SPEED:g} km/h"
    place = "car body at its centre, front bogie, axle 1"
    return [
        Picture(
            "figure-3",
            f"Fig. 3: track irregularity under the four wheels at {speed}",
            "(a) ten seconds of one record, (b) its first second: four copies of one curve, each later than the one "
            "before by the distance between the wheels over the speed.",
            partial(_track, track),
        ),
        Picture(
            "figure-4",
            f"Fig. 4: responses of both models at {speed}",
            f"Joints of 5 MN/m and rigid ones over the record of fig. 3 ({place}). Look for where the curves part: "
            "slowly (low frequency) or in fast ripples (high frequency).",
            partial(_responses, track),
        ),
        Picture(
            "figure-5",
            "Fig. 5: RMS against speed for the primary joint's stiffness",
            f"Table I for the primary joint, the secondary one at 5 MN/m ({place}). Lines above the dashed one: the "
            "joints make the response larger than rigid joints do.",
            partial(_curves, grid, _ALL, PRIMARY),
        ),
        Picture(
            "figure-6",
            "Fig. 6: RMS accelerations against speed for the secondary joint's stiffness",
            f"Table I for the secondary joint, the primary one at 5 MN/m ({place}). Compare the order of the lines at "
            "either end of the speeds.",
            partial(_curves, grid, (CAR, BOGIE), SECONDARY),
        ),
        Picture(
            "figure-7",
            "Fig. 7: RMS strokes against speed for the secondary joint's stiffness",
            f"As fig. 6. See how fast the lines close up on the dashed one as the joint stiffens ({place}).",
            partial(_curves, grid, (SECONDARY_STROKE, PRIMARY_STROKE), SECONDARY),
        ),
        *(
            Picture(
                f"rms-against-{joint.split('_')[0]}-joint",
                f"RMS against the {joint.split('_')[0]} joint's stiffness",
                f"A colour a speed, the other joint at 5 MN/m, the traditional model's value dashed ({place}). Only "
                "the marks, Table I's stiffnesses, are computed; the lines between guide the eye. Below its dashed "
                "line a joint makes that response smaller than rigid ones do. A lowest mark is the lowest of those "
                "computed, for that response and speed, not the best joint.",
                partial(_against_joint, grid, joint),
            )
            for joint in JOINTS
        ),
        Picture(
            "joint-map",
            f"RMS over both joints' stiffness at {speed}, as departure from the traditional model",
            "Colour: by how many per cent the RMS lies above (red) or below (blue) the traditional model's, in steps "
            "that widen and reach to the largest and the smallest value, which stand above each panel; white is within "
            "1 %. The cross is the paper's vehicle. Blue: that response, at this speed, is smaller than with rigid "
            "joints.",
            partial(_map, datasets["map"]),
        ),
        Picture(
            "cumulative-rms",
            f"Where the vibration lives: RMS up to a frequency at {speed}",
            "Each curve climbs where its response has power and ends at the RMS over the band; the dotted lines are "
            "the corners of the two dampers at 5 MN/m. Where the curves of the two models part is where joints matter.",
            partial(_cumulative, datasets["spectra"], datasets["dampers"]),
        ),
        Picture(
            "dampers",
            "What a damper between joints is: effective damping and dynamic stiffness",
            "Im D/ω and Re D of the damper alone for Table I's joints; circles mark the corner κ/(2πC), where half of "
            "the damping is left. Beyond it the damper acts as a spring of stiffness κ, half that of a joint.",
            partial(_dampers, datasets["dampers"]),
        ),
    ]


def draw_all(found: Sequence[Picture], folder: Path, progress: Progress = lambda figures: None) -> None:
    """Draw every picture into `folder` as SVG and PNG. The same bytes from run to run on the same versions."""
    # after_reset: a matplotlibrc of the user's must not change the bytes
    with matplotlib.style.context(STYLE, after_reset=True):
        for picture in found:
            figure = picture.draw()
            for kind in FORMATS:
                save(figure, folder / f"{picture.stem}.{kind}", picture.title)
            progress(1)


# --- the paper's figures ---------------------------------------------------------------------------


def _track(dataset: xr.Dataset) -> Figure:
    figure = new_figure(4.4)
    time, colours = dataset["time"].values, WHEELS
    for ax, shown, letter in zip(figure.subplots(2, 1), (_SHOWN, _CLOSE), "ab", strict=True):
        kept = time <= shown
        for height, colour in zip(dataset["track_height"], colours, strict=True):
            ax.plot(time[kept], 1e3 * height.values[kept], color=colour, linewidth=0.8)
        ax.set(xlim=(0, shown), xlabel="time [s]", ylabel="track height [mm]", title=f"({letter}) {shown:g} s")
    legend(figure, [Line2D([], [], color=c, label=f"$z_{{v{n}}}$") for n, c in enumerate(colours, start=1)])
    return figure


def _responses(dataset: xr.Dataset) -> Figure:
    figure = new_figure(4.9)
    time = dataset["time"].values
    kept = time <= _RESPONSES
    for name, ax in _panels(figure, _ALL):
        response = RESPONSES[name]
        for prefix, style in _models().items():
            history = _at_place(dataset[f"{prefix}{name}_history"]).values[kept]
            ax.plot(time[kept], response.shown_scale * history, **style, linewidth=0.8)
        ax.set(xlim=(0, _RESPONSES), xlabel="time [s]", ylabel=f"{name.split('_')[-1]} [{response.shown_unit}]")
    legend(figure, _model_handles())
    return figure


def _curves(dataset: xr.Dataset, names: Sequence[str], joint: str) -> Figure:
    figure = new_figure(4.9 if len(names) > 2 else 2.9)
    other = next(name for name in JOINTS if name != joint)
    stiffnesses = dataset[joint].values
    styles = family(len(stiffnesses))
    for name, ax in _panels(figure, names):
        scale = RESPONSES[name].shown_scale
        values = _at_place(dataset[f"{name}_rms"]).sel({other: OTHER_JOINT})
        for stiffness, style in zip(stiffnesses, styles, strict=True):
            ax.plot(dataset["speed"].values, scale * values.sel({joint: stiffness}).values, **style)
        rigid = _at_place(dataset[f"traditional_{name}_rms"]).values
        ax.plot(dataset["speed"].values, scale * rigid, color="black", linestyle="--")
        ax.set(xlabel="speed $v$ [km/h]", ylabel=f"RMS [{RESPONSES[name].shown_unit}]")
    handles = [Line2D([], [], **s, label=f"{k:g} MN/m") for k, s in zip(stiffnesses, styles, strict=True)]
    legend(figure, [*handles, _rigid_handle()], f"${PARAMETERS[joint].symbol}$")
    return figure


# --- published plots -------------------------------------------------------------------------------


def _against_joint(dataset: xr.Dataset, joint: str) -> Figure:
    figure = new_figure(4.9)
    other = next(name for name in JOINTS if name != joint)
    styles = family(len(_SPEEDS))
    for name, ax in _panels(figure, _ALL):
        scale = RESPONSES[name].shown_scale
        values = _at_place(dataset[f"{name}_rms"]).sel({other: OTHER_JOINT})
        rigid = _at_place(dataset[f"traditional_{name}_rms"])
        for speed, style in zip(_SPEEDS, styles, strict=True):
            ax.plot(dataset[joint].values, scale * values.sel(speed=speed).values, **style, linewidth=0.7)
            ax.axhline(scale * float(rigid.sel(speed=speed)), color=style["color"], linestyle="--", linewidth=0.8)
        ax.set(xlabel=_joint_label(joint), ylabel=f"RMS [{RESPONSES[name].shown_unit}]")
        _joint_axis(ax, "x")
        not_too_steep(ax)
    handles = [Line2D([], [], **s, label=f"{v:g} km/h") for v, s in zip(_SPEEDS, styles, strict=True)]
    dashed = Line2D([], [], color="0.4", linestyle="--", linewidth=0.8, label="traditional model")
    legend(figure, [*handles, dashed], "speed $v$")
    return figure


def _map(dataset: xr.Dataset) -> Figure:
    figure = new_figure(5.6)
    x, y = dataset[PRIMARY].values, dataset[SECONDARY].values
    departures = {name: _departure(dataset, name) for name in _ALL}
    levels_of = {name: _widening(d.min(), d.max()) for name, d in departures.items()}
    widest = max(abs(level) for levels in levels_of.values() for level in levels)
    for name, ax in _panels(figure, _ALL):
        departure, levels = departures[name], levels_of[name]
        norm = SymLogNorm(_STEPS[0], vmin=-widest, vmax=widest)  # a colour means the same in every panel
        filled = ax.contourf(x, y, departure, levels=levels, cmap=_MAP_COLOURS, norm=norm)
        ax.contour(x, y, departure, levels=[0.0], colors="black", linewidths=0.7)
        ax.plot(PAPER_POINT[PRIMARY], PAPER_POINT[SECONDARY], "x", color="black", markersize=6, markeredgewidth=1.5)
        ax.set(xlabel=_joint_label(PRIMARY), ylabel=_joint_label(SECONDARY))
        for which in "xy":
            _joint_axis(ax, which)
        ax.grid(False)
        bar = figure.colorbar(filled, ax=ax, label="departure [%]", pad=0.02, ticks=levels, spacing="uniform")
        bar.ax.minorticks_off()
        bar.set_ticklabels([f"{level:+g}".replace("-", "−") for level in levels])
        ax.set_title(f"{ax.get_title()}\n{percent(departure.min() / 100)} to {percent(departure.max() / 100)}")
    cross = Line2D([], [], color="black", marker="x", linestyle="none", markersize=6, label="the paper's vehicle")
    line = Line2D([], [], color="black", linewidth=0.7, label="as in the traditional model")
    legend(figure, [cross, line])
    return figure


def _departure(dataset: xr.Dataset, name: str) -> NDArray[np.float64]:
    """Departure from the traditional model in per cent: [secondary joint, primary joint]."""
    joint, rigid = (_at_place(dataset[f"{p}{name}_rms"]).sel(speed=PAPER_SPEED) for p in PREFIXES)
    return np.asarray((100 * (joint / rigid - 1)).transpose(SECONDARY, PRIMARY).values)


def _cumulative(dataset: xr.Dataset, dampers: xr.Dataset) -> Figure:
    figure = new_figure(4.9)
    frequency = dataset["frequency"].values
    drawn: list[tuple[str, Mapping[str, float], Mapping[str, Any]]] = [
        (f"both joints {k:g} MN/m", dict.fromkeys(JOINTS, k), {"color": colour})
        for k, colour in zip(dataset[PRIMARY].values, (ORANGE, BLUE, GREEN), strict=True)
    ]
    corners = dampers["corner_frequency"].sel(joint_stiffness=OTHER_JOINT).values
    for name, ax in _panels(figure, _ALL):
        scale = RESPONSES[name].shown_scale
        joint, rigid = (_at_place(dataset[f"{p}{name}_cumulative_rms"]).sel(speed=PAPER_SPEED) for p in PREFIXES)
        for _, at, style in drawn:
            ax.plot(frequency, scale * joint.sel(at).values, **style)
        ax.plot(frequency, scale * rigid.values, color="black", linestyle="--")
        for corner in corners:
            ax.axvline(corner, color="0.5", linestyle=":", linewidth=0.9)
        ax.set(xscale="log", xlabel="frequency $f$ [Hz]", ylabel=f"RMS below $f$ [{RESPONSES[name].shown_unit}]")
        ax.set_xlim(frequency[0], frequency[-1])
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.set_ylim(bottom=0)
    handles = [Line2D([], [], **style, label=label) for label, _, style in drawn]
    dotted = Line2D([], [], color="0.5", linestyle=":", linewidth=0.9, label="dampers' corners, 5 MN/m")
    legend(figure, [*handles, _rigid_handle(), dotted], columns=3)
    return figure


def _dampers(dataset: xr.Dataset) -> Figure:
    figure = new_figure(5.0)
    frequency, joints = dataset["frequency"].values, dataset["joint_stiffness"].values
    styles = [{**style, "marker": None} for style in family(len(joints))]
    shown = {
        "effective_damping": ("effective damping Im $D/\\omega$ [kN·s/m]", 1e-3),
        "dynamic_stiffness": ("dynamic stiffness Re $D$ [MN/m]", 1e-6),
    }
    axes = figure.subplots(2, 2, sharex=True)
    letters = iter("abcd")
    for row, (variable, (label, scale)) in zip(axes, shown.items(), strict=True):
        for ax, stage in zip(row, dataset["stage"].values, strict=True):
            one = dataset.sel(stage=stage)
            for joint, style in zip(joints, styles, strict=True):
                values = scale * one[variable].sel(joint_stiffness=joint).values
                corner = float(one["corner_frequency"].sel(joint_stiffness=joint))
                ax.plot(frequency, values, **style)
                if corner <= frequency[-1]:
                    at_corner = np.exp(np.interp(np.log(corner), np.log(frequency), np.log(values)))
                    ax.plot(corner, at_corner, "o", color=style["color"], markersize=4, markerfacecolor="white")
            ax.set_xscale("log")
            ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            if variable == "dynamic_stiffness":
                ax.set(yscale="log", ylim=(1e-4, 100), xlabel="frequency $f$ [Hz]")
                ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            ax.set(ylabel=label, title=f"({next(letters)}) {stage} damper")
    handles = [Line2D([], [], **s, label=f"{k:g} MN/m") for k, s in zip(joints, styles, strict=True)]
    circle = Line2D(
        [], [], color="0.4", marker="o", linestyle="none", markersize=4, markerfacecolor="white", label="corner"
    )
    legend(figure, [*handles, circle], "stiffness of each joint")
    return figure


# --- shared ----------------------------------------------------------------------------------------


def _panels(figure: Figure, names: Sequence[str]) -> list[tuple[str, Axes]]:
    places = [(RESPONSES[name], DIMENSIONS[RESPONSES[name].dimension]) for name in names]
    titles = [f"{response.long_name}, {along.place(PLACES[response.dimension])}" for response, along in places]
    return list(zip(names, panels(figure, titles), strict=True))


def _at_place(values: xr.DataArray) -> xr.DataArray:
    return values.sel({dim: place for dim, place in PLACES.items() if dim in values.dims})


def _models() -> dict[str, dict[str, Any]]:
    return {"traditional_": {**TRADITIONAL, "zorder": 2.5}, "": {**WITH_JOINTS}}


def _model_handles() -> list[Line2D]:
    return [handle(WITH_JOINTS, "joints of 5 MN/m"), _rigid_handle()]


def _rigid_handle() -> Line2D:
    return handle(TRADITIONAL, "traditional model")


def _joint_label(joint: str) -> str:
    return f"{joint.split('_')[0]} joint ${PARAMETERS[joint].symbol}$ [MN/m]"


def _joint_axis(ax: Axes, which: str) -> None:
    ax.set(**{f"{which}scale": "log"})
    axis = ax.xaxis if which == "x" else ax.yaxis
    axis.set_ticks(_TICKS)
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _widening(least: float, most: float) -> list[float]:
    """Levels in per cent, ever further apart away from zero, that hold everything from `least` to `most`."""
    steps = [-step for step in reversed(_STEPS)] + list(_STEPS)
    first = max((k for k, step in enumerate(steps) if step <= least), default=0)
    last = min((k for k, step in enumerate(steps) if step >= most), default=len(steps) - 1)
    return steps[first : last + 1]
