"""``skyarm sweep``: what it prints and writes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from skyarm.cli.lines import say_if_many, say_unlikely
from skyarm.cli.machine_output import give
from skyarm.cli.progress import bar
from skyarm.cli.shipped_names import require_not_another
from skyarm.files import require_writable, taken_back


def sweep(
    study: str,
    out: str | None,
    threads: int,
    ray: str | None,
    console: Console,
    controllers: Sequence[str] | None = None,
) -> None:
    """Fly a study, or what is missing of it.

    Raises:
        ValueError, OSError: one line.
    """
    from skyarm.scenario.unlikely_numbers import unlikely_numbers
    from skyarm.sweep import load_study, run_sweep

    require_not_another(study, "study")
    words = None if controllers is None else [word for each in controllers for word in each.split(",") if word]
    loaded = load_study(study, words)
    folder = Path("out") / loaded.name if out is None else Path(out)
    say_if_many(loaded.name, max(each.world.vehicle.n for each in loaded.scenarios.values()))
    say_unlikely(loaded.name, unlikely_numbers(next(iter(loaded.scenarios.values()))))
    begin = time.perf_counter()
    before: list[int] = []
    with taken_back(folder), bar(loaded.name, console) as advance:
        require_writable(folder if out is None else out)

        def progress(done: int, total: int) -> None:
            if not before:
                before.append(done)
            rate = (done - before[0]) * len(loaded.scenarios) / max(time.perf_counter() - begin, 1e-9)
            advance(done, total, f"{rate:.0f} flights/s")

        summary = run_sweep(loaded, folder, threads=threads, ray=ray, progress=progress)
    flights = summary.flown * len(loaded.scenarios)
    known = f", {summary.found} episodes were there" if summary.found else ""
    console.print(
        f"{summary.rows} rows in {folder}: {loaded.episodes} episodes of {', '.join(loaded.scenarios)}; "
        f"{flights} flights in {summary.seconds:.1f} s{known}",
        soft_wrap=True,
    )
    console.print(f"next: skyarm stats {folder}", soft_wrap=True)
    give(
        study=loaded.name,
        folder=folder,
        rows=summary.rows,
        episodes=loaded.episodes,
        controllers=list(loaded.scenarios),
        flights=flights,
        seconds=summary.seconds,
        episodes_there_before=summary.found,
    )
