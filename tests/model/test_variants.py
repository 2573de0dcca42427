"""Variants: what they fix, and what the default one is."""

from __future__ import annotations

import math

from freqrail.model.variants import BASE, DEFAULT, PREFIXES, TRADITIONAL, Variant


def test_the_default_is_the_paper_s_traditional_model():
    assert DEFAULT == (TRADITIONAL,)
    assert dict(TRADITIONAL.values) == {"primary_joint_stiffness": math.inf, "secondary_joint_stiffness": math.inf}
    assert list(PREFIXES) == ["", "traditional_"]


def test_the_vehicle_itself_fixes_nothing_and_has_no_prefix():
    assert (BASE.prefix, BASE.fixed) == ("", frozenset())


def test_a_variant_that_fixes_the_contact_fixes_both_names_of_it():
    assert Variant("hard", "", {"contact_stiffness": 1e9}).fixed == {"contact_stiffness", "contact_constant"}
    assert Variant("heavy", "", {"bogie_mass": 700.0}).fixed == {"bogie_mass"}


def test_the_traditional_vehicle_is_the_default_variant(paper_vehicle):
    rigid = paper_vehicle.traditional()
    assert {name: getattr(rigid, name) for name in TRADITIONAL.values} == dict(TRADITIONAL.values)
