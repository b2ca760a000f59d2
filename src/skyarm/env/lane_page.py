"""The page on which a single environment shows itself: ``render_mode="human"``."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any

from skyarm.compile import leaves, rebuild
from skyarm.env.env_lanes import EnvLanes
from skyarm.env.lane_pictures import picture_settings
from skyarm.files import shown
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.loop_state import LoopState
from skyarm.studio.server import StudioError, has_viser
from skyarm.studio.watched_episode import EpisodePage

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
