"""Mesh files that a URDF file draws its links by: where they are, by ``package://`` addresses too.

skyarm draws a vehicle from its joints and frames. A mesh is named in the notes: whether its file is there, so that one
sees what another program would draw.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path, PurePosixPath

from skyarm.vehicle.notes import Notes

PACKAGE, FILE = "package://", "file://"


def mesh_file(address: str, urdf: Path) -> Path | None:
    """File of a mesh's address; None where there is none.

    Args:
        address: ``package://PACKAGE/PATH``, ``file://PATH`` or a path beside the URDF file.
        urdf: the file that states it. A package is the folder of that name above it or beside one above it, or the
            folder above it that holds a ``package.xml``.
    """
    try:
        return next((each for each in _candidates(address, urdf) if each.is_file()), None)
    except (OSError, ValueError):  # a name that no file can have
        return None


def _candidates(address: str, urdf: Path) -> list[Path]:
    folder = urdf.resolve().parent
    if address.startswith(FILE):
        return [Path(address.removeprefix(FILE))]
    if not address.startswith(PACKAGE):
        return [folder / address]
    package, *inside = PurePosixPath(address.removeprefix(PACKAGE)).parts or ("",)
    above = [folder, *folder.parents]
    roots = [each for each in above if each.name == package]
    roots += [each / package for each in above]
    roots += [each for each in above if (each / "package.xml").is_file()]
    return [root.joinpath(*inside) for root in roots]


def note_meshes(robot: ET.Element, urdf: Path, notes: Notes) -> None:
    """Note the links whose visual meshes are not there; those that are there are not drawn either."""
    for link in robot.findall("link"):
        for mesh in link.findall("visual/geometry/mesh"):
            address = mesh.get("filename", "")
            if mesh_file(address, urdf) is None:
                notes.add("a mesh file is not there; it is drawn from its joints", link.get("name", ""), "link")
