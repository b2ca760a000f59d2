"""HTML elements of self-contained report pages, made from templates with escaped
text.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

FEW, MANY = 3, 9
"""Number of columns up to which a table is narrow, and above which its text is
smaller."""

Rows = Iterable[Iterable[Any]]
"""Rows of cells that are text or :class:`skyarm.view.pages.sections.Mark`."""


@cache
def _templates() -> Environment:
    """Jinja environment of all templates in the package, which escapes text."""
    # 60 ms, which only a page costs
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("skyarm", "")
    return Environment(
        loader=loader,
        autoescape=True,
        # a word that a template misses is an error and not an empty text
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _part(name: str, *values: Any) -> str:
    """Render one macro of the page's parts, such as a table, by its name."""
    return str(
        getattr(_templates().get_template("view/pages/parts.html").module, name)(
            *values
        )
    )


def render_template(template: str, **values: Any) -> str:
    """Render an HTML template by its path in the package, such as
    "studies/sweep/study.html".
    """
    return str(_templates().get_template(template).render(**values))


def page(
    title: str,
    facts: str | Sequence[str],
    body: str = "",
    *,
    style: Mapping[str, str] | None = None,
    script: str = "",
    pages: Mapping[str, str] | None = None,
    sections: Sequence[tuple[str, str, str]] = (),
    **parts: str,
) -> str:
    """Make the HTML of a whole report page that loads nothing from other sites.

    Args:
        title: heading of the page, text.
        facts: first line, text; first lines, each a paragraph, of a page with
            ``pages``.
        body: HTML of :func:`section` s.
        style: style sheets by identifier; the plain one if left out.
        script: the only script that a browser runs in the page, by its hash.
        pages: file -> title of the pages of a report, which get links between them and
            a table of contents.
        sections: (identifier, title, HTML) of such a page.
        parts: further parts of such a page: ``name`` of its file, ``lead`` and
            ``footer`` as text, ``opening`` as HTML.
    """
    # the page runs no script but this one, whatever a text of the report holds
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    named = [
        dict(zip(("name", "title", "content"), each, strict=True)) for each in sections
    ]
    empty = dict.fromkeys(("name", "lead", "footer", "opening"), "")
    return render_template(
        "view/pages/page.html",
        title=title,
        facts=facts,
        body=body,
        styles=style
        or {
            "": (resources.files("skyarm.view.pages") / "plain.css").read_text("utf-8")
        },
        script=script,
        script_hash=digest,
        pages=pages,
        sections=named,
        **{**empty, **parts},
    )


def section(title: str, content: str) -> str:
    """Make the HTML of a section from a heading (text) and its content (HTML)."""
    return _part("section", title, content)


def details(summary: str, content: str) -> str:
    """Make the HTML of a block that the reader can unfold, from a summary (text) and
    its content (HTML).
    """
    return _part("details", summary, content)


def paragraph(words: str, kind: str = "") -> str:
    """Make the HTML of a paragraph of text; ``kind`` "note" marks an explanation."""
    return _part("paragraph", words, kind)


def bullets(items: Iterable[str]) -> str:
    """Make the HTML of a bulleted list of texts."""
    return _part("bullets", items)


def table(head: Iterable[str], rows: Rows, caption: str = "", kind: str = "") -> str:
    """Make the HTML of a table whose first column holds row names."""
    return grouped_table(head, [("", rows)], caption, kind)


def grouped_table(
    head: Iterable[str],
    groups: Iterable[tuple[str, Rows]],
    caption: str,
    kind: str = "",
) -> str:
    """Make the HTML of a table with rows grouped under titles.

    Args:
        head: names of the columns; one that begins with ">" holds numbers and is set to
            the right.
        groups: (title or "", rows).
        caption: above it, or "".
        kind: class of its style; by its number of columns if left out.
    """
    names = list(head)
    kinds = [
        "num" if name[:1] == ">" else "unit" if name == "unit" else "" for name in names
    ]
    kind = kind or ("many" if len(names) > MANY else "few" if len(names) <= FEW else "")
    rows = [(title, [list(row) for row in some]) for title, some in groups]
    assert all(len(row) == len(names) for _, some in rows for row in some), (
        "a row has another number of columns"
    )
    return _part(
        "table", [name.removeprefix(">") for name in names], kinds, rows, caption, kind
    )


def image(
    alternative: str,
    caption: str,
    content: bytes,
    *,
    wide: bool = False,
    kind: str = "",
    name: str = "",
) -> str:
    """Make the HTML of an embedded picture with caption.

    Args:
        alternative: text in its place.
        caption: text below it.
        content: bytes of its PNG or WebP file.
        wide: takes all of the page's width; on a narrow screen it scrolls.
        kind: class of its style.
        name: identifier.
    """
    # a WebP file begins with these letters
    suffix = "webp" if content[:4] == b"RIFF" else "png"
    address = f"data:image/{suffix};base64,{base64.b64encode(content).decode('ascii')}"
    return _part(
        "figure", alternative, caption, address, kind or ("wide" if wide else ""), name
    )
