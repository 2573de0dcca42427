"""Natural frequencies, damping ratios and mode shapes in words, of any vehicle.

The poles are those of the vehicle's blocks, which exchange no energy. Of blocks that are equal, as two bogies that
pitch without the car body, the motions in phase and in antiphase are told.

An oscillation is named after the motion that holds most of its kinetic energy, "bogie pitch", and the phases between
the bodies that it moves (`solver.phases`). What decays without oscillating is named after what holds most of its
energy: a damper's joints (or whatever else yields inside a leg), or bodies whose motion is overdamped.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.case.case import Case, load_case
from freqrail.errors import InputError
from freqrail.model.bodies import Anatomy, anatomy_of
from freqrail.model.elements import Values
from freqrail.model.half_vehicle import half_vehicle, values_of
from freqrail.model.system import System, alike, evaluate_row
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.blocks import Block, blocks_of
from freqrail.solver.mode_owners import TRACK, Owner, inner_elongations, inside_of, owners
from freqrail.solver.phases import body_words, leg_words, motion_words, place_words
from freqrail.solver.vehicle_poles import FreeMotion, free_motion

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

ALIKE = 5e-4  # of the largest displacement: like bodies whose displacements differ by less are told as one
EQUAL = 1e-6  # displacements, or arms of a leg, that differ by less, relatively, are equal


@dataclass(frozen=True)
class Mode:
    """One mode of a vehicle.

    name: the shape in words. pole: rad/s, the one with the positive imaginary part. natural_frequency:
    |pole|/(2 pi), Hz. damping_ratio: -Re(pole)/|pole|, 1 for a mode that does not oscillate.
    shape: displacement of what moves relative to the largest, signed, {words: -}: one entry for like bodies that move
    equally far, the front one's then. displacements: the same of every freedom by name. An angle counts by the
    displacement over the farthest leg, a bending mode where it bends most. Both are empty for a mode that does not
    oscillate.
    """

    name: str
    pole: complex
    natural_frequency: float
    damping_ratio: float
    shape: dict[str, float]
    displacements: dict[str, float]

    @property
    def damped_frequency(self) -> float:
        """Frequency of the free oscillation, Hz; 0 for a mode that does not oscillate."""
        return abs(self.pole.imag) / (2 * np.pi)

    @property
    def time_constant(self) -> float:
        """Time in which the mode decays to 1/e, s; inf without damping."""
        return float(-1 / self.pole.real) if self.pole.real < 0 else np.inf


def modes(vehicle: Vehicle | Case | str | os.PathLike[str]) -> tuple[Mode, ...]:
    """All modes of a single half vehicle, oscillations first, by natural frequency.

    vehicle: numbers without arrays, or a case (a `Case`, a file's path or a shipped case's name): its scalars.

    A 26-state vehicle has ten modes and six joint relaxations, less where a mode is overdamped. Raises InputError if
    the numbers overflow. See `system_modes`.
    """
    if isinstance(vehicle, Vehicle):
        return system_modes(half_vehicle(), values_of(vehicle))
    case = vehicle if isinstance(vehicle, Case) else load_case(vehicle)
    if case.is_half_vehicle:
        return system_modes(half_vehicle(), values_of(case.vehicle))
    values = {name: float(value) for name, value in case.scalar_case.values().items()}
    return system_modes(alike(case.described.system, values), values)


def system_modes(system: System, values: Values) -> tuple[Mode, ...]:
    """All modes of any vehicle, oscillations first, by natural frequency, no two with one name.

    values: floats, every parameter of the system. The words are those of the system's freedoms and legs. Raises
    InputError if the numbers overflow, ValueError for a law without a differential equation. Source: eigenvalues of
    eq. (10) of the paper for its vehicle.
    """
    lengths, blocks = blocks_of(system, values)
    anatomy = anatomy_of(system)
    found: list[Mode] = []
    for index, block in enumerate(blocks):
        if block.alike != index:
            continue
        motion = free_motion(block, lengths, values)
        if motion is None:
            raise InputError("the vehicle's numbers are too far apart for double precision: no modes")
        copies = [each for each in blocks if each.alike == index]
        named = owners(system, anatomy, block, motion, values)
        for factors in _combinations(anatomy, copies):
            moved = _moved(system, copies, factors, motion, values)
            support = np.any([np.any(copy.basis, axis=1) for copy in copies], axis=0)
            for k, owner in enumerate(named):
                name = _name(system, anatomy, owner, moved, k, k < motion.oscillating)
                mode = _mode(name, motion.poles[k])
                if k < motion.oscillating:
                    shape, displacements = _shape(system, anatomy, moved.displacement[:, k], support, values)
                    mode = replace(mode, shape=shape, displacements=displacements)
                found.append(mode)
    return tuple(_told_apart(sorted(found, key=lambda m: (m.damped_frequency == 0, m.natural_frequency))))


def _mode(name: str, pole: complex) -> Mode:
    size = abs(pole)
    damping = float(-pole.real / size) if size else 0.0
    return Mode(name, complex(pole), float(size / (2 * np.pi)), damping, {}, {})


# --- equal blocks ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Moved:
    """All of a vehicle at the poles of some equal blocks: q [freedoms, n], elongations of what yields inside its legs,
    and of these themselves [rows, n]."""

    displacement: Complex
    inner: Complex
    elongation: Complex


def _moved(system: System, copies: Sequence[Block], factors: Array, motion: FreeMotion, values: Values) -> _Moved:
    """Equal blocks that move together, each by its factor."""
    displacement = sum(factor * copy.basis @ motion.x for factor, copy in zip(factors, copies, strict=True))
    own = inner_elongations(copies[0], motion, values)
    elongation, inner = np.zeros((2, len(system.rows), motion.poles.size), complex)
    for factor, copy in zip(factors, copies, strict=True):
        for j, strut in enumerate(copy.struts):
            for member, weight in strut.members:
                elongation[member] += factor * weight * motion.e[j]
                inner[member] += factor * weight * own[j]
    return _Moved(np.asarray(displacement), inner, elongation)


def _combinations(anatomy: Anatomy, copies: Sequence[Block]) -> list[Array]:
    """Factors [copies] of orthogonal motions of equal blocks: in phase first, then in antiphase, group by group.

    Blocks are grouped by the bodies that carry what moves in them, as the two bogies of each of two cars.
    """
    if len(copies) == 1:
        return [np.ones(1)]
    places = [_carrier(anatomy, copy) for copy in copies]
    alone = list(np.eye(len(copies)))
    if None in places:
        return alone
    known = [place for place in places if place is not None]
    levels = sorted(set(known))
    ranks = [known[:k].count(place) for k, place in enumerate(known)]
    if len(levels) * (max(ranks) + 1) != len(copies):
        return alone
    patterns = _patterns(anatomy, levels)
    result = []
    for rank in range(max(ranks) + 1):
        for pattern in patterns:
            own = [pattern[levels.index(p)] if r == rank else 0.0 for p, r in zip(known, ranks, strict=True)]
            result.append(np.array(own))
    return result


def _carrier(anatomy: Anatomy, block: Block) -> int | None:
    """The highest body that moves in a block, or the one above several equally high ones; None if there is none."""
    moving = {anatomy.body_of[k] for k in np.flatnonzero(np.any(block.basis, axis=1))}
    top = max(anatomy.bodies[k].level for k in moving)
    highest = {k for k in moving if anatomy.bodies[k].level == top}
    above = {anatomy.bodies[k].above for k in highest}
    return highest.pop() if len(highest) == 1 else above.pop() if len(above) == 1 else None


def _patterns(anatomy: Anatomy, which: list[int]) -> list[Array]:
    """Orthogonal patterns of like bodies, [bodies] each: products of those of the groups and of those within a group.

    Within a group of n they are cos(pi (j + 1/2) k/n): (1, 1), (1, -1) of two, (1, 1, 1), (1, 0, -1), (1, -2, 1) of
    three.
    """
    groups: dict[int | None, int] = {}
    for k in which:
        groups[anatomy.bodies[k].above] = groups.get(anatomy.bodies[k].above, 0) + 1
    sizes = set(groups.values())
    carriers = [carrier for carrier in groups if carrier is not None]
    if len(sizes) == 1 and len(carriers) == len(groups) > 1 and carriers == sorted(carriers):
        (n,) = sizes
        return [np.outer(outer, inner).ravel() for outer in _patterns(anatomy, carriers) for inner in _cosines(n)]
    return _cosines(len(which))


def _cosines(n: int) -> list[Array]:
    table = np.cos(np.pi * np.outer(np.arange(n), np.arange(n) + 0.5) / n)
    table = np.where(np.abs(table) < 1e-12, 0.0, table / np.max(np.abs(table), axis=1, keepdims=True))
    return list(table)


# --- words -------------------------------------------------------------------------------------------


def _name(system: System, anatomy: Anatomy, owner: Owner, moved: _Moved, k: int, oscillates: bool) -> str:
    """The k-th mode in words."""
    if owner.part >= 0:
        part = anatomy.parts[owner.part]
        own = _signed(moved.displacement[list(part.freedoms), k])
        words = motion_words(part, anatomy.bodies, dict(zip(part.bodies, own, strict=True)))
        return words if oscillates else f"{words}, overdamped"
    rows = [i for i in range(len(system.rows)) if inside_of(system, i) == owner.inside]
    own = _signed((moved.elongation if oscillates else moved.inner)[rows, k])
    lower = [anatomy.lower[i] for i in rows]
    amplitudes: dict[int, float] = {}
    for body, x in zip(lower, own, strict=True):
        if body is not None and abs(x) >= abs(amplitudes.get(body, 0.0)):
            amplitudes[body] = x
    words = ""
    if len(amplitudes) > 1 and None not in lower and len({anatomy.bodies[body].kind for body in amplitudes}) == 1:
        tell = body_words if owner.inside == TRACK else leg_words
        words = tell(sorted(amplitudes), anatomy.bodies, amplitudes)
    return f"{owner.inside} {'oscillating' if oscillates else 'relaxing'}" + (f", {words}" if words else "")


def _signed(x: Complex) -> list[float]:
    """Displacements relative to the largest of them, the real parts."""
    largest = x[np.argmax(np.abs(x))]
    return [float(each) for each in (x / largest).real] if largest else [0.0] * x.size


def _shape(
    system: System, anatomy: Anatomy, q: Complex, support: NDArray[np.bool_], values: Values
) -> tuple[dict[str, float], dict[str, float]]:
    """`Mode.shape` and `Mode.displacements` of freedoms q; support: which of them the block has."""
    x = q * _arms(system, anatomy, values)
    size = np.abs(x)
    x = (x / x[np.flatnonzero(size >= (1 - EQUAL) * np.max(size))[0]]).real  # of equally large ones the first
    told = [part for part in anatomy.parts if any(support[k] for k in part.freedoms)]
    shape: dict[str, float] = {}
    for part in told:
        own = [float(x[k]) for k in part.freedoms]
        motion = sum(other.kind == part.kind for other in told) > 1
        if np.ptp(np.abs(own)) <= ALIKE:
            shape[part.title if motion else part.kind] = own[0]
            continue
        for body, each in zip(part.bodies, own, strict=True):
            words = place_words(body, anatomy.bodies)
            shape[part.title.replace(part.kind, words, 1) if motion else words] = each
    return shape, {freedom.name: float(each) for freedom, each in zip(system.freedoms, x, strict=True)}


def _arms(system: System, anatomy: Anatomy, values: Values) -> Array:
    """Displacement per unit of each freedom where most of it is, over the leg farthest from the centre, upwards."""
    rows = np.array([evaluate_row(each.row, system.freedoms, values) for each, _ in system.rows], dtype=float)
    result = np.zeros(len(system.freedoms))
    for row in rows:
        # a leg's row counts its upper body positive and its lower one negative
        ends = {
            anatomy.body_of[k]: np.sign(row[k])
            for k, freedom in enumerate(system.freedoms)
            if row[k] and freedom.motion in ("bounce", "")
        }
        for k in np.flatnonzero(row):
            arm = row[k] * ends.get(anatomy.body_of[k], 1.0)
            if abs(arm) > (1 + EQUAL) * abs(result[k]):
                result[k] = arm
    return np.where(result == 0, 1.0, result)


def _told_apart(modes: Sequence[Mode]) -> list[Mode]:
    """Modes of one name, as an overdamped pair is, become a slow and a fast one; of more, each has its number."""
    result = []
    for k, mode in enumerate(modes):
        alike = [i for i, other in enumerate(modes) if other.name == mode.name]
        words: tuple[str, ...] = ("lower", "higher") if mode.damped_frequency else ("slow", "fast")
        if len(alike) > 2:
            words = tuple(f"{i + 1} of {len(alike)}" for i in range(len(alike)))
        result.append(replace(mode, name=f"{mode.name}, {words[alike.index(k)]}") if len(alike) > 1 else mode)
    return result
