"""A vehicle at rest on a level track: the stiffness matrix, what hangs on nothing, and the wheels' static loads."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Law, Values
from freqrail.model.system import System, evaluate_row
from freqrail.model.vehicle import GRAVITY

SINGULAR = 1e-9
"""A motion whose stiffness is below this, of the matrix scaled to ones on its diagonal, hangs on nothing."""


def _grid(system: System, values: Values) -> tuple[int, ...]:
    return np.broadcast_shapes(*(np.shape(values[name]) for name in system.parameters if name in values))


def _springs(system: System, values: Values) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """(rows of the legs [..., legs, n], their static stiffnesses [..., legs], rows of the wheels [..., wheels, n])."""
    shape = _grid(system, values)

    def rows(some: tuple) -> NDArray[np.float64]:
        entries = [evaluate_row(each.row, system.freedoms, values) for each in some]
        stacked = [np.stack([np.broadcast_to(entry, shape) for entry in row], axis=-1) for row in entries]
        return np.stack(stacked, axis=-2) if stacked else np.zeros((*shape, 0, len(system.freedoms)))

    stiffnesses = [np.broadcast_to(_at_rest(leg.law, values), shape) for leg in system.legs]
    k = np.stack(stiffnesses, axis=-1) if stiffnesses else np.zeros((*shape, 0))
    return rows(system.legs), k, rows(system.wheels)


_SLOW = 1e-15  # 1/s: at 0 a dashpot and an inerter in series would be 0/0
_RIGID = 1e9  # of the stiffest leg: what stands for an infinite stiffness


def _at_rest(law: Law, values: Values) -> NDArray[np.float64]:
    """Static stiffness of a law, N/m; 0 of one whose force vanishes with the motion, as a dashpot's does."""
    with np.errstate(all="ignore"):
        once, twice = (np.real(law.stiffness(values, factor * _SLOW + 0j)) for factor in (1, 2))
        return np.where(np.abs(twice) > 1.5 * np.abs(once), 0.0, once)


def wheel_loads(system: System, values: Values) -> NDArray[np.float64]:
    """Static load of every wheel in N: [wheels, grid...]; the contacts are rigid, whatever their laws.

    values: of all parameters but the contacts'. Solves K q = -m g with the wheels' displacements zero; g as in the
    paper's eq. (1). NaN where the vehicle does not stand by its springs alone.
    """
    legs, k, wheels = _springs(system, values)
    stiff = np.nanmax(np.where(np.isfinite(k), k, 0.0), axis=-1, keepdims=True, initial=1.0)
    k = np.where(np.isinf(k), _RIGID * stiff, k)
    n, held = len(system.freedoms), wheels.shape[-2]
    matrix = np.einsum("...li,...l,...lj->...ij", legs, k, legs)
    whole = np.zeros((*matrix.shape[:-2], n + held, n + held))
    whole[..., :n, :n] = matrix / stiff[..., None]
    whole[..., :n, n:] = np.swapaxes(wheels, -1, -2)
    whole[..., n:, :n] = wheels
    weight = [
        np.broadcast_to(
            np.asarray(values[f.inertia]) * GRAVITY if f.motion in ("bounce", "") else 0.0, matrix.shape[:-2]
        )
        for f in system.freedoms
    ]
    right = np.concatenate([np.stack(weight, axis=-1), np.zeros((*matrix.shape[:-2], held))], axis=-1)
    try:
        solved = np.linalg.solve(whole, right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        solved = np.full(right.shape, math.nan)
    return np.moveaxis(solved[..., n:], -1, 0)


def loose_motions(system: System, values: Values) -> list[dict[str, float]]:
    """Motions without static stiffness, as {freedom: share}, largest shares first; the contacts count as springs.

    values: floats. A vehicle that has one runs away: the RMS of its displacement is infinite.
    """
    legs, k, wheels = _springs(system, values)
    stiff = max((float(v) for v in np.ravel(k) if np.isfinite(v)), default=1.0) or 1.0
    k = np.where(np.isinf(k), 1e3 * stiff, k)
    matrix = np.einsum("li,l,lj->ij", legs, k, legs) + stiff * wheels.T @ wheels
    size = np.sqrt(np.diag(matrix))
    nothing = size <= 1e-12 * math.sqrt(stiff)
    scale = np.where(nothing, 1.0, size)
    w, v = np.linalg.eigh(matrix / np.outer(scale, scale) * np.outer(~nothing, ~nothing))
    found = []
    for column in v[:, np.abs(w) < SINGULAR].T:
        shares = np.abs(column) / np.max(np.abs(column))
        order = np.argsort(-shares)
        found.append({system.freedoms[i].name: float(shares[i]) for i in order if shares[i] > 0.1})
    return found


def undamped_modes(system: System, values: Values) -> list[tuple[float, dict[str, float]]]:
    """Natural frequencies, Hz, and {freedom: kinetic energy, as a share of the largest} without dashpots.

    values: floats. What stands in series with a dashpot does not count. A rigid leg counts as very stiff. Source: the
    generalised eigenvalue problem K x = omega^2 M x, scaled by the masses.
    """
    legs, k, wheels = _springs(system, values)
    contacts = np.array([float(_at_rest(wheel.contact, values)) for wheel in system.wheels])
    rows, stiff = np.concatenate([legs, wheels]), np.concatenate([k, contacts])
    largest = max((float(v) for v in stiff if np.isfinite(v)), default=1.0)
    stiff = np.where(np.isfinite(stiff), stiff, 1e3 * largest)
    masses = np.array([float(np.asarray(values[f.inertia])) for f in system.freedoms])
    scale = 1 / np.sqrt(masses)
    w, v = np.linalg.eigh(np.einsum("li,l,lj->ij", rows * scale, stiff, rows * scale))
    found = []
    for square, column in zip(w, v.T, strict=True):
        energy = np.square(column)  # of the masses: column is sqrt(M) x
        shares = energy / np.max(energy)
        names = {f.name: float(s) for f, s in zip(system.freedoms, shares, strict=True)}
        found.append((float(np.sqrt(max(square, 0.0)) / (2 * np.pi)), names))
    return found
