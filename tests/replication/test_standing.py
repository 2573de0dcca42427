"""How firmly verdicts stand: the told range of each threshold is where a verdict is the same, and not beyond."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from freqrail.replication import judging, report
from freqrail.replication.claims import CLAIMS
from freqrail.replication.standing import standing, standings
from freqrail.replication.thresholds import CHOSEN, KNIFE_EDGE, MEANING, PLAUSIBLE, SHARES, Thresholds
from freqrail.result import netcdf
from tests.replication.test_claims import CAR, PRIMARY, empty_grid, put

COMMITTED = Path(__file__).parents[2] / "results" / "yu-damper-joint"
BY_KEY = {claim.key: claim for claim in CLAIMS}


@pytest.fixture(scope="module")
def datasets() -> dict[str, xr.Dataset]:
    """The committed study."""
    found = {}
    for name in ("grid", "track", "spectra"):
        with netcdf.opened(COMMITTED / f"{name}.nc", result=False) as dataset:
            found[name] = dataset.load()
    return found


@pytest.fixture(scope="module")
def found(datasets):
    return standings(datasets)


def verdict(claim, dataset, **changed: float) -> str:
    return claim.finding(dataset, thresholds=replace(CHOSEN, **changed)).verdict


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.key)
def test_a_verdict_is_the_same_within_the_told_ranges_and_another_beyond(claim, datasets, found):
    dataset = datasets[claim.over]
    chosen = verdict(claim, dataset)
    for name, (low, high) in found[claim.key].ranges.items():
        assert low is None or low <= getattr(CHOSEN, name)
        assert high is None or high >= getattr(CHOSEN, name)
        for end, out in ((low, 1 / 1.001), (high, 1.001)):
            if end is None or name == "region":
                continue
            # a share of true points equal to a threshold on it reaches the better verdict, so the low end is outside
            edge = end * (1 + 1e-6) if name in SHARES and end == low else end
            assert verdict(claim, dataset, **{name: edge}) == chosen, name
            assert verdict(claim, dataset, **{name: end * out}) != chosen, name


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.key)
def test_knife_edges_are_what_a_walk_through_the_plausible_ranges_finds(claim, datasets, found):
    """A share of true points only grows or only shrinks with a threshold: nothing hides between the ends."""
    dataset = datasets[claim.over]
    chosen = verdict(claim, dataset)
    edges = []
    for name in (*SHARES, *claim.outcome(dataset).thresholds):
        low, high = PLAUSIBLE[name]
        walk = np.linspace(low, high, 9) if name in (*SHARES, "region", "mainly") else np.geomspace(low, high, 9)
        # whole steps of the grid's speeds, which are 5 % of the range
        values = [round(v * 20) / 20 + 1e-9 for v in walk] if name == "region" else [low, *walk[1:-1], high]
        if any(verdict(claim, dataset, **{name: float(v)}) != chosen for v in values):
            edges.append(name)
    assert tuple(edges) == found[claim.key].knife_edges


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.key)
def test_a_claim_names_all_thresholds_that_enter_it(claim, datasets):
    dataset = datasets[claim.over]
    true = claim.outcome(dataset).true
    named = claim.outcome(dataset).thresholds
    for field in fields(Thresholds):
        if field.name in (*SHARES, *named):
            continue
        for value in (1e-7, 0.4, 3.0):
            other = claim.outcome(dataset, thresholds=replace(CHOSEN, **{field.name: value})).true
            assert np.array_equal(other.values, true.values), field.name


def test_what_was_chosen_lies_in_the_plausible_range_and_every_threshold_has_a_name():
    names = {field.name for field in fields(Thresholds)}
    assert names == set(PLAUSIBLE) == set(MEANING)
    for name, (low, high) in PLAUSIBLE.items():
        assert low < getattr(CHOSEN, name) < high


def test_a_departure_of_four_per_cent_is_practically_equal_from_four_per_cent_on_and_a_knife_edge():
    grid = put(empty_grid(), CAR, PRIMARY, lambda k, v: 0.04 + 0 * k)
    found = standing(BY_KEY["V.B b"], grid)
    low, high = found.ranges["same"]
    assert low == pytest.approx(0.04, rel=1e-4)
    assert high is None
    assert found.knife_edges == ("same",)
    assert found.words == "equal within: 4.01 % or more"  # rounded inwards: it stands at the number told


def test_a_departure_far_from_every_plausible_threshold_is_no_knife_edge():
    grid = put(empty_grid(), CAR, PRIMARY, lambda k, v: 0.4 + 0 * k)
    found = standing(BY_KEY["V.B b"], grid)
    assert found.knife_edges == ()
    assert found.words == "equal within: 39.9 % or less"


def test_half_of_the_points_is_partly_up_to_a_half_and_a_knife_edge():
    grid = put(empty_grid(), CAR, PRIMARY, lambda k, v: np.where(k < 0.5, 0.01, 0.4))
    found = standing(BY_KEY["VI.A 1c"], grid)
    assert found.ranges["mostly"] == (None, 0.5)
    assert "mostly" in found.knife_edges
    assert "share for partly: 50 % or less" in found.words
    assert "share for holds: above 50 %" in found.words


def test_ranges_told_are_rounded_inwards(datasets, found):
    for key, one in found.items():
        claim = BY_KEY[key]
        chosen = verdict(claim, datasets[claim.over])
        for part in one.words.split("; "):
            if ": " not in part:
                continue
            label, text = part.split(": ")
            name = next(n for n, (words, _) in MEANING.items() if words == label)
            scale = 1 if name == "alike" else 100
            for number in (float(t) for t in text.replace(" %", "").split() if t[0].isdigit()):
                value = number / scale
                if text.startswith("above"):
                    value *= 1 + 1e-6
                if name == "region":
                    value += 1e-9
                assert math.isfinite(value)
                assert verdict(claim, datasets[claim.over], **{name: value}) == chosen, (key, part)


def test_the_report_defines_a_knife_edge_and_counts_them(found):
    by_verdict = {judging.HOLDS: [BY_KEY["V.B c"]], judging.PARTLY: [], judging.FAILS: [BY_KEY["VI.A 1b"]]}
    words = report._edges(by_verdict, found)
    assert words.startswith("**1 of these verdicts ")
    assert KNIFE_EDGE in words
    assert report._firm(found["V.B c"]).endswith("**Knife edge**: equal within")
    assert "Knife edge" not in report._firm(found["VI.A 1b"])
