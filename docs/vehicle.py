"""docs/vehicle.svg: (a) the paper's half vehicle, (b) any vehicle, (c) a leg's law as a tree.

Drawn by `python -m docs.theory drawing`. Schematic, not to scale. Front is on the right: x counts forward, z upwards.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyBboxPatch, Rectangle

INK, BODY, WHEEL, TRACK, FREEDOM = "0.15", "#dce8f2", "#f3e6d3", "#8c5a2b", "#0b5fa5"
LINE = {"color": INK, "linewidth": 1.1, "solid_capstyle": "round"}
PIVOT, AXLE = 5.4, 1.9  # L_c and L_t as drawn


def figure() -> Figure:
    """The drawing, not yet written."""
    sheet = Figure(figsize=(10, 9.4))
    top = sheet.add_axes((0.01, 0.46, 0.98, 0.53))
    left = sheet.add_axes((0.01, 0.01, 0.62, 0.43))
    right = sheet.add_axes((0.64, 0.01, 0.35, 0.43))
    half_vehicle(top)
    any_vehicle(left)
    law(right)
    for axes in (top, left, right):
        axes.set_aspect("equal")
        axes.axis("off")
    return sheet


def draw(path: Path) -> None:
    """Write the drawing, letters as outlines, so that it looks alike everywhere; the same bytes each time."""
    with rc_context({"svg.fonttype": "path", "svg.hashsalt": "freqrail"}):
        figure().savefig(path, metadata={"Date": None, "Creator": None})


# --- (a) -----------------------------------------------------------------------------------------------


def half_vehicle(axes: Axes) -> None:
    axes.set(xlim=(-10.3, 10.3), ylim=(-3.0, 8.4))
    title(axes, -10.1, 8.0, "(a) the paper's half vehicle, one side on one rail")
    box(axes, -8.3, 5.5, 16.6, 1.3, BODY)
    say(axes, -7.3, 6.15, "$M_c,\\ J_c$")
    freedom(axes, 0.0, 6.15, "$z_c$", "$\\beta_c$", 0.75)
    for side, bogie, axles in ((1, "1", ("1", "2")), (-1, "2", ("3", "4"))):
        x = side * PIVOT
        box(axes, x - 2.5, 3.0, 5.0, 0.85, BODY)
        say(axes, x - 1.75, 3.42, "$M_t,\\ J_t$", size=9)
        freedom(axes, x, 3.4, f"$z_{{t{bogie}}}$", f"$\\beta_{{t{bogie}}}$", 0.42)
        leg(axes, x, 3.85, 5.5, "s", labels=True)
        for place, number in zip((x + AXLE, x - AXLE), axles, strict=True):
            leg(axes, place, 1.55, 3.0, "p", labels=number in "14")
            axes.add_patch(Circle((place, 1.05), 0.5, facecolor=WHEEL, edgecolor=INK, linewidth=1.1, zorder=3))
            say(axes, place, 1.05, "$M_w$", size=8, zorder=4)
            arrow(axes, place + 0.62, 0.8, place + 0.62, 1.5)
            say(axes, place + 0.72, 1.3, f"$z_{{w{number}}}$", "left", color=FREEDOM)
            spring(axes, place, -0.25, 0.55, turns=3)
            say(axes, place - 0.25, 0.15, "$K_H$", "right", size=8)
            height(axes, place)
            say(axes, place + 0.28, -0.75, f"$u_{number}$", "left", color=TRACK)
            say(axes, place, -1.45, f"axle {number}", size=8)
    rail(axes, -9.4, 9.4)
    distance(axes, 0.0, PIVOT, 7.3, "$L_c$")
    distance(axes, -PIVOT, 0.0, 7.3, "$L_c$")
    for side in (1, -1):
        distance(axes, side * PIVOT, side * PIVOT + AXLE, -2.15, "$L_t$")
        distance(axes, side * PIVOT - AXLE, side * PIVOT, -2.15, "$L_t$")
        for place, low, high in ((0.0, 6.9, 7.5), (side * PIVOT, 6.85, 7.5), (side * PIVOT, -2.3, -1.75)):
            axes.plot([place] * 2, [low, high], color="0.6", linewidth=0.6)
    arrow(axes, 8.6, 4.3, 9.9, 4.3, INK)
    say(axes, 9.2, 4.55, "$x,\\ v$", va="bottom")
    arrow(axes, -9.6, 4.0, -9.6, 4.9, INK)
    say(axes, -9.4, 4.5, "$z$", "left")
    axes.annotate("over a front leg: $z_c - L_c\\beta_c$", (PIVOT, 5.5), (0.0, 4.5), ha="center", fontsize=8.5)


def leg(axes: Axes, x: float, low: float, high: float, stage: str, labels: bool) -> None:
    """A spring beside a damper between two joints."""
    apart = 0.42
    rod(axes, x - apart, low, x + apart, low)
    rod(axes, x - apart, high, x + apart, high)
    spring(axes, x - apart, low, high)
    a, b = low + 0.3 * (high - low), high - 0.3 * (high - low)
    spring(axes, x + apart, low, a, turns=2, width=0.12)
    damper(axes, x + apart, a, b)
    spring(axes, x + apart, b, high, turns=2, width=0.12)
    if labels:
        say(axes, x - apart - 0.27, (low + high) / 2, f"$K_{stage}$", "right", size=8.5)
        for place, name in ((low + a) / 2, "K"), ((a + b) / 2, "C"), ((b + high) / 2, "K"):
            text = f"$C_{stage}$" if name == "C" else f"$K_{{{stage}d}}$"
            say(axes, x + apart + 0.3, place, text, "left", size=7.5)


# --- (b) -----------------------------------------------------------------------------------------------


def any_vehicle(axes: Axes) -> None:
    axes.set(xlim=(-7.2, 6.2), ylim=(-3.4, 6.0))
    title(axes, -7.0, 5.7, "(b) any vehicle: bodies, legs, wheels")
    box(axes, -3.6, 3.3, 9.4, 1.0, BODY)
    x = np.linspace(-3.6, 5.8, 80)
    axes.plot(x, 3.8 + 0.28 * np.sin(np.pi * (x + 3.6) / 9.4) - 0.14, color=FREEDOM, linewidth=1.0, linestyle="--")
    say(axes, 1.1, 4.95, "bodies $m_k$: bounce, pitch, bending, ...  $q$", color=FREEDOM)
    box(axes, -7.0, 3.3, 1.5, 1.0, BODY)
    general_leg(axes, -5.5, 3.8, -3.6, 3.8)
    say(axes, -4.55, 4.35, "$D_3$", size=9)
    box(axes, -1.9, 1.4, 5.6, 0.55, BODY)
    general_leg(axes, 1.9, 1.95, 1.9, 3.3)
    say(axes, 2.25, 2.62, "$D_1(s)\\,e,\\quad e = r^{\\mathsf{T}} q$", "left", size=9)
    for number, place in ((3, -1.4), (2, 0.9), (1, 3.2)):
        general_leg(axes, place, 0.25, place, 1.4)
        say(axes, place + 0.33, 0.8, "$D_2$", "left", size=9)
        axes.add_patch(Circle((place, -0.15), 0.4, facecolor=WHEEL, edgecolor=INK, linewidth=1.1))
        general_leg(axes, place, -1.35, place, -0.55, 0.3)
        say(axes, place + 0.28, -0.95, f"$C_{number}$", "left", size=9)
        height(axes, place, -2.12)
        say(axes, place + 0.25, -1.85, f"$u_{number}$", "left", color=TRACK)
    rail(axes, -6.8, 5.9, -1.35)
    distance(axes, -0.25, 3.2, -2.65, "$x_1$")
    axes.plot([-0.25] * 2, [-2.85, -1.55], color="0.6", linewidth=0.6)
    axes.plot([3.2] * 2, [-2.85, -2.3], color="0.6", linewidth=0.6)
    say(axes, -0.25, -3.1, "origin", size=8)
    say(axes, -6.9, 2.4, "the next car's end", "left", size=8.5)
    say(axes, -6.9, 0.9, "$Z(s)\\,q = \\sum_w C_w(s)\\, r_w u_w$", "left")
    say(axes, -6.9, 0.05, "$u_w = u_0\\,e^{i\\omega x_w/v}$", "left", color=TRACK)


def general_leg(axes: Axes, x: float, y: float, x2: float, y2: float, size: float = 0.5) -> None:
    """A box between two ends."""
    rod(axes, x, y, x2, y2)
    middle = np.array([x + x2, y + y2]) / 2
    axes.add_patch(
        Rectangle(tuple(middle - size / 2), size, size, facecolor="white", edgecolor=INK, linewidth=1.1, zorder=3)
    )


# --- (c) -----------------------------------------------------------------------------------------------


def law(axes: Axes) -> None:
    axes.set(xlim=(-3.9, 3.9), ylim=(-5.2, 5.1))
    title(axes, -3.8, 4.6, "(c) a law is a tree")
    say(axes, 0.0, 3.5, "k | (K - c - K)", family="monospace", size=11)
    nodes = {
        "parallel": (-0.6, 2.3),
        "k": (-2.4, 0.6),
        "series": (1.1, 0.6),
        "K": (-0.7, -1.2),
        "c": (1.1, -1.2),
        "K ": (2.9, -1.2),
    }
    for upper, lower in (("parallel", "k"), ("parallel", "series"), ("series", "K"), ("series", "c"), ("series", "K ")):
        axes.plot(*zip(nodes[upper], nodes[lower], strict=True), color="0.5", linewidth=1.0, zorder=0)
    for name, (x, y) in nodes.items():
        wide = name in ("parallel", "series")
        half = 1.05 if wide else 0.42
        axes.add_patch(
            FancyBboxPatch(
                (x - half, y - 0.3),
                2 * half,
                0.6,
                boxstyle="round,pad=0.05",
                facecolor="white" if wide else BODY,
                edgecolor=INK,
                linewidth=1.0,
            )
        )
        say(axes, x, y, name.strip(), size=9.5)
    say(axes, 0.0, -2.6, "parallel: $D = \\sum D_i$", size=10)
    say(axes, 0.0, -3.45, "series: $1/D = \\sum 1/D_i$", size=10)
    say(axes, 0.0, -4.5, "$D(s) = k + \\frac{c\\,s}{1 + 2\\,c\\,s/K}$", size=12)


# --- symbols -------------------------------------------------------------------------------------------


def title(axes: Axes, x: float, y: float, text: str) -> None:
    axes.text(x, y, text, ha="left", va="center", fontsize=11, color=INK, weight="bold")


def say(axes: Axes, x: float, y: float, text: str, ha: str = "center", size: float = 10, va: str = "center", **more):
    axes.text(x, y, text, ha=ha, va=va, fontsize=size, **({"color": INK} | more))


def box(axes: Axes, x: float, y: float, width: float, high: float, colour: str) -> None:
    axes.add_patch(Rectangle((x, y), width, high, facecolor=colour, edgecolor=INK, linewidth=1.2))


def rod(axes: Axes, x: float, y: float, x2: float, y2: float) -> None:
    axes.plot([x, x2], [y, y2], **LINE)


def spring(axes: Axes, x: float, low: float, high: float, turns: int = 5, width: float = 0.18) -> None:
    ends = 0.15 * (high - low)
    y = np.concatenate([[low], np.linspace(low + ends, high - ends, 2 * turns + 1), [high]])
    side = np.concatenate([[0, 0], np.tile([1.0, -1.0], turns)[: 2 * turns - 1], [0, 0]])
    axes.plot(x + width * side, y, **LINE)


def damper(axes: Axes, x: float, low: float, high: float) -> None:
    """A pot with a piston."""
    floor, top = low + 0.15 * (high - low), high - 0.2 * (high - low)
    rod(axes, x, low, x, floor)
    axes.plot([x - 0.17, x - 0.17, x + 0.17, x + 0.17], [top, floor, floor, top], **LINE)
    middle = (floor + top) / 2
    rod(axes, x - 0.12, middle, x + 0.12, middle)
    rod(axes, x, middle, x, high)


def arrow(axes: Axes, x: float, y: float, x2: float, y2: float, colour: str = FREEDOM) -> None:
    axes.annotate("", (x2, y2), (x, y), arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.1})


def freedom(axes: Axes, x: float, y: float, bounce: str, pitch: str, size: float) -> None:
    """An arrow upwards and one around, clockwise: a positive pitch lowers the front, which is on the right."""
    axes.plot(x, y, "o", color=FREEDOM, markersize=2.5)
    arrow(axes, x, y, x, y + size)
    axes.add_patch(Arc((x, y), 1.1 * size, 1.1 * size, theta1=-60, theta2=70, color=FREEDOM, linewidth=1.1))
    end = np.radians(-60)
    tip = x + 0.55 * size * np.cos(end), y + 0.55 * size * np.sin(end)
    axes.annotate(
        "",
        (tip[0] - 0.1, tip[1] - 0.06),
        (tip[0] + 0.02, tip[1] + 0.02),
        arrowprops={"arrowstyle": "->", "color": FREEDOM, "linewidth": 1.1},
    )
    say(axes, x - 0.12, y + 0.12, bounce, "right", color=FREEDOM)
    say(axes, x + 0.7 * size + 0.06, y, pitch, "left", color=FREEDOM)


def rail(axes: Axes, start: float, end: float, level: float = -0.25) -> None:
    x = np.linspace(start, end, 400)
    y = level + 0.05 * np.sin(2.3 * x) + 0.03 * np.sin(5.1 * x + 1)
    axes.plot(x, y, color=TRACK, linewidth=2.2)


def height(axes: Axes, x: float, low: float = -1.05) -> None:
    """The track's height under a wheel."""
    arrow(axes, x, low, x, low + 0.62, TRACK)


def distance(axes: Axes, x: float, x2: float, y: float, text: str) -> None:
    axes.annotate("", (x2, y), (x, y), arrowprops={"arrowstyle": "<->", "color": "0.4", "linewidth": 0.8})
    say(axes, (x + x2) / 2, y + 0.08, text, va="bottom")
