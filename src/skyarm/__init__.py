"""skyarm: aerial manipulation. Multirotors that carry robot arms: dynamics, control, simulation.

The names here are stable. Arrays in, arrays out; SI units and radians; quaternions wxyz, body to world.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from skyarm.dynamics import euler_lagrange
    from skyarm.dynamics.arrays import (
        center_of_mass,
        energy,
        forward_dynamics,
        frame_jacobian,
        frame_pose_world,
        inverse_dynamics,
        mass_matrix,
        momentum,
    )
    from skyarm.experiments.reproduce import reproduce
    from skyarm.simulate import Log, Scenario, run
    from skyarm.simulate.scenario_file import list_scenarios, load_scenario
    from skyarm.vehicle import Body, Frame, Joint, Link, Rotor, Vehicle, VehicleError
    from skyarm.vehicle.files import list_vehicles, load_vehicle

_ROOMS = {
    "skyarm.dynamics.arrays": (
        "center_of_mass",
        "energy",
        "forward_dynamics",
        "frame_jacobian",
        "frame_pose_world",
        "inverse_dynamics",
        "mass_matrix",
        "momentum",
    ),
    "skyarm.experiments.reproduce": ("reproduce",),
    "skyarm.simulate": ("Log", "Scenario", "run"),
    "skyarm.simulate.scenario_file": ("list_scenarios", "load_scenario"),
    "skyarm.vehicle": ("Body", "Frame", "Joint", "Link", "Rotor", "Vehicle", "VehicleError"),
    "skyarm.vehicle.files": ("list_vehicles", "load_vehicle"),
}
_HOME = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "Body",
    "Frame",
    "Joint",
    "Link",
    "Log",
    "Rotor",
    "Scenario",
    "Vehicle",
    "VehicleError",
    "__version__",
    "center_of_mass",
    "energy",
    "euler_lagrange",
    "forward_dynamics",
    "frame_jacobian",
    "frame_pose_world",
    "inverse_dynamics",
    "list_scenarios",
    "list_vehicles",
    "load_scenario",
    "load_vehicle",
    "mass_matrix",
    "momentum",
    "reproduce",
    "run",
]


def __getattr__(name: str) -> Any:
    """Import a public name's room when it is first used, so that ``import skyarm`` stays light."""
    from importlib import import_module

    if name == "euler_lagrange":
        return import_module("skyarm.dynamics.euler_lagrange")
    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'skyarm' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
