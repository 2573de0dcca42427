"""Slopes of mean squares of plain vehicles by dense linear algebra and the product rule: nothing is shared.

With all legs and wheels as rows R and their stiffnesses D, the residual s^2 M q + R^T D (R q - u) is zero whatever a
parameter is, so that Z q' is what it changes by with q held. Rows, stiffnesses and places are differentiated by
Cauchy's integral, which is exact to rounding: they are plain formulas, no solutions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from freqrail.model.assembled import state_space
from freqrail.model.spectrum import RationalSpectrum
from tests import contours
from tests.independent import density
from tests.plain_vehicles import KINDS, Plain, as_system, dense_matrices, dense_rows, places

POINTS, RADIUS = 4, 1e-5  # of Cauchy's circle, relative to the parameter: a law may have its pole near by
Slopes = dict[str, np.ndarray]
SPEED = "speed"


def by_parameter(function: Callable[[Plain], np.ndarray], plain: Plain, name: str) -> np.ndarray:
    """d function/d parameter, of whatever is analytic in it near its value."""
    value = plain.values[name]
    radius = RADIUS * abs(value)
    turns = np.exp(2j * np.pi * (np.arange(POINTS) + 0.5) / POINTS)
    total = [function(replace(plain, values=plain.values | {name: value + radius * turn})) / turn for turn in turns]
    return np.sum(total, axis=0) / (POINTS * radius)


@dataclass(frozen=True)
class Solved:
    """A plain vehicle at s [n]: Z; per metre under a wheel q [n, freedoms, wheels], elongations [rows, n, wheels]."""

    plain: Plain
    s: np.ndarray
    z: np.ndarray
    q: np.ndarray
    elongation: np.ndarray

    @property
    def outputs(self) -> Slopes:
        """What `plain_vehicles.outputs_of` names, {output: [labels, n, wheels]}."""
        return {
            "acceleration": np.moveaxis(self.q, 1, 0) * self.s[:, None] ** 2,
            "elongation": self.elongation,
            "force": self._stiffnesses(self.plain)[..., None] * self.elongation,
        }

    def slopes(self, name: str) -> Slopes:
        """Their slopes by a parameter."""
        plain, s = self.plain, self.s

        def residual(p: Plain) -> np.ndarray:
            mass = np.array([p.values[inertia] for inertia in p.freedoms.values()])
            force = self._stiffnesses(p)[..., None] * self._elongations(p)
            return s[:, None, None] ** 2 * mass[:, None] * self.q + np.einsum(
                "lf,lnw->nfw", np.concatenate(dense_rows(p)), force
            )

        dq = -np.linalg.solve(self.z, by_parameter(residual, plain, name))
        slope = np.einsum("lf,nfw->lnw", np.concatenate(dense_rows(plain)), dq)
        slope = slope + by_parameter(self._elongations, plain, name)
        stiffness, change = self._stiffnesses(plain), by_parameter(self._stiffnesses, plain, name)
        return {
            "acceleration": np.moveaxis(dq, 1, 0) * s[:, None] ** 2,
            "elongation": slope,
            "force": change[..., None] * self.elongation + stiffness[..., None] * slope,
        }

    def _stiffnesses(self, p: Plain) -> np.ndarray:
        laws = [each[2:4] for each in (*p.legs, *p.wheels)]
        return np.array([KINDS[kind][0](self.s, *(p.values[x] for x in names)) + 0 * self.s for kind, names in laws])

    def _elongations(self, p: Plain) -> np.ndarray:
        found = np.einsum("lf,nfw->lnw", np.concatenate(dense_rows(p)), self.q)
        for k in range(len(p.wheels)):
            found[len(p.legs) + k, :, k] -= 1
        return found


def solved(plain: Plain, s: np.ndarray) -> Solved:
    z, force = dense_matrices(plain, s)
    q = np.linalg.solve(z, force)
    empty = Solved(plain, s, z, q, np.zeros(0))
    return replace(empty, elongation=empty._elongations(plain))


@dataclass(frozen=True)
class BandReference:
    """Mean squares of a plain vehicle and their slopes on fixed nodes with weights, {output: [labels]}."""

    plain: Plain
    spectrum: RationalSpectrum
    speed: float
    omega: np.ndarray
    weights: np.ndarray

    def __post_init__(self) -> None:
        omega, speed = self.omega, self.speed
        found = solved(self.plain, 1j * omega)
        waves = np.exp(1j * np.multiply.outer(omega, places(self.plain)) / speed)
        transfers = {k: np.einsum("lnw,nw->ln", x, waves) for k, x in found.outputs.items()}
        g = density(self.spectrum, omega, speed)
        for name, value in {"found": found, "waves": waves, "transfers": transfers, "g": g}.items():
            object.__setattr__(self, name, value)

    def squares(self) -> Slopes:
        return {k: np.abs(t) ** 2 @ (self.g * self.weights) for k, t in self.transfers.items()}

    def slopes(self, name: str) -> Slopes:
        """By a parameter, or by the speed with the band's limits held."""
        speed = self.speed
        if name == SPEED:
            moved, own = -places(self.plain) / speed, None
        else:
            moved, own = by_parameter(places, self.plain, name).real, self.found.slopes(name)
        turned = self.waves * (1j * np.multiply.outer(self.omega, moved) / speed)
        result = {}
        for key, x in self.found.outputs.items():
            change = np.einsum("lnw,nw->ln", x, turned)
            if own is not None:
                change = change + np.einsum("lnw,nw->ln", own[key], self.waves)
            transfer = self.transfers[key]
            result[key] = 2 * np.real(change * np.conj(transfer)) @ (self.g * self.weights)
            if name == SPEED:
                by_speed = np.imag(density(self.spectrum, self.omega, speed + 1e-30j)) / 1e-30
                result[key] = result[key] + np.abs(transfer) ** 2 @ (by_speed * self.weights)
        return result


@dataclass(frozen=True)
class AxisReference:
    """The same over the whole axis, by integrals over circles around all poles left of it, see `contours`."""

    plain: Plain
    spectrum: RationalSpectrum
    speed: float
    points: int = contours.POINTS

    def __post_init__(self) -> None:
        plain, v = self.plain, self.speed
        vehicle = np.linalg.eigvals(state_space(as_system(plain), plain.values).a)
        poles = np.append(vehicle, -v * np.array(self.spectrum.cutoffs))
        found = [(c, r) for c, r in contours.circles(poles, -poles) if c.imag > -r]  # of others, the conjugates
        centre, radius = (np.array(each)[:, None] for each in zip(*found, strict=True))
        turn = np.exp(2j * np.pi * (np.arange(self.points) + 0.5) / self.points)
        s = (centre + radius * turn).ravel()
        twice = np.where(centre.imag > radius, 2.0, 1.0)
        parts = {
            "s": s,
            "weight": (twice * 2 * np.pi / self.points * radius * turn).ravel(),
            "here": solved(plain, s),
            "there": solved(plain, -s),
        }
        for name, value in parts.items():
            object.__setattr__(self, name, value)

    def _lags(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """G(s) e^{s d} of each pair of wheels with d >= 0 [n, wheels, wheels], and its slope by a name, "" for none."""
        x, v, s = places(self.plain), self.speed, self.s[:, None, None]
        moved = by_parameter(places, self.plain, name).real if name not in (SPEED, "") else np.zeros(x.size)
        d, change = x[:, None] - x, moved[:, None] - moved
        some = np.where(d > 1e-12, 1.0, np.where(np.eye(x.size) > 0, 0.5, 0.0))
        low, high = ((v * cutoff) ** 2 for cutoff in self.spectrum.cutoffs)
        g = self.spectrum.roughness * self.spectrum.cutoffs[1] ** 2 * v**3 / ((low - s**2) * (high - s**2))
        lag = some * g * np.exp(s * np.where(some > 0, d, 0.0) / v)
        if name == SPEED:
            by_density = 3 / v - 2 / v * (low / (low - s**2) + high / (high - s**2))
            return lag, lag * (by_density - s * d / v**2)
        return lag, lag * s * change / v

    def _total(self, here: np.ndarray, there: np.ndarray, lag: np.ndarray) -> np.ndarray:
        return np.einsum("lnj,lnj,n->l", np.einsum("lni,nij->lnj", here, lag), there, self.weight).real

    def squares(self) -> Slopes:
        lag, _ = self._lags("")
        there = self.there.outputs
        return {k: self._total(x, there[k], lag) for k, x in self.here.outputs.items()}

    def slopes(self, name: str) -> Slopes:
        """By a parameter or the speed."""
        lag, slope = self._lags(name)
        there = self.there.outputs
        result = {k: self._total(x, there[k], slope) for k, x in self.here.outputs.items()}
        if name != SPEED:
            here_slopes, there_slopes = self.here.slopes(name), self.there.slopes(name)
            for key, x in self.here.outputs.items():
                result[key] = result[key] + self._total(here_slopes[key], there[key], lag)
                result[key] = result[key] + self._total(x, there_slopes[key], lag)
        return result


class MeasuredReference:
    """`AxisReference` with three numbers of points: their mean, and how far they are apart, what rounding leaves of it.

    The rule is exact to far more digits with any; beside sharp poles a dense solution is not, and each machine rounds
    in its own way.
    """

    def __init__(self, plain: Plain, spectrum: RationalSpectrum, speed: float) -> None:
        self.plain, self.speed = plain, speed
        self.each = [AxisReference(plain, spectrum, speed, points) for points in (72, 90, 110)]

    def squares(self) -> Slopes:
        found = [each.squares() for each in self.each]
        return {name: np.mean([one[name] for one in found], axis=0) for name in found[0]}

    def slopes(self, name: str) -> Slopes:
        """By a parameter or the speed."""
        return {key: value for key, (value, _) in self.measured(name).items()}

    def measured(self, name: str) -> dict[str, tuple[np.ndarray, float]]:
        """Slopes, and how far those of the three are apart at most, by output."""
        found = [each.slopes(name) for each in self.each]
        stacked = {key: np.array([one[key] for one in found]) for key in found[0]}
        return {key: (np.mean(each, axis=0), float(np.max(np.ptp(each, axis=0)))) for key, each in stacked.items()}


def euler_sums(shares: dict[str, np.ndarray], speed: str) -> list[list[np.ndarray]]:
    """Shares p d/dp of what has kilograms in its unit, and of what has seconds as often as it has: sums that vanish."""
    kilograms = [share for name, share in shares.items() if not name.startswith("half_") and name != speed]
    seconds = [
        share * (2 if name.endswith("stiffness") else 1)
        for name, share in shares.items()
        if name.endswith(("stiffness", "damping")) or name == speed
    ]
    return [kilograms, seconds]
