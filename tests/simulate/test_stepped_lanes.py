"""Lanes stepped by actions: each is a session of its own, to the bit; episodes begin
and end lane by lane.
"""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.compile.llvm import lane_stepper, shared_steps
from skyarm.compile.llvm.lane_stepper import apart
from skyarm.records.leaves import leaves
from skyarm.world.wind import wind_from
from support.engines import BatchSession, interrupted_queue

MASS = "plant.payload.mass"


def scenario(**changes):
    return skyarm.load_scenario(
        "case3_wind", controller="paper_ct", **{"duration": 0.5, **changes}
    )


def noisy(**changes):
    return dataclasses.replace(
        scenario(**changes),
        noise=skyarm.SensorNoise(position=0.001),
        delays=skyarm.Delays(command=0.002),
    )


def pushes(lanes, periods, seed=0):
    """Actions near hover, different in each lane and period."""
    generator = np.random.default_rng(seed)
    speeds = generator.normal(480.0, 20.0, (periods, 4, lanes))
    return np.concatenate(
        [speeds, generator.normal(0.0, 0.02, (periods, 2, lanes))], axis=1
    )


def numbers(state):
    return np.array(leaves(state))


def test_a_lane_is_a_session_of_its_own_to_the_bit():
    """Also with delayed commands, a payload of its own, and a law of the scenario's
    that nobody asks.
    """
    lanes, actions, masses = 21, pushes(21, 40), np.linspace(0.0, 0.1, 21)
    batch = BatchSession(noisy(), lanes, [MASS], bit_exact=True, seed=5)
    batch.set({MASS: masses})
    batch.reset(seed=5)
    found = [numbers(batch.step(each)).copy() for each in actions]
    for lane in (0, 7, 20):
        changed = skyarm.with_numbers(
            dataclasses.replace(noisy(), seed=5, episode=lane), {MASS: masses[lane]}
        )
        one = skyarm.Session(changed)
        for action, held in zip(actions[:, :, lane], found, strict=True):
            one.step(
                skyarm.Command(
                    rotor_speeds=tuple(action[:4]), efforts=tuple(action[4:])
                )
            )
            assert np.array_equal(numbers(one.state), held[:, lane])


def test_a_law_flies_in_a_session_as_it_does_alone():
    """Noise and all; the law's commands in place of actions."""
    planned = dataclasses.replace(noisy(), seed=3)
    batch = BatchSession(planned, 3, bit_exact=True, seed=3, law=True)
    for _ in range(planned.steps - 1):
        batch.step()
    for lane in range(3):
        log = skyarm.run(dataclasses.replace(planned, episode=lane))
        assert np.array_equal(np.array(batch.state.position)[:, lane], log.position[-1])


def blowing(**changes):
    """Noise of sensors and of turbulence, which starts anew in each episode."""
    gusty = wind_from(
        {"mode": "moving_air", "turbulence": {"altitude": 6.0, "wind_20ft": 7.7}},
        "wind",
    )
    return dataclasses.replace(noisy(**changes), wind=gusty)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("paths = 5: must be a list of paths", lambda s: skyarm.Batch(s, 5)),
        ("scenario = 3: must be a Scenario", lambda _: skyarm.Batch(3)),
        (
            "log_every = -1: must be a whole number, at least 0",
            lambda s: skyarm.Batch(s, log_every=-1),
        ),
        ("log_every = 1.5: must be", lambda s: skyarm.Batch(s, log_every=1.5)),
    ],
)
def test_what_a_batch_cannot_be_made_with_is_one_line(words, call):
    with pytest.raises(skyarm.ScenarioError, match=f"^{words}"):
        call(scenario())


def test_what_a_batch_cannot_fly_with_is_one_line():
    batch = skyarm.Batch(scenario(duration=0.05), effort=0)
    for threads in (0, "x", 1.0):
        with pytest.raises(
            skyarm.ScenarioError,
            match=r"^threads = .*: must be a whole number, at least 1",
        ):
            batch.fly({}, threads=threads)
    with pytest.raises(skyarm.ScenarioError, match=r"^values = 3: must be a mapping"):
        batch.fly(3)


def test_a_law_that_cannot_be_traced_is_no_hindrance_to_actions():
    planned = skyarm.load_scenario("case3_wind", controller="nmpc", duration=0.5)
    batch = BatchSession(planned, 2)
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
        batch = BatchSession(noisy(), 103, single=single, threads=threads)
        for each in actions:
            batch.step(each)
        found.append(numbers(batch.state).tobytes())
    assert len(set(found)) == 1


def test_what_is_raised_in_a_step_finds_every_lane_at_the_same_instant(
    shared, monkeypatch
):
    """Ctrl-C may come while the caller waits: the step is flown to its end first."""
    actions = pushes(103, 2)
    alone, batch = (
        BatchSession(scenario(), 103, threads=threads) for threads in (1, 3)
    )
    for each in actions:
        alone.step(each)
    batch.step(actions[0])

    monkeypatch.setattr(shared_steps, "SimpleQueue", interrupted_queue())
    with pytest.raises(KeyboardInterrupt):
        batch.step(actions[1])
    assert numbers(batch.state).tobytes() == numbers(alone.state).tobytes()


FORKED = """
import os, sys, numpy as np, skyarm
from support.engines import BatchSession
from skyarm.compile.llvm import lane_stepper, shared_steps
lane_stepper.ALONE, shared_steps.SHARED = 0, 1e-12
batch = BatchSession(skyarm.load_scenario("case3", duration=1.0), 103, threads=3)
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
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n{FORKED}"
    )
    words = [sys.executable, "-W", "ignore", "-c", code]
    done = subprocess.run(
        words, capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, "both"), done.stderr


def test_numbers_of_lanes_do_not_share_one_set_of_the_cache():
    assert [apart(blocks) for blocks in (1, 3, 4, 64, 65, 1024)] == [
        1,
        3,
        5,
        65,
        65,
        1025,
    ]
