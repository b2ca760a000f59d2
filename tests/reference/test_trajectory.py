"""Trajectories, their samples, and publishing at a rate."""

import dataclasses
import math
from functools import reduce

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.compile import trace
from skyarm.records.leaves import leaves
from skyarm.reference import (
    Constant,
    Publisher,
    Ramp,
    Reference,
    Shifted,
    Sine,
    Trajectory,
    Windowed,
    circle,
    hover,
)
from skyarm.reference.task_records import Guard, Phase


def case3_joint(amplitude, phase):
    return Windowed(
        Shifted(Sine(amplitude=amplitude, frequency_hz=0.08, phase=phase), 6.0),
        6.0,
        21.0,
    )


CASE3 = circle(
    radius=0.3,
    frequency_hz=0.08,
    center=(0.0, 0.0, 1.0),
    start=6.0,
    stop=21.0,
    joints=(case3_joint(0.2, 0.0), case3_joint(0.15, math.pi / 2)),
)


def test_hover_stays():
    reference = hover((1.0, 2.0, 3.0), yaw=0.4, joints=(0.1, -0.2)).at(5.0)
    assert list(reference.position) == [1.0, 2.0, 3.0]
    assert reference.yaw == 0.4
    assert reference.joints == (0.1, -0.2)
    for name in ("velocity", "acceleration", "jerk", "snap"):
        assert list(getattr(reference, name)) == [0, 0, 0]
    assert (reference.yaw_rate, reference.yaw_acceleration) == (0, 0)
    for name in ("joint_rates", "joint_accelerations", "joint_jerks", "joint_snaps"):
        assert getattr(reference, name) == (0, 0)


def test_case_3_starts_with_a_step_and_turns_left():
    w = 2.0 * math.pi * 0.08
    assert list(CASE3.at(5.99).position) == [0.0, 0.0, 1.0]
    first = CASE3.at(6.0)
    assert list(first.position) == pytest.approx([0.3, 0.0, 1.0], abs=1e-16)
    assert list(first.velocity) == pytest.approx([0.0, 0.3 * w, 0.0], abs=1e-16)
    assert list(first.acceleration) == pytest.approx(
        [-0.3 * w * w, 0.0, 0.0], abs=1e-16
    )
    assert first.joints == pytest.approx((0.0, 0.15), abs=1e-16)
    for t in (7.0, 11.3, 20.99):
        sample, angle = CASE3.at(t), w * (t - 6.0)
        # 1e-15: rounding of an angle of a few rad
        assert list(sample.position) == pytest.approx(
            [0.3 * math.cos(angle), 0.3 * math.sin(angle), 1.0], abs=1e-15
        )
        assert sample.joints == pytest.approx(
            (0.2 * math.sin(angle), 0.15 * math.cos(angle)), abs=1e-15
        )
    assert list(CASE3.at(21.0).position) == [0.0, 0.0, 1.0]
    assert list(CASE3.at(21.0).velocity) == [0.0, 0.0, 0]
    assert CASE3.switch_times() == (6.0, 21.0)


def test_on_a_circle_each_derivative_is_a_quarter_turn_ahead():
    w = 2.0 * math.pi * 0.08
    s = CASE3.at(9.0)
    out = s.position - Vec3(0.0, 0.0, 1.0)
    assert out.dot(out) == pytest.approx(0.09)
    assert s.velocity.dot(out) == pytest.approx(0.0, abs=1e-16)
    assert out.cross(s.velocity).z == pytest.approx(0.09 * w)  # counter-clockwise
    for high, low in (
        (s.acceleration, out),
        (s.jerk, s.velocity),
        (s.snap, s.acceleration),
    ):
        assert list(high) == pytest.approx(list(low * (-w * w)), rel=1e-12, abs=1e-16)


def test_samples_carry_every_signal_to_its_own_field():
    ramps = [
        Sine(amplitude=float(k + 1), frequency_hz=0.1 * (k + 1), phase=0.2 * k)
        for k in range(6)
    ]
    x, y, z, yaw, *joints = ramps
    sample = Trajectory(x=x, y=y, z=z, yaw=yaw, joints=tuple(joints)).at(0.7)
    names = ("position", "velocity", "acceleration", "jerk", "snap")
    rates = (
        "joints",
        "joint_rates",
        "joint_accelerations",
        "joint_jerks",
        "joint_snaps",
    )
    for order, (name, rate) in enumerate(zip(names, rates, strict=True)):
        assert tuple(getattr(sample, name)) == tuple(
            k.derivatives(0.7)[order] for k in (x, y, z)
        )
        assert getattr(sample, rate) == tuple(k.derivatives(0.7)[order] for k in joints)
    assert (sample.yaw, sample.yaw_rate, sample.yaw_acceleration) == yaw.derivatives(
        0.7
    )[:3]


def test_a_load_is_told_by_the_value_of_its_signal():
    grip = Ramp(start=0.5, duration=1.0, height=1.0, shape="linear")
    held = dataclasses.replace(Trajectory(), load=grip)
    assert [tuple(held.at(t).load) for t in (0.0, 1.25, 3.0)] == [
        (0.0,),
        (0.75,),
        (1.0,),
    ]


def test_a_circle_without_start_turns_for_ever():
    always = circle(radius=2.0, frequency_hz=-0.25, center=(1.0, 1.0, 1.0))
    assert always.switch_times() == ()
    # a quarter turn clockwise
    assert list(always.at(1.0).position) == pytest.approx([1.0, -1.0, 1.0])


def test_trajectories_add_and_shift():
    arm = Trajectory(joints=(Ramp(start=1.0, duration=1.0, height=0.5), Constant(0.1)))
    both = (
        hover((0.0, 0.0, 1.0), yaw=0.2)
        + circle(radius=1.0, frequency_hz=0.5, center=(2.0, 0.0, 0.0))
        + arm
        + arm
    )
    sample = both.at(1.5)
    assert list(sample.position) == pytest.approx([2.0, -1.0, 1.0])
    assert sample.joints == pytest.approx((0.5, 0.2))
    assert sample.yaw == pytest.approx(0.2)
    later = both.shifted(3.0)
    assert later.at(4.5) == sample
    assert later.switch_times() == (4.0, 5.0)
    with pytest.raises(ValueError, match="2 and 1 joints"):
        arm + Trajectory(joints=(Constant(0.0),))
    assert hover((0.0, 0.0, 1.0)).with_joints(0.3, arm.joints[0]).at(
        1.5
    ).joints == pytest.approx((0.3, 0.25))


def test_guards_are_shifted_and_added_with_the_motion():
    late, early = (
        dataclasses.replace(hover((0, 0, 1)), guards=(Guard(at=at, error=0.01),))
        for at in (3.0, 1.0)
    )
    assert [guard.at for guard in late.shifted(0.5).guards] == [3.5]
    assert [guard.at for guard in (late + early.shifted(1.0)).guards] == [2.0, 3.0]
    assert (late + hover((0, 0, 0))).guards == late.guards
    phases = (
        Phase(name="go_to", end=3.0),
        Phase(name="retreat", end=4.0, back=(3.0, 3.5)),
    )
    task = dataclasses.replace(late, phases=phases).shifted(0.5)
    assert [(phase.name, phase.end, phase.back) for phase in task.phases] == [
        ("go_to", 3.5, None),
        ("retreat", 4.5, (3.5, 4.0)),
    ]
    assert task.returns == ((3.5, 4.0),)
    assert (task + hover((0, 0, 0))).phases == task.phases


def test_a_dense_sample_fits_one_program_for_every_reference():
    fixed, moving = hover((0.0, 0.0, 1.0), joints=(0.0, 0.0)).at(0.0), CASE3.at(7.0)
    assert len(leaves(fixed)) < len(leaves(fixed.dense()))
    assert len(leaves(fixed.dense())) == len(leaves(moving.dense())) == 15 + 3 + 10
    program = trace(lambda r: r.velocity + r.jerk, fixed.dense())
    assert list(program(moving.dense())) == list(moving.velocity + moving.jerk)


def test_a_trajectory_compiles_to_a_program_of_time():
    program = trace(CASE3.at, 0.0)
    for t in (5.0, 6.0, 13.7, 21.0):
        assert program(t) == CASE3.at(t)  # bit for bit


def test_ticks_hold_the_sample_of_the_last_multiple_of_the_ratio():
    publisher = Publisher(control_rate=200, reference_rate=50)
    assert publisher.ratio == 4
    assert [publisher.held_tick(k) for k in range(10)] == [0, 0, 0, 0, 4, 4, 4, 4, 8, 8]
    assert publisher.held_time(1203) == 6.0
    assert publisher.held_time(1199) == 5.98
    assert Publisher(control_rate=200, reference_rate=200).held_tick(7) == 7


def test_held_times_meet_the_switch_times_exactly():
    publisher = Publisher(control_rate=1000, reference_rate=1000)
    assert all(
        publisher.held_time(k) == float(f"{k // 1000}.{k % 1000:03d}")
        for k in range(0, 30_000, 7)
    )


@pytest.mark.parametrize(
    ("control", "reference"),
    [
        (200, 60),
        (50, 200),
        (0, 50),
        (200, 0),
        (math.nan, 50),
        (200, math.inf),
        (200, -50),
    ],
)
def test_rates_that_do_not_divide_are_refused(control, reference):
    with pytest.raises(ValueError, match=r"_rate = .*must"):
        Publisher(control_rate=control, reference_rate=reference)


def test_ticks_of_an_array_hold_what_each_tick_holds():
    publisher = Publisher(control_rate=1000, reference_rate=250)
    ticks = np.arange(30_000)
    wanted = [publisher.held_time(k) for k in range(30_000)]
    # bit for bit: one division each
    assert publisher.held_time(ticks).tolist() == wanted


def test_a_sample_names_every_field_of_the_control_laws():
    assert [field.name for field in dataclasses.fields(Reference)] == [
        *(
            "position",
            "velocity",
            "acceleration",
            "jerk",
            "snap",
            "yaw",
            "yaw_rate",
            "yaw_acceleration",
        ),
        *(
            "joints",
            "joint_rates",
            "joint_accelerations",
            "joint_jerks",
            "joint_snaps",
            "tip",
        ),
        *("push", "load", "center", "turning", "ahead", "carry"),
    ]


def test_every_name_of_a_circle_leads_to_numbers_of_its_signals():
    names = CASE3.path_names()["base"]
    found = {
        word: [
            reduce(
                lambda at, part: at[int(part)] if part.isdigit() else getattr(at, part),
                place,
                CASE3,
            )
            for place in names[word]
        ]
        for word in ("radius", "frequency_hz", "start", "stop")
    }
    # of x and y; a beginning twice, as the window's and as the sine's delay
    assert found == {
        "radius": [0.3] * 2,
        "frequency_hz": [0.08] * 2,
        "start": [6.0] * 4,
        "stop": [21.0] * 2,
    }
    centre = [names["center"][axis] for axis in "xyz"]
    assert [[place[0] for place in places] for places in centre] == [
        ["x"],
        ["y"],
        ["z"],
    ]
