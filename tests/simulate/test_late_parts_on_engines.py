"""Late rotors and joints, a law that joins a running reference, friction given back:
the same on every engine.

All vary by path, from lane to lane. The oracle is the program as Python floats, one
lane after the other.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import Loop, trace_loop
from skyarm.control.catalogue import make_controller
from skyarm.dynamics.actuators import Command
from skyarm.plant.compiled import Steps
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import load_scenario
from skyarm.sensing.measurement import measurement_of
from skyarm.simulate import Delays
from skyarm.simulate.command_delay import (
    command_in_force,
    rotor_and_joint_delays,
    switches,
)
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop_state import InputRow, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages, joined_reference
from support.engines import ENGINES, evaluate

VALUES = {
    "reference.tracking_start": (0.0, 0.06, 0.121, 0.2),
    "delays.rotors": (0.0, 0.004, 0.0115, 0.005),
    "delays.joints": (0.003, 0.0, 0.0042, 0.005),
    "controller.friction_compensation.0": (0.0, 1.0, 0.7, 1.1),
    "controller.rate_weights.1": (1.0, 0.0, 0.5, 1.0),
    "plant.vehicle.links.0.joint.damping": (0.001, 0.05, 0.06, 0.03),
}
LANES, PERIODS = 4, 40


def flight() -> Any:
    """The arm moves from the first instant, on Euler steps: programs are written out
    for JAX and CasADi.
    """
    base = load_scenario("case2", duration=0.2)
    law = make_controller(
        "hybrid_computed_torque",
        base.controller.par.model,
        friction_compensation=(0.5, 0.5),
        rate_weights=(1.0, 1.0),
    )
    moving = dataclasses.replace(
        base.reference, joints=load_scenario("case2").reference.joints
    )
    planned = dataclasses.replace(
        base,
        controller=law,
        reference=moving,
        integrator="euler",
        delays=Delays(longest_command=0.02),
        tracking_start=0.1,
    )
    return with_numbers(
        planned, {"reference.joints.0.start": 0.0, "reference.joints.1.start": 0.0}
    )


FLIGHT = flight()


@pytest.fixture(scope="module")
def program() -> tuple[Loop, Any, np.ndarray, np.ndarray, np.ndarray]:
    """Loop, its period as a function, first carry, parameters and rows."""
    scenario = FLIGHT
    first, inputs = first_loop_state(scenario), episode_inputs(scenario)

    def period(now: Any, values: Any, fed: InputRow, uniforms: Any = ()) -> Any:
        stages = Stages(with_numbers(scenario, dict(zip(VALUES, values, strict=True))))
        return make_period(stages, RigidBodySteps(stages, lambda _: Steps(1)))(
            now, (fed,), uniforms
        )

    row = InputRow(time=0.0, reference=inputs.reference_example)
    base = tuple(number_at(scenario, path) for path in VALUES)
    loop = trace_loop(
        lambda *given: (period(*given)[0], ()), structure_of(first), base, row
    )
    carry = np.repeat(np.array(leaves(first), dtype=float)[:, None], LANES, axis=1)
    rows = np.column_stack(
        [
            inputs.times,
            np.array(inputs.held_leaves, dtype=float).reshape(scenario.steps, -1),
        ]
    )[:PERIODS]
    examples = (structure_of(first), base, row)
    return loop, (period, examples), carry, np.array(list(VALUES.values())), rows


@pytest.fixture(scope="module")
def floats(program: Any) -> np.ndarray:
    """(leaves, lanes) by Python floats."""
    loop, _, carry, parameters, rows = program
    step, found = loop.stepper(), []
    for lane in range(LANES):
        now = tuple(carry[:, lane].tolist())
        for row in rows:
            now = step((*now, *parameters[:, lane].tolist(), *row.tolist()))[
                : loop.carry
            ]
        found.append(now)
    return np.array(found).T


def test_every_number_makes_a_difference(floats: np.ndarray) -> None:
    assert np.isfinite(floats).all()
    assert len({tuple(lane) for lane in floats.T.tolist()}) == LANES


def test_machine_code_flies_all_lanes_as_one_by_one_to_the_bit(
    program: Any, floats: np.ndarray
) -> None:
    loop, _, carry, parameters, rows = program
    found, _ = Kernel(loop, Lanes(4, contract=False)).run(carry, parameters, rows)
    assert np.array_equal(found, floats)


def pieces(time: Any, *values: Any) -> list[Any]:
    """What the law is told and answers, which commands act, and when within the
    period.
    """
    varied = with_numbers(FLIGHT, dict(zip(VALUES, values, strict=True)))
    told = joined_reference(varied, varied.reference.at(time), time)
    measured = measurement_of(first_loop_state(FLIGHT).agent.state, Vec3(0.0, 0.0, 9.8))
    moving = dataclasses.replace(measured, joint_rates=(0.3, -0.4))
    _, command = varied.controller.law(
        (), moving, told.dense(), 0.005, par=varied.controller.par
    )
    (rotors, part), (joints, other) = rotor_and_joint_delays(varied)
    queue = tuple(
        Command(rotor_speeds=(400.0 + k,) * 4, efforts=(0.1 * k, -0.2 * k))
        for k in range(5)
    )
    acting = Command(
        rotor_speeds=command_in_force(queue, rotors).rotor_speeds,
        efforts=command_in_force(queue, joints).efforts,
    )
    return leaves((told, command, acting, *switches(acting, command, part, other)))


@pytest.mark.parametrize(
    "engine",
    [
        pytest.param(each, marks=pytest.mark.thorough if each == "jax" else ())
        for each in ENGINES
        if each != "floats"
    ],
)
def test_the_pieces_are_the_same_on_every_engine(engine: str) -> None:
    """Before the law joins, at that instant and after; JAX takes a minute to compile
    the whole loop.
    """
    lanes = [
        (time, *column)
        for time in (0.0, 0.06, 0.1)
        for column in zip(*VALUES.values(), strict=True)
    ]
    expected = evaluate("floats", pieces, lanes)
    assert len({tuple(row) for row in expected.tolist()}) == 4 + 2 + 2, (
        "two lanes wait all the time"
    )
    np.testing.assert_allclose(
        evaluate(engine, pieces, lanes), expected, rtol=1e-12, atol=1e-12
    )


def test_casadi_flies_the_same_within_rounding(
    program: Any, floats: np.ndarray
) -> None:
    """Tolerance: CasADi folds constants in another order; roundings as of JAX."""
    import casadi

    _, (period, examples), carry, parameters, rows = program
    x = casadi.SX.sym("x", len(carry) + len(parameters) + rows.shape[1])
    following = leaves(period(*rebuild(examples, iter(casadi.vertsplit(x))))[0])
    step = casadi.Function("step", [x], [casadi.vertcat(*following)])
    for lane in range(LANES):
        now = carry[:, lane]
        for row in rows:
            now = np.array(
                step(np.concatenate([now, parameters[:, lane], row]))
            ).ravel()
        np.testing.assert_allclose(now, floats[:, lane], rtol=1e-9, atol=1e-9)
