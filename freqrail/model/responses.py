"""What responses are called, in which unit and where they are read off: one table a kind of vehicle.

Variables of results, labels, figures and tables of text, and the kernel all read from a `Vocabulary`. Units are
written as UDUNITS parses them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

Labels = tuple[str, ...] | tuple[int, ...]


@dataclass(frozen=True)
class Dimension:
    """Along which responses are resolved: what it is, its labels, and the words for each of them."""

    long_name: str
    labels: Labels
    words: tuple[str, ...]

    def place(self, label: object) -> str:
        """The words for a label, such as "front bogie"; a label that is none of the table's is its own words."""
        return dict(zip(map(str, self.labels), self.words, strict=True)).get(str(label), str(label))


SHOWN_UNITS: Mapping[str, tuple[str, float]] = {
    "m s-2": ("m/s²", 1.0),
    "rad s-2": ("rad/s²", 1.0),
    "m s-1": ("m/s", 1.0),
    "m": ("mm", 1e3),
    "rad": ("mrad", 1e3),
    "N": ("kN", 1e-3),
    "N m": ("kN·m", 1e-3),
    "W": ("W", 1.0),
    "1": ("", 1.0),
}
"""By SI unit, in which unit people read it, and the value in SI times what gives that."""


@dataclass(frozen=True)
class Response:
    """A response that is computed: its variables are NAME_rms, NAME_psd and their twins (see `variants`).

    symbol: mathtext. unit: SI. dimension: along which it is resolved, "" for a single value; positions: its labels
    there, () for a single value. paper: whether it is one of those that are computed unless others are asked for; of
    the half vehicle, the four that the paper reports.
    """

    name: str
    symbol: str
    unit: str
    dimension: str
    long_name: str
    positions: Labels = ()
    paper: bool = True

    @property
    def shown_unit(self) -> str:
        """Of figures and tables."""
        return SHOWN_UNITS[self.unit][0]

    @property
    def shown_scale(self) -> float:
        """The value in SI times this is in the shown unit."""
        return SHOWN_UNITS[self.unit][1]

    @property
    def psd_unit(self) -> str:
        """Unit of the one-sided PSD, as UDUNITS and pint parse it: "m2 s-4 Hz-1" for "m s-2"."""
        factors = [re.fullmatch(r"([A-Za-z]+)(-?\d*)", part) for part in self.unit.split() if part != "1"]
        squared = [f"{factor[1]}{2 * int(factor[2] or 1)}" for factor in factors if factor]
        return " ".join([*squared, "Hz-1"])


@dataclass(frozen=True)
class Vocabulary:
    """The responses of a vehicle by name, in the order in which they are stored and printed, and their dimensions."""

    responses: Mapping[str, Response] = field(default_factory=dict)
    dimensions: Mapping[str, Dimension] = field(default_factory=dict)

    def place(self, name: str) -> tuple[str, ...]:
        """The dimension of a response as one of none or one."""
        dimension = self.responses[name].dimension
        return (dimension,) if dimension else ()

    def series_count(self, names: Iterable[str]) -> int:
        """How many series the named responses are, one a position."""
        return sum(max(1, len(self.responses[name].positions)) for name in names)


DIMENSIONS: dict[str, Dimension] = {
    "car_position": Dimension(
        "where on the car body: over the front pivot (z_c - L_c beta_c), at the centre, over the rear pivot",
        ("front", "centre", "rear"),
        ("over the front pivot", "at the centre", "over the rear pivot"),
    ),
    "bogie": Dimension("bogie, at the centre of its frame", ("front", "rear"), ("front bogie", "rear bogie")),
    "axle": Dimension("axle, counted from the front", (1, 2, 3, 4), ("axle 1", "axle 2", "axle 3", "axle 4")),
}
"""Dimensions along which the half vehicle's responses are resolved, by name."""


def _half(name: str, symbol: str, unit: str, dimension: str, long_name: str, paper: bool = True) -> Response:
    return Response(name, symbol, unit, dimension, long_name, DIMENSIONS[dimension].labels if dimension else (), paper)


RESPONSES: dict[str, Response] = {
    r.name: r
    for r in (
        _half("car_body_acceleration", "\\ddot{z}_c", "m s-2", "car_position", "car body vertical acceleration"),
        _half("bogie_acceleration", "\\ddot{z}_t", "m s-2", "bogie", "bogie frame vertical acceleration"),
        _half("secondary_stroke", "e_s", "m", "bogie", "secondary suspension vertical stroke"),
        _half("primary_stroke", "e_p", "m", "axle", "primary suspension vertical stroke"),
        _half("wheelset_acceleration", "\\ddot{z}_w", "m s-2", "axle", "wheelset vertical acceleration", False),
        _half("car_body_pitch_acceleration", "\\ddot{\\beta}_c", "rad s-2", "", "car body pitch acceleration", False),
        _half(
            "bogie_pitch_acceleration", "\\ddot{\\beta}_t", "rad s-2", "bogie", "bogie frame pitch acceleration", False
        ),
    )
}
"""The half vehicle's responses by name."""

HALF_VEHICLE = Vocabulary(RESPONSES, DIMENSIONS)
"""Of the paper's vehicle."""

PAPER = tuple(name for name, response in RESPONSES.items() if response.paper)
"""The paper's four responses, eleven series in all."""


def series_count(names: tuple[str, ...]) -> int:
    """How many series the named responses of the half vehicle are, one a position."""
    return HALF_VEHICLE.series_count(names)
