"""Limits of the safety layer, their defaults for a controller, and the stiffness of a law measured at its actuators."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Vec3
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.law_checks import checked_law
from skyarm.control.model import Model
from skyarm.files import number, shown
from skyarm.records.leaves import field_names
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scalars import Scalar
from skyarm.sensors.measurement import blank_measurement
from skyarm.vehicle.linkage import Joint

STEP = 1e-3
"""m and m/s: small, so that no limit of the law's own is met."""

SETTLING = 40
"""Calls in which the motors' speeds follow the commands: a law that inverts their lag then commands what it wants."""

PERIOD = 0.005
"""s; the stiffness of a law hardly depends on it."""

USUAL = (5.0, 2.7)
"""1/s^2 and 1/s, RotorS's Hummingbird: for a law whose thrust does not answer a vertical error, or cannot be asked."""


def law_stiffness(controller: Controller) -> tuple[float, float]:
    """(1/s^2, 1/s): commanded vertical acceleration per position and velocity error, in hover at the model's zero pose.

    Vertical, because there the thrust answers in the same period; horizontal gains are taken to be the same. Each call
    starts from the first memory, so that an observer has nothing to learn.

    A law that cannot be traced is taken for a usual one: a predictive one spreads its answer over its horizon, so
    that its first command tells little of its pull, and each first memory may cost it seconds.
    """
    if not controller.compiled:
        return USUAL
    still = _thrust(controller, 0.0, 0.0)
    mass = float(controller.par.model.vehicle.mass)
    found = []
    for position, velocity, usual in ((STEP, 0.0, USUAL[0]), (0.0, STEP, USUAL[1])):
        slope = (_thrust(controller, position, velocity) - still) / (mass * STEP)
        found.append(slope if 0.1 * usual < slope < math.inf else usual)
    return found[0], found[1]


def _thrust(controller: Controller, position: float, velocity: float) -> float:
    """Thrust along body z, N, of the model's rotors at the speeds a law settles on with these errors of z."""
    model = controller.par.model
    vehicle, joints = model.vehicle, (0.0,) * model.vehicle.n
    trim = hover_trim(vehicle, joints, model.gravity)
    arm: dict[str, Any] = {f"joint{word}": joints for word in ("s", "_rates", "_accelerations", "_jerks", "_snaps")}
    wanted = dataclasses.replace(
        Reference(**arm), position=Vec3(0.0, 0.0, position), velocity=Vec3(0.0, 0.0, velocity)
    ).dense()
    weight = Vec3(0.0, 0.0, float(model.gravity))
    resting = dataclasses.replace(blank_measurement(vehicle.n, len(vehicle.rotors)), specific_force=weight)
    speeds = tuple(float(speed) for speed in trim.speeds)
    law = checked_law(controller)
    for _ in range(SETTLING):
        seen = dataclasses.replace(resting, rotor_speeds=speeds)
        _, command = law(controller.memory, seen, wanted, PERIOD, par=controller.par)
        speeds = tuple(float(speed) for speed in command.rotor_speeds)
    shares = (rotor.axis.z * rotor.thrust_coefficient for rotor in vehicle.rotors)
    return sum(float(share) * speed * speed for share, speed in zip(shares, speeds, strict=True))


@dataclass(frozen=True, kw_only=True, slots=True)
class Limits:
    """Limits of references, commands and states of a law with the safety layer. Tuples have one entry per joint.

    Attributes:
        tilt: rad, largest tilt that position and velocity errors together may ask for.
        climb: m/s^2, largest vertical acceleration they may ask for, up or down; below gravity.
        speed: m/s, largest speed that is asked for.
        step, step_speed: m and m/s, errors that pass whatever a stiff law makes of them.
        stiffness, damping: 1/s^2 and 1/s, acceleration the law asks per position and velocity error; what the governor
            takes the law for.
        joint_speed: rad/s or m/s, of the joints themselves.
        joint_step: rad or m, steps of a reference that pass; a longer one is slewed at ``joint_slew``, rad/s or m/s.
        joint_margin: rad or m, kept from the joints' limits; the references keep twice as much.
        joint_pole: 1/s, how fast a joint may close in on a limit of position or speed.
        effort: N m or N.
        rotor_slew: rad/s^2, of the commanded speeds. effort_slew: N m/s or N/s.
        trusted_tilt: rad, trusted_rate: rad/s, trusted_joint_error: rad or m from a joint's governed reference, beyond
            which the law is given up after ``patience`` s.
        lost_rate: rad/s, lost_speed: m/s, lost_joint_speed: rad/s or m/s, beyond which it is given up at once.
        patience: s.
        calm: s of calm flight after which the law gets the vehicle back; inf never gives it back.
    """

    tilt: Annotated[Scalar, Unit("rad", "asked for", infinite=True)]
    climb: Annotated[Scalar, Unit("m/s^2", "asked for, up or down", infinite=True)]
    speed: Annotated[Scalar, Unit("m/s", "asked for", infinite=True)]
    step: Annotated[Scalar, Unit("m", "error that passes", infinite=True)]
    step_speed: Annotated[Scalar, Unit("m/s", "error that passes", infinite=True)]
    stiffness: Annotated[Scalar, Unit("1/s^2", "acceleration the law asks per position error")]
    damping: Annotated[Scalar, Unit("1/s", "acceleration the law asks per velocity error")]
    joint_speed: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "of the joints", infinite=True)]
    joint_step: Annotated[tuple[Scalar, ...], Unit("rad or m", "step of a reference that passes", infinite=True)]
    joint_slew: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "of longer steps of a reference", infinite=True)]
    joint_margin: Annotated[tuple[Scalar, ...], Unit("rad or m", "kept from the joints' limits")]
    joint_pole: Annotated[Scalar, Unit("1/s", "how fast a joint closes in on a limit")]
    effort: Annotated[tuple[Scalar, ...], Unit("N m or N", infinite=True)]
    rotor_slew: Annotated[Scalar, Unit("rad/s^2", "of the commanded speeds", infinite=True)]
    effort_slew: Annotated[tuple[Scalar, ...], Unit("N m/s or N/s", infinite=True)]
    trusted_tilt: Annotated[Scalar, Unit("rad", "largest for longer than patience", infinite=True)]
    trusted_rate: Annotated[Scalar, Unit("rad/s", "largest for longer than patience", infinite=True)]
    trusted_joint_error: Annotated[
        tuple[Scalar, ...], Unit("rad or m", "largest for longer than patience", infinite=True)
    ]
    lost_rate: Annotated[Scalar, Unit("rad/s", "largest for a moment", infinite=True)]
    lost_speed: Annotated[Scalar, Unit("m/s", "largest for a moment", infinite=True)]
    lost_joint_speed: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s", "largest for a moment", infinite=True)]
    patience: Annotated[Scalar, Unit("s", infinite=True)]
    calm: Annotated[Scalar, Unit("s", "of calm flight before the law starts anew", infinite=True)]


STEEPEST = math.radians(85.0)
"""Of the tilt that may be asked for."""

SPEEDS = {"revolute": 12.0, "prismatic": 1.5}
"""rad/s and m/s: twice what the shipped flights ask of their arms, and less than small gear motors run free."""

MARGINS = {"revolute": 0.05, "prismatic": 0.005}
"""rad and m: what a joint of 12 rad/s covers in one control period of 4 ms."""


ERRORS = {"revolute": 0.6, "prismatic": 0.1}
"""rad and m: more than any shipped law that tracks joints loses them by in the paper's cases."""

TIP_ERRORS = {"revolute": 1.5, "prismatic": 0.3}
"""rad and m: the same for a law that moves the joints by the tilt, and by more, to keep the tip in place."""

STEPS = {"revolute": (0.5, 3.0), "prismatic": (0.05, 0.3)}
"""(rad, rad/s) and (m, m/s) of a joint's reference: above those a law meets as a jump, at the pace of a quick reach."""

PER_JOINT = (
    "joint_speed",
    "joint_step",
    "joint_slew",
    "joint_margin",
    "effort",
    "effort_slew",
    "trusted_joint_error",
    "lost_joint_speed",
)

FINITE = ("stiffness", "damping", "joint_margin", "joint_pole")
"""Fields that multiply or are multiplied: infinity times nothing is no number."""

MOST = {
    "speed": 1e3,
    "step": 1e3,
    "step_speed": 1e3,
    "stiffness": 1e4,
    "damping": 1e4,
    "joint_speed": 1e4,
    "joint_step": 1e3,
    "joint_slew": 1e4,
    "joint_margin": 1e3,
    "joint_pole": 1e4,
    "effort": 1e6,
    "rotor_slew": 1e9,
    "effort_slew": 1e9,
    "trusted_rate": 1e4,
    "trusted_joint_error": 1e3,
    "lost_rate": 1e5,
    "lost_speed": 1e4,
    "lost_joint_speed": 1e5,
    "patience": 1e6,
    "calm": 1e6,
}
"""Upper ends, or the default where that is more: far beyond any vehicle, squares and products far from overflow.

Infinity stands for no limit, except in ``FINITE``. Tilts and climb have ends of their own.
"""

SLOWEST = 0.1
"""1/s, of the rotors' highest speed: a smaller slew could not hold an attitude."""


def limits_for(controller: Controller, **given: Any) -> Limits:
    """Limits that leave a controller its ordinary flights.

    Args:
        controller: its model gives efforts and rotor speeds, its law is asked how hard it pulls.
        given: fields of :class:`Limits`, in place of the defaults; one number stands for every joint.

    Raises:
        ControllerError: an unknown field, or a number out of its range.
    """
    model: Model = controller.par.model
    joints = [link.joint for link in model.vehicle.links]
    names = list(field_names(Limits) or ())
    for name in given:
        if name not in names:
            raise ControllerError(f"safety.{name}: unknown field; allowed: {', '.join(names)}")
    default = _defaults(model, joints, TIP_ERRORS if controller.keeps_tip else ERRORS)
    if "stiffness" not in given or "damping" not in given:
        default |= dict(zip(("stiffness", "damping"), law_stiffness(controller), strict=True))
    values = default | given
    checked = {name: _checked(name, values[name], len(joints), default.get(name, 0.0)) for name in names}
    _check_ranges(checked, model)
    return Limits(**checked)


def _defaults(model: Model, joints: list[Joint], errors: Mapping[str, float]) -> dict[str, Any]:
    """All but stiffness and damping, which are the law's."""
    fastest = _fastest(model)
    efforts = tuple(float(joint.effort_limit) for joint in joints)
    speeds = tuple(SPEEDS[joint.kind] for joint in joints)
    return {
        "tilt": math.radians(40.0),
        "climb": 0.5 * float(model.gravity),
        "speed": 4.0,
        "step": 0.4,
        "step_speed": 1.5,
        "joint_speed": speeds,
        "joint_step": tuple(STEPS[joint.kind][0] for joint in joints),
        "joint_slew": tuple(STEPS[joint.kind][1] for joint in joints),
        "joint_margin": tuple(_margin(joint) for joint in joints),
        "joint_pole": 25.0,
        "effort": efforts,
        # from rest to full speed in one period of 5 ms: real motors take longer, and a law that inverts lag needs it
        "rotor_slew": 200.0 * fastest if fastest > 0.0 else math.inf,
        "effort_slew": tuple(200.0 * effort for effort in efforts),
        "trusted_tilt": math.radians(70.0),
        "trusted_rate": 12.0,
        "trusted_joint_error": tuple(errors[joint.kind] for joint in joints),
        "lost_rate": 40.0,
        "lost_speed": 15.0,
        "lost_joint_speed": tuple(4.0 * speed for speed in speeds),
        "patience": 0.25,
        "calm": math.inf,
    }


def _fastest(model: Model) -> float:
    """rad/s, the highest speed of a rotor; twice that of hover where it has no limit."""
    trim = hover_trim(model.vehicle, (0.0,) * model.vehicle.n, model.gravity)
    hover = max((float(speed) for speed in trim.speeds), default=0.0)
    tops = [float(rotor.max_speed) for rotor in model.vehicle.rotors]
    return max((top if top < math.inf else 2.0 * hover for top in tops), default=0.0)


def _margin(joint: Joint) -> float:
    """Not more than a tenth of the joint's range."""
    return min(MARGINS[joint.kind], 0.1 * (float(joint.upper) - float(joint.lower)))


def _checked(name: str, value: Any, joints: int, default: Any) -> Any:
    """One number, or one per joint, within its ends."""
    at = f"safety.{name}"
    strict, infinite = name not in ("patience", "joint_margin"), name not in FINITE
    try:
        if name not in PER_JOINT:
            return _below(name, number(value, at, low=0.0, strict=strict, infinite=infinite), at, default)
        row = list(value) if isinstance(value, (list, tuple)) else [value] * joints
        if len(row) != joints:
            raise ValueError(f"{at} = {shown(value)}: {len(row)} values, must be {joints} (one per joint)")
        found = [number(v, f"{at}[{i}]", low=0.0, strict=strict, infinite=infinite) for i, v in enumerate(row)]
        return tuple(
            _below(name, v, f"{at}[{i}]", usual) for i, (v, usual) in enumerate(zip(found, default, strict=True))
        )
    except ValueError as error:
        raise ControllerError(str(error)) from None


def _below(name: str, value: float, at: str, default: float) -> float:
    """The value, if it is none above its upper end that is still a number."""
    most = max(MOST.get(name, math.inf), default if default < math.inf else 0.0)
    if most < value < math.inf:
        never = "" if name in FINITE else ", or inf for no limit"
        raise ValueError(f"{at} = {value!r}: must be at most {most:g}{never}")
    return value


def _check_ranges(values: dict[str, Any], model: Model) -> None:
    fastest = _fastest(model)
    if values["rotor_slew"] < SLOWEST * fastest < math.inf:
        raise ControllerError(
            f"safety.rotor_slew = {values['rotor_slew']!r}: must be at least {SLOWEST * fastest:.4g}, a tenth of "
            "the rotors' highest speed in a second"
        )
    for name, top in (("tilt", STEEPEST), ("trusted_tilt", math.pi), ("climb", float(model.gravity))):
        if values[name] > top:
            raise ControllerError(f"safety.{name} = {values[name]!r}: must be at most {top:.4g}")
    for i, (margin, link) in enumerate(zip(values["joint_margin"], model.vehicle.links, strict=True)):
        if not 4.0 * margin <= float(link.joint.upper) - float(link.joint.lower):
            raise ControllerError(f"safety.joint_margin[{i}] = {margin!r}: must be at most a quarter of the range")
