"""A grid of vehicles and speeds as numbers, and how it is cut into parts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.model.band import Band, band_limits
from freqrail.model.elements import Values
from freqrail.model.half_vehicle import half_vehicle, outputs, values_of
from freqrail.model.outputs import Output
from freqrail.model.spectrum import Spectrum, kinks
from freqrail.model.system import System, coefficients
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import Reduction, reduce


@dataclass(frozen=True)
class Problem:
    """A grid of vehicles, speeds and the track below them, numbers only.

    reduction: of the vehicle, for every vehicle of the grid that this one is or is a part of. values: by parameter,
    floats or arrays that broadcast to the grid of vehicles. speed: [m] in m/s. band None: the whole axis.
    """

    reduction: Reduction
    values: Values
    speed: NDArray[np.float64]
    spectrum: Spectrum
    band: Band | None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the outputs."""
        return tuple(output.name for output in self.reduction.outputs)

    @property
    def vehicles(self) -> tuple[int, ...]:
        """Shape of the grid of vehicles; () for a single one."""
        return np.broadcast_shapes(*(np.shape(v) for v in self.values.values()))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape [grid..., speeds]."""
        return (*self.vehicles, self.speed.size)

    @property
    def points(self) -> int:
        """Number of grid points."""
        return math.prod(self.shape)

    @property
    def limits(self) -> NDArray[np.float64]:
        """The band at every speed, rad/s: [2, speeds]; no wider than what a tabulated spectrum covers."""
        low, high = np.zeros_like(self.speed), np.full_like(self.speed, np.inf)
        if self.band is not None:
            low, high = band_limits(self.band, self.speed)
        points = kinks(self.spectrum, self.speed)
        if points.size:
            low, high = np.maximum(low, points[0]), np.minimum(high, points[-1])
        return np.array([low, np.maximum(low, high)])

    def cut(self, cell: tuple[slice | NDArray[np.intp], ...]) -> Problem:
        """The vehicles inside `cell`; a value stays whole along axes where it has length 1."""

        def part(value: Any) -> Any:
            array = np.asarray(value)
            if array.ndim == 0:
                return value
            array = array.reshape((1,) * (len(cell) - array.ndim) + array.shape)
            for axis, some in enumerate(cell):
                if array.shape[axis] > 1:
                    array = array[(slice(None),) * axis + (some,)]
            return array

        return replace(self, values={name: part(value) for name, value in self.values.items()})

    def at(self, index: tuple[int, ...]) -> Problem:
        """The single vehicle at an index of the grid, its values floats."""
        shape = self.vehicles
        return replace(self, values={k: float(np.broadcast_to(v, shape)[index]) for k, v in self.values.items()})

    def only(self, names: tuple[str, ...]) -> Problem:
        """Some of the outputs."""
        return replace(self, reduction=self.reduction.only(names))


def problem_of(
    system: System,
    outputs: tuple[Output, ...],
    values: Values,
    speed: NDArray[np.float64],
    spectrum: Spectrum,
    band: Band | None,
) -> Problem:
    """The problem of any vehicle. Raises ValueError for an output that reads what there is not."""
    own: Mapping[str, Any] = {name: values[name] for name in system.parameters}
    return Problem(reduce(system, outputs, own), own, speed, spectrum, band)


def half_vehicle_problem(
    vehicle: Vehicle, speed: NDArray[np.float64], spectrum: Spectrum, band: Band | None, names: tuple[str, ...]
) -> Problem:
    """The problem of the paper's half vehicle; names: of its responses."""
    return Problem(half_vehicle_reduction(names), values_of(vehicle), speed, spectrum, band)


@cache
def half_vehicle_reduction(names: tuple[str, ...]) -> Reduction:
    """The paper's half vehicle reduced for some of its responses, whatever its lengths."""
    known = {output.name: output for output in outputs()}
    return reduced_for_any_lengths(tuple(known[name] for name in names))


def reduced_for_any_lengths(wanted: tuple[Output, ...]) -> Reduction:
    """The paper's half vehicle reduced for some outputs, whatever its lengths."""
    system = half_vehicle()
    return reduce(system, wanted, {name: np.array([1.0, 2.0]) for name in system.lengths})


def cells(shape: tuple[int, ...], most: int) -> list[tuple[slice, ...]]:
    """A grid cut into blocks of at most `most` vehicles (but one at least), about as long along every axis.

    So whatever depends on some of the axes only is computed least often.
    """
    size = [1] * len(shape)
    while 2 * math.prod(size) <= most and any(s < n for s, n in zip(size, shape, strict=True)):
        shortest = min((axis for axis, n in enumerate(shape) if size[axis] < n), key=lambda axis: size[axis])
        size[shortest] *= 2
    size = [-(-n // -(-n // step)) for n, step in zip(shape, size, strict=True)]  # all about equally long
    starts = [range(0, n, step) for n, step in zip(shape, size, strict=True)]
    return [
        tuple(slice(s, min(s + step, n)) for s, step, n in zip(corner, size, shape, strict=True))
        for corner in itertools.product(*starts)
    ]


def cells_by_geometry(problem: Problem, most: int) -> Iterator[tuple[tuple[int, ...], list[tuple[slice, ...]]]]:
    """The grid cut into blocks: (index of a vehicle with the geometry, its blocks), geometry by geometry.

    A block holds at most `most` vehicles whose wheels stand alike, because the lags are common to it; it is never cut
    along speed, so that the matrix product of every row is the same whatever the cut.
    """
    shape = problem.vehicles
    fixed = [_geometry_varies(problem, axis) for axis in range(len(shape))]
    inside = cells(tuple(1 if f else n for n, f in zip(shape, fixed, strict=True)), most)
    for geometry in np.ndindex(*(n if f else 1 for n, f in zip(shape, fixed, strict=True))):
        yield (
            geometry,
            [
                tuple(slice(g, g + 1) if f else s for g, f, s in zip(geometry, fixed, cell, strict=True))
                for cell in inside
            ],
        )


def _geometry_varies(problem: Problem, axis: int) -> bool:
    """Whether the wheels' places change along a grid axis."""
    behind = len(problem.vehicles) - axis
    names = {name for wheel in problem.reduction.system.wheels for name in coefficients(wheel.place) if name}
    shapes = (np.shape(problem.values[name]) for name in names)
    return any(len(shape) >= behind and shape[-behind] > 1 for shape in shapes)
