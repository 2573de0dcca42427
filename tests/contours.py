"""Mean squares over the whole axis of plain vehicles, by contour integrals of a dense solution: nothing is shared.

For wheels i and j with d = (x_i - x_j)/v >= 0 the integral over all omega of T_i(i w) T_j(-i w) G(w) e^{i w d} is that
of the same function of s around all its poles left of the axis. Circles around clusters of poles do it to full
precision, and do not care whether poles are simple, merge, or meet those of the track. Where the poles are is asked of
the package's assembled equations; were one wrong or missing, so would be the sum.
"""

from __future__ import annotations

import numpy as np

from freqrail.model.assembled import state_space
from freqrail.model.spectrum import RationalSpectrum
from tests.plain_vehicles import Plain, as_system, dense_outputs, places

POINTS = 72
APART = 2.2  # poles of a cluster lie this much nearer to its centre than all others
TWICE = 0.02  # poles nearer to each other than this, relative to mirrored poles, are in one cluster


def circles(poles: np.ndarray, others: np.ndarray) -> list[tuple[complex, float]]:
    """(centre, radius) of circles that hold all poles, each once, and none of `others`."""
    clusters = [[k] for k in range(poles.size)]
    while True:
        found = []
        for number, members in enumerate(clusters):
            centre = complex(np.mean(poles[members]))
            inner = float(np.max(np.abs(poles[members] - centre)))
            rest = np.setdiff1d(np.arange(poles.size), members)
            far = np.concatenate([np.abs(poles[rest] - centre), np.abs(others - centre)])
            outer = float(np.min(far))
            close = max(inner * APART, TWICE * float(np.min(np.abs(others - centre))))
            if outer < close and np.argmin(far) < rest.size:
                nearest = int(rest[np.argmin(far)])
                other = next(n for n, c in enumerate(clusters) if nearest in c)
                clusters[number] = members + clusters.pop(other) if other > number else members + clusters[other]
                if other < number:
                    clusters.pop(other)
                break
            found.append((centre, float(np.sqrt(max(inner, outer / 9) * outer))))
        else:
            return found


def sharpness(plain: Plain) -> float:
    """How much rounding of s grows to at the sharpest peak, -."""
    vehicle = np.linalg.eigvals(state_space(as_system(plain), plain.values).a)
    return float(np.max(np.abs(vehicle / vehicle.real)))


def mean_squares(plain: Plain, spectrum: RationalSpectrum, speed: float) -> dict[str, np.ndarray]:
    """What `outputs_of` names, {name: [labels]}."""
    omega_r, omega_c = spectrum.cutoffs
    vehicle = np.linalg.eigvals(state_space(as_system(plain), plain.values).a)
    poles = np.append(vehicle, -speed * np.array([omega_r, omega_c]))
    x = places(plain)
    first, second = np.nonzero(x[:, None] >= x[None, :] - 1e-12)
    delay = (x[first] - x[second]) / speed
    turn = np.exp(2j * np.pi * (np.arange(POINTS) + 0.5) / POINTS)
    found = [(c, r) for c, r in circles(poles, -poles) if c.imag > -r]  # of others, the conjugates
    centre, radius = (np.array(each)[:, None] for each in zip(*found, strict=True))
    s = (centre + radius * turn).ravel()
    weight = (np.where(centre.imag > radius, 2.0, 1.0) * 2 * np.pi / POINTS * radius * turn).ravel()
    g = spectrum.roughness * omega_c**2 * speed**3
    g = g / (((speed * omega_r) ** 2 - s**2) * ((speed * omega_c) ** 2 - s**2))
    lag = np.exp(np.multiply.outer(s, delay)) * np.where(first == second, 0.5, 1.0) * (weight * g)[:, None]
    here, there = dense_outputs(plain, -1j * s), dense_outputs(plain, 1j * s)
    # wheel by wheel: sum over n and pairs of here[l, n, i] there[l, n, j] lag[n, (i, j)]
    pairs = np.zeros((s.size, x.size, x.size), complex)
    pairs[:, first, second] = lag
    return {
        name: np.einsum("lnj,lnj->l", np.einsum("lni,nij->lnj", here[name], pairs), there[name]).real for name in here
    }
