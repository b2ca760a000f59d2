"""Export of a vehicle as a self-contained MuJoCo model with actuators, limits, lights
and a camera.

Bodies, joints and looks are those of the plant (:mod:`skyarm.plant.mujoco_model`).
Within the joints' limits, in still air, at steady rotor speeds and without Coulomb
friction the model moves as the plant does: thrust and drag torque of a rotor are one
actuator in N, joint efforts motors, viscous friction is MuJoCo's own; a rotor's thrust
follows its control as a first-order lag. Limits, Coulomb friction and followers are
MuJoCo's soft constraints. What is left out or changed stands in the first lines of the
file. Numbers have all their digits: MuJoCo's own writer keeps six.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.dynamics.actuators import AllocationError
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.actuators.rotor import push
from skyarm.dynamics.kinematics import every_joint, every_rate
from skyarm.dynamics.state import State, example_state
from skyarm.dynamics.workspace import nearest_to_zero
from skyarm.plant.mujoco_model import (
    COLORS,
    DRAWN,
    TOUCHING,
    add_geom,
    body_name,
    build_spec,
    joint_addresses,
    site_of_rotor,
)
from skyarm.records.arrays import Array
from skyarm.vehicle import Rotor, Vehicle
from skyarm.vehicle.check import unused_name
from skyarm.vehicle.robot_text import actuator_names, render_vehicle
from skyarm.vehicle.vehicle_records import require_plant
from skyarm.world.scene.shapes import in_place, solid_shape

START = "start"
"""Name of the keyframe of the initial state, rotors in hover."""


HEIGHT = 1.0
"""Default height (m) of the start above the floor."""

FASTEST = 1e6
"""Speed (rad/s) of a rotor in the file that has no largest one."""


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
        start: state of the keyframe ``start``; None for level, 1 m up, joints at zero
            or at the limit next to it.
        timestep: s.
        inertial: frames of the vehicle with a gyroscope and an accelerometer.
        collisions: the shapes touch the floor and other bodies, not each other: those
            that the vehicle states for it, else those that draw it.

    Raises:
        VehicleError: no real body.
    """
    require_plant(vehicle)
    taken = [name for each in vehicle.moving for name in (each.name, each.joint.name)]
    spec = build_spec(vehicle, gravity)
    for each in vehicle.collisions if collisions else ():
        shape = in_place(solid_shape(each, each.name, "link", each.link), each)
        body = spec.body(body_name(vehicle, each.link))
        add_geom(spec, body, shape, rgba=COLORS["link"], group=TOUCHING)
    values = {
        "spec": spec,
        "gravity": gravity,
        "timestep": timestep,
        "inertial": inertial,
        "collisions": collisions,
        "touching": TOUCHING if vehicle.collisions else DRAWN,
        "joints": {link.joint.name: link.joint for link in vehicle.moving},
        "rotor_at": dict(zip(site_of_rotor(vehicle), vehicle.rotors, strict=True)),
        "actuators": actuator_names(vehicle),
        "tilts": {
            each.name: unused_name(f"{each.name}_tilt", taken)
            for each in vehicle.rotors
            if each.tilt is not None
        },
        "thrust": _thrust,
    }
    model = mujoco.MjModel.from_xml_string(
        # compiled once without a keyframe: MuJoCo says where each number stands in one
        render_vehicle("mjcf", vehicle, key=None, **values)
    )
    return render_vehicle(
        "mjcf", vehicle, key=_start(vehicle, model, start, gravity), **values
    )


def _thrust(rotor: Rotor, speed: Scalar) -> float:
    """Rotor thrust (N) at a speed (rad/s) in still air."""
    # an infinite thrust is no number of a file
    within = min(max(float(speed), -FASTEST), FASTEST)
    return float(rotor.thrust_coefficient) * float(push(rotor, within))


def _start(
    vehicle: Vehicle, model: mujoco.MjModel, start: State | None, gravity: float
) -> dict[str, str | Array]:
    """Keyframe of the initial state with hover thrusts."""
    if start is None:
        joints = tuple(nearest_to_zero(link.joint) for link in vehicle.links)
        speeds = _hover_speeds(vehicle, joints, gravity)
        level = example_state(*vehicle.sizes)
        start = replace(
            level, position=Vec3(0.0, 0.0, HEIGHT), joints=joints, rotor_speeds=speeds
        )
    qpos, qvel, ctrl = np.array(model.qpos0), np.zeros(model.nv), np.zeros(model.nu)
    at, rates = joint_addresses(vehicle, model)
    qpos[:3] = start.position
    qpos[3:7] = start.quaternion
    qpos[at] = every_joint(vehicle, start.joints)
    qvel[:3] = start.velocity
    qvel[3:6] = start.rate
    qvel[rates] = every_rate(vehicle, start.joint_rates)
    thrusts = np.array([*map(_thrust, vehicle.rotors, start.rotor_speeds)])
    tilts = model.jnt_qposadr[
        model.actuator_trnid[model.nactuator - len(vehicle.tilts) :, 0]
    ]
    qpos[tilts] = start.tilts
    ctrl[: thrusts.size] = thrusts
    ctrl[ctrl.size - len(tilts) :] = start.tilts
    return {"name": START, "qpos": qpos, "qvel": qvel, "act": thrusts, "ctrl": ctrl}


def _hover_speeds(
    vehicle: Vehicle, joints: tuple[float, ...], gravity: float
) -> Scalars:
    """Rotor speeds for level hover, rad/s; zeros if hover is impossible."""
    still = vehicle.rotor_zeros
    try:
        trim = hover_trim(vehicle, joints, gravity)
    except AllocationError:
        return still
    # the root of a negative square is no hover
    return trim.speeds if trim.needs_no_pull else still
