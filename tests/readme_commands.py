"""The commands and the code that the README shows, as they are run to see that they are true."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
LINES = [line.split("#")[0].strip() for line in README.splitlines() if line.startswith("    ")]
SHOWN = [line for line in LINES if line.startswith("skyarm ")]

LONG = (
    *("replay", "diff", "plot", "reproduce", "sweep", "stats", "bench", "compare", "margins", "basin"),
    *("film", "export", "studio", "doctor"),
)
"""These take a minute, need the one before or wait for Ctrl-C, and have tests of their own; here their options must be
understood."""


def words_to_run(line: str, out: Path) -> list[str]:
    """Words after ``skyarm`` that try a line in some seconds, its results in a folder."""
    words = [word.replace("examples/", f"{ROOT}/examples/") for word in shlex.split(line)[1:]]
    if words[0] in LONG:
        return [*words, "--help"]
    return [*words, "--duration", "1", "--out", str(out)] if words[0] == "run" else words


def code_shown() -> str:
    """The README's one block of Python."""
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    return str(code)
