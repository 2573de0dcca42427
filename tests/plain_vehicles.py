"""Random vehicles of many kinds, described in plain data, and their responses by a dense solution that shares nothing.

A `Plain` vehicle is masses, legs and wheels as dictionaries. `as_system` turns it into the package's `System`;
`dense_response` solves M q'' + ... = f with numpy from the equations, each law's formula written out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from freqrail.model.elements import Bending, ComplexSpring, Dashpot, Fractional, Inerter, Parallel, Series, Spring
from freqrail.model.outputs import Displacement, Elongation, Force, Output
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.system import Freedom, Leg, System, Wheel

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))

Arms = dict[str, dict[str, float]]  # freedom -> {length: factor}, "" for 1


@dataclass
class Plain:
    """freedoms: name -> inertia name. legs and wheels: (name, row, kind, names of its numbers[, place])."""

    values: dict[str, float]
    freedoms: dict[str, str] = field(default_factory=dict)
    legs: list[tuple[str, Arms, str, tuple[str, ...]]] = field(default_factory=list)
    wheels: list[tuple[str, str, str, tuple[str, ...], dict[str, float]]] = field(default_factory=list)


# kind: (stiffness written out, law of the package)
KINDS: dict[str, tuple[Callable, Callable]] = {
    "spring": (lambda s, k: k, lambda k: Spring(k)),
    "kelvin": (lambda s, k, c: k + c * s, lambda k, c: Parallel((Spring(k), Dashpot(c)))),
    "paper": (
        lambda s, k, c, joint: k + c * s / (1 + 2 * c * s / joint),
        lambda k, c, joint: Parallel((Spring(k), Series((Spring(joint), Dashpot(c), Spring(joint))))),
    ),
    "inerter": (
        lambda s, k, c, b, joint: k + 1 / (1 / joint + 1 / (c * s + b * s**2)),
        lambda k, c, b, joint: Parallel((Spring(k), Series((Spring(joint), Parallel((Dashpot(c), Inerter(b))))))),
    ),
    "two_stage": (
        lambda s, k, c, joint, c2: 1 / (1 / (k + c2 * s) + 1 / (joint + c * s)),
        lambda k, c, joint, c2: Series((Parallel((Spring(k), Dashpot(c2))), Parallel((Spring(joint), Dashpot(c))))),
    ),
    "hysteretic": (
        lambda s, k, eta, c: k * (1 + 1j * eta) + c * s,
        lambda k, eta, c: Parallel((ComplexSpring(k, eta), Dashpot(c))),
    ),
    "fractional": (
        lambda s, k, coefficient, alpha: k + coefficient * s**alpha,
        lambda k, coefficient, alpha: Parallel((Spring(k), Fractional(coefficient, alpha))),
    ),
    "track": (  # a contact spring on a track that yields
        lambda s, hertz, m, k, c: 1 / (1 / hertz + 1 / (m * s**2 + c * s + k)),
        lambda hertz, m, k, c: Series((Spring(hertz), Parallel((Inerter(m), Spring(k), Dashpot(c))))),
    ),
    "bending": (
        lambda s, m, f, zeta: m * ((2 * np.pi * f) ** 2 + 2 * zeta * 2 * np.pi * f * s),
        lambda m, f, zeta: Bending(m, f, zeta),
    ),
}
RATIONAL = ("kelvin", "paper", "inerter", "two_stage")


def as_system(plain: Plain) -> System:
    return System(
        freedoms=tuple(Freedom(name, inertia) for name, inertia in plain.freedoms.items()),
        legs=tuple(Leg(name, row, KINDS[kind][1](*names)) for name, row, kind, names in plain.legs),
        wheels=tuple(
            Wheel(name, {on: 1.0}, KINDS[kind][1](*names), place) for name, on, kind, names, place in plain.wheels
        ),
    )


def arm(factors: dict[str, float], values: dict[str, float]) -> float:
    return sum(factor * (values[name] if name else 1.0) for name, factor in factors.items())


def dense_rows(plain: Plain) -> tuple[np.ndarray, np.ndarray]:
    """Rows of legs and of wheels as plain matrices."""
    index = {name: k for k, name in enumerate(plain.freedoms)}
    kind = np.result_type(float, *plain.values.values())
    legs, wheels = (np.zeros((len(some), len(index)), kind) for some in (plain.legs, plain.wheels))
    for k, (_, row, *_) in enumerate(plain.legs):
        for name, factors in row.items():
            legs[k, index[name]] = arm(factors, plain.values)
    for k, (_, on, *_) in enumerate(plain.wheels):
        wheels[k, index[on]] = 1.0
    return legs, wheels


def dense_matrices(plain: Plain, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Z [n, freedoms, freedoms] and the forces [n, freedoms, wheels] with Z q = force, at any s."""
    legs, wheels = dense_rows(plain)
    masses = np.array([plain.values[inertia] for inertia in plain.freedoms.values()])
    z = np.zeros((s.size, masses.size, masses.size), complex)
    z += s[:, None, None] ** 2 * np.diag(masses)
    for row, (_, _, kind, names) in zip(legs, plain.legs, strict=True):
        stiffness = KINDS[kind][0](s, *(plain.values[name] for name in names)) + 0 * s
        z += stiffness[:, None, None] * np.outer(row, row)
    force = np.zeros((s.size, masses.size, len(wheels)), complex)
    for k, (row, (_, _, kind, names, _)) in enumerate(zip(wheels, plain.wheels, strict=True)):
        c = KINDS[kind][0](s, *(plain.values[name] for name in names)) + 0 * s
        z += c[:, None, None] * np.outer(row, row)
        force[:, :, k] = c[:, None] * row
    return z, force


def dense_response(plain: Plain, s: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """q per metre under each wheel [n, freedoms, wheels], and elongations of legs and wheels {name: [n, wheels]}."""
    legs, wheels = dense_rows(plain)
    q = np.linalg.solve(*dense_matrices(plain, s))
    elongations = {name: row @ q for row, (name, *_) in zip(legs, plain.legs, strict=True)}
    for k, (row, (name, *_)) in enumerate(zip(wheels, plain.wheels, strict=True)):
        elongations[name] = row @ q - np.eye(len(wheels))[k]
    return q, elongations


def places(plain: Plain) -> np.ndarray:
    """Of the wheels along the vehicle, m."""
    return np.array([arm(place, plain.values) for *_, place in plain.wheels])


def lagged(per_wheel: np.ndarray, plain: Plain, omega: np.ndarray, speed: float) -> np.ndarray:
    """Sum over the wheels (last axis) with e^{i omega x_w/v}: per metre of track under the origin."""
    return np.einsum("n...w,nw->n...", per_wheel, np.exp(1j * np.multiply.outer(omega, places(plain)) / speed))


# --- kinds of vehicles -------------------------------------------------------------------------------


class Draw:
    """Plausible numbers around those of real vehicles."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def about(self, value: float, factor: float = 3.0) -> float:
        return float(value * factor ** self.rng.uniform(-1, 1))

    def leg(self, plain: Plain, name: str, kind: str, stiffness: float, damping: float) -> tuple[str, ...]:
        """Numbers of a leg under names of its own; the names."""
        size = {
            "kelvin": {"k": stiffness, "c": damping},
            "paper": {"k": stiffness, "c": damping, "joint": 5e6},
            "inerter": {"k": stiffness, "c": damping, "b": stiffness / 1e3, "joint": 5e6},
            "two_stage": {"k": 3 * stiffness, "c": damping, "joint": 2 * stiffness, "c2": damping},
            "hysteretic": {"k": stiffness, "eta": 0.1, "c": damping / 2},
            "fractional": {"k": stiffness / 2, "coefficient": damping * 5, "alpha": 0.4},
        }[kind]
        drawn = {f"{name}_{key}": self.about(value, 1.3 if key in ("alpha",) else 2.5) for key, value in size.items()}
        plain.values.update(drawn)
        return tuple(drawn)


def car(
    plain: Plain,
    draw: Draw,
    prefix: str = "",
    centre: str = "",
    axles: int = 2,
    alike: bool = True,
    off_centre: bool = False,
    kinds: tuple[str, str] = ("paper", "paper"),
    contact: str = "spring",
    modes: int = 0,
) -> None:
    """A car on two bogies, appended to a plain vehicle; its centre stands at the length `centre`."""
    v, p = plain.values, prefix
    v.setdefault("car_mass", draw.about(15200))
    v.setdefault("car_inertia", draw.about(500e3))
    v.setdefault("bogie_mass", draw.about(1000, 2))
    v.setdefault("bogie_inertia", draw.about(700, 2))
    v.setdefault("wheelset_mass", draw.about(700, 1.5))
    v.setdefault("pivot", draw.about(8.0, 1.3))
    v.setdefault("axle", draw.about(1.1, 1.3))
    if off_centre:
        v.setdefault("pivot_rear", v["pivot"] * draw.about(1.0, 1.2))
        v.setdefault("leaning", draw.about(0.1, 1.5))
    if contact == "spring":
        v.setdefault("hertz", draw.about(1.05e9, 1.5))
        contact_names: tuple[str, ...] = ("hertz",)
    else:
        for name, value in {"hertz": 1.05e9, "rail_mass": 90.0, "rail_k": 6e7, "rail_c": 4e4}.items():
            v.setdefault(name, draw.about(value, 1.5))
        contact_names = ("hertz", "rail_mass", "rail_k", "rail_c")
    for mode in range(modes):
        v.setdefault(f"mode_{mode}_mass", v["car_mass"] / 4)
        v.setdefault(f"mode_{mode}_frequency", draw.about((9.0, 22.0)[mode], 1.2))
        v.setdefault(f"mode_{mode}_damping", draw.about(0.015, 2))
        for end in ("front", "rear"):  # shape at the pivots, even and odd
            v.setdefault(f"mode_{mode}_{end}", (1 if end == "front" or mode % 2 == 0 else -1) * 0.3 * (1 + 0.4 * mode))
    plain.freedoms |= {f"{p}z_c": "car_mass", f"{p}b_c": "car_inertia"}
    for mode in range(modes):
        plain.freedoms[f"{p}mode_{mode}"] = f"mode_{mode}_mass"
        names = (f"mode_{mode}_mass", f"mode_{mode}_frequency", f"mode_{mode}_damping")
        plain.legs.append((f"{p}beam_{mode}", {f"{p}mode_{mode}": {"": 1.0}}, "bending", names))
    stiff = {"secondary": (412e3, 54e3), "primary": (875e3, 17e3)}
    laws: dict[tuple[str, str], tuple[str, ...]] = {}
    for end in ("front", "rear"):
        for stage, kind in zip(("secondary", "primary"), kinds, strict=True):
            name = stage if alike else f"{stage}_{end}"
            if not any(key.startswith(f"{name}_") for key in v if alike or end in key):
                laws[end, stage] = draw.leg(plain, name, kind, *stiff[stage])
            else:
                laws[end, stage] = tuple(key for key in v if key.startswith(f"{name}_"))
    offsets = {2: (1.0, -1.0), 3: (1.0, 0.0, -1.0)}[axles]
    number = 0
    for end, sign in (("front", 1.0), ("rear", -1.0)):
        pivot = "pivot_rear" if off_centre and end == "rear" else "pivot"
        z, b = f"{p}z_{end}", f"{p}b_{end}"
        plain.freedoms |= {z: "bogie_mass", b: "bogie_inertia"}
        row: Arms = {f"{p}z_c": {"": 1.0}, f"{p}b_c": {pivot: -sign}, z: {"": -1.0}}
        if off_centre:
            row[b] = {"leaning": 1.0}  # the secondary leg does not stand over the bogie's centre
        for mode in range(modes):
            row[f"{p}mode_{mode}"] = {f"mode_{mode}_{end}": 1.0}
        plain.legs.append((f"{p}secondary_{end}", row, kinds[0], laws[end, "secondary"]))
        for offset in offsets:
            number += 1
            wheel = f"{p}z_w{number}"
            plain.freedoms[wheel] = "wheelset_mass"
            leg: Arms = {z: {"": 1.0}, wheel: {"": -1.0}}
            if offset:
                leg[b] = {"axle": -offset}
            plain.legs.append((f"{p}primary_{number}", leg, kinds[1], laws[end, "primary"]))
            place = {pivot: sign} | ({"axle": offset} if offset else {}) | ({centre: 1.0} if centre else {})
            plain.wheels.append((f"{p}axle_{number}", wheel, contact, contact_names, place))


def one_car(rng: np.random.Generator, **options: object) -> Plain:
    plain = Plain({})
    car(plain, Draw(rng), **options)  # type: ignore[arg-type]
    return plain


def two_cars(rng: np.random.Generator, **options: object) -> Plain:
    """Two cars joined by a coupler that carries vertical forces and turns with both."""
    plain, draw = Plain({"half_train": 12.5, "minus_half_train": -12.5}), Draw(rng)
    car(plain, draw, "a_", "half_train", **options)  # type: ignore[arg-type]
    car(plain, draw, "b_", "minus_half_train", **options)  # type: ignore[arg-type]
    names = draw.leg(plain, "coupler", "kelvin", 1e6, 2e4)
    plain.values["end"] = 11.0
    row = {"a_z_c": {"": 1.0}, "a_b_c": {"end": 1.0}, "b_z_c": {"": -1.0}, "b_b_c": {"end": 1.0}}
    plain.legs.append(("coupler", row, "kelvin", names))
    return plain


MAKERS: dict[str, Callable[[np.random.Generator], Plain]] = {
    "the paper's": lambda rng: one_car(rng),
    "front and rear differ": lambda rng: one_car(rng, alike=False),
    "pivots off centre": lambda rng: one_car(rng, off_centre=True),
    "three-axle bogies": lambda rng: one_car(rng, axles=3),
    "three axles, off centre": lambda rng: one_car(rng, axles=3, off_centre=True),
    "one bending mode": lambda rng: one_car(rng, modes=1),
    "two bending modes": lambda rng: one_car(rng, modes=2),
    "two coupled cars": lambda rng: two_cars(rng),
    "laws with inerters": lambda rng: one_car(rng, kinds=("inerter", "two_stage")),
    "laws without joints": lambda rng: one_car(rng, kinds=("kelvin", "kelvin")),
    "a track that yields": lambda rng: one_car(rng, contact="track"),
    "irrational laws": lambda rng: one_car(rng, kinds=("hysteretic", "fractional")),
}


def outputs_of(plain: Plain) -> tuple[Output, ...]:
    """Everything: accelerations of all freedoms, elongations and forces of all legs and wheels."""
    names = [name for name, *_ in plain.legs] + [name for name, *_ in plain.wheels]
    return (
        Output("acceleration", "m s-2", "freedom", tuple((f, Displacement({f: 1.0})) for f in plain.freedoms), 2),
        Output("elongation", "m", "leg", tuple((name, Elongation(name)) for name in names)),
        Output("force", "N", "leg", tuple((name, Force(name)) for name in names)),
    )


def dense_outputs(plain: Plain, omega: np.ndarray) -> dict[str, np.ndarray]:
    """What `outputs_of` names per metre under each wheel, {name: [labels, n, wheels]}."""
    s = 1j * omega
    q, elongations = dense_response(plain, s)
    laws = {name: (kind, names) for name, _, kind, names in plain.legs}
    laws |= {name: (kind, names) for name, _, kind, names, _ in plain.wheels}
    stiffness = {n: KINDS[kind][0](s, *(plain.values[x] for x in names)) + 0 * s for n, (kind, names) in laws.items()}
    return {
        "acceleration": np.moveaxis(q, 1, 0) * s[:, None] ** 2,
        "elongation": np.array(list(elongations.values())),
        "force": np.array([elongations[name] * stiffness[name][:, None] for name in elongations]),
    }
