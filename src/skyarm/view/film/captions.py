"""Texts of a film: title, clock, wind, names and errors of the flights, and the cursor
in the plot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from skyarm.records.arrays import Array, Pixels
from skyarm.records.immutable import positional
from skyarm.view.figures.error_strip import Curve, Strip, error_strip
from skyarm.view.figures.style import typeface
from skyarm.view.film.filmed_flight import FilmedFlight
from skyarm.view.picture.marks import wind_words

INK, PAPER = (28, 32, 40), (255, 255, 255)
LOST = (190, 20, 30)
WANTED = (0.55, 0.58, 0.63)
"""Colour of the desired force."""
TEXT_SIZE = 22.0
"""Text size (pixels) at 720 lines, chosen by eye."""

DESIGNED = 720.0
"""Height (pixels) for which the sizes below are meant; for others they are scaled."""

TITLE, HEAD, PLOT, GAP = 46.0, 40.0, 178.0, 4.0
"""Heights (pixels) of the bands of title and names, of the plot, and of the space
between panels."""

CLOCK = 300.0
"""Width (pixels) of clock and wind in the title's band."""

LEAST_HEIGHT_OF_PLOT = 240
"""Least height (pixels) of a frame with a plot."""

LEAST_TEXT = 6
"""Least text size (pixels)."""


@positional
class Box:
    """Rectangle in a film frame, in pixels from the upper left corner."""

    left: int
    top: int
    width: int
    height: int

    @property
    def inside(self) -> tuple[slice, slice]:
        """Row and column slices of the rectangle in an image."""
        return slice(self.top, self.top + self.height), slice(
            self.left, self.left + self.width
        )

    def split(self, width: int) -> tuple[Box, Box]:
        """Split into a rectangle of given width at the left, and the rest."""
        return replace(self, width=width), replace(
            self, left=self.left + width, width=self.width - width
        )


@positional
class FrameLayout:
    """Layout of a film frame: rectangles of 3D panels, captions and plot.

    Attributes:
        width, height: size of the whole. scale: scale of texts and bands, 1 at 720
            lines.
        title: band at the top. heads: above each panel a part for each vehicle, or in
            one band.
        panels: rectangles of the three-dimensional views. plot: rectangle of the
            error's plot, None without.
    """

    width: int
    height: int
    scale: float
    title: Box
    heads: tuple[Box, ...]
    panels: tuple[Box, ...]
    plot: Box | None


class Captions:
    """Captions and plot in all frames of a film."""

    def __init__(
        self,
        flights: Sequence[FilmedFlight],
        times: Array,
        layout: FrameLayout,
        title: str,
    ) -> None:
        self._flights = flights
        self._times = times
        self._layout = layout
        self._write = partial(write_line, scale=layout.scale)
        self._blank = np.full((layout.height, layout.width, 3), 255, np.uint8)
        name, self._clock = layout.title.split(
            layout.title.width
            # in a narrow film half of the band is left to the title
            - round(min(CLOCK * layout.scale, 0.5 * layout.title.width))
        )
        self._write(self._blank, name, title, bold=True)
        for box, flight in zip(layout.heads, flights, strict=True):
            color = [round(255.0 * part) for part in flight.color]
            # a stripe of the flight's colour before its name, 6 pixels at 720 lines,
            # chosen
            bar, name = box.split(max(2, round(6.0 * layout.scale)))
            self._blank[bar.inside] = color
            self._write(
                self._blank,
                name.split(self._name_width(flight, name))[0],
                flight.label,
                ink=color,
                bold=True,
            )
        self._strip = self._plot()

    def frame(self, drawn: Pixels, k: int) -> Pixels:
        """Compose a film frame from the rendered 3D panels, captions and plot."""
        # what all frames have in common was drawn once
        picture = self._blank.copy()
        layout = self._layout
        time = float(self._times[k])
        for box in layout.panels:
            picture[box.inside] = drawn[box.inside]
        winds = {wind_words(flight, k) for flight in self._flights}
        wind = winds.pop() if len(winds) == 1 else ""  # of all flights
        self._write(
            picture, self._clock, f"{wind}    {time:.1f} s".lstrip(), align="right"
        )
        for box, flight in zip(layout.heads, self._flights, strict=True):
            ink = LOST if flight.lost and time >= flight.end else INK
            number = box.split(self._name_width(flight, box))[1]
            words = state_words(flight, time, k)
            self._write(picture, number, words, ink=ink, align="right")
        if self._strip is not None and layout.plot is not None:
            strip = self._strip
            top = layout.plot.top
            share = (time - self._times[0]) / (_end_time(self._times) - self._times[0])
            at = round(
                layout.plot.left + strip.left + share * (strip.right - strip.left)
            )
            # a line of two pixels at 720 lines, chosen
            half = max(1, round(layout.scale))
            picture[
                top + strip.top : top + strip.bottom, max(at - half, 0) : at + half
            ] = INK
        return picture

    def _name_width(self, flight: FilmedFlight, box: Box) -> int:
        """Width in pixels of a flight's name in its caption."""
        wide, share = (225.0, 0.52) if flight.contact is None else (410.0, 0.62)
        return box.width - round(min(wide * self._layout.scale, share * box.width))

    def _plot(self) -> Strip | None:
        """Render a film's plot: desired and measured forces if every flight has them,
        else tip errors.
        """
        box = self._layout.plot
        if box is None:
            return None
        curves = []
        for each in self._flights:
            if each.wanted_curve is not None and each.contact_curve is not None:
                curves.append(Curve(each.error_time, each.wanted_curve, WANTED))
                curves.append(Curve(each.error_time, each.contact_curve, each.color))
        forces = len(curves) == 2 * len(self._flights)
        if not forces:
            curves = [
                Curve(each.error_time, each.error_curve, each.color)
                for each in self._flights
            ]
        span = float(self._times[0]), _end_time(self._times)
        strip = error_strip(
            curves, span, box.width, box.height, self._layout.scale, forces=forces
        )
        self._blank[box.inside] = strip.pixels
        return strip


def write_line(
    pixels: Pixels,
    box: Box,
    text: str,
    scale: float,
    *,
    ink: Sequence[int] = INK,
    paper: tuple[int, int, int] = PAPER,
    align: str = "left",
    bold: bool = False,
) -> None:
    """Write a line of text into a rectangle of an image, smaller if too long."""
    # a picture's line of text: no line breaks, no characters that steer a terminal
    text = "".join(each if each.isprintable() else " " for each in text)
    # pixels at 720 lines, chosen by eye
    margin = round(10.0 * scale)
    height = max(LEAST_TEXT, round(TEXT_SIZE * scale))
    while (font := _font(height, bold=bold)).getlength(
        text
    ) > box.width - 2 * margin and height > LEAST_TEXT:
        height -= 1
    picture = Image.new("RGB", (box.width, box.height), paper)
    at = margin if align == "left" else box.width - margin
    anchor = "lm" if align == "left" else "rm"
    ImageDraw.Draw(picture).text(
        (at, box.height // 2), text, fill=tuple(ink), font=font, anchor=anchor
    )
    pixels[box.inside] = np.asarray(picture)


def state_words(flight: FilmedFlight, time: float, k: int) -> str:
    """Caption of a flight at frame k: contact force and tip error, or how the flight
    ended.
    """
    if time >= flight.end:
        return flight.lost or f"ended at {flight.end:g} s"
    touch = (
        f"contact {force:.1f} N, "
        if (force := 0.0 if flight.contact is None else flight.contact[k]) > 0.0
        else ""
    )
    return f"{touch}tip error {error_words(float(flight.error[k]))}"


def error_words(error: float) -> str:
    """Format a distance in m as millimetres with two or three digits."""
    millimetres = 1e3 * error
    if millimetres < 0.995:
        return f"{millimetres:.2f} mm"
    # rounded already: 9.96 would be written as 10.0
    if millimetres < 9.95:
        return f"{millimetres:.1f} mm"
    return f"{millimetres:.0f} mm" if millimetres < 9999.5 else f"{error:.0f} m"


def _end_time(times: Array) -> float:
    """Time at which a film's last frame ends, s."""
    return (
        float(times[-1] + (times[-1] - times[0]) / (len(times) - 1))
        # one frame has no length of its own
        if len(times) > 1
        else times[0] + 1.0
    )


# 64 is chosen: a miss costs up to 0.2 ms (measured)
@lru_cache(maxsize=64)
def _font(height: int, *, bold: bool) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(str(typeface(bold=bold)), height)


def frame_layout(
    width: int,
    height: int,
    flights: int,
    layout: str,
    *,
    plot: bool,
    agents: Sequence[int] = (),
) -> FrameLayout:
    """Compute the rectangles of 3D panels, captions and plot in a film frame.

    Args:
        width: pixels.
        height: pixels.
        flights: number of them.
        layout: "side" or "over".
        plot: whether to draw a plot; omitted in a frame that is too low.
        agents: number of vehicles of each flight; one if left out.
    """
    # text shrinks with the width where a frame is narrower than 1.2 of its height
    scale = min(height / DESIGNED, width / (1.2 * DESIGNED))
    title, head, gap = (max(1, round(scale * part)) for part in (TITLE, HEAD, GAP))
    below = round(scale * PLOT) if plot and height >= LEAST_HEIGHT_OF_PLOT else 0
    top = title + head
    tall = height - top - below
    parts = _columns(width, flights, gap)
    heads = tuple(
        Box(left + right, title, narrow, head)
        for (left, wide), count in zip(parts, agents or [1] * flights, strict=True)
        for right, narrow in _columns(wide, count, gap)
    )
    panels = tuple(
        Box(left, top, wide, tall)
        for left, wide in (parts if layout == "side" else [(0, width)])
    )
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
    """List (left, width) in pixels of equal columns in a frame."""
    # edges are rounded and not widths, so that the columns fill the frame
    edges = [round(i * (width + gap) / count) for i in range(count + 1)]
    return [(left, right - gap - left) for left, right in pairwise(edges)]
