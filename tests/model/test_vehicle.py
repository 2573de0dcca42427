"""The assembled vehicle against the paper's equations, written out term by term, and against mechanics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from freqrail.model.equations import leg_dynamic_stiffness, state_space, stiffness_matrices, system_response
from freqrail.model.vehicle import Vehicle, half_vehicle, hertzian_contact_stiffness, static_wheel_load
from tests.chains import CHAINS, chain_system, ladder, poles
from tests.helpers import INDEX, random_vehicles

VEHICLES = random_vehicles(5, seed=1)
IDS = [f"random vehicle {k}" for k in range(len(VEHICLES))]
every_vehicle = pytest.mark.parametrize("vehicle", VEHICLES, ids=IDS)

PAPER_STATES = [
    *("dz_c/dt", "dbeta_c/dt", "dz_t1/dt", "dbeta_t1/dt", "dz_w1/dt", "dz_w2/dt"),
    *("dz_t2/dt", "dbeta_t2/dt", "dz_w3/dt", "dz_w4/dt"),
    *("Delta_secondary_1", "Delta_secondary_2", "Delta_primary_1", "Delta_primary_2"),
    *("Delta_primary_3", "Delta_primary_4"),
    *("z_c", "beta_c", "z_t1", "beta_t1", "z_w1", "z_w2", "z_t2", "beta_t2", "z_w3", "z_w4"),
]


# --- the paper's equations, in the paper's own terms -------------------------------------------------


def damper_ends(vehicle: Vehicle, q: np.ndarray, delta: np.ndarray) -> dict[str, float]:
    """Eq. (8): the heights of the dampers' ends, z_sd1..4 and z_pd1..8."""
    L_c, L_t = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    z_c, beta_c, z_t1, beta_t1, z_w1, z_w2, z_t2, beta_t2, z_w3, z_w4 = q
    D_s1, D_s2, D_p1, D_p2, D_p3, D_p4 = delta
    return {
        "sd1": 0.5 * (z_c - L_c * beta_c + z_t1 + D_s1),
        "sd2": 0.5 * (z_c - L_c * beta_c + z_t1 - D_s1),
        "sd3": 0.5 * (z_c + L_c * beta_c + z_t2 + D_s2),
        "sd4": 0.5 * (z_c + L_c * beta_c + z_t2 - D_s2),
        "pd1": 0.5 * (z_t1 - L_t * beta_t1 + z_w1 + D_p1),
        "pd2": 0.5 * (z_t1 - L_t * beta_t1 + z_w1 - D_p1),
        "pd3": 0.5 * (z_t1 + L_t * beta_t1 + z_w2 + D_p2),
        "pd4": 0.5 * (z_t1 + L_t * beta_t1 + z_w2 - D_p2),
        "pd5": 0.5 * (z_t2 - L_t * beta_t2 + z_w3 + D_p3),
        "pd6": 0.5 * (z_t2 - L_t * beta_t2 + z_w3 - D_p3),
        "pd7": 0.5 * (z_t2 + L_t * beta_t2 + z_w4 + D_p4),
        "pd8": 0.5 * (z_t2 + L_t * beta_t2 + z_w4 - D_p4),
    }


def accelerations(
    vehicle: Vehicle, q: np.ndarray, delta: np.ndarray, v: np.ndarray, as_printed: bool = False
) -> np.ndarray:
    """Eqs. (3) to (5): the ten accelerations. `as_printed` keeps eq. (4)'s two signs that are wrong in print."""
    M_c, J_c, M_t, J_t, M_w = (
        vehicle.car_body_mass,
        vehicle.car_body_pitch_inertia,
        vehicle.bogie_mass,
        vehicle.bogie_pitch_inertia,
        vehicle.wheelset_mass,
    )
    K_p, K_pd = vehicle.primary_stiffness, vehicle.primary_joint_stiffness
    K_s, K_sd = vehicle.secondary_stiffness, vehicle.secondary_joint_stiffness
    K_H, L_c, L_t = vehicle.contact_stiffness, vehicle.half_bogie_spacing, vehicle.half_wheelbase
    z_c, beta_c, z_t1, beta_t1, z_w1, z_w2, z_t2, beta_t2, z_w3, z_w4 = q
    z_v1, z_v2, z_v3, z_v4 = v
    z = damper_ends(vehicle, q, delta)
    slip = +1 if as_printed else -1
    return np.array(
        [
            # eq. (3), car body bounce
            (
                -K_s * (z_c - z_t1 - L_c * beta_c)
                - K_sd * (z_c - z["sd1"] - L_c * beta_c)
                - K_s * (z_c - z_t2 + L_c * beta_c)
                - K_sd * (z_c - z["sd3"] + L_c * beta_c)
            )
            / M_c,
            # eq. (3), car body pitch
            (
                (K_s * (z_c - z_t1 - L_c * beta_c) + K_sd * (z_c - z["sd1"] - L_c * beta_c)) * L_c
                - (K_s * (z_c - z_t2 + L_c * beta_c) + K_sd * (z_c - z["sd3"] + L_c * beta_c)) * L_c
            )
            / J_c,
            # eq. (4), front bogie bounce: the first slip
            (
                -K_s * (z_t1 + L_c * beta_c - z_c)
                + slip * K_sd * (z_t1 - z["sd2"])
                - K_p * (z_t1 - z_w1 - L_t * beta_t1)
                - K_pd * (z_t1 - z["pd1"] - L_t * beta_t1)
                - K_p * (z_t1 - z_w2 + L_t * beta_t1)
                - K_pd * (z_t1 - z["pd3"] + L_t * beta_t1)
            )
            / M_t,
            # eq. (4), front bogie pitch
            (
                (K_p * (z_t1 - z_w1 - L_t * beta_t1) + K_pd * (z_t1 - z["pd1"] - L_t * beta_t1)) * L_t
                - (K_p * (z_t1 - z_w2 + L_t * beta_t1) + K_pd * (z_t1 - z["pd3"] + L_t * beta_t1)) * L_t
            )
            / J_t,
            # eq. (5), wheelsets 1 and 2
            (-K_p * (z_w1 - z_t1 + L_t * beta_t1) - K_pd * (z_w1 - z["pd2"]) - K_H * (z_w1 - z_v1)) / M_w,
            (-K_p * (z_w2 - z_t1 - L_t * beta_t1) - K_pd * (z_w2 - z["pd4"]) - K_H * (z_w2 - z_v2)) / M_w,
            # eq. (4), rear bogie bounce: the second slip
            (
                -K_s * (z_t2 - z_c - L_c * beta_c)
                - K_sd * (z_t2 - z["sd4"])
                - K_p * (z_t2 - L_t * beta_t2 - z_w3)
                - K_pd * (z_t2 - L_t * beta_t2 - z["pd5"])
                - K_p * (z_t2 + L_t * beta_t2 - z_w4)
                + slip * K_pd * (z_t2 + L_t * beta_t2 - z["pd7"])
            )
            / M_t,
            # eq. (4), rear bogie pitch
            (
                (K_p * (z_t2 - L_t * beta_t2 - z_w3) + K_pd * (z_t2 - L_t * beta_t2 - z["pd5"])) * L_t
                - (K_p * (z_t2 + L_t * beta_t2 - z_w4) + K_pd * (z_t2 + L_t * beta_t2 - z["pd7"])) * L_t
            )
            / J_t,
            # eq. (5), wheelsets 3 and 4
            (-K_p * (z_w3 - z_t2 + L_t * beta_t2) - K_pd * (z_w3 - z["pd6"]) - K_H * (z_w3 - z_v3)) / M_w,
            (-K_p * (z_w4 - z_t2 - L_t * beta_t2) - K_pd * (z_w4 - z["pd8"]) - K_H * (z_w4 - z_v4)) / M_w,
        ]
    )


def damper_rates(vehicle: Vehicle, q: np.ndarray, delta: np.ndarray, end: str) -> np.ndarray:
    """Eqs. (6) and (7): dDelta/dt of secondary 1, 2 and primary 1 to 4, from the balance of each damper's `end`."""
    L_c, L_t = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    s, p = (
        vehicle.secondary_joint_stiffness / vehicle.secondary_damping,
        vehicle.primary_joint_stiffness / vehicle.primary_damping,
    )
    z_c, beta_c, z_t1, beta_t1, z_w1, z_w2, z_t2, beta_t2, z_w3, z_w4 = q
    z = damper_ends(vehicle, q, delta)
    if end == "upper":
        return np.array(
            [
                -s * (z["sd1"] - z_c + L_c * beta_c),
                -s * (z["sd3"] - z_c - L_c * beta_c),
                -p * (z["pd1"] - z_t1 + L_t * beta_t1),
                -p * (z["pd3"] - z_t1 - L_t * beta_t1),
                -p * (z["pd5"] - z_t2 + L_t * beta_t2),
                -p * (z["pd7"] - z_t2 - L_t * beta_t2),
            ]
        )
    return np.array(
        [
            s * (z["sd2"] - z_t1),
            s * (z["sd4"] - z_t2),
            p * (z["pd2"] - z_w1),
            p * (z["pd4"] - z_w2),
            p * (z["pd6"] - z_w3),
            p * (z["pd8"] - z_w4),
        ]
    )


def traditional_accelerations(vehicle: Vehicle, q: np.ndarray, dq: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Fig. 1: the same bodies with every spring beside a damper on rigid ends."""
    K_p, C_p = vehicle.primary_stiffness, vehicle.primary_damping
    K_s, C_s = vehicle.secondary_stiffness, vehicle.secondary_damping
    K_H, L_c, L_t = vehicle.contact_stiffness, vehicle.half_bogie_spacing, vehicle.half_wheelbase
    z_c, b_c, z_t1, b_t1, z_w1, z_w2, z_t2, b_t2, z_w3, z_w4 = q
    dz_c, db_c, dz_t1, db_t1, dz_w1, dz_w2, dz_t2, db_t2, dz_w3, dz_w4 = dq
    # each leg's force, which pulls its upper end down and its lower end up
    F_s1 = K_s * (z_c - L_c * b_c - z_t1) + C_s * (dz_c - L_c * db_c - dz_t1)
    F_s2 = K_s * (z_c + L_c * b_c - z_t2) + C_s * (dz_c + L_c * db_c - dz_t2)
    F_p1 = K_p * (z_t1 - L_t * b_t1 - z_w1) + C_p * (dz_t1 - L_t * db_t1 - dz_w1)
    F_p2 = K_p * (z_t1 + L_t * b_t1 - z_w2) + C_p * (dz_t1 + L_t * db_t1 - dz_w2)
    F_p3 = K_p * (z_t2 - L_t * b_t2 - z_w3) + C_p * (dz_t2 - L_t * db_t2 - dz_w3)
    F_p4 = K_p * (z_t2 + L_t * b_t2 - z_w4) + C_p * (dz_t2 + L_t * db_t2 - dz_w4)
    return np.array(
        [
            (-F_s1 - F_s2) / vehicle.car_body_mass,
            (F_s1 - F_s2) * L_c / vehicle.car_body_pitch_inertia,
            (F_s1 - F_p1 - F_p2) / vehicle.bogie_mass,
            (F_p1 - F_p2) * L_t / vehicle.bogie_pitch_inertia,
            (F_p1 + K_H * (v[0] - z_w1)) / vehicle.wheelset_mass,
            (F_p2 + K_H * (v[1] - z_w2)) / vehicle.wheelset_mass,
            (F_s2 - F_p3 - F_p4) / vehicle.bogie_mass,
            (F_p3 - F_p4) * L_t / vehicle.bogie_pitch_inertia,
            (F_p3 + K_H * (v[2] - z_w3)) / vehicle.wheelset_mass,
            (F_p4 + K_H * (v[3] - z_w4)) / vehicle.wheelset_mass,
        ]
    )


def random_state(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=10), rng.normal(size=10), rng.normal(size=6), rng.normal(size=4)


def derivative(vehicle: Vehicle, x: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(A x + B v, what each row loses to rounding)."""
    model = state_space(half_vehicle(vehicle))
    return model.a @ x + model.b @ v, 1e-13 * (np.abs(model.a) @ np.abs(x) + np.abs(model.b) @ np.abs(v))


@every_vehicle
@pytest.mark.parametrize("end", ["upper", "lower"])
def test_assembled_system_is_the_papers_equations_with_two_signs_corrected(vehicle, end):
    for seed in range(5):
        q, dq, delta, v = random_state(seed)
        found, loss = derivative(vehicle, np.concatenate([dq, delta, q]), v)
        expected = np.concatenate([accelerations(vehicle, q, delta, v), damper_rates(vehicle, q, delta, end), dq])
        assert np.all(np.abs(found - expected) <= loss)


@every_vehicle
def test_signs_as_printed_in_equation_4_do_not_agree(vehicle):
    q, dq, delta, v = random_state(0)
    found, loss = derivative(vehicle, np.concatenate([dq, delta, q]), v)
    wrong = np.abs(found[:10] - accelerations(vehicle, q, delta, v, as_printed=True)) > 1e3 * loss[:10]
    assert [name for name in INDEX if wrong[INDEX[name]]] == ["z_t1", "z_t2"]


@every_vehicle
def test_stiffness_is_symmetric_only_with_the_corrected_signs(vehicle):
    inertia = np.array(half_vehicle(vehicle).inertia)

    def stiffness(as_printed: bool) -> np.ndarray:
        columns = [accelerations(vehicle, unit, np.zeros(6), np.zeros(4), as_printed) for unit in np.eye(10)]
        return -inertia[:, None] * np.array(columns).T

    corrected, printed = stiffness(False), stiffness(True)
    scale = np.sqrt(np.outer(np.diag(corrected), np.diag(corrected)))
    assert np.max(np.abs(corrected - corrected.T) / scale) < 1e-14
    assert np.max(np.abs(printed - printed.T) / scale) > 1e-3


@every_vehicle
def test_action_and_reaction_cancel_only_with_the_corrected_signs(vehicle):
    """What the suspension does to the bodies sums to nothing: only the rail's force is left."""
    q, _, delta, v = random_state(3)
    inertia = np.array(half_vehicle(vehicle).inertia)
    bodies = [INDEX[name] for name in INDEX if name.startswith("z_")]
    wheels = [INDEX[name] for name in INDEX if name.startswith("z_w")]
    rail = np.sum(vehicle.contact_stiffness * (v - q[wheels]))

    def sum_of_forces(as_printed: bool) -> float:
        return float(np.sum((inertia * accelerations(vehicle, q, delta, v, as_printed))[bodies]))

    loss = 1e-13 * vehicle.contact_stiffness * np.sum(np.abs(v - q[wheels]))
    assert abs(sum_of_forces(False) - rail) < loss
    assert abs(sum_of_forces(True) - rail) > 1e3 * loss


@every_vehicle
def test_traditional_system_is_figure_1_written_out(vehicle):
    rigid = vehicle.traditional()
    for seed in range(5):
        q, dq, _, v = random_state(seed)
        found, loss = derivative(rigid, np.concatenate([dq, q]), v)
        expected = np.concatenate([traditional_accelerations(rigid, q, dq, v), dq])
        assert np.all(np.abs(found - expected) <= loss)


def test_state_order_is_the_papers(paper_vehicle):
    assert list(state_space(half_vehicle(paper_vehicle)).states) == PAPER_STATES
    rigid = [state for state in PAPER_STATES if not state.startswith("Delta")]
    assert list(state_space(half_vehicle(paper_vehicle.traditional())).states) == rigid


@pytest.mark.parametrize(
    ("change", "size"),
    [
        ({}, 26),
        ({"primary_joint_stiffness": np.inf}, 22),
        ({"secondary_joint_stiffness": np.inf}, 24),
        ({"primary_joint_stiffness": np.inf, "secondary_joint_stiffness": np.inf}, 20),
        ({"primary_damping": 0.0}, 22),  # a damper that does not damp has no elongation of its own to track
        ({"secondary_damping": 0.0}, 24),
    ],
)
def test_one_state_for_every_damper_between_finite_joints(paper_vehicle, change, size):
    model = state_space(half_vehicle(replace(paper_vehicle, **change)))
    assert model.a.shape == (size, size)
    assert model.b.shape == (size, 4)
    assert len(model.states) == size


# --- one suspension leg ------------------------------------------------------------------------------


@every_vehicle
def test_a_leg_is_a_spring_beside_joint_damper_and_joint_in_series(vehicle):
    k, c, joint = vehicle.primary_stiffness, vehicle.primary_damping, vehicle.primary_joint_stiffness
    s = 2j * np.pi * np.geomspace(0.01, 1000, 30)
    in_series = 1 / (1 / joint + 1 / (c * s) + 1 / joint)
    np.testing.assert_allclose(leg_dynamic_stiffness(k, c, joint, s), k + in_series, rtol=1e-13)
    np.testing.assert_allclose(leg_dynamic_stiffness(k, c, np.inf, s), k + c * s, rtol=1e-13)


def test_one_leg_may_differ_from_its_neighbours(paper_vehicle):
    """Removing half the front secondary damper changes the response by what a single leg can change.

    The new force acts along that leg alone, so the change is one column (where the leg pushes) times one
    row: the leg's own elongation under each wheel's track, whatever else the system is made of.
    """
    alike = half_vehicle(paper_vehicle)
    front, *others = alike.legs
    uneven = replace(alike, legs=(replace(front, damping=front.damping / 2), *others))
    omega = 2 * np.pi * np.geomspace(0.3, 30, 20)
    before, after = system_response(alike, omega), system_response(uneven, omega)
    change = after - before
    elongation = np.einsum("f,nfw->nw", front.elongation, before)
    column = change[:, :, :1] / elongation[:, None, :1]
    np.testing.assert_allclose(change, column * elongation[:, None, :], rtol=1e-6, atol=1e-9)
    assert np.all(np.max(np.abs(change), axis=(1, 2)) > 1e-3)


def test_uneven_legs_break_the_mirror_between_front_and_rear(paper_vehicle):
    alike = half_vehicle(paper_vehicle)
    front, *others = alike.legs
    uneven = replace(alike, legs=(replace(front, damping=front.damping / 2), *others))
    omega = 2 * np.pi * np.geomspace(0.3, 30, 20)

    def asymmetry(system) -> float:
        """Front bogie under wheel 1 against rear bogie under wheel 4."""
        q = system_response(system, omega)
        return float(np.max(np.abs(q[:, INDEX["z_t1"], 0] - q[:, INDEX["z_t2"], 3])))

    assert asymmetry(alike) < 1e-12
    assert asymmetry(uneven) > 1e-2


def test_uneven_legs_have_the_same_response_in_state_space(paper_vehicle):
    alike = half_vehicle(paper_vehicle)
    legs = [
        replace(leg, stiffness=leg.stiffness * (1 + 0.1 * k), damping=leg.damping * (1 + 0.2 * k))
        for k, leg in enumerate(alike.legs)
    ]
    legs[2] = replace(legs[2], joint_stiffness=np.inf)
    legs[3] = replace(legs[3], damping=0.0)
    uneven = replace(alike, legs=tuple(legs))
    model = state_space(uneven)
    assert model.a.shape == (24, 24)
    omega = 2 * np.pi * np.geomspace(0.1, 300, 40)
    identity = np.eye(24)
    expected = np.array([np.linalg.solve(1j * w * identity - model.a, model.b)[-10:] for w in omega])
    np.testing.assert_allclose(system_response(uneven, omega), expected, rtol=1e-9, atol=1e-12)


# --- mechanics ---------------------------------------------------------------------------------------


@every_vehicle
def test_stiffness_of_the_assembled_system_is_symmetric_and_positive(vehicle):
    _, stiffness, _ = stiffness_matrices(half_vehicle(vehicle))
    scale = np.sqrt(np.outer(np.diag(stiffness), np.diag(stiffness)))
    assert np.max(np.abs(stiffness - stiffness.T) / scale) < 1e-14
    assert np.all(np.linalg.eigvalsh(stiffness / scale) > 0)


def rigid_motions(vehicle: Vehicle) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Motions of everything as one rigid body with the track along: {name: (q, v)}."""
    a, b = vehicle.half_bogie_spacing, vehicle.half_wheelbase
    lift = np.array([name.startswith("z_") for name in INDEX], dtype=float)
    # nose down by one radian: heights fall with the distance ahead of the centre
    along = {"z_t1": a, "z_t2": -a, "z_w1": a + b, "z_w2": a - b, "z_w3": b - a, "z_w4": -a - b}
    pitch = np.array([1.0 if name.startswith("beta") else -along.get(name, 0.0) for name in INDEX])
    wheels = [INDEX[f"z_w{i}"] for i in (1, 2, 3, 4)]
    return {"lift": (lift, lift[wheels]), "pitch": (pitch, pitch[wheels])}


@every_vehicle
@pytest.mark.parametrize("motion", ["lift", "pitch"])
@pytest.mark.parametrize("model", ["joints", "traditional"])
def test_rigid_motion_with_the_track_costs_no_force(vehicle, motion, model):
    vehicle = vehicle if model == "joints" else vehicle.traditional()
    system = half_vehicle(vehicle)
    q, v = rigid_motions(vehicle)[motion]
    _, stiffness, coupling = stiffness_matrices(system)
    assert np.all(np.abs(stiffness @ q - coupling @ v) <= 1e-13 * (np.abs(stiffness) @ np.abs(q)))
    space = state_space(system)
    states = space.a.shape[0]
    displaced, moving = np.zeros(states), np.zeros(states)
    displaced[-10:] = q
    moving[:10] = q
    # at rest after such a displacement; and moving so steadily strains no damper
    assert np.all(np.abs(space.a @ displaced + space.b @ v) <= 1e-13 * (np.abs(space.a) @ np.abs(displaced)))
    strain = (space.a @ moving)[:-10]
    assert np.all(np.abs(strain) <= 1e-13 * (np.abs(space.a) @ np.abs(moving))[:-10])


@every_vehicle
@pytest.mark.parametrize("model", ["joints", "traditional"])
def test_energy_is_lost_in_the_dampers_and_nowhere_else(vehicle, model):
    """d/dt (kinetic + spring + joint energy) = - sum of c (damper rate)^2 on a track at rest."""
    vehicle = vehicle if model == "joints" else vehicle.traditional()
    system = half_vehicle(vehicle)
    mass, stiffness, _ = stiffness_matrices(system)
    a = state_space(system).a
    rng = np.random.default_rng(7)
    x = rng.normal(size=a.shape[0])
    rate = a @ x
    dq, q = x[:10], x[-10:]
    power = dq @ mass @ rate[:10] + q @ stiffness @ rate[-10:]
    size = np.abs(dq) @ np.abs(mass @ rate[:10]) + np.abs(q) @ np.abs(stiffness @ rate[-10:])
    loss = 0.0
    for k, leg in enumerate(system.legs):
        e, de = np.dot(leg.elongation, q), np.dot(leg.elongation, dq)
        if model == "joints":
            delta, ddelta = x[10 + k], rate[10 + k]
            term = leg.joint_stiffness / 2 * (e - delta) * (de - ddelta)
            power, size = power + term, size + abs(term)
            loss += leg.damping * ddelta**2
        else:
            loss += leg.damping * de**2
    assert loss > 0
    assert abs(power + loss) < 1e-12 * size


# --- poles -------------------------------------------------------------------------------------------


def distance(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Relative distances of two sets of as many poles, each matched with its own."""
    apart = np.abs(found[:, None] - expected) / np.abs(expected)
    return apart[linear_sum_assignment(apart)]


@every_vehicle
@pytest.mark.parametrize("model", ["joints", "traditional", "primary rigid"])
def test_poles_are_the_eigenvalues_of_the_assembled_matrix(vehicle, model):
    """The bogie-pitch poles stand twice in the assembled matrix, front and rear, and once in `poles`."""
    vehicle = {
        "joints": vehicle,
        "traditional": vehicle.traditional(),
        "primary rigid": replace(vehicle, primary_joint_stiffness=np.inf),
    }[model]
    assembled = np.linalg.eigvals(state_space(half_vehicle(vehicle)).a)
    bogie_pitch = np.linalg.eigvals(state_space(chain_system(vehicle, "bogie_pitch")).a)
    assert poles(vehicle).size == assembled.size - bogie_pitch.size
    assert np.max(distance(np.append(poles(vehicle), bogie_pitch), assembled)) < 1e-9


def test_every_random_vehicle_is_stable():
    for vehicle in random_vehicles(40, seed=2):
        assert np.all(np.linalg.eigvals(state_space(half_vehicle(vehicle)).a).real < 0)
        assert np.all(poles(vehicle).real < 0)


def test_wheelsets_ring_near_195_hz_as_the_theory_says(paper_vehicle):
    """docs/theory.md, "The rigid rail's resonance": damping ratios with joints of 5 and 0.5 MN/m, and traditional."""

    def ringing(joint: float) -> complex:
        vehicle = replace(paper_vehicle, primary_joint_stiffness=joint, secondary_joint_stiffness=joint)
        found = poles(vehicle)
        return min(found[found.imag > 2 * np.pi * 150], key=lambda p: abs(p.real / p.imag))

    for joint, ratio, decay in ((5e6, 1.4e-4, 5.7), (0.5e6, 1.4e-6, 566.0), (np.inf, 1e-2, None)):
        pole = ringing(joint)
        assert pole.imag / (2 * np.pi) == pytest.approx(195, abs=1)
        assert -pole.real / pole.imag == pytest.approx(ratio, rel=0.05, abs=0)
        if decay:
            assert -1 / pole.real == pytest.approx(decay, rel=0.01, abs=0)


STIFF = np.geomspace(1e8, 1e11, 7)


def slope(error: list[float]) -> float:
    return float(np.polyfit(np.log(STIFF), np.log(error), 1)[0])


@pytest.mark.parametrize("joint", ["primary_joint_stiffness", "secondary_joint_stiffness"])
def test_poles_converge_to_the_traditional_ones_like_one_over_the_joint_stiffness(paper_vehicle, joint):
    rigid = replace(paper_vehicle, **{joint: np.inf})
    target = poles(rigid)
    error = [
        np.max(np.min(np.abs(poles(replace(rigid, **{joint: k}))[:, None] - target), axis=0) / np.abs(target))
        for k in STIFF
    ]
    assert slope(error) == pytest.approx(-1, abs=0.03)


@pytest.mark.parametrize("joint", ["primary_joint_stiffness", "secondary_joint_stiffness"])
def test_responses_converge_to_the_traditional_ones_like_one_over_the_joint_stiffness(paper_vehicle, joint):
    omega = 2 * np.pi * np.geomspace(0.1, 100, 200)
    rigid = replace(paper_vehicle, **{joint: np.inf})
    target = system_response(half_vehicle(rigid), omega)
    error = [np.max(np.abs(system_response(half_vehicle(replace(rigid, **{joint: k})), omega) - target)) for k in STIFF]
    assert slope(error) == pytest.approx(-1, abs=0.03)


# --- constants of the paper's case -------------------------------------------------------------------


def test_static_wheel_load_of_the_papers_case():
    load = (15200 / 4 + 600 / 2 + 700) * 9.8
    assert static_wheel_load(15200.0, 600.0, 700.0) == pytest.approx(load, rel=1e-15, abs=0)
    assert static_wheel_load(15200.0, 600.0, 700.0) == pytest.approx(47040.0, rel=1e-15, abs=0)


def test_contact_stiffness_of_the_papers_case(paper_vehicle):
    conical, worn = 4.57e-8 * 0.43**-0.149, 3.86e-8 * 0.43**-0.115
    assert conical == pytest.approx(5.1824e-8, rel=1e-5, abs=0)
    assert hertzian_contact_stiffness(conical, 47040.0) == pytest.approx(1.0448e9, rel=5e-5, abs=0)
    assert hertzian_contact_stiffness(worn, 47040.0) == pytest.approx(1.2730e9, rel=5e-5, abs=0)
    assert paper_vehicle.contact_stiffness == pytest.approx(1.0448e9, rel=5e-5, abs=0)


def test_hertzian_spring_is_the_slope_of_hertz_law():
    """Approach delta = G P^(2/3): the spring at the static load is dP/d delta."""
    constant, load = 5e-8, 47040.0
    step = 1e-4 * load
    approach = constant * np.array([load - step, load + step]) ** (2 / 3)
    assert hertzian_contact_stiffness(constant, load) == pytest.approx(2 * step / np.diff(approach)[0], rel=1e-8, abs=0)


def test_an_unknown_chain_is_refused(paper_vehicle):
    assert [len(ladder(paper_vehicle, chain)[0]) for chain in CHAINS] == [3, 3, 2]
    with pytest.raises(ValueError, match="roll"):
        ladder(paper_vehicle, "roll")


# --- what a chain and a grid of vehicles consist of --------------------------------------------------


@pytest.mark.parametrize(
    ("chain", "freedoms", "rows"),
    [
        ("bounce", ("car", "bogie", "wheelset"), [(1, -1, 0), (0, 1, -1)]),
        ("pitch", ("car", "bogie", "wheelset"), [(1, -1, 0), (0, 1, -1)]),
        ("bogie_pitch", ("bogie", "wheelset"), [(1, -1)]),
    ],
)
def test_a_chain_hangs_body_under_body_on_its_legs_above_the_contact_spring(chain, freedoms, rows):
    system = chain_system(VEHICLES[0], chain)
    assert system.freedoms == freedoms
    assert [leg.elongation for leg in system.legs] == rows
    assert [leg.name for leg in system.legs] == ["secondary", "primary"][-len(rows) :]
    assert system.contacts == ((len(freedoms) - 1, VEHICLES[0].contact_stiffness),)


def test_a_column_of_vehicles_broadcasts_against_frequencies():
    grid = replace(VEHICLES[0], bogie_mass=np.array([600.0, 700.0, 800.0])).column()
    assert grid.bogie_mass.shape == (3, 1)
    assert grid.car_body_mass == VEHICLES[0].car_body_mass
    assert (grid.bogie_mass * np.ones(5)).shape == (3, 5)


@pytest.mark.parametrize("joint", [5e6, np.inf], ids=["joints", "rigid"])
def test_the_slightest_damper_acts(joint):
    """Half a newton second a metre: a state of its own behind joints, and damping of the modes."""
    slight, none = (
        replace(VEHICLES[0], primary_damping=c, secondary_damping=0.0, primary_joint_stiffness=joint) for c in (0.5, 0)
    )
    states = state_space(half_vehicle(slight)).states
    assert sum(state.startswith("Delta_primary") for state in states) == (4 if np.isfinite(joint) else 0)
    assert np.max(poles(slight).real) < -1e-8
    assert np.max(np.abs(poles(none).real)) < 1e-9


def test_a_vehicle_that_overflows_has_no_poles_where_it_does():
    """A wheelset of 1e-305 kg: its row of the matrix is not finite, the others are."""
    assert np.isnan(poles(replace(VEHICLES[0], wheelset_mass=1e-305))).all()
