"""Measure what an identification says of sound and of damaged flight logs: a table of
both.

    python tests/identify/measure_faults.py [WORDS] [--workers N]

Only logs with all the words in their name are tried. A damaged log should be *named*:
its channel and what is wrong; or *repaired*: the numbers are right all the same. It is
bad if its channel is accused of another damage (*misread*), if it passes in *silence*
with wrong numbers, or if another channel is accused.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

# the tests' own vehicles, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

from judged_flights import DAMAGED, SOUND, accusations, verdict


def main() -> None:
    """Judge, and print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("words", nargs="*", help="that the names must hold")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    given = parser.parse_args()
    sound, broken = (
        [name for name in names if all(each in name for each in given.words)]
        for names in (SOUND, DAMAGED)
    )
    with ProcessPoolExecutor(given.workers) as pool:
        accused = 0
        for name, words in zip(sound, pool.map(accusations, sound), strict=True):
            accused += bool(words)
            print(
                f"sound    {name:42}"
                f" {'ACCUSED: ' + ' | '.join(words) if words else 'accepted'}",
                flush=True,
            )
        counts = Counter[str]()
        for name, (found, words) in zip(broken, pool.map(verdict, broken), strict=True):
            counts[found] += 1
            print(
                f"damaged  {name:36} {found:9} {DAMAGED[name].how}: {words[:200]}",
                flush=True,
            )
    print(f"{accused} of {len(sound)} sound logs accused; damaged: {dict(counts)}")


if __name__ == "__main__":
    main()
