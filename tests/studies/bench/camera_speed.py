"""Depth pictures beside MuJoCo's ``mj_multiRay`` and crazyflow's depth, of one scene.

    python tests/studies/bench/camera_speed.py [rounds]

A camera of 64 x 48 pixels looks at a floor and 24 shapes of four kinds. The rate is
that of pictures; all take turns in one run.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from bench_timing import Contender, contest

from skyarm.algebra import ZERO3, Mat3
from skyarm.sensing.cameras.camera_kinds import DepthCamera
from skyarm.sensing.cameras.ray_casting import RayCaster
from skyarm.world.contact.surface import Surface
from skyarm.world.contact.vehicle_bodies import Part

WIDTH, HEIGHT = 64, 48

SHAPES = 24

KINDS = {
    "sphere": ("0.2", (0.2,)),
    "capsule": ("0.1 0.2", (0.1, 0.4)),
    "box": ("0.2 0.15 0.1", (0.4, 0.3, 0.2)),
    "cylinder": ("0.15 0.2", (0.15, 0.4)),
}
"""Kind -> sizes in MuJoCo's words and in ours."""

# crazyflow's depth has this vertical field of view
CAMERA = DepthCamera(
    width=WIDTH,
    height=HEIGHT,
    field_of_view=2.0 * math.atan(math.tan(math.pi / 8.0) * WIDTH / HEIGHT),
)


def scene(seed: int = 1) -> str:
    """Scene in MuJoCo's words, with the camera ahead along x."""
    rng = np.random.default_rng(seed)
    bodies = ""
    for i in range(SHAPES):
        kind = [*KINDS][i % len(KINDS)]
        place = " ".join(map(str, rng.uniform([1.0, -2.0, 0.0], [6.0, 2.0, 2.0])))
        turn = " ".join(map(str, rng.normal(size=4)))
        bodies += (
            f'<body pos="{place}" quat="{turn}">'
            f'<geom type="{kind}" size="{KINDS[kind][0]}"/></body>'
        )
    return (
        '<mujoco><worldbody><camera name="eye" pos="0 0 1" xyaxes="0 -1 0 0 0 1"/>'
        f'<geom name="floor" type="plane" size="0 0 1"/>{bodies}</worldbody></mujoco>'
    )


class Scene:
    """The scene in MuJoCo's model, and in ours."""

    def __init__(self) -> None:
        self.model = mujoco.MjModel.from_xml_string(scene())
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.turn = self.data.cam_xmat[0].reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])
        self.place = self.data.cam_xpos[0]
        surfaces = [Surface(name="floor", shape="plane")]
        for i in range(SHAPES):
            kind = [*KINDS][i % len(KINDS)]
            surfaces.append(Surface(name=f"s{i}", shape=kind, size=KINDS[kind][1]))
        parts = [Part(each, Mat3.identity(), ZERO3) for each in surfaces]
        self.caster = RayCaster(CAMERA.directions(), [*range(len(parts))], parts)

    def theirs(self) -> np.ndarray[Any, Any]:
        """Depth (rows, columns) by ``mj_multiRay``, -1 where nothing is met."""
        ways = CAMERA.directions() @ self.turn.T
        far, geoms = np.zeros(ways.size // 3), np.zeros(ways.size // 3, np.int32)
        self.multi_ray(np.ascontiguousarray(ways).ravel(), far, geoms)
        return far.reshape(HEIGHT, WIDTH)

    def multi_ray(self, ways: Any, far: Any, geoms: Any) -> None:
        """One picture of MuJoCo's."""
        mujoco.mj_multiRay(
            self.model,
            self.data,
            self.place,
            ways,
            None,
            1,
            -1,
            geoms,
            far,
            None,
            len(far),
            1e9,
        )

    def ours(self, worlds: int = 1) -> np.ndarray[Any, Any]:
        """Depths (worlds, rows, columns), with the shapes' poses made anew."""
        R_WS = self.data.geom_xmat.reshape(-1, 3, 3)
        R_SW = np.broadcast_to(R_WS.swapaxes(1, 2), (worlds, *R_WS.shape))
        away = np.broadcast_to(self.place - self.data.geom_xpos, (worlds, len(R_WS), 3))
        eyes = (R_SW @ away[..., None])[..., 0]
        return self.caster.cast(R_SW @ self.turn, eyes)[0]


def crazyflow_depth(worlds: int = 1) -> tuple[Any, Any]:
    """crazyflow's simulation of the scene and its function of depth."""
    from crazyflow.sim import Sim
    from crazyflow.sim.sensors.depth import build_render_depth_fn

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.xml"
        path.write_text(scene())
        sim: Any = Sim(n_worlds=worlds, n_drones=1, xml_path=path)
    index = sim.mj_model.camera("eye").id
    function = build_render_depth_fn(sim.mjx_model, index, (WIDTH, HEIGHT))
    return sim, function


def contenders(worlds: int) -> list[Contender]:
    """``mj_multiRay``, which is the baseline; crazyflow if it is there; ours, for one
    world and for many.
    """
    one = Scene()
    ways = np.ascontiguousarray(CAMERA.directions() @ one.turn.T).ravel()
    far, geoms = np.zeros(len(ways) // 3), np.zeros(len(ways) // 3, np.int32)

    def multi_ray() -> float:
        for _ in range(20):
            one.multi_ray(ways, far, geoms)
        return 20.0

    def ours() -> float:
        for _ in range(20):
            one.ours()
        return 20.0

    def many() -> float:
        one.ours(worlds)
        return float(worlds)

    rows = [
        Contender("mj_multiRay", "MuJoCo's rays, f64", multi_ray),
        Contender("skyarm", "rays and poses, f64", ours),
        Contender(f"skyarm {worlds}", f"the same in {worlds} worlds", many),
    ]
    try:
        sim, function = crazyflow_depth()
    except ImportError:
        return rows

    def theirs() -> float:
        function(sim).block_until_ready()
        return 1.0

    return [*rows, Contender("crazyflow", "its depth by MJX, f32", theirs)]


def main(rounds: int = 9, worlds: int = 1024) -> None:
    """Print pictures a second, and how many times the baseline's that is."""
    for score in contest(contenders(worlds), rounds):
        print(
            f"{score.name:14} {score.rate:10.0f} pictures/s"
            f" {score.ratio:7.2f} ({score.low:.2f} to {score.high:.2f}),"
            f" by processor time {score.work_ratio:.2f}  {score.what}"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
