"""Metrics and paths of a sweep in words, with their units, for axes and legends."""

from __future__ import annotations

import re
from collections.abc import Mapping

from skyarm.metrics.accumulate import CONTINUOUS

WORDS: Mapping[str, str] = {
    "ee": "tip",
    "iae": "integral of absolute error,",
    "rms": "RMS",
    "max": "maximum",
    "min": "minimum",
}

UNITS: tuple[tuple[str, str], ...] = (
    (r"tau\d+_rms", "N m"),
    (r".*iae_position", "m s"),
    (r".*iae_joint", "rad s"),
    (r".*(joint|pitch|roll|tilt).*", "rad"),
    (r"rate_rms", "rad/s"),
    (r"rotor_jitter.*", "rad/s"),
    (r".*(position|ee|altitude|peak_x|hover_offset).*", "m"),
)
"""Of the shipped metrics, by their names; one of one's own has none here."""

LAST: Mapping[str, str] = {
    "mass": "kg",
    "damping": "N m s/rad",
    "effort_limit": "N m",
    "time_constant_up": "s",
    "time_constant_down": "s",
    "max_speed": "rad/s",
    "thrust_coefficient": "N s^2/rad^2",
    "frequency_hz": "Hz",
    "radius": "m",
    "start": "s",
    "duration": "s",
    "gravity": "m/s^2",
}
"""Units by the last word of a path."""

INSIDE: Mapping[str, str] = {
    "force": "N",
    "force_W": "N",
    "velocity": "m/s",
    "velocity_W": "m/s",
    "com": "m",
    "inertia": "kg m^2",
    "delays": "s",
}
"""Units by a word before the last, or the last."""

LONGEST = 46
"""Characters of a path on an axis."""


def metric_words(name: str) -> tuple[str, str]:
    """A metric in words, and its unit, "" if that is not known.

    ``ee_error_mean`` is "Tip error mean", in m.
    """
    plain = name.removesuffix(CONTINUOUS)
    words = " ".join(WORDS.get(word, word) for word in plain.split("_"))
    words = words[:1].upper() + words[1:]
    return words, next((unit for form, unit in UNITS if re.fullmatch(form, plain)), "")


def path_words(path: str, longest: int = LONGEST) -> tuple[str, str]:
    """A varied number in words, and its unit where its path says it; a name or an expression stays as it is."""
    parts = path.split(".")
    if len(parts) == 1 or not re.fullmatch(r"[\w.+-]+", path):
        return path if len(path) <= longest else f"{path[: longest - 1]}\N{HORIZONTAL ELLIPSIS}", ""
    unit = LAST.get(parts[-1]) or next((INSIDE[part] for part in reversed(parts) if part in INSIDE), "")
    kept = parts
    while len(".".join(kept)) > longest and len(kept) > 2:
        kept = kept[1:]
    return ("" if kept == parts else "\N{HORIZONTAL ELLIPSIS}") + ".".join(kept), unit
