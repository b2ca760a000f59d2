"""Limits of the safety layer, their defaults for a controller, and the stiffness of a law measured at its actuators."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.law_checks import checked_law
from skyarm.control.model import Model
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import rules
from skyarm.records.files import shown
from skyarm.records.units import Unit, units
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement
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


# infinity times nothing is no number: what multiplies or is multiplied is finite
_finite = partial(Unit, low=0.0, strict=True)
_limit = partial(_finite, infinite=True)


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

    tilt: Annotated[float, _limit("rad", "asked for")]
    climb: Annotated[float, _limit("m/s^2", "asked for, up or down")]
    speed: Annotated[float, _limit("m/s", "asked for")]
    step: Annotated[float, _limit("m", "error that passes")]
    step_speed: Annotated[float, _limit("m/s", "error that passes")]
    stiffness: Annotated[float, _finite("1/s^2", "acceleration the law asks per position error")]
    damping: Annotated[float, _finite("1/s", "acceleration the law asks per velocity error")]
    joint_speed: Annotated[tuple[float, ...], _limit("rad/s or m/s", "of the joints")]
    joint_step: Annotated[tuple[float, ...], _limit("rad or m", "step of a reference that passes")]
    joint_slew: Annotated[tuple[float, ...], _limit("rad/s or m/s", "of longer steps of a reference")]
    joint_margin: Annotated[tuple[float, ...], Unit("rad or m", "kept from the joints' limits", low=0.0)]
    joint_pole: Annotated[float, _finite("1/s", "how fast a joint closes in on a limit")]
    effort: Annotated[tuple[float, ...], _limit("N m or N")]
    rotor_slew: Annotated[float, _limit("rad/s^2", "of the commanded speeds")]
    effort_slew: Annotated[tuple[float, ...], _limit("N m/s or N/s")]
    trusted_tilt: Annotated[float, _limit("rad", "largest for longer than patience")]
    trusted_rate: Annotated[float, _limit("rad/s", "largest for longer than patience")]
    trusted_joint_error: Annotated[tuple[float, ...], _limit("rad or m", "largest for longer than patience")]
    lost_rate: Annotated[float, _limit("rad/s", "largest for a moment")]
    lost_speed: Annotated[float, _limit("m/s", "largest for a moment")]
    lost_joint_speed: Annotated[tuple[float, ...], _limit("rad/s or m/s", "largest for a moment")]
    patience: Annotated[float, Unit("s", low=0.0, infinite=True)]
    calm: Annotated[float, _limit("s", "of calm flight before the law starts anew")]


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

HIGHEST = 1e9
"""Upper end of every finite limit: squares and products stay far from overflow. Infinity stands for no limit."""

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
    for name in given:
        if name not in rules(Limits):
            raise ControllerError(f"safety.{name}: unknown field; allowed: {', '.join(rules(Limits))}")
    values = _defaults(model, joints, TIP_ERRORS if controller.keeps_tip else ERRORS)
    per_joint = {name for name, value in values.items() if isinstance(value, tuple)}
    if "stiffness" not in given or "damping" not in given:
        values |= dict(zip(("stiffness", "damping"), law_stiffness(controller), strict=True))
    for name, value in (values | given).items():
        alone = name in per_joint and not isinstance(value, (list, tuple))
        values[name] = held = _check_limit(name, (value,) * len(joints) if alone else value)
        if name in per_joint and len(held) != len(joints):
            said = f"safety.{name} = {shown(value)}: {len(held)} values"
            raise ControllerError(f"{said}, must be {len(joints)} (one per joint)")
        if name in given and any(HIGHEST < each < math.inf for each in (held if name in per_joint else (held,))):
            none = ", or inf for no limit" if units(Limits)[name].infinite else ""
            raise ControllerError(f"safety.{name} = {shown(value)}: must be at most {HIGHEST:g}{none}")
    _check_ranges(values, model)
    return Limits(**values)


def _check_limit(name: str, value: Any) -> Any:
    """A limit as its field holds it."""
    try:
        return rules(Limits)[name](f"safety.{name}", value)
    except RecordError as error:
        raise ControllerError(str(error)) from None


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
