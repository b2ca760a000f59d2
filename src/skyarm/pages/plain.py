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


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table whose first column names the rows; wide ones scroll by themselves."""
    top = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
    lines = []
    for first, *others in rows:
        cells = "".join(f"<td>{escape(cell)}</td>" for cell in others)
        lines.append(f'<tr><th scope="row">{escape(first)}</th>{cells}</tr>')
    return f'<div class="table"><table><thead><tr>{top}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'


def image(alternative: str, caption: str, png: bytes) -> str:
    """A picture inside the page."""
    data = base64.b64encode(png).decode("ascii")
    picture = f'<img alt="{escape(alternative)}" src="data:image/png;base64,{data}">'
    return f"<figure>{picture}<figcaption>{escape(caption)}</figcaption></figure>"
