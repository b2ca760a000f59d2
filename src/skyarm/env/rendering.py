"""Pictures and pages of environments: frames of chosen lanes, and a studio page of a single environment."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from skyarm.compile import leaves, rebuild
from skyarm.env.env_lanes import EnvLanes
from skyarm.files import must_be_one_of, shown
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.loop_state import LoopState
from skyarm.view.studio.server import StudioError, has_viser
from skyarm.view.studio.watched_episode import EpisodePage

RENDER_MODES = ("rgb_array",)

PICTURES = "skyarm.view.film.episode_pictures"
"""Where pictures are drawn: a room above this one, imported when pictures are asked for and by name only."""

MOST = 64
"""Lanes that are drawn at most: each keeps a drawing context and its meshes."""


class LanePictures:
    """Draws some lanes, one after the other.

    Args:
        options: of a picture: width, height, camera, ghost, fine.
        chosen: numbers of the lanes.

    Raises:
        ScenarioError: one line: an option that there is not, or a value that cannot be.
    """

    def __init__(self, options: Mapping[str, Any], chosen: Sequence[int]) -> None:
        drawing, settings = import_module(PICTURES), picture_settings(options)
        self._pictures = {lane: drawing.EpisodePictures(settings) for lane in chosen}
        self._drawn: dict[int, tuple[int, int]] = {}

    def draw(self, lanes: EnvLanes) -> tuple[Any, ...]:
        """A picture, (height, width, 3) bytes, of each chosen lane.

        Raises:
            NoDisplayError: one line, a ValueError: nothing can be drawn on this machine, and what is missing.
        """
        found = []
        for lane, pictures in self._pictures.items():
            episode = int(lanes.seeds[lane]), int(lanes.episodes[lane])
            if episode != self._drawn.get(lane):
                pictures.begin(lanes.flown(lane))
                self._drawn[lane] = episode
            now = rebuild(lanes.loop, iter([float(leaf[lane]) for leaf in leaves(lanes.loop)]))
            found.append(pictures.draw(now))
        return tuple(found)

    def close(self) -> None:
        """Give back what drawing holds."""
        for pictures in self._pictures.values():
            pictures.close()
        self._drawn.clear()


def picture_settings(options: Mapping[str, Any], *, also: Iterable[str] = ()) -> Any:
    """Settings of pictures.

    Args:
        options: width, height, camera, ghost, fine.
        also: options that are allowed next to these, for the message.

    Raises:
        ScenarioError: one line: an option that there is not, or a value that cannot be.
    """
    try:
        return import_module(PICTURES).picture_settings(options, also)
    except ValueError as error:
        raise ScenarioError(f"render_options: {error}") from None


def lane_pictures(
    mode: Any, options: Any, lanes: int, *, choose: bool = False, also: Sequence[str] = ()
) -> LanePictures | None:
    """What draws; None where nothing is to be drawn.

    Args:
        mode: ``render_mode``.
        options: ``render_options``.
        lanes: how many there are.
        also: modes that are allowed beside these, for the message.
        choose: whether ``options["lanes"]`` says which are drawn; without it all are.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if mode is None:
        return None
    if mode not in RENDER_MODES:
        raise ScenarioError(f"render_mode = {shown(mode)}: {must_be_one_of((*RENDER_MODES, *also), mode)}, or None")
    if options is not None and not isinstance(options, Mapping):
        raise ScenarioError(f"render_options = {shown(options)}: must be a table, as {{'width': 320}}")
    given = dict(options or {})
    chosen = range(lanes)
    if choose and "lanes" in given:
        return LanePictures(given, _chosen(given.pop("lanes"), lanes))
    if lanes > MOST:
        raise ScenarioError(
            f"render_options: lanes is missing: must name at most {MOST} of the {lanes} environments, as [0, 1]"
        )
    return LanePictures(given, chosen)


def _chosen(given: Any, lanes: int) -> list[int]:
    """Numbers of lanes, each once."""
    wanted = f"render_options: lanes = {shown(given)}: must be a list of 1 to {MOST} numbers from 0 to {lanes - 1}"
    listed = isinstance(given, Sequence) and not isinstance(given, (str, bytes, bytearray))
    if not listed and not (isinstance(given, np.ndarray) and given.ndim == 1):
        raise ScenarioError(f"{wanted}, each once")
    whole = [each for each in given if isinstance(each, (int, np.integer)) and not isinstance(each, bool)]
    numbers = [int(each) for each in whole if 0 <= each < lanes]
    if len(numbers) != len(given) or not 1 <= len(numbers) <= MOST or len(set(numbers)) != len(numbers):
        raise ScenarioError(f"{wanted}, each once")
    return numbers


def with_size(options: Any, width: int | None, height: int | None) -> Any:
    """Render options with the size of a picture, which Gymnasium's environments take as arguments of their own.

    Raises:
        ScenarioError: a size that stands in both.
    """
    size = {name: value for name, value in (("width", width), ("height", height)) if value is not None}
    if not size or not isinstance(options, (Mapping, type(None))):
        return options
    for name, value in size.items():
        if name in (options or {}):
            raise ScenarioError(f"{name} = {shown(value)}: must not stand in render_options, too")
    return {**(options or {}), **size}


HUMAN = "human"

SLOWEST, FASTEST = 1e-3, 1e6
"""s of an episode in a second; at the slowest pace a control period of 10 ms takes ten seconds."""

OPTIONS = {"port": 0, "speed": 1.0, "plain": False, "browser": True}
"""Of a page, and what they are if left out."""


class LanePage:
    """Shows the present state of the first lane.

    Args:
        title: of the page.
        options: port, speed, plain, browser; all of them.

    Attributes:
        address: with the token that a tab must bear.

    Raises:
        ScenarioError: one line: the port is taken.
        StudioError: one line: the extra is missing, or no port is free.
    """

    def __init__(self, title: str, options: Mapping[str, Any]) -> None:
        try:
            self._page = EpisodePage(title, **options)
        except StudioError as error:
            if options["port"] and has_viser():
                raise ScenarioError(f"render_options: port = {options['port']}: {error}") from None
            raise
        self.address = self._page.address
        print(f"skyarm: {self.address}", file=sys.stderr, flush=True)

    def begin(self, lanes: EnvLanes) -> None:
        """Begin the picture of the first lane's episode."""
        self._page.begin(lanes.flown(0), _state_of(lanes))

    def show(self, lanes: EnvLanes, lost: str = "") -> None:
        """Show the first lane's present state.

        Args:
            lanes: of the episode that was begun.
            lost: why it has ended early, in words.
        """
        self._page.show(_state_of(lanes), lost)

    def close(self) -> None:
        """Close the page."""
        self._page.close()


def _state_of(lanes: EnvLanes) -> LoopState:
    """The state of the first lane's loop."""
    found: LoopState = rebuild(lanes.loop, iter([float(leaf[0]) for leaf in leaves(lanes.loop)]))
    return found


def options_of_modes(given: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of pictures and options of a page: one table serves every ``render_mode``, each takes its own.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if given is not None and not isinstance(given, Mapping):
        raise ScenarioError(f"render_options = {shown(given)}: must be a table, as {{'width': 320}}")
    page = {name: value for name, value in (given or {}).items() if name in OPTIONS}
    pictures = {name: value for name, value in (given or {}).items() if name not in OPTIONS}
    if pictures:
        picture_settings(pictures, also=OPTIONS)
    return pictures, page_options(page)


def page_options(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a page, with those that are left out.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    found: dict[str, Any] = OPTIONS | dict(given)
    port, speed = found["port"], found["speed"]
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
        raise ScenarioError(f"render_options: port = {shown(port)}: must be from 0 to 65535")
    known = isinstance(speed, (int, float)) and not isinstance(speed, bool)
    if not known or not (SLOWEST <= speed <= FASTEST or speed == math.inf):
        raise ScenarioError(f"render_options: speed = {shown(speed)}: must be from {SLOWEST:g} to {FASTEST:g}, or inf")
    for name in ("plain", "browser"):
        if not isinstance(found[name], bool):
            raise ScenarioError(f"render_options: {name} = {shown(found[name])}: must be true or false")
    return found
