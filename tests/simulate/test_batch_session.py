"""Lanes stepped by actions: each is a session of its own, to the bit; episodes begin and end lane by lane."""

from __future__ import annotations

import dataclasses
import gc
import os
import subprocess
import sys

import numpy as np
import pytest

import skyarm
from kernel_threads import queues, serving, wait_until
from skyarm.compile import leaves
from skyarm.compile.llvm import lane_stepper, shared_steps
from skyarm.compile.llvm.lane_stepper import apart
from skyarm.world.environment_tables import wind_from

MASS = "plant.payload.mass"


def scenario(**changes):
    return skyarm.load_scenario("case3_wind", controller="paper_ct", **{"duration": 0.5, **changes})


def noisy(**changes):
    return dataclasses.replace(
        scenario(**changes), noise=skyarm.SensorNoise(position=0.001), delays=skyarm.Delays(command=0.002)
    )


def pushes(lanes, periods, seed=0):
    """Actions near hover, different in each lane and period."""
    generator = np.random.default_rng(seed)
    speeds = generator.normal(480.0, 20.0, (periods, 4, lanes))
    return np.concatenate([speeds, generator.normal(0.0, 0.02, (periods, 2, lanes))], axis=1)


def numbers(state):
    return np.array(leaves(state))


def test_a_lane_is_a_session_of_its_own_to_the_bit():
    """Also with delayed commands, a payload of its own, and a law of the scenario's that nobody asks."""
    lanes, actions, masses = 21, pushes(21, 40), np.linspace(0.0, 0.1, 21)
    batch = skyarm.BatchSession(noisy(), lanes, [MASS], bit_exact=True, seed=5)
    batch.set({MASS: masses})
    batch.reset(seed=5)
    found = [numbers(batch.step(each)).copy() for each in actions]
    for lane in (0, 7, 20):
        changed = skyarm.with_numbers(dataclasses.replace(noisy(), seed=5, episode=lane), {MASS: masses[lane]})
        one = skyarm.Session(changed)
        for action, held in zip(actions[:, :, lane], found, strict=True):
            one.step(skyarm.Command(rotor_speeds=tuple(action[:4]), efforts=tuple(action[4:])))
            assert np.array_equal(numbers(one.state), held[:, lane])


def test_a_law_flies_in_a_session_as_it_does_alone():
    """Noise and all; the law's commands in place of actions."""
    planned = dataclasses.replace(noisy(), seed=3)
    batch = skyarm.BatchSession(planned, 3, bit_exact=True, seed=3, law=True)
    for _ in range(planned.steps - 1):
        batch.step()
    for lane in range(3):
        log = skyarm.run(dataclasses.replace(planned, episode=lane))
        assert np.array_equal(np.array(batch.state.position)[:, lane], log.position[-1])


def blowing(**changes):
    """Noise of sensors and of turbulence, which starts anew in each episode."""
    gusty = wind_from({"mode": "moving_air", "turbulence": {"altitude": 6.0, "wind_20ft": 7.7}}, "wind")
    return dataclasses.replace(noisy(**changes), wind=gusty)


@pytest.mark.thorough
def test_an_episode_is_a_session_of_its_own_whenever_its_lane_began_it():
    """Lanes begin again by themselves at the end of the duration, and one of them in the middle of an episode."""
    planned = blowing(duration=0.1)
    batch, flown = skyarm.BatchSession(planned, 5, bit_exact=True, seed=6, law=True), {}
    for period in range(50):
        if period == 27:
            batch.reset(np.array([False, False, False, True, False]))
        batch.step()
        for lane, episode in enumerate(batch.episodes.tolist()):
            flown.setdefault(episode, []).append(numbers(batch.state)[:, lane].copy())
    assert batch.episodes.tolist() == [11, 12, 13, 15, 14]
    assert {episode: len(flown[episode]) for episode in (0, 7, 8, 10, 11, 15)} == {
        0: 20, 7: 20, 8: 7, 10: 20, 11: 10, 15: 3
    }  # fmt: skip
    for episode, states in flown.items():
        one = skyarm.Session(dataclasses.replace(planned, seed=6, episode=episode))
        for held in states:
            one.step()
            assert np.array_equal(numbers(one.state), held), episode


def test_a_new_seed_begins_as_a_session_made_with_it():
    """Whatever was flown before."""
    batch = skyarm.BatchSession(blowing(), 5, seed=1, law=True)
    for _ in range(7):
        batch.step()
    batch.reset(seed=2)
    other = skyarm.BatchSession(blowing(), 5, seed=2, law=True)
    assert batch.episodes.tolist() == other.episodes.tolist()
    for _ in range(7):
        assert np.array_equal(numbers(batch.step()), numbers(other.step()))


def test_lanes_end_and_begin_again_one_by_one():
    """Without thrust a lane falls from 1 m to the ground in 0.45 s; the others fly on; the next step begins it anew."""
    planned = scenario(duration=2.0)
    batch = skyarm.BatchSession(planned, 4)
    actions = np.array([[480.0]] * 4 + [[0.0]] * 2) * np.ones(4)
    actions[:4, 2] = 0.0
    first = numbers(batch.state).copy()
    for _ in range(200):
        batch.step(actions)
        if batch.ended.any():
            break
    assert batch.ended.tolist() == [False, False, True, False]
    assert batch.episodes.tolist() == [0, 1, 2, 3]
    at = batch.state.position.z[2]
    kept = batch.step(actions)
    assert batch.episodes.tolist() == [0, 1, 4, 3]
    assert kept.position.z[2] > at + 0.2
    batch.reset()
    assert np.array_equal(numbers(batch.state), first)
    assert batch.episodes.tolist() == [5, 6, 7, 8]


def test_an_ended_lane_stays_where_nobody_wants_another_episode():
    batch = skyarm.BatchSession(scenario(duration=2.0), 2, autoreset=False)
    for _ in range(150):
        batch.step(np.zeros((6, 2)))
    assert batch.ended.all()
    held = numbers(batch.state).copy()
    batch.step(np.full((6, 2), 1.0))
    assert np.array_equal(numbers(batch.state), held)


def test_without_autoreset_a_lane_that_has_flown_its_time_stays_while_the_others_go_on():
    """One lane begins 0.02 s later: it flies on to its own end, to the bit, beside two that stay; then nobody flies."""
    planned = blowing(duration=0.1)
    batch = skyarm.BatchSession(planned, 3, [MASS], bit_exact=True, seed=4, law=True, autoreset=False)
    others = np.array([True, False, True])
    for _ in range(4):
        batch.step()
    batch.reset(~others)
    for _ in range(16):
        batch.step()
    assert (batch.truncated.tolist(), batch.ended.any()) == ([True, False, True], False)
    stays = numbers(batch.state)[:, others].copy()
    one = skyarm.Session(dataclasses.replace(planned, seed=4, episode=3))
    for _ in range(16):
        one.step()
    batch.set({MASS: 0.2}, others)  # of an episode to come
    for period in range(17, 21):
        batch.step()
        one.step()
        assert np.array_equal(numbers(batch.state)[:, others], stays)
        assert np.array_equal(numbers(batch.state)[:, 1], numbers(one.state))
        assert batch.truncated.tolist() == [True, period == 20, True]
    everything = numbers(batch.state).copy()
    batch.step()
    assert np.array_equal(numbers(batch.state), everything)
    assert (batch.truncated.all(), batch.ended.any(), batch.episodes.tolist()) == (True, False, [0, 3, 2])
    batch.reset(others)
    assert (batch.truncated.tolist(), batch.episodes.tolist()) == ([False, True, False], [4, 3, 5])
    batch.step()
    assert np.array_equal(numbers(batch.state)[:, 1], everything[:, 1])
    assert not np.array_equal(numbers(batch.state)[:, 0], everything[:, 0])


def test_the_end_of_the_duration_is_told_apart_from_an_ending():
    batch = skyarm.BatchSession(scenario(duration=0.1), 3)
    actions = np.array([[480.0]] * 4 + [[0.0]] * 2)
    told = []
    for _ in range(25):
        batch.step(actions)
        told.append((bool(batch.truncated.all()), bool(batch.ended.any())))
    assert [k for k, (truncated, _) in enumerate(told) if truncated] == [19]
    assert not any(ended for _, ended in told)
    assert batch.episodes.tolist() == [3, 4, 5]


def test_numbers_may_change_in_some_lanes_only():
    batch = skyarm.BatchSession(scenario(), 4, [MASS], bit_exact=True)
    batch.set({MASS: 0.1}, np.array([True, False, False, True]))
    actions = np.array([[480.0]] * 4 + [[0.0]] * 2)
    for _ in range(20):
        batch.step(actions)
    z = batch.state.position.z
    assert z[0] == z[3] < z[1] == z[2]
    with pytest.raises(ValueError, match=r"path = 'plant\.vehicle\.base\.mass': must be one of plant\.payload\.mass"):
        batch.set({"plant.vehicle.base.mass": 1.0})


def test_what_cannot_be_a_batch_is_one_line():
    with pytest.raises(skyarm.ScenarioError, match="lanes = 0: must be a whole number, at least 1"):
        skyarm.BatchSession(scenario(), 0)
    with pytest.raises(skyarm.ScenarioError, match=r"plant\.kind = 'mujoco': must be rigid_body"):
        skyarm.BatchSession(scenario(plant="mujoco"), 2)


LATE = "delays.command"
SIX = np.full((6, 4), 480.0)
INDICES = np.array([0, 2])
ONE = np.array([True])

REFUSED = {
    r"values\['delays.command'\]: must be from 0 to delays.longest_command = 0.02": [
        lambda b: b.set({LATE: 1.0}),
        lambda b: b.set({LATE: [0.0, 0.0, -1.0, 0.0]}),
    ],
    r"values\['plant.payload.mass'\]: nan is not a number": [lambda b: b.set({MASS: [0.1, float("nan"), 0.1, 0.1]})],
    r"values\['plant.payload.mass'\] = 'x': must be one number, or one for each of 4 lanes": [
        lambda b: b.set({MASS: "x"})
    ],
    r"values\['plant.payload.mass'\]: float64 of shape \(3,\), must be one number, or one for each of 4 lanes": [
        lambda b: b.set({MASS: [0.1] * 3}),
        lambda b: b.set({MASS: [0.1] * 3}, np.array([True, True, True, False])),
    ],
    r"values = 3: must be a mapping": [lambda b: b.set(3)],
    r"mask: bool of shape \(1,\), must be True or False for each of 4 lanes": [
        lambda b: b.set({MASS: 0.2}, ONE),
        lambda b: b.reset(ONE),
    ],
    r"mask: int64 of shape \(2,\), must be True or False for each of 4 lanes": [
        lambda b: b.reset(mask=INDICES),
        lambda b: b.set({MASS: 0.2}, INDICES),
    ],
    r"mask: int64 of shape \(4,\), must be": [
        lambda b: b.reset(np.arange(4)),
        lambda b: b.set({MASS: 0.2}, np.arange(4)),
    ],
    r"seed = -1: must be a whole number": [lambda b: b.reset(seed=-1)],
    r"seed = 3: must be left out with a mask": [lambda b: b.reset(np.ones(4, dtype=bool), seed=3)],
    r"actions: float64 of shape \(6,\), must be numbers of shape \(6, 4\) or \(6, 1\): rotor": [
        lambda b: b.step(SIX[:, 0])
    ],
    r"actions: float64 of shape \(1, 4\), must be": [lambda b: b.step(SIX[:1])],
    r"actions: float64 of shape \(\), must be": [lambda b: b.step(480.0)],
    r"actions = \[\['x', .*: must be numbers of shape": [lambda b: b.step([["x"] * 4] * 6)],
    r"actions = \[\[.*\]\]: must be an array": [lambda b: b.step([[1.0], [1.0, 2.0]])],
}


def test_what_lanes_cannot_be_given_is_one_line_and_nothing_has_changed():
    planned = dataclasses.replace(noisy(), delays=skyarm.Delays(command=0.002, longest_command=0.02))
    batch, other = (skyarm.BatchSession(planned, 4, [LATE, MASS], seed=1) for _ in range(2))
    for words, calls in REFUSED.items():
        for call in calls:
            with pytest.raises(skyarm.ScenarioError, match=f"^{words}"):
                call(batch)
    for each in (batch, other):
        each.set({LATE: [0.0, 0.005, 0.02, 0.01]}, [True, True, False, True])
        each.set({MASS: 0.1})
    assert batch.episodes.tolist() == [0, 1, 2, 3]
    for each in pushes(4, 20):
        assert np.array_equal(numbers(batch.step(each.tolist())), numbers(other.step(each)))


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("threads = 'x': must be a whole number, at least 1", lambda s: skyarm.BatchSession(s, 2, threads="x")),
        ("threads = 0: must be", lambda s: skyarm.BatchSession(s, 2, threads=0)),
        ("seed = -1: must be", lambda s: skyarm.BatchSession(s, 2, seed=-1)),
        ("paths = 'plant.payload.mass': must be a list of paths", lambda s: skyarm.BatchSession(s, 2, MASS)),
        ("paths = 5: must be a list of paths", lambda s: skyarm.Batch(s, 5)),
        ("scenario = 3: must be a Scenario", lambda _: skyarm.Batch(3)),
        ("log_every = -1: must be a whole number, at least 0", lambda s: skyarm.Batch(s, log_every=-1)),
        ("log_every = 1.5: must be", lambda s: skyarm.Batch(s, log_every=1.5)),
        ("width = 3: must be one of 1, 2, 4,", lambda s: skyarm.Batch(s, width=3)),
        ("width = 0: must be", lambda s: skyarm.Batch(s, width=0)),
    ],
)
def test_what_a_batch_cannot_be_made_with_is_one_line(words, call):
    with pytest.raises(skyarm.ScenarioError, match=f"^{words}"):
        call(scenario())


def test_what_a_batch_cannot_fly_with_is_one_line():
    batch = skyarm.Batch(scenario(duration=0.05), effort=0)
    for threads in (0, "x", 1.0):
        with pytest.raises(skyarm.ScenarioError, match=r"^threads = .*: must be a whole number, at least 1"):
            batch.fly({}, threads=threads)
    with pytest.raises(skyarm.ScenarioError, match=r"^values = 3: must be a mapping"):
        batch.fly(3)


def test_a_law_that_cannot_be_traced_is_no_hindrance_to_actions():
    planned = skyarm.load_scenario("case3_wind", controller="nmpc", duration=0.5)
    batch = skyarm.BatchSession(planned, 2)
    batch.step(pushes(2, 1)[0])
    assert not batch.ended.any()


@pytest.fixture
def shared(monkeypatch):
    """However few lanes there are, they are shared among threads."""
    monkeypatch.setattr(lane_stepper, "ALONE", 0)
    monkeypatch.setattr(shared_steps, "SHARED", 1e-12)


@pytest.mark.parametrize("single", [False, True])
def test_threads_change_no_bit(shared, single):
    actions, found = pushes(103, 30), []
    for threads in (1, 2, 3):
        batch = skyarm.BatchSession(noisy(), 103, single=single, threads=threads)
        for each in actions:
            batch.step(each)
        found.append(numbers(batch.state).tobytes())
    assert len(set(found)) == 1


def kernel_of(batch):
    return batch._stepper._kernel


def test_one_pool_lives_as_long_as_the_batch(shared):
    actions = pushes(103, 20)
    batch = skyarm.BatchSession(scenario(), 103, threads=3)
    kernel = kernel_of(batch)
    assert queues(kernel) == []
    batch.step(actions[0])
    at = queues(kernel)
    wait_until(lambda: len(serving(at)) == 3)
    made = serving(at)
    for each in actions:
        batch.step(each)
    assert serving(at) == made
    with batch:
        batch.step(actions[0])
    wait_until(lambda: not serving(at))
    batch.step(actions[1])
    later = queues(kernel)
    wait_until(lambda: len(serving(later)) == 3)
    del batch, kernel
    gc.collect()
    wait_until(lambda: not serving(later))


def test_flights_of_a_batch_share_one_pool(shared):
    batch = skyarm.Batch(scenario(duration=0.1), [MASS])
    masses = {MASS: np.linspace(0.0, 0.1, 103)}
    batch.fly(masses, threads=3)
    at = queues(batch.kernel)
    wait_until(lambda: len(serving(at)) == 3)
    made = serving(at)
    for _ in range(5):
        batch.fly(masses, threads=3)
    assert serving(at) == made
    batch.close()
    wait_until(lambda: not serving(at))


def test_what_is_raised_in_a_step_finds_every_lane_at_the_same_instant(shared, monkeypatch):
    """Ctrl-C may come while the caller waits: the step is flown to its end first."""
    actions = pushes(103, 2)
    alone, batch = (skyarm.BatchSession(scenario(), 103, threads=threads) for threads in (1, 3))
    for each in actions:
        alone.step(each)
    batch.step(actions[0])

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(shared_steps.SharedSteps, "_share", interrupted)
    with pytest.raises(KeyboardInterrupt):
        batch.step(actions[1])
    assert numbers(batch.state).tobytes() == numbers(alone.state).tobytes()


FORKED = """
import os, sys, numpy as np, skyarm
from skyarm.compile.llvm import lane_stepper, shared_steps
lane_stepper.ALONE, shared_steps.SHARED = 0, 1e-12
batch = skyarm.BatchSession(skyarm.load_scenario("case3", duration=1.0), 103, threads=3)
actions = np.array([[480.0]] * 4 + [[0.0]] * 2)
for _ in range(5):
    batch.step(actions)
child = os.fork()
for _ in range(5):
    z = batch.step(actions).position.z.copy()
if not child:
    os._exit(int(np.float64(z).sum() * 1e6) % 251)
_, status = os.waitpid(child, 0)
assert os.waitstatus_to_exitcode(status) == int(np.float64(z).sum() * 1e6) % 251
print("both")
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_a_fork_flies_on_with_threads_of_its_own():
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", FORKED], capture_output=True, text=True, timeout=60)  # noqa: PLW1510
    assert (done.returncode, done.stdout.strip()) == (0, "both"), done.stderr


def test_numbers_of_lanes_do_not_share_one_set_of_the_cache():
    assert [apart(blocks) for blocks in (1, 3, 4, 64, 65, 1024)] == [1, 3, 5, 65, 65, 1025]
