"""The closed loop as one pure function of a control period, for engines that step many episodes in native code.

The same order as :func:`skyarm.simulate.loop.run`: check the state, read the sensors, run the law, count the metrics,
let the commands that have arrived act for one period. An episode that has ended keeps the state it ended in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import ZERO3, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.compile.repeat import repeat
from skyarm.dynamics import State, frame_pose
from skyarm.dynamics.measurement import Measurement
from skyarm.environment import Airspeed, DrydenMemory, WindSample, afflicted, dryden, wind
from skyarm.plant.rigid_body import STEP, accelerate
from skyarm.plant.sensors import measure, noise_count
from skyarm.reference import Reference
from skyarm.scalars import Scalar, absolute, logical_and, where
from skyarm.scalars.philox import normal_pair
from skyarm.simulate.monitor import FAR, LOST, lowest_point
from skyarm.simulate.scenario import Scenario
from skyarm.simulate.totals import Instant, Totals, Windows, counted, distance, joint_norm, roll_and_pitch

CHANNEL_SENSORS, CHANNEL_TURBULENCE = 0, 1


@dataclass(frozen=True, kw_only=True, slots=True)
class Carry:
    """What one control period hands to the next.

    Attributes:
        alive: 1 while the episode runs, 0 once it has ended. ticks: control periods flown.
        state: of the plant. memory: of the controller.
        queue: commands on their way, oldest first; the first acts now.
        readings: measurements on their way, oldest first.
        turbulence: of the air, or None.
    """

    alive: Scalar
    ticks: Scalar
    state: State
    memory: Any
    queue: tuple[Command, ...]
    readings: tuple[Measurement, ...]
    turbulence: DrydenMemory | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """What a control instant is fed from outside: its time, the held reference and where that puts a level tool."""

    time: Scalar
    reference: Reference
    tool: Vec3 = ZERO3


@dataclass(frozen=True, kw_only=True, slots=True)
class Sample:
    """What may be logged of a control instant."""

    alive: Scalar
    state: State
    command: Command
    reading: Measurement
    wind: WindSample


Period = Callable[[Carry, Row, tuple[Any, ...]], tuple[Carry, Sample]]


def draws_needed(scenario: Scenario) -> tuple[tuple[int, int], ...]:
    """(channel, count) of the uniform numbers a period takes; counts are even, normals come in pairs."""
    vehicle = scenario.world.vehicle
    found = []
    if leaves(scenario.sensors):
        count = noise_count(vehicle.n, len(vehicle.rotors))
        found.append((CHANNEL_SENSORS, count + count % 2))
    if isinstance(scenario.wind, Airspeed) and scenario.wind.turbulence is not None:
        found.append((CHANNEL_TURBULENCE, 4))
    return tuple(found)


def _normals(uniforms: tuple[Any, ...]) -> list[Any]:
    numbers: list[Any] = []
    for a, b in zip(uniforms[0::2], uniforms[1::2], strict=True):
        numbers += normal_pair(a, b)
    return numbers


def blend(condition: Any, new: Any, old: Any) -> Any:
    """``new`` where the condition holds, else ``old``, leaf by leaf; structure is the old record's."""
    values = (where(condition, a, b) for a, b in zip(leaves(new), leaves(old), strict=True))
    return rebuild(old, values)


def healthy(scenario: Scenario, state: State, goal: Vec3) -> Any:
    """True while no ending of :class:`skyarm.simulate.monitor.Monitor` has come; NaN compares false."""
    # any comparison with NaN is false, so that a state that is not finite is not healthy
    fine = absolute(state.quaternion.w) < 2.0
    for value in list(state.quaternion)[1:]:
        fine = logical_and(fine, absolute(value) < 2.0)
    for value in (*state.velocity, *state.rate, *state.joints, *state.joint_rates, *state.rotor_speeds):
        fine = logical_and(fine, absolute(value) < FAR)
    for value, wanted in zip(state.position, goal, strict=True):
        fine = logical_and(fine, absolute(value - wanted) < LOST)
    for value, link in zip(state.joints, scenario.world.vehicle.links, strict=True):
        fine = logical_and(fine, logical_and(link.joint.lower <= value, value <= link.joint.upper))
    if scenario.controller.margin is not None:
        fine = logical_and(fine, scenario.controller.margin(state.quaternion) >= 0.0)
    if scenario.ground:
        fine = logical_and(fine, lowest_point(scenario.world.vehicle, state) >= 0.0)
    return fine


def make_period(scenario: Scenario, substeps: Callable[[float], int]) -> Period:
    """The function of one control period of a scenario, whose numbers may be traced.

    Args:
        scenario: plant "rigid_body"; structure (delays, rates, integrator) must be concrete.
        substeps: integration steps that an interval is cut into.
    """
    rates, controller = scenario.rates, scenario.controller
    period = 1.0 / rates.control
    late = round(scenario.delays.command * rates.physics) % (rates.physics // rates.control) / rates.physics
    turbulence = scenario.wind.turbulence if isinstance(scenario.wind, Airspeed) else None
    sensor_draws = dict(draws_needed(scenario)).get(CHANNEL_SENSORS, 0)

    def advance(state: State, command: Command, air: WindSample, seconds: float) -> State:
        count = substeps(seconds)
        return repeat(
            count, lambda x: STEP[scenario.integrator](scenario.world, x, command, air, seconds / count), state
        )

    def step(carry: Carry, row: Row, uniforms: tuple[Any, ...]) -> tuple[Carry, Sample]:
        state = carry.state
        alive = logical_and(carry.alive > 0.5, healthy(scenario, state, row.reference.position))
        gusts, moved = ZERO3, carry.turbulence
        if turbulence is not None and carry.turbulence is not None:
            numbers = _normals(uniforms[sensor_draws:])
            moved, gusts = dryden.step(carry.turbulence, Vec3(*numbers[:3]), period, par=turbulence)
        air = afflicted(wind(scenario.wind, row.time, gusts), scenario.faults, scenario.world.vehicle, row.time)
        force, _ = accelerate(scenario.world, state, state.rotor_speeds, carry.queue[0].efforts, air)
        n, rotors = len(state.joints), len(state.rotor_speeds)
        draws = _normals(uniforms[:sensor_draws]) if sensor_draws else [0] * (noise_count(n, rotors))
        now = measure(scenario.sensors, row.time, state, force.linear, draws[: noise_count(n, rotors)])
        # until the first measurement has arrived the law sees that one
        seen = (*(blend(carry.ticks < 0.5, now, reading) for reading in carry.readings), now)
        memory, command = controller.law(carry.memory, seen[0], row.reference, period, par=controller.par)
        for value in (*command.rotor_speeds, *command.efforts):
            alive = logical_and(alive, absolute(value) < float("inf"))
        queue = (*carry.queue[1:], command)
        following_state = state
        if late:
            following_state = advance(following_state, carry.queue[0], air, late)
        following_state = advance(following_state, queue[0], air, period - late)
        following = Carry(
            alive=where(alive, 1.0, 0.0),
            ticks=carry.ticks + where(alive, 1.0, 0.0),
            state=following_state,
            memory=memory,
            queue=queue,
            readings=seen[1:],
            turbulence=moved,
        )
        frozen = blend(alive, following, _ended(carry))
        return frozen, Sample(alive=where(alive, 1.0, 0.0), state=state, command=command, reading=now, wind=air)

    return step


def make_counting_period(
    scenario: Scenario, substeps: Callable[[float], int], windows: Windows
) -> Callable[[tuple[Carry, Totals], Row, tuple[Any, ...]], tuple[tuple[Carry, Totals], Sample]]:
    """The function of one control period that also counts the metrics of a living episode."""
    period = make_period(scenario, substeps)
    vehicle = scenario.world.vehicle
    frame = vehicle.frame(vehicle.end_effector) if vehicle.end_effector else None

    def step(both: tuple[Carry, Totals], row: Row, uniforms: tuple[Any, ...]) -> tuple[tuple[Carry, Totals], Sample]:
        carry, totals = both
        following, sample = period(carry, row, uniforms)
        state, wanted = sample.state, row.reference
        tool = state.position
        if frame is not None:
            tool = tool + state.quaternion.rotation().apply(frame_pose(vehicle, frame, state.joints).p)
        roll, pitch = roll_and_pitch(state.quaternion)
        now = Instant(
            position=distance(state.position, wanted.position),
            joint=joint_norm(state.joints, wanted.joints),
            tool=distance(tool, row.tool),
            roll=roll,
            pitch=pitch,
            efforts=sample.command.efforts,
        )
        alive = sample.alive > 0.5
        return (following, blend(alive, counted(totals, now, row.time, windows), totals)), sample

    return step


def _ended(carry: Carry) -> Carry:
    """The carry of an episode that has ended: as it was, not alive."""
    values = {field.name: getattr(carry, field.name) for field in fields(carry)}
    return Carry(**{**values, "alive": 0.0})


def structure_of(record: Any) -> Any:
    """An example of a record: every scalar 0.0, structure kept."""
    if is_dataclass(record) or isinstance(record, tuple):
        return rebuild(record, iter([0.0] * len(leaves(record))))
    return record
