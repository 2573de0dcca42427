"""Figures: what is drawn is what the dataset holds, and every picture says what it shows."""

from __future__ import annotations

import errno
import itertools
import re
import sys
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

import freqrail
from freqrail.case.case import build_case
from freqrail.errors import FileError, InputError
from freqrail.figures import plot, sweeps
from freqrail.result import manifest
from freqrail.result.points import parse_point

AXES = {
    "speed": "100, 250, 300 km/h",
    "primary_joint_stiffness": "0.5, 5 MN/m",
    "secondary_joint_stiffness": "0.5, 5 MN/m",
}
PANELS = ("car_body_acceleration", "bogie_acceleration", "secondary_stroke", "primary_stroke")
SCALES = (1, 1, 1000, 1000)  # m/s^2 as they are, strokes in mm


def sweep(psd=False, responses="paper", **axes):
    """The shipped case over small axes; the confirm points it names lie off most of them, so they go."""
    case = freqrail.load_case("yu-damper-joint")
    text = case.text.partition("[confirm]")[0]
    over = {**AXES, **axes, **({"frequency": "log:0.1:100:25 Hz"} if psd else {})}
    return freqrail.sweep(build_case(text, over=over, name="yu-damper-joint"), responses=responses, psd=psd)


@pytest.fixture(scope="module")
def result():
    """Two by two stiffnesses, three speeds, with spectra."""
    return sweep(psd=True)


@pytest.fixture(scope="module")
def speeds_only():
    """The smallest result that has a figure: one panel."""
    return sweep(responses="bogie_acceleration", primary_joint_stiffness="5 MN/m", secondary_joint_stiffness="5 MN/m")


@pytest.fixture
def draw(tmp_path, monkeypatch):
    """Function of a dataset to its figures by name, or to the one named; they are made but not written."""
    every = sweeps.drawings

    def drawn(dataset, name=None, at=None):
        found = {}
        with monkeypatch.context() as patch:
            patch.setattr(plot, "save", lambda figure, target, *_: found.setdefault(target.stem, figure))
            if name:  # making the others would only take time
                patch.setattr(plot, "drawings", lambda *arguments: {name: every(*arguments)[name]})
            freqrail.plot(dataset, tmp_path / "unused", at=at and parse_point(at))
        return found[name] if name else found

    return drawn


def front(dataset, name, prefix="", **where):
    """RMS at the front position, in the unit that figures show."""
    values = dataset[f"{prefix}{name}_rms"].sel(where)
    return values.isel({dim: 0 for dim in ("car_position", "bogie", "axle") if dim in values.dims})


def lines(ax, colour=None, style="-"):
    return [
        line
        for line in ax.get_lines()
        if line.get_linestyle() == style and (colour is None or to_hex(line.get_color()) == to_hex(colour))
    ]


def caption(figure):
    return figure.get_suptitle().replace("\N{NO-BREAK SPACE}", " ")


def legend_texts(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


# --- the files -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("format", "head"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_every_format_gives_whole_files_and_leaves_nothing_else(speeds_only, tmp_path, format, head):
    paths = freqrail.plot(speeds_only, tmp_path / "figures", format=format)
    assert [path.name for path in paths] == [f"rms-against-speed.{format}"]
    assert {*(tmp_path / "figures").iterdir()} == {*paths, tmp_path / "figures" / manifest.NAME}
    assert paths[0].read_bytes().startswith(head)


def test_the_figures_follow_from_the_axes(result, draw):
    joints = ("primary_joint_stiffness", "secondary_joint_stiffness")
    families = ("rms-against-speed", "rms-against", "map-speed")
    assert set(draw(result)) == {f"{family}-{joint}" for family in families for joint in joints} | {"psd"}
    assert set(draw(result.isel(speed=[1]).drop_vars([n for n in result if "_psd" in n]))) == {
        f"rms-against-{joint}" for joint in joints
    }


@pytest.mark.parametrize("format", ["svg", "pdf"])
def test_vector_files_are_the_same_bytes_whenever_and_by_whomever_they_are_drawn(speeds_only, tmp_path, format):
    first = freqrail.plot(speeds_only, tmp_path / "first", format=format)[0].read_bytes()
    later = speeds_only.assign_attrs(history="2099-01-01T00:00:00Z another run")
    with matplotlib.rc_context({"font.size": 20, "svg.hashsalt": None, "axes.facecolor": "red"}):
        second = freqrail.plot(later, tmp_path / "second", format=format)[0].read_bytes()
    assert first == second


def test_drawing_leaves_matplotlib_as_it_was_and_needs_no_pyplot(speeds_only, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # importing it now is an ImportError
    before = matplotlib.rcParams.copy()
    freqrail.plot(speeds_only, tmp_path, format="svg")
    assert matplotlib.rcParams.copy() == before


def test_a_full_disk_leaves_the_old_figure_and_no_rest(speeds_only, tmp_path, monkeypatch):
    (old,) = freqrail.plot(speeds_only, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(self, file, **options):
        file.write_bytes(b"half a fig")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", full)
    with pytest.raises(FileError, match=r"rms-against-speed\.png: cannot be written: No space left"):
        freqrail.plot(speeds_only, tmp_path)
    assert old.name in before
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_only_the_folder_itself_is_made_not_its_parents(speeds_only, tmp_path):
    with pytest.raises(FileError, match="cannot be made: No such file or directory"):
        freqrail.plot(speeds_only, tmp_path / "missing" / "figures")
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="file: this folder cannot be made"):
        freqrail.plot(speeds_only, tmp_path / "file")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("character", ["\x1b", "\x07", "\x0b", "\ufffe", "\uffff", "\U0001fffe", "\x85"])
def test_a_title_of_any_characters_makes_figures_that_xml_readers_take(speeds_only, tmp_path, character):
    (path,) = freqrail.plot(speeds_only.assign_attrs(title=f"a{character}<&>ü"), tmp_path, format="svg")
    text = path.read_text(encoding="utf-8")
    assert character not in text
    titles = [e.text for e in ElementTree.fromstring(text).iter("{http://purl.org/dc/elements/1.1/}title")]
    assert titles[0] == f"a{repr(character)[1:-1]}<&>ü"


# --- what cannot be drawn --------------------------------------------------------------------------


def test_a_single_point_without_spectra_is_refused_with_what_is_needed(result, tmp_path):
    point = result[[name for name in result if "_psd" not in name]].isel(
        speed=[0], primary_joint_stiffness=[0], secondary_joint_stiffness=[0]
    )
    with pytest.raises(InputError, match=r"at least two speeds.*--psd"):
        freqrail.plot(point, tmp_path / "figures")
    assert not (tmp_path / "figures").exists()


def test_a_foreign_dataset_and_an_unknown_format_are_refused(result, tmp_path):
    with pytest.raises(InputError, match="no result of `freqrail sweep`"):
        freqrail.plot(result.drop_vars("status"), tmp_path)
    with pytest.raises(InputError, match=r"one of png, svg, pdf .*'gif'"):
        freqrail.plot(result, tmp_path, format="gif")


def test_without_spectra_the_hint_names_the_command_that_stores_them(result, speeds_only, draw):
    assert "sweep the case anew with --psd" in plot.hint(speeds_only)
    assert list(draw(speeds_only)) == ["rms-against-speed"]
    assert plot.hint(result) is None


# --- what a reader needs ---------------------------------------------------------------------------


def boxes(figure):
    """What must not cover each other, in pixels: panels and colour bars with their labels, titles, legends."""
    for ax in figure.axes:
        yield Bbox.union([ax.bbox, *(axis.get_tightbbox() for axis in (ax.xaxis, ax.yaxis) if axis.get_label_text())])
        if ax.get_title():
            yield ax.title.get_window_extent()
    yield from (legend.get_window_extent() for legend in figure.legends)
    yield figure._suptitle.get_window_extent()


JOINT = "primary_joint_stiffness"


@pytest.mark.parametrize(
    ("name", "options"),
    [
        (f"rms-against-speed-{JOINT}", {}),
        (f"map-speed-{JOINT}", {"responses": "all"}),
        ("psd", {"responses": "bogie_acceleration,primary_stroke"}),
        (f"rms-against-{JOINT}", {JOINT: "0.5, 1, 5, 10, 50, 100, inf MN/m", "speed": "100:300:10 km/h"}),
        ("map-speed-car_body_pitch_inertia", {"car_body_pitch_inertia": "1000000, 1010000, 1020000 kg*m^2"}),
    ],
)
def test_every_axis_has_its_unit_and_nothing_overlaps_or_is_cut_off(draw, name, options):
    dataset = sweep(psd=name == "psd", **{"secondary_joint_stiffness": "5 MN/m", **options})
    figure = draw(with_gaps(dataset), name)
    figure.draw_without_rendering()
    for ax in figure.axes:
        assert re.search(r"\[.+\]$", ax.get_ylabel())
        assert ax.get_label() == "<colorbar>" or re.search(r"\[.+\]$", ax.get_xlabel())
    found = list(boxes(figure))
    assert not [(one, other) for one, other in itertools.combinations(found, 2) if one.overlaps(other)]
    page = figure.bbox
    assert all(page.x0 <= box.x0 < box.x1 <= page.x1 and page.y0 <= box.y0 < box.y1 <= page.y1 for box in found)


def test_labels_bear_the_paper_s_symbols_and_the_shown_units(result, draw):
    speed = draw(result, "rms-against-speed-primary_joint_stiffness")
    assert speed.legends[0].get_title().get_text() == "$K_{pd}$"
    assert legend_texts(speed)[:2] == ["0.5 MN/m", "5 MN/m"]
    assert [ax.get_ylabel() for ax in speed.axes] == ["RMS [m/s²]", "RMS [m/s²]", "RMS [mm]", "RMS [mm]"]
    assert speed.axes[0].get_xlabel() == "speed $v$ [km/h]"
    assert [ax.get_ylabel()[-12:] for ax in draw(result, "psd").axes[1:3]] == ["[(m/s²)²/Hz]", "PSD [mm²/Hz]"]
    assert speed.axes[0].get_title() == "(a) car body vertical acceleration, over the front pivot"
    assert speed.axes[3].get_title() == "(d) primary suspension vertical stroke, axle 1"


def test_the_caption_states_what_is_held_and_the_band(result, draw):
    held = caption(draw(result, "rms-against-speed-primary_joint_stiffness"))
    assert held == "$K_{sd}$ = 5 MN/m, band: 0.1 to 100 Hz"
    assert caption(draw(result, "psd")) == "$K_{pd}$ = 5 MN/m, $K_{sd}$ = 5 MN/m, $v$ = 250 km/h, band: 0.1 to 100 Hz"


def test_a_slice_cut_out_by_the_caller_is_named_by_its_own_value_and_position(result, draw):
    cut = result.sel(secondary_joint_stiffness=0.5).isel(bogie=[1])
    figure = draw(cut, "rms-against-speed-primary_joint_stiffness")
    assert caption(figure).startswith("$K_{sd}$ = 0.5 MN/m,")
    assert figure.axes[1].get_title().endswith(", rear bogie")
    expected = result.bogie_acceleration_rms.sel(secondary_joint_stiffness=0.5, primary_joint_stiffness=5, bogie="rear")
    np.testing.assert_array_equal(lines(figure.axes[1])[1].get_ydata(), expected)


# --- what the lines are ----------------------------------------------------------------------------


def test_rms_against_speed_draws_a_line_a_stiffness_and_the_traditional_model_black_dashed(result, draw):
    figure = draw(result, "rms-against-speed-primary_joint_stiffness")
    for ax, name, scale in zip(figure.axes, PANELS, SCALES, strict=True):
        for line, stiffness in zip(lines(ax), (0.5, 5), strict=True):
            expected = front(result, name, primary_joint_stiffness=stiffness, secondary_joint_stiffness=5)
            np.testing.assert_allclose(line.get_xdata(), (100, 250, 300))
            np.testing.assert_allclose(line.get_ydata(), scale * expected, rtol=1e-15)
        (dashed,) = lines(ax, "black", "--")
        np.testing.assert_allclose(dashed.get_ydata(), scale * front(result, name, "traditional_"), rtol=1e-15)


def test_rms_against_stiffness_shows_the_traditional_model_as_a_level_of_each_speed_s_colour(result, draw):
    figure = draw(result, "rms-against-primary_joint_stiffness")
    ax = figure.axes[1]
    assert ax.get_xscale() == "log"
    for line, speed in zip(lines(ax), (100, 250, 300), strict=True):
        expected = front(result, "bogie_acceleration", speed=speed, secondary_joint_stiffness=5)
        np.testing.assert_array_equal(line.get_ydata(), expected)
        (level,) = lines(ax, line.get_color(), "--")
        assert set(level.get_ydata()) == {float(front(result, "bogie_acceleration", "traditional_", speed=speed))}


def test_along_another_axis_the_traditional_model_is_a_line_since_it_depends_on_it_too(draw):
    dataset = sweep(
        primary_joint_stiffness="5 MN/m", secondary_joint_stiffness="5 MN/m", secondary_damping="20, 54, 90 kN*s/m"
    )
    along = draw(dataset, "rms-against-secondary_damping").axes[2]
    assert along.get_xscale() == "linear"
    assert along.get_xlabel() == "secondary damping $C_s$ [kN·s/m]"
    across = draw(dataset, "rms-against-speed-secondary_damping").axes[2]
    expected = 1000 * front(dataset, "secondary_stroke", "traditional_")
    for line, speed in zip(lines(along, style="--"), (100, 250, 300), strict=True):
        np.testing.assert_allclose(line.get_ydata(), expected.sel(speed=speed), rtol=1e-15)
    for line, damping in zip(lines(across, style="--"), (20, 54, 90), strict=True):
        np.testing.assert_allclose(line.get_ydata(), expected.sel(secondary_damping=damping), rtol=1e-15)


def test_at_most_six_speeds_are_drawn_evenly_spread_with_both_ends(draw):
    dataset = sweep(speed="100:300:10 km/h", secondary_joint_stiffness="5 MN/m")
    figure = draw(dataset, "rms-against-primary_joint_stiffness")
    assert legend_texts(figure)[:6] == [f"{speed} km/h" for speed in (100, 140, 180, 220, 260, 300)]
    assert "6 of 21 values" in figure.legends[0].get_title().get_text()


def test_the_slice_that_at_names_is_the_one_that_is_drawn(result, draw):
    def drawn(at):
        figure = draw(result, "rms-against-speed-primary_joint_stiffness", at)
        return caption(figure), lines(figure.axes[0])[0].get_ydata()

    by_default, soft = drawn(None), drawn("secondary_joint_stiffness=0.5 MN/m")
    for (words, values), stiffness in ((by_default, 5), (soft, 0.5)):
        assert words.startswith(f"$K_{{sd}}$ = {stiffness} MN/m")
        expected = front(
            result, "car_body_acceleration", primary_joint_stiffness=0.5, secondary_joint_stiffness=stiffness
        )
        np.testing.assert_array_equal(values, expected)
    assert np.all(soft[1] > 1.1 * by_default[1])  # a soft secondary joint costs ride
    with pytest.raises(InputError, match=r"bogie_mass: is not swept, the case has 600 kg"):
        drawn("bogie_mass=3 t")


@pytest.mark.parametrize(
    ("at", "stiffness", "shown"), [(None, "5 MN/m", "5 MN/m"), ("secondary_joint_stiffness=inf", "inf", "∞ (rigid)")]
)
def test_a_value_off_the_grid_is_computed_anew_and_the_caption_says_so(draw, at, stiffness, shown):
    """The case's own 5 MN/m too, of which a logarithmic axis never holds the like."""
    dataset = sweep(secondary_joint_stiffness="log:1:40:4 MN/m", responses="bogie_acceleration")
    figure = draw(dataset, "rms-against-speed-primary_joint_stiffness", at)
    assert caption(figure).startswith(f"$K_{{sd}}$ = {shown} (computed anew)")
    exact = front(sweep(secondary_joint_stiffness=stiffness), "bogie_acceleration", primary_joint_stiffness=5)
    np.testing.assert_allclose(lines(figure.axes[0])[1].get_ydata(), exact.squeeze(), rtol=1e-8)
    assert f"secondary_joint_stiffness = {stiffness} is not on" in plot.note(dataset, at and parse_point(at))
    drawn_whole = draw(dataset, "rms-against-secondary_joint_stiffness")
    assert "computed anew" not in caption(drawn_whole)


def test_values_are_labelled_with_three_digits_and_with_more_where_they_would_read_alike(draw):
    dataset = sweep(secondary_joint_stiffness="log:0.7:70:4 MN/m", responses="bogie_acceleration")
    second = f"secondary_joint_stiffness={dataset.secondary_joint_stiffness.values[1]} MN/m"
    held = caption(draw(dataset, "rms-against-speed-primary_joint_stiffness", second))
    assert held.startswith("$K_{sd}$ = 3.25 MN/m,")
    assert "3.25 MN/m" in legend_texts(draw(dataset, "rms-against-speed-secondary_joint_stiffness"))
    close = sweep(secondary_joint_stiffness="5.001, 5.002 MN/m", responses="bogie_acceleration")
    labels = legend_texts(draw(close, "rms-against-speed-secondary_joint_stiffness"))
    assert {"5.001 MN/m", "5.002 MN/m"} <= set(labels)


def test_the_map_has_a_cell_a_grid_point_centred_on_it(result, draw):
    figure = draw(result, "map-speed-primary_joint_stiffness")
    panel = figure.axes[3]
    (cells,) = panel.collections
    expected = front(result, "primary_stroke", secondary_joint_stiffness=5)
    expected = 1000 * expected.transpose("primary_joint_stiffness", "speed")
    np.testing.assert_allclose(cells.get_array(), expected, rtol=1e-15)
    edges = cells.get_coordinates()[:, 0, 1]
    np.testing.assert_allclose(np.sqrt(edges[:-1] * edges[1:]), (0.5, 5))
    assert panel.get_yscale() == "log"


def test_the_psd_figure_shows_both_models_spectra_at_the_slice(result, draw):
    figure = draw(result, "psd", "primary_joint_stiffness=0.5 MN/m, speed=300 km/h")
    ax = figure.axes[2]
    joint = {"primary_joint_stiffness": 0.5, "secondary_joint_stiffness": 5}
    spectrum = 1e6 * result.secondary_stroke_psd.sel(speed=300, bogie="front", **joint)
    traditional = 1e6 * result.traditional_secondary_stroke_psd.sel(speed=300, bogie="front")
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    np.testing.assert_allclose(lines(ax)[0].get_ydata(), spectrum, rtol=1e-14)
    np.testing.assert_allclose(lines(ax, "black", "--")[0].get_ydata(), traditional, rtol=1e-14)


def test_the_psd_figure_shows_where_the_band_at_its_speed_ends(result, draw):
    """Stored spectra cover the bands of all speeds: 200 and 300 km/h over 2 to 50 m are 1.11 to 41.7 Hz."""
    axes = {"speed": "200, 300 km/h", "primary_joint_stiffness": "5 MN/m", "secondary_joint_stiffness": "5 MN/m"}
    dataset = freqrail.sweep("yu-damper-joint", axes, {"wavelength": "2:50 m"}, psd=True)
    figure = draw(dataset, "psd", "speed=250 km/h")  # off the grid
    ends = [line.get_xdata()[0] for line in lines(figure.axes[0], style=":")]
    np.testing.assert_allclose(ends, [250 / 3.6 / 50, 250 / 3.6 / 2], rtol=1e-12)
    assert "ends of the RMS's band at this speed" in legend_texts(figure)
    assert len(lines(draw(dataset, "psd", "speed=300 km/h").axes[0], style=":")) == 1
    assert "ends of the RMS's band at this speed" not in legend_texts(draw(result, "psd", "speed=300 km/h"))


def test_the_rigid_joint_is_marked_at_the_right_edge_and_left_out_of_line_and_map(draw):
    dataset = sweep(primary_joint_stiffness="0.5, 5, inf MN/m", secondary_joint_stiffness="5 MN/m")
    drawn = draw(dataset)
    figure = drawn["rms-against-primary_joint_stiffness"]
    ax = figure.axes[1]
    curves, marks = lines(ax)[::2], lines(ax)[1::2]
    for curve, mark, speed in zip(curves, marks, (100, 250, 300), strict=True):
        rigid = front(dataset, "bogie_acceleration", speed=speed, primary_joint_stiffness=np.inf)
        np.testing.assert_array_equal(curve.get_xdata(), (0.5, 5))
        assert to_hex(mark.get_color()) == to_hex(curve.get_color())
        assert set(mark.get_ydata()) == {float(rigid.squeeze())}
        assert mark.get_window_extent().x1 == pytest.approx(ax.bbox.x1, abs=3)
        assert mark.get_window_extent().x0 > curve.get_window_extent().x1
    assert "rigid joint, at the right edge" in legend_texts(figure)
    assert "rigid" in legend_texts(drawn["rms-against-speed-primary_joint_stiffness"])
    chart = drawn["map-speed-primary_joint_stiffness"]
    assert chart.axes[0].collections[0].get_array().shape == (2, 3)
    assert "the rigid joint is not drawn" in caption(chart)


def test_a_flat_response_looks_flat(draw):
    """The wheelset follows the rail whatever the joints: 0.1 % must not fill the panel."""
    dataset = sweep(responses="wheelset_acceleration", speed="250 km/h", secondary_joint_stiffness="5 MN/m")
    (ax,) = draw(dataset, "rms-against-primary_joint_stiffness").axes
    low, high = ax.get_ylim()
    values = lines(ax)[0].get_ydata()
    assert np.ptp(values) < 0.01 * values.mean()
    assert high - low > 0.09 * values.mean()
    assert low < values.min() < values.max() < high


# --- points without a result -----------------------------------------------------------------------


def with_gaps(dataset):
    """The dataset as if the softest joint at all speeds but the first, and the traditional model there, had failed."""
    failed = dataset.status.copy(data=np.zeros(dataset.status.shape, np.int8))
    failed[{"primary_joint_stiffness": 0, "speed": slice(1, None)}] = 3
    traditional = (dataset.speed == dataset.speed[0]).astype(np.int8) * 3
    gaps = dataset.assign(status=failed, traditional_status=traditional)
    for name in dataset:
        if name.endswith("_rms"):
            status = traditional if name.startswith("traditional_") else failed
            gaps[name] = dataset[name].where(status == 0).transpose(*dataset[name].dims)
    return gaps


def test_points_without_a_result_are_gaps_that_the_caption_counts(result, draw):
    drawn = draw(with_gaps(result))
    figure = drawn["rms-against-speed-primary_joint_stiffness"]
    note = "model with damper joints: 2 of 6 points lack results (gaps)"
    assert caption(figure).split("\n")[1:] == [
        note,
        "traditional model, rigid damper joints: 1 of 3 points lack results (gaps)",
    ]
    soft, stiff = lines(figure.axes[0])
    np.testing.assert_array_equal(np.isnan(soft.get_ydata()), (False, True, True))
    assert soft.get_marker() != "None"  # else its one point would not show
    assert not np.isnan(stiff.get_ydata()).any()
    chart = drawn["map-speed-primary_joint_stiffness"]
    np.testing.assert_array_equal(chart.axes[0].collections[0].get_array().mask[0], (False, True, True))
    assert caption(chart).split("\n")[1:] == [note]
    whole = draw(result, "rms-against-speed-primary_joint_stiffness")
    assert "lack results" not in caption(whole)


def test_a_lone_point_between_gaps_shows_even_on_a_line_too_dense_for_markers(draw):
    dataset = sweep(speed="100:300:5 km/h", primary_joint_stiffness="5 MN/m", secondary_joint_stiffness="5 MN/m")
    whole = lines(draw(dataset, "rms-against-speed").axes[0])[0]
    holes = dataset.assign({n: dataset[n].where(dataset.speed % 10 == 0) for n in dataset if n.endswith("_rms")})
    broken = lines(draw(holes, "rms-against-speed").axes[0])[0]
    assert whole.get_marker() == "None"
    assert broken.get_marker() != "None"
