"""A rational law of an element in time: a spring, a dashpot and an inerter, and branches with inner states.

    D(s) = k + c s + b s^2 + sum of c_j s/(1 + tau_j s)

A branch is a dashpot c_j behind a spring c_j/tau_j (a Maxwell element) with the inner elongation Delta_j:
d Delta_j/dt = (e - Delta_j)/tau_j, its force c_j (e - Delta_j)/tau_j. Any law of springs and dashpots in series and
parallel has this form with positive numbers; with inerters, branches may come as complex conjugate pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from freqrail.types import Number

Polynomial = list[Any]  # coefficients of 1, s, s^2, ..., floats or arrays that broadcast


@dataclass(frozen=True)
class Realisation:
    """k [N/m], c [N s/m], b [kg] and branches (c_j [N s/m], tau_j [s]); each a float or an array over the grid."""

    k: Number
    c: Number
    b: Number
    branches: tuple[tuple[Number, Number], ...] = ()

    def parallel(self, other: Realisation) -> Realisation:
        """Both in parallel."""
        return Realisation(self.k + other.k, self.c + other.c, self.b + other.b, self.branches + other.branches)

    def stiffness(self, s: Number) -> Number:
        """D(s) of the form above, N/m."""
        return self.k + self.c * s + self.b * s * s + sum(c * s / (1.0 + tau * s) for c, tau in self.branches)


def times(a: Polynomial, b: Polynomial) -> Polynomial:
    """The product of two polynomials; coefficients that are the float 0 stay it."""
    result: Polynomial = [0.0] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            if not (_none(x) or _none(y)):
                result[i + j] = result[i + j] + np.multiply(x, y)
    return result


def added(a: Polynomial, b: Polynomial) -> Polynomial:
    """The sum of two polynomials."""
    return [(a[i] if i < len(a) else 0.0) + (b[i] if i < len(b) else 0.0) for i in range(max(len(a), len(b)))]


def of_quotient(n: Polynomial, d: Polynomial) -> Realisation:
    """The realisation of n(s)/d(s), whose numerator's degree is at most two above the denominator's.

    A denominator whose leading coefficients vanish, as those of rigid joints do, gives branches with tau = 0: plain
    dashpots, at every place of the grid as it is there. So a law has as many branches whatever its numbers.
    """
    while len(n) > 1 and len(d) > 1 and _none(n[0]) and _none(d[0]):
        n, d = n[1:], d[1:]
    while len(d) > 1 and _none(d[-1]):
        d = d[:-1]
    b: Number = 0.0
    if len(n) == len(d) + 2:
        b = n[-1] / d[-1]
        n = [x - (b * d[i - 2] if i >= 2 else 0.0) for i, x in enumerate(n)][:-1]
    if len(d) == 1:
        with np.errstate(divide="ignore"):
            k, c = (n[i] / d[0] if i < len(n) else 0.0 for i in (0, 1))
        return Realisation(k, c, b)
    k = n[0] / d[0]
    # (n/d - k)/s = m/d
    m = [(n[i] if i < len(n) else 0.0) - k * (d[i] if i < len(d) else 0.0) for i in range(1, max(len(n), len(d)))]
    if len(d) == 2 and len(m) == 1:
        return Realisation(k, 0.0, b, ((m[0] / d[0], d[1] / d[0]),))
    return _by_roots(k, b, m, d)


def _by_roots(k: Number, b: Number, m: Polynomial, d: Polynomial) -> Realisation:
    """Partial fractions of m/d = c + sum of c_j t/(t + tau_j) in t = 1/s."""
    order = len(d) - 1
    m = (m + [0.0] * (order + 1))[: order + 1]
    coefficients = np.stack(np.broadcast_arrays(*(np.asarray(x, float) for x in (*d, *m))), axis=-1)
    denominator, numerator = coefficients[..., : order + 1], coefficients[..., order + 1 :]
    numerator, denominator = (x / denominator[..., :1] for x in (numerator, denominator))
    # sum of d_i t^(order - i) is monic, its roots t = -tau
    companion = np.zeros((*denominator.shape[:-1], order, order))
    companion[..., 0, :] = -denominator[..., 1:]
    companion[..., range(1, order), range(order - 1)] = 1.0
    roots = np.linalg.eigvals(companion)
    powers = np.arange(order, -1, -1)
    above = np.sum(numerator[..., None, :] * roots[..., None] ** powers, axis=-1)
    slope = np.sum((powers[:-1] * denominator[..., :-1])[..., None, :] * roots[..., None] ** (powers[:-1] - 1), axis=-1)
    instant = np.abs(roots) <= 1e-12 * np.max(np.abs(roots), axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        dampings = np.where(instant, 0.0, above / (roots * slope))
    tau = np.where(instant, 0.0, -roots)
    c = numerator[..., 0] - np.sum(dampings, axis=-1).real
    if not np.iscomplexobj(roots):
        dampings, tau = dampings.real, tau.real
    return Realisation(k, c, b, tuple((dampings[..., j], tau[..., j]) for j in range(order)))


def _none(x: Number) -> bool:
    """Whether a coefficient is not there in any law of its kind; a number that happens to be 0 is no plain float."""
    return type(x) is float and x == 0.0
