"""Components from physical data: air springs by the gas law, solved without the formulas."""

import numpy as np
import pytest

from freqrail.model.components import AMBIENT, air_spring
from freqrail.model.elements import Dashpot, Inerter, Parallel, Series, Spring

DATA = {"pressure": 5e5, "area": 0.25, "volume": 0.025, "reservoir": 0.04, "area_rate": 0.1}
C = 2e4


def law_of(spring, c=C):
    values = {"k1": spring.k1, "k2": spring.k2, "k3": spring.k3, "c": c, "b": spring.b}
    inner = Parallel((Spring("k2"), Dashpot("c"), Inerter("b")))
    return Parallel((Spring("k3"), Series((Spring("k1"), inner)))), values


def by_the_gas_law(pipe=(0.0, np.nan), s=1j, step=1e-6):
    """Force over a compression z e^{st}, from masses of air: p V^n = const in both volumes, flow by the pressure drop.

    Small changes of the state equations about the point of rest, one unknown: the volume that has flowed.
    """
    p, a, v, r, n = DATA["pressure"], DATA["area"], DATA["volume"], DATA["reservoir"], 1.4

    def pressures(z, w):
        return p * (v / (v - a * z + w)) ** n, p * (r / (r - w)) ** n

    by_z = (pressures(step, 0.0)[0] - pressures(-step, 0.0)[0]) / (2 * step)
    by_w = [(one - two) / 2e-9 for one, two in zip(pressures(0.0, 1e-9), pressures(0.0, -1e-9), strict=True)]
    length, section = pipe
    inertia = p / (287.05 * 293.15) * length / section if length else 0.0
    resistance = C / a**2
    # p_bellows - p_reservoir = resistance w' + inertia w''
    w = by_z / (resistance * s + inertia * s**2 + by_w[1] - by_w[0])
    return a * (by_z + by_w[0] * w) + (p - AMBIENT) * DATA["area_rate"]


@pytest.mark.parametrize("pipe", [(0.0, np.nan), (3.0, 2e-3)])
@pytest.mark.parametrize("frequency", [0.01, 0.5, 2.0, 10.0, 50.0])
def test_an_air_spring_is_what_the_gas_law_says(pipe, frequency):
    spring = air_spring(**DATA, pipe_length=pipe[0], pipe_area=pipe[1])
    law, values = law_of(spring)
    s = 2j * np.pi * frequency
    assert complex(law.stiffness(values, s)) == pytest.approx(by_the_gas_law(pipe, s), rel=1e-6)


@pytest.mark.parametrize("frequency", [0.01, 2.0, 50.0])
def test_both_forms_of_the_law_are_one(frequency):
    spring = air_spring(**DATA, pipe_length=3.0, pipe_area=2e-3)
    law, values = law_of(spring)
    other = Parallel((Spring("ke"), Series((Spring("kv"), Parallel((Dashpot("c"), Inerter("b")))))))
    numbers = {"ke": spring.ke, "kv": spring.kv, "c": C * spring.share, "b": spring.b * spring.share}
    s = 2j * np.pi * frequency
    assert complex(law.stiffness(values, s)) == pytest.approx(complex(other.stiffness(numbers, s)), rel=1e-12)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"pressure": 9e4}, "absolute"),
        ({"area": 0.0}, "area must be positive"),
        ({"volume": float("nan")}, "volume must be positive"),
        ({"exponent": 0.5}, "isothermal"),
        ({"pipe_length": 2.0}, "a pipe has"),
    ],
)
def test_data_that_are_none_are_refused(changed, words):
    with pytest.raises(ValueError, match=words):
        air_spring(**DATA | changed)
