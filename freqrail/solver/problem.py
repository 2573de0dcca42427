"""A grid of vehicles and speeds as numbers, and how it is cut into parts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqrail.model.band import Band, band_limits
from freqrail.model.responses import chains_of
from freqrail.model.spectrum import Spectrum, kinks
from freqrail.model.vehicle import Vehicle


@dataclass(frozen=True)
class Problem:
    """A grid of vehicles, speeds and the track below them, numbers only.

    vehicle: fields are floats or arrays that broadcast to the grid of vehicles. speed: [m] in m/s.
    band None: the whole axis. names: keys of `model.responses`.
    """

    vehicle: Vehicle
    speed: NDArray[np.float64]
    spectrum: Spectrum
    band: Band | None
    names: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape [grid..., speeds]."""
        return (*self.vehicle.shape, self.speed.size)

    @property
    def points(self) -> int:
        """Number of grid points."""
        return math.prod(self.shape)

    @property
    def chains(self) -> tuple[str, ...]:
        """The chains that its responses take part in: what happens in another is nothing to them."""
        return chains_of(self.names)

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


def cells_by_geometry(vehicle: Vehicle, most: int) -> Iterator[tuple[tuple[int, ...], list[tuple[slice, ...]]]]:
    """The grid cut into blocks: (index of a vehicle with the geometry, its blocks), geometry by geometry.

    A block holds at most `most` vehicles of one L_c and L_t, because the lags are common to it; it is never cut
    along speed, so that the matrix product of every row is the same whatever the cut.
    """
    shape = vehicle.shape
    fixed = [_geometry_varies(vehicle, axis) for axis in range(len(shape))]
    inside = cells(tuple(1 if f else n for n, f in zip(shape, fixed, strict=True)), most)
    for geometry in np.ndindex(*(n if f else 1 for n, f in zip(shape, fixed, strict=True))):
        yield (
            geometry,
            [
                tuple(slice(g, g + 1) if f else s for g, f, s in zip(geometry, fixed, cell, strict=True))
                for cell in inside
            ],
        )


def _geometry_varies(vehicle: Vehicle, axis: int) -> bool:
    """Whether the lags' geometry changes along a grid axis."""
    behind = len(vehicle.shape) - axis
    shapes = (np.shape(vehicle.half_bogie_spacing), np.shape(vehicle.half_wheelbase))
    return any(len(shape) >= behind and shape[-behind] > 1 for shape in shapes)


def cut(vehicle: Vehicle, cell: tuple[slice | NDArray[np.intp], ...]) -> Vehicle:
    """The part of a grid of vehicles inside `cell`; a field stays whole along axes where it has length 1."""

    def part(field: object) -> object:
        array = np.asarray(field)
        if array.ndim == 0:
            return field
        array = array.reshape((1,) * (len(cell) - array.ndim) + array.shape)
        for axis, some in enumerate(cell):
            if array.shape[axis] > 1:
                array = array[(slice(None),) * axis + (some,)]
        return array

    return vehicle.map(part)
