"""Forces of the rotors beside their thrust along body z, at the reference's motion, with two derivatives.

At the present motion they would feed noise and errors into the posture. Hub drag is linear in the velocity, so that its
derivatives are the drag of acceleration and jerk; what tilted rotors push across body z is no drag and does not change
with the motion, and the derivatives leave it out.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import ZERO3, Vec3
from skyarm.control.blocks.air_drag import BelievedAir, against_air, hull_drag_along
from skyarm.control.blocks.prediction import side_wrench
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.vehicle.vehicle_records import Vehicle


def pushes_across(vehicle: Vehicle) -> bool:
    """Whether some rotor's axis is not body z."""
    return any(float(each) != 0.0 for rotor in vehicle.rotors for each in (rotor.axis.x, rotor.axis.y))


def reference_drag(
    model: Model,
    state: State,
    base: Sequence[Vec3],
    *,
    sideways: bool,
    moving: bool,
    across: bool,
    air: BelievedAir | None = None,
) -> list[Vec3]:
    """Force (N, world axes) and its first and second derivative.

    Args:
        model: belief.
        state: now, of which attitude and rotor speeds count.
        base: position of the base on its reference and its derivatives, world axes.
        sideways: thrust across body z is the law's own, and no disturbance.
        moving: False takes the derivatives as zero.
        across: rotors push across body z, and it is not the law's own.
        air: wind and drag of the hull that are believed.
    """
    R = state.quaternion.rotation()

    def side(motion: Vec3) -> Vec3:
        return R.apply(side_wrench(model, state.rotor_speeds, R.apply_T(motion), ZERO3, sideways).force)

    hull = hull_drag_along(model, air, R, base[1:4])
    value = side(against_air(air, base[1])) + hull[0]
    if not moving:
        return [value, ZERO3, ZERO3]
    changes = [side(base[2]), side(base[3])]
    if across:
        still = side(ZERO3)
        changes = [each - still for each in changes]
    return [value, *(each + beside for each, beside in zip(changes, hull[1:], strict=True))]
