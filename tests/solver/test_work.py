"""The work that a grid takes, counted: nodes placed, blocks, products, vehicles with nodes of their own.

Values hold whatever the policy of `solver.panels` and `solver.solve`: it decides about time and memory. So it is pinned
here, by exact counts on small grids; docs/theory.md, "RMS over a band", says it in words.
"""

from __future__ import annotations

import math
import os
import threading
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.optimize import brentq

from freqrail.model.band import Band
from freqrail.model.elements import Values
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum
from freqrail.model.vehicle import Vehicle
from freqrail.reduction.columns import Reduction
from freqrail.solver import block_quadrature, block_residues, panels, quadrature, rounding, solve
from freqrail.solver.problem import Problem, half_vehicle_problem
from freqrail.solver.resonances import Resonances, every_pole, resonances
from freqrail.solver.solution import METHOD
from tests.chains import FAMILIES
from tests.helpers import PAPER_NAMES, own_quadrature

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
TABLE = TabulatedSpectrum("measured", (1e-3, 0.1, 1e3), (3e-4, 9e-5, 1e-9))
FREQUENCY, WAVELENGTH = Band("frequency", 0.1, 100.0), Band("wavelength", 1.0, 200.0)
JOINTS = np.array([1e6, 5e6, 50e6])
EPSILON = np.finfo(float).eps


def study(
    vehicle: Vehicle, speeds: object, band: Band | None = FREQUENCY, names=PAPER_NAMES, spectrum=TRACK
) -> Problem:
    return half_vehicle_problem(vehicle, np.atleast_1d(np.asarray(speeds, dtype=float)), spectrum, band, names)


def found_in(of: Problem) -> dict[int, Resonances]:
    return resonances(of.reduction, of.values, of.vehicles)


def poles_of(of: Problem) -> np.ndarray:
    return every_pole(found_in(of))


@dataclass
class Work:
    """panels: of every call that places some. squares: (vehicles, products) of every call for mean squares."""

    panels: list[int] = field(default_factory=list)
    squares: list[tuple[int, int]] = field(default_factory=list)
    closed_form: list[int] = field(default_factory=list)
    products: int = 0


def vehicles(values: Values) -> int:
    """How many the values are of."""
    return math.prod(block_quadrature.shape_of(values))


@pytest.fixture
def work(monkeypatch) -> Work:
    found = Work()
    edges, squares, product = quadrature.panel_edges, block_quadrature.mean_squares, block_quadrature.add_product
    closed = block_residues.whole_axis_mean_squares

    def counted_edges(*given):
        result = edges(*given)
        found.panels.append(result.size - 1)
        return result

    def counted_squares(reduction, values, *given):
        before = found.products
        result = squares(reduction, values, *given)
        found.squares.append((vehicles(values), found.products - before))
        return result

    def counted_product(*given):
        found.products += 1
        product(*given)

    def counted_closed(reduction, values, *given):
        found.closed_form.append(vehicles(values))
        return closed(reduction, values, *given)

    monkeypatch.setattr(quadrature, "panel_edges", counted_edges)
    monkeypatch.setattr(block_quadrature, "mean_squares", counted_squares)
    monkeypatch.setattr(block_quadrature, "add_product", counted_product)
    monkeypatch.setattr(block_residues, "whole_axis_mean_squares", counted_closed)
    return found


# --- whole grids -------------------------------------------------------------------------------------


LONG = np.array([[3.0], [6.0]])
WALKING, PAPER = (1.0, 60.0), (30.0, 60.0, 80.0)


@pytest.mark.parametrize(
    ("joints", "spacing", "speeds", "band", "placed", "squares"),
    [
        # one vehicle: the shared nodes are its own, and denser ones where they miss REFINE_ABOVE
        (5e6, 3.289, 60.0, Band("frequency", 1.0, 10.0), [3], [(1, 48)]),
        (5e6, 3.289, 60.0, FREQUENCY, [13, 15], [(1, 48), (1, 48)]),
        (5e6, 3.289, PAPER, FREQUENCY, [18, 22], [(1, 96), (1, 48)]),
        # three: all of one block, and of one, or all of them, anew
        (JOINTS, 3.289, 60.0, FREQUENCY, [16], [(3, 64)]),
        (JOINTS, 3.289, 60.0, Band("frequency", 1.0, 10.0), [5, 6], [(3, 48), (1, 48)]),
        (JOINTS, 3.289, PAPER, WAVELENGTH, [20, 23, 21, 21], [(3, 96), (1, 48), (1, 48), (1, 48)]),
        # a block for each geometry
        (JOINTS, LONG, PAPER, WAVELENGTH, [26, 29], [(3, 96), (3, 96), (1, 48)]),
        # two groups of speeds, the fast one first
        (5e6, 3.289, WALKING, FREQUENCY, [13, 368, 15, 459], [(1, 48), (1, 48), (1, 1152), (1, 496)]),
        (JOINTS, LONG, WALKING, FREQUENCY, [19, 610, 19, 21], [(3, 96)] * 2 + [(1, 48)] * 2 + [(3, 1920)] * 2),
    ],
)
def test_panels_placed_and_products_made(paper_vehicle, work, joints, spacing, speeds, band, placed, squares):
    """Shared panels are placed for all groups of speeds at once, before any block."""
    vehicle = replace(paper_vehicle, primary_joint_stiffness=joints, half_bogie_spacing=spacing)
    solution = solve.solve(study(vehicle, speeds, band))
    assert np.all(solution.status == 0)
    assert work.panels == placed
    assert work.squares == squares
    assert work.closed_form == []


RINGING = {"primary_joint_stiffness": np.geomspace(1e6, 1e8, 17), "bogie_mass": np.linspace(500, 700, 18)[:, None]}
"""306 vehicles whose wheelsets ring near 195 Hz, and 300 poles known."""


def test_where_nothing_is_shared_each_vehicle_has_panels_of_its_own(paper_vehicle, work):
    """The track is tabulated: it has no density off the axis, by which to go around the peaks."""
    vehicle = replace(paper_vehicle, **RINGING)
    solution = solve.solve(study(vehicle, 60.0, Band("frequency", 150.0, 200.0), spectrum=TABLE))
    assert len(work.panels) == 306
    assert [count for count, _ in work.squares] == [1] * 306
    assert np.all(solution.method == METHOD.index("own_quadrature"))


def test_where_peaks_are_gone_around_panels_are_placed_once(paper_vehicle, work):
    """16 columns; of the embedded rule's nodes one part on the axis and one on the detour, of the others as many."""
    vehicle = replace(paper_vehicle, **RINGING)
    solution = solve.solve(study(vehicle, 60.0, Band("frequency", 150.0, 200.0)))
    assert work.panels == [28]
    assert work.squares == [(81, 96), (72, 96), (81, 96), (72, 96)]
    assert np.all(solution.method == METHOD.index("shared_quadrature"))


# --- groups of speeds --------------------------------------------------------------------------------


def needed(of: Problem) -> float:
    """Nodes that lags and edges call for: a panel of 21 for 14 rad of the longest lag, and one between two edges."""
    edges = np.unique(of.limits)
    lag = 2 * (of.values["half_bogie_spacing"] + of.values["half_wheelbase"]) / of.speed.min()
    return 21 * (edges[-1] - edges[0]) * lag / 14 + 21 * (edges.size - 1)


@pytest.mark.parametrize("fastest", [80.0, 4.0])
@pytest.mark.parametrize("band", [FREQUENCY, WAVELENGTH])
def test_a_group_grows_to_2000_nodes_or_twice_what_its_fastest_needs(paper_vehicle, fastest, band):
    """One more node than that, and the slower speed begins a group."""
    alone = needed(study(paper_vehicle, fastest, band))
    assert (2 * alone > 2000) == (fastest == 4 and band == FREQUENCY)
    most = max(2000.0, 2 * alone)

    def beside(slowest: float) -> Problem:
        return study(paper_vehicle, [fastest, slowest], band)

    for nodes, groups in ((most - 0.5, [[0, 1]]), (most + 0.5, [[0], [1]])):
        of = beside(brentq(lambda slowest, nodes=nodes: needed(beside(slowest)) - nodes, 0.05, 0.999 * fastest))
        assert [group.tolist() for group in panels.speed_groups(of, poles_of(of))] == groups


def test_a_group_has_500_speeds(paper_vehicle):
    of = study(paper_vehicle, np.linspace(50.0, 60.0, 1001))
    assert [group.size for group in panels.speed_groups(of, poles_of(of))] == [500, 500, 1]


# --- shared or each its own --------------------------------------------------------------------------


def point(vehicle: Vehicle) -> Vehicle:
    """A vehicle so short that its lags call for no node."""
    return replace(vehicle, half_bogie_spacing=1e-3, half_wheelbase=1e-3)


@pytest.mark.parametrize(("highest", "count", "shared"), [(1.5, 3, True), (3.0, 4, False)])
def test_nodes_are_shared_up_to_three_times_what_the_lags_and_edges_need(
    paper_vehicle, work, monkeypatch, highest, count, shared
):
    """A panel, 21 nodes, for the band of a vehicle without lags, and a hair: 3 panels are below three times that."""
    monkeypatch.setattr(panels, "SHARED_NODES", 1)
    (found,) = panels.shared_panels(study(point(paper_vehicle), 60.0, Band("frequency", 0.1, highest)))
    assert work.panels == [count]
    assert (found.edges is not None) is shared


def test_nodes_are_shared_up_to_a_number_of_them(paper_vehicle, work, monkeypatch):
    """5 panels of 21 nodes."""
    of = study(point(paper_vehicle), 60.0, Band("frequency", 0.1, 10.0))
    for most, shared in ((105, True), (104, False)):
        monkeypatch.setattr(panels, "SHARED_NODES", most)
        (found,) = panels.shared_panels(of)
        assert (found.edges is not None) is shared
    assert work.panels == [5, 5]


def test_nodes_are_shared_up_to_a_number_of_nodes_times_speeds(paper_vehicle, work, monkeypatch):
    """18 panels of 21 nodes at three speeds; panels are not placed where the lags alone call for more."""
    of = study(paper_vehicle, PAPER)
    by_lags = quadrature.fewest_nodes(of.limits[:, 0], 2 * (3.289 + 0.797) / 30)
    for most, placed, shared in (
        (3 * 18 * 21, [18], True),
        (3 * 18 * 21 - 1, [18], False),
        (3 * by_lags, [18], False),
        (3 * by_lags - 1, [], False),
    ):
        work.panels.clear()
        monkeypatch.setattr(panels, "SHARED_WEIGHTS", most)
        (found,) = panels.shared_panels(of)
        assert work.panels == placed
        assert (found.edges is not None) is shared


@pytest.mark.parametrize("spectrum", [TRACK, TABLE], ids=["rational", "table"])
def test_a_peak_of_less_than_one_percent_is_not_shared_unless_it_is_gone_around_or_every_vehicle_is_known(
    paper_vehicle, spectrum
):
    """The car body's bounce; 301 vehicles, of which 300 are sampled."""
    masses = np.linspace(600.0, 601.0, 301)

    def grid(damping: float, count: int) -> Problem:
        vehicle = replace(paper_vehicle, secondary_damping=damping, bogie_mass=masses[:count])
        return study(vehicle, 60.0, Band("frequency", 0.1, 15.0), ("car_body_acceleration",), spectrum)

    def sharpest(damping: float) -> float:
        of = grid(damping, 301)
        poles = poles_of(of.cut(panels._sample(of.vehicles)))
        inside = np.abs(np.abs(poles.imag) - 2 * np.pi * 7.55) < 2 * np.pi * 7.45
        return float(np.min(np.abs(poles.real[inside] / poles.imag[inside])))

    for ratio, blunt in ((0.00995, False), (0.01005, True)):
        damping = brentq(lambda x, ratio=ratio: sharpest(x) - ratio, 500.0, 5e3, xtol=0.01)
        for count, known in ((301, False), (300, True)):
            (found,) = panels.shared_panels(grid(damping, count))
            around = spectrum is TRACK and not blunt
            assert len(found.detours) == around
            assert (found.edges is not None) is (blunt or known or around)


def test_a_peak_outside_the_band_of_all_speeds_keeps_no_one_from_sharing(paper_vehicle):
    """The wheelsets ring near 195 Hz: just above the band, just below, inside, at its end."""
    joints = np.geomspace(0.5e6, 1e8, 20)
    many = replace(paper_vehicle, primary_joint_stiffness=joints, secondary_joint_stiffness=joints[:, None])
    for low, high, inside in ((0.1, 190.0, False), (200.0, 300.0, False), (190.0, 200.0, True), (190.0, 195.0, True)):
        for spectrum in (TRACK, TABLE):
            (found,) = panels.shared_panels(study(many, 60.0, Band("frequency", low, high), spectrum=spectrum))
            around = spectrum is TRACK and high == 200
            assert len(found.detours) == around
            assert (found.edges is not None) is (not inside or around)


@pytest.mark.parametrize(("place", "shared"), [("inside", False), ("outside", True), ("nowhere", True)])
def test_a_peak_whose_width_no_one_knows_keeps_all_from_sharing(paper_vehicle, monkeypatch, place, shared):
    """One inside the band, of one vehicle: the car body's bounce near 1.1 Hz; the wheelsets' is outside."""
    found_by = panels.resonances

    def unknown(*given, **options):
        found = found_by(*given, **options)
        low, high = {"inside": (0.5, 2.0), "outside": (150.0, 250.0), "nowhere": (1e6, 1e7)}[place]
        result = {}
        for index, each in found.items():
            frequency = np.abs(each.poles.imag) / 2 / np.pi
            there = (frequency > low) & (frequency < high)
            result[index] = replace(each, known=~(there & (np.cumsum(there) == 1)))
        return result

    monkeypatch.setattr(panels, "resonances", unknown)
    (found,) = panels.shared_panels(study(replace(paper_vehicle, primary_joint_stiffness=JOINTS), 60.0))
    assert (found.edges is not None) is shared


@pytest.mark.parametrize(
    ("shape", "sampled"),
    [
        ((), ()),
        ((300,), (300,)),
        ((301,), (300,)),
        ((5000,), (300,)),
        ((40, 50), (17, 17)),
        ((2, 1000), (2, 17)),
        ((1, 1000), (1, 300)),
        ((7, 1, 600), (7, 1, 17)),
        ((10, 10, 10), (6, 6, 6)),
        ((3,) * 9, (2,) * 9),
    ],
)
def test_about_300_vehicles_place_the_shared_nodes(paper_vehicle, shape, sampled):
    """As many along every axis that varies, its two ends at least."""
    axes = [name for name, value in vars(paper_vehicle).items() if np.ndim(value) == 0]
    lengths = {
        name: np.arange(1.0, 1 + n).reshape([-1 if k == place else 1 for k in range(len(shape))])
        for place, (name, n) in enumerate(zip(axes, shape, strict=False))
    }
    whole = study(replace(paper_vehicle, **lengths), 60.0)
    assert whole.cut(panels._sample(whole.vehicles)).vehicles == sampled


# --- nodes of its own --------------------------------------------------------------------------------


def test_a_vehicles_own_panels_are_a_quarter_denser(paper_vehicle):
    """Where the lags decide: 14/1.25 rad a panel."""
    of = study(replace(paper_vehicle, half_bogie_spacing=100.0), 60.0)
    lag = 2 * (100.0 + paper_vehicle.half_wheelbase) / 60.0
    (shared,) = panels.shared_panels(of)
    own = panels.own_edges(of, poles_of(of))
    assert np.max(np.diff(shared.edges)) == pytest.approx(14.0 / lag, rel=1e-9)
    assert np.max(np.diff(own)) == pytest.approx(14.0 / 1.25 / lag, rel=1e-9)


@pytest.mark.parametrize("speeds", [(60.0,), (60.0, 60.0, 60.0)])
def test_a_rule_of_ten_million_nodes_times_speeds_is_not_begun(paper_vehicle, monkeypatch, speeds):
    """Twice what the lags call for counts."""
    placed: list[float] = []
    monkeypatch.setattr(quadrature, "panel_edges", lambda first, poles, lag, refine: placed.append(lag))
    size = 1e7 / len(speeds) / 2 / 21 * 14 / (2 * np.pi * 99.9) * 60 / 2
    for change, begun in ((-1e-9, 1), (0.3e-7, 1), (-1e-9, 2)):
        long = replace(paper_vehicle, half_bogie_spacing=size * (1 + change) - paper_vehicle.half_wheelbase)
        of = study(long, speeds)
        assert panels.own_edges(of, poles_of(of)) is None
        assert len(placed) == begun


def test_a_response_whose_rounding_is_above_the_tolerance_is_not_tried(paper_vehicle, monkeypatch):
    """1e-6 of an RMS, twice that of its square; of several speeds one is enough to try."""
    tried: list[tuple[str, ...]] = []
    squares = block_quadrature.mean_squares
    monkeypatch.setattr(
        block_quadrature,
        "mean_squares",
        lambda reduction, *given: tried.append(tuple(reduction.columns)) or squares(reduction, *given),
    )
    names = ("bogie_acceleration", "primary_stroke")
    just = 2e-6
    above = np.nextafter(just, 1.0)
    for lost, expected in (([just, 1.0], [names]), ([above, 1.0], [names[:1]])):
        tried.clear()
        errors = {names[0]: np.full(2, 1e-12), names[1]: np.array(lost)}
        monkeypatch.setattr(solve, "rounding_errors", lambda of, found, errors=errors: errors)
        own_quadrature(study(paper_vehicle, (30.0, 60.0), FREQUENCY, names))
        assert tried == expected


def test_500_nodes_of_a_vehicle_are_taken_at_once(paper_vehicle, work):
    """Of 91 panels 910 nodes of the embedded rule in 2 parts, with two products each, and 1001 others in 3."""
    names = ("car_body_acceleration",)
    of = study(paper_vehicle, (30.0, 60.0), Band("frequency", 0.1, 496.0), names)
    own_quadrature(of)
    columns = 3  # bounce, pitch and what they have in common
    assert work.panels == [91]
    assert work.squares == [(1, columns * (2 * 2 + 3))]


def test_160_nodes_of_a_grid_are_taken_at_once(paper_vehicle, work):
    """Of 16 panels 160 nodes of the embedded rule in one part, with two products each, and 176 others in 2."""
    names = ("car_body_acceleration", "primary_stroke")
    many = replace(paper_vehicle, primary_joint_stiffness=JOINTS)
    solve.solve(study(many, 60.0, FREQUENCY, names))
    columns = 3 + 7  # of two chains, and of all three
    assert work.panels == [16]
    assert work.squares == [(3, columns * (1 * 2 + 2))]


def test_vehicles_with_an_estimate_above_1e_8_are_refined(paper_vehicle, work, monkeypatch):
    """At any position of any response and any speed; relative to the RMS, half that of its square."""
    many = replace(paper_vehicle, primary_joint_stiffness=JOINTS)
    squares = block_quadrature.mean_squares
    for error, refined in ((0.995e-8, []), (1.005e-8, [1])):

        def doubtful(reduction, values, *given, error=error):
            result = squares(reduction, values, *given)
            if vehicles(values) == 3:
                found = result["bogie_acceleration"]
                found.error[1, 1, 2] = 2 * error * found.value[1, 1, 2]
            return result

        with monkeypatch.context() as patch:
            patch.setattr(block_quadrature, "mean_squares", doubtful)
            solution = solve.solve(study(many, PAPER))
        own = np.flatnonzero(np.all(solution.method == METHOD.index("own_quadrature"), axis=-1))
        assert own.tolist() == refined
    assert [count for count, _ in work.squares] == [3, 3, 1]


def test_an_estimate_that_is_just_good_enough_is_not_refined(paper_vehicle, work, monkeypatch):
    many = replace(paper_vehicle, primary_joint_stiffness=JOINTS)
    monkeypatch.setattr(solve, "REFINE_ABOVE", np.inf)
    shared = solve.solve(study(many, PAPER, WAVELENGTH))
    worst = np.max([np.max(error, axis=(0, -1)) for error in shared.relative_error.values()], axis=0)
    order = np.argsort(-worst)
    for count in range(3):
        work.panels.clear()
        monkeypatch.setattr(solve, "REFINE_ABOVE", worst[order[count]])
        solution = solve.solve(study(many, PAPER, WAVELENGTH))
        assert len(work.panels) == 1 + count
        own = np.flatnonzero(solution.method[:, 0] == METHOD.index("own_quadrature"))
        assert set(own) == set(order[:count])


def test_a_closed_form_that_is_just_good_enough_is_not_improved(paper_vehicle, monkeypatch):
    many = replace(paper_vehicle, primary_joint_stiffness=JOINTS)
    closed = solve.solve(study(many, PAPER, None))
    worst = np.max([np.max(error, axis=(0, -1)) for error in closed.relative_error.values()], axis=0)
    order = np.argsort(-worst)
    for count in range(3):
        improved: list[tuple[int, ...]] = []
        monkeypatch.setattr(solve, "_improve", lambda of, solution, index, improved=improved: improved.append(index))
        monkeypatch.setattr(solve, "TOLERANCE", worst[order[count]])
        solve.solve(study(many, PAPER, None))
        assert sorted(improved) == sorted((k,) for k in order[:count])


# --- what nodes reach, and what is owned up to -------------------------------------------------------


def test_without_a_band_nodes_reach_twenty_times_the_highest_resonance(paper_vehicle):
    of = study(paper_vehicle, PAPER, None)
    assert panels.first_edges(of, np.array([-1 + 300j, -1 - 400j, -500.0])).tolist() == [0.0, 8000.0]
    assert panels.first_edges(of, np.array([], dtype=complex)).tolist() == [0.0, 20.0]


def test_edges_are_those_of_every_speeds_band_and_the_kinks_inside(paper_vehicle):
    table = TabulatedSpectrum("measured", (0.02, 0.1, 3.0), (3e-4, 9e-5, 1e-9))
    of = study(paper_vehicle, (10.0, 20.0), None, spectrum=table)
    assert panels.first_edges(of, np.array([1j])) == pytest.approx([0.2, 0.4, 1.0, 2.0, 30.0, 60.0], rel=1e-12)
    of = study(paper_vehicle, (10.0, 20.0), Band("frequency", 1.5 / 2 / np.pi, 10 / 2 / np.pi), spectrum=table)
    assert panels.first_edges(of, np.array([1j])) == pytest.approx([1.5, 2.0, 10.0], rel=1e-12)


@pytest.mark.parametrize(
    ("band", "poles", "highest"),
    [(FREQUENCY, [-30 + 300j], 200 * np.pi), (None, [-30 + 300j], 20 * 300.0), (None, [], 20.0)],
)
def test_the_phase_of_the_longest_lag_is_known_to_the_rounding_of_the_highest_frequency(
    paper_vehicle, band, poles, highest
):
    """With two million kilometres from the first axle to the last nothing else counts."""
    here = np.array(poles, dtype=complex)
    found = Resonances(here, np.full(here.shape, True), np.zeros(here.shape), np.zeros(here.shape, int), {}, {})
    long = replace(paper_vehicle, half_bogie_spacing=np.array([1e6, 1e9 - 0.5]), half_wheelbase=0.5)
    for speed in (20.0, 60.0):
        of = study(long, speed, band, ("bogie_acceleration",))
        errors = rounding.rounding_errors(of, dict.fromkeys(found_in(of.at((0,))), found))
        phase = EPSILON * highest * 2e9 / speed
        assert errors["bogie_acceleration"] == pytest.approx([phase], rel=1e-4)


def test_a_peak_of_unknown_width_leaves_no_estimate_to_the_responses_that_it_enters(paper_vehicle):
    """One block of two is enough; the bogies' pitch alone is not concerned."""
    names = ("bogie_acceleration", "bogie_pitch_acceleration")
    of = study(paper_vehicle, 60.0, FREQUENCY, names)
    entered = of.reduction.blocks_in("bogie_acceleration")
    assert len(entered) == 2
    for index in entered:
        found = found_in(of)
        found[index] = replace(found[index], known=np.zeros(found[index].poles.shape, dtype=bool))
        errors = rounding.rounding_errors(of, found)
        assert errors["bogie_acceleration"].tolist() == [np.inf]
        assert np.all(errors["bogie_pitch_acceleration"] < 1e-11)


def test_the_bound_of_the_tail_begins_where_the_nodes_end(paper_vehicle, monkeypatch):
    begun, ended = [], []
    bound, edges = block_quadrature.truncation_bound, quadrature.panel_edges
    monkeypatch.setattr(block_quadrature, "truncation_bound", lambda *given: begun.append(given[-1]) or bound(*given))
    monkeypatch.setattr(quadrature, "panel_edges", lambda *given: ended.append(edges(*given)) or ended[-1])
    own_quadrature(study(paper_vehicle, PAPER, None))
    assert begun == [ended[0][-1]]


# --- blocks, threads, timing -------------------------------------------------------------------------


def test_blocks_in_closed_form_have_at_most_51200_points(paper_vehicle, monkeypatch):
    """At 100 speeds 512 vehicles: 700 are two blocks of 350."""

    def ones(reduction: Reduction, values: Values, spectrum: object, speed: np.ndarray):
        grid = block_quadrature.shape_of(values)
        shapes = {name: (len(FAMILIES[name].signs), *grid, speed.size) for name in reduction.columns}
        return {name: quadrature.MeanSquare(np.ones(shape), np.full(shape, 1e-12)) for name, shape in shapes.items()}

    done: list[int] = []
    monkeypatch.setattr(block_residues, "whole_axis_mean_squares", ones)
    many = replace(paper_vehicle, bogie_mass=np.linspace(500, 700, 700))
    solve.solve(study(many, np.linspace(30, 80, 100), None), progress=done.append)
    assert done == [35_000, 35_000]


def test_blocks_of_a_grid_have_at_most_256_vehicles(paper_vehicle, work):
    many = replace(paper_vehicle, bogie_mass=np.linspace(580, 620, 257))
    solve.solve(study(many, 60.0, Band("frequency", 1.0, 100.0), ("car_body_acceleration",)))
    assert [count for count, _ in work.squares][:2] == [129, 128]


def test_blocks_of_spectra_have_at_most_250000_numbers(paper_vehicle):
    """Of 100 frequencies at 25 speeds 100 vehicles, a power of two of them: 64."""
    done: list[int] = []
    many = replace(paper_vehicle, bogie_mass=np.linspace(500, 700, 128))
    of = study(many, np.linspace(30, 80, 25), FREQUENCY, ("car_body_acceleration",))
    solve.psd(of, np.linspace(1.0, 20.0, 100), done.append)
    assert done == [64 * 25] * 2


def test_work_starts_no_thread_unless_asked(paper_vehicle, monkeypatch):
    threads = set()
    store = solve._store
    monkeypatch.setattr(solve, "BLOCK", 1)
    monkeypatch.setattr(solve, "_store", lambda *given: threads.add(threading.get_ident()) or store(*given))
    solve.solve(study(replace(paper_vehicle, primary_joint_stiffness=JOINTS), 60.0))
    assert threads == {threading.get_ident()}


@pytest.mark.parametrize(("jobs", "count", "apart"), [(1, 2, False), (2, 1, False), (2, 2, True), (3, 5, True)])
def test_threads_are_started_for_two_items_and_two_jobs(jobs, count, apart):
    threads = set()
    solve._run(lambda item: threads.add(threading.get_ident()), list(range(count)), jobs)
    assert (threading.get_ident() not in threads) is apart


@pytest.mark.parametrize(("allowed", "there", "expected"), [({0, 3, 5}, 8, 3), (None, 8, 8), (None, None, 1)])
def test_processors_are_those_that_the_process_may_use(monkeypatch, allowed, there, expected):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    if allowed is not None:
        monkeypatch.setattr(os, "sched_getaffinity", lambda process: allowed if process == 0 else set(), raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: there)
    assert solve.processors() == expected


@pytest.mark.parametrize(
    ("band", "module", "name"),
    [(FREQUENCY, block_quadrature, "mean_squares"), (None, block_residues, "whole_axis_mean_squares")],
)
def test_the_first_block_of_a_grid_is_timed(paper_vehicle, monkeypatch, band, module, name):
    """Of blocks of 2, 2 and 1 vehicles."""
    timed = []
    original = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *given: timed.append(given[1]) or original(*given))
    monkeypatch.setattr(solve, "BLOCK", 2)
    monkeypatch.setattr(solve, "CLOSED_FORM_BLOCK", 2)
    monkeypatch.setattr(solve, "_timed", lambda task: task() is None or 6.0)
    masses = np.linspace(500, 700, 5)
    assert solve.seconds(study(replace(paper_vehicle, bogie_mass=masses), 60.0, band)) == 15.0
    assert np.ravel(timed[0]["bogie_mass"]).tolist() == masses[:2].tolist()


def test_where_nothing_is_shared_the_first_vehicle_is_timed(paper_vehicle, monkeypatch):
    timed = []
    monkeypatch.setattr(solve, "shared_panels", lambda of: (panels.SharedPanels(np.array([0]), None, {}),))
    monkeypatch.setattr(solve, "_own_quadrature", lambda of, found: timed.append(of.values) or {})
    monkeypatch.setattr(solve, "_timed", lambda task: task() is None or 6.0)
    many = replace(paper_vehicle, bogie_mass=np.linspace(500, 700, 5), car_body_mass=np.array([[1e4], [2e4]]))
    assert solve.seconds(study(many, 60.0)) == 60.0
    assert timed == [vars(many.at((0, 0)))]
