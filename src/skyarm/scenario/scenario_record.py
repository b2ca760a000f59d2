"""Scenario dataclass: plant, model, controller, reference, environment, clocks and
scheduled changes of a flight.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import numbers
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, TypeVar, Unpack, cast

from skyarm.algebra import ZERO3_DATA, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import cos, data, minimum, sin
from skyarm.control.controller import Controller, autopilot_of, follows_plan
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE, Drive
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.state import example_state
from skyarm.log.metrics.windows import Windows
from skyarm.plant.interface import Truth
from skyarm.plant.largest_step import INTEGRATORS
from skyarm.records import coerce, leaves
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.content import keep_results
from skyarm.records.field_rules import accept_fields, checked, defaults, require_fields
from skyarm.records.files import did_you_mean, errors_as, must_be_one_of, number, shown
from skyarm.records.files.names import ALLOWED, is_result_name
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import UNWRITTEN, field_if_any, immutable
from skyarm.records.leaves import field_names, parts
from skyarm.records.members import SOLE, Members, members_of
from skyarm.records.notebook import notebook_html
from skyarm.records.path_names import Names, agent_of, word_of
from skyarm.records.read_table import entry_of
from skyarm.records.registry import registrations
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.records.words import STRUCTURAL, Word, groups, words_of_fields
from skyarm.reference import Trajectory
from skyarm.reference.path_time import PathTime
from skyarm.reference.planned_motion import PlannedBody
from skyarm.scenario.endings import Ending
from skyarm.sensing.estimate.estimator import (
    FULL_STATE,
    PASS_THROUGH,
    Estimator,
    PassThrough,
)
from skyarm.sensing.measurement import SensorNoise
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle import Vehicle
from skyarm.world import NO_WIND, Component, Fault, TimedPayload

if TYPE_CHECKING:
    from skyarm.sensing.cameras.camera_kinds import RaySensor
    from skyarm.world.battery_drain import BatteryDrain
    from skyarm.world.contact.contact import Contact
    from skyarm.world.contact.surface import Surface
    from skyarm.world.team.team import Team

    # of any internal state, which it alone knows
    AnyComponent = Component[Any]
else:
    # a world is imported when a scenario has one
    Contact = Team = AnyComponent = Component

PlacedModels = tuple[tuple[str, AnyComponent], ...]
"""Environment models, each after its parameter path."""

PLANTS = ("rigid_body", "mujoco")
"""Kinds of plants for the paper's cases; the registry lists all."""

HIGHEST_RATE = 1_000_000
"""Highest clock rate (Hz); a larger number is probably in another unit."""

LATEST = 1e7
"""Latest time (s) of a scenario: ten million control periods at 1 Hz."""

PERFECT_SENSORS = SensorNoise()

SEVERAL = (
    "agents = {}: must be one here; scenario.of(NAME) is the flight of one of them"
)
"""Message about a scenario of several vehicles where the word of one is read, completed
by their names."""

Record = TypeVar("Record")


class ScenarioError(ValueError):
    """Error in the description of a scenario."""


def whole(value: object) -> int | None:
    """Convert a whole number (NumPy's too) to int; None for anything else."""
    return (
        int(value)
        if not isinstance(value, bool) and isinstance(value, numbers.Integral)
        else None
    )


@immutable
class Rates:
    """Rates of physics, control and reference, Hz; physics / control and control /
    reference are whole numbers.
    """

    physics: Annotated[
        int,
        Unit(
            "Hz",
            "integration steps a second",
            low=1.0,
            high=HIGHEST_RATE,
            effect=(
                "higher rates integrate more exactly and take more time; stiff contact"
                " needs them"
            ),
        ),
    ] = 1000
    control: Annotated[
        int,
        Unit(
            "Hz",
            "calls of the law a second",
            low=1.0,
            high=HIGHEST_RATE,
            effect="higher rates shorten the delay of the loop and take more time",
        ),
    ] = 200
    reference: Annotated[
        int,
        Unit(
            "Hz",
            "samples of the held reference a second",
            low=1.0,
            high=HIGHEST_RATE,
            effect="lower rates make the law follow coarser steps of the reference",
        ),
    ] = 50

    @property
    def period(self) -> float:
        """Period of the control law, s."""
        return 1.0 / self.control

    def periods_between(self, frequency: float) -> int:
        """Control periods from one sample at a frequency (Hz) to the next; 1 at 0,
        which means each period.
        """
        # a quotient of frequencies that divide each other may be inexact
        return round(self.control / frequency) if frequency else 1

    def __post_init__(self) -> None:
        accept_fields(self, "rates", ScenarioError)
        for fast, slow in (("physics", "control"), ("control", "reference")):
            if getattr(self, fast) % getattr(self, slow):
                raise ScenarioError(
                    f"rates.{slow} = {getattr(self, slow)}: must divide rates.{fast} ="
                    f" {getattr(self, fast)}"
                )


OF_TRIM = ("position", "quaternion", "joints", "rotor_speeds")
"""Fields of a state in hover trim that follow from vehicle and reference; the others
are zero in any."""


@immutable
class PartialState(State):
    """Initial state of which some fields are left out: those of hover trim at the
    reference, of any vehicle.

    Attributes:
        left_out: names of these fields, which hold zeros here (:func:`first_state`
            completes them).
    """

    left_out: tuple[str, ...] = field_if_any(default=())

    @staticmethod
    def of(state: State, left_out: Collection[str], vehicle: Vehicle) -> State:
        """Partial state with the fields of a complete one, but those left out; the
        complete one if none is.
        """
        blank = leaves.parts(example_state(*vehicle.sizes))
        # a field that is empty for this vehicle, as without joints, is never lacking
        lacking = tuple(
            name for name in OF_TRIM if name in left_out and blank[name] != ()
        )
        fields = {
            name: blank[name] if name in lacking else getattr(state, name)
            for name in blank
        }
        return PartialState(**fields, left_out=lacking) if lacking else State(**fields)

    def path_names(self) -> Names:
        """Parameter paths of a complete state."""
        return {
            name: each
            for name, each in State.path_names(self).items()
            if name != "left_out"
        }

    def completed(self, trim: State) -> State:
        """State with the fields of hover trim where they are left out."""
        own = {
            name: getattr(self, name)
            for name in leaves.parts(trim)
            if name not in self.left_out
        }
        return replace(trim, **own)

    def to_entry(self) -> dict[str, Entry]:
        """Table [initial] of a scenario file: the stated fields."""
        keys = words_of_fields(State)
        return {
            keys.get(name, name): entry_of(value)
            for name, value in leaves.parts(self).items()
            if name not in (*self.left_out, "left_out")
        }


QUEUED = Word(unless="longest_command")
"""Declaration of a delay that may vary if the longest is stated, which sets the length
of the loop's queue."""


@immutable
@checked("delays", ScenarioError)
class Delays:
    """Dead times of the control loop: of measurements, of all commands, and of rotor or
    joint commands alone.

    ``measurement`` is a whole number of control periods, the others are of physics
    steps. ``rotors`` and ``joints`` are what the rotors' and the joints' part of a
    command takes on top of ``command``; an int of 0 is structure: they travel together.
    ``longest_command`` is the longest that ``command`` and the larger of the two get
    together in a batch that varies them from episode to episode; its episodes may have
    any delay from 0 to that. None: all episodes have the same.
    """

    measurement: Annotated[
        float,
        nonnegative(
            "s",
            "age of the measurement, a whole number of control periods",
            usual=1.0,
            effect="older measurements take phase margin from every loop",
        ),
    ] = 0.0
    command: Annotated[
        Scalar,
        nonnegative(
            "s",
            "dead time before a command takes effect",
            usual=1.0,
            effect="longer dead times take phase margin from every loop",
        ),
        QUEUED,
    ] = 0.0
    longest_command: Annotated[
        float | None,
        positive(
            "s",
            "longest total command delay in a batch that varies it; None: equal in all"
            " episodes",
        ),
    ] = None
    rotors: Annotated[
        Scalar, nonnegative("s", "additional dead time of rotor commands"), QUEUED
    ] = 0
    joints: Annotated[
        Scalar, nonnegative("s", "additional dead time of joint commands"), QUEUED
    ] = 0

    @property
    def apart(self) -> bool:
        """True if rotor or joint commands have a delay of their own in addition to the
        common command delay.
        """
        return any(
            not concrete(value) or value != 0 for value in (self.rotors, self.joints)
        )

    @property
    def longest(self) -> float:
        """Longest command delay (s): the stated upper bound if delays vary between
        episodes.
        """
        if self.longest_command is not None:
            return self.longest_command
        return float(self.command) + max(float(self.rotors), float(self.joints))


VIEWS = ("follow", "fixed", "tip")
"""Views of a film, which a camera may not be named after: ``skyarm film --camera`` has
both."""


@immutable
class NamedSensor:
    """Named sensor in addition to the full state; an estimator receives its readings
    under this name.
    """

    name: str
    sensor: Sensor

    def __post_init__(self) -> None:
        if (
            not isinstance(self.name, str)
            or not self.name.isidentifier()
            or self.name == FULL_STATE
        ):
            raise ScenarioError(
                f"sensors: name = {shown(self.name)}: must be a word, and not"
                f" {FULL_STATE!r}"
            )
        if not isinstance(self.sensor, Sensor):
            raise ScenarioError(
                f"sensors.{self.name} = {shown(self.sensor)}: must be a Sensor"
            )
        if self.sensor.sees and self.name in VIEWS:
            raise ScenarioError(
                f"sensors: name = {shown(self.name)}: must be none of"
                f" {', '.join(VIEWS)}, views of a film, for a camera"
            )


@immutable
class JointDrive:
    """Actuator model assigned to one joint by the joint's name."""

    joint: str
    drive: Drive

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.joint

    def __post_init__(self) -> None:
        if not isinstance(self.joint, str):
            raise ScenarioError(
                f"drives: joint = {shown(self.joint)}: must be the name of a joint"
            )
        if not isinstance(self.drive, Drive):
            raise ScenarioError(
                f"drives.{self.joint} = {shown(self.drive)}: must be a Drive"
            )


@immutable
class Change:
    """Scheduled change of a parameter or section of the scenario, from the first
    control period at or after ``at``.

    Attributes:
        at: s.
        path: path of a number, or of a part as a whole.
        value: the number, or what a scenario file would hold in the part's place: text,
            true or false, lists (held as tuples) or tables.
    """

    at: Annotated[
        float,
        nonnegative(
            "s", "time of the change; it takes effect at the next control period"
        ),
    ]
    path: str
    value: Any

    def __post_init__(self) -> None:
        try:
            at = number(coerce.plain_number(self.at), "at", low=0.0)
            if at > LATEST:
                raise ScenarioError(
                    f"at = {at!r}: must be at most {LATEST:g} s, beyond which no flight"
                    " lasts"
                )
            object.__setattr__(self, "at", at)
            if not isinstance(self.path, str) or not self.path:
                raise ScenarioError(
                    f"path = {shown(self.path)}: must be text that is not empty"
                )
            object.__setattr__(
                self, "value", _plain_value("value", self.value, whole=False)
            )
        except ValueError as error:
            raise ScenarioError(str(error)) from None
        except RecursionError:
            raise ScenarioError(
                "value: has too many lists or tables within each other"
            ) from None

    def tick(self, rate: int) -> int:
        """Index of the control period in which the change takes effect, at a control
        rate in Hz.
        """
        k = math.floor(self.at * rate)
        # against the instants as the loop has them: k / rate
        while k / rate < self.at:
            k += 1
        return k

    @property
    def of_law(self) -> bool:
        """True for a change of the controller; such changes are dropped when the law is
        replaced.
        """
        return word_of(self.path).split(".", maxsplit=1)[0] == "controller"

    @property
    def table(self) -> Any:
        """Value of a scheduled change in the format of a scenario file: lists in place
        of tuples.
        """
        return _table(self.value)


def _plain_value(field: str, value: object, whole: bool = True) -> Any:
    """Convert the value of a scheduled change: lists to tuples, numbers to floats
    unless ``whole``.
    """
    value = coerce.plain_number(value)
    if isinstance(value, Mapping):
        if not all(isinstance(name, str) for name in value):
            raise RecordError(
                f"{field} = {shown(value)}: must have names that are texts"
            )
        return {
            name: _plain_value(f"{field}.{name}", each) for name, each in value.items()
        }
    if isinstance(value, (list, tuple)):
        return tuple(
            _plain_value(f"{field}[{i}]", each) for i, each in enumerate(value)
        )
    # before the numbers, because Python counts True among them
    if isinstance(value, (bool, str)) or (whole and isinstance(value, (int, float))):
        return value
    if isinstance(value, numbers.Real):
        return number(value, field)
    try:
        if (
            not whole
            and value is not None
            and not isinstance(value, (bytes, set, frozenset))
        ):
            # lanes of a batch, nodes of a trace
            return coerce.number(field, value)
    except RecordError:
        pass
    raise RecordError(
        f"{field} = {shown(value)}: must be a number, text, true, false, a list or a"
        " table"
    )


def _table(value: object) -> Any:
    if isinstance(value, Mapping):
        return {name: _table(each) for name, each in value.items()}
    return [_table(each) for each in value] if isinstance(value, tuple) else value


def in_order(changes: Iterable[Change], rate: int) -> tuple[Change, ...]:
    """Sort scheduled changes by control period, and keep the order within one
    period.
    """
    return tuple(sorted(changes, key=lambda change: change.tick(rate)))


CLOSURES = ("spring", "weld")
"""Ways in which a plant closes the loops of grasps."""

CONTACTS = ("points", "geoms")
"""Contact models of a plant: that of this library, and MuJoCo's own."""

SETTINGS: Mapping[str, tuple[str, ...]] = {
    "integrator": INTEGRATORS,
    "closure": CLOSURES,
    "contact": CONTACTS,
}
"""Settings of the simulation besides its kind, whose names the registry has, and the
words that each may be."""


@immutable
class Solver:
    """Simulation settings of a plant: kind of simulator and integrator.

    Attributes:
        kind: "rigid_body" or "mujoco". integrator: "rk4", "euler" or "rk4_staged".
        closure: grasps are forces of a "spring", or constraints of MuJoCo of the same
            stiffness and damping, a "weld".
        contact: contact forces are those of this library at "points", or MuJoCo's own
            between the same shapes as its "geoms".
    """

    kind: Annotated[str, STRUCTURAL] = "rigid_body"
    integrator: Annotated[str, STRUCTURAL] = "rk4"
    closure: Annotated[str, STRUCTURAL] = dataclasses.field(
        default="spring", metadata={UNWRITTEN: "spring"}
    )
    contact: Annotated[str, STRUCTURAL] = dataclasses.field(
        default="points", metadata={UNWRITTEN: "points"}
    )

    def __post_init__(self) -> None:
        for field, allowed in {"kind": registrations("plant"), **SETTINGS}.items():
            value = getattr(self, field)
            if not isinstance(value, str) or value not in allowed:
                raise ScenarioError(
                    f"plant.{field} = {shown(value)}: {must_be_one_of(allowed, value)}"
                )
        if self.kind == "mujoco" and self.integrator != "euler":
            return
        for field in ("closure", "contact"):
            value, usual = getattr(self, field), SETTINGS[field][0]
            if value != usual:
                raise ScenarioError(
                    f"plant.{field} = {value!r}: must be {usual!r} unless kind is"
                    " 'mujoco' and integrator is not 'euler'"
                )


@immutable
class Environment:
    """Surroundings shared by all vehicles: wind, other air motion, forces, ground and
    contact model.

    Attributes:
        wind: motion of the air. air, forces: further components
            (:mod:`skyarm.world.component`).
        ground: end the episode when the lowest point reaches z = 0.
        world: surfaces, and the vehicle's points that touch them
            (:mod:`skyarm.world.contact`); None for free flight.
    """

    wind: Annotated[AnyComponent, Word(whole=True, kind="air force", reader="wind")] = (
        NO_WIND
    )
    air: Annotated[tuple[AnyComponent, ...], Word(whole=True, kind="air")] = ()
    forces: Annotated[tuple[AnyComponent, ...], Word(whole=True, kind="force")] = ()
    ground: Annotated[bool, Word(whole=True, varies="never")] = True
    world: Annotated[
        Contact | None, Word("/world", kind="world", usual="contact", reader="world")
    ] = field_if_any(default=None)

    def __post_init__(self) -> None:
        # a world is asked for what it can, since importing its class takes time
        if self.world is not None and not hasattr(self.world, "on"):
            raise ScenarioError(
                f"world = {shown(self.world)}: must be a Contact or None"
            )
        accept_fields(self, "", ScenarioError)

    @property
    def has_ground(self) -> bool:
        """True if there is a ground at z = 0; planes and heightfields of the world take
        its place.
        """
        surfaces = () if self.world is None else self.world.surfaces
        grounds = "plane", "heightfield"
        return self.ground and not any(each.shape in grounds for each in surfaces)

    @property
    def solids(self) -> tuple[Surface, ...]:
        """Surfaces at rest: the ground, if there is one, and those of the world."""
        still = () if self.world is None else self.world.still
        if not self.has_ground:
            return still
        from skyarm.world.contact.surface import Surface

        return (Surface(name="ground"), *still)

    @property
    def placed_models(self) -> PlacedModels:
        """Wind, air and added forces with their parameter paths, such as
        ``environment.air[0]``.
        """
        lists = {"environment.air": self.air, "environment.forces": self.forces}
        numbered = [
            (f"{where}[{i}]", each)
            for where, several in lists.items()
            for i, each in enumerate(several)
        ]
        return (("environment.wind", self.wind), *numbered)


@immutable
class Agent:
    """One vehicle with its plant, law, reference, sensors, estimator, drives, delays
    and payloads.

    Attributes:
        plant: true vehicle and gravity.
        controller: law with its model.
        reference: desired motion.
        tracking_start: s; before it the law receives the initial reference at rest.
            Errors always refer to the running reference. An int of 0 is structure: the
            law tracks from the first instant.
        path_time: planned time of the reference (:func:`skyarm.govern`); None for none.
        noise: noise of the full state. sensors: sensors in addition to it.
        estimator: estimator from all readings to the measurement that the law receives.
        drives: drives of joints whose setpoint is not the torque.
        delays: dead times of the loop.
        initial: state at t = 0; None, or what it leaves out, is hover trim of the truth
            at the reference, as far as its rotors can turn.
        faults: losses of single actuators.
        payloads: loads that are picked up and set down in flight.
    """

    plant: Annotated[Truth, Word(reader="plant")]
    controller: Annotated[
        Controller,
        Word("model", inside=("par", "model"), reader="model"),
        Word(whole=True, entries=(("law", ()),), inside=("par",), reader="controller"),
    ]
    reference: Annotated[
        Trajectory,
        Word(
            whole=True,
            entries=(
                ("base", ("x", "y", "z")),
                ("yaw", ("yaw",)),
                ("joints", ("joints",)),
            ),
            reader="reference",
        ),
    ]
    tracking_start: Annotated[
        Scalar,
        nonnegative(
            "s",
            "time at which the law begins to track; before, it holds the initial"
            " reference",
        ),
        Word("reference.tracking_start"),
    ] = 0
    path_time: Annotated[
        PathTime | None, Word("reference.governor", varies="never")
    ] = field_if_any(default=None)
    noise: Annotated[SensorNoise, Word("sensors")] = PERFECT_SENSORS
    sensors: Annotated[
        tuple[NamedSensor, ...],
        Word("sensors.*", kind="sensor", inside=("*", "sensor")),
    ] = ()
    estimator: Annotated[Estimator, Word(whole=True, kind="estimator")] = PASS_THROUGH
    drives: Annotated[
        tuple[JointDrive, ...],
        Word("plant.drives.*", kind="drive", inside=("*", "drive")),
    ] = ()
    delays: Annotated[Delays, STRUCTURAL] = Delays()
    initial: Annotated[State | None, Word(varies="between")] = None
    faults: Annotated[
        tuple[Fault, ...],
        Word("/environment.faults", whole=True, kind="fault", usual="loss"),
    ] = ()
    payloads: Annotated[
        tuple[TimedPayload, ...],
        Word(kind="payload", usual="rigid", reader="payloads"),
    ] = field_if_any(default=())

    def __post_init__(self) -> None:
        accept_fields(self, "", ScenarioError)
        names = [payload.name for payload in self.payloads]
        for i, name in enumerate(names):
            if name and names.count(name) > 1:
                raise ScenarioError(
                    f"payloads[{i}].name = {name!r}: must be of one payload only"
                )
        if self.initial is not None:
            with errors_as(ScenarioError):
                require_fields(self.initial, "initial")
            object.__setattr__(self, "initial", _as_data(self.initial))

    @property
    def vehicle(self) -> Vehicle:
        """True vehicle, as the plant moves it."""
        return self.plant.vehicle

    @property
    def model(self) -> Model:
        """Model of the vehicle that the law computes with."""
        model: Model = self.controller.par.model
        return model

    @property
    def law_reference(self) -> Trajectory:
        """Reference as the law receives it: attitude and rotors of a plan if it follows
        the whole state.
        """
        planned = self.reference.planned
        if planned is None or follows_plan(self.controller.par):
            return self.reference
        only = PlannedBody(center=planned.center, tip=planned.tip)
        return replace(self.reference, planned=only)

    @property
    def power(self) -> tuple[BatteryDrain, ...]:
        """Model of the electrical load on the plant's battery, as a tuple of one; empty
        without a battery.
        """
        vehicle = self.plant.vehicle
        if vehicle.battery is None:
            return ()
        from skyarm.world.battery_drain import BatteryDrain

        return (BatteryDrain(battery=vehicle.battery, rotors=vehicle.rotors),)

    @property
    def has_estimator(self) -> bool:
        """True if the law receives an estimator's output in place of the state."""
        return type(self.estimator) is not PassThrough

    @property
    def placed_estimator(self) -> Estimator:
        """Estimator with the places and angles of the sensors."""
        return self.estimator.placing({each.name: each.sensor for each in self.sensors})

    @property
    def all_sensors(self) -> tuple[tuple[str, Sensor], ...]:
        """Sensors of a control period by name: the full-state sensor first, then named
        sensors.
        """
        named = ((each.name, each.sensor) for each in self.sensors)
        return ((FULL_STATE, self.noise), *(each for each in named if not each[1].sees))

    @property
    def cameras(self) -> dict[str, RaySensor]:
        """Cameras and lidars by name, which are no part of a control period."""
        every = {each.name: each.sensor for each in self.sensors if each.sensor.sees}
        return cast("dict[str, RaySensor]", every)

    @property
    def modelled_payloads(self) -> tuple[TimedPayload, ...]:
        """Payloads that the law's model has from pick to drop, apart from those that
        waiting phases pick.

        The loop adds the latter to the model, since their instants are unknown before
        the flight.
        """
        waiting = {name for guard in self.reference.guards for name in guard.loads}
        return tuple(
            each for each in self.payloads if each.believed and each.name not in waiting
        )

    @property
    def joint_drives(self) -> tuple[JointDrive, ...]:
        """Drives of joints by joint name: those of the scenario, and those of the
        vehicle for other joints.
        """
        named = [each.joint for each in self.drives]
        carried = (each for each in self.plant.vehicle.drives if each.name not in named)
        return (
            *self.drives,
            *(JointDrive(joint=each.name, drive=each.drive) for each in carried),
        )

    @property
    def commands_setpoints(self) -> tuple[bool, ...]:
        """For each joint, true if the law commands a setpoint of the joint's drive, not
        a torque or force.
        """
        drives = self.all_drives or (TORQUE_DRIVE,) * self.plant.vehicle.n
        return tuple(not drive.takes_torque for drive in drives)

    @property
    def all_drives(self) -> tuple[Drive, ...]:
        """Drive of each joint in order; empty if every joint is commanded by torque."""
        given = {each.joint: each.drive for each in self.joint_drives}
        joints = self.plant.vehicle.joints if given else ()
        return tuple(given.get(joint.name, TORQUE_DRIVE) for joint in joints)

    def placed_models(self, environment: Environment) -> PlacedModels:
        """Environment models that the vehicle has for itself, with their parameter
        paths: wind, payloads, battery.
        """
        return (
            *((at, each) for at, each in environment.placed_models if not each.shared),
            *((f"payloads[{i}]", each) for i, each in enumerate(self.payloads)),
            *(("plant.vehicle.battery", each) for each in self.power),
        )


def _with_steady_model(agent: Agent) -> Agent:
    """Agent whose law's model takes up no payload at a known instant."""
    names = [each.name for each in agent.modelled_payloads]
    kept = (
        replace(each, believed=each.believed and each.name not in names)
        for each in agent.payloads
    )
    return replace(agent, payloads=tuple(kept))


def words_as_keywords(kind: type[Record]) -> type[Record]:
    """Decorator of a dataclass that also accepts fields of its groups as keywords, such
    as ``wind`` of ``environment``.

    ``dataclasses.replace`` calls the class and takes them too. Type checkers see the
    record's own fields alone.
    """
    generated: Callable[..., None] = kind.__init__

    @functools.wraps(generated)
    def take_words(record: Record, **words: object) -> None:
        # in loops: a copy with all fields needs no sorting into groups
        complete = words.keys() == defaults(kind).keys()
        generated(record, **(words if complete else _fields_from_words(kind, words)))

    kind.__init__ = take_words  # type: ignore[assignment, method-assign]
    return kind


def _fields_from_words(kind: type, words: dict[str, object]) -> dict[str, object]:
    """Sort keyword arguments, such as ``wind``, into the groups of fields, such as
    ``environment``, that have them.

    Raises:
        TypeError: a field is missing, or there is no such field or word.
    """
    fields: dict[str, Any] = {
        name: words.pop(name)
        for name in (*defaults(kind), *groups(kind))
        if name in words
    }
    members = fields.get("agents")
    if isinstance(members, Mapping) and len(members) == 1:
        del fields["agents"]
        fields.setdefault("agent", next(iter(members.values())))
    for group, group_kind in groups(kind).items() if words else ():
        if inner := {
            word: words.pop(word)
            for word in field_names(group_kind) or ()
            if word in words
        }:
            if group == "agent" and "agents" in fields:
                raise ScenarioError(
                    f"{next(iter(inner))}:"
                    f" {SEVERAL.format(', '.join(fields['agents']))}"
                )
            if group not in fields:
                fields[group] = group_kind(**inner)
            elif isinstance(fields[group], group_kind):
                # what is not is refused as the group
                fields[group] = replace(fields[group], **inner)
    if "agent" in fields:
        known: Members[Any] = (
            members
            if isinstance(members, Members)
            else Members(tuple(members or (SOLE,)))
        )
        fields["agents"] = replace(known, records=(fields.pop("agent"),))
    for name, usual in defaults(kind).items():
        if usual is dataclasses.MISSING and name not in fields:
            raise TypeError(f"{kind.__name__}: {name} is missing")
    if words:
        meant = did_you_mean(next(iter(words)), field_names(Agent) or ())
        raise TypeError(f"{kind.__name__}: {meant}has no field {', '.join(words)}")
    return fields


class ShortNames:
    """Base of :class:`Scenario` with the fields of its groups, and of its only vehicle,
    under their own names.

    ``scenario.wind`` is ``scenario.environment.wind``, ``scenario.plant`` is
    ``scenario.agent.plant``, and ``scenario.with_plant(plant)`` is the scenario with
    another one.

    Raises:
        ScenarioError: a field of the only vehicle, or another one in its place, where
            several fly.
    """

    __slots__ = ()

    if TYPE_CHECKING:
        # made below, one for each field of a group; types are for checkers
        plant: Truth
        """Vehicle and gravity that are simulated, as opposed to the control law's model
        of them.
        """
        controller: Controller
        """Control law with its model of the vehicle."""
        reference: Trajectory
        """Reference trajectory: desired motion of the vehicle over time."""
        tracking_start: Scalar
        """Time (s) at which the control law begins to track the reference."""
        path_time: PathTime | None
        """Time scaling of the reference; None without one."""
        noise: SensorNoise
        """Noise of the full-state measurement."""
        sensors: tuple[NamedSensor, ...]
        """Sensors in addition to the full-state sensor."""
        estimator: Estimator
        """Estimator of the measurement that the law receives."""
        drives: tuple[JointDrive, ...]
        """Joint drives that the scenario assigns, in place of the vehicle's drives for
        the same joints.
        """
        delays: Delays
        """Delays of measurements and commands in the control loop."""
        initial: State | None
        """Stated initial state of the vehicle; None for hover trim."""
        faults: tuple[Fault, ...]
        """Faults of single actuators."""
        payloads: tuple[TimedPayload, ...]
        """Payloads that are picked up and set down in flight."""
        kind: str
        """Kind of simulator, such as "rigid_body" or "mujoco"."""
        integrator: str
        """Integrator of the equations of motion: "rk4", "euler" or "rk4_staged"."""
        closure: str
        """Closure of grasps: forces of a "spring", or constraints of MuJoCo, a
        "weld".
        """
        contact: str
        """Contact forces: skyarm's at its "points", or MuJoCo's between its "geoms"."""
        wind: AnyComponent
        """Wind model of the scenario."""
        air: tuple[AnyComponent, ...]
        """Models of air motion in addition to the wind."""
        forces: tuple[AnyComponent, ...]
        """Force models in addition to wind and contact."""
        ground: bool
        """True if the episode ends when the vehicle reaches the ground at z = 0; planes
        of the world take its place.
        """
        world: Contact | None
        """Contact model: surfaces and the vehicle's points that touch them; None for
        free flight.
        """

        @property
        def agent(self) -> Agent:
            """Only vehicle of the scenario."""
            ...

        def with_agent(self, agent: Agent) -> Scenario:
            """Copy of the scenario with another only vehicle."""
            ...

    def with_controller(self, controller: Controller) -> Scenario:
        """Scenario with another control law; scheduled changes of the law stay
        (:meth:`under` leaves them out).
        """
        return self.with_agent(replace(self.agent, controller=controller))

    def with_plant(self, plant: Truth) -> Scenario:
        """Scenario with another true vehicle or gravity; the law's model stays."""
        return self.with_agent(replace(self.agent, plant=plant))

    def with_reference(self, reference: Trajectory) -> Scenario:
        """Copy of the scenario with another reference trajectory."""
        return self.with_agent(replace(self.agent, reference=reference))

    def with_delays(self, delays: Delays) -> Scenario:
        """Copy of the scenario with other delays of measurements and commands."""
        return self.with_agent(replace(self.agent, delays=delays))

    def with_initial(self, initial: State) -> Scenario:
        """Copy of the scenario with another initial state of the vehicle."""
        return self.with_agent(replace(self.agent, initial=initial))


@words_as_keywords
@immutable
class Scenario(ShortNames):
    """Complete definition of one experiment.

    ``scenario.wind`` means ``scenario.environment.wind``. It is made of its fields or,
    as type checkers do not see, of the words of a group in the group's place:
    ``Scenario(wind=...)``, ``replace(scenario, wind=...)``.

    Attributes:
        name: short name. title: one-line description.
        duration: s.
        solver: simulation of the plant. agent: the vehicle with its law. environment:
            surroundings.
        team: law by which vehicles share the load of a body; None without one.
        endings: conditions that end the episode in addition to the library's endings
            (:mod:`skyarm.scenario.endings`).
        windows: spans of time of its metrics; those that end after a shortened flight
            are general in it.
        changes: scheduled changes (:mod:`skyarm.scenario.in_flight`); those after the
            end of a shortened flight are left out.
        seed, episode: keys of all noise.
    """

    name: Annotated[str, STRUCTURAL]
    title: Annotated[str, STRUCTURAL] = ""
    duration: Annotated[float, positive("s", "duration of the flight"), STRUCTURAL]
    rates: Annotated[Rates, STRUCTURAL] = Rates()
    solver: Annotated[Solver, Word("plant", group=True)] = Solver()
    agents: Annotated[
        Mapping[str, Agent],
        Unit(
            "",
            "vehicles by name, in order; the one of a file without names is main",
            rule=members_of("Agent"),
        ),
        Word("", group=True),
    ] = dataclasses.field(metadata={"alone": "agent"})
    environment: Annotated[Environment, Word(group=True)] = Environment()
    team: Annotated[Team | None, Word(kind="team", reader="team")] = field_if_any(
        default=None
    )
    endings: Annotated[tuple[Ending, ...], Word(whole=True, kind="ending")] = ()
    windows: Annotated[Windows, STRUCTURAL] = Windows()
    changes: Annotated[tuple[Change, ...], Word(varies="between", reader="changes")] = (
        field_if_any(default=())
    )
    seed: Annotated[int, STRUCTURAL] = 0
    episode: Annotated[int, STRUCTURAL] = 0

    def __post_init__(self) -> None:
        with errors_as(ScenarioError):
            check_name(self.name)
            for name in ("seed", "episode"):
                object.__setattr__(self, name, noise_key(name, getattr(self, name)))
            accept_fields(self, "")
            # a view of one of several keeps the world that was fitted to all
            world = None if self.others else self.environment.world
            if world is not None and (fitted := world.on(self.vehicles)) is not world:
                object.__setattr__(
                    self, "environment", replace(self.environment, world=fitted)
                )

    def _repr_html_(self) -> str:
        return notebook_html(self)

    @property
    def as_begun(self) -> Scenario:
        """Scenario at the start of the flight, without scheduled changes: the law's
        model takes up no payload.
        """
        begun = replace(self, changes=()) if self.changes else self
        if not any(each.modelled_payloads for each in self.agents.values()):
            return begun
        return replace(
            begun,
            agents=replace(
                self._members,
                records=tuple(map(_with_steady_model, self._members.records)),
            ),
        )

    @property
    def agent(self) -> Agent:
        """The only vehicle of the scenario.

        Raises:
            ScenarioError: there are several; the message names them.
        """
        only, *others = self._members.records
        if others:
            raise ScenarioError(SEVERAL.format(", ".join(self.agents)))
        return only

    @property
    def _members(self) -> Members[Agent]:
        """Vehicles by name, as the check of the field stored them."""
        return cast("Members[Agent]", self.agents)

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the vehicles that fly beside the one of this scenario, which
        :meth:`of` made; () of a whole one.
        """
        return self._members.others

    def alone(self, purpose: str) -> Scenario:
        """Scenario itself, for a purpose that takes the flight of one vehicle without
        others.

        Raises:
            ScenarioError: there are several, or it is the view of one of them; the
                message names them.
        """
        names = (*self.agents, *self.others)
        if len(names) > 1:
            words = (
                f"must be one for {purpose}; leave the others, and what they hold, out"
                " of the scenario"
            )
            raise ScenarioError(f"agents = {', '.join(names)}: {words}")
        return self

    def of(self, name: str) -> Scenario:
        """Flight of one vehicle of the scenario, in the surroundings of all, as a
        scenario.

        Raises:
            ScenarioError: there is none of this name.
        """
        if name not in self.agents:
            raise ScenarioError(
                f"agents = {shown(name)}: {must_be_one_of(self.agents, name)}"
            )
        # itself, since callers tell a view of one of several by its identity
        if not self.is_team:
            return self
        of_it = (each for each in self.changes if agent_of(each.path) in ("", name))
        changes = tuple(replace(each, path=word_of(each.path)) for each in of_it)
        return replace(self, agents=self._members.only(name), changes=changes)

    @property
    def is_team(self) -> bool:
        """True if several vehicles fly."""
        return len(self.agents) > 1

    @property
    def vehicles(self) -> dict[str, Vehicle]:
        """True vehicle of each agent by name."""
        return {name: each.vehicle for name, each in self.agents.items()}

    @property
    def law_names(self) -> str:
        """Name of the control law; of several vehicles all that differ, joined by plus
        signs.
        """
        return "+".join(
            dict.fromkeys(each.controller.name for each in self.agents.values())
        )

    @property
    def setpoints(self) -> dict[str, tuple[bool, ...]]:
        """For each vehicle and joint, true if the law commands a setpoint of the
        joint's drive.
        """
        return {name: each.commands_setpoints for name, each in self.agents.items()}

    @property
    def autopilot(self) -> Any:
        """External autopilot that flies the only vehicle
        (:mod:`skyarm.links.autopilots`); None for control laws.

        Raises:
            ScenarioError: an autopilot in a scenario of several vehicles.
        """
        autopilots = {
            name: autopilot_of(each.controller) for name, each in self.agents.items()
        }
        for name, each in autopilots.items() if len(autopilots) > 1 else ():
            if each is not None:
                raise ScenarioError(
                    f"agents.{name}.controller.autopilot: must be left out; an"
                    " autopilot flies alone"
                )
        return next(iter(autopilots.values()))

    @property
    def is_compiled(self) -> bool:
        """True if the laws of all vehicles can be traced into machine code."""
        return all(each.controller.compiled for each in self.agents.values())

    def with_loads_of(self, other: Scenario) -> Scenario:
        """Scenario with another one's list of payloads for vehicles without force
        sensors, which alone need it.
        """
        pairs = zip(self.agents.values(), other.agents.values(), strict=True)
        records = tuple(
            (
                mine
                if any(each.sensor.feels is not None for each in mine.sensors)
                else replace(mine, plant=replace(mine.plant, loads=its.plant.loads))
            )
            for mine, its in pairs
        )
        return replace(self, agents=replace(self._members, records=records))

    def with_agent(self, agent: Agent) -> Scenario:
        """Copy of the scenario of one vehicle with another one in its place."""
        return replace(self, agents=replace(self._members, records=(agent,)))

    def under(self, *controllers: Controller) -> Scenario:
        """Scenario with another law of each vehicle in order, and without scheduled
        changes of the present laws.
        """
        # one law for several vehicles is refused with their names, not by zip
        agents = [self.agent] if len(controllers) == 1 else self.agents.values()
        pairs = zip(agents, controllers, strict=True)
        records = tuple(
            replace(own, controller=controller) for own, controller in pairs
        )
        changes = tuple(each for each in self.changes if not each.of_law)
        return replace(
            self, changes=changes, agents=replace(self._members, records=records)
        )

    def with_kind(self, kind: str) -> Scenario:
        """Scenario on another kind of simulator, "rigid_body" or "mujoco"."""
        return replace(self, solver=replace(self.solver, kind=kind))

    @property
    def steps(self) -> int:
        """Number of control periods of the flight."""
        # a whole number but for rounding, as a rule has checked
        return round(self.duration * self.rates.control)

    @property
    def components(self) -> tuple[AnyComponent, ...]:
        """All environment models of one vehicle: wind, air, forces, payloads and
        battery, then those that all share.
        """
        return (*self.own_components(self.agent), *self.shared_components)

    @property
    def placed_components(self) -> PlacedModels:
        """All environment models of one vehicle with their parameter paths, such as
        ``environment.air[0]``.
        """
        return (*self.agent.placed_models(self.environment), *self.placed_shared)

    def own_components(self, agent: Agent) -> tuple[AnyComponent, ...]:
        """Environment models that a vehicle has for itself: wind, air and forces, its
        payloads, its battery's load.
        """
        return tuple(
            component for _, component in agent.placed_models(self.environment)
        )

    @property
    def shared_components(self) -> tuple[AnyComponent, ...]:
        """Environment models that all vehicles share: contact, and air and forces that
        say so.
        """
        return tuple(component for _, component in self.placed_shared)

    @property
    def placed_shared(self) -> PlacedModels:
        """Environment models that all vehicles share, with their parameter paths."""
        together = (
            (at, each) for at, each in self.environment.placed_models if each.shared
        )
        teams = () if self.team is None else (("team", self.team),)
        return (*together, *teams, *(("world", each) for each in self.worlds))

    @property
    def worlds(self) -> tuple[Contact, ...]:
        """The contact model (surfaces, grippers) as a tuple of one; empty if there is
        nothing to touch.
        """
        if self.world is None:
            return ()
        from skyarm.world.contact.closed_contact import ClosedContact, GeomContact

        if self.solver.contact == "geoms":
            return (GeomContact(**parts(self.world)),)
        own = self.closure == "spring"
        return (self.world if own else ClosedContact(**parts(self.world)),)


def _add_short_names() -> None:
    """Give :class:`ShortNames` a property for each field of a scenario's groups."""
    # with its planes and heightfields a world takes the place of the ground
    others = {"ground": "environment.has_ground"}
    for group, kind in groups(Scenario).items():
        for name in field_names(kind) or ():
            place = others.get(name, f"{group}.{name}")
            field = property(attrgetter(place), doc=f"Short name of ``{place}``.")
            setattr(ShortNames, name, field)


_add_short_names()


class FieldsByWord(TypedDict, total=False):
    """Fields of a scenario, and those of its groups, that :func:`with_words`
    replaces.
    """

    name: str
    duration: float
    seed: int
    agents: Mapping[str, Agent]
    windows: Windows
    changes: tuple[Change, ...]
    plant: Truth
    controller: Controller
    reference: Trajectory
    tracking_start: Scalar
    path_time: PathTime | None
    noise: SensorNoise
    drives: tuple[JointDrive, ...]
    delays: Delays
    initial: State | None
    faults: tuple[Fault, ...]
    payloads: tuple[TimedPayload, ...]
    wind: AnyComponent
    air: tuple[AnyComponent, ...]
    forces: tuple[AnyComponent, ...]
    ground: bool
    world: Contact | None


def with_words(scenario: Scenario, **words: Unpack[FieldsByWord]) -> Scenario:
    """Copy of a scenario with fields replaced by keyword, also fields of its groups,
    such as ``wind``.
    """
    # the class takes words of its groups, too, which type checkers do not see
    return replace(scenario, **words)  # type: ignore[misc]


def check_name(name: str) -> None:
    """Check that a scenario's name is valid as a file name on all systems."""
    if not is_result_name(name):
        raise ScenarioError(f"name = {shown(name)}: {ALLOWED}")


def noise_key(field: str, value: object) -> int:
    """Check a key of the noise generator (seed or episode): a whole number from 0 to
    2**32 - 1.
    """
    key = whole(value)
    if key is None or not 0 <= key < 2**32:
        raise ScenarioError(
            f"{field} = {shown(value)}: must be a whole number from 0 to 2**32 - 1"
        )
    return key


# 16 is chosen: a miss costs 0.4 ms (measured)
@keep_results(16)
def trimmed_state(world: Truth, position: Vec3, yaw: Scalar, joints: Scalars) -> State:
    """Hover trim of the plant: at rest and level, with rotor speeds that hold its
    weight and its arm's torque.

    No rotor turns faster than it can: a truth that is too heavy to hover starts at full
    speed and sinks.
    """
    vehicle = world.vehicle
    trim = hover_trim(vehicle, joints, world.gravity)
    still = vehicle.zeros
    return State(
        position=Vec3(*map(data, position)),
        quaternion=Quaternion(cos(0.5 * yaw), 0.0, 0.0, sin(0.5 * yaw)),
        velocity=ZERO3_DATA,
        rate=ZERO3_DATA,
        joints=tuple(map(data, joints)),
        joint_rates=still,
        rotor_speeds=tuple(
            data(minimum(w, r.max_speed))
            for w, r in zip(trim.speeds, vehicle.rotors, strict=True)
        ),
        tilts=(0.0,) * len(vehicle.tilts),
    )


def cameras_of(scenario: Scenario) -> dict[str, tuple[str, RaySensor]]:
    """Vehicle and record of each camera and lidar by name, behind that of its vehicle
    and a dot if there are several.
    """
    return {
        f"{agent}.{name}" if scenario.is_team else name: (agent, sensor)
        for agent, own in scenario.agents.items()
        for name, sensor in own.cameras.items()
    }


def first_state(scenario: Scenario) -> State:
    """Initial state of a scenario: the stated one, and hover trim at the reference for
    what it leaves out.
    """
    own = scenario.agent
    initial = own.initial
    if initial is not None and not isinstance(initial, PartialState):
        return initial
    start = own.reference.at(0.0)
    joints = (
        tuple(start.joints)
        if initial is None or "joints" in initial.left_out
        else initial.joints
    )
    trim = trimmed_state(own.plant, start.position, data(start.yaw), joints)
    # as stated fields are held: floats, and a quaternion of unit length
    return trim if initial is None else initial.completed(_as_data(trim))


def _as_data(state: State) -> State:
    """State with all numbers as floats, which are inputs of compiled code, and with a
    normalised quaternion.
    """

    def as_data(value: Any) -> Any:
        numbers = map(data, value)
        return tuple(numbers) if isinstance(value, tuple) else type(value)(*numbers)

    fields = {name: as_data(getattr(state, name)) for name in field_names(State) or ()}
    return replace(
        state,
        **fields | {"quaternion": coerce.near_unit_quaternion(fields["quaternion"])},
    )
