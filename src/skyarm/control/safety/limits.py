"""Limits of the safety layer, default limits for a controller, and identification of a
law's stiffness in hover.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.controller import (
    Controller,
    ControllerError,
    innermost,
    with_innermost,
)
from skyarm.control.law_checks import checked_law
from skyarm.control.model import Model
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import rules
from skyarm.records.files import errors_as, shown
from skyarm.records.immutable import immutable
from skyarm.records.units import nonnegative, positive
from skyarm.reference import Reference
from skyarm.reference.trajectory import resting_arm
from skyarm.sensing.measurement import blank_measurement
from skyarm.vehicle import Vehicle

STEP = 1e-3
"""Position and velocity step (m and m/s) of the stiffness test, too small to reach the
law's own limits."""

SETTLING = 40
"""Number of answers after which motor speeds have settled at the commands; a law that
inverts their lag then commands its desired speeds. With 400 the stiffness of every
shipped law is the same to six digits."""

PERIOD = 0.005
"""Control period (s) of the stiffness test; a law's stiffness hardly depends on it."""

USUAL = (5.0, 2.7)
"""Default vertical stiffness and damping (1/s^2 and 1/s, RotorS's Hummingbird) of a law
that cannot be tested."""


MEASURED = ("stiffness", "damping")
"""Limits that are measured on the law inside where they are not stated."""


def law_stiffness(controller: Controller) -> tuple[float, float]:
    """Position and velocity gain (1/s^2, 1/s) of a law, from its vertical response to
    small errors in hover.

    Vertical, because there the thrust answers in the same period; horizontal gains are
    taken to be the same. Each call starts from the first memory, so that an observer
    has nothing to learn. A law that starts gently has a method ``after_start`` in its
    memory, which gives the memory at the end of that.

    A law that cannot be traced is taken for a usual one: a predictive one spreads its
    answer over its horizon, so that its first command says little about its stiffness,
    and each first memory may cost it seconds. So is one that sees: its answer depends
    on pictures, which hover alone does not give.
    """
    if not controller.compiled or controller.sees:
        return USUAL
    still = _thrust(controller, 0.0, 0.0)
    mass = float(controller.par.model.vehicle.mass)
    gains = []
    for position, velocity, usual in ((STEP, 0.0, USUAL[0]), (0.0, STEP, USUAL[1])):
        slope = (_thrust(controller, position, velocity) - still) / (mass * STEP)
        # a law that hardly answers an error in hover, or answers later, shows no
        # stiffness: references are then bounded as for a usual one
        gains.append(slope if 0.1 * usual < slope < math.inf else usual)
    return gains[0], gains[1]


def _thrust(controller: Controller, position: float, velocity: float) -> float:
    """Settled thrust (N) of a law along body z for constant vertical position and
    velocity errors.
    """
    model, memory = controller.par.model, controller.memory
    # as it answers in flight, after a gentle start
    if hasattr(own := innermost(memory), "after_start"):
        memory = with_innermost(memory, own.after_start())
    vehicle, joints = model.vehicle, model.vehicle.zeros
    trim = hover_trim(vehicle, joints, model.gravity)
    place, pace = Vec3(0.0, 0.0, position), Vec3(0.0, 0.0, velocity)
    reference = Reference(
        position=place, velocity=pace, **resting_arm(vehicle.n)
    ).dense()
    shares = [
        float(rotor.axis.z * rotor.thrust_coefficient) for rotor in vehicle.rotors
    ]
    resting = blank_measurement(vehicle.n, len(vehicle.rotors))
    speeds, thrust = tuple(map(float, trim.speeds)), float(vehicle.mass * model.gravity)
    law = checked_law(controller)
    for _ in range(SETTLING):
        # an accelerometer feels the thrust: a law that adds to what it measures would
        # else add again and again
        felt = Vec3(0.0, 0.0, thrust / float(vehicle.mass))
        seen = replace(resting, rotor_speeds=speeds, specific_force=felt)
        _, command = law(memory, seen, reference, PERIOD, par=controller.par)
        before = (speeds, thrust)
        speeds = tuple(map(float, command.rotor_speeds))
        thrust = sum(
            share * speed * speed for share, speed in zip(shares, speeds, strict=True)
        )
        if (speeds, thrust) == before:
            # all further answers are the same
            break
    return thrust


# infinity times nothing is no number: what multiplies or is multiplied is finite
_limit = partial(positive, infinite=True)


_SOONER = "lower values replace the law sooner"


@immutable
class Limits:
    """Limits of references, commands and states in the safety layer.

    The defaults are chosen, outside of ordinary flights of the shipped laws: the layer
    must not act where nothing fails.

    Attributes:
        tilt: rad, largest tilt that position and velocity errors together may request.
        climb: m/s^2, largest vertical acceleration they may request, up or down; below
            gravity.
        speed: m/s, largest requested speed.
        step, step_speed: m and m/s, errors that pass whatever a stiff law makes of
            them.
        stiffness, damping: 1/s^2 and 1/s, acceleration that the law commands per
            position and velocity error; of the law that bounded references assume.
        joint_speed: rad/s or m/s, of the joints themselves.
        joint_step: rad or m, steps of a reference that pass; a longer one is slewed at
            ``joint_slew``, rad/s or m/s.
        joint_margin: rad or m, kept from the joints' limits; the references keep twice
            as much.
        joint_pole: 1/s, how fast a joint may close in on a limit of position or speed.
        effort: N m or N.
        rotor_slew: rad/s^2, of the commanded speeds; for tilting rotors, of the pairs
            of fixed ones in their place.
        effort_slew: N m/s or N/s.
        trusted_tilt: rad, trusted_rate: rad/s, trusted_joint_error: rad or m from a
            joint's governed reference, beyond which the law is given up after
            ``patience`` s.
        lost_rate: rad/s, lost_speed: m/s, lost_joint_speed: rad/s or m/s, beyond which
            it is given up at once.
        patience: s.
        calm: s of calm flight after which the law gets the vehicle back; inf never
            gives it back.
    """

    tilt: Annotated[
        float,
        _limit(
            "rad",
            "largest tilt that the errors of position and velocity may request",
            effect="lower values fly more calmly and resist less wind",
        ),
    ] = math.radians(40.0)
    climb: Annotated[
        float,
        _limit(
            "m/s^2",
            "largest vertical acceleration that the errors may request, up or down",
            effect="lower values climb and sink more gently",
        ),
    ]
    speed: Annotated[
        float,
        _limit(
            "m/s",
            "largest speed that the errors may request",
            effect="lower values return from afar more slowly",
        ),
    ] = 4.0
    step: Annotated[
        float,
        _limit(
            "m",
            "position errors up to this size are not shortened, even if `tilt` or"
            " `climb` is then exceeded",
            effect="higher values let a stiff law answer jumps of the reference harder",
        ),
    ] = 0.4
    step_speed: Annotated[
        float,
        _limit(
            "m/s",
            "velocity errors up to this size are not shortened, even if `tilt` or"
            " `climb` is then exceeded",
            effect="higher values let a stiff law answer jumps of the reference harder",
        ),
    ] = 1.5
    stiffness: Annotated[
        float,
        positive(
            "1/s^2",
            "acceleration that the law commands per position error",
            effect=(
                "higher values bound the position error passed to the law more tightly"
            ),
        ),
    ]
    damping: Annotated[
        float,
        positive(
            "1/s",
            "acceleration that the law commands per velocity error",
            effect=(
                "higher values bound the velocity error passed to the law more tightly"
            ),
        ),
    ]
    joint_speed: Annotated[
        tuple[float, ...],
        _limit(
            "rad/s or m/s",
            "largest speed of each joint",
            effect="lower values slow the arm down",
        ),
    ]
    joint_step: Annotated[
        tuple[float, ...],
        _limit(
            "rad or m",
            "largest step of a joint reference that passes unchanged; longer ones are"
            " slewed",
        ),
    ]
    joint_slew: Annotated[
        tuple[float, ...],
        _limit(
            "rad/s or m/s",
            "rate at which longer steps of a joint reference are slewed",
            effect="lower values move the arm more slowly after a step",
        ),
    ]
    joint_margin: Annotated[
        tuple[float, ...],
        nonnegative(
            "rad or m",
            "distance kept from the joint limits; references keep twice as much",
            effect="higher values stop the joints earlier and shrink the workspace",
        ),
    ]
    joint_pole: Annotated[
        float,
        positive(
            "1/s",
            "braking rate k: towards a limit a joint moves at most at k times the"
            " distance left",
            effect="higher values brake later and harder",
        ),
    ] = 25.0
    effort: Annotated[
        tuple[float, ...],
        _limit(
            "N m or N",
            "largest commanded effort of each joint",
            effect="lower values protect the drives and slow the arm down",
        ),
    ]
    rotor_slew: Annotated[
        float,
        _limit(
            "rad/s^2",
            "largest rate of the commanded rotor speeds; a tilting rotor counts as two"
            " fixed rotors",
            effect="lower values spare the motors and delay the thrust",
        ),
    ]
    effort_slew: Annotated[
        tuple[float, ...],
        _limit(
            "N m/s or N/s",
            "largest rate of the commanded joint efforts",
            effect="lower values spare the drives and delay the torque",
        ),
    ]
    trusted_tilt: Annotated[
        float,
        _limit(
            "rad",
            "tilt beyond which the law is replaced after `patience`",
            effect=_SOONER,
        ),
    ] = math.radians(70.0)
    trusted_rate: Annotated[
        float,
        _limit(
            "rad/s",
            "body rate beyond which the law is replaced after `patience`",
            effect=_SOONER,
        ),
    ] = 12.0
    trusted_joint_error: Annotated[
        tuple[float, ...],
        _limit(
            "rad or m",
            "joint error beyond which the law is replaced after `patience`",
            effect=_SOONER,
        ),
    ]
    lost_rate: Annotated[
        float,
        _limit(
            "rad/s",
            "body rate beyond which the law is replaced at once",
            effect=_SOONER,
        ),
    ] = 40.0
    lost_speed: Annotated[
        float,
        _limit("m/s", "speed beyond which the law is replaced at once", effect=_SOONER),
    ] = 15.0
    lost_joint_speed: Annotated[
        tuple[float, ...],
        _limit(
            "rad/s or m/s",
            "joint speed beyond which the law is replaced at once",
            effect=_SOONER,
        ),
    ]
    patience: Annotated[
        float,
        nonnegative(
            "s",
            "time beyond a trusted limit after which the recovery law takes over; inf:"
            " never",
            infinite=True,
            effect=(
                "longer times let a law recover by itself and risk the vehicle longer"
            ),
        ),
    ] = 0.25
    calm: Annotated[
        float,
        _limit(
            "s",
            "time of calm flight after which the law takes over again; inf: never",
            effect="longer times make sure that the vehicle is settled",
        ),
    ] = math.inf


STEEPEST = math.radians(85.0)
"""Largest tilt limit (rad) that may be requested."""


@immutable
class UsualJoint:
    """Default limits of one joint kind, in rad or m and per second.

    Attributes:
        speed: twice what the shipped flights request of their arms, and less than small
            gear motors run free.
        margin: distance that a joint of 12 rad/s covers in one control period of 4 ms.
        error: allowed joint error, above that of any shipped law that tracks joints in
            the paper's cases.
        tip_error: error allowed for a law that moves the joints by the tilt, and by
            more, to keep the tip in place.
        step, slew: largest step of a reference that is no jump, and rate of a jump, the
            pace of a quick reach.
        stow_speed: speed of the arm on its way to its stowed pose, which hardly moves
            the base.
    """

    speed: float
    margin: float
    error: float
    tip_error: float
    step: float
    slew: float
    stow_speed: float


USUAL_JOINTS = {
    "revolute": UsualJoint(
        speed=12.0,
        margin=0.05,
        error=0.6,
        tip_error=1.5,
        step=0.5,
        slew=3.0,
        stow_speed=1.0,
    ),
    "prismatic": UsualJoint(
        speed=1.5,
        margin=0.005,
        error=0.1,
        tip_error=0.3,
        step=0.05,
        slew=0.3,
        stow_speed=0.1,
    ),
}


def usual_joint_errors(vehicle: Vehicle, *, keeps_tip: bool) -> tuple[float, ...]:
    """Default ``trusted_joint_error`` of each joint, larger if the law uses the joints
    to hold the tip.
    """
    usual = [USUAL_JOINTS[joint.kind] for joint in vehicle.joints]
    return tuple(each.tip_error if keeps_tip else each.error for each in usual)


def limits_for(controller: Controller, **given: Any) -> Limits:
    """Default safety limits of a controller, wide enough for its ordinary flights.

    Args:
        controller: its model gives efforts and rotor speeds, its law is tested for its
            stiffness.
        given: fields of :class:`Limits`, in place of the defaults; one number stands
            for every joint.

    Raises:
        ControllerError: an unknown field, or a number out of its range.
    """
    vehicle = controller.par.model.vehicle
    for name in given:
        if name not in rules(Limits):
            raise ControllerError(
                f"safety.{name}: unknown field; allowed: {', '.join(rules(Limits))}"
            )
    values = _defaults(controller)
    per_joint = {name for name, value in values.items() if isinstance(value, tuple)}
    if any(name not in given for name in MEASURED):
        values |= dict(zip(MEASURED, law_stiffness(controller), strict=True))
    for name, value in (values | given).items():
        alone = name in per_joint and not isinstance(value, (list, tuple))
        with errors_as(ControllerError, of=RecordError):
            values[name] = converted = rules(Limits)[name](
                f"safety.{name}", (value,) * vehicle.n if alone else value
            )
        if name in per_joint and len(converted) != vehicle.n:
            said = f"safety.{name} = {shown(value)}: {len(converted)} values"
            raise ControllerError(f"{said}, must be {vehicle.n} (one per joint)")
    limits = Limits(**values)
    for name, top in (
        # the level force is bounded by tan(tilt), which has no value at 90 degrees
        ("tilt", STEEPEST),
        ("trusted_tilt", math.pi),
        # faster downwards than it falls a vehicle would need thrust that pushes down
        ("climb", float(controller.par.model.gravity)),
    ):
        if getattr(limits, name) > top:
            raise ControllerError(
                f"safety.{name} = {getattr(limits, name)!r}: must be at most {top:.4g}"
            )
    for i, (margin, link) in enumerate(
        zip(limits.joint_margin, vehicle.links, strict=True)
    ):
        # references keep twice the margin from either end
        if not 4.0 * margin <= float(link.joint.upper) - float(link.joint.lower):
            raise ControllerError(
                f"safety.joint_margin[{i}] = {margin!r}: must be at most a quarter of"
                " the range"
            )
    return limits


def _defaults(controller: Controller) -> dict[str, Any]:
    """Default limits of a safety layer for the vehicle and kind of a control law."""
    model: Model = controller.par.model
    joints = model.vehicle.joints
    usual = [USUAL_JOINTS[joint.kind] for joint in joints]
    ranges = [float(joint.upper) - float(joint.lower) for joint in joints]
    efforts = tuple(float(joint.effort_limit) for joint in joints)
    fastest = _fastest(model)
    return {
        "climb": 0.5 * float(model.gravity),
        "joint_speed": tuple(each.speed for each in usual),
        "joint_step": tuple(each.step for each in usual),
        "joint_slew": tuple(each.slew for each in usual),
        "joint_margin": tuple(
            # references keep two margins at each end: at least 0.6 of a short range is
            # left
            min(each.margin, 0.1 * width)
            for each, width in zip(usual, ranges, strict=True)
        ),
        "effort": efforts,
        # from rest to full speed in one period of 5 ms: real motors take longer, and a
        # law that inverts lag needs it
        "rotor_slew": 200.0 * fastest if fastest > 0.0 else math.inf,
        "effort_slew": tuple(200.0 * effort for effort in efforts),
        "trusted_joint_error": usual_joint_errors(
            model.vehicle, keeps_tip=controller.keeps_tip
        ),
        "lost_joint_speed": tuple(4.0 * each.speed for each in usual),
    }


def _fastest(model: Model) -> float:
    """Highest rotor speed (rad/s); twice the hover speed for rotors without a limit."""
    trim = hover_trim(model.vehicle, model.vehicle.zeros, model.gravity)
    hover = max(map(float, trim.speeds), default=0.0)
    tops = [float(rotor.max_speed) for rotor in model.vehicle.rotors]
    return max((top if top < math.inf else 2.0 * hover for top in tops), default=0.0)
