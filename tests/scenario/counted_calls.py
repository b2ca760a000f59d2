"""Counts of the library's function calls: one scenario read, and one number of it
replaced at a time.

``python tests/scenario/counted_calls.py`` prints the counts of the library on Python's
path, of whatever version; ``--write`` writes them into ``pins/calls.json``.

Counted are calls of Python functions of the package, resumptions of generators among
them, and the files that they lie in. Each work is done twice before it is counted: what
is cached for the life of a process, such as the rules of a class, does not count.
"""

from __future__ import annotations

import dataclasses
import json
import platform
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FrameType

import skyarm
from skyarm.scenario.scenario_checks import begin

FILE = Path(__file__).with_name("pins") / "calls.json"
PACKAGE = str(Path(skyarm.__file__).parent)

LOADED = "case3"

TEAM = "two_carry_a_bar"
"""Scenario of two vehicles whose law is the same and whose bar is set down and met
before it is flown."""

REPLACED = {
    "plant.gravity": 9.7,
    "environment.wind.velocity.0": 2.0,
    "controller.gains.position.x": 4.2,
    "reference.base.radius": 0.4,
    "plant.vehicle.base.mass": 0.8,
    "initial.position.x": 0.2,
}
"""Path -> new number."""


def count(work: Callable[[], object]) -> dict[str, int]:
    """Calls of the package's functions in some work, and the number of files that these
    lie in.
    """
    files: list[str] = []

    def see(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and (file := frame.f_code.co_filename).startswith(PACKAGE):
            files.append(file)

    before = sys.getprofile()
    sys.setprofile(see)
    try:
        work()
    finally:
        sys.setprofile(before)
    return {"calls": len(files), "files": len(set(files))}


def version() -> str:
    """Version of Python, on which the counts depend: a comprehension is a call in some
    and not in others.
    """
    return ".".join(platform.python_version_tuple()[:2])


def works() -> dict[str, Callable[[], object]]:
    """Name -> what is counted."""
    given = skyarm.load_scenario(LOADED)
    found: dict[str, Callable[[], object]] = {
        f"load {LOADED}": partial(skyarm.load_scenario, LOADED),
        f"load {TEAM}": partial(skyarm.load_scenario, TEAM),
        f"start of {TEAM}, computed anew": partial(
            begin.__wrapped__, skyarm.load_scenario(TEAM)
        ),  # type: ignore[attr-defined]
        "seed": partial(dataclasses.replace, given, seed=given.seed + 1),
    }
    return found | {
        path: partial(skyarm.with_numbers, given, {path: value})
        for path, value in REPLACED.items()
    }


def counts() -> dict[str, dict[str, int]]:
    """Counts of each work, after it has been done twice."""
    found = {}
    for name, work in works().items():
        work()
        work()
        found[name] = count(work)
    return found


if __name__ == "__main__":
    told = counts()
    if sys.argv[1:] == ["--write"]:
        held = json.loads(FILE.read_text("utf-8")) if FILE.exists() else {}
        held |= {"python": version(), "now": told}
        FILE.write_text(json.dumps(held, indent=1) + "\n", "utf-8")
    else:
        print(json.dumps(told, indent=1))
