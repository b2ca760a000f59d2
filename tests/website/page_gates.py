"""What can be counted of a page: long paragraphs, cells, tables and commands that a
reader stumbles over, and facts that stand on another page, too.

    python tests/website/page_gates.py                       every page of docs and the
                                                             README
    python tests/website/page_gates.py docs/pressing.md      one page, each fault with
                                                             its line

The reader is the judge; this only counts. Blocks that a script writes are passed over.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

WORDS = 90
"""Most words of a paragraph or an item of a list."""
CELL = 120
"""Most letters of a table's cell."""
SHELL = ("sh", "bash", "console", "shell")
OUTPUT = ("text", "output", "")
LINKED = (
    "tip",
    "scenario",
    "plant",
    "preset",
    "level base",
    "episode",
    "lane",
    "suite",
)
"""Words that mean something of their own here: a page links them to the glossary or
says in italics what they are. Others of its words also are plain English.
"""

DOORS = ("glossary.md", "README.md", "CONTRIBUTING.md")
"""Pages that link no word: the glossary, and those read before it."""

GENERATED = re.compile(r"<!-- generated: .*?<!-- /generated.*?-->", re.S)
WRITTEN = re.compile(r"<!-- (generated|measured): .*?<!-- /\1.*?-->", re.S)
"""What a script writes."""
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
CODE = re.compile(r"`[^`]*`")
SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-Z`*\[(])")
ABBREVIATION = re.compile(r"\b(?:e\.g|i\.e|et al|vs|cf|Fig|Eq|Eqs|No|Sec|approx)\.")
HEADING = re.compile(r"#{1,6} ")
RULE = re.compile(r"\|?[\s:|-]+\|?$")


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
    text = WRITTEN.sub(lambda found: "\n" * found[0].count("\n"), text)
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


def sentences(block: Block, *, code: bool = False) -> list[str]:
    """Sentences of a block of prose, links by their words; code as one word, or as it
    is.
    """
    text = LINK.sub(lambda link: link[1], " ".join(block.lines))
    text = text if code else CODE.sub("CODE", text)
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


def unexplained(text: str) -> list[Fault]:
    """Words of its own that a page uses, neither linked nor explained."""
    prose = " ".join(
        " ".join(block.lines)
        for block in blocks_of(text)
        if block.kind in ("prose", "table")
    )
    plain = CODE.sub("", LINK.sub(" ", prose))
    return [
        Fault(line=0, kind="not explained", text=word)
        for word in LINKED
        if f"glossary.md#{word.replace(' ', '-')}" not in text
        and not re.search(rf"(?<!\*)\*{word}s?\*(?!\*)", text, re.IGNORECASE)
        and re.search(rf"\b{word}s?\b", plain)
    ]


def faults(page: Path) -> list[Fault]:
    """Faults of one page in the order of its lines."""
    text = page.read_text("utf-8")
    blocks = blocks_of(text)
    found = [] if page.name in DOORS else unexplained(text)
    for at, block in enumerate(blocks):
        if block.kind == "prose":
            count = sum(len(each.split()) for each in sentences(block))
            if count > WORDS:
                found.append(
                    Fault(
                        line=block.line,
                        kind=f"paragraph of {count} words",
                        text=" ".join(block.lines)[:CELL],
                    )
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
    import page_twins

    facts = page_twins.facts(page_twins.pages())
    for page in given.pages or [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]:
        found = faults(page)
        name = page_twins.name_of(page)
        two = [fact for fact in facts if name in fact.pages]
        print(f"{page}: {len(found)} faults, {len(two)} facts that stand twice")
        for fault in found if given.pages else ():
            print(f"  {fault.line:4} {fault.kind}: {fault.text}")
        for fact in two if given.pages else ():
            print(fact.lines())
    return 0


if __name__ == "__main__":
    sys.exit(main())
