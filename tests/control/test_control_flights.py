"""Short closed-loop flights: other vehicles with default gains, and recoveries from
extreme attitudes.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import HUMMINGBIRD, make_controller
from skyarm.control.model import Model
from skyarm.plant.interface import Truth
from skyarm.reference import Constant, Sine, hover
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.simulate import Scenario, run
from support.laws import (
    ARM2,
    JOINT_GAINS,
    G,
    changed,
    controller,
    hovering,
    pushes,
    raw_squares,
    step,
    unclipped,
)

TRUTH = Truth(vehicle=skyarm.load_vehicle("hummingbird_arm2_rotors"), gravity=9.8)


def moving(vehicle):
    """A sine on every joint, in the middle of a sliding joint's range."""
    return tuple(
        (
            Sine(amplitude=0.3, frequency_hz=0.25 + 0.05 * i)
            if link.joint.kind == "revolute"
            else Constant(0.05) + Sine(amplitude=0.03, frequency_hz=0.4)
        )
        for i, link in enumerate(vehicle.links)
    )


def flight(vehicle):
    found = make_controller("hybrid_computed_torque", Model(vehicle=vehicle))
    trajectory = hover((0.0, 0.0, 2.0), joints=moving(vehicle))
    log = run(
        Scenario(
            name="x",
            duration=5.0,
            plant=Truth(vehicle=vehicle),
            controller=found,
            reference=trajectory,
        )
    )
    assert log.status == "completed"
    return log


@pytest.mark.parametrize(
    "name", ["hexarotor_arm6", "octo_coaxial_two_arms", "tilted_hexarotor"]
)
def test_default_gains_hover_any_vehicle_while_its_joints_move(name):
    """Rotor lag of 30-50 ms is all the law does not know: centimetres and hundredths of
    a radian.
    """
    log = flight(skyarm.load_vehicle(name).with_joints(coulomb=0.0, damping=0.0))
    assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.05
    assert np.abs(log.euler).max() < 0.05
    late = log.time >= 1.0  # the sines start with a step in rate
    if log.joints.shape[1]:
        assert np.abs(log.joints - log.joints_reference)[late].max() < 0.03


@pytest.mark.parametrize("name", ["hexarotor_arm6", "octo_coaxial_two_arms"])
def test_viscous_joints_lag_by_what_the_law_leaves_out_and_the_base_does_not_notice(
    name,
):
    """The law's inverse dynamics has no friction: damping d takes an angle of d rate /
    (J kp) on a joint of inertia J.

    For the hexarotor's hand, 0.003 N m s/rad on 1.8e-5 kg m^2, that is a radian at 0.94
    rad/s: a reason for friction compensation, not for other gains.
    """
    log = flight(skyarm.load_vehicle(name).with_joints(coulomb=0.0))
    assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.05
    assert np.abs(log.euler).max() < 0.05
    lag = np.abs(log.joints - log.joints_reference)[log.time >= 1.0].max()
    assert 0.03 < lag < 0.5


def upset(axis, degrees, *, law, policy="clip", height=60.0, seconds=6.0, ground=False):
    """Fly from rest at an attitude turned about one axis, the reference at the same
    place.
    """
    x, y, z, w = Rotation.from_euler(axis, degrees, degrees=True).as_quat()
    start = trimmed_state(TRUTH, Vec3(0.0, 0.0, height), 0.0, (0.0, 0.0))
    believed = Model(vehicle=ARM2, gravity=G)
    found = make_controller(
        law,
        believed,
        gains=HUMMINGBIRD,
        joint_gains=JOINT_GAINS[law],
        mixer_policy=policy,
    )
    return run(
        Scenario(
            name="upset",
            duration=seconds,
            plant=TRUTH,
            controller=found,
            reference=hover((0.0, 0.0, height), joints=(0.0, 0.0)),
            initial=dataclasses.replace(start, quaternion=Quaternion(w, x, y, z)),
            ground=ground,
        )
    )


def upright(log):
    """Cosine of the tilt at the end."""
    return 1.0 - 2.0 * (log.quaternion[-1, 1] ** 2 + log.quaternion[-1, 2] ** 2)


def assert_recovered(log):
    assert log.status == "completed"
    assert upright(log) > 0.99
    # hover_offset of the truth's unknown 15 g and 9.8 m/s^2: 0.035 m
    assert np.linalg.norm(log.position[-1] - log.position_reference[-1]) < 0.2


def test_the_body_form_flies_away_from_a_pitch_of_90_degrees():
    log = upset("y", 90.0, law="hybrid_computed_torque", height=20.0, ground=True)
    assert_recovered(log)
    assert log.position[:, 2].min() > 18.5


@pytest.mark.parametrize("law", ["decoupled_pd", "hybrid_computed_torque"])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_clip_policy_recovers_from_120_degrees(law, axis):
    assert_recovered(upset(axis, 120.0, law=law))


def test_rotors_law_stays_on_its_back_because_every_rotor_is_clipped_to_rest():
    """On its back the wanted thrust is negative: all four squared speeds are, and
    clipping them takes the torque too.

    RotorS's own behaviour. A rotor turns for the torque of 0.7 sin(roll) only while its
    share of that, 0.7 sin(roll) / (2 0.17), is above its share m g |cos(roll)| / 4 of
    the thrust: up to 135 degrees at rest.
    """
    inverted = hovering(euler=(math.radians(179.0), 0.0, 0.0))
    flown = controller("rotors_sim_position")
    assert np.all(
        raw_squares(
            step(unclipped(flown), inverted.measurement(), inverted.reference())
        )
        < 0.0
    )
    assert (
        step(flown, inverted.measurement(), inverted.reference()).rotor_speeds
        == (0.0,) * 4
    )
    turning = math.pi - math.atan(0.806 * G / 4.0 / (0.7 / (2.0 * 0.17)))
    for roll, turns in ((turning - 0.01, True), (turning + 0.01, False)):
        case = hovering(euler=(roll, 0.0, 0.0))
        raw = raw_squares(step(unclipped(flown), case.measurement(), case.reference()))
        assert (raw.max() > 0.0) == turns
    log = upset("x", 179.0, law="decoupled_pd", seconds=3.0)
    assert log.status == "completed"
    assert np.all(log.rotor_commands == 0.0)
    assert upright(log) < -0.999


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_priority_mixer_keeps_the_torque_and_recovers_from_179_degrees(axis):
    log = upset(axis, 179.0, law="decoupled_pd", policy="priority", seconds=8.0)
    assert_recovered(log)
    assert log.position[:, 2].min() > 45.0


@pytest.mark.parametrize(("axis", "degrees"), [("y", 179.0), ("x", 160.0)])
def test_with_the_priority_mixer_the_computed_torque_recovers_from_its_back(
    axis, degrees
):
    assert_recovered(
        upset(
            axis, degrees, law="hybrid_computed_torque", policy="priority", seconds=8.0
        )
    )


def test_computed_torque_turns_wrongly_if_it_wants_more_than_rotors_can_give():
    """Nearly inverted about x, the arm's share of the torque is computed for an
    acceleration that is not flown.

    The arm hangs 0.015 kg m below the base and asks for 0.015 |a_d| sin(roll) to be
    carried along; the attitude loop gives -100 (J_xx + 0.0032) sin(roll) = -1.02
    sin(roll). Beyond |a_d| = 68 m/s^2, a few metres below the target at 10 m/s, the
    first wins: from 179 degrees of roll this law, which knows no limit of the rotors,
    does not recover.
    """
    moment = 0.04 * 0.075 + 0.04 * 0.225 + 0.01 * 0.3
    carried = 0.007 + 0.04 * 0.075**2 + 0.04 * 0.225**2 + 0.01 * 0.3**2
    critical = 100.0 * carried / moment
    assert critical == pytest.approx(68.0, abs=1.0)
    flown = unclipped(controller("hybrid_computed_torque"))
    for acceleration, sign in ((critical - 1.0, -1.0), (critical + 1.0, 1.0)):
        below = (acceleration - G) * 0.806 / 4.0
        case = changed(
            hovering(euler=(math.radians(179.0), 0.0, 0.0)), p=(0.0, 0.0, 1.0 - below)
        )
        raw = raw_squares(step(flown, case.measurement(), case.reference()))
        assert np.sign(raw[1] - raw[3]) == sign  # left minus right: torque about x
    fallen = upset(
        "x", 179.0, law="hybrid_computed_torque", policy="priority", seconds=4.0
    )
    assert fallen.position[-1, 2] < 0.0


def test_pushes_of_rotor_speeds_are_torque_and_thrust_of_the_mixer():
    """The tests' own sum over rotors agrees with what the law asked for."""
    case = hovering(joints=(0.3, 0.1))
    torque, thrust = pushes(
        ARM2, step(controller("decoupled_pd"), case.measurement(), case.reference())
    )
    np.testing.assert_allclose(
        [*torque, thrust], [0.0, 0.0, 0.0, 0.806 * G], atol=1e-14
    )
