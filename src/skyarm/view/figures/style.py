"""Figure styles, for a journal column and for a web page.

Matplotlib's rc parameters are global, and a context that sets them is seen by every
thread; so fonts, widths and colours are passed to each artist instead. Neighbours in
``looks`` differ in colour, in lightness and in dash, so that a print in grey tells them
apart.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from skyarm.records.arrays import Array
from skyarm.records.files import write_atomically
from skyarm.records.files.names import require_suffix
from skyarm.records.immutable import immutable

Style = dict[str, Any]
"""Keyword arguments of a Matplotlib artist."""

Handles = dict[str, Artist]
"""Text of a legend -> drawn artist."""

DPI = 300.0
"""Resolution (dots per inch) of a PNG, as journals require for line drawings with
text."""

NOTEBOOK_DPI = 110.0
"""Resolution (dots per inch) in a notebook, chosen: 788 pixels of a wide
figure."""


class Picture(Figure):
    """Matplotlib figure that notebooks display without an interactive backend."""

    def _repr_png_(self) -> bytes:
        return image_bytes(self, dpi=NOTEBOOK_DPI)


@immutable
class CurveLook:
    """Line style of a curve: colour, dash, width and layer.

    Attributes:
        color: hex. dash: on-off lengths in line widths, empty for solid. width: pt.
        layer: larger is nearer.
    """

    color: str
    dash: tuple[float, ...] = ()
    width: float = 1.1
    layer: float = 3.3

    @property
    def line(self) -> Style:
        """Keyword arguments for a Matplotlib line."""
        dashes = (0, self.dash) if self.dash else "-"
        return {
            "color": self.color,
            "linestyle": dashes,
            "linewidth": self.width,
            "zorder": self.layer,
        }


@immutable
class PictureStyle:
    """Figure style: fonts, sizes, colours and line styles.

    Attributes:
        font: families in order. text, small: pt.
        width, wide: width of one column of panels, and of several, in. panel: least
            height of a panel, in.
        rows: panels one above the other before another column begins.
        face, ink, frame, grid: colours of the ground, of words, of frames, of grids.
        looks: looks of the flights or laws in their order. desired, limit: looks of
            references and of limits.
        shades: fills of events in their order.
    """

    font: tuple[str, ...] = ("STIXGeneral", "DejaVu Serif")
    text: float = 8.0
    small: float = 7.0
    width: float = 3.5
    wide: float = 7.16
    panel: float = 0.95
    rows: int = 8
    face: str = "#ffffff"
    ink: str = "#000000"
    frame: str = "#333333"
    grid: str = "#d9d9d9"
    # the lighter, dashed line lies over the dark, solid one: both stay visible where
    # they agree
    looks: tuple[CurveLook, ...] = (
        CurveLook(color="#08306b", layer=3.0),
        CurveLook(color="#e6762b", dash=(3.2, 1.3), layer=3.2),
        CurveLook(color="#1b7837", dash=(6.0, 1.5, 1.0, 1.5)),
        CurveLook(color="#762a83", dash=(6.0, 2.5)),
        CurveLook(color="#6b6b6b", dash=(2.0, 2.0)),
        CurveLook(color="#b2182b", dash=(5.0, 1.5, 1.0, 1.5, 1.0, 1.5)),
    )
    desired: CurveLook = CurveLook(
        color="#000000", dash=(1.0, 1.4), width=0.8, layer=3.6
    )
    limit: CurveLook = CurveLook(color="#8c1a10", dash=(8.0, 2.0), width=0.8, layer=2.6)
    shades: tuple[str, ...] = ("#dcdcdc", "#f3e3c3", "#f2d3d0", "#d7e6f2")

    @property
    def words(self) -> Style:
        """Keyword arguments of Matplotlib for text of the larger size."""
        return {
            "fontsize": self.text,
            "family": list(self.font),
            "color": self.ink,
            "parse_math": False,
        }

    @property
    def small_words(self) -> Style:
        """Keyword arguments of Matplotlib for text of the smaller size."""
        return {**self.words, "fontsize": self.small}

    @property
    def prop(self) -> Style:
        """Font properties of a legend."""
        return {"size": self.small, "family": list(self.font)}

    def look(self, position: int) -> CurveLook:
        """Line style of the curve with a given index; beyond the last one colours
        repeat with another dash.
        """
        look = self.looks[position % len(self.looks)]
        return (
            look
            if position < len(self.looks)
            else replace(look, dash=(1.0, 1.0), width=0.8 * look.width)
        )

    def blank(self, width: float, height: float) -> Picture:
        """Create a figure without axes, of given width and height in inches."""
        pad = 0.006 * self.text
        layout = ConstrainedLayoutEngine(w_pad=pad, h_pad=pad)
        figure = Picture(figsize=(width, height), layout=layout, facecolor=self.face)
        # a canvas of its own, so that the figure is saved without pyplot
        FigureCanvasAgg(figure)
        return figure

    def dress(self, ax: Axes) -> Axes:
        """Apply the figure style to frame, grid and ticks of one Matplotlib axes."""
        # widths grow with the text, so that a larger style looks alike; factors are
        # chosen
        line = 0.06 * self.text
        ax.set_facecolor(self.face)
        ax.tick_params(
            labelsize=self.small, labelfontfamily=self.font[0], labelcolor=self.ink
        )
        ax.tick_params(direction="in", width=line, length=5.0 * line, color=self.frame)
        ax.grid(visible=True, color=self.grid, linewidth=0.8 * line)
        ax.set_axisbelow(True)
        # at most five labels, at round numbers: chosen for panels an inch high
        ax.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
        for spine in ax.spines.values():
            spine.set_linewidth(line)
            spine.set_edgecolor(self.frame)
        return ax

    def tiles(
        self, count: int, across: int, size: tuple[float, float], extra: float = 0.0
    ) -> tuple[Picture, list[Axes]]:
        """Create a figure with panels of equal size (inches), row by row, and ``extra``
        height.
        """
        columns = min(across, count)
        rows = -(-count // columns)
        figure = self.blank(size[0] * columns, size[1] * rows + extra)
        axes = list(figure.subplots(rows, columns, squeeze=False).flat)
        for ax in axes[count:]:
            ax.set_axis_off()
        return figure, [self.dress(ax) for ax in axes[:count]]

    def stacked_panels(
        self, count: int, rows: int | None = None
    ) -> tuple[Picture, list[Axes]]:
        """Create a figure with panels over a common time axis, filled column by
        column.
        """
        columns = -(-count // (rows or self.rows))
        rows = -(-count // columns)
        figure = self.blank(
            self.width if columns == 1 else self.wide,
            self.panel * rows + 5.0 * self.text / 72.0,
        )
        grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
        # what is left over stays blank at the top of the last column, so that every
        # column ends with a time axis
        blanks = rows * columns - count
        order = [grid[row, column] for column in range(columns) for row in range(rows)]
        first = rows * (columns - 1)
        for ax in order[first : first + blanks]:
            ax.remove()
        axes = [self.dress(ax) for ax in order[:first] + order[first + blanks :]]
        for ax in grid[-1]:
            ax.set_xlabel("Time [s]", **self.words)
        figure.align_ylabels(axes)
        return figure, axes

    def name_axis(self, ax: Axes, label: str, unit: str) -> None:
        """Label a value axis with quantity and unit; a label longer than the axis is
        wrapped after "_" or " ".
        """
        # the mean width of a letter is about half its size
        most = int(
            ax.get_window_extent().height / ax.figure.dpi * 72.0 / (0.48 * self.small)
        )
        end = f"[{unit}]" if unit else ""
        text = f"{label} {end}".strip()
        if len(text) > most:
            lines = re.findall(rf".{{1,{most}}}(?:(?<=[_ ])|$)|.{{1,{most}}}", label)
            text = "\n".join(filter(None, (*lines, end)))
        ax.set_ylabel(text, linespacing=1.0, **self.small_words)

    def legend(self, figure: Figure, handles: Mapping[str, Artist]) -> None:
        """Draw one legend below the panels, with as many columns as fit into the
        width.
        """
        canvas: Any = FigureCanvasAgg(figure)
        renderer = canvas.get_renderer()
        # the widest legend that fits, one column at worst
        # six at most, chosen; 2 % of the width are left for margins
        for columns in range(min(len(handles), 6), 0, -1):
            drawn = figure.legend(
                list(handles.values()),
                list(handles),
                loc="outside lower center",
                ncols=columns,
                frameon=False,
                labelcolor=self.ink,
                prop=self.prop,
                handlelength=2.4,
                columnspacing=1.3,
                handletextpad=0.5,
                borderaxespad=0.1,
            )
            for text in drawn.get_texts():
                # a name such as $x$ of the user is text and no formula
                text.set_parse_math(False)
            if (
                columns == 1
                or drawn.get_window_extent(renderer).width < 0.98 * figure.bbox.width
            ):
                return
            drawn.remove()


PAPER = PictureStyle()
"""Style of one column of a two-column paper (3.5 in), or both (7.16 in): IEEE's
widths."""

PAGE = replace(PAPER, font=("DejaVu Sans",), text=9.5, small=9.5, width=11.0, wide=11.0)
"""Style of a figure as wide as a web page, in its font: 9.5 pt are about 14 px
there."""


def limits(
    values: Iterable[Array], *, floor: bool, span: float, cap: float = np.inf
) -> tuple[float, float]:
    """Compute limits of a value axis that fit the given curves.

    Args:
        values: what the panel shows; entries that are not finite are left out.
        floor: begin at zero (magnitudes).
        span: smallest extent, so that rounding noise does not fill a panel.
        cap: largest magnitude, so that one diverged episode does not flatten the
            others.

    Returns:
        (low, high).
    """
    numbers = np.concatenate([np.ravel(v) for v in values] or [np.zeros(1)])
    numbers = np.clip(numbers[np.isfinite(numbers)], -cap, cap)
    low, high = (
        (float(numbers.min()), float(numbers.max())) if numbers.size else (0.0, 0.0)
    )
    # 7 % of the extent more, so that no curve lies on the frame
    if floor:
        return 0.0, 1.07 * max(high, span / 1.07)
    missing = max(0.0, span - (high - low)) / 2
    low, high = low - missing, high + missing
    return low - 0.07 * (high - low), high + 0.07 * (high - low)


def logarithmic(axis: Axis) -> None:
    """Set a logarithmic axis with plain tick labels at 1, 2 and 5 of each decade."""
    (axis.axes.set_xscale if axis is axis.axes.xaxis else axis.axes.set_yscale)("log")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    plain_numbers(axis)
    axis.set_minor_formatter(NullFormatter())


def plain_numbers(axis: Axis) -> None:
    """Label the ticks of a logarithmic axis by plain numbers such as 0.1 and 100."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


_SALTING = Lock()


@contextmanager
def _repeatable_names() -> Iterator[None]:
    """Context manager that makes Matplotlib's SVG identifiers reproducible; a salt set
    by the user is kept.

    For this there is a global parameter only, so one thread at a time sets it, for as
    long as it writes.
    """
    with _SALTING:
        usual = matplotlib.rcParams["svg.hashsalt"]
        matplotlib.rcParams["svg.hashsalt"] = usual or "skyarm"
        try:
            yield
        finally:
            matplotlib.rcParams["svg.hashsalt"] = usual


def image_bytes(figure: Figure, kind: str = "png", dpi: float = 160.0) -> bytes:
    """Encode a figure as PNG, SVG or PDF without dates and random names, so that equal
    figures give equal files.
    """
    stamp = {
        "png": {"Software": None},
        "svg": {"Date": None},
        "pdf": {"CreationDate": None},
    }
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # a name in letters that the fonts lack is drawn as boxes: no reason for a line
        # for each of them
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        with _repeatable_names():
            figure.savefig(buffer, format=kind, dpi=dpi, metadata=stamp[kind])
    return buffer.getvalue()


def save_picture(figure: Picture, path: Path) -> Path:
    """Write a figure to a file in the format of its suffix; the file appears whole or
    not at all.
    """
    return write_atomically(path, image_bytes(figure, require_suffix(path), dpi=DPI))


def typeface(*, bold: bool) -> Path:
    """Path of the font DejaVu Sans that comes with Matplotlib."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name
