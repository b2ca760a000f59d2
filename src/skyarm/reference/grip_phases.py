"""Phases that take hold of something and leave it again, and the arc on which a handle goes meanwhile.

A gripper that closes on a handle with a ``center`` says that the tip goes about an axis from then on, until the gripper
opens: the push of the reference (:class:`skyarm.reference.tip_push.TipPush`) grips, and the force along the radius of
the believed arc is held. A phase ``turn`` or ``open`` between them goes along that arc.
"""

from __future__ import annotations

from skyarm.algebra import Vec3
from skyarm.files import Fields, shown
from skyarm.reference.guard_tables import guard_from, unit_vector
from skyarm.reference.phase_builder import Arc, Place, Task, require_field, seconds
from skyarm.reference.setting import TaskEvent
from skyarm.reference.task_tables import place_of, within
from skyarm.reference.tip_push import NEAREST, STRONGEST, UPRIGHT

ABOUT = ("center", "axis", "force")
"""Fields of the arc of a handle."""


def grasp(task: Task, phase: Fields) -> None:
    """Take what is there where the tip is; with a ``center`` a handle that goes about an axis."""
    arc = _arc_of(task, phase)
    handle(task, phase, "pick")
    if arc is not None:
        task.grip(arc)


def release(task: Task, phase: Fields) -> None:
    """Leave it where the tip is."""
    handle(task, phase, "place")


def handle(task: Task, phase: Fields, kind: str) -> None:
    """Wait, then take or leave something half-way through a dwell."""
    what = "gripper" if "gripper" in phase.table else "payload"
    name = phase.take(what)
    if not isinstance(name, str) or not name:
        raise ValueError(f"{phase.at(what)} = {shown(name)}: must be the name of a {what}")
    dwell = seconds(phase, "dwell", 1.0)
    task.wait(guard_from(phase, task.normal))
    task.handled = task.time, task.time + 0.5 * dwell
    named = {"payload": "", what: name}
    event = TaskEvent(kind=kind, time=task.handled[1], where=phase.where, **named)
    task.setting.events.append(event)
    task.rest(dwell)
    if kind == "place":
        task.let_go(name)


def arc_about(task: Task, phase: Fields) -> tuple[Place, Place]:
    """Center and axis of a motion about an axis: as told, else those of the handle that is held."""
    held = task.arc
    if held is None:
        return place_of(phase, "center", phase.at("center")), unit_vector(phase, "axis")
    words = "must be left out, or as that of the handle that is held"
    center, axis = held.center, held.axis
    if phase.take("center", None) is not None:
        center = place_of(phase, "center", phase.at("center"))
        require_field(phase, "center", center, held.center, words)
    if phase.take("axis", None) is not None:
        axis = unit_vector(phase, "axis")
        require_field(phase, "axis", axis, held.axis, words)
    return center, axis


def _arc_of(task: Task, phase: Fields) -> Arc | None:
    """The arc of what a phase takes hold of; None of what goes nowhere of its own."""
    told = [name for name in ABOUT if phase.take(name, None) is not None]
    if not told:
        return None
    if "center" not in told:
        raise ValueError(f"{phase.at(told[0])}: must be left out without center")
    if "gripper" not in phase.table:
        raise ValueError(f"{phase.at('center')}: must be left out without gripper; a payload has no axis")
    center = place_of(phase, "center", phase.at("center"))
    axis = unit_vector(phase, "axis") if "axis" in told else UPRIGHT
    force = within(phase.number("force", 0.0), phase.at("force"), -STRONGEST, STRONGEST)
    away, a = Vec3(*task.at) - Vec3(*center), Vec3(*axis)
    out = away - a * a.dot(away)
    length = float(out.norm())
    if length < NEAREST:
        words = f"must be a place beside which the tip stands, {NEAREST:g} m or more away"
        raise ValueError(f"{phase.at('center')} = {shown(list(center))}: {words}")
    x, y, z = (c / length for c in out)
    found = Arc(center=center, axis=axis, force=force, normal=(x, y, z), gripper=str(phase.take("gripper")))
    if task.known_arc is not None and (task.known_arc.center, task.known_arc.axis) != (center, axis):
        raise ValueError(f"{phase.at('center')}: a task goes about one axis only; must be as in the phases before")
    return found
