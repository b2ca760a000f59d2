"""Quantities that make up the observation of a learning environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import maximum, where
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive
from skyarm.reference import Reference
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.tip_and_goal import goal_of, tip_at
from skyarm.vehicle import Vehicle

_LESS = "higher values make it count less"

Metres = Annotated[float, positive("m", "distance that counts as 1", effect=_LESS)]
JointTravel = Annotated[
    float, positive("rad or m", "joint displacement that counts as 1", effect=_LESS)
]
RadPerSecond = Annotated[
    float, positive("rad/s", "angular rate that counts as 1", effect=_LESS)
]
"""Scale: divisor of an observed or rewarded quantity."""


@immutable
class Sight:
    """Inputs of the observations: measurement, reference, last action and nominal
    model.

    Attributes:
        measurement, reference: law's inputs of this period.
        action: last action, each number in [-1, 1]; zeros in an episode's first period.
        model: nominal model of the scenario's controller.
    """

    measurement: Measurement
    reference: Reference
    action: Scalars
    model: Model


@immutable
class Result:
    """Inputs of the rewards: true state, reference, actions and command of a control
    period.

    Attributes:
        state: plant state. reference: reference held at that time. vehicle: true
            vehicle.
        action, action_before: actions of this period and of the one before, each number
            in [-1, 1].
        command: vehicle command, converted from this period's action.
        ended: 1 if the period has ended the episode before its time, else 0.
        scenario: scenario of the episode, with the numbers drawn for it.
    """

    state: State
    reference: Reference
    vehicle: Vehicle
    action: Scalars
    action_before: Scalars
    command: Command
    ended: Scalar
    scenario: Scenario


@immutable
class Observed:
    """Base class of quantities that make up an observation."""

    @property
    def sees(self) -> str:
        """Name of the sensor whose picture the quantity is; empty for numbers."""
        return ""

    def __post_init__(self) -> None:
        accept_fields(self, type(self).__name__)

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """Numbers that an observed quantity contributes to the observation vector."""
        raise NotImplementedError(f"{type(self).__name__} must define numbers()")


@immutable
class PositionError(Observed):
    """Observed position error: reference minus measured position of the base origin,
    world axes.
    """

    scale: Metres = 1.0

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The three scaled components of the position error for the observation
        vector.
        """
        return _divide(
            sight.reference.position - sight.measurement.position, self.scale
        )


@immutable
class VelocityError(Observed):
    """Observed velocity error: reference minus measured velocity of the base origin,
    world axes.
    """

    scale: Annotated[
        float, positive("m/s", "velocity error that counts as 1", effect=_LESS)
    ] = 1.0

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The three scaled components of the velocity error for the observation
        vector.
        """
        return _divide(
            sight.reference.velocity - sight.measurement.velocity, self.scale
        )


@immutable
class Attitude(Observed):
    """Observed attitude: rotation matrix from base to world axes, row by row,
    continuous and unique.
    """

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The nine entries of the rotation matrix for the observation vector."""
        R = sight.measurement.rotation
        return [*R.r0, *R.r1, *R.r2]


@immutable
class BodyRate(Observed):
    """Observed angular velocity in base axes."""

    scale: RadPerSecond = 5.0

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The three scaled components of the angular velocity for the observation
        vector.
        """
        return _divide(sight.measurement.rate, self.scale)


@immutable
class SpecificForce(Observed):
    """Observed specific force: accelerometer reading in base axes, +g along z in
    hover.
    """

    scale: Annotated[
        float, positive("m/s^2", "specific force that counts as 1", effect=_LESS)
    ] = 10.0

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The three scaled components of the specific force for the observation
        vector.
        """
        return _divide(sight.measurement.specific_force, self.scale)


@immutable
class JointErrors(Observed):
    """Observed joint errors: reference minus measured joint positions."""

    scale: JointTravel = 1.0

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The scaled error of each joint for the observation vector."""
        pairs = zip(sight.reference.joints, sight.measurement.joints, strict=True)
        return [(desired - now) / self.scale for desired, now in pairs]


@immutable
class JointAngles(Observed):
    """Observed joint positions."""

    scale: JointTravel = 1.0

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The scaled position of each joint for the observation vector."""
        return [now / self.scale for now in sight.measurement.joints]


@immutable
class JointRates(Observed):
    """Observed joint rates."""

    scale: Annotated[
        float, positive("rad/s or m/s", "joint rate that counts as 1", effect=_LESS)
    ] = 5.0

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The scaled rate of each joint for the observation vector."""
        return [rate / self.scale for rate in sight.measurement.joint_rates]


@immutable
class TipError(Observed):
    """Observed tip error: reference minus measured tip position, world axes; the base's
    error if there is no arm.
    """

    scale: Metres = 0.1

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The three scaled components of the tip error for the observation vector."""
        return _divide(
            tip_error(sight.model.vehicle, sight.measurement, sight.reference),
            self.scale,
        )


@immutable
class LastAction(Observed):
    """Observed action of the previous control period."""

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """The components of the previous action for the observation vector."""
        return sight.action


@immutable
class Depth(Observed):
    """Observed picture of a depth camera or lidar: depths over the scale, 1 where they
    are larger or unknown.

    Attributes:
        sensor: name of the camera or lidar.
    """

    sensor: Annotated[str, Unit("", "name of the camera or lidar")] = "camera"
    scale: Metres = 1.0

    @property
    def sees(self) -> str:
        """Name of the camera or lidar."""
        return self.sensor

    def numbers(self, sight: Sight) -> Sequence[Scalar]:
        """Pixels, row by row, of a law's measurement; that of an environment has
        none, as its pictures stand beside the vector.
        """
        return [
            self.share(depth)
            for image in sight.measurement.images
            if image.sensor == self.sensor
            for depth in image.depth
        ]

    def share(self, depth: Any) -> Any:
        """Observed number of a depth (m), or an array of them."""
        shares = depth / self.scale
        # NaN, of a lost reading, compares false
        return where(shares <= 1.0, maximum(shares, 0.0), 1.0)


OBSERVED: dict[str, type[Observed]] = {
    "position_error": PositionError,
    "velocity_error": VelocityError,
    "attitude": Attitude,
    "body_rate": BodyRate,
    "specific_force": SpecificForce,
    "joint_errors": JointErrors,
    "joint_angles": JointAngles,
    "joint_rates": JointRates,
    "tip_error": TipError,
    "last_action": LastAction,
    "depth": Depth,
}
"""Observed quantities by name; a name gives one with its default scale."""

USUAL = (
    *("position_error", "velocity_error", "attitude", "body_rate"),
    *("joint_errors", "joint_angles", "joint_rates", "tip_error", "last_action"),
)
"""Default observation."""


def tip_error(
    vehicle: Vehicle, state: State | Measurement, reference: Reference
) -> Vec3:
    """Position error (m) of the tip: reference minus actual position, world axes."""
    return goal_of(vehicle, reference).tool - tip_at(
        vehicle, state.position, state.quaternion, state.joints
    )


def _divide(vector: Vec3, scale: float) -> list[Scalar]:
    return [number / scale for number in vector]
