"""What several test modules share: random vehicles, and references that take none of the package's short cuts.

The references start from the assembled half vehicle (`system_response`, `state_space`), add the four
wheels' lags one by one before any modulus, and integrate by rules of their own (`independent`, which knows nothing of
the package). `from_chains` goes through the chains that `tests.chains` derives by hand; none goes through the blocks,
columns and panels that the package computes with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from freqrail.model.equations import state_space, system_response
from freqrail.model.responses import RESPONSES
from freqrail.model.spectrum import RationalSpectrum
from freqrail.model.vehicle import DEGREES_OF_FREEDOM, Vehicle, half_vehicle
from freqrail.solver import block_residues, solve
from freqrail.solver.problem import Problem, half_vehicle_problem
from freqrail.solver.quadrature import MeanSquare
from freqrail.solver.resonances import resonances
from tests.chains import FAMILIES, chain_responses, track_response
from tests.independent import density, lagged, lags, outputs_of, read_off, reference_nodes, whole_axis_rms

INDEX = {name: place for place, name in enumerate(DEGREES_OF_FREEDOM)}
PAPER_NAMES = tuple(RESPONSES)[:4]
ALL_NAMES = tuple(RESPONSES)


def random_vehicle(rng: np.random.Generator, joints: tuple[float, float] = (0.5e6, 100e6)) -> Vehicle:
    """A plausible half vehicle: masses, springs and dampers up to three times larger or smaller than the paper's.

    Joint stiffnesses lie between `joints` (N/m), log-uniform: Table I's range unless given.
    """

    def about(value: float, factor: float = 3.0) -> float:
        return float(value * factor ** rng.uniform(-1, 1))

    def joint() -> float:
        return float(np.exp(rng.uniform(*np.log(joints))))

    wheelbase = about(1.0, 1.4)
    return Vehicle(
        car_body_mass=about(15200),
        car_body_pitch_inertia=about(500e3),
        bogie_mass=about(1000, 2.0),
        bogie_pitch_inertia=about(700, 2.0),
        wheelset_mass=about(700, 1.5),
        primary_stiffness=about(875e3),
        primary_damping=about(17e3),
        primary_joint_stiffness=joint(),
        secondary_stiffness=about(412e3),
        secondary_damping=about(54e3),
        secondary_joint_stiffness=joint(),
        half_bogie_spacing=about(6.0, 1.8),
        half_wheelbase=wheelbase,
        contact_stiffness=about(1.05e9, 1.5),
    )


def random_vehicles(count: int, seed: int, **kwargs: tuple[float, float]) -> list[Vehicle]:
    """`count` random vehicles, the same ones in every run."""
    rng = np.random.default_rng(seed)
    return [random_vehicle(rng, **kwargs) for _ in range(count)]


VEHICLES = random_vehicles(4, seed=11)
MODELS = {
    **{f"random {k}": vehicle for k, vehicle in enumerate(VEHICLES)},
    "traditional": VEHICLES[0].traditional(),
    "primary rigid": replace(VEHICLES[1], primary_joint_stiffness=np.inf),
    "secondary undamped": replace(VEHICLES[2], secondary_damping=0.0),
}
"""Half vehicles of all kinds, by name."""


def explicit_responses(
    vehicle: Vehicle, omega: np.ndarray, speed: float, names: tuple[str, ...] = ALL_NAMES
) -> dict[str, np.ndarray]:
    """T per metre of track under the first wheel, from equations of motion: {name: [positions, n]}."""
    q = lagged(system_response(half_vehicle(vehicle), omega), vehicle, omega, speed)
    return {name: read_off(name, vehicle, q, 1j * omega) for name in names}


def from_chains(
    vehicle: Vehicle, omega: np.ndarray, speed: float, names: tuple[str, ...] = ALL_NAMES
) -> dict[str, np.ndarray]:
    """The same from the chains, for references that need only an integral of their own.

    test_chains holds the chains to `explicit_responses`; they keep more digits and take a tenth of the time.
    """
    chains = chain_responses(vehicle, omega)
    return {name: track_response(FAMILIES[name], vehicle, omega, speed, chains) for name in names}


def all_poles(vehicle: Vehicle, spectrum: RationalSpectrum, speed: float) -> np.ndarray:
    """Eigenvalues of the assembled state matrix, and the poles -v Omega_r and -v Omega_c of the track."""
    return np.append(
        np.linalg.eigvals(state_space(half_vehicle(vehicle)).a), -speed * np.array(spectrum.cutoffs, dtype=complex)
    )


def reference_rms(
    vehicle: Vehicle,
    spectrum: RationalSpectrum,
    speed: float,
    low: float,
    high: float,
    names: tuple[str, ...] = PAPER_NAMES,
    transfer: Callable[..., dict[str, np.ndarray]] = explicit_responses,
    nodes: int = 20,
) -> dict[str, np.ndarray]:
    """RMS over [low, high] rad/s, {name: [positions]}: |T|^2 G with lags added one by one, own quadrature."""
    omega, weights = reference_nodes(low, high, all_poles(vehicle, spectrum, speed), lags(vehicle, speed)[-1], nodes)
    responses = transfer(vehicle, omega, speed, names)
    weighted = density(spectrum, omega, speed) * weights
    return {name: np.sqrt(np.abs(t) ** 2 @ weighted) for name, t in responses.items()}


def output_matrices(vehicle: Vehicle) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """C and D of y = C x + D v for every response, from the package's state equations: {name: [positions, ...]}."""
    model = state_space(half_vehicle(vehicle))
    return outputs_of(vehicle, model.a, model.b, ALL_NAMES)


def residue_rms(vehicle: Vehicle, spectrum: RationalSpectrum, speed: float) -> dict[str, np.ndarray]:
    """RMS over the whole axis, {name: [positions]}, in closed form from the package's state matrices."""
    model = state_space(half_vehicle(vehicle))
    return whole_axis_rms(vehicle, model.a, model.b, spectrum, speed, ALL_NAMES)


def whole_axis_mean_squares(
    vehicle: Vehicle, names: tuple[str, ...], spectrum: RationalSpectrum, speed: np.ndarray
) -> dict[str, MeanSquare]:
    """The package's closed form for a half vehicle or a grid of them, whatever its estimates say."""
    study = half_vehicle_problem(vehicle, speed, spectrum, None, names)
    return block_residues.whole_axis_mean_squares(study.reduction, study.values, spectrum, speed)


def own_quadrature(study: Problem, index: tuple[int, ...] = ()) -> dict[str, MeanSquare]:
    """What the package makes of one vehicle of a grid with nodes placed for it alone: [labels, speeds]."""
    alone = study.at(index)
    return solve._own_quadrature(alone, resonances(alone.reduction, alone.values))
