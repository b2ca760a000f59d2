"""What the library, its pages and examples call a command is one."""

from __future__ import annotations

import re
from pathlib import Path

from skyarm.cli.commands import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "Makefile", "mkdocs.yml")),
    *(each for room in ("docs", "examples", "src") for each in sorted((ROOT / room).rglob("*"))),
]
SUFFIXES = {"", ".py", ".md", ".toml", ".txt", ".js", ".html", ".yml"}
NAMED = re.compile(rb"skyarm ([a-z][a-z-]+)")
NO_COMMANDS = {
    *("import", "from"),  # of Python
    *(
        "and",
        "example",
        "holds",
        "itself",
        "printed",
        "program",
        "simulates",
        "starts",
        "transcript",
        "writes",
        "wrote",
    ),
}
"""Words of a sentence after the name of the library."""


def test_every_command_that_is_named_exists() -> None:
    named: dict[str, str] = {}
    for path in PAGES:
        if path.is_file() and path.suffix in SUFFIXES:
            for word in NAMED.findall(path.read_bytes()):
                named.setdefault(word.decode(), str(path.relative_to(ROOT)))
    assert set(COMMANDS) <= set(named)
    assert {word: path for word, path in named.items() if word not in {*COMMANDS, *NO_COMMANDS}} == {}
