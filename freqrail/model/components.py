"""Components of suspensions from their physical data: what goes into a law as its letters."""

from __future__ import annotations

import math
from dataclasses import dataclass

AMBIENT = 101_325.0
"""Pressure around the vehicle, Pa."""

GAS_CONSTANT = 287.05
"""Of dry air, J/(kg K)."""


@dataclass(frozen=True)
class AirSpring:
    """Letters of an air spring's law, SI units.

    As `k3 | (k1 - (k2 | c))`: k1, k2, k3, N/m. With the surge mass b, kg, of the pipe's air `k3 | (k1 - (k2 | c | b))`;
    the same law as `ke | (kv - (c | b))` has ke, kv, N/m, and c and b times `share`.
    """

    k1: float
    k2: float
    k3: float
    b: float
    ke: float
    kv: float
    share: float


def air_spring(
    pressure: float,
    area: float,
    volume: float,
    reservoir: float,
    area_rate: float = 0.0,
    exponent: float = 1.4,
    pipe_length: float = 0.0,
    pipe_area: float = math.nan,
    temperature: float = 293.15,
) -> AirSpring:
    """Stiffnesses of an air spring that is joined to a reservoir by an orifice or a pipe.

    pressure: absolute, Pa; the spring carries (pressure - ambient) times area. area: effective, m^2. volume: of the
    bellows, reservoir: beside it, m^3. area_rate: by how much the effective area falls with a metre of height, -dA/dz,
    m. exponent: polytropic, 1 for slow and 1.4 for fast motion. pipe_length, m, and pipe_area, m^2: of the pipe, whose
    air moves by area/pipe_area as far as the spring. temperature: K.

    With y = w/A for the volume w that has flowed into the reservoir, A dp = k1 (z - y) in the bellows and k2 y in the
    reservoir, k1 = n p A^2/V, k2 = n p A^2/V_r, and k3 = (p - p_a)(-dA/dz); the orifice's c = R A^2 from its pressure
    drop R per volume flow is not known from these data. b = rho L A^2/a. Raises ValueError for data that are none.

    Sources: N. Oda, S. Nishimura, Vibration of air suspension bogies and their design, Bulletin of JSME 13 (1970)
    43-50; M. Berg, A three-dimensional airspring model with friction and orifice damping, Vehicle System Dynamics 33
    (1999) suppl., 528-539 (surge mass).
    """
    for name, value in {"area": area, "volume": volume, "reservoir": reservoir, "temperature": temperature}.items():
        if not (value > 0 and math.isfinite(value)):
            raise ValueError(f"{name} must be positive and finite (got {value!r})")
    if not AMBIENT < pressure < math.inf:
        raise ValueError(f"pressure is absolute, above the ambient {AMBIENT:g} Pa (got {pressure!r})")
    if not 1.0 <= exponent <= 5 / 3:
        raise ValueError(f"exponent: 1 (isothermal) to 1.67 is expected, 1.4 for fast motion (got {exponent!r})")
    if not pipe_length >= 0 or (pipe_length and not pipe_area > 0):
        raise ValueError(f"a pipe has a length and an area (got {pipe_length!r} m, {pipe_area!r} m^2)")
    k1, k2 = (exponent * pressure * area**2 / v for v in (volume, reservoir))
    density = pressure / (GAS_CONSTANT * temperature)
    return AirSpring(
        k1=k1,
        k2=k2,
        k3=(pressure - AMBIENT) * area_rate,
        b=density * pipe_length * area**2 / pipe_area if pipe_length else 0.0,
        ke=k1 * k2 / (k1 + k2) + (pressure - AMBIENT) * area_rate,
        kv=k1**2 / (k1 + k2),
        share=(k1 / (k1 + k2)) ** 2,
    )
