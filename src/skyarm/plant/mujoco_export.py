"""Export of a vehicle as a self-contained MuJoCo model with actuators, limits, lights and a camera.

Bodies, joints and looks are those of the plant (:mod:`skyarm.plant.mujoco_model`). Within the joints' limits, in still
air, at steady rotor speeds and without Coulomb friction the model moves as the plant does: thrust and drag torque of a
rotor are one actuator in N, joint efforts motors, viscous friction is MuJoCo's own. Limits, Coulomb friction and
followers are MuJoCo's soft constraints; lag, rotor drag and body drag are left out. Numbers have all their digits:
MuJoCo's own writer keeps six.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from skyarm.dynamics.actuators import AllocationError
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.actuators.rotor import push
from skyarm.dynamics.kinematics import every_joint
from skyarm.dynamics.state import State
from skyarm.dynamics.workspace import nearest_to_zero
from skyarm.plant.mujoco_model import build_spec, joint_addresses, site_of_rotor, unused_name
from skyarm.records.arrays import Array
from skyarm.records.immutable import positional
from skyarm.vehicle import Rotor, Vehicle
from skyarm.vehicle.vehicle_records import require_plant

HEADER = "Written by skyarm export as MJCF; control of a rotor is its thrust in N, of a joint its effort in N m or N."


START = "start"
"""Name of the keyframe of the initial state, rotors in hover."""


HEIGHT = 1.0
"""Default height (m) of the start above the floor."""


@positional
class Exported:
    """Text of an exported MJCF file, with its numbers of bodies and joints and the names of its actuators."""

    text: str
    bodies: int
    joints: int
    actuators: tuple[str, ...]


def mjcf_text(
    vehicle: Vehicle,
    gravity: float,
    start: State | None = None,
    *,
    timestep: float = 0.001,
    inertial: Sequence[str] = (),
) -> Exported:
    """Export a vehicle to MJCF; return the text, the numbers of bodies and joints, and the actuators' names.

    Args:
        vehicle: vehicle with concrete numbers; a planar model is refused.
        gravity: m/s^2.
        start: state of the keyframe ``start``; None for level, 1 m up, joints at zero or at the limit next to it.
        timestep: s.
        inertial: frames of the vehicle with a gyroscope and an accelerometer.

    Raises:
        VehicleError: no real body.
    """
    require_plant(vehicle)
    spec = build_spec(vehicle, gravity, timestep=timestep)
    spec.option.disableflags, spec.compiler.degree = 0, False
    floor, sun = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_geom(name="floor", type=floor, size=[0.0, 0.0, 1.0], contype=0, conaffinity=0)
    spec.worldbody.add_light(name="sun", type=sun, pos=[0.0, 0.0, 10.0], dir=[0.3, 0.2, -1.0])
    for joint in spec.joints:
        _finish_joint(joint, vehicle)
    for each in vehicle.followers:
        leader = vehicle.links[each.leader].joint.name
        _tie(spec, each.link.joint.name, leader, float(each.offset), float(each.ratio))
    names, site = _add_actuators(spec, vehicle), mujoco.mjtObj.mjOBJ_SITE
    for frame in inertial:
        for word, kind in (("gyro", mujoco.mjtSensor.mjSENS_GYRO), ("acc", mujoco.mjtSensor.mjSENS_ACCELEROMETER)):
            spec.add_sensor(name=f"{frame}_{word}", type=kind, objtype=site, objname=frame)
    model = spec.compile()
    _add_start(spec, vehicle, model, start, gravity)
    spec.compile()
    return Exported(f"<!-- {HEADER} -->\n{spec.to_xml()}", len(vehicle.bodies), len(vehicle.moving), names)


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


def _add_actuators(spec: mujoco.MjSpec, vehicle: Vehicle) -> tuple[str, ...]:
    """Add actuators for rotors (control: thrust, N) and driven joints (N m or N); return their names."""
    names: list[str] = []
    for rotor, site in zip(vehicle.rotors, site_of_rotor(vehicle), strict=True):
        actuator = spec.add_actuator(name=rotor.name, trntype=mujoco.mjtTrn.mjTRN_SITE, target=site)
        # drag torque acts against the rotation, along the axis
        actuator.gear = [0.0, 0.0, 1.0, 0.0, 0.0, -float(rotor.direction) * float(rotor.moment_coefficient)]
        _bound(actuator, _thrust(rotor, float(rotor.min_speed)), _thrust(rotor, float(rotor.max_speed)))
        names.append(rotor.name)
    for link in vehicle.links:
        effort = float(link.joint.effort_limit)
        if effort == 0.0:
            continue
        name = unused_name(link.joint.name, names)
        actuator = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=link.joint.name)
        _bound(actuator, -effort, effort)
        names.append(name)
    return tuple(names)


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
    ctrl[: len(speeds)] = [_thrust(rotor, speed) for rotor, speed in zip(vehicle.rotors, speeds, strict=True)]
    spec.add_key(name=START, qpos=qpos, qvel=qvel, ctrl=ctrl)


def _hover_speeds(vehicle: Vehicle, joints: tuple[float, ...], gravity: float) -> list[float]:
    """Rotor speeds for level hover, rad/s; zeros if hover is impossible."""
    still = [0.0] * len(vehicle.rotors)
    try:
        trim = hover_trim(vehicle, joints, gravity)
    except AllocationError:
        return still
    return [float(speed) for speed in trim.speeds] if trim.needs_no_pull else still
