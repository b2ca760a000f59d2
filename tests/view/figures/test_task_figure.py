"""The small picture of a task in contact: its forces are those of the log, and its view is the widest."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from logged_flights import with_components
from skyarm.reference.signals import Constant, Windowed
from skyarm.reference.tip_motion import TipPush
from skyarm.view.figures.flight_facts import desired_push
from skyarm.view.figures.path_views import task_figure, widest_view
from skyarm.view.figures.projection import BEHIND, SIDE, TOP
from world_flights import touching


def test_forces_are_those_of_the_log_beside_the_wanted_one() -> None:
    log = touching()
    figure = task_figure(log)
    above, _ = figure.axes
    force, wanted = above.get_lines()
    np.testing.assert_array_equal(force.get_ydata(), log.contact_force.sum(axis=1))
    np.testing.assert_array_equal(wanted.get_ydata(), np.where(log.time >= 0.1, 1.0, 0.0))
    assert above.get_ylim()[0] == 0.0
    words = {text.get_text() for text in figure.legends[0].get_texts()}
    assert words == {"normal force", "desired force", "tip"}


def test_what_is_gripped_without_a_touch_is_drawn_alone() -> None:
    log = touching()
    grip = np.stack([np.arange(log.time.size), np.ones(log.time.size)], axis=1)
    held = with_components(log, contact_force=np.zeros_like(log.contact_force), gripper_force=grip)
    figure = task_figure(held)
    first = figure.axes[0].get_lines()[0]
    np.testing.assert_array_equal(first.get_ydata(), grip.sum(axis=1))
    words = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"grip"} <= words
    assert "normal force" not in words


@pytest.mark.parametrize(
    ("wide", "view"), [((0.0, 1.0, 1.0), BEHIND), ((1.0, 0.0, 1.0), SIDE), ((1.0, 1.0, 0.0), TOP), ((0.0,) * 3, SIDE)]
)
def test_the_view_leaves_out_the_way_that_the_tip_goes_least(wide: tuple[float, ...], view: Any) -> None:
    log = touching()
    path = np.linspace(0.0, 1.0, log.time.size)[:, None] * np.array(wide)
    assert widest_view(dataclasses.replace(log, tool=path)) is view


def test_from_behind_left_is_left() -> None:
    """An observer who looks along x sees y on the left and z above."""
    np.testing.assert_allclose(BEHIND.flat(np.array([5.0, 2.0, 3.0])), [-2.0, 3.0])
    np.testing.assert_allclose(BEHIND.toward, [-1.0, 0.0, 0.0])


def test_the_wanted_force_of_a_task_that_waits_stands_at_its_own_time() -> None:
    push = TipPush(force=Windowed(Constant(2.0), 1.0, 2.0), normal=(-1.0, 0.0, 0.0))
    time, late = np.array([0.0, 1.5, 3.0]), np.array([0.0, 0.5, 1.5])
    waits = SimpleNamespace(reference=SimpleNamespace(push=push, guards=(1,)))
    log: Any = SimpleNamespace(scenario=waits, time=time, path_time=late)
    found = desired_push(log)
    assert found is not None
    assert found.tolist() == [0.0, 0.0, 2.0]
    waits.reference.guards = ()
    assert desired_push(log).tolist() == [0.0, 2.0, 0.0]  # type: ignore[union-attr]
    waits.reference.push = None
    assert desired_push(log) is None
