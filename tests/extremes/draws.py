"""Vehicles, tracks, speeds and bands far apart, and the counter-examples of the past."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from freqrail.case.parameters import PARAMETERS

PLAUSIBLE = {  # the paper's vehicle, of which the draws are moved
    "car_body_mass": 15200.0,
    "car_body_pitch_inertia": 1019000.0,
    "bogie_mass": 600.0,
    "bogie_pitch_inertia": 700.0,
    "wheelset_mass": 700.0,
    "primary_stiffness": 875e3,
    "primary_damping": 17e3,
    "primary_joint_stiffness": 5e6,
    "secondary_stiffness": 412e3,
    "secondary_damping": 54e3,
    "secondary_joint_stiffness": 5e6,
    "half_bogie_spacing": 3.289,
    "half_wheelbase": 0.797,
    "contact_stiffness": 1044772938.1622791,
}
DAMPERS = ("primary_damping", "secondary_damping")
JOINTS = ("primary_joint_stiffness", "secondary_joint_stiffness")
LENGTHS = ("half_bogie_spacing", "half_wheelbase")
GERMAN_LOW = (4.032e-7, 0.0206, 0.8246)
SLOWEST, FASTEST = 1e-3 / 3.6, 600 / 3.6  # m/s: 1 m/h to 600 km/h


@dataclass(frozen=True)
class Draw:
    """One grid point, SI: speed in m/s, spectrum (roughness, cut-offs), band ("frequency" in Hz, "wavelength" in m)."""

    vehicle: dict[str, float] = field(default_factory=dict)
    spectrum: tuple[float, float, float] = GERMAN_LOW
    speed: float = 250 / 3.6
    band: tuple[str, float, float] | None = None

    @property
    def limits(self) -> tuple[float, float] | None:
        """The band in rad/s."""
        if self.band is None:
            return None
        kind, low, high = self.band
        if kind == "wavelength":
            low, high = self.speed / high, self.speed / low
        return 2 * math.pi * low, 2 * math.pi * high

    def case(self) -> str:
        """The case file."""
        units = {name: PARAMETERS[name].unit for name in self.vehicle}
        lines = ["schema_version = 1", 'title = "extreme"', "[vehicle]", 'masses = "half"']
        lines += [f'{name} = "{value!r} {units[name]}"' for name, value in self.vehicle.items()]
        roughness, low, high = self.spectrum
        lines += ["[track]", 'spectrum = "rational"', f'roughness = "{roughness!r} m^2*rad/m"']
        lines += [f'cutoffs = ["{low!r} rad/m", "{high!r} rad/m"]', "[operation]", f'speed = "{self.speed!r} m/s"']
        if self.band is not None:
            kind, start, end = self.band
            unit = PARAMETERS[kind].unit
            lines += ["[band]", f'{kind} = ["{start!r} {unit}", "{end!r} {unit}"]']
        return "\n".join(lines) + "\n"


def _paper(speed: float = 250.0, **changes: float) -> Draw:
    return Draw(PLAUSIBLE | changes, speed=speed / 3.6)


KNOWN = (  # that were ok and off by more than their estimate
    _paper(primary_damping=4.0, secondary_damping=0.02, primary_stiffness=0.5, secondary_stiffness=1e9),
    _paper(primary_stiffness=0.9, primary_damping=20.0, secondary_damping=10.0, car_body_mass=1.0),
    _paper(contact_stiffness=9e11, primary_damping=3e9, secondary_stiffness=3e11),
)


def draw(seed: int, number: int) -> Draw:
    """Draw `number` of a seed, whatever the others."""
    rng = np.random.default_rng((seed, number))
    decades = float(rng.choice([1.0, 3.0, 6.0, 9.0]))
    names = [name for name in PLAUSIBLE if name not in LENGTHS]
    moved = rng.choice(names, int(rng.integers(1, len(names) + 1)), replace=False)
    vehicle = dict(PLAUSIBLE)
    for name in moved:
        vehicle[name] = _within(name, PLAUSIBLE[name] * 10 ** rng.uniform(-decades, decades))
    for name in JOINTS:
        if rng.random() < 0.25:
            vehicle[name] = math.inf if rng.random() < 0.5 else 10 ** rng.uniform(0, 15)
        vehicle[name] = _within(name, vehicle[name])
    for name in DAMPERS:
        if rng.random() < 0.03:
            vehicle[name] = 0.0
    if rng.random() < 0.3:
        scale = min(decades, 2.0)
        vehicle["half_bogie_spacing"] *= 10 ** rng.uniform(-scale, scale)
        vehicle["half_wheelbase"] = vehicle["half_bogie_spacing"] * 10 ** rng.uniform(-scale, -1e-3)
    vehicle |= {name: _within(name, vehicle[name]) for name in LENGTHS}
    speed = rng.uniform(60, 300) / 3.6 if rng.random() < 0.5 else _log(rng, SLOWEST, FASTEST)
    spectrum = _spectrum(rng, decades)
    return Draw(vehicle, spectrum, speed, _band(rng))


def _within(name: str, value: float) -> float:
    """The value, or the end of the range that a case accepts."""
    parameter = PARAMETERS[name]
    if math.isinf(value) and parameter.infinite:
        return value
    low, high = parameter.plausible
    return min(max(value, parameter.lower, low), parameter.upper, high)


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10 ** rng.uniform(math.log10(low), math.log10(high)))


def _spectrum(rng: np.random.Generator, decades: float) -> tuple[float, float, float]:
    roughness, low, high = GERMAN_LOW
    kind = rng.random()
    if kind < 0.5:
        return GERMAN_LOW
    if kind < 0.7:
        scale = min(decades, 3.0)
        low, high = (_within("cutoffs", c * 10 ** rng.uniform(-scale, scale)) for c in (low, high))
    else:  # merging
        low = _within("cutoffs", _log(rng, 1e-3, 10.0))
        high = low * (1 + (0.0 if rng.random() < 0.2 else _log(rng, 1e-16, 1.0)))
    return roughness, min(low, high), max(low, high)


def _band(rng: np.random.Generator) -> tuple[str, float, float] | None:
    kind = rng.random()
    if kind < 0.6:
        return None
    if kind < 0.9:
        low = _log(rng, 1e-3, 1e3)
        return "frequency", low, low * (1 + _log(rng, 1e-3, 1e4))
    low = _log(rng, 1e-1, 1e2)
    return "wavelength", low, low * (1 + _log(rng, 1e-2, 1e3))
