"""Interactive figures: which curves they hold, and how short they are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from logs_synthetic import all_logs, synthetic_log
from skyarm.figures import damping_figure, experiment_figure, tool_path_figure
from skyarm.figures.embed import plotly_spec
from skyarm.simulate import Window


def test_interactive_figure_holds_every_curve_of_both_plants() -> None:
    logs = {plant: cases["case2_gust"] for plant, cases in all_logs().items()}
    figure = experiment_figure(logs, Window(5.0, 20.0))
    assert (figure.layout.shapes[0].x0, figure.layout.shapes[0].x1) == (5.0, 20.0)
    names = {trace.name for trace in figure.data}
    assert names == {"CT, rigid_body", "PD, rigid_body", "CT, mujoco", "PD, mujoco"}
    assert len(figure.data) == 4 * 7
    assert sum(bool(trace.showlegend) for trace in figure.data) == 4
    assert {trace.visible for trace in figure.data if trace.meta == "mujoco"} == {"legendonly"}
    labels = [button.label for button in figure.layout.updatemenus[0].buttons]
    assert labels == ["rigid_body", "mujoco", "both"]
    both = figure.layout.updatemenus[0].buttons[2].args[1]
    assert list(both) == [True] * len(figure.data)
    only = figure.layout.updatemenus[0].buttons[1].args[1]
    assert list(only) == [True if trace.meta == "mujoco" else "legendonly" for trace in figure.data]


def test_interactive_curves_are_decimated_and_short() -> None:
    logs = {"rigid_body": all_logs()["rigid_body"]["case1"]}
    figure = experiment_figure(logs)
    first = figure.data[0]
    assert len(first.y) == 1500
    assert first.x is None
    assert (first.x0, first.dx) == (0.0075, 0.02)
    assert first.y[0] == 0.05
    assert len(plotly_spec(figure)) < 300_000
    assert len(figure.layout.updatemenus) == 0


def test_a_gap_stands_for_what_is_not_finite() -> None:
    log = synthetic_log("case1", "rigid_body", "CT", seconds=1.0)
    position = log.position.copy()
    position[100:120] = np.nan
    figure = experiment_figure({"rigid_body": {"CT": dataclasses.replace(log, position=position)}})
    assert [i for i, v in enumerate(figure.data[0].y) if v is None] == [25, 26, 27, 28, 29]


def test_tool_path_shows_one_reference_and_every_flight() -> None:
    logs = {plant: cases["case3"] for plant, cases in all_logs().items()}
    figure = tool_path_figure(logs, 10.0, 20.0)
    assert [trace.name for trace in figure.data][:3] == ["desired", "CT, rigid_body", "PD, rigid_body"]
    assert len(figure.data) == 5
    desired, flown = figure.data[:2]
    assert np.array(flown.y, dtype=float) - np.array(desired.y, dtype=float) == pytest.approx(np.full(500, 0.01))


def test_damping_figure_draws_measured_points_and_the_published_level() -> None:
    table = {
        "0.05": {"case2": {"CT": {"pitch_rms": None}, "PD": {"pitch_rms": 5.0}}},
        "0": {"case2": {"CT": {"pitch_rms": 1.0}, "PD": {"pitch_rms": 3.0}}},
        "0.001": {"case2": {"CT": {"pitch_rms": 2.0}, "PD": {}}},
    }
    paper = {"case2": {"CT": {"pitch_rms": 1.5}, "PD": {}}}
    figure = damping_figure(table, paper, [("case2", "pitch_rms", "Pitch")])
    ct, ct_paper, pd, _ = figure.data
    assert tuple(ct.x) == ("0", "0.001", "0.05")
    assert tuple(ct.y) == (1.0, 2.0, None)
    assert tuple(pd.y) == (3.0, None, 5.0)
    assert tuple(ct_paper.y) == (1.5, 1.5, 1.5)
    assert (ct.line.dash, pd.line.dash) == ("solid", "dash")
    assert ct.marker.symbol != pd.marker.symbol


def test_specification_cannot_close_a_script_element() -> None:
    figure = tool_path_figure({"</script><b>": {"CT": synthetic_log("case3", "rigid_body", "CT", seconds=9.0)}})
    assert "<" not in plotly_spec(figure)
    assert "script" in plotly_spec(figure)
