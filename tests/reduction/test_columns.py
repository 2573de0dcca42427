"""Columns: the sum of products is |h|^2, whatever the scalars, and as short as the paper's vehicle allows."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.outputs import Displacement, Elongation, Output
from freqrail.reduction.columns import Reduction, reduce
from tests.plain_vehicles import MAKERS, as_system, outputs_of, places

LENGTHS = {"half_bogie_spacing": 8.0, "half_wheelbase": 1.1}


def test_the_papers_responses_have_seven_lag_functions_and_three_three_three_and_seven_products():
    for lengths in (LENGTHS, {"half_bogie_spacing": np.array([6.0, 9.0]), "half_wheelbase": 1.1}):
        found = reduce(half_vehicle(), outputs(), lengths)
        assert len(found.lags) == 7
        assert [len(columns) for columns in found.columns.values()] == [3, 3, 3, 7, 7, 1, 1]


def by_columns(found: Reduction, name: str, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """|h|^2 at every label from the columns; x [scalars, n] complex, u [wheels, n]."""

    def part(z: np.ndarray, which: str) -> np.ndarray:
        return z.real if which == "re" else z.imag

    total = 0.0
    for column in found.columns[name]:
        lag = found.lags[column.lag]
        function = lag.factor * part((lag.one @ u) * np.conj(lag.other @ u), lag.part)
        power = sum(factor * part(x[i] * np.conj(x[j]), which) for i, j, which, factor in column.powers)
        total = total + np.multiply.outer(column.weights, power * function)
    return total


@pytest.mark.parametrize("kind", MAKERS)
def test_the_columns_are_the_square_of_the_sum_for_any_scalars_and_any_speed(kind):
    plain = MAKERS[kind](np.random.default_rng(11))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    rng = np.random.default_rng(0)
    x = rng.normal(size=(len(found.scalars), 40)) + 1j * rng.normal(size=(len(found.scalars), 40))
    u = np.exp(1j * np.multiply.outer(places(plain), rng.uniform(0.01, 3.0, 40)))
    for name, labels in found.sums.items():
        direct = np.array([np.abs(sum(x[i] * (w @ u) for i, w in terms)) ** 2 for terms in labels])
        np.testing.assert_allclose(by_columns(found, name, x, u), direct, atol=1e-11 * np.max(direct))


def test_a_tap_of_something_that_there_is_not_is_refused():
    for tap, words in (
        (Displacement({"z_x": 1.0}), "no freedom 'z_x' to read; there are z_c, beta_c"),
        (Elongation("tertiary"), "no leg or wheel 'tertiary' to read; there are secondary_1"),
    ):
        with pytest.raises(ValueError, match=words):
            reduce(half_vehicle(), (Output("x", "m", "", (("", tap),)),), LENGTHS)
