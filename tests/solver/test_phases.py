"""Phases in words: one rule from two bogies to trains."""

from __future__ import annotations

import pytest

from freqrail.model.bodies import Body, Part
from freqrail.solver.phases import body_words, leg_words, motion_words, place_words


def train(cars: int, bogies: int, wheelsets: int) -> list[Body]:
    """Cars on bogies on wheelsets, front to rear in each kind."""
    count = cars * bogies * wheelsets
    result = [Body(f"w{k}", "wheelset", 0, count + k // wheelsets) for k in range(count)]
    first = count + cars * bogies
    result += [Body(f"t{k}", "bogie", 1, first + k // bogies) for k in range(cars * bogies)]
    return result + [Body(f"c{k}", "car", 2, None) for k in range(cars)]


def told(bodies: list[Body], kind: str, motion: str, *amplitudes: float) -> str:
    which = tuple(k for k, body in enumerate(bodies) if body.kind == kind)
    alone = kind == "wheelset"
    part = Part("wheelsets" if alone else f"{kind} {motion}", kind, motion, which, which, alone)
    return motion_words(part, bodies, dict(zip(which, amplitudes, strict=True)))


@pytest.mark.parametrize(
    ("motion", "amplitudes", "words"),
    [
        ("bounce", (1, 1), "bogie bounce, in phase"),
        ("bounce", (1, -0.4), "bogie bounce, in antiphase"),
        ("bounce", (1, -0.2), "front bogie bounce"),
        ("pitch", (-1, 1), "bogie pitch, bogies in antiphase"),
        ("pitch", (0.1, 1), "rear bogie pitch"),
        ("bounce", (0, 0), "bogie bounce, 0 0"),
    ],
)
def test_two_bogies(motion, amplitudes, words):
    assert told(train(1, 2, 2), "bogie", motion, *amplitudes) == words


@pytest.mark.parametrize(
    ("amplitudes", "words"),
    [
        ((1, 1, 0.9, 0.9), "wheelsets, all in phase"),
        ((1, 1, -1, -1), "wheelsets, bogies in antiphase"),
        ((1, -1, 1, -1), "wheelsets of a bogie opposed, bogies in phase"),
        ((1, -1, -1, 1), "wheelsets of a bogie opposed, bogies in antiphase"),
        ((0, 0, 1, 1), "wheelsets of the rear bogie in phase"),
        ((0, 0, 1, -1), "wheelsets of the rear bogie opposed"),
        ((0, 0, 0, 1), "rear wheelset of the rear bogie"),
        ((1, 0, 1, 0), "front wheelset of each bogie, bogies in phase"),
        ((1, 0, 0, -1), "outer wheelset of each bogie, bogies in antiphase"),
        ((0, 1, 1, 0), "inner wheelset of each bogie, bogies in phase"),
        ((1, 1, 1, 0), "wheelsets, + + + 0"),
    ],
)
def test_four_wheelsets(amplitudes, words):
    assert told(train(1, 2, 2), "wheelset", "bounce", *amplitudes) == words


def test_three_wheelsets_of_a_bogie_and_three_bogies():
    assert told(train(1, 2, 3), "wheelset", "bounce", 1, 0, -1, 1, 0, -1) == (
        "outer wheelsets of a bogie opposed, bogies in phase"
    )
    assert told(train(1, 2, 3), "wheelset", "bounce", -1, 2, -1, 1, -2, 1) == (
        "middle wheelset of a bogie against the outer ones, bogies in antiphase"
    )
    assert told(train(1, 3, 2), "bogie", "bounce", 1, 0, -1) == "bogie bounce, outer bogies in antiphase"
    assert told(train(1, 3, 2), "bogie", "pitch", 0, 1, 0) == "middle bogie pitch"


def test_trains():
    assert told(train(2, 2, 2), "bogie", "bounce", 1, 1, 1, 1) == "bogie bounce, all in phase"
    assert told(train(2, 2, 2), "bogie", "pitch", 1, 1, 1, 1) == "bogie pitch, bogies all in phase"
    assert told(train(2, 2, 2), "bogie", "bounce", 1, -1, -1, 1) == (
        "bogie bounce, bogies of a car opposed, cars in antiphase"
    )
    assert told(train(2, 2, 2), "bogie", "bounce", 0, 0, 0, 1) == "bogie bounce, rear bogie of the rear car"
    assert told(train(2, 2, 2), "wheelset", "bounce", *(1, 1, -1, -1) * 2) == (
        "wheelsets, bogies of a car opposed, cars in phase"
    )
    assert told(train(4, 1, 1), "car", "bounce", 1, 1, -1, -1) == "car bounce, front and rear cars in antiphase"
    assert told(train(4, 1, 1), "car", "bounce", 1, -1, -1, 1) == "car bounce, + - - +"
    assert told(train(3, 1, 1), "car", "bounce", 1, 0.1, 1) == "car bounce, outer cars in phase"
    assert told(train(1, 1, 1), "car", "bounce", 1) == "car bounce"
    # a bogie each: wheelsets of a bogie are told, bogies by the cars
    assert told(train(2, 1, 1), "bogie", "bounce", 1, -1) == "bogie bounce, in antiphase"


def test_legs_follow_the_bodies_above_them():
    one, two = train(1, 2, 2), train(2, 2, 2)

    def legs(bodies: list[Body], kind: str, *amplitudes: float) -> str:
        which = [k for k, body in enumerate(bodies) if body.kind == kind]
        return leg_words(which, bodies, dict(zip(which, amplitudes, strict=True)))

    assert legs(one, "bogie", 1, 1) == legs(one, "wheelset", 1, 1, 1, 1) == "bounce"
    assert legs(one, "bogie", 1, -1) == legs(one, "wheelset", 1, 1, -1, -1) == "pitch"
    assert legs(one, "wheelset", 1, -1, -1, 1) == "bogie pitch, bogies in antiphase"
    four = train(1, 2, 4)
    assert legs(four, "wheelset", *(2, 1, -1, -2) * 2) == "bogie pitch, bogies in phase"
    assert legs(four, "wheelset", *(1, -1, -1, 1) * 2) == "wheelsets of a bogie + - - +, bogies in phase"
    assert legs(one, "wheelset", 0, 0, 1, -1) == "rear bogie pitch"
    assert legs(one, "bogie", 0, 1) == legs(one, "wheelset", 0, 0, 1, 1) == "rear bogie"
    assert legs(two, "bogie", 1, 1, -1, -1) == "car bounce, in antiphase"
    assert legs(two, "bogie", 1, -1, 1, -1) == "car pitch, cars in phase"
    assert body_words([0, 1, 2, 3], one, dict.fromkeys(range(4), 1.0)) == "wheelsets all in phase"


def test_places():
    bodies = train(1, 2, 2)
    assert [place_words(k, bodies) for k in (0, 3, 4, 5, 6)] == [
        *("wheelset 1", "wheelset 4", "front bogie", "rear bogie"),
        "car",
    ]
