"""Report of a sweep: statistics as an HTML page, and robustness maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skyarm.log.metrics.metric_catalogue import metric_words
from skyarm.records.files import file_names, write_inside
from skyarm.scenario.numbers import axis_label, words_of
from skyarm.studies.sweep.manifest import Manifest
from skyarm.studies.sweep.rows import not_counted
from skyarm.studies.sweep.stats import SHARES
from skyarm.view.pages import image, render_template
from skyarm.view.pages import page as plain_page


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """Robustness maps of a sweep as PNG pictures, by controller.

    Attributes:
        maps: law -> PNG of its robustness map. constant: law -> the share of successes that all of its map has.
    """

    maps: Mapping[str, bytes] = field(default_factory=dict)
    constant: Mapping[str, float] = field(default_factory=dict)

    def write(self, folder: Path) -> list[str]:
        """Write the robustness maps as PNG files; returns the file names."""
        written = []
        for label, name in file_names(self.maps, "map_", ".png").items():
            write_inside(folder / name, self.maps[label])
            written.append(name)
        return written


def page(found: Mapping[str, Any], manifest: Manifest, pictures: Pictures) -> str:
    """HTML page of a sweep's statistics and robustness maps, in one self-contained file.

    Args:
        found: from :func:`skyarm.studies.sweep.stats.statistics`.
        manifest: of the study's folder.
        pictures: of maps.
    """
    body = render_template(
        "studies/sweep/study.html",
        found=found,
        study={"derived": None, **manifest.study},
        levels=SHARES,
        notes=not_counted(found["files_not_counted"]),
        metric=metric_label,
        label=lambda path: axis_label(words_of(path), manifest.units.get(path, "")),
        image=image,
        **vars(pictures),
    )
    facts = f"Study {manifest.name}; {_rows_there(found)}; skyarm {manifest.versions['skyarm']}"
    return plain_page(manifest.title or manifest.name, facts, body)


def summary(found: Mapping[str, Any]) -> list[str]:
    """Text lines for a terminal: success rates of a sweep, and how many flights are missing."""

    def interval(pair: Any, form: str) -> str:
        return "" if pair is None else f" [{pair[0]:{form}}, {pair[1]:{form}}]"

    lines = []
    for name, each in found["controllers"].items():
        ends = ", ".join(f"{count} {status}" for status, count in each["status"].items())
        lines.append(f"{name}: success {each['success_rate']:.2%}{interval(each['success_interval'], '.2%')}; {ends}")
    for pair, each in found["paired"].items():
        within = interval(each["success_difference_interval"], "+.2%")
        lines.append(f"{pair}: success {each['success_difference']:+.2%}{within} on the same draws")
    if found["deterministic"]:
        lines.append("no intervals: a grid of given numbers, flown without noise")
    if not found["complete"]:
        lines.append(_rows_there(found))
    return lines + not_counted(found["files_not_counted"])


def _rows_there(found: Mapping[str, Any]) -> str:
    """Text on how many rows and episodes are there."""
    if found["complete"]:
        return f"{found['rows']} rows of {found['episodes']} episodes"
    return f"incomplete: {found['rows']} of {found['rows_planned']} rows, {found['episodes']} episodes so far"


def metric_label(metric: str) -> str:
    """Label of a metric, with its unit."""
    return axis_label(*metric_words(metric))
