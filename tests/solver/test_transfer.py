"""Transfer functions with their lags: against equations of motion written out, at very low frequencies too."""

from __future__ import annotations

import numpy as np
import pytest

from freqrail.model.half_vehicle import values_of
from freqrail.model.outputs import Displacement, Output
from freqrail.reduction.columns import reduce
from freqrail.solver import contact_force as the_force
from freqrail.solver import transfer as the_transfer
from freqrail.solver.contact_force import contact_force
from freqrail.solver.problem import reduced_for_any_lengths
from freqrail.solver.transfer import half_vehicle_transfer, transfer
from tests.helpers import ALL_NAMES, explicit_responses, random_vehicles
from tests.plain_vehicles import MAKERS, as_system, dense_outputs, lagged, outputs_of, places

OMEGA = 2 * np.pi * np.geomspace(0.3, 300, 40)


def furthest(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> float:
    return max(float(np.max(np.abs(found[n] - expected[n]) / np.abs(expected[n]).max())) for n in expected)


def departure(vehicle, speed: float) -> float:
    found = half_vehicle_transfer(vehicle, ALL_NAMES, OMEGA, speed)
    behind = np.exp(-1j * OMEGA * (vehicle.half_bogie_spacing + vehicle.half_wheelbase) / speed)
    expected = explicit_responses(vehicle, OMEGA, speed)  # per metre under the first wheel
    return furthest({name: each * behind for name, each in found.items()}, expected)


def test_the_half_vehicles_responses_are_those_of_its_equations_of_motion(paper_vehicle):
    for vehicle in (paper_vehicle, paper_vehicle.traditional(), *random_vehicles(5, 8)):
        assert departure(vehicle, 70.0) < 1e-9


def test_lags_of_another_speed_are_seen(paper_vehicle, monkeypatch):
    true = the_transfer.evaluate
    monkeypatch.setattr(the_transfer, "evaluate", lambda *given: 1.001 * true(*given))
    assert departure(paper_vehicle, 70.0) > 1e-4


def test_responses_come_in_the_order_of_their_names(paper_vehicle):
    names = ("primary_stroke", "car_body_acceleration")
    assert tuple(half_vehicle_transfer(paper_vehicle, names, OMEGA, 70.0)) == names


@pytest.mark.parametrize("kind", MAKERS)
def test_any_vehicle_any_output_is_the_dense_solution_with_lags(kind):
    plain = MAKERS[kind](np.random.default_rng(3))
    found = transfer(reduce(as_system(plain), outputs_of(plain), plain.values), plain.values, OMEGA, 50.0)
    middle = (places(plain).max() + places(plain).min()) / 2
    expected = {
        name: np.array([lagged(label, plain, OMEGA, 50.0) for label in each]) * np.exp(-1j * OMEGA * middle / 50.0)
        for name, each in dense_outputs(plain, OMEGA).items()
    }
    assert furthest(found, expected) < 1e-8


def momentum_departure(vehicle, speed: float = 70.0) -> float:
    """Of the wheels' forces from the inertia forces of all masses, relatively, at 1 mHz to 10 Hz."""
    omega = 2 * np.pi * np.geomspace(1e-3, 10, 30)
    masses = {"z_c": "car_body_mass", "z_t1": "bogie_mass", "z_t2": "bogie_mass"}
    masses |= {f"z_w{k}": "wheelset_mass" for k in (1, 2, 3, 4)}
    taps = tuple((name, Displacement({name: 1.0})) for name in masses)
    reduction = reduced_for_any_lengths((Output("acceleration", "m s-2", "body", taps, 2),))
    found = transfer(reduction, values_of(vehicle), omega, speed)["acceleration"]
    inertia = np.array([getattr(vehicle, name) for name in masses.values()]) @ found
    total = contact_force(vehicle, omega, speed).sum(axis=0)
    return float(np.max(np.abs(total + inertia) / np.abs(inertia)))


def test_the_wheels_carry_the_inertia_of_all_masses_to_the_last_digits_at_low_frequencies(paper_vehicle, monkeypatch):
    """As a difference of wheel and track height, nearly equal, the force would keep nothing at 1 mHz."""
    for vehicle in (paper_vehicle, paper_vehicle.traditional(), *random_vehicles(5, 9)):
        assert momentum_departure(vehicle) < 1e-11

    def as_difference(reduction, values, omega, speed):
        wheels = tuple((str(k), Displacement({f"z_w{k}": 1.0})) for k in (1, 2, 3, 4))
        moved = transfer(reduced_for_any_lengths((Output("wheel", "m", "axle", wheels),)), values, omega, speed)[
            "wheel"
        ]
        heights = np.exp(1j * np.multiply.outer(reduction.places(values), omega) / speed)
        return {"contact_force": values["contact_stiffness"] * (moved - heights)}

    monkeypatch.setattr(the_force, "transfer", as_difference)
    assert momentum_departure(paper_vehicle) > 1e-8
