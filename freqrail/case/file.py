"""Case files before they are checked: finding and reading them, `--set` and `--over`, and writing TOML.

Here a case is its parsed tables, whatever they hold; `freqrail.case.case` says whether they make sense.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from freqrail import files
from freqrail.case.axis import parse_axis
from freqrail.case.free_tables import NESTED, set_value, typed_name
from freqrail.case.parameters import PARAMETERS, SWEEPABLE, nearest_name, suggestion
from freqrail.case.quantities import split_number
from freqrail.case.shipped import shipped_cases
from freqrail.errors import InputError
from freqrail.text import given

LARGEST_FILE = 1_000_000  # bytes: a case file has two thousand
CONTACTS = ("contact_constant", "contact_stiffness")
"""The two keys for the contact, of which a case gives one."""

# keys of 50 parts such as a.a.a...: no case has them, and tomllib needs memory by the square of their number
_ENDLESS_KEY = re.compile(r"""(?:(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){50}""")


def find(case: str | os.PathLike[str]) -> tuple[str, str, str]:
    """(stem, name for messages, text) of a case file or a shipped case."""
    if not isinstance(case, str | os.PathLike):
        raise InputError(f"a case file's path or a shipped case's name is expected {given(case)}")
    path = Path(case)
    wanted = str(case)
    try:
        if path.is_file():
            return os.fsencode(path.stem).decode("utf-8", "replace"), wanted, _read(path)
        exists, folder = path.exists(), path.is_dir()
    except (OSError, ValueError) as fault:
        words = getattr(fault, "strerror", None) or fault
        raise InputError(f"{wanted}: cannot be opened: {words}") from None
    shipped = shipped_cases()
    if wanted in shipped:
        return wanted, wanted, shipped[wanted]
    if exists:
        kind = "is a folder" if folder else "is not a regular file"
        raise InputError(f"{wanted or '.'}: {kind}, a case file is expected")
    raise InputError(f"{wanted}: no such case file, and no shipped case of that name{suggestion(wanted, shipped)}")


def _read(path: Path) -> str:
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path}: too large for a case file (got {size} bytes, limit {LARGEST_FILE})")
        data = files.read(path)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read: {fault.strerror}") from None
    if data.startswith((b"\x89HDF", b"CDF")):
        raise InputError(f"{path}: is a NetCDF file, a case file is expected")
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


def parse_toml(text: str, file: str) -> dict[str, Any]:
    if _ENDLESS_KEY.search(text):
        raise InputError(f"{file}: not valid as a case: nested too deeply")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        raise InputError(f"{file}: not valid TOML: {fault}{_quoted(text, str(fault))}") from None
    except ValueError:
        raise InputError(f"{file}: not valid TOML: a number with too many digits") from None
    except RecursionError:
        raise InputError(f"{file}: not valid as a case: nested too deeply") from None


def _quoted(text: str, fault: str) -> str:
    """The line of the file that a fault names, for the message."""
    line = re.search(r"at line (\d+)", fault)
    lines = text.splitlines()
    return f" {given(lines[int(line[1]) - 1])}" if line and int(line[1]) <= len(lines) else ""


# --- changes ----------------------------------------------------------------------------------------


def sections() -> dict[str, tuple[str, ...]]:
    """The keys of every table that a setting may change."""
    keys: dict[str, list[str]] = {"vehicle": ["masses"], "track": ["spectrum"], "operation": [], "band": []}
    for parameter in PARAMETERS.values():
        keys[parameter.section].append(parameter.name)
    return {section: tuple(names) for section, names in keys.items()}


def table_of(tables: dict[str, Any], name: str) -> dict[str, Any]:
    """The table of that name, made if missing; a stray value in its place is left for validation."""
    table = tables.setdefault(name, {})
    return table if isinstance(table, dict) else {}


def apply_setting(
    tables: dict[str, Any],
    key: str,
    value: str,
    problems: list[str],
    origins: dict[tuple[str, ...], str],
    scalars: bool = False,
    swept: Collection[str] = (),
    paths: Mapping[str, tuple[str, ...]] | None = None,
) -> None:
    """Change one scalar of the tables; see `case.load_case` for `scalars`. swept: names that `--over` gives besides,
    of which `apply_axis` says that only one of the two can hold. paths: of a free vehicle's values, by name."""
    label = f"--set {key}"
    if paths is not None and _apply_free_setting(tables, key, value, problems, origins, scalars, swept, paths):
        return
    if key == "band":
        if str(value).strip().lower() != "none":
            problems.append(f'{label}: only "band=none", or --set "frequency=0.1:100 Hz", will do {given(value)}')
        _refuse_both(label, [("band", "frequency"), ("band", "wavelength")], problems, origins)
        tables.pop("band", None)
        origins["band",] = label
        return
    if key in ("title", "reference"):
        tables[key] = value
        origins[(key,)] = label
        return
    section, _, name = key.rpartition(".")
    known_keys = sections()
    owners = [s for s, names in known_keys.items() if name in names and section in ("", s)]
    if section == "sweep" and name in (*SWEEPABLE, "frequency"):
        problems.append(f"{label}: an axis is replaced with {_advised_axis(name, value)}")
        return
    if not owners:
        known = known_keys.get(section, tuple(n for names in known_keys.values() for n in names))
        problems.append(f"{label}: unknown name{suggestion(name, known)}")
        return
    if name in SWEEPABLE and name in table_of(tables, "sweep") and not scalars and name not in swept:
        advised = _meant_axis(name, value)
        several = parse_axis(PARAMETERS[name], advised).values.size > 1
        words = "give it values" if several else "give it one value"
        problems.append(f"{label}: {name} is swept by the case; {words} with {_advised_axis(name, value)}")
        return
    table = table_of(tables, owners[0])
    for group in (CONTACTS, ("frequency", "wavelength")):
        for other in group if name in group else ():  # it replaces the other one of the file
            _refuse_both(label, [(owners[0], other), (owners[0],)], problems, origins)
            table.pop(other, None)
    if name == "spectrum" and value != "rational":
        table.pop("roughness", None)
        table.pop("cutoffs", None)
    if name in ("cutoffs", "frequency", "wavelength") and str(value).lstrip().startswith("["):
        with contextlib.suppress(tomllib.TOMLDecodeError):  # a list as in the file; else left to validation
            value = tomllib.loads(f"list = {value}")["list"]
    table[name] = value
    origins[owners[0], name] = label


def apply_axis(
    tables: dict[str, Any],
    key: str,
    value: str,
    problems: list[str],
    origins: dict[tuple[str, ...], str],
    option: str = "--over",
    paths: Mapping[str, tuple[str, ...]] | None = None,
) -> None:
    """Replace or add an axis of the tables; `option` is what messages call the place that it comes from. paths: of a
    free vehicle's values, by name."""
    name = key.removeprefix("sweep.")
    if paths is not None:
        name = typed_name(key)
        known = (*paths, "speed", "frequency")
        if name not in known:
            problems.append(f"{option} {key}: unknown name{nearest_name(name, known)}")
            return
        if name in paths:
            _refuse_both(f"{option} {key}", [paths[name]], problems, origins)
            table_of(tables, "sweep")[name] = value
            origins["sweep", name] = f"{option} {key}"
            return
    if name not in (*SWEEPABLE, "frequency"):
        problems.append(f"{option} {key}: unknown name{suggestion(name, (*SWEEPABLE, 'frequency'))}")
        return
    sweep = table_of(tables, "sweep")
    section = PARAMETERS[name].section
    if name in SWEEPABLE:  # `frequency` is the band's as a setting, that of spectra as an axis
        alike = CONTACTS if name in CONTACTS else (name,)
        _refuse_both(f"{option} {key}", [(section, other) for other in alike], problems, origins)
    for other in CONTACTS if name in CONTACTS else ():
        _refuse_both(f"{option} {key}", [("sweep", other)], problems, origins)
        sweep.pop(other, None)
    sweep[name] = value
    origins["sweep", name] = f"{option} {key}"


def _apply_free_setting(
    tables: dict[str, Any],
    key: str,
    value: str,
    problems: list[str],
    origins: dict[tuple[str, ...], str],
    scalars: bool,
    swept: Collection[str],
    paths: Mapping[str, tuple[str, ...]],
) -> bool:
    """Change a value of a free vehicle; whether the name is one, or is none at all, so that it is done with."""
    name, label = typed_name(key), f"--set {key}"
    if name not in paths:
        others = {each for section, names in sections().items() if section != "vehicle" for each in names}
        known = {*others, "band", "title", "reference", "speed"}
        if name in known or key in known or key.partition(".")[2] in known:
            return False
        problems.append(f"{label}: unknown name{nearest_name(name, [*paths, *sorted(others)])}")
        return True
    if name in table_of(tables, "sweep") and not scalars and name not in swept:
        problems.append(f'{label}: {name} is swept by the case; give it one value with --over "{name}={value}"')
        return True
    set_value(tables, paths[name], value)
    origins[paths[name]] = label
    return True


def _advised_axis(name: str, value: object) -> str:
    """The option that gives a swept quantity its values."""
    return f'{"--psd " if name == "frequency" else ""}--over "{name}={_meant_axis(name, value)}"'


def _meant_axis(name: str, value: object) -> str:
    """The values that were meant, in order, if they would be taken as an axis; else an example of one."""
    for text in (value, _in_order(str(value))):
        try:
            return parse_axis(PARAMETERS[name], text).text
        except ValueError:
            continue
    return PARAMETERS[name].example


def _in_order(text: str) -> str:
    """A list of values such as "10, 5, 5 MN/m" in increasing order, each once; any other text as it is."""
    parts = text.split(",")
    try:
        numbers = [split_number(part, "", "") for part in parts]
    except ValueError:
        return text
    if any(unit for _, unit in numbers[:-1]):
        return text
    shown = {number: part.strip() for (number, _), part in zip(numbers, parts, strict=True)}
    unit = numbers[-1][1]
    shown[numbers[-1][0]] = parts[-1].strip().removesuffix(unit).strip()
    return f"{', '.join(shown[number] for number in sorted(shown))} {unit}".rstrip()


def _refuse_both(
    label: str, others: list[tuple[str, ...]], problems: list[str], origins: dict[tuple[str, ...], str]
) -> None:
    """Note a problem if one of the `others`, of which only one can hold, was changed by an option before."""
    problems += [f"{label}: excludes {origins[other]}; give one of the two" for other in others if other in origins]


# --- writing ----------------------------------------------------------------------------------------


def _key(name: str) -> str:
    """A key as TOML takes it."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def to_toml(tables: Mapping[str, Any]) -> str:
    """TOML text of parsed tables as case files have them: strings, numbers, lists, points, tables of tables."""

    def value(item: object) -> str:
        if isinstance(item, str):
            return json.dumps(item, ensure_ascii=False).replace("\x7f", "\\u007f")
        if isinstance(item, dict):
            return "{ " + ", ".join(f"{k} = {value(v)}" for k, v in item.items()) + " }"
        if isinstance(item, list):
            return "[" + ", ".join(value(v) for v in item) + "]"
        return str(item)

    plain = [f"{k} = {value(v)}" for k, v in tables.items() if not isinstance(v, dict)]
    sections = []
    for name, table in tables.items():
        if isinstance(table, dict):
            nested = name in NESTED and all(isinstance(each, dict) for each in table.values())
            parts = {f"{name}.{key}": each for key, each in table.items()} if nested else {name: table}
            for path, part in parts.items():
                sections.append("\n".join([f"[{path}]", *(f"{_key(k)} = {value(v)}" for k, v in part.items())]))
    return "\n\n".join(["\n".join(plain), *sections]) + "\n"
