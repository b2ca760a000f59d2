"""Task motion as a sequence of phases such as go to, press and grasp, each from rest to
rest.

In free flight: ``hold``: duration. ``go_to``, ``carry``: position, via = [[x, y, z],
...], duration (left out: as fast as the limits let). ``lift``: height (m), duration.
``pick`` and ``place``: payload (its name), position, approach = [0, 0, 0.1] (m, from
where it comes and to where it leaves, against the position), dwell (s, 1: how long it
stays there; the payload is taken or left half-way through). ``grasp`` and ``release``:
payload, dwell; the same where the tip is. A gripper (its name) in place of payload
closes or opens at that instant; of a handle that goes about an axis ``grasp`` says
center, axis ([0, 0, 1]) and the force out of it (N, 0) that is held until the gripper
opens.

In contact (:mod:`skyarm.reference.contact_phases`): ``approach``, ``press``, ``slide``,
``write``, ``search``, ``insert``, ``turn`` or ``open``, ``retreat``.

Every phase may have ``start = 8.0`` (s, of the plan): what comes before rests until
then; and ``joints = { finger = 0.02 }``: joints that do not carry the tip, moved
smoothly to these values (rad or m) in the course of the phase; of phases that take or
leave a payload in the first half of the dwell, so that a gripper has closed or opened
when the payload is taken or left.

Every phase may have ``until`` (:mod:`skyarm.reference.task`): the reference rests at
its planned end until the flight shows what it asks, or a timeout has passed. That of
phases which take or leave a payload stands before that, and that of ``press`` before
the force is held.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

from skyarm.records.files import Fields, did_you_mean, filled_list, number, shown
from skyarm.reference.contact_phases import (
    ABOUT_AN_AXIS,
    TOUCHING,
    approach,
    grasp,
    handle,
    release,
    retreat,
)
from skyarm.reference.signals import Constant, Signal, Sum
from skyarm.reference.splines import minimum_snap
from skyarm.reference.task import TaskBuilder, duration_of, seconds
from skyarm.reference.task_records import JointMove, Setting
from skyarm.reference.trajectory import Trajectory
from skyarm.reference.waypoints import (
    SHORTEST,
    limits_of,
    number_within,
    place_of,
    within,
)
from skyarm.vehicle import Vehicle


def phases_table(fields: Fields, setting: Setting) -> Trajectory:
    """Trajectory of a task from a table of a scenario file that lists the task's
    phases.
    """
    task = TaskBuilder(
        place_of(fields, "position"), limits_of(fields, setting), setting
    )
    at = fields.at("phases")
    for i, entry in enumerate(
        filled_list(fields.take("phases"), at, "a list of phases")
    ):
        phase = Fields(entry, f"{at}[{i}]")
        phase.expect(("depth",))
        kind = phase.choice("kind", tuple(KINDS))
        joints = _joints(phase)
        task.begin(phase)
        # a motion in free flight ends the force that was held
        if kind not in TOUCHING:
            task.force = None
        _require_hands(task, phase, kind)
        KINDS[kind](task, phase)
        if kind in TOUCHING and task.force is not None:
            task.press(task.begun, task.time)
        phase.done()
        if (
            joints
            and setting.guards
            and setting.guards[-1].phase == i
            and setting.guards[-1].early
        ):
            raise ValueError(
                f"{phase.at('joints')}: must be left out of a phase that may end early"
                " (until.early)"
            )
        task.end(kind)
        start, end = task.handled if kind in HANDLES else (task.begun, task.time)
        setting.joint_moves.extend(
            JointMove(
                joint=name,
                value=value,
                start=start,
                end=end,
                where=f"{phase.where}.joints.{name}",
            )
            for name, value in joints.items()
        )
        within(task.time, f"{phase.where}: its end (s)", 0.0)
    return task.motion()


def _require_hands(task: TaskBuilder, phase: Fields, kind: str) -> None:
    """Refuse a phase that presses on a surface while the gripper holds a handle."""
    if task.arc is None or kind not in TOUCHING:
        return
    if kind not in ABOUT_AN_AXIS or phase.states("force"):
        name = "force" if kind in ABOUT_AN_AXIS else "kind"
        words = (
            "must not press while a handle is held; the force along its radius is said"
            " where it is taken"
        )
        raise ValueError(f"{phase.at(name)} = {shown(phase.table[name])}: {words}")


def _joints(phase: Fields) -> dict[str, float]:
    """Joint positions (rad or m) that a task phase commands, by joint name."""
    table = phase.take("joints", None)
    if table is None:
        return {}
    if not isinstance(table, dict) or not table:
        allowed = (
            "must be a table of joints and where they are to be, as { finger = 0.02 }"
            " (rad or m)"
        )
        raise ValueError(f"{phase.at('joints')} = {shown(table)}: {allowed}")
    return {
        name: number(value, f"{phase.at('joints')}.{name}")
        for name, value in table.items()
    }


def hold(task: TaskBuilder, phase: Fields) -> None:
    """Add a stay at the present position to the task."""
    task.rest(seconds(phase, "duration"))
    task.wait_until(phase)


def go_to(task: TaskBuilder, phase: Fields) -> None:
    """Add a motion to a position, through optional intermediate points, to the task."""
    task.go_through(phase, place_of(phase, "position"))


def lift(task: TaskBuilder, phase: Fields) -> None:
    """Add a vertical motion to the task."""
    height = number_within(phase, "height")
    duration = duration_of(phase)
    x, y, z = task.at
    if abs(height) < SHORTEST:
        raise ValueError(
            f"{phase.at('height')} = {height:g}: must be {SHORTEST:g} m or more, up or"
            " down (below 0)"
        )
    task.go([task.at, (x, y, z + height)], duration)
    task.wait_until(phase)


def pick_or_place(task: TaskBuilder, phase: Fields) -> None:
    """Add an approach, a descent, a grasp or release of the payload, and an ascent to
    the task.
    """
    there = place_of(phase, "position")
    x, y, z = (
        a + b
        for a, b in zip(
            there, place_of(phase, "approach", (0.0, 0.0, 0.1)), strict=True
        )
    )
    task.go([task.at, (x, y, z)], back=True)
    task.go([task.at, there])
    handle(task, phase, phase.table["kind"])
    task.go([there, (x, y, z)])


KINDS: Mapping[str, Callable[[TaskBuilder, Fields], None]] = {
    "hold": hold,
    "go_to": go_to,
    "pick": pick_or_place,
    "place": pick_or_place,
    "approach": approach,
    **TOUCHING,
    "retreat": retreat,
    "grasp": grasp,
    "release": release,
    "lift": lift,
    "carry": go_to,
}
"""Kind of a phase -> function that adds it to the task."""

HANDLES = ("pick", "place", "grasp", "release")


PEAK_RATE = 2.1875
"""Peak speed of a minimum-snap motion from rest to rest by 1 in 1 s: 35/16, half-way
through."""


def with_joint_moves(
    trajectory: Trajectory,
    moves: Sequence[JointMove],
    vehicle: Vehicle | None,
    fastest: float = math.inf,
) -> Trajectory:
    """Add moves of joints that do not carry the tip, such as fingers, to a trajectory.

    Args:
        trajectory: trajectory whose own signals of these joints are constant.
        moves: joint moves of a task's phases.
        vehicle: vehicle with the joints; needed where there are moves.
        fastest: largest speed that a move may reach, rad/s or m/s.

    Raises:
        ValueError: one line: a joint that is not there, carries the tip or moves
            already, a value beyond its limits, a move that is too fast.
    """
    if not moves:
        return trajectory
    if vehicle is None:
        raise ValueError(
            f"{moves[0].where} = {moves[0].value:g}: needs a vehicle; none is known"
        )
    signals = list(trajectory.joints)
    added: dict[int, list[Signal]] = {}
    reached: dict[int, float] = {}
    # phases of several tasks are read one task after the other
    for move in sorted(moves, key=lambda each: each.start):
        i = _index(move, trajectory, vehicle)
        # a move begins where the one before has ended
        at = reached.get(i, float(signals[i].derivatives(0.0)[0]))
        _require_within(move, at, vehicle, i, fastest)
        if move.value != at:
            added.setdefault(i, []).append(
                minimum_snap([move.start, move.end], [0.0, move.value - at])
            )
        reached[i] = move.value
    for i, parts in added.items():
        signals[i] = Sum((signals[i], *parts))
    return dataclasses.replace(trajectory, joints=tuple(signals))


def _index(move: JointMove, trajectory: Trajectory, vehicle: Vehicle) -> int:
    """Index of the joint that a task phase moves; refuses joints that carry the tip or
    already move.
    """
    names = vehicle.joint_names
    carriers = () if trajectory.tip is None else trajectory.tip.arm.carriers
    if move.joint not in names:
        others = [name for i, name in enumerate(names) if i not in carriers]
        there = (
            "must be a joint that does not carry the tip; there are"
            f" {', '.join(others) or 'none'}"
        )
        raise ValueError(f"{move.where}: {did_you_mean(move.joint, others)}{there}")
    i = names.index(move.joint)
    if i in carriers:
        raise ValueError(
            f"{move.where}: must be left out, joint {move.joint!r} carries the tip and"
            " follows its path"
        )
    signal = trajectory.joints[i]
    if not isinstance(signal, Constant):
        raise ValueError(
            f"{move.where}: must be left out, reference.joints[{i}] moves joint"
            f" {move.joint!r} already"
        )
    return i


def _require_within(
    move: JointMove, at: float, vehicle: Vehicle, i: int, fastest: float
) -> None:
    """Refuse a planned joint move beyond the joint's limits or maximum speed."""
    joint = vehicle.links[i].joint
    low, high = joint.ends
    if not low <= move.value <= high:
        raise ValueError(
            f"{move.where} = {move.value:g}: must be within {low:g} and {high:g} of"
            f" {joint.name!r}"
        )
    seconds = move.end - move.start
    if PEAK_RATE * abs(move.value - at) > fastest * seconds:
        unit = joint.units[0]
        least = PEAK_RATE * abs(move.value - at) / fastest
        raise ValueError(
            f"{move.where} = {shown(move.value)}: moves by {abs(move.value - at):.3g}"
            f" {unit} in {seconds:.3g} s; must have {least:.3g} s or more (joint_speed"
            f" = {fastest:g} {unit}/s)"
        )
