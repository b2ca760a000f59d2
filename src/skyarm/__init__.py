"""skyarm: aerial manipulation. Multirotors that carry robot arms: dynamics, control, simulation.

The names here are stable. Arrays in, arrays out; SI units and radians; quaternions wxyz, body to world.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.3.0"

if TYPE_CHECKING:
    from skyarm.algebra import Mat3, Quaternion, Vec3
    from skyarm.algebra.scalars.philox import normals
    from skyarm.control.catalogue import Controller, make_controller, preset
    from skyarm.control.model import Model
    from skyarm.dynamics import State
    from skyarm.dynamics.actuators import Command
    from skyarm.dynamics.actuators.drive import Drive
    from skyarm.dynamics.array_front import (
        center_of_mass,
        energy,
        forward_dynamics,
        frame_jacobian,
        frame_pose_world,
        inverse_dynamics,
        mass_matrix,
        momentum,
    )
    from skyarm.flight_data.flight_data import load_flight
    from skyarm.log.flight_log import Log
    from skyarm.log.formats import LogFormat, load_log, save_log
    from skyarm.log.metrics.metric import Metric
    from skyarm.log.metrics.score import score
    from skyarm.log.metrics.windows import Windows
    from skyarm.paper.reproduce import reproduce
    from skyarm.plant.interface import Truth
    from skyarm.records.registry import load_plugin, register
    from skyarm.reference import Constant, Ramp, Reference, Sine, Trajectory, circle, hover
    from skyarm.scenario.controller_table import load_controller
    from skyarm.scenario.endings import Ending
    from skyarm.scenario.numbers import with_numbers
    from skyarm.scenario.path_governor import govern
    from skyarm.scenario.scenario_file import list_scenarios, load_scenario, scenario_from
    from skyarm.scenario.scenario_record import Change, Delays, JointDrive, NamedSensor, Rates, Scenario, ScenarioError
    from skyarm.sensing.estimate.estimator import Estimator
    from skyarm.sensing.measurement import Measurement, SensorNoise
    from skyarm.sensing.sensor import Sensor
    from skyarm.simulate.batch import Batch
    from skyarm.simulate.loop import replay, run
    from skyarm.simulate.session import Session
    from skyarm.simulate.user_code import check_law
    from skyarm.studies.identify.identify_flights import identify_flights
    from skyarm.studies.stability.along import margins
    from skyarm.studies.stability.hover_delay import hover_delay
    from skyarm.studies.sweep.runner import fly_sweep
    from skyarm.studies.sweep.study import StudyError
    from skyarm.studies.sweep.study_file import list_studies, load_study
    from skyarm.vehicle import Body, Frame, Joint, Link, Rotor, Vehicle, VehicleError
    from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
    from skyarm.view.figures.flight_plot import plot
    from skyarm.view.figures.study_figures import plot_sweep
    from skyarm.view.figures.vehicle_drawing import vehicle_drawing
    from skyarm.world import (
        Air,
        Fault,
        Force,
        ForceWind,
        Gust,
        HangingPayload,
        MovingAir,
        Payload,
        Reach,
        TimedPayload,
        Wrench,
    )
    from skyarm.world.contact import Contact, ContactPoint, Material, Surface

_ROOMS = {
    "skyarm.dynamics.actuators": ("Command",),
    "skyarm.dynamics.actuators.drive": ("Drive",),
    "skyarm.algebra": ("Mat3", "Quaternion", "Vec3"),
    "skyarm.world.contact": ("Contact", "ContactPoint", "Material", "Surface"),
    "skyarm.control.catalogue": ("Controller", "make_controller", "preset"),
    "skyarm.control.model": ("Model",),
    "skyarm.dynamics": ("State",),
    "skyarm.dynamics.array_front": (
        "center_of_mass",
        "energy",
        "forward_dynamics",
        "frame_jacobian",
        "frame_pose_world",
        "inverse_dynamics",
        "mass_matrix",
        "momentum",
    ),
    "skyarm.world": (
        "Air",
        "MovingAir",
        "Fault",
        "Force",
        "Gust",
        "Payload",
        "ForceWind",
        "HangingPayload",
        "Reach",
        "TimedPayload",
        "Wrench",
    ),
    "skyarm.sensing.estimate.estimator": ("Estimator",),
    "skyarm.view.figures.flight_plot": ("plot",),
    "skyarm.view.figures.study_figures": ("plot_sweep",),
    "skyarm.view.figures.vehicle_drawing": ("vehicle_drawing",),
    "skyarm.flight_data.flight_data": ("load_flight",),
    "skyarm.log.flight_log": ("Log",),
    "skyarm.log.formats": ("LogFormat", "load_log", "save_log"),
    "skyarm.log.metrics.metric": ("Metric",),
    "skyarm.log.metrics.score": ("score",),
    "skyarm.log.metrics.windows": ("Windows",),
    "skyarm.paper.reproduce": ("reproduce",),
    "skyarm.plant.interface": ("Truth",),
    "skyarm.reference": ("Constant", "Ramp", "Reference", "Sine", "Trajectory", "circle", "hover"),
    "skyarm.records.registry": ("load_plugin", "register"),
    "skyarm.algebra.scalars.philox": ("normals",),
    "skyarm.scenario.endings": ("Ending",),
    "skyarm.scenario.controller_table": ("load_controller",),
    "skyarm.scenario.numbers": ("with_numbers",),
    "skyarm.scenario.path_governor": ("govern",),
    "skyarm.scenario.scenario_file": ("list_scenarios", "load_scenario", "scenario_from"),
    "skyarm.scenario.scenario_record": (
        "Change",
        "Delays",
        "JointDrive",
        "NamedSensor",
        "Rates",
        "Scenario",
        "ScenarioError",
    ),
    "skyarm.sensing.measurement": ("Measurement", "SensorNoise"),
    "skyarm.sensing.sensor": ("Sensor",),
    "skyarm.simulate.batch": ("Batch",),
    "skyarm.simulate.loop": ("replay", "run"),
    "skyarm.simulate.session": ("Session",),
    "skyarm.simulate.user_code": ("check_law",),
    "skyarm.studies.identify.identify_flights": ("identify_flights",),
    "skyarm.studies.stability.along": ("margins",),
    "skyarm.studies.stability.hover_delay": ("hover_delay",),
    "skyarm.studies.sweep.runner": ("fly_sweep",),
    "skyarm.studies.sweep.study": ("StudyError",),
    "skyarm.studies.sweep.study_file": ("list_studies", "load_study"),
    "skyarm.vehicle": ("Body", "Frame", "Joint", "Link", "Rotor", "Vehicle", "VehicleError"),
    "skyarm.vehicle.vehicle_files": ("list_vehicles", "load_vehicle"),
}
_HOME = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "Air",
    "Batch",
    "Body",
    "Change",
    "Command",
    "Constant",
    "Contact",
    "ContactPoint",
    "Controller",
    "Delays",
    "Drive",
    "Ending",
    "Estimator",
    "Fault",
    "Force",
    "ForceWind",
    "Frame",
    "Gust",
    "HangingPayload",
    "Joint",
    "JointDrive",
    "Link",
    "Log",
    "LogFormat",
    "Mat3",
    "Material",
    "Measurement",
    "Metric",
    "Model",
    "MovingAir",
    "NamedSensor",
    "Payload",
    "Quaternion",
    "Ramp",
    "Rates",
    "Reach",
    "Reference",
    "Rotor",
    "Scenario",
    "ScenarioError",
    "Sensor",
    "SensorNoise",
    "Session",
    "Sine",
    "State",
    "StudyError",
    "Surface",
    "TimedPayload",
    "Trajectory",
    "Truth",
    "Vec3",
    "Vehicle",
    "VehicleError",
    "Windows",
    "Wrench",
    "__version__",
    "center_of_mass",
    "check_law",
    "circle",
    "energy",
    "fly_sweep",
    "forward_dynamics",
    "frame_jacobian",
    "frame_pose_world",
    "govern",
    "hover",
    "hover_delay",
    "identify_flights",
    "inverse_dynamics",
    "list_scenarios",
    "list_studies",
    "list_vehicles",
    "load_controller",
    "load_flight",
    "load_log",
    "load_plugin",
    "load_scenario",
    "load_study",
    "load_vehicle",
    "make_controller",
    "margins",
    "mass_matrix",
    "momentum",
    "normals",
    "plot",
    "plot_sweep",
    "preset",
    "register",
    "replay",
    "reproduce",
    "run",
    "save_log",
    "scenario_from",
    "score",
    "vehicle_drawing",
    "with_numbers",
]


def __getattr__(name: str) -> Any:
    """Import a public name or subpackage on first use, so that ``import skyarm`` stays fast."""
    from importlib import import_module
    from importlib.util import find_spec

    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    if not name.startswith("_") and find_spec(f"skyarm.{name}") is not None:
        return import_module(f"skyarm.{name}")
    raise AttributeError(f"module 'skyarm' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
