"""The closed loop as one pure function of a control period, for engines that step many episodes in native code.

The same order as :func:`skyarm.simulate.loop.run`: check the state, read the sensors, run the law, count the metrics,
let the commands that have arrived act for one period. An episode that has ended keeps the state it ended in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import ZERO3, Vec3
from skyarm.compile.repeat import repeat
from skyarm.dynamics import State, frame_pose
from skyarm.environment import Airspeed, WindSample, afflicted, dryden, wind
from skyarm.plant.interface import number
from skyarm.plant.rigid_body import STEP, accelerate
from skyarm.plant.sensors import measure, noise_count
from skyarm.reference import Reference
from skyarm.scalars import absolute, cos, floor, logical_and, maximum, sin, where
from skyarm.simulate.carry import Carry, Row, Sample, blend, ended
from skyarm.simulate.draws import CHANNEL_SENSORS, draws_needed, normals
from skyarm.simulate.monitor import FAR, LONG, LOST, lowest_point
from skyarm.simulate.scenario import Scenario
from skyarm.simulate.totals import Goal, Instant, Total, counted
from skyarm.vehicle.records import Vehicle

Period = Callable[[Carry, Row, tuple[Any, ...]], tuple[Carry, Sample]]


def healthy(scenario: Scenario, state: State, goal: Vec3) -> Any:
    """True while no ending of :class:`skyarm.simulate.monitor.Monitor` has come; NaN compares false."""
    # any comparison with NaN is false, so that a state that is not finite is not healthy
    fine = absolute(state.quaternion.w) < LONG
    for value in list(state.quaternion)[1:]:
        fine = logical_and(fine, absolute(value) < LONG)
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
        scenario: plant "rigid_body"; structure must be concrete: rates, integrator, delays but for
            a varied one of the commands.
        substeps: integration steps that an interval is cut into.
    """
    rates, controller = scenario.rates, scenario.controller
    period = 1.0 / rates.control
    whole, late = _command_delay(scenario)
    turbulence = scenario.wind.turbulence if isinstance(scenario.wind, Airspeed) else None
    sensor_draws = dict(draws_needed(scenario)).get(CHANNEL_SENSORS, 0)

    def advance(state: State, command: Command, air: WindSample, seconds: Any) -> State:
        count = substeps(seconds if type(seconds) is float else period)
        return repeat(
            count, lambda x: STEP[scenario.integrator](scenario.world, x, command, air, seconds / count), state
        )

    def step(carry: Carry, row: Row, uniforms: tuple[Any, ...]) -> tuple[Carry, Sample]:
        state = carry.state
        alive = logical_and(carry.alive > 0.5, healthy(scenario, state, row.reference.position))
        gusts, moved = ZERO3, carry.turbulence
        if turbulence is not None and carry.turbulence is not None:
            numbers = normals(uniforms[sensor_draws:])
            moved, gusts = dryden.step(carry.turbulence, Vec3(*numbers[:3]), period, par=turbulence)
        air = afflicted(wind(scenario.wind, row.time, gusts), scenario.faults, scenario.world.vehicle, row.time)
        old = _issued(carry.queue, whole)
        force, _ = accelerate(scenario.world, state, state.rotor_speeds, old.efforts, air)
        n, rotors = len(state.joints), len(state.rotor_speeds)
        draws = normals(uniforms[:sensor_draws]) if sensor_draws else [0] * (noise_count(n, rotors))
        # where nothing pushes the reading is a structural zero
        proper = Vec3(*(number(c) for c in force.linear))
        now = measure(scenario.sensors, row.time, state, proper, draws[: noise_count(n, rotors)])
        # until the first measurement has arrived the law sees that one
        seen = (*(blend(carry.ticks < 0.5, now, reading) for reading in carry.readings), now)
        memory, command = controller.law(carry.memory, seen[0], row.reference, period, par=controller.par)
        for value in (*command.rotor_speeds, *command.efforts):
            alive = logical_and(alive, absolute(value) < float("inf"))
        queue = (*carry.queue[1:], command)
        following_state = state
        if type(late) is not float:
            following_state = blend(late > 0.0, advance(following_state, old, air, late), following_state)
        elif late:
            following_state = advance(following_state, old, air, late)
        following_state = advance(following_state, _issued(queue, whole), air, period - late)
        following = Carry(
            alive=where(alive, 1.0, 0.0),
            ticks=carry.ticks + where(alive, 1.0, 0.0),
            state=following_state,
            memory=memory,
            queue=queue,
            readings=seen[1:],
            turbulence=moved,
        )
        frozen = blend(alive, following, ended(carry))
        return frozen, Sample(alive=where(alive, 1.0, 0.0), state=state, command=command, reading=now, wind=air)

    return step


def commands_waiting(scenario: Scenario) -> int:
    """How many commands the loop remembers from before the one that it issues."""
    rates, delays = scenario.rates, scenario.delays
    if delays.longest_command is not None:
        return math.ceil(delays.longest_command * rates.control - 1e-9) + 1
    return round(float(delays.command) * rates.physics) // (rates.physics // rates.control) + 1


def _command_delay(scenario: Scenario) -> tuple[Any, Any]:
    """Delay of the commands as whole control periods, None if the queue is just that long, and the rest, s."""
    rates, delay = scenario.rates, scenario.delays.command
    if scenario.delays.longest_command is None:
        return None, round(delay * rates.physics) % (rates.physics // rates.control) / rates.physics
    # a delay that is a multiple of the period up to rounding is one
    whole = floor(delay * float(rates.control) + 1e-9)
    return whole, maximum(delay - whole / float(rates.control), 0.0)


def _issued(queue: tuple[Command, ...], whole: Any) -> Command:
    """The command at the end of a queue's delay: its oldest, or the one before the last ``whole``."""
    if whole is None:
        return queue[0]
    found = queue[-1]
    for age, command in enumerate(queue[-2::-1], start=1):
        found = blend(whole < age - 0.5, found, command)
    return found


def make_counting_period(
    scenario: Scenario, substeps: Callable[[float], int], wanted: Sequence[Total]
) -> Callable[..., tuple[tuple[Carry, tuple[Any, ...]], Sample]]:
    """The function of one control period that also counts totals of a living episode.

    It takes (carry, totals), the row, the held and the continuous goal, the windows the instant lies in (name ->
    condition), and the uniform numbers.
    """
    period = make_period(scenario, substeps)
    vehicle = scenario.world.vehicle

    def step(
        both: tuple[Carry, tuple[Any, ...]],
        row: Row,
        goals: tuple[Goal, Goal],
        inside: Mapping[str, Any],
        uniforms: tuple[Any, ...],
    ) -> tuple[tuple[Carry, tuple[Any, ...]], Sample]:
        carry, totals = both
        following, sample = period(carry, row, uniforms)
        state, command = sample.state, sample.command
        first = carry.ticks < 0.5
        pairs = zip(command.rotor_speeds, carry.queue[-1].rotor_speeds, strict=True)
        now = Instant(
            state=state,
            tool=tool_of(vehicle, state),
            command=command,
            before=tuple(where(first, new, old) for new, old in pairs),
            held=goals[0],
            continuous=goals[1],
        )
        alive = sample.alive > 0.5
        counts = {name: alive if within is True else logical_and(alive, within) for name, within in inside.items()}
        return (following, counted(totals, wanted, now, counts)), sample

    return step


def tool_of(vehicle: Vehicle, state: State) -> Vec3:
    """World position of the end effector; of the base origin if the vehicle has none."""
    if not vehicle.end_effector:
        return state.position
    held = frame_pose(vehicle, vehicle.frame(vehicle.end_effector), state.joints).p
    return state.position + state.quaternion.rotation().apply(held)


def goal_of(vehicle: Vehicle, reference: Reference) -> Goal:
    """What a reference wants; its tool is that of the level vehicle, p_d + R_z(psi_d) p_e(th_d)."""
    tool = reference.position
    if vehicle.end_effector:
        held = frame_pose(vehicle, vehicle.frame(vehicle.end_effector), reference.joints).p
        c, s = cos(reference.yaw), sin(reference.yaw)
        tool = tool + Vec3(c * held.x - s * held.y, s * held.x + c * held.y, held.z)
    return Goal(position=reference.position, joints=reference.joints, tool=tool)
