"""Plain pages read back as a browser reads them: which text stands where, what is a
number, what is escaped.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from skyarm.view.pages import markup as plain
from skyarm.view.pages import sections
from skyarm.view.pages.sections import number


def parsed(text):
    return ElementTree.fromstring(f"<root>{text}</root>")


def test_title_and_facts_stand_in_their_places():
    text = plain.page("A <title>", "facts & figures", "<p>body</p>")
    assert "<title>A &lt;title&gt;</title>" in text
    assert "<h1>A &lt;title&gt;</h1>" in text
    assert '<p class="facts">facts &amp; figures</p>' in text
    assert text.count("<p>body</p>") == 1


def test_a_column_is_set_to_the_right_if_its_name_says_so_and_its_cells_with_it():
    found = parsed(
        plain.table(
            ["law", "remark", ">error", ">time"],
            [["a", "<b>", "1", "2"], ["c", "d", "3", "4"]],
        )
    )
    heads = found.findall(".//thead/tr/th")
    assert [(head.text, head.get("class")) for head in heads] == [
        ("law", None),
        ("remark", None),
        ("error", "num"),
        ("time", "num"),
    ]
    rows = found.findall(".//tbody/tr")
    assert [row.find("th").text for row in rows] == ["a", "c"]
    assert [
        [(cell.text, cell.get("class")) for cell in row.findall("td")] for row in rows
    ] == [
        [("<b>", None), ("1", "num"), ("2", "num")],
        [("d", None), ("3", "num"), ("4", "num")],
    ]


def test_rows_in_groups_have_a_heading_as_wide_as_the_table():
    found = parsed(
        plain.grouped_table(
            ["law", ">x"], [("fast", [["a", "1"]]), ("", [["b", "2"]])], caption="a & b"
        )
    )
    assert found.find(".//caption").text == "a & b"
    first, second = found.findall(".//tbody")
    assert (first[0].get("class"), first[0][0].get("colspan"), first[0][0].text) == (
        "group",
        "2",
        "fast",
    )
    assert (len(first), len(second)) == (2, 1)


@pytest.mark.parametrize("columns", [plain.MANY - 1, plain.MANY, plain.MANY + 1])
def test_only_a_table_of_many_columns_is_set_smaller(columns):
    found = parsed(plain.table([f"c{i}" for i in range(columns)], [["x"] * columns]))
    assert (found.find(".//table").get("class") == "many") == (columns > 9)


def test_a_wide_picture_says_so_and_every_text_is_escaped():
    for wide, kind in ((True, "wide"), (False, None)):
        text = plain.image('a "b"', "c < d", b"\x89PNG", wide=wide)
        found = parsed(text.replace("<figcaption>", "</img><figcaption>"))
        figure = found.find("figure")
        assert figure.get("class") == kind
        assert figure.find("img").get("alt") == 'a "b"'
        assert figure.find("img").get("src") == "data:image/png;base64,iVBORw=="
        assert figure.find("figcaption").text == "c < d"


@pytest.mark.parametrize(
    ("columns", "kind"), [(2, "few"), (3, "few"), (4, None), (9, None), (10, "many")]
)
def test_a_table_is_styled_by_the_number_of_its_columns(columns, kind):
    found = parsed(plain.table([f"c{i}" for i in range(columns)], [["x"] * columns]))
    assert found.find(".//table").get("class") == kind


def test_a_number_is_scaled_and_has_two_or_three_digits():
    assert [number(0.0123, 1e3), number(0.1234, 1e3), number(1.0), number(None)] == [
        "12.3",
        "123",
        "1.00",
        "-",
    ]


def test_a_table_in_markdown_has_its_caption_unless_its_section_is_called_so():
    table = sections.Table(head=["law", ">error"], rows=[["a", "1"]], caption="Laws")
    rows = "| law | error |\n| --- | ---: |\n| a | 1 |"
    assert table.markdown() == f"Laws:\n\n{rows}"
    assert table.markdown("Laws") == rows


def test_no_style_changes_the_colours_of_a_picture_in_the_dark():
    """They mean something: in a map that is inverted success is dark."""
    styles = [*Path(plain.__file__).parents[2].rglob("*.css")]
    assert len(styles) >= 3
    assert not [
        each.name
        for each in styles
        if re.search(r"invert|hue-rotate|mix-blend", each.read_text("utf-8"))
    ]
