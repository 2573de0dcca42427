"""docs/fleet.md and its figure: what the paper says of damper joints, asked of the fleet.

    .venv/bin/python -m docs.fleet

sweeps every case of a half vehicle over the paper's joint stiffnesses and over speeds up to its own, judges the paper's
conclusions (section VII) for each, and draws the RMS against the joints' stiffness; free cases are drawn besides.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import freqrail
from freqrail.case.case import load_case
from freqrail.figures.style import family
from freqrail.replication.claims import CLAIMS

JOINTS = ("primary_joint_stiffness", "secondary_joint_stiffness")
STIFFNESSES = (0.5, 1, 5, 10, 50, 100)  # MN/m of one side, Table I of the paper
DRAWN = np.geomspace(0.5, 100, 24)  # MN/m of one side
PANELS = {
    "car_body_acceleration": "car body over the front pivot",
    "bogie_acceleration": "front bogie frame",
    "secondary_stroke": "secondary stroke, front",
    "primary_stroke": "primary stroke, axle 1",
}
FREE = {
    "car_body_acceleration": ("body_acceleration", "body", "car"),
    "bogie_acceleration": ("body_acceleration", "body", "bogie"),
    "secondary_stroke": ("stroke", "suspension", "secondary"),
    "primary_stroke": ("stroke", "suspension", "primary"),
}
CONCLUSIONS = tuple(claim for claim in CLAIMS if claim.section == "VII")
FOLDER = Path(__file__).parent


def fastest(name: str) -> float:
    """The end of a case's range of speeds, km/h."""
    speeds = next(axis for axis in load_case(name).axes if axis.name == "speed")
    return float(speeds.values[-1])


def sides(name: str) -> int:
    """How many sides of the vehicle a case's stiffnesses are for."""
    return 2 if load_case(name).masses == "whole" else 1


def judged(name: str) -> dict[str, str]:
    """The conclusions for a vehicle of the template, over the paper's joints and its own speeds from a third up."""
    top = fastest(name)
    joints = ", ".join(f"{sides(name) * stiffness:g}" for stiffness in STIFFNESSES) + " MN/m"
    over = dict.fromkeys(JOINTS, joints) | {"speed": f"lin:{top / 3:.0f}:{top:.0f}:11 km/h"}
    dataset = freqrail.sweep(name, over=over)
    one_side = {joint: (joint, np.array(STIFFNESSES, dtype=float), dataset[joint].attrs) for joint in JOINTS}
    dataset = dataset.assign_coords(one_side)  # as the paper's claims have them
    return {claim.key: claim.finding(dataset).verdict for claim in CONCLUSIONS}


def curves(name: str) -> dict[str, np.ndarray]:
    """RMS over that with rigid joints, at the case's speed, all joints alike: {response: [stiffnesses]}."""
    case = load_case(name)
    stiffness = (sides(name) * DRAWN).tolist()
    if case.is_half_vehicle:
        samples = {f"{joint} [MN/m]": stiffness for joint in JOINTS}
        found = freqrail.sweep(name, samples=samples, over={"speed": f"{case.speed * 3.6!r} km/h"})
        return {response: ratio(found[f"{response}_rms"], found[f"traditional_{response}_rms"]) for response in PANELS}
    joints = [axis.name for axis in case.axes if axis.name.endswith("joint")]
    found = freqrail.sweep(
        name, samples={f"{joint} [MN/m]": stiffness for joint in joints}, over={"speed": f"{case.speed * 3.6!r} km/h"}
    )
    result = {}
    for response, (variable, dimension, kind) in FREE.items():
        first = next(label for label in found[dimension].values.tolist() if label.startswith(kind))
        own, twin = (found[f"{prefix}{variable}_rms"].sel({dimension: first}) for prefix in ("", "traditional_"))
        result[response] = np.ravel(own.values) / np.ravel(twin.values)
    return result


def ratio(own: xr.DataArray, twin: xr.DataArray) -> np.ndarray:
    """At the first position."""
    own, twin = (each.isel({d: 0 for d in each.dims if d not in ("sample", "speed")}) for each in (own, twin))
    return np.ravel(own.values) / np.ravel(twin.values)


def draw(found: dict[str, dict[str, np.ndarray]]) -> Figure:
    """One panel a response, a line a vehicle."""
    figure = Figure(figsize=(9, 8.4), layout="constrained")
    styles = family(len(found))
    for ax, (response, title) in zip(figure.subplots(2, 2).flat, PANELS.items(), strict=True):
        for ratios, style in zip((each[response] for each in found.values()), styles, strict=True):
            ax.plot(DRAWN, ratios, markersize=4, markevery=4, linewidth=1.2, **style)
        ax.axhline(1.0, color="0.4", linewidth=0.8)
        ax.set_xscale("log")
        ax.set_title(title)
        ax.set_xlabel("joint stiffness, all joints, one side [MN/m]")
        ax.set_ylabel("RMS over that with rigid joints")
        ax.grid(True, color="0.9")
    handles = [Line2D([], [], label=name, **style) for name, style in zip(found, styles, strict=True)]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def main() -> None:
    """Write docs/fleet.md and docs/fleet.png."""
    names = sorted(freqrail.shipped_cases())
    half = [name for name in names if load_case(name).is_half_vehicle]
    found = {name: curves(name) for name in names}
    draw(found).savefig(FOLDER / "fleet.png", dpi=130)
    head = ["vehicle", *(claim.text for claim in CONCLUSIONS)]
    rows = [[name, *judged(name).values()] for name in half]
    softest = []
    for name, each in found.items():
        at_five = {response: np.interp(np.log(5), np.log(DRAWN), ratios) for response, ratios in each.items()}
        softest.append([name, *(f"{each[response][0]:.2f}, {at_five[response]:.2f}" for response in PANELS)])
    lines = [PAGE, table(head, rows), BETWEEN, table(["vehicle", *PANELS.values()], softest), ""]
    (FOLDER / "fleet.md").write_text("\n".join(lines), encoding="utf-8")


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


PAGE = """# The fleet, and the paper's conclusions

Does what the paper says of damper joints hold for other vehicles? `python -m docs.fleet` makes this page: it sweeps the
cases that come with freqrail over the paper's joint stiffnesses (Table I, of one side) and over eleven speeds from a
third of each vehicle's highest to that, in the case's own band, and judges the conclusions of section VII as
[the replication](../results/yu-damper-joint/report.md) does for the paper's vehicle: with its readings, thresholds and
places. A claim holds where it is true at nearly all points, partly where at most, else it does not hold.

![RMS of four responses over that with rigid joints, against the stiffness of all joints](fleet.png)
"""

BETWEEN = """
RMS over that with rigid joints at the case's own speed, with all joints at 0.5 MN/m and at 5 MN/m; below 1 is quieter
than with rigid joints. Of the free form (crh380a, crh380a-flexible, manchester-1-pitch, six-axle-locomotive and
two-coupled-cars) the car body is read at its centre; the first two have joints in the primary dampers alone.
"""


if __name__ == "__main__":
    main()
