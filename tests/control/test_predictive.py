"""Model predictive control: each part against an oracle of its own, then flights."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import least_squares

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import trace
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import ControllerError
from skyarm.control.laws.predictive import preview
from skyarm.control.laws.predictive.cost import (
    input_residuals,
    predict_stage,
    state_residuals,
)
from skyarm.control.laws.predictive.law import (
    WEIGHTS,
    engine_key,
    make_engine,
    stage_lengths,
)
from skyarm.control.laws.predictive.observer import (
    Bandwidths,
    Estimate,
    observe,
    predict,
)
from skyarm.control.laws.predictive.prediction import (
    StageInputs,
    command_for,
    integrate_stage,
    motors,
    speeds_under,
)
from skyarm.control.laws.predictive.solver import (
    Bounds,
    CompiledStages,
    Linear,
    MotionPlan,
    NoPlanError,
    Policy,
    Problem,
    Riccati,
    Rollouts,
    examples,
    next_damping,
    policy,
    rollout,
    shift_plan,
)
from skyarm.control.model import Model
from skyarm.control.onboard.export_c import export_c
from skyarm.dynamics.actuators import Command, speed_after
from skyarm.plant.interface import Truth
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import Reference
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import first_state
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.batch import Batch
from skyarm.simulate.loop import run
from skyarm.studies.compare.cell_flights import CellFlights
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.suite import CASES, conditions
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import sampled
from support.engines import slopes
from support.flights import fly
from support.laws import ARM2, MODEL
from support.logs import Errors

DT = 0.005
SCALES = np.array([1000.0] * 4 + [0.1] * 2)


def random_problem(seed, stages=5, nx=4, nu=2, errors=7):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(stages + 1, errors, nx + nu))
    J[-1, :, nx:] = 0.0
    return Linear(
        0.5 * rng.normal(size=(stages, nx, nx + nu)),
        rng.normal(size=(stages, nx)),
        J,
        rng.normal(size=(stages + 1, errors)),
    )


def dense_solution(problem, first, fixed=None, at=None):
    """Inputs of the least-squares problem written out whole: states as affine maps of
    all inputs, then lstsq.
    """
    stages, nx, width = problem.AB.shape
    nu = width - nx
    X, x0, rows, right = np.zeros((nx, stages * nu)), np.array(first), [], []
    for i in range(stages + 1):
        U = np.zeros((nu, stages * nu))
        if i < stages:
            U[:, i * nu : (i + 1) * nu] = np.eye(nu)
        rows.append(problem.J[i, :, :nx] @ X + problem.J[i, :, nx:] @ U)
        right.append(-(problem.r[i] + problem.J[i, :, :nx] @ x0))
        if i < stages:
            X, x0 = (
                problem.AB[i, :, :nx] @ X + problem.AB[i, :, nx:] @ U,
                problem.AB[i, :, :nx] @ x0 + problem.c[i],
            )
    A, b = np.vstack(rows), np.concatenate(right)
    u = np.zeros(stages * nu) if at is None else at.ravel().copy()
    free = np.ones(stages * nu, dtype=bool) if fixed is None else ~fixed.ravel()
    u[free] = np.linalg.lstsq(A[:, free], b - A[:, ~free] @ u[~free], rcond=None)[0]
    return u.reshape(stages, nu)


def test_a_long_horizon_gives_the_gain_of_the_discrete_riccati_equation():
    rng = np.random.default_rng(3)
    A, B = np.eye(4) + 0.1 * rng.normal(size=(4, 4)), rng.normal(size=(4, 2))
    Q, R = np.diag([3.0, 1.0, 2.0, 0.5]), np.diag([0.4, 2.0])
    J = np.zeros((301, 6, 6))
    J[:] = np.sqrt(scipy.linalg.block_diag(Q, R))
    J[-1, 4:] = 0.0
    AB = np.tile(np.hstack([A, B]), (300, 1, 1))
    found = policy(Linear(AB, np.zeros((300, 4)), J, np.zeros((301, 6))))
    P = scipy.linalg.solve_discrete_are(A, B, Q, R)
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    # 1e-6: the floor of 1e-9 under the inputs' weights
    np.testing.assert_allclose(found.K[0], -K, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.P, P, rtol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_the_recursion_solves_the_least_squares_problem_written_out_whole(seed):
    problem, first = (
        random_problem(seed),
        np.random.default_rng(seed + 9).normal(size=4),
    )
    wide = np.full((5, 2), np.inf)
    x, u = rollout(problem, policy(problem), first, -wide, wide)
    np.testing.assert_allclose(u, dense_solution(problem, first), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(
        x[1], problem.AB[0] @ np.concatenate([first, u[0]]) + problem.c[0], atol=1e-12
    )


@pytest.mark.parametrize("seed", range(4))
def test_held_inputs_stay_and_the_others_make_the_best_of_it(seed):
    problem, rng = random_problem(seed), np.random.default_rng(seed + 20)
    first, held, at = (
        rng.normal(size=4),
        rng.random((5, 2)) < 0.4,
        rng.normal(size=(5, 2)),
    )
    wide = np.full((5, 2), np.inf)
    _, u = rollout(problem, policy(problem, held, at), first, -wide, wide)
    # 1e-5: a held input weighs 1e8 times the rest
    np.testing.assert_allclose(
        u, dense_solution(problem, first, held, at), rtol=1e-5, atol=1e-5
    )


@pytest.mark.parametrize("acceleration", [-3000.0, -20.0, 0.0, 15.0, 2500.0])
def test_the_command_brings_a_lagging_rotor_where_the_plan_wants_it(acceleration):
    rotor = ARM2.rotors[0]
    (command,) = command_for(
        motors([rotor], DT), np.array([480.0]), np.array([acceleration]), DT
    )
    assert speed_after(rotor, 480.0, command, DT) == pytest.approx(
        480.0 + acceleration * DT, abs=1e-9
    )


@pytest.mark.parametrize("command", [-50.0, 0.0, 300.0, 480.0, 700.0, 1e5])
def test_a_lagging_rotor_is_foreseen_where_the_plants_goes(command):
    """Also of a command that no rotor follows: below rest and above the highest
    speed.
    """
    rotor = ARM2.rotors[0]
    (found,) = speeds_under(motors([rotor], DT), np.array([480.0]), np.array([command]))
    assert found == pytest.approx(
        speed_after(rotor, 480.0, min(max(command, 0.0), rotor.max_speed), DT),
        rel=1e-12,
    )


def random_stage(seed):
    rng = np.random.default_rng(seed)
    state, inputs, disturbance, goal = examples(2, 4)
    q = rng.normal(size=4) + np.array([3.0, 0.0, 0.0, 0.0])
    x = np.concatenate(
        [
            rng.normal(size=3),
            q / np.linalg.norm(q),
            rng.normal(size=6),
            rng.uniform(-1, 1, 4),
            rng.uniform(300, 700, 4),
        ]
    )
    u, d = rng.normal(size=6) * SCALES, rng.normal(size=8) * 0.1
    return (
        (state, inputs, disturbance, goal),
        x,
        u,
        d,
        rng.normal(size=len(leaves(goal))),
    )


@pytest.mark.parametrize("mode", sampled(["tool", "joints"], 2))
def test_derivatives_of_the_stages_equal_scipy_s(mode):
    shapes, x, u, d, wanted = random_stage(1)
    c, e = (
        rebuild(shape, iter(values))
        for shape, values in zip(shapes[2:], (d, wanted), strict=True)
    )

    def stage(*values):
        a, b = rebuild(shapes[:2], iter(values))
        errors = (
            *state_residuals(MODEL, WEIGHTS, a, e, mode),
            *input_residuals(MODEL, WEIGHTS, a, b, c, e),
        )
        return leaves((integrate_stage(MODEL, a, b, c, 0.03, e.joint_rates), errors))

    both = np.concatenate([x, u])
    values, J = (
        np.array(stage(*both)),
        slopes(stage, both, np.array([1.0] * 17 + [100.0] * 4 + [*SCALES])),
    )
    stages = CompiledStages(MODEL, WEIGHTS, mode, SCALES)
    found = stages.derivatives(x[None], u[None], np.array([0.03]), d, wanted[None])
    np.testing.assert_allclose(found[0][0], values[:21], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found[2][0], values[21:], rtol=1e-12, atol=1e-12)
    # central differences: 1e-5 squared times third derivatives
    np.testing.assert_allclose(found[1][0], J[:21], rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(found[3][0], J[21:], rtol=1e-6, atol=1e-7)


def standing_measurement(state):
    return Measurement(
        time=0.0,
        specific_force=Vec3(0.0, 0.0, 9.81),
        **{
            name: getattr(state, name)
            for name in ("position", "quaternion", "velocity", "rate", "joints")
        },
        joint_rates=state.joint_rates,
        rotor_speeds=state.rotor_speeds,
    )


def test_the_observer_finds_a_constant_disturbance_and_leaves_no_offset():
    state, _, nothing, _ = examples(2, 4)
    state = dataclasses.replace(
        state, quaternion=Quaternion(1.0, 0.0, 0.0, 0.0), rotor_speeds=(485.0,) * 4
    )
    push = Disturbance(
        force=Vec3(2.0, -1.0, 0.5),
        torque=Vec3(0.01, 0.02, -0.005),
        efforts=(0.02, -0.01),
    )
    command, bandwidths = (
        Command(rotor_speeds=(485.0,) * 4, efforts=(0.0, 0.0)),
        Bandwidths(linear=25.0, angular=30.0, joints=40.0),
    )
    truth, estimate = (
        Estimate(state=state, disturbance=push),
        Estimate(state=state, disturbance=nothing),
    )
    move = trace(lambda e, c: predict(MODEL, e, c, DT), truth, command)
    look = trace(
        lambda e, c, m: observe(MODEL, bandwidths, e, c, m, DT),
        truth,
        command,
        standing_measurement(state),
    )
    for _ in range(120):
        truth = Estimate(state=move(truth, command), disturbance=push)
        estimate = look(estimate, command, standing_measurement(truth.state))
    # 15 time constants of the slowest pole; the push is constant in axes that turn 1
    # rad meanwhile
    np.testing.assert_allclose(leaves(estimate.disturbance), leaves(push), atol=2e-3)
    np.testing.assert_allclose(
        leaves(estimate.state)[7:10], leaves(truth.state)[7:10], atol=1e-4
    )


def dry_arm(coulomb, coulomb_rate=0.05):
    """The vehicle with the two-joint arm, its joints dry and slightly damped."""
    vehicle = load_vehicle("hummingbird_arm2_rotors")

    def rough(joint):
        return dataclasses.replace(
            joint, damping=0.001, coulomb=coulomb, coulomb_rate=coulomb_rate
        )

    links = tuple(
        dataclasses.replace(link, joint=rough(link.joint)) for link in vehicle.links
    )
    return dataclasses.replace(vehicle, links=links)


def test_a_command_beyond_a_drives_limit_is_foreseen_as_the_limit():
    state, _, nothing, _ = examples(2, 4)
    estimate = Estimate(
        state=dataclasses.replace(state, rotor_speeds=(485.0,) * 4), disturbance=nothing
    )
    limit = float(ARM2.links[0].joint.effort_limit)
    ends = [
        leaves(
            predict(
                MODEL,
                estimate,
                Command(rotor_speeds=(485.0,) * 4, efforts=(effort, -effort)),
                DT,
            )
        )
        for effort in (limit, 3.0 * limit, 0.5 * limit)
    ]
    assert ends[0] == ends[1] != ends[2]


def test_stages_and_rollouts_foresee_dry_friction_at_the_rates_that_are_wanted():
    shapes, x, u, d, wanted = random_stage(3)
    model = Model(vehicle=dry_arm(0.02))
    goal = rebuild(shapes[3], iter(wanted))
    state, inputs, unknown = (
        rebuild(shape, iter(v)) for shape, v in zip(shapes[:3], (x, u, d), strict=True)
    )
    expected = leaves(
        integrate_stage(model, state, inputs, unknown, 0.03, goal.joint_rates)
    )
    assert (
        np.abs(
            np.subtract(
                expected, leaves(integrate_stage(model, state, inputs, unknown, 0.03))
            )
        ).max()
        > 1e-4
    )
    found = CompiledStages(model, WEIGHTS, "tool", SCALES).derivatives(
        x[None], u[None], np.array([0.03]), d, wanted[None]
    )
    np.testing.assert_allclose(found[0][0], expected, rtol=1e-12, atol=1e-12)
    rollouts = Rollouts(
        model, WEIGHTS, "tool", Bounds(np.full(2, 1e9), np.full(4, 1e9))
    )
    zero = Policy(
        np.zeros((1, 6)), np.zeros((1, 6, 21)), np.zeros((21, 21)), np.zeros(21)
    )
    given = np.array([[0.03, 0.03], [0.0, 1.0]]), d, np.tile(wanted, (2, 1))
    motions = rollouts.run(np.stack([x, x]), u[None], zero, np.zeros(1), x, given)
    np.testing.assert_allclose(motions.x[1, :, 0], expected, rtol=1e-12, atol=1e-12)


MOVING = {
    "schema": 1,
    "name": "moving",
    "duration": 5.0,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"law": "nmpc"},
    "reference": {
        "base": {
            "kind": "circle",
            "center": [0.0, 0.0, 1.5],
            "radius": 0.3,
            "frequency_hz": 0.2,
            "start": 0.5,
        },
        "joints": [
            {"kind": "sine", "amplitude": 0.4, "frequency_hz": 0.4},
            {"kind": "sine", "amplitude": 0.3, "frequency_hz": 0.3},
        ],
    },
}


@pytest.mark.thorough
def test_known_dry_friction_costs_the_tip_nothing():
    """Without it in the belief the observer finds it late: the tip is off six times as
    far.
    """
    base, off = scenario_from(MOVING), {}
    for coulomb, believed in ((0, 0), (0.02, 0.02), (0.02, 0)):
        law = make_controller("nmpc", Model(vehicle=dry_arm(believed, 0.5)))
        log = run(
            dataclasses.replace(
                base, plant=Truth(vehicle=dry_arm(coulomb, 0.5)), controller=law
            )
        )
        late = log.time > 2.5
        off[coulomb, believed] = np.sqrt(
            np.mean(np.sum((log.tool - log.tool_reference)[late] ** 2, axis=1))
        )
    # 0.113, 0.104 and 0.70 mm
    assert off[0.02, 0.02] < 1.2 * off[0, 0]
    assert off[0.02, 0] > 4.0 * off[0, 0]


def test_both_poles_of_the_observer_are_where_its_bandwidth_says():
    state, _, nothing, _ = examples(2, 4)
    state = dataclasses.replace(state, rotor_speeds=(485.0,) * 4)
    command, bandwidths = (
        Command(rotor_speeds=(485.0,) * 4, efforts=(0.0, 0.0)),
        Bandwidths(linear=25.0, angular=30.0, joints=40.0),
    )
    truth = Estimate(state=state, disturbance=nothing)
    estimate = Estimate(
        state=dataclasses.replace(state, velocity=Vec3(0.1, 0.0, 0.0)),
        disturbance=nothing,
    )
    pushes = []
    for _ in range(8):
        truth = Estimate(state=predict(MODEL, truth, command, DT), disturbance=nothing)
        estimate = observe(
            MODEL, bandwidths, estimate, command, standing_measurement(truth.state), DT
        )
        pushes.append(estimate.disturbance.force.x)
    d, b = np.array(pushes), np.exp(-25.0 * DT)
    # hub drag on a wrong velocity is not part of the linear law: 1 % of the first push
    np.testing.assert_allclose(
        d[2:] - 2.0 * b * d[1:-1] + b * b * d[:-2], 0.0, atol=0.01 * np.abs(d).max()
    )


@pytest.mark.parametrize(
    ("axis", "attitude"), [((0, 1, 0), (0.0, 1.0)), ((1, 0, 0), (1.0, 0.0))]
)
def test_in_tool_mode_the_first_joint_gives_way_to_the_base_s_tilt(axis, attitude):
    links = [
        dataclasses.replace(k, joint=dataclasses.replace(k.joint, axis=axis))
        for k in ARM2.links
    ]
    model = dataclasses.replace(
        MODEL, vehicle=dataclasses.replace(ARM2, links=tuple(links))
    )
    (state, _, _, goal), *_ = random_stage(0)
    turn = Quaternion.of_rotation_vector(Vec3(*attitude, 0.0) * 0.2)
    level = dataclasses.replace(state, quaternion=turn, joints=(-np.sin(0.2), 0.0))
    errors = state_residuals(model, WEIGHTS, level, goal, "tool")
    np.testing.assert_allclose(errors[10:12], 0.0, atol=1e-12)
    assert abs(
        state_residuals(model, WEIGHTS, level, goal, "joints")[10]
    ) == pytest.approx(WEIGHTS.joints * np.sin(0.2))


def test_samples_are_extrapolated_with_the_jerk_of_the_last_two():
    def sample(t):
        # cubic in time: one jerk is all there is
        return Reference(
            position=Vec3(t**3, 0.0, 0.0),
            velocity=Vec3(3 * t**2, 0.0, 0.0),
            acceleration=Vec3(6 * t, 0, 0),
            joints=(t, 0.0),
            joint_rates=(1.0, 0.0),
            joint_accelerations=(0.0, 0.0),
        )

    held = preview.update_sample(sample(0.1), None, DT)
    for _ in range(3):
        held = preview.update_sample(sample(0.1), held, DT)
    assert held.age == pytest.approx(3 * DT)
    held = preview.update_sample(sample(0.12), held, DT)
    assert held.age == 0.0
    values, rates, accelerations = preview.extrapolate(held, np.array([0.2]))
    assert values[0, 0] == pytest.approx(0.32**3, abs=1e-12)
    assert rates[0, 0] == pytest.approx(3 * 0.32**2, abs=1e-12)
    assert accelerations[0, 0] == pytest.approx(6 * 0.32, abs=1e-12)
    assert values[0, 4] == pytest.approx(0.32)


def test_a_jump_of_the_reference_starts_without_jerk():
    first = preview.update_sample(
        Reference(
            position=Vec3(0.0, 0.0, 0.0),
            joints=(0.0,),
            joint_rates=(0.0,),
            joint_accelerations=(0.0,),
        ),
        None,
        DT,
    )
    second = preview.update_sample(
        Reference(
            position=Vec3(0.3, 0.0, 0.0),
            acceleration=Vec3(5.0, 0.0, 0.0),
            joints=(0.0,),
            joint_rates=(0.0,),
            joint_accelerations=(0.0,),
        ),
        first,
        DT,
    )
    assert not second.jerks.any()
    assert second.motion[2, 0] == 5.0


def test_stages_begin_with_control_periods_and_fill_the_horizon():
    steps = stage_lengths(stages=12, every=3, horizon=0.7, dt=DT)
    assert steps[:3] == pytest.approx([DT] * 3)
    assert steps.sum() == pytest.approx(0.7)
    assert steps[4:] / steps[3:-1] == pytest.approx([steps[5] / steps[4]] * 8)


def test_a_plan_moved_on_in_time_is_the_plan_at_its_own_stages():
    steps = np.array([0.1, 0.1, 0.1, 0.1])
    x = np.zeros((5, 21))
    x[:, 0], x[:, 3] = np.arange(5.0), 1.0
    plan = MotionPlan(x, np.arange(4.0)[:, None], np.zeros((4, 1, 21)))
    later = shift_plan(plan, steps, 0.1)
    assert later.x[:, 0] == pytest.approx([1.0, 2.0, 3.0, 4.0, 4.0])
    assert later.u[:, 0] == pytest.approx([1.0, 2.0, 3.0, 3.0])


def tilted_problem():
    """A start with small errors, 14 stages, hover wanted."""
    par = make_controller("nmpc", MODEL).par
    steps = stage_lengths(par.stages, par.every, par.horizon, DT)
    (state, _, _, goal), *_ = random_stage(0)
    x = np.array(
        leaves(
            dataclasses.replace(
                state,
                position=Vec3(0.02, -0.01, 1.0),
                joints=(0.1, -0.1),
                rotor_speeds=(483.0,) * 4,
            )
        )
    )
    wanted = np.array(leaves(dataclasses.replace(goal, position=Vec3(0.0, 0.0, 1.0))))
    guess = MotionPlan(np.tile(x, (15, 1)), np.zeros((14, 6)), np.zeros((14, 6, 21)))
    return par, steps, Problem(x, np.zeros(8), np.tile(wanted, (15, 1))), guess


def iterations(par, stages, steps, bounds):
    return Riccati(
        stages,
        Rollouts(MODEL, par.weights, par.mode, bounds),
        steps,
        par.weights.final,
        bounds,
    )


def best_motion(par, steps, problem, effort):
    """States and inputs of the whole problem solved at once: shots on NumPy lanes,
    SciPy's bounded least squares.
    """
    shapes, roots = examples(2, 4), np.sqrt(np.append(steps, par.weights.final))
    nothing = rebuild(shapes[2], iter(problem.disturbance))

    def shot(u):
        x, motion, errors = rebuild(shapes[0], iter(problem.start)), [problem.start], []
        for k, root in enumerate(roots):
            wanted = rebuild(shapes[3], iter(problem.goals[k]))
            found = [*state_residuals(MODEL, par.weights, x, wanted, par.mode)]
            if k < len(steps):
                taken = rebuild(shapes[1], iter(u[6 * k : 6 * k + 6]))
                found += input_residuals(MODEL, par.weights, x, taken, nothing, wanted)
                x = predict_stage(MODEL, x, taken, nothing, wanted, steps[k])
                motion.append(leaves(x))
            errors += [root * e for e in found]
        return motion, np.array(np.broadcast_arrays(*errors, u[0])[:-1])

    nudge, most = (
        np.tile(each, len(steps))
        for each in (1e-4 * SCALES, [np.inf] * 4 + [effort] * 2)
    )

    def jacobian(u):
        up, down = np.split(
            shot(u[:, None] + np.hstack([np.diag(nudge), -np.diag(nudge)]))[1],
            2,
            axis=1,
        )
        return (up - down) / (2.0 * nudge)

    u = least_squares(
        lambda u: shot(u)[1],
        np.zeros(len(most)),
        jacobian,
        (-most, most),
        x_scale=nudge,
        xtol=1e-8,
    ).x
    return np.array(shot(u)[0]), u.reshape(-1, 6)


@pytest.mark.parametrize(
    ("lengths", "effort"),
    sampled([((0.02, 0.05, 0.05, 0.05), 0.03), ((), 0.5), ((), 0.05)], 3),
)
def test_iterations_reach_the_optimum_that_scipy_finds(lengths, effort):
    par, steps, problem, guess = tilted_problem()
    steps, stages = (
        (np.array(lengths), len(lengths)) if lengths else (steps, len(steps))
    )
    problem = dataclasses.replace(problem, goals=problem.goals[: stages + 1])
    plan = MotionPlan(guess.x[: stages + 1], guess.u[:stages], guess.K[:stages])
    x, u = best_motion(par, steps, problem, effort)
    bounds = Bounds(np.full(2, effort), np.full(4, 838.0))
    ours = iterations(
        par, CompiledStages(MODEL, par.weights, par.mode, SCALES), steps, bounds
    )
    for _ in range(25):
        plan = ours.solve(problem, plan)
    # Gauss-Newton closes in by 0.6 a step; rotor speeds are hundreds of rad/s
    units = np.array([1.0] * 17 + [500.0] * 4)
    np.testing.assert_allclose(plan.x / units, x / units, atol=5e-6)
    np.testing.assert_allclose(plan.u[:, 4:], u[:, 4:], atol=5e-6)
    assert (np.abs(plan.u[0, 4:]).max() == pytest.approx(effort)) == (effort < 0.5)


def cost(plan, problem, stages, steps, final):
    """Sum of squares of a motion made anew by its inputs."""
    roots, x, total = np.sqrt(np.append(steps, final)), problem.start, 0.0
    for k, root in enumerate(roots):
        u = plan.u[min(k, len(steps) - 1)]
        dt = np.array([steps[min(k, len(steps) - 1)]])
        after, _, errors, _ = stages.derivatives(
            x[None], u[None], dt, problem.disturbance, problem.goals[k : k + 1]
        )
        counted = errors[0] if k < len(steps) else errors[0, : -stages.input_errors]
        total, x = total + float(np.sum((root * counted) ** 2)), after[0]
    return total


def stepped_problem(step):
    """A hover whose wanted position jumps sideways."""
    par, steps, problem, guess = tilted_problem()
    goals = problem.goals.copy()
    goals[:, 0] += step
    speed = np.sqrt(ARM2.mass * 9.81 / 4.0 / float(ARM2.rotors[0].thrust_coefficient))
    x = np.tile(problem.start, (15, 1))
    x[:, -4:] = speed
    return (
        par,
        steps,
        Problem(x[0], problem.disturbance, goals),
        dataclasses.replace(guess, x=x),
    )


def test_a_rolled_out_motion_is_the_model_s_with_inputs_within_their_limits():
    par, _, problem, guess = stepped_problem(0.3)
    steps = np.linspace(0.004, 0.01, 14)
    problem.start[-4:] = 490.0, 490.0, 490.0, 3.0
    bounds = Bounds(np.array([0.05, 0.04]), np.full(4, 495.0))
    rng, shares = np.random.default_rng(4), np.array([1.0, 0.3, 0.0])
    found = Policy(
        rng.normal(size=(14, 6)) * SCALES,
        2e-3 * rng.normal(size=(14, 6, 21)) * SCALES[:, None],
        np.zeros((21, 21)),
        np.zeros(21),
    )
    times = np.column_stack([np.append(steps, steps[-1]), np.append(steps, 0.2)])
    made = Rollouts(MODEL, par.weights, par.mode, bounds)
    motions = made.run(
        guess.x,
        guess.u,
        found,
        shares,
        problem.start,
        (times, problem.disturbance, problem.goals),
    )
    (state, inputs, nothing, goal), *_ = random_stage(0)
    clipped = stopped = fastest = 0
    for lane, share in enumerate(shares):
        x, total = problem.start, 0.0
        for k in range(15):
            at, wanted = (
                rebuild(state, iter(x.tolist())),
                rebuild(goal, iter(problem.goals[k].tolist())),
            )
            errors = state_residuals(MODEL, WEIGHTS, at, wanted, "tool")
            total += times[k, 1] * sum(float(e) ** 2 for e in errors)
            np.testing.assert_allclose(motions.x[k, :, lane], x, rtol=1e-9, atol=1e-9)
            if k == 14:
                break
            u = guess.u[k] + share * found.k[k] + found.K[k] @ (x - guess.x[k])
            u[:4] = np.clip(u[:4], -x[-4:] / steps[k], (495.0 - x[-4:]) / steps[k])
            u[4:] = np.clip(u[4:], -bounds.efforts, bounds.efforts)
            np.testing.assert_allclose(motions.u[k, :, lane], u, rtol=1e-7, atol=1e-7)
            clipped += int((np.abs(u[4:]) == bounds.efforts).sum())
            stopped += int(u[3] == -x[-1] / steps[k])
            fastest += int((u[:3] == (495.0 - x[-4:-1]) / steps[k]).sum())
            taken = rebuild(inputs, iter(u.tolist()))
            pushes = input_residuals(MODEL, WEIGHTS, at, taken, nothing, wanted)
            total += steps[k] * sum(float(e) ** 2 for e in pushes)
            x = np.array(leaves(integrate_stage(MODEL, at, taken, nothing, steps[k])))
        # 1e-9: fused multiplications of vector code
        assert motions.cost[lane] == pytest.approx(total, rel=1e-9)
    assert 0 < clipped < 3 * 14 * 2
    assert stopped > 0 < fastest


@pytest.mark.parametrize("step", sampled([2.0, 0.3, 10.0], 3))
def test_no_step_towards_a_far_goal_makes_the_motion_dearer(step):
    par, steps, problem, plan = stepped_problem(step)
    bounds = Bounds(np.array([0.5, 0.5]), np.full(4, 838.0))
    stages = CompiledStages(MODEL, par.weights, par.mode, SCALES)
    ours, costs, shares = iterations(par, stages, steps, bounds), [], []
    for _ in range(20):
        plan = ours.solve(problem, plan)
        assert plan.cost == pytest.approx(
            cost(plan, problem, stages, steps, par.weights.final), rel=1e-6
        )
        costs.append(plan.cost)
        shares.append(plan.share)
    # 1e-9: at share 0 the old motion is followed, but for rounding
    assert all(after <= before * (1.0 + 1e-9) for before, after in pairwise(costs))
    assert costs[-1] < 0.9 * costs[0]
    assert min(shares) < 1.0


def test_steps_that_were_cut_are_damped_and_whole_ones_free():
    assert [
        next_damping(0.0, 1.0),
        next_damping(0.0, 0.7),
        next_damping(0.0, 0.25),
    ] == [0.0, 0.0, 1e-3]
    assert next_damping(1e-3, 1.0) == 0.0
    assert next_damping(0.1, 0.05) == pytest.approx(0.8)
    assert next_damping(0.8, 1.0) == pytest.approx(0.1)
    assert next_damping(1e3, 0.0) == 1e3


def test_damping_shortens_the_step_and_turns_it_towards_steepest_descent():
    problem, wide = random_problem(1), np.full((5, 2), np.inf)
    problem = dataclasses.replace(problem, c=np.zeros_like(problem.c))
    steps = [
        rollout(problem, policy(problem, damping=damping), np.zeros(4), -wide, wide)[1][
            -1
        ]
        for damping in (0.0, 1.0, 1e6)
    ]
    # the last stage alone: one small system, H raised by a share of its own diagonal
    J, r = problem.J[-2:], problem.r[-2:]
    AB = problem.AB[-1]
    H = J[0].T @ J[0] + AB.T @ (J[1, :, :4].T @ J[1, :, :4]) @ AB
    g = J[0].T @ r[0] + AB.T @ J[1, :, :4].T @ r[1]
    k = policy(problem, damping=1.0).k[-1]
    np.testing.assert_allclose(
        k, -np.linalg.solve(H[4:, 4:] + np.diag(np.diag(H[4:, 4:])), g[4:]), rtol=1e-6
    )
    assert (
        np.linalg.norm(steps[2])
        < 1e-3 * np.linalg.norm(steps[1])
        < np.linalg.norm(steps[0])
    )


def test_a_guess_that_leads_nowhere_says_so_and_the_law_begins_again_from_rest():
    par, _, problem, guess = tilted_problem()
    engine = make_engine(engine_key(par, DT, False))
    with pytest.raises(NoPlanError):
        engine.solver.solve(problem, dataclasses.replace(guess, x=guess.x * np.nan))
    controller = make_controller("nmpc", MODEL)
    state = rebuild(random_stage(0)[0][0], iter(problem.start.tolist()))
    reading = standing_measurement(state)
    still = Reference(
        position=Vec3(0.0, 0.0, 1.0),
        joints=(0.0, 0.0),
        joint_rates=(0.0, 0.0),
        joint_accelerations=(0.0, 0.0),
    )
    memory, _ = controller.law(
        controller.memory, reading, still, DT, par=controller.par
    )
    lost = dataclasses.replace(memory.plan, u=memory.plan.u * np.nan)
    (again, command), (_, fresh) = (
        controller.law(
            dataclasses.replace(memory, plan=plan, since=2),
            reading,
            still,
            DT,
            par=controller.par,
        )
        for plan in (lost, None)
    )
    assert command == fresh
    assert np.isfinite(leaves(command)).all()
    assert np.isfinite(again.plan.cost)


def test_machine_code_is_made_once_for_a_belief_and_its_options():
    one, other = (make_controller("nmpc", MODEL).par for _ in range(2))
    assert make_engine(engine_key(one, DT, False)) is make_engine(
        engine_key(other, DT, False)
    )
    longer = make_controller("nmpc", MODEL, stages=13).par
    assert engine_key(one, DT, False) != engine_key(longer, DT, False)


@pytest.mark.thorough
@pytest.mark.parametrize("episode", [0, 3])
def test_noise_delay_and_wind_do_not_lose_the_step_with_which_the_circle_ends(episode):
    flights = CellFlights(
        entrant=ENTRANTS["nmpc"],
        case=CASES["case3_wind_45"],
        condition=conditions()["noisy"],
        seed=0,
    )
    scenario = flights.scenario()
    late = {
        "reference": scenario.reference.shifted(-20.0),
        "duration": 2.5,
        "episode": episode,
    }
    log = run(dataclasses.replace(scenario, **late))
    assert log.status == "completed"
    # the circle ends after 1 s with a step of 0.3 m
    assert np.abs(log.joints).max() < 1.2
    assert np.linalg.norm(log.position[-1] - np.array([0.0, 0.0, 1.0])) < 0.1


def early_case3(controller=None, plant="rigid_body", **changes):
    """Two seconds of Case 3 that begin on the circle."""
    scenario = load_scenario("case3", plant=plant)
    early = {"duration": 2.0, "reference": scenario.reference.shifted(-8.0)}
    return dataclasses.replace(
        scenario, controller=controller or scenario.controller, **(early | changes)
    )


def tool_error(log):
    return Errors.continuous(log).tool[log.time >= 1.0].mean()


@pytest.mark.parametrize("plant", sampled(["rigid_body", "mujoco"], 2))
def test_it_flies_case_3_nearer_to_the_tip_s_reference_than_the_paper_s_law(plant):
    model = load_scenario("case3").controller.par.model
    paper = tool_error(run(early_case3(plant=plant)))
    ours = run(early_case3(make_controller("nmpc", model), plant=plant))
    assert ours.status == "completed"
    assert tool_error(ours) < 0.002 < 0.1 * paper


def test_a_base_far_from_its_reference_comes_back():
    scenario = load_scenario("case3")
    start = first_state(scenario)
    away = dataclasses.replace(start, position=start.position + Vec3(2.0, -1.0, 1.0))
    controller = make_controller("nmpc", scenario.controller.par.model, every=4)
    log = run(
        dataclasses.replace(scenario, controller=controller, initial=away, duration=5.0)
    )
    assert log.status == "completed"
    assert np.abs(log.euler[:, :2]).max() < 0.8
    assert Errors.continuous(log).position[-1] < 0.3


@pytest.mark.parametrize(
    ("vehicle", "sensors"),
    [
        ("voliro_like", {}),
        ("hummingbird_arm2_rotors", {"wrist": {"kind": "force_torque"}}),
    ],
    ids=["tilting rotors", "force sensor"],
)
def test_channels_that_only_some_vehicles_have_do_not_stop_the_law(vehicle, sensors):
    file = {
        "name": "channels",
        "duration": 0.2,
        "plant": {"vehicle": vehicle},
        "controller": {"law": "nmpc"},
    }
    reference = {"base": {"kind": "hover", "position": [0.0, 0.0, 1.5]}}
    log = run(scenario_from({**file, "reference": reference, "sensors": sensors}))
    assert log.status == "completed"
    assert Errors.continuous(log).position[-1] < 0.01


def test_what_needs_a_law_over_scalars_refuses_in_one_line():
    scenario = early_case3(
        make_controller("nmpc", load_scenario("case3").controller.par.model)
    )
    for refused in (
        lambda: Batch(scenario),
        lambda: fly(scenario),
        lambda: export_c(scenario.controller, name="nmpc", period=DT),
    ):
        with pytest.raises(
            ControllerError,
            match=(
                r"^controller 'nmpc': its law cannot be traced, .* needs a traceable"
                r" law$"
            ),
        ):
            refused()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"mode": "both"},
            r"mode = 'both': must be one of \['tool', 'joints', 'plan'\]",
        ),
        ({"solver": "riccati"}, "no such option"),
        ({"every": 0}, r"every = 0: must be at least 1"),
        ({"every": 14}, r"every = 14: must be less than controller\.stages = 14"),
        ({"horizon": 0.0}, r"horizon = 0\.0: must be at least 0\.05"),
    ],
)
def test_wrong_options_are_refused_by_name(options, message):
    with pytest.raises(ControllerError, match=message):
        make_controller("nmpc", MODEL, **options)


def test_a_controller_s_memory_is_its_own():
    model = load_scenario("case3").controller.par.model
    controller = make_controller("nmpc", model)
    first, second = (run(early_case3(controller, duration=0.2)) for _ in range(2))
    np.testing.assert_array_equal(first.position, second.position)
    assert controller.memory == make_controller("nmpc", model).memory


def test_inputs_are_rates_of_the_rotors_and_torques():
    _, inputs, _, _ = examples(2, 4)
    assert inputs == StageInputs(rotor_accelerations=(0.0,) * 4, efforts=(0.0, 0.0))
