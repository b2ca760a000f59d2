"""The page of a study's statistics: one file that needs nothing else."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
from html import escape
from importlib import resources
from string import Template
from typing import Any

from skyarm.sweep.stats import SHARES


def page(found: Mapping[str, Any], manifest: Mapping[str, Any], images: Mapping[str, bytes]) -> str:
    """HTML of statistics and maps.

    Args:
        found: from :func:`skyarm.sweep.stats.statistics`.
        manifest: of the study.
        images: caption -> PNG.
    """
    body = [_section("Success", _success(found))]
    if found["paired"]:
        body.append(_section("Paired differences", _paired(found)))
    if images:
        body.append(_section("Robustness maps", MAP_NOTE + "".join(_image(*each) for each in images.items())))
    body += [_section(f"Metrics of {name}", _metrics(each)) for name, each in found["controllers"].items()]
    body.append(_section("What varied", _varied(manifest["study"])))
    template = Template((resources.files("skyarm.sweep") / "page.html").read_text("utf-8"))
    rows = f"{manifest['rows']} rows of {found['episodes']} episodes" + (
        "" if found["complete"] else ", not complete yet"
    )
    return template.substitute(
        title=escape(manifest["title"] or manifest["name"]),
        facts=escape(f"Study {manifest['name']}; {rows}; skyarm {manifest['versions']['skyarm']}"),
        body="\n".join(body),
    )


MAP_NOTE = '<p class="note">Shade: share of successes in a cell. Line: half of the episodes succeed.</p>'


def _section(title: str, content: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{content}</section>"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    top = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
    lines = []
    for first, *others in rows:
        cells = "".join(f"<td>{escape(cell)}</td>" for cell in others)
        lines.append(f'<tr><th scope="row">{escape(first)}</th>{cells}</tr>')
    return f'<div class="table"><table><thead><tr>{top}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'


def _success(found: Mapping[str, Any]) -> str:
    limits = "".join(f", {name} at most {limit:g}" for name, limit in found["limits"].items())
    note = f"<p>A success flew to its end{escape(limits)}. Intervals: Wilson, {found['confidence']:.0%}.</p>"
    rows = []
    for name, each in found["controllers"].items():
        ends = ", ".join(f"{count} {status}" for status, count in each["status"].items())
        rows.append((name, f"{each['success_rate']:.2%}", _interval(each["success_interval"], "{:.2%}"), ends))
    return note + _table(("controller", "success", "interval", "ends"), rows)


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
    return note + _table(("metric", "episodes", "mean", *(f"{share:.0%}" for share in SHARES)), rows)


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
        parts.append(f"<p>{escape(line)}</p>{_table(head, rows)}")
    return "".join(parts)


def _varied(study: Mapping[str, Any]) -> str:
    rows = [
        (path, kind, str(value)) for path, table in (study.get("vary") or {}).items() for kind, value in table.items()
    ]
    seed = f"<p>Design {escape(study['design'])}, seed {study['seed']}, precision {escape(study['precision'])}.</p>"
    return seed + _table(("number", "distribution", "of"), rows)


def _image(caption: str, png: bytes) -> str:
    data = base64.b64encode(png).decode("ascii")
    picture = f'<img alt="robustness map of {escape(caption)}" src="data:image/png;base64,{data}">'
    return f"<figure>{picture}<figcaption>{escape(caption)}</figcaption></figure>"


def _number(value: float) -> str:
    return f"{value:.4g}"


def _interval(pair: tuple[float, float], form: str = "{:.4g}") -> str:
    return f"[{form.format(pair[0])}, {form.format(pair[1])}]"
