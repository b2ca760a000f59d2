"""Rules about the flagship on an envelope."""

from __future__ import annotations

from envelope_rules import violation_rows, violations

from support.studies import AXES_FLOWN, LOST, axis, plants, point


def test_violations_are_a_loss_that_another_law_survives_and_10_percent_over_paper():
    found = violations(AXES_FLOWN)
    assert [(each["axis"], each["value"], each["rule"]) for each in found] == [
        ("circle", 3.0, "worse"),
        ("turning_wind", 5.0, "lost"),
    ]
    assert (found[0]["own"], found[0]["other"], found[0]["kept_by"]) == (
        0.5,
        0.4,
        ["paper_ct"],
    )
    assert found[1]["kept_by"] == ["l1_adaptive"]
    assert violation_rows(found) == [
        ["circle 3 m/s", "worse than paper_ct", "500", "400"],
        ["turning wind 5 s", "lost; not lost: l1_adaptive", "-", "-"],
    ]


def test_what_every_law_loses_and_what_is_nine_per_cent_worse_is_no_violation():
    both = {
        "circle": axis(
            (1.0, 2.0), paper_ct=[LOST, point(0.1)], centroidal_tip=[LOST, point(0.109)]
        )
    }
    assert violations(both) == []
    alone = {"circle": axis((1.0,), centroidal_tip=[LOST])}
    assert violations(alone) == []
    # the paper's law is lost: nothing to be worse than
    assert (
        violations(
            {"circle": axis((1.0,), paper_ct=[LOST], centroidal_tip=[point(0.9)])}
        )
        == []
    )


def test_on_another_vehicle_the_tuned_form_of_the_paper_s_law_is_the_measure():
    found = violations(
        {
            "circle": axis(
                (1.0,),
                hybrid_computed_torque_tuned=[point(0.1)],
                centroidal_tip=[point(0.12)],
            )
        }
    )
    assert found[0]["kept_by"] == ["hybrid_computed_torque_tuned"]


def test_every_plant_is_a_trial_of_the_rules():
    own = plants(point(0.10), point(0.12), LOST, LOST)
    paper = plants(point(0.10), point(0.10), LOST, point(0.1))
    few = plants(point(0.2), point(0.2), point(0.3))
    laws = {"centroidal_tip": [own], "paper_ct": [paper], "nmpc": [few]}
    found = violations({"wrong_plants": axis((1.0,), "times", **laws)})
    assert [
        (each["rule"], each["plants"], sorted(each["kept_by"])) for each in found
    ] == [
        ("lost", 2, ["nmpc", "paper_ct"]),
        ("worse", 1, ["paper_ct"]),
    ]
    assert violation_rows(found)[1] == [
        "perturbed plants 1 times (1 of the plants)",
        "worse than paper_ct",
        "120",
        "100",
    ]
