"""Joints that the centroidal law keeps within their limits."""

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.laws.centroidal.demands import (
    brake_at_limit,
    towards,
    within_limits,
)
from skyarm.control.laws.centroidal.make import ends_of, make_centroidal
from skyarm.control.laws.centroidal.parameters import brace_joints
from skyarm.control.laws.centroidal.tip_tasks import plan_weight
from skyarm.control.model import JointGains, Model
from skyarm.dynamics import State
from skyarm.reference import Constant, Reference, Windowed
from skyarm.scenario.scenario_record import Delays
from skyarm.sensing.measurement import blank_measurement
from skyarm.studies.trial.facts import PAPER, setting_of
from skyarm.studies.trial.trial import NOISE
from skyarm.world import Disturbance
from skyarm.world.signal_vector import SignalVector

ARM1 = skyarm.load_vehicle("crazyflie_arm1")
GAINS = JointGains(stiffness=(900.0,), damping=(60.0,))
ZERO = Vec3(0.0, 0.0, 0.0)

SHARE, WITH_STOP, TURN = 0.5, 0.75, 2.2
"""Constants of the page."""


def with_limits(lower, upper, stops=False):
    (link,) = ARM1.links
    stiffness = {} if stops else {"stop_stiffness": 0, "stop_damping": 0}
    joint = dataclasses.replace(link.joint, lower=lower, upper=upper, **stiffness)
    return dataclasses.replace(ARM1, links=(dataclasses.replace(link, joint=joint),))


def bounded(vehicle, q, rate, told, wanted, gains=GAINS):
    """``told`` is the reference, with its derivatives where it moves."""
    reference = (
        Taylor.of_derivatives(told)
        if isinstance(told, tuple)
        else Taylor((told, 0.0, 0.0))
    )
    state = State(
        position=ZERO,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=ZERO,
        rate=ZERO,
        joints=(q,),
        joint_rates=(rate,),
        rotor_speeds=(0.0,) * 4,
    )
    return within_limits(
        vehicle, ends_of(vehicle), gains, state, (reference,), (wanted,)
    )[0]


@pytest.mark.parametrize(
    ("push", "told", "end"),
    [(1e3, 0.2, 0.6), (-1e3, 0.2, -0.65), (1e3, 1.3, 1.0), (-1e3, -1.9, -1.5)],
)
def test_a_joint_that_is_pushed_comes_to_rest_where_it_may_go(push, told, end):
    """On the way that two equal poles of 30 rad/s take from the first instant at which
    the bound holds.
    """
    vehicle, dt = with_limits(-1.5, 1.0), 1e-4
    assert end == pytest.approx(
        np.clip(told + SHARE * ((1.0 if push > 0.0 else -1.5) - told), -1.5, 1.0)
    )
    q, rate, path, met = 0.1, 0.0, [], None
    for k in range(6000):
        asked = bounded(vehicle, q, rate, told, push)
        if met is None and asked != push:
            met = k, q, rate
        rate += asked * dt
        q += rate * dt
        path.append(q)
    k, q_0, rate_0 = met
    t = dt * np.arange(1, 6001 - k)
    exact = end + (q_0 - end + (rate_0 + 30.0 * (q_0 - end)) * t) * np.exp(-30.0 * t)
    assert np.array(path[k:]) == pytest.approx(exact, abs=3e-3)
    assert q == pytest.approx(end, abs=1e-4)
    assert max(np.sign(push) * (np.array(path) - end)) < 1e-6


def swinging(t, size, w=2.0 * np.pi):
    """A sine and its derivatives."""
    return tuple(float(size * w**k * np.sin(w * t + 0.5 * np.pi * k)) for k in range(3))


def test_a_reference_that_moves_within_the_limits_is_followed_as_it_is():
    """0.9 rad at 1 Hz in limits of 1 rad: 42 mrad off where its room counted as at
    rest.
    """
    vehicle, dt, q, rate = with_limits(-1.0, 1.0), 1e-3, 0.0, swinging(0.0, 0.9)[1]
    off = []
    for k in range(2000):
        told = swinging((k + 0.5) * dt, 0.9)
        wanted = told[2] + 60.0 * (told[1] - rate) + 900.0 * (told[0] - q)
        assert bounded(vehicle, q, rate, told, wanted) == wanted
        rate += wanted * dt
        q += rate * dt
        off.append(q - swinging((k + 1) * dt, 0.9)[0])
    assert np.abs(off).max() < 0.01


@pytest.mark.parametrize(("size", "stops"), [(0.6, False), (0.6, True), (1.3, False)])
def test_a_joint_that_is_pushed_along_a_moving_reference_comes_to_where_it_may_go(
    size, stops
):
    """Its share of the way from the reference to the limit; never beyond that, where
    the reference is beyond it too.
    """
    vehicle, dt, q, rate = with_limits(-1.0, 1.0, stops), 1e-3, 0.0, 0.0
    share = WITH_STOP if stops else SHARE
    for k in range(2000):
        told = swinging(k * dt, size)
        rate += bounded(vehicle, q, rate, told, 1e3) * dt
        q += rate * dt
        assert q < 1.0 + 1e-3
        if k > 500 and told[0] < 0.5:
            told = swinging((k + 1) * dt, size)[0]
            assert q == pytest.approx(told + share * (1.0 - told), abs=0.02)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("way", "rate"), [(0.02, 0.61), (0.02, 2.0), (0.3, 30.0)])
def test_a_joint_too_fast_for_its_pole_stops_at_its_limit(side, way, rate):
    """By d'' = d'^2 / d, whose solution is d e^(-t d'/d); two poles of 30 rad/s pass
    the limit.
    """
    vehicle, dt = with_limits(-1.0, 1.0), 1e-5
    q, now = side * (1.0 - way), side * rate
    assert side * bounded(vehicle, q, now, side, side * 1e3) == pytest.approx(
        -rate * rate / way, rel=1e-9
    )
    for k in range(4000):
        now += bounded(vehicle, q, now, side, side * 1e3) * dt
        q += now * dt
        exact = way * np.exp(-rate / way * (k + 1) * dt)
        assert 1.0 - side * q == pytest.approx(exact, abs=2e-3 * way)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_joint_at_its_limit_loses_its_rate_by_six_of_its_poles_at_most(side):
    """Of 30 rad/s each; one that comes back, or rests, is asked for no more than
    before.
    """
    vehicle = with_limits(-1.0, 1.0)
    for place in (0.999, 1.0, 1.01):
        asked = bounded(vehicle, side * place, side * 0.5, side, side * 1e3)
        assert side * asked == pytest.approx(-180.0 * 0.5)
    rests, back = (
        side * bounded(vehicle, side * 1.01, side * rate, side, side * 1e3)
        for rate in (0.0, -0.5)
    )
    assert rests == pytest.approx(-900.0 * 0.01)
    assert back == pytest.approx(-900.0 * 0.01 + 60.0 * 0.5)


def test_the_barrier_moves_with_its_share_of_the_references_motion():
    """k^2 (q + s (l - q)) + (1 - s) (q'' + 2 k q'), with numbers of few bits."""
    reference = Taylor.of_derivatives((0.5, 1.0, 2.0))
    assert towards(1.5, reference, 0.25, 4.0) == 16.0 * 0.75 + 0.75 * (2.0 + 8.0)


def test_a_joint_as_fast_as_its_pole_allows_is_not_braked():
    """At d' = -k d the barrier itself stops it at the limit; above it is braked by
    d'^2 / d.
    """
    way, pole = 0.5, 4.0
    assert [brake_at_limit(7.0, way, speed, pole) for speed in (2.0, 2.5)] == [
        7.0,
        -(2.5**2) / way,
    ]


def test_the_way_to_a_limit_counts_as_a_nanometre_at_least():
    """Beyond the limit a pole of 1e9 rad/s brakes what is faster than 1 m/s."""
    for way in (1e-9, 0.0, -1.0):
        slow, fast = (brake_at_limit(7.0, way, speed, 1e9) for speed in (0.995, 1.005))
        assert (slow, fast) == (7.0, pytest.approx(-(1.005**2) * 1e9))


@pytest.mark.parametrize("arm", [(900.0, 0.0), (900.0, 20.0)])
def test_a_loop_of_little_damping_bounds_by_its_stiffness(arm):
    gains = JointGains(stiffness=(arm[0],), damping=(arm[1],))
    vehicle = with_limits(-1.5, 1.5)
    assert bounded(vehicle, 0.1, 0.0, 0.0, 5.0, gains) == 5.0
    assert bounded(vehicle, 0.1, 0.0, 0.0, 1e4, gains) == pytest.approx(
        900.0 * (0.75 - 0.1)
    )


@pytest.mark.parametrize("push", [1e4, -1e4])
def test_a_joint_without_limits_comes_to_rest_beside_its_moving_reference(push):
    """2.2 rad from a swing, on either side and from 0.4 rad on alike: it does not
    spin.
    """
    vehicle, dt, q, rate = with_limits(-np.inf, np.inf), 1e-3, 0.4 * np.sign(push), 0.0
    for k in range(2000):
        rate += bounded(vehicle, q, rate, swinging(k * dt, 0.6), push) * dt
        q += rate * dt
        if k > 500:
            assert q == pytest.approx(
                swinging((k + 1) * dt, 0.6)[0] + np.sign(push) * TURN, abs=0.02
            )
    one, other = (
        bounded(vehicle, sign * 5.0, sign * 7.0, sign * 0.3, sign * 1e3)
        for sign in (1.0, -1.0)
    )
    assert one == -other < 0.0


def test_a_motion_within_the_room_keeps_its_bits_and_one_limit_bounds_one_side():
    wide, free, above = (
        with_limits(*pair) for pair in ((-1.5, 1.5), (-np.inf, np.inf), (-np.inf, 1.0))
    )
    for q, wanted in ((0.1, 3.3), (-0.3, -7.7), (0.4, 0.0)):
        assert bounded(wide, q, 0.5, 0.1, wanted) == wanted
    assert (ends_of(free), ends_of(above)) == (((False, False),), ((False, True),))
    assert bounded(free, 1.9, 3.0, 0.0, 77.0) == 77.0
    assert bounded(above, -5.0, -50.0, 0.0, -1e3) == -1e3
    assert bounded(above, 0.9, 0.0, 0.0, 1e3) < 0.0
    below = with_limits(-1.0, np.inf)
    assert ends_of(below) == ((True, False),)
    for q, rate, told, wanted in (
        (0.9, 0.0, 0.0, 1e3),
        (0.3, 7.0, 0.2, 10.0),
        (0.9, 0.0, 1.3, 1e3),
        (-5.0, -50.0, 0.0, -1e3),
    ):
        assert bounded(below, -q, -rate, -told, -wanted) == -bounded(
            above, q, rate, told, wanted
        )
    # at rest, where it may go, nothing is asked: further where a stop holds it
    for stops, share in ((False, SHARE), (True, WITH_STOP)):
        vehicle = with_limits(-1.5, 1.5, stops)
        assert bounded(vehicle, 1.5 * share, 0.0, 0.0, 1e3) == pytest.approx(
            0.0, abs=1e-9
        )


def test_joints_are_bounded_and_those_without_limits_are_braced():
    model, free = Model(vehicle=ARM1), Model(vehicle=with_limits(-np.inf, np.inf))
    presses = {"mode": "tip", "interaction": (0.5, 0.25)}
    braces = [make_centroidal(each, mode="tip").par.braces for each in (model, free)]
    assert [*braces, make_centroidal(free, **presses).par.braces] == [
        False,
        True,
        False,
    ]
    assert make_centroidal(model, mode="tip").par.joint_ends == ((True, True),)
    assert make_centroidal(free, mode="tip").par.joint_ends == ((False, False),)
    assert make_centroidal(model).par.joint_ends == ((True, True),)
    assert (
        make_centroidal(
            Model(vehicle=skyarm.load_vehicle("hummingbird"))
        ).par.joint_ends
        == ()
    )


@pytest.mark.parametrize(
    ("up", "share"), [(-3.0, 1.0), (0.04, 1.0), (0.15, 1.9), (0.25, 2.8), (3.0, 3.2)]
)
def test_joints_are_braced_by_the_upward_force_over_the_weight(up, share):
    """Stiffness as the power 1.5 of the damping; the base's gains and, without an
    accelerometer, the observer stay.
    """
    model = Model(vehicle=with_limits(-np.inf, np.inf))
    par = make_centroidal(model, mode="tip", accelerometer=(0.0, 0.0)).par
    weight = par.model.vehicle.mass * par.model.gravity
    found = brace_joints(par, Vec3(40.0, -7.0, up * weight), (0.0,), 0.0)
    gains = (
        found.tip.position,
        found.tip.velocity,
        *found.joint_gains.stiffness,
        *found.joint_gains.damping,
    )
    own = (
        par.tip.position,
        par.tip.velocity,
        *par.joint_gains.stiffness,
        *par.joint_gains.damping,
    )
    assert gains == pytest.approx(
        [a * b for a, b in zip(own, (share**1.5, share) * 2, strict=True)]
    )
    assert (found.base, found.observer) == (par.base, par.observer)
    hears = make_centroidal(model, mode="tip").par
    wider = brace_joints(hears, Vec3(0.0, 0.0, up * weight), (0.0,), 0.0).observer
    assert wider.joints == pytest.approx(
        np.clip(1.0 + 3.0 * (up - 0.15), 1.0, 2.0) * hears.observer.joints
    )
    assert dataclasses.replace(wider, joints=hears.observer.joints) == hears.observer


@pytest.mark.parametrize(("late", "share"), [(0.005, 2.35), (0.02, 1.0), (0.04, 1.0)])
def test_late_commands_leave_less_room_to_brace_joints(late, share):
    par = make_centroidal(Model(vehicle=with_limits(-np.inf, np.inf)), mode="tip").par
    weight = par.model.vehicle.mass * par.model.gravity
    assert brace_joints(
        par, Vec3(0.0, 0.0, 0.25 * weight), (0.0,), late
    ).tip.velocity == pytest.approx(share * par.tip.velocity)


@pytest.mark.parametrize(("periods", "braced"), [(0, True), (2, True), (4, False)])
def test_the_law_braces_joints_of_commands_that_act_within_20_ms(periods, braced):
    """A step under 3 N from below: the same command as of a law without braces, where
    they are 20 ms late.
    """
    model = Model(vehicle=with_limits(-np.inf, np.inf))
    law = make_centroidal(model, mode="tip", delay=0.005 * periods, age=0.0)
    observed = dataclasses.replace(law.memory.observed, force=Vec3(0.0, 0.0, 3.0))
    memory = dataclasses.replace(law.memory, started=1.0, observed=observed)
    reading = dataclasses.replace(blank_measurement(1, 4), joints=(0.2,))
    reference = Reference(joints=(0.1,), joint_rates=(0.0,), joint_accelerations=(0.0,))
    one, other = (
        law.law(
            memory,
            reading,
            reference,
            0.005,
            par=dataclasses.replace(law.par, braces=each),
        )[1]
        for each in (True, False)
    )
    assert (one != other) == braced


@pytest.mark.parametrize("angle", [0.1, 0.5, -1.2])
def test_a_bent_arm_is_braced_less_by_the_square_of_its_lever(angle):
    """60 mm long: at its damping times three half is left."""
    par = make_centroidal(Model(vehicle=with_limits(-np.inf, np.inf)), mode="tip").par
    weight, bend = (
        par.model.vehicle.mass * par.model.gravity,
        (3.0 * par.tip.damping) ** 2,
    )
    found = brace_joints(par, Vec3(0.0, 0.0, weight), (angle,), 0.0)
    straight = bend / (bend + (0.06 * np.sin(angle)) ** 2)
    assert found.tip.velocity == pytest.approx(
        (1.0 + 2.2 * straight) * par.tip.velocity
    )


def test_a_push_from_below_folds_the_arm_by_less_than_half_a_turn():
    """2 N at the tip of the paper's arm for 4 s: 126 mm without bracing."""
    hover = setting_of(PAPER).hover
    force = SignalVector(z=Windowed(Constant(2.0), 4.0, 8.0))
    pushed = dataclasses.replace(
        hover,
        forces=(Disturbance(force=force, frame=hover.plant.vehicle.end_effector),),
        noise=NOISE,
        delays=Delays(measurement=0.005),
        duration=9.0,
    )
    law = make_centroidal(hover.controller.par.model, mode="tip", delay=0.005)
    log = skyarm.run(dataclasses.replace(pushed, controller=law))
    assert log.status == "completed"
    assert np.abs(log.joints).max() < np.pi
    assert np.linalg.norm(log.tip - log.tip[799], axis=1)[800:1600].mean() < 0.09


def test_a_reference_beyond_a_limit_is_followed_up_to_it():
    vehicle = with_limits(-1.5, 0.5)
    scenario = skyarm.scenario_from(
        {
            "name": "beyond",
            "duration": 1.5,
            "plant": {"vehicle": "crazyflie_arm1"},
            "controller": {"law": "centroidal"},
            "endings": [{"kind": "joint_limits"}],
            "reference": {
                "base": {"kind": "hover", "position": [0.0, 0.0, 2.0]},
                "joints": [
                    {"kind": "ramp", "start": 0.2, "duration": 0.8, "height": 0.8}
                ],
            },
        }
    )
    law = make_centroidal(Model(vehicle=vehicle))
    world = dataclasses.replace(scenario.plant, vehicle=vehicle)
    log = skyarm.run(dataclasses.replace(scenario, plant=world, controller=law))
    assert log.status == "completed"
    assert log.joints[-1, 0] == pytest.approx(0.5, abs=2e-3)


def test_an_arm_that_slides_between_limits_has_more_damping_at_the_tip():
    """Where no option says so and no interaction presses with it."""
    octo, arm = (
        Model(vehicle=skyarm.load_vehicle(name))
        for name in ("octo_coaxial_two_arms", "hexarotor_arm6")
    )

    def tip(model, **options):
        found = make_centroidal(model, mode="tip", **options).par.tip
        return found.position, found.velocity

    usual = (700.0, 53.0)
    assert tip(octo)[1] == pytest.approx(1.6 * tip(arm)[1]) == pytest.approx(1.6 * 53.0)
    told = {"tip": usual}, {"interaction": (0.3, 0.1)}
    assert [tip(octo, **options) for options in told] == [usual, usual]
    vehicle = octo.vehicle
    free = [
        (
            dataclasses.replace(
                link, joint=dataclasses.replace(link.joint, lower=-np.inf, upper=np.inf)
            )
            if not link.joint.turns
            else link
        )
        for link in vehicle.links
    ]
    assert (
        tip(Model(vehicle=dataclasses.replace(vehicle, links=tuple(free))))[1]
        == usual[1]
    )


def test_an_arm_takes_back_no_more_of_the_bases_error_than_it_slides():
    octo, arm = (
        Model(vehicle=skyarm.load_vehicle(name))
        for name in ("octo_coaxial_two_arms", "hexarotor_arm6")
    )
    laws = [make_centroidal(model, mode="tip") for model in (octo, arm)]
    assert [law.par.tip.reach for law in laws] == [pytest.approx(0.07), 0.12]
    assert make_centroidal(octo, mode="tip", reach=0.1).par.tip.reach == 0.1


def test_a_finger_beside_the_tip_is_no_slide_of_the_arm():
    """On the last link of the paper's arm, of 20 mm; where it carries the tip it
    counts, down to the option's least.
    """
    arm = skyarm.load_vehicle("hummingbird_arm2")
    last = arm.links[-1]

    def gains(stroke, tip_link):
        joint = dataclasses.replace(
            last.joint, name="finger", kind="prismatic", lower=0.0, upper=stroke
        )
        finger = dataclasses.replace(last, name="finger", parent=1, joint=joint)
        frames = tuple(dataclasses.replace(each, link=tip_link) for each in arm.frames)
        held = dataclasses.replace(arm, links=(*arm.links, finger), frames=frames)
        tip = make_centroidal(Model(vehicle=held), mode="tip").par.tip
        return tip.reach, tip.velocity

    assert gains(0.02, 1) == (0.12, 53.0)
    assert gains(0.02, 2) == pytest.approx((0.01, 1.6 * 53.0))
    assert gains(1e-6, 2)[0] == 1e-3


def test_links_far_off_their_plan_outweigh_the_tip() -> None:
    vehicle = skyarm.load_scenario("case3").plant.vehicle
    directions = [Vec3(0.0, 1.0, 0.0)] * vehicle.n

    def weight(*angles: float) -> float:
        return float(
            plan_weight(
                vehicle, directions, [Vec3(0.3, angle, 0.2) for angle in angles]
            )
        )

    # errors about other axes are no joint's: a planar arm on a base that rolls keeps
    # its tip in place
    assert weight(0.0, 0.0) == 1.0
    assert weight(0.07, -0.07) == pytest.approx(1.0 + 2.0 / 3.0)
    assert weight(0.3, 0.1) == pytest.approx(weight(-0.1, -0.3))
    assert 2.99 < weight(2.0, 2.0) < 3.0
