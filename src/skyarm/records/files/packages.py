"""Installed packages: versions, lowest supported versions, and commands that install
extras.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

FLOORS = {
    "jinja2": "3.1",
    "orjson": "3.10",
    "cloudpickle": "3.1",
    "llvmlite": "0.45",
    "numpy": "1.26",
    "mujoco-core": "4.0",
    "typer": "0.20",
    "rich": "13",
    "matplotlib": "3.8",
}
"""Package -> the lowest version that the tests have passed on."""

METADATA = ".dist-info"
RELEASE = re.compile(r"\d+(?:\.\d+)*")


def installed_versions(
    packages: Iterable[str], path: Iterable[str] | None = None
) -> dict[str, str]:
    """Versions of the installed packages among the given ones, from the names of their
    metadata folders.

    Half a millisecond for all; ``importlib.metadata`` reads and parses a file for each
    and takes twenty.

    Args:
        packages: names in lower case, with hyphens.
        path: folders in the order of import; ``sys.path`` if left out.
    """
    names = set(packages)
    versions = dict[str, str]()
    for folder in sys.path if path is None else path:
        here: dict[str, str] = {}
        for entry in _entries(folder):
            if entry.endswith(METADATA):
                name, _, version = entry.removesuffix(METADATA).partition("-")
                name = name.lower().replace("_", "-")
                # an update that was cut off leaves the folder of the old version beside
                # that of the new
                if name in names and (
                    name not in here or _order(version) > _order(here[name])
                ):
                    here[name] = version
        versions = here | versions
    return versions


def may_extend(group: str) -> bool:
    """True if an installed package, or what lies in a zip file on the path, may have an
    entry point of a group.
    """
    for folder in sys.path:
        # a zip file cannot be searched cheaply, so it counts as one that extends
        if os.path.isfile(folder):
            return True
        for entry in _entries(folder):
            if entry.endswith((METADATA, ".egg-info", "EGG-INFO")):
                with (
                    suppress(OSError),
                    open(os.path.join(folder, entry, "entry_points.txt"), "rb") as file,
                ):
                    if group.encode() in file.read():
                        return True
    return False


def below_floor(versions: dict[str, str]) -> str | None:
    """Message about the first package that is too old, with the required version; None
    if there is none.
    """
    for package, floor in FLOORS.items():
        version = versions.get(package)
        if version is not None and _order(version) < _order(floor):
            return (
                f"{package} {version} is installed: must be at least {floor}; "
                f"python -m pip install --upgrade '{package}>={floor}'"
            )
    return None


RIVAL = "mujoco"
"""Package whose versions below 4 hold the same files as mujoco-core: whichever is
installed last overwrites them."""

REINSTALL = "python -m pip install --force-reinstall --no-deps mujoco-core"
"""Command that writes the files of mujoco-core again."""


def rival_of_mujoco(versions: dict[str, str]) -> str | None:
    """Message about a mujoco of before version 4, with the cure; None without one."""
    version = versions.get(RIVAL)
    if version is None or _order(version) >= _order(FLOORS["mujoco-core"]):
        return None
    cure = f"python -m pip uninstall -y {RIVAL}, then {REINSTALL}"
    return (
        f"{RIVAL} {version} is installed: must not stand beside mujoco-core, whose"
        f" files it has too; {cure}"
    )


def _entries(folder: str) -> list[str]:
    try:
        return os.listdir(folder or os.curdir)
    except OSError:  # no folder: a zip file, or nothing
        return []


def _order(version: str) -> tuple[int, ...]:
    """Leading numbers of a version for comparison, without trailing zeros."""
    match = RELEASE.match(version)
    numbers = [int(part) for part in match[0].split(".")] if match else []
    # so that 1.0 and 1 are one version
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)


ABSENT = "not installed"


def versions(*packages: str) -> dict[str, str]:
    """Versions of Python, skyarm and the given packages."""
    return {
        "python": sys.version.split()[0],
        **{name: _version(name) for name in ("skyarm", *packages)},
    }


# 32 is chosen: a miss costs 0.8 ms (measured)
@lru_cache(maxsize=32)
def _version(package: str) -> str:
    if package == "skyarm":
        # what an editable installation noted once is not the version of the source that
        # runs; not imported, because the package's front reaches every room
        return str(sys.modules["skyarm"].__version__)
    found = installed_versions([package]).get(package)
    if found is not None:
        return found
    # a package that is no folder on the path; imported here, since the import takes a
    # fifth of NumPy's
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ABSENT


PACKAGE = "skyarm"

SOURCE = Path(__file__).resolve().parents[4]
"""Folder of a checkout, if the running source lies in one."""


def how_to_install(*extras: str) -> str:
    """Commands that install extras of this package, from a checkout and from an index.

    The checkout is the current folder, or else that of the running source; without one
    its folder is left to the user.
    """
    pip, names = "python -m pip install", ",".join(extras)
    folder, where = ".", "in a checkout"
    if not is_checkout(Path()) and is_checkout(SOURCE):
        folder, where = str(SOURCE), "of this checkout"
    elif not is_checkout(Path()):
        where = "in the folder of a checkout"
    return (
        f'{pip} -e "{folder}[{names}]" {where}, {pip} "{PACKAGE}[{names}]" from an'
        " index"
    )


def is_checkout(folder: Path) -> bool:
    """True if a folder holds the source of this package with its build file."""
    try:
        return (
            f'name = "{PACKAGE}"'
            in (folder / "pyproject.toml").read_text("utf-8").splitlines()
        )
    # a ValueError is text that is not UTF-8
    except (OSError, ValueError):
        return False


def needs_extra(extra: str) -> str:
    """Message for a missing optional package, with the command that installs it."""
    return f"needs the extra {extra!r}: {how_to_install(extra)}"
