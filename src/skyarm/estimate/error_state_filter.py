"""Error-state Kalman filter on an inertial unit, aided by pose, or position and heading; joints from encoders.

The inertial unit is integrated at every reading; what is estimated is the error of that: position, velocity, attitude
(a rotation, composed with the estimate), biases. A reading that is old when it arrives is compared with the belief of
its own instant: the filter lags ``delay_periods`` behind the present, and the inertial readings since then carry its
belief to the present, which is what the law is told. No delay is approximated.

Sources: Sola 2017, "Quaternion kinematics for the error-state Kalman filter"; Lefferts, Markley, Shuster 1982
(multiplicative attitude error); Khosravian, Trumpf, Mahony, Hamel 2015 (delayed filter with forward prediction).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation import Command
from skyarm.actuation.rotor import speed_after
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.estimate.error_covariance import (
    ACCELEROMETER_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    Covariance,
    Row,
    choose_covariance,
    diagonal,
    gate_of,
    predict_covariance,
    transition,
    update_by_scalar,
)
from skyarm.estimate.estimator import Estimator
from skyarm.estimate.filter_memory import (
    AIDS,
    BLANK_BELIEF,
    BLANK_INERTIAL,
    BLANK_READINGS,
    FilterMemory,
    ModelledRotor,
    choose,
    in_turn,
)
from skyarm.estimate.inertial_navigation import Navigated, corrected, level_attitude, navigate
from skyarm.estimate.joint_filter import FilteredJoints, filter_joints
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, atan2, cos, data, divide, logical_and, logical_not, sin, where
from skyarm.sensors.measurement import Measurement
from skyarm.sensors.sensor_readings import EncoderReading, HeadingReading, ImuReading, PoseReading
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class ErrorStateFilter(Estimator):
    """The filter's belief of its sensors; the plant's sensors have their own numbers.

    Attributes:
        aiding: "pose", "position" or "position_heading": the readings that correct the inertial unit's.
        delay_periods: control periods by which the filter lags, at least the age of the oldest aiding reading.
        gyro, gyro_walk, accelerometer, accelerometer_walk: densities of noise and of the biases' random walks.
        position, attitude, heading: deviations of the aiding readings.
        gravity: m/s^2. gate: normal deviations beyond which a reading is refused; 0 refuses none.
        first_velocity, first_tilt, first_heading, first_gyro_bias, first_accelerometer_bias: deviations of what the
            first readings do not tell. start_heading: rad, without a reading that tells of it.
        joint_bandwidth: rad/s, of the filter of the encoders; 0 takes positions and rates as they are read.
    """

    aiding: str = "pose"
    delay_periods: Annotated[int, Unit("", "control periods by which the filter lags", low=0, high=100)] = 0
    gyro: Annotated[Scalar, Unit("rad/s/sqrt(Hz)", "noise", low=0.0)] = 0.005
    gyro_walk: Annotated[Scalar, Unit("rad/s^2/sqrt(Hz)", "walk of the bias", low=0.0)] = 1e-4
    accelerometer: Annotated[Scalar, Unit("m/s^2/sqrt(Hz)", "noise", low=0.0)] = 0.02
    accelerometer_walk: Annotated[Scalar, Unit("m/s^3/sqrt(Hz)", "walk of the bias", low=0.0)] = 1e-3
    position: Annotated[Scalar, Unit("m", "deviation of a reading", low=0.0, strict=True)] = 0.005
    attitude: Annotated[Scalar, Unit("rad", "deviation of a reading", low=0.0, strict=True)] = 0.005
    heading: Annotated[Scalar, Unit("rad", "deviation of a reading", low=0.0, strict=True)] = 0.02
    gravity: Annotated[Scalar, Unit("m/s^2", low=0.0)] = 9.80665
    gate: Annotated[Scalar, Unit("", "normal deviations, 0: none", low=0.0)] = 4.5
    first_velocity: Annotated[Scalar, Unit("m/s", "deviation at the start", low=0.0)] = 0.1
    first_tilt: Annotated[Scalar, Unit("rad", "deviation at the start, without pose", low=0.0)] = 0.05
    first_heading: Annotated[Scalar, Unit("rad", "deviation at the start, without reading", low=0.0)] = 0.5
    first_gyro_bias: Annotated[Scalar, Unit("rad/s", "deviation at the start", low=0.0)] = 0.01
    first_accelerometer_bias: Annotated[Scalar, Unit("m/s^2", "deviation at the start", low=0.0)] = 0.1
    start_heading: Annotated[Scalar, Unit("rad", "at the start, without reading")] = 0.0
    joint_bandwidth: Annotated[Scalar, Unit("rad/s", "of the encoders' filter, 0: as read", low=0.0)] = 60.0

    def __post_init__(self) -> None:
        accept_fields(self, "")
        if self.aiding not in AIDS:
            raise RecordError(f"aiding = {self.aiding!r}: must be one of {', '.join(AIDS)}")

    def start(self, vehicle: Vehicle) -> FilterMemory:
        """Blank but for the covariance; the first readings begin the belief."""
        still, waiting = (0.0,) * vehicle.n, self.delay_periods + 1
        return FilterMemory(
            started=0.0,
            belief=BLANK_BELIEF,
            covariance=self._first_covariance(),
            inertial=(BLANK_INERTIAL,) * waiting,
            aiding=tuple((BLANK_READINGS[kind],) * waiting for kind in AIDS[self.aiding]),
            joints=FilteredJoints(joints=still, rates=still, read=0.0),
            rotors=tuple(
                ModelledRotor(
                    speed=0.0,
                    max_speed=data(rotor.max_speed),
                    time_constant_up=data(rotor.time_constant_up),
                    time_constant_down=data(rotor.time_constant_down),
                )
                for rotor in vehicle.rotors
            ),
            taken=0.0,
            refused=0.0,
            surprise=0.0,
        )

    def step(
        self, memory: FilterMemory, readings: Mapping[str, Any], command: Command, dt: float
    ) -> tuple[FilterMemory, Measurement]:
        """Take in what has arrived; the measurement is the belief of the present."""
        started = memory.started > 0.5
        imu, encoders = _only(ImuReading, readings), _only(EncoderReading, readings)
        arrived = [_only(kind, readings) for kind in AIDS[self.aiding]]
        before = tuple(choose(started, old, imu) for old in memory.inertial)
        inertial = (*before[1:], imu)
        queues = tuple(
            (*(choose(started, old, new) for old in queue[1:]), new)
            for queue, new in zip(memory.aiding, arrived, strict=True)
        )
        belief = choose(started, memory.belief, self._first_belief(imu, arrived))
        step = inertial[0].time - before[0].time
        R = belief.quaternion.rotation()
        belief, force = navigate(belief, before[0], inertial[0], self.gravity, step)
        P = predict_covariance(memory.covariance, transition(R, force, step), self._variances(step))
        taken, refused, surprise = memory.taken, memory.refused, memory.surprise
        for queue in queues:
            due, reading = in_turn(queue, before[0].time, inertial[0].time)
            rows, count = self._innovations(belief, reading)
            belief, P, passed, found = self._corrected(belief, P, rows, due, count)
            taken = taken + where(passed, 1.0, 0.0)
            refused = refused + where(logical_and(due, logical_not(passed)), 1.0, 0.0)
            surprise = where(due, found, surprise)
        joints = FilteredJoints(joints=(), rates=(), read=memory.joints.read)
        if memory.joints.joints:
            joints = filter_joints(memory.joints, encoders, started, self.joint_bandwidth, imu.time, dt)
        following = FilterMemory(
            started=memory.started * 0.0 + 1.0,
            belief=belief,
            covariance=P,
            inertial=inertial,
            aiding=queues,
            joints=joints,
            rotors=_turned(memory.rotors, command, started, dt),
            taken=taken,
            refused=refused,
            surprise=surprise,
        )
        return following, self._told(following, imu, encoders)

    def _first_covariance(self) -> Covariance:
        """Before the first readings are taken in, which say how far the attitude is known."""
        tilt, heading = self._first_turn()
        parts = (self.position,) * 3, (self.first_velocity,) * 3, (tilt, tilt, heading)
        biases = (self.first_gyro_bias,) * 3, (self.first_accelerometer_bias,) * 3
        return diagonal([each * each for part in (*parts, *biases) for each in part])

    def _first_turn(self) -> tuple[Any, Any]:
        """Deviations of tilt and heading at the start."""
        if self.aiding == "pose":
            return self.attitude, self.attitude
        return self.first_tilt, self.heading if self.aiding == "position_heading" else self.first_heading

    def _first_belief(self, imu: ImuReading, arrived: Sequence[Any]) -> Navigated:
        """At rest where the first readings are, without biases; level by the accelerometer without a pose."""
        if self.aiding == "pose":
            quaternion = arrived[0].quaternion
        else:
            heading = arrived[1].heading if self.aiding == "position_heading" else self.start_heading
            quaternion = level_attitude(imu.specific_force, heading)
        zero = Vec3(0.0, 0.0, 0.0)
        return Navigated(
            position=arrived[0].position,
            velocity=zero,
            quaternion=quaternion,
            gyro_bias=zero,
            accelerometer_bias=zero,
        )

    def _variances(self, dt: Any) -> list[Any]:
        """What a step adds to the variance of each component; to the position none, it is of third order in dt."""
        noise = {
            VELOCITY: self.accelerometer,
            ATTITUDE: self.gyro,
            GYRO_BIAS: self.gyro_walk,
            ACCELEROMETER_BIAS: self.accelerometer_walk,
        }
        added: list[Any] = [0] * 3
        for part in (VELOCITY, ATTITUDE, GYRO_BIAS, ACCELEROMETER_BIAS):
            added += [noise[part] * noise[part] * dt] * 3
        return added

    def _innovations(self, belief: Navigated, reading: Any) -> tuple[list[tuple[Row, Any, Any]], int]:
        """Derivative, innovation and variance of each scalar of a reading, and how many there are."""
        if isinstance(reading, HeadingReading):
            row, off = _heading_off(belief.quaternion.rotation(), reading.heading)
            return [(row, off, self.heading * self.heading)], 1
        off = reading.position - belief.position
        rows: list[tuple[Row, Any, Any]] = [
            ({POSITION + i: 1}, c, self.position * self.position) for i, c in enumerate(off)
        ]
        if isinstance(reading, PoseReading):
            turns = enumerate(_turn_between(belief.quaternion, reading.quaternion))
            rows += [({ATTITUDE + i: 1}, c, self.attitude * self.attitude) for i, c in turns]
        return rows, len(rows)

    def _corrected(
        self, belief: Navigated, P: Covariance, rows: Sequence[tuple[Row, Any, Any]], due: Any, count: int
    ) -> tuple[Navigated, Covariance, Any, Any]:
        """Belief and covariance after a reading that is due and passes the test; whether it did, and its surprise."""
        error: list[Any] = [0] * len(P)
        after, surprise = P, 0
        for row, off, variance in rows:
            after, error, part = update_by_scalar(after, error, row, off, variance)
            surprise = surprise + part
        allowed = where(self.gate > 0.0, gate_of(self.gate, count), float("inf"))
        passed = logical_and(due, surprise < allowed)
        return (
            choose(passed, corrected(belief, error), belief),
            choose_covariance(passed, after, P),
            passed,
            surprise,
        )

    def _told(self, memory: FilterMemory, imu: ImuReading, encoders: Any) -> Measurement:
        """The belief of the filter's instant carried to the present."""
        present = memory.belief
        for old, new in zip(memory.inertial, memory.inertial[1:], strict=False):
            present, _ = navigate(present, old, new, self.gravity, new.time - old.time)
        joints, rates = memory.joints.joints, memory.joints.rates
        if joints and type(self.joint_bandwidth) is not int:
            read = self.joint_bandwidth <= 0.0
            joints = tuple(where(read, a, b) for a, b in zip(encoders.joints, joints, strict=True))
            rates = tuple(where(read, a, b) for a, b in zip(encoders.joint_rates, rates, strict=True))
        return Measurement(
            time=data(imu.time),
            position=present.position,
            quaternion=present.quaternion,
            velocity=present.velocity,
            rate=imu.rate - present.gyro_bias,
            specific_force=imu.specific_force - present.accelerometer_bias,
            joints=joints,
            joint_rates=rates,
            rotor_speeds=tuple(rotor.speed for rotor in memory.rotors),
        )


def _only(kind: type, readings: Mapping[str, Any]) -> Any:
    """The first reading of a kind; None where there is none."""
    return next((each for each in readings.values() if isinstance(each, kind)), None)


def _turn_between(believed: Quaternion, read: Quaternion) -> tuple[Any, Any, Any]:
    """Rotation vector (rad, world axes, to first order) that turns the believed attitude into the read one."""
    turn = read * Quaternion(believed.w, -believed.x, -believed.y, -believed.z)
    factor = where(turn.w < 0.0, -2.0, 2.0)
    return turn.x * factor, turn.y * factor, turn.z * factor


def _heading_off(R: Mat3, heading: Any) -> tuple[Row, Any]:
    """Derivative of the heading by the attitude's error, and innovation of a heading, between -pi and pi."""
    x, y, z = R.column(0)
    level = divide(z, x * x + y * y)
    off = heading - atan2(y, x)
    return {ATTITUDE: -(level * x), ATTITUDE + 1: -(level * y), ATTITUDE + 2: 1}, atan2(sin(off), cos(off))


def _turned(rotors: Sequence[ModelledRotor], command: Command, started: Any, dt: Any) -> tuple[ModelledRotor, ...]:
    """Rotors one period later under the command that acted; at first they turn as they are commanded."""
    found = []
    for rotor, wanted in zip(rotors, command.rotor_speeds, strict=True):
        lagging: Any = rotor
        speed = where(started, speed_after(lagging, rotor.speed, wanted, dt), wanted)
        found.append(
            ModelledRotor(
                speed=speed,
                max_speed=rotor.max_speed,
                time_constant_up=rotor.time_constant_up,
                time_constant_down=rotor.time_constant_down,
            )
        )
    return tuple(found)
