"""skyarm: aerial manipulation. Multirotors that carry robot arms: dynamics, control, simulation.

The names here are stable. Arrays in, arrays out; SI units and radians; quaternions wxyz, body to world.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from skyarm.control.model import Model
    from skyarm.control.presets import preset
    from skyarm.control.registry import Controller, make_controller
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
    from skyarm.plant.interface import World
    from skyarm.plant.sensors import SensorNoise
    from skyarm.reference import Ramp, Sine, Trajectory, circle, hover
    from skyarm.simulate import Delays, Log, Rates, Scenario, ScenarioError, run
    from skyarm.simulate.scenario_file import list_scenarios, load_scenario, scenario_from
    from skyarm.vehicle import Body, Frame, Joint, Link, Rotor, Vehicle, VehicleError
    from skyarm.vehicle.files import list_vehicles, load_vehicle

_ROOMS = {
    "skyarm.control.model": ("Model",),
    "skyarm.control.presets": ("preset",),
    "skyarm.control.registry": ("Controller", "make_controller"),
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
    "skyarm.plant.interface": ("World",),
    "skyarm.plant.sensors": ("SensorNoise",),
    "skyarm.reference": ("Ramp", "Sine", "Trajectory", "circle", "hover"),
    "skyarm.simulate": ("Delays", "Log", "Rates", "Scenario", "ScenarioError", "run"),
    "skyarm.simulate.scenario_file": ("list_scenarios", "load_scenario", "scenario_from"),
    "skyarm.vehicle": ("Body", "Frame", "Joint", "Link", "Rotor", "Vehicle", "VehicleError"),
    "skyarm.vehicle.files": ("list_vehicles", "load_vehicle"),
}
_HOME = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "Body",
    "Controller",
    "Delays",
    "Frame",
    "Joint",
    "Link",
    "Log",
    "Model",
    "Ramp",
    "Rates",
    "Rotor",
    "Scenario",
    "ScenarioError",
    "SensorNoise",
    "Sine",
    "Trajectory",
    "Vehicle",
    "VehicleError",
    "World",
    "__version__",
    "center_of_mass",
    "circle",
    "energy",
    "euler_lagrange",
    "forward_dynamics",
    "frame_jacobian",
    "frame_pose_world",
    "hover",
    "inverse_dynamics",
    "list_scenarios",
    "list_vehicles",
    "load_scenario",
    "load_vehicle",
    "make_controller",
    "mass_matrix",
    "momentum",
    "preset",
    "reproduce",
    "run",
    "scenario_from",
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
