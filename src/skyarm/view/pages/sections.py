"""Report as data (sections of notes, tables and pictures), written as Markdown or
HTML.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from skyarm.view.pages.markup import grouped_table, page, paragraph, section

DASH = "-"


@dataclass(frozen=True, kw_only=True, slots=True)
class Mark:
    """Table cell with formatting besides text: exact value, emphasis, explanation,
    link.

    Attributes:
        text: text of the cell. value: its whole number, for machines.
        strong: set bold. title: explanation of the text, or the level of a finding.
            href: file that it leads to.
    """

    text: str
    value: float | None = None
    strong: bool = False
    title: str = ""
    href: str = ""

    def __str__(self) -> str:
        return self.text


Row = Sequence[str | Mark]
Groups = Sequence[tuple[str, Sequence[Row]]]


def number(quantity: float | None, factor: float = 1.0) -> str:
    """Format a number with two or three significant digits; a dash for None."""
    if quantity is None:
        return DASH
    value = quantity * factor
    if value >= 100.0:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 10.0 else f"{value:.2f}"


def markdown(head: Iterable[str], rows: Iterable[Row]) -> str:
    """Format a table as Markdown; columns whose names begin with ">" are
    right-aligned.
    """
    names = list(head)
    rules = ["---:" if name[:1] == ">" else "---" for name in names]
    lines = [[name.removeprefix(">") for name in names], rules, *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


@dataclass(frozen=True, kw_only=True, slots=True)
class Table:
    """Table of a report: column names, rows of text and a caption.

    Attributes:
        head: names of the columns; ">" begins that of numbers.
        rows: one for each line, under the titles of ``groups`` where these are given.
        caption: caption of the table.
        groups: (title, rows) on a page.
    """

    head: Sequence[str]
    rows: Sequence[Row]
    caption: str = ""
    groups: Groups = ()

    def markdown(self, under: str = "") -> str:
        """Markdown of a report's table, under its caption unless that repeats the title
        of the table's section.
        """
        lead = f"{self.caption}:\n\n" if self.caption not in ("", under) else ""
        return lead + markdown(self.head, self.rows)

    def html(self) -> str:
        """HTML of a report's table."""
        return grouped_table(self.head, self.groups or [("", self.rows)], self.caption)


Facts: TypeAlias = dict[str, Any]
"""Facts of a report as plain data."""

Line: TypeAlias = str | Mark | Table
"""Line of a printed report: text, text with emphasis, or a table."""


def heading(text: str) -> Mark:
    """Text of a heading, marked as bold."""
    return Mark(text=text, strong=True)


def table_of(
    head: Sequence[str], rows: Iterable[Row], *, left: int = 1, title: str = ""
) -> Table:
    """Table with a title for terminal output; the first ``left`` columns hold text, the
    others numbers.
    """
    return Table(
        head=[name if i < left else f">{name}" for i, name in enumerate(head)],
        rows=[*rows],
        caption=title,
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Section:
    """Section of a report: title, notes, tables and pictures.

    Attributes:
        title: heading; "" for what stands under the report's own in Markdown.
        notes: paragraphs. remark: a paragraph of the page alone. name: heading of a
            page's section without a title.
        tables: below them. pictures: HTML of :func:`skyarm.view.pages.image` s, on the
            page alone.
    """

    title: str = ""
    notes: Sequence[str] = ()
    remark: str = ""
    name: str = ""
    tables: Sequence[Table] = ()
    pictures: str = ""

    def markdown(self) -> list[str]:
        """List the Markdown blocks of a report's section: heading, notes and tables."""
        head = [f"## {self.title}"] if self.title else []
        return [
            *head,
            *self.notes,
            *(each.markdown(self.title) for each in self.tables),
        ]

    def html(self) -> str:
        """HTML of a report's section."""
        return section(self.title or self.name, self.content())

    def content(self) -> str:
        """Make the HTML of a report's section without its heading: notes, pictures and
        tables.
        """
        notes = [
            paragraph(words, "note")
            for words in (*self.notes, *([self.remark] if self.remark else ()))
        ]
        return "".join([*notes, self.pictures, *(each.html() for each in self.tables)])


@dataclass(frozen=True, kw_only=True, slots=True)
class Report:
    """Report with a title and sections, to be written as Markdown or HTML.

    Attributes:
        title: heading. facts: first line of the page.
        sections: sections of both forms. page_only: further ones of the page.
        opening: HTML before all sections.
    """

    title: str
    facts: str
    sections: Sequence[Section]
    page_only: Sequence[Section] = ()
    opening: str = ""

    def markdown(self) -> str:
        """Markdown of the report."""
        blocks = [block for each in self.sections for block in each.markdown()]
        return "\n\n".join([f"# {self.title}", *blocks]) + "\n"

    def html(self) -> str:
        """HTML page of the report, in one file."""
        body = [
            self.opening,
            *(each.html() for each in (*self.sections, *self.page_only)),
        ]
        return page(self.title, self.facts, "\n".join(body))
