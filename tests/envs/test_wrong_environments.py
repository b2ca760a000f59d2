"""What an environment is given is looked at before anything flies; each mistake is one
line with what is allowed.
"""

from __future__ import annotations

import dataclasses
import re
import warnings

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
import gymnasium
from small_environments import MASS, bare, one_program_a_task

import skyarm
from skyarm.algebra.scalars import where
from skyarm.envs import REWARDS, RatesAndThrust, RewardTerm
from skyarm.envs.env_task import make_task
from skyarm.envs.single_environment import Environment
from skyarm.envs.vector_environment import VectorEnvironment
from skyarm.records.coerce import RecordError
from skyarm.world.wind import wind_from


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with one_program_a_task(tmp_path_factory.mktemp("cache")):
        yield


@pytest.fixture(scope="module")
def two():
    made = VectorEnvironment(2, **bare())
    made.reset(seed=0)
    return made


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"scenario": "cas3"}, "scenario = 'cas3': did you mean 'case3'"),
        ({"scenario": 3}, "scenario = 3"),
        ({"scenario": "nowhere.toml"}, "nowhere.toml"),
        (
            {"actions": "torques"},
            "actions = 'torques': must be one of rotors_and_joints",
        ),
        ({"observation": "attitude"}, "observation = 'attitude': must be a list"),
        ({"observation": ()}, "at least one quantity"),
        (
            {"observation": ["atitude"]},
            r"observation\[0\] = 'atitude': did you mean 'attitude'",
        ),
        ({"reward": []}, "at least one term"),
        ({"reward": [3]}, r"reward\[0\] = 3: must be one of tip_near"),
        ({"precision": "half"}, "precision = 'half': must be one of single"),
        ({"duration": -1.0}, "duration = -1.0"),
        ({"duration": 0.0123}, "duration"),
        ({"controller": "paper_ct"}, "controller = 'paper_ct': must be left out"),
        ({"randomise": [MASS]}, "randomise = .*: must be a table"),
        (
            {"randomise": {"plant.mass": {"uniform": [0.0, 1.0]}}},
            "randomise: .*plant.mass",
        ),
        ({"randomise": {3: {"uniform": [0.0, 1.0]}}}, "randomise: path = 3"),
        (
            {"randomise": {MASS: {"gauss": [0.0, 1.0]}}},
            "must have exactly one of uniform",
        ),
        ({"randomise": {MASS: {"uniform": [1.0, 0.0]}}}, "the first below the second"),
        (
            {"randomise": {"plant.vehicle.base.mass": {"normal": [0.5, 0.1]}}},
            "randomise: .*base.mass",
        ),
    ],
)
def test_a_task_that_cannot_be_is_refused(given, words):
    with pytest.raises(ValueError, match=words) as error:
        make_task(**bare(**given))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "actions", ["rates_and_thrust", "rotors_and_joints", "residual"]
)
def test_a_governed_path_is_refused_under_all_actions(actions):
    """In flight a policy would see the slower reference, in the environment the other
    one.
    """
    scenario = skyarm.govern(skyarm.load_scenario("case2"), tilt=0.02)
    with pytest.raises(
        skyarm.ScenarioError, match="governor: must be left out of an environment"
    ):
        make_task(scenario, actions=actions)


def test_scenarios_that_lanes_do_not_fly_are_refused():
    other = skyarm.load_scenario("case3", plant="mujoco")
    with pytest.raises(skyarm.ScenarioError, match="must be rigid_body"):
        make_task(other)
    change = skyarm.Change(at=1.0, path=MASS, value=0.1)
    with pytest.raises(skyarm.ScenarioError, match="changes: must be left out"):
        make_task(dataclasses.replace(skyarm.load_scenario("case3"), changes=(change,)))
    called = skyarm.load_scenario("case3", controller="nmpc")
    with pytest.raises(ValueError, match="its law cannot be traced"):
        make_task(called, actions="residual")


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [
        (RatesAndThrust, {"rate": 0.0}),
        (RatesAndThrust, {"rate": "x"}),
        (REWARDS["tip_near"], {"scale": -1.0}),
    ],
)
def test_records_refuse_numbers_that_cannot_be(kind, numbers):
    with pytest.raises(RecordError, match=kind.__name__):
        kind(**numbers)


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        (
            np.zeros((2, 3)),
            r"shape \(2, 3\), must be of real numbers, of shape \(2, 4\)",
        ),
        (np.zeros((4, 2)), r"must be of real numbers, of shape \(2, 4\)"),
        (np.zeros(4), r"must be of real numbers, of shape \(2, 4\)"),
        (
            np.zeros((2, 4), dtype=bool),
            r"bool of shape \(2, 4\), must be of real numbers",
        ),
        (
            np.zeros((2, 4), dtype=complex),
            r"actions: complex128 of shape \(2, 4\), must be of real numbers",
        ),
        ("up", "must be of real numbers"),
        ([[0.0] * 4, [0.0] * 3], "must be an array"),
        ([[0.0] * 4, [0.0, np.nan, 0.0, 0.0]], r"actions\[1\] = .*must be finite"),
        ([[np.inf] * 4, [-np.inf] * 4], r"actions\[0\] = .*must be finite"),
    ],
)
def test_actions_that_are_none_are_refused_and_nothing_flies(two, actions, words):
    ticks = two.lanes.loop.ticks.copy()
    with pytest.raises(skyarm.ScenarioError, match=words) as error:
        two.step(actions)
    assert "\n" not in str(error.value)
    assert np.array_equal(two.lanes.loop.ticks, ticks)
    assert np.isfinite(two.lanes.actions).all()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"seed": -1}, "seed = -1"),
        ({"seed": 1.5}, "seed = 1.5"),
        ({"seed": [1]}, "a list of 1"),
        ({"seed": [1, "x"]}, r"seed\[1\] = 'x'"),
        ({"options": {"reset_mask": np.array([True])}}, "mask: bool of shape"),
        ({"options": {"reset_mask": np.array([0, 1])}}, "mask: int64 of shape"),
        ({"options": {"reset_mask": np.zeros(2, dtype=bool)}}, "at least one lane"),
    ],
)
def test_resets_that_cannot_be_are_refused(two, given, words):
    with pytest.raises((skyarm.ScenarioError, gymnasium.error.Error), match=words):
        two.reset(**given)


def test_other_arguments_of_environments_are_refused():
    for given, words in (
        (
            {"autoreset_mode": "Never"},
            "autoreset_mode = 'Never': must be one of NextStep",
        ),
        ({"num_envs": 0}, "num_envs = 0"),
        ({"copy": "x"}, "copy = 'x': must be True or False"),
        ({"threads": 0}, "threads = 0"),
    ):
        with pytest.raises(skyarm.ScenarioError, match=words):
            VectorEnvironment(**bare(**given))
    with pytest.raises(
        skyarm.ScenarioError, match="render_mode = 'ansi': must be rgb_array"
    ):
        Environment(**bare(render_mode="ansi"))
    with pytest.raises(TypeError, match="unexpected keyword argument 'foo'"):
        Environment(**bare(foo=1))
    with pytest.raises(skyarm.ScenarioError, match=r"must come after reset\(\)"):
        VectorEnvironment(2, **bare()).step(np.zeros((2, 4)))


def test_a_law_whose_command_is_not_finite_ends_the_episode_where_it_is():
    given = bare(actions="residual")

    def law(memory, measurement, reference, dt, *, par):
        late = where(measurement.position.z > 0.0, memory[0] + 1.0, 0.0)
        return (late,), skyarm.Command(
            rotor_speeds=(where(late > 2.5, float("nan"), 480.0),) * 4, efforts=()
        )

    planned = dataclasses.replace(
        given["scenario"].controller, name="fails", law=law, memory=(0.0,)
    )
    one = Environment(
        **{
            **given,
            "scenario": dataclasses.replace(given["scenario"], controller=planned),
        }
    )
    one.reset(seed=0)
    assert not one.step(np.zeros(4))[2]
    assert not one.step(np.zeros(4))[2]
    before = [float(c[0]) for c in one.lanes.state.velocity]
    observed, _, ended, truncated, info = one.step(np.zeros(4))
    assert (ended, truncated) == (True, False)
    assert info == {"status": "diverged", "cause": "the command was not finite"}
    assert [float(c[0]) for c in one.lanes.state.velocity] == before
    assert observed in one.observation_space


def test_a_single_environment_refuses_calls_at_the_wrong_time_and_names_its_end():
    reward = [REWARDS["position_distance"](), "lost"]
    one = Environment(
        **bare(actions=skyarm.envs.RotorsAndJoints(span=1.0), reward=reward)
    )
    with pytest.raises(skyarm.ScenarioError, match=r"must come after reset\(\)"):
        one.step(np.zeros(4))
    one.reset(seed=2**40 + 3)
    for wrong, words in (
        (
            np.zeros((1, 4)),
            (
                r"^action: float64 of shape \(1, 4\), must be of real numbers, of shape"
                r" \(4,\)"
            ),
        ),
        (
            np.zeros(3),
            (
                r"^action: float64 of shape \(3,\), must be of real numbers, of shape"
                r" \(4,\)"
            ),
        ),
        (
            np.zeros(4, dtype=complex),
            r"^action: complex128 of shape \(4,\), must be of real numbers",
        ),
    ):
        with pytest.raises(skyarm.ScenarioError, match=words):
            one.step(wrong)
    with pytest.raises(skyarm.ScenarioError, match=r"^action = .*must be finite"):
        one.step(np.full(4, np.nan))
    assert one.lanes.seeds[0] == (2**40 + 3) % 2**32
    ended = False
    while not ended:
        _, given, ended, truncated, info = one.step(-np.ones(4))
        assert not truncated
    assert info["status"] == "ground"
    off = [float(c[0]) for c in one.lanes.state.position] - np.array([0.0, 0.0, 0.3])
    assert given == pytest.approx(-np.linalg.norm(off) - 1.0, rel=1e-6)
    assert info["cause"].startswith("lowest point at z = -")
    with pytest.raises(skyarm.ScenarioError, match="before the end of the episode"):
        one.step(np.zeros(4))
    # an ending that comes in the very last period counts as one
    last = Environment(
        **bare(actions=skyarm.envs.RotorsAndJoints(span=1.0), reward=reward),
        duration=one.lanes.loop.ticks[0] / 100.0,
    )
    last.reset(seed=2**40 + 3)
    for _ in range(int(one.lanes.loop.ticks[0])):
        *_, ended, truncated, info = last.step(-np.ones(4))
    assert (ended, truncated, info["status"]) == (True, False, "ground")


def test_an_ending_is_told_with_what_was_passed():
    one = Environment(**bare())
    one.reset(seed=0)
    one.lanes.ending[0] = [*one.lanes.statuses].index("ground")
    one.lanes.state.position.z[0] = -0.25
    told = one._ending()
    assert told["status"] == "ground"
    assert re.fullmatch(r"lowest point at z = -0\.[2-9]\d* m.*", told["cause"])


@dataclasses.dataclass(frozen=True, kw_only=True)
class Untold(RewardTerm):
    """No number at all."""

    of_state = False

    def value(self, result):
        return (result.ended - result.ended) / (result.ended - result.ended)


def test_what_diverges_ends_the_episode_with_a_finite_observation():
    fast = {
        "initial.velocity.x": {"uniform": [1.05e4, 1.1e4]},
        "initial.rate.x": {"uniform": [1.0, 2.0]},
    }
    one = Environment(**bare(randomise=fast, reward=[REWARDS["spin"](scale=1e-9)]))
    one.reset(seed=0)
    observed, reward, ended, truncated, info = one.step(np.zeros(4))
    assert (ended, truncated) == (True, False)
    assert info == {"status": "diverged", "cause": "velocity.x passed 10000"}
    assert observed in one.observation_space
    assert reward == 0.0


def test_a_diverged_flight_has_rewards_without_state_and_no_term_spoils_the_others():
    """A push that no vehicle survives; then a term that is no number; then one that is
    too large.
    """
    push = {"environment.wind.force_W.x": {"uniform": [1.0e9, 1.1e9]}}
    planned = dataclasses.replace(
        bare()["scenario"],
        wind=wind_from({"mode": "force_wind", "force": [0.0, 0.0, 0.0]}, "wind"),
    )
    reward = [REWARDS["position_distance"](), Untold(), REWARDS["lost"](weight=10.0)]
    one = Environment(**bare(scenario=planned, randomise=push, reward=reward))
    one.reset(seed=0)
    _, given, ended, _, info = one.step(np.zeros(4))
    assert (ended, info["status"]) == (True, "diverged")
    assert given == -10.0
    sound = Environment(
        **bare(
            reward=[
                Untold(),
                REWARDS["spin"](scale=1e-9),
                REWARDS["alive"](weight=2.0**10),
            ]
        )
    )
    sound.reset(seed=0)
    assert sound.step(np.array([1.0, 0.0, 0.0, 0.0]))[1] == -1e6 + 2.0**10


def test_seeds_of_numpy_are_seeds_and_huge_actions_count_as_the_bound():
    for precision in ("single", "double"):
        one = Environment(**bare(precision=precision))
        found = []
        for action in (
            np.array([1e300, -1e300, 0.5, 0.0]),
            np.array([1.0, -1.0, 0.5, 0.0]),
            [1, -1, 0.5, 0],
        ):
            one.reset(seed=np.int64(5))
            assert one.lanes.seeds[0] == 5
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                found.append(one.step(action)[0])
            assert one.lanes.actions[:, 0].tolist() == [1.0, -1.0, 0.5, 0.0]
        assert np.array_equal(found[0], found[1])
        assert np.array_equal(found[0], found[2])
    with pytest.raises(skyarm.ScenarioError, match="seed = True"):
        one.reset(seed=True)


@pytest.mark.parametrize("make", [Environment, VectorEnvironment])
def test_a_closed_environment_says_so_in_one_line_and_keeps_its_scenario(make):
    env = make(**bare())
    env.reset(seed=0)
    still = np.zeros(env.action_space.shape, np.float32)
    env.step(still)
    env.close()
    env.close()
    for name, call in (("reset", env.reset), ("step", lambda: env.step(still))):
        with pytest.raises(
            skyarm.ScenarioError,
            match=rf"^{name}: must come before close\(\); .*closed[^\n]*$",
        ):
            call()
    assert env.scenario == bare()["scenario"]
