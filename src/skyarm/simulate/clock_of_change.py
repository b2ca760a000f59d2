"""The reference's own clock where the scenario changes in flight: another reference begins at the flight's time.

Another number of the same one, its guards' or its push's, leaves the clock where it stands.
"""

from __future__ import annotations

from typing import Any

from skyarm.records.leaves import blend, mismatch
from skyarm.scenario.in_flight import Overrides
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop_state import LoopState
from skyarm.simulate.pace_clock import Paces
from skyarm.simulate.path_clock import Waits


def is_other_reference(begun: Scenario, now: Overrides, before: Scenario, then: Overrides) -> bool:
    """Whether a change has put another reference in the place of the one before, as a whole.

    Args:
        begun: scenario with which the flight began.
        now: what holds in its place.
        before: scenario with which the flight began, as it was before the change.
        then: what held in its place.
    """
    parts, old = ([pair for pair in each.parts if pair[0].split(".")[0] == "reference"] for each in (now, then))
    return parts != old or (begun is not before and begun.trajectory != before.trajectory)


def clock_of_change(scenario: Scenario, first: LoopState, now: LoopState, *, anew: bool) -> Any:
    """The clock as it begins in the present period; () where the one before goes on, or where there is none.

    Args:
        scenario: after the change.
        first: its first loop state.
        now: the loop where the change came; it may be that of many lanes, of which some have ended.
        anew: the reference is another one.
    """
    other = mismatch(first.clock, now.clock, "clock")
    if first.clock == () or not (anew or other):
        return ()
    begun: Any = (Waits(scenario) if scenario.pause is None else Paces(scenario)).begun_at(now.ticks)
    return begun if other else blend(now.alive > 0.5, begun, now.clock)
