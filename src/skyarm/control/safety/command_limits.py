"""Rotor speeds that the rotors can turn at: thrust, roll and pitch before yaw, whatever mixer the law has."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.actuation import AllocationError, Command, Mixer, allocation_matrix, make_mixer, mix
from skyarm.algebra import ZERO3, Vec3
from skyarm.control.model import Model
from skyarm.scalars import Scalar, add, clip, logical_or, mul, sqrt, sub, where


def with_priorities(model: Model, mixer: Mixer) -> Mixer:
    """Return the mixer with priorities, if the rotors allow them: then a demand is ranked before it is cut off.

    A law that ranks demands already, in whatever order, keeps its own.
    """
    if mixer.policy != "clip":
        return mixer
    try:
        make_mixer(model.vehicle, "priority")
    except AllocationError:
        return mixer
    return dataclasses.replace(mixer, policy="priority")


def reachable(model: Model, mixer: Mixer, speeds: Sequence[Scalar]) -> tuple[Any, ...]:
    """Return speeds within the rotors' limits: torque and thrust of the given ones mixed again where one is beyond.

    A law that commands more than it wants, to undo the motors' lag, may ask for such speeds with any mixer.
    """
    beyond: Any = False
    for speed, top in zip(speeds, mixer.highest, strict=True):
        beyond = logical_or(beyond, speed > sqrt(top))
    pushes: list[Any] = []
    sideways = bool(mixer.across)
    for row in allocation_matrix(model.vehicle, sideways):
        total: Any = 0
        for entry, speed in zip(row, speeds, strict=True):
            total = add(total, mul(entry, speed * speed))
        pushes.append(total)
    across = Vec3(pushes[4], pushes[5], 0) if sideways else ZERO3
    again, _ = mix(mixer, Vec3(*pushes[:3]), pushes[3], across)
    return tuple(where(beyond, new, old) for new, old in zip(again, speeds, strict=True))


def limit_slew(
    command: Command, last: Command, started: Any, rotor_slew: Any, effort_slew: Sequence[Any], dt: Any
) -> Command:
    """Return the command no farther from the last one than the slew limits allow; the first one is free."""

    def near(value: Any, before: Any, slew: Any) -> Any:
        step = mul(slew, dt)
        return where(started > 0.5, clip(value, sub(before, step), add(before, step)), value)

    return Command(
        rotor_speeds=tuple(
            near(w, old, rotor_slew) for w, old in zip(command.rotor_speeds, last.rotor_speeds, strict=True)
        ),
        efforts=tuple(
            near(t, old, slew) for t, old, slew in zip(command.efforts, last.efforts, effort_slew, strict=True)
        ),
    )
