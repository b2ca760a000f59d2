"""``skyarm stats``: what it prints and writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rich.console import Console

from skyarm.cli.machine_output import give
from skyarm.cli.progress import waiting
from skyarm.files import file_names, require_no_link, require_writable, write_inside

DPI = 160


def stats(
    folder: Path,
    out: str | None,
    success: list[str] | None,
    paths: tuple[str, str] | None,
    seed: int,
    console: Console,
) -> None:
    """Write statistics of a study's rows: stats.json, report.html, a PNG for each map and for each metric's curves.

    Raises:
        ValueError, OSError: one line.
    """
    from skyarm.sweep.maps import robustness_maps
    from skyarm.sweep.stats import Rows, parse_limits, statistics
    from skyarm.sweep.study_page import Pictures, page

    rows = Rows(folder, parse_limits(success) if success else None)
    with waiting(f"statistics of {folder}", console) as at:
        at("maps")
        maps = robustness_maps(rows, paths)
        target = require_writable(require_no_link(folder / "stats") if out is None else out)
        at("quantiles and differences")
        found = statistics(rows, seed=seed)
        at("pictures of maps")
        drawn = {each.controller: _map(each) for each in maps if each.constant is None}
        constant = {each.controller: each.constant for each in maps if each.constant is not None}
        curves = _curves(rows, at)
    files = [*_written(target, drawn, "map_"), *_written(target, curves, "curve_")]
    pictures = Pictures(
        maps=drawn, constant=constant, curves=curves, labels={p: rows.label(p) for p in rows.parameters}
    )
    write_inside(target / "stats.json", (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())
    write_inside(target / "report.html", page(found, rows.manifest, pictures).encode())
    give(found, folder=target, files=["report.html", "stats.json", *files])
    console.print(_lines(found), soft_wrap=True)
    kinds = [f"{kind}_*.png" for kind, there in (("map", drawn), ("curve", curves)) if there]
    console.print(f"statistics in {target}: {', '.join(['report.html', 'stats.json', *kinds])}", soft_wrap=True)


def _map(each: Any) -> bytes:
    from skyarm.figures.share_maps import robustness_figure
    from skyarm.figures.style import image_bytes

    return image_bytes(robustness_figure(each), dpi=DPI)


def _curves(rows: Any, at: Any) -> dict[str, bytes]:
    """Metric -> PNG of its curves over each varied number."""
    from skyarm.figures.metric_figure import curves_figure
    from skyarm.figures.style import image_bytes
    from skyarm.metrics.words_of_metrics import metric_words
    from skyarm.scenario.numbers import labelled
    from skyarm.sweep.banded_curves import drawn_metrics, metric_curves, varying

    found: dict[str, bytes] = {}
    for metric in drawn_metrics(rows) if varying(rows) else ():
        at(f"curves of {metric}")
        found[metric] = image_bytes(
            curves_figure(metric_curves(rows, metric), labelled(*metric_words(metric))), dpi=DPI
        )
    return found


def _written(target: Path, images: dict[str, bytes], before: str) -> list[str]:
    """Names of the files of some pictures, which are written."""
    names = file_names(images, before, ".png")
    for name, file in names.items():
        write_inside(target / file, images[name])
    return list(names.values())


def _lines(found: dict[str, Any]) -> str:
    from skyarm.sweep.study_folder import not_counted

    lines = []
    for name, each in found["controllers"].items():
        ends = ", ".join(f"{count} {status}" for status, count in each["status"].items())
        interval = _interval(each["success_interval"], ".2%")
        lines.append(f"{name}: success {each['success_rate']:.2%}{interval}; {ends}")
    for pair, each in found["paired"].items():
        interval = _interval(each["success_difference_interval"], "+.2%")
        lines.append(f"{pair}: success {each['success_difference']:+.2%}{interval} on the same draws")
    if found["deterministic"]:
        lines.append("no intervals: a grid of given numbers, flown without noise")
    if not found["complete"]:
        lines.append(
            f"incomplete: {found['rows']} of {found['rows_planned']} rows, {found['episodes']} episodes so far"
        )
    lines += not_counted(found["files_not_counted"])
    if found["manifest_rebuilt"]:
        lines.append("no manifest, so the study's limits of success are not known: --success gives them")
    return "\n".join(lines)


def _interval(pair: Any, form: str) -> str:
    return "" if pair is None else f" [{pair[0]:{form}}, {pair[1]:{form}}]"
