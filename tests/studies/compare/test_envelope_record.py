"""What an envelope says of its numbers: where a law is good, where it is lost, what violates the rules; its tables."""

from __future__ import annotations

import numpy as np

from skyarm.studies.compare.cells import Cell
from skyarm.studies.compare.envelope_axes import AXES, OUTSIDE, OVERSHOOT, TIP, TIP_MAX
from skyarm.studies.compare.envelope_report import (
    JUDGED,
    axis_rows,
    cell_text,
    envelope_report,
    lost_at,
    point_of_plants,
    points_of,
    sentence,
    summary_rows,
    summary_section,
    violation_rows,
    violations,
    within,
)


def point(error, *, lost=False, judged=None, largest=None):
    """A flight with a mean error in m."""
    status = "ground" if lost else "completed"
    numbers = {
        "judged": judged or error,
        "tip_mean": error,
        "tip_max": largest or 2.0 * error,
        "outside": 1.5,
        "tilt": 0.1,
    }
    return {**numbers, "status": status, "lost": lost}


def axis(values, unit="m/s", **laws):
    """An axis with points of laws."""
    facts = {"title": "a trial", "noisy": False, "judged": "tip, mean / largest", "window_s": [4.0, 20.0]}
    return {**facts, "values": list(values), "unit": unit, "laws": laws}


LOST = point(2.0, lost=True)

AXES_FLOWN = {
    "circle": axis(
        (1.0, 2.0, 3.0),
        paper_ct=[point(0.05), point(0.09), point(0.4)],
        l1_adaptive=[point(0.02), LOST, LOST],
        centroidal_tip=[point(0.001), point(0.095), point(0.5)],
    ),
    "turning_wind": axis(
        (20.0, 5.0),
        "s",
        paper_ct=[point(0.7), LOST],
        l1_adaptive=[point(0.7), point(0.6)],
        centroidal_tip=[point(0.009), LOST],
    ),
}


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
        "ee_error_last_mean_continuous": np.array([0.01, 0.01, 0.01, np.nan, 0.5, 0.501]),
    }
    cell = Cell(found, np.array(["completed", "completed", "ground", *["completed"] * 3]))
    points = points_of(cell, AXES["circle"])
    assert [each["lost"] for each in points] == [False, True, True, True, False, True]
    assert [each["tip_mean"] for each in points] == [0.01, 0.01, 0.01, None, 0.4, 0.4]
    overshoot = Cell({**found, OVERSHOOT: np.array([0.3] * 6)}, cell.status)
    assert [each["judged"] for each in points_of(overshoot, AXES["step"])] == [0.3] * 6


def test_violations_are_a_loss_that_another_law_survives_and_ten_per_cent_over_the_paper():
    found = violations(AXES_FLOWN)
    assert [(each["axis"], each["value"], each["rule"]) for each in found] == [
        ("circle", 3.0, "worse"),
        ("turning_wind", 5.0, "lost"),
    ]
    assert (found[0]["own"], found[0]["other"], found[0]["kept_by"]) == (0.5, 0.4, ["paper_ct"])
    assert found[1]["kept_by"] == ["l1_adaptive"]
    assert violation_rows(found) == [
        ["circle 3 m/s", "worse than paper_ct", "500", "400"],
        ["turning wind 5 s", "lost; not lost: l1_adaptive", "-", "-"],
    ]


def test_what_every_law_loses_and_what_is_nine_per_cent_worse_is_no_violation():
    both = {"circle": axis((1.0, 2.0), paper_ct=[LOST, point(0.1)], centroidal_tip=[LOST, point(0.109)])}
    assert violations(both) == []
    alone = {"circle": axis((1.0,), centroidal_tip=[LOST])}
    assert violations(alone) == []
    # the paper's law is lost: nothing to be worse than
    assert violations({"circle": axis((1.0,), paper_ct=[LOST], centroidal_tip=[point(0.9)])}) == []


def test_on_another_vehicle_the_tuned_form_of_the_paper_s_law_is_the_measure():
    found = violations(
        {"circle": axis((1.0,), hybrid_computed_torque_tuned=[point(0.1)], centroidal_tip=[point(0.12)])}
    )
    assert found[0]["kept_by"] == ["hybrid_computed_torque_tuned"]


def test_the_sentence_of_a_law_says_how_far_and_where_lost():
    assert sentence("centroidal_tip", AXES_FLOWN) == (
        "within 10 mm: circle up to 1 m/s, turning wind down to 20 s; lost: turning wind at 5 s."
    )
    assert sentence("paper_ct", AXES_FLOWN) == (
        "within 100 mm: circle up to 2 m/s; never on turning wind; lost: turning wind at 5 s."
    )
    assert sentence("l1_adaptive", AXES_FLOWN) == (
        "within 100 mm: circle up to 1 m/s; never on turning wind; lost: circle from 2 m/s."
    )
    calm = {"circle": axis((1.0, 2.0), centroidal_tip=[point(0.001), point(0.002)])}
    assert sentence("centroidal_tip", calm) == "within 10 mm: all of circle; lost: nowhere."
    far = {"circle": axis((1.0, 2.0), indi=[point(0.2), LOST])}
    assert sentence("indi", far) == "within 100 mm: nowhere; lost: circle at 2 m/s."


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
        "sentences": {law: sentence(law, AXES_FLOWN) for law in laws},
        "violations": violations(AXES_FLOWN),
        "axes": AXES_FLOWN,
    }


def test_tables_hold_mean_and_largest_error_and_how_far_each_law_is_good():
    assert axis_rows(AXES_FLOWN["circle"])[1] == ["l1_adaptive", "20.0 / 40.0", "lost", "lost"]
    assert cell_text(point(0.3), JUDGED[OVERSHOOT]) == "300; 1.50 s"
    assert cell_text(LOST, JUDGED[OVERSHOOT]) == "lost"
    assert summary_rows(AXES_FLOWN, ["paper_ct", "centroidal_tip", "nmpc"]) == [
        ["circle, 1 to 3 m/s", "- / 2", "1 / 2", "-"],
        ["turning wind, 20 to 5 s", "- / -, lost at 5", "20 / 20, lost at 5", "-"],
    ]
    written = envelope_report(envelope()).markdown()
    for words in ("| l1_adaptive | 20.0 / 40.0 | lost | lost |", "indi does not fly: does not <fit>", "circle 3 m/s"):
        assert words in written


def test_without_the_flagship_nothing_is_said_of_its_rules():
    calm = {"circle": axis((1.0,), paper_ct=[point(0.1)], centroidal_tip=[point(0.1)])}
    for laws, words in ((["paper_ct"], "Not known: centroidal_tip did not fly."), (["centroidal_tip"], "None.")):
        found = envelope() | {"laws": laws, "violations": violations(calm)}
        assert envelope_report(found).markdown().endswith(f"{words}\n")


def test_the_page_holds_every_number_and_lets_no_name_through_unescaped():
    whole = envelope_report(envelope(), b"picture").html()
    for words in ("20.0 / 40.0", "lost; not lost: l1_adaptive", "within 10 mm: circle up to 1 m/s", "&lt;v&gt;"):
        assert words in whole
    assert "<v>" not in whole
    assert "<fit>" not in whole
    assert "http" not in whole.replace("http-equiv", ""), "it needs no other file"
    assert "1 / 2" in summary_section(envelope()).html()


def plants(*flights):
    """A value of wrong plants."""
    return point_of_plants(flights)


def test_a_value_of_wrong_plants_is_judged_by_the_worst_that_flies_and_lost_where_one_is():
    both = plants(point(0.004, largest=0.0201), point(0.002, largest=0.0199), point(0.009, largest=0.019))
    assert (both["judged"], both["tip_mean"], both["tip_max"], both["lost"]) == (0.009, 0.004, 0.0201, False)
    assert [both["plants"][key] for key in ("of", "held", "lost")] == [3, 2, 0]
    assert cell_text(both, "") == "2 of 3; 4.00 / 20.1"
    one = plants(point(0.004), LOST, point(0.03))
    assert (one["judged"], one["lost"], one["status"]) == (0.03, True, "ground")
    assert cell_text(one, "") == "1 of 3; 1 lost; 17.0 / 60.0"
    none = plants(LOST, LOST)
    assert (none["judged"], none["tip_mean"], none["lost"]) == (None, None, True)
    assert cell_text(none, "") == "0 of 2; 2 lost"


def test_lanes_are_grouped_value_by_value():
    columns = {TIP: np.arange(6) * 1e-3, TIP_MAX: np.arange(6) * 1e-2, OUTSIDE: np.zeros(6), "tilt_max": np.zeros(6)}
    columns["ee_error_last_mean_continuous"] = np.zeros(6)
    found = points_of(Cell(columns, np.array(["completed"] * 6)), AXES["wrong_plants"], 2)
    assert [each["judged"] for each in found] == [2e-3, 5e-3]
    assert [each["plants"]["held"] for each in found] == [3, 0]


def test_every_plant_is_a_trial_of_the_rules():
    own = plants(point(0.10), point(0.12), LOST, LOST)
    paper = plants(point(0.10), point(0.10), LOST, point(0.1))
    few = plants(point(0.2), point(0.2), point(0.3))
    laws = {"centroidal_tip": [own], "paper_ct": [paper], "nmpc": [few]}
    found = violations({"wrong_plants": axis((1.0,), "times", **laws)})
    assert [(each["rule"], each["plants"], sorted(each["kept_by"])) for each in found] == [
        ("lost", 2, ["nmpc", "paper_ct"]),
        ("worse", 1, ["paper_ct"]),
    ]
    assert violation_rows(found)[1] == ["wrong plants 1 times (1 of the plants)", "worse than paper_ct", "120", "100"]
