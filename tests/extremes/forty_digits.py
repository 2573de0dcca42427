"""Mean squares of the half vehicle's responses in arithmetic of forty digits and more, whole axis or band.

Shares no code with freqrail. With s = i omega each chain of docs/theory.md (bounce, pitch, bogie pitch) is a small
system Z(s) x = K_H v of rational entries, solved by Cramer's rule: each element is a quotient of polynomials N(s)/V(s).
The four wheels feed it with their lags, and with X, Y the chains' elements of a response

    sigma^2 = Re sum over the chains X, Y and the wheels i, j of a_i b_j J,
    J = integral of X Y* G e^{i omega (tau_j - tau_i)} d omega,

is taken pair by pair, in two ways: over the whole axis by residues in the left half plane, over a band by partial
fractions, of which each integrates to an exponential integral,

    integral of e^{s d}/(s - p) ds = -e^{p d} E_1((p - s) d).

How many digits the sums lose is measured, and the working precision doubled until forty are left.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from mpmath import e1, exp, fabs, fsum, log, mp, mpc, mpf, pi, sqrt

DIGITS = 40  # that every result keeps
FIRST, FIRST_BAND, MOST = 80, 160, 5120  # decimal digits of the arithmetic: at first (over a band), and at most

Polynomial = list  # of mpf, the constant first
BOUNCE, PITCH, BOGIE_PITCH = range(3)

# response: (element, power of s, chains that take part, positions (front or rear, leading or trailing), arm)
RESPONSES = {
    "car_body_acceleration": ("top", 2, (0, 1), ((1, 0), (0, 0), (-1, 0)), None),
    "bogie_acceleration": ("bogie", 2, (0, 1), ((1, 0), (-1, 0)), None),
    "secondary_stroke": ("secondary", 0, (0, 1), ((1, 0), (-1, 0)), None),
    "primary_stroke": ("primary", 0, (0, 1, 2), ((1, 1), (1, -1), (-1, 1), (-1, -1)), None),
    "wheelset_acceleration": ("wheelset", 2, (0, 1, 2), ((1, 1), (1, -1), (-1, 1), (-1, -1)), None),
    "car_body_pitch_acceleration": ("top", 2, (1,), ((1, 0),), "half_bogie_spacing"),
    "bogie_pitch_acceleration": ("bogie", 2, (2,), ((1, 1), (-1, 1)), "half_wheelbase"),
}


class TooFewDigits(ArithmeticError):
    """A result has lost more digits than the precision at work can spare."""


@dataclass(frozen=True)
class Chain:
    """Elements N(s)/V(s) of a chain: numerators by element, V, its roots, V' there, and whether it has dampers."""

    numerators: dict[str, Polynomial]
    denominator: Polynomial
    poles: list[mpc]
    slopes: list[mpc]
    damped: bool


def mean_squares(
    vehicle: Mapping[str, float],
    spectrum: tuple[float, float, float],
    speed: float,
    band: tuple[float, float] | None = None,
) -> dict[str, list[mpf]]:
    """Mean squares {response: [positions]}, SI, of one vehicle; inf where it is undamped and resonates in the band.

    vehicle: names and SI units of the case file's table, floats taken as they are. spectrum: roughness and cut-offs.
    speed: m/s. band: rad/s; None: the whole axis.
    """
    digits = FIRST if band is None else max(FIRST, FIRST_BAND)
    while True:
        with mp.workdps(digits):
            try:
                return _mean_squares({k: mpf(v) for k, v in vehicle.items()}, spectrum, mpf(speed), band)
            except TooFewDigits:
                digits *= 2
                if digits > MOST:
                    raise


def _mean_squares(v, spectrum, speed, band):
    roughness, low, high = map(mpf, spectrum)
    scale = roughness * high**2 * speed**3
    apart = mpf(10) ** -(DIGITS // 2 + 5)
    if fabs(low - high) < apart * high:  # a double pole is two beside it: all is even and smooth in their distance
        low, high = low * (1 - apart), high * (1 + apart)
    chains = [solve_chain(v, which) for which in range(3)]
    lt, lc = v["half_wheelbase"], v["half_bogie_spacing"]
    delays = [mpf(0), 2 * lt / speed, 2 * lc / speed, 2 * (lt + lc) / speed]
    ends = (low * speed, high * speed)
    # G = scale / ((a^2 - s^2) (b^2 - s^2)) with poles +-a, +-b

    def density(s):
        return scale / ((ends[0] ** 2 - s * s) * (ends[1] ** 2 - s * s))

    def end_residue(end, other):  # of G at s = -end; the opposite at +end
        return scale / ((2 * end) * (other**2 - end**2))

    track = [(ends[0], end_residue(*ends)), (ends[1], end_residue(ends[1], ends[0]))]
    waves = _Waves([*(chain.poles for chain in chains), [mpc(-end) for end in ends]], delays, band)
    found = {}
    for name, (element, order, members, positions, arm) in RESPONSES.items():
        if any(not chains[x].damped and _resonates(chains[x], band) for x in members):
            found[name] = [mpf("inf")] * len(positions)
            continue
        fractions = _fractions(chains, members, element, order, density, track, band is not None)
        known, sharp = {}, _sharpness([chains[x] for x in members], ends)
        found[name] = []
        for position in positions:
            total, size = mpf(0), mpf(0)
            for x, y, lag, factor in _pairs(members, position, waves):
                if (x, y, lag) not in known:
                    terms = [fraction * waves.of(pole, lag) for pole, fraction in fractions[x, y]]
                    known[x, y, lag] = fsum(t.real for t in terms), fsum(fabs(t) for t in terms)
                total += factor * known[x, y, lag][0]
                size += fabs(factor) * known[x, y, lag][1]
            if size * sharp > fabs(total) * mpf(10) ** (mp.dps - DIGITS):
                raise TooFewDigits
            found[name].append(total / (v[arm] if arm else 1) ** 2)
    return found


def _pairs(members, position, waves):
    """(X, Y, delay's index, factor) whose products make up |T|^2 at a position."""
    side, axle = position
    front, leading = (1, 1, -1, -1), (1, -1, 1, -1)
    quarter, half = mpf(1) / 4, mpf(1) / 2

    def shares(chain):
        if chain == BOUNCE:
            return [quarter] * 4
        if chain == PITCH:
            return [quarter * side * f for f in front] if side or len(members) == 1 else [mpf(0)] * 4
        return [half * axle * r if f == side else mpf(0) for f, r in zip(front, leading, strict=True)]

    total = {}
    for x in members:
        for y in members:
            for i, a in enumerate(shares(x)):
                for j, b in enumerate(shares(y)):
                    if a and b:
                        forward, k = waves.index[i, j]
                        key = (x, y, k) if forward else (y, x, k)
                        total[key] = total.get(key, mpf(0)) + a * b
    return [(*key, factor) for key, factor in total.items() if factor]


class _Waves:
    """What a simple fraction 1/(s - p) with a lag contributes: half of 2 pi e^{p d}, or an integral over the band.

    poles: groups of poles in the left half plane; (group, number, sign) names one of them or its mirror image.
    """

    def __init__(self, poles, delays, band):
        self.poles = poles
        self.band = None if band is None else tuple(map(mpf, band))
        self.lags, self.index = [], {}
        for i, first in enumerate(delays):
            for j, second in enumerate(delays):
                lag = second - first
                if fabs(lag) not in self.lags:
                    self.lags.append(fabs(lag))
                self.index[i, j] = (lag >= 0, self.lags.index(fabs(lag)))
        self.known = {}

    def of(self, pole, lag):
        if (pole, lag) not in self.known:
            group, number, sign = pole
            p = self.poles[group][number]
            self.known[pole, lag] = self._of(p if sign > 0 else -p, self.lags[lag])
        return self.known[pole, lag]

    def _of(self, p, lag):
        if self.band is None:
            return pi * exp(p * lag)
        low, high = (mpc(0, w) for w in self.band)
        if lag == 0:
            branch = (lambda s: log(s - p)) if p.real <= 0 else (lambda s: log(p - s))
            return (branch(high) - branch(low)) / mpc(0, 1)
        total = exp(p * lag) * (e1((p - low) * lag) - e1((p - high) * lag))
        if p.real < 0 and low.imag <= p.imag < high.imag:
            total += 2 * pi * mpc(0, 1) * exp(p * lag)  # E_1's cut was crossed
        return total / mpc(0, 1)


def _fractions(chains, members, element, order, density, track, mirrored):
    """X(s) Y(-s) G(s) of two chains as simple fractions, {(x, y): [(pole's name, coefficient)]}, see `_Waves`.

    mirrored: the poles of Y(-s) and of G in the right half plane too.
    """

    def value(chain, s):
        return evaluate(chain.numerators[element], s) * s**order / evaluate(chain.denominator, s)

    ends = {x: [(value(chains[x], -end), value(chains[x], end)) for end, _ in track] for x in members}
    single = {}
    for x in members:
        for y in members:
            chain = chains[x]
            single[x, y] = [
                evaluate(chain.numerators[element], p) * p**order / slope * value(chains[y], -p) * density(p)
                for p, slope in zip(chain.poles, chain.slopes, strict=True)
            ]
    result = {}
    for x, y in single:
        terms = [((x, k, 1), fraction) for k, fraction in enumerate(single[x, y])]
        terms += [((3, k, 1), r * ends[x][k][0] * ends[y][k][1]) for k, (_, r) in enumerate(track)]
        if mirrored:
            terms += [((y, k, -1), -fraction) for k, fraction in enumerate(single[y, x])]
            terms += [((3, k, -1), -r * ends[x][k][1] * ends[y][k][0]) for k, (_, r) in enumerate(track)]
        result[x, y] = terms
    return result


def _sharpness(chains, ends):
    """What rounding grows to where poles lie close to each other, to the spectrum's or to the axis."""
    sharp = mpf(1)
    for chain in chains:
        for k, p in enumerate(chain.poles):
            others = [fabs(p - other) for other in chain.poles[:k]] + [fabs(p + end) for end in ends]
            nearest = min([*others, fabs(p.real)])
            sharp = max(sharp, fabs(p) / nearest) if nearest else mpf(10) ** mp.dps
    return sharp


def _resonates(chain, band):
    return band is None or any(band[0] < p.imag < band[1] for p in chain.poles)


def solve_chain(v, which):
    """A chain of docs/theory.md as quotients of polynomials, its legs D = a/b with b = 1 + c s/kappa."""
    wheel, contact = v["wheelset_mass"], v["contact_stiffness"]
    if not v["primary_damping"] and (which == BOGIE_PITCH or not v["secondary_damping"]):
        # Poles on the axis would be double ones of |X|^2: a damping far below the last digit parts them.
        tiny = mpf(10) ** -(2 * DIGITS) * sqrt(v["primary_stiffness"] * wheel)
        v = {**v, "primary_damping": tiny, "primary_joint_stiffness": mpf("inf")}
        return replace(solve_chain(v, which), damped=False)
    primary = _leg(v["primary_stiffness"], v["primary_damping"], v["primary_joint_stiffness"])
    if which == BOGIE_PITCH:
        return _two_masses(v["bogie_pitch_inertia"] / (2 * v["half_wheelbase"] ** 2), wheel, primary, contact)
    secondary = _leg(v["secondary_stiffness"] / 2, v["secondary_damping"] / 2, v["secondary_joint_stiffness"] / 2)
    top = v["car_body_mass"] / 4
    if which == PITCH:
        top = v["car_body_pitch_inertia"] / (4 * v["half_bogie_spacing"] ** 2)
    return _three_masses(top, v["bogie_mass"] / 2, wheel, secondary, primary, contact)


def _leg(stiffness, damping, joint):
    relaxation = 2 * damping / joint if damping else mpf(0)  # c/kappa, zero if rigid
    return [stiffness, damping + stiffness * relaxation], [mpf(1), relaxation], damping > 0


def _two_masses(m1, m2, leg, contact):
    (a, b, damped), zero = leg, mpf(0)
    inertia1, inertia2 = [zero, zero, m1], [contact, zero, m2]  # m1 s^2, m2 s^2 + K_H
    top = _sum(_product(inertia1, b), a)  # (m1 s^2 + D) b
    # determinant of [[m1 s^2 + D, -D], [-D, m2 s^2 + K_H + D]], times b
    whole = _sum(_product(top, inertia2), _product(a, inertia1))
    elements = {"bogie": a, "wheelset": top, "primary": [-x for x in _product(inertia1, b)]}
    return _finished({k: [contact * x for x in n] for k, n in elements.items()}, whole, damped)


def _three_masses(m1, m2, m3, upper, lower, contact):
    (a1, b1, damped1), (a2, b2, damped2), zero = upper, lower, mpf(0)
    i1, i2, i3 = [zero, zero, m1], [zero, zero, m2], [contact, zero, m3]
    top = _sum(_product(i1, b1), a1)  # (m1 s^2 + D1) b1
    # what car and bogie resist with together: (m1 s^2 + D1)(m2 s^2 + D1) - D1^2, times b1
    both = _sum(_product(i2, top), _product(a1, i1))
    with_leg = _sum(_product(both, b2), _product(top, a2))  # the same with D2 below, times b1 b2
    # determinant: with_leg (m3 s^2 + K_H) + D2 both
    whole = _sum(_product(with_leg, i3), _product(both, a2))
    elements = {
        "top": _product(a1, a2),
        "bogie": _product(top, a2),
        "wheelset": with_leg,
        "secondary": [-x for x in _product(_product(i1, b1), a2)],
        "primary": [-x for x in _product(both, b2)],
    }
    return _finished({k: [contact * x for x in n] for k, n in elements.items()}, whole, damped1 or damped2)


def _finished(numerators, denominator, damped):
    while not denominator[-1]:
        denominator = denominator[:-1]
    roots = _roots(denominator)
    derivative = [k * c for k, c in enumerate(denominator)][1:]
    with mp.workdps(2 * mp.dps):
        slopes = [evaluate(derivative, p) for p in roots]
    return Chain(numerators, denominator, roots, slopes, damped)


# --- polynomials ------------------------------------------------------------------------------------


def _sum(a, b):
    n = max(len(a), len(b))
    return [(a[k] if k < len(a) else 0) + (b[k] if k < len(b) else 0) for k in range(n)]


def _product(a, b):
    result = [mpf(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        if x:
            for j, y in enumerate(b):
                result[i + j] += x * y
    return result


def evaluate(polynomial, s):
    total = mpf(0)
    for c in reversed(polynomial):
        total = total * s + c
    return total


def _roots(polynomial):
    """All roots by Aberth's simultaneous iteration, started from the polynomial's Newton polygon (Bini 1996)."""
    digits = mp.dps
    roots = _start(polynomial)
    for precision in (50, 2 * digits):  # Newton's last steps cost little and spare half the digits at close roots
        with mp.workdps(precision):
            roots = _aberth(polynomial, roots, mpf(10) ** (-precision // 3 if precision == 50 else -digits))
    return roots


def _aberth(polynomial, roots, tolerance):
    derivative = [k * c for k, c in enumerate(polynomial)][1:]
    moving = set(range(len(roots)))
    for _ in range(2000):
        for k in sorted(moving):
            z = roots[k]
            value, slope = evaluate(polynomial, z), evaluate(derivative, z)
            if not value:
                moving.discard(k)
                continue
            repulsion = sum((1 / (z - other) for j, other in enumerate(roots) if j != k), mpc(0))
            step = 1 / (slope / value - repulsion)
            roots[k] = z - step
            if fabs(step) < tolerance * fabs(z):
                moving.discard(k)
        if not moving:
            return roots
    raise TooFewDigits


def _start(polynomial):
    """Points on circles whose radii are the slopes of the upper hull of log |coefficient|."""
    points = [(k, float(log(fabs(c)))) for k, c in enumerate(polynomial) if c]
    hull = []
    for k, height in points:
        while len(hull) > 1 and (height - hull[-2][1]) * (hull[-1][0] - hull[-2][0]) >= (hull[-1][1] - hull[-2][1]) * (
            k - hull[-2][0]
        ):
            hull.pop()
        hull.append((k, height))
    roots = []
    for (k, height), (end, last) in itertools.pairwise(hull):
        radius = exp(mpf(height - last) / (end - k))
        roots += [radius * exp(mpc(0, 2 * math.pi * j / (end - k) + 0.7)) for j in range(end - k)]
    return roots
