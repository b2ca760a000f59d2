"""Pages of docs as the site's builder takes them: links out of docs lead to copies,
drawings and formulas are inside.

A page stays readable where it lies: what is changed here is changed in a copy. Taken
from outside of docs are the pages of the repository (``REPOSITORY``), the examples,
parts of pages that lie beside their code (``JOINED``), and single files that a page
links to.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from site_maths import with_mathml
from site_recordings import ASKED

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

REPOSITORY = {
    "README.md": "readme.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "CHANGELOG_ARCHIVE.md": "changelog_archive.md",
    "SECURITY.md": "security.md",
}
"""Page of the repository -> its name on the site."""

EQUATIONS = ROOT / "src/skyarm/control/laws/centroidal/equations"
JOINED = {EQUATIONS: "centroidal_law_specification.md"}
"""Folder of Markdown beside code -> the page of the site of which its files are
parts."""

LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\[\]]*\])*\]\()([^()\s]+)(\))")
"""``[words](target)`` and ``![words](target)``."""

MENU = re.compile(r"<details>\n<summary>All pages</summary>\n.*?</details>\n", re.S)
"""List of all pages on the home page, which the site has as its menu."""

PARTS = re.compile(r"^<!-- joined: (\S+) -->$", re.M)
"""A place for the files of a folder, one after the other."""

FENCE = re.compile(r"^( *)(`{3,}|~{3,}).*?^\1\2[ \t]*$", re.M | re.S)
"""A fenced block, which is shown as it stands."""

DRAWING = re.compile(r"^!\[([^\]]*)\]\(([^)\s]+\.svg)\)$", re.M)
"""A drawing that has a line of its own."""

ALERT = re.compile(
    r"^> \[!(NOTE|TIP|IMPORTANT|WARNING|CAUTION)\]\n((?:>.*(?:\n|\Z))+)", re.M
)
"""A warning as GitHub shows it: a quotation whose first line is its kind."""


def outside_fences(text: str, change: Callable[[str], str]) -> str:
    """Text with everything but its fenced blocks changed."""
    parts, last = [], 0
    for fence in FENCE.finditer(text):
        parts += [change(text[last : fence.start()]), fence[0]]
        last = fence.end()
    return "".join([*parts, change(text[last:])])


def outside_spans(text: str, change: Callable[[str], str]) -> str:
    """Text changed, but for spans of code that show a link."""
    kept: list[str] = []

    def hide(span: re.Match[str]) -> str:
        if "](" not in span[0]:
            return span[0]
        kept.append(span[0])
        return f"\0{len(kept) - 1}\0"

    return re.sub(
        r"\0(\d+)\0",
        lambda found: kept[int(found[1])],
        change(re.sub(r"`[^`\n]*`", hide, text)),
    )


def site_name(path: Path) -> str | None:
    """Where a file of the repository stands on the site, from its root; None for what
    has no place there.
    """
    inside = path.relative_to(ROOT).as_posix()
    if path.parent in JOINED and path.suffix == ".md":
        return JOINED[path.parent]
    if inside in REPOSITORY:
        return REPOSITORY[inside]
    if path.is_relative_to(DOCS):
        name = path.relative_to(DOCS).as_posix()
        if name.startswith("notebooks/") and name.endswith(".py"):
            return name.replace(".py", ".md")
        return (
            re.sub(r"(^|/)README\.md$", r"\1index.md", name)
            if path.is_file()
            else f"{name}/index.md"
        )
    if inside == "examples":
        return "examples/index.md"
    if inside.startswith("examples/") and path.suffix == ".py":
        return inside.replace(".py", ".md")
    return f"files/{inside}" if path.is_file() else None


def relink(text: str, page: Path, name: str, taken: dict[str, Path]) -> str:
    """Text whose links lead to where their targets are on the site.

    Args:
        page: the file that the text is of. name: of the page on the site.
        taken: files that have to be copied, by their name on the site; what is found is
            added.

    Raises:
        ValueError: a link that leads to no file, or to a folder that the site does not
            have.
    """
    up = "../" * name.count("/")

    def one(link: re.Match[str]) -> str:
        target, hash_, anchor = link[2].partition("#")
        if not target or re.match(r"[a-z]+:", target):
            return link[0]
        path = (page.parent / target).resolve()
        if not path.exists() or not path.is_relative_to(ROOT):
            raise ValueError(
                f"{page.relative_to(ROOT)}: link '{link[2]}': must lead to a file of"
                " the repository"
            )
        there = site_name(path)
        if there is None:
            raise ValueError(
                f"{page.relative_to(ROOT)}: link '{link[2]}': the site has no such"
                " folder"
            )
        if path.is_file() and not there.endswith(".md"):
            taken[there] = path
        return f"{link[1]}{up}{there}{hash_}{anchor}{link[3]}"

    return outside_fences(
        text, lambda part: outside_spans(part, lambda words: LINK.sub(one, words))
    )


def with_drawings(text: str, page: Path) -> str:
    """Text with its drawings inside, so that they take the colours of the page around
    them.
    """

    def one(found: re.Match[str]) -> str:
        svg = (page.parent / found[2]).read_text("utf-8")
        svg = re.sub(r"<\?xml.*?\?>|<style>.*?</style>", "", svg, flags=re.S).strip()
        words = found[1].replace('"', "&quot;")
        svg = svg.replace("<svg ", f'<svg role="img" aria-label="{words}" ', 1)
        return f'<div class="drawing">\n{svg}\n</div>'

    return outside_fences(text, lambda part: DRAWING.sub(one, part))


def with_admonitions(text: str) -> str:
    """Text with GitHub's warnings in the form of the site's builder."""

    def one(found: re.Match[str]) -> str:
        lines = [re.sub("^> ?", "", line) for line in found[2].splitlines()]
        body = "\n".join(f"    {line}".rstrip() for line in lines)
        return f"!!! {found[1].lower()}\n\n{body}\n"

    return outside_fences(text, lambda part: ALERT.sub(one, part))


def with_recordings(text: str, name: str, recordings: Path | None) -> str:
    """Text with each recording in a frame of its own; without one that was not made.

    Args:
        name: of the page on the site. recordings: folder of ``NAME.html``; None if
            there is none.
    """
    up = "../" * name.count("/")

    def one(found: re.Match[str]) -> str:
        if recordings is None or not (recordings / f"{found[1]}.html").is_file():
            return ""
        source = f"{up}recordings/{found[1]}.html"
        frame = (
            f'<iframe class="recording" loading="lazy" title="{found[2]}"'
            f' src="{source}"></iframe>'
        )
        return (
            f'<figure markdown="0">{frame}<figcaption>{found[2]}</figcaption></figure>'
        )

    return ASKED.sub(one, text)


def with_parts(text: str, name: str, taken: dict[str, Path]) -> str:
    """Text with the files of a folder in their place, two levels of headings lower."""

    def one(found: re.Match[str]) -> str:
        parts = sorted((ROOT / found[1]).glob("*.md"))
        assert parts, f"{name}: no files in {found[1]}"
        return "\n".join(
            outside_fences(
                relink(part.read_text("utf-8"), part, name, taken),
                lambda words: re.sub(r"^#", "###", words, flags=re.M),
            )
            for part in parts
        )

    return PARTS.sub(one, text)


def staged(
    page: Path, recordings: Path | None, taken: dict[str, Path]
) -> tuple[str, str]:
    """Name on the site and text of a page."""
    name = site_name(page)
    assert name is not None
    text = page.read_text("utf-8")
    if page.suffix == ".md":
        text = with_parts(relink(text, page, name, taken), name, taken)
    return name, staged_text(text, page, name, recordings)


def staged_text(text: str, page: Path, name: str, recordings: Path | None) -> str:
    """A page's text with drawings, warnings, recordings and formulas in their
    places.
    """
    if "![" in text and ".svg" in text:
        # the link was already turned to the site's name, which a drawing inside docs
        # shares with its file
        text = with_drawings(text, DOCS / name)
    text = MENU.sub("", text)
    return with_mathml(with_recordings(with_admonitions(text), name, recordings))


def example_page(path: Path) -> str:
    """The page of an example: what its first lines say as text, then its code."""
    words, code = _words_and_code(path)
    first, _, rest = words.partition("\n")
    said = f"{first.rstrip('.')}.\n\n{rest.strip()}".strip()
    flies = "__main__" in code or not REGISTERS.search(code)
    command = f"```sh\npython examples/{path.name}\n```\n\n" if flies else ""
    return f"# {path.name}\n\n{said}\n\n{command}```python\n{code}\n```\n"


def _words_and_code(path: Path) -> tuple[str, str]:
    """Docstring of an example, and what follows it."""
    _, words, code = path.read_text("utf-8").split('"""', 2)
    return words.strip(), code.strip()


REGISTERS = re.compile(r"skyarm\.register\.|-> skyarm\.Controller")
"""Code of an example that adds a part to the library."""


def examples_index(paths: list[Path]) -> str:
    """The page that lists the examples by what their first lines say."""
    parts = [path for path in paths if REGISTERS.search(path.read_text("utf-8"))]
    others = [path for path in paths if path not in parts]
    return (
        "# Recipes and examples\n\nEach is one commented file in the folder `examples`"
        " of the repository. A file that adds a part is a plugin. Most are programs,"
        " too: `python examples/own_wind.py` flies the part, and prints what stands"
        " beside its `print` lines.\n\n"
        f"## Parts of your own\n\n{_listed(parts, 'what it adds')}\n"
        f"## Flights and training\n\n{_listed(others, 'what it does')}"
    )


def _listed(paths: list[Path], column: str) -> str:
    """Table of examples with the first line of each."""
    firsts = [_words_and_code(path)[0].splitlines()[0] for path in paths]
    rows = [
        f"| [{path.name}]({path.stem}.md) | {first.rstrip('.').replace('|', '')} |"
        for path, first in zip(paths, firsts, strict=True)
    ]
    return f"| file | {column} |\n| --- | --- |\n" + "\n".join(rows) + "\n"
