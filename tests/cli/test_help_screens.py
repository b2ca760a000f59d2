"""Help screens: few commands, each with one sentence, and one screen for each of
them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, get_args

import pytest
import typer

from skyarm.cli.commands import COMMANDS
from skyarm.cli.output import parameters_of
from skyarm.records.registry.shipped import SECTIONS
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from support.commands import skyarm

LINES, COLUMNS, MOST = 26, 100, 18


def test_there_are_few_commands_in_four_groups_with_one_sentence_each() -> None:
    assert len(COMMANDS) <= MOST
    assert len(SECTIONS) == 4
    text = skyarm("--help", columns=80).out
    for name, sentence in COMMANDS.items():
        assert re.fullmatch(r"[A-Z][^.]*\.", sentence), name
        assert re.search(rf"^  {name} +{re.escape(sentence)}$", text, re.MULTILINE), (
            name
        )


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_is_one_screen_that_begins_with_its_sentence(
    command: str,
) -> None:
    lines = skyarm(command, "--help", columns=COLUMNS).out.splitlines()
    assert len(lines) <= LINES
    assert lines[2].strip() == COMMANDS[command]


PAGE = Path(__file__).resolve().parents[2] / "docs" / "command_line.md"
TEXT = PAGE.read_text("utf-8")
BLOCKS = dict(
    re.findall(r"<!-- generated: command ([\w ]+) -->\n(.*?)<!-- /", TEXT, re.S)
)
COMMON = re.findall(r"<!-- generated: common -->\n(.*?)<!-- /", TEXT, re.S)[0]
"""Rows of the page for the options of every command."""


def rows_of(block: str) -> list[dict[str, str]]:
    head, _, *rows = (
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip("|"))]
        for line in block.splitlines()
    )
    return [dict(zip(head, row, strict=True)) for row in rows]


def test_the_page_has_every_option_of_all_commands() -> None:
    assert [row["option"].split("`")[1] for row in rows_of(COMMON)] == [
        "--json",
        "--quiet",
        "--plugin",
        "--debug",
    ]


@pytest.mark.parametrize("command", BLOCKS)
def test_the_help_speaks_the_words_of_the_page(command: str) -> None:
    """SCENARIO, FILE, NUMBER: nothing of Python's, as <str> or {scenario}."""
    shown = skyarm(*command.split(), "--help", columns=COLUMNS).out
    assert not re.search(r"[<>{}]|Annotated|str\b", shown), shown
    words = " ".join(shown.split())
    for cells in (*rows_of(BLOCKS[command]), *rows_of(COMMON)):
        name = cells.get("argument or option", cells.get("option", "")).split("`")[1]
        value = cells.get("value", "-").strip("`-")
        line = " ".join(
            [name, *([value] if value else []), *cells["meaning"].split()]
        ).replace("\\|", "|")
        assert line.partition(" [default")[0] in words, shown


def test_rows_of_a_docstring_are_the_help_of_its_parameters() -> None:
    def own(
        flight: str,
        speed: float = 1.0,
        film: bool = False,
        older: int = typer.Option(3, help="its own"),
        tare: bool = True,
        mass: Annotated[float, "kg"] = 0.0,
    ) -> None:
        """Fly.

        Options:
            flight FILE: the log, of
                one flight
            speed: m/s
            film: it is drawn
            older: other words
            tare: subtract it
            mass: of the load

        Words below the rows are of no row.
        """

    kinds = {each.name: each.annotation for each in parameters_of(own)}
    assert kinds.pop("older") is int
    stated = {name: get_args(kind)[1] for name, kind in kinds.items()}
    assert [(each.metavar, each.help) for each in stated.values()] == [
        ("FILE", "the log, of one flight"),
        (None, "m/s"),
        (None, "it is drawn"),
        (None, "subtract it"),
        (None, "of the load"),
    ]
    # only a flag that is set needs --no-NAME, which Typer adds to one without a name
    assert stated["film"].default == "--film"
    assert stated["tare"].default is ...


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ("run", "case3", "--seed", "x"),
            "--seed = 'x': must be a valid integer; see 'skyarm run --help'",
        ),
        (
            ("run", "case3", "--duration=a"),
            "--duration = 'a': must be a valid number; see 'skyarm run --help'",
        ),
        (
            ("run", "case3", "--seed"),
            "Option '--seed' requires an argument; see 'skyarm run --help'",
        ),
        (("identify", "a.csv"), "flight = 'a.csv': no such file"),
    ],
)
def test_wrong_words_are_shown_with_what_is_allowed(
    words: tuple[str, ...], line: str
) -> None:
    ended = skyarm(*words)
    assert (ended.code, ended.err) == (2, f"skyarm: {line}\n")


@pytest.mark.parametrize("columns", [80, 300])
def test_heads_of_a_wide_table_keep_their_words(columns: int) -> None:
    """At 80 columns the table of a joint's twelve numbers has a row for each."""
    text = skyarm("show", "crazyflie_arm1", columns=columns).out
    joints = text[text.index("\njoints\n") : text.index("\nbodies")]
    assert all(
        head in joints
        for head in (
            "position, m ",
            "coulomb, N m or N ",
            "stop stiffness, N m/rad or N/m ",
        )
    )
    assert (len(joints.splitlines()) > 10) == (columns == 80)
    assert max(map(len, joints.splitlines())) <= columns


@pytest.mark.parametrize("vehicle", list_vehicles())
def test_no_word_of_a_table_is_broken_at_80_columns(vehicle: str) -> None:
    """Joints that do not fit beside each other stand below; paths of sources alone are
    longer than a column.
    """
    narrow, wide = (
        skyarm("show", vehicle, columns=columns).out.partition("\nsources\n")[0]
        for columns in (80, 300)
    )
    assert max(map(len, narrow.splitlines())) <= 80
    assert {*narrow.split()} <= {*wide.split()}
    assert all(
        link.joint.name in narrow.split() for link in load_vehicle(vehicle).links
    )


def test_a_name_is_not_broken_beside_a_long_text() -> None:
    assert (
        "rotor_defaults.rolling_moment_coefficient  "
        in skyarm("show", "crazyflie_arm1", columns=80).out
    )


@pytest.mark.parametrize("columns", [30, 40])
def test_long_names_leave_half_of_a_narrow_screen_to_the_values(columns):
    text = skyarm("show", "hexarotor_arm6", columns=columns).out
    assert "  4 kg" in text
    assert "  11.5, 0, -94.8" in text
