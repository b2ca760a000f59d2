"""Differences from the published numbers and the Markdown table, on cells written by
hand.
"""

from __future__ import annotations

from typing import Any

import pytest

from skyarm.paper import flights
from skyarm.paper.published import (
    PRINTED,
    digits,
    percent,
    relative,
    reversed_orders,
    rounding,
)
from skyarm.paper.report_pages import markdown_tables as markdown
from skyarm.records.files import shipped_tables


def test_every_printed_number_of_a_case_is_measured_in_its_flights() -> None:
    for case, laws in PRINTED.items():
        rows = shipped_tables(flights.__file__)["rows"][case]
        assert len(rows) == len({*rows})
        for cells in laws.values():
            assert {*cells} <= {*rows}


def test_numbers_have_three_digits_and_missing_ones_a_dash() -> None:
    assert (digits(0.034567), digits(None), digits(12.0), digits(0.0)) == (
        "0.0346",
        "-",
        "12.0",
        "0",
    )
    assert (digits(0.13), digits(123.4), digits(-0.0339999)) == (
        "0.130",
        "123",
        "-0.0340",
    )


def test_differences_are_relative_to_the_paper() -> None:
    assert [percent(ours, 0.1) for ours in (0.12, 0.2)] == ["+20 %", "+100 %"]
    assert [percent(*pair) for pair in ((1.0, None), (None, 0.1), (1.0, 0.0))] == [
        "",
        "",
        "",
    ]


def test_a_larger_magnitude_is_a_positive_difference_whatever_its_sign() -> None:
    assert relative(-0.34, -0.32) == pytest.approx(0.0625)
    assert relative(0.34, 0.32) == pytest.approx(0.0625)
    assert relative(-0.3, -0.4) == pytest.approx(-0.25)
    assert relative(0.1, -0.4) == pytest.approx(-1.25), (
        "the other sign is further than nothing at all"
    )
    assert relative(float("nan"), 1.0) is None


def test_a_rounded_zero_has_no_sign() -> None:
    assert [percent(1.0 + x, 1.0) for x in (-0.004, 0.004, -0.006, 0.06)] == [
        "0 %",
        "0 %",
        "-1 %",
        "+6 %",
    ]


def test_every_row_of_the_markdown_has_the_columns_of_its_header() -> None:
    cells = {
        "position_error_mean_continuous": {
            "paper": None,
            "rigid_body": 0.1,
            "mujoco": 0.2,
        },
        "settling_time": {"paper": 10.0, "rigid_body": None, "mujoco": 1.0},
        "pitch_rms": {"paper": 0.01, "rigid_body": 0.1, "mujoco": 0.2},
    }
    results = {"experiments": {"case2": {"CT": cells, "PD": cells}}}
    text = markdown(results)
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + 4
    assert {row.count("|") for row in rows} == {11}
    assert "_continuous" not in text
    assert (
        "| RMS pitch | rad | CT | 0.010 | 0.100 | 0.200 | - | - | +900 % |  |" in text
    )


def test_the_markdown_states_what_is_assumed_beside_the_table() -> None:
    text = markdown({"experiments": {}})
    assert "without latency (RotorS has about three physics steps)" in text
    assert "joint damping of 0.001 N m s/rad" in text


def test_the_markdown_compares_the_plant_that_flew() -> None:
    cells = {"pitch_rms": {"paper": 0.01, "rigid_body": None, "mujoco": 0.02}}
    results: dict[str, Any] = {
        "experiments": {"case2": {"CT": cells}},
        "settings": {"plants": ["mujoco"]},
    }
    text = markdown(results)
    assert "Differences: mujoco against the paper" in text
    assert "| RMS pitch | rad | CT | 0.010 | - | 0.0200 | - | - | +100 % |  |" in text
    results["settings"] = {"plants": ["rigid_body", "mujoco"]}
    text = markdown(results)
    assert "| 0.0200 | - | - |  |  |" in text


def test_an_order_is_reversed_where_the_better_controller_changes() -> None:
    def cell(paper: float | None, ours: float | None) -> dict[str, float | None]:
        return {"paper": paper, "rigid_body": ours, "mujoco": None}

    ct = {
        "kept": cell(1.0, 1.0),
        "turned": cell(1.0, 3.0),
        "signed": cell(-1.0, -3.0),
        "missing": cell(1.0, None),
    }
    pd = {
        "kept": cell(2.0, 5.0),
        "turned": cell(2.0, 2.0),
        "signed": cell(-2.0, -2.0),
        "missing": cell(2.0, 1.0),
    }
    ct |= {"equal": cell(1.0, 9.0), "near": cell(1.0, 2.01)}
    pd |= {"equal": cell(1.0, 1.0), "near": cell(2.0, 2.0)}
    experiments = {"case1": {"CT": ct, "PD": pd}}
    assert reversed_orders(experiments, "rigid_body") == [
        ("case1", "turned"),
        ("case1", "signed"),
    ]
    line = next(
        x
        for x in markdown({"experiments": experiments}).splitlines()
        if x.startswith("Metrics whose better law")
    )
    assert line.endswith("Case 1, turned, signed.")


def test_a_printed_number_is_uncertain_by_half_a_unit_of_its_last_digit() -> None:
    for case, laws in PRINTED.items():
        for law, cells in laws.items():
            for metric, text in cells.items():
                # the same number with one more digit, a 5
                more = float(f"{text}5") if "." in text else float(f"{text}.5")
                assert rounding(case, law, metric) == pytest.approx(
                    abs(more - float(text)), rel=1e-6
                ), (case, metric)
