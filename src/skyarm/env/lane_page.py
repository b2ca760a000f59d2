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
from skyarm.studio.watched_episode import EpisodePage

HUMAN = "human"

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
        self._page = EpisodePage(title, **page_options(options))
        self.address = self._page.address
        print(f"skyarm: {self.address}", file=sys.stderr, flush=True)
        self._shown: tuple[int, int] | None = None

    def show(self, lanes: EnvLanes, lost: str = "") -> None:
        """Take over the present state; the first one of an episode begins its picture.

        Args:
            lanes: of which the first is shown.
            lost: why its episode has ended early, in words.
        """
        episode = int(lanes.seeds[0]), int(lanes.episodes[0])
        now = rebuild(lanes.loop, iter([float(leaf[0]) for leaf in leaves(lanes.loop)]))
        if episode != self._shown:
            self._page.begin(lanes.flown(0), now)
            self._shown = episode
        else:
            self._page.show(now, lost)

    def close(self) -> None:
        """Close the page."""
        self._page.close()


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
    if isinstance(speed, bool) or not isinstance(speed, (int, float)) or math.isnan(speed) or speed <= 0.0:
        raise ScenarioError(f"render_options: speed = {shown(speed)}: must be above 0, or inf")
    for name in ("plain", "browser"):
        if not isinstance(found[name], bool):
            raise ScenarioError(f"render_options: {name} = {shown(found[name])}: must be true or false")
    return found
