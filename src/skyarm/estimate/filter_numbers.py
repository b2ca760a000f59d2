"""What the error-state filter believes of its sensors, its start, and what time adds to its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from skyarm.actuation.drive import TorqueDrive
from skyarm.estimate.error_covariance import Covariance, diagonal
from skyarm.estimate.estimator import Estimator
from skyarm.estimate.filter_memory import AIDS
from skyarm.estimate.filter_sensors import require_filter_sensors
from skyarm.estimate.inertial_navigation import Navigated, level_attitude
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, mul
from skyarm.sensors.sensor import Sensor
from skyarm.sensors.sensor_readings import ImuReading
from skyarm.vehicle.vehicle_records import Vehicle

FORCES = ("measured", "modelled")


@dataclass(frozen=True, kw_only=True, slots=True)
class FilterNumbers(Estimator):
    """The filter's belief of its sensors; the plant's sensors have their own numbers.

    Attributes:
        aiding: "pose", "position" or "position_heading": the readings that correct the inertial unit's.
        delay_periods: control periods by which the filter lags, at least the age of the oldest aiding reading.
        force: "measured" by the accelerometer, or "modelled" by the believed vehicle and corrected by it.
        gyro, gyro_walk, accelerometer, accelerometer_walk: densities of noise and of the biases' random walks.
        push_walk: density of the random walk of what the model lacks. push_turn: s; what it lacks may be fixed to the
            base and turn with it, which adds (rate x push)^2 push_turn to the walk's variance a second.
        position, attitude, heading: deviations of the aiding readings.
        gate: normal deviations beyond which a reading is refused; 0 refuses none. inflation: factor of the covariance
            at a refused reading, so that a filter that is wrong itself does not refuse all that would mend it.
        first_velocity, first_tilt, first_heading, first_gyro_bias, first_accelerometer_bias, first_push: deviations of
            what the first readings do not tell. start_heading: rad, without a reading that tells of it.
        joint_bandwidth: rad/s, of the filter of the encoders; 0 takes positions and rates as they are read.
        gravity: m/s^2; that of the controller's belief if left out. vehicle: that of its belief, given by the loop.
    """

    aiding: str = "pose"
    delay_periods: Annotated[int, Unit("", "control periods by which the filter lags", low=0, high=100)] = 0
    force: str = "measured"
    gyro: Annotated[Scalar, Unit("rad/s/sqrt(Hz)", "noise", low=0.0)] = 0.005
    gyro_walk: Annotated[Scalar, Unit("rad/s^2/sqrt(Hz)", "walk of the bias", low=0.0)] = 1e-4
    accelerometer: Annotated[Scalar, Unit("m/s^2/sqrt(Hz)", "noise", low=0.0)] = 0.02
    accelerometer_walk: Annotated[Scalar, Unit("m/s^3/sqrt(Hz)", "walk of the bias", low=0.0)] = 1e-3
    push_walk: Annotated[Scalar, Unit("m/s^3/sqrt(Hz)", "walk of what the model lacks", low=0.0)] = 0.02
    push_turn: Annotated[Scalar, Unit("s", "memory of a push that turns with the base", low=0.0)] = 0.2
    position: Annotated[Scalar, Unit("m", "deviation of a reading", low=0.0, strict=True)] = 0.005
    attitude: Annotated[Scalar, Unit("rad", "deviation of a reading", low=0.0, strict=True)] = 0.005
    heading: Annotated[Scalar, Unit("rad", "deviation of a reading", low=0.0, strict=True)] = 0.02
    gate: Annotated[Scalar, Unit("", "normal deviations, 0: none", low=0.0)] = 4.5
    inflation: Annotated[Scalar, Unit("", "factor of the covariance at a refused reading", low=1.0)] = 1.5
    first_velocity: Annotated[Scalar, Unit("m/s", "deviation at the start", low=0.0)] = 0.1
    first_tilt: Annotated[Scalar, Unit("rad", "deviation at the start, without pose", low=0.0)] = 0.05
    first_heading: Annotated[Scalar, Unit("rad", "deviation at the start, without reading", low=0.0)] = 0.5
    first_gyro_bias: Annotated[Scalar, Unit("rad/s", "deviation at the start", low=0.0)] = 0.01
    first_accelerometer_bias: Annotated[Scalar, Unit("m/s^2", "deviation at the start", low=0.0)] = 0.1
    first_push: Annotated[Scalar, Unit("m/s^2", "deviation at the start", low=0.0)] = 2.0
    start_heading: Annotated[Scalar, Unit("rad", "at the start, without reading")] = 0.0
    joint_bandwidth: Annotated[Scalar, Unit("rad/s", "of the encoders' filter, 0: as read", low=0.0)] = 300.0
    gravity: Annotated[Scalar | None, Unit("m/s^2", low=0.0)] = None
    vehicle: Vehicle | None = None

    def __post_init__(self) -> None:
        accept_fields(self, "")
        for name, allowed in (("aiding", tuple(AIDS)), ("force", FORCES)):
            if getattr(self, name) not in allowed:
                raise RecordError(f"{name} = {getattr(self, name)!r}: must be one of {', '.join(allowed)}")

    @property
    def modelled(self) -> bool:
        """Whether the believed vehicle says the specific force."""
        return self.force == "modelled"

    def require_sensors(self, sensors: Mapping[str, Sensor], rate: float, vehicle: Vehicle) -> None:
        """An inertial unit, the aiding sensors and, with joints, encoders; none older than the filter lags."""
        self.require_torques(vehicle.name, {each.name: each.drive for each in vehicle.drives})
        require_filter_sensors(sensors, self.aiding, self.delay_periods / rate, vehicle.n)

    def require_torques(self, vehicle: str, drives: Mapping[str, Any]) -> None:
        """Refuse the modelled force where a joint's setpoint is no torque; ``drives`` by joint, of the vehicle named.

        Raises:
            ValueError: one line with the joint.
        """
        for joint, drive in drives.items() if self.modelled else ():
            if not isinstance(drive, TorqueDrive):
                raise ValueError(
                    f"estimator.force = 'modelled': must be 'measured' for {vehicle!r}, whose joint {joint!r} has a "
                    f"drive ({type(drive).__name__}): the model takes setpoints for torques"
                )

    def first_covariance(self) -> Covariance:
        """Before the first readings are taken in, which say how far position and attitude are known."""
        tilt, heading = self.attitude, self.attitude
        if self.aiding != "pose":
            tilt = self.first_tilt
            heading = self.heading if self.aiding == "position_heading" else self.first_heading
        parts = [self.position] * 3 + [self.first_velocity] * 3 + [tilt, tilt, heading]
        parts += [self.first_gyro_bias] * 3 + [self.first_accelerometer_bias] * 3
        parts += [self.first_push] * 3 if self.modelled else []
        return diagonal([each * each for each in parts])

    def first_belief(self, blank: Navigated, imu: ImuReading, arrived: Sequence[Any]) -> Navigated:
        """At rest where the first readings are, without biases; level by the accelerometer without a pose."""
        if self.aiding == "pose":
            return replace(blank, position=arrived[0].position, quaternion=arrived[0].quaternion)
        heading = arrived[1].heading if self.aiding == "position_heading" else self.start_heading
        return replace(blank, position=arrived[0].position, quaternion=level_attitude(imu.specific_force, heading))

    def added_variances(self, belief: Navigated, reading: ImuReading, dt: Any) -> list[Any]:
        """What a step adds to the variance of each component; to the position none, it is of third order in dt."""
        added: list[Any] = [0] * 3
        noise = 0 if self.modelled else self.accelerometer * self.accelerometer
        for density in (noise, *(each * each for each in (self.gyro, self.gyro_walk, self.accelerometer_walk))):
            added += [mul(density, dt)] * 3
        if self.modelled:
            turning = belief.quaternion.rotation().apply(reading.rate - belief.gyro_bias).cross(belief.push)
            walk = self.push_walk * self.push_walk
            added += [(walk + c * c * self.push_turn) * dt for c in turning]
        return added
