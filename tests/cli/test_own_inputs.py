"""A command never writes over what it reads, under whatever name, and none writes under
another format's suffix.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import pytest
from every_command import NEEDS, OVERWRITES

from skyarm.cli.commands import COMMANDS as SHIPPED
from skyarm.records.files.own_inputs import inputs_kept, note_input, require_no_input
from skyarm.records.files.writing import write_atomically
from skyarm.vehicle.vehicle_files import LIBRARY as VEHICLES
from support.commands import refused, skyarm
from support.components import registry_kept

SCENARIO = """
schema = 1
name = "short"
duration = 0.1
[plant]
vehicle = "hummingbird_arm2_rotors"
[model]
vehicle = "hummingbird_arm2"
[controller]
preset = "paper_pd"
[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
"""
LAW = """
from skyarm.control.catalogue import make_controller
def make(model): return make_controller("decoupled_pd", model)
"""
TASK = """schema = 1
vehicle = "ours.toml"
phases = [{ to = { base = [0.0, 0.0, 1.0], rest = true } }]
"""
SAME: Mapping[str, Callable[[Path, Path], None]] = {
    "link": lambda new, old: new.symlink_to(old.name),
    "name": lambda new, old: os.link(old, new),
}
"""Ways in which one file has two names."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(SCENARIO)
    (tmp_path / "law.py").write_text(LAW)
    (tmp_path / "ours.toml").write_bytes((VEHICLES / "hummingbird.toml").read_bytes())
    (tmp_path / "task.toml").write_text(TASK)
    return tmp_path


@cache
def flight() -> bytes:
    """Log of the scenario."""
    skyarm("run", "short.toml", "--log", "flown.npz")
    return Path("flown.npz").read_bytes()


def test_every_command_is_tried_here() -> None:
    assert set(OVERWRITES) == set(SHIPPED), "enter it in tests/cli/every_command.py"


def test_a_log_is_flown_again_beside_itself(folder: Path) -> None:
    """It keeps its name and its bytes; the flight of now is numbered."""
    Path("out/run").mkdir(parents=True)
    Path("out/run/short.npz").write_bytes(flight())
    ended = skyarm("run", "out/run/short.npz")
    assert ended.code == 0, ended.err
    assert Path("out/run/short.npz").read_bytes() == flight()
    assert sorted(file.name for file in Path("out/run").iterdir()) == [
        "short.npz",
        "short_1.csv",
        "short_1.npz",
    ]


def test_a_file_that_takes_the_number_of_one_that_is_gone_is_written(
    folder: Path,
) -> None:
    note = Path("read.toml")
    note.write_text("a = 1")
    with inputs_kept():
        note_input(note)
        note.rename("other.toml")
        # the number's new owner, as it has another path and other content
        Path("other.toml").write_text("a = 22")
        require_no_input("other.toml")
        Path("other.toml").rename(note)
        with pytest.raises(ValueError, match="must be another file"):
            require_no_input(note)


def test_a_file_that_was_read_is_known_though_a_name_of_it_is_gone(
    folder: Path,
) -> None:
    for name in ("a.toml", "b.toml"):
        Path(name).write_text(name)
        os.link(name, f"other_{name}")
    with inputs_kept():
        for name in ("a.toml", "other_a.toml", "b.toml"):
            note_input(Path(name))
        Path("other_a.toml").unlink()
        Path("b.toml").rename("kept.toml")  # as an editor that saves
        require_no_input("b.toml")
        for name in ("a.toml", "kept.toml", "other_b.toml"):
            with pytest.raises(ValueError, match="must be another file"):
                require_no_input(name)


SLOW = {"tune", "film", "plot", "margins"}
"""Commands that import more than all others."""

CASES = [
    pytest.param(
        command,
        *case,
        marks=[pytest.mark.thorough] if command in SLOW or case is not cases[0] else [],
    )
    for command, cases in OVERWRITES.items()
    if not isinstance(cases, str)
    for case in cases
]


@pytest.mark.parametrize(("command", "words", "read", "written"), CASES)
def test_a_command_refuses_to_write_over_its_input(
    folder: Path, command, words, read, written
) -> None:
    if command in NEEDS:
        pytest.importorskip(NEEDS[command])
    if "flight.npz" in words:
        Path("flight.npz").write_bytes(flight())
    before = Path(read).read_bytes()
    place = Path(written)
    place.parent.mkdir(exist_ok=True, parents=True)
    if not place.exists():
        os.link(read, place)
    with registry_kept():
        ended = skyarm(command, *words)
    refused(ended, written, "must be another file than those that are read")
    assert Path(read).read_bytes() == before
    assert place.samefile(read)


@pytest.mark.parametrize("same", SAME)
def test_a_file_is_known_under_its_other_names(folder: Path, same: str) -> None:
    SAME[same](folder / "other.csv", folder / "short.toml")
    for name in ("other.csv", "./other.csv", str(folder / "other.csv")):
        refused(
            skyarm("run", "short.toml", "--log", name),
            "--log = ",
            "must be another file than those that are read",
        )
    assert (folder / "short.toml").read_text() == SCENARIO


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ("margins", "short.toml", "--out", "short.toml"),
            "--out = 'short.toml': must end in .json",
        ),
        (
            ("export", "short.toml", "--to", "c", "--out", "law.py"),
            "--out = 'law.py': must end in .c",
        ),
        (
            ("identify", "--design", "hummingbird", "--out", "law.py"),
            "--out = 'law.py': must end in .toml",
        ),
    ],
)
def test_a_suffix_that_is_not_written_is_refused(
    folder: Path, words, line: str
) -> None:
    refused(skyarm(*words), line)
    assert (folder / "short.toml").read_text() == SCENARIO
    assert (folder / "law.py").read_text() == LAW


def test_the_last_word_is_where_files_are_written(folder: Path) -> None:
    """A file that is read after the first look, or an output that no command
    announces.
    """
    with inputs_kept():
        write_atomically("new.json", b"{}")
        skyarm("show", "short.toml")
        require_no_input("short.toml")  # the command above is over
    with inputs_kept():
        from skyarm.scenario.scenario_file import load_scenario

        load_scenario("short.toml")
        (folder / "link").symlink_to("short.toml")
        for name in ("short.toml", "link"):
            with pytest.raises(
                ValueError,
                match=f"file = '{name}': must be another file than those that are read",
            ):
                write_atomically(name, b"")
    write_atomically("link", b"")
    assert (folder / "short.toml").read_bytes() == b""
