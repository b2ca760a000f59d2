"""How a film is made: size, speed, camera, layout. Nothing is drawn here."""

from __future__ import annotations

import math
from dataclasses import dataclass

from skyarm.files import must_be_one_of, number, shown

LAYOUTS = ("side", "over")
"""A panel for each flight, side by side; or one panel with all flights in it."""

CAMERA_NAMES = ("follow", "fixed", "orbit", "tip")

LEAST_SIDE, MOST_SIDE = 64, 4096
"""Pixels."""

MOST_FPS, SLOWEST, FASTEST, MOST_FRAMES = 120, 0.01, 100.0, 1_000_000


@dataclass(frozen=True, kw_only=True, slots=True)
class FilmSettings:
    """How a film is made.

    Attributes:
        layout: "side" (a panel for each flight) or "over" (all flights in one).
        camera: "follow" (goes with the desired position), "fixed" (stands still and sees all of the flight), "orbit"
            (the same, going round) or "tip" (close to the desired place of the tip).
        width, height: pixels, even numbers.
        fps: frames a second of the film. speed: seconds of flight a second of the film.
        start, stop: s of flight; to the end if ``stop`` is left out.
        ghost: whether the desired pose is drawn. plot: whether the tip's error is plotted below.
        fine: shadows, smooth edges and rounder shapes; a frame takes some four times as long.
        title: above; the scenario's if left out.
    """

    layout: str = "side"
    camera: str = "follow"
    width: int = 1280
    height: int = 720
    fps: int = 30
    speed: float = 1.0
    start: float = 0.0
    stop: float | None = None
    ghost: bool = True
    plot: bool = True
    fine: bool = False
    title: str | None = None

    def __post_init__(self) -> None:
        for field, allowed in (("layout", LAYOUTS), ("camera", CAMERA_NAMES)):
            if getattr(self, field) not in allowed:
                value = getattr(self, field)
                raise ValueError(f"{field} = {shown(value)}: {must_be_one_of(allowed, value)}")
        for field in ("width", "height"):
            side = getattr(self, field)
            if not isinstance(side, int) or not LEAST_SIDE <= side <= MOST_SIDE or side % 2:
                raise ValueError(f"{field} = {shown(side)}: must be an even number from {LEAST_SIDE} to {MOST_SIDE}")
        if not isinstance(self.fps, int) or not 1 <= self.fps <= MOST_FPS:
            raise ValueError(f"fps = {shown(self.fps)}: must be a whole number from 1 to {MOST_FPS}")
        if not SLOWEST <= number(self.speed, "speed") <= FASTEST:
            raise ValueError(f"speed = {self.speed!r}: must be from {SLOWEST:g} to {FASTEST:g}")
        start = number(self.start, "start", low=0.0)
        if self.stop is not None and not start < number(self.stop, "stop") < math.inf:
            raise ValueError(f"stop = {self.stop!r}: must be larger than start = {start:g}")


def size_of(text: str) -> tuple[int, int]:
    """Width and height of a text such as 1280x720.

    Raises:
        ValueError: one line.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isascii() and width.isdigit() and height.isascii() and height.isdigit()) or len(text) > 12:
        raise ValueError(f"size = {shown(text)}: must be WIDTHxHEIGHT in pixels, such as 1280x720")
    return int(width), int(height)
