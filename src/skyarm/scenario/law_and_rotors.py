"""Whether a law flies rotors without the order in which it would give up what does not fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from skyarm.actuation import AllocationError, make_mixer
from skyarm.control.vectored_layer import pairs_model, turns_rotors
from skyarm.scenario.scenario_record import Scenario


def law_without_priorities(scenario: Scenario) -> Iterator[str]:
    """A line about a centroidal law whose believed rotors allow no priorities, and why.

    Demands beyond a rotor's range are then cut rotor by rotor, and ``yaw_slack`` is not used.
    """
    controller = scenario.controller
    par: Any = controller.par  # layers share model and mixer, which stand with the outermost
    if not controller.name.removeprefix("guarded_").startswith("centroidal_") or par.mixer.policy != "clip":
        return
    model = pairs_model(par.model) if turns_rotors(controller) else par.model
    try:
        make_mixer(model.vehicle, "priority")
    except AllocationError as error:
        yield (
            f"controller.law = 'centroidal': cuts what is beyond a rotor's range rotor by rotor, and has no yaw_slack: "
            f"{error}; both are there where all rotors lift"
        )
