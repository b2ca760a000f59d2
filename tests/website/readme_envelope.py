"""The section *The envelope* of the README: its sentence, its table and its picture, from a folder that was flown.

python tests/website/readme_envelope.py out/envelope     writes the block into README.md and docs/images/envelope.png
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.compare.comparison_tables import markdown
from skyarm.compare.envelope_record import FLAGSHIP
from skyarm.compare.envelope_tables import summary_head, summary_rows, violation_rows

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"<!-- the envelope: make envelope -->\n(.*?)<!-- /the envelope -->", re.S)
PICTURE = "docs/images/envelope.png"


def block(found: Mapping[str, Any]) -> str:
    """What stands between the marks of the README, from the content of ``envelope.json``."""
    laws = found["laws"]
    words = found["sentences"][FLAGSHIP]
    trials = ", ".join(row[0] for row in violation_rows(found["violations"])) or "none"
    return (
        f"`{FLAGSHIP}` keeps the tip {words}\n\n"
        f"{markdown(summary_head(laws), summary_rows(found['axes'], laws))}\n\n"
        f"Trials in which it is lost and another of these laws is not, or over 10 % worse than the paper's: {trials}.\n"
    )


def main(folder: Path) -> None:
    """Write block and picture."""
    found = json.loads((folder / "envelope.json").read_text("utf-8"))
    readme = ROOT / "README.md"
    text = f"<!-- the envelope: make envelope -->\n{block(found)}<!-- /the envelope -->"
    readme.write_text(BLOCK.sub(lambda _: text, readme.read_text("utf-8")), "utf-8")
    (ROOT / PICTURE).write_bytes((folder / "envelope.png").read_bytes())
    print(block(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
