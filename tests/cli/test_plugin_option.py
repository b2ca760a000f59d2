"""Plugins and laws from files on the command line."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from skyarm.scenario.scenario_file import LIBRARY
from skyarm.simulate import Log
from support.commands import refused, skyarm
from support.components import registry_kept, same_logs

OWN = Path(__file__).parents[1] / "support" / "own_plugin.py"


@pytest.fixture(autouse=True)
def _kept():
    with registry_kept():
        yield


CASE = (
    (LIBRARY / "case1.toml")
    .read_text("utf-8")
    .replace('name = "case1"', 'name = "mine"')
)
ADDED = """
[[environment.forces]]
kind = "own_tether"
stiffness = 0.2

[[endings]]
kind = "own_ceiling"
height = 4.0
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    shutil.copy(OWN, tmp_path / "own_plugin.py")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(CASE + ADDED)
    return tmp_path


def logged(folder: Path) -> Log:
    return Log.load_npz(folder / "out" / "run" / "mine.npz")


@pytest.mark.parametrize("place", ["before", "after", "equals"])
def test_the_command_line_loads_plugins_wherever_they_stand(folder, place):
    words = ["run", "mine.toml", "--duration", "0.1"]
    given = {
        "before": ["--plugin", "own_plugin.py", *words],
        "after": [*words, "--plugin", "own_plugin.py"],
        "equals": [*words, "--plugin=own_plugin.py"],
    }
    done = skyarm(*given[place])
    assert done.code == 0, done
    log = logged(folder)
    assert (log.status, log.time.size) == ("completed", 20)
    assert log.info["plugins"]["own_plugin.py"].startswith("sha256:")


def test_without_it_the_file_is_refused_in_one_line(folder):
    refused(
        skyarm("run", "mine.toml"),
        "mine.toml",
        "environment.forces[0].kind = 'own_tether'",
        "must be one of force_wind",
    )
    refused(
        skyarm("run", "mine.toml", "--plugin"),
        "--plugin: must be followed by a .py file",
    )
    refused(skyarm("run", "mine.toml", "--plugin", "gone.py"), "plugin = 'gone.py'")
    (folder / "bad.py").write_text("x = 1\n1 / 0\n")
    refused(
        skyarm("run", "mine.toml", "--plugin", "bad.py"),
        "bad.py",
        "line 2: ZeroDivisionError",
    )


def test_a_law_of_a_file_flies_from_the_command_line(folder):
    words = ["run", "mine.toml", "--duration", "0.1", "--plugin", "own_plugin.py"]
    for option in (["--laws", "own_plugin.py:make"], ["--laws=own_plugin.py:make"]):
        done = skyarm(*words, *option)
        assert done.code == 0, done
        flown = logged(folder)
        assert flown.info["controller"] in ("own_plugin.py:make", "decoupled_pd")
    shipped = skyarm(*words, "--laws", "decoupled_pd")
    assert shipped.code == 0
    assert same_logs(flown, logged(folder))
    refused(
        skyarm(*words, "--laws", "own_plugin.py:none"), "must have a function 'none'"
    )
