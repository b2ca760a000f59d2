"""Wrong scenario files are refused in the words that they were refused in, on one line.

Where this is meant to change: ``wrong_files.py --write`` in this folder; a person reads
what has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import wrong_files
from shipped_files import only_shipped

import skyarm
from support.cases import toml_text

ENTRIES = wrong_files.entries()
EVERY = 4
"""Of which one is read by every run of the tests; all take ten seconds."""


def place(entry: dict[str, Any]) -> str:
    """Name of a wrong file, for a failure."""
    if "text" in entry:
        return f"text {entry['text']!r}"
    return (
        f"{entry['base']} {entry['path']} = {entry['value']!r}"
        if "value" in entry
        else f"{entry['base']} without {entry['path']}"
    )


def require_messages(entries: Sequence[dict[str, Any]]) -> None:
    with only_shipped():
        found = [(entry, wrong_files.message(entry)) for entry in entries]
    lines = [
        f"{place(entry)}\n  now    {now}\n  pinned {entry['message']}"
        for entry, now in found
        if now != entry["message"]
    ]
    assert lines == [], "\n".join([f"{len(lines)} messages differ", *lines])


def test_some_wrong_files_are_refused_in_the_words_that_they_were_refused_in() -> None:
    require_messages(ENTRIES[::EVERY])


@pytest.mark.thorough
def test_all_wrong_files_are_refused_in_the_words_that_they_were_refused_in() -> None:
    require_messages(ENTRIES)


def test_wrong_files_differ_and_their_messages_are_of_one_line() -> None:
    texts = [entry["message"] for entry in ENTRIES if entry["message"] is not None]
    assert len({place(entry) for entry in ENTRIES}) == len(ENTRIES) > 500
    assert all(text and "\n" not in text and len(text) <= 1000 for text in texts)
    assert all("note" in entry for entry in ENTRIES if entry["message"] is None)


def test_a_file_that_is_read_has_its_name_before_the_message(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    for entry in [entry for entry in ENTRIES if "base" in entry and entry["message"]][
        ::60
    ]:
        path.write_text(toml_text(wrong_files.document(entry)), "utf-8")
        with only_shipped(), pytest.raises(skyarm.ScenarioError) as error:
            skyarm.load_scenario(path)
        assert str(error.value) == f"{path}: {entry['message']}"


@pytest.mark.parametrize("base", ["free", "contact", "pick"])
def test_the_files_that_wrong_files_differ_from_are_right(base: str) -> None:
    assert (
        wrong_files.message({"base": base, "path": "title", "value": "Another title"})
        is None
    )


def test_a_message_that_differs_is_shown() -> None:
    entry = {
        "base": "free",
        "path": "plant.kind",
        "value": "gazebo",
        "message": "plant.kind: no",
    }
    with pytest.raises(
        AssertionError,
        match=r"now    plant\.kind = 'gazebo': must be one of rigid_body",
    ):
        require_messages([entry])
