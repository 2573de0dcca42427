"""The tables of a free vehicle before they are read: its names, and changes to them by options.

A value's name is its parameter's, or its path with underscores, "suspensions_primary_1_k"; users may also write the
path with dots.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from freqrail.case.free_vehicle import TABLES
from freqrail.case.leaves import Path, leaf_name

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


def value_paths(tables: Mapping[str, Any]) -> dict[str, Path]:
    """Where each value of a free vehicle is written, by its name; one that a suspension has of another, in its own."""
    found: dict[str, Path] = {}
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


def _paths(path: Path, table: Mapping[str, Any]) -> Iterator[Path]:
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


def set_value(tables: dict[str, Any], path: Path, value: str) -> None:
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
