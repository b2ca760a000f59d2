"""The envelope as tables: a map for each axis, what each law is good for, what violates the rules; a CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.compare.comparison_tables import DASH, markdown, number
from skyarm.compare.envelope_axes import TIP
from skyarm.compare.envelope_record import FLAGSHIP, JUDGED, LEVELS, WORSE, lost_at, within

LOST = "lost"

RULES = (
    "No trial in which the flagship is lost and another law is not; none in which its error is more than "
    f"{100.0 * (WORSE - 1.0):.0f} % larger than that of the paper's law."
)

MEANING = (
    "Errors are distances of the tip from where a level base on its reference would carry it: mean / largest, mm; of "
    "steps the base's overshoot. A law is lost where its flight ended early, tilted by over 80 degrees or "
    "was, in the mean over its last 5 s, over 0.5 m off."
)


def cell_text(point: Mapping[str, Any], judged: str) -> str:
    """Mean and largest error in mm; of a step overshoot in mm and time away in s; or that the vehicle was lost.

    Of wrong plants how many keep the tip and how many are lost, the median of their means and the largest error.
    """
    if "plants" in point:
        return _plants_text(point)
    if point["lost"]:
        return LOST
    first = number(1e3 * point["judged"])
    if judged == JUDGED[TIP]:
        return f"{first} / {number(1e3 * point['tip_max'])}"
    return f"{first}; {number(point['outside'])} s"


def _plants_text(point: Mapping[str, Any]) -> str:
    plants = point["plants"]
    told = [f"{plants['held']} of {plants['of']}"]
    if plants["lost"]:
        told.append(f"{plants['lost']} lost")
    if plants["lost"] < plants["of"]:
        told.append(f"{number(1e3 * point['tip_mean'])} / {number(1e3 * point['tip_max'])}")
    return "; ".join(told)


def axis_head(axis: Mapping[str, Any]) -> list[str]:
    """Names of the columns of an axis."""
    return ["law", *(f"{value:g} {axis['unit']}" for value in axis["values"])]


def axis_rows(axis: Mapping[str, Any]) -> list[list[str]]:
    """A row for each law."""
    return [[law, *(cell_text(point, axis["judged"]) for point in points)] for law, points in axis["laws"].items()]


def axis_title(name: str, axis: Mapping[str, Any]) -> str:
    """Name, what is flown, and with which sensors."""
    return f"{name.replace('_', ' ')}: {axis['title']}{', with noise' if axis['noisy'] else ''} ({axis['judged']}, mm)"


def reach_text(axis: Mapping[str, Any], points: Sequence[Mapping[str, Any]]) -> str:
    """Values up to which a law stays within each level, and where it is lost if anywhere."""
    values, gone = axis["values"], lost_at(points)
    counts = [within(points, level) for level in LEVELS]
    good = " / ".join(f"{values[count - 1]:g}" if count else DASH for count in counts)
    return f"{good}, lost at {', '.join(f'{values[k]:g}' for k in gone)}" if gone else good


def summary_rows(axes: Mapping[str, Any], laws: Sequence[str]) -> list[list[str]]:
    """A row for each axis: what it is, its range, and of each law how far it is good and where it is lost."""
    rows = []
    for name, axis in axes.items():
        values, unit = axis["values"], axis["unit"]
        span = f"{values[0]:g} to {values[-1]:g} {unit}"
        cells = [reach_text(axis, axis["laws"][law]) if law in axis["laws"] else DASH for law in laws]
        rows.append([f"{name.replace('_', ' ')}, {span}", *cells])
    return rows


def summary_head(laws: Sequence[str]) -> list[str]:
    """Names of its columns."""
    levels = " / ".join(f"{1e3 * level:g}" for level in LEVELS)
    return [f"within {levels} mm up to", *laws]


def violation_rows(found: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A row for each violation: trial, rule, the flagship's error, the other law's."""
    rows = []
    for each in found:
        count = f" ({each['plants']} of the plants)" if "plants" in each else ""
        trial = f"{each['axis'].replace('_', ' ')} {each['value']:g} {each['unit']}{count}"
        if each["rule"] == LOST:
            rows.append([trial, f"lost; not lost: {', '.join(each['kept_by'])}", DASH, DASH])
        else:
            words = f"worse than {each['kept_by'][0]}"
            rows.append([trial, words, number(1e3 * each["own"]), number(1e3 * each["other"])])
    return rows


NO_FLAGSHIP, NO_VIOLATION = f"Not known: {FLAGSHIP} did not fly.", "None."


def no_violation(laws: Sequence[str]) -> str:
    """What stands in place of a table of violations."""
    return NO_VIOLATION if FLAGSHIP in laws else NO_FLAGSHIP


VIOLATION_HEAD = ["trial", "rule", "flagship, mm", "other, mm"]


def envelope_report(found: Mapping[str, Any]) -> str:
    """Every table as Markdown, under the vehicle's name."""
    axes, laws = found["axes"], found["laws"]
    parts = [f"# The envelope of {found['vehicle']}", MEANING]
    parts += [f"**{law}** keeps the tip {words}" for law, words in found["sentences"].items()]
    parts += [f"{law} does not fly: {why}" for law, why in found["not_flown"].items()]
    parts += [markdown(summary_head(laws), summary_rows(axes, laws))]
    for name, axis in axes.items():
        parts += [f"## {axis_title(name, axis)}", markdown(axis_head(axis), axis_rows(axis))]
    parts += ["## Violations", RULES]
    rows = violation_rows(found["violations"])
    parts.append(markdown(VIOLATION_HEAD, rows) if rows else no_violation(laws))
    return "\n\n".join(parts) + "\n"


COLUMNS = (
    "axis",
    "value",
    "unit",
    "law",
    "judged_by",
    "judged_mm",
    "tip_mean_mm",
    "tip_max_mm",
    "outside_s",
    "tilt_deg",
    "plants",
    "plants_held",
    "plants_lost",
)


def envelope_csv(found: Mapping[str, Any]) -> str:
    """One row for each flight."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow((*COLUMNS, "status", "lost"))
    for name, axis in found["axes"].items():
        for law, points in axis["laws"].items():
            for value, point in zip(axis["values"], points, strict=True):
                numbers = [_scaled(point[key], 1e3) for key in ("judged", "tip_mean", "tip_max")]
                tilt = _scaled(point["tilt"], 57.29577951308232)
                numbers.append(_scaled(point["outside"], 1.0))
                plants = point.get("plants", {})
                counts = [plants.get(key, "") for key in ("of", "held", "lost")]
                fixed = (name, f"{value:g}", axis["unit"], law, axis["judged"])
                writer.writerow((*fixed, *numbers, tilt, *counts, point["status"], int(point["lost"])))
    return stream.getvalue()


def _scaled(value: float | None, factor: float) -> str:
    return "" if value is None else f"{value * factor:.6g}"
