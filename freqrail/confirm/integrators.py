"""Time integration of dx/dt = A x + B v for many records at once.

An integrator is a generator: it steps through the track's start and one period after it and yields blocks of the
states at evenly spaced times of that period. All take the linear state space of `equations.state_space`, or several of
them stacked, and a state of many columns, one a record, so that the interpreter's cost of a step is paid once.

- `rk45` and `radau`: scipy's, with error control;
- `exponential`: the matrix-exponential recurrence, exact for the splines that the track is made of, whatever
  the stiffness. With a first-order hold in place of the splines it would be as wrong as linear interpolation;
- `newmark`: beta = 1/4, gamma = 1/2, which the paper used for the traditional model. Of second order in the step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm
from scipy.sparse import csc_matrix, identity, kron

from freqrail.confirm.track_record import Track, basis_polynomials
from freqrail.errors import NumericalError
from freqrail.model.equations import StateSpace
from freqrail.types import SecondsProgress

INTEGRATORS = ("rk45", "exponential", "newmark", "radau")
BLOCK = 500  # samples handed over at once
DIVERGED = 1e9  # times the expected size of a state, beyond which a run has failed


@dataclass(frozen=True)
class Accuracy:
    """What the integrators are told about accuracy.

    relative: rtol of rk45 and radau. absolute: atol, as a share of each state's size. longest_step: s, of rk45
    and radau. substeps: newmark's steps in one step of the track.
    """

    relative: float = 1e-6
    absolute: float = 1e-6
    longest_step: float = np.inf
    substeps: int = 1


def stack(models: list[StateSpace]) -> StateSpace:
    """Several models under the same wheels as one, the states of each after those of the one before."""
    return StateSpace(
        block_diag(*(m.a for m in models)),
        np.vstack([m.b for m in models]),
        tuple(state for m in models for state in m.states),
    )


def integrate(
    integrator: str,
    model: StateSpace,
    track: Track,
    start: NDArray[np.float64],
    size: NDArray[np.float64],
    stride: int,
    accuracy: Accuracy,
    progress: SecondsProgress = lambda seconds: None,
) -> Iterator[NDArray[np.float64]]:
    """States at every `stride`-th step of the track's period, in blocks [samples, states, records].

    start: the state at the track's start, [states, records]. size: [states], what the states' magnitude is
    expected to be. stride divides the period's samples. progress: called with the simulated seconds just done.

    Raises NumericalError if the integration fails or the states grow without bound; ValueError for newmark on a model
    whose dampers have states of their own.
    """
    if integrator in ("rk45", "radau"):
        return _adaptive(integrator, model, track, start, size, stride, accuracy, progress)
    one_step = {"exponential": exponential_recurrence, "newmark": newmark_recurrence}[integrator]
    return _recurrent(one_step(model, track, accuracy.substeps), track, start, size, stride, progress)


# --- with error control ----------------------------------------------------------------------------


def _adaptive(
    integrator: str,
    model: StateSpace,
    track: Track,
    start: NDArray[np.float64],
    size: NDArray[np.float64],
    stride: int,
    accuracy: Accuracy,
    progress: SecondsProgress,
) -> Iterator[NDArray[np.float64]]:
    solver = solver_of(integrator, model, track, start, size, accuracy)
    times = stride * track.step * np.arange(track.samples // stride)
    limit = DIVERGED * np.repeat(size, start.shape[1])
    done = 0
    block: list[NDArray[np.float64]] = []
    while done < times.size:
        message = solver.step()
        if solver.status == "failed" or not np.all(np.abs(solver.y) <= limit):
            reason = message or "the states grow without bound"
            raise NumericalError(f"{integrator} failed at {solver.t + track.startup:.3g} s: {reason}")
        progress(solver.t - solver.t_old)
        upto = done + int(np.searchsorted(times[done:], solver.t, side="right"))
        if upto > done:
            # [states x records, samples] between the ends of this step
            inside = solver.dense_output()(times[done:upto])
            block += list(inside.T.reshape(-1, *start.shape))
            done = upto
        if len(block) >= BLOCK or done == times.size:
            yield np.array(block)
            block = []


def solver_of(
    integrator: str,
    model: StateSpace,
    track: Track,
    start: NDArray[np.float64],
    size: NDArray[np.float64],
    accuracy: Accuracy,
) -> Any:
    """scipy's RK45 or Radau at the track's start, its state the columns [states, records] laid flat."""
    from scipy.integrate import RK45, Radau

    records = start.shape[1]

    def slope(time: float, flat: NDArray[np.float64]) -> NDArray[np.float64]:
        return (model.a @ flat.reshape(start.shape) + model.b @ track.heights(time)).ravel()

    options: dict[str, Any] = {
        "rtol": accuracy.relative,
        "atol": accuracy.absolute * np.repeat(size, records),
        "max_step": accuracy.longest_step,
    }
    if integrator == "radau":
        options["jac"] = csc_matrix(kron(csc_matrix(model.a), identity(records)))
    method = {"rk45": RK45, "radau": Radau}[integrator]
    return method(slope, -track.startup, start.ravel(), track.end, **options)


# --- by recurrence ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Recurrence:
    """z(t + h) = advance z(t) + sum over j of forcing[j] u_j, over one step h of the track or a part of it.

    advance: [z, z]. forcing: [j, z, wheels]. inputs: reads the u_j from a track, (track, first step, count) to
    [count x parts, j, wheels, records]. parts: recurrences in one step of the track. lift: from a state
    [states, records] and the heights [wheels, records] to z. states: which entries of z are the model's states.
    """

    advance: NDArray[np.float64]
    forcing: NDArray[np.float64]
    inputs: Callable[[Track, int, int], NDArray[np.float64]]
    parts: int
    lift: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
    states: NDArray[np.int64]


def exponential_recurrence(model: StateSpace, track: Track, substeps: int = 1) -> Recurrence:
    """x(t + h) = e^{Ah} x(t) + sum_j Gamma_j c_j, exact for a track that is a spline with coefficients c.

    Gamma_j = integral over the step of e^{A(h - s)} B N_j(s/h) ds. The moments of e^{A(h - s)} B with the powers
    (s/h)^p come from exponentials of A bordered by a chain of integrators (C. F. Van Loan, IEEE Trans. Autom.
    Control 23 (1978) 395, doi:10.1109/TAC.1978.1101743). `substeps` is ignored: there is nothing to refine.
    """
    states, wheels = model.b.shape
    powers = track.degree + 1
    # with w_0 = 1, dw_p/d(s/h) = p w_(p-1): the forcing B w_p enters the states
    chain = np.zeros((states + powers * wheels,) * 2)
    chain[:states, :states] = model.a * track.step
    eye = np.eye(wheels)
    moments = []
    for p in range(powers):
        bordered = chain.copy()
        bordered[:states, states + p * wheels : states + (p + 1) * wheels] = model.b * track.step
        for k in range(1, p + 1):
            rows, columns = (slice(states + n * wheels, states + (n + 1) * wheels) for n in (k, k - 1))
            bordered[rows, columns] = k * eye
        moments.append(expm(bordered)[:states, states : states + wheels])
    forcing = np.einsum("jp,psw->jsw", basis_polynomials(track.degree), np.array(moments))

    def inputs(track: Track, first: int, count: int) -> NDArray[np.float64]:
        return np.stack([track.coefficients[first + j : first + j + count] for j in range(powers)], axis=1)

    return Recurrence(expm(model.a * track.step), forcing, inputs, 1, lambda state, heights: state, np.arange(states))


def newmark_recurrence(model: StateSpace, track: Track, substeps: int = 1) -> Recurrence:
    """Newmark's method with beta = 1/4, gamma = 1/2 (constant average acceleration) as a recurrence in [q', q, q''].

    For q'' = -C q' - K q + B v, in `substeps` equal steps h to a step of the track. Raises ValueError for a model
    that has states other than q' and q, as one with damper joints does. Source: N. M. Newmark, J. Eng. Mech. Div. ASCE
    85 (1959) 67.
    """
    beta, gamma = 1 / 4, 1 / 2
    n = model.b.shape[0] // 2
    rates = np.array([state.endswith("/dt") for state in model.states])
    v, q = np.flatnonzero(rates), np.flatnonzero(~rates)
    if v.size != q.size:
        raise ValueError("newmark: the dampers of this model have states of their own; it serves the traditional one")
    h = track.step / substeps
    damping, stiffness, coupling = -model.a[np.ix_(v, v)], -model.a[np.ix_(v, q)], model.b[v]
    one, none = np.eye(n), np.zeros((n, n))
    # q'' (new) = inverse [B v - C (q' + (1 - gamma) h q'') - K (q + h q' + (1/2 - beta) h^2 q'')]
    inverse = np.linalg.inv(one + gamma * h * damping + beta * h**2 * stiffness)
    to_acceleration = -inverse @ np.hstack(
        [damping + h * stiffness, stiffness, (1 - gamma) * h * damping + (1 / 2 - beta) * h**2 * stiffness]
    )
    advance = np.vstack(
        [
            np.hstack([one, none, (1 - gamma) * h * one]) + gamma * h * to_acceleration,
            np.hstack([h * one, one, (1 / 2 - beta) * h**2 * one]) + beta * h**2 * to_acceleration,
            to_acceleration,
        ]
    )
    push = inverse @ coupling
    forcing = np.vstack([gamma * h * push, beta * h**2 * push, push])[None]

    def inputs(track: Track, first: int, count: int) -> NDArray[np.float64]:
        ends = [track.at_steps(first, count, (k + 1) / substeps) for k in range(substeps)]
        return np.stack(ends, axis=1).reshape(-1, 1, *ends[0].shape[1:])

    def lift(state: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.vstack([state[v], state[q], (model.a @ state + model.b @ heights)[v]])

    return Recurrence(advance, forcing, inputs, substeps, lift, np.argsort(np.concatenate([v, q])))


def _recurrent(
    rule: Recurrence,
    track: Track,
    start: NDArray[np.float64],
    size: NDArray[np.float64],
    stride: int,
    progress: SecondsProgress,
) -> Iterator[NDArray[np.float64]]:
    z = rule.lift(start, track.heights(-track.startup))
    total = track.before + track.samples
    first = 0
    while first < total:
        # a block starts where the start ends, so that the samples of the period fall on its steps
        count = min(BLOCK * stride, (track.before if first < track.before else total) - first)
        inputs = rule.inputs(track, first, count)
        pushes = sum(rule.forcing[j] @ inputs[:, j] for j in range(inputs.shape[1]))
        kept = np.empty((count, *z.shape))
        for step in range(count):
            kept[step] = z
            for part in range(rule.parts):
                z = rule.advance @ z + pushes[step * rule.parts + part]
        if not np.all(np.abs(z[rule.states]) <= DIVERGED * size[:, None]):
            raise NumericalError(f"the states grow without bound, at {(first + count) * track.step:.3g} s")
        if first >= track.before:
            yield kept[::stride, rule.states]
        progress(count * track.step)
        first += count
