"""Other ways to the same RMS values: what a user would write without freqrail, and what other libraries offer.

Each takes a single vehicle, a speed [m/s], a spectrum and a band [Hz] and returns the eleven RMS values
of the paper's four responses, in the order car front, centre, rear, bogies, secondary, primary strokes.
"""

from __future__ import annotations

import numpy as np

from freqrail.model.equations import state_space
from freqrail.model.inputs import wheel_lags
from freqrail.model.spectrum import frequency_psd
from freqrail.model.vehicle import half_vehicle

LINES = 1000
WHOLE_AXIS = (0.01, 500.0)  # Hz, what a user without a band would take for the whole axis


def outputs(vehicle):
    """Rows [11, 10] that read the responses off q, and how often each is differentiated [11]."""
    a = vehicle.half_bogie_spacing
    car = [[1, -a, *[0] * 8], [1, 0, *[0] * 8], [1, a, *[0] * 8]]
    bogies = np.eye(10)[[2, 6]]
    legs = [leg.elongation for leg in half_vehicle(vehicle).legs]
    return np.array([*car, *bogies, *legs]), np.array([2] * 5 + [0] * 6)


def trapezoid(f):
    """The frequencies f [n] and the weights of the trapezoidal rule on them."""
    step = np.diff(f)
    return f, np.r_[step[0], step[1:] + step[:-1], step[-1]] / 2


def lines(vehicle, speed, spectrum, band):
    """Frequencies [Hz], PSD of the track times weights [m^2], and the wheels' heights with their lags [n, 4]."""
    f, weight = trapezoid(np.geomspace(*(band or WHOLE_AXIS), LINES))
    lags = np.exp(-2j * np.pi * np.outer(f, wheel_lags(vehicle, speed)))
    return f, frequency_psd(spectrum, f, speed) * weight, lags


def user_loop(vehicle, speed, spectrum, band):
    """A loop over frequencies with np.linalg.solve of the 26 x 26 state matrix, as one would first write it."""
    model = state_space(half_vehicle(vehicle))
    rows, order = outputs(vehicle)
    identity = np.eye(len(model.a))
    variance = np.zeros(len(rows))
    for f, power, lags in zip(*lines(vehicle, speed, spectrum, band), strict=True):
        s = 2j * np.pi * f
        x = np.linalg.solve(s * identity - model.a, model.b @ lags)
        variance += np.abs(s**order * (rows @ x[-10:])) ** 2 * power
    return np.sqrt(variance)


def batched_numpy(vehicle, speed, spectrum, band):
    """The same with one np.linalg.solve for all frequencies."""
    model = state_space(half_vehicle(vehicle))
    rows, order = outputs(vehicle)
    f, power, lags = lines(vehicle, speed, spectrum, band)
    s = 2j * np.pi * f
    x = np.linalg.solve(s[:, None, None] * np.eye(len(model.a)) - model.a, (lags @ model.b.T)[..., None])[..., 0]
    return np.sqrt(power @ np.abs(s[:, None] ** order * (x[:, -10:] @ rows.T)) ** 2)


def python_control(vehicle, speed, spectrum, band):
    """python-control's frequency response of the state space, four inputs and eleven outputs."""
    import control

    model = state_space(half_vehicle(vehicle))
    rows, order = outputs(vehicle)
    f, power, lags = lines(vehicle, speed, spectrum, band)
    system = control.ss(model.a, model.b, np.c_[np.zeros((11, len(model.a) - 10)), rows], np.zeros((11, 4)))
    response = control.frequency_response(system, 2 * np.pi * f).complex
    t = np.einsum("own,nw->no", response, lags) * (2j * np.pi * f[:, None]) ** order
    return np.sqrt(power @ np.abs(t) ** 2)


def pyyeti_freqdirect(vehicle, speed, spectrum, band):
    """pyyeti's FreqDirect, second-order equations; a damper's elongation is a freedom without mass."""
    from pyyeti import ode

    system = half_vehicle(vehicle)
    rows, order = outputs(vehicle)
    f, power, lags = lines(vehicle, speed, spectrum, band)
    elongations = np.array([leg.elongation for leg in system.legs])
    spring = np.array([leg.stiffness for leg in system.legs])
    kappa = np.array([leg.joint_stiffness for leg in system.legs]) / 2
    damping = np.array([leg.damping for leg in system.legs])
    contact = np.zeros(10)
    wheels = [wheel for wheel, _ in system.contacts]
    contact[wheels] = [value for _, value in system.contacts]
    k = np.zeros((16, 16))
    k[:10, :10] = elongations.T @ np.diag(spring + kappa) @ elongations + np.diag(contact)
    k[:10, 10:] = -elongations.T * kappa
    k[10:, :10] = -(elongations.T * kappa).T
    k[10:, 10:] = np.diag(kappa)
    m, c = np.diag([*system.inertia, *np.zeros(6)]), np.diag([*np.zeros(10), *damping])
    force = np.zeros((16, len(f)), complex)
    force[wheels] = contact[wheels][:, None] * lags.T
    q = ode.FreqDirect(m, c, k).fsolve(force, f, incrb="").d[:10]
    return np.sqrt(power @ np.abs((2j * np.pi * f[:, None]) ** order * (q.T @ rows.T)) ** 2)


def scipy_rk45(vehicle, speed, spectrum, band, seconds=20.0, seed=0):
    """The paper's way: one 20 s run from rest, default tolerances, the track a sum of harmonics of random phase.

    The track is sampled every millisecond and interpolated linearly, as is commonly done.
    """
    from scipy.integrate import solve_ivp

    model = state_space(half_vehicle(vehicle))
    rows, order = outputs(vehicle)
    low, high = band or WHOLE_AXIS
    f = np.arange(max(low, 1 / seconds), high, 1 / seconds)
    amplitude = np.sqrt(2 * frequency_psd(spectrum, f, speed) / seconds)
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, f.size)
    lags = wheel_lags(vehicle, speed)
    grid = np.arange(-1.0, seconds + 1e-3, 1e-3)
    track = np.concatenate(
        [np.cos(2 * np.pi * np.outer(part, f) + phase) @ amplitude for part in np.array_split(grid, 50)]
    )

    def rate(t, x):
        return model.a @ x + model.b @ np.interp(t - lags, grid, track)

    run = solve_ivp(rate, (0, seconds), np.zeros(len(model.a)), t_eval=np.arange(0, seconds, 2e-3))
    slope = np.array([rate(t, x) for t, x in zip(run.t, run.y.T, strict=True)])
    read = np.where(order == 2, slope[:, :10] @ rows.T, run.y[-10:].T @ rows.T)
    return np.sqrt(np.mean(read**2, axis=0))


PEERS = {
    "loop over frequencies, np.linalg.solve": user_loop,
    "batched np.linalg.solve": batched_numpy,
    "python-control frequency_response": python_control,
    "pyyeti FreqDirect": pyyeti_freqdirect,
    "scipy RK45, 20 s from rest": scipy_rk45,
}
