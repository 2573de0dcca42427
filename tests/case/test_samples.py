"""Tables of samples: a CSV file, a case and a mapping give the same; what is wrong is told with file, line, column."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from freqrail.case import samples as module
from freqrail.case.case import build_case, load_case
from freqrail.case.parameters import VARIABLE
from freqrail.case.samples import MOST, from_mapping, number_of, read_csv, read_table
from freqrail.case.shipped import shipped_cases
from freqrail.errors import InputError

CSV = "name,primary_joint_stiffness [MN/m], bogie_mass [kg]\nsoft,0.5,600\nrigid,inf,700\nmiddle,5.25,0.65e3\n"
TABLE = {
    "primary_joint_stiffness": "0.5, inf, 5.25 MN/m",
    "bogie_mass": ["600 kg", "0.7 t", "650 kg"],
    "name": ["soft", "rigid", "middle"],
}


def where(key: str) -> str:
    return f"[samples].{key}" if key else "[samples]"


def lines_of(action) -> list[str]:
    with pytest.raises(InputError) as fault:
        action()
    return list(fault.value.problems)


@pytest.fixture
def csv(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text: str | bytes, name: str = "designs.csv") -> str:
        Path(name).write_bytes(text if isinstance(text, bytes) else text.encode())
        return name

    return write


# --- what is read ------------------------------------------------------------------------------------


def test_a_csv_file_a_table_and_a_mapping_give_the_same_numbers(csv):
    mapping = {
        "name": np.array(["soft", "rigid", "middle"]),
        "primary_joint_stiffness [MN/m]": np.array([0.5, math.inf, 5.25]),
        "bogie_mass": ("600 kg", "0.7 t", "650 kg"),
    }
    for found in (read_csv(csv(CSV)), read_table(TABLE, where, None), read_table(from_mapping(mapping), where, None)):
        si = {column.name: column.si.tolist() for column in found.columns}
        assert si == {"primary_joint_stiffness": [0.5e6, math.inf, 5.25e6], "bogie_mass": [600.0, 700.0, 650.0]}
        assert found.names == ("soft", "rigid", "middle")
        assert found.numbers.tolist() == [1, 2, 3]


def test_a_column_is_in_the_unit_of_its_head_or_in_the_one_that_is_shown(csv):
    found = read_csv(csv("bogie_mass [t],primary_joint_stiffness [kN/m]\n0.6,500\n"))
    assert [(column.unit, column.values.tolist()) for column in found.columns] == [("t", [0.6]), ("MN/m", [0.5])]


@pytest.mark.parametrize("text", [CSV, "bogie_mass [t]\n0.1\n0.3\n0.7\n", "primary_joint_stiffness [MN/m]\ninf\ninf\n"])
def test_a_table_written_out_reads_back_to_the_last_bit(csv, text):
    whole = read_csv(csv(text))
    for table in (whole, whole.at(whole.numbers[::-1]), whole.at([2])):
        again = read_table(table.table(), where, None)
        assert again.numbers.tolist() == table.numbers.tolist()
        assert again.names == table.names
        for one, other in zip(again.columns, table.columns, strict=True):
            assert (one.name, one.si.tobytes(), one.values.tobytes()) == (
                other.name,
                other.si.tobytes(),
                other.values.tobytes(),
            )


def test_a_part_keeps_its_numbers_and_no_other_has_them():
    table = read_table(TABLE, where, None)
    assert table.at([3, 1]).numbers.tolist() == [3, 1]
    assert table.at([3, 1]).names == ("middle", "soft")
    with pytest.raises(KeyError):
        table.at([4])
    assert table.without({"bogie_mass"}).parameters == {"primary_joint_stiffness"}
    assert table.without({*[name for name in VARIABLE if name != "speed"]}) is None


def test_a_sample_is_named_by_number_or_name():
    numbers, names = np.array([1, 3]), ("soft", "17")
    assert [number_of(text, numbers, names) for text in ("1", "3", "soft", "17", "2", "x", "-1")] == [
        1,
        3,
        1,
        3,
        None,
        None,
        None,
    ]


@pytest.mark.parametrize("text", ["\ufeff" + CSV, CSV.replace("\n", "\r\n"), CSV.replace("\n", "\n\n"), CSV.rstrip()])
def test_bom_line_ends_and_blank_lines_do_no_harm(csv, text):
    assert read_csv(csv(text)).names == ("soft", "rigid", "middle")


def test_one_row_is_a_table(csv):
    assert read_csv(csv("bogie_mass [kg]\n600\n")).numbers.tolist() == [1]


# --- what is wrong -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "designs.csv: is empty"),
        ("\n \n", "designs.csv: is empty"),
        ("bogie_mass [kg]\n", "designs.csv: has no sample below its first line"),
        ("name\nsoft\n", "designs.csv: line 1: names no parameter"),
        ("bogie_mass\n600\n", 'designs.csv: line 1: column 1: a unit is missing: write it as in "bogie_mass [kg]"'),
        ("bogie_mass []\n600\n", "designs.csv: line 1: column 1: a unit is missing"),
        ("bogie_mas [kg]\n600\n", "designs.csv: line 1: column 1: unknown name 'bogie_mas' (did you mean bogie_mass?)"),
        ("bogie_mass [kg],\n600,\n", "designs.csv: line 1: column 2: unknown name ''"),
        ("speed [km/h]\n200\n", "designs.csv: line 1: column 1: speed cannot be sampled"),
        ("bogie_mass [kN/m]\n600\n", "designs.csv: line 1: column 1: bogie_mass: wrong dimension: a mass in kg"),
        ("bogie_mass [kgg]\n600\n", "designs.csv: line 1: column 1: bogie_mass: unknown unit 'kgg'"),
        ("bogie_mass [kg],bogie_mass [t]\n1,1\n", "designs.csv: line 1: column 2: bogie_mass is given twice"),
        ("bogie_mass [kg];wheelset_mass [kg]\n1;1\n", "designs.csv: line 1: columns are parted by commas"),
        ("bogie_mass [kg]\n600\nheavy\n", 'designs.csv: line 3: bogie_mass: not a number such as "5" (got "heavy")'),
        ("bogie_mass [kg]\n600 kg\n", "designs.csv: line 2: bogie_mass: a number alone is expected"),
        ('bogie_mass [kg]\n"600,5"\n', "designs.csv: line 2: bogie_mass: a decimal comma"),
        ("bogie_mass [kg]\n600,5\n", "designs.csv: line 2: 2 values for 1 column; a decimal comma? write a point"),
        ("bogie_mass [kg],wheelset_mass [kg]\n600\n", "designs.csv: line 2: 1 value for 2 columns"),
        ("bogie_mass [kg],wheelset_mass [kg]\n,600\n", "designs.csv: line 2: bogie_mass: no value"),
        ("bogie_mass [kg]\nnan\n", "designs.csv: line 2: bogie_mass: nan is not a number"),
        ("bogie_mass [kg]\ninf\n", "designs.csv: line 2: bogie_mass: inf is not allowed here"),
        ("bogie_mass [kg]\n1e400\n", "designs.csv: line 2: bogie_mass: a number beyond what double precision holds"),
        ("primary_damping [yN*s/m]\n1e-305\n", "designs.csv: line 2: primary_damping: a number beyond what double"),
        ("bogie_mass [kg]\n600\n0\n", "designs.csv: line 3: bogie_mass: must be greater than 0 kg"),
        ("primary_joint_stiffness [N/m]\n0\n", "designs.csv: line 2: primary_joint_stiffness: must be at least 1 N/m"),
        ("name,bogie_mass [kg]\na,1\na,2\n", "designs.csv: line 3: name: 'a' is the name of sample 1 too"),
        ("name,bogie_mass [kg]\n2,1\nb,2\n", "designs.csv: line 2: name: 2 is the number of another sample"),
        ("name,bogie_mass [kg]\n,1\n", "designs.csv: line 2: name: no value"),
        ("name,bogie_mass [kg]\na=b,1\n", "designs.csv: line 2: name: up to 100 printable characters and no ="),
        ('bogie_mass [kg]\n"600\n', "designs.csv: line 2: not CSV"),
        (b"bogie_mass [kg]\n6\x000\n", "designs.csv: line 2: holds a NUL byte"),
        (b"bogie_mass [kg]\n\xff\n", "designs.csv: line 2: is not UTF-8 text (byte 0xff)"),
        ("bogie_mass [kg]\n600\n".encode("utf-16"), "designs.csv: is UTF-16 text"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_one_line(csv, text, line):
    found = lines_of(lambda: read_csv(csv(text)))
    assert len(found) == 1, found
    assert found[0].startswith(line), found
    assert "\n" not in found[0]


def test_no_file_a_folder_and_a_pipe_are_refused_at_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    os.mkfifo("pipe")
    assert lines_of(lambda: read_csv("missing.csv")) == ["missing.csv: no such file; a CSV file of samples is expected"]
    assert lines_of(lambda: read_csv("folder")) == ["folder: is a folder"]
    assert lines_of(lambda: read_csv("pipe")) == ["pipe: is not a regular file"]
    assert lines_of(lambda: read_csv("a\0b"))[0].startswith("a\0b: ")


def test_ten_million_rows_are_refused_before_they_are_read(csv, monkeypatch):
    name = csv("bogie_mass [kg]\n")
    with open(name, "r+b") as stream:
        stream.truncate(80_000_000)  # no disk: a hole
    monkeypatch.setattr(module.files, "read", lambda *args: pytest.fail("read"))
    assert lines_of(lambda: read_csv(name)) == [
        "designs.csv: too large for a table of samples (got 80000000 bytes, limit 20000000)"
    ]


def test_more_rows_than_the_limit_are_refused(csv):
    name = csv("bogie_mass [kg]\n" + "1\n" * (MOST + 1))
    assert lines_of(lambda: read_csv(name)) == [f"designs.csv: more than {MOST} samples, the limit; split the table"]


def test_of_many_faults_the_first_ten_are_told_and_the_others_counted(csv):
    found = lines_of(lambda: read_csv(csv("bogie_mass [kg]\n" + "x\n" * 25)))
    assert len(found) == 11
    assert found[-1] == "designs.csv: and 15 more faults of this table"


@pytest.mark.parametrize(
    ("table", "line"),
    [
        (17, "[samples]: must be a table (got 17)"),
        ({}, "[samples]: names no parameter"),
        ({"file": 3}, "[samples].file: the name of a CSV file is expected"),
        ({"file": "designs.csv"}, "[samples].file: only a case file may name another file"),
        ({"file": "designs.csv", "bogie_mass": "1 kg"}, "[samples].file: excludes bogie_mass"),
        ({"bogie_mas": "1 kg"}, "[samples].bogie_mas: unknown parameter (did you mean bogie_mass?)"),
        ({"speed": "200 km/h"}, "[samples].speed: speed cannot be sampled"),
        ({"bogie_mass": 600}, "[samples].bogie_mass: values as text are expected"),
        ({"bogie_mass": "600, 700"}, "[samples].bogie_mass: value 1: a unit is missing"),
        ({"bogie_mass": "600, 700 kN"}, "[samples].bogie_mass: value 1: wrong dimension"),
        ({"bogie_mass": "1, 2 kg", "wheelset_mass": "1 kg"}, "[samples]: the columns are of different lengths"),
        ({"bogie_mass": "1, 2 kg", "name": "ab"}, "[samples].name: a list of texts is expected"),
        ({"bogie_mass": "1, 2 kg", "number": [1, 1]}, "[samples].number"),
        ({"bogie_mass": "1, 2 kg", "number": [True, 2]}, "[samples].number: a list of whole numbers"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_table_is_told(table, line):
    assert lines_of(lambda: read_table(table, where, None))[0].startswith(line)


@pytest.mark.parametrize(
    ("mapping", "line"),
    [
        ({"bogie_mass": [600]}, 'samples: bogie_mass: a unit is missing: write "bogie_mass [kg]" (got 600)'),
        ({"bogie_mass [kg]": 600}, "samples: bogie_mass: a sequence of values is expected"),
        ({"bogie_mass [kg]": [None]}, "samples: bogie_mass: numbers or texts are expected"),
        ({"bogie_mass [kg]": [True]}, "samples: bogie_mass: numbers or texts are expected"),
        ({"bogie_mass [kg]": [600], "bogie_mass [t]": [1]}, "samples: bogie_mass: is given twice"),
        ({"file": ["x"]}, "samples: file: unknown parameter"),
        ({"bogie_mass [kg]": [600, math.nan]}, "samples: bogie_mass: value 2: nan is not a number"),
        ({"mass [kg]": [600]}, "samples: mass: unknown parameter"),
        (17, "samples: the path of a CSV file, or a mapping, is expected (got 17)"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_mapping_is_told(mapping, line):
    assert lines_of(lambda: load_case("yu-damper-joint", samples=mapping))[0].startswith(line)


# --- a case with samples -----------------------------------------------------------------------------


def case_text(*changes: str) -> str:
    """The shipped case with nothing swept and nothing to confirm, and more tables."""
    head = shipped_cases()["yu-damper-joint"].partition("[sweep]")[0]
    return "\n".join([head, *changes])


def test_the_file_of_a_case_is_found_from_the_case(csv, tmp_path):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "designs.csv").write_text(CSV)
    (tmp_path / "study" / "case.toml").write_text(case_text("[samples]", 'file = "designs.csv"'))
    case = load_case("study/case.toml")
    assert case.samples.names == ("soft", "rigid", "middle")
    assert [axis.name for axis in case.axes] == ["sample"]
    assert case.varied == {"primary_joint_stiffness", "bogie_mass"}


def test_the_effective_case_needs_no_file_and_gives_the_same_vehicles():
    case = load_case("yu-damper-joint", {}, {"speed": "200 km/h"}, samples=from_mapping(TABLE))
    assert "file" not in case.effective.partition("[samples]")[2]
    again = build_case(case.effective, stray_points=True)
    for name, value in vars(case.vehicles()).items():
        assert np.array_equal(value, getattr(again.vehicles(), name))
    assert again.effective == case.effective


def test_samples_vary_together_and_beside_axes():
    case = load_case("yu-damper-joint", over={"wheelset_mass": "600, 650 kg"}, samples=from_mapping(TABLE))
    vehicles = case.vehicles()
    assert [axis.name for axis in case.axes] == ["sample", "secondary_joint_stiffness", "speed", "wheelset_mass"]
    assert vehicles.shape == (3, 6, 2)
    assert vehicles.at((2, 0, 1)).bogie_mass == 650.0
    assert vehicles.at((1, 0, 0)).primary_joint_stiffness == math.inf


def test_masses_of_whole_vehicles_are_halved_in_samples_too():
    case = load_case("yu-damper-joint", {"masses": "whole"}, samples={"bogie_mass": ["600 kg"]})
    assert case.vehicles().bogie_mass.ravel().tolist() == [300.0]


def test_a_sampled_contact_constant_gives_the_contact_stiffness():
    case = load_case("yu-damper-joint", samples={"contact_constant": ["5e-8 m/N^(2/3)", "6e-8 m/N^(2/3)"]})
    stiffness = case.vehicles().contact_stiffness.ravel()
    assert stiffness[0] / stiffness[1] == pytest.approx(1.2)


def test_lengths_are_compared_sample_by_sample():
    pairs = {"half_bogie_spacing [m]": [3, 10], "half_wheelbase [m]": [1, 4]}
    load_case("yu-damper-joint", samples=pairs)
    found = lines_of(lambda: load_case("yu-damper-joint", samples={**pairs, "half_wheelbase [m]": [4, 1]}))
    assert "must exceed half_wheelbase everywhere on the grid (got 3 m and 4 m)" in found[0]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"over": {"bogie_mass": "1, 2 kg"}}, "--over bogie_mass: bogie_mass is sampled"),
        ({"settings": {"bogie_mass": "600 kg"}}, "--set bogie_mass: bogie_mass is sampled"),
    ],
)
def test_what_is_sampled_is_nothing_else(arguments, line):
    found = lines_of(lambda: load_case("yu-damper-joint", **arguments, samples=from_mapping(TABLE)))
    assert found[0].startswith(line)
    assert len(found) == 1


def test_an_axis_of_the_file_beside_its_samples_is_refused_and_replaced_by_samples_of_an_option():
    text = case_text("[samples]", 'bogie_mass = "600, 650 kg"', "[sweep]", 'bogie_mass = "600, 700 kg"')
    assert lines_of(lambda: build_case(text)) == [
        "case: [sweep].bogie_mass: bogie_mass is sampled; leave out the axis, or its column of the samples"
    ]
    assert [axis.name for axis in load_case("yu-damper-joint", samples=from_mapping(TABLE)).axes] == [
        "sample",
        "secondary_joint_stiffness",
        "speed",
    ]


def test_both_names_of_the_contact_are_too_many():
    both = {"contact_constant": ["5e-8 m/N^(2/3)"], "contact_stiffness": ["1 GN/m"]}
    assert "both are sampled" in lines_of(lambda: load_case("yu-damper-joint", samples=both))[0]
    own = {"contact_stiffness": "1 GN/m"}
    one = {"contact_constant": ["5e-8 m/N^(2/3)"]}
    assert any("sampled" in line for line in lines_of(lambda: load_case("yu-damper-joint", own, samples=one)))


def test_faults_of_samples_and_of_the_rest_are_told_together():
    text = case_text("[samples]", 'bogie_mass = "600, x kg"').replace('"15200 kg"', '"heavy"')
    found = lines_of(lambda: build_case(text))
    assert len(found) == 2
    assert "case: [samples].bogie_mass: value 2" in found[1]


def test_a_misspelt_table_is_told():
    assert "did you mean samples?" in lines_of(lambda: build_case(case_text("[sample]", 'bogie_mass = "1 kg"')))[0]


def test_points_to_confirm_name_samples_by_number_or_name():
    table = '[samples]\nbogie_mass = "600, 650 kg"\nname = ["light", "heavy"]\n[confirm]\npoints = '
    assert len(build_case(case_text(table + '[{ sample = 2 }, { sample = "light" }]')).points) == 2
    assert "there is no such sample" in lines_of(lambda: build_case(case_text(table + "[{ sample = 3 }]")))[0]
    told = lines_of(lambda: build_case(case_text(table + '[{ bogie_mass = "600 kg" }]')))
    assert 'varies with the samples: name one of them, as in "sample=1"' in told[0]
