"""Statistics of a study: success rates, quantiles, paired differences between
controllers; their report.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from itertools import chain, combinations
from pathlib import Path

import numpy as np

from skyarm.log.metrics.metric_catalogue import metric_words
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import Mask
from skyarm.records.files import (
    PathLike,
    did_you_mean,
    file_names,
    number,
    shown,
    write_inside,
)
from skyarm.records.immutable import immutable
from skyarm.scenario.numbers import axis_label, words_of
from skyarm.studies.flights.store import read_column, require_parquet
from skyarm.studies.sweep.intervals import (
    CONFIDENCE,
    mean_interval,
    paired_difference,
    quantile_intervals,
    quantiles,
    wilson,
)
from skyarm.studies.sweep.manifest import MANIFEST, Manifest, read_manifest
from skyarm.studies.sweep.rows import not_counted, rows_there
from skyarm.studies.sweep.study import StudyError
from skyarm.view.pages import Facts, image, render_template
from skyarm.view.pages import page as plain_page

FAILED = "failed"
"""Text for the first episode without success."""

SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)


class Rows:
    """Results of a sweep's folder, a table row per flight, read column by column.

    Only files count that are whole and of this study.

    Args:
        folder: folder that ``skyarm sweep`` wrote.
        success: metric -> largest value of a successful episode; the study's own if
            left out.

    Attributes:
        manifest: manifest of the folder. count: rows that are there. planned: rows of
            the whole study.
        skipped: names of files that do not count.

    Raises:
        StudyError: no such folder, no rows, or an unknown metric.
    """

    def __init__(
        self, folder: PathLike, success: Mapping[str, float] | None = None
    ) -> None:
        require_parquet()
        self.folder, manifest = Path(folder), read_manifest(folder)
        at = f"folder = {os.fspath(folder)!r}"
        if manifest is None:
            raise StudyError(
                f"{at}: must be one that 'skyarm sweep' wrote; it has no whole"
                f" {MANIFEST}"
            )
        self.manifest = manifest
        there = rows_there(self.folder, manifest)
        self.skipped = there.ignored
        self._chunks = there.chunks
        self._files = there.files
        if not there.chunks:
            others = not_counted(self.skipped)
            why = f" ({'; '.join(others)})" if others else ""
            raise StudyError(
                f"{at}: must hold rows; 'skyarm sweep' has not finished a chunk{why}"
            )
        self.parameters = manifest.parameters
        self.metrics = tuple(manifest.study["metrics"])
        self.controllers = tuple(manifest.scenarios)
        self.limits = dict(self.manifest.success if success is None else success)
        for name in self.limits:
            if name not in self.metrics:
                listed = (
                    f"{did_you_mean(name, self.metrics)}there are"
                    f" {', '.join(self.metrics)}"
                )
                raise StudyError(
                    f"success.{name}: is no metric of these rows; {listed}"
                )
        self.episodes = sum(len(manifest.span(index)) for index in there.chunks)
        self.count = self.episodes * len(self.controllers)
        self.planned = manifest.rows

    @property
    def deterministic(self) -> bool:
        """True if the sweep has no random values: a grid of parameters without
        noise.
        """
        kinds = set(chain.from_iterable(self.manifest.vary.values()))
        given = self.manifest.study["design"] == "grid" and kinds <= {"list", "grid"}
        return given and not self.manifest.noise

    def label(self, path: str) -> str:
        """Label of a varied parameter, with its unit."""
        return axis_label(words_of(path), self.manifest.units.get(path, ""))

    def is_logarithmic(self, path: str) -> bool:
        """True for a varied parameter that was drawn by its logarithm."""
        return "log_uniform" in self.manifest.vary.get(path, {})

    @property
    def complete(self) -> bool:
        """True if the folder has the results of all flights of the study."""
        return self.count == self.planned

    def of(self, controller: str, name: str) -> Array:
        """Values of one metric or parameter over all flights of one controller.

        Raises:
            StudyError: the rows have no such column.
        """
        files = [self._files[index, controller] for index in self._chunks]
        try:
            return read_column(files, name, controller if self.manifest.old else "")
        except ValueError as error:
            raise StudyError(
                f"{self.folder}: column {name!r}: must be readable ({error})"
            ) from None

    def succeeded(self, controller: str) -> Mask:
        """Success of each flight of a controller: completed, with all metrics within
        their limits.
        """
        success = self.of(controller, "status") == "completed"
        for name, limit in self.limits.items():
            success = success & (self.of(controller, name) <= limit)
        return np.asarray(success)

    def episode(self, controller: str, which: str) -> int:
        """Number of a controller's first failed episode, or of the episode with the
        largest value of a metric.

        Args:
            controller: label of the controller.
            which: "failed", or the name of a metric.

        Raises:
            StudyError: the rows have no such metric; no episode failed; or no episode
                has a value of the metric.
        """
        if which == FAILED:
            matching = ~self.succeeded(controller)
        else:
            # NaN of an episode that did not fly is no largest value
            column = self.of(controller, which)
            matching = column == np.max(
                column, initial=-np.inf, where=~np.isnan(column)
            )
        if not matching.any():
            raise StudyError(
                f"{which!r}: is true of no episode of {controller} in {self.folder};"
                " must be true of one"
            )
        return int(self.of(controller, "episode")[int(matching.argmax())])


def parse_limits(texts: list[str]) -> dict[str, float]:
    """Parse success limits from ``metric=value`` texts.

    Raises:
        StudyError: a text of another form, or a metric twice.
    """
    limits = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name.strip() in limits:
            raise StudyError(f"--success = {shown(text)}: must name each metric once")
        try:
            limits[name.strip()] = number(float(value), name)
        except ValueError:
            raise StudyError(
                f"--success = {shown(text)}: must be METRIC=LARGEST, such as"
                " position_error_mean=0.2"
            ) from None
    return limits


def statistics(rows: Rows) -> Facts:
    """Statistics of a sweep as plain data: success rates, quantiles and paired
    differences.

    Args:
        rows: rows of the study.

    Returns:
        Success and quantiles of each controller, and differences of each pair. Metrics
        are those of episodes that flew to their end; paired ones, of episodes that did
        so with both. Where nothing was drawn at random ("deterministic") intervals are
        null: the same study gives the same numbers again, and samples no others. So is
        the interval of a mean or quantile of which there are too few values for one.
    """
    wins = {controller: rows.succeeded(controller) for controller in rows.controllers}
    flew = {
        controller: rows.of(controller, "status") == "completed"
        for controller in rows.controllers
    }
    facts: Facts = {
        "schema": 1,
        "study": rows.manifest.name,
        "complete": rows.complete,
        "rows": rows.count,
        "rows_planned": rows.planned,
        "files_not_counted": list(rows.skipped),
        "episodes": rows.episodes,
        "deterministic": rows.deterministic,
        "confidence": CONFIDENCE,
        "limits": rows.limits,
        "controllers": {},
        "paired": {},
    }
    for controller in rows.controllers:
        counts = Counter(rows.of(controller, "status").tolist())
        won = int(wins[controller].sum())
        facts["controllers"][controller] = {
            "status": dict(sorted(counts.items())),
            "successes": won,
            "success_rate": won / rows.episodes,
            "success_interval": wilson(won, rows.episodes),
            "metrics": {},
        }
    pairs = list(combinations(rows.controllers, 2))
    for one, other in pairs:
        facts["paired"][f"{one} - {other}"] = _success_difference(
            wins[one], wins[other]
        )
    # one metric after the other, so that only its columns are in memory
    for metric in rows.metrics:
        columns = {
            controller: rows.of(controller, metric) for controller in rows.controllers
        }
        for controller, column in columns.items():
            flown = column[flew[controller] & np.isfinite(column)]
            facts["controllers"][controller]["metrics"][metric] = _spread(flown)
        for one, other in pairs:
            difference = columns[one] - columns[other]
            flown = difference[flew[one] & flew[other] & np.isfinite(difference)]
            facts["paired"][f"{one} - {other}"]["metrics"][metric] = (
                _difference_statistics(flown)
            )
    return _without_intervals(facts) if rows.deterministic else facts


def _without_intervals(facts: Facts) -> Facts:
    """Statistics with every confidence interval set to None, for sweeps without random
    values.
    """
    every = {
        key: _without_intervals(each) if isinstance(each, dict) else each
        for key, each in facts.items()
    }
    return {
        key: None if key == "intervals" or key.endswith("_interval") else each
        for key, each in every.items()
    }


def _spread(values: Array) -> Facts | None:
    if not values.size:
        return None
    return {
        "count": int(values.size),
        "mean": float(values.mean()),
        "quantiles": dict(
            zip(map(str, SHARES), quantiles(values, SHARES), strict=True)
        ),
        "intervals": dict(
            zip(map(str, SHARES), quantile_intervals(values, SHARES), strict=True)
        ),
    }


def _difference_statistics(difference: Array) -> Facts | None:
    """Mean and median of paired differences, and share of negative ones (ties count
    half).
    """
    if not difference.size:
        return None
    smaller = float((difference < 0.0).sum() + 0.5 * (difference == 0.0).sum())
    return {
        "count": int(difference.size),
        "mean": float(difference.mean()),
        "mean_interval": mean_interval(difference),
        "median": quantiles(difference, (0.5,))[0],
        "median_interval": quantile_intervals(difference, (0.5,))[0],
        "first_smaller": smaller / difference.size,
        "first_smaller_interval": wilson(smaller, int(difference.size)),
    }


def _success_difference(one: Array, other: Array) -> Facts:
    counts = {
        "both": int((one & other).sum()),
        "only_first": int((one & ~other).sum()),
        "only_second": int((~one & other).sum()),
        "neither": int((~one & ~other).sum()),
    }
    return {
        "success": counts,
        "success_difference": (counts["only_first"] - counts["only_second"]) / one.size,
        "success_difference_interval": paired_difference(**counts),
        "metrics": {},
    }


@immutable(slots=False)
class Pictures:
    """Robustness maps of a sweep as PNG pictures, by controller.

    Attributes:
        maps: law -> PNG of its robustness map. constant: law -> the share of successes
            that all of its map has.
    """

    maps: Mapping[str, bytes] = field(default_factory=dict)
    constant: Mapping[str, float] = field(default_factory=dict)

    def write(self, folder: Path, laws: Iterable[str]) -> list[str]:
        """Write the robustness maps as PNG files; returns the file names.

        An earlier map of a law that has none now is removed.
        """
        written = []
        for label, name in file_names(laws, "map_", ".png").items():
            if label in self.maps:
                write_inside(folder / name, self.maps[label])
                written.append(name)
            else:
                # one of an earlier report would be taken for this one's
                (folder / name).unlink(missing_ok=True)
        return written


def page(found: Facts, manifest: Manifest, pictures: Pictures) -> str:
    """HTML page of a sweep's statistics and robustness maps, in one self-contained
    file.

    Args:
        found: statistics from :func:`skyarm.studies.sweep.stats.statistics`.
        manifest: manifest of the study's folder.
        pictures: pictures of maps.
    """
    body = render_template(
        "studies/sweep/study.html",
        found=found,
        study={"derived": None, **manifest.study},
        levels=SHARES,
        notes=not_counted(found["files_not_counted"]),
        metric=lambda name: axis_label(*metric_words(name)),
        label=lambda path: axis_label(words_of(path), manifest.units.get(path, "")),
        image=image,
        **vars(pictures),
    )
    facts = (
        f"Study {manifest.name}; {_rows_there(found)}; skyarm"
        f" {manifest.versions['skyarm']}"
    )
    return plain_page(manifest.title or manifest.name, facts, body)


def summary(found: Facts) -> list[str]:
    """Text lines for a terminal: success rates of a sweep, and how many flights are
    missing.
    """

    def interval(pair: Sequence[float] | None, form: str) -> str:
        return "" if pair is None else f" [{pair[0]:{form}}, {pair[1]:{form}}]"

    lines = []
    for name, each in found["controllers"].items():
        ends = ", ".join(
            f"{count} {status}" for status, count in each["status"].items()
        )
        lines.append(
            f"{name}: success"
            f" {each['success_rate']:.2%}{interval(each['success_interval'], '.2%')};"
            f" {ends}"
        )
    for pair, each in found["paired"].items():
        within = interval(each["success_difference_interval"], "+.2%")
        lines.append(
            f"{pair}: success {each['success_difference']:+.2%}{within} on the same"
            " draws"
        )
    if found["deterministic"]:
        lines.append("no intervals: a grid of given numbers, flown without noise")
    if not found["complete"]:
        lines.append(_rows_there(found))
    return lines + not_counted(found["files_not_counted"])


def _rows_there(facts: Facts) -> str:
    """Text on how many flights and episodes of a sweep have results."""
    if facts["complete"]:
        return f"{facts['rows']} rows of {facts['episodes']} episodes"
    return (
        f"incomplete: {facts['rows']} of {facts['rows_planned']} rows,"
        f" {facts['episodes']} episodes so far"
    )
