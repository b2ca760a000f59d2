"""What the plant with MuJoCo's own contacts cannot do is refused, in one line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from skyarm.files import shown

if TYPE_CHECKING:
    from skyarm.scenario.scenario_record import Scenario

MUJOCO_CONTACTS = "mujoco_contacts"
"""Name of the plant."""

_OURS = "must be 'rigid_body' or 'mujoco'"


def finds_contacts(scenario: Scenario) -> bool:
    """Whether the scenario's plant has contacts of its own."""
    return scenario.plant == MUJOCO_CONTACTS


def usual_integrator(plant: Any) -> str:
    """The integrator of a plant where nothing is said."""
    return "euler" if plant == MUJOCO_CONTACTS else "rk4"


def check_mujoco_contacts(scenario: Scenario) -> None:
    """Refuse a scenario that MuJoCo's contacts cannot fly.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if not finds_contacts(scenario):
        return
    said = f"plant.kind = {shown(scenario.plant)}"
    if scenario.contact is None:
        raise ValueError(f"{said}: {_OURS} without a [world], of which nothing can be touched")
    if scenario.integrator != "euler":
        raise ValueError(
            f"plant.integrator = {shown(scenario.integrator)}: must be 'euler' of plant.kind = 'mujoco_contacts'"
        )
    vehicle = scenario.world.vehicle
    if vehicle.followers:
        raise ValueError(f"{said}: {_OURS} for vehicle {vehicle.name!r}, whose joints follow others")
    if any(payload.rigid for payload in scenario.payloads):
        raise ValueError(f"{said}: {_OURS} with [[payloads]]; objects and grippers do what they do")
    if any(fault.stuck for fault in scenario.faults):
        raise ValueError(f"{said}: {_OURS} with a joint that gets stuck (environment.faults)")
    holes = [each.name for each in scenario.contact.surfaces if each.shape == "hole"]
    holes += [each.name for carrier in scenario.contact.carriers for each in carrier.surfaces if each.shape == "hole"]
    if holes:
        raise ValueError(f"{said}: {_OURS} with a hole ({holes[0]!r}), of which MuJoCo has no shape")
