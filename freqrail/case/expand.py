"""A case written out in the free form: every body, wheel and suspension by name, as `freqrail show CASE --expand`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from freqrail.case.axis import Axis
from freqrail.case.case import Case, share
from freqrail.case.file import parse_toml, to_toml
from freqrail.case.free_tables import liked
from freqrail.case.parameters import PARAMETERS

_ENDS = {"front": "half_bogie_spacing", "rear": "-half_bogie_spacing"}
_AXLES = {
    "axle_1": ("bogie_front", "half_bogie_spacing + half_wheelbase"),
    "axle_2": ("bogie_front", "half_bogie_spacing - half_wheelbase"),
    "axle_3": ("bogie_rear", "-half_bogie_spacing + half_wheelbase"),
    "axle_4": ("bogie_rear", "-half_bogie_spacing - half_wheelbase"),
}


def expanded(case: Case) -> str:
    """TOML text of a case in the free form, with the values that its settings and axes gave it.

    The half vehicle's quantities become parameters of the same names, those of both sides halved, for the free form
    describes one side. Suspensions that are like others are written out.
    """
    tables = parse_toml(case.effective, case.name)
    if not case.is_half_vehicle:
        suspensions = tables.get("suspensions", {})
        tables["suspensions"] = {name: liked(suspensions, table) for name, table in suspensions.items()}
        return to_toml(tables)
    own = _half_vehicle(case)
    head: dict[str, Any] = {
        "schema_version": 2,
        **{key: tables[key] for key in ("title", "reference") if key in tables},
    }
    rest = {key: table for key, table in tables.items() if key not in ("vehicle", "schema_version", *head)}
    if case.masses == "whole":
        rest |= _halved(case, rest)
    variants = {"variants": rest.pop("variants")} if "variants" in rest else {"variants": _variants(case)}
    return to_toml(head | own | variants | rest)


def _half_vehicle(case: Case) -> dict[str, Any]:
    """The tables of the half vehicle; its quantities as parameters."""
    names = [name for name in case.quantities if PARAMETERS[name].section == "vehicle"]
    contact = "contact_constant" if "contact_constant" in names else "contact_stiffness"
    if "contact_stiffness" in case.varied:
        contact = "contact_stiffness"

    def leg(stage: str, upper: str, lower: str, position: str) -> dict[str, Any]:
        letters = {"k": "stiffness", "c": "damping", "K": "joint_stiffness"}
        return {
            "between": [upper, lower],
            "position": position,
            "law": "k | (K - c - K)",
            **{letter: f"{stage}_{word}" for letter, word in letters.items()},
        }

    parameters = {name: _text(case, name) for name in names if not (name == "contact_constant" != contact)}
    if contact not in parameters:  # swept, where the case gives the constant
        parameters[contact] = case.scalars[contact].text
    return {
        "parameters": parameters,
        "bodies": {
            "car": {"mass": "car_body_mass", "pitch_inertia": "car_body_pitch_inertia", "position": "0 m"},
            **{
                f"bogie_{end}": {"mass": "bogie_mass", "pitch_inertia": "bogie_pitch_inertia", "position": position}
                for end, position in _ENDS.items()
            },
        },
        "wheels": {
            name: {"mass": "wheelset_mass", "position": position, contact: contact}
            for name, (_, position) in _AXLES.items()
        },
        "suspensions": {
            **{
                f"secondary_{end}": leg("secondary", "car", f"bogie_{end}", position) for end, position in _ENDS.items()
            },
            **{
                name.replace("axle", "primary"): leg("primary", bogie, name, position)
                for name, (bogie, position) in _AXLES.items()
            },
        },
    }


def _text(case: Case, name: str) -> str:
    """A quantity of one side as text."""
    quantity = case.quantities[name]
    if share(name, case.masses) == 1.0:
        return quantity.text
    return "inf" if quantity.value == float("inf") else f"{quantity.value / 2!r} {PARAMETERS[name].unit}"


def _halved(case: Case, tables: Mapping[str, Any]) -> dict[str, Any]:
    """The axes, samples and points of a whole vehicle as those of one side."""
    found: dict[str, Any] = {}
    sampled = case.samples.columns if case.samples else ()
    for table, axes in (("sweep", case.axes), ("samples", sampled)):
        if table in tables:
            halves = {axis.name: _axis_text(axis) for axis in axes if share(axis.name, case.masses) != 1.0}
            found[table] = {**tables[table], **halves}
    if "confirm" in tables and "points" in tables["confirm"]:
        points = [
            {
                name: quantity.text
                if share(name, case.masses) == 1.0 or quantity.value == float("inf")
                else f"{quantity.value / 2!r} {PARAMETERS[name].unit}"
                for name, quantity in point.items()
            }
            for point in case.points
        ]
        found["confirm"] = {**tables["confirm"], "points": points}
    return found


def _axis_text(axis: Axis) -> str:
    values = ", ".join("inf" if value == float("inf") else repr(float(value) / 2) for value in axis.si)
    return f"{values} {PARAMETERS[axis.name].unit}"


def _variants(case: Case) -> dict[str, Any]:
    return {
        variant.name: {
            name: "inf" if value == float("inf") else f"{value!r} {PARAMETERS[name].unit}"
            for name, value in variant.values.items()
        }
        for variant in case.variants
    }
