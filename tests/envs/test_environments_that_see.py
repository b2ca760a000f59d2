"""Environments whose observation has pictures: those of a session, in every lane, and a
policy that flies on what it saw.
"""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
from gymnasium.spaces import Dict
from gymnasium.utils.env_checker import check_env
from small_environments import one_program_a_task

import skyarm
from skyarm.algebra import Vec3
from skyarm.envs import Depth, as_law
from skyarm.envs.single_environment import Environment
from skyarm.envs.vector_environment import VectorEnvironment
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate import eyes
from skyarm.world.contact.free_object import FreeObject

EVERY, LATE, RATE = 5, 7, 100

BALL = "world.surfaces.ball.position"


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with one_program_a_task(tmp_path_factory.mktemp("cache")):
        yield


def arguments(**changes):
    scenario = scenario_from(
        {
            "schema": 1,
            "name": "look_down",
            "duration": 0.4,
            "rates": {"physics": 200, "control": RATE, "reference": RATE},
            "plant": {"vehicle": "hummingbird"},
            "controller": {"law": "decoupled_pd"},
            "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.5]}},
            "sensors": {
                "down": {
                    "kind": "depth_camera",
                    "rpy": [0.0, np.pi / 2.0, 0.0],
                    "width": 4,
                    "height": 3,
                    "field_of_view": 0.5,
                    "frequency": RATE / EVERY,
                    "latency": LATE / RATE,
                    "noise": {"constant": 0.01},
                }
            },
            "world": {
                "points": [{"name": "foot", "body": "base"}],
                "surfaces": [{"name": "ball", "shape": "sphere", "size": [0.5]}],
            },
        }
    )
    return {
        "scenario": scenario,
        "observation": ["position_error", Depth(sensor="down", scale=2.0)],
        "actions": "references",
        "randomise": {"x": {"uniform": [-0.3, 0.3]}},
        "derived": {f"{BALL}.x": "x", f"{BALL}.y": "-2 * x"},
        "precision": "bit_exact",
        **changes,
    }


def test_every_lane_sees_what_a_session_sees(monkeypatch):
    monkeypatch.setattr(eyes, "AT_ONCE", 2)
    envs = VectorEnvironment(3, **arguments())
    alone = Environment(**arguments())
    seen, _ = envs.reset(seed=5)
    one, _ = alone.reset(seed=6)
    np.testing.assert_array_equal(one["down"], seen["down"][1])
    drawn = envs.lanes.numbers()
    np.testing.assert_array_equal(drawn[f"{BALL}.y"], -2.0 * drawn[f"{BALL}.x"])
    sessions, frames = [], []
    for lane in range(3):
        own = dataclasses.replace(envs.lanes.lane_scenario(lane), seed=5 + lane)
        sessions.append(skyarm.Session(own, machine_code=False))
        frames.append({0: sessions[-1].frame("down").depth})
    for tick in range(1, 25):
        actions = np.zeros(envs.action_space.shape)
        seen, *_ = envs.step(actions)
        one, *_ = alone.step(actions[1])
        newest = max(0, (tick - LATE) // EVERY) * EVERY
        for lane, session in enumerate(sessions):
            session.step()
            if tick % EVERY == 0:
                frames[lane][tick] = session.frame("down").depth
            shares = np.clip(frames[lane][newest] / 2.0, 0.0, 1.0)
            np.testing.assert_allclose(
                seen["down"][lane, ..., 0], shares, rtol=0.0, atol=1e-12
            )
        np.testing.assert_array_equal(one["down"], seen["down"][1])
    # balls at other places, and noise of its own in each lane
    assert len({each.tobytes() for each in seen["down"]}) == 3


def test_a_centre_of_mass_that_varies_moves_no_shape():
    given = arguments()
    ball = FreeObject(
        name="ball",
        mass=0.3,
        shape="sphere",
        size=(0.2,),
        com=Vec3(0.0, 0.0, 0.02),
        position=Vec3(0.0, 0.0, 0.6),
    )
    scenario = given["scenario"]
    world = dataclasses.replace(scenario.world, objects=(ball,), surfaces=())
    around = dataclasses.replace(scenario.environment, world=world)
    given |= {
        "scenario": dataclasses.replace(scenario, environment=around),
        "randomise": {"world.objects.ball.com.z": {"uniform": [0.03, 0.05]}},
        "derived": None,
    }
    envs = VectorEnvironment(2, **given)
    seen, _ = envs.reset(seed=1)
    for lane in range(2):
        own = dataclasses.replace(envs.lanes.lane_scenario(lane), seed=1 + lane)
        depth = skyarm.Session(own, machine_code=False).frame("down").depth
        assert (depth < 1.0).any()
        shares = np.clip(depth / 2.0, 0.0, 1.0)
        np.testing.assert_allclose(seen["down"][lane, ..., 0], shares, atol=1e-12)


def test_a_rotor_with_a_shield_stays_where_it_is_seen():
    given = arguments(derived=None)
    scenario = given["scenario"]
    moved = "plant.vehicle.rotors.0.position.x"
    vary = {"randomise": {moved: {"uniform": [0.16, 0.17]}}}
    VectorEnvironment(1, **(given | vary))
    vehicle = scenario.plant.vehicle
    rotors = [dataclasses.replace(each, shield=(0.1, 0.05)) for each in vehicle.rotors]
    vehicle = dataclasses.replace(vehicle, rotors=tuple(rotors))
    plant = dataclasses.replace(scenario.agent.plant, vehicle=vehicle)
    agent = dataclasses.replace(scenario.agent, plant=plant)
    given["scenario"] = scenario.with_agent(agent)
    shield = {"plant.vehicle.rotors.0.shield.0": {"uniform": [0.1, 0.11]}}
    for each in (vary, {"randomise": shield}):
        with pytest.raises(ScenarioError, match="must not vary where 'down'"):
            VectorEnvironment(1, **(given | each))


def test_the_space_is_a_table_of_numbers_and_pictures():
    alone = Environment(**arguments())
    assert isinstance(alone.observation_space, Dict)
    assert alone.observation_space["down"].shape == (3, 4, 1)
    check_env(alone, skip_render_check=True)
    envs = VectorEnvironment(2, autoreset_mode="SameStep", **arguments(duration=0.02))
    first, _ = envs.reset(seed=1)
    assert first in envs.observation_space
    envs.step(np.zeros((2, 3)))
    seen, _, _, over, infos = envs.step(np.zeros((2, 3)))
    assert over.all()
    assert infos["final_obs"][1] in envs.single_observation_space
    # the next episode begins with a ball at another place
    assert not np.array_equal(infos["final_obs"][1]["down"], seen["down"][1])


def test_a_policy_flies_on_what_it_saw():
    # the state is first, wherever pictures stand in the observation
    named = arguments()["observation"][::-1]
    alone = Environment(**arguments(observation=named))
    weights = np.random.default_rng(0).normal(0.0, 0.3, (3, 3 + 12))
    law = as_law([(weights, np.zeros(3))], alone, name="sees")
    assert law.sees == ("down",)
    seen, _ = alone.reset(seed=4)
    own = dataclasses.replace(alone.lanes.lane_scenario(0), seed=4)
    session = skyarm.Session(own.with_controller(law), machine_code=False)
    for _ in range(20):
        seen, *_ = alone.step(weights @ [*seen["state"], *seen["down"].ravel()])
        session.step()
        np.testing.assert_allclose(
            [float(leaf[0]) for leaf in leaves(alone.lanes.state)],
            leaves(session.state),
            rtol=1e-9,
            atol=1e-9,
        )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"observation": [Depth(sensor="dwn")]}, "sensor = 'dwn': must be a camera"),
        ({"observation": [Depth(sensor="down")] * 2}, "once, here of down"),
        ({"derived": {f"{BALL}.x": "y"}}, r'derived."world.*must be'),
        ({"derived": {f"{BALL}.x": "x", "world.surfaces.b.size.0": "x"}}, "randomise"),
        (
            {"derived": {"world.surfaces.ball.size.0": "x + 1"}},
            "size.0': must not vary where 'down' is observed",
        ),
        ({"derived": {f"{BALL}.x": "0 * x", f"{BALL}.y": "1 / 0"}}, "divide by zero"),
    ],
)
def test_what_cannot_be_seen_or_drawn_is_one_line(given, words):
    with pytest.raises(ScenarioError, match=words) as error:
        Environment(**arguments(**given))
    assert "\n" not in str(error.value)


@pytest.mark.thorough
@pytest.mark.parametrize("task", ["ReachWhatTheWristSees", "FlyThroughWindow"])
def test_the_example_learns_in_miniature(task, monkeypatch, capsys):
    source = (
        Path(__file__).resolve().parents[2] / "examples" / "learn_to_see.py"
    ).read_text("utf-8")
    monkeypatch.setattr("sys.argv", ["learn_to_see.py", task, "2", "1", "8"])
    exec(compile(source, "learn_to_see.py", "exec"), {"__name__": "__main__"})
    teacher, student, law = capsys.readouterr().out.splitlines()
    assert teacher.startswith("teacher, from states: ")
    assert student.startswith("student, from depth, round 0: ")
    assert re.fullmatch(r"student sees (wrist|front) \w+", law)
