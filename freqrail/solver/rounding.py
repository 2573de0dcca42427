"""What rounding leaves in integrals over a band: by the resonances in and beside it, by the phases of the lags.

Near a resonance a response is a difference of large numbers. How far rounding moves a peak, and what it leaves of its
height, is known of every pole (`solver.resonances`); what it means to an output hangs on how much of the output's mean
square the peak holds.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from freqrail.model.spectrum import angular_psd
from freqrail.model.system import evaluate
from freqrail.solver.block_poles import multiplier
from freqrail.solver.closed_form import LIGHT
from freqrail.solver.detours import Detour
from freqrail.solver.problem import Problem
from freqrail.solver.quadrature import EPSILON, ROUNDING
from freqrail.solver.resonances import Resonances, every_pole

Array = NDArray[np.float64]

UNUSUAL = 3e-14  # what rounding leaves of a plausible vehicle's peaks: covered by 4 EPSILON a unit of sharpness
SMALL = 1e-10  # errors of peaks, relative, up to which they count in full, whatever the peak holds
BEYOND = 20.0
"""Without a band, nodes reach this multiple of the highest resonance; what lies beyond is bounded."""


def rounding_errors(
    study: Problem, found: Mapping[int, Resonances], around: tuple[Detour, ...] = ()
) -> dict[str, Array]:
    """What rounding leaves of each output, relative, [speeds], by the resonances of the blocks that it is read off.

    around: detours, on which no node comes near the peaks that they go around. inf where a resonance inside the band
    may have been missed. The lags' phases are known to the rounding of the highest frequency times the longest lag.
    """
    highest = BEYOND * np.max(np.abs(every_pole(found).imag), initial=1.0)
    phase = EPSILON * np.where(np.isinf(study.limits[1]), highest, study.limits[1]) * longest_lags(study)
    near = {index: each.some(~_gone_around(each, around)) for index, each in found.items()}
    # residues of damped poles that are nearly one are large and cancel, but no peak hangs on them
    light = {index: each.some(np.abs(each.poles.real) < LIGHT * np.abs(each.poles)) for index, each in near.items()}
    result = {}
    for name in study.names:
        blocks = study.reduction.blocks_in(name)
        poles = np.concatenate([near[index].poles for index in blocks])
        shift = np.concatenate([near[index].shift for index in blocks])
        peaks = np.concatenate([light[index].poles for index in blocks])
        some = {index: light[index] for index in blocks}
        errors = _peak_errors(study, name, some, {index: near[index] for index in blocks})
        result[name] = rounding(poles, study.limits, shift) + beside_peaks(peaks, study.limits, errors) + phase
        if not all(found[index].known.all() for index in blocks):
            result[name] = np.full_like(result[name], np.inf)
    return result


def _gone_around(each: Resonances, around: tuple[Detour, ...]) -> NDArray[np.bool_]:
    nowhere = np.zeros(each.poles.shape, dtype=bool)
    return functools.reduce(np.logical_or, [detour.holds(each.poles) for detour in around], nowhere)


def _peak_errors(
    study: Problem, name: str, found: Mapping[int, Resonances], everything: Mapping[int, Resonances]
) -> Array:
    """Relative errors by peaks in the mean square of an output, the largest of all labels, [n] or [n, speeds].

    everything: the peaks that hold the mean square, of which those `found` are the sharp ones.
    """
    labels = study.reduction.sums[name]
    with np.errstate(all="ignore"):
        plain, small = [], True
        for each in found.values():
            some = sorted({k for terms in labels for k, _ in terms if k in each.errors})
            relative = (each.errors[k] / np.abs(each.residues[k]) for k in some)
            lost = functools.reduce(np.maximum, relative, each.shift)
            plain.append(2 * lost)
            inside = (np.abs(each.poles.imag) > np.min(study.limits[0])) & (each.poles.imag != 0)
            inside &= np.abs(each.poles.imag) < np.max(study.limits[1])
            small &= bool(np.all(plain[-1][inside] < SMALL))
        if small:
            return np.nan_to_num(np.concatenate(plain))
        return functools.reduce(np.maximum, (_shares(study, terms, found, everything) for terms in labels))


def _shares(
    study: Problem,
    terms: tuple[tuple[int, Array], ...],
    found: Mapping[int, Resonances],
    everything: Mapping[int, Resonances],
) -> Array:
    """Errors in the mean square of a label by its peaks, relative to what the highest peak in the band holds.

    A peak of residue h, summed over the wheels with their lags, holds pi |h|^2 G/|Re p|. terms: of the label.
    [n, speeds].
    """
    highest = np.zeros((max(1, math.prod(study.vehicles)), study.speed.size))
    for each in everything.values():
        power = _powers(study, terms, each)[0] * np.square(_apart(each))[:, None]
        np.maximum.at(highest, each.vehicle, np.nan_to_num(power))
    lost = []
    for each in found.values():
        lost.append(_powers(study, terms, each)[1] / highest[each.vehicle])
    return np.nan_to_num(np.concatenate(lost))


def _powers(study: Problem, terms: tuple[tuple[int, Array], ...], each: Resonances) -> tuple[Array, Array]:
    """What the peaks of a block hold of a label's mean square, and what rounding may take of it, [n, speeds]."""
    shape, p = study.vehicles, each.poles
    wheels = study.reduction.system.wheels
    places = np.array([np.broadcast_to(evaluate(w.place, study.values), shape).ravel() for w in wheels])
    frequency = np.abs(p.imag)[:, None]
    own = {
        name: np.broadcast_to(v, shape).ravel()[each.vehicle] if np.ndim(v) else v for name, v in study.values.items()
    }
    h, wrong = np.zeros((2, p.size, study.speed.size), complex)
    for k, weights in terms:
        if k not in each.residues:
            continue
        scalar = study.reduction.scalars[k]
        factor = multiplier(scalar, study.reduction.blocks[scalar.block], own, p)
        for weight, place in zip(weights, places[:, each.vehicle], strict=True):
            if weight:
                wave = np.exp(1j * frequency * (place[:, None] / study.speed))
                h += (weight * factor * each.residues[k])[:, None] * wave
        wrong += (np.sum(np.abs(weights)) * np.abs(factor) * each.errors[k])[:, None]
    scale = angular_psd(study.spectrum, frequency, study.speed) / np.abs(p.real)[:, None]
    inside = (frequency > study.limits[0]) & (frequency < study.limits[1])
    scale = np.where(inside & (frequency > 0), scale, 0.0)
    return np.square(np.abs(h)) * scale, (2 * np.abs(h) + np.abs(wrong)) * np.abs(wrong) * scale


def _apart(each: Resonances) -> Array:
    """How much of its height a peak holds beside the next one, [n]: 1 of one that is sharp or stands by itself.

    Residues of damped poles that are nearly one are large and cancel, the more the nearer they are.
    """
    order = np.argsort(each.vehicle, kind="stable")
    counts = np.bincount(each.vehicle, minlength=1)
    rank = np.arange(order.size) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.full((counts.size, max(1, int(np.max(counts)))), np.nan + 0j)  # one line a vehicle
    table[each.vehicle[order], rank] = each.poles[order]
    distances = np.abs(table[:, :, None] - table[:, None, :])
    distances[:, range(table.shape[1]), range(table.shape[1])] = np.inf
    nearest = np.empty(order.size)
    nearest[order] = np.nanmin(distances, axis=-1, initial=np.inf)[each.vehicle[order], rank]
    damped = np.abs(each.poles.real) >= LIGHT * np.abs(each.poles)
    share = np.where(each.poles.imag > 0, np.minimum(1.0, nearest / np.abs(each.poles.real)), 0.0)
    return np.where(damped, share, 1.0)


def longest_lags(study: Problem) -> Array:
    """The last wheel's lag behind the first at every speed, s (eq. 2), the largest of all vehicles': [speeds]."""
    wheels = study.reduction.system.wheels
    places = np.broadcast_arrays(*(np.asarray(evaluate(wheel.place, study.values)) for wheel in wheels))
    return np.asarray(np.max(np.max(places, axis=0) - np.min(places, axis=0)) / study.speed)


def rounding(poles: NDArray[np.complex128], limits: Array, shift: Array | float = 0.0) -> Array:
    """Relative errors [m] that rounding leaves in integrals over limits [2, m] with resonances at `poles` [n], rad/s.

    Near a resonance the response is a difference of large numbers: rounding over the distance of the band from the
    pole, relative to its frequency (the damping ratio, if the band holds the resonance). In a narrow band the
    differences of the nodes carry the rounding of their frequencies. shift: how far rounding moves each pole,
    relatively (`resonances.Resonances`): counted where it is `UNUSUAL`.
    """
    size, frequency = np.abs(poles)[:, None], np.abs(poles.imag)[:, None]
    moved = np.where(~(np.asarray(shift) <= UNUSUAL), shift, 0.0)[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.hypot(_outside(frequency, limits), poles.real[:, None])
        sharpness = np.where(frequency > 0, size / distance, 0.0)
        narrow = np.where(np.isfinite(limits[1]), limits[1] / (limits[1] - limits[0]), 1.0)
        unusual = np.max(np.where(frequency > 0, moved * size / distance, 0.0), axis=0, initial=0.0)
    return ROUNDING + 4 * EPSILON * (np.max(sharpness, axis=0, initial=0.0) + narrow) + unusual


def beside_peaks(poles: NDArray[np.complex128], limits: Array, errors: Array) -> Array:
    """Relative errors [m] of integrals over limits [2, m] by what rounding leaves of peaks at `poles` [n], rad/s.

    errors: [n] or [n, m], relative: in full if the peak is in the band, and falling off with its distance. A response
    is small, and so its error large, beside the pole only.
    """
    size, frequency = np.abs(poles)[:, None], np.abs(poles.imag)[:, None]
    spoilt = errors if errors.ndim == 2 else errors[:, None]
    spoilt = np.where(~(spoilt <= UNUSUAL), spoilt, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        near = np.where(spoilt > 0, 1.0 / (_outside(frequency, limits) / (EPSILON * size) + 1.0 / spoilt), 0.0)
    return np.max(near, axis=0, initial=0.0)


def _outside(frequency: Array, limits: Array) -> Array:
    """How far frequencies [n, 1] are outside limits [2, m], rad/s."""
    return np.maximum(0.0, np.maximum(limits[0] - frequency, frequency - limits[1]))
