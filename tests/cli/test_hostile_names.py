"""Names from files and of files are text on a terminal: no command lets a control
character through.
"""

from __future__ import annotations

import ast
import contextlib
import io
import re
import sys
from pathlib import Path

import pytest
from command_files import CASE1, VEHICLE, changed
from rich.console import Group
from rich.table import Table
from rich.text import Text

import skyarm.cli
from skyarm.cli import output
from skyarm.cli.lines import say, say_warning
from skyarm.cli.main import main
from skyarm.cli.output import Terminal, bar
from support.commands import Outcome

EVIL = "\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\u202eevil\u2066\u2069\u2028\u0085\r"
"""A title set, a screen cleared (C0 and C1), a reversal, line separators, a line begun
anew."""

TOML = (
    EVIL.encode("unicode_escape")
    .decode()
    .replace("\\x", "\\u00")
    .replace("\\r", "\\u000d")
)

FORBIDDEN = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.toml").write_text(
        changed(VEHICLE, 'name = "hummingbird_arm2_rotors"', f'name = "{TOML}"')
        .replace('name = "tip"', f'name = "tip{TOML}"')
        .replace('end_effector = "tip"', f'end_effector = "tip{TOML}"')
        .replace('name = "front"', f'name = "front{TOML}"'),
        "utf-8",
    )
    flight = changed(CASE1, 'title = "', f'title = "{TOML}')
    (tmp_path / "flight.toml").write_text(
        flight.replace(
            'vehicle = "hummingbird_arm2_rotors"', 'vehicle = "evil.toml"'
        ).replace('vehicle = "hummingbird_arm2"', 'vehicle = "evil.toml"'),
        "utf-8",
    )
    return tmp_path


def terminal(*arguments: str) -> Outcome:
    """A command whose standard output and error are what a terminal would be sent,
    styles left out.
    """
    out, err, before = io.StringIO(newline=""), io.StringIO(newline=""), sys.argv
    sys.argv = ["skyarm", *arguments]
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            pytest.raises(SystemExit) as stop,
        ):
            main()
    finally:
        sys.argv = before
    return Outcome(int(stop.value.code or 0), out.getvalue(), err.getvalue())


def inert(outcome: Outcome) -> str:
    """All that was written, once nothing in it is a command."""
    for text in (outcome.out, outcome.err):
        assert not FORBIDDEN.search(text), ascii(text)
    assert "Traceback" not in outcome.err
    return outcome.out + outcome.err


COMMANDS: list[tuple[str, ...]] = [
    ("show", "evil.toml"),
    ("run", "flight.toml", "--duration", "0.02", "--out", "out"),
    ("export", "paper_ct", "--to", "c", "--vehicle", "evil.toml", "--out", "law.c"),
    ("export", "flight.toml", "--to", "c", "--out", "law.c"),
    ("margins", "flight.toml", "--instants", "0", "--out", f"{EVIL}.json"),
]


@pytest.mark.parametrize(
    "words", COMMANDS, ids=[" ".join(words[:2]) for words in COMMANDS]
)
def test_a_command_writes_names_as_text(words: tuple[str, ...], folder: Path) -> None:
    outcome = terminal(*words)
    assert outcome.code in (0, 3), outcome
    assert inert(outcome)


def test_the_names_are_there_written_out(folder: Path) -> None:
    written = r"\x1b[2J\x9b31m\x7f\u202eevil\u2066\u2069\u2028"
    export = terminal(
        "export", "paper_ct", "--to", "c", "--vehicle", "evil.toml", "--out", "law.c"
    )
    assert written in inert(export)
    assert written in inert(terminal("show", "evil.toml")).replace("\n", "").replace(
        " ", ""
    )
    assert not FORBIDDEN.search((folder / "law.c").read_text("utf-8"))


REFUSED: list[tuple[str, ...]] = [
    (EVIL,),
    ("show", EVIL),
    ("show", f"{EVIL}.toml"),
    ("run", f"{EVIL}.toml"),
    ("run", "case1", "--laws", EVIL),
    ("run", "case1", "--plant", EVIL),
    ("sweep", f"{EVIL}.toml"),
    ("margins", "case1", "--laws", EVIL),
    ("compare", EVIL),
    ("compare", "--laws", EVIL),
    ("reproduce", "--plant", EVIL),
    ("export", EVIL, "--to", "c", "--out", "x.c"),
    (
        "export",
        "paper_ct",
        "--to",
        "c",
        "--vehicle",
        "evil.toml",
        "--name",
        EVIL,
        "--out",
        "x.c",
    ),
    ("doctor", EVIL),
]


@pytest.mark.parametrize(
    "words", REFUSED, ids=[ascii(" ".join(words))[:40] for words in REFUSED]
)
def test_a_refusal_shows_what_it_refuses_as_text(
    words: tuple[str, ...], folder: Path
) -> None:
    (folder / "taken").write_text("")
    outcome = terminal(*words)
    assert outcome.code == 2, outcome
    assert inert(outcome).startswith("skyarm: ")
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("name", ["vehicle", "flight", "study"])
def test_a_wrong_file_of_a_hostile_name_is_refused_as_text(
    name: str, folder: Path
) -> None:
    path = folder / f"{EVIL}.toml"
    path.write_text(f'schema = 1\nname = "x"\n"{TOML}" = "{TOML}"\n', "utf-8")
    outcome = terminal(
        {"vehicle": "show", "flight": "run", "study": "sweep"}[name], str(path)
    )
    assert outcome.code == 2
    assert inert(outcome).count("\n") == 1


@pytest.mark.parametrize("styled", [False, True])
def test_whatever_the_console_prints_is_text(
    styled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = io.StringIO(newline="")
    console = Terminal(
        file=stream, force_terminal=styled, width=200, markup=False, highlight=False
    )
    table = Table(EVIL, title=EVIL)
    table.add_row(Text(EVIL), EVIL)
    console.print(EVIL)
    console.print(EVIL, soft_wrap=True)
    console.print(Text(EVIL, style="bold"), Group(table, EVIL))
    console.print(f"one\ntwo {EVIL}", soft_wrap=True)
    monkeypatch.setattr(output, "console", console)
    with bar(EVIL, pause=0.0) as advance:
        advance(1, 2, EVIL)
    sent = (
        re.sub("\x1b\\[(?:[0-9;]*m|[0-9]*[AKGH]|2K|\\?25[lh])", "", stream.getvalue())
        if styled
        else stream.getvalue()
    )
    assert "evil" in sent
    assert not FORBIDDEN.search(sent.replace("\r", "") if styled else sent), ascii(sent)
    assert "one\ntwo" in sent


def test_lines_and_warnings_on_standard_error_are_text(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert say(f"a\n{EVIL}", 7) == 7
    say_warning(f"b {EVIL}", RuntimeWarning, "file.py", 3)
    told = capsys.readouterr().err
    assert not FORBIDDEN.search(told)
    assert told.count("\n") == 2
    assert told.splitlines()[1].startswith("skyarm: warning: b ")


def test_no_command_has_another_way_to_the_terminal() -> None:
    """Commands print on the console of the house or say a line; that and the JSON
    document alone write to a stream.
    """
    found = []
    for path in sorted(Path(skyarm.cli.__file__).parent.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                if called in (
                    "print",
                    "typer.echo",
                    "typer.secho",
                    "Console",
                ) or called.endswith((".write", ".out")):
                    found.append(f"{path.name}: {called}")
    # the document is ASCII; pictures are written into a folder
    assert found == [
        "lines.py: print",
        "output.py: sys.stdout.write",
        "sweep_command.py: pictures.write",
    ]
