"""Reports as self-contained HTML pages and as Markdown: titles, paragraphs, tables,
pictures.
"""

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
from skyarm.view.pages.sections import (
    DASH,
    Facts,
    Line,
    Mark,
    Report,
    Section,
    Table,
    heading,
    markdown,
    number,
    table_of,
)

__all__ = [
    "DASH",
    "Facts",
    "Line",
    "Mark",
    "Report",
    "Section",
    "Table",
    "bullets",
    "details",
    "grouped_table",
    "heading",
    "image",
    "markdown",
    "number",
    "page",
    "paragraph",
    "render_template",
    "section",
    "table",
    "table_of",
]
