"""Runs from rest as the paper makes them: what many runs abreast give is what each gives alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from freqrail.confirm.time_side import readout
from freqrail.confirm.track_record import fixed_amplitudes, mean_square, sampled_track, spectral_lines, stream
from freqrail.model.equations import state_space
from freqrail.model.inputs import wheel_lags
from freqrail.model.vehicle import half_vehicle
from freqrail.replication import procedures
from freqrail.replication.procedures import ABSOLUTE, DURATION, RELATIVE, Procedure, run
from tests.chains import FAMILIES, chain_responses, track_response

BAND = (0.1, 100.0)
SPEED = 250 / 3.6
BOGIE = 3  # of the eleven series


@pytest.fixture
def short(monkeypatch):
    """Runs of 1 s, so that the tests take seconds."""
    monkeypatch.setattr(procedures, "DURATION", 1.0)


def track_of(vehicle, spectrum, interpolation, duration):
    lines = spectral_lines(spectrum, SPEED, BAND, duration)
    amplitudes = fixed_amplitudes(lines, stream(0, procedures.KEY, "track", 0))[None]
    return sampled_track(
        lines, amplitudes, wheel_lags(vehicle, SPEED), round(duration * 1000), interpolation=interpolation
    )


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_an_exact_run_is_what_tight_integration_gives(short, paper_vehicle, paper_case, interpolation):
    procedure = Procedure(interpolation=interpolation, start="jump")
    found = run(procedure, [paper_vehicle], paper_case.spectrum, np.array([SPEED]), BAND)[0, :, 0, 0]
    track = track_of(paper_vehicle, paper_case.spectrum, interpolation, 1.0)
    system = half_vehicle(paper_vehicle)
    model = state_space(system)
    times = 0.001 * np.arange(1000)
    solution = solve_ivp(
        lambda t, x: model.a @ x + model.b @ track.heights(t)[:, 0],
        (0, 1),
        np.zeros(26),
        t_eval=times,
        rtol=1e-9,
        atol=1e-12,
        max_step=0.001,
    )
    expected = np.sqrt(np.mean(np.square(readout(system, model, paper_vehicle)[0] @ solution.y), axis=1))
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_runge_kutta_abreast_takes_the_steps_that_scipy_takes_alone(short, paper_vehicle, paper_case):
    vehicles = [replace(paper_vehicle, primary_joint_stiffness=k) for k in (1e6, 100e6)]
    procedure = Procedure("rk45", "rk45", "linear", start="jump")
    found = run(procedure, vehicles, paper_case.spectrum, np.array([SPEED]), BAND)[:, :, 0, 0]
    for vehicle, rms in zip(vehicles, found, strict=True):
        track = track_of(vehicle, paper_case.spectrum, "linear", 1.0)
        system = half_vehicle(vehicle)
        model = state_space(system)
        alone = solve_ivp(
            lambda t, x, m=model, on=track: m.a @ x + m.b @ on.heights(t)[:, 0],
            (0, 1),
            np.zeros(26),
            rtol=RELATIVE,
            atol=ABSOLUTE,
        )
        y = np.square(readout(system, model, vehicle)[0] @ alone.y)
        expected = np.sqrt(np.sum((y[:, 1:] + y[:, :-1]) / 2 * np.diff(alone.t), axis=1))
        # the kinks of the track turn a last bit of a step into more
        np.testing.assert_allclose(rms, expected, rtol=1e-4)


def test_newmark_and_the_exact_recurrence_agree_on_the_strokes(paper_vehicle, paper_case):
    rigid = [paper_vehicle.traditional()]
    runs = [
        run(Procedure(traditional=kind), rigid, paper_case.spectrum, np.array([SPEED]), BAND)[0, :, 0, 0]
        for kind in ("exponential", "newmark")
    ]
    np.testing.assert_allclose(runs[0][5:], runs[1][5:], rtol=2e-3)
    assert runs[0][BOGIE] != pytest.approx(runs[1][BOGIE], rel=1e-4)  # its error shows at high frequency


def test_a_level_start_forgets_itself_into_the_lines_own_rms(paper_vehicle, paper_case):
    # without the resonance that rings on, 20 s from rest come near to the steady response of the same lines
    found = run(Procedure(), [paper_vehicle], paper_case.spectrum, np.array([SPEED]), BAND)[0, :, 0, 0]
    lines = spectral_lines(paper_case.spectrum, SPEED, BAND, DURATION)
    amplitudes = fixed_amplitudes(lines, stream(0, procedures.KEY, "track", 0))[None]
    omega = 2 * np.pi * lines.frequency
    chains = chain_responses(paper_vehicle, omega)
    name = "bogie_acceleration"
    transfer = track_response(FAMILIES[name], paper_vehicle, omega, SPEED, chains)
    expected = np.sqrt(mean_square(np.square(np.abs(transfer)), amplitudes))[:, 0]
    np.testing.assert_allclose(found[3:5], expected, rtol=0.03)


def test_a_vehicle_set_down_on_uneven_track_rings(paper_vehicle, paper_case):
    level, jump = (
        run(Procedure(start=start), [paper_vehicle], paper_case.spectrum, np.array([SPEED]), BAND)[0, BOGIE, 0, 0]
        for start in ("level", "jump")
    )
    assert jump > 2 * level


def test_tracks_are_shared_unless_told_otherwise(short, paper_vehicle, paper_case):
    twins = [paper_vehicle, paper_vehicle]
    shared, own = (
        run(Procedure(own_track=own), twins, paper_case.spectrum, np.array([SPEED]), BAND)[:, BOGIE, 0, 0]
        for own in (False, True)
    )
    assert shared[0] == shared[1]
    assert own[0] != own[1]
