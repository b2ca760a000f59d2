"""Interface of a plant: states, commands and environment inputs as flat sequences of
numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Protocol

from skyarm.algebra import Scalar
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.state import State
from skyarm.records import coerce
from skyarm.records.field_rules import checked, rules
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import leaves
from skyarm.records.path_names import Names, field_paths
from skyarm.records.registry import find
from skyarm.records.units import nonnegative
from skyarm.vehicle import Vehicle, VehicleError
from skyarm.vehicle.linkage import JOINT_NUMBERS, Body

Flat = Sequence[float]
"""Leaves of a record (:func:`skyarm.records.leaves.leaves`): State, Command or
Surroundings."""


@immutable
@checked("plant", VehicleError)
class Truth:
    """True vehicle and gravity (m/s^2) of the simulation, as opposed to the
    controller's model.

    Attributes:
        loads: link and body of each payload of the plant, for force sensors; its mass
            is in the vehicle's body, too.
    """

    vehicle: Vehicle
    gravity: Annotated[
        Scalar,
        nonnegative(
            "m/s^2",
            "true gravitational acceleration, downwards",
            rule=coerce.number,
            usual=25.0,
        ),
    ] = 9.81
    loads: tuple[tuple[int, Body], ...] = field_if_any(default=())

    def number_of_view(self, name: str) -> float:
        """Current value (kg) of the point mass that a parameter path adds at a frame:
        always zero.
        """
        return 0.0

    def with_views(self, values: Mapping[str, Scalar]) -> Truth:
        """Plant with payloads (kg) added at the frames of given names."""
        loads = [
            (mass, frame)
            for frame, mass in values.items()
            # 0 kg adds nothing, but a symbol may be any mass
            if not coerce.concrete(mass) or mass
        ]
        added = [self.vehicle.point_mass(mass, frame) for mass, frame in loads]
        return replace(
            self, vehicle=self.vehicle.with_views(values), loads=(*self.loads, *added)
        )

    def path_names(self) -> Names:
        """Parameter paths of the true vehicle and gravity, added loads, all joints at
        once, and joint drives.
        """
        vehicle = self.vehicle
        paths = field_paths(self) | {"payload": vehicle.load_names(())}
        # masses are replaced by the names of frames, not by the order of loads
        del paths["loads"]
        paths["joints"] = {
            name: tuple(
                ("vehicle", "links", str(i), "joint", name) for i in range(vehicle.n)
            )
            for name in JOINT_NUMBERS
            if vehicle.n
        }
        if vehicle.drives:
            drives = enumerate(vehicle.drives)
            paths["drives"] = {
                each.name: (("vehicle", "drives", str(i), "drive"),)
                for i, each in drives
            }
        return paths


def require_gravity(value: object, field: str) -> float:
    """Convert gravity (m/s^2) to a float; raise an error if the value is outside the
    allowed bounds.

    Raises:
        RecordError: one line with field, value and what is allowed.
    """
    return float(rules(Truth)["gravity"](field, value))


class Plant(Protocol):
    """Interface of a simulated vehicle, whose state is an argument and a result of its
    methods, not stored in it.
    """

    vehicle: Vehicle

    def advance(
        self, state: Flat, command: Flat, around: Flat, seconds: float
    ) -> tuple[float, ...]:
        """Vehicle state, then contact states, after ``seconds`` with constant command
        and environment inputs.

        Behind its numbers stand those of the coupled memories
        (:mod:`skyarm.plant.surroundings`), if there are any.
        """
        ...

    def specific_force(
        self, state: Flat, command: Flat, around: Flat
    ) -> tuple[float, ...]:
        """Reading of an ideal accelerometer at the base origin, base axes, m/s^2: three
        numbers a vehicle.
        """
        ...

    def angular_acceleration(
        self, state: Flat, command: Flat, around: Flat
    ) -> tuple[float, ...]:
        """Angular acceleration of each base, base axes, rad/s^2: three numbers a
        vehicle.

        Asked only where a sensor is beside the base origin.
        """
        ...


def flat(state: State) -> tuple[float, ...]:
    """Scalars of a vehicle state as a flat sequence, in the order that plants use."""
    return tuple(map(float, leaves(state)))


def whole_steps(seconds: float, physics_step: float) -> int:
    """Number of physics steps in ``seconds``; raises ValueError unless the number is
    whole.
    """
    ratio = seconds / physics_step
    count = round(ratio)
    # decimal fractions such as 0.005 / 0.001 are whole up to rounding only
    if count < 1 or abs(ratio - count) > 1e-6:
        raise ValueError(
            f"seconds = {seconds!r}: must be a whole number of physics steps of"
            f" {physics_step!r} s"
        )
    return count


def make_plant(scenario: Any, around: Any) -> Plant:
    """Make the plant of a scenario, such as rigid body or MuJoCo.

    A class whose ``several`` is true is given the true vehicles of all agents and their
    surroundings together; another one those of the only agent.

    Raises:
        ValueError: one line: there are several agents, and the plant is of one.
    """
    kind = find("plant", scenario.kind, "plant.kind")
    # a user-defined plant without the attribute simulates one vehicle
    if getattr(kind, "several", False):
        world = tuple(each.plant for each in scenario.agents.values())
    elif scenario.is_team:
        # such a plant takes one state, so it cannot be given several
        raise ValueError(
            f"plant.kind = {scenario.kind!r}: flies one agent, not"
            f" {', '.join(scenario.agents)}"
        )
    else:
        world = scenario.agent.plant
        around = around.of(0)
    plant: Plant = kind(
        world, around, scenario.integrator, 1.0 / scenario.rates.physics
    )
    return plant


def example_command(joints: int, rotors: int, tilts: int = 0) -> Command:
    """Command of zeros for tracing, with given numbers of rotors, joints and tilt
    angles.
    """
    return Command(
        rotor_speeds=(0.0,) * rotors, efforts=(0.0,) * joints, tilts=(0.0,) * tilts
    )
