"""A task in phases, each from rest to rest; the reference may wait at the end of each for the flight.

In free flight: ``hold``: duration. ``go_to``, ``carry``: position, via = [[x, y, z], ...], duration (left out: as fast
as the limits let). ``lift``: height (m), duration. ``pick`` and ``place``: payload (its name), position, approach = [0,
0, 0.1] (m, from where it comes and to where it leaves, against the position), dwell (s, 1: how long it stays there; the
payload is taken or left half-way through). ``grasp`` and ``release``: payload, dwell; the same where the tip is. A
gripper (its name) in place of payload closes or opens at that instant; of a handle that goes about an axis ``grasp``
says center, axis ([0, 0, 1]) and the force out of it (N, 0) that is held until the gripper opens.

In contact (:mod:`skyarm.reference.contact_phases`): ``approach``, ``press``, ``slide``, ``write``, ``search``,
``insert``, ``turn`` or ``open``, ``retreat``.

Every phase may have ``start = 8.0`` (s, of the plan): what comes before rests until then; and ``joints = { finger =
0.02 }``: joints that do not carry the tip, moved smoothly to these values (rad or m) in the course of the phase; of
phases that take or leave a payload in the first half of the dwell, so that a gripper has closed or opened when the
payload is taken or left.

Every phase may have ``until`` (:mod:`skyarm.reference.guard_tables`): the reference rests at its planned end until the
flight shows what it asks, or a timeout has passed. That of phases which take or leave a payload stands before that,
and that of ``press`` before the force is held.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from skyarm.files import Fields, number, shown
from skyarm.reference.contact_phases import ABOUT_AN_AXIS, TOUCHING, approach, retreat
from skyarm.reference.grip_phases import grasp, handle, release
from skyarm.reference.guard_tables import guard_from
from skyarm.reference.phase_builder import Place, Task, seconds
from skyarm.reference.setting import JointMove, Setting
from skyarm.reference.task_tables import limits_of, place_of, points_of, require_way, within
from skyarm.reference.trajectory import Trajectory
from skyarm.reference.waypoints import SHORTEST


def phases_table(fields: Fields, setting: Setting) -> Trajectory:
    """The motion of a task: its phases, one after the other."""
    task = Task(place_of(fields, "position", fields.at("position")), limits_of(fields, setting), setting)
    entries, at = fields.take("phases"), fields.at("phases")
    if not isinstance(entries, list) or not entries:
        raise ValueError(f"{at} = {shown(entries)}: must be a list of phases")
    for i, entry in enumerate(entries):
        phase = Fields(entry, f"{at}[{i}]")
        kind = phase.choice("kind", tuple(KINDS))
        joints = _joints(phase)
        task.begin(phase)
        if kind not in TOUCHING:
            task.force = None
        _require_hands(task, phase, kind)
        KINDS[kind](task, phase)
        phase.done()
        if joints and setting.guards and setting.guards[-1].phase == i and setting.guards[-1].early:
            raise ValueError(f"{phase.at('joints')}: must be left out of a phase that may end early (until.early)")
        task.end(kind)
        start, end = task.handled if kind in HANDLES else (task.begun, task.time)
        setting.joint_moves.extend(
            JointMove(joint=name, value=value, start=start, end=end, where=f"{phase.where}.joints.{name}")
            for name, value in joints.items()
        )
        within(task.time, f"{phase.where}: its end (s)", 0.0)
    return task.motion()


def _require_hands(task: Task, phase: Fields, kind: str) -> None:
    """Refuse to press while the tip holds a handle: along the arc's radius one force is held."""
    if task.arc is None or kind not in TOUCHING:
        return
    if kind not in ABOUT_AN_AXIS or phase.take("force", None) is not None:
        name = "force" if kind in ABOUT_AN_AXIS else "kind"
        words = "must not press while a handle is held; the force along its radius is said where it is taken"
        raise ValueError(f"{phase.at(name)} = {shown(phase.table[name])}: {words}")


def _joints(phase: Fields) -> dict[str, float]:
    """Where a phase moves joints, rad or m by name."""
    table = phase.take("joints", None)
    if table is None:
        return {}
    if not isinstance(table, dict) or not table:
        allowed = "must be a table of joints and where they are to be, as { finger = 0.02 } (rad or m)"
        raise ValueError(f"{phase.at('joints')} = {shown(table)}: {allowed}")
    return {name: number(value, f"{phase.at('joints')}.{name}") for name, value in table.items()}


def hold(task: Task, phase: Fields) -> None:
    """Stay."""
    task.rest(seconds(phase, "duration"))
    task.wait(guard_from(phase, task.normal))


def go_to(task: Task, phase: Fields) -> None:
    """Go to a position, through others."""
    via = points_of(phase.take("via", []), phase.at("via"))
    goal = place_of(phase, "position", phase.at("position"))
    duration = None if phase.take("duration", None) is None else seconds(phase, "duration")
    points = [task.at, *via, goal]
    require_way(task.at, [*via, goal], [*(f"{phase.at('via')}[{i}]" for i in range(len(via))), phase.at("position")])
    task.go(points, duration, back=True)
    task.wait(guard_from(phase, task.normal))


def lift(task: Task, phase: Fields) -> None:
    """Go straight up, or down."""
    height = within(phase.number("height"), phase.at("height"))
    duration = None if phase.take("duration", None) is None else seconds(phase, "duration")
    x, y, z = task.at
    if abs(height) < SHORTEST:
        raise ValueError(f"{phase.at('height')} = {height:g}: must be {SHORTEST:g} m or more, up or down (below 0)")
    task.go([task.at, (x, y, z + height)], duration)
    task.wait(guard_from(phase, task.normal))


def pick(task: Task, phase: Fields) -> None:
    """Come near, down, take the payload, leave."""
    _there_and_back(task, phase, "pick")


def place(task: Task, phase: Fields) -> None:
    """Come near, down, leave the payload, leave."""
    _there_and_back(task, phase, "place")


def _there_and_back(task: Task, phase: Fields, kind: str) -> None:
    x, y, z = place_of(phase, "position", phase.at("position"))
    a, b, c = place_of(phase, "approach", phase.at("approach"), (0.0, 0.0, 0.1))
    near: Place = (x + a, y + b, z + c)
    there: Place = (x, y, z)
    task.go([task.at, near], back=True)
    task.go([task.at, there])
    handle(task, phase, kind)
    task.go([there, near])


KINDS: Mapping[str, Callable[[Task, Fields], None]] = {
    "hold": hold, "go_to": go_to, "pick": pick, "place": place, "approach": approach, **TOUCHING, "retreat": retreat,
    "grasp": grasp, "release": release, "lift": lift, "carry": go_to,
}  # fmt: skip
"""Phases by kind."""

HANDLES = ("pick", "place", "grasp", "release")
