"""The page of a study's statistics: one file that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any

from skyarm.metrics.metric_catalogue import metric_words
from skyarm.pages import details, image, section, table
from skyarm.pages import page as plain_page
from skyarm.scenario.numbers import labelled, words_of
from skyarm.sweep.stats import SHARES
from skyarm.sweep.study_folder import Manifest, not_counted


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """What is drawn of a study.

    Attributes:
        maps: law -> PNG of its robustness map. constant: law -> the share of successes that all of its map has.
        curves: metric -> PNG of its curves over each varied number. labels: path -> words and unit.
    """

    maps: Mapping[str, bytes] = field(default_factory=dict)
    constant: Mapping[str, float] = field(default_factory=dict)
    curves: Mapping[str, bytes] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)


def page(found: Mapping[str, Any], manifest: Manifest, pictures: Pictures) -> str:
    """HTML of statistics, maps and curves.

    Args:
        found: from :func:`skyarm.sweep.stats.statistics`.
        manifest: of the study's folder.
        pictures: maps and curves.
    """
    body = [section("Success", _success(found))]
    if pictures.maps or pictures.constant:
        body.append(section("Robustness maps", _maps(pictures)))
    if pictures.curves:
        body.append(section("Metrics over what varied", _curves(pictures, found)))
    if found["paired"]:
        body.append(section("Paired differences", _paired(found)))
    folded = "".join(_metrics(name, each) for name, each in found["controllers"].items())
    body.append(section("Metrics", folded + _names(found)))
    body.append(section("What varied", _varied(manifest.origin.study, pictures.labels)))
    return plain_page(
        manifest.title or manifest.name,
        f"Study {manifest.name}; {_rows(found)}; skyarm {manifest.origin.version}",
        _notes(found) + "\n".join(body),
    )


def _rows(found: Mapping[str, Any]) -> str:
    """How many rows there are, in words."""
    if found["complete"]:
        return f"{found['rows']} rows of {found['episodes']} episodes"
    return f"incomplete: {found['rows']} of {found['rows_planned']} rows, {found['episodes']} episodes so far"


def _notes(found: Mapping[str, Any]) -> str:
    """What a reader must know of the folder before the numbers."""
    notes = [f"{each[0].upper()}{each[1:]}." for each in not_counted(found["files_not_counted"])]
    if found["manifest_rebuilt"]:
        notes.append(NO_MANIFEST)
    return "".join(f'<p class="note">{escape(each)}</p>' for each in notes)


NO_MANIFEST = "The folder has no manifest, so the study's title and its limits of success are not known here."

MAP_NOTE = '<p class="note">Shade: share of successes in a cell. Line: half of the episodes succeed.</p>'


GIVEN = (
    "Every episode is a point of a grid of given numbers, flown without noise: nothing is drawn at random, and the "
    "numbers have no intervals."
)


def _limits(limits: Mapping[str, float]) -> str:
    """Limits of success in words."""
    found = ""
    for name, limit in limits.items():
        words, unit = metric_words(name)
        found += f", {words} at most {limit:g}{f' {unit}' if unit else ''}"
    return found


def _maps(pictures: Pictures) -> str:
    """A picture of each map that has something to show; a sentence for one that is the same everywhere."""
    parts = [MAP_NOTE] if pictures.maps else []
    for name, png in pictures.maps.items():
        parts.append(image(f"robustness map of {name}", f"{name}: share of successes in each cell", png))
    for name, share in pictures.constant.items():
        every = {0.0: "no episode succeeds", 1.0: "every episode succeeds"}.get(share, f"{share:.1%} succeed")
        parts.append(f"<p>{escape(name)}: {every}, in every cell of the map.</p>")
    return "".join(parts)


def _curves(pictures: Pictures, found: Mapping[str, Any]) -> str:
    """The first metric's curves, and those of the others folded."""
    band = "least and largest of the grid" if found["deterministic"] else "5 to 95 % of the episodes"
    note = f'<p class="note">Line: median of the episodes that flew to their end; band: {band}.</p>'
    drawn = []
    for metric, png in pictures.curves.items():
        words = labelled(*metric_words(metric))
        drawn.append(image(f"{words} over each varied number", f"{words} over each varied number", png, wide=True))
    first, *others = drawn
    return note + first + (details("More metrics", "".join(others)) if others else "")


def _success(found: Mapping[str, Any]) -> str:
    how = GIVEN if found["deterministic"] else f"Intervals: Wilson, {found['confidence']:.0%}."
    note = f"<p>A success flew to its end{escape(_limits(found['limits']))}. {how}</p>"
    rows = []
    for name, each in found["controllers"].items():
        ends = ", ".join(f"{count} {status}" for status, count in each["status"].items())
        rate, interval = f"{each['success_rate']:.2%}", _interval(each["success_interval"], "{:.2%}")
        rows.append((name, rate, ends) if found["deterministic"] else (name, rate, interval, ends))
    head = ("law", "success", "ends") if found["deterministic"] else ("law", "success", "interval", "ends")
    return note + table(head, rows)


def _metrics(name: str, each: Mapping[str, Any]) -> str:
    """A law's metrics, folded."""
    rows, given = [], False
    for metric, spread in each["metrics"].items():
        words = labelled(*metric_words(metric))
        if spread is None:
            rows.append((words, "0", *["-"] * (1 + len(SHARES))))
            continue
        given = spread["intervals"] is None
        intervals = spread["intervals"] or {}
        cells = [
            f"{_number(spread['quantiles'][str(share)])} {_interval(intervals.get(str(share)))}".rstrip()
            for share in SHARES
        ]
        rows.append((words, str(spread["count"]), _number(spread["mean"]), *cells))
    how = "quantiles" if given else "quantiles with bootstrap intervals"
    caption = f"{name}: episodes that flew to their end, {how}"
    head = ("metric", ">episodes", ">mean", *(f">{share:.0%}" for share in SHARES))
    return details(f"Metrics of {name}", table(head, rows, caption))


def _names(found: Mapping[str, Any]) -> str:
    """What the metrics are called in files and on the command line."""
    names = dict.fromkeys(name for each in found["controllers"].values() for name in each["metrics"])
    rows = [(labelled(*metric_words(name)), name) for name in names]
    return details("Names in files", table(("metric", "name"), rows)) if rows else ""


def _paired(found: Mapping[str, Any]) -> str:
    parts = []
    for pair, each in found["paired"].items():
        counts, gain = each["success"], each["success_difference"]
        interval = _interval(each["success_difference_interval"], "{:+.2%}")
        line = (
            f"{pair}: success {gain:+.2%}{f' {interval}' if interval else ''}; both "
            f"{counts['both']}, only the first {counts['only_first']}, only the second {counts['only_second']}, "
            f"neither {counts['neither']}"
        )
        rows = []
        for metric, one in each["metrics"].items():
            words = labelled(*metric_words(metric))
            if one is None:
                rows.append((words, "0", "-", "-", "-"))
                continue
            mean = f"{_number(one['mean'])} {_interval(one['mean_interval'])}"
            median = f"{_number(one['median'])} {_interval(one['median_interval'])}"
            smaller = f"{one['first_smaller']:.1%} {_interval(one['first_smaller_interval'], '{:.1%}')}"
            rows.append((words, str(one["count"]), mean.rstrip(), median.rstrip(), smaller.rstrip()))
        head = ("metric", ">pairs", ">mean difference", ">median difference", ">first is smaller")
        parts.append(
            f"<p>{escape(line)}</p>{details(f'Metrics of {pair}', table(head, rows, f'{pair}, on the same draws'))}"
        )
    return "".join(parts)


def _varied(study: Mapping[str, Any], labels: Mapping[str, str]) -> str:
    rows = [
        (labels.get(path, words_of(path)), kind, str(value), path)
        for path, distribution in (study.get("vary") or {}).items()
        for kind, value in distribution.items()
    ]
    derived = (study.get("derived") or {}).items()
    rows += [(labels.get(name, words_of(name)), "derived", str(text), name) for name, text in derived]
    line = f"Design {study['design']}, seed {study['seed']}, precision {study['precision']}."
    return f"<p>{escape(line)}</p>" + table(("number", "distribution", "of", "path"), rows)


def _number(value: float) -> str:
    return f"{value:.4g}"


def _interval(pair: tuple[float, float] | None, form: str = "{:.4g}") -> str:
    return "" if pair is None else f"[{form.format(pair[0])}, {form.format(pair[1])}]"
