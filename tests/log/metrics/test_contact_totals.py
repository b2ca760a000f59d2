"""Metrics of contact against numbers that were made by hand, and in flight against
those over the log.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.log.metrics.accumulate import advance_totals, first_totals
from skyarm.log.metrics.metric import MetricGoal, MetricInstant
from skyarm.log.metrics.metric_catalogue import GROUPS, required_totals, values
from skyarm.log.metrics.score import score
from skyarm.simulate.batch import Batch

NAMES = GROUPS["contact"]
PERIOD = 0.1
ZERO = Vec3(0.0, 0.0, 0.0)
STATE = State(
    position=ZERO,
    quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
    velocity=ZERO,
    rate=ZERO,
    joints=(),
    joint_rates=(),
    rotor_speeds=(0.0,),
)
GOAL = MetricGoal(position=ZERO, joints=(), tool=ZERO)


def instant(k, force, wanted=1.0, tool=ZERO, parts={}, **more):  # noqa: B006
    """The k-th control instant of a flight with a push along -x, forces (N) at two
    pairs.
    """
    return MetricInstant(
        state=STATE,
        tool=tool,
        command=Command(rotor_speeds=(0.0,), efforts=()),
        before=(0.0,),
        held=GOAL,
        continuous=GOAL,
        time=PERIOD * k,
        push=(wanted, 0.1, -1.0, 0.0, 0.0),
        parts=(("contact_force", (0.75 * force, 0.25 * force)), *parts.items()),
        **more,
    )


def metrics_of(instants):
    wanted = required_totals(NAMES, 0)
    totals = first_totals(wanted)
    for now in instants:
        totals = advance_totals(totals, wanted, now, {"whole": True})
    held = dict(zip(wanted, [_arrays(total) for total in totals], strict=True))
    found = values(NAMES, held, {"whole": np.array([len(instants)])}, 0, PERIOD)
    return {name: float(value[0]) for name, value in found.items()}


def _arrays(memory):
    if isinstance(memory, float):
        return np.array([memory])
    return type(memory)(
        **{
            name: np.array([float(getattr(memory, name))])
            for name in type(memory).__slots__
        }
    )


@pytest.fixture(scope="module")
def pushed():
    """Touches at 0.5 s, bounces at 0.7, is lost at 1.5 and 1.6, and holds 1.2 or 1.5 of
    1 N from 2.5 s to 4.5 s.
    """
    forces = (
        [0.0] * 5
        + [4.0, 2.0, 0.0, 1.0]
        + [1.0] * 6
        + [0.0, 0.0]
        + [1.0] * 8
        + [1.2] * 15
        + [1.5] * 5
    )
    found = [
        instant(k, force, tool=Vec3(0.5, 0.003, 0.004 if k < 30 else 0.0))
        for k, force in enumerate(forces)
    ]
    return metrics_of(
        [
            *found,
            instant(len(forces), 3.0, wanted=0.0),
            instant(len(forces) + 1, 0.0, wanted=0.0),
        ]
    )


def test_force_is_held_against_the_wanted_one_from_two_seconds_after_the_touch(pushed):
    error = np.array([0.2] * 15 + [0.5] * 5)
    assert pushed["contact_first"] == pytest.approx(0.5)
    assert pushed["contact_error_mean"] == pytest.approx(error.mean())
    assert pushed["contact_ripple"] == pytest.approx(error.std())
    assert pushed["contact_held"] == pytest.approx(15 / 20), (
        "0.5 N is more than 30 % of 1 N"
    )


def test_a_loss_counts_once_and_not_within_the_impact(pushed):
    assert pushed["contact_losses"] == 1.0


def test_a_peak_counts_while_contact_is_asked_for_and_the_largest_always(pushed):
    assert pushed["contact_peak"] == 4.0
    assert (
        metrics_of([instant(0, 1.0), instant(1, 9.0, wanted=0.0)])["contact_peak"]
        == 1.0
    )
    assert (
        metrics_of([instant(0, 1.0), instant(1, 9.0, wanted=0.0)])["contact_largest"]
        == 9.0
    )
    assert pushed["contact_last"] == 0.0


def test_the_tip_s_error_is_that_across_the_normal_once_it_touches(pushed):
    """0.5 m along the normal do not count; (3, 4) mm until 3 s and 3 mm after it do."""
    assert pushed["contact_tip_max"] == pytest.approx(0.005)
    assert pushed["contact_tip_mean"] == pytest.approx((25 * 0.005 + 15 * 0.003) / 40)


def test_across_is_across_any_normal():
    # perpendicular, 0.75 long
    normal, across = np.array([0.48, -0.6, 0.64]), np.array([0.6, 0.0, -0.45])
    tool = Vec3(*(0.5 * normal + 0.004 * across).tolist())
    push = (1.0, 0.1, *normal.tolist())
    flown = [
        dataclasses.replace(instant(k, 0.0 if k < 5 else 1.0, tool=tool), push=push)
        for k in range(40)
    ]
    found = metrics_of(flown)
    assert (found["contact_tip_mean"], found["contact_tip_max"]) == pytest.approx(
        (0.003, 0.003)
    )


def test_what_was_moved_is_told_where_the_flight_leaves_it():
    found = metrics_of(
        [
            instant(
                k,
                0.0,
                wanted=0.0,
                tool=Vec3(0.0, 0.0, z),
                phase=phase,
                parts={
                    "object_position": (float(k), 5.0, 3.0, 9.0, 9.0, 9.0),
                    "mechanism_position": (turned, 7.0),
                },
            )
            for k, (z, turned, phase) in enumerate(
                [(0.3, 0.1, 0.0), (0.2, 0.5, 1.0), (0.4, 0.2, 1.0)]
            )
        ]
    )
    assert [found[f"object_last_{axis}"] for axis in "xyz"] == [2.0, 5.0, 3.0]
    assert (
        found["mechanism_last"],
        found["mechanism_furthest"],
        found["tip_lowest"],
    ) == (0.2, 0.5, 0.2)
    assert found["phases_time"] == pytest.approx(PERIOD), (
        "the last phase began with the second instant"
    )


def test_a_flight_that_touches_nothing_has_no_such_numbers():
    free = metrics_of([instant(0, 0.0), instant(1, 0.0)])
    assert all(
        math.isnan(free[name])
        for name in NAMES
        if name.startswith("contact_") and "la" not in name
    )
    bare = MetricInstant(
        state=STATE,
        tool=ZERO,
        command=Command(rotor_speeds=(0.0,), efforts=()),
        before=(0.0,),
        held=GOAL,
        continuous=GOAL,
    )
    found = metrics_of([bare])
    assert {name for name in NAMES if not math.isnan(found[name])} == {
        "tip_lowest",
        "phases_time",
        "collision_force",
    }
    assert found["collision_force"] == 0.0


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", ["press_in_phases", "push_a_door", "pick_and_place_box"]
)
def test_metrics_of_contact_in_flight_are_those_over_the_log(name):
    scenario = skyarm.load_scenario(f"examples/{name}.toml")
    log = skyarm.run(scenario)
    over = score(log, ("contact",))
    flown = (
        Batch(scenario, (), metrics=("contact",), bit_exact=True)
        .fly({}, episodes=np.arange(1))
        .metrics
    )
    assert {key: float(value[0]) for key, value in flown.items()} == pytest.approx(
        over, rel=1e-9, nan_ok=True
    )
    if name != "pick_and_place_box":
        force = log.contact_force.sum(axis=1)
        assert over["contact_largest"] == force.max()
        assert over["contact_first"] == log.time[force > 0.0][0]
