"""Pictures of environments: the present state, drawn as films draw it; and what is refused."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RenderCollection

import skyarm
from film_flights import needs_display
from skyarm.envs import rendering, single_environment
from skyarm.envs.named_tasks import make_single
from skyarm.envs.single_environment import Environment
from skyarm.envs.vector_environment import VectorEnvironment
from skyarm.view.film import offscreen
from small_environments import bare, one_program_a_task

SMALL = {"width": 96, "height": 64}


@pytest.fixture(autouse=True, scope="module")
def _cache(tmp_path_factory):
    with one_program_a_task(tmp_path_factory.mktemp("cache")):
        yield


def drawn(**options):
    """An environment that gives small pictures, begun."""
    made = Environment(**bare(render_mode="rgb_array", render_options={**SMALL, **options}))
    made.reset(seed=0)
    return made


def place_of_vehicle(picture):
    """Mean row and column of the pixels of the vehicle's colour, which alone are far redder than blue."""
    rows, columns = np.nonzero(picture[..., 0].astype(int) - picture[..., 2] > 60)
    assert rows.size > 3
    return rows.mean(), columns.mean()


@needs_display
def test_a_picture_is_of_the_present_state():
    env = drawn(camera="fixed")
    assert env.metadata == {"render_modes": ["rgb_array", "human"], "render_fps": 100}
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
    one, other = drawn(), drawn(camera="orbit", ghost=False)
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
@pytest.mark.parametrize("studio", [True, False])
def test_gymnasiums_checks_pass_in_every_render_mode_with_and_without_the_studio(monkeypatch, studio):
    if studio:
        pytest.importorskip("viser", reason="needs the extra 'studio'")
    else:
        monkeypatch.setitem(sys.modules, "viser", None)
        monkeypatch.setattr(single_environment, "has_viser", lambda: False)
    options = {**SMALL, "browser": False, "speed": math.inf}
    env = gymnasium.make("skyarm/Scenario-v0", **bare(render_mode="rgb_array", render_options=options))
    assert env.unwrapped.metadata["render_modes"] == (["rgb_array", "human"] if studio else ["rgb_array"])
    check_env(env.unwrapped)
    env.close()
    if not studio:
        with pytest.raises(ValueError, match=r"^studio: needs the extra 'studio'; .*pip install") as error:
            gymnasium.make("skyarm/Scenario-v0", **bare(render_mode="human", render_options=options))
        assert "\n" not in str(error.value)


@needs_display
@pytest.mark.thorough
def test_gymnasiums_wrappers_take_pictures():
    env = gymnasium.make("skyarm/Scenario-v0", **bare(render_mode="rgb_array", render_options=SMALL))
    pictures = RenderCollection(env)
    pictures.reset(seed=0)
    pictures.step(np.zeros(4, np.float32))
    assert [each.shape for each in pictures.render()] == [(64, 96, 3)] * 2
    pictures.close()
    assert make_single.metadata["render_modes"] == Environment.metadata["render_modes"]


@needs_display
@pytest.mark.thorough
def test_the_tip_of_a_shipped_task_goes_where_it_is_moved():
    env = gymnasium.make("skyarm/TrackTip-v0", render_mode="rgb_array", render_options={"width": 320, "height": 240})
    env.reset(seed=0)

    def tip():
        picture = env.render().astype(int)
        rows, columns = np.nonzero((picture[..., 0] > 120) & (picture[..., 1] < 45) & (picture[..., 2] < 60))
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

    monkeypatch.setattr(rendering, "import_module", loaded)
    env = Environment(**bare())
    env.reset(seed=0)
    with pytest.warns(UserWarning, match='render_mode="rgb_array"'):
        assert env.render() is None
    env.close()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"render_mode": "ansi"}, "render_mode = 'ansi': must be one of rgb_array, human, or None"),
        ({"render_mode": ["rgb_array"]}, "render_mode = .*: must be one of rgb_array, human, or None"),
        ({"render_options": 3}, "render_options = 3: must be a table"),
        ({"render_options": {"widht": 96}}, "render_options: 'widht': did you mean 'width'"),
        ({"render_options": {"width": 5}}, "render_options: width = 5: must be an even number from 64"),
        ({"render_options": {"prot": 1}}, "render_options: 'prot': did you mean 'port'"),
        ({"render_options": {"port": -1}}, "render_options.port = -1: must be at least 0"),
        ({"render_options": {"camera": "mine"}}, "render_options: camera = 'mine': must be one of follow"),
    ],
)
def test_pictures_that_cannot_be_are_refused(given, words):
    with pytest.raises(skyarm.ScenarioError, match=words) as error:
        Environment(**bare(**{"render_mode": "rgb_array", **given}))
    assert "\n" not in str(error.value)


def test_what_is_missing_for_a_picture_is_one_line(monkeypatch):
    env = Environment(**bare(render_mode="rgb_array", render_options=SMALL))
    with pytest.raises(skyarm.ScenarioError, match=r"render: must come after reset\(\)"):
        env.render()
    env.reset(seed=0)
    monkeypatch.setattr(offscreen.sys, "platform", "linux")
    monkeypatch.setattr(offscreen, "LIBRARY", "libnowhere.so.1")
    with pytest.raises(offscreen.NoDisplayError, match=r"libnowhere.so.1: is missing.* apt-get install") as error:
        env.render()
    assert "\n" not in str(error.value)
    env.close()


def many(**options):
    """Three environments that give small pictures, begun with seeds 4, 5, 6."""
    made = VectorEnvironment(3, **bare(render_mode="rgb_array", render_options={**SMALL, **options}, randomise=TILTED))
    made.reset(seed=4)
    return made


TILTED = {"initial.roll": {"uniform": [-1.0, 1.0]}, "reference.base.position.x": {"uniform": [-0.5, 0.5]}}
"""Drawn for every episode; the ghost stands where the vehicle should be."""


@needs_display
def test_a_picture_of_a_lane_is_that_of_the_single_environment_with_its_seed():
    envs = many(lanes=[2, 0])
    assert envs.metadata["render_modes"] == ["rgb_array"]
    assert envs.metadata["render_fps"] == 100
    alone = Environment(**bare(render_mode="rgb_array", render_options=SMALL, randomise=TILTED))
    for lane, picture in zip((2, 0), envs.render(), strict=True):
        alone.reset(seed=4 + lane)
        assert (picture == alone.render()).all()
    before = envs.render()
    # what moves in one lane shows in its picture alone; a new episode of a lane is drawn with its own numbers
    envs.lanes.state.position.z[0] += 0.15
    moved = envs.render()
    assert (moved[0] == before[0]).all()
    assert (moved[1] != before[1]).any()
    envs.reset(options={"reset_mask": np.array([False, False, True])})
    again = envs.render()
    assert (again[1] == moved[1]).all()
    alone.reset(seed=6)
    alone.reset()
    assert (again[0] == alone.render()).all()
    assert (again[0] != before[0]).any()
    envs.close()
    alone.close()


@needs_display
@pytest.mark.thorough
def test_all_lanes_are_drawn_through_the_door_of_gymnasium():
    envs = gymnasium.make_vec(
        "skyarm/Scenario-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        **bare(render_mode="rgb_array", render_options=SMALL),
    )
    assert envs.render_mode == "rgb_array"
    envs.reset(seed=0)
    pictures = envs.render()
    assert isinstance(pictures, tuple)
    assert [each.shape for each in pictures] == [(64, 96, 3)] * 3
    envs.close()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"render_mode": "human"}, "render_mode = 'human': must be one of rgb_array, or None"),
        ({"render_options": {"lanes": 0}}, r"render_options: lanes = 0: must be a list of 1 to 64 numbers from 0 to 2"),
        ({"render_options": {"lanes": []}}, r"lanes = \[\]: must be a list"),
        ({"render_options": {"lanes": [3]}}, r"lanes = \[3\]: must be a list of 1 to 64 numbers from 0 to 2"),
        ({"render_options": {"lanes": [-1]}}, r"lanes = \[-1\]: must be a list"),
        ({"render_options": {"lanes": [1, 1]}}, r"lanes = \[1, 1\]: .*, each once"),
        ({"render_options": {"lanes": [True]}}, r"lanes = \[True\]: must be a list"),
        ({"render_options": {"lanes": "01"}}, r"lanes = '01': must be a list"),
        ({"render_options": {"lines": [1]}}, "render_options: 'lines': did you mean 'fine'"),
        ({"num_envs": 65}, "render_options: lanes is missing: must name at most 64 of the 65 environments"),
    ],
)
def test_pictures_of_lanes_that_cannot_be_are_refused(given, words):
    with pytest.raises(skyarm.ScenarioError, match=words) as error:
        VectorEnvironment(**{"num_envs": 3, **bare(render_mode="rgb_array"), **given})
    assert "\n" not in str(error.value)


def test_lanes_are_drawn_once_begun_and_only_where_they_are_asked_for():
    envs = VectorEnvironment(2, **bare())
    with pytest.warns(UserWarning, match='render_mode="rgb_array"'):
        assert envs.render() is None
    envs = VectorEnvironment(2, **bare(render_mode="rgb_array"))
    with pytest.raises(skyarm.ScenarioError, match=r"render: must come after reset\(\)"):
        envs.render()
    # a single environment has no lanes to choose from
    with pytest.raises(skyarm.ScenarioError, match=r"render_options: 'lanes': .*must be one of"):
        Environment(**bare(render_mode="rgb_array", render_options={"lanes": [0]}))


@pytest.mark.parametrize("make", [Environment, VectorEnvironment])
def test_the_size_of_a_picture_is_an_argument_as_in_other_environments(make):
    envs = make(**bare(render_mode="rgb_array", width=96, height=64))
    envs.reset(seed=1)
    assert np.shape(envs.render())[-3:] == (64, 96, 3)
    envs.close()
    for given in ({"width": 0}, {"height": "tall"}, {"width": 64, "render_options": {"width": 32}}):
        with pytest.raises(skyarm.ScenarioError, match=next(iter(given))) as error:
            make(**bare(render_mode="rgb_array"), **given)
        assert "\n" not in str(error.value)
