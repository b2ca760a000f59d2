"""The reference governor against its four rules written out in NumPy, axis by axis, and
joint references by hand.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.control.catalogue import make_controller
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.control.safety.bounds import govern_base, govern_joints
from skyarm.control.safety.limits import limits_for
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement
from support.laws import ARM2, cases, controller, vec

STIFFNESS, DAMPING, GRAVITY = 6.0, 3.5, 9.3
LIMITS = limits_for(
    controller("hybrid_computed_torque"),
    tilt=0.5,
    climb=3.0,
    speed=2.5,
    step=0.2,
    step_speed=0.6,
    stiffness=STIFFNESS,
    damping=DAMPING,
)
DT = 0.005


def governed(case, **changes):
    reference = dataclasses.replace(
        case.reference(),
        jerk=vec([1.0, 2.0, 3.0]),
        snap=vec([4.0, 5.0, 6.0]),
        **changes,
    )
    found = govern_base(
        reference,
        case.measurement(),
        limits=LIMITS,
        stiffness=STIFFNESS,
        damping=DAMPING,
        gravity=GRAVITY,
    )
    return reference, found


def array(v):
    return np.array(list(v), dtype=float)


def shortened(v, longest):
    return v * min(1.0, longest / max(np.linalg.norm(v), 1e-300))


def expected(case):
    """Position, velocity, acceleration by the rules; errors of the level and of the
    vertical shrink apart.
    """
    wanted = shortened(case.v_d, LIMITS.speed)
    pull = shortened(case.p_d - case.p, LIMITS.speed * DAMPING / STIFFNESS)
    brake = wanted - case.v
    asked = STIFFNESS * pull + DAMPING * brake + case.a_d
    climb = min(1.0, LIMITS.climb / abs(asked[2]))
    level = (
        math.tan(LIMITS.tilt)
        * (GRAVITY + climb * asked[2])
        / np.hypot(asked[0], asked[1])
    )
    least = min(
        LIMITS.step / np.linalg.norm(pull),
        LIMITS.step_speed / np.linalg.norm(brake),
        1.0,
    )
    share = np.array([max(min(1.0, level), least)] * 2 + [max(climb, least)])
    return case.p + share * pull, case.v + share * brake, share * case.a_d, share


def drawn(seed):
    """Errors of all sizes, some within every limit."""
    rng = np.random.default_rng(seed)
    case, size = cases(1, seed=seed)[0], 10.0 ** rng.uniform(-2.0, 1.0)
    return dataclasses.replace(
        case,
        p_d=case.p + size * rng.normal(size=3) * rng.choice([0.05, 1.0], 3),
        v_d=case.v + size * rng.normal(size=3) * rng.choice([0.05, 1.0], 3),
        v=0.3 * case.v,
        a_d=size * rng.normal(size=3),
    )


@pytest.mark.parametrize("seed", range(60))
def test_the_governed_reference_follows_the_four_rules(seed):
    case = drawn(seed)
    reference, found = governed(case)
    p, v, a, share = expected(case)
    # 1e-9 m, m/s and m/s^2 are added to the lengths that divide
    np.testing.assert_allclose(array(found.position), p, atol=3e-7)
    np.testing.assert_allclose(array(found.velocity), v, atol=3e-7)
    np.testing.assert_allclose(array(found.acceleration), a, atol=3e-7)
    for i, name in enumerate("xyz"):
        if share[i] < 1.0 - 1e-6:
            # what moves with the measurement has no higher derivatives
            assert getattr(found.jerk, name) == getattr(found.snap, name) == 0.0
    assert (found.yaw, found.joints) == (reference.yaw, reference.joints)


@pytest.mark.parametrize("seed", range(20))
def test_a_planned_centre_of_mass_and_a_preview_move_with_the_governed_base(seed):
    rng = np.random.default_rng(seed)
    center, ahead = rng.normal(size=(5, 3)), rng.normal(size=(2, 6, 3))
    reference, found = governed(
        drawn(seed), center=tuple(center.ravel()), ahead=tuple(ahead.ravel())
    )
    names = ("position", "velocity", "acceleration", "jerk", "snap")
    moved = np.array(
        [
            array(getattr(found, name)) - array(getattr(reference, name))
            for name in names
        ]
    )
    np.testing.assert_allclose(
        np.reshape(found.center, (5, 3)), center + moved, atol=1e-12
    )
    later = np.reshape(found.ahead, (2, 6, 3))
    # x, y, z of each sample, with two derivatives; heading and joints stay
    np.testing.assert_allclose(later[:, :3], ahead[:, :3] + moved[:3].T, atol=1e-12)
    np.testing.assert_array_equal(later[:, 3:], ahead[:, 3:])


def test_a_law_on_a_plan_climbs_no_harder_than_the_limit():
    """A plan 30 m above: the rotors of a level vehicle push at most its mass times
    gravity and the limit.
    """
    bird = skyarm.load_vehicle("hummingbird")
    law = make_controller("centroidal", Model(vehicle=bird))
    guarded = with_safety_layer(law, {"climb": 1.0, "step": 1e-6, "step_speed": 1e-6})
    hover = math.sqrt(
        float(bird.mass) * 9.81 / sum(float(r.thrust_coefficient) for r in bird.rotors)
    )
    seen = dataclasses.replace(
        blank_measurement(0, 4),
        specific_force=vec([0.0, 0.0, 9.81]),
        rotor_speeds=(hover,) * 4,
    )
    plan = Reference(
        position=vec([0.0, 0.0, 30.0]), center=(0.0, 0.0, 30.0, *(0.0,) * 12)
    ).dense()
    _, command = guarded.law(guarded.memory, seen, plan, 0.005, par=guarded.par)
    pushes = [
        float(r.thrust_coefficient) * w * w
        for r, w in zip(bird.rotors, command.rotor_speeds, strict=True)
    ]
    assert 9.81 < sum(pushes) / float(bird.mass) < 9.81 + 1.0 + 1e-3


def test_the_cases_meet_every_rule():
    shares = np.array([expected(drawn(seed))[3] for seed in range(60)])
    free = (shares == 1.0).all(axis=1)
    assert 5 < free.sum() < 55
    assert (shares[:, 0] < 1.0).sum() > 10
    assert ((shares[:, 2] < 1.0) & (shares[:, 2] != shares[:, 0])).sum() > 10
    assert ((shares[:, 0] < 1.0) & (shares[:, 2] == 1.0)).sum() > 3


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_axis_alone_is_shortened_as_every_other(axis, sign):
    """An error along one axis counts in full: a length that took another component
    twice would not see it.
    """
    still, e = np.zeros(3), sign * np.eye(3)[axis]
    base = dataclasses.replace(
        cases(1, seed=0)[0], p=still, v=still, a_d=still, p_d=still, v_d=still
    )
    _, fast = governed(dataclasses.replace(base, v_d=50.0 * e))
    # the speed asked for is 2.5 m/s before the acceleration that it asks for is bounded
    most = 3.0 if axis == 2 else math.tan(0.5) * GRAVITY
    np.testing.assert_allclose(
        array(fast.velocity), min(2.5, most / DAMPING) * e, atol=1e-7
    )
    _, far = governed(dataclasses.replace(base, p_d=50.0 * e))
    pull = min(2.5 * DAMPING / STIFFNESS, most / STIFFNESS)
    np.testing.assert_allclose(array(far.position), pull * e, atol=1e-7)
    # steps within 0.2 m and 0.6 m/s pass, whatever they ask for, and are the same bits
    near = dataclasses.replace(base, p_d=0.19 * e, v_d=0.59 * e)
    reference, found = governed(near)
    assert found == reference


@pytest.mark.parametrize("axis", range(3))
def test_a_reference_that_is_shortened_but_asks_for_little_is_taken_for_bounded(axis):
    """Far away and braking as much: nothing is asked that a limit cuts, but the
    position moved, so that it is new.
    """
    e, still = np.eye(3)[axis], np.zeros(3)
    pull = 2.5 * DAMPING / STIFFNESS
    case = dataclasses.replace(
        cases(1, seed=0)[0],
        p=still,
        p_d=9.0 * e,
        v=STIFFNESS / DAMPING * pull * e,
        v_d=still,
        a_d=still,
    )
    _, found = governed(case)
    np.testing.assert_allclose(array(found.position), pull * e, atol=1e-6)
    assert array(found.jerk).tolist() == array(found.snap).tolist() == [0.0, 0.0, 0.0]


LOWER, UPPER, MARGIN, MOST = (-0.5, -0.7), (0.8, 0.9), (0.04, 0.05), (6.0, 7.0)


def arm():
    links = tuple(
        dataclasses.replace(
            link, joint=dataclasses.replace(link.joint, lower=low, upper=high)
        )
        for link, low, high in zip(ARM2.links, LOWER, UPPER, strict=True)
    )
    model = Model(vehicle=dataclasses.replace(ARM2, links=links), gravity=9.81)
    law = controller("hybrid_computed_torque", model)
    return model, limits_for(
        law, joint_margin=MARGIN, joint_speed=MOST, stiffness=5.0, damping=2.7
    )


def governed_arm(
    joints, rates, before, ramping=(0.0, 0.0), speeds=(2.0, 3.0), steps=(0.1, 0.2)
):
    model, limits = arm()
    reference = dataclasses.replace(
        cases(1, seed=0)[0].reference(),
        joints=joints,
        joint_rates=rates,
        joint_accelerations=(11.0, 12.0),
        joint_jerks=(13.0, 14.0),
        joint_snaps=(15.0, 16.0),
    )
    return govern_joints(
        reference, before, ramping, speeds, steps, DT, model=model, limits=limits
    )


def other(values, i, fill):
    """A row with one entry at ``i`` and the fill elsewhere."""
    return tuple(values if k == i else fill for k in range(2))


@pytest.mark.parametrize("i", [0, 1])
@pytest.mark.parametrize(
    ("rate", "kept"), [(0.5, 0.5), (-0.5, -0.5), (50.0, 1.0), (-50.0, -1.0)]
)
def test_the_rate_of_a_joint_reference_is_at_most_the_joints_own(i, rate, kept):
    """1 stands for the largest rate of that joint; the position passes."""
    found, ramping = governed_arm((0.1, 0.2), other(rate, i, 0.25), (0.1, 0.2))
    assert found.joints == (0.1, 0.2)
    assert found.joint_rates == other(
        kept if abs(kept) < 1.0 else kept * MOST[i], i, 0.25
    )
    assert ramping == (0.0, 0.0)
    assert found.joint_accelerations == (11.0, 12.0)
    assert (found.joint_jerks, found.joint_snaps) == ((13.0, 14.0), (15.0, 16.0))


@pytest.mark.parametrize("i", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_long_step_of_a_joint_reference_is_slewed_and_what_is_left_of_it_too(i, sign):
    step, speed = (0.1, 0.2)[i], (2.0, 3.0)[i]
    wanted = other(sign * (step + 0.05), i, 0.0)
    found, ramping = governed_arm(wanted, (9.0, 9.0), (0.0, 0.0))
    np.testing.assert_allclose(
        found.joints, other(sign * speed * DT, i, 0.0), rtol=1e-12
    )
    # on the way at its slew, beside it at the other's bounded rate
    assert found.joint_rates == other(sign * speed, i, MOST[1 - i])
    assert ramping == other(1.0, i, 0.0)
    assert found.joint_accelerations == other(0.0, i, (11.0, 12.0)[1 - i])
    assert found.joint_jerks == other(0.0, i, (13.0, 14.0)[1 - i])
    assert found.joint_snaps == other(0.0, i, (15.0, 16.0)[1 - i])
    # the rest, less than a step that passes at once: slewed by one that is on its way,
    # closed by one that is not
    rest = other(sign * 0.9 * step, i, 0.0)
    slewed, going = governed_arm(rest, (9.0, 9.0), (0.0, 0.0), ramping=ramping)
    np.testing.assert_allclose(
        slewed.joints, other(sign * speed * DT, i, 0.0), rtol=1e-12
    )
    assert going == other(1.0, i, 0.0)
    at_once, done = governed_arm(rest, (9.0, 9.0), (0.0, 0.0))
    assert at_once.joints == rest
    assert done == (0.0, 0.0)
    # arrived: no longer on its way
    last, done = governed_arm(
        other(sign * 0.9 * speed * DT, i, 0.0), (0.0, 0.0), (0.0, 0.0), ramping=ramping
    )
    assert last.joints == other(sign * 0.9 * speed * DT, i, 0.0)
    assert done == (0.0, 0.0)


@pytest.mark.parametrize("i", [0, 1])
def test_a_joint_reference_stops_at_twice_the_margin_from_its_limits(i):
    for beyond, end in (
        (5.0, UPPER[i] - 2.0 * MARGIN[i]),
        (-5.0, LOWER[i] + 2.0 * MARGIN[i]),
    ):
        found, ramping = governed_arm(
            other(beyond, i, 0.0), (0.3, 0.3), other(end, i, 0.0)
        )
        np.testing.assert_allclose(found.joints, other(end, i, 0.0), rtol=1e-12)
        assert found.joint_rates == other(0.0, i, 0.3)
        assert found.joint_accelerations == other(0.0, i, (11.0, 12.0)[1 - i])
        assert ramping == (0.0, 0.0)


def test_a_reference_without_higher_derivatives_passes_without():
    model, limits = arm()
    reference = dataclasses.replace(
        cases(1, seed=0)[0].reference(), joints=(0.1, 0.2), joint_rates=(0.0, 0.0)
    )
    found, _ = govern_joints(
        reference,
        (0.1, 0.2),
        (0.0, 0.0),
        (2.0, 3.0),
        (0.1, 0.2),
        DT,
        model=model,
        limits=limits,
    )
    assert (found.joint_jerks, found.joint_snaps) == (
        reference.joint_jerks,
        reference.joint_snaps,
    )
