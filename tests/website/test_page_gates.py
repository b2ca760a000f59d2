"""Long paragraphs and facts that stand on two pages are found, and nothing else."""

from __future__ import annotations

import page_gates
import page_twins
import pytest

LONG = "It stays where it is because nothing moves the arm. " * 10


@pytest.mark.parametrize(
    ("text", "kinds"),
    [
        (f"# T\n\n{LONG}\n", ["paragraph of 100 words"]),
        (f"# T\n\n* {LONG}\n* short\n", ["paragraph of 100 words"]),
        (f"# T\n\n{LONG[:400]}\n\n{LONG[:400]}\n", []),
        (f"# T\n\n<!-- generated: x -->\n{LONG}\n<!-- /generated -->\n", []),
        (f"# T\n\n```text\n{LONG}\n```\n", []),
        ("# T\n\nOne of 1 m, 2 m, 3 m and 4 m, which no rule forbids.\n", []),
    ],
)
def test_a_long_paragraph_is_a_fault_and_numbers_are_none(tmp_path, text, kinds):
    page = tmp_path / "page.md"
    page.write_text(text, "utf-8")
    assert [fault.kind for fault in page_gates.faults(page)] == kinds


@pytest.mark.parametrize(
    "page",
    [
        *sorted(page_gates.DOCS.glob("*.md")),
        *sorted((page_gates.DOCS / "laws").glob("*.md")),
        *(page_gates.ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
    ],
    ids=lambda page: page.relative_to(page_gates.ROOT).as_posix(),
)
def test_no_paragraph_of_a_page_is_long(page):
    assert [
        f"line {fault.line}: {fault.kind}"
        for fault in page_gates.faults(page)
        if fault.kind.startswith("paragraph")
    ] == []


HOME = """# A

The centroidal law holds the tip within 0.04 mm on the circle.

<!-- generated: record x -->
| field | type | meaning |
|-|-|-|
| `wait` | s | longest duration of the contact before the phase ends |
<!-- /generated -->
"""


def kinds(**pages: str) -> list[str]:
    """Kinds of the facts that stand twice."""
    return [fact.kind for fact in page_twins.facts(pages)]


@pytest.mark.parametrize(
    ("other", "kind"),
    [
        (
            "The error of the tip is 0.04 mm there, under the [centroidal law](x.md).",
            "0.04 mm",
        ),
        (
            "| field | meaning |\n|-|-|\n| `wait` | longest contact before the phase"
            " ends, a duration |",
            "field `wait`",
        ),
        (
            "So we know that the centroidal law holds the tip within 0.04 mm on the"
            " circle.",
            "same words",
        ),
        (
            "So *the [centroidal](x.md) law holds the tip within 0.04 mm* on the circle"
            " of a page that is long.",
            "same words",
        ),
    ],
)
def test_a_fact_on_two_pages_is_found(other: str, kind: str) -> None:
    assert kinds(a=HOME, b=f"# B\n\n{other}\n") == [kind]


def test_words_in_a_row_are_found_however_they_are_linked() -> None:
    said = "A flight is lost where it ends before its time or the tip is off by a metre"
    linked = said.replace("lost", "[lost](glossary.md#lost)")
    assert kinds(a=f"# A\n\n{said}.\n", b=f"# B\n\n* That is: {linked}.\n") == [
        "same words"
    ]


@pytest.mark.parametrize(
    "other",
    [
        "The battery sags by 0.04 mm of paper.",
        "The circle has a radius of 0.3 m.",
        "| field | meaning |\n|-|-|\n| `wait` | name of the vehicle |",
        "<!-- generated: y -->\nThe centroidal law holds the tip within 0.04 mm on the"
        " circle.\n<!-- /generated -->",
        "<!-- measured: y -->\nThe centroidal law holds the tip within 0.04 mm on the"
        " circle.\n<!-- /measured -->",
        "```text\nThe centroidal law holds the tip within 0.04 mm on the circle.\n```",
    ],
)
def test_another_fact_is_none(other: str) -> None:
    assert kinds(a=HOME, b=f"# B\n\n{other}\n") == []


def test_a_fact_on_three_pages_is_one_and_worse_than_one_on_two() -> None:
    held, wound = "The law holds its tip at 0.04 mm.", "A drum winds cable at 0.56 m."
    pages = {"a": held, "b": held, "c": f"{held} {wound}", "d": wound}
    first, second = page_twins.facts(pages)
    assert (first.kind, first.pages) == ("0.04 mm", {"a", "b", "c"})
    assert (second.kind, second.pages) == ("0.56 m", {"c", "d"})
    assert first.weight > second.weight


def test_the_pages_compared_are_those_that_somebody_wrote() -> None:
    names = set(page_twins.pages())
    assert {"first_flight.md", "glossary.md"} <= names
    assert not any(name.startswith(("data/", "README")) for name in names)
