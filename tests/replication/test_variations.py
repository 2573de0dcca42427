"""What a variation explains: verdicts that change beside the exact result at the same points."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.case.parameters import JOINTS
from freqrail.model.responses import PAPER
from freqrail.replication import judging, procedures, report, studies, time_variations
from freqrail.replication.claims import CLAIMS, judge_all
from freqrail.replication.document import Bullets
from freqrail.replication.judging import FAILS, HOLDS, PARTLY, Finding
from freqrail.replication.procedures import Procedure
from freqrail.replication.time_variations import Trial
from freqrail.replication.variations import Variation, beside_own_rigid, relabelled


@pytest.fixture(scope="module")
def exact():
    """The exact grid of the paper's study."""
    return studies.paper_grid()


def finding(verdict: str) -> Finding:
    return Finding(verdict, 0.0, "", "")


def test_changes_are_counted_by_track():
    exact = {"a": finding(FAILS), "b": finding(HOLDS), "c": finding(HOLDS)}
    tracks = [
        {"a": finding(HOLDS), "b": finding(FAILS), "c": finding(PARTLY)},
        {"a": finding(PARTLY), "b": finding(HOLDS), "c": finding(HOLDS)},
    ]
    variation = Variation("question", "name", tracks, exact)
    assert variation.changed == {"a": [HOLDS, PARTLY], "b": [FAILS], "c": [PARTLY]}
    assert variation.mended == {"a": 2}
    assert (variation.gained, variation.lost) == ({"a": 3}, {"b": 2, "c": 1})
    assert variation.balance == 0.0
    assert variation.at_once(["a", "b"]) == 1
    assert [variation.count(verdict) for verdict in (HOLDS, PARTLY, FAILS)] == [1.5, 1.0, 0.5]


@pytest.mark.parametrize("worse", [FAILS, PARTLY])
@pytest.mark.parametrize("better", [HOLDS, PARTLY])
def test_a_step_lost_counts_as_much_as_the_same_step_gained(worse, better):
    up = Variation("question", "name", [{"a": finding(better)}], {"a": finding(worse)})
    down = Variation("question", "name", [{"a": finding(worse)}], {"a": finding(better)})
    assert up.balance == -down.balance == (worse == FAILS) + (better == HOLDS)
    assert (up.gained, up.lost) == (down.lost, down.gained)


def test_the_report_says_which_readings_explain_more_than_they_cost():
    """What makes a failing claim hold partly and two that hold fail partly is no likely reading."""
    claims = CLAIMS[:4]
    failing, *others = (claim.key for claim in claims)
    exact = {failing: finding(FAILS), **dict.fromkeys(others, finding(HOLDS))}
    costly = {**exact, failing: finding(PARTLY), others[0]: finding(PARTLY), others[1]: finding(PARTLY)}
    even = {**exact, failing: finding(PARTLY), others[0]: finding(PARTLY)}
    good = {**exact, failing: finding(HOLDS), others[0]: finding(PARTLY)}
    found = {name: Variation("q", name, [track], exact) for name, track in (("c", costly), ("e", even), ("g", good))}

    def said(*names: str) -> str:
        blocks = report._reading(claims[:1], [], [found[name] for name in names])
        return "\n".join(next(block.items for block in blocks if isinstance(block, Bullets)))

    assert said("c").splitlines() == [
        "No reading explains more than it costs.",
        f"**q: c** explains less than it costs: steps gained 1 ({failing} by 1), lost 2 ({others[0]} by 1, "
        f"{others[1]} by 1). It makes 1 of the 1 claims that fail hold at least partly, up to 1 on one track: "
        f"{failing}.",
    ]
    assert "**q: e** explains as much as it costs" in said("c", "e")
    all_three = said("c", "e", "g").splitlines()
    assert [line.split(" it costs")[0] for line in all_three] == [
        "**q: g** explains more than",
        "**q: c** explains less than",
        "**q: e** explains as much as",
    ]


def test_the_exact_values_relabelled_change_no_verdict(exact):
    joint = np.concatenate([exact[f"{name}_rms"].transpose(..., "speed").values for name in PAPER], axis=2)
    rigid = np.concatenate([exact[f"traditional_{name}_rms"].transpose(..., "speed").values for name in PAPER])
    assert judge_all({"grid": relabelled(exact, joint, rigid)}) == judge_all({"grid": exact})


def test_a_joints_own_effect_is_judged_beside_the_vehicle_with_that_joint_rigid(exact):
    """It about halves from 50 to 100 MN/m; the one from the traditional model keeps what the other joint does."""
    own = beside_own_rigid(exact)
    for joint in JOINTS:
        for name in PAPER:
            alone, both = (abs(judging.scan(d, name, joint).departure).mean("speed") for d in (own, exact))
            assert 0.4 < float(alone.sel(stiffness=100) / alone.sel(stiffness=50)) < 0.6
            assert float(both.sel(stiffness=100) / both.sel(stiffness=50)) > 0.65
    assert judge_all({"grid": exact})["VI.A 1d"].verdict == HOLDS


def test_runs_of_both_scans_and_the_extreme_pairs_are_judged_beside_the_exact_ones(exact, monkeypatch):
    monkeypatch.setattr(procedures, "DURATION", 2.0)
    trials = (
        ("start", Trial("level", Procedure())),
        ("start", Trial("Newmark", Procedure(traditional="newmark"), "level")),
    )
    monkeypatch.setattr(time_variations, "TRIALS", trials)
    monkeypatch.setattr(time_variations, "SPEEDS", (100.0, 250.0, 300.0))
    simulated = []
    level, newmark = time_variations.in_time(exact, studies.study_case(), simulated.append)
    # 13 pairs of joints and the traditional model, then the traditional model alone, at three speeds
    assert sum(simulated) == pytest.approx(2.0 * 3 * (14 + 1))
    assert time_variations.simulated_seconds() == pytest.approx(20.0 * 3 * (14 + 1))
    assert len(time_variations._pairs(studies.TABLE_I, studies.TABLE_I)) == 13
    assert (level.group, level.name, newmark.name) == ("start", "level", "Newmark")
    for variation in (level, newmark):
        assert len(variation.tracks) == 1
        assert set(variation.tracks[0]) == set(variation.exact)
        assert "RMS over the exact one: car body" in variation.note
    # what the joints do to the primary stroke is too large for 2 s of chance to hide
    assert level.tracks[0]["VI.A 4c"].verdict == level.exact["VI.A 4c"].verdict == HOLDS
