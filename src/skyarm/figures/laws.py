"""All laws in one picture: tracking error as dots on a logarithmic axis, success on wrong plants as bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, PercentFormatter

from skyarm.figures import style

WIDTH, ROW, MARGIN = 7.2, 0.22, 0.9
"""in: of the figure, of one law, of title and axis."""

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
    figure = Figure(figsize=(WIDTH, MARGIN + ROW * len(names)), layout=ConstrainedLayoutEngine(w_pad=0.04, h_pad=0.04))
    figure.set_facecolor("white")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, sharey=True, gridspec_kw={"width_ratios": [3, 2]})
    style.dress(left)
    style.dress(right)
    _errors(left, errors, error_label)
    _shares(right, shares, share_label)
    left.set_yticks(range(len(names)), names, fontsize=style.SMALL_SIZE, family=style.FONT)
    left.set_ylim(len(names) - 0.5, -0.5)
    return figure


def _errors(ax: Axes, errors: Mapping[str, Sequence[float | None]], label: str) -> None:
    for (name, series), (marker, color) in zip(errors.items(), MARKERS, strict=False):
        places = [(value, row) for row, value in enumerate(series) if value is not None and value > 0.0]
        if places:
            x, y = zip(*places, strict=True)
            ax.plot(x, y, marker, color=color, markersize=4, label=name, linestyle="none")
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_xlabel(label, fontsize=style.SMALL_SIZE, family=style.FONT)
    if errors:
        ax.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=3,
            frameon=False,
            prop={"size": style.SMALL_SIZE, "family": style.FONT},
        )


def _shares(ax: Axes, shares: Sequence[Share | None], label: str) -> None:
    for row, share in enumerate(shares):
        if share is not None:
            ax.barh(row, share.value, height=0.6, color="#9ecae1")
            ax.plot((share.low, share.high), (row, row), color=style.FRAME, linewidth=1.0)
    ax.set_xlim(0.0, 1.0)
    ax.xaxis.set_major_formatter(PercentFormatter(1.0))
    ax.set_xlabel(label, fontsize=style.SMALL_SIZE, family=style.FONT)
