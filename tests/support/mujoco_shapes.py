"""Shapes of a vehicle that touch, as geometries of MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from skyarm import load_vehicle
from skyarm.plant.mujoco_model import build_spec
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.vehicle_records import Collision

GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}


def add_geom(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, each: Collision, name: str
) -> None:
    """Add a shape to a body of a MuJoCo model."""
    turn, size = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(turn, np.array(each.rotation).ravel())
    size[: len(each.size)] = each.size
    if each.shape == "box":
        size *= 0.5
    elif each.shape != "sphere":
        size[1] *= 0.5
    mesh = ""
    if each.shape == "hull":
        mesh = f"mesh of {name}"
        spec.add_mesh(name=mesh, uservert=np.array(each.vertices).ravel())
    body.add_geom(
        name=name,
        type=GEOMS[each.shape],
        size=size,
        pos=np.array(each.position),
        quat=turn,
        meshname=mesh,
    )


def distance(model: mujoco.MjModel, data: mujoco.MjData, a: str, b: str) -> float:
    """Signed distance (m) of two geometries by MuJoCo."""
    one, other = model.geom(a).id, model.geom(b).id
    return float(mujoco.mj_geomDistance(model, data, one, other, 10.0, None))


def boxed() -> Vehicle:
    """A vehicle whose base, upper arm and forearm touch."""
    return load_vehicle(Path(__file__).parent / "boxed.toml")


def spec_with_shapes(vehicle: Vehicle) -> mujoco.MjSpec:
    """MuJoCo model of a vehicle with its shapes, named as its volumes are."""
    spec = build_spec(vehicle, 9.81)
    for each in vehicle.collisions:
        link = "base" if each.link == BASE else vehicle.moving[each.link].name
        name = link if each.link == BASE else f"link/{link}"
        add_geom(spec, spec.body(link), each, f"{name}/{each.name}")
    return spec
