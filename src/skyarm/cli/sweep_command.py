"""``skyarm sweep`` and ``skyarm stats``: what they print and write."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from skyarm.cli.lines import say_if_many, say_unlikely
from skyarm.cli.progress import bar
from skyarm.cli.shipped_names import require_not_another
from skyarm.files import file_names, require_no_link, require_writable, taken_back, write_inside

DPI = 160


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


def stats(
    folder: Path,
    out: str | None,
    success: list[str] | None,
    paths: tuple[str, str] | None,
    seed: int,
    console: Console,
) -> None:
    """Write statistics of a study's rows: stats.json, report.html, a PNG for each map.

    Raises:
        ValueError, OSError: one line.
    """
    from skyarm.figures.embed import image_bytes
    from skyarm.figures.robustness import robustness_figure
    from skyarm.sweep.maps import robustness_maps
    from skyarm.sweep.stats import Rows, parse_limits, statistics
    from skyarm.sweep.study_page import page

    rows = Rows(folder, parse_limits(success) if success else None)
    maps = robustness_maps(rows, paths)
    target = require_writable(require_no_link(folder / "stats") if out is None else out)
    found = statistics(rows, seed=seed)
    images = {f"{each.controller}": image_bytes(robustness_figure(each), dpi=DPI) for each in maps}
    for name, file in file_names(images, "map_", ".png").items():
        write_inside(target / file, images[name])
    write_inside(target / "stats.json", (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())
    write_inside(target / "report.html", page(found, rows.manifest, images).encode())
    console.print(_lines(found), soft_wrap=True)
    console.print(f"statistics in {target}: report.html, stats.json{', map_*.png' if images else ''}", soft_wrap=True)


def _lines(found: dict[str, Any]) -> str:
    from skyarm.sweep.rows_there import not_counted

    lines = []
    for name, each in found["controllers"].items():
        low, high = each["success_interval"]
        ends = ", ".join(f"{count} {status}" for status, count in each["status"].items())
        lines.append(f"{name}: success {each['success_rate']:.2%} [{low:.2%}, {high:.2%}]; {ends}")
    for pair, each in found["paired"].items():
        low, high = each["success_difference_interval"]
        lines.append(f"{pair}: success {each['success_difference']:+.2%} [{low:+.2%}, {high:+.2%}] on the same draws")
    if not found["complete"]:
        lines.append(
            f"incomplete: {found['rows']} of {found['rows_planned']} rows, {found['episodes']} episodes so far"
        )
    lines += not_counted(found["files_not_counted"], found["files_beyond_the_last"])
    if found["manifest_rebuilt"]:
        lines.append("no manifest, so the study's limits of success are not known: --success gives them")
    return "\n".join(lines)
