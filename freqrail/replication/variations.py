"""Why the paper may differ: its study under every procedure and number that it may have used, and what that changes.

A variation makes a grid dataset of its own (or reads the exact one elsewhere on the vehicle); the claims are judged
in it and in the exact dataset at the same points, and the verdicts that differ are what the variation explains. The
variations in the frequency domain are here, those in time in `procedures`.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail.case.case import Case
from freqrail.case.parameters import JOINTS
from freqrail.errors import FreqrailWarning
from freqrail.model.band import Band
from freqrail.model.responses import PAPER as IN_ORDER
from freqrail.model.responses import RESPONSES
from freqrail.model.variants import PREFIXES
from freqrail.replication import judging, printed
from freqrail.replication.claims import judge_all
from freqrail.replication.judging import FAILS, OTHER_JOINT, PLACES, VERDICTS, Finding, Places
from freqrail.replication.studies import CASE
from freqrail.replication.words import percent
from freqrail.sweep.sweep import sweep
from freqrail.types import Progress

# The field's contact constants G = c R^e in m/N^(2/3), R the wheel radius in m: conical and worn tread.
TREADS = {"conical": (4.57e-8, -0.149), "worn": (3.86e-8, -0.115)}
RADII = (0.40, 0.43, 0.46)  # m, of wheels in service

BANDS = {"0.1:20 Hz": "0.1 to 20 Hz", "0.1:50 Hz": "0.1 to 50 Hz", "none": "the whole axis"}

ELSEWHERE: dict[str, Places] = {
    "car body over the front pivot": PLACES | {"car_position": "front"},
    "car body over the rear pivot, rear bogie, axle 3": {"car_position": "rear", "bogie": "rear", "axle": 3},
    "axle 2": PLACES | {"axle": 2},
}


@dataclass(frozen=True)
class Variation:
    """One other way to get the paper's numbers, and what the claims come to in it.

    group: the question it answers. name: what differs. tracks: findings by claim, of every track that it was run on
    (one entry if no track was drawn). exact: the same in the exact dataset at the same points. note: what else was
    found. possible: whether the paper's whole study can be run this way.
    """

    group: str
    name: str
    tracks: Sequence[Mapping[str, Finding]]
    exact: Mapping[str, Finding]
    note: str = ""
    possible: bool = True

    @property
    def changed(self) -> dict[str, list[str]]:
        """By claim, the verdicts that differ from the exact one, one a track on which it does."""
        other = {
            key: [t[key].verdict for t in self.tracks if t[key].verdict != e.verdict] for key, e in self.exact.items()
        }
        return {key: verdicts for key, verdicts in other.items() if verdicts}

    @property
    def mended(self) -> dict[str, int]:
        """By claim that does not hold in the exact dataset: on how many tracks it holds at least partly."""
        return {key: len(verdicts) for key, verdicts in self.changed.items() if self.exact[key].verdict == FAILS}

    def at_once(self, keys: Collection[str]) -> int:
        """How many of the claims `keys` that do not hold exactly do so at least partly on one and the same track."""
        failing = [key for key in keys if key in self.exact and self.exact[key].verdict == FAILS]
        return max(sum(track[key].verdict != FAILS for key in failing) for track in self.tracks)

    @property
    def gained(self) -> dict[str, int]:
        """By claim whose verdict is better than the exact one: by how many steps, over all tracks (see `_steps`)."""
        return self._steps(1)

    @property
    def lost(self) -> dict[str, int]:
        """By claim whose verdict is worse than the exact one: by how many steps, over all tracks (see `_steps`)."""
        return self._steps(-1)

    @property
    def balance(self) -> float:
        """Steps gained less steps lost, on average over the tracks."""
        return (sum(self.gained.values()) - sum(self.lost.values())) / len(self.tracks)

    def _steps(self, way: int) -> dict[str, int]:
        """Steps from one of VERDICTS to the next, by claim. way: 1 for those up to "holds", -1 for those down."""
        steps = {
            key: sum(max(0, way * (VERDICTS.index(e.verdict) - VERDICTS.index(t[key].verdict))) for t in self.tracks)
            for key, e in self.exact.items()
        }
        return {key: count for key, count in steps.items() if count}

    def count(self, verdict: str) -> float:
        """How many claims come to a verdict, on average over the tracks."""
        return sum(found.verdict == verdict for track in self.tracks for found in track.values()) / len(self.tracks)


def in_frequency(exact: xr.Dataset, case: Case, progress: Progress = lambda done: None) -> list[Variation]:
    """The variations that need no time domain. exact: the dataset of `studies.paper_grid`."""
    base = judge_all({"grid": exact})
    found: list[Variation] = []

    def add(group: str, name: str, findings: Mapping[str, Finding], note: str = "") -> None:
        found.append(Variation(group, name, [findings], base, note))
        progress(1)

    for tread, (factor, exponent) in TREADS.items():
        for radius in RADII:
            constant = factor * radius**exponent
            varied = sweep(CASE, settings={"contact_constant": f"{constant:.4e} m/N^(2/3)"})
            note = _change(varied, exact)
            name = f"{tread} tread, wheel radius {radius:g} m (G = {constant:.3e} m/N^(2/3))"
            add("contact constant", name, judge_all({"grid": varied}), note)
    for setting, words in BANDS.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FreqrailWarning)  # that the whole axis takes in the wheelsets' resonance
            varied = sweep(CASE, settings={"band": "none"} if setting == "none" else {"frequency": setting})
        add("band", words, judge_all({"grid": varied}), _change(varied, exact))
    for words, places in ELSEWHERE.items():
        add("place on the vehicle", words, judge_all({"grid": exact}, places))
    name = "with the scanned joint alone rigid, the other at 5 MN/m"
    add("what a joint is compared with", name, judge_all({"grid": beside_own_rigid(exact)}))
    for name, signs in printed.READINGS.items():
        found.append(_as_printed(exact, case, name, signs))
        progress(1)
    return found


def count_in_frequency() -> int:
    """How many variations `in_frequency` makes."""
    return len(TREADS) * len(RADII) + len(BANDS) + len(ELSEWHERE) + 1 + len(printed.READINGS)


def _change(varied: xr.Dataset, exact: xr.Dataset) -> str:
    """In words: the largest relative change of any RMS."""
    names = [f"{prefix}{name}_rms" for prefix in PREFIXES for name in IN_ORDER]
    largest = max(float(abs(varied[k] / exact[k] - 1).max()) for k in names)
    return f"largest change of an RMS: {percent(largest, False)}"


# --- datasets of other origin ----------------------------------------------------------------------


def relabelled(exact: xr.Dataset, joint: NDArray[np.float64], rigid: NDArray[np.float64]) -> xr.Dataset:
    """The exact grid with RMS values of another origin: [primary, secondary, series, speed] and [series, speed].

    Response in the order of `time_side.readout`; speeds as in `exact`, which may be a selection.
    """
    variables: dict[str, Any] = {}
    first = 0
    for name in IN_ORDER:
        dimension = RESPONSES[name].dimension
        rows = slice(first, first + max(1, len(RESPONSES[name].positions)))
        first = rows.stop
        variables[f"{name}_rms"] = ((*JOINTS, dimension, "speed"), joint[:, :, rows])
        variables[f"traditional_{name}_rms"] = ((dimension, "speed"), rigid[rows])
    return xr.Dataset(variables, {name: exact[name] for name in exact.coords if name != "frequency"})


def beside_own_rigid(exact: xr.Dataset) -> xr.Dataset:
    """The exact grid, and beside it what each joint is compared with to see its own effect (see `judging.scan`)."""
    rigid: dict[str, xr.DataArray] = {}
    for joint in JOINTS:
        alone = sweep(CASE, over={joint: "inf MN/m"}).isel({joint: 0}, drop=True)
        other = next(name for name in JOINTS if name != joint)
        rigid |= {judging.own_rigid(name, joint): alone[f"{name}_rms"].sel({other: OTHER_JOINT}) for name in IN_ORDER}
    return exact.assign({name: values.drop_vars(JOINTS, errors="ignore") for name, values in rigid.items()})


def _as_printed(exact: xr.Dataset, case: Case, name: str, signs: printed.Signs) -> Variation:
    """Claims by the printed equations for the joints; the paper prints no equations of the traditional model.

    Both datasets are cut to the stiffnesses of either scan at which the printed equations are stable.
    """
    band = case.band or Band("frequency", 0.1, 100.0)
    shape = case.vehicles().shape
    vehicles = [case.vehicles().at(index) for index in np.ndindex(shape)]
    growth = np.reshape([printed.growth_rate(vehicle, signs) for vehicle in vehicles], shape)
    values = np.array([printed.printed_rms(vehicle, case.spectrum, case.speeds(), band, signs) for vehicle in vehicles])
    rigid = np.concatenate([exact[f"traditional_{name}_rms"].transpose(..., "speed").values for name in IN_ORDER])
    varied = relabelled(exact, values.reshape(*shape, *values.shape[1:]), rigid)
    primary, secondary = JOINTS
    stable = xr.DataArray(growth < 0, {name: exact[name] for name in JOINTS}, JOINTS)
    part = {
        primary: stable[primary][stable.sel({secondary: OTHER_JOINT})],
        secondary: stable[secondary][stable.sel({primary: OTHER_JOINT})],
    }
    asymmetry = 100 * printed.asymmetry(case.vehicle, signs)
    note = f"stiffness matrix not symmetric (by {asymmetry:.2g} % of its largest entry); "
    if bool(stable.all()):
        note += f"stable at all {stable.size} pairs of Table I"
    else:
        always = [f"{float(k):g}" for k in stable[secondary] if not bool(stable.sel({secondary: k}).any())]
        note += (
            f"unstable at {int((~stable).sum())} of {stable.size} pairs of Table I, with K_sd = "
            f"{', '.join(always) or 'no value'} MN/m whatever K_pd; the fastest growth is {growth.max():.2g} 1/s. "
            f"Judged over the stable rest: K_pd = {_list(part[primary])} MN/m, K_sd = {_list(part[secondary])} MN/m"
        )
    found, base = (judge_all({"grid": dataset.sel(part)}) for dataset in (varied, exact))
    possible = bool(stable.sel({secondary: OTHER_JOINT}).all() and stable.sel({primary: OTHER_JOINT}).all())
    return Variation("eq. (4) as printed", name, [found], base, note, possible)


def _list(values: xr.DataArray) -> str:
    return ", ".join(f"{float(value):g}" for value in values)
