"""One experiment: truth, model, controller, reference, environment, clocks, and what changes in flight."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from skyarm.actuation.drive import TORQUE_DRIVE, Drive, TorqueDrive
from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.controller import Controller
from skyarm.dynamics import State
from skyarm.environment import NO_WIND, Component, Fault, TimedPayload, Wind
from skyarm.environment.battery_drain import BatteryDrain
from skyarm.estimate.estimator import FULL_STATE, PASS_THROUGH, Estimator, PassThrough
from skyarm.files import number, shown
from skyarm.files.names import ALLOWED, is_result_name
from skyarm.metrics.windows import Windows
from skyarm.plant.interface import Truth
from skyarm.records import coerce, leaves
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.plain import WRITTEN_IF_ANY
from skyarm.records.units import Unit
from skyarm.reference import Trajectory
from skyarm.reference.governor.path_time import PathTime
from skyarm.reference.governor.pause import PathPause
from skyarm.scalars import Scalar, cos, data, minimum, sin
from skyarm.scenario.endings import Ending
from skyarm.sensors.measurement import SensorNoise
from skyarm.sensors.sensor import Sensor

if TYPE_CHECKING:
    from skyarm.contact.contact import Contact
else:
    Contact = Component  # a world is imported when a scenario has one

PLANTS = ("rigid_body", "mujoco")
"""That the paper's cases fly on; all are those of the registry."""

MUJOCO_CONTACTS = "mujoco_contacts"
"""Plant that finds contacts itself."""

HIGHEST_RATE = 1_000_000
"""Hz: a clock beyond this is a slip of units."""

LATEST = 1e7
"""s: ten million control periods at 1 Hz."""

PERFECT_SENSORS = SensorNoise()


class ScenarioError(ValueError):
    """A scenario's description is wrong."""


def whole(value: Any) -> int | None:
    """A whole number, NumPy's too, as Python's; None for anything else."""
    return int(value) if not isinstance(value, bool) and isinstance(value, numbers.Integral) else None


@dataclass(frozen=True, kw_only=True, slots=True)
class Rates:
    """Clock rates in Hz; physics / control and control / reference must be whole numbers."""

    physics: int = 1000
    control: int = 200
    reference: int = 50

    def __post_init__(self) -> None:
        for name in ("physics", "control", "reference"):
            value = getattr(self, name)
            held = whole(value)
            if held is None or not 1 <= held <= HIGHEST_RATE:
                allowed = f"must be a whole number of Hz from 1 to {HIGHEST_RATE}"
                raise ScenarioError(f"rates.{name} = {shown(value)}: {allowed}")
            object.__setattr__(self, name, held)
        for fast, slow in (("physics", "control"), ("control", "reference")):
            if getattr(self, fast) % getattr(self, slow):
                raise ScenarioError(
                    f"rates.{slow} = {getattr(self, slow)}: must divide rates.{fast} = {getattr(self, fast)}"
                )


@dataclass(frozen=True, kw_only=True, slots=True)
class Delays:
    """Dead times of the loop.

    ``measurement`` is a whole number of control periods, the others are of physics steps. ``rotors`` and ``joints`` are
    what the rotors' and the joints' part of a command takes on top of ``command``; an int of 0 is structure: they
    travel together. ``longest_command`` is the longest that ``command`` and the larger of the two get together in a
    batch that varies them from episode to episode; its episodes may have any delay from 0 to that. None: all episodes
    have the same.
    """

    measurement: Annotated[float, Unit("s", "age of the measurement", low=0.0)] = 0.0
    command: Annotated[Scalar, Unit("s", "before a command takes effect", low=0.0)] = 0.0
    longest_command: Annotated[float | None, Unit("s", low=0.0, strict=True)] = None
    rotors: Annotated[Scalar, Unit("s", "before the rotors hear of it, on top", low=0.0)] = 0
    joints: Annotated[Scalar, Unit("s", "before the joints hear of it, on top", low=0.0)] = 0

    def __post_init__(self) -> None:
        accept_fields(self, "delays", ScenarioError)

    @property
    def apart(self) -> bool:
        """Whether rotors and joints hear of a command at different times."""
        return any(not concrete(value) or value != 0 for value in (self.rotors, self.joints))

    @property
    def longest(self) -> float:
        """Of all commands, s; numbers that vary have their longest."""
        if self.longest_command is not None:
            return self.longest_command
        return float(self.command) + max(float(self.rotors), float(self.joints))


@dataclass(frozen=True, kw_only=True, slots=True)
class NamedSensor:
    """A sensor beside the full state; its readings reach the estimator under this name."""

    name: str
    sensor: Sensor

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier() or self.name == FULL_STATE:
            raise ScenarioError(f"sensors: name = {shown(self.name)}: must be a word, and not {FULL_STATE!r}")
        if not isinstance(self.sensor, Sensor):
            raise ScenarioError(f"sensors.{self.name} = {shown(self.sensor)}: must be a Sensor")


@dataclass(frozen=True, kw_only=True, slots=True)
class JointDrive:
    """The drive of one joint, by the joint's name."""

    joint: str
    drive: Drive

    def __post_init__(self) -> None:
        if not isinstance(self.joint, str):
            raise ScenarioError(f"drives: joint = {shown(self.joint)}: must be the name of a joint")
        if not isinstance(self.drive, Drive):
            raise ScenarioError(f"drives.{self.joint} = {shown(self.drive)}: must be a Drive")


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """A change in flight takes hold in the first control period that does not begin before ``at``.

    Attributes:
        at: s.
        path: of a number, or of a part as a whole.
        value: the number, or what a scenario file would hold in the part's place: text, true or false, lists (held as
            tuples) or tables.
    """

    at: Annotated[float, Unit("s", low=0.0)]
    path: str
    value: Any

    def __post_init__(self) -> None:
        try:
            at = number(coerce.plain_number(self.at), "at", low=0.0)
            if at > LATEST:
                raise ScenarioError(f"at = {at!r}: must be at most {LATEST:g} s, beyond which no flight lasts")
            object.__setattr__(self, "at", at)
            if not isinstance(self.path, str) or not self.path:
                raise ScenarioError(f"path = {shown(self.path)}: must be text that is not empty")
            object.__setattr__(self, "value", _plain_value("value", self.value, whole=False))
        except ValueError as error:
            raise ScenarioError(str(error)) from None
        except RecursionError:
            raise ScenarioError("value: has too many lists or tables within each other") from None

    def tick(self, rate: int) -> int:
        """The control period that it takes hold in, at this control rate (Hz)."""
        k = math.floor(self.at * rate)
        # against the instants as the loop has them: k / rate
        while k / rate < self.at:
            k += 1
        return k

    @property
    def table(self) -> Any:
        """The value as a file's reader gives it: tuples are lists."""
        return _table(self.value)


def _plain_value(field: str, value: Any, whole: bool = True) -> Any:
    """Value of a change: lists as tuples, a number as a float unless ``whole`` numbers stay, as within a list."""
    value = coerce.plain_number(value)
    if isinstance(value, Mapping):
        if not all(isinstance(name, str) for name in value):
            raise RecordError(f"{field} = {shown(value)}: must have names that are texts")
        return {name: _plain_value(f"{field}.{name}", each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return tuple(_plain_value(f"{field}[{i}]", each) for i, each in enumerate(value))
    if isinstance(value, (bool, str)) or (whole and isinstance(value, (int, float))):
        return value
    if isinstance(value, numbers.Real):
        return number(value, field)
    try:
        if not whole and value is not None and not isinstance(value, (bytes, set, frozenset)):
            return coerce.number(field, value)  # lanes of a batch, nodes of a trace
    except RecordError:
        pass
    raise RecordError(f"{field} = {shown(value)}: must be a number, text, true, false, a list or a table")


def _table(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _table(each) for name, each in value.items()}
    return [_table(each) for each in value] if isinstance(value, tuple) else value


def in_order(changes: Iterable[Change], rate: int) -> tuple[Change, ...]:
    """Changes as they take hold: by control period, those of one period in the order given."""
    return tuple(sorted(changes, key=lambda change: change.tick(rate)))


def without_law(changes: Iterable[Change]) -> tuple[Change, ...]:
    """The changes that are not of the controller: another law than the one they were meant for flies without them."""
    return tuple(each for each in changes if each.path.split(".", maxsplit=1)[0] != "controller")


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
    duration: Annotated[float, Unit("s", low=0.0, strict=True)]
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
        from skyarm.scenario.scenario_checks import check_names, check_scenario

        try:
            check_names(self)
            if self.contact is not None and not hasattr(self.contact, "on"):
                raise ScenarioError(f"contact = {shown(self.contact)}: must be a Contact or None")
            for name in ("seed", "episode"):
                object.__setattr__(self, name, noise_key(name, getattr(self, name)))
            accept_fields(self, "")
            if self.contact is not None:
                object.__setattr__(self, "contact", self.contact.on(self.world.vehicle))
            check_scenario(self)
            if self.initial is not None:
                object.__setattr__(self, "initial", _as_data(self.initial))
        except ValueError as error:
            raise ScenarioError(str(error)) from None

    @property
    def steps(self) -> int:
        """Number of control periods."""
        return round(self.duration * self.rates.control)

    @property
    def components(self) -> tuple[Component, ...]:
        """The wind, the air and the forces that are added to it, timed payloads, contact, the load on the battery."""
        contacts = self.contacts
        if self.plant == MUJOCO_CONTACTS:
            from skyarm.contact.plant_contact import plant_contact

            contacts = tuple(map(plant_contact, contacts))
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
        drives = self.all_drives or (TORQUE_DRIVE,) * self.world.vehicle.n
        return tuple(not isinstance(drive, TorqueDrive) for drive in drives)

    @property
    def all_drives(self) -> tuple[Drive, ...]:
        """A drive for each joint; empty where every joint takes its torque."""
        given = {each.joint: each.drive for each in self.joint_drives}
        return tuple(given.get(link.joint.name, TORQUE_DRIVE) for link in self.world.vehicle.links) if given else ()


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


def _as_data(state: State) -> State:
    """The state without integers, which would be structure, its quaternion exactly of unit length."""

    def as_data(value: Any) -> Any:
        numbers = (data(each) for each in value)
        return tuple(numbers) if isinstance(value, tuple) else type(value)(*numbers)

    held = {name: as_data(value) for name, value in leaves.parts(state).items()}
    return State(**held | {"quaternion": coerce.near_unit_quaternion(held["quaternion"])})
