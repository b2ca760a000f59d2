"""Tilting rotor: axis, range and speed of the servo that turns its thrust axis."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any

from skyarm.algebra import Scalar, Vec3
from skyarm.records.coerce import concrete, number, unit_vector
from skyarm.records.field_rules import checked
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive
from skyarm.vehicle.check import VehicleError, refuse

ACROSS = 1e-6
"""Cosine between a servo's axis and the rotor's up to which they count as
perpendicular."""


@immutable
@checked("tilt", VehicleError)
class Tilt:
    """Servo that tilts a rotor about an axis of the base through its hub, perpendicular
    to its thrust.

    The angle follows its setpoint as a first-order lag whose rate is limited. At angle
    0, its rest, the thrust is along the rotor's own axis; a positive angle turns it by
    the right-hand rule. Left out are the inertia of what is turned, the torque that
    turns it and the gyroscopic torque of turning a spinning rotor; the torque of the
    spin as the base turns, and as the speed changes, follows the turned axis.

    Attributes:
        axis: unit vector, base frame, perpendicular to the rotor's axis.
        lower, upper: range of the angle, rad, with rest inside.
        time_constant: time constant of the lag, s.
        max_rate: largest rate, rad/s.
    """

    axis: Annotated[
        Vec3, Unit("", "unit vector of the servo's axis, base axes", rule=unit_vector)
    ]
    lower: Annotated[Scalar, Unit("rad", "least tilt angle", rule=number)]
    upper: Annotated[Scalar, Unit("rad", "largest tilt angle", rule=number)]
    time_constant: Annotated[
        Scalar,
        positive("s", "time constant of the angle's first-order lag", rule=number),
    ]
    max_rate: Annotated[
        Scalar,
        positive("rad/s", "largest rate of the tilt angle", infinite=True, rule=number),
    ] = math.inf

    def require(self, field: str, thrust_axis: Vec3) -> None:
        """Raise an error for invalid parameters of a tilt servo, or a tilt axis not
        perpendicular to the thrust.
        """
        if (
            concrete(*self.axis, *thrust_axis)
            and abs(self.axis.dot(thrust_axis)) > ACROSS
        ):
            refuse(
                f"{field}.axis",
                tuple(self.axis),
                f"must be perpendicular to the rotor's axis {tuple(thrust_axis)}",
            )
        # rest inside the range, because plants begin with all tilts at zero
        for name, low in (("lower", -math.pi), ("upper", 0.0)):
            value = getattr(self, name)
            if concrete(value) and not low <= value <= low + math.pi:
                allowed = (
                    f"must be from {'-pi to 0' if low else '0 to pi'} rad: rest, where"
                    " the angle is 0, is inside"
                )
                refuse(f"{field}.{name}", value, allowed)
        if concrete(self.lower, self.upper) and not self.lower < self.upper:
            refuse(
                f"{field}.lower", self.lower, f"must be below upper = {self.upper!r}"
            )


def arm_direction(field: str, position: Iterable[Any], thrust_axis: Vec3) -> Vec3:
    """Usual tilt axis of a rotor: direction from the base's origin to the hub,
    perpendicular to the thrust.

    Raises:
        VehicleError: the hub lies on the line of its thrust through the origin.
    """
    hub = Vec3(*map(float, position))
    across = hub - thrust_axis * thrust_axis.dot(hub)
    length = math.sqrt(across.dot(across))
    # 1e-9 m is far below any hub's place and far above rounding
    if not length > 1e-9:
        raise VehicleError(
            f"{field}.axis = (missing): must stand here: the hub is not beside the"
            " base's origin"
        )
    return Vec3.from_numbers([c / length for c in across])
