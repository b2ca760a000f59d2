"""The page on which a single environment shows itself: ``render_mode="human"``."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any

from skyarm.compile import leaves, rebuild
from skyarm.env.env_lanes import EnvLanes
from skyarm.files import must_be_one_of, shown
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.loop_state import LoopState
from skyarm.studio.server import StudioError
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
        options: port, speed, plain, browser.

    Attributes:
        address: with the token that a tab must bear.

    Raises:
        ScenarioError: one line: an option that there is not, or a value that cannot be.
        StudioError: one line: the extra is missing, or the port is taken.
    """

    def __init__(self, title: str, options: Any) -> None:
        found = page_options(options)
        try:
            self._page = EpisodePage(title, **found)
        except StudioError as error:
            if found["port"]:
                raise ScenarioError(f"render_options: port = {found['port']}: {error}") from None
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


def page_options(given: Any) -> dict[str, Any]:
    """Options of a page.

    Raises:
        ScenarioError: one line with field, value and what is allowed.
    """
    if given is not None and not isinstance(given, Mapping):
        raise ScenarioError(f"render_options = {shown(given)}: must be a table, as {{'port': 8080}}")
    found = OPTIONS | dict(given or {})
    for name in found:
        if name not in OPTIONS:
            raise ScenarioError(f"render_options: {shown(name)}: {must_be_one_of(OPTIONS, name)}")
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
