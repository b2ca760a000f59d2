"""Export of a vehicle as a self-contained MuJoCo model with actuators, limits, lights and a camera.

Bodies, joints and looks are those of the plant (:mod:`skyarm.plant.mujoco_model`). Within the joints' limits, in still
air, at steady rotor speeds and without Coulomb friction the model moves as the plant does: thrust and drag torque of a
rotor are one actuator in N, joint efforts motors, viscous friction is MuJoCo's own. A rotor's thrust follows its control
as a first-order lag. Limits, Coulomb friction and followers are MuJoCo's soft constraints. What is left out or changed
stands in the first lines of the file; numbers of rotors that MuJoCo has no word for stand in its ``custom`` numbers
(:mod:`skyarm.vehicle.rotor_sources.own_mjcf`). Numbers have all their digits: MuJoCo's own writer keeps six.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from typing import Any

import mujoco
import numpy as np

from skyarm.dynamics.actuators import AllocationError
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.actuators.rotor import push
from skyarm.dynamics.kinematics import every_joint
from skyarm.dynamics.state import State
from skyarm.dynamics.workspace import nearest_to_zero
from skyarm.plant.mujoco_model import (
    LEAST,
    add_upright_site,
    body_name,
    build_spec,
    joint_addresses,
    site_of_rotor,
    unused_name,
)
from skyarm.records.arrays import Array, float_array
from skyarm.vehicle import BASE, Rotor, Vehicle
from skyarm.vehicle.export_losses import ALWAYS_LOST, actuator_names, head_of
from skyarm.vehicle.rotor_sources.own_mjcf import numbers_of_rotor
from skyarm.vehicle.vehicle_records import require_plant

HEADER = (
    "Written by skyarm export as MJCF; control of a rotor is its thrust in N, of a joint its effort in N m or N, of a "
    "tilt its angle in rad."
)

FASTER = 20.0
"""Rate of the second lag of a tilt's servo over that of its own."""

TILT_ARMATURE = 1e-4
"""Armature of a tilt's hinge, kg m^2; what its servo pushes stands in proportion, so that it moves nothing else."""

LOST = {
    **ALWAYS_LOST,
    "rotors": "lag of the speed, here of the thrust; skyarm reads back that of the speed",
    "lags": "lags up and down, here their mean; skyarm reads back both",
    "tilts": f"lag of tilts, here with a second, {FASTER:g} times faster one; skyarm reads back their own",
    "tables": "thrust tables, for which the nearest parabola stands",
    "air": "hub drag and rolling moment, which skyarm alone reads back",
    "spin": "spin inertia of rotors, which skyarm alone reads back",
    "max_speed": "unlimited rotor speed, which skyarm reads back as a gap",
    "one_limit": "limit on one side only, here also 1000 on the other",
    "coulomb": "smooth Coulomb friction, here MuJoCo's friction loss",
    "stops": "stiffness and damping of stops, here MuJoCo's soft limits",
    "followers": 'joints that follow others, here by a soft equality, which skyarm reads back with mimic = "couple"',
    "drag": "drag of the body, which is left out",
    "names": "names that two parts have; the second one's gets an underscore",
}
"""Feature that MuJoCo's file holds otherwise or not at all -> its line."""

START = "start"
"""Name of the keyframe of the initial state, rotors in hover."""


HEIGHT = 1.0
"""Default height (m) of the start above the floor."""

def mjcf_text(
    vehicle: Vehicle,
    gravity: float = 9.81,
    start: State | None = None,
    *,
    timestep: float = 0.001,
    inertial: Sequence[str] = (),
    collisions: bool = False,
) -> str:
    """Export a vehicle to MJCF.

    Args:
        vehicle: vehicle with concrete numbers; a planar model is refused.
        gravity: m/s^2.
        start: state of the keyframe ``start``; None for level, 1 m up, joints at zero or at the limit next to it.
        timestep: s.
        inertial: frames of the vehicle with a gyroscope and an accelerometer.
        collisions: the shapes touch the floor and other bodies, not each other.

    Raises:
        VehicleError: no real body.
    """
    require_plant(vehicle)
    spec = build_spec(vehicle, gravity, timestep=timestep)
    spec.option.disableflags, spec.compiler.degree = 0, False
    for geom in spec.geoms:
        geom.contype = int(collisions)
    floor, sun = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_geom(name="floor", type=floor, size=[0.0, 0.0, 1.0], contype=0, conaffinity=int(collisions))
    spec.worldbody.add_light(name="sun", type=sun, pos=[0.0, 0.0, 10.0], dir=[0.3, 0.2, -1.0])
    for joint in spec.joints:
        _finish_joint(joint, vehicle)
    for each in vehicle.followers:
        leader = vehicle.links[each.leader].joint.name
        _tie(spec, each.link.joint.name, leader, float(each.offset), float(each.ratio))
    _add_actuators(spec, vehicle)
    for frame in inertial:
        for word, kind in (("gyro", mujoco.mjtSensor.mjSENS_GYRO), ("acc", mujoco.mjtSensor.mjSENS_ACCELEROMETER)):
            spec.add_sensor(name=f"{frame}_{word}", type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=frame)
    for rotor, site in zip(vehicle.rotors, site_of_rotor(vehicle), strict=True):
        for name, numbers in numbers_of_rotor(rotor, site, _tilt_name(rotor)):
            spec.add_numeric(name=name, data=numbers, size=len(numbers))
    model = spec.compile()
    _add_start(spec, vehicle, model, start, gravity)
    spec.compile()
    return head_of(vehicle, HEADER, LOST) + _in_full(spec)


FIELDS = {"pos": "ipos", "quat": "iquat", "diaginertia": "inertia", "mass": "mass"}
"""Attribute of <inertial> -> field of MuJoCo's body."""


def _in_full(spec: mujoco.MjSpec) -> str:
    """MJCF text of a specification with all digits of its numbers, where MuJoCo's writer keeps six."""
    root = ET.fromstring(spec.to_xml())
    for element, source in _sources(root, spec):
        for name, text in ((name, text) for name, text in element.items() if name != "rgba"):
            field = FIELDS[name] if element.tag == "inertial" else name
            count, value = len(text.split()), getattr(source, field, None)
            numbers = np.atleast_1d(np.asarray(value, dtype=object)).ravel()[:count]
            if numbers.size == count and all(isinstance(each, float) for each in numbers):
                element.set(name, " ".join(repr(float(each)) for each in numbers))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _sources(root: ET.Element, spec: mujoco.MjSpec) -> Iterator[tuple[ET.Element, Any]]:
    """Pairs of an element of MuJoCo's file and the part of the specification that it was written from."""
    parts = {"body": spec.bodies, "numeric": spec.numerics, "general": spec.actuators, "key": spec.keys}
    parts |= {"site": spec.sites, "light": spec.lights}
    for tag, sources in parts.items():
        named = {each.name: each for each in sources}
        yield from ((each, named[each.get("name")]) for each in root.iter(tag))
    for joint in root.find("worldbody").iter("joint"):
        yield joint, spec.joint(joint.get("name"))
    for body in root.iter("body"):
        source = spec.body(body.get("name"))
        if body.find("inertial") is None:  # MuJoCo's writer leaves out what weighs next to nothing, and refuses the file
            body.insert(0, ET.Element("inertial", pos="0 0 0", quat="1 0 0 0", mass="0", diaginertia="0 0 0"))
        yield body.find("inertial"), source
        yield from zip(body.findall("geom"), source.geoms, strict=True)
    for option in root.iter("option"):
        yield option, spec.option
    for tie, source in zip(root.findall("equality/joint"), spec.equalities, strict=True):
        tie.set("polycoef", " ".join(repr(float(each)) for each in source.data[:5]))


def _finish_joint(joint: mujoco.MjsJoint, vehicle: Vehicle) -> None:
    """Set friction and limits of a joint in the exported MuJoCo model."""
    ours = next((link.joint for link in vehicle.moving if link.joint.name == joint.name), None)
    if ours is None or joint.type == mujoco.mjtJoint.mjJNT_FREE:
        return
    joint.damping = _like(joint.damping, float(ours.damping))
    joint.frictionloss = float(ours.coulomb)
    follows = any(each.link.joint is ours for each in vehicle.followers)
    lower, upper = float(ours.lower), float(ours.upper)
    if follows or (math.isinf(lower) and math.isinf(upper)):
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        return
    far = 1e3  # MuJoCo has no limit on one side only
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    joint.range = [max(lower, -far), min(upper, far)]


def _like(field: float | Array, value: float) -> float | Array:
    """Value in the form of a MuJoCo field: a number, or a vector of coefficients that begins with the number."""
    if np.ndim(field) == 0:
        return value
    coefficients = np.zeros(np.shape(field))
    coefficients[0] = value
    return coefficients


def _tie(spec: mujoco.MjSpec, follower: str, leader: str, offset: float, ratio: float) -> None:
    tie = spec.add_equality(name=f"{follower} follows {leader}", type=mujoco.mjtEq.mjEQ_JOINT)
    tie.objtype, tie.name1, tie.name2 = mujoco.mjtObj.mjOBJ_JOINT, follower, leader
    data = np.zeros(np.shape(tie.data))
    data[:2] = offset, ratio
    tie.data = data


def _add_actuators(spec: mujoco.MjSpec, vehicle: Vehicle) -> None:
    """Add actuators for rotors (control: thrust, N), driven joints (N m or N) and tilts (rad)."""
    names, sites = actuator_names(vehicle), site_of_rotor(vehicle)
    for rotor, site in zip(vehicle.rotors, sites, strict=True):
        if rotor.tilt is not None:
            _add_tilt(spec, vehicle, rotor, site)
        actuator = spec.add_actuator(name=names.pop(0), trntype=mujoco.mjtTrn.mjTRN_SITE, target=site)
        # drag torque acts against the rotation, along the axis
        actuator.gear = [0.0, 0.0, 1.0, 0.0, 0.0, -float(rotor.direction) * float(rotor.moment_coefficient)]
        _bound(actuator, _thrust(rotor, float(rotor.min_speed)), _thrust(rotor, float(rotor.max_speed)))
        lag = 0.5 * (float(rotor.time_constant_up) + float(rotor.time_constant_down))
        # under RK4 MuJoCo's exact filter lags by half a step more, the plain one by less than a hundredth of that
        plain = lag >= spec.option.timestep
        actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTER if plain else mujoco.mjtDyn.mjDYN_FILTEREXACT
        actuator.dynprm[0] = lag
    for link in vehicle.links:
        effort = float(link.joint.effort_limit)
        if effort != 0.0:
            name, joint = names.pop(0), link.joint.name
            _bound(spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint), -effort, effort)
    for rotor in vehicle.rotors:
        if rotor.tilt is not None:
            _add_servo(spec, names.pop(0), rotor)


def _tilt_name(rotor: Rotor) -> str:
    return f"{rotor.name}_tilt"


def _add_tilt(spec: mujoco.MjSpec, vehicle: Vehicle, rotor: Rotor, site: str) -> None:
    """Move the site of a tilting rotor from the base to a body without mass that its servo turns."""
    spec.delete(spec.site(site))
    body = spec.body(body_name(vehicle, BASE)).add_body(name=_tilt_name(rotor), pos=float_array(rotor.position))
    body.explicitinertial, body.mass, body.inertia = True, LEAST, np.full(3, LEAST)
    hinge, servo = mujoco.mjtJoint.mjJNT_HINGE, rotor.tilt
    joint = body.add_joint(name=_tilt_name(rotor), type=hinge, axis=float_array(servo.axis))
    joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, [float(servo.lower), float(servo.upper)]
    add_upright_site(body, site, np.zeros(3), rotor.axis)


def _add_servo(spec: mujoco.MjSpec, name: str, rotor: Rotor) -> None:
    """Add the servo of a tilt: a spring and a damper at the hinge, whose armature makes the second, faster lag.

    The spring's torque stays below that with which the damper lets the angle change at its largest rate.
    """
    servo, joint = rotor.tilt, spec.joint(_tilt_name(rotor))
    rate, least = 1.0 / float(servo.time_constant), TILT_ARMATURE
    damping, stiffness = least * (1.0 + FASTER) * rate, least * FASTER * rate**2
    joint.armature, joint.damping = least, _like(joint.damping, damping)
    actuator = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name)
    actuator.set_to_position(kp=stiffness)
    actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
    actuator.ctrlrange = [float(servo.lower), float(servo.upper)]
    if math.isfinite(float(servo.max_rate)):
        largest = damping * float(servo.max_rate)
        actuator.forcelimited, actuator.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-largest, largest]


def _thrust(rotor: Rotor, speed: float) -> float:
    """Rotor thrust (N) at a speed (rad/s) in still air."""
    return float(rotor.thrust_coefficient) * float(push(rotor, speed)) if math.isfinite(speed) else math.inf


def _bound(actuator: mujoco.MjsActuator, low: float, high: float) -> None:
    actuator.set_to_motor()
    if math.isfinite(high):
        actuator.ctrllimited, actuator.ctrlrange = mujoco.mjtLimited.mjLIMITED_TRUE, [low, high]


def _add_start(
    spec: mujoco.MjSpec, vehicle: Vehicle, model: mujoco.MjModel, start: State | None, gravity: float
) -> None:
    """Add the initial state with hover thrusts to the exported model as a keyframe."""
    positions = start.joints if start is not None else (nearest_to_zero(link.joint) for link in vehicle.links)
    joints = tuple(map(float, positions))
    qpos, qvel, ctrl = np.array(model.qpos0), np.zeros(model.nv), np.zeros(model.nu)
    qpos[:7] = (0.0, 0.0, HEIGHT, 1.0, 0.0, 0.0, 0.0)
    at, rates = joint_addresses(vehicle, model)
    qpos[at] = every_joint(vehicle, joints)
    speeds = _hover_speeds(vehicle, joints, gravity)
    if start is not None:
        qpos[:3], qpos[3:7] = start.position, start.quaternion
        qvel[:3], qvel[3:6], qvel[rates[: vehicle.n]] = start.velocity, start.rate, start.joint_rates
        speeds = [float(speed) for speed in start.rotor_speeds]
    thrusts = [_thrust(rotor, speed) for rotor, speed in zip(vehicle.rotors, speeds, strict=True)]
    tilts = [model.joint(_tilt_name(rotor)).qposadr[0] for rotor in vehicle.rotors if rotor.tilt is not None]
    qpos[tilts] = angles = start.tilts if start is not None else (0.0,) * len(tilts)
    ctrl[: len(thrusts)], ctrl[len(ctrl) - len(tilts) :] = thrusts, angles
    spec.add_key(name=START, qpos=qpos, qvel=qvel, act=thrusts, ctrl=ctrl)


def _hover_speeds(vehicle: Vehicle, joints: tuple[float, ...], gravity: float) -> list[float]:
    """Rotor speeds for level hover, rad/s; zeros if hover is impossible."""
    still = [0.0] * len(vehicle.rotors)
    try:
        trim = hover_trim(vehicle, joints, gravity)
    except AllocationError:
        return still
    return [float(speed) for speed in trim.speeds] if trim.needs_no_pull else still
