"""What a page shows as code, and how it is run: block after block, in one namespace and
one folder.

A fence is ``python`` (run), ``sh`` (commands, run), ``bash`` (a script for other
machines: its syntax is checked), a file (any language with a title: written), or
``text``: lines that the last block printed, in their order, to the digit. A comment
behind a ``print`` of the outermost level is the line that it prints. ``<!-- varies:
REASON -->`` before a fence leaves its numbers out of the comparison, ``<!-- not
printed: REASON -->`` the whole fence.
"""

from __future__ import annotations

import ast
import contextlib
import io
import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shown_commands import run_shown

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FENCE = re.compile(
    r"(?:^<!-- (varies|not printed): \S[^\n]* -->\n)?^```(\w+)(?:"
    r" title=\"([^\"]+)\")?\n(.*?)^```$",
    re.M | re.S,
)
INDENTED = re.compile(r"(?:\A|\n\n)((?:    \S.*\n?)+)")

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
    """Names that a page's blocks left, output of the last one, and lines shown with
    those printed in their place.
    """

    names: dict[str, Any] = field(default_factory=dict)
    printed: str = ""
    blocks: int = 0
    commands: int = 0
    answers: list[tuple[str, str]] = field(default_factory=list)


def blocks(text: str) -> list[Block]:
    """Fences of a page, but for formulas."""
    found = [
        Block(language, title, body, mark)
        for mark, language, title, body in FENCE.findall(text)
    ]
    return [block for block in found if block.language != "math"]


def indented(text: str) -> list[str]:
    """Lines that are shown as code by indenting them, which no test would see."""
    outside = re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)
    found = [line for block in INDENTED.findall(outside) for line in block.splitlines()]
    return [line.strip() for line in found if not re.match(r"\s+([*-]|\d+\.) ", line)]


def commands(block: Block) -> list[str]:
    """Commands of a fence of shell, comments taken off."""
    return [
        line
        for line in (
            re.sub(r"(^|\s)#.*$", "", each).strip() for each in block.text.splitlines()
        )
        if line
    ]


NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")


def masked(text: str) -> str:
    """Words of a text, without the size of its blanks and its numbers."""
    return " ".join(NUMBER.sub("#", text).split())


def wrong_answers(shown: str, printed: str, mark: str = "") -> list[tuple[str, str]]:
    """Lines shown that were not printed, each with the printed line of the same words;
    "" where there is none.

    Lines are compared word by word, in their order; "..." stands for any number of
    lines.
    """
    if mark == "not printed":
        return []
    key = masked if mark == "varies" else lambda line: " ".join(line.split())
    lines, at, wrong = printed.splitlines(), 0, []
    for line in shown.splitlines():
        if line.strip() in ("", "..."):
            continue
        same = [i for i in range(at, len(lines)) if key(lines[i]) == key(line)]
        near = same or [
            i for i in range(at, len(lines)) if masked(lines[i]) == masked(line)
        ]
        if not same:
            wrong.append((line, lines[near[0]].rstrip() if near else ""))
        at = near[0] + 1 if near else at
    return wrong


def rewritten(page: str, answers: list[tuple[str, str]]) -> str:
    """A page with the lines that were printed in place of those shown; answers are in
    the page's order.

    Raises:
        AssertionError: a line for which no line of the same words was printed: a person
            must write it.
    """
    at = 0
    for shown, printed in answers:
        assert printed, f"nothing like this was printed: {shown}"
        at = page.index(shown, at)
        page = page[:at] + printed + page[at + len(shown) :]
        at += len(printed)
    return page


def run_python(text: str, ran: Ran) -> None:
    """Run a block statement by statement; compare comments behind its prints with what
    they print.
    """
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
    """Run a page's blocks in this folder; ``ran.answers`` has what they print otherwise
    than shown.

    Raises:
        AssertionError: a command that ends with another exit code than 0, a file that
            nothing uses.
    """
    for i, block in enumerate(page):
        later = "\n".join(each.text for each in page[i + 1 :])
        if block.title:
            stem = block.title.rpartition(".")[0]
            assert block.title in later or re.search(rf"\b{stem}\b", later), (
                f"{block.title}: nothing uses this file"
            )
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
                    cut = (
                        seconds is not None
                        and not shown
                        and line.startswith("skyarm run ")
                    )
                    code, told = run_shown(
                        f"{line} --duration {seconds:g}" if cut else line
                    )
                    assert code == 0, f"{line}: {told[-800:]}"
                    ran.printed += told
                else:
                    assert line.startswith(KNOWN_ELSEWHERE), f"{line}: nobody runs this"
        elif block.language == "bash":
            done = subprocess.run(
                ["bash", "-n"],
                input=block.text,
                text=True,
                capture_output=True,
                check=False,
            )
            assert done.returncode == 0, done.stderr
            ran.blocks += 1
        elif block.language == "text":
            ran.answers += wrong_answers(block.text, ran.printed, block.mark)
