"""Poles of one vehicle, block by block, and its free oscillations there, in the blocks' coordinates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from freqrail.model.elements import Values
from freqrail.model.half_vehicle import half_vehicle, values_of
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.blocks import Block, blocks_of
from freqrail.reduction.forms import Lengths
from freqrail.solver.block_poles import FAR, LIGHT, UNSURE, poles, state_matrix
from freqrail.solver.free_oscillation import clusters, polished, real_parts, together

Complex = NDArray[np.complex128]

ROUNDED = 1e-9  # an imaginary part below this, relative to the pole, is what rounding leaves of a real pole's
NEAR = 0.01  # relative distance from its eigenvalue beyond which a polished pole is another one


@dataclass(frozen=True)
class FreeMotion:
    """A block of one vehicle in free motion at its poles, each conjugate pair told once.

    poles: [n] rad/s, those that oscillate (Im > 0) first, then real ones. oscillating: how many of them do. x:
    [coordinates, n], e: [struts, n], displacements and elongations, any common factor a pole.
    """

    poles: Complex
    oscillating: int
    x: Complex
    e: Complex

    @property
    def all(self) -> Complex:
        """The poles with their conjugates, rad/s."""
        return np.concatenate([self.poles, np.conj(self.poles[: self.oscillating])])


def free_motion(block: Block, lengths: Lengths, values: Values) -> FreeMotion | None:
    """The free motion of a block at all its poles; None where the numbers overflow.

    values: floats. Eigenvalues are polished; one that no polishing finds stays as it is, with its eigenvector. Raises
    ValueError for a law without a realisation.
    """
    with np.errstate(all="ignore"):
        a, there = state_matrix(block, lengths, values)
        raw = poles(block, lengths, values)
    if not np.isfinite(raw).all():
        return None
    # states that the vehicle does not have stand by themselves at -2 FAR
    order = np.argsort(np.abs(raw + 2 * FAR), kind="stable")
    raw = np.delete(raw, order[: np.count_nonzero(~there)])
    oscillates = np.abs(raw.imag) > ROUNDED * np.abs(raw)
    upper, real = raw[oscillates & (raw.imag > 0)], raw[~oscillates].real.astype(complex)
    raw = np.concatenate([upper, real])
    p, x, e, sure = _polished(block, lengths, values, raw)
    if not sure.all():
        of, vectors = np.linalg.eig(a)
        rows = np.array([lengths.evaluate(strut.row, values) for strut in block.struts], dtype=float)
        for k in np.flatnonzero(~sure):
            p[k] = raw[k]
            x[:, k] = vectors[-block.size :, np.argmin(np.abs(of - raw[k]))]
            e[:, k] = rows @ x[:, k]
    p[upper.size :] = p[upper.size :].real
    return FreeMotion(p, upper.size, x, e)


def _polished(
    block: Block, lengths: Lengths, values: Values, raw: Complex
) -> tuple[Complex, Complex, Complex, NDArray[np.bool_]]:
    """(poles, x, e, whether each is found) from eigenvalues [n]."""
    own = {name: values[name] for name in (*block.parameters, *lengths.varying)}
    with np.errstate(all="ignore"):
        p, found = polished(block, lengths, own, raw)
        for places in clusters(p.reshape(-1, 1), np.ones((p.size, 1), dtype=bool)).values():
            p, found = together(block, lengths, own, p, found, places)
        by_energy, uncertain = real_parts(block, own, p, found)
        light = (np.abs(p.real) < LIGHT * np.abs(p)) & (uncertain < 1)
        p = np.where(light, by_energy + 1j * p.imag, p)
        shift = (np.abs(found.step) + found.shift) / np.abs(p)
        sure = (shift < UNSURE) & (np.abs(p - raw) < NEAR * np.abs(raw))
    sure &= np.isfinite(found.x).all(axis=0) & np.isfinite(found.e).all(axis=0)
    return p, found.x.astype(complex), found.e.astype(complex), sure


def vehicle_poles(lengths: Lengths, blocks: Iterable[Block], values: Values) -> Complex:
    """Poles of one vehicle, rad/s, with their conjugates: those of its blocks, equal blocks' once.

    lengths, blocks: of `blocks_of`. values: floats. NaN for a block whose numbers overflow.
    """
    blocks = tuple(blocks)
    found = [free_motion(block, lengths, values) for k, block in enumerate(blocks) if block.alike == k]
    return np.concatenate([np.full(1, np.nan + 0j) if each is None else each.all for each in found])


def half_vehicle_poles(vehicle: Vehicle) -> Complex:
    """`vehicle_poles` of a single half vehicle."""
    return vehicle_poles(*half_vehicle_blocks(), values_of(vehicle))


@cache
def half_vehicle_blocks() -> tuple[Lengths, tuple[Block, ...]]:
    """The half vehicle's blocks, whatever its lengths."""
    system = half_vehicle()
    return blocks_of(system, {name: np.array([1.0, 2.0]) for name in system.lengths})
