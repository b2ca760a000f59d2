"""Centroidal computed torque with disturbance observer: one control step.

Each step is a function of the records before it, and none of these is changed:

1. when the command acts, by the lag that was found; 2. the held reference continued
until then, with its preview; 3. gains by lag and noise; 4. the observer's state at the
(possibly old) measurement; 5. the state predicted from it, and what a tip in contact
changes: reference, compensated force, adaptation; 6. the force as it will be, by its
weighted rate; 7. attitude and 8. links of the plan without errors; 9. the force that
the centre of mass requires; 10. the attitude of this force; 11. joint accelerations, of
the joints' references or of tip and links; 12. commands by the inverse dynamics of an
underactuated base: the real thrust goes in, the base's acceleration comes out; 13.
adaptation of lag, noise, load and friction. The numbers are those of
the files in ``equations``, one for each step.

Sources: Lee, Leok, McClamroch 2010; Gao 2003; the parts cite their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add, divide, maximum, mul, same, where
from skyarm.control.blocks.actuators import all_follow
from skyarm.control.blocks.disturbance_observer import Observed, disturbance, observe
from skyarm.control.blocks.extrapolation import Channel, extrapolate
from skyarm.control.blocks.filters import low_pass
from skyarm.control.blocks.held_damping import with_held_damping
from skyarm.control.blocks.late_actuators import Past
from skyarm.control.blocks.prediction import (
    Actuation,
    Disturbance,
    predict_across,
    with_side,
)
from skyarm.control.controller import all_applied
from skyarm.control.laws.centroidal.adaptation import AdaptationGains, adapt
from skyarm.control.laws.centroidal.demands import Following, demands
from skyarm.control.laws.centroidal.force_trend import TrendGains, foresee, update_trend
from skyarm.control.laws.centroidal.lag_estimate import LagGains
from skyarm.control.laws.centroidal.noise_estimate import NoiseGains
from skyarm.control.laws.centroidal.parameters import (
    FOLLOWING,
    CentroidalParameters,
    Step,
    brace_joints,
)
from skyarm.control.laws.centroidal.step_records import (
    Effect,
    ObserverOutput,
    ReferenceMotion,
    Timing,
)
from skyarm.control.laws.centroidal.torques import actuate
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Tree
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.reference.preview import Sample, samples, samples_ahead
from skyarm.sensing.measurement import Measurement


@immutable
class PartMemories:
    """Internal states of the law's optional parts (lag estimate, contact control ...);
    empty for a disabled part.
    """

    lag: Any = ()
    noise: Any = ()
    interaction: Tree = ()
    admittance: Tree = ()
    load: Tree = ()
    carrying: Tree = field_if_any(default=())
    trend: Any = ()
    adaptation: Any = ()


@immutable
class CentroidalMemory:
    """Internal state of the centroidal law between two control steps: observer,
    filters, commands, optional parts.

    Attributes:
        channels: samples of x, y, z, yaw and joints.
        sent: the last command. past: modelled past of the actuators, as long as delay
            and lag may be.
        following: filter states of the desired motion. parts: states of the optional
            parts.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement")]
    age: Annotated[Scalar, Unit("s", "time since the held reference sample appeared")]
    channels: tuple[Channel, ...]
    observed: Observed
    sent: Command
    past: Past
    applied: Annotated[
        Scalars,
        Unit("", "1 for rotors and joints whose last command was applied unchanged"),
    ]
    free: Annotated[
        Scalars,
        Unit("", "1 for base and joints whose actuators are not at their limit"),
    ]
    slow_force: Annotated[
        Vec3, Unit("N", "slowly filtered disturbance force of the observer")
    ]
    trim: Annotated[
        Scalars, Unit("(rad/s)^2", "squared speeds added to those of the mixer")
    ]
    following: Following = Following()
    parts: PartMemories = PartMemories()

    def after_start(self) -> CentroidalMemory:
        """Internal state in which the gentle start of the gains is over."""
        lag = self.parts.lag
        if not lag:
            return self
        # a count without end is past every start
        return replace(
            self,
            parts=replace(self.parts, lag=replace(lag, count=float("inf"))),
        )


def centroidal(
    memory: CentroidalMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: CentroidalParameters,
) -> tuple[CentroidalMemory, Command]:
    """One control step of the centroidal law: computed torque on the centre of mass
    with a disturbance observer.
    """
    par = replace(par, model=with_held_damping(par.model, par.mobilities, dt))
    part_memories = memory.parts
    touching = par.parts.touching()
    vehicle = par.model.vehicle
    timing = time_of_action(par, memory, dt)
    motion, channels, age = continue_reference(par, memory, reference, timing.lead, dt)
    par = gains_of_now(par, memory, measurement, timing.lead, dt)
    before, adapted = feedforward(par, part_memories, reference, motion)
    seen = see(par, memory, measurement, timing.acted, (before, adapted), dt)
    step = Step(
        par=par,
        vehicle=vehicle,
        memory=memory,
        measurement=measurement,
        reference=reference,
        dt=dt,
        timing=timing,
        motion=motion,
        seen=seen,
        state=present(par, timing, seen, dt),
    )
    effect = Effect(
        signals=motion.signals,
        ahead=motion.ahead,
        unknown=seen.unknown,
        force=seen.observed.force,
    )
    memories: dict[str, Any] = {}
    for name, part in touching:
        memories[name], effect = part.affect(getattr(part_memories, name), step, effect)
    if isinstance(par.parts.trend, TrendGains):
        memories["trend"] = update_trend(
            par.parts.trend, part_memories.trend, seen.observed.force, dt
        )
    # the base shifts for what lasts: a gust is over before the base has moved
    slow = low_pass(memory.slow_force, effect.force, par.tip.shift_rate, dt)
    coming = foresee(par, memories.get("trend"), effect, slow, adapted.force)
    demand, shifted = demands(step, effect, coming)
    output = actuate(step, coming.unknown, demand)
    if isinstance(par.parts.lag, LagGains):
        memories["lag"] = par.parts.lag.after(part_memories.lag, step, effect.isolated)
    if isinstance(par.parts.noise, NoiseGains):
        memories["noise"] = par.parts.noise.after(
            part_memories.noise, seen, measurement.velocity, dt
        )
    for name, part in touching:
        memories[name] = part.learn(memories[name], effect, demand)
    observed = (
        seen.observed
        if effect.forgets is None
        else seen.observed.without(effect.forgets)
    )
    if isinstance(par.parts.adaptation, AdaptationGains):
        free = learning(memory, effect.learns)
        memories["adaptation"], over = adapt(
            par.parts.adaptation,
            step,
            part_memories.adaptation,
            demand.planned,
            free[1:],
        )
        observed = observed.without(over)
    # from the number itself, so that the 1 is of its kind: array, symbol or dual
    following = CentroidalMemory(
        started=memory.started * 0.0 + 1.0,
        age=age,
        channels=channels,
        observed=observed,
        sent=output.command,
        past=timing.past,
        applied=all_applied(par.model.vehicle.n),
        free=output.free,
        slow_force=slow,
        trim=output.trim,
        following=shifted,
        parts=PartMemories(**memories),
    )
    return following, output.command


def time_of_action(
    par: CentroidalParameters, memory: CentroidalMemory, dt: Scalar
) -> Timing:
    """Delay of this step's command, and modelled rotor speeds and joint efforts before
    the measurement.
    """
    lag = par.parts.lag
    past = memory.past.after(par.model, memory.sent, dt)
    late = lag.delay(memory.parts.lag, dt) if isinstance(lag, LagGains) else 0
    age = divide(late, dt) + float(par.delay_periods)
    lead = add(late, dt * float(par.lead_periods)) if par.lead_periods else late
    # the lag is negative where the known delay is too long, and no reference goes back
    if par.delay_periods:
        lead = maximum(lead, 0.0)
    return Timing(late=late, lead=lead, age=age, past=past, acted=past.period(age))


def continue_reference(
    par: CentroidalParameters,
    memory: CentroidalMemory,
    reference: Reference,
    lead: Scalar,
    dt: Scalar,
) -> tuple[ReferenceMotion, tuple[Channel, ...], Scalar]:
    """Reference when the command acts, next states of the extrapolators, and age (s) of
    the last reference sample.
    """
    ahead = samples_ahead(reference)
    signals, channels, age = extrapolate(
        memory.channels,
        memory.age,
        samples(reference),
        memory.started,
        dt,
        par.reference_period,
        ahead,
        lead,
    )
    # the preview from then on; what a late command has missed follows at one period
    # from the one before
    since, rows = add(age, lead), list[tuple[Scalar, Sequence[Sample]]]()
    last: Scalar = 0.0
    for time, row in zip(par.preview[FOLLOWING:], ahead[FOLLOWING:], strict=False):
        last = maximum(time - since, add(last, dt))
        rows.append((last, row))
    center = planned_center(reference.center, add(age, lead))
    return ReferenceMotion(signals=signals, ahead=rows, center=center), channels, age


def planned_center(held: Scalars, age: Scalar) -> list[Vec3]:
    """Planned centre of mass with four derivatives (m, world axes), ``age`` seconds
    after its sample; empty without.
    """
    rows = [Vec3(*held[k : k + 3]) for k in range(0, len(held), 3)]
    # powers of the age over factorials, one from the other
    terms: list[Scalar] = [1]
    for power in range(1, len(rows)):
        terms.append(mul(terms[-1], age) * (1.0 / power))
    return [
        sum(
            (row * term for row, term in zip(rows[k + 1 :], terms[1:], strict=False)),
            value,
        )
        for k, value in enumerate(rows)
    ]


def gains_of_now(
    par: CentroidalParameters,
    memory: CentroidalMemory,
    measurement: Measurement,
    lead: Scalar,
    dt: Scalar,
) -> CentroidalParameters:
    """Constants of the law for one step, adapted to estimated lag, noise and load, and
    to an observed upward force.
    """
    # zeros known before compilation: nothing measures it, so the program has no such
    # filter
    if all(same(each, 0) for each in measurement.specific_force):
        par = replace(par, observer=replace(par.observer, accelerometer=None))
    for name, part in par.parts.present():
        par = part.adjust_gains(getattr(memory.parts, name), par, dt)
    return (
        brace_joints(par, memory.observed.force, memory.observed.joints, lead)
        if par.braces
        else par
    )


def see(
    par: CentroidalParameters,
    memory: CentroidalMemory,
    measurement: Measurement,
    acted: Actuation,
    adapted: tuple[Disturbance, Disturbance],
    dt: Scalar,
) -> ObserverOutput:
    """Output of the disturbance observer after one measurement: state and disturbance
    at the measurement's time.

    ``adapted``: feed-forward of the period before the measurement, and that of now.
    """
    model = par.model
    expected = disturbance(memory.observed) + adapted[0]
    observed, update = observe(
        model,
        par.observer,
        memory.observed,
        measurement,
        acted,
        expected,
        memory.started,
        memory.free,
        dt,
    )
    alone = disturbance(observed) + adapted[1]
    R = observed.quaternion.rotation()
    across = par.center.sideways is not None
    unknown = with_side(
        model, alone, R, observed.rotor_speeds, observed.velocity, observed.rate, across
    )
    return ObserverOutput(
        observed=observed, corrections=update, alone=alone, unknown=unknown
    )


def present(
    par: CentroidalParameters, timing: Timing, seen: ObserverOutput, dt: Scalar
) -> State:
    """Vehicle state when the command of this step begins to act: filtered estimate,
    predicted over the sent commands.

    That is now, after the measurement's delay, and later by a delay of the commands
    that is found in flight.
    """
    state = seen.observed.state()
    sideways = par.center.sideways is not None
    # neither a known nor an estimated delay: the measured state is that of now
    if type(timing.late) is int and not par.delay_periods:
        return state
    done = timing.past.since(timing.age)
    return predict_across(
        par.model, state, done, seen.unknown, timing.age * dt, sideways
    )


def learning(memory: CentroidalMemory, share: Scalar) -> Scalars:
    """Flags of base and joints that may be adapted: no actuator limit, no contact,
    command applied unchanged.

    A command that others changed moves the vehicle away from its plan: nothing of that
    is a load or friction.
    """
    unchanged = all_follow(memory.applied)
    return tuple(mul(where(unchanged, each, 0.0), share) for each in memory.free)


def feedforward(
    par: CentroidalParameters,
    memories: PartMemories,
    reference: Reference,
    motion: ReferenceMotion,
) -> tuple[Disturbance, Disturbance]:
    """Disturbance compensated beside the observer, before the measurement and now;
    zeros are compiled as constants.
    """
    none = Disturbance(force=ZERO3, torque=ZERO3, efforts=(0,) * par.model.vehicle.n)
    rows = [
        part.feedforward(getattr(memories, name), par, reference, motion)
        for name, part in par.parts.present()
    ]
    given = [row for row in rows if row is not None] or [(none, none)]
    return reduce(lambda a, b: (a[0] + b[0], a[1] + b[1]), given)
