"""Statistics, maps and the page of a small sweep, counted again by hand."""

from __future__ import annotations

import dataclasses
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.studies.sweep import StudyError, run_sweep
from skyarm.studies.sweep.maps import (
    Axis,
    RobustnessMap,
    axis,
    robustness_maps,
    success_map,
)
from skyarm.studies.sweep.stats import Pictures, Rows, page, parse_limits, statistics
from skyarm.studies.sweep.sweep_figures import robustness_figure
from skyarm.view.figures.style import image_bytes
from support.studies import MASS, WIND, read, small_study

pytest.importorskip("pyarrow")

LIMITS = {"position_error_mean": 0.25}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sweep")
    run_sweep(small_study(episodes=120, success=LIMITS, title='<b>"mass"</b>'), path)
    return path


def test_success_is_flying_to_the_end_within_the_limits(folder: Path) -> None:
    found = statistics(Rows(folder))
    for controller, rows in read(folder).items():
        won = (rows["status"] == "completed") & (rows["position_error_mean"] <= 0.25)
        each = found["controllers"][controller]
        assert 0 < each["successes"] < each["status"]["completed"] < 120
        assert each["successes"] == won.sum()
        assert each["success_rate"] == pytest.approx(won.mean())
        assert each["success_interval"][0] < won.mean() < each["success_interval"][1]
        assert sum(each["status"].values()) == 120


def test_metrics_are_of_episodes_that_flew_to_their_end(folder: Path) -> None:
    found = statistics(Rows(folder))["controllers"]["paper_pd"]["metrics"][
        "peak_position"
    ]
    rows = read(folder)["paper_pd"]
    kept = rows["peak_position"][rows["status"] == "completed"]
    assert found["count"] == kept.size < 120
    assert found["mean"] == pytest.approx(kept.mean())
    for share, value in found["quantiles"].items():
        assert value == np.quantile(kept, float(share), method="inverted_cdf")
        if kept.size < 72 and share in ("0.05", "0.95"):  # 0.95^71 > 0.025
            assert found["intervals"][share] is None
            continue
        low, high = found["intervals"][share]
        assert kept.min() <= low <= value <= high <= kept.max()


def test_pairs_are_of_the_same_episode(folder: Path) -> None:
    found = statistics(Rows(folder))["paired"]["paper_ct - paper_pd"]
    rows = read(folder)
    ct, pd = rows["paper_ct"], rows["paper_pd"]
    both = (ct["status"] == "completed") & (pd["status"] == "completed")
    difference = (ct["joint_error_mean"] - pd["joint_error_mean"])[both]
    each = found["metrics"]["joint_error_mean"]
    assert each["count"] == both.sum()
    assert each["mean"] == pytest.approx(difference.mean())
    assert each["mean_interval"][0] <= difference.mean() <= each["mean_interval"][1]
    assert each["first_smaller"] == pytest.approx((difference < 0).mean())


def test_success_is_compared_episode_by_episode(folder: Path) -> None:
    rows = read(folder)
    ct, pd = rows["paper_ct"], rows["paper_pd"]
    limit = float(np.nanmedian(ct["joint_error_mean"][ct["status"] == "completed"]))
    found = statistics(Rows(folder, {"joint_error_mean": limit}))["paired"][
        "paper_ct - paper_pd"
    ]
    won = [
        (each["status"] == "completed") & (each["joint_error_mean"] <= limit)
        for each in (ct, pd)
    ]
    counts = {
        "both": won[0] & won[1],
        "only_first": won[0] & ~won[1],
        "only_second": ~won[0] & won[1],
    }
    assert all(found["success"][name] == at.sum() for name, at in counts.items())
    assert sum(found["success"].values()) == 120
    assert abs(won[0].sum() - won[1].sum()) > 5, "or a wrong sign would not show"
    assert found["success_difference"] == pytest.approx(won[0].mean() - won[1].mean())
    low, high = found["success_difference_interval"]
    assert low < found["success_difference"] < high


def test_statistics_are_the_same_again(folder: Path) -> None:
    assert statistics(Rows(folder)) == statistics(Rows(folder))


def test_limits_may_be_given_anew(folder: Path) -> None:
    rows = Rows(folder, {})
    assert rows.succeeded("paper_ct").sum() > Rows(folder).succeeded("paper_ct").sum()
    with pytest.raises(
        StudyError,
        match=(
            r"success\.speed: is no metric of these rows; there are position_error_mean"
        ),
    ):
        Rows(folder, {"speed": 1.0})
    assert parse_limits(["peak_pitch=0.5", "roll_rms = 1e-3"]) == {
        "peak_pitch": 0.5,
        "roll_rms": 1e-3,
    }
    for text in ("peak_pitch", "peak_pitch=", "peak_pitch=low", "peak_pitch=nan"):
        with pytest.raises(StudyError, match="must be METRIC=LARGEST"):
            parse_limits([text])


def test_a_folder_without_rows_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="must be one that 'skyarm sweep' wrote"):
        Rows(tmp_path)


def test_a_map_counts_every_episode_once() -> None:
    x = np.array([0.0, 0.1, 0.9, 1.0, 1.0, 0.5])
    y = np.array([5.0, 5.0, 6.0, 7.0, 5.1, 5.5])
    won = np.array([True, False, True, True, False, False])
    sides = (
        Axis(path="x", edges=np.array([0.0, 0.5, 1.0])),
        Axis(path="y", edges=np.array([5.0, 6.0, 7.0])),
    )
    found = success_map("c", *sides, x, y, won)
    # a value on an edge between cells belongs to the cell it begins, one on the last
    # edge to the last cell
    assert found.count.tolist() == [[2, 2], [0, 2]]
    assert found.rate[0].tolist() == [0.5, 0.0]
    assert np.isnan(found.rate[1, 0])
    assert found.rate[1, 1] == 1.0


def test_cells_surround_the_values_of_a_grid_and_share_the_range_of_draws() -> None:
    grid = axis("g", np.repeat([1.0, 2.0, 4.0], 10))
    assert grid.edges.tolist() == [0.5, 1.5, 3.0, 5.0]
    draws = axis("d", np.random.default_rng(0).uniform(2.0, 3.0, 10_000))
    assert len(draws.edges) == 21, "25 episodes a cell"
    assert draws.edges[[0, -1]] == pytest.approx([2.0, 3.0], abs=1e-3)
    ratios = axis("r", np.geomspace(0.1, 10.0, 5000), logarithmic=True)
    assert np.diff(np.log(ratios.edges)) == pytest.approx(
        np.log(100.0) / (len(ratios.edges) - 1)
    )
    assert ratios.centers == pytest.approx(
        np.sqrt(ratios.edges[1:] * ratios.edges[:-1])
    )


def test_maps_of_a_sweep_hold_all_its_episodes(folder: Path) -> None:
    for found in robustness_maps(Rows(folder)):
        rows = read(folder)[found.controller]
        assert (found.across.path, found.upward.path) == (MASS, WIND)
        assert found.count.sum() == 120
        won = (rows["status"] == "completed") & (rows["position_error_mean"] <= 0.25)
        assert np.nansum(found.rate * found.count) == pytest.approx(won.sum())
        light = rows[MASS] < found.across.edges[1]
        assert found.count[:, 0].sum() == light.sum()
    other, *_ = robustness_maps(Rows(folder), ("sensors.position", MASS))
    assert other.across.path == "sensors.position"
    with pytest.raises(StudyError, match="must be a varied number; there are"):
        robustness_maps(Rows(folder), (MASS, "plant.gravity"))
    with pytest.raises(StudyError, match="two different numbers"):
        robustness_maps(Rows(folder), (MASS, MASS))


def half_plane(rate: Any) -> RobustnessMap:
    values = np.asarray(rate, dtype=float)
    across = Axis(path="x", edges=np.arange(values.shape[1] + 1.0))
    upward = Axis(path="y", edges=np.arange(values.shape[0] + 1.0))
    return RobustnessMap(
        controller="c",
        across=across,
        upward=upward,
        rate=values,
        count=np.ones(values.shape, dtype=int),
    )


def test_the_boundary_lies_where_half_of_the_episodes_succeed() -> None:
    figure = robustness_figure(half_plane(np.tile([1.0, 1.0, 0.0, 0.0], (3, 1))))
    lines = [
        each
        for each in figure.axes[0].collections
        if each.get_label() == "half succeed"
    ]
    points = np.concatenate(
        [path.vertices for each in lines for path in each.get_paths()]
    )
    # cells 0 and 1 are centred on 0.5 and 1.5, cell 2 on 2.5: the line is between 1.5
    # and 2.5
    assert points[:, 0] == pytest.approx(2.0)


@pytest.mark.parametrize(
    "rate",
    [np.ones((3, 3)), np.zeros((3, 3)), [[1.0, 0.0]], [[np.nan, 1.0], [0.0, np.nan]]],
)
def test_a_map_without_a_boundary_is_drawn_without_one(rate: Any) -> None:
    assert image_bytes(robustness_figure(half_plane(rate)))[:4] == b"\x89PNG"


def test_a_map_of_ratios_has_logarithmic_axes() -> None:
    ratios = dataclasses.replace(
        half_plane(np.eye(3)),
        across=Axis(path="r", edges=np.geomspace(1, 8, 4), logarithmic=True),
    )
    axes = robustness_figure(ratios).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")


def test_a_map_of_an_earlier_report_does_not_stay_beside_one_without_it(
    tmp_path: Path,
) -> None:
    (tmp_path / "map_of_the_town.png").write_bytes(b"not ours")
    laws, names = ("a:b", "c"), ["map_a_b.png", "map_c.png"]
    both = Pictures(maps=dict.fromkeys(laws, b"png"))
    assert both.write(tmp_path, laws) == names
    one = Pictures(maps={"c": b"new"}, constant={"a:b": 1.0})
    assert one.write(tmp_path, laws) == names[1:]
    assert (tmp_path / names[1]).read_bytes() == b"new"
    assert Pictures().write(tmp_path, laws) == []
    assert [each.name for each in tmp_path.iterdir()] == ["map_of_the_town.png"]


class Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


def test_the_page_needs_nothing_else_and_escapes_what_a_file_says(folder: Path) -> None:
    rows = Rows(folder)
    images = {
        each.controller: image_bytes(robustness_figure(each), dpi=40)
        for each in robustness_maps(rows)
    }
    text = page(statistics(rows), rows.manifest, Pictures(maps=images))
    assert "http:" not in text
    assert "https:" not in text
    tags = Tags()
    tags.feed(text)
    sources = [held["src"] for tag, held in tags.found if "src" in held]
    assert len(sources) == 2
    assert all(str(source).startswith("data:image/png;base64,") for source in sources)
    assert not [
        tag
        for tag, held in tags.found
        if tag in ("script", "link", "iframe", "b") or "href" in held
    ]
    (policy,) = [
        held["content"]
        for _, held in tags.found
        if held.get("http-equiv") == "Content-Security-Policy"
    ]
    assert str(policy).startswith("default-src 'none'")
    assert "&lt;b&gt;&#34;mass&#34;&lt;/b&gt;" in text
    for word in (
        "paper_ct",
        "paper_pd",
        "position_error_mean",
        MASS,
        "ground",
        "mean position error [m] at most 0.25",
    ):
        assert word in text


def test_a_study_of_one_controller_and_no_survivor_still_makes_a_page(
    tmp_path: Path,
) -> None:
    run_sweep(
        small_study(
            controllers=["paper_ct"], vary={MASS: {"uniform": [8.0, 9.0]}}, episodes=8
        ),
        tmp_path,
    )
    rows = Rows(tmp_path)
    found = statistics(rows)
    assert found["controllers"]["paper_ct"]["metrics"]["roll_rms"] is None
    assert found["paired"] == {}
    assert robustness_maps(rows) == []
    assert "0.00%" in page(found, rows.manifest, Pictures())
