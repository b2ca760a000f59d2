"""Scenarios from TOML files.

A file has ``schema = 1``, ``name``, ``duration`` (s) and these tables::

    [rates]       physics, control, reference (Hz; 1000, 200, 50)
    [plant]       vehicle, gravity (9.81), kind ("rigid_body", "mujoco", "mujoco_contacts"),
                  integrator ("rk4", "euler", "rk4_staged"),
                  payload = { mass, frame }, joints = { damping, coulomb, coulomb_rate, effort_limit,
                  armature, stop_stiffness, stop_damping }, each a number
                  for every joint or a list of one for each
    [model]       vehicle, gravity (9.81), payload, joints: what the controller believes
    [controller]  preset, or law with gains = { position, velocity, attitude, rate } (three numbers each),
                  joint_gains = { stiffness, damping } (one number a joint); mixer, rate_error,
                  without = ["coriolis", "coupling", "full_gravity", "feedforward"];
                  friction_compensation, rate_weights (one number a joint);
                  safety = true, or a table of limits (skyarm.control.safety.limits)
    [reference]   see skyarm.reference.reference_tables; joined (s): the law rests at the reference of t = 0 until then;
                  governor = true, or a table of limits (skyarm.scenario.path_governor)
    [environment] wind (see skyarm.environment.environment_tables), ground (true),
                  faults = [{ rotor or joint = name, effectiveness (a number or a signal), start }],
                  or { joint = name, stuck = true, start }
                  [[environment.air]], [[environment.forces]] kind = NAME and its numbers, added to the wind
    [sensors]     one sigma: position, velocity, attitude, rate, specific_force, joints, joint_rates, rotor_speeds
    [sensors.X]   kind = NAME and its numbers: a sensor beside the full state, X to the estimator
    [estimator]   kind = NAME and its numbers: from all readings to what the law is told
    [plant.drives.JOINT]  kind = NAME and its numbers: what the joint's setpoint means
    [[endings]]   kind = NAME and its numbers, beside the library's
    [plugins]     need = [names]: plugins that must be loaded; a file never loads one itself
    [delays]      measurement, command, and on top of it rotors, joints (s); longest_command
    [initial]     position, quaternion_wxyz, velocity, rate, joints, joint_rates, rotor_speeds; left out: hover trim;
                  standing = true sets the vehicle down on what is below it, at rest (skyarm.scenario.standing_start)
    [windows]     when its metrics look: steady, transient, gust, hover = [start, stop), s; holds = [...]; last = s
    [[changes]]   at (s), path, value: what is other from then on (:mod:`skyarm.scenario.in_flight`)
    [world]       [[world.surfaces]], [[world.points]]: what the vehicle may touch, and where (skyarm.contact)
    [[payloads]]  mass, frame, pick, drop: loads picked up and set down in flight (skyarm.scenario.payload_tables)
    seed, episode

A vehicle is a name of the library or a path beside the file. Without [model] the controller believes the plant's
vehicle and gravity, but knows of no payload. Every error is one line: file, field, value, what is allowed.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from skyarm.control.model import Model
from skyarm.environment import NO_WIND, faults_from, wind_from
from skyarm.files import (
    Fields,
    all_wrong_words,
    did_you_mean,
    file_name,
    number,
    one_line,
    read_toml,
    shown,
    unreadable,
)
from skyarm.files.names import require_kind
from skyarm.metrics.windows import Windows, windows_from
from skyarm.plant.interface import Truth
from skyarm.reference.tip_tables import reference_from
from skyarm.registry import names
from skyarm.scenario import registered_tables as added
from skyarm.scenario import scenario_tables as tables
from skyarm.scenario.change_checks import require_changes
from skyarm.scenario.changes import Change, changes_from, require_within, without_law
from skyarm.scenario.law_by_name import loop_facts
from skyarm.scenario.mujoco_contact_checks import usual_integrator
from skyarm.scenario.path_governor import with_governor
from skyarm.scenario.payload_tables import belief_changes, payloads_from, waiting_beliefs
from skyarm.scenario.reference_setting import in_folder, setting_of
from skyarm.scenario.scenario_of_log import scenario_of_log
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.scenario.standing_objects import with_standing_objects
from skyarm.scenario.start_in_world import require_start_outside
from skyarm.scenario.task_grippers import with_commands
from skyarm.scenario.task_payloads import with_instants

LIBRARY = resources.files("skyarm.scenario") / "library"


def list_scenarios() -> tuple[str, ...]:
    """Return the names of the shipped scenarios."""
    return tuple(sorted(Path(entry.name).stem for entry in LIBRARY.iterdir() if entry.name.endswith(".toml")))


def load_scenario(
    name_or_path: str | os.PathLike[str],
    *,
    plant: str | None = None,
    controller: str | None = None,
    seed: int | None = None,
    duration: float | None = None,
) -> Scenario:
    """Scenario from the library by name, from a .toml file or from a log; the keywords replace what the file says.

    Args:
        name_or_path: a name of :func:`list_scenarios`, or the path of a .toml file or of a log of a flight.
        plant: "rigid_body", "mujoco" or "mujoco_contacts".
        controller: name of a preset or a law, or ``LAW_tuned`` (:mod:`skyarm.control.catalogue`).
        seed: of the noise.
        duration: s.

    Raises:
        ScenarioError: one line, ``file: field = value: what is allowed``.
    """
    try:
        text = file_name(name_or_path, "scenario")
    except ValueError as error:
        raise ScenarioError(str(error)) from None
    replaced = {"plant": plant, "controller": controller, "seed": seed, "duration": duration}
    given = {field: value for field, value in replaced.items() if value is not None}
    if Path(text).suffix.removeprefix(".") in names("log_format"):
        return scenario_of_log(text, given)
    if text in list_scenarios():
        content, folder = (LIBRARY / f"{text}.toml").read_bytes(), Path()
    else:
        content, folder = _read(text), Path(text).parent
    try:
        document = read_toml(content)
        require_kind(document, "scenario")
        return scenario_from(document, folder, given)
    except ValueError as error:
        raise ScenarioError(f"{text}: {error}") from None


def _read(text: str) -> bytes:
    path = Path(text)
    known = f"shipped scenarios are {', '.join(list_scenarios())}"
    if path.suffix != ".toml":
        allowed = f"{did_you_mean(text, list_scenarios())}must be the path of a .toml file or a log, or a name; {known}"
        raise ScenarioError(f"scenario = {shown(text)}: {allowed}")
    reason = unreadable(path)
    if reason:
        raise ScenarioError(f"scenario = {shown(text)}: {reason}; {known}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"scenario = {shown(text)}: must be readable ({error.strerror}); {known}") from None


def scenario_from(
    document: Mapping[str, Any], folder: str | os.PathLike[str] = "", replaced: Mapping[str, Any] | None = None
) -> Scenario:
    """Make the scenario that a TOML document describes.

    Args:
        document: plain tables, as read from TOML.
        folder: where its vehicle paths start.
        replaced: "plant", "controller", "seed", "duration" in place of the document's.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if not isinstance(document, Mapping):
        raise ScenarioError(f"document = {shown(document)}: must be a table")
    try:
        with all_wrong_words():
            return _scenario(Fields(dict(document), ""), Path(folder), replaced or {})
    except ValueError as error:
        raise ScenarioError(one_line(str(error))) from None


def _scenario(top: Fields, folder: Path, replaced: Mapping[str, Any]) -> Scenario:
    schema = top.take("schema", 1)
    if schema != 1 or isinstance(schema, bool):
        raise ValueError(f"schema = {shown(schema)}: must be 1")
    plant = Fields(top.take("plant"), "plant")
    world = Truth(vehicle=tables.truth(plant, folder), gravity=tables.gravity(plant))
    environment = Fields(top.take("environment", {}), "environment")
    read = Fields(top.take("sensors", {}), "sensors")
    added.require_plugins(top)
    in_file = {
        "duration": top.take("duration"),
        "plant": plant.take("kind", "rigid_body"),
        "seed": top.take("seed", 0),
    }
    chosen = {name: replaced.get(name, value) for name, value in in_file.items()}
    chosen["duration"] = number(chosen["duration"], "duration", low=0.0, strict=True)
    controller = Fields(top.take("controller"), "controller")
    rates, delays = tables.rates(top), tables.delays(top)
    governed, governor = tables.governor(top.take("reference", {}))
    motion, joined = tables.joined(governed)
    longest = max(chosen["duration"], number(in_file["duration"], "duration"))
    setting = setting_of(world, longest)
    trajectory = reference_from(in_folder(motion, folder), world.vehicle.n, "reference", setting)
    handled = [event for event in setting.events if not event.gripper]
    payloads, told = payloads_from(with_instants(top.take("payloads", []), handled, rates.control))
    payloads, told = waiting_beliefs(payloads, told, trajectory)
    model = _model(top, plant, world, folder)
    tables.require_servos_said(controller, world.vehicle, model)
    scenario = Scenario(
        name=top.take("name"),
        title=tables.text(top, "title", ""),
        rates=rates,
        world=world,
        integrator=plant.take("integrator", usual_integrator(chosen["plant"])),
        controller=tables.controller(controller, model, replaced.get("controller"), loop_facts(rates, delays), folder),
        trajectory=trajectory,
        joined=joined,
        wind=wind_from(environment.take("wind"), "environment.wind") if "wind" in environment.table else NO_WIND,
        faults=faults_from(environment.take("faults", []), "environment.faults"),
        sensors=tables.sensors(read),
        instruments=added.instruments(read.table),
        estimator=added.estimator(top),
        drives=added.drives(plant),
        endings=added.endings(top),
        air=added.components(environment, "air", "air"),
        forces=added.components(environment, "forces", "force"),
        delays=delays,
        episode=top.take("episode", 0),
        ground=tables.truth_value(environment, "ground", True),
        windows=windows_from(Fields(top.take("windows", {}), "windows")),
        payloads=payloads,
        contact=with_commands(
            tables.contact(top, folder), [event for event in setting.events if event.gripper], rates.control
        ),
        changes=(*_changes(top, replaced), *belief_changes(payloads, told, chosen["duration"], rates.control)),
        **chosen,
    )
    for fields in (plant, environment):
        fields.done()
    if "duration" not in replaced:  # what takes its place shortens the flight, not the file
        scenario.windows.require_within(scenario.duration)
        require_within(scenario.changes, scenario.steps, rates.control)
    initial = top.take("initial", None)
    top.done()
    require_changes(scenario)
    for held in scenario.contacts:
        scenario = dataclasses.replace(scenario, contact=with_standing_objects(held, float(world.gravity)))
    if initial is not None:
        scenario = dataclasses.replace(scenario, initial=tables.initial(Fields(initial, "initial"), scenario))
    require_start_outside(scenario)
    return scenario if governor is None else with_governor(scenario, governor, setting)


def _changes(top: Fields, replaced: Mapping[str, Any]) -> tuple[Change, ...]:
    """[[changes]]; a controller that takes the place of the file's is not changed by the file."""
    found = changes_from(top.take("changes", []))
    return without_law(found) if "controller" in replaced else found


def _windows(top: Fields, duration: Any) -> Windows:
    """When the metrics look: within the flight of the file, whatever duration takes its place."""
    windows = windows_from(Fields(top.take("windows", {}), "windows"))
    windows.require_within(number(duration, "duration"))
    return windows


def _model(top: Fields, plant: Fields, world: Truth, folder: Path) -> Model:
    """What the controller believes: [model], or the plant's vehicle (without its payload) and gravity."""
    if "model" not in top.table:
        top.take("model", None)
        return Model(vehicle=tables.vehicle(plant, folder), gravity=world.gravity)
    fields = Fields(top.take("model"), "model")
    model = Model(vehicle=tables.truth(fields, folder), gravity=tables.gravity(fields))
    fields.done()
    return model
