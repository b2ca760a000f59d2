"""Whole-body nonlinear model predictive control.

Law: every so many control periods (option ``every``) the motion of base, arm and rotors over a short horizon of growing
stages is chosen so that base, joints and tool follow the reference at little rotor acceleration; in between the
feedback u = u* + K (x - x*) of the solution acts. A disturbance observer makes it free of offset. The solution is warm
started from the last one, moved on in time. Commands that act late, frozen sensors and plans that lead nowhere are
detected (:mod:`.observer`, :mod:`.fallback`). A tip that presses is held by a surface whose force the plan predicts
(:mod:`.tip_contact`, :mod:`.cost`).

Assumptions: rigid bodies, rotors that lag, still air; what else pushes is one force and torque at the base and one
torque a joint, constant over the horizon. Position, velocity, acceleration of the *held samples* are extrapolated, as
every other law must (``preview="samples"``); a known trajectory may be given instead, which no other law has.

Tuning: ``weights``, ``bandwidths``, ``stages``, ``horizon``, ``every``. Not traceable.

Source: Diehl, Bock, Schloeder 2005 (real-time iteration); Tassa, Mansard, Todorov 2014 (line search). Weights, growing
stages and rates of rotor speeds as inputs are our own.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Vec3
from skyarm.compile import leaves
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.law_maker import checked_option, option_numbers
from skyarm.control.laws.centroidal.interaction import InteractionGains, interaction_gains
from skyarm.control.laws.paper import level_joint_gravity
from skyarm.control.laws.predictive.cost import MODES, Weights
from skyarm.control.laws.predictive.fallback import Stabiliser, Trust, after_period, after_plan, is_flyable, worst_cost
from skyarm.control.laws.predictive.observer import (
    LONGEST,
    Bandwidths,
    Fresh,
    Lateness,
    Observation,
    detect_stale,
    fill_stale,
    first_lateness,
    taken_over,
    update_lateness,
)
from skyarm.control.laws.predictive.prediction import Motors, command_for, motors, speeds_under
from skyarm.control.laws.predictive.preview import Sample, Stance, extrapolate, goals, sample_trajectory, update_sample
from skyarm.control.laws.predictive.solver import (
    Bounds,
    NoPlanError,
    Plan,
    Problem,
    Riccati,
    Rollouts,
    Stages,
    shift_plan,
)
from skyarm.control.laws.predictive.tip_contact import TipContact, Touch, contact_goals, shift_ahead
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command, Mixer, make_mixer
from skyarm.records.files import shown
from skyarm.records.units import Unit
from skyarm.reference import Reference, Trajectory
from skyarm.sensing.measurement import Measurement

WEIGHTS = Weights(
    position=10.0,
    velocity=2.0,
    heading=2.0,
    rate=0.2,
    joints=5.0,
    joint_rates=0.2,
    joint_accelerations=0.005,
    tool=50.0,
    rotor_accelerations=3e-4,
    final=0.2,
)

BANDWIDTHS = Bandwidths(linear=25.0, angular=30.0, joints=40.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictiveParameters:
    """Constants of the law.

    Attributes:
        model: the belief. mixer: of the belief; the law does not use it.
        weights, mode: of the cost. bandwidths: of the observer.
        stages: of the horizon, which grow by one factor from the ``every``-th on. horizon: s.
        every: control periods from one solution to the next. delay_periods: known age of measurements, control periods.
        preview: "samples", or the trajectory if it is known.
        interaction: of pressing on surfaces; None for a law that knows nothing of a push.
    """

    model: Model
    mixer: Mixer
    weights: Weights
    bandwidths: Bandwidths
    mode: str
    stages: Annotated[int, Unit("", low=2, high=200)]
    horizon: Annotated[float, Unit("s", low=0.05, high=5.0)]
    every: Annotated[int, Unit("control periods", "from one solution to the next", low=1, high=200)]
    delay_periods: Annotated[int, Unit("control periods", "known age of the measurement", low=0, high=100)]
    preview: str | Trajectory
    interaction: InteractionGains | None = None


Array = npt.NDArray[np.float64]

KEPT = 16
"""Beliefs whose machine code is kept in memory."""


@dataclass(frozen=True, slots=True)
class Engine:
    """Compiled parts of the law, without memory of a flight: copies of a flight share them.

    Attributes:
        solver, observation, motors, bounds: those.
        stabiliser: what flies while no plan is trusted. most: cost of a plan that is trusted.
        stance: where the base stands aside for the tip. contact: of the tip; None where no reference asks for any.
    """

    solver: Riccati
    observation: Observation
    motors: Motors
    bounds: Bounds
    stabiliser: Stabiliser
    most: float
    stance: Stance
    contact: TipContact | None = None

    def __deepcopy__(self, _memo: dict[int, Any]) -> Engine:
        return self  # machine code is not copied


@dataclass(frozen=True, slots=True)
class Purpose:
    """Key of an engine: constants, the control period in s, and whether the reference may request contact."""

    par: PredictiveParameters
    dt: float
    push: bool

    def __deepcopy__(self, _memo: dict[int, Any]) -> Purpose:
        return self  # so that the next period knows its constants by identity

    @property
    def made_of(self) -> tuple[Any, ...]:
        """All that the engine is made of."""
        par = self.par
        shape = par.mode, par.stages, par.horizon, par.every
        return par.model, par.weights, par.bandwidths, *shape, self.dt, par.interaction if self.push else None

    def serves(self, other: Purpose) -> bool:
        """Return True if an engine that is made for this does for another."""
        same = self.par is other.par and (self.dt, self.push) == (other.dt, other.push)
        return same or self.made_of == other.made_of


def engine_for(par: PredictiveParameters, dt: float, push: bool = False) -> Engine:
    """The engine of a law at a control period of ``dt`` s; with ``push`` the reference may request contact."""
    return _engine(*Purpose(par, dt, push).made_of)


@lru_cache(maxsize=KEPT)
def _engine(
    model: Model,
    weights: Weights,
    bandwidths: Bandwidths,
    mode: str,
    stages: int,
    horizon: float,
    every: int,
    dt: float,
    interaction: InteractionGains | None,
) -> Engine:
    vehicle = model.vehicle
    steps = stage_lengths(stages, every, horizon, dt)
    bounds = Bounds(
        np.array([float(link.joint.effort_limit) for link in vehicle.links]),
        np.array([float(rotor.max_speed) for rotor in vehicle.rotors]),
    )
    scales = np.array([*(1000.0,) * len(vehicle.rotors), *(0.1,) * vehicle.n])
    presses = interaction is not None
    compiled = Stages(model, weights, mode, scales, presses)
    rollouts = Rollouts(model, weights, mode, bounds, presses)
    made = Riccati(compiled, rollouts, steps, float(weights.final), bounds)
    most = worst_cost(weights, mode, vehicle.n, horizon)
    seen = Observation(model, bandwidths, dt)
    contact = TipContact(model, interaction, dt) if interaction is not None else None
    lags = motors(vehicle.rotors, dt)
    return Engine(made, seen, lags, bounds, Stabiliser(model), most, Stance(model, mode), contact)


def stage_lengths(stages: int, every: int, horizon: float, dt: float) -> Array:
    """Lengths of the stages, s: control periods until the next solution, then growing by one factor."""
    powers = np.maximum(np.arange(stages) - every + 1, 0)
    low, high = 1.0, 10.0
    for _ in range(60):
        factor = 0.5 * (low + high)
        low, high = (factor, high) if dt * np.sum(factor**powers) < horizon else (low, factor)
    return np.asarray(dt * low**powers)


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictiveMemory:
    """Memory between two steps; all None before the first.

    Attributes:
        engine: machine code. purpose: what it was made for.
        estimate: leaves of :class:`skyarm.control.laws.predictive.observer.Estimate` at the last measurement.
        sent: commands that it does not show yet, oldest first, if they act at once.
        shown: the last ones before them. late: what tells how late they really act.
        fresh: the last measurement as it came, and for how long it has been the same.
        sample: of the reference. plan: the last solution. since: control periods since it was made.
        trust: in the plans. interaction: leaves of the memory of touch and loss.
        tip_force: N, world axes, of a surface on the tip; None of a law that does not press.
    """

    engine: Engine | None = None
    purpose: Purpose | None = None
    estimate: Array | None = None
    sent: tuple[Command, ...] = ()
    shown: tuple[Command, ...] = ()
    late: Lateness | None = None
    fresh: Fresh | None = None
    sample: Sample | None = None
    plan: Plan | None = None
    since: int = 0
    trust: Trust | None = None
    interaction: Array | None = None
    tip_force: Vec3 | None = None


def nmpc(
    memory: PredictiveMemory, measurement: Measurement, reference: Reference, dt: float, *, par: PredictiveParameters
) -> tuple[PredictiveMemory, Command]:
    """Whole-body nonlinear model predictive control; see the module. Takes floats only."""
    presses = bool(reference.push) and par.interaction is not None
    memory, engine = _prepare_engine(memory, Purpose(par, dt, presses))
    seen = _estimate_state(engine, memory, measurement, par, dt)
    estimate, sent, late = seen.estimate, seen.sent, seen.late.periods
    nx = len(estimate) - 6 - par.model.vehicle.n
    # the state in which the command of this period begins to act
    pending = (*seen.shown[len(seen.shown) - late :], *sent)
    x = engine.observation.now(estimate, [_row(command) for command in pending])[:nx]
    sample = update_sample(reference, memory.sample, dt)
    interaction, touch, known = memory.interaction, None, estimate[nx:]
    if presses and engine.contact is not None:
        wanted = extrapolate(sample, np.array([sample.age]))[0][0]
        interaction, touch = engine.contact.at(interaction, estimate, reference.push, wanted)
        known = np.array(touch.pressed)
    plan, since, trust = memory.plan, memory.since, memory.trust or Trust()
    if plan is None or since >= par.every:
        now = measurement.time + par.delay_periods * dt
        problem = problem_at(engine, x, estimate[nx:], sample, now, late * dt, par, touch)
        plan, since = _solve_plan(engine, plan, since * dt, problem, par), 0
        trust = after_plan(trust, is_flyable(plan, engine.most))
    if trust.flies_plans:
        command = _command(engine, plan, since, x, dt)
    else:
        known = bearable(known, engine.bounds.efforts)
        command = engine.stabiliser.command(seen.reading, known, sample)
    following = PredictiveMemory(
        engine=engine,
        purpose=memory.purpose,
        estimate=estimate,
        sent=(*sent, command),
        shown=seen.shown,
        late=seen.late,
        fresh=seen.fresh,
        sample=sample,
        plan=plan,
        since=since + 1,
        trust=after_period(trust, dt),
        interaction=interaction,
        tip_force=memory.tip_force if touch is None else Vec3(*touch.tip_force),
    )
    return following, command


def _prepare_engine(memory: PredictiveMemory, purpose: Purpose) -> tuple[PredictiveMemory, Engine]:
    """Memory and engine of a period: where a flight has changed what the engine was made for, a new one.

    Plan, touch and loss are then forgotten: they may be of other stages, and of a contact that nobody asks for.
    """
    if memory.engine is None:
        return dataclasses.replace(memory, purpose=purpose), engine_for(purpose.par, purpose.dt, purpose.push)
    if memory.purpose is None or memory.purpose.serves(purpose):
        return dataclasses.replace(memory, purpose=purpose), memory.engine
    silent = None if purpose.par.interaction is None else Vec3(0.0, 0.0, 0.0)
    forgotten = dataclasses.replace(memory, purpose=purpose, plan=None, since=0, interaction=None, tip_force=silent)
    return forgotten, engine_for(purpose.par, purpose.dt, purpose.push)


def _row(command: Command) -> Array:
    return np.array([*command.rotor_speeds, *command.efforts], dtype=float)


@dataclass(frozen=True, slots=True)
class Seen:
    """Results of a measurement, see :class:`PredictiveMemory`, and the measurement with frozen parts predicted."""

    estimate: Array
    sent: tuple[Command, ...]
    shown: tuple[Command, ...]
    late: Lateness
    fresh: Fresh | None
    reading: Array


def _estimate_state(
    engine: Engine, memory: PredictiveMemory, measurement: Measurement, par: PredictiveParameters, dt: float
) -> Seen:
    """Estimate at the measurement, and the commands before and after it."""
    reading = np.array(leaves(measurement), dtype=float)
    speeds = np.array(measurement.rotor_speeds, dtype=float)
    known = memory.late or first_lateness(speeds)
    if memory.estimate is None:
        return Seen(_first(measurement, par.model.vehicle.n), (), (), known, None, reading)
    if len(memory.sent) <= par.delay_periods:
        # the first measurements are those of the start, seen again
        return Seen(memory.estimate, memory.sent, memory.shown, known, memory.fresh, reading)
    shown = (*memory.shown, memory.sent[0])[-1 - LONGEST :]
    modelled = speeds_under(engine.motors, known.modelled[0], np.array(memory.sent[0].rotor_speeds))
    stopped = memory.fresh is not None and np.array_equal(memory.fresh.reading[-len(speeds) :], speeds)
    late = update_lateness(known, modelled, None if stopped else speeds, dt)
    stuck = detect_stale(memory.fresh, reading, par.model.vehicle.n)
    fresh = Fresh(reading.copy(), stuck.silent)
    acted = _row(shown[max(len(shown) - 1 - late.periods, 0)])
    # of the quaternion's two signs the one that is nearer to the last
    if reading[4:8] @ memory.estimate[3:7] < 0.0:
        reading[4:8] *= -1.0
    if stuck.parts:
        foreseen = engine.observation.now(memory.estimate, [acted])
        reading = fill_stale(reading, foreseen, stuck.parts, par.model.vehicle.n)
    estimate = engine.observation.at(memory.estimate, acted, reading)
    if stuck.spoke_again:
        estimate = taken_over(estimate, memory.estimate, reading, par.model.vehicle.n)
    return Seen(estimate, memory.sent[1:], shown, late, fresh, reading)


def _first(measurement: Measurement, joints: int) -> Array:
    """Initial estimate at the first measurement: no disturbance."""
    m = measurement
    moving = (*m.position, *m.quaternion, *m.velocity, *m.rate, *m.joints, *m.joint_rates, *m.rotor_speeds)
    return np.array([*moving, *(0.0,) * (6 + joints)], dtype=float)


def _standing(x: Array, par: PredictiveParameters) -> Plan:
    """The first guess: nothing moves."""
    vehicle, stages = par.model.vehicle, par.stages
    joints = tuple(x[13 : 13 + vehicle.n].tolist())
    held = [0.0] * len(vehicle.rotors) + [float(t) for t in level_joint_gravity(par.model, joints)]
    still = x.copy()
    still[7:13], still[13 + vehicle.n : 13 + 2 * vehicle.n] = 0.0, 0.0
    nu = len(held)
    return Plan(np.tile(still, (stages + 1, 1)), np.tile(held, (stages, 1)), np.zeros((stages, nu, len(x))))


def _solve_plan(engine: Engine, last: Plan | None, passed: float, problem: Problem, par: PredictiveParameters) -> Plan:
    """A new plan: from the last one, or, if that leads nowhere, from rest."""
    solver = engine.solver
    if last is not None and is_flyable(last, engine.most):
        with contextlib.suppress(NoPlanError):
            plan = solver.solve(problem, shift_plan(last, solver.steps, passed))
            if is_flyable(plan, engine.most):
                return plan
    rest = _standing(problem.start, par)
    try:
        return solver.solve(problem, rest)
    except NoPlanError:
        return rest


def _command(engine: Engine, plan: Plan, stage: int, x: Array, dt: float) -> Command:
    """Inputs of a stage with its feedback, as the actuators take them."""
    u = plan.u[stage] + plan.K[stage] @ (x - plan.x[stage])
    rotors, most = len(engine.motors.most), engine.bounds.efforts
    speeds = command_for(engine.motors, x[len(x) - rotors :], u[:rotors], dt)
    efforts = np.minimum(np.maximum(u[rotors:], -most), most)
    return Command(rotor_speeds=tuple(speeds.tolist()), efforts=tuple(efforts.tolist()))


THRESHOLDS = (0.3, 0.1)
"""N along the normal, above which a tip touches and below which it is lost, where nobody says others."""


def make_predictive_controller(
    model: Model,
    *,
    mode: str = "tool",
    weights: Weights = WEIGHTS,
    bandwidths: Bandwidths = BANDWIDTHS,
    stages: int = 14,
    horizon: float = 0.65,
    every: int = 2,
    delay_periods: int = 0,
    preview: str | Trajectory = "samples",
    interaction: tuple[float, float] | None = None,
) -> Controller:
    """Whole-body model predictive control; the options are those of :class:`PredictiveParameters`.

    ``interaction``: N along the normal, above which the tip touches and below which it is lost; twice 0 for a law that
    knows nothing of a push, and the only pair allowed where no tip is led. Left out: :data:`THRESHOLDS` where one is.

    Raises:
        ControllerError: an option with a wrong value.
    """
    if mode not in MODES:
        raise ControllerError(f"controller.mode = {shown(mode)}: must be one of {list(MODES)}")
    given = {"weights": weights, "bandwidths": bandwidths, "stages": stages, "horizon": horizon, "every": every}
    given |= {"delay_periods": delay_periods, "mode": mode}
    held = {name: checked_option(PredictiveParameters, name, value, model) for name, value in given.items()}
    if held["every"] >= held["stages"]:
        raise ControllerError(f"controller.every = {every}: must be less than controller.stages = {stages}")
    if not isinstance(preview, Trajectory) and preview != "samples":
        raise ControllerError(f"controller.preview = {shown(preview)}: must be 'samples' or a Trajectory")
    leads = mode == "tool" and bool(model.vehicle.end_effector) and model.vehicle.n > 0
    if interaction is None:
        interaction = THRESHOLDS if leads else (0.0, 0.0)
    touch, lost = option_numbers("interaction", interaction, 2)
    par = PredictiveParameters(
        model=model,
        mixer=make_mixer(model.vehicle),
        preview=preview,
        **held,
        interaction=interaction_gains((touch, lost), "tool" if leads else "joints", model.vehicle, leading="tool"),
    )
    tip = mode == "tool"
    memory = PredictiveMemory(tip_force=None if par.interaction is None else Vec3(0.0, 0.0, 0.0))
    return Controller(name="nmpc", law=nmpc, par=par, memory=memory, compiled=False, keeps_tip=tip)


LONGEST_ERROR = 0.15
"""m: a base further from its reference is asked to come this near only, so that a step does not saturate everything."""

WIDEST_ERROR = 1.5
"""rad or m: the same for a joint."""

WIDEST_TURN = 1.0
"""rad: the same for the heading, whose cost is of the sine."""

BEARABLE = 0.8
"""Share of a drive's limit that a disturbance is foreseen to take at most; the rest moves the arm."""


def problem_at(
    engine: Engine,
    x: Array,
    disturbance: Array,
    sample: Sample,
    time: float,
    late: float,
    par: PredictiveParameters,
    touch: Touch | None = None,
) -> Problem:
    """The problem from the state ``late`` s after now, when a command begins to act."""
    later = late + np.append(0.0, np.cumsum(engine.solver.steps))
    if isinstance(par.preview, Trajectory):
        signals = sample_trajectory(par.preview, time + later)
    else:
        signals = extrapolate(sample, sample.age + later)
    model, pressed = par.model, disturbance
    if touch is not None and engine.contact is not None:
        along = shift_ahead(engine.contact.gains, touch, later)
        places, rates, bends = (along_normal(*each, touch.normal) for each in zip(signals, along, strict=True))
        signals = places, rates, bends
        disturbance, pressed = np.array(touch.free), np.array(touch.pressed)
    held = np.array([0.0, 0.0, float(model.gravity)]) - pressed[:3] / float(model.vehicle.mass)
    shift = engine.stance.at(signals[2][:, :3] + held, signals[0])
    wanted = goals(*signals, shift)
    # a step of the reference is approached as one of this size, which moves along
    error = x[:3] - wanted[0, :3] - shift[0]
    distance = float(np.linalg.norm(error))
    if distance > LONGEST_ERROR:
        wanted[:, :3] += error * (1.0 - LONGEST_ERROR / distance)
    off = float(np.angle(np.exp(1j * (_heading(x) - wanted[0, 6]))))
    wanted[:, 6] += off - np.clip(off, -WIDEST_TURN, WIDEST_TURN)
    joints = model.vehicle.n
    beyond = x[13 : 13 + joints] - wanted[0, 7 : 7 + joints]
    wanted[:, 7 : 7 + joints] += beyond - np.clip(beyond, -WIDEST_ERROR, WIDEST_ERROR)
    if touch is not None and engine.contact is not None:
        wanted = np.hstack([wanted, contact_goals(engine.contact.gains, touch, later)])
    return Problem(x, bearable(disturbance, engine.bounds.efforts), wanted)


def along_normal(signals: Array, way: Array, normal: Sequence[float]) -> Array:
    """Signals (T, 4 + joints) whose place is moved along a normal by ``way`` (T,)."""
    found = signals.copy()
    found[:, :3] += way[:, None] * np.array(normal)
    return found


def _heading(x: Array) -> float:
    """Heading of a state, rad."""
    w, a, b, c = x[3:7].tolist()
    return math.atan2(2.0 * (w * c + a * b), 1.0 - 2.0 * (b * b + c * c))


def bearable(disturbance: Array, most: Array) -> Array:
    """A disturbance whose torques the arm can hold; its force as it is.

    What pushes harder carries the arm away until it lies along the push. A torque foreseen as constant would spin it
    up over the whole horizon, and no plan would be found.
    """
    driven = most > 0.0  # no actuator balances a passive joint's load, and it is predicted as it is
    share = np.max(np.abs(disturbance[6:][driven]) / (BEARABLE * most[driven]), initial=1.0)
    return disturbance if share == 1.0 else np.append(disturbance[:3], disturbance[3:] / share)
