"""The half vehicle with equal legs as three chains of masses that exchange no energy: a reference for the blocks.

The package finds the parts into which a vehicle falls by itself, for any vehicle (`freqrail.reduction`); here they are
derived by hand, for the paper's. The two share the law of a leg as a formula and the tables of responses, nothing else.

With a = omega L_t / v and b = omega L_c / v the four wheels' lags (eq. 2) seen from the vehicle's centre give the
chains' inputs

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

import numpy as np
from numpy.typing import NDArray

from freqrail.model.equations import Leg, System, leg_dynamic_stiffness, state_space
from freqrail.model.spectrum import Spectrum, frequency_psd
from freqrail.model.vehicle import Vehicle
from freqrail.types import Number

CHAINS = ("bounce", "pitch", "bogie_pitch")
"""The half vehicle's families of motion, which exchange no energy if its legs are equal: blocks of its reduction."""


@dataclass(frozen=True)
class Family:
    """How a response is read off the chains.

    element: "car", "bogie", "wheelset" (displacements), "secondary" or "primary" (elongations). derivative: 2 for an
    acceleration, 0 for a stroke. chains: those that take part. signs: (sigma, rho) a label of the dimension, with
    sigma = +1 in front, 0 at the centre and -1 at the rear, rho = +1 at the leading and -1 at the trailing axle of a
    bogie. arm: the length (a field of `Vehicle`) that turns the displacement over a leg into an angle, "" for none.
    """

    element: str
    derivative: int
    chains: tuple[str, ...]
    signs: tuple[tuple[int, int], ...]
    arm: str = ""


_ENDS = ((1, 0), (-1, 0))
_AXLES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
_VERTICAL = ("bounce", "pitch")

FAMILIES = {
    "car_body_acceleration": Family("car", 2, _VERTICAL, ((1, 0), (0, 0), (-1, 0))),
    "bogie_acceleration": Family("bogie", 2, _VERTICAL, _ENDS),
    "secondary_stroke": Family("secondary", 0, _VERTICAL, _ENDS),
    "primary_stroke": Family("primary", 0, CHAINS, _AXLES),
    "wheelset_acceleration": Family("wheelset", 2, CHAINS, _AXLES),
    "car_body_pitch_acceleration": Family("car", 2, ("pitch",), ((1, 0),), "half_bogie_spacing"),
    "bogie_pitch_acceleration": Family("bogie", 2, ("bogie_pitch",), ((1, 1), (-1, 1)), "half_wheelbase"),
}
"""By response."""


def ladder(vehicle: Vehicle, chain: str) -> tuple[list[Number], list[tuple[Number, Number, Number]]]:
    """One of the three chains into which a half vehicle with equal legs decouples, per wheel.

    With x the displacement over the leg (bounce z_c; pitch -L_c beta_c; bogie pitch -L_t beta_t)
    each chain is a ladder of masses from the top body to the wheelset, a leg below each but the
    last, which stands on the contact spring:

    - bounce:       M_c/4,         M_t/2,         M_w   (all bodies move alike front and rear)
    - pitch:        J_c/(4 L_c^2), M_t/2,         M_w   (front and rear opposed)
    - bogie_pitch:  J_t/(2 L_t^2),                M_w   (the two wheelsets of a bogie opposed)

    Returns (masses, legs): masses in kg from the top down, legs as (k, c, K_d), one fewer.
    Fields of `vehicle` may be arrays. Raises ValueError for an unknown chain.
    """
    primary = (vehicle.primary_stiffness, vehicle.primary_damping, vehicle.primary_joint_stiffness)
    # half a secondary leg stands over each wheelset of a bogie
    secondary = (
        vehicle.secondary_stiffness / 2,
        vehicle.secondary_damping / 2,
        vehicle.secondary_joint_stiffness / 2,
    )
    if chain == "bounce":
        return [vehicle.car_body_mass / 4, vehicle.bogie_mass / 2, vehicle.wheelset_mass], [secondary, primary]
    if chain == "pitch":
        car = vehicle.car_body_pitch_inertia / (4 * np.square(vehicle.half_bogie_spacing))
        return [car, vehicle.bogie_mass / 2, vehicle.wheelset_mass], [secondary, primary]
    if chain == "bogie_pitch":
        frame = vehicle.bogie_pitch_inertia / (2 * np.square(vehicle.half_wheelbase))
        return [frame, vehicle.wheelset_mass], [primary]
    raise ValueError(f"unknown chain {chain!r}: one of {', '.join(CHAINS)}")


def chain_system(vehicle: Vehicle, chain: str) -> System:
    """A chain of `ladder` as a `System` of its own: freedoms top body, ..., wheelset."""
    masses, legs = ladder(vehicle, chain)
    n = len(masses)

    def row(k: int) -> tuple[float, ...]:
        return tuple(1.0 if i == k else -1.0 if i == k + 1 else 0.0 for i in range(n))

    names = ("secondary", "primary")[-len(legs) :]
    return System(
        freedoms=("car", "bogie", "wheelset") if n == 3 else ("bogie", "wheelset"),
        inertia=tuple(masses),
        legs=tuple(Leg(name, row(k), *leg) for k, (name, leg) in enumerate(zip(names, legs, strict=True))),
        contacts=((n - 1, vehicle.contact_stiffness),),
    )


def poles(vehicle: Vehicle, chains: tuple[str, ...] = CHAINS) -> NDArray[np.complex128]:
    """Poles of a single vehicle, rad/s: those of its three chains, or some of them, the bogie-pitch pair once.

    The chains' blocks are small and well separated, so that the repeated front and rear
    bogie-pitch poles of the 26-state matrix do not disturb each other. NaN where the numbers overflow.
    """
    with np.errstate(all="ignore"):
        matrices = [state_space(chain_system(vehicle, chain)).a for chain in chains]
    return np.concatenate(
        [np.linalg.eigvals(a) if np.isfinite(a).all() else np.full(len(a), np.nan) for a in matrices]
    ).astype(complex)


BODIES = ("car", "bogie", "wheelset")


STAGES = ("secondary", "primary")


@dataclass(frozen=True)
class ChainResponse:
    """Frequency response of a chain of bodies, per unit displacement of its top body.

    track: the track's displacement, [grid..., n], complex, m/m. ratios: each element (see `Family.element`), complex,
    m/m. forces: of the legs "secondary" and "primary", complex, N/m. Responses that depend on few of the
    vehicle's fields span only their axes of the grid.
    """

    track: NDArray[np.complex128]
    ratios: dict[str, Number]
    forces: dict[str, Number]

    @property
    def top(self) -> NDArray[np.complex128]:
        """Displacement of the top body per metre of track, m/m."""
        return 1.0 / self.track


def chain_response(vehicle: Vehicle, chain: str, omega: NDArray) -> ChainResponse:
    """Frequency response of one chain at omega [n] in rad/s, which the vehicle's fields broadcast against.

    Downwards from the top body, per unit of its displacement: the force below body k is
    f_k = f_{k-1} - m_k s^2 x_k, the elongation of the leg there e_k = f_k / D_k, the next body
    x_{k+1} = x_k - e_k; below the wheelset stands the contact spring, and its lower end is the
    track (eqs. 3 to 7 in the coordinates of `ladder`). Strokes come from forces, never from the
    difference of nearly equal displacements, so they keep their digits at low frequency.
    """
    return ChainResponse(*descend(vehicle, chain, 1j * np.asarray(omega), -np.square(omega)))


def descend(vehicle: Vehicle, chain: str, s: Number, s2: Number) -> tuple[Number, dict[str, Number], dict[str, Number]]:
    """Down a chain from a unit displacement of its top body, at any complex s [rad/s]; `s2` is s^2.

    Returns (track, ratios, forces) of `ChainResponse`. The track's displacement is zero at the
    chain's poles. s^2 is an argument of its own because on the imaginary axis it is real.
    """
    masses, legs = ladder(vehicle, chain)
    ratios: dict[str, Number] = {}
    forces: dict[str, Number] = {}
    x: Number = 1.0
    force: Number = 0.0
    for body, mass, stage, leg in zip(BODIES[-len(masses) :], masses, STAGES[-len(legs) :], legs, strict=False):
        ratios[body] = x
        force = force - mass * s2 * x
        forces[stage] = force
        # products, not quotients: complex division is several times slower
        ratios[stage] = force * (1.0 / leg_dynamic_stiffness(*leg, s))
        x = x - ratios[stage]
    ratios["wheelset"] = x
    contact = 1.0 / vehicle.contact_stiffness
    return x * (1.0 + masses[-1] * contact * s2) - force * contact, ratios, forces


def chain_responses(vehicle: Vehicle, omega: NDArray) -> dict[str, ChainResponse]:
    """`chain_response` of all three chains, by name."""
    return {chain: chain_response(vehicle, chain, omega) for chain in CHAINS}


Product = tuple[Number, Number]  # real and imaginary part


LAG_COLUMNS = 7
"""Number of real functions of the wheel lags that any |T|^2 is a sum of."""


def _scale(series: Family, vehicle: Vehicle, omega: NDArray) -> Number:
    """Factor from the displacement over a leg to the response: s^2 of an acceleration, 1/arm of an angle."""
    factor: Number = -np.square(omega) if series.derivative == 2 else 1.0
    return -factor / getattr(vehicle, series.arm) if series.arm else factor


def top_products(chains: dict[str, ChainResponse]) -> dict[tuple[str, str], Product]:
    """Products X Y* of the chains' top displacements, for all that `column_powers` needs, (m/m)^2."""
    square = {chain: 1.0 / _modulus2(response.track) for chain, response in chains.items()}
    result: dict[tuple[str, str], Product] = {(chain, chain): (square[chain], 0.0) for chain in CHAINS}
    for x, y in (("bounce", "pitch"), ("bounce", "bogie_pitch"), ("pitch", "bogie_pitch")):
        # X Y* = conj(1/X) (1/Y) |X|^2 |Y|^2. As a function, because the operator may swap the factors of a
        # complex product, and with them the last bit, as the size of the arrays suits it.
        product = np.multiply(np.conj(chains[x].track), chains[y].track)
        both = square[x] * square[y]
        result[x, y] = product.real * both, product.imag * both
    return result


def column_powers(
    series: Family,
    vehicle: Vehicle,
    omega: NDArray,
    chains: dict[str, ChainResponse],
    products: dict[tuple[str, str], Product],
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """The powers of a series: (column of `lag_columns`, real array [grid..., n]), one after the other.

    |T|^2 at a position is the sum over the columns of `column_signs` x power x lag column; in
    (m/s^2)^2/m^2, (rad/s^2)^2/m^2 or m^2/m^2. No speed enters. `chains` is `chain_responses` of
    the same vehicle and omega, `products` their `top_products`. A stroke is the leg's force, which does not feel
    what is below, times its compliance, the same in all chains: the factors span few axes of the grid.
    """
    scale = np.square(_scale(series, vehicle, omega))
    if series.element in STAGES:
        leg = ladder(vehicle, "bounce")[1][STAGES.index(series.element)]
        scale = scale / _modulus2(leg_dynamic_stiffness(*leg, 1j * omega))
        elements = {chain: chains[chain].forces[series.element] for chain in series.chains}
    else:
        elements = {chain: chains[chain].ratios[series.element] for chain in series.chains}

    def factors(x: str, y: str) -> tuple[Number, Number, Number, Number]:
        real, imaginary = _times_conjugate(elements[x], elements[y])
        return scale * real, scale * imaginary, *products[x, y]

    def real_part(x: str, y: str) -> Number:
        """Re(X Y*) of the series."""
        real, imaginary, head, tail = factors(x, y)
        return real * head - imaginary * tail

    def imaginary_part(x: str, y: str) -> Number:
        """Im(X Y*) of the series."""
        real, imaginary, head, tail = factors(x, y)
        return real * tail + imaginary * head

    for chain, column in (("bounce", 0), ("pitch", 1), ("bogie_pitch", 3)):
        if chain in series.chains:
            yield column, scale * _modulus2(elements[chain]) * products[chain, chain][0]
    if "bounce" in series.chains and "pitch" in series.chains:
        yield 2, imaginary_part("bounce", "pitch")
    if len(series.chains) == 3:
        yield 4, imaginary_part("bounce", "bogie_pitch")
        yield 5, imaginary_part("pitch", "bogie_pitch")
        yield 6, real_part("pitch", "bogie_pitch") - real_part("bounce", "bogie_pitch")


def _times_conjugate(x: Number, y: Number) -> Product:
    """Real and imaginary part of x y*."""
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
    result = np.empty((LAG_COLUMNS, *a.shape))
    result[0] = np.square(cos_a * cos_b)
    result[1] = np.square(cos_a * sin_b)
    result[2] = 2 * cos_a * cos_a * cos_b * sin_b
    result[3] = sin_a * sin_a
    result[4] = mixed * cos_b * cos_b
    result[5] = mixed * sin_b * sin_b
    result[6] = mixed * cos_b * sin_b
    return result


def track_response(
    series: Family, vehicle: Vehicle, omega: NDArray, speed: Number, chains: dict[str, ChainResponse]
) -> NDArray[np.complex128]:
    """T(i omega) of a series per metre of track height under the vehicle's centre: [positions, grid..., n].

    The four wheels' responses are summed with their lags before any modulus is taken. omega [n] in
    rad/s; speed in m/s and the vehicle's fields broadcast against omega.
    """
    delay = omega / speed
    a, b = vehicle.half_wheelbase * delay, vehicle.half_bogie_spacing * delay
    scale = _scale(series, vehicle, omega)

    def part(chain: str) -> Number:
        return chains[chain].ratios[series.element] * chains[chain].top * scale if chain in series.chains else 0.0

    bounce = part("bounce") * np.cos(a) * np.cos(b)
    pitch = part("pitch") * (1j * np.cos(a) * np.sin(b))
    bogie_pitch = part("bogie_pitch") * (1j * np.sin(a))
    rows = [bounce + sigma * pitch + rho * bogie_pitch * np.exp(1j * sigma * b) for sigma, rho in series.signs]
    return np.stack(np.broadcast_arrays(*rows))


def response_psd(
    series: Family, vehicle: Vehicle, spectrum: Spectrum, frequency: NDArray, speed: Number
) -> NDArray[np.float64]:
    """One-sided PSD of a series per Hz, |T|^2 2 pi S_v(Omega)/v: [positions, grid..., n].

    frequency [n] in Hz; speed in m/s and the vehicle's fields broadcast against it. Units
    (m/s^2)^2/Hz, (rad/s^2)^2/Hz or m^2/Hz.
    """
    omega = 2 * np.pi * np.asarray(frequency)
    chains = chain_responses(vehicle, omega)
    transfer = track_response(series, vehicle, omega, speed, chains)
    return _modulus2(transfer) * frequency_psd(spectrum, frequency, speed)
