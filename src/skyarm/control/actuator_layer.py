"""Actuator layer around a control law: servo setpoints from joint torques, rotor speeds
from thrust tables.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, ClassVar

from skyarm import dynamics
from skyarm.algebra import Force, Scalar, Scalars
from skyarm.algebra.scalars import add, data, divide, maximum, mul, sqrt, where
from skyarm.control.blocks.common import rotor_thrust
from skyarm.control.blocks.filters import double_pole, low_pass_share
from skyarm.control.controller import (
    Controller,
    ControllerError,
    Law,
    innermost,
    layers,
    with_innermost,
)
from skyarm.control.law_checks import check_controller, checked_law, wrong
from skyarm.control.model import LayerParameters, Model
from skyarm.control.vectored_layer import (
    VectoredMemory,
    angles_seen,
    law_inside,
    pairs_model,
    turns_rotors,
    with_leads,
)
from skyarm.dynamics.actuators import Command, joint_force, make_mixer
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE, Drive
from skyarm.dynamics.actuators.rotor import push, speed_of_push
from skyarm.dynamics.actuators.tilting import turn_rotors
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Place, blend, is_record
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Rotor


@immutable
class ActuatorParameters(LayerParameters):
    """Constants of a control law whose commands pass through servos and rotor thrust
    tables.
    """

    commands_actuators: ClassVar[bool] = True

    @property
    def inner_model(self) -> Model:
        """Model for the inner law: the same vehicle, with rotor thrust k_f W^2 (speed
        W) instead of thrust tables.
        """
        return plain_model(self.model)


OBSERVING = 30.0
"""Bandwidth (rad/s) of the observer of joint accelerations that the model lacks.
Without it a servo's damping takes 16 to 21 % of the force of a joint that presses.
The number is chosen, as quick as observers of the laws."""

FOLLOWING = 120.0
"""Bandwidth (rad/s) of the filter from the measured to the observed joint position,
whose noise a stiff servo turns into torque; chosen, a lag of 8 ms."""


@immutable
class JointMotion:
    """Observed motion of a joint: position, rate, and unmodelled acceleration, as from
    a contact or a load.

    Extended state observer of the rate, both poles at exp(-w dt) (Gao 2003), and a
    first-order filter of the position: a stiff servo would turn the encoder's noise
    into torque.
    """

    position: Annotated[
        Scalar, Unit("rad or m", "joint position predicted for the next measurement")
    ] = 0.0
    rate: Annotated[
        Scalar, Unit("rad/s or m/s", "joint rate predicted for the next measurement")
    ] = 0.0
    unmodelled: Annotated[
        Scalar,
        Unit("rad/s^2 or m/s^2", "joint acceleration beyond the model's, estimated"),
    ] = 0.0

    def correct(
        self, position: Scalar, rate: Scalar, started: Scalar, dt: Scalar
    ) -> JointMotion:
        """Joint motion corrected by measured position and rate; equal to them at the
        first measurement.
        """
        fast, slow = double_pole(OBSERVING, dt)
        # before the first measurement there is no prediction to compare with
        error = where(started, rate - self.rate, 0.0)
        share = low_pass_share(FOLLOWING, dt)
        return JointMotion(
            position=where(
                started, self.position + (position - self.position) * share, position
            ),
            rate=where(started, self.rate + error * fast, rate),
            unmodelled=data(self.unmodelled + error * divide(slow, dt)),
        )

    def ahead(self, acceleration: Scalar, dt: Scalar) -> JointMotion:
        """Joint motion one control period later under a constant acceleration."""
        rate = self.rate + acceleration * dt
        position = self.position + (self.rate + rate) * (0.5 * dt)
        return JointMotion(
            position=data(position), rate=data(rate), unmodelled=self.unmodelled
        )


@immutable
class ActuatorMemory:
    """Internal state of a law with the actuator layer: state of the law, and states of
    the modelled joint drives.

    Attributes:
        inner: memory of the law. started: 0 before the first step.
        drives: memories of the modelled drives; empty where the law's efforts are sent
            as they are.
        joints: observed motions of the joints, predicted for the next measurement;
            empty where ``drives`` is.
    """

    inner: Any
    started: Annotated[Scalar, Unit("", "0 before the first step")]
    drives: tuple[Any, ...]
    joints: tuple[JointMotion, ...] = ()

    def inside(self, par: ActuatorParameters, command: Command) -> Command:
        """Torques and speeds without thrust tables that hold with a command's servo
        setpoints and rotor speeds.

        Torques of motionless joints, by the stiffness of each loop: right for
        differences of setpoints within a period, but for the share of the loop's
        integral.
        """
        efforts = command.efforts
        if self.drives:
            rows = zip(believed_drives(par.model), efforts, strict=True)
            # a setpoint is affine in the torque of a joint at rest: a difference gives
            # its slope
            slopes = [
                (drive.standing(1.0, 0.0) - drive.standing(0.0, 0.0), goal)
                for drive, goal in rows
            ]
            efforts = tuple(
                # a setpoint that no torque moves has none to be converted to
                where(slope > 0.0, divide(goal, slope), 0.0)
                for slope, goal in slopes
            )
        return replace(
            command,
            rotor_speeds=_plain_speeds(par.model, command.rotor_speeds),
            efforts=efforts,
        )


def has_tables(model: Model) -> bool:
    """Return True if a rotor of the model has a thrust table."""
    return any(rotor.table is not None for rotor in model.vehicle.rotors)


def plain_model(model: Model) -> Model:
    """Model whose rotors have thrust k_f W^2 (speed W) instead of thrust tables, and
    speed limits of equal thrust.
    """
    if not has_tables(model):
        return model
    rotors = tuple(
        rotor
        if rotor.table is None
        else replace(rotor, table=None, max_speed=_plain_speed(rotor, rotor.max_speed))
        for rotor in model.vehicle.rotors
    )
    return replace(model, vehicle=replace(model.vehicle, rotors=rotors))


def _plain_speed(rotor: Rotor, speed: Scalar) -> Scalar:
    """Speed (rad/s) at which k_f W^2 equals the thrust table's value at ``speed``."""
    return sqrt(maximum(push(rotor, speed), 0.0))


def _plain_speeds(model: Model, speeds: Scalars) -> Scalars:
    """Speeds (rad/s) of equal thrust of rotors without thrust tables."""
    rows = zip(model.vehicle.rotors, speeds, strict=True)
    return tuple(
        w if rotor.table is None else _plain_speed(rotor, w) for rotor, w in rows
    )


def with_actuators(
    controller: Controller, model: Model, control_period: float, *, servos: bool = True
) -> Controller:
    """Wrap a law so that its joint torques become servo setpoints and its rotor speeds
    pass through thrust tables.

    A servo's loop acts while its setpoint is held, so that the torque varies as the
    joint moves. The setpoint is therefore that whose torque is the law's on average
    over the control period: the modelled servo's law is inverted at the mean position
    and rate of the period, which the modelled vehicle's acceleration under that torque
    predicts, plus the observed acceleration that the model lacks: without it a joint
    whose tip a surface holds would be predicted to move and pushed less than it should
    (:class:`JointMotion`). The servo's own integral and latency are followed by its
    model. Joints without a servo keep their torques.

    To the law a rotor with a thrust table is one with k_f W^2: a commanded speed
    becomes that at which the modelled table gives the same thrust, and a measured one
    the other way round.

    The law, and a safety layer around it, are independent of both: the commands that
    they store stay unchanged.

    Args:
        controller: any law for ``plain_model(model)``.
        model: the controller's, with drives or tables.
        control_period: s.
        servos: whether the law's efforts are torques that drives must be made to give.

    Raises:
        ControllerError: the model's vehicle has neither, or the law has the layer
            already.
    """
    check_controller(controller)
    if commands_actuators(controller):
        raise ControllerError(
            f"servos = true: law {controller.name!r} has its actuators already"
        )
    if not hasattr(controller.par, "mixer"):
        raise wrong(
            controller,
            "has constants without a Mixer: par.mixer must be one for a law on real"
            " actuators",
        )
    if servos and not model.vehicle.drives:
        raise ControllerError(
            "servos = true: the nominal vehicle must have drives ([drives.JOINT] of its"
            " file)"
        )
    drives = believed_drives(model) if servos else ()
    law = partial(actuator_law, inner=checked_law(controller), servos=servos)
    return replace(
        controller,
        law=law,
        par=ActuatorParameters.around(controller.par, model=model),
        memory=ActuatorMemory(
            inner=controller.memory,
            started=0.0,
            drives=tuple(drive.begin(0.0, 0.0, control_period) for drive in drives),
            joints=(JointMotion(),) * len(drives),
        ),
    )


def commands_actuators(controller: Controller) -> bool:
    """True of a law whose commands are those of real actuators, in its layers or by
    itself.
    """
    return any(
        getattr(par, "commands_actuators", False) for par in layers(controller.par)
    )


def with_consequences(
    controller: Controller, changed: Collection[Place], control_period: float
) -> Controller:
    """Controller whose mixer, law and joint drive states are refitted after a change of
    its model's parameters.

    A law whose constants follow from its model has a method ``refit(memory, model,
    control_period)``.

    Args:
        controller: controller with the replaced numbers.
        changed: places of the numbers in it.
        control_period: s.
    """
    vehicle = ("par", "model", "vehicle")
    par = controller.par
    memory = controller.memory
    inside = [
        place[len(vehicle) :] for place in changed if place[: len(vehicle)] == vehicle
    ]
    if any(place[0] == "rotors" for place in inside):
        old = par.mixer
        allocated = pairs_model(par.model) if turns_rotors(controller) else par.model
        # the mixer is the inverse of the rotors' allocation, which has changed
        mixer = make_mixer(
            allocated.vehicle, old.policy, bool(old.across), old.yaw_slack
        )
        par = replace(par, mixer=mixer)
        controller = replace(
            controller,
            # a lead that is replaced itself is stated: it does not follow from the
            # model any more
            par=par if any("lead" in place for place in changed) else with_leads(par),
        )
    controller = _with_layers_refitted(controller, changed)
    own = innermost(controller.par)
    if any(place[0] in ("base", "links") for place in inside) and hasattr(own, "refit"):
        constants, begun = own.refit(innermost(memory), par.model, control_period)
        par = with_innermost(controller.par, constants)
        memory = with_innermost(memory, begun)
        controller = replace(controller, par=par, memory=memory)
    # the memory of a late drive is sized by its latency, so it begins anew
    late = any(place[0] == "drives" and place[-1] == "latency" for place in inside)
    if late and isinstance(memory, ActuatorMemory) and memory.drives:
        drives = tuple(
            drive.begin(0.0, 0.0, control_period)
            for drive in believed_drives(par.model)
        )
        controller = replace(controller, memory=replace(memory, drives=drives))
    return controller


def _with_layers_refitted(
    controller: Controller, changed: Collection[Place]
) -> Controller:
    """Controller whose layers follow changed constants of the law inside, outside of
    the model.

    A layer whose constants follow from its law has a method ``refit_to(law, changed)``.
    """
    par = controller.par
    places = [place[1:] for place in changed if place[:1] == ("par",)]
    # limits: one that is stated no longer follows the law inside
    if not is_record(getattr(par, "inner", None)) or not any(
        place[0] in ("inner", "limits") for place in places
    ):
        return controller
    inside = _with_layers_refitted(
        law_inside(controller), [("par", *p[1:]) for p in places if p[0] == "inner"]
    )
    # layers share model and mixer, which stand with the outermost
    par = replace(par, inner=replace(inside.par, model=None, mixer=None))
    return replace(
        controller,
        par=par.refit_to(inside, places) if hasattr(par, "refit_to") else par,
    )


def measured_places(controller: Controller) -> tuple[Place, ...]:
    """Places, in a controller, of the constants of its layers that are measured on the
    law inside.
    """
    return tuple(
        ("par", *("inner",) * depth, *place)
        for depth, par in enumerate(layers(controller.par))
        for place in getattr(par, "measured_limits", ())
    )


def believed_drives(model: Model) -> tuple[Drive, ...]:
    """Modelled drive of each joint: as listed in the vehicle model, else an ideal
    torque drive.
    """
    carried = {each.name: each.drive for each in model.vehicle.drives}
    return tuple(
        carried.get(joint.name, TORQUE_DRIVE) for joint in model.vehicle.joints
    )


def actuator_law(
    memory: ActuatorMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: ActuatorParameters,
    inner: Law,
    servos: bool,
) -> tuple[ActuatorMemory, Command]:
    """One step of the control law ``inner``, whose command is converted to servo
    setpoints and real rotor speeds.
    """
    own, rotors = par.own, par.model.vehicle.rotors
    turning = _plain_speeds(par.model, measurement.rotor_speeds)
    inner_measurement = replace(measurement, rotor_speeds=turning)
    following, command = inner(memory.inner, inner_measurement, reference, dt, par=own)
    speeds = tuple(
        # to the law a thrust is k_f w^2: w^2 is the thrust at which the table is
        # inverted
        w if rotor.table is None else speed_of_push(rotor, w * w)
        for rotor, w in zip(rotors, command.rotor_speeds, strict=True)
    )
    moved, efforts = memory, command.efforts
    if servos:
        moved, efforts = _setpoints(
            memory, inner_measurement, efforts, own.model, par.model, dt
        )
    moved = replace(moved, inner=following, started=1.0)
    return moved, replace(command, rotor_speeds=speeds, efforts=efforts)


def _setpoints(
    memory: ActuatorMemory,
    measurement: Measurement,
    efforts: Sequence[Scalar],
    plain: Model,
    model: Model,
    dt: Scalar,
) -> tuple[ActuatorMemory, Scalars]:
    """Next states of joint drives and joint observers, and servo setpoints for the
    desired mean joint torques.
    """
    setpoints, drives, ahead = [], [], []
    inner = memory.inner
    still = (0.0,) * len(plain.vehicle.tilts)
    angles = angles_seen(
        measurement, inner.angles if isinstance(inner, VectoredMemory) else still
    )
    started = memory.started > 0.5
    rows = zip(
        believed_drives(model),
        memory.drives,
        memory.joints,
        efforts,
        measurement.joints,
        measurement.joint_rates,
        _accelerations(plain, measurement, angles, efforts),
        strict=True,
    )
    for drive, before, joint, effort, q, qd, modelled in rows:
        seen = joint.correct(q, qd, started, dt)
        qdd = add(modelled, seen.unmodelled)
        # a flight begins with drives that have held the law's torque for long: an
        # integral from zero would let the arm sag first
        begun = drive.steady_memory(before, q, drive.standing(effort, q))
        now = blend(started, before, begun)
        setpoint = data(
            drive.setpoint(
                now, effort, *_mean_motion(drive, seen.position, seen.rate, qdd, dt), dt
            )
        )
        setpoints.append(setpoint)
        drives.append(drive.advance(now, setpoint, q, qd, dt))
        ahead.append(seen.ahead(qdd, dt))
    return replace(memory, drives=tuple(drives), joints=tuple(ahead)), tuple(setpoints)


def _mean_motion(
    drive: Drive, q: Scalar, qd: Scalar, qdd: Scalar, dt: Scalar
) -> tuple[Scalar, Scalar]:
    """Mean joint position and rate over the period that begins when a setpoint arrives,
    at constant acceleration.
    """
    ahead = add(getattr(drive, "latency", 0), 0.5 * dt)
    # mean of t^2 over the period: the square of its middle, and the spread about it
    square = add(mul(ahead, ahead), dt * dt / 12.0)
    return add(add(q, mul(qd, ahead)), mul(qdd, mul(0.5, square))), add(
        qd, mul(qdd, ahead)
    )


def _accelerations(
    model: Model,
    measurement: Measurement,
    angles: Sequence[Scalar],
    efforts: Sequence[Scalar],
) -> Scalars:
    """Joint accelerations of the model under joint torques and rotor thrust, in calm
    air.
    """
    vehicle, rates = model.vehicle, measurement.joint_rates
    torque, force = rotor_thrust(turn_rotors(vehicle, angles), measurement.rotor_speeds)
    rows = zip(vehicle.links, efforts, rates, strict=True)
    torques = tuple(joint_force(link.joint, effort, qd) for link, effort, qd in rows)
    return dynamics.forward_dynamics(
        vehicle,
        measurement.joints,
        measurement.rate,
        rates,
        Force(torque, force),
        torques,
    )[1]
