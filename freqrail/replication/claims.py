"""The paper's claims: every directional statement of its sections V, VI and VII, and what decides it.

A claim carries the paper's own sentence, is read in words of our own, names the dataset that it is about ("grid": RMS
over both joints and speed, see `sweep.sweep`; "track": heights under the wheels; "spectra": PSDs at one point) and
has a function over it. No verdict is written here; `judging` says what each test asks, `thresholds` from which share
of points on a claim holds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
import xarray as xr

from freqrail.case.parameters import JOINTS
from freqrail.model.responses import RESPONSES
from freqrail.model.variants import PREFIXES
from freqrail.replication import judging
from freqrail.replication.judging import (
    PLACES,
    Finding,
    Outcome,
    Places,
    Test,
    above,
    approaches,
    arrives,
    below,
    differs,
    everywhere,
    falls,
    grows_with_speed,
    high,
    low,
    never_coincides,
    recedes,
    rises,
    same,
    same_law,
    slowly,
    turns_away,
)
from freqrail.replication.quotations import QUOTATIONS
from freqrail.replication.thresholds import CHOSEN, Thresholds
from freqrail.replication.words import extent, extreme, percent, whole

PAPER_SPEED = 250.0  # km/h
PAPER_POINT = {"speed": PAPER_SPEED, **dict.fromkeys(JOINTS, judging.OTHER_JOINT)}
"""The point of the paper's section V, in the units of a dataset's coordinates."""

PRIMARY, SECONDARY = JOINTS
CAR, BOGIE, SECONDARY_STROKE, PRIMARY_STROKE = (name for name, response in RESPONSES.items() if response.paper)
RESPONSE_NAMES = (CAR, BOGIE, SECONDARY_STROKE, PRIMARY_STROKE)

Judge = Callable[[xr.Dataset, Places, Thresholds], Outcome]


@dataclass(frozen=True)
class Claim:
    """A directional statement of the paper.

    key: what the report calls it. section and item: where the paper says it. text: how it is read, in our words.
    over: the dataset it is about. judge: (dataset, places, thresholds) to an outcome, places as `judging.PLACES`.
    """

    key: str
    section: str
    item: str
    text: str
    over: str
    judge: Judge

    @property
    def quotation(self) -> str:
        """The sentence of the paper that makes the claim, verbatim."""
        return QUOTATIONS[self.key]

    def outcome(
        self, dataset: xr.Dataset, places: Places | None = None, thresholds: Thresholds = CHOSEN
    ) -> judging.Outcome:
        """Where the claim is true in a dataset."""
        return self.judge(dataset, places or PLACES, thresholds)

    def finding(self, dataset: xr.Dataset, places: Places | None = None, thresholds: Thresholds = CHOSEN) -> Finding:
        """What the claim comes to in a dataset."""
        return judging.finding(self.outcome(dataset, places, thresholds), thresholds)


def judge_all(datasets: Mapping[str, xr.Dataset], places: Places | None = None) -> dict[str, Finding]:
    """Findings of all claims about the datasets given, by key."""
    return {claim.key: claim.finding(datasets[claim.over], places) for claim in CLAIMS if claim.over in datasets}


# --- claims that are not about one scan -----------------------------------------------------------


def _at_point(test: Test, response: str, dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    both = judging.read(dataset, response, places)
    return test(judging.Scan(both.joint.sel(PAPER_POINT), both.rigid.sel(speed=PAPER_SPEED)), t)


def _over_scan(test: Test, response: str, joint: str, dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    return test(judging.scan(dataset, response, joint, places), t)


def _bogie_over_car(dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    """At the paper's point the bogie's departure is larger than the car body's."""
    apart = {}
    for response in (BOGIE, CAR):
        both = judging.read(dataset, response, places)
        apart[response] = abs(both.departure.sel(PAPER_POINT))
    numbers = f"bogie frame {percent(float(apart[BOGIE]), False)}, car body {percent(float(apart[CAR]), False)}"
    return Outcome(apart[BOGIE] > apart[CAR], f"{numbers} away from the traditional model")


def _lagged_copies(dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    """Every wheel's track, moved back by its lag, is the first wheel's."""
    time, height = dataset["time"].values, dataset["track_height"]
    first = height.isel(axle=0).values
    off = []
    for axle, lag in enumerate(dataset["lag"].values):
        moved = np.interp(time + lag, time, height.isel(axle=axle).values)
        inside = time + lag <= time[-1]
        off.append(np.sqrt(np.mean((moved - first)[inside] ** 2) / np.mean(first[inside] ** 2)))
    worst = xr.DataArray(off, dims="axle", coords={"axle": height["axle"]})
    lags = ", ".join(f"{1e3 * lag:.1f}" for lag in dataset["lag"].values[1:])
    numbers = f"lags {lags} ms; after taking them out the heights differ by at most {percent(max(off), False)} (RMS)"
    return Outcome(worst <= t.same, numbers, ("same",))


def _at_high_frequency(dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    """Most of what the joints change in a response's power lies above the corner of the softest damper."""
    share, change = about_the_corner(dataset, places)
    words = ", ".join(
        f"{RESPONSES[name].long_name} {percent(float(share.sel(response=name)), False)} "
        f"(RMS below it {percent(float(change.sel(response=name)))})"
        for name in RESPONSE_NAMES
    )
    corner = float(dataset.attrs["corner_frequency"])
    return Outcome(share > t.mainly, f"share of the changed power above {corner:.1f} Hz: {words}", ("mainly",))


def about_the_corner(dataset: xr.Dataset, places: Places = PLACES) -> tuple[xr.DataArray, xr.DataArray]:
    """Of the power that joints change, the share above the corner frequency; what they change in the RMS below it.

    Both [response], at the paper's point, from a dataset of spectra.
    """
    frequency = dataset["frequency"]
    corner = float(dataset.attrs["corner_frequency"])
    at = {key: PAPER_POINT[key] for key in (*JOINTS, "speed")}
    shares, changes = [], []
    for response in RESPONSE_NAMES:
        joint, rigid = (dataset[f"{prefix}{response}_psd"] for prefix in PREFIXES)
        place = {dim: here for dim, here in places.items() if dim in joint.dims}
        joint, rigid = (psd.sel({k: v for k, v in (at | place).items() if k in psd.dims}) for psd in (joint, rigid))
        change = abs(joint - rigid)
        shares.append(
            float(change.where(frequency >= corner, 0).integrate("frequency") / change.integrate("frequency"))
        )
        under = (psd.where(frequency < corner, 0).integrate("frequency") for psd in (joint, rigid))
        changes.append(float(np.sqrt(next(under) / next(under)) - 1))
    labels = {"response": list(RESPONSE_NAMES)}
    return xr.DataArray(shares, labels), xr.DataArray(changes, labels)


def _all_matter(dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    """Either joint changes every response greatly somewhere: "significantly affected"."""
    cells = [
        [float(abs(judging.scan(dataset, response, joint, places).departure).max()) for joint in JOINTS]
        for response in RESPONSE_NAMES
    ]
    largest = xr.DataArray(
        cells, dims=("response", "joint"), coords={"response": list(RESPONSE_NAMES), "joint": list(JOINTS)}
    )
    numbers = f"largest departure of each response by each joint {extent(largest, False)}"
    return Outcome(largest > t.great, f"{numbers}; more than {whole(t.great)} is needed", ("great",))


def _great_errors(dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    """At low speed the traditional model is far off in both accelerations, whichever joint is scanned."""
    scans = {
        (response, joint): judging.scan(dataset, response, joint, places)
        for response in (CAR, BOGIE)
        for joint in JOINTS
    }
    apart = {key: low(abs(s.departure), t.region) for key, s in scans.items()}
    labels = [f"{RESPONSES[response].long_name}, {joint.split('_')[0]} joint" for response, joint in apart]
    words = "; ".join(f"{label} {extent(d, False)}" for label, d in zip(labels, apart.values(), strict=True))
    # the two joints need not have the same stiffnesses: NaN where a scan has no such point
    far = [(d > t.great).astype(float).reset_coords(drop=True) for d in apart.values()]
    true = xr.concat(far, xr.DataArray(labels, dims="scan", name="scan"), join="outer")
    return Outcome(true, f"{words}; more than {whole(t.great)} is needed", ("great", "region"))


def _stiff_joints_agree(dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    """With both joints stiff, every response is nearer to the traditional model than with soft ones, and like it."""
    parts = []
    for response in RESPONSE_NAMES:
        d = abs(judging.read(dataset, response, places).departure)
        soft, stiff = (d.isel(dict.fromkeys(JOINTS, end), drop=True) for end in (0, -1))
        parts.append(((stiff < soft) & (stiff <= t.same), stiff))
    labels = xr.DataArray(list(RESPONSE_NAMES), dims="response", name="response")
    true = xr.concat([part[0] for part in parts], labels)
    stiff = xr.concat([part[1] for part in parts], labels)
    return Outcome(true, f"departure with both joints at their stiffest {extent(stiff, False)}", ("same",))


def _can_be_alleviated(dataset: xr.Dataset, places: Places, t: Thresholds) -> Outcome:
    """For each of the two accelerations some pair of joints makes it smaller than rigid joints do."""
    best, worst = [], []
    for response in (CAR, BOGIE):
        d = judging.read(dataset, response, places).departure
        best.append(d.min(JOINTS))
        worst.append(d.max(JOINTS))
    labels = xr.DataArray([CAR, BOGIE], dims="response", name="response")
    least, most = xr.concat(best, labels), xr.concat(worst, labels)
    words = [
        f"{RESPONSES[name].long_name}: best pair {extent(least.sel(response=name))}, worst pair up to "
        f"{extreme(most.sel(response=name), 'max')}"
        for name in (CAR, BOGIE)
    ]
    return Outcome(least < -t.seen, "; ".join(words), ("seen",))


# --- the table -------------------------------------------------------------------------------------


_AT_POINT = (
    ("b", CAR, "at 250 km/h the car body's acceleration has practically the same RMS in both models", same(everywhere)),
    (
        "c",
        SECONDARY_STROKE,
        "at 250 km/h the secondary stroke has practically the same RMS in both models",
        same(everywhere),
    ),
    (
        "d",
        BOGIE,
        "at 250 km/h the bogie frame's acceleration differs in RMS between the models",
        differs(everywhere),
    ),
    ("e", PRIMARY_STROKE, "at 250 km/h the primary stroke differs in RMS between the models", differs(everywhere)),
)

_PRIMARY_JOINT = (
    ("1a", CAR, "the primary joint matters to the car body mainly at low speed", judging.more_at_low_speed),
    ("1b", CAR, "at low speed the car body's acceleration is below the traditional model's", below(low)),
    ("1c", CAR, "at high speed the car body's acceleration is practically the traditional one", same(high)),
    (
        "1d",
        CAR,
        "with a finite primary joint the car body's curve never coincides with the traditional",
        never_coincides,
    ),
    ("1e", CAR, "a stiffer primary joint lowers the car body's acceleration", falls),
    ("1f", CAR, "what the primary joint's stiffness does to the car body grows with speed", grows_with_speed),
    ("1g", CAR, "a stiffer primary joint brings the car body nearer to the traditional model", approaches(everywhere)),
    ("1h", CAR, "the car body's approach to the traditional model is very slow", slowly),
    ("2a", BOGIE, "the primary joint matters to the bogie frame at every speed", differs(everywhere)),
    ("2b", BOGIE, "the primary joint matters to the bogie frame more at low speed", judging.more_at_low_speed),
    ("2c", BOGIE, "at low speed the bogie frame's acceleration is below the traditional model's", below(low)),
    ("2d", BOGIE, "at high speed the bogie frame's acceleration is above the traditional model's", above(high)),
    ("2e", BOGIE, "a stiffer primary joint raises the bogie frame's acceleration", rises),
    ("2f", BOGIE, "what the primary joint's stiffness does to the bogie frame grows with speed", grows_with_speed),
    ("3a", SECONDARY_STROKE, "the secondary stroke hardly changes with the primary joint", same(everywhere)),
    ("3b", SECONDARY_STROKE, "a stiffer primary joint lowers the secondary stroke", falls),
    ("3c", SECONDARY_STROKE, "what the primary joint does to the secondary stroke grows with speed", grows_with_speed),
    (
        "3d",
        SECONDARY_STROKE,
        "a stiffer primary joint brings the secondary stroke nearer to the traditional model",
        approaches(everywhere),
    ),
    ("3e", SECONDARY_STROKE, "the secondary stroke's approach to the traditional model is very slow", slowly),
    ("3f", SECONDARY_STROKE, "with a finite primary joint the secondary stroke never coincides", never_coincides),
    ("4a", PRIMARY_STROKE, "stiffening the primary joint first nears the traditional stroke, then departs", turns_away),
    ("4b", PRIMARY_STROKE, "that departing of the primary stroke grows with speed", judging.turns_away_more_with_speed),
    ("4c", PRIMARY_STROKE, "a stiffer primary joint lowers the primary stroke", falls),
    ("4d", PRIMARY_STROKE, "the primary stroke follows the primary joint by one law at every speed", same_law),
)

_SECONDARY_JOINT = (
    ("1a", CAR, "the secondary joint matters to the car body mainly at low speed", judging.more_at_low_speed),
    ("1b", CAR, "at low speed the car body's acceleration is below the traditional model's", below(low)),
    ("1c", CAR, "at high speed the car body's acceleration is practically the traditional one", same(high)),
    ("1d", CAR, "with a finite secondary joint the car body's curve never coincides", never_coincides),
    ("1e", CAR, "a stiffer secondary joint lowers the car body's acceleration", falls),
    ("1f", CAR, "the car body's fall with the secondary joint has one shape at every speed (not one size)", same_law),
    (
        "1g",
        CAR,
        "at high speed a stiffer secondary joint brings the car body nearer to the traditional",
        approaches(high),
    ),
    ("2a", BOGIE, "the secondary joint matters to the bogie frame at every speed", differs(everywhere)),
    ("2b", BOGIE, "the secondary joint matters to the bogie frame more at low speed", judging.more_at_low_speed),
    ("2c", BOGIE, "at low speed the bogie frame's acceleration is below the traditional model's", below(low)),
    (
        "2d",
        BOGIE,
        "at high speed a stiffer secondary joint brings the bogie nearer to the traditional",
        approaches(high),
    ),
    ("2e", BOGIE, "a stiffer secondary joint lowers the bogie frame's acceleration", falls),
    ("2f", BOGIE, "the bogie frame follows the secondary joint by one law at every speed", same_law),
    (
        "3a",
        SECONDARY_STROKE,
        "a stiffer secondary joint brings the secondary stroke nearer to the traditional model",
        approaches(everywhere),
    ),
    (
        "3b",
        SECONDARY_STROKE,
        "with a stiff secondary joint the secondary stroke is the traditional",
        arrives(everywhere),
    ),
    ("3c", SECONDARY_STROKE, "a stiffer secondary joint lowers the secondary stroke", falls),
    ("3d", SECONDARY_STROKE, "the secondary stroke follows the secondary joint by one law at every speed", same_law),
    ("4a", PRIMARY_STROKE, "the softer the secondary joint, the nearer the primary stroke to the traditional", recedes),
    ("4b", PRIMARY_STROKE, "a stiffer secondary joint lowers the primary stroke", falls),
    ("4c", PRIMARY_STROKE, "the primary stroke follows the secondary joint by one law at every speed", same_law),
)


def _scanned(section: str, joint: str, rows: tuple[tuple[str, str, str, Test], ...]) -> tuple[Claim, ...]:
    """Claims about one scan each: rows of (item and letter, response, what the paper says, test)."""
    return tuple(
        Claim(f"{section} {item}", section, item[:-1], text, "grid", partial(_over_scan, test, response, joint))
        for item, response, text, test in rows
    )


def _grid_claims(section: str, rows: tuple[tuple[str, str, str, Judge], ...]) -> tuple[Claim, ...]:
    """Claims about the whole grid: rows of (letter or number, item, what the paper says, judge)."""
    return tuple(Claim(f"{section} {key}", section, item, text, "grid", judge) for key, item, text, judge in rows)


CLAIMS: tuple[Claim, ...] = (
    Claim("V.A a", "V.A", "fig. 3", "all wheels see one irregularity, one after the other", "track", _lagged_copies),
    *_grid_claims(
        "V.B", tuple((k, "fig. 4", text, partial(_at_point, test, name)) for k, name, text, test in _AT_POINT)
    ),
    *_grid_claims(
        "V.B", (("f", "fig. 4", "at 250 km/h joints matter more to the bogie frame than to the car", _bogie_over_car),)
    ),
    Claim("V.B g", "V.B", "fig. 4", "what joints change lies at high frequency", "spectra", _at_high_frequency),
    *_scanned("VI.A", PRIMARY, _PRIMARY_JOINT),
    *_scanned("VI.B", SECONDARY, _SECONDARY_JOINT),
    *_grid_claims(
        "VII",
        (
            ("1", "1", "both joints matter significantly to all four responses", _all_matter),
            (
                "2a",
                "2",
                "at low speed the traditional model is far off in both accelerations",
                _great_errors,
            ),
            ("2b", "2", "with stiff joints the two models agree", _stiff_joints_agree),
            ("3", "3", "well chosen joints make the vehicle quieter than rigid ones do", _can_be_alleviated),
        ),
    ),
)
"""Every claim, section by section."""
