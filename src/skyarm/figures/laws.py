"""All laws in one picture: tracking error as dots on a logarithmic axis, success on perturbed plants as bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, PercentFormatter

from skyarm.figures import style

ROW, MARGIN = 0.27, 1.2
"""in: of one law, of title and axis."""

APART = 0.4
"""Rows between the dots of the first and the last series: two that agree must both be seen."""

TEXT: dict[str, Any] = {"fontsize": style.PAGE_SIZE, "family": style.PAGE_FONT}

MARKERS = (("o", "#0072b2"), ("s", "#d55e00"), ("^", "#009e73"))
"""Shape and colour of each series; told apart without colour, too."""


@dataclass(frozen=True, slots=True)
class Share:
    """A share of successes and its interval."""

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
    """Draw the comparison.

    Args:
        names: of the laws, top to bottom.
        errors: series -> one error per law, mm; None leaves the place empty.
        shares: of successes, one per law.
        error_label: of the axis of errors.
        share_label: of the axis of shares.
    """
    size = (style.PAGE_WIDTH, MARGIN + ROW * len(names))
    figure = Figure(figsize=size, layout=ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.05))
    figure.set_facecolor("white")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, sharey=True, gridspec_kw={"width_ratios": [3, 2]})
    for panel in (left, right):
        style.dress(panel, size=style.PAGE_SIZE, family=style.PAGE_FONT[0])
    _errors(left, errors, error_label)
    _shares(right, shares, share_label)
    left.set_yticks(range(len(names)), names, **TEXT)
    left.set_ylim(len(names) - 0.5, -0.5)
    return figure


def _errors(ax: Axes, errors: Mapping[str, Sequence[float | None]], label: str) -> None:
    for i, ((name, series), (marker, color)) in enumerate(zip(errors.items(), MARKERS, strict=False)):
        down = APART * (i / (len(errors) - 1) - 0.5) if len(errors) > 1 else 0.0
        places = [(value, row + down) for row, value in enumerate(series) if value is not None and value > 0.0]
        if places:
            x, y = zip(*places, strict=True)
            ax.plot(x, y, marker, color=color, markersize=5, label=name, linestyle="none")
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_xlabel(label, **TEXT)
    if errors:
        ax.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=3,
            frameon=False,
            prop={"size": style.PAGE_SIZE, "family": style.PAGE_FONT},
        )


def _shares(ax: Axes, shares: Sequence[Share | None], label: str) -> None:
    for row, share in enumerate(shares):
        if share is not None:
            ax.barh(row, share.value, height=0.6, color="#9ecae1")
            ax.plot((share.low, share.high), (row, row), color=style.FRAME, linewidth=1.0)
    ax.set_xlim(0.0, 1.0)
    ax.xaxis.set_major_formatter(PercentFormatter(1.0))
    ax.set_xlabel(label, **TEXT)
