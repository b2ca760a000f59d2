"""Export of a vehicle as a self-contained MuJoCo model with actuators, limits, lights and a camera.

Bodies, joints and looks are those of the plant (:mod:`skyarm.plant.mujoco_model`). Within the joints' limits, in still
air, at steady rotor speeds and without Coulomb friction the model moves as the plant does: thrust and drag torque of a
rotor are one actuator in N, joint efforts motors, viscous friction is MuJoCo's own; a rotor's thrust follows its
control as a first-order lag. Limits, Coulomb friction and followers are MuJoCo's soft constraints. What is left out or
changed stands in the first lines of the file. Numbers have all their digits: MuJoCo's own writer keeps six.
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
from skyarm.plant.mujoco_model import KINDS, build_spec, joint_addresses, site_of_rotor
from skyarm.records.arrays import Array
from skyarm.vehicle import Rotor, Vehicle
from skyarm.vehicle.robot_text import actuator_names, render_vehicle
from skyarm.vehicle.vehicle_records import require_plant

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
    spec, sites = build_spec(vehicle, gravity), site_of_rotor(vehicle)
    values = {
        "spec": spec,
        "gravity": gravity,
        "timestep": timestep,
        "inertial": inertial,
        "collisions": collisions,
        "kinds": {kind: name for name, kind in KINDS.items()},
        "joints": {link.joint.name: link.joint for link in vehicle.moving},
        "following": [each.link.joint.name for each in vehicle.followers],
        "sites": sites,
        "tilting": {site: each for site, each in zip(sites, vehicle.rotors, strict=True) if each.tilt is not None},
        "actuators": actuator_names(vehicle),
        "ranges": [
            [_thrust(each, float(limit)) for limit in (each.min_speed, each.max_speed)] for each in vehicle.rotors
        ],
    }
    model = mujoco.MjModel.from_xml_string(render_vehicle("mjcf", vehicle, key=None, **values))
    return render_vehicle("mjcf", vehicle, key=_start(vehicle, model, start, gravity), **values)


def _thrust(rotor: Rotor, speed: float) -> float:
    """Rotor thrust (N) at a speed (rad/s) in still air."""
    return float(rotor.thrust_coefficient) * float(push(rotor, speed)) if math.isfinite(speed) else math.inf


def _start(vehicle: Vehicle, model: mujoco.MjModel, start: State | None, gravity: float) -> dict[str, str | Array]:
    """Keyframe of the initial state with hover thrusts."""
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
    thrusts = np.array([_thrust(rotor, speed) for rotor, speed in zip(vehicle.rotors, speeds, strict=True)])
    tilts = [model.joint(f"{rotor.name}_tilt").qposadr[0] for rotor in vehicle.rotors if rotor.tilt is not None]
    qpos[tilts] = angles = start.tilts if start is not None else (0.0,) * len(tilts)
    ctrl[: thrusts.size], ctrl[ctrl.size - len(tilts) :] = thrusts, angles
    return {"name": START, "qpos": qpos, "qvel": qvel, "act": thrusts, "ctrl": ctrl}


def _hover_speeds(vehicle: Vehicle, joints: tuple[float, ...], gravity: float) -> list[float]:
    """Rotor speeds for level hover, rad/s; zeros if hover is impossible."""
    still = [0.0] * len(vehicle.rotors)
    try:
        trim = hover_trim(vehicle, joints, gravity)
    except AllocationError:
        return still
    return [float(speed) for speed in trim.speeds] if trim.needs_no_pull else still
