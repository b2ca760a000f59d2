"""Safety layer around any controller: limited reference, law, supervisor, recovery and
limited command.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Any

from skyarm.algebra import ZERO3, ZERO3_DATA, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import absolute, divide, logical_or, where
from skyarm.control.blocks.common import no_command
from skyarm.control.blocks.geometric import yaw_of
from skyarm.control.blocks.select import choose, choose_each
from skyarm.control.controller import (
    Controller,
    ControllerError,
    Law,
    with_applied_command,
)
from skyarm.control.law_checks import LawError, check_controller, checked_law, wrong
from skyarm.control.law_maker import default_gains, default_joint_gains
from skyarm.control.model import LayerParameters, Model
from skyarm.control.safety.bounds import (
    apply_joint_barrier,
    govern_base,
    govern_joints,
    limit_slew,
    reachable,
    with_priorities,
    within_efforts,
)
from skyarm.control.safety.limits import (
    MEASURED,
    USUAL_JOINTS,
    Limits,
    law_stiffness,
    limits_for,
)
from skyarm.control.safety.recovery import (
    Confidence,
    Recovery,
    finite,
    not_finite,
    pose_of,
    recover,
    update_confidence,
)
from skyarm.control.vectored_layer import law_inside, with_tilting
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.workspace import middle_position
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.files import shown
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Place, blend, leaves, parts, rebuild, replace_at
from skyarm.records.path_names import Names, field_paths
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.reference.trajectory import resting_arm
from skyarm.sensing.measurement import Measurement


@immutable
class SafetyParameters(LayerParameters):
    """Constants of a law inside the safety layer: limits and recovery law.

    Attributes:
        limits: limits of references and commands. recovery: constants of the recovery
            law.
        stated: those of the measured limits that do not follow from the law inside.
    """

    limits: Limits
    recovery: Recovery
    stated: tuple[str, ...] = field_if_any(default=())

    def path_names(self) -> Names:
        """Parameter paths of the constants; the names of the stated limits have
        none.
        """
        return {
            name: each for name, each in field_paths(self).items() if name != "stated"
        }

    @property
    def measured_limits(self) -> tuple[Place, ...]:
        """Places, in these constants, of the limits that follow from the law inside."""
        return tuple(("limits", name) for name in MEASURED if name not in self.stated)

    def refit_to(self, law: Controller, changed: Collection[Place]) -> SafetyParameters:
        """Constants whose limits follow from the law inside, after a change of its
        constants.

        Args:
            law: law inside, as it is now. One with symbols or lanes cannot be measured:
                its limits stay.
            changed: places of the changed numbers, in these constants. A limit among
                them is a stated one from now on.
        """
        stated = tuple(
            name
            for name in MEASURED
            if name in self.stated or ("limits", name) in changed
        )
        par = self if stated == self.stated else replace(self, stated=stated)
        follows = par.measured_limits and any(place[0] == "inner" for place in changed)
        # a law with symbols gives no numbers to measure
        if not follows or not concrete(*leaves(law.par)):
            return par
        found = dict(zip(MEASURED, law_stiffness(law), strict=True))
        return replace_at(
            par, {place: found[place[-1]] for place in par.measured_limits}
        )


@immutable
class SafetyMemory:
    """Internal state of a law with the safety layer: state of the law, limited
    references, supervisor and last command.

    Attributes:
        inner: state of the law.
        started: 0 before the first step.
        joints: governed references of the law, rad or m. ramping: 1 where one is on its
            way.
        arm: governed joint references of the recovery.
        sent: the last command.
        confidence: state of the failure detection. hold: hover position of the
            recovery, m. yaw: its heading, rad.
    """

    inner: Any
    started: Annotated[Scalar, Unit("", "0 before the first step")]
    joints: Annotated[Scalars, Unit("rad or m", "governed joint references of the law")]
    ramping: Annotated[
        Scalars, Unit("", "1 for each joint whose reference is being slewed")
    ]
    arm: Annotated[Scalars, Unit("rad or m", "joint references of the recovery")]
    sent: Command
    confidence: Confidence
    hold: Annotated[Vec3, Unit("m", "hover position of the recovery, world axes")]
    yaw: Annotated[Scalar, Unit("rad", "heading of the recovery")]


def first_memory(controller: Controller) -> SafetyMemory:
    """Initial internal state of a controller with the safety layer."""
    vehicle = controller.par.model.vehicle
    still = vehicle.zeros
    return SafetyMemory(
        inner=controller.memory,
        started=0.0,
        joints=still,
        ramping=still,
        arm=still,
        sent=no_command(vehicle),
        confidence=Confidence(given_up=0.0, outside=0.0, calm=0.0),
        hold=ZERO3_DATA,
        yaw=0.0,
    )


@immutable
class Governed:
    """Reference of the law after the safety layer's limits, with flags of the limited
    joints.

    Attributes:
        reference: governed. ramping: 1 for each joint whose reference is on its way.
        joints: rad or m, where the governed references stood one period ago.
    """

    reference: Reference
    ramping: Scalars
    joints: Scalars


def govern(
    par: SafetyParameters,
    memory: SafetyMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
) -> Governed:
    """Reference for the law within the safety layer's limits."""
    limits = par.limits
    joints = choose_each(memory.started > 0.5, memory.joints, measurement.joints)
    base = govern_base(
        reference,
        measurement,
        limits=limits,
        stiffness=limits.stiffness,
        damping=limits.damping,
        gravity=par.model.gravity,
    )
    reference, ramping = govern_joints(
        base,
        joints,
        memory.ramping,
        limits.joint_slew,
        limits.joint_step,
        dt,
        model=par.model,
        limits=limits,
    )
    return Governed(reference=reference, ramping=ramping, joints=joints)


def arbitrate(
    par: SafetyParameters,
    memory: SafetyMemory,
    measurement: Measurement,
    governed: Governed,
    desired: Command,
    failed: Scalar,
    dt: Scalar,
) -> SafetyMemory:
    """Choose between the law and the recovery; return the safety layer's next internal
    state.

    Args:
        par: constants.
        memory: before the step.
        measurement: now.
        governed: reference that the law was given.
        desired: command of the law.
        failed: whether the law's command or memory cannot be used.
        dt: s.
    """
    confidence = update_confidence(
        par.limits, memory.confidence, measurement, governed.joints, failed, dt
    )
    given_up, before = confidence.given_up > 0.5, memory.confidence.given_up > 0.5
    # while the law flies both follow the measurement
    hold = choose(before, memory.hold, measurement.position)
    yaw = where(before, memory.yaw, yaw_of(measurement.quaternion))
    arm = choose_each(before, memory.arm, measurement.joints)
    hovering = _hold_reference(par, measurement, hold, yaw, arm, dt)
    rescue = recover(par.recovery, par.model, par.mixer, measurement, hovering)
    # from the number itself, so that the 1 is of its kind: array, symbol or dual
    return SafetyMemory(
        inner=memory.inner,
        started=memory.started * 0.0 + 1.0,
        # a law that comes back goes on from where the joints are, not from where they
        # were
        joints=choose_each(given_up, measurement.joints, governed.reference.joints),
        ramping=choose_each(given_up, (0.0,) * len(governed.joints), governed.ramping),
        arm=hovering.joints,
        sent=limit_command(
            par,
            memory,
            measurement,
            blend(given_up, rescue.dense(), desired.dense()),
            dt,
        ),
        confidence=confidence,
        hold=hold,
        yaw=yaw,
    )


def _hold_reference(
    par: SafetyParameters,
    measurement: Measurement,
    hold: Vec3,
    yaw: Scalar,
    arm: Sequence[Scalar],
    dt: Scalar,
) -> Reference:
    """Reference of the recovery: hover in place and stow the arm."""
    still = (0.0,) * len(par.recovery.stow)
    arm_at_rest = resting_arm(len(still)) | {"joints": par.recovery.stow}
    hover = Reference(position=hold, velocity=ZERO3, yaw=yaw, **arm_at_rest)
    mass, gains = par.model.vehicle.mass, par.recovery.gains
    base = govern_base(
        hover,
        measurement,
        limits=par.limits,
        # vertical ones, as those that are measured on a law
        stiffness=divide(gains.position.z, mass),
        damping=divide(gains.velocity.z, mass),
        gravity=par.model.gravity,
    )
    speeds = par.recovery.stow_speed
    return govern_joints(
        base, arm, still, speeds, still, dt, model=par.model, limits=par.limits
    )[0]


def limit_command(
    par: SafetyParameters,
    memory: SafetyMemory,
    measurement: Measurement,
    command: Command,
    dt: Scalar,
) -> Command:
    """Command within actuator limits, slew rates and the joint barrier."""
    limits = par.limits
    efforts = within_efforts(limits, command.efforts)
    if efforts:
        # the barrier adds efforts, which must not exceed the limits either
        efforts = within_efforts(
            limits, apply_joint_barrier(par.model, limits, measurement, efforts)
        )
    turning = reachable(par.model, par.mixer, command.rotor_speeds)
    near = limit_slew(
        Command(rotor_speeds=turning, efforts=efforts),
        memory.sent,
        memory.started,
        limits.rotor_slew,
        limits.effort_slew,
        dt,
    )
    # what is not finite is not sent: it stays as it was sent last
    return rebuild(
        memory.sent,
        (
            where(absolute(a) < float("inf"), a, b)
            for a, b in zip(leaves(near), leaves(memory.sent), strict=True)
        ),
    )


FAILURES = (ArithmeticError, ValueError, RuntimeError)
"""Exceptions of arithmetic and solvers, such as numpy's LinAlgError; others are
mistakes in a law's code."""


def with_safety_layer(
    controller: Controller,
    limits: Limits | Mapping[str, Any] | None = None,
    *,
    stow: tuple[float, ...] | None = None,
) -> Controller:
    """Wrap a controller in the safety layer.

    In order, each period: the reference is governed
    (:mod:`skyarm.control.safety.bounds`); the law steps on it; if it is given up
    (:mod:`skyarm.control.safety.recovery`) the recovery flies in its place, the arm on
    its way to ``stow``; the joints are kept from their limits, efforts and rotor speeds
    brought within theirs, yaw given up first; steps from the last command are bounded;
    a number that is not finite becomes the last one sent. The law's memory gets the
    applied command (:func:`skyarm.control.controller.with_applied_command`).

    A law given up starts anew, from its first memory, after ``limits.calm`` seconds of
    calm flight; by default it does not come back. After a measurement that is not
    finite the last command stands.

    A law that cannot be traced gets the layer as well, in Python. Of its memory, which
    may be anything, nothing is looked at; an error of its numbers or its solver
    (``FAILURES``, a record refused among them) gives it up; while the recovery flies it
    is not called.

    Args:
        controller: any law. Its own constants are then found under
            ``controller.inner``.
        limits: or some of their fields; the others are
            :func:`skyarm.control.safety.limits.limits_for`'s.
        stow: rad or m, pose of the arm when the law is given up; the middle of each
            joint's range if left out, zero for a joint without limits.

    Raises:
        ControllerError: no controller, one that has a safety layer already, or limits
            or a pose that do not fit.
    """
    if not isinstance(controller, Controller):
        raise ControllerError(f"controller = {shown(controller)}: must be a Controller")
    if isinstance(controller.par, SafetyParameters):
        raise ControllerError(
            f"controller = {controller.name!r}: has a safety layer already"
        )
    check_controller(controller)
    if getattr(controller.par, "turns_rotors", False):
        # rotor speeds are reallocated by a mixer of fixed rotors, so the layer goes
        # inside the one for tilting rotors
        inside = with_safety_layer(law_inside(controller), limits, stow=stow)
        return with_tilting(inside, controller.par.model)
    if not hasattr(controller.par, "mixer"):
        raise wrong(
            controller,
            "has constants without a Mixer: par.mixer must be one for a law with a"
            " safety layer",
        )
    model: Model = controller.par.model
    links = model.vehicle.links
    recovery = Recovery(
        gains=default_gains(model),
        joint_gains=default_joint_gains(model, torque=True),
        stow=(
            tuple(middle_position(link.joint) for link in links)
            if stow is None
            else pose_of(stow, links)
        ),
        stow_speed=tuple(USUAL_JOINTS[link.joint.kind].stow_speed for link in links),
    )
    par = SafetyParameters.around(
        controller.par,
        model=model,
        # a mixer that clips cuts roll and pitch like the rest: ranked, yaw is given up
        # first
        mixer=with_priorities(model, controller.par.mixer),
        limits=_limits(controller, limits),
        recovery=recovery,
        stated=tuple(
            name
            for name in MEASURED
            if isinstance(limits, Limits) or name in (limits or ())
        ),
    )
    return Controller(
        name=f"guarded_{controller.name}",
        # exceptions cannot be caught in a program, and branches cannot be traced; a
        # functools.partial, unlike a closure, can be pickled
        law=partial(
            _traced_law if controller.compiled else _called_law,
            inner=checked_law(controller),
            first=controller.memory,
            margin=controller.margin,
        ),
        par=par,
        memory=first_memory(controller),
        compiled=controller.compiled,
        keeps_tip=controller.keeps_tip,
        sees=controller.sees,
    )


def _limits(controller: Controller, limits: Any) -> Limits:
    """Safety limits from a user's option, with defaults for omitted fields."""
    if limits is None:
        return limits_for(controller)
    if isinstance(limits, Limits):
        return limits_for(controller, **parts(limits))
    if isinstance(limits, Mapping):
        return limits_for(controller, **limits)
    raise ControllerError(
        f"safety = {shown(limits)}: must be Limits or a mapping of some of their fields"
    )


def _traced_law(
    memory: SafetyMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: SafetyParameters,
    inner: Law,
    first: Any,
    margin: Callable[[Quaternion], Scalar] | None,
) -> tuple[SafetyMemory, Command]:
    """Step of a control law within the safety layer: limited reference and command,
    recovery on failure.

    ``inner`` is the law, ``first`` its first memory and ``margin`` its distance to
    where it is not defined.
    """
    governed = govern(par, memory, measurement, reference, dt)
    following, desired = inner(
        memory.inner, measurement, governed.reference, dt, par=par.own
    )
    failed = logical_or(not_finite(desired), not_finite(following))
    if margin is not None:
        failed = logical_or(failed, margin(measurement.quaternion) < 0.0)
    new = arbitrate(par, memory, measurement, governed, desired, failed, dt)
    # the law starts anew when it comes back
    law_memory = blend(new.confidence.given_up > 0.5, first, following)
    new = replace(new, inner=with_applied_command(law_memory, new.sent))
    seen = finite(measurement)
    return blend(seen, new, memory), blend(seen, new.sent, memory.sent)


def _called_law(
    memory: SafetyMemory,
    measurement: Measurement,
    reference: Reference,
    dt: float,
    *,
    par: SafetyParameters,
    inner: Law,
    first: Any,
    margin: Callable[[Quaternion], Scalar] | None,
) -> tuple[SafetyMemory, Command]:
    """Step, in plain floats, of an untraceable law inside the safety layer."""
    if not finite(measurement):
        return memory, memory.sent
    governed = govern(par, memory, measurement, reference, dt)
    following = first
    desired = memory.sent
    failed = False
    # from its first memory a law may have much to prepare, in vain while the recovery
    # flies
    if memory.confidence.given_up < 0.5:
        try:
            following, desired = inner(
                memory.inner, measurement, governed.reference, dt, par=par.own
            )
            failed = not finite(desired) or (
                margin is not None and margin(measurement.quaternion) < 0.0
            )
        except LawError as error:
            # a mistake in its code, but for a record that its numbers do not make
            if not isinstance(error.__cause__, RecordError):
                raise
            failed = True
        except FAILURES:
            failed = True
    new = arbitrate(par, memory, measurement, governed, desired, failed, dt)
    law_memory = first if new.confidence.given_up > 0.5 else following
    return replace(new, inner=with_applied_command(law_memory, new.sent)), new.sent
