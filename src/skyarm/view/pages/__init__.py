"""Reports as self-contained HTML pages and as Markdown: titles, paragraphs, tables, pictures."""

from skyarm.view.pages.markup import (
    bullets,
    details,
    grouped_table,
    image,
    page,
    paragraph,
    render_template,
    section,
    table,
)
from skyarm.view.pages.sections import DASH, Mark, Report, Section, Table, markdown, number

__all__ = [
    "DASH",
    "Mark",
    "Report",
    "Section",
    "Table",
    "bullets",
    "details",
    "grouped_table",
    "image",
    "markdown",
    "number",
    "page",
    "paragraph",
    "render_template",
    "section",
    "table",
]
