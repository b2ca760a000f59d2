"""Marks of readers belong to the pages that they read."""

from __future__ import annotations

import page_marks
import pytest

TEXT = "\n".join(f"line {k} of a page that somebody reads once" for k in range(90))


def test_a_text_keeps_its_sketch_and_a_changed_one_loses_as_much_as_changed() -> None:
    known = page_marks.sketch(TEXT)
    assert len(known) == 4 * page_marks.LINES
    assert page_marks.left(known, TEXT) == 1.0
    assert (
        page_marks.left(
            known, TEXT.replace("  ", " ") + "\nmore of it, further down the page"
        )
        == 1.0
    )
    changed = TEXT.replace("1", "one")
    rows = TEXT.splitlines()
    same = sum(row in changed.splitlines() for row in rows) / len(rows)
    assert page_marks.left(known, changed) == pytest.approx(same, abs=0.15)
    assert page_marks.left(known, "another page\n" * 9) == 0.0


def test_marks_are_noted_beside_those_of_other_pages(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(page_marks, "MARKS", tmp_path / "marks.toml")
    page_marks.note("docs/b.md", [8.5, 9], TEXT)
    page_marks.note("docs/a.md", [7.25], "a page of one line, long enough to count")
    page_marks.note("docs/b.md", [9.0, 9.25], TEXT)
    assert list(page_marks.marked()) == ["docs/a.md", "docs/b.md"]
    assert page_marks.marked()["docs/b.md"]["marks"] == [9.0, 9.25]


@pytest.mark.parametrize("page", page_marks.marked())
def test_a_page_that_changed_by_a_third_has_no_mark(page: str) -> None:
    entry = page_marks.marked()[page]
    assert all(0.0 <= mark <= 10.0 for mark in entry["marks"])
    text = (page_marks.ROOT / page).read_text("utf-8")
    assert page_marks.left(entry["sketch"], text) >= page_marks.LEAST, (
        f"{page}: read it anew, or remove its mark"
    )
