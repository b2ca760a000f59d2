"""Results of an envelope as plain data: where each law is good, where it is lost, what is violated."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skyarm.compare.cells import Cell
from skyarm.compare.envelope_axes import OUTSIDE, OVERSHOOT, TIP, TIP_MAX, Axis
from skyarm.compare.envelope_setting import Setting

FLAGSHIP = "centroidal_tip"
"""The law that the two rules are about."""

PAPER_LAWS = ("paper_ct", "hybrid_computed_torque_tuned", "hybrid_computed_torque")
"""What it is measured against: the first of the paper's laws that flies."""

WORSE = 1.1
"""Times the error of the paper's law from which on the flagship violates the second rule."""

LEVELS = (0.010, 0.100)
"""m: how far along an axis the error stays within these says where a law is good and where it still serves."""

MEASURED = {"tip_mean": TIP, "tip_max": TIP_MAX, "outside": OUTSIDE, "tilt": "tilt_max"}
"""Key of a point -> metric, m, s and rad."""

NEAR = 0.020
"""m: a plant whose tip stays within this all through its window counts as held; the README's success."""

OF_PLANTS = f"plants that keep the tip within {1e3 * NEAR:g} mm, tip of all: median of means / largest"
"""The same of an axis of wrong plants."""

JUDGED = {TIP: "tip, mean / largest", OVERSHOOT: "overshoot of the base; time with the tip over 5 cm away"}
"""What the numbers of an axis are, in words."""


def points_of(cell: Cell, axis: Axis, values: int | None = None) -> list[dict[str, Any]]:
    """One record for each lane of a cell: errors in m, tilt in rad, the ending, whether the vehicle was lost.

    Of an axis of plants one for each of so many ``values``.
    """
    found = _lanes(cell, axis)
    if not axis.plants:
        return found
    count = len(found) // (values or 1)
    return [point_of_plants(found[k : k + count]) for k in range(0, len(found), count)]


def _lanes(cell: Cell, axis: Axis) -> list[dict[str, Any]]:
    found = []
    for k, status in enumerate(cell.status):
        numbers = {
            name: _finite(cell.metrics[metric][k]) for name, metric in (("judged", axis.metric), *MEASURED.items())
        }
        lost = not cell.flown[k] or numbers["judged"] is None
        found.append({**numbers, "status": str(status), "lost": bool(lost)})
    return found


def _finite(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def point_of_plants(flights: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One point from those of a value's plants.

    It is judged by the largest mean error of the plants that fly to their end, and lost where one plant is. Its mean
    is the median of the plants' means, all else the largest of theirs. ``plants`` has them one by one.
    """
    kept = [each for each in flights if not each["lost"]]
    found: dict[str, Any] = {key: _over(kept, key, max) for key in ("judged", "tip_max", "outside")}
    found |= {"tip_mean": _over(kept, "tip_mean", np.median), "tilt": _over(flights, "tilt", max)}
    gone = [each["status"] for each in flights if each["lost"]]
    held = sum(each["tip_max"] <= NEAR for each in kept)
    counts = {"of": len(flights), "held": held, "lost": len(gone)}
    each = [{"judged": one["judged"], "lost": one["lost"]} for one in flights]
    return {**found, "status": gone[0] if gone else "completed", "lost": bool(gone), "plants": {**counts, "each": each}}


def _over(flights: Sequence[Mapping[str, Any]], key: str, how: Any) -> float | None:
    numbers = [each[key] for each in flights if each[key] is not None]
    found = float(how(numbers)) if numbers else math.nan
    return found if math.isfinite(found) else None


def axis_record(axis: Axis, setting: Setting) -> dict[str, Any]:
    """An axis without its flights; values in the unit that is shown."""
    return {
        "title": axis.title,
        "unit": axis.unit,
        "values": [float(f"{value * axis.shown:.6g}") for value in axis.of(setting)],
        "judged": OF_PLANTS if axis.plants else JUDGED[axis.metric],
        "noisy": axis.noisy,
        "window_s": [axis.start, setting.duration],
        "laws": {},
    }


def within(points: Sequence[Mapping[str, Any]], level: float) -> int:
    """How many of the first values the law flies with an error within a level, m."""
    count = 0
    for point in points:
        if point["lost"] or point["judged"] > level:
            break
        count += 1
    return count


def lost_at(points: Sequence[Mapping[str, Any]]) -> list[int]:
    """Numbers of the values at which the law is lost."""
    return [k for k, point in enumerate(points) if point["lost"]]


def violations(axes: Mapping[str, Any], flagship: str = FLAGSHIP) -> list[dict[str, Any]]:
    """Trials in which the flagship is lost and another law is not, or is over 10 % worse than the paper's law.

    Every plant of an axis of plants is a trial; those of a value that violate one rule are told together.
    """
    found = []
    for name, axis in axes.items():
        laws = axis["laws"]
        for k in range(len(laws.get(flagship, ()))):
            at = {"axis": name, "value": axis["values"][k], "unit": axis["unit"]}
            found += [{**at, **each} for each in _violations_at({law: laws[law][k] for law in laws}, flagship)]
    return found


def _violations_at(points: Mapping[str, Any], flagship: str) -> list[dict[str, Any]]:
    """Violations of one value: at most one of each rule."""
    trials = {law: point["plants"]["each"] if "plants" in point else [point] for law, point in points.items()}
    paper = next((law for law in PAPER_LAWS if law in points), None)
    kept: dict[str, None] = {}
    lost, worse = [], []
    for k, own in enumerate(trials[flagship]):
        others = {law: flown[k] for law, flown in trials.items() if law != flagship and k < len(flown)}
        if own["lost"]:
            survive = [law for law, other in others.items() if not other["lost"]]
            kept |= dict.fromkeys(survive)
            lost += [k] if survive else []
        elif paper in others and not others[paper]["lost"] and own["judged"] > WORSE * others[paper]["judged"]:
            worse.append((own["judged"] / others[paper]["judged"], k))
    found: list[dict[str, Any]] = []
    if lost:
        found.append({"rule": "lost", "kept_by": list(kept), "own": None, "other": None})
    if worse:
        _, k = max(worse)
        own, other = (trials[law][k]["judged"] for law in (flagship, paper) if law)
        found.append({"rule": "worse", "kept_by": [paper], "own": own, "other": other})
    if "plants" in points[flagship]:
        counts = {"lost": len(lost), "worse": len(worse)}
        return [{**each, "plants": counts[each["rule"]]} for each in found]
    return found


def sentence(law: str, axes: Mapping[str, Any]) -> str:
    """The envelope of a law in a sentence: how far along each axis it is good, and where it is lost.

    Good is what is within the first level that the law reaches anywhere.
    """
    flown = {name: axis for name, axis in axes.items() if axis["laws"].get(law)}

    def counts(level: float) -> dict[str, int]:
        return {name: within(axis["laws"][law], level) for name, axis in flown.items()}

    level = next((level for level in LEVELS if any(counts(level).values())), LEVELS[-1])
    ends, whole, never = [], [], []
    for name, count in counts(level).items():
        values, words = axes[name]["values"], name.replace("_", " ")
        if count == len(values):
            whole.append(words)
        elif count:
            towards = "up to" if values[-1] >= values[0] else "down to"
            ends.append(f"{words} {towards} {values[count - 1]:g} {axes[name]['unit']}")
        else:
            never.append(words)
    parts = [f"within {1e3 * level:g} mm: {', '.join([*ends, *(f'all of {words}' for words in whole)]) or 'nowhere'}"]
    parts += [f"never on {', '.join(never)}"] if never and (ends or whole) else []
    lost = [_losses(name, axis, lost_at(axis["laws"][law])) for name, axis in flown.items()]
    return "; ".join([*parts, f"lost: {', '.join(words for words in lost if words) or 'nowhere'}"]) + "."


def _losses(name: str, axis: Mapping[str, Any], gone: Sequence[int]) -> str:
    """From the first lost value on, or at single ones."""
    if not gone:
        return ""
    values = axis["values"]
    if len(gone) > 1 and list(gone) == list(range(gone[0], len(values))):
        where = f"from {values[gone[0]]:g}"
    else:
        where = "at " + " and ".join(f"{values[k]:g}" for k in gone)
    return f"{name.replace('_', ' ')} {where} {axis['unit']}"
