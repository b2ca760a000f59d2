"""Mesh files that a URDF file draws its links by: where they are, by ``package://`` addresses too.

A link is drawn as its meshes where their STL files are there, else from its joints and frames, and the notes say so.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path, PurePosixPath

from skyarm.algebra import Vec3
from skyarm.files.stl_mesh import FARTHEST, METRES, read_corners
from skyarm.vehicle.check import refuse
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.notes import Notes
from skyarm.vehicle.vehicle_records import Look
from skyarm.vehicle.xml_fields import numbers, origin_of

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


def looks_of(link: ET.Element, urdf: Path, notes: Notes) -> list[Look]:
    """Meshes of a link's visuals, in the link's own axes; one that cannot be drawn is noted.

    Args:
        link: of the file.
        urdf: the file.
        notes: of its reader.
    """
    name, found = link.get("name", ""), []
    for visual in link.findall("visual"):
        for mesh in visual.findall("geometry/mesh"):
            file, field = mesh_file(mesh.get("filename", ""), urdf), f"link[{name}].visual"
            if file is None:
                notes.add("a mesh file is not there; it is drawn from its joints", name, "link")
                continue
            if file.suffix.lower() != ".stl":
                notes.add("a mesh file is no .stl; it is drawn from its joints", name, "link")
                continue
            try:  # a picture that cannot be drawn changes nothing of how the vehicle flies
                rotation, position = origin_of(visual, field)
                if max(map(abs, position)) > FARTHEST:
                    refuse(f"{field}.origin.xyz", list(position), f"must be within {FARTHEST:g} m")
                x, y, z = numbers(mesh, "scale", f"{field}.mesh", METRES)
                read_corners(file, (x, y, z))
            except ValueError as error:
                notes.add(f"a mesh cannot be drawn ({error}); it is drawn from its joints", name, "link")
                continue
            scale = Vec3(x, y, z)
            found.append(Look(name=name, link=BASE, position=position, rotation=rotation, file=str(file), scale=scale))
    return found
