"""What the vehicle's sensors say: a record apart from the state."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.state import State
from skyarm.records.field_rules import accept_fields
from skyarm.records.plain import WRITTEN_IF_ANY
from skyarm.records.units import Unit
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Measurement:
    """A measurement holds one reading of every sensor: motion capture, GNSS or odometry, inertial unit, encoders.

    ``time`` is when it was taken: older than now if the measurement is delayed.
    """

    time: Annotated[Scalar, Unit("s")]
    position: Annotated[Vec3, Unit("m", "base origin, world axes")]
    quaternion: Annotated[Quaternion, Unit("", "w x y z, unit, base to world")]
    velocity: Annotated[Vec3, Unit("m/s", "base origin, world axes")]
    rate: Annotated[Vec3, Unit("rad/s", "gyroscope, base axes")]
    specific_force: Annotated[Vec3, Unit("m/s^2", "accelerometer, base axes, +g along z in hover")]
    joints: Annotated[tuple[Scalar, ...], Unit("rad or m", "see the joints above")] = ()
    joint_rates: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s")] = ()
    rotor_speeds: Annotated[tuple[Scalar, ...], Unit("rad/s", "unsigned")] = ()
    tilts: Annotated[tuple[Scalar, ...], Unit("rad", "angles of the rotors that tilt")] = field(
        default=(), metadata=WRITTEN_IF_ANY
    )
    tip_force: Annotated[tuple[Scalar, ...], Unit("N", "that pushes the tip, axes of the tip; of a force sensor")] = (
        field(default=(), metadata=WRITTEN_IF_ANY)
    )
    tip_torque: Annotated[tuple[Scalar, ...], Unit("N m", "about the tip, likewise; of a law that asks for it")] = (
        field(default=(), metadata=WRITTEN_IF_ANY)
    )
    switches: Annotated[tuple[Scalar, ...], Unit("", "1 closed; tactile switches that phases wait for")] = field(
        default=(), metadata=WRITTEN_IF_ANY
    )

    def __post_init__(self) -> None:
        # made in every period: what holds vectors and tuples already is not looked at
        vectors = type(self.position) is type(self.velocity) is type(self.rate) is type(self.specific_force) is Vec3
        tuples = type(self.joints) is type(self.joint_rates) is type(self.rotor_speeds) is type(self.tilts) is tuple
        tuples = tuples and type(self.tip_force) is type(self.tip_torque) is type(self.switches) is tuple
        if not (vectors and tuples and type(self.quaternion) is Quaternion and type(self.time) in (float, int)):
            accept_fields(self, "measurement")


def blank_measurement(joints: int, rotors: int, tilts: int = 0, tip_force: int = 0, tip_torque: int = 0) -> Measurement:
    """A reading of a vehicle that rests at the origin, level, at time 0: an example whose numbers are all data."""
    zero, still = Vec3(0.0, 0.0, 0.0), (0.0,) * joints
    return Measurement(
        time=0.0,
        position=zero,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=zero,
        rate=zero,
        specific_force=zero,
        joints=still,
        joint_rates=still,
        rotor_speeds=(0.0,) * rotors,
        tilts=(0.0,) * tilts,
        tip_force=(0.0,) * tip_force,
        tip_torque=(0.0,) * tip_torque,
    )


def measurement_of(state: State, specific_force: Vec3) -> Measurement:
    """A reading of a state by sensors without errors, at time 0; specific force in m/s^2, base axes."""
    return Measurement(
        time=0.0,
        position=state.position,
        quaternion=state.quaternion,
        velocity=state.velocity,
        rate=state.rate,
        specific_force=specific_force,
        joints=state.joints,
        joint_rates=state.joint_rates,
        rotor_speeds=state.rotor_speeds,
        tilts=state.tilts,
    )
