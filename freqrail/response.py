"""Frequency responses of the half vehicle to one track running under its four wheels.

Two ways, which share no code and are each other's test:

- `system_response` solves the equations of motion of any `System`, legs equal or not;
- `chain_response` uses that a vehicle with equal legs decouples into three ladders of masses
  (bounce, pitch, bogie pitch), where each response is an elementwise expression and no equation is
  solved. It broadcasts over grids of vehicles, which is what makes a sweep fast.

Convention: e^{+i omega t}; accelerations are s^2 X of the displacement X. With a = omega L_t / v and
b = omega L_c / v the four wheels' lags (eq. 2) seen from the vehicle's centre give the chains' inputs

    bounce       (v1 + v2 + v3 + v4)/4 = cos a cos b
    pitch        (v1 + v2 - v3 - v4)/4 = i cos a sin b
    bogie pitch  (v1 - v2)/2 = i sin a e^{+ib} in front, (v3 - v4)/2 = i sin a e^{-ib} at the rear

up to the common factor exp(-i omega (L_c + L_t)/v). A response is T = B u_B + sigma P u_P + rho Q u_Q
with sigma = +1 in front and -1 at the rear, rho = +1 at a bogie's leading and -1 at its trailing axle.
Its square |T|^2 is then a sum of real columns (`lag_columns`) that depend on the speed alone, times
real powers (`column_powers`) that depend on the vehicle alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.track import Spectrum, frequency_psd
from freqrail.vehicle import CHAINS, System, Vehicle, ladder, leg_dynamic_stiffness, stiffness_matrices

Number = Any
Product = tuple[Number, Number]  # real and imaginary part

LAG_COLUMNS = 7
"""Number of real functions of the wheel lags that any |T|^2 is a sum of."""


@dataclass(frozen=True)
class Series:
    """How a response is read off the chains, and where.

    quantity: the ladder's element, "car", "bogie", "wheelset" (displacements), "secondary" or
    "primary" (elongations). derivative: 2 for an acceleration, 0 for a stroke. chains: those that
    take part. positions: (sigma, rho) a label of the response's dimension, with sigma = +1 in front,
    0 at the centre and -1 at the rear, rho = +1 at the leading and -1 at the trailing axle of a
    bogie. arm: the length (a field of `Vehicle`) that turns the displacement over a leg into an
    angle, "" for none.
    """

    quantity: str
    derivative: int
    chains: tuple[str, ...]
    positions: tuple[tuple[int, int], ...]
    arm: str = ""


_ENDS = ((1, 0), (-1, 0))
_AXLES = ((1, 1), (1, -1), (-1, 1), (-1, -1))

SERIES: dict[str, Series] = {
    "car_body_acceleration": Series("car", 2, ("bounce", "pitch"), ((1, 0), (0, 0), (-1, 0))),
    "bogie_acceleration": Series("bogie", 2, ("bounce", "pitch"), _ENDS),
    "secondary_stroke": Series("secondary", 0, ("bounce", "pitch"), _ENDS),
    "primary_stroke": Series("primary", 0, CHAINS, _AXLES),
    "wheelset_acceleration": Series("wheelset", 2, CHAINS, _AXLES),
    "car_body_pitch_acceleration": Series("car", 2, ("pitch",), ((1, 0),), "half_bogie_spacing"),
    "bogie_pitch_acceleration": Series("bogie", 2, ("bogie_pitch",), ((1, 1), (-1, 1)), "half_wheelbase"),
}


@dataclass(frozen=True)
class ChainResponse:
    """Frequency response of a chain of bodies to its track input.

    top: displacement of the top body per metre of track, [grid..., n], complex, m/m.
    ratios: each element (see `Series.quantity`) per unit displacement of the top body, complex, m/m.
    """

    top: NDArray[np.complex128]
    ratios: dict[str, Number]


def chain_response(vehicle: Vehicle, chain: str, omega: NDArray) -> ChainResponse:
    """Frequency response of one chain at omega [n] in rad/s, which the vehicle's fields broadcast against.

    Downwards from the top body, per unit of its displacement: the force below body k is
    f_k = f_{k-1} - m_k s^2 x_k, the elongation of the leg there e_k = f_k / D_k, the next body
    x_{k+1} = x_k - e_k; below the wheelset stands the contact spring, and its lower end is the
    track (eqs. 3 to 7 in the coordinates of `ladder`). Strokes come from forces, never from the
    difference of nearly equal displacements, so they keep their digits at low frequency.
    """
    track, ratios = descend(vehicle, chain, 1j * np.asarray(omega), -np.square(omega))
    return ChainResponse(1.0 / track, ratios)


def descend(vehicle: Vehicle, chain: str, s: Number, s2: Number) -> tuple[Number, dict[str, Number]]:
    """Down a chain from a unit displacement of its top body, at any complex s [rad/s]; `s2` is s^2.

    Returns (the track's displacement, -; the ratios of `ChainResponse`). The track's displacement is zero at the
    chain's poles. s^2 is an argument of its own because on the imaginary axis it is real.
    """
    masses, legs = ladder(vehicle, chain)
    bodies = ("car", "bogie", "wheelset")[-len(masses) :]
    stages = ("secondary", "primary")[-len(legs) :]
    stiffnesses = [leg_dynamic_stiffness(*leg, s) for leg in legs] + [vehicle.contact_stiffness]
    ratios: dict[str, Number] = {}
    x: Number = 1.0
    force: Number = 0.0
    for k, body in enumerate(bodies):
        ratios[body] = x
        force = force - masses[k] * s2 * x
        elongation = force / stiffnesses[k]
        if k < len(stages):
            ratios[stages[k]] = elongation
        x = x - elongation
    return x, ratios


def chain_responses(vehicle: Vehicle, omega: NDArray) -> dict[str, ChainResponse]:
    """`chain_response` of all three chains, by name."""
    return {chain: chain_response(vehicle, chain, omega) for chain in CHAINS}


def _scale(series: Series, vehicle: Vehicle, omega: NDArray) -> Number:
    """Factor from the displacement over a leg to the response: s^2 of an acceleration, 1/arm of an angle."""
    factor: Number = -np.square(omega) if series.derivative == 2 else 1.0
    return -factor / getattr(vehicle, series.arm) if series.arm else factor


def top_products(chains: dict[str, ChainResponse]) -> dict[tuple[str, str], Product]:
    """Products X Y* of the chains' top displacements, for all that `column_powers` needs, (m/m)^2."""
    pairs = [(chain, chain) for chain in CHAINS] + [
        ("bounce", "pitch"),
        ("bounce", "bogie_pitch"),
        ("pitch", "bogie_pitch"),
    ]
    return {(x, y): _times_conjugate(chains[x].top, chains[y].top) for x, y in pairs}


def column_powers(
    series: Series,
    vehicle: Vehicle,
    omega: NDArray,
    chains: dict[str, ChainResponse],
    products: dict[tuple[str, str], Product],
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """The powers of a series: (column of `lag_columns`, real array [grid..., n]), one after the other.

    |T|^2 at a position is the sum over the columns of `column_signs` x power x lag column; in
    (m/s^2)^2/m^2, (rad/s^2)^2/m^2 or m^2/m^2. No speed enters. `chains` is `chain_responses` of
    the same vehicle and omega, `products` their `top_products`.
    """
    scale = np.square(_scale(series, vehicle, omega))
    ratio = {chain: chains[chain].ratios[series.quantity] for chain in series.chains}

    def power(x: str, y: str) -> Product:
        """X Y* of the series, real and imaginary part."""
        head, tail = products[x, y]
        real, imaginary = _times_conjugate(ratio[x], ratio[y])
        real, imaginary = scale * real, scale * imaginary
        return real * head - imaginary * tail, real * tail + imaginary * head

    for chain, column in (("bounce", 0), ("pitch", 1), ("bogie_pitch", 3)):
        if chain in series.chains:
            yield column, scale * _modulus2(ratio[chain]) * products[chain, chain][0]
    if "bounce" in series.chains and "pitch" in series.chains:
        yield 2, power("bounce", "pitch")[1]
    if len(series.chains) == 3:
        bounce, pitch = power("bounce", "bogie_pitch"), power("pitch", "bogie_pitch")
        yield 4, bounce[1]
        yield 5, pitch[1]
        yield 6, pitch[0] - bounce[0]


def _times_conjugate(x: Number, y: Number) -> Product:
    """Real and imaginary part of x y*, in real arithmetic: numpy may swap the factors of a complex product,
    and with them the last bit, as the size of the arrays suits it."""
    a, b, c, d = np.real(x), np.imag(x), np.real(y), np.imag(y)
    return a * c + b * d, b * c - a * d


def _modulus2(z: Number) -> Number:
    return np.square(np.real(z)) + np.square(np.imag(z))


def column_signs(position: tuple[int, int]) -> tuple[int, ...]:
    """The factor of each lag column at a position (sigma, rho) of a series."""
    sigma, rho = position
    return (1, sigma**2, sigma, 1, rho, rho, rho * sigma)


def lag_columns(vehicle: Vehicle, omega: NDArray, speed: NDArray) -> NDArray[np.float64]:
    """The real functions of the wheel lags (eq. 2) that |T|^2 is made of: [7, n, speeds], -.

    vehicle: single geometry (L_c and L_t as floats, m); omega [n] in rad/s; speed [m] in m/s.
    From |T|^2 = |B u_B + sigma P u_P + rho Q u_Q|^2 with a = omega L_t/v and b = omega L_c/v.
    """
    delay = np.asarray(omega)[:, None] / np.asarray(speed)
    a, b = vehicle.half_wheelbase * delay, vehicle.half_bogie_spacing * delay
    cos_a, sin_a, cos_b, sin_b = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
    mixed = 2 * cos_a * sin_a
    return np.stack(
        [
            (cos_a * cos_b) ** 2,
            (cos_a * sin_b) ** 2,
            2 * cos_a**2 * cos_b * sin_b,
            sin_a**2,
            mixed * cos_b**2,
            mixed * sin_b**2,
            mixed * cos_b * sin_b,
        ]
    )


def track_response(
    series: Series, vehicle: Vehicle, omega: NDArray, speed: Number, chains: dict[str, ChainResponse]
) -> NDArray[np.complex128]:
    """T(i omega) of a series per metre of track height under the vehicle's centre: [positions, grid..., n].

    The four wheels' responses are summed with their lags before any modulus is taken. omega [n] in
    rad/s; speed in m/s and the vehicle's fields broadcast against omega.
    """
    delay = omega / speed
    a, b = vehicle.half_wheelbase * delay, vehicle.half_bogie_spacing * delay
    scale = _scale(series, vehicle, omega)

    def part(chain: str) -> Number:
        return chains[chain].ratios[series.quantity] * chains[chain].top * scale if chain in series.chains else 0.0

    bounce = part("bounce") * np.cos(a) * np.cos(b)
    pitch = part("pitch") * (1j * np.cos(a) * np.sin(b))
    bogie_pitch = part("bogie_pitch") * (1j * np.sin(a))
    rows = [bounce + sigma * pitch + rho * bogie_pitch * np.exp(1j * sigma * b) for sigma, rho in series.positions]
    return np.stack(np.broadcast_arrays(*rows))


def response_psd(
    series: Series, vehicle: Vehicle, spectrum: Spectrum, frequency: NDArray, speed: Number
) -> NDArray[np.float64]:
    """One-sided PSD of a series per Hz, |T|^2 2 pi S_v(Omega)/v: [positions, grid..., n].

    frequency [n] in Hz; speed in m/s and the vehicle's fields broadcast against it. Units
    (m/s^2)^2/Hz, (rad/s^2)^2/Hz or m^2/Hz.
    """
    omega = 2 * np.pi * np.asarray(frequency)
    chains = chain_responses(vehicle, omega)
    transfer = track_response(series, vehicle, omega, speed, chains)
    return _modulus2(transfer) * frequency_psd(spectrum, frequency, speed)


def wheel_lags(vehicle: Vehicle, speed: Number) -> NDArray[np.float64]:
    """Lags tau_i [4] of the four wheels behind the first, s (eq. 2); speed in m/s."""
    a, b = 2 * vehicle.half_wheelbase, 2 * vehicle.half_bogie_spacing
    return np.array([0.0, a, b, a + b]) / speed


def system_response(system: System, omega: NDArray) -> NDArray[np.complex128]:
    """Displacements q of any system per metre of height under each contact: [n, freedoms, contacts], m/m.

    omega [n] in rad/s. Solves (M s^2 + E^T D(s) E + K_H) q = K_H v at every frequency; the legs
    need not be alike. Differentiate by multiplying with i omega.
    """
    s = 1j * np.asarray(omega, dtype=float)[:, None, None]
    mass, stiffness, coupling = stiffness_matrices(system)
    dynamic = mass * s**2 + stiffness
    for leg in system.legs:
        row = np.array(leg.elongation)
        total = leg_dynamic_stiffness(leg.stiffness, leg.damping, leg.joint_stiffness, s)
        dynamic = dynamic + (total - leg.stiffness) * np.outer(row, row)
    return np.linalg.solve(dynamic, np.broadcast_to(coupling.astype(complex), (len(s), *coupling.shape)))
