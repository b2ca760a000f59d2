"""Construction of a task's trajectory and of the conditions that end its phases.

``until`` of a phase is what the flight must show before the reference advances::

    until = { error = 0.005 }                      # m, of the tip, at most
    # N against the tip, at least; s of waiting, at most
    until = { force = 0.5, timeout = 8 }
    until = { force_below = 0.2 }                  # N, at most
    # m, that the tip has moved against the direction
    until = { distance = 0.02, direction = [0, 0, 1] }
    # as the sensor at the tip reads it, not as the law observes it
    until = { force = 0.5, force_sensor = true }
    until = { closed = "fingertip" }               # a tactile switch, or open
    until = { force = 0.5, hold = 0.1, on_timeout = "fail", early = true }

What is asked must hold together for ``hold`` s (0.5). A wrong table raises ValueError
with one line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.algebra import Scalars
from skyarm.records.files import Fields, filled_text, shown
from skyarm.records.immutable import immutable
from skyarm.reference.signals import Constant, Signal, Sum, Turning, Windowed
from skyarm.reference.splines import minimum_snap
from skyarm.reference.task_records import Guard, Phase, Setting
from skyarm.reference.tip_motion import SPEED, TipPush
from skyarm.reference.trajectory import Trajectory
from skyarm.reference.waypoints import (
    CLOSEST,
    SHORTEST,
    FlightLimits,
    Place,
    Points,
    allocate,
    number_within,
    points_of,
    positive,
    require_way,
)

NUMBERS = ("error", "force", "force_below", "distance")

SWITCHES = ("closed", "open")

ASKED = (*NUMBERS, *SWITCHES)

NOWHERE = 1e-6
"""Length of a vector below which its direction is undefined, as above its inverse;
chosen, both far from those that are written."""


def guard_from(
    phase: Fields, normal: Place | None, usual: Mapping[str, Any] | None
) -> dict[str, Any] | None:
    """Condition that ends a task phase, from the table ``until`` of the phase; None
    without a condition.

    Args:
        phase: table of the phase.
        normal: unit normal of the surface that the task touches, if given.
        usual: default guard of the phase without ``until``.
    """
    if not phase.states("until"):
        return None if usual is None else dict(usual)
    fields = Fields(phase.take("until"), phase.at("until"))
    guard = _guard_conditions(fields)
    guard["hold"] = number_within(fields, "hold", 0.5, low=0.0)
    guard["timeout"] = number_within(fields, "timeout", 5.0, low=CLOSEST)
    guard["fails"] = fields.choice("on_timeout", ("go_on", "fail"), "go_on") == "fail"
    guard["early"] = fields.flag("early", False)
    if fields.states("direction"):
        guard["direction"] = unit_vector(fields, "direction")
    fields.done()
    if not any(name in guard for name in ASKED):
        raise ValueError(
            f"{phase.at('until')} = {shown(fields.table)}: must have one of"
            f" {', '.join(ASKED)}"
        )
    # an error has no direction, forces and distances are along one
    if "direction" not in guard and any(name in guard for name in NUMBERS[1:]):
        if normal is None:
            allowed = (
                "must be a vector out of the surface, since the task says no normal"
            )
            raise ValueError(f"{fields.at('direction')}: is missing; {allowed}")
        guard["direction"] = normal
    return guard


def _guard_conditions(fields: Fields) -> dict[str, Any]:
    """Thresholds and tactile switches of the condition that ends a task phase."""
    conditions: dict[str, Any] = {}
    for name in SWITCHES:
        if fields.states(name):
            conditions[name] = filled_text(
                fields.take(name), fields.at(name), "the name of a tactile switch"
            )
    for name in NUMBERS:
        if fields.states(name):
            conditions[name] = positive(fields, name)
    if (
        "force" in conditions
        and conditions.get("force_below", math.inf) <= conditions["force"]
    ):
        raise ValueError(
            f"{fields.at('force_below')} = {conditions['force_below']:g}: must be above"
            " force"
        )
    conditions["sensed"] = fields.flag("force_sensor", False)
    if conditions["sensed"] and not (
        "force" in conditions or "force_below" in conditions
    ):
        raise ValueError(
            f"{fields.at('force_sensor')} = true: must be left out without force or"
            " force_below"
        )
    return conditions


def unit_vector(fields: Fields, name: str) -> Place:
    """Read a vector of a table and normalise it to unit length."""
    given = fields.vector(name)
    length = math.hypot(*given)
    if not NOWHERE < length < 1.0 / NOWHERE:
        raise ValueError(
            f"{fields.at(name)} = {shown(list(given))}: must be a vector that points"
            " somewhere"
        )
    x, y, z = (c / length for c in given)
    return x, y, z


EDGE = 1e-6
"""Time (s) after the planned end of a phase at which a force changes; the reference may
wait at that end with the force."""

COMING_BACK = 1.0
"""Time (s) in which an offset reference returns to its plan if the next position is the
planned one; chosen."""


def seconds(fields: Fields, name: str, *default: object) -> float:
    """Read a duration (s) of a task phase."""
    return number_within(fields, name, *default, low=CLOSEST)


def duration_of(phase: Fields) -> float | None:
    """Read the optional duration (s) of a task phase; None for the shortest within the
    flight limits.
    """
    return seconds(phase, "duration") if phase.states("duration") else None


@immutable
class Arc:
    """Circular arc of a handle about its axis, such as that of a door.

    Attributes:
        center: point on its axis, m. axis: unit vector. force: force with which the tip
            presses out of the axis while it holds it, N.
        normal: unit vector out of the axis to where the tip takes hold. gripper:
            gripper that holds it.
    """

    center: Place
    axis: Place
    force: float
    normal: Place
    gripper: str


class TaskBuilder:
    """Builder of a task's trajectory, phase by phase.

    Args:
        start: place at the beginning, m. limits: flight limits of motions. setting:
            flight data.

    Attributes:
        at: place, m. time: s. begun: beginning of the present phase, s.
        handled: beginning of the last dwell and the instant at which its load is taken
            or left, s.
        normal: unit vector out of the surface that the task touches. speed: approach
            speed of the tip, m/s.
        force: last contact force, N.
        arc: arc of the handle that is held. known_arc: arc of the last handle that was.
    """

    def __init__(self, start: Place, limits: FlightLimits, setting: Setting) -> None:
        self.start = self.at = start
        self.time = self.begun = 0.0
        self.handled = 0.0, 0.0
        self.setting = setting
        self.normal: Place | None = None
        self.speed: float | None = None
        self.force: float | None = None
        self.arc: Arc | None = None
        self.known_arc: Arc | None = None
        self._grips: list[tuple[float, float, float]] = []
        self._limits = limits
        self._pieces: list[tuple[Points, tuple[float, ...]]] = []
        self._turns: list[tuple[Turning, ...]] = []
        self._forces: list[tuple[float, float, float]] = []
        self._strays = self._back = False
        self._window = 0.0, 0.0
        # number of the last phase that pressed; -2 is before any, also before the first
        self._pressed = -2

    def begin(self, phase: Fields) -> None:
        """Begin a phase of the task; a phase with a start time first holds the last
        pose until then.
        """
        if phase.states("start"):
            start = number_within(phase, "start", low=0.0)
            if start < self.time:
                allowed = (
                    f"must be at or after {self.time:.6g} s, the end of the phase"
                    " before"
                )
                raise ValueError(f"{phase.at('start')} = {start:g}: {allowed}")
            self.time = start
        self.begun, self._back = self.time, False

    def end(self, kind: str) -> None:
        """End the present phase of the task and record its planned end time."""
        self.setting.phases.append(
            Phase(name=kind, end=self.time, back=self._window if self._back else None)
        )

    def rest(self, duration: float) -> None:
        """Add a rest of ``duration`` seconds."""
        self.time += duration

    def go(
        self, points: Points, duration: float | None = None, *, back: bool = False
    ) -> None:
        """Add a minimum-snap motion through points to the task.

        Args:
            points: positions from where the task stands on, m.
            duration: s; as fast as the limits let if left out.
            back: True to take an offset of the reference back on the way.
        """
        begun = self.time
        stays = len(points) == 2 and _apart(points[0], points[1]) < SHORTEST
        if not stays:
            times = allocate(points, self._limits, self.setting.gravity)
            if duration is not None:
                # the shares of the pieces stay, and with them the shape of the motion
                times = tuple(t * (duration / times[-1]) for t in times)
            self._pieces.append((points, tuple(self.time + t for t in times)))
            self.time, self.at = self.time + times[-1], points[-1]
        if back and self._strays:
            # a reference that stays still needs time to come back to its plan
            if stays:
                self.time = max(self.time, begun + COMING_BACK)
            self._window = (begun, self.time)
            self._back, self._strays = True, False

    def go_through(
        self, phase: Fields, goal: Place, *, back: bool = True, new: bool = True
    ) -> None:
        """Add the motion of a task phase to its goal, through its intermediate points.

        Args:
            phase: table of the phase.
            goal: position at the end, m.
            back: True to take an offset of the reference back on the way.
            new: True if each place must differ from the one before, even without
                ``via``.
        """
        via = points_of(phase.take("via", []), phase.at("via"))
        duration = duration_of(phase)
        if new or via:
            names = [f"{phase.at('via')}[{i}]" for i in range(len(via))]
            require_way(self.at, [*via, goal], [*names, phase.at("position")])
        self.go([self.at, *via, goal], duration, back=back)
        self.wait_until(phase)

    def turn(self, turning: Sequence[Turning], to: Place, duration: float) -> None:
        """Add a rotation about an axis to the task, given by one signal for each
        coordinate.
        """
        self._turns.append(tuple(turning))
        self.time, self.at = self.time + duration, to

    @property
    def follows_a_press(self) -> bool:
        """True if the previous phase of the task pressed on a surface."""
        return self._pressed == len(self.setting.phases) - 1

    def press(self, begin: float, end: float) -> None:
        """Request the task's contact force between two planned times (s).

        The force of the phase before holds until then.
        """
        if self.force is None or self.normal is None:
            raise AssertionError("a force needs its size and direction")
        # it holds on while the tip rests between two phases
        if self._forces and self.follows_a_press:
            self._forces[-1] = (self._forces[-1][0], begin, self._forces[-1][2])
        self._forces.append((begin, end, self.force))
        self._pressed = len(self.setting.phases)

    def grip(self, arc: Arc) -> None:
        """Record that the tip holds a handle from the time at which the gripper
        closes.
        """
        self.arc = self.known_arc = arc
        self._grips.append((self.handled[1], math.inf, arc.force))

    def let_go(self, gripper: str) -> None:
        """Record that the tip releases the handle if the gripper that opens is the one
        that holds it.
        """
        if self.arc is not None and self.arc.gripper == gripper:
            self._grips[-1] = (self._grips[-1][0], self.handled[1], self.arc.force)
            self.arc = None

    def wait_until(self, phase: Fields, usual: Mapping[str, Any] | None = None) -> None:
        """Let the reference wait at the present position until the condition that ends
        the phase is met.
        """
        until = guard_from(phase, self.normal, usual)
        if until is None:
            return
        guard = Guard(
            at=self.time,
            begin=min(self.begun, self.time),
            phase=len(self.setting.phases),
            **until,
        )
        self.setting.guards.append(guard)
        self._strays = self._strays or guard.early

    def motion(self) -> Trajectory:
        """Trajectory of the whole task from its phases."""
        axes: list[Signal] = []
        for axis in range(3):
            parts: list[Signal] = [Constant(self.start[axis])]
            for points, times in self._pieces:
                # an axis along which nothing moves needs no spline
                if any(p[axis] != points[0][axis] for p in points):
                    parts.append(
                        minimum_snap(times, [p[axis] - points[0][axis] for p in points])
                    )
            parts += [turning[axis] for turning in self._turns]
            axes.append(Sum(tuple(parts)))
        x, y, z = axes
        self._tell_push()
        return Trajectory(x=x, y=y, z=z)

    def _tell_push(self) -> None:
        """Store the desired contact force of all phases of the task."""
        if not self._forces and not self._grips:
            return
        if self.setting.pushes:
            raise ValueError(
                "reference: two tasks whose phases press or grip do not add"
            )
        pieces = [_during(f, a + EDGE, b + EDGE) for a, b, f in self._forces]
        pieces += [_during(f, a, b) for a, b, f in self._grips if f]
        arc, normal = self.known_arc, self.normal
        held: dict[str, Any] = {}
        if arc is not None:
            normal = normal or arc.normal
            grip = Sum(tuple(_during(1.0, a, b) for a, b, _ in self._grips))
            held = {"grip": grip, "pivot": arc.center, "axis": arc.axis}
        if normal is None:
            raise AssertionError("a force needs a direction")
        self.setting.pushes.append(
            TipPush(
                force=Sum(tuple(pieces)) if pieces else Constant(0.0),
                normal=normal,
                speed=self.speed or SPEED,
                **held,
            )
        )


def _during(value: float, begin: float, end: float) -> Windowed:
    """Signal that is constant between two times (s) and zero outside."""
    return Windowed(Constant(value), begin, end)


def _apart(a: Place, b: Place) -> float:
    return max(abs(p - q) for p, q in zip(a, b, strict=True))


def require_field(
    fields: Fields, name: str, value: Scalars, earlier: Scalars | None, words: str
) -> None:
    """Refuse a value of a task phase that contradicts an earlier phase."""
    # vectors that a file states are rounded, and their lengths, too
    if earlier is not None and any(
        not math.isclose(a, b, abs_tol=1e-9)
        for a, b in zip(value, earlier, strict=True)
    ):
        raise ValueError(
            f"{fields.at(name)} = {shown(list(value) if len(value) > 1 else value[0])}:"
            f" {words}"
        )
