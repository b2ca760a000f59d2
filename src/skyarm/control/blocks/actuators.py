"""Actuator models inside a control law: saturation checks and inversion of the motor
lag.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    add,
    clip,
    divide,
    exp,
    logical_and,
    minimum,
    mul,
    where,
)
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Mixer
from skyarm.vehicle import Rotor, Vehicle


def rotors_follow(mixer: Mixer, squares: Sequence[Scalar]) -> Scalar:
    """True if each squared rotor speed from the mixer lies between zero and the rotor's
    limit.
    """
    inside: Scalar = True
    for square, top in zip(squares, mixer.highest, strict=True):
        fits = logical_and(square >= 0.0, square <= top)
        # True is structure: no operation for the first rotor
        inside = fits if inside is True else logical_and(inside, fits)
    return inside


def all_follow(applied: Sequence[Scalar]) -> Scalar:
    """True if every actuator applied the last command unchanged, from one flag per
    actuator.

    One for all: through the coupled dynamics what one actuator does not do is missing
    from every acceleration.
    """
    unchanged: Scalar = True
    for each in applied:
        unchanged = logical_and(unchanged, each > 0.5)
    return unchanged


def joints_follow(vehicle: Vehicle, efforts: Sequence[Scalar]) -> list[Scalar]:
    """List with True for each joint whose desired effort lies within its limit."""
    return [
        absolute(e) <= joint.effort_limit
        for e, joint in zip(efforts, vehicle.joints, strict=True)
    ]


class ModelHolder(Protocol):
    """Interface (typing.Protocol) of any constants of a control law that contain the
    controller's model.
    """

    @property
    def model(self) -> Model:
        """Nominal model that the controller uses."""


def limit_efforts(par: ModelHolder, efforts: Sequence[Scalar]) -> Scalars:
    """Joint torques clipped to the model's effort limits."""
    limits = [joint.effort_limit for joint in par.model.vehicle.joints]
    return tuple(
        clip(effort, -limit, limit)
        for effort, limit in zip(efforts, limits, strict=True)
    )


def command_for(
    rotor: Rotor, speed: Scalar, desired: Scalar, dt: Scalar, share: Scalar
) -> Scalar:
    """Speed command (rad/s) that brings a lagging rotor to a desired speed at the end
    of the period.

    Args:
        rotor: rotor with its two time constants.
        speed: speed now, rad/s.
        desired: desired speed, rad/s.
        dt: control period, s.
        share: 1 inverts the lag (:func:`skyarm.dynamics.actuators.speed_after`)
            exactly, 0 sends ``desired`` itself.

    Without the inversion noise through two time constants rectifies into thrust.
    """
    # a motor goes no further than its limit, so the change to lead is the one up to
    # there
    target = minimum(desired, rotor.max_speed)
    change = target - speed
    # of both directions, because speeds rise and fall at rates of their own
    rise, fall = (
        divide(1.0, 1.0 - exp(divide(-dt, tau))) - 1.0
        for tau in (rotor.time_constant_up, rotor.time_constant_down)
    )
    return clip(
        target + change * (share * where(change > 0.0, rise, fall)),
        0.0,
        rotor.max_speed,
    )


def compensate_motor_lag(
    rotors: Sequence[Rotor],
    mixer: Mixer,
    force_rate: Vec3,
    squares: Sequence[Scalar],
    dt: Scalar,
    share: Scalar,
) -> Scalars:
    """Squared rotor speeds, (rad/s)^2, advanced in time by the motor lag for a planned
    rate of the force.

    A target that :func:`command_for` is given once a period is followed dt / (1 - (1 -
    share) e) late, e = exp(-dt / tau); without that the mean speed of a period is the
    wanted one at its middle.

    Args:
        rotors: rotors with their time constants.
        mixer: mixer of all six rows, or of four: then of the force along z alone.
        force_rate: planned rate of the force, body axes, N/s.
        squares: squared speed of each rotor, (rad/s)^2.
        dt: control period, s.
        share: share of the lag that commands invert, as in :func:`command_for`.
    """
    ahead = []
    # ints, so that the program has no products with them
    sides = mixer.across or ((0, 0),) * len(rotors)
    for rotor, thrust, across, square in zip(
        rotors, mixer.inverse, sides, squares, strict=True
    ):
        change = add(
            mul(thrust[3], force_rate.z),
            add(mul(across[0], force_rate.x), mul(across[1], force_rate.y)),
        )
        rise, fall = (
            exp(divide(-dt, tau))
            for tau in (rotor.time_constant_up, rotor.time_constant_down)
        )
        ahead.append(
            square
            + change * divide(dt, 1.0 - (1.0 - share) * where(change > 0.0, rise, fall))
        )
    return tuple(ahead)
