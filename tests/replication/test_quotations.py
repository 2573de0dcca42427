"""What the paper says and what is judged: its own words, and a table of what they mean, written from the words alone.

`CLAUSES` was made from the quotations, not from `claims`: for every claim the clause that makes it, whose response and
which joint it is about, and what it asserts. Three things must agree: the clause is in the quotation, the clause's own
words bear out the assertion (`LEXICON`), and the claim holds in a dataset made from the assertion and fails in one made
from its contrary. A claim judged the wrong way round would need the table and the paper's words to be wrong with it.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from freqrail.replication.claims import CLAIMS
from freqrail.replication.judging import FAILS, HOLDS
from freqrail.replication.quotations import QUOTATIONS
from tests.replication.test_claims import CAR, PRIMARY, SECONDARY, WHOLE, empty_grid, put

PAPER = Path(__file__).parents[3] / "shared" / "paper.txt"
BY_KEY = {claim.key: claim for claim in CLAIMS}

BOGIE, SECONDARY_STROKE, PRIMARY_STROKE = "bogie_acceleration", "secondary_stroke", "primary_stroke"

# key: (response, scanned joint, what is asserted, the clause)
CLAUSES: dict[str, tuple[str, str, str, str]] = {
    "V.B b": (
        CAR,
        PRIMARY,
        "equal",
        "the car body acceleration and secondary suspension vertical stroke is basically identical",
    ),
    "V.B c": (SECONDARY_STROKE, PRIMARY, "equal", "secondary suspension vertical stroke is basically identical"),
    "V.B d": (
        BOGIE,
        PRIMARY,
        "different",
        "the bogie frame vertical acceleration and primary suspension vertical stroke are somewhat different",
    ),
    "V.B e": (PRIMARY_STROKE, PRIMARY, "different", "primary suspension vertical stroke are somewhat different"),
    "VI.A 1a": (CAR, PRIMARY, "more at low speed", "mainly reflected in the lower vehicle running speed"),
    "VI.A 1b": (
        CAR,
        PRIMARY,
        "below at low speed",
        (
            "at a low speed, the car body vertical acceleration with primary vertical damper rubber joint "
            "stiffness is less than that of the traditional model"
        ),
    ),
    "VI.A 1c": (
        CAR,
        PRIMARY,
        "equal at high speed",
        "is basically consistent with the traditional model when the running speed is high",
    ),
    "VI.A 1d": (CAR, PRIMARY, "apart", "the car body vertical acceleration under two models will not be coincidence"),
    "VI.A 1e": (
        CAR,
        PRIMARY,
        "falls",
        (
            "with the increase of the stiffness of the primary damper rubber joint, the car body "
            "acceleration shows a decreasing trend"
        ),
    ),
    "VI.A 1f": (
        CAR,
        PRIMARY,
        "effect grows with speed",
        "the higher the vehicle speed is, the more obvious this effect is",
    ),
    "VI.A 1g": (
        CAR,
        PRIMARY,
        "nears",
        (
            "the car body acceleration is gradually close to that without considering the impact of the "
            "damper joint stiffness"
        ),
    ),
    "VI.A 1h": (CAR, PRIMARY, "slow", "but the change is very slow"),
    "VI.A 2a": (
        BOGIE,
        PRIMARY,
        "different",
        "has a certain influence on the bogie frame acceleration at different vehicle running speed",
    ),
    "VI.A 2b": (BOGIE, PRIMARY, "more at low speed", "which is more significant at the lower vehicle running speed"),
    "VI.A 2c": (
        BOGIE,
        PRIMARY,
        "below at low speed",
        (
            "at a low speed, the bogie frame vertical acceleration with considering the effect of the "
            "primary vertical damper rubber joint stiffness is less than that of the traditional model"
        ),
    ),
    "VI.A 2d": (
        BOGIE,
        PRIMARY,
        "above at high speed",
        "when the vehicle running speed is high, it is greater than that of the traditional model",
    ),
    "VI.A 2e": (
        BOGIE,
        PRIMARY,
        "rises",
        (
            "the greater the primary vertical damper joint stiffness is, the greater the bogie frame "
            "vertical acceleration will be"
        ),
    ),
    "VI.A 2f": (
        BOGIE,
        PRIMARY,
        "effect grows with speed",
        "on the vertical acceleration of the bogie frame increases with the increase of vehicle running speed",
    ),
    "VI.A 3a": (SECONDARY_STROKE, PRIMARY, "equal", "the vertical stroke of the secondary suspension changes little"),
    "VI.A 3b": (
        SECONDARY_STROKE,
        PRIMARY,
        "falls",
        "the greater the joint stiffness is, the smaller the secondary suspension vertical stroke will be",
    ),
    "VI.A 3c": (
        SECONDARY_STROKE,
        PRIMARY,
        "effect grows with speed",
        "on the vertical stroke of the secondary suspension increases with the increase of vehicle speed",
    ),
    "VI.A 3d": (SECONDARY_STROKE, PRIMARY, "nears", "gradually approaches the traditional model"),
    "VI.A 3e": (SECONDARY_STROKE, PRIMARY, "slow", "but the change is very slow"),
    "VI.A 3f": (
        SECONDARY_STROKE,
        PRIMARY,
        "apart",
        "the secondary suspension vertical stroke under the two models can not coincide",
    ),
    "VI.A 4a": (
        PRIMARY_STROKE,
        PRIMARY,
        "nears, then leaves",
        "firstly gradually approaches the traditional model, and then gradually moves away from it",
    ),
    "VI.A 4b": (
        PRIMARY_STROKE,
        PRIMARY,
        "leaves more with speed",
        "this effect is more obvious and higher with the increase of the vehicle running speed",
    ),
    "VI.A 4c": (
        PRIMARY_STROKE,
        PRIMARY,
        "falls",
        (
            "the greater the primary vertical damper joint stiffness is, the smaller the primary suspension "
            "vertical stroke will be"
        ),
    ),
    "VI.A 4d": (PRIMARY_STROKE, PRIMARY, "one law", "is basically the same under the different vehicle running speed"),
    "VI.B 1a": (CAR, SECONDARY, "more at low speed", "mainly reflected in the lower vehicle running speed"),
    "VI.B 1b": (
        CAR,
        SECONDARY,
        "below at low speed",
        (
            "at a low speed, the car body vertical acceleration with secondary vertical damper rubber joint "
            "stiffness is less than that of the traditional mode"
        ),
    ),
    "VI.B 1c": (
        CAR,
        SECONDARY,
        "equal at high speed",
        "is basically the same as that of traditional model when the vehicle running speed is high",
    ),
    "VI.B 1d": (CAR, SECONDARY, "apart", "the car body vertical acceleration under two models will not be coincidence"),
    "VI.B 1e": (
        CAR,
        SECONDARY,
        "falls",
        (
            "with the increase of the stiffness of the secondary damper rubber joint, the car body "
            "acceleration shows a decreasing trend"
        ),
    ),
    "VI.B 1f": (CAR, SECONDARY, "one law", "this effect is basically the same at different vehicle running speed"),
    "VI.B 1g": (
        CAR,
        SECONDARY,
        "nears at high speed",
        "the vehicle speed is high, the car body vertical acceleration will gradually approach traditional model",
    ),
    "VI.B 2a": (
        BOGIE,
        SECONDARY,
        "different",
        "has a certain influence on the bogie frame acceleration at different vehicle running speed",
    ),
    "VI.B 2b": (BOGIE, SECONDARY, "more at low speed", "which is more significant at the lower vehicle running speed"),
    "VI.B 2c": (
        BOGIE,
        SECONDARY,
        "below at low speed",
        (
            "at a low speed, the bogie frame vertical acceleration with considering the effect of secondary "
            "vertical damper rubber joint stiffness is less than that of the traditional model"
        ),
    ),
    "VI.B 2d": (
        BOGIE,
        SECONDARY,
        "nears at high speed",
        (
            "at the high vehicle running speed, with the increase of the secondary vertical damper joint "
            "stiffness, it gradually approaches the traditional model"
        ),
    ),
    "VI.B 2e": (
        BOGIE,
        SECONDARY,
        "falls",
        (
            "the greater the secondary vertical damper joint stiffness is, the smaller the bogie frame "
            "vertical acceleration will be"
        ),
    ),
    "VI.B 2f": (
        BOGIE,
        SECONDARY,
        "one law",
        (
            "the variation law of the bogie frame vertical acceleration with the rubber joint stiffness of "
            "the secondary vertical damper is basically the same under the different vehicle running speed"
        ),
    ),
    "VI.B 3a": (
        SECONDARY_STROKE,
        SECONDARY,
        "nears",
        "the vertical stroke of the secondary suspension gradually approaches the traditional model",
    ),
    "VI.B 3b": (
        SECONDARY_STROKE,
        SECONDARY,
        "arrives",
        "the secondary suspension vertical stroke under the two models is basically the same",
    ),
    "VI.B 3c": (
        SECONDARY_STROKE,
        SECONDARY,
        "falls",
        (
            "the greater the secondary vertical damper joint stiffness is, the smaller the secondary "
            "suspension vertical stroke will be"
        ),
    ),
    "VI.B 3d": (
        SECONDARY_STROKE,
        SECONDARY,
        "one law",
        (
            "the variation law of the vertical stroke of the secondary suspension with the rubber joint "
            "stiffness of the secondary vertical damper is basically the same under the different vehicle "
            "running speed"
        ),
    ),
    "VI.B 4a": (
        PRIMARY_STROKE,
        SECONDARY,
        "leaves",
        (
            "The smaller the secondary vertical damper rubber joint stiffness is, the closer the primary "
            "suspension vertical stroke under the two models is"
        ),
    ),
    "VI.B 4b": (
        PRIMARY_STROKE,
        SECONDARY,
        "falls",
        (
            "the greater the secondary vertical damper joint stiffness is, the smaller the primary "
            "suspension vertical stroke will be"
        ),
    ),
    "VI.B 4c": (
        PRIMARY_STROKE,
        SECONDARY,
        "one law",
        "is basically the same under the different vehicle running speed",
    ),
}
"""Of every claim about one scan."""

GENERAL: dict[str, str] = {
    "V.A a": "consistent, and there is only a certain lag in time between the four wheel-sets",
    "V.B f": (
        "makes the difference between the analysis results of the bogie frame larger, while the "
        "difference between the analysis results of the car body smaller"
    ),
    "V.B g": "mainly reflected in its high frequency range, has little impact on its low frequency characteristics",
    "VII 1": "are significantly affected by the rubber joint stiffness of the primary and secondary vertical dampers",
    "VII 2a": (
        "great errors in calculating the car body vertical acceleration and the bogie frame vertical "
        "acceleration in the low vehicle running speed range"
    ),
    "VII 2b": "the results of the vibration response analysis tend to be consistent",
    "VII 3": "the vibration of the railway vehicle can be alleviated",
}
"""Of the others, whose datasets are `test_claims.WHOLE`: their clauses."""

LEXICON: dict[str, tuple[str, str]] = {
    # assertion: what its clause must say, and what it must not
    "equal": (r"basically identical|changes little", r"different$"),
    "different": (r"different", r"identical|little"),
    "more at low speed": (r"(mainly|more).*lower", r"high"),
    "below at low speed": (r"low speed.*less than", r"greater than"),
    "above at high speed": (r"speed is high.*greater than", r"less than"),
    "equal at high speed": (r"basically (consistent|the same).*high", r"\blow"),
    "apart": (r"not (be coincidence|coincide)", r"basically"),
    "falls": (r"(increase|greater).*(smaller|decreasing)", r"greater.*greater|increasing"),
    "rises": (r"greater.*greater", r"smaller|decreasing"),
    "effect grows with speed": (
        r"higher the vehicle speed.*more|increases with the increase of vehicle",
        r"lower|less",
    ),
    "nears": (r"gradually (close|approaches)", r"away|high"),
    "nears at high speed": (r"high.*approach", r"away|\blow"),
    "slow": (r"very slow", r"fast"),
    "nears, then leaves": (r"firstly.*approaches.*then.*away", r"never"),
    "leaves more with speed": (r"more obvious and higher with the increase of the vehicle", r"lower|less"),
    "one law": (r"basically the same (at|under the) different", r"increases"),
    "arrives": (r"is basically the same$", r"speed"),
    "leaves": (r"smaller.*stiffness.*closer", r"greater"),
}

RESPONSE_WORDS = {
    CAR: r"car body",
    BOGIE: r"bogie frame",
    SECONDARY_STROKE: r"secondary suspension",
    PRIMARY_STROKE: r"primary suspension",
}
JOINT_WORDS = {PRIMARY: r"(primary (vertical )?damper|the joint stiffness)", SECONDARY: r"secondary (vertical )?damper"}

LOW, HIGH = (lambda v: v <= 0.25), (lambda v: v >= 0.75)

# surfaces of the departure over k (stiffness, 0 to 1) and v (speed, 0 to 1): as asserted, and the contrary
SURFACES = {
    "equal": (lambda k, v: 0.01 + 0 * k, lambda k, v: 0.3 + 0 * k),
    "different": (lambda k, v: -0.3 + 0 * k, lambda k, v: 0.01 + 0 * k),
    "more at low speed": (lambda k, v: 0.5 - 0.4 * v, lambda k, v: 0.1 + 0.4 * v),
    "below at low speed": (lambda k, v: np.where(LOW(v), -0.2, 0.2), lambda k, v: np.where(LOW(v), 0.2, -0.2)),
    "above at high speed": (lambda k, v: np.where(HIGH(v), 0.2, -0.2), lambda k, v: np.where(HIGH(v), -0.2, 0.2)),
    "equal at high speed": (lambda k, v: np.where(HIGH(v), 0.01, 0.4), lambda k, v: np.where(HIGH(v), 0.4, 0.01)),
    "apart": (lambda k, v: 0.02 + 0 * k, lambda k, v: 0 * k),
    "falls": (lambda k, v: 0.5 - 0.4 * k, lambda k, v: 0.1 + 0.4 * k),
    "rises": (lambda k, v: 0.1 + 0.4 * k, lambda k, v: 0.5 - 0.4 * k),
    "effect grows with speed": (lambda k, v: k * (0.1 + 0.3 * v), lambda k, v: k * (0.4 - 0.3 * v)),
    "nears": (lambda k, v: -0.5 + 0.4 * k, lambda k, v: -0.1 - 0.4 * k),
    "nears at high speed": (
        lambda k, v: np.where(HIGH(v), 0.5 - 0.4 * k, 0.1 + 0.4 * k),
        lambda k, v: np.where(HIGH(v), 0.1 + 0.4 * k, 0.5 - 0.4 * k),
    ),
    "slow": (lambda k, v: 0.4 - 0.01 * k, lambda k, v: 0.9 - 0.8 * k),
    "nears, then leaves": (lambda k, v: np.abs(0.3 - 0.5 * k), lambda k, v: 0.5 - 0.4 * k),
    "leaves more with speed": (lambda k, v: k * (0.1 + 0.2 * v), lambda k, v: k * (0.3 - 0.2 * v)),
    "one law": (lambda k, v: -k * (1 + v) / 4, lambda k, v: 0.5 * k ** (0.2 + 5 * v)),
    "arrives": (lambda k, v: 0.6 * (1 - k), lambda k, v: 0.6 * k),
    "leaves": (lambda k, v: -0.1 - 0.4 * k, lambda k, v: -0.5 + 0.4 * k),
}


def test_every_claim_has_a_clause_and_no_clause_is_without_a_claim():
    assert set(CLAUSES) | set(GENERAL) == set(QUOTATIONS) == set(BY_KEY)
    assert not set(CLAUSES) & set(GENERAL)
    assert set(GENERAL) == set(WHOLE)
    assert {assertion for _, _, assertion, _ in CLAUSES.values()} == set(LEXICON) == set(SURFACES)


@pytest.mark.parametrize("key", QUOTATIONS)
def test_a_quotation_is_one_whole_sentence_that_contains_the_clause(key):
    quotation = QUOTATIONS[key]
    assert quotation == " ".join(quotation.split()) == BY_KEY[key].quotation
    assert re.match(r"[A-Z]", quotation)
    assert quotation.endswith(".")
    assert ". " not in quotation
    assert (CLAUSES[key][-1] if key in CLAUSES else GENERAL[key]) in quotation


@pytest.mark.parametrize("key", CLAUSES)
def test_the_clauses_own_words_bear_out_what_the_table_says_they_assert(key):
    response, joint, assertion, clause = CLAUSES[key]
    says, says_not = LEXICON[assertion]
    assert re.search(says, clause), (assertion, clause)
    assert not re.search(says_not, clause), (assertion, clause)
    named = [r for r, words in RESPONSE_WORDS.items() if re.search(words, QUOTATIONS[key])]
    assert response in named
    if not key.startswith("V.B"):
        assert named == [response]
        assert re.search(JOINT_WORDS[joint], QUOTATIONS[key])
        other = "secondary" if joint == PRIMARY else "primary"
        assert not re.search(f"{other} (vertical )?damper", QUOTATIONS[key])


@pytest.mark.parametrize("key", CLAUSES)
def test_a_claim_is_judged_in_the_direction_of_the_table(key):
    response, joint, assertion, _ = CLAUSES[key]
    asserted, contrary = (put(empty_grid(), response, joint, surface) for surface in SURFACES[assertion])
    assert BY_KEY[key].finding(asserted).verdict == HOLDS
    assert BY_KEY[key].finding(contrary).verdict == FAILS


def test_a_falling_bogie_makes_the_secondary_joints_claim_hold_and_the_primary_joints_fail():
    """VI.A 2e says "the greater", VI.B 2e "the smaller": the one that was judged the wrong way round."""
    for joint, key, verdict in ((SECONDARY, "VI.B 2e", HOLDS), (PRIMARY, "VI.A 2e", FAILS)):
        grid = put(empty_grid(), BOGIE, joint, lambda k, v: 0.5 - 0.4 * k)
        assert BY_KEY[key].finding(grid).verdict == verdict
    assert "the smaller the bogie frame vertical acceleration" in QUOTATIONS["VI.B 2e"]


@pytest.mark.skipif(not PAPER.is_file(), reason="the paper's text is not part of the project")
@pytest.mark.parametrize("key", QUOTATIONS)
def test_a_quotation_is_a_sentence_of_the_paper_in_its_own_section(key):
    raw = PAPER.read_text(encoding="utf-8")
    text = " ".join(raw.split())
    quotation = QUOTATIONS[key]
    assert text.count(quotation) == 1
    place = text.index(quotation)
    # a sentence begins after another's end, after the number of an item, or with a paragraph
    paragraph = f"\n{quotation[:30]}" in raw
    assert paragraph or re.search(r"(\.|\d\)) $", text[:place])
    section, item = BY_KEY[key].section, BY_KEY[key].item
    heads = {
        "V.A": "A. Input model of the track random irregularity",
        "V.B": "B. Vertical random vibration response analysis",
        "VI.A": "A. Influence analysis of the primary vertical damper",
        "VI.B": "B. Influence analysis of the secondary vertical damper",
        "VII": "VII. CONCLUSIONS",
    }
    before = {name: text.rindex(head, 0, place) for name, head in heads.items() if head in text[:place]}
    assert max(before, key=before.get) == section
    if not section.startswith("V."):
        items = re.findall(r"(\d)\) (?=[A-Z])", text[before[section] : place + 1])
        assert items[-1] == item
