"""Figure of the channels of a measured flight over time, a panel for each."""

from __future__ import annotations

from collections.abc import Mapping

from skyarm.records.arrays import Array
from skyarm.view.figures.style import PAPER, Picture


def channels_figure(channels: Mapping[str, tuple[str, Array, Array]]) -> Picture:
    """Draw the columns of each channel over time.

    Args:
        channels: name -> unit, times (N,), s, and values (N, k).
    """
    figure, panels = PAPER.stacked_panels(len(channels))
    for panel, (name, (unit, time, values)) in zip(panels, channels.items(), strict=True):
        for k, column in enumerate(values.T):
            panel.plot(time, column, **PAPER.look(k).line)
        PAPER.name_axis(panel, name, unit)
    return figure
