"""Whole-body nonlinear model predictive control.

Law: every so many control periods (option ``every``) the motion of base, arm and rotors
over a short horizon of growing stages is chosen so that base, joints and tool follow
the reference at little rotor acceleration; in between the feedback u = u* + K (x - x*)
of the solution acts. A disturbance observer makes it free of offset. The solution is
warm started from the last one, moved on in time. Commands that act late and plans that
lead nowhere are detected (:mod:`.observer`, :mod:`.fallback`). A tip that presses is
held by a surface whose force the plan predicts (:mod:`.tip_contact`, :mod:`.cost`).

In mode "plan" the reference is a plan's: its preview brings attitude, rates and rotor
speeds, and the cost counts errors from that state at any tilt. Feedback gains are those
of the law's own Riccati recursion over the preview, not those of the plan's last one.
In eagle catch the tip is 0.2 mm off at the catch and 1.2 mm at most with the law's own
gains, 1.0 and 118 mm with the plan's: penalties of its goals stiffen these near the
goals alone, and nothing observes what the model lacks.

Assumptions: rigid bodies, rotors that lag, still air; what else pushes is one force and
torque at the base and one torque a joint, constant over the horizon. Position,
velocity, acceleration of the *held samples* are extrapolated, as every other law must.

Tuning: ``weights``, ``bandwidths``, ``stages``, ``horizon``, ``every``. Not traceable.

Source: Diehl, Bock, Schloeder 2005 (real-time iteration); Tassa, Mansard, Todorov 2014
(line search). Weights, growing stages and rates of rotor speeds as inputs are our own.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Any

import numpy as np

from skyarm.algebra import ZERO3_DATA, Vec3
from skyarm.control.blocks.force_control import (
    InteractionGains,
    InteractionMemory,
    require_thresholds,
)
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.law_maker import checked_option, option_numbers
from skyarm.control.laws.paper import level_joint_gravity
from skyarm.control.laws.predictive.cost import MODES, Weights
from skyarm.control.laws.predictive.fallback import (
    Stabiliser,
    Trust,
    after_period,
    after_plan,
    is_flyable,
    worst_cost,
)
from skyarm.control.laws.predictive.observer import (
    Bandwidths,
    Observation,
    ObserverState,
    command_row,
)
from skyarm.control.laws.predictive.prediction import command_for
from skyarm.control.laws.predictive.preview import (
    SampledReference,
    extrapolate,
    goals,
    make_stance,
    planned_motion,
    update_sample,
)
from skyarm.control.laws.predictive.solver import (
    Bounds,
    CompiledStages,
    MotionPlan,
    NoPlanError,
    Problem,
    Riccati,
    Rollouts,
    shift_plan,
)
from skyarm.control.laws.predictive.tip_contact import (
    ContactState,
    TipContact,
    contact_goals,
    shift_ahead,
)
from skyarm.control.model import MeasurementAge, Model
from skyarm.dynamics.actuators import Command, Mixer, make_mixer
from skyarm.records.arrays import Array, doubles, float_array, norm
from skyarm.records.files import shown
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import leaves
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement


@immutable
class PredictiveParameters:
    """Constants of the predictive law.

    Attributes:
        model: the controller's. mixer: mixer of that model; the law does not use it.
        weights, mode: cost weights and mode. bandwidths: poles of the observer.
        stages: number of stages of the horizon, which grow by one factor from the
            ``every``-th on. horizon: s.
        every: control periods from one solution to the next. delay_periods: known age
            of measurements, control periods.
        interaction: constants of contact force control; None for a law that ignores
            requested contact.
    """

    model: Model
    mixer: Mixer
    weights: Weights
    bandwidths: Bandwidths
    mode: str
    stages: Annotated[
        int,
        Unit(
            "",
            "number of stages of the horizon",
            low=2,
            high=200,
            effect="higher values predict more finely and take more time to solve",
        ),
    ]
    horizon: Annotated[
        float,
        Unit(
            "s",
            "length of the prediction horizon",
            low=0.05,
            high=5.0,
            effect="longer horizons act earlier and model errors count more",
        ),
    ]
    every: Annotated[
        int,
        Unit(
            "control periods",
            "control periods from one solution to the next",
            low=1,
            high=200,
            effect="higher values cost less time and react later",
        ),
    ]
    delay_periods: MeasurementAge
    interaction: InteractionGains | None = None

    @property
    def preview(self) -> tuple[float, ...]:
        """Times (s) after the held sample of the future samples that mode "plan"
        follows; empty in other modes.

        They are denser where stages are shorter, and a command that is late finds some
        beyond the horizon.
        """
        if self.mode != "plan":
            return ()
        return tuple(
            (self.horizon + LATE) * (k / self.stages) ** 1.5
            for k in range(1, self.stages + 1)
        )


LATE = 0.08
"""Time (s) by which the preview of a plan is longer than the horizon: as a held
sample may be old (20 ms), and commands late (12 periods of 5 ms)."""

EngineKey = tuple[
    Model, Weights, Bandwidths, str, int, float, int, float, InteractionGains | None
]
"""Cache key of the compiled functions of predictive control: constants, control period,
and gains of contact."""

KEPT = 16
"""Largest number of compiled predictive controllers in the cache; chosen. A miss
costs a tenth of a second or more (measured)."""


@positional
class PredictiveEngine:
    """Compiled functions of predictive control for one model and one set of constants,
    shared between flights.

    Attributes:
        key: constants that it was made of.
        solver, observation, bounds: solver of the plan, state estimator, bounds of the
            inputs.
        stabiliser: law while no plan is trusted. most: cost of a plan that is trusted.
        stance: shift of the base for the tip. contact: contact detection; None where
            the reference requests none.
    """

    key: EngineKey
    solver: Riccati
    observation: Observation
    bounds: Bounds
    stabiliser: Stabiliser
    most: float
    stance: Callable[[Array, Array], Array]
    contact: TipContact | None = None

    def __deepcopy__(self, _memo: dict[int, Any]) -> PredictiveEngine:
        # machine code is not copied
        return self


def engine_key(par: PredictiveParameters, dt: float, push: bool) -> EngineKey:
    """Cache key of the compiled functions of predictive control."""
    shape = par.mode, par.stages, par.horizon, par.every
    return (
        par.model,
        par.weights,
        par.bandwidths,
        *shape,
        dt,
        par.interaction if push else None,
    )


@lru_cache(maxsize=KEPT)
def make_engine(key: EngineKey) -> PredictiveEngine:
    """Compile the functions of predictive control for a cache key."""
    model, weights, bandwidths, mode, stages, horizon, every, dt, interaction = key
    vehicle, presses = model.vehicle, interaction is not None
    bounds = Bounds(
        float_array(joint.effort_limit for joint in vehicle.joints),
        float_array(rotor.max_speed for rotor in vehicle.rotors),
    )
    # rotor accelerations (rad/s^2) and joint torques (N m) of usual flights: nudges of
    # these sizes change the residuals alike
    scales = np.array([*(1000.0,) * len(vehicle.rotors), *(0.1,) * vehicle.n])
    compiled = CompiledStages(model, weights, mode, scales, presses)
    rollouts = Rollouts(model, weights, mode, bounds, presses)
    lengths = stage_lengths(stages, every, horizon, dt)
    return PredictiveEngine(
        key,
        Riccati(compiled, rollouts, lengths, float(weights.final), bounds),
        Observation(model, bandwidths, dt),
        bounds,
        Stabiliser(model),
        worst_cost(weights, mode, vehicle.n, horizon),
        make_stance(model, mode),
        None if interaction is None else TipContact(model, interaction, dt),
    )


def stage_lengths(stages: int, every: int, horizon: float, dt: float) -> Array:
    """Lengths (s) of the horizon's stages: control periods until the next plan, then a
    geometric growth.
    """
    powers = np.maximum(np.arange(stages) - every + 1, 0)
    # a stage is ten times the one before at most: where that is too little, the horizon
    # is shorter
    low, high = 1.0, 10.0
    # sixty halvings of the interval leave less than rounding
    for _ in range(60):
        factor = 0.5 * (low + high)
        low, high = (
            (factor, high) if dt * np.sum(factor**powers) < horizon else (low, factor)
        )
    return dt * low**powers


@immutable
class PredictiveMemory:
    """Internal state of predictive control: observer, last plan, reference sample and
    acceptance history.

    Attributes:
        engine: machine code. past: state of the observer. Both None before the first
            step.
        sent: commands that the last measurement does not show yet, oldest first, if
            they act at once.
        sample: held reference sample. plan: the last solution. since: control periods
            since it was made.
        trust: acceptance history of the plans. interaction: state of contact force
            control; None without contact.
        tip_force: force of a surface on the tip, N, world axes; None for a law that
            does not press.
    """

    engine: PredictiveEngine | None = None
    past: ObserverState | None = None
    sent: tuple[Command, ...] = ()
    sample: SampledReference | None = None
    plan: MotionPlan | None = None
    since: int = 0
    trust: Trust = Trust()
    interaction: InteractionMemory | None = None
    tip_force: Vec3 | None = None


def nmpc(
    memory: PredictiveMemory,
    measurement: Measurement,
    reference: Reference,
    dt: float,
    *,
    par: PredictiveParameters,
) -> tuple[PredictiveMemory, Command]:
    """Step of whole-body nonlinear model predictive control; accepts floats only."""
    key = engine_key(par, dt, bool(reference.push))
    engine = memory.engine
    if engine is None or engine.key != key:
        # plan, touch and loss may be of other stages, and of a contact that is
        # requested no more
        silent = None if par.interaction is None else ZERO3_DATA
        memory = replace(memory, plan=None, since=0, interaction=None, tip_force=silent)
        engine = make_engine(key)
    if par.preview and not reference.turning:
        raise ControllerError(
            "controller.mode = 'plan': must be left out without a reference of kind"
            ' "plan"'
        )
    past, sent = memory.past, memory.sent
    if past is None:
        past = engine.observation.first(measurement)
    elif len(sent) > par.delay_periods:
        # the first measurements are those of the start, repeated
        past = engine.observation.update(past, sent[0], measurement)
        sent = sent[1:]
    estimate, late = past.estimate, past.late.periods
    nx = len(estimate) - 6 - par.model.vehicle.n
    # the state in which the command of this period begins to act
    pending = (*past.shown[len(past.shown) - late :], *sent)
    x = engine.observation.now(estimate, [command_row(command) for command in pending])[
        :nx
    ]
    sample = update_sample(reference, memory.sample, dt)
    interaction = memory.interaction
    touch = None
    disturbance = estimate[nx:]
    if engine.contact is not None:
        signals = extrapolate(sample, np.array([sample.age]))[0, 0]
        interaction, touch = engine.contact.at(
            interaction, estimate, reference.push, signals
        )
        disturbance = np.array(touch.pressed)
    plan, since, trust = memory.plan, memory.since, memory.trust
    if plan is None or since >= par.every:
        problem = problem_at(
            engine, x, estimate[nx:], sample, float(late * dt), par, touch
        )
        plan = _solve_plan(engine, plan, since * dt, problem, par)
        since = 0
        trust = after_plan(trust, is_flyable(plan, engine.most))
    if trust.flies_plans:
        command = _command(engine, plan, since, x, dt)
    else:
        reading = doubles(leaves(measurement))
        command = engine.stabiliser.command(
            reading, bearable(disturbance, engine.bounds.efforts), sample
        )
    following = PredictiveMemory(
        engine=engine,
        past=past,
        sent=(*sent, command),
        sample=sample,
        plan=plan,
        since=since + 1,
        trust=after_period(trust, dt),
        interaction=interaction,
        tip_force=memory.tip_force if touch is None else Vec3(*touch.tip_force),
    )
    return following, command


def _standing(x: Array, par: PredictiveParameters) -> MotionPlan:
    """Initial guess of a plan: the vehicle at rest."""
    vehicle, stages = par.model.vehicle, par.stages
    # a state is position, quaternion, velocities (6), joints, their rates and rotors
    joints = tuple(x[13 : 13 + vehicle.n].tolist())
    inputs = [0.0] * len(vehicle.rotors) + [
        float(t) for t in level_joint_gravity(par.model, joints)
    ]
    still = x.copy()
    still[7:13], still[13 + vehicle.n : 13 + 2 * vehicle.n] = 0.0, 0.0
    nu = len(inputs)
    return MotionPlan(
        np.tile(still, (stages + 1, 1)),
        np.tile(inputs, (stages, 1)),
        np.zeros((stages, nu, len(x))),
    )


def _solve_plan(
    engine: PredictiveEngine,
    last: MotionPlan | None,
    passed: float,
    problem: Problem,
    par: PredictiveParameters,
) -> MotionPlan:
    """Solve for a new plan from the last one or, if that fails, from rest."""
    solver = engine.solver
    if last is not None and is_flyable(last, engine.most):
        with contextlib.suppress(NoPlanError):
            plan = solver.solve(problem, shift_plan(last, solver.steps, passed))
            if is_flyable(plan, engine.most):
                return plan
    # a plan that leads nowhere is a bad guess for the next one: begin from rest
    rest = _standing(problem.start, par)
    try:
        return solver.solve(problem, rest)
    except NoPlanError:
        return rest


def _command(
    engine: PredictiveEngine, plan: MotionPlan, stage: int, x: Array, dt: float
) -> Command:
    """Command of one stage of a plan, with state feedback, inverted motor lag and
    effort limits.
    """
    u = plan.u[stage] + plan.K[stage] @ (x - plan.x[stage])
    lags, most = engine.observation.motors, engine.bounds.efforts
    rotors = len(lags.most)
    speeds = command_for(lags, x[len(x) - rotors :], u[:rotors], dt)
    efforts = np.minimum(np.maximum(u[rotors:], -most), most)
    return Command(rotor_speeds=tuple(speeds.tolist()), efforts=tuple(efforts.tolist()))


WEIGHTS, BANDWIDTHS = Weights(), Bandwidths()

THRESHOLDS = (0.3, 0.1)
"""Default thresholds (N) of the force along the normal for contact of the tip and for
its loss."""


def make_predictive_controller(
    model: Model,
    *,
    mode: str = "tool",
    weights: Weights = WEIGHTS,
    bandwidths: Bandwidths = BANDWIDTHS,
    # to 0.65 s the last of 14 stages lasts 0.17 s, stable to joint dampings of 17 1/s
    stages: int = 14,
    horizon: float = 0.65,
    every: int = 2,
    delay_periods: int = 0,
    interaction: tuple[float, float] | None = None,
) -> Controller:
    """Make the whole-body predictive controller; its options are the fields of
    :class:`PredictiveParameters`.

    ``interaction``: N along the normal, above which the tip touches and below which it
    is lost; twice 0 for a law that ignores requested contact, as every law without a
    tip must. Left out: :data:`THRESHOLDS` with a tip.

    Raises:
        ControllerError: an option with a wrong value.
    """
    if mode not in MODES:
        raise ControllerError(
            f"controller.mode = {shown(mode)}: must be one of {list(MODES)}"
        )
    given = {
        "weights": weights,
        "bandwidths": bandwidths,
        "stages": stages,
        "horizon": horizon,
        "every": every,
    }
    given |= {"delay_periods": delay_periods, "mode": mode}
    options = {
        name: checked_option(PredictiveParameters, name, value, model)
        for name, value in given.items()
    }
    # at least one stage must grow to make up the horizon
    if options["every"] >= options["stages"]:
        raise ControllerError(
            f"controller.every = {every}: must be less than controller.stages ="
            f" {stages}"
        )
    leads = mode == "tool" and bool(model.vehicle.end_effector) and model.vehicle.n > 0
    if interaction is None:
        interaction = THRESHOLDS if leads else (0.0, 0.0)
    touch, lost = option_numbers("interaction", interaction, 2)
    if touch or lost:
        require_thresholds((touch, lost), leads, "tool")
    par = PredictiveParameters(
        model=model,
        mixer=make_mixer(model.vehicle),
        **options,
        interaction=InteractionGains(touch=touch, lost=lost) if touch or lost else None,
    )
    tip = mode == "tool"
    memory = PredictiveMemory(tip_force=None if par.interaction is None else ZERO3_DATA)
    return Controller(
        name="nmpc", law=nmpc, par=par, memory=memory, compiled=False, keeps_tip=tip
    )


LONGEST_ERROR = 0.15
"""Largest base position error (m) in the cost; a larger one is clipped, so that a step
does not saturate everything. Chosen, the error that a plan may have for a moment."""

WIDEST_ERROR = 1.5
"""Largest joint error (rad or m) in the cost; a larger one is clipped. Chosen."""

WIDEST_TURN = 1.0
"""Largest heading error (rad) in the cost, which takes its sine; a larger one is
clipped: at pi/2 the sine has no slope. Chosen."""

BEARABLE = 0.8
"""Largest predicted disturbance of a joint as a fraction of its drive's limit; the
remainder moves the arm. Chosen: a fifth is left to move against it."""


def problem_at(
    engine: PredictiveEngine,
    x: Array,
    disturbance: Array,
    sample: SampledReference,
    late: float,
    par: PredictiveParameters,
    touch: ContactState | None,
) -> Problem:
    """Optimal control problem whose initial state is ``late`` seconds ahead, when a new
    command takes effect.
    """
    later = late + np.append(0.0, np.cumsum(engine.solver.steps))
    planned = np.zeros((len(later), 0))
    if par.preview:
        motion, planned = planned_motion(
            sample, np.array(par.preview), sample.age + later
        )
    else:
        motion = extrapolate(sample, sample.age + later)
    model, pressed, gains = par.model, disturbance, par.interaction
    if touch is not None and gains is not None:
        motion[:, :, :3] += np.stack(shift_ahead(gains, touch, later))[
            :, :, None
        ] * np.array(touch.normal)
        disturbance, pressed = np.array(touch.free), np.array(touch.pressed)
    support = np.array([0.0, 0.0, float(model.gravity)]) - pressed[:3] / float(
        model.vehicle.mass
    )
    shift = engine.stance(motion[2, :, :3] + support, motion[0])
    targets = goals(motion, shift)
    # a step of the reference is approached as one of this size, which moves along
    error = x[:3] - targets[0, :3] - shift[0]
    distance = norm(error)
    if distance > LONGEST_ERROR:
        targets[:, :3] += error * (1.0 - LONGEST_ERROR / distance)
    # a goal's row: position, velocity, heading, then joints from 7 on
    # the turn on the shorter side, as headings may be turns apart
    off = float(np.angle(np.exp(1j * (_heading(x) - targets[0, 6]))))
    targets[:, 6] += off - np.clip(off, -WIDEST_TURN, WIDEST_TURN)
    joints = model.vehicle.n
    beyond = x[13 : 13 + joints] - targets[0, 7 : 7 + joints]
    targets[:, 7 : 7 + joints] += beyond - np.clip(beyond, -WIDEST_ERROR, WIDEST_ERROR)
    if touch is not None and gains is not None:
        targets = np.hstack([targets, contact_goals(gains, touch, later)])
    return Problem(
        x, bearable(disturbance, engine.bounds.efforts), np.hstack([targets, planned])
    )


def _heading(x: Array) -> float:
    """Heading (rad) of a state array.

    Not that of the blocks, whose arc tangent rounds otherwise for one in four headings.
    """
    w, a, b, c = x[3:7].tolist()
    return math.atan2(2.0 * (w * c + a * b), 1.0 - 2.0 * (b * b + c * c))


def bearable(disturbance: Array, most: Array) -> Array:
    """Disturbance with torques scaled down to what the joint actuators can balance;
    force unchanged.

    What pushes harder carries the arm away until it lies along the push. A torque
    foreseen as constant would spin it up over the whole horizon, and no plan would be
    found.
    """
    # no actuator balances a passive joint's load, and it is predicted as it is
    driven = most > 0.0
    share = np.max(
        np.abs(disturbance[6:][driven]) / (BEARABLE * most[driven]), initial=1.0
    )
    return (
        disturbance
        if share == 1.0
        else np.append(disturbance[:3], disturbance[3:] / share)
    )
