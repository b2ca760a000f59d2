"""Goals of base and joints received in flight: smooth motions from the current
reference to the goals.

A goal changes numbers of the reference
(:class:`skyarm.reference.redirection.Redirected`) as
:meth:`skyarm.simulate.session.Session.change` does: the log keeps it, and the flight is
flown again to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from skyarm.links.ros.node import Content
from skyarm.log.ros.message_bytes import MessageError
from skyarm.log.ros.scene import WORLD
from skyarm.records.files import must_be_one_of, shown
from skyarm.reference import Trajectory
from skyarm.reference.redirection import (
    DURATIONS,
    FIELDS,
    Redirected,
    redirectable,
    shortest_duration,
)
from skyarm.reference.signals import Signal
from skyarm.scenario.paths import prefix_of
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle import Vehicle

BASE = ("x", "y", "z")

HEADING = "yaw"

SPEED, ACCELERATION = 1.0, 1.0
"""Limits of a motion to a goal: speed (m/s, rad/s) and acceleration (m/s^2,
rad/s^2)."""

FARTHEST = SPEED * float(DURATIONS[-1]) * 8.0 / 15.0
"""Farthest goal (m or rad): a quintic motion, at most 15/8 times as fast as on average,
reaches it in the longest time."""


def with_goals(scenario: Scenario) -> tuple[Scenario, dict[str, str]]:
    """Make the references of a scenario accept goals in flight; where that is
    impossible, return the reason by vehicle.

    Returns:
        The scenario, and the name of each vehicle that takes no goals with the reason.
    """
    agents = dict(scenario.agents)
    reasons: dict[str, str] = {}
    for name, agent in scenario.agents.items():
        if reason := _reason_against(scenario.of(name)):
            reasons[name] = reason
        else:
            agents[name] = replace(agent, reference=redirectable(agent.reference))
    return replace(scenario, agents=agents), reasons


def _reason_against(scenario: Scenario) -> str:
    """Reason why the reference of a vehicle, of the scenario of its flight, takes no
    goals; empty if it can.
    """
    reference = scenario.agent.reference
    reasons = {
        "its tip leads the base": (
            reference.tip is not None or reference.push is not None
        ),
        "its phases wait for the flight": bool(reference.guards or reference.phases),
        "its path is slowed down by a governor": scenario.agent.path_time is not None,
        "it changes in flight": any(
            each.path.startswith("reference") for each in scenario.changes
        ),
    }
    return next((words for words, holds in reasons.items() if holds), "")


def goal_paths(scenario: Scenario) -> list[str]:
    """Parameter paths that goals change; empty if no reference takes any."""
    return [
        f"{prefix_of(scenario, name)}reference.{word}.{field}"
        for name, agent in scenario.agents.items()
        for word in _signals(agent.reference)
        for field in FIELDS
    ]


def takes_goals(reference: Trajectory) -> bool:
    """True if a reference can take goals in flight."""
    return type(reference.x) is Redirected


def base_goal(message: Content) -> dict[str, float]:
    """Goals for x, y, z (m) and heading (rad) from a PoseStamped message; no heading
    for a zero quaternion.

    Raises:
        MessageError: another frame than the world's, or a number that is not finite.
    """
    frame, pose = message["header"]["frame_id"].lstrip("/"), message["pose"]
    if frame not in ("", WORLD):
        raise MessageError(f"frame_id = {shown(frame)}: must be {WORLD}")
    goals = {axis: float(pose["position"][axis]) for axis in BASE}
    x, y, z, w = (float(pose["orientation"][axis]) for axis in "xyzw")
    if not all(map(math.isfinite, (*goals.values(), x, y, z, w))):
        raise MessageError("must be of finite numbers")
    # four zeros state no orientation: then the heading stays
    if largest := max(map(abs, (x, y, z, w))):
        # whose squares do not overflow
        x, y, z, w = x / largest, y / largest, z / largest, w / largest
        norm = x * x + y * y + z * z + w * w
        goals[HEADING] = math.atan2(2.0 * (w * z + x * y), norm - 2.0 * (y * y + z * z))
    return goals


def joint_goal(message: Content, vehicle: Vehicle) -> dict[str, float]:
    """Joint goals (rad or m) by signal name, such as ``joints.0``, from a JointState
    message with names and positions.

    Raises:
        MessageError: a name of no joint, another number of positions than names, or a
            position outside the limits.
    """
    names = list(message["name"])
    positions = [float(value) for value in message["position"]]
    joints = vehicle.joints
    if len(names) != len(positions) or not names:
        raise MessageError(
            f"{len(names)} names and {len(positions)} positions: must be as many, and"
            " one at least"
        )
    joint_names = [each.name for each in joints]
    goals: dict[str, float] = {}
    for name, value in zip(names, positions, strict=True):
        if name not in joint_names:
            raise MessageError(
                f"name = {shown(name)}: {must_be_one_of(joint_names, name)}"
            )
        low, high = joints[joint_names.index(name)].ends
        if not (math.isfinite(value) and low <= value <= high):
            raise MessageError(
                f"{name} = {value:g}: must be a finite number from {low:g} to {high:g}"
            )
        goals[f"joints.{joint_names.index(name)}"] = value
    return goals


def check_reach(reference: Trajectory, time: float, goals: Mapping[str, float]) -> None:
    """Raise an error for a position goal farther than ``FARTHEST`` (m or rad) from the
    reference at a given time.

    Args:
        reference: reference that takes goals.
        time: time of the instant, s.
        goals: word of a signal (x, y, z, yaw, joints.0) -> goal.

    Raises:
        MessageError: a goal of the base or of a joint is too far.
    """
    signals = _signals(reference)
    for word, goal in goals.items():
        value = _begin(signals[word], time)[0]
        # two headings are half a turn apart at most
        if word != HEADING and not abs(goal - value) <= FARTHEST:
            raise MessageError(
                f"{word} = {goal:g}: must be within {FARTHEST:g} of the reference,"
                f" {value:g}"
            )


def changes_to(
    reference: Trajectory, time: float, goals: Mapping[str, float]
) -> dict[str, float]:
    """Reference parameters, by path, that move the reference smoothly from its state at
    a given time to the goals.

    All of the base arrive together, each joint in its own time. Every number of every
    signal is given, so that all goals change the same ones.

    Args:
        reference: reference that takes goals.
        time: time of the instant, s.
        goals: word of a signal (x, y, z, yaw, joints.0) -> goal.
    """
    signals = _signals(reference)
    groups = [
        # base and heading together, so that a diagonal stays straight
        [word for word in (*BASE, HEADING) if word in goals],
        *([word] for word in goals if "." in word),
    ]
    for group in groups:
        signals |= _move_together({word: signals[word] for word in group}, time, goals)
    return {
        f"reference.{word}.{field}": float(getattr(each, field))
        for word, each in signals.items()
        for field in FIELDS
    }


def _signals(reference: Trajectory) -> dict[str, Redirected]:
    signals: dict[str, Signal] = {
        word: getattr(reference, word) for word in (*BASE, HEADING)
    }
    signals |= {f"joints.{i}": each for i, each in enumerate(reference.joints)}
    return {word: each for word, each in signals.items() if type(each) is Redirected}


def _move_together(
    signals: Mapping[str, Redirected], time: float, goals: Mapping[str, float]
) -> dict[str, Redirected]:
    """Reference signals that leave their values at a given time and reach their goals
    at the same instant.
    """
    begins = [_begin(each, time) for each in signals.values()]
    ends = [
        # of two headings a whole turn apart the nearer one is meant
        _nearest_turn(goals[word], begin[0]) if word == HEADING else goals[word]
        for word, begin in zip(signals, begins, strict=True)
    ]
    duration = shortest_duration(begins, ends, SPEED, ACCELERATION) if begins else 0.0
    return {
        word: replace(
            each,
            start=time,
            duration=duration,
            value=begin[0],
            velocity=begin[1],
            acceleration=begin[2],
            goal=end,
        )
        for (word, each), begin, end in zip(signals.items(), begins, ends, strict=True)
    }


def _begin(signal: Redirected, time: float) -> tuple[float, float, float]:
    value, velocity, acceleration, _, _ = signal.derivatives(time)
    return float(value), float(velocity), float(acceleration)


def _nearest_turn(angle: float, near: float) -> float:
    """Angle (rad), shifted by whole turns, that is nearest to another angle."""
    return angle + math.tau * round((near - angle) / math.tau)
