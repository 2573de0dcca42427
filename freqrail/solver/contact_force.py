"""The dynamic force between wheel and rail: K_H times the contact spring's compression, as RMS over a band.

In a chain of `chains.ladder` the force below the wheelset is the sum of the inertia forces above it, as in
`chains.descend`: no difference of nearly equal heights is taken. A wheel of the linear model pulls as well as it
pushes; where three RMS exceed the static load, a real one leaves the rail now and then.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from freqrail.model.band import Band
from freqrail.model.responses import CHAINS, RESPONSES
from freqrail.model.spectrum import Spectrum, angular_psd
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.chains import chain_responses, ladder, poles
from freqrail.solver import quadrature
from freqrail.solver.panels import own_edges
from freqrail.solver.problem import half_vehicle_problem

BAND_END = 3.0  # of the highest resonance, where a band without an end is cut: hardly any track height is left beyond
FASTEST_POLE = 1e15  # rad/s, beyond which no vehicle has one and panels find no end
MOST_NODES = 50_000  # of a trial that is to take milliseconds: a train so slow that it needs more loses no contact


def contact_force(vehicle: Vehicle, omega: NDArray[np.float64], speed: float) -> NDArray[np.complex128]:
    """Dynamic contact force of each wheel per metre of track height under the vehicle's centre, N/m: [4 axles, n].

    vehicle: numbers without arrays. omega [n] in rad/s, speed in m/s. F = K_H (z_w - v), with the lags of eq. (2).
    """
    chains = chain_responses(vehicle, omega)
    force = {}
    for chain in CHAINS:
        inertia = vehicle.wheelset_mass * np.square(omega) * chains[chain].ratios["wheelset"]
        force[chain] = (chains[chain].forces["primary"] + inertia) * chains[chain].top
    a, b = vehicle.half_wheelbase * omega / speed, vehicle.half_bogie_spacing * omega / speed
    bounce = force["bounce"] * np.cos(a) * np.cos(b)
    pitch = force["pitch"] * (1j * np.cos(a) * np.sin(b))
    bogie_pitch = force["bogie_pitch"] * (1j * np.sin(a))
    axles = RESPONSES["wheelset_acceleration"].signs
    return np.array([bounce + s * pitch + r * bogie_pitch * np.exp(1j * s * b) for s, r in axles])


def contact_force_rms(vehicle: Vehicle, spectrum: Spectrum, speed: float, band: Band | None) -> NDArray[np.float64]:
    """RMS of the dynamic contact force of each wheel, N: [4 axles].

    vehicle: numbers without arrays. speed in m/s. NaN where the numbers overflow, the quadrature would take long, or a
    chain has no damper at all: what rings for ever is told by its points' status.
    """
    resonances = poles(vehicle)
    undamped = any(all(damping == 0 for _, damping, _ in ladder(vehicle, chain)[1]) for chain in CHAINS)
    if undamped or not np.all(np.abs(resonances) < FASTEST_POLE):
        return np.full(4, np.nan)
    highest = float(np.abs(resonances.imag).max()) / (2 * np.pi)
    band = band or Band("frequency", 1e-6 * highest, BAND_END * highest)
    study = half_vehicle_problem(vehicle, np.array([speed]), spectrum, band, ("wheelset_acceleration",))
    lag = 2 * (vehicle.half_bogie_spacing + vehicle.half_wheelbase) / speed
    if not quadrature.fewest_nodes(study.limits[:, 0], lag) < MOST_NODES:
        return np.full(4, np.nan)
    edges = own_edges(study, vehicle, resonances)
    if edges is None or edges.size * quadrature.PANEL_NODES > 2 * MOST_NODES:
        return np.full(4, np.nan)
    rule = quadrature.quadrature(edges)
    transfer = contact_force(vehicle, rule.omega, speed)
    density = angular_psd(spectrum, rule.omega, speed) * rule.weights
    return np.sqrt((np.square(transfer.real) + np.square(transfer.imag)) @ density)
