"""Pieces of a plain page; every text is escaped here."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from html import escape
from importlib import resources
from string import Template


def page(title: str, facts: str, body: str) -> str:
    """A whole page: title, one line of facts, body of :func:`section` s."""
    template = Template((resources.files("skyarm.pages") / "plain.html").read_text("utf-8"))
    return template.substitute(title=escape(title), facts=escape(facts), body=body)


def section(title: str, content: str) -> str:
    """A section with a heading; ``content`` is HTML."""
    return f"<section><h2>{escape(title)}</h2>{content}</section>"


def details(summary: str, content: str) -> str:
    """What is folded until one asks for it, and open on paper; ``content`` is HTML."""
    return f"<details><summary>{escape(summary)}</summary>{content}</details>"


FEW = 3
"""Columns up to which a table takes no more room than it needs."""

Rows = Iterable[Iterable[str]]

MANY = 9
"""Columns above which a table is set smaller and its cells may break."""


def table(head: Iterable[str], rows: Rows, caption: str = "") -> str:
    """A table whose first column names the rows; wide ones scroll by themselves."""
    return grouped(head, [("", rows)], caption)


def grouped(head: Iterable[str], groups: Iterable[tuple[str, Rows]], caption: str = "") -> str:
    """The same with rows in groups.

    Args:
        head: names of the columns; one that begins with ">" holds numbers and is set to the right.
        groups: (title or "", rows).
        caption: above it, or "".
    """
    names = list(head)
    kinds = [' class="num"' if name[:1] == ">" else "" for name in names]
    top = "".join(
        f'<th scope="col"{kind}>{escape(name.removeprefix(">"))}</th>' for name, kind in zip(names, kinds, strict=True)
    )
    bodies = []
    for title, rows in groups:
        heading = f'<tr class="group"><th scope="rowgroup" colspan="{len(names)}">{escape(title)}</th></tr>'
        lines = [heading] if title else []
        for first, *others in rows:
            cells = "".join(f"<td{kind}>{escape(cell)}</td>" for kind, cell in zip(kinds[1:], others, strict=True))
            lines.append(f'<tr><th scope="row">{escape(first)}</th>{cells}</tr>')
        bodies.append(f"<tbody>{''.join(lines)}</tbody>")
    above = f"<caption>{escape(caption)}</caption>" if caption else ""
    size = ' class="many"' if len(names) > MANY else ' class="few"' if len(names) <= FEW else ""
    inside = f"<table{size}>{above}<thead><tr>{top}</tr></thead>{''.join(bodies)}</table>"
    # the box scrolls sideways, the page does not: who has no pointer scrolls it with the keys
    return f'<div class="table" tabindex="0">{inside}</div>'


def image(
    alternative: str, caption: str, png: bytes, *, wide: bool = False, whole: bool = False, small: bool = False,
    link: str = "",
) -> str:  # fmt: skip
    """A picture inside the page.

    A wide one takes all of its width, on a narrow screen only if it is ``whole``; of small ones three stand side by
    side. ``link`` is a file beside the page that the caption leads to.
    """
    data = base64.b64encode(png).decode("ascii")
    picture = f'<img alt="{escape(alternative)}" src="data:image/png;base64,{data}">'
    told = f'<a href="{escape(link)}">{escape(caption)}</a>' if link else escape(caption)
    kind = ' class="small"' if small else ""
    kind = f' class="wide{" whole" if whole else ""}"' if wide else kind
    return f"<figure{kind}>{picture}<figcaption>{told}</figcaption></figure>"
