"""Blocks of all kinds of vehicles: how many, in which coordinates, and that they leave nothing out."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from freqrail.model.half_vehicle import half_vehicle
from freqrail.reduction import decouple as module
from freqrail.reduction.blocks import blocks_of
from freqrail.reduction.decouple import decouple
from tests.plain_vehicles import MAKERS, as_system, dense_rows

FOUND = {  # (size, inputs) of the blocks
    "the paper's": [(3, 1), (3, 1), (2, 1), (2, 1)],
    "front and rear differ": [(6, 2), (2, 1), (2, 1)],
    "pivots off centre": [(10, 4)],
    "three-axle bogies": [(3, 1), (3, 1), (2, 1), (2, 1), (1, 1), (1, 1)],
    "three axles, off centre": [(10, 4), (1, 1), (1, 1)],
    "one bending mode": [(4, 1), (3, 1), (2, 1), (2, 1)],
    "two bending modes": [(4, 1), (4, 1), (2, 1), (2, 1)],
    "two coupled cars": [(6, 2), (3, 1), (3, 1), (2, 1), (2, 1), (2, 1), (2, 1)],
    "laws with inerters": [(3, 1), (3, 1), (2, 1), (2, 1)],
    "laws without joints": [(3, 1), (3, 1), (2, 1), (2, 1)],
    "a track that yields": [(3, 1), (3, 1), (2, 1), (2, 1)],
    "irrational laws": [(3, 1), (3, 1), (2, 1), (2, 1)],
}
HALF = 1 / np.sqrt(2)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", MAKERS)
def test_every_kind_of_vehicle_falls_into_its_blocks(kind, seed):
    plain = MAKERS[kind](np.random.default_rng(seed))
    _, blocks = blocks_of(as_system(plain), plain.values)
    assert [(block.size, len(block.inputs)) for block in blocks] == FOUND[kind]


def test_the_papers_blocks_are_bounce_pitch_and_two_equal_bogie_pitches_in_exact_coordinates():
    lengths = {"half_bogie_spacing": 8.0, "half_wheelbase": 1.1}
    bounce, pitch, front, rear = blocks_of(half_vehicle(), lengths)[1]
    assert [block.alike for block in (bounce, pitch, front, rear)] == [0, 1, 2, 2]

    def columns(*entries: dict[int, float]) -> np.ndarray:
        return np.array([[entry.get(k, 0.0) for k in range(10)] for entry in entries]).T

    wheels, opposed = {4: 0.5, 5: 0.5, 8: 0.5, 9: 0.5}, {4: 0.5, 5: 0.5, 8: -0.5, 9: -0.5}
    np.testing.assert_array_equal(bounce.basis, columns({0: 1.0}, {2: HALF, 6: HALF}, wheels))
    np.testing.assert_array_equal(pitch.basis, columns({1: 1.0}, {2: HALF, 6: -HALF}, opposed))
    for block, first in ((front, 3), (rear, 7)):
        wheel = {first + 1: HALF, first + 2: -HALF}
        np.testing.assert_array_equal(block.basis, columns({first: 1.0}, wheel))


def test_lengths_that_vary_over_the_grid_leave_the_papers_blocks_as_they_are():
    lengths = {"half_bogie_spacing": np.array([6.0, 9.0])[:, None], "half_wheelbase": np.array([1.0, 1.5])}
    varying, one = (
        blocks_of(half_vehicle(), lengths),
        blocks_of(half_vehicle(), {k: v.max() for k, v in lengths.items()}),
    )
    assert varying[0].varying == ("half_bogie_spacing", "half_wheelbase")
    for block, other in zip(varying[1], one[1], strict=True):
        np.testing.assert_array_equal(block.basis, other.basis)


def test_lengths_that_are_equal_at_one_vehicle_only_do_not_decouple_the_grid():
    plain = MAKERS["pivots off centre"](np.random.default_rng(0))
    equal = plain.values | {"leaning": 0.0, "pivot_rear": plain.values["pivot"]}
    assert len(blocks_of(as_system(plain), equal)[1]) == 4
    grid = equal | {"pivot_rear": plain.values["pivot"] * np.array([1.0, 1.1])}
    assert [block.size for block in blocks_of(as_system(plain), grid)[1]] == [6, 2, 2]


@pytest.mark.parametrize("kind", MAKERS)
def test_blocks_hold_all_of_the_matrices_and_nothing_between_them(kind):
    """The struts of the blocks, put back into q, are the sums of row row^T over the legs of each law."""
    plain = MAKERS[kind](np.random.default_rng(7))
    system = as_system(plain)
    lengths, blocks = blocks_of(system, plain.values)
    basis = np.concatenate([block.basis for block in blocks], axis=1)
    np.testing.assert_allclose(basis.T @ basis, np.eye(len(basis)), atol=1e-14)
    rows = np.concatenate(dense_rows(plain))
    for law in system.laws:
        some = [k for k, (_, each) in enumerate(system.rows) if each == law]
        found = np.zeros((len(basis), len(basis)))
        for block in blocks:
            for strut in block.struts:
                if strut.law == law:
                    row = block.basis @ np.array(lengths.evaluate(strut.row, plain.values))
                    found += np.outer(row, row)
        expected = rows[some].T @ rows[some]
        np.testing.assert_allclose(found, expected, atol=2e-12 * np.max(np.abs(expected)))
    for block in blocks:
        for column, inertia in zip(block.basis.T, block.inertias, strict=True):
            owners = [name for f, name in enumerate(plain.freedoms.values()) if column[f]]
            assert set(owners) == {inertia}


@pytest.mark.parametrize("kind", MAKERS)
def test_equal_blocks_have_equal_struts(kind):
    plain = MAKERS[kind](np.random.default_rng(7))
    _, blocks = blocks_of(as_system(plain), plain.values)
    for block in blocks:
        first = blocks[block.alike]
        assert [strut.law for strut in block.struts] == [strut.law for strut in first.struts]
        assert block.inertias == first.inertias
        for strut, other in zip(block.struts, first.struts, strict=True):
            np.testing.assert_allclose(strut.row, other.row, atol=1e-13)


def test_blocks_that_still_feel_each_other_are_taken_together(monkeypatch):
    """A coupling that the search does not see, as one of nearly equal eigenvalues, is found when blocks are checked."""
    diagonals = [np.ones(2)]
    coupled = [np.diag([1.0, 2.0]), np.array([[1.0, 1e-10], [1e-10, 5.0]])]
    (block,) = decouple(diagonals, coupled)
    assert block[0].shape == (2, 2)
    monkeypatch.setattr(module, "LEFT", 1e-9)
    assert len(decouple(diagonals, coupled)) == 2


def test_the_coordinates_have_the_same_bits_in_every_process():
    code = (
        "import numpy as np, hashlib, sys\n"
        "from freqrail.model.half_vehicle import half_vehicle\n"
        "from freqrail.reduction.blocks import blocks_of\n"
        "found = blocks_of(half_vehicle(), {'half_bogie_spacing': 8.0, 'half_wheelbase': 1.1})[1]\n"
        "print(hashlib.sha256(b''.join(b.basis.tobytes() for b in found)).hexdigest())\n"
    )
    digests = {subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout for _ in range(2)}
    assert len(digests) == 1
    assert len(digests.pop()) == 65
