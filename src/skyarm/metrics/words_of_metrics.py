"""What the metrics are called on axes and in tables, and their SI units."""

from __future__ import annotations

import re
from collections.abc import Mapping

from skyarm.metrics.accumulate import CONTINUOUS

GUST = "gust_"

WORDS: Mapping[str, tuple[str, str]] = {
    "position_error_mean": ("mean position error", "m"),
    "position_error_max": ("largest position error", "m"),
    "position_min": ("smallest position error", "m"),
    "position_max": ("largest position error", "m"),
    "position_ripple": ("ripple of the position error", "m"),
    "peak_position": ("largest position error of the transient", "m"),
    "iae_position": ("integral of the position error", "m s"),
    "held_position_error": ("mean position error while the arm is held", "m"),
    "altitude_error_max": ("largest height error", "m"),
    "x_error_max": ("largest position error along x, with its sign", "m"),
    "ee_time_outside": ("time with the tip over 5 cm from its reference", "s"),
    "hover_offset": ("height offset in hover", "m"),
    "joint_error_mean": ("mean joint error", "rad"),
    "joint_error_max": ("largest joint error", "rad"),
    "iae_joint": ("integral of the joint error", "rad s"),
    "ee_error_mean": ("mean tip error", "m"),
    "ee_error_max": ("largest tip error", "m"),
    "ee_error_last_mean": ("mean tip error at the end", "m"),
    "ee_error_last_max": ("largest tip error at the end", "m"),
    "peak_x": ("peak position error along x", "m"),
    "ee_peak_x": ("peak tip error along x", "m"),
    "pitch_mean": ("mean pitch", "rad"),
    "pitch_rms": ("RMS pitch", "rad"),
    "pitch_ripple": ("ripple of pitch", "rad"),
    "peak_pitch": ("peak pitch of the transient", "rad"),
    "gust_peak_pitch": ("peak pitch in the gust", "rad"),
    "roll_rms": ("RMS roll", "rad"),
    "tilt_rms": ("RMS tilt", "rad"),
    "tilt_max": ("largest tilt", "rad"),
    "rate_rms": ("RMS body rate", "rad/s"),
    "reference_lag_mean": ("mean lag of the governor", "s"),
    "reference_lag_max": ("largest lag of the governor", "s"),
    "phases_done": ("phases done", "phases"),
    "phases_time": ("when the last phase was done", "s"),
    "contact_error_mean": ("mean error of the contact force", "N"),
    "contact_ripple": ("RMS of the contact force about its mean", "N"),
    "contact_held": ("share of the time with the contact force within 30 % of the wanted one", ""),
    "contact_peak": ("largest contact force while contact is asked for", "N"),
    "contact_losses": ("losses of contact", "losses"),
    "contact_first": ("first touch", "s"),
    "contact_tip_mean": ("mean tip error across the normal in contact", "m"),
    "contact_tip_max": ("largest tip error across the normal in contact", "m"),
    "contact_last": ("contact force at the end", "N"),
    "contact_largest": ("largest contact force", "N"),
    "object_last_x": ("x of the first object at the end", "m"),
    "object_last_y": ("y of the first object at the end", "m"),
    "object_last_z": ("z of the first object at the end", "m"),
    "mechanism_last": ("coordinate of the first mechanism at the end", ""),
    "mechanism_furthest": ("largest coordinate of the first mechanism", ""),
    "grip_force_mean": ("mean radial force on the handle that is held", "N"),
    "grip_force_max": ("largest radial force on the handle that is held", "N"),
    "grip_lag_max": ("largest lag of the handle that is held", "rad"),
    "tip_lowest": ("lowest height of the tip", "m"),
    "rotor_jitter": ("RMS change of a rotor command per period", "rad/s"),
    "rotor_jitter_mean": ("mean change of a rotor command per period", "rad/s"),
}
"""Metric -> (words, unit); twins, those of the gust and the joints' torques follow from these."""


def metric_words(name: str) -> tuple[str, str]:
    """Words and unit of a metric; of one's own its name, without a unit.

    Joint errors are in rad; those of joints that slide in m.
    """
    base, twin = name.removesuffix(CONTINUOUS), name.endswith(CONTINUOUS)
    if base in WORDS:
        words, unit = WORDS[base]
    elif base.startswith(GUST) and base.removeprefix(GUST) in WORDS:
        words, unit = WORDS[base.removeprefix(GUST)]
        words = f"{words} in the gust"
    elif match := re.fullmatch(r"tau(\d+)_rms", base):
        words, unit = f"RMS torque of joint {match[1]}", "N m"
    else:
        words, unit = base.replace("_", " "), ""
    return (f"{words}, continuous reference" if twin else words), unit
