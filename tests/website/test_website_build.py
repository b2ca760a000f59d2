"""The site: its menu names every page, broken links are found, nothing is loaded from
elsewhere.
"""

from __future__ import annotations

import inspect
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from build_site import PAGES, SITE, build, lay_out, menu_of
from site_links import broken, is_address, read_page
from site_maths import formulas, mathml, rows_of, with_mathml
from site_recordings import RECORDINGS, asked_for, make_recordings
from site_reference import ROOMS, homes, reference_pages
from staged_pages import (
    DOCS,
    JOINED,
    ROOT,
    relink,
    site_name,
    staged,
    with_admonitions,
    with_drawings,
    with_recordings,
)

import skyarm

CONFIG: dict[str, Any] = yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))
TEXTS = {path: path.read_text("utf-8") for path in sorted(DOCS.rglob("*.md"))}
PARTS = {
    path: path.read_text("utf-8")
    for folder in JOINED
    for path in sorted(folder.glob("*.md"))
}
"""Files of which a page consists on the site."""
FORMULAS = sorted(
    {formula for text in (TEXTS | PARTS).values() for formula in formulas(text)}
)


def named(menu: Any) -> list[str]:
    """Pages of a menu."""
    if isinstance(menu, str):
        return [menu]
    return [
        page
        for entry in (menu if isinstance(menu, list) else menu.values())
        for page in named(entry)
    ]


def test_the_menu_names_every_page_once_and_no_other() -> None:
    menu = named(CONFIG["nav"])
    assert len(menu) == len(set(menu))
    here = {
        str(site_name(path)) for path in (*TEXTS, *(DOCS / "notebooks").glob("*.py"))
    }
    made = {
        "contributing.md",
        "changelog.md",
        "examples/index.md",
        "api/index.md",
    }
    assert set(menu) - made <= here
    # data pages are linked from the page whose numbers they hold, notebooks from the
    # page that they belong to
    linked = {name for name in here if name.startswith(("data/", "notebooks/"))}
    assert here - linked <= set(menu)
    texts = "".join(TEXTS.values())
    for path in (DOCS / "notebooks").glob("*.py"):
        assert f"](notebooks/{path.name})" in texts, path.name
    assert made <= set(menu)


def test_an_entry_without_its_page_is_left_out_with_its_empty_heading() -> None:
    text = (
        "nav:\n  - a.md\n  - Some:\n      - B: b.md\n      - C: c/d.md\n  - Last:"
        " e.md\n"
    )
    assert menu_of(text, ["a.md", "b.md", "c/d.md", "e.md"]) == text
    assert (
        menu_of(text, ["a.md", "c/d.md"])
        == "nav:\n  - a.md\n  - Some:\n      - C: c/d.md\n"
    )
    assert menu_of(text, ["a.md", "e.md"]) == "nav:\n  - a.md\n  - Last: e.md\n"


def test_the_site_needs_no_network_and_warnings_are_errors() -> None:
    assert CONFIG["strict"] is True
    assert CONFIG["theme"]["font"] is False
    assert CONFIG["use_directory_urls"] is False
    assert all("://" not in polyfill for polyfill in CONFIG["extra"]["polyfills"])


def slug(heading: str) -> str:
    """The anchor of a heading, as GitHub and the site make it."""
    words = re.sub(r"`|\*|\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", words).replace(" ", "-")


@pytest.mark.parametrize(
    "page",
    TEXTS | PARTS,
    ids=lambda page: page.relative_to(
        DOCS if page.is_relative_to(DOCS) else ROOT
    ).as_posix(),
)
def test_links_of_a_page_lead_to_files_and_headings(page: Path) -> None:
    """Of the pages as they lie, which is how GitHub shows them."""
    text = (TEXTS | PARTS)[page]
    text = re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)
    for target in re.findall(
        r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*\]\([^`\n]*`", "", text)
    ):
        if re.match(r"https?:", target):
            assert is_address(target), target
            continue
        name, _, anchor = target.partition("#")
        found = (page.parent / name).resolve() if name else page
        assert found.exists(), target
        if anchor and found.suffix == ".md":
            heads = re.findall(
                r"^#+ (.*)$",
                re.sub(
                    r"^```.*?^```$", "", found.read_text("utf-8"), flags=re.M | re.S
                ),
                re.M,
            )
            assert anchor in map(slug, heads), target


def test_a_link_that_leaves_docs_leads_to_a_page_or_a_copy() -> None:
    taken: dict[str, Path] = {}
    text = (
        "[a](../../README.md) [b](../../src/skyarm/__init__.py) [`c`](../laws.md#indi)"
        " `[d](e)` [f](https://x.org)"
    )
    page = DOCS / "notebooks" / "README.md"
    found = relink(text, page, "notebooks/index.md", taken)
    assert (
        found == "[a](../readme.md) [b](../files/src/skyarm/__init__.py)"
        " [`c`](../laws.md#indi) `[d](e)` [f](https://x.org)"
    )
    assert taken == {"files/src/skyarm/__init__.py": ROOT / "src/skyarm/__init__.py"}
    with pytest.raises(ValueError, match="must lead to a file of the repository"):
        relink("[x](nothing.md)", page, "notebooks/index.md", {})
    assert (
        relink("```sh\n[x](nothing.md)\n```", page, "notebooks/index.md", {})
        == "```sh\n[x](nothing.md)\n```"
    )


def test_files_beside_the_code_are_parts_of_their_page() -> None:
    """Each heading stands once, two levels lower, and links between files are anchors
    of the page.
    """
    pytest.importorskip("latex2mathml", reason="of the extra docs")
    for folder, name in JOINED.items():
        taken: dict[str, Path] = {}
        _, text = staged(DOCS / name, None, taken)
        heads = [slug(head) for head in re.findall(r"^#+ (.*)$", text, re.M)]
        assert len(heads) == len(set(heads))
        parts = [path for path in PARTS if path.parent == folder]
        assert len(parts) > 20
        for path in parts:
            first = PARTS[path].partition("\n")[0]
            assert f"\n##{first}\n" in text
        assert set(re.findall(rf"\]\({name}#([\w-]+)\)", text)) <= set(heads)
        assert "equations/" not in "".join(taken)


def test_a_recording_is_played_where_it_was_made_and_left_out_where_not(
    tmp_path: Path,
) -> None:
    text = "before\n\n<!-- recording: one | A flight. -->\n\nafter\n"
    assert with_recordings(text, "laws/a.md", None) == "before\n\n\n\nafter\n"
    assert with_recordings(text, "laws/a.md", tmp_path) == "before\n\n\n\nafter\n"
    (tmp_path / "one.html").write_bytes(b"x")
    shown = with_recordings(text, "laws/a.md", tmp_path)
    assert 'src="../recordings/one.html"' in shown
    assert "A flight." in shown


def test_a_drawing_stands_in_its_page_in_the_page_s_colours() -> None:
    shown = with_drawings("![Words](images/laws/indi.svg)\n", DOCS / "laws.md")
    assert shown.startswith('<div class="drawing">\n<svg role="img" aria-label="Words"')
    assert "currentColor" in shown
    assert "<style>" not in shown, "it would style the whole page"


def test_a_warning_of_github_is_one_of_the_site() -> None:
    text = (
        "Before.\n\n> [!WARNING]\n> Moving air acts\n> through `drag`.\n>\n> -"
        " so\n\nAfter.\n"
    )
    shown = (
        "Before.\n\n!!! warning\n\n    Moving air acts\n    through `drag`.\n\n    -"
        " so\n\nAfter.\n"
    )
    assert with_admonitions(text) == shown
    assert with_admonitions("> [!NOTE]\n> Last") == "!!! note\n\n    Last\n"
    assert with_admonitions("> A quotation.\n") == "> A quotation.\n"
    assert with_admonitions(f"```text\n{text}```\n") == f"```text\n{text}```\n"


def test_every_warning_of_a_page_has_a_kind_that_github_shows() -> None:
    shown = [
        line for text in TEXTS.values() for line in re.findall(r"^> \[!.*$", text, re.M)
    ]
    assert all(
        re.fullmatch(r"> \[!(NOTE|TIP|IMPORTANT|WARNING|CAUTION)\]", line)
        for line in shown
    )


@pytest.mark.parametrize(
    "drawing", sorted((DOCS / "images").rglob("*.svg")), ids=lambda path: path.stem
)
def test_a_drawing_has_no_colour_of_its_own(drawing: Path) -> None:
    text = re.sub(r"<style>.*?</style>", "", drawing.read_text("utf-8"))
    assert set(re.findall(r'stroke="([^"]+)"', text)) <= {"currentColor", "none"}
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
    assert "<title>" in text


def test_every_formula_is_understood() -> None:
    pytest.importorskip("latex2mathml", reason="of the extra docs")
    assert len(FORMULAS) > 60
    for formula in FORMULAS:
        assert all(
            mathml(each, "inline").startswith("<math")
            for row in rows_of(formula)
            for each in row
        )
    with pytest.raises(ValueError, match="formula not understood"):
        mathml(r"\nosuchcommand x", "inline")
    with pytest.raises(ValueError, match="formula not understood"):
        mathml(r"a &= b", "block")


def test_equations_of_a_block_are_elements_that_a_line_breaks_between() -> None:
    pytest.importorskip("latex2mathml", reason="of the extra docs")
    stacked = (
        "\\begin{aligned}\n& a \\leftarrow 1, \\quad b \\\\\n& e = \\frac{x \\quad"
        " y}{2}\n\\end{aligned}"
    )
    assert rows_of(stacked) == [[r"a \leftarrow 1,", "b"], [r"e = \frac{x \quad y}{2}"]]
    assert rows_of(r"a = \left( b \quad c \right)") == [
        [r"a = \left( b \quad c \right)"]
    ]
    shown = with_mathml(f"```math\n{stacked}\n```\n")
    assert (shown.count("<div>"), shown.count("<math")) == (2, 3)
    # all primes of a letter with an index stand high
    high = 3 * "<mi>&#x02032;</mi>"
    assert f"<msubsup><mi>p</mi><mi>d</mi><mrow>{high}</mrow></msubsup>" in mathml(
        "p_d" + 3 * "'", "inline"
    )


def test_formulas_are_drawn_by_the_browser() -> None:
    pytest.importorskip("latex2mathml", reason="of the extra docs")
    shown = with_mathml("In a line $`a_1`$.\n\n```math\n\\frac{1}{2}\n```\n")
    assert shown.count("<math") == 2
    assert "<mfrac><mrow><mn>1</mn></mrow><mrow><mn>2</mn></mrow></mfrac>" in shown
    assert with_mathml("$`a_1`$ begins").startswith("<span><math ")
    assert with_mathml("costs $5 and $6") == "costs $5 and $6"


def test_the_api_has_every_public_name() -> None:
    shown = {path.rpartition(".")[2] for paths in homes().values() for path in paths}
    pages = reference_pages()
    rooms = {name for name in skyarm.__all__ if inspect.ismodule(getattr(skyarm, name))}
    assert set(skyarm.__all__) - {"__version__"} - rooms <= shown
    # a room that is public as a whole has a page with all that it has
    for room in rooms:
        assert set(getattr(skyarm, room).__all__) <= shown
        assert f"api/{room}.md" in pages
    directives = re.findall(r"^::: (\S+)$", "\n".join(pages.values()), re.M)
    assert sorted(directives) == sorted(
        path for paths in homes().values() for path in paths
    )


def written(site: Path, **pages: str) -> Path:
    for name, text in pages.items():
        (site / f"{name}.html").write_text(text, "utf-8")
    read_page.cache_clear()
    return site


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    good = (
        '<p id="here"><a href="b.html#there">x</a><a href="#here">y</a><a'
        ' href="https://example.org/a">z</a></p>'
    )
    site = written(tmp_path, a=good, b='<p id="there"></p>')
    assert list(broken(site)) == []
    for wrong, words in (
        ('<a href="c.html">', "leads to no file"),
        ('<a href="b.html#where">', "no such anchor"),
        ('<a href="../secret.html">', "leads to no file"),
        ('<a href="https://">', "is no address"),
        (
            '<script src="https://example.org/x.js"></script>',
            "loaded from another host",
        ),
        ('<img src="missing.png">', "leads to no file"),
    ):
        assert any(
            words in line
            for line in broken(written(tmp_path, a=wrong, b='<p id="there"></p>'))
        ), wrong


def test_a_link_to_a_file_outside_of_the_site_is_broken_although_the_file_is_there(
    tmp_path: Path,
) -> None:
    (tmp_path / "secret.html").write_text("<p></p>", "utf-8")
    (tmp_path / "site").mkdir()
    site = written(tmp_path / "site", a='<a href="../secret.html">')
    assert any("leads to no file" in line for line in broken(site))


def test_what_the_builder_says_is_judged(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for code, out, err, wrong in (
        (0, "Build finished\nno issues found", "", False),
        (0, "Warning: page not in menu", "", True),
        (0, "", "2 warnings", True),
        (1, "Build finished", "", True),
        (1, "", "", True),
    ):
        done = subprocess.CompletedProcess([], code, out, err)
        monkeypatch.setattr(subprocess, "run", lambda *_, done=done, **__: done)
        assert bool(build(tmp_path / "mkdocs.yml")) == wrong, (code, out, err)


def test_a_room_without_a_heading_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(ROOMS, "vehicle")
    with pytest.raises(
        ValueError, match=r"rooms without a heading in site_reference.ROOMS: vehicle"
    ):
        reference_pages()


@pytest.mark.site
def test_the_site_that_was_built_is_whole() -> None:
    if not (SITE / "index.html").is_file():
        pytest.skip("no site here: 'make docs' builds it first")
    read_page.cache_clear()
    assert list(broken(SITE)) == []
    for page in set(named(CONFIG["nav"])):
        assert (SITE / page.replace(".md", ".html")).is_file(), page
    maths = (SITE / "mathematics.html").read_text("utf-8")
    assert maths.count("<math") > 50
    assert "$`" not in maths
    assert '<svg role="img"' in (SITE / "laws/centroidal.html").read_text("utf-8")
    for name in ("Vehicle", "Session"):
        assert any(
            f"{name}" in path.read_text("utf-8")
            for path in (SITE / "api").glob("*.html")
        )
    assert ":func:" not in "".join(
        path.read_text("utf-8") for path in (SITE / "api").glob("*.html")
    )


@pytest.mark.site
def test_a_warning_of_the_builder_is_an_error(tmp_path: Path) -> None:
    pytest.importorskip("zensical", reason="of the extra docs")
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages" / "index.md").write_text(
        "# Title\n\n[x](nowhere.md)\n", "utf-8"
    )
    config = tmp_path / "mkdocs.yml"
    config.write_text(
        "site_name: x\ndocs_dir: pages\nsite_dir: site\nstrict: true\n", "utf-8"
    )
    assert build(config)
    (tmp_path / "pages" / "index.md").write_text("# Title\n", "utf-8")
    assert build(config) == []


def test_pages_are_laid_out(tmp_path: Path) -> None:
    pytest.importorskip("latex2mathml", reason="of the extra docs")
    names = lay_out(tmp_path / "pages", notebooks=False)
    notebooks = {
        f"notebooks/{path.stem}.md" for path in (DOCS / "notebooks").glob("*.py")
    }
    assert set(named(CONFIG["nav"])) - notebooks <= set(names)
    assert (tmp_path / "pages" / "site.css").is_file()
    assert PAGES.is_relative_to(ROOT / "out"), "what is built is not committed"
    shutil.rmtree(tmp_path / "pages")


def test_a_page_of_the_repository_keeps_its_text() -> None:
    pytest.importorskip("latex2mathml", reason="of the extra docs")
    name, text = staged(ROOT / "README.md", None, {})
    assert name == "readme.md"
    assert "](the_paper.md)" in text
    assert "](your_vehicle.md)" in text


def test_pages_ask_for_every_recording_and_for_no_other() -> None:
    assert set(asked_for(list(TEXTS.values()))) == set(RECORDINGS)
    with pytest.raises(ValueError, match="recording 'nothing': must be one of case2, "):
        asked_for(["<!-- recording: nothing | Words. -->\n"])


@pytest.mark.site
def test_a_recording_is_one_page_that_asks_for_nothing_from_elsewhere(
    tmp_path: Path,
) -> None:
    pytest.importorskip("viser", reason="of the extra studio")
    (page,) = make_recordings(tmp_path, ["gust"])
    text = page.read_text("utf-8")
    assert page.name == "gust.html"
    assert "__VISER_EMBED_DATA__" in text
    assert not re.search(r'(?:src|href)="https?:', text)
