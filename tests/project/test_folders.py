"""The tests' folders are the rooms of the source, so that whoever changes a room finds
its tests.
"""

from __future__ import annotations

import re
from pathlib import Path

import skyarm

SOURCE = Path(skyarm.__file__).parent
TESTS = Path(__file__).resolve().parents[1]
BESIDE = {
    "attacks",
    "data",
    "dynamics/euler_lagrange",
    "mutation",
    "openness",
    "project",
    "studies/bench",
    "website",
}
"""Folders that are no room's own: of many rooms at once, or of the repository."""

ALWAYS = (TESTS, TESTS / "studies" / "bench")
"""Folders on Python's path whatever is collected (``pythonpath`` in pyproject.toml)."""


def test_every_folder_of_tests_is_a_room_of_the_source() -> None:
    folders = {path.parent.relative_to(TESTS) for path in TESTS.rglob("test_*.py")} - {
        Path()
    }
    strangers = {
        str(folder)
        for folder in folders
        if not (SOURCE / folder / "__init__.py").is_file()
    } - BESIDE
    assert strangers == set()
    assert len(folders) > 25


BESIDE_ROOMS = {"budget", "conftest", "lowest", "release", "shown_commands"}
"""Files beside the rooms: those that pages, the Makefile or pytest name."""

LINES = 1000
"""Longest file of helpers."""


def test_helpers_lie_in_their_folder_or_in_support() -> None:
    """Any other folder is on Python's path only while tests of it are collected."""
    folders = {
        path.stem: path.parent
        for path in TESTS.rglob("*.py")
        if not path.is_relative_to(TESTS / "support")
    }
    for path in TESTS.rglob("*.py"):
        lines = path.read_text("utf-8").splitlines()
        for name in {
            line.split()[1] for line in lines if line.startswith(("from ", "import "))
        } & set(folders):
            assert folders[name] in (*ALWAYS, path.parent), f"{path.name} takes {name}"
    assert {
        path.stem for path in TESTS.glob("*.py") if not path.stem.startswith("test_")
    } == BESIDE_ROOMS


def test_no_file_of_helpers_is_longer_than_a_chapter() -> None:
    helpers = [
        path for path in TESTS.rglob("*.py") if not path.stem.startswith("test_")
    ]
    lengths = {path.name: len(path.read_text("utf-8").splitlines()) for path in helpers}
    assert {name: length for name, length in lengths.items() if length > LINES} == {}


IMPORTED = re.compile(r"^[ \t]*(?:from|import) (\w+)", re.M)
"""Modules that a file takes, also inside functions and in programs that it writes."""


def test_no_file_of_the_tests_imports_a_test() -> None:
    """What two tests share is a helper's. A program that a test starts may import that
    test's own file.
    """
    taken = {
        path: set(IMPORTED.findall(path.read_text("utf-8"))) - {path.stem}
        for path in TESTS.rglob("*.py")
    }
    assert [
        (path.name, name)
        for path, names in taken.items()
        for name in names
        if name.startswith("test_")
    ] == []


LETTERS = 80
"""Longest name of a test."""


def test_names_of_tests_fit_a_line() -> None:
    texts = [path.read_text("utf-8") for path in TESTS.rglob("test_*.py")]
    names = {
        name for text in texts for name in re.findall(r"^ *def (test_\w+)", text, re.M)
    }
    assert {name for name in names if len(name) > LETTERS} == set()
