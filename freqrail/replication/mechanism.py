"""Why joints change what they change, in numbers: stiffer dampers, a freed bogie, and the wheelbase that filters it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from freqrail.case.case import Case
from freqrail.model.band import Band, band_limits
from freqrail.model.spectrum import frequency_psd
from freqrail.model.vehicle import Vehicle
from freqrail.replication.claims import BOGIE, CAR, PAPER_POINT, PAPER_SPEED, PRIMARY, RESPONSE_NAMES
from freqrail.replication.judging import OTHER_JOINT, PLACES, read, scan
from freqrail.replication.yielding_rail import TYPICAL, Rail, response_rms, wheel_resonance
from freqrail.solver import solve
from freqrail.solver.modes import Mode, modes
from freqrail.solver.problem import half_vehicle_problem

NO_WHEELBASE = 1e-6  # m; what the bogie frame's bounce has of the wheelbase is the lag between its wheels alone


@dataclass(frozen=True)
class Stiffening:
    """What the paper's joints do to the secondary damper at the car body's bounce, and to the car body.

    frequency: of the car body's bounce, Hz. added: c^2 omega^2/kappa over K_s; exact: the same of the whole Re D - k.
    car: departure of the car body's RMS at the paper's point; springs: that of a traditional vehicle whose secondary
    springs alone are stiffer by `exact`.
    """

    frequency: float
    added: float
    exact: float
    car: float
    springs: float


@dataclass(frozen=True)
class Freed:
    """The bogie frame's bounce: slow and fast decay of the traditional model, 1/s, and the mode with joints."""

    rigid: tuple[float, float]
    joint: Mode


@dataclass(frozen=True)
class Filter:
    """The bogie frame's departure over speed for one primary joint, with and without the lag inside the bogie.

    joint: MN/m. departure, without_lag: (speed). bounce: frequency of the bogie frame's bounce, Hz. speed: of the
    smallest departure, km/h. cancelled: the frequency at which the bogie's two wheels cancel at that speed, Hz.
    """

    joint: float
    departure: xr.DataArray
    without_lag: xr.DataArray
    bounce: float
    speed: float
    cancelled: float


@dataclass(frozen=True)
class OnRail:
    """RMS of the paper's responses at its point on a rail, by name: with joints, and of the traditional model."""

    joint: dict[str, float]
    rigid: dict[str, float]

    def departure(self, name: str) -> float:
        """Relative difference that the joints make."""
        return self.joint[name] / self.rigid[name] - 1


@dataclass(frozen=True)
class Mechanism:
    """All of it.

    rail: the yielding one. resonance: natural frequency, Hz, and damping ratio of the wheelsets on it;
    rigid_resonance: on a rigid rail.
    """

    stiffening: Stiffening
    freed: Freed
    filters: tuple[Filter, ...]
    on_rigid: OnRail
    on_yielding: OnRail
    rail: Rail
    resonance: tuple[float, float]
    rigid_resonance: tuple[float, float]


def mechanism(exact: xr.Dataset, case: Case) -> Mechanism:
    """The numbers, from the case's vehicle and the dataset of `studies.paper_grid`."""
    softest = float(exact[PRIMARY].min())
    return Mechanism(
        stiffening(exact, case),
        freed(case.vehicle),
        tuple(wheelbase_filter(exact, case, joint) for joint in (softest, OTHER_JOINT)),
        on_rail(case, None),
        on_rail(case, TYPICAL),
        TYPICAL,
        wheel_resonance(case.vehicle, TYPICAL),
        _on_contact_spring(case.vehicle),
    )


def stiffening(exact: xr.Dataset, case: Case) -> Stiffening:
    """How much stiffer the secondary damper is at the car body's bounce, and the car body's departure."""
    vehicle, rigid = case.vehicle, case.vehicle.traditional()
    frequency = next(mode.natural_frequency for mode in modes(vehicle) if mode.name == "car bounce")
    c, kappa = vehicle.secondary_damping, vehicle.secondary_joint_stiffness / 2
    added = (2 * np.pi * frequency * c) ** 2 / kappa
    whole = added / (1 + added / kappa)
    stiffer = replace(rigid, secondary_stiffness=rigid.secondary_stiffness + whole)
    place = exact["car_position"].values.tolist().index(PLACES["car_position"])
    speed = np.array([PAPER_SPEED / 3.6])
    springs, plain = (
        float(solve.solve(half_vehicle_problem(each, speed, case.spectrum, case.band, (CAR,))).rms[CAR][place, 0])
        for each in (stiffer, rigid)
    )
    car = float(read(exact, CAR).departure.sel(PAPER_POINT))
    k = vehicle.secondary_stiffness
    return Stiffening(frequency, float(added / k), float(whole / k), car, springs / plain - 1)


def freed(vehicle: Vehicle) -> Freed:
    """What becomes of the overdamped bounce of the bogie frames."""
    name = "bogie bounce, in phase"
    slow, fast = (
        next(mode for mode in modes(vehicle.traditional()) if mode.name == f"{name}, overdamped, {which}")
        for which in ("slow", "fast")
    )
    return Freed((-slow.pole.real, -fast.pole.real), _bounce(vehicle))


def _on_contact_spring(vehicle: Vehicle) -> tuple[float, float]:
    mode = next(mode for mode in modes(vehicle) if mode.name == "wheelsets, all in phase")
    return mode.natural_frequency, mode.damping_ratio


def _bounce(vehicle: Vehicle) -> Mode:
    return next(mode for mode in modes(vehicle) if mode.name == "bogie bounce, in phase")


def wheelbase_filter(exact: xr.Dataset, case: Case, joint: float) -> Filter:
    """The bogie frame's departure for one primary joint, MN/m, with the lag between the bogie's wheels and without."""
    departure = scan(exact, BOGIE, PRIMARY).departure.sel(stiffness=joint)
    vehicle = replace(case.vehicle, primary_joint_stiffness=1e6 * joint)
    place = exact["bogie"].values.tolist().index(PLACES["bogie"])
    speeds = exact["speed"].values / 3.6
    with_joint, rigid = (
        solve.solve(
            half_vehicle_problem(replace(each, half_wheelbase=NO_WHEELBASE), speeds, case.spectrum, case.band, (BOGIE,))
        ).rms[BOGIE][place]
        for each in (vehicle, vehicle.traditional())
    )
    least = float(departure["speed"].values[np.argmin(departure.values)])
    return Filter(
        joint,
        departure,
        departure.copy(data=with_joint / rigid - 1),
        _bounce(vehicle).natural_frequency,
        least,
        least / 3.6 / (4 * case.vehicle.half_wheelbase),
    )


def on_rail(case: Case, rail: Rail | None) -> OnRail:
    """The paper's four responses at its point, with joints and without, on a rail (None: rigid)."""
    low, high = band_limits(case.band or Band("frequency", 0.1, 100.0), case.speed) / (2 * np.pi)
    joint, rigid = (
        response_rms(
            vehicle,
            lambda f: np.asarray(frequency_psd(case.spectrum, f, case.speed)),
            case.speed,
            (float(low), float(high)),
            rail,
        )
        for vehicle in (case.vehicle, case.vehicle.traditional())
    )
    return OnRail({n: joint[n] for n in RESPONSE_NAMES}, {n: rigid[n] for n in RESPONSE_NAMES})
