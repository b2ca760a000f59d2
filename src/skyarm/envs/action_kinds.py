"""Action spaces of the learning environments: conversion of numbers in [-1, 1] to
vehicle commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import clip, maximum
from skyarm.control.controller import with_correction
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command, mix
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.actuators.rotor import speed_of_push
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.records.units import nonnegative, positive
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Joint, Vehicle

Decision = tuple[Tree, Command]
"""Result of the scenario's law: (next memory, command)."""

Decide = Callable[[Tree, Measurement, Reference], Decision]
"""Control law of the scenario as a function (memory, measurement, reference) -> (next
memory, command)."""


class Turn(NamedTuple):
    """Control law, measurement and reference with which an action is converted to a
    vehicle command.

    Attributes:
        memory: law's memory, ``()`` where it is not used. measurement, reference: law's
            inputs of the period.
        law: scenario's law. par: its constants, with the model. setpoints: True for
            joints commanded by setpoints.
    """

    memory: Tree
    measurement: Measurement
    reference: Reference
    law: Decide
    par: Any
    setpoints: tuple[bool, ...]

    @property
    def model(self) -> Model:
        """Nominal vehicle model of the scenario's control law."""
        model: Model = self.par.model
        return model


USUAL_EFFORT = 0.5
"""Default range (N m, N, rad or m) of a joint without a limit at an action of 1."""


@immutable
class Actions:
    """Base class of action spaces, whose subclasses convert an action to a vehicle
    command.

    Attributes:
        joints: setpoint of every joint at full action, in its unit: N m or N of a joint
            that takes its effort, else rad or m. None takes the effort limit, or the
            joint's range from end to end, and 0.5 where there is none. A joint without
            an effort, a passive one, has its number, too, which does nothing.
    """

    joints: Annotated[
        float | None,
        nonnegative(
            "N m, N, rad or m",
            "setpoint of a joint at an action of 1",
            effect="higher values give the policy more authority over the arm",
        ),
    ] = None

    asks_law = False
    """True if the scenario's law is called."""

    def __post_init__(self) -> None:
        accept_fields(self, type(self).__name__)

    def size(self, vehicle: Vehicle) -> int:
        """Number of components of an action for a vehicle."""
        return len(vehicle.rotors) + vehicle.n

    def command(self, action: Scalars, now: Turn) -> Decision:
        """Convert an action to a vehicle command; return the control law's next
        internal state and the command.

        Args:
            action: (size,) numbers in [-1, 1].
            now: all other inputs of the period.
        """
        raise NotImplementedError(f"{type(self).__name__} must define command()")

    def efforts(self, action: Scalars, now: Turn) -> Scalars:
        """Joint efforts, or setpoints of joint drives, commanded by the last components
        of an action.
        """
        return tuple(middle + a * half for a, (middle, half) in self.spans(action, now))

    def spans(
        self, action: Scalars, now: Turn
    ) -> list[tuple[Scalar, tuple[Scalar, Scalar]]]:
        """Action component of each joint, with the setpoint at zero action and its
        change at full action.
        """
        links = now.model.vehicle.links
        spans = [
            self._span(link.joint, setpoint)
            for link, setpoint in zip(links, now.setpoints, strict=True)
        ]
        # an action ends with the joints
        return list(zip(action[len(action) - len(links) :], spans, strict=True))

    def _span(self, joint: Joint, setpoint: bool) -> tuple[Scalar, Scalar]:
        if self.joints is not None:
            return 0.0, self.joints
        if setpoint:
            return middle_and_half(joint.lower, joint.upper)
        limit = joint.effort_limit
        # a limit of 0 is a passive joint's: its number does nothing, but has a scale
        if concrete(limit) and 0.0 < limit < math.inf:
            return 0.0, float(limit)
        return 0.0, USUAL_EFFORT


_AUTHORITY = (
    "higher values give the policy more authority and make first flights wilder"
)

HoverShare = Annotated[
    float,
    positive(
        "",
        "change of rotor speed at an action of 1, as a fraction of the hover speed",
        effect=_AUTHORITY,
    ),
]


@immutable
class RotorsAndJoints(Actions):
    """Action space of rotor speeds relative to hover, then joint setpoints.

    Attributes:
        span: share of the model's hover speed that a full action adds or subtracts.
    """

    span: HoverShare = 0.2

    def command(self, action: Scalars, now: Turn) -> Decision:
        """Vehicle command with rotor speeds around hover and joint setpoints, within
        their limits.
        """
        speeds = tuple(
            w * (1.0 + self.span * a)
            # behind those of the rotors stand the numbers of the joints
            for w, a in zip(_hover(now.model), action, strict=False)
        )
        return now.memory, within_limits(now, speeds, self.efforts(action, now))


@immutable
class RatesAndThrust(Actions):
    """Action space of body rates and thrust for a built-in rate controller, then joint
    setpoints.

    Attributes:
        rate: body rate at full action, rad/s. thrust: share of the weight that a full
            action adds or takes.
        bandwidth: bandwidth of the rate controller, 1/s.
    """

    rate: Annotated[
        float, positive("rad/s", "body rate at an action of 1", effect=_AUTHORITY)
    ] = 4.0
    thrust: Annotated[
        float,
        positive(
            "",
            "change of thrust at an action of 1, as a fraction of the weight",
            effect=_AUTHORITY,
        ),
    ] = 0.8
    bandwidth: Annotated[
        float,
        positive(
            "1/s",
            "bandwidth of the rate controller",
            effect="higher values follow the action faster and amplify noise",
        ),
    ] = 20.0

    def size(self, vehicle: Vehicle) -> int:
        """Number of action components: three body rates, thrust, and one for each
        joint.
        """
        return 4 + vehicle.n

    def command(self, action: Scalars, now: Turn) -> Decision:
        """Vehicle command of a proportional body-rate controller for the desired rates
        and thrust.
        """
        model = now.model
        missing = Vec3(*(self.rate * a for a in action[:3])) - now.measurement.rate
        # of the base alone: the arm's inertia and gyroscopic torques are left to the
        # policy
        torque = model.vehicle.base.inertia.apply(missing * self.bandwidth)
        weight = model.vehicle.mass * model.gravity
        speeds, squares = mix(
            now.par.mixer, torque, weight * (1.0 + self.thrust * action[3])
        )
        # the mixer counts on thrust by squared speed; a table has its own speed for it
        if any(rotor.table is not None for rotor in model.vehicle.rotors):
            rows = zip(model.vehicle.rotors, squares, strict=True)
            speeds = tuple(
                # what would be a pull counts as no thrust
                speed_of_push(rotor, maximum(square, 0.0))
                for rotor, square in rows
            )
        return now.memory, within_limits(now, speeds, self.efforts(action, now))


@immutable
class References(Actions):
    """Action space of offsets added to the control law's reference: base position, then
    joint positions.

    Attributes:
        position: offset at full action, m, world axes. angle: offset of a joint at full
            action, rad or m.
    """

    position: Annotated[
        float,
        positive("m", "displacement of the position reference at an action of 1"),
    ] = 0.5
    angle: Annotated[
        float,
        positive("rad or m", "displacement of a joint reference at an action of 1"),
    ] = 0.5

    asks_law = True

    def size(self, vehicle: Vehicle) -> int:
        """Number of action components: three base coordinates, and one for each
        joint.
        """
        return 3 + vehicle.n

    def command(self, action: Scalars, now: Turn) -> Decision:
        """Vehicle command of the control law for the reference plus the action's
        position offsets.
        """
        reference = now.reference
        position = reference.position + Vec3(*(self.position * a for a in action[:3]))
        joints = tuple(
            q + self.angle * a
            for q, a in zip(reference.joints, action[3:], strict=True)
        )
        tip = tuple(
            p + self.position * a
            # a vehicle without a tip has no reference of one
            for p, a in zip(reference.tip, action[:3], strict=False)
        )
        shifted = replace(
            # a preview of the path without the offset would contradict it
            reference,
            position=position,
            joints=joints,
            tip=tip,
            ahead=(),
        )
        return now.law(now.memory, now.measurement, shifted)


@immutable
class Residual(Actions):
    """Action space of corrections added to the control law's command: rotor speeds,
    then joint setpoints.

    A law that remembers its command, in any layers, receives the command that was sent.

    Attributes:
        span: share of the model's hover speed at full action.
    """

    span: HoverShare = 0.1

    asks_law = True

    def command(self, action: Scalars, now: Turn) -> Decision:
        """Vehicle command of the control law plus the action's corrections, within the
        actuators' limits.
        """
        following, own = now.law(now.memory, now.measurement, now.reference)
        # rotors come first in an action, and then joints
        pairs = zip(own.rotor_speeds, _hover(now.model), action, strict=False)
        speeds = tuple(w + self.span * hover * a for w, hover, a in pairs)
        rows = zip(own.efforts, self.spans(action, now), strict=True)
        # the law's command takes the place of the middle of the range
        efforts = tuple(u + a * half for u, (a, (_, half)) in rows)
        # rotor angles are the law's own; no action corrects them
        sent = replace(within_limits(now, speeds, efforts), tilts=own.tilts)
        return with_correction(following, now.par, own, sent), sent


ACTIONS: dict[str, type[Actions]] = {
    "rotors_and_joints": RotorsAndJoints,
    "rates_and_thrust": RatesAndThrust,
    "references": References,
    "residual": Residual,
}
"""Kinds of actions by name; a name alone selects the default numbers."""


def middle_and_half(lower: Scalar, upper: Scalar) -> tuple[Scalar, Scalar]:
    """Centre and half width of a joint's range, with a default distance for a missing
    limit.
    """
    if _free(-lower) and _free(upper):
        return 0.0, USUAL_EFFORT
    # one end is enough for a range of the usual width
    low = upper - 2.0 * USUAL_EFFORT if _free(-lower) else lower
    high = lower + 2.0 * USUAL_EFFORT if _free(upper) else upper
    return (low + high) * 0.5, (high - low) * 0.5


def within_limits(now: Turn, speeds: Scalars, efforts: Scalars) -> Command:
    """Vehicle command clipped to the limits of rotor speeds and joint efforts."""
    vehicle = now.model.vehicle
    turned = tuple(
        clip(w, rotor.min_speed, rotor.max_speed)
        for w, rotor in zip(speeds, vehicle.rotors, strict=True)
    )
    rows = zip(efforts, vehicle.links, now.setpoints, strict=True)
    limited = tuple(
        (
            u
            if setpoint or _free(link.joint.effort_limit)
            else clip(u, -link.joint.effort_limit, link.joint.effort_limit)
        )
        for u, link, setpoint in rows
    )
    return Command(rotor_speeds=turned, efforts=limited)


def _free(limit: Scalar) -> bool:
    return concrete(limit) and limit == math.inf


def _hover(model: Model) -> Scalars:
    """Rotor speeds (rad/s) of the nominal model in hover with all joints at zero."""
    return hover_trim(model.vehicle, model.vehicle.zeros, model.gravity).speeds
