"""Case files: TOML text to a checked, frozen `Case` in SI units.

The order of things is the case file, then settings (`--set`), then axes (`--over`); all three change the
parsed tables before one validation, which reports every fault at once. The tables' keys, units
and bounds come from `freqrail.case.parameters`.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from freqrail.case.axis import Axis, is_same, nearest, parse_axis
from freqrail.case.described import HALF, Described, describe_free, describe_template
from freqrail.case.file import CONTACTS, apply_axis, apply_setting, find, parse_toml, to_toml
from freqrail.case.free_tables import NESTED, flat_names, flat_sweep, inline_shapes, is_free, typed_name, value_paths
from freqrail.case.free_vehicle import TABLES
from freqrail.case.kinds import parse_value
from freqrail.case.parameters import JOINTS, PARAMETERS, SHARED_BY_SIDES, VARIABLE, Parameter, meaning, suggestion
from freqrail.case.quantities import Quantity, milli_hint, parse_quantity
from freqrail.case.samples import SAMPLE, Samples, from_mapping, names_in, number_of, read_csv, read_table
from freqrail.case.tables import (
    axes_of,
    cross_checks,
    keys,
    model,
    problems_of,
    readable,
    readable_points,
    template_model,
)
from freqrail.errors import FreqrailWarning, InputError
from freqrail.model.band import Band
from freqrail.model.responses import Vocabulary
from freqrail.model.spectrum import GERMAN_CUTOFFS, GERMAN_ROUGHNESS, RationalSpectrum
from freqrail.model.variants import BASE, DEFAULT, ITSELF, TRADITIONAL, Variant
from freqrail.model.vehicle import Vehicle, hertzian_contact_stiffness, static_wheel_load
from freqrail.text import given
from freqrail.types import Number

LARGEST_GRID = 2**63  # points, and with spectra points times frequencies: the library's indices end there
SOFT_JOINT = 0.01  # a joint below this fraction of its suspension spring is probably a slip of the unit


@dataclass(frozen=True)
class Case:
    """A checked case. Numbers in SI units.

    name: the file's stem. masses: "half" or "whole": whether the quantities and axes are those of one side of the
    vehicle, as the model takes them, or of both. quantities: every scalar of [vehicle] and [operation] as written and
    in SI. axes: swept parameters in the order given; before them the dimension `sample`, if the case has samples.
    frequency: where spectra are stored, if the case says so. points: those to confirm, {name: quantity}. accepted:
    ranges that replace those of `criteria.CRITERIA`. warnings: what was told when the case was read. text: the file.
    effective: TOML after all changes, samples written out. variants: twins whose responses are computed beside.
    samples: what varies along `sample`. described: the vehicle's system and what is read off it.
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
    samples: Samples | None = None
    described: Described = HALF

    @property
    def speed(self) -> float:
        """The scalar running speed, m/s."""
        return self.quantities["speed"].value

    @property
    def variable(self) -> Mapping[str, Parameter]:
        """What may vary in this case, by name, the speed included."""
        return self.described.variable

    def parameter(self, name: str) -> Parameter:
        """What a name of this case stands for, `frequency` and quantities of the track included."""
        return self.variable[name] if name in self.variable else PARAMETERS[name]

    def meaning(self, name: str) -> str:
        """What a quantity means in this case, in words."""
        own = name in PARAMETERS and self.is_half_vehicle
        return meaning(name, self.masses) if own else self.parameter(name).meaning

    @property
    def vocabulary(self) -> Vocabulary:
        """The responses that it has."""
        return self.described.readings.vocabulary

    @property
    def is_half_vehicle(self) -> bool:
        """Whether its vehicle is the paper's, from the template."""
        return self.described.free is None

    @property
    def scalars(self) -> Mapping[str, Quantity]:
        """The quantities, and the contact stiffness where it follows from the contact constant."""
        return _scalars(self.quantities, self.masses)

    @property
    def models(self) -> tuple[Variant, ...]:
        """The vehicle itself and its variants, in the order in which they are computed and stored."""
        return (BASE if self.is_half_vehicle else ITSELF, *self.variants)

    def of(self, model: Variant) -> Case:
        """The case as one of its models has it: with the numbers that this fixes, and without their axes."""
        if not model.values:
            return self
        fixed = {
            name: Quantity(value, "inf" if math.isinf(value) else f"{value:.10g} {self.variable[name].unit}")
            for name, value in model.values.items()
        }
        own = {name: quantity for name, quantity in self.quantities.items() if name not in model.fixed}
        samples = self.samples.without(model.fixed) if self.samples else None
        gone = model.fixed if samples else {*model.fixed, SAMPLE}
        axes = tuple(axis for axis in self.axes if axis.name not in gone)
        return replace(self, quantities=own | fixed, axes=axes, samples=samples, variants=())

    @property
    def varied(self) -> frozenset[str]:
        """The parameters that the case sweeps, along axes of their own or along `sample`."""
        sampled = self.samples.parameters if self.samples else frozenset()
        return sampled | {axis.name for axis in self.axes} - {SAMPLE}

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle of the case's scalars, axes left aside."""
        return self.scalar_case.vehicles()

    @property
    def scalar_case(self) -> Case:
        """The case without its axes and samples: its scalars alone."""
        return replace(self, axes=(), samples=None)

    def values(self) -> dict[str, Number]:
        """The grid's numbers by name of the vehicle's system, SI, broadcasting in the order of the axes but speed."""
        return self.described.values(vars(self.vehicles()) if self.is_half_vehicle else self.grid())

    def vehicles(self) -> Vehicle:
        """The grid of half vehicles that the axes other than speed span, fields broadcasting in their order.

        This is where whole vehicles become the half ones of the model. Raises InputError for a vehicle of another kind.
        """
        if not self.is_half_vehicle:
            raise InputError(f"{self.name}: is no half vehicle, which this is for")
        values = {name: value * share(name, self.masses) for name, value in self.grid().items()}
        constant = values.pop("contact_constant", None)
        if constant is not None and "contact_stiffness" not in self.varied:
            load = static_wheel_load(values["car_body_mass"], values["bogie_mass"], values["wheelset_mass"])
            values["contact_stiffness"] = hertzian_contact_stiffness(constant, load)
        return Vehicle(**values)

    def grid(self) -> dict[str, Any]:
        """The case's quantities but speed by name, those that vary as arrays."""
        axes = [axis for axis in self.axes if axis.name != "speed"]
        values: dict[str, Any] = {name: quantity.value for name, quantity in self.quantities.items()}
        for place, axis in enumerate(axes):
            columns: tuple[Axis, ...] = (axis,)
            if axis.name == SAMPLE and self.samples:  # the numbers, of which a part may have been cut out
                columns = self.samples.at(axis.values).columns
            for column in columns:
                values[column.name] = column.si.reshape([-1 if i == place else 1 for i in range(len(axes))])
        values.pop("speed")
        return values

    def speeds(self) -> NDArray[np.float64]:
        """The swept speeds, or the scalar one, m/s: [n]."""
        return next((axis.si for axis in self.axes if axis.name == "speed"), np.array([self.speed]))


def load_case(
    case: str | os.PathLike[str],
    settings: Mapping[str, str] | None = None,
    over: Mapping[str, str] | None = None,
    scalars: bool = False,
    samples: str | os.PathLike[str] | Mapping[str, Any] | None = None,
) -> Case:
    """Read, change and check a case.

    case: path of a TOML file, or the name of a shipped case. settings: {"NAME" or "SECTION.NAME":
    value}, as `--set`; {"band": "none"} removes the band. over: {"NAME": axis}, as `--over`: replaces
    the case's axis of that name or adds one after the others. scalars: the case's scalars are what is wanted, so
    that `settings` may name swept quantities too. samples: the path of a CSV file, as `--samples`, or its columns as a
    mapping (see `samples.from_mapping`): replaces the case's samples, and its axes of what is sampled.

    Raises InputError with one line a problem for everything that is wrong with the file or the
    changes (see the README's case format), and warns (FreqrailWarning) of a joint softer
    than 1 % of its suspension spring.
    """
    name, file, text = find(case)
    table: Path | Mapping[str, Any] | None = None
    if isinstance(samples, str | os.PathLike):
        table = Path(samples)
    elif samples is not None:
        if not hasattr(samples, "items"):
            raise InputError(f"samples: the path of a CSV file, or a mapping, is expected {given(samples)}")
        table = from_mapping(samples)
    folder = Path(case).parent if Path(case).is_file() else Path()
    return build_case(text, settings, over, name=name, file=file, scalars=scalars, samples=table, folder=folder)


def build_case(
    text: str,
    settings: Mapping[str, str] | None = None,
    over: Mapping[str, str] | None = None,
    name: str = "case",
    file: str = "case",
    stray_points: bool = False,
    scalars: bool = False,
    axis_option: str = "--over",
    samples: Samples | Mapping[str, Any] | Path | None = None,
    folder: Path | None = None,
) -> Case:
    """`load_case` of TOML text; `file` is the name that messages bear, `axis_option` that of the option behind `over`.

    stray_points: accept confirm points off the grid, as `settings` and `over` may leave them; confirming
    them is what fails then. samples: replaces the table of that name. folder: to which the path of the file of samples
    is relative; None for a text that may name no file.
    """
    for option, changes in (("settings", settings), ("over", over)):
        if changes is not None and not isinstance(changes, Mapping):
            raise InputError(f'{option}: a mapping is expected, such as {{"speed": "250 km/h"}} {given(changes)}')
    tables = parse_toml(text, file)
    problems: list[str] = []
    origins: dict[tuple[str, ...], str] = {}
    paths = None
    if is_free(tables):
        flat_sweep(tables)
        paths = value_paths(tables)
    swept = {typed_name(str(key)) for key in over or {}}
    for key, value in (settings or {}).items():
        apply_setting(tables, key, value, problems, origins, scalars, swept, paths)
    for key, value in (over or {}).items():
        apply_axis(tables, key, value, problems, origins, axis_option, paths)

    def where(*at: str) -> str:
        """The place that a message names: the option that set a key, or the file's own table and key."""
        if at in origins:
            return origins[at]
        if (at[0] in NESTED and len(at) < 3) or (len(at) == 1 and at[0] in TABLES):
            return f"{file}: [{'.'.join(at)}]"
        return f"{file}: [{'.'.join(at[:-1])}].{at[-1]}" if len(at) > 1 else f"{file}: {at[0]}"

    if paths is not None:
        inline_shapes(tables, folder, lambda at, words: problems.append(f"{where(*at)}: {words}"))
    if isinstance(samples, Path):
        names = names_in(samples) if paths is not None else ()
        variable = _variable_before(tables, where, (*keys(tables, "sweep"), *names)) if paths is not None else VARIABLE
        samples = read_csv(samples, variable=variable)
    if samples is not None:
        tables["samples"] = samples if isinstance(samples, Samples) else dict(samples)
        origins["samples",] = "samples"
        sweep = keys(tables, "sweep")
        sampled = samples.parameters if isinstance(samples, Samples) else samples.keys()
        for axis in [axis for axis in sweep if axis in sampled and ("sweep", axis) not in origins]:
            del sweep[axis]  # the case's own axis, which samples given besides replace
    read = _read(tables, file, where, folder)
    problems += _version_problems(tables, file)
    problems += _sampled_twice(read, tables, origins, where, scalars)
    problems += [*read.problems, *cross_checks(tables, file, where)]
    problems += _geometry_problems(read, where)
    problems += _size_problems((*read.axes, *([read.frequency] if read.frequency else ())), where)
    if not (settings or over or samples or stray_points):
        masses = read.masses
        problems += _point_problems(read, _scalars(read.quantities, masses), file)
    if read.checked is None or read.described is None or problems:
        raise InputError(*dict.fromkeys(problems))
    warned = (*read.warned, *_millinewtons(read, where), *_soft_joints(read, where))
    for line in warned:
        warnings.warn(line, FreqrailWarning, stacklevel=3)
    return Case(
        name=name,
        title=read.checked.title,
        reference=read.checked.reference,
        masses=read.masses,
        quantities=read.quantities,
        spectrum=_spectrum(read.checked.track),
        band=_band(read.checked.band),
        axes=read.axes,
        frequency=read.frequency,
        points=tuple(read.points.values()),
        accepted=read.checked.accepted,
        warnings=warned,
        text=text,
        effective=to_toml(tables | ({"samples": read.samples.table()} if read.samples else {})),
        variants=read.variants,
        samples=read.samples,
        described=read.described,
    )


@dataclass(frozen=True)
class _Read:
    """What the tables of a file hold. checked: the validated model, None if something is wrong with them.

    points: those to confirm, by their number in the file. problems: what is wrong, a line each. samples: None if there
    are none, or something is wrong with them. described: None if something is wrong with the vehicle. warned: lines to
    warn of.
    """

    checked: Any
    quantities: dict[str, Quantity]
    axes: tuple[Axis, ...]
    frequency: Axis | None
    points: dict[int, dict[str, Quantity]]
    problems: list[str]
    samples: Samples | None
    described: Described | None
    variants: tuple[Variant, ...]
    warned: list[str]

    @property
    def masses(self) -> str:
        """See `Case`; "half" of a free vehicle."""
        return self.checked.vehicle.masses if self.checked and hasattr(self.checked, "vehicle") else "half"

    @property
    def columns(self) -> tuple[Axis, ...]:
        """What varies: axes, and columns of samples."""
        return (*self.axes, *(self.samples.columns if self.samples else ()))


def _read(tables: dict[str, Any], file: str, where: Callable[..., str], folder: Path | None) -> _Read:
    """Validate the tables of a file; of a faulty one, what can be read all the same, so that every fault of it is told
    at once."""
    free = is_free(tables)
    problems: list[str] = []
    warned: list[str] = []
    described: Described | None = HALF
    quantities: dict[str, Quantity] = {}
    variable = VARIABLE
    if free:
        named = tables.get("samples")
        sampled = named.parameters if isinstance(named, Samples) else keys(tables, "samples")
        own = {*keys(tables, "sweep"), *sampled} - {*keys(tables, "parameters")}
        described, leaves = describe_free(tables, where, problems, warned, own)
        quantities = leaves.quantities()
        unused = leaves.unused()
        variable = {**leaves.parameters(), **unused, "speed": PARAMETERS["speed"]}
        if described is not None:
            warned += [f"{where('parameters', name)}: nothing uses it" for name in unused]
            varies = [name for name in unused if name in own or name in keys(tables, "sweep") or name in sampled]
            problems += [f"{where('sweep', name)}: nothing uses {name}, so that it cannot vary" for name in varies]
    rest = {key: table for key, table in tables.items() if key not in ("samples", *(NESTED_HERE if free else EXTRA))}
    checked = None
    try:
        checked = (model(variable) if free else template_model()).model_validate(rest)
        parts = (checked.operation,) if free else (checked.vehicle, checked.operation)
        quantities |= {k: v for part in parts for k, v in part if isinstance(v, Quantity)}
        found = axes_of(checked)
        sweep = {key: found[key] for key in tables.get("sweep", {})}
        points = dict(enumerate(checked.confirm.points, start=1))
    except ValidationError as fault:
        problems += [line for error in fault.errors() for line in problems_of(error, file, where, variable)]
        for t in ("operation",) if free else ("vehicle", "operation"):
            quantities |= readable(parse_quantity, tables, t)
        sweep = readable(parse_axis, tables, "sweep", variable)
        known = {*_scalars(quantities, "half")} - {*keys(tables, "sweep")} | {*sweep}
        points = readable_points(tables, known, variable)
    if not free:
        described = describe_template(tables, quantities, where, problems, warned)
    known = {*variable, *(value_paths(tables) if free else ())}
    variants = _variants(tables, variable, known, where, problems)
    frequency = sweep.pop("frequency", None)
    axes = tuple(sweep.values())
    samples = None
    if "samples" in tables:
        try:
            table = tables["samples"]
            samples = (
                table
                if isinstance(table, Samples)
                else read_table(table, partial(_place_of_samples, where, file), folder, variable)
            )
            axes = (samples.axis, *axes)
        except InputError as fault:
            problems += fault.problems
    return _Read(checked, quantities, axes, frequency, points, problems, samples, described, variants, warned)


EXTRA = ("variants", "outputs")
NESTED_HERE = (*TABLES, *EXTRA)


def _variable_before(
    tables: dict[str, Any], where: Callable[..., str], own: Collection[str]
) -> Mapping[str, Parameter]:
    """What may vary in a free vehicle, before the rest of its case is read; what is wrong is told later."""
    return describe_free(tables, where, [], [], {*own} - {*keys(tables, "parameters")})[1].parameters()


def _version_problems(tables: dict[str, Any], file: str) -> list[str]:
    """Tables and keys of schema 2 in a file of schema 1."""
    if tables.get("schema_version") != 1:
        return []
    used = [f"[{name}]" for name in NESTED_HERE if name in tables]
    used += ["[vehicle].template"] if "template" in keys(tables, "vehicle") else []
    return [f"{file}: schema_version: must be 2 for {', '.join(used)} (got 1)"] if used else []


def _variants(
    tables: dict[str, Any],
    variable: Mapping[str, Parameter],
    known: Collection[str],
    where: Callable[..., str],
    problems: list[str],
) -> tuple[Variant, ...]:
    """The variants of a case: its own, or those of a half vehicle that names none.

    known: all names that there are, of which `variable` lacks those of a faulty vehicle.
    """
    if "variants" not in tables:
        return () if is_free(tables) else DEFAULT
    table = tables["variants"]
    if not isinstance(table, dict):
        problems.append(f"{where('variants')}: must be a table {given(table)}")
        return ()
    found = []
    for name, changes in table.items():
        place = where("variants", name)
        if not re.fullmatch("[a-z][a-z0-9_]*", name):
            problems.append(f"{place}: a name is small letters, digits and _, beginning with a letter {given(name)}")
        elif not isinstance(changes, dict) or not changes:
            problems.append(f'{place}: a table is expected, with what it fixes, as in joint = "inf" {given(changes)}')
        else:
            found.append(_variant(name, changes, variable, known, where, problems))
    return tuple(found)


def _variant(
    name: str,
    changes: Mapping[str, Any],
    variable: Mapping[str, Parameter],
    known: Collection[str],
    where: Callable[..., str],
    problems: list[str],
) -> Variant:
    values = {}
    for key, text in dict(flat_names(changes)).items():
        place = where("variants", name, key)
        if key == "speed" or key not in known:
            names = sorted(each for each in known if each != "speed")
            problems.append(f"{place}: unknown name{suggestion(key, names)}")
            continue
        if key not in variable:
            continue
        try:
            values[key] = parse_value(variable[key], text)
        except ValueError as fault:
            problems.append(f"{place}: {fault}")
    words = TRADITIONAL.words if (name, values) == (TRADITIONAL.name, TRADITIONAL.values) else name.replace("_", " ")
    return Variant(name, words, values)


def _place_of_samples(where: Callable[..., str], file: str, key: str) -> str:
    """What messages call a key of the samples, or the whole table."""
    given_otherwise = where("samples")
    if not given_otherwise.startswith(f"{file}: "):
        return f"{given_otherwise}: {key}" if key else given_otherwise
    return where("samples", key) if key else f"{file}: [samples]"


def _sampled_twice(
    read: _Read,
    tables: dict[str, Any],
    origins: Mapping[tuple[str, ...], str],
    where: Callable[..., str],
    scalars: bool,
) -> list[str]:
    """Faults of what is sampled, and given by another axis, by an option, or by another name."""
    if read.samples is None:
        return []
    problems = []
    contacts = set(CONTACTS)
    sampled = read.samples.parameters
    for name in sorted(sampled):
        alike = contacts if name in contacts else {name}
        problems += [
            f"{where('sweep', axis)}: {name} is sampled; leave out the axis, or its column of the samples"
            for axis in sorted(alike & {*keys(tables, "sweep")})
        ]
        options = [origins[key] for key in origins if len(key) > 1 and key[0] != "sweep" and key[1] in alike]
        problems += [
            f"{option}: {name} is sampled; change its column of the samples" for option in options if not scalars
        ]
    if contacts <= sampled:
        problems.append(f"{where('samples')}: contact_constant, contact_stiffness: both are sampled; sample one")
    if "contact_constant" in sampled and "contact_stiffness" in keys(tables, "vehicle"):
        problems.append(f"{where('samples', 'contact_constant')}: sampled, but [vehicle] gives contact_stiffness")
    return problems


def share(name: str, masses: str) -> float:
    """What of a quantity as written the model takes: half of what both sides of a whole vehicle share."""
    return 0.5 if masses == "whole" and name in SHARED_BY_SIDES else 1.0


def _scalars(quantities: Mapping[str, Quantity], masses: str) -> dict[str, Quantity]:
    """The quantities, and the contact stiffness where it follows from the contact constant (eq. 1)."""
    names = ("car_body_mass", "bogie_mass", "wheelset_mass")
    constant = quantities.get("contact_constant")
    if constant is None or not set(names) <= quantities.keys():
        return dict(quantities)
    load = static_wheel_load(*(quantities[name].value * share(name, masses) for name in names))
    stiffness = float(hertzian_contact_stiffness(constant.value, load))
    return {"contact_stiffness": Quantity(stiffness, f"{stiffness:.10g} N/m"), **quantities}


def _closest(read: _Read, first: str, second: str) -> tuple[float, float] | None:
    """Where the ratio of two quantities is smallest, SI: of their scalars, and on the grid; None if one has no value.

    Sampled both, they are taken sample by sample, else each at its own end.
    """
    scalars = [read.quantities[name].value for name in (first, second) if name in read.quantities]
    varied = {column.name: column.si for column in read.columns}
    pairs = [(scalars[0], scalars[1])] if len(scalars) == 2 else []
    sampled = read.samples.parameters if read.samples else frozenset()
    if {first, second} <= sampled:
        at = int(np.argmin(varied[first] / varied[second]))
        pairs.append((float(varied[first][at]), float(varied[second][at])))
    else:
        values = [
            [*([read.quantities[name].value] if name in read.quantities else []), *varied.get(name, ())]
            for name in (first, second)
        ]
        if all(values):
            pairs.append((float(min(values[0])), float(max(values[1]))))
    return min(pairs, key=lambda pair: pair[0] / pair[1]) if pairs else None


def _geometry_problems(read: _Read, where: Callable[..., str]) -> list[str]:
    pair = _closest(read, "half_bogie_spacing", "half_wheelbase")
    if pair is None or pair[0] > pair[1]:
        return []
    return [
        f"{where('vehicle', 'half_bogie_spacing')}: must exceed half_wheelbase everywhere on the grid "
        f"(got {pair[0]:g} m and {pair[1]:g} m)"
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
    point: Mapping[str, Quantity],
    axes: tuple[Axis, ...],
    scalars: Mapping[str, Quantity],
    near: bool = False,
    sampled: Collection[str] = (),
    names: Sequence[str] = (),
) -> tuple[dict[str, int], dict[str, str]]:
    """Where a point lies on a grid: ({axis: index}, {name: what is wrong}).

    An axis that the point leaves out takes the case's scalar, or its only value; with `near`, its value nearest
    to the scalar. A value off the grid and a named quantity that is neither swept nor the case's own are faults. A
    sample is named by its number or its name; left out, it is the first. sampled: parameters that vary along `sample`;
    names: of the samples.
    """
    indices, faults = {}, {}
    for axis in axes:
        if axis.name == SAMPLE:
            number = number_of(point[SAMPLE].text, axis.values, names) if SAMPLE in point else axis.values[0]
            if number is None:
                ends = (
                    f"{axis.values[0]:.0f} to {axis.values[-1]:.0f}"
                    if axis.values.size > 1
                    else f"{axis.values[0]:.0f}"
                )
                faults[SAMPLE] = f"there is no such sample (got {point[SAMPLE].text!r}; there are {ends})"
            else:
                indices[SAMPLE] = int(np.flatnonzero(axis.values == number)[0])
            continue
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
        if name in sampled:
            faults[name] = f'varies with the samples: name one of them, as in "{SAMPLE}=1" (got "{point[name].text}")'
            continue
        own = scalars.get(name)
        if own is None or not is_same(own.value, point[name].value):
            has = f"the case has {own.text}" if own else "the case does not give it"
            faults[name] = f'is not swept, {has} (got "{point[name].text}")'
    return indices, dict(sorted(faults.items()))


def _point_problems(read: _Read, scalars: Mapping[str, Quantity], file: str) -> list[str]:
    sampled, names = (read.samples.parameters, read.samples.names) if read.samples else ((), ())
    return [
        f"{file}: [confirm].points: point {place}: {name}: {fault}"
        for place, point in read.points.items()
        for name, fault in place_point(point, read.axes, scalars, sampled=sampled, names=names)[1].items()
    ]


def _millinewtons(read: _Read, where: Callable[..., str]) -> Iterator[str]:
    written = [
        (where(PARAMETERS[name].section, name), quantity.text)
        for name, quantity in read.quantities.items()
        if name in PARAMETERS
    ]
    written += [(where("sweep", axis.name), axis.text) for axis in read.axes]
    written += [(where("samples", column.name), column.text) for column in read.columns if column not in read.axes]
    for place, text in written:
        if milli_hint(text):
            yield f'{place}: {milli_hint(text)} (got "{text}")'


def _soft_joints(read: _Read, where: Callable[..., str]) -> Iterator[str]:
    sampled = read.samples.parameters if read.samples else frozenset()
    for joint in JOINTS:
        spring = joint.replace("_joint", "")
        pair = _closest(read, joint, spring)
        if pair is None or pair[0] >= SOFT_JOINT * pair[1]:
            continue
        own = is_same(read.quantities[joint].value, pair[0])
        table = "vehicle" if own else "samples" if joint in sampled else "sweep"
        yield (
            f"{where(table, joint)}: {pair[0]:g} N/m is {pair[0] / pair[1]:.1e} of {spring} ({pair[1]:g} N/m), "
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
