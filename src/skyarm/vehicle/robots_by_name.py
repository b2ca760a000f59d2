"""Robots by name: ``robot:ur5`` is the URDF file of that name in a package of robots that is installed.

Looked at in this order: example-robot-data, whose files come with its package, and robot_descriptions, which fetches a
robot's files when it is first asked for. Both are in the extra ``robots``.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import sys
from importlib.util import find_spec
from pathlib import Path

from skyarm.files import did_you_mean, needs_extra, one_line
from skyarm.vehicle.check import VehicleError, refuse

PREFIX = "robot:"

CARRIED = Path("share") / "example-robot-data" / "robots"
"""Folder of example-robot-data below the prefix where its package puts its files."""

FETCHED = "robot_descriptions"


def is_robot(name: str) -> bool:
    """Whether a name means a robot of an installed package."""
    return name.startswith(PREFIX)


def robot_file(name: str) -> Path:
    """URDF file of a robot.

    Args:
        name: ``robot:NAME``; NAME is the stem of a URDF file of example-robot-data (``ur5_robot``), or a robot of
            robot_descriptions (``ur5`` for its module ``ur5_description``).

    Raises:
        VehicleError: one line: no package, no such robot, or files that cannot be fetched.
    """
    wanted = name.removeprefix(PREFIX)
    carried = carried_robots()
    if wanted in carried:
        return carried[wanted]
    fetched = fetched_robots()
    if wanted in fetched:
        return _fetched(name, wanted)
    if not carried and not fetched:
        refuse("robot", name, needs_extra("robots"))
    known = sorted({*carried, *fetched})
    refuse(
        "robot", name, f"{did_you_mean(wanted, known)}must be one of the {len(known)} robots of the packages installed"
    )


def carried_robots() -> dict[str, Path]:
    """Name -> file of the robots of example-robot-data; empty where it is not installed."""
    for folder in dict.fromkeys((*sys.path, sys.prefix)):
        for prefix in (Path(folder) / "cmeel.prefix", Path(folder)):
            if (prefix / CARRIED).is_dir():
                return {each.stem: each for each in sorted((prefix / CARRIED).rglob("*.urdf"))}
    return {}


def fetched_robots() -> list[str]:
    """Names of the robots of robot_descriptions that it has as URDF, MJCF or xacro; empty where it is not installed."""
    spec = find_spec(FETCHED)
    if spec is None or not spec.submodule_search_locations:
        return []
    folder = Path(next(iter(spec.submodule_search_locations)))
    return sorted(each.stem.removesuffix("_description") for each in folder.glob("*_description.py"))


def _fetched(name: str, wanted: str) -> Path:
    """File of a robot of robot_descriptions, fetched by that package if it is not there yet."""
    said = io.StringIO()
    try:
        # it tells of each file that it fetches
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            module = importlib.import_module(f"{FETCHED}.{wanted}_description")
        found = getattr(module, "URDF_PATH", None) or getattr(module, "MJCF_PATH", None)
    except Exception as error:
        reason = one_line(str(error))[:200]
        raise VehicleError(
            f"robot = {name!r}: must be fetched by robot_descriptions when first asked for, and could not be: {reason}"
        ) from None
    if found is None:
        refuse("robot", name, "must be a robot that robot_descriptions has as URDF or MJCF")
    return Path(found)
