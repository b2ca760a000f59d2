"""xacro files: robots of macros, expanded to URDF by the package xacrodoc (extra
``xacro``).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from skyarm.records.files import must_be_one_of, needs_extra
from skyarm.vehicle.check import VehicleError, refuse

GUESS = "1.0"
"""Value of an argument that is missing: this very text, so that a default of the file's
is none."""


def _own_name(mark: Path) -> str:
    """Name of a package in its ``package.xml``, which need not be that of its folder;
    "" if it states none.
    """
    # a broken encoding must not hide the name of the package
    stated = re.search(r"<name>\s*(\S+?)\s*</name>", mark.read_text("utf-8", "replace"))
    return stated[1] if stated else ""


class _Arguments(dict[str, str]):
    """Values of a file's arguments by name, and the names that the file has looked
    up.
    """

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.asked = dict[str, None]()

    def __contains__(self, name: object) -> bool:
        self.asked[str(name)] = None
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked[name] = None
        return super().__getitem__(name)

    # goes on behind an argument that nobody gave, to find all of them
    def __missing__(self, name: str) -> str:
        self[name] = GUESS
        return GUESS


def expand_xacro(path: Path, arguments: Mapping[str, str]) -> bytes:
    """Text of the URDF that a xacro file describes; nothing is fetched.

    Args:
        path: the file. A package of its ``$(find NAME)`` is the nearest folder above
            it, or beside one above it, whose ``package.xml`` states that name, or which
            has it itself; else the one that ROS finds.
        arguments: values of its ``<xacro:arg>``.

    Raises:
        VehicleError: without the file's name: the extra is missing, or the file does
            not expand.
    """
    try:
        import xacro
        from xacrodoc import packages  # has xacro look for packages without ROS
    except ImportError:
        raise VehicleError(
            f"xacro: is missing; a .xacro file {needs_extra('xacro')}"
        ) from None
    # a cache of a package that another file found would point to its folder
    packages.reset()
    marks = [
        mark
        # from the outermost folder inwards, so that the nearest package stays in the
        # cache
        for above in reversed(path.resolve().parents)
        for mark in above.glob("*/package.xml")
    ]
    packages.update_package_cache(
        {
            name: mark.parent
            for mark in marks
            for name in (mark.parent.name, _own_name(mark))
        }
    )
    given = _Arguments(arguments)
    fault = expanded = ""
    try:
        expanded = xacro.process_file(str(path), mappings=given).toxml()
    except Exception as error:
        # of its macros, its expressions and the files that it includes
        fault = str(error)
    # by identity: only the placeholder itself is an argument that is missing
    if missing := [name for name, value in given.items() if value is GUESS]:
        fault = f"arguments {', '.join(missing)} are missing"
    if fault:
        values = ", ".join(f"{name} = VALUE" for name in missing or ["NAME"])
        cure = (
            f'schema = 1, name = "v", urdf = "{path.name}" and in the table [xacro]'
            f" {values}"
        )
        raise VehicleError(
            f"xacro: {fault}: must expand; a file v.toml beside it gives it its"
            f" arguments: {cure}"
        )
    for name in arguments:  # xacro itself takes any
        if name not in given.asked:
            refuse(
                f"xacro.{name}",
                arguments[name],
                f"is of no effect: {must_be_one_of(given.asked, name)}",
            )
    return expanded.encode()
