"""Texts of a film: its title, clock and wind, the flights' names and errors; and the cursor in the plot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from skyarm.view.figures.error_strip import Curve, Strip, error_strip
from skyarm.view.figures.style import typeface
from skyarm.view.film.filmed_flight import FilmedFlight, wind_words

Pixels = npt.NDArray[np.uint8]
Array = npt.NDArray[np.float64]

INK, PAPER = (28, 32, 40), (255, 255, 255)
LOST = (190, 20, 30)
WANTED = (0.55, 0.58, 0.63)
"""Colour of the force that is asked for."""
TITLE_SIZE, NAME_SIZE, NUMBER_SIZE = 24.0, 22.0, 22.0
"""Pixels at 720 lines."""

DESIGNED = 720.0
"""Pixels: the height for which the sizes below are meant; others are scaled."""

TITLE, HEAD, PLOT, GAP = 46.0, 40.0, 178.0, 4.0
"""Pixels of that height: bands of title and names, plot, space between panels."""

LEAST_HEIGHT_OF_PLOT = 240
"""Pixels: a lower frame has no room for a plot."""

LEAST_TEXT = 6
"""Pixels."""


@dataclass(frozen=True, slots=True)
class Box:
    """A part of the frame, pixels from its upper left corner."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """Parts of a frame.

    Attributes:
        width, height: of the whole. scale: of texts and bands, 1 at 720 lines.
        title: band at the top. heads: one above each panel, or in one band a part for each flight.
        panels: that are drawn in three dimensions. plot: of the error, None without.
    """

    width: int
    height: int
    scale: float
    title: Box
    heads: tuple[Box, ...]
    panels: tuple[Box, ...]
    plot: Box | None


class Captions:
    """Everything flat in the frames of one film."""

    def __init__(self, flights: Sequence[FilmedFlight], times: Array, layout: FrameLayout, title: str) -> None:
        self._flights, self._times, self._layout = flights, times, layout
        self._blank = np.full((layout.height, layout.width, 3), 255, np.uint8)
        self._numbers = [self._head(box, flight) for box, flight in zip(layout.heads, flights, strict=True)]
        self._clock = self._title(title)
        self._strip = self._plot()

    def frame(self, drawn: Pixels, k: int) -> Pixels:
        """Frame k: the panels from ``drawn``, texts and plot around them."""
        found = self._blank.copy()
        for box in self._layout.panels:
            found[_inside(box)] = drawn[_inside(box)]
        self._write(found, self._clock, self._now(k), INK, TITLE_SIZE)
        for box, flight in zip(self._numbers, self._flights, strict=True):
            ink = LOST if flight.lost and self._times[k] >= flight.end else INK
            self._write(found, box, state_words(flight, float(self._times[k]), k), ink, NUMBER_SIZE)
        if self._strip is not None and self._layout.plot is not None:
            self._put_cursor(found, self._strip, self._layout.plot, k)
        return found

    def _now(self, k: int) -> str:
        """Clock, and the wind where all flights have the same."""
        winds = {wind_words(flight, k) for flight in self._flights}
        return f"{winds.pop() if len(winds) == 1 else ''}    {self._times[k]:.1f} s".lstrip()

    def _title(self, title: str) -> Box:
        """Write the title; returns the box of clock and wind."""
        band = self._layout.title
        right = round(min(300.0 * self._layout.scale, 0.5 * band.width))
        at = Box(band.left, band.top, band.width - right, band.height)
        self._write(self._blank, at, title, INK, TITLE_SIZE, align="left", bold=True)
        return Box(band.width - right, band.top, right, band.height)

    def _head(self, box: Box, flight: FilmedFlight) -> Box:
        """Write a flight's name beside a bar of its colour; returns the box of its error."""
        bar = max(2, round(6.0 * self._layout.scale))
        color = np.round(255.0 * np.array(flight.color)).astype(np.uint8)
        self._blank[box.top : box.top + box.height, box.left : box.left + bar] = color
        wide, share = (225.0, 0.52) if flight.contact is None else (410.0, 0.62)
        number = round(min(wide * self._layout.scale, share * box.width))
        name = Box(box.left + bar, box.top, box.width - bar - number, box.height)
        self._write(self._blank, name, flight.label, tuple(int(c) for c in color), NAME_SIZE, align="left", bold=True)
        return Box(box.left + box.width - number, box.top, number, box.height)

    def _plot(self) -> Strip | None:
        box = self._layout.plot
        if box is None:
            return None
        span = float(self._times[0]), _end(self._times)
        forces = all(each.wanted_curve is not None and each.contact_curve is not None for each in self._flights)
        curves = [Curve(each.error_time, each.error_curve, each.color) for each in self._flights]
        if forces:
            curves = [
                Curve(each.error_time, force, color)
                for each in self._flights
                for force, color in ((each.wanted_curve, WANTED), (each.contact_curve, each.color))
                if force is not None
            ]
        strip = error_strip(curves, span, box.width, box.height, self._layout.scale, forces=forces)
        self._blank[_inside(box)] = strip.pixels
        return strip

    def _put_cursor(self, pixels: Pixels, strip: Strip, box: Box, k: int) -> None:
        share = (self._times[k] - self._times[0]) / (_end(self._times) - self._times[0])
        at = round(box.left + strip.left + share * (strip.right - strip.left))
        half = max(1, round(self._layout.scale))
        pixels[box.top + strip.top : box.top + strip.bottom, max(at - half, 0) : at + half] = INK

    def _write(
        self,
        pixels: Pixels,
        box: Box,
        text: str,
        ink: tuple[int, ...],
        size: float,
        *,
        align: str = "right",
        bold: bool = False,
    ) -> None:
        """Put a line of text into a box, smaller where it would not fit."""
        # a picture's line of text: no line breaks, no characters that steer a terminal
        text = "".join(each if each.isprintable() else " " for each in text)
        margin = max(1, round(10.0 * self._layout.scale))
        room = max(box.width - 2 * margin, 1)
        height = max(LEAST_TEXT, round(size * self._layout.scale))
        font = _font(height, bold=bold)
        while font.getlength(text) > room and height > LEAST_TEXT:
            height -= 1
            font = _font(height, bold=bold)
        picture = Image.new("RGB", (box.width, box.height), PAPER)
        at = (margin, box.height // 2) if align == "left" else (box.width - margin, box.height // 2)
        ImageDraw.Draw(picture).text(at, text, fill=ink, font=font, anchor="lm" if align == "left" else "rm")
        pixels[_inside(box)] = np.asarray(picture)


def state_words(flight: FilmedFlight, time: float, k: int) -> str:
    """State of a flight at frame k, ``time`` s, in words: its error, after its end that, or the reason of its loss."""
    if time >= flight.end:
        return flight.lost or f"ended at {flight.end:g} s"
    touch = f"contact {force:.1f} N, " if (force := 0.0 if flight.contact is None else flight.contact[k]) > 0.0 else ""
    return f"{touch}tip error {error_words(float(flight.error[k]))}"


def error_words(error: float) -> str:
    """A distance in m as millimetres of two or three digits."""
    millimetres = 1e3 * error
    if millimetres < 0.995:
        return f"{millimetres:.2f} mm"
    if millimetres < 9.95:
        return f"{millimetres:.1f} mm"
    return f"{millimetres:.0f} mm" if millimetres < 9999.5 else f"{error:.0f} m"


def _end(times: Array) -> float:
    """End of the last frame, s."""
    return float(times[-1] + (times[-1] - times[0]) / max(len(times) - 1, 1)) if len(times) > 1 else times[0] + 1.0


def _inside(box: Box) -> tuple[slice, slice]:
    return slice(box.top, box.top + box.height), slice(box.left, box.left + box.width)


@lru_cache(maxsize=64)
def _font(height: int, *, bold: bool) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(str(typeface(bold=bold)), height)


def frame_layout(width: int, height: int, flights: int, layout: str, *, plot: bool) -> FrameLayout:
    """Divide a frame.

    Args:
        width: pixels.
        height: pixels.
        flights: number of them.
        layout: "side" or "over".
        plot: whether there shall be a plot; a frame that is too low for it has none.
    """
    scale = min(height / DESIGNED, width / (1.2 * DESIGNED))
    title, head, gap = (max(1, round(scale * part)) for part in (TITLE, HEAD, GAP))
    below = round(scale * PLOT) if plot and height >= LEAST_HEIGHT_OF_PLOT else 0
    top = title + head
    tall = height - top - below
    parts = _columns(width, flights, gap)
    heads = tuple(Box(left, title, wide, head) for left, wide in parts)
    panels = tuple(Box(left, top, wide, tall) for left, wide in (parts if layout == "side" else [(0, width)]))
    return FrameLayout(
        width=width,
        height=height,
        scale=scale,
        title=Box(0, 0, width, title),
        heads=heads,
        panels=panels,
        plot=Box(0, height - below, width, below) if below else None,
    )


def _columns(width: int, count: int, gap: int) -> list[tuple[int, int]]:
    """(left, width) of columns that fill the width."""
    edges = [round(i * (width + gap) / count) for i in range(count + 1)]
    return [(left, right - gap - left) for left, right in pairwise(edges)]
