"""What each mode of a block is named after: the motion, or what yields inside a leg, that holds most of its energy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.bodies import Anatomy
from freqrail.model.elements import Values
from freqrail.model.system import Leg, System
from freqrail.reduction.blocks import Block, Strut
from freqrail.solver.block_poles import EPSILON, FAR
from freqrail.solver.vehicle_poles import FreeMotion
from freqrail.types import Number

Array = NDArray[np.float64]

TRACK = "track under the wheels"


@dataclass(frozen=True)
class Owner:
    """A motion, the index of one of `Anatomy.parts`; or, with -1, what yields inside legs, in words."""

    part: int
    inside: str = ""


def inside_of(system: System, row: int) -> str:
    """Words for what yields inside one of `System.rows`."""
    each = system.rows[row][0]
    return (each.inside or each.name) if isinstance(each, Leg) else TRACK


def owners(system: System, anatomy: Anatomy, block: Block, motion: FreeMotion, values: Values) -> list[Owner]:
    """The owner of each pole of a block.

    A motion can oscillate as often as the block has coordinates of it. If it does not, it is overdamped and has two
    real poles. What yields inside a strut has one real pole for each of its states, or oscillates for two of them.
    """
    square = np.square(block.basis).sum(axis=1)
    coordinates = [float(square[list(part.freedoms)].sum()) for part in anatomy.parts]
    times = {Owner(i): int(np.ceil(count - 1e-9)) for i, count in enumerate(coordinates) if count > 1e-9}
    states: Counter[Owner] = Counter()
    for strut in block.struts:
        count = len(_branches(strut, values))
        if count:
            states[Owner(-1, inside_of(system, strut.members[0][0]))] += count
    kinetic, stored = _energies(system, anatomy, block, motion, values, [*times, *states])
    n = motion.oscillating
    slots = [owner for owner, count in times.items() for _ in range(count)]
    slots += [owner for owner, count in states.items() for _ in range(count // 2)]
    oscillating = _assigned(slots, {owner: each[:n] for owner, each in kinetic.items()}, n)
    used = Counter(oscillating)
    slots = [owner for owner, count in states.items() for _ in range(count - 2 * used[owner])]
    slots += [owner for owner, count in times.items() for _ in range(2 * (count - used[owner]))]
    count = motion.poles.size - n
    return oscillating + _assigned(slots, {owner: each[n:] for owner, each in stored.items()}, count)


def _assigned(slots: Sequence[Owner], energies: dict[Owner, Array], count: int) -> list[Owner]:
    """An owner for each of `count` poles: each slot taken once, most energy in all, each pole's as a share of its own.

    If there are more poles than slots, whoever holds most of a pole's energy owns the rest.
    """
    from scipy.optimize import linear_sum_assignment

    if not count:
        return []
    everyone = list(energies)
    total = np.sum(list(energies.values()), axis=0)
    share = {owner: np.nan_to_num(each / np.where(total > 0, total, 1.0)) for owner, each in energies.items()}
    result = [everyone[int(np.argmax([share[owner][k] for owner in everyone]))] for k in range(count)]
    if slots:
        table = np.array([share[owner] for owner in slots])
        for slot, k in zip(*linear_sum_assignment(-table), strict=True):
            result[k] = slots[slot]
    return result


def _energies(
    system: System, anatomy: Anatomy, block: Block, motion: FreeMotion, values: Values, wanted: Sequence[Owner]
) -> tuple[dict[Owner, Array], dict[Owner, Array]]:
    """(kinetic, stored), {owner: [n]}, at each pole: m |x|^2; and m |p x|^2 or K |e|^2 of the springs inside legs."""
    q = np.square(np.abs(block.basis @ motion.x))
    masses = np.array([float(values[freedom.inertia]) for freedom in system.freedoms])
    speed2 = np.square(np.abs(motion.poles))
    kinetic = {owner: np.zeros(motion.poles.size) for owner in wanted}
    stored = {owner: np.zeros(motion.poles.size) for owner in wanted}
    for owner in wanted:
        if owner.part >= 0:
            some = list(anatomy.parts[owner.part].freedoms)
            kinetic[owner] = np.sum(masses[some, None] * q[some], axis=0)
            stored[owner] = speed2 * kinetic[owner]
    for strut, e in zip(block.struts, motion.e, strict=True):
        owner = Owner(-1, inside_of(system, strut.members[0][0]))
        if owner not in kinetic:
            continue
        kinetic[owner] = kinetic[owner] + np.abs(strut.law.loss(values, motion.poles)[1]) * np.square(np.abs(e))
        for c, tau in _branches(strut, values):
            spring = e - _yielded(e, motion.poles, tau)
            stored[owner] = stored[owner] + np.abs(c / tau) * np.square(np.abs(spring))
    return kinetic, stored


def inner_elongations(block: Block, motion: FreeMotion, values: Values) -> NDArray[np.complex128]:
    """The elongation of what yields most inside each strut, [struts, n]; 0 for one that has nothing inside."""
    result = np.zeros_like(motion.e)
    for j, (strut, e) in enumerate(zip(block.struts, motion.e, strict=True)):
        for _, tau in _branches(strut, values):
            inner = _yielded(e, motion.poles, tau)
            result[j] = np.where(np.abs(inner) > np.abs(result[j]), inner, result[j])
    return result


def _branches(strut: Strut, values: Values) -> list[tuple[Number, Number]]:
    """The branches of a strut's law that are states of the block (see `block_poles.state_matrix`)."""
    found = strut.law.realisation(values)
    return [(c, tau) for c, tau in (found.branches if found else ()) if c != 0 and abs(tau) > 1 / FAR]


def _yielded(e: NDArray, p: NDArray, tau: Number) -> NDArray:
    """Delta of a branch: (e - Delta)/tau = p Delta."""
    rest = 1.0 + p * tau
    return np.asarray(e / np.where(np.abs(rest) > EPSILON, rest, EPSILON))
