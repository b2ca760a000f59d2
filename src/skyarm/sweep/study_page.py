"""The page of a study's statistics: one file that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from skyarm.pages import image, section, table
from skyarm.pages import page as plain_page
from skyarm.sweep.manifest import Manifest
from skyarm.sweep.rows_there import not_counted
from skyarm.sweep.stats import SHARES


def page(found: Mapping[str, Any], manifest: Manifest, images: Mapping[str, bytes]) -> str:
    """HTML of statistics and maps.

    Args:
        found: from :func:`skyarm.sweep.stats.statistics`.
        manifest: of the study's folder.
        images: caption -> PNG.
    """
    body = [section("Success", _success(found))]
    if found["paired"]:
        body.append(section("Paired differences", _paired(found)))
    if images:
        body.append(
            section(
                "Robustness maps",
                MAP_NOTE + "".join(image(f"robustness map of {name}", name, png) for name, png in images.items()),
            )
        )
    body += [section(f"Metrics of {name}", _metrics(each)) for name, each in found["controllers"].items()]
    body.append(section("What varied", _varied(manifest.origin.study)))
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
    notes = [
        f"{each[0].upper()}{each[1:]}."
        for each in not_counted(found["files_not_counted"], found.get("files_beyond_the_last", ()))
    ]
    if found["manifest_rebuilt"]:
        notes.append(NO_MANIFEST)
    return "".join(f'<p class="note">{escape(each)}</p>' for each in notes)


NO_MANIFEST = "The folder has no manifest, so the study's title and its limits of success are not known here."

MAP_NOTE = '<p class="note">Shade: share of successes in a cell. Line: half of the episodes succeed.</p>'


def _success(found: Mapping[str, Any]) -> str:
    limits = "".join(f", {name} at most {limit:g}" for name, limit in found["limits"].items())
    note = f"<p>A success flew to its end{escape(limits)}. Intervals: Wilson, {found['confidence']:.0%}.</p>"
    rows = []
    for name, each in found["controllers"].items():
        ends = ", ".join(f"{count} {status}" for status, count in each["status"].items())
        rows.append((name, f"{each['success_rate']:.2%}", _interval(each["success_interval"], "{:.2%}"), ends))
    return note + table(("controller", "success", "interval", "ends"), rows)


def _metrics(each: Mapping[str, Any]) -> str:
    rows = []
    for metric, spread in each["metrics"].items():
        if spread is None:
            rows.append((metric, "0", *["-"] * (1 + len(SHARES))))
            continue
        cells = [
            f"{_number(spread['quantiles'][str(share)])} {_interval(spread['intervals'][str(share)])}"
            for share in SHARES
        ]
        rows.append((metric, str(spread["count"]), _number(spread["mean"]), *cells))
    note = '<p class="note">Episodes that flew to their end; quantiles with bootstrap intervals; SI units, rad.</p>'
    return note + table(("metric", "episodes", "mean", *(f"{share:.0%}" for share in SHARES)), rows)


def _paired(found: Mapping[str, Any]) -> str:
    parts = []
    for pair, each in found["paired"].items():
        counts, gain = each["success"], each["success_difference"]
        line = (
            f"{pair}: success {gain:+.2%} {_interval(each['success_difference_interval'], '{:+.2%}')}; both "
            f"{counts['both']}, only the first {counts['only_first']}, only the second {counts['only_second']}, "
            f"neither {counts['neither']}"
        )
        rows = []
        for metric, one in each["metrics"].items():
            if one is None:
                rows.append((metric, "0", "-", "-", "-"))
                continue
            mean = f"{_number(one['mean'])} {_interval(one['mean_interval'])}"
            median = f"{_number(one['median'])} {_interval(one['median_interval'])}"
            smaller = f"{one['first_smaller']:.1%} {_interval(one['first_smaller_interval'], '{:.1%}')}"
            rows.append((metric, str(one["count"]), mean, median, smaller))
        head = ("metric", "pairs", "mean difference", "median difference", "first is smaller")
        parts.append(f"<p>{escape(line)}</p>{table(head, rows)}")
    return "".join(parts)


def _varied(study: Mapping[str, Any]) -> str:
    rows = [
        (path, kind, str(value)) for path, table in (study.get("vary") or {}).items() for kind, value in table.items()
    ]
    line = f"Design {study['design']}, seed {study['seed']}, precision {study['precision']}."
    return f"<p>{escape(line)}</p>" + table(("number", "distribution", "of"), rows)


def _number(value: float) -> str:
    return f"{value:.4g}"


def _interval(pair: tuple[float, float], form: str = "{:.4g}") -> str:
    return f"[{form.format(pair[0])}, {form.format(pair[1])}]"
