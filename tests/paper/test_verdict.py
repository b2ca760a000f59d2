"""The three sentences that the report of the paper opens with follow from the results:
other results, other words.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pytest

from skyarm.paper.counted_cells import (
    counts,
    inferred_value,
    published_cells,
    stated_value,
)
from skyarm.paper.inferred_settings import unstated_study
from skyarm.paper.published import CASES, METRICS, PAPER, phrase, short_title
from skyarm.paper.report_pages import markdown_tables, report_pages
from skyarm.paper.verdict_sentences import verdict
from skyarm.scenario.scenario_record import PLANTS

SETTINGS = {
    "plants": list(PLANTS),
    "inferred": {"numbers": 1, "choices": 0, "settings": {"friction_1": 0.06}},
}


def agreeing() -> dict[str, Any]:
    """Results that are the paper's numbers, as stated and with the settings of a
    search.
    """
    experiments = {
        case: {
            law: {
                name: {
                    "paper": value,
                    **dict.fromkeys(PLANTS, value),
                    "inferred": dict.fromkeys(PLANTS, value),
                }
                for name, value in cells.items()
            }
            for law, cells in laws.items()
        }
        for case, laws in PAPER.items()
    }
    return {"schema": 1, "experiments": experiments, "settings": deepcopy(SETTINGS)}


def spoiled(kind: str, *, to: float = 3.0, inferred: bool = False) -> dict[str, Any]:
    """Results in which the numbers of one quantity are a multiple of the paper's."""
    table = agreeing()
    for laws in table["experiments"].values():
        for cells in laws.values():
            for name, cell in cells.items():
                if METRICS[name].quantity == kind:
                    cell.update(dict.fromkeys(PLANTS, to * cell["paper"]))
                    if inferred:
                        cell["inferred"] = dict.fromkeys(PLANTS, to * cell["paper"])
    return table


def test_where_every_number_agrees_none_differs() -> None:
    many = len(published_cells())
    first, second, third = verdict(agreeing())
    assert first.startswith(f"{many} of the paper's {many} numbers agree within 25 %")
    assert second == "No number differs more."
    assert third == "The settings that the paper states are enough."


@pytest.mark.parametrize(
    "kind", ["joint errors", "tip errors", "position errors", "joint torques"]
)
def test_the_quantity_that_agrees_least_is_named_with_its_count(kind: str) -> None:
    table = spoiled(kind)
    first, second, third = verdict(table)
    bad = sum(METRICS[cell.name].quantity == kind for cell in published_cells())
    near = counts(table["experiments"], stated_value("rigid_body"))["within_25%"]
    assert near == len(published_cells()) - bad
    assert first.startswith(f"{near:g} of the paper's")
    assert second == f"{kind.capitalize()} agree least, 0 of {bad}."
    assert third.startswith(
        "Most differences come from unstated settings, such as the viscous friction of"
        " joint 1"
    )
    assert third.endswith(f"{len(published_cells())} agree.")


def test_a_reversed_order_of_the_laws_is_the_example() -> None:
    table = spoiled("joint errors")
    cell = table["experiments"]["case1"]["CT"]["joint_error_mean"]
    other = table["experiments"]["case1"]["PD"]["joint_error_mean"]
    assert cell["paper"] < other["paper"]
    cell["rigid_body"], other["rigid_body"] = 9.0, 8.0
    _, second, _ = verdict(table)
    assert second.endswith(
        ": by mean joint error in Case 1, the paper's law CT is better in the paper, "
        "and its baseline PD is better here."
    )
    cell["paper"], other["paper"] = other["paper"], cell["paper"]
    cell["rigid_body"], other["rigid_body"] = 8.0, 9.0
    assert verdict(table)[1].endswith(
        "its baseline PD is better in the paper, and the paper's law CT is better here."
    )


def test_a_search_that_gains_nothing_is_no_reason() -> None:
    table = spoiled("joint errors", inferred=True)
    near = counts(table["experiments"], inferred_value("rigid_body"))["within_25%"]
    assert verdict(table)[2].endswith(
        f"give no reason: with those of a search, {near:g} agree."
    )


def test_a_search_that_explains_less_than_half_explains_some() -> None:
    table = spoiled("joint errors", inferred=True)
    cell = table["experiments"]["case1"]["CT"]["joint_error_mean"]
    cell["inferred"] = dict.fromkeys(PLANTS, cell["paper"])
    assert verdict(table)[2].startswith("Some differences come from unstated settings")


def test_without_flights_of_a_search_the_cause_is_open() -> None:
    table = spoiled("joint errors")
    for laws in table["experiments"].values():
        for cells in laws.values():
            for cell in cells.values():
                del cell["inferred"]
    assert verdict(table)[2].startswith("The cause is open")
    assert verdict({"experiments": {}})[0] == "No number of the paper was computed."


def test_the_plant_that_flew_first_is_judged() -> None:
    table = spoiled("tip errors")
    for laws in table["experiments"].values():
        for cells in laws.values():
            for cell in cells.values():
                cell["mujoco"] = cell["paper"]
    table["settings"]["plants"] = ["mujoco", "rigid_body"]
    assert verdict(table)[1] == "No number differs more."


@pytest.mark.parametrize(
    "table",
    [agreeing(), spoiled("joint errors"), spoiled("joint errors", inferred=True)],
)
def test_the_sentences_are_short(table: dict[str, Any]) -> None:
    assert len(verdict(table)) == 3
    for words in verdict(table):
        assert len(words.split()) <= 28
        assert words.endswith(".")


def test_the_report_and_its_markdown_open_with_them_in_words() -> None:
    table = spoiled("joint errors")
    page, text = report_pages(table, {}, {})["report.html"], markdown_tables(table)
    first = page[page.index("<h1") : page.index("<table")]
    assert first.count('<p class="lead">') == 3
    assert "_" not in first, "names of arrays are for machines"
    assert text.index(verdict(table)[0]) < text.index("## Case 1")
    assert not any(f"| {name} |" in text for name in METRICS if "_" in name)


def test_every_metric_has_a_quantity_and_a_label_of_its_own() -> None:
    assert all(each.quantity for each in METRICS.values())
    labels = [each.label for each in METRICS.values()]
    assert len(set(labels)) == len(labels)
    assert (phrase("joint_error_mean"), phrase("pitch_rms")) == (
        "mean joint error",
        "RMS pitch",
    )
    assert [short_title(case) for case in CASES][:3] == ["Case 1", "Case 2", "Case 3"]


def test_the_words_of_the_settings_are_those_of_the_study() -> None:
    assert unstated_study()["parameters"][0]["words"] in " ".join(
        verdict(spoiled("joint errors"))
    )
