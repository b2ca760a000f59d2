"""What the exact law remembers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.exact.disturbance import Disturbance
from skyarm.scalars import Scalar, where


def data(value: Any) -> Any:
    """A structural number as data: a memory keeps its shape whatever the reference folds to."""
    return float(value) if type(value) is int else value


def vector_data(v: Vec3) -> Vec3:
    """:func:`data` of a vector."""
    return Vec3(*(data(c) for c in v))


def choose(condition: Any, a: Vec3, b: Vec3) -> Vec3:
    """Vector ``a`` where the condition holds, else ``b``."""
    return Vec3(*(where(condition, data(x), data(y)) for x, y in zip(a, b, strict=True)))


def choose_each(condition: Any, a: tuple[Any, ...], b: tuple[Any, ...]) -> tuple[Any, ...]:
    """Entries of ``a`` where the condition holds, else those of ``b``."""
    return tuple(where(condition, data(x), data(y)) for x, y in zip(a, b, strict=True))


@dataclass(frozen=True, kw_only=True, slots=True)
class Channel:
    """The last sample of one reference signal, the accelerations before it, and how many of them are of one motion."""

    value: Scalar = 0.0
    rate: Scalar = 0.0
    acceleration: Scalar = 0.0
    before: Scalar = 0.0
    earlier: Scalar = 0.0
    count: Scalar = 0.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Observed:
    """Memory of the disturbance observer, at the time of the last measurement.

    Attributes:
        position, quaternion, joints: filtered.
        velocity, rate, joint_rates: estimates.
        force: N, world axes, at the base origin. torque: N m, base axes. efforts: of the joints.
        rotor_speeds: of the modelled motors, rad/s.
    """

    position: Vec3
    quaternion: Quaternion
    joints: tuple[Scalar, ...]
    velocity: Vec3
    rate: Vec3
    joint_rates: tuple[Scalar, ...]
    force: Vec3
    torque: Vec3
    efforts: tuple[Scalar, ...]
    rotor_speeds: tuple[Scalar, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Heard:
    """Planned signals of one joint: torque of 1 kg at the tip (N m/kg), position (rad or m), rate."""

    load: Scalar
    place: Scalar
    rate: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class JointLearned:
    """What is learned of one joint.

    Attributes:
        damping: beyond the model's, N m s/rad or N s/m.
        level, slope: of the observer's effort what is constant, N m or N, and what goes with the position, per rad or
            m. once, twice: planned signals after one and two stages of the observer's lag.
        moving, off: mean squares of the planned rate and of what the joint's own is off.
    """

    damping: Scalar
    level: Scalar
    slope: Scalar
    once: Heard
    twice: Heard
    moving: Scalar
    off: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Learned:
    """What is learned slowly, and what it pushes with one period after it was found.

    Attributes:
        tip_mass: kg, beyond the model's. joints: of each.
        fed: forward, as a disturbance that is known.
    """

    tip_mass: Scalar
    joints: tuple[JointLearned, ...]
    fed: Disturbance


@dataclass(frozen=True, kw_only=True, slots=True)
class ExactMemory:
    """Everything between two steps.

    Attributes:
        started: 0 before the first measurement.
        age: s since the held reference sample appeared. channels: its signals: x, y, z, yaw, joints.
        observed: of the observer.
        sent: the last commands, oldest first, one more than the delay has periods.
        obeyed: 1 for the rotors and each joint whose last command was sent as wished.
        free: 1 while no actuator was at its limit.
        slow_force: the observer's force, slowly filtered, N.
        trim: added to the squared speeds that the mixer asks for, (rad/s)^2.
        learned: of a load at the tip and of friction.
    """

    started: Scalar
    age: Scalar
    channels: tuple[Channel, ...]
    observed: Observed
    sent: tuple[Command, ...]
    obeyed: tuple[Scalar, ...]
    free: tuple[Scalar, ...]
    slow_force: Vec3
    trim: tuple[Scalar, ...]
    learned: Learned
