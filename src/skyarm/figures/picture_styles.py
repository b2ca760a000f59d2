"""The styles of pictures of one's own flights, sweeps and vehicles: for a paper's column, for a talk, light or dark.

As in :mod:`skyarm.figures.style` everything is set on the artists themselves and no global state is touched. Neighbours
in ``looks`` differ in colour, in lightness and in dash, so that a print in grey tells them apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator

from skyarm.figures.embed import image_bytes
from skyarm.figures.style import OTHER_LOOKS, Look
from skyarm.files import must_be_one_of, shown

STYLES = ("paper", "talk")

DPI = {"paper": 300.0, "talk": 144.0}
"""Dots an inch of a PNG: what journals ask of line drawings with text, and 1920 across a slide."""

NOTEBOOK_DPI = 110.0


class Picture(Figure):
    """A figure that a notebook shows, whichever Matplotlib backend is loaded there."""

    def _repr_png_(self) -> bytes:
        return image_bytes(self, dpi=NOTEBOOK_DPI)


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureStyle:
    """How a picture looks.

    Attributes:
        name: one of STYLES. font: families in order. text, small: pt.
        width, wide: of one column of panels, and of several, in. panel: least height of a panel, in.
        rows: panels one above the other before another column begins.
        face, ink, frame, grid: colours of the ground, of words, of frames, of grids.
        looks: of the flights or laws in their order. desired, limit: of references and of limits.
        shades: fills of events in their order.
    """

    name: str
    font: tuple[str, ...]
    text: float
    small: float
    width: float
    wide: float
    panel: float
    rows: int
    face: str
    ink: str
    frame: str
    grid: str
    looks: tuple[Look, ...]
    desired: Look
    limit: Look
    shades: tuple[str, ...]

    @property
    def words(self) -> dict[str, Any]:
        """Keywords of a text of the larger size."""
        return {"fontsize": self.text, "family": list(self.font), "color": self.ink, "parse_math": False}

    @property
    def small_words(self) -> dict[str, Any]:
        """Keywords of a text of the smaller size."""
        return {**self.words, "fontsize": self.small}

    def look(self, position: int) -> Look:
        """The look of a flight by its place; after the last the colours begin again, with a dash of their own."""
        look = self.looks[position % len(self.looks)]
        return look if position < len(self.looks) else replace(look, dash=(1.0, 1.0), width=0.8 * look.width)


_PAPER_LOOKS = (
    Look(color="#08306b", tint="#c3d2e6", width=1.1, layer=3.0),
    Look(color="#e6762b", tint="#f8dcc8", dash=(3.2, 1.3), width=1.1, layer=3.2),
    *(
        replace(look, width=1.1, layer=3.3, tint=tint)
        for look, tint in zip(OTHER_LOOKS, ("#cfe3d5", "#dfcde2", "#dddddd"), strict=True)
    ),
    Look(color="#b2182b", tint="#eccdd1", dash=(5.0, 1.5, 1.0, 1.5, 1.0, 1.5), width=1.1, layer=3.3),
)

_DARK_COLORS = ("#79b0ee", "#f79a5c", "#6fce8f", "#c9a0f0", "#b8bec6", "#ff7d8b")
_DARK_TINTS = ("#26384f", "#4d3524", "#24432f", "#3d3150", "#3a3f45", "#512b31")

PAPER = PictureStyle(
    name="paper",
    font=("STIXGeneral", "DejaVu Serif"),
    text=8.0,
    small=7.0,
    width=3.5,
    wide=7.16,
    panel=0.95,
    rows=8,
    face="#ffffff",
    ink="#000000",
    frame="#333333",
    grid="#d9d9d9",
    looks=_PAPER_LOOKS,
    desired=Look(color="#000000", dash=(1.0, 1.4), width=0.8, layer=3.6),
    limit=Look(color="#8c1a10", dash=(8.0, 2.0), width=0.8, layer=2.6),
    shades=("#dcdcdc", "#f3e3c3", "#f2d3d0", "#d7e6f2"),
)
"""One column of a two-column paper (3.5 in), or both (7.16 in): IEEE's widths."""

TALK = PictureStyle(
    name="talk",
    font=("DejaVu Sans",),
    text=15.0,
    small=13.0,
    width=13.33,
    wide=13.33,
    panel=1.75,
    rows=3,
    face="#ffffff",
    ink="#1b1f24",
    frame="#555555",
    grid="#dddddd",
    looks=tuple(replace(look, width=2.3) for look in _PAPER_LOOKS),
    desired=Look(color="#000000", dash=(1.0, 1.4), width=1.6, layer=3.6),
    limit=Look(color="#8c1a10", dash=(8.0, 2.0), width=1.6, layer=2.6),
    shades=PAPER.shades,
)
"""A slide of 13.33 by 7.5 in, readable from the last row."""

TALK_DARK = replace(
    TALK,
    face="#11151b",
    ink="#e4e8ec",
    frame="#8a949e",
    grid="#323940",
    looks=tuple(
        replace(look, color=color, tint=tint)
        for look, color, tint in zip(TALK.looks, _DARK_COLORS, _DARK_TINTS, strict=True)
    ),
    desired=replace(TALK.desired, color="#ffffff"),
    limit=replace(TALK.limit, color="#ff8a7a"),
    shades=("#333d49", "#4a4028", "#4b2c2c", "#233b4d"),
)


def picture_style(name: str, *, dark: bool = False) -> PictureStyle:
    """A style by its name.

    Raises:
        ValueError: one line: no such style, or a dark paper.
    """
    if name not in STYLES:
        raise ValueError(f"style = {shown(name)}: {must_be_one_of(STYLES, name)}")
    if dark and name != "talk":
        raise ValueError(f"dark: must come with style = 'talk', not {shown(name)}")
    return (TALK_DARK if dark else TALK) if name == "talk" else PAPER


def panels(style: PictureStyle, count: int, rows: int | None = None) -> tuple[Picture, list[Axes]]:
    """A figure of so many panels over one time axis, filled column by column, top to bottom."""
    columns = -(-count // (rows or style.rows))
    rows = -(-count // columns)
    height = style.panel if style.name == "paper" else max(style.panel, 5.6 / rows)
    figure = blank(style, style.width if columns == 1 else style.wide, height * rows + 5.0 * style.text / 72.0)
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    # what is left over stays blank at the top of the last column, so that every column ends with a time axis
    blanks = rows * columns - count
    order = [grid[row, column] for column in range(columns) for row in range(rows)]
    first = rows * (columns - 1)
    for ax in order[first : first + blanks]:
        ax.remove()
    axes = [dress(ax, style) for ax in order[:first] + order[first + blanks :]]
    for ax in grid[-1]:
        ax.set_xlabel("Time [s]", **style.words)
    figure.align_ylabels(axes)
    return figure, axes


def name_axis(ax: Axes, style: PictureStyle, label: str, unit: str) -> None:
    """Words and unit of a value axis, on two lines where one is longer than the panel is high."""
    height = ax.get_window_extent().height / ax.figure.dpi * 72.0
    words = f"{label} [{unit}]" if unit else label
    if 0.48 * style.small * len(words) > height:
        words = f"{label}\n[{unit}]"
    ax.set_ylabel(words, linespacing=1.0, **style.small_words)


def blank(style: PictureStyle, width: float, height: float) -> Picture:
    """An empty figure of this size, in."""
    pad = 0.006 * style.text
    layout = ConstrainedLayoutEngine(w_pad=pad, h_pad=pad)
    figure = Picture(figsize=(width, height), layout=layout, facecolor=style.face)
    FigureCanvasAgg(figure)
    return figure


def dress(ax: Axes, style: PictureStyle) -> Axes:
    """Frame, grid and ticks of one panel."""
    line = 0.06 * style.text
    ax.set_facecolor(style.face)
    ticks: dict[str, Any] = {"labelsize": style.small, "labelfontfamily": style.font[0], "labelcolor": style.ink}
    ax.tick_params(**ticks, direction="in", width=line, length=5.0 * line, color=style.frame)
    ax.grid(visible=True, color=style.grid, linewidth=0.8 * line)
    ax.set_axisbelow(True)
    ax.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    for spine in ax.spines.values():
        spine.set_linewidth(line)
        spine.set_edgecolor(style.frame)
    return ax


def legend(figure: Figure, style: PictureStyle, handles: Sequence[Any], labels: Sequence[str]) -> None:
    """One legend below the panels, in as many columns as fit into the figure's width."""
    canvas: Any = FigureCanvasAgg(figure)
    renderer = canvas.get_renderer()
    for columns in range(min(len(labels), 6), 0, -1):
        drawn = figure.legend(
            handles,
            labels,
            loc="outside lower center",
            ncols=columns,
            frameon=False,
            labelcolor=style.ink,
            prop={"size": style.small, "family": list(style.font)},
            handlelength=2.4,
            columnspacing=1.3,
            handletextpad=0.5,
            borderaxespad=0.1,
        )
        for text in drawn.get_texts():
            text.set_parse_math(False)
        if columns == 1 or drawn.get_window_extent(renderer).width < 0.98 * figure.bbox.width:
            return
        drawn.remove()
