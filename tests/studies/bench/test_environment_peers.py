"""Environments of other libraries beside ours: who is compared, and that ours fly as
the peer does.
"""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")

import peers as environment_peers


@pytest.fixture(autouse=True)
def _small(tmp_path, monkeypatch):
    """A cache of its own, machine code that is compiled quickly, one vehicle."""
    from skyarm.compile.llvm import kernel

    quick = kernel._make_engine
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    monkeypatch.setattr(kernel, "_make_engine", lambda text, effort: quick(text, 0))
    monkeypatch.setattr(environment_peers, "VEHICLES", {"no arm": "hummingbird"})


FEW = environment_peers.Extent(worlds=3, single_steps=7)


class Falling:
    """A peer's environment whose episodes are over after the third step."""

    def __init__(self, **settings):
        self.settings, self.resets, self.actions = settings, 0, []

    def reset(self, seed=None):
        self.resets += 1

    def step(self, action):
        self.actions.append(action)
        return None, 0.0, len(self.actions) >= 3, False, {}


def test_only_peers_that_are_installed_are_flown_and_the_others_are_named(monkeypatch):
    peers_known = environment_peers.PEERS
    monkeypatch.setattr(
        environment_peers, "PEERS", {"there": lambda _: ["flown"], "away": pytest.fail}
    )
    monkeypatch.setattr(
        environment_peers, "installed", lambda name: name in ("gymnasium", "there")
    )
    assert list(environment_peers.peers()) == [["flown"]]
    assert "away" in environment_peers.absent()
    assert "there" not in environment_peers.absent()
    monkeypatch.setattr(environment_peers, "installed", lambda name: name == "there")
    assert list(environment_peers.peers()) == []
    assert set(peers_known) == {"crazyflow", "PyFlyt", "gym_pybullet_drones"}


def test_a_peer_flies_past_its_ends_and_ours_flies_at_its_rates(monkeypatch):
    made = []
    module = ModuleType("PyFlyt.gym_envs.quadx_envs.quadx_hover_env")
    module.QuadXHoverEnv = lambda **settings: (
        made.append(Falling(**settings)) or made[-1]
    )
    for name in ("PyFlyt", "PyFlyt.gym_envs", "PyFlyt.gym_envs.quadx_envs"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    rates, place = [], environment_peers.place_to_reach
    monkeypatch.setattr(
        environment_peers,
        "place_to_reach",
        lambda *given: rates.append(given[1:3]) or place(*given),
    )
    peer, ours = environment_peers.beside_pyflyt(FEW)
    assert rates == [(120, 240)]
    assert peer.run() == 7.0
    assert (made[0].resets, len(made[0].actions)) == (1, 7)
    assert made[0].settings["agent_hz"] == 120
    assert ours.name == "ours, no arm"


def test_ours_begins_anew_where_an_episode_is_over():
    env = Falling()
    contender = environment_peers._single(
        env, np.zeros(4), "name", "words", 7, begins_anew=True
    )
    assert contender.run() == 7.0
    # the first beginning, and one after each of the steps 3 to 7
    assert env.resets == 6


@pytest.mark.parametrize(("control", "physics"), [(120, 240), (500, 500)])
def test_a_control_period_has_the_peers_number_of_integration_steps(control, physics):
    scenario = environment_peers.place_to_reach(
        "hummingbird_arm2_rotors", control, physics, 2.0
    )
    assert (scenario.rates.control, scenario.rates.physics, scenario.integrator) == (
        control,
        physics,
        "euler",
    )
    assert scenario.steps == 2 * control
    assert scenario.plant.vehicle.n == 2
    assert (
        environment_peers.place_to_reach(
            "hummingbird", control, physics, 2.0
        ).plant.vehicle.n
        == 0
    )


def test_vector_and_single_environments_of_ours_fly_on():
    (many,) = environment_peers._vectors(500, FEW)
    assert many.run() == 3.0 * FEW.steps
    (one,) = environment_peers._singles(30, 240, "rotors_and_joints", FEW)
    assert one.run() == 7.0
