"""The tip errors with servos that docs/data/results_laws.md shows are those that are
flown.
"""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib
from typing import Any

import pytest

import skyarm
from skyarm.control.actuator_layer import with_actuators
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.scenario.controller_table import under_law
from skyarm.vehicle.vehicle_records import MountedDrive
from support.pages import DOCS, rows_of

EXAMPLE = (DOCS.parent / "examples" / "servo_quad.toml").read_text("utf-8")


def of_data_sheet() -> PositionServo:
    """The servo of the page, on a joint of 1e-4 kg m^2."""
    numbers = tomllib.loads(EXAMPLE)["drives"]["shoulder"]
    return PositionServo(
        **{name: value for name, value in numbers.items() if name != "kind"}
        | {"inertia": 1e-4}
    )


def ideal(ratio: float) -> PositionServo:
    return PositionServo(
        stiffness=40.0, damping=2.0 * ratio * math.sqrt(40.0 * 4e-4), inertia=2e-4
    )


def tip_error(servo: PositionServo | None) -> float:
    """Mean tip error of Case 3, mm."""
    scenario = under_law(skyarm.load_scenario("case3", duration=20.0), "centroidal_tip")
    if servo is not None:
        drives = tuple(
            MountedDrive(name=name, drive=servo) for name in ("joint1", "joint2")
        )

        def on_servos(record: Any) -> Any:
            return dataclasses.replace(
                record, vehicle=dataclasses.replace(record.vehicle, drives=drives)
            )

        controller = with_actuators(
            scenario.controller, on_servos(scenario.controller.par.model), 0.005
        )
        scenario = dataclasses.replace(
            scenario, plant=on_servos(scenario.plant), controller=controller
        )
    return (
        1e3
        * skyarm.score(skyarm.run(scenario), ["standard_continuous"])[
            "ee_error_mean_continuous"
        ]
    )


def shown_tables() -> list[str]:
    """TOML blocks of the page on drives."""
    return re.findall(
        r"```toml\n(.*?)```", (DOCS / "actuators.md").read_text("utf-8"), re.DOTALL
    )


def test_the_smallest_servo_of_the_page_has_the_required_keys() -> None:
    (shown,) = shown_tables()
    (servo,) = tomllib.loads(shown)["drives"].values()
    numbers = {name: value for name, value in servo.items() if name != "kind"}
    usual = {field.name: field.default for field in dataclasses.fields(PositionServo)}
    assert set(numbers) == {
        name for name, value in usual.items() if value is dataclasses.MISSING
    }
    assert servo["kind"] == "position_servo"
    assert PositionServo(**numbers).takes == "rad or m"


@pytest.mark.site
def test_tip_errors_on_servos_are_those_of_the_page() -> None:
    page = "data/results_laws.md"
    shown = [row[1] for row in rows_of(page, "| joints | tip error |")]
    servos = (None, of_data_sheet(), ideal(2.0))
    assert shown == [f"{tip_error(servo):.2f} mm" for servo in servos]
