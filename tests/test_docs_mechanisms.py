"""The pages on mechanisms name every field of a mechanism, and every kind with the
lengths that it takes.
"""

import re
import tomllib
from dataclasses import fields
from pathlib import Path

from skyarm.world.contact import Detent, Mechanism
from skyarm.world.contact.contact_point import Ring
from skyarm.world.contact.mechanism import BRISTLES, KINDS
from skyarm.world.contact.surface import SIZES
from support.pages import rows_of

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGE = (DOCS / "mechanisms.md").read_text("utf-8")
REFERENCE = "scenario_mechanisms.md"
RECORD = "<!-- generated: record skyarm.world.contact"
WORDS = rows_of(REFERENCE, "| kind | motion | `size` |")


def test_every_field_has_a_row():
    for kind in (Mechanism, Detent):
        rows = rows_of(REFERENCE, f"{RECORD}:{kind.__name__} -->")
        named = [row[0].strip("`") for row in rows]
        assert sorted(named) == sorted(field.name for field in fields(kind))


def test_the_kinds_that_are_allowed_are_those_of_the_library():
    rows = rows_of(REFERENCE, f"{RECORD}:Mechanism -->")
    (allowed,) = (row[3] for row in rows if row[0] == "`kind`")
    assert re.findall(r'"(\w+)"', allowed) == [*KINDS]
    (default,) = (row[2] for row in rows if row[0] == "`bristle`")
    assert default == f"{BRISTLES[True]:g} rad or {BRISTLES[False]:g} m"


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
    ring = ", ".join(field.name for field in fields(Ring))
    assert f"`ring = {{ {ring} }}`" in " ".join(told.split())


def test_the_button_shown_is_that_of_the_example():
    (shown,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    flown = tomllib.loads((ROOT / "examples" / "push_a_button.toml").read_text("utf-8"))
    assert tomllib.loads(shown)["world"]["mechanisms"] == flown["world"]["mechanisms"]
