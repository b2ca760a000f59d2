"""What could not fly is refused before anything is built: vehicles, additions, laws, initial states.

Every refusal is a ValueError of one line; :class:`skyarm.scenario.scenario_record.Scenario` makes it a ScenarioError.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from skyarm.actuation import Mixer, make_mixer
from skyarm.control.controller import innermost, learns_load, part_of
from skyarm.control.law_checks import check_controller
from skyarm.control.model import JointGains
from skyarm.dynamics import State
from skyarm.estimate.error_state_filter import ErrorStateFilter
from skyarm.files import number, shown
from skyarm.plant.largest_step import check_largest_step
from skyarm.plant.stop_rate import joint_rate
from skyarm.records.coerce import TOLERANCE, concrete
from skyarm.records.directions import near_unit_quaternion
from skyarm.records.leaves import named_leaves
from skyarm.scalars import data
from skyarm.scenario.check_frames import check_frames
from skyarm.scenario.clock_checks import require_whole
from skyarm.scenario.scenario_parts import ScenarioError
from skyarm.scenario.steps_of_contact import require_steps_to_fly
from skyarm.scenario.tip_sensor import require_guard_sensors, require_tip_sensor
from skyarm.vehicle.check import require_plant
from skyarm.vehicle.vehicle_records import Vehicle

if TYPE_CHECKING:
    from skyarm.scenario.scenario_record import Scenario

LONGEST_QUEUE_OF_SERVO = 1000
"""Control periods that a servo's setpoints may be on their way: as many are remembered."""


def check_joined(scenario: Scenario) -> None:
    """The instant at which a law joins the reference lies in the flight."""
    if concrete(scenario.joined):
        joined = number(scenario.joined, "reference.joined", low=0.0)
        if joined > scenario.duration:
            raise ValueError(f"reference.joined = {joined!r}: must not exceed the duration of {scenario.duration:g} s")


def check_path_time(scenario: Scenario) -> None:
    """A governor has planned for all of the flight."""
    path = scenario.path_time
    if scenario.trajectory.guards and not (path is None and scenario.pause is None):
        raise ValueError("reference.governor: must be left out of a reference whose phases wait (until)")
    if path is None:
        return
    if path.duration < scenario.duration - 1e-9:
        raise ValueError(
            f"reference.governor: was planned for {path.duration:g} s, the flight lasts {scenario.duration:g} s; "
            "plan it anew (skyarm.govern)"
        )


def check_additions(scenario: Scenario) -> None:
    """Named sensors tick with the loop and have names of their own; drives are of joints that are there."""
    rates, seen = scenario.rates, set[str]()
    for each in scenario.instruments:
        where = f"sensors.{each.name}"
        if each.name in seen:
            raise ValueError(f"{where}: the name is taken")
        seen.add(each.name)
        rate = number(each.sensor.frequency, f"{where}.frequency", low=0.0)
        if rate and abs(rates.control / rate - round(rates.control / rate)) > 1e-9 * rates.control / rate:
            raise ValueError(f"{where}.frequency = {rate:g}: must divide rates.control = {rates.control} Hz")
        delay = number(each.sensor.latency, f"{where}.latency", low=0.0)
        require_whole(f"{where}.latency", delay, rates.control, "control periods")
        try:
            each.sensor.require_vehicle(scenario.world.vehicle)
        except ValueError as error:
            raise ValueError(f"{where}.{error}") from None
    sensors = {each.name: each.sensor for each in scenario.instruments}
    require_tip_sensor(scenario.controller.par, tuple(sensors.items()), scenario.world.vehicle)
    require_guard_sensors(scenario.trajectory, tuple(sensors.items()), scenario.world.vehicle)
    if learns_load(scenario.controller.par) and scenario.trajectory.load is None:
        # the law that waits to be told adapts no tip mass meanwhile, so it would know less than without the option
        most = shown(part_of(scenario.controller.par, "load").limit)
        raise ValueError(f"controller.load = {most}: must be 0 without reference.load, which says when a load is held")
    scenario.estimator.require_sensors(sensors, rates.control, scenario.controller.par.model.vehicle)
    if isinstance(scenario.estimator, ErrorStateFilter):
        # the scenario's own drives, too, of which the belief need not know
        given = {each.joint: each.drive for each in scenario.joint_drives}
        scenario.estimator.require_torques(scenario.world.vehicle.name, given)
    joints = [link.joint.name for link in scenario.world.vehicle.links]
    driven = [each.joint for each in scenario.drives]
    added = [(f"environment.{at}[{i}]", c) for at in ("air", "forces") for i, c in enumerate(getattr(scenario, at))]
    own = {each.joint for each in scenario.drives}
    for fitted in scenario.joint_drives:
        where = f"plant.drives.{fitted.joint}" if fitted.joint in own else f"plant.vehicle.drives.{fitted.joint}"
        added.append((where, fitted.drive))
        latency = getattr(fitted.drive, "latency", 0.0)
        if concrete(latency) and latency * rates.control > LONGEST_QUEUE_OF_SERVO:
            most = f"{LONGEST_QUEUE_OF_SERVO} control periods, {LONGEST_QUEUE_OF_SERVO / rates.control:g} s"
            raise ValueError(f"{where}.latency = {latency!r}: must be at most {most}")
    check_largest_step(added, 1.0 / rates.control)
    for contact in scenario.contacts:
        require_steps_to_fly(contact, 1.0 / rates.control)
    for joint in driven:
        if joint not in joints or driven.count(joint) > 1:
            raise ValueError(f"drives: joint = {shown(joint)}: must be one of {', '.join(joints) or 'none'}, once")
        limit = scenario.world.vehicle.links[joints.index(joint)].joint.effort_limit
        if concrete(limit) and limit == 0:
            words = f"must be above 0 ([[joints]] of its file): it leaves plant.drives.{joint} no torque"
            raise ValueError(f"plant.vehicle: joints[{joint}].effort_limit = 0: {words}")


MOST_JOINTS = 256
"""Of a vehicle that flies. LLVM makes a loop's code in a stack whose depth grows with the loop: of 400 joints it still
does, of 1200 it ends the process."""


def check_vehicles(scenario: Scenario) -> None:
    """Truth and belief have the same joints and rotors, the reference fits them, and the truth can be simulated.

    Its rotors must reach every torque and thrust; whether they are strong enough to carry it, the flight shows.
    """
    check_controller(scenario.controller)
    truth, belief = scenario.world.vehicle, scenario.controller.par.model.vehicle
    if truth.n > MOST_JOINTS:
        raise ValueError(
            f"plant.vehicle = {truth.name!r}: has {truth.n} joints, must have at most {MOST_JOINTS} to fly"
        )
    try:
        require_plant(truth)
        make_mixer(truth)
        joint_rate(truth)
    except ValueError as error:
        raise ValueError(f"plant.vehicle = {truth.name!r}: {error}") from None
    for what, ours, theirs in (("joints", truth.n, belief.n), ("rotors", len(truth.rotors), len(belief.rotors))):
        if ours != theirs:
            raise ValueError(
                f"model.vehicle = {belief.name!r}: has {theirs} {what}, must have {ours} as the plant {truth.name!r}"
            )
    for i, fault in enumerate(scenario.faults):
        try:
            fault.check(truth)
        except ValueError as error:
            raise ValueError(f"environment.faults[{i}].{error}") from None
    check_frames(scenario)
    check_law(scenario.controller.par, belief.n, len(belief.rotors))
    found = len(scenario.trajectory.joints)
    if found != truth.n:
        raise ValueError(f"reference.joints = {found} signals: must be {truth.n}, one for each joint")


def check_initial(state: State, vehicle: Vehicle) -> None:
    """An initial state has a number for each joint and rotor, speeds that the rotors can turn at, and a quaternion."""
    rotors, tilts = len(vehicle.rotors), len(vehicle.tilts)
    counts = (("joints", vehicle.n), ("joint_rates", vehicle.n), ("rotor_speeds", rotors), ("tilts", tilts))
    for name, count in counts:
        if len(getattr(state, name)) != count:
            raise ValueError(f"initial.{name}: {len(getattr(state, name))} values, must be {count}")
    for i, (speed, rotor) in enumerate(zip(state.rotor_speeds, vehicle.rotors, strict=True)):
        # unsigned: the rotor's own turn says the way round; its thrust and its lag hold up to its highest speed
        if concrete(speed, rotor.max_speed) and not 0.0 <= speed <= rotor.max_speed:
            raise ValueError(
                f"initial.rotor_speeds[{i}] = {speed!r}: must be from 0 to {rotor.max_speed:g} rad/s, the highest "
                f"speed of rotor {i}"
            )
    for i, (angle, tilt) in enumerate(zip(state.tilts, vehicle.tilts, strict=True)):
        if concrete(angle, tilt.lower, tilt.upper) and not tilt.lower <= angle <= tilt.upper:
            allowed = f"must be from {tilt.lower:g} to {tilt.upper:g} rad, the range of its servo"
            raise ValueError(f"initial.tilts[{i}] = {angle!r}: {allowed}")
    check_quaternion(tuple(state.quaternion))


def as_data(state: State) -> State:
    """The state without integers, which would be structure, its quaternion exactly of unit length."""
    held: dict[str, Any] = {}
    for name in ("position", "quaternion", "velocity", "rate", "joints", "joint_rates", "rotor_speeds", "tilts"):
        value = getattr(state, name)
        numbers = tuple(data(each) for each in value)
        held[name] = numbers if isinstance(value, tuple) else type(value)(*numbers)
    held["quaternion"] = near_unit_quaternion(held["quaternion"])
    return State(**held)


def check_law(par: Any, joints: int, rotors: int) -> None:
    """Gains and mixer of a law, and its recovery under the safety layer, have a number for each joint and rotor."""
    layer = par
    while getattr(layer, "recovery", None) is None and hasattr(layer, "inner"):
        layer = layer.inner
    recovery = getattr(layer, "recovery", None)
    if recovery is not None:
        for name in ("stow", "stow_speed"):
            _require_count(f"controller.recovery.{name}", getattr(recovery, name), joints)
        for name in ("stiffness", "damping"):
            _require_count(f"controller.recovery.joint_gains.{name}", getattr(recovery.joint_gains, name), joints)
    par = innermost(par)
    gains, mixer = getattr(par, "joint_gains", None), getattr(par, "mixer", None)
    if isinstance(gains, JointGains):
        for name in ("stiffness", "damping"):
            _require_count(f"controller.joint_gains.{name}", getattr(gains, name), joints)
    for name in ("friction_compensation", "rate_weights"):
        if getattr(par, name, ()):
            _require_count(f"controller.{name}", getattr(par, name), joints)
    if isinstance(mixer, Mixer):
        _require_count("controller.mixer.highest", mixer.highest, rotors)
        _require_count("controller.mixer.inverse", mixer.inverse, rotors)
        for i, row in enumerate(mixer.inverse):
            _require_count(f"controller.mixer.inverse[{i}]", row, 4)
        if mixer.across:
            _require_count("controller.mixer.across", mixer.across, rotors)


def _require_count(field: str, values: tuple[Any, ...], count: int) -> None:
    if len(values) != count:
        raise ValueError(f"{field}: {len(values)} values, must be {count}")


FLOWN = (
    "world",
    "trajectory",
    "joined",
    "components",
    "faults",
    "sensors",
    "instruments",
    "drives",
    "delays",
    "initial",
    "contact",
)
"""Fields of a scenario, beside the law's constants, whose numbers a flight takes."""


def require_flight(scenario: Any) -> None:
    """What flies is one scenario whose numbers are plain: a batch flies lanes.

    Raises:
        ScenarioError: one line with field and value.
    """
    from skyarm.scenario.scenario_record import Scenario

    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"scenario = {shown(scenario)}: must be a Scenario; load_scenario(name) makes one")
    for field in FLOWN:
        _require_plain(getattr(scenario, field), field)
    _require_plain(scenario.controller.par, "controller")
    if scenario.contacts:
        from skyarm.scenario.start_in_world import require_start_outside

        try:
            require_start_outside(scenario)
        except ValueError as error:
            raise ScenarioError(str(error)) from None


def _require_plain(record: Any, where: str) -> None:
    for field, value in named_leaves(record, where):
        if not (concrete(value) or callable(value)):
            raise ScenarioError(f"{field} = {shown(value)}: must be one number; a Batch flies several side by side")


def check_quaternion(values: tuple[Any, ...]) -> None:
    """Four numbers of unit length."""
    good = len(values) == 4
    if good and concrete(*values):
        good = abs(math.sqrt(sum(c * c for c in values)) - 1.0) <= TOLERANCE
    if not good:
        raise ValueError(
            f"initial.quaternion_wxyz = {shown(list(values))}: must be four numbers of length 1 within {TOLERANCE:g}"
        )
