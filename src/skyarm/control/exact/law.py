"""The exact law: one control step.

1. The held reference is continued to the present. 2. The observer takes the (possibly old) measurement. 3. The model
carries the state across the delay. 4. The centre of mass asks for a force, the force for an attitude. 5. Joint
accelerations: of the joints' references, or of tip and link orientations. 6. Inverse dynamics of an underactuated
base: the real thrust goes in, the base's acceleration comes out, then body and joint torques. 7. Rotor commands undo
the lag.

Assumes a model of rigid bodies, rotors whose thrust is along body z but for the disturbance, and motor time constants.
Sources: Lee, Leok, McClamroch 2010; Gao 2003; the parts cite their own.
"""

from __future__ import annotations

from typing import Any

from skyarm.actuation import Command
from skyarm.control.controller import all_obeyed
from skyarm.control.exact.adaptation import adapted
from skyarm.control.exact.disturbance import Disturbance
from skyarm.control.exact.extrapolation import continued, samples
from skyarm.control.exact.memory import ExactMemory, Observed
from skyarm.control.exact.motion import carried, with_side
from skyarm.control.exact.observer import disturbance, observe
from skyarm.control.exact.parameters import ExactParameters
from skyarm.control.exact.torques import actuate
from skyarm.control.exact.wishes import wishes
from skyarm.control.model import Model
from skyarm.control.parts.saturation import all_follow
from skyarm.dynamics import State
from skyarm.dynamics.measurement import Measurement
from skyarm.reference import Reference
from skyarm.scalars import add, exp, mul, sub, where


def exact(
    memory: ExactMemory, measurement: Measurement, reference: Reference, dt: Any, *, par: ExactParameters
) -> tuple[ExactMemory, Command]:
    """One step of the exact law."""
    signals, channels, age = continued(
        memory.channels, memory.age, samples(reference), memory.started, dt, par.reference_period, par.continuation
    )
    model, before, fed = par.model, memory.observed, memory.learned.fed
    observed = observe(
        model,
        par.observer,
        before,
        measurement,
        memory.sent[0],
        disturbance(before) + fed,
        memory.started,
        memory.free,
        dt,
    )
    alone = disturbance(observed) + fed
    unknown = with_side(
        model, alone, observed.quaternion.rotation(), observed.rotor_speeds, observed.velocity, observed.rate
    )
    state = _present(par, model, measurement, memory, observed, unknown, dt)
    share = 1.0 - exp(-(par.tip.shift_rate * dt))
    slow = memory.slow_force + (observed.force - memory.slow_force) * share
    steady = (slow if par.mode == "ee" else observed.force) + fed.force
    wish = wishes(par, model, state, signals, unknown, steady)
    done = actuate(par, model, state, wish, unknown, memory.trim, memory.obeyed[0], dt)
    # a command that others changed moves the vehicle away from its plan: nothing of that is a load or friction
    followed = all_follow(memory.obeyed)
    free = tuple(where(followed, each, 0.0) for each in memory.free)
    following = ExactMemory(
        started=memory.started * 0.0 + 1.0,
        age=age,
        channels=channels,
        observed=observed,
        sent=(*memory.sent[1:], done.command),
        obeyed=all_obeyed(model.vehicle.n),
        free=done.free,
        slow_force=slow,
        trim=done.trim,
        learned=adapted(par, memory.learned, wish.planned, observed.joint_rates, observed.efforts, free, dt),
    )
    return following, done.command


def _present(
    par: ExactParameters,
    model: Model,
    measurement: Measurement,
    memory: ExactMemory,
    observed: Observed,
    unknown: Disturbance,
    dt: Any,
) -> State:
    """The state now: filtered, carried across the delay by the commands sent since."""
    share = par.measured_rates

    def mixed(filtered: Any, measured: Any) -> Any:
        return add(filtered, mul(share, sub(measured, filtered)))

    state = State(
        position=observed.position,
        quaternion=observed.quaternion,
        velocity=observed.velocity + (measurement.velocity - observed.velocity) * share,
        rate=observed.rate + (measurement.rate - observed.rate) * share,
        joints=observed.joints,
        joint_rates=tuple(mixed(a, b) for a, b in zip(observed.joint_rates, measurement.joint_rates, strict=True)),
        rotor_speeds=observed.rotor_speeds,
    )
    for command in memory.sent[1:]:
        state = carried(model, state, command, unknown, dt)
    return state
