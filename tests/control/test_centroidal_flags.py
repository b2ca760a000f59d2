"""The centroidal law's flags are 0 or 1, its trim takes what the motors miss, far from
its base the tip goes along.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from law_parts import commanded, demanded
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.actuators import all_follow, joints_follow, rotors_follow
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.step_records import AccelerationDemand, Planned
from skyarm.control.laws.centroidal.torques import TRIM
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement

ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=ARM, gravity=9.8)
DT = 0.005
ZERO = Vec3(0.0, 0.0, 0.0)
NONE = Disturbance(force=ZERO, torque=ZERO, efforts=(0.0, 0.0))
WEIGHT = float(ARM.mass) * 9.8


def hovering(speeds=(480.0,) * 4):
    return State(
        position=Vec3(0.0, 0.0, 1.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=ZERO,
        rate=ZERO,
        joints=(0.0, 0.0),
        joint_rates=(0.0, 0.0),
        rotor_speeds=speeds,
    )


def demand(thrust=WEIGHT, alpha=ZERO, joints=(0.0, 0.0)):
    still = tuple(Taylor((0.0, 0.0, 0.0)) for _ in range(2))
    plan = Planned(
        R=Mat3.identity(),
        rate=ZERO,
        alpha=ZERO,
        proper=Vec3(0.0, 0.0, 9.8),
        joints=still,
    )
    return AccelerationDemand(thrust=thrust, alpha=alpha, joints=joints, planned=plan)


def done(par, wanted, trim=(0.0,) * 4, applied=1.0, speeds=(480.0,) * 4):
    return commanded(
        par, hovering(speeds), NONE, wanted, DT, trim=trim, applied=(applied,)
    )


TURNS = [
    Vec3(80.0, 0.0, 0.0),
    Vec3(-80.0, 0.0, 0.0),
    Vec3(0.0, 80.0, 0.0),
    Vec3(0.0, -80.0, 0.0),
]
HIGHEST = 4 * 8.54858e-6 * 838.0**2
FLAGS = [
    (demand(), (1.0, 1.0, 1.0)),
    (demand(thrust=0.99 * HIGHEST), (1.0, 1.0, 1.0)),
    (demand(thrust=1.01 * HIGHEST), (0.0, 1.0, 1.0)),
    (demand(thrust=-1.0), (0.0, 1.0, 1.0)),
    # one rotor alone is below nothing, or above its most, each in its turn
    *((demand(thrust=0.5, alpha=turn), (0.0, 1.0, 1.0)) for turn in TURNS),
    *((demand(thrust=0.9 * HIGHEST, alpha=turn), (0.0, 1.0, 1.0)) for turn in TURNS),
    *((demand(thrust=0.5 * HIGHEST, alpha=turn), (1.0, 1.0, 1.0)) for turn in TURNS),
    # the base is spared what the joints cannot give
    (demand(joints=(0.0, 3000.0)), (1.0, 0.0, 0.0)),
]


@pytest.mark.parametrize(("wanted", "flags"), FLAGS, ids=range(len(FLAGS)))
def test_what_teaches_is_all_or_nothing(wanted, flags):
    """Any other number scales the observer's gain. Weight, and thrust and torque up to
    the rotors' limits, fit them.
    """
    assert done(make_centroidal(MODEL).par, wanted).free == flags


def test_a_thrust_downwards_teaches_nothing_even_where_the_rotors_could_give_it():
    """One of four rotors is turned over: its thrust outweighs the others', and all turn
    within their limits.
    """
    plain = skyarm.load_vehicle("hummingbird")
    *upright, last = plain.rotors
    last = dataclasses.replace(last, axis=Vec3(0, 0, -1))
    vehicle = dataclasses.replace(plain, rotors=(*upright, last))
    par = make_centroidal(Model(vehicle=vehicle, gravity=9.8)).par
    inertia = np.array([float(each) for each in plain.base.inertia.entries[:3]])

    def flag(squares):
        torque, thrust = np.zeros(3), 0.0
        for rotor, square in zip(vehicle.rotors, squares, strict=True):
            push = (
                float(rotor.thrust_coefficient)
                * square
                * np.array([float(c) for c in rotor.axis])
            )
            torque += np.cross([float(c) for c in rotor.position], push)
            torque -= float(rotor.direction) * float(rotor.moment_coefficient) * push
            thrust += push[2]
        wanted = dataclasses.replace(
            demand(thrust=thrust, alpha=Vec3(*(torque / inertia).tolist())), joints=()
        )
        wanted = dataclasses.replace(
            wanted, planned=dataclasses.replace(wanted.planned, joints=())
        )
        state = dataclasses.replace(hovering(), joints=(), joint_rates=())
        unknown = Disturbance(force=ZERO, torque=ZERO, efforts=())
        return (
            thrust,
            commanded(par, state, unknown, wanted, DT, trim=(0.0,) * 4).free[0],
        )

    up, down = flag((2e5, 3e5, 2e5, 1e5)), flag((1e5, 1e5, 1e5, 5e5))
    assert up[0] > 0.0 > down[0]
    assert (up[1], down[1]) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("limits", "flags"), [((0.05, 0.5), (0.0, 1.0)), ((0.5, 0.005), (1.0, 0.0))]
)
def test_a_joint_at_its_limit_is_told_apart_from_the_other(limits, flags):
    """100 rad/s^2 of both joints' one swing: about 0.2 N m at the first and 0.01 N m at
    the second.
    """
    links = tuple(
        dataclasses.replace(
            link, joint=dataclasses.replace(link.joint, effort_limit=limit)
        )
        for link, limit in zip(ARM.links, limits, strict=True)
    )
    par = make_centroidal(
        Model(vehicle=dataclasses.replace(ARM, links=links), gravity=9.8)
    ).par
    found = done(par, demand(joints=(-100.0, 100.0)))
    assert found.free[1:] == flags
    efforts, plain = (
        found.command.efforts,
        done(
            make_centroidal(MODEL).par, demand(joints=(-100.0, 100.0))
        ).command.efforts,
    )
    for effort, wanted, limit in zip(efforts, plain, limits, strict=True):
        assert effort == pytest.approx(np.clip(wanted, -limit, limit), rel=1e-12)


def test_who_obeys_is_asked_one_and_all():
    assert all_follow((1.0, 1.0, 1.0))
    for i in range(3):
        assert not all_follow(tuple(float(k != i) for k in range(3)))
    mixer = make_centroidal(MODEL).par.mixer
    inside = [0.5 * top for top in mixer.highest]
    assert rotors_follow(mixer, inside)
    for i in range(4):
        for outside in (-1.0, 1.01 * mixer.highest[i]):
            assert not rotors_follow(
                mixer,
                [outside if k == i else square for k, square in enumerate(inside)],
            )
    assert joints_follow(ARM, (0.5, -0.5)) == [True, True]
    assert joints_follow(ARM, (-0.51, 0.4)) == [False, True]
    assert joints_follow(ARM, (0.4, 0.51)) == [True, False]


def test_the_laws_memory_flags_are_ones_too():
    controller = make_centroidal(MODEL)
    rest = dict.fromkeys(
        ("joints", "joint_rates", "joint_accelerations", "joint_jerks", "joint_snaps"),
        (0.0, 0.0),
    )
    measured = dataclasses.replace(
        blank_measurement(2, 4), position=Vec3(0.0, 0.0, 1.0)
    )
    goal = Reference(
        position=Vec3(0.0, 0.0, 1.0), velocity=ZERO, acceleration=ZERO, **rest
    ).dense()
    memory, _ = controller.law(
        controller.memory, measured, goal, DT, par=controller.par
    )
    assert (memory.started, memory.applied, memory.free) == (
        1.0,
        (1.0,) * 3,
        (1.0,) * 3,
    )
    memory, _ = controller.law(memory, measured, goal, DT, par=controller.par)
    assert (memory.started, memory.applied, memory.free) == (
        1.0,
        (1.0,) * 3,
        (1.0,) * 3,
    )


@pytest.mark.parametrize("applied", [1.0, 0.0])
def test_the_trim_moves_by_what_the_motors_miss_of_the_mean_square(applied):
    """Rate 3 per second of wanted less reached squares, a share of the lag undone; at
    most a tenth of the highest.
    """
    par = make_centroidal(MODEL).par
    speeds, trim = (430.0, 520.0, 470.0, 500.0), (900.0, -400.0, 0.0, 200.0)
    # level hover: each rotor carries a quarter but for the arm's and the parts'
    # offsets, of which there are none
    square = WEIGHT / (4 * 8.54858e-6)
    found = done(par, demand(), trim, applied, speeds)
    for before, after, speed in zip(trim, found.trim, speeds, strict=True):
        wanted, lag = (
            np.sqrt(square + before),
            np.exp(-DT / (0.0125 if square + before > speed**2 else 0.025)),
        )
        told = wanted + 0.1 * (wanted - speed) * (1.0 / (1.0 - lag) - 1.0)
        reached = told + (speed - told) * lag
        expected = before + applied * 3.0 * DT * (square - reached**2)
        assert after == pytest.approx(expected, rel=1e-9)
    full = tuple(TRIM * top for top in par.mixer.highest)
    assert done(par, demand(), full, 1.0, (100.0,) * 4).trim == full


def moved(par, offset, velocity, force, rotation):
    """The demand of a vehicle off its reference, whose base law has no gains: it turns
    nowhere and pulls nowhere.
    """
    x, y, z, w = rotation.as_quat().tolist()
    state = dataclasses.replace(
        hovering(),
        position=Vec3(*offset),
        velocity=Vec3(*velocity),
        quaternion=Quaternion(w, x, y, z),
        joints=(0.3, -0.5),
        joint_rates=(0.4, -0.2),
    )
    still = (0.0,) * 3
    signals = [
        Taylor.of_derivatives((each, *still, 0.0))
        for each in (0.0, 0.0, 0.0, 0.0, 0.2, -0.6)
    ]
    unknown = dataclasses.replace(NONE, force=Vec3(*force))
    found = demanded(par, state, signals, unknown)
    np.testing.assert_allclose([*found.alpha], 0.0, atol=1e-12)
    return np.array(found.joints)


def passive():
    par = make_centroidal(MODEL, mode="tip").par
    zero = dict.fromkeys(("position", "velocity", "attitude", "rate"), ZERO)
    return dataclasses.replace(par, base=dataclasses.replace(par.base, **zero))


@pytest.mark.parametrize("part", ["position", "velocity", "acceleration"])
def test_far_from_its_base_the_tip_goes_along_and_the_arm_stays_calm(part):
    """Beyond reach the tip's goal takes over the base's error with its rate and its
    acceleration, whatever they are.

    50 m against a reach of 0.12 m: all but 3e-11 of the error is the goal's, and gains
    of 700 / s^2 see 1e-6 m/s^2 of it. A force of 1 N that pushes the whole vehicle
    accelerates it by 1.2 m/s^2.
    """
    par, rotation = passive(), Rotation.from_euler("ZYX", [0.0, 0.2, -0.1])
    plain = moved(par, (50.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3, rotation)
    for sign in (1.0, -1.0):
        change = {
            "position": (0.0,) * 3,
            "velocity": (0.0,) * 3,
            "acceleration": (0.0,) * 3,
        }
        change[part] = (0.8 * sign, -0.5 * sign, 0.3 * sign)
        offset = np.array([50.0, 0.0, 0.0]) + change["position"]
        found = moved(
            par,
            tuple(offset.tolist()),
            change["velocity"],
            change["acceleration"],
            rotation,
        )
        np.testing.assert_allclose(found, plain, atol=1e-3)


def test_near_its_base_the_arm_makes_good_what_the_base_misses():
    """A centimetre is no reason to go along: the joints turn to make it good, and the
    other way for the opposite.
    """
    par, upright = passive(), Rotation.identity()
    plain = moved(par, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, upright)
    ahead, behind = (
        moved(par, (s * 0.01, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3, upright) - plain
        for s in (1.0, -1.0)
    )
    assert np.abs(ahead).max() > 5.0
    np.testing.assert_allclose(ahead, -behind, rtol=1e-2, atol=1e-2)
