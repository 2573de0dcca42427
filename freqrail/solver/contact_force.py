"""The dynamic force between wheel and rail: K_H times the contact spring's compression, as RMS over a band.

The force is an unknown of the blocks' equations (`solver.elimination`): no difference of nearly equal heights is taken.
A wheel of the linear model pulls as well as it pushes; where three RMS exceed the static load, a real one leaves the
rail now and then.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from freqrail.model.band import Band, band_limits
from freqrail.model.half_vehicle import half_vehicle, values_of
from freqrail.model.outputs import Force, Output
from freqrail.model.spectrum import Spectrum, angular_psd, kinks, singular_points
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import Reduction
from freqrail.solver import quadrature
from freqrail.solver.problem import reduced_for_any_lengths
from freqrail.solver.transfer import transfer
from freqrail.solver.vehicle_poles import half_vehicle_poles

BAND_END = 3.0  # of the highest resonance, where a band without an end is cut: hardly any track height is left beyond
FASTEST_POLE = 1e15  # rad/s, beyond which no vehicle has one and panels find no end
MOST_NODES = 50_000  # of a trial that is to take milliseconds: a train so slow that it needs more loses no contact
REFINEMENT = 1.25  # panels are shorter by this than those that many vehicles share


@cache
def _reduction() -> Reduction:
    wheels = tuple((wheel.name.removeprefix("axle_"), Force(wheel.name)) for wheel in half_vehicle().wheels)
    return reduced_for_any_lengths((Output("contact_force", "N", "axle", wheels),))


def contact_force(vehicle: Vehicle, omega: NDArray[np.float64], speed: float) -> NDArray[np.complex128]:
    """Dynamic contact force of each wheel per metre of track height under the vehicle's centre, N/m: [4 axles, n].

    vehicle: numbers without arrays. omega [n] in rad/s, speed in m/s. F = K_H (z_w - v), with the lags of eq. (2).
    """
    return transfer(_reduction(), values_of(vehicle), omega, speed)["contact_force"]


def contact_force_rms(vehicle: Vehicle, spectrum: Spectrum, speed: float, band: Band | None) -> NDArray[np.float64]:
    """RMS of the dynamic contact force of each wheel, N: [4 axles].

    vehicle: numbers without arrays. speed in m/s. NaN where the numbers overflow, the quadrature would take long, or a
    block has no damper at all: what rings for ever is told by its points' status.
    """
    nothing = np.full(4, np.nan)
    resonances = half_vehicle_poles(vehicle)
    if _undamped(vehicle) or not np.all(np.abs(resonances) < FASTEST_POLE):
        return nothing
    highest = float(np.abs(resonances.imag).max())
    limits = np.array([1e-6 * highest, BAND_END * highest])
    if band is not None:
        limits = np.ravel(band_limits(band, np.array([speed])))
    points = np.ravel(kinks(spectrum, np.array([speed])))
    if points.size:  # a table of the spectrum has ends
        limits = np.clip(limits, points[0], points[-1])
    inside = points[(points > limits[0]) & (points < limits[1])]
    first = np.unique(np.concatenate([limits, inside]))
    lag = 2 * (vehicle.half_bogie_spacing + vehicle.half_wheelbase) / speed
    if first.size < 2 or not quadrature.fewest_nodes(first, lag) < MOST_NODES:
        return nothing
    everything = np.concatenate([resonances, singular_points(spectrum, np.array([speed]))])
    edges = quadrature.panel_edges(first, everything, lag, REFINEMENT)
    if edges.size * quadrature.PANEL_NODES > 2 * MOST_NODES:
        return nothing
    rule = quadrature.quadrature(edges)
    force = contact_force(vehicle, rule.omega, speed)
    density = angular_psd(spectrum, rule.omega, speed) * rule.weights
    return np.sqrt((np.square(force.real) + np.square(force.imag)) @ density)


def _undamped(vehicle: Vehicle) -> bool:
    """Whether a block of the vehicle takes no energy at all."""
    values = values_of(vehicle)
    losses = ([strut.law.loss(values, 1j)[0] for strut in block.struts] for block in _reduction().blocks)
    return any(not np.any(each) for each in losses)
