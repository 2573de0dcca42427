"""What a free vehicle comes to beside what vehicles have: at a few corners of its grid, and at its own point.

A body that stands on wheels is taken for a bogie, one above for a car body; a case whose bodies stand otherwise may
accept what it is told.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.case.axis import Axis
from freqrail.case.case import Case
from freqrail.case.criteria import CRITERIA
from freqrail.case.samples import SAMPLE
from freqrail.model.band import band_limits
from freqrail.model.bodies import anatomy_of
from freqrail.model.elements import Spring, Values
from freqrail.model.spectrum import standard_deviation
from freqrail.model.statics import GRAVITY, undamped_modes, wheel_loads
from freqrail.model.system import System, evaluate
from freqrail.solver.solve import solve
from freqrail.sweep.concern import Concern, few_samples, judged, some_corners, span, wavelengths
from freqrail.sweep.plan import problem_of_case

_CAR, _BOGIE = 2, 1  # levels of bodies above the track, wheels have 0
_MOTIONS = {"car_bounce": (_CAR, "bounce"), "car_pitch": (_CAR, "pitch"), "bogie_bounce": (_BOGIE, "bounce")}


def concerns(case: Case) -> tuple[Concern, ...]:
    """All that is outside its usual range at the corners of a grid, accepted or not. case: cut to them."""
    points = [one.described.values(one.grid()) for one in _corner_cases(case)]
    found = [_judged_of(case, name, values) for name, values in _measured(case.described.system, points)]
    height = 1e3 * standard_deviation(case.spectrum, (3.0, 25.0))
    found.append(judged(case, "track_height", np.array(height)))
    found += _band_concerns(case, points)
    found.append(_wheel_force(case))
    return tuple(concern for concern in found if concern)


def _judged_of(case: Case, name: str, values: NDArray[np.float64]) -> Concern | None:
    some = values[np.isfinite(values)]
    if not some.size:
        return None
    # in words of its own: the values are those of bodies at corners, not of a grid
    words = f"{CRITERIA[name].what} {span(float(some.min()), float(some.max()))} {CRITERIA[name].unit}".rstrip()
    return judged(case, name, some, measured=words)


def _corner_cases(case: Case) -> Iterator[Case]:
    """The case at its own point, and at corners of its grid, axes and samples of one value each."""
    yield case.scalar_case
    case = few_samples(case)
    axes = [axis for axis in case.axes if axis.name != "speed"]
    for corner in some_corners(tuple(axis.si.size for axis in axes)) if axes else ():
        own = [replace(axis, values=axis.values[[i]], si=axis.si[[i]]) for axis, i in zip(axes, corner, strict=True)]
        one = replace(case, axes=tuple(own))
        yield replace(one, quantities=_with(one, own), axes=(), samples=None)


def _with(case: Case, axes: list[Axis]) -> dict[str, Any]:
    """The quantities of a case with those of its axes and samples, each of one value."""
    columns = [axis for axis in axes if axis.name != SAMPLE]
    for axis in axes:
        if axis.name == SAMPLE and case.samples:
            columns += case.samples.at(axis.values).columns
    changed = {column.name: replace(case.quantities[column.name], value=float(column.si[0])) for column in columns}
    return {**case.quantities, **changed}


def _measured(system: System, points: list[dict[str, Any]]) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """(criterion, values) of what is measured at every point."""
    with np.errstate(all="ignore"):
        loads = np.array([wheel_loads(system, values) for values in points])
        yield "axle_load", 2e-3 * loads.ravel() / GRAVITY
        contacts = [wheel.contact.name for wheel in system.wheels if isinstance(wheel.contact, Spring)]
        yield "contact", 1e-9 * np.array([float(values[name]) for values in points for name in contacts])
        for level, name in ((_CAR, "radius_of_gyration"), (_BOGIE, "bogie_radius_of_gyration")):
            yield name, np.array([each for values in points for each in _gyrations(system, values, level)])
        found = [undamped_modes(system, values) for values in points]
        for name, (level, motion) in _MOTIONS.items():
            own = [f for modes in found for f in _frequencies(system, modes, level, motion)]
            yield name, np.array(own)


def _level(system: System) -> dict[str, int]:
    """How many suspensions each body is above the wheels, the cars of all vehicles as `_CAR`."""
    return {body.name: min(body.level, _CAR) for body in anatomy_of(system).bodies}


def _gyrations(system: System, values: Values, level: int) -> list[float]:
    """Radius of gyration of every body of a level over the farthest of the suspensions that carry it."""
    levels, found = _level(system), []
    inertia = {(f.body, f.motion): f.inertia for f in system.freedoms}
    pitch = {f.body: f.name for f in system.freedoms if f.motion == "pitch"}
    bounce = {f.body: f.name for f in system.freedoms if f.motion == "bounce"}
    for body, own in levels.items():
        if own != level or body not in pitch:
            continue
        arms = [
            abs(float(evaluate(leg.row.get(pitch[body], 0.0), values)))
            for leg in system.legs
            if bounce[body] in leg.row and float(evaluate(leg.row[bounce[body]], values)) > 0
        ]
        if len(arms) > 1 and max(arms) > 0:
            j, m = (float(values[inertia[body, motion]]) for motion in ("pitch", "bounce"))
            found.append(float(np.sqrt(j / m) / max(arms)))
    return found


def _frequencies(system: System, modes: list[tuple[float, dict[str, float]]], level: int, motion: str) -> list[float]:
    """Natural frequencies, Hz, of the motions in which bodies of a level have most of the energy, with that motion."""
    levels = _level(system)
    of = {f.name: (levels[f.body], f.motion) for f in system.freedoms}
    return [frequency for frequency, energy in modes if of[max(energy, key=energy.__getitem__)] == (level, motion)]


def _band_concerns(case: Case, points: list[dict[str, Any]]) -> list[Concern | None]:
    """What speaks against the band: the wheels' resonances on rigid rails, and the spectrum's wavelengths."""
    found: list[Concern | None] = []
    rigid = [
        (w.contact.name, f.inertia)
        for w in case.described.system.wheels
        if isinstance(w.contact, Spring)
        for f in case.described.system.freedoms
        if f.name in w.row
    ]
    with np.errstate(all="ignore"):
        lowest = [np.sqrt(float(v[k]) / float(v[m])) / (2 * np.pi) for v in points for k, m in rigid]
    if lowest and case.band is not None:
        high = float(band_limits(case.band, case.speeds())[1].max()) / (2 * np.pi)
        advice = 'end the band below, or let the contact yield: contact = "H - (m | k | c)"'
        found.append(judged(case, "wheelset_resonance", np.array(high / min(lowest)), advice))
    if case.band and case.spectrum.name.startswith("german"):
        ends = np.array(wavelengths(case.band, case.speeds()))
        words = f"{CRITERIA['wavelengths'].what} {span(*ends)} m"
        found.append(judged(case, "wavelengths", ends, 'give a band by wavelength: --set "wavelength=1:120 m"', words))
    return found


def _wheel_force(case: Case) -> Concern | None:
    """The concern about contact lost, at the case's own point and fastest speed."""
    one = case.scalar_case
    fastest = float(case.speeds().max())
    problem = replace(problem_of_case(one, ("contact_force",)), speed=np.array([fastest]))
    with np.errstate(all="ignore"):
        loads = wheel_loads(case.described.system, one.values())
        force = solve(problem).rms["contact_force"][..., 0]
        share = force / loads
    return judged(case, "wheel_force", np.asarray(share))


def vitals(case: Case) -> list[dict[str, Any]]:
    """What an engineer knows a vehicle by: name, smallest, largest, unit."""
    points = [one.described.values(one.grid()) for one in _corner_cases(case)]
    wanted = ("axle_load", "car_bounce", "car_pitch", "bogie_bounce")
    return [
        {"quantity": name, "smallest": float(v.min()), "largest": float(v.max()), "unit": CRITERIA[name].unit}
        for name, v in _measured(case.described.system, points)
        if name in wanted and v.size
    ]
