"""Every option that writes a file does so for a vehicle with joints; what is there is
kept or replaced by one rule.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from command_files import SHORT
from every_command import NEEDS, REPLACES
from typer.main import get_command

import skyarm as package
from skyarm.cli.commands import COMMANDS as SHIPPED
from skyarm.cli.commands import program
from support.commands import refused, skyarm

PAGE = Path(__file__).resolve().parents[2] / "docs" / "command_line.md"
OLD = "# written by hand\n"
UP = """schema = 1
vehicle = "hummingbird_arm2_rotors"
phases = [{ to = { base = [0.0, 0.0, 1.0], rest = true } }]
"""
STUDY = """schema = 1
name = "tiny"
scenario = "short.toml"
episodes = 2
[vary]
"plant.vehicle.base.mass" = { uniform = [0.7, 0.9] }
"""


@pytest.fixture(scope="module")
def flight() -> package.Log:
    """A short flight that excites its vehicle."""
    return package.run(package.load_scenario("case3", duration=4.0))


@pytest.fixture(autouse=True)
def folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flight: package.Log
) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(
        SHORT.replace("duration = 0.5", "duration = 0.1")
    )
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "up.toml").write_text(UP)
    package.save_log(flight, tmp_path / "flight.npz")
    return tmp_path


def test_every_command_is_tried_here() -> None:
    assert set(REPLACES) == set(SHIPPED), "enter it in tests/cli/every_command.py"


READ = ("--columns", "--join", "--from")
"""Options with a file that is read."""

ELSEWHERE = {
    ("fly", "--out"): "needs an autopilot (tests/links/outside)",
    ("identify", "--out"): "takes long (tests/identify)",
    ("reproduce", "--out"): "takes long (tests/paper)",
    ("studio", "--out"): "is written on the page (tests/view/studio)",
}


def test_every_option_that_writes_a_file_is_tried_here_on_a_vehicle_with_joints() -> (
    None
):
    for name, command in get_command(program(list(SHIPPED))).commands.items():  # type: ignore[attr-defined]
        tried = REPLACES.get(name.split()[0], "")
        for each in command.params:
            option = each.opts[0]
            if option in READ or (
                each.metavar not in ("FILE", "PAGE")
                and option not in ("--out", "--save")
            ):
                continue
            if (name.split()[0], option) not in ELSEWHERE:
                assert any(option in words for words, *_ in tried), (
                    f"{name} {option}: enter it in every_command.py"
                )


SLOW = ("tune", "film", "plot", "identify")

CASES = [
    pytest.param(
        command, *case, marks=[pytest.mark.thorough] if command in SLOW else []
    )
    for command, cases in REPLACES.items()
    if not isinstance(cases, str)
    for case in cases
]


@pytest.mark.parametrize(("command", "words", "file", "rule"), CASES)
def test_a_file_that_is_there(
    folder: Path, command: str, words: tuple[str, ...], file: str, rule: str
) -> None:
    if command in NEEDS:
        pytest.importorskip(NEEDS[command])
    path = folder / file
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text(OLD)
    ended = skyarm(command, *words)
    numbered = path.with_name(f"{path.stem}_1{path.suffix}")
    if rule in ("kept", "refused"):
        refused(ended, path.name, "must not be there yet; --force replaces it")
        assert path.read_text() == OLD
        if rule == "refused":  # whose second run takes long
            return
        ended = skyarm(command, *words, "--force")
    assert ended.code in (0, 3), ended
    assert path.read_bytes() != OLD.encode(), ended
    assert numbered.exists() == (rule == "numbered"), ended
    if rule == "numbered":
        assert numbered.read_text() == OLD


def test_what_is_written_anew_byte_for_byte_leaves_no_copy(folder: Path) -> None:
    pytest.importorskip("pyarrow")
    for _ in range(2):
        assert skyarm("sweep", "study.toml", "--save", "1", "--out", "rows").code == 0
    assert [each.name for each in (folder / "rows").iterdir()] == [
        "episode_1_decoupled_pd.toml"
    ]


def test_the_page_says_the_rule_of_each_command() -> None:
    (rule,) = re.findall(
        r"### Files that are there\n(.*?)\n#", PAGE.read_text("utf-8"), re.S
    )
    for command, cases in REPLACES.items():
        if not isinstance(cases, str):
            assert f"`{command}" in rule, command
