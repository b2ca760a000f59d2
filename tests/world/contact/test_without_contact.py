"""The library without its folder of contact: what is not made of contact imports, and
flights without it fly.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import skyarm

MADE_OF_CONTACT = (
    "skyarm.planning",
    "skyarm.plant.mujoco_geoms",
    "skyarm.sensing.cameras.ray",
    "skyarm.simulate.eyes",
    "skyarm.world.team",
    "skyarm.view.figures.plan_figure",
    "skyarm.studies.assess.plan_page",
)
"""Modules that may need it: a plan flies around surfaces and presses on them, a team
holds its body by grasps, a camera sees the shapes that touch."""

PROGRAM = """
import dataclasses, importlib, pkgutil, sys
import skyarm
assert skyarm.__file__.startswith(sys.argv[1]), skyarm.__file__
needing = []
for module in pkgutil.walk_packages(skyarm.__path__, "skyarm."):
    if not module.name.endswith("__main__"):
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as error:
            missing = str(error.name)
            ours = missing.startswith("skyarm")
            assert not ours or module.name.startswith(MADE_OF_CONTACT), (
                module.name,
                missing,
            )
            needing += [module.name] * missing.startswith("skyarm.world.contact")
for each in MADE_OF_CONTACT:
    assert any(name.startswith(each) for name in needing), needing
flown = []
for name in skyarm.list_scenarios():
    try:
        scenario = skyarm.load_scenario(name, duration=0.1)
    except ModuleNotFoundError as error:
        assert error.name == "skyarm.world.contact", (name, error.name)
        continue
    except skyarm.ScenarioError as error:
        known = "skyarm.world.contact" in str(error) or "duration" in str(error)
        assert known, (name, error)
        continue
    assert skyarm.run(scenario).status == "completed", name
    flown.append(name)
assert "case3" in flown and len(flown) > 4, flown
assert skyarm.check("case3").findings
"""


@pytest.mark.thorough
def test_without_the_folder_of_contact_everything_else_works(tmp_path: Path) -> None:
    shutil.copytree(
        Path(skyarm.__file__).parent,
        tmp_path / "skyarm",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    shutil.rmtree(tmp_path / "skyarm" / "world" / "contact")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    program = f"MADE_OF_CONTACT = {MADE_OF_CONTACT!r}{PROGRAM}"
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
