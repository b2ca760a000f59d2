"""Reasons and the Markdown table, on cells written by hand."""

from __future__ import annotations

from typing import Any

import pytest

from skyarm.paper.published import PAPER, PRINTED, digits, percent, relative, reversed_orders, rounding
from skyarm.paper.reasons import agrees, reasons, score
from skyarm.paper.report_tables import markdown_tables as markdown


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


def test_a_variation_that_reaches_the_number_is_named() -> None:
    tried = {("joint_damping", "0.05"): 0.0312, ("time_shift", "0.5"): 0.06}
    assert reason(0.050, tried) == "consistent with joint damping 0.05 N m s/rad: 0.0312"


def test_a_variation_that_removes_a_part_says_which() -> None:
    # 0.019 off; 0.009 off with damping: 53 % of it removed
    assert reason(0.050, {("joint_damping", "0.05"): 0.040}) == (
        "joint damping 0.05 N m s/rad: 0.0400, 53 % of the difference; the rest is open"
    )


def test_what_no_variation_reaches_is_open() -> None:
    tried = {("joint_damping", "0.05"): 0.049, ("command_latency", "0.003"): 0.052}
    assert reason(0.050, tried) == "open: 0.0490 ... 0.0520 over the 2 variations measured"


def test_what_the_table_itself_assumes_is_no_variation() -> None:
    tried = {("joint_damping", "0.05"): 0.049, ("joint_damping", "0.001"): 0.050, ("ramp_shape", "linear"): 0.020}
    assert reason(0.050, tried) == "open: 0.0490 ... 0.0490 over the 1 variations measured"


def test_equal_within_the_rounding_is_said() -> None:
    # printed 0.0001, so anything from 0.00005 to 0.00015 may be meant
    assert reason(0.00006, metric="roll_rms") == "equal within the published rounding"
    assert reason(0.000102, metric="roll_rms") == ""


def flight(paper_times: dict[tuple[str, str], tuple[float, float, float]]) -> dict[str, str]:
    """Reasons of Case 2, CT, where three cells are twice the paper's and variations give multiples of the paper's."""
    metrics = ("position_error_mean", "position_error_max", "pitch_rms")
    paper = [PAPER["case2"]["CT"][metric] for metric in metrics]
    cells = {m: {"paper": p, "rigid_body": 2.0 * p, "mujoco": None} for m, p in zip(metrics, paper, strict=True)}
    sensitivity: Any = {}
    for (group, value), factors in paper_times.items():
        varied = {m: k * p for m, k, p in zip(metrics, factors, paper, strict=True)}
        sensitivity.setdefault(group, {})[value] = {"case2": {"CT": varied}}
    return reasons({"experiments": {"case2": {"CT": cells}}}, sensitivity)["case2"]["CT"]


def test_a_flight_has_one_alignment_only() -> None:
    """0.5 s late mends two cells, 8 s earlier one: both are credible, the better one alone is named."""
    found = flight({("time_shift", "0.5"): (1.0, 1.0, 2.0), ("bag_start", "8"): (2.0, 2.0, 1.0)})
    assert found["position_error_mean"].startswith("consistent with recorded reference 0.5 s late")
    assert found["position_error_max"].startswith("consistent with recorded reference 0.5 s late")
    assert found["pitch_rms"].startswith("open")
    found = flight({("time_shift", "0.5"): (2.0, 1.0, 2.0), ("bag_start", "8"): (1.0, 1.2, 1.1)})
    assert found["position_error_max"].startswith("windows 8 s earlier")


def test_other_variations_stay_beside_the_alignment() -> None:
    found = flight({("time_shift", "0.5"): (1.0, 1.0, 2.0), ("joint_damping", "0.05"): (2.0, 2.0, 1.0)})
    assert found["position_error_mean"].startswith("consistent with recorded reference")
    assert found["pitch_rms"].startswith("consistent with joint damping 0.05")


def test_the_best_alignment_is_not_named_if_it_spoils_more_than_it_mends() -> None:
    # distances are clipped at 1: two cells far beyond that become no worse, so the score alone would name it
    found = flight({("time_shift", "0.5"): (1.0, 5.0, 5.0)})
    assert all(line.startswith("open") for line in found.values())


def test_the_score_is_the_share_of_the_clipped_distance_removed() -> None:
    # (paper, ours, varied): distances 0.5 -> 0.1 and 9 -> 3, both clipped to 1
    assert score([(1.0, 1.5, 1.1), (1.0, 10.0, 4.0)]) == pytest.approx(1.0 - 1.1 / 1.5)
    assert score([(-0.4, -0.6, -0.4)]) == pytest.approx(1.0)
    assert score([(1.0, 1.5, 2.5)]) == pytest.approx(-1.0)
    assert score([]) == 0.0


def test_a_variation_that_spoils_more_cells_than_it_mends_is_not_named() -> None:
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
    assert (digits(0.034567), digits(None), digits(12.0), digits(0.0)) == ("0.0346", "-", "12.0", "0")
    assert (digits(0.13), digits(123.4), digits(-0.0339999)) == ("0.130", "123", "-0.0340")


def test_differences_are_relative_to_the_paper() -> None:
    assert [percent(ours, 0.1) for ours in (0.12, 0.2)] == ["+20 %", "+100 %"]
    assert [percent(*pair) for pair in ((1.0, None), (None, 0.1), (1.0, 0.0))] == ["", "", ""]


def test_a_larger_magnitude_is_a_positive_difference_whatever_its_sign() -> None:
    assert relative(-0.34, -0.32) == pytest.approx(0.0625)
    assert relative(0.34, 0.32) == pytest.approx(0.0625)
    assert relative(-0.3, -0.4) == pytest.approx(-0.25)
    assert relative(0.1, -0.4) == pytest.approx(-1.25), "the other sign is further than nothing at all"
    assert relative(float("nan"), 1.0) is None


def test_a_rounded_zero_has_no_sign() -> None:
    assert [percent(1.0 + x, 1.0) for x in (-0.004, 0.004, -0.006, 0.06)] == ["0 %", "0 %", "-1 %", "+6 %"]


def test_every_row_of_the_markdown_has_the_columns_of_its_header() -> None:
    cells = {
        "position_error_mean_continuous": {"paper": None, "rigid_body": 0.1, "mujoco": 0.2},
        "settling_time": {"paper": 10.0, "rigid_body": None, "mujoco": 1.0},
        "pitch_rms": {"paper": 0.01, "rigid_body": 0.1, "mujoco": 0.2},
    }
    results = {"experiments": {"case2": {"CT": cells, "PD": cells}}}
    why = {"case2": {"CT": {"settling_time": "|e_p| never stays"}}}
    text = markdown(results, why)
    rows = [line.replace(r"\|", "") for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + 4
    assert {row.count("|") for row in rows} == {12}
    assert r"\|e_p\| never stays" in text
    assert "_continuous" not in text
    assert "| pitch_rms | rad | CT | 0.010 | 0.100 | 0.200 | - | - | +900 % |  |" in text
    assert "alternatives, not jointly true" in text


def test_the_markdown_states_what_is_assumed_beside_the_table() -> None:
    text = markdown({"experiments": {}}, {})
    assert "without latency (RotorS has about three physics steps)" in text
    assert "joint damping of 0.001 N m s/rad" in text


def test_the_markdown_compares_the_plant_that_flew() -> None:
    cells = {"pitch_rms": {"paper": 0.01, "rigid_body": None, "mujoco": 0.02}}
    results: dict[str, Any] = {"experiments": {"case2": {"CT": cells}}}
    text = markdown(results, reasons(results, {}))
    assert "Differences: mujoco against the paper" in text
    assert "| pitch_rms | rad | CT | 0.010 | - | 0.0200 | - | - | +100 % |  | no variation was flown |" in text
    results["settings"] = {"plants": ["rigid_body", "mujoco"]}
    text = markdown(results, reasons(results, {}))
    assert "| 0.0200 | - | - |  |  | our flight ended before the window |" in text


def test_an_order_is_reversed_where_the_better_controller_changes() -> None:
    def cell(paper: float | None, ours: float | None) -> dict[str, float | None]:
        return {"paper": paper, "rigid_body": ours, "mujoco": None}

    ct = {"kept": cell(1.0, 1.0), "turned": cell(1.0, 3.0), "signed": cell(-1.0, -3.0), "missing": cell(1.0, None)}
    pd = {"kept": cell(2.0, 5.0), "turned": cell(2.0, 2.0), "signed": cell(-2.0, -2.0), "missing": cell(2.0, 1.0)}
    ct |= {"equal": cell(1.0, 9.0), "near": cell(1.0, 2.01)}
    pd |= {"equal": cell(1.0, 1.0), "near": cell(2.0, 2.0)}
    experiments = {"case1": {"CT": ct, "PD": pd}}
    assert reversed_orders(experiments, "rigid_body") == [("case1", "turned"), ("case1", "signed")]
    line = next(x for x in markdown({"experiments": experiments}, {}).splitlines() if x.startswith("Not reproduced"))
    assert "Case 1 turned; Case 1 signed" in line
