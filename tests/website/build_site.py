"""Build the documentation site: lay the pages out, run the notebooks, build, check; a
warning is an error.

python tests/website/build_site.py            what `make docs` does; the site is
                                              out/docs/site/index.html
python tests/website/build_site.py pages      only lay the pages out, in out/docs/pages
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from percent_scripts import rendered, run_script
from site_links import broken
from site_recordings import asked_for, make_recordings
from site_reference import reference_pages
from staged_pages import (
    DOCS,
    REPOSITORY,
    ROOT,
    example_page,
    examples_index,
    staged,
    staged_text,
)

OUT = ROOT / "out" / "docs"
PAGES, SITE, RECORDINGS = OUT / "pages", OUT / "site", OUT / "recordings"
ROLE = re.compile(r":(?:py:)?(?:func|class|mod|data|meth|attr):(?=<code>|`)")
"""Marks of cross references in docstrings, which are Sphinx's and mean nothing here."""


def lay_out(
    pages: Path, *, recordings: Path | None = None, notebooks: bool = True
) -> list[str]:
    """Write every page of the site as Markdown, with what the pages show.

    Args:
        pages: the folder; what lies there is taken away first.
        recordings: folder of recordings, if they were made.
        notebooks: run the notebooks, for the pages of what they show.

    Returns:
        the names of the pages.
    """
    shutil.rmtree(pages, ignore_errors=True)
    taken: dict[str, Path] = {}
    texts: dict[str, str] = {}
    for page in (*sorted(DOCS.rglob("*.md")), *(ROOT / name for name in REPOSITORY)):
        name, texts[name] = staged(page, recordings, taken)
    examples = sorted((ROOT / "examples").glob("*.py"))
    texts |= {f"examples/{path.stem}.md": example_page(path) for path in examples}
    texts["examples/index.md"] = examples_index(examples)
    texts |= reference_pages()
    if notebooks:
        texts |= notebook_pages(recordings)
    for path in (
        path
        for folder in ("images", "theme")
        for path in (DOCS / folder).rglob("*")
        if path.is_file()
    ):
        taken[
            path.relative_to(
                DOCS / "theme" if "theme" in path.parts else DOCS
            ).as_posix()
        ] = path
    for name, text in texts.items():
        (pages / name).parent.mkdir(parents=True, exist_ok=True)
        (pages / name).write_text(text, "utf-8")
    for name, path in taken.items():
        (pages / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, pages / name)
    if recordings is not None and recordings.is_dir():
        shutil.copytree(recordings, pages / "recordings", dirs_exist_ok=True)
    return sorted(texts)


def notebook_pages(recordings: Path | None) -> dict[str, str]:
    """Pages of the notebooks, each run in an empty folder; pictures are inside."""
    texts = {}
    here = Path.cwd()
    for path in sorted((DOCS / "notebooks").glob("*.py")):
        work = OUT / "work" / path.stem
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir(parents=True)
        os.chdir(work)
        try:
            text, pictures = rendered(run_script(path), path.stem)
        finally:
            os.chdir(here)
        for name, svg in pictures.items():
            drawn = svg[svg.index("<svg") :]
            text = re.sub(
                rf"!\[([^\]]*)\]\({re.escape(name)}\)",
                lambda _, d=drawn: f'<div class="picture">\n{d}\n</div>',
                text,
            )
        name = f"notebooks/{path.stem}.md"
        texts[name] = staged_text(text, path, name, recordings)
    return texts


def without_roles(site: Path) -> None:
    """Take Sphinx's marks out of the built pages."""
    for path in (site / "api").rglob("*.html"):
        text = path.read_text("utf-8")
        path.write_text(ROLE.sub("", text), "utf-8")


ENTRY = re.compile(r"^ *- (?:.*: )?([\w/]+\.md)\n", re.M)
"""A line of the menu that names a page."""


def menu_of(text: str, pages: Iterable[str]) -> str:
    """The configuration without entries of pages that are not there, and without
    headings that are left empty.
    """
    there = set(pages)
    before, nav, menu = text.partition("nav:\n")
    menu = ENTRY.sub(lambda entry: entry[0] if entry[1] in there else "", menu)
    return before + nav + re.sub(r"^( *)- [^:\n]+:\n(?!\1 +-)", "", menu, flags=re.M)


def build(config: Path) -> list[str]:
    """Build the site; returns the lines of warnings and errors, none if all is well."""
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "zensical",
            "build",
            "--clean",
            "--strict",
            "-f",
            str(config),
        ],
        capture_output=True,
        text=True,
        check=False,
        cwd=config.parent,
    )
    told = (done.stdout + done.stderr).splitlines()
    wrong = [
        line
        for line in told
        if re.search(r"\b(warning|error)s?\b", line, re.I)
        and not re.search(r"\bno (issues|warnings)", line, re.I)
    ]
    if done.returncode and not wrong:
        wrong = told or [f"zensical ended with exit code {done.returncode}"]
    return (told or wrong) if wrong else []


def main() -> int:
    """Build the site, or only its pages; 0 if nothing is wrong."""
    try:
        return make_site()
    except ValueError as error:  # a link or a formula of a page
        print(error, file=sys.stderr)
        return 1


def make_site() -> int:
    """Recordings, pages, site, links; 0 if nothing is wrong."""
    began = time.perf_counter()
    shutil.rmtree(RECORDINGS, ignore_errors=True)
    recorded = make_recordings(
        RECORDINGS, asked_for([path.read_text("utf-8") for path in DOCS.rglob("*.md")])
    )
    print(
        f"{len(recorded)} recordings"
        + ("" if recorded else ", for want of the extra studio"),
        flush=True,
    )
    names = lay_out(PAGES, recordings=RECORDINGS if recorded else None)
    print(
        f"{len(names)} pages in {PAGES.relative_to(ROOT)},"
        f" {time.perf_counter() - began:.1f} s",
        flush=True,
    )
    if sys.argv[1:] == ["pages"]:
        return 0
    config = OUT / "mkdocs.yml"
    config.write_text(menu_of((ROOT / "mkdocs.yml").read_text("utf-8"), names), "utf-8")
    wrong = build(config)
    if not wrong:
        without_roles(SITE)
        wrong = list(broken(SITE))
    for line in wrong:
        print(line, file=sys.stderr)
    print(
        f"{len(wrong)} warnings; {(SITE / 'index.html').relative_to(ROOT)},"
        f" {time.perf_counter() - began:.1f} s"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
