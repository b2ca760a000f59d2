"""A law behind the error-state filter, as one step from readings to a command, and the units of its setpoints."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation import Command
from skyarm.actuation.drive import TorqueDrive
from skyarm.actuation.hover import hover_trim
from skyarm.actuation.servo import PositionServo, VelocityServo
from skyarm.compile.c.c_struct import Units
from skyarm.control.controller import Controller
from skyarm.control.law_checks import checked_law
from skyarm.estimate.error_state_filter import ErrorStateFilter
from skyarm.estimate.filter_constants import AIDS, BLANK_INERTIAL, BLANK_READINGS, FilterMemory
from skyarm.records.leaves import leaves, parts
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scalars import Scalar
from skyarm.sensors.sensor_kinds import (
    EncoderReading,
    HeadingReading,
    ImuReading,
    PoseReading,
    PositionReading,
)
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_records import Vehicle

UNITS = {"revolute": "revolute, rad, N m", "prismatic": "prismatic, m, N"}
LENGTHS = {"revolute": "rad", "prismatic": "m"}

SETPOINTS = {"efforts": Unit("", "of each joint what its line above says, in that order")}
"""Of a command some of whose numbers are setpoints."""

SPEEDS = {"rotor_speeds": Unit("rad/s", "unsigned, in the order of the rotors above")}


def units_of(joint: Joint, vehicle: Vehicle) -> str:
    """Kind, unit of the position, and what the command is: an effort, or a setpoint in its unit."""
    kind, effort = UNITS[joint.kind].rsplit(", ", 1)
    return f"{kind}, {_setpoint(joint, vehicle) or effort}"


def _setpoint(joint: Joint, vehicle: Vehicle) -> str:
    """Empty for a joint that takes its torque."""
    drive = drives_of(vehicle).get(joint.name)
    if drive is None:
        return ""
    length = LENGTHS[joint.kind]
    if isinstance(drive, PositionServo):
        return f"setpoint of its position servo in {length}"
    if isinstance(drive, VelocityServo):
        return f"setpoint of its velocity servo in {length}/s"
    return f"setpoint as its drive {type(drive).__name__} takes it"


def drives_of(vehicle: Vehicle) -> dict[str, Any]:
    """Drives by joint whose setpoint is no torque."""
    return {each.name: each.drive for each in vehicle.drives if not isinstance(each.drive, TorqueDrive)}


def command_units(vehicle: Vehicle, *place: str) -> Units:
    """Units of the command that stands at a place, where it holds setpoints."""
    return {place: SPEEDS | SETPOINTS} if drives_of(vehicle) else {}


@dataclass(frozen=True, kw_only=True, slots=True)
class FilterReadings:
    """The last reading of each sensor that has arrived, with its instant; nothing where a sensor is not used.

    The filter tells by the instant whether a reading is new: a reading that did not come is the one before. Force
    and torque at the tip go past the filter to a law that hears them.
    """

    imu: ImuReading
    pose: PoseReading | tuple[()] = ()
    position: PositionReading | tuple[()] = ()
    heading: HeadingReading | tuple[()] = ()
    encoders: EncoderReading | tuple[()] = ()
    tip_force: Annotated[tuple[Scalar, ...], Unit("N", "that pushes the tip, axes of the tip; of a force sensor")] = ()
    tip_torque: Annotated[tuple[Scalar, ...], Unit("N m", "about the tip, likewise; of a law that asks for it")] = ()


AT_TIP = ("tip_force", "tip_torque")
"""What of the readings no filter takes."""


@dataclass(frozen=True, kw_only=True, slots=True)
class EstimatedConstants:
    """What a call does not change: constants of the law and of the filter, and the time between two calls (s)."""

    parameters: Any
    estimator: ErrorStateFilter
    period: Annotated[float, Unit("s", "between two calls")]


@dataclass(frozen=True, kw_only=True, slots=True)
class EstimatedMemory:
    """What filter and law keep, and the last command, which acts until the next."""

    estimate: FilterMemory
    law: Any
    sent: Command


def blank_readings(estimator: ErrorStateFilter, joints: int, tip_force: int = 0, tip_torque: int = 0) -> FilterReadings:
    """Readings whose numbers are not used, of the sensors that a filter takes, and of so many axes of a force."""
    named: dict[type, str] = {PoseReading: "pose", PositionReading: "position", HeadingReading: "heading"}
    aids: dict[str, Any] = {named[kind]: BLANK_READINGS[kind] for kind in AIDS[estimator.aiding]}
    still = (0.0,) * joints
    encoders = EncoderReading(time=0.0, joints=still, joint_rates=still) if joints else ()
    aids |= {"tip_force": (0.0,) * tip_force, "tip_torque": (0.0,) * tip_torque}
    return FilterReadings(imu=BLANK_INERTIAL, encoders=encoders, **aids)


def first_estimated_memory(controller: Controller, estimator: ErrorStateFilter) -> EstimatedMemory:
    """Before the first readings, in hover with all joints at zero: the command that acts then, setpoints for drives."""
    model = controller.par.model
    trim = hover_trim(model.vehicle, (0.0,) * model.vehicle.n, model.gravity)
    drives = drives_of(model.vehicle)
    efforts = tuple(
        drives[link.joint.name].standing(effort, 0.0) if link.joint.name in drives else effort
        for link, effort in zip(model.vehicle.links, trim.efforts, strict=True)
    )
    sent = as_data(Command(rotor_speeds=tuple(trim.speeds), efforts=efforts))
    return EstimatedMemory(estimate=estimator.start(model.vehicle), law=controller.memory, sent=sent)


def estimated_law(controller: Controller) -> Callable[..., tuple[EstimatedMemory, Command]]:
    """The step (constants, readings, reference, memory) -> (memory, command) of a controller behind a filter."""
    law = checked_law(controller)

    def step(
        constants: EstimatedConstants, readings: FilterReadings, reference: Reference, memory: EstimatedMemory
    ) -> tuple[EstimatedMemory, Command]:
        model = constants.parameters.model
        estimator = constants.estimator.believing(model.vehicle, model.gravity)
        arrived = {name: each for name, each in parts(readings).items() if leaves(each) and name not in AT_TIP}
        estimate, measurement = estimator.step(memory.estimate, arrived, memory.sent, constants.period)
        if readings.tip_force:
            force, torque = readings.tip_force, readings.tip_torque
            measurement = dataclasses.replace(measurement, tip_force=force, tip_torque=torque)
        following, command = law(memory.law, measurement, reference, constants.period, par=constants.parameters)
        held = as_data(command)
        return EstimatedMemory(estimate=estimate, law=following, sent=held), held

    return step


def as_data(command: Command) -> Command:
    """A structural zero of a command as data, so that every command has its place."""

    def number(value: Any) -> Any:
        return float(value) if isinstance(value, int) else value

    return Command(
        rotor_speeds=tuple(number(w) for w in command.rotor_speeds),
        efforts=tuple(number(e) for e in command.efforts),
        tilts=tuple(number(a) for a in command.tilts),
    )
