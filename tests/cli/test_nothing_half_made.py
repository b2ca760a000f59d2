"""A command that refuses its input leaves no folder behind, and none that refuses the
corrected input.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from skyarm.records.files import taken_back
from skyarm.records.registry import plugins
from skyarm.records.registry.registrations import _FOUND
from support.commands import refused, skyarm
from support.components import registry_kept

STUDY = """
schema = 1
name = "small"
scenario = "case3"
duration = 0.3
episodes = 4
chunk = 2
[windows]
steady = [0.1, 0.3]
"""

LAW = """
from skyarm.control.catalogue import make_controller
import skyarm
def make(model):
    inner = make_controller("decoupled_pd", model)
    def law(memory, measurement, reference, dt, *, par):
        memory, command = inner.law(memory, measurement, reference, dt, par=par)
        speeds, efforts = command.rotor_speeds, command.efforts
        return memory, skyarm.Command(rotor_speeds=speeds, efforts=efforts{wrong})
    return skyarm.Controller(name="mine", law=law, par=inner.par, memory=inner.memory)
"""


def anew() -> None:
    """As a process of its own would begin."""
    for held in (plugins._LOADED, plugins._MODULES):
        held.clear()
    for name in [name for name in _FOUND["law"] if ".py:" in name]:
        del _FOUND["law"][name]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(STUDY)
    (tmp_path / "mine.py").write_text(LAW.replace("{wrong}", "[:1]"))
    with registry_kept():
        yield tmp_path


def called(*words):
    with registry_kept():
        anew()
        return skyarm(*words)


COMMANDS = {
    "sweep": ("sweep", "small.toml", "--laws", "mine.py:make", "--out", "new/out"),
    "compare": ("compare", "case3", "--laws", "mine.py:make", "--out", "new/out"),
    "suite": (
        "compare",
        "--laws",
        "mine.py:make",
        "--only",
        "perfect",
        "--out",
        "new/out",
    ),
    "run": ("run", "case3", "--laws", "mine.py:make", "--out", "new/out"),
}


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_a_law_that_is_refused_leaves_no_folder(folder: Path, words) -> None:
    pytest.importorskip("pyarrow")
    refused(called(*words), "mine.py", "gives 1 efforts")
    assert not (folder / "new").exists()


def test_the_corrected_law_flies_into_the_folder_of_before(folder: Path) -> None:
    pytest.importorskip("pyarrow")
    words = COMMANDS["sweep"]
    (folder / "new" / "out").mkdir(parents=True)
    refused(called(*words), "gives 1 efforts")
    assert list((folder / "new" / "out").iterdir()) == []
    (folder / "mine.py").write_text(LAW.replace("{wrong}", ""))
    done = called(*words)
    assert done.code == 0, done.err
    # a manifest of other numbers, whose rows are gone, holds nothing back
    for file in (folder / "new" / "out" / "rows").iterdir():
        file.unlink()
    (folder / "small.toml").write_text(STUDY.replace("episodes = 4", "episodes = 2"))
    done = called(*words)
    assert done.code == 0, done.err
    assert (
        json.loads((folder / "new" / "out" / "manifest.json").read_text())["rows"] == 2
    )


def test_only_what_was_made_goes_and_only_without_a_result(tmp_path: Path) -> None:
    def work(name: str, result: bool) -> None:
        with taken_back(
            tmp_path / name, tmp_path / name / "said", tmp_path / name / "held"
        ):
            (tmp_path / name / "held").mkdir(parents=True, exist_ok=True)
            (tmp_path / name / "said").write_text("x")
            if result:
                (tmp_path / name / "held" / "row").write_text("x")
            raise ValueError("refused")

    for name, result in (("a/b", False), ("kept", True)):
        with pytest.raises(ValueError, match="refused"):
            work(name, result)
    assert sorted(path.name for path in tmp_path.rglob("*")) == [
        "held",
        "kept",
        "row",
        "said",
    ]

    def full() -> None:
        with taken_back(tmp_path / "kept" / "other"):
            (tmp_path / "kept" / "other").mkdir()
            raise OSError("disk")

    with pytest.raises(OSError, match="disk"):
        full()
    (tmp_path / "kept" / "other").rmdir()
    (tmp_path / "kept" / "held" / "row").unlink()
    with pytest.raises(ValueError, match="refused"):
        work("kept", False)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["held", "kept", "said"]
