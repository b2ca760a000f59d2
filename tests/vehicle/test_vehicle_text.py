"""A vehicle that is written as a file is the same vehicle when it is read."""

from __future__ import annotations

import dataclasses
import math
import tomllib

import pytest

from skyarm.algebra import Vec3
from skyarm.records.plain import plain
from skyarm.vehicle import VehicleError
from skyarm.vehicle.description import rotation_rpy
from skyarm.vehicle.linkage import Body, Follower, Joint, Link
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import Frame, MountedDrive
from skyarm.vehicle.vehicle_text import vehicle_text

HUMMINGBIRD = load_vehicle("hummingbird")


def written(vehicle, folder, **more):
    file = folder / "vehicle.toml"
    file.write_text(vehicle_text(vehicle, **more), "utf-8")
    return load_vehicle(file)


def same(one, other):
    """True for equal plain data, in which floats may differ by a rounding and integers
    must be integers.
    """
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(
            same(each, other[key]) for key, each in one.items()
        )
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and (
        one == other or (isinstance(one, float) and math.isclose(one, other))
    )


@pytest.mark.parametrize("name", list_vehicles())
def test_a_shipped_vehicle_comes_back(name, tmp_path):
    vehicle = load_vehicle(name)
    assert same(plain(written(vehicle, tmp_path)), plain(vehicle))


@pytest.mark.parametrize(
    "rpy",
    [
        (0.3, -0.4, 2.9),
        (0.0, math.pi / 2.0, 0.0),
        (math.pi, 0.0, 0.0),
        (0.1, -math.pi / 2.0, 0.2),
    ],
)
def test_followers_stops_and_turned_axes_come_back(rpy, tmp_path):
    body = Body(mass=0.1, com=Vec3(0.01, 0.02, 0.03), inertia=HUMMINGBIRD.base.inertia)
    joint = Joint(
        name="j",
        axis=Vec3(0, 0.6, 0.8),
        rotation=rotation_rpy(rpy),
        lower=-1.0,
        upper=1.5,
        effort_limit=0.0,
    )
    limited = dataclasses.replace(
        joint, name="k", kind="prismatic", stop_stiffness=30.0, stop_damping=2.0
    )
    links = (
        Link(name="a", parent=-1, joint=joint, body=body),
        Link(name="b", parent=0, joint=limited, body=body),
    )
    tied = Link(
        name="c", parent=1, joint=Joint(name="f", lower=-3.0, upper=2.25), body=body
    )
    vehicle = dataclasses.replace(
        HUMMINGBIRD,
        links=links,
        followers=(Follower(link=tied, leader=0, ratio=-2.0, offset=0.25),),
        frames=(
            Frame(
                name="tip",
                link=2,
                position=Vec3(0, 0.1, 0.2),
                rotation=rotation_rpy(rpy),
            ),
        ),
        end_effector="tip",
    )
    back = written(vehicle, tmp_path)
    assert same(plain(back), plain(vehicle))
    assert not same(
        plain(back), plain(dataclasses.replace(vehicle, frames=(), end_effector=""))
    )


def test_signs_and_senses_of_rotors_come_back_and_are_no_more_than_stated(tmp_path):
    rotors = [
        dataclasses.replace(each, rolling="signed") for each in HUMMINGBIRD.rotors
    ]
    rotors[1] = dataclasses.replace(rotors[1], reversible=True)
    back = written(dataclasses.replace(HUMMINGBIRD, rotors=tuple(rotors)), tmp_path)
    assert [(each.rolling, each.reversible) for each in back.rotors] == [
        ("signed", k == 1) for k in range(4)
    ]
    assert [float(each.rolling_moment) for each in back.rotors] == [
        1e-6 * each.direction for each in back.rotors
    ]
    text = vehicle_text(HUMMINGBIRD)
    assert "rolling =" not in text
    assert "reversible" not in text
    (tmp_path / "odd.toml").write_text(
        text.replace("[rotor_defaults]", '[rotor_defaults]\nrolling = "odd"'), "utf-8"
    )
    with pytest.raises(ValueError, match=r"rolling = 'odd': must be one of"):
        load_vehicle(tmp_path / "odd.toml")


def test_a_scaled_thrust_table_gives_the_same_thrust_and_torque(tmp_path):
    table = ThrustTable(
        speed=(300.0, 600.0, 800.0), thrust=(0.8, 3.0, 5.5), torque=(0.01, 0.05, 0.1)
    )
    rotor = dataclasses.replace(
        HUMMINGBIRD.rotors[0],
        table=table,
        thrust_coefficient=1.2 * table.thrust_coefficient,
        moment_coefficient=0.7 * table.moment_coefficient,
        max_speed=math.inf,
    )
    plain_one = dataclasses.replace(
        HUMMINGBIRD.rotors[1], axis=Vec3(0.0, 0.6, 0.8), inertia=1e-5
    )
    back = written(
        dataclasses.replace(HUMMINGBIRD, rotors=(rotor, plain_one)), tmp_path
    ).rotors
    assert back[0].max_speed == math.inf
    assert back[1] == plain_one
    for one, speed in (
        (one, speed) for one in back[:1] for speed in (100.0, 450.0, 820.0)
    ):
        thrust = one.thrust_coefficient * one.table.push(speed)
        torque = (
            one.thrust_coefficient * one.moment_coefficient * one.table.twist(speed)
        )
        assert thrust == pytest.approx(
            1.2 * table.thrust_coefficient * table.push(speed)
        )
        twist = (
            1.2
            * 0.7
            * table.thrust_coefficient
            * table.moment_coefficient
            * table.twist(speed)
        )
        assert torque == pytest.approx(twist)


def test_comments_stand_beside_their_numbers_and_are_none_of_them(tmp_path):
    notes = {
        "base.mass": "weighed",
        "base.inertia": "xx: swung\nyy: guessed",
        "rotors.max_speed": "data sheet",
    }
    text = vehicle_text(HUMMINGBIRD, head=["made by hand", ""], notes=notes)
    assert text.startswith("# made by hand\n#\nschema = 1\n")
    assert (
        "\nmass = 0.716  # weighed\ncom = [0.0, 0.0, 0.0]\n# xx: swung\n# yy:"
        " guessed\ninertia = [" in text
    )
    assert text.count("# data sheet") == 1
    assert tomllib.loads(text) == tomllib.loads(vehicle_text(HUMMINGBIRD))


def test_a_drive_that_no_file_can_name_is_refused():
    class Own:
        def effort(self, *_):
            return 0.0

    arm = load_vehicle("hummingbird_arm2")
    own = dataclasses.replace(
        arm, drives=(MountedDrive(name=arm.links[0].joint.name, drive=Own()),)
    )
    with pytest.raises(
        VehicleError,
        match=r"^drives\.joint1 = 'Own': must be registered to be written$",
    ):
        vehicle_text(own)
