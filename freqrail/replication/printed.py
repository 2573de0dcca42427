"""Eq. (4) of the paper as it is printed, signs and all, to see what they do.

Two terms of the printed equation have the wrong sign (see `vehicle`): the secondary damper's force on the front
bogie's bounce and the fourth primary damper's on the rear bogie's bounce. With eq. (8) put in,

    +K_sd (z_t1 - z_sd2)               = -kappa_s (e_s1 - Delta_s1)   where +kappa_s (e_s1 - Delta_s1) is due,
    +K_pd (z_t2 + L_t beta_t2 - z_pd7) = +kappa_p (e_p4 - Delta_p4)   where -kappa_p (e_p4 - Delta_p4) is due.

The force on the other body of either leg is printed right, so that action and reaction do not cancel: the system is no
`System` of legs, and its frequency response is solved here from the state matrix itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freqrail.confirm.time_side import readout
from freqrail.model.band import Band, band_limits
from freqrail.model.equations import StateSpace, state_space
from freqrail.model.inputs import wheel_lags
from freqrail.model.spectrum import Spectrum, angular_psd, singular_points
from freqrail.model.vehicle import Vehicle, half_vehicle
from freqrail.solver import quadrature

Signs = tuple[tuple[str, str], ...]
"""(leg, freedom): whose damper force has the wrong sign in whose equation."""

FRONT, REAR = ("secondary_1", "z_t1"), ("primary_4", "z_t2")
READINGS: dict[str, Signs] = {
    "both signs as printed": (FRONT, REAR),
    "the front bogie's +K_sd alone": (FRONT,),
    "the rear bogie's +K_pd alone": (REAR,),
}
"""What of the printed signs the paper may have computed with."""
AS_PRINTED = READINGS["both signs as printed"]


def printed_state_space(vehicle: Vehicle, signs: Signs = AS_PRINTED) -> StateSpace:
    """The state matrices of eqs. (3) to (7) as printed; finite joints and dampers in both stages."""
    system = half_vehicle(vehicle)
    right = state_space(system)
    a = right.a.copy()
    position = [right.states.index(freedom) for freedom in system.freedoms]
    legs = {leg.name: leg for leg in system.legs}
    for name, freedom in signs:
        leg, row = legs[name], system.freedoms.index(freedom)
        # the damper's force on this freedom, taken away twice
        push = 2 * leg.elongation[row] * leg.joint_stiffness / 2 / system.inertia[row]
        a[row, position] += push * np.array(leg.elongation)
        a[row, right.states.index(f"Delta_{name}")] -= push
    return StateSpace(a, right.b, right.states)


def asymmetry(vehicle: Vehicle, signs: Signs = AS_PRINTED) -> float:
    """Largest entry of K - K^T of the printed equations, dampers held still, over the largest of K; 0 if symmetric."""
    system = half_vehicle(vehicle)
    printed = printed_state_space(vehicle, signs)
    n = len(system.freedoms)
    k = -np.diag(system.inertia) @ printed.a[:n, -n:]
    return float(np.abs(k - k.T).max() / np.abs(k).max())


def growth_rate(vehicle: Vehicle, signs: Signs = AS_PRINTED) -> float:
    """Largest real part of the printed equations' poles, 1/s; above zero: unstable, no steady response exists."""
    return float(np.linalg.eigvals(printed_state_space(vehicle, signs).a).real.max())


def printed_rms(
    vehicle: Vehicle, spectrum: Spectrum, speed: NDArray[np.float64], band: Band, signs: Signs = AS_PRINTED
) -> NDArray[np.float64]:
    """RMS of the eleven series (`time_side.readout`) by the printed equations: [series, speeds], SI units.

    speed: [m] in m/s. band: limits of every speed. NaN where the equations are unstable.
    """
    model = printed_state_space(vehicle, signs)
    poles = np.linalg.eigvals(model.a)
    rows, _ = readout(half_vehicle(vehicle), model, vehicle)
    if poles.real.max() >= 0:
        return np.full((len(rows), speed.size), np.nan)
    return response_rms(model, rows, poles, vehicle, spectrum, speed, band)


def response_rms(
    model: StateSpace,
    rows: NDArray[np.float64],
    poles: NDArray,
    vehicle: Vehicle,
    spectrum: Spectrum,
    speed: NDArray[np.float64],
    band: Band,
) -> NDArray[np.float64]:
    """RMS [series, speeds] of what `rows` [series, states] read off any stable model of a vehicle's four wheels.

    T = rows (i omega - A)^-1 B exp(-i omega tau), summed over the wheels before any modulus; quadrature on panels that
    follow the poles, the same nodes for all speeds.
    """
    limits = band_limits(band, speed)
    longest = float(wheel_lags(vehicle, speed.min())[-1])
    everything = np.concatenate([poles, singular_points(spectrum, speed)])
    rule = quadrature.quadrature(quadrature.panel_edges(np.unique(limits), everything, longest))
    resolvent = 1j * rule.omega[:, None, None] * np.eye(len(model.a)) - model.a
    transfer = rows @ np.linalg.solve(resolvent, np.broadcast_to(model.b, (rule.omega.size, *model.b.shape)))
    result = np.empty((len(rows), speed.size))
    for k, v in enumerate(speed):
        phases = np.exp(-1j * np.multiply.outer(rule.omega, wheel_lags(vehicle, v)))
        summed = np.einsum("nsw,nw->ns", transfer, phases)
        inside = (rule.omega > limits[0, k]) & (rule.omega < limits[1, k])
        density = angular_psd(spectrum, rule.omega, float(v)) * rule.weights * inside
        result[:, k] = np.sqrt(density @ np.square(np.abs(summed)))
    return result
