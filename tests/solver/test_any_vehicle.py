"""Any vehicle through the whole solver: bands, against dense solutions that share nothing."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.model.band import Band
from freqrail.model.spectrum import RationalSpectrum
from freqrail.solver import solve
from freqrail.solver.problem import problem_of
from tests.independent import density, reference_nodes
from tests.plain_vehicles import MAKERS, Plain, as_system, dense_outputs, lagged, outputs_of, places

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
BANDS = [
    Band("frequency", 0.1, 100.0),
    Band("frequency", 0.5, 400.0),  # takes in the wheelsets on a rigid rail
    Band("wavelength", 1.5, 60.0),
    Band("frequency", 8.0, 30.0),
]


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


def reference(plain: Plain, speed: float, low: float, high: float) -> dict[str, np.ndarray]:
    """RMS of `outputs_of`, {name: [labels]}, by Gauss-Legendre panels that close in on the dense response's peaks."""
    x = places(plain)
    blunt = np.geomspace(low, high, 40) * (-0.1 + 1j)  # what is not sharp calls for panels of a tenth of a frequency
    sharp = np.concatenate([peaks(plain, low, high), blunt])
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


@pytest.mark.parametrize("kind", MAKERS)
def test_no_number_is_off_by_more_than_its_estimate(kind):
    """A vehicle of every kind in every band, at three speeds."""
    rng = np.random.default_rng(sum(map(ord, kind)))
    for band in BANDS:
        plain = MAKERS[kind](rng)
        speeds = rng.uniform(8, 100, 2)
        problem = problem_of(as_system(plain), outputs_of(plain), plain.values, speeds, TRACK, band)
        found = solve.solve(problem)
        assert np.all(found.status == 0)
        for k, speed in enumerate(speeds):
            low, high = problem.limits[:, k]
            for name, expected in reference(plain, speed, low, high).items():
                error = np.abs(found.rms[name][:, k] / expected - 1)
                assert np.all(error <= found.relative_error[name][:, k] + 3e-11), (name, band)
                assert np.all(found.relative_error[name][:, k] < 1e-7)
