"""Chains as partial fractions: their poles, polished, the residues there, and what rounding leaves of both.

An element of a chain (see `reduction.chains`) is X(s) = sum of residue_k / (s - pole_k), m per metre of track.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.equations import leg_dynamic_stiffness
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.chains import BODIES, STAGES, descend, ladder
from freqrail.reduction.chains import poles as eigenvalues
from freqrail.solver.closed_form import EPSILON, FAR, LIGHT, POLISHING
from freqrail.types import Number

DIFFERENCE = 1e-6  # relative step of the difference quotient in Newton's method
FOUND = 1e-9  # relative distance from a pole below which Newton's method has found it
UNCERTAIN = 1e-8  # relative error above which another way to a wheelset's displacement at a pole is looked for
ROUNDED_BELOW = 1e-9  # of the largest eigenvalue: real parts smaller than this are not taken from eigenvalues
SURE, SAME = 0.1, 1e-6  # relative error of a real part, and of a product of poles, up to which they count as known


@dataclass(frozen=True)
class Expansion:
    """A chain as partial fractions: element X(s) = sum of residue_k / (s - pole_k), m per metre of track.

    poles: [grid..., n] rad/s, all of them. residues: {element: [grid..., n]}, zero for the poles of states
    that are missing or beyond `FAR`, NaN where the vehicle's numbers overflow. rounding: {element: [grid..., n]},
    possible relative errors of the residues by what they are worth in a mean square. upper: [grid..., k], indices of
    the poles with Im >= 0, which stand for their conjugates too. weight: [grid..., k], 2 for those with a conjugate,
    1 for real ones, 0 where a vehicle has fewer than k.
    """

    poles: NDArray[np.complex128]
    residues: dict[str, NDArray[np.complex128]]
    rounding: dict[str, NDArray[np.float64]]
    upper: NDArray[np.intp]
    weight: NDArray[np.float64]

    def take(self, values: NDArray) -> NDArray:
        """The entries of values [grid..., n] that belong to the upper poles: [grid..., k]."""
        return np.take_along_axis(values, self.upper, axis=-1)


def chain_poles(vehicle: Vehicle, chain: str) -> NDArray[np.complex128]:
    """Poles of a chain for a grid of vehicles, rad/s: [grid..., n], those of missing states at -2 FAR."""
    masses, legs = ladder(vehicle, chain)
    shape = np.broadcast_shapes(*(np.shape(x) for x in (*masses, *(v for leg in legs for v in leg))))
    shape = np.broadcast_shapes(shape, np.shape(vehicle.contact_stiffness))
    n = len(masses)
    a = np.zeros((*shape, 3 * n - 1, 3 * n - 1))
    a[..., range(2 * n - 1, 3 * n - 1), range(n)] = 1.0
    inverse = [1.0 / np.asarray(m) for m in masses]

    def couple(force: Number, column: int, upper: int) -> None:
        """A force of the leg below body `upper`, proportional to the state `column`."""
        a[..., upper, column] -= force * inverse[upper]
        a[..., upper + 1, column] += force * inverse[upper + 1]

    for j, (spring, damping, joint) in enumerate(legs):
        kappa = np.asarray(joint) / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.where(np.asarray(damping) > 0, kappa / damping, np.inf)
        elastic = rate < FAR
        rate, kappa = np.where(elastic, rate, 0.0), np.where(elastic, kappa, 0.0)
        rigid = np.where(elastic, 0.0, damping)
        above, below, delta = 2 * n - 1 + j, 2 * n + j, n + j
        couple(spring + kappa, above, j)
        couple(-(spring + kappa), below, j)
        couple(-kappa, delta, j)
        couple(rigid, j, j)
        couple(-rigid, j + 1, j)
        a[..., delta, above], a[..., delta, below] = rate, -rate
        a[..., delta, delta] = np.where(elastic, -rate, -2 * FAR)
    a[..., n - 1, -1] -= vehicle.contact_stiffness * inverse[-1]
    finite = np.asarray(np.isfinite(a).all(axis=(-2, -1)))
    return np.where(finite[..., None], np.linalg.eigvals(np.where(finite[..., None, None], a, 0.0)), np.nan)


def expand(vehicle: Vehicle, chain: str) -> Expansion:
    """Partial fractions of a chain for a grid of vehicles, the poles polished to full precision.

    Newton's method polishes the eigenvalues. At a pole the displacements x and elongations e of the free oscillation
    give the derivative of the track's displacement, V'(p) = (sum of 2 p m x^2 + sum of e^2 D'(p)) / (K_H x_w),
    D' = c/(1 + c p/kappa)^2; the residue of an element is its ratio over V'. Of a lightly damped pole the real
    part, which decides the height of its peak, comes from the energy its dampers take without cancellation:
    Re p = - sum of c |e|^2/|1 + c p/kappa|^2 / (2 sum of m |x|^2).
    """
    poles = chain_poles(vehicle, chain)
    column = vehicle.column()
    near = (np.abs(poles) < FAR) | (np.abs(poles.imag) > LIGHT * np.abs(poles))
    p = np.where(near, poles, -1.0)
    for _ in range(3):
        value, nearby = (descend(column, chain, z, z * z)[0] for z in (p, p * (1 + DIFFERENCE)))
        with np.errstate(divide="ignore", invalid="ignore"):
            step = DIFFERENCE * p * value / (nearby - value)
        p = np.where(near & ~_beyond(column, p) & (np.abs(step) < 0.1 * np.abs(p)), p - step, p)
    found = _at_pole(column, chain, p)
    unfound = near & ~(found.off < FOUND)
    if np.any(unfound):
        p = np.where(unfound, _polished(column, chain, p), p)
        found = _at_pole(column, chain, p)
    light = near & (np.abs(p.real) < LIGHT * np.abs(p))
    p = np.where(light, found.real_part + 1j * p.imag, p)
    found = _at_pole(column, chain, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        residues = {name: np.where(near, ratio / found.slope, poles * 0.0) for name, ratio in found.ratios.items()}
    rounding = {name: np.where(near, error, 0.0) for name, error in _rounding(found, p, light).items()}
    weight = np.where(p.imag > 0, 2.0, np.where(p.imag < 0, 0.0, 1.0)) * near
    order = np.argsort(-weight, axis=-1, kind="stable")[..., : max(1, int(np.max(np.sum(weight > 0, axis=-1))))]
    return Expansion(p, residues, rounding, order, np.take_along_axis(weight, order, axis=-1))


def _polished(vehicle: Vehicle, chain: str, p: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Poles by Newton's method on V times the legs' stiffnesses: V has poles of its own where a stiffness is zero.

    A damper so strong that its leg is rigid but for the slowest motion puts a pole of the chain right beside such a
    point, from where Newton's method on V does not come.
    """

    def smooth(z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        value = descend(vehicle, chain, z, z * z)[0]
        for leg in ladder(vehicle, chain)[1]:
            value = value * leg_dynamic_stiffness(*leg, z)
        return value

    for _ in range(POLISHING):
        value, nearby = smooth(p), smooth(p * (1 + DIFFERENCE))
        with np.errstate(divide="ignore", invalid="ignore"):
            step = DIFFERENCE * p * value / (nearby - value)
        p = np.where(np.abs(step) < 0.5 * np.abs(p), p - step, p)
    return p


@dataclass(frozen=True)
class _AtPole:
    """A chain in free oscillation at one of its poles, see `expand`, and what rounding leaves of it.

    slope: V'(p). ratios: of each element. real_part: of p, by dissipation. errors: possible relative errors of the
    ratios, slope_error and real_part_error of the others, if p is exact to rounding; off: by how much it is not,
    relative to it. descent_errors: of the ratios as the way down alone gives them; shift: how far, relatively, its
    rounding moves the pole.
    """

    slope: NDArray[np.complex128]
    ratios: dict[str, Number]
    real_part: NDArray[np.float64]
    errors: dict[str, Number]
    slope_error: NDArray[np.float64]
    real_part_error: NDArray[np.float64]
    off: NDArray[np.float64]
    descent_errors: dict[str, Number]
    shift: NDArray[np.float64]


def _at_pole(vehicle: Vehicle, chain: str, p: NDArray[np.complex128]) -> _AtPole:
    track, ratios, forces = descend(vehicle, chain, p, p * p)
    masses, legs = ladder(vehicle, chain)
    bodies, stages = BODIES[-len(masses) :], STAGES[-len(legs) :]
    errors, force_errors, track_error = _descent_errors(vehicle, chain, p, ratios, forces)
    descent_errors = dict(errors)
    _free_wheelset(vehicle, p, (masses, bodies, legs[-1]), ratios, forces["primary"], errors, force_errors["primary"])
    stiffness_slope = sum(2 * p * m * np.square(ratios[b]) for m, b in zip(masses, bodies, strict=True))
    kinetic = sum(2 * m * np.abs(ratios[b]) ** 2 for m, b in zip(masses, bodies, strict=True))
    taken: Number = 0.0
    # errors of these sums, absolute
    kinetic_error = sum(
        2 * m * np.abs(ratios[b]) ** 2 * (errors[b] + EPSILON) for m, b in zip(masses, bodies, strict=True)
    )
    slope_error, dissipation_error = 2 * np.abs(p) * kinetic_error, 0.0
    for (_, damping, joint), stage in zip(legs, stages, strict=True):
        yielding = 1.0 + p * damping * (2.0 / joint)
        stiffness_slope = stiffness_slope + damping * np.square(ratios[stage] / yielding)
        power = damping * np.abs(ratios[stage] / yielding) ** 2
        taken = taken + power
        part = power * (errors[stage] + EPSILON * (2 + _cancelling(1.0, yielding - 1.0)))
        slope_error, dissipation_error = slope_error + 2 * part, dissipation_error + 2 * part
    slope = stiffness_slope / (vehicle.contact_stiffness * ratios["wheelset"])
    with np.errstate(divide="ignore", invalid="ignore"):
        return _AtPole(
            slope,
            ratios,
            -taken / kinetic,
            errors,
            slope_error / np.abs(stiffness_slope) + errors["wheelset"] + 4 * EPSILON,
            np.where(taken > 0, dissipation_error / taken, 0.0) + 2 * kinetic_error / kinetic + 4 * EPSILON,
            (np.abs(track) + track_error) / np.abs(slope * p),
            descent_errors,
            track_error / np.abs(slope * p),
        )


@dataclass(frozen=True)
class Resonances:
    """Poles of a chain as quadrature sees them, rad/s: [..., n], and what rounding makes of responses there.

    known: [..., n], whether its peak surely lies there, as wide as the pole tells. shift: how far rounding moves a
    peak, relative to its frequency. errors: relative errors of each element beside it, {element: [..., n]}.
    """

    poles: NDArray[np.complex128]
    known: NDArray[np.bool_]
    shift: NDArray[np.float64]
    errors: dict[str, NDArray[np.float64]]


def resonances(vehicle: Vehicle, chain: str, poles: NDArray[np.complex128]) -> Resonances:
    """`Resonances` at poles [..., n] of a chain, known by their eigenvalues, of a vehicle or a grid of vehicles."""
    with np.errstate(all="ignore"):
        found = _at_pole(vehicle.column(), chain, poles)
        errors = {name: np.broadcast_to(error, poles.shape) for name, error in found.descent_errors.items()}
    return Resonances(poles, ~sharp(poles), found.shift, errors)


def own_resonances(vehicle: Vehicle, chain: str) -> Resonances:
    """`Resonances` of a single vehicle's chain, polished where eigenvalues lack the digits."""
    raw = eigenvalues(vehicle, (chain,))
    if not np.isfinite(raw).all():
        return Resonances(raw, np.zeros(raw.shape, dtype=bool), np.zeros(raw.shape), {})
    result = resonances(vehicle, chain, raw)
    if result.known.all():
        return result
    with np.errstate(all="ignore"):
        coarse, polished = chain_poles(vehicle, chain), expand(vehicle, chain)
        taken = np.any([residue != 0 for residue in polished.residues.values()], axis=0)
        every = np.where(taken, polished.poles, coarse)[coarse != -2 * FAR]
        found = _at_pole(vehicle.column(), chain, every)
        light = np.abs(every.real) < LIGHT * np.abs(every)
        sure = np.all(~light | (found.real_part_error < SURE))
    result = resonances(vehicle, chain, every)
    known = bool(sure) and _complete(vehicle, chain, every)
    return replace(result, known=np.full(every.shape, known))


def sharp(poles: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Eigenvalues [..., n] whose real parts, the widths of their peaks, may be lost in the rounding of the largest."""
    largest = np.max(np.where(np.abs(poles) < 2 * FAR, np.abs(poles), 0.0), axis=-1, keepdims=True, initial=0.0)
    return np.abs(poles.real) < ROUNDED_BELOW * largest


def _complete(vehicle: Vehicle, chain: str, poles: NDArray[np.complex128]) -> bool:
    """Whether poles [n] are those of a chain, each once.

    V(s) is 1 at s = 0, where all bodies move alike, zero at the poles and infinite at the zeros of the legs'
    stiffnesses: it is the product of (1 - s/p) over the poles by that of (1 - s/z) over those zeros. On the positive
    axis the way down adds positive terms only; at s = |p| a pole that is not there shows.
    """
    s = np.abs(poles[np.abs(poles) < FAR])
    with np.errstate(all="ignore"):
        value = descend(vehicle, chain, s, s * s)[0]
        for stiffness, damping, joint in ladder(vehicle, chain)[1]:
            value = value * (1.0 + s * damping * (1.0 + stiffness * 2.0 / joint) / stiffness)
        product = np.prod(1.0 - s[:, None] / poles, axis=-1)
        return bool(np.all(np.abs(product / value - 1.0) < SAME))


def _rounding(found: _AtPole, p: NDArray[np.complex128], light: NDArray[np.bool_]) -> dict[str, NDArray[np.float64]]:
    """`Modal.rounding`: of ratio and slope, more if the pole itself is off; for a light pole that of Re p too."""
    more = 1.0 + found.off / EPSILON
    peak = np.where(light, found.real_part_error, 0.0)
    return {name: (error + found.slope_error) * more + peak for name, error in found.errors.items()}


def _cancelling(first: Number, second: Number) -> Number:
    """What rounding grows to in the sum of two numbers."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return (np.abs(first) + np.abs(second)) / np.abs(first + second)


def _descent_errors(
    vehicle: Vehicle, chain: str, p: NDArray[np.complex128], ratios: dict[str, Number], forces: dict[str, Number]
) -> tuple[dict[str, Number], dict[str, Number], NDArray[np.float64]]:
    """What rounding leaves of `chains.descend`: relative errors of ratios and forces, absolute ones of the track's.

    A running analysis: every step adds its own rounding to what it takes over (Wilkinson 1963; Higham, Accuracy and
    Stability of Numerical Algorithms, 3.3).
    """
    masses, legs = ladder(vehicle, chain)
    bodies, stages = BODIES[-len(masses) :], STAGES[-len(legs) :]
    x_error: Number = 0.0
    force_error: Number = 0.0
    absolute: dict[str, Number] = {}
    for k, (body, stage, leg) in enumerate(zip(bodies[:-1], stages, legs, strict=True)):
        absolute[body] = x_error
        inertia = np.abs(masses[k] * p * p)
        force_error = force_error + inertia * (x_error + 3 * EPSILON * np.abs(ratios[body]))
        force_error = force_error + EPSILON * np.abs(forces[stage])
        absolute[stage + " force"] = force_error
        stiffness = np.abs(leg_dynamic_stiffness(*leg, p))
        stage_error = force_error / stiffness + np.abs(ratios[stage]) * (_leg_error(*leg, p) + 2 * EPSILON)
        absolute[stage] = stage_error
        x_error = x_error + stage_error + EPSILON * np.abs(ratios[bodies[k + 1]])
    absolute["wheelset"] = x_error
    weight = np.abs(masses[-1] * p * p) / vehicle.contact_stiffness
    track = np.abs(1.0 + masses[-1] * p * p / vehicle.contact_stiffness) * x_error
    track = track + EPSILON * (1 + 3 * weight) * np.abs(ratios["wheelset"])
    track = track + (force_error + EPSILON * np.abs(forces["primary"])) / vehicle.contact_stiffness
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = {name: absolute[name] / np.abs(ratio) for name, ratio in ratios.items()}
        of_forces = {stage: absolute[stage + " force"] / np.abs(force) for stage, force in forces.items()}
    return relative, of_forces, track


def _leg_error(stiffness: Number, damping: Number, joint: Number, p: NDArray[np.complex128]) -> Number:
    """Relative error of a leg's dynamic stiffness."""
    soft = damping * p * (2.0 / joint)
    damper = damping * p / (1.0 + soft)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.abs(damper) / np.abs(stiffness + damper)
    return EPSILON * (1 + share * (3 + 2 * _cancelling(1.0, soft)))


def _free_wheelset(
    vehicle: Vehicle,
    p: NDArray[np.complex128],
    lowest: tuple[list[Number], tuple[str, ...], tuple[Number, Number, Number]],
    ratios: dict[str, Number],
    force: NDArray[np.complex128],
    errors: dict[str, Number],
    force_error: NDArray[np.float64],
) -> None:
    """Replace what the wheelset and the primary leg move, at a pole, by what keeps most digits.

    As the end of the way down they can be differences of large numbers. In free oscillation the wheelset's own equation
    of motion, with D of the leg and q = m_w p^2 + K_H, gives them from the bogie's displacement, x_w = x_b D/(D + q),
    or from the momentum of the bodies above, the leg's force f = q x_w.
    """
    masses, bodies, leg = lowest
    stiffness, leg_error = leg_dynamic_stiffness(*leg, p), _leg_error(*leg, p)
    resistance = vehicle.contact_stiffness + masses[-1] * p * p
    # Far beyond the wheelset's resonance it hardly moves, and as the end of the way down it would be a difference of
    # large numbers: there its displacement follows from the bogie's by its own equation of motion.
    up = ratios["bogie"] / (1.0 + (masses[-1] * p * p + vehicle.contact_stiffness) / stiffness)
    beyond = _beyond(vehicle, p)
    # and far below it, where it hardly moves either, from the momentum of the bodies above it
    above = sum(m * ratios[b] for m, b in zip(masses[:-1], bodies[:-1], strict=True))
    still = -p * p * above / (vehicle.contact_stiffness + masses[-1] * p * p)
    below = np.abs(p) ** 2 < 0.1 * vehicle.contact_stiffness / vehicle.wheelset_mass
    cancelled = EPSILON * _cancelling(vehicle.contact_stiffness, masses[-1] * p * p)  # of q
    with np.errstate(all="ignore"):  # where the numbers overflow there is no error to tell, and no result
        joined = (np.abs(stiffness) * leg_error + np.abs(resistance) * cancelled) / np.abs(stiffness + resistance)
    up_error = errors["bogie"] + joined + leg_error + 4 * EPSILON
    still_error = force_error + cancelled + 4 * EPSILON
    chosen = np.where(beyond, up, np.where(below, still, ratios["wheelset"]))
    error = np.where(beyond, up_error + cancelled, np.where(below, still_error, errors["wheelset"]))
    for other, of_other in ((up, up_error), (still, still_error)):
        better = (error > UNCERTAIN) & (of_other < error)
        chosen, error = np.where(better, other, chosen), np.where(better, of_other, error)
    ratios["wheelset"], errors["wheelset"] = chosen, error
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = (np.abs(ratios["bogie"]) * errors["bogie"] + np.abs(up) * up_error) / np.abs(ratios["bogie"] - up)
    chosen = np.where(beyond, ratios["bogie"] - up, ratios["primary"])
    error = np.where(beyond, difference + EPSILON, errors["primary"])
    product = ratios["bogie"] * (resistance / (stiffness + resistance))
    of_product = errors["bogie"] + joined + cancelled + 4 * EPSILON
    better = (error > UNCERTAIN) & (of_product < error)
    ratios["primary"] = np.where(better, product, chosen)
    errors["primary"] = np.where(better, of_product, error)


def _beyond(vehicle: Vehicle, p: NDArray[np.complex128]) -> NDArray[np.bool_]:
    return np.abs(p) ** 2 > 10 * vehicle.contact_stiffness / vehicle.wheelset_mass
