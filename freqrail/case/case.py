"""Case files: TOML text to a checked, frozen `Case` in SI units.

The order of things is the case file, then settings (`--set`), then axes (`--over`); all three change the
parsed tables before one validation, which reports every fault at once. The tables' keys, units
and bounds come from `freqrail.case.parameters`.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from freqrail.case.axis import Axis, is_same, nearest, parse_axis
from freqrail.case.file import apply_axis, apply_setting, find, parse_toml, to_toml
from freqrail.case.parameters import JOINTS, PARAMETERS, SHARED_BY_SIDES
from freqrail.case.quantities import Quantity, milli_hint, parse_quantity
from freqrail.case.tables import cross_checks, keys, model, problems_of, readable, readable_points
from freqrail.errors import FreqrailWarning, InputError
from freqrail.model.band import Band
from freqrail.model.spectrum import GERMAN_CUTOFFS, GERMAN_ROUGHNESS, RationalSpectrum
from freqrail.model.variants import BASE, DEFAULT, Variant
from freqrail.model.vehicle import Vehicle, hertzian_contact_stiffness, static_wheel_load
from freqrail.text import given

LARGEST_GRID = 2**63  # points, and with spectra points times frequencies: the library's indices end there
SOFT_JOINT = 0.01  # a joint below this fraction of its suspension spring is probably a slip of the unit


@dataclass(frozen=True)
class Case:
    """A checked case. Numbers in SI units.

    name: the file's stem. masses: "half" or "whole": whether the quantities and axes are those of one side of the
    vehicle, as the model takes them, or of both. quantities: every scalar of [vehicle] and [operation] as written and
    in SI. axes: swept parameters in the order given. frequency: where spectra are stored, if the case says so.
    points: those to confirm, {name: quantity}. accepted: ranges that replace those of `criteria.CRITERIA`.
    warnings: what was told when the case was read. text: the file. effective: TOML after all changes. variants: twins
    whose responses are computed beside.
    """

    name: str
    title: str
    reference: str
    masses: str
    quantities: Mapping[str, Quantity]
    spectrum: RationalSpectrum
    band: Band | None
    axes: tuple[Axis, ...]
    frequency: Axis | None
    points: tuple[Mapping[str, Quantity], ...]
    accepted: Mapping[str, tuple[float, float]]
    warnings: tuple[str, ...]
    text: str
    effective: str
    variants: tuple[Variant, ...] = DEFAULT

    @property
    def speed(self) -> float:
        """The scalar running speed, m/s."""
        return self.quantities["speed"].value

    @property
    def scalars(self) -> Mapping[str, Quantity]:
        """The quantities, and the contact stiffness where it follows from the contact constant."""
        return _scalars(self.quantities, self.masses)

    @property
    def models(self) -> tuple[Variant, ...]:
        """The vehicle itself and its variants, in the order in which they are computed and stored."""
        return (BASE, *self.variants)

    def of(self, model: Variant) -> Case:
        """The case as one of its models has it: with the numbers that this fixes, and without their axes."""
        if not model.values:
            return self
        fixed = {
            name: Quantity(value, "inf" if math.isinf(value) else f"{value:.10g} {PARAMETERS[name].unit}")
            for name, value in model.values.items()
        }
        own = {name: quantity for name, quantity in self.quantities.items() if name not in model.fixed}
        axes = tuple(axis for axis in self.axes if axis.name not in model.fixed)
        return replace(self, quantities=own | fixed, axes=axes, variants=())

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle of the case's scalars, axes left aside."""
        return replace(self, axes=()).vehicles()

    def vehicles(self) -> Vehicle:
        """The grid of vehicles that the axes other than speed span, fields broadcasting in their order.

        This is where whole vehicles become the half ones of the model.
        """
        axes = [axis for axis in self.axes if axis.name != "speed"]
        values: dict[str, Any] = {name: quantity.value for name, quantity in self.quantities.items()}
        for place, axis in enumerate(axes):
            values[axis.name] = axis.si.reshape([-1 if i == place else 1 for i in range(len(axes))])
        values.pop("speed")
        values = {name: value * _share(name, self.masses) for name, value in values.items()}
        constant = values.pop("contact_constant", None)
        swept = {axis.name for axis in axes}
        if constant is not None and "contact_stiffness" not in swept:
            load = static_wheel_load(values["car_body_mass"], values["bogie_mass"], values["wheelset_mass"])
            values["contact_stiffness"] = hertzian_contact_stiffness(constant, load)
        return Vehicle(**values)

    def speeds(self) -> NDArray[np.float64]:
        """The swept speeds, or the scalar one, m/s: [n]."""
        return next((axis.si for axis in self.axes if axis.name == "speed"), np.array([self.speed]))


def load_case(
    case: str | os.PathLike[str],
    settings: Mapping[str, str] | None = None,
    over: Mapping[str, str] | None = None,
    scalars: bool = False,
) -> Case:
    """Read, change and check a case.

    case: path of a TOML file, or the name of a shipped case. settings: {"NAME" or "SECTION.NAME":
    value}, as `--set`; {"band": "none"} removes the band. over: {"NAME": axis}, as `--over`: replaces
    the case's axis of that name or adds one after the others. scalars: the case's scalars are what is wanted, so
    that `settings` may name swept quantities too.

    Raises InputError with one line a problem for everything that is wrong with the file or the
    changes (see the README's case format), and warns (FreqrailWarning) of a joint softer
    than 1 % of its suspension spring.
    """
    name, file, text = find(case)
    return build_case(text, settings, over, name=name, file=file, scalars=scalars)


def build_case(
    text: str,
    settings: Mapping[str, str] | None = None,
    over: Mapping[str, str] | None = None,
    name: str = "case",
    file: str = "case",
    stray_points: bool = False,
    scalars: bool = False,
    axis_option: str = "--over",
) -> Case:
    """`load_case` of TOML text; `file` is the name that messages bear, `axis_option` that of the option behind `over`.

    stray_points: accept confirm points off the grid, as `settings` and `over` may leave them; confirming
    them is what fails then.
    """
    for option, changes in (("settings", settings), ("over", over)):
        if changes is not None and not isinstance(changes, Mapping):
            raise InputError(f'{option}: a mapping is expected, such as {{"speed": "250 km/h"}} {given(changes)}')
    tables = parse_toml(text, file)
    problems: list[str] = []
    origins: dict[tuple[str, ...], str] = {}
    swept = {str(key).removeprefix("sweep.") for key in over or {}}
    for key, value in (settings or {}).items():
        apply_setting(tables, key, value, problems, origins, scalars, swept)
    for key, value in (over or {}).items():
        apply_axis(tables, key, value, problems, origins, axis_option)

    def where(*at: str) -> str:
        """The place that a message names: the option that set a key, or the file's own table and key."""
        return origins.get(at, f"{file}: [{at[0]}].{at[1]}" if len(at) > 1 else f"{file}: {at[0]}")

    read = _read(tables, file, where)
    problems += [*read.problems, *cross_checks(tables, file, where)]
    problems += _geometry_problems(read.quantities, read.axes, where)
    problems += _size_problems((*read.axes, *([read.frequency] if read.frequency else ())), where)
    if not (settings or over or stray_points):
        masses = read.checked.vehicle.masses if read.checked else "half"
        problems += _point_problems(read.points, _scalars(read.quantities, masses), read.axes, file)
    if read.checked is None or problems:
        raise InputError(*dict.fromkeys(problems))
    warned = (*_millinewtons(read.quantities, read.axes, where), *_soft_joints(read.quantities, read.axes, where))
    for line in warned:
        warnings.warn(line, FreqrailWarning, stacklevel=3)
    return Case(
        name=name,
        title=read.checked.title,
        reference=read.checked.reference,
        masses=read.checked.vehicle.masses,
        quantities=read.quantities,
        spectrum=_spectrum(read.checked.track),
        band=_band(read.checked.band),
        axes=read.axes,
        frequency=read.frequency,
        points=tuple(read.points.values()),
        accepted=read.checked.accepted,
        warnings=warned,
        text=text,
        effective=to_toml(tables),
    )


@dataclass(frozen=True)
class _Read:
    """What the tables of a file hold. checked: the validated model, None if something is wrong with them.

    points: those to confirm, by their number in the file. problems: what is wrong, a line each.
    """

    checked: Any
    quantities: dict[str, Quantity]
    axes: tuple[Axis, ...]
    frequency: Axis | None
    points: dict[int, dict[str, Quantity]]
    problems: list[str]


def _read(tables: dict[str, Any], file: str, where: Callable[..., str]) -> _Read:
    """Validate the tables of a file; of a faulty one, what can be read all the same, so that every fault of it is told
    at once."""
    checked, problems = None, []
    try:
        checked = model().model_validate(tables)
        quantities = {k: v for part in (checked.vehicle, checked.operation) for k, v in part if isinstance(v, Quantity)}
        sweep = {key: getattr(checked.sweep, key) for key in tables.get("sweep", {})}
        points = dict(enumerate(checked.confirm.points, start=1))
    except ValidationError as fault:
        problems = [line for error in fault.errors() for line in problems_of(error, file, where)]
        quantities = {k: v for t in ("vehicle", "operation") for k, v in readable(parse_quantity, tables, t).items()}
        sweep = readable(parse_axis, tables, "sweep")
        points = readable_points(tables, {*_scalars(quantities, "half")} - {*keys(tables, "sweep")} | {*sweep})
    frequency = sweep.pop("frequency", None)
    return _Read(checked, quantities, tuple(sweep.values()), frequency, points, problems)


def _share(name: str, masses: str) -> float:
    """What of a quantity as written the model takes: half of what both sides of a whole vehicle share."""
    return 0.5 if masses == "whole" and name in SHARED_BY_SIDES else 1.0


def _scalars(quantities: Mapping[str, Quantity], masses: str) -> dict[str, Quantity]:
    """The quantities, and the contact stiffness where it follows from the contact constant (eq. 1)."""
    names = ("car_body_mass", "bogie_mass", "wheelset_mass")
    constant = quantities.get("contact_constant")
    if constant is None or not set(names) <= quantities.keys():
        return dict(quantities)
    load = static_wheel_load(*(quantities[name].value * _share(name, masses) for name in names))
    stiffness = float(hertzian_contact_stiffness(constant.value, load))
    return {"contact_stiffness": Quantity(stiffness, f"{stiffness:.10g} N/m"), **quantities}


def _extremes(name: str, quantities: Mapping[str, Quantity], axes: tuple[Axis, ...]) -> tuple[float, float] | None:
    """Smallest and largest value of a quantity, SI: on the grid, and its scalar; None if it has none."""
    values = [end for axis in axes if axis.name == name for end in (axis.si[0], axis.si[-1])]
    values += [quantities[name].value] if name in quantities else []
    return (float(min(values)), float(max(values))) if values else None


def _geometry_problems(
    quantities: Mapping[str, Quantity], axes: tuple[Axis, ...], where: Callable[..., str]
) -> list[str]:
    spacing = _extremes("half_bogie_spacing", quantities, axes)
    wheelbase = _extremes("half_wheelbase", quantities, axes)
    if spacing is None or wheelbase is None or spacing[0] > wheelbase[1]:
        return []
    return [
        f"{where('vehicle', 'half_bogie_spacing')}: must exceed half_wheelbase everywhere on the grid "
        f"(got {spacing[0]:g} m and {wheelbase[1]:g} m)"
    ]


def _size_problems(axes: tuple[Axis, ...], where: Callable[..., str]) -> list[str]:
    points = math.prod(axis.values.size for axis in axes)
    if points < LARGEST_GRID:
        return []
    longest = max(axes, key=lambda axis: axis.values.size)
    return [
        f"{where('sweep', longest.name)}: the axes span {points:.3g} points, more than can be counted (limit "
        f"{LARGEST_GRID:.3g}); use fewer values"
    ]


def place_point(
    point: Mapping[str, Quantity], axes: tuple[Axis, ...], scalars: Mapping[str, Quantity], near: bool = False
) -> tuple[dict[str, int], dict[str, str]]:
    """Where a point lies on a grid: ({axis: index}, {name: what is wrong}).

    An axis that the point leaves out takes the case's scalar, or its only value; with `near`, its value nearest
    to the scalar. A value off the grid and a named quantity that is neither swept nor the case's own are faults.
    """
    indices, faults = {}, {}
    for axis in axes:
        named = axis.name in point
        quantity = point[axis.name] if named else scalars.get(axis.name)
        if quantity is None or (axis.si.size == 1 and not named):
            indices[axis.name] = 0  # nothing to choose from, or nothing that says what to choose
            continue
        at = nearest(axis.si, quantity.value)
        if is_same(axis.si[at], quantity.value) or (near and not named):
            indices[axis.name] = at
            continue
        value = axis.values[at]
        best = "inf" if np.isinf(value) else f"{value:.10g} {axis.unit}"
        off = f'"{quantity.text}" is off the grid; the nearest value is {best}'
        stray = f'left out, and the case\'s own value {off}: name it, as in "{axis.name}={best}"'
        faults[axis.name] = off if named else stray
    for name in set(point) - {axis.name for axis in axes}:
        own = scalars.get(name)
        if own is None or not is_same(own.value, point[name].value):
            has = f"the case has {own.text}" if own else "the case does not give it"
            faults[name] = f'is not swept, {has} (got "{point[name].text}")'
    return indices, dict(sorted(faults.items()))


def _point_problems(
    points: dict[int, dict[str, Quantity]], scalars: Mapping[str, Quantity], axes: tuple[Axis, ...], file: str
) -> list[str]:
    return [
        f"{file}: [confirm].points: point {place}: {name}: {fault}"
        for place, point in points.items()
        for name, fault in place_point(point, axes, scalars)[1].items()
    ]


def _millinewtons(
    quantities: Mapping[str, Quantity], axes: tuple[Axis, ...], where: Callable[..., str]
) -> Iterator[str]:
    written = [(where(PARAMETERS[name].section, name), quantity.text) for name, quantity in quantities.items()]
    written += [(where("sweep", axis.name), axis.text) for axis in axes]
    for place, text in written:
        if milli_hint(text):
            yield f'{place}: {milli_hint(text)} (got "{text}")'


def _soft_joints(
    quantities: Mapping[str, Quantity], axes: tuple[Axis, ...], where: Callable[..., str]
) -> Iterator[str]:
    for joint in JOINTS:
        spring = joint.replace("_joint", "")
        ends, springs = _extremes(joint, quantities, axes), _extremes(spring, quantities, axes)
        if ends is None or springs is None or ends[0] >= SOFT_JOINT * springs[1]:
            continue
        table = "vehicle" if is_same(quantities[joint].value, ends[0]) else "sweep"
        yield (
            f"{where(table, joint)}: {ends[0]:g} N/m is {ends[0] / springs[1]:.1e} of {spring} ({springs[1]:g} N/m), "
            f"below {SOFT_JOINT:g}: the damper hardly acts; check the unit"
        )


def _spectrum(track: Any) -> RationalSpectrum:
    if track.spectrum == "rational":
        low, high = track.cutoffs
        return RationalSpectrum("rational", track.roughness.value, (low.value, high.value))
    return RationalSpectrum(track.spectrum, GERMAN_ROUGHNESS[track.spectrum], GERMAN_CUTOFFS)


def _band(band: Any) -> Band | None:
    if band is None:
        return None
    kind = "frequency" if band.frequency else "wavelength"
    low, high = getattr(band, kind)
    return Band(kind, low.value, high.value)
