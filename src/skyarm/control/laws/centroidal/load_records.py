"""Records of the learned load: constants and memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.tip_force import ForceErrors
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.scalars import Scalar
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class LoadGains:
    """Constants of the learned load; ``limit`` is the law's option, the others are in no unit of the vehicle's size.

    Attributes:
        twist: N m, of a torque at the tip that counts as much against it as 1 N of the base's force does: a load's
            weight times how far its centre of mass lies from the tip.
        pace, place_pace: rates over the bandwidth of the slower of the observers of the base's force and of the joints.
            The mass and the observer find the same weight at once, and from 2 on they would swing.
        size: small, because a load that has less inertia than is believed of it makes the joints that turn it too
            stiff, and one that has ten times as much does not.
    """

    limit: Annotated[Scalar, Unit("kg", "largest mass that is learned")]
    errors: ForceErrors = ForceErrors()
    twist: Annotated[Scalar, Unit("N m", "at the tip, as much as 1 N of the base's force")] = 0.03
    pace: Annotated[Scalar, Unit("", "rate of the mass over the observer's bandwidth")] = 1.5
    noise_share: Annotated[Scalar, Unit("", "share of the mass, an error below which counts as noise")] = 0.05
    settled_rate: Annotated[Scalar, Unit("", "0 to 1, of the rate that is left of it there")] = 0.1
    place_pace: Annotated[Scalar, Unit("", "rate of the centre of mass over the observer's bandwidth")] = 0.1
    light: Annotated[Scalar, Unit("", "share of the limit, a mass below which tells little of its centre")] = 0.2
    furthest: Annotated[Scalar, Unit("m", "of the centre of mass from the tip, along each of its axes")] = 0.05
    size: Annotated[Scalar, Unit("m", "radius of gyration about the centre of mass, of any axis")] = 0.01
    bias_rate: Annotated[Scalar, Unit("rad/s", "filter of what is observed without a load")] = 0.5


@dataclass(frozen=True, kw_only=True, slots=True)
class LoadMemory:
    """Memory of the learned load.

    Attributes:
        bias: observed without a load.
    """

    mass: Annotated[Scalar, Unit("kg", "learned")]
    place: Annotated[Vec3, Unit("m", "centre of mass, axes of the tip")]
    bias: Disturbance


def load_gains(limit: float, vehicle: Vehicle) -> LoadGains | None:
    """Constants of the learned load for its largest mass, kg; None where it is left out.

    Raises:
        ControllerError: a vehicle without a tip that joints move.
    """
    if limit == 0.0:
        return None
    if not vehicle.end_effector or not vehicle.n:
        raise ControllerError(
            f"controller.load = {shown(limit)}: must be 0: {vehicle.name!r} has no joints that move an end_effector"
        )
    return LoadGains(limit=limit)


def first_load(joints: int) -> LoadMemory:
    """Nothing is held and nothing is known."""
    zero = Vec3(0.0, 0.0, 0.0)
    return LoadMemory(mass=0.0, place=zero, bias=Disturbance(force=zero, torque=zero, efforts=(0.0,) * joints))
