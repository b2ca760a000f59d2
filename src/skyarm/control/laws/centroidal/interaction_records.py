"""Records of pressing on a surface: constants, memory, what the reference asks for; how each is made."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.tip_force import ForceErrors
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.reference.tip_motion import STRONGEST, out_of_axis
from skyarm.scalars import Scalar, logical_and, logical_or, where
from skyarm.vehicle.vehicle_records import Vehicle

SENSING = 60.0
"""rad/s: a force sensor is heard above the bandwidth of the observers, and below that of the contact."""


@dataclass(frozen=True, kw_only=True, slots=True)
class InteractionGains:
    """Constants of pressing; touch and lost are the law's option, the others are in no unit of the vehicle's size."""

    touch: Annotated[Scalar, Unit("N", "along the normal, above which the tip touches")]
    lost: Annotated[Scalar, Unit("N", "along the normal, below which it is lost after a while")]
    errors: ForceErrors = ForceErrors()
    loss_time: Annotated[Scalar, Unit("s", "below lost until contact is lost")] = 0.04
    escape: Annotated[Scalar, Unit("m/s", "into the surface, above which the tip goes through")] = 0.1
    escape_time: Annotated[Scalar, Unit("s", "that the tip goes through until contact is lost")] = 0.015
    rebound: Annotated[Scalar, Unit("s", "after the order is gone, in which a tip that goes in does not touch")] = 0.05
    rise: Annotated[Scalar, Unit("s", "ramp of the wanted force")] = 0.15
    fall: Annotated[Scalar, Unit("s", "ramp to none")] = 0.02
    integral: Annotated[Scalar, Unit("1/s", "of the force's error")] = 4.0
    integral_share: Annotated[Scalar, Unit("", "of the wanted force that the integral may add")] = 0.5
    integral_least: Annotated[Scalar, Unit("N", "that the integral may add anyway")] = 0.3
    damping: Annotated[Scalar, Unit("1/s", "of the tip along the normal while it presses")] = 20.0
    catching: Annotated[Scalar, Unit("1/s", "of a tip that goes through the surface")] = 53.0
    bias_rate: Annotated[Scalar, Unit("rad/s", "filter of what is observed in free flight")] = 0.5
    wind_rate: Annotated[Scalar, Unit("rad/s", "filter of what the base feels beside the tip's force")] = 1.0
    rest: Annotated[Scalar, Unit("s", "after contact, from which on anything is learned")] = 0.5
    follow: Annotated[Scalar, Unit("rad/s", "of the base that follows the surface")] = 3.5
    coming: Annotated[Scalar, Unit("1/s", "at which the base takes the speed of coming")] = 8.0
    follow_limit: Annotated[Scalar, Unit("m/s^2", "of the base along the normal")] = 4.0
    relief_start: Annotated[Scalar, Unit("", "share of a limit from which on friction is let go")] = 0.9
    relief_end: Annotated[Scalar, Unit("", "share of a limit at which most is let go")] = 1.0
    relief: Annotated[Scalar, Unit("", "0 to 1, of the observed friction that is let go at most")] = 0.2
    yielding: Annotated[Scalar, Unit("", "0 to 1, of the observed force across that is answered while it grips")] = 0.7
    tilting: Annotated[Scalar, Unit("1/s", "at which sliding corrects the normal")] = 1.0
    again: Annotated[Scalar, Unit("m/s", "with which the tip comes back to a surface that it lost, at most")] = 0.1
    sensing: Annotated[Scalar, Unit("rad/s", "filter of a force sensor")] | None = None
    furthest: Annotated[Scalar, Unit("m", "that the base looks for the surface")] = 0.5

    @property
    def senses(self) -> bool:
        """Whether a force sensor tells the force along the normal: structure."""
        return self.sensing is not None


@dataclass(frozen=True, kw_only=True, slots=True)
class InteractionMemory:
    """Memory of pressing."""

    touching: Annotated[Scalar, Unit("", "1 while the tip touches as it is wanted to")]
    losing: Annotated[Scalar, Unit("", "0 to 1, how far contact is on its way to count as lost")]
    share: Annotated[Scalar, Unit("", "0 to 1, of the wanted force")]
    integral: Annotated[Scalar, Unit("N", "beside the wanted force")]
    found: Annotated[Scalar, Unit("", "half once the push has met its surface, 1 once it was there as a whole")]
    shift: Annotated[Scalar, Unit("m", "of the reference along the normal")]
    shift_rate: Annotated[Scalar, Unit("m/s", "of the shift")]
    free: Annotated[Scalar, Unit("s", "since the order of the last contact is gone")]
    gap: Annotated[Scalar, Unit("m", "of the tip from its shifted reference, along the normal")]
    bias: Disturbance
    force: Annotated[Vec3, Unit("N", "at the tip, believed, world axes")]
    lean: Annotated[Vec3, Unit("", "of the normal from the one that is told, found by sliding")]
    felt: Annotated[Vec3 | tuple[()], Unit("N", "by a sensor at the tip, filtered, world axes")] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Wanted:
    """A wanted contact as the reference says it: N, m/s and the unit normal out of the surface, world axes.

    Attributes:
        grip: 1 while the tip is held by what it grips; a structural 0 where it never is.
        pivot: m, on the axis about which the tip goes then. axis: its unit vector; None for a normal as told.
    """

    force: Any
    speed: Any
    normal: Vec3
    grip: Any = 0
    pivot: Vec3 | None = None
    axis: Vec3 | None = None

    @property
    def grips(self) -> bool:
        """Whether the tip ever grips: structure."""
        return type(self.grip) is not int

    @property
    def asked(self) -> Any:
        """Whether any contact is asked for."""
        wanted: Any = self.force > 0.0
        return logical_or(wanted, self.grip > 0.5) if self.grips else wanted

    @property
    def presses(self) -> Any:
        """Whether the tip shall press on a surface, which it may slide along."""
        wanted: Any = self.force > 0.0
        return logical_and(wanted, self.grip < 0.5) if self.grips else wanted

    def about_the_pivot(self, tip: Vec3) -> Wanted:
        """The same contact with the normal out of the axis to the tip (m, world axes) while it grips."""
        if self.pivot is None or self.axis is None:
            return self
        out = out_of_axis(tip, self.pivot, self.axis, self.grip > 0.5, self.normal)
        return dataclasses.replace(self, normal=out)


def interaction_gains(
    thresholds: tuple[float, float], mode: str, vehicle: Vehicle, sensor: bool = False, *, leading: str = "tip"
) -> InteractionGains | None:
    """Constants of pressing for its two thresholds, N, with or without a force sensor; None where it is left out.

    ``leading`` is the mode in which the law leads the tip.

    Raises:
        ControllerError: thresholds that are none, or a law without a tip to lead.
    """
    touch, lost = thresholds
    if touch == 0.0 and lost == 0.0:
        if sensor:
            raise ControllerError("controller.force_sensor = true: must be false without interaction")
        return None
    at = f"controller.interaction = {shown(thresholds)}"
    if not touch > lost > 0.0:
        raise ControllerError(f"{at}: must be two forces above 0, the second below the first, or twice 0")
    if touch > STRONGEST:
        raise ControllerError(f"{at}: must be at most {STRONGEST:g} N")
    if mode != leading or not vehicle.n:
        raise ControllerError(f"{at}: must be twice 0 but in mode '{leading}' with joints that press")
    gains = InteractionGains(touch=touch, lost=lost)
    return dataclasses.replace(gains, sensing=SENSING) if sensor else gains


def first_interaction(joints: int, sensor: bool = False) -> InteractionMemory:
    """Free flight, nothing known."""
    zero = Vec3(0.0, 0.0, 0.0)
    none = Disturbance(force=zero, torque=zero, efforts=(0.0,) * joints)
    return InteractionMemory(
        touching=0.0,
        losing=0.0,
        share=0.0,
        integral=0.0,
        found=0.0,
        shift=0.0,
        shift_rate=0.0,
        free=0.0,
        gap=0.0,
        bias=none,
        force=zero,
        lean=zero,
        felt=zero if sensor else (),
    )


def wanted_of(push: Sequence[Any]) -> Wanted:
    """The field ``push`` of a reference."""
    force, speed, *normal = push[:5]
    grip = where(push[5] > 0.5, 1.0, 0.0) if len(push) > 5 else 0
    pivot, axis = (Vec3(*push[6:9]), Vec3(*push[9:])) if len(push) > 6 else (None, None)
    return Wanted(force=force, speed=speed, normal=Vec3(*normal), grip=grip, pivot=pivot, axis=axis)
