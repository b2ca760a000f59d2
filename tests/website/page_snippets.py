"""What a page shows as code, and how it is run: block after block, in one namespace and one folder.

A fence is ``python`` (run), ``sh`` (commands, run), ``bash`` (a script for other machines: its syntax is checked), a
file (any language with a title: written), or ``text``: lines that the last block printed, in their order, to the digit.
A comment behind a ``print`` of the outermost level is the line that it prints. ``<!-- varies: REASON -->`` before a
fence leaves its numbers out of the comparison, ``<!-- not printed: REASON -->`` the whole fence.
"""

from __future__ import annotations

import ast
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
FENCE = re.compile(
    r"(?:^<!-- (varies|not printed): \S[^\n]* -->\n)?^```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)^```$", re.M | re.S
)
INDENTED = re.compile(r"(?:\A|\n\n)((?:    \S.*\n?)+)")

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
    """A fence of a page; ``mark``: "varies", "not printed" or nothing."""

    language: str
    title: str
    text: str
    mark: str = ""


@dataclass
class Ran:
    """Names that a page's blocks left, output of the last one, lines shown that were not printed with the printed ones."""

    names: dict[str, Any] = field(default_factory=dict)
    printed: str = ""
    blocks: int = 0
    commands: int = 0
    answers: list[tuple[str, str]] = field(default_factory=list)


def blocks(text: str) -> list[Block]:
    """Fences of a page, but for formulas."""
    found = [Block(language, title, body, mark) for mark, language, title, body in FENCE.findall(text)]
    return [block for block in found if block.language != "math"]


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


NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")


def masked(text: str) -> str:
    """Words of a text, without the size of its blanks and its numbers."""
    return " ".join(NUMBER.sub("#", text).split())


def wrong_answers(shown: str, printed: str, mark: str = "") -> list[tuple[str, str]]:
    """Lines shown that were not printed, each with the printed line of the same words; "" where there is none.

    Lines are compared word by word, in their order.
    """
    if mark == "not printed":
        return []
    key = masked if mark == "varies" else lambda line: " ".join(line.split())
    lines, at, wrong = printed.splitlines(), 0, []
    for line in filter(str.strip, shown.splitlines()):
        same = [i for i in range(at, len(lines)) if key(lines[i]) == key(line)]
        near = same or [i for i in range(at, len(lines)) if masked(lines[i]) == masked(line)]
        if not same:
            wrong.append((line, lines[near[0]].rstrip() if near else ""))
        at = near[0] + 1 if near else at
    return wrong


def run_python(text: str, ran: Ran) -> None:
    """Run a block statement by statement; compare comments behind its prints with what they print."""
    source, told = text.splitlines(), io.StringIO()
    for node in ast.parse(text).body:
        before = len(told.getvalue())
        with contextlib.redirect_stdout(told):
            exec(compile(ast.Module([node], []), "page", "exec"), ran.names)
        code, mark, shown = source[(node.end_lineno or 1) - 1].partition("  # ")
        if mark and code.startswith("print("):
            ran.answers += wrong_answers(shown, told.getvalue()[before:])
    ran.printed = told.getvalue()


def run_page(page: list[Block], ran: Ran, *, seconds: float | None) -> None:
    """Run a page's blocks in this folder; ``ran.answers`` has what they print otherwise than shown.

    Raises:
        AssertionError: a command that ends with another exit code than 0, a file that nothing uses.
    """
    for i, block in enumerate(page):
        later = "\n".join(each.text for each in page[i + 1 :])
        if block.title:
            stem = block.title.rpartition(".")[0]
            assert block.title in later or re.search(rf"\b{stem}\b", later), f"{block.title}: nothing uses this file"
            Path(block.title).write_text(block.text, "utf-8")
        elif block.language == "python":
            run_python(block.text, ran)
            ran.blocks += 1
        elif block.language == "sh":
            ran.printed, ran.blocks = "", ran.blocks + 1
            shown = page[i + 1].language == "text" if i + 1 < len(page) else False
            for line in commands(block):
                ran.commands += 1
                if line.startswith("skyarm "):
                    code, told = run_command(words_of(line, seconds=None if shown else seconds))
                    assert code == 0, f"{line}: {told[-800:]}"
                    ran.printed += told
                else:
                    assert line.startswith(KNOWN_ELSEWHERE), f"{line}: nobody runs this"
        elif block.language == "bash":
            done = subprocess.run(["bash", "-n"], input=block.text, text=True, capture_output=True, check=False)
            assert done.returncode == 0, done.stderr
            ran.blocks += 1
        elif block.language == "text":
            ran.answers += wrong_answers(block.text, ran.printed, block.mark)
