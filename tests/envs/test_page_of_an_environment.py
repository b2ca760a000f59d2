"""render_mode "human": a page of the studio shows every step of one environment, behind the studio's guard."""

from __future__ import annotations

import http.client
import math
from dataclasses import asdict
from typing import Any
from urllib.parse import urlsplit

import gymnasium
import numpy as np
import pytest

import skyarm.envs  # noqa: F401 - registers the environments
from skyarm.envs import rendering
from skyarm.envs.rendering import PageOptions, options_of_modes
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.view.studio.page import LONGEST_WAIT

QUIET = {"browser": False, "plain": True, "speed": math.inf}


class Shown:
    """In place of a page: what it is told."""

    address = "http://here"

    def __init__(self, title: str, **options: Any) -> None:
        self.title, self.options, self.told = title, options, list[tuple[Any, ...]]()

    def begin(self, scenario: Any, now: Any) -> None:
        self.told.append(("begin", scenario, float(now.ticks), float(now.state.position.x)))

    def show(self, now: Any, lost: str) -> None:
        self.told.append(("show", float(now.ticks), float(now.state.position.x), lost))

    def close(self) -> None:
        self.told.append(("close",))


def made(task: str = "skyarm/Hover-v0", **options: Any) -> Any:
    return gymnasium.make(task, render_mode="human", render_options=QUIET | options).unwrapped


def test_every_step_and_every_beginning_is_shown_with_the_numbers_of_its_episode(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(rendering, "EpisodePage", Shown)
    env = made("skyarm/Recover-v0", port=8123)
    page: Any = env.page._page
    assert (page.options, page.title) == ({**asdict(PageOptions()), **QUIET, "port": 8123}, "skyarm: recover")
    assert capsys.readouterr().err == "skyarm: http://here\n"
    env.reset(seed=3)
    ((word, scenario, ticks, x),) = page.told
    assert (word, ticks) == ("begin", 0.0)
    assert scenario == env.lanes.lane_scenario(0)
    assert x == float(env.lanes.state.position.x[0])
    falls = np.full(env.action_space.shape, -1.0, np.float32)
    over = False
    while not over:
        _, _, ended, truncated, info = env.step(falls)
        over = ended or truncated
    assert page.told[1][:2] == ("show", 1.0)
    assert [each[1] for each in page.told[1:]] == list(range(1, len(page.told)))
    assert page.told[-1][2:] == (float(env.lanes.state.position.x[0]), info["cause"])
    assert {each[3] for each in page.told[1:-1]} == {""}
    env.reset()
    assert page.told[-1][:1] == ("begin",)
    assert page.told[-1][1] == env.lanes.lane_scenario(0) != scenario
    assert env.render() is None
    env.close()
    assert page.told[-1] == ("close",)


def test_a_page_is_on_loopback_and_asks_for_its_token() -> None:
    pytest.importorskip("viser")
    env = made()
    env.reset(seed=1)
    found, address = env.page._page, urlsplit(env.page.address)
    assert address.hostname == "127.0.0.1"
    for path, status in (("/", 403), (f"/?{address.query}", 200)):
        connection = http.client.HTTPConnection("127.0.0.1", address.port, timeout=20.0)
        connection.request("GET", path, headers={"Host": f"127.0.0.1:{address.port}"})
        assert connection.getresponse().status == status
        connection.close()
    found._drawn = -math.inf  # however little of the wall's time has passed
    env.step(np.zeros(env.action_space.shape, np.float32))
    placed = found._episode.poses()
    np.testing.assert_allclose(placed.positions[0], [float(c[0]) for c in env.lanes.state.position], atol=1e-6)
    env.reset(seed=1)
    assert [each.time for each in found._episode.sights] == [0.0], "the same seed begins anew"
    with pytest.raises(ScenarioError, match=rf"render_options.port = {address.port}: .*must be free"):
        made(port=address.port)
    env.close()
    env.close()
    with pytest.raises(ScenarioError, match=r"^reset: must come before close\(\)"):
        env.reset()
    with pytest.raises(ConnectionRefusedError):
        http.client.HTTPConnection("127.0.0.1", address.port, timeout=5.0).connect()


def test_an_episode_is_shown_at_the_pace_of_the_clock_and_the_clock_waits_for_who_pauses() -> None:
    pytest.importorskip("viser")
    env = made(speed=2.0)
    page, now, waited = env.page._page, [100.0], list[float]()

    def wait(seconds: float) -> None:
        waited.append(seconds)
        now[0] += seconds

    page._clock, page._wait, rate = lambda: now[0], wait, env.lanes.task.scenario.rates.control
    env.reset(seed=1)
    still = np.zeros(env.action_space.shape, np.float32)
    for _ in range(10):
        env.step(still)
    assert sum(waited) == pytest.approx(10 / rate / 2.0), "an episode's second in half a second"
    seen = page._episode.session.tick
    assert 0 < seen < 10, "thirty times a second, not at every step"
    now[0] += LONGEST_WAIT - 0.1
    before = len(waited)
    env.step(still)
    assert len(waited) == before, "late: nothing is waited for"
    assert page._episode.session.tick == 11
    now[0] += 10.0
    env.step(still)
    env.step(still)
    assert waited[before:] == pytest.approx([1 / rate / 2.0]), "after a pause the clock goes on from here"
    env.close()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"width": 3}, "render_options: width = 3: must be an even number"),
        ({"prot": 1}, "render_options: 'prot': did you mean 'port'"),
        ({"port": -1}, "render_options.port = -1: must be at least 0"),
        ({"port": True}, "render_options.port = True: must be"),
        ({"speed": 0}, "render_options.speed = 0.0: must be at least 0.001"),
        ({"speed": math.nan}, "render_options.speed = nan: must be a number"),
        ({"speed": 10**400}, "render_options.speed = 1"),
        ({"speed": "fast"}, "render_options.speed = 'fast': must be a number"),
        ({"plain": 1}, "render_options.plain = 1: must be"),
        (3, "render_options = 3: must be a table"),
    ],
)
def test_options_that_cannot_be_are_one_line(given: Any, message: str) -> None:
    with pytest.raises(ScenarioError) as error:
        gymnasium.make("skyarm/Hover-v0", render_mode="human", render_options=given)
    assert str(error.value).startswith(message)
    assert options_of_modes(None) == ({}, PageOptions())


def test_one_table_of_options_serves_pictures_and_a_page() -> None:
    given = {"width": 96, "speed": 2.0, "height": 64}
    assert options_of_modes(given) == ({"width": 96, "height": 64}, PageOptions(speed=2.0))


def test_many_environments_have_no_page() -> None:
    with pytest.raises(ScenarioError, match=r"render_mode = 'human': must be one of rgb_array, or None"):
        gymnasium.make_vec("skyarm/Hover-v0", 2, vectorization_mode="vector_entry_point", render_mode="human")
