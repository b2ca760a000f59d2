"""Whether a law counts on the torque of joints that nothing drives."""

from __future__ import annotations

from collections.abc import Iterator

from skyarm.control.catalogue import BEARS_UNDRIVEN
from skyarm.registry.shipped import SHIPPED
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle.undriven import undriven_joints


def law_of_undriven(scenario: Scenario) -> Iterator[str]:
    """A line about a shipped law that asks for torques which the plant's passive joints never give.

    Such a law takes the reaction of those torques into the base's: a slung load falls within seconds.
    """
    free = undriven_joints(scenario.world.vehicle, [each.joint for each in scenario.joint_drives])
    name = scenario.controller.name.removeprefix("guarded_")
    law = "centroidal" if name.startswith("centroidal_") else name
    if free and law in SHIPPED["law"] and law not in BEARS_UNDRIVEN:
        joints = f"joint{'s' if len(free) > 1 else ''} {', '.join(free)}"
        others = f"{', '.join(BEARS_UNDRIVEN[:-1])} or {BEARS_UNDRIVEN[-1]}"
        yield (
            f"controller.law = {law!r}: counts on the torque of {joints}, which no drive gives (effort_limit 0); "
            f"{others}, which leave passive joints alone?"
        )
