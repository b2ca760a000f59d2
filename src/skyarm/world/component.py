"""Interface of environment components (winds, forces, contacts): frozen dataclasses
with pure functions.

A component is written once, in traceable functions: the same lines fly as Python
floats, in machine code, in a batch whose lanes have other numbers, and on MuJoCo's
plant. Its clock:

* ``advance`` steps its memory once per control period, with the state at the period's
  beginning;
* ``velocity`` and ``wrenches`` are evaluated at every stage of the integrator, with
  that memory and the period's time held. They must not keep anything;
* of a *coupled* component the memory is a part of the plant's state: ``slope`` says how
  it changes, and every plant integrates it together with the vehicle.

Random numbers are uniform in (0, 1) and keyed by seed, episode, component and period:
adding a component changes no other's draws.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Generic, NamedTuple, Self, TypeVar, cast

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add, divide, maximum, mul
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import checked
from skyarm.records.files import errors_as, shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, leaves, rebuild
from skyarm.records.units import Unit
from skyarm.vehicle import BASE, Rotor, Vehicle, VehicleError

if TYPE_CHECKING:
    from skyarm.world.scene.scene import Instants, Scene

Value = TypeVar("Value")
"""Type of the values of log columns: numbers, or what describes a column."""

MOST_STEPS = 1000
"""Largest number of integration steps per control period; a model that needs more is
probably in other units."""

MOST_UNIFORMS = 10_000
"""Largest number of random numbers of one component per period; a program with more
takes minutes to compile."""


@immutable
@checked("wrench", often=True)
class Wrench:
    """Force and torque on one body of a vehicle.

    Attributes:
        body: index into ``Vehicle.moving`` (links, then followers), or ``BASE``.
        agent: name of the vehicle; empty for the one whose motion the model was given.
        acts: 0 where force and torque are zero, so that machine code may skip what
            follows from them; else 1.
    """

    force_W: Annotated[Vec3, Unit("N", "force, world axes")] = ZERO3
    torque_W: Annotated[Vec3, Unit("N m", "torque, world axes")] = ZERO3
    point: Annotated[
        Vec3, Unit("m", "point at which the force acts, axes of its body")
    ] = ZERO3
    body: int = BASE
    agent: str = ""
    acts: Scalar = 1


Memory = TypeVar("Memory", bound=Tree)
"""Type of a component's internal state; its time derivative has the same type."""

NoMemory = tuple[()]
"""Internal state of a component that has none."""


def moved_by(memory: Memory, slope: Memory, dt: Scalar) -> Memory:
    """Internal state after an explicit Euler step: each number plus ``dt`` times its
    time derivative.
    """
    pairs = zip(leaves(memory), leaves(slope), strict=True)
    return rebuild(memory, iter([add(value, mul(rate, dt)) for value, rate in pairs]))


def shorten(vector: Vec3, most: Scalar) -> Vec3:
    """Vector scaled down to a given length if it is longer; zero for a length of
    zero.
    """
    # the square added: the slope of a root is infinite at zero
    return vector * divide(most, maximum(vector.smooth_norm(), most))


def require_frame(vehicle: Vehicle, frame: str) -> None:
    """Refuse the name of a frame that the vehicle lacks; an empty name refers to the
    vehicle's tip.

    Raises:
        RecordError: one line.
    """
    with errors_as(RecordError, f"frame = {shown(frame)}: ", VehicleError):
        vehicle.frame(frame or None)


class Column(NamedTuple):
    """Column of a log: array, label, unit and meaning."""

    array: str
    label: str
    unit: str = ""
    meaning: str = ""


Event = tuple[str, float, float]
"""Event to mark in pictures of a flight: text, start (s) and stop (s)."""


class StepLimits(Generic[Memory]):
    """Base class of environment models: how long their integration steps may be, and
    when longer ones are stable.

    An interval is *far* from contact, *calm* while grasps alone act, *near* contact, or
    one in which something *hits*: each has its steps, from the longest to the shortest.
    """

    __slots__ = ()

    largest_step: Scalar | None = None
    """Longest stable integration step (s) of the environment model; None for no limit.
    May be a field or a property."""

    @property
    def largest_euler_step(self) -> Scalar | None:
        """Longest stable integration step (s) of the model under semi-implicit Euler;
        None for no limit.
        """
        return self.largest_step

    @property
    def largest_verlet_step(self) -> Scalar | None:
        """Longest stable integration step (s) of the model under Stoermer-Verlet; None
        excludes that method.

        None keeps the plant's own method.
        """
        return None

    def far(self, memory: Memory, motion: PointMotion, seconds: Scalar) -> Scalar:
        """True if the model, such as a distant contact, certainly exerts no force for
        the next ``seconds``.
        """
        return False

    largest_calm_step: Scalar | None = None
    """Longest stable integration step (s) while ``calm`` holds, if that is longer; None
    if not."""

    largest_calm_verlet_step: Scalar | None = None
    """The same of the Stoermer-Verlet method."""

    def calm(self, memory: Memory, motion: PointMotion, seconds: Scalar) -> Scalar:
        """True if nothing that needs short steps, such as a contact, acts for the next
        ``seconds``.
        """
        return False

    most_hit_steps: int = 1
    """Largest number of substeps per integration step that ``hurry`` may return; may be
    a property."""

    def hurry(
        self, memory: Memory, motion: PointMotion, seconds: Scalar
    ) -> tuple[Memory, Scalar]:
        """Internal state of the model, and number of substeps for the next ``seconds``:
        more during an impact.
        """
        return memory, 1.0

    def near(self, memory: Memory) -> Memory:
        """Internal state of a model such as a contact before an integration step in
        which it may exert a force.
        """
        return memory

    def alone(
        self, memory: Memory, seconds: Scalar, rounds: int, gravity: Scalar
    ) -> Memory:
        """Internal state of a model such as a contact after ``seconds`` in which it
        exerted no force.

        Args:
            memory: internal state before.
            seconds: s.
            rounds: number of parts of the time, each as short as the component needs.
            gravity: m/s^2, along -z.
        """
        return memory


class Component(StepLimits[Memory]):
    """Base class of environment models (wind, force, contact), whose subclasses
    override the methods that they need.

    ``Component[M]`` has internal states of the type ``M``: a dataclass or tuple of
    scalars.
    """

    __slots__ = ()

    rigid: bool = False
    """True for a rigid load on a body of the vehicle, part of the plant's inertia; it
    then has ``body``."""

    @property
    def uniforms(self) -> int:
        """Number of uniform random numbers that the environment model draws per control
        period.
        """
        return 0

    def require_vehicle(self, vehicle: Vehicle, period: float, gravity: Scalar) -> None:
        """Refuse a vehicle, control period (s) or gravity (m/s^2) that is incompatible
        with the environment model.

        Raises:
            ValueError: one line that begins with a field of the component.
        """

    def require_vehicles(
        self, vehicles: Mapping[str, Vehicle], period: float, gravity: Scalar
    ) -> None:
        """Refuse vehicles, by name, that are incompatible with an environment model
        that all of them share.

        Raises:
            ValueError: one line that begins with a field of the component.
        """
        for vehicle in vehicles.values():
            self.require_vehicle(vehicle, period, gravity)

    def of_agent(self, name: str) -> Self:
        """Model that all vehicles share, without what is of others than one vehicle."""
        return self

    def columns_of(self, agent: str) -> Sequence[Column]:
        """Log columns without those of other vehicles than ``agent``."""
        return self.of_agent(agent).columns

    coupled: bool = False
    """True if the internal state is integrated with the vehicle's within control
    periods; may be a property."""

    shared: bool = False
    """True of a model that all vehicles share: it has one internal state, finds each in
    ``motion.agents``, and its wrenches say on which they act. Of another model each
    vehicle has its own, with its own noise."""

    def start(self, period: float, draws: Sequence[Scalar]) -> Memory:
        """Initial internal state of the environment model, a dataclass or tuple of
        scalars; an empty tuple for none.

        Args:
            period: control period of ``advance``, s.
            draws: uniform numbers, twice ``uniforms`` of them.
                :func:`skyarm.algebra.scalars.philox.normals` makes normal ones of them.
        """
        # a model without a memory of its own has the empty one
        return cast("Memory", ())

    def advance(
        self,
        memory: Memory,
        t: Scalar,
        dt: float,
        state: State,
        draws: Sequence[Scalar],
    ) -> Memory:
        """Internal state of the environment model for the control period from ``t`` to
        ``t + dt`` (s).
        """
        return memory

    def supply(
        self, memory: Memory, dt: float, state: State, commands: Sequence[Scalar]
    ) -> Memory:
        """Internal state of a model that depends on the rotor speed commands in force
        (rad/s), such as a battery.

        Args:
            memory: internal state after ``advance``.
            dt: control period, s.
            state: state of the vehicle at its beginning.
            commands: those that were in force before the period's own arrive.
        """
        return memory

    def settle(self, memory: Memory, motion: PointMotion, vehicle: bool) -> Memory:
        """Internal state of the model with its objects, and optionally the vehicle, in
        static equilibrium.
        """
        return memory

    def act(self, memory: Memory, t: Scalar, dt: float, motion: PointMotion) -> Memory:
        """Internal state of the model after discrete events at the start of a control
        period, such as a grasp.

        Args:
            memory: internal state in the period.
            t: s; of a reference whose phases wait for the flight its own time.
            dt: control period, s.
            motion: motion of the vehicle at the instant.
        """
        return memory

    def holds(self, memory: Memory, frame: str, agent: str = "") -> Scalars:
        """Grasp signal of each gripper at a vehicle's frame: 1 while it holds a body,
        else 0; () without any.
        """
        return ()

    def velocity(self, memory: Memory, t: Scalar, position_W: Vec3) -> Vec3:
        """Air velocity at a position, world axes, m/s."""
        return ZERO3

    def wrenches(
        self,
        memory: Memory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Forces and torques of the environment model on the vehicle's bodies at an
        instant.

        Args:
            memory: internal state in the period.
            t: s.
            motion: places and velocities of all points of the vehicle.
            rotor_speeds: rad/s.
        """
        return ()

    def rotor_commands(
        self, memory: Memory, rotors: Sequence[Rotor], commands: Sequence[Scalar]
    ) -> Sequence[Scalar]:
        """Rotor speed commands (rad/s) as limited or scaled by the environment model,
        such as a battery.
        """
        return commands

    def slope(
        self,
        memory: Memory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Memory:
        """Time derivative of the internal state of a model that is integrated with the
        plant, such as a contact.
        """
        raise NotImplementedError(
            f"{type(self).__name__} is coupled and must define slope()"
        )

    def before_euler_step(self, memory: Memory, slope: Memory, dt: Scalar) -> Memory:
        """Internal state of the model from which a semi-implicit Euler step of ``dt``
        (s) evaluates the forces.

        What velocities bend and has no inertia goes on here, by the velocities that the
        last step left.
        """
        return memory

    def euler_step(self, memory: Memory, slope: Memory, dt: Scalar) -> Memory:
        """Internal state of a model such as a contact after a semi-implicit Euler step
        of ``dt`` (s).

        Velocities go before what they move, or springs gain energy; a memory without
        velocities goes on straight.
        """
        return moved_by(memory, slope, dt)

    def drift(self, memory: Memory, dt: Scalar) -> Memory:
        """Internal state of a model such as a contact after ``dt`` (s) without forces:
        only positions change.
        """
        return memory

    def push(
        self,
        memory: Memory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
        dt: Scalar,
        felt: Memory | None = None,
    ) -> Memory:
        """Internal state of a model such as a contact after forces acted for ``dt``
        (s): only velocities change.

        What goes on by its rate alone, and not in ``drift`` nor ``before_euler_step``,
        does so here.

        Args:
            memory: internal state before.
            t: time as in ``slope``.
            motion: motion as in ``slope``.
            rotor_speeds: rad/s.
            dt: s.
            felt: internal state with the velocities at which forces are taken; that
                before if left out.
        """
        return moved_by(
            memory,
            self.slope(memory if felt is None else felt, t, motion, rotor_speeds),
            dt,
        )

    events: tuple[Event, ...] = ()
    """Intervals that pictures of a flight mark; may be a property."""

    columns: tuple[Column, ...] = ()
    """Columns of a log, one for each number of ``logged``, or tuples of their first
    fields; may be a property."""

    @property
    def constants(self) -> Mapping[str, Scalars]:
        """Constants of the environment model that flight metrics need in addition to
        the logged values, by name.
        """
        return {}

    def logged(self, memory: Memory, motion: PointMotion) -> Scalars:
        """Values of the environment model that the flight log records in every control
        period.
        """
        return ()

    def shapes(self, seen: Instants) -> Scene:
        """Shapes, lines and arrows that draw the environment model in pictures and
        films of a flight.

        Args:
            seen: the instants, where the vehicle was, and the logged numbers.
        """
        from skyarm.world.scene.scene import Scene

        return Scene()

    def warnings(self, vehicle: Vehicle, step: float) -> Sequence[str]:
        """Warnings about suspicious or computationally expensive parameters of the
        environment model.

        Args:
            vehicle: vehicle of the plant.
            step: integration step without the component, s.
        """
        return ()


class Air(Component[Memory]):
    """Base class of wind models, which give the air velocity at a position; they exert
    no force themselves.
    """

    __slots__ = ()

    registered_as = "air"


class Force(Component[Memory]):
    """Base class of environment models that exert forces and torques on bodies of the
    vehicle.
    """

    __slots__ = ()

    registered_as = "force"


def by_array(
    components: Sequence[Component[Tree]], numbers: Sequence[Value]
) -> dict[str, list[Value]]:
    """Group the logged values of winds, forces and contacts by the name of the log
    array that each belongs to.
    """
    groups: dict[str, list[Value]] = {}
    for column, number in zip(
        (column for each in components for column in each.columns), numbers, strict=True
    ):
        # a column may be a plain tuple of the first fields
        groups.setdefault(column[0], []).append(number)
    return groups


COLLISIONS = ("collision_force", "collision_place")
"""Log arrays of pairs of bodies, which are of the world and of no single vehicle."""


def columns_of_agent(
    components: Sequence[Component[Tree]], agent: str
) -> dict[str, list[bool]]:
    """For each log array of winds, forces and contacts, False for the columns of
    another vehicle than ``agent``.
    """
    own = [(each, each.columns_of(agent)) for each in components]
    return by_array(
        components,
        [column in theirs for each, theirs in own for column in each.columns],
    )
