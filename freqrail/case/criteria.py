"""What railway vehicles have: the usual range of what a case comes to, and what to look at outside it.

Every range takes in the vehicles that docs/conventions.md lists, with room to spare; each is narrow enough that the
usual slips leave it (tests/sweep/test_plausibility.py). A case may take another range for usual, under
its [accepted] table. `sweep.plausibility` measures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from freqrail.model.spectrum import GERMAN_WAVELENGTHS


@dataclass(frozen=True)
class Criterion:
    """A usual range. what: the quantity in words. unit: of the numbers, "" for a ratio. remedy: what to look at.

    right_below, right_above: vehicles that lie below or above the range and are right. sides: whether it tells masses
    of both sides from those of one. acceptable: the value beyond which there is nothing that a case could accept.
    """

    what: str
    unit: str
    usual: tuple[float, float]
    remedy: str
    right_below: str = ""
    right_above: str = ""
    sides: bool = False
    acceptable: float = math.inf


_ONE_STAGE = "bogies with one stage of springs (Y25 and other freight wagons)"

CRITERIA: dict[str, Criterion] = {
    "axle_load": Criterion("axle load", "t", (3.0, 42.0), "check the masses' units", sides=True),
    "car_body": Criterion("mass of the whole car body", "t", (3.0, 160.0), "check its unit (kg, t)", sides=True),
    "wheelset": Criterion(
        "mass of a whole wheelset",
        "t",
        (0.5, 2.4),
        "check its unit (kg, t)",
        right_above="wheelsets that carry nose-suspended motors are heavier",
        sides=True,
    ),
    "bogie_frame": Criterion(
        "mass of a whole bogie frame over its wheelbase",
        "kg/m",
        (500.0, 8000.0),
        "check the frame's unit (kg, t), and that half_wheelbase is half of it",
        sides=True,
    ),
    "radius_of_gyration": Criterion(
        "radius of gyration of the car body over half the pivot distance",
        "",
        (0.5, 1.6),
        "check car_body_pitch_inertia (ten times off in some published data sets) and that half_bogie_spacing is half",
    ),
    "bogie_radius_of_gyration": Criterion(
        "radius of gyration of a bogie frame over half its wheelbase",
        "",
        (0.4, 1.5),
        "check bogie_pitch_inertia and that half_wheelbase is half",
    ),
    "pivot_distance": Criterion(
        "distance between pivots", "m", (4.0, 21.5), "half_bogie_spacing is half of it: check that, and the unit"
    ),
    "wheelbase": Criterion(
        "wheelbase of a bogie", "m", (1.1, 3.6), "half_wheelbase is half of it: check that, and the unit"
    ),
    "car_bounce": Criterion(
        "natural frequency of the car's bounce",
        "Hz",
        (0.5, 3.0),
        "check the units of springs (N/m, kN/m) and masses",
        right_above=f"{_ONE_STAGE} have more, most of all empty ones",
    ),
    "car_pitch": Criterion(
        "natural frequency of the car's pitch",
        "Hz",
        (0.4, 3.0),
        "check car_body_pitch_inertia and half_bogie_spacing",
        right_above=f"{_ONE_STAGE} have more, most of all empty ones",
    ),
    "bogie_bounce": Criterion(
        "natural frequency of the bogies' bounce",
        "Hz",
        (3.5, 15.0),
        "check the units of springs (N/m, kN/m) and masses",
        right_above=f"{_ONE_STAGE} have more: the centre bowl stands for the secondary spring",
    ),
    "primary_over_secondary": Criterion(
        "stiffness of a bogie's two primary springs over that of its secondary one",
        "",
        (1.5, math.inf),
        "are primary_stiffness (an axle's) and secondary_stiffness (a bogie's) exchanged?",
        right_below=f"{_ONE_STAGE} have less: the centre bowl stands for the secondary spring",
    ),
    "primary_damping": Criterion(
        "damping ratio of a bogie frame on its primary dampers",
        "",
        (0.01, 5.0),
        "check the unit of primary_damping (N*s/m, kN*s/m); no damper at all is 0",
    ),
    "secondary_damping": Criterion(
        "damping ratio of the car body on its secondary dampers",
        "",
        (0.01, 5.0),
        "check the unit of secondary_damping (N*s/m, kN*s/m); no damper at all is 0",
    ),
    "secondary_over_primary_damping": Criterion(
        "damping of a bogie's secondary dampers over that of an axle's primary ones",
        "",
        (0.7, math.inf),
        "are primary_damping (an axle's) and secondary_damping (a bogie's) exchanged?",
        right_below="where air springs alone damp the second stage, less is usual",
    ),
    "contact": Criterion(
        "contact stiffness of a wheel and the rail", "GN/m", (0.3, 3.0), "check contact_constant or contact_stiffness"
    ),
    "track_height": Criterion(
        "standard deviation of the track's height over 3-25 m",
        "mm",
        (0.05, 10.0),
        "check the unit of roughness (cm^2*rad/m, m^2*rad/m)",
    ),
    "wavelengths": Criterion("wavelengths in the band", "m", GERMAN_WAVELENGTHS, ""),
    "wheelset_resonance": Criterion(
        "upper end of the band over the wheelsets' resonance on the rigid rail", "", (0.0, 0.7), ""
    ),
    "wheel_force": Criterion(
        "RMS of the dynamic force between wheel and rigid rail over the static wheel load",
        "",
        (0.0, 1 / 3),
        "three of them exceed the load: wheels leave the rail, which a linear model cannot say; check speed, roughness "
        "and band",
        acceptable=1.0,
    ),
}
"""Every criterion by the name that warnings bear and [accepted] takes."""
