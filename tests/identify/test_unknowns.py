"""Numbers to identify: which ones, in which units, what is thought of each before, and
the start that has them.
"""

from __future__ import annotations

import dataclasses
import math

import pytest

import skyarm
from skyarm.algebra import Sym3, Vec3
from skyarm.dynamics.actuators.drive import LaggedTorque
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.identify.unknowns import (
    Reported,
    Unknown,
    reported_of,
    require_searched,
    second_moments,
    second_moments_of,
    servo_of,
    unknowns_of,
    with_servos,
    without_tilts,
)
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_records import MountedDrive
from support.flights import ARM, GRAVITY, ONE, QUAD

WORDS = {"curve": False, "velocity": True, "voltage": False, "driven": ()}


def every(vehicle=QUAD, **changes):
    """Unknowns by name."""
    return {each.name: each for each in unknowns_of(vehicle, **{**WORDS, **changes})}


def with_rotors(vehicle=QUAD, **changes):
    return dataclasses.replace(
        vehicle,
        rotors=tuple(dataclasses.replace(each, **changes) for each in vehicle.rotors),
    )


def with_joint(vehicle=ONE, body=None, **changes):
    """One joint with other numbers, and with other numbers of its link's body."""
    (link,) = vehicle.links
    moved = dataclasses.replace(link.body, **(body or {}))
    joint = dataclasses.replace(link.joint, **changes)
    return dataclasses.replace(
        vehicle, links=(dataclasses.replace(link, body=moved, joint=joint),)
    )


def test_numbers_of_a_quadrotor_are_searched_in_the_units_of_its_file():
    """What surrounds the vehicle is told apart from it."""
    found = every(others=["b", "c"])
    of_vehicle = {name: each.unit for name, each in found.items() if each.in_vehicle}
    assert of_vehicle == {
        "rotors.thrust_coefficient": "N s^2/rad^2",
        "rotors.moment_coefficient": "m",
        "rotors.time_constant_up": "s",
        "rotors.time_constant_down": "s",
        "rotors.inertia": "kg m^2",
        "rotors.drag_coefficient": "N s^2/(rad m)",
        **{f"drag.area.{axis}": "m^2" for axis in "xyz"},
        **{f"base.second_moment.{axis}": "kg m^2" for axis in "xyz"},
        **{f"base.inertia.{axes}": "kg m^2" for axes in ("xy", "xz", "yz")},
        **{f"base.com.{axis}": "m" for axis in "xyz"},
    }
    around = {
        name: (each.unit, each.start)
        for name, each in found.items()
        if not each.in_vehicle
    }
    assert around == {
        "delay": ("s", 0.005),
        "accelerometer_delay": ("s", 0.0),
        **{f"place.{axis}": ("m", 0.0) for axis in "xyz"},
        **{f"offset.{axis}": ("m/s^2", 0.0) for axis in "xyz"},
        **{f"torque.{axis}": ("N m", 0.0) for axis in "xyz"},
        "drift": ("1/s", 0.0),
        "thrust.b": ("times", 1.0),
        "thrust.c": ("times", 1.0),
    }
    volts = every(others=["b"], voltage=True)
    unbounded = [name for name, each in found.items() if each.least == -math.inf]
    assert set(found) - {*unbounded} == {
        "rotors.inertia",
        "rotors.drag_coefficient",
        *(f"drag.area.{axis}" for axis in "xyz"),
    }
    assert set(found) - set(volts) == {"drift", "thrust.b", "thrust.c"}
    assert (volts["sag"].start, volts["sag"].unit) == (1.0, "")
    assert not any(
        name.startswith(("drag", "rotors.drag")) for name in every(velocity=False)
    )


@pytest.mark.parametrize(
    ("kind", "angle", "effort"), [("revolute", "rad", "N m"), ("prismatic", "m", "N")]
)
def test_numbers_of_a_joint_are_in_the_units_of_its_motion(kind, angle, effort):
    vehicle, mass = (
        with_joint(kind=kind, damping=0.01, coulomb=0.02),
        ("kg m^2" if kind == "revolute" else "kg"),
    )
    quad, driven = every(), every(vehicle, driven=[True])
    name = "links.link1"
    of_body = {
        f"{name}.mass": "kg",
        **{f"{name}.com.{axis}": "m" for axis in "xyz"},
        f"{name}.inertia": "times",
    }
    of_joint = {
        f"{name}.joint.damping": f"{effort} s/{angle}",
        f"{name}.joint.coulomb": effort,
        f"{name}.joint.coulomb_rate": f"{angle}/s",
        f"{name}.joint.armature": mass,
    }
    assert {k: each.unit for k, each in driven.items() if k not in quad} == {
        **of_body,
        **of_joint,
        "joint_delay": "s",
    }
    assert {
        k: each.unit
        for k, each in every(vehicle, driven=[False]).items()
        if k not in quad
    } == of_body
    assert driven[f"{name}.mass"].start == ONE.links[0].body.mass
    assert driven[f"{name}.inertia"].start == 1.0
    servo = PositionServo(
        stiffness=4.0,
        damping=0.2,
        integral=3.0,
        latency=0.003,
        speed_limit=5.0,
        inertia=1e-3,
    )
    driver = dataclasses.replace(
        with_joint(kind=kind, damping=0.0, coulomb=0.02),
        drives=(MountedDrive(name="joint1", drive=servo),),
    )
    turned = every(driver, driven=[False], servoed=[True])
    del of_joint[f"{name}.joint.damping"]  # that of the servo holds it
    assert {
        k: (each.unit, each.start)
        for k, each in turned.items()
        if k.startswith("drives.")
    } == {
        "drives.joint1.stiffness": (f"{effort}/{angle}", 4.0),
        "drives.joint1.damping": (f"{effort} s/{angle}", 0.2),
        "drives.joint1.integral": (f"{effort}/({angle} s)", 3.0),
        "drives.joint1.latency": ("s", 0.003),
        "drives.joint1.speed_limit": (f"{angle}/s", 5.0),
    }
    assert {k: each.unit for k, each in turned.items() if ".joint." in k} == of_joint
    assert (turned["setpoint_hold"].start, turned["setpoint_hold"].in_vehicle) == (
        0.5,
        False,
    )
    assert "joint_delay" not in turned


def test_what_a_start_has_none_of_is_not_searched_by_its_logarithm():
    """No bend of a friction that there is not, no armature, no gain of an integral, no
    speed limit.
    """
    bare = with_joint(damping=0.0, coulomb=0.0, armature=0.0)
    driven = every(bare, driven=[True])
    assert [name for name in driven if ".joint." in name] == [
        "links.link1.joint.damping",
        "links.link1.joint.coulomb",
    ]
    assert not any(
        driven[f"links.link1.joint.{name}"].positive for name in ("damping", "coulomb")
    )
    assert all(each.start > 0.0 for each in driven.values() if each.positive)
    turned = every(with_servos(bare, [True]), driven=[False], servoed=[True])
    assert [
        name for name in turned if name.startswith(("drives", "links.link1.joint"))
    ] == [
        "drives.joint1.stiffness",
        "drives.joint1.damping",
        "drives.joint1.latency",
        "links.link1.joint.coulomb",
    ]
    # a point mass has no inertia to scale
    nought = Sym3(xx=0.0, yy=0.0, zz=0.0)
    assert "links.link1.inertia" not in every(
        with_joint(body={"inertia": nought}), driven=[True]
    )


def test_friction_that_is_not_on_record_is_thought_of_by_the_link_s_weight():
    """A tenth of it, at its reach for a joint that turns; damping does as much at the
    swing's rate, or at 1 m/s.
    """
    body = {"com": Vec3(0.06, 0.0, -0.08), "mass": 0.5}
    for kind, dry, rate in (
        ("revolute", 0.1 * 0.5 * GRAVITY * 0.1, math.sqrt(GRAVITY / 0.1)),
        ("prismatic", 0.1 * 0.5 * GRAVITY, 1.0),
    ):
        found = every(
            with_joint(body=body, kind=kind, damping=0.0, coulomb=0.0), driven=[True]
        )
        assert found["links.link1.joint.coulomb"].spread == pytest.approx(dry)
        assert found["links.link1.joint.damping"].spread == pytest.approx(dry / rate)
    assert found["links.link1.com.y"].spread == pytest.approx(0.2 * 0.1)
    # a centre of mass at the joint is known to 2 mm, not to nothing
    centred = every(with_joint(body={"com": Vec3(0.0, 0.0, 0.0)}), driven=[True])
    assert centred["links.link1.com.z"].spread == pytest.approx(0.002)


def test_a_servo_without_dry_friction_on_record_may_stick_a_hundredth_of_a_radian():
    servo = PositionServo(stiffness=4.0, damping=0.2, inertia=1e-3)

    def coulomb(value):
        vehicle = with_joint(damping=0.0, coulomb=value)
        made = dataclasses.replace(
            vehicle, drives=(MountedDrive(name="joint1", drive=servo),)
        )
        return every(made, driven=[False], servoed=[True])["links.link1.joint.coulomb"]

    assert coulomb(0.0).spread == pytest.approx(0.04)
    assert coulomb(0.03).spread == pytest.approx(0.04)
    assert coulomb(0.07).spread == pytest.approx(0.07)
    assert (coulomb(0.07).start, coulomb(0.07).positive, coulomb(0.07).least) == (
        0.07,
        False,
        0.0,
    )


def test_what_spins_is_thought_of_by_the_base_s_inertia_or_by_what_is_on_record():
    """A thousandth of the base's second moments of mass, or half of the start's if that
    is more.
    """
    base = sum(second_moments(QUAD.base))
    assert 0.005 < base < 0.05
    for inertia, spread in (
        (0, 1e-3 * base),
        (1e-9, 1e-3 * base),
        (1e-3 * base, 1e-3 * base),
        (1e-4, 5e-5),
    ):
        found = every(with_rotors(inertia=inertia))["rotors.inertia"]
        assert found.start == inertia
        assert found.spread == pytest.approx(spread)
        assert found.least == 0.0


def test_products_of_inertia_drag_and_places_are_thought_of_by_mass_and_arm():
    """Of rotors 0.17 m from the base's origin: its square counts for an area, its tenth
    for a centre of mass.
    """
    found, arm = every(), 0.17
    inertia = QUAD.base.inertia
    half = 0.5 * float(inertia.xx + inertia.yy + inertia.zz)
    assert [
        found[f"base.inertia.{axes}"].spread for axes in ("xy", "xz", "yz")
    ] == pytest.approx([0.03 * half] * 3)
    assert [found[f"base.com.{axis}"].spread for axis in "xyz"] == pytest.approx(
        [0.1 * arm] * 3, rel=2e-3
    )
    assert [found[f"place.{axis}"].spread for axis in "xyz"] == pytest.approx(
        [0.2 * arm] * 3, rel=2e-3
    )
    assert [found[f"drag.area.{axis}"].spread for axis in "xyz"] == pytest.approx(
        [0.3 * arm**2] * 3, rel=4e-3
    )
    # a level start tells the accelerometer's height of zero from the thrust, and the
    # yaw torque is that of rotors
    assert (
        found["offset.x"].spread
        == found["offset.y"].spread
        == pytest.approx(10.0 * found["offset.z"].spread)
    )
    assert (
        found["torque.x"].spread
        == found["torque.y"].spread
        == pytest.approx(10.0 * found["torque.z"].spread)
    )
    assert found["torque.z"].spread == pytest.approx(
        0.01 * GRAVITY * float(QUAD.mass) * arm, rel=3e-3
    )
    wide = dataclasses.replace(
        QUAD, drag=dataclasses.replace(QUAD.drag, area=Vec3(0.2, 0.1, 0.001))
    )
    areas = [every(wide)[f"drag.area.{axis}"] for axis in "xyz"]
    assert [(each.start, each.least) for each in areas] == [
        (0.2, 0.0),
        (0.1, 0.0),
        (0.001, 0.0),
    ]
    assert [each.spread for each in areas] == pytest.approx(
        [0.2, 0.1, 0.3 * arm**2], rel=4e-3
    )
    # the farthest rotor counts
    first = dataclasses.replace(QUAD.rotors[0], position=Vec3(0.3, 0.4, 1.2))
    far = dataclasses.replace(QUAD, rotors=(first, *QUAD.rotors[1:]))
    assert every(far, drag_height=True)["rotors.drag_height"].spread == pytest.approx(
        1.3
    )
    assert every(far)["base.com.x"].spread == pytest.approx(0.13)


def test_hub_drag_is_thought_of_as_on_record_if_that_is_more():
    hover = math.sqrt(
        GRAVITY * float(QUAD.mass) / (4.0 * float(QUAD.rotors[0].thrust_coefficient))
    )
    wind = 0.3 * float(QUAD.mass) / (4.0 * hover)
    for on_record, spread in (
        (0.0, wind),
        (0.9 * wind, wind),
        (3.0 * wind, 3.0 * wind),
    ):
        found = every(with_rotors(drag_coefficient=on_record))[
            "rotors.drag_coefficient"
        ]
        assert (found.start, found.least) == (on_record, 0.0)
        assert found.spread == pytest.approx(spread)


def test_a_number_above_zero_is_searched_by_its_logarithm():
    above = Unknown(name="a", unit="", start=0.5, spread=0.1, positive=True)
    assert above.begin == pytest.approx(math.log(0.5))
    assert above.value(above.begin + math.log(3.0)) == pytest.approx(1.5)
    plain = Unknown(name="a", unit="", start=-0.5, spread=0.1)
    assert (plain.begin, plain.value(-2.0)) == (-0.5, -2.0)


def test_moments_of_inertia_are_sums_of_two_second_moments():
    """Of a cuboid m (a^2, b^2, c^2) / 12; a thin plate's and a point's are above
    zero.
    """
    cuboid = second_moments_of(4.0 + 9.0, 1.0 + 9.0, 1.0 + 4.0)
    assert cuboid == pytest.approx((1.0, 4.0, 9.0))
    assert second_moments_of(1.0, 1.0, 3.0)[2] == pytest.approx(-0.5)
    rod = dataclasses.replace(QUAD.base, inertia=Sym3(xx=0.0, yy=2.0, zz=2.0))
    assert second_moments(rod) == pytest.approx((2.0, 0.04, 0.04))
    point = dataclasses.replace(QUAD.base, inertia=Sym3(xx=0.0, yy=0.0, zz=0.0))
    assert second_moments(point) == (1e-12, 1e-12, 1e-12)


def test_reported_are_moments_of_inertia_and_thrusts_in_place_of_what_is_searched():
    unknowns = list(every(curve=True, velocity=True).values())
    told = {each.name: each for each in reported_of(unknowns)}
    assert told["base.inertia.yy"] == Reported(
        name="base.inertia.yy",
        unit="kg m^2",
        parts=("base.second_moment.x", "base.second_moment.z"),
    )
    rises = tuple(f"rotors.rise_to_{share}_percent" for share in (25, 50, 75, 100))
    for k, share in enumerate((25, 50, 75, 100)):
        name = f"rotors.thrust_at_{share}_percent"
        assert told[name] == Reported(name=name, unit="N", parts=rises[: k + 1])
    for name in ("rotors.inertia", "delay", "base.inertia.xy"):
        (plain,) = (each for each in unknowns if each.name == name)
        assert told[name] == Reported(
            name=name, unit=plain.unit, parts=(name,), least=plain.least
        )
    assert len(told) == len(unknowns)


def test_numbers_of_rotors_begin_with_those_of_the_first():
    """Of which the others keep their share; so does the square of the speed at each
    knot of a curve.
    """
    other = dataclasses.replace(
        QUAD.rotors[3], thrust_coefficient=1e-5, drag_coefficient=1e-3, inertia=1e-4
    )
    found = every(dataclasses.replace(QUAD, rotors=(*QUAD.rotors[:3], other)))
    plain = every()
    for name in (
        "thrust_coefficient",
        "moment_coefficient",
        "drag_coefficient",
        "inertia",
    ):
        assert found[f"rotors.{name}"] == plain[f"rotors.{name}"]
    rises = [
        each.start
        for name, each in every(curve=True).items()
        if name.startswith("rotors.rise_to_")
    ]
    full = (
        float(QUAD.rotors[0].thrust_coefficient) * float(QUAD.rotors[0].max_speed) ** 2
    )
    assert rises == pytest.approx(
        [full / 16.0, 3.0 * full / 16.0, 5.0 * full / 16.0, 7.0 * full / 16.0]
    )


def test_a_thrust_curve_begins_with_the_thrusts_of_the_start_s_table():
    speeds, thrusts = (200.0, 400.0, 600.0, 800.0), (0.5, 1.7, 3.6, 5.0)
    made = with_rotors(
        table=ThrustTable(speed=speeds, thrust=thrusts),
        thrust_coefficient=ThrustTable(speed=speeds, thrust=thrusts).thrust_coefficient,
        max_speed=800.0,
    )
    rises = [
        each
        for name, each in every(made, curve=True).items()
        if name.startswith("rotors.rise_to_")
    ]
    assert [each.start for each in rises] == pytest.approx([0.5, 1.2, 1.9, 1.4])
    assert {(each.unit, each.positive) for each in rises} == {("N", True)}
    assert "rotors.thrust_coefficient" not in every(made, curve=True)
    with pytest.raises(
        ValueError,
        match=r"^rotors\.max_speed = inf: must be finite, the speed of the full signal",
    ):
        every(with_rotors(max_speed=math.inf), curve=True)
    with pytest.raises(
        ValueError, match=r"^vehicle 'hummingbird': rotors: must be one or more$"
    ):
        every(dataclasses.replace(QUAD, rotors=()))


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("delay", -0.01, None),
        ("drag.area.x", -1.0, None),
        ("base.second_moment.x", 1e-3, None),
        ("rotors.moment_coefficient", 1e-3, None),
        ("delay", math.inf, r"^known\.delay = inf: must be a finite number$"),
        (
            "rotors.moment_coefficient",
            0.0,
            r"^known\.rotors\.moment_coefficient = 0.0: must be above 0$",
        ),
        (
            "rotors.moment_coefficient",
            -1.0,
            r"^known\.rotors\.moment_coefficient = -1.0: must be above 0$",
        ),
        (
            "base.inertia.ww",
            1.0,
            (
                r"^known\.base\.inertia\.ww: .*mass, voltage, .*base\.inertia\.xx,"
                r" base\.inertia\.yy"
            ),
        ),
    ],
)
def test_known_numbers_are_some_that_would_be_searched(name, value, words):
    if words is None:
        require_searched({name: value}, list(every().values()))
        return
    with pytest.raises(ValueError, match=words) as error:
        require_searched({name: value}, list(every().values()))
    assert "second_moment" not in str(error.value), "a user knows moments of inertia"


def test_joints_that_take_setpoints_get_a_servo_of_moderate_gains():
    """Critically damped at 20 rad/s of the arm's inertia about the joint; what has a
    servo keeps it.
    """
    found = with_servos(ARM, [True, True])
    assert [each.name for each in found.drives] == ["joint1", "joint2"]
    body = ARM.links[1].body
    about = float(body.inertia.yy) + float(body.mass) * float(body.com.z) ** 2
    servo = servo_of(found, 1)
    assert servo.inertia == pytest.approx(about)
    assert servo.stiffness == pytest.approx(400.0 * about)
    assert servo.damping == pytest.approx(2.0 * 20.0 * about)
    # the first joint carries the second link too
    assert servo_of(found, 0).inertia > 3.0 * about
    assert with_servos(found, [True, True]) is found
    assert with_servos(ARM, [False, False]) is ARM
    assert [each.name for each in with_servos(ARM, [False, True]).drives] == ["joint2"]
    assert (servo_of(ARM, 0), servo_of(with_servos(ARM, [False, True]), 0)) == (
        None,
        None,
    )


def test_a_joint_with_a_drive_of_torques_takes_no_setpoints():
    lagged = dataclasses.replace(
        ARM,
        drives=(MountedDrive(name="joint2", drive=LaggedTorque(time_constant=0.01)),),
    )
    assert servo_of(lagged, 1) is None
    with pytest.raises(
        ValueError,
        match=(
            r"^drives\.joint2: must be a position_servo, or none: joint_commands"
            r" are its"
        ),
    ):
        with_servos(lagged, [True, True])
    made = with_servos(lagged, [True, False])
    assert [each.name for each in made.drives] == ["joint2", "joint1"]
    assert servo_of(made, 0) is made.drives[1].drive


def test_rotors_do_not_tilt_as_flights_are_flown_again():
    tilting = skyarm.load_vehicle("voliro_like")
    assert all(each.tilt is not None for each in tilting.rotors)
    still = without_tilts(tilting)
    assert [each.tilt for each in still.rotors] == [None] * len(tilting.rotors)
    assert [dataclasses.replace(each, tilt=None) for each in tilting.rotors] == list(
        still.rotors
    )
