"""What is read off any vehicle: the responses that each has, and the quantities that an output may name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from freqrail.model.derived import Derived
from freqrail.model.outputs import Displacement, Elongation, Force, Output, Tap
from freqrail.model.responses import Dimension, Response, Vocabulary
from freqrail.model.stations import Body, displacement
from freqrail.model.system import Row


@dataclass(frozen=True)
class Quantity:
    """A quantity that an output may name.

    of: whose it is, "body", "suspension" or "wheel". unit: SI. symbol: mathtext. derivative: by time, of what is read.
    """

    of: str
    unit: str
    symbol: str
    words: str
    derivative: int = 0


QUANTITIES: Mapping[str, Quantity] = {
    "displacement": Quantity("body", "m", "z", "vertical displacement"),
    "velocity": Quantity("body", "m s-1", "\\dot{z}", "vertical velocity", 1),
    "acceleration": Quantity("body", "m s-2", "\\ddot{z}", "vertical acceleration", 2),
    "pitch_acceleration": Quantity("body", "rad s-2", "\\ddot{\\beta}", "pitch acceleration", 2),
    "stroke": Quantity("suspension", "m", "e", "stroke"),
    "stroke_velocity": Quantity("suspension", "m s-1", "\\dot{e}", "stroke velocity", 1),
    "force": Quantity("suspension", "N", "F", "force"),
    "contact_force": Quantity("wheel", "N", "P", "dynamic wheel-rail force"),
}
"""By name. One more is one more entry here, and, if it reads something new, a tap of `outputs`."""

ALWAYS = {
    "body_acceleration": ("body", "acceleration", "body vertical acceleration, at its position"),
    "body_pitch_acceleration": ("body", "pitch_acceleration", "body pitch acceleration"),
    "stroke": ("suspension", "stroke", "suspension vertical stroke"),
    "suspension_force": ("suspension", "force", "suspension force"),
    "contact_force": ("wheel", "contact_force", "dynamic wheel-rail force"),
}
"""Responses that every vehicle of the free form has: (dimension, quantity, words)."""

_WORDS = {
    "body": "body, as the case names it",
    "suspension": "suspension, as the case names it",
    "wheel": "wheel, front to rear",
}


@dataclass(frozen=True)
class Readings:
    """What is read off a vehicle: outputs for the kernel, their vocabulary, and numbers that they need besides."""

    outputs: tuple[Output, ...]
    vocabulary: Vocabulary
    derived: tuple[Derived, ...] = ()


def tap_of(quantity: str, of: str, body: Body | None, row: Row | None) -> Tap:
    """How a quantity is read. of: name of the leg or wheel; row: of a body's station."""
    kind = QUANTITIES[quantity]
    if quantity == "pitch_acceleration":
        assert body
        return Displacement({body.pitch: 1.0} if body.pitch else {})
    if kind.of == "body":
        return Displacement(row or {})
    return Force(of) if kind.unit == "N" else Elongation(of)


def usual_readings(bodies: Mapping[str, Body], suspensions: Sequence[str], wheels: Sequence[str]) -> Readings:
    """The responses that every vehicle has: of its bodies, vertical suspensions and wheels, as a case names them."""
    own = {name: body for name, body in bodies.items() if name not in wheels}
    labels = {"body": tuple(own), "suspension": tuple(suspensions), "wheel": tuple(wheels)}
    dimensions = {name: Dimension(_WORDS[name], some, some) for name, some in labels.items() if some}
    outputs: list[Output] = []
    responses: dict[str, Response] = {}
    derived: dict[str, Derived] = {}
    for name, (dimension, quantity, words) in ALWAYS.items():
        kind = QUANTITIES[quantity]
        some = labels[dimension]
        if quantity == "pitch_acceleration" and not any(body.pitch for body in own.values()):
            continue
        taps = []
        for label in some:
            row, needed = displacement(own[label], own[label].place) if dimension == "body" else (None, ())
            derived |= {each.name: each for each in needed}
            taps.append((label, tap_of(quantity, label, own.get(label), row)))
        if taps:
            outputs.append(Output(name, kind.unit, dimension, tuple(taps), kind.derivative))
            responses[name] = Response(name, kind.symbol, kind.unit, dimension, words, some)
    return Readings(tuple(outputs), Vocabulary(responses, dimensions), tuple(derived.values()))


def joined(readings: Iterable[Readings]) -> Readings:
    """Several readings as one."""
    outputs: tuple[Output, ...] = ()
    responses: dict[str, Response] = {}
    dimensions: dict[str, Dimension] = {}
    derived: dict[str, Derived] = {}
    for each in readings:
        outputs += each.outputs
        responses |= each.vocabulary.responses
        dimensions |= each.vocabulary.dimensions
        derived |= {one.name: one for one in each.derived}
    return Readings(outputs, Vocabulary(responses, dimensions), tuple(derived.values()))
