"""Modes in words: the poles of the assembled vehicle, named once each, of the paper's vehicle and of others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqrail.errors import InputError
from freqrail.model import assembled
from freqrail.model.elements import Dashpot, Parallel, Series, Spring
from freqrail.model.equations import state_space
from freqrail.model.system import Freedom, Leg, System, Wheel
from freqrail.model.vehicle import half_vehicle
from freqrail.solver import modes as the_modes
from freqrail.solver import phases
from freqrail.solver.modes import Mode, modes, system_modes
from tests.helpers import random_vehicles
from tests.plain_vehicles import KINDS, MAKERS, Plain, as_system, dense_rows
from tests.worded import worded


def test_modes_and_their_conjugates_are_the_poles_of_the_26_state_model(paper_vehicle):
    for vehicle in (paper_vehicle, *random_vehicles(5, seed=3)):
        found = [mode.pole for mode in modes(vehicle)]
        found += [pole.conjugate() for pole in found if pole.imag > 0]
        expected = np.linalg.eigvals(state_space(half_vehicle(vehicle)).a)
        assert len(found) == expected.size == 26
        apart = np.abs(np.subtract.outer(found, expected))
        assert np.max(apart.min(axis=0) / np.abs(expected)) < 1e-6
        assert np.max(apart.min(axis=1) / np.abs(found)) < 1e-6


def test_every_mode_has_a_name_of_its_own(paper_vehicle):
    for vehicle in (paper_vehicle, paper_vehicle.traditional()):
        names = [mode.name for mode in modes(vehicle)]
        assert len(set(names)) == len(names)


@pytest.mark.parametrize("stiffness", [1e13, 1e15])
def test_very_stiff_joints_are_rigid_to_the_digits_that_are_left(paper_vehicle, stiffness):
    """A joint softens by one over its stiffness and no more; plain eigenvalues lose their digits on the way."""
    stiff = replace(paper_vehicle, primary_joint_stiffness=stiffness, secondary_joint_stiffness=stiffness)
    rigid = {mode.name: mode for mode in modes(paper_vehicle.traditional()) if "wheelset" in mode.name}
    for mode in modes(stiff):
        if mode.name in rigid:
            assert mode.damping_ratio == pytest.approx(rigid[mode.name].damping_ratio, rel=1e7 / stiffness)
            assert mode.natural_frequency == pytest.approx(rigid[mode.name].natural_frequency, rel=1e7 / stiffness)


def test_an_overdamped_pair_is_a_slow_and_a_fast_one(paper_vehicle):
    pair = [mode for mode in modes(paper_vehicle.traditional()) if mode.name.startswith("bogie bounce, in phase")]
    assert [mode.name.split(", ")[-1] for mode in pair] == ["slow", "fast"]
    assert pair[0].natural_frequency < pair[1].natural_frequency
    assert all(mode.damping_ratio == 1 and mode.damped_frequency == 0 for mode in pair)


def test_no_two_modes_have_one_name_be_a_bogie_overdamped_beside_soft_joints_or_not():
    for vehicle in random_vehicles(60, seed=4):
        for each in (vehicle, vehicle.traditional()):
            names = [mode.name for mode in modes(each)]
            assert len(set(names)) == len(names)
            # every motion oscillates, or is overdamped at two poles
            overdamped = sum("overdamped" in name for name in names)
            assert sum(mode.damped_frequency > 0 for mode in modes(each)) + overdamped / 2 == 10


# --- any vehicle -----------------------------------------------------------------------------------

RATIONAL = [kind for kind in MAKERS if kind != "irrational laws"]

TWO_BOGIES = {
    *("car bounce", "car pitch", "bogie bounce, in phase", "bogie bounce, in antiphase"),
    *("bogie pitch, bogies in phase", "bogie pitch, bogies in antiphase"),
}
FOUR_WHEELSETS = {
    *("wheelsets, all in phase", "wheelsets, bogies in antiphase"),
    *("wheelsets of a bogie opposed, bogies in phase", "wheelsets of a bogie opposed, bogies in antiphase"),
}
SIX_WHEELSETS = {
    *("wheelsets, all in phase", "wheelsets, bogies in antiphase"),
    *("outer wheelsets of a bogie opposed, bogies in phase", "outer wheelsets of a bogie opposed, bogies in antiphase"),
    "middle wheelset of a bogie against the outer ones, bogies in phase",
    "middle wheelset of a bogie against the outer ones, bogies in antiphase",
}
OSCILLATIONS = {
    "the paper's": TWO_BOGIES | FOUR_WHEELSETS,
    "pivots off centre": TWO_BOGIES | FOUR_WHEELSETS,
    "three-axle bogies": TWO_BOGIES | SIX_WHEELSETS,
    "three axles, off centre": TWO_BOGIES | SIX_WHEELSETS,
    "one bending mode": TWO_BOGIES | FOUR_WHEELSETS | {"car bending, first mode"},
    "two bending modes": TWO_BOGIES | FOUR_WHEELSETS | {"car bending, first mode", "car bending, second mode"},
    "front and rear differ": {"car bounce", "car pitch"}
    | {f"{end} bogie {motion}" for end in ("front", "rear") for motion in ("bounce", "pitch")}
    | {f"wheelsets of the {end} bogie {phase}" for end in ("front", "rear") for phase in ("in phase", "opposed")},
    "two coupled cars": {
        *(
            "car bounce, in phase",
            "car bounce, in antiphase",
            "car pitch, cars in phase",
            "car pitch, cars in antiphase",
        ),
        *("bogie bounce, all in phase", "bogie bounce, cars in antiphase"),
        "bogie bounce, bogies of a car opposed, cars in phase",
        "bogie bounce, bogies of a car opposed, cars in antiphase",
        *("bogie pitch, bogies all in phase", "bogie pitch, cars in antiphase"),
        "bogie pitch, bogies of a car opposed, cars in phase",
        "bogie pitch, bogies of a car opposed, cars in antiphase",
        *("wheelsets, all in phase", "wheelsets, cars in antiphase"),
        "wheelsets, bogies of a car opposed, cars in phase",
        "wheelsets, bogies of a car opposed, cars in antiphase",
        *("wheelsets of a bogie opposed, bogies all in phase", "wheelsets of a bogie opposed, cars in antiphase"),
        "wheelsets of a bogie opposed, bogies of a car opposed, cars in phase",
        "wheelsets of a bogie opposed, bogies of a car opposed, cars in antiphase",
    },
    "a track that yields": TWO_BOGIES
    | FOUR_WHEELSETS
    | {
        "track under the wheels oscillating, wheelsets all in phase",
        "track under the wheels oscillating, bogies in antiphase",
        "track under the wheels oscillating, wheelsets of a bogie opposed, bogies in phase",
        "track under the wheels oscillating, wheelsets of a bogie opposed, bogies in antiphase",
    },
}


def found_of(kind: str, seed: int, undamped: bool = False) -> tuple[Plain, tuple[Mode, ...]]:
    plain = MAKERS[kind](np.random.default_rng(seed))
    if undamped:
        plain.values |= {name: 0.0 for name in plain.values if name.endswith(("_c", "_c2", "_damping"))}
    return plain, system_modes(worded(plain), plain.values)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", OSCILLATIONS)
def test_oscillations_have_the_names_that_an_engineer_gives_them(kind, seed):
    _, found = found_of(kind, seed)
    oscillating = {mode.name for mode in found if mode.damped_frequency}
    overdamped = {mode.name.partition(", overdamped")[0] for mode in found if "overdamped" in mode.name}
    assert oscillating | overdamped == OSCILLATIONS[kind]
    assert len({mode.name for mode in found}) == len(found)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", RATIONAL)
def test_modes_and_their_conjugates_are_the_eigenvalues_of_the_assembled_matrix(kind, seed):
    plain, found = found_of(kind, seed)
    poles = np.array([mode.pole for mode in found])
    poles = np.append(poles, np.conj(poles[poles.imag > 0]))
    expected = np.linalg.eigvals(assembled.state_space(as_system(plain), plain.values).a)
    assert poles.size == expected.size
    apart = np.abs(np.subtract.outer(poles, expected))
    assert np.max(apart.min(axis=0) / np.abs(expected)) < 1e-6
    assert np.max(apart.min(axis=1) / np.abs(poles)) < 1e-6


def test_joints_relax_as_bodies_move_or_where_one_alone_does():
    _, found = found_of("front and rear differ", 0)
    assert {mode.name for mode in found if not mode.damped_frequency} == {
        f"{stage} damper joints relaxing, {end} bogie{motion}"
        for end in ("front", "rear")
        for stage, motion in (("secondary", ""), ("primary", ""), ("primary", " pitch"))
    }
    _, found = found_of("two coupled cars", 0)
    names = {mode.name.removeprefix("secondary damper joints relaxing, ") for mode in found if "secondary" in mode.name}
    assert names == {
        *("car bounce, in phase", "car pitch, cars in antiphase"),
        *("outer bogie of each car, cars in antiphase", "inner bogie of each car, cars in antiphase"),
    }
    _, found = found_of("three-axle bogies", 0)
    assert {mode.name for mode in found if "relaxing, middle" in mode.name} == {
        f"primary damper joints relaxing, middle wheelset of a bogie against the outer ones, bogies in {phase}"
        for phase in ("phase", "antiphase")
    }


# --- shapes: against the equations written out -------------------------------------------------------


def shapes_of(plain: Plain, found: tuple[Mode, ...]) -> np.ndarray:
    """Modes as q [modes, freedoms], angles in rad: a displacement over the leg in front, by its arm."""
    arms = {"b_c": -plain.values["pivot"], "b_front": -plain.values["axle"], "b_rear": -plain.values["axle"]}
    arms["b_c"] = -max(plain.values.get("end", 0.0), plain.values["pivot"])
    if "end" in plain.values:  # the coupler stands farther from the centre than the pivots, behind car a
        arms |= {"a_b_c": plain.values["end"], "b_b_c": -plain.values["end"]}
    scale = np.array([arms.get(name, arms.get(name[2:], 1.0)) for name in plain.freedoms])
    return np.array([[mode.displacements[name] for name in plain.freedoms] for mode in found]) / scale


def worst_residual(plain: Plain, found: tuple[Mode, ...]) -> float:
    """How far an undamped vehicle's modes are from solving (K - omega^2 M) q = 0, relative to the terms; 1: not."""
    legs, wheels = dense_rows(plain)
    masses = np.array([plain.values[inertia] for inertia in plain.freedoms.values()])
    stiffness = np.zeros((masses.size, masses.size))
    tops = [*plain.legs, *((name, on, kind, names) for name, on, kind, names, _ in plain.wheels)]
    for row, (*_, kind, names) in zip((*legs, *wheels), tops, strict=True):
        stiffness += np.real(KINDS[kind][0](0.0, *(plain.values[name] for name in names))) * np.outer(row, row)
    worst = 0.0
    for mode, q in zip(found, shapes_of(plain, found), strict=True):
        inertia = mode.pole.imag**2 * masses * q
        size = np.sqrt(np.abs(q) @ np.abs(inertia)) * np.sqrt(mode.pole.imag**2 * masses)
        worst = max(worst, float(np.max(np.abs(stiffness @ q - inertia) / size)))
    return worst


UNDAMPED = ("the paper's", "front and rear differ", "three-axle bogies", "two bending modes", "two coupled cars")


@pytest.mark.parametrize("kind", UNDAMPED)
def test_shapes_solve_the_equations_of_motion_and_are_orthogonal_each_told_once(kind):
    plain, found = found_of(kind, 1, undamped=True)
    assert len(found) == len(plain.freedoms)
    assert all(mode.damping_ratio == 0 for mode in found)
    assert worst_residual(plain, found) < 1e-10
    q = shapes_of(plain, found)
    masses = np.array([plain.values[inertia] for inertia in plain.freedoms.values()])
    gram = (q * masses) @ q.T
    size = np.sqrt(np.diag(gram))
    np.testing.assert_allclose(gram / np.outer(size, size), np.eye(len(found)), atol=1e-9)


def wrongly_told(found: tuple[Mode, ...]) -> list[str]:
    """Names of modes of a vehicle on two bogies whose phases are not those of their displacements."""
    wrong = []
    for mode in found:
        x = mode.displacements
        part = mode.name.partition(",")[0]
        pairs = {"bogie bounce": ("z_front", "z_rear"), "bogie pitch": ("b_front", "b_rear")}
        bogies = pairs.get(part, ("z_w1", "z_w3" if len(x) == 10 else "z_w4"))
        if part.startswith("car") or not mode.displacements:
            continue
        right = (x[bogies[0]] * x[bogies[1]] > 0) == ("antiphase" not in mode.name)
        if "wheelset" in part:
            right &= (x["z_w1"] * x["z_w2"] > 0) == ("opposed" not in part and "middle" not in part)
        if not right:
            wrong.append(mode.name)
    return wrong


@pytest.mark.parametrize("kind", ["the paper's", "pivots off centre"])
def test_the_phases_told_are_those_of_the_displacements(kind):
    for seed in range(5):
        assert wrongly_told(found_of(kind, seed)[1]) == []


def test_a_rear_bogie_turned_over_is_seen_by_the_equations_and_phases_made_equal_by_the_names(monkeypatch):
    """Faults put into the shape and into the words."""
    true = the_modes._moved

    def turned(*given):
        moved = true(*given)
        turn = np.where([f.name in ("z_rear", "b_rear") for f in given[0].freedoms], -1.0, 1.0)
        return replace(moved, displacement=moved.displacement * turn[:, None])

    with monkeypatch.context() as patch:
        patch.setattr(the_modes, "_moved", turned)
        plain, found = found_of("the paper's", 1, undamped=True)
        assert worst_residual(plain, found) > 0.1
    with monkeypatch.context() as patch:
        patch.setattr(phases, "_pattern", lambda amplitudes: (1,) * len(amplitudes))
        _, found = found_of("the paper's", 1)
        assert wrongly_told(found) != []
        assert "bogie bounce, in antiphase" not in {mode.name for mode in found}
    with monkeypatch.context() as patch:  # equal blocks told one by one: no bogie is in phase with the other
        patch.setattr(the_modes, "_combinations", lambda anatomy, copies: list(np.eye(len(copies))))
        _, found = found_of("the paper's", 1)
        assert {"front bogie pitch", "rear bogie pitch"} <= {mode.name for mode in found}


def test_shapes_count_an_angle_by_the_displacement_over_the_farthest_leg(paper_vehicle):
    pitch = next(mode for mode in modes(paper_vehicle) if mode.name == "car pitch")
    x = pitch.displacements
    assert x["beta_c"] == 1.0  # -L_c beta_c, over the front bogie
    assert x["z_t1"] == pytest.approx(-x["z_t2"])
    assert x["z_t1"] == pitch.shape["bogie"]
    assert x["z_c"] == x["beta_t1"] == 0.0


def test_a_system_without_words_is_told_by_its_names():
    """A mass on a wheel: two freedoms, a leg with a joint."""
    leg = Parallel((Spring("k"), Series((Spring("joint"), Dashpot("c")))))
    system = System(
        (Freedom("box", "m"), Freedom("wheel", "w")),
        (Leg("leg", {"box": 1.0, "wheel": -1.0}, leg),),
        (Wheel("contact", {"wheel": 1.0}, Spring("hertz"), 0.0),),
    )
    values = {"m": 4e3, "w": 1e3, "k": 5e5, "joint": 5e6, "c": 1e4, "hertz": 1e9}
    box, wheel, relaxing = system_modes(system, values)
    assert [box.name, wheel.name, relaxing.name] == ["box", "wheel", "leg relaxing"]
    assert box.shape["box"] == 1.0
    assert relaxing.shape == {}


def test_numbers_that_overflow_are_told(paper_vehicle):
    with pytest.raises(InputError, match="too far apart"):
        modes(replace(paper_vehicle, car_body_mass=1e300, wheelset_mass=1e-300))
