"""What an envelope says of its numbers: where a law is good, where it is lost; its
tables.
"""

from __future__ import annotations

import numpy as np

from skyarm.studies.compare.cell_flights import Cell
from skyarm.studies.compare.envelope import (
    JUDGED,
    axis_rows,
    cell_text,
    command_rows,
    command_text,
    envelope_report,
    lost_at,
    points_of,
    summary_rows,
    summary_section,
    within,
)
from skyarm.studies.compare.envelope_axes import AXES, OUTSIDE, OVERSHOOT, TIP, TIP_MAX
from support.studies import AXES_FLOWN, LOST, plants, point


def test_a_law_is_good_up_to_the_first_value_where_it_is_not():
    points = [point(0.001), point(0.009), point(0.011), point(0.002)]
    assert within(points, 0.010) == 2
    assert within([LOST, point(0.001)], 0.010) == 0
    assert lost_at([point(0.1), LOST, point(0.1), LOST]) == [1, 3]


def test_lost_is_what_ended_early_or_tilted_over_or_was_far_away_or_has_no_number():
    found = {
        TIP: np.array([0.01, 0.01, 0.01, np.nan, 0.4, 0.4]),
        TIP_MAX: np.array([0.02, 0.02, 0.02, np.nan, 0.6, 0.6]),
        OUTSIDE: np.array([0.0, 2.5, 0.0, np.nan, 9.0, 9.0]),
        "tilt_max": np.radians([79.9, 80.1, 5.0, 5.0, 5.0, 5.0]),
        "rotor_jitter": np.array([1.0, 2.0, 3.0, np.nan, 5.0, 6.0]),
        "rotor_saturation": np.array([0.0, 0.1, 0.2, np.nan, 0.4, 0.5]),
        "ee_error_last_mean_continuous": np.array(
            [0.01, 0.01, 0.01, np.nan, 0.5, 0.501]
        ),
    }
    cell = Cell(
        found, np.array(["completed", "completed", "ground", *["completed"] * 3])
    )
    points = points_of(cell, AXES["circle"])
    assert [each["lost"] for each in points] == [False, True, True, True, False, True]
    assert [each["tip_mean"] for each in points] == [0.01, 0.01, 0.01, None, 0.4, 0.4]
    assert [each["jitter"] for each in points] == [1.0, 2.0, 3.0, None, 5.0, 6.0]
    assert [each["limited"] for each in points] == [0.0, 0.1, 0.2, None, 0.4, 0.5]
    overshoot = Cell({**found, OVERSHOOT: np.array([0.3] * 6)}, cell.status)
    assert [each["judged"] for each in points_of(overshoot, AXES["step"])] == [0.3] * 6


def envelope():
    """A whole record."""
    laws = ["paper_ct", "l1_adaptive", "centroidal_tip"]
    return {
        "schema": 1,
        "vehicle": "<v>",
        "seed": 3,
        "plant": "rigid_body",
        "quick": False,
        "laws": laws,
        "not_flown": {"indi": "does not <fit>"},
        "axes": AXES_FLOWN,
    }


def test_tables_hold_mean_and_largest_error_and_how_far_each_law_is_good():
    assert axis_rows(AXES_FLOWN["circle"])[1] == [
        "l1_adaptive",
        "20.0 / 40.0",
        "lost",
        "lost",
    ]
    assert cell_text(point(0.3), JUDGED[OVERSHOOT]) == "300; 1.50 s"
    assert cell_text(LOST, JUDGED[OVERSHOOT]) == "lost"
    assert summary_rows(AXES_FLOWN, ["paper_ct", "centroidal_tip", "nmpc"]) == [
        ["circle, 1 to 3 m/s", "- / 2; 40, 25 %", "1 / 2; 50, 25 %", "-"],
        [
            "turning wind, 20 to 5 s",
            "- / -, lost at 5; 70, 25 %",
            "20 / 20, lost at 5; 0.9",
            "-",
        ],
    ]
    assert command_rows(AXES_FLOWN["circle"])[1:] == [
        ["l1_adaptive", "2.00; 0.00 %", "lost", "lost"],
        ["centroidal_tip", "0.10; 0.00 %", "9.50; 0.00 %", "50.0; 25.0 %"],
    ]
    written = envelope_report(envelope()).markdown()
    for words in (
        "| l1_adaptive | 20.0 / 40.0 | lost | lost |",
        "| l1_adaptive | 2.00; 0.00 % | lost |",
        "indi does not fly: does not <fit>",
    ):
        assert words in written


def test_the_page_holds_every_number_and_lets_no_name_through_unescaped():
    whole = envelope_report(envelope(), b"picture").html()
    for words in ("20.0 / 40.0", "&lt;v&gt;"):
        assert words in whole
    assert "<v>" not in whole
    assert "<fit>" not in whole
    assert "http" not in whole.replace("http-equiv", ""), "it needs no other file"
    assert "1 / 2; 50, 25 %" in summary_section(envelope()).html()


def test_a_value_of_wrong_plants_counts_by_the_worst_that_flies_and_is_lost_with_one():
    both = plants(
        point(0.004, largest=0.0201),
        point(0.002, largest=0.0199),
        point(0.009, largest=0.019),
    )
    assert (both["judged"], both["tip_mean"], both["tip_max"], both["lost"]) == (
        0.009,
        0.004,
        0.0201,
        False,
    )
    assert [both["plants"][key] for key in ("of", "held", "lost")] == [3, 2, 0]
    assert cell_text(both, "") == "2 of 3; 4.00 / 20.1"
    assert command_text(both) == "0.90; 0.00 %", "the largest of the plants"
    one = plants(point(0.004), LOST, point(0.03))
    assert (one["judged"], one["lost"], one["status"]) == (0.03, True, "ground")
    assert cell_text(one, "") == "1 of 3; 1 lost; 17.0 / 60.0"
    none = plants(LOST, LOST)
    assert (none["judged"], none["tip_mean"], none["lost"]) == (None, None, True)
    assert cell_text(none, "") == "0 of 2; 2 lost"
    assert (command_text(one), command_text(none)) == ("3.00; 0.00 %", "lost")


def test_lanes_are_grouped_value_by_value():
    columns = {
        TIP: np.arange(6) * 1e-3,
        TIP_MAX: np.arange(6) * 1e-2,
        OUTSIDE: np.zeros(6),
        "tilt_max": np.zeros(6),
    }
    columns |= dict.fromkeys(
        ("ee_error_last_mean_continuous", "rotor_jitter", "rotor_saturation"),
        np.zeros(6),
    )
    found = points_of(
        Cell(columns, np.array(["completed"] * 6)), AXES["wrong_plants"], 2
    )
    assert [each["judged"] for each in found] == [2e-3, 5e-3]
    assert [each["plants"]["held"] for each in found] == [3, 0]
