"""The loss and the counts of cells, against numbers made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.paper.unstated_study import (
    PublishedNumber,
    losses,
    slack_distance,
    tally,
    within,
)


def cell(measured: float, half: float = 0.0) -> PublishedNumber:
    return PublishedNumber("flight", "name", "metric", measured, half)


def loss(
    ours: float,
    measured: float,
    half: float = 0.0,
    width: float = 0.25,
    knee: float = 3.0,
) -> float:
    return float(losses(np.array([[ours]]), [cell(measured, half)], width, knee)[0, 0])


def test_the_loss_is_that_of_the_logarithm() -> None:
    u = math.log(1.5) / 0.25
    assert loss(1.5, 1.0) == pytest.approx(u**2 / (1.0 + u**2 / 9.0), rel=1e-12)
    assert loss(1.0 / 1.5, 1.0) == pytest.approx(loss(1.5, 1.0), rel=1e-12), (
        "too small costs as too large"
    )
    assert loss(2.0, 2.0) == 0.0


def test_no_cell_costs_more_than_the_knee_squared() -> None:
    for lost in (1e9, 1e-12, -1.0, math.nan, math.inf, 0.0):
        assert 8.98 < loss(lost, 1.0) <= 9.0
    assert loss(math.nan, 1.0, knee=2.0) == pytest.approx(4.0, rel=1e-5)


def test_negative_numbers_are_compared_along_their_sign() -> None:
    assert loss(-1.5, -1.0) == pytest.approx(loss(1.5, 1.0))
    assert loss(1.0, -1.0) == pytest.approx(9.0, rel=1e-5)


def test_rounding_of_the_measured_number_is_forgiven() -> None:
    assert loss(0.0104, 0.010, half=0.0005) == 0.0
    assert loss(0.0109, 0.010, half=0.0005) == pytest.approx(
        loss(0.0104, 0.010), rel=1e-9
    )
    assert slack_distance(np.array([[1.5]]), [cell(1.0, 0.2)])[0, 0] == pytest.approx(
        0.3
    )


@pytest.mark.parametrize(
    ("ours", "inside"), [(1.25, True), (1.2501, False), (0.75, True), (0.7499, False)]
)
def test_within_a_share_of_the_measured_number(ours: float, inside: bool) -> None:
    assert within(np.array([[ours]]), [cell(1.0)], 0.25)[0, 0] == inside
    assert within(np.array([[-ours]]), [cell(-1.0)], 0.25)[0, 0] == inside
    # half a unit of the last digit is taken off first
    assert (
        within(
            np.array([[ours + 0.05 * (1 if ours > 1 else -1)]]), [cell(1.0, 0.05)], 0.25
        )[0, 0]
        == inside
    )


def test_a_missing_number_is_within_nothing() -> None:
    assert not within(np.array([[math.nan]]), [cell(1.0)], 1e9)[0, 0]


def test_counts() -> None:
    cells = [cell(1.0), cell(2.0), cell(3.0), cell(4.0)]
    assert tally(np.array([1.04, 2.2, 3.7, math.nan]), cells) == {
        "cells": 4,
        "within_5%": 1,
        "within_10%": 2,
        "within_25%": 3,
    }
