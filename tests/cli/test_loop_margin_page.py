"""The page of margins: its curves keep out of their disks and touch them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.studies.stability.disk_margins import LoopMargin
from skyarm.studies.stability.flight_margins import Evidence, Locus, hover_loci, margins
from skyarm.studies.stability.margins_report import loop_rows, margins_page
from skyarm.studies.stability.nyquist_figure import nyquist_figure
from skyarm.view.figures.style import image_bytes


@pytest.fixture(scope="module")
def drawn() -> tuple[Evidence, list[Locus]]:
    scenario = skyarm.load_scenario("case3", controller="paper_ct")
    return margins(scenario, 0), hover_loci(scenario)


def test_a_curve_touches_the_disk_of_its_margin_and_stays_out_of_it(
    drawn: tuple[Evidence, list[Locus]],
) -> None:
    groups = [locus.margin.group for locus in drawn[1]]
    assert len(set(groups)) == len(groups) >= 8
    for locus in drawn[1]:
        low, high = locus.margin.gain
        left, right = -1.0 / low, -1.0 / high
        away = np.abs(locus.L - 0.5 * (left + right)) / (0.5 * (right - left))
        # the most delicate frequency is found to a share of the distance between two of
        # the grid
        assert away.min() == pytest.approx(1.0, abs=2e-3), locus.margin.name


def test_a_diagram_is_of_the_worse_of_both_lags_as_its_row_is(
    drawn: tuple[Evidence, list[Locus]],
) -> None:
    found, loci = drawn
    (hover,) = found.instants
    for locus in loci:
        rows = {
            lag: min(
                each.disk for each in margins.loops if each.group == locus.margin.group
            )
            for lag, margins in hover.by_lag.items()
        }
        # the curve is drawn at more frequencies than the margin was searched at
        assert locus.margin.disk == pytest.approx(min(rows.values()), rel=1e-3), rows


def test_the_delay_of_a_row_is_the_least_wherever_the_disk_is() -> None:
    def instant(disk: float, delay: float, other: float) -> Any:
        loops = [
            LoopMargin(
                name=name,
                group="thrust",
                port="commands",
                disk=disk + more,
                frequency=9.0,
                delay=each,
            )
            for name, more, each in (("one", 0.0, delay), ("two", 0.1, other))
        ]
        return SimpleNamespace(by_lag={"up": SimpleNamespace(loops=loops, together=[])})

    instants = (instant(0.5, 0.020, 0.040), instant(0.9, 0.004, 0.003))
    found: Any = SimpleNamespace(instants=instants)
    assert [row[5] for row in loop_rows(found, every=True)] == ["delay", "4.0", "3.0"]
    assert [(row[0], row[1], row[5]) for row in loop_rows(found, every=False)[1:]] == [
        ("one", "0.50", "3.0")
    ]


def test_each_loop_has_a_diagram_with_its_disk_and_a_row(
    drawn: tuple[Evidence, list[Locus]],
) -> None:
    found, loci = drawn
    figure = nyquist_figure(loci)
    titles = [ax.get_title() for ax in figure.axes if ax.axison]
    assert titles == [
        f"{e.margin.name}: {e.margin.disk:.2f} at {e.margin.frequency:.3g} rad/s"
        for e in loci
    ]
    assert all(len(ax.patches) == 1 for ax in figure.axes if ax.axison)
    text = margins_page(found, loci, image_bytes(figure, dpi=150))
    for each in found.instants[0].by_lag["up"].loops:
        assert f">{each.name}<" in text
    assert text.count("<img") == 1


def test_a_hover_that_is_lost_leaves_a_page_that_says_so() -> None:
    none = Evidence(controller="law", scenario="case", instants=(), completed=False)
    assert "the loop is lost in hover" in margins_page(none, [])
