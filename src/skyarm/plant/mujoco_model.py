"""MuJoCo model of a vehicle: bodies, joints, sites and visual shapes, without any
forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from skyarm.algebra import Mat3
from skyarm.records.arrays import Array, float_array
from skyarm.vehicle import BASE, Body, Joint, Vehicle
from skyarm.vehicle.check import unused_name
from skyarm.vehicle.description import Matrix, turn_onto
from skyarm.world import TimedPayload
from skyarm.world.scene.shapes import Shape
from skyarm.world.scene.vehicle_shapes import vehicle_shapes

INTEGRATORS = {
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "rk4_staged": mujoco.mjtIntegrator.mjINT_RK4,
}
"""Integrator -> MuJoCo's; in "rk4_staged" MuJoCo only computes accelerations."""

BASE_NAME = "base"
"""Name of the airframe's body and free joint; no link may have it."""

LEAST = 2e-15
"""Least mass (kg) and inertia (kg m^2) in MuJoCo, which refuses a moving body below
1e-15; used for massless links and point masses."""

KINDS = {
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "plane": mujoco.mjtGeom.mjGEOM_PLANE,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}
"""Kind of a shape -> MuJoCo's geometry, which takes half lengths."""

DRAWN, TOUCHING = 1, 3
"""Groups of geoms: the drawn shapes, and those that a vehicle states for contacts."""

_GREY, _DARK, _BLUE = (
    (0.6, 0.6, 0.62, 1.0),
    (0.2, 0.2, 0.22, 1.0),
    (0.25, 0.45, 0.75, 1.0),
)

COLORS = {
    "hull": _GREY,
    "boom": _DARK,
    "rotor": (*_BLUE[:3], 0.4),
    "link": _BLUE,
    "joint": _DARK,
    "tip": (0.85, 0.35, 0.15, 1.0),
}
"""Role of a shape -> RGBA."""


def build_spec(
    vehicle: Vehicle,
    gravity: float,
    *,
    timestep: float = 0.001,
    integrator: str = "rk4",
    loads: Sequence[TimedPayload] = (),
) -> mujoco.MjSpec:
    """MuJoCo model specification (``mujoco.MjSpec``) of a vehicle.

    Contacts, constraints, implicit damping and MuJoCo's own reset of a diverged state
    are off; joints have neither damping, friction nor limits: everything that pushes is
    applied from outside, and followers have joints of their own
    (:mod:`skyarm.plant.mujoco_loads`).

    Args:
        vehicle: vehicle with concrete numbers.
        gravity: m/s^2, positive downwards.
        timestep: s.
        integrator: "rk4", "euler" or "rk4_staged".
        loads: timed rigid payloads, each a body without mass, welded to the link that
            may hold it.
    """
    spec = mujoco.MjSpec()
    spec.modelname = vehicle.name
    # shapes are drawn only: their volumes say nothing of masses
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    # a load is a body without a joint: fused into its link its mass could not change
    spec.compiler.fusestatic = False
    spec.option.gravity = [0.0, 0.0, -float(gravity)]
    spec.option.timestep = timestep
    spec.option.integrator = INTEGRATORS[integrator]
    off = mujoco.mjtDisableBit
    spec.option.disableflags = int(
        off.mjDSBL_CONTACT
        | off.mjDSBL_CONSTRAINT
        | off.mjDSBL_EULERDAMP
        # a diverged state must stay diverged: the episode's monitor ends the flight
        | off.mjDSBL_AUTORESET
    )
    add_vehicle(spec, vehicle, loads)
    return spec


def add_vehicle(
    spec: mujoco.MjSpec,
    vehicle: Vehicle,
    loads: Sequence[TimedPayload],
    prefix: str = "",
) -> None:
    """Add the tree of a vehicle to a MuJoCo model specification.

    Args:
        spec: specification of :func:`build_spec`.
        vehicle: vehicle with concrete numbers.
        loads: loads of :func:`build_spec`.
        prefix: prefix of all names in the tree, which tells those of several vehicles
            apart.
    """
    bodies = {BASE: spec.worldbody.add_body(name=prefix + body_name(vehicle, BASE))}
    bodies[BASE].add_freejoint(
        # aligned to principal axes, base axes would not be those of the vehicle
        name=prefix + free_name(vehicle),
        align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE,
    )
    _give_inertia(bodies[BASE], vehicle.base)
    for i, link in enumerate(vehicle.moving):
        at = link.joint
        bodies[i] = bodies[link.parent].add_body(
            name=prefix + body_name(vehicle, i),
            pos=float_array(at.position),
            quat=quaternion_of(at.rotation),
        )
        _add_joint(bodies[i], at, prefix)
        _give_inertia(bodies[i], link.body)
    for i, load in enumerate(loads):
        grasp = vehicle.frame(load.frame or None)
        place = grasp.position + grasp.rotation.apply(load.com)
        name = prefix + load_name(i)
        body = bodies[grasp.link].add_body(
            name=name, pos=float_array(place), quat=quaternion_of(grasp.rotation)
        )
        # no mass until the load is held, when Loads gives it one; MuJoCo's defaults are
        # these, too (measured)
        body.explicitinertial = True
        body.mass = 0.0
        body.inertia = np.zeros(3)
        body.ipos = np.zeros(3)
        body.iquat = np.array([1.0, 0.0, 0.0, 0.0])
    _add_sites(vehicle, bodies, prefix)
    for shape in vehicle_shapes(vehicle, meshes=False):
        add_geom(spec, bodies[shape.body], shape, rgba=COLORS[shape.role], group=DRAWN)


def free_name(vehicle: Vehicle) -> str:
    """Name of the free joint of a vehicle's base."""
    return unused_name(BASE_NAME, [link.joint.name for link in vehicle.moving])


def load_name(index: int) -> str:
    """Name of the MuJoCo body of a payload."""
    return f"load {index}"


def joint_addresses(
    vehicle: Vehicle, model: mujoco.MjModel, prefix: str = ""
) -> tuple[list[int], list[int]]:
    """Addresses of a tree's joints in MuJoCo's qpos and qvel, in the order of the
    vehicle's links.
    """
    joints = [model.joint(prefix + link.joint.name) for link in vehicle.moving]
    return [int(joint.qposadr[0]) for joint in joints], [
        int(joint.dofadr[0]) for joint in joints
    ]


def site_of_rotor(vehicle: Vehicle) -> list[str]:
    """Name of the site at each rotor's hub."""
    taken = [frame.name for frame in vehicle.frames]
    sites = list[str]()
    for rotor in vehicle.rotors:
        sites.append(unused_name(rotor.name, [*taken, *sites]))
    return sites


def body_name(vehicle: Vehicle, link: int) -> str:
    """Name of the body of a link, or of the base."""
    names = [each.name for each in vehicle.moving]
    return unused_name(BASE_NAME, names) if link == BASE else names[link]


def _add_joint(body: mujoco.MjsBody, joint: Joint, prefix: str) -> None:
    """Add a joint without friction, limits or springs."""
    kinds = {
        "revolute": mujoco.mjtJoint.mjJNT_HINGE,
        "prismatic": mujoco.mjtJoint.mjJNT_SLIDE,
    }
    name = prefix + joint.name
    armature = float(joint.armature)
    # friction, limits and stops are our forces, equal on both plants
    body.add_joint(
        name=name,
        type=kinds[joint.kind],
        axis=float_array(joint.axis),
        armature=armature,
    )


def _give_inertia(body: mujoco.MjsBody, source: Body) -> None:
    """Set the inertia of a body about its centre of mass, as principal moments and
    axes.

    MuJoCo's own diagonalisation of ``fullinertia`` stops at an absolute 1e-12 kg m^2,
    which small links would feel.
    """
    moments, axes = np.linalg.eigh(np.array(source.inertia.full()))
    # a quaternion needs a rotation, not a reflection
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    moments = np.maximum(moments, LEAST)
    # a flat body has a + b = c up to rounding, and MuJoCo refuses a + b < c
    moments[2] = min(moments[2], moments[0] + moments[1])
    body.explicitinertial = True
    body.mass = max(float(source.mass), LEAST)
    body.ipos = float_array(source.com)
    body.inertia = moments
    body.iquat = quaternion_of(axes)


def _add_sites(
    vehicle: Vehicle, bodies: dict[int, mujoco.MjsBody], prefix: str
) -> None:
    """Add a site for each frame and each rotor hub (z along the thrust)."""
    for frame in vehicle.frames:
        bodies[frame.link].add_site(
            name=prefix + frame.name,
            pos=float_array(frame.position),
            quat=quaternion_of(frame.rotation),
            # 5 mm: size only matters where it is drawn
            size=[0.005] * 3,
        )
    for rotor, name in zip(vehicle.rotors, site_of_rotor(vehicle), strict=True):
        bodies[BASE].add_site(
            name=prefix + name,
            pos=float_array(rotor.position),
            quat=quaternion_of(turn_onto(rotor.axis)),
            size=[0.005] * 3,
        )


def add_geom(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, shape: Shape, **words: Any
) -> mujoco.MjsGeom:
    """Add a shape to a body, without mass, and without contacts that MuJoCo chooses."""
    # MuJoCo takes three sizes of every kind
    geom = body.add_geom(
        type=KINDS[shape.kind],
        size=[*half_lengths(shape), 0.0, 0.0][:3],
        pos=shape.position,
        quat=quaternion_of(shape.rotation),
        contype=0,
        conaffinity=0,
        mass=0.0,
        **words,
    )
    if shape.kind == "hull":
        name = f"mesh {len(spec.meshes)}"
        geom.meshname = spec.add_mesh(name=name, uservert=shape.size).name
    return geom


def half_lengths(shape: Shape) -> tuple[float, ...]:
    """Size of a shape as MuJoCo has it, m."""
    if shape.kind in ("capsule", "cylinder"):
        return shape.size[0], 0.5 * shape.size[1]
    # a plane without end has a grid alone
    return shape.size or (0.0, 0.0, 1.0)


def quaternion_of(R: Mat3 | Matrix | Array) -> Array:
    """Quaternion w x y z of a rotation matrix."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.array(R, dtype=float).ravel())
    return quaternion
