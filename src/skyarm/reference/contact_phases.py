"""Task phases with contact or grasp: approach, press, slide, write, search, insert,
turn, retreat, grasp, release.

A gripper that closes on a handle with a ``center`` says that the tip goes about an axis
from then on, until the gripper opens: the push of the reference
(:class:`skyarm.reference.tip_motion.TipPush`) grips, and the force along the radius of
the believed arc is held. A phase ``turn`` or ``open`` between them goes along that arc.

Phases that touch request the push of the reference: a force along one normal, which a
law that can press holds; across the normal the tip stays on the path. A force is held
in the phases that touch until ``retreat`` or a motion in free flight ends it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

from skyarm.algebra import Vec3, axis_rotation
from skyarm.dynamics.kinematics import NEAREST
from skyarm.records.files import Fields, filled_text, shown
from skyarm.reference.signals import Turning
from skyarm.reference.splines import Polynomials, minimum_snap
from skyarm.reference.task import (
    Arc,
    TaskBuilder,
    duration_of,
    require_field,
    seconds,
    unit_vector,
)
from skyarm.reference.task_records import TaskEvent
from skyarm.reference.tip_motion import FASTEST, STRONGEST, UPRIGHT
from skyarm.reference.waypoints import (
    MOST_POINTS,
    Place,
    number_within,
    place_of,
    points_of,
    positive,
    require_way,
)

ABOUT = ("center", "axis", "force")
"""Keys that define the circular arc of a handle."""


def grasp(task: TaskBuilder, phase: Fields) -> None:
    """Add to the task a grasp at the tip's position; the grasped handle may turn about
    an axis.
    """
    arc = _arc_of(task, phase)
    handle(task, phase, "pick")
    if arc is not None:
        task.grip(arc)


def release(task: TaskBuilder, phase: Fields) -> None:
    """Add to the task a release at the tip's position."""
    handle(task, phase, "place")


def handle(task: TaskBuilder, phase: Fields, kind: str) -> None:
    """Add a dwell to the task, during which a gripper closes or opens or a payload is
    taken or left.
    """
    what = "gripper" if "gripper" in phase.table else "payload"
    name = filled_text(phase.take(what), phase.at(what), f"the name of a {what}")
    dwell = seconds(phase, "dwell", 1.0)
    task.wait_until(phase)
    # half-way through the dwell: the tip rests before and after
    task.handled = task.time, task.time + 0.5 * dwell
    named = {"payload": "", what: name}
    event = TaskEvent(kind=kind, time=task.handled[1], where=phase.where, **named)
    task.setting.events.append(event)
    task.rest(dwell)
    if kind == "place":
        task.let_go(name)


def arc_about(task: TaskBuilder, phase: Fields) -> tuple[Place, Place]:
    """Centre (m) and unit axis of a task phase's rotation, given by the phase or by the
    held handle.
    """
    arc = task.arc
    if arc is None:
        return place_of(phase, "center"), unit_vector(phase, "axis")
    words = "must be left out, or as that of the handle that is held"
    center, axis = arc.center, arc.axis
    if phase.states("center"):
        center = place_of(phase, "center")
        require_field(phase, "center", center, arc.center, words)
    if phase.states("axis"):
        axis = unit_vector(phase, "axis")
        require_field(phase, "axis", axis, arc.axis, words)
    return center, axis


def _arc_of(task: TaskBuilder, phase: Fields) -> Arc | None:
    """Circular arc of the handle that a task phase grasps; None if the phase describes
    no rotation.
    """
    given = [name for name in ABOUT if phase.states(name)]
    if not given:
        return None
    if "center" not in given:
        raise ValueError(f"{phase.at(given[0])}: must be left out without center")
    if "gripper" not in phase.table:
        raise ValueError(
            f"{phase.at('center')}: must be left out without gripper; a payload has no"
            " axis"
        )
    center = place_of(phase, "center")
    axis = unit_vector(phase, "axis") if "axis" in given else UPRIGHT
    force = number_within(phase, "force", 0.0, low=-STRONGEST, high=STRONGEST)
    away, a = Vec3(*task.at) - Vec3(*center), Vec3(*axis)
    out = away - a * a.dot(away)
    length = float(out.norm())
    if length < NEAREST:
        words = (
            f"must be a place beside which the tip stands, {NEAREST:g} m or more away"
        )
        raise ValueError(f"{phase.at('center')} = {shown(list(center))}: {words}")
    x, y, z = (c / length for c in out)
    arc = Arc(
        center=center,
        axis=axis,
        force=force,
        normal=(x, y, z),
        gripper=str(phase.take("gripper")),
    )
    if task.known_arc is not None and (task.known_arc.center, task.known_arc.axis) != (
        center,
        axis,
    ):
        raise ValueError(
            f"{phase.at('center')}: a task goes about one axis only; must be as in the"
            " phases before"
        )
    return arc


EASE = 0.05
"""Time (s) of the plan between the request of a force and the wait for it: without any
no insert can be planned, and a press waits in vain; 0.01 s serves as well."""

LETTING_GO = 0.4
"""Waiting time (s) of a retreat while the force decays; a base that moves at once would
turn and shift a heavy tip.

Largest force after a noisy press of 4 N without a wait, with 0.2 s, and from 0.4 s on:
10.3, 6.7 and 4.7 N on ``quadrotor_roll_arm2``, 17.9, 4.8 and 4.8 N on
``hexarotor12_arm5`` (``test_a_release_does_not_jab``)."""

CLEARANCE = 0.05
"""Default distance (m) in front of a surface from which the tip approaches and to which
it retreats; chosen. A tip that retreats by half and by twice of it after a press of 1 N
tilts its base alike, by 0.123 rad, and by four times 0.157 rad (measured)."""

TOUCHED = 0.5
"""Default fraction of the desired force above which the tip counts as in contact;
chosen. A press of 1 N goes on 0.08 s sooner with half of it and 0.12 s later with 0.9
(measured)."""

MOST_TURNS = 40.0
"""Largest number of turns of a spiral or about an axis; chosen: each quarter of a turn
of a spiral is a knot of the plan."""

FASTEST_TURNING = 1.0
"""Highest rate (turns a second) of a spiral, which bounds its angular speed near the
middle."""


def approach(task: TaskBuilder, phase: Fields) -> None:
    """Add a motion to a point in front of a surface to the task."""
    _tell_normal(task, phase)
    goal = place_of(phase, "position")
    task.go_through(
        phase, _in_front(task, phase, goal, near="normal" in phase.table), new=False
    )


def press(task: TaskBuilder, phase: Fields) -> None:
    """Add a press against a surface at rest to the task: wait for contact, then hold
    the force.
    """
    _tell_push(task, phase)
    force = task.force or 0.0
    usual = {
        # hold and timeout are chosen: a press that finds nothing ends the flight
        "force": TOUCHED * force,
        "hold": 0.1,
        "timeout": 10.0,
        "fails": True,
        "direction": task.normal,
    }
    duration = seconds(phase, "duration", 1.0)
    task.rest(EASE)
    task.wait_until(phase, usual)
    task.rest(duration)


def slide(task: TaskBuilder, phase: Fields) -> None:
    """Add a straight motion along a surface with contact force to the task."""
    _tell_push(task, phase)
    task.go_through(phase, place_of(phase, "position"), back=False)


def write(task: TaskBuilder, phase: Fields) -> None:
    """Add a polyline along a surface with contact force to the task."""
    _tell_push(task, phase)
    points = points_of(phase.take("points"), phase.at("points"))
    if not 1 <= len(points) <= MOST_POINTS:
        said = f"{len(points)} points" if points else "[]"
        raise ValueError(
            f"{phase.at('points')} = {said}: must be 1 to {MOST_POINTS} points"
        )
    require_way(
        task.at, points, [f"{phase.at('points')}[{i}]" for i in range(len(points))]
    )
    whole = duration_of(phase)
    length = sum(math.dist(a, b) for a, b in pairwise([task.at, *points]))
    # a stated duration is shared out by length: one speed on all pieces
    for point in points:
        share = None if whole is None else whole * math.dist(task.at, point) / length
        task.go([task.at, point], share)
    task.wait_until(phase)


def retreat(task: TaskBuilder, phase: Fields) -> None:
    """Add a motion away from a surface without contact force to the task, after a wait
    if the tip pressed before.
    """
    wait = LETTING_GO if task.follows_a_press else 0.0
    if phase.states("position"):
        task.rest(wait)
        task.go_through(phase, place_of(phase, "position"), new=False)
        return
    goal = _in_front(task, phase, task.at, near=task.normal is not None)
    duration = seconds(phase, "duration", 1.0)
    if goal == task.at:
        task.rest(duration)
    else:
        # straight out, as of a hole: an offset of the reference stays
        task.rest(wait)
        task.go([task.at, goal], duration)
    task.wait_until(phase)


def search(task: TaskBuilder, phase: Fields) -> None:
    """Add a spiral along a surface with contact force to the task, until the tip drops
    into a hole.
    """
    _tell_push(task, phase)
    u, w = _across(task.normal or (0.0, 0.0, 1.0))
    pitch = positive(phase, "pitch")
    radius = positive(phase, "radius")
    # pace and depth are chosen
    pace = positive(phase, "pace", 0.02)
    depth = positive(phase, "depth", 0.003)
    # each quarter of a turn is a knot of the plan
    if radius > MOST_TURNS * pitch:
        raise ValueError(
            f"{phase.at('pitch')} = {pitch:g}: must be at least"
            f" {radius / MOST_TURNS:.3g} for its radius"
        )
    most, growth = 2.0 * math.pi * radius / pitch, pitch / (2.0 * math.pi)
    angle = _spiral_angle(task.time, most, growth, pace)
    duration = float(angle.knots[-1]) - task.time
    to = tuple(
        p + growth * most * (a * math.cos(most) + b * math.sin(most))
        for p, a, b in zip(task.at, u, w, strict=True)
    )
    task.turn(
        [
            Turning(angle=angle, radius=0.0, growth=growth, u=a, w=b)
            for a, b in zip(u, w, strict=True)
        ],
        (to[0], to[1], to[2]),
        duration,
    )
    usual = {
        "distance": depth,
        # chosen: a drop shows on the way, so the wait at the end is short
        "hold": 0.05,
        "timeout": 0.5,
        "fails": True,
        "early": True,
        "direction": task.normal,
    }
    task.wait_until(phase, usual)


def insert(task: TaskBuilder, phase: Fields) -> None:
    """Add a push into a hole to the task, until the tip has moved in by a distance."""
    _tell_push(task, phase)
    depth = positive(phase, "distance")
    # hold and timeout are chosen: the shipped peg goes in with a hold of 0, too
    usual = {
        "distance": depth,
        "hold": 0.05,
        "timeout": 10.0,
        "fails": True,
        "direction": task.normal,
    }
    task.rest(EASE)
    task.wait_until(phase, usual)


def turn(task: TaskBuilder, phase: Fields) -> None:
    """Add a rotation of the tip about an axis, such as a door's hinge, to the task."""
    if task.force is not None or "force" in phase.table:
        _tell_push(task, phase)
    center, axis = arc_about(task, phase)
    angle = number_within(
        phase, "angle", low=-2.0 * math.pi * MOST_TURNS, high=2.0 * math.pi * MOST_TURNS
    )
    if not angle:
        raise ValueError(
            f"{phase.at('angle')} = 0: must be an angle in rad, counter-clockwise about"
            " the axis"
        )
    begun = task.time
    duration = seconds(phase, "duration")
    a, away = Vec3(*axis), Vec3(*task.at) - Vec3(*center)
    out = away - a * a.dot(away)
    radius = float(out.norm())
    # nearer than rounding: the tip stands on the axis
    if radius < 1e-6:
        raise ValueError(
            f"{phase.at('center')} = {shown(list(center))}: must be a place beside"
            " which the tip stands"
        )
    u = out * (1.0 / radius)
    w = a.cross(u)
    to = Vec3(*task.at) + (axis_rotation(a, angle).apply(out) - out)
    profile = minimum_snap((begun, begun + duration), (0.0, angle))
    turning = [
        Turning(angle=profile, radius=radius, u=p, w=q)
        for p, q in zip(u, w, strict=True)
    ]
    task.turn(turning, (to.x, to.y, to.z), duration)
    task.wait_until(phase)


TOUCHING: Mapping[str, Callable[[TaskBuilder, Fields], None]] = {
    "press": press,
    "slide": slide,
    "write": write,
    "search": search,
    "insert": insert,
    "turn": turn,
    "open": turn,
}
"""Phases in which the tip may press, by kind."""

ABOUT_AN_AXIS = ("turn", "open")
"""Phases that turn about an axis."""


def _in_front(task: TaskBuilder, phase: Fields, place: Place, *, near: bool) -> Place:
    """Position in front of a surface, offset along its normal by the task phase's
    clearance.
    """
    clearance = number_within(phase, "clearance", CLEARANCE if near else 0.0, low=0.0)
    if clearance and task.normal is None:
        raise ValueError(
            f"{phase.at('clearance')} = {clearance:g}: must be left out without a"
            " normal"
        )
    if task.normal is None:
        return place
    x, y, z = (p + clearance * d for p, d in zip(place, task.normal, strict=True))
    return x, y, z


def _tell_normal(task: TaskBuilder, phase: Fields) -> None:
    if phase.states("normal"):
        normal = unit_vector(phase, "normal")
        require_field(
            phase,
            "normal",
            normal,
            task.normal,
            "must be the same in all phases of a task",
        )
        task.normal = normal


def _tell_push(task: TaskBuilder, phase: Fields) -> None:
    """Read contact force, surface normal and approach speed of a task phase into the
    task.
    """
    _tell_normal(task, phase)
    if phase.states("speed"):
        speed = positive(phase, "speed", high=FASTEST)
        require_field(
            phase,
            "speed",
            (speed,),
            None if task.speed is None else (task.speed,),
            "must be the same in all phases of a task",
        )
        task.speed = speed
    if task.force is None or phase.states("force"):
        task.force = positive(phase, "force", high=STRONGEST)
    if task.normal is None:
        raise ValueError(
            f"{phase.at('normal')}: is missing; must be a vector out of the surface"
            " that is touched first"
        )


def _across(normal: Place) -> tuple[Vec3, Vec3]:
    """Two unit vectors perpendicular to a normal and to each other."""
    n = Vec3(*normal)
    # the axis farthest from the normal, whose cross product is longest
    least = min(range(3), key=lambda i: abs(normal[i]))
    u = n.cross(Vec3(*(1.0 if i == least else 0.0 for i in range(3))))
    u = u * (1.0 / float(u.norm()))
    return u, n.cross(u)


def _spiral_angle(begin: float, most: float, growth: float, pace: float) -> Polynomials:
    """Angle of an Archimedean spiral over time, at constant speed (m/s), at most one
    turn a second.

    With da/dt = pace / (growth sqrt(k^2 + a^2)) the time of an angle is known; knots
    stand at each quarter of a turn, and the first and the last piece take twice their
    time: it begins and ends at rest.
    """
    k = pace / (growth * 2.0 * math.pi * FASTEST_TURNING)
    # a first, a middle and a last piece: the outer two take twice their time
    count = max(3, math.ceil(most / (0.5 * math.pi)))
    angles = [most * i / count for i in range(count + 1)]
    # integral of sqrt(k^2 + a^2) by the angle, over its speed
    even = [
        0.5 * growth / pace * (a * math.hypot(k, a) + k * k * math.asinh(a / k))
        for a in angles
    ]
    first, last = even[1], even[-1] - even[-2]
    return minimum_snap(
        [
            begin,
            *(begin + first + t for t in even[1:-1]),
            begin + first + even[-1] + last,
        ],
        angles,
    )
