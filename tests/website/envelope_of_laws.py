"""The envelope in docs/comparing_laws.md: table, weakest points of the flagship and picture, from a folder.

python tests/website/envelope_of_laws.py out/envelope    writes the block into docs/comparing_laws.md
and docs/images/envelope.png
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from envelope_rules import FLAGSHIP, violation_rows, violations
from PIL import Image

from skyarm.studies.compare.envelope import summary_head, summary_rows
from skyarm.view.pages import markdown

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"<!-- the envelope: make envelope -->\n(.*?)<!-- /the envelope -->", re.S)
LEFT_OUT = ("paper_pd", "l1_adaptive")
"""Laws that the figure shows and the page's table has no room for."""
PAGE = "docs/comparing_laws.md"
PICTURE = "docs/images/envelope.png"


def block(found: Mapping[str, Any]) -> str:
    """What stands between the marks of the page, from the content of ``envelope.json``."""
    laws, axes = [law for law in found["laws"] if law not in LEFT_OUT], found["axes"]
    weakest = ", ".join(words_of(row) for row in violation_rows(violations(axes, FLAGSHIP))) or "none"
    return (
        f"{markdown(summary_head(laws), summary_rows(axes, laws))}\n\n"
        f"Weakest points of `{FLAGSHIP}` (lost where another law is not, or over 10 % worse than the paper's law): "
        f"{weakest}.\n"
    )


def words_of(row: list[str]) -> str:
    """A violation: its trial, and which rule."""
    return f"{row[0]} {row[1].split(';')[0]}"


def put(file: Path, marks: re.Pattern[str], name: str, text: str) -> None:
    """Write a block between its marks."""
    whole = f"<!-- {name}: make envelope -->\n{text}<!-- /{name} -->"
    file.write_text(marks.sub(lambda _: whole, file.read_text("utf-8")), "utf-8")


def main(folder: Path) -> None:
    """Write block and picture."""
    found = json.loads((folder / "envelope.json").read_text("utf-8"))
    put(ROOT / PAGE, BLOCK, "the envelope", block(found))
    # a palette: a third of the size, and nobody sees it in lines on white
    Image.open(folder / "envelope.png").convert("RGB").quantize(128).save(ROOT / PICTURE, optimize=True)
    print(block(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
