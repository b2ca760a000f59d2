"""The comparison's page: every law in its kind, every condition, and its title."""

from __future__ import annotations

import functools
import re

import numpy as np

from skyarm.studies.compare.cell_flights import SUCCESS_METRIC, Cell, table
from skyarm.studies.compare.comparison import (
    COST,
    GROUPS,
    TRACKING,
    comparison_report,
    main_sections,
)
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.suite import CASES, conditions
from skyarm.view.pages import grouped_table

EVERY = conditions(plants=4, seeds=2)
METRICS = ("position_error_mean_continuous", "ee_error_mean_continuous", "rotor_jitter")
LAWS = list(ENTRANTS)


def number(condition, case, name, metric):
    """Distinct for every cell, m or rad/s."""
    places = (
        list(EVERY).index(condition),
        list(CASES).index(case),
        LAWS.index(name),
        METRICS.index(metric),
    )
    a, b, c, d = places
    return 1.0 + 0.3 * a + 0.03 * b + 0.001 * c + 0.1 * d


@functools.lru_cache(maxsize=1)
def made():
    cells = {}
    for condition in EVERY:
        for case in EVERY[condition].cases:
            for name in LAWS:
                numbers = {
                    m: np.array([number(condition, case, name, m)] * 4) for m in METRICS
                }
                # of four plants as many succeed as the law's name has letters, modulo
                # five
                good = np.arange(4) < len(name) % 5
                numbers[SUCCESS_METRIC] = np.where(good, 0.01, 1.0)
                cells[condition, case, name] = Cell(
                    numbers, np.array(["completed"] * 4)
                )
    return {"summaries": table(cells), "seed": 0, "plant": "rigid_body"}


def test_every_law_stands_once_in_every_table_under_its_kind():
    (first,) = [
        each.html()
        for each in main_sections(made(), ENTRANTS, EVERY)
        if each.title.startswith("perfect:")
    ]
    errors = first.split("</table>")[0]
    found = re.findall(r'<th scope="row(?:group)?"[^>]*>([^<]*)</th>', errors)
    wanted = []
    for group, title in list(GROUPS.items())[:-1]:
        wanted += [
            title.replace("'", "&#39;"),
            *(name for name in LAWS if ENTRANTS[name].group == group),
        ]
    assert found == wanted
    assert set(LAWS) < set(found)


def test_columns_of_numbers_are_set_to_the_right_and_text_is_escaped():
    text = grouped_table(
        ["law", ">tip", "what"], [("a & b", [["<x>", "1", "words"]])], "c < d"
    )
    assert "<caption>c &lt; d</caption>" in text
    assert '<th scope="rowgroup" colspan="3">a &amp; b</th>' in text
    assert '<th scope="row">&lt;x&gt;</th><td class="num">1</td><td>words</td>' in text
    assert '<th scope="col" class="num">tip</th>' in text


def test_no_two_columns_of_a_table_have_the_same_head():
    for each in main_sections(made(), ENTRANTS, EVERY):
        for head in re.findall(r"<thead>(.*?)</thead>", each.html()):
            names = re.findall(r"<th[^>]*>([^<]*)</th>", head)
            assert len(set(names)) == len(names), (each.title, names)


def test_the_table_of_costs_says_its_case():
    tables = [
        each.html()
        for each in main_sections(made(), ENTRANTS, EVERY)
        if "jitter" in each.html()
    ]
    assert any(
        "torque, motion and tilt: Case 3 in wind" in content for content in tables
    )


def test_jitter_and_saturation_stand_beside_every_error_of_the_tip():
    tipped = {column.case for column in TRACKING if "tip" in column.head}
    for metric in ("rotor_jitter", "rotor_saturation"):
        assert {column.case for column in COST if column.metric == metric} == tipped


def test_the_picture_takes_the_whole_width_of_the_page():
    assert (
        '<figure class="wide"><img alt="Case 3'
        in comparison_report(made(), ENTRANTS, EVERY, b"png").html()
    )


def test_a_comparison_is_called_by_its_laws():
    found = made()
    for laws, title in (
        (LAWS, "All laws compared"),
        (["paper_pd", "paper_ct"], "paper_pd against paper_ct"),
        (["paper_pd", "paper_ct", LAWS[-1]], "3 laws compared"),
        ([LAWS[-1]], LAWS[-1]),
    ):
        chosen = {name: ENTRANTS[name] for name in laws}
        report = comparison_report(found, chosen, EVERY)
        text = report.html()
        assert f"<h1>{title}</h1>" in text
        assert f"<title>{title}</title>" in text
        assert report.markdown().startswith(f"# {title}\n\n## perfect")
        assert (f"{len(laws)} laws" in text) == (len(laws) > 1)
