"""Films on docs/pictures.md: their commands and Python run; the reference of the
command names every choice.
"""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path
from typing import get_args

import pytest

from skyarm.cli.commands import perform
from skyarm.view.film.make_film import Camera, Layout
from skyarm.view.film.recording import SUFFIXES
from skyarm.view.film.video_files import FILM_FORMATS
from support.pictures import needs_display

DOCS = Path(__file__).resolve().parents[3] / "docs"
BEFORE, _, PAGE = (DOCS / "pictures.md").read_text("utf-8").partition("\n## Films\n")
OPTIONS = (
    (DOCS / "command_line.md").read_text("utf-8").partition("\n### skyarm film\n")[2]
).partition("\n### ")[0]
LINES = re.findall(r"^(skyarm film .+)$", PAGE, re.M)
FLOWN = re.findall(r"^(skyarm run .+ --log (?:ct|pd)\.npz)$", BEFORE, re.M)
DRAWN = (".mp4", ".webp")
SHORT = {
    "run": ["--duration", "0.3"],
    "film": ["--window", "0", "0.2", "--size", "64x64", "--fps", "10"],
}


@pytest.mark.thorough
@needs_display
def test_the_commands_run_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("viser", reason="no extra 'studio'")
    monkeypatch.chdir(tmp_path)
    ran = 0
    for line in (*FLOWN, *LINES):
        words = shlex.split(line)
        # a recording is drawn where it is watched: it has no size
        drawn = words[1] != "film" or any(word.endswith(DRAWN) for word in words)
        short = SHORT[words[1]] if drawn else ["--window", "0", "0.2"]
        if "--window" in words:
            at = words.index("--window")
            words[at : at + 3] = []
        monkeypatch.setattr(sys, "argv", [*words, *short])
        assert perform() == 0, line
        ran += words[1] == "film"
    assert ran == 2
    made = {
        path.relative_to(tmp_path).as_posix()
        for path in tmp_path.rglob("*")
        if path.is_file()
    }
    assert made >= {"gust.webp", "wind.html"}


@needs_display
def test_the_python_shown_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("viser", reason="no extra 'studio'")
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(code, "pictures.md", "exec"), {})
    assert [path.name for path in tmp_path.iterdir()] == ["wind.webp"]


def test_every_choice_is_in_the_reference() -> None:
    for choice in (*get_args(Layout), *get_args(Camera)):
        assert re.search(rf"\b{choice}\b", OPTIONS), choice
    for suffix in (*FILM_FORMATS, *SUFFIXES):
        assert re.search(rf"\.{suffix}\b", OPTIONS), suffix
