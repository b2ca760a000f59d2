"""Reference trajectory of base, joints and tip, and its sample at one instant.

A publisher samples it at one rate and holds each sample for a controller that runs at
another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any, TypeVar

import numpy as np

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.records import coerce
from skyarm.records.arrays import AnyArray, Array
from skyarm.records.field_rules import checked
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import parts
from skyarm.records.path_names import Names, field_paths
from skyarm.records.units import Unit
from skyarm.reference.motion_names import motion_names
from skyarm.reference.planned_motion import PlannedBody
from skyarm.reference.signals import (
    Constant,
    Shifted,
    Signal,
    Sine,
    Windowed,
    switch_times,
    with_signals,
)
from skyarm.reference.task_records import Guard, Phase
from skyarm.reference.tip_motion import STILL, TipMotion, TipPush, vector_derivatives


@immutable
@checked("reference", often=True)
class Reference:
    """Desired motion at one instant, or at many instants with arrays in place of
    numbers.

    ``tip`` is empty where the tip has no reference of its own: then it is where a level
    base on reference carries it. ``push`` is empty where no contact is ever requested;
    else force (N), speed (m/s), unit normal and more
    (:class:`skyarm.reference.tip_motion.TipPush`). ``load`` is empty where nothing is
    ever held; else a number, above 0.5 while the tip has to hold a load. ``center`` is
    empty but in a plan, and ``turning`` but in one that the law follows as a whole.
    ``ahead`` is empty without a preview (:mod:`skyarm.reference.preview`), which
    ``turning`` has, too. ``carry`` is empty without a team's law
    (:class:`skyarm.reference.carry.Carry`).
    """

    position: Annotated[
        Vec3, Unit("m", "desired position of the base origin, world axes")
    ] = ZERO3
    velocity: Annotated[
        Vec3, Unit("m/s", "desired velocity of the base origin, world axes")
    ] = ZERO3
    acceleration: Annotated[
        Vec3, Unit("m/s^2", "desired acceleration of the base origin, world axes")
    ] = ZERO3
    jerk: Annotated[
        Vec3, Unit("m/s^3", "desired jerk of the base origin, world axes")
    ] = ZERO3
    snap: Annotated[
        Vec3, Unit("m/s^4", "desired snap of the base origin, world axes")
    ] = ZERO3
    yaw: Annotated[Scalar, Unit("rad", "desired heading about world z")] = 0
    yaw_rate: Annotated[Scalar, Unit("rad/s", "desired rate of the heading")] = 0
    yaw_acceleration: Annotated[
        Scalar, Unit("rad/s^2", "desired acceleration of the heading")
    ] = 0
    joints: Annotated[
        Scalars, Unit("rad or m", "desired joint positions, in the vehicle's order")
    ] = ()
    joint_rates: Annotated[
        Scalars, Unit("rad/s or m/s", "desired joint rates, in the vehicle's order")
    ] = ()
    joint_accelerations: Annotated[
        Scalars,
        Unit("rad/s^2 or m/s^2", "desired joint accelerations, in the vehicle's order"),
    ] = ()
    joint_jerks: Annotated[
        Scalars, Unit("rad/s^3 or m/s^3", "desired joint jerks, in the vehicle's order")
    ] = ()
    joint_snaps: Annotated[
        Scalars, Unit("rad/s^4 or m/s^4", "desired joint snaps, in the vehicle's order")
    ] = ()
    tip: Annotated[
        Scalars,
        Unit(
            "m", "desired position of the tip, world axes; empty: that of a level base"
        ),
    ] = ()
    push: Annotated[
        Scalars,
        Unit(
            "",
            "desired contact: N, m/s, unit normal in world axes; grip, pivot (m) and"
            " axis",
        ),
    ] = ()
    load: Annotated[Scalars, Unit("", "above 0.5 while the tip must hold a load")] = ()
    center: Annotated[
        Scalars,
        Unit(
            "",
            "planned centre of mass, m, world axes, with four derivatives; empty: that"
            " of a level base",
        ),
    ] = ()
    turning: Annotated[
        Scalars,
        Unit(
            "",
            "planned quaternion and rotor speeds (rad/s), then their derivatives;"
            " empty: no plan",
        ),
    ] = ()
    ahead: Annotated[
        Scalars,
        Unit("", "preview samples: value, rate and acceleration of each signal"),
    ] = ()
    carry: Annotated[
        Scalars, Unit("", "part of a load that the tip takes over; empty: none")
    ] = ()

    def map_scalars(self, function: Callable[[Scalar], Scalar]) -> Reference:
        """Copy of the reference with a function applied to every number."""
        values: dict[str, Any] = {}
        for name, value in parts(self).items():
            if isinstance(value, Vec3):
                values[name] = Vec3(*map(function, value))
            elif isinstance(value, tuple):
                values[name] = tuple(map(function, value))
            else:
                values[name] = function(value)
        return Reference(**values)

    def dense(self) -> Reference:
        """Copy of the reference with all integers as floats, so that one compiled
        program fits every reference.
        """
        return self.map_scalars(
            lambda value: float(value) if isinstance(value, int | float) else value
        )


VECTORS = ("position", "velocity", "acceleration", "jerk", "snap")
"""Fields of the base position and its first four derivatives."""

JOINTS = ("joints", "joint_rates", "joint_accelerations", "joint_jerks", "joint_snaps")
"""Fields of the joint positions and their first four derivatives."""


@immutable
@checked("trajectory")
class Trajectory:
    """Desired motion over time: signals of base position, heading and joints, with
    optional tip and contact.

    With a ``tip`` the base is where it carries that tip
    (:mod:`skyarm.reference.tip_motion`), moved by the signals ``x``, ``y``, ``z``. A
    ``push`` requests contact, a ``load`` defines when the tip has to hold one. With
    ``guards`` it waits for the flight (:mod:`skyarm.simulate.reference_clock`);
    ``phases`` are those of its task.
    """

    x: Annotated[Signal, Unit("m", "desired x of the base origin, world axes")] = STILL
    y: Annotated[Signal, Unit("m", "desired y of the base origin, world axes")] = STILL
    z: Annotated[Signal, Unit("m", "desired z of the base origin, world axes")] = STILL
    yaw: Annotated[Signal, Unit("rad", "desired heading about world z")] = STILL
    joints: Annotated[
        tuple[Signal, ...],
        Unit("rad or m", "desired joint positions, in the vehicle's order"),
    ] = ()
    tip: TipMotion | None = field_if_any(default=None)
    push: TipPush | None = field_if_any(default=None)
    load: Annotated[Signal | None, Unit("", "above 0.5 while the tip holds a load")] = (
        field_if_any(default=None)
    )
    planned: PlannedBody | None = field_if_any(default=None)
    guards: tuple[Guard, ...] = field_if_any(default=())
    phases: tuple[Phase, ...] = field_if_any(default=())

    def path_names(self) -> Names:
        """Names, in parameter paths, of the fields that are set and of the base
        motion's parameters.
        """
        names = field_paths(self) | {"base": motion_names(self.x, self.y, self.z)}
        # base is the name of a table, not an attribute: it stays
        return {
            name: places
            for name, places in names.items()
            if getattr(self, name, self) is not None
        }

    def at(self, t: Scalar) -> Reference:
        """Reference at time t (s): position, heading and joints with derivatives, and
        contact request.
        """
        base = vector_derivatives((self.x, self.y, self.z), t)
        heading = self.yaw.derivatives(t)
        yaw, yaw_rate, yaw_acceleration, _, _ = heading
        q = (
            tuple(zip(*(k.derivatives(t) for k in self.joints), strict=True))
            or ((),) * 5
        )
        tip: Scalars = ()
        if self.tip is not None:
            carried = self.tip.base(t, heading, q)
            # a motion of the base is added to what the tip's motion takes
            base = tuple(own + more for own, more in zip(carried, base, strict=True))
            tip = tuple(self.tip.path(t)[0])
        # a plan states where the tip will be, with the base's tilt
        if self.planned is not None:
            tip = tuple(signal.derivatives(t)[0] for signal in self.planned.tip)
        moving: dict[str, Any] = dict(
            zip((*VECTORS, *JOINTS), (*base, *q), strict=True)
        )
        return Reference(
            **moving,
            yaw=yaw,
            yaw_rate=yaw_rate,
            yaw_acceleration=yaw_acceleration,
            tip=tip,
            push=() if self.push is None else self.push.at(t),
            load=() if self.load is None else (self.load.derivatives(t)[0],),
            center=() if self.planned is None else self.planned.center_at(t),
            turning=() if self.planned is None else self.planned.turning_at(t),
        )

    def switch_times(self) -> tuple[float, ...]:
        """List the times (s), in order, at which the trajectory or one of its
        derivatives may jump.
        """
        return switch_times(self)

    def with_joints(self, *joints: Signal | float) -> Trajectory:
        """Copy of the trajectory with other joint signals; a number is a constant
        signal.
        """
        return replace(self, joints=signals(joints))

    def shifted(self, delay: Scalar) -> Trajectory:
        """Copy of the trajectory that is ``delay`` seconds later."""
        moved = with_signals(self, lambda signal: Shifted(signal, delay))
        if not self.guards:
            return moved
        later = float(delay)
        guards = tuple(
            replace(each, at=each.at + later, begin=each.begin + later)
            for each in self.guards
        )
        return replace(
            moved,
            guards=guards,
            phases=tuple(each.later(later) for each in self.phases),
        )

    @property
    def returns(self) -> tuple[tuple[float, float], ...]:
        """Time intervals (s) of the task phases in which a position offset returns to
        zero.
        """
        return tuple(phase.back for phase in self.phases if phase.back is not None)

    def __add__(self, other: Trajectory) -> Trajectory:
        """Return the sum of two trajectories."""
        if self.joints and other.joints and len(self.joints) != len(other.joints):
            raise ValueError(
                f"trajectories of {len(self.joints)} and {len(other.joints)} joints do"
                " not add"
            )
        # one of both may have no joints
        joints = (
            tuple(a + b for a, b in zip(self.joints, other.joints, strict=False))
            or self.joints
            or other.joints
        )
        for name in ("tip", "push", "load", "planned"):
            if getattr(self, name) is not None and getattr(other, name) is not None:
                raise ValueError(f"two trajectories that each have a {name} do not add")
        return Trajectory(
            **{
                name: getattr(self, name) + getattr(other, name)
                for name in ("x", "y", "z", "yaw")
            },
            **{
                name: getattr(self, name) or getattr(other, name)
                for name in ("tip", "push", "load", "planned")
            },
            joints=joints,
            guards=tuple(
                sorted((*self.guards, *other.guards), key=lambda guard: guard.at)
            ),
            phases=tuple(
                sorted((*self.phases, *other.phases), key=lambda phase: phase.end)
            ),
        )


def resting_arm(joints: int) -> dict[str, Any]:
    """Joint fields of a reference in which a given number of joints rests at zero."""
    return dict.fromkeys(JOINTS, (0.0,) * joints)


def signals(values: Sequence[Signal | Any]) -> tuple[Signal, ...]:
    """Convert numbers in a list of time signals to constant signals."""
    return tuple(
        value if isinstance(value, Signal) else Constant(value) for value in values
    )


def hover(
    position: Sequence[Scalar],
    *,
    yaw: Scalar = 0.0,
    joints: Sequence[Signal | Scalar] = (),
) -> Trajectory:
    """Make a trajectory at a constant position (m) and heading (rad), with optional
    joint signals.

    Args:
        position: position of the base, m, world.
        yaw: rad.
        joints: signals or numbers, one for each joint.
    """
    place = coerce.items("hover.position", position, (3,), "must be three numbers")
    x, y, z, heading = signals((*place, yaw))
    followed = coerce.items(
        "hover.joints", joints, None, "must be signals or numbers, one per joint"
    )
    return Trajectory(x=x, y=y, z=z, yaw=heading, joints=signals(followed))


def circle(
    *,
    radius: Scalar,
    frequency_hz: Scalar,
    center: Sequence[Scalar],
    start: Scalar = -math.inf,
    stop: Scalar = math.inf,
    yaw: Scalar = 0.0,
    joints: Sequence[Signal | Scalar] = (),
) -> Trajectory:
    """Make a horizontal circular trajectory within [start, stop), at the centre
    otherwise.

    It begins with a step: x = radius cos(2 pi f (t - start)), y = radius sin(...), as
    in the paper's Case 3. Without a ``start`` the angle counts from t = 0.

    Args:
        radius: m.
        frequency_hz: turns per second; negative turns clockwise.
        center: m, world.
        start: s.
        stop: s.
        yaw: rad.
        joints: signals or numbers.
    """
    # a start of minus infinity would make every angle infinite
    origin = 0.0 if isinstance(start, float) and math.isinf(start) else start
    motion = [
        Windowed(
            Shifted(
                Sine(amplitude=radius, frequency_hz=frequency_hz, phase=phase), origin
            ),
            start,
            stop,
        )
        for phase in (math.pi / 2.0, 0.0)
    ]
    at_center = hover(center, yaw=yaw, joints=joints)
    return replace(at_center, x=at_center.x + motion[0], y=at_center.y + motion[1])


Tick = TypeVar("Tick", int, AnyArray)


@immutable
class Publisher:
    """Zero-order hold of a reference that is sampled at a lower rate than the control
    rate.

    Attributes:
        control_rate: Hz, of the controller's ticks.
        reference_rate: Hz, of the samples; divides the control rate.
    """

    control_rate: float
    reference_rate: float

    def __post_init__(self) -> None:
        for name in ("control_rate", "reference_rate"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(
                    f"{name} = {value!r}: must be a finite number of Hz above 0"
                )
        quotient = self.control_rate / self.reference_rate
        # 1e-9: rates such as 1000/3 Hz are given rounded
        if round(quotient) < 1 or abs(quotient - round(quotient)) > 1e-9 * quotient:
            raise ValueError(
                f"reference_rate = {self.reference_rate!r}: must divide control_rate ="
                f" {self.control_rate!r} Hz"
            )

    @property
    def ratio(self) -> int:
        """Number of control ticks per reference sample."""
        return round(self.control_rate / self.reference_rate)

    def held_tick(self, tick: Tick) -> Tick:
        """Control tick at which the currently held reference sample was taken."""
        return tick // self.ratio * self.ratio

    def held_time(self, tick: Tick) -> Any:
        """Time (s) at which the currently held reference sample was taken."""
        return self.held_tick(tick) / self.control_rate


PASSED = 1e-6
"""Path time (s) beyond the planned end of a phase at which the phase is completed; the
reference may wait at that end."""


def phase_numbers(trajectory: Trajectory, path_time: Scalar) -> Array:
    """Index of the active task phase at given path times (s)."""
    ends = np.array([phase.end + PASSED for phase in trajectory.phases])
    return np.searchsorted(ends, np.asarray(path_time), side="left").astype(float)


def failure_words(trajectory: Trajectory, guard: Guard) -> str:
    """Error text for a task phase whose end condition was not met in time."""
    texts = {
        "force": "no contact of {:g} N",
        "force_below": "force not below {:g} N",
        "closed": "switch '{}' not closed",
        "open": "switch '{}' not open",
        "distance": "not moved by {:g} m",
        "error": "error not below {:g} m",
    }
    values = {name: getattr(guard, name) for name in texts}
    asked = [
        texts[name].format(value)
        for name, value in values.items()
        if value not in (None, "")
    ]
    return (
        f"{phase_words(trajectory, guard)}: {' or '.join(asked)} within"
        f" {float(guard.timeout):g} s"
    )


def phase_words(trajectory: Trajectory, guard: Guard) -> str:
    """Number and name, for messages, of the phase that a condition ends."""
    named = (
        trajectory.phases[guard.phase].name
        if guard.phase < len(trajectory.phases)
        else "guard"
    )
    return f"phase {guard.phase} '{named}'"
