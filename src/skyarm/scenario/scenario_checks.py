"""Consistency checks of a scenario: clocks, delays, vehicles, law, sensors and
surroundings.

A rule says which words of the file it reads. All run where a scenario is loaded and
before it is flown (:func:`require_flight`); where numbers or parts are replaced, those
that read them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple

from skyarm.algebra import Mat3, Scalars
from skyarm.control.controller import (
    follows_plan,
    innermost,
    learns_load,
    part_of,
    senses_force,
)
from skyarm.control.law_checks import check_controller
from skyarm.control.model import JointGains, Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Mixer, make_mixer
from skyarm.dynamics.actuators.drive import Drive
from skyarm.dynamics.actuators.rotor import require_speeds
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.joint_rate import joint_rate
from skyarm.plant.largest_step import check_largest_step
from skyarm.plant.surroundings import motions_of
from skyarm.records.coerce import TOLERANCE, concrete
from skyarm.records.content import keep_results
from skyarm.records.field_rules import require_fields
from skyarm.records.files import did_you_mean, errors_as, must_be_one_of, number, shown
from skyarm.records.leaves import Place, Tree, leaves, named_leaves, part
from skyarm.records.words import Slot, slots
from skyarm.reference.trajectory import Trajectory, phase_words
from skyarm.scenario.endings import BodyCollision, BodyContact, RotorContact
from skyarm.scenario.paths import errors_of_agent, is_below, prefix_of
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.vehicle_records import require_plant
from skyarm.world import Component

if TYPE_CHECKING:
    from skyarm.sensing.cameras.camera_kinds import RaySensor
    from skyarm.world.contact.contact import Contact

LONGEST_FLIGHT = 10_000_000
"""Largest number of control periods of one episode, 14 h at 200 Hz; its log takes about
10 GB."""

STEPPING = ("mujoco",)
"""Kinds of plants that advance by whole physics steps only."""

LONGEST_QUEUE = 100
"""Largest varied command delay in control periods; the loop stores as many commands."""

LONGEST_QUEUE_OF_SERVO = 1000
"""Longest servo latency in control periods; the servo stores as many setpoints."""

MOST_JOINTS = 256
"""Largest number of joints of a vehicle that flies. LLVM's stack grows with the
compiled loop: 400 joints compile, 1200 end the process."""


class Rule(NamedTuple):
    """Consistency check of a scenario, with the keys of the scenario file that the
    check reads.

    Attributes:
        numbers: False if only counts, names and other structure are read, which no
            replaced number changes.
    """

    check: Callable[[Scenario], None]
    reads: tuple[str, ...]
    numbers: bool


RULES: list[Rule] = []
"""Consistency checks in the order of their messages; the first failure is reported."""


SHARED_RULES: list[Rule] = []
"""Checks of what all vehicles share, which are given the whole scenario; :data:`RULES`
are given that of each."""


def rule(
    *reads: str, numbers: bool = True, shared: bool = False
) -> Callable[[Callable[[Scenario], None]], Callable[[Scenario], None]]:
    """Add a function to the consistency checks of a scenario.

    Args:
        reads: words of a scenario's file, or paths below them, that the function reads.
        numbers: numbers as of :class:`Rule`.
        shared: True for a function that takes the scenario of all vehicles.
    """

    def add(check: Callable[[Scenario], None]) -> Callable[[Scenario], None]:
        (SHARED_RULES if shared else RULES).append(Rule(check, reads, numbers))
        return check

    return add


def check_scenario(
    scenario: Scenario,
    changed: Collection[Place] | None = None,
    *,
    numbers: bool = False,
) -> None:
    """Raise an error if the plant, law, sensors, clocks and other settings of a
    scenario are inconsistent.

    Args:
        scenario: scenario to check.
        changed: fields that differ from a scenario that was checked: only rules that
            read them run; None for all.
        numbers: True if nothing but numbers differs.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    rules = [
        r
        for r in RULES
        if changed is None or ((r.numbers or not numbers) and touches(r, changed))
    ]
    for name in scenario.agents:
        one = scenario.of(name)
        # messages about the only vehicle name no agent
        with (
            errors_as(ScenarioError),
            errors_of_agent(name if scenario.is_team else ""),
        ):
            for each in rules:
                each.check(one)
    with errors_as(ScenarioError):
        for each in SHARED_RULES:
            if changed is None or (
                (each.numbers or not numbers) and touches(each, changed)
            ):
                each.check(scenario)


def touches(each: Rule, changed: Collection[Place]) -> bool:
    """True if a consistency check reads any given scenario field, a part of one, or a
    record that contains one.
    """
    # in loops: this runs for each rule and each number that a sweep replaces
    for word in each.reads:
        for read in read_places(word):
            for place in changed:
                if place[: len(read)] == read[: len(place)]:
                    return True
    return False


@cache
def read_places(word: str) -> tuple[Place, ...]:
    """Fields of a scenario that a key path of its file denotes, or that lie below the
    path.
    """
    places = []
    for slot in slots(Scenario):
        if is_below(word, slot.table):
            places.append(
                (*slot.record, *word[len(slot.table) + 1 :].split("."))
                if word != slot.table
                else slot.record
            )
        elif is_below(slot.table, word):
            places.append(slot.record)
    return tuple(places)


@rule("controller", numbers=False)
def law_has_model(scenario: Scenario) -> None:
    """Check that the constants of the control law contain a model of the vehicle."""
    if not isinstance(getattr(scenario.agent.controller.par, "model", None), Model):
        raise ValueError(
            f"controller.par = {shown(scenario.agent.controller.par)}: must have a"
            " model, a skyarm.Model"
        )


@rule("plant.vehicle", numbers=False)
def joints_can_be_compiled(scenario: Scenario) -> None:
    """Check that the plant has no more joints than machine code can be made for."""
    truth = scenario.agent.vehicle
    if truth.n > MOST_JOINTS:
        raise ValueError(
            f"plant.vehicle = {truth.name!r}: has {truth.n} joints, must have at most"
            f" {MOST_JOINTS} to fly"
        )


@rule("initial", "plant.vehicle", "plant.gravity", "reference")
def initial_state_is_possible(scenario: Scenario) -> None:
    """Check an initial state that is stated against the plant's joints, rotors and
    tilts.
    """
    if scenario.agent.initial is not None:
        _check_initial(first_state(scenario), scenario.agent.vehicle)


@rule("rates", "delays", "duration", "plant.kind")
def times_are_whole(scenario: Scenario) -> None:
    """Check that duration and delays are whole numbers of steps, and that a varied
    delay stays below its maximum.
    """
    rates, delays = scenario.rates, scenario.agent.delays
    if scenario.duration * rates.control > LONGEST_FLIGHT:
        most = f"{LONGEST_FLIGHT / rates.control:g} s"
        raise ValueError(
            f"duration = {scenario.duration!r}: must be at most {most} at this control"
            " rate"
        )
    require_whole("duration", scenario.duration, rates.control, "control periods")
    for name in ("measurement", "command", "rotors", "joints"):
        delay = getattr(delays, name)
        if not concrete(delay):
            continue
        if delay > scenario.duration:
            raise ValueError(
                f"delays.{name} = {delay!r}: must not exceed the duration of"
                f" {scenario.duration:g} s"
            )
        if name == "measurement":
            require_whole("delays.measurement", delay, rates.control, "control periods")
        # the closed loop in machine code takes any delay if it is told the longest;
        # MuJoCo's plant steps
        elif delays.longest_command is None or scenario.kind in STEPPING:
            require_whole(f"delays.{name}", delay, rates.physics, "physics steps")
    longest = delays.longest_command
    if longest is None:
        return
    if longest * rates.control > LONGEST_QUEUE:
        most = f"{LONGEST_QUEUE} control periods, {LONGEST_QUEUE / rates.control:g} s"
        raise ValueError(
            f"delays.longest_command = {longest!r}: must be at most {most}"
        )
    for name in ("rotors", "joints", "command") if concrete(delays.command) else ():
        own = getattr(delays, name)
        # of a delay of 0 the sum is the command's own, which is named by itself
        if (
            concrete(own)
            and (total := own if name == "command" else own and own + delays.command)
            > longest
        ):
            what = "" if name == "command" else " with delays.command"
            raise ValueError(
                f"delays.{name} = {total!r}{what}: must not exceed"
                f" delays.longest_command = {longest!r}"
            )


def require_whole(field: str, seconds: float, rate: int, unit: str) -> None:
    """Check that a time is a whole number of ticks of a clock (Hz), at least one if it
    is above 0.
    """
    count = seconds * rate
    # times such as 0.005 s are no exact floats, nor are their multiples
    if abs(count - round(count)) > 1e-6 or (seconds > 0.0 and round(count) < 1):
        raise ValueError(
            f"{field} = {seconds!r}: must be a whole number of {unit} of"
            f" {1.0 / rate:g} s"
        )


@rule("controller", "rates")
def clocks_of_law_agree(scenario: Scenario) -> None:
    """Check that control periods and filter cutoffs among a law's constants match the
    scenario's clocks.
    """
    par, rates = innermost(scenario.agent.controller.par), scenario.rates
    cutoff = getattr(par, "cutoff", None)
    if cutoff is not None and concrete(cutoff) and not 2.0 * cutoff < rates.control:
        raise ValueError(
            f"controller.cutoff = {cutoff!r}: must be below {0.5 * rates.control:g} Hz,"
            " half of rates.control"
        )
    for clock, rate in (("control", rates.control), ("reference", rates.reference)):
        period = getattr(par, f"{clock}_period", None)
        # 1e-6, because a stated period in decimals rounds one over the rate
        if period is not None and concrete(period) and abs(period * rate - 1.0) > 1e-6:
            raise ValueError(
                f"controller.{clock}_period = {period!r}: must be {1.0 / rate:g} s, as"
                f" rates.{clock} has it"
            )


@rule("reference", "duration", "plant.vehicle")
def reference_fits(scenario: Scenario) -> None:
    """Check that the law starts tracking within the flight and that a planned time law
    covers all of it.
    """
    if concrete(scenario.agent.tracking_start):
        start = number(
            scenario.agent.tracking_start, "reference.tracking_start", low=0.0
        )
        if start > scenario.duration:
            raise ValueError(
                f"reference.tracking_start = {start!r}: must not exceed the duration of"
                f" {scenario.duration:g} s"
            )
    if scenario.agent.path_time is not None:
        scenario.agent.path_time.check(
            scenario.duration, bool(scenario.agent.reference.guards)
        )
    count, joints = len(scenario.agent.reference.joints), scenario.agent.vehicle.n
    if count != joints:
        raise ValueError(
            f"reference.joints = {count} signals: must be {joints}, one for each joint"
        )


@rule("controller", "reference", numbers=False)
def plan_is_there(scenario: Scenario) -> None:
    """Check that a law that follows a plan's whole state has one, and a plan as many
    rotors as the model.
    """
    par, planned = scenario.agent.controller.par, scenario.agent.reference.planned
    if follows_plan(par) and not (planned and planned.attitude):
        raise ValueError(
            "controller.mode = 'plan': must be left out without a reference of kind"
            ' "plan"'
        )
    if planned is None:
        return
    own, nodes = len(par.model.vehicle.rotors), len(planned.times)
    if planned.attitude and len(planned.rotors) != own:
        raise ValueError(
            f"reference.planned.rotors = {len(planned.rotors)} signals: must be {own},"
            " one for each rotor"
        )
    for name, count in (("efforts", par.model.vehicle.n), ("force", 3)):
        lengths = [len(row) for row in getattr(planned, name)]
        if lengths and lengths != [nodes] * count:
            raise ValueError(
                f"reference.planned.{name}: must be {count} lists of {nodes} numbers,"
                " one for each time"
            )


@rule(
    "sensors",
    "rates",
    "plant.vehicle",
    "plant.drives",
    "controller",
    "reference",
    "world",
    "estimator",
)
def sensors_suffice(scenario: Scenario) -> None:
    """Check named sensors: periods, unique names, and all sensors that the law, phases
    and estimator need.
    """
    rates, vehicle = scenario.rates, scenario.agent.vehicle
    sensors: dict[str, Sensor] = {}
    for each in scenario.agent.sensors:
        where = f"sensors.{each.name}"
        if each.name in sensors:
            raise ValueError(f"{where}: the name is taken")
        sensors[each.name] = each.sensor
        rate = number(each.sensor.frequency, f"{where}.frequency", low=0.0)
        ratio = rates.control / rate if rate else 1.0
        # a whole number but for rounding
        if abs(ratio - round(ratio)) > 1e-9 * ratio:
            raise ValueError(
                f"{where}.frequency = {rate:g}: must divide rates.control ="
                f" {rates.control} Hz"
            )
        delay = number(each.sensor.latency, f"{where}.latency", low=0.0)
        require_whole(f"{where}.latency", delay, rates.control, "control periods")
        with errors_as(ValueError, f"{where}."):
            each.sensor.require_vehicle(vehicle)
    par, named_sensors = scenario.agent.controller.par, tuple(sensors.items())
    if senses_force(par):
        _require_tip_sensor("controller", named_sensors, vehicle)
    _check_guards(scenario.agent.reference, named_sensors, vehicle)
    grippers = () if scenario.world is None else scenario.world.grippers
    names = ("", *scenario.agents)
    reported = any(
        each.agent in names and each.frame in ("", vehicle.end_effector)
        for each in grippers
    )
    if learns_load(par) and scenario.agent.reference.load is None and not reported:
        # the law that waits to be told adapts no tip mass meanwhile, so it would know
        # less than without the option
        most = shown(part_of(scenario.agent.controller.par, "load").limit)
        words = (
            "must be 0 without reference.load or a gripper at the tip, which says when"
            " a load is held"
        )
        raise ValueError(f"controller.load = {most}: {words}")
    scenario.agent.estimator.require_sensors(sensors, rates.control, par.model.vehicle)
    # the scenario's own drives, too, of which the model need not know
    scenario.agent.estimator.require_torques(
        vehicle.name, {each.joint: each.drive for each in scenario.agent.joint_drives}
    )


@rule("controller", "sensors", "endings", numbers=False)
def pictures_are_taken(scenario: Scenario) -> None:
    """Check that the law and the endings see cameras or lidars of the vehicle."""
    cameras = scenario.agent.cameras
    sees: dict[str, Sequence[str]] = {"controller": scenario.agent.controller.sees}
    sees |= {f"endings[{i}]": each.sees for i, each in enumerate(scenario.endings)}
    for where, names in sees.items():
        if isinstance(names, str) or len({*names}) < len(names):
            allowed = "must be a list of cameras, each once"
            raise ValueError(f"{where}: sees = {shown(names)}: {allowed}")
        for name in names:
            if name not in cameras:
                allowed = f"{must_be_one_of(cameras, name)}, or" if cameras else "must"
                raise ValueError(
                    f"{where}: sees = {shown(name)}: {allowed} be a table"
                    f' [sensors.{name}] with kind = "depth_camera" or "lidar"'
                )


@rule("plant.drives", "plant.vehicle", "environment", "rates")
def drives_fit(scenario: Scenario) -> None:
    """Check that drives belong to joints with torque, and that drives and environment
    models are stable.
    """
    period, vehicle = scenario.rates.period, scenario.agent.vehicle
    joints, own = vehicle.joint_names, [each.joint for each in scenario.agent.drives]
    added: list[tuple[str, Component[Tree] | Drive]] = [
        *scenario.environment.placed_models
    ]
    for fitted in scenario.agent.joint_drives:
        where = (
            f"plant.{'' if fitted.joint in own else 'vehicle.'}drives.{fitted.joint}"
        )
        added.append((where, fitted.drive))
        latency = getattr(fitted.drive, "latency", 0.0)
        if (
            concrete(latency)
            and latency * scenario.rates.control > LONGEST_QUEUE_OF_SERVO
        ):
            most = (
                f"{LONGEST_QUEUE_OF_SERVO} control periods,"
                f" {LONGEST_QUEUE_OF_SERVO * period:g} s"
            )
            raise ValueError(f"{where}.latency = {latency!r}: must be at most {most}")
    check_largest_step(added, period)
    for joint in own:
        if joint not in joints or own.count(joint) > 1:
            raise ValueError(
                f"drives: joint = {shown(joint)}: must be one of"
                f" {', '.join(joints) or 'none'}, once"
            )
        limit = vehicle.links[joints.index(joint)].joint.effort_limit
        if concrete(limit) and limit == 0:
            words = (
                "must be above 0 ([[joints]] of its file): it leaves"
                f" plant.drives.{joint} no torque"
            )
            raise ValueError(
                f"plant.vehicle: joints[{joint}].effort_limit = 0: {words}"
            )


@rule("controller")
def law_can_be_called(scenario: Scenario) -> None:
    """Check a user's law by calling it."""
    check_controller(scenario.agent.controller)


@rule("plant.vehicle")
def plant_can_fly(scenario: Scenario) -> None:
    """Check that the plant can be simulated: its rotors span torque and thrust, whether
    they can lift it or not.
    """
    truth = scenario.agent.vehicle
    with errors_as(ValueError, f"plant.vehicle = {truth.name!r}: "):
        _require_plant(truth)


# 16 is chosen: a miss costs 1 ms (measured)
@keep_results(16)
def _require_plant(truth: Vehicle) -> None:
    """Raise an error if a vehicle cannot be simulated."""
    require_plant(truth)
    # called for their refusals: both are made again where they are used
    make_mixer(truth)
    joint_rate(truth)


@rule("plant.vehicle", "controller", numbers=False)
def law_fits_plant(scenario: Scenario) -> None:
    """Check that plant and model have as many joints and rotors, and that lists of the
    law have matching lengths.
    """
    truth, model = scenario.agent.vehicle, scenario.agent.model.vehicle
    for what, ours, theirs in (
        ("joints", truth.n, model.n),
        ("rotors", len(truth.rotors), len(model.rotors)),
    ):
        if ours != theirs:
            raise ValueError(
                f"model.vehicle = {model.name!r}: has {theirs} {what}, must have {ours}"
                f" as the plant {truth.name!r}"
            )
    for field, values, count in _counts_of_law(
        scenario.agent.controller.par, model.n, len(model.rotors)
    ):
        if len(values) != count:
            raise ValueError(
                f"controller.{field}: {len(values)} values, must be {count}"
            )


def _counts_of_law(
    par: object, joints: int, rotors: int
) -> Iterator[tuple[str, Sequence[object], int]]:
    """Lists among a law's constants whose lengths must match joints or rotors: (field,
    values, length).
    """
    # the recovery belongs to a layer around the law, which may have others around it
    layer = par
    while getattr(layer, "recovery", None) is None and hasattr(layer, "inner"):
        layer = layer.inner
    recovery = getattr(layer, "recovery", None)
    if recovery is not None:
        yield "recovery.stow", recovery.stow, joints
        yield "recovery.stow_speed", recovery.stow_speed, joints
        yield "recovery.joint_gains.stiffness", recovery.joint_gains.stiffness, joints
        yield "recovery.joint_gains.damping", recovery.joint_gains.damping, joints
    par = innermost(par)
    gains = getattr(par, "joint_gains", None)
    mixer = getattr(par, "mixer", None)
    if isinstance(gains, JointGains):
        yield "joint_gains.stiffness", gains.stiffness, joints
        yield "joint_gains.damping", gains.damping, joints
    for name in ("friction_compensation", "rate_weights"):
        if getattr(par, name, ()):
            yield name, getattr(par, name), joints
    if isinstance(mixer, Mixer):
        yield "mixer.highest", mixer.highest, rotors
        yield "mixer.inverse", mixer.inverse, rotors
        for i, row in enumerate(mixer.inverse):
            # of thrust and three torques
            yield f"mixer.inverse[{i}]", row, 4
        if mixer.across:
            yield "mixer.across", mixer.across, rotors


@rule("environment", "payloads", "plant.vehicle", "plant.gravity", "rates")
def surroundings_fit(scenario: Scenario) -> None:
    """Check that faults, forces and contact models name existing actuators, frames and
    links of the plant.
    """
    vehicle, period = scenario.agent.vehicle, scenario.rates.period
    for i, fault in enumerate(scenario.agent.faults):
        with errors_as(ValueError, f"environment.faults[{i}]."):
            fault.check(vehicle)
    for where, component in scenario.agent.placed_models(scenario.environment):
        with _at_its_place(where):
            component.require_vehicle(vehicle, period, scenario.agent.plant.gravity)


@rule(
    "environment",
    "team",
    "world",
    "plant.vehicle",
    "plant.gravity",
    "plant.closure",
    "plant.contact",
    "rates",
    shared=True,
)
def shared_surroundings_fit(scenario: Scenario) -> None:
    """Check that contact and other models that all vehicles share name vehicles, frames
    and bodies that exist.
    """
    period = scenario.rates.period
    gravities = {name: a.plant.gravity for name, a in scenario.agents.items()}
    first = next(iter(gravities))
    for name, gravity in gravities.items():
        if concrete(gravity, gravities[first]) and gravity != gravities[first]:
            words = f"must be {gravities[first]!r} as of {first}; there is one world"
            raise ValueError(f"agents.{name}.plant.gravity = {gravity!r}: {words}")
    agents = ("", *scenario.agents, *scenario.others)
    for where, force in scenario.environment.placed_models:
        # a part of a user may have one of its own
        agent = getattr(force, "agent", "")
        if type(agent) is str and agent not in agents:
            raise ValueError(
                f"{where}.agent = {shown(agent)}: {must_be_one_of(agents[1:], agent)}"
            )
    for where, whole in scenario.placed_shared:
        # in the flight of one, the parts of a world that are of others have no vehicle
        component = whole.of_agent(first) if scenario.others else whole
        with _at_its_place(where):
            component.require_vehicles(scenario.vehicles, period, gravities[first])


@rule("team", "controller", numbers=False, shared=True)
def laws_take_instructions(scenario: Scenario) -> None:
    """Check that the laws of a team's members accept instructions of the team's law."""
    team, agents = scenario.team, scenario.agents.items()
    deaf = [
        name
        for name, each in agents
        if part_of(each.controller.par, "carrying") is None
    ]
    for each in team.members if team is not None and team.steers else ():
        if each.agent in deaf:
            allowed = "must be above 0, as 0.7, under this law of [team]"
            words = "the centroidal law has it in mode 'tip', or without joints"
            raise ValueError(
                f"agents.{each.agent}.controller.carrying: {allowed}; {words}"
            )


@contextmanager
def _at_its_place(where: str) -> Iterator[None]:
    """Context manager that puts the path of an environment model before the messages
    about its fields.
    """
    try:
        yield
    except ValueError as error:
        words = str(error)
        raise ValueError(
            words if words.startswith(where) else f"{where}.{words}"
        ) from None


def _fields_of_users(slot: Slot, scenario: Scenario) -> None:
    """Check the numbers of models, such as forces, since user-defined classes may lack
    checks of their own.
    """
    require_fields(part(scenario, slot.record), slot.table)


RULES += [
    Rule(partial(_fields_of_users, slot), (slot.table,), True)
    for slot in slots(Scenario)
    if slot.word.kind
]


def _check_initial(state: State, vehicle: Vehicle) -> None:
    """Check an initial state: a number for each joint and rotor, feasible rotor speeds,
    and a unit quaternion.
    """
    rotors, tilts = len(vehicle.rotors), len(vehicle.tilts)
    counts = (
        ("joints", vehicle.n),
        ("joint_rates", vehicle.n),
        ("rotor_speeds", rotors),
        ("tilts", tilts),
    )
    for name, count in counts:
        if len(getattr(state, name)) != count:
            raise ValueError(
                f"initial.{name}: {len(getattr(state, name))} values, must be {count}"
            )
    require_speeds(vehicle.rotors, state.rotor_speeds, "initial.rotor_speeds")
    for i, (angle, tilt) in enumerate(zip(state.tilts, vehicle.tilts, strict=True)):
        if (
            concrete(angle, tilt.lower, tilt.upper)
            and not tilt.lower <= angle <= tilt.upper
        ):
            allowed = (
                f"must be from {tilt.lower:g} to {tilt.upper:g} rad, the range of its"
                " servo"
            )
            raise ValueError(f"initial.tilts[{i}] = {angle!r}: {allowed}")
    check_quaternion(tuple(state.quaternion))


def check_quaternion(values: Scalars) -> None:
    """Check that a quaternion is four numbers of unit length."""
    good = len(values) == 4
    # traced numbers have no length to see
    if good and concrete(*values):
        good = abs(math.sqrt(sum(c * c for c in values)) - 1.0) <= TOLERANCE
    if not good:
        raise ValueError(
            f"initial.quaternion_wxyz = {shown(list(values))}: must be four numbers of"
            f" length 1 within {TOLERANCE:g}"
        )


@rule(
    *("endings", "world", "plant.closure", "plant.contact"), numbers=False, shared=True
)
def collisions_can_happen(scenario: Scenario) -> None:
    """Check that the pairs which end a flight are among those whose touch its end
    sees.
    """
    for i, ending in enumerate(scenario.endings):
        if isinstance(ending, BodyCollision):
            names = [
                pair.name
                for agent in scenario.agents
                for contact in ending.contacts(scenario.of(agent))
                for pair in contact.body_pairs
            ]
            if not any(map(ending.ends, names)):
                if not names:
                    raise ValueError(
                        f"endings[{i}]: kind = 'collision' must be left out: no shape"
                        " of a vehicle ([[collisions]]) may touch a surface at rest"
                        " ([world])"
                    )
                given = f"endings[{i}].pair = {shown(ending.pair)}"
                raise ValueError(
                    f"{given}: {must_be_one_of(names, ending.pair)} of a vehicle's"
                    " shapes with surfaces at rest or its own"
                )


def require_flight(scenario: object) -> None:
    """Raise an error unless a scenario can be flown: consistent, of plain numbers, and
    started outside all surfaces.

    Raises:
        ScenarioError: one line with field and value.
    """
    if not isinstance(scenario, Scenario):
        raise ScenarioError(
            f"scenario = {shown(scenario)}: must be a Scenario; load_scenario(name)"
            " makes one"
        )
    if scenario.others:
        raise ScenarioError(
            f"agents = {', '.join(scenario.agents)}: flies beside"
            f" {', '.join(scenario.others)}; fly all"
        )
    check_scenario(scenario)
    for one in map(scenario.of, scenario.agents):
        for slot in slots(Scenario):
            for field, value in named_leaves(part(one, slot.record), slot.table):
                # the table of a change holds what a file would, plain numbers only
                if not (
                    concrete(value) or callable(value) or isinstance(value, Mapping)
                ):
                    said = f"{field} = {shown(value)}"
                    raise ScenarioError(
                        f"{said}: must be one number; a Batch flies several side by"
                        " side"
                    )
    with errors_as(ScenarioError):
        begin(scenario)


def _numbers_of_start(scenario: Scenario) -> object:
    """Parts of a scenario that decide how its vehicles start among the bodies that they
    may touch; none without any.
    """
    if not scenario.worlds:
        return ()
    agents = [
        (name, each.plant, each.reference, each.initial, each.cameras)
        for name, each in scenario.agents.items()
    ]
    return scenario.environment.world, scenario.solver.contact, scenario.closure, agents


# 16 is chosen: a miss costs 5 ms of carry_in_wind (measured)
@keep_results(16, _numbers_of_start)
def begin(scenario: Scenario) -> None:
    """Compute where the vehicles start, and meet the bodies that they may touch.

    Raises:
        ValueError: one line: a vehicle starts inside a surface, with an excessive
            contact force, or out of reach.
    """
    states = list[State]()
    for name in scenario.agents if scenario.worlds else ():
        states.append(first_state(one := scenario.of(name)))
        _require_start_outside(one, name, states[-1])
    truths = [each.plant for each in scenario.agents.values()]
    for contact in scenario.worlds:
        motion = motions_of(truths, states, tuple(scenario.agents))[0]
        contact.require_within_reach(motion)
        cameras = any(each.cameras for each in scenario.agents.values())
        # of a batch each lane shows itself
        if (cameras or contact.vehicle_bodies) and concrete(
            *leaves((contact, *states, *truths))
        ):
            from skyarm.world.contact.initial_world import require_bodies_apart

            require_bodies_apart(contact, motion)
            if cameras:
                _require_clear_views(scenario, contact, motion)


def _require_clear_views(
    scenario: Scenario, contact: Contact, motion: PointMotion
) -> None:
    """Raise an error if a camera starts inside a surface or a movable body, or is one
    beside a heightfield.
    """
    from skyarm.world.contact.contact_point import ContactPoint

    places = tuple(
        ContactPoint(
            name=f"{prefix_of(scenario, agent)}sensors.{name}.position",
            body=sensor.link,
            position=sensor.position,
            agent=agent,
        )
        for agent, own in scenario.agents.items()
        for name, sensor in own.cameras.items()
    )
    for surface in contact.surfaces:
        # no ray meets one: a picture without it would show what is behind
        if surface.shape == "heightfield":
            raise ValueError(
                f"{places[0].name.removesuffix('.position')}: sees no heightfield, must"
                f" be left out beside world.surfaces[{surface.name}]"
            )
    seeing = replace(contact, points=places)
    # nothing is advanced, so any period will do
    meetings = seeing.meetings(seeing.start(1.0, ()), motion)
    for met in meetings[: seeing.logged_pairs]:
        if met.touch.depth > 0.0:
            where = places[met.index]
            given = shown([float(c) for c in where.position])
            raise ValueError(
                f"{where.name} = {given}: starts inside {met.surface!r}, must start"
                " outside"
            )
    for agent, own in scenario.agents.items():
        for name, sensor in own.cameras.items():
            if within := _shape_around(sensor, own.vehicle, motion.of(agent)):
                given = shown([float(c) for c in sensor.position])
                raise ValueError(
                    f"{prefix_of(scenario, agent)}sensors.{name}.position = {given}:"
                    f" starts inside {within}, which hides all, must start outside"
                )


def _shape_around(sensor: RaySensor, vehicle: Vehicle, motion: PointMotion) -> str:
    """Words for the shape of its own vehicle that a camera starts inside, of those that
    it sees; empty for none.
    """
    from skyarm.vehicle.vehicle_records import body_names
    from skyarm.world.contact.contact_point import body_axes
    from skyarm.world.contact.material import Material
    from skyarm.world.contact.shape_pairs import PlacedShape
    from skyarm.world.contact.vehicle_bodies import part_of_vehicle

    body = sensor.body_of(vehicle)
    eye = motion.position(sensor.position, body)
    for each in vehicle.shapes:
        part = part_of_vehicle(each, Material())
        R_WL = body_axes(motion, each.link)
        place = motion.position(part.position, each.link)
        solid = PlacedShape(part.shape, R_WL @ part.rotation, place)
        seen = sensor.sees_own_link or each.link != body
        if seen and solid.skin(eye, 0)[0] > 0.0:
            link = body_names(vehicle)[each.link - BASE]
            return f"collisions[{each.name}] of {link}"
    return ""


def _require_start_outside(scenario: Scenario, name: str, state: State) -> None:
    """Raise an error if one vehicle, of a name, starts inside a surface, or with an
    excessive contact force.
    """
    from skyarm.world.contact.initial_world import (
        require_start_outside as require_outside,
    )

    vehicle, gravity = scenario.agent.vehicle, scenario.agent.plant.gravity
    for contact in (each.of_agent(name) for each in scenario.worlds):
        if not concrete(*leaves((contact, state, gravity, vehicle.mass))):
            # of a batch: each lane shows itself
            return
        require_outside(contact, vehicle, float(gravity), state)
        for ending in (RotorContact(), BodyContact()):
            if not ending.fine(scenario, state, state.position, 0):
                cause = ending.cause(scenario, state, state.position)
                raise ValueError(f"world: {cause} at the start: must start outside")


def tip_sensor(
    sensors: Sequence[tuple[str, Sensor]], vehicle: Vehicle
) -> tuple[str, Mat3] | None:
    """Name of the first force-torque sensor on the tip's link, and the rotation from
    sensor axes to tip axes.
    """
    if not sensors or not vehicle.end_effector:
        return None
    framed = (
        (name, vehicle.frame(s.feels or None))
        for name, s in sensors
        if s.senses == "wrench"
    )
    tip = vehicle.frame()
    return next(
        (
            (name, tip.rotation.T @ frame.rotation)
            for name, frame in framed
            if frame.link == tip.link
        ),
        None,
    )


def _require_tip_sensor(
    at: str, sensors: Sequence[tuple[str, Sensor]], vehicle: Vehicle
) -> None:
    if tip_sensor(sensors, vehicle) is None:
        needed = "a sensor of kind 'force_torque' on the link of the tip"
        raise ValueError(
            f"{at}.force_sensor = true: must be false without {needed} ([sensors.NAME])"
        )


def _check_guards(
    trajectory: Trajectory, sensors: Sequence[tuple[str, Sensor]], vehicle: Vehicle
) -> None:
    """Check that the scenario has all sensors that the end conditions of task phases
    use.
    """
    if not trajectory.guards:
        return
    switches = [name for name, sensor in sensors if sensor.senses == "switch"]
    for guard in trajectory.guards:
        at = f"reference: {phase_words(trajectory, guard)}: until"
        if guard.sensed:
            _require_tip_sensor(at, sensors, vehicle)
        for word in ("closed", "open"):
            name = getattr(guard, word)
            if name and name not in switches:
                near = did_you_mean(name, switches)
                there = ", ".join(switches) or "none"
                allowed = (
                    f"{near}must be the name of a sensor of kind 'tactile_switch';"
                    f" there are {there}"
                )
                raise ValueError(f"{at}.{word} = {shown(name)}: {allowed}")
