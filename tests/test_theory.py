"""docs/theory.md: the point worked by hand, what its commands print, and that what it names is there."""

from __future__ import annotations

import cmath
import math
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import freqrail
from docs import theory, vehicle
from freqrail.reduction.columns import lag_sums, reduce
from tests.independent import PAPER

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
PROSE = re.sub(r"```.*?```", "", PAGE, flags=re.DOTALL)
MATH = re.findall(r"\$\$(.+?)\$\$", PROSE) + re.findall(r"(?<!\$)\$([^$\n]+)\$(?!\$)", PROSE)


def section(title: str) -> str:
    return PAGE.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def rows(text: str) -> dict[str, list[str]]:
    """The rows of all tables by their first cell, without heads."""
    lines = [line for line in text.splitlines() if line.startswith("| ") and not line.startswith("| |")]
    return {cells[0]: cells[1:] for cells in ([c.strip() for c in line.strip("|").split("|")] for line in lines)}


# --- one point by hand ---------------------------------------------------------------------------------


def by_hand() -> dict[str, list[complex]]:
    """Every number of the tables, by the row's head, from formulas written out here."""
    v, omega = 250 / 3.6, 2 * math.pi
    s = 1j * omega
    d_s = 412e3 + 54e3 * s / (1 + 2 * 54e3 * s / 5e6)
    d_p = 875e3 + 17e3 * s / (1 + 2 * 17e3 * s / 5e6)
    p_0 = (15200 / 4 + 600 / 2 + 700) * 9.8
    k_h = 1.5 * p_0 ** (1 / 3) / 5.1824e-8
    result = {
        "$v$": [v],
        r"$\omega$": [omega],
        r"$\omega^2$": [omega**2],
        r"$2 C_s \omega/K_{sd}$": [2 * 54e3 * omega / 5e6],
        "$D_s$": [d_s],
        r"$2 C_p \omega/K_{pd}$": [2 * 17e3 * omega / 5e6],
        "$D_p$": [d_p],
        "$P_0$": [p_0],
        "$K_H$": [k_h],
    }
    ladders = []
    for mass in (15200.0, 1019000 / 3.289**2):
        first = omega**2 * mass
        e_s = first / (2 * d_s)
        z_t = 1 - e_s
        second = first + 2 * 600 * omega**2 * z_t
        e_p = second / (4 * d_p)
        z_w = z_t - e_p
        third = second + 4 * 700 * omega**2 * z_w
        e_h = third / (4 * k_h)
        ladders.append([first, e_s, z_t, second, e_p, z_w, third, e_h, z_w - e_h, 1 / (z_w - e_h)])
    heads = (r"\varphi_1", "e_s", "z_t", r"\varphi_2", "e_p", "z_w", r"\varphi_3", "e_H", r"\hat u", r"B,\ P")
    result |= {f"${head}$": list(both) for head, both in zip(heads, zip(*ladders, strict=True), strict=True)}
    a, b = omega * 0.797 / v, omega * 3.289 / v
    u_b, u_p = math.cos(a) * math.cos(b), 1j * math.cos(a) * math.sin(b)
    bounce, pitch = ladders[0][-1], ladders[1][-1]
    centre, front = -(omega**2) * bounce * u_b, -(omega**2) * (bounce * u_b + pitch * u_p)
    wavenumber = omega / v
    track = 4.032e-7 * 0.8246**2 / ((wavenumber**2 + 0.0206**2) * (wavenumber**2 + 0.8246**2))
    per_hz = 2 * math.pi * track / v
    return result | {
        "$a$": [a],
        "$b$": [b],
        "$U_B$": [u_b],
        "$U_P$": [u_p],
        r"$T_{\mathrm{centre}}$": [centre],
        r"$T_{\mathrm{front}}$": [front],
        r"$\lvert T_{\mathrm{centre}}\rvert^2$": [abs(centre) ** 2],
        r"$\lvert T_{\mathrm{front}}\rvert^2$": [abs(front) ** 2],
        r"$\Omega$": [wavenumber],
        "$S_v$": [track],
        r"$2\pi G$": [per_hz],
        "PSD, centre": [abs(centre) ** 2 * per_hz],
        "PSD, front": [abs(front) ** 2 * per_hz],
    }


def number(text: str) -> complex:
    """A number as the page writes it: 0.1, 2e9, 1 - 0.2 i, 0.3 i."""
    return complex(text.replace(" ", "").replace("i", "j"))


def rounded(value: complex) -> complex:
    """To six digits, each part."""
    return complex(float(f"{complex(value).real:.6g}"), float(f"{complex(value).imag:.6g}"))


def wrong(text: str) -> list[str]:
    """Heads of rows whose numbers are not those computed here to six digits."""
    printed = rows(text)
    expected = by_hand()
    assert printed.keys() == expected.keys()
    return [
        head
        for head, values in expected.items()
        if [number(cell) for cell in printed[head][1 : 1 + len(values)]] != [rounded(value) for value in values]
    ]


def test_every_number_of_the_point_is_what_its_formula_gives():
    assert wrong(section("One point by hand")) == []


@pytest.mark.parametrize("digits", ["0.571361", "0.0427257", "0.292447", "5857.20", "3640360", "0.0224217"])
def test_a_slip_in_any_number_is_seen(digits):
    text = section("One point by hand")
    assert text.count(digits) >= 1
    last = digits.rstrip("0")[-1]
    slip = digits.rstrip("0")[:-1] + str((int(last) + 1) % 10) + digits[len(digits.rstrip("0")) :]
    assert len(wrong(text.replace(digits, slip))) == 1 or digits == "0.0427257"  # which stands in a formula too


def test_the_point_ends_in_what_freqrail_gives():
    text = section("One point by hand")
    (command,) = re.findall(r"```sh\npython -c \"\n(.*?)\"\n```", text, re.DOTALL)
    found: dict = {}
    exec(command.replace("print(", "psd = (").strip(), found)
    (printed,) = re.findall(r"```text\n\[(.*?)\]\n```", text)
    assert np.array2string(found["psd"]) == f"[{printed}]"
    hand = by_hand()
    np.testing.assert_allclose(found["psd"][:2], [hand["PSD, front"][0], hand["PSD, centre"][0]], rtol=1e-12)


def test_the_numbers_beside_the_tables_of_the_point():
    text = " ".join(section("One point by hand").split())
    for value, digits in (
        (1019000 / 3.289**2, "94199.0 kg"),
        (abs(by_hand()[r"$B,\ P$"][0]), "1.94 fold"),
        (250 / 3.6, "a wave of 69 m"),
    ):
        assert digits in text
        shown = re.search(r"[\d.]+", digits)[0]
        assert float(shown) == round(value, len(shown.partition(".")[2]))
    bounce = next(mode for mode in freqrail.modes("yu-damper-joint") if mode.name == "car bounce")
    assert f"near its resonance ({bounce.natural_frequency:.1f} Hz)" in text


def test_the_wheels_lags_are_those_of_equation_33():
    a, b = 0.31, 1.27
    u = [cmath.exp(1j * x) for x in (b + a, b - a, -b + a, -b - a)]
    assert sum(u) / 4 == pytest.approx(math.cos(a) * math.cos(b))
    assert (u[0] + u[1] - u[2] - u[3]) / 4 == pytest.approx(1j * math.cos(a) * math.sin(b))
    assert (u[0] - u[1]) / 2 == pytest.approx(1j * math.sin(a) * cmath.exp(1j * b))


# --- tables --------------------------------------------------------------------------------------------


PRINTED = {name: text for name, _, text in theory.PRINTED.findall(PAGE)}


def test_every_table_is_on_the_page():
    assert PRINTED.keys() == theory.TABLES.keys()


@pytest.mark.parametrize("name", ["blocks", "columns", "nodes", "rail"])
def test_tables_are_what_their_commands_print(name):
    """To mend: python -m docs.theory page."""
    assert theory.printed(name) == PRINTED[name]


@pytest.mark.parametrize("name", ["errors", "kinds"])
def test_measured_errors_are_below_the_estimates_on_the_page(name):
    """Digits of rounding differ from machine to machine."""
    number = r"\d\.?\d*e-\d+"
    for now, then in zip(theory.printed(name).splitlines(), PRINTED[name].splitlines(), strict=True):
        found, shown = ([float(x) for x in re.findall(number, line)] for line in (now, then))
        assert re.split(number, now)[0] == re.split(number, then)[0]
        assert len(found) == len(shown)
        if len(found) == 3:
            assert found[0] < 1e-12
        if len(found) > 1:
            assert found[-2] < shown[-1] < 1e-7


def test_the_seven_lag_functions_are_those_generated():
    """The formulas of the page against the sums over distances, in one order and up to sign and scale."""
    reduction = reduce(theory.half_vehicle(), theory.outputs(), theory.VARYING)
    forms, factors = lag_sums(reduction)
    formulas = {head: cells[0] for head, cells in rows(section("Columns")).items() if head.isdigit()}
    assert list(formulas) == [str(k + 1) for k in range(len(reduction.lags))]
    a, b = np.random.default_rng(3).uniform(0, 2 * np.pi, (2, 20))
    for lag, row, formula in zip(reduction.lags, factors, formulas.values(), strict=True):
        angle = np.multiply.outer(forms[:, 1], b) + np.multiply.outer(forms[:, 2], a)
        generated = row @ (np.cos(angle) if lag.part == "re" else np.sin(angle))
        typed = 1.0
        for function, power, twice, of in re.findall(r"\\(cos|sin)(\^2)? (2?)([ab])", formula):
            value = getattr(np, function)((2 if twice else 1) * (a if of == "a" else b))
            typed = typed * (value**2 if power else value)
        ratio = generated / typed
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)


def test_the_values_of_the_papers_vehicle_are_those_computed_with():
    cells = rows(section("Symbols"))
    kilo, giga = 1e3, 1e9
    expected = {
        r"$M_c,\ J_c$": (PAPER.car_body_mass, PAPER.car_body_pitch_inertia),
        r"$M_t,\ J_t$": (PAPER.bogie_mass, PAPER.bogie_pitch_inertia),
        "$M_w$": (PAPER.wheelset_mass,),
        r"$K_s,\ C_s,\ K_{sd}$": (
            PAPER.secondary_stiffness / kilo,
            PAPER.secondary_damping / kilo,
            PAPER.secondary_joint_stiffness / kilo,
        ),
        r"$K_p,\ C_p,\ K_{pd}$": (
            PAPER.primary_stiffness / kilo,
            PAPER.primary_damping / kilo,
            PAPER.primary_joint_stiffness / kilo,
        ),
        "$K_H$": (round(PAPER.contact_stiffness / giga, 4),),
        r"$L_c,\ L_t$": (PAPER.half_bogie_spacing, PAPER.half_wheelbase),
    }
    for head, values in expected.items():
        assert tuple(float(x) for x in cells[head][1].split(",")) == values


# --- what the page names -------------------------------------------------------------------------------


def test_equations_are_numbered_through_and_no_other_is_named():
    tags = [int(tag) for tag in re.findall(r"\\tag\{(\d+)\}", PAGE)]
    assert tags == list(range(1, len(tags) + 1))
    assert PAGE.count("$$") == 2 * len(tags)
    named = re.sub(r"\$\$.*?\$\$|`[^`]*`|Yu \(\d+\)( (and|to) \(\d+\))?", "", PROSE)
    assert {int(tag) for tag in re.findall(r"\((\d\d?)\)", named)} <= set(tags)


def test_modules_and_tests_that_the_page_names_are_there():
    for name in set(re.findall(r"`((?:\w+/)+\w+\.py)`", PAGE)):
        assert (ROOT / name).is_file() or (ROOT / "freqrail" / name).is_file(), name
    commands = re.findall(r"`pytest ([^`]+)`", PAGE)
    assert len(commands) > 5
    for command in commands:
        files, _, word = command.partition(" -k ")
        for file in files.split():
            text = (ROOT / file).read_text(encoding="utf-8")
            assert re.search(rf"def test_\w*{word}", text), command


def test_links_lead_somewhere():
    heads = [re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in re.findall(r"^#+ (.+)$", PROSE, re.M)]
    for target in re.findall(r"\]\(([^)]+)\)", PROSE):
        assert target[1:] in heads if target.startswith("#") else (ROOT / "docs" / target).is_file(), target


def test_formulas_hold_nothing_that_markdown_takes_for_its_own():
    r"""Markdown eats the backslash of \, \; \{ and \\, and pairs asterisks; a table ends at a bar."""
    assert len(MATH) > 200
    for formula in MATH:
        assert not re.search(r"\\[,;!{}\\]|[*|]", formula), formula


def test_labels_of_the_drawing_do_not_overlap():
    figure = vehicle.figure()
    figure.canvas.draw()
    texts = [text for axes in figure.axes for text in axes.texts if text.get_text()]
    boxes = [text.get_window_extent() for text in texts]
    assert len(boxes) > 60
    both = [
        (a.get_text(), b.get_text())
        for (a, x), (b, y) in combinations(zip(texts, boxes, strict=True), 2)
        if x.overlaps(y)
    ]
    assert both == []
    sheet = figure.bbox
    assert all(sheet.x0 <= box.x0 and box.x1 <= sheet.x1 for box in boxes)
