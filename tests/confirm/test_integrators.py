"""Integrators: each follows the exact solution of a small system as well as its order promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.confirm.integrators import Accuracy, integrate, newmark_recurrence, stack
from freqrail.confirm.track_record import Track, fixed_amplitudes, sampled_track, spectral_lines, stream
from freqrail.errors import NumericalError
from freqrail.model.equations import state_space
from freqrail.model.vehicle import half_vehicle
from tests.chains import chain_system

LAG = np.zeros(1)
PERIOD = 1.0  # s
SPEED = 250 / 3.6


@pytest.fixture(scope="module")
def chain(paper_vehicle):
    """A bogie pitching on its wheelset: 5 states, one of them a damper's own."""
    return state_space(chain_system(paper_vehicle, "bogie_pitch"))


@pytest.fixture(scope="module")
def rigid(paper_vehicle):
    """The same without joints: 4 states."""
    return state_space(chain_system(paper_vehicle.traditional(), "bogie_pitch"))


def track(german_low, samples=1000, before=0, **kwargs) -> Track:
    lines = spectral_lines(german_low, SPEED, (1.0, 30.0), PERIOD)
    records = np.array([fixed_amplitudes(lines, stream(0, "p", "test", r)) for r in range(2)])
    return sampled_track(lines, records, LAG, samples, before, **kwargs)


def steady(model, german_low, time):
    """The exact steady states at `time` from the harmonics, [states, records]."""
    lines = spectral_lines(german_low, SPEED, (1.0, 30.0), PERIOD)
    total = np.zeros((len(model.a), 2))
    for r in range(2):
        record = fixed_amplitudes(lines, stream(0, "p", "test", r))
        for f, a in zip(lines.frequency, record, strict=True):
            x = np.linalg.solve(2j * np.pi * f * np.eye(len(model.a)) - model.a, model.b[:, 0])
            total[:, r] += (x * a * np.exp(2j * np.pi * f * time)).real
    return total


def run(integrator, model, german_low, samples=1000, accuracy=None, stride=4, **kwargs):
    """States at every `stride`-th step of the period, started on the exact solution."""
    size = np.abs(steady(model, german_low, 0.0)).max(axis=1) + 1e-12
    blocks = integrate(
        integrator,
        model,
        track(german_low, samples, **kwargs),
        steady(model, german_low, 0.0),
        size,
        stride,
        accuracy or Accuracy(longest_step=1 / 150),
    )
    return np.concatenate(list(blocks)), size


def error(integrator, model, german_low, samples=1000, accuracy=None, **kwargs):
    """Largest error of a state at mid-period, relative to its size."""
    states, size = run(integrator, model, german_low, samples, accuracy, **kwargs)
    middle = steady(model, german_low, PERIOD / 2)
    return np.max(np.abs(states[len(states) // 2] - middle) / size[:, None])


@pytest.mark.parametrize("integrator", ["rk45", "radau"])
def test_follows_the_exact_steady_state_the_closer_the_tighter_the_tolerance(integrator, chain, german_low):
    loose, tight = (error(integrator, chain, german_low, accuracy=Accuracy(t, t, 1 / 150)) for t in (1e-5, 1e-6))
    assert tight < 5e-5
    assert tight < loose / 4


def test_the_exponential_recurrence_follows_it_but_for_the_images_of_the_spline(chain, german_low):
    assert error("exponential", chain, german_low) < 2e-6


def test_samples_are_evenly_spaced_over_the_period(chain, german_low):
    states, _ = run("exponential", chain, german_low)
    assert states.shape == (250, 5, 2)
    np.testing.assert_allclose(states[0], steady(chain, german_low, 0.0), rtol=1e-12)
    np.testing.assert_allclose(states[125], steady(chain, german_low, PERIOD / 2), atol=1e-6 * np.abs(states).max())


def test_all_integrators_agree_on_the_samples_of_the_traditional_chain(rigid, german_low):
    exact, size = run("exponential", rigid, german_low)
    for integrator in ("rk45", "newmark"):
        found, _ = run(integrator, rigid, german_low, accuracy=Accuracy(1e-6, 1e-6, 1 / 150, substeps=8))
        assert found.shape == exact.shape
        assert np.max(np.abs(found - exact) / size[:, None]) < 1e-3


def test_newmark_is_of_second_order(rigid, german_low):
    errors = [error("newmark", rigid, german_low, accuracy=Accuracy(substeps=n)) for n in (1, 2, 4, 8)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2, atol=0.1)


def test_newmark_without_damping_and_track_keeps_the_energy(paper_vehicle, german_low):
    """beta = 1/4, gamma = 1/2 damps nothing of its own, whatever the step."""
    bare = replace(paper_vehicle, primary_damping=0.0, secondary_damping=0.0)
    system = chain_system(bare, "bogie_pitch")
    model = state_space(system)
    rule = newmark_recurrence(model, track(german_low, samples=100))
    eigenvalues = np.abs(np.linalg.eigvals(rule.advance))
    np.testing.assert_allclose(np.sort(eigenvalues)[-4:], 1, rtol=1e-9)


def test_newmark_refuses_a_model_with_damper_states(chain, german_low):
    with pytest.raises(ValueError, match="states of their own"):
        newmark_recurrence(chain, track(german_low))


def test_the_exponential_recurrence_is_exact_for_the_spline_however_stiff(paper_vehicle, german_low):
    stiff = state_space(chain_system(replace(paper_vehicle, primary_joint_stiffness=1e10), "bogie_pitch"))
    assert error("exponential", stiff, german_low) < 2e-6


def test_the_exponential_recurrence_on_straight_lines_is_as_wrong_as_they_are(chain, german_low):
    assert error("exponential", chain, german_low, interpolation="linear") > 1e-4


def test_stacked_models_move_as_they_do_alone(chain, rigid, german_low):
    both = stack([chain, rigid])
    alone, size = run("exponential", chain, german_low)
    states, _ = run("exponential", both, german_low)
    np.testing.assert_allclose(states[:, :5] / size[:, None], alone / size[:, None], atol=1e-10)
    assert both.states == (*chain.states, *rigid.states)


def test_the_half_vehicle_has_the_papers_26_states_and_20_in_a_stack(paper_vehicle):
    both = stack([state_space(half_vehicle(v)) for v in (paper_vehicle, paper_vehicle.traditional())])
    assert both.a.shape == (46, 46)
    assert both.b.shape == (46, 4)


@pytest.mark.parametrize("integrator", ["rk45", "exponential"])
def test_states_that_grow_without_bound_end_the_run_with_the_time(integrator, chain, german_low):
    unstable = replace(chain, a=chain.a + 20.0 * np.eye(5))
    size = np.full(5, 1e-3)
    blocks = integrate(
        integrator, unstable, track(german_low), np.full((5, 2), 1e-3), size, 4, Accuracy(longest_step=1 / 150)
    )
    with pytest.raises(NumericalError, match=r"grow without bound"):
        list(blocks)


def test_progress_tells_every_simulated_second_once(chain, german_low):
    told = []
    blocks = integrate(
        "exponential",
        chain,
        track(german_low, before=500),
        np.zeros((5, 2)),
        np.ones(5),
        4,
        Accuracy(),
        told.append,
    )
    list(blocks)
    assert sum(told) == pytest.approx(1.5)
