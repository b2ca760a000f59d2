"""Centroidal computed torque with disturbance observer: one control step.

1. The held reference is continued to the present. 2. Parts adjust gains and model. 3. The observer takes the (possibly
old) measurement, and the model predicts the state across the delay. 4. Parts adjust the reference and the disturbance.
5. The centre of mass requires a force, the force an attitude; joints follow their references, or tip and link
orientations. 6. Inverse dynamics of an underactuated base: the real thrust goes in, the base's acceleration comes out,
then body and joint torques; rotor commands invert the lag. 7. Parts adapt.

Sources: Lee, Leok, McClamroch 2010; Gao 2003; the parts cite their own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, add, divide, maximum, same, where
from skyarm.control.blocks.actuators import all_follow
from skyarm.control.blocks.disturbance_observer import Observed, disturbance, observe
from skyarm.control.blocks.extrapolation import Channel, extrapolate
from skyarm.control.blocks.filters import low_pass
from skyarm.control.blocks.late_actuators import Past
from skyarm.control.blocks.prediction import Disturbance, predict_across, with_side
from skyarm.control.controller import all_applied
from skyarm.control.laws.centroidal.demands import Following, demands
from skyarm.control.laws.centroidal.force_trend import steady_force
from skyarm.control.laws.centroidal.parameters import FOLLOWING, CentroidalParameters, brace_joints
from skyarm.control.laws.centroidal.part import Step
from skyarm.control.laws.centroidal.torques import actuate
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.reference.preview import Sample, samples, samples_ahead
from skyarm.sensing.measurement import Measurement


@immutable
class PartMemories:
    """Internal states of the law's optional parts (lag estimate, contact control ...); empty for a disabled part."""

    lag: Any = ()
    noise: Any = ()
    interaction: Any = ()
    admittance: Any = ()
    load: Any = ()
    trend: Any = ()
    adaptation: Any = ()


@immutable
class CentroidalMemory:
    """Internal state of the centroidal law between two control steps: observer, filters, commands, optional parts.

    Attributes:
        channels: samples of x, y, z, yaw and joints.
        sent: the last command. past: of the actuators, as long as delay and lag may be.
        following: of the demands. parts: of the parts.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement")]
    age: Annotated[Scalar, Unit("s", "since the held reference sample appeared")]
    channels: tuple[Channel, ...]
    observed: Observed
    sent: Command
    past: Past
    applied: Annotated[tuple[Scalar, ...], Unit("", "1 for rotors and joints whose last command was applied unchanged")]
    free: Annotated[tuple[Scalar, ...], Unit("", "1 for base and joints whose actuators are not at their limit")]
    slow_force: Annotated[Vec3, Unit("N", "the observer's force, slowly filtered")]
    trim: Annotated[tuple[Scalar, ...], Unit("(rad/s)^2", "added to the squared speeds that the mixer asks for")]
    following: Following = Following()
    parts: PartMemories = PartMemories()


def centroidal(
    memory: CentroidalMemory, measurement: Measurement, reference: Reference, dt: Scalar, *, par: CentroidalParameters
) -> tuple[CentroidalMemory, Command]:
    """One control step of the centroidal law: computed torque on the centre of mass with a disturbance observer."""
    lag, past = par.parts.lag, memory.past.after(par.model, memory.sent, dt)
    late = 0 if lag is None else lag.delay(memory.parts.lag, dt)
    acted = past.period(_age(par, late, dt))
    ahead, lead = samples_ahead(reference), _lead(par, late, dt)
    signals, channels, age = extrapolate(
        memory.channels, memory.age, samples(reference), memory.started, dt, par.reference_period, ahead, lead
    )
    if all(same(each, 0) for each in measurement.specific_force):
        par = dataclasses.replace(par, observer=dataclasses.replace(par.observer, accelerometer=None))
    parts = par.parts.present()
    memories = {name: getattr(memory.parts, name) for name, _ in parts}
    for name, part in parts:
        par = part.adjust_gains(memories[name], par, dt)
    if par.braces:
        par = brace_joints(par, memory.observed.force, memory.observed.joints, lead)
    adapted = Disturbance(force=ZERO3, torque=ZERO3, efforts=(0,) * par.model.vehicle.n)
    if par.parts.adaptation is not None:
        adapted = memories["adaptation"].feedforward
    observed, told = observe(
        par.model,
        par.observer,
        memory.observed,
        measurement,
        acted,
        disturbance(memory.observed) + adapted,
        memory.started,
        memory.free,
        dt,
    )
    alone = disturbance(observed) + adapted
    # a command that others changed moves the vehicle away from its plan: nothing of that is a load or friction
    unchanged = all_follow(memory.applied)
    step = Step(
        par=par,
        memory=memory,
        measurement=measurement,
        reference=reference,
        dt=dt,
        late=late,
        past=past,
        acted=acted,
        signals=signals,
        ahead=_coming(par, ahead, add(age, lead), dt),
        observed=observed,
        told=told,
        alone=alone,
        unknown=with_side(
            par.model,
            alone,
            observed.quaternion.rotation(),
            observed.rotor_speeds,
            observed.velocity,
            observed.rate,
            par.center.sideways is not None,
        ),
        force=observed.force,
        free=tuple(where(unchanged, each, 0.0) for each in memory.free),
    )
    step.state = _present(step)
    for name, part in parts:
        memories[name] = part.adjust_reference(memories[name], step)
    slow = low_pass(memory.slow_force, step.force, par.tip.shift_rate, dt)
    step.steady = steady_force(par, step, slow, adapted.force)
    step.demand = demands(step)
    output = actuate(step, step.demand)
    for name, part in parts:
        memories[name] = part.learn(memories[name], step)
    following = CentroidalMemory(
        started=memory.started * 0.0 + 1.0,
        age=age,
        channels=channels,
        observed=observed,
        sent=output.command,
        past=past,
        applied=all_applied(par.model.vehicle.n),
        free=output.free,
        slow_force=slow,
        trim=output.trim,
        following=step.demand.following,
        parts=PartMemories(**memories),
    )
    return following, output.command


def _present(step: Step) -> State:
    """Vehicle state when the command of this step begins to act: filtered estimate, predicted over the sent commands.

    That is now, after the measurement's delay, and later by a delay of the commands that is found in flight.
    """
    par, state, sideways = step.par, step.observed.state(), step.par.center.sideways is not None
    if type(step.late) is int and not par.delay_periods:
        return state
    age = _age(par, step.late, step.dt)
    return predict_across(par.model, state, step.past.since(age), step.unknown, age * step.dt, sideways)


def _age(par: CentroidalParameters, late: Scalar, dt: Scalar) -> Scalar:
    """Age of the measurement against what the present command will find, in periods."""
    return divide(late, dt) + float(par.delay_periods)


def _lead(par: CentroidalParameters, late: Scalar, dt: Scalar) -> Scalar:
    """Time from now to when a command of this step acts, s: the commands' known delay and that found in flight."""
    return add(late, dt * float(par.lead_periods)) if par.lead_periods else late


def _coming(
    par: CentroidalParameters, ahead: Sequence[Sequence[Sample]], age: Scalar, dt: Scalar
) -> list[tuple[Scalar, Sequence[Sample]]]:
    """Samples of the preview with their times from when a command of this step acts, a period at least."""
    found = [(maximum(lead - age, dt), row) for lead, row in zip(par.preview, ahead, strict=False)]
    return found[FOLLOWING:]
