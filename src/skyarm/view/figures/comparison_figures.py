"""Figures of controller comparisons: errors, success rates and performance
envelopes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import count
from typing import TypedDict

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    LogLocator,
    NullFormatter,
    PercentFormatter,
)

from skyarm.records.immutable import positional
from skyarm.view.figures.style import PAGE, Style, plain_numbers

ROW, MARGIN = 0.27, 1.2
"""Height (in) of a law's row, and of title and axis together."""

APART = 0.4
"""Distance between the dots of the first and the last series, in rows, so that equal
values are both visible."""

MARKERS = (("o", "#0072b2"), ("s", "#d55e00"), ("^", "#009e73"))
"""Marker and colour of each series, distinguishable without colour."""

ACROSS, PANEL, LEGEND = 3, 2.1, 0.6
"""Number of panels side by side; height (in) of a panel and of the legend."""

LOW, HIGH, TOP = 0.1, 1500.0, 9000.0
"""Limits (mm) of the errors, and of the band above them for lost laws; smaller errors
lower the first."""

LOWEST = 1e-3
"""Smallest drawn error (mm)."""

LINES = (
    ("#d55e00", "s", (3.2, 1.3)),
    ("#0072b2", "o", ()),
    ("#7b3294", "^", (6.0, 1.5, 1.0, 1.5)),
    ("#000000", "D", ()),
    ("#009e73", "v", (2.0, 1.2)),
    ("#a6761d", "P", (1.0, 1.2)),
    ("#666666", "X", (8.0, 2.0)),
)
"""Colour, marker and dashes of a law; each alone is distinguishable."""

KNOWN = ("paper_pd", "paper_ct", "l1_adaptive", "centroidal_tip", "nmpc")
"""Laws with the same look in every picture; others take the remaining looks in
order."""


class EnvelopePoint(TypedDict):
    """Result of a control law at one value of a condition: whether the vehicle is lost,
    and tracking error (m).
    """

    lost: bool
    judged: float


class EnvelopePanel(TypedDict):
    """Varied condition of a performance envelope: its values, their unit, and a point
    per control law and value.
    """

    values: Sequence[float]
    unit: str
    laws: Mapping[str, Sequence[EnvelopePoint]]


@positional
class Share:
    """Success rate of a control law with its confidence interval, as fractions from 0
    to 1.
    """

    value: float
    low: float
    high: float


def laws_figure(
    names: Sequence[str],
    errors: Mapping[str, Sequence[float | None]],
    shares: Sequence[Share | None],
    *,
    error_label: str,
    share_label: str,
) -> Figure:
    """Draw tracking errors of control laws as dots on a log axis, and success rates on
    perturbed plants as bars.

    Args:
        names: names of the laws, top to bottom.
        errors: series -> one error per law, mm; None leaves the place empty.
        shares: shares of successes, one per law.
        error_label: label of the axis of errors.
        share_label: label of the axis of shares.
    """
    figure = PAGE.blank(PAGE.width, MARGIN + ROW * len(names))
    left, right = figure.subplots(
        1, 2, sharey=True, gridspec_kw={"width_ratios": [3, 2]}
    )
    for panel, label in ((left, error_label), (right, share_label)):
        PAGE.dress(panel).set_xlabel(label, **PAGE.words)
    _draw_errors(left, errors)
    for row, share in enumerate(shares):
        if share is not None:
            right.barh(row, share.value, height=0.6, color="#9ecae1")
            right.plot(
                (share.low, share.high), (row, row), color=PAGE.frame, linewidth=1.0
            )
    right.set_xlim(0.0, 1.0)
    right.xaxis.set_major_formatter(PercentFormatter(1.0))
    left.set_yticks(range(len(names)), names, **PAGE.words)
    # an axis grows upwards: turned over, so that the first law stands at the top
    left.set_ylim(len(names) - 0.5, -0.5)
    return figure


def _draw_errors(ax: Axes, errors: Mapping[str, Sequence[float | None]]) -> None:
    """Draw the errors of all laws: a dot per law and series, on a logarithmic axis."""
    for i, ((name, series), (marker, color)) in enumerate(
        zip(errors.items(), MARKERS, strict=False)
    ):
        # side by side in a row; one series alone stands in its middle
        down = APART * (i / (len(errors) - 1) - 0.5) if len(errors) > 1 else 0.0
        places = [
            (value, row + down)
            for row, value in enumerate(series)
            # a logarithm has no place for zero
            if value is not None and value > 0.0
        ]
        if places:
            x, y = zip(*places, strict=True)
            ax.plot(
                x, y, marker, color=color, markersize=5, label=name, linestyle="none"
            )
    ax.set_xscale("log")
    plain_numbers(ax.xaxis)
    if errors:
        ax.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=3,
            frameon=False,
            prop=PAGE.prop,
        )


def envelope_figure(axes: Mapping[str, EnvelopePanel], laws: Sequence[str]) -> Figure:
    """Draw performance envelopes: a panel per varied condition, a line per controller,
    a cross where it crashes.

    Args:
        axes: name -> values, unit, and of each law a point for every value
            (:mod:`skyarm.studies.compare.envelope`).
        laws: in the order of the legend.
    """
    looks = _line_styles(laws)
    low = _lower_limit(axes)
    figure, panels = PAGE.tiles(len(axes), ACROSS, (PAGE.width / ACROSS, PANEL), LEGEND)
    for i, ((name, axis), panel) in enumerate(zip(axes.items(), panels, strict=True)):
        _draw_panel(panel, name, axis, looks, low)
        if i % ACROSS == 0:
            panel.set_ylabel("error [mm]", **PAGE.words)
    handles = {law: Line2D([], [], markersize=5, **look) for law, look in looks.items()}
    cross = Line2D(
        [],
        [],
        color=PAGE.frame,
        linestyle="none",
        marker="x",
        markersize=7,
        markeredgewidth=2,
    )
    PAGE.legend(figure, {**handles, "lost": cross})
    return figure


def _lower_limit(axes: Mapping[str, EnvelopePanel]) -> float:
    """Lower limit (mm) of the logarithmic error axis: a power of ten below all
    errors.
    """
    errors = [
        1e3 * point["judged"]
        for axis in axes.values()
        for points in axis["laws"].values()
        for point in points
        if not point["lost"] and point["judged"] > 0.0
    ]
    return min(
        LOW, max(LOWEST, 10.0 ** math.floor(math.log10(min(errors, default=LOW))))
    )


def _line_styles(laws: Sequence[str]) -> dict[str, Style]:
    """Return the line style (colour, marker, dashes) of each controller, by its
    name.
    """
    fixed = {law: KNOWN.index(law) for law in laws if law in KNOWN}
    free = (place for place in count() if place not in fixed.values())
    places = {law: fixed[law] if law in fixed else next(free) for law in laws}
    looks = {law: LINES[place % len(LINES)] for law, place in places.items()}
    return {
        law: {
            "color": color,
            "marker": marker,
            "linestyle": (0, dash) if dash else "-",
            "linewidth": 1.3,
        }
        for law, (color, marker, dash) in looks.items()
    }


def _draw_panel(
    panel: Axes, name: str, axis: EnvelopePanel, looks: Mapping[str, Style], low: float
) -> None:
    """Draw the error curves of all laws in one panel, with a band above for lost
    vehicles.
    """
    places = range(len(axis["values"]))
    panel.axhspan(HIGH, TOP, facecolor="#f6dcdc", edgecolor="none", zorder=0.2)
    for k, (law, look) in enumerate(looks.items()):
        if law in axis["laws"]:
            _draw_law(panel, places, axis["laws"][law], look, k / len(looks), low)
    panel.set_yscale("log")
    panel.set_ylim(low, TOP)
    # more than the decades of the axis: of fewer Matplotlib leaves out every second or
    # third power of ten
    panel.yaxis.set_major_locator(LogLocator(numticks=9))
    panel.yaxis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{value:g}" if value <= HIGH else "")
    )
    panel.yaxis.set_minor_formatter(NullFormatter())
    # values stand at equal distances, whatever they are; 0.35 of one is room, chosen
    panel.set_xlim(-0.35, len(axis["values"]) - 0.65)
    panel.xaxis.set_major_locator(FixedLocator(list(places)))
    panel.set_xticklabels([f"{value:g}" for value in axis["values"]])
    panel.set_title(
        f"{name.replace('_', ' ')} [{axis['unit']}]", loc="left", pad=4, **PAGE.words
    )


def _draw_law(
    panel: Axes,
    places: Sequence[int],
    points: Sequence[EnvelopePoint],
    look: Style,
    place: float,
    low: float,
) -> None:
    """Draw a controller's error curve; where the vehicle is lost, a cross at the top
    replaces the point.
    """
    error = [
        # NaN interrupts the curve
        float("nan") if p["lost"] else min(max(1e3 * p["judged"], low), HIGH)
        for p in points
    ]
    panel.plot(places, error, markersize=4, zorder=3 + place, **look)
    # the cross of each law has its own height in the band, so that none hides another
    height = HIGH * (TOP / HIGH) ** (0.15 + 0.85 * place)
    lost = [at for at, point in zip(places, points, strict=True) if point["lost"]]
    heights = [height] * len(lost)
    panel.plot(
        lost,
        heights,
        "x",
        color=look["color"],
        markersize=6,
        markeredgewidth=2.0,
        zorder=4,
    )
