"""What a law gives back of the friction that it believes in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.actuation.drive import friction
from skyarm.control.controller import ControllerError
from skyarm.control.model import Parameters
from skyarm.files import number, shown
from skyarm.reference import Reference
from skyarm.scalars import add, mul
from skyarm.sensors.measurement import Measurement


def friction_given_back(par: Parameters, measurement: Measurement, reference: Reference) -> tuple[Any, ...]:
    """Joint torques (N m or N) that make up for friction: a share of the model's, 0 where the law gives none back.

    Viscous friction is taken at the measured rate, Coulomb's at the reference's, which does not chatter. It belongs
    behind the inertia matrix: a joint's own friction moves nothing else.
    """
    shares: Sequence[Any] = par.friction_compensation or (0,) * par.model.vehicle.n
    rows = zip(shares, par.model.vehicle.links, measurement.joint_rates, reference.joint_rates, strict=True)
    return tuple(mul(share, friction(link.joint, rate, wanted)) for share, link, rate, wanted in rows)


def with_friction(
    par: Parameters, measurement: Measurement, reference: Reference, efforts: Sequence[Any]
) -> tuple[Any, ...]:
    """Joint torques with the friction that the law gives back; as they are where it gives none."""
    if not par.friction_compensation:
        return tuple(efforts)
    back = friction_given_back(par, measurement, reference)
    return tuple(add(effort, more) for effort, more in zip(efforts, back, strict=True))


def shares(option: str, values: Any, joints: int) -> tuple[float, ...]:
    """A share of at least 0 for each joint, or none at all.

    Raises:
        ControllerError: names the option.
    """
    if values is None:
        return ()
    if not isinstance(values, (list, tuple)) or len(values) not in (0, joints):
        raise ControllerError(f"controller.{option} = {shown(values)}: must be {joints} numbers, one for each joint")
    try:
        return tuple(number(value, f"controller.{option}[{i}]", low=0.0) for i, value in enumerate(values))
    except ValueError as error:
        raise ControllerError(str(error)) from None
