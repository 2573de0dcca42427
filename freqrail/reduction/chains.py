"""The half vehicle with equal legs as three chains of masses that exchange no energy, and their responses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.equations import Leg, System, leg_dynamic_stiffness, state_space
from freqrail.model.responses import CHAINS
from freqrail.model.vehicle import Vehicle
from freqrail.types import Number


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

    track: the track's displacement, [grid..., n], complex, m/m. ratios: each element (see `Response.element`), complex,
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
