"""Reference solutions that import nothing of freqrail: the paper's vehicle typed in, its equations typed out.

`state_matrices` writes eqs. (3) to (8) as matrices; the integrals sum the four wheels' lags one by one before any
modulus. Vehicles and spectra are anything with the attributes read here. `helpers` puts the package's own matrices into
the same integrals; the benchmarks use this module alone.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss

Vehicle = Any

NAMES = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke")

PAPER = SimpleNamespace(
    car_body_mass=15200.0,
    car_body_pitch_inertia=1019000.0,
    bogie_mass=600.0,
    bogie_pitch_inertia=700.0,
    wheelset_mass=700.0,
    primary_stiffness=875e3,
    primary_damping=17e3,
    primary_joint_stiffness=5e6,
    secondary_stiffness=412e3,
    secondary_damping=54e3,
    secondary_joint_stiffness=5e6,
    half_bogie_spacing=3.289,
    half_wheelbase=0.797,
    contact_stiffness=1.5 * ((15200 / 4 + 600 / 2 + 700) * 9.8) ** (1 / 3) / 5.1824e-8,  # eq. (1)
)
"""Section V's vehicle, with the shipped case's contact constant."""
TRACK = SimpleNamespace(roughness=4.032e-7, cutoffs=(0.0206, 0.8246))
"""Eq. (11)'s numbers."""
SPEED = 250 / 3.6


def state_matrices(vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """A [26, 26] and B [26, 4] of the vehicle with finite joints, states [dq/dt, Delta, q] as in the paper."""
    a, b = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    e = np.zeros((6, 10))  # over a leg: front and rear secondary, primary 1 to 4
    e[0, [0, 1, 2]] = 1, -a, -1
    e[1, [0, 1, 6]] = 1, +a, -1
    e[2, [2, 3, 4]] = 1, -b, -1
    e[3, [2, 3, 5]] = 1, +b, -1
    e[4, [6, 7, 8]] = 1, -b, -1
    e[5, [6, 7, 9]] = 1, +b, -1
    legs = [("secondary", 2), ("primary", 4)]
    k, c, kappa = (
        np.concatenate([np.full(n, getattr(vehicle, f"{stage}_{what}")) for stage, n in legs])
        for what in ("stiffness", "damping", "joint_stiffness")
    )
    kappa = kappa / 2
    bogie = [vehicle.bogie_mass, vehicle.bogie_pitch_inertia, vehicle.wheelset_mass, vehicle.wheelset_mass]
    inertia = np.array([vehicle.car_body_mass, vehicle.car_body_pitch_inertia, *bogie, *bogie])
    contact = np.zeros((10, 4))
    contact[[4, 5, 8, 9], range(4)] = vehicle.contact_stiffness
    stiffness = e.T @ np.diag(k + kappa) @ e + np.diag(contact.sum(axis=1))
    rate = np.diag(kappa / c)
    matrix = np.block(
        [
            [np.zeros((10, 10)), (e.T * kappa) / inertia[:, None], -stiffness / inertia[:, None]],
            [np.zeros((6, 10)), -rate, rate @ e],
            [np.eye(10), np.zeros((10, 6)), np.zeros((10, 10))],
        ]
    )
    return matrix, np.vstack([contact / inertia[:, None], np.zeros((16, 4))])


def lags(vehicle: Vehicle, speed: float) -> np.ndarray:
    """Eq. (2): tau = 0, 2 L_t/v, 2 L_c/v, 2 (L_t + L_c)/v."""
    a, b = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    return np.array([0, 2 * b / speed, 2 * a / speed, 2 * (b + a) / speed])


def lagged(per_wheel: np.ndarray, vehicle: Vehicle, omega: np.ndarray, speed: float) -> np.ndarray:
    """Sum over the wheels [n, ..., 4] with exp(-i omega tau_i): per metre of track under the FIRST wheel."""
    return np.einsum("n...w,nw->...n", per_wheel, np.exp(-1j * np.multiply.outer(omega, lags(vehicle, speed))))


def density(spectrum: Any, omega: np.ndarray, speed: float) -> np.ndarray:
    """G(omega) = S_v(omega/v)/v with eq. (11) written out, m^2/(rad/s)."""
    omega_r, omega_c = spectrum.cutoffs
    wavenumber = omega / speed
    return spectrum.roughness * omega_c**2 / ((wavenumber**2 + omega_r**2) * (wavenumber**2 + omega_c**2)) / speed


def reference_nodes(
    low: float, high: float, poles: np.ndarray, longest_lag: float, nodes: int = 20
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of a composite Gauss-Legendre rule on [low, high] that closes in on every pole.

    Break points stand at omega_p +- half-width x 2^k, and no panel is longer than the lags' half period.
    """
    centre, width = np.abs(poles.imag), np.abs(poles.real)
    steps = np.concatenate([-(2.0 ** np.arange(44)), [0.0], 2.0 ** np.arange(44)]) / 2
    breaks = (centre[:, None] + width[:, None] * steps).ravel()
    ladder = np.arange(low, high, np.pi / longest_lag)
    breaks = np.unique(np.concatenate([[low, high], breaks, ladder]))
    breaks = breaks[(breaks >= low) & (breaks <= high)]
    x, w = leggauss(nodes)
    middle, half = (breaks[1:] + breaks[:-1]) / 2, np.diff(breaks) / 2
    return (middle[:, None] + half[:, None] * x).ravel(), (half[:, None] * w).ravel()


def read_off(name: str, vehicle: Vehicle, q: np.ndarray, s: np.ndarray) -> np.ndarray:
    """A response from the displacements q [freedoms, ...]: [positions, ...], read as docs/conventions.md says.

    Car body over the front pivot (z_c - L_c beta_c), at the centre, over the rear pivot; front and rear
    bogie; axles 1 to 4. Strokes are upper end minus lower end; s is i omega, accelerations are s^2 X.
    """
    a, b = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    z_c, beta_c, z_t1, beta_t1, z_w1, z_w2, z_t2, beta_t2, z_w3, z_w4 = q
    displacement = {
        "car_body_acceleration": [z_c - a * beta_c, z_c, z_c + a * beta_c],
        "bogie_acceleration": [z_t1, z_t2],
        "secondary_stroke": [z_c - a * beta_c - z_t1, z_c + a * beta_c - z_t2],
        "primary_stroke": [
            z_t1 - b * beta_t1 - z_w1,
            z_t1 + b * beta_t1 - z_w2,
            z_t2 - b * beta_t2 - z_w3,
            z_t2 + b * beta_t2 - z_w4,
        ],
        "wheelset_acceleration": [z_w1, z_w2, z_w3, z_w4],
        "car_body_pitch_acceleration": [beta_c],
        "bogie_pitch_acceleration": [beta_t1, beta_t2],
    }[name]
    return np.array(displacement) * (1 if name.endswith("stroke") else s**2)


def outputs_of(
    vehicle: Vehicle, a: np.ndarray, b: np.ndarray, names: tuple[str, ...] = NAMES
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """C and D of y = C x + D v for every response, from state matrices: {name: [positions, ...]}."""
    position = np.eye(len(a))[-10:]
    c, d = {}, {}
    for name in names:
        if name.endswith("stroke"):
            c[name] = read_off(name, vehicle, position, np.ones(1))
            d[name] = np.zeros((len(c[name]), 4))
        else:
            c[name] = read_off(name, vehicle, a[:10], np.ones(1))
            d[name] = read_off(name, vehicle, b[:10], np.ones(1))
    return c, d


def band_rms(vehicle: Vehicle, spectrum: Any, speed: float, low: float, high: float) -> dict[str, np.ndarray]:
    """RMS over [low, high] rad/s, {name: [positions]}, from the matrices typed out here."""
    a, b = state_matrices(vehicle)
    poles = np.append(np.linalg.eigvals(a), -speed * np.array(spectrum.cutoffs, dtype=complex))
    omega, weights = reference_nodes(low, high, poles, lags(vehicle, speed)[-1])
    states = np.linalg.solve(1j * omega[:, None, None] * np.eye(len(a)) - a, np.broadcast_to(b, (len(omega), *b.shape)))
    q = lagged(states[:, -10:], vehicle, omega, speed)
    weighted = density(spectrum, omega, speed) * weights
    return {name: np.sqrt(np.abs(read_off(name, vehicle, q, 1j * omega)) ** 2 @ weighted) for name in NAMES}


def whole_axis_rms(
    vehicle: Vehicle, a: np.ndarray, b: np.ndarray, spectrum: Any, speed: float, names: tuple[str, ...] = NAMES
) -> dict[str, np.ndarray]:
    """RMS over the whole axis, {name: [positions]}, in closed form: no frequency grid and no truncation.

    sigma^2 = 1/2 sum_ij I_ij, and for d = tau_j - tau_i >= 0
    I_ij = 2 pi sum over the left-half-plane poles of Res[H_i(s) H_j(-s) G(s) e^{s d}],
    the poles being those of the state matrix a, with inputs b, and of the track, all simple.
    """
    values, vectors = np.linalg.eig(a)
    inputs = np.linalg.solve(vectors, b)
    track = -speed * np.array(spectrum.cutoffs)
    tau = lags(vehicle, speed)
    identity = np.eye(len(values))
    omega_r, omega_c = speed * spectrum.cutoffs[0], speed * spectrum.cutoffs[1]
    # G(s) = scale / ((omega_r^2 - s^2)(omega_c^2 - s^2)), its residues at s = -omega_r and -omega_c
    scale = spectrum.roughness * spectrum.cutoffs[1] ** 2 * speed**3
    g = scale / ((omega_r**2 - values**2) * (omega_c**2 - values**2))
    g_residue = np.array(
        [scale / (2 * omega_r * (omega_c**2 - omega_r**2)), scale / ((omega_r**2 - omega_c**2) * 2 * omega_c)]
    )
    mirrored = [np.linalg.solve(-p * identity - a, b) for p in values]
    at_track = {+1: [], -1: []}
    for p in track:
        for sign in at_track:
            at_track[sign].append(np.linalg.solve(sign * p * identity - a, b))
    result = {}
    c_all, d_all = outputs_of(vehicle, a, b, names)
    for name, c in c_all.items():
        d = d_all[name]
        modal = c @ vectors
        square = np.zeros(len(c))
        for i in range(4):
            for j in range(4):
                delay = tau[j] - tau[i]
                if delay < 0:
                    continue  # I_ij = conj(I_ji), counted below
                total = np.zeros(len(c), dtype=complex)
                for k, p in enumerate(values):
                    opposite = c @ mirrored[k][:, j] + d[:, j]
                    total += modal[:, k] * inputs[k, i] * opposite * g[k] * np.exp(p * delay)
                for k, p in enumerate(track):
                    here = c @ at_track[+1][k][:, i] + d[:, i]
                    there = c @ at_track[-1][k][:, j] + d[:, j]
                    total += here * there * g_residue[k] * np.exp(p * delay)
                square += (1 if i == j else 2) * np.real(2 * np.pi * total) / 2
        result[name] = np.sqrt(square)
    return result
