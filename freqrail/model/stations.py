"""Where the bodies of a vehicle are along it, and how what they do moves a station of theirs.

The displacement of a body at a station x is z - (x - position) beta, as in the paper (front pivot z_c - L_c beta_c),
and what its bending modes add. Places are arms: sums of named lengths, m, forward positive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from freqrail.model.derived import BeamShape, Derived, TabulatedShape
from freqrail.model.elements import Values
from freqrail.model.system import Arm, Row, coefficients, evaluate

Place = Mapping[str, float]
"""A sum {length: factor} in m, "" for 1 m."""


@dataclass(frozen=True)
class BendingMode:
    """A bending mode: its freedom, its order from 1, and the name of the beam's length or the points of its shape."""

    freedom: str
    order: int
    length: str
    points: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def reach(self, values: Values) -> tuple[float, float]:
        """How far from the body's position its shape is known, m, to the rear and to the front; of one vehicle."""
        if self.points:
            return self.points[0][0], self.points[0][-1]
        half = float(values[self.length]) / 2
        return -half, half


@dataclass(frozen=True)
class Body:
    """A body or a wheel: its place, and the names of its freedoms; pitch "" if it does not."""

    name: str
    place: Place
    bounce: str
    pitch: str = ""
    modes: tuple[BendingMode, ...] = ()


def displacement(body: Body, station: Place) -> tuple[Row, tuple[Derived, ...]]:
    """What of q moves a body at a station, and the numbers that the row needs besides: the modes' deflections."""
    row: dict[str, Arm] = {body.bounce: 1.0}
    derived: list[Derived] = []
    arm = difference(station, body.place)
    if body.pitch and arm:
        row[body.pitch] = scaled(arm, -1.0)
    for mode in body.modes:
        # a beam's shape is its own mirror image: of two places as far from the middle, one is computed
        behind = not mode.points and bool(arm) and next(factor for _, factor in sorted(arm.items())) < 0
        place = {name: -factor if behind else factor for name, factor in arm.items()}
        words = " ".join(f"{factor:+g} {name}".strip() for name, factor in sorted(place.items())) or "0"
        name = f"{mode.freedom} at {words}"
        shape = TabulatedShape(name, place, *mode.points) if mode.points else None
        derived.append(shape or BeamShape(name, mode.order, place, mode.length))
        row[mode.freedom] = {name: -1.0} if behind and mode.order % 2 == 0 else name
    return row, tuple(derived)


def between(upper: Body, lower: Body, station: Place) -> tuple[Row, tuple[Derived, ...]]:
    """The elongation between two bodies at a station: upper end minus lower end."""
    (above, some), (below, others) = (displacement(body, station) for body in (upper, lower))
    return {**above, **{freedom: scaled(arm, -1.0) for freedom, arm in below.items()}}, (*some, *others)


def distance(body: Body, station: Place, values: Values) -> float:
    """How far a station lies before a body's position, m; of one vehicle."""
    return float(evaluate(dict(difference(station, body.place)), values))


def difference(one: Place, other: Place) -> dict[str, float]:
    """One place minus another."""
    result = dict(one)
    for name, factor in other.items():
        result[name] = result.get(name, 0.0) - factor
    return {name: factor for name, factor in result.items() if factor}


def scaled(arm: Arm, factor: float) -> Arm:
    """An arm times a number."""
    if factor == 1.0 or isinstance(arm, int | float):
        return arm if factor == 1.0 else float(arm) * factor  # type: ignore[arg-type]
    return {name: factor * own for name, own in coefficients(arm).items()}
