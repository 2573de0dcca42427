"""Which body stands on which, told by legs and wheels alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freqrail.model.bodies import anatomy_of, ordinal, plural
from freqrail.model.elements import Spring
from freqrail.model.half_vehicle import half_vehicle
from freqrail.model.system import Freedom, Leg, System, Wheel
from tests.plain_vehicles import MAKERS
from tests.worded import worded


def stands(system: System) -> dict[str, str | None]:
    bodies = anatomy_of(system).bodies
    return {body.name: None if body.above is None else bodies[body.above].name for body in bodies}


def test_the_half_vehicles_wheelsets_stand_below_bogies_and_these_below_the_car():
    found = stands(half_vehicle())
    assert found == {
        **{"wheelset_1": "bogie_1", "wheelset_2": "bogie_1", "wheelset_3": "bogie_2", "wheelset_4": "bogie_2"},
        **{"bogie_1": "car", "bogie_2": "car", "car": None},
    }
    anatomy = anatomy_of(half_vehicle())
    assert [part.title for part in anatomy.parts] == [
        *("car bounce", "car pitch", "bogie bounce", "bogie pitch"),
        "wheelsets",
    ]
    rows = [each.name for each, _ in half_vehicle().rows]
    below = {name: anatomy.bodies[body].name for name, body in zip(rows, anatomy.lower, strict=True)}
    assert below["secondary_2"] == "bogie_2"
    assert below["primary_3"] == below["axle_3"] == "wheelset_3"


def test_bodies_are_ordered_as_the_wheels_below_them_whatever_the_order_of_the_freedoms():
    system = half_vehicle()
    turned = replace(system, freedoms=system.freedoms[::-1])
    bogies = [body.name for body in anatomy_of(turned).bodies if body.kind == "bogie"]
    assert bogies == ["bogie_1", "bogie_2"]
    (pitch,) = (part for part in anatomy_of(turned).parts if part.title == "bogie pitch")
    assert [turned.freedoms[k].name for k in pitch.freedoms] == ["beta_t1", "beta_t2"]


def test_cars_are_coupled_and_no_car_carries_another():
    found = stands(worded(MAKERS["two coupled cars"](np.random.default_rng(0))))
    assert found["a_car"] is None
    assert found["b_car"] is None
    assert found["b_bogie_front"] == "b_car"
    bogies = [name for name in found if "bogie" in name]
    assert bogies == ["a_bogie_front", "a_bogie_rear", "b_bogie_front", "b_bogie_rear"]


def test_a_bogie_shared_by_two_cars_stands_below_neither_alone():
    freedoms = [Freedom(f"car_{k}", "m_c", f"car_{k}", "car", "bounce") for k in (1, 2)]
    freedoms += [Freedom(f"bogie_{k}", "m_b", f"bogie_{k}", "bogie", "bounce") for k in (1, 2, 3)]
    legs = [("car_1", "bogie_1"), ("car_1", "bogie_2"), ("car_2", "bogie_2"), ("car_2", "bogie_3")]
    system = System(
        tuple(freedoms),
        tuple(Leg(f"leg_{i}", {upper: 1.0, lower: -1.0}, Spring("k")) for i, (upper, lower) in enumerate(legs)),
        tuple(Wheel(f"wheel_{k}", {f"bogie_{k}": 1.0}, Spring("h"), -10.0 * k) for k in (1, 2, 3)),
    )
    assert stands(system) == {"bogie_1": "car_1", "bogie_2": None, "bogie_3": "car_2", "car_1": None, "car_2": None}


def test_a_freedom_without_words_is_a_body_of_its_own_and_two_of_a_body_are_told_by_their_names():
    system = System(
        (Freedom("z", "m", "box"), Freedom("b", "j", "box"), Freedom("wheel", "w")),
        (Leg("leg", {"z": 1.0, "b": 1.0, "wheel": -1.0}, Spring("k")),),
        (Wheel("contact", {"wheel": 1.0}, Spring("h"), 0.0),),
    )
    assert [part.title for part in anatomy_of(system).parts] == ["box z", "box b", "wheel"]


def test_bending_modes_of_a_car_are_counted():
    system = worded(MAKERS["two bending modes"](np.random.default_rng(0)))
    titles = [part.title for part in anatomy_of(system).parts]
    assert "car bending, first mode" in titles
    assert "car bending, second mode" in titles
    assert (ordinal(0), ordinal(6), plural("car body"), plural("bogie")) == ("first", "7th", "car bodies", "bogies")
