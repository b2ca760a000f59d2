"""Meshes that bodies of a world are drawn as: files beside that of the scenario, looked at when it is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from skyarm.files import shown
from skyarm.files.stl_mesh import read_corners


def with_meshes(table: Any, where: str, folder: Path) -> Any:
    """The tables of a world whose paths of meshes stand below a folder, as absolute paths.

    Args:
        table: plain, of a file.
        where: its place in the file.
        folder: of the file.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if isinstance(table, list):
        return [with_meshes(each, f"{where}[{i}]", folder) for i, each in enumerate(table)]
    if not isinstance(table, dict):
        return table
    found = {name: with_meshes(each, f"{where}.{name}", folder) for name, each in table.items()}
    mesh = table.get("mesh")
    if isinstance(mesh, str) and mesh:
        path = folder / mesh
        try:
            read_corners(path)
        except ValueError as error:
            raise ValueError(f"{where}.mesh = {shown(mesh)}: {error}") from None
        found["mesh"] = str(path.absolute())  # a log is drawn from any folder
    return found
