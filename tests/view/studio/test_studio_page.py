"""The page of the documents on the studio says what is so."""

import re
import sys
from pathlib import Path

import pytest

from shown_commands import run_shown
from skyarm.view.studio.clock import SPEEDS
from skyarm.view.studio.controls import CLOCK
from skyarm.view.studio.fleet import BLOW, GUST, MOST
from support.commands import skyarm as skyarm_command

ROOT = Path(__file__).resolve().parents[3]
TEXT = (ROOT / "docs" / "studio.md").read_text("utf-8")
COMMANDS = [
    line
    for line in TEXT.splitlines()
    if line.startswith(("skyarm studio", "skyarm --plugin"))
]


def test_the_page_shows_commands() -> None:
    assert len(COMMANDS) == 2


def test_every_option_of_the_page_is_there() -> None:
    told = skyarm_command("studio", "--help").out
    for option in re.findall(r"`(--[\w-]+)", TEXT):
        assert option in told, option


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for a child there")
@pytest.mark.parametrize("line", COMMANDS)
def test_a_command_of_the_page_opens_and_closes(line: str) -> None:
    code, told = run_shown(line)
    assert code == 0, told
    assert told.startswith("studio: http://127.0.0.1:")
    assert told.endswith("studio: closed\n")


def test_numbers_of_the_page_are_those_of_the_studio() -> None:
    assert f"{SPEEDS[0]:g} to {SPEEDS[-1]:g} times real time" in TEXT
    assert f"push of {BLOW[0] * BLOW[1]:g} N s" in TEXT
    assert f"gust of {GUST[0]:g} N for {GUST[1]:g} s" in TEXT
    assert (MOST, set(CLOCK)) == (3, {"play / pause", "step", "reset"})
    picture = ROOT / "docs" / "images" / "studio.webp"
    assert picture.stat().st_size < 200_000
