"""The matrix of a block and its bordered inverse, against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.reduction.columns import reduce
from freqrail.solver import block_matrix
from freqrail.solver.block_matrix import bordered_inverse, inverses, matrix_at, product, start
from freqrail.solver.block_poles import expand
from tests.plain_vehicles import MAKERS, as_system, outputs_of

KINDS = ("the paper's", "one bending mode", "pivots off centre", "a track that yields")


def matrices(kind: str, beside: float = 0.0):
    """(block, matrix at its poles, or beside them) of every block of a vehicle."""
    plain = MAKERS[kind](np.random.default_rng(3))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    for index, each in expand(found, plain.values).items():
        block, poles = found.blocks[index], each.poles[each.weight > 0]
        yield block, matrix_at(block, found.lengths, plain.values, poles * (1 + beside))


@pytest.mark.parametrize("kind", KINDS)
def test_products_and_slopes_are_those_of_the_dense_matrix(kind):
    for (_, here), (_, there) in zip(matrices(kind), matrices(kind, 1e-6), strict=True):
        z = np.random.default_rng(0).normal(size=here.diagonal.shape) + 1j
        dense = here.dense()
        np.testing.assert_array_equal(dense, np.swapaxes(dense, 1, 2))
        np.testing.assert_allclose(here.times(z).T, np.einsum("nij,jn->ni", dense, z), rtol=1e-10, atol=1e-12)
        unscaled = [m.diagonal / np.square(m.scale) for m in (here, there)]
        slope = (unscaled[1] - unscaled[0]) / (there.s - here.s) * np.square(here.scale)
        np.testing.assert_allclose(here.derivative(), slope, rtol=1e-4, atol=1e-4 * np.max(np.abs(slope)))


@pytest.mark.parametrize("kind", KINDS)
def test_the_inverse_is_that_of_the_dense_bordered_matrix(kind):
    for block, matrix in matrices(kind, 1e-5):
        border = start(1, len(block.struts))[0]
        carried, z = bordered_inverse(matrix, border)
        unknowns = len(z)
        dense = np.zeros((matrix.s.size, unknowns + 1, unknowns + 1), complex)
        dense[:, :unknowns, :unknowns] = matrix.dense()
        dense[:, block.size : unknowns, -1] = dense[:, -1, block.size : unknowns] = border
        exact = np.linalg.inv(dense)
        np.testing.assert_allclose(np.moveaxis(carried, -1, 0), exact[:, :-1, :-1], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(z.T, exact[:, :-1, -1], rtol=1e-6, atol=1e-6)


def symmetric(m: int, count: int = 100) -> np.ndarray:
    """Complex symmetric matrices [m, m, count]."""
    rng = np.random.default_rng(m)
    a = rng.normal(size=(m, m, count)) + 1j * rng.normal(size=(m, m, count))
    return np.asarray(a + np.swapaxes(a, 0, 1))


@pytest.mark.parametrize("m", [2, 3, 4, 5])
def test_inverses_by_minors_are_lapacks(m):
    a = symmetric(m)
    inverse = block_matrix._inverses_along(a)
    np.testing.assert_allclose(np.moveaxis(inverse, -1, 0), inverses(np.moveaxis(a, -1, 0)), rtol=1e-9)


@pytest.mark.parametrize("m", [3, 4])
def test_where_a_determinant_cancels_lapack_takes_over(m, monkeypatch):
    """Beside a matrix of rank one minors lose all digits, LAPACK only some."""
    v = symmetric(m, 1)[0]
    a = np.multiply(v[:, None], v[None]) + 1e-9 * symmetric(m, 1)
    unit = np.eye(m)[..., None]

    def left() -> float:
        inverse = block_matrix._inverses_along(a)
        return float(np.max(np.abs(np.einsum("ijn,jkn->ikn", a, inverse) - unit)))

    assert left() < 1e-5
    monkeypatch.setattr(block_matrix, "CANCELLING", 0.0)
    assert left() > 1e-5


def test_what_is_singular_or_no_number_leaves_those_beside_it_alone():
    a = np.moveaxis(symmetric(5, 4), -1, 0).copy()
    alone = inverses(a[2:])
    a[0], a[1] = 0.0, np.nan
    together = inverses(a)
    np.testing.assert_array_equal(together[2:], alone)
    assert np.all(np.isnan(together[1]))


def test_sums_go_one_by_one():
    a, v = symmetric(4, 7), symmetric(4, 7)[0]
    np.testing.assert_array_equal(product(a, v)[:, 3], product(a[..., 3:4].copy(), v[:, 3:4].copy())[:, 0])
