"""Interface of autopilots: settings of the program that flies the base, its link, and
the control law of the joints.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from skyarm import dynamics
from skyarm.algebra import ZERO3, Motion, Scalar, sums
from skyarm.algebra.frames import to_our_axes
from skyarm.control.blocks.actuators import limit_efforts
from skyarm.control.blocks.common import joint_pd
from skyarm.control.controller import Controller, ControllerError, Memory
from skyarm.control.law_maker import default_joint_gains, fitting_mixer
from skyarm.control.model import JointGains, Model
from skyarm.dynamics.actuators import Command, Mixer
from skyarm.records.files import shown
from skyarm.records.immutable import immutable, positional
from skyarm.records.plain import Plain
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.sensing.channel import Channel
from skyarm.sensing.measurement import Measurement
from skyarm.sensing.sensor import Sensor, at_origin
from skyarm.sensing.sensor_kinds import Imu
from skyarm.vehicle import Vehicle

if TYPE_CHECKING:
    from skyarm.links.transcript import Tape
    from skyarm.scenario.scenario_record import Scenario

Numbers = Sequence[float]

Patience = Annotated[
    float,
    Unit(
        "s", "longest silence of the autopilot, by the wall clock", low=0.1, high=600.0
    ),
]

Preparation = Annotated[
    float,
    Unit("s", "longest time from power-on to hover, simulated", low=1.0, high=1000.0),
]

FLIGHT_IMU = Imu(
    gyro=Channel(density=2e-4, walk=1e-5),
    accelerometer=Channel(density=3e-3, walk=1e-4),
)
"""Inertial unit of a flight controller: InvenSense MPU-9250 data sheet (0.01 deg/s and
300 micro-g per root Hz)."""


LARGEST = 3.4e38
"""Largest value of a parameter, which has single precision."""


class LinkError(Exception):
    """Error if an autopilot's program does not respond, has ended, or violates the
    protocol.
    """


@positional
class BaseGoal:
    """Set point of the base: position (m), velocity (m/s), acceleration (m/s^2) in
    world axes, yaw (rad).
    """

    position: Numbers
    velocity: Numbers
    acceleration: Numbers
    yaw: float


@positional
class SensedInstant:
    """Sensor readings and true state at one instant, as an autopilot's link receives
    them.

    Attributes:
        time: since the link was made, s.
        readings: numbers of each sensor by name, of which the first is the time of the
            reading.
        state: numbers of the true state, in the order of
            :class:`skyarm.dynamics.State`: only for a program that makes its own sensor
            readings from the state, as ArduPilot does.
    """

    time: float
    readings: Mapping[str, Numbers]
    state: Numbers


class SimulatorLink(ABC):
    """Connection to an autopilot's running program, from its start to its end."""

    following: bool = False
    """True once the vehicle is in the air and tracks the set points."""

    @abstractmethod
    def exchange(self, now: SensedInstant, goal: BaseGoal) -> Numbers:
        """Send sensor readings and a set point to the autopilot; return the rotor
        signals (0 to 1) that it answers.

        Raises:
            LinkError: silence, a connection that ended, what the protocol does not
                allow.
        """

    released: bool = False
    """True once the autopilot holds its position by itself and accepts external set
    points."""

    def release(self) -> None:
        """Hand control of the autopilot over to an external program; may be called
        again until that is done.

        Raises:
            LinkError: the link cannot.
        """
        raise LinkError(
            "this autopilot's link does not leave the set points to a program outside"
        )

    @abstractmethod
    def close(self) -> None:
        """End the program and free its ports; a second call does nothing."""

    @property
    def facts(self) -> dict[str, Plain]:
        """Statistics of the exchange with the autopilot so far, such as counts of
        messages, for the log.
        """
        return {}


@immutable
class Autopilot(ABC):
    """Base class of autopilot settings: path of the program, parameters, and take-off.

    Attributes:
        program: path of the program; empty for that of the environment variable
            ``variable``. No file gives it: one that is read back has none.
        parameters: names and values in place of those that follow from the vehicle.
        climb: height of the flight's start above the stand from which the vehicle takes
            off.
        patience: longest silence of the program.
        preparation: longest time from power-on to hover at the flight's start,
            simulated.
        transcript: file that the exchanged bytes are written to; empty for none, as in
            a log that is flown again.
        replayed: file of an earlier transcript that answers in the program's place;
            empty for the program.
        outside: the flight is real time, the autopilot holds the start, and a program
            outside commands base and arm.
    """

    # log and files name no program of this machine, so that they fly elsewhere
    program: str = field(default="", metadata={"restored": False})
    parameters: tuple[tuple[str, float], ...] = ()
    climb: Annotated[
        float,
        Unit(
            "m",
            "height of the hover above the launch stand, in which a flight begins",
            low=0.2,
            high=100.0,
        ),
    ] = 0.5
    patience: Patience = 20.0
    preparation: Preparation = 120.0
    transcript: str = field(default="", metadata={"restored": False})
    replayed: str = ""
    outside: bool = False

    name: ClassVar[str]
    title: ClassVar[str]
    variable: ClassVar[str]
    least_rate: ClassVar[int]
    """Least rate (Hz) of sensor messages."""
    longest_name: ClassVar[int] = 16
    """Largest number of characters of a parameter's name."""

    @abstractmethod
    def sensors(self, vehicle: Vehicle) -> Mapping[str, Sensor]:
        """Sensors that the autopilot reads, by name; those missing in a scenario are
        added.
        """

    def outside_options(self, vehicle: Vehicle) -> str:
        """Command-line options that ``skyarm fly`` needs for a vehicle under this
        autopilot; empty if none.
        """
        return ""

    @property
    def outside_ports(self) -> tuple[int, int]:
        """UDP ports for an external program: the autopilot's MAVLink port and the joint
        port.

        Raises:
            ScenarioError: the autopilot takes no set points from outside.
        """
        raise ScenarioError(
            f"controller.outside: must be left out for {self.title}, whose link keeps"
            " the set points"
        )

    @abstractmethod
    def connect(self, scenario: Scenario, tape: Tape) -> SimulatorLink:
        """Start the autopilot's program and connect to it.

        Args:
            scenario: scenario to fly, with the sensors and the control rate of the
                link.
            tape: records what is exchanged, or plays it back in the program's place.

        Raises:
            ScenarioError: no program, or a vehicle that the autopilot cannot fly.
            LinkError: a program that does not start.
        """


@immutable
class AutopilotParameters:
    """Parameters of the joint control law that runs next to an autopilot, and the
    autopilot's settings.
    """

    model: Model
    mixer: Mixer
    joint_gains: JointGains
    autopilot: Autopilot


def inertial_unit(scenario: Scenario) -> Sensor:
    """Inertial unit that an autopilot reads."""
    return {each.name: each.sensor for each in scenario.agent.sensors}.get(
        "imu", FLIGHT_IMU
    )


def place_parameters(scenario: Scenario, prefix: str) -> dict[str, float]:
    """Parameters with the place of the inertial unit (m; front, right, down), such as
    ``EKF2_IMU_POS_X``; {} at 0.
    """
    place = inertial_unit(scenario).mounted_at
    numbers = zip("XYZ", map(float, to_our_axes(*place)), strict=True)
    return (
        {}
        if at_origin(place)
        else {f"{prefix}{axis}": number for axis, number in numbers}
    )


def move_arm(
    memory: Memory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: AutopilotParameters,
) -> tuple[Memory, Command]:
    """Computed-torque control of the joints while an autopilot flies the base; the
    rotor speeds are zero.

    tau = inverse dynamics of the arm for the joint accelerations of PD and
    feed-forward, on a base with the measured angular rate and specific force. The
    base's angular acceleration is taken as zero.

    Source: Siciliano, Sciavicco, Villani, Oriolo 2009, Robotics, section 8.5.2, on a
    base that moves.
    """
    vehicle = par.model.vehicle
    feedback = joint_pd(par.joint_gains, measurement, reference)
    desired = sums(feedback, reference.joint_accelerations)
    base = Motion(ZERO3, measurement.specific_force)
    torques = dynamics.inverse_dynamics(
        vehicle,
        measurement.joints,
        measurement.rate,
        measurement.joint_rates,
        base,
        desired,
    )[1]
    # the base is flown by the autopilot: the plant ignores these speeds
    return memory, Command(
        rotor_speeds=(0.0,) * len(vehicle.rotors), efforts=limit_efforts(par, torques)
    )


def controller_with(
    autopilot: Autopilot, model: Model, joint_gains: JointGains | None
) -> Controller:
    """Controller of a vehicle whose base an autopilot flies and whose joints follow
    their references.

    Raises:
        ControllerError: tilting rotors, or rotors without a highest speed.
    """
    if model.vehicle.tilts:
        raise ControllerError(
            f"autopilot = {autopilot.name!r}: must fly a vehicle whose rotors do not"
            " tilt"
        )
    endless = [
        rotor.name
        for rotor in model.vehicle.rotors
        if not float(rotor.max_speed) < float("inf")
    ]
    if endless:
        raise ControllerError(
            f"autopilot = {autopilot.name!r}: rotor {endless[0]!r} must have a"
            " max_speed, that of a full signal"
        )
    gains = joint_gains if joint_gains is not None else default_joint_gains(model)
    par = AutopilotParameters(
        model=model,
        joint_gains=gains,
        mixer=fitting_mixer(model, "clip"),
        autopilot=autopilot,
    )
    return Controller(name=autopilot.name, law=move_arm, par=par)


@positional
class AutopilotMaker:
    """Factory of controllers for vehicles whose base an autopilot flies.

    Its options are the fields of the autopilot's record, and the joint law's gains.

    Attributes:
        kind: class of the record.
    """

    kind: type[Autopilot]

    @property
    def __signature__(self) -> Signature:
        """Call signature of the factory: an option per field of the autopilot's
        settings, and the joint gains.
        """
        usual = {each.name: each.default for each in fields(self.kind)} | {
            "joint_gains": None
        }
        options = [
            Parameter(name, Parameter.KEYWORD_ONLY, default=value)
            for name, value in usual.items()
        ]
        return Signature(
            [Parameter("model", Parameter.POSITIONAL_OR_KEYWORD), *options]
        )

    def __call__(
        self, model: Model, *, joint_gains: JointGains | None = None, **options: Any
    ) -> Controller:
        """Make the controller for a nominal model of the vehicle.

        Raises:
            ControllerError: a wrong parameter, tilting rotors, or rotors without a
                highest speed.
        """
        if "parameters" in options:
            options["parameters"] = plain_parameters(
                options["parameters"], self.kind.longest_name
            )
        for each in fields(self.kind):
            # a file may state a whole number
            if isinstance(each.default, float) and type(options.get(each.name)) is int:
                options[each.name] = float(options[each.name])
        return controller_with(self.kind(**options), model, joint_gains)


def require_rotors(vehicle: Vehicle, model: Vehicle, title: str) -> None:
    """Raise an error if the plant's rotors tilt, lack a maximum speed, or differ in
    number from the model's.

    Raises:
        ScenarioError: rotors that tilt, that have no highest speed, or another number
            of them than the model has.
    """
    if vehicle.tilts:
        raise ScenarioError(f"plant.vehicle: must have no rotors that tilt for {title}")
    if len(vehicle.rotors) != len(model.rotors):
        raise ScenarioError(
            f"plant.vehicle: {len(vehicle.rotors)} rotors: must be {len(model.rotors)},"
            " as of the model"
        )
    for rotor in vehicle.rotors:
        if not float(rotor.max_speed) < float("inf"):
            raise ScenarioError(
                f"plant.vehicle: rotor {rotor.name!r} must have a max_speed, that of a"
                " full signal"
            )


def plain_parameters(value: object, longest: int = 16) -> tuple[tuple[str, float], ...]:
    """Check a mapping from autopilot parameter (at most ``longest`` letters) to number;
    return its items.

    Raises:
        ControllerError: a name that is no parameter's, or a value that is no number.
    """
    if value is None:
        return ()
    if not isinstance(value, Mapping):
        raise ControllerError(
            f"controller.parameters = {shown(value)}: must be a table of names and"
            " numbers"
        )
    for name, number in value.items():
        if not (
            isinstance(name, str)
            and name.isascii()
            and name.replace("_", "").isalnum()
            and len(name) <= longest
        ):
            raise ControllerError(
                f"controller.parameters: {shown(name)} must be a name of at most"
                f" {longest} letters"
            )
        if (
            # True and False are ints of Python, but no numbers of a parameter
            isinstance(number, bool)
            or not isinstance(number, (int, float))
            or not abs(number) <= LARGEST
        ):
            raise ControllerError(
                f"controller.parameters.{name} = {shown(number)}: must be a number up"
                f" to {LARGEST:g}"
            )
    return tuple((name, number) for name, number in value.items())
