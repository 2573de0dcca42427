"""Systems by names: their matrices, and the time side's equations against the dense solution and the old model's."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.model import equations
from freqrail.model import vehicle as old
from freqrail.model.assembled import state_space
from freqrail.model.elements import Inerter, Spring
from freqrail.model.half_vehicle import half_vehicle, outputs
from freqrail.model.responses import RESPONSES
from freqrail.model.system import Freedom, Leg, System, Wheel, evaluate, structure
from tests.plain_vehicles import MAKERS, as_system, dense_response, dense_rows, places

RATIONAL = [kind for kind in MAKERS if kind != "irrational laws"]


def numbers(vehicle: old.Vehicle) -> dict:
    return dict(vars(vehicle))


def test_the_template_has_the_parameters_of_the_case_file():
    assert set(half_vehicle().parameters) == set(old.Vehicle.__dataclass_fields__)
    assert tuple(output.name for output in outputs()) == tuple(RESPONSES)
    assert [len(output.taps) for output in outputs()] == [
        max(1, len(response.positions)) for response in RESPONSES.values()
    ]


@pytest.mark.parametrize("joint", [5e6, np.inf])
def test_the_template_assembled_is_the_papers_model(paper_vehicle, joint):
    from dataclasses import replace

    vehicle = replace(paper_vehicle, primary_joint_stiffness=joint)
    found, expected = state_space(half_vehicle(), numbers(vehicle)), equations.state_space(old.half_vehicle(vehicle))
    assert len(found.states) == len(expected.states)
    order = [found.states.index(f"Delta_{s[6:]}" if s.startswith("Delta_") else s) for s in expected.states]
    np.testing.assert_allclose(found.a[np.ix_(order, order)], expected.a, rtol=1e-13, atol=1e-9)
    np.testing.assert_allclose(found.b[order], expected.b, rtol=1e-13)
    assert not found.b_rate.any()


@pytest.mark.parametrize("kind", RATIONAL)
def test_the_equations_in_time_answer_as_the_dense_solution_does(kind):
    """(s - A)^-1 (B + s B') of the assembled equations against Z^-1 f written out."""
    for seed in range(3):
        plain = MAKERS[kind](np.random.default_rng(seed))
        model = state_space(as_system(plain), plain.values)
        omega = np.array([0.5, 7.0, 60.0, 900.0])
        q, _ = dense_response(plain, 1j * omega)
        n = len(plain.freedoms)
        for k, w in enumerate(omega):
            x = np.linalg.solve(1j * w * np.eye(len(model.a)) - model.a, model.b + 1j * w * model.b_rate)
            np.testing.assert_allclose(x[-n:], q[k], rtol=1e-9, atol=1e-10 * np.max(np.abs(q[k])))


@pytest.mark.parametrize("kind", MAKERS)
def test_the_structure_holds_rows_and_places(kind):
    plain = MAKERS[kind](np.random.default_rng(1))
    system = as_system(plain)
    fixed = structure(system, plain.values)
    np.testing.assert_allclose(fixed.rows, np.concatenate(dense_rows(plain)))
    np.testing.assert_allclose(fixed.places, places(plain))
    assert set(system.parameters) <= set(plain.values)
    assert sum(len(rows) for rows in fixed.laws.values()) == len(system.legs) + len(system.wheels)


def test_an_arm_is_a_number_a_length_or_a_sum_of_lengths():
    lengths = {"a": np.array([1.0, 2.0]), "b": 0.5}
    assert evaluate(3.0, lengths) == 3.0
    np.testing.assert_allclose(evaluate({"a": -1.0, "b": 2.0, "": 4.0}, lengths), [4.0, 3.0])
    assert evaluate("b", lengths) == 0.5


def vehicle_with(freedoms=("z", "w"), row=None, law=None, wheels=("axle",), contact=None) -> System:
    return System(
        tuple(Freedom(name, "m") for name in freedoms),
        (Leg("leg", {"z": 1.0, "w": -1.0} if row is None else row, law or Spring("k")),),
        tuple(Wheel(name, {"w": 1.0}, contact or Spring("h"), 0.0) for name in wheels),
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"freedoms": ("z", "w", "z")}, "freedom 'z' stands twice"),
        ({"wheels": ("leg",)}, "leg or wheel 'leg' stands twice"),
        ({"row": {"y": 1.0}}, "'leg' has unknown freedom 'y'; freedoms are w, z"),
        ({"row": {}}, "'leg' has an empty row"),
        ({"wheels": ()}, "a vehicle needs a wheel"),
    ],
)
def test_names_that_do_not_fit_together_are_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        vehicle_with(**changes)


@pytest.mark.parametrize(
    ("changes", "values", "words"),
    [
        ({}, {"k": np.inf}, "'leg' is rigid"),
        ({"contact": Inerter("h")}, {}, "the contact of 'axle' takes the track's acceleration"),
    ],
)
def test_what_has_no_first_order_equations_is_refused(changes, values, words):
    with pytest.raises(ValueError, match=words):
        state_space(vehicle_with(**changes), {"m": 1.0, "k": 1.0, "h": 1.0} | values)


def test_an_irrational_law_has_no_equations_in_time():
    plain = MAKERS["irrational laws"](np.random.default_rng(0))
    with pytest.raises(ValueError, match="has no differential equation"):
        state_space(as_system(plain), plain.values)
