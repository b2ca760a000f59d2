"""Replay of a measured flight: errors, clock and picture from planted motions, and the
page over its own protocol.
"""

from __future__ import annotations

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from tab import Tab

import skyarm
from skyarm.log.motion import PoseSeries, PredictedMotion, join_motions
from skyarm.view.studio.replay import RATE, PredictionReplay, mean_error
from skyarm.view.studio.replay_page import ReplayPage, ReplayPicture
from skyarm.view.studio.server import (
    AccessGuard,
    close_server,
    listening_socket,
    open_server,
)
from support.peers import Scene

START, SECONDS = 100.0, 4.0
"""s on the flight's own clock: begin and duration of the flight."""

DRIFT, TURN = 0.1, 0.2
"""m/s and rad/s by which the planted model leaves the flight; held velocity and rate do
twice as fast."""

LANDED = 0.5
"""s at both ends without a prediction."""


def motion(
    first: float, last: float, begin: float, drift: float = 0.0, turn: float = 0.0
) -> PoseSeries:
    """Flight along x at 1 m/s that is left from ``begin`` on along z, and by a rotation
    about x.
    """
    time = START + np.linspace(first, last, round((last - first) * 50) + 1)
    zero, age = 0.0 * time, time - START - begin
    return PoseSeries(
        time=time,
        position=np.stack([time - START, zero, 1.0 + drift * age], axis=1),
        quaternion=np.stack(
            [np.cos(0.5 * turn * age), np.sin(0.5 * turn * age), zero, zero], axis=1
        ),
        joints=np.tile(0.3, (len(time), 2)),
    )


def predicted(horizon: float) -> PredictedMotion:
    """Prediction that leaves the flight evenly, set back after each horizon."""
    begins = np.arange(LANDED, SECONDS - LANDED - 1e-9, horizon)
    spans = [(b, min(b + horizon, SECONDS - LANDED)) for b in begins]
    model, held = (
        join_motions([motion(a, b, a, factor * DRIFT, factor * TURN) for a, b in spans])
        for factor in (1.0, 2.0)
    )
    return PredictedMotion(model=model, held=held, begins=START + begins)


def replay(horizon: float = 1.0) -> PredictionReplay:
    measured = motion(0.0, SECONDS, 0.0)
    return PredictionReplay(
        "swings", skyarm.load_vehicle("hummingbird_arm2"), measured, predicted, horizon
    )


@pytest.mark.parametrize(
    ("time", "age"), [(0.5, 0.0), (1.25, 0.75), (1.49, 0.99), (1.5, 0.0), (3.25, 0.75)]
)
def test_errors_grow_since_the_model_was_set_back(time: float, age: float) -> None:
    shown = replay()
    shown.go(round(time * RATE))
    assert shown.age[shown.tick] == pytest.approx(age, abs=1e-6)
    np.testing.assert_allclose(
        shown.errors[:, shown.tick], [DRIFT * age, TURN * age], atol=1e-6
    )
    np.testing.assert_allclose(
        shown.held_errors[:, shown.tick], [2 * DRIFT * age, 2 * TURN * age], atol=1e-6
    )


def test_a_longer_horizon_has_larger_errors_and_ends_of_the_log_have_none() -> None:
    shown = replay()
    short = mean_error(shown.errors)
    # of age from 0 to 1 s
    assert short == pytest.approx([DRIFT / 3.0**0.5, TURN / 3.0**0.5], rel=0.02)
    shown.show(shown.predict(3.0), 3.0)
    assert mean_error(shown.errors) == pytest.approx(
        [3.0 * each for each in short], rel=0.02
    )
    assert np.isnan(shown.errors[:, [0, 45, 355, -1]]).all()
    assert np.isnan(mean_error(np.full((2, 3), np.nan))).all()


def test_plots_show_the_last_seconds_and_trails_break_where_the_model_is_set_back() -> (
    None
):
    shown = replay(0.2)
    shown.go(300)
    model, held = (each.recent(10.0) for each in shown.curves)
    assert [len(model), model[0].time, model[-1].time] == [
        151,
        0.0,
        3.0,
    ], "every second picture of 3 s"
    assert held[75].position == pytest.approx(2.0 * model[75].position)
    shown.show(shown.predict(0.05), 0.05)
    assert shown.curves[0].recent(10.0)[0].time == pytest.approx(2.0), "20 horizons"
    shown.show(shown.predict(0.5), 0.5)
    measured, own = shown.trails(1.0)
    assert (len(measured), len(own)) == (100, 98), "set back at 2.5 and 3 s"
    assert np.linalg.norm(own[:, 1] - own[:, 0], axis=1).max() < 1.2 / RATE


def test_the_clock_reaches_every_instant_stops_at_the_end_and_begins_again() -> None:
    shown = replay()
    assert shown.steps == 401
    shown.go_to_time(3.5)
    assert (shown.time, shown.playing) == (3.5, False)
    shown.playing, shown.speed = True, 4.0
    shown.advance(0.2)
    assert (shown.time, shown.playing) == (4.0, False)
    shown.playing = True
    shown.advance(0.1)
    assert shown.time == pytest.approx(0.4)
    shown.reset()
    shown.go_to_time(2.0)
    assert shown.time == 2.0


def test_the_picture_has_the_flight_as_a_ghost_and_the_predicted_model() -> None:
    scene = Scene()
    shown, camera = replay(), SimpleNamespace()
    picture = ReplayPicture(SimpleNamespace(scene=scene, initial_camera=camera), shown)
    picture.follow = False
    for time, height in ((1.25, 1.075), (2.0, 1.05)):
        shown.go(round(time * RATE))
        picture.draw(shown)
        assert scene.nodes["/stage/measured"].position == pytest.approx(
            [time, 0.0, 1.0], abs=1e-3
        )
        assert scene.nodes["/stage/model"].position == pytest.approx(
            [time, 0.0, height], abs=1e-3
        )
        # the log's joints on both
        for body in ("0", "1"):
            one, other = (
                scene.nodes[f"/stage/{name}/{body}"] for name in ("measured", "model")
            )
            assert one.wxyz == pytest.approx(other.wxyz, abs=1e-3)
    shown.go(10)
    picture.draw(shown)
    assert not scene.nodes["/stage/model"].visible
    assert scene.nodes["/stage/measured"].position == pytest.approx(
        [0.1, 0.0, 1.0], abs=1e-3
    )
    shown.go(100)
    picture.draw(shown)
    assert scene.nodes["/stage/model"].visible
    picture.follow = True
    picture.draw(shown)
    assert scene.nodes["/stage"].position == pytest.approx([-1.0, 0.0, 0.0], abs=1e-3)


def test_the_page_tells_the_errors_and_its_slider_sets_the_horizon() -> None:
    listening = listening_socket(0)
    port, token = listening.getsockname()[1], "0123456789abcdef"
    server = open_server(listening, AccessGuard(port, token), "test")
    page = ReplayPage(server, replay())
    thread = threading.Thread(target=page.run)
    thread.start()
    try:
        page.do(lambda clock: clock.go_to_time(1.25))
        tab = Tab(port, token)
        tab.listen(lambda t: "1.25 s, paused, 1x" in t.status(), 30.0)
        assert (
            "model hummingbird_arm2: 75 mm, 8.59 deg, 0.75 s after it was set back"
            in tab.status()
        )
        assert "root mean square: 57" in tab.status()
        assert (
            "Grey: measured. Blue: model under the recorded commands. An open loop"
            " drifts" in tab.status()
        )
        tab.move(tab.find("set back"), 0.5)
        tab.listen(
            lambda t: (
                "25 mm, 2.86 deg, 0.25 s after" in t.status()
                and "every 0.5 s" in t.status()
            ),
            30.0,
        )
        tab.close()
    finally:
        page.stop()
        thread.join(10.0)
        close_server(server)


@pytest.mark.parametrize("warning", ["", "swings: 1 fault: gyro: axis x is *frozen*"])
def test_the_page_says_the_faults_of_the_flight(warning: str) -> None:
    shown = replay()
    shown.warning = warning
    page = object.__new__(ReplayPage)
    vars(page).update(replay=shown, _predicting=False, _words="")
    text = page._text()
    lines = [line for line in text.splitlines() if line.startswith("**Warning:**")]
    assert len(lines) == bool(warning)
    assert not lines or "gyro: axis x is" in lines[0]
