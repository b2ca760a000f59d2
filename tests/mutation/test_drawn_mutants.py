"""Drawn mutants: every large room of the source has one, and the published score is of
this draw.
"""

from __future__ import annotations

import collections
import re
from pathlib import Path

import mutation_draw
import mutation_record

import skyarm

HERE = Path(mutation_draw.__file__).parent
SOURCE = Path(skyarm.__file__).parent
LARGE = 1000
"""Lines from which a room must have a mutant."""
SEED, MUTANTS = mutation_record.read_drawn(HERE / "drawn.json")


def lines_by_room() -> dict[str, int]:
    lines: collections.Counter[str] = collections.Counter()
    for path in SOURCE.rglob("*.py"):
        lines[mutation_draw.room(path.relative_to(SOURCE).as_posix())] += (
            path.read_text("utf-8").count("\n")
        )
    return lines


def test_every_large_room_has_a_mutant_whose_line_is_there() -> None:
    drawn = {mutant.room for mutant in MUTANTS if mutant.there(SOURCE)}
    assert [
        room
        for room, lines in lines_by_room().items()
        if lines >= LARGE and room not in drawn
    ] == []


def test_rooms_are_the_folders_and_the_subfolders_of_the_big_ones() -> None:
    assert mutation_draw.room("control/laws/published/kim.py") == "control.laws"
    assert mutation_draw.room("identify/windows.py") == "identify"
    assert mutation_draw.room("world/contact/gripper.py") == "world"
    assert mutation_draw.tests_of("control.laws") == "control"
    assert mutation_draw.tests_of("identify") == "identify"
    assert mutation_draw.tests_of("links.other") == "links"


def test_the_published_score_is_of_this_draw() -> None:
    assert re.search(
        rf", seed {SEED}$", (HERE / "score.md").read_text("utf-8"), flags=re.MULTILINE
    )
