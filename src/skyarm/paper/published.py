"""The paper's numbers.

Source: Barakou, Tzafestas, Valavanis, Drones 2026, 10, 274: Table 2 (case1-3), section 5 text and Figures 9-11 (gust),
16-18 (wind). The mean position error of PD in the wind is derived: 0.577 m / (1 - 0.14).
"""

from __future__ import annotations

from collections.abc import Mapping

Cells = Mapping[str, float]

CASES = ("case1", "case2", "case3", "case2_gust", "case3_wind")
TITLES: Mapping[str, str] = {
    "case1": "Case 1: hover, arm ramps",
    "case2": "Case 2: hover, arm sinusoids",
    "case3": "Case 3: circle, arm sinusoids",
    "case2_gust": "Case 2 in a gust of 3 s",
    "case3_wind": "Case 3 in constant wind",
}
CONTROLLERS = {"CT": "paper_ct", "PD": "paper_pd"}

PRINTED: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "case1": {
        "CT": {
            "joint_error_mean": "0.019",
            "joint_error_max": "0.265",
            "position_error_mean": "0.040",
            "position_error_max": "0.076",
            "pitch_rms": "0.026",
            "roll_rms": "0.0002",
            "tau1_rms": "0.036",
            "tau2_rms": "0.012",
            "peak_pitch": "0.130",
            "peak_position": "0.088",
            "settling_time_upper_bound": "10",
            "iae_position": "1.17",
            "iae_joint": "2.17",
        },
        "PD": {
            "joint_error_mean": "0.057",
            "joint_error_max": "0.300",
            "position_error_mean": "0.083",
            "position_error_max": "0.140",
            "pitch_rms": "0.012",
            "roll_rms": "0.0001",
            "tau1_rms": "0.041",
            "tau2_rms": "0.010",
            "peak_pitch": "0.012",
            "peak_position": "0.035",
            "settling_time_upper_bound": "10",
            "iae_position": "2.33",
            "iae_joint": "3.68",
        },
    },
    "case2": {
        "CT": {
            "joint_error_mean": "0.036",
            "joint_error_max": "0.105",
            "position_error_mean": "0.031",
            "position_error_max": "0.034",
            "pitch_rms": "0.010",
            "roll_rms": "0.0001",
            "tau1_rms": "0.045",
            "tau2_rms": "0.010",
            "peak_pitch": "0.227",
            "peak_position": "0.099",
            "settling_time": "10",
            "iae_position": "0.94",
            "iae_joint": "2.42",
        },
        "PD": {
            "joint_error_mean": "0.049",
            "joint_error_max": "0.073",
            "position_error_mean": "0.065",
            "position_error_max": "0.089",
            "pitch_rms": "0.056",
            "roll_rms": "0.0007",
            "tau1_rms": "0.056",
            "tau2_rms": "0.009",
            "peak_pitch": "0.003",
            "peak_position": "0.037",
            "settling_time": "23.5",
            "iae_position": "1.47",
            "iae_joint": "2.62",
        },
    },
    "case3": {
        "CT": {
            "joint_error_mean": "0.012",
            "joint_error_max": "0.025",
            "position_error_mean": "0.035",
            "position_error_max": "0.038",
            "ee_error_mean": "0.036",
            "ee_error_max": "0.041",
            "pitch_rms": "0.010",
            "roll_rms": "0.006",
            "tau1_rms": "0.030",
            "tau2_rms": "0.006",
            "peak_pitch": "0.245",
            "peak_position": "0.302",
            "settling_time": "10",
            "iae_position": "2.94",
            "iae_joint": "1.26",
        },
        "PD": {
            "joint_error_mean": "0.031",
            "joint_error_max": "0.039",
            "position_error_mean": "0.053",
            "position_error_max": "0.083",
            "ee_error_mean": "0.066",
            "ee_error_max": "0.113",
            "pitch_rms": "0.039",
            "roll_rms": "0.007",
            "tau1_rms": "0.033",
            "tau2_rms": "0.006",
            "peak_pitch": "0.012",
            "peak_position": "0.303",
            "settling_time": "24.5",
            "iae_position": "3.89",
            "iae_joint": "1.99",
        },
    },
    "case2_gust": {
        "CT": {
            "peak_x": "0.55",
            "position_error_mean": "0.13",
            "pitch_rms": "0.121",
            "iae_position": "2.04",
            "iae_joint": "1.14",
            "peak_pitch": "-0.32",
        },
        "PD": {
            "peak_x": "0.71",
            "position_error_mean": "0.17",
            "pitch_rms": "0.138",
            "iae_position": "2.80",
            "iae_joint": "1.34",
            "peak_pitch": "-0.40",
        },
    },
    "case3_wind": {
        "CT": {
            "position_error_mean": "0.577",
            "position_ripple": "0.01",
            "ee_error_mean": "0.661",
            "ee_error_max": "0.684",
            "pitch_mean": "-0.28",
            "pitch_ripple": "0.02",
            "peak_pitch": "0.647",
        },
        "PD": {
            "position_error_mean": "0.671",
            "position_min": "0.62",
            "position_max": "0.73",
            "ee_error_mean": "0.741",
            "ee_error_max": "0.829",
            "pitch_mean": "-0.28",
            "pitch_ripple": "0.06",
            "peak_pitch": "0.381",
        },
    },
}
"""The numbers as printed, trailing zeros included: they say how well a number is known."""

PAPER: Mapping[str, Mapping[str, Cells]] = {
    case: {name: {metric: float(text) for metric, text in cells.items()} for name, cells in controllers.items()}
    for case, controllers in PRINTED.items()
}


def rounding(case: str, controller: str, metric: str) -> float:
    """Half a unit of the last printed digit."""
    _, _, decimals = PRINTED[case][controller][metric].partition(".")
    return 0.5 * 10.0 ** -len(decimals)


def printed(case: str, controller: str, metric: str) -> str:
    """The published number as printed; "" where there is none."""
    return PRINTED.get(case, {}).get(controller, {}).get(metric, "")


SAID: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    case: {law: {"hover_offset": "0.035"} for law in CONTROLLERS} for case in CASES if case != "case3_wind"
} | {"case1": {"CT": {"hover_offset": "0.035"}, "PD": {"hover_offset": "0.035", "held_position_error": "0.13-0.14"}}}
"""What section 5 says in words where Table 2 is silent: the height offset of every case without constant wind, and how
far PD stays away while the arm of Case 1 is held."""


def said(case: str, controller: str, metric: str) -> str:
    """The published number as printed, or as the text says it; "" where there is none."""
    return printed(case, controller, metric) or SAID.get(case, {}).get(controller, {}).get(metric, "")
