"""Figures of parameter studies: curves with bands, and robustness maps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, PercentFormatter

from skyarm.log.metrics.metric_catalogue import metric_words
from skyarm.records.arrays import Array
from skyarm.records.files import PathLike
from skyarm.records.files.names import require_suffix
from skyarm.scenario.numbers import axis_label
from skyarm.studies.sweep.banded_curves import (
    BAND,
    BandedCurve,
    BandedCurves,
    banded_curves,
)
from skyarm.studies.sweep.maps import RobustnessMap
from skyarm.studies.sweep.stats import Rows
from skyarm.studies.sweep.study import StudyError
from skyarm.view.figures.style import (
    PAPER,
    CurveLook,
    Handles,
    Picture,
    Style,
    limits,
    logarithmic,
    save_picture,
)

ROUNDING = 1e-9
"""Extent below which values differ by rounding; it does not fill a panel."""

MOST_PANELS = 6
"""Largest number of metrics in a picture."""

LONGEST = 44
"""Largest number of characters of a variable's description on an axis."""


def plot_sweep(
    folder: PathLike | Rows,
    metrics: str | Sequence[str],
    over: str,
    file: PathLike | None = None,
) -> Picture:
    """Draw metrics of a sweep against a varied parameter or an expression of several.

    Args:
        folder: folder that ``skyarm sweep`` wrote, or its rows.
        metrics: one, or several above each other.
        over: a varied path, ``"sqrt(a * a + b * b)"`` or ``"length = sqrt(a * a + b *
            b)"``.
        file: written there too, as PNG, SVG or PDF by its suffix.

    Raises:
        ValueError: one line. OSError: a file cannot be read or written.
    """
    if file is not None:
        require_suffix(Path(file))
    rows = folder if isinstance(folder, Rows) else Rows(folder)
    # a metric that is named twice has one panel
    names = [metrics] if isinstance(metrics, str) else list(dict.fromkeys(metrics))
    if not 1 <= len(names) <= MOST_PANELS:
        raise StudyError(
            f"metrics = {len(names)}: must be 1 to {MOST_PANELS} in one picture"
        )
    curves = [banded_curves(rows, name, over) for name in names]
    figure = metric_figure(curves)
    if file is not None:
        save_picture(figure, Path(file))
    return figure


def metric_figure(found: Sequence[BandedCurves]) -> Picture:
    """Draw metrics of a sweep against one variable: a panel per metric, a line per
    controller.
    """
    first = found[0]
    lost = any(curve.lost.any() for curve in first.curves)
    # in inches, chosen; above and below them there is room for six lines of text
    heights = [2.0] * len(found) + [0.7] * lost
    figure = PAPER.blank(PAPER.width, sum(heights) + 6.0 * PAPER.text / 72.0)
    options = {"height_ratios": heights}
    panels = figure.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw=options
    )[:, 0]
    for ax in panels:
        PAPER.dress(ax).xaxis.set_major_locator(MaxNLocator(nbins=7))
    handles: Handles = {}
    # the panel of the lost, if any, is behind those of the metrics
    for ax, each in zip(panels, found, strict=False):
        for i, curve in enumerate(each.curves):
            handles[curve.controller] = _draw_band(
                ax, curve, PAPER.look(i), curve.controller
            )
        PAPER.name_axis(ax, *metric_words(each.metric))
        if _spans_decades(each):
            logarithmic(ax.yaxis)
        else:
            ax.set_ylim(*_axis_limits(each))
    if lost:
        _draw_lost(panels[-1], first.curves)
        panels[-1].set_ylabel("Lost", **PAPER.small_words)
    panels[-1].set_xlabel(
        axis_label(_short(first.over.words), first.over.unit), **PAPER.words
    )
    if first.over.logarithmic:
        panels[-1].set_xscale("log")
    figure.align_ylabels(list(panels))
    shares = " to ".join(f"{100.0 * share:g}" for share in BAND)
    of = " of completed" if lost else ""
    handles[f"median{of}, band {shares} %"] = Patch(
        facecolor=PAPER.frame, alpha=0.25, edgecolor="none"
    )
    PAPER.legend(figure, handles)
    return figure


def _short(words: str) -> str:
    return (
        words
        if len(words) <= LONGEST
        else f"{words[: LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"
    )


def _axis_limits(drawn: BandedCurves) -> tuple[float, float]:
    """Limits of a metric's value axis, starting at zero if no value is negative."""
    seen = np.concatenate(
        [
            line
            for curve in drawn.curves
            for line in (curve.middle, curve.low, curve.high)
        ]
    )
    return limits([seen], floor=not (seen < 0.0).any(), span=ROUNDING)


DECADES = 2.0
"""Range of a metric, in powers of ten, from which its axis is logarithmic."""


def _spans_decades(drawn: BandedCurves) -> bool:
    """True if the medians of a metric are positive and span decades."""
    seen = np.concatenate([curve.middle for curve in drawn.curves])
    seen = seen[np.isfinite(seen)]
    return (
        seen.size > 0
        and seen.min() > 0.0
        and bool(seen.max() >= 10.0**DECADES * seen.min())
    )


def _draw_band(ax: Axes, curve: BandedCurve, look: CurveLook, label: str) -> Line2D:
    """Draw a median curve with its quantile band; returns the line for the legend."""
    ax.fill_between(
        curve.x,
        curve.low,
        curve.high,
        color=look.color,
        alpha=0.16,
        linewidth=0.0,
        zorder=look.layer - 1.0,
    )
    for end in (curve.low, curve.high):
        ax.plot(
            curve.x,
            end,
            color=look.color,
            linewidth=0.4 * look.width,
            alpha=0.6,
            label="_band",
        )
    (line,) = ax.plot(
        curve.x, curve.middle, label=label, **look.line, **_marks(curve.x)
    )
    return line


def _marks(x: Array) -> Style:
    """Marker style of a curve with few points; empty for a longer one."""
    return (
        {"marker": "o", "markersize": 0.4 * PAPER.small, "markeredgewidth": 0.0}
        # the marks of more points would touch each other; chosen
        if x.size <= 15
        else {}
    )


def _draw_lost(ax: Axes, curves: Sequence[BandedCurve]) -> None:
    """Draw the share of episodes that ended early against the varied parameter, a curve
    per controller.
    """
    for i, curve in enumerate(curves):
        look = PAPER.look(i)
        share = curve.lost / np.maximum(curve.episodes, 1)
        ax.plot(curve.x, share, label=curve.controller, **look.line, **_marks(curve.x))
    # beyond both ends, where most curves lie
    ax.set_ylim(-0.05, 1.05)
    ax.set_yticks([0.0, 0.5, 1.0])
    ax.yaxis.set_major_formatter(PercentFormatter(1.0))


MAP_WIDTH, MAP_HEIGHT = 4.2, 3.4
"""Width and height (in) of a map."""

COLORS = "cividis"
"""Colour map: even in lightness, and readable with every form of colour vision."""

BOUNDARY = 0.5
"""Fraction of successes on the failure boundary."""

LINE = "#d7301f"


def robustness_figure(found: RobustnessMap) -> Figure:
    """Draw success rates as shading with the failure boundary as a line; bins without
    episodes stay blank.
    """
    figure, (ax,) = PAPER.tiles(1, 1, (MAP_WIDTH, MAP_HEIGHT))
    across = found.across
    upward = found.upward
    share = np.ma.masked_invalid(found.rate)
    ax.grid(visible=False)
    shade = ax.pcolormesh(
        across.edges, upward.edges, share, cmap=COLORS, vmin=0.0, vmax=1.0
    )
    bar = figure.colorbar(shade, ax=ax)
    bar.ax.tick_params(labelsize=PAPER.small, labelfontfamily=PAPER.font[0], width=0.5)
    bar.set_label("share of successes", **PAPER.small_words)
    for side, axis in ((across, ax.xaxis), (upward, ax.yaxis)):
        if side.logarithmic:
            logarithmic(axis)
    # Matplotlib's contours take two rows, two columns and values on both sides
    if min(share.shape) >= 2 and share.min() < BOUNDARY < share.max():
        half = ax.contour(
            across.centers,
            upward.centers,
            share,
            levels=[BOUNDARY],
            colors=[LINE],
            linewidths=1.4,
        )
        half.set_label("half succeed")
    ax.set_title(found.controller, **PAPER.words)
    ax.set_xlabel(across.label or across.path, **PAPER.small_words)
    ax.set_ylabel(upward.label or upward.path, **PAPER.small_words)
    return figure
