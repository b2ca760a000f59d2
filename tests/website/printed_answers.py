"""Run what README and docs show, print the lines that came out otherwise than shown,
and write them into the pages.

    python tests/website/printed_answers.py [--write] [PAGE ...]

PAGE is a path below docs, as ``margins.md`` or ``../README.md``; all if left out.
Minutes.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
from pathlib import Path


def main() -> int:
    """Exit code: 1 where lines differ that were not written."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    import shown_pages as pages
    from page_snippets import rewritten

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--write", action="store_true", help="write the printed lines into the pages"
    )
    parser.add_argument("pages", nargs="*", default=pages.WITH_CODE, metavar="PAGE")
    given, left = parser.parse_args(), 0
    for name in given.pages:
        if missing := pages.missing_programs(name):
            print(f"{name}: left out, needs {' and '.join(missing)}", flush=True)
            continue
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            sys.path.insert(0, folder)
            answers = pages.flown(name, Path(folder)).answers
            sys.path.remove(folder)
        for shown, printed in answers:
            print(f"{name}\n- {shown}\n+ {printed}", flush=True)
        if answers and given.write:
            pages.FILES[name].write_text(rewritten(pages.PAGES[name], answers), "utf-8")
        left += 0 if given.write else len(answers)
    return 1 if left else 0


if __name__ == "__main__":
    sys.exit(main())
