"""Interactive figures: which curves they hold, and how short they are."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from logs_synthetic import all_logs, synthetic_log
from skyarm.simulate import Window
from skyarm.view.figures.interactive import (
    STYLES,
    Choice,
    Shade,
    damping_figure,
    experiment_figure,
    figure_json,
    tool_path_figure,
)
from skyarm.view.figures.paper_figures import by_hold


def test_interactive_figure_holds_every_curve_of_both_plants() -> None:
    logs = {plant: cases["case2_gust"] for plant, cases in all_logs().items()}
    figure = experiment_figure(logs, Window(5.0, 20.0))
    assert figure.shades == [Shade(name="window", start=5.0, stop=20.0), Shade(name="gust", start=7.5, stop=10.5)]
    names = ["CT, rigid_body", "PD, rigid_body", "CT, mujoco", "PD, mujoco"]
    assert list(dict.fromkeys(curve.name for curve in figure.curves)) == names
    assert len(figure.curves) == 4 * 7
    assert [curve.panel for curve in figure.curves] == [*range(7)] * 4
    assert {curve.name for curve in figure.curves if curve.shown} == set(names[:2])
    assert len({curve.style for curve in figure.curves}) == 4
    assert figure.choices == [
        Choice(label="rigid_body", names=names[:2]),
        Choice(label="mujoco", names=names[2:]),
        Choice(label="both", names=names),
    ]


def test_interactive_curves_are_decimated_and_short() -> None:
    logs = {"rigid_body": all_logs()["rigid_body"]["case1"]}
    figure = experiment_figure(logs)
    first = figure.curves[0]
    assert len(first.y) == 1500
    assert (first.x0, first.dx) == (0.0075, 0.02)
    assert first.y[0] == 0.05
    assert len(figure_json(figure)) < 300_000
    assert figure.choices == []
    assert figure.shades == []


def test_the_data_in_the_page_are_those_of_the_log() -> None:
    log = synthetic_log("case1", "mujoco", "CT", seconds=3.0)
    wobble = 0.01 * np.sin(np.arange(log.time.size))
    log = dataclasses.replace(log, joints=log.joints + wobble[:, None])
    read = json.loads(figure_json(experiment_figure({"mujoco": {"CT": log}})))
    labels = [panel["label"] for panel in read["panels"]]
    (curve,) = [each for each in read["curves"] if labels[each["panel"]] == "Joint 2 error"]
    held = by_hold(log, (log.joints - log.joints_held)[:, 1])
    assert curve["y"] == pytest.approx(held.mean, abs=5.1e-7)
    assert curve["x0"] + curve["dx"] * np.arange(len(curve["y"])) == pytest.approx(held.time, abs=1e-8)
    assert curve["style"] == "ct-mujoco"
    assert set(STYLES) >= {each["style"] for each in read["curves"]}


def test_a_gap_stands_for_what_is_not_finite() -> None:
    log = synthetic_log("case1", "rigid_body", "CT", seconds=1.0)
    position = log.position.copy()
    position[100:120] = np.nan
    figure = experiment_figure({"rigid_body": {"CT": dataclasses.replace(log, position=position)}})
    assert [i for i, v in enumerate(figure.curves[0].y) if v is None] == [25, 26, 27, 28, 29]


def test_tool_path_shows_one_reference_and_every_flight() -> None:
    logs = {plant: cases["case3"] for plant, cases in all_logs().items()}
    figure = tool_path_figure(logs, 10.0, 20.0)
    assert [path.name for path in figure.curves][:3] == ["desired", "CT, rigid_body", "PD, rigid_body"]
    assert len(figure.curves) == 5
    assert [path.shown for path in figure.curves] == [True, True, True, False, False]
    assert [choice.names[0] for choice in figure.choices] == ["desired"] * 3
    desired, flown = figure.curves[:2]
    assert np.array(flown.y, dtype=float) - np.array(desired.y, dtype=float) == pytest.approx(np.full(500, 0.01))
    log = logs["rigid_body"]["CT"]
    rows = np.flatnonzero((log.time >= 10.0) & (log.time < 20.0))[::4]
    assert np.stack([flown.x, flown.y, flown.z], axis=1) == pytest.approx(log.tool[rows], abs=5.1e-7)


def test_damping_figure_draws_measured_points_and_the_published_level() -> None:
    table = {
        "0.05": {"case2": {"CT": {"pitch_rms": None}, "PD": {"pitch_rms": 5.0}}},
        "0": {"case2": {"CT": {"pitch_rms": 1.0}, "PD": {"pitch_rms": 3.0}}},
        "0.001": {"case2": {"CT": {"pitch_rms": 2.0}, "PD": {}}},
    }
    paper = {"case2": {"CT": {"pitch_rms": 1.5}, "PD": {}}}
    figure = damping_figure(table, paper, [("case2", "pitch_rms", "Pitch")])
    ct, ct_paper, pd, _ = figure.curves
    assert figure.categories == ["0", "0.001", "0.05"]
    assert (ct.x0, ct.dx) == (0.0, 1.0)
    assert tuple(ct.y) == (1.0, 2.0, None)
    assert tuple(pd.y) == (3.0, None, 5.0)
    assert tuple(ct_paper.y) == (1.5, 1.5, 1.5)
    assert (ct.style, ct_paper.style, pd.style) == ("ct", "ct-paper", "pd")
    assert (ct.points, ct_paper.points) == (True, False)


def test_specification_cannot_close_a_script_element() -> None:
    figure = tool_path_figure({"</script><b>": {"CT": synthetic_log("case3", "rigid_body", "CT", seconds=9.0)}})
    assert "<" not in figure_json(figure)
    assert "script" in figure_json(figure)
    assert json.loads(figure_json(figure))["curves"][1]["name"] == "CT, </script><b>"
