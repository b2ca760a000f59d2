"""The attitude that a force asks for: of all of it, or of what the rotors do not give across the thrust axis."""

from __future__ import annotations

from skyarm.algebra import Vec3
from skyarm.control.blocks.attitude import Attitude, attitude, upright
from skyarm.control.blocks.sideways_force import Reach, leaning, thrust_axis
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.scalars.taylor import Taylor


def wanted_attitude(par: CentroidalParameters, force: Vec3, yaw: Taylor, reach: Reach | None) -> Attitude:
    """Attitude of a force (series of second order, world axes, N).

    Args:
        par: constants.
        force: wanted.
        yaw: heading.
        reach: of the force that goes sideways at the attitude that is held; None for none.
    """
    if reach is not None:
        axis = thrust_axis(par.attitude, yaw.truncated(2)) if par.holds_attitude else None
        force = leaning(reach, force, par.sideways, axis)
    if par.softens_attitude:
        force = upright(force, par.model.vehicle.mass * par.model.gravity, par.low_thrust)
    return attitude(force, yaw.truncated(2))
