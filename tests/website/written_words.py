"""Count the words of the pages that somebody wrote: prose, tables by hand, code.

    python tests/website/written_words.py              every page, the longest first

Generated and measured blocks are not counted; a word has a letter or a digit.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

BLOCK = re.compile(
    r"^<!-- (generated|measured): [^\n]* -->\n.*?^<!-- /\1[^\n]*-->$", re.M | re.S
)
LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\[\]]*\])*\])\([^)\s]*\)")
COMMENT = re.compile(r"<!--.*?-->", re.S)


def words(text: str) -> int:
    """Number of written words of a page."""
    text = COMMENT.sub("", BLOCK.sub("", text))
    return sum(
        bool(re.search(r"[^\W_]", word)) for word in LINK.sub(r"\1", text).split()
    )


def counts() -> dict[str, int]:
    """Number of written words by page, from the root of the repository."""
    pages = [
        *sorted(DOCS.rglob("*.md")),
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    ]
    return {
        path.relative_to(ROOT).as_posix(): words(path.read_text("utf-8"))
        for path in pages
    }


def main() -> None:
    """Print the count of every page and their sum."""
    found = counts()
    for name, count in sorted(found.items(), key=lambda row: -row[1]):
        print(f"{count:7} {name}")
    print(f"{sum(found.values()):7} in {len(found)} pages")


if __name__ == "__main__":
    main()
