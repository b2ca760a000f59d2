"""An environment flies what a session flies, to the bit; a lane what a single
environment flies.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
import gymnasium
from small_environments import MASS, bare, noisy, one_program_a_task

import skyarm
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.envs import ActionChange, ActionSize, Result, Sight, Spin, TipError, TipNear
from skyarm.envs.env_program import EnvProgram
from skyarm.envs.env_task import make_task
from skyarm.envs.single_environment import Environment
from skyarm.envs.vector_environment import VectorEnvironment
from skyarm.records.leaves import leaves
from skyarm.scenario.numbers import with_numbers
from skyarm.studies.sweep.design import values
from skyarm.studies.sweep.distributions import Uniform, distribution_from
from skyarm.studies.sweep.study import Study
from support.cases import sampled


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with one_program_a_task(tmp_path_factory.mktemp("cache")):
        yield


def drawn(seed, episode):
    """The payload of an episode, as a sweep with this seed draws it."""
    study = Study(
        name="x",
        scenarios={},
        vary={MASS: Uniform(0.0, 0.1)},
        episodes=9,
        seed=seed,
        document={},
    )
    return float(values(study, [episode])[MASS][0])


def begun(planned, seed, episode):
    """A session of an episode."""
    one = dataclasses.replace(planned, seed=seed, episode=episode)
    return skyarm.Session(with_numbers(one, {MASS: drawn(seed, episode)}))


def test_every_episode_is_that_of_a_session_with_its_seed_and_number():
    """State, measurement and ending; noise, turbulence, delays, a payload of its own;
    two episodes a lane.
    """
    planned = noisy(duration=0.05)
    observation = (
        skyarm.envs.OBSERVED["position_error"](scale=0.5),
        "body_rate",
        "specific_force",
        "joint_angles",
    )
    reward = (
        ActionChange(weight=0.3),
        TipNear(scale=0.02, weight=2.0),
        Spin(scale=1.0),
        ActionSize(),
    )
    environment = VectorEnvironment(
        2,
        scenario=planned,
        observation=observation,
        reward=reward,
        randomise={MASS: {"uniform": [0.0, 0.1]}},
        precision="bit_exact",
    )
    model = planned.controller.par.model
    hover = hover_trim(model.vehicle, (0.0, 0.0), model.gravity).speeds
    limits = [rotor.max_speed for rotor in model.vehicle.rotors]
    actions = np.random.default_rng(1).uniform(-1.3, 1.3, (21, 2, 6))
    observed, _ = environment.reset(seed=[5, 5000])
    seeds, episodes = (5, 5000), [0, 0]
    sessions = [begun(planned, seed, 0) for seed in seeds]
    waiting, before = [False] * 2, [(0.0,) * 6] * 2
    for action in actions:
        for lane, session in enumerate(sessions):
            if not waiting[lane]:
                told, seen = session.reference, session.measurement
                wanted = [
                    (a - b) / 0.5
                    for a, b in zip(told.position, seen.position, strict=True)
                ]
                felt = [f / 10.0 for f in seen.specific_force]
                assert observed[lane].tolist() == [
                    *wanted,
                    *(w / 5.0 for w in seen.rate),
                    *felt,
                    *seen.joints,
                ]
        observed, rewards, ended, truncated, _ = environment.step(action)
        for lane, seed in enumerate(seeds):
            if waiting[lane]:
                # the step after the last of an episode only begins the next
                episodes[lane] += 1
                sessions[lane], waiting[lane] = (
                    begun(planned, seed, episodes[lane]),
                    False,
                )
                assert not ended[lane] | truncated[lane]
                assert rewards[lane] == 0.0
                before[lane] = (0.0,) * 6
                continue
            session, a = sessions[lane], np.clip(action[lane], -1.0, 1.0).tolist()
            speeds = [
                min(max(w * (1.0 + 0.2 * k), 0.0), top)
                for w, k, top in zip(hover, a, limits, strict=False)
            ]
            session.step(
                skyarm.Command(
                    rotor_speeds=tuple(speeds), efforts=(0.5 * a[4], 0.5 * a[5])
                )
            )
            assert [
                float(leaf[lane]) for leaf in leaves(environment.lanes.state)
            ] == leaves(session.state)
            waiting[lane] = bool(ended[lane] or truncated[lane])
            if session.running:
                result = Result(
                    state=session.state,
                    reference=session.reference,
                    vehicle=session.scenario.plant.vehicle,
                    action=tuple(a),
                    action_before=before[lane],
                    command=skyarm.Command(),
                    ended=0.0,
                    scenario=session.scenario,
                )
                total = sum(float(term.value(result)) * term.weight for term in reward)
                assert rewards[lane] == pytest.approx(total, rel=1e-12)
            before[lane] = tuple(a)
            assert truncated[lane] == (session.tick == planned.steps)
            assert session.running != waiting[lane]
    assert episodes == [1, 1]


def compared(mode, periods=70):
    """A vector environment beside Gymnasium's own loop of single ones: what both gave
    in every step.
    """
    arguments = bare(actions=skyarm.envs.RotorsAndJoints(span=1.0))
    ours = VectorEnvironment(3, autoreset_mode=mode, **arguments)
    loop = gymnasium.vector.SyncVectorEnv(
        [lambda: Environment(**arguments)] * 3, autoreset_mode=mode
    )
    assert ours.single_observation_space == loop.single_observation_space
    assert ours.action_space == loop.action_space
    random = np.random.default_rng(2)
    assert np.array_equal(ours.reset(seed=3)[0], loop.reset(seed=3)[0])
    for _ in range(periods):
        # one of them sinks to the ground within its 0.3 s, the others last
        action = random.uniform(-1.0, 1.0, (3, 4)).astype(np.float32)
        action[1] -= 1.0
        mine, other = ours.step(action), loop.step(np.clip(action, -1.0, 1.0))
        yield mine, other


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_vector_environment_is_gymnasiums_loop_of_single_ones(mode):
    ends = np.zeros(2, dtype=int)
    for mine, other in compared(mode):
        for a, b in zip(mine[:4], other[:4], strict=True):
            assert np.array_equal(a, b)
        ends += mine[2].sum(), mine[3].sum()
        infos, words = (
            each.get("final_info", each) if mode == "SameStep" else each
            for each in (mine[4], other[4])
        )
        assert np.array_equal(infos.get("_status", False), words.get("_status", False))
        assert np.array_equal(infos.get("status", ()), words.get("status", ()))
        for name in ("_final_obs", "_final_info"):
            assert np.array_equal(mine[4].get(name, ()), other[4].get(name, ()))
        if "final_obs" in mine[4]:
            for a, b in zip(mine[4]["final_obs"], other[4]["final_obs"], strict=True):
                assert np.array_equal(a, b) if b is not None else a is None
    assert (ends > 0).all()


def test_what_nobody_seeds_differs_and_goes_on_with_the_next_episode():
    one = VectorEnvironment(2, **bare())
    first, _ = one.reset()
    assert not np.array_equal(first[0], first[1])
    assert one.lanes.episodes.tolist() == [0, 0]
    # drawn one by one, of a hundred thousand two would be the same
    assert (one.lanes.seeds[1] - one.lanes.seeds[0]) % np.uint64(2**32) == 1
    again, _ = one.reset(options={"reset_mask": np.array([True, False])})
    assert one.lanes.episodes.tolist() == [1, 0]
    assert not np.array_equal(again[0], first[0])
    assert np.array_equal(again[1], first[1])
    one.reset(seed=[None, 7])
    assert one.lanes.episodes.tolist() == [2, 0]
    assert one.lanes.seeds[1] == 7


def test_semi_implicit_steps_are_those_of_the_scenarios_rate():
    given = bare()
    planned = dataclasses.replace(given["scenario"], integrator="euler")
    program = EnvProgram(make_task(planned, observation=given["observation"]))
    assert (
        program._program.plant.substeps(1.0 / planned.rates.control).near
        == planned.rates.physics // planned.rates.control
    )


def test_an_episode_begins_the_same_wherever_its_beginning_was_made():
    """Beginnings are made many at a time: the first and the last of those, the next
    ones, and ones before.
    """
    starts = VectorEnvironment(2, **bare()).lanes._starts
    seeds, depth = np.array([5, 2**40], dtype=np.uint64), starts._depth
    assert depth > 3
    starts.seed(np.array([0, 1]), seeds)
    for lanes, numbers in (
        ([0, 1], [0, 3]),
        ([0, 1], [depth - 1, 3 + depth]),
        ([1], [4]),
        ([0, 1], [depth, depth + 4]),
        ([0], [1]),
        ([1, 0], [depth + 3, depth + 1]),
        ([0, 1], [0, 2 * depth]),
    ):
        found = starts.take(np.array(lanes), np.array(numbers))
        made = starts._compute(seeds[lanes], np.array(numbers))
        assert np.array_equal(found, made.astype(found.dtype))
    assert not np.array_equal(found[:, 0], found[:, 1])


def test_observations_are_one_buffer_or_copies():
    viewing, copying = (
        VectorEnvironment(4, copy=copy, **bare()) for copy in (False, True)
    )
    kept = {}
    for each in (viewing, copying):
        first, _ = each.reset(seed=0)
        then, *_ = each.step(np.zeros((4, 4), dtype=np.float32))
        kept[each] = first, then
    assert np.shares_memory(*kept[viewing])
    assert not np.shares_memory(*kept[copying])
    assert np.array_equal(kept[viewing][1], kept[copying][1])
    assert kept[copying][1].flags.c_contiguous
    # what torch and JAX read of it is the same memory
    assert np.shares_memory(np.from_dlpack(viewing.observations), viewing.observations)
    assert viewing.observations.dtype == np.float32


def test_the_checker_of_gymnasium_has_no_complaint():
    from gymnasium.utils.env_checker import check_env

    made = gymnasium.make("skyarm/Scenario-v0", **bare())
    check_env(made.unwrapped)
    assert made.unwrapped.spec.id == "skyarm/Scenario-v0"


@pytest.mark.thorough
def test_a_belief_that_varies_is_the_one_of_the_episode():
    """The arm that the policy believes in, in the observation as in the law."""
    length = "model.vehicle.links.1.joint.position.z"
    planned = noisy(duration=0.02)
    one = Environment(
        scenario=planned,
        observation=["tip_error"],
        randomise={length: {"list": [-0.3, -0.1]}},
        precision="bit_exact",
    )
    seen = set()
    for seed in range(4):
        observed, _ = one.reset(seed=seed)
        drawn_here = {
            path: float(column[0]) for path, column in one.lanes.numbers().items()
        }
        scenario = with_numbers(dataclasses.replace(planned, seed=seed), drawn_here)
        told = skyarm.Session(scenario, machine_code=False)
        sight = Sight(
            measurement=told.measurement,
            reference=told.reference,
            action=(0.0,) * 6,
            model=scenario.controller.par.model,
        )
        assert observed.tolist() == list(TipError().numbers(sight))
        seen.add(drawn_here[length])
    assert seen == {-0.3, -0.1}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Gate(skyarm.Ending):
    """The reference past a line."""

    x: float

    status = "gate"

    def fine(self, scenario, state, goal, slack):
        return goal.x + 0.0 * state.position.x < self.x


@pytest.mark.parametrize(("line", "ended"), sampled([(0.045, False), (0.035, True)], 2))
def test_endings_read_the_reference_of_the_next_period_and_after_the_last_its_own(
    line, ended
):
    """As a session does: the reference is at 0.04 m in the last of five periods, and at
    0.05 after it.
    """
    moving = dataclasses.replace(
        skyarm.hover([0.0, 0.0, 1.0]),
        x=skyarm.Ramp(height=1.0, duration=1.0, start=0.0),
    )
    planned = dataclasses.replace(
        bare()["scenario"], reference=moving, duration=0.05, endings=(Gate(x=line),)
    )
    one = Environment(**bare(scenario=planned))
    one.reset(seed=0)
    flags = [one.step(np.zeros(4))[2:4] for _ in range(4 if ended else 5)]
    session = skyarm.Session(planned)
    while session.step():
        pass
    assert flags[-1] == (ended, not ended)
    assert not any(any(each) for each in flags[:-1])
    assert (session.ended is not None) == ended


def test_numbers_are_drawn_as_a_sweep_draws_them_and_the_stiffest_sets_the_steps():
    damping = "plant.vehicle.links.0.joint.damping"
    table = {MASS: {"uniform": [0.0, 0.1]}, damping: {"log_uniform": [0.001, 0.1]}}
    found = make_task(skyarm.load_scenario("case3"), randomise=table).randomised
    seeds, episodes = np.array([3, 3, 2**31], dtype=np.uint64), np.array([0, 7, 7])
    drawn_here = np.array(found.draw(seeds, episodes))
    vary = {path: distribution_from(each, path) for path, each in table.items()}
    for k, (seed, episode) in enumerate(
        zip(seeds.tolist(), episodes.tolist(), strict=True)
    ):
        study = Study(
            name="x", scenarios={}, vary=vary, episodes=9, seed=seed, document={}
        )
        assert drawn_here[:, k].tolist() == [
            float(column[0]) for column in values(study, [episode]).values()
        ]
    assert float(found.stiffest.plant.vehicle.links[0].joint.damping) == pytest.approx(
        0.1, rel=1e-12
    )


def test_a_lane_is_told_its_own_ending():
    envs = VectorEnvironment(3, **bare())
    envs.reset(seed=0)
    envs.lanes.ending[:] = [2.0, 0.0, 1.0]
    words = envs.lanes.statuses
    assert words[1] != words[2]
    infos = envs._infos(np.array([True, False, True]))
    assert infos["status"].tolist() == [words[2], None, words[1]]
    assert infos["_status"].tolist() == [True, False, True]
    assert envs._infos(np.zeros(3, dtype=bool)) == {}


def test_vectors_are_filled_with_the_last_lane():
    """Zeros there are no state: numbers that are none make vectors slow."""
    envs = VectorEnvironment(3, **bare())
    envs.reset(seed=0)
    stepper = envs.lanes._stepper
    last = stepper._blocks * stepper._kernel.lanes.width
    assert last > 3
    assert (stepper._carry[:, 3:last] == stepper._carry[:, 2:3]).all()
