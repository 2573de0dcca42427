"""Case files: TOML text to a checked, frozen `Case` in SI units.

The order of things is the case file, then settings (`--set`), then axes (`--over`); all three change the
parsed tables before one validation, which reports every fault at once. The tables' keys, units
and bounds come from `freqrail.names`.
"""

from __future__ import annotations

import json
import os
import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, PlainValidator, ValidationError, create_model

from freqrail.errors import FreqrailWarning, InputError
from freqrail.names import JOINTS, PARAMETERS, SWEEPABLE, suggestion
from freqrail.quantities import Axis, Quantity, parse_axis, parse_pair, parse_quantity, shown_value
from freqrail.track import GERMAN_CUTOFFS, GERMAN_ROUGHNESS, Band, RationalSpectrum
from freqrail.vehicle import Vehicle, hertzian_contact_stiffness, static_wheel_load

SCHEMA_VERSION = 1
SPECTRA = (*GERMAN_ROUGHNESS, "rational")
CONTACTS = ("contact_constant", "contact_stiffness")
LARGEST_FILE = 10_000_000  # bytes: a case file has two thousand
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


def shipped_cases() -> dict[str, str]:
    """The cases that come with freqrail: {name: TOML text}."""
    inside = resources.files("freqrail") / "cases"
    folder = inside if inside.is_dir() else Path(__file__).parent.parent / "cases"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {f.name.removesuffix(".toml"): f.read_text(encoding="utf-8") for f in files}


def load_case(
    case: str | os.PathLike[str],
    settings: Mapping[str, str] | None = None,
    over: Mapping[str, str] | None = None,
) -> Case:
    """Read, change and check a case.

    case: path of a TOML file, or the name of a shipped case. settings: {"NAME" or "SECTION.NAME":
    value}, as `--set`; {"band": "none"} removes the band. over: {"NAME": axis}, as `--over`: replaces
    the case's axis of that name or adds one after the others.

    Raises InputError with one line a problem for everything that is wrong with the file or the
    changes (see the README's case format), and warns (FreqrailWarning) of a joint softer
    than 1 % of its suspension spring.
    """
    name, file, text = _find(case)
    return build_case(text, settings, over, name=name, file=file)


def build_case(
    text: str,
    settings: Mapping[str, str] | None = None,
    over: Mapping[str, str] | None = None,
    name: str = "case",
    file: str = "case",
    stray_points: bool = False,
) -> Case:
    """`load_case` of TOML text; `file` is the name that messages bear.

    stray_points: accept confirm points off the grid, as an axis given by `over` may leave them.
    """
    tables = _parse_toml(text, file)
    problems: list[str] = []
    origins: dict[tuple[str, ...], str] = {}
    for key, value in (settings or {}).items():
        _apply_setting(tables, key, value, problems, origins)
    for key, value in (over or {}).items():
        _apply_axis(tables, key, value, problems, origins)
    try:
        checked = _model().model_validate(tables)
    except ValidationError as fault:
        problems += [_problem(error, file, origins) for error in fault.errors()]
        checked = None
    if checked is None or problems:
        # what the tables can tell on their own is told even beside other faults
        problems += _cross_checks(tables, file)
        raise InputError(*dict.fromkeys(problems))
    problems += _cross_checks(tables, file)
    quantities = {
        key: value
        for table in (checked.vehicle, checked.operation)
        for key, value in table
        if isinstance(value, Quantity)
    }
    sweep = {key: getattr(checked.sweep, key) for key in tables.get("sweep", {})}
    frequency = sweep.pop("frequency", None)
    axes = tuple(sweep.values())
    problems += _geometry_problems(quantities, axes, file)
    points = tuple(checked.confirm.points)
    if not (over or stray_points):
        problems += _point_problems(points, quantities, axes, file)
    if problems:
        raise InputError(*problems)
    _warn_of_soft_joints(quantities, axes, file)
    return Case(
        name=name,
        title=checked.title,
        reference=checked.reference,
        quantities=quantities,
        spectrum=_spectrum(checked.track),
        band=_band(checked.band),
        axes=axes,
        frequency=frequency,
        points=points,
        text=text,
        effective=to_toml(tables),
    )


def _find(case: str | os.PathLike[str]) -> tuple[str, str, str]:
    """(stem, name for messages, text) of a case file or a shipped case."""
    path = Path(case)
    given = str(case)
    try:
        if path.is_file():
            return path.stem, given, _read(path)
        exists, folder = path.exists(), path.is_dir()
    except (OSError, ValueError) as fault:
        raise InputError(f"{given!r}: cannot be opened: {fault}") from None
    if exists:
        raise InputError(f"{given}: {'is a folder' if folder else 'is not a regular file'}, a case file is due")
    shipped = shipped_cases()
    if given in shipped:
        return given, given, shipped[given]
    raise InputError(f"{given}: no such case file, and no shipped case of that name{suggestion(given, shipped)}")


def _read(path: Path) -> str:
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path}: too large for a case file (got {size} bytes, limit {LARGEST_FILE})")
        data = path.read_bytes()
    except OSError as fault:
        raise InputError(f"{path}: cannot be read: {fault.strerror}") from None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(f"{path}: is UTF-16 text, a case file is UTF-8: save it anew with that encoding")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise InputError(f"{path}: is not UTF-8 text (byte {fault.start} is {data[fault.start]:#04x})") from None
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise InputError(f"{path}: line {line}: holds a NUL byte, a case file is plain text")
    if not text.strip():
        raise InputError(f"{path}: is empty; start from a shipped case: freqrail cases yu-damper-joint")
    return text


def _parse_toml(text: str, file: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        raise InputError(f"{file}: not valid TOML: {fault}") from None
    except ValueError:
        raise InputError(f"{file}: not valid TOML: a number with too many digits") from None
    except RecursionError:
        raise InputError(f"{file}: not valid TOML: nested too deeply") from None


# --- settings and axes -----------------------------------------------------------------------------


def _sections() -> dict[str, tuple[str, ...]]:
    """The keys of every table that a setting may change."""
    keys: dict[str, list[str]] = {"vehicle": ["masses"], "track": ["spectrum"], "operation": [], "band": []}
    for parameter in PARAMETERS.values():
        keys[parameter.section].append(parameter.name)
    return {section: tuple(names) for section, names in keys.items()}


def _table(tables: dict[str, Any], name: str) -> dict[str, Any]:
    """The table of that name, made if missing; a stray value in its place is left for validation."""
    table = tables.setdefault(name, {})
    return table if isinstance(table, dict) else {}


def _apply_setting(
    tables: dict[str, Any], key: str, value: str, problems: list[str], origins: dict[tuple[str, ...], str]
) -> None:
    label = f"--set {key}"
    if key == "band":
        if value.strip().lower() != "none":
            problems.append(f'{label}: only "band=none", or --set "frequency=0.1:100 Hz", will do (got {value!r})')
        tables.pop("band", None)
        return
    if key in ("title", "reference"):
        tables[key] = value
        return
    section, _, name = key.rpartition(".")
    sections = _sections()
    owners = [s for s, names in sections.items() if name in names and section in ("", s)]
    if section == "sweep":
        problems.append(f'{label}: an axis is replaced with --over "{name}={value}"')
        return
    if not owners:
        known = sections.get(section, tuple(n for names in sections.values() for n in names))
        problems.append(f"{label}: unknown name{suggestion(name, known)}")
        return
    if name in _table(tables, "sweep"):
        problems.append(f'{label}: {name} is swept by the case; give it one value with --over "{name}={value}"')
        return
    table = _table(tables, owners[0])
    for group in (CONTACTS, ("frequency", "wavelength")):
        if name in group:  # of the two, the one set last holds
            for other in group:
                table.pop(other, None)
    if name == "spectrum" and value != "rational":
        table.pop("roughness", None)
        table.pop("cutoffs", None)
    table[name] = value
    origins[owners[0], name] = label


def _apply_axis(
    tables: dict[str, Any], key: str, value: str, problems: list[str], origins: dict[tuple[str, ...], str]
) -> None:
    name = key.rpartition(".")[2]
    if name not in (*SWEEPABLE, "frequency"):
        problems.append(f"--over {key}: unknown name{suggestion(name, (*SWEEPABLE, 'frequency'))}")
        return
    sweep = _table(tables, "sweep")
    for other in CONTACTS:
        if name in CONTACTS and other != name:
            sweep.pop(other, None)
    sweep[name] = value
    origins["sweep", name] = f"--over {key}"


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
    if isinstance(value, bool) or value != SCHEMA_VERSION:
        raise ValueError(f"unsupported schema_version: this freqrail reads {SCHEMA_VERSION} (got {value!r})")
    return SCHEMA_VERSION


def _check_points(value: object) -> list[dict[str, Quantity]]:
    if not isinstance(value, list) or not all(isinstance(point, dict) for point in value):
        raise ValueError(f'a list of points is due, such as [{{ speed = "250 km/h" }}] (got {value!r})')
    points = []
    for place, point in enumerate(value):
        checked = {}
        for name, text in point.items():
            if name not in SWEEPABLE:
                raise ValueError(f"point {place + 1}: unknown name {name!r}{suggestion(name, SWEEPABLE)}")
            try:
                checked[name] = parse_quantity(PARAMETERS[name], text)
            except ValueError as fault:
                raise ValueError(f"point {place + 1}: {name}: {fault}") from None
        points.append(checked)
    return points


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
        title=(str, ""),
        reference=(str, ""),
        **tables,
    )


def _problem(error: Any, file: str, origins: dict[tuple[str, ...], str]) -> str:
    """One line for one of pydantic's errors: where, what is wrong, what was given, what would be right."""
    where = tuple(str(part) for part in error["loc"])
    table, key = (f"[{where[0]}]", f".{where[1]}") if len(where) > 1 else ("", where[0])
    place = origins.get(where[:2], f"{file}: {table}{key}")
    sections = (*_sections(), "sweep", "confirm")
    given = error["input"]
    got = f"(got {_short(given)})"
    kind = error["type"]
    if kind == "extra_forbidden":
        if len(where) > 1:
            known = {**_sections(), "sweep": (*SWEEPABLE, "frequency"), "confirm": ("points",)}[where[0]]
            return f"{place}: unknown {'axis' if where[0] == 'sweep' else 'key'}{suggestion(where[1], known)}"
        if isinstance(given, dict):
            return f"{file}: [{key}]: unknown table{suggestion(key, sections)}"
        return f"{place}: unknown key{suggestion(key, ('schema_version', 'title', 'reference', *sections))}"
    if kind == "missing":
        if key in sections:
            return f"{file}: [{key}]: this table is missing"
        example = PARAMETERS[where[1]].example if len(where) > 1 and where[1] in PARAMETERS else ""
        name = key.removeprefix(".")
        hint = {"masses": "half", "spectrum": "german-low"}.get(name, example)
        right = f'{name} = "{hint}"' if hint else f"{name} = {SCHEMA_VERSION}"
        return f"{place}: missing; write it as in {right}"
    if kind == "value_error":
        return f"{place}: {error['ctx']['error']}"
    if kind == "literal_error" and where[-1] == "spectrum":
        return f"{place}: unknown spectrum{suggestion(str(given), SPECTRA)} {got}"
    if kind == "literal_error":
        return f'{place}: must be "half": masses and inertias are half of the whole {got}'
    if kind in ("model_type", "model_attributes_type"):
        return f"{file}: [{key}]: must be a table {got}"
    if kind == "string_type":
        return f"{place}: text is due {got}"
    return f"{place}: {error['msg'][0].lower()}{error['msg'][1:]} {got}"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _cross_checks(tables: dict[str, Any], file: str) -> list[str]:
    """Faults between keys that are there or not, whatever their values."""

    def keys(name: str) -> set[str]:
        table = tables.get(name)
        return set(table) if isinstance(table, dict) else set()

    problems = []
    contacts = keys("vehicle") & set(CONTACTS)
    if "vehicle" in tables and len(contacts) != 1:
        fault = "both are given" if contacts else "one of the two is missing"
        problems.append(f"{file}: [vehicle].contact_constant, .contact_stiffness: {fault}; give exactly one")
    if set(CONTACTS) <= keys("sweep"):
        problems.append(f"{file}: [sweep].contact_constant, .contact_stiffness: both are swept; sweep one")
    if "contact_constant" in keys("sweep") and contacts == {"contact_stiffness"}:
        problems.append(f"{file}: [sweep].contact_constant: swept, but [vehicle] gives contact_stiffness")
    rational = {"roughness", "cutoffs"}
    spectrum = tables["track"].get("spectrum") if isinstance(tables.get("track"), dict) else None
    if spectrum == "rational":
        problems += [
            f'{file}: [track].{key}: missing; spectrum = "rational" needs it'
            for key in sorted(rational - keys("track"))
        ]
    elif spectrum in GERMAN_ROUGHNESS:
        problems += [
            f'{file}: [track].{key}: belongs to spectrum = "rational" only (spectrum is "{spectrum}")'
            for key in sorted(rational & keys("track"))
        ]
    if "band" in tables and isinstance(tables["band"], dict):
        bands = keys("band") & {"frequency", "wavelength"}
        if len(bands) == 2:
            problems.append(f"{file}: [band]: both frequency and wavelength are given; give one")
        if not tables["band"]:
            problems.append(f"{file}: [band]: is empty; give frequency or wavelength, or leave the table out")
    for name in ("frequency", "wavelength"):
        if name in keys("band"):
            try:
                low, high = parse_pair(PARAMETERS[name], tables["band"][name])
            except ValueError:
                continue
            if low.value >= high.value:
                problems.append(
                    f"{file}: [band].{name}: the lower limit must be below the upper one "
                    f'(got "{low.text}" and "{high.text}")'
                )
    return problems


def _extremes(name: str, quantities: Mapping[str, Quantity], axes: tuple[Axis, ...]) -> tuple[float, float]:
    """Smallest and largest value of a quantity on the grid, SI."""
    for axis in axes:
        if axis.name == name:
            return float(axis.si[0]), float(axis.si[-1])
    return quantities[name].value, quantities[name].value


def _geometry_problems(quantities: Mapping[str, Quantity], axes: tuple[Axis, ...], file: str) -> list[str]:
    spacing = _extremes("half_bogie_spacing", quantities, axes)[0]
    wheelbase = _extremes("half_wheelbase", quantities, axes)[1]
    if spacing > wheelbase:
        return []
    return [
        f"{file}: [vehicle].half_bogie_spacing: must exceed half_wheelbase everywhere on the grid "
        f"(got {spacing:g} m and {wheelbase:g} m)"
    ]


def _point_problems(
    points: tuple[Mapping[str, Quantity], ...],
    quantities: Mapping[str, Quantity],
    axes: tuple[Axis, ...],
    file: str,
) -> list[str]:
    """Confirm points that do not lie on the grid, each with the nearest value that does."""
    swept = {axis.name: axis for axis in axes}
    problems = []
    for place, point in enumerate(points):
        for name, quantity in point.items():
            known = (
                swept[name].si if name in swept else np.array([quantities[name].value] if name in quantities else [])
            )
            if known.size and not np.any(np.isclose(known, quantity.value, rtol=1e-9, atol=0)):
                nearest = float(known[np.argmin(np.abs(np.where(np.isinf(known), 1e300, known) - quantity.value))])
                problems.append(
                    f"{file}: [confirm].points: point {place + 1}: {name} is off the grid; "
                    f'the nearest value is {shown_value(name, nearest)} (got "{quantity.text}")'
                )
    return problems


def _warn_of_soft_joints(quantities: Mapping[str, Quantity], axes: tuple[Axis, ...], file: str) -> None:
    for joint in JOINTS:
        spring = joint.replace("_joint", "")
        softest, hardest = _extremes(joint, quantities, axes)[0], _extremes(spring, quantities, axes)[1]
        if softest < SOFT_JOINT * hardest:
            warnings.warn(
                f"{file}: [vehicle].{joint}: {softest:g} N/m is {softest / hardest:.1e} of {spring} ({hardest:g} N/m), "
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


# --- writing ---------------------------------------------------------------------------------------


def to_toml(tables: Mapping[str, Any]) -> str:
    """TOML text of parsed tables, one level deep as case files are: strings, numbers, lists, points."""

    def value(item: object) -> str:
        if isinstance(item, str):
            return json.dumps(item, ensure_ascii=True).replace("\x7f", "\\u007f")
        if isinstance(item, dict):
            return "{ " + ", ".join(f"{k} = {value(v)}" for k, v in item.items()) + " }"
        if isinstance(item, list):
            return "[" + ", ".join(value(v) for v in item) + "]"
        return str(item)

    plain = [f"{k} = {value(v)}" for k, v in tables.items() if not isinstance(v, dict)]
    sections = [
        "\n".join([f"[{name}]", *(f"{k} = {value(v)}" for k, v in table.items())])
        for name, table in tables.items()
        if isinstance(table, dict)
    ]
    return "\n\n".join(["\n".join(plain), *sections]) + "\n"
