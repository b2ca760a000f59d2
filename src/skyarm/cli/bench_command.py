"""``skyarm bench``: what it prints and writes."""

from __future__ import annotations

import json

from rich.console import Console

from skyarm.cli.machine_output import give
from skyarm.cli.progress import waiting
from skyarm.files import output_file, write_atomically


def bench(name: str | None, quick: bool, console: Console) -> None:
    """Measure, print, and write the numbers where they are wanted.

    Raises:
        ValueError, OSError: the file cannot be written; said before anything is measured.
    """
    from skyarm.bench.bench_report import measure, text

    file = None if name is None else output_file(name, "--out")
    with waiting("measuring", console) as at:
        found = measure(quick=quick, progress=at)
    give(found)
    console.print(text(found), soft_wrap=True)
    if file is not None:
        write_atomically(file, (json.dumps(found, indent=1) + "\n").encode())
        console.print(f"written: {file}", soft_wrap=True)
