"""Small pieces of HTML: escaped text, numbers, cells, tables."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

from skyarm.paper.agreement import Number, difference, digits, known, percent

DASH = "&ndash;"
NEAR, FAIR = 0.05, 0.20
"""Relative differences up to which a value counts as near and as fair."""


def text(value: object) -> str:
    """Escape text for an element or a quoted attribute."""
    return html.escape(str(value), quote=True)


def shown(value: float) -> str:
    """Three significant digits, typographic minus."""
    return typographic(digits(value))


def typographic(number: str) -> str:
    """A written number with a typographic minus."""
    return number.replace("-", "&minus;")


def number_cell(value: Number, *, written: str = "", mark: str = "") -> str:
    """Table cell of a number: as written, or rounded for reading; whole for machines.

    A dash if it is missing or not finite.
    """
    finite = known(value)
    if finite is None:
        return f'<td class="num none">{DASH}</td>'
    words = typographic(written) if written else shown(finite)
    return f'<td class="num"><data value="{value!r}">{mark_up(words, mark)}</data></td>'


def mark_up(content: str, element: str) -> str:
    """Wrap markup in an element; as it is if the element is empty."""
    return f"<{element}>{content}</{element}>" if element else content


GRADES = {"near": ("&#9679;", "within 5 %"), "fair": ("&#9680;", "within 20 %"), "far": ("&#9675;", "beyond 20 %")}
"""Grade -> symbol and words, so that the tint is never the only sign."""


def graded_cell(content: str, grade: str, words: str = "") -> str:
    """Table cell with a tint, a symbol and hidden words."""
    symbol, usual = GRADES[grade]
    sign = f'<span class="sign" aria-hidden="true">{symbol}</span><span class="hidden">({words or usual})</span>'
    return f'<td class="num {grade}">{content} {sign}</td>'


def difference_cell(ours: Number, paper: Number) -> str:
    """Table cell of a relative difference in percent, graded by how near it is."""
    relative = difference(ours, paper)
    if relative is None:
        return f'<td class="num none">{DASH}</td>'
    grade = "near" if abs(relative) <= NEAR else "fair" if abs(relative) <= FAIR else "far"
    return graded_cell(typographic(percent(relative)).replace(" ", "&nbsp;"), grade)


def bound_cell(ours: Number, paper: Number) -> str:
    """Table cell for a number of which the paper states an upper bound only."""
    value, bound = known(ours), known(paper)
    if value is None or bound is None:
        return f'<td class="num none">{DASH}</td>'
    return graded_cell("below", "near", "met") if value <= bound else graded_cell("above", "far", "not met")


def header_row(names: Iterable[str]) -> str:
    """Head of a table; an entry that begins with ">" heads a column of numbers."""
    cells = (
        f'<th scope="col" class="num">{text(name[1:])}</th>'
        if name[:1] == ">"
        else f'<th scope="col">{text(name)}</th>'
        for name in names
    )
    return f"<thead><tr>{''.join(cells)}</tr></thead>"


def table(caption: str, head: Sequence[str], groups: Iterable[tuple[str, Sequence[str]]], kind: str = "") -> str:
    """Table of groups of rows.

    Args:
        caption: markup.
        head: names of the columns.
        groups: (title in text or "", rows as markup of their cells).
        kind: CSS class.
    """
    bodies = []
    for title, rows in groups:
        heading = (
            f'<tr class="group"><th scope="rowgroup" colspan="{len(head)}">{text(title)}</th></tr>' if title else ""
        )
        bodies.append(f"<tbody>{heading}{''.join(f'<tr>{row}</tr>' for row in rows)}</tbody>")
    inner = f"<caption>{caption}</caption>{header_row(head)}{''.join(bodies)}"
    # the box scrolls sideways, the page does not: who has no pointer scrolls it with the keys
    return f'<div class="table" tabindex="0"><table class="{text(kind)}">{inner}</table></div>'


def details(summary: str, content: str) -> str:
    """Collapsed block."""
    return f"<details><summary>{text(summary)}</summary>{content}</details>"


def image(png: bytes, caption: str) -> str:
    """A picture inside the page and the caption below it, for a figure."""
    data = base64.b64encode(png).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="{text(caption)}"><figcaption>{text(caption)}</figcaption>'


def section(name: str, title: str, content: str) -> str:
    """Section with a heading that can be linked to."""
    heading = f'<h2 id="{name}-title">{text(title)}</h2>'
    return f'<section id="{name}" aria-labelledby="{name}-title">{heading}{content}</section>'


def bullets(items: Iterable[str]) -> str:
    """List of text items."""
    return f"<ul>{''.join(f'<li>{text(item)}</li>' for item in items)}</ul>"
