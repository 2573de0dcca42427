"""The vehicles of `plain_vehicles` with the words that modes are named by."""

from __future__ import annotations

import re
from dataclasses import replace

from freqrail.model.system import Freedom, System
from tests.plain_vehicles import Plain, as_system

_KINDS = {"c": ("car", ""), "front": ("bogie", "front"), "rear": ("bogie", "rear")}


def worded(plain: Plain) -> System:
    """The system of a plain vehicle, its freedoms and legs with words."""
    system = as_system(plain)
    legs = tuple(replace(leg, inside=_inside(leg.name)) for leg in system.legs)
    return replace(system, freedoms=tuple(map(_freedom, system.freedoms)), legs=legs)


def _freedom(freedom: Freedom) -> Freedom:
    prefix, rest = re.fullmatch(r"((?:[ab]_(?=[zbm]))?)(.*)", freedom.name).groups()
    if rest.startswith("mode"):
        return replace(freedom, body=f"{prefix}car", kind="car", motion="bending")
    motion, _, where = rest.partition("_")
    motion = {"z": "bounce", "b": "pitch"}[motion]
    if where.startswith("w"):
        return replace(freedom, body=f"{prefix}{where}", kind="wheelset", motion=motion)
    kind, end = _KINDS[where]
    return replace(freedom, body=f"{prefix}{kind}_{end}".rstrip("_"), kind=kind, motion=motion)


def _inside(leg: str) -> str:
    stage = next((stage for stage in ("secondary", "primary") if stage in leg), "")
    return f"{stage} damper joints" if stage else ""
