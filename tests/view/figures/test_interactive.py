"""Interactive figures: which curves they hold, and how short they are."""

from __future__ import annotations

import dataclasses
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from logs_synthetic import all_logs, synthetic_log
from skyarm.simulate import Window
from skyarm.view.figures.interactive import (
    STYLES,
    experiment_figure,
    figure_json,
    plot_script,
    plot_style,
)
from skyarm.view.figures.paper_figures import by_hold
from skyarm.view.pages import page, plot

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def test_interactive_figure_holds_every_curve_of_both_plants() -> None:
    logs = {plant: cases["case2_gust"] for plant, cases in all_logs().items()}
    figure = experiment_figure(logs, Window(5.0, 20.0))
    assert figure.shades == [
        {"name": "window", "start": 5.0, "stop": 20.0},
        {"name": "gust", "start": 7.5, "stop": 10.5},
    ]
    names = ["CT, rigid_body", "PD, rigid_body", "CT, mujoco", "PD, mujoco"]
    assert list(dict.fromkeys(curve.name for curve in figure.curves)) == names
    assert len(figure.curves) == 4 * 7
    assert [curve.panel for curve in figure.curves] == [*range(7)] * 4
    assert {curve.name for curve in figure.curves if curve.shown} == set(names[:2])
    assert len({curve.style for curve in figure.curves}) == 4
    assert figure.choices == [
        {"label": "rigid_body", "names": names[:2]},
        {"label": "mujoco", "names": names[2:]},
        {"label": "both", "names": names},
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
    assert set(STYLES.values()) >= {each["style"] for each in read["curves"]}


def test_a_gap_stands_for_what_is_not_finite() -> None:
    log = synthetic_log("case1", "rigid_body", "CT", seconds=1.0)
    position = log.position.copy()
    position[100:120] = np.nan
    figure = experiment_figure({"rigid_body": {"CT": dataclasses.replace(log, position=position)}})
    assert [i for i, v in enumerate(figure.curves[0].y) if v is None] == [25, 26, 27, 28, 29]


def test_specification_cannot_close_a_script_element() -> None:
    log = synthetic_log("case3", "rigid_body", "CT", seconds=9.0)
    figure = experiment_figure({"</script><b>": {"CT": log}})
    assert "<" not in figure_json(figure)
    assert json.loads(figure_json(figure))["curves"][1]["name"] == "CT, </script><b>"


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
def test_a_page_draws_every_panel_and_hides_what_waits(tmp_path: Path) -> None:
    logs = {plant: cases["case2_gust"] for plant, cases in all_logs().items()}
    data = (
        f'<script type="application/json" id="gust">{figure_json(experiment_figure(logs, Window(5.0, 20.0)))}</script>'
    )
    written = page("Title", "", plot("gust", "Caption"), style={"": plot_style()}, script=plot_script(), data=data)
    (tmp_path / "page.html").write_text(written, "utf-8")
    options = ("--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=3000", "--dump-dom")
    command = [str(CHROMIUM), *options, (tmp_path / "page.html").as_uri()]
    seen = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    assert seen.count("<canvas") == 7
    assert seen.count('class="u-series u-off"') == 2 * 7
    assert "Tip error [m]" in seen
