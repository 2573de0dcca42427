"""Ways around sharp peaks: the sides of a rectangle and the residues inside are the integral along the axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from freqrail.model.band import Band
from freqrail.model.responses import RESPONSES
from freqrail.model.spectrum import RationalSpectrum, TabulatedSpectrum
from freqrail.solver import panels, peaks, solve
from freqrail.solver.detours import Detour, detours, is_sharp
from freqrail.solver.problem import half_vehicle_problem
from freqrail.solver.solution import METHOD

TRACK = RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))
ALL = tuple(RESPONSES)
RINGING = Band("frequency", 0.1, 500.0)  # takes in the wheelsets near 195 Hz
SPEEDS = np.array([30.0, 65.0, 80.0])


def grid(vehicle):
    joints = np.geomspace(0.5e6, 1e8, 18)
    return replace(vehicle, primary_joint_stiffness=joints[:, None], secondary_joint_stiffness=joints)


# --- the way itself ----------------------------------------------------------------------------------


def test_sides_and_residues_are_the_integral_along_the_axis():
    """Of s^2 e^{0.2 s}/((s - p)(s - p*)(s + 3)) from 5i to 20i, with p inside the rectangle."""
    pole = -0.05 + 11j
    (way,) = detours(np.array([pole]), np.array([[5.0], [20.0]]), 0.2)
    assert way.holds(np.array([pole])).all()

    def function(s):
        return s**2 * np.exp(0.2 * s) / ((s - pole) * (s - np.conj(pole)) * (s + 3))

    rule = way.rule()
    sides = np.sum(rule.weights * function(1j * rule.omega))
    residue = pole**2 * np.exp(0.2 * pole) / ((pole - np.conj(pole)) * (pole + 3))
    on_axis = [
        quad(lambda w, part=part: part(function(1j * w)), way.low, way.high, points=[11.0], limit=500, epsabs=1e-13)[0]
        for part in (np.real, np.imag)
    ]
    assert sides + 2 * np.pi * residue == pytest.approx(complex(*on_axis), rel=1e-10)
    assert abs(2 * np.pi * residue / sides) > 1  # the peak is not in the sides


def test_each_cluster_of_sharp_poles_has_its_rectangle():
    poles = np.array([-0.001 + 10j, -0.002 + 11j, -0.1 + 1000j, -30 + 100j, -500 + 0j])
    limits = np.array([[1.0, 2.0], [3000.0, 2000.0]])
    low, high = detours(poles, limits, 0.1)
    assert is_sharp(poles).tolist() == [True, True, True, False, False]
    assert low.holds(poles).tolist() == [True, True, False, False, False]
    assert high.holds(poles).tolist() == [False, False, True, False, False]


@pytest.mark.parametrize("edge", [1000.0, 1019.0, 981.0])
def test_there_is_no_way_around_a_peak_at_the_bands_edge(edge):
    """Nor where one speed's band takes it in and another's does not."""
    poles = np.array([-0.1 + 1000j])
    assert detours(poles, np.array([[1.0], [edge]]), 0.1) is None
    assert detours(poles, np.array([[1.0, 1.0], [edge, 3000.0]]), 0.1) is None


def test_without_sharp_peaks_there_is_nothing_to_go_around():
    assert detours(np.array([-30 + 100j, -0.1 + 1000j]), np.array([[1.0], [500.0]]), 0.1) == ()


# --- numbers -----------------------------------------------------------------------------------------


def test_grids_that_ring_share_nodes_and_keep_their_numbers(paper_vehicle, monkeypatch):
    """Against nodes of each vehicle's own, within both estimates: all responses, 324 vehicles, three speeds."""
    problem = half_vehicle_problem(grid(paper_vehicle), SPEEDS, TRACK, RINGING, ALL)
    around = solve.solve(problem)
    assert np.all(around.method == METHOD.index("shared_quadrature"))
    monkeypatch.setattr(panels, "detours", lambda *given: None)
    own = solve.solve(problem)
    assert np.all(own.method == METHOD.index("own_quadrature"))
    for name in ALL:
        apart = np.abs(around.rms[name] / own.rms[name] - 1)
        assert np.all(apart <= around.relative_error[name] + own.relative_error[name])
        assert np.all(around.relative_error[name] < 1e-8)


def test_peaks_hold_nearly_all_of_what_soft_joints_let_ring(paper_vehicle):
    """The wheelsets' acceleration: all but a ten-thousandth where joints are softest, less where they damp."""
    problem = half_vehicle_problem(grid(paper_vehicle), SPEEDS, TRACK, RINGING, ("wheelset_acceleration",))
    whole = np.square(solve.solve(problem).rms["wheelset_acceleration"])
    (shared,) = panels.shared_panels(problem)
    found = peaks.peak_mean_squares(problem.reduction, problem.values, TRACK, SPEEDS, shared.detours, problem.limits)
    share = found["wheelset_acceleration"].value / whole
    assert np.all(np.abs(1 - share[:, 0, 0]) < 1e-4)
    assert np.all(np.abs(1 - share[:, -1, -1]) > 1e-4)


def test_a_peak_outside_all_rectangles_is_left_to_its_own_nodes(paper_vehicle, monkeypatch):
    """As of a vehicle that the sample does not show."""
    problem = half_vehicle_problem(grid(paper_vehicle), SPEEDS, TRACK, RINGING, ALL)
    (shared,) = panels.shared_panels(problem)
    moved = tuple(
        Detour(1.3 * d.low, 1.3 * d.high, d.width, 1.3j * d.edges.imag + d.edges.real) for d in shared.detours
    )
    found = peaks.peak_mean_squares(problem.reduction, problem.values, TRACK, SPEEDS, moved, problem.limits)
    assert all(np.all(np.isinf(square.error)) for square in found.values())


def test_tables_and_hysteresis_have_no_detours(paper_vehicle):
    """They are not analytic off the axis."""
    table = TabulatedSpectrum("measured", (0.001, 1.0, 400.0), (1e-4, 1e-7, 1e-12))
    for spectrum, ways in ((TRACK, 1), (table, 0)):
        problem = half_vehicle_problem(grid(paper_vehicle), SPEEDS, spectrum, RINGING, ALL)
        assert sum(len(shared.detours) for shared in panels.shared_panels(problem)) == ways


def test_bits_do_not_depend_on_how_a_ringing_grid_is_cut(paper_vehicle):
    problem = half_vehicle_problem(grid(paper_vehicle), SPEEDS, TRACK, RINGING, ALL)
    shared = panels.shared_panels(problem)
    whole = solve.solve(problem, nodes=shared)
    for cell in ((slice(3, 9), slice(0, 18)), (slice(5, 6), slice(7, 8))):
        part = solve.solve(problem.cut(cell), nodes=shared)
        for name in ALL:
            assert np.array_equal(part.rms[name], whole.rms[name][(slice(None), *cell)])
            assert np.array_equal(part.relative_error[name], whole.relative_error[name][(slice(None), *cell)])
