"""The one table of responses: what each is called, in which unit and where, and how it is read off the vehicle.

Variables of results, labels, figures and tables of text, and the kernel all read from here. Units are written
as UDUNITS parses them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

CHAINS = ("bounce", "pitch", "bogie_pitch")
"""The half vehicle's families of motion, which exchange no energy if its legs are equal: blocks of its reduction."""

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


DIMENSIONS: dict[str, Dimension] = {
    "car_position": Dimension(
        "where on the car body: over the front pivot (z_c - L_c beta_c), at the centre, over the rear pivot",
        ("front", "centre", "rear"),
        ("over the front pivot", "at the centre", "over the rear pivot"),
    ),
    "bogie": Dimension("bogie, at the centre of its frame", ("front", "rear"), ("front bogie", "rear bogie")),
    "axle": Dimension("axle, counted from the front", (1, 2, 3, 4), ("axle 1", "axle 2", "axle 3", "axle 4")),
}
"""Dimensions along which responses are resolved, by name."""


@dataclass(frozen=True)
class Response:
    """A response that is computed: its variables are NAME_rms, NAME_psd and their twins (see `variants`).

    unit: SI. shown_unit and shown_scale: for figures and tables, the value in SI times the scale.
    dimension: along which it is resolved, "" for a single value. paper: whether it is one of the four that the paper
    reports.

    What they are in these families, which tests hold the blocks against: element, "car", "bogie", "wheelset"
    (displacements), "secondary" or "primary" (elongations); derivative: 2 for an acceleration, 0 for a stroke;
    chains: those that take part;
    signs: (sigma, rho) a label of the dimension, with sigma = +1 in front, 0 at the centre and -1 at the rear, rho = +1
    at the leading and -1 at the trailing axle of a bogie; arm: the length (a field of `Vehicle`) that turns the
    displacement over a leg into an angle, "" for none.
    """

    name: str
    symbol: str
    unit: str
    shown_unit: str
    shown_scale: float
    dimension: str
    long_name: str
    element: str
    derivative: int
    chains: tuple[str, ...]
    signs: tuple[tuple[int, int], ...]
    arm: str = ""
    paper: bool = True

    @property
    def positions(self) -> Labels:
        """The labels of its dimension, () for a single value."""
        return DIMENSIONS[self.dimension].labels if self.dimension else ()

    @property
    def psd_unit(self) -> str:
        """Unit of the one-sided PSD, as UDUNITS and pint parse it: "m2 s-4 Hz-1" for "m s-2"."""
        factors = [re.fullmatch(r"([A-Za-z]+)(-?\d*)", part) for part in self.unit.split()]
        squared = [f"{factor[1]}{2 * int(factor[2] or 1)}" for factor in factors if factor]
        return " ".join([*squared, "Hz-1"])


_ENDS = ((1, 0), (-1, 0))
_AXLES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
_VERTICAL = ("bounce", "pitch")

RESPONSES: dict[str, Response] = {
    r.name: r
    for r in (
        Response(
            "car_body_acceleration",
            "\\ddot{z}_c",
            "m s-2",
            "m/s²",
            1.0,
            "car_position",
            "car body vertical acceleration",
            "car",
            2,
            _VERTICAL,
            ((1, 0), (0, 0), (-1, 0)),
        ),
        Response(
            "bogie_acceleration",
            "\\ddot{z}_t",
            "m s-2",
            "m/s²",
            1.0,
            "bogie",
            "bogie frame vertical acceleration",
            "bogie",
            2,
            _VERTICAL,
            _ENDS,
        ),
        Response(
            "secondary_stroke",
            "e_s",
            "m",
            "mm",
            1e3,
            "bogie",
            "secondary suspension vertical stroke",
            "secondary",
            0,
            _VERTICAL,
            _ENDS,
        ),
        Response(
            "primary_stroke",
            "e_p",
            "m",
            "mm",
            1e3,
            "axle",
            "primary suspension vertical stroke",
            "primary",
            0,
            CHAINS,
            _AXLES,
        ),
        Response(
            "wheelset_acceleration",
            "\\ddot{z}_w",
            "m s-2",
            "m/s²",
            1.0,
            "axle",
            "wheelset vertical acceleration",
            "wheelset",
            2,
            CHAINS,
            _AXLES,
            paper=False,
        ),
        Response(
            "car_body_pitch_acceleration",
            "\\ddot{\\beta}_c",
            "rad s-2",
            "rad/s²",
            1.0,
            "",
            "car body pitch acceleration",
            "car",
            2,
            ("pitch",),
            ((1, 0),),
            "half_bogie_spacing",
            paper=False,
        ),
        Response(
            "bogie_pitch_acceleration",
            "\\ddot{\\beta}_t",
            "rad s-2",
            "rad/s²",
            1.0,
            "bogie",
            "bogie frame pitch acceleration",
            "bogie",
            2,
            ("bogie_pitch",),
            ((1, 1), (-1, 1)),
            "half_wheelbase",
            paper=False,
        ),
    )
}
"""Every response by its name, in the order they are stored and printed."""

PAPER = tuple(name for name, response in RESPONSES.items() if response.paper)
"""The paper's four responses, eleven series in all."""


def series_count(names: tuple[str, ...]) -> int:
    """How many series the named responses are, one a position."""
    return sum(len(RESPONSES[name].signs) for name in names)
