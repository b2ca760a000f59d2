"""The example that learns by PPO: the same seed learns the same bits, and what it
learned is a law, in C too.
"""

from __future__ import annotations

import dataclasses
import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
pytest.importorskip("jax", reason="needs the extra 'jax'")
import skyarm
from skyarm.control.onboard.export_c import export_c
from skyarm.envs import as_law
from support.engines import Loaded

SOURCE = Path(__file__).resolve().parents[2] / "examples" / "ppo_residual.py"


def test_the_plain_integral_keeps_the_tip_where_the_law_alone_loses_plants(monkeypatch):
    monkeypatch.syspath_prepend(SOURCE.parent)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    example: Any = importlib.import_module("ppo_residual")
    flight = skyarm.load_scenario("case3_wind")
    own, wrong = example.tip_errors(flight.controller, plants=4)
    assert own == pytest.approx(672.0, abs=0.1)
    # a plant whose tip is over 0.5 m off at the end is lost, wherever its flight ended
    assert np.isinf(wrong).any()
    assert (wrong[np.isfinite(wrong)] < 500.0).all()
    own, wrong = example.tip_errors(example.with_integral(flight), plants=4)
    assert own == pytest.approx(18.6, abs=0.1)
    assert (wrong < 42.0).all()


@pytest.mark.thorough
def test_a_seed_learns_the_same_bits_and_its_policy_is_a_law(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(SOURCE.parent)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    example: Any = importlib.import_module("ppo_residual")
    monkeypatch.setattr(example, "STEPS", 8)
    envs, policy, curve = example.train(3, iterations=2, worlds=32)
    _, again, same = example.train(3, iterations=2, worlds=32)
    assert curve == same
    assert policy == again
    assert [steps for steps, _ in curve] == [8 * 10 * 32, 2 * 8 * 10 * 32]
    _, other, _ = example.train(4, iterations=1, worlds=32)
    assert other != policy

    # the law's action is the last one and a step of what the network says
    seen = np.random.default_rng(0).normal(size=envs.single_observation_space.shape[0])
    x, layers = seen, policy.network.layers
    for layer in layers:
        x = np.array(layer.weights) @ x + np.array(layer.offsets)
        x = np.tanh(x) if layer is not layers[-1] else np.clip(x, -1.0, 1.0)
    assert policy(tuple(seen)) == pytest.approx(seen[-5:] + example.PACE * x, rel=1e-9)

    controller = as_law(policy, envs, name="learned")
    flight = skyarm.load_scenario("case3_wind", duration=0.2)
    flight = dataclasses.replace(flight, controller=controller)
    assert skyarm.run(flight).status == "completed"
    exported = Loaded(export_c(controller, name="law", period=0.005).text, tmp_path)
    session, memory = skyarm.Session(flight), controller.memory
    for _ in range(3):
        told = session.measurement, session.reference
        memory, command = controller.law(memory, *told, 0.005, par=controller.par)
        assert exported(*told) == pytest.approx(
            (*command.rotor_speeds, *command.efforts), rel=1e-9, abs=1e-12
        )
        session.step()
