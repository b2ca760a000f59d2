"""Random scenes of MuJoCo's geoms, and the same shapes for our rays."""

from __future__ import annotations

import mujoco
import numpy as np

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.sensing.cameras.ray_casting import RayCaster
from skyarm.world.contact.surface import Surface
from skyarm.world.contact.vehicle_bodies import Part

KINDS = ("sphere", "capsule", "box", "cylinder", "mesh")


def random_model(rng, count, hulls=True):
    """A floor and ``count`` shapes of all kinds about the origin, of 0.05 to 0.4 m."""
    assets, bodies = "", ""
    kinds = KINDS if hulls else KINDS[:-1]
    for i in range(count):
        kind = kinds[i % len(kinds)]
        place = " ".join(map(str, rng.uniform(-3.0, 3.0, 3)))
        turn = " ".join(map(str, rng.normal(size=4)))
        size = " ".join(map(str, rng.uniform(0.05, 0.4, 3)))
        shape = f'size="{size}"'
        if kind == "mesh":
            corners = rng.normal(size=(rng.integers(5, 20), 3)) * 0.3
            given = " ".join(map(str, corners.ravel()))
            assets += f'<mesh name="m{i}" vertex="{given}"/>'
            shape = f'mesh="m{i}"'
        bodies += (
            f'<body pos="{place}" quat="{turn}"><geom type="{kind}" {shape}/></body>'
        )
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{assets}</asset><worldbody>"
        f'<geom type="plane" size="0 0 1" pos="0 0 -3.2"/>{bodies}'
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def surface_of(model, geom):
    """The geom as a surface in its own axes."""
    kind = mujoco.mjtGeom(model.geom_type[geom]).name[len("mjGEOM_") :].lower()
    a, b, c = (float(each) for each in model.geom_size[geom])
    size = {
        "sphere": (a,),
        "capsule": (a, 2.0 * b),
        "cylinder": (a, 2.0 * b),
        "box": (2.0 * a, 2.0 * b, 2.0 * c),
    }.get(kind, ())
    if kind != "mesh":
        return Surface(name=f"geom{geom}", shape=kind, size=size)
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    corners = model.mesh_vert[first : first + count].astype(float)
    return Surface(
        name=f"geom{geom}",
        shape="hull",
        vertices=tuple(Vec3(*map(float, each)) for each in corners),
    )


def caster_of(directions, surfaces):
    """Our rays against surfaces, each a body of its own."""
    parts = [Part(each, Mat3.identity(), ZERO3) for each in surfaces]
    return RayCaster(directions, np.arange(len(parts)), parts)


class Ours:
    """Our rays in a scene of MuJoCo's."""

    def __init__(self, model, data, directions):
        surfaces = [surface_of(model, i) for i in range(model.ngeom)]
        self.caster = caster_of(directions, surfaces)
        self.turns = data.geom_xmat.reshape(-1, 3, 3)
        self.places = data.geom_xpos

    def poses(self, eye, turn=None):
        """Rotations and places of the sensor in the shapes' axes; one world."""
        R_SW = self.turns.swapaxes(1, 2)
        R_SC = R_SW if turn is None else R_SW @ turn
        return R_SC[None], (R_SW @ (eye - self.places)[..., None])[None, ..., 0]

    def cast(self, eye, turn=None):
        """Depth and geom of each ray, -1 for none, as MuJoCo has them."""
        depth, number = self.caster.cast(*self.poses(eye, turn))
        return np.where(np.isinf(depth[0]), -1.0, depth[0]), number[0] - 1


def theirs(model, data, eye, directions):
    """Depth and geom of each ray by ``mj_ray``."""
    geom = np.zeros((1, 1), np.int32)
    rows = []
    for way in directions:
        far = mujoco.mj_ray(model, data, eye, way, None, 1, -1, geom)
        rows.append((far, geom[0, 0]))
    far, hit = zip(*rows, strict=True)
    return np.array(far), np.array(hit)
