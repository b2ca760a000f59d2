"""The tables of docs/mechanisms.md name every field of a mechanism, and every word with
the lengths that it takes.
"""

import re
import tomllib
from dataclasses import fields
from pathlib import Path

from skyarm.world.contact import Detent, Mechanism
from skyarm.world.contact.contact_point import Ring
from skyarm.world.contact.mechanism import KINDS
from skyarm.world.contact.surface import SIZES
from support.pages import rows_of

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGE = (DOCS / "mechanisms.md").read_text("utf-8")
ROWS = rows_of(
    "mechanisms.md", "| `[[world.mechanisms]]` | type and unit | default | meaning |"
)
WORDS = rows_of("mechanisms.md", "| kind | motion | `size` |")


def test_every_field_has_a_row():
    named = [
        name
        for row in ROWS
        if row[0].startswith("`")
        for name in re.findall(r"`(\w+)`", row[0])
    ]
    assert sorted(named) == sorted(field.name for field in fields(Mechanism))
    (detent,) = (row for row in ROWS if row[0] == "`detent`")
    assert {field.name for field in fields(Detent)} == set(
        re.findall(r"\w+", detent[1].split("}")[0])
    )


def test_every_word_has_a_row_with_its_lengths():
    rows = {row[0].strip('`"'): row for row in WORDS}
    assert set(rows) == {word for word, kind in KINDS.items() if kind.sizes}
    for word, row in rows.items():
        assert all(", ".join(lengths) in row[2] for lengths in KINDS[word].sizes)


def test_the_hole_and_the_ring_are_told_with_their_lengths():
    told = PAGE.split("## A peg in a hole")[1].split("\n## ")[0]
    assert [told.index(word) for word in SIZES] == sorted(
        told.index(word) for word in SIZES
    )
    assert f"`ring = {{ {', '.join(field.name for field in fields(Ring))} }}`" in told


def test_the_button_shown_is_that_of_the_example():
    (shown,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    flown = tomllib.loads((ROOT / "examples" / "push_a_button.toml").read_text("utf-8"))
    assert tomllib.loads(shown)["world"]["mechanisms"] == flown["world"]["mechanisms"]
