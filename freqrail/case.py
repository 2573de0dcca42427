"""Case files: TOML text to a checked, frozen `Case` in SI units.

The order of things is the case file, then settings (`--set`), then axes (`--over`); all three change the
parsed tables before one validation, which reports every fault at once. The tables' keys, units
and bounds come from `freqrail.names`.
"""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, PlainValidator, ValidationError, create_model

from freqrail.casefile import (
    CONTACTS,
    apply_axis,
    apply_setting,
    find,
    parse_toml,
    sections,
    to_toml,
)
from freqrail.errors import FreqrailWarning, InputError
from freqrail.names import JOINTS, PARAMETERS, SWEEPABLE, suggestion
from freqrail.quantities import (
    Axis,
    Quantity,
    given,
    is_same,
    milli_hint,
    nearest,
    parse_axis,
    parse_pair,
    parse_quantity,
)
from freqrail.track import GERMAN_CUTOFFS, GERMAN_ROUGHNESS, Band, RationalSpectrum
from freqrail.vehicle import Vehicle, hertzian_contact_stiffness, static_wheel_load

SCHEMA_VERSION = 1
SPECTRA = (*GERMAN_ROUGHNESS, "rational")
SOFT_JOINT = 0.01  # a joint below this fraction of its suspension spring is probably a slip of the unit


@dataclass(frozen=True)
class Case:
    """A checked case. Numbers in SI units.

    name: the file's stem. quantities: every scalar of [vehicle] and [operation] as written and in SI.
    axes: swept parameters in the order given. frequency: where spectra are stored, if the case says so.
    points: those to confirm, {name: quantity}. text: the file. effective: TOML after all changes.
    """

    name: str
    title: str
    reference: str
    quantities: Mapping[str, Quantity]
    spectrum: RationalSpectrum
    band: Band | None
    axes: tuple[Axis, ...]
    frequency: Axis | None
    points: tuple[Mapping[str, Quantity], ...]
    text: str
    effective: str

    @property
    def speed(self) -> float:
        """The scalar running speed, m/s."""
        return self.quantities["speed"].value

    @property
    def scalars(self) -> Mapping[str, Quantity]:
        """The quantities, and the contact stiffness where it follows from the contact constant."""
        return _scalars(self.quantities)

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle of the case's scalars, axes left aside."""
        return replace(self, axes=()).vehicles()

    def vehicles(self) -> Vehicle:
        """The grid of vehicles that the axes other than speed span, fields broadcasting in their order."""
        axes = [axis for axis in self.axes if axis.name != "speed"]
        values: dict[str, Any] = {name: quantity.value for name, quantity in self.quantities.items()}
        for place, axis in enumerate(axes):
            values[axis.name] = axis.si.reshape([-1 if i == place else 1 for i in range(len(axes))])
        values.pop("speed")
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
) -> Case:
    """`load_case` of TOML text; `file` is the name that messages bear.

    stray_points: accept confirm points off the grid, as `settings` and `over` may leave them; confirming
    them is what fails then.
    """
    for option, changes in (("settings", settings), ("over", over)):
        if changes is not None and not isinstance(changes, Mapping):
            raise InputError(f'{option}: a mapping is due, such as {{"speed": "250 km/h"}} {given(changes)}')
    tables = parse_toml(text, file)
    problems: list[str] = []
    origins: dict[tuple[str, ...], str] = {}
    for key, value in (settings or {}).items():
        apply_setting(tables, key, value, problems, origins, scalars)
    for key, value in (over or {}).items():
        apply_axis(tables, key, value, problems, origins)

    def where(*at: str) -> str:
        """The place that a message names: the option that set a key, or the file's own table and key."""
        return origins.get(at, f"{file}: [{at[0]}].{at[1]}" if len(at) > 1 else f"{file}: {at[0]}")

    checked = None
    try:
        checked = _model().model_validate(tables)
        quantities = {k: v for part in (checked.vehicle, checked.operation) for k, v in part if isinstance(v, Quantity)}
        sweep = {key: getattr(checked.sweep, key) for key in tables.get("sweep", {})}
        points = dict(enumerate(checked.confirm.points, start=1))
    except ValidationError as fault:
        problems += [line for error in fault.errors() for line in _problems(error, file, where)]
        # what can be read is still checked, so that every fault of a file is told at once
        quantities = {k: v for t in ("vehicle", "operation") for k, v in _readable(parse_quantity, tables, t).items()}
        sweep = _readable(parse_axis, tables, "sweep")
        points = _readable_points(tables, {*_scalars(quantities)} - {*_keys(tables, "sweep")} | {*sweep})
    frequency = sweep.pop("frequency", None)
    axes = tuple(sweep.values())
    problems += _cross_checks(tables, file, where)
    problems += _geometry_problems(quantities, axes, where)
    if not (settings or over or stray_points):
        problems += _point_problems(points, quantities, axes, file)
    if checked is None or problems:
        raise InputError(*dict.fromkeys(problems))
    _warn_of_millinewtons(quantities, axes, where)
    _warn_of_soft_joints(quantities, axes, where)
    return Case(
        name=name,
        title=checked.title,
        reference=checked.reference,
        quantities=quantities,
        spectrum=_spectrum(checked.track),
        band=_band(checked.band),
        axes=axes,
        frequency=frequency,
        points=tuple(points.values()),
        text=text,
        effective=to_toml(tables),
    )


# --- validation ------------------------------------------------------------------------------------


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, arbitrary_types_allowed=True)


def _quantity_field(name: str) -> Any:
    return Annotated[Quantity, PlainValidator(partial(parse_quantity, PARAMETERS[name]))]


def _pair_field(name: str) -> Any:
    return Annotated[tuple[Quantity, Quantity], PlainValidator(partial(parse_pair, PARAMETERS[name]))]


def _axis_field(name: str) -> Any:
    return Annotated[Axis, PlainValidator(partial(parse_axis, PARAMETERS[name]))]


def _check_version(value: object) -> int:
    if type(value) is not int or value != SCHEMA_VERSION:
        raise ValueError(f"unsupported schema_version: this freqrail reads {SCHEMA_VERSION} {given(value)}")
    return SCHEMA_VERSION


def _check_text(value: str) -> str:
    """A title or reference that a file can hold; control characters are kept, and escaped when printed."""
    if "\0" in value or any("\ud800" <= c <= "\udfff" for c in value):
        raise ValueError(f"holds a NUL or another character that no file can store {given(value)}")
    return value


def _points(value: object) -> tuple[dict[int, dict[str, Quantity]], list[str]]:
    """({number: point} of the points to confirm that are in order, what is wrong with the others)."""
    if not isinstance(value, list) or not all(isinstance(point, dict) for point in value):
        return {}, [f'a list of points is due, such as [{{ speed = "250 km/h" }}] {given(value)}']
    points: dict[int, dict[str, Quantity]] = {}
    faults: list[str] = []
    for place, point in enumerate(value, start=1):
        before = len(faults)
        points[place] = {}
        for name, text in point.items():
            if name not in SWEEPABLE:
                faults.append(f"point {place}: unknown name {name!r}{suggestion(name, SWEEPABLE)}")
                continue
            try:
                points[place][name] = parse_quantity(PARAMETERS[name], text)
            except ValueError as fault:
                faults.append(f"point {place}: {name}: {fault}")
        if len(faults) > before:
            del points[place]
    return points, faults


def _check_points(value: object) -> list[dict[str, Quantity]]:
    """The points to confirm. Raises ValueError with one argument a fault."""
    points, faults = _points(value)
    if faults:
        raise ValueError(*faults)
    return list(points.values())


@cache
def _model() -> Any:
    """The pydantic model of a whole case file, its tables built from the table of names."""

    def table(name: str, **fields: Any) -> Any:
        return create_model(name, __base__=_Table, **fields)

    vehicle: dict[str, Any] = {
        name: (_quantity_field(name), ...) for name, p in PARAMETERS.items() if p.section == "vehicle"
    }
    vehicle |= {name: (_quantity_field(name), None) for name in CONTACTS}
    empty: Any = None
    tables = {
        "vehicle": (table("Vehicle", masses=(Literal["half"], ...), **vehicle), ...),
        "track": (
            table(
                "Track",
                spectrum=(Literal[SPECTRA], ...),
                roughness=(_quantity_field("roughness"), None),
                cutoffs=(_pair_field("cutoffs"), None),
            ),
            ...,
        ),
        "operation": (table("Operation", speed=(_quantity_field("speed"), ...)), ...),
        "band": (
            table("Band", frequency=(_pair_field("frequency"), None), wavelength=(_pair_field("wavelength"), None)),
            empty,
        ),
        "sweep": (table("Sweep", **{n: (_axis_field(n), None) for n in (*SWEEPABLE, "frequency")}), empty),
        "confirm": (table("Confirm", points=(Annotated[list, PlainValidator(_check_points)], ())), None),
    }
    for name in ("sweep", "confirm"):
        model = tables[name][0]
        tables[name] = (model, model())
    return table(
        "CaseFile",
        schema_version=(Annotated[int, PlainValidator(_check_version)], ...),
        title=(Annotated[str, AfterValidator(_check_text)], ""),
        reference=(Annotated[str, AfterValidator(_check_text)], ""),
        **tables,
    )


def _problems(error: Any, file: str, where: Callable[..., str]) -> list[str]:
    """The lines for one of pydantic's errors: where, what is wrong, what was given, what would be right."""
    at = tuple(str(part) for part in error["loc"])
    key = at[-1]
    place = where(*at)
    tables = (*sections(), "sweep", "confirm")
    got = given(error["input"])
    kind = error["type"]
    if kind == "value_error":
        return [f"{place}: {fault}" for fault in error["ctx"]["error"].args]
    if kind == "extra_forbidden" and len(at) > 1:
        known = {**sections(), "sweep": (*SWEEPABLE, "frequency"), "confirm": ("points",)}[at[0]]
        line = f"{place}: unknown {'axis' if at[0] == 'sweep' else 'key'}{suggestion(key, known)}"
    elif kind == "extra_forbidden" and isinstance(error["input"], dict):
        line = f"{file}: [{key}]: unknown table{suggestion(key, tables)}"
    elif kind == "extra_forbidden":
        line = f"{place}: unknown key{suggestion(key, ('schema_version', 'title', 'reference', *tables))}"
    elif kind == "missing" and key in tables:
        line = f"{file}: [{key}]: this table is missing"
    elif kind == "missing":
        example = PARAMETERS[key].example if key in PARAMETERS else ""
        hint = {"masses": "half", "spectrum": "german-low"}.get(key, example)
        right = f'{key} = "{hint}"' if hint else f"{key} = {SCHEMA_VERSION}"
        line = f"{place}: missing; write it as in {right}"
    elif kind == "literal_error" and key == "spectrum":
        wanted = error["input"] if isinstance(error["input"], str) else ""
        line = f"{place}: unknown spectrum{suggestion(wanted, SPECTRA)} {got}"
    elif kind == "literal_error":
        line = f'{place}: must be "half": masses and inertias are half of the whole {got}'
    elif kind in ("model_type", "model_attributes_type"):
        line = f"{file}: [{key}]: must be a table {got}"
    elif kind == "string_type":
        line = f"{place}: text is due {got}"
    else:
        line = f"{place}: {error['msg'][0].lower()}{error['msg'][1:]} {got}"
    return [line]


def _keys(tables: dict[str, Any], name: str) -> dict[str, Any]:
    """The keys of a table and what is written there; none if it is no table."""
    table = tables.get(name)
    return table if isinstance(table, dict) else {}


def _readable(parse: Callable[..., Any], tables: dict[str, Any], name: str) -> dict[str, Any]:
    """What can be read of a table, whatever is wrong with the rest of it."""
    found = {}
    for key, text in _keys(tables, name).items():
        if key in PARAMETERS:
            with contextlib.suppress(ValueError):  # told already
                found[key] = parse(PARAMETERS[key], text)
    return found


def _readable_points(tables: dict[str, Any], known: set[str]) -> dict[int, dict[str, Quantity]]:
    """{number: point} of the points that can be read, without the names that cannot be judged."""
    points = _points(_keys(tables, "confirm").get("points", []))[0]
    return {place: {k: q for k, q in point.items() if k in known} for place, point in points.items()}


def _cross_checks(tables: dict[str, Any], file: str, where: Callable[..., str]) -> list[str]:
    """Faults between keys that are there or not, whatever their values."""
    problems = []
    sweep, track, band = (_keys(tables, name) for name in ("sweep", "track", "band"))
    contacts = set(_keys(tables, "vehicle")) & set(CONTACTS)
    if isinstance(tables.get("vehicle"), dict) and len(contacts) != 1:
        fault = "both are given" if contacts else "one of the two is missing"
        problems.append(f"{file}: [vehicle].contact_constant, .contact_stiffness: {fault}; give exactly one")
    if set(CONTACTS) <= set(sweep):
        problems.append(f"{file}: [sweep].contact_constant, .contact_stiffness: both are swept; sweep one")
    if "contact_constant" in sweep and contacts == {"contact_stiffness"}:
        problems.append(f"{where('sweep', 'contact_constant')}: swept, but [vehicle] gives contact_stiffness")
    rational = {"roughness", "cutoffs"}
    spectrum = track.get("spectrum")
    if spectrum == "rational":
        problems += [
            f'{where("track", key)}: missing; spectrum = "rational" needs it, such as "{PARAMETERS[key].example}"'
            for key in sorted(rational - set(track))
        ]
    elif spectrum in SPECTRA:
        problems += [
            f'{where("track", key)}: belongs to spectrum = "rational" only (spectrum is "{spectrum}")'
            for key in sorted(rational & set(track))
        ]
    if {"frequency", "wavelength"} <= set(band):
        problems.append(f"{file}: [band]: both frequency and wavelength are given; give one")
    if tables.get("band") == {}:
        problems.append(f"{file}: [band]: is empty; give frequency or wavelength, or leave the table out")
    for name, (low, high) in _readable(parse_pair, tables, "band").items():
        if name in ("frequency", "wavelength") and low.value >= high.value:
            problems.append(
                f"{where('band', name)}: the lower limit must be below the upper one "
                f'(got "{low.text}" and "{high.text}")'
            )
    return problems


def _scalars(quantities: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """The quantities, and the contact stiffness where it follows from the contact constant (eq. 1)."""
    masses = [quantities.get(f"{body}_mass") for body in ("car_body", "bogie", "wheelset")]
    constant = quantities.get("contact_constant")
    if constant is None or None in masses:
        return dict(quantities)
    load = static_wheel_load(*(mass.value for mass in masses if mass))
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
    points: dict[int, dict[str, Quantity]], quantities: Mapping[str, Quantity], axes: tuple[Axis, ...], file: str
) -> list[str]:
    return [
        f"{file}: [confirm].points: point {place}: {name}: {fault}"
        for place, point in points.items()
        for name, fault in place_point(point, axes, _scalars(quantities))[1].items()
    ]


def _warn_of_millinewtons(
    quantities: Mapping[str, Quantity], axes: tuple[Axis, ...], where: Callable[..., str]
) -> None:
    written = [(where(PARAMETERS[name].section, name), quantity.text) for name, quantity in quantities.items()]
    written += [(where("sweep", axis.name), axis.text) for axis in axes]
    for place, text in written:
        if milli_hint(text):
            warnings.warn(f'{place}: {milli_hint(text)} (got "{text}")', FreqrailWarning, stacklevel=4)


def _warn_of_soft_joints(quantities: Mapping[str, Quantity], axes: tuple[Axis, ...], where: Callable[..., str]) -> None:
    for joint in JOINTS:
        spring = joint.replace("_joint", "")
        ends, springs = _extremes(joint, quantities, axes), _extremes(spring, quantities, axes)
        if ends is None or springs is None or ends[0] >= SOFT_JOINT * springs[1]:
            continue
        table = "vehicle" if is_same(quantities[joint].value, ends[0]) else "sweep"
        warnings.warn(
            f"{where(table, joint)}: {ends[0]:g} N/m is {ends[0] / springs[1]:.1e} of {spring} ({springs[1]:g} N/m), "
            f"below {SOFT_JOINT:g}: the damper hardly acts; check the unit",
            FreqrailWarning,
            stacklevel=4,
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
