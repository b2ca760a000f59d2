"""Two rules about the flagship on the envelope, and the envelope of a law in a sentence, for the documentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.studies.compare.envelope_report import LEVELS, LOST, lost_at, within
from skyarm.view.pages import number

FLAGSHIP = "centroidal_tip"
"""The law that the two rules are about."""

PAPER_LAWS = ("paper_ct", "hybrid_computed_torque_tuned", "hybrid_computed_torque")
"""What it is measured against: the first of the paper's laws that flies."""

WORSE = 1.1
"""Times the error of the paper's law from which on the flagship violates the second rule."""


def violations(axes: Mapping[str, Any], flagship: str = FLAGSHIP) -> list[dict[str, Any]]:
    """Trials in which the flagship is lost and another law is not, or is over 10 % worse than the paper's law.

    Every plant of an axis of plants is a trial; those of a value that violate one rule are told together.
    """
    found = []
    for name, axis in axes.items():
        laws = axis["laws"]
        for k in range(len(laws.get(flagship, ()))):
            at = {"axis": name, "value": axis["values"][k], "unit": axis["unit"]}
            found += [{**at, **each} for each in violations_at({law: laws[law][k] for law in laws}, flagship)]
    return found


def violations_at(points: Mapping[str, Any], flagship: str) -> list[dict[str, Any]]:
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
    """The envelope of a law in a sentence: its range along each axis, and its limits.

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
    every = [f"all of {', '.join(whole)}"] if whole else []
    parts = [f"within {1e3 * level:g} mm: {'; '.join([', '.join(ends), *every] if ends else every) or 'nowhere'}"]
    parts += [f"never on {', '.join(never)}"] if never and (ends or whole) else []
    lost = [losses(name, axis, lost_at(axis["laws"][law])) for name, axis in flown.items()]
    return "; ".join([*parts, f"lost: {', '.join(words for words in lost if words) or 'nowhere'}"]) + "."


def losses(name: str, axis: Mapping[str, Any], gone: Sequence[int]) -> str:
    """From the first lost value on, or at single ones."""
    if not gone:
        return ""
    values = axis["values"]
    if len(gone) > 1 and list(gone) == list(range(gone[0], len(values))):
        where = f"from {values[gone[0]]:g}"
    else:
        where = "at " + " and ".join(f"{values[k]:g}" for k in gone)
    return f"{name.replace('_', ' ')} {where} {axis['unit']}"


def violation_rows(found: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A row for each violation: trial, rule, the flagship's error, the other law's."""
    rows = []
    for each in found:
        count = f" ({each['plants']} of the plants)" if "plants" in each else ""
        trial = f"{each['axis'].replace('_', ' ')} {each['value']:g} {each['unit']}{count}"
        lost = f"lost; not lost: {', '.join(each['kept_by'])}"
        rule = lost if each["rule"] == LOST else f"worse than {each['kept_by'][0]}"
        rows.append([trial, rule, number(each["own"], 1e3), number(each["other"], 1e3)])
    return rows
