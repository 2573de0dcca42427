"""Natural frequencies, damping ratios and mode shapes in words.

A half vehicle with equal legs moves in four families that do not exchange energy: car and bogies
bouncing together, car pitching with the bogies bouncing opposed, and the two bogies pitching in phase
or in antiphase. Each family is a chain of `chains.ladder` with a small eigenproblem of its own, so that
the modes come out named, and repeated frequencies do not mix their shapes.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.case.case import Case, load_case
from freqrail.errors import InputError
from freqrail.model.equations import System, state_space
from freqrail.model.responses import CHAINS
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.chains import chain_system
from freqrail.solver.partial_fractions import expand

_WORDS = {
    ("bounce", "car"): "car bounce",
    ("bounce", "bogie"): "bogie bounce, in phase",
    ("bounce", "wheelset"): "wheelsets, all in phase",
    ("pitch", "car"): "car pitch",
    ("pitch", "bogie"): "bogie bounce, in antiphase",
    ("pitch", "wheelset"): "wheelsets, bogies in antiphase",
    ("bogie_pitch", "bogie"): "bogie pitch",
    ("bogie_pitch", "wheelset"): "wheelsets of a bogie opposed",
}
_TWICE = ("bogies in phase", "bogies in antiphase")  # the two bogies' pitch modes have the same poles


@dataclass(frozen=True)
class Mode:
    """One mode of a vehicle.

    name: the shape in words. pole: rad/s, the one with the positive imaginary part. natural_frequency:
    |pole|/(2 pi), Hz. damping_ratio: -Re(pole)/|pole|, 1 for a mode that does not oscillate.
    shape: displacement of each body relative to the largest, signed, {body: -}; empty for a relaxation.
    """

    name: str
    pole: complex
    natural_frequency: float
    damping_ratio: float
    shape: dict[str, float]

    @property
    def damped_frequency(self) -> float:
        """Frequency of the free oscillation, Hz; 0 for a mode that does not oscillate."""
        return abs(self.pole.imag) / (2 * np.pi)

    @property
    def time_constant(self) -> float:
        """Time in which the mode decays to 1/e, s; inf without damping."""
        return float(-1 / self.pole.real) if self.pole.real < 0 else np.inf


def modes(vehicle: Vehicle | Case | str | os.PathLike[str]) -> tuple[Mode, ...]:
    """All modes of a single vehicle, oscillations first, by natural frequency.

    vehicle: numbers without arrays, or a case (a `Case`, a file's path or a shipped case's name): its scalars.

    Oscillations are named after the body that holds most of the kinetic energy; what decays without
    oscillating is named after the damper joint or body that it moves most. Raises InputError if the numbers
    overflow. A 26-state vehicle has ten
    modes and six joint relaxations, less where a mode is overdamped. Source: eigenvalues of eq. (10).
    """
    if not isinstance(vehicle, Vehicle):
        vehicle = (vehicle if isinstance(vehicle, Case) else load_case(vehicle)).vehicle
    found: list[Mode] = []
    for chain in CHAINS:
        part = _chain_modes(vehicle, chain)
        found += part if chain != "bogie_pitch" else [m for words in _TWICE for m in _renamed(part, words)]
    return tuple(sorted(found, key=lambda m: (m.damped_frequency == 0, m.natural_frequency)))


def _renamed(modes: list[Mode], words: str) -> list[Mode]:
    return [replace(mode, name=f"{mode.name}, {words}") for mode in modes]


def _chain_modes(vehicle: Vehicle, chain: str) -> list[Mode]:
    system = chain_system(vehicle, chain)
    model = state_space(system)
    if not np.isfinite(model.a).all():
        raise InputError("the vehicle's numbers are too far apart for double precision: no modes")
    values, vectors = np.linalg.eig(model.a)
    values = _polished(values, expand(vehicle, chain).poles)
    n = len(system.freedoms)
    displacement = vectors[-n:]
    # a pair is told once, by its upper pole; rounding can leave a real pole a tiny imaginary part
    oscillates = np.abs(values.imag) > 1e-9 * np.abs(values)
    upper = np.flatnonzero(oscillates & (values.imag > 0))
    owners = _owners(np.array(system.inertia)[:, None] * np.abs(displacement[:, upper]) ** 2)
    found = [
        _mode(_WORDS[chain, system.freedoms[body]], values[k], _shape(system, displacement[:, k]))
        for k, body in zip(upper, owners, strict=True)
    ]
    for k in np.flatnonzero(~oscillates):
        found.append(_mode(_relaxation(system, model.states, vectors[:, k], chain), complex(values[k].real), {}))
    return _told_apart(found)


def _polished(values: NDArray[np.complex128], poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Eigenvalues, each replaced by the pole beside it: stiff joints cost the eigenvalues digits, not the poles."""
    distance = np.abs(values[:, None] - poles)
    nearest = np.argmin(np.where(np.isfinite(distance), distance, np.inf), axis=1)
    beside = distance[np.arange(values.size), nearest] < 0.01 * np.abs(values)
    return np.where(beside, poles[nearest], values)


def _told_apart(modes: list[Mode]) -> list[Mode]:
    """Two modes of one name, as an overdamped pair is, become a slow and a fast one."""
    result = []
    for mode in modes:
        alike = [m.natural_frequency for m in modes if m.name == mode.name]
        words = "" if len(alike) == 1 else ", slow" if mode.natural_frequency == min(alike) else ", fast"
        result.append(replace(mode, name=mode.name + words))
    return result


def _owners(energy: NDArray[np.float64]) -> list[int]:
    """The body that each mode [bodies, modes] is named after, each body once: most energy in all."""
    from scipy.optimize import linear_sum_assignment

    share = energy / energy.sum(axis=0)
    bodies, columns = linear_sum_assignment(-share)
    return [int(body) for _, body in sorted(zip(columns, bodies, strict=True))]


def _shape(system: System, displacement: NDArray[np.complex128]) -> dict[str, float]:
    largest = displacement[np.argmax(np.abs(displacement))]
    return {body: float((x / largest).real) for body, x in zip(system.freedoms, displacement, strict=True)}


def _relaxation(system: System, states: tuple[str, ...], vector: NDArray, chain: str) -> str:
    inner = [i for i, name in enumerate(states) if name.startswith("Delta_")]
    if inner:
        most = max(inner, key=lambda i: abs(vector[i]))
        return f"{states[most].removeprefix('Delta_')} damper joints relaxing, {chain.replace('_', ' ')}"
    body = system.freedoms[int(np.argmax(np.abs(vector[-len(system.freedoms) :])))]
    return f"{_WORDS[chain, body]}, overdamped"


def _mode(name: str, pole: complex, shape: dict[str, float]) -> Mode:
    size = abs(pole)
    return Mode(name, complex(pole), float(size / (2 * np.pi)), float(-pole.real / size) if size else 0.0, shape)
