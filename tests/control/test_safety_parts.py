"""The parts of the safety layer one by one, against arithmetic of NumPy and SciPy."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm import dynamics
from skyarm.algebra import ZERO3, Force, Mat3, Vec3
from skyarm.control.catalogue import HUMMINGBIRD, make_controller
from skyarm.control.controller import ControllerError, with_applied_command
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.control.safety.bounds import (
    _within_barrier,
    apply_joint_barrier,
    floating_inertia_times,
    govern_base,
    govern_joints,
    limit_slew,
    reachable,
    with_priorities,
)
from skyarm.control.safety.limits import law_stiffness, limits_for
from skyarm.control.safety.recovery import Confidence, steep_error, update_confidence
from skyarm.dynamics.actuators import Command, allocation_matrix, make_mixer
from skyarm.dynamics.workspace import middle_position
from support.laws import ARM2, MODEL, cases, controller, pushes, vec

LIMITS = limits_for(controller("hybrid_computed_torque"), step=1e-6, step_speed=1e-6)
CASES = cases(200, seed=5)


def asked(case, reference):
    """Acceleration that a law of the governor's gains asks, by NumPy."""
    e_p = np.array(list(reference.position)) - case.p
    e_v = np.array(list(reference.velocity)) - case.v
    return (
        LIMITS.stiffness * e_p
        + LIMITS.damping * e_v
        + np.array(list(reference.acceleration))
    )


def governed(case, limits=LIMITS):
    return govern_base(
        case.reference(),
        case.measurement(),
        limits=limits,
        stiffness=limits.stiffness,
        damping=limits.damping,
        gravity=9.81,
    )


def test_the_stiffness_of_the_papers_laws_is_found():
    for name in ("hybrid_computed_torque", "decoupled_pd", "rotors_sim_position"):
        limits = limits_for(controller(name))
        mass = float(ARM2.mass)
        expected = 4.0 / mass, 2.2 / mass
        # the computed torque accelerates the whole vehicle by gains over its mass, as
        # RotorS's law does; differences of thrusts of 7 N by 1e-3 m leave 1e-9
        assert (limits.stiffness, limits.damping) == pytest.approx(expected, rel=1e-6)


def test_the_stiffness_of_increments_on_measured_thrust_is_that_of_the_gains():
    mass = float(ARM2.mass)
    limits = limits_for(make_controller("indi", MODEL, gains=HUMMINGBIRD))
    assert (limits.stiffness, limits.damping) == pytest.approx(
        (4.0 / mass, 2.2 / mass), rel=1e-6
    )


def test_a_law_that_starts_gently_is_as_stiff_as_it_is_in_flight():
    model = Model(vehicle=skyarm.load_vehicle("hummingbird"))
    # of a known delay of 40 ms and more the bandwidth grows in 1.5 s from a quarter
    soon, late = (
        law_stiffness(make_controller("centroidal", model, delay=delay))
        for delay in (0.035, 0.04)
    )
    assert late == pytest.approx(soon, rel=1e-6)


def test_a_law_that_keeps_the_tip_keeps_it_under_the_layer():
    for keeps in (False, True):
        law = dataclasses.replace(controller("hybrid_computed_torque"), keeps_tip=keeps)
        assert with_safety_layer(law).keeps_tip is keeps


def test_whatever_the_errors_the_tilt_and_climb_asked_for_stay_within_their_limits():
    tilts, before = [], []
    for case in CASES:
        for wanted, found in (
            (asked(case, case.reference()), before),
            (asked(case, governed(case)), tilts),
        ):
            found.append(
                [math.atan2(math.hypot(*wanted[:2]), 9.81 + wanted[2]), abs(wanted[2])]
            )
    assert np.max(before, axis=0)[0] > 1.0  # rad: the cases do ask for too much
    assert np.max(tilts, axis=0)[0] <= LIMITS.tilt + 1e-9
    assert np.max(tilts, axis=0)[1] <= LIMITS.climb + 1e-9


def test_a_bounded_reference_still_pulls_the_same_way():
    far = dataclasses.replace(
        CASES[0],
        p=np.zeros(3),
        v=np.zeros(3),
        p_d=np.array([30.0, 40.0, 0.0]),
        v_d=np.zeros(3),
    )
    far = dataclasses.replace(far, a_d=np.zeros(3))
    pull = asked(far, governed(far))
    assert pull[1] / pull[0] == pytest.approx(40.0 / 30.0, rel=1e-9)
    assert pull[0] > 0.0
    assert pull[2] == pytest.approx(0.0, abs=1e-9)


def test_a_small_error_passes_bit_for_bit():
    case = dataclasses.replace(
        CASES[0], p=np.zeros(3), v=np.zeros(3), p_d=np.full(3, 0.1), v_d=np.full(3, 0.2)
    )
    case = dataclasses.replace(case, a_d=np.full(3, 0.3))
    assert governed(case) == case.reference()


def test_a_small_error_of_a_stiff_law_passes_and_the_bound_has_no_jump():
    stiff = dataclasses.replace(
        LIMITS, stiffness=100.0, damping=30.0, step=0.4, step_speed=1.5
    )
    at = dataclasses.replace(
        CASES[0], p=np.zeros(3), v=np.zeros(3), v_d=np.zeros(3), a_d=np.zeros(3)
    )
    found = [
        governed(dataclasses.replace(at, p_d=np.array([d, 0.0, 0.0])), stiff).position.x
        for d in (0.399, 0.401)
    ]
    assert found[0] == 0.399
    assert found[1] == pytest.approx(0.4, abs=1e-6)


def limited_arm(lower=-0.5, upper=0.8):
    return Model(vehicle=ARM2.with_joints(lower=lower, upper=upper), gravity=9.81)


def test_joint_references_are_slewed_and_kept_inside_their_limits():
    model = limited_arm()
    limits = limits_for(
        controller("hybrid_computed_torque", model), joint_slew=2.0, joint_step=0.5
    )
    reference = dataclasses.replace(
        CASES[0].reference(), joints=(2.0, -0.3), joint_rates=(5.0, 0.1)
    )
    at, ramping, seen = (0.0, -0.3), (0.0, 0.0), []
    for _ in range(200):
        found, ramping = govern_joints(
            reference,
            at,
            ramping,
            limits.joint_slew,
            limits.joint_step,
            0.005,
            model=model,
            limits=limits,
        )
        seen.append((found.joints[0] - at[0]) / 0.005)
        at = found.joints
        if at[0] < 0.65:
            assert found.joint_rates == pytest.approx([2.0, 0.1])
    assert max(seen) <= 2.0 + 1e-9
    assert at == pytest.approx((0.8 - 2.0 * limits.joint_margin[0], -0.3), abs=1e-12)
    assert found.joint_rates[0] == 0.0
    assert found.joint_accelerations[1] == reference.joint_accelerations[1]


def test_torques_that_change_joint_accelerations_are_what_forward_dynamics_says():
    rng = np.random.default_rng(3)
    for case in CASES[:20]:
        change, efforts = rng.normal(size=2), rng.normal(size=2)
        added = floating_inertia_times(
            MODEL, tuple(case.q.tolist()), tuple(change.tolist())
        )
        state = (
            ARM2,
            tuple(case.q.tolist()),
            vec(case.w),
            tuple(case.qd.tolist()),
            Force(ZERO3, vec([0.1, 0.2, 7.0])),
        )
        before = np.array(dynamics.forward_dynamics(*state, tuple(efforts))[1])
        after = np.array(
            dynamics.forward_dynamics(*state, tuple(efforts + np.array(added)))[1]
        )
        # articulated-body algorithm against composite bodies, accelerations of hundreds
        # of rad/s^2
        np.testing.assert_allclose(after - before, change, atol=1e-9)


def test_the_fence_leaves_torques_far_from_limits_alone_bit_for_bit():
    model = limited_arm(-20.0, 20.0)
    limits = limits_for(controller("hybrid_computed_torque", model), joint_speed=100.0)
    measurement = CASES[1].measurement()
    assert apply_joint_barrier(model, limits, measurement, (0.01, -0.02)) == (
        0.01,
        -0.02,
    )


def test_the_fence_knows_what_friction_brakes():
    """A motor that turns a damped joint at a constant rate, against damping times rate,
    is far from every limit.
    """
    vehicle = ARM2.with_joints(lower=-20.0, upper=20.0, damping=0.3)
    model = Model(vehicle=vehicle, gravity=9.81)
    limits = limits_for(controller("hybrid_computed_torque", model), joint_speed=1.2)
    case = dataclasses.replace(
        CASES[1], w=np.zeros(3), q=np.zeros(2), qd=np.array([1.0, 0.0])
    )
    efforts = (0.3 * 1.0, 0.0)
    assert apply_joint_barrier(model, limits, case.measurement(), efforts) == efforts


def test_the_fence_brakes_a_joint_that_runs_at_its_limit():
    model = limited_arm()
    limits = limits_for(controller("hybrid_computed_torque", model))
    case = dataclasses.replace(
        CASES[1], q=np.array([0.7, 0.0]), qd=np.array([3.0, 0.0])
    )
    measurement = case.measurement()
    efforts = apply_joint_barrier(model, limits, measurement, (0.3, 0.0))
    thrust = sum(r.thrust_coefficient * 480.0**2 for r in ARM2.rotors)
    _, qdd = dynamics.forward_dynamics(
        ARM2,
        measurement.joints,
        measurement.rate,
        measurement.joint_rates,
        Force(ZERO3, vec([0, 0, thrust])),
        efforts,
    )
    k, room = limits.joint_pole, 0.8 - limits.joint_margin[0] - 0.7
    bound = k * k * room - 2.0 * k * 3.0
    assert 2.0 * bound < qdd[0] <= bound + 1e-9 < 0.0


def test_yaw_gives_way_before_roll_pitch_and_thrust():
    mixer = with_priorities(MODEL, make_mixer(ARM2))
    speeds = (870.0, 600.0, 860.0, 610.0)  # two are beyond 838 rad/s
    torque, thrust = pushes(ARM2, Command(rotor_speeds=speeds))
    found = reachable(MODEL, mixer, speeds)
    got, lift = pushes(ARM2, Command(rotor_speeds=found))
    assert max(found) <= 838.0 + 1e-9
    np.testing.assert_allclose(got[:2], torque[:2], rtol=1e-9)
    assert lift == pytest.approx(thrust, rel=1e-9)
    assert abs(got[2]) < abs(torque[2])


def test_a_law_that_ranks_demands_keeps_its_own_order():
    for mixer in (
        make_mixer(ARM2, "priority"),
        make_mixer(ARM2, "thrust_before_yaw", yaw_slack=0.1),
    ):
        assert with_priorities(MODEL, mixer) is mixer
    assert with_priorities(MODEL, make_mixer(ARM2)).policy == "priority"


def test_speeds_out_of_reach_keep_their_sideways_force():
    tilted = Model(vehicle=skyarm.load_vehicle("tilted_hexarotor"))
    mixer = make_mixer(tilted.vehicle, "thrust_before_yaw", sideways=True)
    # the last one is beyond 750 rad/s
    asked = (500.0, 560.0, 500.0, 460.0, 520.0, 755.0)
    found = np.array(reachable(tilted, mixer, asked))
    assert max(found) <= 750.0 + 1e-9
    A = np.array(
        [
            [float(v) for v in row]
            for row in allocation_matrix(tilted.vehicle, sideways=True)
        ]
    )
    wanted, got = (A @ np.square(each) for each in (asked, found))
    assert np.abs(wanted[4:]).max() > 1.0
    np.testing.assert_allclose(got[4:], wanted[4:], atol=0.25)


def test_speeds_in_reach_pass_bit_for_bit():
    mixer = with_priorities(MODEL, make_mixer(ARM2))
    speeds = (790.0, 300.0, 0.0, 838.0)
    assert reachable(MODEL, mixer, speeds) == speeds


def test_a_command_moves_no_faster_than_its_slew_but_the_first_is_free():
    last, wanted = (
        Command(rotor_speeds=(100.0,), efforts=(0.1,)),
        Command(rotor_speeds=(500.0,), efforts=(-0.4,)),
    )
    assert limit_slew(wanted, last, 0.0, 1e3, (2.0,), 0.005) == wanted
    found = limit_slew(wanted, last, 1.0, 1e3, (2.0,), 0.005)
    assert found.rotor_speeds == pytest.approx([105.0])
    assert found.efforts == pytest.approx([0.09])
    assert limit_slew(wanted, last, 1.0, math.inf, (math.inf,), 0.005) == wanted


def test_the_steep_attitude_error_grows_up_to_180_degrees():
    rng = np.random.default_rng(1)
    for angle in (1e-4, 0.5, 1.5, 2.5, 3.1):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        wanted = Rotation.random(random_state=2).as_matrix()
        R = wanted @ Rotation.from_rotvec(angle * axis).as_matrix()
        error = steep_error(
            *(Mat3(*(Vec3(*row) for row in each.tolist())) for each in (R, wanted))
        )
        np.testing.assert_allclose(
            list(error), 2.0 * math.sin(0.5 * angle) * axis, atol=1e-9
        )


def test_an_arm_is_stowed_in_the_middle_of_its_range_or_hanging():
    joint = ARM2.links[0].joint
    assert middle_position(joint) == 0.0
    assert middle_position(
        dataclasses.replace(joint, lower=-0.2, upper=1.0)
    ) == pytest.approx(0.4)
    assert middle_position(dataclasses.replace(joint, lower=0.3)) == 0.3


@dataclasses.dataclass(frozen=True)
class Observing:
    """A memory that keeps what was sent."""

    sent: object


def test_a_memory_is_told_what_was_sent_if_it_keeps_that():
    first, second = Command(rotor_speeds=(1.0,)), Command(rotor_speeds=(2.0,))
    assert with_applied_command((), second) == ()
    assert with_applied_command(Observing(first), second) == Observing(second)
    assert with_applied_command(Observing((first, first)), second) == Observing(
        (first, second)
    )
    assert with_applied_command(Observing("no command"), second) == Observing(
        "no command"
    )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"tilts": 1.0}, "safety.tilts: unknown field; allowed"),
        ({"tilt": 1.6}, "safety.tilt = 1.6: must be at most 1.484"),
        ({"climb": 10.0}, "safety.climb = 10.0: must be at most 9.81"),
        ({"speed": 0.0}, "safety.speed = 0.0: must be above 0"),
        ({"speed": "fast"}, "safety.speed = 'fast': must be a number"),
        ({"trusted_tilt": 3.2}, "safety.trusted_tilt = 3.2: must be at most 3.142"),
        (
            {"trusted_tilt": math.inf},
            "safety.trusted_tilt = inf: must be at most 3.142",
        ),
        ({"stiffness": math.inf}, "safety.stiffness = inf: must be a finite number"),
        ({"damping": math.inf}, "safety.damping = inf: must be a finite number"),
        ({"joint_pole": math.inf}, "safety.joint_pole = inf: must be a finite number"),
        (
            {"joint_margin": math.inf},
            r"safety.joint_margin\[0\] = inf: must be a finite number",
        ),
        ({"effort": [1.0]}, r"safety.effort = \[1.0\]: 1 values, must be 2"),
        ({"effort": [1.0, -1.0]}, r"safety.effort\[1\] = -1.0: must be above 0"),
    ],
)
def test_wrong_limits_are_refused_by_name(given, words):
    with pytest.raises(ControllerError, match=words):
        limits_for(controller("hybrid_computed_torque"), **given)


@pytest.mark.parametrize("limits", [3, "tight", [0.5]])
def test_what_are_no_limits_is_refused(limits):
    with pytest.raises(
        ControllerError,
        match=r"^safety = .*: must be Limits or a mapping of some of their fields$",
    ):
        with_safety_layer(controller("hybrid_computed_torque"), limits)


def test_limits_given_as_a_record_are_checked_too():
    law = controller("hybrid_computed_torque")
    assert with_safety_layer(law, LIMITS).par.limits == LIMITS
    for field, value, words in (
        ("speed", math.nan, "^safety.speed = nan: must be a number$"),
        ("tilt", 2.0, "^safety.tilt = 2.0: must be at most 1.484$"),
        (
            "effort",
            (1.0,),
            r"^safety.effort = \(1.0,\): 1 values, must be 2 \(one per joint\)$",
        ),
    ):
        with pytest.raises(ControllerError, match=words):
            with_safety_layer(law, dataclasses.replace(LIMITS, **{field: value}))


def test_what_is_no_controller_is_not_guarded():
    with pytest.raises(
        ControllerError, match=r"^controller = 'paper_ct': must be a Controller$"
    ):
        with_safety_layer("paper_ct")


@pytest.mark.parametrize(
    ("stow", "words"),
    [
        ((math.nan, 0.0), r"^safety.stow\[0\] = nan: must be a finite number$"),
        ((0.0, math.inf), r"^safety.stow\[1\] = inf: must be a finite number$"),
        ((True, 0.0), r"^safety.stow\[0\] = True: must be a finite number$"),
        (
            (0.0, 0.9),
            r"^safety.stow\[1\] = 0.9: must be within the joint's limits, -0.5 to 0.8$",
        ),
        ("ab", "^safety.stow = 'ab': must be 2 numbers, one per joint$"),
        (5, "^safety.stow = 5: must be 2 numbers, one per joint$"),
    ],
)
def test_a_pose_that_the_arm_cannot_take_is_refused(stow, words):
    with pytest.raises(ControllerError, match=words):
        with_safety_layer(
            controller("hybrid_computed_torque", limited_arm()), stow=stow
        )


def test_a_law_is_given_up_at_once_above_the_speed_at_which_it_is_lost():
    still = dataclasses.replace(
        CASES[0], euler=np.zeros(3), w=np.zeros(3), q=np.zeros(2), qd=np.zeros(2)
    )
    for speed, given_up in ((0.99, 0.0), (1.01, 1.0)):
        seen = dataclasses.replace(
            still.measurement(),
            velocity=Vec3(0.6, 0.0, 0.8) * (speed * LIMITS.lost_speed),
        )
        none = Confidence(given_up=0.0, outside=0.0, calm=0.0)
        assert (
            update_confidence(LIMITS, none, seen, seen.joints, False, 0.005).given_up
            == given_up
        )


def test_near_its_largest_speed_a_joint_accelerates_by_four_poles_times_the_rest():
    model = limited_arm(-1e3, 1e3)
    limits = limits_for(
        controller("hybrid_computed_torque", model), joint_speed=2.0, joint_pole=20.0
    )
    seen = dataclasses.replace(
        CASES[0].measurement(), joints=(0.0, 0.0), joint_rates=(1.5, -1.0)
    )
    assert _within_barrier(model, limits, seen, (1e6, -1e6)) == pytest.approx(
        [80.0 * 0.5, -80.0 * 1.0], rel=1e-12
    )
