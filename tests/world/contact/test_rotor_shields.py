"""Rotors with shields: their rims bounce as a spring does, on both plants, and end no
flight.
"""

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings, Together, coupled_places
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_file import scenario_from
from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_text import vehicle_text
from skyarm.world.contact import Contact, Material, Surface
from skyarm.world.contact.closed_contact import GeomContact
from support.worlds import at_rest, fall, limp, states

RADIUS, HEIGHT = 0.11, 0.02


def shielded(vehicle, **fields):
    rotors = (
        dataclasses.replace(each, shield=(RADIUS, HEIGHT), **fields)
        for each in vehicle.rotors
    )
    return dataclasses.replace(vehicle, rotors=tuple(rotors))


def bounce(kind):
    """Speeds and places along x of a shielded vehicle that hits a wall."""
    vehicle = shielded(limp())
    level = vehicle.rotors[0].position.z - vehicle.base.com.z
    assert level == 0.0
    wall = Surface(
        name="wall",
        position=(1.0, 0.0, 0.0),
        angles=(0.0, -0.5 * math.pi, 0.0),
        material=Material(dissipation=0.0, friction=0.0),
    )
    contact = kind(surfaces=(wall,)).on({"": vehicle})
    reach = float(vehicle.rotors[0].position.x) + RADIUS
    state = dataclasses.replace(
        at_rest(vehicle, (1.0 - reach - 0.005, 0.0, 0.0)), velocity=Vec3(0.5, 0.0, 0.0)
    )
    memory = contact.start(0.005, ())
    if kind is Contact:
        around = Surroundings(components=(contact,), memories=(memory,))
        flight = states(state, fall(vehicle, state, around, 0.1, gravity=0.0))
        rows = [(each.position.x, each.velocity.x) for each in flight]
    else:
        around = Together(
            each=(Surroundings(),), components=(contact,), memories=(memory,)
        )
        plant = MujocoPlant(Truth(vehicle=vehicle, gravity=0.0), around)
        x, given, rows = flat(state), list(leaves(around)), []
        for _ in range(20):
            row = plant.advance(x, (0.0,) * 4, given, 0.005)
            x = row[: len(x)]
            for place, value in zip(coupled_places(around), row[len(x) :], strict=True):
                given[place] = value
            rows.append((x[0], x[7]))
    return vehicle, np.array(rows, float) + np.array((reach - 1.0, 0.0))


@pytest.mark.parametrize("kind", [Contact, GeomContact])
def test_the_rim_bounces_as_a_mass_on_the_springs_of_its_two_edges(kind):
    vehicle, rows = bounce(kind)
    rate = math.sqrt(2.0 * 5000.0 / float(vehicle.mass))
    assert rows[-1, 1] == pytest.approx(-0.5, rel=2e-3)
    inside = rows[rows[:, 0] > 0.0]
    assert len(inside) > 3
    # energy of the spring and the speed at every place of the way
    np.testing.assert_allclose(
        inside[:, 1] ** 2 + (rate * inside[:, 0]) ** 2, 0.25, rtol=0.01
    )


def flight(shield, **plant):
    return scenario_from(
        {
            "name": "into_a_wall",
            "duration": 0.3,
            "plant": {"vehicle": shield, **plant},
            "controller": {"law": "centroidal"},
            "initial": {"position": [0.0, 0.0, 1.0], "velocity": [1.0, 0.0, 0.0]},
            "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
            "world": {
                "rotor_radius": 0.108,
                "points": [{"name": "base", "body": "base"}],
                "surfaces": [
                    {
                        "name": "wall",
                        "shape": "box",
                        "size": [0.1, 1.0, 1.0],
                        "position": [0.4, 0.0, 1.0],
                        "material": {"dissipation": 0.1},
                    }
                ],
            },
        }
    )


def test_a_shield_touches_where_a_bare_disc_ends_the_flight(tmp_path):
    bare = load_vehicle("hummingbird")
    path = tmp_path / "guarded.toml"
    path.write_text(vehicle_text(shielded(bare)), "utf-8")
    assert load_vehicle(path) == dataclasses.replace(
        shielded(bare), sources=load_vehicle(path).sources
    )
    ended = skyarm.run(flight("hummingbird"))
    assert ended.info["status"] == "rotor_contact"
    # dampers of the two plants lose different shares at 0.9 m/s
    places = []
    for plant in ({}, {"kind": "mujoco", "contact": "geoms"}):
        log = skyarm.run(flight(str(path), **plant))
        assert log.info["status"] == "completed"
        assert log.component("collision_force").max() > 1.0
        places.append(log.position[-1])
    np.testing.assert_allclose(*places, atol=8e-3)


def test_shields_lie_around_the_axes_of_their_rotors():
    axes = [(0.6, 0.64, -0.48), (0, 0, -1.0), (1.0, 0, 0), (0, 0.6, 0.8)]
    bird = load_vehicle("hummingbird")
    vehicle = shielded(
        dataclasses.replace(
            bird,
            rotors=tuple(
                dataclasses.replace(each, axis=Vec3(*axis))
                for each, axis in zip(bird.rotors, axes, strict=True)
            ),
        )
    )
    for own, axis in zip(vehicle.shields, axes, strict=True):
        assert tuple(own.rotation.column(2)) == pytest.approx(axis)
        R = np.array(own.rotation.rows, float)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1.0)
    assert next(each.name for each in vehicle.shapes) == "front.shield"


def test_a_vehicle_file_puts_a_shield_on_a_rotor_of_its_airframe(tmp_path):
    path = tmp_path / "v.toml"
    head = 'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[rotors]]\n'
    path.write_text(head + 'name = "left"\nshield = [0.2, 0.05]\n')
    bird, fitted = load_vehicle("hummingbird"), load_vehicle(path)
    assert [each.shield for each in fitted.rotors if each.shield] == [(0.2, 0.05)]
    (shield,) = fitted.shields
    assert shield.name == "left.shield"
    bare = tuple(dataclasses.replace(each, shield=()) for each in fitted.rotors)
    assert bare == bird.rotors
    path.write_text(head + 'name = "left"\nshield = [0.2, 0.05]\nmax_speed = 9.0\n')
    with pytest.raises(
        VehicleError, match=r"rotors\[left\] = .*: must be shield alone"
    ):
        load_vehicle(path)
    # not lost in silence: defaults complete no rotor of an airframe
    head = head.replace("[[rotors]]", "[rotor_defaults]")
    path.write_text(head + "shield = [0.2, 0.05]\n")
    with pytest.raises(VehicleError, match="rotor_defaults = 'shield': must be left"):
        load_vehicle(path)


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ((0.1,), "[0.1]: must be two numbers, radius and height, m"),
        ((0.1, -0.1), "rotors[front].shield[1] = -0.1: must be above 0"),
    ],
)
def test_a_shield_that_cannot_be_is_refused_in_one_line(size, words):
    bird = load_vehicle("hummingbird")

    def made():
        first = dataclasses.replace(bird.rotors[0], shield=size)
        dataclasses.replace(bird, rotors=(first, *bird.rotors[1:]))

    with pytest.raises(VehicleError) as error:
        made()
    assert words in str(error.value)
