"""Offscreen renderer of films by MuJoCo: solids, lines and arrows over a ground with a
grid.

No vehicle is in MuJoCo's model: every solid is handed over with its place, so that
films of both plants, and of plants that MuJoCo does not know, are drawn alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np

from skyarm.plant.mujoco_model import KINDS, half_lengths
from skyarm.records.arrays import Array, IntArray, Pixels
from skyarm.records.immutable import positional
from skyarm.view.picture.marks import Stroke
from skyarm.view.picture.offscreen import offscreen
from skyarm.world.scene.shapes import (
    SURFACE,
    Shape,
    Solid,
    in_own_axes,
    mesh_of,
    own_mesh,
)

FIELD_OF_VIEW = 40.0
"""Field of view (deg), from the lower to the upper edge of a panel; chosen, a little
less than MuJoCo's usual 45."""

GEOMS = {
    **KINDS,
    **dict.fromkeys(("patch", "mesh", "hole", "hull"), mujoco.mjtGeom.mjGEOM_BOX),
    "arrow": mujoco.mjtGeom.mjGEOM_ARROW,
    "line": mujoco.mjtGeom.mjGEOM_LINE,
}

WORLD = f"""
<mujoco>
  <visual>
    <global fovy="{FIELD_OF_VIEW}"/>
    <map znear="0.02" zfar="300" shadowclip="2.5"/>
    <headlight ambient="0.5 0.5 0.5" diffuse="0.2 0.2 0.2" specular="0 0 0"/>
  </visual>
  <statistic extent="1" center="0 0 0"/>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient"
      rgb1="0.82 0.88 0.95" rgb2="0.965 0.972 0.98" width="128" height="128"/>
    <texture name="grid" type="2d" builtin="flat" mark="edge"
      rgb1="0.945 0.95 0.96" rgb2="0.945 0.95 0.96"
      markrgb="0.80 0.82 0.845" width="256" height="256"/>
    <material name="ground" texture="grid" texuniform="true" texrepeat="2 2"
      specular="0"/>
  </asset>
  <worldbody>
    <light type="directional" pos="-7.5 -6 30" dir="7.5 6 -30"
      diffuse="0.5 0.5 0.5" specular="0.2 0.2 0.2"/>
    <geom type="plane" size="60 60 1" material="ground"/>
  </worldbody>
</mujoco>"""
"""MuJoCo world: ground with a grid of 0.5 m, sky and light, with shadows within 2.5 m
of the camera's target."""

MOST_GEOMS = 4000
"""Largest number of geoms in a panel; six flights have up to 2880 pieces of trails and
desired paths."""

NO_SHADOW = mujoco.mjtCatBit.mjCAT_DECOR.value
"""Category of geometries without a shadow: the ground, whose own would be a dotted rim,
and transparent ones."""

LAMP = np.array([-7.5, -6.0, 30.0])
"""Position (m) of the light relative to the camera's target, so that shadows fall where
the flight is."""

THIN = 2e-4
"""Half the thickness (m) of a plane's patch: invisible, and not zero, at which its two
faces would fight for the same pixels."""


@positional
class CameraPath:
    """Target, distance and direction of a picture's camera in each of F frames.

    Attributes:
        look_at: (F, 3) m. distance: (F,) m. azimuth, elevation: (F,) deg, as MuJoCo's
            free camera has them.
        rotation: (F, 3, 3) from optical to world axes of a camera at ``look_at``, which
            replaces distance and angles; None for a free camera.
        slope: tangent of half its field of view, from the lower to the upper edge.
    """

    look_at: Array
    distance: Array
    azimuth: Array
    elevation: Array
    rotation: Array | None = None
    slope: float = 0.0


@positional
class FramePanel:
    """Rectangle of a film frame with its camera, solids, lines and arrows.

    Attributes:
        left, top, width, height: pixels, from the frame's upper left corner.
        camera: camera path. solids: moving solids. marks: number of a frame -> lines
            and arrows of that frame.
        ground: height of the ground, m.
    """

    left: int
    top: int
    width: int
    height: int
    camera: CameraPath
    solids: Sequence[Solid]
    marks: Callable[[int], Sequence[Stroke]]
    ground: float = 0.0


class Renderer:
    """Offscreen renderer of a film's 3D panels, frame by frame."""

    def __init__(
        self,
        panels: Sequence[FramePanel],
        width: int,
        height: int,
        *,
        fine: bool,
        current: Callable[[], None],
    ) -> None:
        self._panels = panels
        self._size = (width, height)
        self._current = current
        self._model, self._meshes = _model(width, height, _meshes_of(panels), fine=fine)
        self._data = mujoco.MjData(self._model)
        # once: the ground stays where it is, and the lamp is moved in the scene
        mujoco.mj_forward(self._model, self._data)
        self._context = mujoco.MjrContext(
            self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value
        )
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scenes = [self._scene(panel, fine=fine) for panel in panels]
        self._pixels = np.zeros((height, width, 3), np.uint8)

    def draw(self, k: int) -> Pixels:
        """Render the panels of frame k as pixels (height, width, 3); the next call
        overwrites them.
        """
        self._current()  # two stages may be open at once
        for panel, (scene, ground) in zip(self._panels, self._scenes, strict=True):
            self._place(panel, scene, ground, k)
            below = self._size[1] - panel.top - panel.height
            mujoco.mjr_render(
                mujoco.MjrRect(panel.left, below, panel.width, panel.height),
                scene,
                self._context,
            )
        mujoco.mjr_readPixels(
            self._pixels, None, mujoco.MjrRect(0, 0, *self._size), self._context
        )
        # OpenGL counts rows from the bottom
        return self._pixels[::-1]

    def move(self, panels: Sequence[FramePanel]) -> None:
        """Replace the panels by panels with the same shapes at other poses."""
        self._panels = panels

    def close(self) -> None:
        """Release the graphics context."""
        self._current()
        self._context.free()

    def _scene(self, panel: FramePanel, *, fine: bool) -> tuple[mujoco.MjvScene, int]:
        """MuJoCo scene of a panel with ground and solids, and the number of static
        geoms.
        """
        scene = mujoco.MjvScene(self._model, MOST_GEOMS)
        scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = fine
        # nothing in WORLD reflects
        scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            mujoco.MjvOption(),
            None,
            _camera(panel.camera, 0),
            mujoco.mjtCatBit.mjCAT_ALL.value,
            scene,
        )
        ground = scene.ngeom
        for geom in scene.geoms[:ground]:
            # WORLD has its ground at the height 0
            geom.pos = geom.pos + np.array([0.0, 0.0, panel.ground])
            geom.category = NO_SHADOW
        for solid in panel.solids:
            size = half_lengths(solid.shape)
            geom = self._add(scene, solid.shape.kind, size, solid.rgba or SURFACE)
            if (key := mesh_key(solid.shape)) in self._meshes:
                geom.type, geom.dataid = (
                    mujoco.mjtGeom.mjGEOM_MESH.value,
                    # every second number is a mesh, the others are their convex hulls
                    2 * self._meshes[key],
                )
        return scene, ground

    def _place_mesh(self, geom: mujoco.MjvGeom, mesh: int) -> None:
        """Correct the pose of a mesh for MuJoCo's shift of its vertices to the
        principal axes of inertia.
        """
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, self._model.mesh_quat[mesh])
        R = np.array(geom.mat).reshape(3, 3)
        geom.pos = geom.pos + R @ self._model.mesh_pos[mesh]
        geom.mat = R @ turn.reshape(3, 3)

    def _place(
        self, panel: FramePanel, scene: mujoco.MjvScene, ground: int, k: int
    ) -> None:
        """Move solids, lines, arrows and camera of a panel to frame k."""
        for i, solid in enumerate(panel.solids):
            geom = scene.geoms[ground + i]
            geom.pos, geom.mat = solid.position[k], solid.rotation[k]
            if (key := mesh_key(solid.shape)) in self._meshes:
                self._place_mesh(geom, self._meshes[key])
        # without the lines and arrows of the frame before
        scene.ngeom = ground + len(panel.solids)
        for mark in panel.marks(k):
            geom = self._add(scene, mark.kind, (mark.width, mark.width, 0.0), mark.rgba)
            mujoco.mjv_connector(
                geom, GEOMS[mark.kind].value, mark.width, mark.start, mark.end
            )
        mujoco.mjv_updateCamera(
            self._model, self._data, _camera(panel.camera, k), scene
        )
        if panel.camera.rotation is not None:
            R = panel.camera.rotation[k]
            # one for each eye; a free camera of MuJoCo has no roll
            for eye in scene.camera:
                eye.pos, eye.forward, eye.up = (
                    panel.camera.look_at[k],
                    R[:, 2],
                    -R[:, 1],
                )
                eye.frustum_top = panel.camera.slope * eye.frustum_near
                eye.frustum_bottom = -eye.frustum_top
        for i in range(scene.nlight):
            # the lamp goes along with what the camera looks at
            if not scene.lights[i].headlight:
                scene.lights[i].pos = panel.camera.look_at[k] + LAMP

    def _add(
        self,
        scene: mujoco.MjvScene,
        kind: str,
        size: Sequence[float],
        rgba: Sequence[float],
    ) -> mujoco.MjvGeom:
        """Add a geom without gloss to a MuJoCo scene."""
        geom = scene.geoms[scene.ngeom]
        # three numbers, whatever the kind has: of a patch the third is its thickness
        sizes = np.array([*size, THIN if kind == "patch" else 0.0, 0.0][:3])
        mujoco.mjv_initGeom(
            geom,
            GEOMS[kind].value,
            sizes,
            np.zeros(3),
            np.eye(3).ravel(),
            np.array(rgba, np.float32),
        )
        # MuJoCo's usual numbers, both 0.5, gloss; these are chosen
        geom.specular, geom.shininess = 0.15, 0.3
        if rgba[3] < 1.0:
            geom.category = NO_SHADOW
        scene.ngeom += 1
        return geom


@contextmanager
def open_stage(
    panels: Sequence[FramePanel], width: int, height: int, *, fine: bool = False
) -> Iterator[Renderer]:
    """Context manager that opens a renderer of ``width`` by ``height`` pixels.

    Raises:
        NoDisplayError: one line: nothing can be drawn on this machine.
    """
    with offscreen() as current:
        stage = Renderer(panels, width, height, fine=fine, current=current)
        try:
            yield stage
        finally:
            stage.close()


def _camera(path: CameraPath, k: int) -> mujoco.MjvCamera:
    """MuJoCo's free camera at frame k of a camera path."""
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat = path.look_at[k]
    camera.distance = path.distance[k]
    camera.azimuth = path.azimuth[k]
    camera.elevation = path.elevation[k]
    return camera


MeshKey = tuple[str, tuple[float, ...]]

Mesh = tuple[Array, IntArray]
"""Vertices (V, 3) in m, and triangles (F, 3), of a mesh."""


def mesh_key(shape: Shape) -> MeshKey:
    """Key of a shape's mesh (file and size); shapes with equal keys share one mesh."""
    return shape.mesh, shape.size if shape.kind in ("mesh", "hole", "hull") else ()


def _meshes_of(panels: Sequence[FramePanel]) -> dict[MeshKey, Mesh]:
    """Collect (vertices, triangles) of all meshes in the panels, by mesh key."""
    shapes = {
        mesh_key(solid.shape): solid.shape for panel in panels for solid in panel.solids
    }
    meshes = {
        key: mesh_of(in_own_axes(each)) if each.kind == "hole" else own_mesh(each)
        for key, each in shapes.items()
    }
    return {key: mesh for key, mesh in meshes.items() if mesh is not None}


def _model(
    width: int, height: int, meshes: Mapping[MeshKey, Mesh], *, fine: bool
) -> tuple[mujoco.MjModel, dict[MeshKey, int]]:
    """Make the MuJoCo model with ground, sky, light and meshes; also returns the index
    of each mesh.
    """
    spec = mujoco.MjSpec.from_string(WORLD)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    quality = spec.visual.quality
    # fine: MuJoCo's own quality, but for a shadow map of half its 4096; else no shadow
    # map, no smoothing of edges, and coarser round bodies
    quality.shadowsize, quality.offsamples = (2048, 4) if fine else (0, 0)
    quality.numslices, quality.numstacks, quality.numquads = (
        (28, 16, 4) if fine else (18, 8, 2)
    )
    spec.lights[0].castshadow = fine
    for i, (vertices, faces) in enumerate(meshes.values()):
        mesh = spec.add_mesh(
            # a shell: volume is undefined for a mesh that is not closed
            name=str(i),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        mesh.uservert, mesh.userface = vertices.ravel(), faces.ravel()
    return spec.compile(), {path: i for i, path in enumerate(meshes)}
