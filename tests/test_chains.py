"""The chains that tests hold the blocks to: against their own equations, and as columns times powers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from freqrail.model.equations import system_response
from freqrail.model.inputs import wheel_lags
from tests.chains import (
    CHAINS,
    FAMILIES,
    LAG_COLUMNS,
    chain_response,
    chain_responses,
    chain_system,
    column_powers,
    column_signs,
    lag_columns,
    response_psd,
    top_products,
    track_response,
)
from tests.helpers import ALL_NAMES, MODELS, VEHICLES, density, explicit_responses, random_vehicles

OMEGA = 2 * np.pi * np.geomspace(1e-3, 1e3, 601)
EPSILON = np.finfo(float).eps


@pytest.mark.parametrize("vehicle", MODELS.values(), ids=MODELS.keys())
@pytest.mark.parametrize("chain", CHAINS)
def test_a_chain_is_the_response_of_its_own_equations(vehicle, chain):
    response = chain_response(vehicle, chain, OMEGA)
    q = system_response(chain_system(vehicle, chain), OMEGA)[:, :, 0]
    bodies = ("car", "bogie", "wheelset")[-q.shape[1] :]
    for body, expected in zip(bodies, q.T, strict=True):
        np.testing.assert_allclose(response.top * response.ratios[body], expected, rtol=1e-8)


@pytest.mark.parametrize("chain", CHAINS)
def test_ratios_are_per_unit_displacement_of_the_top_body(chain, paper_vehicle):
    response = chain_response(paper_vehicle, chain, OMEGA)
    assert np.all(response.ratios["bogie" if chain == "bogie_pitch" else "car"] == 1)


@pytest.mark.parametrize("name", ALL_NAMES)
@settings(deadline=None, max_examples=15)
@given(
    seed=st.integers(0, 10**6),
    speed=st.floats(3.0, 160.0),
)
@example(seed=1591, speed=90.171875)  # at 177 rad/s half the wheelbase is a quarter of the wave but for 8e-5
def test_columns_times_powers_are_the_square_of_the_sum(name, seed, speed):
    """|T|^2 as seven real columns of the lags times powers of the vehicle, none of which knows of the other."""
    (vehicle,) = random_vehicles(1, seed)
    omega = OMEGA[::5]
    series, chains = FAMILIES[name], chain_responses(vehicle, omega)
    columns = lag_columns(vehicle, omega, np.array([speed]))
    assert columns.shape == (LAG_COLUMNS, omega.size, 1)
    square = np.abs(track_response(series, vehicle, omega, speed, chains)) ** 2
    for place, position in enumerate(series.signs):
        signs = column_signs(position)
        powers = list(column_powers(series, vehicle, omega, chains, top_products(chains)))
        terms = np.array([signs[column] * power * columns[column, :, 0] for column, power in powers])
        # where a cosine vanishes, what is left of it is the rounding of its angle
        loss = 1e-12 * np.sum(np.abs(terms), axis=0) + 8 * EPSILON * np.sum(np.abs([p for _, p in powers]), axis=0)
        assert np.all(np.abs(np.sum(terms, axis=0) - square[place]) <= loss)


def test_lags_stay_when_geometry_and_speed_grow_together():
    vehicle = VEHICLES[0]
    larger = replace(
        vehicle, half_bogie_spacing=2 * vehicle.half_bogie_spacing, half_wheelbase=2 * vehicle.half_wheelbase
    )
    speed = np.array([20.0, 60.0])
    assert np.array_equal(lag_columns(larger, OMEGA, 2 * speed), lag_columns(vehicle, OMEGA, speed))
    assert np.array_equal(wheel_lags(larger, 2 * speed[0]), wheel_lags(vehicle, speed[0]))


@pytest.mark.parametrize("name", ALL_NAMES)
def test_psd_is_the_square_of_the_response_times_the_track_per_hz(name, german_low):
    vehicle, speed = VEHICLES[3], 60.0
    frequency = np.geomspace(0.1, 100, 50)
    omega = 2 * np.pi * frequency
    expected = np.abs(explicit_responses(vehicle, omega, speed, (name,))[name]) ** 2
    expected = expected * 2 * np.pi * density(german_low, omega, speed)
    found = response_psd(FAMILIES[name], vehicle, german_low, frequency, speed)
    assert np.all(found >= 0)
    np.testing.assert_allclose(found, expected, rtol=1e-7)
