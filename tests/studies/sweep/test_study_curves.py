"""Curves of metrics over varied numbers, their words and units, and studies in which
nothing is drawn.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from skyarm.studies.sweep import run_sweep
from skyarm.studies.sweep.banded_curves import FEWEST_OF_BAND, banded_curves
from skyarm.studies.sweep.manifest import read_manifest
from skyarm.studies.sweep.maps import robustness_maps
from skyarm.studies.sweep.stats import Rows, statistics
from skyarm.studies.sweep.sweep_figures import robustness_figure
from support.studies import MASS, WIND, read, small_study, write_manifest

pytest.importorskip("pyarrow")

GRID = {MASS: {"list": [0.7, 0.8, 0.9]}, WIND: {"grid": [0.0, 2.0, 5]}}


def flown(path: Path, **fields) -> Path:
    run_sweep(small_study(**fields), path)
    return path


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A grid of given numbers, without noise."""
    return flown(
        tmp_path_factory.mktemp("given"), design="grid", episodes=None, vary=GRID
    )


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flown(tmp_path_factory.mktemp("drawn"), episodes=120)


def of_path(rows: Rows, metric: str, path: str):
    return banded_curves(rows, metric, path).curves


def test_points_are_the_medians_of_their_cells(given: Path) -> None:
    rows = read(given)
    for path, values in ((MASS, [0.7, 0.8, 0.9]), (WIND, [0.0, 0.5, 1.0, 1.5, 2.0])):
        for curve in of_path(Rows(given), "ee_error_mean", path):
            np.testing.assert_allclose(curve.x, values, atol=1e-12)
            column = rows[curve.controller]
            for k, value in enumerate(values):
                inside = np.sort(
                    column["ee_error_mean"][np.isclose(column[path], value)]
                )
                assert inside.size == 15 // len(values)
                assert curve.middle[k] == np.median(inside)


def test_bands_of_drawn_numbers_hold_nine_of_ten(drawn: Path) -> None:
    rows = read(drawn)
    for curve in of_path(Rows(drawn), "position_error_mean", WIND):
        column = rows[curve.controller]
        order, cells = np.argsort(column[WIND], kind="stable"), len(curve.x)
        assert 0 < (column["status"] == "completed").sum() < 120, (
            "some crash, and are left out"
        )
        for k in range(cells):
            here = order[np.arange(120) * cells // 120 == k]
            inside = column["position_error_mean"][here][
                column["status"][here] == "completed"
            ]
            wanted = np.quantile(inside, [0.05, 0.5, 0.95])
            wanted[::2] = wanted[::2] if inside.size >= FEWEST_OF_BAND else np.nan
            np.testing.assert_allclose(
                [curve.low[k], curve.middle[k], curve.high[k]], wanted, rtol=1e-12
            )


def test_a_grid_of_given_numbers_without_noise_has_no_interval(given: Path) -> None:
    assert Rows(given).deterministic
    found = statistics(Rows(given))
    assert found["deterministic"] is True
    text = json.dumps(found)
    assert "interval" in text
    for part in json.loads(
        text, object_pairs_hook=lambda pairs: [list(pair) for pair in pairs]
    ):
        _no_interval(part)


def _no_interval(part) -> None:
    if isinstance(part, list):
        if len(part) == 2 and isinstance(part[0], str) and "interval" in part[0]:
            assert part[1] is None
        for each in part:
            _no_interval(each)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({}, "drawn masses"),
        (
            {
                "vary": {**GRID, "sensors.position": {"list": [0.0, 0.001]}},
                "design": "grid",
                "episodes": None,
            },
            "noise",
        ),
        (
            {
                "vary": {**GRID, MASS: {"uniform": [0.7, 0.9]}},
                "design": "grid",
                "episodes": 10,
            },
            "one is drawn",
        ),
        (
            {"vary": {MASS: {"list": [0.7, 0.9]}}, "episodes": 10},
            "values chosen at random",
        ),
    ],
)
def test_a_study_in_which_anything_is_drawn_keeps_its_intervals(
    tmp_path: Path, change, why: str
) -> None:
    rows = Rows(
        flown(tmp_path, duration=0.5, windows=None, controllers=["paper_pd"], **change)
    )
    assert not rows.deterministic, why
    assert statistics(rows)["controllers"]["paper_pd"]["success_interval"] is not None


def test_a_folder_that_does_not_say_keeps_them_too(given: Path, tmp_path: Path) -> None:
    path = flown(
        tmp_path, design="grid", episodes=None, vary=GRID, duration=0.5, windows=None
    )
    manifest = json.loads((path / "manifest.json").read_text())
    assert (manifest.pop("noise"), manifest.pop("units")) == (
        False,
        {MASS: "kg", WIND: "N"},
    )
    write_manifest(path, manifest)
    rows = Rows(path)
    assert not rows.deterministic
    assert rows.label(WIND) == "wind force x"
    held = read_manifest(given)
    assert held is not None
    assert held.noise is False


def test_axes_of_maps_have_words_and_units(given: Path) -> None:
    rows = Rows(given, {"position_error_mean": 0.2})
    first, *_ = robustness_maps(rows)
    figure = robustness_figure(first)
    assert figure.axes[0].get_xlabel() == "base mass (plant) [kg]"
    assert figure.axes[0].get_ylabel() == "wind force x [N]"


def test_a_map_with_one_share_everywhere_is_known_as_such(given: Path) -> None:
    assert [each.constant for each in robustness_maps(Rows(given, {}))] == [1.0, 1.0]
    assert [
        each.constant
        for each in robustness_maps(Rows(given, {"position_error_mean": 0.0}))
    ] == [0.0, 0.0]
    middle = float(np.median(read(given)["paper_pd"]["position_error_mean"]))
    assert (
        robustness_maps(Rows(given, {"position_error_mean": middle}))[1].constant
        is None
    )
