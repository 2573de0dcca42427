"""Why joints do what they do: each number against a formula or a computation of another kind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from freqrail.replication.explanation import explained
from freqrail.replication.mechanism import freed, mechanism, stiffening, wheelbase_filter
from freqrail.result import netcdf
from tests.independent import TRACK, density, lagged, state_matrices

COMMITTED = Path(__file__).parents[2] / "results" / "yu-damper-joint"


@pytest.fixture(scope="module")
def exact():
    with netcdf.opened(COMMITTED / "grid.nc", result=False) as dataset:
        return dataset.load()


def test_the_joints_stiffen_the_secondary_suspension_by_a_sixth_at_the_car_bodys_bounce(exact, paper_case):
    found = stiffening(exact, paper_case)
    omega, c, kappa, k = 2 * np.pi * found.frequency, 54e3, 2.5e6, 412e3
    assert found.frequency == pytest.approx(1.19, abs=5e-3)
    assert found.added == pytest.approx(c**2 * omega**2 / kappa / k)
    dashpot = c * 1j * omega
    assert found.exact == pytest.approx((dashpot / (1 + dashpot / kappa)).real / k)
    assert 0.15 < found.exact < found.added < 0.16
    assert (2 * np.pi * 1.2 * c) ** 2 / kappa / k == pytest.approx(0.161, abs=1e-3)  # at 1.2 Hz
    assert found.car == pytest.approx(0.116, abs=1e-3)
    # springs of that stiffness at all frequencies are about half of the story: the stiffening grows with frequency
    assert found.springs == pytest.approx(0.0636, abs=1e-3)


def test_the_bogie_frames_bounce_is_overdamped_with_rigid_joints_and_a_resonance_with_joints(paper_vehicle):
    found = freed(paper_vehicle)
    # by hand: a bogie between both suspensions, the car body and the rail at rest
    m, c, k = 600.0, 2 * 17e3 + 54e3, 2 * 875e3 + 412e3
    slow, fast = (c - np.sqrt(c**2 - 4 * m * k)) / (2 * m), (c + np.sqrt(c**2 - 4 * m * k)) / (2 * m)
    assert found.rigid == (pytest.approx(slow, rel=0.2), pytest.approx(fast, rel=0.1))
    # with joints the dampers are nearly springs of stiffness kappa at such frequencies
    assert found.joint.natural_frequency == pytest.approx(np.sqrt((k + 3 * 2.5e6) / m) / (2 * np.pi), rel=0.15)
    assert found.joint.natural_frequency == pytest.approx(17.8, abs=0.06)
    assert found.joint.damping_ratio == pytest.approx(0.30, abs=5e-3)


def bogie_rms(vehicle, speed: float, inside: bool) -> float:
    """RMS of the front bogie frame from the typed matrices, trapezoidal rule; lags inside the bogies or none."""
    omega = 2 * np.pi * np.geomspace(0.1, 100, 3000)
    a, b = state_matrices(vehicle)
    states = np.linalg.solve(1j * omega[:, None, None] * np.eye(26) - a, np.broadcast_to(b, (omega.size, 26, 4)))
    placed = vehicle if inside else replace(vehicle, half_wheelbase=0.0)  # the wheels' places alone
    transfer = -(omega**2) * lagged(states[:, -10:], placed, omega, speed)[2]
    return float(np.sqrt(np.trapezoid(np.abs(transfer) ** 2 * density(TRACK, omega, speed), omega)))


@pytest.mark.parametrize(("joint", "flat"), [(0.5, (0.675, 0.749)), (5.0, (0.739, 0.796))])
def test_without_the_lag_inside_the_bogie_the_dip_over_speed_is_gone(exact, paper_case, joint, flat):
    found = wheelbase_filter(exact, paper_case, joint)
    assert float(found.without_lag.min()) == pytest.approx(flat[0], abs=1e-3)
    assert float(found.without_lag.max()) == pytest.approx(flat[1], abs=1e-3)
    assert np.ptp(found.departure.values) > 0.6
    # a stiff joint stands for a rigid one in matrices that need a finite one
    vehicle = replace(paper_case.vehicle, primary_joint_stiffness=1e6 * joint)
    stiff = replace(vehicle, primary_joint_stiffness=1e11, secondary_joint_stiffness=1e11)
    for speed in (100.0, 170.0, 300.0):
        for inside, values in ((True, found.departure), (False, found.without_lag)):
            expected = bogie_rms(vehicle, speed / 3.6, inside) / bogie_rms(stiff, speed / 3.6, inside) - 1
            assert float(values.sel(speed=speed)) == pytest.approx(expected, abs=2e-3)


def test_the_soft_joints_dip_is_where_the_bogies_wheels_cancel_at_its_bounce(exact, paper_case):
    found = wheelbase_filter(exact, paper_case, 0.5)
    assert 150 <= found.speed <= 190
    assert found.cancelled == pytest.approx(found.bounce, rel=0.05)
    assert found.cancelled == pytest.approx(170 / 3.6 / (4 * 0.797))


def test_the_report_tells_the_mechanism_with_the_numbers_computed(exact, paper_case):
    found = mechanism(exact, paper_case)
    text = " ".join(str(block) for block in explained(found))
    for words in ("+15.7 %", "+11.6 %", "17.8 Hz", "0.30", "+67.5 %", "+74.9 %", "2.039 m/s²", "1.454 m/s²", "+13.4 %"):
        assert words in text
    other = replace(found, stiffening=replace(found.stiffening, car=0.4321))
    assert "+43.2 %" in " ".join(str(block) for block in explained(other))
