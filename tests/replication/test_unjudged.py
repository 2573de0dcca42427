"""What the report says that its claims leave out, and where claims exclude each other."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import freqrail
from freqrail.case.parameters import JOINTS
from freqrail.replication import judging
from freqrail.replication.claims import CLAIMS, RESPONSE_NAMES
from freqrail.replication.contradictions import contradictions
from freqrail.replication.document import Bullets
from freqrail.replication.unjudged import absolute, compares_speeds, curve_differences

TABLE = dict.fromkeys(JOINTS, "0.5, 5, 100 MN/m")


@pytest.fixture(scope="module")
def grid() -> xr.Dataset:
    return freqrail.sweep("yu-damper-joint", {**TABLE, "speed": "100:300:50 km/h"})


def test_absolute_departures_are_differences_of_rms_over_one_number_for_all_speeds(grid):
    other = absolute(grid)
    for name in RESPONSE_NAMES:
        difference = grid[f"{name}_rms"] - grid[f"traditional_{name}_rms"]
        one = grid[f"traditional_{name}_rms"].mean("speed")
        found = other[f"{name}_rms"] / other[f"traditional_{name}_rms"] - 1
        np.testing.assert_allclose(found, (difference / one).transpose(*found.dims), rtol=1e-9)
        scan = judging.scan(other, name, JOINTS[0])
        own = judging.scan(grid, name, JOINTS[0])
        span = own.joint.max("stiffness") - own.joint.min("stiffness")
        np.testing.assert_allclose(scan.span / scan.span[0], span / span[0], rtol=1e-9)


def test_the_claims_that_compare_speeds_are_those_whose_words_do():
    keys = {claim.key for claim in CLAIMS if compares_speeds(claim)}
    assert keys == {"VI.A 1a", "VI.A 1f", "VI.A 2b", "VI.A 2f", "VI.A 3c", "VI.B 1a", "VI.B 2b"}


def test_curves_that_differ_in_phase_alone_are_not_alike_though_their_rms_is():
    time = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    places = {"car_position": ("front", "centre", "rear"), "bogie": ("front", "rear"), "axle": (1, 2, 3, 4)}
    dims = {"car_body_acceleration": "car_position", "bogie_acceleration": "bogie", "secondary_stroke": "bogie"}
    dims["primary_stroke"] = "axle"
    variables = {}
    for name, dim in dims.items():
        for prefix, phase in (("", np.pi / 3), ("traditional_", 0.0)):
            curve = np.broadcast_to(np.sin(time + phase), (len(places[dim]), time.size))
            variables[f"{prefix}{name}_history"] = ((dim, "sample"), curve)
    found = curve_differences(xr.Dataset(variables, {dim: list(labels) for dim, labels in places.items()}))
    assert set(found) == set(RESPONSE_NAMES)
    assert list(found.values()) == pytest.approx([1.0] * 4)  # 2 sin(60 degrees/2)


def test_claims_that_cannot_both_be_true_are_kept_apart_from_those_that_are_hard_to_hold_together(grid):
    never, hardly = (block.items for block in contradictions(grid) if isinstance(block, Bullets))
    assert ["VI.A 1b against 1e and 1g" in never[0], "VI.A 3a against VII 1" in never[1]] == [True, True]
    assert len(never) == 2
    assert all("VI.B 1g" not in item for item in (*never, *hardly))  # of high speed alone, as VI.B 1b is of low speed
    for item in hardly:
        assert "VII 2b" not in item or "of this joint alone" in item
