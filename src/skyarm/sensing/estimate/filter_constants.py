"""Error-state filter: parameters, internal state, required sensors, initial state and
process noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

from skyarm.algebra import ZERO3, ZERO3_DATA, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import logical_and, logical_or, mul, sqrt
from skyarm.dynamics.actuators.drive import Drive
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Record, blend
from skyarm.records.units import Unit, declared_fields, nonnegative, positive
from skyarm.sensing.estimate.error_state import (
    ATTITUDE,
    Aid,
    Covariance,
    Navigated,
    diagonal,
    level_attitude,
)
from skyarm.sensing.estimate.estimator import Estimator
from skyarm.sensing.estimate.filter_models import FilteredJoints
from skyarm.sensing.sensor import Sensor
from skyarm.sensing.sensor_kinds import (
    EncoderReading,
    HeadingReading,
    ImuReading,
    PoseReading,
    PositionReading,
    mount_rotation,
    reads,
)
from skyarm.vehicle import Vehicle
from skyarm.vehicle.check import FARTHEST

AIDS: dict[str, tuple[type, ...]] = {
    "pose": (PoseReading,),
    "position": (PositionReading,),
    "position_heading": (PositionReading, HeadingReading),
}
"""Value of the filter's ``aiding`` -> readings that correct the inertial unit."""

TURNING = 100.0
"""Bandwidth (rad/s) of the angular acceleration from the gyroscope. At usual noise
densities its error, 0.005 rad/s^2 sqrt(bandwidth^3 / 2), moves the specific force at a
lever arm of 0.1 m by less than the accelerometer's own noise."""


# zeros of floats are data: as ints they would be structure that never changes
_AT_REST: Mapping[object, Any] = {
    Vec3: ZERO3_DATA,
    Quaternion: Quaternion(1.0, 0.0, 0.0, 0.0),
}


def blank(kind: type[Record]) -> Record:
    """Reading or state of a given type whose numbers are zeros, level."""
    fields = declared_fields(kind).items()
    return kind(**{name: _AT_REST.get(each, 0.0) for name, (each, _) in fields})


@immutable
class FilterMemory:
    """Internal state of the error-state filter: estimate, covariance and queues of past
    readings.

    Attributes:
        started: 1 after the first readings.
        belief, covariance: at the instant of ``inertial[0]``, up to which readings have
            been taken in.
        inertial: readings of the inertial unit from then to the present, oldest first.
        aiding: for each kind of aiding reading what has arrived since then, oldest
            first.
        modelled: specific force of the nominal vehicle over the period that ends with
            each of ``inertial``, m/s^2, base axes; nothing where the force is measured.
        joints: filtered readings of the encoders. rotor_speeds: speeds of the nominal
            vehicle's motors, rad/s.
        taken, refused: numbers of readings that passed the innovation test, and that
            did not.
        surprise: normalised squared innovation of the last reading; for a matched
            filter its mean is the number of the reading's components.
        slow_rate: low-passed angular velocity, rad/s, base axes; structural zeros
            without a lever arm.
    """

    started: Scalar
    belief: Navigated
    covariance: Covariance
    inertial: tuple[ImuReading, ...]
    aiding: tuple[tuple[Aid, ...], ...]
    joints: FilteredJoints
    modelled: tuple[Vec3, ...]
    rotor_speeds: Scalars
    taken: Scalar
    refused: Scalar
    surprise: Scalar
    slow_rate: Vec3 = ZERO3

    @property
    def deviations(self) -> Scalars:
        """Standard deviation of each component of the error state."""
        return tuple(sqrt(self.covariance[i][i]) for i in range(len(self.covariance)))

    @property
    def yaw_deviation(self) -> Scalar:
        """Standard deviation (rad) of the heading, which grows while no sensor measures
        the heading.
        """
        return sqrt(self.covariance[ATTITUDE + 2][ATTITUDE + 2])

    @property
    def time(self) -> Scalar:
        """Time of the filter's state and covariance, s."""
        return self.inertial[0].time


def in_turn(queue: Sequence[Aid], after: Scalar, until: Scalar) -> tuple[Scalar, Aid]:
    """Find the reading in a queue whose time stamp is in (after, until]; returns a flag
    and the reading.
    """
    reading = queue[0]
    any_due = due_between(queue[0].time, after, until)
    for each in queue[1:]:
        due = due_between(each.time, after, until)
        any_due, reading = logical_or(any_due, due), blend(due, each, reading)
    return any_due, reading


def due_between(time: Scalar, after: Scalar, until: Scalar) -> Scalar:
    """True if a time (s) is after ``after`` and at most ``until``, with a tolerance of
    10 us.
    """
    # 10 us: far below a control period, and far above the rounding of a time
    return logical_and(time > after + 1e-5, time < until + 1e-5)


NEEDED: Mapping[type, str] = {
    ImuReading: "imu",
    PoseReading: "pose",
    PositionReading: "position",
    HeadingReading: "heading",
    EncoderReading: "encoders",
}
"""Reading that the filter may need -> kind of the shipped sensor that takes it."""


def only(kind: type, readings: Mapping[str, Any]) -> Any:
    """First reading of a given type among the readings; None without such a reading."""
    return next((each for each in readings.values() if isinstance(each, kind)), None)


FORCES = ("measured", "modelled")


_DRIFT = "higher values follow a drifting bias faster and estimate it less exactly"


@immutable
class FilterNumbers(Estimator):
    """Parameters of the error-state filter: assumed sensor noise, innovation gate,
    initial standard deviations.

    Attributes:
        aiding: "pose", "position" or "position_heading": the readings that correct the
            inertial unit's.
        delay_periods: control periods by which the filter lags, at least the age of the
            oldest aiding reading.
        force: "measured" by the accelerometer, or "modelled" by the nominal vehicle and
            corrected by it.
        gyro, gyro_walk, accelerometer, accelerometer_walk: densities of noise and of
            the biases' random walks.
        push_walk: density of the random walk of what the model lacks. push_turn: s;
            what it lacks may be fixed to the base and turn with it, which adds (rate x
            push)^2 push_turn to the walk's variance a second.
        position, attitude, heading: deviations of the aiding readings.
        gate: normal deviations beyond which a reading is refused; 0 refuses none.
            inflation: factor of the covariance at a refused reading, so that a filter
            that is wrong itself does not refuse all that would mend it.
        first_velocity, first_tilt, first_heading, first_gyro_bias,
            first_accelerometer_bias, first_push: deviations of what the first readings
            do not determine. start_heading: rad, without a heading reading.
        joint_bandwidth: rad/s, of the filter of the encoders; 0 takes positions and
            rates as they are read.
        gravity: m/s^2; that of the controller's model if left out. vehicle: nominal
            vehicle, given by the loop.
    """

    aiding: str = "pose"
    delay_periods: Annotated[
        int,
        Unit(
            "",
            "control periods by which the filter lags, at least the oldest aiding"
            " reading's age",
            low=0,
            high=100,
        ),
    ] = 0
    force: str = "measured"
    gyro: Annotated[
        Scalar,
        nonnegative(
            "rad/s/sqrt(Hz)",
            "assumed noise density of the gyroscope",
            effect="higher values trust the aiding readings more for the attitude",
        ),
    ] = 0.005
    gyro_walk: Annotated[
        Scalar,
        nonnegative(
            "rad/s^2/sqrt(Hz)",
            "assumed random walk of the gyroscope's bias",
            effect=_DRIFT,
        ),
    ] = 1e-4
    accelerometer: Annotated[
        Scalar,
        nonnegative(
            "m/s^2/sqrt(Hz)",
            "assumed noise density of the accelerometer",
            effect=(
                "higher values trust the aiding readings more for velocity and position"
            ),
        ),
    ] = 0.02
    accelerometer_walk: Annotated[
        Scalar,
        nonnegative(
            "m/s^3/sqrt(Hz)",
            "assumed random walk of the accelerometer's bias",
            effect=_DRIFT,
        ),
    ] = 1e-3
    push_walk: Annotated[
        Scalar,
        nonnegative(
            "m/s^3/sqrt(Hz)",
            "assumed random walk of the specific force beyond the model",
            effect="higher values follow changing forces faster and pass more noise",
        ),
    ] = 0.02
    push_turn: Annotated[
        Scalar,
        nonnegative(
            "s",
            "correlation time of an unmodelled force that turns with the base",
            effect="higher values follow forces fixed to the base better in fast turns",
        ),
    ] = 0.2
    position: Annotated[
        Scalar,
        positive(
            "m",
            "assumed standard deviation of a position reading",
            effect="higher values smooth the position more and follow it later",
        ),
    ] = 0.005
    attitude: Annotated[
        Scalar,
        positive(
            "rad",
            "assumed standard deviation of an attitude reading",
            effect="higher values smooth the attitude more and follow it later",
        ),
    ] = 0.005
    heading: Annotated[
        Scalar,
        positive(
            "rad",
            "assumed standard deviation of a heading reading",
            effect="higher values smooth the heading more and follow it later",
        ),
    ] = 0.02
    gate: Annotated[
        Scalar,
        nonnegative(
            "",
            "innovation gate in standard deviations; 0: no gate",
            effect=(
                "lower values refuse more outliers and more true readings after a jump"
            ),
        ),
    ] = 4.5
    inflation: Annotated[
        Scalar,
        Unit(
            "",
            "factor of the covariance at a refused reading",
            low=1.0,
            effect="higher values accept readings again sooner after a wrong start",
        ),
    ] = 1.5
    first_velocity: Annotated[
        Scalar,
        nonnegative("m/s", "initial standard deviation of the velocity", begins=True),
    ] = 0.1
    first_tilt: Annotated[
        Scalar,
        nonnegative(
            "rad",
            "initial standard deviation of the tilt, without a pose reading",
            begins=True,
        ),
    ] = 0.05
    first_heading: Annotated[
        Scalar,
        nonnegative(
            "rad",
            "initial standard deviation of the heading, without a heading reading",
            begins=True,
        ),
    ] = 0.5
    first_gyro_bias: Annotated[
        Scalar,
        nonnegative(
            "rad/s", "initial standard deviation of the gyroscope's bias", begins=True
        ),
    ] = 0.01
    first_accelerometer_bias: Annotated[
        Scalar,
        nonnegative(
            "m/s^2",
            "initial standard deviation of the accelerometer's bias",
            begins=True,
        ),
    ] = 0.1
    first_push: Annotated[
        Scalar,
        nonnegative(
            "m/s^2",
            "initial standard deviation of the specific force beyond the model",
            begins=True,
        ),
    ] = 2.0
    start_heading: Annotated[
        Scalar, Unit("rad", "initial heading, without a heading reading", begins=True)
    ] = 0.0
    joint_bandwidth: Annotated[
        Scalar,
        nonnegative(
            "rad/s",
            "bandwidth of the encoders' filter; 0: readings unfiltered",
            effect="lower values smooth noisy encoders and add lag",
        ),
    ] = 300.0
    gravity: Annotated[
        Scalar | None,
        nonnegative(
            "m/s^2",
            "gravitational acceleration of the filter; None: that of the controller's"
            " model",
        ),
    ] = None
    imu_position: Annotated[
        Vec3 | None,
        Unit(
            "m",
            "assumed place of the inertial unit from the base origin, base axes; None:"
            " the sensor's",
            usual=FARTHEST,
        ),
    ] = field_if_any(default=None)
    imu_rpy: Annotated[
        Vec3 | None,
        Unit(
            "rad",
            "assumed angles of the inertial unit's axes in the base; None: the"
            " sensor's",
        ),
    ] = field_if_any(default=None)
    vehicle: Vehicle | None = None

    def __post_init__(self) -> None:
        accept_fields(self, "")
        for name, allowed in (("aiding", tuple(AIDS)), ("force", FORCES)):
            if getattr(self, name) not in allowed:
                raise RecordError(
                    f"{name} = {getattr(self, name)!r}: must be one of"
                    f" {', '.join(allowed)}"
                )

    @property
    def uses_model(self) -> bool:
        """True if the specific force comes from the vehicle's model, not from the
        accelerometer.
        """
        return self.force == "modelled"

    @property
    def lever(self) -> Vec3:
        """Place of the inertial unit from the base origin, m, base axes."""
        return ZERO3 if self.imu_position is None else self.imu_position

    def in_base_axes(self, reading: ImuReading) -> ImuReading:
        """Reading of the inertial unit turned from its own axes to base axes."""
        R_BS = None if self.imu_rpy is None else mount_rotation(self.imu_rpy)
        if R_BS is None:
            return reading
        return replace(
            reading,
            rate=R_BS.apply(reading.rate),
            specific_force=R_BS.apply(reading.specific_force),
        )

    def require_sensors(
        self, sensors: Mapping[str, Sensor], rate: float, vehicle: Vehicle
    ) -> None:
        """Refuse sensors that the filter cannot use or whose delays the filter does not
        cover.

        Raises:
            ValueError: one line: a kind of sensor that is missing or there twice, or
                readings that come too late, or whose instant has passed before the
                inertial unit's reading of it comes, or is none of its instants.
        """
        self.require_torques(
            vehicle.name, {each.name: each.drive for each in vehicle.drives}
        )
        lag = self.delay_periods / rate
        aids = AIDS[self.aiding]
        imu = ""
        # the inertial unit first, since the others are compared with its rate and
        # latency
        for kind in (ImuReading, *aids, *((EncoderReading,) if vehicle.n else ())):
            names = [name for name, sensor in sensors.items() if reads(sensor, kind)]
            if len(names) != 1:
                word = NEEDED[kind]
                raise ValueError(
                    f"estimator: needs one sensor of kind {word!r} ([sensors.NAME] with"
                    f" kind = {word!r}); there are {len(names)} of kind {word!r}"
                )
            imu = imu or names[0]
            sensor = sensors[names[0]]
            # 1e-9 s: lag and latency are products of periods, which round
            if kind in aids and sensor.latency > lag + 1e-9:
                raise ValueError(
                    f"estimator.delay_periods: lags {lag:g} s, must be at least"
                    f" sensors.{names[0]}.latency = {sensor.latency:g} s, or those"
                    " readings are never used"
                )
            if kind in aids and sensor.latency < sensors[imu].latency - 1e-9:
                raise ValueError(
                    f"sensors.{imu}.latency = {sensors[imu].latency:g} s: must be at"
                    f" most sensors.{names[0]}.latency = {sensor.latency:g} s, or the"
                    " filter never uses those readings"
                )
            often, seldom = (each.frequency or rate for each in (sensors[imu], sensor))
            # else it would correct the state of one instant by a reading of an earlier
            # one
            if kind in aids and abs(often / seldom - round(often / seldom)) > 1e-9:
                raise ValueError(
                    f"sensors.{names[0]}.frequency = {seldom:g} Hz: must divide that of"
                    f" sensors.{imu}, {often:g} Hz; the filter corrects at readings of"
                    " the inertial unit"
                )

    def require_torques(self, vehicle: str, drives: Mapping[str, Drive]) -> None:
        """Refuse a modelled specific force if the setpoint of some joint drive is not a
        torque or force.

        Raises:
            ValueError: one line with the joint.
        """
        for joint, drive in drives.items() if self.uses_model else ():
            if not drive.takes_torque:
                raise ValueError(
                    f"estimator.force = 'modelled': must be 'measured' for {vehicle!r},"
                    f" whose joint {joint!r} has a drive ({type(drive).__name__}): the"
                    " model takes setpoints for torques"
                )

    def first_covariance(self) -> Covariance:
        """Initial covariance of the error state."""
        # a pose tells tilt and heading alike; else the accelerometer levels the base
        tilt, heading = self.attitude, self.attitude
        if self.aiding != "pose":
            tilt = self.first_tilt
            heading = (
                self.heading
                if self.aiding == "position_heading"
                else self.first_heading
            )
        parts = [self.position] * 3 + [self.first_velocity] * 3 + [tilt, tilt, heading]
        parts += [self.first_gyro_bias] * 3 + [self.first_accelerometer_bias] * 3
        parts += [self.first_push] * 3 if self.uses_model else []
        return diagonal([each * each for each in parts])

    def first_belief(
        self, blank: Navigated, imu: ImuReading, arrived: Sequence[Any]
    ) -> Navigated:
        """Initial estimate at rest from the first readings; without a pose, levelled by
        the accelerometer.
        """
        if self.aiding == "pose":
            attitude = arrived[0].quaternion
        else:
            heading = (
                arrived[1].heading
                if self.aiding == "position_heading"
                else self.start_heading
            )
            attitude = level_attitude(imu.specific_force, heading)
        # the belief is that of the inertial unit's place
        place = arrived[0].position + attitude.rotation().apply(self.lever)
        return replace(blank, position=place, quaternion=attitude)

    def added_variances(
        self, belief: Navigated, reading: ImuReading, dt: Scalar
    ) -> list[Scalar]:
        """Process noise variances of one step, per error component; zero for position
        (third order in dt).
        """
        added: list[Scalar] = [0] * 3
        # with a modelled force the accelerometer corrects, and its noise counts there
        noise = 0 if self.uses_model else self.accelerometer * self.accelerometer
        for density in (
            noise,
            *(
                each * each
                for each in (self.gyro, self.gyro_walk, self.accelerometer_walk)
            ),
        ):
            added += [mul(density, dt)] * 3
        if self.uses_model:
            turning = (
                belief.quaternion.rotation()
                .apply(reading.rate - belief.gyro_bias)
                .cross(belief.push)
            )
            walk = self.push_walk * self.push_walk
            added += [(walk + c * c * self.push_turn) * dt for c in turning]
        return added
