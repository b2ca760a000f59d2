"""Readers of those scenario-file sections whose tables have other keys than the fields
of their records.

Each takes the entry of its word, the word's path and a :class:`ScenarioWords` of all
others.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from skyarm.algebra import Quaternion, Vec3
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators.hover import highest_thrust
from skyarm.plant.interface import Truth
from skyarm.records.field_rules import accept_scalar, rules
from skyarm.records.files import (
    Fields,
    errors_as,
    filled_text,
    must_be_one_of,
    number,
    shown,
)
from skyarm.records.files.fields import list_of_tables
from skyarm.records.files.messages import comma_list, did_you_mean
from skyarm.records.files.toml import Entry
from skyarm.records.leaves import Place, Tree, field_names, replace_at
from skyarm.records.path_names import AGENTS
from skyarm.records.read_table import record_from, registered_from, registered_values
from skyarm.records.registry.plugins import is_law_of_file, known_names
from skyarm.records.registry.registrations import LOADED_BY
from skyarm.records.units import units
from skyarm.records.words import words_of_fields
from skyarm.reference import Trajectory
from skyarm.reference.object_motion import motion_of_object
from skyarm.reference.reference_tables import reference_from
from skyarm.reference.task_records import Setting, TaskEvent
from skyarm.reference.waypoints import samples_as_spline
from skyarm.scenario.controller_table import (
    controller_by_name,
    controller_from,
    is_gains_file,
    loop_facts,
)
from skyarm.scenario.numbers import INITIAL
from skyarm.scenario.payload_tables import with_commands, with_instants
from skyarm.scenario.scenario_checks import begin, check_quaternion, check_scenario
from skyarm.scenario.scenario_record import (
    Change,
    PartialState,
    Scenario,
    trimmed_state,
)
from skyarm.vehicle import Joint, Vehicle
from skyarm.vehicle.linkage import JOINT_NUMBERS
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_tables import mounted_drives
from skyarm.world import Component, Payload, TimedPayload, wind_from

if TYPE_CHECKING:
    from skyarm.reference.feasibility import Feasibility
    from skyarm.world.contact.contact import Contact
    from skyarm.world.team import Team

LAW = "controller.law"


class ScenarioWords(Protocol):
    """Interface (typing.Protocol) by which the reader of one scenario-file section gets
    the values of other sections.

    Attributes:
        folder: folder where paths of files begin.
        law: name of a law, or file of gains, in place of what [controller] says; None
            for none.
    """

    folder: Path
    law: str | None

    @property
    def setting(self) -> Setting:
        """Vehicle, gravity, duration and other facts of a flight that its reference
        table is read with.
        """
        ...

    @property
    def events(self) -> Sequence[tuple[str, Sequence[TaskEvent]]]:
        """Events of the task of each agent's reference, with the agent's name; "" if it
        is the only one.
        """
        ...

    @property
    def name(self) -> str:
        """Name of the agent whose words are read; empty for the only one and for what
        all share.
        """
        ...

    @property
    def agents(self) -> Collection[str]:
        """Names of all agents."""
        ...

    @property
    def stated_world(self) -> Component[Tree]:
        """Contact model as [world] states it, without commands of a task."""
        ...

    def entry_at(self, path: str) -> Entry:
        """Unread entry of the file at a path from its top; an empty table if the file
        has none.
        """
        ...

    def word(self, path: str) -> Any:
        """Value of a scenario field by its key path in the scenario file."""
        ...

    def vehicle(self, path: str) -> Vehicle:
        """Vehicle that the table at a key path names, without the payload and joint
        values that the table states.
        """
        ...


def wind(entry: object, path: str, reading: ScenarioWords) -> Component[Tree]:
    """Read the wind from the table [environment.wind] of a scenario file."""
    return wind_from(entry, path)


def plant(entry: object, path: str, reading: ScenarioWords) -> Truth:
    """Read [plant]: vehicle, gravity (m/s^2; 9.81), payload and joint values."""
    fields = Fields(entry, path)
    beside = ["kind", "integrator", "closure", "contact", "drives"]
    carrier, gravity = _vehicle_and_gravity(fields, reading, beside=beside)
    held = fields.table.get("payload", {})
    loads = (
        (carrier.point_mass(held["mass"], held.get("frame")),)
        if held.get("mass")
        else ()
    )
    return Truth(vehicle=carrier, gravity=gravity, loads=loads)


def model(entry: object, path: str, reading: ScenarioWords) -> Model:
    """Read the controller's [model]; without one, the plant's vehicle and gravity
    without payload or joint values.
    """
    if entry is None:
        return Model(
            vehicle=reading.vehicle("plant"), gravity=reading.word("plant").gravity
        )
    carrier, gravity = _vehicle_and_gravity(Fields(entry, path), reading)
    return Model(vehicle=carrier, gravity=gravity)


def vehicle(named: object, at: str, folder: Path) -> Vehicle:
    """Load the vehicle that [plant] or [model] names, without the table's payload and
    joint values.
    """
    named = filled_text(named, at, "a name of the library or a path")
    try:
        return load_vehicle(named if named in list_vehicles() else folder / named)
    except ValueError as error:
        words = str(error).removeprefix(f"vehicle = {shown(named)}: ")
        raise ValueError(f"{at} = {shown(named)}: {words}") from None


def _vehicle_and_gravity(
    fields: Fields, reading: ScenarioWords, beside: Sequence[str] = ()
) -> tuple[Vehicle, float]:
    """Vehicle of [plant] or [model] with the payload, drives and joint values that the
    table states, and gravity.
    """
    vehicle = reading.vehicle(fields.where)
    fields.take("vehicle")
    if "payload" in fields.table:
        try:
            vehicle = record_from(Payload, fields.inner("payload")).held_by(vehicle)
        except ValueError as error:
            words = str(error)
            at = fields.at("payload")
            raise ValueError(
                words if words.startswith(at) else f"{at}: {words}"
            ) from None
    if fields.where.split(".")[-1] == "model" and "drives" in fields.table:
        drives = fields.inner("drives").table
        vehicle = dataclasses.replace(
            vehicle, drives=mounted_drives(drives, fields.at("drives"))
        )
    vehicle = _with_joint_numbers(vehicle, fields.inner("joints"))
    gravity = fields.number("gravity", 9.81, low=0.0)
    fields.done(beside)
    return vehicle, gravity


def controller(entry: object, path: str, reading: ScenarioWords) -> Controller:
    """Read [controller]: a control law for the model, with its safety and actuator
    layers.
    """
    return own_controller(Fields(entry, path), reading, reading.law)


def own_controller(
    fields: Fields, reading: ScenarioWords, replaced: str | None = None
) -> Controller:
    """Read [controller] as it stands, or with another law or file of gains."""
    believed = reading.word("model")
    facts = loop_facts(
        reading.word("rates"), reading.word("delays"), reading.word("estimator")
    )
    return controller_from(fields, believed, replaced, facts, reading.folder)


def law(scenario: Scenario, name: object) -> Controller:
    """Controller of a given name, with the safety layer of the present controller if it
    has one.
    """
    if not isinstance(name, str):
        raise ValueError(
            f"{LAW} = {shown(name)}: must be the name of a preset, a law or LAW_tuned"
        )
    if is_law_of_file(name):
        raise ValueError(
            f"{LAW} = {shown(name)}: must not be a file's; only --laws takes"
            " FILE.py:make"
        )
    try:
        return controller_by_name(scenario, name)
    except ControllerError as error:
        raise ValueError(str(error).replace("controller = ", f"{LAW} = ", 1)) from None


def _with_joint_numbers(vehicle: Vehicle, table: Fields) -> Vehicle:
    """Vehicle with joint values replaced, such as damping: one value for all joints, or
    a list with one for each.
    """
    numbers: dict[Place, float] = {}
    for name in JOINT_NUMBERS:
        value = table.take(name, None)
        at = table.at(name)
        if isinstance(value, list) and len(value) != vehicle.n:
            raise ValueError(
                f"{at} = {shown(value)}: must be a number, or {vehicle.n} numbers, one"
                " for each joint"
            )
        for i in range(vehicle.n if value is not None else 0):
            given, where = (
                (value[i], f"{at}[{i}]") if isinstance(value, list) else (value, at)
            )
            joint_number = number(given, where, low=0.0, strict=name == "coulomb_rate")
            accept_scalar(where, joint_number, units(Joint)[name])
            # a stop of exactly no stiffness is none
            numbers["links", str(i), "joint", name] = (
                0 if name == "stop_stiffness" and joint_number == 0.0 else joint_number
            )
    table.done()
    return replace_at(vehicle, numbers) if numbers else vehicle


def world(
    entry: Entry | None, path: str, reading: ScenarioWords
) -> Component[Tree] | None:
    """Read [world]: surfaces, objects, contact points and grippers, which phases of a
    task may command.
    """
    component = None if entry is None else reading.stated_world
    for agent, every in reading.events:
        events = [event for event in every if event.gripper]
        component = (
            with_commands(component, events, reading.word("rates").control, agent)
            if events
            else component
        )
    return component


def stated_world(entry: Entry, path: str, folder: Path) -> Component[Tree]:
    """Read [world] without commands of a task."""
    return registered_from(
        "world", Component, with_files(entry, path, folder), path, "contact"
    )


def payloads(
    entry: object, path: str, reading: ScenarioWords
) -> tuple[TimedPayload, ...]:
    """Read [[payloads]], with pick and drop times from the phases of a task."""
    # the phases of a task are its events, so that the reference is read first
    reading.word("reference")
    events = [event for event in reading.setting.events if not event.gripper]
    tables = (
        with_instants(entry, events, reading.word("rates").control) if events else entry
    )
    return registered_values("payload", TimedPayload, tables, path, "rigid")


def with_files(table: Entry, where: str, folder: Path) -> Entry:
    """Tables of [reference] or [world] with absolute paths of samples and meshes, and
    the surfaces of files.

    Args:
        table: plain table of a file.
        where: its place in the file.
        folder: folder of the file.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """

    def absolute(word: str, path: str, at: str) -> str:
        if word == "file":
            return str(folder / path)
        from skyarm.records.files.stl_mesh import read_corners

        with errors_as(ValueError, f"{at}.mesh = {shown(path)}: "):
            read_corners(folder / path)
        # a log is drawn from any folder
        return str((folder / path).absolute())

    if where == "world":
        from skyarm.world.contact.surface_files import with_bodies

        table = with_bodies(table, folder)
    return _with_paths(table, where, absolute)


def _with_paths(
    table: Entry, where: str, other: Callable[[str, str, str], str]
) -> Entry:
    """Replace the file paths in tables of [reference] or [world] by a function of key,
    path and table location.
    """
    if isinstance(table, list):
        return [
            _with_paths(each, f"{where}[{i}]", other) for i, each in enumerate(table)
        ]
    if not isinstance(table, Mapping):
        return table
    entries = {
        name: _with_paths(each, f"{where}.{name}", other)
        for name, each in table.items()
    }
    # only these have a key "file" that is a path; a user's own kind may not
    body = where.startswith("world.bodies[")
    named = body or table.get("kind") in ("samples", "plan")
    keys = ("file", "mesh") if named else ("mesh",)
    paths = {
        key: path for key in keys if isinstance(path := table.get(key), str) and path
    }
    return entries | {key: other(key, path, where) for key, path in paths.items()}


NAMED_FILES = ("plant", "vehicle"), ("model", "vehicle"), ("controller", "tuned")
"""Tables and keys whose text is a file path or the name of a shipped file."""


def with_other_paths(
    tables: Mapping[str, Entry], other: Callable[[str], str]
) -> dict[str, Entry]:
    """Tables of a scenario file with all file paths replaced by a function of the path.

    Args:
        tables: plain tables of a file.
        other: function from a path of a vehicle, of gains, samples or a mesh to the
            path in its place.
    """
    replaced = dict(tables)
    for name, word in NAMED_FILES:
        table = tables.get(name)
        if (
            isinstance(table, Mapping)
            and isinstance(entry := table.get(word), str)
            and entry not in list_vehicles()
        ):
            replaced[name] = {**table, word: other(entry)}
    files = (name for name in ("reference", "world") if name in replaced)
    replaced |= {
        name: _with_paths(replaced[name], name, lambda _, path, __: other(path))
        for name in files
    }
    agents = Fields(replaced, "").inner(AGENTS)
    own: dict[str, Entry] = {
        name: with_other_paths(agents.inner(name).table, other) for name in agents.table
    }
    return replaced | ({AGENTS: own} if own else {})


def changes(entry: object, path: str, reading: ScenarioWords) -> tuple[Change, ...]:
    """Read [[changes]] of a scenario file, with sample files read in and paths of other
    files made absolute.
    """
    read = [record_from(Change, table) for table in list_of_tables(entry, path)]

    def absolute(_: str, file: str, __: str) -> str:
        # a change is read again wherever it is flown
        return str((reading.folder / file).absolute())

    values = (
        _without_files(each.table, f"{path}[{i}].value", reading.folder)
        for i, each in enumerate(read)
    )
    return tuple(
        dataclasses.replace(each, value=_with_paths(value, path, absolute))
        for each, value in zip(read, values, strict=True)
    )


def _without_files(table: Entry, where: str, folder: Path) -> Entry:
    """Value of a scheduled change, with samples read from their file and paths of gains
    files made absolute.

    Args:
        table: plain table of a file.
        where: its place in the file.
        folder: folder of the file.
    """
    if isinstance(table, list):
        return [
            _without_files(each, f"{where}[{i}]", folder)
            for i, each in enumerate(table)
        ]
    # a change is read again in flight, when the folder of its file is not known
    if is_gains_file(table):
        return str((folder / table).absolute())
    if not isinstance(table, dict):
        return table
    if table.get("kind") == "samples" and isinstance(file := table.get("file"), str):
        return samples_as_spline(Fields(table | {"file": str(folder / file)}, where))
    return {
        name: _without_files(each, f"{where}.{name}", folder)
        for name, each in table.items()
    }


def setting_of(world: Truth, duration: float) -> Setting:
    """Setting of a flight for readers of a reference: vehicle, gravity, duration and
    thrust-to-weight ratio.
    """
    weight = float(world.vehicle.mass) * float(world.gravity)
    # without weight every thrust is enough
    most = float(highest_thrust(world.vehicle)) / weight if weight > 0.0 else math.inf
    return Setting(
        vehicle=world.vehicle,
        gravity=float(world.gravity),
        duration=duration,
        thrust_to_weight=most,
    )


def feasibility_of(scenario: Scenario) -> Feasibility | None:
    """Feasibility of the tip's reference against reach and limits; None where the tip
    has no reference.
    """
    from skyarm.reference.feasibility import feasibility

    return feasibility(
        scenario.agent.reference, setting_of(scenario.agent.plant, scenario.duration)
    )


def reference(entry: Entry, path: str, reading: ScenarioWords) -> Trajectory:
    """Read [reference], and store the events of its task in the flight data."""
    vehicle = reading.word("plant").vehicle
    setting = reading.setting
    team = reading.word("team")
    # a misspelt agent would be one more, at the origin: beside others with a reference
    # of their own, one without is refused
    if path == "reference" and reading.name and (team is not None or not entry):
        stated = Fields(reading.entry_at(AGENTS), AGENTS).table.items()
        if team:
            led = [each.agent for each in team.members]
        else:
            led = [name for name, own in stated if "reference" in own]
        if led and reading.name not in led:
            words = (
                f"{did_you_mean(reading.name, led)}must have a reference of its own,"
                " or be one of"
            )
            raise ValueError(f"{AGENTS}.{reading.name}: {words} {comma_list(led)}")
    if team is None and isinstance(entry, dict) and "object" in entry:
        raise ValueError(f"{path}.object: must be left out without [team]")
    # [reference.object] is the motion of the team's body, read with the team
    if team is not None and isinstance(entry, dict):
        entry = {
            name: each
            for name, each in entry.items()
            if name != "object" or path != "reference"
        }
        for member in team.members:
            if member.agent == reading.name:
                turned = (
                    (team.motion.roll, team.motion.pitch, team.motion.yaw)
                    if member.kind == "fixed"
                    else ()
                )
                path_of_member = team.path_of(
                    member, vehicle, setting.gravity, setting.duration
                )
                setting = dataclasses.replace(
                    setting, carried=path_of_member, turned=turned
                )
    return reference_from(
        with_files(entry, path, reading.folder), vehicle.n, path, setting
    )


def team(entry: object, path: str, reading: ScenarioWords) -> Team:
    """Read [team]; what it leaves out of members and body is that of [world], the
    motion is [reference.object].
    """
    from skyarm.world.team import Member, Team

    record = registered_from("team", Team, entry, path, word="law")
    contact = _stated_contact(reading)
    objects = {each.name: each for each in contact.objects}
    if record.object not in objects:
        raise ValueError(
            f"{path}.object = {shown(record.object)}:"
            f" {must_be_one_of(objects, record.object)}"
        )
    body = objects[record.object]
    grasps = [each for each in contact.grasps if each.body == record.object]
    by_agent = {each.agent: each for each in grasps}
    if isinstance(entry, Mapping) and entry.get("members") == []:
        raise ValueError(f"{path}.members = []: must be two or more, or left out")
    for i, grasp in enumerate(contact.grasps):
        if grasp.agent not in reading.agents:
            words = must_be_one_of(reading.agents, grasp.agent)
            raise ValueError(f"world.grasps[{i}].agent = {shown(grasp.agent)}: {words}")
    if len(by_agent) < len(grasps):
        raise ValueError(
            "world.grasps: must be one of each member of a team at"
            f" {shown(record.object)}"
        )
    members = record.members or tuple(
        Member(agent=each.agent, place=each.place) for each in grasps
    )
    if len(members) < 2:
        words = (
            f"{len(members)} members: must be two or more, each with a grasp of"
            f" {shown(record.object)}"
        )
        raise ValueError(f"{path}.members = {words}")
    with errors_as(ValueError, f"{path}."):
        named = dataclasses.replace(record, members=members)
        named.require_members(reading.agents, 1.0 / reading.word("rates").control)
    for i, each in enumerate(members):
        if each.agent not in by_agent:
            words = f"must hold {shown(record.object)} by one of [[world.grasps]]"
            raise ValueError(
                f"{path}.members[{i}].agent = {shown(each.agent)}: {words}"
            )
        with errors_as(ValueError, f"{path}.members[{i}]."):
            body.require_near(each.place)
            own = by_agent[each.agent].kind
            if own != "cable" and (each.length or each.kind == "cable"):
                stated = (
                    f"length = {each.length:g}" if each.length else "kind = 'cable'"
                )
                raise ValueError(
                    f"{stated}: must be left out, the grasp of {shown(each.agent)} is"
                    f" of kind {own!r}"
                )
    # directions of cables are planned, so that all shares must be known before the
    # flight
    usual = 1.0 if any(each.kind == "cable" for each in grasps) else 0.0
    taken = ((each, each.taken or by_agent[each.agent].place) for each in members)
    members = tuple(
        dataclasses.replace(
            each,
            taken=None if at == each.place else at,
            kind=each.kind or by_agent[each.agent].kind,
            length=each.length or cast("float", by_agent[each.agent].length),
            mass=each.mass or usual,
        )
        for each, at in taken
    )
    motion = motion_of_object(
        Fields(reading.entry_at("reference.object"), "reference.object"), body.position
    )
    # all members hold from the last of these instants on
    take = max(float(record.take), *(float(each.close) for each in grasps))
    if float(motion.lift) < take:
        words = (
            f"must not lift before {take:g} s, when all members hold"
            f" {shown(record.object)}"
        )
        raise ValueError(
            f"reference.object.phases: lifts at {float(motion.lift):g} s: {words}"
        )
    com = record.com if any(record.com) else body.com
    if any(com) and len(members) == 2 and all(each.kind == "cable" for each in members):
        words = "must be 0 on two cables: their team's body hangs by its middle"
        where = "team.com" if any(record.com) else f"world.objects.{record.object}.com"
        raise ValueError(f"{where} = {shown([float(c) for c in com])}: {words}")
    return dataclasses.replace(
        record,
        members=members,
        motion=motion,
        take=take,
        mass=record.mass or body.mass,
        inertia=record.inertia if any(record.inertia) else body.moments,
        com=com,
    )


def _stated_contact(reading: ScenarioWords) -> Contact:
    """Contact model of [world], whose objects a team can hold."""
    from skyarm.world.contact.contact import Contact

    world = reading.stated_world
    if isinstance(world, Contact):
        return world
    stated = Fields(reading.entry_at("world"), "world").take("kind")
    raise ValueError(
        f"world.kind = {stated!r}: must be registered as a subclass of Contact"
    )


def at_start(
    scenario: Scenario, initials: Mapping[str, tuple[object, str]]
) -> Scenario:
    """Scenario with given initial states, objects in static equilibrium, and no initial
    penetration.

    Args:
        scenario: scenario with the vehicles at their references.
        initials: by the agent's name the entry of its initial state, None for hover
            trim, and the entry's path.
    """
    if scenario.world is not None:
        from skyarm.world.contact.static_equilibrium import with_standing_objects

        gravity = float(next(iter(scenario.agents.values())).plant.gravity)
        rested = with_standing_objects(scenario.world, gravity)
        scenario = dataclasses.replace(
            scenario,
            environment=dataclasses.replace(scenario.environment, world=rested),
        )
    for name, (initial, path) in initials.items():
        if initial is not None:
            one = scenario.of(name)
            one = one.with_initial(initial_state(Fields(initial, path), one))
            check_scenario(one, [INITIAL])
            scenario = dataclasses.replace(
                scenario, agents={**scenario.agents, name: one.agent}
            )
    begin(scenario)
    return scenario


def initial_state(fields: Fields, scenario: Scenario) -> State:
    """Read [initial]: hover trim with given fields replaced, or a vehicle standing on a
    surface with rotors off.
    """
    stands = fields.flag("standing", False)
    keys = words_of_fields(State)
    # keys are taken from the table below
    stated = {*fields.table}
    start = scenario.agent.reference.at(0.0)
    joints = rules(State)["joints"](
        fields.at("joints"), fields.numbers("joints", [float(q) for q in start.joints])
    )
    n = scenario.agent.vehicle.n
    if len(joints) != n:
        raise ValueError(
            f"{fields.at('joints')}: {len(joints)} values, must be {n}, one for each"
            " joint"
        )
    trim = trimmed_state(scenario.agent.plant, start.position, float(start.yaw), joints)
    if stands:
        _require_standing(fields, scenario)
        trim = dataclasses.replace(trim, rotor_speeds=(0.0,) * len(trim.rotor_speeds))
    quaternion = fields.numbers("quaternion_wxyz", list(trim.quaternion))
    check_quaternion(quaternion)
    # decimals of a file have length 1 up to rounding only
    length = math.sqrt(sum(c * c for c in quaternion))
    vectors = {
        name: Vec3(*fields.vector(name, tuple(getattr(trim, name))))
        for name in ("position", "velocity", "rate")
    }
    state = State(
        quaternion=Quaternion(*(c / length for c in quaternion)),
        joints=joints,
        joint_rates=fields.numbers("joint_rates", trim.joint_rates),
        rotor_speeds=fields.numbers("rotor_speeds", trim.rotor_speeds),
        tilts=fields.numbers("tilts", trim.tilts),
        **vectors,
    )
    fields.done()
    if not stands:
        left_out = [
            name
            for name in field_names(State) or ()
            if keys.get(name, name) not in stated
        ]
        return PartialState.of(state, left_out, scenario.agent.vehicle)
    from skyarm.world.contact.static_equilibrium import stand_vehicle

    return stand_vehicle(
        scenario.agent.vehicle,
        float(scenario.agent.plant.gravity),
        scenario.worlds[0].of_agent(next(iter(scenario.agents))),
        state,
    )


def _require_standing(fields: Fields, scenario: Scenario) -> None:
    """Raise an error for a start standing on a surface if there are no surfaces, or
    with an initial motion.
    """
    if not scenario.worlds:
        raise ValueError(
            f"{fields.at('standing')} = true: must be false without a [world] to"
            " stand on"
        )
    for name in ("quaternion_wxyz", "velocity", "rate", "joint_rates", "rotor_speeds"):
        # its first number says that it is not
        turned = fields.numbers(name, ())[name == "quaternion_wxyz" :]
        if any(turned):
            raise ValueError(
                f"{fields.at(name)}: must be left out of a start that is standing: it"
                " is at rest"
            )


def require_plugins(top: Fields) -> None:
    """Raise an error if a plugin that a file requires by [plugins] need = [...] is not
    loaded.

    Raises:
        ValueError: one is not loaded, with how to load it.
    """
    table = top.inner("plugins")
    needed = table.take("need", [])
    table.done()
    if not isinstance(needed, list) or not all(
        isinstance(name, str) for name in needed
    ):
        raise ValueError(f"plugins.need = {shown(needed)}: must be a list of names")
    for name in needed:
        if name not in known_names():
            how = (
                LOADED_BY.format(name)
                if name.endswith(".py")
                else f"pip install {name}"
            )
            raise ValueError(
                f"plugins.need = {name!r}: is not loaded; {how}. A file that is read"
                " runs no code"
            )
