"""The one table of names: every parameter that users type and every response that they read.

Validation, dataset attributes, axis labels and `freqrail show` all read from here. Units are written
as users type them (and as UDUNITS parses them); `unit` is always the SI unit the code computes in.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """A quantity of the case file.

    symbol: as in the paper, for figures (mathtext). unit: SI. shown_unit: of the dataset's
    coordinate and of messages, None for the unit the user wrote. kind: what it is, for messages.
    lower: smallest accepted value, SI (excluded if `above`); upper: largest. infinite: whether inf
    is accepted. plausible: the range of all other values, SI, about a millionth of the smallest to a million times
    the largest that vehicles and tracks have: beyond it double precision cannot be relied on.
    """

    name: str
    section: str
    symbol: str
    unit: str
    kind: str
    example: str
    meaning: str
    lower: float = 0.0
    above: bool = True
    upper: float = math.inf
    infinite: bool = False
    shown_unit: str | None = None
    hint: str = ""
    plausible: tuple[float, float] = (0.0, math.inf)


SMALLEST_JOINT_STIFFNESS = 1.0  # N/m
FASTEST = 600 / 3.6  # m/s

_VEHICLE = (
    Parameter(
        "car_body_mass",
        "vehicle",
        "M_c",
        "kg",
        "mass",
        "15200 kg",
        "half of the car body's mass",
        plausible=(1e-2, 1e11),
    ),
    Parameter(
        "car_body_pitch_inertia",
        "vehicle",
        "J_c",
        "kg*m^2",
        "moment of inertia",
        "1019000 kg*m^2",
        "half of the car body's pitch moment of inertia",
        plausible=(1e-1, 1e13),
    ),
    Parameter(
        "bogie_mass",
        "vehicle",
        "M_t",
        "kg",
        "mass",
        "600 kg",
        "half of a bogie frame's mass",
        plausible=(1e-3, 1e10),
    ),
    Parameter(
        "bogie_pitch_inertia",
        "vehicle",
        "J_t",
        "kg*m^2",
        "moment of inertia",
        "700 kg*m^2",
        "half of a bogie frame's pitch moment of inertia",
        plausible=(1e-3, 1e10),
    ),
    Parameter(
        "wheelset_mass",
        "vehicle",
        "M_w",
        "kg",
        "mass",
        "700 kg",
        "half of a wheelset's mass",
        plausible=(1e-3, 1e10),
    ),
    Parameter(
        "primary_stiffness",
        "vehicle",
        "K_p",
        "N/m",
        "stiffness",
        "875 kN/m",
        "vertical stiffness of the primary suspension, one side of one axle",
        plausible=(1e-1, 1e13),
    ),
    Parameter(
        "primary_damping",
        "vehicle",
        "C_p",
        "N*s/m",
        "damping",
        "17 kN*s/m",
        "vertical damping of the primary suspension, one side of one axle",
        above=False,
        plausible=(1e-3, 1e11),
    ),
    Parameter(
        "primary_joint_stiffness",
        "vehicle",
        "K_{pd}",
        "N/m",
        "stiffness",
        "5 MN/m",
        "stiffness of each of the two rubber joints of a primary vertical damper",
        lower=SMALLEST_JOINT_STIFFNESS,
        above=False,
        infinite=True,
        shown_unit="MN/m",
        plausible=(SMALLEST_JOINT_STIFFNESS, 1e14),
    ),
    Parameter(
        "secondary_stiffness",
        "vehicle",
        "K_s",
        "N/m",
        "stiffness",
        "412 kN/m",
        "vertical stiffness of the secondary suspension, one side of one bogie",
        plausible=(1e-1, 1e13),
    ),
    Parameter(
        "secondary_damping",
        "vehicle",
        "C_s",
        "N*s/m",
        "damping",
        "54 kN*s/m",
        "vertical damping of the secondary suspension, one side of one bogie",
        above=False,
        plausible=(1e-3, 1e11),
    ),
    Parameter(
        "secondary_joint_stiffness",
        "vehicle",
        "K_{sd}",
        "N/m",
        "stiffness",
        "5 MN/m",
        "stiffness of each of the two rubber joints of a secondary vertical damper",
        lower=SMALLEST_JOINT_STIFFNESS,
        above=False,
        infinite=True,
        shown_unit="MN/m",
        plausible=(SMALLEST_JOINT_STIFFNESS, 1e14),
    ),
    Parameter(
        "half_bogie_spacing",
        "vehicle",
        "L_c",
        "m",
        "length",
        "3.289 m",
        "half of the distance between bogie pivots",
        plausible=(1e-6, 1e7),
    ),
    Parameter(
        "half_wheelbase",
        "vehicle",
        "L_t",
        "m",
        "length",
        "0.797 m",
        "half of a bogie's wheelbase",
        plausible=(1e-6, 1e7),
    ),
    Parameter(
        "contact_constant",
        "vehicle",
        "G",
        "m/N^(2/3)",
        "contact constant",
        "5.1824e-8 m/N^(2/3)",
        "Hertzian contact constant of wheel and rail",
        plausible=(1e-14, 1e-1),
    ),
    Parameter(
        "contact_stiffness",
        "vehicle",
        "K_H",
        "N/m",
        "stiffness",
        "1.0448 GN/m",
        "linear contact stiffness of wheel and rail",
        plausible=(1e2, 1e16),
    ),
)

_OTHERS = (
    Parameter(
        "roughness",
        "track",
        "A_v",
        "m^2*rad/m",
        "roughness coefficient",
        "4.032e-7 m^2*rad/m",
        "track roughness",
        plausible=(1e-14, 1e1),
    ),
    Parameter(
        "cutoffs",
        "track",
        "\\Omega",
        "rad/m",
        "wavenumber",
        "0.0206 rad/m",
        "cut-off wavenumbers of the track",
        plausible=(1e-9, 1e7),
    ),
    Parameter(
        "speed",
        "operation",
        "v",
        "m/s",
        "speed",
        "250 km/h",
        "running speed",
        upper=FASTEST,
        shown_unit="km/h",
        hint="speeds above 600 km/h are refused: is the unit right?",
        plausible=(1e-5 / 3.6, FASTEST),
    ),
    Parameter(
        "frequency",
        "band",
        "f",
        "Hz",
        "frequency",
        "0.1 Hz",
        "frequency",
        shown_unit="Hz",
        plausible=(1e-8, 1e10),
    ),
    Parameter(
        "wavelength",
        "band",
        "\\lambda",
        "m",
        "length",
        "1 m",
        "wavelength of the track irregularity",
        plausible=(1e-8, 1e9),
    ),
)

PARAMETERS: dict[str, Parameter] = {p.name: p for p in (*_VEHICLE, *_OTHERS)}
"""Every quantity by its name."""

SWEEPABLE: tuple[str, ...] = tuple(p.name for p in PARAMETERS.values() if p.section in ("vehicle", "operation"))
"""Names that may be an axis of a sweep, beside the `frequency` of stored spectra."""

VARIABLE: Mapping[str, Parameter] = {name: PARAMETERS[name] for name in SWEEPABLE}
"""The same with what they are: what may vary in a case of the half vehicle."""

JOINTS = ("primary_joint_stiffness", "secondary_joint_stiffness")
"""The stiffnesses of the dampers' rubber joints, inf for a rigid one."""

COMPLIANCES = {joint: joint.replace("stiffness", "compliance") for joint in JOINTS}
"""The reciprocal of a joint's stiffness, finite where the joint is rigid: a coordinate of results."""

COMPLIANCE_UNIT = "mm kN-1"  # so that the number is the reciprocal of that in MN/m


SHARED_BY_SIDES: tuple[str, ...] = tuple(
    p.name
    for p in _VEHICLE
    if p.kind in ("mass", "moment of inertia", "stiffness", "damping") and p.name != "contact_stiffness"
)
"""What both sides of a vehicle share: with `masses = "whole"` it is given for both, and the model takes half."""


def meaning(name: str, masses: str = "half") -> str:
    """What a quantity means where `masses` is "half" or "whole": a bogie frame's mass, or half of it."""
    words = PARAMETERS[name].meaning
    if masses == "half" or name not in SHARED_BY_SIDES:
        return words
    if words.startswith("half of "):
        return words.removeprefix("half of ")
    if ", one side of" in words:
        return words.replace(", one side of", ", both sides of")
    return f"{words}, both sides together"


# Words in the names of quantities that this model does not have, and what it has instead.
_BEYOND = {
    "front rear leading trailing first second": "front and rear are alike in this model",
    "left right": "the model is one rail's share: left and right are alike",
    "lateral yaw roll sway horizontal longitudinal traction": "the model moves vertically and pitches, no more",
    "bending flexible elastic torsional": "the bodies of this model are rigid",
    "rail sleeper ballast pad track": "the rail of this model is rigid",
    "friction nonlinear clearance bumpstop": "the model is linear",
}


def _beyond(name: str) -> str:
    parts = {"".join(c for c in part if c.isalpha()) for part in name.lower().split("_")}
    return next((why for words, why in _BEYOND.items() if parts & set(words.split())), "")


def nearest_name(name: str, known: Iterable[str]) -> str:
    """' (did you mean ...?)' with the nearest known name, or the list of names when none is near; "" of no names."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    if near:
        return f" (did you mean {near[0]}?)"
    return f" (known: {', '.join(known)})" if known else ""


def suggestion(name: str, known: Iterable[str]) -> str:
    """' (did you mean ...?)' with the nearest known name, or the list of names when none is near.

    Of a quantity that the model cannot have, such as front_secondary_damping, it says so.
    """
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    why = _beyond(name) if PARAMETERS.keys() & set(known) else ""
    if why:
        own = near and near[0] in PARAMETERS and set(near[0].split("_")) <= set(name.split("_"))
        instead = f"; {near[0]} is the one value it takes" if own else ""
        return f" ({why}{instead})"
    return nearest_name(name, known)
