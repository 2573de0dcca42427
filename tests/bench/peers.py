"""Other ways to the same RMS values: what a user would write without freqrail.

Each takes a single vehicle, a speed [m/s], a spectrum and a band [Hz] and returns the eleven RMS values
of the paper's four responses, in the order car front, centre, rear, bogies, secondary, primary strokes.
"""

from __future__ import annotations

import numpy as np

from freqrail.track import frequency_psd
from freqrail.vehicle import half_vehicle, state_space

LINES = 1000


def outputs(vehicle):
    """Rows [11, 10] that read the responses off q, and how often each is differentiated."""
    a = vehicle.half_bogie_spacing
    car = [[1, -a, *[0] * 8], [1, 0, *[0] * 8], [1, a, *[0] * 8]]
    bogies = np.eye(10)[[2, 6]]
    legs = [leg.elongation for leg in half_vehicle(vehicle).legs]
    return np.array([*car, *bogies, *legs]), np.array([2] * 5 + [0] * 6)


def trapezoid(f):
    """The frequencies f [n] and the weights of the trapezoidal rule on them."""
    step = np.diff(f)
    return f, np.r_[step[0], step[1:] + step[:-1], step[-1]] / 2


def lagged_input(vehicle, omega, speed):
    """The four wheels' heights [n, 4] per unit of the first wheel's, with their lags (eq. 2)."""
    a, b = 2 * vehicle.half_wheelbase / speed, 2 * vehicle.half_bogie_spacing / speed
    return np.exp(-1j * np.outer(omega, [0, a, b, a + b]))


def user_loop(vehicle, speed, spectrum, band):
    """A loop over frequencies with np.linalg.solve of the 26 x 26 state matrix, as one would first write it."""
    model = state_space(half_vehicle(vehicle))
    rows, order = outputs(vehicle)
    f, weight = trapezoid(np.geomspace(*band, LINES))
    density = frequency_psd(spectrum, f, speed)
    n = len(model.a)
    identity = np.eye(n)
    variance = np.zeros(len(rows))
    for k, fk in enumerate(f):
        s = 2j * np.pi * fk
        v = lagged_input(vehicle, np.array([2 * np.pi * fk]), speed)[0]
        x = np.linalg.solve(s * identity - model.a, model.b @ v)
        response = s**order * (rows @ x[-10:])
        variance += np.abs(response) ** 2 * density[k] * weight[k]
    return np.sqrt(variance)
