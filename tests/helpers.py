"""What several test modules share: random vehicles, and references that take none of the package's short cuts.

The references start from the assembled half vehicle (`system_response`, `state_space`), add the four
wheels' lags one by one before any modulus, and integrate by rules of their own. Only `from_chains`
goes through the decoupled chains; none through the lag columns and panels that the package computes with.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial.legendre import leggauss

from freqrail.response import SERIES, chain_responses, system_response, track_response
from freqrail.track import RationalSpectrum
from freqrail.vehicle import DEGREES_OF_FREEDOM, Vehicle, half_vehicle, state_space

INDEX = {name: place for place, name in enumerate(DEGREES_OF_FREEDOM)}
PAPER_NAMES = tuple(SERIES)[:4]
ALL_NAMES = tuple(SERIES)


def random_vehicle(rng: np.random.Generator, joints: tuple[float, float] = (0.5e6, 100e6)) -> Vehicle:
    """A plausible half vehicle: masses, springs and dampers up to three times larger or smaller than the paper's.

    Joint stiffnesses lie between `joints` (N/m), log-uniform: Table I's range unless given.
    """

    def about(value: float, factor: float = 3.0) -> float:
        return float(value * factor ** rng.uniform(-1, 1))

    def joint() -> float:
        return float(np.exp(rng.uniform(*np.log(joints))))

    wheelbase = about(1.0, 1.4)
    return Vehicle(
        car_body_mass=about(15200),
        car_body_pitch_inertia=about(500e3),
        bogie_mass=about(1000, 2.0),
        bogie_pitch_inertia=about(700, 2.0),
        wheelset_mass=about(700, 1.5),
        primary_stiffness=about(875e3),
        primary_damping=about(17e3),
        primary_joint_stiffness=joint(),
        secondary_stiffness=about(412e3),
        secondary_damping=about(54e3),
        secondary_joint_stiffness=joint(),
        half_bogie_spacing=about(6.0, 1.8),
        half_wheelbase=wheelbase,
        contact_stiffness=about(1.05e9, 1.5),
    )


def random_vehicles(count: int, seed: int, **kwargs: tuple[float, float]) -> list[Vehicle]:
    """`count` random vehicles, the same ones in every run."""
    rng = np.random.default_rng(seed)
    return [random_vehicle(rng, **kwargs) for _ in range(count)]


def read_off(name: str, vehicle: Vehicle, q: np.ndarray, s: np.ndarray) -> np.ndarray:
    """A response from the displacements q [freedoms, ...]: [positions, ...], read as section 7 of the design says.

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


def lags(vehicle: Vehicle, speed: float) -> np.ndarray:
    """Eq. (2): tau = 0, 2 L_t/v, 2 L_c/v, 2 (L_t + L_c)/v."""
    a, b = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    return np.array([0, 2 * b / speed, 2 * a / speed, 2 * (b + a) / speed])


def lagged(per_wheel: np.ndarray, vehicle: Vehicle, omega: np.ndarray, speed: float) -> np.ndarray:
    """Sum over the wheels [n, ..., 4] with exp(-i omega tau_i): per metre of track under the FIRST wheel."""
    return np.einsum("n...w,nw->...n", per_wheel, np.exp(-1j * np.multiply.outer(omega, lags(vehicle, speed))))


def explicit_responses(
    vehicle: Vehicle, omega: np.ndarray, speed: float, names: tuple[str, ...] = ALL_NAMES
) -> dict[str, np.ndarray]:
    """T per metre of track under the first wheel, from equations of motion: {name: [positions, n]}."""
    q = lagged(system_response(half_vehicle(vehicle), omega), vehicle, omega, speed)
    return {name: read_off(name, vehicle, q, 1j * omega) for name in names}


def from_chains(
    vehicle: Vehicle, omega: np.ndarray, speed: float, names: tuple[str, ...] = ALL_NAMES
) -> dict[str, np.ndarray]:
    """The same from the package's chains, for references that need only an integral of their own.

    test_response holds the chains to `explicit_responses`; they keep more digits and take a tenth of the time.
    """
    chains = chain_responses(vehicle, omega)
    return {name: track_response(SERIES[name], vehicle, omega, speed, chains) for name in names}


def density(spectrum: RationalSpectrum, omega: np.ndarray, speed: float) -> np.ndarray:
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


def all_poles(vehicle: Vehicle, spectrum: RationalSpectrum, speed: float) -> np.ndarray:
    """Eigenvalues of the assembled state matrix, and the poles -v Omega_r and -v Omega_c of the track."""
    return np.append(
        np.linalg.eigvals(state_space(half_vehicle(vehicle)).a), -speed * np.array(spectrum.cutoffs, dtype=complex)
    )


def reference_rms(
    vehicle: Vehicle,
    spectrum: RationalSpectrum,
    speed: float,
    low: float,
    high: float,
    names: tuple[str, ...] = PAPER_NAMES,
    transfer: Callable[..., dict[str, np.ndarray]] = explicit_responses,
    nodes: int = 20,
) -> dict[str, np.ndarray]:
    """RMS over [low, high] rad/s, {name: [positions]}: |T|^2 G with lags added one by one, own quadrature."""
    omega, weights = reference_nodes(low, high, all_poles(vehicle, spectrum, speed), lags(vehicle, speed)[-1], nodes)
    responses = transfer(vehicle, omega, speed, names)
    weighted = density(spectrum, omega, speed) * weights
    return {name: np.sqrt(np.abs(t) ** 2 @ weighted) for name, t in responses.items()}


def output_matrices(vehicle: Vehicle) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """C and D of y = C x + D v for every response, from the state equations: {name: [positions, ...]}."""
    model = state_space(half_vehicle(vehicle))
    n = len(DEGREES_OF_FREEDOM)
    states = model.a.shape[0]
    position = np.eye(states)[states - n :]
    c, d = {}, {}
    for name in ALL_NAMES:
        if name.endswith("stroke"):
            c[name] = read_off(name, vehicle, position, np.ones(1))
            d[name] = np.zeros((len(c[name]), 4))
        else:
            c[name] = read_off(name, vehicle, model.a[:n], np.ones(1))
            d[name] = read_off(name, vehicle, model.b[:n], np.ones(1))
    return c, d


def residue_rms(vehicle: Vehicle, spectrum: RationalSpectrum, speed: float) -> dict[str, np.ndarray]:
    """RMS over the whole axis, {name: [positions]}, in closed form: no frequency grid and no truncation.

    sigma^2 = 1/2 sum_ij I_ij, and for d = tau_j - tau_i >= 0
    I_ij = 2 pi sum over the left-half-plane poles of Res[H_i(s) H_j(-s) G(s) e^{s d}],
    the poles being those of the assembled state matrix and of the track, all simple.
    """
    model = state_space(half_vehicle(vehicle))
    values, vectors = np.linalg.eig(model.a)
    inputs = np.linalg.solve(vectors, model.b)
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
    mirrored = [np.linalg.solve(-p * identity - model.a, model.b) for p in values]
    at_track = {+1: [], -1: []}
    for p in track:
        for sign in at_track:
            at_track[sign].append(np.linalg.solve(sign * p * identity - model.a, model.b))
    result = {}
    c_all, d_all = output_matrices(vehicle)
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
