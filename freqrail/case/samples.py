"""Samples: several parameters that vary together, row by row, along one dimension `sample`.

They come from a CSV file whose head names parameters with units, from `[samples]` of a case with the columns written
out, or from Python as a mapping. The written-out form, `Samples.table`, is what a stored case holds, so that it needs
no other file.
"""

from __future__ import annotations

import csv
import io
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqrail import files
from freqrail.case.axis import Axis
from freqrail.case.parameters import VARIABLE, Parameter, suggestion
from freqrail.case.quantities import check_bounds, split_number, to_float, unit_factor, user_factor
from freqrail.errors import InputError
from freqrail.text import counted, given

SAMPLE = "sample"
"""Name of the dimension."""

NAME, NUMBER, FILE = "name", "number", "file"
"""Keys of a table of samples that are no parameters: the samples' names, their numbers if they are a part of a larger
table's, and the file that holds them instead."""

Known = Mapping[str, Parameter]
"""What may vary, by name; all of it but the speed may be sampled."""

MOST = 100_000  # samples
LARGEST_FILE = 20_000_000  # bytes of a CSV file
LONGEST_NAME = 100  # characters
_FAULTS = 10  # told of a table; of more, their number

_HEAD = re.compile(r"([^\[\]]*?)\s*(?:\[([^\[\]]*)\])?")
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|\+?inf", re.ASCII)
_QUANTITY = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,2})?) (.+)", re.ASCII)
_SHORT = 40  # characters of a number that is read without ado
_NO_SPEED = "speed cannot be sampled: every sample runs at every speed; give speeds as an axis"


@dataclass(frozen=True, eq=False)
class Samples:
    """A table of samples.

    numbers: [n], counted from 1; a part of a table keeps those of the whole. names: [n], or () if they have none.
    columns: the values of each parameter, [n] each, in any order. cells: the same as text with units, by parameter.
    """

    numbers: NDArray[np.int64]
    names: tuple[str, ...]
    columns: tuple[Axis, ...]
    cells: Mapping[str, tuple[str, ...]]

    @property
    def axis(self) -> Axis:
        """The dimension as an axis, whose values are the samples' numbers."""
        numbers = self.numbers.astype(float)
        return Axis(SAMPLE, numbers, "", numbers, "")

    @property
    def parameters(self) -> frozenset[str]:
        """The names of what is sampled."""
        return frozenset(column.name for column in self.columns)

    def at(self, numbers: Iterable[float]) -> Samples:
        """The samples with these numbers. Raises KeyError for one that there is not."""
        wanted = [int(number) for number in numbers]
        if wanted == self.numbers.tolist():
            return self
        places = {int(number): place for place, number in enumerate(self.numbers)}
        rows = [places[number] for number in wanted]
        return Samples(
            self.numbers[rows],
            tuple(self.names[row] for row in rows) if self.names else (),
            tuple(replace(column, values=column.values[rows], si=column.si[rows]) for column in self.columns),
            {name: tuple(cells[row] for row in rows) for name, cells in self.cells.items()},
        )

    def without(self, names: Collection[str]) -> Samples | None:
        """The table without some of its columns; None if it has no other."""
        columns = tuple(column for column in self.columns if column.name not in names)
        cells = {column.name: self.cells[column.name] for column in columns}
        return replace(self, columns=columns, cells=cells) if columns else None

    def table(self) -> dict[str, Any]:
        """The table as `[samples]` of a case writes it out, which `read_table` reads back to the last bit."""
        table: dict[str, Any] = {name: _joined(cells) for name, cells in self.cells.items()}
        if self.names:
            table[NAME] = list(self.names)
        if not np.array_equal(self.numbers, np.arange(1, self.numbers.size + 1)):
            table[NUMBER] = self.numbers.tolist()
        return table


def _joined(cells: Sequence[str]) -> str | list[str]:
    """Quantities as one text with their unit at its end, if they have the same one and it stands there."""
    units = {unit for _, _, unit in (cell.partition(" ") for cell in cells) if unit}
    last = cells[-1].partition(" ")[2]
    if len(units) != 1 or not last:
        return list(cells)
    return f"{', '.join(cell.partition(' ')[0] for cell in cells)} {last}"


# --- a table written out ---------------------------------------------------------------------------


def read_table(table: object, where: Callable[[str], str], folder: Path | None, variable: Known = VARIABLE) -> Samples:
    """The samples of `[samples]`, written out or in a file. Raises InputError with a line a fault.

    where: what messages call a key of the table, or with "" the table. folder: where the case file is, to which the
    file's path is relative; None where no other file may be read. variable: what may vary.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"{where('')}: must be a table {given(table)}")
    if FILE in table:
        others = [str(key) for key in table if key != FILE]
        path = table[FILE]
        if others:
            raise InputError(f"{where(FILE)}: excludes {', '.join(others)}; give the file or the columns")
        if not isinstance(path, str) or not path:
            raise InputError(f'{where(FILE)}: the name of a CSV file is expected, such as "designs.csv" {given(path)}')
        if folder is None:
            raise InputError(f"{where(FILE)}: only a case file may name another file {given(path)}")
        return read_csv(path, folder, variable)
    faults = _Faults()
    known = (*_sampled(variable), NAME, NUMBER, FILE)
    cells: dict[str, list[str]] = {}
    for key, value in table.items():
        if key in _sampled(variable):
            cells[key] = _written_out(variable[key], value, where(key), faults)
        elif key not in known:
            fault = _NO_SPEED if key == "speed" else f"unknown parameter{suggestion(str(key), known)}"
            faults.add(f"{where(str(key))}: {fault}")
    if not cells and not faults.found:
        faults.add(f'{where("")}: names no parameter; write it as in file = "designs.csv"')
    lengths = {name: len(each) for name, each in cells.items()}
    names, numbers = table.get(NAME), table.get(NUMBER)
    for key, values, kind in ((NAME, names, str), (NUMBER, numbers, int)):
        if values is not None and not (isinstance(values, list) and all(type(value) is kind for value in values)):
            what = "texts" if kind is str else "whole numbers"
            faults.add(f"{where(key)}: a list of {what} is expected {given(values)}")
        elif values is not None:
            lengths[key] = len(values)
    if len({*lengths.values()}) > 1:
        sizes = ", ".join(f"{key} {size}" for key, size in lengths.items())
        faults.add(f"{where('')}: the columns are of different lengths ({sizes})")
    faults.tell()
    return _built(cells, variable, lambda key, row: f"{where(key)}: value {row + 1}", names, numbers)


def _written_out(parameter: Parameter, value: object, place: str, faults: _Faults) -> list[str]:
    """The cells of a column, each with its unit, from "5, 10, inf MN/m" or ["5 MN/m", "inf"]."""
    if isinstance(value, str):
        parts = [part.strip() for part in value.split(",")]
        unit = parts[-1].partition(" ")[2].strip()
        return [*(part if part == "inf" or not unit else f"{part} {unit}" for part in parts[:-1]), parts[-1]]
    if isinstance(value, list) and all(isinstance(cell, str) for cell in value):
        return [cell.strip() for cell in value]
    example = parameter.example.split(" ", 1)[1]
    faults.add(f'{place}: values as text are expected, such as "1, 5, 2 {example}" {given(value)}')
    return []


# --- a CSV file ------------------------------------------------------------------------------------


def read_csv(path: str | os.PathLike[str], folder: Path | None = None, variable: Known = VARIABLE) -> Samples:
    """The samples of a CSV file, whose path is relative to `folder`. Raises InputError with a line a fault.

    The head has a column a parameter, with its unit: `primary_joint_stiffness [MN/m]`; a column `name` names samples.
    """
    label = str(path) or "."
    text = read_text(Path(folder or ".", path), label)
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    faults = _Faults()
    heads: list[tuple[str, str]] | None = None
    cells: dict[str, list[str]] = {}
    lines: list[int] = []
    try:
        for row in rows:
            if not row or not any(cell.strip() for cell in row):
                continue
            if heads is None:
                heads = _heads(row, f"{label}: line {rows.line_num}", faults, variable)
                faults.tell()
                cells = {name: [] for name, _ in heads}
                continue
            if len(lines) == MOST:
                raise InputError(f"{label}: more than {MOST} samples, the limit; split the table")
            lines.append(rows.line_num)
            _add_row(row, heads, cells, f"{label}: line {rows.line_num}", faults)
    except csv.Error as fault:
        raise InputError(f"{label}: line {rows.line_num}: not CSV: {fault}") from None
    if heads is None:
        raise InputError(f"{label}: is empty; its first line names the columns, as in {_example()}")
    if not lines:
        raise InputError(f"{label}: has no sample below its first line")
    faults.tell()
    names = cells.pop(NAME, None)
    return _built(cells, variable, lambda key, row: f"{label}: line {lines[row]}: {key}", names)


def names_in(path: Path) -> tuple[str, ...]:
    """The names in the head of a CSV file, as far as they can be read; `read_csv` says what is wrong with it."""
    try:
        head = next(csv.reader(io.StringIO(read_text(path, str(path)), newline="")), [])
    except (InputError, csv.Error):
        return ()
    found = [_HEAD.fullmatch(cell.strip()) for cell in head]
    return tuple(match[1].strip().replace(".", "_") for match in found if match)


def _example() -> str:
    return '"name,primary_joint_stiffness [MN/m]"'


def read_text(path: Path, label: str) -> str:
    """The text of a CSV file. Raises InputError for one that is missing, too large or no text."""
    try:
        if not path.exists():
            raise InputError(f"{label}: no such file; a CSV file of samples is expected")
        if not path.is_file():
            raise InputError(f"{label}: {'is a folder' if path.is_dir() else 'is not a regular file'}")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{label}: too large for a table of samples (got {size} bytes, limit {LARGEST_FILE})")
        data = files.read(path, LARGEST_FILE + 1)
    except (OSError, ValueError) as fault:
        raise InputError(f"{label}: cannot be read: {getattr(fault, 'strerror', None) or fault}") from None
    if data.startswith((b"\x89HDF", b"CDF")):
        raise InputError(f"{label}: is a NetCDF file, a CSV file of samples is expected")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(f"{label}: is UTF-16 text, a table of samples is UTF-8: save it anew with that encoding")
    if b"\0" in data:
        raise InputError(f"{label}: line {data.count(bytes([10]), 0, data.index(0)) + 1}: holds a NUL byte")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = data.count(b"\n", 0, fault.start) + 1
        raise InputError(f"{label}: line {line}: is not UTF-8 text (byte {data[fault.start]:#04x})") from None


def _heads(row: Sequence[str], place: str, faults: _Faults, variable: Known) -> list[tuple[str, str]]:
    """(name, unit) of every column."""
    if len(row) == 1 and re.search(r"[;\t]", row[0]):
        faults.add(f"{place}: columns are parted by commas, as in {_example()} {given(row[0])}")
        return []
    heads: list[tuple[str, str]] = []
    for column, cell in enumerate(row, start=1):
        found = _HEAD.fullmatch(cell.strip())
        name, unit = (found[1].strip(), found[2]) if found else (cell.strip(), None)
        name = name.replace(".", "_")  # a dotted path
        at = f"{place}: column {column}"
        if name in (name for name, _ in heads):
            faults.add(f"{at}: {name} is given twice")
        elif name == NAME and unit is None:
            pass
        elif name == "speed":
            faults.add(f"{at}: {_NO_SPEED}")
        elif name not in _sampled(variable):
            faults.add(f"{at}: unknown name {name!r}{suggestion(name, (*_sampled(variable), NAME))} {given(cell)}")
        else:
            example = variable[name].example.split(" ", 1)[1]
            try:
                if not (unit or "").strip():
                    raise ValueError(f'a unit is missing: write it as in "{name} [{example}]" {given(cell)}')
                user_factor(variable[name], str(unit).strip(), given(cell))
            except ValueError as fault:
                faults.add(f"{at}: {fault if str(fault).startswith('a unit') else f'{name}: {fault}'}")
        heads.append((name, (unit or "").strip()))
    if not faults.found and [name for name, _ in heads] == [NAME]:
        faults.add(f"{place}: names no parameter; write it as in {_example()}")
    return heads


def _add_row(
    row: Sequence[str], heads: Sequence[tuple[str, str]], cells: dict[str, list[str]], place: str, faults: _Faults
) -> None:
    """Add the values of a line to the columns, with their units."""
    if len(row) != len(heads):
        hint = "; a decimal comma? write a point" if len(row) > len(heads) else ""
        faults.add(f"{place}: {counted(len(row), 'value')} for {counted(len(heads), 'column')}{hint}")
        row = ["0"] * len(heads)
    for (name, unit), cell in zip(heads, map(str.strip, row), strict=True):
        if name == NAME:
            cells[name].append(cell)
            continue
        if not _PLAIN.fullmatch(cell):
            faults.add(f"{place}: {name}: {_no_number(cell)}")
        cells[name].append("inf" if cell in ("inf", "+inf") else f"{cell} {unit}")


def _no_number(cell: str) -> str:
    """What is wrong with a cell that is no plain number."""
    if not cell:
        return "no value; every sample needs one"
    try:
        split_number(cell, "5", given(cell))
    except ValueError as fault:
        return str(fault).replace("a number with a unit", "a number")
    return f"a number alone is expected, its unit stands in the head {given(cell)}"


# --- a mapping of Python ---------------------------------------------------------------------------


def from_mapping(columns: Mapping[str, Any]) -> dict[str, Any]:
    """A table as `[samples]` writes it out, from {"bogie_mass [kg]": [600, 650]} or
    {"bogie_mass": ["600 kg", "0.7 t"]}.

    A text is taken as in a case file. Anything with `items` will do, such as a table of pandas; a column `name` names
    the samples. Raises InputError for numbers without a unit; what else may be wrong is for `read_table` to say.
    """
    table: dict[str, Any] = {}
    for key, values in dict(columns).items():
        found = _HEAD.fullmatch(str(key).strip())
        name, unit = (found[1], (found[2] or "").strip()) if found else (str(key), "")
        name = name.replace(".", "_")  # a dotted path
        if name in table:
            raise InputError(f"samples: {name}: is given twice")
        if isinstance(values, str) and not unit:
            table[name] = values
            continue
        if isinstance(values, str) or not hasattr(values, "__iter__"):
            raise InputError(f"samples: {name}: a sequence of values is expected {given(values)}")
        cells = [value.item() if isinstance(value, np.generic) else value for value in values]
        if name == NAME:
            table[name] = [str(cell) for cell in cells]
            continue
        if name in (NUMBER, FILE):
            raise InputError(f"samples: {name}: unknown parameter{suggestion(name, (*_sampled(VARIABLE), NAME))}")
        bare = [cell for cell in cells if not isinstance(cell, str)]
        if any(isinstance(cell, bool) or not isinstance(cell, int | float) for cell in bare):
            raise InputError(f"samples: {name}: numbers or texts are expected {given(cells)}")
        if bare and not unit:
            example = (VARIABLE[name].example if name in VARIABLE else "5 MN/m").split(" ", 1)[1]
            raise InputError(f'samples: {name}: a unit is missing: write "{name} [{example}]" {given(bare[0])}')
        table[name] = [_quantity_text(cell, unit) for cell in cells]
    return table


def _quantity_text(cell: str | float, unit: str) -> str:
    text = cell if isinstance(cell, str) else repr(cell)
    return text if text == "inf" or not unit else f"{text} {unit}"


# --- values ----------------------------------------------------------------------------------------


def _sampled(variable: Known) -> list[str]:
    return [name for name in variable if name != "speed"]


def _built(
    cells: Mapping[str, Sequence[str]],
    variable: Known,
    where: Callable[[str, int], str],
    names: Sequence[str] | None = None,
    numbers: Sequence[int] | None = None,
) -> Samples:
    """The table with the values of its cells. where: what messages call a cell, by column and row from 0."""
    faults = _Faults()
    size = len(next(iter(cells.values())))
    if not size:
        raise InputError(f"{where(next(iter(cells)), 0)}: there is no sample")
    if size > MOST:
        raise InputError(f"{where(next(iter(cells)), MOST)}: more than {MOST} samples, the limit")
    columns = [_column(variable[name], each, partial_place(where, name), faults) for name, each in cells.items()]
    _check_names(names or (), size, partial_place(where, NAME), faults)
    own = np.arange(1, size + 1) if numbers is None else np.array(numbers, dtype=np.int64)
    if np.any(own < 1) or np.unique(own).size < own.size:
        faults.add(f"{where(NUMBER, 0)}: samples are numbered from 1, each its own way")
    faults.tell()
    found = tuple(column for column in columns if column is not None)
    return Samples(own, tuple(names or ()), found, {name: tuple(each) for name, each in cells.items()})


def partial_place(where: Callable[[str, int], str], key: str) -> Callable[[int], str]:
    """What messages call the rows of one column."""
    return lambda row: where(key, row)


def _column(parameter: Parameter, cells: Sequence[str], where: Callable[[int], str], faults: _Faults) -> Axis | None:
    """The values of a column, formed exactly and rounded once; None if a cell is at fault."""
    factors: dict[str, Fraction] = {}
    exact: list[tuple[int, int]] = []  # numerator and denominator in SI units; (1, 0) is inf
    si = np.empty(len(cells))
    before = faults.count
    for row, cell in enumerate(cells):
        try:
            numerator, denominator = _exactly(parameter, cell, factors)
            si[row] = numerator / denominator if denominator else np.inf
        except (ValueError, OverflowError) as fault:
            words = (
                fault if isinstance(fault, ValueError) else f"a number beyond what double precision holds {given(cell)}"
            )
            faults.add(f"{where(row)}: {words}")
        else:
            exact.append((numerator, denominator))
    if faults.count > before:
        return None
    for row in _suspects(parameter, si):
        try:
            check_bounds(parameter, float(si[row]), given(cells[row]))
        except ValueError as fault:
            faults.add(f"{where(int(row))}: {fault}")
    if faults.count > before:
        return None
    unit = parameter.shown_unit or next(iter(factors), parameter.unit)
    ratio = unit_factor(unit)[0]
    top, bottom = ratio.denominator, ratio.numerator
    values = np.array([n * top / (d * bottom) if d else np.inf for n, d in exact])
    return Axis(parameter.name, values, unit, si, ", ".join(cells[:3]))


def _exactly(parameter: Parameter, cell: str, factors: dict[str, Fraction]) -> tuple[int, int]:
    """A cell in SI units as numerator and denominator, (1, 0) for inf. factors: of the units met so far, which grow.

    Raises ValueError for what is no quantity of the parameter.
    """
    plain = _QUANTITY.fullmatch(cell)
    if plain and plain[2] in factors and len(plain[1]) <= _SHORT:
        number, unit = Decimal(plain[1]), plain[2]
    else:
        got = given(cell)
        number, unit = split_number(cell, parameter.example, got)
        if number.is_infinite():
            check_bounds(parameter, float(number), got)
            return 1, 0
        if unit not in factors:
            factors[unit] = user_factor(parameter, unit, got)
    numerator, denominator = number.as_integer_ratio()
    numerator, denominator = numerator * factors[unit].numerator, denominator * factors[unit].denominator
    if numerator and abs(numerator / denominator) < sys.float_info.min:
        to_float(Fraction(numerator, denominator), given(cell))
    return numerator, denominator


def _suspects(parameter: Parameter, si: NDArray[np.float64]) -> Iterable[int]:
    """The rows whose values may be out of bounds: none if the extremes are within them, which are intervals."""
    some = si[np.isfinite(si) & (si != 0)]
    try:
        for value in (*([some.min(), some.max()] if some.size else []), *({0.0} & {*si.tolist()})):
            check_bounds(parameter, float(value), "")
    except ValueError:
        return range(si.size)
    return ()


def _check_names(names: Sequence[str], size: int, where: Callable[[int], str], faults: _Faults) -> None:
    """Note what keeps names of samples from naming one each."""
    seen: dict[str, int] = {}
    for row, name in enumerate(names):
        if not name.strip():
            faults.add(f"{where(row)}: no value; every sample needs one")
        elif not name.isprintable() or "=" in name or len(name) > LONGEST_NAME:
            faults.add(f"{where(row)}: up to {LONGEST_NAME} printable characters and no = are expected {given(name)}")
        elif name in seen:
            faults.add(f"{where(row)}: {name!r} is the name of sample {seen[name] + 1} too")
        elif re.fullmatch(r"\d+", name, re.ASCII) and int(name) != row + 1 and int(name) <= size:
            faults.add(f"{where(row)}: {name} is the number of another sample; write a name that is none")
        seen.setdefault(name, row)


def number_of(text: str, numbers: NDArray[Any], names: Sequence[str]) -> int | None:
    """The number of the sample that a text names, by number or by name; None if there is no such sample."""
    if text in names:
        return int(numbers[list(names).index(text)])
    whole = re.fullmatch(r"\d{1,18}", text, re.ASCII)
    return int(text) if whole and np.any(numbers == int(text)) else None


class _Faults:
    """Lines about what is wrong with a table: the first few, and how many more there are."""

    def __init__(self) -> None:
        self.found: list[str] = []
        self.count = 0

    def add(self, line: str) -> None:
        self.count += 1
        if len(self.found) < _FAULTS:
            self.found.append(line)

    def tell(self) -> None:
        """Raise InputError if there is any."""
        if self.found:
            more = self.count - len(self.found)
            rest = [f"{self.found[-1].split(':')[0]}: and {counted(more, 'more fault')} of this table"] if more else []
            raise InputError(*self.found, *rest)
