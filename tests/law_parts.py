"""Parts of the centroidal law changed in its constants or its memory, and steps of it."""

import dataclasses
from types import SimpleNamespace
from typing import Any

from skyarm.algebra import Quaternion
from skyarm.control.blocks.prediction import acceleration, motor_speeds, rotor_wrench
from skyarm.control.laws.centroidal.demands import Following
from skyarm.control.laws.centroidal.part import Step
from skyarm.dynamics import State


def with_parts(record: Any, **changes: Any) -> Any:
    """The constants, or the memory, with other parts."""
    return dataclasses.replace(record, parts=dataclasses.replace(record.parts, **changes))


def step_of(par: Any, state: Any, signals: Any = (), dt: float = 0.005, **known: Any) -> Step:
    """A step of the law; its memory's following, trim and applied, and any field of a step, may be given."""
    kept = {"following": Following(), "trim": (), "applied": (1.0,)}
    memory = SimpleNamespace(**{name: known.pop(name, value) for name, value in kept.items()})
    blank: dict[str, Any] = dict.fromkeys(("measurement", "reference", "observed", "told", "alone", "unknown", "force"))
    step = Step(par=par, memory=memory, dt=dt, signals=signals, free=(), past=None, acted=None, **blank)
    step.state, step.told = state, SimpleNamespace(amid=state)
    for name, value in known.items():
        setattr(step, name, value)
    return step


def in_small_steps(model: Any, state: State, command: Any, unknown: Any, dt: float, steps: int = 5) -> State:
    """State after a held command by the law's model, in symplectic steps with the rotors' mean squares."""
    h = dt / steps
    for _ in range(steps):
        speeds = motor_speeds(model, state.rotor_speeds, command, h)
        squares = [0.5 * (a * a + b * b) for a, b in zip(state.rotor_speeds, speeds, strict=True)]
        R, wrench = state.quaternion.rotation(), rotor_wrench(model, squares)
        linear, angular, bend = acceleration(
            model, R, state.rate, state.joints, state.joint_rates, wrench, command.efforts, unknown
        )
        velocity, rate = state.velocity + linear * h, state.rate + angular * h
        rates = tuple(v + a * h for v, a in zip(state.joint_rates, bend, strict=True))
        state = State(
            position=state.position + (state.velocity + velocity) * (0.5 * h),
            quaternion=(state.quaternion * Quaternion.of_small_rotation((state.rate + rate) * (0.5 * h))).normalized(),
            velocity=velocity,
            rate=rate,
            joints=tuple(
                q + (a + b) * (0.5 * h) for q, a, b in zip(state.joints, state.joint_rates, rates, strict=True)
            ),
            joint_rates=rates,
            rotor_speeds=speeds,
        )
    return state
