"""The tables of a free vehicle before they are read: its names, and changes to them by options.

A value's name is its parameter's, or its path with underscores, "suspensions_primary_1_k"; users may also write the
path with dots.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from freqrail.case.free_vehicle import TABLES
from freqrail.case.leaves import Path as Keys
from freqrail.case.leaves import leaf_name
from freqrail.case.samples import read_text
from freqrail.errors import InputError
from freqrail.text import given

NESTED = ("bodies", "wheels", "suspensions", "variants", "outputs")
"""Tables of tables."""

_NO_VALUES = ("between", "like", "law", "direction", "contact", "shape", "bending")


def is_free(tables: Mapping[str, Any]) -> bool:
    """Whether a case describes its vehicle itself rather than by a template."""
    return "vehicle" not in tables and any(name in tables for name in TABLES)


def typed_name(name: str) -> str:
    """A name as it is used inside, from one that may be a path with dots."""
    head, dot, rest = name.partition(".")
    return rest.replace(".", "_") if dot and head in ("parameters", "sweep", "operation") else name.replace(".", "_")


def value_paths(tables: Mapping[str, Any]) -> dict[str, Keys]:
    """Where each value of a free vehicle is written, by its name; one that a suspension has of another, in its own."""
    found: dict[str, Keys] = {}
    parameters = tables.get("parameters", {})
    if isinstance(parameters, dict):
        found |= {name: ("parameters", name) for name in parameters}
    for kind in ("bodies", "wheels", "suspensions"):
        table = tables.get(kind, {})
        for name, each in table.items() if isinstance(table, dict) else ():
            if isinstance(each, dict):
                for path in _paths((kind, name), liked(table, each) if kind == "suspensions" else each):
                    found.setdefault(leaf_name(path), path)
    outputs = tables.get("outputs", {})
    for name, each in outputs.items() if isinstance(outputs, dict) else ():
        if isinstance(each, dict) and "at" in each:
            found.setdefault(leaf_name(("outputs", name, "at")), ("outputs", name, "at"))
    return found


def liked(table: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """A suspension's table with the keys of those that it is like; table: all suspensions."""
    result, at, seen = dict(own), own, 0
    while isinstance(at.get("like"), str) and isinstance(table.get(at["like"]), dict) and seen < len(table):
        at, seen = table[at["like"]], seen + 1
        result = dict(at) | result
    return {key: value for key, value in result.items() if key != "like"}


def _paths(path: Keys, table: Mapping[str, Any]) -> Iterator[Keys]:
    for key, value in table.items():
        if key == "bending" and isinstance(value, list):
            for order, mode in enumerate(value, start=1):
                if isinstance(mode, dict):
                    yield from _paths((*path, f"bending_{order}"), mode)
        elif key not in _NO_VALUES:
            if isinstance(value, dict):
                yield from ((*path, key, inner) for inner in value)
            else:
                yield (*path, key)


def set_value(tables: dict[str, Any], path: Keys, value: str) -> None:
    """Write a value; of a number without a unit, the number."""
    at: Any = tables
    for key in path[:-1]:
        order = key.removeprefix("bending_")
        at = at["bending"][int(order) - 1] if order != key and "bending" in at else at.setdefault(key, {})
    number = isinstance(at.get(path[-1]), int | float)
    try:
        at[path[-1]] = float(value) if number else value
    except ValueError:
        at[path[-1]] = value  # for the reader to refuse


def inline_shapes(tables: Mapping[str, Any], folder: Path | None, fault: Callable[[Keys, object], None]) -> None:
    """Put the points of mode shapes that stand in CSV files in their place, so that the case needs no other file.

    folder: to which the files' paths are relative; None for a text that may name no file. fault: notes what is wrong.
    """
    bodies = tables.get("bodies", {})
    for name, body in bodies.items() if isinstance(bodies, dict) else ():
        modes = body.get("bending", []) if isinstance(body, dict) else []
        for order, mode in enumerate(modes if isinstance(modes, list) else [], start=1):
            if isinstance(mode, dict) and isinstance(mode.get("shape"), str):
                at = ("bodies", name, f"bending_{order}", "shape")
                try:
                    if folder is None:
                        raise InputError("only a case file may name another file")
                    mode["shape"] = _points(read_text(folder / mode["shape"], mode["shape"]), mode["shape"])
                except InputError as wrong:
                    for line in wrong.problems:
                        fault(at, line)


def _points(text: str, file: str) -> dict[str, Any]:
    """The points of a CSV file with the head "position [m],value". Raises InputError."""
    rows = [row for row in csv.reader(io.StringIO(text, newline="")) if any(cell.strip() for cell in row)]
    head = [cell.strip() for cell in rows[0]] if rows else []
    found = re.fullmatch(r"position \[(\w+)\]", head[0]) if head else None
    if not found or head[1:] != ["value"]:
        raise InputError(f'{file}: its first line must be "position [m],value" {given(",".join(head))}')
    positions, values = [], []
    for number, row in enumerate(rows[1:], start=2):
        try:
            position, value = (float(cell) for cell in row)
        except ValueError:
            raise InputError(f"{file}: line {number}: two numbers are expected {given(','.join(row))}") from None
        positions.append(repr(position))
        values.append(value)
    return {"position": f"{', '.join(positions)} {found[1]}", "value": values}


def flat_sweep(tables: dict[str, Any]) -> None:
    """Names of axes that were written as dotted keys, which TOML reads as tables of tables, as names."""
    sweep = tables.get("sweep")
    if isinstance(sweep, dict):
        tables["sweep"] = dict(flat_names(sweep))


def flat_names(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """The names of a table's values, those under dotted keys too, and the values."""
    for key, value in table.items():
        name = typed_name(f"{before}{key}")
        if isinstance(value, dict):
            yield from flat_names(value, f"{name}_")
        else:
            yield name, value
