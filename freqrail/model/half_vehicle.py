"""The paper's half vehicle as a template: a `System` with the names of the case file's [vehicle] table.

Car body, two bogie frames and four wheelsets with ten freedoms, six legs, each a spring beside a damper between two
rubber joints (eqs. 3 to 7, the signs of eq. 4 corrected), and four contact springs. Front and rear are alike because
they share names; give a leg names of its own, and it may differ.
"""

from __future__ import annotations

from collections.abc import Mapping

from freqrail.model.elements import Dashpot, Law, Parallel, Series, Spring
from freqrail.model.outputs import Displacement, Elongation, Output, Tap
from freqrail.model.stations import Body
from freqrail.model.system import Freedom, Leg, Row, System, Wheel
from freqrail.model.vehicle import Vehicle
from freqrail.types import Number

FREEDOMS = (
    Freedom("z_c", "car_body_mass", "car", "car", "bounce"),
    Freedom("beta_c", "car_body_pitch_inertia", "car", "car", "pitch"),
    Freedom("z_t1", "bogie_mass", "bogie_1", "bogie", "bounce"),
    Freedom("beta_t1", "bogie_pitch_inertia", "bogie_1", "bogie", "pitch"),
    Freedom("z_w1", "wheelset_mass", "wheelset_1", "wheelset", "bounce"),
    Freedom("z_w2", "wheelset_mass", "wheelset_2", "wheelset", "bounce"),
    Freedom("z_t2", "bogie_mass", "bogie_2", "bogie", "bounce"),
    Freedom("beta_t2", "bogie_pitch_inertia", "bogie_2", "bogie", "pitch"),
    Freedom("z_w3", "wheelset_mass", "wheelset_3", "wheelset", "bounce"),
    Freedom("z_w4", "wheelset_mass", "wheelset_4", "wheelset", "bounce"),
)
"""The order of q, as in the paper's state vector below eq. (9)."""

_A, _B = "half_bogie_spacing", "half_wheelbase"
_FRONT, _REAR = {_A: -1.0}, {_A: 1.0}
_LEADING, _TRAILING = {_B: -1.0}, {_B: 1.0}
_PLACES = ({_A: 1.0, _B: 1.0}, {_A: 1.0, _B: -1.0}, {_A: -1.0, _B: 1.0}, {_A: -1.0, _B: -1.0})


BODIES: Mapping[str, Body] = {
    "car": Body("car", {}, "z_c", "beta_c"),
    "bogie_front": Body("bogie_front", {_A: 1.0}, "z_t1", "beta_t1"),
    "bogie_rear": Body("bogie_rear", {_A: -1.0}, "z_t2", "beta_t2"),
    **{f"axle_{k + 1}": Body(f"axle_{k + 1}", place, f"z_w{k + 1}") for k, place in enumerate(_PLACES)},
}
"""The bodies by the names that outputs, and the vehicle written out in the free form, call them."""

SUSPENSIONS = {
    "secondary_front": "secondary_1",
    "secondary_rear": "secondary_2",
    **{f"primary_{k}": f"primary_{k}" for k in (1, 2, 3, 4)},
}
"""The legs' names by those that outputs call them."""


def leg_law(stiffness: str, damping: str, joint_stiffness: str) -> Law:
    """The law of the paper's leg, k | (K - c - K), of the parameters named."""
    damper = Series((Spring(joint_stiffness), Dashpot(damping), Spring(joint_stiffness)))
    return Parallel((Spring(stiffness), damper))


def half_vehicle() -> System:
    """Ten freedoms, six legs (secondary front, rear, primary 1 to 4) and four wheels."""
    secondary, primary = (
        leg_law(f"{stage}_stiffness", f"{stage}_damping", f"{stage}_joint_stiffness")
        for stage in ("secondary", "primary")
    )
    rows: dict[str, tuple[Row, Law]] = {
        "secondary_1": ({"z_c": 1.0, "beta_c": _FRONT, "z_t1": -1.0}, secondary),
        "secondary_2": ({"z_c": 1.0, "beta_c": _REAR, "z_t2": -1.0}, secondary),
        "primary_1": ({"z_t1": 1.0, "beta_t1": _LEADING, "z_w1": -1.0}, primary),
        "primary_2": ({"z_t1": 1.0, "beta_t1": _TRAILING, "z_w2": -1.0}, primary),
        "primary_3": ({"z_t2": 1.0, "beta_t2": _LEADING, "z_w3": -1.0}, primary),
        "primary_4": ({"z_t2": 1.0, "beta_t2": _TRAILING, "z_w4": -1.0}, primary),
    }
    return System(
        freedoms=FREEDOMS,
        legs=tuple(Leg(name, row, law, f"{name.partition('_')[0]} damper joints") for name, (row, law) in rows.items()),
        wheels=tuple(
            Wheel(f"axle_{k + 1}", {f"z_w{k + 1}": 1.0}, Spring("contact_stiffness"), place)
            for k, place in enumerate(_PLACES)
        ),
    )


def values_of(vehicle: Vehicle) -> dict[str, Number]:
    """The numbers of a vehicle, or of a grid of vehicles, by the names that the template has."""
    return dict(vars(vehicle))


def outputs() -> tuple[Output, ...]:
    """The seven responses of the paper's vehicle."""

    def displaced(**rows: Row) -> tuple[tuple[str, Tap], ...]:
        return tuple((label.lstrip("_"), Displacement(row)) for label, row in rows.items())

    bogies, axles = ("front", "rear"), ("1", "2", "3", "4")
    acceleration, angular = "m s-2", "rad s-2"
    return (
        Output(
            "car_body_acceleration",
            acceleration,
            "car_position",
            displaced(front={"z_c": 1.0, "beta_c": _FRONT}, centre={"z_c": 1.0}, rear={"z_c": 1.0, "beta_c": _REAR}),
            2,
        ),
        Output("bogie_acceleration", acceleration, "bogie", displaced(front={"z_t1": 1.0}, rear={"z_t2": 1.0}), 2),
        Output(
            "secondary_stroke",
            "m",
            "bogie",
            tuple((label, Elongation(f"secondary_{k + 1}")) for k, label in enumerate(bogies)),
        ),
        Output("primary_stroke", "m", "axle", tuple((label, Elongation(f"primary_{label}")) for label in axles)),
        Output(
            "wheelset_acceleration",
            acceleration,
            "axle",
            displaced(**{f"_{label}": {f"z_w{label}": 1.0} for label in axles}),
            2,
        ),
        Output("car_body_pitch_acceleration", angular, "", (("", Displacement({"beta_c": 1.0})),), 2),
        Output(
            "bogie_pitch_acceleration",
            angular,
            "bogie",
            displaced(front={"beta_t1": 1.0}, rear={"beta_t2": 1.0}),
            2,
        ),
    )
