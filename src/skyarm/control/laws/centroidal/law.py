"""The centroidal law: one control step.

1. The held reference is continued to the present. 2. The observer takes the (possibly old) measurement. 3. The model
carries the state across the delay. 4. The centre of mass asks for a force, the force for an attitude. 5. Joint
accelerations: of the joints' references, or of tip and link orientations. 6. Inverse dynamics of an underactuated
base: the real thrust goes in, the base's acceleration comes out, then body and joint torques. 7. Rotor commands undo
the lag.

Assumes a model of rigid bodies, rotors whose thrust is along body z but for the disturbance (with ``sideways`` in any
direction), and motor time constants.
Sources: Lee, Leok, McClamroch 2010; Gao 2003; the parts cite their own.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm.actuation import Command
from skyarm.algebra import ZERO3, Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.disturbance_observer import Observed, disturbance, observe
from skyarm.control.blocks.extrapolation import extrapolate, samples
from skyarm.control.blocks.force_trend import ForceTrend, followed, trusted_rate
from skyarm.control.blocks.lag_estimate import LagMemory, learn, shares
from skyarm.control.blocks.prediction import predict, with_side
from skyarm.control.blocks.saturation import all_follow
from skyarm.control.controller import all_applied
from skyarm.control.laws.centroidal.adaptation import adapt
from skyarm.control.laws.centroidal.admittance import give_way, known_rate, outside, unmoved
from skyarm.control.laws.centroidal.bandwidth import at_shares
from skyarm.control.laws.centroidal.carrying_step import carry
from skyarm.control.laws.centroidal.demands import Following, demands
from skyarm.control.laws.centroidal.gust_shift import foretold, lateness, slow_force
from skyarm.control.laws.centroidal.interaction import rested
from skyarm.control.laws.centroidal.interaction_records import InteractionMemory
from skyarm.control.laws.centroidal.learned_load import with_learned
from skyarm.control.laws.centroidal.load_records import LoadMemory
from skyarm.control.laws.centroidal.memory import CentroidalMemory
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.pressing_step import press
from skyarm.control.laws.centroidal.torques import actuate
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.reference import Reference
from skyarm.scalars import add, mul, sub, where
from skyarm.sensors.measurement import Measurement


def centroidal(
    memory: CentroidalMemory, measurement: Measurement, reference: Reference, dt: Any, *, par: CentroidalParameters
) -> tuple[CentroidalMemory, Command]:
    """One step of the centroidal law."""
    signals, channels, age = extrapolate(
        memory.channels, memory.age, samples(reference), memory.started, dt, par.reference_period, par.continuation
    )
    if par.lag is not None and isinstance(memory.lag, LagMemory):
        par = at_shares(par, *shares(par.lag, memory.lag, dt))
    load = memory.load
    if par.load is not None and isinstance(load, LoadMemory):
        par = dataclasses.replace(par, model=with_learned(par.model, par.load, load))
    model, then, feedforward = par.model, memory.observed, memory.learned.feedforward
    observed, told = observe(
        model,
        par.observer,
        then,
        measurement,
        memory.sent[0],
        disturbance(then) + feedforward,
        memory.started,
        memory.free,
        dt,
        par.accelerometer,
        par.air,
    )
    alone = disturbance(observed) + feedforward
    unknown = with_side(
        model,
        alone,
        observed.quaternion.rotation(),
        observed.rotor_speeds,
        observed.velocity,
        observed.rate,
        par.uses_sideways,
        par.air,
    )
    state = _present(par, model, measurement, memory, observed, unknown, dt)
    held, pressing, force, felt = memory.interaction, None, observed.force, measurement.tip_force
    if par.interaction is not None and isinstance(held, InteractionMemory) and reference.push:
        weight = mul(load.mass, model.gravity) if isinstance(load, LoadMemory) else 0
        held, pressing, unknown, force = press(
            par, held, reference.push, signals, observed, memory.sent[-1], state, unknown, felt, dt, weight
        )
        signals = pressing.shifted(signals)
    yields, signals = give_way(
        par.admittance, memory.admittance, model.vehicle, observed, signals, felt, dt, measurement.tip_torque
    )
    if par.load is not None and isinstance(load, LoadMemory) and reference.load:
        load, resting = carry(par, memory, load, reference.load[0], observed, alone, pressing, dt, signals)
        unknown, force = unknown + resting, force + resting.force
    slow = slow_force(par, memory.slow_force, memory.gust, force, dt)
    steady = (slow.force if par.mode == "tip" else force) + feedforward.force
    before: Following = memory.following
    rate: Vec3 = ZERO3
    if par.trend is not None and isinstance(before.trend, ForceTrend):
        trend = followed(par.trend, before.trend, observed.force, dt)
        rate = trusted_rate(par.trend, trend)
        if pressing is not None:
            rate = rate * (1.0 - pressing.engaged)  # an impact is no trend
        rate = known_rate(yields, rate)
        before = dataclasses.replace(before, trend=trend)
        late = lateness(par)
        unknown = dataclasses.replace(unknown, force=unknown.force + rate * late)
        steady, slow = foretold(par, steady, slow, trend, rate, late, outside(yields, pressing))
    demand = demands(par, model, state, signals, unknown, steady, rate, before, dt, pressing, slow)
    done = actuate(par, model, state, demand, unknown, memory.trim, memory.applied[0], dt)
    # a command that others changed moves the vehicle away from its plan: nothing of that is a load or friction
    unchanged = all_follow(memory.applied)
    free = tuple(where(unchanged, each, 0.0) for each in memory.free)
    lag, isolated = memory.lag, (1.0,)
    if pressing is not None and par.interaction is not None and isinstance(held, InteractionMemory):
        rest = rested(par.interaction, held)  # a surface is no load, no friction and no lag
        free, isolated = (tuple(mul(each, rest) for each in row) for row in (free, isolated))
        held = dataclasses.replace(held, gap=demand.gap)
    free, isolated = (unmoved(par.admittance, yields, row) for row in (free, isolated))
    if par.lag is not None and isinstance(lag, LagMemory):
        lag = learn(par.lag, lag, told, measurement, memory.started, memory.free, isolated[0], dt)
    following = CentroidalMemory(
        started=memory.started * 0.0 + 1.0,
        age=age,
        channels=channels,
        observed=observed,
        sent=(*memory.sent[1:], done.command),
        applied=all_applied(model.vehicle.n),
        free=done.free,
        slow_force=slow.force,
        gust=slow.memory,
        trim=done.trim,
        learned=adapt(par, memory.learned, demand.planned, observed.joint_rates, observed.efforts, free, dt),
        following=demand.following,
        lag=lag,
        interaction=held,
        load=load,
        admittance=yields,
    )
    return following, done.command


def _present(
    par: CentroidalParameters,
    model: Model,
    measurement: Measurement,
    memory: CentroidalMemory,
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
        state = predict(model, state, command, unknown, dt, par.uses_sideways)
    return state
