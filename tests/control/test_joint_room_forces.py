"""What counts near a joint's limit beside its own motion: forces that may let go, and what the observer finds late."""

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.compare.envelope_axes import AXES
from skyarm.compare.envelope_setting import setting_of
from skyarm.control.blocks.disturbance_observer import Told, first_observed
from skyarm.control.laws.centroidal.joint_room import SHARE, WITH_STOP, as_sensed, ends_of, within_limits
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.model import JointGains, Model
from skyarm.dynamics import State
from skyarm.scalars.taylor import Taylor
from skyarm.scenario.law_by_name import controller_by_name

ARM1 = skyarm.load_vehicle("crazyflie_arm1")
ZERO = Vec3(0.0, 0.0, 0.0)
POLE = 30.0
GAINS = JointGains(stiffness=(POLE**2,), damping=(2.0 * POLE,))
LOWER, UPPER, INERTIA = -1.0, 1.5, 0.2


def limited(stops=False):
    (link,) = ARM1.links
    stiffness = {} if stops else {"stop_stiffness": 0, "stop_damping": 0}
    joint = dataclasses.replace(link.joint, lower=LOWER, upper=UPPER, **stiffness)
    return dataclasses.replace(ARM1, links=(dataclasses.replace(link, joint=joint),))


def state_of(q, rate):
    return State(
        position=ZERO,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=ZERO,
        rate=ZERO,
        joints=(q,),
        joint_rates=(rate,),
        rotor_speeds=(0.0,) * 4,
    )


def bounded(q, rate, wanted, effort, told=(0.0, 0.0, 0.0), vehicle=None):
    vehicle = vehicle or limited()
    reference = Taylor.of_derivatives(told)
    state, ends = state_of(q, rate), ends_of(vehicle)
    return within_limits(vehicle, ends, GAINS, state, (reference,), (wanted,), (effort,), (INERTIA,))[0]


def rest(push, effort, told=0.0, stops=False):
    """Where a joint comes to rest that is asked for ever more, from its bound at rest at zero."""
    return bounded(0.0, 0.0, push, effort, (told, 0.0, 0.0), limited(stops)) / POLE**2


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_force_that_lets_go_leaves_the_joint_within_its_limit(share):
    """The drive that goes on pushing against it moves the joint, held by its loop, up to the limit and no further."""
    effort = -share * LOWER * INERTIA * POLE**2
    q, rate, dt = rest(-1e6, effort), 0.0, 1e-3
    for _ in range(1000):
        rate += (bounded(q, rate, -1e6, effort) - effort / INERTIA) * dt
        q += rate * dt
        assert q > LOWER - 1e-6
    assert q == pytest.approx(LOWER if share > SHARE else -SHARE - share, abs=1e-6)


def test_only_a_force_that_pushes_off_the_limit_takes_of_the_way_and_none_beyond_the_reference():
    unit = INERTIA * POLE**2
    for effort in (0.0, -0.4 * unit, -5.0 * unit):
        assert rest(-1e6, effort) == pytest.approx(SHARE * LOWER)
        assert rest(1e6, -effort) == pytest.approx(SHARE * UPPER)
    assert rest(-1e6, 0.7 * unit) == pytest.approx(LOWER + 0.7)
    assert rest(1e6, -0.9 * unit) == pytest.approx(UPPER - 0.9)
    assert rest(-1e6, 5.0 * unit) == pytest.approx(0.0)
    assert rest(1e6, -5.0 * unit, told=0.2) == pytest.approx(0.2)
    assert rest(-1e6, 5.0 * unit, told=-1.3) == pytest.approx(LOWER)
    for effort in (5.0 * unit, -5.0 * unit):
        assert rest(-1e6, effort, stops=True) == pytest.approx(WITH_STOP * LOWER)
        assert rest(1e6, effort, stops=True) == pytest.approx(WITH_STOP * UPPER)


@pytest.mark.parametrize("effort", [1e6, -1e6])
def test_under_any_force_a_reference_that_moves_is_followed_as_it_is(effort):
    told = (0.3, 2.0, 7.0)
    assert bounded(0.3, 2.0, 7.0, effort, told) == pytest.approx(7.0)
    off = np.sign(effort) * 50.0
    assert bounded(0.3, 2.0, 7.0 - off, effort, told) == pytest.approx(7.0)
    assert bounded(0.3, 2.0, 7.0 + off, effort, told) == 7.0 + off


def observed_under(acceleration, bandwidth, dt, periods):
    """Measured rate, the observer's, and its last correction, after a constant acceleration that it must not learn."""
    b = np.exp(-bandwidth * dt)
    true = found = off = 0.0
    for _ in range(periods):
        true += acceleration * dt
        off = true - found
        found += (1.0 - b**2) * off
    return true, found, (1.0 - b) ** 2 * off / dt


def sensed(bandwidth, measured, found, correction, started=1.0, periods=1, dt=0.005, now=(0.31, 0.7)):
    observed = dataclasses.replace(
        first_observed(1, (0.0,) * 4), joints=(found[0],), joint_rates=(found[1],), efforts=(0.0,)
    )
    told = Told(angular=ZERO, joints=(0.0,), angular_correction=ZERO, joint_corrections=(correction,))
    measurement = dataclasses.replace(
        make_centroidal(Model(vehicle=ARM1)).memory.observed, joints=(measured[0],), joint_rates=(measured[1],)
    )
    return as_sensed(bandwidth, state_of(*now), observed, told, measurement, started, periods, dt)


@pytest.mark.parametrize(("bandwidth", "dt", "periods"), [(34.0, 0.005, 1), (60.0, 0.002, 4), (120.0, 0.01, 0)])
def test_an_acceleration_that_the_observer_has_not_found_goes_on_amid_the_period_of_the_command(bandwidth, dt, periods):
    rate, found, correction = observed_under(-7.0, bandwidth, dt, 400)
    state = sensed(bandwidth, (0.4, rate), (0.37, found), correction, 1.0, periods, dt, now=(0.31, found))
    assert state.joint_rates[0] == pytest.approx(rate - 7.0 * (periods + 0.5) * dt)
    assert state.joints[0] == pytest.approx(0.34)


def test_what_the_observer_knows_is_sensed_as_it_stands_and_the_first_measurement_tells_of_no_force():
    assert sensed(34.0, (0.4, 0.2), (0.4, 0.2), 0.0) == state_of(0.31, 0.7)
    first = sensed(34.0, (0.4, 0.2), (0.4, 0.2), 1e3, started=0.0)
    assert first == state_of(0.31, 0.7)
    asleep = sensed(0.0, (0.4, 0.3), (0.4, 0.2), 0.0)
    assert asleep.joint_rates[0] == pytest.approx(0.8)


def test_a_batch_equals_a_loop():
    rng = np.random.default_rng(3)
    q, rate, wanted, effort, more = rng.normal(size=(5, 40)) * np.array([[0.7], [5.0], [500.0], [300.0], [9.0]])
    batch = bounded(q, rate, wanted, effort)
    assert batch == pytest.approx(
        [float(bounded(*each)) for each in zip(q, rate, wanted, effort, strict=True)], abs=1e-9
    )
    assert not np.array_equal(batch, bounded(q, rate, wanted, 0.0 * effort))
    told = sensed(34.0, (q, rate), (0.0, 0.1), more).joint_rates[0]
    loop = [float(sensed(34.0, (a, b), (0.0, 0.1), c).joint_rates[0]) for a, b, c in zip(q, rate, more, strict=True)]
    assert told == pytest.approx(loop)


def test_inertias_are_those_of_the_joints_on_a_base_that_stands():
    vehicle = skyarm.load_vehicle("octo_coaxial_two_arms")
    par = make_centroidal(Model(vehicle=vehicle), mode="tip", preset="adaptive").par
    arm = 0.15 * 0.1**2 + 5e-4 + 0.1 * 0.18**2 + 2e-4 + 0.04 * 0.28**2  # about the shoulder, slide at zero
    assert par.inertias[1:] == pytest.approx((arm, 0.14, arm, 0.14))
    assert make_centroidal(Model(vehicle=vehicle), mode="tip", preset="robust").par.inertias == ()


@pytest.mark.parametrize(
    ("name", "value", "until"), [("push_y", 12.4, 5.0), ("push_z", 3.5, 5.5), ("payload", 0.5, 1.0)]
)
def test_a_slide_of_two_arms_keeps_off_its_end(name, value, until):
    """A push that ends, one that begins, and a tip four and a half times as heavy as believed."""
    axis, setting = AXES[name], setting_of("octo_coaxial_two_arms", until)
    scenario = axis.scenario(setting, value)
    log = skyarm.run(dataclasses.replace(scenario, controller=controller_by_name(scenario, "centroidal_tip")))
    assert log.status == "completed"
    assert log.joints[:, 2].min() > -0.02
