"""Read scenarios from TOML files.

A file has ``schema = 1``, ``name``, ``title``, ``duration`` (s) and these tables::

    [rates]       physics, control, reference (Hz; 1000, 200, 50)
    [plant]       vehicle, gravity (9.81), kind ("rigid_body", "mujoco"),
                  integrator ("rk4", "euler", "rk4_staged"),
                  payload = { mass, frame }, joints = { damping, coulomb, coulomb_rate,
                  effort_limit, armature, stop_stiffness, stop_damping }, each a number
                  for every joint or a list of one for each
    [model]       vehicle, gravity (9.81), payload, joints: the controller's model
    [controller]  preset, or law with gains = { position, velocity, attitude, rate }
                  (three numbers each), joint_gains = { stiffness, damping } (one number
                  a joint); mixer, rate_error,
                  without = ["coriolis", "coupling", "full_gravity", "feedforward"];
                  friction_compensation, rate_weights (one number a joint);
                  safety = true, or a table of limits (skyarm.control.safety.limits)
    [reference]   see skyarm.reference.reference_tables; tracking_start (s): until then
                  the law gets that of t = 0;
                  governor = true, or a table of limits (skyarm.scenario.path_governor)
    [environment] wind (see skyarm.world.wind), ground (true),
                  faults = [{ rotor or joint = name, effectiveness (a number or a
                  signal), start }], or { joint = name, stuck = true, start }
                  [[environment.air]], [[environment.forces]] kind = NAME and its
                  numbers, added to the wind
    [sensors]     one sigma: position, velocity, attitude, rate, specific_force, joints,
                  joint_rates, rotor_speeds
    [sensors.X]   kind = NAME and its numbers: a sensor beside the full state, X to the
                  estimator
    [estimator]   kind = NAME and its numbers: from all readings to the law's
                  measurement
    [plant.drives.JOINT]  kind = NAME and its numbers: what the joint's setpoint means
    [[endings]]   kind = NAME and its numbers, beside the library's
    [plugins]     need = [names]: plugins that must be loaded; a file never loads one
                  itself
    [delays]      measurement, command, and on top of it rotors, joints (s);
                  longest_command
    [initial]     position, quaternion_wxyz, velocity, rate, joints, joint_rates,
                  rotor_speeds; left out: hover trim;
                  standing = true sets the vehicle down on what is below it, at rest
                  (skyarm.world.contact.static_equilibrium)
    [windows]     when its metrics look: steady, transient, gust, hover = [start, stop),
                  s; holds = [...]; last = s
    [[changes]]   at (s), path, value: what is other from then on
                  (:mod:`skyarm.scenario.in_flight`)
    [world]       [[world.surfaces]], [[world.points]]: what the vehicle may touch, and
                  where (skyarm.world.contact)
    [[payloads]]  mass, frame, pick, drop: loads picked up and set down in flight
                  (skyarm.scenario.payload_tables)
    [numbers]     numbers by their path, applied last (:mod:`skyarm.scenario.numbers`)
    [agents.NAME] the tables of one of several vehicles, but those of what they share;
                  what stands at the top is of all vehicles that do not say otherwise;
                  faults = [...] are its own
    seed, episode

A vehicle is a name of the library or a path beside the file. Without [model] the
controller's model is the plant's vehicle and gravity, but knows of no payload. Every
error is one line: file, field, value, what is allowed.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

from skyarm.algebra import Scalar
from skyarm.control.catalogue import OWN
from skyarm.dynamics.actuators import AllocationError
from skyarm.records.files import (
    PathLike,
    errors_as,
    file_name,
    one_line,
    read_toml,
    shown,
    unreadable,
)
from skyarm.records.files.names import kind_of, names_in, read_named
from skyarm.records.members import SOLE
from skyarm.records.path_names import AGENTS, agent_of, word_of
from skyarm.records.registry import names
from skyarm.scenario import readers
from skyarm.scenario.controller_table import (
    require_servos_said,
    under_law,
    warn_of_own_options,
)
from skyarm.scenario.document import Document, slot_of, words_of_agent
from skyarm.scenario.in_flight import require_changes
from skyarm.scenario.numbers import require_apart, with_numbers
from skyarm.scenario.paths import OF_STUDIES, is_below
from skyarm.scenario.scenario_checks import begin, check_scenario
from skyarm.scenario.scenario_record import Agent, Change, Scenario, ScenarioError
from skyarm.vehicle.vehicle_files import list_vehicles

LIBRARY = resources.files("skyarm.scenario") / "library"


def list_scenarios() -> tuple[str, ...]:
    """Return the names of the shipped scenarios."""
    return names_in(LIBRARY)


def load_scenario(
    name_or_path: PathLike,
    *,
    plant: str | None = None,
    controller: str | None = None,
    seed: int | None = None,
    duration: float | None = None,
) -> Scenario:
    """Load a scenario by library name, from a .toml file or from a log; keywords
    replace stated values.

    Args:
        name_or_path: a name of :func:`list_scenarios`, or the path of a .toml file or
            of a log of a flight.
        plant: "rigid_body" or "mujoco".
        controller: name of a preset or a law, or ``LAW_tuned``
            (:mod:`skyarm.control.catalogue`); "own" is the scenario's, with its
            options.
        seed: seed of the noise.
        duration: s.

    Warns of parts without effect on the flight
    (:class:`skyarm.scenario.without_effect.WithoutEffectWarning`).

    Raises:
        ScenarioError: one line, ``file: field = value: what is allowed``.
    """
    from skyarm.scenario.without_effect import WithoutEffectWarning, without_effect

    stated = {
        "plant": plant,
        "controller": controller,
        "seed": seed,
        "duration": duration,
    }
    scenario = _read_scenario(
        name_or_path,
        {name: value for name, value in stated.items() if value is not None},
    )
    for line in without_effect(scenario):
        warnings.warn(f"{scenario.name}: {line}", WithoutEffectWarning, stacklevel=2)
    return scenario


def _read_scenario(name_or_path: PathLike, given: Mapping[str, Any]) -> Scenario:
    with errors_as(ScenarioError):
        text = file_name(name_or_path, "scenario")
    if Path(text).suffix.removeprefix(".") in names("log_format"):
        return _scenario_of_log(text, given)
    with errors_as(ScenarioError):
        document, folder = read_named(text, "scenario", LIBRARY, " or a log, or a name")
    with errors_as(ScenarioError, f"{text}: "):
        return scenario_from(document, folder, given)


def as_scenario(given: Scenario | PathLike, controller: str | None = None) -> Scenario:
    """Return a given scenario, or load one by its shipped name, from a .toml file or
    from a log.

    Args:
        given: a record, a name or a path.
        controller: name of a law in place of its own.

    Raises:
        ScenarioError: one line.
    """
    if isinstance(given, (str, os.PathLike)):
        return load_scenario(given, controller=controller)
    if not isinstance(given, Scenario):
        raise ScenarioError(
            f"scenario = {shown(given)}: must be a Scenario, or the name or path of one"
        )
    return given if controller is None else under_law(given, controller)


def is_scenario(name: str) -> bool:
    """True if a name denotes a scenario: a shipped one, a file of one or a log (.npz).

    All else is read as a vehicle, whose reader says what is wrong with a file that
    nobody can read.
    """
    if name in list_vehicles():
        return False
    return (
        name in list_scenarios()
        or name.endswith(".npz")
        or kind_of_file(name) == "scenario"
    )


def kind_of_file(name: str) -> str:
    """Kind of a TOML file (vehicle, scenario, study, gains) by its tables; empty for
    other files.
    """
    if not name.endswith(".toml") or unreadable(Path(name)):
        return ""
    try:
        # what is wrong with it is told by whoever reads it as its kind
        return kind_of(read_toml(Path(name).read_bytes()))
    except (OSError, ValueError):
        return ""


def _scenario_of_log(path: str, given: Mapping[str, Any]) -> Scenario:
    """Load the scenario stored in a log file, with some values replaced."""
    from skyarm.log.flown_scenario import warn_of_commands
    from skyarm.log.formats import load_log

    try:
        if reason := unreadable(Path(path)):
            raise ValueError(reason)
        log = load_log(path)
        warn_of_commands(log.info)
        scenario: Scenario = log.scenario_with(_by_path(given))
        return (
            under_law(scenario, given["controller"])
            if "controller" in given
            else scenario
        )
    except (ValueError, OSError, AllocationError) as error:
        words = str(error).removeprefix(f"log = {shown(path)}: ")
        raise ScenarioError(f"{path}: {words}") from None


def _by_path(given: Mapping[str, object]) -> dict[str, object]:
    """Replacement values by key path of a scenario file, without the law; ``plant``
    means ``plant.kind``.
    """
    return {
        "plant.kind" if name == "plant" else name: value
        for name, value in given.items()
        if name != "controller"
    }


def scenario_from(
    document: Mapping[str, object],
    folder: PathLike = "",
    replaced: Mapping[str, Any] | None = None,
) -> Scenario:
    """Make the scenario that a TOML document describes.

    Args:
        document: plain tables, as read from TOML.
        folder: folder where its vehicle paths start.
        replaced: "plant", "controller", "seed", "duration" in place of the document's.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if not isinstance(document, Mapping):
        raise ScenarioError(f"document = {shown(document)}: must be a table")
    try:
        given = dict(replaced or {})
        if given.get("controller") == OWN:
            del given["controller"]
        return _scenario_of(
            Document(document, Path(folder), _by_path(given), given.get("controller"))
        )
    except ValueError as error:
        raise ScenarioError(one_line(str(error))) from None


def _scenario_of(document: Document) -> Scenario:
    """Make the scenario of all keys of a file; unknown keys raise an error."""
    top, members = document.table(""), document.members
    top.require_schema()
    for each in members.values():
        # plants come first: faults of a vehicle would show as faults of what needs it
        each.word("plant")
    document.word("duration")
    readers.require_plugins(top)
    agents: dict[str, Agent] = {}
    changes = document.word("changes")
    # those of a law that does not fly
    if document.law is not None:
        changes = [each for each in changes if not each.of_law]
    for name, each in members.items():
        with each.errors_at():
            controller = each.stated_table("controller")
            require_servos_said(
                controller, each.word("plant").vehicle, each.word("model")
            )
            # and the reference, of whose faults the law's would distract
            each.word("payloads")
            agents[name] = Agent(
                **{place[-1]: value for place, value in each.fields(agent=True).items()}
            )
    shared = {place[-1]: value for place, value in document.fields(agent=False).items()}
    scenario = Scenario(**shared | {"agents": agents, "changes": tuple(changes)})
    check_scenario(scenario)
    document.table("environment").done()
    # what takes its place shortens the flight, not the file
    if "duration" not in document.replaced:
        scenario.windows.require_within(scenario.duration)
        _require_within(scenario.changes, scenario.steps, scenario.rates.control)
    numbers = document.table("numbers").table
    initial = slot_of("initial")
    # gains of a law that does not fly, as changes of it are
    of_law = {
        path: value
        for path, value in numbers.items()
        if document.law is not None and is_below(word_of(path), "controller")
    }
    numbers = {path: value for path, value in numbers.items() if path not in of_law}
    for name, each in members.items():
        of_it = [c for c in scenario.changes if agent_of(c.path) in ("", name)]
        _warn_of_two_loads(each, [word_of(c.path) for c in of_it])
    initials = {
        name: (each.entry(initial), each.at("initial"))
        for name, each in members.items()
    }
    # a file without names has no tables of agents that could have keys left
    for name in members if members.keys() != {SOLE} else ():
        document.table(f"{AGENTS}.{name}").done(words_of_agent())
    top.done()
    require_changes(scenario)
    made = readers.at_start(scenario, initials)
    if numbers:
        # numbers come last: their paths lead into what all else has made
        with errors_as(ScenarioError, "numbers: "):
            made = _with_stated_numbers(made, numbers)
    if document.law is not None:
        # a law that does not fly may be wrong, and then has no options to lose
        with suppress(ValueError):
            own = made.under(
                *(
                    readers.own_controller(each.stated_table("controller"), each)
                    for each in members.values()
                )
            )
            own = _with_stated_numbers(own, of_law) if of_law else own
            warn_of_own_options(own, made, document.law)
    governed = {
        name: each.plan_time(made.of(name)).agent
        for name, each in members.items()
        if each.has_governor
    }
    return replace(made, agents={**made.agents, **governed}) if governed else made


class TwoLoadsWarning(UserWarning):
    """Warning about a payload of a vehicle's table to which a change in flight adds
    another.
    """


def _warn_of_two_loads(document: Document, paths: Iterable[str]) -> None:
    """Warn where a change of one vehicle sets a payload at a frame where [plant] or
    [model] states another.

    Numbers by path may add to it on purpose: saved files have them.
    """
    for path in dict.fromkeys(paths):
        root, _, load = path.partition(".payload.")
        if root not in ("plant", "model") or not load:
            continue
        stated = document.table(document.at(root)).table.get("payload", {})
        tip = document.word(root).vehicle.end_effector
        frame = load.rpartition(".")[0]
        if stated.get("mass") and (stated.get("frame") or tip) == (frame or tip):
            own = f"{document.at(root)}.payload.mass = {shown(stated['mass'])}"
            line = (
                f"{path}: is a load beside {own}, which it does not replace; set both"
                " by the path"
            )
            warnings.warn(line, TwoLoadsWarning, stacklevel=2)


def _require_within(changes: Iterable[Change], steps: int, rate: int) -> None:
    """Raise an error if a scheduled change lies outside of the flight's control
    periods.

    Raises:
        ScenarioError: one line.
    """
    for i, change in enumerate(changes):
        if change.tick(rate) >= steps:
            last = (steps - 1) / rate
            raise ScenarioError(
                f"changes[{i}].at = {change.at!r}: must be at most {last:g} s, the last"
                " control period"
            )


def _with_stated_numbers(scenario: Scenario, numbers: Mapping[str, Scalar]) -> Scenario:
    """Scenario with the numbers that a file states by parameter path, checked like
    values stated in tables.
    """
    try:
        require_apart(scenario, tuple(numbers))
        changed = with_numbers(scenario, numbers)
    except ValueError as error:
        raise _by_its_path(scenario, numbers, str(error)) from None
    require_changes(changed)
    begin(changed)
    return changed


def _by_its_path(
    scenario: Scenario, numbers: Mapping[str, Scalar], words: str
) -> ScenarioError:
    """Error about a number that a file states by parameter path; the message names that
    path, not a record's field.

    Args:
        scenario: scenario without the numbers.
        numbers: numbers by path.
        words: message of the error in all of them.
    """
    # a message that begins with a path names it already
    for path, value in numbers.items() if not words.startswith("path = ") else ():
        try:
            with_numbers(scenario, {path: value})
        except ValueError as error:
            # as it is and as a record holds a whole number
            message, texts = str(error), (shown(value), f"{value}.0")
            why = next(
                (
                    tail
                    for each in texts
                    if (tail := message.partition(f" = {each}: ")[2])
                ),
                message,
            )
            return ScenarioError(f"{path} = {shown(value)}: {why}")
    return ScenarioError(words.replace(OF_STUDIES, "must be written in its table"))
