"""Mean squares of plain vehicles over a band: Gauss-Legendre panels that close in on a dense solution's peaks."""

from __future__ import annotations

import numpy as np

from freqrail.model.assembled import state_space
from tests.independent import density, reference_nodes
from tests.plain_vehicles import TRACK, Plain, as_system, dense_matrices, dense_outputs, lagged, places


def peaks(plain: Plain, low: float, high: float) -> np.ndarray:
    """Resonances between two frequencies, as poles: where 1/|q| has minima on a fine grid, and their widths.

    From the dense response itself, refined around every minimum.
    """
    omega = np.geomspace(low, high, 4000)
    found = []

    def size(at: np.ndarray) -> np.ndarray:
        return np.max(np.abs(dense_outputs(plain, at)["force"]), axis=(0, 2))

    level = size(omega)
    for k in np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])) + 1:
        a, b = omega[k - 1], omega[k + 1]
        for _ in range(12):  # by thirds of a finer and finer grid
            fine = np.linspace(a, b, 21)
            top = int(np.argmax(size(fine)))
            a, b = fine[max(top - 2, 0)], fine[min(top + 2, 20)]
        centre = (a + b) / 2
        peak = size(np.array([centre]))[0]
        width = centre
        while width > 1e-12 * centre and size(np.array([centre + width]))[0] < peak / 2:
            width /= 1.5
        found.append(-width + 1j * centre)
    return np.array(found)


def _eigenvalues(plain: Plain) -> np.ndarray:
    """Where peaks are and how wide, as poles: modes of the dense equations, the stiffness frozen at their frequency.

    They only say where to look closely; what is integrated is the dense solution. A peak of a damping ratio of a
    millionth is narrower than any grid that looks for it.
    """
    masses = np.array([plain.values[inertia] for inertia in plain.freedoms.values()])
    scale = 1 / np.sqrt(np.outer(masses, masses))

    def modes(omega: float) -> np.ndarray:
        z = dense_matrices(plain, np.array([1j * omega]))[0][0]
        found = 1j * np.sqrt(np.linalg.eigvals((z + omega**2 * np.diag(masses)) * scale))
        return np.where(found.imag < 0, -found, found)

    result = []
    for start in modes(50.0):
        p = start
        for _ in range(60):
            near = modes(abs(p.imag))
            p = near[np.argmin(np.abs(near.imag - p.imag))]
        result.append(-abs(p.real) + 1j * p.imag)
    system = as_system(plain)
    if system.rational:  # what moves inside a law, as the rail under a wheel, is no freedom of the dense equations
        inner = np.linalg.eigvals(state_space(system, plain.values).a)
        result.extend(inner[inner.imag > 0])
    return np.array(result)


def band_rms(plain: Plain, speed: float, low: float, high: float) -> dict[str, np.ndarray]:
    """RMS of `outputs_of`, {name: [labels]}, by Gauss-Legendre panels that close in on the dense response's peaks."""
    x = places(plain)
    blunt = np.geomspace(low, high, 40) * (-0.1 + 1j)  # what is not sharp calls for panels of a tenth of a frequency
    sharp = np.concatenate([peaks(plain, low, high), blunt, _eigenvalues(plain)])
    omega, weights = reference_nodes(low, high, sharp, float(np.ptp(x)) / speed)
    result = {}
    power = 0.0
    for part in np.array_split(np.arange(omega.size), max(1, omega.size // 3000)):
        found = dense_outputs(plain, omega[part])
        g = density(TRACK, omega[part], speed) * weights[part]
        power = {
            name: (0.0 if isinstance(power, float) else power[name])
            + np.array([np.abs(lagged(row, plain, omega[part], speed)) ** 2 @ g for row in each])
            for name, each in found.items()
        }
    for name, each in power.items():
        result[name] = np.sqrt(each)
    return result
