"""Tables of the public names of skyarm: by job, with call, result, errors and guide;
arguments of its functions.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence
from typing import Any

import skyarm

Row = Sequence[str]

FUNCTIONS = {
    "fly": {
        "run": "first_flight.md",
        "replay": "logs.md",
        "govern": "tip_and_tasks.md",
        "with_numbers": "add_a_law.md",
        "compare": "comparing_laws.md",
        "fly_sweep": "sweeps.md",
        "reproduce": "the_paper.md",
    },
    "load": {
        "load_scenario": "scenario_files.md",
        "load_vehicle": "vehicle_files.md",
        "load_study": "sweeps.md",
        "load_task": "planning_tasks.md",
        "load_log": "logs.md",
        "load_flight": "identification.md",
        "load_controller": "tuning.md",
        "load_plugin": "extending.md",
        "list_scenarios": "scenario_files.md",
        "list_vehicles": "vehicle_files.md",
        "list_studies": "sweeps.md",
        "save_scenario": "scenario_files.md",
        "save_log": "logs.md",
    },
    "make": {
        "circle": "scenario_files.md",
        "hover": "scenario_files.md",
        "scenario_from": "scenario_files.md",
        "preset": "laws.md",
        "make_controller": "laws.md",
        "plan": "plan_a_flight.md",
    },
    "judge": {
        "score": "metrics.md",
        "plot": "pictures.md",
        "plot_sweep": "pictures.md",
        "film": "pictures.md",
        "vehicle_drawing": "pictures.md",
        "check": "checks.md",
        "margins": "margins.md",
        "hover_delay": "margins.md",
        "tune": "tuning.md",
        "identify_flights": "identification.md",
    },
    "extend": {
        "register": "extending.md",
        "check_law": "add_a_law.md",
        "make_mixer": "add_a_law.md",
        "mix": "add_a_law.md",
        "normals": "../examples/own_wind.py",
    },
    "dynamics": {
        "mass_matrix": "mathematics.md",
        "center_of_mass": "mathematics.md",
        "frame_jacobian": "mathematics.md",
        "frame_pose_world": "mathematics.md",
        "energy": "mathematics.md",
        "momentum": "mathematics.md",
        "inverse_dynamics": "mathematics.md",
        "forward_dynamics": "mathematics.md",
    },
}
"""Job -> functions with the page that shows each, the usual ones first."""

CLASSES = {
    "flights": {
        "Scenario": "scenario_files.md",
        "Session": "python_api.md",
        "Batch": "python_api.md",
        "Log": "log_arrays.md",
        "Windows": "metrics.md",
        "Rates": "scenario_files.md",
        "Delays": "scenario_files.md",
        "Change": "scenario_files.md",
        "State": "mathematics.md",
    },
    "vehicles": {
        "Vehicle": "vehicle_files.md",
        "Link": "vehicle_files.md",
        "Joint": "vehicle_files.md",
        "Body": "vehicle_files.md",
        "Rotor": "vehicle_files.md",
        "Frame": "vehicle_files.md",
        "JointDrive": "actuators.md",
        "Truth": "scenario_files.md",
        "Model": "scenario_files.md",
    },
    "motions": {
        "Trajectory": "scenario_files.md",
        "Reference": "add_a_law.md",
        "Constant": "scenario_files.md",
        "Ramp": "scenario_files.md",
        "Sine": "scenario_files.md",
        "Task": "planning_tasks.md",
        "Plan": "planning_tasks.md",
    },
    "world": {
        "ForceWind": "disturbances_and_payloads.md",
        "MovingAir": "disturbances_and_payloads.md",
        "Gust": "disturbances_and_payloads.md",
        "Payload": "disturbances_and_payloads.md",
        "TimedPayload": "disturbances_and_payloads.md",
        "HangingPayload": "disturbances_and_payloads.md",
        "Reach": "disturbances_and_payloads.md",
        "Fault": "disturbances_and_payloads.md",
        "Contact": "contact.md",
        "ContactPoint": "contact.md",
        "Surface": "contact.md",
        "Material": "contact.md",
    },
    "laws": {
        "Controller": "add_a_law.md",
        "Command": "add_a_law.md",
        "Measurement": "add_a_law.md",
        "Mixer": "add_a_law.md",
        "SensorNoise": "sensors.md",
    },
    "bases": {
        "Air": "../examples/own_wind.py",
        "Force": "../examples/own_force.py",
        "Wrench": "../examples/own_force.py",
        "Sensor": "../examples/gps.py",
        "NamedSensor": "../examples/gps.py",
        "Estimator": "../examples/gps.py",
        "Drive": "../examples/own_drive.py",
        "Ending": "../examples/own_ending.py",
        "Metric": "../examples/own_metric.py",
        "Team": "team_laws.md",
        "LogFormat": "../examples/own_log_format.py",
    },
    "numbers": {
        "Vec3": "mathematics.md",
        "Quaternion": "mathematics.md",
        "Mat3": "mathematics.md",
    },
    "errors": {"ScenarioError": "", "VehicleError": "", "StudyError": ""},
}
"""Job -> classes with the page that explains each."""

PUBLIC = "__all__"
"""Name of the list of public names, which the stub does not declare."""


def first_line(thing: object) -> str:
    """Summary of a docstring, its first paragraph as one line, without markup of
    Sphinx.
    """
    summary = (inspect.getdoc(thing) or "").partition("\n\n")[0]
    return without_markup(" ".join(summary.split()))


def without_markup(text: str) -> str:
    """Words of a docstring as Markdown."""
    return re.sub(r":\w+:`~?([^`]*)`", r"`\1`", text).replace("``", "`")


def names_by_kind() -> dict[str, list[str]]:
    """Public names of skyarm: functions, classes and modules."""
    found: dict[str, list[str]] = {"functions": [], "classes": [], "modules": []}
    for name in sorted(set(getattr(skyarm, PUBLIC)) - {"__version__"}):
        thing = getattr(skyarm, name)
        kind = (
            "classes"
            if inspect.isclass(thing)
            else "modules"
            if inspect.ismodule(thing)
            else "functions"
        )
        found[kind].append(name)
    return found


def require_all(kind: str, jobs: dict[str, dict[str, str]]) -> None:
    """Raise ValueError if a public name has no job, or a job has a name that is not
    public.
    """
    listed = [name for job in jobs.values() for name in job]
    if wrong := set(listed) ^ set(names_by_kind()[kind]):
        raise ValueError(
            f"python_names: {kind}: without a job, or not public:"
            f" {', '.join(sorted(wrong))}"
        )


def call_of(name: str) -> str:
    """Call of a function: its arguments, those that may be left out with "=", those
    that need a name after "*".
    """
    thing = getattr(skyarm, name)
    if not inspect.isfunction(thing):
        return name
    words: list[str] = []
    for each in inspect.signature(thing).parameters.values():
        if each.kind is inspect.Parameter.KEYWORD_ONLY and "*" not in words:
            words.append("*")
        words.append(argument_in_call(each))
    return f"{name}({', '.join(words)})"


def argument_in_call(argument: inspect.Parameter) -> str:
    """Name of an argument, with "=" if it may be left out and "**" if it stands for
    several.
    """
    if argument.kind is inspect.Parameter.VAR_KEYWORD:
        return f"**{argument.name}"
    return (
        argument.name
        if argument.default is inspect.Parameter.empty
        else f"{argument.name}="
    )


def errors_of(thing: object) -> str:
    """Names of the errors that a docstring lists."""
    _, _, listed = (inspect.getdoc(thing) or "").partition("Raises:")
    return ", ".join(
        f"`{name}`" for name in dict.fromkeys(re.findall(r"\b(\w+Error):", listed))
    )


def type_in_words(annotation: object) -> str:
    """Type of an argument or a result without None, which its default shows."""
    if annotation is inspect.Parameter.empty:
        return ""
    text = str(annotation).strip("'")
    for ours, word in (
        ("PathLike", "path"),
        ("ArrayLike", "array"),
        ("Array", "array"),
    ):
        text = text.replace(ours, word)
    text = re.sub(r"\bstr \| Path\b", "path", text)
    return f"`{text}`" if text == "None" else f"`{text.replace(' | None', '')}`"


def default_in_words(argument: inspect.Parameter) -> str:
    """Default of an argument."""
    if argument.kind is inspect.Parameter.VAR_KEYWORD:
        return "none"
    if argument.default is inspect.Parameter.empty:
        return "required"
    value: Any = argument.default
    if value is None or value in ((), ""):
        return "none"
    return f"`{value}`" if not isinstance(value, str) else f'`"{value}"`'


def words_of_arguments(thing: object) -> dict[str, str]:
    """Meaning of each argument by the section "Args" of a docstring."""
    words: dict[str, str] = {}
    name, inside = "", False
    for line in (inspect.getdoc(thing) or "").split("\n"):
        if not line.startswith(" "):
            inside = line.strip() == "Args:" or (inside and not line.strip())
        elif inside and (begun := re.match(r"    (\w+): (.*)", line)):
            name = begun[1]
            words[name] = begun[2]
        elif inside and name:
            words[name] += f" {line.strip()}"
    return {
        name: without_markup(text).removesuffix(".") for name, text in words.items()
    }


def functions_of(job: str) -> tuple[Row, list[Row]]:
    """Heads and rows: functions of a job with call, result, errors and guide."""
    require_all("functions", FUNCTIONS)
    rows: list[Row] = []
    for name, page in FUNCTIONS[job].items():
        thing = getattr(skyarm, name)
        result = (
            type_in_words(inspect.signature(thing).return_annotation)
            if inspect.isfunction(thing)
            else ""
        )
        rows.append(
            (
                f"`{call_of(name)}`",
                first_line(thing),
                result,
                errors_of(thing),
                guide(page),
            )
        )
    return ("call", "meaning", "returns", "raises", "guide"), rows


def arguments_of(job: str) -> tuple[Row, list[Row]]:
    """Heads and rows: every argument of the functions of a job."""
    rows: list[Row] = []
    for name in FUNCTIONS[job]:
        thing = getattr(skyarm, name)
        if not inspect.isfunction(thing):
            continue
        words = words_of_arguments(thing)
        for argument in inspect.signature(thing).parameters.values():
            shown = (
                type_in_words(argument.annotation),
                default_in_words(argument),
                words.get(argument.name, ""),
            )
            rows.append((f"`{name}`", f"`{argument.name}`", *shown))
    return ("function", "argument", "type", "default", "meaning"), rows


def classes_of(job: str) -> tuple[Row, list[Row]]:
    """Heads and rows: classes of a job with their guide."""
    require_all("classes", CLASSES)
    rows: list[Row] = [
        (f"`skyarm.{name}`", first_line(getattr(skyarm, name)), guide(page))
        for name, page in CLASSES[job].items()
    ]
    return ("name", "meaning", "guide"), rows


def modules_of() -> tuple[Row, list[Row]]:
    """Heads and rows: modules whose names are used with that of the module."""
    return ("name", "meaning"), [
        (f"`skyarm.{name}`", first_line(getattr(skyarm, name)))
        for name in names_by_kind()["modules"]
    ]


def guide(page: str) -> str:
    """Link to a page by its name without underscores, or to an example."""
    if page.startswith("../"):
        return f"[{page.rpartition('/')[2]}]({page})"
    return f"[{page.removesuffix('.md').replace('_', ' ')}]({page})" if page else ""
