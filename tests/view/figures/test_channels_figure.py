"""Channels of a measured flight: a panel for each, with the numbers that are given."""

from __future__ import annotations

import numpy as np

from skyarm.view.figures.channels_figure import channels_figure
from skyarm.view.figures.style import image_bytes


def test_each_panel_holds_the_columns_of_its_channel_over_its_own_times():
    gyro, volts = np.arange(12.0).reshape(4, 3), np.array([[12.4], [12.3]])
    times = {"gyro": np.arange(4.0), "voltage": np.array([0.5, 2.5])}
    figure = channels_figure(
        {
            "gyro": ("rad/s", "xyz", times["gyro"], gyro),
            "voltage": ("V", "1", times["voltage"], volts),
        }
    )
    for panel, (name, values) in zip(
        figure.axes, (("gyro", gyro), ("voltage", volts)), strict=True
    ):
        assert len(panel.lines) == values.shape[1]
        for line, column in zip(panel.lines, values.T, strict=True):
            np.testing.assert_array_equal(line.get_xdata(), times[name])
            np.testing.assert_array_equal(line.get_ydata(), column)
    assert [panel.get_ylabel() for panel in figure.axes] == [
        "gyro [rad/s]",
        "voltage [V]",
    ]
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == [
        "x",
        "y",
        "z",
    ]
    assert figure.axes[-1].get_xlabel() == "Time [s]"
    assert image_bytes(figure).startswith(b"\x89PNG")
