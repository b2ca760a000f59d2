"""What no settings of the study explain, said with its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.paper.agreement import digits, known
from skyarm.paper.published import printed

Cells = Mapping[str, Any]


def impossible(results: Mapping[str, Any], plant: str) -> list[str]:
    """One sentence for each thing that stays open, with the paper's numbers and ours under the inferred settings."""
    experiments = results.get("experiments", {})

    def ours(case: str, law: str, name: str) -> float | None:
        cell = experiments.get(case, {}).get(law, {}).get(name, {})
        return known(cell.get("inferred", {}).get(plant))

    def shown(case: str, law: str, name: str) -> str:
        value = ours(case, law, name)
        return "-" if value is None else digits(value)

    def both(case: str, law: str, name: str) -> str:
        return f"{printed(case, law, name)} (ours {shown(case, law, name)})"

    def ratio(name: str) -> str:
        pair = [ours(case, "CT", name) for case in ("case2", "case3")]
        paper = float(printed("case2", "CT", name)) / float(printed("case3", "CT", name))
        known_pair = [value for value in pair if value]
        found = f" (ours {known_pair[0] / known_pair[1]:.1f})" if len(known_pair) == 2 else ""
        return f"{paper:.1f} times{found}"

    return [
        "CT in Case 2 against CT in Case 3: the paper's joint errors are "
        f"{ratio('joint_error_mean')} in the mean and {ratio('joint_error_max')} at most as large, where reference, "
        "friction, latency and inertia scale by 1.33 to 1.5. No share of friction, latency or gain of the study gives "
        f"both; Case 2's peaks stay away too: pitch {both('case2', 'CT', 'peak_pitch')} rad, position "
        f"{both('case2', 'CT', 'peak_position')} m. They look like another build, or another run.",
        f"CT in Case 1: position {both('case1', 'CT', 'position_error_max')} and "
        f"{both('case1', 'CT', 'peak_position')} m. Torques of {both('case1', 'CT', 'tau1_rms')} N m speak for slow "
        f"ramps, pitch of {both('case1', 'CT', 'pitch_rms')} rad and joint errors up to "
        f"{both('case1', 'CT', 'joint_error_max')} rad for steps: one motion cannot be both.",
        f"The onset of the constant wind: CT pitches by {both('case3_wind', 'CT', 'peak_pitch')} rad, PD by "
        f"{both('case3_wind', 'PD', 'peak_pitch')} rad, in the same wind from the same hover.",
        f"PD's peak pitch of the first 8 s, {both('case2', 'PD', 'peak_pitch')} and "
        f"{both('case3', 'PD', 'peak_pitch')} rad, is that of a hover which it is about to leave: hundredths of a "
        f"second decide it. In Case 1, where PD joins later, {both('case1', 'PD', 'peak_pitch')} rad has no cause.",
        "Settling times: no rule for them is published. The paper's 10 s for CT is where the steady window begins, and "
        "in Case 3 it passes over the step back at 21 s that its own figure shows.",
    ]
