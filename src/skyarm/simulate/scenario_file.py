"""Scenarios from TOML files.

A file has ``schema = 1``, ``name``, ``duration`` (s) and these tables::

    [rates]       physics, control, reference (Hz; 1000, 200, 50)
    [plant]       vehicle, gravity (9.81), kind ("rigid_body" or "mujoco"), integrator ("rk4" or "euler"),
                  payload = { mass, frame }, joints = { damping, coulomb, coulomb_rate, effort_limit }
    [model]       vehicle, gravity (9.81), payload: what the controller believes
    [controller]  preset, or law with gains = { position, velocity, attitude, rate } (three numbers each),
                  joint_gains = { stiffness, damping } (one number a joint); mixer, rate_error,
                  without = ["coriolis", "coupling", "full_gravity", "feedforward"]
    [reference]   see skyarm.reference.parse
    [environment] wind (see skyarm.environment.parse), ground (true)
    [sensors]     one sigma: position, velocity, attitude, rate, specific_force, joints, joint_rates, rotor_speeds
    [delays]      measurement, command (s)
    [initial]     position, quaternion_wxyz, velocity, rate, joints, joint_rates, rotor_speeds; left out: hover trim
    seed, episode

A vehicle is a name of the library or a path beside the file. Every error is one line: file, field, value, what is allowed.
"""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.control.model import GeometricGains, JointGains, Model, Terms
from skyarm.control.presets import preset
from skyarm.control.registry import Controller, make_controller
from skyarm.dynamics import State
from skyarm.environment import NO_WIND, payload_from, wind_from
from skyarm.files import Fields, number
from skyarm.plant.rigid_body import World
from skyarm.plant.sensors import SensorNoise
from skyarm.reference import trajectory_from
from skyarm.simulate.scenario import Delays, Rates, Scenario, ScenarioError, trimmed_state
from skyarm.vehicle.check import TOLERANCE
from skyarm.vehicle.files import list_vehicles, load_vehicle
from skyarm.vehicle.records import Vehicle

LIBRARY = resources.files("skyarm.simulate") / "scenarios"
TERMS = tuple(field.name for field in dataclasses.fields(Terms))


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
        controller: name of a preset.
        seed: of the noise.
        duration: s.
    Raises:
        ScenarioError: one line, ``file: field = value: what is allowed``.
    """
    text = os.fspath(name_or_path)
    if text in list_scenarios():
        content, folder = (LIBRARY / f"{text}.toml").read_bytes(), Path()
    else:
        content, folder = _read(text), Path(text).parent
    replaced = {"plant": plant, "controller": controller, "seed": seed, "duration": duration}
    try:
        document = tomllib.loads(content.decode("utf-8"))
        return scenario_from(document, folder, {k: v for k, v in replaced.items() if v is not None})
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{text}: TOML = {str(error)!r}: must be valid TOML in UTF-8") from None
    except ValueError as error:
        raise ScenarioError(f"{text}: {error}") from None


def _read(text: str) -> bytes:
    path = Path(text)
    known = f"shipped scenarios are {', '.join(list_scenarios())}"
    if path.suffix != ".toml":
        raise ScenarioError(f"scenario = {text!r}: must be the path of a .toml file or a name; {known}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"scenario = {text!r}: must be a readable file ({error.strerror}); {known}") from None


def scenario_from(document: Mapping[str, Any], folder: Path, replaced: Mapping[str, Any]) -> Scenario:
    """Scenario that a TOML document describes; ``folder`` is where its vehicle paths start.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    top = Fields(dict(document), "")
    schema = top.take("schema", 1)
    if schema != 1 or isinstance(schema, bool):
        raise ValueError(f"schema = {schema!r}: must be 1")
    plant = Fields(top.take("plant"), "plant")
    truth = _vehicle(plant, folder)
    joints = _joint_overrides(plant)
    world = World(vehicle=truth.with_joints(**joints) if joints else truth, gravity=_gravity(plant))
    model = Fields(top.take("model", {"vehicle": plant.table["vehicle"]}), "model")
    belief = Model(vehicle=_vehicle(model, folder), gravity=_gravity(model))
    model.done()
    trajectory = trajectory_from(top.take("reference", {}), world.vehicle.n, "reference")
    environment = Fields(top.take("environment", {}), "environment")
    wind = wind_from(environment.take("wind"), "environment.wind") if "wind" in environment.table else NO_WIND
    scenario = Scenario(
        name=_text(top, "name"),
        title=_text(top, "title", ""),
        duration=float(replaced.get("duration", top.number("duration"))),
        rates=_rates(top),
        world=world,
        plant=str(replaced.get("plant", plant.take("kind", "rigid_body"))),
        integrator=plant.take("integrator", "rk4"),
        controller=_controller(Fields(top.take("controller"), "controller"), belief, replaced.get("controller")),
        trajectory=trajectory,
        wind=wind,
        sensors=_sensors(top),
        delays=_delays(top),
        seed=int(replaced.get("seed", _whole(top, "seed"))),
        episode=_whole(top, "episode"),
        ground=_truth_value(environment, "ground", True),
    )
    for fields in (plant, environment):
        fields.done()
    initial = top.take("initial", None)
    top.done()
    return scenario if initial is None else dataclasses.replace(scenario, initial=_initial(initial, scenario))


def _text(fields: Fields, name: str, *default: str) -> str:
    value = fields.take(name, *default)
    if not isinstance(value, str) or (not value and not default):
        raise ValueError(f"{name} = {value!r}: must be text that is not empty")
    return value


def _whole(fields: Fields, name: str) -> int:
    value = fields.take(name, 0)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**32:
        raise ValueError(f"{name} = {value!r}: must be a whole number from 0 to 2**32 - 1")
    return value


def _truth_value(fields: Fields, name: str, default: bool) -> bool:
    value = fields.take(name, default)
    if not isinstance(value, bool):
        raise ValueError(f"{fields.where}.{name} = {value!r}: must be true or false")
    return value


def _vehicle(fields: Fields, folder: Path) -> Vehicle:
    named = fields.take("vehicle")
    if not isinstance(named, str):
        raise ValueError(f"{fields.where}.vehicle = {named!r}: must be a name of the library or a path")
    try:
        vehicle = load_vehicle(named if named in list_vehicles() else folder / named)
    except ValueError as error:
        raise ValueError(f"{fields.where}.vehicle = {named!r}: {error}") from None
    payload = fields.take("payload", None)
    if payload is None:
        return vehicle
    held = payload_from(payload, f"{fields.where}.payload")
    return vehicle.with_payload(held.mass, held.frame or None)


def _gravity(fields: Fields) -> float:
    return fields.number("gravity", 9.81, low=0.0)


def _joint_overrides(plant: Fields) -> dict[str, float]:
    table = Fields(plant.take("joints", {}), "plant.joints")
    found = {}
    for name, strict in (("damping", False), ("coulomb", False), ("coulomb_rate", True), ("effort_limit", True)):
        value = table.take(name, None)
        if value is not None:
            found[name] = number(value, f"plant.joints.{name}", low=0.0, strict=strict)
    table.done()
    return found


def _rates(top: Fields) -> Rates:
    table = Fields(top.take("rates", {}), "rates")
    defaults = Rates()
    rates = {name: table.take(name, getattr(defaults, name)) for name in ("physics", "control", "reference")}
    table.done()
    return Rates(**rates)


def _controller(fields: Fields, model: Model, replaced: str | None) -> Controller:
    if replaced is not None:
        return preset(replaced, model)
    if "preset" in fields.table:
        found = preset(_text(fields, "preset"), model)
        fields.done()
        return found
    gains, joint_gains = fields.take("gains", None), fields.take("joint_gains", None)
    without = fields.take("without", [])
    if not isinstance(without, list) or any(name not in TERMS for name in without):
        raise ValueError(f"controller.without = {without!r}: must be a list of {', '.join(TERMS)}")
    controller = make_controller(
        _text(fields, "law"),
        model,
        gains=None if gains is None else _gains(Fields(gains, "controller.gains")),
        joint_gains=None if joint_gains is None else _joint_gains(Fields(joint_gains, "controller.joint_gains")),
        mixer_policy=fields.take("mixer", "rotors_clip"),
        rate_error=fields.take("rate_error", "rotors"),
        terms=Terms(**dict.fromkeys(without, False)),
    )
    fields.done()
    return controller


def _gains(fields: Fields) -> GeometricGains:
    names = ("position", "velocity", "attitude", "rate")
    vectors = {name: Vec3(*fields.vector(name)) for name in names}
    fields.done()
    for name, vector in vectors.items():
        for axis, value in zip("xyz", vector, strict=True):
            number(value, f"{fields.where}.{name}.{axis}", low=0.0)
    return GeometricGains(**vectors)


def _joint_gains(fields: Fields) -> JointGains:
    rows = {name: _numbers(fields, name, low=0.0) for name in ("stiffness", "damping")}
    fields.done()
    return JointGains(**rows)


def _numbers(fields: Fields, name: str, *default: Any, low: float = -math.inf) -> tuple[float, ...]:
    values, at = fields.take(name, *default), f"{fields.where}.{name}"
    if not isinstance(values, (list, tuple)):
        raise ValueError(f"{at} = {values!r}: must be a list of numbers")
    return tuple(number(value, f"{at}[{i}]", low=low) for i, value in enumerate(values))


def _sensors(top: Fields) -> SensorNoise:
    table = Fields(top.take("sensors", {}), "sensors")
    names = tuple(field.name for field in dataclasses.fields(SensorNoise))
    sigmas: dict[str, Any] = {name: table.number(name, 0.0, low=0.0) for name in names}
    table.done()
    return SensorNoise(**{name: sigma if sigma > 0.0 else 0 for name, sigma in sigmas.items()})


def _delays(top: Fields) -> Delays:
    table = Fields(top.take("delays", {}), "delays")
    delays = Delays(
        measurement=table.number("measurement", 0.0, low=0.0), command=table.number("command", 0.0, low=0.0)
    )
    table.done()
    return delays


def _initial(table: Any, scenario: Scenario) -> State:
    """Initial state: hover trim at the reference with the given fields replaced."""
    fields = Fields(table, "initial")
    vehicle = scenario.world.vehicle
    start = scenario.trajectory.at(0.0)
    joints = _numbers(fields, "joints", [float(q) for q in start.joints])
    if len(joints) != vehicle.n:
        raise ValueError(f"initial.joints: {len(joints)} values, must be {vehicle.n} (one per joint)")
    trim = trimmed_state(scenario.world, start.position, float(start.yaw), joints)
    quaternion = _numbers(fields, "quaternion_wxyz", list(trim.quaternion))
    length = math.sqrt(sum(c * c for c in quaternion))
    if len(quaternion) != 4 or abs(length - 1.0) > TOLERANCE:
        raise ValueError(
            f"initial.quaternion_wxyz = {list(quaternion)}: must be four numbers of length 1 within {TOLERANCE:g}"
        )
    rates, speeds = _numbers(fields, "joint_rates", trim.joint_rates), _numbers(fields, "rotor_speeds", trim.rotor_speeds)
    for name, values, count in (("joint_rates", rates, vehicle.n), ("rotor_speeds", speeds, len(vehicle.rotors))):
        if len(values) != count:
            raise ValueError(f"initial.{name}: {len(values)} values, must be {count}")
    vectors = {name: Vec3(*fields.vector(name, tuple(getattr(trim, name)))) for name in ("position", "velocity", "rate")}
    fields.done()
    return State(
        quaternion=Quaternion.of([c / length for c in quaternion]),
        joints=joints,
        joint_rates=rates,
        rotor_speeds=speeds,
        **vectors,
    )
