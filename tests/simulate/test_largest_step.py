"""Air, forces and drives that state their largest step: every engine divides its step
by it, where one does only.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.compile.tracing.program import trace_loop
from skyarm.dynamics.actuators import Command
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import flat
from skyarm.plant.largest_step import divisions
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import JointDrive, ScenarioError, trimmed_state
from skyarm.simulate import lane_numbers, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.lane_numbers import require_short_steps
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.loop_state import InputRow, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.session import Session
from skyarm.simulate.stages import Stages
from skyarm.studies.sweep.design import extremes
from skyarm.studies.sweep.plan import prepare
from skyarm.studies.sweep.study_file import study_from
from skyarm.world import WindSample
from support.components import Servo, SteadyWrench, same_logs, with_law

BASE = load_scenario("case1", duration=0.25)
INERTIA = 8e-5
"""kg m^2, about the least that a joint of this arm moves."""


@dataclass(frozen=True, kw_only=True)
class StiffServo(Servo):
    """A servo that says how short a step it bears."""

    stiffness: float = 20.0
    damping: float = 0.06

    @property
    def largest_step(self) -> float:
        return 1.0 / max((self.stiffness / INERTIA) ** 0.5, self.damping / INERTIA)


@dataclass(frozen=True, kw_only=True)
class Stepped(SteadyWrench):
    """A steady force; its step is a number of its own."""

    largest_step: float | None = None


def holding(
    memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
) -> tuple[Any, Command]:
    """Hover speed, and the joints at two angles."""
    return memory, Command(rotor_speeds=(485.0,) * 4, efforts=(0.3, -0.2))


def served(drive: Any, **changes: Any) -> Any:
    drives = tuple(JointDrive(joint=name, drive=drive) for name in ("joint1", "joint2"))
    return dataclasses.replace(
        with_law(BASE, holding), drives=drives, ground=False, **changes
    )


def pushed(step: float | None, **changes: Any) -> Any:
    return dataclasses.replace(
        BASE, forces=(Stepped(force=Vec3(0.1, 0.0, 0.0), largest_step=step),), **changes
    )


def plant_of(scenario: Any, kind: Any = RigidBodyPlant) -> Any:
    around = first_surroundings(scenario, first_loop_state(scenario))
    return (
        kind(scenario.plant, around, scenario.integrator, 1.0 / scenario.rates.physics),
        around,
    )


# 20 N m/rad at 8e-5 kg m^2 are 500 rad/s; 0.06 N m s/rad are 750 /s: 1.33 ms
STIFF = StiffServo()
DAMPED = StiffServo(damping=0.2)  # 2500 /s: 0.4 ms, shorter than Euler's 1 ms too


@pytest.mark.parametrize(
    ("step", "rk4", "euler"),
    [
        (None, 1, 5),
        (0.1, 1, 5),
        (0.005, 1, 5),
        (0.00499, 2, 5),
        (0.0025, 2, 5),
        (0.001, 5, 5),
        (0.0004, 13, 15),
    ],
)
def test_the_step_is_divided_by_the_smallest_whole_number_that_will_do(
    step, rk4, euler
):
    calm = dataclasses.replace(
        pushed(step), plant=dataclasses.replace(BASE.plant, vehicle=_smooth())
    )
    assert plant_of(calm)[0].substeps(0.005).near == rk4
    assert (
        plant_of(dataclasses.replace(calm, integrator="euler"))[0].substeps(0.005).near
        == euler
    )
    theirs = plant_of(dataclasses.replace(calm, integrator="euler"), MujocoPlant)[0]
    assert theirs.model.opt.timestep == pytest.approx(0.005 / euler, rel=1e-12)


def _smooth() -> Any:
    """The arm without friction, which would ask for shorter steps by itself."""
    return BASE.plant.vehicle.with_joints(damping=0.0, coulomb=0.0)


def test_where_none_states_one_nothing_changes():
    plain = run(
        dataclasses.replace(BASE, forces=(SteadyWrench(force=Vec3(0.1, 0.0, 0.0)),))
    )
    assert same_logs(plain, run(pushed(None)))
    assert same_logs(plain, run(pushed(0.005)))
    assert not same_logs(plain, run(pushed(0.002)))


def test_a_stiff_servo_flies_where_it_says_so_and_blows_up_where_it_does_not():
    strong = dataclasses.replace(
        BASE.plant, vehicle=BASE.plant.vehicle.with_joints(effort_limit=math.inf)
    )
    silent = Servo(stiffness=20.0, damping=0.2)
    assert run(served(silent, plant=strong)).status == "diverged"
    for world in (BASE.plant, strong):
        log = run(served(DAMPED, plant=world))
        assert log.status == "completed"
        # 9 Hz at a damping ratio of two to five: settled after a quarter of a second,
        # but for the falling base
        np.testing.assert_allclose(log.joints[-1], [0.3, -0.2], atol=0.002)
        assert np.abs(log.joint_rates[-1]).max() < 0.2
    # within the joint's effort limit it does not diverge: it chatters, and nothing says
    # so
    limited = run(served(silent))
    assert np.abs(limited.joints[-1] - log.joints[-1]).max() > 0.02


@pytest.mark.parametrize("integrator", ["rk4", "euler"])
def test_machine_code_sessions_and_batches_fly_it_as_floats_do_to_the_last_bit(
    integrator,
):
    scenario = served(
        STIFF if integrator == "rk4" else DAMPED, integrator=integrator, duration=0.1
    )
    log = run(scenario)
    assert same_logs(log, run_in_python(scenario))
    assert same_logs(log, Session(scenario).run())
    path = "plant.drives.joint1.stiffness"
    lanes = Batch(scenario, [path], bit_exact=True, log_every=1).fly(
        {path: np.array([20.0, 15.0])}
    )
    assert lanes.log is not None
    assert np.array_equal(np.asarray(lanes.log.state.joints[0])[0], log.joints[:, 0])
    softer = with_numbers(scenario, {path: 15.0})
    # a softer servo would take the same number of steps: its damping is what is fast
    assert np.array_equal(
        np.asarray(lanes.log.state.joints[0])[1], run(softer).joints[:, 0]
    )


def test_loops_that_are_written_out_for_jax_take_the_same_steps():
    scenario = served(STIFF, duration=0.05)
    inputs, first = episode_inputs(scenario), first_loop_state(scenario)
    stages = Stages(scenario)
    period = make_period(stages, RigidBodySteps(stages, plant_of(scenario)[0].substeps))
    row = InputRow(time=0.0, reference=inputs.reference_example)

    def step(now: Any, _parameters: Any, fed: InputRow, draws: Any) -> Any:
        return period(now, (fed,), draws)

    loop = trace_loop(step, structure_of(first), (), row, stages.draws.channels)
    now = tuple(leaves(first))
    advance = loop.stepper()
    for numbers in inputs.rows.tolist():
        now = advance((*now, *numbers))[: loop.carry]
    log = run(served(STIFF, duration=0.055))
    assert tuple(now[2:5]) == tuple(log.position[-1])


def test_both_plants_fly_it_alike():
    """Euler's step is the same on both."""
    ours, theirs = (
        run(served(DAMPED, integrator="euler", kind=plant))
        for plant in ("rigid_body", "mujoco")
    )
    np.testing.assert_allclose(ours.joints, theirs.joints, rtol=0.0, atol=1e-9)
    assert ours.status == theirs.status == "completed"


@pytest.mark.parametrize("integrator", ["rk4", "euler"])
def test_a_divided_step_is_the_steps_taken_by_hand(integrator):
    """The plant that divides a period by n, beside one that is asked n times for an
    n-th of it.
    """
    scenario = served(DAMPED, integrator=integrator)
    plant, around = plant_of(scenario)
    count = plant.substeps(0.005).near
    silent = dataclasses.replace(
        around.of(0), drives=(Servo(stiffness=20.0, damping=0.2),) * 2
    )
    alone = RigidBodyPlant(scenario.plant, silent, integrator, 0.005 / count)
    start = trimmed_state(scenario.plant, Vec3(0.0, 0.0, 5.0), 0.0, (0.25, -0.15))
    command, told = (485.0,) * 4 + (0.3, -0.2), tuple(leaves(around))
    by_hand = flat(start)
    for _ in range(count):
        by_hand = alone.advance(by_hand, command, tuple(leaves(silent)), 0.005 / count)
    assert count > 1
    np.testing.assert_allclose(
        plant.advance(flat(start), command, told, 0.005),
        by_hand,
        rtol=1e-13,
        atol=1e-15,
    )


def test_halved_steps_converge_with_the_order_of_the_method():
    """RK4: each halving of the largest step leaves a sixteenth of the error, towards
    sixteen times shorter steps.
    """
    start = flat(trimmed_state(BASE.plant, Vec3(0.0, 0.0, 5.0), 0.0, (0.28, -0.18)))
    command = (485.0,) * 4 + (0.3, -0.2)
    vehicle = dataclasses.replace(BASE.plant, vehicle=_smooth())

    def after(step: float) -> Any:
        push = Stepped(force=Vec3(0.1, 0.0, 0.0), largest_step=step)
        around = Surroundings(
            components=(WindSample(), push),
            memories=((), ()),
            drives=(Servo(stiffness=20.0, damping=0.02),) * 2,
            drive_memories=((), ()),
        )
        return np.array(
            RigidBodyPlant(vehicle, around).advance(
                start, command, tuple(leaves(around)), 0.005
            )
        )

    exact = after(0.005 / 256)
    errors = [np.abs(after(0.005 / n) - exact)[13:17].max() for n in (8, 16, 32)]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.2)


@pytest.mark.parametrize("step", [0.0, -0.001, 4.9e-6, float("nan"), float("inf")])
def test_a_step_that_is_none_is_refused(step):
    words = (
        r"environment\.forces\[0\]\.largest_step = .*: must be None or at least 5e-06 s"
    )
    with pytest.raises(ScenarioError, match=words):
        check_scenario(pushed(step))


def test_of_a_word_the_field_is_named():
    with pytest.raises(
        ScenarioError, match=r"forces\[0\]\.largest_step = 'short': must be a number"
    ):
        check_scenario(pushed("short"))
    with pytest.raises(ScenarioError, match=r"plant\.drives\.joint1\.largest_step"):
        check_scenario(served(dataclasses.replace(STIFF, damping=100.0)))


def test_lanes_that_bear_only_shorter_steps_are_refused_or_compiled_for():
    scenario, path = served(STIFF, duration=0.1), "plant.drives.joint1.stiffness"
    values = {path: np.array([20.0, 100.0])}
    with pytest.raises(
        ScenarioError,
        match=(
            r"values\['plant.drives.joint1.stiffness'\] = 100: requires steps of"
            r" 0.000894"
        ),
    ):
        Batch(scenario, [path]).fly(values)
    stiffest = with_numbers(scenario, {path: 100.0})
    lanes = Batch(scenario, [path], stiffest=stiffest, bit_exact=True, log_every=1).fly(
        values
    )
    assert lanes.log is not None
    log = run(stiffest)
    assert np.array_equal(np.asarray(lanes.log.state.joints[0])[1], log.joints[:, 0])


@dataclass(frozen=True, kw_only=True)
class Sprung(SteadyWrench):
    """Bears steps that two of its numbers make together, and no smoother one where it
    is soft.
    """

    k: float = 1.0
    m: float = 1.0

    @property
    def largest_step(self) -> float | None:
        return None if self.k < 0.5 else 0.004 * self.m / self.k


def sprung(**numbers: float) -> Any:
    push = Sprung(force=Vec3(0.1, 0.0, 0.0), **numbers)
    return dataclasses.replace(
        BASE, forces=(SteadyWrench(force=Vec3(0.0, 0.0, 0.1)), push), duration=0.05
    )


def test_an_array_is_no_step(monkeypatch):
    monkeypatch.setattr(Sprung, "largest_step", property(lambda _: np.ones(2)))
    with pytest.raises(
        ScenarioError, match=r"forces\[1\]\.largest_step = array.*: must be one number"
    ):
        check_scenario(sprung())


K, M, RATE = (
    "environment.forces.1.k",
    "environment.forces.1.m",
    "plant.drives.joint1.stiffness",
)


def test_the_numbers_of_a_lane_are_looked_at_together():
    scenario, largest = sprung(), 0.001  # that of k = 4
    # each alone within 1 ms, and together 0.4 ms; neither is the greatest or the least
    mixed = {K: np.array([4.0, 3.0, 0.6, 1.0]), M: np.array([1.0, 0.3, 0.25, 0.9])}
    words = (
        r"values\['environment.forces.1.k'\] = 3, values\['environment.forces.1.m'\] ="
        r" 0.3: requires steps of 0.0004 s"
    )
    with pytest.raises(ScenarioError, match=words):
        require_short_steps(scenario, mixed, largest)
    with pytest.raises(ScenarioError, match=words):
        Batch(scenario, [K, M], stiffest=sprung(k=4.0), effort=0).fly(mixed)
    fine = {K: mixed[K], M: np.array([1.0, 0.75, 0.25, 0.9])}
    require_short_steps(scenario, fine, largest)
    # one number for all lanes goes with each of them
    with pytest.raises(ScenarioError, match=r"0\.3: requires steps of 0\.0003 s"):
        require_short_steps(scenario, {K: mixed[K], M: 0.3}, largest)


@pytest.mark.parametrize("numbers", [(1.0, 8.0), (8.0, 1.0), (2.0, 8.0, 1.0)])
def test_the_stiffest_lane_is_found_wherever_it_stands(numbers):
    with pytest.raises(
        ScenarioError, match=r"forces\.1\.k'\] = 8: requires steps of 0\.0005 s"
    ):
        require_short_steps(sprung(), {K: np.array(numbers)}, 0.001)


def test_the_lightest_lane_is_found_too():
    with pytest.raises(
        ScenarioError, match=r"forces\.1\.m'\] = 0\.1: requires steps of 0\.0004 s"
    ):
        require_short_steps(sprung(), {M: np.array([0.25, 0.1, 0.9])}, 0.001)


def test_a_batch_compiled_for_steps_of_any_length_flies_what_states_none():
    soft = sprung(k=0.1)
    require_short_steps(soft, {K: np.array([0.1, 0.4])}, None)
    with pytest.raises(
        ScenarioError,
        match=(
            r"= 1: requires steps of 0\.004 s, and the batch was .* steps of any length"
        ),
    ):
        require_short_steps(soft, {K: np.array([0.1, 1.0])}, None)
    # and where it was compiled for some, a lane that states none bears them
    require_short_steps(soft, {K: np.array([0.1, 0.4])}, 0.001)


def test_the_step_that_was_compiled_is_borne_up_to_rounding():
    require_short_steps(sprung(), {K: np.array([4.0 * (1.0 + 1e-12)])}, 0.001)
    with pytest.raises(ScenarioError, match="requires steps"):
        require_short_steps(sprung(), {K: np.array([4.0 * (1.0 + 1e-7)])}, 0.001)


def test_a_step_that_a_lane_cannot_state_is_one_line():
    with pytest.raises(
        ScenarioError, match=r"values\['plant.drives.joint1.stiffness'\] = -1: "
    ):
        require_short_steps(served(STIFF), {RATE: np.array([20.0, -1.0])}, 0.001)


@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan])
def test_a_step_that_is_none_is_not_lost_among_others(mass):
    with pytest.raises(ScenarioError, match=rf"m'\] = {mass:g}: .*must be"):
        require_short_steps(sprung(), {M: np.array([mass, 0.9])}, 0.001)


def test_of_what_never_states_a_step_no_lane_is_looked_at(monkeypatch):
    monkeypatch.setattr(
        lane_numbers, "_stable_step", lambda *_: pytest.fail("was looked at")
    )
    path = "environment.forces.0.force.z"
    require_short_steps(sprung(), {path: np.array([0.1, 0.2])}, 0.001)


@pytest.mark.parametrize("count", [3, 5, 7, 10, 30])
def test_a_share_of_the_step_is_that_many_divisions_whatever_the_rounding(count):
    """0.005 / 0.005 / n is n up to rounding, and a step that is shorter by more than
    that is one more.
    """
    for seconds in np.linspace(0.001, 0.02, 101).tolist():
        share = seconds / count
        assert (
            divisions(seconds, share)
            == divisions(seconds, math.nextafter(share, 0.0))
            == count
        )
        assert divisions(seconds, share * (1.0 - 1e-7)) == count + 1


def test_a_sweep_takes_the_shortest_step_of_all_that_it_draws():
    paths = {
        "plant.drives.joint1.stiffness": 100.0,
        "plant.drives.joint1.damping": 0.08,
        "plant.drives.joint2.damping": 0.3,
    }
    document = {
        "schema": 1,
        "name": "stiff",
        "scenario": "case1",
        "episodes": 4,
        "metrics": ["position_error_max"],
    }
    document["vary"] = {"plant.payload.mass": {"uniform": [0.0, 0.01]}}
    study = study_from(document)
    like = study.vary["plant.payload.mass"]
    ranges = {
        path: dataclasses.replace(like, low=0.01, high=high)
        for path, high in paths.items()
    }
    study = dataclasses.replace(
        study, vary=ranges, scenarios={"own": served(STIFF, duration=0.1)}
    )
    drawn = {path: high for path, (_, high, *_) in extremes(study).items()}
    drives = {each.joint: each.drive for each in prepare(study).stiffest.agent.drives}
    # each number at the end that shortens the step; where it does not, as it was
    assert drives["joint1"].stiffness == drawn["plant.drives.joint1.stiffness"] > 50.0
    assert drives["joint2"].damping == drawn["plant.drives.joint2.damping"] > 0.1
    assert drives["joint1"].damping == STIFF.damping
