"""The tables of a case file: which keys there are, what each must hold, and the words for what is wrong.

The pydantic model is built from the table of parameters. What can be read of a faulty file is still read here, so that
`case.case` can tell every fault of a file at once.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PlainValidator, create_model

from freqrail.case.axis import Axis, parse_axis
from freqrail.case.criteria import CRITERIA
from freqrail.case.file import CONTACTS, sections
from freqrail.case.parameters import PARAMETERS, VARIABLE, Parameter, suggestion
from freqrail.case.quantities import Quantity, parse_pair, parse_quantity
from freqrail.case.samples import SAMPLE
from freqrail.model.spectrum import GERMAN_ROUGHNESS
from freqrail.text import given

SCHEMA_VERSIONS = (1, 2)
SPECTRA = (*GERMAN_ROUGHNESS, "rational")
TEMPLATE = "half-vehicle"
"""The one template of vehicles there is."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, arbitrary_types_allowed=True)


def _quantity_field(name: str) -> Any:
    return Annotated[Quantity, PlainValidator(partial(parse_quantity, PARAMETERS[name]))]


def _pair_field(name: str) -> Any:
    return Annotated[tuple[Quantity, Quantity], PlainValidator(partial(parse_pair, PARAMETERS[name]))]


def _axis_field(parameter: Parameter) -> Any:
    return Annotated[Axis, PlainValidator(partial(parse_axis, parameter))]


def _check_version(value: object) -> int:
    if type(value) is not int or value not in SCHEMA_VERSIONS:
        known = " and ".join(map(str, SCHEMA_VERSIONS))
        raise ValueError(f"unsupported schema_version: this freqrail reads {known} {given(value)}")
    return value


def _check_text(value: str) -> str:
    """A title or reference that a file can hold; control characters are kept, and escaped when printed."""
    if "\0" in value or any("\ud800" <= c <= "\udfff" for c in value):
        raise ValueError(f"holds a NUL or another character that no file can store {given(value)}")
    return value


def _points(value: object, variable: Mapping[str, Parameter]) -> tuple[dict[int, dict[str, Quantity]], list[str]]:
    """({number: point} of the points to confirm that are in order, what is wrong with the others)."""
    if not isinstance(value, list) or not all(isinstance(point, dict) for point in value):
        return {}, [f'a list of points is expected, such as [{{ speed = "250 km/h" }}] {given(value)}']
    points: dict[int, dict[str, Quantity]] = {}
    faults: list[str] = []
    for place, point in enumerate(value, start=1):
        before = len(faults)
        points[place] = {}
        for name, text in point.items():
            if name == SAMPLE:
                points[place][name] = Quantity(math.nan, str(text))
                continue
            if name not in variable:
                faults.append(f"point {place}: unknown name {name!r}{suggestion(name, variable)}")
                continue
            try:
                points[place][name] = parse_quantity(variable[name], text)
            except ValueError as fault:
                faults.append(f"point {place}: {name}: {fault}")
        if len(faults) > before:
            del points[place]
    return points, faults


def _check_points(variable: Mapping[str, Parameter], value: object) -> list[dict[str, Quantity]]:
    """The points to confirm. Raises ValueError with one argument a fault."""
    points, faults = _points(value, variable)
    if faults:
        raise ValueError(*faults)
    return list(points.values())


def _check_accepted(value: object) -> dict[str, tuple[float, float]]:
    """The ranges that a case takes in place of the usual ones. Raises ValueError with one argument a fault."""
    if not isinstance(value, dict):
        raise ValueError(f"a table is expected, such as radius_of_gyration = [0.5, 2.5] {given(value)}")
    accepted: dict[str, tuple[float, float]] = {}
    faults: list[str] = []
    for name, ends in value.items():
        if name not in CRITERIA:
            faults.append(f"unknown warning {name!r}{suggestion(name, CRITERIA)}")
        elif not (isinstance(ends, list) and len(ends) == 2 and all(type(end) in (int, float) for end in ends)):
            faults.append(
                f"{name}: two numbers are expected, as in {name} = {list(CRITERIA[name].usual)} {given(ends)}"
            )
        elif not 0 <= ends[0] < ends[1]:  # nan too
            faults.append(f"{name}: the first number must be less than the second, none below 0 {given(ends)}")
        else:
            accepted[name] = (float(ends[0]), float(ends[1]))
    if faults:
        raise ValueError(*faults)
    return accepted


@cache
def template_model() -> Any:
    """The pydantic model of a case file of the half vehicle."""
    return model(VARIABLE, template=True)


def model(variable: Mapping[str, Parameter], template: bool = False) -> Any:
    """The pydantic model of a whole case file, its tables built from the table of names.

    variable: what may vary, by name. template: whether it has a table [vehicle]; the tables of a free vehicle are read
    elsewhere (`case.free_vehicle`).
    """

    def table(name: str, **fields: Any) -> Any:
        return create_model(name, __base__=_Table, **fields)

    vehicle: dict[str, Any] = {
        name: (_quantity_field(name), ...) for name, p in PARAMETERS.items() if p.section == "vehicle"
    }
    vehicle |= {name: (_quantity_field(name), None) for name in CONTACTS}
    vehicle |= {"masses": (Literal["half", "whole"], ...), "template": (Literal[TEMPLATE], TEMPLATE)}
    empty: Any = None
    # an alias each, because some names would hide an attribute of pydantic's
    axes: dict[str, Any] = {
        f"axis_{k}": (_axis_field(parameter), Field(None, alias=name))
        for k, (name, parameter) in enumerate({**variable, "frequency": PARAMETERS["frequency"]}.items())
    }
    tables = {
        **({"vehicle": (table("Vehicle", **vehicle), ...)} if template else {}),
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
        "sweep": (table("Sweep", **axes), empty),
        "confirm": (
            table("Confirm", points=(Annotated[list, PlainValidator(partial(_check_points, variable))], ())),
            None,
        ),
    }
    tables["accepted"] = (Annotated[dict, PlainValidator(_check_accepted)], {})
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


def axes_of(checked: Any) -> dict[str, Axis]:
    """The axes of a validated case by name."""
    fields = type(checked.sweep).model_fields
    found = {str(field.alias): getattr(checked.sweep, key) for key, field in fields.items()}
    return {name: axis for name, axis in found.items() if axis is not None}


def problems_of(
    error: Any, file: str, where: Callable[..., str], variable: Mapping[str, Parameter] = VARIABLE
) -> list[str]:
    """The lines for one of pydantic's errors: where, what is wrong, what was given, what would be right."""
    at = tuple(str(part) for part in error["loc"])
    key = at[-1]
    place = where(*at)
    tables = (*sections(), "sweep", "samples", "confirm", "accepted")
    got = given(error["input"])
    kind = error["type"]
    if kind == "value_error":
        return [f"{place}: {fault}" for fault in error["ctx"]["error"].args]
    if kind == "extra_forbidden" and len(at) > 1:
        known = {**sections(), "sweep": (*variable, "frequency"), "confirm": ("points",)}[at[0]]
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
        right = f'{key} = "{hint}"' if hint else f"{key} = {SCHEMA_VERSIONS[0]}"
        line = f"{place}: missing; write it as in {right}"
    elif kind == "literal_error" and key == "spectrum":
        wanted = error["input"] if isinstance(error["input"], str) else ""
        line = f"{place}: unknown spectrum{suggestion(wanted, SPECTRA)} {got}"
    elif kind == "literal_error" and key == "template":
        line = f'{place}: unknown template, "{TEMPLATE}" is expected {got}'
    elif kind == "literal_error":
        line = (
            f'{place}: must be "half" (masses, inertias, springs and dampers of one side) or "whole" (of both sides) '
            f"{got}"
        )
    elif kind in ("model_type", "model_attributes_type"):
        line = f"{file}: [{key}]: must be a table {got}"
    elif kind == "string_type":
        line = f"{place}: text is expected {got}"
    else:
        line = f"{place}: {error['msg'][0].lower()}{error['msg'][1:]} {got}"
    return [line]


def keys(tables: dict[str, Any], name: str) -> dict[str, Any]:
    """The keys of a table and what is written there; none if it is no table."""
    table = tables.get(name)
    return table if isinstance(table, dict) else {}


def readable(
    parse: Callable[..., Any], tables: dict[str, Any], name: str, variable: Mapping[str, Parameter] = VARIABLE
) -> dict[str, Any]:
    """What can be read of a table, whatever is wrong with the rest of it."""
    found = {}
    everything = {**PARAMETERS, **variable}
    for key, text in keys(tables, name).items():
        if key in everything:
            with contextlib.suppress(ValueError):  # told already
                found[key] = parse(everything[key], text)
    return found


def readable_points(
    tables: dict[str, Any], known: set[str], variable: Mapping[str, Parameter] = VARIABLE
) -> dict[int, dict[str, Quantity]]:
    """{number: point} of the points that can be read, without the names that cannot be judged."""
    points = _points(keys(tables, "confirm").get("points", []), variable)[0]
    return {place: {k: q for k, q in point.items() if k in known} for place, point in points.items()}


def cross_checks(tables: dict[str, Any], file: str, where: Callable[..., str]) -> list[str]:
    """Faults between keys that are there or not, whatever their values."""
    problems = []
    sweep, track, band = (keys(tables, name) for name in ("sweep", "track", "band"))
    contacts = set(keys(tables, "vehicle")) & set(CONTACTS)
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
    for name, (low, high) in readable(parse_pair, tables, "band").items():
        if name in ("frequency", "wavelength") and low.value >= high.value:
            problems.append(
                f"{where('band', name)}: the lower limit must be below the upper one "
                f'(got "{low.text}" and "{high.text}")'
            )
    return problems
