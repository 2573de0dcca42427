"""What a whole grid comes to beside what vehicles and tracks have: measured value, criterion, remedy.

Whatever is measured is monotonic in each of the vehicle's numbers, so that the corners of the grid (both ends of every
axis) hold its smallest and largest value. Only the wheel-rail force is not: it is computed at a few corners, which
hold both ends of every axis, and at the fastest speed, where it is largest but for the lags.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail.case.case import Case
from freqrail.case.criteria import CRITERIA
from freqrail.errors import FreqrailWarning, InputError
from freqrail.model.band import Band, band_limits
from freqrail.model.spectrum import standard_deviation
from freqrail.model.variants import Variant
from freqrail.model.vehicle import Vehicle, static_wheel_load
from freqrail.solver.contact_force import contact_force_rms
from freqrail.solver.modes import modes
from freqrail.sweep import free_plausibility
from freqrail.sweep.concern import (
    Concern,
    corners,
    few_samples,
    inside,
    judged,
    rounded,
    some_corners,
    span,
    wavelengths,
)
from freqrail.types import Number

LIKELY = (0.1, 100.0)  # Hz: the band that is advised where nothing speaks against it


# --- what is measured ------------------------------------------------------------------------------


def natural_frequencies(vehicle: Vehicle, chain: str) -> tuple[Number, Number]:
    """The lower and the upper natural frequency of a car body above its bogies, undamped, on rigid wheels, Hz.

    chain: "bounce" or "pitch". Fields of `vehicle` may be arrays. Roots of the two masses' characteristic equation.
    """
    car = vehicle.car_body_mass / 4
    if chain == "pitch":
        car = vehicle.car_body_pitch_inertia / (4 * np.square(vehicle.half_bogie_spacing))
    bogie, above, below = vehicle.bogie_mass / 2, vehicle.secondary_stiffness / 2, vehicle.primary_stiffness
    total = (above + below) / bogie + above / car
    product = (above / car) * (below / bogie)
    upper = total / 2 + np.sqrt(np.square(total / 2) - product)
    return np.sqrt(product / upper) / (2 * np.pi), np.sqrt(upper) / (2 * np.pi)


def _damping_ratio(damping: Number, stiffness: Number, mass: Number) -> Number:
    """Of a mass on a spring and a damper; nan without a damper, which is nothing to wonder at."""
    return np.where(np.equal(damping, 0), np.nan, damping / (2 * np.sqrt(stiffness * mass)))


def _ratio(secondary: Number, primary: Number) -> Number:
    """Of two dampings; nan where there is no damper at one of the stages."""
    none = np.equal(secondary, 0) | np.equal(primary, 0)
    return np.where(none, np.nan, np.divide(secondary, np.where(none, 1.0, primary)))


def _load(vehicle: Vehicle) -> Number:
    return static_wheel_load(vehicle.car_body_mass, vehicle.bogie_mass, vehicle.wheelset_mass)


def _gyration(inertia: Number, mass: Number, length: Number) -> Number:
    return np.sqrt(inertia / mass) / length


MEASURES: Mapping[str, Callable[[Vehicle], Number]] = {
    "axle_load": lambda v: 2e-3 * (v.car_body_mass / 4 + v.bogie_mass / 2 + v.wheelset_mass),
    "car_body": lambda v: 2e-3 * v.car_body_mass,
    "wheelset": lambda v: 2e-3 * v.wheelset_mass,
    "bogie_frame": lambda v: v.bogie_mass / v.half_wheelbase,
    "radius_of_gyration": lambda v: _gyration(v.car_body_pitch_inertia, v.car_body_mass, v.half_bogie_spacing),
    "bogie_radius_of_gyration": lambda v: _gyration(v.bogie_pitch_inertia, v.bogie_mass, v.half_wheelbase),
    "pivot_distance": lambda v: 2 * v.half_bogie_spacing,
    "wheelbase": lambda v: 2 * v.half_wheelbase,
    "car_bounce": lambda v: natural_frequencies(v, "bounce")[0],
    "car_pitch": lambda v: natural_frequencies(v, "pitch")[0],
    "bogie_bounce": lambda v: natural_frequencies(v, "bounce")[1],
    "primary_over_secondary": lambda v: 2 * v.primary_stiffness / v.secondary_stiffness,
    "primary_damping": lambda v: _damping_ratio(
        v.primary_damping, v.primary_stiffness + v.secondary_stiffness / 2, v.bogie_mass / 2
    ),
    "secondary_damping": lambda v: _damping_ratio(
        v.secondary_damping / 2, v.secondary_stiffness / 2, v.car_body_mass / 4
    ),
    "secondary_over_primary_damping": lambda v: _ratio(v.secondary_damping, v.primary_damping),
    "contact": lambda v: 1e-9 * v.contact_stiffness,
}
"""What is measured of a half vehicle, by criterion; fields may be arrays. Whole masses and distances."""


def measure(case: Case, name: str) -> NDArray[np.float64]:
    """A measure of the vehicles of a case, in the criterion's unit; of length 1 along axes that do not touch it."""
    with np.errstate(all="ignore"):  # what overflows is told by the points' status
        return np.asarray(MEASURES[name](case.vehicles()), dtype=float)


# --- what is outside its range ---------------------------------------------------------------------


def concerns(case: Case) -> tuple[Concern, ...]:
    """All that is outside its usual range somewhere on the grid of a case, accepted or not.

    Of a variant what lies further outside than the vehicle itself does; of the wheel-rail force the largest of all.
    """
    ends = corners(case)
    if not case.is_half_vehicle:
        return free_plausibility.concerns(ends)
    found = _of_one_model(ends)
    for variant in case.variants:
        widest = {concern.name: concern.measured for concern in found}
        for concern in _of_one_model(ends.of(variant)):
            if not (concern.name in widest and inside(concern.measured, widest[concern.name])):
                found.append(replace(concern, text=f"{variant.words}: {concern.text}"))
    return tuple(concern for concern in (*found, _wheel_force(ends)) if concern)


def _of_one_model(ends: Case) -> list[Concern]:
    """What is outside its usual range on the corners of a grid, but for the wheel-rail force."""
    found = [judged(ends, name, measure(ends, name)) for name in MEASURES]
    height = 1e3 * standard_deviation(ends.spectrum, (3.0, 25.0))
    found.append(judged(ends, "track_height", np.array(height)))
    return [concern for concern in (*found, *_band_concerns(ends)) if concern]


def warn(case: Case) -> tuple[Concern, ...]:
    """`concerns`, each warned of (FreqrailWarning) that the case does not accept."""
    found = concerns(case)
    for concern in found:
        if not concern.accepted:
            warnings.warn(f"{case.name}: {concern.text}", FreqrailWarning, stacklevel=3)
    return found


# --- the band --------------------------------------------------------------------------------------


def _band_concerns(case: Case) -> list[Concern]:
    """What speaks against the band: the wheelsets' resonance, and the spectrum's wavelengths."""
    found = []
    resonance, index = _lowest_resonance(case)
    ratio = _highest(case, case.band) / resonance
    if not inside((ratio, ratio), CRITERIA["wheelset_resonance"].usual):
        measured = _resonance_text(case, ratio, resonance, index)
        found.append(judged(case, "wheelset_resonance", np.array(ratio), _advice(case, "frequency"), measured))
    if case.band and case.spectrum.name.startswith("german"):  # of the whole axis the resonance's concern says it
        ends = np.array(wavelengths(case.band, case.speeds()))
        # of the band at all speeds, at no one corner of the grid
        words = f"{CRITERIA['wavelengths'].what} {span(*ends)} m"
        found.append(judged(case, "wavelengths", ends, _advice(case, "wavelength"), words))
    return [concern for concern in found if concern]


def _highest(case: Case, band: Band | None) -> float:
    """The highest frequency of a band at any speed, Hz."""
    return math.inf if band is None else float(band_limits(band, case.speeds())[1].max()) / (2 * np.pi)


def _lowest_resonance(case: Case) -> tuple[float, tuple[int, ...]]:
    """The lowest resonance of the wheelsets between rail and primary springs on the grid, undamped, Hz, and where."""
    vehicle = case.vehicles()
    with np.errstate(all="ignore"):
        square = (vehicle.contact_stiffness + vehicle.primary_stiffness) / vehicle.wheelset_mass
        values = np.nan_to_num(np.broadcast_to(np.sqrt(square), vehicle.shape), nan=np.inf) / (2 * np.pi)
    index = tuple(map(int, np.unravel_index(int(np.argmin(values)), values.shape)))
    return max(float(values[index]), np.finfo(float).tiny), index


def _resonance_text(case: Case, ratio: float, resonance: float, index: tuple[int, ...]) -> str:
    try:
        found = [m for m in modes(case.vehicles().at(index)) if m.name.startswith("wheelsets") and m.damped_frequency]
    except InputError:
        found = []
    damping = ""
    if found:
        mode = min(found, key=lambda m: abs(m.damped_frequency - resonance))
        resonance, damping = mode.damped_frequency, f" with a damping ratio of {mode.damping_ratio:.1e}"
    axes = [axis for axis in case.axes if axis.name != "speed"]
    own = [axis for axis in axes if axis.name.endswith("_mass") or axis.name.startswith(("contact", "primary_stiff"))]
    where = [f"{a.name}={a.values[i]:.4g} {a.unit}" for a, i in zip(axes, index, strict=True) if a in own]
    at = f" (at {', '.join(where)})" if where else ""
    if case.band is None:
        reach = "is the whole axis: all wavelengths, whatever the spectrum is good for, and"
    else:
        times = f"{ratio:.2g} times"
        reach = f"ends at {_highest(case, case.band):.4g} Hz, {'about at' if times == '1 times' else times}"
    return (
        f"the band {reach} the wheelsets' resonance on the rigid rail, {resonance:.3g} Hz{damping}{at}, "
        "which no real track has"
    )


def _advice(case: Case, first: str) -> str:
    """The option that gives a band which nothing speaks against; `first`: the kind to try first."""
    resonance, _ = _lowest_resonance(case)
    usual = {name: _widest(case, name) for name in ("wheelset_resonance", "wavelengths")}
    highest = usual["wheelset_resonance"][1] * resonance
    low = case.band.low if case.band and case.band.kind == "frequency" else LIKELY[0]
    shortest, longest = usual["wavelengths"]
    if not case.spectrum.name.startswith("german"):
        shortest, longest = 1.0, 200.0
    candidates = {
        "frequency": Band("frequency", low, min(LIKELY[1], rounded(highest, math.floor))),
        "wavelength": Band(
            "wavelength", max(shortest, rounded(float(case.speeds().max()) / highest, math.ceil)), longest
        ),
    }
    for kind in (first, *candidates.keys() - {first}):
        band = candidates[kind]
        if not 0 < band.low < band.high < math.inf:
            continue
        tried = replace(case, band=band)
        ratio = _highest(tried, band) / resonance
        clear = inside((ratio, ratio), usual["wheelset_resonance"])
        if case.spectrum.name.startswith("german"):
            clear &= inside(wavelengths(band, case.speeds()), usual["wavelengths"])
        if clear:
            unit = "Hz" if kind == "frequency" else "m"
            return f'for a band clear of it sweep (anew) with --set "{kind}={band.low:g}:{band.high:g} {unit}"'
    return "no band is clear of it: check wheelset_mass and the contact stiffness, or sweep fewer speeds"


def _widest(case: Case, name: str) -> tuple[float, float]:
    """The range that a case takes for usual."""
    return case.accepted.get(name, CRITERIA[name].usual)


# --- the wheel-rail force --------------------------------------------------------------------------


def _wheel_force(case: Case) -> Concern | None:
    """The concern about contact lost, from a few corners of the grid, in all models of a case."""
    case = few_samples(case)
    vehicle = case.vehicles()
    models = [_on_the_grid(case, model) for model in case.models]
    values = np.full(vehicle.shape, np.nan)
    forces: dict[tuple[Vehicle, float], float] = {}  # the same rigid joints stand for many

    def force(one: Vehicle, speed: float) -> float:
        """Of a model at a corner, in static wheel loads."""
        if (one, speed) not in forces:
            with np.errstate(all="ignore"):
                rms = float(contact_force_rms(one, case.spectrum, speed, case.band).max())
            forces[one, speed] = rms / float(_load(one))
        return forces[one, speed]

    def compute(index: tuple[int, ...]) -> None:
        each = [force(grid.at(tuple(index[axis] for axis in axes)), speed) for grid, axes, speed in models]
        values[index] = max(each)

    for index in some_corners(vehicle.shape):
        compute(index)
    worst = _worst_corner(values)
    if np.isnan(values[worst]):
        compute(worst)
    return judged(case, "wheel_force", values)


def _on_the_grid(case: Case, model: Variant) -> tuple[Vehicle, list[int], float]:
    """The vehicles of a model, which axes of the case's grid of vehicles they have, and the fastest speed, m/s."""
    own = case.of(model)
    named = {axis.name for axis in own.axes}
    axes = [place for place, axis in enumerate(a for a in case.axes if a.name != "speed") if axis.name in named]
    return own.vehicles(), axes, float(own.speeds().max())


def _worst_corner(values: NDArray[np.float64]) -> tuple[int, ...]:
    """The corner at which each axis has the end with the larger mean of what is known of `values`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the mean of nothing
        means = [
            np.nan_to_num(np.nanmean(np.moveaxis(values, axis, 0).reshape(ends, -1), axis=1), nan=-np.inf)
            for axis, ends in enumerate(values.shape)
        ]
    return tuple(int(np.argmax(mean)) for mean in means)


# --- in words, and in a file -----------------------------------------------------------------------

_VITALS = ("axle_load", "car_bounce", "car_pitch", "bogie_bounce", "pivot_distance", "wheelbase")


def vitals(case: Case) -> list[dict[str, Any]]:
    """What an engineer knows a vehicle by, over the grid of a case: name, smallest, largest, unit."""
    ends = corners(case)
    if not case.is_half_vehicle:
        return free_plausibility.vitals(ends)
    found = {name: measure(ends, name) for name in _VITALS}
    return [
        {"quantity": name, "smallest": float(v.min()), "largest": float(v.max()), "unit": CRITERIA[name].unit}
        for name, v in found.items()
    ]


def vitals_text(case: Case) -> str:
    """The same in a line."""
    words = {"pivot_distance": "pivots", "bogie_bounce": "bogie bounce"}
    parts = [
        f"{words.get(v['quantity'], v['quantity'].replace('_', ' '))} {span(v['smallest'], v['largest'])} {v['unit']}"
        for v in vitals(case)
    ]
    return ", ".join(parts) + (" (whole vehicle, undamped)" if case.is_half_vehicle else "")


def recalled(attributes: Mapping[Any, Any]) -> list[dict[str, Any]]:
    """What `stored` put into the attributes of a file: records with `text` and `accepted`."""
    return json.loads(str(attributes.get("warnings") or "[]"))


def accepted_text(records: list[dict[str, Any]]) -> str:
    """What a case has accepted, in a line; "" if nothing."""
    texts = [record["text"] for record in records if record["accepted"]]
    return f"accepted by the case: {', and '.join(texts)}" if texts else ""


def stored(found: tuple[Concern, ...], case: Case) -> str:
    """All that was told of a case as JSON, for a file's attribute; "" if there is nothing."""
    records: list[dict[str, Any]] = [{"name": "input", "accepted": False, "text": line} for line in case.warnings]
    for concern in found:
        record = {k: v for k, v in asdict(concern).items() if k in ("name", "accepted", "text")}
        ends = {key: [str(x) if math.isinf(x) else x for x in getattr(concern, key)] for key in ("measured", "usual")}
        records.append({**record, **ends})
    return attribute(records)


def attribute(records: list[dict[str, Any]]) -> str:
    """Records as a file's attribute keeps them (JSON), see `recalled`; "" if there are none."""
    return json.dumps(records, ensure_ascii=False) if records else ""
