"""An environment flies what a session flies, to the bit; a lane what a single environment flies."""

from __future__ import annotations

import dataclasses

import gymnasium
import numpy as np
import pytest

import skyarm
from shared_programs import hurried
from skyarm.actuation.hover import hover_trim
from skyarm.compile import leaves
from skyarm.env import ActionChange, ActionSize, Result, Spin, TipNear
from skyarm.env.single_environment import Environment
from skyarm.env.vector_environment import VectorEnvironment
from skyarm.scenario.numbers import with_numbers
from skyarm.sweep.design import values
from skyarm.sweep.distributions import Uniform
from skyarm.sweep.study import Study
from small_environments import MASS, bare, noisy


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with hurried(tmp_path_factory.mktemp("cache")):
        yield


def drawn(seed, episode):
    """The payload of an episode, as a sweep with this seed draws it."""
    study = Study(name="x", scenarios={}, vary={MASS: Uniform(0.0, 0.1)}, episodes=9, seed=seed, document={})
    return float(values(study, [episode])[MASS][0])


def begun(planned, seed, episode):
    """A session of an episode."""
    one = dataclasses.replace(planned, seed=seed, episode=episode)
    return skyarm.Session(with_numbers(one, {MASS: drawn(seed, episode)}))


def test_every_episode_is_that_of_a_session_with_its_seed_and_number():
    """State, measurement and ending; noise, turbulence, delays, a payload of its own; two episodes a lane."""
    planned = noisy(duration=0.05)
    observation = (skyarm.env.OBSERVED["position_error"](scale=0.5), "body_rate", "joint_angles")
    reward = (ActionChange(weight=0.3), TipNear(scale=0.02, weight=2.0), Spin(scale=1.0), ActionSize())
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
                wanted = [(a - b) / 0.5 for a, b in zip(told.position, seen.position, strict=True)]
                assert observed[lane].tolist() == [*wanted, *(w / 5.0 for w in seen.rate), *seen.joints]
        observed, rewards, ended, truncated, _ = environment.step(action)
        for lane, seed in enumerate(seeds):
            if waiting[lane]:
                # the step after the last of an episode only begins the next
                episodes[lane] += 1
                sessions[lane], waiting[lane] = begun(planned, seed, episodes[lane]), False
                assert not ended[lane] | truncated[lane]
                assert rewards[lane] == 0.0
                before[lane] = (0.0,) * 6
                continue
            session, a = sessions[lane], np.clip(action[lane], -1.0, 1.0).tolist()
            speeds = [min(max(w * (1.0 + 0.2 * k), 0.0), top) for w, k, top in zip(hover, a, limits, strict=False)]
            session.step(skyarm.Command(rotor_speeds=tuple(speeds), efforts=(0.5 * a[4], 0.5 * a[5])))
            assert [float(leaf[lane]) for leaf in leaves(environment.lanes.state)] == leaves(session.state)
            waiting[lane] = bool(ended[lane] or truncated[lane])
            if session.running:
                result = Result(
                    state=session.state,
                    reference=session.reference,
                    vehicle=session.scenario.world.vehicle,
                    action=tuple(a),
                    action_before=before[lane],
                    command=skyarm.Command(),
                    ended=0.0,
                )
                total = sum(float(term.value(result)) * term.weight for term in reward)
                assert rewards[lane] == pytest.approx(total, rel=1e-12)
            before[lane] = tuple(a)
            assert truncated[lane] == (session.tick == planned.steps)
            assert session.running != waiting[lane]
    assert episodes == [1, 1]


def compared(mode, periods=70):
    """A vector environment beside Gymnasium's own loop of single ones: what both gave in every step."""
    arguments = bare(actions=skyarm.env.RotorsAndJoints(span=1.0))
    ours = VectorEnvironment(3, autoreset_mode=mode, **arguments)
    loop = gymnasium.vector.SyncVectorEnv([lambda: Environment(**arguments)] * 3, autoreset_mode=mode)
    assert ours.single_observation_space == loop.single_observation_space
    assert ours.action_space == loop.action_space
    random = np.random.default_rng(2)
    assert np.array_equal(ours.reset(seed=3)[0], loop.reset(seed=3)[0])
    for _ in range(periods):
        # one of them sinks to the ground within its 0.3 s, the others last
        action = random.uniform(-1.0, 1.0, (3, 4)).astype(np.float32)
        action[1] -= 1.0
        mine, other = ours.step(action), loop.step(np.clip(action, -1.0, 1.0))
        yield ours, loop, mine, other


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_a_vector_environment_is_gymnasiums_loop_of_single_ones(mode):
    ends = np.zeros(2, dtype=int)
    for ours, loop, mine, other in compared(mode):
        for a, b in zip(mine[:4], other[:4], strict=True):
            assert np.array_equal(a, b)
        ends += mine[2].sum(), mine[3].sum()
        infos, words = (each.get("final_info", each) if mode == "SameStep" else each for each in (mine[4], other[4]))
        assert np.array_equal(infos.get("_status", False), words.get("_status", False))
        assert np.array_equal(infos.get("status", ()), words.get("status", ()))
        for name in ("_final_obs", "_final_info"):
            assert np.array_equal(mine[4].get(name, ()), other[4].get(name, ()))
        if "final_obs" in mine[4]:
            for a, b in zip(mine[4]["final_obs"], other[4]["final_obs"], strict=True):
                assert np.array_equal(a, b) if b is not None else a is None
        over = mine[2] | mine[3]
        if mode == "Disabled" and over.any():
            again = [env.reset(options={"reset_mask": over.copy()})[0] for env in (ours, loop)]
            assert np.array_equal(*again)
    assert (ends > 0).all()


def test_an_episode_that_is_over_stays_as_it_is_until_it_is_begun_again():
    """Where nothing begins by itself; the others go on."""
    ours = next(each[0] for each in compared("Disabled") if each[2][2][1])
    before, ticks = ours.observations.copy(), ours.lanes.loop.ticks.copy()
    observed, rewards, ended, _, infos = ours.step(np.zeros((3, 4)))
    assert np.array_equal(observed[1], before[1])
    assert not np.array_equal(observed[0], before[0])
    assert (ours.lanes.loop.ticks - ticks).tolist() == [1.0, 0.0, 1.0]
    assert (rewards[1], ended[1], infos["status"][1]) == (0.0, True, "ground")


def test_what_nobody_seeds_differs_and_goes_on_with_the_next_episode():
    one = VectorEnvironment(2, **bare())
    first, _ = one.reset()
    assert not np.array_equal(first[0], first[1])
    assert one.lanes.episodes.tolist() == [0, 0]
    again, _ = one.reset(options={"reset_mask": np.array([True, False])})
    assert one.lanes.episodes.tolist() == [1, 0]
    assert not np.array_equal(again[0], first[0])
    assert np.array_equal(again[1], first[1])
    one.reset(seed=[None, 7])
    assert one.lanes.episodes.tolist() == [2, 0]
    assert one.lanes.seeds[1] == 7


def test_observations_are_one_buffer_or_copies():
    viewing, copying = (VectorEnvironment(4, copy=copy, **bare()) for copy in (False, True))
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
