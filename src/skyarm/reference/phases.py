"""A task in phases: hold, go to a place, pick a payload up, put it down; each from rest to rest.

``hold``: duration. ``go_to``: position, via = [[x, y, z], ...], duration (left out: as fast as the limits let).
``pick`` and ``place``: payload (its name), position, approach = [0, 0, 0.1] (m, from where it comes and to where it
leaves, against the position), dwell (s, 1: how long it stays there; the payload is taken or left half-way through).

Every phase may have ``start = 8.0`` (s, of the plan): what comes before rests until then; and ``joints = { finger =
0.02 }``: joints that do not carry the tip, moved smoothly to these values (rad or m) in the course of the phase; of
``pick`` and ``place`` in the first half of the dwell, so that a gripper has closed or opened when the payload is taken
or left.

Every phase may have ``until = { error = 0.005, hold = 0.5, timeout = 5.0 }``: the next one begins once the tip's error
has stayed below so many m for so many s, at the latest that long after the phase's planned end. The guard of ``pick``
and ``place`` stands before the payload is taken or left.
"""

from __future__ import annotations

from typing import Any

from skyarm.files import Fields, number, shown
from skyarm.reference.compose import Sum
from skyarm.reference.minimum_snap import minimum_snap
from skyarm.reference.phase_guard import Guard, Phase
from skyarm.reference.setting import JointMove, Setting, TaskEvent
from skyarm.reference.signals import Constant, Signal
from skyarm.reference.task_tables import CLOSEST, limits_of, place_of, points_of, require_apart, within
from skyarm.reference.trajectory import Trajectory
from skyarm.reference.waypoints import SHORTEST, FlightLimits, Points, allocate

HANDLES = ("pick", "place")

KINDS = ("hold", "go_to", *HANDLES)

Place = tuple[float, float, float]


def phases_table(fields: Fields, setting: Setting) -> Trajectory:
    """The motion of a task: its phases, one after the other."""
    builder = _Task(place_of(fields, "position", fields.at("position")), limits_of(fields, setting), setting)
    entries, at = fields.take("phases"), fields.at("phases")
    if not isinstance(entries, list) or not entries:
        raise ValueError(f"{at} = {shown(entries)}: must be a list of phases")
    for i, entry in enumerate(entries):
        phase = Fields(entry, f"{at}[{i}]")
        kind = phase.choice("kind", KINDS)
        until = None if phase.take("until", None) is None else _guard(Fields(phase.take("until"), phase.at("until")))
        joints = _joints(phase)
        builder.begin(phase)
        begun = builder.begun = builder.time
        getattr(builder, kind)(phase, until)
        phase.done()
        setting.phases.append(Phase(name=kind, begin=begun, end=builder.time))
        start, end = builder.handled if kind in HANDLES else (begun, builder.time)
        setting.joint_moves.extend(
            JointMove(joint=name, value=value, start=start, end=end, where=f"{phase.where}.joints.{name}")
            for name, value in joints.items()
        )
        within(builder.time, f"{phase.where}: its end (s)", 0.0)
    return builder.motion()


def _seconds(fields: Fields, name: str, *default: Any) -> float:
    """How long something of a phase takes."""
    return within(fields.number(name, *default), fields.at(name), CLOSEST)


def _joints(phase: Fields) -> dict[str, float]:
    """Where a phase moves joints, rad or m by name."""
    table = phase.take("joints", None)
    if table is None:
        return {}
    if not isinstance(table, dict) or not table:
        allowed = "must be a table of joints and where they are to be, as { finger = 0.02 } (rad or m)"
        raise ValueError(f"{phase.at('joints')} = {shown(table)}: {allowed}")
    return {name: number(value, f"{phase.at('joints')}.{name}") for name, value in table.items()}


def _guard(fields: Fields) -> dict[str, float]:
    """Numbers of a guard."""
    found = {
        "error": fields.number("error", low=0.0, strict=True),
        "hold": fields.number("hold", 0.5, low=0.0),
        "timeout": _seconds(fields, "timeout", 5.0),
    }
    fields.done()
    return found


class _Task:
    """Phases as they are read: where the task stands, at what time, and its pieces so far."""

    def __init__(self, start: Place, limits: FlightLimits, setting: Setting) -> None:
        self.start = self.at = start
        self.time = self.begun = 0.0
        self.handled = 0.0, 0.0
        """Beginning of the last dwell and the instant at which its payload is taken or left, s."""
        self._limits, self._setting = limits, setting
        self._pieces: list[tuple[Points, tuple[float, ...]]] = []

    def begin(self, phase: Fields) -> None:
        """Rest until the instant at which a phase is to begin, if it says one."""
        if phase.take("start", None) is None:
            return
        start = within(phase.number("start"), phase.at("start"), 0.0)
        if start < self.time:
            raise ValueError(
                f"{phase.at('start')} = {start:g}: must be at or after {self.time:.6g} s, the end of the phase before"
            )
        self.time = start

    def hold(self, phase: Fields, until: dict[str, float] | None) -> None:
        """Stay."""
        self.time += _seconds(phase, "duration")
        self._wait(until)

    def go_to(self, phase: Fields, until: dict[str, float] | None) -> None:
        """Go to a position, through others."""
        via = points_of(phase.take("via", []), phase.at("via"))
        goal = place_of(phase, "position", phase.at("position"))
        duration = None if phase.take("duration", None) is None else _seconds(phase, "duration")
        points = [self.at, *via, goal]
        require_apart(points, phase.at("position"))
        self._go(points, duration)
        self._wait(until)

    def pick(self, phase: Fields, until: dict[str, float] | None) -> None:
        """Come near, down, take the payload, leave."""
        self._handle(phase, "pick", until)

    def place(self, phase: Fields, until: dict[str, float] | None) -> None:
        """Come near, down, leave the payload, leave."""
        self._handle(phase, "place", until)

    def _handle(self, phase: Fields, kind: str, until: dict[str, float] | None) -> None:
        payload = phase.take("payload")
        if not isinstance(payload, str) or not payload:
            raise ValueError(f"{phase.at('payload')} = {shown(payload)}: must be the name of a payload")
        x, y, z = place_of(phase, "position", phase.at("position"))
        a, b, c = place_of(phase, "approach", phase.at("approach"), (0.0, 0.0, 0.1))
        dwell = _seconds(phase, "dwell", 1.0)
        near, there = (x + a, y + b, z + c), (x, y, z)
        for goal in (near, there):
            self._go([self.at, goal], None)
        self._wait(until)
        self.handled = self.time, self.time + 0.5 * dwell
        event = TaskEvent(kind=kind, payload=payload, time=self.time + 0.5 * dwell, where=phase.where)
        self._setting.events.append(event)
        self.time += dwell
        self._go([there, near], None)

    def _wait(self, until: dict[str, float] | None) -> None:
        """Let the reference rest here until the flight shows what a guard asks."""
        if until is not None:
            number = len(self._setting.phases)
            self._setting.guards.append(Guard(at=self.time, begin=self.begun, phase=number, **until))

    def _go(self, points: Points, duration: float | None) -> None:
        """Add the motion of least snap through points; none where they are one place."""
        if len(points) == 2 and max(abs(a - b) for a, b in zip(*points, strict=True)) < SHORTEST:
            return
        times = allocate(points, self._limits, self._setting.gravity)
        if duration is not None:
            times = tuple(t * (duration / times[-1]) for t in times)
        self._pieces.append((points, tuple(self.time + t for t in times)))
        self.time, self.at = self.time + times[-1], points[-1]

    def motion(self) -> Trajectory:
        """The whole motion, each axis a sum of what every piece adds to where it begins."""
        axes: list[Signal] = []
        for axis in range(3):
            parts: list[Any] = [Constant(self.start[axis])]
            for points, times in self._pieces:
                if any(p[axis] != points[0][axis] for p in points):
                    parts.append(minimum_snap(times, [p[axis] - points[0][axis] for p in points]))
            axes.append(Sum(tuple(parts)))
        x, y, z = axes
        return Trajectory(x=x, y=y, z=z)
