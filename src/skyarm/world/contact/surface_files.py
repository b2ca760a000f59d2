"""Surfaces from files: the shapes of an MJCF scene, the convex hull of a mesh, or the
heightfield of an image.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from skyarm.algebra import ZERO3, Vec3
from skyarm.records import coerce
from skyarm.records.field_rules import checked
from skyarm.records.files import errors_as, shown
from skyarm.records.files.fields import list_of_tables
from skyarm.records.files.mesh_vertices import MESHES, read_vertices
from skyarm.records.files.names import unreadable
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.records.read_table import entry_of, record_from
from skyarm.records.units import Unit
from skyarm.vehicle.attach import Notes, at_origin, moved_into, posed_in
from skyarm.vehicle.description import rpy_of
from skyarm.vehicle.imported_shapes import MOST_CORNERS, MOST_VERTICES, collision_of
from skyarm.vehicle.mjcf import SceneShape, read_image, read_scene, words_of
from skyarm.vehicle.vehicle_records import FEWEST_CORNERS
from skyarm.world.contact.material import Material
from skyarm.world.contact.surface import Surface, rotation_of, rows_of

SCENE = ".xml"
"""Suffix of MJCF files."""

IMAGE = ".png"
"""Suffix of images of heights."""

BASE = 0.1
"""Thickness (m) of the heightfield of an image below its lowest point."""

METRES = Vec3(1, 1, 1)
"""Scale of a file whose lengths are in m."""


class SurfaceFileWarning(UserWarning):
    """Warning about what a file holds and its surfaces lack.

    These are corners of a hull, what moves, and shapes that touch in MuJoCo alone.
    """


SimplifiedHullWarning = SurfaceFileWarning
"""Name of the warning where hulls alone can be simplified."""


@immutable
@checked("body")
class SurfaceFile:
    """File whose shapes become surfaces: an MJCF scene, a mesh, of which it is the
    convex hull, or an image of heights.
    """

    name: Annotated[
        str,
        Unit(
            "",
            "name of the surface; those of a scene are called NAME/GEOM",
            rule=coerce.name,
        ),
    ]
    file: Annotated[
        str, Unit("", "path of an MJCF scene, of a mesh or of an image of heights")
    ]
    position: Annotated[
        Vec3, Unit("m", "position of the file's origin, world axes")
    ] = ZERO3
    angles: Annotated[
        Vec3, Unit("rad", "roll, pitch, yaw: about x, then y, then z of the world")
    ] = ZERO3
    scale: Annotated[
        Vec3,
        Unit(
            "m",
            "length of one unit of a mesh file, along each axis; of an image distances"
            " of pixels along x and y, and height of the highest over the lowest",
        ),
    ] = METRES
    most_vertices: Annotated[
        int,
        Unit(
            "",
            "largest number of corners of the hull of a mesh",
            low=FEWEST_CORNERS,
            high=MOST_CORNERS,
        ),
    ] = MOST_VERTICES
    material: Material | None = None

    def surfaces(self, folder: Path) -> Iterator[Surface]:
        """Surfaces of the file, where it lies in the world.

        Args:
            folder: where the path of the file begins.

        Raises:
            ValueError: one line without the file's name: what cannot be read.
        """
        path, notes = folder / self.file, Notes()
        suffix = path.suffix.lower()
        if suffix not in (SCENE, IMAGE, *MESHES):
            allowed = f"{', '.join(MESHES)}, {SCENE} (MJCF) or {IMAGE} (heights)"
            raise ValueError(f"must end in {allowed}")
        if reason := unreadable(path):
            raise ValueError(reason)
        if suffix != SCENE:
            friction, at = Material().friction, replace(at_origin(), name=self.name)
            if suffix == IMAGE:
                words = read_image(path, [*self.scale], BASE)
            else:
                points = read_vertices(path, [*self.scale])
                mesh = self.name, "hull", at, points, notes, self.most_vertices
                words = words_of(collision_of(*mesh))
            shapes = [SceneShape(at, words, friction)]
        elif self.scale == METRES:
            shapes = read_scene(path, f"{self.name}/", self.most_vertices, notes)
        else:
            raise ValueError("is in m: scale must be left out of an MJCF scene")
        origin = posed_in(at_origin(), rotation_of(self.angles), self.position)
        for each in shapes:
            at, words = moved_into(origin, each.at), each.words
            if "heights" in words:
                words = {**words, "heights": rows_of(words["heights"])}
            with errors_as(ValueError, f"{at.name}: "):
                yield Surface(
                    name=at.name,
                    position=at.position,
                    angles=Vec3(*rpy_of(at.rotation)),
                    material=self.material or Material(friction=each.friction),
                    **words,
                )
        for line in notes.lines():
            warnings.warn(line, SurfaceFileWarning, stacklevel=2)


def with_bodies(world: Entry, folder: Path) -> Entry:
    """Table [world] in which surfaces stand in place of the files of its bodies.

    Args:
        world: plain table of a file.
        folder: folder of the file.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if not isinstance(world, Mapping) or "bodies" not in world:
        return world
    expanded = dict(world)
    rows = list_of_tables(expanded.pop("bodies"), "world.bodies")
    stated = list_of_tables(world.get("surfaces", []), "world.surfaces")
    surfaces: list[Entry] = [each.table for each in stated]
    names = list[str]()
    for row in rows:
        body = record_from(SurfaceFile, row)
        if body.name in names:
            raise ValueError(
                f"{row.at('name')} = {shown(body.name)}: must be of one body only"
            )
        names.append(body.name)
        label = f"{row.at('file')} = {shown(body.file)}: "
        with errors_as(ValueError, label, (ValueError, OSError)):
            surfaces += map(entry_of, body.surfaces(folder))
    return expanded | {"surfaces": surfaces}
