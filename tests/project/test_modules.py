"""What modules may take from each other."""

from __future__ import annotations

import ast
import functools
import re
import sys
from pathlib import Path

import skyarm
from lowest import project

SOURCES = sorted(Path(skyarm.__file__).parent.rglob("*.py"))


@functools.cache
def imports_of(path: Path) -> list[ast.AST]:
    """Imports of a file, anywhere in it."""
    return [
        node
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]


def private_imports(path: Path) -> list[str]:
    """Underscored names that a file imports from another module."""
    found = []
    for node in imports_of(path):
        if isinstance(node, ast.ImportFrom):
            module = node.module or ""
            names = [alias.name for alias in node.names] + module.split(".")
            found += [
                f"{path.name}: {module}.{name}"
                for name in names
                if name.startswith("_") and name[:2] != "__"
            ]
    return found


NOWHERE_ELSE = {
    # viser offers its scene on a server that listens only; its buffer of messages has
    # no public name
    "recording.py: viser.infra._async_message_buffer._async_message_buffer",
    # Ray has no public word for a cluster that listens on the loopback address alone
    "ray_cluster.py: ray._private._private",
}


def test_no_module_imports_a_private_name_of_another():
    assert len(SOURCES) > 100
    assert {
        found for path in SOURCES for found in private_imports(path)
    } == NOWHERE_ELSE


INSTALLED_AS = {
    "betaflight-chirp-core": "betaflight_chirp_core",
    "dynamixel-sdk": "dynamixel_sdk",
    "mujoco-core": "mujoco",
    "pillow": "PIL",
    "pin": "pinocchio",
    "pyyaml": "yaml",
}
"""Distribution -> the name that it is imported by, where that is another."""
PEERS = {"crazyflow", "rotorpy", "PyFlyt", "gym_pybullet_drones"}
"""Simulators that the bench measures if somebody has them; nobody is asked to install
them."""


def imported(path: Path) -> set[str]:
    """Top names that a file imports, anywhere in it."""
    found = set()
    for node in imports_of(path):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add(str(node.module).split(".")[0])
    return found


def test_every_imported_library_is_declared_and_every_declared_one_is_imported():
    taken = (
        set().union(*map(imported, SOURCES))
        - set(sys.stdlib_module_names)
        - {"skyarm"}
        - PEERS
    )
    table = project()

    def names(requirements):
        found = [re.split(r"[>=; ]", each)[0] for each in requirements]
        return {INSTALLED_AS.get(name, name) for name in found}

    core, extras = (
        names(table["dependencies"]),
        set().union(*map(names, table["optional-dependencies"].values())),
    )
    assert core <= taken
    assert taken <= core | extras
