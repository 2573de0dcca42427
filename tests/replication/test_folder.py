"""The replication as a whole: a quick run against the committed one, and the folder it may replace."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.contour import QuadContourSet

from freqrail.cli import commands
from freqrail.errors import FileError, InputError
from freqrail.replication import folder as replication
from freqrail.replication.claims import CLAIMS
from freqrail.replication.figures import draw_all, pictures
from freqrail.replication.judging import FAILS, HOLDS, PARTLY
from freqrail.replication.thresholds import KNIFE_EDGE
from freqrail.result import manifest, netcdf


def read(path: Path) -> xr.Dataset:
    """A dataset of the study: some are no sweeps."""
    with netcdf.opened(path, result=False) as dataset:
        return dataset.load()


COMMITTED = Path(__file__).parents[2] / "results" / "yu-damper-joint"
needs_committed = pytest.mark.skipif(not COMMITTED.is_dir(), reason="the committed study is not in the source package")


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """A quick replication into a folder of its own."""
    return replication.replicate(tmp_path_factory.mktemp("quick") / "study", quick=True)


def verdicts(report: Path) -> dict[str, str]:
    """Verdicts by claim as a report's tables state them."""
    rows = re.findall(
        r"^\| (\S+ \S+) \| [^|]+ \| [^|]+ \| (holds|holds partly|does not hold) \|", report.read_text(), re.M
    )
    return dict(rows)


def variation_rows(report: Path) -> dict[tuple[str, str], str]:
    """Changed claims by (question, variation) as a report states them."""
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \| \d+ / \d+ / \d+ \| ([^|]+) \|", report.read_text(), re.M)
    return {(group, name): changed for group, name, changed in rows}


@needs_committed
@pytest.mark.parametrize("name", ["grid", "map", "spectra", "dampers"])
def test_a_quick_run_gives_the_committed_numbers(quick, name):
    committed = read(COMMITTED / f"{name}.nc")
    fresh = read(quick.folder / f"{name}.nc")
    assert set(fresh.data_vars) == set(committed.data_vars)
    for key, values in committed.data_vars.items():
        if not str(key).endswith("_relative_error"):
            np.testing.assert_allclose(fresh[key].values, values.values, rtol=1e-7, err_msg=str(key))


@needs_committed
def test_a_quick_run_draws_the_committed_track_and_responses(quick):
    committed, fresh = (read(folder / "track.nc") for folder in (COMMITTED, quick.folder))
    for key, values in committed.data_vars.items():
        np.testing.assert_allclose(fresh[key].values, values.values, atol=1e-5 * float(abs(values).max()))


@needs_committed
def test_a_quick_run_comes_to_the_committed_verdicts(quick):
    assert verdicts(quick.folder / "report.md") == verdicts(COMMITTED / "report.md")
    assert {key: found.verdict for key, found in quick.findings.items()} == verdicts(COMMITTED / "report.md")
    assert len(quick.findings) == len(CLAIMS)


@needs_committed
def test_a_quick_run_says_what_it_left_out_and_the_committed_one_has_it(quick):
    fresh, committed = (variation_rows(folder / "report.md") for folder in (quick.folder, COMMITTED))
    assert len(fresh) == replication.variations.count_in_frequency()
    assert set(fresh) < set(committed)
    assert {key: committed[key] for key in fresh} == fresh
    assert replication.LEFT_OUT in (quick.folder / "report.md").read_text()
    assert replication.LEFT_OUT not in (COMMITTED / "report.md").read_text()


def test_what_holds_is_said_first(quick):
    text = (quick.folder / "report.md").read_text()
    assert text.index("## What holds\n") < text.index("## What holds partly\n") < text.index("## What does not hold\n")


def test_the_page_opens_from_disk_with_every_figure_in_it(quick):
    page = (quick.folder / "report.html").read_text()
    assert page.count("data:image/svg+xml;base64,") == len(list(quick.folder.glob("*.svg"))) == 10
    assert not re.search(r'(src|href)="(?!data:|#)', page)


def test_every_axis_has_a_unit_and_every_figure_says_what_to_see(quick):
    for picture in pictures(quick.datasets):
        assert len(picture.caption) > 60
        for ax in picture.draw().axes:
            assert ax.get_ylabel().endswith("]"), (picture.stem, ax.get_ylabel())
            assert ax.get_xlabel().endswith("]") or not ax.get_xlabel()


def test_the_maps_colours_reach_to_the_largest_and_the_smallest_value(quick):
    """A colour scale that ends before the data hides how far a soft joint leads."""
    picture = next(picture for picture in pictures(quick.datasets) if picture.stem == "joint-map")
    panels = [ax for ax in picture.draw().axes if ax.get_xlabel().startswith("primary joint")]
    assert len(panels) == 4
    largest = 0.0
    for ax in panels:
        filled = next(c for c in ax.collections if isinstance(c, QuadContourSet) and c.filled)
        values = filled.get_array()
        assert filled.extend == "neither"
        assert values is not None
        low, high = (float(part.rstrip(" %").replace("−", "-")) for part in ax.get_title().split("\n")[1].split(" to "))
        assert filled.levels[0] <= low < high <= filled.levels[-1]
        largest = max(largest, high)
    grid = quick.datasets["map"]
    ratio = grid["bogie_acceleration_rms"] / grid["traditional_bogie_acceleration_rms"]
    assert largest == pytest.approx(100 * (float(ratio.sel(bogie="front").max()) - 1), abs=1)


def test_no_caption_sells_a_best_joint_of_six(quick):
    for picture in pictures(quick.datasets):
        assert "best joint" not in picture.caption.replace("not the best joint", "")


def test_every_claim_stands_beside_its_quotation_section_and_range_in_both_reports(quick):
    text, page = ((quick.folder / f"report.{kind}").read_text() for kind in ("md", "html"))
    rows = {line.split(" | ")[0].removeprefix("| "): line for line in text.splitlines() if line.startswith("| V")}
    edges = 0
    for claim in CLAIMS:
        line = next(li for li in text.splitlines() if li.startswith(f"| {claim.key} | “"))
        assert f"“{claim.quotation}” ({claim.section}, {claim.item})" in line
        assert claim.quotation in html.unescape(page)
        assert f"| {quick.findings[claim.key].verdict} |" in line
        edges += "**Knife edge**" in line
    assert set(rows) >= {claim.key for claim in CLAIMS}
    assert f"**{edges} of these verdicts are knife edges**" in text
    assert text.count(KNIFE_EDGE) == 1  # defined once, where they are counted


def test_figures_are_the_same_bytes_from_run_to_run(quick, tmp_path):
    chosen = [picture for picture in pictures(quick.datasets) if picture.stem in ("figure-6", "joint-map")]
    draw_all(chosen, tmp_path)
    assert len(list(tmp_path.iterdir())) == 4
    for path in tmp_path.iterdir():
        assert path.read_bytes() == (quick.folder / path.name).read_bytes(), path.name


@needs_committed
def test_the_committed_folder_is_small_and_complete():
    names = {path.name for path in COMMITTED.iterdir()}
    assert {"report.md", "report.html", "grid.nc", *(f"figure-{n}.svg" for n in range(3, 8))} <= names
    assert {Path(name).stem for name in names if name.endswith(".png")} == {
        Path(name).stem for name in names if name.endswith(".svg")
    }
    assert sum(path.stat().st_size for path in COMMITTED.iterdir()) < 9e6


def test_the_command_counts_verdicts(quick, monkeypatch, capsys):
    monkeypatch.setattr(replication, "replicate", lambda *arguments: quick)
    assert commands.run(["replicate", "--quick", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert set(facts["claims"]) == {HOLDS, PARTLY, FAILS}
    assert sum(facts["claims"].values()) == len(CLAIMS)


def test_a_folder_of_another_is_left_alone(tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match=r"mine: holds what this command did not write \(thesis.tex\)"):
        replication.replicate(mine, quick=True)
    assert (mine / "thesis.tex").read_text() == "years of work"


def test_a_missing_parent_is_an_output_fault(tmp_path):
    with pytest.raises(FileError, match="no such folder"):
        replication.replicate(tmp_path / "nowhere" / "study", quick=True)


def test_a_run_that_fails_leaves_the_old_folder_and_no_traces(quick, tmp_path, monkeypatch):
    study = tmp_path / "study"
    study.mkdir()
    (study / "report.md").write_text("old")
    manifest.record(study, replication.COMMAND, {"report.md": manifest.digest(study / "report.md")})
    monkeypatch.setattr(replication.variations, "in_frequency", lambda *arguments: [])
    known = {name: lambda found=found: found for name, found in quick.datasets.items()}
    monkeypatch.setattr(replication, "_DATASETS", known)
    monkeypatch.setattr(replication, "standings", lambda datasets: {})

    def full_disk(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(replication, "draw_all", full_disk)
    with pytest.raises(FileError, match="No space left"):
        replication.replicate(study, quick=True)
    assert [path.name for path in tmp_path.iterdir()] == ["study"]
    assert (study / "report.md").read_text() == "old"
