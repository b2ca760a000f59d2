"""Error-state Kalman filter: inertial unit aided by pose, or by position and heading;
joints from encoders.

The inertial unit is integrated at every reading; what is estimated is the error of
that: position, velocity, attitude (a rotation, composed with the estimate), biases. A
reading that is old when it arrives is compared with the belief of its own instant: the
filter lags ``delay_periods`` behind the present, and the inertial readings since then
carry its belief to the present, which is the law's measurement. No delay is
approximated.

With ``force = "modelled"`` the believed vehicle's dynamics say the specific force, and
the accelerometer tells what they lack: a push by the wind or by what is wrong in the
model, which is estimated as a random walk.

Sources: Sola 2017, "Quaternion kinematics for the error-state Kalman filter"; Lefferts,
Markley, Shuster 1982 (multiplicative attitude error); Khosravian, Trumpf, Mahony, Hamel
2015 (delayed filter with forward prediction).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, ClassVar

from skyarm.algebra import ZERO3, ZERO3_DATA, Motion, Scalar, Vec3
from skyarm.algebra.scalars import data, exp, logical_and, logical_not, where
from skyarm.dynamics.actuators import Command, tilting
from skyarm.dynamics.actuators.rotor import speeds_after
from skyarm.records.coerce import RecordError
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data, blend
from skyarm.sensing.estimate.error_state import (
    Covariance,
    Navigated,
    ScalarInnovation,
    gate_of,
    innovations,
    navigate,
    of_specific_force,
    predict_covariance,
    scaled_covariance,
    transition,
    update_by_scalar,
)
from skyarm.sensing.estimate.error_state import correct_state as with_error
from skyarm.sensing.estimate.filter_constants import (
    AIDS,
    TURNING,
    FilterMemory,
    FilterNumbers,
    blank,
    in_turn,
    only,
)
from skyarm.sensing.estimate.filter_models import (
    FilteredJoints,
    filter_joints,
    modelled_force,
)
from skyarm.sensing.measurement import Measurement
from skyarm.sensing.sensor import Sensor, at_origin, specific_force_at
from skyarm.sensing.sensor_kinds import EncoderReading, ImuReading, reads
from skyarm.vehicle import Vehicle


@immutable
class ErrorStateFilter(FilterNumbers):
    """Error-state Kalman filter of position, velocity, attitude and biases from
    inertial and aiding sensors.
    """

    reads_state: ClassVar[bool] = False

    @property
    def on_board(self) -> ErrorStateFilter:
        """Filter that an exported C file contains: this error-state filter itself."""
        return self

    def believing(self, vehicle: Vehicle, gravity: Scalar) -> ErrorStateFilter:
        """Filter that uses the given nominal vehicle and gravity (m/s^2) as its
        model.
        """
        return replace(
            self,
            vehicle=vehicle,
            gravity=gravity if self.gravity is None else self.gravity,
        )

    def placing(self, sensors: Mapping[str, Sensor]) -> ErrorStateFilter:
        """Filter that takes place and angles of the inertial unit from the sensor,
        unless its own fields state them.
        """
        imu = next(
            (each for each in sensors.values() if reads(each, ImuReading)), Sensor()
        )
        position = imu.mounted_at if self.imu_position is None else self.imu_position
        rpy = imu.turned_by if self.imu_rpy is None else self.imu_rpy
        return (
            self
            if at_origin(position) and at_origin(rpy)
            else replace(self, imu_position=position, imu_rpy=rpy)
        )

    def start(self, vehicle: Vehicle) -> FilterMemory:
        """Initial filter state with the initial covariance; the first readings
        initialise the estimate.
        """
        # the present, and the periods by which the filter lags behind it
        still, waiting = (0.0,) * vehicle.n, self.delay_periods + 1
        return FilterMemory(
            started=0.0,
            belief=replace(
                blank(Navigated), push=ZERO3_DATA if self.uses_model else ZERO3
            ),
            covariance=self.first_covariance(),
            inertial=(blank(ImuReading),) * waiting,
            aiding=tuple((blank(kind),) * waiting for kind in AIDS[self.aiding]),
            joints=FilteredJoints(joints=still, rates=still, read=0.0),
            modelled=(ZERO3_DATA,) * waiting if self.uses_model else (),
            rotor_speeds=(0.0,) * len(vehicle.rotors),
            taken=0.0,
            refused=0.0,
            surprise=0.0,
            # without a lever no turning is needed: structure, which folds away
            slow_rate=ZERO3 if at_origin(self.lever) else ZERO3_DATA,
        )

    def step(
        self,
        memory: FilterMemory,
        readings: Mapping[str, Any],
        command: Command,
        dt: float,
    ) -> tuple[FilterMemory, Measurement]:
        """Process the sensor readings that arrived; return the next filter state and
        the present state estimate.
        """
        started = memory.started > 0.5
        imu = self.in_base_axes(only(ImuReading, readings))
        encoders = only(EncoderReading, readings)
        arrived = [only(kind, readings) for kind in AIDS[self.aiding]]
        # until the first step the queue is blank: the first reading fills it, and dt is
        # 0
        before = tuple(blend(started, old, imu) for old in memory.inertial)
        belief = blend(
            started, memory.belief, self.first_belief(memory.belief, imu, arrived)
        )
        joints = memory.joints
        if joints.joints:
            joints = filter_joints(
                joints, encoders, started, self.joint_bandwidth, imu.time, dt
            )
        present = replace(memory, belief=belief, joints=joints)
        now = replace(
            self._advance_rotors(present, imu, command, started, dt),
            # 1 of the memory's own kind: of an array or a traced number, too
            started=memory.started * 0.0 + 1.0,
            inertial=(*before[1:], imu),
            aiding=tuple(
                (*(blend(started, old, new) for old in queue[1:]), new)
                for queue, new in zip(memory.aiding, arrived, strict=True)
            ),
        )
        following = self._apply_aiding(self._predict(now, before[0]), before[0].time)
        measurement = self._measurement(following, imu, encoders)
        if at_origin(self.lever):
            return following, measurement
        slow = blend(started, memory.slow_rate, measurement.rate)
        # the change of the low-passed rate over the period is the angular acceleration:
        # a difference of two rates would be all noise
        share = 1.0 - exp(-TURNING * dt)
        off = measurement.rate - slow
        placed = _at_base_origin(measurement, self.lever, off * (share / dt))
        return replace(following, slow_rate=slow + off * share), placed

    def _advance_rotors(
        self,
        memory: FilterMemory,
        imu: ImuReading,
        command: Command,
        started: Scalar,
        dt: Scalar,
    ) -> FilterMemory:
        """Advance the modelled rotor speeds, and the modelled specific force if used,
        by a period.
        """
        if self.vehicle is None:
            raise RecordError("vehicle: must be given, by believing(vehicle, gravity)")
        turned = speeds_after(
            self.vehicle.rotors, memory.rotor_speeds, command.rotor_speeds, dt
        )
        # before the first step the rotors are taken at their commanded speeds
        speeds = blend(started, turned, as_data(command.rotor_speeds))
        if not self.uses_model:
            return replace(memory, rotor_speeds=speeds)
        belief, joints = memory.belief, memory.joints
        old = blend(started, memory.rotor_speeds, speeds)
        rate = imu.rate - belief.gyro_bias
        velocity = belief.quaternion.rotation().apply_T(belief.velocity) - rate.cross(
            self.lever
        )
        # servos of tilting rotors count as at their commanded angles
        leaning = (
            tilting.turn_rotors(self.vehicle, command.tilts)
            if command.tilts
            else self.vehicle
        )
        force = modelled_force(
            leaning,
            velocity,
            rate,
            joints.joints,
            joints.rates,
            (old, speeds),
            command.efforts,
            self.lever,
        )
        queue = tuple(blend(started, each, force) for each in memory.modelled[1:])
        return replace(memory, rotor_speeds=speeds, modelled=(*queue, force))

    def _predict(self, memory: FilterMemory, before: ImuReading) -> FilterMemory:
        """Predict estimate and covariance over one inertial reading, to the filter's
        delayed instant.
        """
        reading = memory.inertial[0]
        belief = memory.belief
        dt = reading.time - before.time
        R = belief.quaternion.rotation()
        given = memory.modelled[0] if self.uses_model else None
        following, force = navigate(belief, before, reading, self.gravity, dt, given)
        F = transition(R, force, dt, modelled=self.uses_model)
        P = predict_covariance(
            memory.covariance, F, self.added_variances(belief, reading, dt)
        )
        if self.uses_model:
            # noise of a density, averaged over dt; dt is 0 at the first step
            variance = (
                self.accelerometer * self.accelerometer / where(dt > 0.0, dt, 1.0)
            )
            rows = of_specific_force(
                following, reading.specific_force, memory.modelled[0], variance
            )
            # no gate: a difference from the model is what the push is estimated from
            following, P, _ = _apply_innovations(
                following, P, rows, dt > 0.0, float("inf")
            )
        return replace(memory, belief=following, covariance=P)

    def _apply_aiding(self, memory: FilterMemory, after: Scalar) -> FilterMemory:
        """Kalman update by the pose, position or heading readings of the filter's
        delayed instant.
        """
        belief, P = memory.belief, memory.covariance
        taken, refused, surprise = memory.taken, memory.refused, memory.surprise
        for queue in memory.aiding:
            due, reading = in_turn(queue, after, memory.inertial[0].time)
            rows = innovations(
                belief, reading, self.position, self.attitude, self.heading, self.lever
            )
            allowed = where(
                self.gate > 0.0, gate_of(self.gate, len(rows)), float("inf")
            )
            belief, updated, test_value = _apply_innovations(
                belief, P, rows, due, allowed
            )
            passed = logical_and(due, test_value < allowed)
            # not by >=, so that a test value which is no number counts as refused
            failed = logical_and(due, logical_not(test_value < allowed))
            P = scaled_covariance(updated, where(failed, self.inflation, 1.0))
            taken = taken + where(passed, 1.0, 0.0)
            refused = refused + where(failed, 1.0, 0.0)
            surprise = where(due, test_value, surprise)
        return replace(
            memory,
            belief=belief,
            covariance=P,
            taken=taken,
            refused=refused,
            surprise=surprise,
        )

    def _measurement(
        self, memory: FilterMemory, imu: ImuReading, encoders: EncoderReading
    ) -> Measurement:
        """Estimate of the present state, extrapolated from the filter's delayed
        instant.
        """
        present = memory.belief
        # a period without a reading repeats the one before, so its step is of 0 s
        for i, (old, new) in enumerate(pairwise(memory.inertial)):
            given = memory.modelled[i + 1] if self.uses_model else None
            present, _ = navigate(
                present, old, new, self.gravity, new.time - old.time, given
            )
        joints, rates = memory.joints.joints, memory.joints.rates
        if joints:
            # without a bandwidth joints are as the encoders read them
            read = self.joint_bandwidth <= 0.0
            joints = blend(read, encoders.joints, joints)
            rates = blend(read, encoders.joint_rates, rates)
        return Measurement(
            time=data(imu.time),
            position=present.position,
            quaternion=present.quaternion,
            velocity=present.velocity,
            rate=imu.rate - present.gyro_bias,
            specific_force=imu.specific_force - present.accelerometer_bias,
            joints=joints,
            joint_rates=rates,
            rotor_speeds=memory.rotor_speeds,
        )


def _at_base_origin(at_imu: Measurement, place: Vec3, turning: Vec3) -> Measurement:
    """Measurement at an inertial unit carried to the base origin.

    Args:
        at_imu: with position, velocity and specific force of the inertial unit.
        place: of the inertial unit from the base origin, m, base axes.
        turning: angular acceleration, rad/s^2, base axes.
    """
    R = at_imu.quaternion.rotation()
    there = Motion(angular=turning, linear=at_imu.specific_force)
    return replace(
        at_imu,
        position=at_imu.position - R.apply(place),
        velocity=at_imu.velocity - R.apply(at_imu.rate.cross(place)),
        specific_force=specific_force_at(-place, there, at_imu.rate),
    )


def _apply_innovations(
    belief: Navigated,
    P: Covariance,
    rows: Sequence[ScalarInnovation],
    due: Scalar,
    allowed: Scalar,
) -> tuple[Navigated, Covariance, Scalar]:
    """Kalman update by a reading's innovations, if the reading is due and within the
    gate; also the test value.
    """
    error: list[Scalar] = [0] * len(P)
    surprise: Scalar = 0
    # all scalars first, then all or none: an outlier in one refuses the reading
    after = P
    for row in rows:
        after, error, part = update_by_scalar(
            after, error, row.H, row.value, row.variance
        )
        surprise = surprise + part
    passed = logical_and(due, surprise < allowed)
    return (
        blend(passed, with_error(belief, error), belief),
        blend(passed, after, P),
        surprise,
    )
