"""Pictures of environments: the present state, drawn as films draw it; and what is
refused.
"""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RenderCollection
from small_environments import bare, one_program_a_task

import skyarm
from skyarm.envs import single_environment
from skyarm.envs.named_tasks import make_single
from skyarm.envs.single_environment import Environment
from skyarm.view.picture import offscreen
from support.pictures import needs_display

SMALL = {"width": 96, "height": 64}


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with one_program_a_task(tmp_path_factory.mktemp("cache")):
        yield


def drawn(**options):
    """An environment that gives small pictures, begun."""
    made = Environment(
        **bare(render_mode="rgb_array", render_options={**SMALL, **options})
    )
    made.reset(seed=0)
    return made


def place_of_vehicle(picture):
    """Mean row and column of the pixels of the vehicle's colour, which alone are far
    redder than blue.
    """
    rows, columns = np.nonzero(picture[..., 0].astype(int) - picture[..., 2] > 60)
    assert rows.size > 3
    return rows.mean(), columns.mean()


@needs_display
def test_a_picture_is_of_the_present_state():
    env = drawn(camera="fixed")
    assert env.metadata == {"render_modes": ["rgb_array"], "render_fps": 100}
    first = env.render()
    assert first.shape == (64, 96, 3)
    assert first.dtype == np.uint8
    assert (env.render() == first).all()
    kept = first.copy()
    row, column = place_of_vehicle(first)
    # the camera looks along an azimuth of 125 degrees: +x is to the right
    position = env.lanes.state.position
    position.z[0] += 0.15
    up = env.render()
    assert place_of_vehicle(up)[0] < row - 2
    position.z[0] -= 0.15
    position.x[0] += 0.15
    assert place_of_vehicle(env.render())[1] > column + 2
    position.x[0] -= 0.15
    assert (env.render() == first).all()
    position.z[0] = np.nan
    # what has diverged stays where it was drawn last
    assert (env.render() == first).all()
    assert (first == kept).all()
    env.close()


@needs_display
@pytest.mark.thorough
def test_environments_draw_beside_one_another_and_after_a_reset():
    one, other = drawn(), drawn(camera="tip", ghost=False)
    first, second = one.render(), other.render()
    assert (first != second).any()
    assert (one.render() == first).all()
    other.close()
    assert (one.render() == first).all()
    one.step(-np.ones(4, np.float32))
    one.reset(seed=0)
    assert (one.render() == first).all()
    one.close()


@needs_display
def test_gymnasiums_checks_pass_in_every_render_mode():
    env = gymnasium.make(
        "skyarm/Scenario-v0", **bare(render_mode="rgb_array", render_options=SMALL)
    )
    check_env(env.unwrapped)
    env.close()


@needs_display
@pytest.mark.thorough
def test_gymnasiums_wrappers_take_pictures():
    env = gymnasium.make(
        "skyarm/Scenario-v0", **bare(render_mode="rgb_array", render_options=SMALL)
    )
    pictures = RenderCollection(env)
    pictures.reset(seed=0)
    pictures.step(np.zeros(4, np.float32))
    assert [each.shape for each in pictures.render()] == [(64, 96, 3)] * 2
    pictures.close()
    assert make_single.metadata["render_modes"] == Environment.metadata["render_modes"]


@needs_display
@pytest.mark.thorough
def test_the_tip_of_a_shipped_task_goes_where_it_is_moved():
    env = gymnasium.make(
        "skyarm/TrackTip-v0",
        render_mode="rgb_array",
        render_options={"width": 320, "height": 240},
    )
    env.reset(seed=0)

    def tip():
        picture = env.render().astype(int)
        rows, columns = np.nonzero(
            (picture[..., 0] > 120) & (picture[..., 1] < 45) & (picture[..., 2] < 60)
        )
        assert rows.size
        return rows.mean(), columns.mean()

    row, column = tip()
    state = env.unwrapped.lanes.state
    state.position.z[0] -= 0.1
    assert tip()[0] > row + 2
    state.position.z[0] += 0.1
    state.position.x[0] += 0.1
    assert tip()[1] > column + 2
    env.close()


def test_without_a_mode_nothing_is_drawn_and_nothing_loaded(monkeypatch):
    def loaded(name):
        raise AssertionError(name)

    monkeypatch.setattr(single_environment, "import_module", loaded)
    env = Environment(**bare())
    env.reset(seed=0)
    with pytest.warns(UserWarning, match='render_mode="rgb_array"'):
        assert env.render() is None
    env.close()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"render_mode": "ansi"}, "render_mode = 'ansi': must be rgb_array or None"),
        ({"render_mode": ["rgb_array"]}, "render_mode = .*: must be rgb_array or None"),
        ({"render_options": 3}, "render_options = 3: must be a table"),
        (
            {"render_options": {"widht": 96}},
            "render_options: 'widht': did you mean 'width'",
        ),
        (
            {"render_options": {"width": 5}},
            "render_options: width = 5: must be at least 64",
        ),
        (
            {"render_options": {"camera": "mine"}},
            "render_options: camera = 'mine': must be one of follow",
        ),
    ],
)
def test_pictures_that_cannot_be_are_refused(given, words):
    with pytest.raises(skyarm.ScenarioError, match=words) as error:
        Environment(**bare(**{"render_mode": "rgb_array", **given}))
    assert "\n" not in str(error.value)


def test_what_is_missing_for_a_picture_is_one_line(monkeypatch):
    env = Environment(**bare(render_mode="rgb_array", render_options=SMALL))
    with pytest.raises(
        skyarm.ScenarioError, match=r"render: must come after reset\(\)"
    ):
        env.render()
    env.reset(seed=0)
    monkeypatch.setattr(offscreen.sys, "platform", "linux")
    monkeypatch.setattr(offscreen, "LIBRARY", "libnowhere.so.1")
    with pytest.raises(
        offscreen.NoDisplayError, match=r"libnowhere.so.1: is missing.* apt-get install"
    ) as error:
        env.render()
    assert "\n" not in str(error.value)
    env.close()
