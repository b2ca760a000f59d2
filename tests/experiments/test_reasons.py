"""Reasons and the Markdown table, on cells written by hand."""

from __future__ import annotations

from typing import Any

import pytest

from skyarm.experiments.published import PAPER, PRINTED, rounding
from skyarm.experiments.reasons import agrees, reasons
from skyarm.experiments.table import difference, markdown, number


def table(case: str, controller: str, metric: str, ours: float | None) -> dict[str, Any]:
    cell = {"paper": PAPER[case][controller].get(metric), "rigid_body": ours, "mujoco": ours}
    return {"experiments": {case: {controller: {metric: cell}}}}


def reason(
    ours: float | None, tried: dict[tuple[str, str], float] | None = None, metric: str = "position_error_mean",
    controller: str = "CT",
) -> str:  # fmt: skip
    """Why case 2 differs (the paper's position error mean of CT is 0.031 m)."""
    sensitivity: dict[str, Any] = {}
    for (group, value), number_ in (tried or {}).items():
        sensitivity.setdefault(group, {})[value] = {"case2": {controller: {metric: number_}}}
    found = reasons(table("case2", controller, metric, ours), sensitivity)
    return found["case2"][controller].get(metric, "")


def test_agreement_is_five_percent_or_the_rounding() -> None:
    assert agrees(0.031, 0.0325, 0.0005)
    assert not agrees(0.031, 0.0327, 0.0005)
    assert agrees(0.0001, 0.00014, 0.00005)
    assert not agrees(0.0001, 0.00016, 0.00005)
    assert agrees(-0.28, -0.27, 0.005)


@pytest.mark.parametrize(
    ("case", "controller", "metric", "half"),
    [
        ("case1", "CT", "position_error_mean", 0.0005),  # printed 0.040, not 0.04
        ("case1", "CT", "roll_rms", 0.00005),
        ("case1", "PD", "iae_position", 0.005),
        ("case2", "PD", "settling_time", 0.05),
        ("case2", "CT", "settling_time", 0.5),
        ("case2_gust", "PD", "peak_pitch", 0.005),  # printed -0.40
    ],
)
def test_rounding_is_half_a_unit_of_the_last_printed_digit(
    case: str, controller: str, metric: str, half: float
) -> None:
    assert rounding(case, controller, metric) == pytest.approx(half)
    assert PAPER[case][controller][metric] == float(PRINTED[case][controller][metric])


def test_a_cell_that_agrees_needs_no_reason() -> None:
    assert not reason(0.0320)


def test_a_variation_that_reaches_the_number_is_the_reason() -> None:
    tried = {("joint_damping", "0.05"): 0.0312, ("time_shift", "0.5"): 0.06}
    assert reason(0.050, tried) == "consistent with joint damping 0.05 N m s/rad: 0.0312"


def test_a_variation_that_explains_a_part_says_which() -> None:
    # 0.019 off; 0.009 off with damping: 53 % of it removed
    assert reason(0.050, {("joint_damping", "0.05"): 0.040}) == (
        "joint damping 0.05 N m s/rad: 0.04, 53 % of the difference; the rest is open"
    )


def test_what_no_variation_explains_is_open() -> None:
    tried = {("joint_damping", "0.05"): 0.049, ("command_latency", "0.003"): 0.052}
    assert reason(0.050, tried).startswith("open: 0.049 ... 0.052 over the 2 variations")


def test_a_variation_that_spoils_more_cells_than_it_mends_explains_none() -> None:
    metrics = ("position_error_mean", "position_error_max", "pitch_rms")
    paper = [PAPER["case2"]["CT"][metric] for metric in metrics]
    cells = {m: {"paper": p, "rigid_body": 2.0 * p, "mujoco": None} for m, p in zip(metrics, paper, strict=True)}
    varied = dict(zip(metrics, (paper[0], 5.0 * paper[1], 5.0 * paper[2]), strict=True))
    sensitivity: Any = {"joint_damping": {"0.05": {"case2": {"CT": varied}}}}
    found = reasons({"experiments": {"case2": {"CT": cells}}}, sensitivity)["case2"]["CT"]
    assert all(line.startswith("open") for line in found.values())
    varied["pitch_rms"] = paper[2]
    found = reasons({"experiments": {"case2": {"CT": cells}}}, sensitivity)["case2"]["CT"]
    assert found["position_error_mean"].startswith("consistent with joint damping 0.05")


def test_without_flights_no_reason_is_made_up() -> None:
    assert reason(0.050) == "no variation was flown"
    assert reason(None) == "our flight ended before the window"


def test_settling_times_have_their_own_reasons() -> None:
    assert not reason(9.9, metric="settling_time")
    assert "never stays" in reason(None, metric="settling_time")
    assert "steady window" in reason(21.4, metric="settling_time")
    bound = reasons(table("case1", "CT", "settling_time_upper_bound", 8.0), {})
    assert not bound["case1"]["CT"]
    late = reasons(table("case1", "CT", "settling_time_upper_bound", 12.0), {})
    assert "upper bound" in late["case1"]["CT"]["settling_time_upper_bound"]


def test_cells_without_a_published_number_have_no_reason() -> None:
    assert not reason(1.0, metric="ee_error_mean")


def test_numbers_have_three_digits_and_missing_ones_a_dash() -> None:
    assert (number(0.034567), number(None), number(12.0), number(0.0)) == ("0.0346", "-", "12", "0")


def test_differences_are_relative_to_the_paper() -> None:
    assert difference({"paper": 0.1, "rigid_body": 0.12, "mujoco": 0.2}) == "+20 %"
    assert difference({"paper": -0.4, "rigid_body": -0.3, "mujoco": None}) == "-25 %"
    assert difference({"paper": 0.1, "rigid_body": None, "mujoco": 0.05}) == "-50 %"
    assert not difference({"paper": None, "rigid_body": 1.0, "mujoco": 1.0})
    assert not difference({"paper": 0.1, "rigid_body": None, "mujoco": None})


def test_every_row_of_the_markdown_has_the_columns_of_its_header() -> None:
    cells = {
        "settling_time": {"paper": 10.0, "rigid_body": None, "mujoco": 1.0},
        "pitch_rms": {"paper": None, "rigid_body": 0.1, "mujoco": 0.2},
        "position_error_mean_continuous": {"paper": None, "rigid_body": 0.1, "mujoco": 0.2},
    }
    results = {"experiments": {"case2": {"CT": cells, "PD": cells}}}
    why = {"case2": {"CT": {"settling_time": "|e_p| never stays"}}}
    text = markdown(results, why)
    rows = [line.replace(r"\|", "") for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + 4
    assert {row.count("|") for row in rows} == {8}
    assert r"\|e_p\| never stays" in text
    assert "_continuous" not in text
