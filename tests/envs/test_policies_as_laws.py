"""A policy flies as a law what it flew in its environment, to the bit; what is no
policy is refused in one line.
"""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
from small_environments import bare, noisy, one_program_a_task

import skyarm
from skyarm.control.actuator_layer import plain_model
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import ControllerError
from skyarm.control.onboard.export_c import export_c
from skyarm.control.safety import with_safety_layer
from skyarm.envs import as_law, network
from skyarm.envs.env_task import make_task
from skyarm.envs.single_environment import Environment
from skyarm.scenario.controller_table import on_actuators
from support.cases import sampled
from support.engines import Loaded


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with one_program_a_task(tmp_path_factory.mktemp("cache")):
        yield


def a_network(environment, seed=0):
    """Small weights, drawn."""
    seen, size = (
        environment.observation_space.shape[0],
        environment.action_space.shape[0],
    )
    draw = np.random.default_rng(seed).normal
    layers = [
        (draw(0.0, 0.3, (5, seen)), draw(0.0, 0.1, 5)),
        (draw(0.0, 0.5, (size, 5)), draw(0.0, 0.1, size)),
    ]
    return network(layers, means=draw(0.0, 0.1, seen), deviations=np.full(seen, 0.7))


def flown(environment, policy, seed):
    """Positions of an episode in the environment, and its last step's words."""
    observed, _ = environment.reset(seed=seed)
    positions, over = [], False
    while not over:
        observed, _, ended, truncated, info = environment.step(
            np.array(policy(tuple(observed.tolist())))
        )
        positions.append([float(c[0]) for c in environment.lanes.state.position])
        over = ended or truncated
    return np.array(positions), info


def tilting():
    """Rotors with servos, on which a law that knows nothing of them keeps its commands
    without their angles.
    """
    reference = {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        "joints": [0.1, 0.1],
    }
    table = {"schema": 1, "name": "tilting", "duration": 0.1, "reference": reference}
    return skyarm.scenario_from(
        table
        | {
            "plant": {"vehicle": "voliro_like"},
            "controller": {"law": "centroidal"},
        }
    )


CASES = {
    "rates_and_thrust": bare,
    "residual": bare,
    "rotors_and_joints": lambda **more: {"scenario": noisy(), **more},
    "references": lambda **more: {"scenario": noisy(), **more},
    "residual, an arm": lambda **more: {"scenario": noisy(), **more},
    "residual, a law that keeps its commands": lambda **more: {
        "scenario": noisy(controller="centroidal_tip"),
        **more,
    },
    "residual, rotors that tilt": lambda **more: {"scenario": tilting(), **more},
}


@pytest.mark.parametrize("case", sampled(list(CASES), 99, keep=("residual",)))
def test_a_policy_flies_as_a_law_what_it_flew_in_its_environment(case):
    environment = Environment(
        **CASES[case](actions=case.split(",")[0], precision="bit_exact")
    )
    policy = a_network(environment)
    positions, info = flown(environment, policy, seed=3)
    planned = environment.lanes.task.scenario
    log = skyarm.run(
        dataclasses.replace(planned, controller=as_law(policy, environment), seed=3)
    )
    assert np.array_equal(positions[:-1], log.position[1 : len(positions)])
    assert log.status == info.get("status", "completed")


def test_a_policy_on_a_law_is_defined_where_the_law_is_and_one_alone_everywhere():
    planned = skyarm.load_scenario("case3", controller="paper_ct")
    edge = dataclasses.replace(
        planned.controller, margin=lambda quaternion: quaternion.w, limit="upside down"
    )
    planned = dataclasses.replace(planned, controller=edge)
    for actions, defined in (
        ("residual", planned.controller),
        ("rates_and_thrust", None),
    ):
        law = as_law(lambda numbers: numbers[:6], make_task(planned, actions=actions))
        assert law.margin is (defined and defined.margin)
        assert law.limit == (defined.limit if defined else "")


def test_a_function_and_an_untraceable_one_fly_as_the_network_does():
    environment = Environment(**bare(actions="rates_and_thrust", precision="bit_exact"))
    policy = a_network(environment)

    def function(numbers):
        return policy(numbers)

    def of_arrays(numbers):
        return policy(tuple(np.asarray(numbers, dtype=float).tolist()))

    planned = dataclasses.replace(environment.lanes.task.scenario, duration=0.1)
    laws = (
        as_law(policy, environment),
        as_law(function, environment),
        as_law(of_arrays, environment, traceable=False),
        as_law(lambda n: np.array(policy(n)), environment, traceable=False),
        as_law(lambda n: tuple(np.array(policy(n))), environment, traceable=False),
    )
    logs = [skyarm.run(dataclasses.replace(planned, controller=law)) for law in laws]
    for log in logs[1:]:
        assert np.array_equal(logs[0].position, log.position)


@pytest.mark.thorough
def test_a_policy_on_a_law_is_one_c_file(tmp_path):
    """Its numbers are those of the law called with floats, but for the last digit of a
    contraction.
    """
    environment = Environment(**bare(actions="residual"))
    controller = as_law(a_network(environment), environment)
    text = export_c(controller, name="law", period=0.01).text
    session = skyarm.Session(
        dataclasses.replace(environment.lanes.task.scenario, controller=controller)
    )
    exported, memory = Loaded(text, tmp_path), controller.memory
    for _ in range(3):
        told = session.measurement, session.reference
        memory, command = controller.law(memory, *told, 0.01, par=controller.par)
        assert exported(*told) == pytest.approx(command.rotor_speeds, rel=1e-9)
        session.step()


def test_a_network_is_tanh_between_affine_layers_held_within_one():
    draw = np.random.default_rng(4).normal
    A, a, B, b = draw(size=(3, 4)), draw(size=3), draw(size=(2, 3)), draw(size=2)
    found = network(
        [(A, a), (B, b)], means=[1.0, 0.0, 2.0, 0.0], deviations=[2.0, 1.0, 0.5, 1.0]
    )
    x = draw(size=4)
    wanted = (
        B @ np.tanh(A @ ((x - [1.0, 0.0, 2.0, 0.0]) / [2.0, 1.0, 0.5, 1.0]) + a) + b
    )
    assert found(tuple(x)) == pytest.approx(np.clip(wanted, -1.0, 1.0), rel=1e-12)
    assert network([(10.0 * np.eye(2), np.zeros(2))])((1.0, -1.0)) == (1.0, -1.0)


def test_a_network_for_another_observation_is_refused_with_both_counts():
    task = _task()
    law = as_law([(np.zeros((4, 33)), np.zeros(4))], task)
    with pytest.raises(
        ControllerError,
        match="policy: takes 33 numbers, must be 19 for this observation",
    ):
        skyarm.run(dataclasses.replace(task.scenario, controller=law))


@pytest.mark.parametrize("actions", ["residual", "rotors_and_joints"])
def test_a_policy_gets_no_second_actuator_layer(actions):
    """Its set points are the environment's; inverted once more as if they were torques,
    they are others.
    """
    table = {
        "schema": 1,
        "name": "servos",
        "duration": 0.1,
        "controller": {"law": "decoupled_pd"},
    }
    table["reference"] = {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        "joints": [0.1] * 5,
    }
    scenario = skyarm.scenario_from(table | {"plant": {"vehicle": "hexarotor12_arm5"}})
    environment = Environment(scenario=scenario, actions=actions)
    law = as_law(a_network(environment), environment)
    model, period = scenario.agent.model, scenario.rates.period
    assert on_actuators(law, model, period, servos=True) is law
    safe = with_safety_layer(law)
    assert on_actuators(safe, model, period, servos=True) is safe
    plain = make_controller("decoupled_pd", plain_model(model))
    assert on_actuators(plain, model, period, servos=True) is not plain


ONE = (np.zeros((4, 19)), np.zeros(4))


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        (7, "must be a function, or layers"),
        ([], "at least one layer"),
        ([(np.zeros((4, 19)), np.zeros(3))], "layer 0: weights of shape"),
        ([ONE, (np.zeros((4, 5)), np.zeros(4))], "layer 1: weights of shape"),
        ([(np.full((4, 19), np.nan), np.zeros(4))], "must be finite"),
        ([(np.zeros((3, 19)), np.zeros(3))], "gives 3 numbers, must be 4"),
    ],
)
def test_what_is_no_policy_is_refused(policy, words):
    task = Environment(**bare()).lanes.task if words.startswith("gives") else _task()
    with pytest.raises(ControllerError, match=words) as error:
        as_law(policy, task)
    assert "\n" not in str(error.value)


def _task():
    return make_task(**bare())


def test_what_is_no_environment_and_normalization_that_does_not_fit_are_refused():
    with pytest.raises(ControllerError, match=r"must be an environment of skyarm\.env"):
        as_law([ONE], object())
    with pytest.raises(ControllerError, match=r"means = .*must be 19 finite numbers"):
        network([ONE], means=[0.0])
    with pytest.raises(ControllerError, match="deviations: must be above 0"):
        network([ONE], deviations=[0.0] * 19)


@pytest.mark.thorough
def test_the_example_that_learns_is_better_than_the_law_below_it(monkeypatch, capsys):
    """Two generations of it, on another motion than it learned in."""
    source = (
        Path(__file__).resolve().parents[2] / "examples" / "learn_a_residual.py"
    ).read_text("utf-8")
    monkeypatch.setattr("sys.argv", ["learn_a_residual.py", "2"])
    exec(compile(source, "learn_a_residual.py", "exec"), {"__name__": "__main__"})
    below, learned = (line.split() for line in capsys.readouterr().out.splitlines())
    assert (below[:2], learned[:2]) == (
        ["hybrid_computed_torque", "completed"],
        ["learned", "completed"],
    )
    assert float(learned[2]) < 0.7 * float(below[2])


COMPARED = """
import numpy as np, gymnasium, skyarm.envs

def policy(push):
    env = gymnasium.make("skyarm/HoldTipInWind-v0")
    weights = np.zeros((env.action_space.shape[0], env.observation_space.shape[0]))
    layers = [(weights, np.full(len(weights), push))]
    return skyarm.envs.as_law(layers, env, name="policy")

def still(model):
    return policy(0.0)

def pushing(model):
    return policy(0.3)
"""


@pytest.mark.thorough
def test_a_policy_is_compared_with_the_law_that_it_adds_to(tmp_path):
    """A residual of zero is the paper's law; another flies elsewhere."""
    (tmp_path / "mine.py").write_text(COMPARED)
    words = [
        "compare",
        "case3_wind",
        "--laws",
        "paper_ct,mine.py:still,mine.py:pushing",
        "--out",
        "out",
    ]
    subprocess.run(
        [sys.executable, "-m", "skyarm", *words],
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )
    (found,) = json.loads((tmp_path / "out" / "results.json").read_text())["summaries"][
        "given"
    ].values()
    errors = {
        law: each["metrics"]["ee_error_mean_continuous"]["mean"]
        for law, each in found.items()
    }
    assert errors["mine.py:still"] == pytest.approx(errors["paper_ct"], rel=1e-9)
    assert errors["mine.py:pushing"] != pytest.approx(errors["paper_ct"], rel=1e-3)
