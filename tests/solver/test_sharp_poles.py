"""Inverses of blocks beside sharp poles, and the circles around them."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.reduction.columns import reduce
from freqrail.solver import whole_axis_gradients
from freqrail.solver.block_response import parts_of
from freqrail.solver.sharp_poles import circles, local_inverses
from tests.plain_vehicles import MAKERS, as_system, outputs_of


def inverse_at(reduction, values, block: int, s: complex) -> np.ndarray:
    at = np.array([s])
    return np.linalg.inv(parts_of(reduction.blocks[block], reduction.lengths, values, at, at**2, {}).matrix())[0]


@pytest.mark.parametrize("kind", ["the paper's", "pivots off centre", "three axles, off centre"])
def test_beside_poles_the_inverse_is_what_it_is_without_them(kind):
    """Away from the poles, where both are good; of a block with one wheelset, and with four and six nearly alike."""
    plain = MAKERS[kind](np.random.default_rng(52))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    poles, _ = whole_axis_gradients._poles(found, plain.values)
    for block, p in poles[0].items():
        local = local_inverses(found, plain.values, block, p, p.imag > 600)
        for each in local:
            for offset in 0.3 * each.radius * np.exp(1j * np.arange(6.0)):
                expected = inverse_at(found, plain.values, block, each.centre + offset)
                (own,) = each.at(each.centre, np.array([offset]))
                scale = np.sqrt(np.abs(np.diag(expected)))
                assert np.max(np.abs(own - expected) / np.outer(scale, scale)) < 1e-9
        assert sum(len(each.poles) for each in local) == np.sum(p.imag > 600)


def test_poles_too_near_to_others_have_no_inverse_of_their_own():
    plain = MAKERS["the paper's"](np.random.default_rng(52))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    poles, _ = whole_axis_gradients._poles(found, plain.values)
    (p, *_) = poles[0].values()
    crowded = np.append(p, p[p.imag > 600] + 0.5)  # which is not asked for, and so may not be inside
    assert local_inverses(found, plain.values, 0, crowded, np.arange(crowded.size) < p.size) is None


def test_circles_hold_every_pole_once_and_no_mirror_image():
    rng = np.random.default_rng(3)
    for _ in range(50):
        poles = -(10.0 ** rng.uniform(-3, 0, 6)) + 1j * (1000 + rng.normal(0, 10.0 ** rng.uniform(-4, 1), 6))
        others = np.append(-np.conj(poles), -5 + 700j)
        found = circles(poles, others)
        if found is not None:
            held = np.array([[abs(p - c.centre) < c.radius for c in found] for p in poles])
            assert np.all(np.sum(held, axis=1) == 1)
            assert not any(abs(other - c.centre) < c.radius for other in others for c in found)
