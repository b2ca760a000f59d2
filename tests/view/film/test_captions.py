"""Texts and plot of a film: the cursor stands at the frame's instant, numbers change, a
lost flight is called so.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.view.figures.error_strip import Curve, error_strip
from skyarm.view.film.captions import (
    INK,
    LOST,
    Box,
    Captions,
    FrameLayout,
    error_words,
    frame_layout,
    state_words,
)
from skyarm.view.film.filmed_flight import FilmedFlight, film_flights
from support.pictures import flight

TIMES = np.arange(10) * 0.1
MAGENTA = (255, 0, 255)
"""No colour of any text or curve."""

DRAWN = np.full((360, 640, 3), MAGENTA, np.uint8)


def made(title: str = "A title", **changed: object) -> tuple[Captions, FrameLayout]:
    first, second = film_flights([flight(), flight("centroidal_tip")], TIMES)
    flights: list[FilmedFlight] = [dataclasses.replace(first, **changed), second]  # type: ignore[arg-type]
    layout = frame_layout(640, 360, 2, "side", plot=True)
    return Captions(flights, TIMES, layout, title), layout


def inside(picture: np.ndarray, box: Box) -> np.ndarray:
    return picture[
        box.top : box.top + box.height, box.left : box.left + box.width
    ].astype(int)


def count(part: np.ndarray, color: tuple[int, ...]) -> int:
    return int((np.abs(part - np.array(color)).max(axis=2) < 40).sum())


def test_the_cursor_stands_at_the_frame_s_share_of_the_time_axis() -> None:
    captions, layout = made()
    assert layout.plot is not None
    parts = [inside(captions.frame(DRAWN, k), layout.plot) for k in (0, 5, 9)]
    columns = []
    for part in parts:
        dark = (np.abs(part - np.array(INK)).max(axis=2) < 12).sum(axis=0)
        columns.append(float(np.nonzero(dark > 0.9 * dark.max())[0].mean()))
    # the axis ends with the last frame, a tenth after it begins
    assert columns[1] - columns[0] == pytest.approx(
        5 / 9 * (columns[2] - columns[0]), abs=1.5
    )
    strip = error_strip(
        [Curve(TIMES, 0 * TIMES + 0.1, (0, 0, 0))],
        (0.0, 1.0),
        640,
        layout.plot.height,
        layout.scale,
    )
    assert columns[2] - columns[0] == pytest.approx(
        0.9 * (strip.right - strip.left), abs=1.5
    )
    assert columns[0] == pytest.approx(strip.left, abs=1.5)


def test_panels_are_taken_as_they_were_drawn_and_nothing_else_is() -> None:
    captions, layout = made()
    picture = captions.frame(DRAWN, 3)
    for panel in layout.panels:
        assert np.all(inside(picture, panel) == MAGENTA)
    assert np.all(picture == MAGENTA, axis=2).sum() == sum(
        panel.width * panel.height for panel in layout.panels
    )


def test_names_are_in_the_flights_colours_and_numbers_change() -> None:
    captions, layout = made()
    first, later = captions.frame(DRAWN, 0), captions.frame(DRAWN, 9)
    for head, each in zip(
        layout.heads,
        film_flights([flight(), flight("centroidal_tip")], TIMES),
        strict=True,
    ):
        color = tuple(round(255 * c) for c in each.color)
        assert count(inside(first, head), color) > 100
        assert np.any(inside(first, head) != inside(later, head))
        assert count(inside(later, head), LOST) == 0
    assert np.any(inside(first, layout.title) != inside(later, layout.title)), (
        "the clock"
    )


def test_a_long_title_is_written_smaller_beside_the_clock() -> None:
    words = (
        "A magnet picks a box of 100 g from a table, and another sets it down 0.4 m"
        " furthe"
    )
    seen = [
        inside(captions.frame(DRAWN, 0), layout.title)
        for captions, layout in (made(words + "r"), made(words + "t"))
    ]
    different = np.nonzero(np.any(seen[0] != seen[1], axis=(0, 2)))[0]
    assert different.size >= 2, "the last letter is seen"
    assert different.max() < seen[0].shape[1] - 150, "the clock's place at 360 lines"


def test_a_lost_flight_is_called_so_from_its_end_on() -> None:
    captions, layout = made(end=0.45, lost="joint limit", color=(0.0, 0.0, 1.0))
    before, after = (inside(captions.frame(DRAWN, k), layout.heads[0]) for k in (4, 5))
    assert count(before, LOST) == 0
    assert count(after, LOST) > 30


def test_a_whole_flight_that_is_shorter_than_the_film_is_said_to_have_ended() -> None:
    captions, layout = made(end=0.45)
    before, after, later = (
        inside(captions.frame(DRAWN, k), layout.heads[0]) for k in (4, 5, 9)
    )
    assert count(after, LOST) == 0
    assert np.any(before != after)
    np.testing.assert_array_equal(after, later)
    (flown,) = film_flights([flight()], TIMES)
    assert state_words(flown, 0.99, 9).startswith("tip error ")
    assert state_words(flown, 1.0, 9) == "ended at 1 s"


def test_the_wind_stands_beside_the_clock_where_it_is_that_of_all_flights() -> None:
    pictures = []
    layout = frame_layout(640, 360, 2, "side", plot=False)
    for scenarios in (
        ("case3_wind", "case3_wind"),
        ("case3", "case3_wind"),
        ("case3", "case3"),
    ):
        flights = film_flights(
            [flight(scenario=name) for name in scenarios], TIMES, ["a", "b"]
        )
        pictures.append(Captions(flights, TIMES, layout, "").frame(DRAWN, 5))
    ink = [
        [count(inside(each, box), INK) for box in (layout.title, *layout.heads)]
        for each in pictures
    ]
    same, apart, calm = ink
    assert same[0] > apart[0] == calm[0]


def test_a_text_of_several_lines_is_written_in_one() -> None:
    flights = film_flights([flight()], TIMES, ["two\nlines\x1b[31m"])
    layout = frame_layout(640, 360, 1, "side", plot=False)
    captions = Captions(flights, TIMES, layout, "a\ntitle\tof\x00three")
    assert count(inside(captions.frame(DRAWN, 0), layout.title), INK) > 100


def test_errors_are_said_in_millimetres_of_two_or_three_digits() -> None:
    said = [
        error_words(each)
        for each in (0.0, 1.2e-4, 9.94e-4, 9.96e-4, 0.0034, 0.02, 0.7404, 9.9994, 12.4)
    ]
    assert said == [
        "0.00 mm",
        "0.12 mm",
        "0.99 mm",
        "1.0 mm",
        "3.4 mm",
        "20 mm",
        "740 mm",
        "9999 mm",
        "12 m",
    ]


def test_the_plot_is_logarithmic_where_errors_are_far_apart_with_each_curve() -> None:
    time = np.linspace(0.0, 10.0, 4000)
    red, green = (1.0, 0.0, 0.0), (0.0, 0.6, 0.0)

    def height(error: float, *others: float) -> float:
        """Share of the axis at which a constant error is drawn, from the bottom."""
        curves = [
            Curve(time, 0 * time + error, red),
            *(Curve(time, 0 * time + other, green) for other in others),
        ]
        strip = error_strip(curves, (0.0, 10.0), 800, 200, 1.0)
        pixels = strip.pixels[strip.top : strip.bottom].astype(int)
        rows = np.nonzero((pixels[:, :, 0] > 200) & (pixels[:, :, 1] < 90))[0]
        assert rows.size > 500
        return float(1.0 - rows.mean() / (strip.bottom - strip.top))

    # on a straight axis from zero 0.1 m is half of 0.2 m
    assert height(0.1, 0.2) / height(0.2, 0.1) == pytest.approx(0.5, abs=0.04)
    # on a logarithmic one 0.1 m is halfway between 0.01 m and 1 m
    assert height(0.1, 0.01, 1.0) == pytest.approx(0.5, abs=0.04)


def test_the_cursor_is_in_the_middle_of_the_axis_in_the_second_of_two_frames() -> None:
    """Each frame is shown as long as the other: the axis ends a frame after the last
    one begins.
    """
    times = TIMES[[0, 5]]
    layout = frame_layout(640, 360, 1, "side", plot=True)
    captions = Captions(film_flights([flight()], times), times, layout, "A title")
    assert layout.plot is not None
    ink = [
        (
            np.abs(inside(captions.frame(DRAWN, k), layout.plot) - INK).max(axis=2) < 12
        ).sum(axis=0)
        for k in (0, 1)
    ]
    first, second = (
        float(np.nonzero(column > 0.9 * column.max())[0].mean()) for column in ink
    )
    strip = error_strip(
        [Curve(times, 0 * times + 0.1, (0, 0, 0))],
        (0.0, 1.0),
        640,
        layout.plot.height,
        layout.scale,
    )
    assert second - first == pytest.approx(0.5 * (strip.right - strip.left), abs=1.5)


@pytest.mark.parametrize("scale", [0.5, 1.0])
def test_below_the_axis_of_the_plot_there_is_room_for_its_numbers_and_its_name(
    scale: float,
) -> None:
    height = round(200 * scale)
    strip = error_strip(
        [Curve(TIMES, 0 * TIMES + 0.1, (0, 0, 0))], (0.0, 1.0), 640, height, scale
    )
    # two lines of 12.5 points at 100 pixels an inch
    assert height - strip.bottom > 2 * 12.5 * scale / 72.0 * 100.0
    assert (strip.pixels[-1] > 200).all()


def plotted(*wanted: bool) -> list[tuple[float, ...]]:
    """Colours of the curves in the plot of two flights, by whether each has a desired
    and a measured force.
    """
    flights = film_flights([flight(), flight("centroidal_tip")], TIMES)
    force = np.linspace(0.0, 3.0, len(flights[0].error_time))
    with_force = [
        (
            dataclasses.replace(each, wanted_curve=force, contact_curve=force)
            if has
            else each
        )
        for each, has in zip(flights, wanted, strict=True)
    ]
    layout = frame_layout(640, 360, 2, "side", plot=True)
    captions = Captions(with_force, TIMES, layout, "A title")
    assert layout.plot is not None
    part = inside(captions.frame(DRAWN, 3), layout.plot)
    return [tuple(part.reshape(-1, 3).mean(axis=0))]


def test_the_plot_shows_forces_where_all_flights_have_them_and_errors_else() -> None:
    errors = plotted(False, False)
    assert plotted(True, False) == errors
    assert plotted(True, True) != errors


def test_the_axis_of_a_film_of_one_frame_is_a_second_that_begins_with_it() -> None:
    begin, change = 5.0, 5.25
    (filmed,) = film_flights([flight()], np.zeros(1))
    time = np.linspace(begin, begin + 1.0, 401)
    one = dataclasses.replace(
        filmed,
        error_time=time,
        error_curve=np.where(time < change, 0.1, 0.9),
        color=(1.0, 0.0, 0.0),
        end=10.0,
    )
    layout = frame_layout(640, 360, 1, "side", plot=True)
    assert layout.plot is not None
    captions = Captions([one], np.array([begin]), layout, "A title")
    part = inside(captions.frame(DRAWN, 0), layout.plot)
    red = (part[:, :, 0] > 200) & (part[:, :, 1] < 90)
    # the jump is where the curve has most pixels above one another
    step = int(red.sum(axis=0).argmax())
    strip = error_strip(
        [Curve(time, one.error_curve, one.color)],
        (0.0, 1.0),
        640,
        layout.plot.height,
        layout.scale,
    )
    share = (step - strip.left) / (strip.right - strip.left)
    assert share == pytest.approx(change - begin, abs=0.02)
