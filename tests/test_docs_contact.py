"""The tables of docs/contact.md name every field of the world with its default, every
shape and every kind.
"""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.records.immutable import stated_fields
from skyarm.world.contact import Contact, FreeObject, Gripper
from skyarm.world.contact.contact_point import ContactPoint, Ring
from skyarm.world.contact.free_object import SOLIDS
from skyarm.world.contact.grasp import KINDS as HOLDS
from skyarm.world.contact.grasp import Grasp
from skyarm.world.contact.gripper import KINDS
from skyarm.world.contact.material import Material
from skyarm.world.contact.surface import SHAPES, Surface
from support.pages import rows_of

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "contact.md").read_text("utf-8")
RECORD = "<!-- generated: record skyarm.world.contact"
TABLES = {
    f"{RECORD}:Contact": Contact,
    f"{RECORD}.surface:Surface": Surface,
    f"{RECORD}.material:Material": Material,
    f"{RECORD}.contact_point:ContactPoint": ContactPoint,
    f"{RECORD}.contact_point:Ring": Ring,
    f"{RECORD}:FreeObject": FreeObject,
    f"{RECORD}:Gripper": Gripper,
    f"{RECORD}.grasp:Grasp": Grasp,
}
"""Head of each table -> record that it lists."""


OTHERWISE = ((Surface, "material"), (FreeObject, "material"), (Grasp, "body"))
"""Fields that a file may leave out where the record may not, or must state."""


@pytest.mark.parametrize(
    ("head", "kind"), TABLES.items(), ids=[kind.__name__ for kind in TABLES.values()]
)
def test_a_table_lists_every_field_with_its_default(head: str, kind: type[Any]) -> None:
    rows = {row[0].strip("`"): row[2] for row in rows_of("contact.md", head)}
    fields = {
        field.name: field
        for field in dataclasses.fields(kind)
        if field.name in stated_fields(kind)
    }
    assert set(rows) == set(fields)
    for name, shown in rows.items():
        default = fields[name].default
        required = (
            default is dataclasses.MISSING
            and fields[name].default_factory is dataclasses.MISSING
        )
        assert (shown == "required") is required or (kind, name) in OTHERWISE, name
        if type(default) in (int, float) and shown != "no limit":
            assert float(shown.strip("`")) == default, name


def test_required_fields_come_first() -> None:
    for head in TABLES:
        shown = [row[2] == "required" for row in rows_of("contact.md", head)]
        assert shown == sorted(shown, reverse=True), head


def test_every_shape_and_every_kind_has_a_row() -> None:
    shapes = {
        name
        for row in rows_of("contact.md", f"{RECORD}.surface:Surface")
        if row[0] == "`shape`"
        for name in re.findall(r'"(\w+)"', row[3])
    }
    held, joined = (
        {name for row in rows for name in re.findall(r"`(\w+)`", row[0])}
        for rows in (
            rows_of("contact.md", "| kind | what it holds | releases at |"),
            rows_of("contact.md", "| kind | what it holds |\n"),
        )
    )
    spots = {
        name
        for row in rows_of("contact.md", "| shape | places |")
        for name in row[0].split(", ")
    }
    assert shapes == set(SHAPES)
    assert held == set(KINDS)
    assert joined == set(HOLDS)
    assert spots == set(SOLIDS)


def hover_in(shown: str) -> skyarm.Scenario:
    """A hover 1 m above the origin in the world of a block of the page."""
    return skyarm.scenario_from(
        {
            "name": "shown",
            "duration": 1.0,
            "plant": {"vehicle": "hummingbird_arm2_rotors"},
            "controller": {"preset": "paper_ct"},
            "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
            **tomllib.loads(shown),
        }
    )


def test_the_ball_shown_hangs_at_the_tip() -> None:
    _, shown = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    log = skyarm.run(hover_in(shown))
    assert log.status == "completed"
    # m g / k of the spring: 0.06 mm
    assert abs(log.object_position - log.tip).max() < 1e-4


def test_the_smallest_world_shown_is_one() -> None:
    shown, _ = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    scenario = hover_in(shown)
    (surface,) = scenario.world.surfaces
    (point,) = scenario.world.points
    assert (surface.name, surface.shape, point.frame) == ("ground", "plane", "tip")
