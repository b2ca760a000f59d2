"""Entry point of the command line. Light, so that a signal that comes while libraries load ends with a line too."""

from __future__ import annotations

import gc
import sys

from skyarm.cli.endings import WORDS, endings
from skyarm.cli.lines import say

PATIENCE = 50_000
"""New objects before the first search for garbage: libraries and traced programs are many objects that stay."""


def main() -> None:
    """Carry out a command: 0 done, 2 wrong input, 3 a flight not completed, 128 + n ended by signal n."""
    gc.set_threshold(PATIENCE)
    with endings() as came:
        try:
            from skyarm.cli.commands import perform

            code = perform()
        except BaseException:
            # a library that a signal cut off while it loaded may have turned it into an error of its own
            if not came:
                raise
    if came:
        code = say(f"{WORDS[came[0].name]}; finished files are whole", 128 + came[0])
    sys.exit(code)
