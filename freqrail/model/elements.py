"""Laws of suspension elements, as trees of names: springs, dashpots and inerters in series and parallel.

A law knows names only. The numbers are in one mapping `Values`, name -> float or array, and arrays broadcast over the
grid of vehicles, so that any parameter can be an axis. A law gives its dynamic stiffness D(s), force over elongation,
at any complex s; its slopes by s and by each parameter; how it takes energy; and its realisation in time.

Limits need no special case: D is computed as a quotient n/d in which a rigid spring (inf) in series is d = 0 of its
own and a dashpot without damping n = 0. Of several parts in series one at most may have no stiffness.

Units: spring N/m, dashpot N s/m, inerter kg; s in rad/s. The paper's leg is "k | (K - c - K)": a spring beside a
damper between two rubber joints (eqs. 6 to 8), D = k + c s/(1 + 2 c s/K).
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from freqrail.model.realisation import Polynomial, Realisation, added, of_quotient, times
from freqrail.types import Number

Values = Mapping[str, Number]

BY_S = "d/ds"
"""Key of a law's slope by s among its `slopes`; no parameter can have this name."""


class Law:
    """Dynamic stiffness of an element, a function of named parameters and s."""

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters, each once, in the order in which they stand."""
        raise NotImplementedError

    @property
    def rational(self) -> bool:
        """Whether D is a rational function of s: a law in time, with poles. Others need s = i omega."""
        return True

    @property
    def knots(self) -> tuple[float, ...]:
        """Frequencies where D(i omega) is not smooth, rad/s."""
        return ()

    def quotient(self, values: Values, s: Number) -> tuple[Number, Number]:
        """(n, d) with D = n/d: finite, never both zero."""
        raise NotImplementedError

    def stiffness(self, values: Values, s: Number) -> Number:
        """D(s), N/m: force over elongation; inf where rigid."""
        n, d = self.quotient(values, s)
        with np.errstate(divide="ignore"):
            return n / d

    def compliance(self, values: Values, s: Number) -> Number:
        """1/D(s), m/N: 0 where rigid, inf where there is no force."""
        n, d = self.quotient(values, s)
        with np.errstate(divide="ignore"):
            return d / n

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        """dD/d(parameter) by name and, under `BY_S`, dD/ds."""
        raise NotImplementedError

    def loss(self, values: Values, s: Number) -> tuple[Number, Number]:
        """(taken, kinetic) with Im D(s) = Im(s) taken + Im(s^2) kinetic, N s/m and kg, sums of terms of one sign.

        Of a free oscillation at s = p the elongation e loses `taken` |e|^2, and `kinetic` counts as mass. Only for
        rational laws.
        """
        raise NotImplementedError

    def damps(self, values: Values) -> NDArray[np.bool_]:
        """Whether it takes energy, for each vehicle."""
        return np.asarray(False)

    def polynomials(self, values: Values) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of D as coefficients of 1, s, s^2, ...; only for rational laws."""
        raise NotImplementedError

    def realisation(self, values: Values) -> Realisation | None:
        """The law in time, see `Realisation`; None for a law that is not rational."""
        return of_quotient(*self.polynomials(values)) if self.rational else None

    def renamed(self, names: Mapping[str, str]) -> Law:
        """The law with other names for some of its parameters."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        texts = {key: names.get(value, value) for key, value in own.items() if isinstance(value, str)}
        return replace(self, **texts)  # type: ignore[type-var]


@dataclass(frozen=True)
class Spring(Law):
    """D = K; inf is rigid."""

    name: str

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name,)

    def quotient(self, values: Values, s: Number) -> tuple[Number, Number]:
        stiffness = np.asarray(values[self.name])
        some = stiffness != 0
        with np.errstate(divide="ignore"):
            return np.where(some, 1.0, 0.0), np.where(some, 1.0 / stiffness, 1.0)

    def stiffness(self, values: Values, s: Number) -> Number:
        return values[self.name]

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        return {self.name: 1.0, BY_S: 0.0}

    def loss(self, values: Values, s: Number) -> tuple[Number, Number]:
        return 0.0, 0.0

    def polynomials(self, values: Values) -> tuple[Polynomial, Polynomial]:
        n, d = self.quotient(values, 0.0)
        return [n], [d]


@dataclass(frozen=True)
class _Power(Law):
    """D = value x s^power."""

    name: str

    power = 0

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name,)

    def quotient(self, values: Values, s: Number) -> tuple[Number, Number]:
        return np.multiply(values[self.name], s**self.power), 1.0

    def stiffness(self, values: Values, s: Number) -> Number:
        return np.multiply(values[self.name], s**self.power)

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        return {self.name: s**self.power, BY_S: self.power * np.multiply(values[self.name], s ** (self.power - 1))}

    def polynomials(self, values: Values) -> tuple[Polynomial, Polynomial]:
        return [0.0] * self.power + [np.asarray(values[self.name])], [1.0]


class Dashpot(_Power):
    """D = c s."""

    power = 1

    def loss(self, values: Values, s: Number) -> tuple[Number, Number]:
        return values[self.name], 0.0

    def damps(self, values: Values) -> NDArray[np.bool_]:
        return np.not_equal(values[self.name], 0)


class Inerter(_Power):
    """D = b s^2: a force in proportion to the relative acceleration of its ends."""

    power = 2

    def loss(self, values: Values, s: Number) -> tuple[Number, Number]:
        return 0.0, values[self.name]


@dataclass(frozen=True)
class Bending(Law):
    """D = M (w0^2 + 2 zeta w0 s), w0 = 2 pi f: what holds a bending mode of modal mass M, at f [Hz].

    A leg with this law and the mode's coordinate alone as its row makes a freedom of inertia M a bending mode.
    """

    mass: str
    frequency: str
    damping_ratio: str

    @property
    def names(self) -> tuple[str, ...]:
        return (self.mass, self.frequency, self.damping_ratio)

    def _numbers(self, values: Values) -> tuple[Number, Number]:
        frequency = 2 * np.pi * np.asarray(values[self.frequency])
        damping = 2 * values[self.mass] * np.asarray(values[self.damping_ratio]) * frequency
        return values[self.mass] * np.square(frequency), damping

    def quotient(self, values: Values, s: Number) -> tuple[Number, Number]:
        spring, damping = self._numbers(values)
        return spring + np.multiply(damping, s), 1.0

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        spring, damping = self._numbers(values)
        mass, frequency = (np.asarray(values[name]) for name in self.names[:2])
        by_ratio = 4 * np.pi * mass * frequency * s
        return {
            self.mass: (spring + damping * s) / mass,
            self.frequency: (2 * spring + damping * s) / frequency,
            self.damping_ratio: by_ratio,
            BY_S: damping,
        }

    def loss(self, values: Values, s: Number) -> tuple[Number, Number]:
        return self._numbers(values)[1], 0.0

    def damps(self, values: Values) -> NDArray[np.bool_]:
        return np.not_equal(self._numbers(values)[1], 0)

    def polynomials(self, values: Values) -> tuple[Polynomial, Polynomial]:
        return list(self._numbers(values)), [1.0]


class _Irrational(Law):
    @property
    def rational(self) -> bool:
        return False

    def quotient(self, values: Values, s: Number) -> tuple[Number, Number]:
        return self.stiffness(values, s), 1.0

    def damps(self, values: Values) -> NDArray[np.bool_]:
        return np.asarray(True)


@dataclass(frozen=True)
class ComplexSpring(_Irrational):
    """D = K (1 + i eta) for s = i omega with omega > 0: hysteretic damping with the loss factor eta."""

    name: str
    loss_factor: str

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name, self.loss_factor)

    def stiffness(self, values: Values, s: Number) -> Number:
        return np.multiply(values[self.name], 1.0 + 1j * np.asarray(values[self.loss_factor]))

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        factor = 1.0 + 1j * np.asarray(values[self.loss_factor])
        return {self.name: factor, self.loss_factor: 1j * np.asarray(values[self.name]), BY_S: 0.0}


@dataclass(frozen=True)
class Fractional(_Irrational):
    """D = C s^alpha, of rubber between a spring (alpha = 0) and a dashpot (1); C in N s^alpha/m."""

    name: str
    exponent: str

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name, self.exponent)

    def stiffness(self, values: Values, s: Number) -> Number:
        return np.multiply(values[self.name], np.asarray(s) ** np.asarray(values[self.exponent]))

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        exponent, s = np.asarray(values[self.exponent]), np.asarray(s)
        power = s**exponent
        stiffness = np.multiply(values[self.name], power)
        return {self.name: power, self.exponent: np.multiply(stiffness, np.log(s)), BY_S: stiffness * exponent / s}


@dataclass(frozen=True)
class Tabulated(_Irrational):
    """A measured complex stiffness over frequency, times the parameter `name` (1 for as measured).

    frequencies: [n] rad/s, increasing. stiffnesses: [n] N/m, complex. Straight between the points and constant
    beyond them; only for s = i omega. Raises ValueError for tables that are none.
    """

    name: str
    frequencies: tuple[float, ...]
    stiffnesses: tuple[complex, ...]

    def __post_init__(self) -> None:
        if len(self.frequencies) != len(self.stiffnesses) or len(self.frequencies) < 2:
            raise ValueError(
                "a table needs two or more frequencies and as many stiffnesses "
                f"(got {len(self.frequencies)} and {len(self.stiffnesses)})"
            )
        if not np.all(np.diff(self.frequencies) > 0):
            raise ValueError("the frequencies of a table must increase")

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def knots(self) -> tuple[float, ...]:
        return self.frequencies

    def _measured(self, s: Number) -> NDArray[np.complex128]:
        omega, table = np.imag(s), np.array(self.stiffnesses)
        real, imaginary = (np.interp(omega, self.frequencies, part) for part in (table.real, table.imag))
        return np.asarray(real + 1j * imaginary)

    def stiffness(self, values: Values, s: Number) -> Number:
        return np.multiply(values[self.name], self._measured(s))

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        omega, knots, table = np.imag(s), np.array(self.frequencies), np.array(self.stiffnesses)
        place = np.clip(np.searchsorted(knots, omega) - 1, 0, knots.size - 2)
        inside = (omega >= knots[0]) & (omega <= knots[-1])
        slope = np.where(inside, (np.diff(table) / np.diff(knots))[place] / 1j, 0.0)
        return {self.name: self._measured(s), BY_S: np.multiply(values[self.name], slope)}


class _Compound(Law):
    parts: tuple[Law, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for part in self.parts for name in part.names))

    def renamed(self, names: Mapping[str, str]) -> Law:
        return type(self)(tuple(part.renamed(names) for part in self.parts))  # type: ignore[call-arg]

    @property
    def rational(self) -> bool:
        return all(part.rational for part in self.parts)

    @property
    def knots(self) -> tuple[float, ...]:
        return tuple(knot for part in self.parts for knot in part.knots)


@dataclass(frozen=True)
class Parallel(_Compound):
    """Parts with one elongation, whose forces add."""

    parts: tuple[Law, ...]

    def damps(self, values: Values) -> NDArray[np.bool_]:
        return functools.reduce(np.logical_or, [part.damps(values) for part in self.parts])

    def quotient(self, values: Values, s: Number) -> tuple[Number, Number]:
        springs = sum(np.asarray(values[part.name]) for part in self.parts if isinstance(part, Spring))
        rigid = np.isinf(springs)  # whatever is beside it
        plain = [part.stiffness(values, s) for part in self.parts if not isinstance(part, Spring | _Compound)]
        n: Number = functools.reduce(operator.add, plain, np.where(rigid, 1.0, springs))
        d: Number = np.where(rigid, 0.0, 1.0)
        for part in self.parts:
            if isinstance(part, _Compound):
                other_n, other_d = part.quotient(values, s)
                n, d = np.multiply(n, other_d) + np.multiply(other_n, d), np.multiply(d, other_d)
        return n, d

    def stiffness(self, values: Values, s: Number) -> Number:
        return functools.reduce(operator.add, [part.stiffness(values, s) for part in self.parts])

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        return _summed((part.slopes(values, s), 1.0) for part in self.parts)

    def loss(self, values: Values, s: Number) -> tuple[Number, Number]:
        taken, kinetic = zip(*(part.loss(values, s) for part in self.parts), strict=True)
        return functools.reduce(operator.add, taken), functools.reduce(operator.add, kinetic)

    def polynomials(self, values: Values) -> tuple[Polynomial, Polynomial]:
        n, d = [0.0], [1.0]
        for part in self.parts:
            other_n, other_d = part.polynomials(values)
            n, d = added(times(n, other_d), times(other_n, d)), times(d, other_d)
        return n, d

    def realisation(self, values: Values) -> Realisation | None:
        if not self.rational:
            return None
        found = [part.realisation(values) for part in self.parts]
        return functools.reduce(Realisation.parallel, [r for r in found if r is not None])


@dataclass(frozen=True)
class Series(_Compound):
    """Parts with one force, whose elongations add: 1/D = sum of 1/D_i."""

    parts: tuple[Law, ...]

    def damps(self, values: Values) -> NDArray[np.bool_]:
        some = functools.reduce(np.logical_or, [part.damps(values) for part in self.parts])
        # without force in one of them, there is none in any
        held = [np.not_equal(part.quotient(values, 1j)[0], 0) for part in self.parts]
        return np.asarray(functools.reduce(np.logical_and, held, some))

    def _others(self, values: Values, s: Number) -> tuple[list[Number], Number, Number]:
        """d_i times the other parts' n, their sum, and the product of all n."""
        quotients = [part.quotient(values, s) for part in self.parts]
        shares = []
        for i, (_, d) in enumerate(quotients):
            rest = [n for j, (n, _) in enumerate(quotients) if j != i]
            shares.append(functools.reduce(np.multiply, rest, d))
        return shares, functools.reduce(operator.add, shares), functools.reduce(np.multiply, [n for n, _ in quotients])

    def quotient(self, values: Values, s: Number) -> tuple[Number, Number]:
        _, total, product = self._others(values, s)
        return product, total

    def _ratios(self, values: Values, s: Number) -> list[Number]:
        """D/D_i: the share of the elongation that each part takes."""
        shares, total, _ = self._others(values, s)
        return [share / total for share in shares]

    def slopes(self, values: Values, s: Number) -> dict[str, Number]:
        ratios = self._ratios(values, s)
        return _summed((part.slopes(values, s), r * r) for part, r in zip(self.parts, ratios, strict=True))

    def loss(self, values: Values, s: Number) -> tuple[Number, Number]:
        taken: Number = 0.0
        kinetic: Number = 0.0
        for part, ratio in zip(self.parts, self._ratios(values, s), strict=True):
            own_taken, own_kinetic = part.loss(values, s)
            share = np.square(np.abs(ratio))
            taken, kinetic = taken + share * own_taken, kinetic + share * own_kinetic
        return taken, kinetic

    def polynomials(self, values: Values) -> tuple[Polynomial, Polynomial]:
        n, d = self.parts[0].polynomials(values)
        for part in self.parts[1:]:
            other_n, other_d = part.polynomials(values)
            n, d = times(n, other_n), added(times(d, other_n), times(other_d, n))
        return n, d


def _summed(weighted: Iterable[tuple[dict[str, Number], Number]]) -> dict[str, Number]:
    """The sum of slopes, each with its weight; a parameter that stands in several parts adds up."""
    result: dict[str, Number] = {}
    for slopes, weight in weighted:
        for name, slope in slopes.items():
            result[name] = result.get(name, 0.0) + weight * slope
    return result
