"""The cases that come with freqrail: the numbers published, and what another solver makes of them written out.

The solver here reads the free form by itself (tomllib, a table of units) and solves the dense equations; of freqrail it
takes nothing but the text.
"""

from __future__ import annotations

import json
import re
import tomllib
import warnings

import numpy as np
import pytest

import freqrail
from freqrail.case.case import build_case, load_case
from freqrail.case.expand import expanded
from freqrail.cli.commands import run
from freqrail.sweep import plausibility

CASES = sorted(freqrail.shipped_cases())

# whole vehicle as published: car kg, kg m^2; bogie kg, kg m^2; wheelset kg; primary N/m, N s/m an axle; secondary N/m,
# N s/m a bogie; half pivot distance, half wheelbase m
PUBLISHED = {
    "manchester-1": (32000, 1.97e6, 2615, 1476, 1813, 2.44e6, 8e3, 860e3, 40e3, 9.5, 1.28),
    "ave-s103": (47800, 1957888, 3500, 1715, 1800, 2.4e6, 20e3, 700e3, 40e3, 8.6875, 1.25),
    "shinkansen-300": (41750, 2.08e6, 3040, 3930, 1780, 1.18e6, 39.2e3, 530e3, 90.2e3, 8.75, 1.25),
    "pioneer-trailer": (44000, 2.74e6, 1700, 1700, 1900, 700e3, 38e3, 350e3, 40e3, 9.0, 1.25),
    "zhai-conventional": (40560, 2.966e6, 3175, 2710, 1900, 1.61e6, 40e3, 618e3, 80e3, 9.0, 1.25),
    "zhai-double-deck": (29600, 2.139e6, 1700, 1700, 1900, 1.746e6, 60e3, 820e3, 217.4e3, 9.0, 1.2),
    "zhai-high-speed": (34000, 2.277e6, 3000, 2710, 1400, 1.1e6, 12e3, 800e3, 160e3, 9.0, 1.2),
    "china-star-power-car": (59364.2, 1.723e6, 5630.8, 9487, 1843.5, 4.7992e6, 60e3, 1.7716e6, 90e3, 5.73, 1.5),
    "eurostar-locomotive": (51500, 1.05e6, 2200, 1900, 1700, 2.6e6, 12e3, 3.26e6, 90e3, 7.0, 1.5),
    "gz18-metro": (30549, 1315247, 8900, 3419, 1834, 2.8e6, 20e3, 460e3, 40e3, 7.85, 1.25),
}
NAMES = (
    "car_body_mass",
    "car_body_pitch_inertia",
    "bogie_mass",
    "bogie_pitch_inertia",
    "wheelset_mass",
    "primary_stiffness",
    "primary_damping",
    "secondary_stiffness",
    "secondary_damping",
    "half_bogie_spacing",
    "half_wheelbase",
)


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_case_has_the_numbers_published_and_the_model_half_of_them(name):
    case = load_case(name)
    assert case.masses == "whole"
    for key, value in zip(NAMES, PUBLISHED[name], strict=True):
        assert case.quantities[key].value == pytest.approx(value, rel=1e-12), key
        share = 1.0 if key.startswith("half_") else 0.5
        assert getattr(case.vehicle, key) == pytest.approx(share * value, rel=1e-12), key
    assert all(np.isinf(case.quantities[f"{stage}_joint_stiffness"].value) for stage in ("primary", "secondary"))


def test_the_free_ones_have_the_numbers_published():
    mass = {}
    for name in CASES:
        case = load_case(name)
        values = case.scalar_case.values()
        system = case.described.system
        mass[name] = 2 * sum(float(values[f.inertia]) for f in system.freedoms if f.motion == "bounce")
    assert mass["manchester-1-pitch"] == pytest.approx(32000 + 2 * 2615 + 4 * 1813)
    assert mass["crh380a"] == mass["crh380a-flexible"] == pytest.approx(40840 + 2 * 2280 + 4 * 1901.8)
    assert mass["six-axle-locomotive"] == pytest.approx(72452 + 2 * 15293 + 6 * 5827)
    assert mass["two-coupled-cars"] == pytest.approx(2 * (40560 + 2 * 3175 + 4 * 1900))
    air = load_case("crh380a-flexible").quantities
    k1, k2, k3 = (air[name].value for name in ("bellows", "reservoir", "area_change"))
    assert k3 + k1 * k2 / (k1 + k2) == pytest.approx(260e3, rel=1e-6)  # slow motions meet the published stiffness


@pytest.mark.parametrize("name", CASES)
def test_a_case_is_warned_of_nowhere_that_it_does_not_accept(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        case = load_case(name)
        assert [c.text for c in plausibility.concerns(case) if not c.accepted] == []


def test_cases_are_listed_with_mass_length_and_source(capsys):
    assert run(["cases", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert list(listed) == CASES
    assert listed["manchester-1"]["mass_t"] == pytest.approx(44.482)
    assert listed["manchester-1"]["length_m"] == pytest.approx(21.56)
    assert all(entry["source"] for entry in listed.values())
    assert run(["cases"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in CASES)
    assert "Iwnicki" in out


# --- another solver ------------------------------------------------------------------------------------

UNITS = {"kg": 1, "m": 1, "N": 1, "kN": 1e3, "MN": 1e6, "GN": 1e9, "s": 1, "rad": 1, "Hz": 1, "km": 1e3, "h": 3600}


def si(text, parameters):
    """A value: a number, a parameter's name, a quantity, or a sum of lengths."""
    if not isinstance(text, str):
        return float(text)
    if text.strip() == "inf":
        return np.inf
    if re.fullmatch(r"[+-]?[\d.]+(e[+-]?\d+)? .*", text) and "m + " not in text:
        number, unit = text.split(" ", 1)
        if unit == "m/N^(2/3)":
            return float(number)
        over = unit.split("/")
        value = float(number)
        for sign, part in ((1, over[0]), *((-1, p) for p in over[1:])):
            for factor in part.split("*"):
                base, _, power = factor.partition("^")
                value *= UNITS[base] ** (sign * int(power or 1))
        return value
    total = 0.0
    for sign, name in re.findall(r"([+-]?)\s*([A-Za-z_0-9.]+(?: m)?)", text):
        total += (-1 if sign == "-" else 1) * si(parameters.get(name, name), {})
    return total


def unit_of(text, parameters):
    text = parameters.get(text, text)
    return text.split(" ", 1)[1] if isinstance(text, str) and " " in text else ""


def stiffness(law, table, parameters, s):
    """A law's dynamic stiffness at s [n], by Python's own parser: | is parallel, - is series."""

    class Element:
        def __init__(self, d):
            self.d = d

        def __or__(self, other):
            return Element(self.d + other.d)

        def __sub__(self, other):
            with np.errstate(divide="ignore", invalid="ignore"):
                return Element(1 / (1 / self.d + 1 / other.d))

    letters = {}
    for name in set(re.findall(r"[A-Za-z]\w*", law)):
        value, unit = min(si(table[name], parameters), 1e30), unit_of(table[name], parameters)  # inf is rigid
        power = {"kg": 2}.get(unit, 1 if "*s" in unit else 0)
        letters[name] = Element(value * s**power + 0j)
    return eval(law, {"__builtins__": {}}, letters).d  # a law of our own case files


def dense(text, speed, frequency):
    """T of bodies' accelerations and vertical strokes, {name: [n]}, per metre of track under the origin."""
    case = tomllib.loads(text)
    parameters = case.get("parameters", {})
    s = 2j * np.pi * frequency
    index, mass, where = {}, [], {}
    for name, body in case["bodies"].items():
        where[name] = si(body["position"], parameters)
        index[name, "z"] = len(mass)
        mass.append(si(body["mass"], parameters))
        if "pitch_inertia" in body:
            index[name, "b"] = len(mass)
            mass.append(si(body["pitch_inertia"], parameters))
        for k in range(len(body.get("bending", []))):
            index[name, k] = len(mass)
            mass.append(si(body["mass"], parameters) / 4)
    for name, wheel in case["wheels"].items():
        where[name] = si(wheel["position"], parameters)
        index[name, "z"] = len(mass)
        mass.append(si(wheel["mass"], parameters))
    size = len(mass)

    def row_at(name, x):
        row = np.zeros(size)
        row[index[name, "z"]] = 1.0
        if (name, "b") in index:
            row[index[name, "b"]] = -(x - where[name])
        for k, mode in enumerate(case["bodies"].get(name, {}).get("bending", [])):
            assert k == 0
            beta = 4.730040744862704
            half, at = beta / 2, beta * (x - where[name]) / si(mode["length"], parameters)
            row[index[name, k]] = (np.cos(at) / np.cos(half) + np.cosh(at) / np.cosh(half)) / 2
        return row

    z = np.zeros((s.size, size, size), complex)
    z += (s**2)[:, None, None] * np.diag(mass)
    static, strokes = np.zeros((size, size)), {}
    for name, body in case["bodies"].items():
        for k, mode in enumerate(body.get("bending", [])):
            omega, ratio = 2 * np.pi * si(mode["frequency"], parameters), mode["damping_ratio"]
            i = index[name, k]
            z[:, i, i] += mass[i] * (omega**2 + 2 * ratio * omega * s)
            static[i, i] += mass[i] * omega**2
    for name, leg in case["suspensions"].items():
        d = stiffness(leg["law"], leg, parameters, s)
        if leg.get("direction") == "pitch":
            row = np.zeros(size)
            row[index[leg["between"][0], "b"]], row[index[leg["between"][1], "b"]] = 1.0, -1.0
        else:
            x = si(leg["position"], parameters)
            row = row_at(leg["between"][0], x) - row_at(leg["between"][1], x)
            strokes[name] = row
        z += d[:, None, None] * np.outer(row, row)
        static += stiffness(leg["law"], leg, parameters, np.array([1e-12 + 0j]))[0].real * np.outer(row, row)
    # the static load of every wheel, by equilibrium on rigid wheels
    wheels = [index[name, "z"] for name in case["wheels"]]
    free = [i for i in range(size) if i not in wheels]
    weight = np.array([m * 9.8 if kind == "z" else 0.0 for (_, kind), m in zip(index, mass, strict=True)])
    q = np.zeros(size)
    q[free] = np.linalg.solve(static[np.ix_(free, free)], -weight[free])
    load = (weight + static @ q)[wheels]
    force = np.zeros((s.size, size), complex)
    first = max(where[name] for name in case["wheels"])
    for name, i, p in zip(case["wheels"], wheels, load, strict=True):
        contact = 1.5 * np.cbrt(p) / si(case["wheels"][name]["contact_constant"], parameters)
        z[:, i, i] += contact
        force[:, i] += contact * np.exp(s * (where[name] - first) / speed)
    q = np.linalg.solve(z, force[..., None])[..., 0]
    found = {("body_acceleration", name): s**2 * (q @ row_at(name, where[name])) for name in case["bodies"]}
    return found | {("stroke", name): q @ row for name, row in strokes.items()}


def mean_square(text, speed, low, high):
    """RMS over wavelengths from `low` to `high`, m, on the low German track."""
    edges = np.geomspace(speed / high, speed / low, 700)
    x, w = np.polynomial.legendre.leggauss(8)
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    frequency = (middle[:, None] + half[:, None] * x).ravel()
    weight = (half[:, None] * w).ravel()
    wave = 2 * np.pi * frequency / speed
    density = 4.032e-7 * 0.8246**2 / ((wave**2 + 0.0206**2) * (wave**2 + 0.8246**2)) * 2 * np.pi / speed
    return {key: np.sqrt(np.abs(t) ** 2 @ (density * weight)) for key, t in dense(text, speed, frequency).items()}


@pytest.mark.parametrize("name", [name for name in CASES if name != "yu-damper-joint"])
def test_another_solver_that_reads_the_case_written_out_agrees(name):
    text = expanded(load_case(name))
    case = build_case(text, name=name).scalar_case
    found = freqrail.sweep(case)
    assert found.status == 0
    for (response, label), value in mean_square(text, case.speed, 1.5, 120.0).items():
        dimension = {"body_acceleration": "body", "stroke": "suspension"}[response]
        ours = found[f"{response}_rms"].sel({dimension: label}).item()
        assert ours == pytest.approx(value, rel=1e-7), label
        assert found[f"{response}_rms_relative_error"].max() < 1e-6


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_template_written_out_gives_its_numbers(name):
    case = load_case(name)
    one, other = freqrail.sweep(case.scalar_case), freqrail.sweep(build_case(expanded(case)).scalar_case)
    ends = ["bogie_front", "bogie_rear"]
    for ours, theirs in (
        (one.bogie_acceleration_rms, other.body_acceleration_rms.sel(body=ends)),
        (one.car_body_acceleration_rms.sel(car_position="centre"), other.body_acceleration_rms.sel(body="car")),
        (one.primary_stroke_rms, other.stroke_rms.sel(suspension=[f"primary_{k}" for k in (1, 2, 3, 4)])),
        (one.secondary_stroke_rms, other.stroke_rms.sel(suspension=["secondary_front", "secondary_rear"])),
    ):
        np.testing.assert_allclose(ours.values, theirs.values, rtol=1e-12)
