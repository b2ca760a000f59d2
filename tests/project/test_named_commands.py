"""What the library, its pages and examples call a command is one."""

from __future__ import annotations

import re
from pathlib import Path

from skyarm.cli.commands import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(
        ROOT / name
        for name in (
            "README.md",
            "CONTRIBUTING.md",
            "SECURITY.md",
            "Makefile",
            "mkdocs.yml",
        )
    ),
    *(
        each
        for room in ("docs", "examples", "src")
        for each in sorted((ROOT / room).rglob("*"))
    ),
]
SUFFIXES = {"", ".py", ".md", ".toml", ".txt", ".js", ".html", ".yml"}
NAMED = re.compile(rb"skyarm ([a-z][a-z-]+)")
CODE = re.compile(rb"```.*?```|`[^`]+`", re.S)
NO_COMMANDS = {
    "import",
    "from",
    "and",
    "checks",
    "developers",
    "example",
    "weigh",
    "holds",
    "itself",
    "printed",
    "program",
    "simulates",
    "starts",
    "transcript",
    "reads",
    "writes",
    "wrote",
}
"""Words after the name of the library, of Python or of a sentence, that are no
commands."""


def code_of(path: Path) -> bytes:
    """Text of a file in which commands stand; of a page its code only, since a sentence
    may begin with the name.
    """
    text = path.read_bytes()
    return b"\n".join(CODE.findall(text)) if path.suffix == ".md" else text


def test_every_command_that_is_named_exists() -> None:
    named: dict[str, str] = {}
    for path in PAGES:
        if path.is_file() and path.suffix in SUFFIXES:
            for word in NAMED.findall(code_of(path)):
                named.setdefault(word.decode(), str(path.relative_to(ROOT)))
    assert set(COMMANDS) <= set(named)
    assert {
        word: path
        for word, path in named.items()
        if word not in {*COMMANDS, *NO_COMMANDS}
    } == {}
