"""Parts of the centroidal law changed in its constants or its memory, and steps of
it.
"""

import dataclasses
from types import SimpleNamespace
from typing import Any

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.control.blocks.prediction import acceleration, motor_speeds, rotor_wrench
from skyarm.control.laws.centroidal.demands import Following, demands, plan
from skyarm.control.laws.centroidal.force_trend import Foreseen
from skyarm.control.laws.centroidal.parameters import Step
from skyarm.control.laws.centroidal.step_records import Effect, ReferenceMotion
from skyarm.control.laws.centroidal.torques import actuate
from skyarm.dynamics import State


def with_parts(record: Any, **changes: Any) -> Any:
    """The constants, or the memory, with other parts."""
    return dataclasses.replace(
        record, parts=dataclasses.replace(record.parts, **changes)
    )


def step_of(par: Any, state: Any, dt: float = 0.005, **known: Any) -> Any:
    """A step of the law; its memory's following, trim and applied may be given."""
    memory = SimpleNamespace(
        **{"following": Following(), "trim": (), "applied": (1.0,), **known}
    )
    blank: dict[str, Any] = dict.fromkeys(
        ("measurement", "reference", "timing", "seen")
    )
    blank |= {"vehicle": par.model.vehicle, "motion": ReferenceMotion(signals=())}
    return Step(par=par, memory=memory, dt=dt, state=state, **blank)


def demanded(
    par: Any,
    state: Any,
    signals: Any,
    unknown: Any,
    steady: Vec3 = ZERO3,
    **rates: Vec3,
) -> Any:
    """Demand of a step whose whole disturbance is known, and the part of its force that
    stays, or its rates.
    """
    effect = Effect(signals=signals, unknown=unknown, force=None)
    return demands(
        step_of(par, state), effect, Foreseen(unknown=unknown, steady=steady, **rates)
    )[0]


def planned(par: Any, state: Any, signals: Any, dt: float, following: Any) -> Any:
    """Planned course of a step in still air, from a state of the base's shift."""
    effect = Effect(signals=signals, unknown=None, force=None)
    return plan(
        step_of(par, state, dt, following=following),
        effect,
        Foreseen(unknown=None, steady=ZERO3),
    )


def commanded(
    par: Any, state: Any, unknown: Any, demand: Any, dt: float, **memory: Any
) -> Any:
    """Commands of a step for its demand; trim and applied flags of its memory may be
    given.
    """
    return actuate(step_of(par, state, dt, **memory), unknown, demand)


def in_small_steps(
    model: Any, state: State, command: Any, unknown: Any, dt: float, steps: int = 5
) -> State:
    """State after a held command by the law's model, in symplectic steps with the
    rotors' mean squares.
    """
    h = dt / steps
    for _ in range(steps):
        speeds = motor_speeds(model, state.rotor_speeds, command, h)
        squares = [
            0.5 * (a * a + b * b)
            for a, b in zip(state.rotor_speeds, speeds, strict=True)
        ]
        R, wrench = state.quaternion.rotation(), rotor_wrench(model, squares)
        linear, angular, bend = acceleration(
            model,
            R,
            state.rate,
            state.joints,
            state.joint_rates,
            wrench,
            command.efforts,
            unknown,
        )
        velocity, rate = state.velocity + linear * h, state.rate + angular * h
        rates = tuple(v + a * h for v, a in zip(state.joint_rates, bend, strict=True))
        state = State(
            position=state.position + (state.velocity + velocity) * (0.5 * h),
            quaternion=(
                state.quaternion
                * Quaternion.of_small_rotation((state.rate + rate) * (0.5 * h))
            ).normalized(),
            velocity=velocity,
            rate=rate,
            joints=tuple(
                q + (a + b) * (0.5 * h)
                for q, a, b in zip(state.joints, state.joint_rates, rates, strict=True)
            ),
            joint_rates=rates,
            rotor_speeds=speeds,
        )
    return state
