"""The study of docs/confirming.md: what a usual time run reports for the bogie's acceleration, and why.

    .venv/bin/python docs/confirming.py

prints the table and writes docs/confirming-usual-run.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

import freqrail
from freqrail.confirm.time_side import OperatingPoint
from freqrail.confirm.usual_run import plain_run

LIMITS, DURATION = (0.1, 90.0), 20.0  # Hz; s
STEP, FINE = 0.005, 0.001  # s between samples of the track
BOGIE, CAR = 3, 0  # the front bogie and the car body over the front pivot, among the eleven series
RAMP = 4.0  # s, discarded where there is one
EXACT = {"integrator": "exponential"}
SPLINE = {"interpolation": "cubic", "step": FINE}
LINEAR = {"interpolation": "linear", "step": STEP}
VARIANTS = {
    "usual run: all three": {**LINEAR},
    "sudden start alone": {**EXACT, **SPLINE},
    "straight lines alone": {**EXACT, **LINEAR, "ramp": RAMP},
    "default tolerances alone": {**SPLINE, "ramp": RAMP},
    "none of them": {**EXACT, **SPLINE, "ramp": RAMP},
}
"""A usual run, then each of its three habits alone; integrated exactly where the tolerances are not the question."""


def main() -> None:
    case = freqrail.load_case("yu-damper-joint")
    point = OperatingPoint(case.vehicle, case.speed, case.spectrum, "study")
    runs = {}
    for name, options in VARIANTS.items():
        time, responses, exact = plain_run(point, LIMITS, DURATION, **options)
        kept = time >= options.get("ramp", 0.0)
        runs[name] = time, responses, np.sqrt(np.mean(np.square(responses[..., kept]), axis=-1))
    print("| run | front bogie, joints | front bogie, traditional | car body, joints |\n|---|---|---|---|")
    for name, (_, _, rms) in runs.items():
        print(f"| {name} | {rms[0, BOGIE]:.3g} | {rms[1, BOGIE]:.3g} | {rms[0, CAR]:.3g} |")
    print(f"| exact, the same track | {exact[0, BOGIE]:.3g} | {exact[1, BOGIE]:.3g} | {exact[0, CAR]:.3g} |")
    print("front bogie of the usual run over the exact value, records 0 to 5:", *spread(point))
    draw(runs, exact)


def spread(point: OperatingPoint) -> list[str]:
    """How much of it is chance: the start strikes the harder the higher the track happens to be at t = 0."""
    ratios = []
    for seed in range(6):
        _, responses, exact = plain_run(point, LIMITS, DURATION, **LINEAR, seed=seed)
        ratios.append(np.sqrt(np.mean(np.square(responses[0, BOGIE]))) / exact[0, BOGIE])
    return [f"{ratio:.2g}" for ratio in sorted(ratios)]


def draw(runs: dict, exact: np.ndarray) -> None:
    """(a) the usual run and the mended one in time; (b) what every run reports."""
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    history, bars = figure.subplots(1, 2, width_ratios=(1, 1.1))
    for name, style in (
        ("usual run: all three", {"color": "#D55E00", "linewidth": 0.7, "label": "usual run"}),
        ("none of them", {"color": "#0072B2", "linewidth": 1.4, "label": "mended run"}),
    ):
        time, responses, _ = runs[name]
        span = (time > 10.0) & (time < 10.5)
        history.plot(time[span], responses[0, BOGIE, span], **style)
    history.set(xlabel="time [s]", ylabel="front bogie, acceleration [m/s²]", title="(a) half a second, with joints")
    y = np.arange(len(runs))
    for model, colour, offset, label in ((0, "#56B4E9", -0.2, "with joints"), (1, "0.35", 0.2, "traditional")):
        values = [rms[model, BOGIE] for _, _, rms in runs.values()]
        bars.barh(y + offset, values, height=0.36, color=colour, label=label)
        bars.axvline(exact[model, BOGIE], color=colour, linestyle="--", linewidth=1.2)
    bars.set_yticks(y, [name.replace(" alone", "\nalone").replace(": ", ":\n") for name in runs], fontsize=8)
    bars.invert_yaxis()
    bars.set(xscale="log", xlabel="RMS, front bogie [m/s²]", title="(b) dashed: exact")
    bars.set_xlim(0.8, 60)
    bars.xaxis.set_major_locator(FixedLocator([1, 2, 5, 10, 20, 50]))
    bars.xaxis.set_major_formatter("{x:g}")
    bars.xaxis.set_minor_locator(NullLocator())
    found = [ax.get_legend_handles_labels() for ax in (history, bars)]
    handles, labels = ([*a, *b] for a, b in zip(*found, strict=True))
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    figure.savefig(Path(__file__).with_name("confirming-usual-run.png"), dpi=110)


if __name__ == "__main__":
    main()
