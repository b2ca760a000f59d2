"""Figure of the channels of a measured flight over time, a panel for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from skyarm.records.arrays import Array
from skyarm.view.figures.style import PAPER, Picture


def channels_figure(
    channels: Mapping[str, tuple[str, Sequence[str], Array, Array]],
) -> Picture:
    """Draw the columns of each channel over time.

    Args:
        channels: name -> unit, names of the k columns, times (N,), s, and values (N,
            k).
    """
    figure, panels = PAPER.stacked_panels(len(channels))
    for panel, (name, (unit, columns, time, values)) in zip(
        panels, channels.items(), strict=True
    ):
        for k, column in enumerate(columns):
            panel.plot(time, values[:, k], label=column, **PAPER.look(k).line)
        PAPER.name_axis(panel, name, unit)
        if len(columns) > 1:
            panel.legend(
                loc="center left",
                bbox_to_anchor=(1.0, 0.5),
                frameon=False,
                prop=PAPER.prop,
            )
    return figure
