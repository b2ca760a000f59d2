"""One experiment: truth, belief, controller, reference, environment, clock."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from skyarm.actuation.drive import TORQUE_DRIVE, Drive, TorqueDrive
from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Quaternion, Vec3
from skyarm.contact.contact import Contact
from skyarm.contact.plant_contact import plant_contact
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.environment import NO_WIND, Component, Fault, TimedPayload, Wind
from skyarm.environment.battery_drain import BatteryDrain
from skyarm.estimate.estimator import FULL_STATE, PASS_THROUGH, Estimator, PassThrough
from skyarm.files import must_be_one_of, number, shown
from skyarm.files.names import ALLOWED, is_result_name
from skyarm.metrics.windows import Windows
from skyarm.plant.integrators import INTEGRATORS
from skyarm.plant.interface import Truth
from skyarm.records.coerce import RecordError, accept
from skyarm.records.field_rules import require_fields, rules
from skyarm.records.plain import WRITTEN_IF_ANY
from skyarm.reference import Trajectory
from skyarm.reference.path_pause import PathPause
from skyarm.reference.path_time import PathTime
from skyarm.registry.registrations import registrations
from skyarm.scalars import Scalar, cos, data, minimum, sin
from skyarm.scenario.changes import Change
from skyarm.scenario.clock_checks import check_clocks, check_delays, require_whole
from skyarm.scenario.endings import Ending
from skyarm.scenario.mujoco_contact_checks import check_mujoco_contacts, finds_contacts
from skyarm.scenario.scenario_checks import (
    as_data,
    check_additions,
    check_initial,
    check_joined,
    check_path_time,
    check_vehicles,
)
from skyarm.scenario.scenario_parts import Delays, JointDrive, NamedSensor, Rates, ScenarioError, whole
from skyarm.sensors.noise import SensorNoise
from skyarm.sensors.sensor import Sensor

__all__ = [
    "Delays",
    "JointDrive",
    "NamedSensor",
    "Rates",
    "Scenario",
    "ScenarioError",
    "check_name",
    "first_state",
    "noise_key",
    "trimmed_state",
]

PLANTS = ("rigid_body", "mujoco")
"""That the paper's cases fly on; all are those of the registry."""

LONGEST_FLIGHT = 10_000_000
"""Control periods of one episode, 14 h at 200 Hz: its log takes about 10 GB."""

PERFECT_SENSORS = SensorNoise()


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenario:
    """Everything that fixes an episode.

    Attributes:
        name: short name. title: one line for people.
        duration: s.
        world: the truth: vehicle and gravity of the plant.
        plant: "rigid_body", "mujoco" or "mujoco_contacts". integrator: "rk4", "euler" or "rk4_staged"; of the
            last plant "euler".
        controller: law with its belief.
        trajectory: reference.
        joined: s; until then the law is told the reference of t = 0, at rest, while the reference goes on and errors
            are taken against it. An int of 0 is structure: the law follows from the first instant.
        wind, faults: environment; losses of single actuators.
        air, forces: what surrounds the vehicle beside the wind (:mod:`skyarm.environment.component`).
        sensors, delays: measurement.
        instruments: sensors beside the full state. estimator: from all readings to what the law is told.
        drives: of joints whose setpoint is not the torque.
        endings: what ends the episode beside the library's endings (:mod:`skyarm.scenario.endings`).
        initial: state at t = 0; None is hover trim of the truth at the reference, as far as its rotors can turn.
        seed, episode: keys of all noise.
        ground: end the episode when the lowest point reaches z = 0.
        windows: when its metrics look; those that end after a shortened flight are general in it.
        changes: what is other from an instant of the flight on (:mod:`skyarm.scenario.in_flight`); those that would
            come after the end of a shortened flight do not.
        payloads: loads that are picked up and set down in flight; the law knows of them as far as it is told.
        path_time: of a governor (:func:`skyarm.govern`): how far along the reference the law is led, while errors are
            taken against the reference as it is commanded; None leads it as commanded.
        pause: of a governor that slows the reference's time in flight; None never does.
        contact: surfaces of the world and the vehicle's points that touch them (:mod:`skyarm.contact`); None for
            nothing to touch.
    """

    name: str
    title: str = ""
    duration: float
    rates: Rates = Rates()
    world: Truth
    plant: str = "rigid_body"
    integrator: str = "rk4"
    controller: Controller
    trajectory: Trajectory
    joined: Scalar = 0
    wind: Wind = NO_WIND
    faults: tuple[Fault, ...] = ()
    air: tuple[Component, ...] = ()
    forces: tuple[Component, ...] = ()
    sensors: SensorNoise = PERFECT_SENSORS
    instruments: tuple[NamedSensor, ...] = ()
    estimator: Estimator = PASS_THROUGH
    drives: tuple[JointDrive, ...] = ()
    endings: tuple[Ending, ...] = ()
    delays: Delays = Delays()
    initial: State | None = None
    seed: int = 0
    episode: int = 0
    ground: bool = True
    windows: Windows = Windows()
    changes: tuple[Change, ...] = dataclasses.field(default=(), metadata=WRITTEN_IF_ANY)
    payloads: tuple[TimedPayload, ...] = dataclasses.field(default=(), metadata=WRITTEN_IF_ANY)
    path_time: PathTime | None = dataclasses.field(default=None, metadata=WRITTEN_IF_ANY)
    pause: PathPause | None = dataclasses.field(default=None, metadata=WRITTEN_IF_ANY)
    contact: Contact | None = dataclasses.field(default=None, metadata=WRITTEN_IF_ANY)

    def __post_init__(self) -> None:
        try:
            _check_kinds(self)
            object.__setattr__(self, "duration", number(self.duration, "duration", low=0.0, strict=True))
            if self.contact is not None:
                object.__setattr__(self, "contact", self.contact.on(self.world.vehicle))
            for name in ("seed", "episode"):
                object.__setattr__(self, name, noise_key(name, getattr(self, name)))
            _check(self)
            for field, where in ADDED_WITH_CLOCKS.items():
                require_fields(getattr(self, field), where)
        except ValueError as error:
            raise ScenarioError(str(error)) from None

    @property
    def steps(self) -> int:
        """Number of control periods."""
        return round(self.duration * self.rates.control)

    @property
    def components(self) -> tuple[Component, ...]:
        """The wind, the air and the forces that are added to it, timed payloads, contact, the load on the battery."""
        contacts = tuple(plant_contact(each) if finds_contacts(self) else each for each in self.contacts)
        return (self.wind, *self.air, *self.forces, *self.payloads, *contacts, *self.power)

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contact, if there is something to touch."""
        return () if self.contact is None else (self.contact,)

    @property
    def power(self) -> tuple[BatteryDrain, ...]:
        """The load on the true vehicle's battery, if it has one."""
        vehicle = self.world.vehicle
        return () if vehicle.battery is None else (BatteryDrain(battery=vehicle.battery, rotors=vehicle.rotors),)

    @property
    def estimates(self) -> bool:
        """Whether an estimator stands between the sensors and the law."""
        return type(self.estimator) is not PassThrough

    @property
    def all_sensors(self) -> tuple[tuple[str, Sensor], ...]:
        """(name, sensor): the full state, then the named ones."""
        return ((FULL_STATE, self.sensors), *((each.name, each.sensor) for each in self.instruments))

    @property
    def joint_drives(self) -> tuple[JointDrive, ...]:
        """Drives of joints by name: the scenario's, and those that its vehicle carries where it says nothing else."""
        named = [each.joint for each in self.drives]
        carried = (each for each in self.world.vehicle.drives if each.name not in named)
        return (*self.drives, *(JointDrive(joint=each.name, drive=each.drive) for each in carried))

    @property
    def told(self) -> tuple[bool, ...]:
        """Joint by joint, whether its command is a setpoint of its drive in place of a torque or force."""
        given = {each.joint: each.drive for each in self.joint_drives}
        return tuple(
            not isinstance(given.get(link.joint.name, TORQUE_DRIVE), TorqueDrive) for link in self.world.vehicle.links
        )

    @property
    def all_drives(self) -> tuple[Drive, ...]:
        """A drive for each joint; empty where every joint takes its torque."""
        given = {each.joint: each.drive for each in self.joint_drives}
        if not given:
            return ()
        return tuple(given.get(link.joint.name, TORQUE_DRIVE) for link in self.world.vehicle.links)


CHECKED_APART = ("name", "duration", "plant", "integrator", "seed", "episode")
"""Fields whose checks say more than that they are of their kind."""

ADDED = ("estimator", "drives", "endings", "initial")
"""Fields whose records may not check themselves."""

ADDED_WITH_CLOCKS = {"air": "environment.air", "forces": "environment.forces", "instruments": "instruments"}
"""The same, whose steps and clocks are looked at before -> their name in messages."""


def _check_kinds(scenario: Scenario) -> None:
    """Every field holds records of its kind, lists of them as tuples; every number of them is one."""
    looked_at = {field: rule for field, rule in rules(Scenario).items() if field not in CHECKED_APART}
    accept(scenario, "", looked_at)
    for field in ADDED:
        require_fields(getattr(scenario, field), field)
    if not isinstance(getattr(scenario.controller.par, "model", None), Model):
        raise RecordError(f"controller.par = {shown(scenario.controller.par)}: must have a model, a skyarm.Model")


def _check(scenario: Scenario) -> None:
    """Refuse what could not fly, before anything is built."""
    check_name(scenario.name)
    if scenario.duration * scenario.rates.control > LONGEST_FLIGHT:
        longest = LONGEST_FLIGHT / scenario.rates.control
        raise ScenarioError(f"duration = {scenario.duration!r}: must be at most {longest:g} s at this control rate")
    require_whole("duration", scenario.duration, scenario.rates.control, "control periods")
    for field, value, allowed in (
        ("plant.kind", scenario.plant, registrations("plant")),
        ("plant.integrator", scenario.integrator, dict.fromkeys(INTEGRATORS)),
    ):
        if not isinstance(value, str) or value not in allowed:
            raise ScenarioError(f"{field} = {shown(value)}: {must_be_one_of(allowed, value)}")
    check_delays(scenario)
    check_joined(scenario)
    check_path_time(scenario)
    check_additions(scenario)
    check_vehicles(scenario)
    check_mujoco_contacts(scenario)
    check_clocks(scenario)
    if scenario.initial is not None:
        check_initial(scenario.initial, scenario.world.vehicle)
        object.__setattr__(scenario, "initial", as_data(scenario.initial))


def check_name(name: str) -> None:
    """A scenario's name becomes the name of its files."""
    if not is_result_name(name):
        raise ScenarioError(f"name = {shown(name)}: {ALLOWED}")


def noise_key(field: str, value: Any) -> int:
    """A key of the noise generator."""
    held = whole(value)
    if held is None or not 0 <= held < 2**32:
        raise ScenarioError(f"{field} = {shown(value)}: must be a whole number from 0 to 2**32 - 1")
    return held


def trimmed_state(world: Truth, position: Vec3, yaw: float, joints: tuple[Any, ...]) -> State:
    """The truth at rest and level, rotors at the speeds that hold its weight and its arm's torque.

    No rotor turns faster than it can: a truth that is too heavy to hover starts at full speed and sinks.
    """
    vehicle = world.vehicle
    trim = hover_trim(vehicle, joints, world.gravity)
    still = (0.0,) * vehicle.n
    return State(
        position=Vec3(*(data(c) for c in position)),
        quaternion=Quaternion(cos(0.5 * yaw), 0.0, 0.0, sin(0.5 * yaw)),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=tuple(data(q) for q in joints),
        joint_rates=still,
        rotor_speeds=tuple(data(minimum(w, r.max_speed)) for w, r in zip(trim.speeds, vehicle.rotors, strict=True)),
        tilts=(0.0,) * len(vehicle.tilts),
    )


def first_state(scenario: Scenario) -> State:
    """The scenario's initial state, or hover trim at the reference."""
    if scenario.initial is not None:
        return scenario.initial
    start = scenario.trajectory.at(0.0)
    return trimmed_state(scenario.world, start.position, data(start.yaw), tuple(start.joints))
