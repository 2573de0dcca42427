"""Laws of elements: limits, slopes, energy and realisation, against formulas written out and complex steps."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.case.law_text import law_of, parse_law
from freqrail.model.elements import (
    BY_S,
    Bending,
    ComplexSpring,
    Dashpot,
    Fractional,
    Inerter,
    Law,
    Parallel,
    Series,
    Spring,
    Tabulated,
)

VALUES = {"k": 4e5, "K": 5e6, "c": 5e4, "b": 300.0, "K2": 3e6, "c2": 2e3}
VALUES |= {"eta": 0.1, "C": 1.2e7, "alpha": 0.19, "t": 1.1, "f0": 9.0, "zeta": 0.015}
ELEMENTS: dict[str, Law] = {
    "k": Spring("k"),
    "K": Spring("K"),
    "c": Dashpot("c"),
    "b": Inerter("b"),
    "K2": Spring("K2"),
    "c2": Dashpot("c2"),
    "B": Bending("b", "f0", "zeta"),
    "h": ComplexSpring("K", "eta"),
    "f": Fractional("C", "alpha"),
    "t": Tabulated("t", (1.0, 20.0, 400.0), (1e6 + 1e4j, 1.5e6 + 9e4j, 3e6 + 1e5j)),
}
RATIONAL = (
    "k",
    "c",
    "b",
    "k | c",
    "K - c - K",
    "k | (K - c - K)",
    "k | (K - c - K) | (K2 - c2)",
    "(k | c2) - K",
    "(k | (K2 - c2)) - (K | c)",
    "k | (K - (b | c))",
    "(b | c) - (k | c2)",
    "b - b",
    "B",
)
OTHERS = ("h", "f | k", "f - c", "t", "h | (K - c)", "t - (k | c)")
S = np.array([1e-6j, 1j, -3.0 + 40j, 25.0, -2.0, 1e4j])


def law(text, elements):
    """A law of text."""
    return law_of(parse_law(text), elements)


@pytest.mark.parametrize("joint", [1e3, 5e6, 1e12, np.inf])
@pytest.mark.parametrize("damping", [0.0, 1e-3, 5e4])
def test_the_papers_leg_is_eqs_6_to_8_for_every_joint_and_damper(joint, damping):
    own = law("k | (K - c - K)", ELEMENTS)
    values = {"k": 4e5, "c": damping, "K": joint}
    expected = 4e5 + damping * S / (1 + damping * S * 2 / joint)
    np.testing.assert_allclose(own.stiffness(values, S), expected, rtol=1e-14)
    np.testing.assert_allclose(own.compliance(values, S), 1 / expected, rtol=1e-14)


def test_values_broadcast_and_limits_hold_place_by_place():
    own = law("k | (K - c - K)", ELEMENTS)
    joints, dampings = np.array([1e4, 5e6, np.inf])[:, None, None], np.array([0.0, 1e4])[:, None]
    together = own.stiffness({"k": 1e5, "c": dampings, "K": joints}, S)
    assert together.shape == (3, 2, S.size)
    for i, j in np.ndindex(3, 2):
        alone = own.stiffness({"k": 1e5, "c": dampings[j, 0], "K": joints[i, 0, 0]}, S)
        np.testing.assert_array_equal(together[i, j], alone)


def test_series_is_the_sum_of_compliances_and_parallel_that_of_stiffnesses():
    k, c, b = 4e5, 5e4 * S, 300.0 * S**2
    series = Series((Spring("k"), Dashpot("c"), Inerter("b"))).stiffness(VALUES, S)
    np.testing.assert_allclose(series, 1 / (1 / k + 1 / c + 1 / b), rtol=1e-13)
    np.testing.assert_allclose(
        Parallel((Spring("k"), Dashpot("c"), Inerter("b"))).stiffness(VALUES, S), k + c + b, rtol=1e-13
    )


def test_a_rigid_spring_is_no_compliance_and_leaves_what_is_in_series_with_it():
    values = VALUES | {"K": np.inf}
    assert Spring("K").compliance(values, 1j) == 0
    np.testing.assert_allclose(law("K - c", ELEMENTS).stiffness(values, S), 5e4 * S, rtol=1e-14)


@pytest.mark.parametrize("text", RATIONAL + OTHERS)
def test_slopes_are_those_of_differences(text):
    own = law(text, ELEMENTS)
    at = 1j * np.array([0.7, 9.0, 130.0])  # any law, the irrational ones only here
    slopes = own.slopes(VALUES, at)
    assert set(slopes) == {*own.names, BY_S}
    for name in own.names:
        step = 1e-5 * VALUES[name]
        up, down = (own.stiffness(VALUES | {name: VALUES[name] + h}, at) for h in (step, -step))
        expected = (up - down) / (2 * step)
        np.testing.assert_allclose(slopes[name] + 0 * at, expected, rtol=1e-8, atol=1e-9 * np.max(np.abs(expected)))
    step = 1e-5 * at  # along the axis
    expected = (own.stiffness(VALUES, at + step) - own.stiffness(VALUES, at - step)) / (2 * step)
    scale = np.abs(own.stiffness(VALUES, at) / at)
    assert np.all(np.abs(slopes[BY_S] - expected) <= 1e-8 * scale)


@pytest.mark.parametrize("text", RATIONAL)
def test_the_energy_that_a_law_takes_is_the_imaginary_part_of_its_stiffness(text):
    own = law(text, ELEMENTS)
    p = np.array([-0.5 + 7j, -20.0 + 90j, 1j])
    taken, kinetic = own.loss(VALUES, p)
    stiffness = own.stiffness(VALUES, p)
    found = p.imag * taken + (p * p).imag * kinetic
    np.testing.assert_allclose(found, np.imag(stiffness + 0 * p), rtol=1e-9, atol=1e-12 * np.max(np.abs(stiffness)))
    assert np.all(np.asarray(taken) >= 0)
    assert np.all(np.asarray(kinetic) >= 0)


@pytest.mark.parametrize("text", RATIONAL)
def test_the_realisation_is_the_law(text):
    own = law(text, ELEMENTS)
    np.testing.assert_allclose(
        own.realisation(VALUES).stiffness(S), own.stiffness(VALUES, S) + 0 * S, rtol=1e-9, atol=1e-9
    )


def test_a_realisation_knows_rigid_joints_and_missing_dampers_place_by_place():
    joint, damping = np.array([1e5, 5e6, np.inf])[:, None], np.array([0.0, 5e4])
    values = VALUES | {"K": joint, "c": damping}
    for text in ("k | (K - c - K)", "(k | (K2 - c2)) - (K | c2)"):
        own = law(text, ELEMENTS)
        found = own.realisation(values)
        for s in S:
            np.testing.assert_allclose(
                found.stiffness(s) + 0 * damping * joint.clip(max=1),
                own.stiffness(values, s) + 0 * damping * joint.clip(max=1),
                rtol=1e-8,
                atol=1e-8,
            )


@pytest.mark.parametrize("text", OTHERS)
def test_laws_without_a_differential_equation_have_no_realisation(text):
    own = law(text, ELEMENTS)
    assert not own.rational
    assert own.realisation(VALUES) is None


def test_a_complex_spring_and_a_fractional_element_are_their_formulas():
    np.testing.assert_allclose(ELEMENTS["h"].stiffness(VALUES, 1j), 5e6 * (1 + 0.1j))
    np.testing.assert_allclose(ELEMENTS["f"].stiffness(VALUES, 1j * 3), 1.2e7 * 3**0.19 * np.exp(0.5j * np.pi * 0.19))


def test_a_table_is_straight_between_its_points_and_constant_beyond():
    found = ELEMENTS["t"].stiffness(VALUES | {"t": 1.0}, 1j * np.array([0.1, 10.5, 1e4]))
    np.testing.assert_allclose(found, [1e6 + 1e4j, 1.25e6 + 5e4j, 3e6 + 1e5j])


@pytest.mark.parametrize(
    ("frequencies", "stiffnesses", "words"), [((1.0,), (1.0,), "two or more"), ((2.0, 1.0), (1.0, 1.0), "increase")]
)
def test_a_table_that_is_none_is_refused(frequencies, stiffnesses, words):
    with pytest.raises(ValueError, match=words):
        Tabulated("t", frequencies, stiffnesses)


def test_a_formula_is_a_tree():
    assert law("k|(K-c-K)", ELEMENTS) == Parallel((Spring("k"), Series((Spring("K"), Dashpot("c"), Spring("K")))))
    assert law(" ( k ) ", ELEMENTS) == Spring("k")
    assert law("k | (K - c - K)", ELEMENTS).names == ("k", "K", "c")
