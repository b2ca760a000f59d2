"""What a page shows as code, and how it is run: block after block, in one namespace and one folder.

A fence is ``python`` (run), ``sh`` (commands, run), ``bash`` (a script for other machines: its syntax is looked at), a
file (any language with a title: written), or ``text`` after a block that was run: its lines must have been printed.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FENCE = re.compile(r"^```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)^```$", re.M | re.S)
INDENTED = re.compile(r"(?:\A|\n\n)((?:    \S.*\n?)+)")
RUN = ("python", "sh")

HELP_ONLY = (
    "skyarm reproduce",
    "skyarm bench",
    "skyarm sweep robustness",
    "skyarm stats out/robustness",
    "skyarm compare paper-suite",
    "skyarm compare flight.toml",
    "skyarm compare envelope-suite",
    "skyarm compare contact-suite",
    "skyarm sweep my_study.toml",
)
"""Commands that take a minute or need other machines: they have tests of their own, here their help is asked for."""

KNOWN_ELSEWHERE = ("python -m pip install",)
"""Lines of other programs: `make fresh` and `make test` install."""


@dataclass(frozen=True)
class Block:
    """A fence of a page."""

    language: str
    title: str
    text: str


@dataclass
class Ran:
    """What came of a page's blocks: how many ran, what the last of them printed."""

    names: dict[str, Any] = field(default_factory=dict)
    printed: str = ""
    blocks: int = 0
    commands: int = 0
    compared: int = 0


def blocks(text: str) -> list[Block]:
    """Fences of a page, but for formulas."""
    return [Block(*found) for found in FENCE.findall(text) if found[0] != "math"]


def indented(text: str) -> list[str]:
    """Lines that are shown as code by indenting them, which no test would see."""
    outside = re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)
    found = [line for block in INDENTED.findall(outside) for line in block.splitlines()]
    return [line.strip() for line in found if not re.match(r"\s+([*-]|\d+\.) ", line)]


def commands(block: Block) -> list[str]:
    """Commands of a fence of shell, comments taken off."""
    return [line for line in (re.sub(r"(^|\s)#.*$", "", each).strip() for each in block.text.splitlines()) if line]


def words_of(line: str, *, seconds: float | None) -> list[str]:
    """Words after ``skyarm`` of a command; a flight whose result is not compared is cut short."""
    words = shlex.split(line)[1:]
    if line.startswith(HELP_ONLY):
        return [words[0], "--help"] if words[-1] != "--help" else words
    if seconds is not None and words[0] == "run" and "--duration" not in words:
        words += ["--duration", f"{seconds:g}"]
    return words


def run_command(words: list[str]) -> tuple[int, str]:
    """Exit code and output of ``skyarm WORDS``, in this process."""
    from added_components import registry_kept
    from skyarm.cli.commands import perform

    told, before = io.StringIO(), sys.argv
    sys.argv = ["skyarm", *words]
    try:
        with registry_kept(), contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
            code = perform()
    except SystemExit as ended:
        code = int(ended.code or 0)
    finally:
        sys.argv = before
    return code, told.getvalue()


def plain(text: str) -> str:
    """Text with blanks of any number as one."""
    return " ".join(text.split())


def run_page(page: list[Block], ran: Ran, *, seconds: float | None) -> None:
    """Run a page's blocks in this folder.

    Raises:
        AssertionError: a command that ends with another exit code than 0, output that is not what the page shows, a
            file that nothing uses.
    """
    for i, block in enumerate(page):
        later = "\n".join(each.text for each in page[i + 1 :])
        if block.title:
            stem = block.title.rpartition(".")[0]
            assert block.title in later or re.search(rf"\b{stem}\b", later), f"{block.title}: nothing uses this file"
            Path(block.title).write_text(block.text, "utf-8")
        elif block.language == "python":
            told = io.StringIO()
            with contextlib.redirect_stdout(told):
                exec(compile(block.text, "page", "exec"), ran.names)
            ran.printed, ran.blocks = told.getvalue(), ran.blocks + 1
        elif block.language == "sh":
            ran.printed, ran.blocks = "", ran.blocks + 1
            shown = page[i + 1].language == "text" if i + 1 < len(page) else False
            for line in commands(block):
                ran.commands += 1
                if line.startswith("skyarm "):
                    code, told_ = run_command(words_of(line, seconds=None if shown else seconds))
                    assert code == 0, f"{line}: {told_[-800:]}"
                    ran.printed += told_
                else:
                    assert line.startswith(KNOWN_ELSEWHERE), f"{line}: nobody runs this"
        elif block.language == "bash":
            done = subprocess.run(["bash", "-n"], input=block.text, text=True, capture_output=True, check=False)
            assert done.returncode == 0, done.stderr
            ran.blocks += 1
        elif block.language == "text" and i and page[i - 1].language in RUN:
            for line in block.text.splitlines():
                assert plain(line) in plain(ran.printed), f"'{line}' was not printed, but: {ran.printed[-800:]}"
            ran.compared += 1
