"""What is unusual about a free vehicle: measured value, criterion and remedy, accepted or not."""

from __future__ import annotations

import pytest

from freqrail.sweep import plausibility
from tests.case.test_free_vehicle import VEHICLE, changed, quiet

LEGS = [f"primary_{k}" for k in (1, 2, 3, 4)]


def told(text, **further):
    return {concern.name: concern for concern in plausibility.concerns(quiet(text, **further))}


def test_a_usual_vehicle_is_told_of_nothing():
    assert told(VEHICLE) == {}


@pytest.mark.parametrize(
    ("changes", "name", "words"),
    [
        ([(("bodies", "car", "pitch_inertia"), "98500000 kg*m^2")], "radius_of_gyration", "ten times off"),
        ([(("bodies", "bogie_front", "pitch_inertia"), "7.38 kg*m^2")], "bogie_radius_of_gyration", "0.0587"),
        ([(("bodies", "car", "mass"), "160 t")], "axle_load", "check the masses' units"),
        ([(("bodies", "car", "mass"), "1600 kg"), (("bodies", "car", "bending"), None)], "car_bounce", "3.11 Hz"),
        ([(("suspensions", "primary_1", "k"), "12 MN/m")], "bogie_bounce", "Hz"),
        ([(("wheels", "axle_1", "contact_stiffness"), "1.3 MN/m")], "contact", "GN/m"),
        ([(("band",), {"frequency": ["0.1 Hz", "300 Hz"]})], "wheelset_resonance", "let the contact yield"),
        ([(("band",), {"wavelength": ["0.2 m", "400 m"]})], "wavelengths", "1 to 120 m"),
    ],
)
def test_what_is_off_is_measured_and_the_remedy_named(changes, name, words):
    found = told(changed(*changes))
    assert name in found
    assert words in found[name].text
    assert not found[name].accepted


def test_corners_of_the_grid_are_measured_and_what_a_case_accepts_is_said():
    found = told(VEHICLE, over={"bodies.car.mass": "16, 160 t"})
    assert found["axle_load"].measured[1] > 40
    text = changed((("accepted",), {"axle_load": [3.0, 90.0]}))
    assert told(text, over={"bodies.car.mass": "16, 160 t"})["axle_load"].accepted


def test_vitals_name_load_and_frequencies():
    found = {each["quantity"]: each["smallest"] for each in plausibility.vitals(quiet(VEHICLE))}
    assert found["axle_load"] == pytest.approx(11.12, abs=0.01)
    assert 0.8 < found["car_bounce"] < 1.5
    assert 5 < found["bogie_bounce"] < 12
