"""Every claim of the paper, fed a dataset in which it is true and one in which it is not.

A dataset is made from one surface: the departure of one response from the traditional model, over the joint's
stiffness (k from 0, the softest, to 1) and the speed (v from 0 to 1). All else in it is NaN, so that a claim that
read another response or joint than its own could not hold.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from freqrail.case.parameters import JOINTS
from freqrail.model.responses import RESPONSES
from freqrail.replication import judging
from freqrail.replication.claims import CLAIMS, PAPER_POINT
from freqrail.replication.judging import FAILS, HOLDS, PARTLY, VERDICTS
from freqrail.replication.thresholds import CHOSEN

CAR, BOGIE, SECONDARY_STROKE, PRIMARY_STROKE = (name for name, response in RESPONSES.items() if response.paper)
PRIMARY, SECONDARY = JOINTS
TABLE_I = np.array([0.5, 1, 5, 10, 50, 100])
SPEEDS = np.arange(100.0, 301, 10)
FREQUENCY = np.geomspace(0.1, 100, 200)

Surface = Callable[[np.ndarray, np.ndarray], np.ndarray]


def empty_grid() -> xr.Dataset:
    """A grid over Table I in which no RMS of the joint model is known, and the traditional one grows with speed."""
    coordinates = {PRIMARY: TABLE_I, SECONDARY: TABLE_I, "speed": SPEEDS}
    variables = {}
    for name, response in RESPONSES.items():
        if response.paper:
            places = len(response.positions)
            rigid = np.repeat(1e-3 * SPEEDS[:, None], places, axis=1)
            variables[f"traditional_{name}_rms"] = (("speed", response.dimension), rigid)
            variables[f"{name}_rms"] = ((*JOINTS, "speed", response.dimension), np.full((6, 6, 21, places), np.nan))
            coordinates[response.dimension] = list(response.positions)
    return xr.Dataset(variables, coordinates)


def put(grid: xr.Dataset, response: str, joint: str, surface: Surface) -> xr.Dataset:
    """Put a surface of departures over `joint`, the other joint at the paper's value, where claims read `response`."""
    k, v = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 21), indexing="ij")
    other = SECONDARY if joint == PRIMARY else PRIMARY
    rms = grid[f"{response}_rms"]
    dimension = RESPONSES[response].dimension
    rigid = grid[f"traditional_{response}_rms"].isel({dimension: 0}).values
    at = {other: judging.OTHER_JOINT, dimension: judging.PLACES[dimension]}
    rms.loc[at] = rigid * (1 + np.broadcast_to(surface(k, v), k.shape))
    return grid


# (true surface, false surface) of the departure, by what a claim says
GROWING_FAN = (lambda k, v: 0.2 * (1 - k) * (1 + v), lambda k, v: 0.2 * (1 - k) * (2 - v))
NEARER = (lambda k, v: 0.3 - 0.25 * k, lambda k, v: 0.05 + 0.25 * k)
SLOW = (lambda k, v: 0.3 - 0.02 * k, lambda k, v: 0.5 * k)
APART = (lambda k, v: 0.01 + 0 * k, lambda k, v: 0 * k)
MATTERS = (lambda k, v: 0.2 + 0 * k, lambda k, v: 0.01 + 0 * k)
SAME = (lambda k, v: 0.03 * np.cos(9 * k * v), lambda k, v: 0.2 + 0 * k)
AT_LOW_SPEED = (lambda k, v: -0.2 * (1 - v), lambda k, v: -0.2 * v)
LOW_BELOW = (lambda k, v: -0.1 + 0.2 * v, lambda k, v: 0.1 - 0.2 * v)
HIGH_ABOVE = LOW_BELOW
HIGH_SAME = (lambda k, v: 0.2 * (1 - v) ** 2, lambda k, v: 0.2 * v)
FALLING = (lambda k, v: 0.1 - 0.2 * k, lambda k, v: -0.1 + 0.2 * k)
RISING = FALLING[::-1]
ONE_LAW = (lambda k, v: (1 - k) ** 2 * (1 + v), lambda k, v: (1 - k) ** (0.2 + 4 * v))
TURNS = (lambda k, v: 0.2 * (0.5 - k) * (1 + v), lambda k, v: 0.2 * (1.5 - k))
TURNS_MORE = (lambda k, v: 0.2 * (0.5 - k) * (1 + v), lambda k, v: 0.2 * (0.5 - k) * (2 - v))
SOFTEST_NEAREST = NEARER[::-1]
ARRIVES = (lambda k, v: 0.3 * (1 - k), lambda k, v: 0.3 + 0 * k)

SURFACES: dict[str, tuple[str, str, tuple[Surface, Surface]]] = {
    "VI.A 1a": (CAR, PRIMARY, AT_LOW_SPEED),
    "VI.A 1b": (CAR, PRIMARY, LOW_BELOW),
    "VI.A 1c": (CAR, PRIMARY, HIGH_SAME),
    "VI.A 1d": (CAR, PRIMARY, APART),
    "VI.A 1e": (CAR, PRIMARY, FALLING),
    "VI.A 1f": (CAR, PRIMARY, GROWING_FAN),
    "VI.A 1g": (CAR, PRIMARY, NEARER),
    "VI.A 1h": (CAR, PRIMARY, SLOW),
    "VI.A 2a": (BOGIE, PRIMARY, MATTERS),
    "VI.A 2b": (BOGIE, PRIMARY, AT_LOW_SPEED),
    "VI.A 2c": (BOGIE, PRIMARY, LOW_BELOW),
    "VI.A 2d": (BOGIE, PRIMARY, HIGH_ABOVE),
    "VI.A 2e": (BOGIE, PRIMARY, RISING),
    "VI.A 2f": (BOGIE, PRIMARY, GROWING_FAN),
    "VI.A 3a": (SECONDARY_STROKE, PRIMARY, SAME),
    "VI.A 3b": (SECONDARY_STROKE, PRIMARY, FALLING),
    "VI.A 3c": (SECONDARY_STROKE, PRIMARY, GROWING_FAN),
    "VI.A 3d": (SECONDARY_STROKE, PRIMARY, NEARER),
    "VI.A 3e": (SECONDARY_STROKE, PRIMARY, SLOW),
    "VI.A 3f": (SECONDARY_STROKE, PRIMARY, APART),
    "VI.A 4a": (PRIMARY_STROKE, PRIMARY, TURNS),
    "VI.A 4b": (PRIMARY_STROKE, PRIMARY, TURNS_MORE),
    "VI.A 4c": (PRIMARY_STROKE, PRIMARY, FALLING),
    "VI.A 4d": (PRIMARY_STROKE, PRIMARY, ONE_LAW),
    "VI.B 1a": (CAR, SECONDARY, AT_LOW_SPEED),
    "VI.B 1b": (CAR, SECONDARY, LOW_BELOW),
    "VI.B 1c": (CAR, SECONDARY, HIGH_SAME),
    "VI.B 1d": (CAR, SECONDARY, APART),
    "VI.B 1e": (CAR, SECONDARY, FALLING),
    "VI.B 1f": (CAR, SECONDARY, ONE_LAW),
    "VI.B 1g": (CAR, SECONDARY, NEARER),
    "VI.B 2a": (BOGIE, SECONDARY, MATTERS),
    "VI.B 2b": (BOGIE, SECONDARY, AT_LOW_SPEED),
    "VI.B 2c": (BOGIE, SECONDARY, LOW_BELOW),
    "VI.B 2d": (BOGIE, SECONDARY, NEARER),
    "VI.B 2e": (BOGIE, SECONDARY, FALLING),
    "VI.B 2f": (BOGIE, SECONDARY, ONE_LAW),
    "VI.B 3a": (SECONDARY_STROKE, SECONDARY, NEARER),
    "VI.B 3b": (SECONDARY_STROKE, SECONDARY, ARRIVES),
    "VI.B 3c": (SECONDARY_STROKE, SECONDARY, FALLING),
    "VI.B 3d": (SECONDARY_STROKE, SECONDARY, ONE_LAW),
    "VI.B 4a": (PRIMARY_STROKE, SECONDARY, SOFTEST_NEAREST),
    "VI.B 4b": (PRIMARY_STROKE, SECONDARY, FALLING),
    "VI.B 4c": (PRIMARY_STROKE, SECONDARY, ONE_LAW),
    "V.B b": (CAR, PRIMARY, SAME),
    "V.B c": (SECONDARY_STROKE, PRIMARY, SAME),
    "V.B d": (BOGIE, PRIMARY, MATTERS),
    "V.B e": (PRIMARY_STROKE, PRIMARY, MATTERS),
}
"""What a claim about one scan reads, and the surfaces that make it true and false."""


def on_plane(car: float, bogie: float, strokes: float = 0.0, stiff: float | None = None) -> xr.Dataset:
    """A grid with constant departures of each response; `stiff` is that of all where both joints are stiffest."""
    grid = empty_grid()
    departures = {CAR: car, BOGIE: bogie, SECONDARY_STROKE: strokes, PRIMARY_STROKE: strokes}
    for name, departure in departures.items():
        full = grid[f"traditional_{name}_rms"] * (1 + departure)
        grid[f"{name}_rms"] = full.expand_dims({PRIMARY: TABLE_I, SECONDARY: TABLE_I}).copy()
        if stiff is not None:
            at = {PRIMARY: TABLE_I[-1], SECONDARY: TABLE_I[-1]}
            grid[f"{name}_rms"].loc[at] = grid[f"traditional_{name}_rms"] * (1 + stiff)
    return grid


def track(shifted: bool) -> xr.Dataset:
    """Heights under four wheels of 30 Hz and 3 Hz, with their lags, or without any."""
    time, lag = np.arange(0, 10, 0.001), np.array([0.0, 0.02, 0.09, 0.11])
    seen = time - (lag[:, None] if shifted else 0 * lag[:, None])
    heights = np.sin(2 * np.pi * 3 * seen) + 0.1 * np.sin(2 * np.pi * 30 * seen)
    coordinates = {"time": ("sample", time), "axle": [1, 2, 3, 4]}
    return xr.Dataset({"track_height": (("axle", "sample"), heights), "lag": ("axle", lag)}, coordinates)


def spectra(high: bool) -> xr.Dataset:
    """Flat PSDs that joints double above 10 Hz, or below it, with the corner at 10 Hz."""
    doubled = (FREQUENCY > 10) == high
    point = {key: [value] for key, value in PAPER_POINT.items()}
    variables, coordinates = {}, {**point, "frequency": FREQUENCY}
    for name, response in RESPONSES.items():
        if response.paper:
            places = len(response.positions)
            coordinates[response.dimension] = list(response.positions)
            dims = (*JOINTS, "speed", response.dimension, "frequency")
            ones = np.ones((1, 1, 1, places, FREQUENCY.size))
            variables[f"{name}_psd"] = (dims, ones + doubled)
            variables[f"traditional_{name}_psd"] = (dims[2:], ones[0, 0])
    return xr.Dataset(variables, coordinates, {"corner_frequency": 10.0})


WHOLE: dict[str, tuple[xr.Dataset, xr.Dataset]] = {
    "V.A a": (track(True), track(False)),
    "V.B f": (on_plane(0.1, 0.3), on_plane(0.3, 0.1)),
    "V.B g": (spectra(True), spectra(False)),
    "VII 1": (on_plane(0.2, 0.2, 0.2), on_plane(0.07, 0.07, 0.07)),  # more than 10 %: "significantly"
    "VII 2a": (on_plane(0.2, 0.2), on_plane(0.02, 0.02)),
    "VII 2b": (on_plane(0.2, 0.2, 0.2, stiff=0.01), on_plane(0.01, 0.01, 0.01, stiff=0.2)),
    "VII 3": (on_plane(-0.1, -0.1), on_plane(0.1, 0.1)),
}
"""Datasets that make claims about more than one scan true and false."""


def datasets(key: str) -> tuple[xr.Dataset, xr.Dataset]:
    """A dataset in which the claim is true everywhere, and one in which it is true nowhere or nearly so."""
    if key in WHOLE:
        return WHOLE[key]
    response, joint, (true, false) = SURFACES[key]
    return put(empty_grid(), response, joint, true), put(empty_grid(), response, joint, false)


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.key)
def test_a_claim_holds_where_it_is_true_and_fails_where_it_is_not(claim):
    true, false = (claim.finding(dataset) for dataset in datasets(claim.key))
    assert (true.verdict, true.share) == (HOLDS, 1.0)
    assert true.where == "at every point"
    assert false.verdict == FAILS
    assert false.share < CHOSEN.mostly
    assert true.numbers
    assert true.numbers != false.numbers


def test_the_table_has_every_claim_once_with_section_item_and_words():
    keys = [claim.key for claim in CLAIMS]
    assert len(set(keys)) == len(keys)
    assert set(keys) == set(SURFACES) | set(WHOLE)
    for claim in CLAIMS:
        assert claim.key.startswith(claim.section)
        assert claim.section in ("V.A", "V.B", "VI.A", "VI.B", "VII")
        assert claim.item
        assert len(claim.text) > 20


@pytest.mark.parametrize("key", sorted(SURFACES))
def test_a_claim_without_a_number_does_not_hold(key):
    claim = next(claim for claim in CLAIMS if claim.key == key)
    assert claim.finding(empty_grid()).verdict == FAILS


def test_a_claim_that_is_true_at_some_speeds_only_holds_partly_and_says_where():
    claim = next(claim for claim in CLAIMS if claim.key == "VI.A 1b")
    # below the traditional model at 100 to 130 km/h of the 100 to 150 km/h that count as low speed
    grid = put(empty_grid(), CAR, PRIMARY, lambda k, v: np.where(v < 0.16, -0.1, 0.1))
    found = claim.finding(grid)
    assert found.verdict == PARTLY
    assert found.share == pytest.approx(4 / 6)
    assert found.where == "at 24 of 36: all but 0.5, 1, 5, 10, 50 and 100 MN/m at 140-150 km/h"
    assert "−10.0 %" in found.numbers
    assert "+10.0 %" in found.numbers


def test_claims_are_about_ratios_so_that_the_track_drops_out():
    for key in ("VI.A 2c", "VI.B 4a", "VII 3"):
        claim = next(claim for claim in CLAIMS if claim.key == key)
        for dataset in datasets(key):
            rougher = dataset * 3.7
            assert claim.finding(rougher).share == claim.finding(dataset).share


def test_a_claim_is_read_where_it_is_told_to():
    claim = next(claim for claim in CLAIMS if claim.key == "VI.A 2d")
    grid = put(empty_grid(), BOGIE, PRIMARY, HIGH_ABOVE[0])
    elsewhere = judging.PLACES | {"bogie": "rear"}
    assert claim.finding(grid).verdict == HOLDS
    assert claim.finding(grid, elsewhere).verdict == FAILS  # nothing is known of the rear bogie


def test_verdicts_are_three():
    assert VERDICTS == (HOLDS, PARTLY, FAILS)
