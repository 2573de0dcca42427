"""What is read off a vehicle: where, of what, and its derivative by time."""

from __future__ import annotations

from dataclasses import dataclass

from freqrail.model.system import Row


@dataclass(frozen=True)
class Displacement:
    """A row times q, m or rad."""

    row: Row


@dataclass(frozen=True)
class Elongation:
    """The elongation of a leg by name, m; of a wheel, wheel minus track."""

    of: str


@dataclass(frozen=True)
class Force:
    """The force of a leg or of a wheel's contact by name, N, positive in extension."""

    of: str


Tap = Displacement | Elongation | Force


@dataclass(frozen=True)
class Output:
    """A response: its name, SI unit, and a tap for each label of its dimension ("" for one without).

    derivative: 0 of what the taps read, 1 its rate, 2 its acceleration.
    """

    name: str
    unit: str
    dimension: str
    taps: tuple[tuple[str, Tap], ...]
    derivative: int = 0
