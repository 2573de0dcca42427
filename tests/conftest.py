"""Fixtures: the paper's case, its vehicle and its track."""

from __future__ import annotations

import pytest

import freqrail
from freqrail.case.case import Case
from freqrail.model.spectrum import GERMAN_CUTOFFS, RationalSpectrum
from freqrail.model.vehicle import Vehicle


@pytest.fixture(scope="session")
def paper_case() -> Case:
    """The shipped case of the paper."""
    return freqrail.load_case("yu-damper-joint")


@pytest.fixture(scope="session")
def paper_vehicle(paper_case: Case) -> Vehicle:
    """The vehicle of the paper's section V, joints of 5 MN/m."""
    return paper_case.vehicle


@pytest.fixture(scope="session")
def german_low() -> RationalSpectrum:
    """Eq. (11) with the paper's numbers, A_v = 4.032e-7 m^2 rad/m."""
    return RationalSpectrum("german-low", 4.032e-7, (0.0206, 0.8246))


@pytest.fixture(scope="session")
def german_high() -> RationalSpectrum:
    """Eq. (11) with the German high roughness, A_v = 1.080e-6 m^2 rad/m."""
    return RationalSpectrum("german-high", 1.080e-6, GERMAN_CUTOFFS)
