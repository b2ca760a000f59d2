"""Reference tables of the pages list the declared fields of their records, with their
defaults.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Set
from typing import Any

import pytest

from skyarm.dynamics.actuators.servo import PositionServo, Servo, VelocityServo
from skyarm.records.registry import find
from skyarm.records.registry.shipped import SHIPPED
from skyarm.scenario.endings import STATUSES
from skyarm.sensing import sensor_kinds
from skyarm.sensing.cameras import camera_kinds
from skyarm.sensing.channel import Channel, Dropouts
from skyarm.sensing.estimate.filter_constants import FilterNumbers
from skyarm.vehicle.battery import Battery
from skyarm.vehicle.thrust_table import COLUMNS
from support.pages import DOCS, rows_of

SERVO = "skyarm.dynamics.actuators.servo"


def fields_of(kind: type) -> dict[str, Any]:
    """Name -> default, MISSING for a required field."""
    return {field.name: field.default for field in dataclasses.fields(kind)}


def named(cells: str) -> list[str]:
    return re.findall(r"`(\w+)`", cells)


@pytest.mark.parametrize(
    ("page", "head", "kinds", "left_out"),
    [
        (
            "scenario_sensors.md",
            "<!-- generated: record skyarm.sensing.channel:Channel -->",
            (Channel,),
            set[str](),
        ),
        (
            "scenario_sensors.md",
            "<!-- generated: words estimator ekf",
            (FilterNumbers,),
            {"vehicle"},
        ),
        (
            "actuators.md",
            f"<!-- generated: record {SERVO}:PositionServo",
            (Servo, PositionServo),
            set[str](),
        ),
        (
            "actuators.md",
            f"<!-- generated: record {SERVO}:VelocityServo",
            (VelocityServo,),
            fields_of(Servo).keys(),
        ),
        (
            "actuators.md",
            "<!-- generated: record skyarm.vehicle.battery:Battery -->",
            (Battery,),
            set[str](),
        ),
    ],
)
def test_a_table_lists_every_field(
    page: str, head: str, kinds: tuple[type, ...], left_out: Set[str]
) -> None:
    listed = {name for row in rows_of(page, head) for name in named(row[0])}
    assert listed == {name for kind in kinds for name in fields_of(kind)} - left_out


@pytest.mark.parametrize(
    ("page", "head", "kind"),
    [
        (
            "scenario_sensors.md",
            "<!-- generated: words estimator ekf",
            FilterNumbers,
        ),
        (
            "actuators.md",
            "<!-- generated: record skyarm.vehicle.battery:Battery -->",
            Battery,
        ),
        (
            "actuators.md",
            f"<!-- generated: record {SERVO}:PositionServo",
            PositionServo,
        ),
    ],
)
def test_defaults_of_a_table_are_those_of_the_fields(
    page: str, head: str, kind: type
) -> None:
    own, seen = fields_of(kind), 0
    for names, *cells in rows_of(page, head):
        shown = next(
            (
                cell.strip("`")
                for cell in cells
                if re.fullmatch(r"`[-+]?\d[-+.\de]*`", cell)
            ),
            cells[-1],
        )
        for name, text in zip(named(names), shown.split(", "), strict=False):
            if name in own and re.fullmatch(r"[-+]?\d[-+.\de]*", text):
                assert own[name] == float(text), name
                seen += 1
    assert seen >= 3


def test_the_page_on_sensors_lists_kinds_and_dropouts() -> None:
    rows = rows_of("scenario_sensors.md", "<!-- generated: sensors -->")
    rows += rows_of("scenario_sensors.md", "<!-- generated: cameras -->")
    shipped = set(SHIPPED["sensor"]) - {"full_state"}
    assert {named(row[0])[0] for row in rows} == shipped
    shared = set(fields_of(sensor_kinds.ChannelSensor))
    shared |= set(fields_of(camera_kinds.RaySensor))
    listed: dict[str, set[str]] = {}
    for row in rows:
        listed.setdefault(named(row[0])[0], set()).update(named(row[1]))
    for name in shipped:
        assert set(fields_of(find("sensor", name))) - shared <= listed[name], name
    page = (DOCS / "scenario_sensors.md").read_text("utf-8")
    assert all(f"`{name}`" in page for name in (*shared, *fields_of(Dropouts)))


def test_the_columns_of_a_thrust_table_are_on_the_page() -> None:
    rows = rows_of(
        "actuators.md", "<!-- generated: record skyarm.vehicle.thrust_table:ThrustTable"
    )
    assert {name for row in rows for name in named(row[0])} == set(COLUMNS)


def test_every_ending_and_status_is_on_the_page() -> None:
    rows = rows_of("scenario_sensors.md", "| ending | status | condition |\n|-|-|-|")
    assert {name for row in rows for name in named(row[0])} == set(SHIPPED["ending"])
    assert {name for row in rows for name in named(row[1])} == set(STATUSES) - {
        "completed"
    }
