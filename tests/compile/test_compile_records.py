"""Records as flat lists of scalars and back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Sym3, Vec3
from skyarm.records.leaves import leaves, rebuild, shaped_like
from support.vehicles import random_vehicle


class Colour(Enum):
    RED = 1


@dataclass(frozen=True, kw_only=True)
class Thing:
    mass: float
    name: str = "thing"
    place: Vec3 = Vec3(0, 0, 1)
    parts: tuple[Sym3, ...] = ()
    flag: bool = True
    colour: Colour = Colour.RED
    nothing: None = None


THING = Thing(
    mass=2.5,
    place=Vec3(0, 1.5, -3.0),
    parts=(Sym3(1.0, 0, 2.0), Sym3(3.0, 4.0, 5.0, xz=6.0)),
)


def test_leaves_are_the_scalars_in_field_order_and_nothing_else():
    assert leaves(THING) == [2.5, 1.5, -3.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert leaves((1.0, (2, (3.0,)), None, "x")) == [1.0, 3.0]
    assert leaves(7) == []
    assert leaves(7.0) == [7.0]


def test_rebuilding_with_its_own_leaves_gives_the_record_back():
    for record in (THING, (1.0, THING, ()), Vec3(0, 0, 0), 3.5):
        assert rebuild(record, iter(leaves(record))) == record
        assert shaped_like(record, leaves(record)) == record


def test_rebuilding_keeps_structure_and_replaces_scalars_in_order():
    doubled = shaped_like(THING, [2.0 * x for x in leaves(THING)])
    assert doubled.place == Vec3(0, 3.0, -6.0)
    assert type(doubled.place.x) is int
    assert doubled.parts[1].xz == 12.0
    assert (doubled.name, doubled.flag, doubled.colour, doubled.nothing) == (
        "thing",
        True,
        Colour.RED,
        None,
    )


@pytest.mark.parametrize("count", [0, 8, 10])
def test_a_wrong_number_of_scalars_is_refused(count):
    with pytest.raises(ValueError, match=f"Thing has 9 scalars, got {count}"):
        shaped_like(THING, [0.0] * count)


def test_leaves_of_any_engine_pass():
    lanes = np.arange(3.0)
    assert leaves(Vec3(lanes, 1, np.float64(2.0)))[0] is lanes
    assert (
        shaped_like(Quaternion(1.0, 1.0, 1.0, 1.0), ["not", "checked", "here", "!"]).w
        == "not"
    )


def test_a_vehicle_makes_the_round_trip():
    vehicle = random_vehicle(np.random.default_rng(1), 4)
    again = shaped_like(vehicle, leaves(vehicle))
    assert again == vehicle
    assert vehicle.base.mass in leaves(vehicle)
    assert math.inf in leaves(vehicle)  # a joint without limits
