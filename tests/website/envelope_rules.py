"""Two rules about the flagship on the envelope, for the documentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.studies.compare.envelope import LOST
from skyarm.studies.compare.envelope_axes import axis_words
from skyarm.view.pages import number

FLAGSHIP = "centroidal_tip"
"""The law that the two rules are about."""

PAPER_LAWS = ("paper_ct", "hybrid_computed_torque_tuned", "hybrid_computed_torque")
"""What it is measured against: the first of the paper's laws that flies."""

WORSE = 1.1
"""Times the error of the paper's law from which on the flagship violates the second
rule."""


def violations(
    axes: Mapping[str, Any], flagship: str = FLAGSHIP
) -> list[dict[str, Any]]:
    """Trials in which the flagship is lost and another law is not, or is over 10 %
    worse than the paper's law.

    Every plant of an axis of plants is a trial; those of a value that violate one rule
    are told together.
    """
    found = []
    for name, axis in axes.items():
        laws = axis["laws"]
        for k in range(len(laws.get(flagship, ()))):
            at = {"axis": name, "value": axis["values"][k], "unit": axis["unit"]}
            found += [
                {**at, **each}
                for each in violations_at({law: laws[law][k] for law in laws}, flagship)
            ]
    return found


def violations_at(points: Mapping[str, Any], flagship: str) -> list[dict[str, Any]]:
    """Violations of one value: at most one of each rule."""
    trials = {
        law: point["plants"]["each"] if "plants" in point else [point]
        for law, point in points.items()
    }
    paper = next((law for law in PAPER_LAWS if law in points), None)
    kept: dict[str, None] = {}
    lost, worse = [], []
    for k, own in enumerate(trials[flagship]):
        others = {
            law: flown[k]
            for law, flown in trials.items()
            if law != flagship and k < len(flown)
        }
        if own["lost"]:
            survive = [law for law, other in others.items() if not other["lost"]]
            kept |= dict.fromkeys(survive)
            lost += [k] if survive else []
        elif (
            paper in others
            and not others[paper]["lost"]
            and own["judged"] > WORSE * others[paper]["judged"]
        ):
            worse.append((own["judged"] / others[paper]["judged"], k))
    found: list[dict[str, Any]] = []
    if lost:
        found.append(
            {"rule": "lost", "kept_by": list(kept), "own": None, "other": None}
        )
    if worse:
        _, k = max(worse)
        own, other = (trials[law][k]["judged"] for law in (flagship, paper) if law)
        found.append({"rule": "worse", "kept_by": [paper], "own": own, "other": other})
    if "plants" in points[flagship]:
        counts = {"lost": len(lost), "worse": len(worse)}
        return [{**each, "plants": counts[each["rule"]]} for each in found]
    return found


def violation_rows(found: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A row for each violation: trial, rule, the flagship's error, the other law's."""
    rows = []
    for each in found:
        count = f" ({each['plants']} of the plants)" if "plants" in each else ""
        trial = f"{axis_words(each['axis'])} {each['value']:g} {each['unit']}{count}"
        lost = f"lost; not lost: {', '.join(each['kept_by'])}"
        rule = lost if each["rule"] == LOST else f"worse than {each['kept_by'][0]}"
        rows.append([trial, rule, number(each["own"], 1e3), number(each["other"], 1e3)])
    return rows
