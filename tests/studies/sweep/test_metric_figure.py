"""Curves of a sweep's metrics: medians, bands and shares as NumPy counts them from the
rows, drawn as they are.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from skyarm.studies.sweep.banded_curves import (
    FEWEST_OF_BAND,
    PER_CELL,
    BandedCurve,
    BandedCurves,
    _curve,
    banded_curves,
    variable,
)
from skyarm.studies.sweep.stats import Rows
from skyarm.studies.sweep.sweep_figures import metric_figure, plot_sweep
from support.studies import MASS, WIND, flown, read

METRIC = "position_error_mean"
LOADS = "plant.payload.mass"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Flights of which heavy ones crash."""
    found: Path = tmp_path_factory.mktemp("sweep")
    vary = {
        MASS: {"uniform": [0.4, 6.0]},
        WIND: {"normal": [1.0, 0.5]},
        LOADS: {"list": [0.0, 0.05, 0.1]},
    }
    flown(
        found,
        vary=vary,
        episodes=120,
        chunk=64,
        duration=0.6,
        windows={"steady": [0.1, 0.6]},
    )
    return found


def of_episodes(
    columns: dict[str, np.ndarray], chosen: np.ndarray
) -> tuple[np.ndarray, int]:
    """The metric of those that were completed, and how many were lost."""
    done = columns["status"][chosen] == "completed"
    return columns[METRIC][chosen][done], int((~done).sum())


def test_a_curve_over_values_is_that_of_the_rows(folder: Path) -> None:
    columns = read(folder)
    found = banded_curves(Rows(folder), METRIC, LOADS)
    assert [curve.controller for curve in found.curves] == list(columns)
    lost_in_all = 0
    for curve in found.curves:
        rows = columns[curve.controller]
        np.testing.assert_array_equal(curve.x, [0.0, 0.05, 0.1])
        for i, x in enumerate(curve.x):
            kept, lost = of_episodes(rows, rows[LOADS] == x)
            assert curve.middle[i] == pytest.approx(np.median(kept), rel=1e-12)
            assert (curve.low[i], curve.high[i]) == pytest.approx(
                tuple(np.quantile(kept, (0.05, 0.95))), rel=1e-12
            )
            assert (curve.episodes[i], curve.lost[i]) == (kept.size + lost, lost)
            lost_in_all += lost
    assert lost_in_all > 0, (
        "some of these flights must be lost, or nothing is tested of them"
    )


def test_drawn_numbers_are_put_into_cells_of_equally_many(folder: Path) -> None:
    rows = read(folder)["paper_ct"]
    curve = banded_curves(Rows(folder), METRIC, MASS).curves[0]
    order = np.argsort(rows[MASS])
    cells = np.array_split(order, 120 // PER_CELL)
    assert curve.x.size == len(cells)
    for i, cell in enumerate(cells):
        kept, lost = of_episodes(rows, cell)
        assert curve.x[i] == pytest.approx(np.median(rows[MASS][cell]))
        assert curve.lost[i] == lost
        if kept.size:
            assert curve.middle[i] == pytest.approx(np.median(kept))
        assert np.isnan(curve.low[i]) == (kept.size < FEWEST_OF_BAND)
    assert np.isnan(curve.low).any(), "the heaviest crash"


def test_an_expression_is_a_variable(folder: Path) -> None:
    there, rows = Rows(folder), read(folder)["paper_pd"]
    whole = variable(there, f"all mass [kg] = {MASS} + {LOADS}", "over")
    assert whole.words == "all mass [kg]"
    np.testing.assert_array_equal(whole.values, rows[MASS] + rows[LOADS])
    plain = variable(there, f"sqrt({MASS} * {MASS})", "over")
    np.testing.assert_allclose(plain.values, rows[MASS], rtol=1e-15)
    assert plain.words == f"sqrt({MASS} * {MASS})"
    assert (
        variable(there, MASS, "over").words,
        variable(there, MASS, "over").unit,
    ) == ("base mass (plant)", "kg")


@pytest.mark.parametrize(
    ("count", "banded"),
    [(1, False), (FEWEST_OF_BAND - 1, False), (FEWEST_OF_BAND, True)],
)
def test_few_flights_have_a_middle_and_no_band(count: int, banded: bool) -> None:
    columns = {"m": np.arange(count) + 1.0, "status": np.array(["completed"] * count)}
    rows: Any = SimpleNamespace(of=lambda _law, name: columns[name])
    curve = _curve(rows, "m", "law", np.full(count, 3.0))
    cells = np.isfinite(curve.low)
    assert np.isfinite(curve.middle).all()
    assert cells.all() if banded else not cells.any()


def test_what_was_drawn_by_its_logarithm_has_such_an_axis(folder: Path) -> None:
    found = banded_curves(Rows(folder), METRIC, MASS)
    for logarithmic, scale in ((True, "log"), (False, "linear")):
        over = replace(found.over, logarithmic=logarithmic)
        assert metric_figure([replace(found, over=over)]).axes[-1].get_xscale() == scale


def lines(ax: Any) -> dict[str, Any]:
    return {
        line.get_label(): line
        for line in ax.get_lines()
        if not line.get_label().startswith("_")
    }


def test_the_picture_shows_the_curves_and_the_lost_ones(
    folder: Path, tmp_path: Path
) -> None:
    found = banded_curves(Rows(folder), METRIC, LOADS)
    figure = plot_sweep(
        folder, [METRIC, "ee_error_max"], LOADS, tmp_path / "curves.pdf"
    )
    assert (tmp_path / "curves.pdf").read_bytes().startswith(b"%PDF")
    metric, other, lost = figure.axes
    assert metric.get_ylabel() == "mean position error [m]"
    assert other.get_ylabel() == "largest tip error [m]"
    assert lost.get_ylabel() == "Lost"
    assert lost.get_xlabel() == "payload mass (plant) [kg]"
    for curve, band in zip(found.curves, metric.collections, strict=True):
        np.testing.assert_array_equal(
            lines(metric)[curve.controller].get_ydata(), curve.middle
        )
        shares = np.asarray(lines(lost)[curve.controller].get_ydata(), dtype=float)
        np.testing.assert_allclose(shares, curve.lost / curve.episodes)
        corners = band.get_paths()[0].vertices
        assert corners[:, 1].min() == curve.low.min()
        assert corners[:, 1].max() == curve.high.max()
    low, high = metric.get_ylim()
    assert low == 0.0
    assert high > max(curve.high.max() for curve in found.curves)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["paper_ct", "paper_pd", "median of completed, band 5 to 95 %"]


def _with(found: BandedCurves, curves: list[BandedCurve]) -> BandedCurves:
    return BandedCurves(
        metric=found.metric,
        over=found.over,
        curves=tuple(curves),
    )


def test_where_nothing_was_lost_no_panel_says_so(folder: Path) -> None:
    found = banded_curves(Rows(folder), METRIC, LOADS)
    whole = [
        BandedCurve(
            controller=c.controller,
            x=c.x,
            middle=c.middle - 1.0,
            low=c.low - 1.0,
            high=c.high - 1.0,
            episodes=c.episodes,
            lost=0 * c.lost,
        )
        for c in found.curves
    ]
    figure = metric_figure([_with(found, whole)])
    assert len(figure.axes) == 1
    assert figure.axes[0].get_ylim()[0] < min(c.low.min() for c in whole), (
        "values below zero are seen"
    )
    assert "median, band 5 to 95 %" in [
        text.get_text() for text in figure.legends[0].get_texts()
    ]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"metrics": "position_error_men"},
            "metric = 'position_error_men': must be one of these rows; did you mean",
        ),
        (
            {"over": "plant.payload.mas"},
            (
                "over = 'plant.payload.mas': at 1: 'plant.payload.mas' must be a named"
                " number"
            ),
        ),
        ({"over": f"x = {MASS} / 0"}, "must not divide by zero"),
        (
            {"over": f"sqrt({LOADS} - 1)"},
            "must take the root of a number of at least 0",
        ),
        ({"over": f"x = {MASS}.__class__"}, "must be a named number"),
        ({"over": "eval(1)"}, "over = 'eval(1)': at 1: 'eval' must not be called"),
        ({"metrics": []}, "metrics = 0: must be 1 to 6 in one picture"),
        (
            {"file": "curves.txt"},
            "file = 'curves.txt': suffix 'txt': must be one of png, svg, pdf",
        ),
    ],
)
def test_wrong_options_are_one_line(
    folder: Path, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        plot_sweep(folder, **{"metrics": METRIC, "over": LOADS, **options})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("middle", "scale"),
    [
        ([0.01, 0.1, 1.5], "log"),
        ([0.01, 0.1, 0.5], "linear"),
        ([0.0, 0.1, 1.5], "linear"),
        ([np.nan] * 3, "linear"),
    ],
)
def test_a_metric_that_spans_decades_has_a_logarithmic_axis(
    folder: Path, middle: list[float], scale: str
) -> None:
    found = banded_curves(Rows(folder), METRIC, LOADS)
    curves = tuple(replace(curve, middle=np.array(middle)) for curve in found.curves)
    assert metric_figure([replace(found, curves=curves)]).axes[0].get_yscale() == scale
