"""Whether a law flies rotors without the order in which it would give up what does not fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from skyarm.actuation import AllocationError, make_mixer
from skyarm.scenario.scenario_record import Scenario


def law_without_priorities(scenario: Scenario) -> Iterator[str]:
    """A line about a centroidal law whose believed rotors allow no priorities, and why.

    Demands beyond a rotor's range are then cut rotor by rotor, and ``yaw_slack`` is not used.
    """
    par: Any = getattr(scenario.controller.par, "inner", scenario.controller.par)
    name = scenario.controller.name.removeprefix("guarded_")
    if not name.startswith("centroidal_") or par.mixer.policy != "clip":
        return
    try:
        make_mixer(scenario.controller.par.model.vehicle, "priority")
    except AllocationError as error:
        yield (
            f"controller.law = 'centroidal': cuts what is beyond a rotor's range rotor by rotor, and has no yaw_slack: "
            f"{error}; a layout whose rotors all lift?"
        )
