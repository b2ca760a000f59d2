"""Control law without a simulator: measurement and reference in, set points of body
rates or motors and joints out.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any

from skyarm.algebra import ZERO3_DATA, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import clip
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.control.controller import Controller
from skyarm.control.law_checks import checked_law
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command, speeds_after
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.actuators.rotor import push
from skyarm.links.outside.px4_topics import MOST_MOTORS
from skyarm.links.outside.rate_commands import (
    RateCommand,
    RateLoop,
    angular_acceleration,
    rotor_wrench,
)
from skyarm.records.coerce import refuse
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves, rebuild
from skyarm.records.units import Unit, positive
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement, blank_measurement
from skyarm.vehicle import Vehicle


@immutable
class MotorCommand:
    """Set point for an autopilot: thrust of each rotor as a fraction of its highest, in
    the vehicle's order.
    """

    thrusts: Annotated[
        Scalars, Unit("", "normalized thrust set point of each motor, 0 to 1")
    ]


SetPoint = RateCommand | MotorCommand


@immutable
class MotorSettings:
    """Settings of the loop around a control law whose rotor commands go directly to the
    motors.

    The autopilot keeps its thrust curve, motor order and limits, and none of its loops:
    the law's own bandwidth counts.
    """

    period: Annotated[float, positive("s", "control period of the law")]

    def begin(self, vehicle: Vehicle, speeds: Sequence[float]) -> Vec3:
        """Zero integral torque, since motor set points bypass the autopilot's rate
        loop.
        """
        return ZERO3_DATA

    def set_point(
        self,
        model: Model,
        integral: Vec3,
        measurement: Measurement,
        reference: Reference,
        command: Command,
    ) -> tuple[Vec3, MotorCommand]:
        """Rotor thrusts as fractions of the highest, for a law's commanded rotor
        speeds; integral torque unchanged.
        """
        pairs = zip(model.vehicle.rotors, command.rotor_speeds, strict=True)
        shares = (
            # the push of a rotor grows with the square of its speed: a share of thrust
            # is no share of speed
            clip(push(rotor, speed) / push(rotor, rotor.max_speed), 0.0, 1.0)
            for rotor, speed in pairs
        )
        return integral, MotorCommand(thrusts=tuple(shares))


def require_full_thrust(vehicle: Vehicle) -> None:
    """Raise an error for rotors without a maximum speed, or for more rotors than a set
    point has motors.

    Raises:
        RecordError: a rotor whose ``max_speed`` is infinite, or too many of them.
    """
    if len(vehicle.rotors) > MOST_MOTORS:
        refuse(
            "model.vehicle.rotors",
            len(vehicle.rotors),
            f"must be at most {MOST_MOTORS}, for motor set points",
        )
    for i, rotor in enumerate(vehicle.rotors):
        if not math.isfinite(rotor.max_speed):
            refuse(
                f"model.vehicle.rotors[{i}].max_speed",
                rotor.max_speed,
                "must be finite, for motor set points",
            )


@immutable
class LoopSettings:
    """Settings of the loop around a control law: its period, the autopilot's rate loop,
    full thrust and torque centre.

    Attributes:
        period: period of the law.
        rate_loop: rate loop that is inverted.
        full_thrust: thrust that the autopilot gives at a thrust set point of 1.
        center: point about which the autopilot shares torques among the rotors.
    """

    period: Annotated[float, positive("s", "control period of the law")]
    rate_loop: RateLoop
    full_thrust: Annotated[
        float, positive("N", "thrust of the vehicle at a thrust set point of 1")
    ]
    center: Annotated[
        Vec3,
        Unit(
            "m",
            "point about which the autopilot distributes torques among the rotors, base"
            " axes",
        ),
    ] = ZERO3_DATA

    def begin(self, vehicle: Vehicle, speeds: Sequence[Scalar]) -> Vec3:
        """Initial integral torque (N m) of the rate loop in a hover at given rotor
        speeds (rad/s).
        """
        wrench = rotor_wrench(vehicle, speeds)
        # torque centre: autopilots share torques about it, the wrench is about the
        # origin
        torque = wrench.torque - self.center.cross(wrench.force)
        return Vec3(*map(float, self.rate_loop.begin(torque)))

    def set_point(
        self,
        model: Model,
        integral: Vec3,
        measurement: Measurement,
        reference: Reference,
        command: Command,
    ) -> tuple[Vec3, RateCommand]:
        """Body rates and thrust for a law's command, and the rate loop's integral
        torque after the period.
        """
        applied = rotor_wrench(model.vehicle, command.rotor_speeds)
        torque = applied.torque - self.center.cross(applied.force)
        turning = angular_acceleration(
            model, measurement, reference, applied, command.efforts
        )
        following, error = self.rate_loop.rate_error(
            integral, torque, turning, self.period
        )
        share = clip(applied.force.z / self.full_thrust, 0.0, 1.0)
        # the measured rate plus the error: the loop subtracts the rate that it measures
        return following, RateCommand(rates=measurement.rate + error, thrust=share)


@immutable
class OutsideMemory:
    """Internal state between two periods: of the law, of the modelled rotors, and of
    the rate loop's integral.
    """

    law: Any
    rotor_speeds: Annotated[Scalars, Unit("rad/s", "modelled rotor speeds, unsigned")]
    integral: Annotated[
        Vec3, Unit("N m", "modelled torque of the rate loop's integral, base axes")
    ]


@immutable
class OutsideCommand:
    """Output of one control period: set point of the base, and the command of the
    law.
    """

    base: SetPoint
    law: Command


OTHER = 0.01
"""Fraction by which the speed of a rotor in hover changes at least for a law that needs
an accelerometer."""


class OutsideLaw:
    """Control law evaluated in real time on measured values, compiled to machine code
    if it can be traced.

    No autopilot reports rotor speeds as a law measures them: they are modelled, by the
    rotors' lag under the law's own commands.

    Args:
        controller: controller as it flies in the simulator.
        settings: settings of the loop around it.
        begin: reference with whose joint angles it begins; later ones have its
            structure.

    Raises:
        ControllerError: the controller flies by an autopilot of its own.
    """

    def __init__(
        self,
        controller: Controller,
        settings: LoopSettings | MotorSettings,
        begin: Reference,
    ) -> None:
        self.controller, self.settings = controller, settings
        model = controller.par.model
        # it takes over in a hover, whose rotor speeds no autopilot reports
        trim = hover_trim(model.vehicle, tuple(begin.joints), model.gravity)
        speeds = tuple(map(float, trim.speeds))
        integral = settings.begin(model.vehicle, speeds)
        self._first = OutsideMemory(
            law=controller.memory, rotor_speeds=speeds, integral=integral
        )
        self._step = (
            self._in_machine_code(begin) if controller.compiled else self._in_python()
        )
        self.reset()

    def reset(self) -> None:
        """Restore the initial internal state of the control law."""
        self._begin()

    def needs_accelerometer(self, reference: Reference) -> bool:
        """True if hover at a reference takes other rotor speeds without an
        accelerometer; the law begins anew after it.

        Laws have no field that states it, and the law of a user could not be asked: it
        is tried. A law that notices the missing reading differs by rounding, INDI by 40
        %.
        """
        model, yaw = self.controller.par.model, 0.5 * float(reference.yaw)
        blank = blank_measurement(model.vehicle.n, len(model.vehicle.rotors))
        hover = dataclasses.replace(
            blank,
            position=Vec3(*map(float, reference.position)),
            quaternion=Quaternion(math.cos(yaw), 0.0, 0.0, math.sin(yaw)),
            joints=tuple(map(float, reference.joints)),
        )
        speeds = []
        for force in (ZERO3_DATA, Vec3(0.0, 0.0, float(model.gravity))):
            self.reset()
            law = self.step(
                dataclasses.replace(hover, specific_force=force), reference
            ).law
            speeds.append([float(each) for each in law.rotor_speeds])
        self.reset()
        without, with_one = speeds
        # a speed that is no number is other, too
        return not all(
            abs(a - b) <= OTHER * abs(b) for a, b in zip(without, with_one, strict=True)
        )

    def step(self, measurement: Measurement, reference: Reference) -> OutsideCommand:
        """Evaluate the control law for one period; modelled rotor speeds replace those
        of the measurement.
        """
        return self._step(measurement, reference)

    def _period(
        self, memory: OutsideMemory, measurement: Measurement, reference: Reference
    ) -> tuple[OutsideMemory, OutsideCommand]:
        """One control period, for any scalar type: the law, the set point for its
        command, and the modelled rotors.
        """
        par, settings, dt = self.controller.par, self.settings, self.settings.period
        seen = dataclasses.replace(measurement, rotor_speeds=memory.rotor_speeds)
        law, command = checked_law(self.controller)(
            memory.law, seen, reference, dt, par=par
        )
        integral, base = settings.set_point(
            par.model, memory.integral, seen, reference, command
        )
        speeds = speeds_after(
            par.model.vehicle.rotors, memory.rotor_speeds, command.rotor_speeds, dt
        )
        following = OutsideMemory(law=law, rotor_speeds=speeds, integral=integral)
        return following, OutsideCommand(base=base, law=command.dense())

    def _in_python(self) -> Callable[[Measurement, Reference], OutsideCommand]:
        """Prepare the law for evaluation with Python floats; its internal state may be
        of any type.
        """

        def begin() -> None:
            # a law's own memory may be mutable: each flight begins from an untouched
            # copy
            self._memory = copy.deepcopy(self._first)

        def step(measurement: Measurement, reference: Reference) -> OutsideCommand:
            self._memory, command = self._period(self._memory, measurement, reference)
            return command

        self._begin = begin
        return step

    def _in_machine_code(
        self, example: Reference
    ) -> Callable[[Measurement, Reference], OutsideCommand]:
        """Compile one control period to machine code; without a compiler it is
        evaluated operation by operation.
        """
        vehicle = self.controller.par.model.vehicle
        blank = blank_measurement(vehicle.n, len(vehicle.rotors))
        period = Quick(self._period, self._first, blank, example)
        first = leaves(self._first)
        # views: a step reads its inputs in place
        memory = period.inputs[: len(first)]
        given = period.inputs[len(first) :]
        shape: OutsideCommand = period.result[1]

        def begin() -> None:
            memory[:] = first

        def step(measurement: Measurement, reference: Reference) -> OutsideCommand:
            given[:] = (*leaves(measurement), *leaves(reference))
            period.step()
            memory[:] = period.outputs[: len(first)]
            # the memory stays flat: as a record it takes longer than many a law
            return rebuild(shape, period.outputs[len(first) :].tolist())

        self._begin = begin
        return step
