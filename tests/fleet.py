"""Published vehicles, whole: what warnings must leave alone, and what slips are made from. SI units.

Masses and inertias of the car body, a bogie frame, a wheelset; primary springs and dampers of an axle, secondary ones
of a bogie, both sides; half the distance between pivots, half the wheelbase. Sources: Iwnicki 1998 (Manchester
benchmark, vehicle 1); Goicolea 2014; Wu and Yang 2003; Antolin 2013; Zhai; Domenech 2014; the paper.
"""

from __future__ import annotations

from collections.abc import Mapping

UNITS = {
    "car_body_mass": "kg",
    "car_body_pitch_inertia": "kg*m^2",
    "bogie_mass": "kg",
    "bogie_pitch_inertia": "kg*m^2",
    "wheelset_mass": "kg",
    "primary_stiffness": "N/m",
    "primary_damping": "N*s/m",
    "secondary_stiffness": "N/m",
    "secondary_damping": "N*s/m",
    "half_bogie_spacing": "m",
    "half_wheelbase": "m",
}

_ROWS = {
    "Manchester benchmark": (32e3, 1.97e6, 2615, 1476, 1813, 2.44e6, 8e3, 860e3, 40e3, 9.5, 1.28),
    "Velaro E": (47.8e3, 1957888, 3500, 1715, 1800, 2.4e6, 20e3, 700e3, 40e3, 8.6875, 1.25),
    "Shinkansen 300": (41750, 2.08e6, 3040, 3930, 1780, 1.18e6, 39.2e3, 530e3, 90.2e3, 8.75, 1.25),
    "Pioneer trailer": (44e3, 2.74e6, 1700, 1700, 1900, 700e3, 38e3, 350e3, 40e3, 9.0, 1.25),
    "conventional coach": (40560, 2.966e6, 3175, 2710, 1900, 1.61e6, 40e3, 618e3, 80e3, 9.0, 1.25),
    "double-deck coach": (29600, 2.139e6, 1700, 1700, 1900, 1.746e6, 60e3, 820e3, 217.4e3, 9.0, 1.20),
    "high-speed coach": (34e3, 2.277e6, 3000, 2710, 1400, 1.1e6, 12e3, 800e3, 160e3, 9.0, 1.20),
    "China Star power car": (59364.2, 1.723e6, 5630.8, 9487, 1843.5, 4.7992e6, 60e3, 1.7716e6, 90e3, 5.73, 1.50),
    "Eurostar locomotive": (51.5e3, 1.05e6, 2200, 1900, 1700, 2.6e6, 12e3, 3.26e6, 90e3, 7.0, 1.50),
    "GZ18 metro": (30549, 1315247, 8900, 3419, 1834, 2.8e6, 20e3, 460e3, 40e3, 7.85, 1.25),
    "CRH380A": (40840, 1.666e6, 2280, 1249, 1901.8, 2.352e6, 20e3, 520e3, 80e3, 8.75, 1.25),
}

PAPER = dict(zip(UNITS, (30.4e3, 2.038e6, 1200, 1400, 1400, 1.75e6, 34e3, 824e3, 108e3, 3.289, 0.797), strict=True))
"""The paper's vehicle, whole. Its radius of gyration is 2.49 half pivot distances, which is warned of."""

FLEET: dict[str, dict[str, float]] = {name: dict(zip(UNITS, row, strict=True)) for name, row in _ROWS.items()}

_TYPICAL = {
    "tram": (10e3, 160e3, 1800, 585, 900, 4e6, 25e3, 600e3, 40e3, 3.2, 0.95),
    "locomotive": (50e3, 1.06e6, 9000, 10e3, 2900, 3e6, 60e3, 2.8e6, 100e3, 5.2, 1.4),
    "Y25 wagon, laden": (80.6e3, 1.16e6, 2200, 1000, 1250, 4e6, 60e3, 160e6, 0.0, 4.5, 0.9),
    "Y25 wagon, empty": (12.6e3, 182e3, 2200, 1000, 1250, 2e6, 30e3, 160e6, 0.0, 4.5, 0.9),
}

TYPICAL: dict[str, dict[str, float]] = {name: dict(zip(UNITS, row, strict=True)) for name, row in _TYPICAL.items()}
"""Right vehicles of other kinds, in typical numbers, of no one publication: a tram; a locomotive whose wheelsets carry
nose-suspended motors; wagons of 22.5 and 5.5 t an axle on bogies with one stage of springs, the centre bowl on top."""

LENGTHS = ("half_bogie_spacing", "half_wheelbase")


def half(vehicle: Mapping[str, float]) -> dict[str, float]:
    """One side of a whole vehicle."""
    return {name: value if name in LENGTHS else value / 2 for name, value in vehicle.items()}


def case_text(
    vehicle: Mapping[str, float], masses: str = "half", joints: str = "5 MN/m", contact: str = "5.1e-8 m/N^(2/3)"
) -> str:
    """A case file of a vehicle at 200 km/h over wavelengths of 1 to 120 m of the low German spectrum."""
    lines = [f'{name} = "{value!r} {UNITS[name]}"' for name, value in vehicle.items()]
    return "\n".join(
        [
            "schema_version = 1\n[vehicle]",
            f'masses = "{masses}"',
            *lines,
            f'primary_joint_stiffness = "{joints}"\nsecondary_joint_stiffness = "{joints}"',
            f'contact_constant = "{contact}"',
            '[track]\nspectrum = "german-low"\n[operation]\nspeed = "200 km/h"',
            '[band]\nwavelength = ["1 m", "120 m"]',
            "",
        ]
    )
