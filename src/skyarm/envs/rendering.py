"""Pictures and pages of environments: frames of chosen lanes, and a studio page of a single environment."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from importlib import import_module
from typing import Annotated, Any

import numpy as np

from skyarm.compile import leaves, rebuild
from skyarm.envs.env_lanes import EnvLanes
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.units import Unit
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.loop_state import LoopState
from skyarm.view.studio.page import EpisodePage
from skyarm.view.studio.server import StudioError, has_viser

RENDER_MODES = ("rgb_array",)

HUMAN = "human"

PICTURES = "skyarm.view.film.episode_pictures"
"""Where pictures are drawn: a room above this one, imported when pictures are asked for and by name only."""

MOST = 64
"""Lanes that are drawn at most: each keeps a drawing context and its meshes."""


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """Options of a page.

    Attributes:
        speed: s of an episode in a second of the wall.
    """

    port: Annotated[int, Unit("", low=0, high=65535)] = 0
    speed: Annotated[float, Unit("", low=1e-3, infinite=True)] = 1.0
    plain: bool = False
    browser: bool = True

    def __post_init__(self) -> None:
        accept_fields(self, "render_options", ScenarioError)


OPTIONS = tuple(field.name for field in fields(PageOptions))


def options_of_modes(
    given: Any, width: int | None = None, height: int | None = None
) -> tuple[dict[str, Any], PageOptions]:
    """Options of pictures and of a page: one table serves every ``render_mode``, each takes its own.

    Args:
        given: ``render_options``.
        width: of a picture, which Gymnasium's environments take as an argument of their own.
        height: likewise.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if not isinstance(given, (Mapping, type(None))):
        raise ScenarioError(f"render_options = {shown(given)}: must be a table, as {{'width': 320}}")
    found = dict(given or {})
    for name, value in (("width", width), ("height", height)):
        if value is not None and name in found:
            raise ScenarioError(f"{name} = {shown(value)}: must not stand in render_options, too")
        if value is not None:
            found[name] = value
    page = {name: found.pop(name) for name in OPTIONS if name in found}
    return found, PageOptions(**page)


def picture_settings(options: Mapping[str, Any], also: Sequence[str] = ()) -> Any:
    """Settings of pictures: width, height, camera, ghost, fine; ``also`` names others for the message.

    Raises:
        ScenarioError: one line: an option that there is not, or a value that cannot be.
    """
    try:
        return import_module(PICTURES).picture_settings(options, also)
    except ValueError as error:
        raise ScenarioError(f"render_options: {error}") from None


class LanePictures:
    """Draws some lanes, one after the other.

    Args:
        settings: of a picture. chosen: numbers of the lanes.
    """

    def __init__(self, settings: Any, chosen: Sequence[int]) -> None:
        drawing = import_module(PICTURES)
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
                pictures.begin(lanes.lane_scenario(lane))
                self._drawn[lane] = episode
            found.append(pictures.draw(loop_of_lane(lanes, lane)))
        return tuple(found)

    def close(self) -> None:
        """Release the resources of drawing."""
        for pictures in self._pictures.values():
            pictures.close()
        self._drawn.clear()


def lane_pictures(mode: Any, options: Mapping[str, Any], lanes: int, *, human: bool = False) -> LanePictures | None:
    """Pictures of the lanes that ``options["lanes"]`` names, or of all; None where nothing is to be drawn.

    Args:
        mode: ``render_mode``.
        options: of pictures.
        lanes: how many there are.
        human: a single environment, which may have a page in place of pictures.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if human and options:
        picture_settings(options, OPTIONS)
    if mode is None or (human and mode == HUMAN):
        return None
    if mode not in RENDER_MODES:
        known = (*RENDER_MODES, HUMAN) if human else RENDER_MODES
        raise ScenarioError(f"render_mode = {shown(mode)}: {must_be_one_of(known, mode)}, or None")
    given = dict(options)
    chosen: Sequence[int] = range(lanes)
    if not human and "lanes" in given:
        chosen = _choose(given.pop("lanes"), lanes)
    elif lanes > MOST:
        raise ScenarioError(
            f"render_options: lanes is missing: must name at most {MOST} of the {lanes} environments, as [0, 1]"
        )
    return LanePictures(picture_settings(given), chosen)


def _choose(given: Any, lanes: int) -> list[int]:
    """Numbers of lanes, each once."""
    try:
        found = np.asarray(given)
    except ValueError:
        found = np.zeros(0)
    numbers = [] if found.ndim != 1 or found.dtype.kind not in "iu" else found.tolist()
    if not 1 <= len(set(numbers)) == len(numbers) <= MOST or not set(numbers) <= set(range(lanes)):
        wanted = f"must be a list of 1 to {MOST} numbers from 0 to {lanes - 1}, each once"
        raise ScenarioError(f"render_options: lanes = {shown(given)}: {wanted}")
    return numbers


def loop_of_lane(lanes: EnvLanes, lane: int = 0) -> LoopState:
    """The present state of a lane's loop."""
    found: LoopState = rebuild(lanes.loop, iter([float(leaf[lane]) for leaf in leaves(lanes.loop)]))
    return found


class LanePage:
    """Shows the present state of the first lane.

    Args:
        title, options: of the page.

    Attributes:
        address: with the token that a tab must bear.

    Raises:
        ScenarioError: one line: the port is taken.
        StudioError: one line: the extra is missing, or no port is free.
    """

    def __init__(self, title: str, options: PageOptions) -> None:
        try:
            self._page = EpisodePage(title, **asdict(options))
        except StudioError as error:
            if options.port and has_viser():
                raise ScenarioError(f"render_options.port = {options.port}: {error}") from None
            raise
        self.address = self._page.address
        print(f"skyarm: {self.address}", file=sys.stderr, flush=True)

    def begin(self, lanes: EnvLanes) -> None:
        """Begin the picture of the first lane's episode."""
        self._page.begin(lanes.lane_scenario(0), loop_of_lane(lanes))

    def show(self, lanes: EnvLanes, lost: str = "") -> None:
        """Show the first lane's present state; ``lost``: cause of an early end, in words."""
        self._page.show(loop_of_lane(lanes), lost)

    def close(self) -> None:
        """Close the page."""
        self._page.close()
