"""What the flights of an envelope say, as plain data: where each law is good, where it ends, what is violated."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skyarm.compare.cells import Cell
from skyarm.compare.envelope_axes import OVERSHOOT, TIP, TIP_MAX, Axis
from skyarm.compare.envelope_setting import Setting

FLAGSHIP, PAPER_LAW = "centroidal_tip", "paper_ct"
"""The law that the two rules are about, and the one that it is measured against."""

WORSE = 1.1
"""Times the error of the paper's law from which on the flagship violates the second rule."""

GOOD = 0.010
"""m: a law is good as far as the tip stays within this in the mean."""

TILTED = math.radians(80.0)
"""rad: a flight that tilts further is lost, even where it comes to its end."""

JUDGED = {TIP: "tip, mean", OVERSHOOT: "overshoot"}
"""What the numbers of an axis are, in words."""


def points_of(cell: Cell, axis: Axis) -> list[dict[str, Any]]:
    """One record for each lane of a cell: errors in m, tilt in rad, the ending, whether the vehicle was lost."""
    found = []
    for k, status in enumerate(cell.status):
        numbers = {
            name: _finite(cell.metrics[metric][k])
            for name, metric in (("judged", axis.metric), ("tip_mean", TIP), ("tip_max", TIP_MAX), ("tilt", "tilt_max"))
        }
        lost = status != "completed" or numbers["judged"] is None or not (numbers["tilt"] or 0.0) <= TILTED
        found.append({**numbers, "status": str(status), "lost": bool(lost)})
    return found


def _finite(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def axis_record(axis: Axis, setting: Setting) -> dict[str, Any]:
    """An axis without its flights; values in the unit that is shown."""
    return {
        "title": axis.title,
        "unit": axis.unit,
        "values": [float(f"{value * axis.shown:.6g}") for value in axis.of(setting)],
        "judged": JUDGED[axis.metric],
        "noisy": axis.noisy,
        "window_s": [axis.start, setting.duration],
        "laws": {},
    }


def good_until(points: Sequence[Mapping[str, Any]]) -> int:
    """How many of the first values the law flies with an error within :data:`GOOD`."""
    count = 0
    for point in points:
        if point["lost"] or point["judged"] > GOOD:
            break
        count += 1
    return count


def lost_at(points: Sequence[Mapping[str, Any]]) -> list[int]:
    """Numbers of the values at which the law is lost."""
    return [k for k, point in enumerate(points) if point["lost"]]


def violations(axes: Mapping[str, Any], flagship: str = FLAGSHIP, other: str = PAPER_LAW) -> list[dict[str, Any]]:
    """Trials in which the flagship is lost and another law is not, or is over 10 % worse than the paper's law."""
    found = []
    for name, axis in axes.items():
        laws = axis["laws"]
        for k, point in enumerate(laws.get(flagship, ())):
            at = {"axis": name, "value": axis["values"][k], "unit": axis["unit"]}
            if point["lost"]:
                kept = [law for law, points in laws.items() if law != flagship and not points[k]["lost"]]
                if kept:
                    found.append({**at, "rule": "lost", "kept_by": kept, "own": point["judged"], "other": None})
                continue
            against = laws[other][k] if other in laws else None
            if against is not None and not against["lost"] and point["judged"] > WORSE * against["judged"]:
                numbers = {"own": point["judged"], "other": against["judged"]}
                found.append({**at, "rule": "worse", "kept_by": [other], **numbers})
    return found


def sentence(law: str, axes: Mapping[str, Any]) -> str:
    """The envelope of a law in a sentence: how far along each axis it is good, and from where on it is lost."""
    good, never, lost = [], [], []
    for name, axis in axes.items():
        points = axis["laws"].get(law)
        if not points:
            continue
        words, values, unit = name.replace("_", " "), axis["values"], axis["unit"]
        count = good_until(points)
        if count:
            good.append(f"{words} {_towards(values)} {values[count - 1]:g}{_rest(values, count)} {unit}")
        else:
            never.append(words)
        gone = lost_at(points)
        if gone:
            lost.append(f"{words} {_where(values, gone)} {unit}")
    parts = [f"within {1e3 * GOOD:g} mm: {', '.join(good) or 'nowhere'}"]
    parts += [f"beyond it from the first value on: {', '.join(never)}"] if never else []
    parts.append(f"lost: {', '.join(lost) or 'nowhere'}")
    return "; ".join(parts) + "."


def _towards(values: Sequence[float]) -> str:
    return "up to" if values[-1] >= values[0] else "down to"


def _rest(values: Sequence[float], count: int) -> str:
    """How far the axis was flown, where that is further."""
    return "" if count == len(values) else f" (of {values[-1]:g})"


def _where(values: Sequence[float], gone: Sequence[int]) -> str:
    """From the first lost value on, or at single ones."""
    if list(gone) == list(range(gone[0], len(values))):
        return f"at {values[-1]:g}" if len(gone) == 1 else f"from {values[gone[0]]:g}"
    return "at " + " and ".join(f"{values[k]:g}" for k in gone)
