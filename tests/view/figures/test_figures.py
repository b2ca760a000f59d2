"""Figures: what they draw, read back from their artists; synthetic logs whose curves
are known numbers.
"""

from __future__ import annotations

import dataclasses
import itertools
import threading

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

import skyarm
from skyarm.view.figures.flight_facts import end_time, gust_interval
from skyarm.view.figures.paper_figures import (
    PAPER_CATALOGUE,
    POSITION_ERROR,
    TOOL_ERROR,
    by_hold,
    joint_error_size,
    paper_figures,
)
from skyarm.view.figures.style import PAPER, image_bytes, limits
from support.flights import document
from support.logs import WINDOWS, all_logs, synthetic_log

PANELS = {
    3: 2,
    4: 4,
    5: 1,
    6: 2,
    7: 4,
    8: 2,
    9: 1,
    10: 3,
    11: 2,
    12: 3,
    13: 3,
    14: 3,
    15: 3,
    16: 1,
    17: 2,
    18: 1,
}
"""Counted in the paper's captions."""
WITH_REFERENCE = {4: (2, 3), 13: (0, 1, 2)}
"""Panels, counted from the top, that show desired and actual."""


@pytest.fixture(scope="module")
def drawn() -> dict[int, Figure]:
    return paper_figures(all_logs()["rigid_body"], WINDOWS)


def luminance(color: str) -> float:
    """Relative luminance of a hex colour; Source: WCAG 2.2, relative luminance."""
    channels = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a: str, b: str) -> float:
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


def lines_of(ax: object) -> dict[str, object]:
    return {
        line.get_label(): line
        for line in ax.get_lines()
        if not line.get_label().startswith("_")
    }


def test_every_figure_of_the_paper_is_drawn_with_its_panels(
    drawn: dict[int, Figure],
) -> None:
    assert {number: len(figure.axes) for number, figure in drawn.items()} == PANELS


@pytest.mark.parametrize("number", sorted(PANELS))
def test_every_panel_overlays_both_controllers_and_the_reference_where_there_is_one(
    number: int, drawn: dict[int, Figure]
) -> None:
    for i, ax in enumerate(drawn[number].axes):
        expected = (
            {"CT", "PD", "desired"}
            if i in WITH_REFERENCE.get(number, ())
            else {"CT", "PD"}
        )
        assert set(lines_of(ax)) == expected


@pytest.mark.parametrize("number", sorted(PANELS))
def test_titles_name_the_number_and_labels_name_si_units(
    number: int, drawn: dict[int, Figure]
) -> None:
    figure = drawn[number]
    assert figure.get_suptitle().startswith(f"Figure {number}. ")
    assert all(ax.get_ylabel().endswith(("[m]", "[rad]")) for ax in figure.axes)
    assert figure.axes[-1].get_xlabel() == "Time [s]"
    entries = [entry.get_text() for entry in figure.legends[0].get_texts()]
    assert entries[:2] == ["CT", "PD"]
    assert ("gust" in entries) == (number in (9, 10, 11))


@pytest.mark.parametrize("number", [4, 7, 12, 14])
def test_figures_of_two_parts_carry_the_letters(
    number: int, drawn: dict[int, Figure]
) -> None:
    letters = [t.get_text() for ax in drawn[number].axes for t in ax.texts]
    assert letters == ["(a)", "(b)"]


def test_curves_are_the_known_errors(drawn: dict[int, Figure]) -> None:
    """The synthetic logs are off by constants: 0.03 m in x, 0.04 m in z, 0.02 rad in
    joint 1; exact up to rounding.
    """

    def level(number: int, panel: int, label: str) -> float:
        values = lines_of(drawn[number].axes[panel])[label].get_ydata()
        assert np.ptp(values) < 1e-12
        return float(values[0])

    assert level(5, 0, "CT") == pytest.approx(0.05, abs=1e-12)
    assert level(7, 1, "CT") == pytest.approx(0.03, abs=1e-12)
    assert level(7, 2, "CT") == pytest.approx(0.0, abs=1e-12)
    assert level(7, 3, "CT") == pytest.approx(-0.04, abs=1e-12)
    assert level(4, 0, "CT") == pytest.approx(-0.02, abs=1e-12)
    assert level(4, 0, "PD") == pytest.approx(-0.04, abs=1e-12)
    assert level(14, 0, "PD") == pytest.approx(0.04, abs=1e-12)
    assert level(15, 1, "CT") == pytest.approx(0.01, abs=1e-12)
    assert level(18, 0, "CT") == pytest.approx(0.01, abs=1e-12)
    assert level(3, 0, "CT") == pytest.approx(0.05, abs=1e-12)
    assert level(9, 0, "CT") == pytest.approx(0.10, abs=1e-12)


def test_roll_and_pitch_share_their_limits(drawn: dict[int, Figure]) -> None:
    for number in (3, 6, 17):
        roll, pitch = drawn[number].axes
        assert roll.get_ylim() == pitch.get_ylim()


def test_magnitudes_begin_at_zero(drawn: dict[int, Figure]) -> None:
    for number, panel in ((5, 0), (7, 0), (12, 0), (14, 0), (14, 2), (16, 0), (18, 0)):
        assert drawn[number].axes[panel].get_ylim()[0] == 0.0


def test_the_window_of_the_metrics_and_the_gust_are_shaded(
    drawn: dict[int, Figure],
) -> None:
    def spans(number: int) -> list[tuple[float, float]]:
        # a rectangle or, in older versions of Matplotlib, a polygon
        boxes = [
            p.get_path().get_extents(p.get_patch_transform())
            for p in drawn[number].axes[0].patches
        ]
        return [(box.x0, box.x1) for box in boxes]

    assert spans(6) == [(10.0, 20.0)]
    assert spans(16) == [(10.0, 20.0)]
    window, gust = spans(10)
    assert window == (5.0, 20.0)
    assert gust == pytest.approx((7.5, 10.5), abs=1e-9)


def test_controllers_differ_in_dash_and_in_lightness() -> None:
    """Grey print: dash alone tells them apart, and so does lightness; 3 is the usual
    minimum for graphics.
    """
    (ct, pd, *others), reference = PAPER.looks, PAPER.desired
    assert len({ct.dash, pd.dash, reference.dash}) == 3
    assert ct.dash == ()
    assert contrast(ct.color, pd.color) >= 3.0
    assert contrast(pd.color, "#ffffff") >= 2.9
    assert len({look.dash for look in others}) == len(others)


def test_drawn_lines_keep_their_looks(drawn: dict[int, Figure]) -> None:
    lines = lines_of(drawn[13].axes[0])
    assert [lines[name].get_color() for name in ("CT", "PD", "desired")] == [
        look.color for look in (*PAPER.looks[:2], PAPER.desired)
    ]
    assert [lines[name].is_dashed() for name in ("CT", "PD", "desired")] == [
        False,
        True,
        True,
    ]


@pytest.mark.thorough
def test_nothing_of_a_figure_lies_outside_its_canvas(drawn: dict[int, Figure]) -> None:
    for figure in drawn.values():
        figure.canvas.draw()
        renderer = figure.canvas.get_renderer()
        width, height = figure.get_size_inches() * figure.dpi
        boxes = [ax.get_tightbbox(renderer) for ax in figure.axes] + [
            figure.legends[0].get_window_extent(renderer)
        ]
        for box in boxes:
            assert -1.0 <= box.x0 <= box.x1 <= width + 1.0
            assert -1.0 <= box.y0 <= box.y1 <= height + 1.0
        for upper, lower in itertools.pairwise(boxes):
            assert lower.y1 <= upper.y0 + 1.0


def test_drawing_changes_nothing_global() -> None:
    before = dict(mpl.rcParams)
    figures = paper_figures({"case1": all_logs()["rigid_body"]["case1"]}, WINDOWS)
    assert sorted(figures) == [3, 4, 5]
    assert dict(mpl.rcParams) == before


def test_threads_draw_the_same_pixels() -> None:
    logs = {"case1": all_logs()["rigid_body"]["case1"]}
    found: list[bytes] = []

    def work() -> None:
        found.append(image_bytes(paper_figures(logs, WINDOWS)[5], dpi=60))

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 2
    assert len(set(found)) == 1
    assert found[0][:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize("kind", ["svg", "pdf"])
def test_two_pictures_of_one_flight_are_the_same_file(kind: str) -> None:
    logs = {"case1": all_logs()["rigid_body"]["case1"]}
    before = mpl.rcParams["svg.hashsalt"]
    one, other = (image_bytes(paper_figures(logs, WINDOWS)[5], kind) for _ in range(2))
    assert one == other
    assert b"<dc:date>" not in one
    assert mpl.rcParams["svg.hashsalt"] == before


def test_a_diverged_episode_is_named_and_does_not_flatten_the_other() -> None:
    good = synthetic_log("case1", "rigid_body", "CT")
    wild = synthetic_log("case1", "rigid_body", "PD", seconds=12.0)
    position = wild.position.copy()
    position[-1] = [1e9, np.nan, np.inf]
    wild = dataclasses.replace(
        wild, position=position, info={**wild.info, "status": "diverged"}
    )
    figure = paper_figures({"case1": {"CT": good, "PD": wild}}, WINDOWS)[5]
    assert "PD (diverged)" in [
        entry.get_text() for entry in figure.legends[0].get_texts()
    ]
    assert figure.axes[0].get_ylim()[1] < 6.0
    assert figure.axes[0].get_xlim() == pytest.approx((0.0, 30.0), abs=1e-9)
    assert image_bytes(figure, dpi=50)


def test_an_episode_that_ended_at_once_is_drawn() -> None:
    empty = synthetic_log("case3", "rigid_body", "PD", seconds=0.0)
    assert empty.time.size == 0
    figures = paper_figures(
        {"case3": {"CT": synthetic_log("case3", "rigid_body", "CT"), "PD": empty}}, {}
    )
    assert sorted(figures) == [12, 13, 14, 15]


def test_by_hold_gives_the_mean_of_four_control_instants() -> None:
    log = synthetic_log("case1", "rigid_body", "CT", seconds=0.045)
    values = np.arange(9.0)
    time, mean = by_hold(log, values)
    assert mean.tolist() == [1.5, 5.5, 8.0]
    assert time == pytest.approx([0.0075, 0.0275, 0.04], abs=1e-12)
    assert end_time(log) == 0.045


def test_a_constant_wind_is_no_gust() -> None:
    assert gust_interval(synthetic_log("case3_wind", "rigid_body", "CT")) is None
    assert gust_interval(synthetic_log("case1", "rigid_body", "CT")) is None


def test_gusts_of_moving_air_are_shaded_from_the_first_to_the_last() -> None:
    gusts = [
        {"velocity": [2.0, 0.0, 0.0], "start": start, "duration": 0.1}
        for start in (0.1, 0.25)
    ]
    air = {"mode": "moving_air", "velocity": [1.0, 0.0, 0.0]}
    blown = [
        document("case1", duration=0.5, environment={"wind": {**air, **more}})
        for more in ({}, {"gust": gusts})
    ]
    constant, gusty = (skyarm.run(skyarm.scenario_from(each)) for each in blown)
    assert constant.wind_force[:, 0].all()
    assert gust_interval(constant) is None
    assert gust_interval(gusty) == pytest.approx((0.1, 0.35))


def test_quantities_are_errors_against_the_held_reference() -> None:
    log = synthetic_log("case3", "rigid_body", "CT")
    moved = dataclasses.replace(log, position_reference=log.position_reference + 7.0)
    assert POSITION_ERROR.of(moved) == pytest.approx(
        np.full(log.time.size, 0.05), abs=1e-12
    )
    assert TOOL_ERROR.of(log) == pytest.approx(np.full(log.time.size, 0.01), abs=1e-12)
    assert joint_error_size(0).of(log) == pytest.approx(
        np.full(log.time.size, 0.02), abs=1e-12
    )


def test_limits_keep_a_smallest_span_and_ignore_what_is_not_finite() -> None:
    low, high = limits(
        [np.array([1e-9, np.nan, np.inf])], floor=False, span=0.02, cap=5.0
    )
    assert high - low >= 0.02
    assert limits([], floor=True, span=0.02, cap=5.0) == pytest.approx((0.0, 0.02))
    assert limits(
        [np.array([1e6, -1e6])], floor=False, span=0.02, cap=5.0
    ) == pytest.approx((-5.7, 5.7))


def test_catalogue_names_only_the_papers_experiments() -> None:
    assert {spec.case for spec in PAPER_CATALOGUE.values()} == set(WINDOWS)
    assert sorted(PAPER_CATALOGUE) == list(range(3, 19))
