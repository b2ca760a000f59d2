"""Whole-body nonlinear model predictive control.

Law: every so many control periods (option ``every``) the motion of base, arm and rotors over a short horizon of growing
stages is chosen so that base, joints and tool follow the reference at little rotor acceleration; in between the
feedback u = u* + K (x - x*) of the solution acts. A disturbance observer makes it free of offset. The solution is warm
started from the last one, moved on in time.

Assumptions: rigid bodies, rotors that lag, still air; what else pushes is one force and torque at the base and one
torque a joint, constant over the horizon. Position, velocity, acceleration of the *held samples* are extrapolated, as
every other law must (``preview="samples"``); a known trajectory may be given instead, which no other law has.

Tuning: ``weights``, ``bandwidths``, ``stages``, ``horizon``, ``every``. Not over scalars: it cannot be traced.

Source: Diehl, Bock, Schloeder 2005 (real-time iteration); Vanroye et al. 2023 (fatrop, the other solver); observer
:mod:`skyarm.control.predictive.observer`. Weights, growing stages and rates of rotor speeds as inputs are our own.
"""

from __future__ import annotations

import dataclasses
import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import Command, Mixer, make_mixer
from skyarm.compile import Program, leaves, rebuild, trace
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.laws import level_joint_gravity
from skyarm.control.model import Model
from skyarm.control.predictive import preview as ahead
from skyarm.control.predictive.cost import MODES, Weights
from skyarm.control.predictive.linearise import Stages, examples
from skyarm.control.predictive.motion import command_for
from skyarm.control.predictive.observer import Bandwidths, Estimate, observe, predict
from skyarm.control.predictive.solve import Bounds, Plan, Problem, Riccati, Solver, shifted
from skyarm.control.rivals.options import positive
from skyarm.dynamics import State
from skyarm.dynamics.measurement import Measurement, blank_measurement
from skyarm.files import shown
from skyarm.reference import Reference, Trajectory
from skyarm.vehicle.records import Vehicle

Array = npt.NDArray[np.float64]

SOLVERS = ("riccati", "fatrop", "ipopt")

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

LONGEST_ERROR = 0.15
"""m: a base further from its reference is asked to come this near only, so that a step does not saturate everything.

Single iterations lose a step of 0.3 m, where torques and rotors saturate together; 0.2 m they fly.
"""

MOST_STAGES = 200

BANDWIDTHS = Bandwidths(linear=25.0, angular=30.0, joints=40.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictiveParameters:
    """Constants of the law.

    Attributes:
        model: the belief. mixer: of the belief; the law does not use it.
        weights, mode: of the cost. bandwidths: of the observer.
        solver: "riccati", "fatrop" or "ipopt".
        stages: of the horizon, which grow by one factor from the ``every``-th on. horizon: s.
        every: control periods from one solution to the next. delay_periods: known age of measurements, control periods.
        preview: "samples", or the trajectory if it is known.
    """

    model: Model
    mixer: Mixer
    weights: Weights
    bandwidths: Bandwidths
    mode: str
    solver: str
    stages: int
    horizon: float
    every: int
    delay_periods: int
    preview: str | Trajectory


@dataclass(frozen=True, slots=True)
class Engine:
    """Programs of a law, made at its first step."""

    solver: Solver
    observe: Program
    predict: Program
    state: State


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictiveMemory:
    """What one step hands to the next; all None before the first.

    Attributes:
        engine: programs. estimate: at the last measurement. sent: commands that it does not show yet, oldest first.
        sample: of the reference. plan: the last solution. since: control periods since it was made.
    """

    engine: Engine | None = None
    estimate: Estimate | None = None
    sent: tuple[Command, ...] = ()
    sample: ahead.Sample | None = None
    plan: Plan | None = None
    since: int = 0


def make_predictive_controller(
    model: Model,
    *,
    mode: str = "tool",
    solver: str = "riccati",
    weights: Weights = WEIGHTS,
    bandwidths: Bandwidths = BANDWIDTHS,
    stages: int = 14,
    horizon: float = 0.65,
    every: int = 2,
    delay_periods: int = 0,
    preview: str | Trajectory = "samples",
) -> Controller:
    """Whole-body model predictive control of a belief; the options are those of :class:`PredictiveParameters`.

    Raises:
        ControllerError: an option with a wrong value, or solver "fatrop" or "ipopt" without the extra 'casadi'.
    """
    for name, value, allowed in (("mode", mode, MODES), ("solver", solver, SOLVERS)):
        if value not in allowed:
            raise ControllerError(f"controller.{name} = {shown(value)}: must be one of {list(allowed)}")
    for name, count, least, most in (
        ("stages", stages, 2, MOST_STAGES),
        ("every", every, 1, MOST_STAGES),
        ("delay_periods", delay_periods, 0, 100),
    ):
        if not isinstance(count, int) or isinstance(count, bool) or not least <= count <= most:
            raise ControllerError(f"controller.{name} = {shown(count)}: must be a whole number from {least} to {most}")
    if every >= stages:
        raise ControllerError(f"controller.every = {every}: must be less than controller.stages = {stages}")
    if not isinstance(preview, Trajectory) and preview != "samples":
        raise ControllerError(f"controller.preview = {shown(preview)}: must be 'samples' or a Trajectory")
    if not isinstance(horizon, (int, float)) or isinstance(horizon, bool) or not 0.05 <= horizon <= 5.0:
        raise ControllerError(f"controller.horizon = {shown(horizon)}: must be a number of s from 0.05 to 5")
    _require_numbers("weights", weights, Weights, zero=True)
    _require_numbers("bandwidths", bandwidths, Bandwidths)
    if solver != "riccati":
        _require_casadi(solver)
    par = PredictiveParameters(
        model=model,
        mixer=make_mixer(model.vehicle),
        weights=weights,
        bandwidths=bandwidths,
        mode=mode,
        solver=solver,
        stages=stages,
        horizon=float(horizon),
        every=every,
        delay_periods=delay_periods,
        preview=preview,
    )
    return Controller(name="nmpc", law=nmpc, par=par, memory=PredictiveMemory(), compiled=False)


def _require_numbers(name: str, record: Any, kind: type, *, zero: bool = False) -> None:
    """A record of the kind whose numbers are above zero (or at least zero)."""
    if not isinstance(record, kind):
        raise ControllerError(f"controller.{name} = {shown(record)}: must be {kind.__name__}")
    for field in dataclasses.fields(kind):
        positive(f"{name}.{field.name}", getattr(record, field.name), zero=zero)


def _require_casadi(solver: str) -> None:
    """Say now, not in flight, that a library is missing."""
    try:
        importlib.import_module("skyarm.compile.casadi_shooting")
    except ImportError as error:
        raise ControllerError(f"controller.solver = '{solver}': {error}, or take solver 'riccati'") from None


def nmpc(
    memory: PredictiveMemory, measurement: Measurement, reference: Reference, dt: float, *, par: PredictiveParameters
) -> tuple[PredictiveMemory, Command]:
    """Whole-body nonlinear model predictive control; see the module. Takes floats only."""
    engine = memory.engine or _engine(par, dt)
    estimate, sent = _estimated(engine, memory, measurement, dt, par)
    now = estimate.state
    for command in sent:
        now = engine.predict(Estimate(state=now, disturbance=estimate.disturbance), command, (dt,))
    x = np.array(leaves(now))
    sample = ahead.taken(reference, memory.sample, dt)
    plan, since = memory.plan, memory.since
    if plan is None or since >= par.every:
        guess = _standing(engine, x, par) if plan is None else shifted(plan, engine.solver.steps, since * dt)
        plan, since = _solved(engine, guess, x, estimate, sample, measurement.time + par.delay_periods * dt, par), 0
    command = _command(par, plan, since, x, dt)
    following = PredictiveMemory(
        engine=engine,
        estimate=estimate,
        sent=(*sent, command),
        sample=sample,
        plan=plan,
        since=since + 1,
    )
    return following, command


def _engine(par: PredictiveParameters, dt: float) -> Engine:
    """Trace and compile what the law needs."""
    model = par.model
    vehicle = model.vehicle
    state, _, disturbance, _ = examples(vehicle.n, len(vehicle.rotors))
    estimate = Estimate(state=state, disturbance=disturbance)
    command = Command(rotor_speeds=state.rotor_speeds, efforts=state.joints)
    reading = blank_measurement(vehicle.n, len(vehicle.rotors))
    steps = stage_lengths(par, dt)
    bounds = Bounds(
        np.array([float(link.joint.effort_limit) for link in vehicle.links]),
        np.array([float(rotor.max_speed) for rotor in vehicle.rotors]),
    )
    scales = np.array([*(1000.0,) * len(vehicle.rotors), *(0.1,) * vehicle.n])
    compiled = Stages(model, par.weights, par.mode, scales)
    solver: Solver
    if par.solver == "riccati":
        solver = Riccati(compiled, steps, float(par.weights.final), bounds)
    else:
        from skyarm.control.predictive.interior_point import InteriorPoint

        solver = InteriorPoint(par.solver, model, par.weights, par.mode, compiled, steps, bounds)
    return Engine(
        solver,
        trace(lambda e, c, m, t: observe(model, par.bandwidths, e, c, m, t[0]), estimate, command, reading, (dt,)),
        trace(lambda e, c, t: predict(model, e, c, t[0]), estimate, command, (dt,)),
        state,
    )


def stage_lengths(par: PredictiveParameters, dt: float) -> Array:
    """Lengths of the stages, s: control periods until the next solution, then growing by one factor."""
    powers = np.maximum(np.arange(par.stages) - par.every + 1, 0)
    low, high = 1.0, 10.0
    for _ in range(60):
        factor = 0.5 * (low + high)
        low, high = (factor, high) if dt * np.sum(factor**powers) < par.horizon else (low, factor)
    return np.asarray(dt * low**powers)


def _estimated(
    engine: Engine, memory: PredictiveMemory, measurement: Measurement, dt: float, par: PredictiveParameters
) -> tuple[Estimate, tuple[Command, ...]]:
    """Estimate at the measurement, and the commands that came after it."""
    dense = rebuild(measurement, iter([float(value) for value in leaves(measurement)]))
    if memory.estimate is None:
        return _first(engine, dense, par.model.vehicle), ()
    if len(memory.sent) <= par.delay_periods:
        # the first measurements are those of the start, seen again
        return memory.estimate, memory.sent
    estimate: Estimate = engine.observe(memory.estimate, memory.sent[0], _near(dense, memory.estimate), (dt,))
    return estimate, memory.sent[1:]


def _near(measurement: Measurement, before: Estimate) -> Measurement:
    """The measurement with that sign of its quaternion which is nearer to the last one."""
    if sum(a * b for a, b in zip(measurement.quaternion, before.state.quaternion, strict=True)) >= 0.0:
        return measurement
    flipped = type(measurement.quaternion)(*(-c for c in measurement.quaternion))
    return dataclasses.replace(measurement, quaternion=flipped)


def _first(engine: Engine, measurement: Measurement, vehicle: Vehicle) -> Estimate:
    """What is believed at the first measurement: no disturbance."""
    m = measurement
    state = dataclasses.replace(
        engine.state,
        position=m.position,
        quaternion=m.quaternion,
        velocity=m.velocity,
        rate=m.rate,
        joints=m.joints,
        joint_rates=m.joint_rates,
        rotor_speeds=m.rotor_speeds,
    )
    _, _, nothing, _ = examples(vehicle.n, len(vehicle.rotors))
    return Estimate(state=state, disturbance=nothing)


def _standing(engine: Engine, x: Array, par: PredictiveParameters) -> Plan:
    """The first guess: nothing moves."""
    vehicle, stages = par.model.vehicle, par.stages
    joints = tuple(x[13 : 13 + vehicle.n].tolist())
    held = [0.0] * len(vehicle.rotors) + [float(t) for t in level_joint_gravity(par.model, joints)]
    still = x.copy()
    still[7:13], still[13 + vehicle.n : 13 + 2 * vehicle.n] = 0.0, 0.0
    nu = len(held)
    return Plan(np.tile(still, (stages + 1, 1)), np.tile(held, (stages, 1)), np.zeros((stages, nu, len(x))))


def _solved(
    engine: Engine,
    guess: Plan,
    x: Array,
    estimate: Estimate,
    sample: ahead.Sample,
    time: float,
    par: PredictiveParameters,
) -> Plan:
    """A new plan from the state now."""
    later = np.append(0.0, np.cumsum(engine.solver.steps))
    if isinstance(par.preview, Trajectory):
        signals = ahead.known(par.preview, time + later)
    else:
        signals = ahead.extrapolated(sample, sample.age + later)
    wanted = ahead.goals(*signals)
    # a step of the reference is approached as one of this size, which moves along
    error = x[:3] - wanted[0, :3]
    distance = float(np.linalg.norm(error))
    if distance > LONGEST_ERROR:
        wanted[:, :3] += error * (1.0 - LONGEST_ERROR / distance)
    problem = Problem(x, np.array(leaves(estimate.disturbance)), wanted)
    # a problem without a solution leaves the old plan, which the next solution begins from; the episode goes on or ends
    try:
        with np.errstate(all="ignore"):
            found = engine.solver.solve(problem, guess)
    except np.linalg.LinAlgError:
        return guess
    return found if np.isfinite(found.x).all() and np.isfinite(found.K).all() else guess


def _command(par: PredictiveParameters, plan: Plan, stage: int, x: Array, dt: float) -> Command:
    """Inputs of a stage with its feedback, as the actuators take them."""
    vehicle = par.model.vehicle
    u = plan.u[stage] + plan.K[stage] @ (x - plan.x[stage])
    rotors = len(vehicle.rotors)
    speeds = x[len(x) - rotors :]
    limits = [float(link.joint.effort_limit) for link in vehicle.links]
    return Command(
        rotor_speeds=tuple(
            float(command_for(rotor, float(w), float(a), dt))
            for rotor, w, a in zip(vehicle.rotors, speeds, u[:rotors], strict=True)
        ),
        efforts=tuple(float(min(max(t, -high), high)) for t, high in zip(u[rotors:], limits, strict=True)),
    )
