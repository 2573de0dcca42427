"""Responses of blocks, put together over blocks and wheels, against a dense solution that shares nothing."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.reduction.blocks import blocks_of
from freqrail.reduction.columns import Reduction, reduce
from freqrail.solver.block_response import column, parts_of, scalars, unsound
from freqrail.solver.elimination import is_tree, order_of
from tests.chains import chain_responses
from tests.plain_vehicles import MAKERS, Plain, arm, as_system, dense_outputs, outputs_of

OMEGA = np.geomspace(2 * np.pi * 0.05, 2 * np.pi * 400, 60)


def per_wheel(found: Reduction, values: dict, omega: np.ndarray) -> dict[str, np.ndarray]:
    """{output: [labels, n, wheels]}."""
    x = scalars(found, column(values), 1j * omega, -np.square(omega)).values()
    result = {}
    for name, labels in found.sums.items():
        rows = [sum(np.multiply.outer(np.broadcast_to(x[i], omega.shape), w) for i, w in terms) for terms in labels]
        nothing = np.zeros((omega.size, len(found.system.wheels)))
        result[name] = np.array([nothing + row for row in rows])
    return result


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", MAKERS)
def test_every_response_of_every_kind_of_vehicle_is_that_of_the_dense_solution(kind, seed):
    plain = MAKERS[kind](np.random.default_rng(100 + seed))
    found = per_wheel(reduce(as_system(plain), outputs_of(plain), plain.values), plain.values, OMEGA)
    for name, expected in dense_outputs(plain, OMEGA).items():
        # a contact's elongation is a difference of large numbers in the dense solution, its force the same times K_H
        scale = np.max(np.abs(expected), axis=(0, 2))[None, :, None]
        np.testing.assert_allclose(found[name] / scale, expected / scale, atol=3e-11)


def exact_strokes(plain: Plain, omega: float) -> np.ndarray:
    """Elongations of the legs for a unit of height under all wheels, in fractions without any rounding: [legs].

    For laws of springs and dampers between joints; complex numbers as pairs, the equations as real ones twice as many.
    """
    w, v = Fraction(omega), {name: Fraction(value) for name, value in plain.values.items()}
    freedoms = list(plain.freedoms)
    n = len(freedoms)

    def stiffness(kind: str, names: tuple[str, ...]) -> tuple[Fraction, Fraction]:
        numbers = [v[name] for name in names]
        if kind == "spring":
            return numbers[0], Fraction(0)
        if kind == "bending":
            m, f, zeta = numbers
            natural = 2 * Fraction(np.pi) * f
            return m * natural**2, m * 2 * zeta * natural * w
        if kind == "kelvin":
            return numbers[0], numbers[1] * w
        k, c, joint = numbers
        lag = 2 * c * w / joint
        return k + c * w * lag / (1 + lag**2), c * w / (1 + lag**2)

    legs = [
        ([Fraction(arm(row.get(f, {}), plain.values)) for f in freedoms], kind, names)
        for _, row, kind, names in plain.legs
    ]
    contacts = [([Fraction(f == on) for f in freedoms], kind, names) for _, on, kind, names, _ in plain.wheels]
    a = [[Fraction(0)] * (2 * n + 1) for _ in range(2 * n)]
    for i, inertia in enumerate(plain.freedoms.values()):
        a[i][i] -= v[inertia] * w**2
        a[n + i][n + i] -= v[inertia] * w**2
    for k, (row, kind, names) in enumerate(legs + contacts):
        real, imaginary = stiffness(kind, names)
        for i in range(n):
            for j in range(n):
                both = row[i] * row[j]
                a[i][j] += real * both
                a[n + i][n + j] += real * both
                a[i][n + j] -= imaginary * both
                a[n + i][j] += imaginary * both
            if k >= len(legs):
                a[i][-1] += real * row[i]
                a[n + i][-1] += imaginary * row[i]
    for k in range(2 * n):
        pivot = next(i for i in range(k, 2 * n) if a[i][k])
        a[k], a[pivot] = a[pivot], a[k]
        a[k] = [x / a[k][k] for x in a[k]]
        for i in range(2 * n):
            if i != k and a[i][k]:
                factor = a[i][k]
                a[i] = [x - factor * y if y else x for x, y in zip(a[i], a[k], strict=True)]
    q = [row[-1] for row in a]

    def elongation(row: list[Fraction], q: list[Fraction]) -> float:
        return float(sum(r * x for r, x in zip(row, q, strict=True)))

    return np.array([complex(elongation(row, q[:n]), elongation(row, q[n:])) for row, _, _ in legs])


@pytest.mark.parametrize("kind", ["the paper's", "front and rear differ", "one bending mode", "three-axle bogies"])
@pytest.mark.parametrize("hertz", [1e-3, 1e-6])
def test_strokes_keep_their_digits_where_all_bodies_move_as_one(kind, hertz):
    """At 1 mHz on a flat wave a stroke is a millionth of the height, at 1 uHz a millionth of a millionth of that."""
    plain = MAKERS[kind](np.random.default_rng(5))
    omega = np.array([2 * np.pi * hertz])
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    x = scalars(found, column(plain.values), 1j * omega, -np.square(omega)).values()
    x = [complex(np.ravel(v)[0]) for v in x]
    stroke = [sum(x[i] * w.sum() for i, w in terms if abs(w.sum()) > 1e-12) for terms in found.sums["elongation"]]
    exact = exact_strokes(plain, float(omega[0]))
    np.testing.assert_allclose(stroke[: len(exact)], exact, rtol=1e-12, atol=1e-13 * np.max(np.abs(exact)))


@pytest.mark.parametrize("primary", [1e2, 5e6, 1e14, np.inf])
@pytest.mark.parametrize("secondary", [1e2, 5e6, 1e14, np.inf])
def test_the_papers_blocks_are_todays_chains(paper_vehicle, primary, secondary):
    """Per scalar to 1e-12 of its value, from 1 mHz to 1 kHz, with joints of any stiffness."""
    vehicle = replace(paper_vehicle, primary_joint_stiffness=primary, secondary_joint_stiffness=secondary)
    omega = 2 * np.pi * np.geomspace(1e-3, 1e3, 200)
    found = reduce(half_vehicle(), outputs(), vars(vehicle))
    x = scalars(found, column(vars(vehicle)), 1j * omega, -np.square(omega)).values()
    chains = list(chain_responses(vehicle, omega).values())
    bodies = (("car", "bogie", "wheelset"), ("car", "bogie", "wheelset"), ("bogie", "wheelset"))
    for value, scalar in zip(x, found.scalars, strict=True):
        chain, names = chains[scalar.block], bodies[scalar.block]
        stages = ("secondary", "primary")[-len(names) + 1 :]
        if scalar.quantity == "displacement":
            element = names[int(np.flatnonzero(scalar.row)[0])]
            expected = chain.ratios[element] * chain.top * -np.square(omega)
        else:
            expected = chain.ratios[stages[scalar.of]] * chain.top
        ratio = value / expected  # a constant, of the coordinates' units
        np.testing.assert_allclose(ratio, np.median(ratio.real), rtol=2e-12)


def test_arrays_of_vehicles_are_each_vehicle_by_itself(paper_vehicle):
    values = dict(vars(paper_vehicle))
    values |= {"primary_joint_stiffness": np.array([1e5, 5e6, np.inf])[:, None], "car_body_mass": np.array([1e4, 2e4])}
    values |= {"half_wheelbase": np.array([0.9, 1.1, 1.3])[:, None]}
    found = reduce(half_vehicle(), outputs(), values)
    together = scalars(found, column(values), 1j * OMEGA, -np.square(OMEGA)).values()
    for i, j in np.ndindex(3, 2):
        one = {k: np.ravel(v)[i if np.ndim(v) == 2 else j] if np.ndim(v) else v for k, v in values.items()}
        alone = scalars(found, column(one), 1j * OMEGA, -np.square(OMEGA)).values()
        for a, b in zip(together, alone, strict=True):
            np.testing.assert_allclose(np.broadcast_to(a, (3, 2, OMEGA.size))[i, j], b, rtol=1e-13)


def test_scalars_span_only_the_axes_that_they_depend_on(paper_vehicle):
    values = dict(vars(paper_vehicle))
    values |= {"primary_joint_stiffness": np.full((4, 1), 5e6), "secondary_joint_stiffness": np.full(3, 5e6)}
    found = reduce(half_vehicle(), outputs(), values)
    x = scalars(found, column(values), 1j * OMEGA, -np.square(OMEGA)).values()
    shapes = {scalar.block: np.shape(value) for scalar, value in zip(found.scalars, x, strict=True)}
    assert shapes == {0: (4, 3, OMEGA.size), 1: (4, 3, OMEGA.size), 2: (4, 1, OMEGA.size)}


@pytest.mark.parametrize("kind", MAKERS)
def test_three_ways_through_a_block_agree(kind):
    """Continuants where a block is a tree, elimination, and LAPACK."""
    plain = MAKERS[kind](np.random.default_rng(8))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    everything = frozenset(range(len(found.blocks)))
    s, s2 = 1j * OMEGA, -np.square(OMEGA)
    quick, exact = (scalars(found, column(plain.values), s, s2, which).values() for which in (frozenset(), everything))
    for one, other in zip(quick, exact, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-11 * np.max(np.abs(other)))


def test_ladders_and_bending_modes_are_trees_and_coupled_legs_are_none(paper_vehicle):
    def trees(kind: str) -> list[bool]:
        plain = MAKERS[kind](np.random.default_rng(8))
        return [is_tree(order_of(block)) for block in blocks_of(as_system(plain), plain.values)[1]]

    assert all(trees("the paper's"))
    assert all(trees("two bending modes"))
    assert trees("front and rear differ") == [False, True, True]


def test_elimination_that_fails_is_found_and_left_to_lapack():
    """Front and rear differ, undamped secondary legs, exactly at the frequency at which a pivot vanishes."""
    plain = MAKERS["front and rear differ"](np.random.default_rng(0))
    found = reduce(as_system(plain), outputs_of(plain), plain.values)
    for name in [name for name in plain.values if name.startswith("secondary") and name.endswith("_c")]:
        plain.values[name] = 0.0
    (block, *_) = found.blocks
    parts = parts_of(block, found.lengths, plain.values, 1j, -1.0, {})
    row, inertia = np.array(parts.rows[0][:2], float), np.array(parts.inertia[:2], float)
    omega = np.array([np.sqrt(float(np.sum(row**2 / inertia)) / float(np.real(parts.compliances[0])))])
    assert unsound(found, plain.values, omega * (1 + 1e-3)) == frozenset()
    omega = omega * (1 + 1e-13)
    assert unsound(found, plain.values, omega) == {0}
    expected = dense_outputs(plain, omega)["acceleration"]
    s = 1j * omega
    x = scalars(found, column(plain.values), s, -np.square(omega), frozenset({0})).values()
    rows = [sum(np.multiply.outer(np.ravel(x[i])[0], w) for i, w in terms) for terms in found.sums["acceleration"]]
    np.testing.assert_allclose(rows, expected[:, 0], atol=1e-9 * np.max(np.abs(expected)))
