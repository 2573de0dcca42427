"""Gradients of RMS values of one vehicle: over its band with nodes of its own, or over the whole axis."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.solver import quadrature
from freqrail.solver.block_quadrature import mean_squares
from freqrail.solver.block_residues import whole_axis_mean_squares
from freqrail.solver.gradients import mean_square_gradients, rms_gradient
from freqrail.solver.lag_slopes import POWERS, SPEED, band_edges, gradient_nodes
from freqrail.solver.panels import in_closed_form, own_edges, speed_groups
from freqrail.solver.problem import Problem
from freqrail.solver.quadrature import MeanSquare, WeightedNodes
from freqrail.solver.resonances import every_pole, resonances
from freqrail.solver.rounding import rounding_errors
from freqrail.solver.whole_axis_gradients import whole_axis_gradients

__all__ = ["SPEED", "RmsGradient", "rms_gradients"]

Array = NDArray[np.float64]

MOST = 500  # nodes held at once


@dataclass(frozen=True)
class RmsGradient:
    """The RMS of an output, [labels, speeds], and its slopes by name, with error estimates."""

    rms: Array
    slopes: dict[str, MeanSquare]


def rms_gradients(study: Problem, wanted: Iterable[str]) -> dict[str, RmsGradient]:
    """RMS values of a single vehicle at every speed, and their slopes, {output: RmsGradient}.

    wanted: names of parameters of the vehicle, and `SPEED`. Slopes are in the output's unit over the parameter's SI
    unit; by the stiffness of a rigid joint they are 0. NaN where the vehicle is undamped, its numbers overflow or its
    lags call for too many nodes. Raises ValueError for what is no parameter, and over the whole axis for spectra and
    laws that are not rational.
    """
    wanted = tuple(dict.fromkeys(wanted))
    if study.band is None:
        if not in_closed_form(study):
            raise ValueError("gradients over the whole axis are for rational spectra and laws; give a band")
        at = study.reduction, study.values, study.spectrum, study.speed
        return _gradients(whole_axis_mean_squares(*at), whole_axis_gradients(*at, wanted))
    found = resonances(study.reduction, study.values)
    parts: dict[str, list[tuple[NDArray[np.intp], RmsGradient]]] = {name: [] for name in study.names}
    for speeds in speed_groups(study, every_pole(found)):
        part = replace(study, speed=study.speed[speeds])
        edges = own_edges(part, every_pole(found))
        if edges is None:
            continue
        limits, moving = band_edges(study.band, study.spectrum, part.speed)
        rule = quadrature.quadrature(edges)
        nodes = list(
            gradient_nodes(
                study.reduction, study.values, study.spectrum, rule, part.speed, limits, moving, wanted, MOST
            )
        )
        rounding = rounding_errors(part, found)
        plain = [
            WeightedNodes(np.real(n.omega), n.kronrod[POWERS], None if n.gauss is None else n.gauss[POWERS])
            for n in nodes
            if POWERS in n.kronrod
        ]
        squares = mean_squares(study.reduction, study.values, plain, rounding)
        slopes = mean_square_gradients(study.reduction, study.values, nodes, wanted, rounding)
        for name, own in _gradients(squares, slopes).items():
            parts[name].append((speeds, own))
    return {
        output.name: _joined(parts[output.name], (len(output.taps), study.speed.size), wanted)
        for output in study.reduction.outputs
    }


def _gradients(squares: dict[str, MeanSquare], slopes: dict[str, dict[str, MeanSquare]]) -> dict[str, RmsGradient]:
    with np.errstate(invalid="ignore"):
        return {
            name: RmsGradient(
                np.sqrt(square.value), {by: rms_gradient(square, slope) for by, slope in slopes[name].items()}
            )
            for name, square in squares.items()
        }


def _joined(
    parts: list[tuple[NDArray[np.intp], RmsGradient]], shape: tuple[int, int], wanted: tuple[str, ...]
) -> RmsGradient:
    """Groups of speeds side by side; NaN where there is none."""
    rms = np.full(shape, np.nan)
    slopes = {name: MeanSquare(np.full(shape, np.nan), np.full(shape, np.inf)) for name in wanted}
    for speeds, own in parts:
        rms[:, speeds] = own.rms
        for name, slope in own.slopes.items():
            slopes[name].value[:, speeds], slopes[name].error[:, speeds] = slope.value, slope.error
    return RmsGradient(rms, slopes)
