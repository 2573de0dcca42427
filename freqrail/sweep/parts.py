"""A sweep cut into blocks, each a part of the grid along every axis but speed, computed one by one.

The bits of a block do not depend on how the grid is cut, nor on where and in which order blocks are computed: the
quadrature nodes are those of the whole grid. So blocks can be kept in a journal, and sent to other machines.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.result import content, labels, layout
from freqrail.solver import solve
from freqrail.solver.panels import SharedPanels, shared_panels
from freqrail.solver.problem import cells
from freqrail.sweep.gradients import grid_gradients
from freqrail.sweep.plan import Plan
from freqrail.types import Progress

POINTS = 250_000
"""Most grid points of a block; with spectra, points times frequencies."""


@dataclass(frozen=True)
class Part:
    """A part of a model's grid. cell: along the axes of `Problem.vehicles`; place: along the swept parameters."""

    prefix: str
    cell: tuple[slice, ...]
    place: tuple[slice, ...]

    @property
    def key(self) -> str:
        """A name that tells the block from all others of the sweep."""
        return self.prefix + ",".join(f"{part.start}:{part.stop}" for part in self.cell)


def cut(plan: Plan) -> list[Part]:
    """All blocks of a sweep, in the order to compute them."""
    result = []
    for prefix, problem in plan.problems.items():
        lines = plan.layout.frequency.si.size if plan.layout.frequency is not None else 1
        lines *= 1 + 10 * len(plan.layout.gradients)  # a slope takes about ten times as long as the value
        swept = [axis.name for axis in plan.layout.axes(prefix)]
        for cell in cells(problem.vehicles, max(1, POINTS // (problem.speed.size * lines))):
            place = list(cell)
            if "speed" in swept:
                place.insert(swept.index("speed"), slice(0, problem.speed.size))
            result.append(Part(prefix, cell, tuple(place)))
    return result


def point_count(plan: Plan, block: Part) -> int:
    """Grid points that `progress` is told of while a block is computed."""
    inside = math.prod(part.stop - part.start for part in block.cell) * plan.problems[block.prefix].speed.size
    return inside * (2 if plan.layout.frequency is not None else 1)


def panels_of(plan: Plan) -> dict[str, tuple[SharedPanels, ...]]:
    """The quadrature nodes of all models' whole grids, for `compute`."""
    return {prefix: shared_panels(problem) for prefix, problem in plan.problems.items()}


def compute(
    plan: Plan,
    block: Part,
    shared: Mapping[str, tuple[SharedPanels, ...]],
    jobs: int = 1,
    progress: Progress = lambda points: None,
) -> dict[str, NDArray]:
    """The numbers of a block by variable, in the order of the variable's dimensions."""
    problem = plan.problems[block.prefix].cut(block.cell)
    solution = solve.solve(problem, jobs, progress, shared[block.prefix])
    spectra = solve.psd(problem, plan.layout.frequency.si, progress) if plan.layout.frequency is not None else None
    slopes = None
    if plan.layout.gradients:
        model = plan.layout.model(block.prefix)
        own = plan.layout.case.of(model)
        slopes = grid_gradients(own, plan.layout.names, plan.layout.gradients, block.cell, model.fixed)
    return labels.arrays(plan.layout, block.prefix, solution, spectra, slopes)


def pack(plan: Plan, block: Part, values: Mapping[str, NDArray]) -> bytes:
    """The numbers of a block as bytes, little-endian, in the order of `block_variables`."""
    return b"".join(
        np.ascontiguousarray(values[name], dtype=variable.dtype.newbyteorder("<")).tobytes()
        for name, variable in part_variables(plan, block).items()
    )


def unpack(plan: Plan, block: Part, data: bytes) -> dict[str, NDArray]:
    """The numbers of a block from `pack`. Raises ValueError if there are too few or too many."""
    result, start = {}, 0
    for name, variable in part_variables(plan, block).items():
        count = math.prod(variable.shape)
        little = variable.dtype.newbyteorder("<")
        result[name] = np.frombuffer(data, little, count, start).reshape(variable.shape)
        start += count * little.itemsize
    if start != len(data):
        raise ValueError(f"a block of {len(data)} bytes where {start} are expected")
    return result


def part_variables(plan: Plan, block: Part) -> dict[str, content.Variable]:
    """The variables that a block holds a part of, with the part's shape, in the order of the file."""
    size = tuple(part.stop - part.start for part in block.place)
    described = layout.variables_of(plan.layout, block.prefix)
    return {
        name: replace(variable, shape=(*size, *variable.shape[len(size) :])) for name, variable in described.items()
    }
