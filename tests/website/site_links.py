"""Every link of the built site leads somewhere on it, and nothing is loaded from
another host.

What a browser would follow or load is read from the pages themselves: files, anchors,
style sheets, scripts, pictures. Addresses of other hosts are looked at only as text:
nothing here asks the network.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

FOLLOWED = {"a": "href", "area": "href"}
LOADED = {
    "link": "href",
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "audio": "src",
    "object": "data",
    "image": "href",
    "use": "href",
}
"""Element -> attribute that names what a browser follows, or loads by itself."""

STYLED = re.compile(r"url\(\s*['\"]?([^'\")]+)")


@dataclass
class Page(HTMLParser):
    """Anchors of a page, and what it links to and loads."""

    anchors: set[str] = field(default_factory=set)
    followed: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.anchors |= {str(found[key]) for key in ("id", "name") if found.get(key)}
        if tag in FOLLOWED and found.get(FOLLOWED[tag]):
            self.followed.append(str(found[FOLLOWED[tag]]))
        if tag == "link" and found.get("rel") in (
            "canonical",
            "prev",
            "next",
            "alternate",
        ):
            return
        if tag in LOADED and found.get(LOADED[tag]):
            self.loaded.append(str(found[LOADED[tag]]))


@cache
def read_page(path: Path) -> Page:
    """A page of the site, read."""
    page = Page()
    page.feed(path.read_text("utf-8"))
    return page


def is_address(text: str) -> bool:
    """Whether an address of another host is well formed: a host with a dot, no blank,
    no bracket left over.
    """
    parts = urlsplit(text)
    return (
        parts.scheme in ("http", "https")
        and re.fullmatch(r"[\w-]+(\.[\w-]+)+(:\d+)?", parts.netloc) is not None
    )


def wrong_link(site: Path, page: Path, link: str) -> str | None:
    """What is wrong with a link; None if it leads somewhere."""
    if link.startswith(("http:", "https:", "//")):
        return None if is_address(link) else "is no address"
    if re.match(r"(mailto|javascript|data):", link):
        return None
    parts = urlsplit(link)
    target = page if not parts.path else (page.parent / unquote(parts.path)).resolve()
    if target.is_dir():
        target = target / "index.html"
    if not target.is_relative_to(site.resolve()) or not target.is_file():
        return "leads to no file of the site"
    anchor = unquote(parts.fragment)
    if (
        anchor
        and target.suffix == ".html"
        and anchor not in read_page(target).anchors
        and not anchor.startswith(":~:")
    ):
        return f"{target.name} has no such anchor"
    return None


def broken(site: Path) -> Iterator[str]:
    """One line for each link that leads nowhere and for each thing that would be loaded
    from another host.
    """
    site = site.resolve()
    for path in sorted(site.rglob("*.html")):
        if "recordings" in path.relative_to(site).parts[:1] or path.name == "404.html":
            continue
        page, name = read_page(path), path.relative_to(site)
        for link in dict.fromkeys([*page.followed, *page.loaded]):
            wrong = wrong_link(site, path, link)
            if wrong:
                yield f"{name}: {link}: {wrong}"
        for link in page.loaded:
            if link.startswith(("http:", "https:", "//")):
                yield f"{name}: {link}: is loaded from another host"
    for path in sorted(site.rglob("*.css")):
        for link in STYLED.findall(path.read_text("utf-8", errors="replace")):
            if link.startswith(("http:", "https:", "//")):
                yield f"{path.relative_to(site)}: {link}: is loaded from another host"
