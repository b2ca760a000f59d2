"""Scenarios from TOML files.

A file has ``schema = 1``, ``name``, ``duration`` (s) and these tables::

    [rates]       physics, control, reference (Hz; 1000, 200, 50)
    [plant]       vehicle, gravity (9.81), kind ("rigid_body" or "mujoco"), integrator ("rk4" or "euler"),
                  payload = { mass, frame }, joints = { damping, coulomb, coulomb_rate, effort_limit }
    [model]       vehicle, gravity (9.81), payload: what the controller believes
    [controller]  preset, or law with gains = { position, velocity, attitude, rate } (three numbers each),
                  joint_gains = { stiffness, damping } (one number a joint); mixer, rate_error,
                  without = ["coriolis", "coupling", "full_gravity", "feedforward"];
                  safety = true, or a table of limits (skyarm.control.safety.limits)
    [reference]   see skyarm.reference.parse
    [environment] wind (see skyarm.environment.parse), ground (true),
                  faults = [{ rotor or joint = name, effectiveness, start }]
    [sensors]     one sigma: position, velocity, attitude, rate, specific_force, joints, joint_rates, rotor_speeds
    [delays]      measurement, command (s)
    [initial]     position, quaternion_wxyz, velocity, rate, joints, joint_rates, rotor_speeds; left out: hover trim
    seed, episode

A vehicle is a name of the library or a path beside the file. Without [model] the controller believes the plant's
vehicle and gravity, but knows of no payload. Every error is one line: file, field, value, what is allowed.
"""

from __future__ import annotations

import dataclasses
import os
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from skyarm.control.model import Model
from skyarm.environment import NO_WIND, faults_from, wind_from
from skyarm.files import Fields, file_name, number, shown, unreadable
from skyarm.plant.interface import World
from skyarm.reference import trajectory_from
from skyarm.simulate import scenario_tables as tables
from skyarm.simulate.scenario import Delays, Rates, Scenario, ScenarioError

LIBRARY = resources.files("skyarm.simulate") / "scenarios"


def list_scenarios() -> tuple[str, ...]:
    """Names of the shipped scenarios."""
    return tuple(sorted(Path(entry.name).stem for entry in LIBRARY.iterdir() if entry.name.endswith(".toml")))


def load_scenario(
    name_or_path: str | os.PathLike[str],
    *,
    plant: str | None = None,
    controller: str | None = None,
    seed: int | None = None,
    duration: float | None = None,
) -> Scenario:
    """Scenario from the library by name or from a .toml file; the keywords replace what the file says.

    Args:
        name_or_path: a name of :func:`list_scenarios`, or the path of a .toml file.
        plant: "rigid_body" or "mujoco".
        controller: name of a preset or a law, or ``LAW_tuned`` (:mod:`skyarm.control.named`).
        seed: of the noise.
        duration: s.

    Raises:
        ScenarioError: one line, ``file: field = value: what is allowed``.
    """
    try:
        text = file_name(name_or_path, "scenario")
    except ValueError as error:
        raise ScenarioError(str(error)) from None
    if text in list_scenarios():
        content, folder = (LIBRARY / f"{text}.toml").read_bytes(), Path()
    else:
        content, folder = _read(text), Path(text).parent
    replaced = {"plant": plant, "controller": controller, "seed": seed, "duration": duration}
    try:
        document = tomllib.loads(content.decode("utf-8-sig"))
        return scenario_from(document, folder, {k: v for k, v in replaced.items() if v is not None})
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{text}: TOML = {str(error)!r}: must be valid TOML in UTF-8") from None
    except RecursionError:
        raise ScenarioError(f"{text}: TOML = tables in tables: must not be nested this deep") from None
    except ValueError as error:
        raise ScenarioError(f"{text}: {error}") from None


def _read(text: str) -> bytes:
    path = Path(text)
    known = f"shipped scenarios are {', '.join(list_scenarios())}"
    if path.suffix != ".toml":
        raise ScenarioError(f"scenario = {shown(text)}: must be the path of a .toml file or a name; {known}")
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
    """Scenario that a TOML document describes.

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
        return _scenario(Fields(dict(document), ""), Path(folder), replaced or {})
    except ValueError as error:
        # a name in a file may hold line breaks
        raise ScenarioError(" ".join(str(error).split())) from None


def _scenario(top: Fields, folder: Path, replaced: Mapping[str, Any]) -> Scenario:
    schema = top.take("schema", 1)
    if schema != 1 or isinstance(schema, bool):
        raise ValueError(f"schema = {shown(schema)}: must be 1")
    plant = Fields(top.take("plant"), "plant")
    world = World(vehicle=tables.truth(plant, folder), gravity=tables.gravity(plant))
    environment = Fields(top.take("environment", {}), "environment")
    in_file = {
        "duration": top.take("duration"),
        "plant": plant.take("kind", "rigid_body"),
        "seed": top.take("seed", 0),
    }
    chosen = {name: replaced.get(name, value) for name, value in in_file.items()}
    chosen["duration"] = number(chosen["duration"], "duration")
    controller = Fields(top.take("controller"), "controller")
    rates, delays = tables.rates(top), tables.delays(top)
    scenario = Scenario(
        name=top.take("name"),
        title=tables.text(top, "title", ""),
        rates=rates,
        world=world,
        integrator=plant.take("integrator", "rk4"),
        controller=tables.controller(
            controller, _model(top, plant, world, folder), replaced.get("controller"), loop_facts(rates, delays)
        ),
        trajectory=trajectory_from(top.take("reference", {}), world.vehicle.n, "reference"),
        wind=wind_from(environment.take("wind"), "environment.wind") if "wind" in environment.table else NO_WIND,
        faults=faults_from(environment.take("faults", []), "environment.faults"),
        sensors=tables.sensors(top),
        delays=delays,
        episode=top.take("episode", 0),
        ground=tables.truth_value(environment, "ground", True),
        **chosen,
    )
    for fields in (plant, environment):
        fields.done()
    initial = top.take("initial", None)
    top.done()
    if initial is None:
        return scenario
    return dataclasses.replace(scenario, initial=tables.initial(Fields(initial, "initial"), scenario))


def loop_facts(rates: Rates, delays: Delays) -> dict[str, float]:
    """What a law may know of its loop: its clocks and the age of its measurements, s."""
    return {
        "control_period": 1.0 / rates.control,
        "reference_period": 1.0 / rates.reference,
        "delay": delays.measurement,
        "delay_periods": round(delays.measurement * rates.control),
    }


def _model(top: Fields, plant: Fields, world: World, folder: Path) -> Model:
    """What the controller believes: [model], or the plant's vehicle (without its payload) and gravity."""
    if "model" not in top.table:
        top.take("model", None)
        return Model(vehicle=tables.vehicle(plant, folder), gravity=world.gravity)
    fields = Fields(top.take("model"), "model")
    model = Model(vehicle=tables.with_payload(tables.vehicle(fields, folder), fields), gravity=tables.gravity(fields))
    fields.done()
    return model
