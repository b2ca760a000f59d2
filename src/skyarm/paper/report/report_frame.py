"""What all pages of the report share: head and foot, links between them, styles, script, interactive plots."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from string import Template

from skyarm.figures.interactive import PanelsFigure, PathFigure, figure_json, plot_script, plot_style
from skyarm.paper.report.report_markup import section, text

MAIN = "report.html"
"""The page that leads to all others."""

NO_SCRIPT = "<noscript><p>The interactive plots need JavaScript; the static figures do not.</p></noscript>"


class Plots:
    """Interactive plots of one page: holders in the text, data at its end."""

    def __init__(self) -> None:
        self._specs: list[str] = []

    def add(self, figure: PanelsFigure | PathFigure, caption: str) -> str:
        """Place for a plot; its data are kept for the end of the page."""
        name = f"plot-{len(self._specs)}"
        self._specs.append(f'<script type="application/json" id="{name}">{figure_json(figure)}</script>')
        body = f'<div class="plot" data-plot="{name}" role="group" aria-label="{text(caption)}">{NO_SCRIPT}</div>'
        return f'<figure class="interactive">{body}<figcaption>{text(caption)}</figcaption></figure>'

    def data(self) -> str:
        """All specifications."""
        return "\n".join(self._specs)


@dataclass(frozen=True, kw_only=True)
class Page:
    """One page of the report.

    Attributes:
        title: of the page. lead, facts: first lines, as text. opening: what stands before all sections, as HTML.
        sections: (name in links, title, HTML).
        plots: whose holders stand in the sections.
    """

    title: str
    lead: str
    facts: str
    opening: str = ""
    sections: Sequence[tuple[str, str, str]]
    plots: Plots = field(default_factory=Plots)


def page_html(page: Page, name: str, pages: Mapping[str, str], schema: object) -> str:
    """A whole page: scripts, styles and pictures inside, no address outside the folder.

    Args:
        page: its content.
        name: of its file.
        pages: file -> short title of all pages, for the links between them.
        schema: of the results.
    """
    script = page_script()
    return Template(_resource("report_page.html")).substitute(
        title=text(page.title),
        style=_resource("report.css"),
        lead=text(page.lead),
        facts=text(page.facts),
        opening=page.opening,
        pages=_links(name, pages),
        contents="".join(f'<li><a href="#{each}">{text(title)}</a></li>' for each, title, _ in page.sections),
        body="\n".join(section(each, title, content) for each, title, content in page.sections),
        footer=f"Format of the results: schema {text(schema)}. This page needs no network.",
        data=page.plots.data(),
        plot_style=plot_style(),
        script=script,
        # the browser runs this script and no other, whatever stands in the page
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii"),
    )


def page_script() -> str:
    """The script of a page: it draws the interactive plots, and unfolds everything for the printer."""
    return plot_script() + _resource("report_print.js")


def _links(name: str, pages: Mapping[str, str]) -> str:
    """A link to every page; the one that is shown is named without a link."""
    return "".join(
        f'<li aria-current="page">{text(title)}</li>'
        if file == name
        else f'<li><a href="{text(file)}">{text(title)}</a></li>'
        for file, title in pages.items()
    )


def _resource(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
