"""The paper's vehicle on a rail that gives way: what of its results belongs to the rigid one.

Under each wheel stands a mass of rail and sleeper on a spring and a damper; the contact spring lies between wheel and
rail, and the irregularity in it. Wheels do not feel each other through the rail. Nothing here is shared with the
package's own solution: the matrices are written out from eqs. (3) to (7) and solved densely, frequency by frequency, so
that with a rail of great stiffness this is a check of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from freqrail.model.vehicle import Vehicle

_CAR, _CAR_PITCH, _FRONT, _REAR = 0, 1, 2, 6
_WHEELS = (4, 5, 8, 9)
_PANELS, _NODES = 160, 12  # on the logarithm of the frequency


@dataclass(frozen=True)
class Rail:
    """What lies under each wheel: mass kg, stiffness N/m, damping N s/m."""

    mass: float
    stiffness: float
    damping: float


TYPICAL = Rail(150.0, 80e6, 60e3)
"""Rail and half a sleeper on pads and ballast, as one wheel feels them."""


def response_rms(
    vehicle: Vehicle,
    density: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    speed: float,
    band: tuple[float, float],
    rail: Rail | None,
) -> dict[str, float]:
    """RMS of the paper's four responses at the places the paper reads them (car body's centre, front bogie, axle 1).

    density: of the track's height in m^2/Hz at frequencies in Hz and at `speed`, m/s. band: Hz. rail: None is rigid.
    """
    node, weight = leggauss(_NODES)
    edges = np.linspace(np.log(band[0]), np.log(band[1]), _PANELS + 1)
    half = np.diff(edges)[:, None] / 2
    f = np.exp((edges[:-1, None] + half + half * node).ravel())
    power = density(f) * (half * weight).ravel() * f
    q = displacements(vehicle, f, speed, rail)
    s2 = -((2 * np.pi * f) ** 2)
    read = {
        "car_body_acceleration": s2 * q[:, _CAR],
        "bogie_acceleration": s2 * q[:, _FRONT],
        "secondary_stroke": q[:, _CAR] - vehicle.half_bogie_spacing * q[:, _CAR_PITCH] - q[:, _FRONT],
        "primary_stroke": q[:, _FRONT] - vehicle.half_wheelbase * q[:, _FRONT + 1] - q[:, _WHEELS[0]],
    }
    return {name: float(np.sqrt(np.abs(t) ** 2 @ power)) for name, t in read.items()}


def displacements(
    vehicle: Vehicle, frequency: NDArray[np.float64], speed: float, rail: Rail | None
) -> NDArray[np.complex128]:
    """Displacements q [frequencies, 10], per metre of track under the first wheel."""
    s = 2j * np.pi * frequency
    size = 10 if rail is None else 14
    z = s[:, None, None] ** 2 * np.diag(_inertia(vehicle, rail))
    for e, k, c, joint in _legs(vehicle, size):
        viscous = c * s
        z += (k + viscous / (1 + 2 * viscous / joint))[:, None, None] * np.outer(e, e)
    contact = np.zeros((size, 4))
    for wheel, place in enumerate(_WHEELS):
        contact[place, wheel] = 1
        if rail is not None:
            contact[10 + wheel, wheel] = -1
            z[:, 10 + wheel, 10 + wheel] += rail.stiffness + rail.damping * s
    z += vehicle.contact_stiffness * contact @ contact.T
    a, b = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    lag = np.array([0, 2 * b, 2 * a, 2 * (a + b)]) / speed
    push = vehicle.contact_stiffness * np.exp(-np.multiply.outer(s, lag)) @ contact.T
    return np.asarray(np.linalg.solve(z, push[..., None])[:, :10, 0])


def poles(vehicle: Vehicle, rail: Rail) -> NDArray[np.complex128]:
    """Poles of the vehicle, with finite joints, on the rail, rad/s: of its state matrix, written out as well."""
    inertia = _inertia(vehicle, rail)
    legs = _legs(vehicle, 14)
    k, c = np.zeros((14, 14)), np.zeros((14, 14))
    pull = np.zeros((14, len(legs)))  # of the dampers' own elongations
    relax, follow = np.zeros((len(legs), len(legs))), np.zeros((len(legs), 14))
    for n, (e, spring, damping, joint) in enumerate(legs):
        k += (spring + joint / 2) * np.outer(e, e)
        pull[:, n] = joint / 2 * e
        relax[n, n], follow[n] = -joint / 2 / damping, joint / 2 / damping * e
    for wheel, place in enumerate(_WHEELS):
        gap = np.zeros(14)
        gap[place], gap[10 + wheel] = 1, -1
        k += vehicle.contact_stiffness * np.outer(gap, gap)
        k[10 + wheel, 10 + wheel] += rail.stiffness
        c[10 + wheel, 10 + wheel] += rail.damping
    zero, one = np.zeros((14, 14)), np.eye(14)
    rows = [
        [zero, one, np.zeros((14, len(legs)))],
        [-k / inertia[:, None], -c / inertia[:, None], pull / inertia[:, None]],
        [follow, np.zeros((len(legs), 14)), relax],
    ]
    return np.asarray(np.linalg.eigvals(np.block(rows)), dtype=complex)


def wheel_resonance(vehicle: Vehicle, rail: Rail) -> tuple[float, float]:
    """Natural frequency, Hz, and damping ratio of the wheelsets bouncing on the rail, the least damped of them.

    They are the four modes above the vehicle's own and below those of the rail against the wheel.
    """
    found = poles(vehicle, rail)
    found = found[found.imag > 0]
    wheels = found[np.argsort(np.abs(found))][-8:-4]
    pole = min(wheels, key=lambda p: float(-p.real / abs(p)))
    return float(abs(pole) / (2 * np.pi)), float(-pole.real / abs(pole))


def _inertia(vehicle: Vehicle, rail: Rail | None) -> NDArray[np.float64]:
    bogie = (vehicle.bogie_mass, vehicle.bogie_pitch_inertia, vehicle.wheelset_mass, vehicle.wheelset_mass)
    rails = () if rail is None else (rail.mass,) * 4
    return np.array([vehicle.car_body_mass, vehicle.car_body_pitch_inertia, *bogie, *bogie, *rails], dtype=float)


def _legs(vehicle: Vehicle, size: int) -> list[tuple[NDArray[np.float64], float, float, float]]:
    """Elongation over q, stiffness, damping and joint stiffness of the six legs, secondary ones first."""
    a, b = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    secondary = (vehicle.secondary_stiffness, vehicle.secondary_damping, vehicle.secondary_joint_stiffness)
    primary = (vehicle.primary_stiffness, vehicle.primary_damping, vehicle.primary_joint_stiffness)
    terms = [
        ({0: 1, 1: -a, 2: -1}, secondary),
        ({0: 1, 1: +a, 6: -1}, secondary),
        ({2: 1, 3: -b, 4: -1}, primary),
        ({2: 1, 3: +b, 5: -1}, primary),
        ({6: 1, 7: -b, 8: -1}, primary),
        ({6: 1, 7: +b, 9: -1}, primary),
    ]
    legs = []
    for term, (k, c, joint) in terms:
        e = np.zeros(size)
        e[list(term)] = list(term.values())
        legs.append((e, float(k), float(c), float(joint)))
    return legs
