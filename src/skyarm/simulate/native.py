"""Episodes on the rigid-body plant as machine code: the closed loop traced, compiled, and stepped for many lanes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import Command
from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import Loop, trace_loop
from skyarm.compile.native import Kernel
from skyarm.dynamics import State
from skyarm.dynamics.measurement import Measurement
from skyarm.environment import Airspeed, DrydenMemory, dryden
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import number
from skyarm.simulate.closed_loop import Carry, Row, Sample, draws_needed, make_period, structure_of
from skyarm.simulate.inputs import EpisodeInputs, first_state, turbulence_start
from skyarm.simulate.scenario import Scenario

Array = npt.NDArray[np.float64]


def first_carry(scenario: Scenario) -> Carry:
    """What the first control period finds."""
    state, rates = first_state(scenario), scenario.rates
    vehicle = scenario.world.vehicle
    efforts = hover_trim(vehicle, state.joints, scenario.world.gravity).efforts
    standing = Command(rotor_speeds=state.rotor_speeds, efforts=tuple(number(effort) for effort in efforts))
    waiting = round(scenario.delays.command * rates.physics) // (rates.physics // rates.control)
    old = round(scenario.delays.measurement * rates.control)
    return Carry(
        alive=1.0,
        ticks=0.0,
        state=state,
        memory=scenario.controller.memory,
        queue=(standing,) * (waiting + 1),
        readings=(_blank_reading(state),) * old,
        turbulence=_first_turbulence(scenario),
    )


def _blank_reading(state: State) -> Measurement:
    zero = Vec3(0.0, 0.0, 0.0)
    return Measurement(
        time=0.0,
        position=zero,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=zero,
        rate=zero,
        specific_force=zero,
        joints=(0.0,) * len(state.joints),
        joint_rates=(0.0,) * len(state.joints),
        rotor_speeds=(0.0,) * len(state.rotor_speeds),
    )


def _first_turbulence(scenario: Scenario) -> DrydenMemory | None:
    par = scenario.wind.turbulence if isinstance(scenario.wind, Airspeed) else None
    if par is None:
        return None
    return dryden.start(*turbulence_start(scenario.seed, scenario.episode), 1.0 / scenario.rates.control, par=par)


@dataclass(frozen=True, slots=True)
class Traced:
    """A scenario's closed loop, ready to compile.

    Attributes:
        loop: the stepped program. carry: first carry. sample: record that is logged.
    """

    loop: Loop
    carry: Carry
    sample: Sample


def trace_scenario(scenario: Scenario, inputs: EpisodeInputs) -> Traced:
    """Trace one control period of a scenario with all its numbers as constants."""
    scenario.controller.require_compiled("machine code of the loop")
    plant = RigidBodyPlant(scenario.world, inputs.wind_example, scenario.integrator, 1.0 / scenario.rates.physics)
    period = make_period(scenario, plant.substeps)
    carry = first_carry(scenario)
    row = Row(time=0.0, reference=inputs.reference_example)

    def step(now: Carry, _parameters: Any, fed: Row, uniforms: Any) -> tuple[Carry, Sample]:
        return period(now, fed, uniforms)

    loop = trace_loop(step, structure_of(carry), (), row, draws_needed(scenario), loops=True)
    return Traced(loop, carry, loop.result[1])


@dataclass(frozen=True, slots=True)
class Flown:
    """What one episode left: rows while it ran, the final carry, and the sample record they fill."""

    rows: Array
    carry: Carry
    sample: Sample


def fly(scenario: Scenario, inputs: EpisodeInputs, *, reference: bool = False) -> Flown:
    """Fly one episode.

    Args:
        scenario: on the rigid-body plant.
        inputs: its tables.
        reference: step in Python floats in place of machine code; the numbers are the same to the last bit.
    """
    traced = trace_scenario(scenario, inputs)
    rows = np.column_stack([inputs.times, np.array(inputs.held, dtype=float).reshape(scenario.steps, -1)])
    start = np.array(leaves(traced.carry), dtype=float)
    if reference:
        end, log = _in_python(traced.loop, scenario, start, rows)
    else:
        kernel = Kernel(traced.loop, Lanes(1), logging=True)
        carry, logged = kernel.run(
            start[:, None],
            np.zeros((0, 1)),
            rows,
            seed=scenario.seed,
            episodes=np.array([scenario.episode]),
        )
        end, log = carry[:, 0], logged[:, :, 0]
    final: Carry = rebuild(traced.carry, iter(end.tolist()))
    return Flown(log[: round(float(final.ticks))], final, traced.sample)


def _in_python(loop: Loop, scenario: Scenario, start: Array, rows: Array) -> tuple[Array, Array]:
    """The same steps in Python floats."""
    from skyarm.scalars.philox import uniforms

    step = loop.stepper()
    ticks = np.arange(len(rows))
    draws = [uniforms(scenario.seed, scenario.episode, channel, ticks, count) for channel, count in loop.uniforms]
    numbers: Sequence[Any] = np.concatenate(draws, axis=1).tolist() if draws else [()] * len(rows)
    carry, log = tuple(start.tolist()), []
    for row, drawn in zip(rows.tolist(), numbers, strict=True):
        result = step((*carry, *row, *drawn))
        carry = result[: loop.carry]
        log.append(result[loop.carry :])
    return np.array(carry), np.array(log)
