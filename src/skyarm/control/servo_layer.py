"""Torque laws on joints that are driven by servos: each torque becomes the setpoint that gives it by the belief."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from skyarm import dynamics
from skyarm.actuation import Command, Mixer, joint_force
from skyarm.actuation.drive import TORQUE_DRIVE
from skyarm.algebra import Force
from skyarm.compile import leaves, rebuild
from skyarm.control.blocks.common import rotor_thrust
from skyarm.control.controller import Controller, ControllerError, Law
from skyarm.control.law_checks import check_controller, checked_law, wrong
from skyarm.control.model import Model
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scalars import Scalar, add, data, mul, where
from skyarm.sensors.measurement import Measurement


@dataclass(frozen=True, kw_only=True, slots=True)
class ServoParameters:
    """Constants of a torque law on servos: the belief, whose vehicle carries the believed servos, and the law's own.

    Attributes:
        model: belief. mixer: its rotors.
        inner: constants of the law; its model and mixer are those above, given to it at each call.
    """

    model: Model
    mixer: Mixer
    inner: Any


@dataclass(frozen=True, kw_only=True, slots=True)
class ServoLayerMemory:
    """State of a torque law on servos between two steps.

    Attributes:
        inner: memory of the law. started: 0 before the first step.
        drives: memories that the believed servos would have.
    """

    inner: Any
    started: Annotated[Scalar, Unit("", "0 before the first step")]
    drives: tuple[Any, ...]


def with_servos(controller: Controller, control_period: float) -> Controller:
    """Return a torque law whose commands are the setpoints of the servos that its believed vehicle carries.

    A servo's loop acts while its setpoint is held, so that the torque changes as the joint moves. The setpoint is
    therefore that whose torque is the law's on average over the control period: the believed servo's law is inverted at
    the mean position and rate of the period, which the believed vehicle's acceleration under that torque predicts. The
    servo's own integral and latency are followed by its belief. Joints without a servo keep their torques.

    The law, and a safety layer around it, know of torques only: what they keep of their commands stays as it is.

    Args:
        controller: any law whose efforts are torques. control_period: s.

    Raises:
        ControllerError: the believed vehicle carries no drives, or the law has the layer already.
    """
    check_controller(controller)
    if isinstance(controller.par, ServoParameters):
        raise ControllerError(f"servos = true: law {controller.name!r} gives setpoints already")
    if not hasattr(controller.par, "mixer"):
        raise wrong(controller, "has constants without a Mixer: par.mixer must be one for a law on servos")
    model: Model = controller.par.model
    if not model.vehicle.drives:
        raise ControllerError("servos = true: the believed vehicle must carry drives ([drives.JOINT] of its file)")
    inner = dataclasses.replace(controller.par, model=None, mixer=None)
    drives = tuple(drive.begin(0.0, 0.0, control_period) for drive in believed_drives(model))
    return dataclasses.replace(
        controller,
        law=partial(servo_law, inner=controller.law, name=controller.name, compiled=controller.compiled),
        par=ServoParameters(model=model, mixer=controller.par.mixer, inner=inner),
        memory=ServoLayerMemory(inner=controller.memory, started=0.0, drives=drives),
    )


def believed_drives(model: Model) -> tuple[Any, ...]:
    """The drive of each joint as the belief has it."""
    carried = {each.name: each.drive for each in model.vehicle.drives}
    return tuple(carried.get(link.joint.name, TORQUE_DRIVE) for link in model.vehicle.links)


def servo_law(
    memory: ServoLayerMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Any,
    *,
    par: ServoParameters,
    inner: Law,
    name: str,
    compiled: bool,
) -> tuple[ServoLayerMemory, Command]:
    """One step of the law ``inner``, its torques as setpoints."""
    own = dataclasses.replace(par.inner, model=par.model, mixer=par.mixer)
    law = checked_law(Controller(name=name, law=inner, par=own, compiled=compiled))
    following, command = law(memory.inner, measurement, reference, dt, par=own)
    drives = believed_drives(par.model)
    accelerations = _accelerations(par.model, measurement, command.efforts)
    setpoints, kept = [], []
    for i, drive in enumerate(drives):
        q, qd, effort = measurement.joints[i], measurement.joint_rates[i], command.efforts[i]
        begun = drive.begin(q, drive.standing(effort, q), dt)
        held = _blend(memory.started > 0.5, memory.drives[i], begun)
        # means over the period in which the setpoint acts
        late = getattr(drive, "latency", 0)
        ahead = add(late, 0.5 * dt)
        mean_rate = add(qd, mul(accelerations[i], ahead))
        square = add(mul(ahead, ahead), dt * dt / 12.0)
        mean = add(add(q, mul(qd, ahead)), mul(accelerations[i], mul(0.5, square)))
        setpoint = data(drive.setpoint(held, effort, mean, mean_rate))
        setpoints.append(setpoint)
        kept.append(drive.advance(held, setpoint, q, qd, dt))
    moved = ServoLayerMemory(inner=following, started=1.0, drives=tuple(kept))
    return moved, Command(rotor_speeds=command.rotor_speeds, efforts=tuple(setpoints))


def _accelerations(model: Model, measurement: Measurement, efforts: Any) -> tuple[Any, ...]:
    """Joint accelerations of the believed vehicle under torques and the thrust of its rotors as they turn, in calm air."""
    vehicle = model.vehicle
    torque, force = rotor_thrust(vehicle, measurement.rotor_speeds)
    limited = tuple(
        joint_force(link.joint, u, qd)
        for link, u, qd in zip(vehicle.links, efforts, measurement.joint_rates, strict=True)
    )
    return dynamics.forward_dynamics(
        vehicle, measurement.joints, measurement.rate, measurement.joint_rates, Force(torque, force), limited
    )[1]


def _blend(condition: Any, new: Any, old: Any) -> Any:
    return rebuild(old, (where(condition, a, b) for a, b in zip(leaves(new), leaves(old), strict=True)))
