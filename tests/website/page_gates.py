"""What can be counted of a page's prose: a report of sentences, cells, tables and
commands that a reader stumbles over.

    python tests/website/page_gates.py                       every page of docs and the
                                                             README
    python tests/website/page_gates.py docs/pressing.md      one page, each fault with
                                                             its line

The reader is the judge; this only counts what tires a reader's eye. Blocks that a
script writes are passed over.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
GLOSSARY = DOCS / "glossary.md"

WORDS = 30
"""Most words of a sentence."""
NUMBERS = 3
"""Numbers from which a sentence has too many, outside pages of results."""
CELL = 120
"""Most letters of a table's cell."""
SHELL = ("sh", "bash", "console", "shell")
OUTPUT = ("text", "output", "")
RESULTS = (
    "results",
    "performance",
    "the_paper",
    "mathematics",
    "centroidal_law_specification",
)
"""Beginnings of the names of pages whose sentences may carry numbers."""

GENERATED = re.compile(r"<!-- generated: .*?<!-- /generated.*?-->", re.S)
MEASURED = re.compile(
    r"^skyarm [^`]*?, (?:`[^`]+`|no command)\.\n(?=<!-- /measured -->)", re.M
)
"""Last line of a measured block: version, machine and command."""
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
CODE = re.compile(r"`[^`]*`")
NUMBER = re.compile(r"(?<![\w.#])[-+±]?\d[\d.,]*(?:e[-+]?\d+)?(?![\w.])")
SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-Z`*\[(])")
ABBREVIATION = re.compile(r"\b(?:e\.g|i\.e|et al|vs|cf|Fig|Eq|Eqs|No|Sec|approx)\.")
HEADING = re.compile(r"#{1,6} ")
RULE = re.compile(r"\|?[\s:|-]+\|?$")
ANCHOR = re.compile(r"(?:<a id=\"([\w-]+)\"></a>|^#+ +(.+)$)", re.M)
COMMON = {
    "data",
    "window",
    "trial",
    "model",
    "memory",
    "age",
    "lag",
    "wind",
    "success",
    "status",
    "draws",
    "base",
    "part",
}
"""Glossary words that also are plain English: a first use may be the plain one."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One place that a reader stumbles over."""

    line: int
    kind: str
    text: str


@dataclass(frozen=True, kw_only=True)
class Block:
    """Consecutive lines of one kind: prose, a table or code."""

    kind: str
    line: int
    lines: list[str]
    language: str = ""


def blocks_of(text: str) -> list[Block]:
    """Cut a page into prose, lists, headings, tables and code; what a script writes is
    emptied first.
    """
    text = GENERATED.sub(lambda found: "\n" * found[0].count("\n"), text)
    text = MEASURED.sub(lambda found: "\n" * found[0].count("\n"), text)
    text = re.sub(
        r"<!--.*?-->", lambda found: "\n" * found[0].count("\n"), text, flags=re.S
    )
    found: list[Block] = []
    lines, row = text.splitlines(), 0
    while row < len(lines):
        line = lines[row]
        bare = re.sub(r"^(?:> ?)+", "", line).strip()
        begin = row
        if fence := re.match(r"(?:> ?)*\s*(`{3,}|~{3,})\s*([\w-]*)", line):
            row += 1
            while row < len(lines) and not re.match(
                rf"(?:> ?)*\s*{fence[1]}", lines[row]
            ):
                row += 1
            found.append(
                Block(
                    kind="code",
                    line=begin + 1,
                    lines=lines[begin + 1 : row],
                    language=fence[2],
                )
            )
            row += 1
        elif bare.startswith("|"):
            while row < len(lines) and re.sub(
                r"^(?:> ?)+", "", lines[row]
            ).strip().startswith("|"):
                row += 1
            found.append(
                Block(
                    kind="table",
                    line=begin + 1,
                    lines=[each.strip() for each in lines[begin:row]],
                )
            )
        elif not bare or HEADING.match(bare):
            kind = "heading" if bare else "empty"
            found.append(Block(kind=kind, line=begin + 1, lines=[bare]))
            row += 1
        elif line.startswith("    ") and (
            not found or found[-1].kind in ("empty", "code")
        ):
            while row < len(lines) and (
                lines[row].startswith("    ") or not lines[row].strip()
            ):
                row += 1
            found.append(
                Block(
                    kind="code",
                    line=begin + 1,
                    lines=lines[begin:row],
                    language="indented",
                )
            )
        else:
            parts = [re.sub(r"^(?:[*+-]|\d+\.) +", "", bare)]
            row += 1
            while row < len(lines):
                after = re.sub(r"^(?:> ?)+", "", lines[row]).strip()
                if not after or re.match(
                    r"(?:[*+-]|\d+\.) |`{3}|~{3}|\||#{1,6} ", after
                ):
                    break
                parts.append(after)
                row += 1
            found.append(Block(kind="prose", line=begin + 1, lines=parts))
    return [block for block in found if block.kind != "empty"]


def sentences(block: Block) -> list[str]:
    """Sentences of a block of prose, links by their words and code as one word."""
    text = LINK.sub(lambda link: link[1], " ".join(block.lines))
    text = CODE.sub("CODE", text)
    text = re.sub(r"\$[^$]*\$", "SYMBOL", text)
    text = ABBREVIATION.sub(lambda found: found[0].replace(".", ""), text)
    return [
        each.strip()
        for each in SENTENCE.split(text)
        if each.strip() and not each.startswith("[!")
    ]


def cells(row: str) -> list[str]:
    """Cells of a row of a table; a bar in code or behind a backslash does not part
    them.
    """
    hidden = CODE.sub(lambda code: code[0].replace("|", "\0"), row.replace("\\|", "\0"))
    return [
        each.strip().replace("\0", "|") for each in hidden.strip().strip("|").split("|")
    ]


@cache
def glossary() -> dict[str, str]:
    """Anchor of each word of the glossary; no word while there is no page."""
    if not GLOSSARY.is_file():
        return {}
    found = {}
    for anchor, heading in ANCHOR.findall(GLOSSARY.read_text("utf-8")):
        name = anchor or re.sub(r"[^\w -]", "", heading).strip().lower().replace(
            " ", "-"
        )
        word = name.replace("-", " ")
        if (
            len(word) > 2
            and word not in COMMON
            and "glossary" not in word
            and not re.search(r"\d", word)
        ):
            found[word] = name
    return found


def unlinked(text: str) -> list[Fault]:
    """Words of the glossary that a page uses and links nowhere."""
    prose = " ".join(
        " ".join(block.lines)
        for block in blocks_of(text)
        if block.kind in ("prose", "table")
    )
    plain = CODE.sub("", LINK.sub(" ", prose))
    wrong = []
    for word, anchor in glossary().items():
        if f"glossary.md#{anchor}" not in text and re.search(
            rf"\b{re.escape(word)}s?\b", plain
        ):
            wrong.append(Fault(line=0, kind="not linked", text=word))
    return wrong


def faults(page: Path) -> list[Fault]:
    """Faults of one page in the order of its lines."""
    text = page.read_text("utf-8")
    blocks = blocks_of(text)
    numbers = not page.name.startswith(RESULTS)
    found = (
        []
        if page.name in ("glossary.md", "README.md", "decisions.md")
        else unlinked(text)
    )
    for at, block in enumerate(blocks):
        if block.kind == "prose":
            for sentence in sentences(block):
                count = len(sentence.split())
                if count > WORDS:
                    found.append(
                        Fault(line=block.line, kind=f"{count} words", text=sentence)
                    )
                many = len(NUMBER.findall(sentence))
                if numbers and many >= NUMBERS:
                    found.append(
                        Fault(line=block.line, kind=f"{many} numbers", text=sentence)
                    )
        elif block.kind == "table":
            headed = len(block.lines) > 1 and RULE.match(block.lines[1]) is not None
            if not headed or not any(cells(block.lines[0])):
                found.append(
                    Fault(
                        line=block.line, kind="table without heads", text=block.lines[0]
                    )
                )
            for row in block.lines[2:]:
                for cell in cells(row):
                    shown = LINK.sub(lambda link: link[1], cell)
                    if len(shown) > CELL:
                        found.append(
                            Fault(
                                line=block.line,
                                kind=f"cell of {len(shown)} letters",
                                text=shown,
                            )
                        )
        elif block.kind == "code" and block.language in SHELL:
            after = blocks[at + 1] if at + 1 < len(blocks) else None
            shown = after is not None and after.kind in ("code", "prose", "table")
            if not shown:
                found.append(
                    Fault(
                        line=block.line,
                        kind="command without output or a reason",
                        text=block.lines[0],
                    )
                )
    return sorted(found, key=lambda fault: fault.line)


def main() -> int:
    """Print the faults of the pages that are named, or one line a page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pages", nargs="*", type=Path)
    given = parser.parse_args()
    for page in given.pages or [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]:
        found = faults(page)
        print(f"{page}: {len(found)} faults")
        for fault in found if given.pages else ():
            print(f"  {fault.line:4} {fault.kind}: {fault.text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
